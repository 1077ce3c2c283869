//! How to trace.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::{Journal, Standing, TraceError};

/// Which integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// `Langevin` when there is noise; `BlanesMoan14`, with a step from the tolerance, in forces that are linear in the
    /// position; `Stoermer` for 100 to 4000 grains that feel each other in smooth fields; else `Dop853`.
    #[default]
    Auto,
    /// Dormand and Prince's 8(5,3): order 8, adaptive, dense output of order 7. For any force without noise.
    Dop853,
    /// Kick, exact free flight, kick: order 2, symplectic without drag, also for forces that change with time.
    Verlet,
    /// Boris's scheme with the exact angle of rotation: order 2, preserves volume.
    Boris,
    /// Kick, exact Ornstein-Uhlenbeck flight, kick: weak order 2.
    Langevin,
    /// Blanes and Moan's composition of order 4 (six forces a step).
    BlanesMoan4,
    /// Blanes and Moan's composition of order 6 (eleven forces a step).
    BlanesMoan6,
    /// Blanes and Moan's composition of order 6 with the smallest error (fourteen forces a step): in a Paul trap 1e-6 after 1000
    /// periods takes 140 forces a period, where the one with eleven takes 176.
    BlanesMoan14,
    /// Störmer's multistep scheme of order 12: one force a step, dense output, for smooth forces without magnetic field. In a Paul
    /// trap 1e-6 after 1000 periods takes 36 forces a period.
    Stoermer12,
    /// The same scheme with steps from the tolerance, begun by `Dop853`: for grains that feel each other, whose forces are dear.
    Stoermer,
}

/// Called with the fraction that is done, from 0 to 1, at most about a thousand times, from any thread.
pub type Progress = Arc<dyn Fn(f64) + Send + Sync>;

/// How to trace.
#[derive(Clone)]
pub struct Options {
    /// The integrator. Default: `Auto`.
    pub method: Method,
    /// Time of the start, s. Default: 0, where waveforms have their stated phase.
    pub start: f64,
    /// How long, s. Default: 1.
    pub duration: f64,
    /// Relative error that a step of an adaptive integrator may make, in position (against the way the grain has come
    /// so far) and in velocity (against the largest so far). Default: 1e-9. That leaves 1e-8 after 100 RF periods
    /// (measured for q from 0.02 to 0.8), well below the 1e-6 of the best tables of a field, with 1.8 times the steps of
    /// 1e-7.
    pub tolerance: f64,
    /// Step of the other integrators, s. Default: from the forces, see [`crate::natural_step`].
    pub step: Option<f64>,
    /// Longest step, s. Default: a fraction of the shortest period.
    pub max_step: Option<f64>,
    /// Interval between samples, s. Default: no samples.
    pub every: Option<f64>,
    /// Samples hold forces and energies; without, only the first of a grain does, and the others have zeros. Default: yes. Where the
    /// field has no table they take longer than the flight.
    pub forces: bool,
    /// Names the random numbers of the noise. Default: 1.
    pub seed: u64,
    /// Grains traced side by side by one thread. Changes no result. Default: 64, whose stages (60 kB) stay in a core's
    /// second cache while the cost of a call is shared by many.
    pub block: usize,
    /// Trace a few grains again, tighter, to tell the error. Default: yes.
    pub estimate_error: bool,
    /// Keeps where the flights stand. Default: nobody.
    pub journal: Option<Arc<dyn Journal>>,
    /// Where an earlier run of the same flights stood. Default: at the start.
    pub resume: Option<Arc<Standing>>,
    /// Told how far the run is. Default: nobody.
    pub progress: Option<Progress>,
    /// Once true, the run ends cleanly after the current step. Default: never.
    pub cancel: Option<Arc<AtomicBool>>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            start: 0.0,
            duration: 1.0,
            tolerance: 1e-9,
            step: None,
            max_step: None,
            every: None,
            forces: true,
            seed: 1,
            block: 64,
            estimate_error: true,
            journal: None,
            resume: None,
            progress: None,
            cancel: None,
        }
    }
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Options")
            .field("method", &self.method)
            .field("start", &self.start)
            .field("duration", &self.duration)
            .field("tolerance", &self.tolerance)
            .field("step", &self.step)
            .field("max_step", &self.max_step)
            .field("every", &self.every)
            .field("forces", &self.forces)
            .field("seed", &self.seed)
            .field("block", &self.block)
            .field("estimate_error", &self.estimate_error)
            .finish_non_exhaustive()
    }
}

impl Options {
    /// End of the run, s.
    pub fn end(&self) -> f64 {
        self.start + self.duration
    }

    /// Whether the run has been told to stop.
    pub(crate) fn cancelled(&self) -> bool {
        self.cancel.as_ref().is_some_and(|flag| flag.load(std::sync::atomic::Ordering::Relaxed))
    }

    pub(crate) fn check(&self) -> Result<(), TraceError> {
        let require = |ok: bool, option, value, expected| {
            if ok { Ok(()) } else { Err(TraceError::Option { option, value, expected }) }
        };
        let positive = |option, value: Option<f64>| {
            let ok = value.is_none_or(|x| x.is_finite() && x > 0.0);
            require(ok, option, value.unwrap_or(0.0), "a positive time in s")
        };
        require(self.start.is_finite(), "start", self.start, "a time in s")?;
        require(self.duration.is_finite() && self.duration >= 0.0, "duration", self.duration, "zero or more, in s")?;
        // Below 1e-14 the rounding of a step exceeds what it may err.
        let sane = (1e-14..=1e-2).contains(&self.tolerance);
        require(sane, "tolerance", self.tolerance, "a number between 1e-14 and 1e-2")?;
        require(self.block > 0, "block", self.block as f64, "at least one grain")?;
        positive("step", self.step)?;
        positive("max_step", self.max_step)?;
        positive("every", self.every)
    }

    /// How many samples a flight of full length has.
    pub(crate) fn samples(&self) -> usize {
        // Too many for a count are too many for anything else.
        self.every.map_or(0, |every| ((self.duration / every).floor() as usize).saturating_add(2))
    }
}
