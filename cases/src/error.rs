//! The one error a wrong case gives: which file, line, key and value, what was expected, what to change.

use std::fmt;
use std::ops::{Deref, Range};

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode};
use serde_json::json;

/// A case that cannot be run, and what to do about it.
///
/// It displays as one line, `case.toml:12:15: electrode.left.radius: ...`; [`CaseError::report`] shows the lines of the file
/// with the wrong place underlined, [`CaseError::json`] is for programs.
#[derive(Clone, thiserror::Error)]
#[error("{}", self.headline())]
pub struct CaseError(Box<Details>);

/// What a [`CaseError`] knows.
#[derive(Clone, Debug)]
pub struct Details {
    /// The case file as it was named.
    pub file: String,
    /// The `--set` argument at fault, where it is not the file.
    pub set: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Column in that line, in characters, from 1.
    pub column: Option<usize>,
    /// The key path, as `electrode.left.radius`: list entries by name, else by number from 1.
    pub key: Option<String>,
    /// The value as it is written.
    pub value: Option<String>,
    /// What is wrong and what was expected.
    pub problem: String,
    /// What to change.
    pub help: Option<String>,
    /// The text at fault: the case file's, or the `--set` argument.
    text: String,
    /// The bytes of it to underline.
    range: Option<Range<usize>>,
    /// Words under them.
    label: Option<String>,
    /// The problem names the key itself.
    names_key: bool,
}

impl Deref for CaseError {
    type Target = Details;

    fn deref(&self) -> &Details {
        &self.0
    }
}

/// How an error is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// Lines and arrows of Unicode; else of ASCII.
    pub unicode: bool,
    /// Colours of a terminal.
    pub color: bool,
    /// Columns at which sentences are wrapped.
    pub width: usize,
}

impl Look {
    /// For files, pipes and logs: ASCII, no colours, long lines.
    pub const PLAIN: Self = Self { unicode: false, color: false, width: 120 };
    /// For a terminal.
    pub const TERMINAL: Self = Self { unicode: true, color: true, width: 80 };

    /// What suits standard error: [`Look::TERMINAL`] on a terminal (without colours where `NO_COLOR` is set), else plain.
    pub fn of_stderr() -> Self {
        if std::io::IsTerminal::is_terminal(&std::io::stderr()) {
            let color = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
            Self { color, ..Self::TERMINAL }
        } else {
            Self::PLAIN
        }
    }
}

/// What is wrong, before it is known where.
#[derive(Default)]
pub(crate) struct Complaint {
    pub key: Option<String>,
    pub value: Option<String>,
    pub problem: String,
    pub help: Option<String>,
    pub label: Option<String>,
    /// The problem names the key: it need not be said twice.
    pub names_key: bool,
}

impl CaseError {
    /// An error at some bytes of a text: the case file's, or that of the `--set` argument `set`.
    pub(crate) fn at(file: &str, set: Option<&str>, text: &str, range: Option<Range<usize>>, what: Complaint) -> Self {
        let range = range.map(|range| underlined(text, range));
        let (line, column) = match &range {
            Some(range) if set.is_none() => {
                let before = &text[..range.start];
                let start = before.rfind('\n').map_or(0, |at| at + 1);
                (Some(before.matches('\n').count() + 1), Some(before[start..].chars().count() + 1))
            }
            _ => (None, None),
        };
        let Complaint { key, value, problem, help, label, names_key } = what;
        Self(Box::new(Details {
            file: file.to_owned(),
            set: set.map(str::to_owned),
            line,
            column,
            key,
            value,
            problem,
            help,
            text: text.to_owned(),
            range,
            label,
            names_key,
        }))
    }

    /// An error about the file as a whole.
    pub(crate) fn of_file(file: &str, problem: impl Into<String>, help: Option<&str>) -> Self {
        let what = Complaint { problem: problem.into(), help: help.map(str::to_owned), ..Complaint::default() };
        Self::at(file, None, "", None, what)
    }

    fn headline(&self) -> String {
        let mut line = self.file.clone();
        if let (Some(at), Some(column)) = (self.line, self.column) {
            line += &format!(":{at}:{column}");
        }
        if let Some(set) = &self.set {
            line += &format!(", --set '{set}'");
        }
        format!("{line}: {}", self.sentence())
    }

    /// Key and problem.
    fn sentence(&self) -> String {
        match &self.key {
            Some(key) if !self.0.names_key => format!("{key}: {}", self.problem),
            _ => self.problem.clone(),
        }
    }

    /// The message for people: what is wrong, the lines of the file with the place underlined, what to change.
    pub fn report(&self, look: Look) -> String {
        let mut theme = match (look.unicode, look.color) {
            (true, true) => GraphicalTheme::unicode(),
            (true, false) => GraphicalTheme::unicode_nocolor(),
            (false, true) => GraphicalTheme::ascii(),
            (false, false) => GraphicalTheme::none(),
        };
        theme.characters.error = "error:".to_owned();
        let handler = GraphicalReportHandler::new_themed(theme).with_width(look.width.max(40)).with_links(false);
        let mut text = String::new();
        let snippet = Snippet::of(self);
        match handler.render_report(&mut text, &snippet) {
            Ok(()) => text.trim_end().to_owned() + "\n",
            Err(_) => format!("{self}\n{}\n", self.help.as_deref().unwrap_or_default()),
        }
    }

    /// The message for programs.
    pub fn json(&self) -> serde_json::Value {
        json!({
            "error": {
                "message": self.to_string(),
                "file": self.file,
                "line": self.line,
                "column": self.column,
                "set": self.set,
                "key": self.key,
                "value": self.value,
                "problem": self.problem,
                "help": self.help,
            }
        })
    }
}

/// Lines longer than this are not drawn: whoever reads the message finds the place faster by line and column.
const LONGEST_LINE: usize = 200;

/// Whether the line at `position` is short enough to be drawn.
fn drawable(text: &str, position: usize) -> bool {
    let start = text[..position].rfind('\n').map_or(0, |at| at + 1);
    let end = text[position..].find('\n').map_or(text.len(), |at| position + at);
    end - start <= LONGEST_LINE
}

/// The range made drawable: within the text, at least one character, at character boundaries, and of a value of several
/// lines the first.
fn underlined(text: &str, range: Range<usize>) -> Range<usize> {
    let mut start = range.start.min(text.len());
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    let mut end = range.end.clamp(start, text.len());
    while !text.is_char_boundary(end) {
        end += 1;
    }
    let first_line = text[start..end].lines().next().unwrap_or("");
    end = start + first_line.trim_end().len();
    if end == start
        && let Some(c) = text[start..].chars().next().filter(|c| !c.is_whitespace())
    {
        end += c.len_utf8();
    }
    start..end
}

impl fmt::Debug for CaseError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.report(Look::PLAIN))
    }
}

impl Diagnostic for CaseError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.range.as_ref().map(|_| &self.0.text as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.range.as_ref().map(|range| {
            let label = LabeledSpan::new_with_span(self.0.label.clone(), range.clone());
            Box::new(std::iter::once(label)) as Box<dyn Iterator<Item = LabeledSpan>>
        })
    }
}

/// A [`CaseError`] drawn: file and line stand above the lines of the file, so the first sentence leaves them out.
#[derive(Debug, thiserror::Error)]
#[error("{sentence}")]
struct Snippet<'e> {
    sentence: String,
    error: &'e CaseError,
    lines: Option<NamedSource<String>>,
}

impl<'e> Snippet<'e> {
    fn of(error: &'e CaseError) -> Self {
        let name = match &error.set {
            Some(_) => format!("--set (for {})", error.file),
            None => error.file.clone(),
        };
        let drawn = error.range.as_ref().is_some_and(|range| drawable(&error.0.text, range.start));
        let lines = drawn.then(|| NamedSource::new(name, error.0.text.replace('\r', " ")));
        let sentence = if lines.is_some() { error.sentence() } else { error.headline() };
        Self { sentence, error, lines }
    }
}

impl Diagnostic for Snippet<'_> {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.error.help()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.lines.as_ref().map(|lines| lines as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.lines.as_ref().and_then(|_| self.error.labels())
    }
}
