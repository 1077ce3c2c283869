//! Fewer points for the same picture.

use super::axis::drawable;

/// A gap in a curve.
const GAP: [f64; 2] = [f64::NAN, f64::NAN];

/// For curves that advance along the horizontal axis: of the points that follow each other within one of `columns`
/// columns of `[min, max]`, the first, the lowest, the highest and the last. Extremes stay, exactly.
pub(super) fn by_column(points: &[[f64; 2]], min: f64, max: f64, columns: usize) -> Vec<[f64; 2]> {
    let column = |x: f64| ((x - min) / (max - min) * columns as f64).floor();
    let mut kept = Vec::new();
    let mut start = 0;
    while start < points.len() {
        if !drawable(&points[start]) {
            if kept.last().is_some_and(drawable) {
                kept.push(GAP);
            }
            start += 1;
            continue;
        }
        let here = column(points[start][0]);
        let (mut low, mut high, mut end) = (start, start, start + 1);
        while end < points.len() && drawable(&points[end]) && column(points[end][0]) == here {
            if points[end][1] < points[low][1] {
                low = end;
            }
            if points[end][1] > points[high][1] {
                high = end;
            }
            end += 1;
        }
        let mut indices = [start, low.min(high), low.max(high), end - 1];
        indices.sort_unstable();
        for (i, &index) in indices.iter().enumerate() {
            if i == 0 || index != indices[i - 1] {
                kept.push(points[index]);
            }
        }
        start = end;
    }
    kept
}

/// For curves that wander over the plane: points closer than `resolution` to the one kept before are left out; if more
/// than `most` remain, whole stretches spread evenly over the curve are kept, among them those that hold its extremes
/// and its ends.
pub(super) fn by_plane(points: &[[f64; 2]], resolution: [f64; 2], most: usize) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (i, point) in points.iter().enumerate() {
        match (drawable(point), kept.last().filter(|last| drawable(last))) {
            (true, Some(last)) => {
                let moved = (0..2).any(|k| (point[k] - last[k]).abs() > resolution[k]);
                let ends = points.get(i + 1).is_none_or(|next| !drawable(next));
                if moved || ends {
                    kept.push(*point);
                }
            }
            (true, None) => kept.push(*point),
            (false, Some(_)) => kept.push(GAP),
            (false, None) => {}
        }
    }
    if kept.len() <= most { kept } else { stretches(&kept, most) }
}

/// About `most` of `points`, in stretches spread evenly.
fn stretches(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    let length = (most / 16).clamp(4, 200);
    let count = points.len().div_ceil(length);
    let wanted = (most / length).saturating_sub(6).max(1);
    let mut chosen: Vec<usize> = (0..wanted).map(|i| i * count / wanted).collect();
    chosen.push(count - 1);
    for k in 0..2 {
        let drawn = || (0..points.len()).filter(|&i| drawable(&points[i]));
        let compare = |a: &usize, b: &usize| points[*a][k].total_cmp(&points[*b][k]);
        chosen.extend(drawn().min_by(compare).map(|i| i / length));
        chosen.extend(drawn().max_by(compare).map(|i| i / length));
    }
    chosen.sort_unstable();
    chosen.dedup();
    let mut kept = Vec::new();
    for (i, &stretch) in chosen.iter().enumerate() {
        if i > 0 && chosen[i - 1] + 1 < stretch {
            kept.push(GAP);
        }
        kept.extend_from_slice(&points[stretch * length..points.len().min((stretch + 1) * length)]);
    }
    kept
}
