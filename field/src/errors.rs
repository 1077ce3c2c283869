//! How wrong a solution is.

use serde::{Deserialize, Serialize};

/// Estimated relative errors of a solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Largest error of an entry of the capacitance matrix, against its largest entry.
    pub capacitance: f64,
    /// Largest error of a unit field in the trap region, against the strongest there of the same basis function.
    pub field: f64,
}

impl Errors {
    /// The larger one; no number if one is none.
    pub fn worst(self) -> f64 {
        if self.capacitance.is_nan() || self.field.is_nan() { f64::NAN } else { self.capacitance.max(self.field) }
    }

    /// Both times a factor.
    pub fn times(self, factor: f64) -> Self {
        Self { capacitance: factor * self.capacitance, field: factor * self.field }
    }
}
