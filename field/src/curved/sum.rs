//! The field of curved elements at points.

use std::sync::Arc;

use meshes::Vec3;
use pulp::Arch;

use super::charge::CurvedCharge;
use super::element::CurvedMesh;
use super::kernel::{Moments, Precision, Whole, near_field};
use super::legendre::Transform;
use crate::gauss::gauss;

/// Points that are summed side by side.
const LANES: usize = 8;

/// Combinations of the charges of curved elements, ready to be summed.
pub(crate) struct CurvedSum {
    mesh: Arc<CurvedMesh>,
    precision: Precision,
    /// Coordinates of the points, padded to whole lanes in every element with points of no charge.
    places: [Vec<f64>; 3],
    /// Charges of the points: `channel * padded points + point`.
    charges: Vec<f64>,
    /// Padded points of an element.
    each: usize,
    /// Legendre coefficients: `element * channels + channel`.
    coefficients: Vec<Moments>,
    elements: Vec<Whole>,
    channels: usize,
    arch: Arch,
}

impl CurvedSum {
    /// Channel c is the combination of basis functions with `weights[c]`.
    pub fn new(charge: &CurvedCharge, weights: &[Arc<[f64]>]) -> Self {
        let mesh = charge.mesh.clone();
        let (order, channels) = (mesh.order, weights.len());
        let (real, each) = (order * order, (order * order).next_multiple_of(LANES));
        let points = mesh.points();
        let mut places = [0, 1, 2].map(|_| vec![0.0; mesh.elements.len() * each]);
        let rule = gauss(order);
        let mut charges = vec![0.0; channels * mesh.elements.len() * each];
        let transform = Transform::new(order);
        let mut coefficients = Vec::with_capacity(mesh.elements.len() * channels);
        for e in 0..mesh.elements.len() {
            for local in 0..each {
                let point = points[e * real + local.min(real - 1)];
                for k in 0..3 {
                    places[k][e * each + local] = point[k];
                }
            }
            for (c, row) in weights.iter().enumerate() {
                for local in 0..real {
                    let weight = rule.weights[local / order] * rule.weights[local % order];
                    let value: f64 = row.iter().enumerate().map(|(f, w)| w * charge.of_element(e, f)[local]).sum();
                    charges[(c * mesh.elements.len() + e) * each + local] = weight * value;
                }
                coefficients.push(charge.combination(e, row, &transform));
            }
        }
        let elements = (0..mesh.elements.len()).map(|e| Whole::new(mesh.patch_of(e), &mesh.elements[e])).collect();
        let precision = Precision::new(order, charge.accuracy);
        Self { mesh, precision, places, charges, each, coefficients, elements, channels, arch: Arch::new() }
    }

    /// Points of all elements, a measure of the work for one point.
    pub fn len(&self) -> usize {
        self.places[0].len()
    }

    /// Potential and gradient of every channel at every point, `(point * channels + channel) * 4`.
    pub fn sum(&self, points: &[Vec3]) -> Vec<f64> {
        let mut sums = vec![[0.0; 4]; points.len() * self.channels];
        for (point, sums) in points.iter().zip(sums.chunks_exact_mut(self.channels)) {
            self.arch.dispatch(|| self.add_all(point, sums));
        }
        sums.into_flattened()
    }

    #[inline(always)]
    fn add_all(&self, point: &Vec3, sums: &mut [[f64; 4]]) {
        let mut e = 0;
        let is_far = |whole: &Whole| (point - whole.ball.center).norm() >= self.precision.far * whole.ball.reach;
        while e < self.elements.len() {
            // A run of far elements goes together.
            let first = e;
            while e < self.elements.len() && is_far(&self.elements[e]) {
                e += 1;
            }
            if e > first {
                self.add_far(point, first * self.each, e * self.each, sums);
            }
            if e < self.elements.len() {
                let of = &self.coefficients[e * self.channels..(e + 1) * self.channels];
                if !self.elements[e].add_field(point, &self.precision, of, sums) {
                    near_field(self.mesh.patch_of(e), &self.mesh.elements[e], point, &self.precision, of, sums);
                }
                e += 1;
            }
        }
    }

    #[inline(always)]
    fn add_far(&self, point: &Vec3, first: usize, last: usize, sums: &mut [[f64; 4]]) {
        let total = self.len();
        let (xs, ys, zs) = (&self.places[0][..last], &self.places[1][..last], &self.places[2][..last]);
        for (c, sum) in sums.iter_mut().enumerate() {
            let q = &self.charges[c * total..c * total + last];
            let mut lanes = [[0.0; LANES]; 4];
            let mut start = first;
            while start < last {
                for b in 0..LANES {
                    let k = start + b;
                    let (x, y, z) = (xs[k] - point.x, ys[k] - point.y, zs[k] - point.z);
                    let square = x * x + y * y + z * z;
                    let value = q[k] / square.sqrt();
                    let cube = value / square;
                    lanes[0][b] += value;
                    lanes[1][b] += cube * x;
                    lanes[2][b] += cube * y;
                    lanes[3][b] += cube * z;
                }
                start += LANES;
            }
            for (s, lanes) in sum.iter_mut().zip(lanes) {
                *s += lanes.iter().sum::<f64>();
            }
        }
    }
}
