//! `graintrap solve` and `graintrap table`: fields without grains; also the first half of every run.

use std::time::Instant;

use super::session::Session;
use crate::cache;
use crate::output::field_map::{FieldMap, NODES};
use crate::output::summary::{SolveSummary, Summary, TableSummary};
use crate::output::{OutputFolder, electrodes, field_map, pictures};
use crate::pipeline::drives::{Driven, strengths, tabulated_field};
use crate::pipeline::ready::{Ready, check_starts_again, ready};
use crate::pipeline::solution::{Solution, solve};
use crate::pipeline::tables::{Tabulated, table};
use crate::pipeline::{Failure, Reporter, memory, region};

/// How far a verb goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    Solution,
    Table,
}

pub(super) fn fields(session: &Session, extent: Extent) -> Result<(), Failure> {
    let mut out = session.output()?;
    let ready = ready(&session.case, &session.source, &*session.progress)?;
    let solution = solved(session, &ready)?;
    let tabulated = match extent {
        Extent::Solution => None,
        Extent::Table => Some(table(&session.case, &session.source, &solution.basis, &*session.progress)?),
    };
    let mut summary = session.summary(if extent == Extent::Table { "table" } else { "solve" });
    let start = Instant::now();
    write(session, &mut out, &mut summary, &solution, tabulated.as_ref())?;
    cache::write(&mut out, &session.case, &solution, tabulated.as_ref())?;
    summary.seconds.write = start.elapsed().as_secs_f64();
    session.finish(out, summary)
}

/// Solves, and checks that grains still start outside of the conductors that were solved.
pub(super) fn solved(session: &Session, ready: &Ready) -> Result<Solution, Failure> {
    let solution = solve(&session.case, &session.source, ready, &*session.progress)?;
    check_starts_again(&session.case, &session.source, ready, &solution.basis)?;
    Ok(solution)
}

/// Writes the electrodes and, from a table, the field; fills in the summary. Gives the driven field, if there is a table.
pub(super) fn write(
    session: &Session,
    out: &mut OutputFolder,
    summary: &mut Summary,
    solution: &Solution,
    tabulated: Option<&Tabulated>,
) -> Result<Option<Driven>, Failure> {
    let (case, basis) = (&session.case, &solution.basis);
    let start = case.trace.as_ref().map_or(0.0, |trace| trace.start);
    let strengths = strengths(case, basis, start);
    summary.solve = Some(SolveSummary::new(case, solution, &strengths));
    summary.seconds.mesh = solution.mesh_seconds;
    summary.seconds.solve = solution.solve_seconds;
    out.write(electrodes::FILE, |w| electrodes::write(w, case, basis, &strengths))?;
    let Some(tabulated) = tabulated else { return Ok(None) };
    summary.table = Some(TableSummary::new(tabulated));
    summary.seconds.table = Some(tabulated.seconds);
    let driven = tabulated_field(case, basis, &tabulated.table);
    check_map(session, &driven)?;
    session.progress.stage("field map");
    let bounds = region::table_box(case, &basis.mesh);
    let map = FieldMap::new(case, &driven, &bounds);
    out.write(field_map::FILE, |w| map.write(w))?;
    pictures::potential_along_axis(out, case, &session.title(), &driven, &bounds)?;
    Ok(Some(driven))
}

/// Refuses a map of the field that fits in no memory.
fn check_map(session: &Session, driven: &Driven) -> Result<(), Failure> {
    let nodes = session.case.output.field_nodes.unwrap_or(NODES);
    let (needed, free) = (FieldMap::bytes_for(nodes, driven.names.len()), memory::available());
    if needed <= free {
        return Ok(());
    }
    let (needed, free) = (memory::people(needed), memory::people(free));
    let problem = format!("a field of {nodes} nodes needs {needed} of memory to write, and {free} are free");
    Err(session.source.error_at("output.field_nodes", problem, "ask for fewer nodes").into())
}
