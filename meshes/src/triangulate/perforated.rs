//! Plates with holes: a lattice of cells that fit together, and a rim round them.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use super::Triangulation;
use super::flat::thicken;
use super::grading::{End, count_for, lines};
use super::patchwork::Patchwork;
use super::planar::{Loop, fill, winding};
use crate::lattice::{hole_lattice, hole_spans, holes_along, slot_half_length};
use crate::{Hole, Outline, ShapeError, Vec3};

/// How finely one cell is meshed.
struct Fineness {
    /// Panels along a side of a hole.
    along: usize,
    /// Panels across half a bar.
    across: usize,
}

pub(super) fn plate(
    outline: Outline,
    pitch: f64,
    hole: Hole,
    open: f64,
    thickness: f64,
    fineness: f64,
) -> Result<Triangulation, ShapeError> {
    let along = ((3.0 * fineness).round() as usize).max(2);
    // Bars narrower than the holes need fewer panels across, never less than one for each half.
    let bar = 0.5 * (pitch - open);
    let step = open / along as f64;
    let across =
        count_for((step / bar).min(1.0), End::Smooth, End::Free).max(((2.0 * fineness).round() as usize).max(1));
    let fine = Fineness { along, across };
    let width = step.max(bar);
    let sheet = match (outline, hole) {
        (Outline::Rectangle(size), Hole::Square | Hole::Slot) => {
            rectangular_in_rectangle(size, pitch, hole, open, &fine)
        }
        (Outline::Rectangle(size), Hole::Round) => round_in_rectangle(size, pitch, open, &fine),
        _ => {
            let mut work = Patchwork::default();
            for center in hole_lattice(outline, pitch, hole) {
                if hole == Hole::Slot {
                    slot(&mut work, center, slot_half_length(outline, pitch, open, center[0]), pitch, open, &fine);
                } else {
                    cell(&mut work, center, hole, pitch, open, &fine);
                }
            }
            with_rim(work.finish(), outline, 0.5 * (pitch - open), width)?
        }
    };
    Ok(thicken(sheet, thickness, width))
}

/// Square holes or slots in a rectangle: one grid of lines, left out where a hole is.
fn rectangular_in_rectangle(size: [f64; 2], pitch: f64, hole: Hole, open: f64, fine: &Fineness) -> Triangulation {
    let [across, along] = hole_spans(size, pitch, hole, open);
    // Along each direction: alternating bars and holes, the outermost bars as wide as what is left.
    let spans = |side: f64, holes: &[[f64; 2]]| {
        let first = holes[0][0] + 0.5 * side;
        let mut marks = vec![0.0];
        let mut is_hole = Vec::new();
        let mut at = -0.5 * side;
        let mut add = |length: f64, n: usize, hole: bool, marks: &mut Vec<f64>| {
            let ends = if hole { (End::Smooth, End::Smooth) } else { (End::Free, End::Free) };
            for t in lines(n, ends.0, ends.1) {
                if t == 0.0 {
                    marks.pop();
                }
                marks.push(at + length * t);
            }
            is_hole.extend(std::iter::repeat_n(hole, n));
            at += length;
        };
        // A border wider than a bar gets more lines, of the same width as the holes'.
        let border =
            (2 * fine.across).max(count_for((open / fine.along as f64 / first).min(1.0), End::Free, End::Free));
        add(first, border, false, &mut marks);
        for (h, [from, to]) in holes.iter().enumerate() {
            // A slot is some pitches long.
            add(to - from, fine.along * ((to - from) / pitch).ceil() as usize, true, &mut marks);
            let last = h + 1 == holes.len();
            add(
                if last { first } else { pitch - open },
                if last { border } else { 2 * fine.across },
                false,
                &mut marks,
            );
        }
        (marks, is_hole)
    };
    let ((xs, hole_x), (ys, hole_y)) = (spans(size[0], &across), spans(size[1], &along));
    let mut work = Patchwork::default();
    let number: Vec<Vec<u32>> =
        xs.iter().map(|&x| ys.iter().map(|&y| work.vertex(Vec3::new(x, y, 0.0))).collect()).collect();
    for i in 0..hole_x.len() {
        for j in 0..hole_y.len() {
            if !(hole_x[i] && hole_y[j]) {
                let corners = [number[i][j], number[i + 1][j], number[i + 1][j + 1], number[i][j + 1]];
                work.quad(corners, (2 * i < hole_x.len()) == (2 * j < hole_y.len()));
            }
        }
    }
    work.finish()
}

/// Round holes in a rectangle: square cells, and a border of the lines that run between them.
fn round_in_rectangle(size: [f64; 2], pitch: f64, open: f64, fine: &Fineness) -> Triangulation {
    let mut work = Patchwork::default();
    for center in hole_lattice(Outline::Rectangle(size), pitch, Hole::Round) {
        cell(&mut work, center, Hole::Round, pitch, open, fine);
    }
    // Lines along one direction, and which of the gaps between them lie within the cells.
    let spans = |side: f64| {
        let inner = holes_along(side, pitch) as f64 * pitch;
        let border = 0.5 * (side - inner);
        let n = holes_along(side, pitch) * fine.along;
        let mut marks: Vec<f64> = lines(n, End::Smooth, End::Smooth).iter().map(|t| inner * (t - 0.5)).collect();
        let mut in_cells = vec![true; n];
        if border > 1e-9 * side {
            let m = count_for((pitch / fine.along as f64 / border).min(1.0), End::Free, End::Smooth).max(2);
            let depth = lines(m, End::Free, End::Smooth);
            let left = depth[..m].iter().map(|t| border * t - 0.5 * side);
            let right = depth[..m].iter().rev().map(|t| 0.5 * side - border * t);
            marks = left.chain(marks).chain(right).collect();
            in_cells = [vec![false; m], in_cells, vec![false; m]].concat();
        }
        (marks, in_cells)
    };
    let ((xs, in_x), (ys, in_y)) = (spans(size[0]), spans(size[1]));
    let number: Vec<Vec<u32>> =
        xs.iter().map(|&x| ys.iter().map(|&y| work.vertex(Vec3::new(x, y, 0.0))).collect()).collect();
    for i in 0..in_x.len() {
        for j in 0..in_y.len() {
            if !(in_x[i] && in_y[j]) {
                let corners = [number[i][j], number[i + 1][j], number[i + 1][j + 1], number[i][j + 1]];
                work.quad(corners, (2 * i < in_x.len()) == (2 * j < in_y.len()));
            }
        }
    }
    work.finish()
}

/// One cell: the region between the hole and the cell's own outline, a square or a hexagon.
fn cell(work: &mut Patchwork, center: [f64; 2], hole: Hole, pitch: f64, open: f64, fine: &Fineness) {
    let sides = if hole == Hole::Hexagonal { 6 } else { 4 };
    // Corners of a regular polygon of width `w` across flats; a hexagon has one of its flats facing +x, as a square has.
    let corner = |w: f64, k: usize| {
        let angle = TAU * (k as f64 - 0.5) / sides as f64;
        let r = 0.5 * w / (PI / sides as f64).cos();
        [r * angle.cos(), r * angle.sin()]
    };
    let on_polygon = |w: f64, k: usize, s: f64| {
        let (a, b) = (corner(w, k), corner(w, k + 1));
        [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
    };
    // A circle as a polygon of the same area, so that the plate has the true open fraction.
    let segments = sides * fine.along;
    let round = {
        let step = TAU / segments as f64;
        0.5 * open * (step / step.sin()).sqrt()
    };
    let depth = lines(fine.across, End::Free, End::Smooth);
    let along: Vec<f64> = lines(fine.along, End::Smooth, End::Smooth);
    for k in 0..sides {
        // ∂u × ∂v along +z: u outwards, v counter-clockwise.
        work.grid(&depth, &along, |u, v| {
            let inner = match hole {
                Hole::Round => {
                    let angle = TAU * (k as f64 - 0.5 + v) / sides as f64;
                    [round * angle.cos(), round * angle.sin()]
                }
                _ => on_polygon(open, k, v),
            };
            let outer = on_polygon(pitch, k, v);
            let mix = |i: usize| center[i] + inner[i] * (1.0 - u) + outer[i] * u;
            Vec3::new(mix(0), mix(1), 0.0)
        });
    }
}

/// One slot: the half of its bars that is nearer to it, on all four sides. Slots of a disc differ in length, so that what is left
/// between them fits no pattern.
fn slot(work: &mut Patchwork, center: [f64; 2], half: f64, pitch: f64, open: f64, fine: &Fineness) {
    let margin = 0.25 * (pitch - open);
    let depth: Vec<f64> = lines(fine.across, End::Free, End::Smooth);
    let corner = |k: usize, by: f64| {
        let (x, y) = (0.5 * open + by, half + by);
        [[x, -y], [x, y], [-x, y], [-x, -y]][k % 4]
    };
    let long = fine.along * (2.0 * half / pitch).ceil().max(1.0) as usize;
    for k in 0..4 {
        let along = lines(if k % 2 == 0 { long } else { fine.along }, End::Smooth, End::Smooth);
        work.grid(&depth, &along, |u, v| {
            let (a, b) = (corner(k, u * margin), corner(k + 1, u * margin));
            let mix = |i: usize| center[i] + a[i] * (1.0 - v) + b[i] * v;
            Vec3::new(mix(0), mix(1), 0.0)
        });
    }
}

/// Open edges of a flat sheet, joined to loops.
fn loops(sheet: &Triangulation) -> Vec<Vec<u32>> {
    let edges = sheet.open_edges();
    let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
    for [a, b] in edges.iter().rev() {
        next.entry(*a).or_default().push(*b);
    }
    let mut found = Vec::new();
    for [start, _] in edges {
        let mut curve = Vec::new();
        let mut at = start;
        while let Some(b) = next.get_mut(&at).and_then(Vec::pop) {
            curve.push(at);
            at = b;
        }
        if !curve.is_empty() {
            found.push(curve);
        }
    }
    found
}

/// Adds the solid rim between a lattice of cells and the outline of the plate. `margin` is half a bar.
fn with_rim(cells: Triangulation, outline: Outline, margin: f64, width: f64) -> Result<Triangulation, ShapeError> {
    let point = |v: u32| {
        let p = cells.vertices[v as usize];
        [p.x, p.y]
    };
    let outer: Vec<Loop> = loops(&cells)
        .into_iter()
        .map(|curve| curve.into_iter().map(point).collect::<Loop>())
        .filter(|curve| winding(curve) > 0.0)
        .collect();
    let reach = |p: &[f64; 2]| match outline {
        Outline::Disc(radius) => radius - p[0].hypot(p[1]),
        Outline::Rectangle([a, b]) => (0.5 * a - p[0].abs()).min(0.5 * b - p[1].abs()),
    };
    let room = outer.iter().flatten().map(reach).fold(f64::INFINITY, f64::min);
    let mut work = Patchwork::default();
    let base: Vec<u32> = cells.vertices.iter().map(|v| work.vertex(*v)).collect();
    for t in &cells.triangles {
        let [a, b, c] = t.map(|v| base[v as usize]);
        work.triangle(a, b, c);
    }
    if room < 1e-6 * margin {
        // The cells reach the outline exactly: there is no rim.
        return Ok(work.finish());
    }
    // Rows along the outline, closer together towards the edge, over half of the room there is.
    let depth = 0.5 * room.min(2.0 * width);
    let rows: Vec<f64> = lines(3, End::Free, End::Smooth).iter().map(|t| depth * t).collect();
    let rim_row = |inset: f64| -> Loop {
        match outline {
            Outline::Disc(radius) => {
                let n = 8 * ((TAU * radius / width / 8.0).ceil() as usize).max(2);
                // A polygon of the disc's area.
                let step = TAU / n as f64;
                let r = (radius - inset) * (step / step.sin()).sqrt();
                (0..n).map(|k| (TAU * k as f64 / n as f64).sin_cos()).map(|(s, c)| [r * c, r * s]).collect()
            }
            Outline::Rectangle([a, b]) => {
                let (x, y) = (0.5 * a - inset, 0.5 * b - inset);
                let corners = [[x, -y], [x, y], [-x, y], [-x, -y]];
                (0..4)
                    .flat_map(|k| {
                        let (p, q) = (corners[k], corners[(k + 1) % 4]);
                        let n = ((if k % 2 == 0 { b } else { a }) / width).ceil().max(2.0) as usize;
                        (0..n).map(move |i| {
                            let t = i as f64 / n as f64;
                            [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]
                        })
                    })
                    .collect()
            }
        }
    };
    for pair in rows.windows(2) {
        let numbers = |work: &mut Patchwork, row: Loop| -> Vec<u32> {
            row.iter().map(|p| work.vertex(Vec3::new(p[0], p[1], 0.0))).collect()
        };
        let (out, inner) = (numbers(&mut work, rim_row(pair[0])), numbers(&mut work, rim_row(pair[1])));
        for k in 0..out.len() {
            let l = (k + 1) % out.len();
            work.quad([inner[k], out[k], out[l], inner[l]], k % 2 == 0);
        }
    }
    let mut borders = vec![rim_row(depth)];
    borders.extend(outer);
    let (vertices, triangles) = fill(&borders, 0.5 * width * width)?;
    let base: Vec<u32> = vertices.into_iter().map(|v| work.vertex(v)).collect();
    for t in triangles {
        let [a, b, c] = t.map(|v| base[v as usize]);
        work.triangle(a, b, c);
    }
    Ok(work.finish())
}
