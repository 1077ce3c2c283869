//! From the keys of a case file to a [`Case`]: defaults filled in, and every rule checked that ties keys together.

mod analysis;
mod at;
mod chart;
mod electrodes;
mod files;
mod grains;
mod names;
mod optimise;
mod settings;
mod shapes;
mod sources;
mod study;
mod sweep;
mod waveforms;

use crate::case::Case;
use crate::case_source::CaseSource;
use crate::error::CaseError;
use crate::explain::explain;
use crate::keys::CaseKeys;
use crate::reader::read;

use at::At;
use waveforms::Drives;

/// Reads the tree and checks it.
pub(crate) fn case(source: &CaseSource) -> Result<Case, CaseError> {
    resolved(source, true)
}

/// The corners of a chart are cases, which have none.
fn resolved(source: &CaseSource, with_chart: bool) -> Result<Case, CaseError> {
    let keys: CaseKeys = read(&source.tree).map_err(|fault| explain(source, fault))?;
    let root = At::root(source);
    if keys.electrode.is_empty() && keys.source.is_empty() {
        return Err(root.error(
            "the case has neither electrodes nor sources",
            "add an [[electrode]] (or a field in closed form, [[source]])",
        ));
    }
    let drives = Drives::resolve(&root, &keys.drive)?;
    let electrodes = electrodes::electrodes(&root.key("electrode"), &keys.electrode, &drives)?;
    let sources = sources::sources(&root.key("source"), &keys.source, &drives)?;
    names::all_different(&root, &electrodes, &sources)?;
    let grains = grains::groups(&root.key("grains"), &keys.grains)?;
    let forces = settings::forces(&root.key("forces"), &keys.forces, &grains)?;
    let trace = settings::trace(&root, keys.trace.as_ref(), &grains, &forces)?;
    let field = settings::field(&root.key("field"), &keys.field)?;
    if field.ground.is_some() {
        names::not_ground(&root, &electrodes, &sources)?;
    }
    let analysis = analysis::analysis(&root.key("analysis"), &keys.analysis, &electrodes)?;
    let mut case = Case {
        title: keys.title.unwrap_or_default(),
        electrodes,
        sources,
        table: settings::table(&root.key("table"), &keys.table, &field)?,
        field,
        grains,
        forces,
        trace,
        output: settings::output(&keys.output),
        analysis,
        sweep: keys.sweep.map(|keys| sweep::sweep(&root.key("sweep"), keys)).transpose()?,
        study: study::study(&root.key("study"), &keys.study)?,
    };
    (case.study.optimise, case.study.asked) = optimise::optimise(&root.key("study"), &keys.study, &case)?;
    if let Some(keys) = keys.analysis.chart.as_ref().filter(|_| with_chart) {
        case.analysis.chart = Some(chart::chart(&root.key("analysis").key("chart"), keys, &case)?);
    }
    Ok(case)
}
