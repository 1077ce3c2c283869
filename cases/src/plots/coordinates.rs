//! Coordinates against time.

use super::prefix::axis_unit;
use super::track::{self, NAMED, Track};
use super::{Curve, Figure, Panel, thin};

/// Finer than any screen; longer tracks are thinned to this before they are stored in the figure.
const COLUMNS: usize = 4000;

/// Three panels, one above the other: x, y and z of the grains against time.
///
/// Up to 10 grains are named in the legend. Of more than 100, 100 are drawn, spread evenly through the list, and the line
/// below the title says so. Without grains the figure is an empty sheet of axes that says "no grains".
pub fn coordinates(title: &str, tracks: &[Track]) -> Figure {
    let drawn = track::drawn(tracks);
    let times = || drawn.iter().flat_map(|track| track.times.iter().copied());
    let time = axis_unit(times(), "s", 0);
    let finite = || times().filter(|t| t.is_finite()).map(|t| t * time.factor);
    let (first, last) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));

    let panels = ["x", "y", "z"].iter().enumerate().map(|(k, name)| {
        let length = axis_unit(drawn.iter().flat_map(|track| &track.positions).map(|p| p[k]), "m", 3);
        let mut curves = Vec::new();
        let mut ends = Vec::new();
        for (colour, track) in drawn.iter().enumerate() {
            let points = track.times.iter().zip(&track.positions);
            let mut points: Vec<_> = points.map(|(t, p)| [t * time.factor, p[k] * length.factor]).collect();
            ends.push((track.ended, points.last().copied()));
            if points.len() > 4 * COLUMNS && last > first {
                points = thin::by_column(&points, first, last, COLUMNS);
            }
            let label = track::label(track, tracks.len());
            curves.push(Curve { label, points, colour, faint: tracks.len() > NAMED });
        }
        let x_label = if k == 2 { time.label("time") } else { String::new() };
        Panel { x_label, y_label: length.label(name), curves, marks: track::endings(&ends), ..Panel::default() }
    });
    Figure { title: title.to_owned(), subtitle: track::subtitle(tracks), panels: panels.collect(), ..Figure::default() }
}
