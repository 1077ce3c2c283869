//! Unit potentials about a point as solid harmonics.

use std::f64::consts::TAU;

use meshes::Vec3;
use nalgebra::Matrix3;

use crate::gauss::gauss;
use crate::harmonics::{Harmonics, coefficients, derivative_weights};
use crate::{BasisField, Samples};

/// All channels about a centre: as long as the ball is free of charges the expansion is the field.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// m.
    pub center: Vec3,
    /// Radius of the sphere on which the field was asked for, m.
    pub radius: f64,
    /// Largest degree.
    pub degree: usize,
    /// Coefficients of each channel, as [`crate::harmonics`] orders them, in units of the radius.
    pub channels: Vec<Vec<f64>>,
}

/// A potential and its derivatives at a point.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    /// V.
    pub value: f64,
    /// V/m.
    pub gradient: Vec3,
    /// V/m².
    pub hessian: Matrix3<f64>,
    /// ∂³/∂x_i∂x_j∂x_k, `[i]` of it a matrix over j and k, V/m³.
    pub third: [Matrix3<f64>; 3],
}

/// Coefficients of every channel from potentials on a sphere: `nodes` Gauss points in the polar angle and twice as many equal
/// steps of azimuth.
///
///   L_l^m = (2l + 1) (l + m)! (l - m)! < R_l^m φ >,  < > the mean over the sphere
///
/// Degrees up to `degree` are free of each other; degree l takes in what the potential has of degrees from 2 `nodes` - l on.
/// Source: orthogonality of the harmonics (Dehnen 2014, whose normalisation this is). Checked by
/// `an_expansion_of_a_point_charge_is_exact`.
pub(crate) fn on_sphere(
    field: &dyn BasisField,
    center: &Vec3,
    frame: &[Vec3; 3],
    radius: f64,
    degree: usize,
    nodes: usize,
) -> Vec<Vec<f64>> {
    let rule = gauss(nodes);
    let around = 2 * nodes;
    let mut directions = Vec::with_capacity(nodes * around);
    for (u, weight) in rule.points.iter().zip(&rule.weights) {
        let cos = 2.0 * u - 1.0;
        let sin = (1.0 - cos * cos).sqrt();
        for k in 0..around {
            // Half a step beside the frame's planes: a mirror of the trap then does not put all points on edges of panels.
            let (s, c) = (TAU * (k as f64 + 0.5) / around as f64).sin_cos();
            directions.push((Vec3::new(sin * c, sin * s, cos), weight / around as f64));
        }
    }
    let place = |d: &Vec3| center + (frame[0] * d.x + frame[1] * d.y + frame[2] * d.z) * radius;
    let points: Vec<Vec3> = directions.iter().map(|(d, _)| place(d)).collect();
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let channels = field.channels();
    let mut sums = vec![vec![0.0; coefficients(degree)]; channels];
    for (p, (direction, weight)) in directions.iter().enumerate() {
        let harmonics = Harmonics::regular(direction, degree).value_weights();
        for (c, sums) in sums.iter_mut().enumerate() {
            let share = weight * samples.potential[p * channels + c];
            for (sum, harmonic) in sums.iter_mut().zip(&harmonics) {
                *sum += share * harmonic;
            }
        }
    }
    let factors = normalisation(degree);
    for sums in &mut sums {
        sums.iter_mut().zip(&factors).for_each(|(sum, factor)| *sum *= factor);
    }
    sums
}

/// (2l + 1) (l + m)! (l - m)!, half of it for m > 0 whose weights are doubled.
fn normalisation(degree: usize) -> Vec<f64> {
    let mut factors = Vec::with_capacity(coefficients(degree));
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    for l in 0..=degree {
        let factor = |m: usize| (2 * l + 1) as f64 * factorial(l + m) * factorial(l - m);
        factors.push(factor(0));
        for m in 1..=l {
            factors.extend([0.5 * factor(m); 2]);
        }
    }
    factors
}

const FRAME: [Vec3; 3] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];

/// Radius of the ball of an [`Expansion::near`] as a fraction of the room, with its degree and Gauss points: what is left out,
/// of degree 9, is below 0.15^9 = 4e-8 of the potential at the edge of the ball, and third derivatives at the centre lose
/// 0.15^14 = 3e-12 to aliasing (degree 17 and up into 3) and 1e-15 / 0.15³ = 3e-13 to rounding.
const NEAR: (f64, usize, usize) = (0.15, 8, 10);

impl Expansion {
    /// Of degree `degree`, from a sphere of that radius (m).
    pub fn new(field: &dyn BasisField, center: Vec3, radius: f64, degree: usize, nodes: usize) -> Self {
        let channels = on_sphere(field, &center, &FRAME, radius, degree, nodes);
        Self { center, radius, degree, channels }
    }

    /// For derivatives close to a point with that much room (m).
    pub fn near(field: &dyn BasisField, center: Vec3, room: f64) -> Self {
        let (fraction, degree, nodes) = NEAR;
        Self::new(field, center, fraction * room, degree, nodes)
    }

    /// Slope and second derivatives of every channel at a point: what motion close to it needs, in half the time of
    /// [`Expansion::jets`].
    pub fn slopes(&self, point: &Vec3) -> Vec<(Vec3, Matrix3<f64>)> {
        let at = (point - self.center) / self.radius;
        let weights = |order: [usize; 3]| derivative_weights(&at, self.degree, order);
        let first = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(weights);
        let second = [[2, 0, 0], [1, 1, 0], [1, 0, 1], [0, 2, 0], [0, 1, 1], [0, 0, 2]].map(weights);
        let s = self.radius;
        let of = |channel: &Vec<f64>| {
            let dot = |w: &Vec<f64>| w.iter().zip(channel).map(|(a, b)| a * b).sum::<f64>();
            let [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map(|k: usize| dot(&second[k]) / (s * s));
            (Vec3::from_fn(|i, _| dot(&first[i]) / s), Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
        };
        self.channels.iter().map(of).collect()
    }

    /// Derivatives of every channel at a point.
    pub fn jets(&self, point: &Vec3) -> Vec<Jet> {
        let at = (point - self.center) / self.radius;
        let weights = |order: [usize; 3]| derivative_weights(&at, self.degree, order);
        let unit = |k: usize| -> [usize; 3] { std::array::from_fn(|j| usize::from(j == k)) };
        let plus = |a: [usize; 3], b: [usize; 3]| -> [usize; 3] { std::array::from_fn(|j| a[j] + b[j]) };
        let value = weights([0; 3]);
        let first: Vec<_> = (0..3).map(|i| weights(unit(i))).collect();
        let mut pairs = Vec::new();
        let mut triples = Vec::new();
        for i in 0..3 {
            for j in i..3 {
                pairs.push(([i, j], weights(plus(unit(i), unit(j)))));
                for k in j..3 {
                    triples.push(([i, j, k], weights(plus(plus(unit(i), unit(j)), unit(k)))));
                }
            }
        }
        let s = self.radius;
        self.channels
            .iter()
            .map(|channel| {
                let dot = |w: &[f64]| w.iter().zip(channel).map(|(a, b)| a * b).sum::<f64>();
                let mut hessian = Matrix3::zeros();
                for ([i, j], w) in &pairs {
                    let entry = dot(w) / (s * s);
                    (hessian[(*i, *j)], hessian[(*j, *i)]) = (entry, entry);
                }
                let mut third = [Matrix3::zeros(); 3];
                for ([i, j, k], w) in &triples {
                    let entry = dot(w) / (s * s * s);
                    for [a, b, c] in [[i, j, k], [i, k, j], [j, i, k], [j, k, i], [k, i, j], [k, j, i]] {
                        third[*a][(*b, *c)] = entry;
                    }
                }
                let gradient = Vec3::from_fn(|i, _| dot(&first[i]) / s);
                Jet { value: dot(&value), gradient, hessian, third }
            })
            .collect()
    }
}

impl BasisField for Expansion {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    /// As exact as the field while points are well within the ball.
    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.channels.len();
        samples.reset(points.len(), n);
        for (p, point) in points.iter().enumerate() {
            let at = (point - self.center) / self.radius;
            let weights = Harmonics::regular(&at, self.degree).value_weights();
            let slopes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|order| derivative_weights(&at, self.degree, order));
            for (c, channel) in self.channels.iter().enumerate() {
                let dot = |w: &[f64]| w.iter().zip(channel).map(|(a, b)| a * b).sum::<f64>();
                samples.potential[p * n + c] = dot(&weights);
                samples.gradient[p * n + c] = Vec3::from_fn(|k, _| dot(&slopes[k]) / self.radius);
            }
        }
    }
}

impl Jet {
    /// A combination.
    pub fn sum(jets: &[Self], weights: &[f64]) -> Self {
        let mut sum =
            Self { value: 0.0, gradient: Vec3::zeros(), hessian: Matrix3::zeros(), third: [Matrix3::zeros(); 3] };
        for (jet, w) in jets.iter().zip(weights) {
            sum.value += w * jet.value;
            sum.gradient += jet.gradient * *w;
            sum.hessian += jet.hessian * *w;
            for k in 0..3 {
                sum.third[k] += jet.third[k] * *w;
            }
        }
        sum
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Point charges, each a channel: φ = 1/|r - c|.
    pub(crate) struct Charges(pub Vec<Vec3>);

    impl BasisField for Charges {
        fn channels(&self) -> usize {
            self.0.len()
        }

        fn sample(&self, points: &[Vec3], samples: &mut Samples) {
            let n = self.0.len();
            samples.reset(points.len(), n);
            for (p, point) in points.iter().enumerate() {
                for (c, place) in self.0.iter().enumerate() {
                    let d = point - place;
                    samples.potential[p * n + c] = 1.0 / d.norm();
                    samples.gradient[p * n + c] = -d / d.norm().powi(3);
                }
            }
        }
    }

    #[test]
    fn an_expansion_of_a_point_charge_is_exact() {
        let place = Vec3::new(0.6, -0.7, 0.9);
        let field = Charges(vec![place, -place]);
        let expansion = Expansion::near(&field, Vec3::new(0.05, 0.0, -0.02), 1.0);
        let (mut got, mut exact) = (Samples::default(), Samples::default());
        for x in [Vec3::new(0.05, 0.0, -0.02), Vec3::new(0.07, 0.02, 0.0)] {
            expansion.sample(&[x], &mut got);
            field.sample(&[x], &mut exact);
            let jets = expansion.jets(&x);
            for (c, jet) in jets.iter().enumerate() {
                // A fifth of the ball: 0.03^9 of the potential, times 9 / 0.03 for its slope.
                assert!((got.potential[c] - exact.potential[c]).abs() < 1e-12);
                assert!((got.gradient[c] - exact.gradient[c]).norm() < 1e-10);
                assert!((jet.gradient - exact.gradient[c]).norm() < 1e-10);
                let d = x - field.0[c];
                let r = d.norm();
                let hessian = d * d.transpose() * (3.0 / r.powi(5)) - Matrix3::identity() / r.powi(3);
                assert!((jet.hessian - hessian).norm() < 1e-8, "{}", jet.hessian - hessian);
                assert!(jet.hessian.trace().abs() < 1e-12);
                let (slope, bend) = expansion.slopes(&x)[c];
                assert!((slope - jet.gradient).norm() < 1e-13 && (bend - jet.hessian).norm() < 1e-12);
                // ∂³(1/r) = -15 ddd/r⁷ + 3 (d δ + ...)/r⁵.
                for i in 0..3 {
                    for j in 0..3 {
                        for k in 0..3 {
                            let delta = |a: usize, b: usize| f64::from(u8::from(a == b));
                            let pairs = d[i] * delta(j, k) + d[j] * delta(i, k) + d[k] * delta(i, j);
                            let third = 3.0 * pairs / r.powi(5) - 15.0 * d[i] * d[j] * d[k] / r.powi(7);
                            assert!((jet.third[i][(j, k)] - third).abs() < 1e-6);
                        }
                    }
                }
            }
        }
    }
}
