//! Plots of a run, each as SVG and PNG.

use std::io::Write;

use field::Samples;
use meshes::{SurfaceMesh, Vec3};
use tracer::{Outcome, Region as FlightRegion};

use super::OutputFolder;
use crate::case::{Case, Region};
use crate::pipeline::Failure;
use crate::pipeline::drives::Driven;
use crate::pipeline::flights::Flights;
use crate::plots::{
    Ending, Figure, PlotError, Track, axis_potential, coordinates, outlines, phase_planes, spectrum, tracks,
};

/// Samples to an RF period from which on a spectrum is drawn: two show its frequency, and its upper sideband lies above.
const LEAST_OF_A_PERIOD: f64 = 3.0;

/// Points along the axis: two to a pixel.
const POINTS: usize = 2000;

/// Draws the potential along the axis of the electrodes: its static part, what oscillates (at its largest), and the sum at the
/// start.
///
/// # Errors
/// The output fails.
pub fn potential_along_axis(
    out: &mut OutputFolder,
    case: &Case,
    title: &str,
    driven: &Driven,
    bounds: &Region,
) -> Result<(), Failure> {
    let axis = Axis::of(case, bounds);
    let places: Vec<Vec3> = (0..POINTS).map(|k| axis.point(k as f64 / (POINTS - 1) as f64)).collect();
    // Sources and the insides of conductors have no potential worth a line.
    let hidden: Vec<bool> =
        places.iter().map(|p| driven.exact.inside(p).is_some() || driven.exact.singular_at(p).is_some()).collect();
    let shown: Vec<Vec3> = places.iter().zip(&hidden).filter(|(_, hidden)| !**hidden).map(|(p, _)| *p).collect();
    let mut samples = Samples::default();
    driven.field.basis().sample(&shown, &mut samples);
    let channels = driven.field.basis().channels();
    let curve = |label: &str, volts: &[f64]| {
        let mut next = samples.potential.chunks(channels);
        let points = (0..POINTS).map(|k| {
            let value = if hidden[k] {
                f64::NAN
            } else {
                next.next().map_or(f64::NAN, |unit| unit.iter().zip(volts).map(|(u, v)| u * v).sum())
            };
            [axis.position(k as f64 / (POINTS - 1) as f64), value]
        });
        (label.to_owned(), points.collect::<Vec<_>>())
    };
    let start = case.trace.as_ref().map_or(0.0, |trace| trace.start);
    let of =
        |value: &dyn Fn(&field::Waveform) -> f64| -> Vec<f64> { driven.field.waveforms().iter().map(value).collect() };
    let now = curve("at the start", &of(&|w| w.value(start)));
    let curves = if driven.field.waveforms().iter().all(field::Waveform::is_constant) {
        vec![now]
    } else {
        vec![curve("static part", &of(&|w| w.constant)), now]
    };
    write(out, "potential", &axis_potential(title, &axis.name, &curves))
}

/// Draws the tracks of the grains between the electrodes, their coordinates against time, their phase planes, and the spectra of
/// those that flew to the end, if there are.
///
/// # Errors
/// The output fails.
pub fn of_flights(out: &mut OutputFolder, title: &str, flights: &Flights, mesh: &SurfaceMesh) -> Result<(), Failure> {
    let paths: Vec<Track> = flights
        .samples
        .iter()
        .zip(&flights.traced.endings)
        .enumerate()
        .map(|(grain, (samples, ending))| Track {
            grain,
            times: samples.iter().map(|s| s.time).collect(),
            positions: samples.iter().map(|s| s.position.into()).collect(),
            velocities: samples.iter().map(|s| s.velocity.into()).collect(),
            ended: match ending.outcome {
                Outcome::TimeUp | Outcome::Stopped => Ending::TimeUp,
                Outcome::Struck { .. } => Ending::Struck,
                Outcome::LeftRegion { .. } | Outcome::Unstable { .. } => Ending::Left,
            },
        })
        .collect();
    write(out, "tracks", &tracks(title, &outlines(mesh), &paths))?;
    write(out, "coordinates", &coordinates(title, &paths))?;
    write(out, "phase_planes", &phase_planes(title, &paths))?;
    // Sampled more rarely, the RF's own lines are folded among the slow ones, and say nothing.
    let often = flights.period == 0.0 || flights.every * flights.stride as f64 <= flights.period / LEAST_OF_A_PERIOD;
    match spectrum(title, &paths).filter(|_| often) {
        Some(figure) => write(out, "spectrum", &figure),
        None => Ok(()),
    }
}

/// Writes a figure as SVG and PNG.
///
/// # Errors
/// It cannot be drawn, or the output fails.
pub fn write(out: &mut OutputFolder, name: &str, figure: &Figure) -> Result<(), Failure> {
    let failed = |error: PlotError| {
        Failure::run(format!("the plot `{name}` cannot be drawn: {error}"), "this is a fault of graintrap")
    };
    let (svg, png) = (figure.svg().map_err(failed)?, figure.png().map_err(failed)?);
    out.write(&format!("{name}.svg"), |w: &mut dyn Write| w.write_all(svg.as_bytes()))?;
    out.write(&format!("{name}.png"), |w: &mut dyn Write| w.write_all(&png))
}

/// A line through the case.
struct Axis {
    name: String,
    through: Vec3,
    direction: Vec3,
    from: f64,
    to: f64,
}

impl Axis {
    /// The axis of the first electrode (or source) within the box.
    fn of(case: &Case, bounds: &Region) -> Self {
        let placements = case.electrodes.iter().map(|e| &e.placement).chain(case.sources.iter().map(|s| &s.placement));
        let middle = (bounds.min + bounds.max) / 2.0;
        let (through, direction) = placements
            .map(|p| (p.center, p.axis))
            .next()
            .and_then(|(center, axis)| Some((center, axis.try_normalize(0.0)?)))
            .filter(|(center, _)| (0..3).all(|k| (bounds.min[k]..=bounds.max[k]).contains(&center[k])))
            .unwrap_or((middle, Vec3::z()));
        let coordinate = (0..3).find(|&k| direction[k].abs() > 1.0 - 1e-12);
        // Along a coordinate axis positions are the coordinate, whichever way the electrode points.
        let direction = coordinate.map_or(direction, |k| Vec3::ith(k, 1.0));
        let origin = coordinate.map_or(through, |k| through - Vec3::ith(k, through[k]));
        let region = FlightRegion { min: bounds.min, max: bounds.max };
        let (from, to) = span(&region, &origin, &direction);
        let name = coordinate.map_or("distance along the axis".to_owned(), |k| ["x", "y", "z"][k].to_owned());
        Self { name, through: origin, direction, from, to }
    }

    fn position(&self, part: f64) -> f64 {
        self.from + (self.to - self.from) * part
    }

    fn point(&self, part: f64) -> Vec3 {
        self.through + self.direction * self.position(part)
    }
}

/// Where a line enters and leaves a box.
fn span(region: &FlightRegion, through: &Vec3, direction: &Vec3) -> (f64, f64) {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if direction[k].abs() > 1e-12 {
            let (a, b) = ((region.min[k] - through[k]) / direction[k], (region.max[k] - through[k]) / direction[k]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
    }
    (from, to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_by_its_box() {
        let region = FlightRegion { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 3.0) };
        assert_eq!(span(&region, &Vec3::zeros(), &Vec3::y()), (-2.0, 2.0));
        let diagonal = Vec3::new(1.0, 1.0, 0.0).normalize();
        let (from, to) = span(&region, &Vec3::zeros(), &diagonal);
        assert!((to - 2.0_f64.sqrt()).abs() < 1e-15 && (from + to).abs() < 1e-15);
    }
}
