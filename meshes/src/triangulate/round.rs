//! Shapes with an axis.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::Triangulation;
use super::flat::thicken;
use super::grading::{End, count_for, lines};
use super::revolve::{Meridian, revolve, revolve_closed, revolve_round_space};
use super::tube::capacitive_radius;
use crate::Vec3;

/// A count that scales with fineness, at least `least`.
fn count(per_unit: f64, fineness: f64, least: usize) -> usize {
    ((per_unit * fineness).round() as usize).max(least)
}

/// Scales the distance from the axis.
fn wider(v: &Vec3, k: f64) -> Vec3 {
    Vec3::new(v.x * k, v.y * k, v.z)
}

pub(super) fn sphere(radius: f64, fineness: f64) -> Triangulation {
    let rows = count(14.0, fineness, 4);
    let meridian: Meridian = (0..=rows)
        .map(|i| {
            let (sin, cos) = (PI * i as f64 / rows as f64).sin_cos();
            [if i == 0 || i == rows { 0.0 } else { radius * sin }, radius * cos]
        })
        .collect();
    revolve(&meridian, PI * radius / rows as f64).with_area(4.0 * PI * radius * radius, |v, k| v * k)
}

pub(super) fn ring(radius: f64, wire_radius: f64, fineness: f64) -> Triangulation {
    // Round the wire the error is that of a polygon, (number of sides)^-2; along the ring the charge varies over the size of
    // the ring, so that panels there may be longer: up to sixteen times on a thin wire.
    let sides = 2 * count(4.0, fineness, 3);
    let side = TAU * wire_radius / sides as f64;
    let round = TAU * (radius + wire_radius);
    let longest = (round / count(36.0, fineness, 12) as f64).min(16.0 * side);
    let along = 8 * ((round / longest / 8.0).round() as usize).max(1);
    let corner = capacitive_radius(wire_radius, sides);
    let meridian: Meridian = (0..sides)
        .map(|i| {
            // Half a step off the equator: panels, not points, face the axis and the outside.
            let (sin, cos) = (-TAU * (i as f64 + 0.5) / sides as f64).sin_cos();
            [radius + corner * cos, corner * sin]
        })
        .collect();
    revolve_closed(&meridian, along)
}

pub(super) fn disc(radius: f64, hole_radius: f64, thickness: f64, fineness: f64) -> Triangulation {
    let inner = if hole_radius > 0.0 { End::Free } else { End::Smooth };
    let span = radius - hole_radius;
    let rows = count(if hole_radius > 0.0 { 12.0 } else { 10.0 }, fineness, 4);
    let meridian: Meridian = lines(rows, inner, End::Free).iter().map(|t| [hole_radius + span * t, 0.0]).collect();
    let widest = span * super::grading::widest(rows, inner, End::Free);
    // A narrow annulus needs no panels as short as it is wide.
    let width = widest.max((TAU * radius / count(36.0, fineness, 16) as f64).min(4.0 * widest));
    let area = PI * (radius * radius - hole_radius * hole_radius);
    let sheet = revolve(&meridian, width).with_area(area, wider);
    thicken(sheet, thickness, width)
}

pub(super) fn end_cap(radius: f64, opening: f64, thickness: f64, fineness: f64) -> Triangulation {
    let arc = |r: f64, rows: usize, rim: End| -> Meridian {
        let mut points: Meridian = lines(rows, End::Smooth, rim)
            .iter()
            .map(|t| {
                let (sin, cos) = (opening * t).sin_cos();
                [r * sin, r * cos]
            })
            .collect();
        points[0][0] = 0.0;
        points
    };
    // A small cap needs as many rows as a disc, a nearly closed one as many as a sphere.
    let rows = count(10.0 + 6.0 * (opening / PI), fineness, 4);
    if thickness == 0.0 {
        let meridian = arc(radius, rows, End::Free);
        let width = radius * opening * super::grading::widest(rows, End::Smooth, End::Free);
        let area = TAU * radius * radius * (1.0 - opening.cos());
        return revolve(&meridian, width).with_area(area, |v, k| v * k);
    }
    let outer_radius = radius + thickness;
    let width = outer_radius * opening * super::grading::widest(rows, End::Smooth, End::Corner);
    let rim = if thickness < width { End::Free } else { End::Corner };
    let walls =
        lines(count_for(width.min(0.5 * thickness) / thickness, End::Corner, End::Corner), End::Corner, End::Corner);
    let mut meridian = arc(outer_radius, rows, rim);
    let (sin, cos) = opening.sin_cos();
    for t in &walls[1..walls.len() - 1] {
        let r = outer_radius - thickness * t;
        meridian.push([r * sin, r * cos]);
    }
    meridian.extend(arc(radius, rows, rim).into_iter().rev());
    let area = TAU * (1.0 - opening.cos()) * (outer_radius * outer_radius + radius * radius)
        + PI * opening.sin() * (outer_radius * outer_radius - radius * radius);
    revolve(&meridian, width).with_area(area, |v, k| v * k)
}

pub(super) fn cylinder(radius: f64, length: f64, caps: bool, fineness: f64) -> Triangulation {
    let end = if caps { End::Corner } else { End::Free };
    let around = TAU * radius / (8 * count(4.0, fineness, 2)) as f64;
    // Long tubes: panels up to three times as long as wide, since far from the ends the charge varies along the tube slowly.
    let step = (length / count(8.0, fineness, 4) as f64).min(3.0 * around).max(around.min(length / 3.0));
    let heights: Vec<f64> =
        lines(count_for(step / length, end, end), end, end).iter().map(|t| length * (0.5 - t)).collect();
    let side: Meridian = heights.iter().map(|&z| [radius, z]).collect();
    if !caps {
        return revolve(&side, around).with_area(TAU * radius * length, wider);
    }
    let rows = lines(count_for(around / radius, End::Smooth, End::Corner), End::Smooth, End::Corner);
    let mut meridian: Meridian = rows.iter().map(|t| [radius * t, 0.5 * length]).collect();
    meridian.extend(&side[1..side.len() - 1]);
    meridian.extend(rows.iter().rev().map(|t| [radius * t, -0.5 * length]));
    revolve(&meridian, around).with_area(TAU * radius * (radius + length), wider)
}

pub(super) fn rod(radius: f64, length: f64, fineness: f64) -> Triangulation {
    // A thick rod is meshed like a sphere, a thin one like a wire.
    let around =
        (TAU * radius / (8 * count(1.5, fineness, 1)) as f64).min((TAU * radius * length).sqrt() / (16.0 * fineness));
    let straight = length - 2.0 * radius;
    let quarter = ((FRAC_PI_2 * radius / around).round() as usize).max(2);
    let dome = |i: usize| {
        let (sin, cos) = (FRAC_PI_2 * i as f64 / quarter as f64).sin_cos();
        [if i == 0 { 0.0 } else { radius * sin }, 0.5 * straight + radius * cos]
    };
    let mut meridian: Meridian = (0..=quarter).map(dome).collect();
    if straight > 1e-9 * radius {
        let step = (straight / count(8.0, fineness, 4) as f64).min(3.0 * around).max(around.min(straight));
        let heights = lines(count_for(step / straight, End::Corner, End::Corner), End::Corner, End::Corner);
        meridian.extend(heights[1..].iter().map(|t| [radius, straight * (0.5 - t)]));
    }
    meridian.extend((0..quarter).rev().map(|i| {
        let [r, z] = dome(i);
        [r, -z]
    }));
    revolve(&meridian, around).with_area(TAU * radius * length, wider)
}

/// Points at given fractions of the arc length of a curve.
fn along(curve: impl Fn(f64) -> [f64; 2], fractions: &[f64]) -> Meridian {
    let n = 4000;
    let mut length = vec![0.0; n + 1];
    for k in 1..=n {
        let (p, q) = (curve((k - 1) as f64 / n as f64), curve(k as f64 / n as f64));
        length[k] = length[k - 1] + (p[0] - q[0]).hypot(p[1] - q[1]);
    }
    fractions
        .iter()
        .map(|f| {
            let wanted = f * length[n];
            let k = length.partition_point(|&s| s < wanted).clamp(1, n);
            let part = (wanted - length[k - 1]) / (length[k] - length[k - 1]);
            curve((k as f64 - 1.0 + part) / n as f64)
        })
        .collect()
}

/// Length of a curve, m.
fn arc_length(curve: &impl Fn(f64) -> [f64; 2]) -> f64 {
    let points = along(curve, &(0..=1000).map(|k| k as f64 / 1000.0).collect::<Vec<_>>());
    points.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum()
}

/// Steps of the inner meridian on a length of two r0 at fineness 1: some five hundred panels on a ring that reaches to 3 r0.
const STEPS: f64 = 5.0;

/// Where the common rows begin, in r0. Inside of it the sheets are more than half a r0 apart, and each has its own even rows.
const JOIN: f64 = 1.5;

/// Widest step of the common rows, in steps of the inner meridian: outside the sheets are flat, and what happens there hardly
/// reaches the centre. More makes the capacitances worse (by 6e-3 instead of 3e-3 at 2400 panels and 2.4 instead of 1.6), less
/// makes the quadrupole worse.
const OUTER_STEP: f64 = 1.9;

/// Length of panels round the axis at r0, in steps of the meridian. 1.4 made A2 worse by three to ten times.
const WIDTH: f64 = 1.0;

/// Rows that a hyperbolic ring and its caps have in common, as distances from the axis.
///
/// *Why.* Ring and caps come closer and closer to each other outwards: at 3 r0 a fifth of r0 is left, less than a panel of a mesh
/// of some thousand. With rows and corners of their own, facets stand off the hyperboloids by a tenth of that gap, here wider,
/// there narrower, and panels that face each other carry charges that do not match: A2 r0² near the centre was 0.92 to 0.99,
/// with no order in the number of panels. Panels as small as the gap would leave none for the centre. With the same rows and
/// the same corners on both, facets stand off both sheets alike and leave the gap as it is, and each panel faces its image.
/// What remains is the shape near the centre, where chords are moved to leave the space they take ([`evened`]): 1 to 4e-4
/// from 1800 panels on at 2 r0, from 3300 on at 3 r0, and hardly worse when ring and caps have rows of other finenesses.
struct CommonRows {
    /// Distances from the axis, from the rim inwards, m.
    rows: Vec<f64>,
    /// Step of the meridian inside of the last of them, m.
    step: f64,
    /// m.
    size: f64,
}

impl CommonRows {
    /// For a sheet that is cut off early, and has no rows in common, `own` says from where its outer part is, and `size` what
    /// its counts go by, both in m.
    fn new(r0: f64, extent: f64, own: f64, size: f64, fineness: f64) -> Self {
        // A whole number decides, so that ring and caps of about the same fineness have the same rows.
        let step = 2.0 * size / count(STEPS, fineness, 2) as f64;
        let join = if extent > 1.2 * JOIN * r0 { JOIN * r0 } else { own };
        let length = (extent - join) * 1.5_f64.sqrt();
        let n = count_for(OUTER_STEP * step / length, End::Smooth, End::Free).max(2);
        let rows = lines(n, End::Smooth, End::Free).iter().rev().map(|t| join + (extent - join) * t).collect();
        Self { rows, step, size }
    }

    /// Length of panels round the axis at distance r, m: as many everywhere from r0 to 3 r0, and as long beyond.
    fn width(&self) -> impl Fn(f64) -> f64 {
        let (step, size) = (self.step, self.size);
        move |r| WIDTH * step * (r / size).clamp(1.0, 3.0)
    }
}

/// Moves the points of a meridian off their curve by 1/12 of curvature times squared step, so that its chords leave as much
/// space on one side of the curve as on the other. The ends stay.
fn evened(points: &[[f64; 2]]) -> Meridian {
    let n = points.len();
    (0..n)
        .map(|i| {
            if i == 0 || i + 1 == n {
                return points[i];
            }
            let [a, b, c] = [points[i - 1], points[i], points[i + 1]];
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
            let (lu, lv) = (u[0].hypot(u[1]), v[0].hypot(v[1]));
            // The change of direction is curvature times the mean step, along the normal to the inside of the bend.
            let turn = [v[0] / lv - u[0] / lu, v[1] / lv - u[1] / lu];
            let mean = 0.5 * (lu + lv);
            let share = (lu * lu + lv * lv) / (24.0 * mean);
            [b[0] - share * turn[0], b[1] - share * turn[1]]
        })
        .collect()
}

pub(super) fn hyperbolic_ring(r0: f64, extent: f64, fineness: f64) -> Triangulation {
    // r = r0 cosh t, z = r0/√2 sinh t, from below upwards: the side facing the axis is the outside.
    // A narrow ring needs no panels much longer than it is high.
    let size = r0.min(1.5 * (0.5 * (extent * extent - r0 * r0)).sqrt());
    let own = r0 * (0.5 * (extent / r0).acosh()).cosh();
    let outer = CommonRows::new(r0, extent, own, size, fineness);
    let join = (outer.rows[outer.rows.len() - 1] / r0).acosh();
    let curve = |s: f64| {
        let t = join * (2.0 * s - 1.0);
        [r0 * t.cosh(), r0 * t.sinh() / 2.0_f64.sqrt()]
    };
    let inner = 2 * ((0.5 * arc_length(&curve) / outer.step).round() as usize).max(1);
    let at = |r: f64, sign: f64| [r, sign * ((r * r - r0 * r0) / 2.0).max(0.0).sqrt()];
    let mut meridian: Meridian = outer.rows.iter().map(|&r| at(r, -1.0)).collect();
    let middle = along(curve, &lines(inner, End::Smooth, End::Smooth));
    meridian.extend(&middle[1..inner]);
    meridian.extend(outer.rows.iter().rev().map(|&r| at(r, 1.0)));
    revolve_round_space(&evened(&meridian), outer.width())
}

pub(super) fn hyperbolic_cap(r0: f64, z0: f64, extent: f64, fineness: f64) -> Triangulation {
    // r = √2 z0 sinh t, z = z0 cosh t, from the rim to the pole: the side facing the centre is the outside.
    let outer = CommonRows::new(r0, extent, 0.5 * extent, r0.min(extent), fineness);
    let join = (outer.rows[outer.rows.len() - 1] / (2.0_f64.sqrt() * z0)).asinh();
    let curve = |s: f64| {
        let t = join * (1.0 - s);
        [2.0_f64.sqrt() * z0 * t.sinh(), z0 * t.cosh()]
    };
    let inner = ((arc_length(&curve) / outer.step).round() as usize).max(2);
    let mut meridian: Meridian = outer.rows.iter().map(|&r| [r, (z0 * z0 + 0.5 * r * r).sqrt()]).collect();
    let middle = along(curve, &lines(inner, End::Smooth, End::Smooth));
    meridian.extend(&middle[1..]);
    let mut meridian = evened(&meridian);
    if let Some(pole) = meridian.last_mut() {
        pole[0] = 0.0;
        // As elsewhere: a twelfth of the curvature 1/(2 z0) times the squared step.
        let first = 2.0_f64.sqrt() * z0 * (join / inner as f64);
        pole[1] -= first * first / (24.0 * z0);
    }
    revolve_round_space(&meridian, outer.width())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hyperbolic_sheets_of_any_extent_are_sound() {
        for fineness in [0.5, 1.0, 3.0] {
            for extent in [0.2, 0.99, 1.0, 1.05, 1.3, 6.0] {
                for z0 in [0.3, 0.7, 2.0] {
                    let cap = hyperbolic_cap(1.0, z0, extent, fineness);
                    let ring = if extent > 1.0 { hyperbolic_ring(1.0, extent, fineness) } else { cap.clone() };
                    for (mesh, rims) in [(cap, 1.0), (ring, if extent > 1.0 { 2.0 } else { 1.0 })] {
                        let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices[v as usize]);
                        let aspect = |t: &[u32; 3]| crate::triangle::aspect_ratio(&corners(t));
                        let worst = mesh.triangles.iter().map(aspect).fold(0.0, f64::max);
                        assert!(worst < 60.0 * fineness.max(1.0), "{worst} at extent {extent}, z0 {z0}, {fineness}");
                        let edge = |[a, b]: &[u32; 2]| mesh.vertices[*a as usize] - mesh.vertices[*b as usize];
                        let rim: f64 = mesh.open_edges().iter().map(|e| edge(e).norm()).sum();
                        // A rim of eight corners is longer than its circle by 3e-2.
                        assert!((rim / (TAU * extent * rims) - 1.0).abs() < 4e-2, "rim {rim} at extent {extent}");
                    }
                }
            }
        }
    }

    #[test]
    fn hyperbolic_ring_and_cap_have_their_outer_corners_face_to_face() {
        let (r0, z0, extent) = (1.0, 0.7, 3.0);
        for fineness in [0.6, 1.0, 2.3] {
            let (ring, cap) = (hyperbolic_ring(r0, extent, fineness), hyperbolic_cap(r0, z0, extent, fineness));
            let outer = |mesh: &Triangulation| -> Vec<Vec3> {
                let above = |v: &&Vec3| v.z > 0.0 && v.xy().norm() > 1.7 * r0;
                mesh.vertices.iter().filter(above).copied().collect()
            };
            let (below, above) = (outer(&ring), outer(&cap));
            assert_eq!(below.len(), above.len());
            let gap = |r: f64| (z0 * z0 + 0.5 * r * r).sqrt() - (0.5 * (r * r - r0 * r0)).sqrt();
            for v in &below {
                let nearest = above.iter().map(|w| (w.xy() - v.xy()).norm()).fold(f64::INFINITY, f64::min);
                // Both meridians are moved off their curves by a little, and not by the same.
                assert!(nearest < 0.1 * gap(v.xy().norm()), "{nearest} at {v}");
            }
        }
    }
}
