//! Where grains stay, over two voltages or over a and q: the linear motion at the centre, Mathieu's equation on its axes, and grains
//! that are traced from off the centre.
//!
//! Voltages are weights on solved fields: nothing is solved again.

use std::sync::Arc;

use field::analysis::{Expansion, Tones, clearance};
use field::{DrivenField, TabulatedField, Waveform};
use meshes::Vec3;
use nalgebra::Matrix3;
use rayon::prelude::*;
use tracer::secular::{Neighbourhood, common_period};
use tracer::stability::mathieu_map;
use tracer::{Ensemble, Grain, Options, Outcome, System, Trajectories, trace};

use super::report::{ChartCenter, ChartGrain, ChartReport};
use super::species::{alone, bends, parameters, principal};
use crate::CaseSource;
use crate::case::{Case, Chart, ChartVoltages, GROUND, GrainGroup};
use crate::pipeline::solution::Solution;
use crate::pipeline::{Failure, Reporter, drives, flights, ready, region};

/// Start of a grain along each axis, of the distance of the nearest electrode.
const START: f64 = 0.1;

/// Grains stay in a chart or not: their ways need not be known better.
const TOLERANCE: f64 = 1e-7;

/// A scan over voltages. Lists go row by row, x fastest.
#[derive(Clone, Debug)]
pub struct Scan {
    /// Values of both axes, in their units.
    pub values: [Vec<f64>; 2],
    /// How far beyond the edge of stability the linear motion at the centre is; not a number where there is no orbit.
    pub floquet: Vec<f64>,
    /// The same of an ideal trap with this a and q on each axis.
    pub ideal: Vec<f64>,
    /// Grains that were traced.
    pub grains: Vec<ChartGrain>,
}

/// One place of a chart: the voltage of each function, and what follows.
struct Place<'a> {
    case: &'a Case,
    solution: &'a Solution,
    chart: &'a Chart,
    /// Factors of what oscillates and what is constant for q = 1 and a = 1.
    scales: [f64; 2],
}

impl Place<'_> {
    /// Waveforms of electrodes and sources where both values are given, floating electrodes included.
    fn waveforms(&self, [x, y]: [f64; 2]) -> Vec<Waveform> {
        let given = match &self.chart.voltages {
            ChartVoltages::Scaled => {
                let (mut given, _) = self.case.given();
                for waveform in &mut given {
                    waveform.constant *= self.scales[1] * y;
                    waveform.parts.iter_mut().for_each(|part| *part.amplitude_mut() *= self.scales[0] * x);
                }
                given
            }
            ChartVoltages::Corners(corners) => {
                let part = |k: usize, value: f64| {
                    let axis = &self.chart.axes[k];
                    (value - axis.from) / (axis.to - axis.from)
                };
                let (s, t) = (part(0, x), part(1, y));
                let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
                let mut given = corners[0].clone();
                for (k, waveform) in given.iter_mut().enumerate() {
                    waveform.constant = weights.iter().zip(corners.iter()).map(|(w, c)| w * c[k].constant).sum();
                    for (n, part) in waveform.parts.iter_mut().enumerate() {
                        let amplitude = |c: &Vec<Waveform>| *c[k].parts[n].clone().amplitude_mut();
                        *part.amplitude_mut() = weights.iter().zip(corners.iter()).map(|(w, c)| w * amplitude(c)).sum();
                    }
                }
                given
            }
        };
        let channels = drives::channels_of(self.case, &self.solution.basis, &given);
        (0..given.len()).map(|function| channels.waveform_of(function)).collect()
    }
}

/// Scans the chart of a case about a centre.
///
/// # Errors
/// No voltage oscillates, or nothing is constant that `a` could scale; a grain that cannot be traced.
pub fn scan(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    tabulated: Option<&field::PotentialTable>,
    chart: &Chart,
    center: Vec3,
    reporter: &dyn Reporter,
) -> Result<(ChartReport, Scan), Failure> {
    reporter.stage("chart");
    let units = Arc::new(solution.basis.panel_sum());
    // Sources may leave room without end: then half of what they span.
    let bounds = region::trap_box(case, &solution.basis.mesh);
    let room = clearance(&units, &center).min(0.5 * (bounds.max - bounds.min).norm());
    if room <= 0.0 {
        let problem = "there is no centre outside of conductors to chart the stability at";
        return Err(source.error_at("analysis.chart", problem, "give `analysis.min` and `max` round the trap").into());
    }
    let expansion = Expansion::near(&*units, center, room);
    let jets = expansion.jets(&center);
    let group = &case.grains[0];
    let specific = group.charge / group.mass;
    let mut place = Place { case, solution, chart, scales: [1.0, 1.0] };
    let middle = chart.axes.each_ref().map(|axis| 0.5 * (axis.from + axis.to));
    // 1. Periods are those of the case: charts vary amplitudes.
    let of_case = place.waveforms(if chart.voltages == ChartVoltages::Scaled { [1.0, 1.0] } else { middle });
    let tones = Tones::of(&of_case).unwrap_or_default();
    let frequency = tones.strongest();
    let frequencies: Vec<f64> = tones.tones.iter().map(|t| t.frequency).collect();
    let (Some(frequency), Some(period)) = (frequency, common_period(&frequencies)) else {
        let problem = "a chart of stability needs voltages that oscillate, with a period in common";
        return Err(source.error_at("analysis.chart", problem, "give an electrode an `rf`").into());
    };
    let found = bends(&tones, &jets, specific, frequency);
    let axes = principal(&if found[1].norm() >= found[2].norm() { found[1] } else { found[2] }).1;
    let (a, q) = parameters(&found, &axes);
    let main = (0..3).fold(0, |best, k| if q[k].abs() > q[best].abs() * (1.0 + 1e-9) { k } else { best });
    if chart.voltages == ChartVoltages::Scaled {
        if q[main] == 0.0 || a[main].abs() < 1e-9 * q[main].abs() {
            let help = "give an electrode a `dc` that the chart can scale, or chart two voltages";
            let problem = format!("at the case's voltages a is {:.1e} and q is {:.1e}", a[main], q[main]);
            return Err(source.error_at("analysis.chart", problem, help).into());
        }
        place.scales = [1.0 / q[main], 1.0 / a[main]];
    }
    let flown_in = ready::flight_region(case, &solution.basis.mesh);
    let system = alone(case, DrivenField::new(units.clone(), of_case), flown_in);
    let rate = system.drag_rate(group.mass, group.radius).unwrap_or(0.0);
    let k = rate / (std::f64::consts::TAU * frequency);
    let acceleration = case.forces.gravity + case.forces.constant / group.mass;
    // 2. Linear motion at each place.
    let values = chart.axes.each_ref().map(|axis| spread(axis.from, axis.to, axis.steps));
    let (columns, nodes) = (values[0].len(), values[0].len() * values[1].len());
    let at = |n: usize| [values[0][n % columns], values[1][n / columns]];
    let both: Vec<[f64; 2]> = (0..nodes)
        .into_par_iter()
        .map(|n| {
            let waveforms = place.waveforms(at(n));
            let near = Neighbourhood {
                expansion: &expansion,
                waveforms: &waveforms,
                specific_charge: specific,
                rate,
                acceleration,
                magnetic_field: case.forces.magnetic_field,
                period: Some(period),
            };
            let tones = Tones::of(&waveforms).unwrap_or_default();
            let matrices: [Matrix3<f64>; 3] = bends(&tones, &jets, specific, frequency);
            let (a, q) = parameters(&matrices, &axes);
            [near.excess(&center).unwrap_or(f64::NAN), ideal_excess(&a, &q, k)]
        })
        .collect();
    let floquet: Vec<f64> = both.iter().map(|pair| pair[0]).collect();
    let ideal: Vec<f64> = both.iter().map(|pair| pair[1]).collect();
    // 3. Grains.
    let distance = chart.grains.and_then(|grains| grains.distance).unwrap_or(START * room);
    let flown = match &chart.grains {
        None => Vec::new(),
        Some(grains) => {
            let basis: Arc<dyn field::BasisField> = match tabulated {
                Some(table) => {
                    let functions = solution.basis.functions();
                    let unit = |k: usize| (0..functions).map(|i| f64::from(u8::from(i == k))).collect();
                    let weights: Vec<Vec<f64>> = (0..functions).map(unit).collect();
                    Arc::new(TabulatedField::combined(&solution.basis, table, &weights))
                }
                None => units.clone(),
            };
            let surface = flights::obstacles(&solution.basis.mesh, case.field.ground.as_ref(), &flown_in);
            let [xs, ys] = chart.axes.each_ref().map(|axis| spread(axis.from, axis.to, grains.steps));
            let start = center + (axes[0] + axes[1] + axes[2]) * distance;
            let fly = |n: usize| {
                let values = [xs[n % xs.len()], ys[n / xs.len()]];
                let field = DrivenField::new(Arc::clone(&basis), place.waveforms(values));
                let system =
                    System { region: Some(flown_in), surface: surface.clone(), ..alone(case, field, flown_in) };
                flight(&system, group, case, start, grains.periods as f64 * period, values)
            };
            (0..xs.len() * ys.len()).into_par_iter().map(fly).collect::<Result<Vec<_>, _>>()?
        }
    };
    let scan = Scan { values, floquet, ideal, grains: flown };
    let report = ChartReport::new(chart, group, &scan, &ChartCenter { center, axes, main, distance, period });
    Ok((report, scan))
}

/// Traces a grain.
fn flight(
    system: &System,
    group: &GrainGroup,
    case: &Case,
    start: Vec3,
    duration: f64,
    [x, y]: [f64; 2],
) -> Result<ChartGrain, Failure> {
    let mut ensemble = Ensemble::new();
    let grain = Grain {
        position: start,
        velocity: Vec3::zeros(),
        charge: group.charge,
        mass: group.mass,
        radius: group.radius,
        id: 1,
        group: 0,
    };
    let failed = |what: String| {
        Failure::run(format!("a grain of the chart cannot be traced: {what}"), "look at the voltages of the chart")
    };
    ensemble.push(grain).map_err(|error| failed(error.to_string()))?;
    let options = Options { duration, tolerance: TOLERANCE, estimate_error: false, ..Options::default() };
    let traced =
        trace(system, &ensemble, &options, &Trajectories::default()).map_err(|error| failed(error.to_string()))?;
    let ending = traced.endings[0];
    let (outcome, point) = match ending.outcome {
        Outcome::TimeUp | Outcome::Stopped => ("retained".to_owned(), None),
        Outcome::Struck { electrode, point, .. } => {
            (case.electrodes.get(electrode).map_or(GROUND.to_owned(), |e| e.name.clone()), Some(point.into()))
        }
        Outcome::LeftRegion { point } | Outcome::Unstable { point } => ("left_region".to_owned(), Some(point.into())),
    };
    Ok(ChartGrain { x, y, outcome, time: ending.time, point })
}

/// From one value to another, evenly, the ends exactly.
fn spread(from: f64, to: f64, steps: usize) -> Vec<f64> {
    let at = |n: usize| if n + 1 == steps { to } else { from + (to - from) * n as f64 / (steps - 1) as f64 };
    (0..steps).map(at).collect()
}

/// How far beyond the edge of stability Mathieu's equation is on the worst axis.
fn ideal_excess(a: &[f64; 3], q: &[f64; 3], k: f64) -> f64 {
    let each = a.iter().zip(q).map(|(a, q)| {
        let map = mathieu_map(&[*a], &[*q], k);
        map.value[0].abs() - map.limit
    });
    each.fold(f64::NEG_INFINITY, f64::max)
}

/// Where a row or a column of excesses passes through zero, straight between values.
pub(super) fn edges(values: &[f64], excess: impl Fn(usize) -> f64) -> Vec<f64> {
    (1..values.len())
        .filter_map(|n| {
            let (before, after) = (excess(n - 1), excess(n));
            ((before < 0.0) != (after < 0.0) && (before - after).is_finite())
                .then(|| values[n - 1] + (values[n] - values[n - 1]) * before / (before - after))
        })
        .collect()
}
