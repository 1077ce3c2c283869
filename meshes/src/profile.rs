//! Surfaces of revolution as what they are: curves in the half plane beside an axis, turned about it.
//!
//! What solves with curved elements needs the true surface, not its facets. A shape that is made of bodies of revolution gives
//! them here in closed form; [`crate::triangulate()`] gives the same surfaces as triangles.

use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

use crate::lattice::wires_along;
use crate::triangulate::CLEARANCE;
use crate::{GridPattern, Shape, Vec3, Weave};

/// A smooth piece of a generating curve: points (distance from the axis, height), m, for a parameter from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// A straight line.
    Line {
        /// Where it begins, m.
        from: [f64; 2],
        /// Where it ends, m.
        to: [f64; 2],
    },
    /// Part of a circle: centre + radius (sin θ, cos θ).
    Arc {
        /// Its centre, m.
        center: [f64; 2],
        /// m.
        radius: f64,
        /// θ where it begins, rad, from the direction of the axis.
        from: f64,
        /// θ where it ends, rad.
        to: f64,
    },
    /// Part of a hyperbola about the axis: (a sinh τ, b cosh τ) if `across` is false, (a cosh τ, b sinh τ) if it is true.
    Hyperbola {
        /// The half axes a and b, m.
        axes: [f64; 2],
        /// The vertex is beside the axis (a ring), not on it (a cap).
        across: bool,
        /// τ where it begins.
        from: f64,
        /// τ where it ends.
        to: f64,
    },
}

impl Curve {
    /// The point at a parameter from 0 to 1, m, and its derivative by the parameter, m.
    pub fn at(&self, t: f64) -> ([f64; 2], [f64; 2]) {
        match *self {
            Self::Line { from, to } => {
                let step = [to[0] - from[0], to[1] - from[1]];
                // From the nearer end: an end on the axis is on it exactly.
                let point = |k: usize| if t <= 0.5 { from[k] + t * step[k] } else { to[k] - (1.0 - t) * step[k] };
                ([point(0), point(1)], step)
            }
            Self::Arc { center, radius, from, to } => {
                let (sin, cos) = (from + t * (to - from)).sin_cos();
                let speed = radius * (to - from);
                ([center[0] + radius * sin, center[1] + radius * cos], [speed * cos, -speed * sin])
            }
            Self::Hyperbola { axes: [a, b], across, from, to } => {
                let (tau, speed) = (from + t * (to - from), to - from);
                let (sinh, cosh) = (tau.sinh(), tau.cosh());
                if across {
                    ([a * cosh, b * sinh], [speed * a * sinh, speed * b * cosh])
                } else {
                    ([a * sinh, b * cosh], [speed * a * cosh, speed * b * sinh])
                }
            }
        }
    }

    /// Parameter of its point next to a point (distance from the axis, height) near it, from 0 to 1.
    pub fn nearest(&self, [r, z]: [f64; 2]) -> f64 {
        let t = match *self {
            Self::Line { from, to } => {
                let d = [to[0] - from[0], to[1] - from[1]];
                ((r - from[0]) * d[0] + (z - from[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1])
            }
            Self::Arc { center, from, to, .. } => {
                let middle = 0.5 * (from + to);
                let angle = (r - center[0]).atan2(z - center[1]) - middle;
                (middle + angle.sin().atan2(angle.cos()) - from) / (to - from)
            }
            Self::Hyperbola { axes: [a, b], across, from, to } => {
                let tau = if across { (z / b).asinh() } else { (r / a).asinh() };
                (tau - from) / (to - from)
            }
        };
        t.clamp(0.0, 1.0)
    }

    /// Its length, m: exact for lines and arcs, to 1e-6 for hyperbolas.
    pub fn length(&self) -> f64 {
        match *self {
            Self::Line { from, to } => (to[0] - from[0]).hypot(to[1] - from[1]),
            Self::Arc { radius, from, to, .. } => radius * (to - from).abs(),
            Self::Hyperbola { .. } => {
                const N: usize = 2000;
                let speed = |k: usize| {
                    let (_, d) = self.at(k as f64 / N as f64);
                    d[0].hypot(d[1])
                };
                let ends = 0.5 * (speed(0) + speed(N));
                (ends + (1..N).map(speed).sum::<f64>()) / N as f64
            }
        }
    }
}

/// A generating curve: pieces one after the other, with the outside on the left of the direction of travel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Its pieces; each begins where the one before ends.
    pub curves: Vec<Curve>,
    /// The last piece ends where the first begins, off the axis: a torus.
    pub closed: bool,
}

/// What stands at one end of a piece of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Joint {
    /// The axis, which the surface crosses smoothly.
    Axis,
    /// The next piece, at an angle: `vacuum` is the angle (rad) of the space outside, π where the surface goes on smoothly,
    /// 3π/2 at a convex right-angled edge. Charge density goes as s^(π/vacuum - 1) at distance s.
    Edge {
        /// rad.
        vacuum: f64,
    },
    /// The free edge of a sheet: density as s^(-1/2).
    Free,
}

impl Profile {
    /// What stands at the beginning of piece `k`; at the end of piece `k` stands what begins piece `k + 1`.
    pub fn joint(&self, k: usize) -> Joint {
        let n = self.curves.len();
        let on_axis = |p: [f64; 2], length: f64| p[0].abs() <= 1e-9 * length;
        let (before, after) = match (k, self.closed) {
            (0, true) => (n - 1, 0),
            (k, true) if k >= n => (n - 1, 0),
            (0, false) => {
                let first = &self.curves[0];
                return if on_axis(first.at(0.0).0, first.length()) { Joint::Axis } else { Joint::Free };
            }
            (k, false) if k >= n => {
                let last = &self.curves[n - 1];
                return if on_axis(last.at(1.0).0, last.length()) { Joint::Axis } else { Joint::Free };
            }
            (k, _) => (k - 1, k),
        };
        let (u, v) = (self.curves[before].at(1.0).1, self.curves[after].at(0.0).1);
        // Outside on the left: a turn to the right is a convex edge.
        let turn = (u[0] * v[1] - u[1] * v[0]).atan2(u[0] * v[0] + u[1] * v[1]);
        Joint::Edge { vacuum: PI - turn }
    }
}

/// A profile and where its axis stands, in the frame of the shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolved {
    /// The generating curve.
    pub profile: Profile,
    /// The origin of its heights, m.
    pub center: Vec3,
    /// `[e1, e2, e3]`, orthonormal and right-handed; `e3` is the axis.
    pub frame: [Vec3; 3],
}

/// The bodies of revolution that a shape is made of, or `None` for a shape that is not.
pub fn revolved(shape: &Shape) -> Option<Vec<Revolved>> {
    let profile = match *shape {
        Shape::Sphere { radius } => open(vec![
            Curve::Arc { center: [0.0, 0.0], radius, from: 0.0, to: FRAC_PI_2 },
            Curve::Arc { center: [0.0, 0.0], radius, from: FRAC_PI_2, to: PI },
        ]),
        Shape::Ring { radius, wire_radius } => {
            // Clockwise from the top: the outside stays on the left.
            let quarter = |k: u8| Curve::Arc {
                center: [radius, 0.0],
                radius: wire_radius,
                from: f64::from(k) * FRAC_PI_2,
                to: f64::from(k + 1) * FRAC_PI_2,
            };
            Profile { curves: (0..4).map(quarter).collect(), closed: true }
        }
        Shape::Disc { radius, hole_radius, thickness } => disc(radius, hole_radius, thickness),
        Shape::EndCap { radius, opening, thickness } => end_cap(radius, opening, thickness),
        Shape::Cylinder { radius, length, caps } => {
            let h = 0.5 * length;
            if caps {
                open(polygon(&[[0.0, h], [radius, h], [radius, -h], [0.0, -h]]))
            } else {
                open(polygon(&[[radius, h], [radius, -h]]))
            }
        }
        Shape::Rod { radius, length } => rod(radius, length),
        Shape::HyperbolicRing { r0, extent, .. } => {
            let end = (extent / r0).acosh();
            let piece = |from, to| Curve::Hyperbola { axes: [r0, r0 / 2.0_f64.sqrt()], across: true, from, to };
            // From below upwards: the side that faces the axis is the outside.
            open(vec![piece(-end, 0.0), piece(0.0, end)])
        }
        Shape::HyperbolicCap { z0, extent, .. } => {
            let end = (extent / (2.0_f64.sqrt() * z0)).asinh();
            open(vec![Curve::Hyperbola { axes: [2.0_f64.sqrt() * z0, z0], across: false, from: end, to: 0.0 }])
        }
        Shape::Wire { ref points, wire_radius } => {
            let [a, b] = points.as_slice() else { return None };
            return Some(vec![straight_wire(a, b, wire_radius)]);
        }
        Shape::GridPlate { outline, pitch, pattern: GridPattern::Wires { weave, wire_radius } } => {
            let layers: &[(bool, f64)] = match weave {
                Weave::Parallel => &[(true, 0.0)],
                Weave::Crossed => {
                    let lift = (1.0 + 0.5 * CLEARANCE) * wire_radius;
                    &[(true, -lift), (false, lift)]
                }
                Weave::Woven => return None,
            };
            let wires = layers.iter().flat_map(|&(second, height)| {
                wires_along(outline, pitch, wire_radius, second).into_iter().map(move |(across, half)| {
                    let at = |along: f64| {
                        if second { Vec3::new(across, along, height) } else { Vec3::new(along, across, height) }
                    };
                    straight_wire(&at(-half), &at(half), wire_radius)
                })
            });
            return Some(wires.collect());
        }
        Shape::Plate { .. } | Shape::GridPlate { .. } | Shape::Box { .. } | Shape::Mesh { .. } => return None,
    };
    let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
    Some(vec![Revolved { profile, center: Vec3::zeros(), frame }])
}

fn open(curves: Vec<Curve>) -> Profile {
    Profile { curves, closed: false }
}

/// Straight lines from point to point.
fn polygon(points: &[[f64; 2]]) -> Vec<Curve> {
    points.windows(2).map(|w| Curve::Line { from: w[0], to: w[1] }).collect()
}

fn disc(radius: f64, hole: f64, thickness: f64) -> Profile {
    let h = 0.5 * thickness;
    match (hole > 0.0, thickness > 0.0) {
        // A sheet, normals up: the outside is above.
        (_, false) => open(polygon(&[[hole, 0.0], [radius, 0.0]])),
        (false, true) => open(polygon(&[[0.0, h], [radius, h], [radius, -h], [0.0, -h]])),
        (true, true) => {
            let curves = polygon(&[[hole, h], [radius, h], [radius, -h], [hole, -h], [hole, h]]);
            Profile { curves, closed: true }
        }
    }
}

fn end_cap(radius: f64, opening: f64, thickness: f64) -> Profile {
    let arc = |radius, from, to| Curve::Arc { center: [0.0, 0.0], radius, from, to };
    // Long arcs in two, so that no piece goes round more than a right angle.
    let arcs = |radius, from: f64, to: f64| {
        let middle = 0.5 * (from + to);
        if (to - from).abs() > FRAC_PI_2 * (1.0 + 1e-9) {
            vec![arc(radius, from, middle), arc(radius, middle, to)]
        } else {
            vec![arc(radius, from, to)]
        }
    };
    if thickness == 0.0 {
        return open(arcs(radius, 0.0, opening));
    }
    let outer = radius + thickness;
    let (sin, cos) = opening.sin_cos();
    let mut curves = arcs(outer, 0.0, opening);
    curves.push(Curve::Line { from: [outer * sin, outer * cos], to: [radius * sin, radius * cos] });
    curves.extend(arcs(radius, opening, 0.0));
    open(curves)
}

/// A rod with hemispherical ends, `length` from tip to tip.
fn rod(radius: f64, length: f64) -> Profile {
    let h = 0.5 * length - radius;
    let dome = |z, from, to| Curve::Arc { center: [0.0, z], radius, from, to };
    let mut curves = vec![dome(h, 0.0, FRAC_PI_2)];
    if h > 1e-9 * radius {
        curves.extend(polygon(&[[radius, h], [radius, -h]]));
    }
    curves.push(dome(-h, FRAC_PI_2, PI));
    open(curves)
}

/// A wire from tip to tip; its hemispherical ends are within.
fn straight_wire(a: &Vec3, b: &Vec3, wire_radius: f64) -> Revolved {
    let length = (b - a).norm();
    let e3 = (b - a) / length;
    let e1 = e3.cross(&Vec3::ith(e3.iamin(), 1.0)).normalize();
    let frame = [e1, e3.cross(&e1), e3];
    Revolved { profile: rod(wire_radius, length), center: (a + b) * 0.5, frame }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{Outline, triangulate};

    fn shapes() -> Vec<Shape> {
        vec![
            Shape::Sphere { radius: 0.7 },
            Shape::Ring { radius: 1.0, wire_radius: 0.1 },
            Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.0 },
            Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.0 },
            Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.2 },
            Shape::EndCap { radius: 1.0, opening: 1.2, thickness: 0.0 },
            Shape::EndCap { radius: 1.0, opening: 2.5, thickness: 0.1 },
            Shape::Cylinder { radius: 0.5, length: 2.0, caps: true },
            Shape::Cylinder { radius: 0.5, length: 2.0, caps: false },
            Shape::Rod { radius: 0.2, length: 1.5 },
            Shape::Wire { points: vec![Vec3::zeros(), Vec3::new(0.0, 1.0, 1.0)], wire_radius: 0.1 },
            Shape::GridPlate {
                outline: Outline::Disc(1.0),
                pitch: 0.4,
                pattern: GridPattern::Wires { weave: Weave::Crossed, wire_radius: 0.02 },
            },
        ]
    }

    fn area(body: &Revolved) -> f64 {
        const N: usize = 4000;
        let ring = |curve: &Curve, t: f64| {
            let (p, d) = curve.at(t);
            TAU * p[0] * d[0].hypot(d[1]) / N as f64
        };
        body.profile.curves.iter().map(|c| (0..N).map(|k| ring(c, (k as f64 + 0.5) / N as f64)).sum::<f64>()).sum()
    }

    #[test]
    fn profiles_have_the_area_and_the_reach_of_the_triangles() {
        for shape in shapes() {
            let bodies = revolved(&shape).unwrap();
            let mesh = triangulate(&shape, 4.0).unwrap();
            let whole: f64 = bodies.iter().map(area).sum();
            // Wires are meshed with sides that hold the charge of round ones, not their area.
            assert!((mesh.area() / whole - 1.0).abs() < 1e-2, "{shape:?}: {} {whole}", mesh.area());
            for body in &bodies {
                for curve in &body.profile.curves {
                    for k in 0..=10 {
                        let ([r, z], _) = curve.at(f64::from(k) / 10.0);
                        let p = body.center + body.frame[0] * r + body.frame[2] * z;
                        let nearest = mesh.vertices.iter().map(|v| (v - p).norm()).fold(f64::INFINITY, f64::min);
                        assert!(nearest < 0.15, "{shape:?}: {nearest} at {p}");
                    }
                }
            }
        }
    }

    #[test]
    fn pieces_join_with_the_outside_on_the_left() {
        for shape in shapes() {
            for body in revolved(&shape).unwrap() {
                let curves = &body.profile.curves;
                for k in 1..curves.len() {
                    let (a, b) = (curves[k - 1].at(1.0).0, curves[k].at(0.0).0);
                    assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12, "{shape:?} at {k}");
                    let Joint::Edge { vacuum } = body.profile.joint(k) else { panic!("{shape:?} at {k}") };
                    assert!(vacuum > PI - 1e-7 && vacuum < 1.51 * PI, "{shape:?} at {k}: {vacuum}");
                }
            }
        }
        let joints = |shape: &Shape| {
            let profile = revolved(shape).unwrap().swap_remove(0).profile;
            (profile.joint(0), profile.joint(profile.curves.len()))
        };
        assert_eq!(joints(&Shape::Sphere { radius: 1.0 }), (Joint::Axis, Joint::Axis));
        assert_eq!(joints(&Shape::Cylinder { radius: 1.0, length: 1.0, caps: false }), (Joint::Free, Joint::Free));
        let cap = Shape::HyperbolicCap { r0: 1.0, z0: 0.7, extent: 2.0 };
        assert_eq!(joints(&cap), (Joint::Free, Joint::Axis));
    }

    #[test]
    fn derivatives_are_those_of_the_points() {
        for shape in shapes().into_iter().chain([Shape::HyperbolicRing { r0: 1.0, z0: 0.7, extent: 2.0 }]) {
            for curve in revolved(&shape).unwrap().iter().flat_map(|b| &b.profile.curves) {
                let (t, h) = (0.37, 1e-5);
                let ((p, _), (q, _), (_, d)) = (curve.at(t + h), curve.at(t - h), curve.at(t));
                for k in 0..2 {
                    assert!(((p[k] - q[k]) / (2.0 * h) - d[k]).abs() < 1e-8, "{curve:?}");
                }
                let middle: f64 =
                    (0..1000).map(|k| curve.at((f64::from(k) + 0.5) / 1000.0).1).map(|d| d[0].hypot(d[1])).sum();
                assert!((middle / 1000.0 / curve.length() - 1.0).abs() < 1e-6);
            }
        }
    }
}
