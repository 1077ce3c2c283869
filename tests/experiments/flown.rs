//! A shipped case, flown.

use std::path::Path;
use std::sync::Arc;

use cases::Case;
use cases::pipeline::drives::{Driven, tabulated_field};
use cases::pipeline::flights::{Flights, fly, obstacles};
use cases::pipeline::ready::{flight_region, ready};
use cases::pipeline::solution::solve;
use cases::pipeline::tables::{Plan, table};
use cases::pipeline::{Failure, Reporter, Silent};
use field::{BasisField, Samples};
use meshes::Vec3;
use tracer::spectrum::{Line, spectrum};
use tracer::{Outcome, Sample};

/// What came of a case.
pub struct Flown {
    /// The case.
    pub case: Case,
    /// Its field.
    pub driven: Driven,
    /// Its flights.
    pub flights: Flights,
}

/// Flies a shipped case, some keys set. A table where the tracks stay, given by a test, is faster than one of the whole trap.
pub fn flown(name: &str, sets: &[&str]) -> Flown {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../cases").join(name).join("case.toml");
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let (case, source) = Case::read(&path, &sets).unwrap_or_else(|e| panic!("{name}: {e}"));
    let fly_it = || -> Result<(Driven, Flights), Failure> {
        let reporter: Arc<dyn Reporter> = Arc::new(Silent);
        let ready = ready(&case, &source, &Silent)?;
        let solution = solve(&case, &source, &ready, &Silent)?;
        let plan = Plan::new(&case, &solution.basis);
        let tabulated = table(&case, &source, &solution.basis, &plan, &Silent)?;
        let driven = tabulated_field(&case, &solution.basis, &tabulated.table);
        let mesh = &solution.basis.mesh;
        let region = flight_region(&case, mesh);
        let surface = obstacles(mesh, case.field.ground.as_ref(), &region);
        let settings = case.trace.as_ref().expect("an experiment is traced");
        let field = driven.field.clone();
        let flights =
            fly(&case, settings, &source, field, None, surface, &ready.ensemble, region, true, None, &reporter)?;
        Ok((driven, flights))
    };
    let (driven, flights) = fly_it().unwrap_or_else(|e| panic!("{name}: {e:?}"));
    Flown { case, driven, flights }
}

impl Flown {
    /// Samples of a grain.
    pub fn track(&self, grain: usize) -> &[Sample] {
        &self.flights.samples[grain]
    }

    /// How a grain ended.
    pub fn outcome(&self, grain: usize) -> &Outcome {
        &self.flights.traced.endings[grain].outcome
    }

    /// All flew until the time was up.
    pub fn all_stay(&self) -> bool {
        self.flights.traced.endings.iter().all(|ending| ending.outcome == Outcome::TimeUp)
    }

    /// Where the grains ended.
    pub fn ends(&self) -> &[Vec3] {
        self.flights.traced.ensemble.positions()
    }

    /// Lines of coordinate `k` of a grain from a time on, the strongest first.
    pub fn lines(&self, grain: usize, k: usize, since: f64) -> Vec<Line> {
        let late: Vec<f64> = self.track(grain).iter().filter(|s| s.time >= since).map(|s| s.position[k]).collect();
        spectrum(&late, self.flights.every).lines(6, 1e-5)
    }

    /// Samples in the last part of the flights, of all grains.
    pub fn late(&self, part: f64) -> impl Iterator<Item = (usize, &Sample)> {
        let last = self.track(0).last().expect("samples").time;
        let tracks = self.flights.samples.iter().enumerate();
        tracks
            .flat_map(move |(g, track)| track.iter().filter(move |s| s.time > (1.0 - part) * last).map(move |s| (g, s)))
    }

    /// Exact gradients at points of the channel that oscillates (its unit field) and of the static part (with its volts).
    pub fn fields(&self, points: &[Vec3]) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut samples = Samples::default();
        self.driven.exact.sample(points, &mut samples);
        let waveforms = self.driven.field.waveforms();
        let channels = waveforms.len();
        let of = |weight: &dyn Fn(usize) -> f64| -> Vec<Vec3> {
            (0..points.len())
                .map(|p| (0..channels).map(|c| samples.gradient[p * channels + c] * weight(c)).sum())
                .collect()
        };
        (of(&|c| f64::from(u8::from(!waveforms[c].is_constant()))), of(&|c| waveforms[c].constant))
    }
}

/// ∂²φ/∂a² at a place from the exact field, by differences of the gradient: of the oscillating unit field and of the static one.
/// Richardson's two steps leave the sixth derivative times h⁴: some 1e-6 at h a fiftieth of the trap.
pub fn curvature(flown: &Flown, place: Vec3, k: usize, h: f64) -> (f64, f64) {
    let e = Vec3::ith(k, h);
    let points = [place + e, place - e, place + e * 0.5, place - e * 0.5];
    let (rf, dc) = flown.fields(&points);
    let of = |g: &[Vec3]| {
        let (wide, near) = ((g[0][k] - g[1][k]) / (2.0 * h), (g[2][k] - g[3][k]) / h);
        (4.0 * near - wide) / 3.0
    };
    (of(&rf), of(&dc))
}

/// β of Mathieu's u'' + (a - 2 q cos 2ζ) u = 0 by its transition matrix over π, cos πβ half its trace (Runge and Kutta's fourth
/// order in 2000 steps: 1e-11; checked against `mathieu.json` in `mathieu.rs`). `None` where it is unstable.
pub fn beta(a: f64, q: f64) -> Option<f64> {
    let slope = |zeta: f64, [u, v]: [f64; 2]| [v, -(a - 2.0 * q * (2.0 * zeta).cos()) * u];
    let h = std::f64::consts::PI / 2000.0;
    let mut columns = [[1.0, 0.0], [0.0, 1.0]];
    for y in &mut columns {
        for n in 0..2000 {
            let t = f64::from(n) * h;
            let add = |k: [f64; 2], s: f64| [y[0] + s * k[0], y[1] + s * k[1]];
            let k1 = slope(t, *y);
            let k2 = slope(t + 0.5 * h, add(k1, 0.5 * h));
            let k3 = slope(t + 0.5 * h, add(k2, 0.5 * h));
            let k4 = slope(t + h, add(k3, h));
            *y = [0, 1].map(|c| y[c] + h / 6.0 * (k1[c] + 2.0 * k2[c] + 2.0 * k3[c] + k4[c]));
        }
    }
    let half = 0.5 * (columns[0][0] + columns[1][1]);
    (half.abs() <= 1.0).then(|| half.acos() / std::f64::consts::PI)
}

/// A_0, A_1, ... of φ = Σ A_l r^l P_l about the origin, of a unit potential along an axis of symmetry, where P_l = 1: the
/// polynomial through 17 Chebyshev points out to `reach`.
pub fn axial_multipoles(phi: &dyn Fn(f64) -> f64, reach: f64) -> Vec<f64> {
    let count = 17;
    let nodes: Vec<f64> =
        (0..count).map(|k| (std::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(count)).cos()).collect();
    let matrix = nalgebra::DMatrix::from_fn(nodes.len(), nodes.len(), |i, j| nodes[i].powi(j as i32));
    let values = nalgebra::DVector::from_iterator(nodes.len(), nodes.iter().map(|t| phi(t * reach)));
    let solved = matrix.lu().solve(&values).expect("Chebyshev points are distinct");
    solved.iter().enumerate().map(|(l, c)| c / reach.powi(l as i32)).collect()
}
