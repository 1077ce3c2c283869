//! What a run says about itself: `summary.json`, and the same for people.

use std::fmt::Write as _;

use meshes::{MeshReport, SurfaceMesh};
use serde::Serialize;
use tracer::{Ensemble, Outcome, Region};

use crate::CaseSource;
use crate::case::{Case, Drive, GROUND};
use crate::pipeline::analysis::trap::Trap;
use crate::pipeline::flights::Flights;
use crate::pipeline::memory::people;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;

/// Final states are listed for up to so many grains.
const LISTED: usize = 1000;

/// What a command did: the object that `--json` prints and that `summary.json` holds. SI throughout.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Version of the program.
    pub version: &'static str,
    /// What was done: `run`, `solve`, ...
    pub command: &'static str,
    /// Title of the case.
    pub title: String,
    /// The case itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub case: Option<CaseText>,
    /// The mesh and what was solved on it.
    #[serde(flatten)]
    pub solve: Option<SolveSummary>,
    /// The table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<TableSummary>,
    /// The flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<TraceSummary>,
    /// The trap that each group of grains is in, where that is known for little.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub traps: Vec<Trap>,
    /// Time that each stage took.
    pub seconds: Seconds,
    /// Most memory that was used, bytes; 0 where the system does not tell.
    pub peak_memory_bytes: u64,
    /// Threads that worked.
    pub threads: usize,
    /// Stages that were not computed but taken from an earlier run.
    pub reused: Vec<&'static str>,
    /// What a person should know.
    pub warnings: Vec<String>,
    /// Files that were written, relative to the folder; the frames of the animation are counted in one entry of `grains.pvd`.
    pub files: Vec<String>,
}

/// A case as it was read, so that results say what they are of.
#[derive(Clone, Debug, Serialize)]
pub struct CaseText {
    /// The case file, as it was named.
    pub file: String,
    /// What `--set` changed, as `key=value`.
    pub set: Vec<String>,
    /// The text of the file.
    pub text: String,
}

impl CaseText {
    /// Of a case that was read.
    pub fn new(source: &CaseSource) -> Self {
        let file = source.path.display().to_string();
        Self { file, set: source.sets.clone(), text: source.text.clone() }
    }
}

/// The solved surface.
#[derive(Clone, Debug, Serialize)]
pub struct SolveSummary {
    /// Names, in the order of the case.
    pub electrodes: Vec<String>,
    /// Maxwell's form: charge on i with k at 1 V and the others at 0 V, F.
    pub capacitance_matrix_farad: Vec<Vec<f64>>,
    /// Largest difference of two entries that should be equal, before they were made so, against the largest entry.
    pub capacitance_asymmetry: f64,
    /// Triangles.
    pub panels: usize,
    /// Unknowns of the linear system.
    pub unknowns: usize,
    /// What solved it: `dense`, `symmetric`, `axisymmetric`, `multipole`, or `none` where there are no electrodes.
    pub solver: &'static str,
    /// `solved` now, or `kept` from an earlier command.
    pub solution: &'static str,
    /// Why that solver, in a sentence.
    pub solver_reason: String,
    /// What the charges sit on: `galerkin`, `collocation` or `curved`.
    pub elements: &'static str,
    /// Estimated relative error of the capacitances, against the largest.
    pub error_estimate: f64,
    /// Estimated relative error of the unit fields in the trap region, against the strongest there of each.
    pub field_error_estimate: f64,
    /// What the estimate is from.
    pub error_estimated_by: String,
    /// Largest error of the potential on the rows looked at, V per V.
    pub residual: f64,
    /// Voltage of each electrode at the start, V, floating ones included.
    pub voltages_at_start: Vec<f64>,
    /// Charge of each electrode at the start, C.
    pub charges_at_start: Vec<f64>,
}

/// The table.
#[derive(Clone, Debug, Serialize)]
pub struct TableSummary {
    /// Nodes.
    pub nodes: usize,
    /// Bytes in memory.
    pub bytes: u64,
    /// Edge of the largest cells, m.
    pub spacing: f64,
    /// Edge of the smallest cells, m.
    pub finest_spacing: f64,
    /// Lower corner, m.
    pub min: [f64; 3],
    /// Upper corner, m.
    pub max: [f64; 3],
    /// Measured relative error against the exact sum: the larger of the next two.
    pub error_estimate: f64,
    /// Of the potential, V per V.
    pub potential_error: f64,
    /// Of the field, against the strongest field that was met.
    pub field_error: f64,
    /// Largest |Laplacian| of what is interpolated times the edge of a cell, against the strongest field: zero for an exact
    /// potential.
    pub laplacian: f64,
    /// Largest jump of the potential between cells, V per V.
    pub jump: f64,
    /// Nearer than so many cells to a conductor the exact sum is used.
    pub exact_within_cells: f64,
    /// Fraction of the space outside of conductors that is interpolated.
    pub interpolated_fraction: f64,
}

/// The flights.
#[derive(Clone, Debug, Serialize)]
pub struct TraceSummary {
    /// Number of grains.
    pub grains: usize,
    /// Steps of single grains.
    pub steps: u64,
    /// Steps that were tried and rejected.
    pub rejected_steps: u64,
    /// Name of the integrator.
    pub integrator: &'static str,
    /// How many ended how.
    pub outcomes: Outcomes,
    /// Estimated error of the final positions, m, from a tighter second run of some grains.
    pub position_error_estimate: Option<f64>,
    /// Final states, in the order of the grains.
    #[serde(rename = "final", skip_serializing_if = "Option::is_none")]
    pub finals: Option<Vec<Final>>,
    /// Time between samples, s.
    pub every: f64,
    /// One sample in so many was written.
    pub stride: usize,
    /// Lower corner of the region in which grains were followed, m.
    pub region_min: [f64; 3],
    /// Its upper corner, m.
    pub region_max: [f64; 3],
    /// How strongly those that still flew at the end were coupled, if they were two or more and charged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plasma: Option<PlasmaSummary>,
}

/// A cloud of charges in the last tenth of its flight: [`tracer::plasma::Cloud`] as an object.
#[derive(Clone, Debug, Serialize)]
pub struct PlasmaSummary {
    /// Grains in it.
    pub grains: usize,
    /// Kinetic temperature of the secular motion, K.
    pub temperature_kelvin: f64,
    /// m.
    pub wigner_seitz_radius: f64,
    /// Mean distance of nearest neighbours, m.
    pub nearest_neighbour: f64,
    /// Coupling with the Wigner-Seitz radius; `null` at rest.
    pub gamma_wigner_seitz: f64,
    /// Coupling with the distance of neighbours; `null` at rest.
    pub gamma_nearest_neighbour: f64,
    /// Middles of the bins of the radial distribution, m.
    pub radial_distances: Vec<f64>,
    /// Pairs in each over those of a uniform ball.
    pub radial_distribution: Vec<f64>,
}

impl PlasmaSummary {
    /// Of flights, if they are many enough.
    pub fn new(flights: &Flights) -> Option<Self> {
        let (ensemble, endings) = (&flights.traced.ensemble, &flights.traced.endings);
        let flying = (0..endings.len()).filter(|&g| matches!(endings[g].outcome, Outcome::TimeUp | Outcome::Stopped));
        let tracks: Vec<_> =
            flying.map(|g| (&flights.samples[g][..], ensemble.charges()[g], ensemble.masses()[g])).collect();
        tracer::plasma::cloud(&tracks, flights.period).map(|cloud| Self {
            grains: cloud.grains,
            temperature_kelvin: cloud.temperature,
            wigner_seitz_radius: cloud.wigner_seitz_radius,
            nearest_neighbour: cloud.nearest_neighbour,
            gamma_wigner_seitz: cloud.gamma,
            gamma_nearest_neighbour: cloud.gamma_of_neighbours,
            radial_distances: cloud.distances,
            radial_distribution: cloud.distribution,
        })
    }
}

/// How many flights ended how.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outcomes {
    /// Still flying at the end.
    pub time_up: usize,
    /// Struck an electrode: name and number.
    pub struck: serde_json::Map<String, serde_json::Value>,
    /// Left the region.
    pub left_region: usize,
    /// Given up: forces or motion were no longer finite.
    pub unstable: usize,
}

/// The end of a flight.
#[derive(Clone, Debug, Serialize)]
pub struct Final {
    /// m.
    pub position: [f64; 3],
    /// m/s.
    pub velocity: [f64; 3],
    /// `time_up`, `struck`, `left_region` or `unstable`.
    pub outcome: &'static str,
    /// s.
    pub time: f64,
    /// The electrode that was struck.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub electrode: Option<String>,
    /// Kinetic energy with which it was struck, J.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<f64>,
}

/// Wall-clock time of each stage, s.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// Meshing.
    pub mesh: f64,
    /// Filling and solving linear systems, error estimate included.
    pub solve: f64,
    /// Tabulating.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<f64>,
    /// Tracing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<f64>,
    /// Sampling for viewers and writing files.
    pub write: f64,
}

impl SolveSummary {
    /// Of a solution, at the voltages of the start.
    pub fn new(case: &Case, solution: &Solution, strengths: &[f64]) -> Self {
        let (basis, electrodes) = (&solution.basis, case.electrodes.len());
        let matrix = &basis.capacitance.matrix;
        let charge = |e: usize| -> f64 {
            let own: f64 = matrix[e].iter().zip(strengths).map(|(c, v)| c * v).sum();
            let induced: f64 = basis.induced[e].iter().zip(&strengths[electrodes..]).map(|(q, s)| q * s).sum();
            own + induced
        };
        Self {
            electrodes: case.electrodes.iter().map(|e| e.name.clone()).collect(),
            capacitance_matrix_farad: matrix.clone(),
            capacitance_asymmetry: basis.capacitance.asymmetry,
            panels: basis.panels.len(),
            unknowns: basis.report.unknowns,
            solver: if electrodes == 0 { "none" } else { solution.choice.solver.name() },
            solution: if solution.kept { "kept" } else { "solved" },
            solver_reason: solution.choice.why.clone(),
            elements: solution.choice.elements.name(),
            error_estimate: solution.errors.capacitance,
            field_error_estimate: solution.errors.field,
            error_estimated_by: solution.estimated_by.clone(),
            residual: basis.report.residual,
            voltages_at_start: strengths[..electrodes].to_vec(),
            charges_at_start: (0..electrodes).map(charge).collect(),
        }
    }
}

impl TableSummary {
    /// Of a table.
    pub fn new(tabulated: &Tabulated) -> Self {
        let (grid, report) = (tabulated.table.grid(), &tabulated.report);
        Self {
            nodes: report.nodes,
            bytes: report.bytes,
            spacing: report.spacing,
            finest_spacing: report.finest_spacing,
            min: grid.min.into(),
            max: grid.max.into(),
            error_estimate: report.error(),
            potential_error: report.potential_error,
            field_error: report.field_error,
            laplacian: report.laplacian,
            jump: report.jump,
            exact_within_cells: report.layer,
            interpolated_fraction: report.tabulated_fraction,
        }
    }
}

impl TraceSummary {
    /// Of a case without grains.
    pub fn none(region: &Region) -> Self {
        Self {
            grains: 0,
            steps: 0,
            rejected_steps: 0,
            integrator: "none",
            outcomes: Outcomes::default(),
            position_error_estimate: None,
            finals: Some(Vec::new()),
            every: 0.0,
            stride: 1,
            region_min: region.min.into(),
            region_max: region.max.into(),
            plasma: None,
        }
    }

    /// Of flights.
    pub fn new(case: &Case, flights: &Flights) -> Self {
        let traced = &flights.traced;
        // After the electrodes comes the grounded plane.
        let name = |e: usize| case.electrodes.get(e).map_or(GROUND, |electrode| &electrode.name).to_owned();
        let mut outcomes = Outcomes::default();
        let mut struck = vec![0_u64; case.electrodes.len() + 1];
        for ending in &traced.endings {
            match ending.outcome {
                Outcome::TimeUp | Outcome::Stopped => outcomes.time_up += 1,
                Outcome::Struck { electrode, .. } => struck[electrode] += 1,
                Outcome::LeftRegion { .. } => outcomes.left_region += 1,
                Outcome::Unstable { .. } => outcomes.unstable += 1,
            }
        }
        outcomes.struck =
            struck.iter().enumerate().filter(|(_, n)| **n > 0).map(|(e, n)| (name(e), (*n).into())).collect();
        let finals = traced.endings.iter().enumerate().map(|(grain, ending)| {
            let (outcome, electrode, energy) = match ending.outcome {
                Outcome::TimeUp | Outcome::Stopped => ("time_up", None, None),
                Outcome::Struck { electrode, energy, .. } => ("struck", Some(name(electrode)), Some(energy)),
                Outcome::LeftRegion { .. } => ("left_region", None, None),
                Outcome::Unstable { .. } => ("unstable", None, None),
            };
            Final {
                position: traced.ensemble.positions()[grain].into(),
                velocity: traced.ensemble.velocities()[grain].into(),
                outcome,
                time: ending.time,
                electrode,
                energy,
            }
        });
        Self {
            grains: traced.endings.len(),
            steps: traced.accepted,
            rejected_steps: traced.rejected,
            integrator: traced.method.name(),
            outcomes,
            position_error_estimate: traced.error.as_ref().map(|e| e.position),
            finals: (traced.endings.len() <= LISTED).then(|| finals.collect()),
            every: flights.every,
            stride: flights.stride,
            region_min: flights.region.min.into(),
            region_max: flights.region.max.into(),
            plasma: PlasmaSummary::new(flights),
        }
    }
}

/// The errors of a solution, in words.
fn about(solve: &SolveSummary) -> String {
    let (capacitance, field) = (solve.error_estimate, solve.field_error_estimate);
    format!("errors about {field:.0e} in the field, {capacitance:.0e} in the capacitances")
}

/// Capacitances are shown for up to so many electrodes; the rest is in the file.
const SHOWN: usize = 8;

impl Summary {
    /// The summary for people.
    pub fn text(&self, case: &Case, folder: &std::path::Path) -> String {
        let mut text = String::new();
        let mut line = |key: &str, value: String| {
            let _ = writeln!(text, "{key:<12} {value}");
        };
        if !self.title.is_empty() {
            line("case", self.title.clone());
        }
        if let Some(solve) = self.solve.as_ref().filter(|s| s.panels > 0) {
            let names = solve.electrodes.join(", ");
            line("electrodes", format!("{names}: {} panels, {}", solve.panels, about(solve)));
            line("solver", format!("{}, {}: {}", solve.solver, solve.elements, solve.solver_reason));
            for (number, row) in capacitances(case, solve).into_iter().enumerate() {
                line(if number == 0 { "capacitance" } else { "" }, row);
            }
        }
        if let Some(table) = &self.table {
            line(
                "table",
                format!(
                    "{} nodes, {}, {}, measured error {:.0e}",
                    table.nodes,
                    if table.finest_spacing < 0.9 * table.spacing {
                        format!("cells of {} to {}", metres(table.finest_spacing), metres(table.spacing))
                    } else {
                        format!("cells of {}", metres(table.spacing))
                    },
                    people(table.bytes),
                    table.error_estimate
                ),
            );
        }
        if let Some(trace) = self.trace.as_ref().filter(|trace| trace.grains > 0) {
            let o = &trace.outcomes;
            let mut parts = Vec::new();
            if o.time_up > 0 {
                parts.push(format!("{} still flying at the end", o.time_up));
            }
            parts.extend(o.struck.iter().map(|(name, n)| format!("{n} struck {name}")));
            if o.left_region > 0 {
                parts.push(format!("{} left the region", o.left_region));
            }
            if o.unstable > 0 {
                parts.push(format!("{} unstable", o.unstable));
            }
            line("grains", format!("{}: {}", trace.grains, parts.join(", ")));
            let error = match trace.position_error_estimate {
                Some(error) => format!(", positions within {}", metres(error)),
                None => String::new(),
            };
            line("", format!("{} steps of {}{error}", trace.steps, trace.integrator));
            if trace.grains <= 5 {
                for (grain, end) in trace.finals.iter().flatten().enumerate() {
                    line("", format!("grain {grain}: {}", ending(end)));
                }
            }
            if let Some(p) = &trace.plasma {
                line(
                    "coupling",
                    format!(
                        "Gamma {:.3e} (Wigner-Seitz radius {}), {:.3e} (neighbours {} apart), secular motion at {:.3e} K",
                        p.gamma_wigner_seitz,
                        metres(p.wigner_seitz_radius),
                        p.gamma_nearest_neighbour,
                        metres(p.nearest_neighbour),
                        p.temperature_kelvin
                    ),
                );
            }
        }
        for trap in &self.traps {
            trap_lines(trap).into_iter().for_each(|(key, words)| line(key, words));
        }
        let s = &self.seconds;
        let mut parts = vec![format!("mesh {:.2} s, solve {:.2} s", s.mesh, s.solve)];
        parts.extend(s.table.map(|t| format!("table {t:.2} s")));
        parts.extend(s.trace.map(|t| format!("trace {t:.2} s")));
        parts.push(format!("write {:.2} s", s.write));
        let threads = if self.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", self.threads) };
        let memory =
            if self.peak_memory_bytes > 0 { format!(", {}", people(self.peak_memory_bytes)) } else { String::new() };
        let reused =
            if self.reused.is_empty() { String::new() } else { format!("; reused: {}", self.reused.join(", ")) };
        line("time", format!("{} ({threads}{memory}{reused})", parts.join(", ")));
        if !self.files.is_empty() {
            line("files", format!("{}: {}", folder.display(), self.files.join(", ")));
        }
        text
    }
}

/// A trap in lines for people.
fn trap_lines(trap: &Trap) -> Vec<(&'static str, String)> {
    let list = |numbers: &[f64]| numbers.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", ");
    // Rounding of a centre is no place.
    let [x, y, z] = trap.center.map(|x| metres(if x.abs() < 1e-12 { 0.0 } else { x }));
    let mut lines = vec![("trap", format!("grains {}: {} at ({x}, {y}, {z})", trap.grains, trap.kind))];
    if let Some(m) = &trap.mathieu {
        lines.push(("", format!("a {}; q {}; each within {:.0e}", list(&m.a), list(&m.q), m.error_estimate)));
    }
    let swings: Vec<String> = trap.secular_hz.iter().map(|f| format!("{f:.5}")).collect();
    let held = if trap.held { "held" } else { "not held in all directions" };
    lines.push(("", format!("{held}; secular frequencies {} Hz within {:.0e}", swings.join(", "), trap.secular_error)));
    lines
}

fn ending(end: &Final) -> String {
    let [x, y, z] = end.position;
    let place = format!("({x:.4e}, {y:.4e}, {z:.4e}) m");
    match (&end.electrode, end.outcome) {
        (Some(name), _) => format!("struck {name} at {place} after {:.4e} s", end.time),
        (None, "time_up") => format!("at {place}"),
        (None, "left_region") => format!("left the region at {place} after {:.4e} s", end.time),
        (None, other) => format!("{other} at {place} after {:.4e} s", end.time),
    }
}

/// The capacitance matrix as lines of a table.
fn capacitances(case: &Case, solve: &SolveSummary) -> Vec<String> {
    let n = solve.electrodes.len();
    if n > SHOWN {
        return vec![format!("{n} x {n}, in summary.json")];
    }
    let width = solve.electrodes.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    let column = width.max(11);
    let head: String = solve.electrodes.iter().map(|name| format!(" {name:>column$}")).collect();
    let mut lines = vec![format!("{:width$}{head}  (pF)", "")];
    for (electrode, row) in solve.capacitance_matrix_farad.iter().enumerate() {
        let entries: String = row.iter().map(|c| format!(" {:>column$.6}", c * 1e12)).collect();
        let mut text = format!("{:width$}{entries}", solve.electrodes[electrode]);
        if matches!(case.electrodes[electrode].drive, Drive::Charge(_)) {
            let _ = write!(text, "  floats at {:.6} V", solve.voltages_at_start[electrode]);
        }
        lines.push(text);
    }
    lines
}

/// A length for people.
pub fn metres(length: f64) -> String {
    // A tenth of a millimetre to rounding is one.
    let (factor, unit) = match length.abs() * (1.0 + 1e-9) {
        l if l == 0.0 || l >= 0.1 => (1.0, "m"),
        l if l >= 1e-4 => (1e-3, "mm"),
        l if l >= 1e-7 => (1e-6, "um"),
        l if l >= 1e-10 => (1e-9, "nm"),
        _ => return format!("{length:.1e} m"),
    };
    format!("{:.3} {unit}", length / factor)
}

/// What `mesh` says of a mesh.
#[derive(Clone, Debug, Serialize)]
pub struct MeshSummary {
    /// Triangles in all.
    pub panels: usize,
    /// Worst longest side over height.
    pub worst_aspect: f64,
    /// One entry for each electrode.
    pub electrodes: Vec<ElectrodeMesh>,
}

/// What `mesh` says of one electrode: [`meshes::ElectrodeReport`] as an object, since `meshes` writes no JSON.
#[derive(Clone, Debug, Serialize)]
pub struct ElectrodeMesh {
    /// Name.
    pub name: String,
    /// Triangles.
    pub panels: usize,
    /// m².
    pub area: f64,
    /// m³, of a closed surface.
    pub volume: Option<f64>,
    /// Worst longest side over height.
    pub worst_aspect: f64,
    /// Smallest and largest square root of a panel's area, m.
    pub panel_size: [f64; 2],
    /// Edges that belong to one panel only.
    pub open_edges: usize,
    /// Edges that more than two panels share, or along which normals flip.
    pub bad_edges: usize,
    /// Normals point outwards; `null` for an open surface.
    pub outward: Option<bool>,
    /// Encloses other electrodes or grains, so that its inside is field and not metal.
    pub hollow: bool,
    /// Nearest other electrode.
    pub nearest: Option<String>,
    /// Distance to it, m.
    pub distance: Option<f64>,
}

impl MeshSummary {
    /// Of a report on a mesh.
    pub fn new(report: &MeshReport, mesh: &SurfaceMesh) -> Self {
        let electrodes = report.electrodes.iter().zip(&mesh.electrodes).map(|(e, surface)| ElectrodeMesh {
            name: e.name.clone(),
            panels: e.panels,
            area: e.area,
            volume: e.volume,
            worst_aspect: e.worst_aspect,
            panel_size: e.panel_size,
            open_edges: e.open_edges,
            bad_edges: e.bad_edges,
            outward: e.outward,
            hollow: surface.hollow,
            nearest: e.nearest.as_ref().map(|(_, name)| name.clone()),
            distance: e.nearest.as_ref().map(|(distance, _)| *distance),
        });
        Self { panels: report.panels, worst_aspect: report.worst_aspect, electrodes: electrodes.collect() }
    }
}

/// What `check` says of the grains of a case.
pub fn grains_text(case: &Case, ensemble: &Ensemble) -> String {
    let groups: Vec<String> = case.grains.iter().map(|g| format!("{} {}", g.count, g.name)).collect();
    match ensemble.len() {
        0 => "none".to_owned(),
        n => format!("{n} ({})", groups.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_for_people() {
        assert_eq!([metres(0.25), metres(0.012), metres(3e-6)], ["0.250 m", "12.000 mm", "3.000 um"]);
        assert_eq!([metres(0.0), metres(2e-15)], ["0.000 m", "2.0e-15 m"]);
    }
}
