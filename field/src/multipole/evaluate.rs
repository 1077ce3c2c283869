//! Potential and gradient of charged panels at many points.

use faer::{Mat, MatRef};
use meshes::Vec3;
use rayon::prelude::*;

use super::clusters::Clusters;
use super::points::{Points, PointsError};
use crate::panel::{Panel, quadrature};

/// Panels and points, ready for any number of charges: panels that are near a point act by their closed form
/// ([`Panel::potential_and_gradient`]), the others as the points of a quadrature rule through [`Points`].
///
/// On a panel the gradient's normal part is the mean of both sides; see there.
pub struct PanelsAtPoints<'a> {
    panels: &'a [Panel],
    at: &'a [Vec3],
    points: Points,
    clusters: Clusters,
    degree: usize,
    near: f64,
}

/// A point of the rule does not act nearer than this, in panel radii. Without it, a target next to it would get a large number
/// from the sum over points that the correction takes away again, and with it digits; with it two at most.
const REACH: f64 = 0.1;

/// Panels of one cluster in the search for near ones.
const CLUSTER: usize = 8;

/// The accuracy that is usual for a table of the field: the charges themselves are not better than 1e-4.
pub const FIELD_ACCURACY: f64 = 1e-5;

/// Degree of the rule, and from which distance on in panel radii it stands for the panel: the rule misses some
/// (1/near)^(degree + 1) of one panel's share, which is a hundredth of the whole or less there.
fn scheme(accuracy: f64) -> (usize, f64) {
    match accuracy {
        1e-3.. => (2, 4.0),
        1e-4.. => (2, 6.0),
        1e-6.. => (4, 6.0),
        _ => (6, 8.0),
    }
}

impl<'a> PanelsAtPoints<'a> {
    /// Prepares the sums over `panels` at the points `at` (m) to a relative accuracy, root mean square over that of the
    /// values; [`FIELD_ACCURACY`] is a good one.
    ///
    /// # Errors
    /// See [`PointsError`].
    pub fn new(panels: &'a [Panel], at: &'a [Vec3], accuracy: f64) -> Result<Self, PointsError> {
        let (degree, near) = scheme(accuracy);
        let balls: Vec<(Vec3, f64)> = panels.iter().map(|p| (p.centroid, p.radius)).collect();
        let clusters = Clusters::new(&balls, CLUSTER);
        let rule = quadrature::rule(degree);
        let mut sources = Vec::with_capacity(panels.len() * rule.weights.len());
        let mut reach = Vec::with_capacity(sources.capacity());
        for panel in panels {
            for (x, _) in rule.on(&panel.corners) {
                sources.push(x);
                reach.push(REACH * panel.radius);
            }
        }
        let points = Points::with_reach(&sources, at, &reach, accuracy)?;
        Ok(Self { panels, at, points, clusters, degree, near })
    }

    /// Bytes that stay allocated.
    pub fn bytes(&self) -> u64 {
        self.points.bytes() + 4 * self.panels.len() as u64
    }

    /// Bytes that one application allocates.
    pub fn bytes_applied(&self, columns: usize) -> u64 {
        let rule = quadrature::rule(self.degree).weights.len();
        self.points.bytes_applied(columns, true) + 8 * (columns * rule * self.panels.len()) as u64
    }

    /// Σ_j q_j/A_j ∫_j dS / |x - y| and its gradient, `points × 4 columns` (potential, slopes along x, y, z for each column),
    /// of charges `panels × columns`: V and V/m of charges that are Coulomb's constant times coulombs. The result does not
    /// depend on the number of threads.
    ///
    /// # Panics
    /// The charges have another number of rows than there are panels.
    pub fn potentials_and_gradients(&self, charges: MatRef<'_, f64>) -> Mat<f64> {
        assert_eq!(charges.nrows(), self.panels.len(), "one row of charges for each panel");
        let rule = quadrature::rule(self.degree);
        let (q, k) = (rule.weights.len(), charges.ncols());
        let spread = Mat::from_fn(self.panels.len() * q, k, |i, c| charges[(i / q, c)] * rule.weights[i % q]);
        let mut values = self.points.potentials_and_gradients(spread.as_ref());
        drop(spread);
        values.par_row_chunks_mut(ROWS).enumerate().for_each(|(chunk, mut values)| {
            for t in 0..values.nrows() {
                let x = &self.at[chunk * ROWS + t];
                self.clusters.near(x, 0.0, self.near, |run| {
                    for &p in &self.clusters.order[run] {
                        let panel = &self.panels[p as usize];
                        if (x - panel.centroid).norm_squared() < (self.near * panel.radius).powi(2) {
                            let (v, g) = correction(panel, x, rule);
                            for c in 0..k {
                                let charge = charges[(p as usize, c)];
                                values[(t, 4 * c)] += charge * v;
                                for axis in 0..3 {
                                    values[(t, 4 * c + axis + 1)] += charge * g[axis];
                                }
                            }
                        }
                    }
                });
            }
        });
        values
    }
}

/// Points whose near panels one task looks for.
const ROWS: usize = 256;

/// What a panel of charge one has at a point more than the points that stand for it.
fn correction(panel: &Panel, x: &Vec3, rule: &quadrature::Rule) -> (f64, Vec3) {
    let (value, slope) = panel.potential_and_gradient(x);
    let (mut value, mut slope) = (value / panel.area, slope / panel.area);
    let least = (REACH * panel.radius).powi(2);
    for (y, weight) in rule.on(&panel.corners) {
        let d = x - y;
        let r2 = d.norm_squared();
        if r2 > least {
            let over = weight / r2.sqrt();
            value -= over;
            slope += d * (over / r2);
        }
    }
    (value, slope)
}
