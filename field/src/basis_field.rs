//! The seam between ways of knowing a field: the panel sum, the table and closed forms are equals behind it.

use std::ops::Range;

use meshes::Vec3;

use crate::Quadratic;

/// Unit potentials and their gradients at a batch of points.
///
/// Entry `point * channels + channel` belongs to that point and channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Potential of the channel at 1 V, a pure number (V per V; V per unit strength for sources).
    pub potential: Vec<f64>,
    /// Gradient of that potential, 1/m. The field is minus this.
    pub gradient: Vec<Vec3>,
    /// Kept from call to call by who multiplies them.
    pub(crate) factors: Vec<f64>,
}

impl Samples {
    /// Makes room for `points * channels` entries, all zero.
    pub fn reset(&mut self, points: usize, channels: usize) {
        self.potential.clear();
        self.potential.resize(points * channels, 0.0);
        self.gradient.clear();
        self.gradient.resize(points * channels, Vec3::zeros());
    }

    /// Σ_c `factors[point * channels + c]` times channel c: a potential and a gradient for each point.
    pub fn sum(&self, factors: &[f64], potential: &mut [f64], gradient: &mut [Vec3]) {
        let channels = factors.len() / potential.len().max(1);
        for p in 0..potential.len() {
            let own = p * channels..(p + 1) * channels;
            (potential[p], gradient[p]) = self.sum_of(own.clone(), &factors[own]);
        }
    }

    /// The sum over some entries times factors.
    pub(crate) fn sum_of(&self, entries: Range<usize>, factors: &[f64]) -> (f64, Vec3) {
        let all = self.potential[entries.clone()].iter().zip(&self.gradient[entries]).zip(factors);
        all.fold((0.0, Vec3::zeros()), |(potential, gradient), ((p, g), f)| (potential + f * p, gradient + g * *f))
    }
}

/// Potentials of unit excitations, and their gradients, anywhere in space.
pub trait BasisField: Send + Sync {
    /// How many channels there are.
    fn channels(&self) -> usize;

    /// Potential and gradient of every channel at every point (m), into `samples`, whatever it held before.
    ///
    /// Whoever calls may split the work between threads, and so may an implementation whose points are dear: its answer for a
    /// point does not depend on the other points of the batch.
    fn sample(&self, points: &[Vec3], samples: &mut Samples);

    /// Σ_c `factors[point * channels + c]` times channel c at every point (m): a potential and a gradient for each, whatever the two
    /// slices held before. `scratch` is overwritten.
    ///
    /// *Why here:* grains at one time feel one field, and who interpolates can add channels up before, not after.
    fn sum(
        &self,
        points: &[Vec3],
        factors: &[f64],
        scratch: &mut Samples,
        potential: &mut [f64],
        gradient: &mut [Vec3],
    ) {
        self.sample(points, scratch);
        scratch.sum(factors, potential, gradient);
    }

    /// Whether its derivatives jump at many places, as those of a coarse interpolation do: then schemes of high order do not pay.
    fn is_rough(&self) -> bool {
        false
    }

    /// The potential of every channel, if all of them are quadratic functions of position everywhere. They give what
    /// [`BasisField::sample`] gives, to rounding.
    ///
    /// *Why here:* an ideal trap is the commonest closed form, and who integrates in it a thousand times faster without a
    /// call for each point must learn that it is one.
    fn quadratics(&self) -> Option<Vec<Quadratic>> {
        None
    }
}
