//! What a grid does to light, to the field and to grains, against a plate in its place.

mod far;
mod near;
pub mod strikes;
mod trap;

use field::{GridFrame, Samples, zonal};
use meshes::{
    GridPatch, GridPattern, Incidence, Outline, Placement, Shape, Vec3, half_thickness, open_fraction, unit_cell,
};
use tracer::{Ensemble, Outcome, wilson};

use super::numbers::{amplitudes, sphere};
use super::row::Number;
use crate::CaseSource;
use crate::case::{Case, ElectrodeShape};
use crate::pipeline::drives::{Driven, exact_field};
use crate::pipeline::flights::Flights;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;
use crate::pipeline::{Failure, Reporter};

/// Points of the trap region in which fields are compared.
const COMPARED: usize = 300;

/// Standard deviations of the intervals that are told: 95 of 100 hold the truth.
const SIGMAS: f64 = 1.96;

/// A deviation this many times its error is told without a warning.
const RESOLVED: f64 = 3.0;

/// Field lines that are followed on each side where grains fly and the study does not say how many: known to 3 %.
const LINES: usize = 200;

/// A grid of a case.
struct Grid<'c> {
    electrode: usize,
    placement: &'c Placement,
    pitch: f64,
    pattern: &'c GridPattern,
}

impl Grid<'_> {
    /// Width of a wire, or of a bar between holes, m.
    fn wire(&self) -> f64 {
        match *self.pattern {
            GridPattern::Perforated { open, .. } => self.pitch - open,
            GridPattern::Wires { wire_radius, .. } => 2.0 * wire_radius,
        }
    }

    /// In its place; nothing without a direction.
    fn placed(&self) -> Option<GridFrame> {
        let frame = self.placement.frame().ok()?;
        let (cell, half_thickness) = (unit_cell(self.pitch, self.pattern), half_thickness(self.pattern));
        let (center, pitch, wire) = (self.placement.center, self.pitch, self.wire());
        Some(GridFrame { center, frame, cell, pitch, wire, half_thickness })
    }
}

fn grids(case: &Case) -> impl Iterator<Item = Grid<'_>> {
    case.electrodes.iter().enumerate().filter_map(|(electrode, e)| match &e.shape {
        ElectrodeShape::Shape(Shape::GridPlate { pitch, pattern, .. }) => {
            Some(Grid { electrode, placement: &e.placement, pitch: *pitch, pattern })
        }
        _ => None,
    })
}

/// The case with a plate in place of every grid: of the same outline, and as thick as the one it stands for (a sheet for wires).
///
/// # Errors
/// The case has no grid.
pub fn with_plates(case: &Case, source: &CaseSource) -> Result<Case, Failure> {
    let mut solid = case.clone();
    let mut any = false;
    for electrode in &mut solid.electrodes {
        if let ElectrodeShape::Shape(shape) = &mut electrode.shape
            && let Shape::GridPlate { outline, pattern, .. } = shape
        {
            let thickness = match pattern {
                GridPattern::Perforated { thickness, .. } => *thickness,
                GridPattern::Wires { .. } => 0.0,
            };
            *shape = match *outline {
                Outline::Rectangle(size) => Shape::Plate { size, thickness },
                Outline::Disc(radius) => Shape::Disc { radius, hole_radius: 0.0, thickness },
            };
            // A number of panels that was meant for a grid is none for a plate.
            electrode.panels = None;
            any = true;
        }
    }
    if any {
        return Ok(solid);
    }
    let help = "add an electrode with shape = \"grid_plate\", or write kind = \"sweep\"";
    Err(source.error_at("study.kind", "the case has no grid to study", help).into())
}

/// Light, field and sheet of the first grid of a case, and how far the trap is from that with plates. `tabulated` is the field in
/// which grains fly, where they do.
///
/// # Errors
/// A pattern that cannot be, a trap that cannot be analysed.
pub fn of_grid(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    solid: &Solution,
    tabulated: Option<&Tabulated>,
    reporter: &dyn Reporter,
) -> Result<Vec<Number>, Failure> {
    let Some(grid) = grids(case).next() else { return Ok(Vec::new()) };
    let Grid { pitch, pattern, .. } = grid;
    let mut numbers = vec![
        Number::new("pitch", "m", pitch, None),
        Number::new("wire", "m", grid.wire(), None),
        Number::new("open_fraction", "", open_fraction(pitch, pattern), None),
    ];
    numbers.extend(light(case, source, &grid)?);
    let gridded = exact_field(case, &solution.basis);
    if let Some(placed) = grid.placed() {
        numbers.extend(far::sheet(solution, &gridded, grid.electrode, &placed));
        numbers.extend(near::ripple(solution, &gridded, &placed));
        let lines = case.study.lines.unwrap_or(if tabulated.is_some() { LINES } else { 0 });
        numbers.extend(near::lines(&gridded, grid.electrode, &placed, lines));
    }
    numbers.extend(deviation(case, source, solution, &gridded, solid, reporter)?);
    numbers.extend(trap::shifts(case, source, solution, solid, tabulated, reporter)?);
    Ok(numbers)
}

fn light(case: &Case, source: &CaseSource, grid: &Grid) -> Result<Vec<Number>, Failure> {
    let study = &case.study;
    let steepest = study.angles.iter().chain(&study.cone).copied().fold(0.0, f64::max);
    let patch = GridPatch::new(grid.pitch, grid.pattern, steepest).map_err(|error| {
        let key = format!("electrode.{}.{}", case.electrodes[grid.electrode].name, error.key);
        source.error_at(&key, error.problem, error.help)
    })?;
    let told = |name: String, incidence: Incidence| {
        let passed = patch.passed(incidence, study.rays);
        let [low, high] = wilson(passed, study.rays, SIGMAS);
        Number::new(name, "", passed as f64 / study.rays as f64, 0.5 * (high - low))
    };
    let angles = study.angles.iter().map(|a| (format!("light.{:.6}deg", a.to_degrees()), Incidence::Angle(*a)));
    let angles = angles.map(|(name, incidence)| (tidy(&name), incidence));
    let cone = study.cone.map(|half| ("light.cone".to_owned(), Incidence::Cone(half)));
    Ok(angles.chain(cone).map(|(name, incidence)| told(name, incidence)).collect())
}

/// `light.30deg` of `light.30.000000deg`.
fn tidy(name: &str) -> String {
    let number = name.trim_end_matches("deg");
    format!("{}deg", number.trim_end_matches('0').trim_end_matches('.'))
}

/// What the RF, or where there is none the constant voltages, multiply each channel by.
fn weights(driven: &Driven) -> Vec<f64> {
    let waveforms = driven.field.waveforms();
    amplitudes(waveforms).unwrap_or_else(|| waveforms.iter().map(|waveform| waveform.constant).collect())
}

/// How far the field of the trap is from that with plates, within the sphere that multipoles are told of.
///
/// # Errors
/// There is no such sphere.
fn deviation(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    gridded: &Driven,
    solid: &Solution,
    reporter: &dyn Reporter,
) -> Result<Vec<Number>, Failure> {
    let plain = exact_field(case, &solid.basis);
    let of = |driven: &Driven, solution: &Solution| sphere(case, &solution.basis.mesh, driven.exact.tree());
    let (Some((center, one)), Some((_, other))) = (of(gridded, solution), of(&plain, solid)) else {
        let key = if case.study.radius.is_some() { "study.radius" } else { "study.center" };
        let problem =
            "the ball in which fields are compared reaches a conductor, with the grids or with plates in their place";
        let help = "give a center and a radius between the electrodes";
        return Err(source.error_at(key, problem, help).into());
    };
    let radius = one.min(other);
    let points = ball(&center, radius);
    let field = |driven: &Driven| -> Vec<Vec3> {
        let mut samples = Samples::default();
        let (basis, weights) = (driven.field.basis(), weights(driven));
        basis.sample(&points, &mut samples);
        let sum = |gradients: &[Vec3]| gradients.iter().zip(&weights).map(|(g, w)| g * *w).sum();
        samples.gradient.chunks(basis.channels()).map(sum).collect()
    };
    let (with, without) = (field(gridded), field(&plain));
    let strongest = without.iter().map(|e| e.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let apart = || with.iter().zip(&without).map(|(a, b)| (a - b).norm() / strongest);
    let largest = apart().fold(0.0, f64::max);
    let rms = (apart().map(|x| x * x).sum::<f64>() / points.len() as f64).sqrt();
    let error = solution.errors.field + solid.errors.field;
    if largest < RESOLVED * error {
        reporter.warning(&format!(
            "the deviation of the field ({largest:.1e}) is not much larger than its error ({error:.1e}): ask for a smaller field.accuracy, in the region that matters ([table] min and max)"
        ));
    }
    let a = |driven: &Driven| -> Vec<f64> {
        let of = zonal(&**driven.field.basis(), &center, &case.study.axis, radius);
        let weights = weights(driven);
        (0..=4).map(|l| of.coefficients.iter().zip(&weights).map(|(a, w)| a[l] * w).sum()).collect()
    };
    let (a, b) = (a(gridded), a(&plain));
    // Relative to the quadrupole on the sphere; errors as for multipoles, of both fields.
    let quadrupole = b[2].abs() * radius * radius;
    let share = error * strongest * radius;
    Ok(vec![
        Number::new("field_deviation_max", "", largest, error),
        Number::new("field_deviation_rms", "", rms, error),
        Number::new("A0_shift", "V", a[0] - b[0], share),
        Number::new("A2_shift", "", a[2] / b[2] - 1.0, 5.0_f64.sqrt() * share / quadrupole),
        Number::new("A4_shift", "", (a[4] - b[4]) * radius.powi(4) / quadrupole, 3.0 * share / quadrupole),
    ])
}

/// Points spread evenly over a ball.
fn ball(center: &Vec3, radius: f64) -> Vec<Vec3> {
    // The sequence of Roberts (2018) in three dimensions: g solves x^4 = x + 1.
    let g: f64 = 1.220_744_084_605_76;
    let step = Vec3::new(1.0 / g, 1.0 / (g * g), 1.0 / (g * g * g));
    let points = (1..).map(|k| (step * f64::from(k)).map(|x| 2.0 * x.fract() - 1.0));
    points.filter(|p| p.norm() <= 1.0).take(COMPARED).map(|p| center + p * radius).collect()
}

/// How many grains came through the first grid, were caught by it, or turned back, as fractions with 95 % intervals (Wilson).
pub fn of_grains(case: &Case, starts: &Ensemble, flights: &Flights) -> Vec<Number> {
    let Some(grid) = grids(case).next() else { return Vec::new() };
    let Ok([_, _, normal]) = grid.placement.frame() else { return Vec::new() };
    let above = |p: &Vec3| normal.dot(&(p - grid.placement.center)) > 0.0;
    let endings = &flights.traced.endings;
    let (mut passed, mut caught) = (0, 0);
    for (grain, ending) in endings.iter().enumerate() {
        if matches!(ending.outcome, Outcome::Struck { electrode, .. } if electrode == grid.electrode) {
            caught += 1;
        } else if above(&starts.positions()[grain]) != above(&flights.traced.ensemble.positions()[grain]) {
            passed += 1;
        }
    }
    let all = endings.len();
    let turned = all - passed - caught;
    [("grains_passed", passed), ("grains_caught", caught), ("grains_turned", turned)]
        .into_iter()
        .flat_map(|(name, count)| fraction(name, count, all))
        .collect()
}

/// A fraction with the ends of its interval of 95 % (Wilson).
fn fraction(name: &str, count: usize, all: usize) -> [Number; 3] {
    let [low, high] = wilson(count, all, SIGMAS);
    [
        Number::new(name, "", count as f64 / all as f64, 0.5 * (high - low)),
        Number::new(format!("{name}_low"), "", low, None),
        Number::new(format!("{name}_high"), "", high, None),
    ]
}
