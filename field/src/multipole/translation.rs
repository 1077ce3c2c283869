//! Moving expansions between cubes: to parents, to children, and across, the last in a reduced basis.
//!
//! In a cube of half side 1, multipoles are M = Σ q R(y) and local expansions Σ L R(x). Across, from a cube to one of the
//! same size d away,
//!
//!   1/|d + x - y| = Σ_ab R_a(x) K_ab(d) R_b(y).
//!
//! Sources and targets fill cubes, not balls, and so K has a lower rank than it has columns. With W the Gram matrix of R over
//! the cube, K̂ = W^½ K W^½ is the same kernel between functions that are orthonormal over the cube: its Frobenius norm is the
//! root mean square of the kernel over both cubes. The eigenvectors V of Σ_d K̂ K̂ᵀ with the largest eigenvalues, over all
//! directions d, serve all directions at once:
//!
//!   K(d) ≈ Pᵀ C(d) P,  P = Vᵀ W^{-½},  C(d) = Vᵀ K̂(d) V.
//!
//! The compression is that of Fong and Darve 2009, section 3.3, who use Chebyshev polynomials instead of harmonics. R is even
//! or odd along each axis, and so is each eigenvector: C(d) for a d with negative components is C of their absolute values
//! with signs on its rows and columns.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, Side};
use meshes::Vec3;

use super::solid::{Family, complex, parts, place, values};
use crate::gauss::gauss;

/// Directions with no negative component: components 0 to 3, one of them at least 2.
const DIRECTIONS: usize = 64;

/// Number of a direction without its signs.
pub(super) fn direction_number(d: [i8; 3]) -> usize {
    d.iter().fold(0, |number, c| 4 * number + c.unsigned_abs() as usize)
}

/// Number of the signs of a direction: bit k where component k is negative.
pub(super) fn sign_number(d: [i8; 3]) -> usize {
    (0..3).map(|k| usize::from(d[k] < 0) << k).sum()
}

/// Numbers of a reduced basis, in single or double precision.
pub(super) trait Number: faer::traits::RealField + Copy + Send + Sync + 'static {
    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
    fn matrices(all: &Across) -> &[Mat<Self>];
}

impl Number for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
    fn matrices(all: &Across) -> &[Mat<Self>] {
        match all {
            Across::Single(matrices) => matrices,
            Across::Double(_) => &[],
        }
    }
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn wide(self) -> f64 {
        self
    }
    fn matrices(all: &Across) -> &[Mat<Self>] {
        match all {
            Across::Double(matrices) => matrices,
            Across::Single(_) => &[],
        }
    }
}

/// C(d) for each direction number.
#[derive(Clone, Debug)]
pub(super) enum Across {
    Single(Vec<Mat<f32>>),
    Double(Vec<Mat<f64>>),
}

/// All translations for one degree and one rank.
#[derive(Clone, Debug)]
pub(super) struct Translations {
    pub degree: usize,
    pub rank: usize,
    /// To the parent from each of its eighths; the transposed matrix takes local expansions the other way.
    pub to_parent: Vec<Mat<f64>>,
    /// P, `rank × parts`.
    pub reduction: Mat<f64>,
    /// Signs of the reduced basis for each number of signs of a direction.
    pub signs: Vec<Vec<f64>>,
    pub across: Across,
}

/// Degree, relative error of the reduced basis, and whether single precision does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grade {
    pub degree: usize,
    pub cut: f64,
    pub single: bool,
}

/// Below this cut all harmonics are kept.
const LEAST_CUT: f64 = 1e-8;

type Cache = Mutex<BTreeMap<(usize, u64, bool), Arc<Translations>>>;
static CACHE: LazyLock<Cache> = LazyLock::new(Cache::default);

impl Translations {
    /// Computed once for each grade.
    pub fn of(grade: Grade) -> Arc<Self> {
        let key = (grade.degree, grade.cut.to_bits(), grade.single);
        let cached = CACHE.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        cached.unwrap_or_else(|| {
            // Not under the lock: a thread that waits for it could not help the one that computes.
            let made = Arc::new(Self::new(grade));
            CACHE.lock().unwrap_or_else(PoisonError::into_inner).insert(key, made.clone());
            made
        })
    }

    fn new(grade: Grade) -> Self {
        let degree = grade.degree;
        let n = parts(degree);
        let norm = norms(degree);
        let classes: Vec<usize> = classes(degree);
        // The eigenvectors come from squares, and squares end at 1e-16.
        let whole = grade.cut < LEAST_CUT;
        let identity = || Mat::<f64>::identity(n, n);
        let (root, inverse_root) = if whole { (identity(), identity()) } else { gram_roots(degree, &norm, &classes) };
        let directions: Vec<[i8; 3]> = (0..DIRECTIONS as i8).map(|k| [k / 16, k / 4 % 4, k % 4]).collect();
        // Halves of directions that exist with several signs.
        let kernels: Vec<Mat<f64>> = directions
            .iter()
            .map(|d| {
                if d.iter().all(|c| *c < 2) {
                    return Mat::zeros(0, 0);
                }
                let mut kernel = across(degree, &Vec3::from(d.map(|c| 2.0 * f64::from(c))));
                for b in 0..n {
                    for a in 0..n {
                        kernel[(a, b)] /= norm[a] * norm[b];
                    }
                }
                if whole { kernel } else { multiply(multiply(&root, &kernel), &root) }
            })
            .collect();
        let mut total = Mat::<f64>::zeros(n, n);
        for (d, kernel) in directions.iter().zip(&kernels) {
            if kernel.nrows() > 0 && !whole {
                let mirrored = f64::from(1 << d.iter().filter(|c| **c > 0).count());
                matmul(&mut total, Accum::Add, kernel, kernel.transpose(), mirrored, Par::Seq);
            }
        }
        let (basis, class) = if whole { (identity(), classes) } else { leading(&total, &classes, grade.cut) };
        let rank = basis.ncols();
        let mut reduction = multiply(basis.transpose(), &inverse_root);
        for a in 0..n {
            for r in 0..rank {
                reduction[(r, a)] *= norm[a];
            }
        }
        let reduced = |kernel: &Mat<f64>| {
            if kernel.nrows() == 0 || whole {
                kernel.clone()
            } else {
                multiply(multiply(basis.transpose(), kernel), &basis)
            }
        };
        let across = if grade.single {
            let single = |m: Mat<f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32);
            Across::Single(kernels.iter().map(|k| single(reduced(k))).collect())
        } else {
            Across::Double(kernels.iter().map(reduced).collect())
        };
        let signs = (0..8)
            .map(|flips| class.iter().map(|c| if (c & flips).count_ones() % 2 == 0 { 1.0 } else { -1.0 }).collect())
            .collect();
        let to_parent = (0..8_usize)
            .map(|octant| to_parent(degree, &Vec3::from([0, 1, 2].map(|k| (octant >> k & 1) as f64 - 0.5))))
            .collect();
        Self { degree, rank, to_parent, reduction, signs, across }
    }

    /// Bytes.
    pub fn bytes(&self) -> u64 {
        let n = parts(self.degree) as u64;
        let across = match &self.across {
            Across::Single(_) => 4,
            Across::Double(_) => 8,
        };
        8 * 8 * n * n + across * 56 * (self.rank * self.rank) as u64
    }
}

fn multiply(
    a: impl faer::mat::AsMatRef<T = f64, Rows = usize, Cols = usize>,
    b: impl faer::mat::AsMatRef<T = f64, Rows = usize, Cols = usize>,
) -> Mat<f64> {
    let (a, b) = (a.as_mat_ref(), b.as_mat_ref());
    let (a, b): (MatRef<f64>, MatRef<f64>) = (a.as_dyn_stride(), b.as_dyn_stride());
    let mut c = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut c, Accum::Replace, a, b, 1.0, Par::Seq);
    c
}

/// What brings each part of R to the size of r^l: √((l - m)! (l + m)!).
fn norms(degree: usize) -> Vec<f64> {
    let mut norm = vec![1.0; parts(degree)];
    for l in 0..=degree {
        for m in 0..=l {
            let factor = ((1..=l - m).chain(1..=l + m)).map(|k| (k as f64).sqrt()).product();
            norm[place(l, m)] = factor;
            if m > 0 {
                norm[place(l, m) + 1] = factor;
            }
        }
    }
    norm
}

/// Along which axes (bits) each part of R is odd.
fn classes(degree: usize) -> Vec<usize> {
    let mut class = vec![0; parts(degree)];
    for l in 0..=degree {
        for m in 0..=l {
            let z = (l + m) % 2;
            class[place(l, m)] = (m % 2) | (z << 2);
            if m > 0 {
                class[place(l, m) + 1] = ((m + 1) % 2) | 2 | (z << 2);
            }
        }
    }
    class
}

/// K(d) between parts of R.
fn across(degree: usize, d: &Vec3) -> Mat<f64> {
    let n = parts(degree);
    let far = values(Family::Irregular, 2 * degree, d);
    let mut kernel = Mat::<f64>::zeros(n, n);
    for j in 0..=degree {
        for i in 0..=j {
            let source = place(j, i);
            for k in 0..=degree {
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                for m in 0..=k {
                    // conj R_j^±i(y) conj R_k^±m(-x) I_{j+k}^{±i±m}(d), summed over signs.
                    let target = place(k, m);
                    let t = complex(&far, j + k, (i + m) as isize);
                    match (i, m) {
                        (0, 0) => kernel[(target, source)] = sign * t.0,
                        (0, _) => {
                            kernel[(target, source)] = 2.0 * sign * t.0;
                            kernel[(target + 1, source)] = 2.0 * sign * t.1;
                        }
                        (_, 0) => {
                            kernel[(target, source)] = 2.0 * sign * t.0;
                            kernel[(target, source + 1)] = 2.0 * sign * t.1;
                        }
                        _ => {
                            let u = complex(&far, j + k, i as isize - m as isize);
                            let odd = if m % 2 == 0 { 1.0 } else { -1.0 };
                            let u = (odd * u.0, odd * u.1);
                            kernel[(target, source)] = 2.0 * sign * (t.0 + u.0);
                            kernel[(target + 1, source + 1)] = 2.0 * sign * (u.0 - t.0);
                            kernel[(target + 1, source)] = 2.0 * sign * (t.1 - u.1);
                            kernel[(target, source + 1)] = 2.0 * sign * (t.1 + u.1);
                        }
                    }
                }
            }
        }
    }
    kernel
}

/// Multipoles of a cube in those of its parent, whose half side is the unit; `t` is the cube's centre from the parent's:
/// R_l^m(y/2 + t) = Σ_kμ 2^-k R_k^μ(y) R_{l-k}^{m-μ}(t).
fn to_parent(degree: usize, t: &Vec3) -> Mat<f64> {
    let n = parts(degree);
    let shift = values(Family::Regular, degree, t);
    let mut matrix = Mat::<f64>::zeros(n, n);
    for l in 0..=degree {
        for m in 0..=l {
            let row = place(l, m);
            for k in 0..=l {
                let scale = 0.5_f64.powi(k as i32);
                for order in 0..=k {
                    let column = place(k, order);
                    let one = complex(&shift, l - k, m as isize - order as isize);
                    // The negative order: R_k^{-μ} = (-1)^μ conj R_k^μ.
                    let odd = if order == 0 {
                        0.0
                    } else if order % 2 == 0 {
                        1.0
                    } else {
                        -1.0
                    };
                    let two = complex(&shift, l - k, (m + order) as isize);
                    let two = (odd * two.0, odd * two.1);
                    matrix[(row, column)] = scale * (one.0 + two.0);
                    if order > 0 {
                        matrix[(row, column + 1)] = scale * (two.1 - one.1);
                    }
                    if m > 0 {
                        matrix[(row + 1, column)] = scale * (one.1 + two.1);
                        if order > 0 {
                            matrix[(row + 1, column + 1)] = scale * (one.0 - two.0);
                        }
                    }
                }
            }
        }
    }
    matrix
}

/// W^½ and W^{-½} of the normalised parts of R over the cube.
fn gram_roots(degree: usize, norm: &[f64], classes: &[usize]) -> (Mat<f64>, Mat<f64>) {
    let n = parts(degree);
    // Products are of degree 2p along each axis, and the rule is symmetric: an eighth of the cube gives what is even.
    let rule = gauss(degree + 1);
    let both = rule.points.iter().zip(&rule.weights).map(|(u, w)| (2.0 * u - 1.0, *w));
    let rule: Vec<(f64, f64)> = both.filter(|(x, _)| *x > -1e-12).collect();
    let mut functions = Mat::<f64>::zeros(n, rule.len().pow(3));
    let mut column = 0;
    let half = |x: f64, w: f64| if x.abs() < 1e-12 { 0.5 * w } else { w };
    for &(x, wx) in &rule {
        for &(y, wy) in &rule {
            for &(z, wz) in &rule {
                let weight = (half(x, wx) * half(y, wy) * half(z, wz)).sqrt();
                let point = values(Family::Regular, degree, &Vec3::new(x, y, z));
                for a in 0..n {
                    functions[(a, column)] = point[a] * norm[a] * weight;
                }
                column += 1;
            }
        }
    }
    let gram = multiply(&functions, functions.transpose());
    let (mut root, mut inverse) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, n));
    for class in 0..8 {
        let members: Vec<usize> = (0..n).filter(|&a| classes[a] == class).collect();
        let Some((values, vectors)) = eigen(&gram, &members) else { continue };
        let largest = values.iter().copied().fold(0.0, f64::max);
        for (k, value) in values.into_iter().enumerate() {
            // Rounding may leave tiny directions negative; nothing depends on them.
            let value = value.max(1e-15 * largest);
            for (j, &b) in members.iter().enumerate() {
                for (i, &a) in members.iter().enumerate() {
                    let product = vectors[(i, k)] * vectors[(j, k)];
                    root[(a, b)] += product * value.sqrt();
                    inverse[(a, b)] += product / value.sqrt();
                }
            }
        }
    }
    (root, inverse)
}

/// Eigenvalues and vectors of a part of a symmetric matrix.
fn eigen(matrix: &Mat<f64>, members: &[usize]) -> Option<(Vec<f64>, Mat<f64>)> {
    if members.is_empty() {
        return None;
    }
    let part = Mat::from_fn(members.len(), members.len(), |i, j| matrix[(members[i], members[j])]);
    let found = part.self_adjoint_eigen(Side::Lower).ok()?;
    Some((found.S().column_vector().iter().copied().collect(), found.U().to_owned()))
}

/// Leading eigenvectors, class by class, until what is left out is `cut` of the norm; with the class of each.
fn leading(total: &Mat<f64>, classes: &[usize], cut: f64) -> (Mat<f64>, Vec<usize>) {
    let n = total.nrows();
    let mut found: Vec<(f64, usize, Vec<f64>)> = Vec::new();
    for class in 0..8 {
        let members: Vec<usize> = (0..n).filter(|&a| classes[a] == class).collect();
        let Some((values, vectors)) = eigen(total, &members) else { continue };
        for (k, value) in values.into_iter().enumerate() {
            let mut whole = vec![0.0; n];
            for (i, &a) in members.iter().enumerate() {
                whole[a] = vectors[(i, k)];
            }
            found.push((value.max(0.0), class, whole));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let all: f64 = found.iter().map(|f| f.0).sum();
    let mut rest = 0.0;
    let mut rank = found.len();
    while rank > 1 && rest + found[rank - 1].0 <= cut * cut * all {
        rank -= 1;
        rest += found[rank].0;
    }
    found.truncate(rank);
    (Mat::from_fn(n, rank, |a, r| found[r].2[a]), found.into_iter().map(|f| f.1).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(degree: usize, m: &Mat<f64>, x: &Vec3, y: &Vec3) -> f64 {
        let (r, s) = (values(Family::Regular, degree, x), values(Family::Regular, degree, y));
        (0..r.len()).map(|a| (0..s.len()).map(|b| r[a] * m[(a, b)] * s[b]).sum::<f64>()).sum()
    }

    #[test]
    fn across_is_the_inverse_distance() {
        let (x, y, d) = (Vec3::new(0.3, -0.4, 0.2), Vec3::new(-0.1, 0.3, 0.5), Vec3::new(4.0, -2.0, 0.0));
        let exact = 1.0 / (d + x - y).norm();
        // (0.6 + 0.54)/4.5 to the degree.
        assert!((kernel(18, &across(18, &d), &x, &y) / exact - 1.0).abs() < 1e-10);
    }

    #[test]
    fn parents_have_the_multipoles_of_their_children() {
        let (degree, t) = (7, Vec3::new(0.5, -0.5, 0.5));
        let y = Vec3::new(0.3, -0.9, 0.7);
        let (child, parent) = (values(Family::Regular, degree, &y), values(Family::Regular, degree, &(y / 2.0 + t)));
        let matrix = to_parent(degree, &t);
        for a in 0..parent.len() {
            let sum: f64 = (0..child.len()).map(|b| matrix[(a, b)] * child[b]).sum();
            assert!((sum - parent[a]).abs() < 1e-14);
        }
    }

    #[test]
    fn reduced_kernels_agree_in_every_direction() {
        let translations = Translations::of(Grade { degree: 10, cut: 1e-5, single: false });
        let matrices = f64::matrices(&translations.across);
        let (x, y) = (Vec3::new(0.6, -0.4, 0.7), Vec3::new(-0.8, 0.3, 0.5));
        let reduce = |v: &Vec3| {
            let r = values(Family::Regular, 10, v);
            let p = &translations.reduction;
            (0..p.nrows()).map(|k| (0..r.len()).map(|a| p[(k, a)] * r[a]).sum::<f64>()).collect::<Vec<_>>()
        };
        let (rx, ry) = (reduce(&x), reduce(&y));
        for d in [[2, 0, 0], [-2, 1, 0], [3, -3, -3], [0, -2, 1], [-1, -2, -3]] {
            let c = &matrices[direction_number(d)];
            let s = &translations.signs[sign_number(d)];
            let sum: f64 = (0..rx.len())
                .map(|a| (0..ry.len()).map(|b| rx[a] * s[a] * c[(a, b)] * s[b] * ry[b]).sum::<f64>())
                .sum();
            let exact = 1.0 / (Vec3::from(d.map(|c| 2.0 * f64::from(c))) + x - y).norm();
            // The degree leaves (1.7/2.8)^11 at worst.
            assert!((sum / exact - 1.0).abs() < 1e-3, "{d:?}: {sum} {exact}, rank {}", translations.rank);
        }
    }
}
