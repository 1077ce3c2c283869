//! The gas between the grains.

use std::f64::consts::PI;

use crate::constants::{ATOMIC_MASS, BOLTZMANN};

/// A gas at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gas {
    /// Mass of a molecule, kg.
    pub molecule_mass: f64,
    /// Viscosity η at `temperature`, Pa s.
    pub viscosity: f64,
    /// Pa.
    pub pressure: f64,
    /// K.
    pub temperature: f64,
}

/// Gases whose viscosity is known here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GasKind {
    /// Dry air.
    Air,
    /// N2.
    Nitrogen,
    /// Ar.
    Argon,
    /// He.
    Helium,
    /// H2.
    Hydrogen,
    /// Ne.
    Neon,
    /// O2.
    Oxygen,
    /// CO2.
    CarbonDioxide,
    /// Kr.
    Krypton,
    /// Xe.
    Xenon,
}

impl GasKind {
    /// Mass of a molecule, kg: standard atomic weights (IUPAC 2021, abridged); air as in the U.S. Standard Atmosphere 1976.
    pub fn molecule_mass(self) -> f64 {
        ATOMIC_MASS
            * match self {
                Self::Air => 28.9644,
                Self::Nitrogen => 28.014,
                Self::Argon => 39.95,
                Self::Helium => 4.0026,
                Self::Hydrogen => 2.016,
                Self::Neon => 20.180,
                Self::Oxygen => 31.998,
                Self::CarbonDioxide => 44.009,
                Self::Krypton => 83.798,
                Self::Xenon => 131.29,
            }
    }

    /// Viscosity of the dilute gas, Pa s; it does not depend on the pressure.
    ///
    ///   air:     η = β T^(3/2) / (T + S),  β = 1.458e-6 kg/(s m K^½), S = 110.4 K
    ///   others:  η = η0 (T / 273 K)^ω
    ///
    /// T temperature, K. Valid from about 200 K to 600 K, where it is within 2 % of measured values; no check is made.
    ///
    /// Source: air, Sutherland's law of the U.S. Standard Atmosphere 1976, equation 51; others, Bird, *Molecular Gas
    /// Dynamics and the Direct Simulation of Gas Flows* (1994), appendix A, table A1. Checked by
    /// `viscosities_are_near_measured_ones`.
    pub fn viscosity(self, temperature: f64) -> f64 {
        let (at_273, exponent) = match self {
            Self::Air => return 1.458e-6 * temperature.powf(1.5) / (temperature + 110.4),
            Self::Nitrogen => (1.656e-5, 0.74),
            Self::Argon => (2.117e-5, 0.81),
            Self::Helium => (1.865e-5, 0.66),
            Self::Hydrogen => (8.45e-6, 0.67),
            Self::Neon => (2.975e-5, 0.66),
            Self::Oxygen => (1.919e-5, 0.77),
            Self::CarbonDioxide => (1.380e-5, 0.93),
            Self::Krypton => (2.328e-5, 0.80),
            Self::Xenon => (2.107e-5, 0.85),
        };
        at_273 * (temperature / 273.0).powf(exponent)
    }
}

impl Gas {
    /// A known gas at a pressure (Pa) and a temperature (K).
    pub fn new(kind: GasKind, pressure: f64, temperature: f64) -> Self {
        let (molecule_mass, viscosity) = (kind.molecule_mass(), kind.viscosity(temperature));
        Self { molecule_mass, viscosity, pressure, temperature }
    }

    /// Density, kg/m³, of the ideal gas: ρ = p m / (kB T).
    pub fn density(&self) -> f64 {
        self.pressure * self.molecule_mass / (BOLTZMANN * self.temperature)
    }

    /// Mean speed of a molecule, m/s: v̄ = sqrt(8 kB T / (π m)).
    pub fn mean_speed(&self) -> f64 {
        (8.0 * BOLTZMANN * self.temperature / (PI * self.molecule_mass)).sqrt()
    }

    /// Mean free path, m:
    ///
    ///   λ = (η / p) sqrt(π kB T / (2 m))
    ///
    /// η viscosity, p pressure, m mass of a molecule. Source: kinetic theory, the definition that goes with the
    /// coefficients of Cunningham's slip used here (Davies 1945). Checked by `exact_drag_of_the_reference_grains`.
    pub fn mean_free_path(&self) -> f64 {
        self.viscosity / self.pressure * (PI * BOLTZMANN * self.temperature / (2.0 * self.molecule_mass)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viscosities_are_near_measured_ones() {
        // µPa s at 300 K and 0.1 MPa, CRC Handbook of Chemistry and Physics, "Viscosity of gases". Bird's power laws are
        // fits over some hundred kelvin: 2 %.
        for (kind, measured) in [
            (GasKind::Air, 18.6),
            (GasKind::Nitrogen, 17.9),
            (GasKind::Argon, 22.9),
            (GasKind::Helium, 20.0),
            (GasKind::Hydrogen, 9.0),
            (GasKind::Neon, 31.9),
            (GasKind::Oxygen, 20.8),
            (GasKind::CarbonDioxide, 15.0),
            (GasKind::Krypton, 25.6),
            (GasKind::Xenon, 23.2),
        ] {
            let computed = kind.viscosity(300.0) * 1e6;
            assert!((computed / measured - 1.0).abs() < 0.02, "{kind:?}: {computed}, measured {measured}");
        }
    }

    #[test]
    fn air_at_room_temperature_has_the_textbook_free_path() {
        let air = Gas::new(GasKind::Air, 101_325.0, 293.15);
        // 65 nm with its last digit; 1.204 kg/m³.
        assert!((air.mean_free_path() - 65e-9).abs() < 1e-9, "{}", air.mean_free_path());
        assert!((air.density() - 1.204).abs() < 1e-3, "{}", air.density());
    }
}
