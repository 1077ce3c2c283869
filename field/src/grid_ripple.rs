//! How far the ripple of a grid reaches: beyond, its field is that of a sheet.
//!
//! The ripple is what the field differs by from its mean over a cell about the same point. It falls as e^(-2πz/L) with the longest
//! period L of the grid.

use std::f64::consts::{LN_2, TAU};

use meshes::Vec3;

use crate::{BasisField, Samples};

/// Points of a cell along each side.
const ACROSS: usize = 6;

/// Heights looked at on a side.
const ROUNDS: usize = 6;

/// A height is known when it moves by less than this, in pitches.
const SETTLED: f64 = 1e-3;

/// Heights that are looked at, in pitches beyond the grid itself.
const NEAREST: f64 = 0.02;
const FARTHEST: f64 = 4.0;

/// A grid in its place.
#[derive(Clone, Copy, Debug)]
pub struct GridFrame {
    /// A point of its plane in the middle of the plate, m.
    pub center: Vec3,
    /// Directions along the plate and its normal.
    pub frame: [Vec3; 3],
    /// A rectangle with which it repeats, m.
    pub cell: [f64; 2],
    /// Distance of neighbouring holes or wires, m.
    pub pitch: f64,
    /// Width of a wire, or of a bar between holes, m.
    pub wire: f64,
    /// Half of what it takes up along its normal, m.
    pub half_thickness: f64,
}

/// The distances from the plane of a grid, on the side of its normal and on the other, at which its ripple has fallen to a `share` of the
/// mean field on the stronger side, m. `weights`: of each channel of the field.
///
/// Nothing on a side where there is no such distance within four pitches: there the trap itself bends the field as much over a
/// cell. Where the ripple is weaker from the first, the distance of the grid's own surface.
///
/// Checked by `ripple_of_line_charges`.
pub fn ripple_depths(field: &dyn BasisField, weights: &[f64], grid: &GridFrame, share: f64) -> [Option<f64>; 2] {
    let far = [1.0, -1.0].map(|side| ripple(field, weights, grid, side * (grid.half_thickness + 1.5 * grid.pitch)));
    let strongest = far[0].mean.max(far[1].mean);
    if strongest == 0.0 {
        return [None; 2];
    }
    let excess = |side: f64, height: f64| {
        (ripple(field, weights, grid, side * (grid.half_thickness + height * grid.pitch)).largest / (share * strongest))
            .ln()
    };
    [0, 1].map(|k| {
        let side = if k == 0 { 1.0 } else { -1.0 };
        // Newton's method with the slope of the longest period at first, then the one that is seen.
        let (mut height, mut last) = (1.5, (far[k].largest / (share * strongest)).ln());
        let mut slope = -TAU;
        for _ in 0..ROUNDS {
            let next = (height - last / slope).clamp(NEAREST, FARTHEST);
            if (next - height).abs() < SETTLED {
                let nothing = next == FARTHEST && last > LN_2 * 1e-2;
                return (!nothing).then_some(grid.half_thickness + next * grid.pitch);
            }
            let there = excess(side, next);
            let seen = (there - last) / (next - height);
            // A ripple that does not fall is none.
            if seen > -0.2 * TAU && there > 0.0 {
                return None;
            }
            slope = seen.min(-0.2 * TAU);
            (height, last) = (next, there);
        }
        (last.abs() < 0.1).then_some(grid.half_thickness + height * grid.pitch)
    })
}

struct Ripple {
    /// Largest difference from the mean over a cell, V/m.
    largest: f64,
    /// The mean over the cell in the middle, V/m.
    mean: f64,
}

/// At a signed height over the plane of a grid. The field is looked at on two by two cells; each point of the inner cell is compared
/// with the mean over the cell about it, which also takes a slope of the field away.
fn ripple(field: &dyn BasisField, weights: &[f64], grid: &GridFrame, height: f64) -> Ripple {
    let side = 2 * ACROSS;
    let place = |k: usize, cell: f64| (k as f64 / ACROSS as f64 - 1.0) * cell;
    let mut points = Vec::with_capacity((side + 1) * (side + 1));
    for i in 0..=side {
        for j in 0..=side {
            let across = grid.frame[0] * place(i, grid.cell[0]) + grid.frame[1] * place(j, grid.cell[1]);
            points.push(grid.center + across + grid.frame[2] * height);
        }
    }
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let sum = |gradients: &[Vec3]| gradients.iter().zip(weights).map(|(g, w)| g * *w).sum::<Vec3>();
    let gradients: Vec<Vec3> = samples.gradient.chunks(field.channels()).map(sum).collect();
    let at = |i: usize, j: usize| gradients[i * (side + 1) + j];
    let half = ACROSS / 2;
    // The ends of a cell are the same place of the grid: each counts half.
    let weight = |k: usize| if k == 0 || k == ACROSS { 0.5 } else { 1.0 } / ACROSS as f64;
    let mean = |i: usize, j: usize| -> Vec3 {
        let entry = |(a, b)| at(i + a - half, j + b - half) * (weight(a) * weight(b));
        (0..=ACROSS).flat_map(|a| (0..=ACROSS).map(move |b| (a, b))).map(entry).sum()
    };
    let inner = || (half..half + ACROSS).flat_map(|i| (half..half + ACROSS).map(move |j| (i, j)));
    let largest = inner().map(|(i, j)| (at(i, j) - mean(i, j)).norm()).fold(0.0, f64::max);
    Ripple { largest, mean: mean(ACROSS, ACROSS).norm() }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Thin wires along y with equal charges, and a field along z that changes with x as a trap's does.
    struct Wires {
        pitch: f64,
        uniform: f64,
        bend: f64,
    }

    impl BasisField for Wires {
        fn channels(&self) -> usize {
            1
        }
        fn sample(&self, points: &[Vec3], samples: &mut Samples) {
            samples.reset(points.len(), 1);
            for (k, p) in points.iter().enumerate() {
                // φ = ln|2 sin(π(x + iz)/d)|: its gradient is the conjugate of (π/d) cot(π(x + iz)/d).
                let (x, z) = (PI * p.x / self.pitch, PI * p.z / self.pitch);
                let size = x.sin().powi(2) + z.sinh().powi(2);
                let cot = Vec3::new(x.sin() * x.cos(), 0.0, z.sinh() * z.cosh()) / size * (PI / self.pitch);
                samples.gradient[k] = cot + Vec3::z() * (self.uniform + self.bend * p.x);
            }
        }
    }

    #[test]
    fn ripple_of_line_charges() {
        // Over a wire the field of the wires is (π/d) coth(πz/d), on average π/d, and with a uniform one more above and less below: the
        // share s of the stronger, E, is reached where coth(πz/d) - 1 = q = s E d/π,  z = d/2π ln(1 + 2/q).
        let pitch = 2e-3;
        let own = PI / pitch;
        let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
        let grid = GridFrame { center: Vec3::zeros(), frame, cell: [pitch; 2], pitch, wire: 0.0, half_thickness: 0.0 };
        for (share, uniform) in [(0.02, 0.0), (0.01, own), (0.3, -2.0 * own)] {
            let field = Wires { pitch, uniform, bend: uniform / 20e-3 };
            let depths = ripple_depths(&field, &[3.0], &grid, share);
            let exact = pitch / TAU * (1.0 + 2.0 * own / (share * (own + uniform.abs()))).ln();
            for depth in depths {
                // Where the search stops, and what a mean of six points leaves of the sixth ripple; a slope of the field is no ripple.
                let depth = depth.unwrap();
                assert!((depth - exact).abs() < 3e-3 * pitch, "{depth} instead of {exact} at {share}");
            }
        }
    }

    #[test]
    fn a_bent_field_has_no_ripple_to_tell() {
        struct Bent;
        impl BasisField for Bent {
            fn channels(&self) -> usize {
                1
            }
            fn sample(&self, points: &[Vec3], samples: &mut Samples) {
                samples.reset(points.len(), 1);
                for (k, p) in points.iter().enumerate() {
                    samples.gradient[k] = Vec3::new(2.0 * p.x * p.z, 0.0, 1.0 + p.x * p.x - p.z * p.z);
                }
            }
        }
        let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
        let grid =
            GridFrame { center: Vec3::zeros(), frame, cell: [1.0; 2], pitch: 1.0, wire: 0.0, half_thickness: 0.0 };
        assert_eq!(ripple_depths(&Bent, &[1.0], &grid, 1e-3), [None; 2]);
    }
}
