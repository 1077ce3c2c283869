//! The tabulated potential of a case.

use std::time::Instant;

use field::{ElectrodeBasis, PotentialTable, TableError, TableOptions, TableReport, tabulate};

use super::{Failure, Reporter, memory, region};
use crate::CaseSource;
use crate::case::Case;

/// A table and how long it took.
#[derive(Clone, Debug)]
pub struct Tabulated {
    /// The unit potentials.
    pub table: PotentialTable,
    /// What it is like.
    pub report: TableReport,
    /// s.
    pub seconds: f64,
}

/// Memory that a table may take when the case does not say, and no more than half of what is free: beyond this, finer cells
/// cost more in caches than they gain.
const USUAL_BYTES: u64 = 1 << 29;

/// Tabulates the unit potentials of a case.
///
/// # Errors
/// The table asked for does not fit in memory.
pub fn table(
    case: &Case,
    source: &CaseSource,
    basis: &ElectrodeBasis,
    reporter: &dyn Reporter,
) -> Result<Tabulated, Failure> {
    reporter.stage("table");
    let start = Instant::now();
    let free = memory::available();
    let max_bytes = match (case.table.max_memory, case.table.spacing) {
        (Some(bytes), _) => bytes.min(free),
        // Asked for outright: all that can be had.
        (None, Some(_)) => free / 10 * 9,
        (None, None) => USUAL_BYTES.min(free / 2),
    };
    let bounds = region::table_box(case, &basis.mesh);
    let options = TableOptions {
        min: bounds.min,
        max: bounds.max,
        accuracy: case.table.accuracy,
        spacing: case.table.spacing,
        max_bytes,
    };
    let (table, report) = tabulate(basis, &options, &|done| reporter.fraction(done)).map_err(|error| {
        let TableError::TooLarge { nodes, functions, needed, available, spacing_that_fits } = error;
        let key = if case.table.spacing.is_some() { "table.spacing" } else { "table.max_memory" };
        let problem = format!(
            "a table of {nodes} nodes for {functions} electrodes and sources needs {} of memory, and {} may be used",
            memory::people(needed),
            memory::people(available)
        );
        let help =
            format!("a spacing of {spacing_that_fits:.2e} m would fit; or make the box smaller (table.min, table.max)");
        Failure::from(source.error_at(key, problem, help))
    })?;
    if report.error() > case.table.accuracy {
        reporter.warning(&format!(
            "the table has an error of {:.1e}; {:.0e} was asked. Give it more memory (table.max_memory) or a smaller spacing",
            report.error(),
            case.table.accuracy
        ));
    }
    Ok(Tabulated { table, report, seconds: start.elapsed().as_secs_f64() })
}
