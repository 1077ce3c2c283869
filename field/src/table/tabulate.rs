//! Making a table to an accuracy: choosing its bricks and the layer it leaves to the exact sum.
//!
//! Large bricks come first. Those whose estimated error is too large are halved, or left to the exact sum next to conductors, until
//! that layer is too thick; then its bricks are halved, too. In the end the error is measured against the exact sum, and where it
//! is larger than estimated, more is halved.

use std::collections::HashMap;

use meshes::{SurfaceTree, Vec3};
use rayon::prelude::*;

use super::fill::fill;
use super::kernel::Kernel;
use super::measure::{TableReport, measure};
use super::octree::{Brick, MAX_LEVEL, MOST_BRICKS, NONE, Octree};
use super::refine::{Quality, quality, rescale};
use super::spline::{CUBIC, QUINTIC};
use super::{CELLS_PER_BRICK, Grid, PER_NODE, PotentialTable};
use crate::{ElectrodeBasis, PanelSum, Plane};

/// What is wanted of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableOptions {
    /// Lower corner of the box, m.
    pub min: Vec3,
    /// Upper corner, m.
    pub max: Vec3,
    /// Largest error of the field, as a fraction of the strongest field in the table; the potential is held to a tenth of it, as
    /// a fraction of the unit excitation.
    pub accuracy: f64,
    /// Size of a cell, m, the same everywhere; `None`: chosen so that the accuracy is reached, smaller where the field needs it.
    pub spacing: Option<f64>,
    /// Splines of degree five also where the accuracy does not ask for them ([`SMOOTH`](super::SMOOTH)): forces then are so smooth that
    /// multistep schemes can use them.
    pub smooth: bool,
    /// Bytes that may be used. A spacing that is given is refused when it needs more; one that is chosen stops shrinking.
    pub max_bytes: u64,
}

impl TableOptions {
    /// Whether splines are of degree five.
    pub fn is_smooth(&self) -> bool {
        self.smooth || self.accuracy <= super::SMOOTH
    }
}

/// Why there is no table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// It would not fit.
    #[error(
        "a table of {nodes} nodes for {functions} electrodes and sources needs {needed} bytes, and {available} may be used"
    )]
    TooLarge {
        /// Nodes.
        nodes: u64,
        /// Basis functions.
        functions: usize,
        /// Bytes.
        needed: u64,
        /// Bytes.
        available: u64,
        /// Largest spacing that would fit, m.
        spacing_that_fits: f64,
    },
    /// The box is too long for its cells.
    #[error("a table has fewer than {most} cells along each axis, and this one would have {cells}")]
    TooFine {
        /// Cells along the longest edge.
        cells: u64,
        /// There must be fewer.
        most: u64,
        /// Smallest spacing that would do, m.
        spacing_that_fits: f64,
    },
}

/// Nearest interpolated bricks may come this close to a conductor, in bricks.
const NEAREST: f64 = 1.0;

/// Bricks farther than this from conductors, in bricks, are never left to the exact sum for their error: they are halved.
const THICKEST: f64 = 3.0;

/// The same where the size of cells is given.
const THICKEST_GIVEN: f64 = 2.0;

/// The clearance of a brick inside a conductor or below a grounded plane, where no table is needed.
const INSIDE: f32 = -1.0;

/// Bricks along the longest side of the box to begin with.
const FIRST_BRICKS: f64 = 12.0;

/// Fraction of the space outside of conductors that is to be interpolated, as long as the table stays small. A point beside a
/// conductor takes some hundred times as long as an interpolated one (`field/benches`).
const WIDE: f64 = 0.85;

/// Part of the points of interest that are to lie in interpolated bricks: all but what is next to a conductor anyway.
const COVERED: f64 = 0.9;

/// Nodes times basis functions above which no bricks are halved for those two reasons.
const WIDE_NODES: usize = 100_000;

/// Times that the estimated errors are corrected by the measured one.
const CORRECTIONS: usize = 4;

/// Tabulates all basis functions.
///
/// # Errors
/// It needs more memory than may be used.
pub fn tabulate(
    basis: &ElectrodeBasis,
    options: &TableOptions,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(PotentialTable, TableReport), TableError> {
    tabulate_around(basis, options, 0, progress)
}

/// As [`tabulate`], with bricks beside conductors halved so often ([`halvings_for`] points of interest, where grains start, say), as
/// long as the table stays small: what is next to a conductor is left to the exact sum, which takes some hundred times as
/// long (`field/benches`).
///
/// # Errors
/// As [`tabulate`].
pub fn tabulate_around(
    basis: &ElectrodeBasis,
    options: &TableOptions,
    halvings: u8,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(PotentialTable, TableReport), TableError> {
    let longest = (options.max - options.min).max();
    let spacing = options.spacing.unwrap_or(longest / FIRST_BRICKS / CELLS_PER_BRICK as f64);
    let functions = basis.functions();
    let bytes = |spacing: f64| {
        let bricks = PotentialTable::bricks_for(options.min, options.max, spacing);
        (bricks, PotentialTable::bytes_while_filling(&bricks, functions, options.accuracy, options.smooth))
    };
    let (grid, needed) = bytes(spacing);
    if needed > options.max_bytes {
        let mut fits = spacing;
        while bytes(fits).1 > options.max_bytes && fits < longest {
            fits *= 1.05;
        }
        return Err(TableError::TooLarge {
            nodes: grid.nodes() as u64,
            functions,
            needed,
            available: options.max_bytes,
            spacing_that_fits: fits,
        });
    }
    let most = grid.cells.iter().copied().max().unwrap_or(0);
    if most >= MOST_BRICKS {
        let cells = |bricks: usize| (bricks * CELLS_PER_BRICK) as u64;
        let fits = 1.01 * longest / cells(MOST_BRICKS) as f64;
        return Err(TableError::TooFine { cells: cells(most), most: cells(MOST_BRICKS), spacing_that_fits: fits });
    }
    let mut maker = Maker {
        basis,
        options,
        halvings,
        exact: basis.panel_sum(),
        table: PotentialTable {
            octree: Octree::new(grid),
            channels: functions,
            accuracy: options.accuracy,
            smooth: options.is_smooth(),
            nodes: Vec::new(),
        },
        ids: HashMap::new(),
        clearance: Vec::new(),
        quality: Vec::new(),
        severity: 1.0,
        fills: 0,
        progress,
    };
    maker.fill_new();
    Ok(maker.finished())
}

/// How often bricks beside conductors have to be halved for most of these points to lie in interpolated ones.
pub fn halvings_for(basis: &ElectrodeBasis, options: &TableOptions, points: &[Vec3]) -> u8 {
    if points.is_empty() || options.spacing.is_some() {
        return 0;
    }
    let first = (options.max - options.min).max() / FIRST_BRICKS;
    // Where a point may be farthest from a conductor that is too near to its brick.
    let bricks = NEAREST + 3.0_f64.sqrt();
    let tree = SurfaceTree::new(&basis.mesh);
    let distance = |p: &Vec3| tree.nearest(p, bricks * first).map_or(bricks * first, |nearest| nearest.distance);
    let mut distances: Vec<f64> = points.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    let most = distances[((1.0 - COVERED) * (distances.len() - 1) as f64) as usize];
    let halvings = (bricks * first / most.max(first * 1e-3)).log2().ceil();
    (halvings.max(0.0) as u8).min(MAX_LEVEL)
}

/// A table in the making.
struct Maker<'a> {
    basis: &'a ElectrodeBasis,
    options: &'a TableOptions,
    /// How often bricks beside conductors are to be halved.
    halvings: u8,
    exact: PanelSum,
    table: PotentialTable,
    /// The number of the node at a place.
    ids: HashMap<[u32; 3], u32>,
    /// For each brick its distance from the nearest conductor in bricks; zero where it is cut, [`INSIDE`] within.
    clearance: Vec<f32>,
    /// For each brick with known corners its quality for each function.
    quality: Vec<Vec<Quality>>,
    /// By how much errors are larger than estimated.
    severity: f64,
    /// Times that nodes were filled.
    fills: i32,
    progress: &'a (dyn Fn(f64) + Sync),
}

impl Maker<'_> {
    /// Fills the bricks that came last.
    fn fill_new(&mut self) {
        let first = self.clearance.len();
        let (tree, ground) = (self.exact.tree(), self.basis.ground.as_ref());
        let octree = &self.table.octree;
        let new: Vec<f32> =
            octree.all()[first..].par_iter().map(|brick| clearance(octree, brick, tree, ground)).collect();
        self.clearance.extend(new);
        let count = self.clearance.len();
        let mut levels: Vec<u8> = self.table.octree.all()[first..].iter().map(|brick| brick.level).collect();
        levels.sort_unstable();
        levels.dedup();
        for level in levels {
            let is_new = |number: &usize| {
                let brick = &self.table.octree.all()[*number];
                brick.level == level && f64::from(self.clearance[*number]) >= NEAREST
            };
            let new: Vec<usize> = (first..count).filter(is_new).collect();
            let bricks: Vec<Brick> = new.iter().map(|n| self.table.octree.all()[*n]).collect();
            let down = MAX_LEVEL - level;
            let grid = self.table.octree.grid_of(level);
            let corners = bricks.iter().flat_map(|brick| (0..8).map(|c| brick.corner(c)));
            self.fill_nodes(corners.collect(), grid, down);
            for number in new {
                let brick = self.table.octree.brick_mut(number);
                brick.corners = std::array::from_fn(|c| self.ids[&brick.corner(c)]);
            }
        }
        let quality: Vec<Vec<Quality>> = (first..count).into_par_iter().map(|n| self.quality_of(n)).collect();
        self.quality.extend(quality);
    }

    /// Makes sure that nodes at these places are known. They are nodes of a grid: place = index · 2^`down`.
    fn fill_nodes(&mut self, mut places: Vec<[u32; 3]>, grid: Grid, down: u8) {
        places.retain(|place| !self.ids.contains_key(place));
        places.sort_unstable();
        places.dedup();
        if places.is_empty() {
            return;
        }
        let index = |place: &[u32; 3]| place.map(|i| (i >> down) as usize);
        let nodes: Vec<[usize; 3]> = places.iter().map(index).collect();
        // How many times more there will be is not known: each takes half of what is left of the bar.
        let from = 1.0 - 0.5_f64.powi(self.fills);
        let mut new = fill(self.basis, grid, &nodes, self.options.accuracy, &|done| {
            (self.progress)(from + 0.5 * (1.0 - from) * done);
        });
        self.fills += 1;
        let size = self.table.octree.size(MAX_LEVEL - down).x / self.table.octree.size(0).x;
        rescale(&mut new, size);
        let known = self.ids.len() as u32;
        self.ids.extend(places.into_iter().zip(known..));
        self.table.nodes.extend(new);
    }

    fn quality_of(&self, number: usize) -> Vec<Quality> {
        let octree = &self.table.octree;
        let brick = &octree.all()[number];
        if !brick.is_filled() {
            return Vec::new();
        }
        let (n, reach) = (self.table.channels, if self.options.is_smooth() { QUINTIC } else { CUBIC });
        let of = |node: u32, c: usize| {
            let first = (node as usize * n + c) * PER_NODE;
            &self.table.nodes[first..first + PER_NODE]
        };
        let (size, edges) = (0.5_f64.powi(i32::from(brick.level)), octree.size(brick.level).into());
        (0..n).map(|c| quality(&brick.corners.map(|node| of(node, c)), size, edges, reach)).collect()
    }

    /// Marks the bricks that are good enough to be interpolated.
    fn mark(&mut self) {
        let thickest = if self.options.spacing.is_some() { THICKEST_GIVEN } else { THICKEST };
        let electrodes = self.basis.mesh.electrodes.len();
        // What errors are measured against: the strongest field and the largest potential in interpolated bricks. Fewer bricks
        // have less of both, so begin with all.
        let mut scales = self.scales(electrodes, |_| true);
        for _ in 0..3 {
            let good = |number: usize| {
                f64::from(self.clearance[number]) >= thickest || self.error(number, &scales) <= self.options.accuracy
            };
            let kept: Vec<bool> = (0..self.quality.len()).map(|n| !self.quality[n].is_empty() && good(n)).collect();
            scales = self.scales(electrodes, |n| kept[n]);
            for (number, kept) in kept.into_iter().enumerate() {
                let whole = !self.table.octree.all()[number].is_halved();
                self.table.octree.brick_mut(number).tabulated = whole && kept;
            }
        }
    }

    /// For each function potential and field against which errors in the interpolated bricks are measured.
    fn scales(&self, electrodes: usize, kept: impl Fn(usize) -> bool) -> Vec<[f64; 2]> {
        let own = || self.table.octree.whole().map(|(n, _)| n).filter(|n| !self.quality[*n].is_empty() && kept(*n));
        (0..self.table.channels)
            .map(|c| {
                let height = own().map(|n| self.quality[n][c].height).fold(f64::MIN_POSITIVE, f64::max);
                let strength = own().map(|n| self.quality[n][c].strength).fold(f64::MIN_POSITIVE, f64::max);
                [if c < electrodes { 1.0 } else { height }, strength]
            })
            .collect()
    }

    /// The estimated error of a brick that counts against the accuracy.
    fn error(&self, number: usize, scales: &[[f64; 2]]) -> f64 {
        let errors = self.quality[number].iter().zip(scales);
        let worst = errors.map(|(q, [height, strength])| f64::max(q.field / strength, 10.0 * q.potential / height));
        self.severity * worst.fold(0.0, f64::max)
    }

    /// Halves bricks that are not good enough, and those that hold too much of the space; whether there were any.
    fn refined(&mut self) -> bool {
        self.mark();
        let marked = self.too_large();
        if self.halve(marked, usize::MAX) {
            return true;
        }
        let marked = self.too_wide();
        self.halve(marked, WIDE_NODES / self.table.channels.max(1))
    }

    /// Whether a brick may be halved.
    fn can_be_halved(&self, number: usize) -> bool {
        self.table.octree.all()[number].level < MAX_LEVEL
    }

    /// Bricks away from conductors whose error is too large, the worst first.
    fn too_large(&self) -> Vec<usize> {
        let octree = &self.table.octree;
        let scales = self.scales(self.basis.mesh.electrodes.len(), |n| octree.all()[n].tabulated);
        let far = |n: usize| f64::from(self.clearance[n]) >= THICKEST && !self.quality[n].is_empty();
        let candidates = octree.whole().map(|(n, _)| n).filter(|n| far(*n) && self.can_be_halved(*n));
        let errors = candidates.map(|n| (self.error(n, &scales), n));
        let mut bad: Vec<(f64, usize)> = errors.filter(|(error, _)| *error > self.options.accuracy).collect();
        bad.sort_by(|a, b| b.0.total_cmp(&a.0));
        bad.into_iter().map(|(_, n)| n).collect()
    }

    /// Bricks that are left to the exact sum, if that is too much of the space or they are larger than they should be.
    fn too_wide(&self) -> Vec<usize> {
        let octree = &self.table.octree;
        let whole: Vec<usize> = octree.whole().map(|(n, _)| n).collect();
        let can = |n: &usize| self.can_be_halved(*n);
        let outside = |n: &usize| self.clearance[*n] > INSIDE;
        let open = |n: &usize| outside(n) && !octree.all()[*n].tabulated;
        let volume = |n: usize| octree.all()[n].volume() * if self.clearance[n] == 0.0 { 0.5 } else { 1.0 };
        let free: f64 = whole.iter().copied().filter(outside).map(volume).sum();
        let left: f64 = whole.iter().copied().filter(open).map(volume).sum();
        let wide = left <= (1.0 - WIDE) * free;
        let coarse = |n: &usize| !wide || octree.all()[*n].level < self.halvings;
        whole.iter().copied().filter(|n| can(n) && open(n) && coarse(n)).collect()
    }

    /// Halves bricks and what has to be halved with them, as many of them, from the first on, as there is room for; whether there
    /// were any.
    fn halve(&mut self, mut marked: Vec<usize>, most_nodes: usize) -> bool {
        while !marked.is_empty() {
            let mut all = marked.clone();
            self.table.octree.balance(&mut all);
            // Eight parts have 19 nodes of their own, most of them shared with neighbours.
            let nodes = self.ids.len() + 10 * all.len();
            let n = self.table.channels;
            let bricks = self.table.octree.all().len() + 8 * all.len();
            let bytes = (8 * PER_NODE * n * nodes) as u64 / 3 * 4
                + Kernel::bytes_for(self.options.accuracy, self.options.is_smooth(), bricks, n);
            if nodes <= most_nodes && bytes <= self.options.max_bytes {
                for number in all {
                    self.table.octree.halve(number);
                }
                self.fill_new();
                return true;
            }
            // For a wider table all or nothing: half of a layer is not thinner.
            marked.truncate(if most_nodes < usize::MAX { 0 } else { marked.len() / 2 });
        }
        false
    }

    /// Halves bricks until the table is as good as asked.
    fn finished(mut self) -> (PotentialTable, TableReport) {
        let chosen = self.options.spacing.is_none();
        let electrodes = self.basis.mesh.electrodes.len();
        let mut correction = 0;
        loop {
            while chosen && self.refined() {}
            self.mark();
            let report = measure(&self.table, &self.clearance, &self.exact, electrodes);
            let excess = report.error() / self.options.accuracy;
            if excess <= 1.0 || correction == CORRECTIONS {
                return self.closed(report);
            }
            correction += 1;
            self.severity *= excess.clamp(1.5, 10.0);
        }
    }

    /// The table without nodes that are no corners, and the rest of its report.
    fn closed(mut self, mut report: TableReport) -> (PotentialTable, TableReport) {
        let octree = &self.table.octree;
        let kept = || octree.whole().filter(|(_, brick)| brick.tabulated);
        let outside = |n: usize| self.clearance[n] > INSIDE;
        let volume = |(n, brick): (usize, &Brick)| brick.volume() * if self.clearance[n] == 0.0 { 0.5 } else { 1.0 };
        let free: f64 = octree.whole().filter(|(n, _)| outside(*n)).map(volume).sum();
        report.tabulated_fraction = kept().map(volume).sum::<f64>() / free.max(f64::MIN_POSITIVE);
        let cell = |level: Option<u8>| octree.size(level.unwrap_or(0)).mean() / CELLS_PER_BRICK as f64;
        let levels = || kept().map(|(_, brick)| brick.level);
        (report.spacing, report.finest_spacing) = (cell(levels().min()), cell(levels().max()));
        let nearest = kept().map(|(n, _)| f64::from(self.clearance[n])).fold(f64::INFINITY, f64::min);
        report.layer = if nearest.is_finite() { nearest * CELLS_PER_BRICK as f64 } else { 0.0 };
        let per_node = PER_NODE * self.table.channels;
        let mut new_ids = vec![NONE; self.ids.len()];
        let mut nodes = Vec::new();
        let mut count = 0;
        for number in 0..self.table.octree.all().len() {
            let brick = self.table.octree.brick_mut(number);
            if brick.is_halved() {
                brick.corners = [NONE; 8];
            }
            for corner in brick.corners.iter_mut().filter(|c| **c != NONE) {
                let old = *corner as usize;
                if new_ids[old] == NONE {
                    new_ids[old] = count;
                    count += 1;
                    nodes.extend_from_slice(&self.table.nodes[old * per_node..(old + 1) * per_node]);
                }
                *corner = new_ids[old];
            }
        }
        self.table.nodes = nodes;
        report.nodes = count as usize;
        report.bytes = self.table.bytes();
        (self.table, report)
    }
}

/// Distance of a brick from the nearest conductor in bricks, as far as it matters; zero where it cuts one, [`INSIDE`] where it lies
/// within.
fn clearance(octree: &Octree, brick: &Brick, tree: &SurfaceTree, ground: Option<&Plane>) -> f32 {
    let edges = octree.size(brick.level);
    let center = octree.point(brick, [0.5; 3]);
    let (size, half) = (edges.max(), 0.5 * edges.norm());
    // A table is needed above the grounded plane only.
    if ground.is_some_and(|plane| plane.height(&center) < -half) {
        return INSIDE;
    }
    let reach = 8.0 * size + half;
    match tree.nearest(&center, reach) {
        Some(nearest) if nearest.distance <= half => 0.0,
        // Nothing is cut: the whole brick is inside where its centre is.
        _ if tree.inside(&center).is_some() => INSIDE,
        Some(nearest) => ((nearest.distance - half) / size) as f32,
        None => ((reach - half) / size) as f32,
    }
}
