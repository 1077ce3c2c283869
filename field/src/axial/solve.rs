//! Level by level to the accuracy asked, each level judged by a better one.

use faer::{Mat, Par};
use pulp::Arch;

use super::assembly::{Assembly, LARGEST_ORDER, Nodes};
use super::element::{Element, coarsest};
use super::gauss::{Rules, legendre};
use super::solution::AxialSolution;
use super::{AxialError, AxialProblem};
use crate::capacitance::CapacitanceMatrix;
use crate::constants::COULOMB;
use crate::linear;

/// Order of the coarsest elements.
const FIRST_ORDER: usize = 6;

/// Elements whose indicator is below that part of the largest are resolved well enough for the next level.
const MARKED: f64 = 0.02;

/// Factor by which the indicator of a marked element is to fall from one level to the next.
const FALL: f64 = 0.02;

/// Largest step of an element's order; where it would not do, the element is cut in two.
const LARGEST_STEP: usize = 6;

/// Indicators below that are rounding.
const ROUNDING: f64 = 1e-14;

/// Smallest error that is told: rounding of the sums, whatever two levels agree to.
const SMALLEST_ERROR: f64 = 1e-13;

/// What is told over the difference from the judge: that difference was 0.82 to 1.06 of the true error over 29 geometries.
const TRUST: f64 = 1.25;

/// The judge's indicator is to be below that part of the judged level's.
const CLEARLY_BETTER: f64 = 0.2;

/// Levels and unknowns after which the solver gives up; the hardest shape of the tests takes half of the levels and a fifth
/// of the unknowns.
const MOST_LEVELS: usize = 40;
const MOST_UNKNOWNS: usize = 4000;

/// Levels without a smaller error after which the solver gives up. While a narrow gap is not resolved (spheres of radius 1 with
/// a gap of 1e-6 take ten levels) the error does not fall; these levels are small.
const MOST_IN_VAIN: usize = 4;

/// As [`MOST_IN_VAIN`] for errors of the potential above [`LARGE`].
const MOST_IN_VAIN_AT_FIRST: usize = 16;

/// V per V.
const LARGE: f64 = 1e-2;

/// Largest residual of the equations: where bodies do not lie on each other rounding leaves 1e-12.
const RESIDUAL: f64 = 1e-6;

/// Elements with their charges.
struct Level {
    elements: Vec<Element>,
    nodes: Vec<Nodes>,
    /// Row-major potentials of the charges.
    matrix: Vec<f64>,
    /// Wanted potentials, a column for each electrode and source.
    wanted: Mat<f64>,
    /// Charges at nodes in units of charge over Coulomb's constant, V m.
    charges: Mat<f64>,
    /// Of each element: what the last coefficients of its charge make of potential, in parts of the column's potentials, and
    /// by which factor the coefficients fall from one to the next.
    indicators: Vec<(f64, f64)>,
}

impl AxialProblem<'_> {
    /// The solution to a relative accuracy between 1e-2 and 1e-11, with its error.
    ///
    /// # Errors
    /// See [`AxialError`].
    pub fn solve(&self, accuracy: f64) -> Result<AxialSolution, AxialError> {
        Ok(self.solve_with_judge(accuracy)?.0)
    }

    /// As [`AxialProblem::solve`], with the better solution by which the error was measured.
    ///
    /// Accepted is the first level whose capacitances, induced charges and potentials on the surface (at the nodes of the
    /// next level, which are between its own) are within `accuracy` of those of a better level.
    ///
    /// # Errors
    /// See [`AxialError`].
    pub fn solve_with_judge(&self, accuracy: f64) -> Result<(AxialSolution, AxialSolution), AxialError> {
        self.check()?;
        let rules = Rules::new(LARGEST_ORDER);
        let mut best = f64::INFINITY;
        let mut level = Level::new(self, coarsest(self.bodies, FIRST_ORDER), &rules)?;
        // Accepted but for its judge, which was not clearly better.
        let mut waiting: Option<(Level, f64)> = None;
        let (mut unknowns, mut vain) = (0, 0);
        for _ in 0..MOST_LEVELS {
            let (elements, parents) = level.refined();
            let next = Level::new(self, elements, &rules)?;
            let misfit = level.misfit(&next, &parents, &rules);
            let found = level.solution(self);
            let judge = next.solution(self);
            let error = told(&found, &judge);
            vain = if error.max(misfit) < 0.7 * best { 0 } else { vain + 1 };
            best = best.min(error.max(misfit));
            if let Some((earlier, misfit)) = waiting.take() {
                return Ok(self.judged(earlier, misfit, judge));
            }
            if error <= accuracy && misfit <= accuracy {
                let clearly = next.indicator() <= CLEARLY_BETTER * level.indicator() || next.indicator() < ROUNDING;
                if clearly {
                    return Ok(self.judged(level, misfit, judge));
                }
                waiting = Some((level, misfit));
            }
            unknowns = next.charges.nrows();
            let most_in_vain = if best > LARGE { MOST_IN_VAIN_AT_FIRST } else { MOST_IN_VAIN };
            if unknowns > MOST_UNKNOWNS || vain > most_in_vain {
                break;
            }
            level = next;
        }
        Err(AxialError::Accuracy { reached: best, asked: accuracy, unknowns })
    }

    fn judged(&self, level: Level, misfit: f64, judge: AxialSolution) -> (AxialSolution, AxialSolution) {
        let mut solution = level.solution(self);
        solution.data.capacitance_error = told(&solution, &judge);
        solution.data.misfit = misfit;
        (solution, judge)
    }
}

/// The error of a solution: its difference from a better one, and something for what that one errs.
fn told(solution: &AxialSolution, judge: &AxialSolution) -> f64 {
    (TRUST * solution.difference(judge)).max(SMALLEST_ERROR)
}

impl Level {
    fn new(problem: &AxialProblem, elements: Vec<Element>, rules: &Rules) -> Result<Self, AxialError> {
        let mut first = 0;
        let mut nodes = Vec::with_capacity(elements.len());
        for element in &elements {
            nodes.push(Nodes::new(element, problem.bodies, rules, first));
            first += element.order;
        }
        let (n, electrodes) = (first, problem.electrodes);
        let mut wanted = Mat::<f64>::zeros(n, electrodes + problem.sources.len());
        for (element, nodes) in elements.iter().zip(&nodes) {
            for (k, place) in nodes.places.iter().enumerate() {
                wanted[(nodes.first + k, problem.bodies[element.body].electrode)] = 1.0;
                for (s, source) in problem.sources.iter().enumerate() {
                    let outside = source(place[0], place[1]);
                    if !outside.is_finite() {
                        return Err(AxialError::SourceOnBody { source_number: s + 1, body: element.body });
                    }
                    wanted[(nodes.first + k, electrodes + s)] = -outside;
                }
            }
        }
        let assembly = Assembly {
            bodies: problem.bodies,
            elements: &elements,
            nodes: &nodes,
            rules,
            ground: problem.ground,
            arch: Arch::new(),
        };
        let matrix = assembly.matrix();
        let charges = solved(&matrix, &wanted);
        if residual(&matrix, &charges, &wanted) > RESIDUAL {
            return Err(AxialError::Singular);
        }
        let mut level = Self { elements, nodes, matrix, wanted, charges, indicators: Vec::new() };
        level.indicators = level.find_indicators(rules);
        Ok(level)
    }

    fn indicator(&self) -> f64 {
        self.indicators.iter().map(|i| i.0).fold(0.0, f64::max)
    }

    /// Potentials that count as one, for each column.
    fn scales(&self) -> Vec<f64> {
        (0..self.wanted.ncols())
            .map(|c| {
                let largest = (0..self.wanted.nrows()).map(|r| self.wanted[(r, c)].abs()).fold(0.0, f64::max);
                if largest > 0.0 { largest } else { 1.0 }
            })
            .collect()
    }

    /// A charge per parameter c ρ P_k is a density c/(2π ds/du), whose potential on the spot is about c/k.
    fn find_indicators(&self, rules: &Rules) -> Vec<(f64, f64)> {
        let scales = self.scales();
        let indicator = |(element, nodes): (&Element, &Nodes)| {
            if element.beyond_resolution() {
                return (0.0, 0.0);
            }
            let order = element.order;
            let transform = rules.transform(order);
            let (mut worst, mut fall) = (0.0, 0.0);
            for (c, scale) in scales.iter().enumerate() {
                let coefficient = |k: usize| -> f64 {
                    let terms = (0..order)
                        .map(|j| transform[k * order + j] * self.charges[(nodes.first + j, c)] / nodes.places[j][0]);
                    terms.sum::<f64>().abs()
                };
                let last = coefficient(order - 1).max(coefficient(order - 2));
                let before = coefficient(order - 3).max(coefficient(order - 4));
                let size = last / (order as f64 * scale);
                if size > worst {
                    worst = size;
                    fall = (last / before).sqrt().clamp(0.02, 0.99);
                }
            }
            (worst, fall)
        };
        self.elements.iter().zip(&self.nodes).map(indicator).collect()
    }

    /// The elements of the next level, and for each the element it comes from and its stretch of that.
    fn refined(&self) -> (Vec<Element>, Vec<(usize, f64, f64)>) {
        let limit = (MARKED * self.indicator()).max(0.1 * ROUNDING);
        let (mut elements, mut parents) = (Vec::new(), Vec::new());
        for (e, (element, &(size, fall))) in self.elements.iter().zip(&self.indicators).enumerate() {
            let step = if size <= limit { 1 } else { ((FALL.ln() / fall.ln()).ceil() as usize).max(2) };
            if step <= LARGEST_STEP && (element.order + step <= LARGEST_ORDER || step == 1) {
                elements.push(Element { order: (element.order + step).min(LARGEST_ORDER), ..*element });
                parents.push((e, 0.0, 1.0));
            } else {
                let order = (element.order + 1).min(16);
                for (half, (from, to)) in element.halves().into_iter().zip([(0.0, 0.5), (0.5, 1.0)]) {
                    elements.push(Element { order, ..half });
                    parents.push((e, from, to));
                }
            }
        }
        (elements, parents)
    }

    /// Largest error of this level's potential at the nodes of the next, in parts of the potentials of its column.
    fn misfit(&self, next: &Self, parents: &[(usize, f64, f64)], rules: &Rules) -> f64 {
        let n = next.charges.nrows();
        let mut worst = 0.0_f64;
        for (c, scale) in self.scales().into_iter().enumerate() {
            let mut charges = vec![0.0; n];
            for ((element, nodes), &(parent, from, to)) in next.elements.iter().zip(&next.nodes).zip(parents) {
                let (order, own) = (self.elements[parent].order, &self.nodes[parent]);
                let value = |j: usize| self.charges[(own.first + j, c)] / own.places[j][0];
                let transform = rules.transform(order);
                let coefficients: Vec<f64> =
                    (0..order).map(|k| (0..order).map(|j| transform[k * order + j] * value(j)).sum()).collect();
                let rule = rules.rule(element.order);
                let mut values = vec![0.0; order];
                for (k, (u, w)) in rule.points.iter().zip(&rule.weights).enumerate() {
                    legendre(from + (to - from) * u, &mut values);
                    let density: f64 = coefficients.iter().zip(&values).map(|(a, b)| a * b).sum();
                    charges[nodes.first + k] = density * nodes.places[k][0] * w * (to - from);
                }
            }
            let resolved = next.elements.iter().zip(&next.nodes).filter(|(e, _)| !e.beyond_resolution());
            for r in resolved.flat_map(|(_, nodes)| nodes.first..nodes.first + nodes.places.len()) {
                let potential: f64 = next.matrix[r * n..(r + 1) * n].iter().zip(&charges).map(|(a, b)| a * b).sum();
                worst = worst.max((potential - next.wanted[(r, c)]).abs() / scale);
            }
        }
        worst
    }

    fn solution(&self, problem: &AxialProblem) -> AxialSolution {
        let electrodes = problem.electrodes;
        let on_electrode = |electrode: usize, column: usize| -> f64 {
            let of = |(element, nodes): (&Element, &Nodes)| -> f64 {
                if problem.bodies[element.body].electrode != electrode {
                    return 0.0;
                }
                (0..element.order).map(|k| self.charges[(nodes.first + k, column)]).sum()
            };
            self.elements.iter().zip(&self.nodes).map(of).sum::<f64>() / COULOMB
        };
        let charges: Vec<Vec<f64>> =
            (0..electrodes).map(|i| (0..electrodes).map(|k| on_electrode(i, k)).collect()).collect();
        let columns = self.charges.ncols();
        let induced = (0..electrodes).map(|i| (electrodes..columns).map(|k| on_electrode(i, k)).collect()).collect();
        let flat =
            (0..columns).flat_map(|c| (0..self.charges.nrows()).map(move |r| self.charges[(r, c)] / COULOMB)).collect();
        AxialSolution::new(
            problem.bodies,
            self.elements.clone(),
            flat,
            (CapacitanceMatrix::new(&charges), induced),
            self.scales()[electrodes..].to_vec(),
            problem.ground,
        )
    }
}

/// Largest error of the equations, in parts of the column's largest potential; not finite charges are infinitely wrong.
fn residual(matrix: &[f64], charges: &Mat<f64>, wanted: &Mat<f64>) -> f64 {
    let n = wanted.nrows();
    let mut worst = 0.0_f64;
    for c in 0..wanted.ncols() {
        let column: Vec<f64> = (0..n).map(|r| charges[(r, c)]).collect();
        let (mut largest, mut wrong) = (0.0_f64, 0.0_f64);
        for (r, row) in matrix.chunks_exact(n).enumerate() {
            let potential: f64 = row.iter().zip(&column).map(|(a, b)| a * b).sum();
            largest = largest.max(wanted[(r, c)].abs());
            let miss = (potential - wanted[(r, c)]).abs();
            wrong = wrong.max(if miss.is_finite() { miss } else { f64::INFINITY });
        }
        worst = worst.max(if largest > 0.0 { wrong / largest } else { wrong });
    }
    worst
}

/// Solves by Gauss elimination on one thread, whatever the number of threads: always the same bits.
fn solved(matrix: &[f64], wanted: &Mat<f64>) -> Mat<f64> {
    let n = wanted.nrows();
    let mut columns = wanted.clone();
    linear::solve(Mat::from_fn(n, n, |r, c| matrix[r * n + c]), &mut columns, Par::Seq);
    columns
}
