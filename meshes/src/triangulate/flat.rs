//! Flat sheets, their thick forms, and blocks.

use super::Triangulation;
use super::grading::{End, count_for, lines};
use super::patchwork::Patchwork;
use crate::Vec3;

/// Gives a sheet in the plane z = 0 (normals along +z) a thickness: a copy on either side and walls along its edges.
/// Zero thickness returns the sheet. `width` is the size of its panels, m.
pub(super) fn thicken(sheet: Triangulation, thickness: f64, width: f64) -> Triangulation {
    if thickness == 0.0 {
        return sheet;
    }
    let edges = sheet.open_edges();
    let n = sheet.vertices.len() as u32;
    let half = Vec3::z() * (0.5 * thickness);
    let mut solid = Triangulation {
        vertices: sheet.vertices.iter().map(|v| v + half).chain(sheet.vertices.iter().map(|v| v - half)).collect(),
        triangles: sheet.triangles.clone(),
    };
    solid.triangles.extend(sheet.triangles.iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]));
    let walls = lines(count_for((width / thickness).min(0.5), End::Corner, End::Corner), End::Corner, End::Corner);
    // Numbers of the points between top and bottom, for each point on an edge.
    let mut below: std::collections::HashMap<u32, Vec<u32>> = std::collections::HashMap::new();
    for &v in edges.iter().flatten() {
        below.entry(v).or_insert_with(|| {
            let mut column = vec![v];
            for t in &walls[1..walls.len() - 1] {
                column.push(solid.vertices.len() as u32);
                solid.vertices.push(sheet.vertices[v as usize] + half * (1.0 - 2.0 * t));
            }
            column.push(v + n);
            column
        });
    }
    for [a, b] in edges {
        let (left, right) = (&below[&a], &below[&b]);
        for k in 1..left.len() {
            let (a0, b0, a1, b1) = (left[k - 1], right[k - 1], left[k], right[k]);
            if 2 * k < left.len() {
                solid.triangles.extend([[a0, a1, b0], [b0, a1, b1]]);
            } else {
                solid.triangles.extend([[a0, a1, b1], [a0, b1, b0]]);
            }
        }
    }
    solid
}

/// Steps for the two sides of a rectangle with about `cells` cells across its mean side; long sides get longer steps.
fn steps(a: f64, b: f64, cells: f64) -> [f64; 2] {
    let mean = (a * b).sqrt() / cells;
    let stretch = (a / b).powf(0.25).clamp(0.5, 2.0);
    [(mean * stretch).min(a / 3.0), (mean / stretch).min(b / 3.0)]
}

pub(super) fn plate(size: [f64; 2], thickness: f64, fineness: f64) -> Triangulation {
    let [a, b] = size;
    let [step_a, step_b] = steps(a, b, 8.0 * fineness);
    let us = lines(count_for(step_a / a, End::Free, End::Free), End::Free, End::Free);
    let vs = lines(count_for(step_b / b, End::Free, End::Free), End::Free, End::Free);
    let mut work = Patchwork::default();
    work.grid(&us, &vs, |u, v| Vec3::new(a * (u - 0.5), b * (v - 0.5), 0.0));
    thicken(work.finish(), thickness, step_a.max(step_b))
}

pub(super) fn block(size: [f64; 3], fineness: f64) -> Triangulation {
    let [a, b, c] = size;
    // One step per direction, so that faces meet line on line.
    let mean = ((a * b + b * c + c * a) / 3.0).sqrt() / (7.0 * fineness);
    let line = |side: f64| {
        let others = mean * (side / mean / (7.0 * fineness)).powf(0.25).clamp(0.5, 2.0);
        lines(count_for((others / side).min(0.5), End::Corner, End::Corner), End::Corner, End::Corner)
    };
    let (us, vs, ws) = (line(a), line(b), line(c));
    let at = |u: f64, v: f64, w: f64| Vec3::new(a * (u - 0.5), b * (v - 0.5), c * (w - 0.5));
    let mut work = Patchwork::default();
    work.grid(&us, &vs, |u, v| at(u, v, 1.0));
    work.grid(&vs, &us, |v, u| at(u, v, 0.0));
    work.grid(&vs, &ws, |v, w| at(1.0, v, w));
    work.grid(&ws, &vs, |w, v| at(0.0, v, w));
    work.grid(&ws, &us, |w, u| at(u, 1.0, w));
    work.grid(&us, &ws, |u, w| at(u, 0.0, w));
    work.finish()
}
