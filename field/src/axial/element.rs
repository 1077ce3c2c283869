//! Elements of generating curves, in a parameter in which the charge is smooth up to edges.

use std::f64::consts::PI;

use meshes::profile::{Curve, Joint, Profile};
use serde::{Deserialize, Serialize};

use super::AxialBody;

/// Part of a piece of a generating curve, with its own parameter u from 0 to 1:
///
///   t = edge + (far - edge) v^power,   v = from + (to - from) u
///
/// t the parameter of the curve. With s ~ v^power the charge per parameter, s^(π/b - 1) ds/dv ~ v^(power π/b - 1) at an edge
/// with the angle b of space outside, is smooth where power π/b is a whole number: 2 for a free edge, 3 for a right angle
/// (whose further terms, powers of s^(2/3), are smooth as well).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Element {
    /// Which body.
    pub body: usize,
    /// Which curve of its profile.
    pub piece: usize,
    /// Curve parameter at v = 0: the edge, if there is one.
    pub edge: f64,
    /// Curve parameter at v = 1.
    pub far: f64,
    /// See above.
    pub power: u32,
    /// At the edge the charge has terms that the power does not make smooth.
    pub rough: bool,
    /// v where the element begins.
    pub from: f64,
    /// v where it ends.
    pub to: f64,
    /// Number of nodes; the charge per parameter is ρ times a polynomial of one degree less.
    pub order: usize,
}

impl Element {
    /// Curve parameter t and dt/du.
    pub fn curve_parameter(&self, u: f64) -> (f64, f64) {
        let v = self.from + (self.to - self.from) * u;
        let (span, n) = (self.far - self.edge, self.power as i32);
        let below = v.powi(n - 1);
        (self.edge + span * v * below, span * f64::from(n) * below * (self.to - self.from))
    }

    /// The element's parameter u for a curve parameter, where it holds it.
    pub fn parameter(&self, t: f64) -> Option<f64> {
        let v = ((t - self.edge) / (self.far - self.edge)).max(0.0).powf(1.0 / f64::from(self.power));
        let u = (v - self.from) / (self.to - self.from);
        (-1e-9..=1.0 + 1e-9).contains(&u).then(|| u.clamp(0.0, 1.0))
    }

    /// Point (ρ, z) in the frame of the axis and its derivative by u, m.
    pub fn at(&self, bodies: &[AxialBody], u: f64) -> ([f64; 2], [f64; 2]) {
        let body = &bodies[self.body];
        let (t, slope) = self.curve_parameter(u);
        let ([rho, z], [drho, dz]) = body.profile.curves[self.piece].at(t);
        let sign = if body.flipped { -1.0 } else { 1.0 };
        // A point on the axis may come out beside it by rounding.
        ([rho.max(0.0), body.height + sign * z], [drho * slope, sign * dz * slope])
    }

    /// Unit normal (ρ, z) towards the outside: on the left of the direction of travel of the profile.
    pub fn normal(&self, bodies: &[AxialBody], u: f64) -> [f64; 2] {
        let body = &bodies[self.body];
        let (_, [drho, dz]) = body.profile.curves[self.piece].at(self.curve_parameter(u).0);
        let length = drho.hypot(dz);
        let sign = if body.flipped { -1.0 } else { 1.0 };
        [-dz / length, sign * drho / length]
    }

    /// Whether it ends at a rough edge and is too short for more.
    pub(crate) fn beyond_resolution(&self) -> bool {
        self.rough && self.from == 0.0 && self.to.powi(self.power as i32) < SHORTEST
    }

    /// Its two halves.
    pub fn halves(&self) -> [Self; 2] {
        let middle = 0.5 * (self.from + self.to);
        [Self { to: middle, ..*self }, Self { from: middle, ..*self }]
    }
}

/// Angle from π below which a joint counts as smooth, rad.
const SMOOTH: f64 = 1e-6;

/// Power for joints at which the charge has terms that no power makes smooth: jumps of curvature (s ln s) and odd angles.
const ROUGH: u32 = 3;

/// Part of a piece below which nothing is resolved at rough edges. Elements shrink towards them by a factor of eight from
/// level to level, and their charge with them; but at an odd angle the potential at distance s is found to some power of s
/// only, and where s is rounding to nothing at all.
const SHORTEST: f64 = 1e-6;

/// Power of the substitution at the beginning of piece k (or, for k = number of pieces, at the end of the last), and whether
/// it leaves the charge rough.
fn power_at(profile: &Profile, k: usize) -> (u32, bool) {
    let rough = (ROUGH, true);
    match profile.joint(k) {
        // Smooth across the axis, or the tip of a cone.
        Joint::Axis => {
            let n = profile.curves.len();
            let (_, d) = if k < n { profile.curves[k].at(0.0) } else { profile.curves[n - 1].at(1.0) };
            if d[1].abs() > SMOOTH * d[0].abs() { rough } else { (1, false) }
        }
        Joint::Free => (2, false),
        Joint::Edge { vacuum } if (vacuum - PI).abs() < SMOOTH => {
            let n = profile.curves.len();
            let (before, after) = (&profile.curves[(k + n - 1) % n], &profile.curves[k % n]);
            let (one, two) = (curvature(before, 1.0), curvature(after, 0.0));
            if (one - two).abs() > 1e-2 * one.abs().max(two.abs()) { rough } else { (1, false) }
        }
        Joint::Edge { vacuum } => {
            let whole = |power: u32| {
                let x = f64::from(power) * PI / vacuum;
                (x - x.round()).abs() < 1e-6 && x > 0.5
            };
            (1..=4).find(|&power| whole(power)).map_or(rough, |power| (power, false))
        }
    }
}

/// Curvature at an end, 1/m, from a step inwards: good to a thousandth, enough to see a jump. Zero for less than that over the
/// length of the curve.
fn curvature(curve: &Curve, end: f64) -> f64 {
    let h = if end > 0.5 { -1e-4 } else { 1e-4 };
    let ((_, u), (_, v)) = (curve.at(end), curve.at(end + h));
    let turn = (u[0] * v[1] - u[1] * v[0]) / (u[0].hypot(u[1]) * v[0].hypot(v[1]));
    let bend = turn / (h * u[0].hypot(u[1]));
    if (turn / h).abs() < 1e-3 { 0.0 } else { bend }
}

/// The coarsest elements: one for each piece, two for a piece with edges at both ends.
pub(crate) fn coarsest(bodies: &[AxialBody], order: usize) -> Vec<Element> {
    let mut elements = Vec::new();
    for (b, body) in bodies.iter().enumerate() {
        let n = body.profile.curves.len();
        for piece in 0..n {
            let element = |edge: f64, far: f64, (power, rough): (u32, bool)| Element {
                body: b,
                piece,
                edge,
                far,
                power,
                rough,
                from: 0.0,
                to: 1.0,
                order,
            };
            match (power_at(&body.profile, piece), power_at(&body.profile, piece + 1)) {
                (power, (1, _)) => elements.push(element(0.0, 1.0, power)),
                ((1, _), power) => elements.push(element(1.0, 0.0, power)),
                (first, last) => elements.extend([element(0.0, 0.5, first), element(1.0, 0.5, last)]),
            }
        }
    }
    elements
}

/// A stretch of an element's parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub from: f64,
    pub to: f64,
}

impl Cell {
    pub const WHOLE: Self = Self { from: 0.0, to: 1.0 };

    /// Cuts the cell into stretches that are as far from a point as `apart` times their length; those not longer than
    /// `shortest` are taken as they are, and the answer is the parameter of such a one nearest to the point.
    pub fn cut(
        self,
        element: &Element,
        bodies: &[AxialBody],
        point: [f64; 2],
        (apart, shortest): (f64, f64),
        cells: &mut Vec<Cell>,
    ) -> Option<f64> {
        let (mut touching, mut stack) = (None::<(f64, f64)>, vec![self]);
        while let Some(cell) = stack.pop() {
            let width = cell.to - cell.from;
            let middle = 0.5 * (cell.from + cell.to);
            let (mut nearest, mut speed, mut place) = (f64::INFINITY, 0.0_f64, middle);
            for u in [cell.from, middle, cell.to] {
                let (p, d) = element.at(bodies, u);
                let distance = (p[0] - point[0]).hypot(p[1] - point[1]);
                if distance < nearest {
                    (nearest, place) = (distance, u);
                }
                speed = speed.max(d[0].hypot(d[1]));
            }
            let length = speed * width;
            // No point of the cell is farther from one of the three than a quarter of its length.
            if nearest - 0.25 * length >= apart * length {
                cells.push(cell);
            } else if length <= shortest || width < 1e-15 {
                cells.push(cell);
                if touching.is_none_or(|(d, _)| nearest < d) {
                    touching = Some((nearest, place));
                }
            } else {
                stack.push(Cell { from: middle, to: cell.to });
                stack.push(Cell { from: cell.from, to: middle });
            }
        }
        touching.map(|(_, u)| u)
    }
}
