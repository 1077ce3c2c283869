//! What a coarser charge would have given, from the matrix at hand: an error estimate for surfaces that cannot be meshed anew.

use std::collections::HashMap;

use faer::{Mat, Side};
use meshes::SurfaceMesh;
use rayon::prelude::*;

use crate::constants::COULOMB;
use crate::panel::Panel;

/// Panels that share one charge density in the coarse problem: neighbours on one electrode, up to four.
const GROUP: usize = 4;

/// The capacitance matrix (F) of a coarser charge, and the ratio of panel sizes, coarse over fine.
#[derive(Clone, Debug, PartialEq)]
pub struct CoarseCapacitance {
    /// As [`crate::CapacitanceMatrix::matrix`].
    pub matrix: Vec<Vec<f64>>,
    /// Square root of panels over groups.
    pub size_ratio: f64,
}

/// Group of each panel, and the number of groups.
pub(crate) fn groups(mesh: &SurfaceMesh) -> (Vec<u32>, usize) {
    let mut neighbours: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
    let edges = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| (a.min(b), a.max(b)));
    for (p, t) in mesh.triangles.iter().enumerate() {
        for edge in edges(t) {
            neighbours.entry(edge).or_default().push(p as u32);
        }
    }
    const NONE: u32 = u32::MAX;
    let mut group = vec![NONE; mesh.panels()];
    let mut count = 0;
    for first in 0..mesh.panels() {
        if group[first] != NONE {
            continue;
        }
        let mut members = vec![first];
        group[first] = count;
        let mut next = 0;
        while next < members.len() && members.len() < GROUP {
            for edge in edges(&mesh.triangles[members[next]]) {
                for &other in &neighbours[&edge] {
                    if group[other as usize] == NONE && members.len() < GROUP {
                        group[other as usize] = count;
                        members.push(other as usize);
                    }
                }
            }
            next += 1;
        }
        count += 1;
    }
    (group, count as usize)
}

/// Solves the problem with one charge density for each group of panels. `matrix` holds the Galerkin coefficients of the
/// panels in its lower triangle. `None` where the coarse matrix is not positive definite.
pub(crate) fn coarse_capacitance(mesh: &SurfaceMesh, panels: &[Panel], matrix: &Mat<f64>) -> Option<CoarseCapacitance> {
    let (group, count) = groups(mesh);
    let mut area = vec![0.0; count];
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (p, &g) in group.iter().enumerate() {
        area[g as usize] += panels[p].area;
        members[g as usize].push(p as u32);
    }
    // A group's charge spreads by area, and its mean potential weighs by area.
    let share = |p: u32| panels[p as usize].area / area[group[p as usize] as usize];
    let entry = |i: u32, j: u32| matrix[(i.max(j) as usize, i.min(j) as usize)];
    let mut coarse = Mat::<f64>::zeros(count, count);
    let columns: Vec<_> = coarse.col_iter_mut().enumerate().collect();
    columns.into_par_iter().for_each(|(j, mut column)| {
        for i in j..count {
            let mut sum = 0.0;
            for &p in &members[i] {
                for &q in &members[j] {
                    sum += share(p) * share(q) * entry(p, q);
                }
            }
            column[i] = sum;
        }
    });
    let electrodes = mesh.electrodes.len();
    let of = |g: usize| mesh.electrode[members[g][0] as usize] as usize;
    let wanted = Mat::<f64>::from_fn(count, electrodes, |g, k| f64::from(u8::from(of(g) == k)));
    let factor = faer::linalg::solvers::Llt::new(coarse.as_ref(), Side::Lower).ok()?;
    let charge = faer::linalg::solvers::Solve::solve(&factor, &wanted);
    let mut capacitance = vec![vec![0.0; electrodes]; electrodes];
    for g in 0..count {
        for k in 0..electrodes {
            capacitance[of(g)][k] += charge[(g, k)] / COULOMB;
        }
    }
    Some(CoarseCapacitance { matrix: capacitance, size_ratio: (panels.len() as f64 / count as f64).sqrt() })
}
