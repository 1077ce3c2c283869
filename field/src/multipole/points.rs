//! Potentials of many point charges at many points.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use meshes::Vec3;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

use super::near::{self, Coordinates, Sources};
use super::solid::{Family, Relative, Scatter, gather, gradient_forms, padded, parts};
use super::translation::{Grade, Number, Translations, direction_number, sign_number};
use super::tree::{Lists, Octree, Shape};

/// Why points cannot be summed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PointsError {
    /// A coordinate is infinite or not a number.
    #[error("{what} number {index} is not at a finite position")]
    NotFinite {
        /// Source or target.
        what: &'static str,
        /// Which, from 0.
        index: usize,
    },
    /// The accuracy asked for is out of range.
    #[error("the accuracy {asked:e} is not between 1e-11 and 1")]
    Accuracy {
        /// What was asked.
        asked: f64,
    },
    /// More points than an index holds.
    #[error("{count} points are more than can be numbered (2³² - 1)")]
    TooMany {
        /// How many.
        count: usize,
    },
}

/// Sources and targets in an octree, ready for any number of charges: Σ_j q_j / |x_i - y_j| by the fast multipole method.
///
/// The sum over far sources goes through expansions in solid harmonics between cubes of one size, whose translations are
/// products with dense matrices of reduced rank; near ones act point by point. Source and target at the same place do not
/// act on each other. Results do not depend on the number of threads.
///
/// Source: Greengard and Rokhlin 1997; Cheng, Greengard and Rokhlin 1999 for the lists of the adaptive tree.
#[derive(Clone, Debug)]
pub struct Points {
    tree: Octree,
    lists: Vec<Lists>,
    batches: Vec<Batch>,
    translations: Arc<Translations>,
    sources: Coordinates,
    targets: Coordinates,
    reach2: Vec<f64>,
    single: bool,
    arch: Arch,
}

/// Translations to a run of nodes of one level.
#[derive(Clone, Debug)]
struct Batch {
    nodes: Range<usize>,
    /// Sorted by direction.
    pairs: Vec<Pair>,
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    direction: u8,
    sign: u8,
    /// Place in the batch.
    target: u16,
    source: u32,
}

/// Nodes whose translations are done together: enough for pairs of one direction to fill a product of matrices.
const BATCH: usize = 256;

/// Columns of one product of matrices: with 50 to 200 rows they stay in the second cache.
const PRODUCT: usize = 96;

/// Degree and the rest that an accuracy takes, from gradients of charges of random sign in a cube, which need most: errors
/// 4e-4 at degree 6, 6e-5 at 8, 9e-6 at 10, 6e-7 at 14, 1e-7 at 17, 2e-8 at 20, each with a reduced basis that leaves an eighth
/// of it. Potentials of the same charges are four times as good, those of charges of one sign ten times.
fn grade(accuracy: f64) -> (Grade, Shape) {
    let digits = -accuracy.log10();
    let degree = if digits < 6.0 { 2.6 * digits - 2.0 } else { 13.6 + 5.0 * (digits - 6.0) };
    let degree = (degree.ceil() as usize).max(1);
    let grade = Grade { degree, cut: CUT * accuracy, single: accuracy >= SINGLE_TO };
    (grade, shape(grade))
}

/// Points of a leaf for each number of the reduced basis: translations, whose work goes with the square of the rank, take as
/// long then as near pairs. In double precision they take twice as long.
const LEAF_SINGLE: f64 = 2.0;
const LEAF_DOUBLE: f64 = 1.6;

/// The tree's shape for a grade.
fn shape(grade: Grade) -> Shape {
    let rank = Translations::of(grade).rank;
    let leaf = if grade.single { LEAF_SINGLE } else { LEAF_DOUBLE } * rank as f64;
    // A translation is worth rank²/100 pairs or so, a value of an expansion as many points as it has numbers.
    Shape { leaf: (leaf as usize).max(30), pairs: (rank * rank / 40).max(30), single: parts(grade.degree) }
}

/// Share of the accuracy that the reduced basis may take: 0.2 leaves errors just above what was asked.
const CUT: f64 = 0.08;

/// Finest accuracy with translations in single precision: their rounding is 6e-8 of the largest number, ten times that in sums.
const SINGLE_TO: f64 = 5e-6;

impl Points {
    /// Prepares the sum over `sources` (m) at `targets` (m) to a relative accuracy: root mean square of the errors over that
    /// of the potentials, likewise of the gradients. Where sources cancel each other, as inside a closed shell, errors are
    /// relative to what they would give without.
    ///
    /// # Errors
    /// See [`PointsError`].
    pub fn new(sources: &[Vec3], targets: &[Vec3], accuracy: f64) -> Result<Self, PointsError> {
        Self::with_reach(sources, targets, &[], accuracy)
    }

    /// As [`Points::new`]; a source does not act on targets nearer than its `reach` (m, one for each source, or none at all).
    pub(super) fn with_reach(
        sources: &[Vec3],
        targets: &[Vec3],
        reach: &[f64],
        accuracy: f64,
    ) -> Result<Self, PointsError> {
        if !(1e-11..=1.0).contains(&accuracy) {
            return Err(PointsError::Accuracy { asked: accuracy });
        }
        for (what, points) in [("source", sources), ("target", targets)] {
            if points.len() >= u32::MAX as usize {
                return Err(PointsError::TooMany { count: points.len() });
            }
            if let Some(index) = points.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
                return Err(PointsError::NotFinite { what, index });
            }
        }
        let (grade, shape) = grade(accuracy);
        Ok(Self::with_grade(sources, targets, reach, grade, shape))
    }

    pub(super) fn with_grade(sources: &[Vec3], targets: &[Vec3], reach: &[f64], grade: Grade, shape: Shape) -> Self {
        let translations = Translations::of(grade);
        let tree = Octree::new(sources, targets, reach, &shape);
        let mut lists = tree.lists(&shape);
        let runs: Vec<Range<usize>> = tree
            .levels
            .iter()
            .flat_map(|level| {
                let end = level.end;
                level.clone().step_by(BATCH).map(move |first| first..(first + BATCH).min(end))
            })
            .collect();
        let batches = runs
            .into_par_iter()
            .map(|nodes| {
                let mut pairs: Vec<Pair> = nodes
                    .clone()
                    .flat_map(|n| lists[n].translated.iter().map(move |&(source, d)| (n, source, d)))
                    .map(|(n, source, d)| Pair {
                        direction: direction_number(d) as u8,
                        sign: sign_number(d) as u8,
                        target: (n - nodes.start) as u16,
                        source,
                    })
                    .collect();
                pairs.sort_by_key(|pair| pair.direction);
                Batch { nodes, pairs }
            })
            .collect();
        for list in &mut lists {
            list.translated = Vec::new();
        }
        Self {
            sources: Coordinates::new(sources, &tree.source_order),
            targets: Coordinates::new(targets, &tree.target_order),
            reach2: if reach.is_empty() {
                Vec::new()
            } else {
                tree.source_order.iter().map(|&i| reach[i as usize].powi(2)).collect()
            },
            tree,
            lists,
            batches,
            translations,
            single: grade.single,
            arch: Arch::new(),
        }
    }

    /// Number of sources.
    pub fn sources(&self) -> usize {
        self.tree.source_order.len()
    }

    /// Number of targets.
    pub fn targets(&self) -> usize {
        self.tree.target_order.len()
    }

    /// Bytes that stay allocated.
    pub fn bytes(&self) -> u64 {
        let tree = self.tree.nodes.len() * size_of::<super::tree::Node>()
            + 4 * (self.sources() + self.targets())
            + 8 * (3 * (self.sources() + self.targets()) + self.reach2.len());
        let lists: usize = self
            .lists
            .iter()
            .map(|l| {
                size_of::<Lists>() + 8 * l.direct.capacity() + 4 * (l.sources.capacity() + l.multipoles.capacity())
            })
            .sum();
        let pairs: usize = self.batches.iter().map(|b| b.pairs.capacity() * size_of::<Pair>()).sum();
        (tree + lists + pairs) as u64 + self.translations.bytes()
    }

    /// Bytes that one application to so many columns allocates besides.
    pub fn bytes_applied(&self, columns: usize, gradients: bool) -> u64 {
        let number = if self.single { 4 } else { 8 };
        let (n, r) = (parts(self.translations.degree), self.translations.rank);
        let outputs = columns * if gradients { 4 } else { 1 };
        (self.tree.nodes.len() * columns * (16 * n + 2 * number * r)
            + 8 * (columns * self.sources() + 2 * outputs * self.targets())) as u64
    }

    /// Σ_j q_j / |x_i - y_j|, `targets × columns`, of charges `sources × columns`.
    ///
    /// # Panics
    /// The charges have another number of rows than there are sources.
    pub fn potentials(&self, charges: MatRef<'_, f64>) -> Mat<f64> {
        self.apply(charges, false)
    }

    /// Potentials as [`Points::potentials`], and their gradients with respect to x_i, `targets × 4 columns`: for each column
    /// of charges potential, then slopes along x, y, z.
    ///
    /// # Panics
    /// As [`Points::potentials`].
    pub fn potentials_and_gradients(&self, charges: MatRef<'_, f64>) -> Mat<f64> {
        self.apply(charges, true)
    }

    fn apply(&self, charges: MatRef<'_, f64>, gradients: bool) -> Mat<f64> {
        assert_eq!(charges.nrows(), self.sources(), "one row of charges for each source");
        let columns = charges.ncols();
        let outputs = columns * if gradients { 4 } else { 1 };
        let mut result = Mat::zeros(self.targets(), outputs);
        if columns == 0 || self.sources() == 0 || self.targets() == 0 {
            return result;
        }
        let sorted: Vec<Vec<f64>> = (0..columns)
            .into_par_iter()
            .map(|c| self.tree.source_order.iter().map(|&i| charges[(i as usize, c)]).collect())
            .collect();
        let sorted: Vec<&[f64]> = sorted.iter().map(Vec::as_slice).collect();
        let values =
            if self.single { self.values::<f32>(&sorted, gradients) } else { self.values::<f64>(&sorted, gradients) };
        // Leaf by leaf, output by output.
        for leaf in self.tree.nodes.iter().filter(|n| n.is_leaf() && !n.targets.is_empty()) {
            let range = leaf.target_range();
            let block = &values[outputs * range.start..outputs * range.end];
            for (o, block) in block.chunks_exact(range.len()).enumerate() {
                for (t, value) in range.clone().zip(block) {
                    result[(self.tree.target_order[t] as usize, o)] = *value;
                }
            }
        }
        result
    }

    fn values<T: Number>(&self, charges: &[&[f64]], gradients: bool) -> Vec<f64> {
        let moments = self.moments(charges);
        let locals = self.locals::<T>(charges, &moments);
        self.evaluate(charges, &moments, &locals, gradients)
    }

    /// Multipoles of all nodes, `parts` numbers for each column of each node.
    fn moments(&self, charges: &[&[f64]]) -> Vec<f64> {
        let degree = self.translations.degree;
        let (n, k) = (parts(degree), charges.len());
        let mut moments = vec![0.0; self.tree.nodes.len() * k * n];
        moments.par_chunks_mut(k * n).zip(&self.tree.nodes).with_min_len(8).for_each_init(
            Relative::default,
            |relative, (moments, node)| {
                if node.is_leaf() && !node.sources.is_empty() {
                    let range = node.source_range();
                    relative.set(self.sources.lists(), range.clone(), &self.tree.center(node), self.tree.half(node));
                    let charges: Vec<&[f64]> = charges.iter().map(|q| &q[range.clone()]).collect();
                    gather(self.arch, Family::Regular, degree, relative, &charges, moments);
                }
            },
        );
        for level in (1..self.tree.levels.len().saturating_sub(1)).rev() {
            let range = self.tree.levels[level].clone();
            let (above, below) = moments.split_at_mut(range.end * k * n);
            let above = &mut above[range.start * k * n..];
            above.par_chunks_mut(SIBLINGS * k * n).enumerate().for_each(|(chunk, above)| {
                let first = range.start + chunk * SIBLINGS;
                let nodes = &self.tree.nodes[first..first + above.len() / (k * n)];
                let (mut from, mut to) = (Vec::new(), Vec::new());
                for (octant, matrix) in self.translations.to_parent.iter().enumerate() {
                    from.clear();
                    let mut parents = Vec::new();
                    for (p, node) in nodes.iter().enumerate() {
                        for c in node.child_range() {
                            let child = &self.tree.nodes[c];
                            if child.octant() == octant && !child.sources.is_empty() {
                                parents.push(p);
                                let at = (c - range.end) * k * n;
                                from.extend_from_slice(&below[at..at + k * n]);
                            }
                        }
                    }
                    to.resize(from.len(), 0.0);
                    product(matrix.as_ref(), &from, &mut to, 1.0, Accum::Replace);
                    for (p, to) in parents.into_iter().zip(to.chunks_exact(k * n)) {
                        add(self.arch, &mut above[p * k * n..(p + 1) * k * n], to);
                    }
                }
            });
        }
        moments
    }

    /// Local expansions of all nodes, in the same places as the multipoles.
    fn locals<T: Number>(&self, charges: &[&[f64]], moments: &[f64]) -> Vec<f64> {
        let Translations { degree, rank, reduction, to_parent, .. } = &*self.translations;
        let (n, r, k) = (parts(*degree), *rank, charges.len());
        let count = self.tree.nodes.len();
        let mut reduced = vec![T::of(0.0); count * k * r];
        reduced.par_chunks_mut(BATCH * k * r).zip(moments.par_chunks(BATCH * k * n)).for_each(|(reduced, moments)| {
            let mut wide = vec![0.0; reduced.len()];
            product(reduction.as_ref(), moments, &mut wide, 1.0, Accum::Replace);
            for (narrow, wide) in reduced.iter_mut().zip(wide) {
                *narrow = T::of(wide);
            }
        });
        let mut across = vec![T::of(0.0); count * k * r];
        let mut places = Vec::new();
        let mut rest = across.as_mut_slice();
        for batch in &self.batches {
            let (these, others) = rest.split_at_mut(batch.nodes.len() * k * r);
            places.push((batch, these));
            rest = others;
        }
        places.into_par_iter().for_each(|(batch, into)| self.translate(batch, k, &reduced, into));
        drop(reduced);
        let mut locals = vec![0.0; count * k * n];
        for range in self.tree.levels.iter().skip(1) {
            let (above, below) = locals.split_at_mut(range.start * k * n);
            let below = &mut below[..range.len() * k * n];
            let length = self.tree.half(&self.tree.nodes[range.start]);
            let across = &across[range.start * k * r..range.end * k * r];
            let chunks = below.par_chunks_mut(SIBLINGS * k * n).zip(across.par_chunks(SIBLINGS * k * r));
            chunks.enumerate().for_each(|(chunk, (below, across))| {
                let first = range.start + chunk * SIBLINGS;
                let nodes = &self.tree.nodes[first..first + below.len() / (k * n)];
                let wide: Vec<f64> = across.iter().map(|v| v.wide()).collect();
                product(reduction.transpose(), &wide, below, 1.0 / length, Accum::Replace);
                let (mut from, mut to) = (Vec::new(), Vec::new());
                for (octant, matrix) in to_parent.iter().enumerate() {
                    let these: Vec<usize> = (0..nodes.len())
                        .filter(|&p| nodes[p].octant() == octant && !nodes[p].targets.is_empty())
                        .collect();
                    from.clear();
                    for &p in &these {
                        let at = nodes[p].parent as usize * k * n;
                        from.extend_from_slice(&above[at..at + k * n]);
                    }
                    to.resize(from.len(), 0.0);
                    product(matrix.transpose(), &from, &mut to, 1.0, Accum::Replace);
                    for (p, to) in these.into_iter().zip(to.chunks_exact(k * n)) {
                        add(self.arch, &mut below[p * k * n..(p + 1) * k * n], to);
                    }
                }
                for (p, node) in nodes.iter().enumerate() {
                    self.single_sources(first + p, node, charges, &mut below[p * k * n..(p + 1) * k * n]);
                }
            });
        }
        locals
    }

    /// Adds the sources of larger leaves to a node's local expansions.
    fn single_sources(&self, n: usize, node: &super::tree::Node, charges: &[&[f64]], local: &mut [f64]) {
        if self.lists[n].sources.is_empty() {
            return;
        }
        let degree = self.translations.degree;
        let (center, length) = (self.tree.center(node), self.tree.half(node));
        let mut relative = Relative::default();
        let mut sums = vec![0.0; local.len()];
        for &s in &self.lists[n].sources {
            let range = self.tree.nodes[s as usize].source_range();
            relative.set(self.sources.lists(), range.clone(), &center, length);
            let charges: Vec<&[f64]> = charges.iter().map(|q| &q[range.clone()]).collect();
            gather(self.arch, Family::Irregular, degree, &relative, &charges, &mut sums);
        }
        for (local, sums) in local.chunks_exact_mut(parts(degree)).zip(sums.chunks_exact(parts(degree))) {
            for (k, factor) in doubled(degree).enumerate() {
                local[k] += factor * sums[k] / length;
            }
        }
    }

    /// Translations of one batch.
    fn translate<T: Number>(&self, batch: &Batch, k: usize, reduced: &[T], into: &mut [T]) {
        let r = self.translations.rank;
        let matrices = T::matrices(&self.translations.across);
        let signs: Vec<Vec<T>> =
            self.translations.signs.iter().map(|s| s.iter().map(|v| T::of(*v)).collect()).collect();
        let mut from = vec![T::of(0.0); PRODUCT.max(k) * r];
        let mut to = from.clone();
        for run in batch.pairs.chunk_by(|a, b| a.direction == b.direction) {
            let matrix = matrices[run[0].direction as usize].as_ref();
            for pairs in run.chunks((PRODUCT / k).max(1)) {
                let size = pairs.len() * k * r;
                self.arch.dispatch(|| {
                    for (pair, from) in pairs.iter().zip(from.chunks_exact_mut(k * r)) {
                        let source = &reduced[pair.source as usize * k * r..][..k * r];
                        let sign = &signs[pair.sign as usize];
                        for (from, source) in from.chunks_exact_mut(r).zip(source.chunks_exact(r)) {
                            signed(from, source, sign);
                        }
                    }
                });
                let (from, to) = (&from[..size], &mut to[..size]);
                matmul(
                    MatMut::from_column_major_slice_mut(to, r, pairs.len() * k),
                    Accum::Replace,
                    matrix,
                    MatRef::from_column_major_slice(from, r, pairs.len() * k),
                    T::of(1.0),
                    Par::Seq,
                );
                self.arch.dispatch(|| {
                    for (pair, to) in pairs.iter().zip(to.chunks_exact(k * r)) {
                        let target = &mut into[pair.target as usize * k * r..][..k * r];
                        let sign = &signs[pair.sign as usize];
                        for (target, to) in target.chunks_exact_mut(r).zip(to.chunks_exact(r)) {
                            add_signed(target, to, sign);
                        }
                    }
                });
            }
        }
    }

    /// Values at all targets, leaf by leaf.
    fn evaluate(&self, charges: &[&[f64]], moments: &[f64], locals: &[f64], gradients: bool) -> Vec<f64> {
        let k = charges.len();
        let outputs = k * if gradients { 4 } else { 1 };
        let mut values = vec![0.0; outputs * self.targets()];
        let mut leaves: Vec<usize> = (0..self.tree.nodes.len())
            .filter(|&n| self.tree.nodes[n].is_leaf() && !self.tree.nodes[n].targets.is_empty())
            .collect();
        leaves.sort_unstable_by_key(|&n| self.tree.nodes[n].targets.start);
        let mut places = Vec::with_capacity(leaves.len());
        let mut rest = values.as_mut_slice();
        for n in leaves {
            let (these, others) = rest.split_at_mut(outputs * self.tree.nodes[n].targets.len());
            places.push((n, these));
            rest = others;
        }
        let sources = Sources { at: &self.sources, reach2: &self.reach2, charges };
        places.into_par_iter().for_each_init(Relative::default, |relative, (leaf, out)| {
            let node = &self.tree.nodes[leaf];
            let range = node.target_range();
            let mut expansion = |n: usize, family: Family, coefficients: &[f64], out: &mut [f64]| {
                let node = &self.tree.nodes[n];
                let length = self.tree.half(node);
                relative.set(self.targets.lists(), range.clone(), &self.tree.center(node), length);
                let degree = self.translations.degree;
                let (forms, degree) = forms(family, degree, coefficients, length, k, gradients);
                let stride = range.len();
                Scatter { family, degree, points: relative, forms: &forms, outputs, out, stride }.run(self.arch);
            };
            let size = k * parts(self.translations.degree);
            expansion(leaf, Family::Regular, &locals[leaf * size..(leaf + 1) * size], out);
            for &m in &self.lists[leaf].multipoles {
                let m = m as usize;
                expansion(m, Family::Irregular, &moments[m * size..(m + 1) * size], out);
            }
            let mut n = leaf;
            loop {
                let direct = &self.lists[n].direct;
                if !direct.is_empty() {
                    let all = range.clone();
                    near::add(self.arch, &sources, direct, (&self.targets, all), gradients, out, range.len());
                }
                if n == 0 {
                    break;
                }
                n = self.tree.nodes[n].parent as usize;
            }
        });
        values
    }
}

/// Nodes whose expansions go to parents or come from them together.
const SIBLINGS: usize = 64;

/// 1 for m = 0 and 2 for the parts of all others.
fn doubled(degree: usize) -> impl Iterator<Item = f64> {
    (0..=degree).flat_map(|l| (0..=2 * l).map(|part| if part == 0 { 1.0 } else { 2.0 }))
}

/// The forms that give potentials, and gradients if wanted, from k expansions about a centre with a length; and their degree.
fn forms(
    family: Family,
    degree: usize,
    coefficients: &[f64],
    length: f64,
    k: usize,
    gradients: bool,
) -> (Vec<f64>, usize) {
    let n = parts(degree);
    let regular = family == Family::Regular;
    let top = if gradients && !regular { degree + 1 } else { degree };
    let outputs = k * if gradients { 4 } else { 1 };
    let width = padded(outputs);
    let mut all = vec![0.0; parts(top) * width];
    for (c, coefficients) in coefficients.chunks_exact(n).enumerate() {
        let form: Vec<f64> = if regular {
            coefficients.to_vec()
        } else {
            coefficients.iter().zip(doubled(degree)).map(|(v, factor)| v * factor / length).collect()
        };
        let first = c * if gradients { 4 } else { 1 };
        for (part, value) in form.iter().enumerate() {
            all[part * width + first] = *value;
        }
        if gradients {
            let mut slopes: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; parts(top)]);
            gradient_forms(family, degree, &form, &mut slopes);
            for (axis, slopes) in slopes.iter().enumerate() {
                for (part, value) in slopes.iter().enumerate() {
                    all[part * width + first + axis + 1] = value / length;
                }
            }
        }
    }
    (all, top)
}

/// `to (+)= factor · matrix · from`, vectors side by side.
fn product(matrix: MatRef<'_, f64>, from: &[f64], to: &mut [f64], factor: f64, accum: Accum) {
    let columns = from.len() / matrix.ncols();
    if columns > 0 {
        let from = MatRef::from_column_major_slice(from, matrix.ncols(), columns);
        let to = MatMut::from_column_major_slice_mut(to, matrix.nrows(), columns);
        matmul(to, accum, matrix, from, factor, Par::Seq);
    }
}

fn add(arch: Arch, to: &mut [f64], from: &[f64]) {
    arch.dispatch(|| {
        for (to, from) in to.iter_mut().zip(from) {
            *to += from;
        }
    });
}

#[inline(always)]
fn signed<T: Number>(to: &mut [T], from: &[T], sign: &[T]) {
    for ((to, from), sign) in to.iter_mut().zip(from).zip(sign) {
        *to = from.mul(*sign);
    }
}

#[inline(always)]
fn add_signed<T: Number>(to: &mut [T], from: &[T], sign: &[T]) {
    for ((to, from), sign) in to.iter_mut().zip(from).zip(sign) {
        *to = to.add(from.mul(*sign));
    }
}
