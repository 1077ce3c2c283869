//! Files that appear under their final names only when they are whole.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::pipeline::Failure;

/// What a file is called while it is written, between the dot and this ending.
const PARTIAL: &str = ".partial";

/// A folder of results. Files are written under temporary names and get their own all together, in [`OutputFolder::commit`]:
/// a run that ends early, however it ends, changes nothing of what was there before.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// Names within the folder, in the order they were written.
    written: Vec<String>,
    /// Of those, the ones that are for people.
    listed: Vec<String>,
}

impl OutputFolder {
    /// Makes the folder if need be, and clears away what an earlier run that was killed left unfinished.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        let failed = |error: io::Error| {
            Failure::run(
                format!("the output folder {} cannot be written: {}", path.display(), plain(&error)),
                "give another one with -o DIR",
            )
        };
        fs::create_dir_all(path).map_err(failed)?;
        remove_all_partial(path);
        // Better to know now than after the work.
        let probe = path.join(format!(".probe-{}{PARTIAL}", std::process::id()));
        File::create(&probe).map_err(failed)?;
        let _ = fs::remove_file(&probe);
        Ok(Self { path: path.to_owned(), written: Vec::new(), listed: Vec::new() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of what has been written so far, frames of animations and kept solutions left out.
    pub fn names(&self) -> &[String] {
        &self.listed
    }

    /// Writes a file under a temporary name. `name` may have one folder in it, as `grains/grains_0001.vtp`.
    ///
    /// # Errors
    /// The content cannot be made, or the disk refuses it (it may be full).
    pub fn write<E: std::fmt::Display>(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<(), Failure> {
        self.write_unlisted(name, content)?;
        self.listed.push(name.to_owned());
        Ok(())
    }

    /// As [`OutputFolder::write`], for a file that belongs to another one or that is not for people.
    ///
    /// # Errors
    /// As [`OutputFolder::write`].
    pub fn write_unlisted<E: std::fmt::Display>(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<(), Failure> {
        let temporary = self.temporary(name);
        let failed = |what: String| {
            let help = "make room on the disk, or write elsewhere with -o DIR";
            Failure::run(format!("{} cannot be written: {what}", self.path.join(name).display()), help)
        };
        if let Some(folder) = temporary.parent() {
            fs::create_dir_all(folder).map_err(|error| failed(plain(&error)))?;
        }
        // Not while an interrupt clears the folder: it would miss the new file.
        let file = {
            let _undisturbed = undisturbed();
            File::create(&temporary).map_err(|error| failed(plain(&error)))?
        };
        let mut out = BufWriter::with_capacity(1 << 18, file);
        content(&mut out).map_err(|error| failed(error.to_string()))?;
        out.flush().map_err(|error| failed(plain(&error)))?;
        self.written.push(name.to_owned());
        Ok(())
    }

    /// What gives the files of a folder within this one their own names beforehand, as far as that can be done: they hold no
    /// results, but what a run that is resumed would have to find again.
    pub fn early(&self, folder: &str) -> impl Fn() + Send + Sync + 'static {
        let of_folder = self.written.iter().filter(|name| Path::new(name).starts_with(folder));
        let pairs: Vec<_> = of_folder.map(|name| (self.temporary(name), self.path.join(name))).collect();
        move || {
            let _undisturbed = undisturbed();
            for (temporary, path) in &pairs {
                // The second name of the file takes the place of the old one; the first is left for the commit.
                let second = temporary.with_extension(format!("early{PARTIAL}"));
                if fs::hard_link(temporary, &second).is_ok() && fs::rename(&second, path).is_err() {
                    let _ = fs::remove_file(&second);
                }
            }
        }
    }

    /// Gives every file its own name. Files of an earlier run in `grains/` that this one did not write go away.
    ///
    /// # Errors
    /// A file cannot be renamed. Where a folder has the name of a file, which is the likely reason, no file is.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, Failure> {
        let mut committed = undisturbed();
        let failed = |path: &Path, reason: String| {
            let help = "is it open in another program, or is there a folder of that name?";
            Failure::run(format!("{} cannot be written: {reason}", path.display()), help)
        };
        if let Some(path) = self.written.iter().map(|name| self.path.join(name)).find(|path| path.is_dir()) {
            return Err(failed(&path, "a folder has that name".to_owned()));
        }
        let mut paths = Vec::with_capacity(self.written.len());
        for name in std::mem::take(&mut self.written) {
            let path = self.path.join(&name);
            fs::rename(self.temporary(&name), &path).map_err(|error| failed(&path, plain(&error)))?;
            paths.push(path);
        }
        self.remove_old_frames(&paths);
        *committed = true;
        Ok(paths)
    }

    /// Removes animation frames (files we name) that no longer belong to the run.
    fn remove_old_frames(&self, current: &[PathBuf]) {
        let current: HashSet<&PathBuf> = current.iter().collect();
        let Ok(entries) = fs::read_dir(self.path.join("grains")) else { return };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let ours = name.strip_prefix("grains_").and_then(|rest| rest.strip_suffix(".vtp"));
            let frame = ours.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()));
            if frame && !current.contains(&entry.path()) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }

    fn temporary(&self, name: &str) -> PathBuf {
        let path = self.path.join(name);
        let file = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        path.with_file_name(format!(".{file}{PARTIAL}"))
    }
}

static COMMIT: Mutex<bool> = Mutex::new(false);

/// Held while files are begun and while they get their names; whether they have got them. Whoever means to end the process
/// takes it first.
pub fn undisturbed() -> MutexGuard<'static, bool> {
    COMMIT.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for OutputFolder {
    /// What was not committed goes away.
    fn drop(&mut self) {
        for name in &self.written {
            let _ = fs::remove_file(self.temporary(name));
        }
        remove_all_partial(&self.path);
    }
}

/// Writes a file on its own, which gets its name when it is whole. What a run is writing beside it is left alone.
///
/// # Errors
/// The disk refuses it, or a folder has that name.
pub fn write_alone(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |error: io::Error| {
        let help = "is there room on the disk, and does its folder exist? Give another place with -o FILE";
        Failure::run(format!("{} cannot be written: {}", path.display(), plain(&error)), help)
    };
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = path.with_file_name(format!(".{name}-{}{PARTIAL}", std::process::id()));
    let written = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, path));
    written.map_err(|error| {
        let _ = fs::remove_file(&temporary);
        failed(error)
    })
}

/// Removes unfinished files in an output folder and the folders in it that are ours.
pub fn remove_all_partial(folder: &Path) {
    for part in ["", "grains", "cache"] {
        remove_partial(&folder.join(part));
    }
}

fn remove_partial(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(PARTIAL) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// An error of the system without its number.
pub(crate) fn plain(error: &io::Error) -> String {
    error.to_string().split(" (os error").next().unwrap_or_default().to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("graintrap-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        path
    }

    fn put(out: &mut OutputFolder, name: &str, text: &str) {
        out.write(name, |w| w.write_all(text.as_bytes())).unwrap();
    }

    #[test]
    fn nothing_appears_before_the_end_and_everything_after() {
        let path = folder("commit");
        let mut out = OutputFolder::create(&path).unwrap();
        put(&mut out, "a.txt", "new");
        put(&mut out, "grains/grains_0001.vtp", "frame");
        assert!(!path.join("a.txt").exists());
        assert_eq!(out.commit().unwrap().len(), 2);
        assert_eq!(fs::read_to_string(path.join("a.txt")).unwrap(), "new");
        // The next run has fewer frames; a file of the user's stays.
        fs::write(path.join("grains/notes.txt"), "mine").unwrap();
        let mut out = OutputFolder::create(&path).unwrap();
        put(&mut out, "grains/grains_0000.vtp", "frame");
        out.commit().unwrap();
        let left = |name: &str| path.join("grains").join(name).exists();
        assert!(left("grains_0000.vtp") && left("notes.txt") && !left("grains_0001.vtp"));
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn a_run_that_fails_leaves_what_was_there() {
        let path = folder("fail");
        let mut out = OutputFolder::create(&path).unwrap();
        put(&mut out, "a.txt", "old");
        out.commit().unwrap();
        let mut out = OutputFolder::create(&path).unwrap();
        put(&mut out, "a.txt", "new");
        let failure = out.write("b.txt", |w| w.write_all(b"half").and(Err(io::Error::other("no space left"))));
        assert!(failure.unwrap_err().to_string().contains("b.txt cannot be written: no space left"));
        drop(out);
        let names: Vec<_> = fs::read_dir(&path).unwrap().flatten().map(|e| e.file_name()).collect();
        assert_eq!(names, ["a.txt"]);
        assert_eq!(fs::read_to_string(path.join("a.txt")).unwrap(), "old");
        fs::remove_dir_all(path).unwrap();
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_told_before_the_work() {
        let path = folder("file");
        fs::write(&path, "a file").unwrap();
        let error = OutputFolder::create(&path.join("sub")).unwrap_err();
        assert!(error.to_string().contains("cannot be written"), "{error}");
        fs::remove_file(path).unwrap();
    }
}
