//! Kicks and free flights in turn.

use meshes::Vec3;

use super::scheme::Scheme;
use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::linear::{Linear, LinearFlow};
use crate::path::{Motion, Path};

/// Kicks by the forces between exact flights with drag and magnetic field ([`LinearFlow`]).
///
/// Time flows during flights; kicks are instantaneous. Symplectic without drag, also with a magnetic field and forces
/// that change with time.
///
/// *Why the Nyström coefficients hold with drag and magnetic field:* they need [B,[B,[B,A]]] = 0 of the flights A and
/// kicks B. With r' = v, v' = M v, t' = 1 and v' = f(r, t), the bracket [B,[B,A]] is (0, -2 (∂f/∂r) f): no velocity in
/// it, so it commutes with B for any matrix M.
pub(crate) struct Splitting {
    scheme: &'static Scheme,
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    time: Vec<f64>,
    acceleration: Vec<Vec3>,
    /// Square of the strongest acceleration of the step, m²/s⁴.
    strongest: Vec<f64>,
    flows: Vec<Flows>,
}

/// The flights of one grain over its step.
#[derive(Clone, Default)]
struct Flows {
    of: (Linear, f64),
    flows: Vec<LinearFlow>,
}

impl Splitting {
    pub fn new(scheme: &'static Scheme) -> Self {
        Self {
            scheme,
            position: Vec::new(),
            velocity: Vec::new(),
            time: Vec::new(),
            acceleration: Vec::new(),
            strongest: Vec::new(),
            flows: Vec::new(),
        }
    }

    /// Kicks all grains.
    fn kick(&mut self, block: &Block, part: f64) {
        for (lane, v) in self.velocity.iter_mut().enumerate() {
            *v += self.acceleration[lane] * (part * block.trial[lane].step);
        }
    }

    /// Flies all grains over the n-th flight of the step.
    fn fly(&mut self, block: &Block, n: usize) {
        let (part, which) = (self.scheme.flight(n), self.scheme.length_of(n));
        for lane in 0..block.len() {
            let (r, v) = (&mut self.position[lane], &mut self.velocity[lane]);
            if block.linear[lane].is_free() {
                *r += *v * (part * block.trial[lane].step);
            } else {
                self.flows[lane].flows[which].apply(r, v);
            }
            self.time[lane] += part * block.trial[lane].step;
        }
    }
}

impl Integrator for Splitting {
    fn nature(&self) -> IntegratorNature {
        let starts_from_force = self.scheme.outer_kicks;
        IntegratorNature { order: self.scheme.order, adaptive: false, dense: false, random: false, starts_from_force }
    }

    fn advance(&mut self, block: &mut Block) {
        let (scheme, n) = (self.scheme, block.len());
        self.flows.resize_with(n, Flows::default);
        self.position.clear();
        self.velocity.clear();
        self.acceleration.clear();
        self.strongest.clear();
        for lane in 0..n {
            let (motion, of) = (&block.state[lane].motion, (block.linear[lane], block.trial[lane].step));
            self.position.push(motion.position);
            self.velocity.push(motion.velocity);
            self.acceleration.push(motion.acceleration);
            self.strongest.push(if scheme.outer_kicks { motion.acceleration.norm_squared() } else { 0.0 });
            let flows = &mut self.flows[lane];
            if flows.of != of && !of.0.is_free() {
                flows.of = of;
                flows.flows.clear();
                flows.flows.extend(scheme.lengths().iter().map(|part| LinearFlow::new(&of.0, part * of.1)));
            }
        }
        self.time.clear();
        self.time.extend(block.state.iter().map(|s| s.time));
        let outer = usize::from(scheme.outer_kicks);
        if scheme.outer_kicks {
            self.kick(block, scheme.kick(0));
        }
        for flight in 0..scheme.flights() {
            self.fly(block, flight);
            if flight + outer == scheme.kicks() {
                break;
            }
            if flight + 1 == scheme.flights() {
                for lane in 0..n {
                    let (state, trial) = (&block.state[lane], &block.trial[lane]);
                    self.time[lane] = block.forces.within(trial.end, state.time, trial.end);
                }
            }
            block.forces.accelerations(&self.time, &self.position, &self.velocity, &mut self.acceleration);
            for (strongest, a) in self.strongest.iter_mut().zip(&self.acceleration) {
                *strongest = strongest.max(a.norm_squared());
            }
            self.kick(block, scheme.kick(flight + outer));
        }
        for lane in 0..n {
            let trial = &mut block.trial[lane];
            let before = block.state[lane].motion.velocity;
            trial.motion.position = self.position[lane];
            trial.motion.velocity = self.velocity[lane];
            trial.motion.acceleration = self.acceleration[lane];
            trial.fresh = scheme.outer_kicks;
            if !block.watched {
                trial.reach = 0.0;
                continue;
            }
            let fastest = before.norm_squared().max(trial.motion.velocity.norm_squared()).sqrt()
                + self.strongest[lane].sqrt() * trial.step;
            trial.reach = fastest * trial.step;
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        paths_between(block, lanes, paths, self.scheme.outer_kicks);
    }
}

/// The ways of some grains as quintics through positions, velocities and accelerations at both ends of the step; the
/// accelerations by the forces are asked for unless they are known.
pub(super) fn paths_between(block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>, known: bool) {
    let ends = |lane: usize| (block.state[lane].motion, block.trial[lane].motion);
    let (mut from, mut to): (Vec<Motion>, Vec<Motion>) = lanes.iter().map(|&lane| ends(lane)).unzip();
    if !known {
        let mut acceleration = Vec::new();
        for (motions, late) in [(&mut from, false), (&mut to, true)] {
            let time = |&lane: &usize| {
                let (start, end) = (block.state[lane].time, block.trial[lane].end);
                block.forces.within(if late { end } else { start }, start, end)
            };
            let time: Vec<f64> = lanes.iter().map(time).collect();
            let position: Vec<Vec3> = motions.iter().map(|m| m.position).collect();
            let velocity: Vec<Vec3> = motions.iter().map(|m| m.velocity).collect();
            block.forces.accelerations_of(lanes, &time, &position, &velocity, &mut acceleration);
            for (motion, a) in motions.iter_mut().zip(&acceleration) {
                motion.acceleration = *a;
            }
        }
    }
    for (i, &lane) in lanes.iter().enumerate() {
        let whole = |m: &Motion| Motion { acceleration: block.whole_acceleration(lane, m), ..*m };
        paths.push(Path::quintic(block.state[lane].time, block.trial[lane].step, &whole(&from[i]), &whole(&to[i])));
    }
}
