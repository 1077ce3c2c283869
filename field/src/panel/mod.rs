//! One triangle with a uniform charge: the building block of every field here.
//!
//! Three ways to its potential judge each other: the closed form ([`Panel::potential_and_gradient`]), Gauss quadrature
//! ([`quadrature::potential_and_gradient`]) and brute force ([`brute_force::potential_and_gradient`]).
//!
//! All of them are for charge density 1 and Coulomb's constant 1: potentials are ∫ dS / |x - y|, in metres.

pub mod brute_force;
mod closed_form;
pub mod quadrature;

use meshes::Vec3;

/// A triangle with what its integrals need again and again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panel {
    /// Corners, m, counter-clockwise seen from outside.
    pub corners: [Vec3; 3],
    /// Outward unit normal.
    pub normal: Vec3,
    /// m².
    pub area: f64,
    /// m.
    pub centroid: Vec3,
    /// Largest distance of a corner from the centroid, m.
    pub radius: f64,
    /// Second moments about the centroid, ∫ (y - c)(y - c)ᵀ dS / area, m²: xx, yy, zz, xy, xz, yz.
    pub moments: [f64; 6],
}

impl Panel {
    /// A panel from its corners, which must not lie on one line.
    pub fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let area_vector = (b - a).cross(&(c - a)) * 0.5;
        let area = area_vector.norm();
        let centroid = (a + b + c) / 3.0;
        let arms = corners.map(|v| v - centroid);
        // ∫ λi λj over a triangle is area/12 off the diagonal and area/6 on it; the corners sum to zero about the centroid.
        let moment = |i: usize, j: usize| arms.iter().map(|d| d[i] * d[j]).sum::<f64>() / 12.0;
        Self {
            corners,
            normal: area_vector / area,
            area,
            centroid,
            radius: arms.iter().map(|d| d.norm()).fold(0.0, f64::max),
            moments: [moment(0, 0), moment(1, 1), moment(2, 2), moment(0, 1), moment(0, 2), moment(1, 2)],
        }
    }
}
