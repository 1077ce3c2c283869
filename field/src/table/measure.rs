//! What a table is like: its error, at points that are no nodes.

use meshes::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::PotentialTable;
use super::kernel::Kernel;
use super::octree::Brick;
use super::spline::CELLS;
use crate::{BasisField, PanelSum, Samples};

/// What a table is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TableReport {
    /// Number of nodes.
    pub nodes: usize,
    /// Bytes it takes.
    pub bytes: u64,
    /// Size of the largest interpolated cells, m.
    pub spacing: f64,
    /// Size of the smallest interpolated cells, m.
    pub finest_spacing: f64,
    /// Fraction of the space outside of conductors that is interpolated; the rest is left to the exact sum.
    pub tabulated_fraction: f64,
    /// Cells between a conductor and the nearest interpolated cell.
    pub layer: f64,
    /// Largest error of the potential at points between the nodes, as a fraction of the unit excitation.
    pub potential_error: f64,
    /// Largest error of the field there, as a fraction of the strongest field in interpolated cells.
    pub field_error: f64,
    /// Largest |Laplacian| of the interpolant at points between the nodes, times the size of the cell, as a fraction of the
    /// strongest field: zero for an exact potential. It knows nothing of the exact sum: a second opinion on the error.
    pub laplacian: f64,
    /// Largest jump of the potential between neighbouring bricks that are interpolated, as a fraction of the unit excitation:
    /// rounding.
    pub jump: f64,
    /// Points at which the error was measured.
    pub error_points: usize,
}

impl TableReport {
    /// The error that counts against the accuracy asked for.
    pub fn error(&self) -> f64 {
        self.field_error.max(10.0 * self.potential_error)
    }
}

/// Distances from conductors, in bricks, from each of which as many points are drawn: the worst bricks are the nearest ones.
const BANDS: [f64; 7] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, f64::INFINITY];

/// Points that are drawn from each band, and from all bricks together. The largest error of 200 points misses the largest of
/// all by a factor of about two where the error falls steeply with distance from a conductor.
const POINTS: usize = 200;

/// The error of a table. `clearance` is the distance of each brick from the nearest conductor in bricks.
pub(super) fn measure(table: &PotentialTable, clearance: &[f32], exact: &PanelSum, electrodes: usize) -> TableReport {
    let octree = &table.octree;
    let kept: Vec<usize> = octree.whole().filter(|(_, brick)| brick.tabulated).map(|(n, _)| n).collect();
    let mut next = sequence();
    let mut drawn: Vec<(usize, Vec3)> = Vec::new();
    let mut draw = |bricks: &[usize]| {
        for _ in 0..if bricks.is_empty() { 0 } else { POINTS } {
            let number = bricks[(next() * bricks.len() as f64) as usize];
            drawn.push((number, octree.point(&octree.all()[number], [next(), next(), next()])));
        }
    };
    for band in BANDS.windows(2) {
        let within = |n: &usize| (band[0]..band[1]).contains(&f64::from(clearance[*n]));
        draw(&kept.iter().copied().filter(within).collect::<Vec<_>>());
    }
    draw(&kept);
    drawn.retain(|(_, point)| !exact.below_ground(point));
    let points: Vec<Vec3> = drawn.iter().map(|(_, point)| *point).collect();
    let mut truth = Samples::default();
    exact.sample(&points, &mut truth);
    let n = if points.is_empty() { 0 } else { table.channels };
    let mut report = TableReport { error_points: points.len(), ..TableReport::default() };
    // One function after the other: splines of all of them may not fit in memory.
    for c in 0..n {
        let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == c))).collect();
        let kernel = Kernel::new(table, &[unit]);
        let errors: Vec<[f64; 6]> = drawn
            .par_iter()
            .enumerate()
            .map(|(p, (number, point))| {
                let at = p * n + c;
                let (mut potential, mut gradient) = (vec![0.0; n], vec![Vec3::zeros(); n]);
                exact.add_sources(point, &mut potential, &mut gradient);
                let Some((value, slope)) = sample(&kernel, point) else { return [0.0; 6] };
                // An electrode at 1 V; a source by the largest potential it makes.
                let height = if c < electrodes { 1.0 } else { truth.potential[at].abs() };
                let brick = &octree.all()[*number];
                let cell = octree.size(brick.level).max() / CELLS as f64;
                [
                    (potential[c] + value - truth.potential[at]).abs(),
                    height,
                    (gradient[c] + slope - truth.gradient[at]).norm(),
                    truth.gradient[at].norm(),
                    laplacian(&kernel, point, 1e-3 * cell).abs() * cell,
                    jump(table, &kernel, brick, point),
                ]
            })
            .collect();
        let largest = |k: usize| errors.iter().map(|e| e[k]).fold(f64::MIN_POSITIVE, f64::max);
        report.potential_error = report.potential_error.max(largest(0) / largest(1));
        report.field_error = report.field_error.max(largest(2) / largest(3));
        report.laplacian = report.laplacian.max(largest(4) / largest(3));
        report.jump = report.jump.max(largest(5) / largest(1));
    }
    report
}

/// Potential and gradient of the only channel at a point.
fn sample(kernel: &Kernel, point: &Vec3) -> Option<(f64, Vec3)> {
    let (mut potential, mut gradient, mut left) = ([0.0], [Vec3::zeros()], Vec::new());
    kernel.channels_at(std::slice::from_ref(point), &mut potential, &mut gradient, &mut left);
    left.is_empty().then_some((potential[0], gradient[0]))
}

/// Laplacian of the interpolant by differences of its gradient over `step` (m), 1/m² per unit; none where the table ends.
fn laplacian(kernel: &Kernel, point: &Vec3, step: f64) -> f64 {
    let along = |axis: usize| {
        let side = |sign: f64| Some(sample(kernel, &(point + Vec3::ith(axis, sign * step)))?.1[axis]);
        Some((side(1.0)? - side(-1.0)?) / (2.0 * step))
    };
    (0..3).map(along).sum::<Option<f64>>().unwrap_or(0.0)
}

/// How far from a face its two sides are asked, in bricks.
const BESIDE: f64 = 1e-7;

/// The largest jump of the potential where a line through the point along x, y or z leaves the brick.
fn jump(table: &PotentialTable, kernel: &Kernel, brick: &Brick, point: &Vec3) -> f64 {
    let (octree, size) = (&table.octree, table.octree.size(brick.level));
    let mut largest = 0.0_f64;
    for axis in 0..3 {
        for side in 0..2 {
            let mut face = *point;
            face[axis] = octree.point(brick, [f64::from(side); 3])[axis];
            let step = Vec3::ith(axis, BESIDE * size[axis]);
            let (Some(above), Some(below)) = (sample(kernel, &(face + step)), sample(kernel, &(face - step))) else {
                continue;
            };
            let rise = 0.5 * (above.1 + below.1).dot(&step) * 2.0;
            largest = largest.max((above.0 - below.0 - rise).abs());
        }
    }
    largest
}

/// Numbers in [0, 1), always the same ones: the additive recurrence of the golden ratio (Weyl 1916), scrambled so that
/// successive numbers are unrelated.
fn sequence() -> impl FnMut() -> f64 {
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
