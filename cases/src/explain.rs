//! From what the reader found to what a person reads.

use crate::case_source::{CaseSource, Mark};
use crate::error::CaseError;
use crate::key_path::Segment;
use crate::reader::{Fault, Variant, What};
use crate::schema::keys_of;
use crate::suggestion::{list, nearest};
use crate::tree::{Node, Value};

/// Longer values are cut in sentences; the lines of the file show them whole.
const LONGEST_VALUE: usize = 48;

/// The error for a fault of the reader, whose path starts at the root of the tree.
pub(crate) fn explain(source: &CaseSource, fault: Fault) -> CaseError {
    let Fault { path, what } = fault;
    let found = source.tree.find(&path);
    let node = found.node;
    match what {
        What::UnknownKey { known, variant } => unknown_key(source, &path, &known, variant.as_ref()),
        What::MissingKey { key, choices, variant } => missing_key(source, &path, &key, &choices, variant.as_ref()),
        What::UnknownName { known } => {
            let value = shown(source, &path);
            let last = last_key(&path);
            let help = match &node.value {
                Value::String(name) => nearest(name, &known).map(|name| format!("did you mean \"{name}\"?")),
                _ => None,
            };
            let problem = format!("{value} is not {}: expected {}", thing(last), list(&quoted(&known), "or"));
            source.error(&path, Mark::Value, problem, help, None)
        }
        What::WrongType { expected } => {
            let last = last_key(&path);
            let help =
                wrong_brackets(node, last, path.len()).or_else(|| unquoted_string(node, &expected, source, &path));
            let value = shown(source, &path);
            let is = format!("{value} is {}", node.type_name());
            source.error(&path, Mark::Value, format!("{is}: expected {expected}"), help, None)
        }
        What::Said { problem, help } => {
            let problem = problem.replace("{value}", &shown(source, &path));
            source.error(&path, Mark::Value, problem, help, None)
        }
    }
}

fn unknown_key(source: &CaseSource, path: &[Segment], known: &[&'static str], variant: Option<&Variant>) -> CaseError {
    let (key, table) = match path.split_last() {
        Some((Segment::Key(key), table)) => (key.as_str(), table),
        _ => ("", path),
    };
    let place = match source.tree.display(table) {
        place if place.is_empty() => String::new(),
        place => format!(" in {place}"),
    };
    let takes = match variant {
        Some(variant) if known.len() == 1 => format!("{} takes only {}", named(variant), list(known, "and")),
        Some(variant) => format!("{} takes {}", named(variant), list(known, "and")),
        None if table.is_empty() => format!("a case takes {}", list(known, "and")),
        None => format!("{} takes {}", source.tree.display(table), list(known, "and")),
    };
    let siblings = variant.map(|variant| owners(variant, key)).unwrap_or_default();
    let (problem, help) = if !siblings.is_empty() {
        (format!("`{key}` belongs to {}; {takes}", list(&siblings, "and")), None)
    } else {
        let written: Vec<&str> = source.tree.find(table).node.keys().collect();
        // A key that stands there already is less likely meant; but on the command line it is.
        let free = known.iter().copied().filter(|name| !written.contains(name));
        let meant = nearest(key, free).or_else(|| nearest(key, known)).or_else(|| synonym(key, known));
        let problem = format!("unknown key `{key}`{place}");
        let takes = capital(&takes);
        (problem, Some(meant.map_or(takes.clone(), |name| format!("did you mean `{name}`? {takes}"))))
    };
    let mark = if siblings.is_empty() { Mark::UnknownKey } else { Mark::Key };
    source.error(path, mark, problem, help, None)
}

fn missing_key(
    source: &CaseSource,
    path: &[Segment],
    key: &str,
    choices: &[&'static str],
    variant: Option<&Variant>,
) -> CaseError {
    let what = match variant {
        Some(variant) => format!("; {} needs it", named(variant)),
        None => String::new(),
    };
    let help = if choices.is_empty() {
        example(key).map(|value| format!("add a line such as {key} = {value}"))
    } else {
        let plural = if key == "shape" { "shapes" } else { "kinds" };
        let sample = if key == "shape" { "ring" } else { choices[0] };
        let plural = if key == "model" { "models" } else { plural };
        Some(format!("add a line such as {key} = \"{sample}\"; the {plural} are {}", list(&quoted(choices), "and")))
    };
    let inline = source.literal(path).is_some();
    let help = match help {
        Some(help) if inline => Some(help.replacen("add a line such as ", "write ", 1).replacen("add ", "write ", 1)),
        other => other,
    };
    let problem = format!("`{key}` is missing{what}");
    source.error(path, Mark::Value, problem, help, Some(format!("no `{key}` here")))
}

/// The other kinds of table of the same family that take `key`.
fn owners(variant: &Variant, key: &str) -> Vec<String> {
    let mut owners = keys_of(variant.family);
    owners.retain(|(_, keys)| keys.iter().any(|known| known == key));
    owners.into_iter().map(|(name, _)| name).collect()
}

/// Words that people try for a key.
fn synonym(key: &str, known: &[&'static str]) -> Option<String> {
    let key = key.to_lowercase();
    let meant = match key.as_str() {
        "voltage" | "potential" | "v" | "bias" | "u" => "dc",
        "position" | "pos" | "origin" | "location" => "center",
        "normal" | "orientation" | "dir" => "axis",
        "tube_radius" | "minor_radius" | "wire" => "wire_radius",
        "major_radius" | "r" => "radius",
        "diameter" => "radius",
        "type" => "kind",
        "freq" | "f" | "omega" => "frequency",
        "velocity" => "speed",
        "number" | "n" => "count",
        "angle" => "opening",
        "b" | "b_field" | "magnetic" => "magnetic_field",
        "g" => "gravity",
        "damping" | "friction" => "drag",
        "time" | "t_end" | "tmax" => "duration",
        "dt" | "timestep" | "time_step" => "step",
        "tolerance" | "rtol" | "precision" | "error" => "accuracy",
        "inner_radius" => "hole_radius",
        _ => return None,
    };
    let meant = if key == "type" && known.contains(&"shape") { "shape" } else { meant };
    known.contains(&meant).then(|| meant.to_owned())
}

/// How a key that is missing might be written.
fn example(key: &str) -> Option<&'static str> {
    Some(match key {
        "name" => "\"left\"",
        "radius" => "\"1 cm\"",
        "wire_radius" => "\"1 mm\"",
        "length" => "\"5 cm\"",
        "r0" => "\"5 mm\"",
        "pitch" => "\"2 mm\"",
        "opening" => "\"90 deg\" (a hemisphere)",
        "points" => "[[0, 0, 0], [0, 0, \"1 cm\"]]",
        "file" => "\"name.csv\"",
        "amplitude" => "\"300 V\"",
        "frequency" => "\"60 Hz\"",
        "duration" => "\"1 s\"",
        "charge" => "\"1e-13 C\"",
        "place" => "{ kind = \"ball\", radius = \"1 mm\" }",
        "temperature" => "\"300 K\"",
        "velocity" => "[0, 0, \"1 mm/s\"]",
        "speed" => "\"1 mm/s\"",
        "min" => "[\"-1 cm\", \"-1 cm\", \"-1 cm\"]",
        "max" => "[\"1 cm\", \"1 cm\", \"1 cm\"]",
        "gas" => "\"air\"",
        "pressure" => "\"1 bar\"",
        "direction" => "\"z\"",
        "drive" => "\"main\"",
        _ => return None,
    })
}

/// "[[electrode]]" with the wrong number of brackets.
fn wrong_brackets(node: &Node, key: &str, depth: usize) -> Option<String> {
    let lists = crate::set::LISTS.contains(&key);
    match &node.value {
        Value::Table(_) if depth == 1 && lists => {
            Some(format!("there may be several: write [[{key}]] with double brackets"))
        }
        Value::List(entries) if depth == 1 && !lists && entries.iter().all(|e| matches!(e.value, Value::Table(_))) => {
            Some(format!("there is one only: write [{key}] with single brackets"))
        }
        _ => None,
    }
}

/// A number where a string should stand, as happens to `--set title=1`.
fn unquoted_string(node: &Node, expected: &str, source: &CaseSource, path: &[Segment]) -> Option<String> {
    let scalar = matches!(node.value, Value::Integer(_) | Value::Float(_) | Value::Boolean(_) | Value::Date);
    let literal = source.literal(path)?;
    (scalar && expected == "a string").then(|| format!("put it in quotes: \"{literal}\""))
}

/// The value as written, cut where it is long.
pub(crate) fn shown(source: &CaseSource, path: &[Segment]) -> String {
    // A table with a header is shown by that.
    let found = source.tree.find(path);
    let header = || (found.depth == path.len()).then(|| source.slice(found.node.span).to_owned());
    let literal = source.literal(path).or_else(header).unwrap_or_default();
    let line = literal.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= LONGEST_VALUE {
        return line;
    }
    let beginning: String = line.chars().take(LONGEST_VALUE - 4).collect();
    format!("{beginning} ...")
}

/// The last key of a path.
fn last_key(path: &[Segment]) -> &str {
    let key = path.iter().rev().find_map(|segment| match segment {
        Segment::Key(key) => Some(key.as_str()),
        Segment::Entry(_) => None,
    });
    key.unwrap_or("")
}

/// What a name stands for, by its key.
fn thing(key: &str) -> String {
    match key {
        "shape" => "a shape".to_owned(),
        "kind" => "a known kind".to_owned(),
        "model" => "a model of drag".to_owned(),
        "gas" => "a known gas".to_owned(),
        "integrator" => "an integrator".to_owned(),
        "axis" | "up" | "direction" => "an axis".to_owned(),
        other => format!("a known {other}"),
    }
}

pub(crate) fn quoted(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| format!("\"{name}\"")).collect()
}

/// "a ring", "a point source".
fn named(variant: &Variant) -> String {
    let name = &variant.name;
    let article = if name.starts_with(['a', 'e', 'i', 'o']) { "an" } else { "a" };
    match variant.family {
        "SpeedKeys" => format!("a speed of kind \"{name}\""),
        "GasDragKeys" => format!("the model \"{name}\""),
        "SourceKind" if matches!(name.as_str(), "point" | "uniform") => format!("{article} {name} source"),
        _ => format!("{article} {name}"),
    }
}

fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    match letters.next() {
        Some(first) if !sentence.starts_with(|c: char| !c.is_alphabetic()) && sentence.starts_with("a") => {
            first.to_uppercase().chain(letters).collect()
        }
        _ => sentence.to_owned(),
    }
}
