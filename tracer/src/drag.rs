//! Drag in proportion to the speed.

use std::f64::consts::PI;

use thiserror::Error;

use crate::Gas;

/// Drag on a grain: m v' = -c v, or v' = -γ v with γ = c / m. The gas is at rest.
///
/// Kept apart from the other forces, because integrators that split know its exact flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drag {
    /// γ, 1/s, the same for all grains.
    Rate(f64),
    /// c, kg/s, the same for all grains.
    Coefficient(f64),
    /// Of a sphere in a gas, from the grain's radius.
    Sphere {
        /// The gas.
        gas: Gas,
        /// How molecules and grain meet.
        law: DragLaw,
    },
}

/// How the drag of a sphere follows from its radius R and the gas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DragLaw {
    /// Stokes with Cunningham's slip:
    ///
    ///   c = 6 π η R / C,  C = 1 + Kn (1.257 + 0.4 exp(-1.1 / Kn)),  Kn = λ / R
    ///
    /// η viscosity, λ mean free path. Valid for Reynolds numbers R ρ v / η below about 0.1 and, through the slip, for
    /// any Kn within some 10 %. Source: Davies 1945 (slip). Checked by `exact_drag_of_the_reference_grains`.
    Stokes,
    /// Epstein, free molecules reflected as by a mirror:
    ///
    ///   c = (4 π / 3) R² ρ v̄
    ///
    /// ρ density of the gas, v̄ mean speed of its molecules. Valid for Kn much above 1 and speeds far below v̄.
    /// Source: Epstein 1924. Checked by `exact_drag_of_the_reference_grains`.
    EpsteinSpecular,
    /// Epstein, free molecules that leave the grain at its own temperature: (1 + π/8) times the specular one.
    /// Source: Epstein 1924. Checked by `exact_drag_of_the_reference_grains`.
    EpsteinDiffuse,
}

/// Why the drag on a grain cannot be told.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DragError {
    /// A number that makes no sense.
    #[error("{what} is {value}; give {expected}")]
    Value {
        /// Which.
        what: &'static str,
        /// What it was.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
}

impl Drag {
    /// c of a grain (radius in m, mass in kg), kg/s.
    ///
    /// # Errors
    /// A negative rate or coefficient; gas drag on a grain without radius; a gas with a quantity that is not positive.
    pub fn coefficient(&self, radius: f64, mass: f64) -> Result<f64, DragError> {
        let value = |ok: bool, what, value, expected| {
            if ok { Ok(()) } else { Err(DragError::Value { what, value, expected }) }
        };
        match *self {
            Self::Rate(rate) => {
                value(rate.is_finite() && rate >= 0.0, "the drag rate", rate, "zero or more, in 1/s")?;
                Ok(rate * mass)
            }
            Self::Coefficient(c) => {
                value(c.is_finite() && c >= 0.0, "the drag coefficient", c, "zero or more, in kg/s")?;
                Ok(c)
            }
            Self::Sphere { gas, law } => {
                let positive = |what, x: f64| value(x.is_finite() && x > 0.0, what, x, "a positive number in SI units");
                positive("the radius of a grain in gas", radius)?;
                positive("the gas pressure", gas.pressure)?;
                positive("the gas temperature", gas.temperature)?;
                positive("the viscosity of the gas", gas.viscosity)?;
                positive("the mass of a gas molecule", gas.molecule_mass)?;
                Ok(law.coefficient(radius, &gas))
            }
        }
    }

    /// Temperature of the gas, K, when there is one.
    pub fn temperature(&self) -> Option<f64> {
        match self {
            Self::Sphere { gas, .. } => Some(gas.temperature),
            Self::Rate(_) | Self::Coefficient(_) => None,
        }
    }
}

impl DragLaw {
    fn coefficient(self, radius: f64, gas: &Gas) -> f64 {
        let specular = 4.0 * PI / 3.0 * radius * radius * gas.density() * gas.mean_speed();
        match self {
            Self::Stokes => {
                let knudsen = gas.mean_free_path() / radius;
                let slip = 1.0 + knudsen * (1.257 + 0.4 * (-1.1 / knudsen).exp());
                6.0 * PI * gas.viscosity * radius / slip
            }
            Self::EpsteinSpecular => specular,
            Self::EpsteinDiffuse => specular * (1.0 + PI / 8.0),
        }
    }
}
