//! The case files in `tests/cli`: good ones are read, bad ones give the message that stands in them.

use std::fs;
use std::path::{Path, PathBuf};

use cases::{Case, CaseError, Look};

/// The case files of one folder, in order.
fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cli").join(folder);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files
}

/// The values of lines such as `#! expect: ...`.
fn directives(text: &str, name: &str) -> Vec<String> {
    let head = format!("#! {name}:");
    text.lines().filter_map(|line| line.strip_prefix(&head)).map(|rest| rest.trim().to_owned()).collect()
}

/// Reads a file as the command would, with the `--set` arguments it names itself. Messages call it `case.toml`.
fn read(path: &Path) -> Result<Case, CaseError> {
    let text = fs::read_to_string(path).unwrap();
    Case::parse(path.with_file_name("case.toml"), &text, &directives(&text, "set")).map(|(case, _)| case)
}

/// One line without the drawing, so that wrapped sentences are found.
fn flat(report: &str) -> String {
    let drawing = |word: &&str| !word.chars().all(|c| "|`,-.'^x:".contains(c)) || *word == "x";
    report.split_whitespace().filter(drawing).collect::<Vec<_>>().join(" ")
}

#[test]
fn good_cases_are_read() {
    for path in files("good") {
        if let Err(error) = read(&path) {
            panic!("{}:\n{error:?}", path.display());
        }
    }
}

#[test]
fn bad_cases_say_what_is_wrong() {
    let files = files("bad");
    assert!(files.len() >= 45, "{} bad cases", files.len());
    let mut failed = Vec::new();
    for path in files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let expected = directives(&fs::read_to_string(&path).unwrap(), "expect");
        assert!(!expected.is_empty(), "{name} expects nothing");
        let Err(error) = read(&path) else {
            failed.push(format!("{name} was read without an error"));
            continue;
        };
        let report = error.report(Look::PLAIN);
        println!("--- {name}\n{report}");
        let (line, flat) = (error.to_string(), flat(&report));
        let folder = path.parent().unwrap().display().to_string() + "/";
        for message in expected {
            if !flat.replace(&folder, "").contains(&message) && !line.replace(&folder, "").contains(&message) {
                failed.push(format!("{name} does not say `{message}` but:\n{line}\n{report}"));
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
