//! Filling a table: potentials and their derivatives at every node, from expansions that are handed down a tree of boxes.
//!
//! The box of all nodes is halved again and again. A panel that is far from a box (against the box's size) joins the box's
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
    needed: &'a [bool],
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

/// A box at the end of the tree: what far panels make in it, and the near ones.
struct Leaf {
    cube: Cube,
    expansion: Mat<f64>,
    near: Vec<Piece>,
}

/// A box of cells.
#[derive(Clone, Copy)]
struct Cube {
    first: [usize; 3],
    edge: usize,
}

/// Derivatives at some nodes: node numbers, and `PER_NODE * functions` numbers for each.
type Filled = Vec<(usize, Vec<f64>)>;

/// Potentials and derivatives of every basis function at every node marked as needed (zeros at the others), in units of
/// cells: entry `(node * functions + function) * 27 + a + 3 b + 9 c`. Sources contribute what they induce on the electrodes,
/// not their own field. `accuracy` is that of the field, relative; what is left out here is far below it. `progress` is told
/// the fraction done.
pub(super) fn fill(
    basis: &ElectrodeBasis,
    grid: Grid,
    needed: &[bool],
    accuracy: f64,
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<f64> {
    let functions = basis.functions();
    let per_node = PER_NODE * functions;
    let mut nodes = vec![0.0; grid.nodes() * per_node];
    let filler = Filler::new(basis, grid, needed, accuracy);
    let pieces = filler.pieces.all();
    let mut edge = LEAF;
    while edge < *grid.cells.iter().max().unwrap_or(&LEAF) {
        edge *= 2;
    }
    // Down to boxes of 16 cells one after the other, those in parallel: enough of them to keep all threads busy.
    let root = Cube { first: [0; 3], edge };
    let mut queue = vec![(root, pieces, Mat::zeros(coefficients(filler.degree), functions))];
    while queue.first().is_some_and(|(cube, ..)| cube.edge > 4 * LEAF) {
        queue = queue
            .into_par_iter()
            .flat_map_iter(|(cube, near, incoming)| {
                let (expansion, near) = filler.take_far(&cube, near, incoming);
                filler.parts(&cube, &near, &expansion)
            })
            .collect();
    }
    let total = queue.len().max(1) as f64;
    let done = std::sync::atomic::AtomicUsize::new(0);
    // Groups of boxes, so that what has been computed but not yet stored stays small.
    for group in queue.chunks(64) {
        let filled: Vec<Filled> = group
            .par_iter()
            .map(|(cube, near, incoming)| {
                let mut leaves = Vec::new();
                filler.descend(*cube, near.clone(), incoming.clone(), &mut leaves);
                let filled = filler.evaluate(leaves);
                let n = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                progress(n as f64 / total);
                filled
            })
            .collect();
        for (node, values) in filled.into_iter().flatten() {
            nodes[node * per_node..(node + 1) * per_node].copy_from_slice(&values);
        }
    }
    nodes
}

impl<'a> Filler<'a> {
    fn new(basis: &'a ElectrodeBasis, grid: Grid, needed: &'a [bool], accuracy: f64) -> Self {
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
        Self { grid, needed, pieces, functions, accuracy, degree, handed_down, derivatives, at_node, arch: Arch::new() }
    }

    /// Adds far panels to the box's expansion and returns the near ones, those as large as the box cut into pieces.
    fn take_far(&self, cube: &Cube, near: Vec<Piece>, mut expansion: Mat<f64>) -> (Mat<f64>, Vec<Piece>) {
        let (center, radius) = (cube.center(&self.grid), cube.radius(&self.grid));
        let mut gather = Gather::new(self.functions);
        let mut left = Vec::new();
        let mut pending = near;
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
        (expansion, left)
    }

    /// The eight parts of a box that hold nodes, with what is handed down to them.
    fn parts(&self, cube: &Cube, near: &[Piece], expansion: &Mat<f64>) -> Vec<(Cube, Vec<Piece>, Mat<f64>)> {
        let half = cube.edge / 2;
        (0..8)
            .filter_map(|part| {
                let first = std::array::from_fn(|k| cube.first[k] + (part >> k & 1) * half);
                let inside = (0..3).all(|k| first[k] < self.grid.cells[k]);
                let handed = || product(self.handed_down[part].as_ref(), expansion.as_ref());
                inside.then(|| (Cube { first, edge: half }, near.to_vec(), handed()))
            })
            .collect()
    }

    fn descend(&self, cube: Cube, near: Vec<Piece>, incoming: Mat<f64>, leaves: &mut Vec<Leaf>) {
        if self.nodes_of(&cube).is_empty() {
            return;
        }
        let (expansion, near) = self.take_far(&cube, near, incoming);
        if cube.edge > LEAF || (cube.edge > SMALLEST && !near.is_empty()) {
            for (part, near, expansion) in self.parts(&cube, &near, &expansion) {
                self.descend(part, near, expansion, leaves);
            }
        } else {
            leaves.push(Leaf { cube, expansion, near });
        }
    }

    /// Derivatives at the nodes of some leaves; leaves of one size share one product of matrices.
    fn evaluate(&self, leaves: Vec<Leaf>) -> Filled {
        let mut filled = Filled::new();
        for (matrix, edge) in self.derivatives.iter().zip([LEAF, SMALLEST]) {
            let same: Vec<&Leaf> = leaves.iter().filter(|leaf| leaf.cube.edge == edge).collect();
            let k = self.functions;
            let expansions =
                Mat::from_fn(coefficients(self.degree), same.len() * k, |i, c| same[c / k].expansion[(i, c % k)]);
            let all = product(matrix.as_ref(), expansions.as_ref());
            let width = edge + 1;
            for (number, leaf) in same.into_iter().enumerate() {
                for index in self.nodes_of(&leaf.cube) {
                    let local: [usize; 3] = std::array::from_fn(|i| index[i] - leaf.cube.first[i]);
                    let row = (local[0] + width * (local[1] + width * local[2])) * PER_NODE;
                    let mut values = Vec::with_capacity(k * PER_NODE);
                    for function in 0..k {
                        values.extend((0..PER_NODE).map(|d| all[(row + d, number * k + function)]));
                    }
                    if !leaf.near.is_empty() {
                        self.add_near(index, &leaf.near, &mut values);
                    }
                    filled.push((self.grid.node(index), values));
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

    /// The needed nodes that belong to a box: those on its lower faces and within, on its upper faces only where the table
    /// ends.
    fn nodes_of(&self, cube: &Cube) -> Vec<[usize; 3]> {
        let range = |k: usize| {
            let end = cube.first[k] + cube.edge;
            let last = if end >= self.grid.cells[k] { self.grid.cells[k] } else { end - 1 };
            cube.first[k]..=last
        };
        let mut nodes = Vec::new();
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    if self.needed[self.grid.node([x, y, z])] {
                        nodes.push([x, y, z]);
                    }
                }
            }
        }
        nodes
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
