//! Solutions and tables that are kept beside a run's files, so that `trace` need not compute them again.
//!
//! A kept file opens with the digest of everything it depends on (version of the program included) and one of its content. A
//! file of another case, of another version, or damaged is passed over: the work is done again.

use std::fs;
use std::path::Path;

use field::{CapacitanceMatrix, ElectrodeBasis, Grid, PotentialTable, SolveReport, Source, TableReport};
use meshes::{ElectrodeSurface, SurfaceMesh, Vec3};
use serde::{Deserialize, Serialize};

use crate::case::Case;
use crate::output::OutputFolder;
use crate::pipeline::Failure;
use crate::pipeline::choice::Choice;
use crate::pipeline::solution::Solution;
use crate::pipeline::tables::Tabulated;

/// Name of the file within the output folder.
pub const FILE: &str = "cache/fields.bin";

/// Tables larger than this are made anew: reading them would take as long.
const LARGEST_TABLE: u64 = 256 << 20;

/// What stands at the beginning of a file; the number changes with the format.
const MAGIC: &[u8] = b"graintrap fields 2\n";

/// Everything that a solution and a table depend on.
pub fn key(case: &Case) -> [u8; 32] {
    let parts = case.parts();
    let mut hasher = blake3::Hasher::new();
    for part in [env!("CARGO_PKG_VERSION"), &parts.geometry, &parts.table, &parts.starts] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    *hasher.finalize().as_bytes()
}

/// A solution and, if it was made, the table of it.
pub type Fields = (Solution, Option<Tabulated>);

/// Writes a solution and its table.
///
/// # Errors
/// The output fails.
pub fn write(
    out: &mut OutputFolder,
    case: &Case,
    solution: &Solution,
    table: Option<&Tabulated>,
) -> Result<(), Failure> {
    let stored = Stored::new(solution, table.filter(|t| t.report.bytes <= LARGEST_TABLE));
    let content = postcard::to_stdvec(&stored).map_err(|error| {
        Failure::run(format!("the solution cannot be kept: {error}"), "this is a fault of graintrap")
    })?;
    out.write_unlisted(FILE, |w| {
        w.write_all(MAGIC)?;
        w.write_all(&key(case))?;
        w.write_all(blake3::hash(&content).as_bytes())?;
        w.write_all(&content)
    })
}

/// The kept solution of a case, if there is one that is whole; otherwise why not.
///
/// # Errors
/// Words for people.
pub fn read(folder: &Path, case: &Case, sources: &[Source]) -> Result<Fields, &'static str> {
    let bytes = fs::read(folder.join(FILE)).map_err(|_| "nothing is kept from an earlier run")?;
    let rest = bytes.strip_prefix(MAGIC).ok_or("what is kept was written by another version")?;
    let (of, rest) = rest.split_at_checked(32).ok_or("what is kept is damaged")?;
    if of != key(case) {
        return Err("what is kept is of another geometry");
    }
    let (digest, content) = rest.split_at_checked(32).ok_or("what is kept is damaged")?;
    if digest != blake3::hash(content).as_bytes() {
        return Err("what is kept is damaged");
    }
    let stored: Stored = postcard::from_bytes(content).map_err(|_| "what is kept is damaged")?;
    Ok(stored.restored(sources))
}

#[derive(Serialize, Deserialize)]
struct Stored {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    electrode: Vec<u32>,
    electrodes: Vec<(String, bool, bool)>,
    /// Charges, basis function after basis function.
    charges: Vec<f64>,
    capacitance: Vec<Vec<f64>>,
    asymmetry: f64,
    induced: Vec<Vec<f64>>,
    unknowns: usize,
    residual: f64,
    matrix_bytes: u64,
    choice: Choice,
    error_estimate: f64,
    estimated_by: String,
    table: Option<StoredTable>,
}

#[derive(Serialize, Deserialize)]
struct StoredTable {
    min: Vec3,
    max: Vec3,
    cells: [usize; 3],
    channels: usize,
    nodes: Vec<f64>,
    tabulated: Vec<bool>,
    spacing: f64,
    tabulated_fraction: f64,
    layer: f64,
    potential_error: f64,
    field_error: f64,
    laplacian: f64,
    error_points: usize,
}

impl Stored {
    fn new(solution: &Solution, table: Option<&Tabulated>) -> Self {
        let (basis, mesh) = (&solution.basis, &solution.basis.mesh);
        Self {
            vertices: mesh.vertices.clone(),
            triangles: mesh.triangles.clone(),
            electrode: mesh.electrode.clone(),
            electrodes: mesh.electrodes.iter().map(|e| (e.name.clone(), e.closed, e.hollow)).collect(),
            charges: basis.charges(),
            capacitance: basis.capacitance.matrix.clone(),
            asymmetry: basis.capacitance.asymmetry,
            induced: basis.induced.clone(),
            unknowns: basis.report.unknowns,
            residual: basis.report.residual,
            matrix_bytes: basis.report.matrix_bytes,
            choice: solution.choice.clone(),
            error_estimate: solution.error_estimate,
            estimated_by: solution.estimated_by.clone(),
            table: table.map(|t| StoredTable {
                min: t.table.grid.min,
                max: t.table.grid.max,
                cells: t.table.grid.cells,
                channels: t.table.channels,
                nodes: t.table.nodes.clone(),
                tabulated: t.table.tabulated.clone(),
                spacing: t.report.spacing,
                tabulated_fraction: t.report.tabulated_fraction,
                layer: t.report.layer,
                potential_error: t.report.potential_error,
                field_error: t.report.field_error,
                laplacian: t.report.laplacian,
                error_points: t.report.error_points,
            }),
        }
    }

    fn restored(self, sources: &[Source]) -> Fields {
        let electrodes = self
            .electrodes
            .into_iter()
            .map(|(name, closed, hollow)| ElectrodeSurface { name, closed, hollow })
            .collect();
        let mesh =
            SurfaceMesh { vertices: self.vertices, triangles: self.triangles, electrode: self.electrode, electrodes };
        let report = SolveReport {
            unknowns: self.unknowns,
            assembly_seconds: 0.0,
            solve_seconds: 0.0,
            residual: self.residual,
            matrix_bytes: self.matrix_bytes,
        };
        let capacitance = CapacitanceMatrix { matrix: self.capacitance, asymmetry: self.asymmetry };
        let basis =
            ElectrodeBasis::from_charges(mesh, sources.to_vec(), &self.charges, capacitance, self.induced, report);
        let solution = Solution {
            basis,
            choice: self.choice,
            error_estimate: self.error_estimate,
            estimated_by: self.estimated_by,
            mesh_seconds: 0.0,
            solve_seconds: 0.0,
        };
        let table = self.table.map(|t| {
            let grid = Grid { min: t.min, max: t.max, cells: t.cells };
            let table = PotentialTable { grid, channels: t.channels, nodes: t.nodes, tabulated: t.tabulated };
            let report = TableReport {
                nodes: grid.nodes(),
                bytes: table.bytes(),
                spacing: t.spacing,
                tabulated_fraction: t.tabulated_fraction,
                layer: t.layer,
                potential_error: t.potential_error,
                field_error: t.field_error,
                laplacian: t.laplacian,
                error_points: t.error_points,
            };
            Tabulated { table, report, seconds: 0.0 }
        });
        (solution, table)
    }
}
