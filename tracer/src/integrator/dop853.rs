//! Dormand and Prince's 8(5,3), with its dense output.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

use super::dop853_table::{DENSE, ERROR_5, SOLUTION, SOLUTION_3, STAGES};
use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::path::{Motion, Path};

/// Order 8 with twelve forces a step; the error is estimated from embedded solutions of orders 5 and 3, and three more
/// forces, asked for only where they are needed, give a dense output of order 7.
///
/// Source: Hairer, Nørsett and Wanner (1993), section II.5 and program dop853.f. Where it departs: the error is measured
/// grain by grain, as the root mean square of the relative errors of position and velocity (two vectors), each against
/// the largest seen so far.
pub(crate) struct Dop853 {
    /// Derivatives at the stages; each holds three velocities for every grain, then three accelerations for every grain.
    k: Vec<Vec<f64>>,
    sum: Vec<f64>,
    error: [Vec<f64>; 2],
    stage: Points,
    acceleration: Vec<Vec3>,
    arch: Arch,
}

/// Where and when forces are wanted.
#[derive(Default)]
struct Points {
    time: Vec<f64>,
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
}

impl Points {
    fn clear(&mut self) {
        self.time.clear();
        self.position.clear();
        self.velocity.clear();
    }
}

/// Numbers handled at a time; lists of derivatives are filled up to a multiple of it.
const WIDTH: usize = 8;

impl Dop853 {
    pub fn new() -> Self {
        Self {
            k: vec![Vec::new(); 16],
            sum: Vec::new(),
            error: [Vec::new(), Vec::new()],
            stage: Points::default(),
            acceleration: Vec::new(),
            arch: Arch::new(),
        }
    }

    /// Stores the derivative at a stage: the velocities and accelerations at `self.stage`.
    fn store(&mut self, stage: usize, block: &Block) {
        let (n, k) = (block.len(), &mut self.k[stage]);
        for lane in 0..n {
            let v = self.stage.velocity[lane];
            let a = self.acceleration[lane] + block.linear[lane].acceleration(&v);
            k[3 * lane..3 * lane + 3].copy_from_slice(v.as_slice());
            k[3 * (n + lane)..3 * (n + lane) + 3].copy_from_slice(a.as_slice());
        }
    }

    /// Derivative of one grain at a stage.
    fn derivative(&self, stage: usize, n: usize, lane: usize) -> (Vec3, Vec3) {
        let k = &self.k[stage];
        (vector(k, lane), vector(k, n + lane))
    }
}

fn vector(list: &[f64], index: usize) -> Vec3 {
    Vec3::new(list[3 * index], list[3 * index + 1], list[3 * index + 2])
}

/// Weighted sum of derivatives, number by number.
struct Combine<'a> {
    weights: &'a [(usize, f64)],
    k: &'a [Vec<f64>],
    out: &'a mut [f64],
}

impl WithSimd for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (out, _) = S::as_mut_simd_f64s(self.out);
        for (c, out) in out.iter_mut().enumerate() {
            let mut sum = simd.splat_f64s(0.0);
            for &(j, w) in self.weights {
                let (k, _) = S::as_simd_f64s(&self.k[j]);
                sum = simd.add_f64s(sum, simd.mul_f64s(simd.splat_f64s(w), k[c]));
            }
            *out = sum;
        }
    }
}

impl Integrator for Dop853 {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 8, adaptive: true, dense: true, random: false, starts_from_force: true }
    }

    fn advance(&mut self, block: &mut Block) {
        let n = block.len();
        let padded = (6 * n).div_ceil(WIDTH) * WIDTH;
        for list in self.k.iter_mut().chain(&mut self.error).chain([&mut self.sum]) {
            list.clear();
            list.resize(padded, 0.0);
        }
        self.stage.clear();
        self.acceleration.clear();
        for state in &block.state {
            self.stage.velocity.push(state.motion.velocity);
            self.stage.position.push(state.motion.position);
            self.stage.time.push(state.time);
            self.acceleration.push(state.motion.acceleration);
        }
        self.store(0, block);
        for (lane, trial) in block.trial.iter_mut().enumerate() {
            // Until the end of the step: the square of the strongest acceleration.
            trial.reach = vector(&self.k[0], n + lane).norm_squared();
        }
        for stage in 1..=12 {
            let (c, weights) = if stage < 12 { (STAGES[stage - 1].c, STAGES[stage - 1].a) } else { (1.0, SOLUTION) };
            let (k, sum) = (&self.k[..], &mut self.sum[..]);
            self.arch.dispatch(Combine { weights, k, out: sum });
            for lane in 0..n {
                let (state, trial) = (&block.state[lane], &block.trial[lane]);
                self.stage.position[lane] = state.motion.position + vector(&self.sum, lane) * trial.step;
                self.stage.velocity[lane] = state.motion.velocity + vector(&self.sum, n + lane) * trial.step;
                let time = if c == 1.0 { trial.end } else { state.time + c * trial.step };
                self.stage.time[lane] = block.forces.within(time, state.time, trial.end);
            }
            let stages = &self.stage;
            block.forces.accelerations(&stages.time, &stages.position, &stages.velocity, &mut self.acceleration);
            self.store(stage, block);
            for lane in 0..n {
                let trial = &mut block.trial[lane];
                trial.reach = trial.reach.max(vector(&self.k[stage], n + lane).norm_squared());
            }
        }
        let (k, [five, three]) = (&self.k[..], &mut self.error);
        self.arch.dispatch(Combine { weights: ERROR_5, k, out: five });
        self.arch.dispatch(Combine { weights: SOLUTION_3, k, out: three });
        // `sum` still holds the weighted sum of the solution.
        for lane in 0..n {
            let (r, v) = (self.stage.position[lane], self.stage.velocity[lane]);
            let allowed = block.limits().allowed(&block.state[lane], &r, &v);
            let (state, trial) = (&block.state[lane], &mut block.trial[lane]);
            let h = trial.step;
            trial.motion = Motion { position: r, velocity: v, acceleration: self.acceleration[lane] };
            trial.fresh = true;
            // The motion bends with the strongest acceleration seen at the stages; twice that allows for what lies
            // between them.
            trial.reach = state.motion.velocity.norm() * h + trial.reach.sqrt() * h * h;
            let (mut five, mut three) = (0.0, 0.0);
            for (part, allowed) in allowed.into_iter().enumerate() {
                let (e5, s3) = (vector(&self.error[0], part * n + lane), vector(&self.error[1], part * n + lane));
                let e3 = vector(&self.sum, part * n + lane) - s3;
                // A grain that has never moved has no scale, and no error.
                if allowed > 0.0 {
                    five += e5.norm_squared() / (allowed * allowed);
                    three += e3.norm_squared() / (allowed * allowed);
                }
            }
            let denominator = five + 0.01 * three;
            trial.error = if denominator == 0.0 { 0.0 } else { h * five / (2.0 * denominator).sqrt() };
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        let n = block.len();
        let mut acceleration = Vec::new();
        for stage in 13..16 {
            self.stage.clear();
            let Points { time, position, velocity } = &mut self.stage;
            let node = &STAGES[stage - 2];
            for &lane in lanes {
                let (state, trial) = (&block.state[lane], &block.trial[lane]);
                let (mut r, mut v) = (Vec3::zeros(), Vec3::zeros());
                for &(j, w) in node.a {
                    let (kr, kv) = (vector(&self.k[j], lane), vector(&self.k[j], n + lane));
                    r += kr * w;
                    v += kv * w;
                }
                position.push(state.motion.position + r * trial.step);
                velocity.push(state.motion.velocity + v * trial.step);
                time.push(block.forces.within(state.time + node.c * trial.step, state.time, trial.end));
            }
            block.forces.accelerations_of(lanes, time, position, velocity, &mut acceleration);
            for (i, &lane) in lanes.iter().enumerate() {
                let v = velocity[i];
                let a = acceleration[i] + block.linear[lane].acceleration(&v);
                self.k[stage][3 * lane..3 * lane + 3].copy_from_slice(v.as_slice());
                self.k[stage][3 * (n + lane)..3 * (n + lane) + 3].copy_from_slice(a.as_slice());
            }
        }
        for &lane in lanes {
            let (state, trial) = (&block.state[lane], &block.trial[lane]);
            let h = trial.step;
            let (first, last) = (self.derivative(0, n, lane), self.derivative(12, n, lane));
            let terms = |part: usize, from: Vec3, to: Vec3, first: Vec3, last: Vec3| {
                let d = to - from;
                let mut f = [d, first * h - d, d * 2.0 - (first + last) * h, d, d, d, d];
                for (f, weights) in f[3..].iter_mut().zip(DENSE) {
                    *f = weights.iter().map(|&(j, w)| vector(&self.k[j], part * n + lane) * w).sum::<Vec3>() * h;
                }
                polynomial(from, &f)
            };
            let (a, b) = (&state.motion, &trial.motion);
            paths.push(Path::new(
                state.time,
                h,
                terms(0, a.position, b.position, first.0, last.0),
                terms(1, a.velocity, b.velocity, first.1, last.1),
            ));
        }
    }
}

/// y + θ (f0 + (1-θ) (f1 + θ (f2 + (1-θ) (f3 + θ (f4 + (1-θ) (f5 + θ f6)))))) in powers of θ.
fn polynomial(y: Vec3, f: &[Vec3; 7]) -> [Vec3; 8] {
    let mut p = [Vec3::zeros(); 8];
    for (k, f) in f.iter().enumerate().rev() {
        p[0] += f;
        let degree = 6 - k;
        if k % 2 == 0 {
            for i in (0..=degree).rev() {
                p[i + 1] = p[i];
            }
            p[0] = Vec3::zeros();
        } else {
            for i in (0..=degree).rev() {
                let moved = p[i];
                p[i + 1] -= moved;
            }
        }
    }
    p[0] += y;
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_agree_with_the_nested_form() {
        let v = |k: usize| Vec3::new(1.0 + k as f64, (3 * k % 5) as f64, -0.5 * k as f64);
        let f = [v(1), v(2), v(3), v(4), v(5), v(6), v(7)];
        let p = polynomial(v(0), &f);
        for theta in [0.0, 0.2, 0.7, 1.0] {
            let mut nested = Vec3::zeros();
            for k in (0..7).rev() {
                nested = (nested + f[k]) * if k % 2 == 0 { theta } else { 1.0 - theta };
            }
            let powers: Vec3 = p.iter().enumerate().map(|(k, c)| c * theta.powi(k as i32)).sum();
            // Rounding of sums of size 30.
            assert!((powers - nested - v(0)).norm() < 1e-13);
        }
    }
}
