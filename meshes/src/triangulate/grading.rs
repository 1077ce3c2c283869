//! Where the lines of a mesh stand along a side, closer together at edges where charge crowds.

/// What one end of a side is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The surface goes on smoothly.
    Smooth,
    /// A convex right-angled edge: charge density grows like (distance)^(-1/3).
    Corner,
    /// The free edge of a sheet: charge density grows like (distance)^(-1/2).
    Free,
}

impl End {
    /// Exponent p of the spacing law x = t^p at this end.
    ///
    /// With charge density s^(-a) and constant charge per panel, the energy error of the first panel is of the order of the
    /// interior ones when p (1 - a) is at least 1.5: p = 3 for a sheet, 2.25 for a corner. Less is taken, 2 and 1.7, since
    /// the edge panels get long and thin as (panels)^(p - 1) and the gain stays below the other errors up to some 10⁴ panels.
    fn exponent(self) -> f64 {
        match self {
            Self::Smooth => 1.0,
            Self::Corner => 1.7,
            Self::Free => 2.0,
        }
    }
}

/// Positions of `n + 1` lines from 0 to 1, strictly increasing, closer together at ends that are not smooth.
pub fn lines(n: usize, start: End, end: End) -> Vec<f64> {
    let (p, q) = (start.exponent(), end.exponent());
    let map = |t: f64| match (start, end) {
        (End::Smooth, End::Smooth) => t,
        (_, End::Smooth) => t.powf(p),
        (End::Smooth, _) => 1.0 - (1.0 - t).powf(q),
        _ => {
            // Two laws, each on its half; symmetric where the ends are alike.
            if t <= 0.5 { 0.5 * (2.0 * t).powf(p) } else { 1.0 - 0.5 * (2.0 - 2.0 * t).powf(q) }
        }
    };
    (0..=n)
        .map(|i| match i {
            0 => 0.0,
            i if i == n => 1.0,
            i => map(i as f64 / n as f64),
        })
        .collect()
}

/// The widest step of [`lines`], as a fraction of the side.
pub fn widest(n: usize, start: End, end: End) -> f64 {
    lines(n, start, end).windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max)
}

/// The least number of lines for which the widest step is at most `step` (a fraction of the side).
pub fn count_for(step: f64, start: End, end: End) -> usize {
    let guess = start.exponent().max(end.exponent()) / step.max(1e-6);
    let mut n = (guess.ceil() as usize).max(1);
    while n > 1 && widest(n - 1, start, end) <= step {
        n -= 1;
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_increase_and_crowd_at_edges() {
        for start in [End::Smooth, End::Corner, End::Free] {
            for end in [End::Smooth, End::Corner, End::Free] {
                let x = lines(10, start, end);
                assert_eq!((x.len(), x[0], x[10]), (11, 0.0, 1.0));
                assert!(x.windows(2).all(|w| w[1] > w[0]));
                let step = |i: usize| x[i + 1] - x[i];
                let widest = widest(10, start, end);
                for (i, which) in [(0, start), (9, end)] {
                    let crowded = step(i) < 0.6 * widest;
                    assert_eq!(crowded, which != End::Smooth, "{start:?} {end:?}: {x:?}");
                }
                assert!(super::widest(count_for(0.07, start, end), start, end) <= 0.07);
            }
        }
    }
}
