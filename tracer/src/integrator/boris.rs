//! Boris's scheme.

use meshes::Vec3;

use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::linear::{Linear, LinearFlow};
use crate::path::Path;

/// Half a drift, half a kick, the whole rotation and drag, half a kick, half a drift:
///
///   r½ = r + v h/2,  v⁻ = v + a h/2,  v⁺ = e^(-γh) R(ω h) v⁻,  v' = v⁺ + a h/2,  r' = r½ + v' h/2
///
/// a acceleration by the forces at r½ and t + h/2, R the exact rotation. Order 2; preserves volume without drag. With
/// φ = ω h the radius of a free gyration and the drift across an electric field are (φ/2) / tan(φ/2) times what they
/// should be: steps must resolve the gyration, where those of `Verlet` with its exact flight need not.
///
/// Source: Boris 1970, with the exact angle instead of its rational approximation. Checked by `order_boris`.
pub(crate) struct Boris {
    middle: Vec<Vec3>,
    time: Vec<f64>,
    velocity: Vec<Vec3>,
    acceleration: Vec<Vec3>,
    flows: Vec<(Linear, f64, LinearFlow)>,
}

impl Boris {
    pub fn new() -> Self {
        Self { middle: Vec::new(), time: Vec::new(), velocity: Vec::new(), acceleration: Vec::new(), flows: Vec::new() }
    }
}

impl Integrator for Boris {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 2, adaptive: false, dense: false, random: false, starts_from_force: false }
    }

    fn advance(&mut self, block: &mut Block) {
        self.middle.clear();
        self.time.clear();
        self.velocity.clear();
        for (state, trial) in block.state.iter().zip(&block.trial) {
            let m = &state.motion;
            self.middle.push(m.position + m.velocity * (0.5 * trial.step));
            self.velocity.push(m.velocity);
            self.time.push(0.5 * (state.time + trial.end));
        }
        block.forces.accelerations(&self.time, &self.middle, &self.velocity, &mut self.acceleration);
        self.flows.resize(block.len(), (Linear::default(), 0.0, LinearFlow::new(&Linear::default(), 0.0)));
        for lane in 0..block.len() {
            let (linear, trial) = (block.linear[lane], &mut block.trial[lane]);
            let h = trial.step;
            let flow = &mut self.flows[lane];
            if flow.0 != linear || flow.1 != h {
                *flow = (linear, h, LinearFlow::new(&linear, h));
            }
            let before = block.state[lane].motion.velocity;
            let kick = self.acceleration[lane] * (0.5 * h);
            let mut v = before + kick;
            if !linear.is_free() {
                v = flow.2.turned(&v);
            }
            v += kick;
            trial.motion.velocity = v;
            trial.motion.position = self.middle[lane] + v * (0.5 * h);
            trial.fresh = false;
            trial.reach = (before.norm().max(v.norm()) + 2.0 * kick.norm()) * h;
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        for &lane in lanes {
            let (state, trial) = (&block.state[lane], &block.trial[lane]);
            paths.push(Path::cubic(state.time, trial.step, &state.motion, &trial.motion));
        }
    }
}
