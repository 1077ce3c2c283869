//! What a grid does to a trap: a, q and depth against those with plates.

use super::super::row::Number;
use crate::CaseSource;
use crate::case::Case;
use crate::pipeline::analysis::brief::brief;
use crate::pipeline::analysis::report::{Depth, Species};
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;
use crate::pipeline::{Failure, Reporter, Silent};

/// a and q on the axis with the largest q, and the depth, of the first grains; each with its change from the trap with plates, of q and
/// depth relative. Nothing without an RF; the depth only where grains fly.
pub(super) fn shifts(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    solid: &Solution,
    tabulated: Option<&Tabulated>,
    reporter: &dyn Reporter,
) -> Result<Vec<Number>, Failure> {
    if case.grains.is_empty() || tabulated.is_none() {
        return Ok(Vec::new());
    }
    let Some(with) = brief(case, source, solution, tabulated, reporter)? else { return Ok(Vec::new()) };
    // Of the plates nothing new is to be warned of.
    let Some(without) = brief(case, source, solid, None, &Silent)? else { return Ok(Vec::new()) };
    let mut numbers = Vec::new();
    if let (Some((q, a, error)), Some((q0, a0, error0))) = (strongest(&with), strongest(&without)) {
        let both = error + error0;
        numbers.extend([
            Number::new("q", "", q, error),
            Number::new("q_shift", "", q / q0 - 1.0, both / q0),
            Number::new("a", "", a, error),
            Number::new("a_shift", "", a - a0, both),
        ]);
    }
    if let (Some(depth), Some(before)) = (&with.depth_ev, &without.depth_ev) {
        let relative = |depth: &Depth| depth.error_estimate / before.value;
        numbers.extend([
            Number::new("depth", "eV", depth.value, depth.error_estimate),
            Number::new("depth_shift", "", depth.value / before.value - 1.0, relative(depth) + relative(before)),
        ]);
    }
    Ok(numbers)
}

/// The largest |q|, a on the same axis, and the error of both.
fn strongest(species: &Species) -> Option<(f64, f64, f64)> {
    let mathieu = species.mathieu.as_ref()?;
    let axis = (0..3).max_by(|i, j| mathieu.q[*i].abs().total_cmp(&mathieu.q[*j].abs()))?;
    Some((mathieu.q[axis].abs(), mathieu.a[axis], mathieu.error_estimate))
}
