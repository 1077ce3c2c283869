//! What charged points do to the electrodes: the charges they induce, and the field of these back at the points.
//!
//! Points with charges q_j at x_j induce σ = -S aᵀ q on the panels, where a_jp is the potential at x_j of panel p with unit
//! charge and S is the inverse of the matrix of potential coefficients P. (By reciprocity a_jp is also the mean over panel p of the
//! potential of a unit charge at x_j: Galerkin's right-hand side.) Their energy
//!
//!   W = -½ k qᵀ a S aᵀ q
//!
//! has the force q_j E(x_j) as its exact gradient, E the field of σ held where it is. On a floating electrode σ sums to zero:
//!
//!   S = P⁻¹ - P⁻¹ F (Fᵀ P⁻¹ F)⁻¹ Fᵀ P⁻¹,
//!
//! a column of F for each floating electrode, one on its panels. Checked against the image charges of sphere and plane by
//! `sphere_attracts_as_its_image_charge` and `plane_attracts_as_its_image_charge`.

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Mat, Side};
use meshes::{SurfaceMesh, Vec3};
use rayon::prelude::*;

use crate::boundary_problem::SolveError;
use crate::constants::COULOMB;
use crate::influence::{Testing, potential_coefficients_telling};
use crate::panel::Panel;
use crate::plane::Plane;

/// The electrodes as they answer to charges nearby, all at fixed voltages or floating.
///
/// The induced charge is constant on each panel: the potential a panel's width off the surface errs by some hundredths, ever
/// more below that, and beyond it as that of a solution with as many panels.
#[derive(Clone, Debug)]
pub struct Induction {
    panels: Vec<Panel>,
    images: Option<Vec<Panel>>,
    ground: Option<Plane>,
    /// S, 1/(1/m), row by row. Symmetric to the last bit, so that the force is the gradient of the energy; single numbers,
    /// whose rounding is far below the error of the panels.
    inverse: Vec<f32>,
}

/// No grain is smaller, m.
const SMALLEST: f64 = 1e-9;

impl Induction {
    /// Inverts the matrix of the panels, with `floating` for each electrode.
    ///
    /// # Errors
    /// The matrix is not positive definite: panels lie on each other.
    ///
    /// # Panics
    /// Another number of electrodes than of flags.
    pub fn new(mesh: &SurfaceMesh, ground: Option<Plane>, floating: &[bool]) -> Result<Self, SolveError> {
        assert_eq!(floating.len(), mesh.electrodes.len(), "a flag for each electrode");
        let panels: Vec<Panel> = (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect();
        let images: Option<Vec<Panel>> =
            ground.map(|plane| panels.iter().map(|panel| plane.image_of_panel(panel)).collect());
        let n = panels.len();
        if n == 0 {
            return Ok(Self { panels, images, ground, inverse: Vec::new() });
        }
        let matrix = potential_coefficients_telling(&panels, images.as_deref(), Testing::Galerkin, &|_| ());
        let factors = matrix
            .llt(Side::Lower)
            .map_err(|_| SolveError::NotPositiveDefinite { panel: 0, electrode: mesh.electrodes[0].name.clone() })?;
        let mut inverse = factors.inverse();
        let free: Vec<usize> = (0..floating.len()).filter(|&e| floating[e]).collect();
        if !free.is_empty() {
            let on = Mat::from_fn(n, free.len(), |p, f| f64::from(u8::from(mesh.electrode[p] as usize == free[f])));
            let charges = &inverse * &on;
            let sums = on.transpose() * &charges;
            inverse -= &charges * sums.partial_piv_lu().solve(charges.transpose());
        }
        let entry = |i: usize, j: usize| inverse[(i.max(j), i.min(j))] as f32;
        let inverse = (0..n * n).into_par_iter().map(|k| entry(k / n, k % n)).collect();
        Ok(Self { panels, images, ground, inverse })
    }

    /// Bytes needed at the peak for so many panels.
    pub fn memory_needed(panels: usize) -> u64 {
        let n = panels as u64;
        28 * n * n
    }

    /// Number of panels.
    pub fn panels(&self) -> usize {
        self.panels.len()
    }

    /// Potential (V) and its gradient (V/m) at each of some charged points, of the charges that all of them together induce.
    /// The same bits with any number of threads.
    ///
    /// A point charge falls without end into its image in a plane; `radii` (m) say how near the middle of a grain comes: the
    /// square of the distance from an image is larger by that of both radii, but for a grain far smaller than its height nothing
    /// is changed by that.
    ///
    /// # Panics
    /// Another number of charges (C) or of radii than of points.
    pub fn sample(&self, points: &[Vec3], charges: &[f64], radii: &[f64]) -> Vec<(f64, Vec3)> {
        assert!(points.len() == charges.len() && points.len() == radii.len(), "a charge and a radius for each point");
        let n = self.panels.len();
        let at: Vec<Vec<(f64, Vec3)>> = points.par_iter().map(|x| (0..n).map(|p| self.unit(p, x)).collect()).collect();
        let seen: Vec<f64> =
            (0..n).into_par_iter().map(|p| at.iter().zip(charges).map(|(at, q)| q * at[p].0).sum()).collect();
        let induced: Vec<f64> = self
            .inverse
            .par_chunks_exact(n.max(1))
            .map(|row| -row.iter().zip(&seen).map(|(s, b)| f64::from(*s) * b).sum::<f64>())
            .collect();
        let of_panels = at.into_par_iter().zip(points).zip(radii).map(|((at, x), radius)| {
            let (mut potential, mut gradient) = (0.0, Vec3::zeros());
            for ((p, g), q) in at.iter().zip(&induced) {
                potential += q * p;
                gradient += g * *q;
            }
            if let Some(plane) = &self.ground {
                for ((y, q), other) in points.iter().zip(charges).zip(radii) {
                    let arm = x - plane.image(y);
                    let distance = arm.norm().hypot(radius.max(SMALLEST) + other.max(SMALLEST));
                    potential -= q / distance;
                    gradient += arm * (q / distance.powi(3));
                }
            }
            (COULOMB * potential, COULOMB * gradient)
        });
        of_panels.collect()
    }

    /// Potential and gradient over Coulomb's constant of a unit charge on a panel, with that of its image.
    fn unit(&self, panel: usize, x: &Vec3) -> (f64, Vec3) {
        let of = |panel: &Panel| {
            let (potential, gradient) = panel.potential_and_gradient(x);
            (potential / panel.area, gradient / panel.area)
        };
        let (potential, gradient) = of(&self.panels[panel]);
        match &self.images {
            None => (potential, gradient),
            Some(images) => {
                let image = of(&images[panel]);
                (potential - image.0, gradient - image.1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::{Placement, Shape, triangulate_to};

    fn sphere(panels: usize, height: f64) -> SurfaceMesh {
        let (mesh, _) = triangulate_to(&Shape::Sphere { radius: 1.0 }, panels).unwrap();
        let placement = Placement { center: Vec3::new(0.0, 0.0, height), ..Placement::default() };
        SurfaceMesh::assemble([("ball".to_owned(), mesh.placed(&placement).unwrap())])
    }

    /// Maxwell, art. 155: the image -q R/D at R²/D, and on an isolated sphere its opposite in the middle.
    #[test]
    fn sphere_attracts_as_its_image_charge() {
        let q = 1e-12;
        for floating in [false, true] {
            let mut worst = Vec::new();
            for panels in [450, 1800] {
                let induction = Induction::new(&sphere(panels, 0.0), None, &[floating]).unwrap();
                let errors: Vec<f64> = [1.3_f64, 2.0, 5.0]
                    .into_iter()
                    .map(|d| {
                        let point = Vec3::new(0.3, -0.5, 0.8).normalize() * d;
                        let (potential, gradient) = induction.sample(&[point], &[q], &[0.0])[0];
                        let free = f64::from(u8::from(floating));
                        let exact = COULOMB * q * (-1.0 / (d * d - 1.0) + free / (d * d));
                        let force = COULOMB * q * (d / (d * d - 1.0).powi(2) - free / d.powi(3));
                        let along = gradient.dot(&point.normalize());
                        assert!((gradient - point.normalize() * along).norm() < 1e-2 * force);
                        (potential / exact - 1.0).abs().max((along / force - 1.0).abs())
                    })
                    .collect();
                println!("floating {floating}, {panels} panels: {errors:?}");
                worst.push(errors);
            }
            // With four times the panels (of area h², 0.17 and 0.084) a quarter of the error, where a panel is not as wide as
            // the gap.
            assert!(worst[1][0] < 1e-2 && worst[1][1] < 3e-3 && worst[1][2] < 3e-3, "{worst:?}");
            assert!(worst[1][1] < 0.4 * worst[0][1], "{worst:?}");
        }
    }

    #[test]
    fn plane_attracts_as_its_image_charge() {
        let plane = Plane { point: Vec3::zeros(), normal: Vec3::z() };
        let none = SurfaceMesh::assemble([]);
        let induction = Induction::new(&none, Some(plane), &[]).unwrap();
        let (points, charges) = ([Vec3::new(0.1, 0.0, 0.5), Vec3::new(0.4, 0.2, 0.9)], [2e-12, -1e-12]);
        let found = induction.sample(&points, &charges, &[0.0; 2]);
        for (j, (potential, gradient)) in found.iter().enumerate() {
            let (mut p, mut g) = (0.0, Vec3::zeros());
            for (y, q) in points.iter().zip(&charges) {
                let arm = points[j] - Vec3::new(y.x, y.y, -y.z);
                p -= COULOMB * q / arm.norm();
                g += COULOMB * q * arm / arm.norm().powi(3);
            }
            assert!((potential - p).abs() < 1e-14 * p.abs() && (gradient - g).norm() < 1e-14 * g.norm());
        }
    }

    /// The force is the gradient of the energy to the error of differences, also beside a plane and with two points.
    #[test]
    fn force_is_the_gradient_of_the_energy() {
        let plane = Plane { point: Vec3::zeros(), normal: Vec3::z() };
        for floating in [false, true] {
            let induction = Induction::new(&sphere(300, 2.0), Some(plane), &[floating]).unwrap();
            let (points, charges) = ([Vec3::new(1.6, 0.2, 1.4), Vec3::new(-0.3, 0.4, 3.5)], [3e-12, -2e-12]);
            let energy = |points: &[Vec3]| -> f64 {
                induction.sample(points, &charges, &[0.0; 2]).iter().zip(&charges).map(|((p, _), q)| 0.5 * p * q).sum()
            };
            let found = induction.sample(&points, &charges, &[0.0; 2]);
            for j in 0..2 {
                let force = found[j].1 * -charges[j];
                for axis in 0..3 {
                    let step = 1e-4;
                    let moved = |by: f64| {
                        let mut points = points;
                        points[j][axis] += by;
                        energy(&points)
                    };
                    let slope =
                        (8.0 * (moved(step) - moved(-step)) - (moved(2.0 * step) - moved(-2.0 * step))) / (12.0 * step);
                    assert!((slope + force[axis]).abs() < 1e-8 * force.norm(), "{j} {axis}: {slope} {}", force[axis]);
                }
            }
        }
    }
}
