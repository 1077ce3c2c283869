//! Plots of a study: reported numbers over varied keys.

use super::files::{in_one_unit, number_and_unit, reported};
use super::row::Row;
use crate::case::{Sampling, Sweep, SweepAxis};
use crate::plots::{Curve, Figure, Mark, Panel, Shape};

/// Panels of a figure: more are not looked at.
const PANELS: usize = 12;

/// Curves of a panel: colours of the palette.
const CURVES: usize = 10;

/// Height of a row of panels, and of what stands around them; pixels.
const ROW: f64 = 330.0;
const AROUND: f64 = 150.0;

/// Numbers that are drawn only when the sweep names them: those of the work, and those of which there are many.
const UNASKED: [&str; 10] =
    ["panels", "unknowns", "table_nodes", "steps", "grains", "grain1", "grain2", "grain3", "grain4", "grain5"];

/// Multipoles that are drawn unasked: what holds grains, and how far from a quadrupole it is.
const MULTIPOLES: [&str; 2] = ["A2_", "A4_"];

/// The reported numbers over the one varied key, over one of two with a curve for each value of the other, or, of more keys and of
/// samples, as points over each key. What does not vary is left out, unless the sweep names it. `None` where nothing is left.
pub fn figure(title: &str, sweep: &Sweep, rows: &[Row]) -> Option<Figure> {
    let axes: Vec<Horizontal> = (0..sweep.axes.len()).filter_map(|k| Horizontal::of(sweep, rows, k)).collect();
    if axes.is_empty() {
        return None;
    }
    let names = worth_drawing(sweep, rows);
    let sampled = matches!(sweep.sampling, Sampling::LatinHypercube | Sampling::Sobol);
    let panels: Vec<Panel> = match (&axes[..], sampled) {
        ([only], false) if sweep.axes.len() == 1 => names.iter().map(|name| one(rows, only, name)).collect(),
        (_, false) if sweep.sampling == Sampling::Zip => names.iter().map(|name| one(rows, &axes[0], name)).collect(),
        (_, false) if sweep.axes.len() == 2 => {
            // The key with more values runs along the axis.
            let along = axes.iter().max_by_key(|axis| (sweep.axes[axis.key].values.len(), usize::MAX - axis.key))?;
            names.iter().map(|name| two(sweep, rows, along, 1 - along.key, name)).collect()
        }
        _ => names.iter().flat_map(|name| axes.iter().map(|axis| scattered(rows, axis, name))).collect(),
    };
    let panels: Vec<Panel> = panels.into_iter().take(PANELS).collect();
    if panels.is_empty() {
        return None;
    }
    let columns = if panels.len() == 1 { 1 } else { 2 };
    let height = (AROUND + ROW * panels.len().div_ceil(columns) as f64).max(600.0);
    let failed = rows.iter().filter(|row| row.reason().is_some()).count();
    let subtitle = match failed {
        0 => format!("{} points", rows.len()),
        n => format!("{} points, {n} of them failed", rows.len()),
    };
    Some(Figure { title: title.to_owned(), subtitle, columns, panels, height, ..Figure::default() })
}

/// A varied key as a horizontal axis.
struct Horizontal {
    /// Which key of the sweep.
    key: usize,
    /// One position for each row.
    positions: Vec<f64>,
    label: String,
}

impl Horizontal {
    fn of(sweep: &Sweep, rows: &[Row], key: usize) -> Option<Self> {
        let (numbers, unit) = in_one_unit(rows.iter().map(|row| row.values[key].as_str()))?;
        let SweepAxis { key: name, log, .. } = &sweep.axes[key];
        let named = if unit.is_empty() { name.clone() } else { format!("{name} ({unit})") };
        let log = *log && numbers.iter().all(|x| *x > 0.0);
        let positions = if log { numbers.iter().map(|x| x.log10()).collect() } else { numbers };
        Some(Self { key, positions, label: if log { format!("log₁₀ {named}") } else { named } })
    }
}

/// Names and units of the numbers to draw.
fn worth_drawing(sweep: &Sweep, rows: &[Row]) -> Vec<(String, String)> {
    let varies = |name: &str| {
        let values: Vec<f64> = rows.iter().filter_map(|row| row.value(name)).collect();
        let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
        let error = rows.iter().flat_map(Row::numbers).filter(|n| n.name == name).filter_map(|n| n.error);
        // What varies by less than its error is that error.
        hi - lo > error.fold(1e-12 * hi.abs().max(lo.abs()), f64::max)
    };
    let names = reported(sweep, rows).into_iter().map(|(name, unit, _)| (name, unit));
    if !sweep.report.is_empty() {
        return names.collect();
    }
    let first = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let multipole = |name: &str| name.starts_with('A') && name.chars().nth(1).is_some_and(|c| c.is_ascii_digit());
    let drawn = |name: &str| {
        let hidden = UNASKED.contains(&first(name).as_str()) || name.starts_with("charge.") || name.ends_with("_error");
        !hidden && (!multipole(name) || MULTIPOLES.iter().any(|m| name.starts_with(m))) && varies(name)
    };
    names.filter(|(name, _)| drawn(name)).collect()
}

fn y_label((name, unit): &(String, String)) -> String {
    if unit.is_empty() { name.clone() } else { format!("{name} ({unit})") }
}

/// A number at each row; not finite where there is none.
fn value(row: &Row, name: &str) -> f64 {
    row.value(name).unwrap_or(f64::NAN)
}

fn one(rows: &[Row], axis: &Horizontal, name: &(String, String)) -> Panel {
    let points: Vec<[f64; 2]> = axis.positions.iter().zip(rows).map(|(x, row)| [*x, value(row, &name.0)]).collect();
    let marks = Mark { label: "points of the study".to_owned(), points: points.clone(), shape: Shape::Circle };
    let curve = Curve { label: String::new(), points, colour: 0, faint: false };
    let y_label = y_label(name);
    Panel { x_label: axis.label.clone(), y_label, curves: vec![curve], marks: vec![marks], ..Panel::default() }
}

fn two(sweep: &Sweep, rows: &[Row], along: &Horizontal, other: usize, name: &(String, String)) -> Panel {
    let mut curves: Vec<Curve> = Vec::new();
    let mut of: Vec<&str> = Vec::new();
    for value in sweep.axes[other].values.iter().map(String::as_str) {
        if !of.contains(&value) {
            of.push(value);
        }
    }
    for (colour, text) in of.into_iter().take(CURVES).enumerate() {
        let points = along.positions.iter().zip(rows).filter(|(_, row)| row.values[other] == text);
        let points = points.map(|(x, row)| [*x, value(row, &name.0)]).collect();
        let shown = match number_and_unit(text) {
            Some((number, unit)) => format!("{number:.6} {unit}").trim_end().to_owned(),
            None => text.trim_matches('"').to_owned(),
        };
        let label = format!("{} = {}", sweep.axes[other].key, tidy(&shown));
        curves.push(Curve { label, points, colour, faint: false });
    }
    Panel { x_label: along.label.clone(), y_label: y_label(name), curves, ..Panel::default() }
}

/// A number without the zeros at its end.
fn tidy(text: &str) -> String {
    let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
    let number = if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number };
    format!("{number} {unit}").trim_end().to_owned()
}

fn scattered(rows: &[Row], axis: &Horizontal, name: &(String, String)) -> Panel {
    let points = axis.positions.iter().zip(rows).map(|(x, row)| [*x, value(row, &name.0)]).collect();
    let marks = Mark { label: "points of the study".to_owned(), points, shape: Shape::Circle };
    Panel { x_label: axis.label.clone(), y_label: y_label(name), marks: vec![marks], ..Panel::default() }
}
