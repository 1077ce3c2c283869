//! `graintrap solve` and `graintrap table`: fields without grains; also the first half of every run.

use std::time::Instant;

use super::session::Session;
use crate::case::Case;
use crate::output::field_map::{FieldMap, NODES};
use crate::output::summary::{SolveSummary, Summary, TableSummary};
use crate::output::{OutputFolder, electrodes, field_map, pictures};
use crate::pipeline::drives::{Driven, strengths, tabulated_field};
use crate::pipeline::ready::{Ready, check_starts_again, ready};
use crate::pipeline::solution::{Solution, solve};
use crate::pipeline::tables::{Plan, Tabulated, table};
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
    let solution = solved(session, &session.case, &ready)?;
    let planned = match extent {
        Extent::Solution => None,
        Extent::Table => Some(tabulated(session, &solution)?),
    };
    let mut summary = session.summary(if extent == Extent::Table { "table" } else { "solve" });
    let start = Instant::now();
    write(session, &mut out, &mut summary, &solution, planned.as_ref().map(|(_, tabulated)| tabulated))?;
    let planned = planned.as_ref().map(|(plan, tabulated)| (plan, tabulated));
    session.cache.write(&mut out, &session.case, &solution, planned)?;
    summary.seconds.write = start.elapsed().as_secs_f64();
    session.finish(out, summary)
}

/// Solves, unless the solution was kept, and checks that grains still start outside of the conductors that were solved.
pub(super) fn solved(session: &Session, case: &Case, ready: &Ready) -> Result<Solution, Failure> {
    let solution = match session.kept(session.cache.solution(case)) {
        Some(solution) => {
            solution.warnings.iter().for_each(|text| session.progress.warning(text));
            solution
        }
        None => solve(case, &session.source, ready, &*session.progress)?,
    };
    check_starts_again(case, &session.source, ready, &solution.basis)?;
    Ok(solution)
}

/// Tabulates, unless the table was kept.
pub(super) fn tabulated(session: &Session, solution: &Solution) -> Result<(Plan, Tabulated), Failure> {
    let (case, source, basis) = (&session.case, &session.source, &solution.basis);
    let plan = Plan::new(case, basis);
    let tabulated = match session.kept(session.cache.table(case, &plan)) {
        Some(tabulated) => {
            tabulated.warn_if_missed(case, &*session.progress);
            tabulated
        }
        None => table(case, source, basis, &plan, &*session.progress)?,
    };
    Ok((plan, tabulated))
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
    summary.reused.extend(solution.kept.then_some("solution"));
    summary.reused.extend(tabulated.filter(|tabulated| tabulated.kept).map(|_| "table"));
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
