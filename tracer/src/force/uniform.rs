//! Forces that are the same everywhere.

use meshes::Vec3;

use super::linear_form::LinearForm;
use super::{Batch, Force, Scratch};

/// F = m g.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gravity {
    /// g, m/s².
    pub acceleration: Vec3,
}

impl Force for Gravity {
    fn add(&self, batch: &Batch, _: &mut Scratch, force: &mut [Vec3]) {
        for (f, m) in force.iter_mut().zip(batch.mass) {
            *f += self.acceleration * *m;
        }
    }

    fn add_energy(&self, batch: &Batch, _: &mut Scratch, energy: &mut [f64]) {
        for (i, w) in energy.iter_mut().enumerate() {
            *w -= batch.mass[i] * self.acceleration.dot(&batch.position[i]);
        }
    }

    fn linear_form(&self) -> Option<LinearForm> {
        Some(LinearForm { acceleration: self.acceleration, ..LinearForm::default() })
    }
}

/// The same force on every grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantForce {
    /// N.
    pub force: Vec3,
}

impl Force for ConstantForce {
    fn add(&self, _: &Batch, _: &mut Scratch, force: &mut [Vec3]) {
        for f in force {
            *f += self.force;
        }
    }

    fn add_energy(&self, batch: &Batch, _: &mut Scratch, energy: &mut [f64]) {
        for (w, r) in energy.iter_mut().zip(batch.position) {
            *w -= self.force.dot(r);
        }
    }

    fn linear_form(&self) -> Option<LinearForm> {
        Some(LinearForm { force: self.force, ..LinearForm::default() })
    }
}
