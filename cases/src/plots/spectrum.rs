//! Spectra of the coordinates.

use tracer::spectrum::{FEWEST, Spectrum, spectrum as spectrum_of};

use super::prefix::axis_unit;
use super::track::Track;
use super::{Curve, Ending, Figure, Mark, Panel, Shape};

/// Lines that are named, and how far below the strongest: weaker ones of a damped motion are the window's.
const NAMED: usize = 5;
const WEAKEST: f64 = 3e-3;
/// Decades that are drawn; lower lies the rounding of the samples.
const DECADES: f64 = 7.0;

/// Three panels, one above the other: the spectra of x, y and z, root mean square of all grains that flew until the time was up.
/// The strongest lines are named in Hz, and the line below the title says how far up and how finely the sampling tells.
///
/// `None` where no such grain has [`FEWEST`] equally spaced samples or more.
pub fn spectrum(title: &str, tracks: &[Track]) -> Option<Figure> {
    let whole: Vec<&Track> = tracks.iter().filter(|track| track.ended == Ending::TimeUp).collect();
    let (every, count) = whole.iter().filter_map(|track| evenly(&track.times)).min_by_key(|(_, count)| *count)?;
    let panels: Vec<Panel> = ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(k, name)| {
            let spectra = whole.iter().map(|track| {
                let samples: Vec<f64> = track.positions.iter().take(count).map(|p| p[k]).collect();
                spectrum_of(&samples, every)
            });
            panel(name, &mean(spectra))
        })
        .collect();
    let mut panels = panels;
    let frequency = panels.len() - 1;
    "frequency (Hz)".clone_into(&mut panels[frequency].x_label);
    let (fine, far) = (1.0 / (count as f64 * every), hertz(0.5 / every));
    let grains = match whole.len() {
        1 => "1 grain".to_owned(),
        n => format!("root mean square of {n} grains"),
    };
    Some(Figure {
        title: title.to_owned(),
        subtitle: format!("{grains}; entries {fine:.3} Hz apart; faster than {far} Hz is folded back"),
        panels,
        ..Figure::default()
    })
}

/// Distance of equally spaced samples, and how many there are before one is out of step.
fn evenly(times: &[f64]) -> Option<(f64, usize)> {
    let every = times.get(1)? - times[0];
    let in_step =
        |(k, t): (usize, &f64)| (t - times[0] - k as f64 * every).abs() < 1e-6 * every * (1.0 + k as f64).sqrt();
    let count = times.iter().enumerate().take_while(|(k, t)| in_step((*k, t))).count();
    (count >= FEWEST && every > 0.0).then_some((every, count))
}

fn mean(spectra: impl Iterator<Item = Spectrum>) -> Spectrum {
    let (mut sum, mut grains) = (Spectrum::default(), 0.0);
    for spectrum in spectra.filter(|s| !s.amplitudes.is_empty()) {
        sum.spacing = spectrum.spacing;
        sum.amplitudes.resize(spectrum.amplitudes.len(), 0.0);
        sum.amplitudes.iter_mut().zip(&spectrum.amplitudes).for_each(|(s, a)| *s += a * a);
        grains += 1.0;
    }
    sum.amplitudes.iter_mut().for_each(|s| *s = (*s / f64::max(grains, 1.0)).sqrt());
    sum
}

fn panel(name: &str, spectrum: &Spectrum) -> Panel {
    let strongest = spectrum.amplitudes.iter().copied().fold(0.0, f64::max);
    let unit = axis_unit(std::iter::once(strongest), "m", 3);
    let y_label = format!("log₁₀ {}", unit.label(name));
    if strongest == 0.0 {
        return Panel { title: "at rest".to_owned(), y_label, ..Panel::default() };
    }
    let height = |a: f64| (a * unit.factor).log10().max((strongest * unit.factor).log10() - DECADES);
    let points =
        spectrum.amplitudes.iter().enumerate().map(|(k, a)| [k as f64 * spectrum.spacing, height(*a)]).collect();
    let mut lines = spectrum.lines(NAMED, WEAKEST);
    lines.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    let named: Vec<String> = lines.iter().map(|line| hertz(line.frequency)).collect();
    let title = if named.is_empty() { "no lines".to_owned() } else { format!("{} Hz", named.join(", ")) };
    let marks = Mark {
        label: "lines".to_owned(),
        points: lines.iter().map(|line| [line.frequency, height(line.amplitude)]).collect(),
        shape: Shape::Circle,
    };
    let curve = Curve { label: String::new(), points, colour: 0, faint: false };
    Panel { title, y_label, curves: vec![curve], marks: vec![marks], ..Panel::default() }
}

/// A frequency in four digits.
fn hertz(frequency: f64) -> String {
    let decade = frequency.abs().max(1e-300).log10().floor();
    match decade {
        d if (-4.0..5.0).contains(&d) => format!("{frequency:.*}", (3.0 - d).max(0.0) as usize),
        _ => format!("{frequency:.3e}"),
    }
}
