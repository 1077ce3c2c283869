//! Charges of the panels that show a solution whose own charges are elsewhere.

use faer::Mat;
use meshes::{SurfaceMesh, Vec3};

use crate::panel::{Panel, quadrature};

/// Degree of the rule that integrates densities over a panel.
const DEGREE: usize = 2;

/// Densities of all basis functions at points of electrodes, `point * functions + function`.
type Densities<'a> = dyn Fn(&[(Vec3, usize)]) -> Vec<f64> + 'a;

/// Charge of each panel (row) in each basis function (column), C, from densities (C/m²) at points of the surface; on every
/// electrode they sum to `wanted(electrode, function)`.
///
/// A density is infinite at an edge, where no rule is right: what is missing goes to the panels on which the rule and the
/// density in the middle differ, by how much they do. Checked by `charges_shown_add_up`.
pub(crate) fn charges(
    mesh: &SurfaceMesh,
    panels: &[Panel],
    functions: usize,
    densities: &Densities,
    wanted: &dyn Fn(usize, usize) -> f64,
) -> Mat<f64> {
    let rule = quadrature::rule(DEGREE);
    let each = rule.points.len() + 1;
    let points: Vec<(Vec3, usize)> = panels
        .iter()
        .zip(&mesh.electrode)
        .flat_map(|(panel, &e)| {
            let inside = rule.on(&panel.corners).map(|(x, _)| x);
            inside.chain([panel.centroid]).map(move |x| (x, e as usize))
        })
        .collect();
    let densities = densities(&points);
    let at = |panel: usize, point: usize, function: usize| densities[(panel * each + point) * functions + function];
    let mut charge = Mat::zeros(panels.len(), functions);
    let mut doubt = vec![0.0; panels.len()];
    for k in 0..functions {
        for (p, panel) in panels.iter().enumerate() {
            let mean: f64 = rule.weights.iter().enumerate().map(|(q, w)| w * at(p, q, k)).sum();
            charge[(p, k)] = mean * panel.area;
            // A little of every charge, for surfaces on which both agree.
            doubt[p] = ((mean - at(p, each - 1, k)).abs() + 1e-6 * mean.abs()) * panel.area;
        }
        for e in 0..mesh.electrodes.len() {
            let sum = |of: &dyn Fn(usize) -> f64| mesh.panels_of(e).map(of).sum::<f64>();
            let (missing, doubts) = (wanted(e, k) - sum(&|p| charge[(p, k)]), sum(&|p| doubt[p]));
            if doubts > 0.0 {
                mesh.panels_of(e).for_each(|p| charge[(p, k)] += missing * doubt[p] / doubts);
            }
        }
    }
    charge
}
