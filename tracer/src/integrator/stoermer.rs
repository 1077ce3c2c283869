//! Störmer's multistep scheme of order 12: one force a step.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

use super::scheme::BLANES_MOAN_14;
use super::splitting::{Splitting, paths_between};
use super::{Integrator, IntegratorNature};
use crate::block::{Block, retain};
use crate::linear::LinearFlow;
use crate::path::Path;

/// The position from the chord before it and twelve accelerations, the velocity from the chord and twelve:
///
///   d' = d + h² Σ_j σ_j a_j,   r' = r + d',   h v' = d' + h² Σ_j c_j a_j
///
/// d the chord of the last step, kept apart, so that rounding of r does not spoil it; σ_j weights of the acceleration j steps before the start, c_j before the end, both exact for accelerations that are
/// polynomials of degree 11 in time. With drag γ the scheme holds for e^(γt/2) r, whose acceleration has (γ/2)² r added to it.
/// The first eleven steps, and those after a corner of a waveform or another length of step, are done by `BlanesMoan14`.
///
/// In a Paul trap 1e-6 after 1000 periods takes 32 to 36 forces a period, where `BlanesMoan14` takes 112 to 140. Not symplectic,
/// but for its order the energy hardly moves: errors at 48 steps a period are 3e-9 at q = 0.4, 3e-8 at q = 0.8. Grows without
/// bounds where a step is more than a tenth of 1/ω of the fastest oscillation; the estimate of the error then shows it.
///
/// Source: Störmer 1907; Hairer, Nørsett and Wanner (1993), III.10. Checked by `order_stoermer`, `exact_mathieu_trajectories`.
pub(crate) struct Stoermer {
    starter: Splitting,
    weights: Weights,
    /// Accelerations by age, the newest first; x, y, z of each grain one after the other, scaled by the drag since.
    history: [Vec<f64>; TERMS],
    /// How many are known.
    filled: usize,
    /// The chord of the last step, m; known once all accelerations are.
    chord: Vec<f64>,
    chord_known: bool,
    /// Step they belong to, s.
    step: f64,
    /// Positions now and sums for the next, m.
    now: Vec<f64>,
    place: Vec<f64>,
    speed: Vec<f64>,
    /// e^(-γh/2) for each number.
    decay: Vec<f64>,
    time: Vec<f64>,
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    acceleration: Vec<Vec3>,
    arch: Arch,
}

/// Accelerations that a step uses.
const TERMS: usize = 12;

/// Numbers handled at a time; lists are filled up to a multiple of it.
const WIDTH: usize = 8;

/// σ_j and c_j, by the age j of the acceleration.
struct Weights {
    place: [f64; TERMS],
    speed: [f64; TERMS],
}

impl Weights {
    /// Through backward differences: σ from the series (z / ln(1-z))² / (1-z), c from (-1)^m ∫ (1-s) binom(s, m) ds over 0 to 1.
    fn new() -> Self {
        // ln(1-z)/(-z) = Σ z^j / (j+1), its square, the inverse of that, and its partial sums.
        let log: [f64; TERMS] = std::array::from_fn(|j| 1.0 / (j + 1) as f64);
        let square: [f64; TERMS] = std::array::from_fn(|n| (0..=n).map(|j| log[j] * log[n - j]).sum());
        let mut inverse = [0.0; TERMS];
        inverse[0] = 1.0;
        for n in 1..TERMS {
            inverse[n] = -(1..=n).map(|j| square[j] * inverse[n - j]).sum::<f64>();
        }
        let place = std::array::from_fn(|n| inverse[..=n].iter().sum());
        // Eight Gauss points are exact for the polynomials of degree twelve.
        const NODES: [(f64, f64); 4] = [
            (0.183_434_642_495_649_8, 0.362_683_783_378_362),
            (0.525_532_409_916_329, 0.313_706_645_877_887_3),
            (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
            (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
        ];
        let mut speed = [0.0; TERMS];
        for (node, weight) in NODES {
            for s in [0.5 - 0.5 * node, 0.5 + 0.5 * node] {
                let mut term = 0.5 * weight * (1.0 - s);
                for (m, sum) in speed.iter_mut().enumerate() {
                    *sum += term;
                    term *= -(s - m as f64) / (m + 1) as f64;
                }
            }
        }
        Self { place: ordinates(&place), speed: ordinates(&speed) }
    }
}

/// Weights of values from those of backward differences.
fn ordinates(differences: &[f64; TERMS]) -> [f64; TERMS] {
    let mut values = [0.0; TERMS];
    for (m, weight) in differences.iter().enumerate() {
        let mut binomial = 1.0;
        for (j, value) in values.iter_mut().enumerate().take(m + 1) {
            *value += weight * binomial;
            binomial *= -((m - j) as f64) / (j + 1) as f64;
        }
    }
    values
}

impl Stoermer {
    pub fn new() -> Self {
        Self {
            starter: Splitting::new(&BLANES_MOAN_14),
            weights: Weights::new(),
            history: std::array::from_fn(|_| Vec::new()),
            filled: 0,
            chord: Vec::new(),
            chord_known: false,
            step: 0.0,
            now: Vec::new(),
            place: Vec::new(),
            speed: Vec::new(),
            decay: Vec::new(),
            time: Vec::new(),
            position: Vec::new(),
            velocity: Vec::new(),
            acceleration: Vec::new(),
            arch: Arch::new(),
        }
    }

    /// Takes in where the grains are and their accelerations, and forgets what is older after a corner or another step.
    fn note(&mut self, block: &Block) {
        let padded = (3 * block.len()).div_ceil(WIDTH) * WIDTH;
        let (first, step) = block.trial.first().map_or((true, 0.0), |trial| (trial.first, trial.step));
        if first || step != self.step {
            self.filled = 0;
            self.step = step;
        }
        if self.filled == 0 {
            self.chord_known = false;
            self.make_room(block, padded);
        }
        for list in [&mut self.now, &mut self.place, &mut self.speed, &mut self.chord] {
            list.resize(padded, 0.0);
        }
        self.history.rotate_right(1);
        let list = &mut self.history[0];
        for (lane, state) in block.state.iter().enumerate() {
            let half = 0.5 * block.linear[lane].rate;
            let whole = state.motion.acceleration + state.motion.position * (half * half);
            list[3 * lane..3 * lane + 3].copy_from_slice(whole.as_slice());
            self.now[3 * lane..3 * lane + 3].copy_from_slice(state.motion.position.as_slice());
        }
        self.filled = (self.filled + 1).min(TERMS);
        if self.filled == TERMS && !self.chord_known {
            self.find_chord(block);
        }
    }

    /// Empty lists of accelerations, and the decay over a step.
    fn make_room(&mut self, block: &Block, padded: usize) {
        for list in &mut self.history {
            list.clear();
            list.resize(padded, 0.0);
        }
        self.decay.clear();
        for linear in &block.linear {
            let (_, decay) = LinearFlow::new(linear, 0.5 * self.step).along();
            self.decay.extend([decay; 3]);
        }
        self.decay.resize(padded, 1.0);
    }

    /// The chord that belongs to the velocity now: d = h v - h² Σ c_j a_j.
    fn find_chord(&mut self, block: &Block) {
        let h = self.step;
        for (lane, state) in block.state.iter().enumerate() {
            let half = 0.5 * block.linear[lane].rate;
            let speed = state.motion.velocity + state.motion.position * half;
            let known = self.weights.speed.iter().zip(&self.history);
            let sum: Vec3 = known.map(|(c, list)| vector(list, lane) * *c).sum();
            self.chord[3 * lane..3 * lane + 3].copy_from_slice((speed * h - sum * (h * h)).as_slice());
        }
        self.chord_known = true;
    }
}

impl Integrator for Stoermer {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 12, adaptive: false, dense: true, random: false, starts_from_force: true }
    }

    fn advance(&mut self, block: &mut Block) {
        self.note(block);
        let h = self.step;
        let Self { weights, history, chord, now, place, speed, decay, .. } = self;
        if decay.iter().any(|&decay| decay != 1.0) {
            let carry = |list: &mut [f64]| list.iter_mut().zip(&*decay).for_each(|(x, decay)| *x *= decay);
            history.iter_mut().for_each(|list| carry(list));
            carry(chord);
            carry(now);
        }
        self.arch.dispatch(Sums { weights, h2: h * h, history, now, chord, place, speed });
        if self.filled < TERMS {
            self.starter.advance(block);
            return;
        }
        self.time.clear();
        self.position.clear();
        self.velocity.clear();
        for (lane, (state, trial)) in block.state.iter().zip(&block.trial).enumerate() {
            self.time.push(block.forces.within(trial.end, state.time, trial.end));
            self.position.push(vector(&self.place, lane));
            self.velocity.push(state.motion.velocity);
        }
        block.forces.accelerations(&self.time, &self.position, &self.velocity, &mut self.acceleration);
        for lane in 0..block.len() {
            let half = 0.5 * block.linear[lane].rate;
            let (r, a) = (self.position[lane], self.acceleration[lane]);
            // `speed` holds the sum without the newest.
            let chord = vector(&self.chord, lane);
            let sum = vector(&self.speed, lane) + (a + r * (half * half)) * (self.weights.speed[0] * h * h);
            let trial = &mut block.trial[lane];
            trial.motion.position = r;
            trial.motion.velocity = (chord + sum) / h - r * half;
            trial.motion.acceleration = a;
            trial.fresh = true;
            trial.reach = 0.0;
            if block.watched {
                let state = &block.state[lane].motion;
                let fastest = state.velocity.norm_squared().max(trial.motion.velocity.norm_squared()).sqrt();
                let strongest = state.acceleration.norm_squared().max(a.norm_squared()).sqrt();
                trial.reach = h * (fastest + h * strongest);
            }
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        let known = block.trial.iter().all(|trial| trial.fresh);
        paths_between(block, lanes, paths, known);
    }

    fn memory(&self, lanes: usize) -> Vec<Vec<f64>> {
        let known = if self.filled == TERMS && self.chord_known { 1.0 } else { 0.0 };
        let of_lane = |lane: usize| {
            let lists = self.history[..self.filled].iter().chain([&self.chord]);
            let numbers = lists.flat_map(|list| {
                // Before the first step there are no lists.
                (0..3).map(move |k| list.get(3 * lane + k).copied().unwrap_or(0.0))
            });
            [self.filled as f64, self.step, known].into_iter().chain(numbers).collect()
        };
        (0..lanes).map(of_lane).collect()
    }

    fn remember(&mut self, block: &Block, memory: &[&[f64]]) {
        let Some([filled, step, known, ..]) = memory.first() else { return };
        let padded = (3 * block.len()).div_ceil(WIDTH) * WIDTH;
        (self.step, self.chord_known) = (*step, *known == 1.0);
        self.filled = (*filled as usize).min(TERMS);
        self.make_room(block, padded);
        self.chord.resize(padded, 0.0);
        for (lane, numbers) in memory.iter().enumerate() {
            let mut numbers = numbers[3..].chunks_exact(3);
            for list in &mut self.history[..self.filled] {
                list[3 * lane..3 * lane + 3].copy_from_slice(numbers.next().unwrap_or(&[0.0; 3]));
            }
            self.chord[3 * lane..3 * lane + 3].copy_from_slice(numbers.next().unwrap_or(&[0.0; 3]));
        }
    }

    fn retain(&mut self, keep: &[bool], forget: bool) {
        if forget {
            self.filled = 0;
            return;
        }
        let keep: Vec<bool> = keep.iter().flat_map(|&k| [k; 3]).collect();
        for list in self.history.iter_mut().chain([&mut self.chord, &mut self.decay]) {
            list.truncate(keep.len());
            retain(list, &keep);
            list.resize(list.len().div_ceil(WIDTH) * WIDTH, 0.0);
        }
    }
}

fn vector(list: &[f64], index: usize) -> Vec3 {
    Vec3::new(list[3 * index], list[3 * index + 1], list[3 * index + 2])
}

/// Finds the next chords and positions and what the known accelerations add to h v, all scaled to the end of the step.
struct Sums<'a> {
    weights: &'a Weights,
    h2: f64,
    history: &'a [Vec<f64>; TERMS],
    now: &'a [f64],
    chord: &'a mut [f64],
    place: &'a mut [f64],
    speed: &'a mut [f64],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lists: [&[S::f64s]; TERMS] = std::array::from_fn(|age| S::as_simd_f64s(&self.history[age]).0);
        let (now, _) = S::as_simd_f64s(self.now);
        let (chord, _) = S::as_mut_simd_f64s(self.chord);
        let (place, _) = S::as_mut_simd_f64s(self.place);
        let (speed, _) = S::as_mut_simd_f64s(self.speed);
        let (of_place, of_speed) = (&self.weights.place, &self.weights.speed);
        let h2 = simd.splat_f64s(self.h2);
        for c in 0..now.len() {
            let zero = simd.splat_f64s(0.0);
            let (mut sum, mut slope) = (zero, zero);
            for age in 0..TERMS {
                let a = lists[age][c];
                sum = simd.mul_add_f64s(simd.splat_f64s(of_place[age]), a, sum);
                // The newest of those that the velocity takes is not known yet: this one is a step older for it.
                if age + 1 < TERMS {
                    slope = simd.mul_add_f64s(simd.splat_f64s(of_speed[age + 1]), a, slope);
                }
            }
            chord[c] = simd.mul_add_f64s(h2, sum, chord[c]);
            place[c] = simd.add_f64s(now[c], chord[c]);
            speed[c] = simd.mul_f64s(h2, slope);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_exact_for_polynomials() {
        // a = (t/12)^m with h = 1, from t = 0 backwards: r' - 2 r + r⁻ and h v' - (r' - r).
        let weights = Weights::new();
        for m in 0..TERMS as i32 {
            let a = |t: f64| (t / 12.0).powi(m);
            let r = |t: f64| t * t * a(t) / f64::from((m + 1) * (m + 2));
            let v = |t: f64| t * a(t) / f64::from(m + 1);
            let place: f64 = (0..TERMS).map(|j| weights.place[j] * a(-(j as f64))).sum();
            let speed: f64 = (0..TERMS).map(|j| weights.speed[j] * a(1.0 - j as f64)).sum();
            // Rounding of sums of numbers of size 100.
            assert!((place - (r(1.0) - 2.0 * r(0.0) + r(-1.0))).abs() < 1e-12, "degree {m}");
            assert!((speed - (v(1.0) - r(1.0) + r(0.0))).abs() < 1e-13, "degree {m}");
        }
        // As they stand in the textbooks: 1, 0, 1/12, 1/12, 19/240 for the differences of σ.
        let total: f64 = weights.place.iter().sum();
        assert!((total - 1.0).abs() < 1e-12 && (weights.speed.iter().sum::<f64>() - 0.5).abs() < 1e-14);
    }
}
