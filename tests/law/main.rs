//! Laws: reciprocity, superposition, motion and scale of the whole, Gauss, energy, thread count.

mod energy;
mod gauss;
mod motion;
mod reciprocity;
mod solvers;
mod superposition;
mod threads;
