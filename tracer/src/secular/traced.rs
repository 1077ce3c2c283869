//! Frequencies of a grain that is flown.

use field::analysis::{Effective, Square, Tones};
use meshes::Vec3;

use super::{Equilibrium, Mode};
use crate::spectrum::{Measured, measured};
use crate::{Ensemble, Grain, Method, Options, System, TraceError, Trajectories, trace};

/// Periods of the RF, at most: some seconds of flight where the field is dear.
const MOST_PERIODS: f64 = 600.0;

/// Turns of the slowest mode that are wanted, and the fewest from which a frequency is told.
const TURNS: f64 = 30.0;
const FEWEST: f64 = 6.0;

/// Samples of an RF period: lines up to half the RF's frequency stay clear of the images of its harmonics.
const SAMPLES: f64 = 8.0;
/// And of the fastest mode of a static field: two thirds of the fewest turns make a spectrum.
const STATIC_SAMPLES: f64 = 16.0;

/// Decay e^(-x/2), at most, of an amplitude that is looked at.
const DECAY: f64 = 12.0;

/// The mean energy per mass (J/kg) of a grain in a driven field whose voltages are these tones: its second derivatives are the
/// squares of the secular angular frequencies. Specific charge in C/kg, drag rate in 1/s, acceleration by gravity and constant
/// forces in m/s².
pub fn effective(tones: &Tones, specific_charge: f64, rate: f64, acceleration: Vec3) -> Effective {
    let mut squares = Vec::new();
    for tone in &tones.tones {
        let omega = std::f64::consts::TAU * tone.frequency;
        let strength = specific_charge * specific_charge / (4.0 * (omega * omega + rate * rate));
        for pattern in [&tone.cosine, &tone.sine] {
            if pattern.iter().any(|p| *p != 0.0) {
                squares.push(Square { strength, pattern: pattern.clone() });
            }
        }
    }
    Effective { statics: tones.constant.iter().map(|v| v * specific_charge).collect(), slope: -acceleration, squares }
}

/// The strongest three lines below half of the RF's frequency in the motion along each of three axes, of a grain that starts at
/// rest beside its equilibrium by `amplitude` (m) along all of them. `period` is that of the RF, if there is one; `grain` gives
/// charge, mass and radius.
///
/// Drag is taken out of the signal by e^(γt/2), under which a linear motion is one without drag. Empty lists where the motion
/// creeps, dies away or runs away before it has swung a few times.
///
/// # Errors
/// As [`trace()`].
pub fn traced(
    system: &System,
    grain: &Grain,
    equilibrium: &Equilibrium,
    axes: &[Vec3; 3],
    amplitude: f64,
    period: Option<f64>,
) -> Result<[Vec<Measured>; 3], TraceError> {
    let rate = system.drag_rate(grain.mass, grain.radius).unwrap_or(0.0);
    let swinging: Vec<&Mode> = equilibrium.modes.iter().filter(|m| m.frequency > 0.0).collect();
    let fastest = swinging.iter().map(|m| m.frequency).fold(0.0, f64::max);
    let slowest = swinging.iter().map(|m| m.frequency).fold(f64::INFINITY, f64::min);
    let growth = equilibrium.modes.iter().map(|m| -m.rate).fold(0.0, f64::max);
    let mut duration = TURNS / slowest;
    if let Some(period) = period {
        duration = duration.max(20.0 * period).min(MOST_PERIODS * period);
    } else {
        duration = duration.min(MOST_PERIODS / fastest);
    }
    if rate > 0.0 {
        duration = duration.min(DECAY / rate);
    }
    if swinging.is_empty() || duration * fastest < FEWEST || growth * duration > 3.0 {
        return Ok([Vec::new(), Vec::new(), Vec::new()]);
    }
    let every = period.map_or(1.0 / (STATIC_SAMPLES * fastest), |period| period / SAMPLES);
    let mut ensemble = Ensemble::new();
    let start = Grain {
        position: equilibrium.position + (axes[0] + axes[1] + axes[2]) * amplitude,
        velocity: equilibrium.velocity,
        ..*grain
    };
    // Finite by construction; a grain that is none has no lines.
    if ensemble.push(start).is_err() {
        return Ok([Vec::new(), Vec::new(), Vec::new()]);
    }
    let smooth = period.is_some() && system.magnetic_field == Vec3::zeros() && system.next_corner(0.0).is_infinite();
    let linear = system.linear_form().is_some();
    let method = if smooth && !linear { Method::Stoermer12 } else { Method::Auto };
    let options =
        Options { method, duration, tolerance: 1e-10, every: Some(every), estimate_error: false, ..Options::default() };
    let kept = Trajectories::default();
    trace(system, &ensemble, &options, &kept)?;
    let samples = kept.into_samples().swap_remove(0);
    let below = period.map_or(0.5 * STATIC_SAMPLES * fastest, |period| 0.5 / period);
    Ok(axes.map(|axis| {
        let undamped = |t: f64| if system.magnetic_field == Vec3::zeros() { (0.5 * rate * t).exp() } else { 1.0 };
        let away = samples.iter().map(|s| (s.position - equilibrium.position).dot(&axis) * undamped(s.time));
        // The last sample is at the end of the flight, not on the beat.
        let mut signal: Vec<f64> = away.collect();
        signal.pop();
        measured(&signal, every, below, 3)
    }))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use field::analysis::Expansion;
    use field::{DrivenField, QuadraticField, Waveform, WaveformPart};

    use super::super::Neighbourhood;
    use super::*;

    #[test]
    fn the_spectrum_of_a_flight_is_that_of_the_matrix() {
        let basis = QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0);
        let part = WaveformPart::Sine { amplitude: 0.11, frequency: 1.0 / std::f64::consts::TAU, phase: 0.0 };
        let waveforms = vec![Waveform { constant: 1e-4, parts: vec![part] }];
        for rate in [0.0, 0.02] {
            let field = DrivenField::new(Arc::new(basis.clone()), waveforms.clone());
            let system = System::new().with_field(field).with_drag(crate::Drag::Rate(rate));
            let expansion = Expansion::near(&basis, Vec3::zeros(), 1.0);
            let near = Neighbourhood {
                expansion: &expansion,
                waveforms: &waveforms,
                specific_charge: 1.0,
                rate,
                acceleration: Vec3::zeros(),
                magnetic_field: Vec3::zeros(),
                period: Some(std::f64::consts::TAU),
            };
            let equilibrium = near.equilibrium(&Vec3::zeros()).unwrap();
            let grain = Grain {
                position: Vec3::zeros(),
                velocity: Vec3::zeros(),
                charge: 1e-13,
                mass: 1e-13,
                radius: 0.0,
                id: 1,
                group: 0,
            };
            let axes = [Vec3::x(), Vec3::y(), Vec3::z()];
            let found = traced(&system, &grain, &equilibrium, &axes, 1e-3, near.period).unwrap();
            for (axis, lines) in axes.iter().zip(&found) {
                let mode = equilibrium.modes.iter().find(|m| m.axis.dot(axis).abs() > 0.9 || axis.z == 0.0).unwrap();
                let line = lines[0];
                let off = line.frequency / mode.frequency - 1.0;
                // Thirty turns of the slowest, with drag a dozen.
                assert!(off.abs() < 1e-4, "{rate} {axis}: {off} {line:?}");
                assert!((line.frequency - mode.frequency).abs() < line.error + 1e-9, "{rate}: {line:?} {mode:?}");
            }
        }
    }
}
