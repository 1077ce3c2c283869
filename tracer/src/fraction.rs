//! How well a fraction is known from a count.

/// The interval of a fraction of which `count` of `all` were seen, at so many standard deviations:
///
///   (p + z²/2n ± z √(p(1 - p)/n + z²/4n²)) / (1 + z²/n),  p = count/n
///
/// good for small counts and near 0 and 1, where p ± z√(p(1 - p)/n) is not. Without anything seen it is [0, 1].
///
/// Source: Wilson 1927, equation (5). Checked by `wilson_intervals`.
pub fn wilson(count: usize, all: usize, sigmas: f64) -> [f64; 2] {
    if all == 0 {
        return [0.0, 1.0];
    }
    let n = all as f64;
    let (p, z2) = (count as f64 / n, sigmas * sigmas);
    let middle = (p + 0.5 * z2 / n) / (1.0 + z2 / n);
    let half = sigmas * (p * (1.0 - p) / n + 0.25 * z2 / (n * n)).sqrt() / (1.0 + z2 / n);
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals() {
        // The ends are where the normal test just accepts: (p - x)² = z² x(1 - x)/n.
        for (count, all) in [(0, 10), (3, 10), (10, 10), (81, 263)] {
            let [low, high] = wilson(count, all, 1.96);
            let p = count as f64 / all as f64;
            for x in [low, high] {
                assert!(((p - x).powi(2) - 1.96 * 1.96 * x * (1.0 - x) / all as f64).abs() < 1e-15);
            }
            assert!(low <= p && p <= high);
        }
        // Newcombe 1998, table I: 81 of 263 gives 0.2553 to 0.3662, 0 of 20 gives 0 to 0.1611.
        let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-4 && (b - d).abs() < 1e-4;
        assert!(near(wilson(81, 263, 1.959_964), [0.2553, 0.3662]));
        assert!(near(wilson(0, 20, 1.959_964), [0.0, 0.1611]));
    }
}
