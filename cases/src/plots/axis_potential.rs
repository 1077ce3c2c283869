//! Potential along an axis.

use super::prefix::axis_unit;
use super::{Band, Curve, Figure, Panel};

/// Potential along the axis `axis_name`: labelled curves of `[position, potential]`, m and V.
///
/// A potential that is not finite means "inside a conductor": a gap in the curve, on grey ground.
pub fn axis_potential(title: &str, axis_name: &str, curves: &[(String, Vec<[f64; 2]>)]) -> Figure {
    let points = || curves.iter().flat_map(|(_, points)| points);
    let length = axis_unit(points().map(|p| p[0]), "m", 3);
    let voltage = axis_unit(points().map(|p| p[1]), "V", 6);
    let mut panel = Panel { x_label: length.label(axis_name), y_label: voltage.label("potential"), ..Panel::default() };
    for (i, (label, points)) in curves.iter().enumerate() {
        let points: Vec<_> = points.iter().map(|p| [p[0] * length.factor, p[1] * voltage.factor]).collect();
        for span in conductors(&points) {
            let band = Band { label: "inside a conductor".to_owned(), span };
            if !panel.bands.contains(&band) {
                panel.bands.push(band);
            }
        }
        panel.curves.push(Curve { label: label.clone(), points, colour: i, faint: false });
    }
    let empty = points().next().is_none();
    Figure {
        title: title.to_owned(),
        subtitle: if empty { "no points".to_owned() } else { String::new() },
        panels: vec![panel],
        ..Figure::default()
    }
}

/// Where a curve has positions but no potential: up to half way to its neighbours.
fn conductors(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let placed: Vec<_> = points.iter().filter(|p| p[0].is_finite()).collect();
    let mut spans = Vec::new();
    let mut start = 0;
    for run in placed.chunk_by(|a, b| a[1].is_finite() == b[1].is_finite()) {
        let end = start + run.len();
        if !run[0][1].is_finite() {
            let before = if start > 0 { placed[start - 1][0] } else { run[0][0] };
            let after = if end < placed.len() { placed[end][0] } else { run[run.len() - 1][0] };
            spans.push([0.5 * (before + run[0][0]), 0.5 * (run[run.len() - 1][0] + after)]);
        }
        start = end;
    }
    spans
}
