//! Elements as small as the charge asks for, and an error that is known from a better solution.

use std::collections::HashMap;

use meshes::{Patch, Side, Vec3};

use super::apart::apart;
use super::element::{CurvedMesh, Element};
use super::legendre::{MAX_ORDER, Transform};
use super::solve::{CurvedBy, CurvedProblem, CurvedSolution};
use crate::boundary_problem::SolveError;
use crate::errors::Errors;

/// A solution whose error is known.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The solution.
    pub solution: CurvedSolution,
    /// Its errors, found from a better solution.
    pub errors: Errors,
    /// Unknowns of the better solution.
    pub judged_by: usize,
}

/// A stage of refinement: the order of the elements, and how often those next to a vertex are cut in four.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    order: usize,
    depth: usize,
}

impl Level {
    fn first(accuracy: f64) -> Self {
        let digits = -accuracy.log10();
        Self {
            order: (digits.round() as usize - 1).clamp(2, MAX_ORDER - 1),
            depth: (digits - 5.0).clamp(0.0, 6.0).round() as usize,
        }
    }

    fn next(self) -> Self {
        Self { order: (self.order + 1).min(MAX_ORDER), depth: self.depth }
    }
}

/// Largest number of solutions on the way to the accuracy.
const ROUNDS: usize = 9;

/// Solves on finer and finer meshes until the error of one is known to be below `accuracy`. `difference(fine, coarse)` tells
/// the errors of the second if the first were exact; `begins` hears of each mesh before it is solved. `limit` is the largest number
/// of points, or of unknowns of a sector where the problem is to be solved by a matrix.
///
/// # Errors
/// As [`CurvedProblem::solve`].
#[allow(clippy::too_many_arguments)]
pub fn solve_to(
    problem: &CurvedProblem,
    patches: &[Patch],
    electrode: &[u32],
    accuracy: f64,
    limit: usize,
    difference: &dyn Fn(&CurvedSolution, &CurvedSolution) -> Errors,
    begins: &dyn Fn(&CurvedMesh),
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Refined, SolveError> {
    let electrodes = electrode.iter().map(|e| *e as usize + 1).max().unwrap_or(0);
    let vertices = vertices(patches, electrode);
    let mut level = Level::first(accuracy);
    let start: Vec<Element> =
        (0..patches.len()).map(|p| Element { patch: p as u32, low: [0.0; 2], high: [1.0; 2] }).collect();
    let mut mesh = CurvedMesh {
        patches: patches.to_vec(),
        electrode: electrode.to_vec(),
        electrodes,
        elements: graded(patches, &vertices, start, level.depth),
        order: level.order,
    };
    mesh.elements = apart(&mesh, problem.sources, problem.ground);
    // Without a matrix points count, not what symmetry leaves of them.
    let reduced = |points: usize, reduction: usize| match problem.by {
        CurvedBy::Matrix => points / reduction,
        CurvedBy::Size | CurvedBy::Multipoles => points,
    };
    if mesh.unknowns() > limit {
        let unknowns = if problem.by == CurvedBy::Matrix { problem.unknowns(&mesh)? } else { mesh.unknowns() };
        if unknowns > limit {
            return Err(SolveError::TooMany { unknowns, most: limit });
        }
    }
    // Where nothing better can be had: one order less errs more.
    let judged_by_rougher = |solution: CurvedSolution| {
        let mesh = &solution.charge.mesh;
        let rough = CurvedMesh { order: (mesh.order - 1).max(1), ..(**mesh).clone() };
        begins(&rough);
        let errors = difference(&solution, &problem.solve(&rough, 0.01 * accuracy, progress)?);
        Ok(Refined { solution, errors, judged_by: 0 })
    };
    let mut before: Option<CurvedSolution> = None;
    for round in 1.. {
        // Integrals to a hundredth of what is asked.
        begins(&mesh);
        let solution = match (problem.solve(&mesh, 0.01 * accuracy, progress), before.take()) {
            // The coarser one will have to do.
            (Err(SolveError::TooLarge { .. }), Some(coarse)) => return judged_by_rougher(coarse),
            (solution, coarse) => {
                before = coarse;
                solution?
            }
        };
        let mut known = None;
        if let Some(coarse) = before {
            let errors = difference(&solution, &coarse).times(TRUST);
            if errors.worst() <= accuracy {
                return Ok(Refined { solution: coarse, errors, judged_by: solution.unknowns });
            }
            known = Some(errors);
            if round == ROUNDS {
                return Ok(Refined { solution, errors, judged_by: 0 });
            }
        }
        level = level.next();
        let elements = graded(patches, &vertices, refined(&solution, accuracy, known.is_some()), level.depth);
        let mut finer = CurvedMesh { elements, order: level.order, ..mesh.clone() };
        // As much smaller by symmetry as the one at hand.
        let reduction = (mesh.unknowns() / solution.unknowns.max(1)).max(1);
        if reduced(finer.unknowns(), reduction) > limit {
            if let Some(errors) = known {
                // Nothing better can be had: the error of the coarser one bounds that of the better.
                return Ok(Refined { solution, errors, judged_by: 0 });
            }
            finer = CurvedMesh { order: level.order, ..mesh.clone() };
            if reduced(finer.unknowns(), reduction) > limit {
                return judged_by_rougher(solution);
            }
        }
        mesh = finer;
        before = Some(solution);
    }
    unreachable!("the last round returns")
}

/// The error of a solution over its difference from a better one: the better one errs as well, by a third as much or less. With
/// 1.2 a thin rod before a plate was told 9.8e-4 and had 1.9e-3, two grid plates 9.3e-5 and 1.4e-4: both near what was asked.
const TRUST: f64 = 1.5;

/// How much of the largest roughness an element may have without being divided. With 0.1, five of 16 geometries (most with
/// narrow gaps) ran out of unknowns at 1e-3, with 0.5 one, and the others took up to five times as long as with 0.5.
const SHARE: f64 = 0.5;

/// Roughness of an element that does not count at first, over √(accuracy / number of elements): a charge that is wrong by δ
/// makes an error of δ² in the energy.
const HARMLESS: f64 = 0.1;

/// Divides elements on which the charge is rough, in the directions in which it is.
///
/// What the last two Legendre coefficients of a direction hold is what the next ones may hold: an estimate of the charge that
/// the element misses.
fn refined(solution: &CurvedSolution, accuracy: f64, missed: bool) -> Vec<Element> {
    let (charge, mesh) = (&solution.charge, &*solution.charge.mesh);
    let transform = Transform::new(mesh.order);
    let last = mesh.order - 1;
    let scale: Vec<f64> = (0..charge.functions)
        .map(|f| {
            let of = |e: usize| transform.coefficients(charge.of_element(e, f))[0][0].abs();
            (0..mesh.elements.len()).map(of).sum::<f64>().max(f64::MIN_POSITIVE)
        })
        .collect();
    let rough: Vec<[f64; 2]> = (0..mesh.elements.len())
        .map(|e| {
            let mut worst = [0.0_f64; 2];
            for (f, scale) in scale.iter().enumerate() {
                let c = transform.coefficients(charge.of_element(e, f));
                let tail = |k: usize, l: usize| -> f64 {
                    let (u, v) = ((0..=last).map(|j| c[k][j].powi(2)), (0..=last).map(|i| c[i][k].powi(2)));
                    (if l == 0 { u.sum::<f64>() } else { v.sum::<f64>() }).sqrt()
                };
                for (l, worst) in worst.iter_mut().enumerate() {
                    // Even and odd parts may vanish by symmetry.
                    *worst = worst.max(tail(last, l).max(tail(last - 1, l) / 4.0) / scale);
                }
            }
            worst
        })
        .collect();
    let worst = rough.iter().flatten().fold(0.0_f64, |m, r| m.max(*r));
    // Ties within rounding are decided alike, so that a symmetric mesh stays symmetric.
    let harmless = if missed { 0.0 } else { HARMLESS * (accuracy / mesh.elements.len() as f64).sqrt() };
    let threshold = (SHARE * worst).max(harmless);
    let mut elements = Vec::new();
    for (element, rough) in mesh.elements.iter().zip(&rough) {
        let rounded = rough.map(|r| (r * 1e6 / threshold).round() / 1e6);
        let mut parts = vec![*element];
        for (along, rough) in rounded.into_iter().enumerate() {
            if rough > 1.0 {
                parts = parts.iter().flat_map(|part| part.halves(along)).collect();
            }
        }
        elements.extend(parts);
    }
    elements
}

/// Cuts the elements at vertices in four until each has been cut `depth` times along both directions.
fn graded(patches: &[Patch], vertices: &[[bool; 4]], elements: Vec<Element>, depth: usize) -> Vec<Element> {
    let smallest = 0.5_f64.powi(depth as i32) * 1.5;
    let mut done = Vec::with_capacity(elements.len());
    let mut pending: Vec<Element> = elements.into_iter().rev().collect();
    debug_assert_eq!(patches.len(), vertices.len());
    while let Some(element) = pending.pop() {
        let corners = vertices[element.patch as usize];
        let touches = (0..4).any(|c| {
            let end = [c & 1, c >> 1];
            corners[c] && (0..2).all(|k| if end[k] == 0 { element.low[k] == 0.0 } else { element.high[k] == 1.0 })
        });
        let wide: Vec<usize> = (0..2).filter(|&k| element.high[k] - element.low[k] > smallest).collect();
        if touches && !wide.is_empty() {
            let mut parts = vec![element];
            for along in wide {
                parts = parts.iter().flat_map(|part| part.halves(along)).collect();
            }
            pending.extend(parts.into_iter().rev());
        } else {
            done.push(element);
        }
    }
    done
}

/// Which corners of each patch, (0,0), (1,0), (0,1), (1,1), are vertices of their electrode: points where an edge ends or turns.
fn vertices(patches: &[Patch], electrode: &[u32]) -> Vec<[bool; 4]> {
    let bounds = patches.iter().flat_map(|p| (0..4).map(|c| p.at((c & 1) as f64, (c >> 1) as f64)));
    let (low, high) = bounds.fold((Vec3::repeat(f64::MAX), Vec3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p), h.sup(&p)));
    let tolerance = 1e-7 * (high - low).norm();
    let key = |p: &Vec3, e: u32| {
        let k = ((p - low) / tolerance).map(|x| (x / 4.0).round() as i64);
        (e, k.x, k.y, k.z)
    };
    // Directions in which edges leave each of their ends.
    let mut ends: HashMap<(u32, i64, i64, i64), Vec<Vec3>> = HashMap::new();
    for (patch, e) in patches.iter().zip(electrode) {
        for (side, what) in patch.sides.iter().enumerate() {
            if *what == Side::Smooth {
                continue;
            }
            let at = |t: f64| match side {
                0 => patch.at(0.0, t),
                1 => patch.at(1.0, t),
                2 => patch.at(t, 0.0),
                _ => patch.at(t, 1.0),
            };
            // Parameters may be stretched: well off the end.
            for (end, inner) in [(0.0, 0.02), (1.0, 0.98)] {
                let direction = (at(inner) - at(end)).normalize();
                ends.entry(key(&at(end), *e)).or_default().push(direction);
            }
        }
    }
    let turns = |directions: &[Vec3]| {
        // An edge that goes on straight leaves in two opposite directions, each maybe told by two faces.
        let first = directions[0];
        !(directions.iter().all(|d| d.cross(&first).norm() < 0.1) && directions.iter().any(|d| d.dot(&first) < 0.0))
    };
    patches
        .iter()
        .zip(electrode)
        .map(|(patch, e)| {
            std::array::from_fn(|c| {
                let p = patch.at((c & 1) as f64, (c >> 1) as f64);
                ends.get(&key(&p, *e)).is_some_and(|directions| turns(directions))
            })
        })
        .collect()
}
