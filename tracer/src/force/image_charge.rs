//! What the charges of the grains do to the electrodes, and these back to the grains.

use std::sync::Arc;

use field::Induction;
use meshes::Vec3;

use super::{Batch, Force, Nature, Scratch};

/// The force on each grain of the charges that all grains together induce on the electrodes: its own image charge, and those of
/// the others, which screen their Coulomb force.
///
/// W = ½ Σ_j Q_j φ_ind(r_j), F_j = -Q_j ∇φ_ind(r_j) with the induced charges held: the exact gradient of W
/// ([`field::induction`]). A grain closer to a conductor than the width of its panels is attracted with an error of some
/// hundredths and more. Checked by `exact_image_charge_of_a_plane` and `exact_image_charge_of_a_sphere`.
#[derive(Clone, Debug)]
pub struct ImageCharge {
    /// The electrodes.
    pub induction: Arc<Induction>,
}

impl Force for ImageCharge {
    fn nature(&self) -> Nature {
        Nature { couples_grains: true, ..Nature::default() }
    }

    fn add(&self, batch: &Batch, _: &mut Scratch, force: &mut [Vec3]) {
        let felt = self.induction.sample(batch.position, batch.charge, batch.radius);
        for ((f, (_, gradient)), q) in force.iter_mut().zip(felt).zip(batch.charge) {
            *f -= gradient * *q;
        }
    }

    fn add_energy(&self, batch: &Batch, _: &mut Scratch, energy: &mut [f64]) {
        let felt = self.induction.sample(batch.position, batch.charge, batch.radius);
        for ((w, (potential, _)), q) in energy.iter_mut().zip(felt).zip(batch.charge) {
            *w += 0.5 * q * potential;
        }
    }
}
