//! A place in a case, from which errors know where they are.

use crate::case_source::{CaseSource, Mark};
use crate::error::CaseError;
use crate::explain::shown;
use crate::key_path::Segment;

/// A key of the case, written or not.
#[derive(Clone)]
pub(super) struct At<'s> {
    pub source: &'s CaseSource,
    path: Vec<Segment>,
}

impl<'s> At<'s> {
    /// The whole case.
    pub fn root(source: &'s CaseSource) -> Self {
        Self { source, path: Vec::new() }
    }

    /// A key of this table.
    pub fn key(&self, key: &str) -> Self {
        self.down(Segment::Key(key.to_owned()))
    }

    /// An entry of this list, from zero.
    pub fn entry(&self, n: usize) -> Self {
        self.down(Segment::Entry(n))
    }

    fn down(&self, segment: Segment) -> Self {
        let mut path = self.path.clone();
        path.push(segment);
        Self { source: self.source, path }
    }

    /// Whether it is written.
    pub fn written(&self) -> bool {
        self.source.tree.find(&self.path).depth == self.path.len()
    }

    /// The value as it is written, short enough for a sentence.
    pub fn shown(&self) -> String {
        shown(self.source, &self.path)
    }

    /// The text of the value.
    pub fn text(&self) -> &str {
        let found = self.source.tree.find(&self.path);
        self.source.slice(found.node.span)
    }

    /// An error about the value. `{value}` stands for it as it is written.
    pub fn error(&self, problem: impl Into<String>, help: impl Into<String>) -> CaseError {
        self.marked(Mark::Value, problem.into(), help.into())
    }

    /// An error about the key itself.
    pub fn key_error(&self, problem: impl Into<String>, help: impl Into<String>) -> CaseError {
        self.marked(Mark::Key, problem.into(), help.into())
    }

    fn marked(&self, mark: Mark, problem: String, help: String) -> CaseError {
        let problem = problem.replace("{value}", &self.shown());
        self.source.error(&self.path, mark, problem, Some(help), None)
    }

    /// An error about a key of this table that is not there but should be.
    pub fn missing(&self, key: &str, why: &str, help: impl Into<String>) -> CaseError {
        let why = if why.is_empty() { String::new() } else { format!(": {why}") };
        let label = Some(format!("no `{key}` here"));
        self.source.error(&self.path, Mark::Value, format!("`{key}` is missing{why}"), Some(help.into()), label)
    }

    /// The line of the file in which the key stands, for messages that compare two places.
    pub fn line(&self) -> Option<usize> {
        self.error("", "").line
    }
}
