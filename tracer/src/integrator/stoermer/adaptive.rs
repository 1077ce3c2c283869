//! Störmer's scheme with steps that follow the error.

use super::super::dop853::Dop853;
use super::super::splitting::paths_between;
use super::super::{Integrator, IntegratorNature};
use super::past::{KEPT, Past};
use crate::block::Block;
use crate::path::Path;

/// [`Stoermer`](super::Stoermer)'s scheme of order 12 with steps from the tolerance, for grains that share their steps: one force
/// a step, where [`Dop853`] takes twelve for steps two to three times as long.
///
/// `Dop853` flies alone at first; once it has found its step, it makes eleven even steps of about a third of that, and then the
/// multistep goes on. Its error is what the first difference that it leaves out would add. A step whose error is too large is tried again with a
/// shorter one, and after a while of small errors the steps grow; the accelerations for another step are those of the polynomial
/// through the known ones, so that a change costs no force. Corners, ends, strikes: `Dop853` again.
///
/// Source: Störmer 1907; for changes of the step Krogh 1974 (*Changing stepsize in the integration of differential equations
/// using modified divided differences*), here by interpolation. Checked by `order_adaptive_stoermer`,
/// `exact_two_grains_collide_as_kepler_says`.
pub(crate) struct AdaptiveStoermer {
    single: Dop853,
    past: Past,
    phase: Phase,
    /// Good steps of `Dop853` before even steps are tried.
    look: u32,
    /// Whether the last step tried was one of the multistep.
    multiple: bool,
}

/// What the next steps are to be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// `Dop853` with steps of its own.
    Single(Single),
    /// Even steps.
    Even(Even),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Single {
    /// Good steps so far.
    good: u32,
    /// All of them, those that were not good too.
    tries: u32,
    /// How far the good ones came, s.
    flown: f64,
    /// The shortest step among those that the error control would have liked, s.
    least: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Even {
    /// s.
    step: f64,
    /// Good steps of this length so far.
    good: u32,
    /// The largest error among these, over what is allowed: during the last whole turn of the forces, and since.
    worst: [f64; 2],
    /// Times in a row that the step was made shorter.
    failures: u32,
    /// Good steps of any length.
    sum: u32,
    /// A step that takes as many forces as `Dop853` took before, s.
    worth: f64,
}

impl Even {
    fn new(step: f64, worth: f64) -> Self {
        Self { step, good: 0, worst: [0.0; 2], failures: 0, sum: 0, worth }
    }

    /// The next steps of another length.
    fn with(self, step: f64, failures: u32) -> Self {
        Self { step, good: 0, worst: [0.0; 2], failures, ..self }
    }
}

const BEGIN: Phase = Phase::Single(Single { good: 0, tries: 0, flown: 0.0, least: f64::INFINITY });

/// Good steps of `Dop853` before even steps are tried. Twice as many each time that the multistep soon had to give up, up to the second
/// where it met something sudden, up to the third where it was no better: in a field of rough tables it never is.
const LOOK: [u32; 3] = [8, 64, 1024];

/// Good even steps that are worth the start, which takes 132 forces.
const WORTH: u32 = 64;

/// Forces of a step of `Dop853`.
const STAGES: f64 = 12.0;

/// First even step, in steps of `Dop853`.
const RATIO: f64 = 0.3;

/// Even steps for which there must be room before a corner or the end: with fewer, `Dop853` takes fewer forces.
const ROOM: f64 = 64.0;

/// Steps of small error after which longer ones are tried, even if a period of the forces is not over.
const LONG: f64 = 48.0;

/// A change makes the step at most so much longer: by the accelerations that are kept.
const GROW: f64 = (KEPT - 1) as f64 / 12.0;

/// The step is chosen for errors of so much of what is allowed, and grows when that makes it longer by more than a twentieth.
const AIM: f64 = 0.03;

/// An error above this part of what is allowed makes the next step shorter: while what is known of the past is still good.
const SOFT: f64 = 0.1;

/// Order of the error of a step in its length, as a velocity: h ∇¹² a.
const ORDER: f64 = 13.0;

/// Steps that are not good in a row before `Dop853` has to see, and the largest error of such a step: what is known of the past is for
/// the longer step, and the error of a shorter one goes with its square only.
const PATIENCE: u32 = 5;
const NEAR: f64 = 8.0;

impl AdaptiveStoermer {
    pub fn new() -> Self {
        Self { single: Dop853::new(), past: Past::new(), phase: BEGIN, look: LOOK[0], multiple: false }
    }

    fn fly_single(&mut self, block: &mut Block) {
        self.multiple = false;
        self.single.advance(block);
    }

    /// Lets `Dop853` fly, until its steps are known.
    fn look(&mut self, block: &mut Block, mut seen: Single) {
        self.fly_single(block);
        let Some(trial) = block.trial.first() else { return };
        let error = worst(block);
        seen.tries = seen.tries.saturating_add(1);
        seen.least = seen.least.min(trial.step * (0.9 * error.powf(-0.125)).clamp(0.1, 6.0));
        if error <= 1.0 {
            seen.good = seen.good.saturating_add(1);
            seen.flown += trial.step;
        }
        let even = round(RATIO * seen.least.min(trial.longest));
        self.phase = if error <= 1.0 && seen.good >= self.look && trial.room - trial.step > ROOM * even {
            Phase::Even(Even::new(even, seen.flown / (STAGES * f64::from(seen.tries))))
        } else {
            Phase::Single(seen)
        };
    }

    /// A step of the multistep, or one towards its first.
    fn go_on(&mut self, block: &mut Block, even: Even) {
        let step = even.step;
        // What is known may still belong to the step before.
        let known = if self.past.filled() > 0 { self.past.step() } else { step };
        self.past.note(block, known);
        if self.past.filled() > 1 && known != step {
            self.past.stretch(block, step);
        }
        if self.past.step() != step {
            self.past.forget();
            self.past.note(block, step);
        }
        if !self.past.suffices() {
            self.fly_single(block);
            return;
        }
        self.multiple = true;
        self.past.advance(block, true);
        let error = worst(block);
        let sum = even.sum.saturating_add(u32::from(error <= 1.0));
        let even = Even { sum, ..even };
        self.phase = if error <= SOFT {
            self.calm(block, even, error)
        } else if even.failures < PATIENCE && error < NEAR {
            Phase::Even(even.with(round(step * (AIM / error).powf(1.0 / ORDER)), even.failures + 1))
        } else {
            self.give_up(sum >= WORTH, LOOK[1])
        };
    }

    /// After a step of small error: perhaps longer ones.
    fn calm(&mut self, block: &Block, even: Even, error: f64) -> Phase {
        let step = even.step;
        // Over a period of the forces every phase has had its turn.
        let turn = ((block.forces.period / step).ceil().min(LONG) as u32).max(KEPT as u32);
        let good = even.good.saturating_add(1);
        let [mut before, mut now] = even.worst;
        now = now.max(error);
        let longest = block.trial.first().map_or(step, |trial| RATIO * trial.longest);
        let factor = (AIM / before.max(now)).powf(1.0 / ORDER).min(GROW);
        let longer = round((step * factor).min(longest));
        if good >= turn || (good >= KEPT as u32 && factor == GROW) {
            if longer > 1.05 * step {
                return Phase::Even(even.with(longer, 0));
            }
            if step < even.worth && even.sum >= WORTH {
                return self.give_up(false, LOOK[2]);
            }
        }
        if good.is_multiple_of(turn) {
            (before, now) = (now, 0.0);
        }
        let failures = if good >= KEPT as u32 { 0 } else { even.failures };
        Phase::Even(Even { good, worst: [before, now], failures, ..even })
    }

    /// Back to `Dop853`.
    fn give_up(&mut self, worth: bool, most: u32) -> Phase {
        self.look = if worth { LOOK[0] } else { (2 * self.look).min(most.max(self.look)) };
        self.past.forget();
        BEGIN
    }
}

/// Numbers that [`AdaptiveStoermer::memory`] tells before those of the past.
const OWN: usize = 9;

/// The largest error of a step just tried, over what is allowed.
fn worst(block: &Block) -> f64 {
    block
        .trial
        .iter()
        .fold(0.0, |worst, trial| if trial.error > worst || trial.error.is_nan() { trial.error } else { worst })
}

/// The step with 24 binary digits: times then are sums of it without rounding, and steps are even to the last bit.
fn round(step: f64) -> f64 {
    f64::from(step as f32)
}

impl Integrator for AdaptiveStoermer {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 12, adaptive: true, dense: true, random: false, starts_from_force: true }
    }

    fn asks(&self) -> Option<f64> {
        match self.phase {
            Phase::Single(_) => None,
            Phase::Even(Even { step, .. }) => Some(step),
        }
    }

    fn advance(&mut self, block: &mut Block) {
        let Some(trial) = block.trial.first() else { return };
        match self.phase {
            Phase::Single(seen) => self.look(block, seen),
            // Times are rounded, steps are not.
            Phase::Even(even) if (trial.step - even.step).abs() <= 1e-6 * even.step => self.go_on(block, even),
            // The last before a corner or the end, or up to a strike.
            Phase::Even(_) => {
                self.past.forget();
                self.phase = BEGIN;
                self.fly_single(block);
            }
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        if self.multiple {
            paths_between(block, lanes, paths, true);
        } else {
            self.single.paths(block, lanes, paths);
        }
    }

    fn memory(&self, lanes: usize) -> Vec<Vec<f64>> {
        let look = f64::from(self.look);
        let own: [f64; OWN] = match self.phase {
            Phase::Single(Single { good, tries, flown, least }) => {
                [0.0, look, f64::from(good), f64::from(tries), flown, least, 0.0, 0.0, 0.0]
            }
            Phase::Even(Even { step, good, worst, failures, sum, worth }) => {
                let [before, now] = worst;
                [1.0, look, f64::from(good), f64::from(failures), step, worth, f64::from(sum), before, now]
            }
        };
        let past = self.past.memory(lanes);
        past.into_iter().map(|past| own.into_iter().chain(past).collect()).collect()
    }

    fn remember(&mut self, block: &Block, memory: &[&[f64]]) {
        let Some(numbers) = memory.first() else { return };
        let &[even, look, good, second, length, other, sum, before, now] =
            numbers.first_chunk::<OWN>().unwrap_or(&[0.0; OWN]);
        let (good, second, sum) = (good as u32, second as u32, sum as u32);
        self.look = look as u32;
        self.phase = if even == 1.0 {
            Phase::Even(Even { step: length, good, worst: [before, now], failures: second, sum, worth: other })
        } else {
            Phase::Single(Single { good, tries: second, flown: length, least: other })
        };
        let past: Vec<&[f64]> = memory.iter().map(|numbers| numbers.get(OWN..).unwrap_or_default()).collect();
        self.past.remember(block, &past);
    }

    fn retain(&mut self, _keep: &[bool], _forget: bool) {
        // The others' forces have changed, or their lists would have to be.
        self.past.forget();
        self.phase = BEGIN;
    }
}
