//! Grains in flight: ensembles, forces, integrators, how a flight ends, what is kept of it.

pub mod cloud;
pub mod constants;
pub mod drag;
pub mod force;
pub mod gas;
pub mod grains;
pub mod observer;
pub mod outcome;
pub mod stream;

pub use cloud::{CloudError, Group, Launch, Place, grain_id};
pub use drag::{Drag, DragError, DragLaw};
pub use force::coulomb::Coulomb;
pub use force::electric::Electric;
pub use force::uniform::{ConstantForce, Gravity};
pub use force::{Batch, Force, Nature, Scratch};
pub use gas::{Gas, GasKind};
pub use grains::{Ensemble, Grain, GrainError};
pub use observer::{Nothing, Observer, Sample, Sink, Trajectories};
pub use outcome::{Ending, Outcome};
