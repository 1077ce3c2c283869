//! The field of the electrodes.

use field::DrivenField;
use meshes::Vec3;

use super::linear_form::{LinearChannel, LinearForm};
use super::{Batch, Force, Nature, Scratch};

/// F = Q E(r, t) of a driven field.
///
/// What the grain's own charge does to the electrodes (its image) is not in it: that matters once k Q / (2 s) at the
/// distance s of a surface is comparable to the voltages.
#[derive(Clone)]
pub struct Electric {
    /// Volts on their basis.
    pub field: DrivenField,
}

impl Electric {
    /// Potential (V) and field (V/m) at the grains, left in the scratch's `scalar` and `vector`.
    fn evaluate(&self, batch: &Batch, scratch: &mut Scratch) {
        scratch.scalar.resize(batch.len(), 0.0);
        scratch.vector.resize(batch.len(), Vec3::zeros());
        self.field.evaluate(batch.position, batch.time, &mut scratch.samples, &mut scratch.scalar, &mut scratch.vector);
    }
}

impl Force for Electric {
    fn nature(&self) -> Nature {
        Nature {
            shortest_period: self.field.shortest_period(),
            rough: self.field.basis().is_rough(),
            ..Nature::default()
        }
    }

    fn add(&self, batch: &Batch, scratch: &mut Scratch, force: &mut [Vec3]) {
        self.evaluate(batch, scratch);
        for (i, f) in force.iter_mut().enumerate() {
            *f += scratch.vector[i] * batch.charge[i];
        }
    }

    fn add_energy(&self, batch: &Batch, scratch: &mut Scratch, energy: &mut [f64]) {
        self.evaluate(batch, scratch);
        for (i, w) in energy.iter_mut().enumerate() {
            *w += scratch.scalar[i] * batch.charge[i];
        }
    }

    fn linear_form(&self) -> Option<LinearForm> {
        let forms = self.field.basis().quadratics()?;
        let channels = forms.into_iter().zip(self.field.waveforms()).map(|(form, waveform)| LinearChannel {
            waveform: waveform.clone(),
            field: -form.gradient,
            hessian: form.hessian,
        });
        Some(LinearForm { channels: channels.collect(), ..LinearForm::default() })
    }

    fn next_corner(&self, t: f64) -> f64 {
        self.field.next_corner(t)
    }
}
