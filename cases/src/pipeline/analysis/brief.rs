//! The parts of an analysis that are told of many traps side by side: a, q and depth, without the motion about the equilibrium.

use std::sync::Arc;

use field::BasisField;
use field::analysis::{Search, Space, Tones, clearance};
use meshes::Vec3;

use super::report::Species;
use super::species::species;
use super::{Failure, Ground, Reporter, region};
use crate::CaseSource;
use crate::case::Case;
use crate::pipeline::drives;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;

/// a, q and depth of the trap for the first grains of a case, about the minimum of the effective potential that is nearest to the middle.
/// `tabulated`, where there is one, tells the field in place of the exact sum: the search asks for tens of thousands of points.
///
/// Nothing without grains, without an RF, and with voltages that are sampled from a file.
///
/// # Errors
/// As [`super::analyse`].
pub fn brief(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    tabulated: Option<&Tabulated>,
    reporter: &dyn Reporter,
) -> Result<Option<Species>, Failure> {
    let Some(group) = case.grains.first() else { return Ok(None) };
    let basis = &solution.basis;
    let driven = drives::exact_field(case, basis);
    let Some(tones) = Tones::of(driven.field.waveforms()).filter(|tones| tones.strongest().is_some()) else {
        return Ok(None);
    };
    let fast = tabulated.map(|tabulated| drives::tabulated_field(case, basis, &tabulated.table));
    let field: &Arc<dyn BasisField> = fast.as_ref().unwrap_or(&driven).field.basis();
    let bounds = case.analysis.region.unwrap_or_else(|| region::trap_box(case, &basis.mesh));
    let exact = Arc::clone(&driven.exact);
    let room = |p: &Vec3| clearance(&exact, p);
    let size = 0.5 * (bounds.max - bounds.min).norm();
    let space = Space { field: &**field, clearance: &room, error: solution.errors.field, size };
    let lattice = Search { min: bounds.min, max: bounds.max, nodes: case.analysis.nodes }.lattice();
    let fallback = ((bounds.min + bounds.max) * 0.5, "the middle of the region".to_owned());
    let ground =
        Ground { case, source, solution, driven: &driven, tones, space, lattice, bounds, fallback, motion: false };
    species(&ground, group, reporter).map(|(species, _)| Some(species))
}
