//! Filling a table: potentials and their derivatives at nodes, from expansions that are handed down a tree of boxes.
//!
//! The box of all nodes is halved again and again; parts without nodes are forgotten. A panel that is far from a box (against the box's size) joins the box's
//! expansion and is done with; a near one is handed on to the box's parts. Expansions are moved to the parts' centres. What
//! reaches a box of four cells is evaluated at its nodes by one matrix for all such boxes. Near conductors boxes shrink to two
//! cells, whose nodes sum over the last near panels themselves, cut into pieces small against their distance.

use faer::{Mat, MatRef, Par};
use meshes::Vec3;
use pulp::Arch;
use rayon::prelude::*;

use super::grid::Grid;
use super::hermite::PER_NODE;
use crate::ElectrodeBasis;
use crate::gather::Gather;
use crate::harmonics::{coefficients, derivative_weights, translation};
use crate::pieces::{Piece, Pieces};

/// A panel is far from a box when its nearest point is farther from the centre than this many times the box's radius. Of
/// an expansion of degree p it leaves out (1/2.2)^(p + 1).
const FAR: f64 = 2.2;

/// Cells along the edge of the boxes that are evaluated by matrix.
const LEAF: usize = 4;

/// The same for boxes with near panels. (With 1 every node has an expansion of its own, of a degree it does not need: in the
/// table of two thin rings that took ten times as long.)
const SMALLEST: usize = 2;

/// Highest order of derivative at a node, ∂_x² ∂_y² ∂_z².
const NODE_DEGREE: usize = 6;

/// A piece of a panel counts as a sum of points of a rule when it is at most this large against its distance.
const LARGEST_PIECE: f64 = 1.0 / 3.0;

/// Degree of the rule for a piece of that size against its distance whose error, (size/distance)^(degree + 1), stays below a
/// thousandth of the accuracy asked of the field.
fn rule_degree(ratio: f64, accuracy: f64) -> usize {
    (((1e-3 * accuracy).ln() / ratio.max(1e-6).ln()) as usize).clamp(2, 18)
}

/// Degree of expansion that keeps the relative accuracy asked of the field: a hundredth of it for the nearest panels.
fn degree_for(accuracy: f64) -> usize {
    (((0.01 * accuracy).ln() / (1.0 / FAR).ln()).ceil() as usize).clamp(8, 20)
}

/// What all boxes share.
struct Filler<'a> {
    grid: Grid,
    nodes: &'a [[usize; 3]],
    pieces: Pieces<'a>,
    functions: usize,
    /// Asked of the field, relative.
    accuracy: f64,
    degree: usize,
    /// Moves an expansion from a box to each of its eight parts.
    handed_down: Vec<Mat<f64>>,
    /// For boxes of 4 and 2 cells: derivatives (rows, node by node) at all their (edge + 1)³ nodes.
    derivatives: Vec<Mat<f64>>,
    /// Weights of derivatives at the centre of an expansion of degree six.
    at_node: Vec<Vec<f64>>,
    arch: Arch,
}

/// A box on the way down: what is far from it is in its expansion.
struct Branch {
    cube: Cube,
    near: Vec<Piece>,
    expansion: Mat<f64>,
    /// The numbers of its nodes: those within and on its lower faces.
    nodes: Vec<u32>,
}

/// A box of cells.
#[derive(Clone, Copy)]
struct Cube {
    first: [usize; 3],
    edge: usize,
}

/// Derivatives at some nodes: node numbers, and `PER_NODE * functions` numbers for each.
type Filled = Vec<(u32, Vec<f64>)>;

/// Potentials and derivatives of every basis function at given nodes of a grid, in units of its cells: entry
/// `(n * functions + function) * 27 + a + 3 b + 9 c` for the n-th of `nodes`. Sources contribute what they induce on the electrodes,
/// not their own field. `accuracy` is that of the field, relative; what is left out here is far below it. `progress` is told
/// the fraction done.
pub(super) fn fill(
    basis: &ElectrodeBasis,
    grid: Grid,
    nodes: &[[usize; 3]],
    accuracy: f64,
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<f64> {
    let functions = basis.functions();
    let per_node = PER_NODE * functions;
    let mut all = vec![0.0; nodes.len() * per_node];
    let filler = Filler::new(basis, grid, nodes, accuracy);
    // A box owns no nodes on its upper faces, and the outermost one has all.
    let mut edge = LEAF;
    while edge <= *grid.cells.iter().max().unwrap_or(&LEAF) {
        edge *= 2;
    }
    // Down to boxes of 16 cells one after the other, those in parallel: enough of them to keep all threads busy.
    let mut queue = vec![Branch {
        cube: Cube { first: [0; 3], edge },
        near: filler.pieces.all(),
        expansion: Mat::zeros(coefficients(filler.degree), functions),
        nodes: (0..nodes.len() as u32).collect(),
    }];
    while queue.first().is_some_and(|branch| branch.cube.edge > 4 * LEAF) {
        queue = queue.into_par_iter().flat_map_iter(|branch| filler.parts(&filler.take_far(branch))).collect();
    }
    let total = queue.len().max(1) as f64;
    let done = std::sync::atomic::AtomicUsize::new(0);
    // Groups of boxes, so that what has been computed but not yet stored stays small.
    let mut queue = queue.into_iter();
    loop {
        let group: Vec<Branch> = queue.by_ref().take(64).collect();
        if group.is_empty() {
            return all;
        }
        let filled: Vec<Filled> = group
            .into_par_iter()
            .map(|branch| {
                let mut leaves = Vec::new();
                filler.descend(branch, &mut leaves);
                let filled = filler.evaluate(leaves);
                let n = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(n as f64 / total);
                filled
            })
            .collect();
        for (node, values) in filled.into_iter().flatten() {
            let first = node as usize * per_node;
            all[first..first + per_node].copy_from_slice(&values);
        }
    }
}

impl<'a> Filler<'a> {
    fn new(basis: &'a ElectrodeBasis, grid: Grid, nodes: &'a [[usize; 3]], accuracy: f64) -> Self {
        let functions = basis.functions();
        let degree = degree_for(accuracy);
        let n = coefficients(degree);
        // In units of a box's radius: its edges, whatever its size.
        let unit = Cube { first: [0; 3], edge: 1 };
        let scaled = grid.spacing() / unit.radius(&grid);
        let orders = |k: usize| [k % 3, k / 3 % 3, k / 9];
        let handed_down = (0..8)
            .map(|part| {
                let side = |bit: usize| if part >> bit & 1 == 1 { 0.25 } else { -0.25 };
                let shift = Vec3::new(side(0) * scaled.x, side(1) * scaled.y, side(2) * scaled.z);
                let matrix = translation(&shift, 0.5, degree);
                Mat::from_fn(n, n, |i, j| matrix[i * n + j])
            })
            .collect();
        let derivatives = [LEAF, SMALLEST]
            .iter()
            .map(|&edge| {
                let width = edge + 1;
                let mut matrix = Mat::zeros(width * width * width * PER_NODE, n);
                for node in 0..width * width * width {
                    let index = [node % width, node / width % width, node / (width * width)];
                    let at = Vec3::from_fn(|k, _| (index[k] as f64 / edge as f64 - 0.5) * scaled[k]);
                    for derivative in 0..PER_NODE {
                        let order = orders(derivative);
                        // From derivatives per box radius to derivatives per cell.
                        let unit: f64 = (0..3).map(|k| (scaled[k] / edge as f64).powi(order[k] as i32)).product();
                        for (column, w) in derivative_weights(&at, degree, order).into_iter().enumerate() {
                            matrix[(node * PER_NODE + derivative, column)] = w * unit;
                        }
                    }
                }
                matrix
            })
            .collect();
        let at_node = (0..PER_NODE).map(|k| derivative_weights(&Vec3::zeros(), NODE_DEGREE, orders(k))).collect();
        let pieces = Pieces::new(basis);
        Self { grid, nodes, pieces, functions, accuracy, degree, handed_down, derivatives, at_node, arch: Arch::new() }
    }

    /// Adds far panels to the box's expansion and keeps the near ones, those as large as the box cut into pieces.
    fn take_far(&self, branch: Branch) -> Branch {
        let Branch { cube, near: mut pending, mut expansion, nodes } = branch;
        let (center, radius) = (cube.center(&self.grid), cube.radius(&self.grid));
        let mut gather = Gather::new(self.functions);
        let mut left = Vec::new();
        while let Some(piece) = pending.pop() {
            let distance = (piece.center - center).norm();
            let far = distance - piece.radius > FAR * radius;
            let ratio = piece.radius / (distance - radius).max(f64::MIN_POSITIVE);
            if far && ratio <= LARGEST_PIECE {
                let reach = (distance - radius).max(f64::MIN_POSITIVE);
                let degree = |size: f64| rule_degree(size / reach, self.accuracy);
                self.pieces.points(&piece, &degree, &mut |y, charges| {
                    gather.push(&((y - center) / radius), 1.0 / radius, charges);
                });
            } else if far || piece.radius > radius {
                pending.extend(self.pieces.parts(&piece));
            } else {
                left.push(piece);
            }
        }
        if !gather.is_empty() {
            let n = coefficients(self.degree);
            let mut sums = vec![0.0; n * self.functions];
            gather.flush(self.arch, self.degree, &mut sums);
            for (k, sum) in sums.chunks_exact(n).enumerate() {
                for (i, s) in sum.iter().enumerate() {
                    expansion[(i, k)] += s;
                }
            }
        }
        Branch { cube, near: left, expansion, nodes }
    }

    /// The parts of a box that hold nodes, with what is handed down to them.
    fn parts(&self, branch: &Branch) -> Vec<Branch> {
        let (first, half) = (branch.cube.first, branch.cube.edge / 2);
        let mut nodes: [Vec<u32>; 8] = Default::default();
        for &node in &branch.nodes {
            let at = self.nodes[node as usize];
            nodes[(0..3).map(|k| usize::from(at[k] >= first[k] + half) << k).sum::<usize>()].push(node);
        }
        let parts = nodes.into_iter().enumerate().filter(|(_, nodes)| !nodes.is_empty());
        parts
            .map(|(part, nodes)| Branch {
                cube: Cube { first: std::array::from_fn(|k| first[k] + (part >> k & 1) * half), edge: half },
                near: branch.near.clone(),
                expansion: product(self.handed_down[part].as_ref(), branch.expansion.as_ref()),
                nodes,
            })
            .collect()
    }

    fn descend(&self, branch: Branch, leaves: &mut Vec<Branch>) {
        let branch = self.take_far(branch);
        let edge = branch.cube.edge;
        if edge > LEAF || (edge > SMALLEST && !branch.near.is_empty()) {
            for part in self.parts(&branch) {
                self.descend(part, leaves);
            }
        } else {
            leaves.push(branch);
        }
    }

    /// Derivatives at the nodes of some leaves; leaves of one size share one product of matrices.
    fn evaluate(&self, leaves: Vec<Branch>) -> Filled {
        let mut filled = Filled::new();
        for (matrix, edge) in self.derivatives.iter().zip([LEAF, SMALLEST]) {
            let same: Vec<&Branch> = leaves.iter().filter(|leaf| leaf.cube.edge == edge).collect();
            let k = self.functions;
            let expansions =
                Mat::from_fn(coefficients(self.degree), same.len() * k, |i, c| same[c / k].expansion[(i, c % k)]);
            let all = product(matrix.as_ref(), expansions.as_ref());
            let width = edge + 1;
            for (number, leaf) in same.into_iter().enumerate() {
                for &node in &leaf.nodes {
                    let index = self.nodes[node as usize];
                    let local: [usize; 3] = std::array::from_fn(|i| index[i] - leaf.cube.first[i]);
                    let row = (local[0] + width * (local[1] + width * local[2])) * PER_NODE;
                    let mut values = Vec::with_capacity(k * PER_NODE);
                    for function in 0..k {
                        values.extend((0..PER_NODE).map(|d| all[(row + d, number * k + function)]));
                    }
                    if !leaf.near.is_empty() {
                        self.add_near(index, &leaf.near, &mut values);
                    }
                    filled.push((node, values));
                }
            }
        }
        filled
    }

    /// Adds near panels to one node's derivatives.
    fn add_near(&self, index: [usize; 3], near: &[Piece], values: &mut [f64]) {
        let node = self.grid.point(index.map(|i| i as f64));
        let spacing = self.grid.spacing();
        let length = spacing.max();
        let mut gather = Gather::new(self.functions);
        let mut pending = near.to_vec();
        while let Some(piece) = pending.pop() {
            let distance = (piece.center - node).norm().max(f64::MIN_POSITIVE);
            let ratio = piece.radius / distance;
            if ratio > LARGEST_PIECE {
                pending.extend(self.pieces.parts(&piece));
                continue;
            }
            let degree = |size: f64| rule_degree(size / distance, self.accuracy);
            self.pieces.points(&piece, &degree, &mut |y, charges| {
                gather.push(&((y - node) / length), 1.0 / length, charges);
            });
        }
        let n = coefficients(NODE_DEGREE);
        let mut sums = vec![0.0; n * self.functions];
        gather.flush(self.arch, NODE_DEGREE, &mut sums);
        for (k, sum) in sums.chunks_exact(n).enumerate() {
            for (d, weights) in self.at_node.iter().enumerate() {
                let order = [d % 3, d / 3 % 3, d / 9];
                let unit: f64 = (0..3).map(|i| (spacing[i] / length).powi(order[i] as i32)).product();
                let derivative: f64 = weights.iter().zip(sum).map(|(w, l)| w * l).sum();
                values[k * PER_NODE + d] += derivative * unit;
            }
        }
    }
}

impl Cube {
    fn center(&self, grid: &Grid) -> Vec3 {
        grid.point(self.first.map(|i| i as f64 + 0.5 * self.edge as f64))
    }

    fn radius(&self, grid: &Grid) -> f64 {
        0.5 * self.edge as f64 * grid.spacing().norm()
    }
}

/// A B on the calling thread.
fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut c = Mat::zeros(a.nrows(), b.ncols());
    faer::linalg::matmul::matmul(c.as_mut(), faer::Accum::Replace, a, b, 1.0, Par::Seq);
    c
}
