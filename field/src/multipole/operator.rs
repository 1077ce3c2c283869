//! The Galerkin matrix of potential coefficients, far panels by multipoles and near ones from a sparse matrix.

use faer::{Mat, MatRef};
use meshes::{Vec3, triangle};
use pulp::Arch;
use rayon::prelude::*;

use super::close::{Weighted, potential};
use super::clusters::Clusters;
use super::points::{Points, PointsError};
use crate::influence;
use crate::linear_operator::LinearOperator;
use crate::panel::{Panel, quadrature};

/// The matrix of [`crate::influence::potential_coefficients`] (Galerkin, 1/m) as an operator: panels act as the points of a
/// quadrature rule through [`Points`], and what near pairs have more than their points is added from a sparse matrix.
///
/// Charges go in, one row for each panel and one column for each problem; mean potentials over Coulomb's constant come out.
pub struct PanelOperator<'a> {
    panels: &'a [Panel],
    pub(super) clusters: Clusters,
    points: Points,
    /// Weights of the rule.
    weights: Vec<f64>,
    pub(super) near: Near,
    arch: Arch,
}

/// What near panels have more than their points, row by row, in the order of the clusters.
#[derive(Clone, Debug)]
pub(super) struct Near {
    /// Where each row starts, one more than rows.
    pub starts: Vec<usize>,
    /// Places of the columns.
    pub columns: Vec<u32>,
    pub values: Values,
    /// The entries themselves, as long as an approximate inverse is to be made of them.
    pub entries: Vec<f32>,
}

/// Entries in single precision where that is enough.
#[derive(Clone, Debug)]
pub(super) enum Values {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

/// How panels are replaced by points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scheme {
    /// Degree of the rule.
    pub degree: usize,
    /// Pairs nearer than this, in units of the sum of both radii, are corrected.
    pub near: f64,
    /// From this distance on, in the same units, entries are by a rule of degree 5 rather than by the closed form: at 1.5 that
    /// changes the potentials of random charges by 1e-6, at 3 by 1e-8.
    pub rules_from: f64,
    /// Accuracy of the sum over points.
    pub accuracy: f64,
    /// Whether near entries are in single precision.
    pub single: bool,
}

/// Degrees of the outer rule, and the distance over the smaller radius below which panels touch: those of
/// [`crate::influence`], so that near entries are the same. Checked by `operator_is_the_dense_matrix`.
const OUTER_APART: usize = 5;
const OUTER_NEAR: usize = 8;
const OUTER_TOUCHING: usize = 12;
const TOUCHING: f64 = 0.25;

/// Panels of one cluster.
pub(super) const CLUSTER: usize = 40;

impl Scheme {
    /// For errors of the potential below `accuracy` (root mean square, relative).
    pub fn of(accuracy: f64) -> Self {
        // Charges of a plate under a thin ring, 2500 panels, against the dense matrix: the first leaves 8e-4 of them (root mean
        // square), the second 3e-5, the third and fourth what the dense matrix itself leaves (2e-5). More points and fewer
        // near pairs is better than the contrary: degree 2 with twice the distance leaves 2e-4.
        let (degree, near, rules_from) = match accuracy {
            3e-4.. => (2, 2.0, 1.5),
            3e-5.. => (4, 1.5, 1.5),
            3e-6.. => (4, 2.5, 2.0),
            1e-7.. => (5, 3.0, 3.0),
            _ => (6, 4.0, 3.0),
        };
        Self { degree, near, rules_from, accuracy, single: accuracy > 3e-8 }
    }
}

impl<'a> PanelOperator<'a> {
    /// Prepares the operator to a relative accuracy: root mean square of the errors of the potential over that of the
    /// potentials. `progress` hears the fraction of the near entries that are done, from any thread.
    ///
    /// # Errors
    /// A corner is not finite, or the accuracy not between 1e-11 and 1.
    pub fn new(panels: &'a [Panel], accuracy: f64) -> Result<Self, PointsError> {
        let mut operator = Self::with_scheme(panels, Scheme::of(accuracy))?;
        operator.forget_entries();
        Ok(operator)
    }

    /// Entries are needed no more for an approximate inverse.
    pub(super) fn forget_entries(&mut self) {
        self.near.entries = Vec::new();
    }

    pub(super) fn with_scheme(panels: &'a [Panel], scheme: Scheme) -> Result<Self, PointsError> {
        let rule = quadrature::rule(scheme.degree);
        let balls: Vec<(Vec3, f64)> = panels.iter().map(|p| (p.centroid, p.radius)).collect();
        let clusters = Clusters::new(&balls, CLUSTER);
        let points: Vec<Vec3> =
            clusters.order.iter().flat_map(|&p| rule.on(&panels[p as usize].corners).map(|(x, _)| x)).collect();
        let sum = Points::new(&points, &points, scheme.accuracy)?;
        let arch = Arch::new();
        let near = Near::new(panels, &clusters, &points, &rule.weights, &scheme, arch);
        Ok(Self { panels, clusters, points: sum, weights: rule.weights.clone(), near, arch })
    }

    /// Bytes that stay allocated.
    pub fn bytes(&self) -> u64 {
        let values = match &self.near.values {
            Values::Single(v) => 4 * v.len(),
            Values::Double(v) => 8 * v.len(),
        };
        let near = values + 4 * (self.near.columns.len() + self.near.entries.len()) + 8 * self.near.starts.len();
        self.points.bytes() + near as u64 + 4 * self.panels.len() as u64
    }

    /// Pairs of panels whose entries are stored.
    pub fn near_pairs(&self) -> usize {
        self.near.columns.len()
    }

    /// Mean potentials over Coulomb's constant, `panels × columns`, of charges of the same shape. The result does not depend
    /// on the number of threads.
    ///
    /// # Panics
    /// The charges have another number of rows than there are panels.
    pub fn apply_columns(&self, charges: MatRef<'_, f64>) -> Mat<f64> {
        let order = &self.clusters.order;
        let sorted = Mat::from_fn(charges.nrows(), charges.ncols(), |i, c| charges[(order[i] as usize, c)]);
        let found = self.apply_sorted(sorted.as_ref());
        let mut result = Mat::zeros(found.nrows(), found.ncols());
        for c in 0..found.ncols() {
            for (i, &p) in order.iter().enumerate() {
                result[(p as usize, c)] = found[(i, c)];
            }
        }
        result
    }

    /// As [`PanelOperator::apply_columns`], in the order of the clusters.
    pub(super) fn apply_sorted(&self, charges: MatRef<'_, f64>) -> Mat<f64> {
        assert_eq!(charges.nrows(), self.panels.len(), "one row of charges for each panel");
        let (n, k, q) = (charges.nrows(), charges.ncols(), self.weights.len());
        let spread = Mat::from_fn(n * q, k, |i, c| charges[(i / q, c)] * self.weights[i % q]);
        let far = self.points.potentials(spread.as_ref());
        let rows: Vec<f64> = (0..n).flat_map(|i| (0..k).map(move |c| (i, c))).map(|(i, c)| charges[(i, c)]).collect();
        let mut sums = vec![0.0; n * k];
        match &self.near.values {
            Values::Single(values) => self.near.add(self.arch, values, &rows, k, &mut sums),
            Values::Double(values) => self.near.add(self.arch, values, &rows, k, &mut sums),
        }
        Mat::from_fn(n, k, |i, c| {
            let mean: f64 = self.weights.iter().enumerate().map(|(a, w)| w * far[(i * q + a, c)]).sum();
            sums[i * k + c] + mean
        })
    }

    pub(super) fn panels(&self) -> &'a [Panel] {
        self.panels
    }

    /// Bytes that one application allocates.
    pub fn bytes_applied(&self, columns: usize) -> u64 {
        let n = (self.panels.len() * columns) as u64;
        self.points.bytes_applied(columns, false) + 8 * n * (2 * self.weights.len() as u64 + 3)
    }
}

impl LinearOperator for PanelOperator<'_> {
    fn rows(&self) -> usize {
        self.panels.len()
    }

    fn cols(&self) -> usize {
        self.panels.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let found = self.apply_columns(MatRef::from_column_major_slice(x, x.len(), 1));
        for (y, found) in y.iter_mut().zip(found.col(0).iter()) {
            *y = *found;
        }
    }
}

impl Near {
    fn new(
        panels: &[Panel],
        clusters: &Clusters,
        points: &[Vec3],
        weights: &[f64],
        scheme: &Scheme,
        arch: Arch,
    ) -> Self {
        let n = panels.len();
        let q = weights.len();
        let order = &clusters.order;
        let at = |place: usize| &panels[order[place] as usize];
        // Above the diagonal and on it.
        let rows: Vec<Vec<(u32, f64, f32)>> = (0..n)
            .into_par_iter()
            .with_min_len(16)
            .map_init(
                || Entries { rules_from: scheme.rules_from, ..Entries::default() },
                |entries, i| {
                    let one = at(i);
                    let mut row = Vec::new();
                    clusters.near(&one.centroid, one.radius, scheme.near, |run| {
                        for j in run.start.max(i)..run.end {
                            let other = at(j);
                            let reach = scheme.near * (one.radius + other.radius);
                            if j == i || (one.centroid - other.centroid).norm_squared() < reach * reach {
                                row.push((j as u32, 0.0, 0.0));
                            }
                        }
                    });
                    row.sort_unstable_by_key(|(j, ..)| *j);
                    entries.start();
                    let own = points[i * q..(i + 1) * q].iter().zip(weights);
                    entries.points.set(own.map(|(x, w)| (*x, *w)));
                    for (j, value, entry) in &mut row {
                        let j = *j as usize;
                        let exact = if i == j {
                            influence::galerkin(one, one, true)
                        } else {
                            entries.galerkin(arch, one, at(j))
                        };
                        let ys = points[j * q..(j + 1) * q].iter().zip(weights);
                        let by_points: f64 = ys.map(|(y, v)| v * entries.points.inverse_distance(arch, y)).sum();
                        *value = exact - by_points;
                        *entry = exact as f32;
                    }
                    row
                },
            )
            .collect();
        let mut counts = vec![0_usize; n + 1];
        for (i, row) in rows.iter().enumerate() {
            counts[i + 1] += row.len();
            for (j, ..) in row.iter().filter(|(j, ..)| *j as usize != i) {
                counts[*j as usize + 1] += 1;
            }
        }
        for i in 0..n {
            counts[i + 1] += counts[i];
        }
        let starts = counts.clone();
        let mut columns = vec![0_u32; starts[n]];
        let mut values =
            if scheme.single { Values::Single(vec![0.0; starts[n]]) } else { Values::Double(vec![0.0; starts[n]]) };
        // Rows in turn, so that those below the diagonal come first and in order.
        let mut entries = vec![0.0_f32; starts[n]];
        let mut put = |i: usize, j: u32, value: f64, entry: f32| {
            let at = counts[i];
            counts[i] += 1;
            columns[at] = j;
            entries[at] = entry;
            match &mut values {
                Values::Single(v) => v[at] = value as f32,
                Values::Double(v) => v[at] = value,
            }
        };
        for (i, row) in rows.into_iter().enumerate() {
            for (j, value, entry) in row {
                put(i, j, value, entry);
                if j as usize != i {
                    put(j as usize, i as u32, value, entry);
                }
            }
        }
        Self { starts, columns, values, entries }
    }

    /// Adds the product with `x`, k numbers side by side for each panel.
    fn add<T: Copy + Into<f64> + Sync>(&self, arch: Arch, values: &[T], x: &[f64], k: usize, sums: &mut [f64]) {
        sums.par_chunks_mut(k * 256).enumerate().for_each(|(chunk, sums)| {
            arch.dispatch(|| {
                for (r, sums) in sums.chunks_exact_mut(k).enumerate() {
                    let i = chunk * 256 + r;
                    let range = self.starts[i]..self.starts[i + 1];
                    for (j, value) in self.columns[range.clone()].iter().zip(&values[range]) {
                        let value: f64 = (*value).into();
                        for (sum, x) in sums.iter_mut().zip(&x[*j as usize * k..(*j as usize + 1) * k]) {
                            *sum += value * x;
                        }
                    }
                }
            });
        });
    }
}

/// Entries against one panel: its own points of each rule are set once.
#[derive(Default)]
struct Entries {
    own: [Option<Box<Weighted>>; 3],
    /// The points that stand for it.
    points: Weighted,
    other: Weighted,
    /// From this distance on, in units of the sum of both radii, both integrals are by a rule.
    rules_from: f64,
}

impl Entries {
    fn start(&mut self) {
        self.own = [None, None, None];
    }

    /// Both integrals by the rule of degree 5.
    fn by_rules(&mut self, arch: Arch, one: &Panel, other: &Panel) -> f64 {
        let rule = quadrature::rule(OUTER_APART);
        let own = self.own[2].get_or_insert_with(|| {
            let mut own = Box::<Weighted>::default();
            own.set(rule.on(&one.corners));
            own
        });
        rule.on(&other.corners).map(|(y, w)| w * own.inverse_distance(arch, &y)).sum()
    }

    /// [`crate::influence::galerkin`] of two different panels, with the closed form at all distances.
    fn galerkin(&mut self, arch: Arch, one: &Panel, other: &Panel) -> f64 {
        let small = one.radius.min(other.radius);
        let distance = (one.centroid - other.centroid).norm();
        if distance > self.rules_from * (one.radius + other.radius) {
            return self.by_rules(arch, one, other);
        }
        let apart = distance > one.radius + other.radius + small;
        let gap =
            if apart { distance - one.radius - other.radius } else { triangle::distance(&one.corners, &other.corners) };
        let (kind, degree) = match gap / small {
            ..TOUCHING => (0, OUTER_TOUCHING),
            ..1.0 => (1, OUTER_NEAR),
            _ => (2, OUTER_APART),
        };
        let rule = quadrature::rule(degree);
        let mut sum = 0.0;
        let (first, second) = (one.area <= 1.5 * other.area, other.area <= 1.5 * one.area);
        if first {
            let own = self.own[kind].get_or_insert_with(|| {
                let mut own = Box::<Weighted>::default();
                own.set(rule.on(&one.corners));
                own
            });
            sum += potential(arch, other, own, gap) / other.area;
        }
        if second {
            self.other.set(rule.on(&other.corners));
            sum += potential(arch, one, &self.other, gap) / one.area;
        }
        if first && second { 0.5 * sum } else { sum }
    }
}
