//! An approximate inverse of the matrix of potential coefficients: patch by patch.
//!
//! The panels of each cluster and those around it form a patch. The patch's own matrix is inverted, and of the inverse only
//! the rows of the cluster are kept: charges of a cluster from the potentials of the patch. This is the restricted additive
//! Schwarz method (Cai and Sarkis 1999) with one cluster for each subdomain; for potential coefficients it is due to
//! Vavasis 1992 and to Nabors et al. 1994.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

use super::operator::PanelOperator;
use crate::panel::Panel;

/// Rows of the inverse for one cluster.
pub(crate) struct Block {
    cluster: Range<usize>,
    /// Places of the patch.
    patch: Vec<u32>,
    /// `cluster × patch`, column-major. Single precision: an approximate inverse needs no more.
    rows: Vec<f32>,
}

/// The approximate inverse, in the order of the clusters.
pub(crate) struct Patches {
    blocks: Vec<Block>,
}

/// Most panels of a patch: the work of its factorisation goes with the third power.
const LARGEST: usize = 160;

impl Block {
    /// From the rows of the inverse, `cluster × patch`, column-major.
    pub fn new(cluster: Range<usize>, patch: Vec<u32>, rows: Vec<f32>) -> Self {
        Self { cluster, patch, rows }
    }
}

impl Patches {
    /// Of blocks whose clusters make up all places.
    pub fn of(blocks: Vec<Block>) -> Self {
        Self { blocks }
    }

    pub fn new(operator: &PanelOperator) -> Self {
        let n = operator.panels().len();
        let leaves = operator.clusters.leaves();
        let blocks = leaves
            .into_par_iter()
            .map_init(|| vec![u32::MAX; n], |places, cluster| block(operator, cluster, places))
            .collect();
        Self { blocks }
    }

    /// Bytes.
    pub fn bytes(&self) -> u64 {
        self.blocks.iter().map(|b| (4 * b.patch.len() + 4 * b.rows.len()) as u64).sum()
    }

    /// Charges from potentials, `panels × columns`.
    pub fn apply(&self, potentials: MatRef<'_, f64>) -> Mat<f64> {
        let (n, k) = (potentials.nrows(), potentials.ncols());
        let parts: Vec<Vec<f32>> = self
            .blocks
            .par_iter()
            .map(|block| {
                let (own, all) = (block.cluster.len(), block.patch.len());
                let mut from = vec![0.0_f32; all * k];
                for c in 0..k {
                    for (from, &p) in from[c * all..(c + 1) * all].iter_mut().zip(&block.patch) {
                        *from = potentials[(p as usize, c)] as f32;
                    }
                }
                let mut to = vec![0.0_f32; own * k];
                matmul(
                    MatMut::from_column_major_slice_mut(&mut to, own, k),
                    Accum::Replace,
                    MatRef::from_column_major_slice(&block.rows, own, all),
                    MatRef::from_column_major_slice(&from, all, k),
                    1.0,
                    Par::Seq,
                );
                to
            })
            .collect();
        let mut charges = Mat::zeros(n, k);
        for (block, part) in self.blocks.iter().zip(parts) {
            for (c, part) in part.chunks_exact(block.cluster.len()).enumerate() {
                for (i, value) in block.cluster.clone().zip(part) {
                    charges[(i, c)] = f64::from(*value);
                }
            }
        }
        charges
    }
}

/// `places` is `u32::MAX` everywhere, and is so again afterwards.
fn block(operator: &PanelOperator, cluster: Range<usize>, places: &mut [u32]) -> Block {
    let order = &operator.clusters.order;
    let at = |place: usize| -> &Panel { &operator.panels()[order[place] as usize] };
    let near = &operator.near;
    // Those around: near entries' columns, nearest first in units of their own and the cluster's panels' size.
    let mut patch: Vec<u32> = cluster.clone().map(|p| p as u32).collect();
    for (k, &p) in patch.iter().enumerate() {
        places[p as usize] = k as u32;
    }
    let mut around: Vec<(f64, u32)> = Vec::new();
    for i in cluster.clone() {
        for &j in &near.columns[near.starts[i]..near.starts[i + 1]] {
            if places[j as usize] == u32::MAX {
                places[j as usize] = 0;
                let nearest = cluster.clone().map(|i| (at(i).centroid - at(j as usize).centroid).norm_squared());
                around.push((nearest.fold(f64::INFINITY, f64::min), j));
            }
        }
    }
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (_, j) in &around {
        if patch.len() < LARGEST.max(cluster.len()) {
            places[*j as usize] = patch.len() as u32;
            patch.push(*j);
        } else {
            places[*j as usize] = u32::MAX;
        }
    }
    let m = patch.len();
    let mut matrix = Mat::<f64>::zeros(m, m);
    for b in 0..m {
        let one = at(patch[b] as usize);
        for a in b + 1..m {
            matrix[(a, b)] = by_moments(one, at(patch[a] as usize));
        }
    }
    for (a, &i) in patch.iter().enumerate() {
        let range = near.starts[i as usize]..near.starts[i as usize + 1];
        for k in range {
            let b = places[near.columns[k] as usize];
            if b != u32::MAX && b as usize <= a {
                matrix[(a, b as usize)] = f64::from(near.entries[k]);
            }
        }
    }
    for &p in &patch {
        places[p as usize] = u32::MAX;
    }
    // The rows of the inverse are columns, as it is symmetric.
    let own = cluster.len();
    let mut columns = Mat::<f64>::from_fn(m, own, |i, j| if i == j { 1.0 } else { 0.0 });
    let scale: Vec<f64> = (0..m).map(|i| matrix[(i, i)]).collect();
    match matrix.llt(faer::Side::Lower) {
        Ok(factor) => factor.solve_in_place(&mut columns),
        // Panels almost on each other, seen through the errors of their entries: the diagonal alone.
        Err(_) => {
            for j in 0..own {
                columns[(j, j)] = 1.0 / scale[j];
            }
        }
    }
    let rows = (0..m).flat_map(|i| (0..own).map(move |j| (i, j))).map(|(i, j)| columns[(i, j)] as f32).collect();
    Block { cluster, patch, rows }
}

/// The entry of two panels that are not near: 1/R + ½ (M₁ + M₂) : ∇∇(1/R), M the second moments.
fn by_moments(one: &Panel, other: &Panel) -> f64 {
    let arm = one.centroid - other.centroid;
    let r2 = arm.norm_squared();
    let m: [f64; 6] = std::array::from_fn(|k| one.moments[k] + other.moments[k]);
    let [x, y, z] = [arm.x, arm.y, arm.z];
    let quadratic = m[0] * x * x + m[1] * y * y + m[2] * z * z + 2.0 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
    (1.0 + 0.5 * (3.0 * quadratic / r2 - (m[0] + m[1] + m[2])) / r2) / r2.sqrt()
}
