//! How deep the well about a minimum is: the height at which it first opens, and where.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use meshes::Vec3;

use super::critical::{Lattice, polish};
use super::{Effective, Kind, Space};
use crate::Samples;

/// Where a well opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Opening {
    /// Over a saddle into the open or into another well.
    Pass,
    /// On the surface of this electrode.
    Wall(usize),
    /// On the edge of the box that was searched: beyond it the well may be deeper.
    Edge,
}

/// A well.
#[derive(Clone, Copy, Debug)]
pub struct Well {
    /// Of the effective potential above its minimum.
    pub depth: f64,
    /// Where it opens.
    pub opening: Opening,
    /// The same place, m.
    pub point: Vec3,
    /// Beside it on the side of the well, m: where the surface itself is met when panels only show it.
    pub beside: Vec3,
    /// Estimated error of the depth.
    pub error: f64,
}

/// Surfaces: the electrode that a segment meets first, and where (m).
pub type Walls<'a> = dyn Fn(&Vec3, &Vec3) -> Option<(Vec3, usize)> + Sync + 'a;

/// The well about a minimum: the lattice is flooded from there, lowest nodes first, until the water meets a surface, the edge
/// of the box, a node below the minimum, or one of the `others` (further minima). A pass that was met on the way is found again
/// by Newton's method in the exact field, a wall by going down along the surface.
///
/// `floor` is the value at the minimum. `None` where no node of the lattice has room near it.
pub fn well(
    space: &Space,
    effective: &Effective,
    (lattice, values): (&Lattice, &[f64]),
    minimum: (&Vec3, f64),
    others: &[Vec3],
    walls: &Walls,
) -> Option<Well> {
    let (minimum, floor) = minimum;
    let first = nearest(lattice, values, minimum)?;
    let beyond: Vec<usize> =
        others.iter().filter_map(|p| nearest(lattice, values, p)).filter(|n| *n != first).collect();
    let mut queue = BinaryHeap::new();
    let mut from = vec![usize::MAX; lattice.len()];
    from[first] = first;
    queue.push(Front { height: values[first], node: first, exit: None });
    let mut samples = Samples::default();
    let below = floor - 1e-6 * (values[first] - floor).abs().max(1e-3 * floor.abs());
    let step = lattice.step.min();
    let end = loop {
        let front = queue.pop()?;
        let node = front.node;
        if front.exit.is_some() || beyond.contains(&node) || values[node] < below {
            break front;
        }
        let here = lattice.place(node);
        for k in 0..3 {
            for by in [-1, 1] {
                let mut shift = [0; 3];
                shift[k] = by;
                let Some(next) = lattice.neighbour(node, shift) else {
                    queue.push(Front { height: front.height, node, exit: Some((Opening::Edge, here)) });
                    continue;
                };
                let there = lattice.place(next);
                if let Some((hit, electrode)) = walls(&here, &there) {
                    let value = beside(space, effective, &hit, &here, step, &mut samples);
                    let height = front.height.max(value);
                    queue.push(Front { height, node, exit: Some((Opening::Wall(electrode), hit)) });
                } else if from[next] == usize::MAX && values[next].is_finite() {
                    from[next] = node;
                    queue.push(Front { height: front.height.max(values[next]), node: next, exit: None });
                }
            }
        }
    };
    // The highest node on the way.
    let (mut top, mut node) = (end.node, end.node);
    while from[node] != node {
        node = from[node];
        if values[node] > values[top] {
            top = node;
        }
    }
    let coarse = lattice.step.norm();
    let pass = || {
        let point = polish(space, effective, &lattice.place(top), 3.0 * coarse)?;
        // A way over nodes cannot be lower than the pass, and is not much higher.
        let share = (point.value - floor) / (values[top] - floor);
        (point.kind == Kind::Pass && (0.3..1.001).contains(&share)).then_some(point)
    };
    let error_of = |depth: f64| 2.0 * space.error * depth;
    match end.exit {
        Some((Opening::Wall(electrode), hit)) if end.height > values[top] || top == end.node => {
            let (point, eye, value) = down(space, effective, &hit, &lattice.place(end.node), step, walls, &mut samples);
            let depth = value.max(values[top].min(end.height)) - floor;
            // What going along the surface changed, in part.
            let slack = 0.1 * (end.height - value).abs();
            let beside = eye;
            return Some(Well {
                depth,
                opening: Opening::Wall(electrode),
                point,
                beside,
                error: error_of(depth) + slack,
            });
        }
        Some((Opening::Edge, point)) if end.height <= values[top] && top == end.node => {
            let depth = end.height - floor;
            return Some(Well { depth, opening: Opening::Edge, point, beside: point, error: error_of(depth) });
        }
        _ => {}
    }
    Some(match pass() {
        Some(point) => {
            let depth = point.value - floor;
            Well {
                depth,
                opening: Opening::Pass,
                point: point.position,
                beside: point.position,
                error: error_of(depth),
            }
        }
        // The lattice is too coarse for Newton's method: what it says, to a cell.
        None => {
            let depth = end.height - floor;
            let point = lattice.place(top);
            Well { depth, opening: Opening::Pass, point, beside: point, error: error_of(depth) + 0.1 * depth }
        }
    })
}

/// The node with room that is nearest to a point, if there is one within two cells.
fn nearest(lattice: &Lattice, values: &[f64], point: &Vec3) -> Option<usize> {
    let index = |k: usize| ((point[k] - lattice.origin[k]) / lattice.step[k]).round();
    let clamped: [usize; 3] = std::array::from_fn(|k| index(k).clamp(0.0, lattice.counts[k] as f64 - 1.0) as usize);
    let center = clamped[0] + lattice.counts[0] * (clamped[1] + lattice.counts[1] * clamped[2]);
    let around = (-2..=2).flat_map(|a| (-2..=2).flat_map(move |b| (-2..=2).map(move |c| [a, b, c])));
    around
        .filter_map(|by| lattice.neighbour(center, by))
        .filter(|n| values[*n].is_finite())
        .min_by(|a, b| (lattice.place(*a) - point).norm().total_cmp(&(lattice.place(*b) - point).norm()))
        .filter(|n| (lattice.place(*n) - point).norm() < 2.0 * lattice.step.norm())
}

/// Distance from a panel, in cells, at which one is surely on its side of the surface that the panel shows: panels cut corners,
/// and behind a sheet the field is another one.
const BESIDE: f64 = 0.3;

/// The effective potential on a surface as it is from the side of a point: from three places on a straight line,
/// whose parabola is carried on.
fn beside(space: &Space, effective: &Effective, hit: &Vec3, from: &Vec3, step: f64, samples: &mut Samples) -> f64 {
    let away = (from - hit).try_normalize(0.0).unwrap_or_else(Vec3::zeros) * (BESIDE * step);
    let values = effective.values(space.field, &[hit + away, hit + away * 2.0, hit + away * 3.0], samples);
    3.0 * values[0] - 3.0 * values[1] + values[2]
}

/// From a place on a surface to the lowest one nearby, looking from the same side.
fn down(
    space: &Space,
    effective: &Effective,
    hit: &Vec3,
    from: &Vec3,
    step: f64,
    walls: &Walls,
    samples: &mut Samples,
) -> (Vec3, Vec3, f64) {
    let mut eye = *from;
    let mut best = (*hit, beside(space, effective, hit, from, step, samples));
    let mut size = step;
    while size > 1e-3 * step {
        let mut moved = false;
        for k in 0..3 {
            for sign in [-1.0, 1.0] {
                let shift = Vec3::ith(k, sign * size);
                let (eye_there, aim) = (eye + shift, best.0 + shift);
                let beyond = eye_there + (aim - eye_there) * 2.0;
                if walls(&eye, &eye_there).is_some() {
                    continue;
                }
                let Some((there, _)) = walls(&eye_there, &beyond) else { continue };
                let value = beside(space, effective, &there, &eye_there, step, samples);
                if value < best.1 {
                    best = (there, value);
                    eye = eye_there;
                    moved = true;
                }
            }
        }
        if !moved {
            size *= 0.5;
        }
    }
    let away = (eye - best.0).try_normalize(0.0).unwrap_or_else(Vec3::zeros) * (BESIDE * step);
    (best.0, best.0 + away, best.1)
}

/// The edge of the flood: the lowest first, and of equals the first node.
struct Front {
    height: f64,
    node: usize,
    exit: Option<(Opening, Vec3)>,
}

impl PartialEq for Front {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Front {}

impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        other.height.total_cmp(&self.height).then(other.node.cmp(&self.node))
    }
}

#[cfg(test)]
mod tests {
    use super::super::critical::{Search, values_on};
    use super::super::{Square, critical_points_on};
    use super::*;
    use crate::{Quadratic, QuadraticField};

    /// A well between two walls at z = ±0.7: D = q V/8 with the wall at the cap's place.
    #[test]
    fn a_well_ends_at_its_walls() {
        let field = QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0);
        let space = Space { field: &field, clearance: &|p| 0.7 - p.z.abs(), error: 0.0, size: 2.0 };
        let effective = Effective {
            statics: vec![0.0],
            slope: Vec3::zeros(),
            squares: vec![Square { strength: 0.25, pattern: vec![1.0] }],
        };
        let search = Search { min: Vec3::repeat(-1.6), max: Vec3::repeat(1.6), nodes: 20_000 };
        let lattice = search.lattice();
        let values = values_on(&space, &effective, &lattice);
        let walls = |a: &Vec3, b: &Vec3| {
            let side = if b.z > a.z { 0.7 } else { -0.7 };
            let part = (side - a.z) / (b.z - a.z);
            (0.0..=1.0).contains(&part).then(|| (a + (b - a) * part, 3))
        };
        let well = well(&space, &effective, (&lattice, &values), (&Vec3::zeros(), 0.0), &[], &walls).unwrap();
        assert_eq!(well.opening, Opening::Wall(3));
        // (4 z²)/4 at z = 0.7, on the axis; the lowest place is found to a thousandth of a cell, and the parabola is exact.
        assert!((well.depth - 0.49).abs() < 1e-4 && well.point.xy().norm() < 1e-2, "{well:?}");
    }

    /// A bowl has no pass: its well ends at the edge of the box. (It is no harmonic potential, which is not asked for.)
    #[test]
    fn a_bowl_ends_at_the_edge() {
        let bowl = Quadratic { hessian: nalgebra::Matrix3::identity(), ..Quadratic::default() };
        let field = QuadraticField { channels: vec![bowl] };
        let space = Space { field: &field, clearance: &|_| f64::INFINITY, error: 0.0, size: 2.0 };
        let effective = Effective::of_static(vec![1.0]);
        let search = Search { min: Vec3::repeat(-1.0), max: Vec3::repeat(1.0), nodes: 20_000 };
        let lattice = search.lattice();
        let values = values_on(&space, &effective, &lattice);
        let well = well(&space, &effective, (&lattice, &values), (&Vec3::zeros(), 0.0), &[], &|_, _| None).unwrap();
        assert_eq!(well.opening, Opening::Edge);
        assert!((well.depth - 0.5).abs() < 0.05, "{well:?}");
    }

    /// Charges of a triangle hold a charge of the same sign in the plane up to the passes towards the middles of its sides.
    #[test]
    fn a_well_opens_over_its_lowest_pass() {
        use super::super::expansion::tests::Charges;
        let places: Vec<Vec3> = (0..3)
            .map(|k| std::f64::consts::TAU * f64::from(k) / 3.0)
            .map(|a| Vec3::new(a.cos(), a.sin(), 0.0))
            .collect();
        let near = |p: &Vec3| places.iter().map(|c| (p - c).norm()).fold(f64::INFINITY, f64::min);
        let field = Charges(places.clone());
        let space = Space { field: &field, clearance: &near, error: 0.0, size: 1.0 };
        // The square of the field vanishes at all four nulls: four wells, and passes between the middle and the others.
        let squares = vec![Square { strength: 1.0, pattern: vec![1.0; 3] }];
        let effective = Effective { statics: vec![0.0; 3], slope: Vec3::zeros(), squares };
        let search = Search { min: Vec3::repeat(-0.8), max: Vec3::repeat(0.8), nodes: 60_000 };
        let lattice = search.lattice();
        let values = values_on(&space, &effective, &lattice);
        let all = critical_points_on(&space, &effective, &lattice, &values);
        let minima: Vec<Vec3> = all.iter().filter(|c| c.kind == Kind::Minimum).map(|c| c.position).collect();
        assert_eq!(minima.len(), 4, "{all:#?}");
        let well =
            well(&space, &effective, (&lattice, &values), (&minima[0], 0.0), &minima[1..], &|_, _| None).unwrap();
        assert_eq!(well.opening, Opening::Pass);
        let pass = all.iter().filter(|c| c.kind == Kind::Pass).map(|c| c.value).fold(f64::INFINITY, f64::min);
        assert!((well.depth / pass - 1.0).abs() < 1e-9, "{well:?} {pass}");
    }
}
