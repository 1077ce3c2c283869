//! One axis of a quadrupole: Mathieu's equation.

use std::f64::consts::PI;

use crate::stability::mathieu_map;

/// u'' + 2 k u' + (a - 2 q cos 2ζ) u = 0, ζ half the phase of the RF.
///
///   a = 4 (Q/m) φ_dc'' / Ω²,  q = -2 (Q/m) φ_rf'' / Ω²,  k = γ / Ω
///
/// φ_dc'' and φ_rf'' the curvatures of the constant potential and of the amplitude of the cosine along the axis, V/m². (With the
/// voltage U - V cos Ωt of the textbooks φ_rf'' is minus that of V; the sign of q has no meaning but a shift in time.)
/// Source: McLachlan 1947; Dawson 1976. Checked by `exact_frequencies_of_the_ideal_trap`, `limits_with_drag`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mathieu {
    /// From the static field.
    pub a: f64,
    /// From the oscillating one.
    pub q: f64,
    /// From the drag.
    pub k: f64,
}

/// Largest q that limits are looked for at.
const FARTHEST: f64 = 40.0;

impl Mathieu {
    /// β from cos πβ = u(π), between 0 and 1; none where the motion without drag (at a - k²) does not stay bounded.
    pub fn beta(&self) -> Option<f64> {
        let half_trace = mathieu_map(&[self.a], &[self.q], self.k).value[0];
        (half_trace.abs() < 1.0).then(|| half_trace.acos() / PI)
    }

    /// β for small a and q: sqrt(a + q²/(2 (1 + k²)) - k²); none where that creeps or runs away.
    ///
    /// Source: Dehmelt 1967; with drag Hasegawa and Bollinger 2005.
    pub fn small_q_beta(&self) -> Option<f64> {
        let square = self.a + 0.5 * self.q * self.q / (1.0 + self.k * self.k) - self.k * self.k;
        (square >= 0.0).then(|| square.sqrt())
    }

    /// Whether motion dies away or stays bounded, drag counted.
    pub fn is_stable(&self) -> bool {
        mathieu_map(&[self.a], &[self.q], self.k).is_stable(0, 0)
    }

    /// The size of q, at this a and drag, between which motion is stable: the limits next to the present one. Nothing where it is
    /// unstable; the upper limit is infinite where there is none below 40.
    pub fn limits(&self) -> Option<[f64; 2]> {
        if !self.is_stable() {
            return None;
        }
        let here = self.q.abs();
        let stable = |q: f64| Self { q, ..*self }.is_stable();
        let edge = |mut inside: f64, mut outside: f64| {
            for _ in 0..50 {
                let middle = 0.5 * (inside + outside);
                if stable(middle) { inside = middle } else { outside = middle }
            }
            0.5 * (inside + outside)
        };
        // Bands are no narrower than this where traps are built.
        const STEP: f64 = 0.01;
        let scan = |sign: f64| {
            let count = if sign > 0.0 { (FARTHEST - here) / STEP } else { here / STEP };
            let qs: Vec<f64> = (1..=count.floor().max(0.0) as usize).map(|n| here + sign * STEP * n as f64).collect();
            let map = mathieu_map(&[self.a], &qs, self.k);
            (0..qs.len()).find(|j| !map.is_stable(0, *j)).map(|j| edge(qs[j] - sign * STEP, qs[j]))
        };
        let below = scan(-1.0).unwrap_or_else(|| if stable(0.0) { 0.0 } else { edge(here.min(STEP), 0.0) });
        Some([below, scan(1.0).unwrap_or(f64::INFINITY)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_with_drag() {
        // Reference values, `tests/reference/mathieu.json` (damped limits at a = 0).
        for (k, exact) in
            [(0.0, 0.908_046_333_7), (0.01, 0.908_244), (0.1, 0.927_694), (1.0, 2.366_823), (2.0, 6.055_872)]
        {
            let [below, above] = Mathieu { a: 0.0, q: 0.3, k }.limits().unwrap();
            assert!(below < 1e-6 && (above - exact).abs() < 1e-6, "{k}: {below} {above}");
        }
        assert_eq!(Mathieu { a: 0.0, q: 0.95, k: 0.0 }.limits(), None);
        // a0(q) = -q²/2 + 7 q⁴/128: at a = -0.02 from q = 0.2006 on.
        let [below, _] = Mathieu { a: -0.02, q: 0.5, k: 0.0 }.limits().unwrap();
        assert!((-0.5 * below.powi(2) + 7.0 / 128.0 * below.powi(4) + 0.02).abs() < 1e-5, "{below}");
    }

    #[test]
    fn small_q_is_right_for_small_q() {
        for k in [0.0, 0.02] {
            let axis = Mathieu { a: 0.0, q: 0.1, k };
            // Physics, section 3: 0.2 % at q = 0.1.
            assert!((axis.small_q_beta().unwrap() / axis.beta().unwrap() - 1.0).abs() < 4e-3);
        }
    }
}
