//! The table against the exact sum, over its spacing.

use field::{BasisField, Samples};
use graintrap_tests::{TwoRings, list, random, slopes};
use meshes::Vec3;

#[test]
fn order_of_the_table() {
    // The cube between the rings is in the clear: nothing there but smooth fields.
    let mut next = random(51);
    let unit: Vec<Vec3> = (0..400).map(|_| Vec3::from_fn(|_, _| 2.0 * next() - 1.0)).collect();
    let cells = [4.0, 6.0, 9.0, 13.0];
    let (mut potential, mut field) = (Vec::new(), Vec::new());
    for cells in cells {
        let rings = TwoRings::tabulated(cells as usize);
        let points: Vec<Vec3> = unit.iter().map(|p| p * rings.half).collect();
        let volts = [vec![1.0, 0.5]];
        let (mut truth, mut got) = (Samples::default(), Samples::default());
        rings.basis.combined(&volts).sample(&points, &mut truth);
        rings.field(&volts).sample(&points, &mut got);
        let root = |sum: f64| (sum / points.len() as f64).sqrt();
        let pairs = got.potential.iter().zip(&truth.potential);
        potential.push(root(pairs.map(|(a, b)| (a - b).powi(2)).sum()));
        let pairs = got.gradient.iter().zip(&truth.gradient);
        let strongest = truth.gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
        field.push(root(pairs.map(|(a, b)| (a - b).norm_squared()).sum()) / strongest);
    }
    let spacings = cells.map(|n| 1.2 / n);
    let orders = (slopes(&spacings, &potential), slopes(&spacings, &field));
    println!("potential {} V per V, orders {:.2?}", list(&potential), orders.0);
    println!("field {} of the strongest, orders {:.2?}", list(&field), orders.1);
    // Quintic Hermite polynomials and splines of degree five: h⁶ for the potential, h⁵ for the field. A few cells are not many, and how they lie to the field
    // changes with their number: the mean slope from 4 to 13 cells to three quarters, measured 5.5 and 4.9.
    let mean = |errors: &[f64]| (errors[0] / errors[3]).ln() / (spacings[0] / spacings[3]).ln();
    assert!((mean(&potential) - 6.0).abs() < 0.75, "potential: {}", mean(&potential));
    assert!((mean(&field) - 5.0).abs() < 0.75, "field: {}", mean(&field));
}
