//! Coaxial bodies of revolution, solved on their generating curves: few unknowns, and errors down to 1e-11.
//!
//! * **body**: a conductor with a [`Profile`] turned about the common axis;
//! * **element**: part of its curve with a parameter in which the charge is a polynomial, edges included ([`Element`]);
//! * **level**: elements with their charges; the next level has higher orders and shorter elements where the charge is not
//!   resolved, and judges the one before.
//!
//! The potential on the curves is imposed at Gauss's nodes (collocation). A ring of charge acts by an elliptic integral
//! (`ring`); what is near or on itself is integrated with rules for it (`assembly`).
//!
//! ```
//! use field::axial::{AxialBody, AxialProblem, AxialSum, Axis};
//! use field::constants::COULOMB;
//! use meshes::{Shape, Vec3, profile::revolved};
//!
//! // A sphere of 2 cm: its capacitance over 4πε0 is its radius.
//! let profile = revolved(&Shape::Sphere { radius: 0.02 }).unwrap()[0].profile.clone();
//! let bodies = [AxialBody { profile, electrode: 0, height: 0.0, flipped: false }];
//! let solution = AxialProblem { bodies: &bodies, electrodes: 1, sources: &[], ground: None }.solve(1e-6)?;
//! assert!((solution.capacitance.matrix[0][0] * COULOMB / 0.02 - 1.0).abs() < 1e-6);
//!
//! // Twice as far from its centre, half its potential.
//! let sums = AxialSum::every(&solution, Axis::default()).sum(&[Vec3::x() * 0.04]);
//! assert!((sums[0] - 0.5).abs() < 1e-6);
//! # Ok::<(), field::axial::AxialError>(())
//! ```

mod assembly;
mod charge;
mod element;
mod gauss;
mod ring;
mod solution;
mod solve;
mod sum;

use meshes::profile::{Joint, Profile};
use serde::{Deserialize, Serialize};

pub use charge::AxialCharge;
pub(crate) use charge::AxialPieces;
pub use element::Element;
pub use solution::{AxialData, AxialSolution, FieldDifference};
pub use sum::{AxialSum, Axis};

/// A conductor that is turned about the common axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxialBody {
    /// Its generating curve.
    pub profile: Profile,
    /// Which electrode it belongs to.
    pub electrode: usize,
    /// Height of the profile's origin on the axis, m.
    pub height: f64,
    /// The profile's axis points against the common one.
    pub flipped: bool,
}

impl AxialBody {
    /// Whether its surface has no edge to the outside: it is a solid body, or a shell that is not seen through.
    pub fn closed(&self) -> bool {
        let n = self.profile.curves.len();
        self.profile.closed || [0, n].iter().all(|&k| self.profile.joint(k) == Joint::Axis)
    }
}

/// Potential of an outside field of strength one at (ρ, z), V; about the axis it is the same all round.
pub type AxialSource<'a> = &'a (dyn Fn(f64, f64) -> f64 + Sync);

/// The electrostatic problem of coaxial bodies in given outside fields.
#[derive(Clone, Copy)]
pub struct AxialProblem<'a> {
    /// The conductors. They do not touch or cross each other.
    pub bodies: &'a [AxialBody],
    /// Number of electrodes.
    pub electrodes: usize,
    /// Outside fields; with a grounded plane they are to be zero on it.
    pub sources: &'a [AxialSource<'a>],
    /// Height of a grounded plane across the axis, m; all bodies are on one side of it.
    pub ground: Option<f64>,
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AxialError {
    /// Nothing to solve.
    #[error("there is no body")]
    NoBody,
    /// A body of an electrode that there is not.
    #[error("body {body} belongs to electrode {electrode}, but there are {electrodes}")]
    NoSuchElectrode {
        /// Which body, from 0.
        body: usize,
        /// Its electrode, from 0.
        electrode: usize,
        /// How many there are.
        electrodes: usize,
    },
    /// An electrode without a body.
    #[error("electrode {electrode} has no body")]
    NoBodyOf {
        /// Which, from 0.
        electrode: usize,
    },
    /// A curve that is a point, lies on the axis, beyond it, or is not finite.
    #[error("piece {piece} of body {body} is no curve beside the axis")]
    Degenerate {
        /// Which body, from 0.
        body: usize,
        /// Which of its curves, from 0.
        piece: usize,
    },
    /// A body on or across the grounded plane, or bodies on both sides.
    #[error("body {body} is not on the same side of the grounded plane as the rest: move it or the plane")]
    AcrossGround {
        /// Which body, from 0.
        body: usize,
    },
    /// A source's field is infinite on a body.
    #[error("the field of source number {source_number} is infinite on body {body}: move one of them")]
    SourceOnBody {
        /// Which source, from 1.
        source_number: usize,
        /// Which body, from 0.
        body: usize,
    },
    /// The equations have no solution.
    #[error("the equations cannot be solved: do bodies lie on each other?")]
    Singular,
    /// The accuracy was not reached.
    #[error("reached {reached:.1e} with {unknowns} unknowns, asked {asked:.1e}: do bodies almost touch or cross?")]
    Accuracy {
        /// The smallest error found.
        reached: f64,
        /// What it had to be.
        asked: f64,
        /// How many unknowns the last level had.
        unknowns: usize,
    },
    /// Kept numbers that are of another solution.
    #[error("the kept numbers do not belong to these bodies")]
    Data,
}

impl AxialProblem<'_> {
    fn check(&self) -> Result<(), AxialError> {
        if self.bodies.is_empty() {
            return Err(AxialError::NoBody);
        }
        let mut side = None;
        for (b, body) in self.bodies.iter().enumerate() {
            if body.electrode >= self.electrodes {
                let (electrode, electrodes) = (body.electrode, self.electrodes);
                return Err(AxialError::NoSuchElectrode { body: b, electrode, electrodes });
            }
            if body.profile.curves.is_empty() {
                return Err(AxialError::Degenerate { body: b, piece: 0 });
            }
            for (k, curve) in body.profile.curves.iter().enumerate() {
                let length = curve.length();
                let sound = |t: f64| {
                    let (p, d) = curve.at(t);
                    let finite = p.iter().chain(&d).all(|x| x.is_finite());
                    let inner = t > 0.1 && t < 0.9;
                    finite && p[0] >= -1e-9 * length && (!inner || p[0] > 0.0) && d[0].hypot(d[1]) > 0.0
                };
                if !(length > 0.0 && (0..=16).all(|i| sound(f64::from(i) / 16.0))) {
                    return Err(AxialError::Degenerate { body: b, piece: k });
                }
                if let Some(ground) = self.ground {
                    let sign = if body.flipped { -1.0 } else { 1.0 };
                    for i in 0..=16 {
                        let above = body.height + sign * curve.at(f64::from(i) / 16.0).0[1] > ground;
                        let on = body.height + sign * curve.at(f64::from(i) / 16.0).0[1] == ground;
                        if on || *side.get_or_insert(above) != above {
                            return Err(AxialError::AcrossGround { body: b });
                        }
                    }
                }
            }
        }
        match (0..self.electrodes).find(|&e| self.bodies.iter().all(|b| b.electrode != e)) {
            Some(electrode) => Err(AxialError::NoBodyOf { electrode }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
