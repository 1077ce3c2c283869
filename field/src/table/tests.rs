//! Splines against the functions they stand for, and where they meet.

use meshes::Vec3;

use super::*;
use octree::Octree;

/// exp(a x + b y) sin(c z) with a² + b² = c²: harmonic, and every derivative is a factor.
const RATES: [f64; 3] = [0.6, 0.8, 1.0];

fn derivatives(p: &Vec3) -> Vec<[f64; PER_NODE]> {
    let grow = (RATES[0] * p.x + RATES[1] * p.y).exp();
    let (sin, cos) = (RATES[2] * p.z).sin_cos();
    let along_z = [sin, RATES[2] * cos, -RATES[2] * RATES[2] * sin];
    let own: [f64; PER_NODE] = std::array::from_fn(|d| {
        RATES[0].powi((d % 3) as i32) * RATES[1].powi((d / 3 % 3) as i32) * grow * along_z[d / 9]
    });
    vec![own, own.map(|x| -2.0 * x)]
}

fn truth(p: &Vec3) -> (f64, Vec3) {
    let own = derivatives(p)[0];
    (own[0], Vec3::new(own[1], own[3], own[9]))
}

fn random() -> impl FnMut() -> f64 {
    let mut state = 7_u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Accuracies that make splines cubic, and of degree five, both in double precision; and cubic in single precision.
const ACCURACIES: [f64; 2] = [5e-5, 1e-6];
const ROUNDED: f64 = 1e-3;

fn kernel(table: &PotentialTable, weights: &[Vec<f64>]) -> Kernel {
    Kernel::new(table, weights)
}

/// Potential and gradient of all channels.
fn at(kernel: &Kernel, points: &[Vec3]) -> (Vec<f64>, Vec<Vec3>) {
    let n = points.len() * kernel.channels();
    let (mut potential, mut gradient, mut left) = (vec![0.0; n], vec![Vec3::zeros(); n], Vec::new());
    kernel.channels_at(points, &mut potential, &mut gradient, &mut left);
    assert!(left.is_empty());
    (potential, gradient)
}

/// Bricks of three sizes.
fn mixed() -> Octree {
    let mut octree = Octree::new(Grid::new(Vec3::repeat(-1.0), Vec3::repeat(1.0), 0.4));
    for point in [Vec3::new(0.1, 0.1, 0.1), Vec3::new(0.12, 0.11, 0.15)] {
        let mut marked = vec![octree.locate(&point).unwrap().0];
        octree.balance(&mut marked);
        marked.into_iter().for_each(|m| octree.halve(m));
    }
    octree
}

#[test]
fn errors_fall_with_the_powers_of_the_degree() {
    for (accuracy, [of_potential, of_field]) in ACCURACIES.into_iter().zip([[4.0, 3.0], [6.0, 5.0]]) {
        check_order(accuracy, of_potential, of_field);
    }
}

fn check_order(accuracy: f64, of_potential: f64, of_field: f64) {
    let mut next = random();
    let points: Vec<Vec3> = (0..500).map(|_| Vec3::from_fn(|_, _| 2.0 * next() - 1.0)).collect();
    let errors = [4, 8].map(|bricks| {
        let grid = Grid::new(Vec3::repeat(-1.0), Vec3::repeat(1.0), 2.0 / f64::from(bricks));
        let table = PotentialTable::of_function(grid, 2, accuracy, derivatives);
        let (potential, gradient) = at(&kernel(&table, &[vec![1.0, 0.0]]), &points);
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((0..points.len()).map(|p| of(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt()
        };
        [rms(&|p| potential[p] - truth(&points[p]).0), rms(&|p| (gradient[p] - truth(&points[p]).1).norm())]
    });
    let order = |k: usize| (errors[0][k] / errors[1][k]).log2();
    let far = (order(0) - of_potential).abs().max((order(1) - of_field).abs());
    assert!(far < 0.25, "orders {} and {} of {errors:?}", order(0), order(1));
    if of_potential < 5.0 {
        // δ⁴/384 Σ ∂⁴φ with δ = 1/16, where the three fourth derivatives add up to 1.54 times 4.1 at most.
        assert!(errors[1][0] < 2.5e-7, "{:e}", errors[1][0]);
    } else {
        // (1/4)³ h⁶ Σ ∂⁶φ/720 with h = 1/4, where they add up to 1.31 times 4.1 at most.
        assert!(errors[1][0] < 2.9e-8, "{:e}", errors[1][0]);
    }
}

#[test]
fn bricks_join_smoothly() {
    for accuracy in ACCURACIES {
        check_faces(accuracy);
    }
}

fn check_faces(accuracy: f64) {
    let octree = mixed();
    assert!(octree.whole().any(|(_, brick)| brick.level == 2));
    let table = PotentialTable::of_bricks(octree, 2, accuracy, derivatives);
    let kernel = kernel(&table, &[vec![1.0, 0.0]]);
    let mut next = random();
    // On both sides of faces between bricks, of one size and of different sizes: potential and field go on, and the field's
    // slope does.
    let mut different = 0;
    let whole: Vec<Brick> = table.octree.whole().map(|(_, brick)| *brick).collect();
    for brick in whole {
        for axis in 0..3 {
            let mut part = [next(), next(), next()];
            part[axis] = 1.0;
            let face = table.octree.point(&brick, part);
            let step = Vec3::ith(axis, 1e-5);
            let points: Vec<Vec3> = [-2.0, -1.0, 1.0, 2.0].iter().map(|s| face + step * *s).collect();
            let Some((beyond, _)) = table.octree.locate(&points[3]) else { continue };
            different += usize::from(table.octree.all()[beyond].level != brick.level);
            let (potential, gradient) = at(&kernel, &points);
            // Second derivatives are below 3, and third ones jump by less than 10: 1e-9 over these distances.
            let slope = (gradient[1] + gradient[2]).dot(&step);
            assert!((potential[2] - potential[1] - slope).abs() < 1e-13, "potential at {face:?}");
            let ahead = gradient[3] - gradient[2];
            let behind = gradient[1] - gradient[0];
            assert!((ahead - behind).norm() < 3e-9, "slopes of the field at {face:?}: {ahead:?} {behind:?}");
            let middle = 0.5 * (ahead + behind);
            assert!((gradient[2] - gradient[1] - 2.0 * middle).norm() < 3e-9, "field at {face:?}");
        }
    }
    assert!(different > 50, "{different}");
}

/// Potentials and fields of both precisions at random points of bricks of three sizes: their largest differences, and the largest
/// field.
#[test]
fn single_precision_is_enough() {
    let [rounded, double] = [ROUNDED, ACCURACIES[0]].map(|accuracy| {
        let table = PotentialTable::of_bricks(mixed(), 2, accuracy, derivatives);
        kernel(&table, &[vec![1.0, 0.0], vec![0.0, 1.0]])
    });
    assert!(2 * rounded.bytes() < double.bytes() * 11 / 10);
    let mut next = random();
    let points: Vec<Vec3> = (0..2000).map(|_| Vec3::from_fn(|_, _| 2.0 * next() - 1.0)).collect();
    let ((potential, gradient), (exact, exact_gradient)) = (at(&rounded, &points), at(&double, &points));
    let off = potential.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let field_off = gradient.iter().zip(&exact_gradient).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    // Within 0.2 of the middle of the largest bricks, the potential of the second channel leaves its plane by less than
    // 2 · 4.1 · 0.2² · 3/2 = 0.5. Weights of splines add up to 1, and those of their slopes to 1.5 per cell along each axis.
    let rounding = 0.5 * f64::from(f32::EPSILON) / 2.0;
    assert!(off > 0.0 && off < rounding, "{off:e} {rounding:e}");
    assert!(field_off < 1.5 * 3.0_f64.sqrt() * rounding / 0.1, "{field_off:e}");
    let strongest = exact_gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
    assert!(field_off < 1e-3 * kernel::SINGLE * strongest, "{field_off:e} of {strongest}");
}

#[test]
fn sums_of_channels_are_sums() {
    for accuracy in [ROUNDED, ACCURACIES[0], ACCURACIES[1]] {
        check_sums(accuracy);
    }
}

fn check_sums(accuracy: f64) {
    let table = PotentialTable::of_bricks(mixed(), 2, accuracy, derivatives);
    let kernel = kernel(&table, &[vec![1.0, 0.0], vec![0.5, 1.0], vec![0.0, 0.1]]);
    let mut next = random();
    let points: Vec<Vec3> = (0..100).map(|_| Vec3::from_fn(|_, _| 2.0 * next() - 1.0)).collect();
    let factors: Vec<f64> = (0..300).map(|_| next()).collect();
    let (potential, gradient) = at(&kernel, &points);
    let (mut sum, mut slope, mut left) = (vec![0.0; 100], vec![Vec3::zeros(); 100], Vec::new());
    kernel.sum_at(&points, &factors, &mut sum, &mut slope, &mut left);
    for p in 0..100 {
        let own = |c: usize| factors[3 * p + c];
        let expected: f64 = (0..3).map(|c| own(c) * potential[3 * p + c]).sum();
        let expected_slope: Vec3 = (0..3).map(|c| gradient[3 * p + c] * own(c)).sum();
        assert!((sum[p] - expected).abs() < 1e-14 && (slope[p] - expected_slope).norm() < 1e-13);
    }
}

#[test]
fn a_table_that_lies_is_not_whole() {
    let table = PotentialTable::of_bricks(mixed(), 2, 1e-3, derivatives);
    assert!(table.is_whole());
    let mut short = table.clone();
    short.nodes.truncate(short.nodes.len() - 2 * PER_NODE);
    assert!(!short.is_whole());
}

#[test]
fn points_outside_are_left() {
    let table = PotentialTable::of_bricks(mixed(), 2, 1e-3, derivatives);
    let kernel = kernel(&table, &[vec![1.0, 0.0]]);
    let points = [Vec3::zeros(), Vec3::repeat(1.1), Vec3::repeat(f64::NAN), Vec3::repeat(1.0)];
    let (mut potential, mut gradient, mut left) = (vec![0.0; 4], vec![Vec3::zeros(); 4], Vec::new());
    kernel.channels_at(&points, &mut potential, &mut gradient, &mut left);
    assert_eq!(left, [1, 2]);
}

#[test]
fn a_box_too_long_for_its_cells_is_refused() {
    let ball = meshes::triangulate_to(&meshes::Shape::Sphere { radius: 1.0 }, 80).unwrap().0;
    let basis =
        crate::BoundaryProblem::new(&meshes::SurfaceMesh::assemble([("ball".to_owned(), ball)])).solve().unwrap();
    let (min, max) = (Vec3::new(2.0, -1e-6, -1e-6), Vec3::new(12.0, 1e-6, 1e-6));
    let options = TableOptions { min, max, accuracy: 1e-3, spacing: Some(1e-6), max_bytes: u64::MAX, smooth: false };
    let refused = tabulate(&basis, &options, &|_| ()).unwrap_err();
    let TableError::TooFine { cells, most, spacing_that_fits } = refused else { panic!("{refused}") };
    assert!(cells > most && (10.0 / spacing_that_fits) < most as f64, "{refused}");
}
