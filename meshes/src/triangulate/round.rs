//! Shapes with an axis.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::Triangulation;
use super::flat::thicken;
use super::grading::{End, count_for, lines};
use super::revolve::{Meridian, area_of_revolution, revolve, revolve_closed};
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

pub(super) fn hyperbolic_ring(r0: f64, extent: f64, fineness: f64) -> Triangulation {
    // r = r0 cosh t, z = r0/√2 sinh t, from below upwards: the side facing the axis is the outside.
    let end = (extent / r0).acosh();
    let curve = |s: f64| {
        let t = end * (2.0 * s - 1.0);
        [r0 * t.cosh(), r0 * t.sinh() / 2.0_f64.sqrt()]
    };
    let rows = count(18.0, fineness, 6);
    let meridian = along(curve, &lines(rows, End::Free, End::Free));
    let width = 1.5 * arc_length(&curve) * super::grading::widest(rows, End::Free, End::Free);
    revolve(&meridian, width).with_area(area_of_revolution(curve), wider)
}

pub(super) fn hyperbolic_cap(z0: f64, extent: f64, fineness: f64) -> Triangulation {
    // r = √2 z0 sinh t, z = z0 cosh t, from the rim to the pole: the side facing the centre is the outside.
    let end = (extent / (2.0_f64.sqrt() * z0)).asinh();
    let curve = |s: f64| {
        let t = end * (1.0 - s);
        [2.0_f64.sqrt() * z0 * t.sinh(), z0 * t.cosh()]
    };
    let rows = count(11.0, fineness, 4);
    let mut meridian = along(curve, &lines(rows, End::Free, End::Smooth));
    if let Some(pole) = meridian.last_mut() {
        pole[0] = 0.0;
    }
    let width = arc_length(&curve) * super::grading::widest(rows, End::Free, End::Smooth);
    revolve(&meridian, width).with_area(area_of_revolution(curve), wider)
}
