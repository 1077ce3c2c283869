//! Electrostatics of electrodes: what one volt on each of them does to the space between.
//!
//! * **basis**: one unit solution per electrode (that electrode at 1 V, the others at 0 V) and per closed-form source;
//! * **channel**: a combination of basis functions that share one time dependence;
//! * **driven field**: channels times their waveforms. Volts enter here and nowhere earlier.
//!
//! Charges are found in one of three ways, from the most special to the most general: on generating curves of coaxial bodies
//! ([`axial`]), on curved elements of the true surface ([`curved`]), or on flat panels, a [`BoundaryProblem`] that is solved by
//! a matrix, by symmetry, or with sums by multipoles ([`multipole`]). Each gives an [`ElectrodeBasis`]: charges for each
//! electrode at 1 V. The field of these charges is a [`PanelSum`] (exact, slow) or a [`TabulatedField`] (interpolated where that is good,
//! exact elsewhere); both are a [`BasisField`], and so is whatever else gives unit potentials at many points at once.
//!
//! # A sphere and a ring
//!
//! ```
//! use std::sync::Arc;
//!
//! use field::{BoundaryProblem, Channels, DrivenField, Samples, TableOptions, TabulatedField, Waveform, WaveformPart, tabulate};
//! use meshes::{Placement, Shape, SurfaceMesh, Vec3, triangulate};
//!
//! // 1. Two electrodes, as triangles.
//! let at = |z: f64| Placement { center: Vec3::z() * z, axis: Vec3::z(), up: None };
//! let sphere = triangulate(&Shape::Sphere { radius: 0.1 }, 0.5)?.placed(&at(0.0))?;
//! let ring = triangulate(&Shape::Ring { radius: 0.3, wire_radius: 0.02 }, 0.5)?.placed(&at(0.2))?;
//! let mesh = SurfaceMesh::assemble([("sphere".to_owned(), sphere), ("ring".to_owned(), ring)]);
//!
//! // 2. Charges for each of them at 1 V: the capacitance matrix is symmetric, and negative off its diagonal.
//! let basis = BoundaryProblem::new(&mesh).solve()?;
//! let c = &basis.capacitance.matrix;
//! assert!(c[0][0] > 0.0 && c[0][1] < 0.0 && c[0][1] == c[1][0]);
//!
//! // 3. Their potentials, tabulated; the error is measured against the exact sum.
//! let options = TableOptions {
//!     min: Vec3::repeat(-0.4),
//!     max: Vec3::repeat(0.4),
//!     accuracy: 1e-2,
//!     spacing: None,
//!     max_bytes: 1 << 28,
//!     smooth: false,
//! };
//! let (table, report) = tabulate(&basis, &options, &|_| ())?;
//! assert!(report.error() < 1e-2);
//!
//! // 4. Volts: a constant one on the sphere, 300 V at 60 Hz on the ring. Two patterns in time, so two channels.
//! let rf = WaveformPart::Sine { amplitude: 300.0, frequency: 60.0, phase: 0.0 };
//! let channels = Channels::new(&[Waveform::constant(-5.0), Waveform { constant: 0.0, parts: vec![rf] }]);
//! let tabulated = TabulatedField::combined(&basis, &table, &channels.weights);
//! let field = DrivenField::new(Arc::new(tabulated), channels.waveforms);
//!
//! // 5. Potential and field between them, at the start.
//! let (mut potential, mut gradient) = ([0.0], [Vec3::zeros()]);
//! let mut scratch = Samples::default();
//! field.evaluate(&[Vec3::new(0.2, 0.0, 0.1)], &[0.0], &mut scratch, &mut potential, &mut gradient);
//! assert!(potential[0] > -5.0 && potential[0] < 300.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod analysis;
pub mod axial;
pub mod basis_field;
pub mod boundary_problem;
pub mod capacitance;
pub mod channels;
pub mod coarse;
pub mod constants;
pub mod curved;
pub mod driven;
pub mod electrode_basis;
mod errors;
pub mod field_lines;
pub mod gather;
mod gauss;
pub mod grid_ripple;
pub mod grid_sheet;
pub mod harmonics;
pub mod induction;
pub mod influence;
mod iterative;
mod linear;
pub mod linear_operator;
pub mod multipole;
pub mod panel;
mod panel_groups;
pub mod panel_sum;
mod pieces;
mod plane;
pub mod quadratic;
mod reduced;
mod shown;
pub mod source;
mod symmetry;
pub mod table;
pub mod waveform;
pub mod zonal;

pub use basis_field::{BasisField, Samples};
pub use boundary_problem::{BoundaryProblem, By, SolveError, SolveReport};
pub use capacitance::{CapacitanceDefect, CapacitanceMatrix};
pub use channels::Channels;
pub use driven::DrivenField;
pub use electrode_basis::{ElectrodeBasis, SurfaceCharge};
pub use errors::Errors;
pub use field_lines::{FieldLines, field_lines};
pub use grid_ripple::{GridFrame, ripple_depths};
pub use grid_sheet::{GridSheet, grid_sheets};
pub use induction::Induction;
pub use linear_operator::LinearOperator;
pub use panel::Panel;
pub use panel_sum::PanelSum;
pub use plane::Plane;
pub use quadratic::{Quadratic, QuadraticField};
pub use source::{Source, SourceKind};
pub use table::{
    Brick, CELLS_PER_BRICK, Grid, Octree, PER_NODE, PotentialTable, SMOOTH, TableError, TableOptions, TableReport,
    TabulatedField, halvings_for, tabulate, tabulate_around,
};
pub use waveform::{Waveform, WaveformPart};
pub use zonal::{Zonal, zonal};
