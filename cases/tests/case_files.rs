//! The case files in `tests/cli`: good ones are read, bad ones give the message that stands in them.

mod common;

use std::fs;
use std::path::Path;

use cases::{Case, CaseError, Look};
use common::{directives, files, flat};

/// Reads a file as the command would, with the `--set` arguments it names itself. Messages call it `case.toml`.
fn read(path: &Path) -> Result<Case, CaseError> {
    let text = fs::read_to_string(path).unwrap();
    Case::parse(path.with_file_name("case.toml"), &text, &directives(&text, "set")).map(|(case, _)| case)
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
