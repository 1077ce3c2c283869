//! Surfaces of revolution: rows of points round an axis, as many to a row as its size asks for.

use std::f64::consts::{PI, TAU};

use super::Triangulation;
use super::patchwork::Patchwork;
use crate::Vec3;

/// A meridian: points (distance from the axis, height), m, with the outside on the left of the direction of travel.
pub(super) type Meridian = Vec<[f64; 2]>;

/// Azimuthal points on a row at distance `r` from the axis when panels may be `width` long: a multiple of eight, which keeps
/// the symmetry of the square; four next to the axis; one on it.
fn row_count(r: f64, width: f64) -> usize {
    let wanted = TAU * r / width;
    if r <= 0.0 {
        1
    } else if wanted < 6.0 {
        4
    } else {
        8 * ((wanted / 8.0).round() as usize).max(1)
    }
}

/// Radius at which a regular polygon of `n` corners has the circumference of a circle of radius `r`.
fn widened(r: f64, n: usize) -> f64 {
    if n <= 1 {
        return r;
    }
    let half = PI / n as f64;
    r * half / half.sin()
}

/// Radius at which a regular polygon of `n` corners is on average as far from its centre as a circle of radius `r`: to first
/// order, an electrode round a space makes the field there that the circle makes.
fn evened(r: f64, n: usize) -> f64 {
    if n <= 1 {
        return r;
    }
    let half = PI / n as f64;
    r * half / (half.cos() * half.tan().asinh())
}

/// Turns a meridian about the z axis, with panels about `width` (m) long round it. Rows are widened so that each polygon has
/// the circumference of its circle.
pub(super) fn revolve(meridian: &[[f64; 2]], width: f64) -> Triangulation {
    turn(meridian, false, |r| row_count(r, width), widened)
}

/// Turns a meridian about the z axis, with panels about `width(r)` (m) long round it at distance `r`. Rows are widened so that
/// each polygon is as far from the axis on average as its circle.
pub(super) fn revolve_round_space(meridian: &[[f64; 2]], width: impl Fn(f64) -> f64) -> Triangulation {
    turn(meridian, false, |r| row_count(r, width(r)), evened)
}

/// Turns a closed meridian that stays clear of the axis, with `count` panels round it in every row: a torus.
pub(super) fn revolve_closed(meridian: &[[f64; 2]], count: usize) -> Triangulation {
    turn(meridian, true, |_| count, widened)
}

fn turn(
    meridian: &[[f64; 2]],
    closed: bool,
    count: impl Fn(f64) -> usize,
    wide: impl Fn(f64, usize) -> f64,
) -> Triangulation {
    let largest = meridian.iter().map(|p| p[0]).fold(0.0, f64::max);
    let mut work = Patchwork::default();
    let rows: Vec<Vec<u32>> = meridian
        .iter()
        .map(|&[r, z]| {
            let r = if r <= 1e-12 * largest { 0.0 } else { r };
            let n = count(r);
            let wide = wide(r, n);
            (0..n)
                .map(|k| {
                    let (sin, cos) = (TAU * k as f64 / n as f64).sin_cos();
                    work.vertex(Vec3::new(wide * cos, wide * sin, z))
                })
                .collect()
        })
        .collect();
    for i in 1..rows.len() {
        zip(&mut work, &rows[i - 1], &rows[i]);
    }
    if closed {
        zip(&mut work, &rows[rows.len() - 1], &rows[0]);
    }
    work.finish()
}

/// Fills the strip between two rows. Each quarter turn repeats the first, and its second half mirrors its first.
fn zip(work: &mut Patchwork, a: &[u32], b: &[u32]) {
    if a.len() == 1 || b.len() == 1 {
        for k in 0..a.len().max(b.len()) {
            let next = |row: &[u32]| row[(k + 1) % row.len()];
            let here = |row: &[u32]| row[k % row.len()];
            if a.len() == 1 && b.len() > 1 {
                work.triangle(a[0], here(b), next(b));
            } else if b.len() == 1 && a.len() > 1 {
                work.triangle(here(a), b[0], next(a));
            }
        }
        return;
    }
    let (qa, qb) = (a.len() / 4, b.len() / 4);
    for quarter in 0..4 {
        let at = |row: &[u32], q: usize, k: usize| row[(quarter * q + k) % row.len()];
        let (mut i, mut j) = (0, 0);
        while i < qa || j < qb {
            // Fractions of the quarter where the next point of each row stands, compared without rounding.
            let (next_a, next_b) = ((i + 1) * qb, (j + 1) * qa);
            let second_half = 2 * (i * qb + j * qa) >= 2 * qa * qb;
            let step_a = i < qa && (j >= qb || next_a < next_b || (next_a == next_b && second_half));
            if step_a {
                work.triangle(at(a, qa, i), at(b, qb, j), at(a, qa, i + 1));
                i += 1;
            } else {
                work.triangle(at(a, qa, i), at(b, qb, j), at(b, qb, j + 1));
                j += 1;
            }
        }
    }
}
