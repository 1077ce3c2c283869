//! How a grain gets from one time to the next.
//!
//! | integrator | order | step | right for |
//! |---|---|---|---|
//! | `Dop853` | 8, dense output 7 | adaptive | anything smooth without noise |
//! | `Verlet` | 2 | fixed | long runs, symplectic; stiff drag |
//! | `Boris` | 2 | fixed | the customary scheme in magnetic fields |
//! | `Langevin` | 2 (weak) | fixed | noise |
//! | `Stoermer` | 12 | adaptive | grains that feel each other |
//! | `Stoermer12` | 12 | fixed | smooth fields that are dear: one force a step |
//! | `BlanesMoan4`, `BlanesMoan6`, `BlanesMoan14` | 4, 6, 6 | fixed | long runs, symplectic, accurate |

pub(crate) mod boris;
pub(crate) mod dop853;
pub(crate) mod dop853_table;
pub(crate) mod langevin;
pub(crate) mod linear_splitting;
pub(crate) mod scheme;
pub(crate) mod splitting;
pub(crate) mod stoermer;

use crate::block::Block;
use crate::path::Path;

/// Carries the grains of a block over the steps they try.
pub(crate) trait Integrator {
    /// What kind of integrator it is.
    fn nature(&self) -> IntegratorNature;

    /// Fills in what comes of each grain's trial.
    fn advance(&mut self, block: &mut Block);

    /// Carries the grains over several steps at once, as long as those they try, to each of `ends` (s), and fills in what comes
    /// of them as of one long step: `reach` then holds for all of it. Asked only while all grains are at the same time, for
    /// steps that all lie between the same corners and samples. `false` when the integrator cannot, and nothing is done.
    fn leap(&mut self, _block: &mut Block, _ends: &[f64]) -> bool {
        false
    }

    /// The length of the next step (s), where it is not for the loop's control of errors to choose.
    fn asks(&self) -> Option<f64> {
        None
    }

    /// Told when grains leave the block, those whose flag is false; and whether the others' forces change by that, so that
    /// what was known of them no longer holds.
    fn retain(&mut self, _keep: &[bool], _forget: bool) {}

    /// What it knows of the past of each of so many lanes, if anything: for a run that is to go on from here.
    fn memory(&self, lanes: usize) -> Vec<Vec<f64>> {
        vec![Vec::new(); lanes]
    }

    /// Takes back what [`Integrator::memory`] told of the grains of a block, all of which it told at the same moment.
    fn remember(&mut self, _block: &Block, _memory: &[&[f64]]) {}

    /// The ways of some grains (by lane) during the step just advanced, pushed to `paths` in that order.
    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>);
}

/// What the loop over steps must know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct IntegratorNature {
    /// Order of the error of a run in the step.
    pub order: u32,
    /// Estimates its error, so that steps can follow it.
    pub adaptive: bool,
    /// Its paths are as good as its steps, so that samples need not be ends of steps.
    pub dense: bool,
    /// Draws random numbers.
    pub random: bool,
    /// Needs the acceleration at the start of a step.
    pub starts_from_force: bool,
}
