//! A case file as a tree that remembers where everything was written.
//!
//! *Why a tree of our own, and not `toml::de::DeTable`*: values from the command line (`--set`) stand in the same tree with
//! spans into other texts, and the reader on top of it (see [`crate::reader`]) must say for every error which key, which
//! alternatives and which line, where `toml::de::Error` keeps a sentence.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use crate::key_path::{Segment, is_bare};

/// Where a text was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// In the case file.
    File,
    /// In a `--set`, counted from zero.
    Set(usize),
}

/// Some bytes of one of these texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub origin: Origin,
    pub start: usize,
    pub end: usize,
}

/// A value and where it was written (for a table with a header: the header).
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub span: Span,
    pub value: Value,
}

/// A TOML value.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    String(String),
    Integer(i64),
    /// Also integers beyond 64 bits.
    Float(f64),
    Boolean(bool),
    /// Case files have no use for dates; kept for the message.
    Date,
    List(Vec<Node>),
    Table(Vec<Entry>),
}

/// A key of a table, its place, its value; in the order of the file.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: String,
    pub key_span: Span,
    pub node: Node,
}

/// What a path leads to: the node, or the last one on the way that exists.
pub(crate) struct Found<'t> {
    pub node: &'t Node,
    /// Where the key of the node stands; none for entries of lists and for the root.
    pub key_span: Option<Span>,
    /// How many steps of the path exist.
    pub depth: usize,
}

/// Which text spans point into, and by how much they are shifted there.
#[derive(Clone, Copy)]
pub(crate) struct Shift {
    pub origin: Origin,
    /// Added to every position.
    pub by: isize,
}

impl Shift {
    fn span(self, range: Range<usize>) -> Span {
        let shifted = |at: usize| at.saturating_add_signed(self.by);
        Span { origin: self.origin, start: shifted(range.start), end: shifted(range.end) }
    }
}

impl Node {
    /// The tree of a parsed table.
    pub fn from_toml(table: &DeTable, range: Range<usize>, shift: Shift) -> Self {
        let mut entries: Vec<Entry> = table
            .iter()
            .map(|(key, value)| Entry {
                key: key.get_ref().to_string(),
                key_span: shift.span(key.span()),
                node: Self::from_value(value.get_ref(), value.span(), shift),
            })
            .collect();
        entries.sort_by_key(|entry| entry.key_span.start);
        Self { span: shift.span(range), value: Value::Table(entries) }
    }

    fn from_value(value: &DeValue, range: Range<usize>, shift: Shift) -> Self {
        let value = match value {
            DeValue::String(text) => Value::String(text.to_string()),
            DeValue::Integer(integer) => match i64::from_str_radix(integer.as_str(), integer.radix()) {
                Ok(value) => Value::Integer(value),
                Err(_) => Value::Float(integer.as_str().parse().unwrap_or(f64::INFINITY)),
            },
            DeValue::Float(float) => Value::Float(float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(value) => Value::Boolean(*value),
            DeValue::Datetime(_) => Value::Date,
            DeValue::Array(values) => {
                Value::List(values.iter().map(|v| Self::from_value(v.get_ref(), v.span(), shift)).collect())
            }
            DeValue::Table(table) => return Self::from_toml(table, range, shift),
        };
        Self { span: shift.span(range), value }
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entry(key).map(|entry| &entry.node)
    }

    /// A key with its place.
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        match &self.value {
            Value::Table(entries) => entries.iter().find(|entry| entry.key == key),
            _ => None,
        }
    }

    /// The keys of a table, in the order of the file.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        let entries = match &self.value {
            Value::Table(entries) => entries.as_slice(),
            _ => &[],
        };
        entries.iter().map(|entry| entry.key.as_str())
    }

    /// The entries of a list.
    pub fn entries(&self) -> &[Node] {
        match &self.value {
            Value::List(entries) => entries,
            _ => &[],
        }
    }

    /// The name of an entry of a list of tables.
    pub fn name(&self) -> Option<&str> {
        match self.get("name").map(|node| &node.value) {
            Some(Value::String(name)) => Some(name),
            _ => None,
        }
    }

    /// Follows a path as far as it goes.
    pub fn find(&self, path: &[Segment]) -> Found<'_> {
        let mut found = Found { node: self, key_span: None, depth: 0 };
        for segment in path {
            let next = match segment {
                Segment::Key(key) => found.node.entry(key).map(|entry| (&entry.node, Some(entry.key_span))),
                Segment::Entry(n) => found.node.entries().get(*n).map(|node| (node, None)),
            };
            let Some((node, key_span)) = next else { break };
            found = Found { node, key_span, depth: found.depth + 1 };
        }
        found
    }

    /// A path as people write it: entries of lists by name where they have one of their own, else by number from one.
    pub fn display(&self, path: &[Segment]) -> String {
        let mut at = Some(self);
        let mut parts = Vec::with_capacity(path.len());
        for segment in path {
            let list = at;
            at = at.and_then(|node| match segment {
                Segment::Key(key) => node.get(key),
                Segment::Entry(n) => node.entries().get(*n),
            });
            let unique = at.and_then(Node::name).filter(|name| {
                let same = list.map_or(0, |list| list.entries().iter().filter(|e| e.name() == Some(name)).count());
                same == 1 && is_bare(name)
            });
            parts.push(match (segment, unique) {
                (Segment::Entry(_), Some(name)) => Segment::Key(name.to_owned()).to_string(),
                _ => segment.to_string(),
            });
        }
        parts.join(".")
    }

    /// Turns names and numbers into steps; what does not exist stays a key.
    pub fn resolve(&self, parts: &[String]) -> Vec<Segment> {
        let mut at = Some(self);
        parts
            .iter()
            .map(|part| {
                let segment = match at.filter(|node| matches!(node.value, Value::List(_))) {
                    Some(list) => position(list.entries(), part).map(Segment::Entry),
                    None => None,
                }
                .unwrap_or_else(|| Segment::Key(part.clone()));
                at = at.and_then(|node| match &segment {
                    Segment::Key(key) => node.get(key),
                    Segment::Entry(n) => node.entries().get(*n),
                });
                segment
            })
            .collect()
    }

    /// Its type in words.
    pub fn type_name(&self) -> &'static str {
        match self.value {
            Value::String(_) => "a string",
            Value::Integer(_) | Value::Float(_) => "a number",
            Value::Boolean(_) => "a boolean",
            Value::Date => "a date",
            Value::List(_) => "a list",
            Value::Table(_) => "a table",
        }
    }
}

/// The entry of a list that is called `part`: by its `name`, or else its number from one, or else the name that an entry
/// without one is given (source1, grains1).
pub(crate) fn position(entries: &[Node], part: &str) -> Option<usize> {
    entries.iter().position(|entry| entry.name() == Some(part)).or_else(|| {
        let given = ["source", "grains"].into_iter().find_map(|noun| part.strip_prefix(noun));
        let number: usize = given.unwrap_or(part).parse().ok()?;
        let entry = entries.get(number.checked_sub(1)?)?;
        (given.is_none() || entry.name().is_none()).then(|| number - 1)
    })
}
