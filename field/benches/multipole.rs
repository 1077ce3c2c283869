//! Sums by multipoles: `cargo bench -p graintrap-field --bench multipole -- [points|solve|evaluate] [largest number]`.
//!
//! Core-seconds are processor time of all threads, so that they say the same on a busy machine.

use std::time::Instant;

use faer::Mat;
use field::Panel;
use field::multipole::{FIELD_ACCURACY, PanelOperator, PanelsAtPoints, Points, bytes_needed, solve_panels};
use meshes::Vec3;
use meshes::{Placement, Shape, SurfaceMesh, triangulate_to};

/// Processor time of this process so far, s: user and system, in hundredths (proc(5), fields 14 and 15).
fn core_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |k: usize| fields.get(k).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

struct Clock {
    wall: Instant,
    cores: f64,
}

impl Clock {
    fn start() -> Self {
        Self { wall: Instant::now(), cores: core_seconds() }
    }

    fn stop(&self) -> (f64, f64) {
        (core_seconds() - self.cores, self.wall.elapsed().as_secs_f64())
    }
}

fn row(what: &str, count: usize, asked: f64, measured: f64, (cores, wall): (f64, f64), bytes: u64) {
    println!(
        "{what:34} {count:>9} {asked:>8.0e} {measured:>9.1e} {cores:>8.2} {wall:>8.2} {:>8.1}",
        bytes as f64 / 1024.0 / 1024.0
    );
}

fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn cloud(on_sphere: bool, n: usize) -> Vec<Vec3> {
    let mut r = random(3);
    (0..n)
        .map(|_| {
            if on_sphere {
                let (z, turn) = (2.0 * r() - 1.0, std::f64::consts::TAU * r());
                let across = (1.0 - z * z).sqrt();
                Vec3::new(across * turn.cos(), across * turn.sin(), z)
            } else {
                Vec3::new(r(), r(), r())
            }
        })
        .collect()
}

fn points(largest: usize) {
    for (shape, on_sphere) in [("cube", false), ("sphere", true)] {
        for n in [10_000, 100_000, 1_000_000] {
            for asked in [2e-4, 1e-5, 2e-6] {
                if n > largest || (n > 100_000 && asked < 1e-4) {
                    continue;
                }
                let cloud = cloud(on_sphere, n);
                let mut r = random(5);
                let charges = Mat::from_fn(n, 1, |_, _| r() - 0.5);
                let clock = Clock::start();
                let sum = Points::new(&cloud, &cloud, asked).expect("finite points");
                let built = clock.stop();
                let clock = Clock::start();
                let found = sum.potentials_and_gradients(charges.as_ref());
                let applied = clock.stop();
                let (mut error, mut size) = ([0.0; 2], [0.0; 2]);
                for t in (0..n).step_by(n / 100) {
                    let mut exact = [0.0; 4];
                    for (j, y) in cloud.iter().enumerate().filter(|(j, _)| *j != t) {
                        let d = cloud[t] - y;
                        let over = charges[(j, 0)] / d.norm();
                        exact[0] += over;
                        for k in 0..3 {
                            exact[k + 1] -= over * d[k] / d.norm_squared();
                        }
                    }
                    for k in 0..4 {
                        error[usize::from(k > 0)] += (found[(t, k)] - exact[k]).powi(2);
                        size[usize::from(k > 0)] += exact[k].powi(2);
                    }
                }
                let measured = (error[0] / size[0]).sqrt().max((error[1] / size[1]).sqrt());
                row(&format!("points, {shape}: build"), n, asked, measured, built, sum.bytes());
                row("   potentials and gradients", n, asked, measured, applied, sum.bytes_applied(1, true));
            }
        }
    }
}

/// A ring trap: two end caps and a ring between them.
fn trap(panels: usize) -> SurfaceMesh {
    let part = |name: &str, shape: Shape, z: f64| {
        let placement = Placement { center: Vec3::z() * z, ..Placement::default() };
        let mesh = triangulate_to(&shape, panels / 3).expect("a sound shape").0;
        (name.to_owned(), mesh.placed(&placement).expect("it has a direction"))
    };
    let cap = || Shape::Sphere { radius: 0.4 };
    let ring = Shape::Ring { radius: 1.0, wire_radius: 0.1 };
    SurfaceMesh::assemble([part("below", cap(), -1.0), part("ring", ring, 0.0), part("above", cap(), 1.0)])
}

fn solve(largest: usize) {
    for n in [10_000, 100_000, 1_000_000] {
        // What the others are measured against; where there is none, the residual is shown.
        let mut finest: Option<Mat<f64>> = None;
        for tolerance in [1e-6, 1e-4, 1e-3] {
            if n > largest || (n > 100_000 && tolerance != 1e-4) {
                continue;
            }
            let mesh = trap(n);
            let panels: Vec<Panel> = (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect();
            let right = Mat::from_fn(panels.len(), mesh.electrodes.len(), |i, c| {
                f64::from(u8::from(mesh.electrode[i] as usize == c))
            });
            let clock = Clock::start();
            let solved = solve_panels(&panels, right.as_ref(), tolerance, &mut |_, _| ());
            let time = clock.stop();
            match solved {
                Ok((charges, report)) => {
                    let what = format!("solve, {} iterations", report.iterations);
                    let measured = finest.as_ref().map_or(report.residual, |f| (&charges - f).norm_l2() / f.norm_l2());
                    finest.get_or_insert(charges);
                    row(&what, panels.len(), tolerance, measured, time, report.bytes);
                    println!(
                        "   operator {:.2} s, inverse {:.2} s, iterations {:.2} s; {:.0} MiB foreseen",
                        report.operator_seconds,
                        report.inverse_seconds,
                        report.solve_seconds,
                        bytes_needed(panels.len(), right.ncols(), tolerance) as f64 / 1024.0 / 1024.0
                    );
                }
                Err(error) => println!("{error}"),
            }
            let clock = Clock::start();
            let operator = PanelOperator::new(&panels, tolerance).expect("sound panels");
            row("   operator", panels.len(), tolerance, f64::NAN, clock.stop(), operator.bytes());
            let clock = Clock::start();
            let _ = operator.apply_columns(right.as_ref());
            row(
                "   applied to three columns",
                panels.len(),
                tolerance,
                f64::NAN,
                clock.stop(),
                operator.bytes_applied(3),
            );
        }
    }
}

fn evaluate(largest: usize) {
    for (n, side) in [(10_000, 58), (100_000, 126), (1_000_000, 126)] {
        if n > largest {
            continue;
        }
        let mesh = trap(n);
        let panels: Vec<Panel> = (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect();
        let charges = Mat::from_fn(panels.len(), 1, |i, _| panels[i].area * (1.0 + panels[i].centroid.x));
        let at = |i: usize| 3.0 * (i as f64 / (side - 1) as f64) - 1.5;
        let grid: Vec<Vec3> = (0..side * side * side)
            .map(|i| Vec3::new(at(i % side), at(i / side % side), at(i / side / side)))
            .collect();
        let clock = Clock::start();
        let sums = PanelsAtPoints::new(&panels, &grid, FIELD_ACCURACY).expect("sound panels");
        row(
            &format!("field of {} panels: build", panels.len()),
            grid.len(),
            FIELD_ACCURACY,
            f64::NAN,
            clock.stop(),
            sums.bytes(),
        );
        let clock = Clock::start();
        let found = sums.potentials_and_gradients(charges.as_ref());
        let time = clock.stop();
        let (mut error, mut size) = (0.0, 0.0);
        for t in (0..grid.len()).step_by(grid.len() / 40) {
            let add = |(v, g): (f64, Vec3), p: usize| {
                let (value, slope) = panels[p].potential_and_gradient(&grid[t]);
                let density = charges[(p, 0)] / panels[p].area;
                (v + density * value, g + slope * density)
            };
            let (_, g) = (0..panels.len()).fold((0.0, Vec3::zeros()), add);
            error += (g - Vec3::new(found[(t, 1)], found[(t, 2)], found[(t, 3)])).norm_squared();
            size += g.norm_squared();
        }
        let measured = f64::sqrt(error / size);
        row("   potential and gradient", grid.len(), FIELD_ACCURACY, measured, time, sums.bytes_applied(1));
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let what = arguments.iter().find(|a| a.parse::<usize>().is_err()).map_or("", String::as_str);
    let largest = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(100_000);
    println!(
        "{:34} {:>9} {:>8} {:>9} {:>8} {:>8} {:>8}",
        "", "number", "asked", "measured", "cores s", "wall s", "MiB"
    );
    if what.is_empty() || what == "points" {
        points(largest);
    }
    if what.is_empty() || what == "evaluate" {
        evaluate(largest);
    }
    if what.is_empty() || what == "solve" {
        solve(largest);
    }
}
