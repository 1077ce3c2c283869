//! The case files in `tests/cli` and the lines in them that say what is expected.

use std::fs;
use std::path::{Path, PathBuf};

/// A folder of case files.
pub fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cli").join(name)
}

/// The case files of one folder, in order.
pub fn files(name: &str) -> Vec<PathBuf> {
    let folder = folder(name);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files
}

/// The values of lines such as `#! expect: ...`.
pub fn directives(text: &str, name: &str) -> Vec<String> {
    let head = format!("#! {name}:");
    text.lines().filter_map(|line| line.strip_prefix(&head)).map(|rest| rest.trim().to_owned()).collect()
}

/// One line without the drawing, so that wrapped sentences are found.
pub fn flat(report: &str) -> String {
    let drawing = |word: &&str| !word.chars().all(|c| "|`,-.'^x:".contains(c)) || *word == "x";
    report.split_whitespace().filter(drawing).collect::<Vec<_>>().join(" ")
}
