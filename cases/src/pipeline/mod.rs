//! From a case to its results: surface, solution, table, flights.
//!
//! Each stage is a plain value made from the one before; what is wrong with the case that shows only here (electrodes that
//! touch, grains inside a conductor, work that does not fit in memory) is a [`CaseError`] at the key that causes it, before the
//! work starts.

pub mod analysis;
mod axial;
pub mod choice;
mod curved;
pub mod drives;
pub mod flights;
pub mod memory;
pub mod ready;
pub mod region;
pub mod solution;
pub mod surface;
pub mod tables;

use crate::CaseError;

/// Why a run ended without results.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Failure {
    /// The case is wrong, or the command was used wrongly: exit status 2.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The command was used wrongly: exit status 2.
    #[error("{problem}")]
    Usage {
        /// What is wrong.
        problem: String,
        /// What to change.
        help: String,
    },
    /// The run failed: exit status 1.
    #[error("{problem}")]
    Run {
        /// What happened.
        problem: String,
        /// What can be done about it.
        help: String,
    },
}

impl Failure {
    /// A failure of the run.
    pub fn run(problem: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Run { problem: problem.into(), help: help.into() }
    }

    /// A wrong use of the command.
    pub fn usage(problem: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Usage { problem: problem.into(), help: help.into() }
    }

    /// Exit status of the command.
    pub fn status(&self) -> u8 {
        match self {
            Self::Case(_) | Self::Usage { .. } => 2,
            Self::Run { .. } => 1,
        }
    }
}

/// Who is told how far the work is.
pub trait Reporter: Send + Sync {
    /// A stage begins.
    fn stage(&self, name: &str);

    /// The fraction of the stage that is done, from 0 to 1; from any thread.
    fn fraction(&self, done: f64);

    /// Something a person should know, though the run goes on.
    fn warning(&self, text: &str);
}

/// Tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Reporter for Silent {
    fn stage(&self, _: &str) {}
    fn fraction(&self, _: f64) {}
    fn warning(&self, _: &str) {}
}
