//! Curved elements against exact values, other solvers, and finer solutions.

mod exact;
mod iterative;
mod kernel;
mod shown;
mod symmetry;
mod table;

use meshes::{GridPattern, Hole, Outline, Placement, Shape, Vec3, patches};

use super::*;
use crate::{Errors, Plane, Source};

/// Electrodes in place, and what stands beside them.
#[derive(Clone, Default)]
struct Setup {
    shapes: Vec<(Shape, Placement)>,
    sources: Vec<Source>,
    ground: Option<Plane>,
    dense: bool,
}

impl Setup {
    fn one(shape: Shape) -> Self {
        Self { shapes: vec![(shape, Placement::default())], ..Self::default() }
    }

    fn and(mut self, shape: Shape, center: [f64; 3], axis: [f64; 3]) -> Self {
        self.shapes.push((shape, Placement { center: center.into(), axis: axis.into(), up: None }));
        self
    }

    /// Whole patches as elements, each cut in four that many times.
    fn mesh(&self, order: usize, cuts: usize) -> CurvedMesh {
        let (mut all, mut electrode) = (Vec::new(), Vec::new());
        for (e, (shape, placement)) in self.shapes.iter().enumerate() {
            for patch in patches(shape).unwrap() {
                all.push(patch.placed(placement).unwrap());
                electrode.push(e as u32);
            }
        }
        let mut elements: Vec<Element> =
            (0..all.len()).map(|p| Element { patch: p as u32, low: [0.0; 2], high: [1.0; 2] }).collect();
        for _ in 0..cuts {
            elements = elements.iter().flat_map(|e| e.halves(0)).flat_map(|e| e.halves(1)).collect();
        }
        CurvedMesh { patches: all, electrode, electrodes: self.shapes.len(), elements, order }
    }

    fn names(&self) -> Vec<String> {
        (0..self.shapes.len()).map(|k| k.to_string()).collect()
    }

    fn with<T>(&self, f: impl FnOnce(&CurvedProblem) -> T) -> T {
        let names = self.names();
        f(&CurvedProblem {
            names: &names,
            sources: &self.sources,
            ground: self.ground,
            symmetric: !self.dense,
            max_bytes: u64::MAX,
            by: CurvedBy::Size,
        })
    }

    fn solved_on(&self, mesh: &CurvedMesh, accuracy: f64) -> CurvedSolution {
        self.with(|problem| problem.solve(mesh, accuracy, &|_| ()).unwrap())
    }

    fn solved(&self, accuracy: f64) -> Refined {
        let mesh = self.mesh(1, 0);
        let difference = |fine: &CurvedSolution, coarse: &CurvedSolution| Errors {
            capacitance: apart_by(&fine.totals, &coarse.totals),
            field: 0.0,
        };
        let (patches, owner) = (&mesh.patches, &mesh.electrode);
        self.with(|p| solve_to(p, patches, owner, accuracy, 6000, &difference, &|_| (), &|_| ()).unwrap())
    }
}

/// Largest difference of two matrices against the largest entry.
fn apart_by(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let largest = a.iter().flatten().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / largest
}

fn sphere(radius: f64) -> Shape {
    Shape::Sphere { radius }
}

fn ring(radius: f64, wire_radius: f64) -> Shape {
    Shape::Ring { radius, wire_radius }
}

fn plate(a: f64, b: f64) -> Shape {
    Shape::Plate { size: [a, b], thickness: 0.0 }
}

fn cube() -> Shape {
    Shape::Box { size: [1.0; 3] }
}

fn perforated(size: f64, hole: Hole, thickness: f64) -> Shape {
    let pattern = GridPattern::Perforated { hole, open: 0.6, thickness };
    Shape::GridPlate { outline: Outline::Rectangle([size; 2]), pitch: 1.0, pattern }
}

const Z: [f64; 3] = [0.0, 0.0, 1.0];
