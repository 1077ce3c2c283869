//! Grains that the electrodes attract by the charges they induce there.

use std::sync::Arc;

use field::constants::COULOMB;
use field::{Induction, Plane};
use meshes::{Placement, Shape, SurfaceMesh, Vec3, triangulate_to};
use tracer::{Ensemble, Grain, ImageCharge, Options, Outcome, Region, System, trace};

fn grain(position: Vec3, velocity: Vec3) -> Ensemble {
    let mut grains = Ensemble::new();
    let grain = Grain { position, velocity, charge: 1e-12, mass: 1e-9, radius: 0.0, id: 0, group: 0 };
    grains.push(grain).unwrap();
    grains
}

fn attracted(induction: Induction) -> System {
    System::new().with_force(ImageCharge { induction: Arc::new(induction) })
}

/// A grain at rest at the height h above a plane falls towards its image, m z'' = -k Q² / (4 z²): with z = h cos² s
///
///   t = sqrt(2 m h³ / (k Q²)) (s + sin s cos s),
///
/// Kepler's radial fall.
#[test]
fn exact_image_charge_of_a_plane() {
    let plane = Plane { point: Vec3::zeros(), normal: Vec3::z() };
    let system = attracted(Induction::new(&SurfaceMesh::assemble([]), Some(plane), &[]).unwrap());
    let (height, end) = (0.1_f64, 0.02_f64);
    let strength = COULOMB * 1e-24 / (4.0 * 1e-9);
    let scale = (height.powi(3) / (2.0 * strength)).sqrt();
    let s = (end / height).sqrt().acos();
    let time = scale * (s + s.sin() * s.cos());
    let region = Region { min: Vec3::new(-1.0, -1.0, end), max: Vec3::repeat(1.0) };
    let options = Options { duration: 2.0 * time, tolerance: 1e-11, ..Options::default() };
    let fallen =
        trace(&system.with_region(region), &grain(Vec3::z() * height, Vec3::zeros()), &options, &tracer::Nothing);
    let ending = fallen.unwrap().endings[0];
    assert!(matches!(ending.outcome, Outcome::LeftRegion { .. }), "{ending:?}");
    assert!((ending.time / time - 1.0).abs() < 1e-9, "{} {time}", ending.time);
}

/// Past a grounded sphere a grain keeps energy and angular momentum, in the field of its image:
/// W = -½ k Q² R / (D² - R²).
#[test]
fn exact_image_charge_of_a_sphere() {
    let (ball, _) = triangulate_to(&Shape::Sphere { radius: 0.01 }, 1000).unwrap();
    let mesh = SurfaceMesh::assemble([("ball".to_owned(), ball.placed(&Placement::default()).unwrap())]);
    let system = attracted(Induction::new(&mesh, None, &[false]).unwrap());
    let start = Vec3::new(0.03, 0.004, 0.002);
    let speed = 0.1;
    let grains = grain(start, Vec3::new(-speed, 0.12, 0.05) * 0.1);
    let options = Options { duration: 0.8, every: Some(0.02), ..Options::default() };
    let tracks = tracer::Trajectories::default();
    trace(&system, &grains, &options, &tracks).unwrap();
    let samples = &tracks.into_samples()[0];
    let kinetic = |v: &Vec3| 0.5e-9 * v.norm_squared();
    let image = |r: &Vec3| -0.5 * COULOMB * 1e-24 * 0.01 / (r.norm_squared() - 1e-4);
    let whole = kinetic(&samples[0].velocity) + samples[0].potential_energy;
    let turning = samples[0].position.cross(&samples[0].velocity);
    let nearest = samples.iter().map(|s| s.position.norm()).fold(f64::INFINITY, f64::min);
    println!("nearest {nearest}");
    assert!(nearest < 0.025 && nearest > 0.012, "{nearest}");
    for s in samples {
        let energy = kinetic(&s.velocity) + s.potential_energy;
        // The force is the exact gradient: what is left is the error of the steps.
        assert!((energy - whole).abs() < 1e-9 * whole.abs().max(kinetic(&s.velocity)), "{energy} {whole}");
        // The panels' errors: a thousand are 0.11 radii wide, and the gap is 2 of them at least.
        assert!((s.potential_energy / image(&s.position) - 1.0).abs() < 5e-3);
        let turn = s.position.cross(&s.velocity);
        assert!((turn - turning).norm() < 1e-3 * turning.norm(), "{turn} {turning}");
    }
}
