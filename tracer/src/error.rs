//! What can go wrong in a run.

use meshes::Vec3;
use thiserror::Error;

use crate::DragError;

/// Why a run could not be done.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TraceError {
    /// An option makes no sense.
    #[error("option {option} is {value}; give {expected}")]
    Option {
        /// Which.
        option: &'static str,
        /// What it was.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// The integrator cannot do what the forces ask for.
    #[error("{method} cannot be used: {reason}; {advice}")]
    Method {
        /// Which integrator.
        method: &'static str,
        /// What stands against it.
        reason: &'static str,
        /// What to change.
        advice: &'static str,
    },
    /// The drag on a grain cannot be told.
    #[error("grain {grain}: {source}")]
    Drag {
        /// Index in the ensemble.
        grain: usize,
        /// What is wrong.
        source: DragError,
    },
    /// What was to be resumed is of other grains.
    #[error("grain {grain} of the flights to resume is not among the {grains} of the ensemble")]
    Resume {
        /// Index in an ensemble.
        grain: usize,
        /// How many there are.
        grains: usize,
    },
    /// Where the flights stand cannot be kept.
    #[error("{0}")]
    Journal(String),
    /// The tolerance asks for a step so small that time no longer advances.
    #[error(
        "grain {grain} at {} {} {} m, time {time} s: tolerance {tolerance} asks for a step below {step} s; \
         {advice}", position.x, position.y, position.z
    )]
    StepUnderflow {
        /// Index in the ensemble.
        grain: usize,
        /// m.
        position: Vec3,
        /// s.
        time: f64,
        /// s.
        step: f64,
        /// What was asked.
        tolerance: f64,
        /// What to change.
        advice: &'static str,
    },
}
