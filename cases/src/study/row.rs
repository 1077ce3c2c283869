//! What is reported of a point.

use serde::{Deserialize, Serialize};

use crate::CaseError;
use crate::pipeline::Failure;

/// A reported number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// What it is, as `A2_rf`.
    pub name: String,
    /// Its unit, SI; empty for pure numbers.
    pub unit: String,
    /// The number; `None` where there is none, or where it is not finite.
    pub value: Option<f64>,
    /// Its estimated error, in the same unit; `None` of counts and of errors.
    pub error: Option<f64>,
}

impl Number {
    /// A number with an error.
    pub fn new(name: impl Into<String>, unit: &str, value: f64, error: impl Into<Option<f64>>) -> Self {
        let finite = |x: f64| x.is_finite().then_some(x);
        Self { name: name.into(), unit: unit.to_owned(), value: finite(value), error: error.into().and_then(finite) }
    }
}

/// How a point ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// With these numbers.
    Done(Vec<Number>),
    /// With none: the case cannot be at this point.
    Refused(String),
    /// With none: the work failed. It is tried again when the study goes on.
    Failed(String),
}

/// A point and what is reported of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// From 0, in the order of the sweep.
    pub point: usize,
    /// The value of each varied key, as it is written.
    pub values: Vec<String>,
    /// Its numbers, or why there are none.
    pub end: End,
    /// What a person should know.
    pub warnings: Vec<String>,
}

impl End {
    /// Of a point that came to nothing.
    pub fn of(failure: &Failure) -> Self {
        match failure {
            Failure::Case(error) => Self::refused(error),
            Failure::Usage { problem, .. } => Self::Refused(problem.clone()),
            Failure::Run { problem, .. } => Self::Failed(problem.clone()),
        }
    }

    /// Of a point whose values make no case: key and problem. Which file it was, and which machine's, is all the same to a row.
    pub fn refused(error: &CaseError) -> Self {
        Self::Refused(match &error.key {
            Some(key) => format!("{key}: {}", error.problem),
            None => error.problem.clone(),
        })
    }
}

impl Row {
    /// Its numbers; none if it failed.
    pub fn numbers(&self) -> &[Number] {
        match &self.end {
            End::Done(numbers) => numbers,
            End::Refused(_) | End::Failed(_) => &[],
        }
    }

    /// One of its numbers.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.numbers().iter().find(|number| number.name == name)?.value
    }

    /// Why there are no numbers.
    pub fn reason(&self) -> Option<&str> {
        match &self.end {
            End::Done(_) => None,
            End::Refused(reason) | End::Failed(reason) => Some(reason),
        }
    }
}
