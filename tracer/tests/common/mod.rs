//! Closed-form fields, reference values and shorthands for the tests.

#![allow(dead_code)] // each test file uses a part of it

use std::sync::Arc;

use field::{BasisField, DrivenField, Samples, Waveform, WaveformPart};
use meshes::Vec3;
use serde_json::Value;
use tracer::{Ending, Ensemble, Grain, Method, Nothing, Options, Outcome, Sample, System, Traced, Trajectories, trace};

pub fn v(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x, y, z)
}

/// φ = (lx x² + ly y² + lz z²) / (2 r0²) at 1 V.
pub struct Quadrupole {
    pub l: Vec3,
    pub r0: f64,
}

impl BasisField for Quadrupole {
    fn channels(&self) -> usize {
        1
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        samples.reset(points.len(), 1);
        for (p, r) in points.iter().enumerate() {
            let gradient = self.l.component_mul(r) / (self.r0 * self.r0);
            samples.potential[p] = 0.5 * gradient.dot(r);
            samples.gradient[p] = gradient;
        }
    }
}

/// φ = -d · r at 1 V: the field d, 1/m.
pub struct Uniform(pub Vec3);

impl BasisField for Uniform {
    fn channels(&self) -> usize {
        1
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        samples.reset(points.len(), 1);
        for (p, r) in points.iter().enumerate() {
            samples.potential[p] = -self.0.dot(r);
            samples.gradient[p] = -self.0;
        }
    }
}

/// φ = s²/2 + quartic s⁴/4, s² = x² + 2 y² + 3 z², at 1 V: a well with three frequencies that depend on the amplitude.
pub struct Well {
    pub quartic: f64,
}

impl BasisField for Well {
    fn channels(&self) -> usize {
        1
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        samples.reset(points.len(), 1);
        for (p, r) in points.iter().enumerate() {
            let weighted = v(r.x, 2.0 * r.y, 3.0 * r.z);
            let s2 = weighted.dot(r);
            samples.potential[p] = 0.5 * s2 + 0.25 * self.quartic * s2 * s2;
            samples.gradient[p] = weighted * (1.0 + self.quartic * s2);
        }
    }
}

/// A basis of one channel with a constant voltage.
pub fn dc(basis: impl BasisField + 'static, volts: f64) -> DrivenField {
    DrivenField::new(Arc::new(basis), vec![Waveform::constant(volts)])
}

/// A basis of one channel with `constant - amplitude cos(omega t)`, the sign of the Mathieu equation.
pub fn rf(basis: impl BasisField + 'static, constant: f64, amplitude: f64, omega: f64) -> DrivenField {
    let frequency = omega / std::f64::consts::TAU;
    let parts = vec![WaveformPart::Sine { amplitude: -amplitude, frequency, phase: 0.0 }];
    DrivenField::new(Arc::new(basis), vec![Waveform { constant, parts }])
}

/// Grains of charge 1 C and mass 1 kg obey u'' + (a - 2 q cos 2t) u = 0 along x, with -a and -q along y.
pub fn mathieu(a: f64, q: f64) -> System {
    System::new().with_field(rf(Quadrupole { l: v(1.0, -1.0, 0.0), r0: 1.0 }, a, 2.0 * q, 2.0))
}

pub fn grain(position: Vec3, velocity: Vec3, charge: f64, mass: f64) -> Grain {
    Grain { position, velocity, charge, mass, radius: 0.0, id: 0, group: 0 }
}

/// Grains with ids 0, 1, 2, ...
pub fn ensemble(grains: impl IntoIterator<Item = Grain>) -> Ensemble {
    let mut ensemble = Ensemble::new();
    for (k, grain) in grains.into_iter().enumerate() {
        ensemble.push(Grain { id: k as u64, ..grain }).unwrap();
    }
    ensemble
}

/// Options of a plain run: tight, no second run.
pub fn options(method: Method, duration: f64) -> Options {
    Options { method, duration, tolerance: 1e-13, estimate_error: false, ..Options::default() }
}

pub fn run(system: &System, grains: &Ensemble, options: &Options) -> Traced {
    trace(system, grains, options, &Nothing).unwrap()
}

/// Where a grain of charge 1 C and mass 1 kg is after the run, and how fast.
pub fn end(system: &System, r: Vec3, u: Vec3, options: &Options) -> (Vec3, Vec3) {
    let traced = run(system, &ensemble([grain(r, u, 1.0, 1.0)]), options);
    assert_eq!(traced.endings[0].outcome, Outcome::TimeUp);
    (traced.ensemble.positions()[0], traced.ensemble.velocities()[0])
}

/// The samples of a run.
pub fn samples(system: &System, grains: &Ensemble, options: &Options) -> (Vec<Vec<Sample>>, Vec<Ending>) {
    let kept = Trajectories::default();
    let traced = trace(system, grains, options, &kept).unwrap();
    (kept.into_samples(), traced.endings)
}

/// Numbers in [-1, 1) from a fixed seed.
pub fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut stream = tracer::stream::Stream::new(seed, tracer::stream::Purpose::Start, 0, 0);
    move || 2.0 * stream.unit() - 1.0
}

/// The cases of a reference file whose id starts with `prefix`.
pub fn cases(file: &str, prefix: &str) -> Vec<Case> {
    let text = match file {
        "mathieu" => include_str!("../reference/mathieu.json"),
        "penning" => include_str!("../reference/penning.json"),
        _ => include_str!("../reference/ocp.json"),
    };
    let all: Value = serde_json::from_str(text).unwrap();
    let cases: Vec<Case> = all["cases"].as_array().unwrap().iter().cloned().map(Case).collect();
    let wanted: Vec<Case> = cases.into_iter().filter(|c| c.id().starts_with(prefix)).collect();
    assert!(!wanted.is_empty(), "no case {prefix} in {file}");
    wanted
}

/// One case of a reference file.
pub struct Case(Value);

impl Case {
    pub fn id(&self) -> &str {
        self.0["id"].as_str().unwrap()
    }

    fn find(&self, name: &str) -> &Value {
        self.0["inputs"].get(name).or_else(|| self.0["outputs"].get(name)).unwrap_or_else(|| panic!("{name}"))
    }

    pub fn has(&self, name: &str) -> bool {
        self.0["outputs"].get(name).is_some()
    }

    pub fn number(&self, name: &str) -> f64 {
        self.find(name).as_f64().unwrap()
    }

    pub fn list(&self, name: &str) -> Vec<f64> {
        self.find(name).as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    }

    pub fn vector(&self, name: &str) -> Vec3 {
        Vec3::from_iterator(self.list(name))
    }

    pub fn vectors(&self, name: &str) -> Vec<Vec3> {
        let rows = self.find(name).as_array().unwrap();
        rows.iter()
            .map(|row| Vec3::from_iterator(row.as_array().unwrap().iter().map(|x| x.as_f64().unwrap())))
            .collect()
    }
}

/// Slope of log error over log step between neighbours.
pub fn slopes(steps: &[f64], errors: &[f64]) -> Vec<f64> {
    let pairs = steps.windows(2).zip(errors.windows(2));
    pairs.map(|(h, e)| (e[0] / e[1]).ln() / (h[0] / h[1]).ln()).collect()
}
