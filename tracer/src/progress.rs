//! How far a run is.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::options::Progress;

/// Adds up the time flown by all grains and tells the listener now and then.
pub(crate) struct Meter<'a> {
    listener: Option<&'a Progress>,
    /// Flight time of all grains together, s.
    whole: f64,
    /// What is done, in units of `whole` / 2^40.
    done: AtomicU64,
    /// Thousandths last told.
    told: AtomicU64,
}

const UNITS: f64 = (1_u64 << 40) as f64;

impl<'a> Meter<'a> {
    pub fn new(listener: Option<&'a Progress>, whole: f64) -> Self {
        Self { listener, whole, done: AtomicU64::new(0), told: AtomicU64::new(0) }
    }

    /// Adds flight time of one grain, s.
    pub fn add(&self, time: f64) {
        if self.listener.is_some() && self.whole > 0.0 {
            self.done.fetch_add((time / self.whole * UNITS) as u64, Ordering::Relaxed);
        }
    }

    /// Tells the listener, if a thousandth has passed since the last time.
    pub fn report(&self) {
        let Some(listener) = self.listener else { return };
        let fraction = (self.done.load(Ordering::Relaxed) as f64 / UNITS).min(1.0);
        let thousandths = (fraction * 1000.0) as u64;
        if self.told.fetch_max(thousandths, Ordering::Relaxed) < thousandths {
            listener(fraction);
        }
    }
}
