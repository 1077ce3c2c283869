//! Kicks and free flights in turn.

use meshes::Vec3;

use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::linear::{Linear, LinearFlow};
use crate::path::Path;

/// How kicks and flights alternate: the step begins and ends with a kick, and reads the same backwards.
#[derive(Debug, PartialEq)]
pub(crate) struct Scheme {
    pub order: u32,
    /// Parts of the step, up to and including the middle one: kicks.
    kicks: &'static [f64],
    /// Parts of the step, up to and including the middle one: flights.
    flights: &'static [f64],
    /// Whether the middle one is a kick (else a flight).
    middle_kick: bool,
}

/// Störmer's, Verlet's (1967) or leapfrog scheme: order 2.
pub(crate) const VERLET: Scheme = Scheme { order: 2, kicks: &[0.5], flights: &[1.0], middle_kick: false };

/// SRKN6b of Blanes and Moan, "Practical symplectic partitioned Runge-Kutta and Runge-Kutta-Nyström methods",
/// J. Comput. Appl. Math. 142 (2002) 313, table 3. The last ones of the paper's are fixed by the sum being one.
/// Checked by `order_blanes_moan_4`.
pub(crate) const BLANES_MOAN_4: Scheme = {
    const B: [f64; 3] = [0.0829844064174052, 0.396309801498368, -0.0390563049223486];
    const A: [f64; 2] = [0.245298957184271, 0.604872665711080];
    Scheme {
        order: 4,
        kicks: &[B[0], B[1], B[2], 1.0 - 2.0 * (B[0] + B[1] + B[2])],
        flights: &[A[0], A[1], 0.5 - (A[0] + A[1])],
        middle_kick: true,
    }
};

/// SRKN11b of the same paper and table. Checked by `order_blanes_moan_6`.
pub(crate) const BLANES_MOAN_6: Scheme = {
    const B: [f64; 5] =
        [0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879];
    const A: [f64; 5] =
        [0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928];
    Scheme {
        order: 6,
        kicks: &[B[0], B[1], B[2], B[3], B[4], 0.5 - (B[0] + B[1] + B[2] + B[3] + B[4])],
        flights: &[A[0], A[1], A[2], A[3], A[4], 1.0 - 2.0 * (A[0] + A[1] + A[2] + A[3] + A[4])],
        middle_kick: false,
    }
};

impl Scheme {
    fn stages(&self) -> usize {
        if self.middle_kick { 2 * self.flights.len() } else { 2 * self.flights.len() - 1 }
    }

    /// Which entry of `flights` the n-th flight is.
    fn flight_index(&self, n: usize) -> usize {
        n.min(self.stages() - 1 - n)
    }

    fn kick(&self, n: usize) -> f64 {
        self.kicks[n.min(self.stages() - n)]
    }
}

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
}

impl Integrator for Splitting {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: self.scheme.order, adaptive: false, random: false, starts_from_force: true }
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
            self.strongest.push(motion.acceleration.norm());
            let flows = &mut self.flows[lane];
            if flows.of != of && !of.0.is_free() {
                flows.of = of;
                flows.flows.clear();
                flows.flows.extend(scheme.flights.iter().map(|part| LinearFlow::new(&of.0, part * of.1)));
            }
        }
        self.time.clear();
        self.time.extend(block.state.iter().map(|s| s.time));
        for stage in 0..scheme.stages() {
            let (kick, which) = (scheme.kick(stage), scheme.flight_index(stage));
            for lane in 0..n {
                let (state, trial) = (&block.state[lane], &block.trial[lane]);
                let (r, v) = (&mut self.position[lane], &mut self.velocity[lane]);
                *v += self.acceleration[lane] * (kick * trial.step);
                if block.linear[lane].is_free() {
                    *r += *v * (scheme.flights[which] * trial.step);
                } else {
                    self.flows[lane].flows[which].apply(r, v);
                }
                self.time[lane] = if stage + 1 == scheme.stages() {
                    block.forces.within(trial.end, state.time, trial.end)
                } else {
                    self.time[lane] + scheme.flights[which] * trial.step
                };
            }
            block.forces.accelerations(&self.time, &self.position, &self.velocity, &mut self.acceleration);
            for (strongest, a) in self.strongest.iter_mut().zip(&self.acceleration) {
                *strongest = strongest.max(a.norm());
            }
        }
        let kick = scheme.kick(scheme.stages());
        for lane in 0..n {
            let trial = &mut block.trial[lane];
            let before = block.state[lane].motion.velocity;
            trial.motion.position = self.position[lane];
            trial.motion.velocity = self.velocity[lane] + self.acceleration[lane] * (kick * trial.step);
            trial.motion.acceleration = self.acceleration[lane];
            trial.fresh = true;
            let fastest = before.norm().max(trial.motion.velocity.norm()) + self.strongest[lane] * trial.step;
            trial.reach = fastest * trial.step;
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        for &lane in lanes {
            let (state, trial) = (&block.state[lane], &block.trial[lane]);
            let whole =
                |m: &crate::path::Motion| crate::path::Motion { acceleration: block.whole_acceleration(lane, m), ..*m };
            paths.push(Path::quintic(state.time, trial.step, &whole(&state.motion), &whole(&trial.motion)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_step_add_up_to_one_and_read_the_same_backwards() {
        for scheme in [&VERLET, &BLANES_MOAN_4, &BLANES_MOAN_6] {
            let stages = scheme.stages();
            let kicks: Vec<f64> = (0..=stages).map(|n| scheme.kick(n)).collect();
            let flights: Vec<f64> = (0..stages).map(|n| scheme.flights[scheme.flight_index(n)]).collect();
            for list in [&kicks, &flights] {
                assert!((list.iter().sum::<f64>() - 1.0).abs() < 1e-15);
                assert!(list.iter().eq(list.iter().rev()));
            }
        }
        assert_eq!([VERLET.stages(), BLANES_MOAN_4.stages(), BLANES_MOAN_6.stages()], [1, 6, 11]);
    }

    #[test]
    fn a_step_of_an_oscillator_has_the_series_of_sine_and_cosine() {
        // x' = v, v' = -x: position and velocity after a step are polynomials in h; up to the order of the method their
        // coefficients must be those of cos and sin, to the 15 digits of the paper's table. A slope would not see an error
        // in the twelfth digit.
        for scheme in [&VERLET, &BLANES_MOAN_4, &BLANES_MOAN_6] {
            for (x0, v0) in [(1.0, 0.0), (0.0, 1.0)] {
                let (mut x, mut v) = ([0.0; 9], [0.0; 9]);
                (x[0], v[0]) = (x0, v0);
                for stage in 0..=scheme.stages() {
                    for k in (1..9).rev() {
                        v[k] -= scheme.kick(stage) * x[k - 1];
                    }
                    if stage < scheme.stages() {
                        for k in (1..9).rev() {
                            x[k] += scheme.flights[scheme.flight_index(stage)] * v[k - 1];
                        }
                    }
                }
                let mut factorial = 1.0;
                for k in 0..=scheme.order as usize {
                    factorial *= k.max(1) as f64;
                    // x = x0 cos h + v0 sin h, v = v0 cos h - x0 sin h.
                    let sign = [1.0, 1.0, -1.0, -1.0][k % 4] / factorial;
                    let (cos, sin) = if k % 2 == 0 { (sign, 0.0) } else { (0.0, sign) };
                    assert!((x[k] - x0 * cos - v0 * sin).abs() < 2e-15, "order {} at {k}: {}", scheme.order, x[k]);
                    assert!((v[k] - v0 * cos + x0 * sin).abs() < 2e-15, "order {} at {k}: {}", scheme.order, v[k]);
                }
            }
        }
    }
}
