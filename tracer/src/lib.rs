//! Grains in flight: ensembles, forces, integrators, how a flight ends, what is kept of it.

pub mod cloud;

pub use cloud::{Launch, Place};
