//! From what the reader found to what a person reads.

use crate::case_source::{CaseSource, Mark};
use crate::error::CaseError;
use crate::key_path::Segment;
use crate::reader::{Fault, Variant, What};
use crate::schema::keys_of;
use crate::suggestion::{list, nearest};
use crate::tree::{Node, Origin, Value};

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
            let value = shown(source, &path);
            let help = wrong_brackets(node, last, path.len())
                .or_else(|| unquoted_string(node, &expected, &value))
                .or_else(|| lonely_component(node, &expected, &value));
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
    let siblings = match variant {
        Some(variant) => owners(variant, key),
        None => tables_with(key, table),
    };
    if let Some(path_in_quotes) = bare_sweep(source, path) {
        let problem = "key paths stand in quotes in a sweep".to_owned();
        return source.error(&path[..2], Mark::Key, problem, Some(format!("write {path_in_quotes} = ...")), None);
    }
    let (problem, help) = if !siblings.is_empty() {
        (format!("`{key}` belongs to {}; {takes}", list(&siblings, "and")), None)
    } else {
        let written: Vec<&str> = source.tree.find(table).node.keys().collect();
        // A key that stands there already is less likely meant; but on the command line it is.
        let free = known.iter().copied().filter(|name| !written.contains(name));
        let meant = nearest(key, free).or_else(|| nearest(key, known)).or_else(|| synonym(key, known));
        let meant = if table.is_empty() { thing_called(source, key).or(meant) } else { meant };
        let problem = format!("unknown key `{key}`{place}");
        let takes = capital(&takes);
        let help = match meant {
            Some(radius) if key == "diameter" => format!("give the `{radius}`, which is half of it. {takes}"),
            Some(name) => format!("did you mean `{name}`? {takes}"),
            None => takes,
        };
        (problem, Some(help))
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
    let help = match (source.tree.find(path).node.span.origin, example(key)) {
        (Origin::Set(_), Some(value)) => {
            Some(format!("set it as well: --set '{}.{key}={}'", source.tree.display(path), value.trim_matches('"')))
        }
        _ => help,
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

/// The other settings tables that take `key`, where `table` is one of those.
fn tables_with(key: &str, table: &[Segment]) -> Vec<String> {
    let settings = keys_of("settings");
    let [Segment::Key(table)] = table else { return Vec::new() };
    if !settings.iter().any(|(name, _)| name == table) {
        return Vec::new();
    }
    let others = settings.iter().filter(|(name, keys)| name != table && keys.iter().any(|known| known == key));
    others.map(|(name, _)| format!("[{name}]")).collect()
}

/// The path of an electrode, source or group of grains of this name, for `--set left.dc=5`.
fn thing_called(source: &CaseSource, name: &str) -> Option<String> {
    let has =
        |list: &&str| source.tree.get(list).is_some_and(|list| list.entries().iter().any(|e| e.name() == Some(name)));
    let list = crate::set::LISTS.into_iter().find(|list| has(list))?;
    Some(format!("{list}.{name}"))
}

/// `electrode.left.dc = ...` in a sweep without quotes is a table in a table: the path that was meant.
fn bare_sweep(source: &CaseSource, path: &[Segment]) -> Option<String> {
    let [Segment::Key(sweep), Segment::Key(first), ..] = path else { return None };
    if sweep != "sweep" || first.contains('.') || path.len() < 3 {
        return None;
    }
    let mut parts = vec![first.clone()];
    let mut at = source.tree.get(sweep)?.get(first)?;
    while let Value::Table(entries) = &at.value
        && let [entry, ..] = &entries[..]
        && entry.key != "from"
    {
        parts.push(entry.key.clone());
        at = &entry.node;
    }
    Some(format!("\"{}\"", parts.join(".")))
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
fn unquoted_string(node: &Node, expected: &str, value: &str) -> Option<String> {
    let scalar = matches!(node.value, Value::Integer(_) | Value::Float(_) | Value::Boolean(_) | Value::Date);
    (scalar && expected == "a string").then(|| format!("put it in quotes: \"{value}\""))
}

/// One number where two or three should stand.
fn lonely_component(node: &Node, expected: &str, value: &str) -> Option<String> {
    let scalar = matches!(node.value, Value::Integer(_) | Value::Float(_) | Value::String(_));
    match expected {
        _ if !scalar => None,
        "a list of two, [a, b]" => Some(format!("for a square, write [{value}, {value}]")),
        "a list of three, [x, y, z]" => Some(format!("along z, for instance, it is [0, 0, {value}]")),
        _ => None,
    }
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
