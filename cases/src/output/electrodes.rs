//! The electrodes with their charges, for viewers.

use std::io::Write;

use field::ElectrodeBasis;
use meshes::SurfaceMesh;
use meshes::vtk::{DataArray, VtkError, write_surface};

use crate::case::Case;

/// Name of the file.
pub const FILE: &str = "electrodes.vtu";

/// Writes the mesh alone: the number of the electrode that each panel belongs to.
///
/// # Errors
/// The output fails.
pub fn write_mesh(out: &mut dyn Write, mesh: &SurfaceMesh) -> Result<(), VtkError> {
    write_surface(out, mesh, &[], &[DataArray::scalars("electrode", mesh.electrode.as_slice())])
}

/// Writes the solved surface: per panel the electrode's number (0 for the first of the case), the charge density at the given
/// voltages, C/m², and the charge density of each electrode at 1 V with the others grounded, C/m² per volt (of each source
/// at strength one, with all electrodes grounded).
///
/// `strengths` holds the voltage of each electrode and the strength of each source.
///
/// # Errors
/// The output fails.
pub fn write(out: &mut dyn Write, case: &Case, basis: &ElectrodeBasis, strengths: &[f64]) -> Result<(), VtkError> {
    let unit: Vec<Vec<f64>> = (0..basis.functions()).map(|k| basis.charge_density(k)).collect();
    let total: Vec<f64> = (0..basis.panels.len())
        .map(|panel| unit.iter().zip(strengths).map(|(density, strength)| strength * density[panel]).sum())
        .collect();
    let mut arrays = vec![
        DataArray::scalars("electrode", basis.mesh.electrode.as_slice()),
        DataArray::scalars("surface_charge_density", total),
    ];
    let names = case.electrodes.iter().map(|e| &e.name).chain(case.sources.iter().map(|s| &s.name));
    for (name, density) in names.zip(unit) {
        arrays.push(DataArray::scalars(format!("unit_charge_density {name}"), density));
    }
    write_surface(out, &basis.mesh, &[], &arrays)
}
