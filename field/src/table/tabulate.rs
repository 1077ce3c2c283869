//! Making a table to an accuracy: choosing its spacing and the layer it leaves to the exact sum, and measuring its error.

use meshes::{SurfaceTree, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::fill::fill;
use super::{Grid, PotentialTable};
use crate::{BasisField, ElectrodeBasis, PanelSum, Plane, Samples};

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
    /// Size of a cell, m; `None`: chosen so that the accuracy is reached.
    pub spacing: Option<f64>,
    /// Bytes that may be used. A spacing that is given is refused when it needs more; one that is chosen stops shrinking.
    pub max_bytes: u64,
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
}

/// What a table is like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TableReport {
    /// Number of nodes.
    pub nodes: usize,
    /// Bytes it takes.
    pub bytes: u64,
    /// Mean size of a cell, m.
    pub spacing: f64,
    /// Fraction of the cells outside of conductors that are interpolated; the others are left to the exact sum.
    pub tabulated_fraction: f64,
    /// Cells between a conductor and the nearest interpolated cell.
    pub layer: f64,
    /// Largest error of the potential at points between the nodes, as a fraction of the unit excitation.
    pub potential_error: f64,
    /// Largest error of the field there, as a fraction of the strongest field in interpolated cells.
    pub field_error: f64,
    /// Largest |Laplacian| of the interpolant at points between the nodes, times spacing, as a fraction of the strongest
    /// field: zero for an exact potential.
    pub laplacian: f64,
    /// Points at which the error was measured.
    pub error_points: usize,
}

impl TableReport {
    /// The error that counts against the accuracy asked for.
    pub fn error(&self) -> f64 {
        self.field_error.max(10.0 * self.potential_error)
    }
}

/// Thickness, in cells, of the layer next to conductors that may be left to the exact sum.
const LAYERS: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0];

/// Thickest layer with which a spacing that is chosen is accepted; a finer grid with a thinner layer is faster to trace in.
const THICKEST: f64 = 3.0;

/// Cells along the longest side of the box to begin with.
const FIRST_CELLS: f64 = 24.0;

/// The clearance of a cell inside a conductor, where no table is needed.
const INSIDE: f64 = -1.0;

/// The layer, in cells, that is left to the exact sum at the usual accuracies.
const USUAL_LAYER: f64 = 1.5;

/// Fraction of the cells outside of conductors that are to be interpolated, as long as the table stays small. A point in one of
/// the others takes some eight times as long as an interpolated one (`field/benches`).
const WIDE: f64 = 0.85;

/// Nodes times basis functions above which that is no longer asked for: some 20 MB.
const WIDE_NODES: usize = 100_000;

/// Points at which the error is measured, for each thickness of layer. The largest error of 400 points misses the largest of
/// all by a factor of about two where the error falls steeply with distance from a conductor; the worst cells are the
/// nearest ones, and those are drawn as often as all others together.
const POINTS: usize = 400;

/// Tabulates all basis functions.
///
/// # Errors
/// It needs more memory than may be used.
pub fn tabulate(
    basis: &ElectrodeBasis,
    options: &TableOptions,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(PotentialTable, TableReport), TableError> {
    tabulate_around(basis, options, &[], progress)
}

/// Points of interest that are to lie in interpolated cells, where the spacing is chosen: all but what is next to a conductor
/// anyway.
const COVERED: f64 = 0.9;

/// As [`tabulate`], with a spacing so small that the table holds most points of interest (where grains start, say): a cell next
/// to a conductor is left to the exact sum, which takes some eight times as long (`field/benches`).
///
/// # Errors
/// As [`tabulate`].
pub fn tabulate_around(
    basis: &ElectrodeBasis,
    options: &TableOptions,
    interest: &[Vec3],
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(PotentialTable, TableReport), TableError> {
    tabulate_from(basis, options, starting_spacing(basis, options, interest)?, progress)
}

/// Nodes of a grid of that spacing, and bytes to fill it.
fn bytes_for(options: &TableOptions, functions: usize, spacing: f64) -> (usize, u64) {
    let nodes = Grid::new(options.min, options.max, spacing).nodes();
    (nodes, PotentialTable::bytes_while_filling(nodes, functions))
}

/// The spacing that [`tabulate_around`] begins with, m: all that its table knows of the points of interest.
///
/// # Errors
/// As [`tabulate`].
pub fn starting_spacing(basis: &ElectrodeBasis, options: &TableOptions, interest: &[Vec3]) -> Result<f64, TableError> {
    let functions = basis.functions();
    let longest = (options.max - options.min).max();
    let bytes = |spacing: f64| bytes_for(options, functions, spacing);
    let spacing = options.spacing.unwrap_or(longest / FIRST_CELLS);
    let (nodes, needed) = bytes(spacing);
    if needed > options.max_bytes {
        let mut fits = spacing;
        while bytes(fits).1 > options.max_bytes && fits < longest {
            fits *= 1.05;
        }
        return Err(TableError::TooLarge {
            nodes: nodes as u64,
            functions,
            needed,
            available: options.max_bytes,
            spacing_that_fits: fits,
        });
    }
    if options.spacing.is_some() {
        return Ok(spacing);
    }
    let fits = |spacing: f64| bytes(spacing).1 <= options.max_bytes;
    Ok(wide_spacing(options, spacing, functions, interest, basis, fits))
}

/// As [`tabulate`], beginning with a spacing (m) that [`starting_spacing`] gave.
///
/// # Errors
/// As [`tabulate`].
pub fn tabulate_from(
    basis: &ElectrodeBasis,
    options: &TableOptions,
    mut spacing: f64,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(PotentialTable, TableReport), TableError> {
    let functions = basis.functions();
    let exact = basis.panel_sum();
    loop {
        let grid = Grid::new(options.min, options.max, spacing);
        let clearance = clearances(&grid, exact.tree(), basis.ground.as_ref());
        let needed = needed_nodes(&grid, &clearance);
        let nodes = fill(basis, grid, &needed, options.accuracy, progress);
        let everywhere = clearance.iter().map(|c| *c >= LAYERS[0]).collect();
        let mut table = PotentialTable { grid, channels: functions, nodes, tabulated: everywhere };
        let measured = measure(&table, &clearance, &exact, basis.mesh.electrodes.len());
        let (layer, mut report) = measured
            .iter()
            .find(|(_, r)| r.error() <= options.accuracy)
            .or(measured.last())
            .map_or((LAYERS[0], TableReport::default()), |(layer, report)| (*layer, *report));
        table.tabulated = clearance.iter().map(|c| *c >= layer).collect();
        report.nodes = grid.nodes();
        report.bytes = table.bytes();
        report.spacing = grid.spacing().mean();
        report.layer = layer;
        let kept = table.tabulated.iter().filter(|t| **t).count();
        let free = clearance.iter().filter(|c| **c > INSIDE).count();
        report.tabulated_fraction = kept as f64 / free.max(1) as f64;
        let good = report.error() <= options.accuracy && layer <= THICKEST;
        // The error of the field falls with the fifth power of the spacing; a fifth to two fifths less at a time.
        let wanted = (options.accuracy / report.error().max(f64::MIN_POSITIVE)).powf(0.2);
        let next = spacing * wanted.clamp(0.6, 0.8);
        if good || options.spacing.is_some() || bytes_for(options, functions, next).1 > options.max_bytes {
            return Ok((table, report));
        }
        spacing = next;
    }
}

/// A spacing at which most of the space between conductors, and most points of interest, are so far from conductors that they
/// will be interpolated; not so small that the table becomes large for that alone.
fn wide_spacing(
    options: &TableOptions,
    first: f64,
    functions: usize,
    interest: &[Vec3],
    basis: &ElectrodeBasis,
    fits: impl Fn(f64) -> bool,
) -> f64 {
    let tree = SurfaceTree::new(&basis.mesh);
    let mut spacing = first;
    loop {
        let grid = Grid::new(options.min, options.max, spacing);
        let clearance = clearances(&grid, &tree, basis.ground.as_ref());
        let free = clearance.iter().filter(|c| **c > INSIDE).count();
        let kept = clearance.iter().filter(|c| **c >= USUAL_LAYER).count();
        let in_box: Vec<usize> = interest.iter().filter_map(|p| grid.locate(p)).map(|(at, _)| grid.cell(at)).collect();
        let held = in_box.iter().filter(|cell| clearance[**cell] >= USUAL_LAYER).count();
        let wide = kept as f64 >= WIDE * free as f64 && held as f64 >= COVERED * in_box.len() as f64;
        let next = 0.8 * spacing;
        let large = Grid::new(options.min, options.max, next).nodes() * functions > WIDE_NODES;
        if wide || large || !fits(next) {
            return spacing;
        }
        spacing = next;
    }
}

/// Distance of each cell from the nearest conductor, in cells; zero where it cuts one, [`INSIDE`] where it lies within.
fn clearances(grid: &Grid, tree: &SurfaceTree, ground: Option<&Plane>) -> Vec<f64> {
    let spacing = grid.spacing();
    let (size, half) = (spacing.max(), 0.5 * spacing.norm());
    let reach = (LAYERS[LAYERS.len() - 1] + 1.0) * size + half;
    (0..grid.cell_count())
        .into_par_iter()
        .map(|cell| {
            let center = grid.point(grid.cell_indices(cell).map(|i| i as f64 + 0.5));
            // Wholly below the grounded plane.
            if ground.is_some_and(|plane| plane.height(&center) < -half) {
                return INSIDE;
            }
            match tree.nearest(&center, reach) {
                Some(nearest) if nearest.distance <= half => 0.0,
                // Nothing is cut: the whole cell is inside where its centre is.
                _ if tree.inside(&center).is_some() => INSIDE,
                Some(nearest) => (nearest.distance - half) / size,
                None => (reach - half) / size,
            }
        })
        .collect()
}

/// Nodes of cells that may be interpolated.
fn needed_nodes(grid: &Grid, clearance: &[f64]) -> Vec<bool> {
    let mut needed = vec![false; grid.nodes()];
    for (cell, _) in clearance.iter().enumerate().filter(|(_, c)| **c >= LAYERS[0]) {
        let [i, j, k] = grid.cell_indices(cell);
        for corner in 0..8 {
            needed[grid.node([i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)])] = true;
        }
    }
    needed
}

/// The error of the table for each thickness of layer, at points drawn from the cells beyond it: half of them from the cells
/// next to the layer.
fn measure(table: &PotentialTable, clearance: &[f64], exact: &PanelSum, electrodes: usize) -> Vec<(f64, TableReport)> {
    let n = table.channels;
    let mut next = sequence();
    // Points, each with the clearance of its cell.
    let mut drawn: Vec<(f64, Vec3)> = Vec::new();
    let mut draw = |cells: &[usize]| {
        for _ in 0..POINTS / 2 {
            if cells.is_empty() {
                break;
            }
            let cell = cells[(next() * cells.len() as f64) as usize];
            let [i, j, k] = table.grid.cell_indices(cell).map(|i| i as f64);
            drawn.push((clearance[cell], table.grid.point([i + next(), j + next(), k + next()])));
        }
    };
    for (index, &layer) in LAYERS.iter().enumerate() {
        let thicker = LAYERS.get(index + 1).copied().unwrap_or(f64::INFINITY);
        let band = |from: f64, to: f64| -> Vec<usize> {
            (0..clearance.len()).filter(|&c| clearance[c] >= from && clearance[c] < to).collect()
        };
        draw(&band(layer, thicker));
    }
    let all: Vec<usize> = (0..clearance.len()).filter(|&c| clearance[c] >= LAYERS[0]).collect();
    draw(&all);
    struct Error {
        clearance: f64,
        potential: Vec<f64>,
        height: Vec<f64>,
        field: Vec<f64>,
        strength: Vec<f64>,
        laplacian: Vec<f64>,
    }
    let size = table.grid.spacing().max();
    drawn.retain(|(_, point)| !exact.below_ground(point));
    let errors: Vec<Error> = drawn
        .par_iter()
        .map(|(clearance, point)| {
            let mut samples = Samples::default();
            exact.sample(std::slice::from_ref(point), &mut samples);
            let (mut potential, mut gradient) = (vec![0.0; n], vec![Vec3::zeros(); n]);
            table.add(point, &mut potential, &mut gradient);
            exact.add_sources(point, &mut potential, &mut gradient);
            let difference = |c: usize| (gradient[c] - samples.gradient[c]).norm();
            Error {
                clearance: *clearance,
                potential: (0..n).map(|c| (potential[c] - samples.potential[c]).abs()).collect(),
                // An electrode at 1 V; a source by the largest potential it makes.
                height: (0..n).map(|c| if c < electrodes { 1.0 } else { samples.potential[c].abs() }).collect(),
                field: (0..n).map(difference).collect(),
                strength: samples.gradient.iter().map(|g| g.norm()).collect(),
                laplacian: laplacians(table, point, 1e-3 * size),
            }
        })
        .collect();
    LAYERS
        .iter()
        .map(|&layer| {
            let beyond: Vec<&Error> = errors.iter().filter(|e| e.clearance >= layer).collect();
            let largest = |of: &dyn Fn(&Error) -> f64| beyond.iter().map(|e| of(e)).fold(0.0, f64::max);
            // The worst channel, each against its own scale.
            let relative = |of: &dyn Fn(&Error, usize) -> f64, scale: &dyn Fn(&Error, usize) -> f64| {
                (0..n)
                    .map(|c| largest(&|e| of(e, c)) / largest(&|e| scale(e, c)).max(f64::MIN_POSITIVE))
                    .fold(0.0, f64::max)
            };
            let report = TableReport {
                potential_error: relative(&|e, c| e.potential[c], &|e, c| e.height[c]),
                field_error: relative(&|e, c| e.field[c], &|e, c| e.strength[c]),
                laplacian: size * relative(&|e, c| e.laplacian[c].abs(), &|e, c| e.strength[c]),
                error_points: beyond.len(),
                ..TableReport::default()
            };
            (layer, report)
        })
        .collect()
}

/// Laplacian of the interpolant of each channel, by differences of its gradient over `step` (m), 1/m² per unit.
fn laplacians(table: &PotentialTable, point: &Vec3, step: f64) -> Vec<f64> {
    let n = table.channels;
    let mut sum = vec![0.0; n];
    for axis in 0..3 {
        let side = |sign: f64| {
            let (mut potential, mut gradient) = (vec![0.0; n], vec![Vec3::zeros(); n]);
            let moved = point + Vec3::ith(axis, sign * step);
            table.add(&moved, &mut potential, &mut gradient).then_some(gradient)
        };
        let (Some(above), Some(below)) = (side(1.0), side(-1.0)) else { return vec![0.0; n] };
        for c in 0..n {
            sum[c] += (above[c][axis] - below[c][axis]) / (2.0 * step);
        }
    }
    sum
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
