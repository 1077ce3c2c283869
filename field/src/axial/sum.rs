//! The field of charges on generating curves, anywhere.

use std::f64::consts::TAU;
use std::sync::Arc;

use meshes::Vec3;
use pulp::Arch;

use super::AxialBody;
use super::assembly::{LARGEST_ORDER, Nodes, far, fine_nodes};
use super::element::{Cell, Element};
use super::gauss::{Rules, legendre};
use super::ring::{self, GROUP, Rings};
use super::solution::{AxialSolution, density};
use crate::constants::COULOMB;

/// Where the common axis stands in space.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// What an element's own nodes leave of its share of the potential, where they act as rings.
const LEFT_FAR: f64 = 1e-11;

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
        Self {
            axis,
            closed: bodies.iter().map(AxialBody::closed).collect(),
            bodies,
            reach: elements.iter().zip(&nodes).map(|(e, n)| far(e.order, LEFT_FAR) * n.length).collect(),
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
        }
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
        let (mut touched, mut counted) = (None, true);
        scratch.near.clear();
        scratch.fine.clear();
        for (e, (nodes, reach)) in self.nodes.iter().zip(&self.reach).enumerate() {
            if nodes.distance(point) < *reach {
                scratch.near.push(e);
            }
        }
        if !scratch.near.is_empty() {
            counted = false;
            scratch.counted.clear();
            scratch.counted.resize(self.rings.radius.len(), 1.0);
            for &e in &scratch.near {
                scratch.counted[self.nodes[e].first..][..self.elements[e].order].fill(0.0);
                scratch.cells.clear();
                let shortest = ON_SURFACE * self.nodes[e].length;
                let (element, cells) = (&self.elements[e], &mut scratch.cells);
                if let Some(u) = Cell::WHOLE.cut(element, &self.bodies, point, (APART, shortest), cells) {
                    touched = Some((e, u));
                }
                let rule = self.rules.rule(fine_nodes(element.order));
                for cell in &scratch.cells {
                    let width = cell.to - cell.from;
                    for (x, w) in rule.nodes.iter().zip(&rule.weights) {
                        scratch.fine.push((e, cell.from + width * x, w * width));
                    }
                }
            }
            self.add_fine(point, scratch);
        }
        let counted: &[f64] = if counted { &[] } else { &scratch.counted };
        ring::add_sums(self.arch, point, &self.rings, &self.charge, counted, &mut scratch.sums);
        touched
    }

    /// Adds the rings of near elements, with charges from the polynomials.
    fn add_fine(&self, point: [f64; 2], scratch: &mut Scratch) {
        let n = scratch.fine.len().next_multiple_of(GROUP);
        scratch.rings.clear();
        scratch.charge.clear();
        scratch.charge.resize(n * self.channels, 0.0);
        let mut polynomials = [0.0; LARGEST_ORDER];
        for (i, &(e, u, weight)) in scratch.fine.iter().enumerate() {
            let (element, first) = (&self.elements[e], self.nodes[e].first);
            let ring = element.at(&self.bodies, u).0;
            scratch.rings.push(ring);
            let polynomials = &mut polynomials[..element.order];
            legendre(u, polynomials);
            for c in 0..self.channels {
                let coefficients = &self.coefficients[c * self.unknowns + first..][..element.order];
                let density: f64 = coefficients.iter().zip(polynomials.iter()).map(|(a, b)| a * b).sum();
                scratch.charge[c * n + i] = weight * ring[0] * density;
            }
        }
        scratch.rings.fill();
        ring::add_sums(self.arch, point, &scratch.rings, &scratch.charge, &[], &mut scratch.sums);
    }

    /// Puts the gradient on a surface in place: the mean of both sides, and on a closed body half the jump more, -2π σ/(4πε0)
    /// along the normal.
    fn on_surface(&self, e: usize, u: f64, scratch: &mut Scratch) {
        let element = &self.elements[e];
        // At an edge the normal and the charge are those a step beside it.
        let u = u.clamp(1e-7, 1.0 - 1e-7);
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
            let jump = if self.closed[element.body] {
                -TAU * density(element, &self.bodies, u, coefficients)
            } else {
                0.0
            };
            let [along_rho, along_z] = mean[c];
            scratch.sums[c] = [potentials[c], along_rho + jump * normal[0], along_z + jump * normal[1]];
        }
    }
}

/// What one sum after the other writes over.
#[derive(Default)]
struct Scratch {
    sums: Vec<[f64; 3]>,
    near: Vec<usize>,
    counted: Vec<f64>,
    cells: Vec<Cell>,
    /// Element, parameter and weight of each ring of a near element.
    fine: Vec<(usize, f64, f64)>,
    rings: Rings,
    charge: Vec<f64>,
}
