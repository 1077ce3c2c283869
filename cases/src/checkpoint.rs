//! Where flights stand, kept in a file: a run that was stopped, killed or cut off goes on from there.
//!
//! The file holds what it is, the digest of everything that the flights depend on, and frames one after the other, each with its
//! length and its digest. A frame is added when a block of grains says where it is; none is ever changed. A run that is killed
//! while it writes leaves half a frame at the end, which is cut off; the bits of the flights are the same from whichever
//! frame they go on.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracer::{Frame, Journal, Standing};

use crate::cache::{Digest, digest};
use crate::case::Case;
use crate::output::folder::plain;
use crate::pipeline::Failure;

/// Name of the file within the output folder.
pub const CHECKPOINT: &str = "checkpoint.bin";

/// Raised when the same case flies otherwise than before, or the stored form changes.
const EDITION: u32 = 2;

/// Time between frames of a block when the case does not say: what a person can afford to lose.
pub const INTERVAL: Duration = Duration::from_secs(10);

/// The interval is no less than this part of the time that has passed, so that the file of a run of days stays small.
const SHARE: f64 = 0.01;

/// Bytes of a frame's digest that are kept: enough to tell that it is whole.
const SEAL: usize = 16;

fn magic() -> String {
    format!("graintrap checkpoint {EDITION} of {}\n", env!("CARGO_PKG_VERSION"))
}

/// Everything that flights depend on: the whole case but its title and what may be kept between its runs.
fn key(case: &Case) -> Digest {
    let parts = case.parts();
    digest(
        &[&parts.geometry, &parts.sources, &parts.table, &parts.starts, &parts.drives, &parts.grains]
            .map(|p| p.as_bytes()),
    )
}

/// What is left of an earlier run.
#[derive(Debug, Default)]
pub struct Left {
    /// Where its grains stood.
    pub standing: Standing,
    /// Bytes of the file up to the last whole frame.
    whole: u64,
    /// Something the user should know.
    pub remark: Option<String>,
}

/// Reads what an earlier run of the same case left in a folder; `None` if there is no such file.
///
/// # Errors
/// The file is of another case or another version, or is no such file: what it knows cannot go on.
pub fn left(folder: &Path, case: &Case) -> Result<Option<Left>, Failure> {
    let path = folder.join(CHECKPOINT);
    let mut file = match File::open(&path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(unusable(&path, format!("cannot be read: {}", plain(&error)))),
    };
    let failed = |error: io::Error| unusable(&path, format!("cannot be read: {}", plain(&error)));
    let (magic, length) = (magic(), file.metadata().map_err(failed)?.len());
    let mut head = vec![0; magic.len() + size_of::<Digest>()];
    // A run that was killed before its first frame.
    if length < head.len() as u64 {
        return Ok(None);
    }
    file.read_exact(&mut head).map_err(failed)?;
    if head[..magic.len()] != *magic.as_bytes() {
        return Err(unusable(&path, "is damaged, or was written by another version".to_owned()));
    }
    if head[magic.len()..] != key(case) {
        let problem = "is of another case: electrodes, voltages, grains or settings were changed since".to_owned();
        return Err(unusable(&path, problem));
    }
    let mut found = Left { whole: head.len() as u64, ..Left::default() };
    let mut file = io::BufReader::new(file);
    while found.whole < length {
        match frame(&mut file, length - found.whole) {
            Ok((frame, bytes)) => {
                found.standing.add(frame);
                found.whole += bytes;
            }
            // The last frame, cut short: so ends every run that is killed while it writes.
            Err(Broken::Short) => break,
            Err(Broken::Damaged) => {
                let share = 100.0 * found.whole as f64 / length as f64;
                found.remark = Some(format!(
                    "{} is damaged: the flights go on from its sound part, the first {share:.0} %",
                    path.display()
                ));
                break;
            }
        }
    }
    Ok(Some(found))
}

fn unusable(path: &Path, problem: String) -> Failure {
    let help = "start anew, without --resume; the file is then written anew";
    Failure::usage(format!("{} {problem}", path.display()), help)
}

enum Broken {
    Short,
    Damaged,
}

/// The next frame and its bytes, of so many that are left.
fn frame(file: &mut impl Read, left: u64) -> Result<(Frame, u64), Broken> {
    let mut length = [0; 8];
    file.read_exact(&mut length).map_err(|_| Broken::Short)?;
    let length = u64::from_le_bytes(length);
    let bytes = length.checked_add((8 + SEAL) as u64).ok_or(Broken::Damaged)?;
    if bytes > left {
        return Err(Broken::Short);
    }
    let mut content = vec![0; length as usize];
    let mut seal = [0; SEAL];
    file.read_exact(&mut content).and_then(|()| file.read_exact(&mut seal)).map_err(|_| Broken::Short)?;
    if seal != digest(&[&content])[..SEAL] {
        // A file system may have kept room for the last frame without its content: then its end is empty.
        let empty = bytes == left && seal == [0; SEAL];
        return Err(if empty { Broken::Short } else { Broken::Damaged });
    }
    let frame = postcard::from_bytes(&content).map_err(|_| Broken::Damaged)?;
    Ok((frame, bytes))
}

/// The checkpoint file of a run.
pub struct Checkpoint {
    path: PathBuf,
    head: Vec<u8>,
    interval: Duration,
    start: Instant,
    /// Done before the first frame is written.
    first: Box<dyn Fn() + Send + Sync>,
    file: Mutex<Written>,
}

/// The file, if there is one yet, and when it was last brought to the disk.
#[derive(Debug)]
struct Written {
    file: Option<File>,
    synced: Instant,
}

impl std::fmt::Debug for Checkpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Checkpoint").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Checkpoint {
    /// A file in an output folder, which goes on after what is left of an earlier run, or anew. It appears with the first
    /// frame, just after `first`.
    ///
    /// # Errors
    /// What is left cannot be cut to its whole frames.
    pub fn new(
        folder: &Path,
        case: &Case,
        interval: Option<Duration>,
        left: Option<&Left>,
        first: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, Failure> {
        let path = folder.join(CHECKPOINT);
        let file = left.map(|left| reopened(&path, left.whole)).transpose();
        let file = file.map_err(|error| {
            let problem = format!("{} cannot be written: {}", path.display(), plain(&error));
            Failure::run(problem, "give another folder with -o DIR")
        })?;
        let head = [magic().as_bytes(), &key(case)].concat();
        let interval = interval.unwrap_or(INTERVAL);
        let start = Instant::now();
        let file = Mutex::new(Written { file, synced: start });
        Ok(Self { path, head, interval, start, first: Box::new(first), file })
    }

    /// The run has ended well: nothing is left to resume.
    pub fn remove(folder: &Path) {
        let _ = fs::remove_file(folder.join(CHECKPOINT));
    }
}

fn reopened(path: &Path, whole: u64) -> io::Result<File> {
    let mut file = OpenOptions::new().write(true).open(path)?;
    file.set_len(whole)?;
    file.seek(SeekFrom::End(0))?;
    Ok(file)
}

impl Journal for Checkpoint {
    fn interval(&self) -> Duration {
        self.interval.max(self.start.elapsed().mul_f64(SHARE))
    }

    fn keep(&self, frame: &Frame) -> Result<(), String> {
        let mut written = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        // Blocks that end while no other could have lost much need not be kept.
        if written.file.is_none() && self.start.elapsed() < self.interval {
            return Ok(());
        }
        let words = |error: io::Error| format!("{} cannot be written: {}", self.path.display(), plain(&error));
        let content = postcard::to_stdvec(frame).map_err(|error| error.to_string())?;
        let seal = digest(&[&content]);
        let length = (content.len() as u64).to_le_bytes();
        let whole = [&length, &content[..], &seal[..SEAL]].concat();
        let Written { file, synced } = &mut *written;
        let out = match file {
            Some(out) => out,
            none => {
                (self.first)();
                let mut out = File::create(&self.path).map_err(words)?;
                out.write_all(&self.head).map_err(words)?;
                none.insert(out)
            }
        };
        out.write_all(&whole).map_err(words)?;
        // Against the loss of power; that of the process loses nothing that was written.
        if synced.elapsed() >= self.interval {
            out.sync_data().map_err(words)?;
            *synced = Instant::now();
        }
        Ok(())
    }
}
