//! Values on a regular lattice.

use std::io::Write;

use super::appended::Document;
use super::array::check_all;
use super::{DataArray, VtkError};
use crate::Vec3;

/// A regular lattice of points along x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageGrid {
    /// Number of points along x, y and z; 1 makes it flat.
    pub points: [usize; 3],
    /// The first point, m.
    pub origin: Vec3,
    /// Distances of neighbouring points, m; positive.
    pub spacing: Vec3,
}

impl ImageGrid {
    /// Number of points, and number of cells between them: a flat direction counts as one layer of cells.
    ///
    /// # Errors
    /// No points, more than VTK counts, or an origin or spacing that is no place or distance.
    pub fn counts(&self) -> Result<(usize, usize), VtkError> {
        let mut counts = (1usize, 1usize);
        for (k, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            let n = self.points[k];
            let wrong = |key, value, expected| Err(VtkError::Lattice { key, axis, value, expected });
            // VTK's extents are signed 32-bit.
            if n == 0 || n > i32::MAX as usize {
                return wrong("number of points", n as f64, "between 1 and 2147483647");
            }
            if !self.origin[k].is_finite() {
                return wrong("origin", self.origin[k], "finite");
            }
            if !(self.spacing[k].is_finite() && self.spacing[k] > 0.0) {
                return wrong("spacing", self.spacing[k], "finite and positive");
            }
            let too_large = || VtkError::TooLarge { what: format!("the {:?} points of the lattice", self.points) };
            counts = (
                counts.0.checked_mul(n).ok_or_else(too_large)?,
                counts.1.checked_mul((n - 1).max(1)).ok_or_else(too_large)?,
            );
        }
        Ok(counts)
    }
}

/// Writes values on a lattice as ImageData (`.vti`), x running fastest, then y, then z.
///
/// Origin and spacing are written with as many digits as bring back the same f64.
///
/// # Errors
/// A bad lattice or name, a length that does not match or a value in memory that is not finite, before anything is
/// written; a computed value that is not finite, or an output that fails, in the middle of it.
pub fn write_image(
    out: &mut dyn Write,
    grid: &ImageGrid,
    point_arrays: &[DataArray],
    cell_arrays: &[DataArray],
) -> Result<(), VtkError> {
    let (points, cells) = grid.counts()?;
    check_all(point_arrays, points, "points")?;
    check_all(cell_arrays, cells, "cells")?;
    let [nx, ny, nz] = grid.points.map(|n| n - 1);
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    let triple = |v: Vec3| format!("{:?} {:?} {:?}", v.x, v.y, v.z);
    let mut document = Document::new(
        "ImageData",
        &format!(" WholeExtent=\"{extent}\" Origin=\"{}\" Spacing=\"{}\"", triple(grid.origin), triple(grid.spacing)),
        &format!(" Extent=\"{extent}\""),
    );
    document.data("PointData", point_arrays)?;
    document.data("CellData", cell_arrays)?;
    document.write(out)
}
