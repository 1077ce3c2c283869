//! The numbers of an analysis that a study reports: those of the first group of grains, about the centre of the study.
//!
//! `graintrap analyse` tells more, and about a centre that it finds by itself. Here axes are those of coordinates, so that a number
//! means the same at every point of a study, and only what is asked for is worked out.

use std::f64::consts::{PI, TAU};

use field::Samples;
use field::analysis::critical::polish;
use field::analysis::{
    Effective, Expansion, Jet, Kind, Opening, Search, Space, Tones, clearance, critical_points_on, values_on, well,
};
use field::constants::COULOMB;
use meshes::Vec3;
use tracer::secular::{Mathieu, Neighbourhood, common_period, effective};

use super::row::Number;
use crate::CaseSource;
use crate::case::{Case, GrainGroup};
use crate::pipeline::analysis::species::{alone, bends, in_order, on_surface, parameters};
use crate::pipeline::analysis::{first_wall, patterns};
use crate::pipeline::drives::{Driven, exact_field};
use crate::pipeline::solution::Solution;
use crate::pipeline::{Failure, region};

/// Elementary charge, C.
const E: f64 = 1.602_176_634e-19;

/// Places along a radius at which the mean force is looked at before the circle is narrowed down.
const PLACES: usize = 96;

/// Error of a depth, as part of it, from which on it is one of the lattice.
const COARSE: f64 = 0.05;

/// What the numbers of a trap share.
struct Trap<'a> {
    case: &'a Case,
    solution: &'a Solution,
    driven: &'a Driven,
    tones: Tones,
    space: Space<'a>,
    bounds: crate::case::Region,
    center: Vec3,
}

/// The numbers that are asked for, some without a value where there is none.
///
/// # Errors
/// Voltages without a mean.
pub fn of_trap(case: &Case, source: &CaseSource, solution: &Solution) -> Result<Vec<Number>, Failure> {
    let asked = case.study.asked;
    if !asked.trap() {
        return Ok(Vec::new());
    }
    let driven = exact_field(case, &solution.basis);
    let Some(tones) = Tones::of(driven.field.waveforms()) else {
        let problem = "a voltage that is sampled from a file has no mean and no frequency to analyse";
        return Err(source.error_at("study", problem, "give it as dc, sine or square waves").into());
    };
    let bounds = case.analysis.region.unwrap_or_else(|| region::trap_box(case, &solution.basis.mesh));
    let exact = &driven.exact;
    let room = |p: &Vec3| clearance(exact, p);
    let size = 0.5 * (bounds.max - bounds.min).norm();
    let space = Space { field: &**exact, clearance: &room, error: solution.errors.field, size };
    let center = case.study.center.unwrap_or((bounds.min + bounds.max) * 0.5);
    let trap = Trap { case, solution, driven: &driven, tones, space, bounds, center };
    let mut numbers = Vec::new();
    if asked.nulls {
        trap.nulls(&mut numbers);
    }
    let Some(group) = case.grains.first() else { return Ok(numbers) };
    if asked.linear {
        trap.linear(group, &mut numbers);
    }
    if asked.well {
        trap.well(group, &mut numbers);
    }
    if asked.annulus {
        numbers.push(trap.annulus(group));
    }
    Ok(numbers)
}

fn coordinates(name: &str, position: Option<(Vec3, f64)>, numbers: &mut Vec<Number>) {
    for (k, axis) in ["x", "y", "z"].iter().enumerate() {
        let (value, error) = position.map_or((f64::NAN, f64::NAN), |(p, error)| (p[k], error));
        numbers.push(Number::new(format!("{name}_{axis}"), "m", value, error));
    }
}

impl Trap<'_> {
    /// Where the RF and the static field vanish next to the centre.
    fn nulls(&self, numbers: &mut Vec<Number>) {
        let reach = 2.0 * self.space.room(&self.center);
        let null = |pattern: Vec<f64>| {
            let found = polish(&self.space, &Effective::of_static(pattern), &self.center, reach)?;
            Some((found.position, found.position_error))
        };
        let rf = patterns(&self.tones).into_iter().next().map(|(_, pattern)| pattern);
        coordinates("null", rf.and_then(null), numbers);
        coordinates("dc_null", null(self.tones.constant.clone()), numbers);
    }

    /// Drag rate (1/s) and constant acceleration (m/s²) of a group.
    fn drag(&self, group: &GrainGroup) -> (f64, Vec3) {
        let region = tracer::Region { min: self.bounds.min, max: self.bounds.max };
        let system = alone(self.case, self.driven.field.clone(), region);
        let forces = &self.case.forces;
        (system.drag_rate(group.mass, group.radius).unwrap_or(0.0), forces.gravity + forces.constant / group.mass)
    }

    /// a, q and β along the axes of coordinates at the centre, and the frequencies of the motion about the periodic orbit there.
    fn linear(&self, group: &GrainGroup, numbers: &mut Vec<Number>) {
        let axes = [Vec3::x(), Vec3::y(), Vec3::z()];
        let specific = group.charge / group.mass;
        let (rate, acceleration) = self.drag(group);
        let room = self.space.room(&self.center);
        if room <= 0.0 {
            return;
        }
        let expansion = Expansion::near(self.space.field, self.center, room);
        let mut push = |what: &str, unit: &str, values: [f64; 3], error: f64| {
            for (axis, value) in ["x", "y", "z"].iter().zip(values) {
                numbers.push(Number::new(format!("{what}_{axis}"), unit, value, error));
            }
        };
        if let Some(frequency) = self.tones.strongest() {
            let jets = expansion.jets(&self.center);
            let (a, q) = parameters(&bends(&self.tones, &jets, specific, frequency), &axes);
            let omega = TAU * frequency;
            // What the error of each channel does, at its own voltage: as in an analysis.
            let size = |weights: &[f64]| -> f64 {
                jets.iter().zip(weights).map(|(jet, w): (&Jet, &f64)| (jet.hessian.norm() * w).abs()).sum()
            };
            let tone = self.tones.tones.iter().find(|t| t.frequency == frequency);
            let rf = tone.map_or(0.0, |t| size(&t.cosine).hypot(size(&t.sine)));
            let scale = 4.0 * specific.abs() / (omega * omega);
            let error = self.space.error * scale * size(&self.tones.constant).max(0.5 * rf);
            push("a", "", a, error);
            push("q", "", q, error);
            let k = rate / omega;
            let beta = [0, 1, 2].map(|i| Mathieu { a: a[i], q: q[i], k }.beta().unwrap_or(f64::NAN));
            push("beta", "", beta, error);
        }
        let frequencies: Vec<f64> = self.tones.tones.iter().map(|t| t.frequency).collect();
        let period = common_period(&frequencies);
        if specific == 0.0 || period.is_none() && !frequencies.is_empty() {
            return;
        }
        let near = Neighbourhood {
            expansion: &expansion,
            waveforms: self.driven.field.waveforms(),
            specific_charge: specific,
            rate,
            acceleration,
            magnetic_field: self.case.forces.magnetic_field,
            period,
        };
        let Some(equilibrium) = near.equilibrium(&self.center) else { return };
        let modes = in_order(&equilibrium.modes, &axes);
        // A mode that is not held has no frequency.
        let of = |k: usize| modes.get(k).filter(|mode| mode.is_held()).map_or(f64::NAN, |mode| mode.frequency);
        let error = modes.iter().map(|m| m.frequency_error + self.space.error * m.frequency).fold(0.0, f64::max);
        push("secular", "Hz", [of(0), of(1), of(2)], error);
    }

    /// The minimum of the effective potential nearest to the centre, and how deep the well about it is.
    fn well(&self, group: &GrainGroup, numbers: &mut Vec<Number>) {
        let (rate, acceleration) = self.drag(group);
        let potential = effective(&self.tones, group.charge / group.mass, rate, acceleration);
        let search = Search { min: self.bounds.min, max: self.bounds.max, nodes: self.case.analysis.nodes };
        let lattice = search.lattice();
        let values = values_on(&self.space, &potential, &lattice);
        let found = critical_points_on(&self.space, &potential, &lattice, &values);
        let away = |p: &Vec3| (p - self.center).norm();
        let minima: Vec<_> = found.iter().filter(|c| c.kind == Kind::Minimum).collect();
        let minimum = minima.iter().copied().min_by(|a, b| away(&a.position).total_cmp(&away(&b.position)));
        coordinates("minimum", minimum.map(|m| (m.position, m.position_error)), numbers);
        let depth = minimum.and_then(|minimum| {
            let others = minima.iter().filter(|m| !(std::ptr::eq(**m, minimum) || m.flat && minimum.flat));
            let others: Vec<Vec3> = others.map(|m| m.position).collect();
            let electrodes = self.case.electrodes.len();
            let ground = self.case.field.ground.as_ref();
            let walls = |a: &Vec3, b: &Vec3| first_wall(&self.driven.exact, ground, electrodes, a, b);
            let floor = (&minimum.position, minimum.value);
            let well = well(&self.space, &potential, (&lattice, &values), floor, &others, &walls)?;
            let mut well = on_surface(&self.space, self.solution, electrodes, &potential, minimum.value, well);
            // Where the lattice alone says how deep it is, the pass is one of those that the search found: the highest that is not above
            // what the way over the nodes has to climb. An optimiser needs a depth without the jumps of nodes.
            let height = well.depth * (1.0 + 1e-3);
            let passes = found.iter().filter(|c| c.kind == Kind::Pass).map(|c| c.value - minimum.value);
            let pass = passes.filter(|p| (0.5 * well.depth..height).contains(p)).fold(0.0, f64::max);
            if well.opening == Opening::Pass && well.error > COARSE * well.depth && pass > 0.0 {
                (well.depth, well.error) = (pass, 2.0 * self.space.error * pass);
            }
            Some(well)
        });
        let (joules, error) =
            depth.map_or((f64::NAN, f64::NAN), |well| (well.depth * group.mass, well.error * group.mass));
        numbers.push(Number::new("depth_ev", "eV", joules / E, error / E));
        let charge = group.charge.abs();
        numbers.push(Number::new("depth_v", "V", joules / charge, error / charge));
    }

    /// The circle about the axis of the study, in the plane through its centre, on which the mean forces on one of the N grains of the
    /// group balance, spread evenly on it,
    ///
    ///   -dU/dρ + k Q²/(4 m ρ²) Σ_{n<N} 1/sin(πn/N) = 0
    ///
    /// with U the effective potential per mass: outward inside of it, inward outside (physics of the annulus: Dehmelt 1967 for U; a ring
    /// of charges: Thomson 1904). Checked by `experiment_annulus_*` (the same sum against flown grains) and `cli_optimise_annulus_voltages`.
    fn annulus(&self, group: &GrainGroup) -> Number {
        let name = "annulus_radius";
        let none = || Number::new(name, "m", f64::NAN, None);
        let (rate, acceleration) = self.drag(group);
        let specific = group.charge / group.mass;
        let potential = effective(&self.tones, specific, rate, acceleration);
        let axis = self.case.study.axis;
        // Any direction across the axis: that of the coordinate which has least to do with it.
        let across = Vec3::ith(axis.iamin(), 1.0);
        let Some(out) = (across - axis * axis.dot(&across)).try_normalize(0.0) else { return none() };
        let repulsion = if self.case.forces.coulomb {
            let spread: f64 = (1..group.count).map(|n| 1.0 / (PI * n as f64 / group.count as f64).sin()).sum();
            COULOMB * group.charge * specific * spread / 4.0
        } else {
            0.0
        };
        let reach = self.bounds.max - self.bounds.min;
        let reach = 0.5 * reach.dot(&out.abs()).abs();
        let mut samples = Samples::default();
        let mut force = |radii: &[f64]| -> Vec<f64> {
            // Central differences: a thousandth of the reach to the third power is 1e-9 of it.
            let h = 1e-3 * reach;
            let points: Vec<Vec3> =
                radii.iter().flat_map(|r| [self.center + out * (r - h), self.center + out * (r + h)]).collect();
            let values = potential.values(self.space.field, &points, &mut samples);
            let slope = |n: usize| (values[2 * n + 1] - values[2 * n]) / (2.0 * h);
            radii.iter().enumerate().map(|(n, r)| repulsion / (r * r) - slope(n)).collect()
        };
        let step = reach / PLACES as f64;
        let free = |r: &f64| self.space.room(&(self.center + out * *r)) > step;
        let radii: Vec<f64> = (1..=PLACES).map(|n| n as f64 * step).take_while(free).collect();
        let along = force(&radii);
        let Some(at) = (1..radii.len()).find(|&n| along[n - 1] > 0.0 && along[n] <= 0.0) else { return none() };
        let (mut low, mut high) = (radii[at - 1], radii[at]);
        while high - low > 1e-12 * reach {
            let middle = 0.5 * (low + high);
            if force(&[middle])[0] > 0.0 { low = middle } else { high = middle }
        }
        let radius = 0.5 * (low + high);
        // What moves it: fields that are off by their error, against how fast the force changes.
        let stiffness = (along[at] - along[at - 1]).abs() / step;
        let largest = along.iter().take(at + 1).fold(0.0_f64, |m, f| m.max(f.abs()));
        Number::new(name, "m", radius, 2.0 * self.space.error * largest / stiffness + 1e-9 * reach)
    }
}
