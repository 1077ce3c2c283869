//! What is evaluated: cubic B-splines on 4 x 4 x 4 cells in each brick.
//!
//! *Why splines:* a point needs 4³ numbers of a channel against the 216 of the brick's polynomial, and each brick has them side by
//! side. The coefficients follow from the polynomial, so that what is stored and filled stays as coarse as a field of degree
//! five may be: where its error is 1e-4 at a distance of three and a half bricks from a conductor, that of splines on a quarter
//! of its size is as large.
//!
//! *Continuity:* bricks of one size share their coefficients, and potential, field and field gradient are continuous. A
//! coefficient whose spline reaches into a larger brick follows from the larger one's splines by the two-scale relation
//! B(x) = Σ_k 2^-3 C(4, k) B(2 x - k + 2), so that the same holds between bricks of different size. Checked by
//! `bricks_join_smoothly`.

use rayon::prelude::*;

use super::PotentialTable;
use super::hermite::{PER_NODE, basis, gather};
use super::octree::{Brick, NONE, Octree};

/// Cells of a spline along the edge of a brick.
pub(super) const CELLS: usize = 4;

/// Coefficients along the edge of a brick: those at its five nodes and one beyond each end.
pub(super) const EDGE: usize = CELLS + 3;

/// Rows of a brick: entry `y + 7 z`.
pub(super) const ROWS: usize = EDGE * EDGE;

/// For each place along an axis the neighbours (0 to 2) that hold its node, and the place that it has in them.
const HOLDING: [&[(usize, usize)]; EDGE] =
    [&[(0, 4)], &[(0, 5), (1, 1)], &[(1, 2)], &[(1, 3)], &[(1, 4)], &[(1, 5), (2, 1)], &[(2, 2)]];

/// The same with those that have the node one beyond their end.
const HOLDING_OR_BESIDE: [&[(usize, usize)]; EDGE] = [
    &[(0, 4), (1, 0)],
    &[(0, 5), (1, 1)],
    &[(0, 6), (1, 2)],
    &[(1, 3)],
    &[(1, 4), (2, 0)],
    &[(1, 5), (2, 1)],
    &[(1, 6), (2, 2)],
];

/// Coefficients along x, the last of eight always zero: a line of memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Row(pub [f64; 8]);

/// Splines of all interpolated bricks.
pub(super) struct Splines {
    /// Number of channels.
    pub channels: usize,
    /// Where each brick's numbers are, in bricks; [`NONE`] for bricks that are not interpolated.
    pub slots: Vec<u32>,
    /// Coefficients: entry `(slot * channels + channel) * 49 + y + 7 z`.
    pub rows: Vec<Row>,
}

impl Splines {
    /// Bytes of the splines of so many bricks and channels.
    pub fn bytes_for(bricks: usize, channels: usize) -> u64 {
        (size_of::<[Row; ROWS]>() as u64 * channels as u64).saturating_mul(bricks as u64)
    }

    /// The splines of combinations of a table's functions: channel c is Σ_k `weights[c][k]` times function k.
    pub fn new(table: &PotentialTable, weights: &[Vec<f64>]) -> Self {
        let octree = &table.octree;
        let kept: Vec<usize> = octree.whole().filter(|(_, brick)| brick.tabulated).map(|(n, _)| n).collect();
        let mut slots = vec![NONE; octree.all().len()];
        kept.iter().enumerate().for_each(|(slot, &n)| slots[n] = slot as u32);
        let channels = weights.len();
        let mut splines = Self { channels, slots, rows: Vec::new() };
        let per_brick = channels * ROWS;
        if per_brick == 0 {
            return splines;
        }
        let nodes = combined(table, weights);
        let mut own = vec![Row::default(); kept.len() * per_brick];
        let prefilter = prefilter();
        own.par_chunks_mut(per_brick).zip(&kept).for_each(|(rows, &number)| {
            let brick = &octree.all()[number];
            for (channel, rows) in rows.chunks_exact_mut(ROWS).enumerate() {
                let corners: [&[f64]; 8] = std::array::from_fn(|c| {
                    let first = (brick.corners[c] as usize * channels + channel) * PER_NODE;
                    &nodes[first..first + PER_NODE]
                });
                let size = 0.5_f64.powi(i32::from(brick.level));
                coefficients(&gather(&corners, size), &prefilter, rows);
            }
        });
        let mut shared = vec![Row::default(); own.len()];
        shared.par_chunks_mut(per_brick).zip(&kept).for_each(|(rows, &number)| {
            splines.share(octree, &octree.all()[number], &own, rows);
        });
        splines.rows = shared;
        splines.follow_larger(octree, &kept);
        splines
    }

    /// The mean of what all bricks of one size have for a coefficient: of those that hold its node if there are any, else of
    /// those beside it.
    fn share(&self, octree: &Octree, brick: &Brick, own: &[Row], rows: &mut [Row]) {
        let slots = octree.around(brick).map(|neighbour| {
            neighbour.filter(|n| octree.all()[*n].level == brick.level).map_or(NONE, |n| self.slots[n])
        });
        for (row, at) in (0..ROWS).map(|row| (row, [row % EDGE, row / EDGE])) {
            for x in 0..EDGE {
                let at = [x, at[0], at[1]];
                for channel in 0..self.channels {
                    let mean = |of: &[&[(usize, usize)]; EDGE]| {
                        let (mut sum, mut count) = (0.0, 0.0);
                        for (oz, k) in of[at[2]] {
                            for (oy, j) in of[at[1]] {
                                for (ox, i) in of[at[0]] {
                                    let slot = slots[ox + 3 * oy + 9 * oz];
                                    if slot != NONE {
                                        let brick = (slot as usize * self.channels + channel) * ROWS;
                                        sum += own[brick + j + EDGE * k].0[*i];
                                        count += 1.0;
                                    }
                                }
                            }
                        }
                        (count > 0.0).then(|| sum / count)
                    };
                    let value = mean(&HOLDING).or_else(|| mean(&HOLDING_OR_BESIDE));
                    rows[channel * ROWS + row].0[x] = value.unwrap_or(0.0);
                }
            }
        }
    }

    /// Coefficients that reach into larger bricks, from those of the larger ones: large bricks first.
    fn follow_larger(&mut self, octree: &Octree, kept: &[usize]) {
        let levels = kept.iter().map(|n| octree.all()[*n].level).max().unwrap_or(0);
        for level in 1..=levels {
            let followed: Vec<(usize, usize, f64)> = kept
                .par_iter()
                .filter(|n| octree.all()[**n].level == level)
                .flat_map_iter(|&number| self.followed(octree, number))
                .collect();
            for (row, x, value) in followed {
                self.rows[row].0[x] = value;
            }
        }
    }

    /// For one brick: row, place in it and value of coefficients that follow a larger brick.
    fn followed(&self, octree: &Octree, number: usize) -> Vec<(usize, usize, f64)> {
        let brick = &octree.all()[number];
        let larger = octree
            .around(brick)
            .map(|neighbour| neighbour.filter(|n| octree.all()[*n].level < brick.level && self.slots[*n] != NONE));
        let mut followed = Vec::new();
        if larger.iter().all(Option::is_none) {
            return followed;
        }
        // A spline reaches two cells to both sides of its node, which stands at i - 1.
        let reached = |i: usize| {
            if i < 3 {
                0..2
            } else if i == 3 {
                1..2
            } else {
                1..3
            }
        };
        for z in 0..EDGE {
            for y in 0..EDGE {
                for x in 0..EDGE {
                    let found = reached(z)
                        .flat_map(|oz| reached(y).map(move |oy| 3 * oy + 9 * oz))
                        .flat_map(|o| reached(x).map(move |ox| ox + o))
                        .find_map(|o| larger[o]);
                    let Some(found) = found else { continue };
                    let other = &octree.all()[found];
                    // Weights of three places of the larger brick from `first` on, along each axis.
                    let at = [x, y, z];
                    let two_scale: [(usize, [f64; 3]); 3] = std::array::from_fn(|k| {
                        let node = i64::from(brick.at[k]) * CELLS as i64 + at[k] as i64 - 1;
                        let place = node.div_euclid(2) - i64::from(other.at[k]) * CELLS as i64;
                        match node.rem_euclid(2) {
                            0 => (place as usize, [0.125, 0.75, 0.125]),
                            _ if place < 0 => (0, [0.5, 0.5, 0.0]),
                            _ => (place as usize, [0.0, 0.5, 0.5]),
                        }
                    });
                    for channel in 0..self.channels {
                        let rows = (self.slots[found] as usize * self.channels + channel) * ROWS;
                        let [(i, wx), (j, wy), (k, wz)] = two_scale;
                        let mut value = 0.0;
                        for (c, wz) in wz.iter().enumerate() {
                            for (b, wy) in wy.iter().enumerate() {
                                let row = &self.rows[rows + (j + b) + EDGE * (k + c)].0;
                                value += wz * wy * (0..3).map(|a| wx[a] * row[i + a]).sum::<f64>();
                            }
                        }
                        let row = (self.slots[number] as usize * self.channels + channel) * ROWS + y + EDGE * z;
                        followed.push((row, x, value));
                    }
                }
            }
        }
        followed
    }
}

/// What the nodes hold of combinations of functions: entry `(node * channels + channel) * 27 + derivative`.
fn combined(table: &PotentialTable, weights: &[Vec<f64>]) -> Vec<f64> {
    let per_node = table.channels * PER_NODE;
    let mut nodes = vec![0.0; table.nodes.len() / per_node.max(1) * weights.len() * PER_NODE];
    nodes.par_chunks_mut(weights.len() * PER_NODE).zip(table.nodes.par_chunks(per_node)).for_each(|(new, old)| {
        for (new, row) in new.chunks_exact_mut(PER_NODE).zip(weights) {
            for (old, w) in old.chunks_exact(PER_NODE).zip(row).filter(|(_, w)| **w != 0.0) {
                new.iter_mut().zip(old).for_each(|(n, o)| *n += w * o);
            }
        }
    });
    nodes
}

/// Coefficients along one axis from the six numbers of a polynomial of degree five: c = f - δ² f''/6 + δ⁴ f''''/72, the inverse of
/// what the spline's values at its nodes are, (c₋₁ + 4 c₀ + c₁)/6 = c + δ² c''/6 + δ⁴ c''''/72 + ..., exact for degree five.
fn prefilter() -> [[f64; 6]; EDGE] {
    let cell = 1.0 / CELLS as f64;
    std::array::from_fn(|i| {
        let t = (i as f64 - 1.0) * cell;
        let [value, second, fourth] = [0, 2, 4].map(|order| basis(t, order));
        std::array::from_fn(|k| value[k] - cell.powi(2) / 6.0 * second[k] + cell.powi(4) / 72.0 * fourth[k])
    })
}

/// All coefficients of a brick from its polynomial alone, axis by axis.
fn coefficients(corners: &[f64; 216], prefilter: &[[f64; 6]; EDGE], rows: &mut [Row]) {
    let mut along_x = [[0.0; 8]; 36];
    for (row, corners) in along_x.iter_mut().zip(corners.chunks_exact(6)) {
        for (x, weights) in row.iter_mut().zip(prefilter) {
            *x = (0..6).map(|a| weights[a] * corners[a]).sum();
        }
    }
    let mut along_y = [[0.0; 8]; 6 * EDGE];
    for c in 0..6 {
        for (j, weights) in prefilter.iter().enumerate() {
            let row = &mut along_y[c * EDGE + j];
            for (b, w) in weights.iter().enumerate() {
                row.iter_mut().zip(&along_x[6 * c + b]).for_each(|(sum, x)| *sum += w * x);
            }
        }
    }
    for (k, weights) in prefilter.iter().enumerate() {
        for j in 0..EDGE {
            let row = &mut rows[j + EDGE * k].0;
            *row = [0.0; 8];
            for (c, w) in weights.iter().enumerate() {
                row.iter_mut().zip(&along_y[c * EDGE + j]).for_each(|(sum, x)| *sum += w * x);
            }
        }
    }
}
