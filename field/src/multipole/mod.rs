//! Sums over very many charges in nearly linear time: the fast multipole method, and what is built on it.
//!
//! * [`Points`]: Σ q / |x - y| over point charges, with gradients, several columns of charges at once;
//! * [`PanelOperator`]: the Galerkin matrix of [`crate::influence::potential_coefficients`] as an operator. Panels act as the
//!   points of a quadrature rule; what near pairs have more is added from a sparse matrix;
//! * [`solve_panels`]: charges from potentials by block GMRES, all right-hand sides together;
//! * [`PanelsAtPoints`]: potential and gradient of charged panels at many points, near panels by their closed form.
//!
//! Accuracies are root mean squares relative to those of the values, and follow from one number. No result depends on the
//! number of threads. Translations are computed once for each accuracy and kept: some hundredths of a second down to 1e-6, a
//! second and some hundred megabytes at 1e-8 and below.
//!
//! ```
//! use faer::Mat;
//! use field::multipole::Points;
//! use meshes::Vec3;
//!
//! let sources: Vec<Vec3> = (0..5000).map(|k| Vec3::new((k as f64).sin(), (2.3 * k as f64).cos(), 0.0)).collect();
//! let sum = Points::new(&sources, &sources, 1e-4)?;
//! let charges = Mat::from_fn(5000, 1, |_, _| 1.0);
//! let found = sum.potentials(charges.as_ref());
//! let exact: f64 = (1..5000).map(|k| 1.0 / (sources[0] - sources[k]).norm()).sum();
//! assert!((found[(0, 0)] / exact - 1.0).abs() < 1e-3);
//! # Ok::<(), field::multipole::PointsError>(())
//! ```

mod close;
pub(crate) mod clusters;
mod evaluate;
pub(crate) mod krylov;
mod near;
mod operator;
mod points;
pub(crate) mod precondition;
mod solid;
mod solve;
#[cfg(test)]
mod tests;
mod translation;
mod tree;

pub use evaluate::{FIELD_ACCURACY, PanelsAtPoints};
pub use operator::PanelOperator;
pub use points::{Points, PointsError};
pub(crate) use solve::solve_keeping;
pub use solve::{IterativeError, IterativeReport, bytes_needed, solve_panels};
