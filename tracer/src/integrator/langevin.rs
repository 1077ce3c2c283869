//! Grains kicked by the molecules of a gas.

use meshes::Vec3;

use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::cloud::normal_vector;
use crate::linear::{Linear, NoisyFlow};
use crate::path::Path;
use crate::stream::{Purpose, Stream};

/// Half a kick, the exact flight of a Brownian grain over the whole step with drag, rotation and noise, half a kick.
///
/// Weak order 2. Without noise it is `Verlet`. Exact whatever γ h is for a free grain's diffusion and for the mean
/// speed of fall under a constant force. In a harmonic well of frequency ω, <x²> comes out too large by the part
/// (ω h)² / 12 while γ h is small and ω² h / (2 γ), which is less, once it is large.
///
/// Source: the scheme called BUB in Sanz-Serna and Zygalakis, "Wasserstein distance estimates for the distributions of
/// numerical approximations to ergodic stochastic differential equations", JMLR 22 (2021). Checked by
/// `order_langevin_in_a_well`, `law_noise_in_a_well_is_boltzmann`, `law_noise_makes_the_thermal_speed_and_free_diffusion`.
///
/// *Why not BAOAB:* its drift uses the velocity as if free, so that with a grain in air at γ h = 0.5 the speed of fall
/// and the diffusion come out (γh/2) coth(γh/2) = 1.02 times too large, at γ h = 5 2.5 times. Traps in air work there.
pub(crate) struct Langevin {
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    time: Vec<f64>,
    acceleration: Vec<Vec3>,
    flows: Vec<((Linear, f64, f64), NoisyFlow)>,
}

impl Langevin {
    pub fn new() -> Self {
        Self {
            position: Vec::new(),
            velocity: Vec::new(),
            time: Vec::new(),
            acceleration: Vec::new(),
            flows: Vec::new(),
        }
    }
}

impl Integrator for Langevin {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 2, adaptive: false, dense: false, random: true, starts_from_force: true }
    }

    fn advance(&mut self, block: &mut Block) {
        self.position.clear();
        self.velocity.clear();
        self.time.clear();
        let still = Linear::default();
        self.flows.resize(block.len(), ((still, 0.0, 0.0), NoisyFlow::new(&still, 0.0, 0.0)));
        for lane in 0..block.len() {
            let (state, trial) = (&block.state[lane], &block.trial[lane]);
            let of = (block.linear[lane], block.thermal[lane], trial.step);
            let flow = &mut self.flows[lane];
            if flow.0 != of {
                *flow = (of, NoisyFlow::new(&of.0, of.1, of.2));
            }
            let mut r = state.motion.position;
            let mut v = state.motion.velocity + state.motion.acceleration * (0.5 * trial.step);
            let mut stream = Stream::new(block.seed, Purpose::Noise, block.forces.id[lane], trial.number);
            let (first, second) = (normal_vector(&mut stream), normal_vector(&mut stream));
            flow.1.apply(&mut r, &mut v, &first, &second);
            self.position.push(r);
            self.velocity.push(v);
            self.time.push(block.forces.within(trial.end, state.time, trial.end));
        }
        block.forces.accelerations(&self.time, &self.position, &self.velocity, &mut self.acceleration);
        for lane in 0..block.len() {
            let trial = &mut block.trial[lane];
            trial.motion.position = self.position[lane];
            trial.motion.velocity = self.velocity[lane] + self.acceleration[lane] * (0.5 * trial.step);
            trial.motion.acceleration = self.acceleration[lane];
            trial.fresh = true;
            trial.reach = (self.position[lane] - block.state[lane].motion.position).norm();
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        // Within a step the way is not known; its chord is the mean of what it may be once γ h is large.
        for &lane in lanes {
            let (state, trial) = (&block.state[lane], &block.trial[lane]);
            paths.push(Path::chord(state.time, trial.step, &state.motion, &trial.motion));
        }
    }
}
