//! Störmer's multistep scheme of order 12: one force a step.

mod adaptive;
mod past;
mod weights;

pub(crate) use self::adaptive::AdaptiveStoermer;

use self::past::Past;
use super::scheme::BLANES_MOAN_14;
use super::splitting::{Splitting, paths_between};
use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::path::Path;

/// The position from the chord before it and twelve accelerations, the velocity from the chord and twelve:
///
///   d' = d + h² Σ_j σ_j a_j,   r' = r + d',   h v' = d' + h² Σ_j c_j a_j
///
/// d the chord of the last step, kept apart, so that rounding of r does not spoil it; σ_j weights of the acceleration j steps
/// before the start, c_j before the end, both exact for accelerations that are polynomials of degree 11 in time. With drag γ the scheme
/// holds for e^(γt/2) r, whose acceleration has (γ/2)² r added to it.
/// The first eleven steps, and those after a corner of a waveform or another length of step, are done by `BlanesMoan14`.
///
/// In a Paul trap 1e-6 after 1000 periods takes 32 to 36 forces a period, where `BlanesMoan14` takes 112 to 140. Not symplectic,
/// but for its order the energy hardly moves: errors at 48 steps a period are 3e-9 at q = 0.4, 3e-8 at q = 0.8. Grows without
/// bounds where a step is more than a tenth of 1/ω of the fastest oscillation; the estimate of the error then shows it.
///
/// Source: Störmer 1907; Hairer, Nørsett and Wanner (1993), III.10. Checked by `order_stoermer`, `exact_mathieu_trajectories`.
pub(crate) struct Stoermer {
    starter: Splitting,
    past: Past,
}

impl Stoermer {
    pub fn new() -> Self {
        Self { starter: Splitting::new(&BLANES_MOAN_14), past: Past::new() }
    }
}

impl Integrator for Stoermer {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature { order: 12, adaptive: false, dense: true, random: false, starts_from_force: true }
    }

    fn advance(&mut self, block: &mut Block) {
        let Some(trial) = block.trial.first() else { return };
        if trial.first {
            self.past.forget();
        }
        let step = trial.step;
        self.past.note(block, step);
        if self.past.suffices() {
            self.past.advance(block, false);
        } else {
            self.starter.advance(block);
        }
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        let known = block.trial.iter().all(|trial| trial.fresh);
        paths_between(block, lanes, paths, known);
    }

    fn memory(&self, lanes: usize) -> Vec<Vec<f64>> {
        self.past.memory(lanes)
    }

    fn remember(&mut self, block: &Block, memory: &[&[f64]]) {
        self.past.remember(block, memory);
    }

    fn retain(&mut self, keep: &[bool], forget: bool) {
        if forget {
            self.past.forget();
        } else {
            self.past.retain(keep);
        }
    }
}
