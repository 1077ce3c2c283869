//! The weights of Störmer's scheme.

/// Accelerations that a step uses.
pub(super) const TERMS: usize = 12;

/// σ_j and c_j, by the age j of the acceleration.
pub(super) struct Weights {
    pub place: [f64; TERMS],
    pub speed: [f64; TERMS],
    /// Of the first difference of the accelerations that `place` leaves out: the error of a step is h² times this and that.
    pub missing: f64,
    /// Of the accelerations in that difference, ∇¹², by their age before the end of the step.
    pub difference: [f64; TERMS + 1],
}

impl Weights {
    /// Through backward differences: σ from the series (z / ln(1-z))² / (1-z), c from (-1)^m ∫ (1-s) binom(s, m) ds over 0 to 1.
    pub fn new() -> Self {
        // ln(1-z)/(-z) = Σ z^j / (j+1), its square, the inverse of that, and its partial sums.
        let log: [f64; TERMS + 1] = std::array::from_fn(|j| 1.0 / (j + 1) as f64);
        let square: [f64; TERMS + 1] = std::array::from_fn(|n| (0..=n).map(|j| log[j] * log[n - j]).sum());
        let mut inverse = [0.0; TERMS + 1];
        inverse[0] = 1.0;
        for n in 1..=TERMS {
            inverse[n] = -(1..=n).map(|j| square[j] * inverse[n - j]).sum::<f64>();
        }
        let place = std::array::from_fn(|n| inverse[..=n].iter().sum());
        // Eight Gauss points are exact for the polynomials of degree twelve.
        const NODES: [(f64, f64); 4] = [
            (0.183_434_642_495_649_8, 0.362_683_783_378_362),
            (0.525_532_409_916_329, 0.313_706_645_877_887_3),
            (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
            (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
        ];
        let mut speed = [0.0; TERMS];
        for (node, weight) in NODES {
            for s in [0.5 - 0.5 * node, 0.5 + 0.5 * node] {
                let mut term = 0.5 * weight * (1.0 - s);
                for (m, sum) in speed.iter_mut().enumerate() {
                    *sum += term;
                    term *= -(s - m as f64) / (m + 1) as f64;
                }
            }
        }
        let mut alone = [0.0; TERMS + 1];
        alone[TERMS] = 1.0;
        let missing = inverse.iter().sum();
        Self { place: ordinates(&place), speed: ordinates(&speed), missing, difference: ordinates(&alone) }
    }
}

/// Weights of values from those of backward differences.
fn ordinates<const N: usize>(differences: &[f64; N]) -> [f64; N] {
    let mut values = [0.0; N];
    for (m, weight) in differences.iter().enumerate() {
        let mut binomial = 1.0;
        for (j, value) in values.iter_mut().enumerate().take(m + 1) {
            *value += weight * binomial;
            binomial *= -((m - j) as f64) / (j + 1) as f64;
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_exact_for_polynomials() {
        // a = (t/12)^m with h = 1, from t = 0 backwards: r' - 2 r + r⁻ and h v' - (r' - r).
        let weights = Weights::new();
        for m in 0..TERMS as i32 {
            let a = |t: f64| (t / 12.0).powi(m);
            let r = |t: f64| t * t * a(t) / f64::from((m + 1) * (m + 2));
            let v = |t: f64| t * a(t) / f64::from(m + 1);
            let place: f64 = (0..TERMS).map(|j| weights.place[j] * a(-(j as f64))).sum();
            let speed: f64 = (0..TERMS).map(|j| weights.speed[j] * a(1.0 - j as f64)).sum();
            // Rounding of sums of numbers of size 100.
            assert!((place - (r(1.0) - 2.0 * r(0.0) + r(-1.0))).abs() < 1e-12, "degree {m}");
            assert!((speed - (v(1.0) - r(1.0) + r(0.0))).abs() < 1e-13, "degree {m}");
        }
        // As they stand in the textbooks: 1, 0, 1/12, 1/12, 19/240 for the differences of σ.
        let total: f64 = weights.place.iter().sum();
        assert!((total - 1.0).abs() < 1e-12 && (weights.speed.iter().sum::<f64>() - 0.5).abs() < 1e-14);
    }
}
