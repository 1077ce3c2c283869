//! Grains meet electrodes and the faces of the region where geometry says.

mod common;

use std::sync::Arc;

use common::*;
use meshes::{ElectrodeSurface, SurfaceMesh, SurfaceTree, Vec3};
use tracer::{Drag, Ending, Method, Options, Outcome, Region, System};

/// A mesh of triangles, one electrode for each list.
fn mesh(electrodes: &[(bool, Vec<[Vec3; 3]>)]) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    for (e, (closed, triangles)) in electrodes.iter().enumerate() {
        for t in triangles {
            let base = mesh.vertices.len() as u32;
            mesh.vertices.extend(t);
            mesh.triangles.push([base, base + 1, base + 2]);
            mesh.electrode.push(e as u32);
        }
        mesh.electrodes.push(ElectrodeSurface { name: format!("electrode {e}"), closed: *closed, hollow: false });
    }
    mesh
}

fn tree(electrodes: &[(bool, Vec<[Vec3; 3]>)]) -> Arc<SurfaceTree> {
    Arc::new(SurfaceTree::new(&mesh(electrodes)))
}

/// A square sheet around a centre, spanned by two half sides, cut into n × n squares.
fn sheet(center: Vec3, a: Vec3, b: Vec3, n: usize) -> Vec<[Vec3; 3]> {
    let at =
        |i: usize, j: usize| center + a * (2.0 * i as f64 / n as f64 - 1.0) + b * (2.0 * j as f64 / n as f64 - 1.0);
    let cells = (0..n * n).map(|k| (k / n, k % n));
    cells
        .flat_map(|(i, j)| {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[p, q, r], [p, r, s]]
        })
        .collect()
}

/// A sphere from an octahedron, each triangle cut in four `times` times.
fn sphere(radius: f64, times: u32) -> Vec<[Vec3; 3]> {
    let mut triangles = Vec::new();
    for (x, y, z) in
        [(1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, 1), (1, 1, -1), (-1, 1, -1), (-1, -1, -1), (1, -1, -1)]
    {
        let t = [Vec3::x() * f64::from(x), Vec3::y() * f64::from(y), Vec3::z() * f64::from(z)];
        triangles.push(if x * y * z > 0 { t } else { [t[0], t[2], t[1]] });
    }
    for _ in 0..times {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [d, e, f] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            })
            .collect();
    }
    triangles.into_iter().map(|t| t.map(|p| p * radius)).collect()
}

/// A wire along z, a prism of `sides` sides.
fn wire(at: Vec3, radius: f64, length: f64, sides: usize) -> Vec<[Vec3; 3]> {
    let corner = |k: usize, z: f64| {
        let angle = std::f64::consts::TAU * k as f64 / sides as f64;
        at + v(radius * angle.cos(), radius * angle.sin(), z)
    };
    (0..sides)
        .flat_map(|k| {
            let (p, q) = (corner(k, -length / 2.0), corner(k + 1, -length / 2.0));
            let (r, s) = (corner(k + 1, length / 2.0), corner(k, length / 2.0));
            [[p, q, r], [p, r, s]]
        })
        .collect()
}

fn strike(ending: &Ending) -> (usize, Vec3, Vec3, f64, f64) {
    match ending.outcome {
        Outcome::Struck { electrode, point, normal, energy, speed } => (electrode, point, normal, energy, speed),
        other => panic!("{other:?}"),
    }
}

const ALL: [Method; 5] = [Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6];

#[test]
fn exact_parabola_onto_a_plate() {
    // From (-1, 0, 0.3) with (2, 0, 1) under g = 9: lands on z = 0 at t = (1 + sqrt(1 + 2·9·0.3)) / 9.
    let plate = sheet(v(0.0, 0.0, 0.0), v(3.0, 0.0, 0.0), v(0.0, 3.0, 0.0), 7);
    let system = System::new().with_gravity(v(0.0, 0.0, -9.0)).with_surface(tree(&[(false, plate)]));
    let time = (1.0 + (1.0_f64 + 5.4).sqrt()) / 9.0;
    let point = v(-1.0 + 2.0 * time, 0.0, 0.0);
    let speed = (4.0 + (1.0 - 9.0 * time).powi(2)).sqrt();
    let start = ensemble([grain(v(-1.0, 0.0, 0.3), v(2.0, 0.0, 1.0), 1.0, 0.2)]);
    for method in ALL {
        // Parabolas are flown, and the paths between steps drawn, exactly by all: rounding.
        let options = Options { step: Some(0.17), every: Some(0.1), ..options(method, 5.0) };
        let (tracks, endings) = samples(&system, &start, &options);
        let (electrode, p, normal, energy, u) = strike(&endings[0]);
        assert_eq!((electrode, normal.z.abs()), (0, 1.0));
        assert!((endings[0].time - time).abs() < 1e-13, "{method:?}: {}", endings[0].time - time);
        assert!((p - point).norm() < 1e-13, "{method:?}: {p}");
        assert!((u - speed).abs() < 1e-12 && (energy - 0.1 * speed * speed).abs() < 1e-12, "{method:?}");
        let last = tracks[0].last().unwrap();
        assert_eq!((last.time, last.position), (endings[0].time, p), "the track ends at the plate");
    }
}

#[test]
fn exact_strike_on_a_sheet_at_an_angle_in_a_curved_field() {
    // A harmonic well x'' = -x, x = cos t: a sheet across the way at x = 0.3, tilted; the grain meets it on the path's
    // own time, not the chord's.
    let field = dc(Quadrupole { l: v(1.0, 1.0, 1.0), r0: 1.0 }, 1.0);
    let normal = v(1.0, 0.5, -0.3).normalize();
    let a = normal.cross(&Vec3::y()).normalize() * 0.4;
    let b = normal.cross(&a).normalize() * 0.4;
    let surface = tree(&[(false, sheet(v(0.3, 0.2, 0.0), a, b, 3))]);
    let system = System::new().with_field(field).with_surface(surface);
    let at = |t: f64| v(t.cos(), 0.3 * t.sin(), 0.0);
    // (r(t) - c)·n = 0 by bisection.
    let (mut low, mut high) = (0.5_f64, 2.0_f64);
    while high - low > 1e-15 {
        let t = 0.5 * (low + high);
        if (at(t) - v(0.3, 0.2, 0.0)).dot(&normal) > 0.0 { low = t } else { high = t }
    }
    let start = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.3, 0.0), 1.0, 1.0)]);
    for (method, allowed) in [(Method::Dop853, 1e-11), (Method::BlanesMoan6, 1e-9), (Method::Verlet, 1e-3)] {
        // Dop853 flies here in steps of about 0.2.
        let options = Options { step: Some(0.1), ..options(method, 5.0) };
        let traced = run(&system, &start, &options);
        let (_, p, n, ..) = strike(&traced.endings[0]);
        assert!((traced.endings[0].time - low).abs() < allowed, "{method:?}: {:e}", traced.endings[0].time - low);
        assert!((p - at(low)).norm() < allowed, "{method:?}");
        // In the plane of the sheet, whatever the method.
        assert!((p - v(0.3, 0.2, 0.0)).dot(&n).abs() < 1e-14 && (n.dot(&normal).abs() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn exact_hits_on_a_sphere_at_every_impact_parameter() {
    // A beam along x at a triangulated sphere: grains strike exactly when a straight line does, none slips through.
    let triangles = sphere(0.5, 3);
    let surface = tree(&[(true, triangles)]);
    let mut expected = 0;
    let grains: Vec<_> =
        (0..41 * 41).map(|k| v(-2.0, (k % 41) as f64 * 0.03 - 0.6, (k / 41) as f64 * 0.03 - 0.6)).collect();
    for start in &grains {
        expected += usize::from(surface.first_hit(start, &(start + v(4.0, 0.0, 0.0))).is_some());
    }
    let system = System::new().with_surface(surface);
    let start = ensemble(grains.iter().map(|&r| grain(r, v(1.0, 0.0, 0.0), 1.0, 1.0)));
    // Area of the disc over the area of a cell, to the ragged rim: 2π 0.5/0.03 cells on it, some tenth of them either way.
    let disc = std::f64::consts::PI * 0.25 / (0.03 * 0.03);
    assert!((expected as f64 - disc).abs() < 20.0, "{expected} {disc}");
    for method in ALL {
        for step in [0.013, 4.0] {
            let traced = run(&system, &start, &Options { step: Some(step), ..options(method, 4.0) });
            let mut struck = 0;
            for (ending, r) in traced.endings.iter().zip(&grains) {
                if let Outcome::Struck { point, normal, speed, .. } = ending.outcome {
                    struck += 1;
                    assert!((point.y - r.y).abs() < 1e-12 && (point.z - r.z).abs() < 1e-12);
                    assert!((ending.time - (point.x + 2.0)).abs() < 1e-12 && normal.x < 0.0);
                    assert!((speed - 1.0).abs() < 1e-12);
                }
            }
            assert_eq!(struck, expected, "{method:?} at step {step}");
        }
    }
}

#[test]
fn law_nothing_tunnels_through_a_thin_wire() {
    // A wire of 1 µm, grains at 100 km/s, steps of 10 km, straight and on curved ways.
    let surface = tree(&[(true, wire(v(0.0, 0.0, 0.0), 1e-6, 1.0, 6))]);
    let straight = System::new().with_surface(surface.clone());
    for method in ALL {
        for (miss, hits) in [(0.0, true), (0.8e-6, true), (-0.8e-6, true), (1.1e-6, false)] {
            let start = ensemble([grain(v(-3000.0, miss, 0.0), v(1e5, 0.0, 0.0), 1.0, 1.0)]);
            let traced = run(&straight, &start, &Options { step: Some(0.1), ..options(method, 0.1) });
            let struck = matches!(traced.endings[0].outcome, Outcome::Struck { .. });
            assert_eq!(struck, hits, "{method:?} passing at {miss}");
        }
    }
    // Gyration of radius 1 about (0, -1): through the origin, in steps of a third of a turn.
    let curved = System::new().with_surface(surface).with_magnetic_field(v(0.0, 0.0, 1.0));
    for (offset, hits) in [(0.0, true), (0.7e-6, true), (-0.7e-6, true), (4e-6, false), (-4e-6, false)] {
        // Starts on the far side; r(t) = center + (sin, cos) turned clockwise.
        let start = ensemble([grain(v(0.0, -2.0 - offset, 0.0), v(-1.0, 0.0, 0.0), 1.0, 1.0)]);
        let options = Options { max_step: Some(2.0), tolerance: 1e-7, ..options(Method::Dop853, 5.0) };
        let traced = run(&curved, &start, &options);
        let struck = matches!(traced.endings[0].outcome, Outcome::Struck { .. });
        assert_eq!(struck, hits, "passing at {offset}");
    }
}

#[test]
fn exact_grazing_a_wire() {
    // A grain on the parabola x = t, y = (t² + d)/2 comes within d/2 of the origin; a wire of radius 0.01 with many sides is
    // struck when the parabola meets the circle. Close misses pass.
    let surface = tree(&[(true, wire(v(0.0, 0.0, 0.0), 0.01, 1.0, 400))]);
    let system = System::new().with_gravity(v(0.0, 1.0, 0.0)).with_surface(surface);
    for method in ALL {
        for (distance, hits) in [(0.0099, true), (0.009_999, true), (0.010_001, false), (0.0101, false)] {
            // The polygon lies within 0.01 (1 - cos(π/400)) = 3e-7 of the circle.
            let start = ensemble([grain(v(-1.0, 0.5 + distance, 0.0), v(1.0, -1.0, 0.0), 1.0, 1.0)]);
            let traced = run(&system, &start, &Options { step: Some(0.3), ..options(method, 2.0) });
            let struck = matches!(traced.endings[0].outcome, Outcome::Struck { .. });
            assert_eq!(struck, hits, "{method:?} at {distance}");
        }
    }
}

#[test]
fn law_the_first_of_several_events_ends_the_flight() {
    // Two sheets and a face of the region in one step: the nearest counts, from either direction.
    let sheets = [0.3, 0.6].map(|x| (false, sheet(v(x, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0), 2)));
    let region = Region { min: v(-1.0, -2.0, -2.0), max: v(0.9, 2.0, 2.0) };
    let system = System::new().with_surface(tree(&sheets)).with_region(region);
    let start = ensemble([
        grain(v(0.0, 0.1, 0.2), v(1.0, 0.0, 0.0), 1.0, 1.0),
        grain(v(0.8, 0.1, 0.2), v(-1.0, 0.0, 0.0), 1.0, 1.0),
        grain(v(0.7, 0.1, 0.2), v(1.0, 0.0, 0.0), 1.0, 1.0),
        grain(v(0.0, 0.1, 0.2), v(-1.0, 0.5, 0.0), 1.0, 1.0),
        grain(v(0.0, 0.1, 0.2), v(0.0, 0.0, 0.1), 1.0, 1.0),
        grain(v(0.0, 3.0, 0.0), v(0.0, 0.0, 0.1), 1.0, 1.0),
    ]);
    for method in ALL {
        let traced = run(&system, &start, &Options { step: Some(5.0), ..options(method, 5.0) });
        let near = |time: f64, expected: f64| assert!((time - expected).abs() < 1e-13, "{method:?}: {time} {expected}");
        for (grain, electrode, time) in [(0, 0, 0.3), (1, 1, 0.2)] {
            assert_eq!(strike(&traced.endings[grain]).0, electrode);
            near(traced.endings[grain].time, time);
        }
        for (grain, face, time) in [(2, v(0.9, 0.1, 0.2), 0.2), (3, v(-1.0, 0.6, 0.2), 1.0), (5, v(0.0, 3.0, 0.0), 0.0)]
        {
            let Outcome::LeftRegion { point } = traced.endings[grain].outcome else { panic!("{:?}", traced.endings) };
            assert!((point - face).norm() < 1e-13);
            near(traced.endings[grain].time, time);
        }
        assert_eq!(traced.endings[4].outcome, Outcome::TimeUp);
    }
}

#[test]
fn law_a_grain_that_starts_inside_a_conductor_has_struck_it() {
    let system = System::new().with_surface(tree(&[(true, sphere(0.5, 2))]));
    let start = ensemble([
        grain(v(0.1, 0.2, 0.0), v(1.0, 0.0, 0.0), 1.0, 1.0),
        grain(v(0.6, 0.2, 0.0), v(1.0, 0.0, 0.0), 1.0, 1.0),
    ]);
    let traced = run(&system, &start, &options(Method::Dop853, 1.0));
    let (electrode, point, normal, ..) = strike(&traced.endings[0]);
    assert_eq!((electrode, point, traced.endings[0].time), (0, v(0.1, 0.2, 0.0), 0.0));
    assert!(normal.dot(&v(0.1, 0.2, 0.0)) > 0.0, "towards the surface");
    assert_eq!(traced.endings[1].outcome, Outcome::TimeUp);
}

#[test]
fn law_struck_grains_no_longer_repel() {
    // Two grains repel each other; one meets a plate close by, after which the other coasts. Its speed must be the one at
    // that moment: by energy, v² = 2 κ/m (1/d0 - 1/d) / 2 for each of two equal grains.
    let (charge, mass, d0) = (1e-14_f64, 1e-13_f64, 1e-3);
    let plate = sheet(v(-2e-3, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0), 2);
    let system = System::new().with_coulomb().with_surface(tree(&[(false, plate)]));
    let start = ensemble([
        grain(v(0.5 * d0, 0.0, 0.0), v(0.0, 0.0, 0.0), charge, mass),
        grain(v(-0.5 * d0, 0.0, 0.0), v(0.0, 0.0, 0.0), charge, mass),
    ]);
    let kappa = field::constants::COULOMB * charge * charge;
    let expected = (kappa / mass * (1.0 / d0 - 1.0 / 4e-3)).sqrt();
    for (method, allowed) in [(Method::Dop853, 1e-10), (Method::Verlet, 1e-5), (Method::BlanesMoan6, 1e-9)] {
        let options = Options { step: Some(1e-4), ..options(method, 0.5) };
        let traced = run(&system, &start, &options);
        let (_, point, _, _, speed) = strike(&traced.endings[1]);
        assert!((speed / expected - 1.0).abs() < allowed, "{method:?}: {speed} {expected}");
        assert_eq!(point.x, -2e-3);
        let coasting = traced.ensemble.velocities()[0].x;
        assert!((coasting / expected - 1.0).abs() < allowed, "{method:?}: {coasting} {expected}");
        // It was at +2 mm when the other struck, and has coasted since.
        let x = 2e-3 + coasting * (0.5 - traced.endings[1].time);
        assert!((traced.ensemble.positions()[0].x / x - 1.0).abs() < allowed, "{method:?}");
    }
}

#[test]
fn law_strikes_of_a_cloud_do_not_depend_on_the_method() {
    // A damped cloud falls through a grid of wires onto a plate: what each grain strikes is the same for all methods.
    let wires = |k: usize| (true, wire(v(0.1 * k as f64 - 0.5, 0.0, 0.0), 0.01, 4.0, 12));
    let mut electrodes: Vec<_> = (0..11).map(wires).collect();
    electrodes.push((false, sheet(v(0.0, -1.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), 9)));
    let system =
        System::new().with_gravity(v(0.2, -9.8, 0.0)).with_drag(Drag::Rate(1.0)).with_surface(tree(&electrodes));
    let mut next = random(9);
    let start = ensemble((0..300).map(|_| grain(v(0.4 * next(), 1.0, 0.5 * next()), v(next(), 0.0, next()), 1.0, 1.0)));
    let struck = |method| {
        let traced = run(&system, &start, &Options { step: Some(0.005), ..options(method, 5.0) });
        traced.endings.iter().map(|e| strike(e).0).collect::<Vec<usize>>()
    };
    let first = struck(Method::Dop853);
    let on_wires = first.iter().filter(|&&e| e < 11).count();
    // Wires cover a fifth of the way.
    assert!((35..85).contains(&on_wires), "{on_wires}");
    assert_eq!(struck(Method::BlanesMoan4), first);
    assert_eq!(struck(Method::BlanesMoan6), first);
    let one_by_one = |block| run(&system, &start, &Options { block, ..options(Method::Dop853, 5.0) });
    assert_eq!(one_by_one(1), one_by_one(64), "the same bits, strikes and all");
    let same = struck(Method::Verlet).iter().zip(&first).filter(|(a, b)| a == b).count();
    assert!(same >= 299, "Verlet's paths are off by 1e-5, wires are 2e-2 wide: {same}");
}

#[test]
fn law_nothing_diffuses_out_of_a_closed_sphere() {
    // Grains kicked about by a gas inside a triangulated sphere, in steps that cross a tenth of it: each strikes it or is
    // inside when the time is up.
    let system = System::new()
        .with_drag(Drag::Rate(5.0))
        .with_noise(0.05 / tracer::constants::BOLTZMANN)
        .with_surface(Arc::new(SurfaceTree::new(&hollow(sphere(0.5, 3)))));
    let start = ensemble((0..500).map(|_| grain(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)));
    for step in [0.02, 0.2] {
        let traced = run(&system, &start, &Options { step: Some(step), ..options(Method::Auto, 8.0) });
        let mut struck = 0;
        for (ending, p) in traced.endings.iter().zip(traced.ensemble.positions()) {
            match ending.outcome {
                Outcome::Struck { point, normal, .. } => {
                    struck += 1;
                    // Flat panels of a sphere lie up to 2 % inside it.
                    assert!((0.48..0.500_001).contains(&point.norm()) && normal.dot(&point) > 0.0);
                }
                Outcome::TimeUp => assert!(p.norm() < 0.5),
                other => panic!("{other:?}"),
            }
        }
        // D = 0.01: the mean time to the wall is R²/(6 D) = 4.2.
        assert!((300..480).contains(&struck), "{struck} at step {step}");
    }
}

/// One closed electrode that grains may fly inside of.
fn hollow(triangles: Vec<[Vec3; 3]>) -> SurfaceMesh {
    let mut mesh = mesh(&[(true, triangles)]);
    mesh.electrodes[0].hollow = true;
    mesh
}
