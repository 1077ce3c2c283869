//! The chart of stability: a picture and tables.

use std::io::Write;

use super::{OutputFolder, pictures};
use crate::case::ChartAxis;
use crate::pipeline::Failure;
use crate::pipeline::analysis::chart::Scan;
use crate::pipeline::analysis::report::{ChartGrain, ChartReport};
use crate::plots::{Curve, Figure, Heights, Mark, Panel, Shape};

/// Writes `stability_chart` as SVG, PNG and CSV, and the traced grains as `stability_grains.csv`.
///
/// # Errors
/// The output fails.
pub fn write(out: &mut OutputFolder, title: &str, report: &ChartReport, scan: &Scan) -> Result<(), Failure> {
    let [xs, ys] = &scan.values;
    let edge = |label: &str, values: &[f64], colour: usize| Curve {
        label: label.to_owned(),
        points: Heights { x: xs.clone(), y: ys.clone(), values: values.to_vec() }.contour(0.0),
        colour,
        faint: false,
    };
    let grains = |kept: bool, shape: Shape, label: &str| Mark {
        label: label.to_owned(),
        points: scan.grains.iter().filter(|g| (g.outcome == "retained") == kept).map(|g| [g.x, g.y]).collect(),
        shape,
    };
    let corner = |last: bool| [(&report.x, last), (&report.y, last)].map(|(a, last)| if last { a.to } else { a.from });
    // The corners, so that the axes show all of the chart.
    let frame = [false, true].map(|last| Curve { points: vec![corner(last)], faint: true, ..Curve::default() });
    let mut curves = vec![
        edge("ideal trap with this a and q", &scan.ideal, 1),
        edge("linear motion at the centre", &scan.floquet, 0),
    ];
    curves.extend(frame);
    let mut marks = vec![grains(true, Shape::Circle, "grain stays"), grains(false, Shape::Cross, "grain is lost")];
    marks.retain(|mark| !mark.points.is_empty());
    let traced = report.distance.map_or(String::new(), |distance| {
        format!(
            "; grains from {} off along each axis: {} of {} stay",
            super::summary::metres(distance),
            report.retained,
            report.traced.len()
        )
    });
    let figure = Figure {
        title: title.to_owned(),
        subtitle: format!("stability of {}{traced}", report.grains),
        panels: vec![Panel {
            x_label: name(&report.x, report.main_axis),
            y_label: name(&report.y, report.main_axis),
            curves,
            marks,
            ..Panel::default()
        }],
        width: 1100.0,
        height: 800.0,
        ..Figure::default()
    };
    pictures::write(out, "stability_chart", &figure)?;
    out.write("stability_chart.csv", |w| values(w, scan))?;
    if !scan.grains.is_empty() {
        out.write("stability_grains.csv", |w| lost(w, &scan.grains))?;
    }
    Ok(())
}

fn name(axis: &ChartAxis, main: usize) -> String {
    match (axis.key.as_str(), axis.unit.as_str()) {
        (key @ ("q" | "a"), _) => format!("{key} on principal axis {main}"),
        (key, "") => key.to_owned(),
        (key, unit) => format!("{key} ({unit})"),
    }
}

fn values(out: &mut dyn Write, scan: &Scan) -> std::io::Result<()> {
    writeln!(out, "x,y,excess,ideal_excess")?;
    let [xs, ys] = &scan.values;
    for (j, y) in ys.iter().enumerate() {
        for (i, x) in xs.iter().enumerate() {
            let n = j * xs.len() + i;
            let number = |v: f64| if v.is_finite() { format!("{v:.9e}") } else { String::new() };
            writeln!(out, "{x},{y},{},{}", number(scan.floquet[n]), number(scan.ideal[n]))?;
        }
    }
    Ok(())
}

fn lost(out: &mut dyn Write, grains: &[ChartGrain]) -> std::io::Result<()> {
    writeln!(out, "x,y,outcome,time,lost_x,lost_y,lost_z")?;
    for g in grains {
        let [a, b, c] = g.point.map_or([String::new(), String::new(), String::new()], |p| p.map(|x| x.to_string()));
        writeln!(out, "{},{},{},{},{a},{b},{c}", g.x, g.y, g.outcome, g.time)?;
    }
    Ok(())
}
