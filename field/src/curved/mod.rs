//! Charge of high order on the true surface: the 3D method for shapes whose surface is known in closed form.
//!
//! The surface is cut into **elements**, rectangles in the parameters of [`meshes::Patch`]. On each the charge per parameter is
//! a polynomial of some **order** in both directions, known by its values at Gauss points; since the parameters are stretched at
//! edges, that is the charge density with its edge singularity divided out. The potential is to be right at the same points
//! (collocation). Elements are divided where the charge turns out to be rough, and the error is known from the next, finer
//! solution.
//!
//! Source: Atkinson 1997, *The Numerical Solution of Integral Equations of the Second Kind*, chapter 9, for collocation on
//! curved elements; Duffy 1982 for the singular integrals.

// Sums over small square arrays read as in the formula, and compile to vectors, with indices.
#![allow(clippy::needless_range_loop)]

mod apart;
mod assembly;
mod charge;
mod element;
mod iterative;
mod kernel;
mod legendre;
mod pieces;
mod refine;
mod solve;
mod sum;

pub use charge::CurvedCharge;
pub use element::{CurvedMesh, Element};
pub(crate) use pieces::CurvedPieces;
pub use refine::{Refined, solve_to};
pub use solve::{CurvedBy, CurvedProblem, CurvedSolution};
pub(crate) use sum::CurvedSum;

#[cfg(test)]
mod tests;
