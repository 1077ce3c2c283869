//! Forces that are linear in the position.

use field::{Waveform, WaveformPart};
use meshes::Vec3;
use nalgebra::Matrix3;

/// A force that is a linear function of position, the same for all grains but for their charge Q and mass m:
///
///   F(r, t) = Q Σ_c V_c(t) (s_c - H_c r) + m g + F₀
///
/// Integrators that know it fly grains without asking for the force at each point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinearForm {
    /// What acts on charges.
    pub channels: Vec<LinearChannel>,
    /// g, m/s².
    pub acceleration: Vec3,
    /// F₀, N.
    pub force: Vec3,
}

/// The field of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearChannel {
    /// V_c, V.
    pub waveform: Waveform,
    /// s_c, the field at the origin at 1 V, 1/m.
    pub field: Vec3,
    /// H_c, 1/m².
    pub hessian: Matrix3<f64>,
}

impl LinearForm {
    /// The sum of two forces.
    pub fn plus(mut self, other: Self) -> Self {
        self.channels.extend(other.channels);
        self.acceleration += other.acceleration;
        self.force += other.force;
        self
    }

    /// Whether the axes do not mix: each component of the force depends on that of the position alone.
    pub fn is_diagonal(&self) -> bool {
        self.channels.iter().all(|c| c.hessian == Matrix3::from_diagonal(&c.hessian.diagonal()))
    }

    /// A bound of |Σ V_c(t) H_c| along the axes, at any time, V/m².
    pub fn steepest(&self) -> f64 {
        let part = |part: &WaveformPart| match part {
            WaveformPart::Sine { amplitude, .. }
            | WaveformPart::Square { amplitude, .. }
            | WaveformPart::Ramp { amplitude, .. } => amplitude.abs(),
            WaveformPart::Sampled { values, scale, .. } => values.iter().fold(0.0_f64, |m, v| m.max((scale * v).abs())),
        };
        let volts = |w: &Waveform| w.constant.abs() + w.parts.iter().map(part).sum::<f64>();
        self.channels.iter().map(|c| c.hessian.diagonal().amax() * volts(&c.waveform)).sum()
    }

    /// Σ V_c(t) H_c, along the axes, and Σ V_c(t) s_c: the force on a charge of 1 C is the second minus the first times the
    /// position. For forms that are diagonal.
    pub fn at(&self, time: f64) -> (Vec3, Vec3) {
        let (mut slope, mut field) = (Vec3::zeros(), Vec3::zeros());
        for channel in &self.channels {
            let volts = channel.waveform.value(time);
            slope += channel.hessian.diagonal() * volts;
            field += channel.field * volts;
        }
        (slope, field)
    }
}
