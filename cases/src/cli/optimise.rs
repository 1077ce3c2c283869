//! `graintrap study` of an optimisation: the case with the best values of some keys.

use std::collections::HashMap;
use std::fmt::Write;
use std::sync::Mutex;
use std::time::Instant;

use serde_json::json;

use super::arguments::StudyArguments;
use super::session::Session;
use super::study::{LISTED, write_table};
use crate::cache::Cache;
use crate::case::{Goal, Optimise};
use crate::output::pictures;
use crate::pipeline::{Failure, Reporter, Silent, memory};
use crate::study::best::{BEST, best};
use crate::study::files::{CSV, JSON, Table};
use crate::study::grid::strikes::Book;
use crate::study::history::{history, parameters};
use crate::study::journal::{Journal, kept};
use crate::study::optimise::{Outcome, VIOLATION, as_sweep, optimise as search};
use crate::study::row::Row;
use crate::study::work::Work;

pub(super) fn optimise(mut session: Session, arguments: &StudyArguments) -> Result<(), Failure> {
    let start = Instant::now();
    let Some(optimise) = session.case.study.optimise.clone() else { return Ok(()) };
    if arguments.shard.is_some() || !arguments.merge.is_empty() {
        let help = "leave --shard and --merge out; --threads says how many threads work on each";
        return Err(Failure::usage("the evaluations of an optimisation come one after the other", help));
    }
    let folder = session.folder.clone();
    if arguments.common.cache.is_none() {
        session.cache = Cache::shared(&folder.join("cache"), arguments.common.fresh);
    }
    let mut out = session.output()?;
    let before = if arguments.common.fresh { HashMap::new() } else { kept(&folder) };
    let journal = Journal::open(&folder, arguments.common.fresh)?;
    let strikes = Book::new(&folder, arguments.common.fresh);
    // The search tells how far it is itself, not the field of each evaluation.
    let work = Work {
        case: &session.case,
        source: &session.source,
        cache: &session.cache,
        journal: &journal,
        strikes: &strikes,
        reporter: &Silent,
        solids: Mutex::default(),
        last: Mutex::default(),
    };
    let outcome = search(&work, &*session.progress, &mut out, &optimise, &before)?;
    let sweep = as_sweep(&optimise);
    let table = Table::new(&sweep, &outcome.rows);
    write_table(&mut out, &table)?;
    let title = session.title();
    pictures::write(&mut out, "history", &history(&title, &optimise, &outcome))?;
    pictures::write(&mut out, "study", &parameters(&title, &optimise, &outcome))?;
    let figures = figures(&optimise, &outcome);
    if let Some(row) = outcome.best.map(|n| &outcome.rows[n]) {
        let comment =
            format!("# {}\n#\n{}", title, figures.lines().map(|line| format!("# {line}\n")).collect::<String>());
        let text = best(&session.case, &session.source, &optimise, &row.values, &comment).map_err(|problem| {
            let help = format!("the values are in {CSV}; report this as a defect");
            Failure::run(format!("{BEST} cannot be made: {problem}"), help)
        })?;
        out.write(BEST, |w| w.write_all(text.as_bytes()))?;
    }
    let failed: Vec<&Row> = outcome.rows.iter().filter(|row| row.reason().is_some()).collect();
    if let Some(first) = failed.first() {
        let (reason, all) = (first.reason().unwrap_or_default(), outcome.rows.len());
        let of = format!("{} of {all} evaluations failed, number {} first: {reason}", failed.len(), first.point + 1);
        session.progress.warning(&of);
    }
    let mut files = out.names().to_vec();
    files.push(JSON.to_owned());
    let described: Vec<_> =
        table.columns.iter().map(|column| json!({ "name": column.name, "unit": column.unit })).collect();
    let rows = table.json();
    let mut object = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "command": "study",
        "title": title,
        "kind": session.case.study.kind,
        "points": outcome.rows.len(),
        "failed": failed.len(),
        "objective": optimise.objective.text,
        "goal": optimise.goal,
        "optimiser": optimise.optimiser,
        "converged": outcome.converged,
        "active": outcome.active,
        "best": outcome.best.map(|best| rows[best].clone()),
        "rows_kept": outcome.tally.rows_kept,
        "solved": outcome.tally.solved,
        "solutions_kept": outcome.tally.solutions_kept,
        "tabulated": outcome.tally.tabulated,
        "columns": described,
        "threads": rayon::current_num_threads(),
        "seconds": start.elapsed().as_secs_f64(),
        "peak_memory_bytes": memory::peak(),
        "warnings": session.progress.warnings(),
        "files": files,
    });
    if rows.len() <= LISTED {
        object["rows"] = rows.into();
    }
    out.write(JSON, |w| serde_json::to_writer_pretty(w, &object))?;
    out.commit()?;
    session.say(&object, || {
        let tally = outcome.tally;
        format!(
            "study        {title}\n{figures}field        {} solved, {} of the rows kept from before\ntime         {:.1} s\nfiles        {}: {}\n",
            tally.solved,
            tally.rows_kept,
            start.elapsed().as_secs_f64(),
            folder.display(),
            files.join(", ")
        )
    });
    match outcome.best {
        Some(_) => Ok(()),
        None => Err(nothing(&outcome, &failed)),
    }
}

/// Why there is no best.
fn nothing(outcome: &Outcome, failed: &[&Row]) -> Failure {
    if failed.len() == outcome.rows.len() {
        let reason = failed.first().and_then(|row| row.reason()).unwrap_or_default();
        let help = format!("start elsewhere, or with narrower bounds; the reasons are in {CSV}");
        return Failure::run(format!("every evaluation failed: {reason}"), help);
    }
    let least = outcome.rows.iter().filter_map(|row| row.value(VIOLATION)).fold(f64::INFINITY, f64::min);
    let problem = format!("no evaluation holds all constraints; the nearest breaks one by {least:.2e} of its size");
    Failure::run(problem, format!("loosen the constraints or the bounds, or allow more evaluations; all are in {CSV}"))
}

/// What was reached, in words.
fn figures(optimise: &Optimise, outcome: &Outcome) -> String {
    let mut text = String::new();
    let goal = if optimise.goal == Goal::Maximise { "as large as can be" } else { "as small as can be" };
    let _ = writeln!(text, "objective    {}, {goal}", optimise.objective.text);
    if let (Some((value, error)), Some(best)) = (outcome.objective, outcome.best) {
        let within = if error > 0.0 { format!(" within {error:.1e}") } else { String::new() };
        let _ =
            writeln!(text, "best         {}{within}, evaluation {} of {}", digits(value), best + 1, outcome.rows.len());
        let row = &outcome.rows[best];
        for (varied, value) in optimise.varied.iter().zip(&row.values) {
            let bounds = varied.range.map(|x| varied.written(x).trim_matches('"').to_owned());
            let _ = writeln!(
                text,
                "             {} = {} (from {} to {})",
                varied.key,
                value.trim_matches('"'),
                bounds[0],
                bounds[1]
            );
        }
    }
    let converged = if outcome.converged {
        format!("yes, to {:e} of the ranges", optimise.tolerance)
    } else if outcome.rows.len() >= optimise.evaluations {
        format!("no: {} evaluations were not enough", optimise.evaluations)
    } else {
        "no".to_owned()
    };
    let _ = writeln!(text, "converged    {converged}");
    let active = if outcome.active.is_empty() { "nothing".to_owned() } else { outcome.active.join(", ") };
    let _ = writeln!(text, "held back by {active}");
    text
}

/// A number in nine digits.
fn digits(x: f64) -> String {
    if x == 0.0 || (1e-3..1e7).contains(&x.abs()) {
        let places = (8 - x.abs().max(1e-9).log10().floor() as i32).clamp(0, 12) as usize;
        let text = format!("{x:.places$}");
        return if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    }
    format!("{x:.8e}")
}
