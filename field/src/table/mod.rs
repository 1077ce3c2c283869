//! The tabulated potential: unit potentials on a grid, interpolated.
//!
//! A table covers a box with cells of one size. Cells next to a conductor, where no polynomial can follow the field, are left
//! to the exact panel sum, and so is everything outside the box: nothing is extrapolated. How thick that layer must be follows
//! from the error, measured at points between the nodes.

mod fill;
mod grid;
mod hermite;
mod tabulate;

use std::sync::Arc;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

pub use grid::Grid;
pub use hermite::PER_NODE;
pub use tabulate::{TableError, TableOptions, TableReport, starting_spacing, tabulate, tabulate_around, tabulate_from};

use crate::panel_sum::PanelSum;
use crate::{BasisField, ElectrodeBasis, Samples};

/// Potentials of channels on a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PotentialTable {
    /// The grid.
    pub grid: Grid,
    /// Number of channels.
    pub channels: usize,
    /// Potential and derivatives at the nodes, in units of cells: entry `(node * channels + channel) * 27 + a + 3 b + 9 c`
    /// is ∂_x^a ∂_y^b ∂_z^c. Zero at nodes that no tabulated cell uses.
    pub nodes: Vec<f64>,
    /// Cells that are interpolated; the others are left to the panel sum.
    pub tabulated: Vec<bool>,
}

impl PotentialTable {
    /// Whether there are as many numbers as the grid has nodes and cells; a table that was read from somewhere may lie.
    pub fn is_whole(&self) -> bool {
        let product = |counts: [usize; 3]| counts.into_iter().try_fold(1_usize, usize::checked_mul);
        let nodes = self.grid.cells.iter().all(|c| *c < usize::MAX).then(|| self.grid.cells.map(|c| c + 1));
        let numbers = nodes.and_then(product).and_then(|n| n.checked_mul(self.channels)?.checked_mul(PER_NODE));
        self.grid.cells.iter().all(|c| *c > 0)
            && numbers == Some(self.nodes.len())
            && product(self.grid.cells) == Some(self.tabulated.len())
    }

    /// Bytes of the table.
    pub fn bytes(&self) -> u64 {
        Self::bytes_for(self.grid.nodes(), self.channels)
    }

    /// Bytes of a table of so many nodes and channels.
    pub fn bytes_for(nodes: usize, channels: usize) -> u64 {
        (8 * PER_NODE as u64 * channels as u64).saturating_mul(nodes as u64)
    }

    /// Bytes that [`tabulate`] takes at its peak: a third more for distances, marks and what is computed but not yet stored.
    pub fn bytes_while_filling(nodes: usize, functions: usize) -> u64 {
        (Self::bytes_for(nodes, functions) / 3).saturating_mul(4)
    }

    /// The table of combinations of channels: channel c of the answer is Σ_k `weights[c][k]` times channel k.
    pub fn combined(&self, weights: &[Vec<f64>]) -> Self {
        let old = self.channels;
        let nodes = (0..self.grid.nodes())
            .flat_map(|node| weights.iter().map(move |row| (node, row)))
            .flat_map(|(node, row)| {
                (0..PER_NODE).map(move |d| {
                    row.iter().enumerate().map(|(k, w)| w * self.nodes[(node * old + k) * PER_NODE + d]).sum()
                })
            })
            .collect();
        Self { grid: self.grid, channels: weights.len(), nodes, tabulated: self.tabulated.clone() }
    }

    /// Adds potential and gradient of every channel at a point; `false` where the point is not in a tabulated cell.
    pub fn add(&self, point: &Vec3, potential: &mut [f64], gradient: &mut [Vec3]) -> bool {
        let Some((cell, part)) = self.grid.locate(point) else { return false };
        if !self.tabulated[self.grid.cell(cell)] {
            return false;
        }
        let spacing = self.grid.spacing();
        let corners: [usize; 8] =
            std::array::from_fn(|c| self.grid.node([cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)]));
        for channel in 0..self.channels {
            let data: [&[f64]; 8] = std::array::from_fn(|c| {
                let first = (corners[c] * self.channels + channel) * PER_NODE;
                &self.nodes[first..first + PER_NODE]
            });
            let (value, slope) = hermite::interpolate(&data, part);
            potential[channel] += value;
            gradient[channel] += Vec3::from(slope).component_div(&spacing);
        }
        true
    }
}

/// A table with the exact sum for what it does not cover.
pub struct TabulatedField {
    /// The table of what sits on panels.
    pub table: Arc<PotentialTable>,
    /// The same channels exactly, sources included.
    pub exact: Arc<PanelSum>,
}

impl TabulatedField {
    /// A table of all basis functions, combined to channels: channel c is Σ_k `weights[c][k]` times basis function k.
    pub fn combined(basis: &ElectrodeBasis, table: &PotentialTable, weights: &[Vec<f64>]) -> Self {
        Self { table: Arc::new(table.combined(weights)), exact: Arc::new(basis.combined(weights)) }
    }
}

impl BasisField for TabulatedField {
    fn channels(&self) -> usize {
        self.table.channels
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.table.channels;
        samples.reset(points.len(), n);
        let mut left = Vec::new();
        for (p, point) in points.iter().enumerate() {
            // A cell that the grounded plane cuts holds what goes on smoothly below it; there is no field there.
            if self.exact.below_ground(point) {
                continue;
            }
            let potential = &mut samples.potential[p * n..(p + 1) * n];
            let gradient = &mut samples.gradient[p * n..(p + 1) * n];
            if self.table.add(point, potential, gradient) {
                self.exact.add_sources(point, potential, gradient);
            } else {
                left.push(p);
            }
        }
        if left.is_empty() {
            return;
        }
        let places: Vec<Vec3> = left.iter().map(|&p| points[p]).collect();
        let mut exact = Samples::default();
        self.exact.sample(&places, &mut exact);
        for (k, p) in left.into_iter().enumerate() {
            samples.potential[p * n..(p + 1) * n].copy_from_slice(&exact.potential[k * n..(k + 1) * n]);
            samples.gradient[p * n..(p + 1) * n].copy_from_slice(&exact.gradient[k * n..(k + 1) * n]);
        }
    }
}
