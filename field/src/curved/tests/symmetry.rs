use faer::Mat;

use super::*;
use crate::symmetry::Symmetry;

/// Order of the group and number of sign-changing mirrors.
fn group(setup: &Setup) -> (usize, u32) {
    let mesh = setup.mesh(3, 1);
    let (points, electrode) = (mesh.points(), mesh.electrode_of_points());
    let wanted = Mat::from_fn(points.len(), mesh.electrodes, |p, e| f64::from(u8::from(electrode[p] as usize == e)));
    let symmetry = Symmetry::find(&points, &electrode, &wanted, setup.ground.as_ref().map(|plane| &plane.normal));
    // Every point belongs to exactly one orbit, and parts of all sectors are the whole.
    let sectors: Vec<u32> = (0..1 << symmetry.mirrors).collect();
    let parts: Vec<Mat<f64>> = sectors.iter().map(|s| symmetry.part(*s, &wanted)).collect();
    for p in 0..points.len() {
        for c in 0..wanted.ncols() {
            let sum: f64 = parts.iter().map(|part| part[(p, c)]).sum();
            assert!((sum - wanted[(p, c)]).abs() < 1e-14);
        }
    }
    let unknowns: usize = sectors.iter().map(|s| symmetry.orbits(*s).1.len()).sum();
    assert!(unknowns * symmetry.order() >= points.len(), "sectors hold all charges");
    (symmetry.order(), symmetry.mirrors)
}

fn rods(electrodes: [[f64; 3]; 4]) -> Setup {
    let rod = || Shape::Rod { radius: 0.1, length: 1.0 };
    electrodes.into_iter().fold(Setup::default(), |setup, center| setup.and(rod(), center, Z))
}

#[test]
fn groups_are_as_large_as_they_can_be() {
    assert_eq!(group(&Setup::one(cube())), (48, 0), "all of a cube");
    assert_eq!(group(&Setup::one(plate(1.0, 1.0))), (16, 0), "of a square, and up to down");
    assert_eq!(group(&Setup::one(plate(1.0, 0.5))), (8, 0), "of a rectangle");
    assert_eq!(group(&Setup::one(sphere(1.0))).1, 0);
    let ground = Some(Plane { point: Vec3::z() * -2.0, normal: Vec3::z() });
    assert_eq!(group(&Setup { ground, ..Setup::one(cube()) }), (8, 0), "up is not down above a plane");
    let rings = Setup::one(ring(1.0, 0.1)).and(ring(1.0, 0.1), [0.0, 0.0, 1.0], Z);
    assert_eq!(group(&rings), (16, 1), "up to down changes the rings' places: one mirror with a sign");
    let aside = Setup::one(ring(1.0, 0.1)).and(ring(1.0, 0.1), [0.2, 0.1, 1.0], Z);
    assert_eq!(
        group(&aside).0,
        1,
        "nothing is left of two rings beside each other, but for turns that are not looked for"
    );
    let tilted = Setup::one(cube()).and(sphere(0.1), [0.7, 0.2, 0.9], Z);
    assert_eq!(group(&tilted).0, 1);
    // Four rods, each an electrode of its own: two mirrors with signs, one up to down without.
    let four = rods([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
    let (order, mirrors) = group(&four);
    assert_eq!(mirrors, 2);
    assert!(order == 8, "exchanges of x and y change electrodes, and are no mirrors: {order}");
}

#[test]
fn a_symmetric_solution_is_the_dense_one() {
    let cases = [
        Setup::one(cube()),
        Setup::one(ring(1.0, 0.1)).and(ring(1.0, 0.1), [0.0, 0.0, 1.0], Z),
        rods([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        Setup::one(ring(1.0, 0.1)).and(plate(1.0, 1.0), [0.0, 0.0, 1.0], Z),
    ];
    for setup in cases {
        let mesh = setup.mesh(4, 0);
        let symmetric = setup.solved_on(&mesh, 1e-6);
        let dense = Setup { dense: true, ..setup.clone() }.solved_on(&mesh, 1e-6);
        assert!(symmetric.symmetry >= 8 && dense.symmetry == 1);
        let largest = dense.charge.values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let apart = symmetric.charge.values.iter().zip(&dense.charge.values);
        let apart = apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest;
        // Integrals of images differ where they are divided the other way round, below the accuracy asked of them.
        assert!(apart < 1e-7, "{apart:.1e}");
        assert!(apart_by(&dense.totals, &symmetric.totals) < 1e-8);
    }
}

#[test]
fn numbers_are_the_same_with_any_number_of_threads() {
    let setup = Setup { dense: true, ..Setup::one(cube()).and(sphere(0.3), [1.0, 0.2, 0.1], Z) };
    let mesh = setup.mesh(4, 1);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| setup.solved_on(&mesh, 1e-4).charge)
    };
    let one = with(1);
    assert!(one.values.len() > 500, "enough for the factorisation to be shared");
    for threads in [2, 3] {
        assert!(one == with(threads), "{threads} threads");
    }
}

#[test]
fn charges_are_read_back_as_they_were_written() {
    let setup = Setup::one(perforated(2.2, Hole::Round, 0.1));
    let charge = setup.solved_on(&setup.mesh(2, 0), 1e-3).charge;
    let back: CurvedCharge = serde_json::from_str(&serde_json::to_string(&charge).unwrap()).unwrap();
    // This text form may lose the last digit of a number.
    let same = back.values.iter().zip(&charge.values).all(|(a, b)| (a - b).abs() <= 4e-16 * b.abs());
    assert!(back.is_whole(1) && same && back.mesh.elements == charge.mesh.elements);
    assert!(!back.is_whole(0), "no electrode to be on");
    let short = CurvedCharge { values: charge.values[1..].to_vec(), ..charge };
    assert!(!short.is_whole(1));
}
