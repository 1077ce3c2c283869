//! The patches of each shape.

use std::f64::consts::{FRAC_PI_4, TAU};

use super::{Patch, PatchForm, Path, Side};
use crate::lattice::{hole_lattice, hole_spans, holes_along};
use crate::profile::{Curve, Profile, Revolved, revolved};
use crate::{GridPattern, Hole, Outline, Shape, Vec3};

/// Sectors of a surface of revolution.
const SECTORS: usize = 4;

/// The patches of a shape in its local frame, or `None` for shapes that have none yet: imported meshes, bent and woven wires,
/// perforated discs, honeycombs.
pub fn patches(shape: &Shape) -> Option<Vec<Patch>> {
    if let Some(bodies) = revolved(shape) {
        // A wire of a grid has charge that repeats with the wires across it.
        let longest = match *shape {
            Shape::GridPlate { pitch, .. } => pitch,
            _ => f64::INFINITY,
        };
        return Some(bodies.iter().flat_map(|body| turned(body, longest)).collect());
    }
    match *shape {
        Shape::Plate { size: [a, b], thickness } => {
            let faces = [([-0.5 * a, 0.5 * a], [-0.5 * b, 0.5 * b])];
            Some(plate(&faces, &|_| [true; 4], thickness))
        }
        Shape::Box { size: [a, b, c] } => {
            let face = [([-0.5 * a, 0.5 * a], [-0.5 * b, 0.5 * b])];
            Some(plate(&face, &|_| [true; 4], c))
        }
        Shape::GridPlate { outline: Outline::Rectangle(size), pitch, pattern } => match pattern {
            GridPattern::Perforated { hole: hole @ (Hole::Square | Hole::Slot), open, thickness } => {
                Some(rectangular_holes(size, pitch, hole, open, thickness))
            }
            GridPattern::Perforated { hole: Hole::Round, open, thickness } => {
                Some(round_holes(size, pitch, open, thickness))
            }
            _ => None,
        },
        _ => None,
    }
}

/// Patches of a body, straight curves cut into pieces of about `longest`, in m.
fn turned(body: &Revolved, longest: f64) -> Vec<Patch> {
    let Revolved { profile, center, frame } = body;
    let side = |profile: &Profile, k: usize| Side::of(profile.joint(k));
    let mut all = Vec::new();
    for (k, curve) in profile.curves.iter().enumerate() {
        // Sides in order: a profile leaves the outside on its left, and azimuth runs so that ∂u × ∂v points there.
        let ends = [side(profile, k), side(profile, k + 1)];
        let pieces = cut(*curve, longest);
        for (number, curve) in pieces.iter().enumerate() {
            let inner = |is_end: bool, end: Side| if is_end { end } else { Side::Smooth };
            let (first, last) = (inner(number == 0, ends[0]), inner(number + 1 == pieces.len(), ends[1]));
            let sides = [first, last, Side::Smooth, Side::Smooth];
            for sector in 0..SECTORS {
                let angle = |s: usize| TAU * s as f64 / SECTORS as f64;
                let form = PatchForm::Revolved {
                    curve: *curve,
                    center: *center,
                    frame: *frame,
                    from: angle(sector),
                    to: angle(sector + 1),
                };
                all.push(Patch { form, sides });
            }
        }
    }
    all
}

/// Pieces of a straight line of about that length; other curves stay whole.
fn cut(curve: Curve, longest: f64) -> Vec<Curve> {
    let Curve::Line { from, to } = curve else { return vec![curve] };
    let count = (curve.length() / longest).round().max(1.0) as usize;
    // Measured from the nearer end, so that pieces are mirror images of each other.
    let at = |k: usize| {
        let (start, end, s) = if 2 * k <= count { (from, to, k) } else { (to, from, count - k) };
        [0, 1].map(|i| start[i] + (end[i] - start[i]) * s as f64 / count as f64)
    };
    (0..count).map(|k| Curve::Line { from: at(k), to: at(k + 1) }).collect()
}

/// A range along x and one along y, m.
type Rectangle = ([f64; 2], [f64; 2]);

/// A flat quadrilateral between two lines.
fn flat(corners: [Vec3; 4], sides: [Side; 4]) -> Patch {
    let [a, b, c, d] = corners;
    // u from line a-d to line b-c, v along them.
    Patch {
        form: PatchForm::Ruled { first: Path::Line { from: a, to: d }, last: Path::Line { from: b, to: c } },
        sides,
    }
}

/// Rectangles in the plane z = 0 made a sheet, or a plate of some thickness with walls along their bare edges. `bare` tells
/// which sides (left, right, lower, upper) of a rectangle have no neighbour.
fn plate(faces: &[Rectangle], bare: &dyn Fn(usize) -> [bool; 4], thickness: f64) -> Vec<Patch> {
    let mut all = Vec::new();
    let edge = if thickness > 0.0 { Side::CORNER } else { Side::FREE };
    let h = 0.5 * thickness;
    for (k, &([x0, x1], [y0, y1])) in faces.iter().enumerate() {
        let bare = bare(k);
        let sides = bare.map(|bare| if bare { edge } else { Side::Smooth });
        let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        all.push(flat([at(x0, y0, h), at(x1, y0, h), at(x1, y1, h), at(x0, y1, h)], sides));
        if thickness == 0.0 {
            continue;
        }
        // Seen from below, left and right change places.
        let mirrored = [sides[1], sides[0], sides[2], sides[3]];
        all.push(flat([at(x1, y0, -h), at(x0, y0, -h), at(x0, y1, -h), at(x1, y1, -h)], mirrored));
        // Walls: along the edge with the outside on the right, u from the lower rim to the upper.
        let corners = [[x0, y1, x0, y0], [x1, y0, x1, y1], [x0, y0, x1, y0], [x1, y1, x0, y1]];
        // What the ends of each wall are: sides before and after it, going round.
        let ends = [[3, 2], [2, 3], [0, 1], [1, 0]];
        for side in 0..4 {
            if !bare[side] {
                continue;
            }
            let [ax, ay, bx, by] = corners[side];
            let end = |k: usize| if bare[ends[side][k]] { Side::CORNER } else { Side::Smooth };
            all.push(flat(
                [at(ax, ay, h), at(ax, ay, -h), at(bx, by, -h), at(bx, by, h)],
                [Side::CORNER, Side::CORNER, end(0), end(1)],
            ));
        }
    }
    all
}

/// Square holes or slots on a rectangle: the rectangles between the lines of all holes' edges, those along a slot cut into pieces of
/// about a pitch.
fn rectangular_holes(size: [f64; 2], pitch: f64, hole: Hole, open: f64, thickness: f64) -> Vec<Patch> {
    let [across, along] = hole_spans(size, pitch, hole, open);
    // Lines, and which of the gaps between them are those of holes.
    let lines = |side: f64, spans: &[[f64; 2]]| -> (Vec<f64>, Vec<bool>) {
        let (mut lines, mut open) = (vec![-0.5 * side], Vec::new());
        for [from, to] in spans {
            let pieces = ((to - from) / pitch).ceil();
            lines.push(*from);
            open.push(false);
            for k in 1..=pieces as usize {
                // Ends as they are, and what stands between them symmetric to the last bit.
                let (k, rest) = (k as f64, pieces - k as f64);
                lines.push((from * rest + to * k) / pieces);
                open.push(true);
            }
        }
        lines.push(0.5 * side);
        open.push(false);
        (lines, open)
    };
    let ((xs, open_x), (ys, open_y)) = (lines(size[0], &across), lines(size[1], &along));
    let metal = |i: i64, j: i64| {
        let inside = i >= 0 && j >= 0 && i < open_x.len() as i64 && j < open_y.len() as i64;
        inside && !(open_x[i as usize] && open_y[j as usize])
    };
    let (mut faces, mut bare) = (Vec::new(), Vec::new());
    for i in 0..xs.len() as i64 - 1 {
        for j in 0..ys.len() as i64 - 1 {
            if metal(i, j) {
                let (k, l) = (i as usize, j as usize);
                faces.push(([xs[k], xs[k + 1]], [ys[l], ys[l + 1]]));
                bare.push([!metal(i - 1, j), !metal(i + 1, j), !metal(i, j - 1), !metal(i, j + 1)]);
            }
        }
    }
    plate(&faces, &|k| bare[k], thickness)
}

/// Round holes on a rectangle: four patches between each hole and its cell, and a frame around all cells.
fn round_holes([a, b]: [f64; 2], pitch: f64, open: f64, thickness: f64) -> Vec<Patch> {
    let (n, m) = (holes_along(a, pitch), holes_along(b, pitch));
    let (x, y) = (0.5 * n as f64 * pitch, 0.5 * m as f64 * pitch);
    let (left, low) = (0.5 * a - x, 0.5 * b - y);
    let none = 1e-9 * pitch;
    let has = [left > none, low > none];
    let mut faces: Vec<Rectangle> = Vec::new();
    let mut bare = Vec::new();
    // The frame: bands of one pitch each, so that what faces a hole is as large as it, and corners.
    let (xs, ys) = ([-0.5 * a, -x, x, 0.5 * a], [-0.5 * b, -y, y, 0.5 * b]);
    for i in 0..3 {
        for j in 0..3 {
            if (i == 1 && j == 1) || (i != 1 && !has[0]) || (j != 1 && !has[1]) {
                continue;
            }
            let cut = |k: usize, lines: &[f64; 4], count: usize| -> Vec<[f64; 2]> {
                if k != 1 {
                    return vec![[lines[k], lines[k + 1]]];
                }
                let at = |s: usize| lines[1] + (lines[2] - lines[1]) * s as f64 / count as f64;
                (0..count).map(|s| [at(s), at(s + 1)]).collect()
            };
            for along in cut(i, &xs, n) {
                for up in cut(j, &ys, m) {
                    faces.push((along, up));
                    let rim = |at: f64, half: f64| (at.abs() - half).abs() < none;
                    bare.push([rim(along[0], xs[3]), rim(along[1], xs[3]), rim(up[0], ys[3]), rim(up[1], ys[3])]);
                }
            }
        }
    }
    let mut all = plate(&faces, &|k| bare[k], thickness);
    let edge = if thickness > 0.0 { Side::CORNER } else { Side::FREE };
    let (h, r) = (0.5 * thickness, 0.5 * open);
    let lattice = hole_lattice(Outline::Rectangle([a, b]), pitch, Hole::Round);
    for (number, [cx, cy]) in lattice.into_iter().enumerate() {
        let (i, j) = (number / m, number % m);
        let outermost = [i == 0 && !has[0], i + 1 == n && !has[0], j == 0 && !has[1], j + 1 == m && !has[1]];
        for quarter in 0..4 {
            // Towards +x, +y, -x, -y.
            let (sin, cos) = (TAU * quarter as f64 / 4.0).sin_cos();
            let (ex, ey) = (Vec3::new(cos.round(), sin.round(), 0.0), Vec3::new(-sin.round(), cos.round(), 0.0));
            let is_bare = outermost[[1, 3, 0, 2][quarter]];
            let arc = |z: f64, reversed: bool| {
                let center = Vec3::new(cx, cy, z);
                let (from, to) = if reversed { (FRAC_PI_4, -FRAC_PI_4) } else { (-FRAC_PI_4, FRAC_PI_4) };
                Path::Arc { center, cosine: ex * r, sine: ey * r, from, to }
            };
            let cell = |z: f64, reversed: bool| {
                let center = Vec3::new(cx, cy, z) + ex * (0.5 * pitch);
                let half = ey * if reversed { -0.5 * pitch } else { 0.5 * pitch };
                Path::Line { from: center - half, to: center + half }
            };
            let outer = if is_bare { edge } else { Side::Smooth };
            let sides = [edge, outer, Side::Smooth, Side::Smooth];
            all.push(Patch { form: PatchForm::Ruled { first: arc(h, false), last: cell(h, false) }, sides });
            if thickness > 0.0 {
                all.push(Patch { form: PatchForm::Ruled { first: arc(-h, true), last: cell(-h, true) }, sides });
                let walls = [Side::CORNER, Side::CORNER, Side::Smooth, Side::Smooth];
                // The hole's wall looks to its centre.
                all.push(Patch { form: PatchForm::Ruled { first: arc(-h, false), last: arc(h, false) }, sides: walls });
                if is_bare {
                    all.push(Patch {
                        form: PatchForm::Ruled { first: cell(h, false), last: cell(-h, false) },
                        sides: walls,
                    });
                }
            }
        }
    }
    all
}
