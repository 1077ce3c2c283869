//! Many panels at many points: closed form and expansion, a vector of panels at a time.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

use crate::panel::Panel;

/// Panels whose numbers stand side by side: two vectors of four or one of eight. Each panel acts by its own distance; panels
/// of a group are neighbours, so that a vector rarely needs two ways.
const GROUP: usize = 8;

/// Groups that are summed at once for one point: their data (21 kB at most in use) stay in the nearest cache from point to point.
const CHUNK: usize = 16;

/// From this distance on, in panel radii, a panel acts through the first moments of its charge. What is left out is at most
/// 3/80 (1/28)⁴ = 6e-8 of the panel's share (3/80 is the fourth moment of a needle). With 16, potentials of 1 V missed by
/// 1e-8 V; without expansion points among 3600 panels took a twentieth longer between two rings, a third beside their wires.
const EXPANSION_FROM: f64 = 28.0;

/// Nearer than this, in panel radii, a panel acts by [`Panel::potential_and_gradient`], which is good on the panel too. From
/// here on an edge L is at most half the sum S of the distances to its ends: the midpoint m of an edge is √(1 - L²/4) radii
/// from the centroid, S is twice the distance to m or more, and L/S is below 0.497 for every L.
const CLOSE: f64 = 2.25;

/// A point this near to a panel's plane and over its area is on the panel, in panel radii: the rounding of a point that was
/// computed to lie on it.
pub(crate) const ON_SURFACE: f64 = 1e-12;

/// Numbers that the expansion of a panel takes: centroid, squared reach, area, five and seven moments.
const EXPANSION: usize = 17;

/// Numbers that the closed form takes: corners, normal, twice the area.
const OUTLINE: usize = 13;

/// Potential and gradient.
const VALUES: usize = 4;

/// Panels in groups of neighbours, each number of a group's panels side by side.
pub(crate) struct PanelGroups {
    /// In the order of the groups.
    panels: Vec<Panel>,
    /// Of each panel: on a solid electrode, so that only its outside counts.
    solid: Vec<bool>,
    /// `(group * EXPANSION + number) * GROUP + panel of the group`.
    expansion: Vec<f64>,
    /// `(group * OUTLINE + number) * GROUP + panel of the group`.
    outline: Vec<f64>,
    /// Charge densities, V/m: `(channel * groups + group) * GROUP + panel of the group`; zero where a group is not full.
    density: Vec<f64>,
    channels: usize,
    arch: Arch,
}

impl PanelGroups {
    /// `density(panel, channel)` is Coulomb's constant times charge per area.
    pub fn new(panels: &[Panel], solid: &[bool], channels: usize, density: impl Fn(usize, usize) -> f64) -> Self {
        let mut order: Vec<usize> = (0..panels.len()).collect();
        gather_neighbours(panels, &mut order);
        let groups = panels.len().div_ceil(GROUP);
        let mut all = Self {
            panels: order.iter().map(|&p| panels[p]).collect(),
            solid: order.iter().map(|&p| solid[p]).collect(),
            expansion: vec![0.0; groups * EXPANSION * GROUP],
            outline: vec![0.0; groups * OUTLINE * GROUP],
            density: vec![0.0; channels * groups * GROUP],
            channels,
            arch: Arch::new(),
        };
        // Places that no panel takes repeat the last one, without charge.
        for place in 0..groups * GROUP {
            let (group, lane) = (place / GROUP, place % GROUP);
            let panel = &all.panels[place.min(panels.len() - 1)];
            for (k, number) in expansion(panel).into_iter().enumerate() {
                all.expansion[(group * EXPANSION + k) * GROUP + lane] = number;
            }
            for (k, number) in outline(panel).into_iter().enumerate() {
                all.outline[(group * OUTLINE + k) * GROUP + lane] = number;
            }
            if place < order.len() {
                for c in 0..channels {
                    all.density[c * groups * GROUP + place] = density(order[place], c);
                }
            }
        }
        all
    }

    /// Number of panels.
    pub fn len(&self) -> usize {
        self.panels.len()
    }

    /// Potential and gradient of every channel at every point, `(point * channels + channel) * 4`. For a point the order of
    /// the sum is always the same; its last bits depend on the width of the machine's vectors, and on nothing else.
    pub fn sum(&self, points: &[Vec3]) -> Vec<f64> {
        let mut sums = vec![0.0; points.len() * self.channels * VALUES];
        self.arch.dispatch(Sum { all: self, points, sums: &mut sums });
        sums
    }

    /// Potential and gradient of one panel near a point, per unit of density: just outside where the point is on a panel of
    /// a solid electrode.
    fn close(&self, place: usize, point: &Vec3) -> [f64; VALUES] {
        let Some(panel) = self.panels.get(place) else { return [0.0; VALUES] };
        let (value, mut slope) = panel.potential_and_gradient(point);
        let height = panel.normal.dot(&(point - panel.corners[0]));
        if self.solid[place] && height.abs() <= ON_SURFACE * panel.radius {
            let nearest = meshes::triangle::closest_point(point, &panel.corners);
            if (nearest - point).norm() <= ON_SURFACE * panel.radius {
                // The closed form has the solid angle ±2π for points off the plane by less than that, and zero in it.
                slope += panel.normal * (-std::f64::consts::TAU - slope.dot(&panel.normal));
            }
        }
        [value, slope.x, slope.y, slope.z]
    }
}

/// Sorts panels so that each group is compact: halves of whole groups along the longest side, again and again.
fn gather_neighbours(panels: &[Panel], order: &mut [usize]) {
    if order.len() <= GROUP {
        return;
    }
    let first = panels[order[0]].centroid;
    let (low, high) =
        order.iter().map(|&p| panels[p].centroid).fold((first, first), |(l, h), c| (l.inf(&c), h.sup(&c)));
    let axis = (high - low).imax();
    let half = order.len().div_ceil(GROUP).div_ceil(2) * GROUP;
    // Ties are broken by panel number, so that the groups do not depend on the sorting algorithm.
    order.select_nth_unstable_by(half, |&p, &q| {
        panels[p].centroid[axis].total_cmp(&panels[q].centroid[axis]).then(p.cmp(&q))
    });
    let (below, above) = order.split_at_mut(half);
    gather_neighbours(panels, below);
    gather_neighbours(panels, above);
}

/// Centroid c, squared distance from which on the expansion holds, area A, and moments without trace of y - c, the second
/// times 3A/2 (xx, yy, xy, xz, yz) and the third times 5A/2 (xxx, yyy, xxy, xxz, xyy, yyz, xyz).
fn expansion(panel: &Panel) -> [f64; EXPANSION] {
    let [xx, yy, zz, xy, xz, yz] = panel.moments;
    let third = (xx + yy + zz) / 3.0;
    let second = [xx - third, yy - third, xy, xz, yz].map(|q| 1.5 * panel.area * q);
    // ∫ λa λb λc / area is 1/60 for three different corners, and the rest follows from arms that sum to zero.
    let arms = panel.corners.map(|v| v - panel.centroid);
    let raw = |i: usize, j: usize, k: usize| -> f64 {
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        orders.iter().map(|[a, b, c]| arms[*a][i] * arms[*b][j] * arms[*c][k]).sum::<f64>() / 60.0
    };
    let trace = [0, 1, 2].map(|i| (0..3).map(|j| raw(i, j, j)).sum::<f64>() / 5.0);
    let free = |i: usize, j: usize, k: usize| {
        let delta = |a: usize, b: usize| f64::from(u8::from(a == b));
        let traces = trace[i] * delta(j, k) + trace[j] * delta(i, k) + trace[k] * delta(i, j);
        2.5 * panel.area * (raw(i, j, k) - traces)
    };
    let c = panel.centroid;
    let reach = (EXPANSION_FROM * panel.radius).powi(2);
    let [q0, q1, q2, q3, q4] = second;
    let (t0, t1, t2, t3) = (free(0, 0, 0), free(1, 1, 1), free(0, 0, 1), free(0, 0, 2));
    let (t4, t5, t6) = (free(0, 1, 1), free(1, 1, 2), free(0, 1, 2));
    [c.x, c.y, c.z, reach, panel.area, q0, q1, q2, q3, q4, t0, t1, t2, t3, t4, t5, t6]
}

fn outline(panel: &Panel) -> [f64; OUTLINE] {
    let ([a, b, c], n) = (panel.corners, panel.normal);
    [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, n.x, n.y, n.z, 2.0 * panel.area]
}

struct Sum<'a> {
    all: &'a PanelGroups,
    points: &'a [Vec3],
    sums: &'a mut [f64],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    /// Chunk by chunk, point by point: first what each panel does at density 1, then the sum over densities for each channel.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { all, points, sums } = self;
        let vectors = GROUP / S::F64_LANES;
        let groups = all.outline.len() / (OUTLINE * GROUP);
        let expansion = S::as_simd_f64s(&all.expansion).0;
        let outline = S::as_simd_f64s(&all.outline).0;
        let density = S::as_simd_f64s(&all.density).0;
        let close = simd.splat_f64s((CLOSE / EXPANSION_FROM).powi(2));
        let mut shares = [[0.0; CHUNK * GROUP]; VALUES];
        for first in (0..groups).step_by(CHUNK) {
            let chunk = first..(first + CHUNK).min(groups);
            for (p, point) in points.iter().enumerate() {
                let x = [point.x, point.y, point.z].map(|k| simd.splat_f64s(k));
                for group in chunk.clone() {
                    let base = (group - first) * vectors;
                    let numbers = &expansion[group * EXPANSION * vectors..(group + 1) * EXPANSION * vectors];
                    let outlines = &outline[group * OUTLINE * vectors..(group + 1) * OUTLINE * vectors];
                    let mut near = false;
                    for v in 0..vectors {
                        let squared = distance_squared(simd, numbers, vectors, v, x);
                        let reach = numbers[3 * vectors + v];
                        let closer = simd.less_than_f64s(squared, reach);
                        let farther = simd.less_than_or_equal_f64s(reach, squared);
                        let mut values;
                        if none(simd, closer) {
                            values = expanded(simd, numbers, vectors, v, x);
                        } else {
                            near |= !none(simd, simd.less_than_f64s(squared, simd.mul_f64s(reach, close)));
                            values = closed_form(simd, outlines, vectors, v, x);
                            if !none(simd, farther) {
                                let far = expanded(simd, numbers, vectors, v, x);
                                for k in 0..VALUES {
                                    values[k] = simd.select_f64s(closer, values[k], far[k]);
                                }
                            }
                        }
                        store(simd, &mut shares, base + v, values);
                    }
                    if near {
                        all.replace_close(group, point, &mut shares, group - first);
                    }
                }
                let used = chunk.len() * vectors;
                for c in 0..all.channels {
                    let density = &density[(c * groups + first) * vectors..][..used];
                    let sums = &mut sums[(p * all.channels + c) * VALUES..][..VALUES];
                    for (sum, share) in sums.iter_mut().zip(&shares) {
                        let mut total = simd.splat_f64s(0.0);
                        for (q, s) in density.iter().zip(S::as_simd_f64s(share).0) {
                            total = simd.mul_add_e_f64s(*q, *s, total);
                        }
                        *sum += simd.reduce_sum_f64s(total);
                    }
                }
            }
        }
    }
}

impl PanelGroups {
    /// Puts the scalar closed form in place of the vectors' for panels of a group that are close to the point.
    #[inline(never)]
    fn replace_close(&self, group: usize, point: &Vec3, shares: &mut [[f64; CHUNK * GROUP]; VALUES], slot: usize) {
        for lane in 0..GROUP {
            let place = group * GROUP + lane;
            let panel = &self.panels[place.min(self.panels.len() - 1)];
            if (point - panel.centroid).norm_squared() < (1.001 * CLOSE * panel.radius).powi(2) {
                let values = self.close(place, point);
                for (share, value) in shares.iter_mut().zip(values) {
                    share[slot * GROUP + lane] = value;
                }
            }
        }
    }
}

/// Whether no entry is set.
#[inline(always)]
fn none<S: Simd>(simd: S, mask: S::m64s) -> bool {
    simd.first_true_m64s(mask) >= S::F64_LANES
}

#[inline(always)]
fn store<S: Simd>(_: S, shares: &mut [[f64; CHUNK * GROUP]; VALUES], at: usize, values: [S::f64s; VALUES]) {
    for k in 0..VALUES {
        S::as_mut_simd_f64s(&mut shares[k]).0[at] = values[k];
    }
}

#[inline(always)]
fn minus<S: Simd>(simd: S, a: [S::f64s; 3], b: [S::f64s; 3]) -> [S::f64s; 3] {
    [simd.sub_f64s(a[0], b[0]), simd.sub_f64s(a[1], b[1]), simd.sub_f64s(a[2], b[2])]
}

#[inline(always)]
fn dot<S: Simd>(simd: S, a: [S::f64s; 3], b: [S::f64s; 3]) -> S::f64s {
    simd.mul_add_e_f64s(a[0], b[0], simd.mul_add_e_f64s(a[1], b[1], simd.mul_f64s(a[2], b[2])))
}

#[inline(always)]
fn cross<S: Simd>(simd: S, a: [S::f64s; 3], b: [S::f64s; 3]) -> [S::f64s; 3] {
    [
        simd.negate_mul_add_e_f64s(a[2], b[1], simd.mul_f64s(a[1], b[2])),
        simd.negate_mul_add_e_f64s(a[0], b[2], simd.mul_f64s(a[2], b[0])),
        simd.negate_mul_add_e_f64s(a[1], b[0], simd.mul_f64s(a[0], b[1])),
    ]
}

/// Σ c_k w^k.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(simd: S, coefficients: &[f64; N], w: S::f64s) -> S::f64s {
    let mut sum = simd.splat_f64s(coefficients[N - 1]);
    for k in (0..N - 1).rev() {
        sum = simd.mul_add_e_f64s(sum, w, simd.splat_f64s(coefficients[k]));
    }
    sum
}

#[inline(always)]
fn triple<S: Simd>(numbers: &[S::f64s], vectors: usize, v: usize, first: usize) -> [S::f64s; 3] {
    [numbers[first * vectors + v], numbers[(first + 1) * vectors + v], numbers[(first + 2) * vectors + v]]
}

#[inline(always)]
fn distance_squared<S: Simd>(simd: S, numbers: &[S::f64s], vectors: usize, v: usize, x: [S::f64s; 3]) -> S::f64s {
    let d = minus(simd, x, triple::<S>(numbers, vectors, v, 0));
    dot(simd, d, d)
}

/// The expansion about the centroid to the third moments, with d = x - c and moments Q, T without trace:
///
///   ∫ dS / |x - y| ≈ A/r + (3A/2) Q(d, d)/r⁵ + (5A/2) T(d, d, d)/r⁷
///
/// The first moment about the centroid is zero. Checked by `vectors_agree_with_the_scalar_closed_form`.
#[inline(always)]
fn expanded<S: Simd>(simd: S, numbers: &[S::f64s], vectors: usize, v: usize, x: [S::f64s; 3]) -> [S::f64s; VALUES] {
    let at = |k: usize| numbers[k * vectors + v];
    let d = minus(simd, x, triple::<S>(numbers, vectors, v, 0));
    let [dx, dy, dz] = d;
    let inverse2 = simd.div_f64s(simd.splat_f64s(1.0), dot(simd, d, d));
    let inverse = simd.sqrt_f64s(inverse2);
    let inverse3 = simd.mul_f64s(inverse, inverse2);
    let inverse5 = simd.mul_f64s(inverse3, inverse2);
    let inverse7 = simd.mul_f64s(inverse5, inverse2);
    // Q d, with Q_zz = -Q_xx - Q_yy.
    let (qxx, qyy, qxy, qxz, qyz) = (at(5), at(6), at(7), at(8), at(9));
    let qzz = simd.add_f64s(qxx, qyy);
    let q = [
        dot(simd, [qxx, qxy, qxz], d),
        dot(simd, [qxy, qyy, qyz], d),
        simd.negate_mul_add_e_f64s(qzz, dz, simd.mul_add_e_f64s(qxz, dx, simd.mul_f64s(qyz, dy))),
    ];
    let second = simd.mul_f64s(dot(simd, q, d), inverse5);
    // T d d, with T_izz = -T_ixx - T_iyy.
    let (txxx, tyyy, txxy, txxz, txyy, tyyz, txyz) = (at(10), at(11), at(12), at(13), at(14), at(15), at(16));
    let squares = [
        simd.negate_mul_add_e_f64s(dz, dz, simd.mul_f64s(dx, dx)),
        simd.negate_mul_add_e_f64s(dz, dz, simd.mul_f64s(dy, dy)),
    ];
    let two = simd.splat_f64s(2.0);
    let twice = simd.mul_f64s(two, dz);
    let mixed = [simd.mul_f64s(simd.mul_f64s(two, dx), dy), simd.mul_f64s(twice, dx), simd.mul_f64s(twice, dy)];
    let row = |a: S::f64s, b: S::f64s, m: [S::f64s; 3]| {
        simd.mul_add_e_f64s(a, squares[0], simd.mul_add_e_f64s(b, squares[1], dot(simd, m, mixed)))
    };
    let txzz = simd.neg_f64s(simd.add_f64s(txxx, txyy));
    let tyzz = simd.neg_f64s(simd.add_f64s(txxy, tyyy));
    let t =
        [row(txxx, txyy, [txxy, txxz, txyz]), row(txxy, tyyy, [txyy, txyz, tyyz]), row(txxz, tyyz, [txyz, txzz, tyzz])];
    let third = simd.mul_f64s(dot(simd, t, d), inverse7);
    let first = simd.mul_f64s(at(4), inverse);
    let value = simd.add_f64s(first, simd.add_f64s(second, third));
    let inward =
        simd.mul_add_e_f64s(simd.splat_f64s(5.0), second, simd.mul_add_e_f64s(simd.splat_f64s(7.0), third, first));
    let inward = simd.mul_f64s(inward, inverse2);
    let (two5, three7) = (simd.mul_f64s(two, inverse5), simd.mul_f64s(simd.splat_f64s(3.0), inverse7));
    let slope = |k: usize| {
        let rest = simd.mul_add_e_f64s(q[k], two5, simd.mul_f64s(t[k], three7));
        simd.negate_mul_add_e_f64s(d[k], inward, rest)
    };
    [value, slope(0), slope(1), slope(2)]
}

/// artanh(√w)/√w on [0, 1/4]: the polynomial through it at the Chebyshev nodes, off by 2e-17 of it.
const ARTANH: [f64; 14] = [
    1.0,
    0.33333333333334253,
    0.1999999999976213,
    0.14285714309936393,
    0.11111109827808782,
    0.0909094967767514,
    0.07691479619739994,
    0.06678071960165906,
    0.057736807394426284,
    0.059849948126744074,
    0.014509315392605584,
    0.1449797049645602,
    -0.15287151789790238,
    0.22471180117043177,
];

/// arctan(√w)/√w on [0, 1/5] in the same way, off by 2e-17 of it.
const ARCTAN: [f64; 12] = [
    1.0,
    -0.3333333333333234,
    0.19999999999761667,
    -0.14285714263336027,
    0.11111110022135758,
    -0.09090877699019131,
    0.07691730859682595,
    -0.06659632591850656,
    0.058243931405155075,
    -0.04940578572579412,
    0.0357205005839704,
    -0.015503704816782966,
];

/// [`Panel::potential_and_gradient`] where the point is some way off: with edge vectors e_i, m_i L_i = e_i × n and
/// S = R₊ + R₋ of each edge, f_i = 2 artanh(L/S); and Ω = 2 arctan of a ratio below √(1/5), since from there a panel is seen
/// under less than 1.3 / 1.25² steradians.
#[inline(always)]
fn closed_form<S: Simd>(simd: S, numbers: &[S::f64s], vectors: usize, v: usize, x: [S::f64s; 3]) -> [S::f64s; VALUES] {
    let n = triple::<S>(numbers, vectors, v, 9);
    let r = [
        minus(simd, triple::<S>(numbers, vectors, v, 0), x),
        minus(simd, triple::<S>(numbers, vectors, v, 3), x),
        minus(simd, triple::<S>(numbers, vectors, v, 6), x),
    ];
    let length = [
        simd.sqrt_f64s(dot(simd, r[0], r[0])),
        simd.sqrt_f64s(dot(simd, r[1], r[1])),
        simd.sqrt_f64s(dot(simd, r[2], r[2])),
    ];
    let (one, two) = (simd.splat_f64s(1.0), simd.splat_f64s(2.0));
    let zero = simd.splat_f64s(0.0);
    let mut value = zero;
    let mut slope = [zero; 3];
    for i in 0..3 {
        let j = (i + 1) % 3;
        let edge = minus(simd, r[j], r[i]);
        let outward = cross(simd, edge, n);
        let inverse = simd.div_f64s(one, simd.add_f64s(length[i], length[j]));
        let w = simd.mul_f64s(dot(simd, edge, edge), simd.mul_f64s(inverse, inverse));
        let f = simd.mul_f64s(simd.mul_f64s(two, inverse), polynomial(simd, &ARTANH, w));
        value = simd.mul_add_e_f64s(dot(simd, outward, r[i]), f, value);
        for k in 0..3 {
            slope[k] = simd.negate_mul_add_e_f64s(outward[k], f, slope[k]);
        }
    }
    let height = simd.neg_f64s(dot(simd, n, r[0]));
    let [a, b, c] = length;
    let product = simd.mul_f64s(simd.mul_f64s(a, b), c);
    let others = dot(simd, [dot(simd, r[0], r[1]), dot(simd, r[1], r[2]), dot(simd, r[2], r[0])], [c, a, b]);
    let ratio = simd.div_f64s(simd.mul_f64s(numbers[12 * vectors + v], height), simd.add_f64s(product, others));
    let angle = simd.mul_f64s(simd.mul_f64s(two, ratio), polynomial(simd, &ARCTAN, simd.mul_f64s(ratio, ratio)));
    value = simd.negate_mul_add_e_f64s(height, angle, value);
    for k in 0..3 {
        slope[k] = simd.negate_mul_add_e_f64s(n[k], angle, slope[k]);
    }
    [value, slope[0], slope[1], slope[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::{Shape, triangulate_to};

    /// Directions with no relation to each other.
    fn directions() -> impl Iterator<Item = Vec3> {
        (0..60).map(|k| {
            let (z, turn) = ((2 * k + 1) as f64 / 60.0 - 1.0, 2.4 * k as f64);
            let across = (1.0 - z * z).sqrt();
            Vec3::new(across * turn.cos(), across * turn.sin(), z)
        })
    }

    fn panels() -> [Panel; 3] {
        [
            [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.3, 0.8, -0.1)],
            // As different as panels are: the even one, and a long thin one.
            [Vec3::x(), Vec3::new(-0.5, 0.75_f64.sqrt(), 0.0), Vec3::new(-0.5, -0.75_f64.sqrt(), 0.0)],
            [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.02, 1.0)],
        ]
        .map(Panel::new)
    }

    #[test]
    fn vectors_agree_with_the_scalar_closed_form() {
        for panel in panels() {
            let alone = PanelGroups::new(&[panel], &[false], 1, |_, _| 1.0);
            for distance in [0.3, 1.2, 2.2, 2.26, 3.0, 5.0, 9.0, 27.9, 28.1, 50.0, 100.0] {
                for direction in directions() {
                    let x = panel.centroid + direction * (distance * panel.radius);
                    let (p, g) = panel.potential_and_gradient(&x);
                    let sums = alone.sum(&[x]);
                    let slope = Vec3::new(sums[1], sums[2], sums[3]);
                    // The closed form in vectors to rounding, which grows as distance over size; the expansion as it is cut.
                    let slack = if distance < EXPANSION_FROM { 1e-12 } else { 0.0375 * f64::powi(distance, -4) };
                    assert!((sums[0] / p - 1.0).abs() < slack, "at {distance}: {:.1e}", sums[0] / p - 1.0);
                    let error = (slope - g).norm() / g.norm();
                    assert!(error < 6.0 * slack, "gradient at {distance}: {error:.1e}");
                }
            }
        }
    }

    #[test]
    fn sums_are_those_of_closed_forms_and_have_no_steps() {
        let plate = Shape::Plate { size: [1.0, 1.0], thickness: 0.0 };
        let mesh = triangulate_to(&plate, 3000).unwrap().0;
        let corners = |t: &[u32; 3]| t.map(|v| mesh.vertices[v as usize]);
        let panels: Vec<Panel> = mesh.triangles.iter().map(|t| Panel::new(corners(t))).collect();
        // Densities that make some volts, the second of both signs.
        let density = |p: usize, c: usize| if c == 0 { 1.0 } else { 4.0 * panels[p].centroid.x };
        let groups = PanelGroups::new(&panels, &vec![false; panels.len()], 2, density);
        let steps = 1000;
        let points: Vec<Vec3> = (0..=steps)
            .map(|k| k as f64 / steps as f64)
            .map(|t| Vec3::new(1.5 * t - 0.75, 0.2 + 0.1 * t, 0.01 + 0.1 * t * t))
            .collect();
        let sums = groups.sum(&points);
        let (mut worst, mut step, mut field, mut before) = (0.0_f64, 0.0_f64, 0.0_f64, [0.0; 2]);
        for (point, sums) in points.iter().zip(sums.chunks_exact(2 * VALUES)) {
            for c in 0..2 {
                let add = |(v, g), p: usize| {
                    let (value, slope) = panels[p].potential_and_gradient(point);
                    (v + density(p, c) * value, g + slope * density(p, c))
                };
                let (v, g) = (0..panels.len()).fold((0.0, Vec3::zeros()), add);
                let sum = &sums[c * VALUES..(c + 1) * VALUES];
                let error = sum[0] - v;
                worst = worst.max(error.abs());
                step = step.max((error - before[c]).abs());
                field = field.max((Vec3::new(sum[1], sum[2], sum[3]) - g).norm());
                before[c] = error;
            }
            assert_eq!(groups.sum(&[*point]), sums, "a point's sum does not depend on the others");
        }
        println!("potential {worst:.1e} V, steps {step:.1e} V, gradient {field:.1e} V/m");
        // Potentials up to 3.5 V, fields of some 10 V/m. Measured 2e-9 V, 2e-9 V and 1.2e-8 V/m.
        assert!(worst < 1e-8 && step < 1e-8 && field < 1e-7);
    }

    #[test]
    fn polynomials_are_the_functions() {
        for k in 1..=1000 {
            let w = 0.25 * k as f64 / 1000.0;
            let sum = |c: &[f64]| c.iter().rev().fold(0.0, |s, c| s * w + c);
            let u = w.sqrt();
            assert!((sum(&ARTANH) * u / u.atanh() - 1.0).abs() < 1e-15);
            assert!(w > 0.2 || (sum(&ARCTAN) * u / u.atan() - 1.0).abs() < 1e-15);
        }
    }
}
