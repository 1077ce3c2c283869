//! `--set key=value`: one key of a case changed from the command line.

use toml::de::DeTable;

use crate::key_path::split;
use crate::suggestion::{list, nearest};
use crate::tree::{Entry, Node, Origin, Shift, Span, Value, position};

/// Why a `--set` cannot be carried out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SetFault {
    /// Which part of the argument is at fault.
    pub span: Span,
    /// The key path as far as it is understood.
    pub key: String,
    pub problem: String,
    pub help: Option<String>,
}

/// Changes the tree of a case file as the argument says. `number` tells which argument it is, from zero, for spans.
pub(crate) fn set(tree: &mut Node, argument: &str, number: usize) -> Result<(), SetFault> {
    let origin = Origin::Set(number);
    let span = |start: usize, end: usize| Span { origin, start, end };
    let Some(equals) = equals_sign(argument) else {
        return Err(SetFault {
            span: span(0, argument.len()),
            key: argument.trim().to_owned(),
            problem: format!("`--set {argument}` has no `=`"),
            help: Some("write key=value, as in `--set electrode.left.dc=\"7 V\"`".to_owned()),
        });
    };
    let key = argument[..equals].trim();
    let key_start = argument.len() - argument.trim_start().len();
    let key_span = span(key_start.min(equals), key_start.min(equals) + key.len());
    let fault = |problem: String, help: Option<String>| SetFault { span: key_span, key: key.to_owned(), problem, help };
    let parts = split(key).map_err(|problem| {
        let help = "a key path is written as `electrode.left.dc`, `grains.1.mass` or `drive.main.frequency`";
        fault(problem, Some(help.to_owned()))
    })?;
    let node = value(argument, equals + 1, origin, key)?;

    // A fault leaves the tree as it was: below a table that had to be made nothing can be at fault.
    let mut at = &mut *tree;
    for (depth, part) in parts.iter().enumerate() {
        let last = depth + 1 == parts.len();
        let so_far = || parts[..depth].join(".");
        match &mut at.value {
            Value::Table(entries) => {
                let existing = entries.iter().position(|entry| &entry.key == part);
                let index = match existing {
                    Some(index) => index,
                    None => {
                        if depth == 0 && LISTS.contains(&part.as_str()) && !last {
                            let problem = format!("the case has no {part}");
                            let help = format!("add one to the case file under [[{part}]]");
                            return Err(fault(problem, Some(help)));
                        }
                        let empty = Node { span: key_span, value: Value::Table(Vec::new()) };
                        entries.push(Entry { key: part.clone(), key_span, node: empty });
                        entries.len() - 1
                    }
                };
                if last {
                    entries[index].key_span = key_span;
                }
                at = &mut entries[index].node;
            }
            Value::List(entries) => {
                let count = entries.len();
                let names: Vec<String> = entries.iter().filter_map(|e| e.name().map(str::to_owned)).collect();
                let Some(position) = position(entries, part) else {
                    return Err(no_entry(&so_far(), part, &parts[depth..], count, &names, fault));
                };
                at = &mut entries[position];
            }
            other => {
                let what = Node { span: key_span, value: other.clone() };
                let shown = match &what.value {
                    Value::String(text) => format!("the string \"{text}\""),
                    _ => what.type_name().to_owned(),
                };
                let path = so_far();
                let help = match (&what.value, parts[depth - 1].as_str()) {
                    (Value::String(drive), "rf") => format!("set it where the drive is: `drive.{drive}.{part}`"),
                    _ => format!("set `{path}` itself, or make it a table: `--set '{path}={{ {part} = ... }}'`"),
                };
                return Err(fault(format!("`{path}` is {shown}: it has no key `{part}`"), Some(help)));
            }
        }
    }
    *at = node;
    Ok(())
}

/// The keys of a case that are lists of tables.
pub(crate) const LISTS: [&str; 3] = ["electrode", "source", "grains"];

/// Keys that one may try to set without saying of which entry.
const KEYS_OF_ENTRIES: [&str; 15] = [
    "shape", "center", "axis", "up", "dc", "rf", "charge", "panels", "kind", "count", "mass", "density", "radius",
    "place", "speed",
];

/// The `=` between key and value: the first outside quotes.
fn equals_sign(argument: &str) -> Option<usize> {
    let mut quote = None;
    argument.char_indices().find_map(|(at, c)| {
        match quote {
            Some(open) if c == open => quote = None,
            None if matches!(c, '"' | '\'') => quote = Some(c),
            None if c == '=' => return Some(at),
            _ => {}
        }
        None
    })
}

fn no_entry(
    list_path: &str,
    part: &str,
    rest: &[String],
    count: usize,
    names: &[String],
    fault: impl Fn(String, Option<String>) -> SetFault,
) -> SetFault {
    if !LISTS.contains(&list_path) {
        let help = if count == 0 { "the list is empty".to_owned() } else { format!("its entries are 1 to {count}") };
        return fault(format!("`{list_path}` is a list: it has no entry `{part}`"), Some(help));
    }
    if rest.len() == 1 && KEYS_OF_ENTRIES.contains(&part) {
        // grains.mass: which group is left out
        let which = names.first().map_or("1", String::as_str);
        let help = format!("say which one: `{list_path}.{which}.{part}`");
        return fault(format!("`{list_path}` is a list: it has no entry `{part}`"), Some(help));
    }
    let known = if names.is_empty() {
        format!("the case has {count} without names: use their numbers from 1")
    } else {
        let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        format!("the case has {}", list(&quoted, "and"))
    };
    let help = match nearest(part, names) {
        Some(name) => format!("did you mean `{name}`? {}", known.replacen("the case", "The case", 1)),
        None => known,
    };
    let noun = if list_path == "grains" { "group of grains" } else { list_path };
    fault(format!("there is no {noun} `{part}`"), Some(help))
}

/// The value of an argument: TOML, or else a bare string.
fn value(argument: &str, start: usize, origin: Origin, key: &str) -> Result<Node, SetFault> {
    let text = argument[start..].trim();
    let start = start + (argument[start..].len() - argument[start..].trim_start().len());
    let span = Span { origin, start, end: start + text.len() };
    let fault = |span, problem: String, help: &str| SetFault {
        span,
        key: key.to_owned(),
        problem,
        help: Some(help.to_owned()),
    };
    if text.is_empty() {
        let span = Span { origin, start: 0, end: argument.len() };
        return Err(fault(
            span,
            format!("`--set {argument}` has no value"),
            "write key=value; an empty string is '\"\"'",
        ));
    }
    if crate::syntax::too_deep(text).is_some() {
        return Err(fault(span, "the value holds a key of too many parts".to_owned(), "no key of a case has"));
    }
    const HEAD: &str = "x = ";
    let document = format!("{HEAD}{text}");
    let shift = Shift { origin, by: start as isize - HEAD.len() as isize };
    match DeTable::parse(&document) {
        Ok(table) => {
            let Node { value: Value::Table(mut entries), .. } = Node::from_toml(table.get_ref(), table.span(), shift)
            else {
                return Ok(Node { span, value: Value::String(text.to_owned()) });
            };
            match (entries.pop(), entries.is_empty()) {
                (Some(entry), true) => Ok(entry.node),
                _ => Err(fault(span, "the value spans several lines".to_owned(), "set one key at a time")),
            }
        }
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => {
            let range = error.span().unwrap_or(0..0);
            let at = |position: usize| (position + start).saturating_sub(HEAD.len()).clamp(start, span.end);
            let span = Span { origin, start: at(range.start), end: at(range.end) };
            let help =
                "inside lists and tables, strings stand in quotes: `--set 'electrode.left.center=[\"1 mm\", 0, 0]'`";
            Err(fault(span, crate::syntax::rephrased(error.message(), document.get(range.clone()).unwrap_or("")), help))
        }
        Err(_) => Ok(Node { span, value: Value::String(text.to_owned()) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASE: &str = r#"
[[electrode]]
name = "left"
rf = { amplitude = "300 V" }
center = [0, 0, 0]
[[electrode]]
name = "right"
rf = "main"
[[grains]]
place = { kind = "ball", radius = 1 }
"#;

    fn tree() -> Node {
        let table = DeTable::parse(CASE).unwrap();
        Node::from_toml(table.get_ref(), table.span(), Shift { origin: Origin::File, by: 0 })
    }

    fn at<'t>(tree: &'t Node, path: &str) -> &'t Value {
        let parts = split(path).unwrap();
        let segments = tree.resolve(&parts);
        let found = tree.find(&segments);
        assert_eq!(found.depth, parts.len(), "{path}");
        &found.node.value
    }

    #[test]
    fn sets_any_key() {
        let mut tree = tree();
        for (n, argument) in [
            "electrode.left.dc=7 V",
            "electrode.left.rf.amplitude = \"1 kV\"",
            "electrode.left.center=[0, 0, \"1 m\"]",
            "electrode.2.rf.frequency=60",
        ]
        .iter()
        .enumerate()
        .take(3)
        {
            set(&mut tree, argument, n).unwrap();
        }
        set(&mut tree, "grains.1.place.radius=2", 0).unwrap();
        set(&mut tree, "field.accuracy=1e-3", 0).unwrap();
        set(&mut tree, "electrode.left.center.1=5", 0).unwrap();
        assert!(matches!(at(&tree, "electrode.left.dc"), Value::String(s) if s == "7 V"));
        assert!(matches!(at(&tree, "electrode.left.rf.amplitude"), Value::String(s) if s == "1 kV"));
        assert!(matches!(at(&tree, "electrode.left.center.3"), Value::String(s) if s == "1 m"));
        assert!(matches!(at(&tree, "electrode.left.center.1"), Value::Integer(5)));
        assert!(matches!(at(&tree, "grains.1.place.radius"), Value::Integer(2)));
        assert!(matches!(at(&tree, "field.accuracy"), Value::Float(_)));
    }

    #[test]
    fn spans_point_into_the_argument() {
        let mut tree = tree();
        let argument = "electrode.left.center=[0, 0, \"1 m\"]";
        set(&mut tree, argument, 3).unwrap();
        let segments = tree.resolve(&split("electrode.left.center.3").unwrap());
        let span = tree.find(&segments).node.span;
        assert_eq!((span.origin, &argument[span.start..span.end]), (Origin::Set(3), "\"1 m\""));
    }

    #[test]
    fn messages_name_what_there_is() {
        let message = |argument| {
            let fault = set(&mut tree(), argument, 0).unwrap_err();
            format!("{}\n{}", fault.problem, fault.help.unwrap_or_default())
        };
        let unknown = message("electrode.rihgt.dc=1");
        assert!(unknown.contains("there is no electrode `rihgt`") && unknown.contains("did you mean `right`?"));
        assert!(unknown.contains("`left` and `right`"));
        assert!(message("electrode.right.rf.amplitude=1").contains("`drive.main.amplitude`"));
        assert!(message("grains.mass=1").contains("`grains.1.mass`"));
        assert!(message("source.tip.dc=1").contains("[[source]]"));
        assert!(message("electrode.left.dc").contains("has no `=`"));
        assert!(message("electrode.left.dc=").contains("has no value"));
        assert!(message("=3").contains("empty part"));
        assert!(message("electrode.left.center=[0, 0, 1 m]").contains("quotes"));
        assert!(message("electrode.left.center.4=1").contains("1 to 3"));
        assert!(message("a=1\nb=2").contains("several lines"));
    }
}
