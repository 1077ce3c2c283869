//! A grid from nearby: its ripple, and what follows the lines of the field.

use std::f64::consts::TAU;

use field::{FieldLines, GridFrame, field_lines, ripple_depths};

use super::super::row::Number;
use super::{fraction, weights};
use crate::pipeline::drives::Driven;
use crate::pipeline::solution::Solution;

/// The share of the field that counts as ripple.
const RIPPLE: f64 = 0.01;

/// How far the ripple of the driven field reaches on both sides: where it has fallen to 1 % of the field.
pub(super) fn ripple(solution: &Solution, driven: &Driven, grid: &GridFrame) -> Vec<Number> {
    let depths = ripple_depths(&**driven.field.basis(), &weights(driven), grid, RIPPLE);
    // A ripple that is off by what the field is, and where the search for its depth ends.
    let error = grid.cell[0].max(grid.cell[1]) / TAU * solution.errors.field + 1e-3 * grid.pitch;
    let names = ["ripple_above", "ripple_below"].into_iter();
    names.zip(depths).filter_map(|(name, depth)| Some(Number::new(name, "m", depth?, error))).collect()
}

/// What becomes of field lines that come from both sides: the limit of grains without inertia.
pub(super) fn lines(driven: &Driven, electrode: usize, grid: &GridFrame, lines: usize) -> Vec<Number> {
    if lines == 0 {
        return Vec::new();
    }
    let of = |(name, side): (&str, f64)| -> Vec<Number> {
        let (basis, weights) = (driven.field.basis(), weights(driven));
        let found = field_lines(&**basis, &weights, driven.exact.tree(), electrode, grid, side, lines);
        let Some(FieldLines { followed, passed, caught }) = found else { return Vec::new() };
        let passed = fraction(&format!("lines_passed.{name}"), passed, followed);
        passed.into_iter().chain(fraction(&format!("lines_caught.{name}"), caught, followed)).collect()
    };
    [("above", 1.0), ("below", -1.0)].into_iter().flat_map(of).collect()
}
