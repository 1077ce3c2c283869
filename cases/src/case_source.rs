//! Where a case was written: its text, the `--set` arguments, and the way from a key path to a line.

use std::path::{Path, PathBuf};

use toml::de::DeTable;

use crate::error::{CaseError, Complaint};
use crate::key_path::{Segment, split};
use crate::set::set;
use crate::syntax;
use crate::tree::{Node, Origin, Shift, Span, Value};

/// The text of a case, kept so that whatever is found wrong later can still be shown where it was written.
#[derive(Clone, Debug)]
pub struct CaseSource {
    /// The case file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// What was set on the command line, as `key=value`, in order.
    pub sets: Vec<String>,
    pub(crate) tree: Node,
}

/// What of a key is underlined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    /// Its value.
    Value,
    /// The key itself.
    Key,
    /// The key itself, which the problem names in full.
    UnknownKey,
}

impl CaseSource {
    /// Reads a case file's text into a tree and applies the `--set` arguments.
    pub(crate) fn read(path: &Path, sets: &[String]) -> Result<Self, CaseError> {
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|error| {
            let help = match error.kind() {
                std::io::ErrorKind::NotFound => Some("give the path of a case file, as in `cases/ring_trap/case.toml`"),
                _ if path.is_dir() => Some("this is a folder: give the case.toml in it"),
                _ => None,
            };
            CaseError::of_file(&file, format!("cannot be read: {}", reason(&error)), help)
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let line = error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
            CaseError::of_file(
                &format!("{file}:{line}"),
                "is not UTF-8 text",
                Some("save the file as UTF-8 in your editor; a µ in another encoding is the usual cause, `u` does as well"),
            )
        })?;
        Self::parse(path, text, sets)
    }

    /// The same from a text at hand; `path` names it in messages and is where relative paths start.
    pub(crate) fn parse(path: &Path, text: String, sets: &[String]) -> Result<Self, CaseError> {
        let file = path.display().to_string();
        // A byte order mark is no part of the first key; editors on Windows write one.
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        if let Some(at) = syntax::too_deep(&text) {
            let problem = format!("a key has more than {} parts", syntax::DEEPEST_KEY);
            let what = Complaint { problem, help: Some("no key of a case has".to_owned()), ..Complaint::default() };
            return Err(CaseError::at(&file, None, &text, Some(at..at + 1), what));
        }
        let (table, errors) = DeTable::parse_recoverable(&text);
        if let Some(error) = errors.first() {
            let fault = syntax::fault(&text, error, table.get_ref());
            let what = Complaint { key: fault.key, problem: fault.problem, help: fault.help, ..Complaint::default() };
            return Err(CaseError::at(&file, None, &text, Some(fault.range), what));
        }
        let mut tree = Node::from_toml(table.get_ref(), 0..0, Shift { origin: Origin::File, by: 0 });
        for (number, argument) in sets.iter().enumerate() {
            set(&mut tree, argument, number).map_err(|fault| {
                let what = Complaint {
                    key: Some(fault.key).filter(|key| !key.is_empty()),
                    problem: fault.problem,
                    help: fault.help,
                    ..Complaint::default()
                };
                let range = fault.span.start..fault.span.end;
                CaseError::at(&file, Some(argument), argument, Some(range), what)
            })?;
        }
        Ok(Self { path: path.to_owned(), text, sets: sets.to_vec(), tree })
    }

    /// The folder that relative paths in the case start from.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// An error at a key of the case, such as `electrode.left.center`, wherever it was found out: shown at the key's value,
    /// at the header of its table where the key is not written, or at the `--set` that wrote it.
    pub fn error_at(&self, key: &str, problem: impl Into<String>, help: impl Into<String>) -> CaseError {
        let parts = split(key).unwrap_or_else(|_| vec![key.to_owned()]);
        let path = self.tree.resolve(&parts);
        self.error(&path, Mark::Value, problem.into(), Some(help.into()), None)
    }

    /// An error at a path of the tree.
    pub(crate) fn error(
        &self,
        path: &[Segment],
        mark: Mark,
        problem: String,
        help: Option<String>,
        label: Option<String>,
    ) -> CaseError {
        let found = self.tree.find(path);
        let span = match (mark, found.key_span) {
            _ if found.depth == 0 => None,
            (Mark::Key | Mark::UnknownKey, Some(key_span)) if found.depth == path.len() => Some(key_span),
            _ => Some(found.node.span),
        };
        let what = Complaint {
            key: Some(self.tree.display(path)).filter(|key| !key.is_empty()),
            value: self.literal(path),
            problem,
            help: help.filter(|help| !help.is_empty()),
            label,
            names_key: mark == Mark::UnknownKey,
        };
        let file = self.path.display().to_string();
        let Some(span) = span else {
            return CaseError::at(&file, None, &self.text, None, what);
        };
        let (set, text) = self.text_of(span.origin);
        CaseError::at(&file, set, text, Some(span.start..span.end), what)
    }

    fn text_of(&self, origin: Origin) -> (Option<&str>, &str) {
        match origin {
            Origin::File => (None, &self.text),
            Origin::Set(number) => {
                let argument = self.sets.get(number).map_or("", String::as_str);
                (Some(argument), argument)
            }
        }
    }

    /// The text of a span.
    pub(crate) fn slice(&self, span: Span) -> &str {
        self.text_of(span.origin).1.get(span.start..span.end).unwrap_or("")
    }

    /// The value at a path as it is written, if it is written and not a table of its own.
    pub(crate) fn literal(&self, path: &[Segment]) -> Option<String> {
        let found = self.tree.find(path);
        if found.depth < path.len() || path.is_empty() {
            return None;
        }
        let text = self.slice(found.node.span).trim();
        let inline = !matches!(found.node.value, Value::Table(_)) || text.starts_with('{');
        // A value set without quotes on the command line is a string like any other.
        let bare = matches!(found.node.value, Value::String(_)) && !text.starts_with(['"', '\'']);
        (inline && !text.is_empty()).then(|| if bare { format!("\"{text}\"") } else { text.to_owned() })
    }
}

/// Why a file could not be read, without the "(os error 2)".
pub(crate) fn reason(error: &std::io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default();
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_lowercase().chain(letters).collect(),
        None => "unknown error".to_owned(),
    }
}
