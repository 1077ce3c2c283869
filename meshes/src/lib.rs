//! Electrode shapes as triangulated surfaces.
//!
//! A [`Shape`] with a [`Placement`] becomes triangles with outward normals, graded towards edges where charge crowds;
//! several of them become one [`SurfaceMesh`], the only thing the field solver sees. Surfaces drawn elsewhere come in
//! through [`import`]. This crate knows no volts.
//!
//! * **panel**: one triangle, counter-clockwise seen from outside (from the side its normal points to);
//! * **electrode**: a named set of panels at one potential;
//! * **sheet**: a surface of zero thickness, with free edges;
//! * **closed**: without free edges, so that it has an inside.

pub mod import;
pub mod lattice;
pub mod report;
pub mod shape;
pub mod surface;
pub mod surface_tree;
pub mod triangle;
pub mod triangulate;
pub mod vtk;

pub use report::{ElectrodeReport, MeshReport};
pub use shape::{GridPattern, Hole, Outline, Placement, Shape, ShapeError, Weave};
pub use surface::{ElectrodeSurface, SurfaceMesh};
pub use surface_tree::{Hit, Nearest, SurfaceTree};
pub use triangulate::{Triangulation, triangulate, triangulate_to};

/// A point or a vector in space, in metres unless said otherwise.
pub type Vec3 = nalgebra::Vector3<f64>;
