//! The tabulated potential: unit potentials in bricks, interpolated.
//!
//! A table covers a box with bricks, smaller ones where the field needs them ([`Octree`]). Bricks next to a conductor, where no
//! polynomial can follow the field, are left to the exact panel sum, and so is everything outside the box: nothing is
//! extrapolated. How small bricks must be and how thick that layer follows from the error, measured at points between the nodes.
//!
//! A [`PotentialTable`] holds the derivatives of the basis functions at the corners of bricks; it is what is kept in files. A
//! [`TabulatedField`] holds splines of the channels that follow from it, in single precision where that rounds off less than a
//! thousandth of the accuracy; it is what grains fly in.

mod bspline;
mod fill;
mod finder;
mod grid;
mod hermite;
mod kernel;
mod lanes;
mod measure;
mod octree;
mod refine;
mod rows;
mod spline;
mod tabulate;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::Arc;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

pub use grid::Grid;
pub use hermite::PER_NODE;
pub use measure::TableReport;
pub use octree::{Brick, Octree};
pub use tabulate::{TableError, TableOptions, halvings_for, tabulate, tabulate_around};

use crate::panel_sum::PanelSum;
use crate::{BasisField, ElectrodeBasis, Samples};
use kernel::Kernel;

/// Cells of a table along the edge of one of its bricks.
pub const CELLS_PER_BRICK: usize = spline::CELLS;

/// Potentials of basis functions and their derivatives at the corners of bricks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PotentialTable {
    /// The bricks.
    pub octree: Octree,
    /// Number of functions.
    pub channels: usize,
    /// Accuracy of the field that was asked for.
    pub accuracy: f64,
    /// Splines are of degree five: from [`SMOOTH`] on, and where that was asked for.
    pub smooth: bool,
    /// Potential and derivatives at the nodes, in units of the coarsest bricks: entry `(node * channels + channel) * 27 + a + 3 b + 9 c`
    /// is ∂_x^a ∂_y^b ∂_z^c.
    pub nodes: Vec<f64>,
}

impl PotentialTable {
    /// A table of given derivatives, all bricks of one size and interpolated: `derivatives` gives for a point (m) the potential of
    /// each channel and its derivatives per metre, in the order of [`PotentialTable::nodes`]. The bricks are the cells of the
    /// grid.
    pub fn of_function(
        grid: Grid,
        channels: usize,
        accuracy: f64,
        derivatives: impl Fn(&Vec3) -> Vec<[f64; PER_NODE]>,
    ) -> Self {
        Self::of_bricks(Octree::new(grid), channels, accuracy, derivatives)
    }

    /// As [`PotentialTable::of_function`], with given bricks.
    fn of_bricks(
        mut octree: Octree,
        channels: usize,
        accuracy: f64,
        derivatives: impl Fn(&Vec3) -> Vec<[f64; PER_NODE]>,
    ) -> Self {
        let size = octree.size(0);
        let unit: [f64; PER_NODE] =
            std::array::from_fn(|d| (0..3).map(|k| size[k].powi((d / 3_usize.pow(k as u32) % 3) as i32)).product());
        let mut known = HashMap::new();
        let mut nodes = Vec::new();
        let whole: Vec<usize> = octree.whole().map(|(number, _)| number).collect();
        for number in whole {
            let brick = octree.all()[number];
            let corners = std::array::from_fn(|c| {
                let new = known.len() as u32;
                *known.entry(brick.corner(c)).or_insert_with(|| {
                    let own = derivatives(&octree.point(&brick, [c & 1, c >> 1 & 1, c >> 2].map(|i| i as f64)));
                    nodes.extend(own.iter().flat_map(|own| own.iter().zip(&unit).map(|(x, u)| x * u)));
                    new
                })
            });
            let brick = octree.brick_mut(number);
            (brick.corners, brick.tabulated) = (corners, true);
        }
        Self { octree, channels, accuracy, smooth: accuracy <= SMOOTH, nodes }
    }

    /// Whether there are as many numbers as the bricks have nodes; a table that was read from somewhere may lie.
    pub fn is_whole(&self) -> bool {
        let per_node = self.channels.checked_mul(PER_NODE);
        let nodes = match per_node {
            Some(0) | None => return self.nodes.is_empty() && per_node.is_some() && self.octree.is_whole(usize::MAX),
            Some(n) => self.nodes.len().is_multiple_of(n).then_some(self.nodes.len() / n),
        };
        nodes.is_some_and(|n| self.octree.is_whole(n))
    }

    /// The grid of the coarsest bricks.
    pub fn grid(&self) -> &Grid {
        self.octree.grid()
    }

    /// Whether a point lies in a brick that is interpolated.
    pub fn covers(&self, point: &Vec3) -> bool {
        self.octree.locate(point).is_some_and(|(number, _)| self.octree.all()[number].tabulated)
    }

    /// Interpolates all bricks whose corners are known, whatever their error.
    pub fn tabulate_all(&mut self) {
        for number in 0..self.octree.all().len() {
            let brick = self.octree.brick_mut(number);
            brick.tabulated = brick.is_filled();
        }
    }

    /// Bytes of the table.
    pub fn bytes(&self) -> u64 {
        size_of_val(self.nodes.as_slice()) as u64
    }

    /// Bytes that [`tabulate`] takes at its peak for a grid of bricks, and flights after it: what nodes hold, a third more for what
    /// is computed but not yet stored, and splines of all functions.
    pub fn bytes_while_filling(bricks: &Grid, functions: usize, accuracy: f64, smooth: bool) -> u64 {
        let nodes = (8 * PER_NODE as u64 * functions as u64).saturating_mul(bricks.nodes() as u64);
        let bricks = bricks.cells.iter().fold(1, |n: usize, c| n.saturating_mul(*c));
        let splines = Kernel::bytes_for(accuracy, smooth || accuracy <= SMOOTH, bricks, functions);
        (nodes / 3).saturating_mul(4).saturating_add(splines)
    }

    /// The grid of bricks whose cells are of about that size, m.
    pub fn bricks_for(min: Vec3, max: Vec3, spacing: f64) -> Grid {
        Grid::new(min, max, CELLS_PER_BRICK as f64 * spacing)
    }
}

/// Accuracy of the field from which on splines are of degree five: they take two and a half times as long and as much memory, and
/// where this much is asked cubic ones would need more than that many more bricks.
pub const SMOOTH: f64 = 3e-5;

/// A table with the exact sum for what it does not cover.
pub struct TabulatedField {
    kernel: Kernel,
    smooth: bool,
    /// The same channels exactly, sources included.
    pub exact: Arc<PanelSum>,
}

impl TabulatedField {
    /// A table of all basis functions, combined to channels: channel c is Σ_k `weights[c][k]` times basis function k.
    pub fn combined(basis: &ElectrodeBasis, table: &PotentialTable, weights: &[Vec<f64>]) -> Self {
        Self::new(table, weights, Arc::new(basis.combined(weights)))
    }

    /// A table's functions combined to channels, with what is exact for the same channels.
    pub fn new(table: &PotentialTable, weights: &[Vec<f64>], exact: Arc<PanelSum>) -> Self {
        Self { kernel: Kernel::new(table, weights), smooth: table.smooth, exact }
    }

    /// Bytes of the splines.
    pub fn bytes(&self) -> u64 {
        self.kernel.bytes()
    }

    /// Points above the grounded plane. A brick that the plane cuts holds what goes on smoothly below it; there is no field there.
    fn above_ground(&self, points: &[Vec3]) -> Option<Vec<usize>> {
        if !self.exact.is_grounded() || !points.iter().any(|p| self.exact.below_ground(p)) {
            return None;
        }
        Some((0..points.len()).filter(|p| !self.exact.below_ground(&points[*p])).collect())
    }
}

impl BasisField for TabulatedField {
    fn channels(&self) -> usize {
        self.kernel.channels()
    }

    fn is_rough(&self) -> bool {
        !self.smooth
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.channels();
        samples.reset(points.len(), n);
        if let Some(above) = self.above_ground(points) {
            let places: Vec<Vec3> = above.iter().map(|&p| points[p]).collect();
            let mut own = Samples::default();
            self.sample(&places, &mut own);
            scatter(&own, &above, n, samples);
            return;
        }
        let mut left = Vec::new();
        self.kernel.channels_at(points, &mut samples.potential, &mut samples.gradient, &mut left);
        if self.exact.has_sources() {
            let mut exact = left.iter().peekable();
            for (p, point) in points.iter().enumerate() {
                if exact.next_if_eq(&&p).is_none() {
                    let potential = &mut samples.potential[p * n..(p + 1) * n];
                    self.exact.add_sources(point, potential, &mut samples.gradient[p * n..(p + 1) * n]);
                }
            }
        }
        if left.is_empty() {
            return;
        }
        let places: Vec<Vec3> = left.iter().map(|&p| points[p]).collect();
        let mut exact = Samples::default();
        self.exact.sample(&places, &mut exact);
        scatter(&exact, &left, n, samples);
    }

    fn sum(
        &self,
        points: &[Vec3],
        factors: &[f64],
        scratch: &mut Samples,
        potential: &mut [f64],
        gradient: &mut [Vec3],
    ) {
        if self.exact.has_sources() || self.exact.is_grounded() {
            self.sample(points, scratch);
            scratch.sum(factors, potential, gradient);
            return;
        }
        let mut left = Vec::new();
        self.kernel.sum_at(points, factors, potential, gradient, &mut left);
        if left.is_empty() {
            return;
        }
        let n = self.channels();
        let places: Vec<Vec3> = left.iter().map(|&p| points[p]).collect();
        self.exact.sample(&places, scratch);
        for (k, p) in left.into_iter().enumerate() {
            let own = k * n..(k + 1) * n;
            (potential[p], gradient[p]) = scratch.sum_of(own, &factors[p * n..(p + 1) * n]);
        }
    }
}

/// Puts what was sampled at some of the points in its place.
fn scatter(own: &Samples, points: &[usize], channels: usize, all: &mut Samples) {
    let n = channels;
    for (k, p) in points.iter().enumerate() {
        all.potential[p * n..(p + 1) * n].copy_from_slice(&own.potential[k * n..(k + 1) * n]);
        all.gradient[p * n..(p + 1) * n].copy_from_slice(&own.gradient[k * n..(k + 1) * n]);
    }
}
