//! Where flights stand, so that a run that was ended by force can go on from there, to the same bits.
//!
//! Every block of grains says now and then where its grains are, and which samples were taken since it last did: a [`Frame`]. A
//! [`Journal`] keeps the frames. From those that are left a [`Standing`] is put together, which goes back into
//! [`Options::resume`](crate::Options): grains that had ended have ended, others go on from the last frame that knows them, and
//! grains that no frame knows start anew. What is not in a frame is found again step by step, the same as before.

use std::collections::BTreeMap;
use std::time::Duration;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use crate::block::State;
use crate::flight::Pace;
use crate::{Ending, Observer, Sample};

/// Who keeps frames. Called from several threads at once.
pub trait Journal: Send + Sync {
    /// How long a block flies between two frames, by the clock on the wall.
    fn interval(&self) -> Duration;

    /// Keeps a frame.
    ///
    /// # Errors
    /// In words, why it cannot be kept; the run ends with [`TraceError::Journal`](crate::TraceError).
    fn keep(&self, frame: &Frame) -> Result<(), String>;
}

/// What has come of some grains since the last frame that knew them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    pub(crate) flying: Vec<Flying>,
    pub(crate) landed: Vec<Landed>,
    /// Grain and samples, in the order they were taken.
    pub(crate) samples: Vec<(usize, Vec<Sample>)>,
    pub(crate) counts: Counts,
}

/// A grain in flight, with all that its next step depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Flying {
    pub grain: usize,
    pub state: State,
    pub pace: Pace,
    /// What the integrator remembers of its way.
    pub memory: Vec<f64>,
}

impl Flying {
    /// The same for grains that one block may carry on together: their time, and the first that the integrator remembers (which
    /// is the same for all grains of a block).
    pub fn moment(&self) -> [u64; 4] {
        let known = |k: usize| self.memory.get(k).map_or(0, |x| x.to_bits());
        [self.state.time.to_bits(), known(0), known(1), known(2)]
    }
}

/// A grain whose flight is over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Landed {
    pub grain: usize,
    pub ending: Ending,
    pub position: Vec3,
    pub velocity: Vec3,
}

/// Work that was done, in steps and forces of single grains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Counts {
    pub accepted: u64,
    pub rejected: u64,
    pub evaluations: u64,
}

impl Counts {
    pub fn add(&mut self, more: Self) {
        self.accepted += more.accepted;
        self.rejected += more.rejected;
        self.evaluations += more.evaluations;
    }

    pub fn since(self, before: Self) -> Self {
        Self {
            accepted: self.accepted - before.accepted,
            rejected: self.rejected - before.rejected,
            evaluations: self.evaluations - before.evaluations,
        }
    }
}

/// Where all grains stand that frames know of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Standing {
    pub(crate) flying: BTreeMap<usize, Flying>,
    pub(crate) landed: BTreeMap<usize, Landed>,
    pub(crate) samples: Vec<(usize, Vec<Sample>)>,
    pub(crate) counts: Counts,
}

impl Standing {
    /// Nowhere yet.
    pub const fn new() -> Self {
        let counts = Counts { accepted: 0, rejected: 0, evaluations: 0 };
        Self { flying: BTreeMap::new(), landed: BTreeMap::new(), samples: Vec::new(), counts }
    }

    /// Takes in a frame that was kept after those before.
    pub fn add(&mut self, frame: Frame) {
        for flying in frame.flying {
            self.flying.insert(flying.grain, flying);
        }
        for landed in frame.landed {
            self.flying.remove(&landed.grain);
            self.landed.insert(landed.grain, landed);
        }
        self.samples.extend(frame.samples);
        self.counts.add(frame.counts);
    }

    /// Number of grains in flight, and of those whose flight is over.
    pub fn grains(&self) -> [usize; 2] {
        [self.flying.len(), self.landed.len()]
    }

    /// A grain that is not of an ensemble of so many, if there is one.
    pub(crate) fn stranger(&self, grains: usize) -> Option<usize> {
        let known = self.flying.keys().chain(self.landed.keys()).chain(self.samples.iter().map(|(grain, _)| grain));
        known.copied().find(|&grain| grain >= grains)
    }

    /// Tells an observer what it had been told before.
    pub(crate) fn tell(&self, observer: &dyn Observer) {
        for (grain, samples) in &self.samples {
            observer.record(*grain, samples);
        }
        for (grain, landed) in &self.landed {
            observer.end(*grain, &landed.ending);
        }
    }
}
