//! Files that a case refers to: tables of numbers, meshes.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use meshes::Vec3;

use super::at::At;
use crate::case::{ImportedMesh, MeshFormat};
use crate::case_source::reason;
use crate::error::CaseError;
use crate::quantity::{Kind, parse};
use crate::suggestion::nearest;

/// Opens a file named in the case; relative paths start from the case file's folder.
fn open(at: &At, file: &str) -> Result<(PathBuf, File), CaseError> {
    if file.trim().is_empty() {
        return Err(at.error("{value} names no file", "write its path, relative to the case file"));
    }
    let path = at.source.folder().join(file);
    let opened = File::open(&path).and_then(|opened| {
        // A folder opens too, and fails only when read.
        if opened.metadata()?.is_dir() { Err(std::io::Error::other("it is a folder")) } else { Ok(opened) }
    });
    opened.map(|opened| (path.clone(), opened)).map_err(|error| {
        let mut help = format!("looked for {}; paths start from the folder of the case file", path.display());
        if let Some(name) = similar(&path) {
            help = format!("did you mean \"{}\"? ({help})", Path::new(file).with_file_name(name).display());
        }
        at.error(format!("{{value}} cannot be read: {}", reason(&error)), help)
    })
}

/// A file beside the missing one with nearly its name.
fn similar(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name != wanted)
        .collect();
    names.sort();
    nearest(wanted, names)
}

/// The rows of a CSV file, each with one of the allowed numbers of columns. A header line may stand first; lines that begin
/// with `#` are comments.
fn rows(at: &At, file: &str, columns: &[&[&str]]) -> Result<Vec<(u64, Vec<f64>)>, CaseError> {
    let (path, opened) = open(at, file)?;
    let shown = path.display();
    let named: Vec<String> = columns.iter().map(|names| names.join(",")).collect();
    let takes = format!("its columns are {}", named.join(" or "));
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(std::io::BufReader::new(opened));
    let mut rows: Vec<(u64, Vec<f64>)> = Vec::new();
    let mut first = true;
    for record in reader.records() {
        let record = record.map_err(|error| match error.kind() {
            csv::ErrorKind::Utf8 { pos, .. } => {
                let line = pos.as_ref().map_or(String::new(), |pos| format!(":{}", pos.line()));
                at.error(format!("{shown}{line} is not UTF-8 text"), &*takes)
            }
            _ => at.error(format!("{shown} cannot be read: {error}"), &*takes),
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let is_word = |field: &str| field.parse::<f64>().is_err() && field.starts_with(char::is_alphabetic);
        let is_header = first && record.iter().all(is_word);
        first = false;
        if is_header {
            in_order(&record, columns).map_err(|found| {
                at.error(format!("{shown}:{line} names the columns {found}"), format!("put them in order: {takes}"))
            })?;
            continue;
        }
        let expected = match rows.first() {
            Some((_, row)) => columns.iter().find(|names| names.len() == row.len()),
            None => columns.iter().find(|names| names.len() == record.len()),
        };
        let Some(names) = expected.filter(|names| names.len() == record.len()) else {
            let found = record.len();
            let found = if found == 1 { "1 column".to_owned() } else { format!("{found} columns") };
            let help = match record.iter().next() {
                Some(field) if found == "1 column" && field.contains([';', '\t', ' ']) => {
                    format!("separate the columns by commas; {takes}")
                }
                _ => takes.clone(),
            };
            let wanted = match expected {
                Some(names) => format!("{} like the lines above", names.len()),
                None => columns.iter().map(|names| names.len().to_string()).collect::<Vec<_>>().join(" or "),
            };
            return Err(at.error(format!("{shown}:{line} has {found}, expected {wanted}"), help));
        };
        let row = record
            .iter()
            .zip(*names)
            .enumerate()
            .map(|(n, (field, name))| match field.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                found => {
                    let why = match found {
                        Ok(value) if value.is_nan() => "not a number",
                        Ok(_) => "not finite",
                        Err(_) if field.is_empty() => "empty",
                        Err(_) => "not a number",
                    };
                    let problem = match why {
                        "empty" => format!("{shown}:{line}, column {} ({name}) is empty", n + 1),
                        why => format!("{shown}:{line}, column {} ({name}) is \"{field}\": {why}", n + 1),
                    };
                    Err(at.error(problem, format!("write numbers in SI, without units; {takes}")))
                }
            })
            .collect::<Result<Vec<f64>, CaseError>>()?;
        rows.push((line, row));
    }
    if rows.is_empty() {
        return Err(at.error(format!("{shown} holds no numbers"), takes));
    }
    Ok(rows)
}

/// Whether a header that has the names of the columns has them in order; its own words for them are fine.
fn in_order(header: &csv::StringRecord, columns: &[&[&str]]) -> Result<(), String> {
    let word = |field: &str| {
        let end = field.find(|c: char| !c.is_alphanumeric()).unwrap_or(field.len());
        field[..end].to_lowercase()
    };
    let found: Vec<String> = header.iter().map(word).collect();
    let shuffled = |names: &&[&str]| {
        let mut sorted: [Vec<&str>; 2] = [names.to_vec(), found.iter().map(String::as_str).collect()];
        sorted.iter_mut().for_each(|names| names.sort_unstable());
        sorted[0] == sorted[1] && found != **names
    };
    if columns.iter().any(shuffled) { Err(found.join(",")) } else { Ok(()) }
}

/// Times and values of a sampled waveform.
pub(super) fn samples(at: &At, file: &str, repeat: bool) -> Result<(Vec<f64>, Vec<f64>), CaseError> {
    let rows = rows(at, file, &[&["time", "value"]])?;
    let shown = at.source.folder().join(file);
    if let Some(pair) = rows.windows(2).find(|pair| pair[1].1[0] <= pair[0].1[0]) {
        let (line, time, before) = (pair[1].0, pair[1].1[0], pair[0].1[0]);
        let problem =
            format!("{}:{line}: time {time} s does not come after {before} s in the line above", shown.display());
        return Err(
            at.error(problem, "times must increase from line to line; write a jump as two times close together")
        );
    }
    if repeat && rows.len() < 2 {
        let problem = format!("{} has one sample: it has no period to repeat", shown.display());
        return Err(at.error(problem, "add samples, or leave out `repeat`"));
    }
    Ok(rows.iter().map(|(_, row)| (row[0], row[1])).unzip())
}

/// Positions of grains, m, and their velocities, m/s, if the file has them.
pub(super) fn grains(at: &At, file: &str) -> Result<(Vec<Vec3>, Option<Vec<Vec3>>), CaseError> {
    let rows = rows(at, file, &[&["x", "y", "z"], &["x", "y", "z", "vx", "vy", "vz"]])?;
    let points = rows.iter().map(|(_, row)| Vec3::new(row[0], row[1], row[2])).collect();
    let moving = rows.first().is_some_and(|(_, row)| row.len() == 6);
    let velocities = moving.then(|| rows.iter().map(|(_, row)| Vec3::new(row[3], row[4], row[5])).collect());
    Ok((points, velocities))
}

/// Formats by extension.
const FORMATS: [(&str, MeshFormat); 6] = [
    ("msh", MeshFormat::Gmsh),
    ("stl", MeshFormat::Stl),
    ("vtu", MeshFormat::Vtu),
    ("vtk", MeshFormat::Vtk),
    ("obj", MeshFormat::Obj),
    ("ply", MeshFormat::Ply),
];

/// A surface from a file: its format, unit and hash. The triangles are read when the electrodes are built.
pub(super) fn mesh(
    electrode: &At,
    file: &str,
    group: Option<&str>,
    unit: Option<&str>,
    closed: bool,
) -> Result<ImportedMesh, CaseError> {
    let at = electrode.key("file");
    let extension = Path::new(file).extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let Some((_, format)) = FORMATS.iter().find(|(known, _)| *known == extension) else {
        let known = FORMATS.map(|(known, _)| format!(".{known}"));
        let problem = format!("{{value}} is no mesh file: expected {}", crate::suggestion::list(&known, "or"));
        return Err(at.error(problem, "the format is told by the file's extension"));
    };
    if group.is_some_and(|group| group.trim().is_empty()) {
        return Err(electrode.key("group").error("{value} names no group", "leave `group` out to take the whole file"));
    }
    let (path, mut opened) = open(&at, file)?;
    let digest = digest(&mut opened).map_err(|error| {
        at.error(format!("{{value}} cannot be read: {}", reason(&error)), path.display().to_string())
    })?;
    let scale = match unit {
        None => 1.0,
        Some(unit) => match parse(&format!("1 {unit}"), &[Kind::Length]) {
            Ok((scale, _)) => scale,
            Err(error) => {
                let nearest = error.help().filter(|help| help.starts_with("did you mean")).map(str::to_owned);
                let help = nearest.unwrap_or("write \"mm\" if the file's coordinates are in millimetres".to_owned());
                let problem = "{value} is not a unit of length: expected \"m\", \"mm\", \"um\" or the like";
                return Err(electrode.key("unit").error(problem, help));
            }
        },
    };
    Ok(ImportedMesh { path, format: *format, group: group.map(str::to_owned), scale, closed, digest })
}

/// FNV-1a, 64 bits (Fowler, Noll and Vo). It guards against forgetting a changed file, not against malice.
fn digest(file: &mut impl Read) -> std::io::Result<String> {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let hash = bytes.iter().fold(OFFSET, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME));
    Ok(format!("{hash:016x}"))
}

#[cfg(test)]
mod tests {
    #[test]
    fn digest_has_the_published_value() {
        // The test vector of the authors for "foobar".
        assert_eq!(super::digest(&mut b"foobar".as_slice()).unwrap(), "85944171f73967e8");
    }
}
