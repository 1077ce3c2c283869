//! Maps of potentials in a plane.

use super::contour::{Heights, joined};
use super::prefix::axis_unit;
use super::{Curve, Figure, Mark, Panel};

/// One map.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// Above it.
    pub title: String,
    /// Heights, coordinates in m.
    pub heights: Heights,
    /// Where lines are drawn.
    pub levels: Vec<f64>,
    /// Points that are marked, m.
    pub marks: Vec<Mark>,
}

/// Lines of equal potential below zero, and from zero on.
const COLOURS: [usize; 2] = [1, 0];
/// Electrodes.
const INK: usize = 6;

/// Maps side by side, with the cuts of electrodes (pieces of lines, m) through the plane. `axes` names the coordinates.
pub fn potential_maps(
    title: &str,
    subtitle: &str,
    axes: [&str; 2],
    maps: &[Map],
    electrodes: &[[[f64; 2]; 2]],
) -> Figure {
    let outline = joined(electrodes);
    let all = || maps.iter().flat_map(|m| m.heights.x.iter().chain(&m.heights.y).copied());
    let length = axis_unit(all(), "m", 3);
    let scaled =
        |points: &[[f64; 2]]| -> Vec<[f64; 2]> { points.iter().map(|p| p.map(|x| x * length.factor)).collect() };
    let panels: Vec<Panel> = maps
        .iter()
        .map(|map| {
            let mut curves: Vec<Curve> = Vec::new();
            for level in &map.levels {
                let points = scaled(&map.heights.contour(*level));
                let colour = COLOURS[usize::from(*level >= 0.0)];
                if !points.is_empty() {
                    let label = if *level < 0.0 { "equal potential, below zero" } else { "equal potential" };
                    curves.push(Curve { label: label.to_owned(), points, colour, faint: true });
                }
            }
            if !outline.is_empty() {
                let label = "electrodes".to_owned();
                curves.push(Curve { label, points: scaled(&outline), colour: INK, faint: false });
            }
            // The corners of the map, so that axes show all of it.
            let corner =
                |list: &[f64], last: bool| (if last { list.last() } else { list.first() }).copied().unwrap_or(0.0);
            let frame = [false, true].map(|last| [corner(&map.heights.x, last), corner(&map.heights.y, last)]);
            curves.extend(frame.map(|p| Curve { points: scaled(&[p]), faint: true, ..Curve::default() }));
            let marks = map.marks.iter().map(|m| Mark { points: scaled(&m.points), ..m.clone() }).collect();
            Panel {
                title: map.title.clone(),
                x_label: length.label(axes[0]),
                y_label: length.label(axes[1]),
                curves,
                marks,
                equal: true,
                ..Panel::default()
            }
        })
        .collect();
    let extent = |list: &[f64]| list.last().unwrap_or(&1.0) - list.first().unwrap_or(&0.0);
    let shape = maps.first().map_or(1.0, |m| extent(&m.heights.y) / extent(&m.heights.x));
    // Margins of a panel are some 100 by 150 pixels.
    let columns = panels.len().max(1);
    let width = if columns == 1 { 900.0 } else { 1500.0 };
    let height = ((width / columns as f64 - 100.0) * shape + 210.0).clamp(450.0, 1600.0);
    Figure { title: title.to_owned(), subtitle: subtitle.to_owned(), columns, panels, width, height }
}
