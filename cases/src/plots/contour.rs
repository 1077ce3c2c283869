//! Lines of equal height on a grid, and lines from pieces.

use std::collections::HashMap;

/// Values on a grid of equal steps; not a number where there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heights {
    /// Horizontal coordinate of each column.
    pub x: Vec<f64>,
    /// Vertical coordinate of each row.
    pub y: Vec<f64>,
    /// Row by row.
    pub values: Vec<f64>,
}

impl Heights {
    /// Lines along which the values are `level`, each a list of points; straight within a cell (marching squares). A gap, a point
    /// that is not finite, stands between lines.
    pub fn contour(&self, level: f64) -> Vec<[f64; 2]> {
        let (nx, ny) = (self.x.len(), self.y.len());
        let mut pieces = Vec::new();
        for j in 0..ny.saturating_sub(1) {
            for i in 0..nx.saturating_sub(1) {
                let corner = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let height = corner.map(|(i, j)| self.values[j * nx + i] - level);
                if !height.iter().all(|h| h.is_finite()) {
                    continue;
                }
                let crossing = |a: usize, b: usize| {
                    let (a, b) = if corner[a] <= corner[b] { (a, b) } else { (b, a) };
                    let part = height[a] / (height[a] - height[b]);
                    let at = |k: usize| [self.x[corner[k].0], self.y[corner[k].1]];
                    let (p, q) = (at(a), at(b));
                    [p[0] + part * (q[0] - p[0]), p[1] + part * (q[1] - p[1])]
                };
                let sides = (0..4).map(|k| (k, (k + 1) % 4));
                let cut: Vec<[f64; 2]> = sides
                    .filter(|(a, b)| (height[*a] >= 0.0) != (height[*b] >= 0.0))
                    .map(|(a, b)| crossing(a, b))
                    .collect();
                match cut[..] {
                    [a, b] => pieces.push([a, b]),
                    // A saddle: the middle decides which corners go together.
                    [a, b, c, d] => {
                        let middle = height.iter().sum::<f64>() >= 0.0;
                        let pairs = if middle == (height[0] >= 0.0) { [[a, b], [c, d]] } else { [[d, a], [b, c]] };
                        pieces.extend(pairs);
                    }
                    _ => {}
                }
            }
        }
        joined(&pieces)
    }
}

/// Pieces of lines put together where their ends meet, with gaps between what does not.
pub fn joined(pieces: &[[[f64; 2]; 2]]) -> Vec<[f64; 2]> {
    let size = pieces.iter().flatten().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    // Ends are computed twice from the same numbers: rounding apart.
    let key = |p: &[f64; 2]| p.map(|x| (x / (1e-9 * size.max(f64::MIN_POSITIVE))).round() as i64);
    let mut ends: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (n, piece) in pieces.iter().enumerate() {
        for end in piece {
            ends.entry(key(end)).or_default().push(n);
        }
    }
    // Where a line goes through a node of the grid, pieces of no length stand that nothing needs.
    let mut used: Vec<bool> = pieces.iter().map(|[a, b]| key(a) == key(b)).collect();
    let mut line = Vec::new();
    let next = |from: &[f64; 2], used: &[bool]| ends.get(&key(from))?.iter().copied().find(|n| !used[*n]);
    for start in 0..pieces.len() {
        if used[start] {
            continue;
        }
        used[start] = true;
        let mut run = std::collections::VecDeque::from(pieces[start]);
        for forward in [true, false] {
            loop {
                let end = if forward { run[run.len() - 1] } else { run[0] };
                let Some(n) = next(&end, &used) else { break };
                used[n] = true;
                let [a, b] = pieces[n];
                let other = if key(&a) == key(&end) { b } else { a };
                if forward { run.push_back(other) } else { run.push_front(other) }
            }
        }
        if !line.is_empty() {
            line.push([f64::NAN; 2]);
        }
        line.extend(run);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_one_closed_line() {
        let x: Vec<f64> = (0..41).map(|k| -1.0 + 0.05 * f64::from(k)).collect();
        let values = x.iter().flat_map(|y| x.iter().map(move |x| x * x + y * y)).collect();
        let heights = Heights { x: x.clone(), y: x, values };
        let line = heights.contour(0.5);
        assert!(line.iter().all(|p| p[0].is_finite()), "in one piece");
        assert_eq!(line.first().map(|p| p.map(|x| (x * 1e9) as i64)), line.last().map(|p| p.map(|x| (x * 1e9) as i64)));
        // Straight in cells of 0.05: the sagitta is 0.05²/8 over the radius.
        assert!(line.iter().all(|p| (p[0].hypot(p[1]) - 0.5_f64.sqrt()).abs() < 1e-3));
        assert_eq!(heights.contour(5.0), Vec::<[f64; 2]>::new());
    }

    #[test]
    fn pieces_become_lines() {
        let pieces = [[[2.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[5.0, 5.0], [6.0, 5.0]]];
        let line = joined(&pieces);
        assert_eq!(line.len(), 6);
        assert!(line[3][0].is_nan() && line[1] == [1.0, 0.0]);
    }
}
