//! What is kept of a run.

use std::sync::Mutex;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use crate::Ending;

/// A grain at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// s.
    pub time: f64,
    /// m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// The whole force, drag and magnetic force with it, noise without, N.
    pub force: Vec3,
    /// Of all forces that have one, J; a pair of grains shares theirs evenly.
    pub potential_energy: f64,
}

/// Who watches a run. Called from several threads at once, but never at once for the same grain.
pub trait Observer: Sync {
    /// Before the first step: so many grains, and at most so many samples of each.
    fn begin(&self, _grains: usize, _samples: usize) {}

    /// The next samples of a grain (its index in the ensemble), in the order of time. Grains come in any order.
    fn record(&self, grain: usize, samples: &[Sample]);

    /// After the last sample of a grain.
    fn end(&self, _grain: usize, _ending: &Ending) {}
}

/// Keeps nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Nothing;

impl Observer for Nothing {
    fn record(&self, _grain: usize, _samples: &[Sample]) {}
}

/// Hands every batch of samples to a function: for runs too long to keep.
#[derive(Clone, Copy, Debug)]
pub struct Sink<F>(pub F);

impl<F: Fn(usize, &[Sample]) + Sync> Observer for Sink<F> {
    fn record(&self, grain: usize, samples: &[Sample]) {
        (self.0)(grain, samples);
    }
}

/// Keeps the samples of all grains in memory, up to a bound.
#[derive(Debug)]
pub struct Trajectories {
    limit: usize,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    stride: usize,
    grains: Vec<GrainTrack>,
}

#[derive(Debug, Default)]
struct GrainTrack {
    seen: usize,
    samples: Vec<Sample>,
    /// The newest sample, if it was passed over: the end of a flight is always kept.
    last: Option<Sample>,
}

/// The default bound on what [`Trajectories`] keeps: 1 GiB, what a desk machine can spare.
pub const DEFAULT_LIMIT: usize = 1 << 30;

impl Default for Trajectories {
    fn default() -> Self {
        Self::with_limit(DEFAULT_LIMIT)
    }
}

impl Trajectories {
    /// Keeps at most about this many bytes of samples: when more are to come, every second, third, ... of each grain,
    /// decided before the run starts, and always the first and the last.
    pub fn with_limit(bytes: usize) -> Self {
        Self { limit: bytes / size_of::<Sample>(), kept: Mutex::default() }
    }

    /// One list of samples for each grain.
    pub fn into_samples(self) -> Vec<Vec<Sample>> {
        let kept = self.kept.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        kept.grains.into_iter().map(|g| g.samples).collect()
    }

    /// One sample in how many was kept.
    pub fn stride(&self) -> usize {
        self.lock().stride
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Kept> {
        // A thread that panicked while it held the lock left whole samples behind.
        self.kept.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl Observer for Trajectories {
    fn begin(&self, grains: usize, samples: usize) {
        let mut kept = self.lock();
        kept.stride = (grains.saturating_mul(samples)).div_ceil(self.limit.max(1)).max(1);
        kept.grains = (0..grains).map(|_| GrainTrack::default()).collect();
    }

    fn record(&self, grain: usize, samples: &[Sample]) {
        let mut kept = self.lock();
        let stride = kept.stride;
        let track = &mut kept.grains[grain];
        for sample in samples {
            track.last = None;
            if track.seen.is_multiple_of(stride) {
                track.samples.push(*sample);
            } else {
                track.last = Some(*sample);
            }
            track.seen += 1;
        }
    }

    fn end(&self, grain: usize, _: &Ending) {
        let track = &mut self.lock().grains[grain];
        track.samples.extend(track.last.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Outcome;

    #[test]
    fn trajectories_stay_within_their_bound_and_keep_the_ends() {
        let tracks = Trajectories::with_limit(20 * size_of::<Sample>());
        tracks.begin(2, 100);
        assert_eq!(tracks.stride(), 10);
        let sample = |k: usize| Sample {
            time: k as f64,
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            force: Vec3::zeros(),
            potential_energy: 0.0,
        };
        for k in 0..100 {
            tracks.record(1, &[sample(k)]);
        }
        tracks.end(1, &Ending { outcome: Outcome::TimeUp, time: 99.0 });
        let kept = tracks.into_samples();
        let times: Vec<f64> = kept[1].iter().map(|s| s.time).collect();
        assert_eq!(times, [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 99.0]);
        assert!(kept[0].is_empty());
    }
}
