use meshes::{SurfaceMesh, triangulate};

use super::*;
use crate::{BasisField, ElectrodeBasis, Samples, TableOptions, TabulatedField, tabulate};

#[test]
fn a_table_is_the_sum_that_it_was_filled_from() {
    let setup = Setup::one(ring(1.0, 0.1)).and(plate(1.0, 1.0), [0.1, 0.0, 0.6], [0.2, 0.0, 1.0]);
    let solution = setup.solved_on(&setup.mesh(4, 0), 1e-5);
    let parts =
        setup.shapes.iter().enumerate().map(|(k, (shape, placement))| {
            (k.to_string(), triangulate(shape, 0.5).unwrap().placed(placement).unwrap())
        });
    let mesh = SurfaceMesh::assemble(parts);
    let basis = ElectrodeBasis::from_curved(mesh, Vec::new(), None, solution.clone());
    let options = TableOptions {
        min: Vec3::repeat(-0.4),
        max: Vec3::repeat(0.3),
        accuracy: 1e-3,
        spacing: None,
        max_bytes: 1 << 27,
        smooth: false,
    };
    let (table, report) = tabulate(&basis, &options, &|_| ()).unwrap();
    assert!(report.error() <= 1e-3, "{report:?}");
    let field = TabulatedField::combined(&basis, &table, &[vec![1.0, 0.0], vec![0.0, 1.0]]);
    let points: Vec<Vec3> =
        (1..50).map(|k| Vec3::new(0.137, 0.291, 0.553).map(|x| (x * f64::from(k)).fract() * 0.68 - 0.39)).collect();
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let exact = solution.sample(&points);
    let strongest = exact.gradient.iter().map(Vec3::norm).fold(0.0, f64::max);
    for k in 0..2 * points.len() {
        // The table is asked for 1e-3 of the field and a tenth of that of the potential, and judges itself at other points.
        assert!((samples.potential[k] - exact.potential[k]).abs() < 2e-4);
        assert!((samples.gradient[k] - exact.gradient[k]).norm() < 2e-3 * strongest);
    }
}
