//! Geometry of one triangle and of two.

use crate::Vec3;

/// The point of a triangle closest to `p`, m.
///
/// Source: Ericson, *Real-Time Collision Detection* (2005), section 5.1.5.
pub fn closest_point(p: &Vec3, [a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

/// Where a line `from + s · direction` meets a triangle's plane inside the triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Parameter on the line, in units of `direction`.
    pub s: f64,
    /// Smallest barycentric coordinate of the point: zero on an edge, negative up to the slack just outside.
    pub margin: f64,
}

/// The crossing of a line with a triangle, from either side; `None` for a parallel line.
///
/// Points up to `slack` (a barycentric coordinate) outside an edge count, so that a line through a shared edge of two
/// panels never slips between them.
///
/// Source: Möller and Trumbore 1997.
pub fn crossing(from: &Vec3, direction: &Vec3, [a, b, c]: &[Vec3; 3], slack: f64) -> Option<Crossing> {
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(&e2);
    let det = e1.dot(&p);
    if det.abs() <= 1e-14 * e1.norm() * e2.norm() * direction.norm() {
        return None;
    }
    let t = from - a;
    let u = t.dot(&p) / det;
    let q = t.cross(&e1);
    let v = direction.dot(&q) / det;
    let margin = u.min(v).min(1.0 - u - v);
    (margin >= -slack).then(|| Crossing { s: e2.dot(&q) / det, margin })
}

/// Distance of two segments and the closest points on them, m.
///
/// Source: Ericson (2005), section 5.1.9.
fn segment_distance(p1: &Vec3, q1: &Vec3, p2: &Vec3, q2: &Vec3) -> f64 {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let (c, b) = (d1.dot(&r), d1.dot(&d2));
    let denominator = a * e - b * b;
    let mut s = if denominator > 0.0 { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = if e > 0.0 { (b * s + f) / e } else { 0.0 };
    if t < 0.0 {
        t = 0.0;
        s = if a > 0.0 { (-c / a).clamp(0.0, 1.0) } else { 0.0 };
    } else if t > 1.0 {
        t = 1.0;
        s = if a > 0.0 { ((b - c) / a).clamp(0.0, 1.0) } else { 0.0 };
    }
    ((p1 + d1 * s) - (p2 + d2 * t)).norm()
}

/// Distance of two triangles, m; zero where they cut or touch each other.
pub fn distance(t1: &[Vec3; 3], t2: &[Vec3; 3]) -> f64 {
    for (one, other) in [(t1, t2), (t2, t1)] {
        for k in 0..3 {
            let (from, to) = (one[k], one[(k + 1) % 3]);
            if crossing(&from, &(to - from), other, 0.0).is_some_and(|hit| (0.0..=1.0).contains(&hit.s)) {
                return 0.0;
            }
        }
    }
    let mut least = f64::INFINITY;
    for i in 0..3 {
        least = least.min((t1[i] - closest_point(&t1[i], t2)).norm());
        least = least.min((t2[i] - closest_point(&t2[i], t1)).norm());
        for j in 0..3 {
            least = least.min(segment_distance(&t1[i], &t1[(i + 1) % 3], &t2[j], &t2[(j + 1) % 3]));
        }
    }
    least
}

/// Longest side over the height on it: 1.15 for an equilateral triangle, without bound for a sliver.
pub fn aspect_ratio([a, b, c]: &[Vec3; 3]) -> f64 {
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    longest * longest / (b - a).cross(&(c - a)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vec3 {
        Vec3::new(x, y, z)
    }

    const SLACK: f64 = 1e-12;

    #[test]
    fn closest_point_in_every_region_of_the_plane() {
        let t = [v(0.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0)];
        for (p, expected) in [
            (v(0.5, 0.5, 3.0), v(0.5, 0.5, 0.0)),
            (v(-1.0, -1.0, 1.0), v(0.0, 0.0, 0.0)),
            (v(1.0, -2.0, 0.0), v(1.0, 0.0, 0.0)),
            (v(4.0, 0.0, 0.0), v(2.0, 0.0, 0.0)),
            (v(2.0, 2.0, -1.0), v(1.0, 1.0, 0.0)),
            (v(0.0, 5.0, 0.0), v(0.0, 2.0, 0.0)),
            (v(-3.0, 1.0, 0.0), v(0.0, 1.0, 0.0)),
        ] {
            assert!((closest_point(&p, &t) - expected).norm() < 1e-15, "{p} -> {}", closest_point(&p, &t));
        }
    }

    #[test]
    fn crossing_counts_the_edge_and_not_what_is_beyond() {
        let t = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)];
        let down = v(0.0, 0.0, -2.0);
        assert_eq!(crossing(&v(0.25, 0.25, 1.0), &down, &t, SLACK).map(|c| c.s), Some(0.5));
        assert_eq!(crossing(&v(0.5, 0.0, 1.0), &down, &t, SLACK).map(|c| c.margin), Some(0.0));
        assert_eq!(crossing(&v(0.5, -1e-6, 1.0), &down, &t, SLACK), None);
        assert_eq!(crossing(&v(0.2, 0.2, 1.0), &v(1.0, 0.0, 0.0), &t, SLACK), None);
    }

    #[test]
    fn distance_of_triangles_cut_touching_and_apart() {
        let t = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)];
        let shifted = |d: Vec3| t.map(|p| p + d);
        assert_eq!(distance(&t, &[v(0.2, 0.2, -1.0), v(0.2, 0.2, 1.0), v(3.0, 3.0, 1.0)]), 0.0);
        assert!((distance(&t, &shifted(v(0.1, 0.1, 0.3))) - 0.3).abs() < 1e-15);
        assert!((distance(&t, &shifted(v(3.0, 0.0, 0.0))) - 2.0).abs() < 1e-15);
        assert_eq!(distance(&t, &shifted(v(1.0, 0.0, 0.0))), 0.0);
    }
}
