//! Potentials that charges on elements cause at nodes: far by their nodes, near by cutting, on themselves through ln.
//!
//! Between its nodes the charge per parameter of an element is the ring's radius ρ times a polynomial: so it vanishes on the
//! axis as it must. Were it the polynomial alone, a rest of 1e-10 there would be a field of 1e-10 over the distance.

use pulp::Arch;
use rayon::prelude::*;

use super::AxialBody;
use super::element::{Cell, Element};
use super::gauss::{Rules, legendre};
use super::ring::{self, Rings};

/// Largest order of an element.
pub(crate) const LARGEST_ORDER: usize = 24;

/// Nodes of the rule with which near elements and their parts are summed.
const FINE: usize = 24;

/// As [`FINE`], for orders up to 8.
const FINE_FOR_LOW: usize = 16;

/// Cells are summed from this distance on, in their lengths: there the Bernstein ellipse has half axes that add up to 3.3, and
/// 24 nodes of degree 15 leave 3.3^-32.
const APART: f64 = 0.75;

/// Power of the substitution that takes ln out of the stretches beside a node: x = s^6 leaves s^5 ln s, of which 24 nodes
/// leave 1e-15.
const LOG_POWER: i32 = 6;

/// Longest such stretch of u, times the order: on it the polynomials bend a few times at most. Without this limit the
/// capacitances of two spheres (2.01 and 2.1) stopped at 1e-10.
const SMOOTH_FOR: f64 = 3.0;

/// Number of nodes with which an element of that order is summed near by.
pub(crate) fn fine_nodes(order: usize) -> usize {
    if order <= 8 { FINE_FOR_LOW } else { FINE }
}

/// From which distance on, in lengths of the element, its own nodes will do: from a Bernstein ellipse of size r they leave
/// r^-order, and of `left`.
pub(crate) fn far(order: usize, left: f64) -> f64 {
    let r = left.powf(-1.0 / order as f64);
    (0.25 * (r - 1.0 / r)).max(APART)
}

/// Nodes of an element in space.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub places: Vec<[f64; 2]>,
    /// Greatest |dx/du|, m: at least the element's length.
    pub length: f64,
    /// A circle in the half plane that holds the element.
    pub center: [f64; 2],
    pub reach: f64,
    pub first: usize,
}

impl Nodes {
    pub fn new(element: &Element, bodies: &[AxialBody], rules: &Rules, first: usize) -> Self {
        let at: Vec<_> = rules.rule(element.order).points.iter().map(|&u| element.at(bodies, u)).collect();
        let ends = [0.0, 1.0].map(|u| element.at(bodies, u));
        let length = at.iter().chain(&ends).map(|(_, d)| d[0].hypot(d[1])).fold(0.0, f64::max);
        let center = element.at(bodies, 0.5).0;
        let reach = at.iter().chain(&ends).map(|(p, _)| apart(*p, center)).fold(0.0, f64::max);
        // Between nodes a bent curve may reach a little beyond its nodes' circle.
        Self { places: at.into_iter().map(|(p, _)| p).collect(), length, center, reach: 1.05 * reach, first }
    }

    /// A lower bound of the distance of a point, m.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        let bound = apart(point, self.center) - self.reach;
        if bound > 0.5 * self.length {
            return bound;
        }
        let nearest = self.places.iter().map(|p| apart(*p, point)).fold(f64::INFINITY, f64::min);
        // Neighbouring nodes, and the ends, are no farther from each other than that.
        nearest - 0.8 * self.length / self.places.len() as f64
    }
}

pub(crate) fn apart(p: [f64; 2], q: [f64; 2]) -> f64 {
    (p[0] - q[0]).hypot(p[1] - q[1])
}

/// What one thread needs to integrate.
struct Scratch {
    cells: Vec<Cell>,
    rings: Rings,
    /// Parameter and weight of each ring, its radius included.
    parameters: Vec<(f64, f64)>,
    values: Vec<f64>,
}

impl Scratch {
    fn add(&mut self, ring: [f64; 2], u: f64, weight: f64) {
        self.rings.push(ring);
        self.parameters.push((u, weight * ring[0]));
    }
}

/// Matrix of potentials (row-major, charge over metres) at all nodes for charges at all nodes.
pub(crate) struct Assembly<'a> {
    pub bodies: &'a [AxialBody],
    pub elements: &'a [Element],
    pub nodes: &'a [Nodes],
    pub rules: &'a Rules,
    pub ground: Option<f64>,
    pub arch: Arch,
}

impl Assembly<'_> {
    pub fn matrix(&self) -> Vec<f64> {
        let n = self.nodes.last().map_or(0, |e| e.first + e.places.len());
        let mut matrix = vec![0.0; n * n];
        let targets: Vec<(usize, usize)> =
            self.nodes.iter().enumerate().flat_map(|(e, nodes)| (0..nodes.places.len()).map(move |k| (e, k))).collect();
        let fresh = || {
            let scratch =
                Scratch { cells: Vec::new(), rings: Rings::default(), parameters: Vec::new(), values: Vec::new() };
            (scratch, [0.0; LARGEST_ORDER], Rings::default())
        };
        matrix.par_chunks_mut(n.max(1)).zip(targets).with_min_len(8).for_each_init(
            fresh,
            |(scratch, moments, far_rings), (row, (element, k))| {
                let point = self.nodes[element].places[k];
                let u = self.rules.rule(self.elements[element].order).points[k];
                self.add_row(point, Some((element, u)), 1.0, row, (scratch, moments, far_rings));
                if let Some(height) = self.ground {
                    let image = [point[0], 2.0 * height - point[1]];
                    self.add_row(image, None, -1.0, row, (scratch, moments, far_rings));
                }
            },
        );
        matrix
    }

    /// Adds the potentials at a point, times a sign, to a row; `own` is the element that holds the point, and where.
    fn add_row(
        &self,
        point: [f64; 2],
        own: Option<(usize, f64)>,
        sign: f64,
        row: &mut [f64],
        (scratch, moments, rings): (&mut Scratch, &mut [f64; LARGEST_ORDER], &mut Rings),
    ) {
        let is_far = |e: usize| {
            own.is_none_or(|(own, _)| own != e)
                && self.nodes[e].distance(point) >= far(self.elements[e].order, 1e-13) * self.nodes[e].length
        };
        // Far elements all at once.
        rings.clear();
        let near: Vec<bool> = (0..self.elements.len()).map(|e| !is_far(e)).collect();
        for (e, nodes) in self.nodes.iter().enumerate() {
            if !near[e] {
                nodes.places.iter().for_each(|p| rings.push(*p));
            }
        }
        rings.fill();
        ring::potentials(self.arch, point, rings, &mut scratch.values);
        let mut values = scratch.values.iter();
        for (e, nodes) in self.nodes.iter().enumerate() {
            if !near[e] {
                for (entry, value) in row[nodes.first..].iter_mut().take(nodes.places.len()).zip(&mut values) {
                    *entry += sign * value;
                }
            }
        }
        for (e, nodes) in self.nodes.iter().enumerate().filter(|(e, _)| near[*e]) {
            let order = self.elements[e].order;
            let own_u = own.and_then(|(own, u)| (own == e).then_some(u));
            let moments = &mut moments[..order];
            self.moments(e, point, own_u, scratch, moments);
            let transform = self.rules.transform(order);
            let entries = &mut row[nodes.first..nodes.first + order];
            let mut potentials = [0.0; LARGEST_ORDER];
            for (moment, factors) in moments.iter().zip(transform.chunks_exact(order)) {
                for (potential, factor) in potentials.iter_mut().zip(factors) {
                    *potential += moment * factor;
                }
            }
            for ((entry, potential), place) in entries.iter_mut().zip(potentials).zip(&nodes.places) {
                *entry += sign * potential / place[0];
            }
        }
    }

    /// ∫ P_k(2u - 1) ρ(u) φ(u) du over an element, φ the potential at the point of a unit charge on the ring at u.
    fn moments(&self, e: usize, point: [f64; 2], own: Option<f64>, scratch: &mut Scratch, moments: &mut [f64]) {
        let element = &self.elements[e];
        scratch.cells.clear();
        scratch.rings.clear();
        scratch.parameters.clear();
        if let Some(u) = own {
            self.beside(element, point, u, scratch);
        } else {
            // A node of another element is not on this one: no shortest cell.
            Cell::WHOLE.cut(element, self.bodies, point, (APART, 0.0), &mut scratch.cells);
        }
        let rule = self.rules.rule(fine_nodes(element.order));
        for k in 0..scratch.cells.len() {
            let cell = scratch.cells[k];
            let width = cell.to - cell.from;
            for (x, w) in rule.points.iter().zip(&rule.weights) {
                let u = cell.from + width * x;
                scratch.add(element.at(self.bodies, u).0, u, w * width);
            }
        }
        scratch.rings.fill();
        ring::potentials(self.arch, point, &scratch.rings, &mut scratch.values);
        moments.fill(0.0);
        let mut polynomials = [0.0; LARGEST_ORDER];
        let polynomials = &mut polynomials[..moments.len()];
        for ((u, w), value) in scratch.parameters.iter().zip(&scratch.values) {
            legendre(*u, polynomials);
            for (moment, p) in moments.iter_mut().zip(polynomials.iter()) {
                *moment += w * value * p;
            }
        }
    }

    /// Nodes on both sides of the point's own place u: first stretches in which the potential is a smooth function and
    /// another times ln of the distance, then cells that double.
    fn beside(&self, element: &Element, point: [f64; 2], u: f64, scratch: &mut Scratch) {
        let (_, d) = element.at(self.bodies, u);
        // The ring's image beyond the axis is 2ρ away; where the parameter has a power, the curve comes back to the point
        // at parameters as far from it as the edge.
        let from_edge = if element.power > 1 { u + element.from / (element.to - element.from) } else { f64::INFINITY };
        let smooth = (point[0] / d[0].hypot(d[1])).min(from_edge);
        let rule = self.rules.rule(FINE);
        for (side, room) in [(-1.0, u), (1.0, 1.0 - u)] {
            let first = smooth.min(room).min(SMOOTH_FOR / element.order as f64);
            for (x, w) in rule.points.iter().zip(&rule.weights) {
                let power = x.powi(LOG_POWER - 1);
                let place = (u + side * first * power * x).clamp(0.0, 1.0);
                let weight = w * first * f64::from(LOG_POWER) * power;
                scratch.add(element.at(self.bodies, place).0, place, weight);
            }
            let mut done = first;
            while done < room {
                // A rest shorter than a cell belongs to the last one.
                let next = if 2.5 * done >= room { room } else { 2.0 * done };
                let (a, b) = (u + side * done, u + side * next);
                scratch.cells.push(Cell { from: a.min(b).max(0.0), to: a.max(b).min(1.0) });
                done = next;
            }
        }
    }
}
