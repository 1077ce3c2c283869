//! Physical constants of electrostatics, CODATA 2018, SI.

/// Vacuum permittivity ε0, F/m.
pub const EPSILON_0: f64 = 8.8541878128e-12;

/// Coulomb's constant 1 / (4 π ε0), m/F.
pub const COULOMB: f64 = 1.0 / (4.0 * std::f64::consts::PI * EPSILON_0);
