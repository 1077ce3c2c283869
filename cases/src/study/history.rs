//! The plots of an optimisation: the objective of each evaluation, and what was varied.

use super::files::number_and_unit;
use super::optimise::{OBJECTIVE, Outcome, VIOLATION};
use super::row::Row;
use crate::case::{Goal, Optimise};
use crate::plots::{Curve, Figure, Mark, Panel, Shape};

/// Height of a row of panels, and of what stands around them; pixels.
const ROW: f64 = 330.0;
const AROUND: f64 = 150.0;

/// How an evaluation ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Holds,
    Breaks,
    Failed,
}

fn kind(row: &Row) -> Kind {
    match (row.reason(), row.value(VIOLATION)) {
        (Some(_), _) => Kind::Failed,
        (None, Some(violation)) if violation > 1e-9 => Kind::Breaks,
        _ => Kind::Holds,
    }
}

/// Evaluations of one kind as marks.
fn marks(rows: &[Row], at: impl Fn(&Row) -> f64) -> Vec<Mark> {
    let of = |which: Kind, label: &str, shape: Shape| {
        let points =
            rows.iter().filter(|row| kind(row) == which).map(|row| [(row.point + 1) as f64, at(row)]).collect();
        Mark { label: label.to_owned(), points, shape }
    };
    let all = [
        of(Kind::Holds, "holds all constraints", Shape::Circle),
        of(Kind::Breaks, "breaks a constraint", Shape::Cross),
        of(Kind::Failed, "failed", Shape::Triangle),
    ];
    all.into_iter().filter(|mark| !mark.points.is_empty()).collect()
}

/// The objective over the evaluations, and the best so far.
pub fn history(title: &str, optimise: &Optimise, outcome: &Outcome) -> Figure {
    let rows = &outcome.rows;
    let better = |a: f64, b: f64| if optimise.goal == Goal::Maximise { a > b } else { a < b };
    let mut best = f64::NAN;
    let mut so_far = Vec::new();
    for row in rows {
        // Stairs: what was best stays so until it is surpassed.
        so_far.push([(row.point + 1) as f64, best]);
        if let (Kind::Holds, Some(value)) = (kind(row), row.value(OBJECTIVE))
            && (best.is_nan() || better(value, best))
        {
            best = value;
        }
        so_far.push([(row.point + 1) as f64, best]);
    }
    // A failed point has no objective: it stands at the least that is drawn.
    let values = || rows.iter().filter_map(|row| row.value(OBJECTIVE));
    let floor = values().fold(f64::INFINITY, f64::min);
    let marks = marks(rows, |row| row.value(OBJECTIVE).unwrap_or(floor));
    let curve = Curve { label: "best so far".to_owned(), points: so_far, colour: 1, faint: false };
    let goal = if optimise.goal == Goal::Maximise { "to be large" } else { "to be small" };
    // A number by itself has its unit.
    let unit = rows.iter().flat_map(Row::numbers).find(|number| number.name == optimise.objective.text);
    let unit = unit.map(|number| number.unit.as_str()).filter(|unit| !unit.is_empty());
    let unit = unit.map(|unit| format!(" ({unit})")).unwrap_or_default();
    let panel = Panel {
        x_label: "evaluation".to_owned(),
        y_label: format!("{}{unit}, {goal}", short(&optimise.objective.text)),
        curves: vec![curve],
        marks,
        ..Panel::default()
    };
    Figure {
        title: title.to_owned(),
        subtitle: subtitle(outcome),
        columns: 1,
        panels: vec![panel],
        ..Figure::default()
    }
}

/// What was varied over the evaluations, with the best.
pub fn parameters(title: &str, optimise: &Optimise, outcome: &Outcome) -> Figure {
    let rows = &outcome.rows;
    let panel = |(n, varied): (usize, &crate::case::Varied)| {
        let at = |row: &Row| number_and_unit(&row.values[n]).map_or(f64::NAN, |(x, _)| x);
        let unit = if varied.unit.is_empty() { String::new() } else { format!(" ({})", varied.unit) };
        let best = outcome.best.map(|best| at(&rows[best]));
        let line = best.map(|x| vec![[1.0, x], [rows.len() as f64, x]]).unwrap_or_default();
        Panel {
            x_label: "evaluation".to_owned(),
            y_label: format!("{}{unit}", varied.key),
            curves: vec![Curve { label: "best".to_owned(), points: line, colour: 1, faint: false }],
            marks: marks(rows, at),
            ..Panel::default()
        }
    };
    let panels: Vec<Panel> = optimise.varied.iter().enumerate().map(panel).collect();
    let columns = if panels.len() == 1 { 1 } else { 2 };
    let height = (AROUND + ROW * panels.len().div_ceil(columns) as f64).max(600.0);
    Figure { title: title.to_owned(), subtitle: subtitle(outcome), columns, panels, height, ..Figure::default() }
}

fn subtitle(outcome: &Outcome) -> String {
    let converged = if outcome.converged { "converged" } else { "not converged" };
    format!("{} evaluations, {converged}", outcome.rows.len())
}

/// A formula short enough for the side of a plot.
fn short(text: &str) -> String {
    const MOST: usize = 50;
    if text.chars().count() <= MOST {
        return text.to_owned();
    }
    format!("{} ...", text.chars().take(MOST).collect::<String>())
}
