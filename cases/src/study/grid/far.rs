//! A grid from afar: a sheet between two fields.

use field::{GridFrame, grid_sheets};

use super::super::row::Number;
use super::weights;
use crate::pipeline::drives::Driven;
use crate::pipeline::solution::Solution;

/// δ, τ and leakage, in the unit potential that crosses the grid most; and the driven field far from it on both sides, along its
/// normal.
pub(super) fn sheet(solution: &Solution, driven: &Driven, electrode: usize, grid: &GridFrame) -> Vec<Number> {
    let basis = solution.basis.panel_sum();
    let sheets = grid_sheets(&basis, &grid.center, &grid.frame, grid.cell, grid.pitch);
    let across = |slopes: [f64; 2]| (slopes[0] - slopes[1]).abs();
    let others = sheets.iter().enumerate().filter(|(function, _)| *function != electrode).map(|(_, sheet)| sheet);
    let Some(sheet) = others.max_by(|a, b| across(a.slopes).total_cmp(&across(b.slopes))) else { return Vec::new() };
    // A potential that is off by what the field is, along a pitch from the grid.
    let strongest = sheet.slopes[0].abs().max(sheet.slopes[1].abs());
    let error = solution.errors.field * strongest * grid.pitch / across(sheet.slopes) + sheet.uncertainty;
    let mut numbers = vec![
        Number::new("delta", "m", sheet.delta, error),
        Number::new("tau", "m", sheet.tau, 4.0 * error),
        Number::new("leakage", "m", sheet.delta + 0.25 * sheet.tau, 2.0 * error),
    ];
    let functions = driven.functions(&weights(driven));
    for (side, name) in ["field_above", "field_below"].into_iter().enumerate() {
        let of = |sheet: &field::GridSheet, volts: &f64| -sheet.slopes[side] * volts;
        let field: f64 = sheets.iter().zip(&functions).map(|(sheet, volts)| of(sheet, volts)).sum();
        let size: f64 = sheets.iter().zip(&functions).map(|(sheet, volts)| of(sheet, volts).abs()).sum();
        numbers.push(Number::new(name, "V/m", field, solution.errors.field * size));
    }
    numbers
}
