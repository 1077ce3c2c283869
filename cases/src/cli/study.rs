//! `graintrap study`: the case at every point of its sweep.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use serde_json::json;

use super::arguments::StudyArguments;
use super::session::Session;
use crate::cache::Cache;
use crate::case::{StudyKind, Sweep};
use crate::output::OutputFolder;
use crate::output::pictures;
use crate::output::summary::CaseText;
use crate::pipeline::{Failure, Reporter, memory};
use crate::study::figures::figure;
use crate::study::files::{CSV, JSON, PARQUET, Table, unknown_report};
use crate::study::front::Front;
use crate::study::grid::strikes::{self, Book, Struck};
use crate::study::journal::{JOURNAL, Journal, kept, name};
use crate::study::points::{Point, Refused, points};
use crate::study::row::{End, Row};
use crate::study::shard::Shard;
use crate::study::work::{Tally, Work};

/// Rows that `--json` and `study.json` list.
pub(super) const LISTED: usize = 10_000;

pub(super) fn study(mut session: Session, arguments: &StudyArguments) -> Result<(), Failure> {
    let start = Instant::now();
    if session.case.study.optimise.is_some() {
        return super::optimise::optimise(session, arguments);
    }
    let (case, source) = (&session.case, &session.source);
    let Some(sweep) = case.sweep.clone() else {
        let help = "add [sweep] with a line such as \"electrode.left.dc\" = [\"1 V\", \"2 V\"]";
        return Err(source.error_at("sweep", "the case varies nothing", help).into());
    };
    let (mut all, mut refused) = points(case, source);
    if all.is_empty() && !refused.is_empty() {
        // Wrong everywhere: what is wrong is the case, not the point.
        return Err(refused.remove(0).error.into());
    }
    if !arguments.merge.is_empty() {
        return merge(&session, &sweep, &arguments.merge, start);
    }
    let shard = shard(arguments, &session);
    if let Some(shard) = shard {
        session.folder = session.folder.join(format!("shard-{}-of-{}", shard.index + 1, shard.count));
        all = shard.of_points(all);
        refused.retain(|refused| refused.number % shard.count == shard.index);
    }
    let folder = session.folder.clone();
    if arguments.common.cache.is_none() {
        session.cache = Cache::shared(&folder.join("cache"), arguments.common.fresh);
    }
    let mut out = session.output()?;
    let before = if arguments.common.fresh { HashMap::new() } else { kept(&folder) };
    let journal = Journal::open(&folder, arguments.common.fresh)?;
    let strikes = Book::new(&folder, arguments.common.fresh);
    let work = Work {
        case: &session.case,
        source: &session.source,
        cache: &session.cache,
        journal: &journal,
        strikes: &strikes,
        reporter: &*session.progress,
        solids: Mutex::default(),
        last: Mutex::default(),
    };
    let (rows, tally) = work.rows(&mut out, all, refused, &before)?;
    finish(&session, out, &sweep, &rows, tally, shard, start)
}

/// The part of the study that is ours.
fn shard(arguments: &StudyArguments, session: &Session) -> Option<Shard> {
    if let Some(shard) = arguments.shard {
        return (shard.count > 1).then_some(shard);
    }
    let (shard, by) = Shard::of_environment(|name| std::env::var(name).ok())?;
    session.remark(&format!("part {shard} of the study, as {by} says; --shard 1/1 does all of it"));
    Some(shard)
}

/// Joins the rows that shards kept.
fn merge(session: &Session, sweep: &Sweep, folders: &[PathBuf], start: Instant) -> Result<(), Failure> {
    let mut found: HashMap<String, Row> = HashMap::new();
    for folder in folders {
        if !folder.join(JOURNAL).is_file() {
            let help = "give the folders that `graintrap study --shard i/n` wrote";
            return Err(Failure::usage(format!("{} holds no study", folder.display()), help));
        }
        for (key, row) in kept(folder) {
            // What one part failed to do another may have done.
            let better = found.get(&key).is_none_or(|known| matches!(known.end, End::Failed(_)));
            if better {
                found.insert(key, row);
            }
        }
    }
    let (points, refused) = points(&session.case, &session.source);
    let mut rows: Vec<Row> = refused
        .into_iter()
        .map(|Refused { number, values, error }| Row {
            point: number,
            values,
            end: End::refused(&error),
            warnings: Vec::new(),
        })
        .collect();
    let mut missing = Vec::new();
    for Point { number, values, key, .. } in points {
        match found.get(&name(&key)) {
            Some(row) => rows.push(Row { point: number, values, ..row.clone() }),
            None => missing.push(number + 1),
        }
    }
    if !missing.is_empty() {
        let few: Vec<String> = missing.iter().take(5).map(usize::to_string).collect();
        let more = if missing.len() > few.len() { ", ..." } else { "" };
        let problem = format!(
            "{} of {} points are in none of these folders: {}{more}",
            missing.len(),
            missing.len() + rows.len(),
            few.join(", ")
        );
        let help = "let every shard come to its end (one that was stopped goes on where it was), and name all of their folders; the case must be the one they had";
        return Err(Failure::run(problem, help));
    }
    rows.sort_by_key(|row| row.point);
    let out = session.output()?;
    let tally = Tally { rows_kept: rows.len(), ..Tally::default() };
    // What was joined is kept here too, so that the study can grow.
    let journal = Journal::open(&session.folder, true)?;
    for (key, row) in &found {
        journal.add_named(key, row)?;
    }
    let book = Book::new(&session.folder, true);
    for (key, struck) in folders.iter().flat_map(|folder| strikes::kept(folder)) {
        book.add_named(key, struck)?;
    }
    finish(session, out, sweep, &rows, tally, None, start)
}

/// Writes tables and plots, and tells of them.
fn finish(
    session: &Session,
    mut out: OutputFolder,
    sweep: &Sweep,
    rows: &[Row],
    tally: Tally,
    shard: Option<Shard>,
    start: Instant,
) -> Result<(), Failure> {
    if let Err((unknown, names)) = unknown_report(&session.case, rows) {
        let help = format!("there are {}", names.join(", "));
        session.progress.warning(&format!("the sweep reports `{unknown}`, which no point has; {help}"));
    }
    let table = Table::new(sweep, rows);
    write_table(&mut out, &table)?;
    if let Some(figure) = figure(&session.title(), sweep, rows) {
        pictures::write(&mut out, "study", &figure)?;
    }
    let front = match session.case.study.kind {
        StudyKind::GridTransparency => Front::of(rows, &session.case.study.weighing),
        StudyKind::Sweep | StudyKind::Optimise => None,
    };
    if let Some(front) = &front {
        pictures::write(&mut out, "front", &front.figure(&session.title()))?;
    }
    let struck = struck(session, rows);
    if !struck.is_empty() {
        out.write(strikes::CSV, |w| strikes::csv(&struck, w))?;
    }
    if let Some(figure) = strikes::figure(&session.title(), &struck) {
        pictures::write(&mut out, "strikes", &figure)?;
    }
    let failed: Vec<&Row> = rows.iter().filter(|row| row.reason().is_some()).collect();
    if let Some(first) = failed.first() {
        let reason = first.reason().unwrap_or_default();
        let of = format!("{} of {} points failed, point {} first: {reason}", failed.len(), rows.len(), first.point + 1);
        session.progress.warning(&of);
    }
    let mut files = out.names().to_vec();
    files.push(JSON.to_owned());
    let described: Vec<_> =
        table.columns.iter().map(|column| json!({ "name": column.name, "unit": column.unit })).collect();
    let mut object = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "command": "study",
        "title": session.title(),
        "case": CaseText::new(&session.source),
        "kind": session.case.study.kind,
        "points": rows.len(),
        "failed": failed.len(),
        "shard": shard.map(|shard| shard.to_string()),
        "rows_kept": tally.rows_kept,
        "solved": tally.solved,
        "solutions_kept": tally.solutions_kept,
        "tabulated": tally.tabulated,
        "columns": described,
        "threads": rayon::current_num_threads(),
        "seconds": start.elapsed().as_secs_f64(),
        "peak_memory_bytes": memory::peak(),
        "warnings": session.progress.warnings(),
        "files": files,
    });
    if let Some(front) = &front {
        object["front"] = front.json(rows);
    }
    if rows.len() <= LISTED {
        object["rows"] = table.json().into();
    }
    out.write(JSON, |w| serde_json::to_writer_pretty(w, &object))?;
    out.commit()?;
    let sentence = front.map(|front| front.sentence(sweep, rows));
    session.say(&object, || {
        let read = sentence.map(|sentence| format!("grids        {sentence}\n")).unwrap_or_default();
        text(session, rows, &failed, tally, start, &files, &session.folder) + &read
    });
    if !rows.is_empty() && failed.len() == rows.len() {
        let reason = failed[0].reason().unwrap_or_default();
        return Err(Failure::run(format!("every point failed: {reason}"), format!("the reasons are in {CSV}")));
    }
    Ok(())
}

/// Where grains struck grids, for each row that has such.
fn struck(session: &Session, rows: &[Row]) -> Struck {
    let mut kept = strikes::kept(&session.folder);
    if kept.is_empty() {
        return Vec::new();
    }
    let (points, _) = points(&session.case, &session.source);
    let ours = points.iter().filter(|point| rows.iter().any(|row| row.point == point.number));
    ours.filter_map(|point| Some((point.number + 1, kept.remove(&name(&point.key))?))).collect()
}

/// Writes the rows as tables.
pub(super) fn write_table(out: &mut OutputFolder, table: &Table) -> Result<(), Failure> {
    out.write(CSV, |w| table.csv(w))?;
    let columns = table.parquet().map_err(|error| {
        Failure::run(
            format!("{PARQUET} cannot be made: {error}"),
            "the rows are in the journal; report this as a defect",
        )
    })?;
    out.write(PARQUET, |w| w.write_all(&columns))
}

/// The study in words.
fn text(
    session: &Session,
    rows: &[Row],
    failed: &[&Row],
    tally: Tally,
    start: Instant,
    files: &[String],
    folder: &Path,
) -> String {
    let done = rows.len() - failed.len();
    let kept =
        if tally.rows_kept > 0 { format!(", {} of the rows kept from before", tally.rows_kept) } else { String::new() };
    format!(
        "study        {}\npoints       {}: {done} done, {} failed{kept}\nfield        {} solved, {} kept, {} tabulated\ntime         {:.1} s\nfiles        {}: {}\n",
        session.title(),
        rows.len(),
        failed.len(),
        tally.solved,
        tally.solutions_kept,
        tally.tabulated,
        start.elapsed().as_secs_f64(),
        folder.display(),
        files.join(", ")
    )
}
