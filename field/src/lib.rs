//! Electrostatics of electrodes: what one volt on each of them does to the space between.
//!
//! * **basis**: one unit solution per electrode (that electrode at 1 V, the others at 0 V) and per closed-form source;
//! * **channel**: a combination of basis functions that share one time dependence;
//! * **driven field**: channels times their waveforms. Volts enter here and nowhere earlier.

pub mod basis_field;
pub mod boundary_problem;
pub mod capacitance;
pub mod channels;
pub mod coarse;
pub mod constants;
pub mod driven;
pub mod electrode_basis;
pub mod gather;
pub mod harmonics;
pub mod influence;
pub mod linear_operator;
pub mod panel;
mod panel_groups;
pub mod panel_sum;
pub mod source;
pub mod table;
pub mod waveform;

pub use basis_field::{BasisField, Samples};
pub use boundary_problem::{BoundaryProblem, SolveError, SolveReport};
pub use capacitance::{CapacitanceDefect, CapacitanceMatrix};
pub use channels::Channels;
pub use driven::DrivenField;
pub use electrode_basis::ElectrodeBasis;
pub use linear_operator::LinearOperator;
pub use panel::Panel;
pub use panel_sum::PanelSum;
pub use source::{Source, SourceKind};
pub use table::{Grid, PotentialTable, TableError, TableOptions, TableReport, TabulatedField, tabulate};
pub use waveform::{Waveform, WaveformPart};
