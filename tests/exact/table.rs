//! The table against the exact panel sum.

use field::{
    BasisField, BoundaryProblem, CELLS_PER_BRICK, ElectrodeBasis, PotentialTable, Samples, TableOptions,
    TabulatedField, tabulate,
};
use graintrap_tests::{at, random, several};
use meshes::{GridPattern, Outline, Placement, Shape, SurfaceMesh, Vec3, Weave};

struct Geometry {
    name: &'static str,
    mesh: SurfaceMesh,
    half: f64,
}

fn geometries() -> Vec<Geometry> {
    let along_x = |x: f64| Placement { center: Vec3::x() * x, axis: Vec3::x(), up: None };
    let ring = Shape::Ring { radius: 1.0, wire_radius: 0.02 };
    let cap = Shape::EndCap { radius: 0.6, opening: 1.2, thickness: 0.0 };
    vec![
        Geometry {
            name: "two thin rings",
            mesh: several(&[(ring.clone(), along_x(-1.0), 400), (ring, along_x(1.0), 400)]),
            half: 1.2,
        },
        Geometry {
            name: "sphere and bowl",
            mesh: several(&[
                (Shape::Sphere { radius: 0.2 }, at(Vec3::new(0.1, 0.0, 0.0)), 400),
                (cap, at(Vec3::z() * 0.3), 500),
            ]),
            half: 1.0,
        },
    ]
}

#[test]
fn exact_table_at_a_64th_of_the_region() {
    for Geometry { name, mesh, half } in geometries() {
        let basis = BoundaryProblem::new(&mesh).solve().unwrap();
        let (min, max, spacing) = (Vec3::repeat(-half), Vec3::repeat(half), half / 32.0);
        let options =
            TableOptions { min, max, accuracy: 1e-4, spacing: Some(spacing), max_bytes: 1 << 30, smooth: false };
        let (table, report) = tabulate(&basis, &options, &|_| ()).unwrap();
        assert_eq!(table.grid().cells.map(|n| n * CELLS_PER_BRICK), [64; 3]);
        let exact = basis.panel_sum();
        // Points of their own, at least two cells away from every conductor.
        let mut next = random(1);
        let mut points = Vec::new();
        while points.len() < 1000 {
            let p = Vec3::from_fn(|_, _| half * (2.0 * next() - 1.0));
            if exact.tree().nearest(&p, 2.0 * spacing).is_none() && exact.inside(&p).is_none() {
                points.push(p);
            }
        }
        let (mut truth, mut got) = (Samples::default(), Samples::default());
        exact.sample(&points, &mut truth);
        let identity = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
        TabulatedField::combined(&basis, &table, &identity).sample(&points, &mut got);
        let largest = |f: &dyn Fn(usize) -> f64| (0..got.potential.len()).map(f).fold(0.0, f64::max);
        let potential = largest(&|k| (got.potential[k] - truth.potential[k]).abs());
        let strongest = largest(&|k| truth.gradient[k].norm());
        let field = largest(&|k| (got.gradient[k] - truth.gradient[k]).norm()) / strongest;
        println!("{name}: potential {potential:.1e} V per V, field {field:.1e} of the strongest; reported {report:?}");
        // The goals.
        assert!(potential < 1e-5, "{name}: potential {potential:e}");
        assert!(field < 1e-4, "{name}: field {field:e}");
        // The reported error stands for cells nearer to conductors than these points, too: never less than half of what
        // is found here, and within the accuracy asked for.
        assert!(report.field_error > 0.5 * field && report.error() <= 1e-4, "{name}: reported {}", report.field_error);
    }
}

#[test]
fn exact_table_outside_and_next_to_conductors() {
    let Geometry { mesh, .. } = geometries().swap_remove(1);
    let basis = BoundaryProblem::new(&mesh).solve().unwrap();
    let options = TableOptions {
        min: Vec3::repeat(-0.5),
        max: Vec3::repeat(0.5),
        accuracy: 1e-3,
        spacing: Some(0.05),
        max_bytes: 1 << 30,
        smooth: false,
    };
    let (table, _) = tabulate(&basis, &options, &|_| ()).unwrap();
    let field = TabulatedField::combined(&basis, &table, &[vec![2.0, -1.0]]);
    let exact = basis.combined(&[vec![2.0, -1.0]]);
    // Outside the table; a hair off the sphere; inside it.
    let points = [Vec3::new(0.8, 0.1, -0.3), Vec3::new(0.1, 0.0, 0.203), Vec3::new(0.1, 0.05, 0.0)];
    let (mut a, mut b) = (Samples::default(), Samples::default());
    field.sample(&points, &mut a);
    exact.sample(&points, &mut b);
    assert_eq!(a, b, "what the table does not cover is exact to the bit");
    assert_eq!((a.potential[2], a.gradient[2]), (2.0, Vec3::zeros()), "inside the sphere");
}

/// Largest error of the field of a table with all basis functions driven, relative to the strongest at these points.
fn field_error(basis: &ElectrodeBasis, table: &PotentialTable, points: &[Vec3]) -> f64 {
    let volts: Vec<f64> = (0..basis.functions()).map(|k| 1.0 - 0.7 * k as f64).collect();
    let (mut truth, mut got) = (Samples::default(), Samples::default());
    basis.combined(std::slice::from_ref(&volts)).sample(points, &mut truth);
    TabulatedField::combined(basis, table, &[volts]).sample(points, &mut got);
    let strongest = truth.gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
    let apart = truth.gradient.iter().zip(&got.gradient).map(|(a, b)| (a - b).norm());
    apart.fold(0.0, f64::max) / strongest
}

#[test]
fn exact_table_of_a_grid_plate_has_small_cells_where_they_count() {
    // Wires 0.2 apart between two plates 1.2 apart: the field varies on the scale of the wires beside them, on that of the gaps
    // elsewhere.
    let outline = Outline::Rectangle([1.0, 1.0]);
    let wires = GridPattern::Wires { weave: Weave::Parallel, wire_radius: 0.02 };
    let grid = Shape::GridPlate { outline, pitch: 0.2, pattern: wires };
    let plate = Shape::Plate { size: [1.0, 1.0], thickness: 0.0 };
    let mesh = several(&[
        (plate.clone(), at(-0.6 * Vec3::z()), 200),
        (grid, at(Vec3::zeros()), 600),
        (plate, at(0.6 * Vec3::z()), 200),
    ]);
    let basis = BoundaryProblem::new(&mesh).solve().unwrap();
    let (min, max) = (Vec3::new(-0.4, -0.4, -0.5), Vec3::new(0.4, 0.4, 0.5));
    let options = TableOptions { min, max, accuracy: 1e-3, spacing: None, max_bytes: 1 << 29, smooth: false };
    let (small, report) = tabulate(&basis, &options, &|_| ()).unwrap();
    // A table of cells of one size with no fewer nodes, held to nothing: its layer is as thin as can be.
    let mut spacing = 0.1;
    while PotentialTable::bricks_for(min, max, spacing).nodes() < report.nodes {
        spacing *= 0.97;
    }
    let options = TableOptions { accuracy: 0.5, spacing: Some(spacing), ..options };
    let (uniform, other) = tabulate(&basis, &options, &|_| ()).unwrap();
    // Everywhere outside of the wires: what a table leaves to the exact sum is no error, but it is the dear part of the space.
    let mut next = random(11);
    let mut any = std::iter::repeat_with(|| Vec3::from_fn(|k, _| min[k] + next() * (max[k] - min[k])));
    let exact = basis.panel_sum();
    let free: Vec<Vec3> = any.by_ref().filter(|p| exact.inside(p).is_none()).take(20_000).collect();
    let left = |table: &PotentialTable| free.iter().filter(|p| !table.covers(p)).count();
    let both: Vec<Vec3> = free.iter().filter(|p| small.covers(p) && uniform.covers(p)).take(3000).copied().collect();
    let (a, b) = (field_error(&basis, &small, &both), field_error(&basis, &uniform, &both));
    println!("bricks {report:?}\nuniform {other:?}");
    println!(
        "fields off by {a:.1e} and {b:.1e}; left to the exact sum {} and {} of 20000",
        left(&small),
        left(&uniform)
    );
    assert!(report.error() <= 1e-3 && a < 1e-3, "{a:e}, {report:?}");
    // Bricks round on their own, in single precision at this accuracy: less than the whole unit beside their planes.
    assert!(report.finest_spacing < 0.6 * report.spacing && report.jump < 2.0_f64.powi(-24), "{report:?}");
    // As many nodes: better where both are, and less is left to the exact sum.
    assert!(b > 2.0 * a && left(&uniform) > left(&small), "{a:e} {b:e}, {} {}", left(&small), left(&uniform));
}
