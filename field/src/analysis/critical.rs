//! Where the gradient of an effective potential vanishes: found on a grid, then by Newton's method in the exact field.

use meshes::Vec3;
use nalgebra::SymmetricEigen;

use super::{Effective, Expansion, Local, Space};
use crate::Samples;

/// What an effective potential does about a critical point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Rises in all directions.
    Minimum,
    /// Falls along one axis.
    Pass,
    /// Falls along two.
    Ridge,
    /// Falls in all directions.
    Maximum,
}

impl Kind {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Minimum => "minimum",
            Self::Pass => "saddle, falls along one axis",
            Self::Ridge => "saddle, falls along two axes",
            Self::Maximum => "maximum",
        }
    }
}

/// A point at which no mean force acts.
#[derive(Clone, Copy, Debug)]
pub struct CriticalPoint {
    /// m.
    pub position: Vec3,
    /// Of the effective potential.
    pub value: f64,
    /// What it does about the point, directions in which it is flat left out.
    pub kind: Kind,
    /// Second derivatives along the axes, largest first, 1/m² of the effective potential.
    pub curvatures: [f64; 3],
    /// Principal axes, of length one.
    pub axes: [Vec3; 3],
    /// Estimated error of the position, m: what the error of the field does, and where Newton's method stopped.
    pub position_error: f64,
    /// Estimated error of the curvatures.
    pub curvature_error: f64,
    /// The potential is flat along at least one axis: the point is one of a line or a ring of such points.
    pub flat: bool,
}

/// Where to look, and how closely.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Lower corner, m.
    pub min: Vec3,
    /// Upper corner, m.
    pub max: Vec3,
    /// About how many nodes. Points that are closer together than two cells, or to a surface than
    /// one, may be missed.
    pub nodes: usize,
}

/// The nodes of a search.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Along each axis.
    pub counts: [usize; 3],
    /// Edges of a cell, m.
    pub step: Vec3,
    /// The first node, m.
    pub origin: Vec3,
}

impl Search {
    /// Its nodes: beside planes of symmetry, on which a gradient has no sign.
    pub fn lattice(&self) -> Lattice {
        let size = self.max - self.min;
        let edge = (size.product() / self.nodes as f64).cbrt();
        let counts: [usize; 3] = std::array::from_fn(|k| ((size[k] / edge).round() as usize).clamp(6, 400));
        // A golden fraction of a cell on one side: no node is in the middle.
        let step = Vec3::from_fn(|k, _| size[k] / (counts[k] as f64 - 0.618));
        Lattice { counts, step, origin: self.min - step * 0.191 }
    }
}

impl Lattice {
    /// How many nodes.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The indices of a node.
    pub fn indices(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Where it is, m.
    pub fn place(&self, node: usize) -> Vec3 {
        let at = self.indices(node);
        self.origin + Vec3::from_fn(|k, _| at[k] as f64 * self.step[k])
    }

    /// The node so many steps further, if there is one.
    pub fn neighbour(&self, node: usize, by: [isize; 3]) -> Option<usize> {
        let at = self.indices(node);
        let mut to = [0; 3];
        for k in 0..3 {
            to[k] = at[k].checked_add_signed(by[k]).filter(|i| *i < self.counts[k])?;
        }
        Some(to[0] + self.counts[0] * (to[1] + self.counts[1] * to[2]))
    }
}

/// Nodes that have less room than this fraction of a cell are left out.
const CLOSE: f64 = 0.05;

/// Nor is anything looked for nearer to a surface than this part of a cell: what the lattice cannot resolve.
const NEAREST: f64 = 0.7;

/// Starts of Newton's method, at most: the field is asked for at some thousand points for each.
const MOST: usize = 150;

/// Balls in which Newton's method goes on, at most: points that it finds take four or five.
const ROUNDS: usize = 12;

/// A curvature below this fraction of the largest counts as none.
pub const FLAT: f64 = 1e-6;

/// Values of an effective potential on a lattice; not a number where there is no room.
pub fn values_on(space: &Space, effective: &Effective, lattice: &Lattice) -> Vec<f64> {
    use rayon::prelude::*;
    const CHUNK: usize = 512;
    let nodes: Vec<usize> = (0..lattice.len()).collect();
    let closest = CLOSE * lattice.step.min();
    let parts: Vec<Vec<f64>> = nodes
        .par_chunks(CHUNK)
        .map(|nodes| {
            let points: Vec<Vec3> = nodes.iter().map(|n| lattice.place(*n)).collect();
            let mut values = effective.values(space.field, &points, &mut Samples::default());
            for (value, point) in values.iter_mut().zip(&points) {
                if (space.clearance)(point) <= closest {
                    *value = f64::NAN;
                }
            }
            values
        })
        .collect();
    parts.concat()
}

/// All critical points in a box, the ones nearest to its middle first. Along lines and rings of such points one stands for all.
pub fn critical_points(space: &Space, effective: &Effective, search: &Search) -> Vec<CriticalPoint> {
    let lattice = search.lattice();
    critical_points_on(space, effective, &lattice, &values_on(space, effective, &lattice))
}

/// As [`critical_points`], with the values on the lattice at hand.
pub fn critical_points_on(
    space: &Space,
    effective: &Effective,
    lattice: &Lattice,
    values: &[f64],
) -> Vec<CriticalPoint> {
    use rayon::prelude::*;
    if effective.is_zero() {
        return Vec::new();
    }
    let mut starts = starts(lattice, values);
    starts.retain(|start| (space.clearance)(start) > NEAREST * lattice.step.min());
    let far = lattice.origin + Vec3::from_fn(|k, _| (lattice.counts[k] - 1) as f64 * lattice.step[k]);
    let within = |p: &Vec3| (0..3).all(|k| p[k] >= lattice.origin[k] && p[k] <= far[k]);
    let reach = 4.0 * lattice.step.norm();
    let polished: Vec<Option<CriticalPoint>> =
        starts.par_iter().map(|start| polish(space, effective, start, reach).filter(|c| within(&c.position))).collect();
    let middle = (lattice.origin + far) * 0.5;
    let mut found: Vec<CriticalPoint> = Vec::new();
    let mut all: Vec<CriticalPoint> = polished.into_iter().flatten().collect();
    all.sort_by(|a, b| (a.position - middle).norm().total_cmp(&(b.position - middle).norm()));
    let apart = 0.02 * lattice.step.min();
    let range = values
        .iter()
        .filter(|v| v.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(*v), hi.max(*v)]);
    for point in all {
        let same = found.iter().any(|other| {
            let ring = point.flat && other.flat && (point.value - other.value).abs() < 1e-6 * (range[1] - range[0]);
            (point.position - other.position).norm() < apart.max(2.0 * point.position_error.min(lattice.step.min()))
                || ring
        });
        if !same {
            found.push(point);
        }
    }
    found
}

/// Nodes about which the gradient may vanish: all its components change sign among the neighbours. Of each neighbourhood the one
/// with the smallest gradient.
fn starts(lattice: &Lattice, values: &[f64]) -> Vec<Vec3> {
    let unit = |k: usize, by: isize| -> [isize; 3] { std::array::from_fn(|j| if j == k { by } else { 0 }) };
    let gradient: Vec<Option<Vec3>> = (0..lattice.len())
        .map(|node| {
            let mut slope = Vec3::zeros();
            for k in 0..3 {
                let value = |by| {
                    let neighbour = lattice.neighbour(node, unit(k, by))?;
                    Some(values[neighbour]).filter(|v| v.is_finite())
                };
                slope[k] = match (value(-1), value(1)) {
                    (Some(a), Some(b)) => (b - a) / (2.0 * lattice.step[k]),
                    (Some(a), None) => (values[node] - a) / lattice.step[k],
                    (None, Some(b)) => (b - values[node]) / lattice.step[k],
                    (None, None) => return None,
                };
            }
            Some(slope).filter(|s| s.iter().all(|x| x.is_finite()))
        })
        .collect();
    let cube = || (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [a, b, c])));
    let mut candidates: Vec<(f64, usize)> = Vec::new();
    for node in 0..lattice.len() {
        let Some(here) = gradient[node] else { continue };
        let (mut least, mut cell) = (true, [[f64::INFINITY, f64::NEG_INFINITY]; 3]);
        let mut count = 0;
        for by in cube() {
            let Some(there) = lattice.neighbour(node, by).and_then(|n| gradient[n]) else {
                continue;
            };
            count += 1;
            least &= by == [0; 3] || there.norm_squared() >= here.norm_squared();
            for k in 0..3 {
                cell[k] = [cell[k][0].min(there[k]), cell[k][1].max(there[k])];
            }
        }
        // Beside walls some are missing; of a few nothing can be told.
        let changes = count >= 18 && cell.iter().all(|[lo, hi]| *lo <= 0.0 && *hi >= 0.0);
        if changes {
            candidates.push((if least { -1.0 } else { 0.0 } + 1.0 - 1.0 / (1.0 + here.norm_squared()), node));
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut taken: Vec<Vec3> = Vec::new();
    let near = 1.8 * lattice.step.norm() / 3.0_f64.sqrt();
    for (order, node) in candidates {
        let place = lattice.place(node);
        // The smallest of its neighbourhood stands for the others.
        if (order < 0.0 || taken.iter().all(|p| (p - place).norm() > near)) && taken.len() < MOST {
            taken.push(place);
        }
    }
    taken
}

/// Newton's method from a start, no further than `reach` (m). `None` where there is no critical point.
pub fn polish(space: &Space, effective: &Effective, start: &Vec3, reach: f64) -> Option<CriticalPoint> {
    let mut point = *start;
    for _ in 0..ROUNDS {
        let room = space.room(&point);
        // Next to a surface there is nothing to find, and the field is dear.
        if room <= 0.05 * reach {
            return None;
        }
        let expansion = Expansion::near(space.field, point, room);
        let ball = expansion.radius;
        let (mut x, mut last) = (point, f64::INFINITY);
        for _ in 0..30 {
            let local = effective.local(&expansion, &x);
            let step = newton_step(&local)?;
            last = step.norm();
            let left = ball - (x - point).norm();
            x += if last > 0.7 * left { step * (0.7 * left / last) } else { step };
            if last < 1e-13 * space.size || left < 0.1 * ball {
                break;
            }
        }
        let moved = (x - point).norm();
        point = x;
        if (point - start).norm() > reach || !point.iter().all(|p| p.is_finite()) {
            return None;
        }
        // Close to the middle of the ball the expansion is the field.
        if moved < 0.1 * ball && last < 1e-6 * ball {
            return described(space, effective, &point, last);
        }
    }
    None
}

/// -H⁻¹ g, without what H does not know.
fn newton_step(local: &Local) -> Option<Vec3> {
    let eigen = SymmetricEigen::try_new(local.hessian, 1e-15, 200)?;
    let largest = eigen.eigenvalues.amax();
    if largest == 0.0 || !largest.is_finite() {
        return None;
    }
    let mut step = Vec3::zeros();
    for k in 0..3 {
        if eigen.eigenvalues[k].abs() > 1e-9 * largest {
            let axis = eigen.eigenvectors.column(k);
            step -= axis * (axis.dot(&local.gradient) / eigen.eigenvalues[k]);
        }
    }
    Some(step)
}

/// A critical point with its curvatures.
fn described(space: &Space, effective: &Effective, point: &Vec3, last: f64) -> Option<CriticalPoint> {
    let room = space.room(point);
    let expansion = Expansion::near(space.field, *point, room);
    let local = effective.local(&expansion, point);
    let eigen = SymmetricEigen::try_new(local.hessian, 1e-15, 200)?;
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let curvatures = order.map(|k| eigen.eigenvalues[k]);
    let axes = order.map(|k| {
        let axis: Vec3 = eigen.eigenvectors.column(k).into();
        // The largest component is positive.
        if axis[axis.iamax()] < 0.0 { -axis } else { axis }
    });
    let largest = curvatures.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let flat = curvatures.iter().any(|c| c.abs() < FLAT * largest);
    let down = curvatures.iter().filter(|c| **c < -FLAT * largest).count();
    let kind = [Kind::Minimum, Kind::Pass, Kind::Ridge, Kind::Maximum][down];
    // What errors of the unit fields make of the gradient and of the curvatures: each channel's field is wrong by ε of what it
    // is within half the room, and its slope by that over the room.
    let jets = expansion.jets(point);
    let reach = 0.5 * room;
    let size = |c: usize| jets[c].gradient.norm() + jets[c].hessian.norm() * reach;
    let total = |weights: &[f64]| weights.iter().enumerate().map(|(c, w)| w.abs() * size(c)).sum::<f64>();
    let (mut slope, mut bend) = (total(&effective.statics), total(&effective.statics) / reach);
    for square in &effective.squares {
        let jet = super::Jet::sum(&jets, &square.pattern);
        let field = total(&square.pattern);
        slope += 2.0 * square.strength * field * (jet.hessian.norm() + jet.gradient.norm() / reach);
        bend += 4.0 * square.strength * field * (jet.hessian.norm() + jet.gradient.norm() / reach) / reach;
    }
    let softest = curvatures.iter().map(|c| c.abs()).filter(|c| *c >= FLAT * largest).fold(f64::INFINITY, f64::min);
    Some(CriticalPoint {
        position: *point,
        value: local.value,
        kind,
        curvatures,
        axes,
        position_error: last + space.error * slope / softest,
        curvature_error: space.error * bend,
        flat,
    })
}

#[cfg(test)]
mod tests {
    use super::super::Square;
    use super::super::expansion::tests::Charges;
    use super::*;
    use crate::QuadraticField;

    fn cube(half: f64) -> Search {
        Search { min: Vec3::repeat(-half), max: Vec3::repeat(half), nodes: 20_000 }
    }

    #[test]
    fn nulls_between_equal_charges() {
        // Charges at the corners of a triangle: a null at its centre, and three more towards the middles of its sides.
        let places: Vec<Vec3> =
            (0..3).map(|k| std::f64::consts::TAU * k as f64 / 3.0).map(|a| Vec3::new(a.cos(), a.sin(), 0.0)).collect();
        let nearest = |p: &Vec3| places.iter().map(|c| (p - c).norm()).fold(f64::INFINITY, f64::min);
        let field = Charges(places.clone());
        let space = Space { field: &field, clearance: &nearest, error: 0.0, size: 1.0 };
        let effective = Effective::of_static(vec![1.0; 3]);
        let found = critical_points(&space, &effective, &cube(0.9));
        assert_eq!(found.len(), 4, "{found:#?}");
        let center = found[0];
        assert!(center.position.norm() < 1e-12, "{}", center.position);
        // φ = 3 (1 + (r² - 3 z²)/4 + ...): curvatures 3/2, 3/2 and -3.
        assert!((center.curvatures[0] - 1.5).abs() < 1e-9 && (center.curvatures[2] + 3.0).abs() < 1e-9);
        for point in &found {
            let sum: f64 = point.curvatures.iter().sum();
            // Laplace's equation; and a static field holds nothing (Earnshaw).
            assert!(sum.abs() < 1e-9 * point.curvatures[0], "{sum}");
            assert!(matches!(point.kind, Kind::Pass | Kind::Ridge));
            let force: Vec3 = places.iter().map(|c| (point.position - c) / (point.position - c).norm().powi(3)).sum();
            assert!(force.norm() < 1e-9, "{force}");
        }
        // The three others: by symmetry at -s (cos a, sin a).
        for other in &found[1..] {
            let radius = found[1].position.norm();
            assert!((other.position.norm() - radius).abs() < 1e-10 && other.position.z.abs() < 1e-12);
            assert!((0.1..0.5).contains(&radius), "{radius}");
        }
    }

    #[test]
    fn a_line_of_nulls_is_one() {
        let field = QuadraticField::quadrupole(Vec3::new(1.0, -1.0, 0.0), 1.0);
        let space = Space { field: &field, clearance: &|_| f64::INFINITY, error: 0.0, size: 2.0 };
        let square = Square { strength: 1.0, pattern: vec![1.0] };
        let effective = Effective { statics: vec![0.0], slope: Vec3::zeros(), squares: vec![square] };
        let found = critical_points(&space, &effective, &cube(1.0));
        assert_eq!(found.len(), 1, "{found:#?}");
        assert!(found[0].flat && found[0].kind == Kind::Minimum && found[0].position.norm() < 0.2);
        assert!(found[0].position.xy().norm() < 1e-10);
    }

    #[test]
    fn gravity_moves_a_minimum() {
        let field = QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0);
        let space = Space { field: &field, clearance: &|_| f64::INFINITY, error: 0.0, size: 2.0 };
        let square = Square { strength: 1.0, pattern: vec![1.0] };
        let effective = Effective { statics: vec![0.0], slope: Vec3::z() * 0.4, squares: vec![square] };
        let found = critical_points(&space, &effective, &cube(1.0));
        // |∇φ|² = x² + y² + 4 z²: the minimum of that and 0.4 z is at z = -0.05.
        assert_eq!(found.len(), 1);
        assert!((found[0].position - Vec3::z() * -0.05).norm() < 1e-12, "{}", found[0].position);
    }
}
