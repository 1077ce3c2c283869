//! Velocity against position.

use super::prefix::axis_unit;
use super::track::{self, NAMED, Track};
use super::{Curve, Figure, Panel};

/// Three panels side by side: the phase planes (x, vx), (y, vy) and (z, vz) of the grains.
///
/// Grains are chosen and named as in [`coordinates`](super::coordinates()).
pub fn phase_planes(title: &str, tracks: &[Track]) -> Figure {
    let drawn = track::drawn(tracks);
    let panels = ["x", "y", "z"].iter().enumerate().map(|(k, name)| {
        let length = axis_unit(drawn.iter().flat_map(|track| &track.positions).map(|p| p[k]), "m", 3);
        let speed = axis_unit(drawn.iter().flat_map(|track| &track.velocities).map(|v| v[k]), "m/s", 3);
        let mut curves = Vec::new();
        let mut ends = Vec::new();
        for (colour, track) in drawn.iter().enumerate() {
            let count = track.times.len();
            let samples = track.positions.iter().zip(&track.velocities).take(count);
            let points: Vec<_> = samples.map(|(p, v)| [p[k] * length.factor, v[k] * speed.factor]).collect();
            ends.push((track.ended, points.last().copied()));
            let label = track::label(track, tracks.len());
            curves.push(Curve { label, points, colour, faint: tracks.len() > NAMED });
        }
        let (x_label, y_label) = (length.label(name), speed.label(&format!("v{name}")));
        Panel { x_label, y_label, curves, marks: track::endings(&ends), ..Panel::default() }
    });
    // Wide and low: each plane about square.
    Figure {
        title: title.to_owned(),
        subtitle: track::subtitle(tracks),
        columns: 3,
        panels: panels.collect(),
        width: 1400.0,
        height: 600.0,
    }
}
