//! Starts the command and looks at what it left.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;

use crate::common;

/// A folder of its own for one test, removed in the end.
pub struct Scratch(pub PathBuf);

impl Scratch {
    /// Makes it.
    pub fn new() -> Self {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let name = format!("cli-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A place in it, as an argument.
    pub fn at(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// Writes a file in it and gives its path.
    pub fn file(&self, name: &str, text: &str) -> String {
        fs::write(self.0.join(name), text).unwrap();
        self.at(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// What a command said.
#[derive(Debug)]
pub struct Said {
    /// Exit status; `None` when a signal ended it.
    pub status: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Said {
    /// Standard output as one JSON object.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    /// Panics with everything that was said unless the command was done.
    pub fn done(self) -> Self {
        assert_eq!(self.status, Some(0), "{self:?}");
        self
    }
}

/// The command, not yet started, in a folder.
pub fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_graintrap"));
    command.args(args).current_dir(folder).env_remove("RUST_BACKTRACE");
    command
}

/// Starts the command in a folder and waits for it.
pub fn graintrap_in(folder: &Path, args: &[&str]) -> Said {
    let output = command(folder, args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let said = Said { status: output.status.code(), out: text(output.stdout), err: text(output.stderr) };
    assert!(!said.err.contains("panicked"), "{args:?}: {said:?}");
    said
}

/// Starts the command and waits for it.
pub fn graintrap(args: &[&str]) -> Said {
    graintrap_in(Path::new(env!("CARGO_TARGET_TMPDIR")), args)
}

/// The quick case.
pub fn tiny() -> String {
    common::folder("run").join("two_small_rings.toml").to_str().unwrap().to_owned()
}

/// `graintrap study` of a case.
pub fn study(case: &str, out: &str, more: &[&str]) -> Said {
    graintrap(&[&["study", case, "-o", out, "--json"], more].concat())
}

/// Starts a study on one thread, kills it when that many of its rows are kept, and gives the file they are in.
pub fn killed_with(rows: usize, scratch: &Scratch, case: &str, out: &str) -> PathBuf {
    let journal = Path::new(out).join("cache/points.jsonl");
    let mut run = command(&scratch.0, &["study", case, "-o", out, "--threads", "1"]);
    let mut child = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let lines = || fs::read(&journal).map_or(0, |text| text.iter().filter(|byte| **byte == b'\n').count());
    while lines() < rows {
        assert!(child.try_wait().unwrap().is_none(), "the study ended before it was killed");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    journal
}

/// A number of a row or of another object.
pub fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("no {name} in {row}"))
}

/// A file that a command left in a folder.
pub fn file(folder: &str, name: &str) -> Vec<u8> {
    fs::read(Path::new(folder).join(name)).unwrap_or_else(|error| panic!("{folder}/{name}: {error}"))
}

/// All files of a folder and the folders in it: path within it, and content.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    collect(folder, folder, &mut files);
    files
}

fn collect(root: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(root, &path, files);
        } else {
            let name = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
            files.insert(name, fs::read(&path).unwrap());
        }
    }
}

/// Whether a file has an end that fits its beginning.
pub fn is_whole(name: &str, bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let ends = |end: &str| text.trim_end().ends_with(end);
    match name.rsplit('.').next().unwrap() {
        "json" => serde_json::from_slice::<Value>(bytes).is_ok(),
        "svg" => roxmltree::Document::parse(&text).is_ok(),
        "vtu" | "vtp" | "vti" | "pvd" => text.contains("<VTKFile") && ends("</VTKFile>"),
        "csv" => bytes.ends_with(b"\n"),
        "png" => bytes.starts_with(b"\x89PNG") && bytes.ends_with(b"IEND\xae\x42\x60\x82"),
        // It holds a digest of itself, and a run that reads it checks that.
        "bin" => bytes.starts_with(b"graintrap "),
        _ => false,
    }
}
