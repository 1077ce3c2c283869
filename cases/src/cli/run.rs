//! `graintrap run` and `graintrap trace`: the whole chain.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::fields;
use super::session::Session;
use crate::checkpoint::{self, CHECKPOINT, Checkpoint, Left};
use crate::output::summary::TraceSummary;
use crate::output::{pictures, tracks};
use crate::pipeline::analysis::trap::traps;
use crate::pipeline::flights::{Kept, fly, induction, obstacles};
use crate::pipeline::ready::{flight_region, ready};
use crate::pipeline::{Failure, Reporter};

/// Mesh, solve, tabulate, trace, write. `resume`: from where an earlier run left the grains; `trace`: there must be grains.
pub(super) fn run(session: &Session, resume: bool, trace: bool) -> Result<(), Failure> {
    let (case, source) = (&session.case, &session.source);
    if trace && case.grains.is_empty() {
        let help = "add [[grains]] and [trace] to it, or use `graintrap table` to look at its field";
        return Err(source.error_at("grains", "the case has no grains to trace", help).into());
    }
    let left = left(session, resume)?;
    let mut out = session.output()?;
    let ready = ready(case, source, &*session.progress)?;
    let mut summary = session.summary(if trace { "trace" } else { "run" });
    let solution = fields::solved(session, case, &ready)?;
    let (plan, tabulated) = fields::tabulated(session, &solution)?;
    let start = Instant::now();
    let driven = fields::write(session, &mut out, &mut summary, &solution, Some(&tabulated))?;
    session.cache.write(&mut out, case, &solution, Some((&plan, &tabulated)))?;
    let mut writing = start.elapsed().as_secs_f64();
    if let (Some(settings), Some(driven)) = (&case.trace, driven)
        && !ready.ensemble.is_empty()
    {
        let mesh = &solution.basis.mesh;
        let region = flight_region(case, mesh);
        let surface = obstacles(mesh, case.field.ground.as_ref(), &region);
        let reporter: Arc<dyn Reporter> = session.progress.clone();
        let every = case.output.checkpoint.map(|s| Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX));
        let journal = Checkpoint::new(&session.folder, case, every, left.as_ref(), out.early("cache"))?;
        let kept = Some(Kept { journal: Arc::new(journal), standing: left.map(|left| Arc::new(left.standing)) });
        let induction = induction(case, source, &ready.electrodes, &*reporter)?;
        let flights = fly(
            case,
            settings,
            source,
            driven.field,
            induction,
            surface,
            &ready.ensemble,
            region,
            true,
            kept,
            &reporter,
        )?;
        session.progress.stage("write");
        let start = Instant::now();
        tracks::write(&mut out, &flights, &ready.ensemble)?;
        pictures::of_flights(&mut out, &session.title(), &flights, mesh)?;
        let trace = TraceSummary::new(case, &flights);
        if trace.outcomes.unstable > 0 {
            session.progress.warning(&format!(
                "{} of {} grains were given up: the force on them, or their motion, was no longer finite. Look at their mass and charge, and at the voltages",
                trace.outcomes.unstable, trace.grains
            ));
        }
        summary.trace = Some(trace);
        summary.seconds.trace = Some(flights.seconds);
        writing += start.elapsed().as_secs_f64();
    }
    summary.traps = traps(case, &solution);
    if summary.trace.is_none() {
        summary.trace = Some(TraceSummary::none(&flight_region(case, &solution.basis.mesh)));
        summary.seconds.trace = Some(0.0);
    }
    summary.seconds.write = writing;
    session.finish(out, summary)?;
    Checkpoint::remove(&session.folder);
    Ok(())
}

/// What an earlier run left to resume.
fn left(session: &Session, resume: bool) -> Result<Option<Left>, Failure> {
    let path = session.folder.join(CHECKPOINT);
    if !resume {
        if path.is_file() {
            session.progress.warning(&format!(
                "{} is that of a run which did not end; --resume would go on with it, this run begins anew and replaces it",
                path.display()
            ));
        }
        return Ok(None);
    }
    let left = checkpoint::left(&session.folder, &session.case)?;
    match &left {
        None => session.progress.warning(&format!("there is no {} to resume: the run begins anew", path.display())),
        Some(left) => left.remark.iter().for_each(|remark| session.progress.warning(remark)),
    }
    Ok(left)
}
