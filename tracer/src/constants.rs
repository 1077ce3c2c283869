//! Physical constants of grains and gases, CODATA 2018, SI. Those of electrostatics are in `field::constants`.

/// Elementary charge e, C; exact by the definition of the ampere.
pub const ELEMENTARY_CHARGE: f64 = 1.602176634e-19;

/// Boltzmann's constant kB, J/K; exact by the definition of the kelvin.
pub const BOLTZMANN: f64 = 1.380649e-23;

/// Unified atomic mass unit, kg; ±5.0e-37.
pub const ATOMIC_MASS: f64 = 1.66053906660e-27;

/// Standard acceleration of free fall, m/s²; a convention (3rd CGPM, 1901).
pub const STANDARD_GRAVITY: f64 = 9.80665;
