//! Solving for the charge of very many curved elements, without a matrix.
//!
//! Elements act through their points by multipoles, and what elements near a point have more than their points is added from
//! a sparse matrix. Unknowns are the charges of points (values times weights), one for each orbit of the symmetry; only
//! representatives of orbits are looked at. GMRES is preconditioned patch by patch: the elements of a cluster and those around
//! them, whose own equations are solved exactly ([`Patches`]). As that inverse scales with the unknowns, and the residual is
//! one of potentials, elements may differ in size by any factor.

use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef};
use meshes::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

use super::assembly::Assembly;
use super::element::CurvedMesh;
use super::legendre::{Transform, legendre};
use crate::boundary_problem::SolveError;
use crate::gauss::gauss;
use crate::multipole::clusters::Clusters;
use crate::multipole::precondition::{Block, Patches};
use crate::multipole::{IterativeError, Points, krylov};
use crate::plane::Plane;
use crate::symmetry::Symmetry;

/// Iterations after which something is wrong.
const MOST: usize = 150;

/// Right-hand sides advanced together.
const TOGETHER: usize = 8;

/// Residual of the potentials (root mean square, relative) over the accuracy of the integrals.
const RESIDUAL: f64 = 1.0;

/// Coarsest accuracy of the sum over points: with less, steps of the iteration go astray.
const COARSEST: f64 = 1e-4;

/// Unknowns of a cluster, and of the patch of elements in and around it: the work of its factorisation goes with the third
/// power. Elements are not cut, so that those of high order make larger patches.
const CLUSTER: usize = 64;
const PATCH: usize = 288;
/// Elements in a patch at least: one and those around it.
const AROUND: usize = 9;

/// Integrals of this accuracy and better are kept in double precision.
const SINGLE_TO: f64 = 3e-7;

/// What elements near a point have more than their points: for each representative.
enum Near {
    Single(Vec<Row<f32>>),
    Double(Vec<Row<f64>>),
}

/// Elements, and for each the numbers of its points, one element after the other.
struct Row<T> {
    elements: Vec<u32>,
    /// How many of them are near the point itself; the others are near its image in the ground.
    own: usize,
    values: Vec<T>,
}

/// The operator for all sectors of a symmetry.
pub struct Iterative<'a> {
    mesh: &'a CurvedMesh,
    symmetry: &'a Symmetry,
    places: &'a [Vec3],
    assembly: &'a Assembly<'a>,
    grounded: bool,
    points: Points,
    near: Near,
    tolerance: f64,
}

/// The charges of one sector, and what it took.
pub struct Solved {
    /// Charge per parameter of the sector's orbits.
    pub values: Mat<f64>,
    /// Where they go, as [`Symmetry::orbits`].
    pub of: Vec<Option<(u32, f64)>>,
    /// Applications of the operator.
    pub iterations: usize,
}

/// From how many times its reach on an element counts by its own points: as [`super::kernel::Precision`], but elements
/// at that distance have a small share of the potential. The residual against exact rows stays that of the iteration.
fn far(order: usize, accuracy: f64) -> f64 {
    let rho = (4.0 * accuracy).clamp(1e-12, 1.0).powf(-1.0 / (order + 2) as f64);
    (0.5 * (rho + 1.0 / rho)).max(1.5)
}

/// Elements near a place, in order of their numbers.
fn near_elements(clusters: &Clusters, balls: &[(Vec3, f64)], x: &Vec3, far: f64) -> Vec<u32> {
    let mut found = Vec::new();
    clusters.near(x, 0.0, far, |run| {
        found.extend(clusters.order[run].iter().filter(|&&e| {
            let (center, reach) = balls[e as usize];
            (x - center).norm_squared() < (far * reach).powi(2)
        }));
    });
    found.sort_unstable();
    found
}

impl<'a> Iterative<'a> {
    /// Prepares the operator; `accuracy` is that of the integrals, `columns` how many right-hand sides there will be.
    ///
    /// # Errors
    /// Too little memory.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        mesh: &'a CurvedMesh,
        assembly: &'a Assembly<'a>,
        places: &'a [Vec3],
        symmetry: &'a Symmetry,
        ground: Option<Plane>,
        accuracy: f64,
        columns: usize,
        max_bytes: u64,
    ) -> Result<Self, SolveError> {
        let representatives = &symmetry.representatives;
        let balls: Vec<(Vec3, f64)> = assembly.elements.iter().map(|e| (e.ball.center, e.ball.reach)).collect();
        let clusters = Clusters::new(&balls, 8);
        let far = far(mesh.order, accuracy);
        let single = accuracy >= SINGLE_TO;
        let each = mesh.order * mesh.order;
        let image = |x: &Vec3| ground.map(|plane| plane.image(x));
        let lists = |target: u32| {
            let x = places[target as usize];
            let own = near_elements(&clusters, &balls, &x, far);
            (own, image(&x).map(|x| near_elements(&clusters, &balls, &x, far)).unwrap_or_default())
        };
        // A look at some rows tells how large all will be.
        let some: Vec<u32> =
            representatives.iter().step_by(representatives.len().div_ceil(200).max(1)).copied().collect();
        let pairs: usize = some.par_iter().map(|&t| lists(t)).map(|(a, b)| a.len() + b.len()).sum();
        let pairs = (pairs as f64 / some.len().max(1) as f64 * representatives.len() as f64 * 1.05) as u64;
        let number = if single { 4 } else { 8 };
        let near_bytes = pairs * (4 + number * each as u64);
        let (unknowns, n) = (representatives.len(), places.len());
        let needed = near_bytes + Self::other_bytes(unknowns, n, each, columns.min(TOGETHER), accuracy);
        if needed > max_bytes {
            return Err(SolveError::TooLarge { unknowns, needed, available: max_bytes });
        }
        let repeated = Repeated::new(mesh, assembly, places, representatives, accuracy, &|t| lists(t).0);
        let finer = Finer::new(mesh, assembly, accuracy);
        let near = if single {
            Near::Single(rows(assembly, places, representatives, &repeated, &finer, &lists, &image))
        } else {
            Near::Double(rows(assembly, places, representatives, &repeated, &finer, &lists, &image))
        };
        let mut targets: Vec<Vec3> = representatives.iter().map(|&t| places[t as usize]).collect();
        if let Some(plane) = &ground {
            targets.extend(representatives.iter().map(|&t| plane.image(&places[t as usize])));
        }
        let points = Points::new(places, &targets, accuracy.clamp(1e-11, COARSEST)).map_err(IterativeError::Points)?;
        let tolerance = (RESIDUAL * accuracy).max(1e-12);
        Ok(Self { mesh, symmetry, places, assembly, grounded: ground.is_some(), points, near, tolerance })
    }

    /// Bytes besides those of near elements, from above.
    fn other_bytes(unknowns: usize, points: usize, each: usize, columns: usize, accuracy: f64) -> u64 {
        let (u, n, k) = (unknowns as u64, points as u64, columns as u64);
        let digits = (-accuracy.log10()).clamp(3.0, 11.0);
        let patches = 4 * u * PATCH.max(AROUND * each) as u64;
        let krylov = 8 * u * k * (40.0 + 8.0 * digits) as u64;
        // Whole elements of the assembly, the tree, expansions and charges.
        let sums = n * (150 + 2100 / each as u64) + (n + 2 * u) * k * (100.0 + 12.0 * digits * digits) as u64;
        patches + krylov + sums + (256 << 20)
    }

    /// Bytes of the sparse matrix.
    pub fn bytes(&self) -> u64 {
        let all = match &self.near {
            Near::Single(rows) => rows.iter().map(|r| 4 * (r.elements.len() + r.values.len())).sum::<usize>(),
            Near::Double(rows) => rows.iter().map(|r| 4 * r.elements.len() + 8 * r.values.len()).sum(),
        };
        all as u64 + self.points.bytes()
    }

    fn each(&self) -> usize {
        self.mesh.order * self.mesh.order
    }

    /// Solves in one sector for wanted potentials at all points.
    ///
    /// # Errors
    /// Iterations that do not arrive.
    pub fn solve(
        &self,
        sector: u32,
        wanted: MatRef<'_, f64>,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Solved, SolveError> {
        let (mut of, mut unknowns) = self.symmetry.orbits(sector);
        let leaves = self.sort(&mut of, &mut unknowns);
        // Where the rows of the operator stand.
        let representatives = &self.symmetry.representatives;
        let rows: Vec<u32> =
            unknowns.iter().map(|p| representatives.binary_search(p).map_or(0, |k| k as u32)).collect();
        let patches = match &self.near {
            Near::Single(near) => self.patches(near, &of, &unknowns, &rows, leaves),
            Near::Double(near) => self.patches(near, &of, &unknowns, &rows, leaves),
        };
        let (n, each) = (unknowns.len(), self.each());
        let mut values = Mat::zeros(n, wanted.ncols());
        let mut iterations = 0;
        for first in (0..wanted.ncols()).step_by(TOGETHER) {
            let columns = TOGETHER.min(wanted.ncols() - first);
            let right = Mat::from_fn(n, columns, |i, c| wanted[(unknowns[i] as usize, first + c)]);
            let outcome = krylov::solve(
                |x| self.apply(x, &of, &rows),
                |x| patches.apply(x),
                right.as_ref(),
                self.tolerance,
                MOST,
                |_, residual| {
                    let share = (residual.ln() / self.tolerance.ln()).clamp(0.0, 1.0);
                    progress((first as f64 + share * columns as f64) / wanted.ncols() as f64);
                },
            );
            iterations += outcome.iterations;
            // Also where it is no number.
            // A residual that is no number has not arrived either.
            #[allow(clippy::neg_cmp_op_on_partial_ord)]
            if !(outcome.residual <= self.tolerance) {
                let (residual, iterations, asked) = (outcome.residual, outcome.iterations, self.tolerance);
                return Err(IterativeError::NotConverged { residual, iterations, asked }.into());
            }
            for c in 0..columns {
                for (i, &p) in unknowns.iter().enumerate() {
                    values[(i, first + c)] = outcome.solution[(i, c)] / self.assembly.weights[p as usize % each];
                }
            }
        }
        Ok(Solved { values, of, iterations })
    }

    /// Orders the unknowns of a sector by clusters of elements, and tells the clusters.
    fn sort(&self, of: &mut [Option<(u32, f64)>], unknowns: &mut Vec<u32>) -> Vec<Range<usize>> {
        let each = self.each();
        // Elements with unknowns, each with its run of them.
        let mut elements: Vec<(usize, Range<usize>)> = Vec::new();
        for (u, p) in unknowns.iter().enumerate() {
            let e = *p as usize / each;
            match elements.last_mut() {
                Some((last, run)) if *last == e => run.end = u + 1,
                _ => elements.push((e, u..u + 1)),
            }
        }
        let ball = |e: usize| (self.assembly.elements[e].ball.center, self.assembly.elements[e].ball.reach);
        let balls: Vec<(Vec3, f64)> = elements.iter().map(|(e, _)| ball(*e)).collect();
        let clusters = Clusters::new(&balls, (CLUSTER / each).max(1));
        let (mut sorted, mut place) = (Vec::with_capacity(unknowns.len()), vec![0_u32; unknowns.len()]);
        let mut leaves = Vec::new();
        for leaf in clusters.leaves() {
            let start = sorted.len();
            for &k in &clusters.order[leaf] {
                for u in elements[k as usize].1.clone() {
                    place[u] = sorted.len() as u32;
                    sorted.push(unknowns[u]);
                }
            }
            leaves.push(start..sorted.len());
        }
        for (unknown, _) in of.iter_mut().flatten() {
            *unknown = place[*unknown as usize];
        }
        *unknowns = sorted;
        leaves
    }

    /// Potentials at representatives of charges of orbits.
    fn apply(&self, x: MatRef<'_, f64>, of: &[Option<(u32, f64)>], rows: &[u32]) -> Mat<f64> {
        let (n, k) = (of.len(), x.ncols());
        let charges = Mat::from_fn(n, k, |p, c| of[p].map_or(0.0, |(u, sign)| sign * x[(u as usize, c)]));
        let far = self.points.potentials(charges.as_ref());
        let mut found = match &self.near {
            Near::Single(near) => self.near(near, &charges, rows),
            Near::Double(near) => self.near(near, &charges, rows),
        };
        let images = self.symmetry.representatives.len();
        for c in 0..k {
            for (i, &row) in rows.iter().enumerate() {
                let image = if self.grounded { far[(images + row as usize, c)] } else { 0.0 };
                found[(i, c)] += far[(row as usize, c)] - image;
            }
        }
        found
    }

    fn near<T: Copy + Into<f64> + Sync>(&self, near: &[Row<T>], charges: &Mat<f64>, rows: &[u32]) -> Mat<f64> {
        const CHUNK: usize = 128;
        let (each, k) = (self.each(), charges.ncols());
        let columns: Vec<&[f64]> = (0..k).map(|c| charges.col_as_slice(c)).collect();
        let mut sums = vec![0.0; rows.len() * k];
        sums.par_chunks_mut(CHUNK * k).zip(rows.par_chunks(CHUNK)).for_each(|(sums, rows)| {
            self.assembly.arch.dispatch(|| {
                for (sums, &row) in sums.chunks_exact_mut(k).zip(rows) {
                    let row = &near[row as usize];
                    for (&e, values) in row.elements.iter().zip(row.values.chunks_exact(each)) {
                        let range = e as usize * each..(e as usize + 1) * each;
                        for (sum, column) in sums.iter_mut().zip(&columns) {
                            let mut part = 0.0;
                            for (v, q) in values.iter().zip(&column[range.clone()]) {
                                let v: f64 = (*v).into();
                                part += v * q;
                            }
                            *sum += part;
                        }
                    }
                }
            });
        });
        Mat::from_fn(rows.len(), k, |i, c| sums[i * k + c])
    }

    fn patches<T: Copy + Into<f64> + Sync>(
        &self,
        near: &[Row<T>],
        of: &[Option<(u32, f64)>],
        unknowns: &[u32],
        rows: &[u32],
        leaves: Vec<Range<usize>>,
    ) -> Patches {
        let scratch = || (vec![u32::MAX; unknowns.len()], vec![f64::INFINITY; self.mesh.elements.len()]);
        let blocks = leaves
            .into_par_iter()
            .map_init(scratch, |(places, distances), cluster| {
                self.block(near, of, unknowns, rows, cluster, places, distances)
            })
            .collect();
        Patches::of(blocks)
    }

    /// Rows of the inverse for a cluster. `places` is `u32::MAX` everywhere and `distances` infinite, and are so again
    /// afterwards.
    #[allow(clippy::too_many_arguments)]
    fn block<T: Copy + Into<f64>>(
        &self,
        near: &[Row<T>],
        of: &[Option<(u32, f64)>],
        unknowns: &[u32],
        rows: &[u32],
        cluster: Range<usize>,
        places: &mut [u32],
        distances: &mut [f64],
    ) -> Block {
        let each = self.each();
        let points_of = |e: u32| e as usize * each..(e as usize + 1) * each;
        let mut patch: Vec<u32> = cluster.clone().map(|u| u as u32).collect();
        for &u in &patch {
            places[u as usize] = u - cluster.start as u32;
        }
        // Elements around, nearest first; mirror images stand for what they are images of.
        let mut around: Vec<u32> = Vec::new();
        for u in cluster.clone() {
            let x = &self.places[unknowns[u] as usize];
            let row = &near[rows[u] as usize];
            for &e in &row.elements[..row.own] {
                let ball = &self.assembly.elements[e as usize].ball;
                let distance = &mut distances[e as usize];
                if distance.is_infinite() {
                    around.push(e);
                }
                *distance = distance.min((x - ball.center).norm() - ball.reach);
            }
        }
        around.sort_by(|a, b| distances[*a as usize].total_cmp(&distances[*b as usize]).then(a.cmp(b)));
        let largest = PATCH.max(AROUND * each);
        for &e in &around {
            distances[e as usize] = f64::INFINITY;
            if patch.len() < largest {
                for (u, _) in of[points_of(e)].iter().flatten() {
                    if places[*u as usize] == u32::MAX {
                        places[*u as usize] = patch.len() as u32;
                        patch.push(*u);
                    }
                }
            }
        }
        let m = patch.len();
        // Transposed: a column for each equation.
        let mut matrix = Mat::<f64>::zeros(m, m);
        for (i, &u) in patch.iter().enumerate() {
            let own = unknowns[u as usize] as usize;
            let x = self.places[own];
            let column = matrix.col_as_slice_mut(i);
            let row = &near[rows[u as usize] as usize];
            // What the image of the point sees is left to the iteration.
            for (&e, values) in row.elements[..row.own].iter().zip(row.values.chunks_exact(each)) {
                for (p, value) in points_of(e).zip(values) {
                    let Some((v, sign)) = of[p] else { continue };
                    let place = places[v as usize];
                    if place != u32::MAX {
                        let by_points = if p == own { 0.0 } else { 1.0 / (x - self.places[p]).norm() };
                        column[place as usize] += sign * ((*value).into() + by_points);
                    }
                }
            }
            for (entry, &v) in column.iter_mut().zip(&patch) {
                if *entry == 0.0 && v != u {
                    *entry = 1.0 / (x - self.places[unknowns[v as usize] as usize]).norm();
                }
            }
        }
        for &u in &patch {
            places[u as usize] = u32::MAX;
        }
        let own = cluster.len();
        let mut inverse = Mat::<f64>::from_fn(m, own, |i, j| if i == j { 1.0 } else { 0.0 });
        matrix.partial_piv_lu().solve_in_place(&mut inverse);
        let rows = (0..m).flat_map(|i| (0..own).map(move |j| (i, j))).map(|(i, j)| inverse[(i, j)] as f32).collect();
        Block::new(cluster, patch, rows)
    }
}

/// What elements close to a point do there, computed once where it is the same: grids repeat. Where the integral over the
/// element as a whole is not exact enough, it costs hundreds of times as much.
struct Repeated {
    /// For each representative, close elements in order and the number of their values.
    rows: Vec<Vec<(u32, u32)>>,
    values: Vec<f64>,
    each: usize,
}

/// Elements that differ less than this, relative to their size, are the same but for where they are.
const SAME: f64 = 1e-9;

/// Integrals finer than this are not taken from another place.
const REPEATED_TO: f64 = 1e-8;

/// The point within its element, both elements' forms, and from the one to the other in units of [`SAME`].
type Pair = (u32, u32, u32, [i64; 3]);

impl Repeated {
    fn new(
        mesh: &CurvedMesh,
        assembly: &Assembly,
        places: &[Vec3],
        representatives: &[u32],
        accuracy: f64,
        list: &(dyn Fn(u32) -> Vec<u32> + Sync),
    ) -> Self {
        let each = assembly.weights.len();
        if accuracy < REPEATED_TO {
            return Self { rows: Vec::new(), values: Vec::new(), each };
        }
        let steps = |v: Vec3, unit: f64| -> [i64; 3] { v.map(|x| (x / (SAME * unit)).round() as i64).into() };
        // An element's form: where some of its points are.
        let samples: Vec<Vec<[i64; 3]>> = (0..mesh.elements.len())
            .into_par_iter()
            .map(|e| {
                let (element, patch, ball) = (&mesh.elements[e], mesh.patch_of(e), &assembly.elements[e].ball);
                let rows = [0.07, 0.31, 0.66, 0.94];
                let at = |x: f64, y: f64| {
                    let [xi, eta] = element.parameters(x, y);
                    steps(patch.at(xi, eta) - ball.center, ball.reach)
                };
                let mut samples: Vec<[i64; 3]> = rows.iter().flat_map(|&x| rows.map(|y| at(x, y))).collect();
                samples.push([(ball.reach.ln() / SAME).round() as i64, 0, 0]);
                samples
            })
            .collect();
        let mut forms: HashMap<&[[i64; 3]], u32> = HashMap::new();
        let form: Vec<u32> = samples
            .iter()
            .map(|samples| {
                let next = forms.len() as u32;
                *forms.entry(samples).or_insert(next)
            })
            .collect();
        let pairs: Vec<Vec<(u32, Pair)>> = representatives
            .par_iter()
            .with_min_len(16)
            .map(|&target| {
                let (own, local) = (target as usize / each, target % each as u32);
                let ball = &assembly.elements[own].ball;
                let x = &places[target as usize];
                let mut close = list(target);
                close.retain(|&e| {
                    let other = &assembly.elements[e as usize].ball;
                    e as usize == own || (x - other.center).norm() < assembly.precision.accept * other.reach
                });
                let pair = |e: u32| {
                    let arm = assembly.elements[e as usize].ball.center - ball.center;
                    (e, (local, form[own], form[e as usize], steps(arm, ball.reach)))
                };
                close.into_iter().map(pair).collect()
            })
            .collect();
        let mut known: HashMap<Pair, u32> = HashMap::new();
        let mut first: Vec<(u32, u32)> = Vec::new();
        let rows = representatives
            .iter()
            .zip(pairs)
            .map(|(&target, pairs)| {
                pairs
                    .into_iter()
                    .map(|(e, pair)| {
                        let id = *known.entry(pair).or_insert_with(|| {
                            first.push((target, e));
                            first.len() as u32 - 1
                        });
                        (e, id)
                    })
                    .collect()
            })
            .collect();
        let mut values = vec![0.0; first.len() * each];
        values.par_chunks_mut(each).with_min_len(8).zip(&first).for_each(|(values, &(target, e))| {
            let x = &places[target as usize];
            assembly.arch.dispatch(|| assembly.near(x, Some(target as usize), e as usize, values));
        });
        Self { rows, values, each }
    }

    /// Close elements of a row, in order, and the numbers of their values.
    fn of_row(&self, number: usize) -> std::iter::Peekable<impl Iterator<Item = (u32, u32)> + '_> {
        self.rows.get(number).into_iter().flatten().copied().peekable()
    }

    fn values(&self, id: u32) -> &[f64] {
        &self.values[id as usize * self.each..(id as usize + 1) * self.each]
    }
}

/// Elements at some distance by more points than their own, the polynomials between those known beforehand: a tenth of the
/// work of [`Assembly::near`], and most near elements are not very near.
struct Finer {
    /// From how many times its reach on it is exact enough for an element.
    from: f64,
    /// Coordinates of the points, element after element.
    places: [Vec<f64>; 3],
    /// Points of an element.
    count: usize,
    /// For each point its weight times the polynomials that are one at one of the element's own points.
    weights: Vec<f64>,
    each: usize,
}

impl Finer {
    /// With three points more along each side.
    fn new(mesh: &CurvedMesh, assembly: &Assembly, accuracy: f64) -> Self {
        let order = mesh.order + 3;
        // ρ^-(2n - order + 1), as in `Precision`.
        let rho = (0.05 * accuracy).clamp(1e-13, 1.0).powf(-1.0 / (mesh.order + 7) as f64);
        let points = CurvedMesh { order, ..mesh.clone() }.points();
        let (rule, transform) = (gauss(order), Transform::new(mesh.order));
        let basis: Vec<Vec<f64>> = rule
            .points
            .iter()
            .map(|x| {
                let p = legendre(*x);
                (0..mesh.order).map(|k| (0..mesh.order).map(|l| transform.matrix[l][k] * p[l]).sum()).collect()
            })
            .collect();
        let mut weights = Vec::new();
        for (u, wu) in basis.iter().zip(&rule.weights) {
            for (v, wv) in basis.iter().zip(&rule.weights) {
                weights.extend(u.iter().flat_map(|a| v.iter().map(move |b| wu * wv * a * b)));
            }
        }
        Self {
            from: (0.5 * (rho + 1.0 / rho)).max(assembly.precision.accept),
            places: [0, 1, 2].map(|k| points.iter().map(|p| p[k]).collect()),
            count: order * order,
            weights,
            each: mesh.order * mesh.order,
        }
    }

    #[inline(always)]
    fn integrates(&self, assembly: &Assembly, x: &Vec3, e: usize) -> bool {
        let ball = &assembly.elements[e].ball;
        (x - ball.center).norm_squared() >= (self.from * ball.reach).powi(2)
    }

    #[inline(always)]
    fn row(&self, x: &Vec3, e: usize, row: &mut [f64]) {
        // The largest order and three more.
        let mut inverse = [0.0; 11 * 11];
        let range = e * self.count..(e + 1) * self.count;
        let [xs, ys, zs] = [0, 1, 2].map(|k| &self.places[k][range.clone()]);
        for (((inverse, px), py), pz) in inverse.iter_mut().zip(xs).zip(ys).zip(zs) {
            let (a, b, c) = (px - x.x, py - x.y, pz - x.z);
            *inverse = 1.0 / (a * a + b * b + c * c).sqrt();
        }
        row.fill(0.0);
        for (inverse, weights) in inverse.iter().zip(self.weights.chunks_exact(self.each)) {
            for (value, w) in row.iter_mut().zip(weights) {
                *value += w * inverse;
            }
        }
    }
}

/// The rows of all representatives.
fn rows<T: Number>(
    assembly: &Assembly,
    places: &[Vec3],
    representatives: &[u32],
    repeated: &Repeated,
    finer: &Finer,
    lists: &(dyn Fn(u32) -> (Vec<u32>, Vec<u32>) + Sync),
    image: &(dyn Fn(&Vec3) -> Option<Vec3> + Sync),
) -> Vec<Row<T>> {
    let weights = &assembly.weights;
    let each = weights.len();
    representatives
        .par_iter()
        .with_min_len(8)
        .enumerate()
        .map(|(number, &target)| {
            let (own, images) = lists(target);
            let mut known = repeated.of_row(number);
            let mut values: Vec<T> = Vec::with_capacity((own.len() + images.len()) * each);
            let x = places[target as usize];
            let mut exact = vec![0.0; each];
            let mut add = |x: &Vec3, target: Option<usize>, sign: f64, elements: &[u32]| {
                assembly.arch.dispatch(|| {
                    for &e in elements {
                        match known.next_if(|(of, _)| target.is_some() && *of == e) {
                            Some((_, id)) => exact.copy_from_slice(repeated.values(id)),
                            None if finer.integrates(assembly, x, e as usize) => finer.row(x, e as usize, &mut exact),
                            None => assembly.near(x, target, e as usize, &mut exact),
                        }
                        let first = e as usize * each;
                        for k in 0..each {
                            // Source and target at one place do not act on each other by multipoles.
                            let same = target == Some(first + k);
                            let by_points = if same { 0.0 } else { 1.0 / (x - places[first + k]).norm() };
                            values.push(T::rounded(sign * (exact[k] / weights[k] - by_points)));
                        }
                    }
                });
            };
            add(&x, Some(target as usize), 1.0, &own);
            if let Some(below) = image(&x) {
                add(&below, None, -1.0, &images);
            }
            Row { own: own.len(), elements: own.into_iter().chain(images).collect(), values }
        })
        .collect()
}

/// A number of a row.
trait Number: Copy + Into<f64> + Send + Sync {
    fn rounded(value: f64) -> Self;
}

impl Number for f32 {
    fn rounded(value: f64) -> Self {
        value as Self
    }
}

impl Number for f64 {
    fn rounded(value: f64) -> Self {
        value
    }
}
