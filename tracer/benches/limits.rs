//! What tracing costs at the accuracies that design work asks for: core-seconds beside errors, as rows of a Markdown table.
//!
//! `cargo bench -p graintrap-tracer --bench limits`; `-- paul coulomb` runs the rows whose names hold one of the words.
//! Seconds are processor time of one thread, so that a busy machine gives what an idle one does; the least of three runs.

use std::f64::consts::{PI, TAU};
use std::sync::{Arc, LazyLock};
use std::time::Instant;

use field::{
    BasisField, BoundaryProblem, DrivenField, ElectrodeBasis, PER_NODE, PotentialTable, QuadraticField, SMOOTH,
    Samples, TableOptions, TabulatedField, Waveform, WaveformPart, tabulate,
};
use meshes::{Placement, Shape, SurfaceMesh, Vec3, triangulate_to};
use tracer::{Batch, Coulomb, Drag, Ensemble, Force, Grain, Method, Nothing, Options, Scratch, System, trace};

fn main() {
    // Everything on the thread that is timed.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("no pool has been used yet");
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    println!("| work | core-seconds | rate | error |\n|---|---|---|---|");
    let rows: [(&str, fn()); 10] = [
        ("paul", paul),
        ("points", points),
        ("tabulated", flights_in_a_table),
        ("interpolation", interpolation),
        ("pairs", pairs),
        ("coupled", coupled),
        ("cloud", cloud_in_a_gas),
        ("stability", stability),
        ("many", many),
        ("memory", memory),
    ];
    for (name, row) in rows {
        if words.is_empty() || words.iter().any(|word| name.contains(word.as_str())) {
            row();
        }
    }
}

/// Processor time of this thread so far, s; where the system does not tell, the time of day.
fn seconds(start: &Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or(start.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// Processor time of one run, s, and what it gave.
fn once<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let clock = Instant::now();
    let before = seconds(&clock);
    let out = work();
    (seconds(&clock) - before, out)
}

/// The least processor time of three runs, s, and what the last gave.
fn timed<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let (first, second, (third, out)) = (once(&mut work).0, once(&mut work).0, once(&mut work));
    (first.min(second).min(third), out)
}

fn grain(position: Vec3, velocity: Vec3, id: u64) -> Grain {
    Grain { position, velocity, charge: 1.0, mass: 1.0, radius: 0.0, id, group: 0 }
}

fn cloud(count: usize) -> Ensemble {
    let mut ensemble = Ensemble::new();
    let mut stream = tracer::stream::Stream::new(3, tracer::stream::Purpose::Start, 0, 0);
    let mut next = || 2.0 * stream.unit() - 1.0;
    for k in 0..count {
        let (r, u) = (Vec3::new(next(), next(), next()), Vec3::new(next(), next(), next()) * 0.1);
        ensemble.push(grain(r, u, k as u64)).expect("a sound grain");
    }
    ensemble
}

/// u'' + (a - 2 q cos 2t) u = 0 with a = 0, q = 0.2 along x and y and -0.4 along z.
const Q: [f64; 3] = [0.2, 0.2, -0.4];

fn paul_trap() -> System {
    paul_trap_in(QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0))
}

fn paul_trap_in(basis: impl BasisField + 'static) -> System {
    let drive = WaveformPart::Sine { amplitude: -0.4, frequency: 2.0 / TAU, phase: 0.0 };
    System::new().with_field(DrivenField::new(Arc::new(basis), vec![Waveform { constant: 0.0, parts: vec![drive] }]))
}

/// The map of (u, u') over a period of the Mathieu equation, by 4000 steps of the classical Runge-Kutta scheme: to 1e-13.
fn period(q: f64) -> [f64; 4] {
    let force = |t: f64, u: f64| 2.0 * q * (2.0 * t).cos() * u;
    let flown = |mut u: f64, mut v: f64| {
        let h = PI / 4000.0;
        for k in 0..4000 {
            let t = h * f64::from(k);
            let (k1, l1) = (v, force(t, u));
            let (k2, l2) = (v + 0.5 * h * l1, force(t + 0.5 * h, u + 0.5 * h * k1));
            let (k3, l3) = (v + 0.5 * h * l2, force(t + 0.5 * h, u + 0.5 * h * k2));
            let (k4, l4) = (v + h * l3, force(t + h, u + h * k3));
            u += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
            v += h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4);
        }
        (u, v)
    };
    let ((a, c), (b, d)) = (flown(1.0, 0.0), flown(0.0, 1.0));
    [a, b, c, d]
}

/// A thousand grains, a thousand periods.
fn paul() {
    let whole = Options { duration: 1000.0 * PI, ..Options::default() };
    let with = |method, steps: f64| {
        (format!("{method:?}, {steps} steps a period"), Options { method, step: Some(PI / steps), ..whole.clone() })
    };
    thousand(
        &paul_trap(),
        &[
            ("as by default".into(), whole.clone()),
            ("tolerance 1e-8".into(), Options { tolerance: 1e-8, ..whole.clone() }),
            with(Method::BlanesMoan14, 8.0),
            with(Method::BlanesMoan14, 10.0),
            with(Method::BlanesMoan6, 16.0),
        ],
    );
}

/// A field that does not say that it is quadratic.
struct Hidden(QuadraticField);

impl BasisField for Hidden {
    fn channels(&self) -> usize {
        self.0.channels()
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        self.0.sample(points, samples);
    }
}

/// The same where the field is asked for point by point: what a field that costs nothing leaves to the tracer.
fn points() {
    let system = paul_trap_in(Hidden(QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0)));
    let whole = Options { duration: 1000.0 * PI, ..Options::default() };
    let fixed = |method, steps: f64| Options { method, step: Some(PI / steps), ..whole.clone() };
    thousand(
        &system,
        &[
            ("point by point, Stoermer12, 36 steps a period".into(), fixed(Method::Stoermer12, 36.0)),
            ("point by point, Stoermer12, 48 steps a period".into(), fixed(Method::Stoermer12, 48.0)),
            ("point by point, BlanesMoan14, 10 steps a period".into(), fixed(Method::BlanesMoan14, 10.0)),
            (
                "point by point, Dop853, 1e-8 a step".into(),
                Options { method: Method::Dop853, tolerance: 1e-8, ..whole.clone() },
            ),
        ],
    );
}

/// Two electrodes far from the box of the tables below, whose sum has as many functions as these tables.
static FAR: LazyLock<ElectrodeBasis> = LazyLock::new(|| {
    let ball = |name: &str, x: f64| {
        let placement = Placement { center: Vec3::x() * x, axis: Vec3::z(), up: None };
        let mesh = triangulate_to(&Shape::Sphere { radius: 0.1 }, 40).expect("a sound shape").0;
        (name.to_string(), mesh.placed(&placement).expect("it has a direction"))
    };
    let mesh = SurfaceMesh::assemble([ball("left", -50.0), ball("right", 50.0)]);
    BoundaryProblem::new(&mesh).solve().expect("sound balls")
});

/// Derivatives at a point (in the order of a table's nodes) of Σ_n f_n Re (u + i v)^n over the planes (x, y), (y, z), (z, x): planar
/// multipoles. ∂_u^a ∂_v^b Re w^n = Re i^b n!/(n - a - b)! w^(n - a - b).
fn multipoles(orders: &[(usize, f64)], p: &Vec3) -> [f64; PER_NODE] {
    let mut all = [0.0; PER_NODE];
    for (u, v) in [(0, 1), (1, 2), (2, 0)] {
        let (radius, angle) = (p[u].hypot(p[v]), p[v].atan2(p[u]));
        for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
            let place = a * 3_usize.pow(u as u32) + b * 3_usize.pow(v as u32);
            for &(n, f) in orders.iter().filter(|(n, _)| *n >= a + b) {
                let left = n - a - b;
                let factor: f64 = (left + 1..=n).map(|k| k as f64).product();
                let turned = left as f64 * angle + b as f64 * PI / 2.0;
                all[place] += f * factor * radius.powi(left as i32) * turned.cos();
            }
        }
    }
    all
}

/// What a trap of real electrodes has: mostly a quadrupole, some hexapole, octupole and dodecapole.
const ORDERS: [(usize, f64); 4] = [(2, 1.0), (3, 0.05), (4, 0.05), (6, 0.01)];

/// Half the side of the box of these tables.
const HALF: f64 = 0.9;

fn table_of_multipoles(cells: usize, accuracy: f64) -> PotentialTable {
    let spacing = 2.0 * HALF / cells as f64;
    let bricks = PotentialTable::bricks_for(Vec3::repeat(-HALF), Vec3::repeat(HALF), spacing);
    PotentialTable::of_function(bricks, 1, accuracy, |p| vec![multipoles(&ORDERS, p)])
}

/// Times that all points are asked for.
const PASSES: usize = 8;

/// Points of a table.
fn interpolation() {
    let one = [vec![1.0]];
    // The exact sum takes no part: all points lie in the table.
    let exact = Arc::new(FAR.combined(&[vec![1.0, 0.0]]));
    for (cells, accuracy) in [(64, 1e-4), (128, 1e-4), (64, 1e-6), (128, 1e-6)] {
        let degree = if accuracy > SMOOTH { 3 } else { 5 };
        let field = TabulatedField::new(&table_of_multipoles(cells, accuracy), &one, exact.clone());
        let mut stream = tracer::stream::Stream::new(5, tracer::stream::Purpose::Start, 0, 0);
        let mut next = || 0.95 * HALF * (2.0 * stream.unit() - 1.0);
        let random: Vec<Vec3> = (0..1_000_000).map(|_| Vec3::new(next(), next(), next())).collect();
        // A thousand grains on circles, 36 points to a turn, in blocks of 64 as the tracer flies them.
        let flight: Vec<Vec3> = (0..15)
            .flat_map(|block| (0..1000).flat_map(move |step| (0..64).map(move |lane| (64 * block + lane, step))))
            .map(|(grain, step)| {
                let (sin, cos) = (TAU * f64::from(step) / 36.0).sin_cos();
                0.7 * random[grain] + 0.1 * Vec3::new(cos, sin, 0.5 * cos)
            })
            .collect();
        let slope = |p: &Vec3| {
            let truth = multipoles(&ORDERS, p);
            Vec3::new(truth[1], truth[3], truth[9])
        };
        let strongest = random.iter().step_by(50).map(|p| slope(p).norm()).fold(0.0, f64::max);
        for (name, points) in [("in random order", &random), ("in flight", &flight)] {
            let all = |look: &mut dyn FnMut(&[Vec3], &[Vec3])| {
                let factors = [1.0; 64];
                let (mut potential, mut gradient, mut scratch) = ([0.0; 64], [Vec3::zeros(); 64], Samples::default());
                for points in points.chunks_exact(64) {
                    field.sum(points, &factors, &mut scratch, &mut potential, &mut gradient);
                    look(points, &gradient);
                }
            };
            let many = || (0..PASSES).for_each(|_| all(&mut |_, _| ()));
            let (seconds, ()) = timed(many);
            let mut off = 0.0_f64;
            all(&mut |points, gradient| {
                for (p, g) in points.iter().zip(gradient).step_by(50) {
                    off = off.max((g - slope(p)).norm());
                }
            });
            // Wall time: two threads do twice the work.
            let wall = |threads: usize| {
                let mut least = f64::INFINITY;
                for _ in 0..3 {
                    let start = Instant::now();
                    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(many))));
                    least = least.min(start.elapsed().as_secs_f64());
                }
                least
            };
            println!(
                "| potential and field, one channel, {cells}³ cells, degree {degree}, points {name} | {seconds:.3} | {:.1} M points/s; two threads {:.2} times as many | {:.1e} of the strongest |",
                (PASSES * points.len()) as f64 / seconds * 1e-6,
                2.0 * wall(1) / wall(2),
                off / strongest
            );
        }
    }
    let ring = |name: &str, z: f64| {
        let placement = Placement { center: Vec3::z() * z, axis: Vec3::z(), up: None };
        let ring = Shape::Ring { radius: 1.0, wire_radius: 0.02 };
        let mesh = triangulate_to(&ring, 800).expect("a sound shape").0;
        (name.to_string(), mesh.placed(&placement).expect("it has a direction"))
    };
    let mesh = SurfaceMesh::assemble([ring("below", -1.0), ring("above", 1.0)]);
    let basis = BoundaryProblem::new(&mesh).solve().expect("sound rings");
    let (min, max) = (Vec3::repeat(-0.6), Vec3::repeat(0.6));
    let options =
        TableOptions { min, max, accuracy: 1e-6, spacing: Some(1.2 / 64.0), max_bytes: 1 << 32, smooth: false };
    let (seconds, (mut table, _)) = timed(|| tabulate(&basis, &options, &|_| ()).expect("a small table"));
    table.tabulate_all();
    let exact = Arc::new(basis.combined(&[vec![1.0, 1.0]]));
    let field = TabulatedField::new(&table, &[vec![1.0, 1.0]], exact.clone());
    let mut stream = tracer::stream::Stream::new(6, tracer::stream::Purpose::Start, 0, 0);
    let mut next = || 0.6 * (2.0 * stream.unit() - 1.0);
    let points: Vec<Vec3> = (0..2000).map(|_| Vec3::new(next(), next(), next())).collect();
    let (mut truth, mut got) = (Samples::default(), Samples::default());
    exact.sample(&points, &mut truth);
    field.sample(&points, &mut got);
    let strongest = truth.gradient.iter().map(Vec3::norm).fold(0.0, f64::max);
    let off = truth.gradient.iter().zip(&got.gradient).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    println!(
        "| two rings, 64³ cells between them, filled and measured | {seconds:.2} | - | {:.1e} of the strongest |",
        off / strongest
    );
}

/// A thousand grains for a thousand periods in a table of two channels, against finer steps in the same table.
fn flights_in_a_table() {
    for accuracy in [1e-4, 1e-6] {
        thousand_in_a_table(accuracy);
    }
}

fn thousand_in_a_table(accuracy: f64) {
    let degree = if accuracy > SMOOTH { 3 } else { 5 };
    let spacing = 2.0 / 64.0;
    let bricks = PotentialTable::bricks_for(Vec3::repeat(-1.0), Vec3::repeat(1.0), spacing);
    // A quadrupole for RF and another along the same axis, a tenth of a hexapole and of higher ones, for DC.
    let table = PotentialTable::of_function(bricks, 2, accuracy, |p| {
        let mut rf = [0.0; PER_NODE];
        (rf[0], rf[1], rf[3], rf[9]) = (0.5 * (p.x * p.x + p.y * p.y) - p.z * p.z, p.x, p.y, -2.0 * p.z);
        (rf[2], rf[6], rf[18]) = (1.0, 1.0, -2.0);
        let dc = multipoles(&[(2, 0.2), (3, 0.1), (4, 0.05), (6, 0.02)], p);
        vec![rf, dc]
    });
    let weights = [vec![1.0, 0.0], vec![0.0, 1.0]];
    let exact = Arc::new(FAR.combined(&weights));
    let basis = Arc::new(TabulatedField::new(&table, &weights, exact));
    let drive = WaveformPart::Sine { amplitude: -0.4, frequency: 2.0 / TAU, phase: 0.0 };
    let waveforms = vec![Waveform { constant: 0.0, parts: vec![drive] }, Waveform::constant(0.01)];
    let system = System::new().with_field(DrivenField::new(basis, waveforms));
    let even = cloud(1000);
    let mut grains = Ensemble::new();
    for k in 0..1000 {
        let (position, velocity) = (0.3 * even.positions()[k], 0.3 * even.velocities()[k]);
        grains.push(Grain { position, velocity, ..even.grain(k) }).expect("sound");
    }
    let whole = Options { duration: 1000.0 * PI, estimate_error: false, ..Options::default() };
    let fixed = |method, steps: f64| Options { method, step: Some(PI / steps), ..whole.clone() };
    let best = trace(&system, &grains, &fixed(Method::Stoermer12, 160.0), &Nothing).expect("a sound run");
    for (name, options) in [
        ("Stoermer12, 32 steps a period", fixed(Method::Stoermer12, 32.0)),
        ("Stoermer12, 36 steps a period", fixed(Method::Stoermer12, 36.0)),
        ("Stoermer12, 40 steps a period", fixed(Method::Stoermer12, 40.0)),
        ("as by default", whole.clone()),
    ] {
        let (seconds, traced) = once(|| trace(&system, &grains, &options, &Nothing).expect("a sound run"));
        println!(
            "| 1000 grains, 1000 RF periods, table of two channels, degree {degree}, {name} | {seconds:.2} | {:.0} M forces/s | {:.1e} |",
            traced.force_evaluations as f64 / seconds * 1e-6,
            apart(traced.ensemble.positions(), best.ensemble.positions()),
        );
    }
}

fn thousand(system: &System, runs: &[(String, Options)]) {
    let grains = cloud(1000);
    let maps = Q.map(period);
    let exact = |g: usize, k: usize| {
        let (mut u, mut v) = (grains.positions()[g][k], grains.velocities()[g][k]);
        for _ in 0..1000 {
            let [a, b, c, d] = maps[k];
            (u, v) = (a * u + b * v, c * u + d * v);
        }
        u
    };
    let exact: Vec<Vec3> = (0..1000).map(|g| Vec3::new(exact(g, 0), exact(g, 1), exact(g, 2))).collect();
    let size = (exact.iter().map(Vec3::norm_squared).sum::<f64>() / 1000.0).sqrt();
    for (name, options) in runs {
        let (seconds, traced) = timed(|| trace(system, &grains, options, &Nothing).expect("a sound run"));
        let off = traced.ensemble.positions().iter().zip(&exact).map(|(a, b)| (a - b).norm_squared()).sum::<f64>();
        let told = traced.error.map_or("-".into(), |e| format!("{:.1e}", e.position));
        println!(
            "| 1000 grains, 1000 RF periods, ideal trap, {name} | {seconds:.3} | {:.0} M steps/s | {:.1e}, told {told} |",
            traced.accepted as f64 / seconds * 1e-6,
            (off / 1000.0).sqrt() / size,
        );
    }
}

fn batch<'a>(grains: &'a Ensemble, time: &'a [f64]) -> Batch<'a> {
    Batch {
        position: grains.positions(),
        velocity: grains.velocities(),
        time,
        charge: grains.charges(),
        mass: grains.masses(),
        radius: grains.radii(),
        id: grains.ids(),
    }
}

/// Root mean square of the differences over that of the second list.
fn apart(a: &[Vec3], b: &[Vec3]) -> f64 {
    let off: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (off / b.iter().map(Vec3::norm_squared).sum::<f64>()).sqrt()
}

/// Coulomb forces by the direct sum.
fn pairs() {
    for (count, times) in [(100, 2000), (1000, 50), (8000, 1)] {
        let grains = cloud(count);
        let time = vec![0.0; count];
        let (mut force, mut slow) = (vec![Vec3::zeros(); count], vec![Vec3::zeros(); count]);
        let mut scratch = Scratch::default();
        let (seconds, ()) = timed(|| {
            for _ in 0..times {
                force.fill(Vec3::zeros());
                Coulomb::default().add(&batch(&grains, &time), &mut scratch, &mut force);
            }
        });
        tracer::force::coulomb::slow_coulomb(&batch(&grains, &time), &mut slow);
        println!(
            "| Coulomb forces, {count} grains, direct | {:.2e} | {:.2} G pairs/s | {:.1e} |",
            seconds / f64::from(times),
            (count * count) as f64 * f64::from(times) / seconds * 1e-9,
            apart(&force, &slow),
        );
    }
}

/// A thousand grains that repel each other in a trap with gas, RF periods of π s. They start at random and come to rest during
/// the first forty periods: told are these, and for a thousand what twenty more take. Errors after ten: later the flights part
/// from each other as those of any cloud that melts and freezes do.
fn cloud_in_a_gas() {
    let even = cloud(1000);
    let mut grains = Ensemble::new();
    for k in 0..1000 {
        let position = even.positions()[k] * 0.15;
        grains
            .push(Grain { position, velocity: Vec3::zeros(), charge: 1e-15, mass: 1e-15, ..even.grain(k) })
            .expect("sound");
    }
    let system = paul_trap_in(Hidden(QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0)))
        .with_drag(Drag::Rate(0.05))
        .with_coulomb();
    let fly = |periods: f64, options: &Options| {
        let options = Options { duration: periods * PI, estimate_error: false, ..options.clone() };
        once(|| trace(&system, &grains, &options, &Nothing).expect("a sound run"))
    };
    let dop853 = |tolerance| Options { method: Method::Dop853, tolerance, ..Options::default() };
    let (_, best) = fly(10.0, &dop853(1e-11));
    for (name, options) in [
        ("as by default", Options::default()),
        ("Dop853", dop853(1e-9)),
        ("Dop853, 1e-7 a step", dop853(1e-7)),
        (
            "Stoermer12, 40 steps a period",
            Options { method: Method::Stoermer12, step: Some(PI / 40.0), ..Options::default() },
        ),
    ] {
        let (_, ten) = fly(10.0, &options);
        let ((first, forty), (all, sixty)) = (fly(40.0, &options), fly(60.0, &options));
        let forces = (sixty.force_evaluations - forty.force_evaluations) as f64 / 2e4;
        println!(
            "| 1000 grains with Coulomb and drag, {name}: 40 RF periods; 1000 | {first:.1}; {:.0} | {forces:.0} forces a period in the end | {:.1e} after ten |",
            first + 48.0 * (all - first),
            apart(ten.ensemble.positions(), best.ensemble.positions()),
        );
    }
}

/// Maps of the first region of stability, 200 x 200; the error is the part of the map that differs from Floquet's.
fn stability() {
    use tracer::stability::{mathieu_map, mathieu_map_by_flights};
    let a: Vec<f64> = (0..200).map(|i| -0.2 + 0.0035 * f64::from(i)).collect();
    let q: Vec<f64> = (0..200).map(|j| 0.005 * (0.5 + f64::from(j))).collect();
    // Often enough to be seen by a coarse clock.
    let (floquet, exact) = timed(|| (1..50).fold(mathieu_map(&a, &q, 0.0), |_, _| mathieu_map(&a, &q, 0.0)));
    let floquet = floquet / 50.0;
    let (flights, flown) = timed(|| mathieu_map_by_flights(&a, &q, 100, 1e2));
    let differ = (0..40_000).filter(|k| exact.is_stable(k / 200, k % 200) != flown.is_stable(k / 200, k % 200)).count();
    println!("| stability map 200 x 200, Floquet | {floquet:.4} | {:.0} M points/s | - |", 0.04 / floquet);
    println!(
        "| the same by flights of 100 periods | {flights:.4} | {:.0} M periods/s | {:.1e} |",
        4.0 / flights,
        differ as f64 / 40_000.0
    );
}

/// Coulomb forces by multipoles; the error at a thousand of the grains, over the size of all forces.
fn many() {
    for (count, accuracy) in [
        (4001, None),
        (4001, Some(1e-4)),
        (4001, Some(1e-6)),
        (100_000, Some(1e-4)),
        (100_000, Some(1e-6)),
        (1_000_000, Some(1e-4)),
    ] {
        let grains = cloud(count);
        let time = vec![0.0; count];
        let mut force = vec![Vec3::zeros(); count];
        let mut scratch = Scratch::default();
        let sum = Coulomb { accuracy };
        let (seconds, ()) = timed(|| {
            force.fill(Vec3::zeros());
            sum.add(&batch(&grains, &time), &mut scratch, &mut force);
        });
        let (mut off, mut size) = (0.0, 0.0);
        for i in (0..count).step_by(count / 1000) {
            let mut exact = Vec3::zeros();
            for (j, r) in grains.positions().iter().enumerate().filter(|(j, _)| *j != i) {
                let d = grains.positions()[i] - r;
                exact += d * (field::constants::COULOMB * grains.charges()[j] / d.norm().powi(3));
            }
            off += (force[i] - exact).norm_squared();
            size += exact.norm_squared();
        }
        let how = accuracy.map_or("direct".into(), |accuracy| format!("{accuracy:.0e} asked"));
        println!(
            "| Coulomb forces, {count} grains, {how} | {seconds:.3} | {:.2} M grains/s | {:.1e} |",
            count as f64 / seconds * 1e-6,
            (off / size).sqrt(),
        );
    }
}

/// A step of ten grains that repel each other in a trap.
fn coupled() {
    let grains = cloud(10);
    let mut weak = Ensemble::new();
    for k in 0..10 {
        weak.push(Grain { charge: 1e-7, mass: 1e-7, ..grains.grain(k) }).expect("a sound grain");
    }
    let system = paul_trap().with_coulomb();
    for (method, steps) in [(Method::Verlet, 100.0), (Method::BlanesMoan14, 16.0), (Method::Dop853, 16.0)] {
        let options = Options {
            method,
            step: Some(PI / steps),
            duration: 1000.0 * PI,
            estimate_error: false,
            ..Options::default()
        };
        let (seconds, traced) = timed(|| trace(&system, &weak, &options, &Nothing).expect("a sound run"));
        let taken = traced.accepted as f64 / 10.0;
        println!(
            "| ten coupled grains, {method:?} | {seconds:.3} | {:.2} µs/step, {:.2} µs/force | - |",
            seconds / taken * 1e6,
            seconds / traced.force_evaluations as f64 * 1e7,
        );
    }
}

/// Peak memory of a million grains that do not feel each other, without samples.
fn memory() {
    let peak = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or_default();
        line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1024.0
    };
    let count = 1_000_000;
    let grains = cloud(count);
    let before = peak();
    let options = Options { duration: PI, estimate_error: false, ..Options::default() };
    let clock = Instant::now();
    let start = seconds(&clock);
    let traced = trace(&paul_trap(), &grains, &options, &Nothing).expect("a sound run");
    println!(
        "| 1e6 independent grains, one period | {:.2} | {:.0} bytes a grain beside the ensemble's {:.0} | - |",
        seconds(&clock) - start,
        (peak() - before) / count as f64,
        before / count as f64,
    );
    drop(traced);
}
