//! Everything here against what it replaces: direct sums, the dense matrix, the sum over all panels.

use faer::Mat;
use meshes::Vec3;

use super::points::Points;

/// Numbers from 0 to 1 without relation to each other (a permuted congruential generator).
pub(super) fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1);
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((state >> 18) ^ state) >> 27;
        let turned = (word as u32).rotate_right((state >> 59) as u32);
        f64::from(turned) / 4_294_967_296.0
    }
}

pub(super) fn direction(random: &mut impl FnMut() -> f64) -> Vec3 {
    let (z, turn) = (2.0 * random() - 1.0, std::f64::consts::TAU * random());
    let across = (1.0 - z * z).sqrt();
    Vec3::new(across * turn.cos(), across * turn.sin(), z)
}

pub(super) fn clouds(n: usize) -> Vec<(&'static str, Vec<Vec3>)> {
    let mut r = random(1);
    let cube = (0..n).map(|_| Vec3::new(r(), r(), r())).collect();
    let sphere = (0..n).map(|_| direction(&mut r)).collect();
    // A sheet whose points crowd towards one edge and one corner, over some five decades.
    let sheet = (0..n).map(|_| Vec3::new(10_f64.powf(-4.0 * r()), 10_f64.powf(-2.0 * r()), 0.0)).collect();
    let far = (0..n)
        .map(|i| {
            let d = direction(&mut r);
            if i % 3 == 0 { d * (1e-3 * r()) } else { Vec3::new(30.0, 4.0, -5.0) + d * r() }
        })
        .collect();
    vec![("cube", cube), ("sphere", sphere), ("graded sheet", sheet), ("two clusters", far)]
}

/// Σ q/r and its gradient at some targets.
pub(super) fn direct(sources: &[Vec3], charges: &[f64], target: &Vec3) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for (y, q) in sources.iter().zip(charges) {
        let d = target - y;
        let r = d.norm();
        if r > 0.0 {
            sum[0] += q / r;
            for k in 0..3 {
                sum[k + 1] -= q * d[k] / (r * r * r);
            }
        }
    }
    sum
}

/// Errors of potentials and of gradients on every `stride`th target, root mean square over that of the exact ones.
pub(super) fn errors(sources: &[Vec3], charges: &Mat<f64>, targets: &[Vec3], found: &Mat<f64>, stride: usize) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for c in 0..charges.ncols() {
        let q: Vec<f64> = charges.col(c).iter().copied().collect();
        let (mut error, mut size) = ([0.0; 2], [0.0; 2]);
        for t in (0..targets.len()).step_by(stride) {
            let exact = direct(sources, &q, &targets[t]);
            for k in 0..4 {
                let kind = usize::from(k > 0);
                error[kind] += (found[(t, 4 * c + k)] - exact[k]).powi(2);
                size[kind] += exact[k].powi(2);
            }
        }
        for kind in 0..2 {
            worst[kind] = worst[kind].max((error[kind] / size[kind]).sqrt());
        }
    }
    worst
}

/// One column of positive charges, one of random signs, one of zeros.
pub(super) fn some_charges(n: usize) -> Mat<f64> {
    let mut r = random(7);
    let mut charges = Mat::from_fn(n, 2, |_, _| r());
    for i in 0..n {
        charges[(i, 1)] = charges[(i, 1)] - 0.5;
    }
    charges
}

#[test]
fn points_are_as_good_as_asked() {
    let n = 5000;
    for (name, points) in clouds(n) {
        let charges = some_charges(n);
        for accuracy in [1e-2, 1e-4, 1e-6, 1e-8, 1e-10] {
            // The translations of the finest take a second by themselves.
            if accuracy < 1e-9 && name != "graded sheet" {
                continue;
            }
            let sum = Points::new(&points, &points, accuracy).unwrap();
            let found = sum.potentials_and_gradients(charges.as_ref());
            let [potential, gradient] = errors(&points, &charges, &points, &found, 17);
            println!("{name:15} {accuracy:.0e}: potential {potential:.1e}, gradient {gradient:.1e}");
            // What was asked is what is promised.
            assert!(potential < accuracy && gradient < accuracy, "{name} at {accuracy:e}");
        }
    }
}

#[test]
#[ignore]
fn calibrate() {
    use super::{translation::Grade, tree::Shape};
    let n = 30000;
    for (name, points) in clouds(n).into_iter().take(2) {
        let charges = some_charges(n);
        for degree in [4, 6, 8, 10, 12, 14, 17, 20, 24] {
            let best = 10_f64.powf(-(degree as f64 - 0.5) / 1.8);
            for cut in [best, best / 3.0, best / 10.0] {
                let grade = Grade { degree, cut, single: cut > 1e-6 };
                let shape = Shape { leaf: 60, pairs: 100, single: super::solid::parts(degree) };
                let sum = Points::with_grade(&points, &points, &[], grade, shape);
                let clock = std::time::Instant::now();
                let found = sum.potentials_and_gradients(charges.as_ref());
                let time = clock.elapsed().as_secs_f64();
                let [potential, gradient] = errors(&points, &charges, &points, &found, 97);
                println!("{name:10} degree {degree} cut {cut:.1e} rank {}: {potential:.1e} {gradient:.1e} {time:.3}", super::translation::Translations::of(grade).rank);
            }
        }
    }
}

/// A sphere, and two electrodes with panels of very different size.
pub(super) fn meshes(panels: usize) -> Vec<(&'static str, meshes::SurfaceMesh)> {
    use meshes::{Placement, Shape, SurfaceMesh, triangulate_to};
    let part = |shape: &Shape, n: usize, z: f64| {
        let placement = Placement { center: Vec3::z() * z, ..Placement::default() };
        triangulate_to(shape, n).unwrap().0.placed(&placement).unwrap()
    };
    let sphere = part(&Shape::Sphere { radius: 1.0 }, panels, 0.0);
    let plate = part(&Shape::Plate { size: [1.0, 1.0], thickness: 0.0 }, panels / 2, 0.0);
    let ring = part(&Shape::Ring { radius: 0.3, wire_radius: 0.01 }, panels / 2, 0.05);
    vec![
        ("sphere", SurfaceMesh::assemble([("sphere".to_owned(), sphere)])),
        ("plate and ring", SurfaceMesh::assemble([("plate".to_owned(), plate), ("ring".to_owned(), ring)])),
    ]
}

pub(super) fn panels_of(mesh: &meshes::SurfaceMesh) -> Vec<crate::Panel> {
    (0..mesh.panels()).map(|p| crate::Panel::new(mesh.corners(p))).collect()
}

#[test]
fn operator_is_the_dense_matrix() {
    use super::operator::PanelOperator;
    use crate::LinearOperator;
    use crate::linear_operator::GalerkinOperator;
    for (name, mesh) in meshes(3000) {
        let panels = panels_of(&mesh);
        let n = panels.len();
        let mut r = random(3);
        // Densities of the order of those that a volt makes, even and of random sign.
        let x: Vec<f64> = panels.iter().map(|p| p.area * (1.0 + p.centroid.x)).collect();
        let noise: Vec<f64> = panels.iter().map(|p| p.area * (r() - 0.5)).collect();
        let judge = GalerkinOperator { panels: &panels };
        let rows: Vec<usize> = (0..n).step_by(7).collect();
        for (kind, x) in [("even", x), ("random", noise)] {
            let exact: Vec<f64> = rows.iter().map(|&i| judge.row(i, &x)).collect();
            for accuracy in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
                let clock = std::time::Instant::now();
                let operator = PanelOperator::new(&panels, accuracy).unwrap();
                let built = clock.elapsed().as_secs_f64();
                let mut y = vec![0.0; n];
                operator.apply(&x, &mut y);
                let error: f64 = rows.iter().zip(&exact).map(|(&i, e)| (y[i] - e).powi(2)).sum();
                let size: f64 = exact.iter().map(|e| e * e).sum();
                let error = (error / size).sqrt();
                println!("{name} {kind} {accuracy:.0e}: {error:.1e}, {} near, built in {built:.2} s", operator.near_pairs() / n);
            }
        }
    }
}

#[test]
fn solutions_are_as_good_as_asked() {
    use super::solve::solve_panels;
    for (name, mesh) in meshes(2500) {
        let panels = panels_of(&mesh);
        let basis = crate::BoundaryProblem::new(&mesh).solve().unwrap();
        let n = panels.len();
        let right = Mat::from_fn(n, mesh.electrodes.len(), |i, c| f64::from(u8::from(mesh.electrode[i] as usize == c)));
        for tolerance in [1e-3, 1e-4, 1e-6] {
            let (charges, report) = solve_panels(&panels, right.as_ref(), tolerance, &mut |_, _| ()).unwrap();
            let mut worst = 0.0_f64;
            for c in 0..right.ncols() {
                let (mut error, mut size) = (0.0, 0.0);
                for i in 0..n {
                    let exact = basis.charge[(i, c)] * crate::constants::COULOMB;
                    error += (charges[(i, c)] - exact).powi(2);
                    size += exact * exact;
                }
                worst = worst.max((error / size).sqrt());
            }
            println!(
                "{name} {tolerance:.0e}: {worst:.1e} after {} iterations, {:.2} {:.2} {:.2} s",
                report.iterations, report.operator_seconds, report.inverse_seconds, report.solve_seconds
            );
        }
    }
}

#[test]
#[ignore]
fn schemes() {
    use super::operator::{PanelOperator, Scheme};
    use crate::linear_operator::GalerkinOperator;
    for (name, mesh) in meshes(3000) {
        let panels = panels_of(&mesh);
        let n = panels.len();
        let mut r = random(3);
        let x = Mat::from_fn(n, 1, |i, _| panels[i].area * (r() - 0.5));
        let xs: Vec<f64> = x.col(0).iter().copied().collect();
        let judge = GalerkinOperator { panels: &panels };
        let rows: Vec<usize> = (0..n).step_by(7).collect();
        let exact: Vec<f64> = rows.iter().map(|&i| judge.row(i, &xs)).collect();
        let best = PanelOperator::with_scheme(&panels, Scheme { degree: 8, near: 3.0, rules_from: 3.0, accuracy: 1e-8, single: false }).unwrap().apply_columns(x.as_ref());
        for degree in [1, 2, 3, 4, 5, 6] {
            for near in [1.5, 2.0, 3.0] {
                let y = PanelOperator::with_scheme(&panels, Scheme { degree, near, rules_from: 3.0, accuracy: 1e-7, single: false }).unwrap().apply_columns(x.as_ref());
                let (mut e1, mut e2, mut size) = (0.0, 0.0, 0.0);
                for (&i, e) in rows.iter().zip(&exact) {
                    e1 += (y[(i, 0)] - e).powi(2);
                    e2 += (y[(i, 0)] - best[(i, 0)]).powi(2);
                    size += e * e;
                }
                println!("{name} degree {degree} near {near}: dense {:.1e} best {:.1e}", (e1 / size).sqrt(), (e2 / size).sqrt());
            }
        }
    }
}

#[test]
fn fields_are_those_of_the_panel_sum() {
    use super::evaluate::PanelsAtPoints;
    use crate::{BasisField, Samples};
    for (name, mesh) in meshes(1500) {
        let basis = crate::BoundaryProblem::new(&mesh).solve().unwrap();
        let mut r = random(11);
        // Far and near, and some on the panels' corners.
        let mut points: Vec<Vec3> = (0..1500).map(|_| Vec3::new(3.0 * r() - 1.5, 3.0 * r() - 1.5, 3.0 * r() - 1.5)).collect();
        points.extend(basis.panels.iter().step_by(3).map(|p| p.centroid + p.normal * (p.radius * 3.0 * r())));
        let weights = (0..mesh.electrodes.len())
            .map(|e| (0..mesh.electrodes.len()).map(|k| f64::from(u8::from(e == k))).collect())
            .collect();
        let judge = crate::PanelSum::new(&basis, weights);
        let points: Vec<Vec3> = points.into_iter().filter(|p| judge.inside(p).is_none()).collect();
        let mut samples = Samples::default();
        judge.sample(&points, &mut samples);
        let charges = Mat::from_fn(basis.panels.len(), mesh.electrodes.len(), |i, c| basis.charge[(i, c)] * crate::constants::COULOMB);
        let k = charges.ncols();
        for accuracy in [1e-3, 1e-5, 1e-7] {
            let sums = PanelsAtPoints::new(&basis.panels, &points, accuracy).unwrap();
            let found = sums.potentials_and_gradients(charges.as_ref());
            for c in 0..k {
                let (mut error, mut size) = ([0.0; 2], [0.0; 2]);
                for t in 0..points.len() {
                    let exact = samples.gradient[t * k + c];
                    let exact = [samples.potential[t * k + c], exact.x, exact.y, exact.z];
                    for o in 0..4 {
                        error[usize::from(o > 0)] += (found[(t, 4 * c + o)] - exact[o]).powi(2);
                        size[usize::from(o > 0)] += exact[o].powi(2);
                    }
                }
                let [potential, gradient] = [0, 1].map(|kind| (error[kind] / size[kind]).sqrt());
                println!("{name} {accuracy:.0e}: potential {potential:.1e}, gradient {gradient:.1e}");
                // The judge expands panels from 28 radii on, which leaves 1e-8.
                assert!(potential < accuracy && gradient < accuracy, "{name} at {accuracy:e}");
            }
        }
    }
}
