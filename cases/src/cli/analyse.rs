//! `graintrap analyse`: the case as a trap.

use std::time::Instant;

use super::fields::{solved, tabulated};
use super::session::Session;
use crate::output::summary::CaseText;
use crate::output::{analysis_chart, analysis_pictures, analysis_text, electrodes};
use crate::pipeline::analysis::analyse as analysis;
use crate::pipeline::analysis::chart::scan;
use crate::pipeline::choice::Solver;
use crate::pipeline::drives::strengths;
use crate::pipeline::ready::ready;
use crate::pipeline::{Failure, Reporter};

/// Accuracy of the field that is asked for at least, where it is to be had in a tenth of a second.
const ON_CURVES: f64 = 1e-7;

/// Name of the file with everything.
const FILE: &str = "analysis.json";

pub(super) fn analyse(session: &Session) -> Result<(), Failure> {
    let source = &session.source;
    let mut out = session.output()?;
    let ready = ready(&session.case, source, &*session.progress)?;
    // On generating curves seven digits cost nothing, and trap parameters are worth them.
    let mut case = session.case.clone();
    if ready.choice.solver == Solver::Axisymmetric {
        case.field.accuracy = case.field.accuracy.min(ON_CURVES);
    }
    let case = &case;
    let solution = solved(session, case, &ready)?;
    let start = Instant::now();
    let (mut report, shown) = analysis(case, source, &solution, &*session.progress)?;
    let chart = case.analysis.chart.as_ref();
    // Grains of a chart fly through the table, as those of a run; sources by themselves are as fast as one.
    let flown = chart.is_some_and(|chart| chart.grains.is_some()) && !case.electrodes.is_empty();
    let tabulated = flown.then(|| tabulated(session, &solution)).transpose()?;
    let scan = match chart {
        None => None,
        Some(chart) => {
            let table = tabulated.as_ref().map(|(_, tabulated)| &tabulated.table);
            let (short, scan) = scan(case, source, &solution, table, chart, report.center.into(), &*session.progress)?;
            report.chart = Some(short);
            Some(scan)
        }
    };
    session.progress.stage("pictures");
    let start_of_flight = case.trace.as_ref().map_or(0.0, |trace| trace.start);
    let strengths = strengths(case, &solution.basis, start_of_flight);
    out.write(electrodes::FILE, |w| electrodes::write(w, case, &solution.basis, &strengths))?;
    analysis_pictures::write(&mut out, case, &session.title(), &solution, &report, &shown)?;
    if let (Some(short), Some(scan)) = (&report.chart, &scan) {
        analysis_chart::write(&mut out, &session.title(), short, scan)?;
    }
    let kept = tabulated.as_ref().map(|(plan, tabulated)| (plan, tabulated));
    session.cache.write(&mut out, case, &solution, kept)?;
    report.version = env!("CARGO_PKG_VERSION");
    report.command = "analyse";
    report.title = session.title();
    report.case = Some(CaseText::new(source));
    report.seconds = start.elapsed().as_secs_f64();
    report.warnings = session.progress.warnings();
    report.files = out.names().to_vec();
    report.files.push(FILE.to_owned());
    out.write(FILE, |w| serde_json::to_writer_pretty(w, &report))?;
    out.commit()?;
    session.say(&report, || analysis_text::text(&report, &session.folder));
    Ok(())
}
