//! Sums over very many charges in nearly linear time: the fast multipole method, and what is built on it.

mod close;
mod clusters;
mod evaluate;
mod krylov;
mod near;
mod operator;
mod points;
mod precondition;
mod solid;
mod solve;
#[cfg(test)]
mod tests;
mod translation;
mod tree;

pub use evaluate::{FIELD_ACCURACY, PanelsAtPoints};
pub use operator::PanelOperator;
pub use points::{Points, PointsError};
pub use solve::{IterativeError, IterativeReport, bytes_needed, solve_panels};
