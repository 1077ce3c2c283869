//! The capacitance matrix and what must hold for it.

use faer::Mat;
use serde::{Deserialize, Serialize};

/// Charges on the electrodes for unit voltages: Q_i = Σ_k C_ik V_k (Maxwell's form), farad.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapacitanceMatrix {
    /// Symmetric: the mean of what came out of the solution and its transpose. F.
    pub matrix: Vec<Vec<f64>>,
    /// Largest |C_ik - C_ki| before that, as a fraction of the largest entry: rounding for Galerkin testing, discretisation
    /// error for collocation.
    pub asymmetry: f64,
}

/// Something a capacitance matrix must not do; a mesh too coarse for a narrow gap, or panels that cut each other, show here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CapacitanceDefect {
    /// Entries off the diagonal are never positive.
    #[error("C[{row}][{column}] = {value:.3e} F is positive, and must not be")]
    PositiveCoupling {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// F.
        value: f64,
    },
    /// With all electrodes at the same voltage none carries a charge of the other sign.
    #[error("row {row} of C sums to {sum:.3e} F, and must not be negative")]
    NegativeRowSum {
        /// Row.
        row: usize,
        /// F.
        sum: f64,
    },
}

impl CapacitanceMatrix {
    /// From the charge on each electrode (row) for 1 V on each (column).
    pub fn new(charges: &[Vec<f64>]) -> Self {
        let n = charges.len();
        let largest = charges.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut matrix = charges.to_vec();
        let mut asymmetry = 0.0_f64;
        for i in 0..n {
            for k in 0..n {
                asymmetry = asymmetry.max((charges[i][k] - charges[k][i]).abs() / largest);
                matrix[i][k] = 0.5 * (charges[i][k] + charges[k][i]);
            }
        }
        Self { matrix, asymmetry }
    }

    /// Number of electrodes.
    pub fn electrodes(&self) -> usize {
        self.matrix.len()
    }

    /// What is wrong with the matrix beyond `tolerance` times its largest entry (the error it is known to have).
    ///
    /// Row sums count only where no electrode encloses another: inside a shell they vanish, and their sign is rounding.
    pub fn defects(&self, tolerance: f64) -> Vec<CapacitanceDefect> {
        let slack = tolerance * self.matrix.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let mut found = Vec::new();
        for (row, entries) in self.matrix.iter().enumerate() {
            for (column, &value) in entries.iter().enumerate() {
                if row != column && value > slack {
                    found.push(CapacitanceDefect::PositiveCoupling { row, column, value });
                }
            }
            let sum: f64 = entries.iter().sum();
            if sum < -slack {
                found.push(CapacitanceDefect::NegativeRowSum { row, sum });
            }
        }
        found
    }

    /// Voltages of electrodes whose charge is given instead: for each floating electrode (`true`) its voltage as a
    /// combination of given quantities. Row f of the answer holds, for floating electrode number f, the factors on each
    /// electrode's given quantity: its voltage (V) where it is not floating, its charge (C) where it is.
    ///
    /// From C_ff V_f = Q_f - C_fg V_g. `induced` adds, column by column, the charges that outside fields of strength one
    /// induce on grounded electrodes; the answer then has as many more columns, with the factors on those strengths.
    ///
    /// # Panics
    /// `induced` has another number of rows than there are electrodes.
    pub fn floating_voltages(&self, floating: &[bool], induced: &[Vec<f64>]) -> Vec<Vec<f64>> {
        assert_eq!(induced.len(), self.electrodes(), "a row of induced charges for each electrode");
        let f: Vec<usize> = (0..self.electrodes()).filter(|&e| floating[e]).collect();
        if f.is_empty() {
            return Vec::new();
        }
        let sources = induced.first().map_or(0, Vec::len);
        let block = Mat::from_fn(f.len(), f.len(), |i, j| self.matrix[f[i]][f[j]]);
        let given = Mat::from_fn(f.len(), self.electrodes() + sources, |i, k| {
            if k >= self.electrodes() {
                -induced[f[i]][k - self.electrodes()]
            } else if !floating[k] {
                -self.matrix[f[i]][k]
            } else {
                f64::from(u8::from(f[i] == k))
            }
        });
        let answer = faer::linalg::solvers::Solve::solve(&block.partial_piv_lu(), &given);
        (0..f.len()).map(|i| (0..given.ncols()).map(|k| answer[(i, k)]).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> CapacitanceMatrix {
        CapacitanceMatrix::new(&[vec![3.0, -1.0], vec![-1.2, 2.0]])
    }

    #[test]
    fn symmetrised_with_its_asymmetry_told() {
        assert_eq!(two().matrix, [[3.0, -1.1], [-1.1, 2.0]]);
        assert!((two().asymmetry - 0.2 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn wrong_signs_are_found() {
        assert!(two().defects(1e-6).is_empty());
        let bad = CapacitanceMatrix::new(&[vec![1.0, 0.1], vec![0.1, -2.0]]);
        assert_eq!(bad.defects(1e-6).len(), 3);
        assert!(bad.defects(1.0).is_empty());
    }

    #[test]
    fn a_floating_electrode_takes_the_voltage_that_gives_its_charge() {
        let c = two();
        let rows = c.floating_voltages(&[true, false], &[vec![0.5], vec![0.25]]);
        // Electrode 0 holds 4 C, electrode 1 is at 2 V, the source has strength 3.
        let voltage = rows[0][0] * 4.0 + rows[0][1] * 2.0 + rows[0][2] * 3.0;
        let charge = c.matrix[0][0] * voltage + c.matrix[0][1] * 2.0 + 0.5 * 3.0;
        assert!((charge - 4.0).abs() < 1e-14);
    }
}
