//! The charge that curved elements carry.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use faer::Mat;
use meshes::Vec3;
use rayon::prelude::*;

use super::element::{Ball, CurvedMesh};
use super::kernel::Moments;
use super::legendre::{MAX_ORDER, Transform, legendre};
use crate::constants::COULOMB;
use crate::multipole::clusters::Clusters;

/// How near to an edge a density is told, as a part of an element.
const OFF_EDGE: f64 = 1e-3;

/// The same to an axis. A charge per parameter that is wrong by 1e-5 made the density in the middle of a disc wrong by 5e-2 at
/// 1e-3 of an element from it; at this distance it is 1e-3, and the density itself changes by less.
const OFF_AXIS: f64 = 0.03;

/// Patches in which a point is looked for before all near ones are compared: of a plate of 48 x 48 holes the first three hold 95 of 100.
const TRIED: usize = 4;

/// Charges on a curved mesh, for each basis function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvedCharge {
    /// The elements.
    #[serde(with = "shared")]
    pub mesh: Arc<CurvedMesh>,
    /// Charge per parameter at every point, over Coulomb's constant (V m): `function * points + point`.
    pub values: Vec<f64>,
    /// Number of basis functions.
    pub functions: usize,
    /// Relative accuracy to which integrals over the elements are taken.
    pub accuracy: f64,
}

impl CurvedCharge {
    /// From values at points (rows) for basis functions (columns).
    pub fn new(mesh: CurvedMesh, values: &Mat<f64>, accuracy: f64) -> Self {
        let columns = values.col_iter().flat_map(|c| c.iter().copied().collect::<Vec<_>>()).collect();
        Self { mesh: Arc::new(mesh), values: columns, functions: values.ncols(), accuracy }
    }

    /// Whether numbers fit together; a charge that was read from somewhere may lie.
    pub fn is_whole(&self, electrodes: usize) -> bool {
        let mesh = &*self.mesh;
        let orders = (1..=MAX_ORDER).contains(&mesh.order);
        let owned =
            mesh.electrode.len() == mesh.patches.len() && mesh.electrode.iter().all(|e| (*e as usize) < electrodes);
        let cut = mesh.elements.iter().all(|e| (e.patch as usize) < mesh.patches.len());
        orders && owned && cut && mesh.unknowns().checked_mul(self.functions) == Some(self.values.len())
    }

    /// Values at the points of an element for one function.
    pub fn of_element(&self, element: usize, function: usize) -> &[f64] {
        let each = self.mesh.order * self.mesh.order;
        let start = function * self.mesh.unknowns() + element * each;
        &self.values[start..start + each]
    }

    /// Legendre coefficients on an element of a combination of basis functions.
    pub fn combination(&self, element: usize, weights: &[f64], transform: &Transform) -> Moments {
        let each = self.mesh.order * self.mesh.order;
        let mut sum = vec![0.0; each];
        for (function, weight) in weights.iter().enumerate() {
            if *weight != 0.0 {
                for (s, v) in sum.iter_mut().zip(self.of_element(element, function)) {
                    *s += weight * v;
                }
            }
        }
        transform.coefficients(&sum)
    }

    /// Charge density of every basis function at points near the surface, each with its electrode: C/m² per volt,
    /// `point * functions + function`.
    pub fn densities(&self, points: &[(Vec3, usize)]) -> Vec<f64> {
        let mesh = &*self.mesh;
        let transform = Transform::new(mesh.order);
        let balls: Vec<Ball> = mesh.patches.iter().map(|p| Ball::new(p, [0.0; 2], [1.0; 2])).collect();
        let mut of_patch: Vec<Vec<usize>> = vec![Vec::new(); mesh.patches.len()];
        for (e, element) in mesh.elements.iter().enumerate() {
            of_patch[element.patch as usize].push(e);
        }
        let clusters = Clusters::new(&balls.iter().map(|b| (b.center, b.reach)).collect::<Vec<_>>(), 8);
        // The patch whose surface is nearest; patches reach some 1.5 of their ball where they bend.
        let least = |p: u32, point: &Vec3| (point - balls[p as usize].center).norm() - 1.5 * balls[p as usize].reach;
        // Most points of flat faces lie in the midst of a patch, one of the few whose middle is nearest in terms of their size: no other
        // can be as near.
        let within = |candidates: &[u32], point: &Vec3| -> Option<(usize, [f64; 2])> {
            let away = |p: u32| (point - balls[p as usize].center).norm() / balls[p as usize].reach;
            let mut tried = f64::NEG_INFINITY;
            for _ in 0..TRIED {
                let untried = candidates.iter().map(|&p| (away(p), p)).filter(|(a, _)| *a > tried);
                let (next, p) = untried.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
                tried = next;
                let (patch, reach) = (&mesh.patches[p as usize], balls[p as usize].reach);
                let at = patch.parameters(point);
                let inner = at.iter().all(|x| (1e-6..1.0 - 1e-6).contains(x));
                if inner && (patch.at(at[0], at[1]) - point).norm() < 1e-9 * reach {
                    return Some((p as usize, at));
                }
            }
            None
        };
        let nearest = |candidates: &mut Vec<u32>, point: &Vec3, electrode: usize| -> Option<(usize, [f64; 2])> {
            candidates.retain(|&p| mesh.electrode[p as usize] as usize == electrode);
            if let Some(found) = within(candidates, point) {
                return Some(found);
            }
            candidates.sort_by(|a, b| least(*a, point).total_cmp(&least(*b, point)).then(a.cmp(b)));
            let mut best: Option<(f64, u32, [f64; 2])> = None;
            for &p in &*candidates {
                if best.is_some_and(|(d, ..)| least(p, point) > d) {
                    break;
                }
                let at = mesh.patches[p as usize].parameters(point);
                let distance = (mesh.patches[p as usize].at(at[0], at[1]) - point).norm();
                // Of equally near ones the first.
                if best.is_none_or(|(d, q, _)| distance < d || (distance == d && p < q)) {
                    best = Some((distance, p, at));
                }
            }
            best.map(|(_, p, at)| (p as usize, at))
        };
        let mut densities = vec![0.0; points.len() * self.functions];
        densities.par_chunks_mut(self.functions.max(1)).zip(points).for_each(|(out, (point, electrode))| {
            let mut candidates = Vec::new();
            clusters.near(point, 0.0, 3.0, |run| candidates.extend(&clusters.order[run]));
            let found = nearest(&mut candidates, point, *electrode).or_else(|| {
                candidates = (0..mesh.patches.len() as u32).collect();
                nearest(&mut candidates, point, *electrode)
            });
            let Some((patch, at)) = found else { return };
            let holds = |e: &&usize| {
                let element = &mesh.elements[**e];
                (0..2).all(|k| at[k] >= element.low[k] && at[k] <= element.high[k])
            };
            let Some(&e) = of_patch[patch].iter().find(holds) else { return };
            let element = &mesh.elements[e];
            let width = [0, 1].map(|k| element.high[k] - element.low[k]);
            // Off the very edge, where the density is infinite, and off the axis, where charge and area vanish.
            let (surface, middle) = (&mesh.patches[patch], 0.5 * (element.low[0] + element.high[0]));
            let shrinks = |xi: f64| {
                let [across, there] = [middle, xi].map(|xi| surface.tangents(xi, at[1])[1].norm());
                there < 1e-9 * across
            };
            let inset = |along: usize, end: f64| if along == 0 && shrinks(end) { OFF_AXIS } else { OFF_EDGE };
            let local = [0, 1].map(|k| {
                let (first, last) = (inset(k, element.low[k]), inset(k, element.high[k]));
                ((at[k] - element.low[k]) / width[k]).clamp(first, 1.0 - last)
            });
            let inside = element.parameters(local[0], local[1]);
            let [s, t] = mesh.patches[patch].tangents(inside[0], inside[1]);
            let area = s.cross(&t).norm() * width[0] * width[1];
            let (pu, pv) = (legendre(local[0]), legendre(local[1]));
            for (function, out) in out.iter_mut().enumerate() {
                let c = transform.coefficients(self.of_element(e, function));
                let charge: f64 =
                    (0..MAX_ORDER).map(|i| (0..MAX_ORDER).map(|j| c[i][j] * pu[i] * pv[j]).sum::<f64>()).sum();
                *out = charge / (area * COULOMB);
            }
        });
        densities
    }
}

/// A mesh that is shared is stored as it is.
mod shared {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::CurvedMesh;

    pub fn serialize<S: Serializer>(mesh: &Arc<CurvedMesh>, to: S) -> Result<S::Ok, S::Error> {
        (**mesh).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<CurvedMesh>, D::Error> {
        CurvedMesh::deserialize(from).map(Arc::new)
    }
}
