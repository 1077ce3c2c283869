//! The numbers that are reported of a point, each with its error.

use std::f64::consts::FRAC_PI_2;

use field::zonal::HIGHEST;
use field::{Waveform, WaveformPart, Zonal, zonal};
use meshes::{SurfaceMesh, SurfaceTree, Vec3};
use tracer::Outcome;

use super::row::Number;
use crate::case::Case;
use crate::output::summary::{SolveSummary, TraceSummary};
use crate::pipeline::drives::{exact_field, strengths};
use crate::pipeline::flights::Flights;
use crate::pipeline::region;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;

/// Capacitances are reported of up to so many electrodes.
const LISTED: usize = 8;

/// Ends of flights are reported one by one of up to so many grains.
const FEW_GRAINS: usize = 5;

/// Numbers of the field: capacitances, charges and voltages at the start, multipoles.
pub fn of_field(case: &Case, solution: &Solution) -> Vec<Number> {
    let start = case.trace.as_ref().map_or(0.0, |trace| trace.start);
    let strengths = strengths(case, &solution.basis, start);
    let summary = SolveSummary::new(case, solution, &strengths);
    let mut numbers = vec![
        Number::new("panels", "", summary.panels as f64, None),
        Number::new("unknowns", "", summary.unknowns as f64, None),
        Number::new("capacitance_error", "", summary.error_estimate, None),
        Number::new("field_error", "", summary.field_error_estimate, None),
    ];
    let (names, matrix) = (&summary.electrodes, &summary.capacitance_matrix_farad);
    let largest = matrix.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
    let error = summary.error_estimate * largest;
    if names.len() <= LISTED {
        for (i, row) in matrix.iter().enumerate() {
            for (j, c) in row.iter().enumerate().skip(i) {
                numbers.push(Number::new(format!("capacitance.{}.{}", names[i], names[j]), "F", *c, error));
            }
        }
    }
    // Charges are sums of capacitances times voltages.
    let volts: f64 = summary.voltages_at_start.iter().map(|v| v.abs()).sum();
    for (electrode, name) in names.iter().enumerate() {
        let charge = summary.charges_at_start[electrode];
        numbers.push(Number::new(format!("charge.{name}"), "C", charge, error * volts));
        if matches!(case.electrodes[electrode].drive, crate::case::Drive::Charge(_)) {
            let value = summary.voltages_at_start[electrode];
            let relative = summary.error_estimate * value.abs();
            numbers.push(Number::new(format!("voltage.{name}"), "V", value, relative));
        }
    }
    numbers.extend(multipoles(case, solution));
    numbers
}

/// Where multipoles are told: the centre and the radius of the sphere. `None` where it would lie in a conductor.
pub fn sphere(case: &Case, mesh: &SurfaceMesh, tree: &SurfaceTree) -> Option<(Vec3, f64)> {
    let region = region::trap_box(case, mesh);
    let center = case.study.center.unwrap_or((region.min + region.max) * 0.5);
    if tree.inside(&center).is_some() {
        return None;
    }
    let reach = (region.max - region.min).norm() + (center - region.min).norm();
    let nearest = tree.nearest(&center, reach).map(|nearest| nearest.distance);
    let plane = case.field.ground.map(|plane| plane.height(&center));
    let free = nearest.into_iter().chain(plane).fold(f64::INFINITY, f64::min);
    let radius = case.study.radius.unwrap_or(if free.is_finite() { 0.5 * free } else { 0.25 * reach });
    (free > 0.0 && radius < free).then_some((center, radius))
}

/// Multipoles of the static field and of the first RF, `A0_static` ... `A8_rf`, V/m^l.
///
/// Their errors: what a field that is off by its estimated error, against the strongest on the sphere, makes of them at most,
///
///   |δA_l| ≤ √(2l + 1) ε E r / r^l,
///
/// since |δφ| ≤ ε E r relative to the centre and the mean of |P_l| is at most 1/√(2l + 1).
fn multipoles(case: &Case, solution: &Solution) -> Vec<Number> {
    let driven = exact_field(case, &solution.basis);
    let Some((center, radius)) = sphere(case, &solution.basis.mesh, driven.exact.tree()) else { return Vec::new() };
    let of = zonal(&**driven.field.basis(), &center, &case.study.axis, radius);
    let waveforms = driven.field.waveforms();
    let constant: Vec<f64> = waveforms.iter().map(|waveform| waveform.constant).collect();
    let mut numbers = told("static", &of, &constant, solution.errors.field, radius);
    if let Some(rf) = amplitudes(waveforms) {
        numbers.extend(told("rf", &of, &rf, solution.errors.field, radius));
    }
    numbers
}

fn told(what: &str, of: &Zonal, weights: &[f64], error: f64, radius: f64) -> Vec<Number> {
    let strongest: f64 = of.strongest.iter().zip(weights).map(|(e, w)| e * w.abs()).sum();
    let number = |l: usize| {
        let value: f64 = of.coefficients.iter().zip(weights).map(|(a, w)| a[l] * w).sum();
        let error = ((2 * l + 1) as f64).sqrt() * error * strongest * radius.powi(1 - l as i32);
        let unit = match l {
            0 => "V".to_owned(),
            1 => "V/m".to_owned(),
            l => format!("V/m^{l}"),
        };
        Number::new(format!("A{l}_{what}"), &unit, value, error)
    };
    (0..=HIGHEST).map(number).collect()
}

/// The amplitude of each channel at the first frequency there is: what goes with cos ωt, or, where nothing does, with -sin ωt.
pub fn amplitudes(waveforms: &[Waveform]) -> Option<Vec<f64>> {
    let sines = |waveform: &Waveform| -> Vec<(f64, f64, f64)> {
        let sine = |part: &WaveformPart| match *part {
            WaveformPart::Sine { amplitude, frequency, phase } => Some((amplitude, frequency, phase)),
            _ => None,
        };
        waveform.parts.iter().filter_map(sine).collect()
    };
    let (_, first, _) = waveforms.iter().flat_map(sines).next()?;
    let of = |lag: f64| -> Vec<f64> {
        let at_first =
            |waveform: &Waveform| sines(waveform).into_iter().filter(|(_, frequency, _)| *frequency == first);
        let part = |waveform: &Waveform| at_first(waveform).map(|(a, _, phase)| a * (phase - lag).cos()).sum();
        waveforms.iter().map(part).collect()
    };
    let size = |amplitudes: &[f64]| amplitudes.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
    let (cosines, sines) = (of(0.0), of(FRAC_PI_2));
    // Rounding of the phases.
    Some(if size(&cosines) > 1e-9 * size(&sines) { cosines } else { sines })
}

/// Numbers of the table.
pub fn of_table(tabulated: &Tabulated) -> Vec<Number> {
    vec![
        Number::new("table_nodes", "", tabulated.report.nodes as f64, None),
        Number::new("table_error", "", tabulated.report.error(), None),
    ]
}

/// Numbers of the flights: how many ended how, where those ended that flew to the end, and how strongly they are coupled.
pub fn of_flights(case: &Case, flights: &Flights) -> Vec<Number> {
    let summary = TraceSummary::new(case, flights);
    let outcomes = &summary.outcomes;
    let count = |name: &str, n: usize| Number::new(name, "", n as f64, None);
    let mut numbers = vec![count("grains", summary.grains), count("still_flying", outcomes.time_up)];
    for electrode in &case.electrodes {
        let struck = outcomes.struck.get(&electrode.name).and_then(serde_json::Value::as_u64).unwrap_or(0);
        numbers.push(count(&format!("struck.{}", electrode.name), struck as usize));
    }
    numbers.push(count("left_region", outcomes.left_region));
    numbers.push(count("unstable", outcomes.unstable));
    numbers.push(count("steps", summary.steps as usize));
    let (ensemble, endings) = (&flights.traced.ensemble, &flights.traced.endings);
    let error = summary.position_error_estimate;
    let flying: Vec<Vec3> = (0..endings.len())
        .filter(|&g| matches!(endings[g].outcome, Outcome::TimeUp | Outcome::Stopped))
        .map(|g| ensemble.positions()[g])
        .collect();
    if !flying.is_empty() {
        let n = flying.len() as f64;
        let middle = flying.iter().sum::<Vec3>() / n;
        let spread = (flying.iter().map(|p| (p - middle).norm_squared()).sum::<f64>() / n).sqrt();
        for (axis, value) in ["x", "y", "z"].iter().zip(middle.iter()) {
            numbers.push(Number::new(format!("cloud_{axis}"), "m", *value, error));
        }
        numbers.push(Number::new("cloud_radius", "m", spread, error));
    }
    if endings.len() <= FEW_GRAINS {
        for (g, ending) in endings.iter().enumerate() {
            numbers.push(Number::new(format!("grain{}.time", g + 1), "s", ending.time, None));
            for (axis, value) in ["x", "y", "z"].iter().zip(ensemble.positions()[g].iter()) {
                numbers.push(Number::new(format!("grain{}.{axis}", g + 1), "m", *value, error));
            }
        }
    }
    if let Some(plasma) = &summary.plasma {
        numbers.push(Number::new("temperature", "K", plasma.temperature_kelvin, None));
        numbers.push(Number::new("gamma_wigner_seitz", "", plasma.gamma_wigner_seitz, None));
    }
    numbers
}
