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
//!
//! ```
//! use meshes::{MeshReport, Placement, Shape, SurfaceMesh, Vec3, triangulate};
//!
//! // A hemisphere over a plate, each with the number of panels that shapes have at fineness 1.
//! let cap = triangulate(&Shape::EndCap { radius: 0.1, opening: 90_f64.to_radians(), thickness: 0.0 }, 1.0)?;
//! let plate = triangulate(&Shape::Plate { size: [0.3, 0.3], thickness: 0.0 }, 1.0)?;
//! let at = |z: f64| Placement { center: Vec3::z() * z, axis: Vec3::z(), up: None };
//! let mesh = SurfaceMesh::assemble([
//!     ("cap".to_owned(), cap.placed(&at(0.05))?),
//!     ("plate".to_owned(), plate.placed(&at(0.0))?),
//! ]);
//!
//! // The true area, whatever the number of panels; free edges, since both are sheets; how far they are apart.
//! let report = MeshReport::new(&mesh);
//! let area = 2.0 * std::f64::consts::PI * 0.1 * 0.1;
//! assert!((report.electrodes[0].area / area - 1.0).abs() < 1e-9);
//! assert!(report.electrodes[1].open_edges > 0);
//! println!("{report}");
//!
//! // For viewers.
//! let mut file = Vec::new();
//! meshes::vtk::write_surface(&mut file, &mesh, &[], &[])?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod grid_optics;
pub mod import;
pub mod lattice;
pub mod patch;
pub mod profile;
pub mod report;
pub mod shape;
pub mod surface;
pub mod surface_tree;
pub mod triangle;
pub mod triangulate;
pub mod vtk;

pub use grid_optics::{GridPatch, Incidence, half_thickness, open_fraction, unit_cell};
pub use patch::{Column, Patch, PatchForm, Path, Side, patches};
pub use profile::{Curve, Joint, Profile, Revolved, revolved};
pub use report::{ElectrodeReport, MeshReport};
pub use shape::{GridPattern, Hole, Outline, Placement, Shape, ShapeError, Weave};
pub use surface::{ElectrodeSurface, SurfaceMesh};
pub use surface_tree::{Hit, Nearest, SurfaceTree};
pub use triangulate::{Triangulation, triangulate, triangulate_to};

/// A point or a vector in space, in metres unless said otherwise.
pub type Vec3 = nalgebra::Vector3<f64>;
