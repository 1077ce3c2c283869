//! Integrals of 1/r over parts of elements.

use meshes::{Patch, Vec3};

use super::element::{Ball, Element};
use super::legendre::{MAX_ORDER, legendre};
use crate::gauss::gauss;

/// Integrals against products of Legendre polynomials.
pub type Moments = [[f64; MAX_ORDER]; MAX_ORDER];

/// How exactly elements are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// A rectangle is integrated by 16 × 16 points when the point is this many times its reach from its middle.
    pub accept: f64,
    /// From here on 8 × 8 points do.
    pub fewer: f64,
    /// An element counts by its own points when the point is this many times its reach away.
    pub far: f64,
    /// Points of the singular rule: outwards and across its triangles.
    pub singular: [usize; 2],
}

impl Precision {
    /// For charges of some order whose own error is about `accuracy`, relative: an integral's error is a twentieth of it.
    ///
    /// A Gauss rule of n points leaves ρ^-(2n - order + 1) of a charge of that order, where ρ = d + √(d² - 1) for a point d
    /// reaches away (Davis and Rabinowitz 1984, 4.6); an element's own points leave ρ^-(order + 2).
    pub fn new(order: usize, accuracy: f64) -> Self {
        let wanted = 0.05 * accuracy.clamp(1e-12, 1.0);
        let distance = |power: usize| {
            let rho = wanted.powf(-1.0 / power as f64);
            0.5 * (rho + 1.0 / rho)
        };
        let accept = distance(33 - order).clamp(1.05, 3.0);
        let fewer = distance(17 - order).max(accept);
        let far = distance(order + 2).max(fewer);
        let singular = if wanted > 1e-6 { [6, 8] } else { [8, 12] };
        let singular = if wanted < 1e-9 { [10, 16] } else { singular };
        Self { accept, fewer, far, singular }
    }
}

/// A tensor grid of Gauss points on a rectangle of a patch.
#[derive(Clone)]
pub struct Tensor<const N: usize> {
    s: [f64; N],
    c: [f64; N],
    base: [[f64; N]; 3],
    step: [[f64; N]; 3],
    direction: Vec3,
    /// Local parameters of the element.
    x: [f64; N],
    y: [f64; N],
    /// Area of the rectangle in local parameters of the element.
    share: f64,
}

impl<const N: usize> Tensor<N> {
    /// On a rectangle of an element.
    #[inline(always)]
    pub fn new(patch: &Patch, element: &Element, low: [f64; 2], high: [f64; 2]) -> Self {
        let rule = gauss(N);
        let mut tensor = Self {
            s: [0.0; N],
            c: [0.0; N],
            base: [[0.0; N]; 3],
            step: [[0.0; N]; 3],
            direction: patch.direction(),
            x: [0.0; N],
            y: [0.0; N],
            share: 1.0,
        };
        let width = |k: usize| element.high[k] - element.low[k];
        for (a, x) in rule.points.iter().enumerate() {
            let xi = low[0] + x * (high[0] - low[0]);
            let eta = low[1] + x * (high[1] - low[1]);
            let [s, c] = patch.row(xi);
            let column = patch.column(eta);
            tensor.s[a] = s;
            tensor.c[a] = c;
            for k in 0..3 {
                tensor.base[k][a] = column.base[k];
                tensor.step[k][a] = column.step[k];
            }
            tensor.x[a] = (xi - element.low[0]) / width(0);
            tensor.y[a] = (eta - element.low[1]) / width(1);
        }
        tensor.share = (high[0] - low[0]) / width(0) * ((high[1] - low[1]) / width(1));
        tensor
    }

    /// Adds the integrals of Legendre products over 1/r.
    #[inline(always)]
    pub fn add_potential(&self, point: &Vec3, moments: &mut Moments) {
        let weights: &[f64; N] = gauss(N).weights.as_slice().try_into().unwrap_or(&[0.0; N]);
        let pv: [[f64; MAX_ORDER]; N] = std::array::from_fn(|b| legendre(self.y[b]));
        for a in 0..N {
            let s = self.s[a];
            let shift = self.direction * self.c[a] - point;
            let mut k = [0.0; N];
            for b in 0..N {
                let x = self.base[0][b] + s * self.step[0][b] + shift.x;
                let y = self.base[1][b] + s * self.step[1][b] + shift.y;
                let z = self.base[2][b] + s * self.step[2][b] + shift.z;
                k[b] = weights[b] / (x * x + y * y + z * z).sqrt();
            }
            let mut row = [0.0; MAX_ORDER];
            for b in 0..N {
                for j in 0..MAX_ORDER {
                    row[j] += k[b] * pv[b][j];
                }
            }
            let pu = legendre(self.x[a]);
            let factor = weights[a] * self.share;
            for i in 0..MAX_ORDER {
                for j in 0..MAX_ORDER {
                    moments[i][j] += factor * pu[i] * row[j];
                }
            }
        }
    }

    /// Adds potential and gradient of a charge with these coefficients.
    #[inline(always)]
    pub fn add_field(&self, point: &Vec3, charges: &[Moments], sums: &mut [[f64; 4]]) {
        let weights: &[f64; N] = gauss(N).weights.as_slice().try_into().unwrap_or(&[0.0; N]);
        // Transposed, so that the points of a row stand side by side.
        let mut pv = [[1.0; N]; MAX_ORDER];
        for b in 0..N {
            let p = legendre(self.y[b]);
            for j in 0..MAX_ORDER {
                pv[j][b] = p[j];
            }
        }
        let mut kernel = [[[0.0; N]; 4]; N];
        for a in 0..N {
            let s = self.s[a];
            let shift = self.direction * self.c[a] - point;
            for b in 0..N {
                let x = self.base[0][b] + s * self.step[0][b] + shift.x;
                let y = self.base[1][b] + s * self.step[1][b] + shift.y;
                let z = self.base[2][b] + s * self.step[2][b] + shift.z;
                let square = x * x + y * y + z * z;
                let inverse = weights[a] * weights[b] * self.share / square.sqrt();
                let cube = inverse / square;
                kernel[a][0][b] = inverse;
                kernel[a][1][b] = cube * x;
                kernel[a][2][b] = cube * y;
                kernel[a][3][b] = cube * z;
            }
        }
        for (charge, sum) in charges.iter().zip(sums) {
            let mut total = [[0.0; N]; 4];
            for a in 0..N {
                let pu = legendre(self.x[a]);
                let mut along = [0.0; MAX_ORDER];
                for i in 0..MAX_ORDER {
                    for j in 0..MAX_ORDER {
                        along[j] += pu[i] * charge[i][j];
                    }
                }
                let mut q = [0.0; N];
                for j in 0..MAX_ORDER {
                    for b in 0..N {
                        q[b] += along[j] * pv[j][b];
                    }
                }
                for k in 0..4 {
                    for b in 0..N {
                        total[k][b] += q[b] * kernel[a][k][b];
                    }
                }
            }
            for (s, lanes) in sum.iter_mut().zip(total) {
                *s += lanes.iter().sum::<f64>();
            }
        }
    }
}

/// Rectangles of an element still to be integrated.
type Rectangles = Vec<([f64; 2], [f64; 2])>;

/// Deepest division of an element in halves: a point nearer to the surface than 2^-25 of an element's size counts as on it.
const DEEPEST: f64 = 1.0 / ((1_u64 << 26) as f64);

/// Walks over rectangles of an element that are small against their distance from a point, and says whether few points do.
#[inline(always)]
fn divide(
    patch: &Patch,
    element: &Element,
    pending: &mut Rectangles,
    point: &Vec3,
    precision: &Precision,
    mut integrate: impl FnMut([f64; 2], [f64; 2], bool),
) {
    let least = [0, 1].map(|k| DEEPEST * (element.high[k] - element.low[k]));
    while let Some((low, high)) = pending.pop() {
        let ball = Ball::new(patch, low, high);
        let distance = (point - ball.center).norm();
        let smallest = (0..2).all(|k| high[k] - low[k] < least[k]);
        if smallest || distance >= precision.accept * ball.reach {
            integrate(low, high, distance >= precision.fewer * ball.reach);
            continue;
        }
        let k = usize::from(ball.sides[1] > ball.sides[0]);
        let (mut first, mut last) = (high, low);
        first[k] = 0.5 * (low[k] + high[k]);
        last[k] = first[k];
        pending.push((low, first));
        pending.push((last, high));
    }
}

/// Integrals of the Legendre products of an element over 1/r from a point off the element, near it.
#[inline(always)]
pub fn near_moments(patch: &Patch, element: &Element, point: &Vec3, precision: &Precision, moments: &mut Moments) {
    let mut pending = element.halves_of_longer_side(patch).to_vec();
    rest(patch, element, &mut pending, point, precision, moments);
}

#[inline(always)]
fn rest(
    patch: &Patch,
    element: &Element,
    pending: &mut Rectangles,
    point: &Vec3,
    precision: &Precision,
    moments: &mut Moments,
) {
    divide(patch, element, pending, point, precision, |low, high, few| {
        if few {
            Tensor::<8>::new(patch, element, low, high).add_potential(point, moments);
        } else {
            Tensor::<16>::new(patch, element, low, high).add_potential(point, moments);
        }
    });
}

/// Part of the way from the point to the nearest side of its element that the singular rule reaches.
const REACH: f64 = 0.75;

/// The same from a point of the element, at these parameters of the patch.
///
/// A rectangle about the point, as wide as high in space, is cut into four triangles with their tip at the point, where
/// ξ = ξ0 + s a, η = η0 + s b t takes away the singularity (Duffy 1982); the rest of the element is integrated as from outside.
#[inline(always)]
pub fn own_moments(patch: &Patch, element: &Element, at: [f64; 2], precision: &Precision, moments: &mut Moments) {
    let point = patch.at(at[0], at[1]);
    let tangents = patch.tangents(at[0], at[1]);
    let room = [0, 1].map(|k| REACH * (at[k] - element.low[k]).min(element.high[k] - at[k]));
    let lengths = [0, 1].map(|k| tangents[k].norm() * room[k]);
    let shorter = lengths[0].min(lengths[1]);
    let half = [0, 1].map(|k| room[k] * shorter / lengths[k]);
    let width = [0, 1].map(|k| element.high[k] - element.low[k]);
    let (out, across) = (gauss(precision.singular[0]), gauss(precision.singular[1]));
    let e = patch.direction();
    for along in 0..2 {
        let other = 1 - along;
        for sign in [-1.0, 1.0] {
            for (s, ws) in out.points.iter().zip(&out.weights) {
                for (t, wt) in across.points.iter().zip(&across.weights) {
                    let mut here = at;
                    here[along] += sign * s * half[along];
                    here[other] += s * (2.0 * t - 1.0) * half[other];
                    let ([row_s, row_c], column) = (patch.row(here[0]), patch.column(here[1]));
                    let r = (column.base + column.step * row_s + e * row_c - point).norm();
                    let weight = ws * wt * 2.0 * s * half[0] * half[1] / (width[0] * width[1] * r);
                    let pu = legendre((here[0] - element.low[0]) / width[0]);
                    let pv = legendre((here[1] - element.low[1]) / width[1]);
                    for i in 0..MAX_ORDER {
                        for j in 0..MAX_ORDER {
                            moments[i][j] += weight * pu[i] * pv[j];
                        }
                    }
                }
            }
        }
    }
    let (low, high) = (element.low, element.high);
    let (left, right) = ([at[0] - half[0], at[1] - half[1]], [at[0] + half[0], at[1] + half[1]]);
    let mut pending = vec![
        (low, [left[0], high[1]]),
        ([right[0], low[1]], high),
        ([left[0], low[1]], [right[0], left[1]]),
        ([left[0], right[1]], [right[0], high[1]]),
    ];
    rest(patch, element, &mut pending, &point, precision, moments);
}

/// Adds potential and gradient, `[φ, ∂x φ, ∂y φ, ∂z φ]` over Coulomb's constant, of an element's charges at a point near it.
#[inline(always)]
pub fn near_field(
    patch: &Patch,
    element: &Element,
    point: &Vec3,
    precision: &Precision,
    charges: &[Moments],
    sums: &mut [[f64; 4]],
) {
    let mut pending = element.halves_of_longer_side(patch).to_vec();
    divide(patch, element, &mut pending, point, precision, |low, high, few| {
        if few {
            Tensor::<8>::new(patch, element, low, high).add_field(point, charges, sums);
        } else {
            Tensor::<16>::new(patch, element, low, high).add_field(point, charges, sums);
        }
    });
}

/// An element as a whole, ready to be integrated again and again from points at some distance.
#[derive(Clone)]
pub struct Whole {
    /// Middle and reach.
    pub ball: Ball,
    few: Tensor<8>,
    many: Tensor<16>,
}

impl Whole {
    /// Of an element.
    pub fn new(patch: &Patch, element: &Element) -> Self {
        let (low, high) = (element.low, element.high);
        Self {
            ball: Ball::new(patch, low, high),
            few: Tensor::new(patch, element, low, high),
            many: Tensor::new(patch, element, low, high),
        }
    }

    /// Adds the integrals of Legendre products over 1/r, and says whether the point was far enough for that.
    #[inline(always)]
    pub fn add_potential(&self, point: &Vec3, precision: &Precision, moments: &mut Moments) -> bool {
        let distance = (point - self.ball.center).norm();
        if distance >= precision.fewer * self.ball.reach {
            self.few.add_potential(point, moments);
        } else if distance >= precision.accept * self.ball.reach {
            self.many.add_potential(point, moments);
        } else {
            return false;
        }
        true
    }

    /// Adds potential and gradient, and says whether the point was far enough for that.
    #[inline(always)]
    pub fn add_field(&self, point: &Vec3, precision: &Precision, charges: &[Moments], sums: &mut [[f64; 4]]) -> bool {
        let distance = (point - self.ball.center).norm();
        if distance >= precision.fewer * self.ball.reach {
            self.few.add_field(point, charges, sums);
        } else if distance >= precision.accept * self.ball.reach {
            self.many.add_field(point, charges, sums);
        } else {
            return false;
        }
        true
    }
}
