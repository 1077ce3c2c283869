//! Electrostatics of electrodes: what one volt on each of them does to the space between.
//!
//! * **basis**: one unit solution per electrode (that electrode at 1 V, the others at 0 V) and per closed-form source;
//! * **channel**: a combination of basis functions that share one time dependence;
//! * **driven field**: channels times their waveforms. Volts enter here and nowhere earlier.

pub mod basis_field;
pub mod constants;
pub mod driven;
pub mod influence;
pub mod panel;
pub mod source;
pub mod waveform;

pub use basis_field::{BasisField, Samples};
pub use driven::DrivenField;
pub use waveform::{Waveform, WaveformPart};
