//! Matrix entries, solved unknowns, points of the exact sum and of the table a second: `cargo bench -p graintrap-field`.
//!
//! On as many threads as the machine has, but for points of fields, which an implementation finds on one. Two rings of
//! radius 1, 2 apart; a table in the cube between them. Ratios of rates are good within one run.

use std::sync::LazyLock;

use divan::{Bencher, counter::ItemsCount};
use field::influence::{Testing, galerkin, potential_coefficients};
use field::linear_operator::GalerkinOperator;
use field::panel::{Panel, brute_force, quadrature};
use field::{
    BasisField, BoundaryProblem, ElectrodeBasis, LinearOperator, PotentialTable, Samples, TableOptions, TabulatedField,
    tabulate,
};
use meshes::{Placement, Shape, SurfaceMesh, Vec3, triangulate_to};

fn main() {
    divan::main();
}

/// Panels of each ring in the benchmarks of fields and tables: 2000 together.
const EACH: usize = 1000;

fn rings(each: usize) -> SurfaceMesh {
    let ring = Shape::Ring { radius: 1.0, wire_radius: 0.05 };
    let part = |name: &str, z: f64| {
        let placement = Placement { center: Vec3::z() * z, ..Placement::default() };
        let mesh = triangulate_to(&ring, each).expect("the ring can be").0;
        (name.to_string(), mesh.placed(&placement).expect("it has a direction"))
    };
    SurfaceMesh::assemble([part("below", -1.0), part("above", 1.0)])
}

fn panels(each: usize) -> Vec<Panel> {
    let mesh = rings(each);
    (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect()
}

static BASIS: LazyLock<ElectrodeBasis> =
    LazyLock::new(|| BoundaryProblem::new(&rings(EACH)).solve().expect("sound rings"));

/// Cells of the table along each side.
const CELLS: usize = 32;

fn tabulated(cells: usize) -> PotentialTable {
    let half = 0.6;
    let (min, max) = (Vec3::repeat(-half), Vec3::repeat(half));
    let spacing = Some(2.0 * half / cells as f64);
    let options = TableOptions { min, max, accuracy: 1e-4, spacing, max_bytes: 1 << 32, smooth: false };
    tabulate(&BASIS, &options, &|_| ()).expect("a small table").0
}

static TABLE: LazyLock<PotentialTable> = LazyLock::new(|| tabulated(CELLS));

/// Points in the table's box, in the order of a space that is not that of memory.
fn points(count: usize) -> Vec<Vec3> {
    // The additive recurrence of the plastic number: even and without order.
    let step = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_6];
    (0..count).map(|k| Vec3::from_fn(|i, _| 1.2 * ((k as f64 * step[i]).fract() - 0.5))).collect()
}

/// Items: entries of the whole matrix, of which Galerkin testing computes half.
#[divan::bench(args = [500, 1000], sample_count = 5)]
fn assembly_galerkin(bencher: Bencher, each: usize) {
    assembly(bencher, each, Testing::Galerkin);
}

/// Items: entries of the matrix.
#[divan::bench(args = [500, 1000], sample_count = 5)]
fn assembly_collocation(bencher: Bencher, each: usize) {
    assembly(bencher, each, Testing::Collocation);
}

fn assembly(bencher: Bencher, each: usize, testing: Testing) {
    let panels = panels(each);
    bencher.counter(ItemsCount::new(panels.len().pow(2))).bench(|| potential_coefficients(&panels, testing));
}

/// The judge of both matrices: entries on one thread, the inner integral by brute force, the outer by a rule. Items: entries.
#[divan::bench(sample_count = 5)]
fn entries_by_quadrature(bencher: Bencher) {
    let panels = panels(EACH);
    // One panel against a hundred others, near and far.
    let others: Vec<&Panel> = panels.iter().step_by(panels.len() / 100).skip(1).collect();
    let entry = |other: &&Panel| -> f64 {
        let outer = quadrature::rule(12).on(&panels[0].corners);
        outer.map(|(x, weight)| weight * brute_force::potential_and_gradient(other, &x).0).sum::<f64>() / other.area
    };
    bencher.counter(ItemsCount::new(others.len())).bench(|| others.iter().map(entry).sum::<f64>());
}

/// The same entries as Galerkin testing computes them, on one thread. Items: entries.
#[divan::bench]
fn entries_galerkin(bencher: Bencher) {
    let panels = panels(EACH);
    let others: Vec<&Panel> = panels.iter().step_by(panels.len() / 100).skip(1).collect();
    bencher
        .counter(ItemsCount::new(others.len()))
        .bench(|| others.iter().map(|other| galerkin(&panels[0], other, false)).sum::<f64>());
}

/// The matrix applied without being stored: an iteration of a solver that keeps none. Items: entries.
#[divan::bench(sample_count = 5)]
fn apply_without_matrix(bencher: Bencher) {
    let panels = panels(500);
    let (x, mut y) = (vec![1.0; panels.len()], vec![0.0; panels.len()]);
    let operator = GalerkinOperator { panels: &panels };
    bencher.counter(ItemsCount::new(panels.len().pow(2))).bench_local(|| operator.apply(&x, &mut y));
}

/// A whole solution by Cholesky: matrix, factors, two right-hand sides, residual; less the assembly above it is the cost of
/// the factors. Items: unknowns.
#[divan::bench(args = [500, 1000], sample_count = 5)]
fn solve_galerkin(bencher: Bencher, each: usize) {
    solve(bencher, each, Testing::Galerkin);
}

/// The same by LU on the collocation matrix. Items: unknowns.
#[divan::bench(args = [500, 1000], sample_count = 5)]
fn solve_collocation(bencher: Bencher, each: usize) {
    solve(bencher, each, Testing::Collocation);
}

fn solve(bencher: Bencher, each: usize, testing: Testing) {
    let mesh = rings(each);
    let problem = BoundaryProblem { testing, ..BoundaryProblem::new(&mesh) };
    bencher.counter(ItemsCount::new(mesh.panels())).bench(|| problem.solve());
}

/// One panel's potential and gradient at a point near by, in closed form, on one thread. Items: points.
#[divan::bench]
fn one_panel_in_closed_form(bencher: Bencher) {
    let panel = panels(EACH)[0];
    let x = panel.centroid + panel.normal * panel.radius;
    bencher.counter(ItemsCount::new(1_u32)).bench(|| divan::black_box(&panel).potential_and_gradient(&x));
}

/// Both channels at points of the exact sum over 1920 and 3584 panels, on one thread. Items: points.
#[divan::bench(args = [1000, 1800])]
fn points_of_the_exact_sum(bencher: Bencher, each: usize) {
    let field = BoundaryProblem::new(&rings(each)).solve().expect("sound rings").panel_sum();
    sample(bencher, &field, &points(50));
}

/// The same, a wire radius off the wires. Items: points.
#[divan::bench(args = [1000, 1800])]
fn points_of_the_exact_sum_beside_wires(bencher: Bencher, each: usize) {
    let field = BoundaryProblem::new(&rings(each)).solve().expect("sound rings").panel_sum();
    let beside = |k: usize| {
        let (sin, cos) = (k as f64).sin_cos();
        Vec3::new(1.1 * cos, 1.1 * sin, if k.is_multiple_of(2) { 1.0 } else { -1.0 })
    };
    sample(bencher, &field, &(0..50).map(beside).collect::<Vec<_>>());
}

/// Both channels at points of the table, on one thread. Items: points.
#[divan::bench]
fn points_of_the_table(bencher: Bencher) {
    let field = TabulatedField::combined(&BASIS, &TABLE, &[vec![1.0, 0.0], vec![0.0, 1.0]]);
    sample(bencher, &field, &points(10_000));
}

fn sample(bencher: Bencher, field: &dyn BasisField, points: &[Vec3]) {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let mut samples = Samples::default();
    bencher
        .counter(ItemsCount::new(points.len()))
        .bench_local(|| one_thread.install(|| field.sample(points, &mut samples)));
}

/// Filling a table and measuring its error. Items: nodes, each with 27 derivatives of both channels.
#[divan::bench(args = [16, 32, 64], sample_count = 3)]
fn table_fill(bencher: Bencher, cells: usize) {
    let nodes = (cells + 1).pow(3);
    LazyLock::force(&BASIS);
    bencher.counter(ItemsCount::new(nodes)).bench(|| tabulated(cells));
}
