//! What the loop over steps remembers of one grain.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use crate::event::{Crossing, Met};
use crate::path::Motion;
use crate::{Ending, Outcome, Sample};

/// What the loop remembers of one grain besides its state.
pub(crate) struct Lane {
    pub grain: usize,
    /// Whether its flight began in an earlier run.
    pub begun: bool,
    pub pace: Pace,
    pub buffer: Vec<Sample>,
    /// A grain that ends at the end of the step now tried, and how.
    pub fate: Option<Fate>,
}

/// What a grain's next steps depend on, besides its state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pace {
    /// Next time at which a force is not smooth, s.
    pub corner: f64,
    /// Step that the error control would like, s; zero before the first.
    pub wanted: f64,
    /// Whether the last try failed.
    pub rejected: bool,
    /// Even steps up to the next stop.
    pub grid: Grid,
    /// Steps so far.
    pub number: u64,
    /// Number of the next sample.
    pub sample: u64,
    /// No event lies within `clear` (m) of `anchor`.
    pub anchor: Vec3,
    pub clear: f64,
    /// Time of the last sample, s.
    pub sampled: f64,
}

/// Even steps between two times at which a step must end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Grid {
    pub start: f64,
    pub stop: f64,
    pub step: f64,
    pub taken: u64,
    pub count: u64,
}

/// The end of a grain: when, where, how fast, and what it met (nothing: the time was up).
#[derive(Clone, Copy)]
pub(crate) struct Fate {
    pub time: f64,
    pub position: Vec3,
    pub velocity: Vec3,
    pub kind: Kind,
}

#[derive(Clone, Copy)]
pub(crate) enum Kind {
    TimeUp,
    Met(Crossing),
    Unstable,
    Stopped,
}

impl Grid {
    pub fn new(start: f64, stop: f64, step: f64) -> Self {
        // A little less, so that a room of a whole number of steps is not given one more by rounding.
        let count = ((stop - start) / step * (1.0 - 1e-9)).ceil().max(1.0);
        Self { start, stop, step: (stop - start) / count, taken: 0, count: count as u64 }
    }

    pub fn next_end(&self) -> f64 {
        self.end_after(1)
    }

    /// Where the grid is after so many more steps.
    pub fn end_after(&self, steps: u64) -> f64 {
        let next = self.taken + steps;
        if next == self.count { self.stop } else { self.start + next as f64 * self.step }
    }
}

impl Fate {
    pub fn here(time: f64, motion: &Motion, kind: Kind) -> Self {
        Self { time, position: motion.position, velocity: motion.velocity, kind }
    }

    pub fn ending(&self, mass: f64) -> Ending {
        let speed = self.velocity.norm();
        let outcome = match self.kind {
            Kind::TimeUp => Outcome::TimeUp,
            Kind::Stopped => Outcome::Stopped,
            Kind::Unstable => Outcome::Unstable { point: self.position },
            Kind::Met(Crossing { met: Met::Edge, point, .. }) => Outcome::LeftRegion { point },
            Kind::Met(Crossing { met: Met::Electrode(electrode), point, normal, .. }) => {
                Outcome::Struck { electrode, point, normal, energy: 0.5 * mass * speed * speed, speed }
            }
        };
        Ending { outcome, time: self.time }
    }
}
