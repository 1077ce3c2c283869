//! Round wires along a line, straight or bent, and grids of them.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::Triangulation;
use super::grading::{End, lines};
use super::patchwork::Patchwork;
use crate::lattice::wires_along;
use crate::{Outline, Vec3, Weave};

/// Gap between wires that cross, in wire radii, so that their panels stay apart. All wires of a grid have one potential:
/// the gap only keeps the mesh clean.
pub(crate) const CLEARANCE: f64 = 0.1;

/// Number of panels round a wire.
fn sides(fineness: f64) -> usize {
    2 * ((4.0 * fineness).round() as usize).max(3)
}

/// Centre line with points as the mesh wants them, and whether it is closed.
struct Path {
    points: Vec<Vec3>,
    closed: bool,
}

/// Direction in which a path leaves each of its points; at a bend the mean of both sides.
fn tangents(path: &Path) -> Vec<Vec3> {
    let n = path.points.len();
    let step = |i: usize, j: usize| (path.points[j % n] - path.points[i % n]).normalize();
    (0..n)
        .map(|i| {
            let before = if i > 0 || path.closed { Some(step(i + n - 1, i)) } else { None };
            let after = if i + 1 < n || path.closed { Some(step(i, i + 1)) } else { None };
            match (before, after) {
                (Some(b), Some(a)) => (a + b).normalize(),
                (Some(d), None) | (None, Some(d)) => d,
                (None, None) => Vec3::z(),
            }
        })
        .collect()
}

/// Distance of the corners from the centre of a regular polygon that holds the charge of a circle at the same voltage, m.
///
/// A wire of polygonal section acts like a round one of the polygon's outer conformal radius, which for n corners at
/// distance ρ is
///
///   r = ρ · 2 sin(π/n) Γ(1/n) / [2^(1 + 2/n) √π Γ(1/2 + 1/n)]
///
/// The polygon whose area of surface is the wire's is too thin an electrode by 1.5/n² of its radius, an error of 1e-3 in the
/// capacitance of a ring of sixteen sides; this one has a slightly larger surface instead.
///
/// Source: Pólya and Szegő 1951, table of outer radii. Checked by `wires_hold_the_charge_of_round_ones`.
pub(super) fn capacitive_radius(radius: f64, n: usize) -> f64 {
    let inverse = 1.0 / n as f64;
    let conformal = 2.0 * (PI * inverse).sin() * libm::tgamma(inverse)
        / (2.0_f64.powf(1.0 + 2.0 * inverse) * PI.sqrt() * libm::tgamma(0.5 + inverse));
    radius / conformal
}

/// Sweeps a polygon with corners at `wide` (m) along a path: rings in the planes that halve the bends, domes at free ends.
fn sweep(work: &mut Patchwork, path: &Path, wide: f64, around: usize) {
    let tangents = tangents(path);
    let n = path.points.len();
    // A frame carried along without twisting (Bishop 1975): each step turns it by the least rotation.
    let first = tangents[0];
    let mut side = first.cross(&Vec3::ith(first.iamin(), 1.0)).normalize();
    let mut frames = vec![side];
    for i in 1..n {
        side = carried(&side, &tangents[i - 1], &tangents[i]);
        frames.push(side);
    }
    // Round a closed path the frame comes back turned by some angle, which is spread over the length.
    let twist = if path.closed {
        let back = carried(&side, &tangents[n - 1], &first);
        back.dot(&first.cross(&frames[0])).atan2(back.dot(&frames[0]))
    } else {
        0.0
    };
    let rings: Vec<Vec<u32>> = (0..n)
        .map(|i| {
            let (t, u) = (tangents[i], frames[i]);
            let w = t.cross(&u);
            let turn = -twist * i as f64 / n as f64;
            // In the plane that halves a bend the tube's section is an ellipse: points slide along the straight part
            // until they meet the plane.
            let next = if path.closed { (i + 1) % n } else { (i + 1).min(n - 1) };
            let along = (path.points[next] - path.points[i]).try_normalize(0.0).unwrap_or(t);
            (0..around)
                .map(|k| {
                    let (sin, cos) = (TAU * (k as f64 + 0.5) / around as f64 + turn).sin_cos();
                    let d = (u * cos + w * sin) * wide;
                    let across = d - along * d.dot(&along);
                    let across = across.try_normalize(0.0).unwrap_or(d) * wide;
                    let slide = -across.dot(&t) / along.dot(&t);
                    work.vertex(path.points[i] + across + along * slide)
                })
                .collect()
        })
        .collect();
    let last = if path.closed { n } else { n - 1 };
    for i in 0..last {
        let (a, b) = (&rings[i], &rings[(i + 1) % n]);
        for k in 0..around {
            let l = (k + 1) % around;
            work.quad([a[k], a[l], b[l], b[k]], (i + k) % 2 == 0);
        }
    }
    if !path.closed {
        dome(work, &rings[0], path.points[0], -tangents[0], wide, true);
        dome(work, &rings[n - 1], path.points[n - 1], tangents[n - 1], wide, false);
    }
}

/// A direction across the unit vector `from`, turned by the least rotation that takes `from` to the unit vector `to`:
/// v - (a + b) (v·b) / (1 + a·b), Rodrigues' formula for v ⟂ a. Never turned back on itself: `Shape::check` sees to that.
fn carried(side: &Vec3, from: &Vec3, to: &Vec3) -> Vec3 {
    let turned = side - (from + to) * (side.dot(to) / (1.0 + from.dot(to)));
    (turned - to * turned.dot(to)).normalize()
}

/// Closes the end of a tube with a hemisphere. `reversed` for the end that looks against the path.
fn dome(work: &mut Patchwork, ring: &[u32], center: Vec3, out: Vec3, radius: f64, reversed: bool) {
    let around = ring.len();
    let rows = (around / 4).max(2);
    let rim: Vec<Vec3> = ring.iter().map(|&v| work.at(v) - center).collect();
    let mut below = ring.to_vec();
    for row in 1..rows {
        let (sin, cos) = (FRAC_PI_2 * row as f64 / rows as f64).sin_cos();
        let here: Vec<u32> = rim.iter().map(|r| work.vertex(center + r * cos + out * (radius * sin))).collect();
        for k in 0..around {
            let l = (k + 1) % around;
            let corners = [below[k], below[l], here[l], here[k]];
            work.quad(if reversed { [corners[3], corners[2], corners[1], corners[0]] } else { corners }, true);
        }
        below = here;
    }
    let tip = work.vertex(center + out * radius);
    for k in 0..around {
        let l = (k + 1) % around;
        if reversed {
            work.triangle(below[l], below[k], tip);
        } else {
            work.triangle(below[k], below[l], tip);
        }
    }
}

/// A straight or bent wire. The ends of an open wire are the tips of its hemispheres.
pub(super) fn wire(points: &[Vec3], radius: f64, fineness: f64) -> Triangulation {
    let closed = points.len() > 2 && (points[0] - points[points.len() - 1]).norm() < 1e-9 * radius;
    let mut corners = points.to_vec();
    if closed {
        corners.pop();
    } else {
        // The hemispheres end where the wire ends.
        let n = corners.len();
        let (start, end) = ((corners[1] - corners[0]).normalize(), (corners[n - 2] - corners[n - 1]).normalize());
        corners[0] += start * radius;
        corners[n - 1] += end * radius;
    }
    let around = sides(fineness);
    let pieces = corners.len() - usize::from(!closed);
    let total: f64 = (0..pieces).map(|i| (corners[(i + 1) % corners.len()] - corners[i]).norm()).sum();
    // Along the wire panels may be eight times as long as wide, but a wire has at least some twenty of them.
    let step = (8.0 * TAU * radius / around as f64).min(total / (20.0 * fineness).max(4.0));
    let mut path = Path { points: Vec::new(), closed };
    for i in 0..pieces {
        let (from, to) = (corners[i], corners[(i + 1) % corners.len()]);
        let n = (((to - from).norm() / step).ceil() as usize).max(1);
        let (start, end) = (
            if !closed && i == 0 { End::Corner } else { End::Smooth },
            if !closed && i + 1 == pieces { End::Corner } else { End::Smooth },
        );
        path.points.extend(lines(n, start, end)[..n].iter().map(|t| from + (to - from) * *t));
    }
    if !closed {
        path.points.push(corners[corners.len() - 1]);
    }
    let mut work = Patchwork::default();
    sweep(&mut work, &path, capacitive_radius(radius, around), around);
    work.finish()
}

/// Wires side by side, crossed or woven, within an outline.
pub(super) fn wire_grid(outline: Outline, pitch: f64, weave: Weave, radius: f64, fineness: f64) -> Triangulation {
    let around = sides(fineness);
    let wide = capacitive_radius(radius, around);
    let lift = if weave == Weave::Parallel { 0.0 } else { wide + 0.5 * CLEARANCE * radius };
    // Panels along a wire: three to a pitch resolve the neighbours' influence, woven wires need their wave resolved as well.
    let per_pitch =
        if weave == Weave::Woven { (6.0 * fineness).round().max(4.0) } else { (3.0 * fineness).round().max(2.0) };
    let layers = if weave == Weave::Parallel { &[true][..] } else { &[true, false][..] };
    let mut paths = Vec::new();
    for &second in layers {
        let wires = wires_along(outline, pitch, radius, second);
        let others = wires_along(outline, pitch, radius, !second).len();
        let side = if second { -1.0 } else { 1.0 };
        for (index, (offset, half)) in wires.into_iter().enumerate() {
            // The hemispheres end where the wire ends.
            let half = half - radius;
            let n = ((2.0 * half / pitch * per_pitch).ceil() as usize).max(3);
            let points = (0..=n)
                .map(|i| {
                    let s = half * (2.0 * i as f64 / n as f64 - 1.0);
                    let height = match weave {
                        Weave::Parallel => 0.0,
                        Weave::Crossed => side * lift,
                        // Over one, under the next: wire i meets wire j of the other layer at phase π(i + j).
                        Weave::Woven => {
                            let j = s / pitch + 0.5 * (others as f64 - 1.0);
                            side * lift * (PI * (j + index as f64)).cos()
                        }
                    };
                    if second { Vec3::new(offset, s, height) } else { Vec3::new(s, offset, height) }
                })
                .collect::<Vec<_>>();
            paths.push(Path { points, closed: false });
        }
    }
    let mut work = Patchwork::default();
    for path in &paths {
        sweep(&mut work, path, wide, around);
    }
    work.finish()
}
