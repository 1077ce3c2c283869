//! The effective potential: what a fast field does on average, with what is static.

use meshes::Vec3;
use nalgebra::Matrix3;

use super::expansion::{Expansion, Jet};
use crate::{BasisField, Samples};

/// A potential made of the channels φ_c of a field:
///
///   U(r) = Σ_c s_c φ_c(r) + b·r + Σ_k κ_k |∇ Σ_c p_kc φ_c(r)|²
///
/// In which units is decided by who gives the factors. With s_c the constant voltages it is the static potential. With
/// s_c = (Q/m) V_c, b = -g and for the cosine and the sine part of each RF frequency ω
///
///   κ = (Q/m)² / (4 (ω² + γ²))
///
/// it is the mean energy per mass of a grain with charge Q, mass m and drag rate γ (J/kg), whose second derivatives are the
/// squares of the secular angular frequencies. Valid while a grain moves little in one period against the length on which the
/// RF field varies. Source: Dehmelt 1967; with drag Hasegawa and Bollinger 2005 (the mean of their equation of motion).
/// Checked by `the_effective_potential_of_the_ideal_trap`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effective {
    /// s, one for each channel.
    pub statics: Vec<f64>,
    /// b.
    pub slope: Vec3,
    /// What enters with the square of its field.
    pub squares: Vec<Square>,
}

/// A field that enters with its square.
#[derive(Clone, Debug, PartialEq)]
pub struct Square {
    /// κ.
    pub strength: f64,
    /// p, one for each channel.
    pub pattern: Vec<f64>,
}

/// An effective potential and its derivatives at a point.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// U.
    pub value: f64,
    /// 1/m of it.
    pub gradient: Vec3,
    /// 1/m² of it.
    pub hessian: Matrix3<f64>,
}

impl Effective {
    /// A static potential alone, s in V.
    pub fn of_static(statics: Vec<f64>) -> Self {
        Self { statics, ..Self::default() }
    }

    /// Whether it is the same everywhere.
    pub fn is_zero(&self) -> bool {
        let none = |list: &[f64]| list.iter().all(|x| *x == 0.0);
        none(&self.statics) && self.slope == Vec3::zeros() && self.squares.iter().all(|s| none(&s.pattern))
    }

    /// The values at points.
    pub fn values(&self, field: &dyn BasisField, points: &[Vec3], samples: &mut Samples) -> Vec<f64> {
        field.sample(points, samples);
        let n = field.channels();
        let at = |p: usize| {
            let potential = &samples.potential[p * n..(p + 1) * n];
            let gradient = &samples.gradient[p * n..(p + 1) * n];
            let statics: f64 = self.statics.iter().zip(potential).map(|(s, v)| s * v).sum();
            let squares = self.squares.iter().map(|square| {
                let slope: Vec3 = square.pattern.iter().zip(gradient).map(|(p, g)| g * *p).sum();
                square.strength * slope.norm_squared()
            });
            statics + self.slope.dot(&points[p]) + squares.sum::<f64>()
        };
        (0..points.len()).map(at).collect()
    }

    /// Value and derivatives at a point within an expansion.
    pub fn local(&self, expansion: &Expansion, point: &Vec3) -> Local {
        let jets = expansion.jets(point);
        let statics = Jet::sum(&jets, &self.statics);
        let mut local = Local {
            value: statics.value + self.slope.dot(point),
            gradient: statics.gradient + self.slope,
            hessian: statics.hessian,
        };
        for square in &self.squares {
            let Jet { gradient: e, hessian: h, third, .. } = Jet::sum(&jets, &square.pattern);
            local.value += square.strength * e.norm_squared();
            // ∂_i |e|² = 2 h_ik e_k,  ∂_i∂_j |e|² = 2 (h_ik h_jk + t_ijk e_k).
            local.gradient += h * e * (2.0 * square.strength);
            let bent = third[0] * e.x + third[1] * e.y + third[2] * e.z;
            local.hessian += (h * h + bent) * (2.0 * square.strength);
        }
        local
    }
}

#[cfg(test)]
mod tests {
    use super::super::expansion::tests::Charges;
    use super::*;
    use crate::QuadraticField;

    #[test]
    fn derivatives_are_those_of_the_values() {
        let field = Charges(vec![Vec3::new(1.0, 0.2, 0.1), Vec3::new(-0.8, 0.5, -0.7)]);
        let squares =
            vec![Square { strength: 0.3, pattern: vec![1.0, 0.5] }, Square { strength: 0.2, pattern: vec![-0.2, 1.0] }];
        let effective = Effective { statics: vec![0.7, -0.4], slope: Vec3::new(0.1, 0.2, -0.3), squares };
        let x = Vec3::new(0.02, -0.01, 0.03);
        let expansion = Expansion::near(&field, Vec3::zeros(), 1.0);
        let local = effective.local(&expansion, &x);
        let mut samples = Samples::default();
        let mut at = |d: Vec3| effective.values(&field, &[x + d], &mut samples)[0];
        assert!((local.value - at(Vec3::zeros())).abs() < 1e-9);
        let h = 1e-4;
        for i in 0..3 {
            let e = |k: usize| Vec3::ith(k, h);
            // Central differences: h² times derivatives of size 10.
            assert!((local.gradient[i] - (at(e(i)) - at(-e(i))) / (2.0 * h)).abs() < 1e-6);
            for j in 0..3 {
                let mixed = at(e(i) + e(j)) - at(e(i) - e(j)) - at(e(j) - e(i)) + at(-e(i) - e(j));
                assert!((local.hessian[(i, j)] - mixed / (4.0 * h * h)).abs() < 1e-5, "{i} {j}");
            }
        }
    }

    #[test]
    fn the_effective_potential_of_the_ideal_trap() {
        // Q/m = 1, Ω = 1 rad/s, φ = (x² + y² - 2z²)/2: Ψ = V² (x² + y² + 4 z²)/4, the secular frequencies V/√2 and √2 V.
        let field = QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0);
        let square = Square { strength: 0.25, pattern: vec![0.1] };
        let effective = Effective { statics: vec![0.0], slope: Vec3::zeros(), squares: vec![square] };
        let expansion = Expansion::near(&field, Vec3::zeros(), 1.0);
        let local = effective.local(&expansion, &Vec3::zeros());
        for (k, omega) in [0.1 / 2.0_f64.sqrt(), 0.1 / 2.0_f64.sqrt(), 0.1 * 2.0_f64.sqrt()].into_iter().enumerate() {
            assert!((local.hessian[(k, k)] / (omega * omega) - 1.0).abs() < 1e-12);
        }
    }
}
