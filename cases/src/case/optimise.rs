//! What a study optimises.

use serde::Serialize;

use super::{Goal, Optimiser};
use crate::study::expression::Expression;

/// An objective, what is varied for it, and what must hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimise {
    /// Over the numbers of a row and what is varied.
    pub objective: Expression,
    /// Which way is better.
    pub goal: Goal,
    /// What must hold.
    pub constraints: Vec<Constraint>,
    /// What is varied, at least one; in alphabetical order.
    pub varied: Vec<Varied>,
    /// Keys that follow.
    pub ties: Vec<Tie>,
    /// How many cases may be worked out.
    pub evaluations: usize,
    /// Part of each range to which the optimum is to be known.
    pub tolerance: f64,
    /// What searches.
    pub optimiser: Optimiser,
    /// From how many places.
    pub starts: usize,
    /// Of places after the first.
    pub seed: u64,
}

/// Something that is varied between bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Varied {
    /// A key path of the case, or a name that ties use.
    pub key: String,
    /// Whether it is a key of the case.
    pub is_key: bool,
    /// Least and largest value, in the unit.
    pub range: [f64; 2],
    /// Where the search starts, in the unit.
    pub start: f64,
    /// Only whole steps above the least value, in the unit.
    pub step: Option<f64>,
    /// Empty for pure numbers.
    pub unit: String,
    /// Equal ratios count alike.
    pub log: bool,
}

/// A key that follows others.
#[derive(Clone, Debug, PartialEq)]
pub struct Tie {
    /// A key path of the case.
    pub key: String,
    /// In SI, over what is varied.
    pub value: Expression,
}

/// `left <= right`.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// As it is written in the case.
    pub text: String,
    /// The side that must not be larger.
    pub small: Expression,
    /// The side that must not be smaller.
    pub large: Expression,
}

/// Which numbers a study works out of each point, beside those of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Asked {
    /// How grains fly.
    pub flights: bool,
    /// Light through grids, and what plates in their place would do.
    pub grids: bool,
    /// a, q and frequencies at the centre.
    pub linear: bool,
    /// Depth of the well and its minimum.
    pub well: bool,
    /// Null points next to the centre.
    pub nulls: bool,
    /// The circle on which grains gather.
    pub annulus: bool,
}

impl Asked {
    /// What a sweep works out if it names nothing else.
    pub const OF_SWEEPS: Self =
        Self { flights: true, grids: false, linear: false, well: false, nulls: false, annulus: false };

    /// Whether it is just that.
    pub fn is_of_sweeps(&self) -> bool {
        *self == Self::OF_SWEEPS
    }

    /// Whether anything of the trap as a trap is asked for.
    pub fn trap(&self) -> bool {
        self.linear || self.well || self.nulls || self.annulus
    }
}

impl Varied {
    /// The value at a place from 0 to 1 of the range.
    pub fn at(&self, place: f64) -> f64 {
        let value = self.between(place);
        let [from, to] = self.range;
        match self.step {
            None => value,
            Some(step) => {
                // A bound that is no whole number of steps away is out of reach.
                let steps = ((value - from) / step).round().min(((to - from) / step * (1.0 + 1e-12)).floor());
                // Digits of sums of decimal fractions that nobody wrote.
                let value = from + steps * step;
                format!("{value:.12e}").parse().unwrap_or(value)
            }
        }
    }

    fn between(&self, place: f64) -> f64 {
        let [from, to] = self.range;
        match place.clamp(0.0, 1.0) {
            // The bounds exactly as written.
            0.0 => from,
            1.0 => to,
            t if self.log => from * (to / from).powf(t),
            t => from + (to - from) * t,
        }
    }

    /// The place of a value in the range, from 0 to 1.
    pub fn place(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        if self.log { (value / from).ln() / (to / from).ln() } else { (value - from) / (to - from) }
    }

    /// A value as it is written in a case.
    pub fn written(&self, value: f64) -> String {
        if self.unit.is_empty() { format!("{value:?}") } else { format!("\"{value} {}\"", self.unit) }
    }
}
