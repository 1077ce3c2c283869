//! Polygons cut into triangles.

use crate::Vec3;

/// Most corners a polygon may have.
///
/// Ear clipping takes some 10 n² steps, 0.3 s for combs and spirals of 5000 corners. A round cap or a perforated plate
/// of a CAD export has some hundreds.
pub(super) const MOST_CORNERS: usize = 5000;

/// Calls `emit` with the triangles of a polygon, oriented as the polygon is: always two fewer than it has corners.
///
/// `at` gives the position of each of the `n` corners. A quadrilateral is cut along its shorter diagonal that stays
/// inside, larger polygons by clipping ears, so that notches are left open. The outline must not cross itself; it may
/// be slightly out of plane.
pub(super) fn split(n: usize, at: impl Fn(usize) -> Vec3, mut emit: impl FnMut([usize; 3])) {
    match n {
        0..3 => {}
        3 => emit([0, 1, 2]),
        4 => split_quad([at(0), at(1), at(2), at(3)]).map(emit).into_iter().collect(),
        _ => clip_ears(&(0..n).map(at).collect::<Vec<_>>(), emit),
    }
}

/// The two triangles of a quadrilateral.
fn split_quad([a, b, c, d]: [Vec3; 4]) -> [[usize; 3]; 2] {
    // A diagonal stays inside when the triangles on its two sides face the same way; of a dart only one does.
    let inside = |p: Vec3, q: Vec3, r: Vec3, s: Vec3| (q - p).cross(&(r - p)).dot(&(r - p).cross(&(s - p))) > 0.0;
    let (ac, bd) = (inside(a, b, c, d), inside(b, c, d, a));
    if (ac == bd && (c - a).norm_squared() <= (d - b).norm_squared()) || (ac && !bd) {
        [[0, 1, 2], [0, 2, 3]]
    } else {
        [[0, 1, 3], [1, 2, 3]]
    }
}

/// Ear clipping (Meisters 1975) in the projection along the polygon's largest normal component.
fn clip_ears(corners: &[Vec3], mut emit: impl FnMut([usize; 3])) {
    let n = corners.len();
    // Newell's normal: right for notched outlines too, where the normal at a single corner may point backwards.
    let normal: Vec3 = (0..n).map(|i| (corners[i] - corners[0]).cross(&(corners[(i + 1) % n] - corners[0]))).sum();
    let axis = normal.iamax();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let sign = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    let turn = |i: usize, j: usize, k: usize| {
        let (p, q, r) = (corners[i], corners[j], corners[k]);
        sign * ((q[u] - p[u]) * (r[v] - p[v]) - (q[v] - p[v]) * (r[u] - p[u]))
    };

    let mut next: Vec<usize> = (1..=n).map(|i| i % n).collect();
    let mut previous: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
    let is_ear = |i: usize, next: &[usize], previous: &[usize]| {
        let (h, j) = (previous[i], next[i]);
        // A straight corner is no ear: cut off, it would be a triangle without area and leave a gap beside its
        // neighbours.
        if turn(h, i, j) <= 0.0 {
            return false;
        }
        let mut k = next[j];
        while k != h {
            let within = turn(h, i, k) >= 0.0 && turn(i, j, k) >= 0.0 && turn(j, h, k) >= 0.0;
            let at_corner = || [h, i, j].iter().any(|&c| corners[c] == corners[k]);
            if within && turn(previous[k], k, next[k]) <= 0.0 && !at_corner() {
                return false;
            }
            k = next[k];
        }
        true
    };

    // Cutting an ear changes only its neighbours: what was no ear of the larger outline is none of the smaller one.
    let mut ear: Vec<bool> = (0..n).map(|i| is_ear(i, &next, &previous)).collect();
    let (mut left, mut i, mut refused) = (n, 0, 0);
    let mut looks = 3; // at all corners anew, for outlines that touch themselves
    while left > 3 {
        // After a whole round without an ear the outline is degenerate: cut anything rather than go on for ever.
        if refused > left && looks > 0 {
            (refused, looks) = (0, looks - 1);
            let mut k = i;
            for _ in 0..left {
                ear[k] = is_ear(k, &next, &previous);
                k = next[k];
            }
        }
        let (h, j) = (previous[i], next[i]);
        if ear[i] || refused > left {
            emit([h, i, j]);
            (next[h], previous[j]) = (j, h);
            (left, refused) = (left - 1, 0);
            ear[h] = is_ear(h, &next, &previous);
            ear[j] = is_ear(j, &next, &previous);
            i = next[j]; // not `j`: going on beyond it keeps the triangles from forming one thin fan
        } else {
            refused += 1;
            i = j;
        }
    }
    emit([previous[i], i, next[i]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(corners: &[Vec3]) -> Vec<[usize; 3]> {
        let mut out = Vec::new();
        split(corners.len(), |i| corners[i], |t| out.push(t));
        out
    }

    /// Sum of the areas, and norm of the sum of the area vectors: equal only if no triangle is turned over.
    fn areas(corners: &[Vec3]) -> (f64, f64) {
        let vectors = triangles(corners)
            .into_iter()
            .map(|[a, b, c]| (corners[b] - corners[a]).cross(&(corners[c] - corners[a])) * 0.5);
        let (sum, vector) = vectors.fold((0.0, Vec3::zeros()), |(s, v), a: Vec3| (s + a.norm(), v + a));
        (sum, vector.norm())
    }

    fn flat(points: &[(f64, f64)]) -> Vec<Vec3> {
        // An oblique plane, so that no coordinate is left out.
        points.iter().map(|&(x, y)| Vec3::new(x, y, 0.5 * x - 0.25 * y)).collect()
    }

    /// Area of a piece of the plane above per area of its shadow on the xy plane.
    const SLOPE: f64 = 1.145_643_923_738_96; // √(1 + 1/4 + 1/16)

    #[test]
    fn a_quad_is_cut_along_its_shorter_diagonal() {
        let kite = flat(&[(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0)]);
        assert_eq!(triangles(&kite).len(), 2);
        let skew = flat(&[(0.0, 0.0), (2.0, 0.0), (3.0, 1.0), (1.0, 1.0)]);
        assert_eq!(triangles(&skew), [[0, 1, 3], [1, 2, 3]]);
        let other = flat(&[(1.0, 0.0), (3.0, 0.0), (2.0, 1.0), (0.0, 1.0)]);
        assert_eq!(triangles(&other), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_dart_is_cut_through_its_notch() {
        for turn in 0..4 {
            let mut dart = flat(&[(0.0, 0.0), (2.0, 0.0), (0.3, 0.3), (0.0, 2.0)]);
            dart.rotate_left(turn);
            let (sum, vector) = areas(&dart);
            assert!((sum - 0.6 * SLOPE).abs() < 1e-12 && (sum - vector).abs() < 1e-12, "{sum} {vector}"); // round-off
        }
    }

    #[test]
    fn notches_and_straight_corners() {
        // A comb with a midpoint on one side: area 5 - 2 = 3 squares.
        let comb = [(0.0, 0.0), (2.5, 0.0), (5.0, 0.0), (5.0, 1.0), (4.0, 1.0), (4.0, 0.5), (3.0, 0.5), (3.0, 1.0)];
        let teeth = [(2.0, 1.0), (2.0, 0.5), (1.0, 0.5), (1.0, 1.0), (0.0, 1.0)];
        let mut corners = flat(&[&comb[..], &teeth[..]].concat());
        for reversed in [false, true] {
            if reversed {
                corners.reverse();
            }
            let (sum, vector) = areas(&corners);
            assert!((sum - 4.0 * SLOPE).abs() < 1e-12 && (sum - vector).abs() < 1e-12, "{sum} {vector}"); // round-off
            let cut = triangles(&corners);
            assert_eq!(cut.len(), corners.len() - 2);
            let flat_ones = cut.iter().filter(|t| areas(&t.map(|i| corners[i])).0 < 1e-12).count();
            assert_eq!(flat_ones, 0, "a straight corner must not become a triangle without area");
        }
    }

    #[test]
    fn a_regular_polygon_and_nonsense() {
        let round: Vec<Vec3> = (0..100)
            .map(|i| (i as f64 * 0.02 * std::f64::consts::PI).sin_cos())
            .map(|(s, c)| Vec3::new(c, s, 0.0))
            .collect();
        let exact = 50.0 * (0.02 * std::f64::consts::PI).sin();
        assert!((areas(&round).0 - exact).abs() < 1e-12); // round-off
        let point = vec![Vec3::new(1.0, 2.0, 3.0); 9];
        assert_eq!(triangles(&point).len(), 7);
        let wild: Vec<Vec3> = (0..50).map(|i| Vec3::new((i * 7 % 13) as f64, (i * 5 % 11) as f64, f64::NAN)).collect();
        assert_eq!(triangles(&wild).len(), 48);
    }
}
