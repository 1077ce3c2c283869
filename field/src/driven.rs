//! The field at a time: channels times their waveforms.

use std::sync::Arc;

use meshes::Vec3;

use crate::{BasisField, Samples, Waveform};

/// A basis with a waveform on each channel.
#[derive(Clone)]
pub struct DrivenField {
    basis: Arc<dyn BasisField>,
    waveforms: Vec<Waveform>,
}

impl DrivenField {
    /// Puts a waveform on each channel of the basis.
    ///
    /// # Panics
    /// The number of waveforms is not the number of channels.
    pub fn new(basis: Arc<dyn BasisField>, waveforms: Vec<Waveform>) -> Self {
        assert_eq!(basis.channels(), waveforms.len(), "one waveform for each channel");
        Self { basis, waveforms }
    }

    /// The basis.
    pub fn basis(&self) -> &Arc<dyn BasisField> {
        &self.basis
    }

    /// The waveform of each channel.
    pub fn waveforms(&self) -> &[Waveform] {
        &self.waveforms
    }

    /// Potential (V) and field (V/m) at each point (m), each at a time of its own (s).
    ///
    /// `scratch` is overwritten; keeping it between calls saves allocations.
    pub fn evaluate(
        &self,
        points: &[Vec3],
        times: &[f64],
        scratch: &mut Samples,
        potential: &mut [f64],
        field: &mut [Vec3],
    ) {
        let channels = self.waveforms.len();
        let mut volts = std::mem::take(&mut scratch.factors);
        volts.clear();
        for p in 0..points.len() {
            // Grains that step together are all at one time.
            if p > 0 && times[p] == times[p - 1] {
                volts.extend_from_within((p - 1) * channels..p * channels);
            } else {
                volts.extend(self.waveforms.iter().map(|w| w.value(times[p])));
            }
        }
        self.basis.sum(points, &volts, scratch, potential, field);
        scratch.factors = volts;
        field.iter_mut().for_each(|e| *e = -*e);
    }

    /// The first time after `t` at which some waveform is not smooth (a jump or a corner), or infinity.
    pub fn next_corner(&self, t: f64) -> f64 {
        self.waveforms.iter().map(|w| w.next_corner(t)).fold(f64::INFINITY, f64::min)
    }

    /// The shortest period of any waveform, s, or `None` when nothing is periodic.
    pub fn shortest_period(&self) -> Option<f64> {
        self.waveforms.iter().filter_map(Waveform::shortest_period).min_by(f64::total_cmp)
    }
}
