//! What a grid is from afar: a sheet with a penetration length and a thickness.
//!
//!   φ(0±) = V_g + δ (E1 - E2) ∓ (τ/2) (E1 + E2)/2
//!
//! with φ(0±) the potentials of both sides extrapolated to the plane of the grid, E1 and E2 the slopes dφ/dz on the side of its
//! normal and on the other.
//!
//! Source: Maxwell 1873, sections 203 to 205; the thickness after `tests/reference/README.md`.

use meshes::Vec3;

use crate::{BasisField, Samples};

/// Points of a cell along each side: an average over them is blind to all ripples but the 8th.
const ACROSS: usize = 8;

/// Distances from the plane, in pitches. At the first of them the ripple that an average over a cell cannot take away (the 8th, of a
/// weave every fourth of a pitch) is below 3e-7; a parabola through all takes up how the field changes over the trap.
const HEIGHTS: [f64; 5] = [0.6, 0.8, 1.0, 1.2, 1.4];

/// A grid, seen from afar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSheet {
    /// Penetration length δ, m.
    pub delta: f64,
    /// Thickness τ, m.
    pub tau: f64,
    /// Slopes of the potential on the side of the normal and on the other, V/m.
    pub slopes: [f64; 2],
    /// How far δ moves when the field is taken from nearer points only, m. Where the trap is not much larger than a pitch this is no
    /// small part of δ: then there is no "from afar".
    pub uncertainty: f64,
}

/// δ and τ of a grid in each channel of a field, about a point of its plane in the middle of the plate; of channels in which the grid
/// itself is not at 0 V only the slopes mean anything. `frame`: the directions along the plate and its normal; `cell`: a rectangle
/// that holds whole cells of the grid, m; `pitch`: what heights are measured in, m.
///
/// τ is told only where the field comes through on both sides: with equal slopes of different sign it has no part in the potential
/// and is not a number.
pub fn grid_sheets(
    field: &dyn BasisField,
    center: &Vec3,
    frame: &[Vec3; 3],
    cell: [f64; 2],
    pitch: f64,
) -> Vec<GridSheet> {
    let mut points = Vec::new();
    for side in [1.0, -1.0] {
        for height in HEIGHTS {
            for i in 0..ACROSS {
                for j in 0..ACROSS {
                    let [u, v] = [i, j].map(|k| (k as f64 + 0.5) / ACROSS as f64 - 0.5);
                    let across = frame[0] * (u * cell[0]) + frame[1] * (v * cell[1]);
                    points.push(center + across + frame[2] * (side * height * pitch));
                }
            }
        }
    }
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let channels = field.channels();
    (0..channels).map(|channel| sheet(&samples.potential, channel, channels, pitch)).collect()
}

/// Of the potentials of the points of [`grid_sheets`].
fn sheet(potential: &[f64], channel: usize, channels: usize, pitch: f64) -> GridSheet {
    let mean = |from: usize| -> f64 {
        let sum: f64 = (from..from + ACROSS * ACROSS).map(|p| potential[p * channels + channel]).sum();
        sum / (ACROSS * ACROSS) as f64
    };
    let side = |which: usize| {
        let means: Vec<f64> = (0..HEIGHTS.len()).map(|h| mean((which * HEIGHTS.len() + h) * ACROSS * ACROSS)).collect();
        // From all heights, and from the nearest three alone.
        (parabola(&means), parabola(&means[..3]))
    };
    let (above, below) = (side(0), side(1));
    let sheet = |(above, up): (f64, f64), (below, down): (f64, f64)| {
        let slopes = [up / pitch, -down / pitch];
        let [e1, e2] = slopes;
        let (delta, tau) = (0.5 * (above + below) / (e1 - e2), 2.0 * (below - above) / (e1 + e2));
        GridSheet { delta, tau, slopes, uncertainty: 0.0 }
    };
    let (all, near) = (sheet(above.0, below.0), sheet(above.1, below.1));
    GridSheet { uncertainty: (all.delta - near.delta).abs(), ..all }
}

/// Value and slope at zero of the parabola through values at the first of [`HEIGHTS`], by least squares.
fn parabola(values: &[f64]) -> (f64, f64) {
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = Vec3::zeros();
    for (h, value) in HEIGHTS.iter().zip(values) {
        let row = Vec3::new(1.0, *h, h * h);
        normal += row * row.transpose();
        right += row * *value;
    }
    // Five different heights: never singular.
    let fit = normal.lu().solve(&right).unwrap_or_else(Vec3::zeros);
    (fit.x, fit.y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Thin wires along y, potential by the exact image sum of line charges: φ = E_far |z|/... as ln|2 sin(π(x + iz)/d)|.
    struct Wires {
        pitch: f64,
        tilt: f64,
    }

    impl BasisField for Wires {
        fn channels(&self) -> usize {
            1
        }
        fn sample(&self, points: &[Vec3], samples: &mut Samples) {
            samples.reset(points.len(), 1);
            for (k, p) in points.iter().enumerate() {
                let (x, z) = (PI * p.x / self.pitch, PI * p.z / self.pitch);
                // |2 sin(x + iz)|² = 4 (sin² x + sinh² z)
                samples.potential[k] = 0.5 * (4.0 * (x.sin().powi(2) + z.sinh().powi(2))).ln() + self.tilt * p.z;
            }
        }
    }

    #[test]
    fn line_charges_have_no_penetration_at_their_zero() {
        // ln|2 sin(π(x + iz)/d)| → π|z|/d far away: extrapolated to the plane it is zero, and at the distance r from a wire
        // ln(2πr/d): a wire of that potential has δ = -ln(2πr/d) / (2π/d), Maxwell's thin wires.
        let (pitch, r) = (0.01, 1e-4);
        let wire = (2.0 * PI * r / pitch).ln();
        let field = Wires { pitch, tilt: 30.0 };
        let axes = [Vec3::x(), Vec3::y(), Vec3::z()];
        let sheet = grid_sheets(&field, &Vec3::zeros(), &axes, [pitch, pitch], pitch)[0];
        // The 8th ripple at 0.6 pitches is e^-30, an eighth of it in the potential, over π of the slope; a fit makes some times that.
        assert!(sheet.delta.abs() < 1e-12 * pitch);
        assert!(
            (sheet.slopes[0] - (PI / pitch + 30.0)).abs() < 1e-8 && (sheet.slopes[1] + PI / pitch - 30.0).abs() < 1e-8
        );
        let delta = sheet.delta - wire / (sheet.slopes[0] - sheet.slopes[1]);
        assert!((delta - pitch / (2.0 * PI) * (pitch / (2.0 * PI * r)).ln()).abs() < 1e-12);
        assert!(sheet.tau.abs() < 1e-10 * pitch);
    }
}
