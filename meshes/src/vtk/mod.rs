//! Writing VTK files: the one place in the workspace that does.
//!
//! Everything here speaks of points, lines, cells and named arrays; what the numbers mean is the caller's business.
//!
//! * **point array**: one tuple of values per point; **cell array**: one per triangle, line or lattice cell;
//! * **polyline**: points joined in order, of which there must be at least one;
//! * **appended raw**: an XML header, then the numbers as they lie in memory, each array behind its length.
//!
//! | written by | file | encoding | read by |
//! |---|---|---|---|
//! | [`write_surface`] | `.vtu`, triangles | inline base64, zlib (vtkio) | ParaView, VTK, meshio |
//! | [`write_points`] | `.vtp`, vertices | inline base64 (vtkio) | ParaView, VTK |
//! | [`write_polylines`] | `.vtp`, polylines | appended raw | ParaView, VTK |
//! | [`write_line_cells`] | `.vtu`, lines of two points | appended raw | ParaView, VTK, meshio |
//! | [`write_image`] | `.vti` | appended raw | ParaView, VTK |
//! | [`write_collection`] | `.pvd` | text | ParaView |
//!
//! *Why two encodings.* vtkio holds a file three to four times in memory, encodes 0.1 GB/s, and knows neither appended
//! data nor an origin in f64. That is fine for surfaces and for one frame of an animation. Long tracks and large
//! lattices go through a writer of our own (`appended.rs`), which holds one block at a time.
//!
//! *Why errors for NaN.* A NaN in a file is silent until a colour bar turns grey. Arrays in memory are checked before
//! the first byte is written; computed ones while they stream, so that a failed write leaves part of a file behind:
//! write under a temporary name and rename when the writer has returned `Ok`.
//!
//! ```
//! use meshes::vtk::{DataArray, write_points};
//! use meshes::Vec3;
//!
//! let points = [Vec3::new(0.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1e-3)];
//! let mut file = Vec::new();
//! write_points(&mut file, &points, &[DataArray::scalars("speed", vec![1.5, 2.5])])?;
//! assert!(file.starts_with(b"<VTKFile type=\"PolyData\""));
//! # Ok::<(), meshes::vtk::VtkError>(())
//! ```

mod appended;
mod array;
mod collection;
mod error;
mod image;
mod inline;
mod polylines;
#[cfg(test)]
mod tests;

pub use array::{Computed, DataArray, PolylineArray, Values};
pub use collection::write_collection;
pub use error::VtkError;
pub use image::{ImageGrid, write_image};
pub use inline::{write_points, write_surface};
pub use polylines::{Polylines, write_line_cells, write_polylines};
