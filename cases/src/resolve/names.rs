//! Names of electrodes, sources, drives and groups of grains.

use super::at::At;
use crate::case::{Electrode, GROUND, Source};
use crate::error::CaseError;
use crate::key_path::is_name_character;

/// Names become parts of file names, which end at 255 bytes in most file systems.
const LONGEST_NAME: usize = 64;

/// Checks that a name can be part of a key path, of a file name and of an array's name.
pub(super) fn check(at: &At, name: &str) -> Result<(), CaseError> {
    wrong(name).map_or(Ok(()), |(problem, help)| Err(at.error(format!("{{value}} {problem}"), help)))
}

/// The same for a name that is itself a key.
pub(super) fn check_key(at: &At, name: &str) -> Result<(), CaseError> {
    wrong(name).map_or(Ok(()), |(problem, help)| Err(at.key_error(format!("the name \"{name}\" {problem}"), help)))
}

fn wrong(name: &str) -> Option<(String, String)> {
    let made_of = "names are made of letters, digits, `_` and `-`";
    if name.trim().is_empty() {
        return Some(("is empty".to_owned(), made_of.to_owned()));
    }
    if let Some(wrong) = name.chars().find(|&c| !is_name_character(c)) {
        let shown = match wrong {
            ' ' => "a space".to_owned(),
            c if c.is_control() => "a control character".to_owned(),
            c => format!("`{c}`"),
        };
        let better: String = name.trim().chars().map(|c| if is_name_character(c) { c } else { '_' }).collect();
        let help = format!("{made_of}, since they become parts of key paths and file names: \"{better}\"");
        return Some((format!("contains {shown}"), help));
    }
    if name.chars().all(|c| c.is_ascii_digit()) {
        let help = format!("numbers stand for positions in key paths: give it a letter, as in \"e{name}\"");
        return Some(("is a number".to_owned(), help));
    }
    if name.starts_with('-') {
        return Some(("begins with `-`".to_owned(), "begin with a letter, a digit or `_`".to_owned()));
    }
    if name.chars().count() > LONGEST_NAME {
        let help = format!("names have at most {LONGEST_NAME} characters");
        return Some((format!("has {} characters", name.chars().count()), help));
    }
    None
}

/// A name, or what an entry is called that has none.
pub(super) fn or_default(at: &At, name: Option<&str>, noun: &str, n: usize) -> Result<String, CaseError> {
    match name {
        Some(name) => check(&at.key("name"), name).map(|()| name.to_owned()),
        None => Ok(format!("{noun}{}", n + 1)),
    }
}

/// Names of electrodes and sources stand side by side in results: all must differ.
pub(super) fn all_different(root: &At, electrodes: &[Electrode], sources: &[Source]) -> Result<(), CaseError> {
    let electrodes = electrodes.iter().enumerate().map(|(n, e)| (e.name.as_str(), "electrode", n));
    let sources = sources.iter().enumerate().map(|(n, s)| (s.name.as_str(), "source", n));
    let all: Vec<_> = electrodes.chain(sources).collect();
    different(root, &all, "what shares a voltage can share a drive (see [drive.NAME]) and keep a name of its own")
}

/// Beside a grounded plane nothing else is called after it: grains strike it by that name.
pub(super) fn not_ground(root: &At, electrodes: &[Electrode], sources: &[Source]) -> Result<(), CaseError> {
    let (electrodes, sources) = (electrodes.iter().map(|e| &e.name), sources.iter().map(|s| &s.name));
    for (list, n) in [
        ("electrode", electrodes.into_iter().position(|name| name == GROUND)),
        ("source", sources.into_iter().position(|name| name == GROUND)),
    ] {
        if let Some(n) = n {
            let problem = "{value} is what the plane of `field.ground` is called in results";
            return Err(root.key(list).entry(n).key("name").error(problem, "give it another name"));
        }
    }
    Ok(())
}

/// Names of groups of grains must differ.
pub(super) fn different(root: &At, all: &[(&str, &str, usize)], help: &str) -> Result<(), CaseError> {
    let mut seen = std::collections::HashMap::new();
    for &(name, list, n) in all {
        let at = root.key(list).entry(n);
        if let Some(&(first_list, first)) = seen.get(name) {
            let first: At = root.key(first_list).entry(first);
            let first = if first.key("name").written() { first.key("name") } else { first };
            let line = first.line().map_or(String::new(), |line| format!(" in line {line}"));
            let noun = if first_list == "grains" { "group of grains" } else { first_list };
            let problem = format!("the name \"{name}\" is taken by the {noun}{line}");
            return Err(at.key("name").error(problem, help));
        }
        seen.insert(name, (list, n));
    }
    Ok(())
}
