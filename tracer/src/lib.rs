//! Grains in flight: ensembles, forces, integrators, how a flight ends, what is kept of it.

pub mod cloud;
pub mod constants;
pub mod drag;
pub mod gas;
pub mod grains;
pub mod stream;

pub use cloud::{CloudError, Group, Launch, Place, grain_id};
pub use drag::{Drag, DragError, DragLaw};
pub use gas::{Gas, GasKind};
pub use grains::{Ensemble, Grain, GrainError};
