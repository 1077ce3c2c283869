//! What Störmer's scheme knows of the past, and the step it takes from that.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::weights::{TERMS, Weights};
use crate::block::{Block, retain};
use crate::linear::LinearFlow;

/// Accelerations that are kept: more than a step uses, so that they can be told for a longer step from those of shorter ones.
pub(super) const KEPT: usize = 16;

/// Numbers handled at a time; lists are filled up to a multiple of it.
const WIDTH: usize = 8;

/// Grains that a thread takes at least: ten microseconds of work.
const PART: usize = 256;

/// Accelerations of the last steps, all of the same length, and the chord of the last one.
///
/// With drag γ everything is scaled by e^(γ (t' - t)/2), t' the time of the newest acceleration.
pub(super) struct Past {
    weights: Weights,
    /// Accelerations by age, the newest first; x, y, z of each grain one after the other.
    history: [Vec<f64>; KEPT],
    /// How many are known.
    filled: usize,
    /// Step between them, s.
    step: f64,
    /// Time of the newest, s.
    newest: f64,
    /// End of the step tried since, s.
    tried: f64,
    /// The chord of the step that ended at the newest, m; and of the step tried since.
    chord: Vec<f64>,
    chord_known: bool,
    next: Vec<f64>,
    /// Positions at the newest, m; what the known accelerations make of position and h v at the end of the step, and of ∇¹² a.
    now: Vec<f64>,
    place: Vec<f64>,
    speed: Vec<f64>,
    rough: Vec<f64>,
    /// e^(-γh/2) for each number.
    decay: Vec<f64>,
    time: Vec<f64>,
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    acceleration: Vec<Vec3>,
    arch: Arch,
}

impl Past {
    pub fn new() -> Self {
        Self {
            weights: Weights::new(),
            history: std::array::from_fn(|_| Vec::new()),
            filled: 0,
            step: 0.0,
            newest: f64::NAN,
            tried: f64::NAN,
            chord: Vec::new(),
            chord_known: false,
            next: Vec::new(),
            now: Vec::new(),
            place: Vec::new(),
            speed: Vec::new(),
            rough: Vec::new(),
            decay: Vec::new(),
            time: Vec::new(),
            position: Vec::new(),
            velocity: Vec::new(),
            acceleration: Vec::new(),
            arch: Arch::new(),
        }
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.filled = 0;
        self.chord_known = false;
        self.newest = f64::NAN;
    }

    /// Step between the accelerations, s.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// How many accelerations are known.
    pub fn filled(&self) -> usize {
        self.filled
    }

    /// Whether enough is known for a step.
    pub fn suffices(&self) -> bool {
        self.filled >= TERMS
    }

    /// Takes in where the grains are, at the end of a step of this length (s); forgets all else if it does not continue what is
    /// known.
    pub fn note(&mut self, block: &Block, step: f64) {
        let Some(time) = block.state.first().map(|state| state.time) else { return };
        let again = self.newest == time && self.step == step;
        if self.filled > 0 && !again && (self.step != step || self.tried != time) {
            self.forget();
        }
        if self.filled == 0 {
            self.step = step;
            self.make_room(block);
        }
        if !again || self.filled == 0 {
            self.carry();
            self.history.rotate_right(1);
            let lists = self.history[0].par_chunks_mut(3).zip(self.now.par_chunks_mut(3));
            lists.zip(&block.state).zip(&block.linear).with_min_len(PART).for_each(
                |(((whole, now), state), linear)| {
                    let (half, motion) = (0.5 * linear.rate, &state.motion);
                    whole.copy_from_slice((motion.acceleration + motion.position * (half * half)).as_slice());
                    now.copy_from_slice(motion.position.as_slice());
                },
            );
            self.filled = (self.filled + 1).min(KEPT);
            self.newest = time;
        }
        if self.suffices() && !self.chord_known {
            self.find_chord(block);
        }
        self.tried = block.trial.first().map_or(f64::NAN, |trial| trial.end);
    }

    /// Scales what is known to the end of the step just taken.
    fn carry(&mut self) {
        std::mem::swap(&mut self.chord, &mut self.next);
        if self.decay.iter().any(|&decay| decay != 1.0) {
            for list in &mut self.history {
                list.iter_mut().zip(&self.decay).for_each(|(x, decay)| *x *= decay);
            }
        }
    }

    /// Empty lists, and the decay over a step.
    fn make_room(&mut self, block: &Block) {
        let padded = (3 * block.len()).div_ceil(WIDTH) * WIDTH;
        let lists = [&mut self.chord, &mut self.next, &mut self.now, &mut self.place, &mut self.speed, &mut self.rough];
        for list in self.history.iter_mut().chain(lists) {
            list.clear();
            list.resize(padded, 0.0);
        }
        self.find_decay(block);
    }

    fn find_decay(&mut self, block: &Block) {
        self.decay.clear();
        for linear in &block.linear {
            let (_, decay) = LinearFlow::new(linear, 0.5 * self.step).along();
            self.decay.extend([decay; 3]);
        }
        self.decay.resize(self.now.len(), 1.0);
    }

    /// The chord that belongs to the velocity now: d = h v - h² Σ c_j a_j.
    fn find_chord(&mut self, block: &Block) {
        let h = self.step;
        for (lane, state) in block.state.iter().enumerate() {
            let half = 0.5 * block.linear[lane].rate;
            let speed = state.motion.velocity + state.motion.position * half;
            let known = self.weights.speed.iter().zip(&self.history);
            let sum: Vec3 = known.map(|(c, list)| vector(list, lane) * *c).sum();
            put(&mut self.chord, lane, &(speed * h - sum * (h * h)));
        }
        self.chord_known = true;
    }

    /// Tries a step from what was noted, and estimates its error if that is wanted.
    pub fn advance(&mut self, block: &mut Block, estimate: bool) {
        let h = self.step;
        let Self { weights, history, chord, next, now, place, speed, rough, decay, .. } = self;
        self.arch.dispatch(Sums { weights, h2: h * h, history, now, chord, decay, next, place, speed, rough });
        self.time.clear();
        self.position.clear();
        self.velocity.clear();
        for (lane, (state, trial)) in block.state.iter().zip(&block.trial).enumerate() {
            self.time.push(block.forces.within(trial.end, state.time, trial.end));
            self.position.push(vector(&self.place, lane));
            self.velocity.push(state.motion.velocity);
        }
        block.forces.accelerations(&self.time, &self.position, &self.velocity, &mut self.acceleration);
        let (past, limits, watched) = (&*self, block.limits(), block.watched);
        let lanes = block.trial.par_iter_mut().zip(&block.state).zip(&block.linear).enumerate();
        lanes.with_min_len(PART).for_each(|(lane, ((trial, state), linear))| {
            let half = 0.5 * linear.rate;
            let (r, a) = (past.position[lane], past.acceleration[lane]);
            // `speed` holds the sum without the newest.
            let (chord, newest) = (vector(&past.next, lane), a + r * (half * half));
            let sum = vector(&past.speed, lane) + newest * (past.weights.speed[0] * h * h);
            trial.motion.position = r;
            trial.motion.velocity = (chord + sum) / h - r * half;
            trial.motion.acceleration = a;
            trial.fresh = true;
            trial.reach = 0.0;
            if watched {
                let state = &state.motion;
                let fastest = state.velocity.norm_squared().max(trial.motion.velocity.norm_squared()).sqrt();
                let strongest = state.acceleration.norm_squared().max(a.norm_squared()).sqrt();
                trial.reach = h * (fastest + h * strongest);
            }
            if estimate {
                trial.error = past.error(lane, &newest, limits.allowed(state, &r, &trial.motion.velocity));
            }
        });
    }

    /// Error of the step just tried for one grain, over what is allowed: what the first difference left out adds to the chord, as
    /// a velocity and as a position, root mean square of the two. `newest` is the acceleration found for its end.
    fn error(&self, lane: usize, newest: &Vec3, [length, speed]: [f64; 2]) -> f64 {
        /// ∇¹² is a sum of numbers up to 924, of which 4096 in all: so much of it may be rounding, in parts of the acceleration.
        const ROUNDING: f64 = 4096.0 * f64::EPSILON;
        /// Errors of a multistep last: so much more care leaves what `Dop853` leaves at the same tolerance (clouds in a Paul trap).
        const CAUTION: f64 = 3.0;
        let difference = (vector(&self.rough, lane) + newest).norm();
        let rounding = ROUNDING * newest.norm().max(vector(&self.history[0], lane).norm());
        let missing = CAUTION * self.step * self.weights.missing * (difference - rounding).max(0.0);
        // A grain that has never moved has no scale, and no error.
        let part = |error: f64, allowed: f64| if allowed > 0.0 { (error / allowed).powi(2) } else { 0.0 };
        (0.5 * (part(missing * self.step, length) + part(missing, speed))).sqrt()
    }

    /// Tells the accelerations for another step (s), by polynomials through those that are known, and the chord with them.
    ///
    /// Where the step grows, fewer remain: as many as lie between those known.
    pub fn stretch(&mut self, block: &Block, step: f64) {
        let factor = step / self.step;
        // One polynomial for all: where pieces of several meet, ∇¹² of what they err by would be hundreds of times that.
        let points = if factor <= 1.0 { self.filled.min(TERMS + 1) } else { self.filled };
        let mut told: [Vec<f64>; KEPT] = std::array::from_fn(|_| vec![0.0; self.now.len()]);
        let wanted = (((points - 1) as f64 / factor * (1.0 + 1e-12)).floor() as usize + 1).min(KEPT);
        for (age, told) in told.iter_mut().enumerate().take(wanted) {
            let at = (age as f64 * factor).min((points - 1) as f64);
            for k in 0..points {
                let others = (0..points).filter(|&j| j != k);
                let weight: f64 = others.map(|j| (at - j as f64) / (k as f64 - j as f64)).product();
                told.iter_mut().zip(&self.history[k]).for_each(|(t, a)| *t += weight * a);
            }
        }
        (self.history, self.filled, self.step) = (told, wanted, step);
        self.find_decay(block);
        self.chord_known = false;
        if self.suffices() {
            self.find_chord(block);
        }
    }

    /// How many numbers [`Past::memory`] tells of each grain before those that are its own.
    const SHARED: usize = 5;

    /// All that is known of each of so many grains.
    pub fn memory(&self, lanes: usize) -> Vec<Vec<f64>> {
        let known = if self.suffices() && self.chord_known { 1.0 } else { 0.0 };
        let of_lane = |lane: usize| {
            let lists = self.history[..self.filled].iter().chain([&self.chord, &self.next]);
            let numbers = lists.flat_map(|list| {
                // Before the first step there are no lists.
                (0..3).map(move |k| list.get(3 * lane + k).copied().unwrap_or(0.0))
            });
            [self.filled as f64, self.step, known, self.newest, self.tried].into_iter().chain(numbers).collect()
        };
        (0..lanes).map(of_lane).collect()
    }

    /// Takes back what [`Past::memory`] told.
    pub fn remember(&mut self, block: &Block, memory: &[&[f64]]) {
        let Some([filled, step, known, newest, tried, ..]) = memory.first() else { return };
        (self.step, self.chord_known, self.newest, self.tried) = (*step, *known == 1.0, *newest, *tried);
        self.filled = (*filled as usize).min(KEPT);
        self.make_room(block);
        for (lane, numbers) in memory.iter().enumerate() {
            let mut numbers = numbers.get(Self::SHARED..).unwrap_or_default().chunks_exact(3);
            for list in self.history[..self.filled].iter_mut().chain([&mut self.chord, &mut self.next]) {
                list[3 * lane..3 * lane + 3].copy_from_slice(numbers.next().unwrap_or(&[0.0; 3]));
            }
            put(&mut self.now, lane, &block.state[lane].motion.position);
        }
    }

    /// Keeps the grains whose flag is true.
    pub fn retain(&mut self, keep: &[bool]) {
        let keep: Vec<bool> = keep.iter().flat_map(|&k| [k; 3]).collect();
        let lists = [&mut self.chord, &mut self.next, &mut self.now, &mut self.decay];
        for list in self.history.iter_mut().chain(lists) {
            list.truncate(keep.len());
            retain(list, &keep);
            list.resize(list.len().div_ceil(WIDTH) * WIDTH, 0.0);
        }
        let padded = self.now.len();
        for list in [&mut self.place, &mut self.speed, &mut self.rough] {
            list.resize(padded, 0.0);
        }
    }
}

fn vector(list: &[f64], index: usize) -> Vec3 {
    Vec3::new(list[3 * index], list[3 * index + 1], list[3 * index + 2])
}

fn put(list: &mut [f64], index: usize, v: &Vec3) {
    list[3 * index..3 * index + 3].copy_from_slice(v.as_slice());
}

/// Finds the next chords and positions and what the known accelerations add to h v and to ∇¹² a, all scaled to the end of the step.
struct Sums<'a> {
    weights: &'a Weights,
    h2: f64,
    history: &'a [Vec<f64>; KEPT],
    now: &'a [f64],
    chord: &'a [f64],
    decay: &'a [f64],
    next: &'a mut [f64],
    place: &'a mut [f64],
    speed: &'a mut [f64],
    rough: &'a mut [f64],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lists: [&[S::f64s]; TERMS] = std::array::from_fn(|age| S::as_simd_f64s(&self.history[age]).0);
        let (now, _) = S::as_simd_f64s(self.now);
        let (chord, _) = S::as_simd_f64s(self.chord);
        let (decay, _) = S::as_simd_f64s(self.decay);
        let (next, _) = S::as_mut_simd_f64s(self.next);
        let (place, _) = S::as_mut_simd_f64s(self.place);
        let (speed, _) = S::as_mut_simd_f64s(self.speed);
        let (rough, _) = S::as_mut_simd_f64s(self.rough);
        let Weights { place: of_place, speed: of_speed, difference, .. } = self.weights;
        let h2 = simd.splat_f64s(self.h2);
        for c in 0..now.len() {
            let zero = simd.splat_f64s(0.0);
            let (mut sum, mut slope, mut kink) = (zero, zero, zero);
            for age in 0..TERMS {
                let a = lists[age][c];
                sum = simd.mul_add_f64s(simd.splat_f64s(of_place[age]), a, sum);
                // The newest of those that the velocity takes is not known yet: this one is a step older for it.
                if age + 1 < TERMS {
                    slope = simd.mul_add_f64s(simd.splat_f64s(of_speed[age + 1]), a, slope);
                }
                kink = simd.mul_add_f64s(simd.splat_f64s(difference[age + 1]), a, kink);
            }
            next[c] = simd.mul_f64s(decay[c], simd.mul_add_f64s(h2, sum, chord[c]));
            place[c] = simd.mul_add_f64s(decay[c], now[c], next[c]);
            speed[c] = simd.mul_f64s(decay[c], simd.mul_f64s(h2, slope));
            rough[c] = simd.mul_f64s(decay[c], kink);
        }
    }
}
