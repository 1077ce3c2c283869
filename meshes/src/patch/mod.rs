//! Surfaces as smooth quadrilateral patches: what curved elements of high order are cut from.
//!
//! A patch maps the unit square to the true surface. Its sides say what happens to charge there: it goes on smoothly, or
//! crowds as at a free edge or a corner. Patches of a shape meet along their sides but need not share corners.

mod shapes;

use serde::{Deserialize, Serialize};
pub use shapes::patches;

use crate::profile::{Curve, Joint};
use crate::{Placement, ShapeError, Vec3};

/// What stands at one side of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Side {
    /// The surface goes on smoothly, or the side shrinks to a point of the axis.
    Smooth,
    /// An edge between two faces, or the free edge of a sheet: charge density as (distance)^(π/vacuum - 1), where `vacuum` is
    /// the angle of the space outside, rad: 3π/2 at the edge of a box, 2π at a free edge.
    Edge {
        /// rad.
        vacuum: f64,
    },
}

impl Side {
    /// The free edge of a sheet.
    pub const FREE: Self = Self::Edge { vacuum: std::f64::consts::TAU };
    /// A convex right-angled edge.
    pub const CORNER: Self = Self::Edge { vacuum: 1.5 * std::f64::consts::PI };

    /// The power of a parameter t, distance ~ t^power, in which density times dt is smooth: density s^(π/vacuum - 1) and
    /// s = t^k give t^(k π/vacuum - 1), a whole power for k = 2 at a free edge and k = 3 at a right-angled one.
    fn power(self) -> u8 {
        match self {
            Self::Edge { vacuum } if vacuum > 1.75 * std::f64::consts::PI => 2,
            Self::Edge { vacuum } if vacuum > 1.02 * std::f64::consts::PI => 3,
            _ => 1,
        }
    }

    fn of(joint: Joint) -> Self {
        match joint {
            Joint::Axis => Self::Smooth,
            Joint::Free => Self::FREE,
            Joint::Edge { vacuum } if (vacuum / std::f64::consts::PI - 1.0).abs() < 1e-6 => Self::Smooth,
            Joint::Edge { vacuum } => Self::Edge { vacuum },
        }
    }
}

/// A line or part of a circle in space, for a parameter from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Path {
    /// A straight line.
    Line {
        /// m.
        from: Vec3,
        /// m.
        to: Vec3,
    },
    /// center + cosine cos θ + sine sin θ.
    Arc {
        /// m.
        center: Vec3,
        /// The radius towards θ = 0, m.
        cosine: Vec3,
        /// The radius towards θ = π/2, m.
        sine: Vec3,
        /// θ where it begins, rad.
        from: f64,
        /// θ where it ends, rad.
        to: f64,
    },
}

impl Path {
    /// The point at a parameter, m, and its derivative.
    pub fn at(&self, t: f64) -> (Vec3, Vec3) {
        match *self {
            Self::Line { from, to } => {
                (if t <= 0.5 { from + (to - from) * t } else { to - (to - from) * (1.0 - t) }, to - from)
            }
            Self::Arc { center, cosine, sine, from, to } => {
                let (s, c) = (from + t * (to - from)).sin_cos();
                (center + cosine * c + sine * s, (sine * c - cosine * s) * (to - from))
            }
        }
    }
}

/// The form of a patch: the unit square (u, v) in space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum PatchForm {
    /// A piece of a generating curve (along u) turned about `e3` from one azimuth to another (along v).
    Revolved {
        /// Generating curve.
        curve: Curve,
        /// Where its axis stands, m.
        center: Vec3,
        /// `[e1, e2, e3]`, right-handed.
        frame: [Vec3; 3],
        /// rad.
        from: f64,
        /// rad.
        to: f64,
    },
    /// Straight lines along u from a point of one path to the point of another at the same v.
    Ruled {
        /// At u = 0.
        first: Path,
        /// At u = 1.
        last: Path,
    },
}

/// A point of a patch in the form (A + s B + c e) in which a tensor grid of points is cheap: s and c depend on u alone, A and B on v
/// alone, e is a constant direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// A, m.
    pub base: Vec3,
    /// B.
    pub step: Vec3,
}

/// How a parameter of a patch is stretched, so that charge per parameter is smooth up to the sides.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Warp {
    start: u8,
    end: u8,
}

impl Warp {
    /// u at ξ, and du/dξ.
    fn at(self, x: f64) -> (f64, f64) {
        let half_pi = std::f64::consts::FRAC_PI_2;
        match (self.start, self.end) {
            (1, 1) => (x, 1.0),
            (k, 1) => (x.powi(k.into()), f64::from(k) * x.powi(i32::from(k) - 1)),
            (1, k) => {
                let y = 1.0 - x;
                (1.0 - y.powi(k.into()), f64::from(k) * y.powi(i32::from(k) - 1))
            }
            (2, 2) => {
                let (s, c) = (half_pi * x).sin_cos();
                (s * s, 2.0 * half_pi * s * c)
            }
            // x³ (10 - 15 x + 6 x²): third order at both ends; also good where one end is of second order.
            _ => {
                let y = 1.0 - x;
                let u = if x <= 0.5 {
                    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
                } else {
                    1.0 - y * y * y * (10.0 - 15.0 * y + 6.0 * y * y)
                };
                (u, 30.0 * x * x * y * y)
            }
        }
    }

    /// ξ at u, by bisection of the increasing function.
    fn inverse(self, u: f64) -> f64 {
        if (self.start, self.end) == (1, 1) {
            return u;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.at(middle).0 < u { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// A smooth part of a surface. Its parameters (ξ, η) are those of the form, stretched towards sides where charge crowds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// Its form.
    pub form: PatchForm,
    /// What stands at u = 0, u = 1, v = 0 and v = 1.
    pub sides: [Side; 4],
}

impl Patch {
    fn warp(&self, along: usize) -> Warp {
        Warp { start: self.sides[2 * along].power(), end: self.sides[2 * along + 1].power() }
    }

    /// s and c of [`Column`] at ξ.
    pub fn row(&self, xi: f64) -> [f64; 2] {
        let u = self.warp(0).at(xi).0;
        match &self.form {
            PatchForm::Revolved { curve, .. } => curve.at(u).0,
            PatchForm::Ruled { .. } => [u, 0.0],
        }
    }

    /// A and B of [`Column`] at η.
    pub fn column(&self, eta: f64) -> Column {
        let v = self.warp(1).at(eta).0;
        match &self.form {
            PatchForm::Revolved { center, frame, from, to, .. } => {
                let (sin, cos) = (from + v * (to - from)).sin_cos();
                Column { base: *center, step: frame[0] * cos + frame[1] * sin }
            }
            PatchForm::Ruled { first, last } => {
                let (a, b) = (first.at(v).0, last.at(v).0);
                Column { base: a, step: b - a }
            }
        }
    }

    /// e of [`Column`].
    pub fn direction(&self) -> Vec3 {
        match &self.form {
            PatchForm::Revolved { frame, .. } => frame[2],
            PatchForm::Ruled { .. } => Vec3::zeros(),
        }
    }

    /// The point at (ξ, η), m.
    pub fn at(&self, xi: f64, eta: f64) -> Vec3 {
        let ([s, c], column) = (self.row(xi), self.column(eta));
        column.base + column.step * s + self.direction() * c
    }

    /// ∂X/∂ξ and ∂X/∂η, m; their cross product points outwards.
    pub fn tangents(&self, xi: f64, eta: f64) -> [Vec3; 2] {
        let ((u, du), (v, dv)) = (self.warp(0).at(xi), self.warp(1).at(eta));
        match &self.form {
            PatchForm::Revolved { curve, frame, from, to, .. } => {
                let (p, d) = curve.at(u);
                let (sin, cos) = (from + v * (to - from)).sin_cos();
                let along = (frame[0] * cos + frame[1] * sin) * d[0] + frame[2] * d[1];
                let round = (frame[1] * cos - frame[0] * sin) * (p[0] * (to - from));
                [along * du, round * dv]
            }
            PatchForm::Ruled { first, last } => {
                let ((a, da), (b, db)) = (first.at(v), last.at(v));
                [(b - a) * du, (da + (db - da) * u) * dv]
            }
        }
    }

    /// The parameters (ξ, η) of the point of the patch near a point on or near its surface, clamped to the patch.
    pub fn parameters(&self, point: &Vec3) -> [f64; 2] {
        let (u, v) = match &self.form {
            PatchForm::Revolved { curve, center, frame, from, to } => {
                let d = point - center;
                let (x, y, z) = (d.dot(&frame[0]), d.dot(&frame[1]), d.dot(&frame[2]));
                let middle = 0.5 * (from + to);
                let turn = (y.atan2(x) - middle).sin().atan2((y.atan2(x) - middle).cos());
                (curve.nearest([x.hypot(y), z]), (middle + turn - from) / (to - from))
            }
            PatchForm::Ruled { first, last } => {
                let (mut u, mut v) = (0.5, 0.5);
                for _ in 0..12 {
                    let ((a, da), (b, db)) = (first.at(v), last.at(v));
                    let off = point - (a + (b - a) * u);
                    let (s, t) = (b - a, da + (db - da) * u);
                    let (ss, st, tt) = (s.dot(&s), s.dot(&t), t.dot(&t));
                    let det = (ss * tt - st * st).max(f64::MIN_POSITIVE);
                    let (f, g) = (off.dot(&s), off.dot(&t));
                    u = (u + (f * tt - g * st) / det).clamp(-0.2, 1.2);
                    v = (v + (g * ss - f * st) / det).clamp(-0.2, 1.2);
                }
                (u, v)
            }
        };
        [self.warp(0).inverse(u.clamp(0.0, 1.0)), self.warp(1).inverse(v.clamp(0.0, 1.0))]
    }

    /// The patch in the frame in which its shape stands.
    ///
    /// # Errors
    /// As [`Placement::frame`].
    pub fn placed(&self, placement: &Placement) -> Result<Self, ShapeError> {
        let frame = placement.frame()?;
        let turn = |v: &Vec3| frame[0] * v.x + frame[1] * v.y + frame[2] * v.z;
        let shift = |v: &Vec3| placement.center + turn(v);
        let path = |path: &Path| match path {
            Path::Line { from, to } => Path::Line { from: shift(from), to: shift(to) },
            Path::Arc { center, cosine, sine, from, to } => {
                Path::Arc { center: shift(center), cosine: turn(cosine), sine: turn(sine), from: *from, to: *to }
            }
        };
        let form = match &self.form {
            PatchForm::Revolved { curve, center, frame, from, to } => PatchForm::Revolved {
                curve: *curve,
                center: shift(center),
                frame: [turn(&frame[0]), turn(&frame[1]), turn(&frame[2])],
                from: *from,
                to: *to,
            },
            PatchForm::Ruled { first, last } => PatchForm::Ruled { first: path(first), last: path(last) },
        };
        Ok(Self { form, sides: self.sides })
    }
}

#[cfg(test)]
mod tests;
