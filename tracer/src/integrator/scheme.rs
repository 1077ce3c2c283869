//! How kicks and flights alternate within a step.

/// Parts of a step, kicks by the forces and free flights in turn; it reads the same backwards.
#[derive(Debug, PartialEq)]
pub(crate) struct Scheme {
    pub order: u32,
    /// Parts of the step, up to and including the middle one: kicks.
    kicks: &'static [f64],
    /// Parts of the step, up to and including the middle one: flights.
    flights: &'static [f64],
    /// Whether the middle one is a kick (else a flight).
    middle_kick: bool,
    /// Whether the step begins and ends with a kick (else with a flight).
    pub outer_kicks: bool,
}

/// Störmer's, Verlet's (1967) or leapfrog scheme: order 2.
pub(crate) const VERLET: Scheme =
    Scheme { order: 2, kicks: &[0.5], flights: &[1.0], middle_kick: false, outer_kicks: true };

/// SRKN6b of Blanes and Moan, "Practical symplectic partitioned Runge-Kutta and Runge-Kutta-Nyström methods",
/// J. Comput. Appl. Math. 142 (2002) 313, table 3. The last ones of the paper's are fixed by the sum being one.
/// Checked by `order_blanes_moan_4`.
pub(crate) const BLANES_MOAN_4: Scheme = {
    const B: [f64; 3] = [0.0829844064174052, 0.396309801498368, -0.0390563049223486];
    const A: [f64; 2] = [0.245298957184271, 0.604872665711080];
    Scheme {
        order: 4,
        kicks: &[B[0], B[1], B[2], 1.0 - 2.0 * (B[0] + B[1] + B[2])],
        flights: &[A[0], A[1], 0.5 - (A[0] + A[1])],
        middle_kick: true,
        outer_kicks: true,
    }
};

/// SRKN11b of the same paper and table. Checked by `order_blanes_moan_6`.
pub(crate) const BLANES_MOAN_6: Scheme = {
    const B: [f64; 5] =
        [0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879];
    const A: [f64; 5] =
        [0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928];
    Scheme {
        order: 6,
        kicks: &[B[0], B[1], B[2], B[3], B[4], 0.5 - (B[0] + B[1] + B[2] + B[3] + B[4])],
        flights: &[A[0], A[1], A[2], A[3], A[4], 1.0 - 2.0 * (A[0] + A[1] + A[2] + A[3] + A[4])],
        middle_kick: false,
        outer_kicks: true,
    }
};

/// SRKN14a of the same paper and table. Checked by `order_blanes_moan_14`.
pub(crate) const BLANES_MOAN_14: Scheme = {
    const A: [f64; 7] = [
        0.0378593198406116,
        0.102635633102435,
        -0.0258678882665587,
        0.314241403071447,
        -0.130144459517415,
        0.106417700369543,
        -0.00879424312851058,
    ];
    const B: [f64; 6] = [
        0.09171915262446165,
        0.183983170005006,
        -0.05653436583288827,
        0.004914688774712854,
        0.143761127168358,
        0.328567693746804,
    ];
    Scheme {
        order: 6,
        kicks: &[B[0], B[1], B[2], B[3], B[4], B[5], 0.5 - (B[0] + B[1] + B[2] + B[3] + B[4] + B[5])],
        flights: &[
            A[0],
            A[1],
            A[2],
            A[3],
            A[4],
            A[5],
            A[6],
            1.0 - 2.0 * (A[0] + A[1] + A[2] + A[3] + A[4] + A[5] + A[6]),
        ],
        middle_kick: false,
        outer_kicks: false,
    }
};

impl Scheme {
    /// How many flights a step has.
    pub fn flights(&self) -> usize {
        if self.middle_kick { 2 * self.flights.len() } else { 2 * self.flights.len() - 1 }
    }

    /// How many kicks a step has.
    pub fn kicks(&self) -> usize {
        if self.outer_kicks { self.flights() + 1 } else { self.flights() - 1 }
    }

    /// How many flights of a step differ in length.
    pub fn lengths(&self) -> &'static [f64] {
        self.flights
    }

    /// Which of the lengths the n-th flight has.
    pub fn length_of(&self, n: usize) -> usize {
        n.min(self.flights() - 1 - n)
    }

    /// The n-th flight, in steps.
    pub fn flight(&self, n: usize) -> f64 {
        self.flights[self.length_of(n)]
    }

    /// The n-th kick, in steps.
    pub fn kick(&self, n: usize) -> f64 {
        self.kicks[n.min(self.kicks() - 1 - n)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&Scheme; 4] = [&VERLET, &BLANES_MOAN_4, &BLANES_MOAN_6, &BLANES_MOAN_14];

    #[test]
    fn parts_of_a_step_add_up_to_one_and_read_the_same_backwards() {
        for scheme in ALL {
            let kicks: Vec<f64> = (0..scheme.kicks()).map(|n| scheme.kick(n)).collect();
            let flights: Vec<f64> = (0..scheme.flights()).map(|n| scheme.flight(n)).collect();
            for list in [&kicks, &flights] {
                assert!((list.iter().sum::<f64>() - 1.0).abs() < 1e-15);
                assert!(list.iter().eq(list.iter().rev()));
            }
        }
        // The first and last kick of neighbouring steps are one force.
        assert_eq!(ALL.map(|s| s.kicks() - usize::from(s.outer_kicks)), [1, 6, 11, 14]);
    }

    #[test]
    fn a_step_of_an_oscillator_has_the_series_of_sine_and_cosine() {
        // x' = v, v' = -x: position and velocity after a step are polynomials in h; up to the order of the method their
        // coefficients must be those of cos and sin, to the 15 digits of the paper's table. A slope would not see an error
        // in the twelfth digit.
        for scheme in ALL {
            for (x0, v0) in [(1.0, 0.0), (0.0, 1.0)] {
                let (mut x, mut v) = ([0.0; 9], [0.0; 9]);
                (x[0], v[0]) = (x0, v0);
                let mut kick = 0;
                for part in 0..scheme.flights() + scheme.kicks() {
                    let is_kick = part.is_multiple_of(2) == scheme.outer_kicks;
                    for k in (1..9).rev() {
                        if is_kick {
                            v[k] -= scheme.kick(kick) * x[k - 1];
                        } else {
                            x[k] += scheme.flight(part - kick) * v[k - 1];
                        }
                    }
                    kick += usize::from(is_kick);
                }
                let mut factorial = 1.0;
                for k in 0..=scheme.order as usize {
                    factorial *= k.max(1) as f64;
                    // x = x0 cos h + v0 sin h, v = v0 cos h - x0 sin h.
                    let sign = [1.0, 1.0, -1.0, -1.0][k % 4] / factorial;
                    let (cos, sin) = if k % 2 == 0 { (sign, 0.0) } else { (0.0, sign) };
                    assert!((x[k] - x0 * cos - v0 * sin).abs() < 2e-15, "order {} at {k}: {}", scheme.order, x[k]);
                    assert!((v[k] - v0 * cos + x0 * sin).abs() < 2e-15, "order {} at {k}: {}", scheme.order, v[k]);
                }
            }
        }
    }
}
