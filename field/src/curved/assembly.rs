//! Filling the matrix of a curved mesh: potentials at points for unit charges at points.

use faer::Mat;
use meshes::Vec3;
use pulp::Arch;
use rayon::prelude::*;

use super::element::CurvedMesh;
use super::kernel::{Moments, Precision, Whole, near_moments, own_moments};
use super::legendre::{MAX_ORDER, Transform};
use crate::gauss::gauss;
use crate::plane::Plane;
use crate::symmetry::Symmetry;

/// What all rows of a matrix share.
pub struct Assembly<'a> {
    mesh: &'a CurvedMesh,
    ground: Option<Plane>,
    pub precision: Precision,
    transform: Transform,
    /// Coordinates of all points.
    places: [Vec<f64>; 3],
    /// Weight of each point within its element.
    pub weights: Vec<f64>,
    pub elements: Vec<Whole>,
    pub arch: Arch,
}

impl<'a> Assembly<'a> {
    /// For a relative accuracy of the charge.
    pub fn new(mesh: &'a CurvedMesh, points: &[Vec3], ground: Option<Plane>, accuracy: f64) -> Self {
        let rule = gauss(mesh.order);
        let weights = rule.weights.iter().flat_map(|u| rule.weights.iter().map(move |v| u * v)).collect();
        Self {
            mesh,
            ground,
            precision: Precision::new(mesh.order, accuracy),
            transform: Transform::new(mesh.order),
            places: [0, 1, 2].map(|k| points.iter().map(|p| p[k]).collect()),
            weights,
            elements: (0..mesh.elements.len()).map(|e| Whole::new(mesh.patch_of(e), &mesh.elements[e])).collect(),
            arch: Arch::new(),
        }
    }

    /// Number of points of an element.
    fn each(&self) -> usize {
        self.mesh.order * self.mesh.order
    }

    /// The potential at a point (its number) for a unit of charge per parameter at each point, 1/m: one row of the matrix.
    pub fn row(&self, target: usize, row: &mut [f64]) {
        let x = Vec3::new(self.places[0][target], self.places[1][target], self.places[2][target]);
        self.fill(&x, Some(target), row);
        if let Some(plane) = &self.ground {
            // What images do to a point their charges do to its image.
            let mut images = vec![0.0; row.len()];
            self.fill(&plane.image(&x), None, &mut images);
            for (value, image) in row.iter_mut().zip(images) {
                *value -= image;
            }
        }
    }

    /// The same for a place, which may be one of the points.
    fn fill(&self, x: &Vec3, target: Option<usize>, row: &mut [f64]) {
        self.arch.dispatch(|| {
            for e in 0..self.mesh.elements.len() {
                let ball = &self.elements[e].ball;
                let range = e * self.each()..(e + 1) * self.each();
                if (x - ball.center).norm() >= self.precision.far * ball.reach {
                    self.far(x, range.clone(), &mut row[range]);
                } else {
                    self.near(x, target, e, &mut row[range]);
                }
            }
        });
    }

    #[inline(always)]
    fn far(&self, x: &Vec3, range: std::ops::Range<usize>, row: &mut [f64]) {
        let [xs, ys, zs] = [0, 1, 2].map(|k| &self.places[k][range.clone()]);
        let n = row.len().min(xs.len()).min(ys.len()).min(zs.len()).min(self.weights.len());
        let (row, xs, ys, zs, weights) = (&mut row[..n], &xs[..n], &ys[..n], &zs[..n], &self.weights[..n]);
        for k in 0..n {
            let (a, b, c) = (xs[k] - x.x, ys[k] - x.y, zs[k] - x.z);
            row[k] = weights[k] / (a * a + b * b + c * c).sqrt();
        }
    }

    /// The part of a row that belongs to an element near the place, exactly.
    #[inline(always)]
    pub fn near(&self, x: &Vec3, target: Option<usize>, e: usize, row: &mut [f64]) {
        let (patch, element) = (self.mesh.patch_of(e), &self.mesh.elements[e]);
        let mut moments: Moments = [[0.0; MAX_ORDER]; MAX_ORDER];
        if let Some(target) = target.filter(|target| target / self.each() == e) {
            let local = target % self.each();
            let rule = gauss(self.mesh.order);
            let at = element.parameters(rule.points[local / self.mesh.order], rule.points[local % self.mesh.order]);
            own_moments(patch, element, at, &self.precision, &mut moments);
        } else if !self.elements[e].add_potential(x, &self.precision, &mut moments) {
            near_moments(patch, element, x, &self.precision, &mut moments);
        }
        self.transform.to_points(&moments, row);
    }

    /// The matrices of the sectors of a symmetry, each transposed: column i belongs to point i of the sector's unknowns.
    pub fn matrices(&self, symmetry: &Symmetry, sectors: &[u32], progress: &(dyn Fn(f64) + Sync)) -> Vec<Mat<f64>> {
        let orbits: Vec<_> = sectors.iter().map(|&sector| symmetry.orbits(sector)).collect();
        let mut matrices: Vec<Mat<f64>> =
            orbits.iter().map(|(_, unknowns)| Mat::zeros(unknowns.len(), unknowns.len())).collect();
        // Where the row of a representative goes in each sector.
        let columns: Vec<Vec<Option<u32>>> = orbits
            .iter()
            .map(|(_, unknowns)| {
                let place = |p: &u32| unknowns.binary_search(p).ok().map(|k| k as u32);
                symmetry.representatives.iter().map(place).collect()
            })
            .collect();
        let n = self.places[0].len();
        let done = std::sync::atomic::AtomicUsize::new(0);
        // A block of rows at a time: they are kept until they are stored.
        const BLOCK: usize = 64;
        let representatives = &symmetry.representatives;
        for (block, targets) in representatives.chunks(BLOCK).enumerate() {
            let rows: Vec<Vec<Vec<f64>>> = targets
                .par_iter()
                .map(|&target| {
                    let mut row = vec![0.0; n];
                    self.row(target as usize, &mut row);
                    orbits.iter().map(|(of, unknowns)| Symmetry::folded(&row, of, unknowns.len())).collect()
                })
                .collect();
            for (k, folded) in rows.into_iter().enumerate() {
                for (s, row) in folded.into_iter().enumerate() {
                    if let Some(column) = columns[s][block * BLOCK + k] {
                        matrices[s].col_as_slice_mut(column as usize).copy_from_slice(&row);
                    }
                }
            }
            let finished = done.fetch_add(targets.len(), std::sync::atomic::Ordering::Relaxed) + targets.len();
            progress(finished as f64 / representatives.len() as f64);
        }
        matrices
    }
}
