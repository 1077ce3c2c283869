//! The tabulated potential of a case.

use std::time::Instant;

use field::{
    ElectrodeBasis, PotentialTable, TableError, TableOptions, TableReport, Waveform, halvings_for, tabulate_around,
};

use meshes::Vec3;
use serde::{Deserialize, Serialize};
use tracer::{DEAR, Ensemble, Group, Launch, MANY, Place};

use super::ready::{table_memory, table_too_large};
use super::{Failure, Reporter, region};
use crate::CaseSource;
use crate::case::{Case, Integrator};

/// A table and how long it took. What is stored of it is the same whenever its [`Plan`] is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tabulated {
    /// The unit potentials.
    pub table: PotentialTable,
    /// What it is like.
    pub report: TableReport,
    /// s; none for what was kept.
    #[serde(skip)]
    pub seconds: f64,
    /// It was not made now: an earlier run kept it.
    #[serde(skip)]
    pub kept: bool,
}

impl Tabulated {
    /// Tells when the table is not as exact as asked.
    pub fn warn_if_missed(&self, case: &Case, reporter: &dyn Reporter) {
        if self.report.error() > case.table.accuracy {
            reporter.warning(&format!(
                "the table has an error of {:.1e}; {:.0e} was asked. Give it more memory (table.max_memory) or a smaller spacing",
                self.report.error(),
                case.table.accuracy
            ));
        }
    }
}

/// All that a table depends on besides the solution.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Its box, accuracy and spacing, and the memory it may take.
    pub options: TableOptions,
    /// How often bricks beside conductors are halved for the sake of where grains start. They have a part in the table through
    /// this and the box, and no other.
    pub halvings: u8,
}

impl Plan {
    /// What the table of a case will be.
    pub fn new(case: &Case, basis: &ElectrodeBasis) -> Self {
        let bounds = region::table_box(case, &basis.mesh);
        let options = TableOptions {
            min: bounds.min,
            max: bounds.max,
            accuracy: case.table.accuracy,
            spacing: case.table.spacing,
            max_bytes: table_memory(case),
            smooth: many_coupled_flights(case),
        };
        let halvings = halvings_for(basis, &options, &starts(case));
        Self { options, halvings }
    }
}

/// Whether grains that feel each other fly so long that a smooth table, which takes about four times the bricks, is soon paid back: the
/// multistep needs a third of the forces that `Dop853` does, but not where derivatives jump from cell to cell.
pub(super) fn many_coupled_flights(case: &Case) -> bool {
    /// Pairs of a flight that take half a minute.
    const PAIRS: f64 = 3e10;
    /// Forces that `Dop853` takes in a period of the drives, in clouds at rest.
    const FORCES: f64 = 200.0;
    let Some(trace) = case.trace.as_ref().filter(|_| case.forces.coulomb && case.forces.langevin.is_none()) else {
        return false;
    };
    let able = matches!(trace.integrator, Integrator::Auto | Integrator::Stoermer);
    let grains: usize = case.grains.iter().map(|group| group.count).sum();
    let (waveforms, _) = case.given();
    let Some(period) = waveforms.iter().filter_map(Waveform::shortest_period).min_by(f64::total_cmp) else {
        return false;
    };
    let pairs = (grains as f64).powi(2) * FORCES * trace.duration / period;
    able && case.forces.magnetic_field == Vec3::zeros() && (DEAR..=MANY).contains(&grains) && pairs > PAIRS
}

fn too_large(case: &Case, source: &CaseSource, error: TableError) -> Failure {
    match error {
        TableError::TooLarge { nodes, functions, needed, available, spacing_that_fits } => {
            table_too_large(case, source, nodes, functions, needed, available, spacing_that_fits)
        }
        TableError::TooFine { spacing_that_fits, .. } => {
            let help = format!("make it at least {spacing_that_fits:.2e} m, or the box shorter (table.min, table.max)");
            source.error_at("table.spacing", error.to_string(), help).into()
        }
    }
}

/// Tabulates the unit potentials of a case.
///
/// # Errors
/// The table asked for does not fit in memory.
pub fn table(
    case: &Case,
    source: &CaseSource,
    basis: &ElectrodeBasis,
    plan: &Plan,
    reporter: &dyn Reporter,
) -> Result<Tabulated, Failure> {
    reporter.stage("table");
    let start = Instant::now();
    let (table, report) = tabulate_around(basis, &plan.options, plan.halvings, &|done| reporter.fraction(done))
        .map_err(|error| too_large(case, source, error))?;
    let tabulated = Tabulated { table, report, seconds: start.elapsed().as_secs_f64(), kept: false };
    tabulated.warn_if_missed(case, reporter);
    Ok(tabulated)
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
