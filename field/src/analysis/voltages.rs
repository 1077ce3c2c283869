//! Voltages from wishes: least squares within limits.

use nalgebra::{DMatrix, DVector};

/// What came of a wish.
#[derive(Clone, Debug)]
pub struct Voltages {
    /// V.
    pub values: Vec<f64>,
    /// What each row has too much, in its own unit.
    pub residual: Vec<f64>,
    /// What each row would have too much without limits and without a weight on large voltages: these electrodes cannot do it.
    pub out_of_reach: Vec<f64>,
    /// Which voltages stand at a limit.
    pub at_limit: Vec<bool>,
}

/// Minimises  Σ_i (Σ_k a_ik v_k - b_i)² / s_i² + λ² Σ_k v_k²  with |v_k| ≤ limit.
///
/// a row by row, in the unit of b per volt; s_i the size of the row (its largest |a|), so that rows of different units count
/// alike; λ = `weight` times the largest singular value of the scaled matrix. With λ far below 1 the answer is the one of least
/// squares and, of those, nearly the smallest.
///
/// An active set after Stark and Parker 1995 (BVLS). Checked by `limits_are_kept_and_optimal`.
pub fn voltages(rows: &[Vec<f64>], wanted: &[f64], limit: f64, weight: f64) -> Voltages {
    let (m, n) = (rows.len(), rows.first().map_or(0, Vec::len));
    let size: Vec<f64> = rows.iter().map(|row| row.iter().fold(0.0_f64, |s, a| s.max(a.abs()))).collect();
    let scale = |i: usize| if size[i] > 0.0 { 1.0 / size[i] } else { 0.0 };
    let a = DMatrix::from_fn(m, n, |i, k| rows[i][k] * scale(i));
    let b = DVector::from_fn(m, |i, _| wanted[i] * scale(i));
    let largest = a.clone().svd(false, false).singular_values.iter().copied().fold(0.0, f64::max);
    let lambda = weight * largest;
    let stacked =
        DMatrix::from_fn(m + n, n, |i, k| if i < m { a[(i, k)] } else { f64::from(u8::from(i - m == k)) * lambda });
    let aim = DVector::from_fn(m + n, |i, _| if i < m { b[i] } else { 0.0 });
    let solve = |columns: &[usize], aim: &DVector<f64>| -> DVector<f64> {
        let part = stacked.select_columns(columns);
        part.svd(true, true).solve(aim, 1e-12 * largest).unwrap_or_else(|_| DVector::zeros(columns.len()))
    };
    let mut v: DVector<f64> = DVector::zeros(n);
    let mut held = vec![0.0_f64; n];
    // Every round lowers the sum of squares; no two sets of limits come twice but for rounding.
    for _ in 0..20 * (n + 1) {
        loop {
            let free: Vec<usize> = (0..n).filter(|k| held[*k] == 0.0).collect();
            if free.is_empty() {
                break;
            }
            let mut rest = aim.clone();
            for k in (0..n).filter(|k| held[*k] != 0.0) {
                rest -= stacked.column(k) * v[k];
            }
            let next = solve(&free, &rest);
            // As far towards it as the limits allow.
            let mut part = (1.0, None);
            for (j, &k) in free.iter().enumerate() {
                if next[j].abs() > limit {
                    let bound = limit.copysign(next[j]);
                    let share = if next[j] == v[k] { 1.0 } else { ((bound - v[k]) / (next[j] - v[k])).clamp(0.0, 1.0) };
                    if share <= part.0 {
                        part = (share, Some((k, bound)));
                    }
                }
            }
            for (j, &k) in free.iter().enumerate() {
                v[k] += part.0 * (next[j] - v[k]);
            }
            match part.1 {
                None => break,
                Some((k, bound)) => (v[k], held[k]) = (bound, bound.signum()),
            }
        }
        // A limit that the sum of squares would leave is given up, the steepest first.
        let slope = stacked.transpose() * (&aim - &stacked * &v);
        let leaves = (0..n).filter(|k| held[*k] * slope[*k] < -1e-12 * largest * aim.norm().max(f64::MIN_POSITIVE));
        match leaves.max_by(|x, y| slope[*x].abs().total_cmp(&slope[*y].abs())) {
            Some(k) => held[k] = 0.0,
            None => break,
        }
    }
    let miss = |v: &DVector<f64>| -> Vec<f64> {
        (0..m).map(|i| (0..n).map(|k| rows[i][k] * v[k]).sum::<f64>() - wanted[i]).collect()
    };
    let best = a.clone().svd(true, true).solve(&b, 1e-10 * largest).unwrap_or_else(|_| DVector::zeros(n));
    Voltages {
        values: v.iter().copied().collect(),
        residual: miss(&v),
        out_of_reach: miss(&best),
        at_limit: held.iter().map(|h| *h != 0.0).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_kept_and_optimal() {
        let rows = vec![vec![1.0, 0.5, -0.2, 0.1], vec![-0.3, 1.0, 0.7, 0.4], vec![0.2, -0.1, 1.0, -0.9]];
        let wanted = [3.0, -2.0, 1.5];
        for (limit, weight) in [(10.0, 1e-9), (2.0, 1e-9), (1.0, 1e-2), (0.1, 0.3)] {
            let found = voltages(&rows, &wanted, limit, weight);
            let cost = |v: &[f64]| -> f64 {
                let size = [1.0, 1.0, 1.0];
                let rows: f64 = (0..3)
                    .map(|i| ((rows[i].iter().zip(v).map(|(a, v)| a * v).sum::<f64>() - wanted[i]) / size[i]).powi(2))
                    .sum();
                let largest = DMatrix::from_fn(3, 4, entry).svd(false, false).singular_values[0];
                rows + (weight * largest).powi(2) * v.iter().map(|v| v * v).sum::<f64>()
            };
            let best = cost(&found.values);
            assert!(found.values.iter().all(|v| v.abs() <= limit), "{found:?}");
            // No allowed step in any direction of a fine star gets lower: the problem is convex.
            for k in 0..4 {
                for by in [-1e-4, 1e-4] {
                    let mut other = found.values.clone();
                    other[k] = (other[k] + by * limit).clamp(-limit, limit);
                    assert!(cost(&other) >= best * (1.0 - 1e-12) - 1e-18, "{limit} {weight}: {k} {by}");
                }
            }
            assert_eq!(found.at_limit.iter().any(|x| *x), limit < 3.0, "{found:?}");
        }
        // Three equations and four voltages: they can be met, and with the smallest voltages.
        let free = voltages(&rows, &wanted, f64::INFINITY, 1e-9);
        assert!(free.residual.iter().all(|r| r.abs() < 1e-7) && free.out_of_reach.iter().all(|r| r.abs() < 1e-9));
    }

    fn entry(i: usize, k: usize) -> f64 {
        [[1.0, 0.5, -0.2, 0.1], [-0.3, 1.0, 0.7, 0.4], [0.2, -0.1, 1.0, -0.9]][i][k]
    }

    #[test]
    fn what_cannot_be_is_told() {
        // Both electrodes make the same field: two different wishes cannot come true.
        let found = voltages(&[vec![1.0, 1.0], vec![2.0, 2.0]], &[1.0, 0.0], 100.0, 1e-3);
        assert!((found.out_of_reach[0] + 0.5).abs() < 1e-9 && (found.out_of_reach[1] - 1.0).abs() < 1e-9, "{found:?}");
        // Only the weight tells them apart: rounding over its square.
        assert!((found.values[0] - found.values[1]).abs() < 1e-8, "{found:?}");
        // A row that no electrode touches.
        let none = voltages(&[vec![0.0, 0.0]], &[2.0], 100.0, 1e-6);
        assert_eq!((none.values, none.out_of_reach), (vec![0.0, 0.0], vec![-2.0]));
    }
}
