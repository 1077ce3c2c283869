//! Sums over very many charges in nearly linear time: the fast multipole method, and what is built on it.

mod near;
mod points;
mod solid;
#[cfg(test)]
mod tests;
mod translation;
mod tree;

pub use points::{Points, PointsError};
