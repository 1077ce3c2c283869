//! The field of charges on generating curves, anywhere.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use meshes::Vec3;
use pulp::Arch;
use serde::{Deserialize, Serialize};

use super::AxialBody;
use super::assembly::{LARGEST_ORDER, Nodes, fine_nodes};
use super::element::{Cell, Element};
use super::gauss::{Rules, legendre};
use super::ring::{self, GROUP, Rings};
use super::solution::{AxialSolution, density};
use crate::constants::COULOMB;

/// Where the common axis stands in space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Where heights are zero, m.
    pub origin: Vec3,
    /// `[e1, e2, e3]`, orthonormal and right-handed; `e3` is the axis.
    pub frame: [Vec3; 3],
}

impl Default for Axis {
    fn default() -> Self {
        Self { origin: Vec3::zeros(), frame: [Vec3::x(), Vec3::y(), Vec3::z()] }
    }
}

/// What a rule may leave of an element's share of the potential.
const LEFT: f64 = 1e-11;

/// No rule is used nearer than that, in lengths of the element.
const NEAREST: f64 = 0.6;

/// Cells of a near element are summed from this distance on, in their lengths. Gradients lose a digit more than potentials
/// (`assembly`), which 24 nodes have to spare.
const APART: f64 = 0.75;

/// A point nearer to a surface than that is on it, in lengths of the element: farther off, rounding leaves 1e-16 over the
/// distance of the gradient.
const ON_SURFACE: f64 = 1e-11;

/// How far from a surface the gradient of a point on it is taken, once and twice that, in lengths of the element: from there to
/// the surface it is a straight line to the square of this.
const BESIDE: f64 = 1e-6;

/// Potential and gradient.
const VALUES: usize = 4;

/// Potentials and gradients of channels: combinations of unit solutions.
///
/// Inside a closed body the potential is its own, to the accuracy of the solution. On the surface of a closed body the
/// gradient is that just outside, on a sheet the mean of both sides.
pub struct AxialSum {
    axis: Axis,
    bodies: Vec<AxialBody>,
    closed: Vec<bool>,
    elements: Vec<Element>,
    nodes: Vec<Nodes>,
    /// Distance from which on an element acts by its nodes, m.
    reach: Vec<f64>,
    rings: Rings,
    /// V m: `channel * rings + ring`.
    charge: Vec<f64>,
    /// Distance from which on an element acts by the nodes of a finer rule, m.
    finer_reach: Vec<f64>,
    finer_groups: Vec<Range<usize>>,
    finer_rings: Rings,
    finer_charge: Vec<f64>,
    /// Legendre coefficients of the charge per parameter over ρ, V: `channel * nodes + first node + k`.
    coefficients: Vec<f64>,
    unknowns: usize,
    ground: Option<f64>,
    channels: usize,
    rules: Arc<Rules>,
    arch: Arch,
}

impl AxialSum {
    /// Channel c is Σ_k `weights[c][k]` times unit solution k.
    ///
    /// # Panics
    /// A row of weights has another length than there are unit solutions.
    pub fn new(solution: &AxialSolution, weights: &[Arc<[f64]>], axis: Axis) -> Self {
        assert!(weights.iter().all(|w| w.len() == solution.functions()), "a weight for each unit solution");
        let rules = solution.rules().clone();
        let elements = solution.data.elements.clone();
        let bodies = solution.bodies.clone();
        let (mut nodes, mut rings, mut first) = (Vec::with_capacity(elements.len()), Rings::default(), 0);
        for element in &elements {
            nodes.push(Nodes::new(element, &bodies, &rules, first));
            first += element.order;
        }
        nodes.iter().flat_map(|n| &n.places).for_each(|p| rings.push(*p));
        rings.fill();
        let unknowns = solution.unknowns();
        let mut charge = vec![0.0; weights.len() * rings.radius.len()];
        let mut coefficients = Vec::with_capacity(weights.len() * unknowns);
        for (row, all) in weights.iter().zip(charge.chunks_exact_mut(rings.radius.len())) {
            for (k, w) in row.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                for (q, unit) in all.iter_mut().zip(solution.charges(k)) {
                    *q += COULOMB * w * unit;
                }
            }
            coefficients.extend(solution.coefficients(&all[..unknowns]));
        }
        let mut sum = Self {
            axis,
            closed: bodies.iter().map(AxialBody::closed).collect(),
            bodies,
            reach: Vec::new(),
            finer_reach: Vec::new(),
            finer_groups: Vec::new(),
            finer_rings: Rings::default(),
            finer_charge: Vec::new(),
            elements,
            nodes,
            rings,
            charge,
            coefficients,
            unknowns,
            ground: solution.data.ground,
            channels: weights.len(),
            rules,
            arch: Arch::new(),
        };
        sum.add_rules();
        sum
    }

    /// The finer rules of all elements, and how near to it each rule serves.
    fn add_rules(&mut self) {
        let mut places = Vec::new();
        for (e, element) in self.elements.iter().enumerate() {
            let n = fine_nodes(element.order);
            let rule = self.rules.rule(n);
            let begin = places.len() / GROUP;
            places.extend(rule.points.iter().zip(&rule.weights).map(|(u, w)| (e, *u, *w)));
            self.finer_groups.push(begin..places.len() / GROUP);
            let length = self.nodes[e].length;
            self.reach.push(self.nearest(e, element.order) * length);
            self.finer_reach.push(self.nearest(e, n) * length);
        }
        let (mut rings, mut charge) = (Rings::default(), Vec::new());
        self.charged(&places, &mut rings, &mut charge);
        (self.finer_rings, self.finer_charge) = (rings, charge);
    }

    /// How near to an element a rule of n nodes serves, in lengths of the element. In a Bernstein ellipse of size r around it
    /// the potential is smooth, and Gauss's rule leaves r^(k - 2n) of the term P_k of the charge (two degrees more for the
    /// radius); the half axes of the ellipse are (r ± 1/r)/2, in half lengths.
    fn nearest(&self, e: usize, n: usize) -> f64 {
        let (order, first) = (self.elements[e].order, self.nodes[e].first);
        let coefficients = |c: usize| &self.coefficients[c * self.unknowns + first..][..order];
        let mut terms = [0.0_f64; LARGEST_ORDER];
        for c in 0..self.channels {
            let largest = coefficients(c).iter().fold(0.0_f64, |m, a| m.max(a.abs()));
            if largest > 0.0 {
                for (term, a) in terms.iter_mut().zip(coefficients(c)) {
                    *term = term.max(a.abs() / largest);
                }
            }
        }
        let left = |r: f64| -> f64 {
            let term = |(k, a): (usize, &f64)| a * r.powi(k as i32 + 2 - 2 * n as i32);
            terms.iter().take(order).enumerate().map(term).fold(0.0, f64::max)
        };
        let mut r = 1.5;
        while left(r) > LEFT && r < 1e3 {
            r *= 1.05;
        }
        (0.25 * (r - 1.0 / r)).max(NEAREST)
    }

    /// Rings with their charges at places: element, parameter and weight.
    fn charged(&self, places: &[(usize, f64, f64)], rings: &mut Rings, charge: &mut Vec<f64>) {
        let n = places.len().next_multiple_of(GROUP);
        rings.clear();
        charge.clear();
        charge.resize(n * self.channels, 0.0);
        let mut polynomials = [0.0; LARGEST_ORDER];
        for (i, &(e, u, weight)) in places.iter().enumerate() {
            let (element, first) = (&self.elements[e], self.nodes[e].first);
            let ring = element.at(&self.bodies, u).0;
            rings.push(ring);
            let polynomials = &mut polynomials[..element.order];
            legendre(u, polynomials);
            for c in 0..self.channels {
                let coefficients = &self.coefficients[c * self.unknowns + first..][..element.order];
                let density: f64 = coefficients.iter().zip(polynomials.iter()).map(|(a, b)| a * b).sum();
                charge[c * n + i] = weight * ring[0] * density;
            }
        }
        rings.fill();
    }

    /// Every unit solution as a channel.
    pub fn every(solution: &AxialSolution, axis: Axis) -> Self {
        let n = solution.functions();
        let unit = |k: usize| -> Arc<[f64]> { (0..n).map(|l| f64::from(u8::from(k == l))).collect() };
        Self::new(solution, &(0..n).map(unit).collect::<Vec<_>>(), axis)
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of rings that a far point sums over.
    pub fn rings(&self) -> usize {
        self.unknowns
    }

    /// Potential (V) and gradient (V/m) of every channel at every point (m), `(point * channels + channel) * 4`. A point's
    /// answer does not depend on the others.
    pub fn sum(&self, points: &[Vec3]) -> Vec<f64> {
        let mut scratch = Scratch::default();
        let mut all = Vec::with_capacity(points.len() * self.channels * VALUES);
        let [e1, e2, e3] = &self.axis.frame;
        for point in points {
            let d = point - self.axis.origin;
            let (x, y, z) = (d.dot(e1), d.dot(e2), d.dot(e3));
            let rho = x.hypot(y);
            let outward = if rho > 0.0 { (e1 * x + e2 * y) / rho } else { Vec3::zeros() };
            self.in_half_plane([rho, z], &mut scratch);
            for [potential, along_rho, along_z] in &scratch.sums {
                let gradient = outward * *along_rho + e3 * *along_z;
                all.extend([*potential, gradient.x, gradient.y, gradient.z]);
            }
        }
        all
    }

    /// Sums of all channels at a point of the half plane, images in the ground included.
    fn in_half_plane(&self, point: [f64; 2], scratch: &mut Scratch) {
        scratch.sums.clear();
        scratch.sums.resize(self.channels, [0.0; 3]);
        if let Some(height) = self.ground {
            // The images' potential here is minus that of the charges at the mirrored point.
            self.add_charges([point[0], 2.0 * height - point[1]], scratch);
            for [potential, along_rho, _] in &mut scratch.sums {
                (*potential, *along_rho) = (-*potential, -*along_rho);
            }
        }
        if let Some((e, u)) = self.add_charges(point, scratch) {
            self.on_surface(e, u, scratch);
        }
    }

    /// Adds what the charges do at a point; the answer is the place on a surface that the point is on.
    fn add_charges(&self, point: [f64; 2], scratch: &mut Scratch) -> Option<(usize, f64)> {
        let mut touched = None;
        let Scratch { sums, counted, cells, finer, fine, rings, charge } = scratch;
        fine.clear();
        finer.clear();
        counted.clear();
        let mut others = 0;
        for (e, (nodes, element)) in self.nodes.iter().zip(&self.elements).enumerate() {
            let distance = nodes.distance(point);
            if distance >= self.reach[e] {
                continue;
            }
            if counted.is_empty() {
                counted.resize(self.rings.radius.len(), 1.0);
            }
            counted[nodes.first..][..element.order].fill(0.0);
            others += 1;
            if distance >= self.finer_reach[e] {
                finer.push(self.finer_groups[e].clone());
                continue;
            }
            cells.clear();
            let shortest = ON_SURFACE * nodes.length;
            if let Some(u) = Cell::WHOLE.cut(element, &self.bodies, point, (APART, shortest), cells) {
                touched = Some((e, u));
            }
            let rule = self.rules.rule(fine_nodes(element.order));
            for cell in cells.iter() {
                let width = cell.to - cell.from;
                fine.extend(rule.points.iter().zip(&rule.weights).map(|(x, w)| (e, cell.from + width * x, w * width)));
            }
        }
        let groups = |rings: &Rings| 0..rings.radius.len() / GROUP;
        if others < self.elements.len() {
            let all = groups(&self.rings);
            ring::add_sums(self.arch, point, &self.rings, &self.charge, (&[all], counted), sums);
        }
        if !finer.is_empty() {
            ring::add_sums(self.arch, point, &self.finer_rings, &self.finer_charge, (finer, &[]), sums);
        }
        if !fine.is_empty() {
            self.charged(fine, rings, charge);
            ring::add_sums(self.arch, point, rings, charge, (&[groups(rings)], &[]), sums);
        }
        touched
    }

    /// Puts the gradient on a surface in place: the mean of both sides, and on a closed body half the jump more, -2π σ/(4πε0)
    /// along the normal.
    fn on_surface(&self, e: usize, u: f64, scratch: &mut Scratch) {
        let element = &self.elements[e];
        let (place, normal) = (element.at(&self.bodies, u).0, element.normal(&self.bodies, u));
        let step = BESIDE * self.nodes[e].length;
        let potentials: Vec<f64> = scratch.sums.iter().map(|s| s[0]).collect();
        let mut mean = vec![[0.0; 2]; self.channels];
        // On each side the straight line through two steps.
        for (side, weight) in [(step, 1.0), (2.0 * step, -0.5), (-step, 1.0), (-2.0 * step, -0.5)] {
            let beside = [(place[0] + side * normal[0]).abs(), place[1] + side * normal[1]];
            self.in_half_plane(beside, scratch);
            for (mean, sum) in mean.iter_mut().zip(&scratch.sums) {
                *mean = [mean[0] + weight * sum[1], mean[1] + weight * sum[2]];
            }
        }
        for c in 0..self.channels {
            let coefficients = &self.coefficients[c * self.unknowns + self.nodes[e].first..][..element.order];
            let jump =
                if self.closed[element.body] { -TAU * density(element, &self.bodies, u, coefficients) } else { 0.0 };
            let [along_rho, along_z] = mean[c];
            scratch.sums[c] = [potentials[c], along_rho + jump * normal[0], along_z + jump * normal[1]];
        }
    }
}

/// What one sum after the other writes over.
#[derive(Default)]
struct Scratch {
    sums: Vec<[f64; 3]>,
    counted: Vec<f64>,
    cells: Vec<Cell>,
    /// Groups of finer rings that count.
    finer: Vec<Range<usize>>,
    /// Element, parameter and weight of each ring of a near element.
    fine: Vec<(usize, f64, f64)>,
    rings: Rings,
    charge: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use meshes::{Shape, profile::revolved};

    use super::*;
    use crate::axial::AxialProblem;

    #[test]
    fn rules_leave_what_they_may() {
        let shapes = [
            Shape::Ring { radius: 1.0, wire_radius: 0.05 },
            Shape::Disc { radius: 0.7, hole_radius: 0.0, thickness: 0.0 },
            Shape::Cylinder { radius: 0.3, length: 0.5, caps: true },
        ];
        let body = |(k, shape): (usize, &Shape)| {
            let profile = revolved(shape).unwrap().swap_remove(0).profile;
            AxialBody { profile, electrode: k, height: 0.8 * k as f64, flipped: false }
        };
        let bodies: Vec<AxialBody> = shapes.iter().enumerate().map(body).collect();
        for accuracy in [1e-2, 1e-5, 1e-9] {
            let problem = AxialProblem { bodies: &bodies, electrodes: 3, sources: &[], ground: None };
            let solution = problem.solve(accuracy).unwrap();
            let sum = AxialSum::every(&solution, Axis::default());
            // Every element cut, however far.
            let mut cut = AxialSum::every(&solution, Axis::default());
            cut.reach.fill(f64::INFINITY);
            cut.finer_reach.fill(f64::INFINITY);
            let (mut potential, mut gradient) = (0.0_f64, 0.0_f64);
            for k in 0..400 {
                let u = |i: usize| (f64::from(k) * [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9][i]).fract();
                let p = [Vec3::new(3.0 * u(0) - 1.5, 3.0 * u(1) - 1.5, 4.0 * u(2) - 1.0)];
                for (a, b) in sum.sum(&p).chunks_exact(4).zip(cut.sum(&p).chunks_exact(4)) {
                    let slope = |s: &[f64]| Vec3::new(s[1], s[2], s[3]);
                    potential = potential.max((a[0] - b[0]).abs());
                    gradient = gradient.max((slope(a) - slope(b)).norm() / slope(b).norm().max(1.0));
                }
            }
            println!("{accuracy:e}: {potential:.1e} {gradient:.1e}");
            // Of 1 V; the gradient loses a digit beside an element.
            assert!(potential < 1e-10 && gradient < 1e-8, "{accuracy:e}: {potential:e} {gradient:e}");
        }
    }
}
