//! Where the holes and wires of a grid plate stand.

use crate::{Hole, Outline};

/// Whole pitches that fit a side, forgiving the rounding of `side / pitch`.
pub fn holes_along(side: f64, pitch: f64) -> usize {
    (side / pitch + 1e-9).floor().max(0.0) as usize
}

/// Centres of the holes in a plate about the origin, m.
///
/// On a rectangle, square and round holes fill as many whole pitches as fit, centred, and so do slots. In every other case a hole is kept
/// when its cell (the square or hexagon that belongs to it) leaves a whole rim of a tenth of a pitch: on a disc the lattice
/// has a hole on the axis; hexagons stand in rows along `e1`. Slots are kept where a square hole beside the middle would be.
pub fn hole_lattice(outline: Outline, pitch: f64, hole: Hole) -> Vec<[f64; 2]> {
    if let (Outline::Rectangle([a, b]), Hole::Square | Hole::Round | Hole::Slot) = (outline, hole) {
        let (n, m) = (holes_along(a, pitch), holes_along(b, pitch));
        let m = if hole == Hole::Slot { m.min(1) } else { m };
        let at = |k: usize, n: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
        return (0..n).flat_map(|i| (0..m).map(move |j| [at(i, n), at(j, m)])).collect();
    }
    let (reach_x, reach_y) = match outline {
        Outline::Disc(radius) => (radius, radius),
        Outline::Rectangle([a, b]) => (0.5 * a, 0.5 * b),
    };
    let hexagonal = hole == Hole::Hexagonal;
    let row_step = if hexagonal { pitch * 0.75_f64.sqrt() } else { pitch };
    // Corners of the cell: how far it reaches.
    let corners: Vec<[f64; 2]> = if hexagonal {
        (0..6)
            .map(|k| (std::f64::consts::PI * (2 * k + 1) as f64 / 6.0).sin_cos())
            .map(|(s, c)| [c * pitch / 3.0_f64.sqrt(), s * pitch / 3.0_f64.sqrt()])
            .collect()
    } else {
        [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|c| c.map(|x| 0.5 * x * pitch)).to_vec()
    };
    let rim = 0.1 * pitch;
    let fits = |x: f64, y: f64| {
        corners.iter().all(|[dx, dy]| {
            let (x, y) = (x + dx, y + dy);
            match outline {
                Outline::Disc(radius) => x.hypot(y) <= radius - rim,
                Outline::Rectangle(_) => x.abs() <= reach_x - rim && y.abs() <= reach_y - rim,
            }
        })
    };
    let (rows, columns) = ((reach_y / row_step) as i64 + 1, (reach_x / pitch) as i64 + 1);
    let rows = if hole == Hole::Slot { 0 } else { rows };
    let mut centers = Vec::new();
    for j in -rows..=rows {
        let shift = if hexagonal && j % 2 != 0 { 0.5 * pitch } else { 0.0 };
        for i in -columns - 1..=columns {
            let (x, y) = (i as f64 * pitch + shift, j as f64 * row_step);
            if fits(x, y) {
                centers.push([x, y]);
            }
        }
    }
    centers
}

/// Half the length of the slot at `x` of [`hole_lattice`], m: what is left of the plate by half a bar at its end, and on a disc by the
/// rim that all cells leave.
pub fn slot_half_length(outline: Outline, pitch: f64, open: f64, x: f64) -> f64 {
    let end = match outline {
        Outline::Rectangle([_, b]) => 0.5 * b,
        Outline::Disc(radius) => ((radius - 0.1 * pitch).powi(2) - (x.abs() + 0.5 * pitch).powi(2)).max(0.0).sqrt(),
    };
    end - 0.5 * (pitch - open)
}

/// Where square holes or slots of a rectangle begin and end along `e1` and along `e2`, m; a hole is where both have one.
pub fn hole_spans(size: [f64; 2], pitch: f64, hole: Hole, open: f64) -> [Vec<[f64; 2]>; 2] {
    let row = |side: f64| -> Vec<[f64; 2]> {
        let n = holes_along(side, pitch);
        let center = |k: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) * pitch;
        (0..n).map(|k| [center(k) - 0.5 * open, center(k) + 0.5 * open]).collect()
    };
    let along = if hole == Hole::Slot {
        let half = slot_half_length(Outline::Rectangle(size), pitch, open, 0.0);
        vec![[-half, half]]
    } else {
        row(size[1])
    };
    [row(size[0]), along]
}

/// Wires of one layer of a wire grid: offset across and half length of each, m. `second`: the layer along `e2`.
///
/// As many as fit within the outline with their full thickness, a pitch apart, symmetric to the centre.
pub fn wires_along(outline: Outline, pitch: f64, wire_radius: f64, second: bool) -> Vec<(f64, f64)> {
    let (across, half): (f64, Box<dyn Fn(f64) -> f64>) = match outline {
        Outline::Rectangle([a, b]) => {
            let (across, along) = if second { (a, b) } else { (b, a) };
            (across, Box::new(move |_| 0.5 * along))
        }
        Outline::Disc(radius) => {
            (2.0 * radius, Box::new(move |x: f64| (radius * radius - (x.abs() + wire_radius).powi(2)).max(0.0).sqrt()))
        }
    };
    let n = ((across - 2.0 * wire_radius) / pitch + 1e-9).floor().max(-1.0) as i64 + 1;
    (0..n)
        .map(|k| (k as f64 - 0.5 * (n as f64 - 1.0)) * pitch)
        .map(|x| (x, half(x)))
        .filter(|(_, half)| *half > 2.0 * wire_radius)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_pitches_hold_ten_holes_however_they_round() {
        assert_eq!(holes_along(1.0, 0.1), 10);
        assert_eq!(holes_along(0.3, 0.1), 3);
        assert_eq!(holes_along(0.0999, 0.1), 0);
        assert_eq!(hole_lattice(Outline::Rectangle([1.0, 0.3]), 0.1, Hole::Square).len(), 30);
    }

    #[test]
    fn lattices_are_symmetric_and_inside() {
        for (outline, hole) in [
            (Outline::Disc(1.0), Hole::Square),
            (Outline::Disc(1.0), Hole::Round),
            (Outline::Disc(1.0), Hole::Hexagonal),
            (Outline::Rectangle([2.0, 1.5]), Hole::Hexagonal),
        ] {
            let centers = hole_lattice(outline, 0.13, hole);
            assert!(centers.len() > 40, "{outline:?} {hole:?}: {}", centers.len());
            for [x, y] in &centers {
                let mirrored = centers.iter().any(|[u, v]| (u + x).abs() + (v + y).abs() < 1e-12);
                assert!(mirrored, "no partner of ({x}, {y})");
            }
            let nearest = |p: &[f64; 2]| {
                let d = centers.iter().filter(|c| *c != p).map(|c| (c[0] - p[0]).hypot(c[1] - p[1]));
                d.fold(f64::INFINITY, f64::min)
            };
            assert!(centers.iter().all(|p| (nearest(p) - 0.13).abs() < 1e-12));
        }
    }

    #[test]
    fn slots_leave_half_a_bar_at_their_ends() {
        let plate = Outline::Rectangle([1.0, 0.7]);
        assert_eq!(hole_lattice(plate, 0.25, Hole::Slot), [[-0.375, 0.0], [-0.125, 0.0], [0.125, 0.0], [0.375, 0.0]]);
        let [across, along] = hole_spans([1.0, 0.7], 0.25, Hole::Slot, 0.2);
        assert!(across.iter().all(|[from, to]| (to - from - 0.2).abs() < 1e-15) && across.len() == 4);
        assert!(along.len() == 1 && (along[0][1] - 0.325).abs() < 1e-15 && along[0][0] == -along[0][1]);
        // On a disc none is shorter than wide, and all end within the rim.
        let slots = hole_lattice(Outline::Disc(1.0), 0.13, Hole::Slot);
        assert_eq!(slots.len(), 15);
        for [x, y] in slots {
            let half = slot_half_length(Outline::Disc(1.0), 0.13, 0.1, x);
            assert!(y == 0.0 && half >= 0.05 && (x.abs() + 0.065).hypot(half + 0.015) < 0.987 + 1e-12, "{x} {half}");
        }
    }

    #[test]
    fn wires_fill_the_outline() {
        let wires = wires_along(Outline::Rectangle([1.0, 2.0]), 0.25, 0.01, true);
        assert_eq!(wires.len(), 4);
        assert!(wires.iter().all(|(x, half)| *half == 1.0 && x.abs() < 0.5));
        let wires = wires_along(Outline::Disc(1.0), 0.25, 0.01, false);
        assert!(wires.iter().all(|(x, half)| (x.abs() + 0.01).hypot(*half) <= 1.0 + 1e-12));
    }
}
