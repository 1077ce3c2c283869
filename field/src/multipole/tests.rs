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
pub(super) fn errors(
    sources: &[Vec3],
    charges: &Mat<f64>,
    targets: &[Vec3],
    found: &Mat<f64>,
    stride: usize,
) -> [f64; 2] {
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
        charges[(i, 1)] -= 0.5;
    }
    charges
}

fn check_points(n: usize, name: &str, points: &[Vec3], accuracy: f64) {
    let charges = some_charges(n);
    let sum = Points::new(points, points, accuracy).unwrap();
    let found = sum.potentials_and_gradients(charges.as_ref());
    let [potential, gradient] = errors(points, &charges, points, &found, n / 200);
    println!("{name:15} {accuracy:.0e}: potential {potential:.1e}, gradient {gradient:.1e}");
    // What was asked is what is promised; far below it nothing went through expansions.
    assert!(potential < accuracy && gradient < accuracy, "{name} at {accuracy:e}");
    assert!(potential > 1e-4 * accuracy, "{name} at {accuracy:e} was summed point by point");
}

#[test]
fn points_are_as_good_as_asked() {
    let n = 15_000;
    for (name, points) in clouds(n) {
        for accuracy in [1e-2, 1e-4, 1e-6] {
            check_points(n, name, &points, accuracy);
        }
    }
    let (name, points) = &clouds(n)[0];
    check_points(n, name, points, 1e-8);
}

/// Some seconds and 1 GiB.
#[test]
fn the_finest_accuracy_is_reached() {
    let n = 40_000;
    for (name, points) in clouds(n).into_iter().skip(1).take(2) {
        check_points(n, name, &points, 1e-10);
    }
}

#[test]
fn targets_need_not_be_sources() {
    let mut r = random(5);
    let sources: Vec<Vec3> = (0..5000).map(|_| direction(&mut r)).collect();
    // Inside and outside, and near: deep inside an even shell there is no field that an error could be compared with.
    let targets: Vec<Vec3> = (0..9000).map(|_| direction(&mut r) * (0.5 + r())).collect();
    let charges = some_charges(sources.len());
    let sum = Points::new(&sources, &targets, 1e-5).unwrap();
    let found = sum.potentials_and_gradients(charges.as_ref());
    let [potential, gradient] = errors(&sources, &charges, &targets, &found, 29);
    assert!(potential < 1e-5 && gradient < 1e-5, "{potential:e} {gradient:e}");
    // Without gradients the same, and column by column.
    let alone = sum.potentials(charges.as_ref().get(.., 1..2));
    let error = (0..targets.len()).map(|t| (alone[(t, 0)] - found[(t, 4)]).abs()).fold(0.0, f64::max);
    assert!(error < 1e-9 * found.norm_max(), "{error:e}");
}

#[test]
fn what_cannot_be_summed_is_refused() {
    let (good, bad) = ([Vec3::zeros()], [Vec3::new(0.0, f64::NAN, 0.0)]);
    assert!(Points::new(&good, &bad, 1e-4).is_err() && Points::new(&good, &good, 0.0).is_err());
    let none = Points::new(&[], &good, 1e-4).unwrap().potentials(Mat::zeros(0, 2).as_ref());
    assert_eq!((none.nrows(), none.norm_max()), (1, 0.0));
}

#[test]
fn threads_do_not_change_a_bit() {
    let (_, mesh) = meshes(1500).swap_remove(1);
    let panels = panels_of(&mesh);
    let right = Mat::from_fn(panels.len(), 2, |i, c| f64::from(u8::from(mesh.electrode[i] as usize == c)));
    let (_, cloud) = clouds(6000).swap_remove(2);
    let charges = some_charges(cloud.len());
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let sums = Points::new(&cloud, &cloud, 1e-4).unwrap().potentials_and_gradients(charges.as_ref());
            let solved = super::solve_panels(&panels, right.as_ref(), 1e-3, &mut |_, _| ()).unwrap().0;
            let field = super::PanelsAtPoints::new(&panels, &cloud, 1e-3).unwrap();
            (sums, field.potentials_and_gradients(solved.as_ref()), solved)
        })
    };
    let one = on(1);
    assert!(one == on(2) && one == on(3));
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
            for accuracy in [1e-3, 1e-4, 1e-5, 1e-6] {
                let operator = PanelOperator::new(&panels, accuracy).unwrap();
                let mut y = vec![0.0; n];
                operator.apply(&x, &mut y);
                let error: f64 = rows.iter().zip(&exact).map(|(&i, e)| (y[i] - e).powi(2)).sum();
                let size: f64 = exact.iter().map(|e| e * e).sum();
                let error = (error / size).sqrt();
                println!("{name} {kind} {accuracy:.0e}: {error:.1e}, {} near each", operator.near_pairs() / n);
                // Beyond that the dense matrix has errors of its own: moments from 16 radii on leave 1e-6 of an entry,
                // which charges of random sign see.
                assert!(error < accuracy + 3e-6, "{name} {kind} at {accuracy:e}: {error:e}");
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
            let (mut worst, mut total) = (0.0_f64, 0.0_f64);
            for c in 0..right.ncols() {
                let (mut error, mut size, mut sum, mut all) = (0.0, 0.0, 0.0, 0.0);
                for i in 0..n {
                    let exact = basis.charge[(i, c)] * crate::constants::COULOMB;
                    error += (charges[(i, c)] - exact).powi(2);
                    size += exact * exact;
                    sum += charges[(i, c)] - exact;
                    all += exact.abs();
                }
                worst = worst.max((error / size).sqrt());
                total = total.max((sum / all).abs());
            }
            println!(
                "{name} {tolerance:.0e}: {worst:.1e} after {} iterations, {:.2} {:.2} {:.2} s",
                report.iterations, report.operator_seconds, report.inverse_seconds, report.solve_seconds
            );
            // The dense matrix's own errors, 1e-6 of its entries, are 2e-5 of the charges of single panels; in sums they cancel.
            assert!(worst < tolerance + 3e-5 && total < tolerance, "{name} at {tolerance:e}: {worst:e} {total:e}");
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
        let mut points: Vec<Vec3> =
            (0..1500).map(|_| Vec3::new(3.0 * r() - 1.5, 3.0 * r() - 1.5, 3.0 * r() - 1.5)).collect();
        points.extend(basis.panels.iter().step_by(3).map(|p| p.centroid + p.normal * (p.radius * 3.0 * r())));
        let weights = (0..mesh.electrodes.len())
            .map(|e| (0..mesh.electrodes.len()).map(|k| f64::from(u8::from(e == k))).collect())
            .collect();
        let judge = crate::PanelSum::new(&basis, weights);
        let points: Vec<Vec3> = points.into_iter().filter(|p| judge.inside(p).is_none()).collect();
        let mut samples = Samples::default();
        judge.sample(&points, &mut samples);
        let charges = Mat::from_fn(basis.panels.len(), mesh.electrodes.len(), |i, c| {
            basis.charge[(i, c)] * crate::constants::COULOMB
        });
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
