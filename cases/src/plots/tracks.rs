//! Tracks between electrodes, seen from the side and a little above.

use std::collections::HashMap;

use meshes::{SurfaceMesh, Vec3};

use super::prefix::axis_unit;
use super::track::{self, NAMED, Track};
use super::{Curve, Figure, Panel};

/// Where the viewer stands, as seen from the middle: in front of the plane of x and z, to the right, and above. Projection is
/// orthographic: parallel lines stay parallel, and sizes do not depend on the distance.
const AZIMUTH_DEG: f64 = -60.0;
const ELEVATION_DEG: f64 = 22.0;

/// How long the arrows of the axes are, against the picture.
const ARROW: f64 = 0.12;

/// To the right, up, and towards the viewer.
fn directions() -> [Vec3; 3] {
    let (azimuth, elevation) = (AZIMUTH_DEG.to_radians(), ELEVATION_DEG.to_radians());
    let right = Vec3::new(-azimuth.sin(), azimuth.cos(), 0.0);
    let towards = Vec3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
    [right, towards.cross(&right), towards]
}

/// The edges of electrodes that make their outline as the viewer of [`tracks`] sees them, in m: where a surface ends, and where it
/// turns away. What stands behind a surface is drawn all the same.
pub fn outlines(mesh: &SurfaceMesh) -> Vec<[Vec3; 2]> {
    let towards = directions()[2];
    // The panels along each edge: do they face the viewer, and how is their normal.
    let mut sides: HashMap<[u32; 2], Vec<Vec3>> = HashMap::new();
    let mut order = Vec::new();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(&(c - a)).normalize();
        for k in 0..3 {
            let (from, to) = (t[k], t[(k + 1) % 3]);
            let edge = [from.min(to), from.max(to)];
            let normals = sides.entry(edge).or_default();
            if normals.is_empty() {
                order.push(edge);
            }
            normals.push(normal);
        }
    }
    let shown = |normals: &[Vec3]| match normals {
        [a, b] => (a.dot(&towards) >= 0.0) != (b.dot(&towards) >= 0.0) || a.dot(b) < 0.5,
        _ => true,
    };
    let edges = order.into_iter().filter(|edge| shown(&sides[edge]));
    edges.map(|edge| edge.map(|v| mesh.vertices[v as usize])).collect()
}

/// The tracks of the grains in space, with the outlines of the electrodes (pairs of points, m), in orthographic projection with equal
/// scales.
///
/// Grains are chosen and named as in [`coordinates`](super::coordinates()).
pub fn tracks(title: &str, outlines: &[[Vec3; 2]], tracks: &[Track]) -> Figure {
    let [right, up, _] = directions();
    let drawn = track::drawn(tracks);
    let places = drawn.iter().flat_map(|track| &track.positions).map(|p| Vec3::from(*p));
    // Grains that left far behind would make the trap a dot: the picture holds the electrodes, or the tracks where there are none.
    let near = Near::of(outlines);
    let seen = |r: &Vec3| if near.holds(r) { [r.dot(&right), r.dot(&up)] } else { [f64::NAN; 2] };
    let all: Vec<[f64; 2]> = outlines.iter().flatten().copied().chain(places).map(|r| seen(&r)).collect();
    let unit = axis_unit(all.iter().flatten().copied(), "m", 3);
    let scaled = |p: [f64; 2]| p.map(|v| v * unit.factor);
    let mut curves = vec![Curve { label: "electrodes".to_owned(), points: Vec::new(), colour: 6, faint: true }];
    curves[0].points = chained(outlines, &|r| scaled(seen(&r)));
    if outlines.is_empty() {
        curves.clear();
    }
    let mut ends = Vec::new();
    for (colour, track) in drawn.iter().enumerate() {
        let points: Vec<_> = track.positions.iter().map(|p| scaled(seen(&Vec3::from(*p)))).collect();
        ends.push((track.ended, points.iter().rev().copied().find(|p| p[0].is_finite())));
        let label = track::label(track, tracks.len());
        // Black is the electrodes'.
        let colour = if colour % 10 < 6 { colour % 10 } else { 7 + (colour % 10 - 6) % 3 };
        curves.push(Curve { label, points, colour, faint: tracks.len() > NAMED });
    }
    curves.extend(arrows(&all, unit.factor, &right, &up));
    let panel = Panel {
        x_label: format!("to the right, in {}", unit.name),
        y_label: format!("up, in {}; the short lines at the lower left are the directions of x, y and z", unit.name),
        curves,
        marks: track::endings(&ends),
        equal: true,
        ..Panel::default()
    };
    let subtitle = format!("{}, seen from azimuth {AZIMUTH_DEG}°, elevation {ELEVATION_DEG}°", track::subtitle(tracks));
    Figure { title: title.to_owned(), subtitle, panels: vec![panel], ..Figure::default() }
}

/// What belongs to the picture: three times the box of the electrodes.
struct Near {
    bounds: Option<(Vec3, Vec3)>,
}

impl Near {
    fn of(outlines: &[[Vec3; 2]]) -> Self {
        let points = || outlines.iter().flatten();
        let low = points().copied().reduce(|a, b| a.inf(&b));
        let high = points().copied().reduce(|a, b| a.sup(&b));
        let bounds = low.zip(high).map(|(low, high)| {
            // A flat electrode has no thickness, but grains fly around it.
            let reach = Vec3::repeat((high - low).amax());
            let middle = (low + high) / 2.0;
            (middle - reach, middle + reach)
        });
        Self { bounds }
    }

    fn holds(&self, r: &Vec3) -> bool {
        self.bounds.is_none_or(|(low, high)| (0..3).all(|k| (low[k]..=high[k]).contains(&r[k])))
    }
}

/// Edges joined to lines as far as they go on from each other, with gaps between.
fn chained(outlines: &[[Vec3; 2]], seen: &dyn Fn(Vec3) -> [f64; 2]) -> Vec<[f64; 2]> {
    let key = |r: &Vec3| [r.x.to_bits(), r.y.to_bits(), r.z.to_bits()];
    let mut at: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
    for (number, edge) in outlines.iter().enumerate() {
        edge.iter().for_each(|r| at.entry(key(r)).or_default().push(number));
    }
    let mut used = vec![false; outlines.len()];
    let mut points = Vec::new();
    for first in 0..outlines.len() {
        if std::mem::replace(&mut used[first], true) {
            continue;
        }
        let mut end = outlines[first][1];
        points.extend([seen(outlines[first][0]), seen(end)]);
        while let Some(&next) = at.get(&key(&end)).and_then(|edges| edges.iter().find(|&&e| !used[e])) {
            used[next] = true;
            end = if key(&outlines[next][0]) == key(&end) { outlines[next][1] } else { outlines[next][0] };
            points.push(seen(end));
        }
        points.push([f64::NAN; 2]);
    }
    points
}

/// Short lines along x, y and z at the lower left of what is drawn.
fn arrows(all: &[[f64; 2]], factor: f64, right: &Vec3, up: &Vec3) -> Vec<Curve> {
    let finite = || all.iter().filter(|p| p[0].is_finite());
    let fold = |k: usize, f: fn(f64, f64) -> f64, from: f64| finite().map(|p| p[k]).fold(from, f);
    let (left, low) = (fold(0, f64::min, f64::INFINITY), fold(1, f64::min, f64::INFINITY));
    let size = (fold(0, f64::max, f64::NEG_INFINITY) - left).max(fold(1, f64::max, f64::NEG_INFINITY) - low);
    if !size.is_finite() || size <= 0.0 {
        return Vec::new();
    }
    let origin = [left, low];
    let ends = [("x", 1, Vec3::x()), ("y", 2, Vec3::y()), ("z", 0, Vec3::z())];
    ends.into_iter()
        .map(|(name, colour, axis)| {
            let end = [axis.dot(right), axis.dot(up)].map(|v| v * ARROW * size);
            let points = vec![origin.map(|v| v * factor), [0, 1].map(|k| (origin[k] + end[k]) * factor)];
            Curve { label: format!("{name} direction"), points, colour, faint: false }
        })
        .collect()
}
