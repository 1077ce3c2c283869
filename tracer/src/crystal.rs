//! Coulomb crystals: where equal charges rest in a harmonic well, and how they swing about these places.
//!
//! Lengths are in units of ℓ = (k Q² / (m ω²))^(1/3) (k = 1/(4πε0)), frequencies in units of ω, energies in k Q²/ℓ. The energy is
//!
//!   V = ½ Σ_i (κ_x x_i² + κ_y y_i² + κ_z z_i²) + Σ_{i<j} 1/|r_i - r_j|,  κ_k = (ω_k/ω)²,
//!
//! the place of rest its minimum, and the squares of the mode frequencies the eigenvalues of its second derivatives there.
//! Source: James 1998, eqs. 1 to 5 and 12 (chains). Checked by `exact_chains`, `exact_planar_rings` and `modes_*`.

use faer::{Mat, Side};
use field::constants::COULOMB;
use meshes::Vec3;
use thiserror::Error;

/// Grains at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Crystal {
    /// Places, in units of ℓ.
    pub positions: Vec<Vec3>,
    /// Frequencies of the 3 N modes over ω, in rising order; a rotation that costs nothing has zero.
    pub modes: Vec<f64>,
    /// Energy, in k Q²/ℓ.
    pub energy: f64,
    /// Largest force that is left, in k Q²/ℓ².
    pub residual: f64,
}

/// Why there is no crystal.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CrystalError {
    /// A direction that does not hold.
    #[error("the well does not hold along {axis}: its stiffness is {stiffness}; give a positive one")]
    Open {
        /// `x`, `y` or `z`.
        axis: char,
        /// (ω_k/ω)².
        stiffness: f64,
    },
    /// Two grains start in one place, or a start is not finite.
    #[error("{grains} grains do not start in as many places; give each a finite place of its own")]
    Start {
        /// How many.
        grains: usize,
    },
    /// The steps did not end.
    #[error("the forces are still {residual:.1e} after {steps} steps; start nearer to a place of rest")]
    NotAtRest {
        /// Largest force left, in k Q²/ℓ².
        residual: f64,
        /// Steps taken.
        steps: usize,
    },
}

/// ℓ = (k Q² / (m ω²))^(1/3), m, for a charge (C), a mass (kg) and an angular frequency (rad/s).
pub fn length(charge: f64, mass: f64, omega: f64) -> f64 {
    (COULOMB * charge * charge / (mass * omega * omega)).cbrt()
}

/// Forces below this are rounding's: they are sums of terms of order one, N at most a few hundred.
const REST: f64 = 1e-11;
/// A ball of a hundred takes some sixty steps.
const MOST_STEPS: usize = 2000;
/// Curvatures below this are taken for it when a step is made: a rotation that costs nothing shall not be turned far.
const SOFTEST: f64 = 1e-3;

impl Crystal {
    /// Grains that start evenly spread (a spiral on shells) in the ellipsoid that they would fill.
    ///
    /// # Errors
    /// As [`Crystal::from`].
    pub fn of(grains: usize, stiffness: Vec3) -> Result<Self, CrystalError> {
        let size = (grains as f64).cbrt();
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let start = (0..grains).map(|k| {
            let part = (k as f64 + 0.5) / grains as f64;
            let (height, turn) = (1.0 - 2.0 * part, golden * k as f64);
            let across = (1.0 - height * height).sqrt();
            // Radii that are not in the order of the heights fill the inside.
            let radius = size * (((k * 7919) % grains) as f64 + 0.5).cbrt() / (grains as f64).cbrt();
            let unit = Vec3::new(across * turn.cos(), across * turn.sin(), height) * radius;
            unit.component_div(&stiffness.map(|s| s.abs().sqrt().max(1e-6)))
        });
        Self::from(start.collect(), stiffness)
    }

    /// The place of rest downhill from a start, by Newton's method; where a curvature is negative, the step is downhill along it.
    ///
    /// # Errors
    /// A well that is open, a start that cannot be, steps that do not end.
    pub fn from(start: Vec<Vec3>, stiffness: Vec3) -> Result<Self, CrystalError> {
        for (axis, s) in ['x', 'y', 'z'].into_iter().zip(stiffness.iter()) {
            if !(s.is_finite() && *s > 0.0) {
                return Err(CrystalError::Open { axis, stiffness: *s });
            }
        }
        let grains = start.len();
        if grains == 0 {
            return Ok(Self { positions: start, modes: Vec::new(), energy: 0.0, residual: 0.0 });
        }
        let mut positions = start;
        let mut energy = potential(&positions, &stiffness);
        if !energy.is_finite() {
            return Err(CrystalError::Start { grains });
        }
        for _ in 0..MOST_STEPS {
            let gradient = gradient(&positions, &stiffness);
            let residual = gradient.iter().map(|g| g.amax()).fold(0.0, f64::max);
            let curved = hessian(&positions, &stiffness).self_adjoint_eigen(Side::Lower);
            let Ok(curved) = curved else { return Err(CrystalError::NotAtRest { residual, steps: MOST_STEPS }) };
            let values: Vec<f64> = curved.S().column_vector().iter().copied().collect();
            let softest = values.first().copied().unwrap_or(1.0);
            if residual < REST * (1.0 + grains as f64) && softest > -1e-7 {
                let modes = values.iter().map(|v| v.max(0.0).sqrt()).collect();
                return Ok(Self { positions, modes, energy, residual });
            }
            let vectors = curved.U();
            let mut step = vec![Vec3::zeros(); grains];
            for (mode, value) in values.iter().enumerate() {
                let along: f64 = (0..3 * grains).map(|c| vectors[(c, mode)] * gradient[c / 3][c % 3]).sum();
                // At a saddle no force tells which way is down: either is.
                let along = if *value < -1e-7 && along.abs() < 1e-6 { 1e-3 } else { along };
                let length = -along / value.abs().max(SOFTEST);
                (0..3 * grains).for_each(|c| step[c / 3][c % 3] += length * vectors[(c, mode)]);
            }
            // No grain moves farther than a part of the way to its nearest neighbour.
            let longest = step.iter().map(Vec3::norm).fold(0.0, f64::max);
            let mut scale = (0.3 * nearest(&positions) / longest).min(1.0);
            loop {
                let tried: Vec<Vec3> = positions.iter().zip(&step).map(|(r, s)| r + s * scale).collect();
                let found = potential(&tried, &stiffness);
                // Near the end energies are equal to rounding.
                if found <= energy + 1e-14 * energy.abs() || scale < 1e-9 {
                    (positions, energy) = (tried, found);
                    break;
                }
                scale *= 0.5;
            }
        }
        let residual = gradient(&positions, &stiffness).iter().map(|g| g.amax()).fold(0.0, f64::max);
        Err(CrystalError::NotAtRest { residual, steps: MOST_STEPS })
    }

    /// Distance of the two nearest grains, in units of ℓ; infinite for one alone.
    pub fn nearest(&self) -> f64 {
        nearest(&self.positions)
    }
}

fn nearest(positions: &[Vec3]) -> f64 {
    pairs(positions.len()).map(|(i, j)| (positions[i] - positions[j]).norm()).fold(f64::INFINITY, f64::min)
}

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |i| (0..i).map(move |j| (i, j)))
}

fn potential(positions: &[Vec3], stiffness: &Vec3) -> f64 {
    let well: f64 = positions.iter().map(|r| 0.5 * r.component_mul(r).dot(stiffness)).sum();
    well + pairs(positions.len()).map(|(i, j)| 1.0 / (positions[i] - positions[j]).norm()).sum::<f64>()
}

fn gradient(positions: &[Vec3], stiffness: &Vec3) -> Vec<Vec3> {
    let mut gradient: Vec<Vec3> = positions.iter().map(|r| r.component_mul(stiffness)).collect();
    for (i, j) in pairs(positions.len()) {
        let d = positions[i] - positions[j];
        let pull = d / d.norm().powi(3);
        gradient[i] -= pull;
        gradient[j] += pull;
    }
    gradient
}

/// ∂²(1/r) = (3 d dᵀ - r² 1)/r⁵ on the diagonal blocks, its negative between the two.
fn hessian(positions: &[Vec3], stiffness: &Vec3) -> Mat<f64> {
    let mut hessian = Mat::zeros(3 * positions.len(), 3 * positions.len());
    for i in 0..positions.len() {
        (0..3).for_each(|k| hessian[(3 * i + k, 3 * i + k)] = stiffness[k]);
    }
    for (i, j) in pairs(positions.len()) {
        let d = positions[i] - positions[j];
        let r2 = d.norm_squared();
        let scale = r2.powf(-2.5);
        for a in 0..3 {
            for b in 0..3 {
                let entry = (3.0 * d[a] * d[b] - if a == b { r2 } else { 0.0 }) * scale;
                hessian[(3 * i + a, 3 * i + b)] += entry;
                hessian[(3 * j + a, 3 * j + b)] += entry;
                hessian[(3 * i + a, 3 * j + b)] -= entry;
                hessian[(3 * j + a, 3 * i + b)] -= entry;
            }
        }
    }
    hessian
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_of_two_in_an_isotropic_well() {
        let pair = Crystal::of(2, Vec3::repeat(1.0)).unwrap();
        assert!((pair.nearest() - 2.0_f64.cbrt()).abs() < 1e-10, "{pair:?}");
        // Two rotations, three of the centre, and breathing at √3.
        let expected = [0.0, 0.0, 1.0, 1.0, 1.0, 3.0_f64.sqrt()];
        // Rotations: the root of rounding in an eigenvalue of zero.
        pair.modes.iter().zip(expected).for_each(|(mode, e)| assert!((mode - e).abs() < 1e-5, "{pair:?}"));
    }

    #[test]
    fn what_cannot_be() {
        let open = Crystal::of(2, Vec3::new(1.0, -1.0, 1.0)).unwrap_err();
        assert_eq!(open, CrystalError::Open { axis: 'y', stiffness: -1.0 });
        let same = Crystal::from(vec![Vec3::zeros(); 2], Vec3::repeat(1.0)).unwrap_err();
        assert_eq!(same, CrystalError::Start { grains: 2 });
        assert_eq!(Crystal::of(0, Vec3::repeat(1.0)).unwrap().modes.len(), 0);
    }
}
