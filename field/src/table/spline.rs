//! What is evaluated: B-splines on 4 x 4 x 4 cells in each brick, of degree three or five.
//!
//! *Why splines:* a point needs 4³ numbers of a channel (6³ for degree five) against the 216 of the brick's polynomial and 27 for
//! each node, and each brick has them side by side. The coefficients follow from the polynomial, so that what is stored and filled
//! stays as coarse as a field of degree five may be: where its error is 1e-4 at a distance of three and a half bricks from a
//! conductor, that of cubic splines on a quarter of its size is as large. Where more is asked splines of degree five lose nothing
//! against the polynomial.
//!
//! *Continuity:* bricks of one size share their coefficients; potential and field have as many continuous derivatives as the degree
//! allows (the field one, or three). A coefficient whose spline reaches into a larger brick follows from the larger one's splines
//! by the two-scale relation B(x) = Σ_k 2^-d C(d + 1, k) B(2 x - k + (d + 1)/2), so that the same holds between bricks of
//! different size. Checked by `bricks_join_smoothly`.

use rayon::prelude::*;

use super::PotentialTable;
use super::hermite::{PER_NODE, basis, gather};
use super::octree::{Brick, NONE, Octree};

/// Cells of a spline along the edge of a brick.
pub(super) const CELLS: usize = 4;

/// Of degree three: splines reach two cells to both sides of their node.
pub(super) const CUBIC: usize = 2;

/// Of degree five: they reach three cells.
pub(super) const QUINTIC: usize = 3;

/// Coefficients along the edge of a brick: those at its five nodes and those beyond each end that reach into it.
pub(super) const fn edge(reach: usize) -> usize {
    CELLS + 2 * reach - 1
}

/// Numbers of a row along x: coefficients and zeros, so many that whole vectors can be read from any cell on.
pub(super) const fn stride(reach: usize) -> usize {
    if reach == CUBIC { 8 } else { 12 }
}

/// Numbers of a brick: rows `y + edge z`.
pub(super) const fn per_brick(reach: usize) -> usize {
    edge(reach) * edge(reach) * stride(reach)
}

/// Splines of a function in all interpolated bricks.
pub(super) struct Splines {
    /// [`CUBIC`] or [`QUINTIC`].
    reach: usize,
    /// Coefficients: entry `slot * per_brick + x + stride (y + edge z)`.
    pub numbers: Vec<f64>,
}

/// Where each brick's numbers are, counted in bricks; [`NONE`] for bricks that are not interpolated.
pub(super) fn slots(octree: &Octree) -> Vec<u32> {
    let mut slots = vec![NONE; octree.all().len()];
    for (slot, (number, _)) in kept(octree).enumerate() {
        slots[number] = slot as u32;
    }
    slots
}

/// Interpolated bricks, with their numbers.
fn kept(octree: &Octree) -> impl Iterator<Item = (usize, &Brick)> {
    octree.whole().filter(|(_, brick)| brick.tabulated)
}

/// Neighbours along an axis, from -2 to 2 bricks away, and the places that a node has in them.
type Candidates = Vec<(usize, usize)>;

impl Splines {
    /// Bytes that are needed while splines are made of so many bricks.
    pub fn bytes_for(reach: usize, bricks: usize) -> u64 {
        (2 * 8 * per_brick(reach) as u64).saturating_mul(bricks as u64)
    }

    /// The splines of a combination of a table's functions, Σ_k `weights[k]` times function k, where `slots` are those of its
    /// bricks.
    pub fn new(table: &PotentialTable, reach: usize, slots: &[u32], weights: &[f64]) -> Self {
        let octree = &table.octree;
        let kept: Vec<usize> = kept(octree).map(|(number, _)| number).collect();
        let per_brick = per_brick(reach);
        let mut own = vec![0.0; kept.len() * per_brick];
        let nodes = combined(table, weights);
        let prefilter = prefilter(reach);
        own.par_chunks_mut(per_brick).zip(&kept).for_each(|(numbers, &number)| {
            let brick = &octree.all()[number];
            let corners: [&[f64]; 8] = std::array::from_fn(|c| {
                let first = brick.corners[c] as usize * PER_NODE;
                &nodes[first..first + PER_NODE]
            });
            let size = 0.5_f64.powi(i32::from(brick.level));
            coefficients(&gather(&corners, size), &prefilter, reach, numbers);
        });
        let candidates: Vec<(Candidates, Candidates)> = (0..edge(reach)).map(|i| candidates(reach, i)).collect();
        let mut splines = Self { reach, numbers: vec![0.0; own.len()] };
        let steps = splines.steps();
        splines.numbers.par_chunks_mut(per_brick).zip(&kept).for_each(|(numbers, &number)| {
            let brick = &octree.all()[number];
            let alike = |n: &usize| octree.all()[*n].level == brick.level;
            let around = octree.around(brick, steps).into_iter();
            let around: Vec<u32> = around.map(|n| n.filter(alike).map_or(NONE, |n| slots[n])).collect();
            share(reach, &around, &own, &candidates, numbers);
        });
        splines.follow_larger(octree, slots, &kept);
        splines
    }

    /// Neighbours in steps of bricks that a brick's coefficients depend on.
    fn steps(&self) -> usize {
        self.reach - 1
    }

    /// Coefficients that reach into larger bricks, from those of the larger ones: large bricks first.
    fn follow_larger(&mut self, octree: &Octree, slots: &[u32], kept: &[usize]) {
        let levels = kept.iter().map(|n| octree.all()[*n].level).max().unwrap_or(0);
        for level in 1..=levels {
            let followed: Vec<(usize, f64)> = kept
                .par_iter()
                .filter(|n| octree.all()[**n].level == level)
                .flat_map_iter(|&number| self.followed(octree, slots, number))
                .collect();
            for (place, value) in followed {
                self.numbers[place] = value;
            }
        }
    }

    /// For one brick the places and values of coefficients that follow a larger brick.
    fn followed(&self, octree: &Octree, slots: &[u32], number: usize) -> Vec<(usize, f64)> {
        let brick = &octree.all()[number];
        let is_larger = |n: &usize| octree.all()[*n].level < brick.level && slots[*n] != NONE;
        let larger: Vec<Option<usize>> =
            octree.around(brick, self.steps()).into_iter().map(|n| n.filter(is_larger)).collect();
        let mut followed = Vec::new();
        if larger.iter().all(Option::is_none) {
            return followed;
        }
        let (reach, steps, edge) = (self.reach as i64, self.steps() as i64, edge(self.reach));
        let side = 2 * self.steps() + 1;
        // The neighbours that the spline of a place reaches into: cells from `reach` before its node on.
        let reached = |i: usize| {
            let node = i as i64 - steps;
            let bricks = (node - reach).div_euclid(CELLS as i64)..=(node + reach - 1).div_euclid(CELLS as i64);
            bricks.map(move |o| (o + steps) as usize)
        };
        for at in (0..edge * edge * edge).map(|n| [n % edge, n / edge % edge, n / (edge * edge)]) {
            let found = reached(at[2])
                .flat_map(|oz| reached(at[1]).map(move |oy| side * (oy + side * oz)))
                .flat_map(|o| reached(at[0]).map(move |ox| ox + o))
                .find_map(|o| larger[o]);
            let Some(found) = found else { continue };
            let other = &octree.all()[found];
            let weights: [(i64, [f64; 4]); 3] = std::array::from_fn(|k| {
                let node = i64::from(brick.at[k]) * CELLS as i64 + at[k] as i64 - steps;
                let (first, weights) = two_scale(self.reach, node);
                (first - i64::from(other.at[k]) * CELLS as i64 + steps, weights)
            });
            let along = |k: usize| {
                let (first, weights) = weights[k];
                let some = (0..4).filter(move |n| weights[*n] != 0.0);
                some.map(move |n| ((first + n as i64) as usize, weights[n]))
            };
            let mut value = 0.0;
            for (z, wz) in along(2) {
                for (y, wy) in along(1) {
                    for (x, wx) in along(0) {
                        value += wx * wy * wz * self.numbers[place(self.reach, slots[found], [x, y, z])];
                    }
                }
            }
            followed.push((place(self.reach, slots[number], at), value));
        }
        followed
    }
}

/// Where a brick's coefficient is.
fn place(reach: usize, slot: u32, [x, y, z]: [usize; 3]) -> usize {
    slot as usize * per_brick(reach) + x + stride(reach) * (y + edge(reach) * z)
}

/// The mean of what all bricks of one size have for a coefficient: of those that hold its node if there are any, else of those
/// beside it. `around` are the slots of neighbours of the same size.
fn share(reach: usize, around: &[u32], own: &[f64], candidates: &[(Candidates, Candidates)], numbers: &mut [f64]) {
    let (side, edge) = (2 * (reach - 1) + 1, edge(reach));
    let mean = |of: [&Candidates; 3]| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (oz, k) in of[2] {
            for (oy, j) in of[1] {
                for (ox, i) in of[0] {
                    let slot = around[ox + side * (oy + side * oz)];
                    if slot != NONE {
                        sum += own[place(reach, slot, [*i, *j, *k])];
                        count += 1.0;
                    }
                }
            }
        }
        (count > 0.0).then(|| sum / count)
    };
    for at in (0..edge * edge * edge).map(|n| [n % edge, n / edge % edge, n / (edge * edge)]) {
        let value = mean(at.map(|i| &candidates[i].0)).or_else(|| mean(at.map(|i| &candidates[i].1)));
        numbers[place(reach, 0, at)] = value.unwrap_or(0.0);
    }
}

/// For a place along an axis the neighbours that hold its node, with the place that it has in them, and the same of all that have
/// a coefficient for it.
fn candidates(reach: usize, place: usize) -> (Candidates, Candidates) {
    let steps = reach - 1;
    let all: Candidates = (0..=2 * steps)
        .filter_map(|o| {
            let there = (place + CELLS * steps).checked_sub(CELLS * o)?;
            (there < edge(reach)).then_some((o, there))
        })
        .collect();
    let holding = all.iter().copied().filter(|(_, there)| (steps..=steps + CELLS).contains(there)).collect();
    (holding, all)
}

/// How the coefficient at a node of small cells follows from those of cells of twice the size: the first of these, counted from
/// the same origin, and the weights of four from there on.
fn two_scale(reach: usize, node: i64) -> (i64, [f64; 4]) {
    let below = node.div_euclid(2);
    match (reach, node.rem_euclid(2)) {
        (CUBIC, 0) => (below - 1, [0.125, 0.75, 0.125, 0.0]),
        (CUBIC, _) => (below, [0.5, 0.5, 0.0, 0.0]),
        (_, 0) => (below - 1, [0.1875, 0.625, 0.1875, 0.0]),
        _ => (below - 1, [0.03125, 0.46875, 0.46875, 0.03125]),
    }
}

/// What the nodes hold of a combination of functions: entry `node * 27 + derivative`.
fn combined(table: &PotentialTable, weights: &[f64]) -> Vec<f64> {
    let per_node = (table.channels * PER_NODE).max(1);
    let mut nodes = vec![0.0; table.nodes.len() / per_node * PER_NODE];
    nodes.par_chunks_mut(PER_NODE).zip(table.nodes.par_chunks(per_node)).for_each(|(new, old)| {
        for (old, w) in old.chunks_exact(PER_NODE).zip(weights).filter(|(_, w)| **w != 0.0) {
            new.iter_mut().zip(old).for_each(|(n, o)| *n += w * o);
        }
    });
    nodes
}

/// Coefficients along one axis from the six numbers of a polynomial of degree five: the inverse of what the spline's values at its
/// nodes are, exact for degree five. Cubic: (c₋₁ + 4 c₀ + c₁)/6 = c + δ² c''/6 + δ⁴ c/72 + ..., so c = f - δ² f/6 + δ⁴ f/72.
/// Degree five: (c₋₂ + 26 c₋₁ + 66 c₀ + 26 c₁ + c₂)/120 = c + δ² c''/4 + 7 δ⁴ c/240 + ..., so c = f - δ² f/4 + δ⁴ f/30.
fn prefilter(reach: usize) -> Vec<[f64; 6]> {
    let cell = 1.0 / CELLS as f64;
    let (second, fourth) = if reach == CUBIC { (1.0 / 6.0, 1.0 / 72.0) } else { (0.25, 1.0 / 30.0) };
    let factors = [1.0, -second * cell.powi(2), fourth * cell.powi(4)];
    let at = |i: usize| {
        let t = (i as f64 - (reach as f64 - 1.0)) * cell;
        let derivatives = [0, 2, 4].map(|order| basis(t, order));
        std::array::from_fn(|k| (0..3).map(|d| factors[d] * derivatives[d][k]).sum())
    };
    (0..edge(reach)).map(at).collect()
}

/// Coefficients along an edge at most.
const LONGEST: usize = edge(QUINTIC);

/// All coefficients of a brick from its polynomial alone, axis by axis.
fn coefficients(corners: &[f64; 216], prefilter: &[[f64; 6]], reach: usize, numbers: &mut [f64]) {
    let (edge, stride) = (edge(reach), stride(reach));
    let mut along_x = [[0.0; LONGEST]; 36];
    for (row, corners) in along_x.iter_mut().zip(corners.chunks_exact(6)) {
        for (x, weights) in row.iter_mut().zip(prefilter) {
            *x = (0..6).map(|a| weights[a] * corners[a]).sum();
        }
    }
    let mut along_y = [[0.0; LONGEST]; 6 * LONGEST];
    for c in 0..6 {
        for (j, weights) in prefilter.iter().enumerate() {
            let row = &mut along_y[c * edge + j];
            for (b, w) in weights.iter().enumerate() {
                row.iter_mut().zip(&along_x[6 * c + b]).for_each(|(sum, x)| *sum += w * x);
            }
        }
    }
    for (k, weights) in prefilter.iter().enumerate() {
        for j in 0..edge {
            let row = &mut numbers[stride * (j + edge * k)..][..edge];
            for (c, w) in weights.iter().enumerate() {
                row.iter_mut().zip(&along_y[c * edge + j]).for_each(|(sum, x)| *sum += w * x);
            }
        }
    }
}
