//! Solutions and tables that are kept for the next command, so that a voltage or a grain can be changed without solving again.
//!
//! A kept file holds what it is, the digest of everything it depends on, its content, and a digest of all that. A file of
//! another case, of another version, or damaged is passed over: the work is done again.
//!
//! What is stored, and how, the types themselves say with serde: the solution with whatever its charges are, the table.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::case::Case;
use crate::output::OutputFolder;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::{Plan, Tabulated};
use crate::pipeline::{Failure, memory};

/// Name of the kept solution within the output folder.
pub const SOLUTION: &str = "cache/solution.bin";

/// Name of the kept table within the output folder.
pub const TABLE: &str = "cache/table.bin";

/// Tables larger than this are made anew: reading them would take as long.
const LARGEST_TABLE: u64 = 2 << 30;

/// Raised when the same case gives other numbers than before, or the stored form changes.
const EDITION: u32 = 4;

/// A digest: of what a file depends on, or of its content.
pub type Digest = [u8; 32];

/// What a file holds; it opens with these words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Solution,
    Table,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Solution => SOLUTION,
            Self::Table => TABLE,
        }
    }

    fn magic(self) -> String {
        let what = match self {
            Self::Solution => "solution",
            Self::Table => "table",
        };
        format!("graintrap {what} {EDITION} of {}\n", env!("CARGO_PKG_VERSION"))
    }
}

/// The digest of some bytes in parts.
pub(crate) fn digest(parts: &[&[u8]]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    *hasher.finalize().as_bytes()
}

/// Everything that a solution depends on: electrodes, how the field is computed, sources. Voltages, charges and grains are not
/// among it.
pub fn solution_key(case: &Case) -> Digest {
    let parts = case.parts();
    digest(&[parts.geometry.as_bytes(), parts.sources.as_bytes()])
}

/// Everything that a table depends on: its solution, its settings, its box and how small its bricks are beside conductors.
pub fn table_key(case: &Case, plan: &Plan) -> Digest {
    let (min, max) = (plan.options.min, plan.options.max);
    let numbers = min
        .iter()
        .chain(max.iter())
        .flat_map(|x| x.to_le_bytes())
        .chain([plan.halvings, u8::from(plan.options.smooth)]);
    let numbers: Vec<u8> = numbers.collect();
    digest(&[&solution_key(case), case.parts().table.as_bytes(), &numbers])
}

/// Why a file that is there is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unusable {
    /// Not a file of this program, or not of this version of it.
    #[error("was written by another version")]
    Foreign,
    /// Cut short, or changed since it was written.
    #[error("is damaged")]
    Damaged,
    /// It would fill the memory.
    #[error("is larger than the memory that is free")]
    TooLarge,
}

/// Where solutions and tables are kept.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    shared: bool,
    fresh: bool,
}

impl Cache {
    /// In an output folder: the last solution and the last table. `fresh`: nothing is read.
    pub fn of_output(folder: &Path, fresh: bool) -> Self {
        Self { folder: folder.to_owned(), shared: false, fresh }
    }

    /// In a folder that many cases share: every solution and every table that was ever kept there, by their digests.
    pub fn shared(folder: &Path, fresh: bool) -> Self {
        Self { folder: folder.to_owned(), shared: true, fresh }
    }

    /// Makes a shared folder if need be: better to know now than after the work.
    ///
    /// # Errors
    /// It cannot be made or written to.
    pub fn prepare(&self) -> Result<(), Failure> {
        if !self.shared {
            return Ok(());
        }
        let probe = self.folder.join(format!(".probe-{}.partial", std::process::id()));
        let made =
            fs::create_dir_all(&self.folder).and_then(|()| File::create(&probe)).map(|_| fs::remove_file(&probe));
        made.map(|_| ()).map_err(|error| {
            let reason = error.to_string();
            let reason = reason.split(" (os error").next().unwrap_or_default().to_lowercase();
            let problem = format!("the cache folder {} cannot be written: {reason}", self.folder.display());
            Failure::run(problem, "give another one with --cache DIR, or none")
        })
    }

    fn path(&self, kind: Kind, key: &Digest) -> PathBuf {
        let file = self.folder.join(kind.name());
        if !self.shared {
            return file;
        }
        let short: String = key.iter().take(16).map(|byte| format!("{byte:02x}")).collect();
        let name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        self.folder.join(format!("{short}.{name}"))
    }

    /// The kept solution of a case, if there is one.
    ///
    /// # Errors
    /// The file, and why it is of no use.
    pub fn solution(&self, case: &Case) -> Result<Option<Solution>, (PathBuf, Unusable)> {
        let read = self.read::<Solution>(Kind::Solution, &solution_key(case));
        Ok(read?.map(|solution| Solution { kept: true, ..solution }))
    }

    /// The kept table of a case, if there is one.
    ///
    /// # Errors
    /// The file, and why it is of no use.
    pub fn table(&self, case: &Case, plan: &Plan) -> Result<Option<Tabulated>, (PathBuf, Unusable)> {
        let key = table_key(case, plan);
        let Some(tabulated) = self.read::<Tabulated>(Kind::Table, &key)? else { return Ok(None) };
        // What the digest vouches for was written by us; still, whoever uses a table relies on its lengths.
        if !tabulated.table.is_whole() {
            return Err((self.path(Kind::Table, &key), Unusable::Damaged));
        }
        Ok(Some(Tabulated { kept: true, ..tabulated }))
    }

    /// Keeps a solution and its table, as far as they are new.
    ///
    /// # Errors
    /// The output fails.
    pub fn write(
        &self,
        out: &mut OutputFolder,
        case: &Case,
        solution: &Solution,
        table: Option<(&Plan, &Tabulated)>,
    ) -> Result<(), Failure> {
        self.write_solution(out, case, solution)?;
        match table {
            Some((plan, tabulated)) => self.write_table(out, case, plan, tabulated),
            None => Ok(()),
        }
    }

    /// Keeps a solution if it is new.
    ///
    /// # Errors
    /// The output fails.
    pub fn write_solution(&self, out: &mut OutputFolder, case: &Case, solution: &Solution) -> Result<(), Failure> {
        if solution.kept {
            return Ok(());
        }
        self.write_one(out, Kind::Solution, &solution_key(case), solution)
    }

    /// Keeps a table if it is new and no larger than is worth reading again.
    ///
    /// # Errors
    /// The output fails.
    pub fn write_table(
        &self,
        out: &mut OutputFolder,
        case: &Case,
        plan: &Plan,
        tabulated: &Tabulated,
    ) -> Result<(), Failure> {
        if tabulated.kept || tabulated.report.bytes > LARGEST_TABLE {
            return Ok(());
        }
        self.write_one(out, Kind::Table, &table_key(case, plan), tabulated)
    }

    fn write_one(
        &self,
        out: &mut OutputFolder,
        kind: Kind,
        key: &Digest,
        value: &impl Serialize,
    ) -> Result<(), Failure> {
        let content = |w: &mut dyn Write| store(w, kind, key, value);
        if !self.shared {
            return out.write_unlisted(kind.name(), content);
        }
        let path = self.path(kind, key);
        write_whole(&path, content).map_err(|error| {
            Failure::run(
                format!("{} cannot be written: {error}", path.display()),
                "give another folder with --cache DIR, or none",
            )
        })
    }

    fn read<T: DeserializeOwned>(&self, kind: Kind, key: &Digest) -> Result<Option<T>, (PathBuf, Unusable)> {
        if self.fresh {
            return Ok(None);
        }
        let path = self.path(kind, key);
        // A file that cannot be opened is none.
        let Ok(file) = File::open(&path) else { return Ok(None) };
        restore(file, kind, key).map_err(|why| (path, why))
    }
}

/// Writes a file under another name first, so that no other process sees half of it.
fn write_whole(path: &Path, content: impl FnOnce(&mut dyn Write) -> Result<(), String>) -> Result<(), String> {
    let words = |error: io::Error| error.to_string();
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(words)?;
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = path.with_file_name(format!(".{name}.{}.partial", std::process::id()));
    let written = (|| {
        let mut out = io::BufWriter::new(File::create(&temporary).map_err(words)?);
        content(&mut out)?;
        out.flush().map_err(words)?;
        fs::rename(&temporary, path).map_err(words)
    })();
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Passes on what is written and digests it.
struct Digesting<'a> {
    out: &'a mut dyn Write,
    hasher: blake3::Hasher,
}

impl Write for Digesting<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn store(out: &mut dyn Write, kind: Kind, key: &Digest, value: &impl Serialize) -> Result<(), String> {
    // Numbers one by one are no food for a hasher.
    let mut out = io::BufWriter::with_capacity(1 << 16, Digesting { out, hasher: blake3::Hasher::new() });
    let words = |error: io::Error| error.to_string();
    out.write_all(kind.magic().as_bytes()).map_err(words)?;
    out.write_all(key).map_err(words)?;
    let out = postcard::to_io(value, out).map_err(|error| error.to_string())?;
    let Digesting { out, hasher } = out.into_inner().map_err(|error| error.to_string())?;
    out.write_all(hasher.finalize().as_bytes()).map_err(words)
}

/// What a file holds if it is of that key; `None` if it is of another one.
fn restore<T: DeserializeOwned>(mut file: File, kind: Kind, key: &Digest) -> Result<Option<T>, Unusable> {
    let damaged = |_| Unusable::Damaged;
    let magic = kind.magic();
    let mut head = vec![0; magic.len()];
    let length = file.metadata().map_err(damaged)?.len();
    file.read_exact(&mut head).map_err(damaged)?;
    if head != magic.as_bytes() {
        return Err(Unusable::Foreign);
    }
    let mut of = [0; 32];
    file.read_exact(&mut of).map_err(damaged)?;
    if of != *key {
        return Ok(None);
    }
    // The bytes and what they become.
    if length > memory::available() / 2 {
        return Err(Unusable::TooLarge);
    }
    let mut rest = Vec::new();
    file.read_to_end(&mut rest).map_err(damaged)?;
    let (content, found) = rest.split_at_checked(rest.len().wrapping_sub(32)).ok_or(Unusable::Damaged)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(&head).update(&of).update(content);
    if found != hasher.finalize().as_bytes() {
        return Err(Unusable::Damaged);
    }
    match postcard::take_from_bytes(content) {
        Ok((value, [])) => Ok(Some(value)),
        _ => Err(Unusable::Damaged),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASE: &str = r#"
[[electrode]]
name   = "ball"
shape  = "sphere"
radius = "1 cm"

[[source]]
name   = "spot"
kind   = "point"
charge = "1 fC"
center = [0, 0, 1]

[[grains]]
count  = 3
mass   = "1e-12 kg"
charge = "1 fC"
place  = { kind = "ball", center = [0, 0, "5 cm"], radius = "1 mm" }

[trace]
duration = "1 ms"
"#;

    fn case(sets: &[&str]) -> Case {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        Case::parse("case.toml", CASE, &sets).unwrap().0
    }

    #[test]
    fn a_solution_depends_on_what_makes_the_field_and_on_nothing_else() {
        let key = solution_key(&case(&[]));
        for set in [
            "electrode.ball.dc=3 V",
            "electrode.ball.charge=1 fC",
            "source.spot.charge=2 fC",
            "grains.1.count=7",
            "grains.1.place.radius=2 mm",
            "trace.duration=2 ms",
            "forces.coulomb=true",
            "table.accuracy=1e-2",
            "output.field_nodes=10",
        ] {
            assert_eq!(solution_key(&case(&[set])), key, "{set}");
        }
        for set in [
            "electrode.ball.radius=2 cm",
            "electrode.ball.center=[0, 0, 0.1]",
            "electrode.ball.panels=100",
            "electrode.ball.name=other",
            "field.accuracy=1e-2",
            "field.panels=100",
            "field.max_panels=100",
            "field.solver=dense",
            "field.method=collocation",
            "source.spot.center=[0, 0, 2]",
        ] {
            assert_ne!(solution_key(&case(&[set])), key, "{set}");
        }
    }

    #[test]
    fn what_is_kept_comes_back_or_is_refused() {
        let folder = std::env::temp_dir().join(format!("graintrap-cache-{}", std::process::id()));
        let path = folder.join("file");
        let (key, value) = ([7; 32], vec![1.5_f64, f64::MIN_POSITIVE, -0.0]);
        write_whole(&path, |w| store(w, Kind::Table, &key, &value)).unwrap();
        let read = |kind, key: &Digest| restore::<Vec<f64>>(File::open(&path).unwrap(), kind, key);
        let back = read(Kind::Table, &key).unwrap().unwrap();
        assert!(back.iter().zip(&value).all(|(a, b)| a.to_bits() == b.to_bits()) && back.len() == value.len());
        assert_eq!(read(Kind::Table, &[8; 32]), Ok(None));
        assert_eq!(read(Kind::Solution, &key), Err(Unusable::Foreign));

        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            fs::write(&path, bytes).unwrap();
            assert!(!matches!(read(Kind::Table, &key), Ok(Some(_))), "byte {at}");
            fs::write(&path, &whole[..at]).unwrap();
            assert!(read(Kind::Table, &key).is_err(), "cut at {at}");
        }
        // A list of numbers without end, under digests that are right.
        let endless = [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01];
        let mut bytes = [Kind::Table.magic().as_bytes(), &key, &endless].concat();
        bytes.extend(blake3::hash(&bytes).as_bytes());
        fs::write(&path, bytes).unwrap();
        assert_eq!(read(Kind::Table, &key), Err(Unusable::Damaged));
        fs::remove_dir_all(folder).unwrap();
    }
}
