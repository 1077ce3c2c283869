//! The tabulated potential of a case.

use std::time::Instant;

use field::{ElectrodeBasis, PotentialTable, TableError, TableOptions, TableReport, tabulate_around};

use meshes::Vec3;
use tracer::{Ensemble, Group, Launch, Place};

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
    let (table, report) =
        tabulate_around(basis, &options, &starts(case), &|done| reporter.fraction(done)).map_err(|error| {
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

/// Grains drawn from each group to see where they start.
const DRAWN: usize = 100;

/// Places where grains start. Drawn anew, so that they depend on nothing but the places: a kept table serves other numbers of
/// grains and other seeds.
fn starts(case: &Case) -> Vec<Vec3> {
    let mut ensemble = Ensemble::new();
    for (number, group) in case.grains.iter().enumerate() {
        let count = if let Place::Points(points) = &group.place { points.len() } else { DRAWN };
        let drawn = Group {
            count,
            charge: group.charge,
            mass: group.mass,
            radius: group.radius,
            place: group.place.clone(),
            launch: Launch::Rest,
        };
        // What cannot be drawn was refused before.
        let _ = ensemble.add_group(number as u32, &drawn, 0);
    }
    ensemble.positions().to_vec()
}
