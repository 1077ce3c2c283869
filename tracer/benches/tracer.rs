//! Grain-steps, Coulomb pairs and strike tests a second, on one core: `cargo bench -p graintrap-tracer`.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use divan::{Bencher, counter::ItemsCount};
use field::{BasisField, DrivenField, Samples, Waveform, WaveformPart};
use meshes::{ElectrodeSurface, SurfaceMesh, SurfaceTree, Vec3};
use tracer::{Batch, Coulomb, Drag, Ensemble, Force, Grain, Method, Nothing, Options, Scratch, System, trace};

fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("no pool has been used yet");
    divan::main();
}

/// φ = (x² + y² - 2 z²) / 2 at 1 V.
struct Quadrupole;

impl BasisField for Quadrupole {
    fn channels(&self) -> usize {
        1
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        samples.reset(points.len(), 1);
        for (p, r) in points.iter().enumerate() {
            let gradient = Vec3::new(r.x, r.y, -2.0 * r.z);
            samples.potential[p] = 0.5 * gradient.dot(r);
            samples.gradient[p] = gradient;
        }
    }
}

fn paul_trap() -> System {
    let parts = vec![WaveformPart::Sine { amplitude: -0.4, frequency: 2.0 / TAU, phase: 0.0 }];
    System::new().with_field(DrivenField::new(Arc::new(Quadrupole), vec![Waveform { constant: 0.0, parts }]))
}

fn cloud(count: usize) -> Ensemble {
    let mut ensemble = Ensemble::new();
    for k in 0..count {
        let angle = k as f64;
        let position = Vec3::new(angle.cos(), angle.sin(), (2.3 * angle).cos()) * 0.3;
        let grain =
            Grain { position, velocity: position * 0.1, charge: 1.0, mass: 1.0, radius: 0.0, id: k as u64, group: 0 };
        ensemble.push(grain).expect("a sound grain");
    }
    ensemble
}

fn options(method: Method) -> Options {
    Options { method, duration: 10.0 * PI, step: Some(PI / 50.0), estimate_error: false, ..Options::default() }
}

/// Items: steps of single grains that were accepted.
fn steps(bencher: Bencher, system: &System, method: Method) {
    let grains = cloud(256);
    let options = options(method);
    let count = trace(system, &grains, &options, &Nothing).expect("a sound run").accepted;
    bencher.counter(ItemsCount::new(count)).bench(|| trace(system, &grains, &options, &Nothing));
}

#[divan::bench(args = [Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6])]
fn steps_in_a_paul_trap(bencher: Bencher, method: Method) {
    steps(bencher, &paul_trap(), method);
}

#[divan::bench(args = [Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6])]
fn steps_with_drag_and_magnetic_field(bencher: Bencher, method: Method) {
    let system = paul_trap().with_drag(Drag::Rate(0.01)).with_magnetic_field(Vec3::new(0.0, 0.1, 0.3));
    steps(bencher, &system, method);
}

#[divan::bench]
fn steps_with_noise(bencher: Bencher) {
    let system = paul_trap().with_drag(Drag::Rate(0.1)).with_noise(1e-3 / tracer::constants::BOLTZMANN);
    steps(bencher, &system, Method::Langevin);
}

/// A sphere of radius 5 around all flights: 20 000 panels, none within reach.
fn shell() -> SurfaceTree {
    let mut mesh = SurfaceMesh::default();
    let (rings, sectors) = (100_u32, 100_u32);
    for i in 0..=rings {
        for j in 0..sectors {
            let (theta, phi) = (PI * f64::from(i) / f64::from(rings), TAU * f64::from(j) / f64::from(sectors));
            mesh.vertices.push(Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * 5.0);
        }
    }
    for i in 0..rings {
        for j in 0..sectors {
            let at = |i: u32, j: u32| i * sectors + j % sectors;
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            mesh.electrode.extend([0, 0]);
        }
    }
    mesh.electrodes.push(ElectrodeSurface { name: "shell".into(), closed: false, hollow: true });
    SurfaceTree::new(&mesh)
}

#[divan::bench(args = [Method::Dop853, Method::Verlet])]
fn steps_far_from_surfaces(bencher: Bencher, method: Method) {
    steps(bencher, &paul_trap().with_surface(Arc::new(shell())), method);
}

/// Items: ordered pairs.
#[divan::bench(args = [100, 1000, 4000])]
fn coulomb_pairs(bencher: Bencher, count: usize) {
    coulomb(bencher, count, |batch, force| Coulomb::default().add(batch, &mut Scratch::default(), force));
}

#[divan::bench(args = [1000])]
fn coulomb_pairs_slow(bencher: Bencher, count: usize) {
    coulomb(bencher, count, tracer::force::coulomb::slow_coulomb);
}

fn coulomb(bencher: Bencher, count: usize, add: impl Fn(&Batch, &mut [Vec3]) + Sync) {
    let grains = cloud(count);
    let time = vec![0.0; count];
    let batch = Batch {
        position: grains.positions(),
        velocity: grains.velocities(),
        time: &time,
        charge: grains.charges(),
        mass: grains.masses(),
        radius: grains.radii(),
        id: grains.ids(),
    };
    let mut force = vec![Vec3::zeros(); count];
    bencher.counter(ItemsCount::new(count * count)).bench_local(|| add(&batch, &mut force));
}
