//! The tabulated potential of a case.

use std::time::Instant;

use field::{ElectrodeBasis, PotentialTable, TableError, TableOptions, TableReport, tabulate};

use super::ready::{table_memory, table_too_large};
use super::{Failure, Reporter, region};
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
    let bounds = region::table_box(case, &basis.mesh);
    let options = TableOptions {
        min: bounds.min,
        max: bounds.max,
        accuracy: case.table.accuracy,
        spacing: case.table.spacing,
        max_bytes: table_memory(case),
    };
    let (table, report) = tabulate(basis, &options, &|done| reporter.fraction(done)).map_err(|error| {
        let TableError::TooLarge { nodes, functions, needed, available, spacing_that_fits } = error;
        table_too_large(case, source, nodes, functions, needed, available, spacing_that_fits)
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
