//! Shapes to triangles.
//!
//! Each shape decides by itself how many panels it needs along each direction for a given **fineness**, a number that scales
//! all counts: twice the fineness is half the panel size and four times the panels. [`triangulate`] meshes for a fineness,
//! [`triangulate_to`] finds the fineness that gives about a wanted number of panels.
//!
//! Round shapes keep their true area: a polygon inscribed in a circle would be a smaller electrode, with a smaller capacitance.

mod flat;
pub mod grading;
mod patchwork;
mod perforated;
mod planar;
mod revolve;
mod round;
mod tube;

use std::collections::HashMap;

pub(crate) use tube::CLEARANCE;

use crate::{GridPattern, Placement, Shape, ShapeError, Vec3};

/// Triangles of one shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangulation {
    /// Corner points, m.
    pub vertices: Vec<Vec3>,
    /// Corners of each panel, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Triangulation {
    /// Sum of the areas, m².
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|t| self.area_vector(t).norm()).sum()
    }

    /// Enclosed volume, m³: positive for a closed surface with outward normals.
    pub fn volume(&self) -> f64 {
        self.triangles.iter().map(|t| self.vertices[t[0] as usize].dot(&self.area_vector(t)) / 3.0).sum()
    }

    fn area_vector(&self, t: &[u32; 3]) -> Vec3 {
        let [a, b, c] = t.map(|v| self.vertices[v as usize]);
        (b - a).cross(&(c - a)) * 0.5
    }

    /// Edges that belong to one panel only, in the direction that panel runs along them; in a fixed order.
    pub fn open_edges(&self) -> Vec<[u32; 2]> {
        let mut uses: HashMap<[u32; 2], u32> = HashMap::with_capacity(2 * self.triangles.len());
        let sorted = |a: u32, b: u32| if a < b { [a, b] } else { [b, a] };
        let edges = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        for [a, b] in self.triangles.iter().flat_map(edges) {
            *uses.entry(sorted(a, b)).or_insert(0) += 1;
        }
        self.triangles.iter().flat_map(edges).filter(|&[a, b]| uses[&sorted(a, b)] == 1).collect()
    }

    /// Moves the local frame to where the shape stands.
    ///
    /// # Errors
    /// As [`Placement::frame`].
    pub fn placed(mut self, placement: &Placement) -> Result<Self, ShapeError> {
        let [e1, e2, e3] = placement.frame()?;
        for v in &mut self.vertices {
            *v = placement.center + e1 * v.x + e2 * v.y + e3 * v.z;
        }
        Ok(self)
    }

    /// Applies `moved(vertex, k)` with the k near 1 for which the area is `wanted` (m²).
    fn with_area(self, wanted: f64, moved: impl Fn(&Vec3, f64) -> Vec3) -> Self {
        fit_area(wanted, |k| Self {
            vertices: self.vertices.iter().map(|v| moved(v, k)).collect(),
            triangles: self.triangles.clone(),
        })
    }
}

/// Builds a surface with the factor k near 1 for which its area is `wanted` (m²), by the secant method; the area then
/// agrees to 1e-12.
fn fit_area(wanted: f64, build: impl Fn(f64) -> Triangulation) -> Triangulation {
    let excess = |mesh: &Triangulation| mesh.area() / wanted - 1.0;
    let (mut k0, mut k1) = (1.0, 1.001);
    let mut mesh = build(k1);
    let (mut e0, mut e1) = (excess(&build(k0)), excess(&mesh));
    for _ in 0..20 {
        if e1.abs() < 1e-12 || e1 == e0 {
            break;
        }
        let k2 = k1 - e1 * (k1 - k0) / (e1 - e0);
        mesh = build(k2);
        (k0, e0) = (k1, e1);
        (k1, e1) = (k2, excess(&mesh));
    }
    mesh
}

/// Triangulates a shape in its local frame.
///
/// A fineness of 1 gives a few hundred panels for a simple shape and a capacitance good to about a percent.
///
/// # Errors
/// The shape cannot be: see [`Shape::check`].
pub fn triangulate(shape: &Shape, fineness: f64) -> Result<Triangulation, ShapeError> {
    shape.check()?;
    Ok(match shape {
        Shape::Sphere { radius } => round::sphere(*radius, fineness),
        Shape::Ring { radius, wire_radius } => round::ring(*radius, *wire_radius, fineness),
        Shape::Disc { radius, hole_radius, thickness } => round::disc(*radius, *hole_radius, *thickness, fineness),
        Shape::Plate { size, thickness } => flat::plate(*size, *thickness, fineness),
        Shape::EndCap { radius, opening, thickness } => round::end_cap(*radius, *opening, *thickness, fineness),
        Shape::GridPlate { outline, pitch, pattern: GridPattern::Perforated { hole, open, thickness } } => {
            perforated::plate(*outline, *pitch, *hole, *open, *thickness, fineness)?
        }
        Shape::GridPlate { outline, pitch, pattern: GridPattern::Wires { weave, wire_radius } } => {
            tube::wire_grid(*outline, *pitch, *weave, *wire_radius, fineness)
        }
        Shape::Cylinder { radius, length, caps } => round::cylinder(*radius, *length, *caps, fineness),
        Shape::Rod { radius, length } => round::rod(*radius, *length, fineness),
        Shape::Wire { points, wire_radius } => tube::wire(points, *wire_radius, fineness),
        Shape::Box { size } => flat::block(*size, fineness),
        Shape::HyperbolicRing { r0, extent, .. } => round::hyperbolic_ring(*r0, *extent, fineness),
        Shape::HyperbolicCap { r0, z0, extent } => round::hyperbolic_cap(*r0, *z0, *extent, fineness),
        Shape::Mesh { vertices, triangles } => {
            Triangulation { vertices: vertices.clone(), triangles: triangles.clone() }
        }
    })
}

/// Triangulates a shape with about `panels` panels, and says the fineness that gave them.
///
/// The number is met within some ten percent where the shape allows it; a shape has a least number of its own.
///
/// # Errors
/// As [`triangulate`].
pub fn triangulate_to(shape: &Shape, panels: usize) -> Result<(Triangulation, f64), ShapeError> {
    let wanted = panels.max(1) as f64;
    let mut best = (triangulate(shape, 1.0)?, 1.0);
    if matches!(shape, Shape::Mesh { .. }) {
        return Ok(best);
    }
    let ratio = |mesh: &Triangulation| mesh.triangles.len() as f64 / wanted;
    // Counts go up in steps with the square of the fineness: bracket the wanted number, then halve the bracket.
    let (mut low, mut high) = (1.0_f64, 1.0_f64);
    let mut fineness = (1.0 / ratio(&best.0)).sqrt().clamp(1e-3, 1e3);
    for _ in 0..14 {
        let mesh = triangulate(shape, fineness)?;
        let here = ratio(&mesh);
        if here <= 1.0 {
            low = fineness;
        } else {
            high = fineness;
        }
        if here.ln().abs() < ratio(&best.0).ln().abs() {
            best = (mesh, fineness);
        }
        if (here - 1.0).abs() < 0.03 {
            break;
        }
        fineness = match (low < high, here <= 1.0) {
            (true, _) => (low * high).sqrt(),
            (false, true) => fineness * 1.3,
            (false, false) => fineness / 1.3,
        };
        if !(1e-3..=1e3).contains(&fineness) {
            break;
        }
    }
    Ok(best)
}
