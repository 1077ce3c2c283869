//! Draws the first region of stability of the planar and of the three-dimensional quadrupole, by Floquet's theorem, with the points
//! of the shipped cases in it: `stability_chart [folder]` writes `stability.svg` and `stability.png`.

use std::path::PathBuf;

use cases::plots::{Curve, Figure, Mark, Panel, Shape};
use tracer::stability::mathieu_map;

/// Edges of where both `a q` on one axis and `factor` times it on the other are stable, around the region that touches a = 0 at
/// small q: lower edge out, upper edge back.
fn region(factor: f64, a: &[f64], q: &[f64]) -> Vec<[f64; 2]> {
    let own = mathieu_map(a, q, 0.0);
    let scaled = |values: &[f64], f: f64| -> Vec<f64> { values.iter().map(|v| v * f).collect() };
    let other = mathieu_map(&scaled(a, factor), &scaled(q, factor.abs()), 0.0);
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for (j, q) in q.iter().enumerate() {
        let stable: Vec<usize> = (0..a.len()).filter(|&i| own.is_stable(i, j) && other.is_stable(i, j)).collect();
        if let (Some(first), Some(last)) = (stable.first(), stable.last()) {
            lower.push([*q, a[*first]]);
            upper.push([*q, a[*last]]);
        }
    }
    upper.reverse();
    lower.extend(upper);
    lower.extend(lower.first().copied());
    lower
}

fn main() {
    let folder = std::env::args().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let grid = |from: f64, to: f64, n: i32| -> Vec<f64> {
        (0..=n).map(|i| from + (to - from) * (f64::from(i) + 0.37) / f64::from(n)).collect()
    };
    let panel =
        |title: &str, y: &str, factor: f64, a: &[f64], q: &[f64], marks: Vec<(&str, Shape, Vec<[f64; 2]>)>| Panel {
            title: title.to_owned(),
            x_label: "q".to_owned(),
            y_label: y.to_owned(),
            curves: vec![Curve {
                label: "edge of stability".to_owned(),
                points: region(factor, a, q),
                colour: 0,
                faint: false,
            }],
            marks: marks
                .into_iter()
                .map(|(label, shape, points)| Mark { label: label.to_owned(), points, shape })
                .collect(),
            ..Panel::default()
        };
    let planar = panel(
        "planar quadrupole",
        "a along x",
        -1.0,
        &grid(-0.3, 0.3, 1200),
        &grid(0.0, 1.0, 400),
        vec![
            ("mass_filter: stays", Shape::Circle, vec![[0.700, 0.230]]),
            ("mass_filter: lost", Shape::Cross, vec![[0.737, 0.242], [0.648, 0.213]]),
        ],
    );
    let round = panel(
        "3D quadrupole",
        "a along z",
        -0.5,
        &grid(-0.75, 0.25, 1600),
        &grid(0.0, 1.4, 400),
        vec![
            ("mathieu_corner: (1.2, -0.6) and (0.095, -3.5e-6)", Shape::Triangle, vec![[1.2, -0.6], [0.095, -3.5e-6]]),
            ("mathieu: tables 3 and 4", Shape::Circle, vec![[0.330_579, -3.3e-4], [0.4, -4e-4]]),
        ],
    );
    let figure = Figure {
        title: "First region of stability".to_owned(),
        subtitle: "by Floquet's theorem; ejection at a = 0 from q = 0.908, tips at (0.706, 0.237) and (1.240, -0.671)"
            .to_owned(),
        columns: 2,
        panels: vec![planar, round],
        width: 1200.0,
        height: 600.0,
    };
    std::fs::write(folder.join("stability.svg"), figure.svg().expect("an SVG")).expect("a writable folder");
    std::fs::write(folder.join("stability.png"), figure.png().expect("a PNG")).expect("a writable folder");
}
