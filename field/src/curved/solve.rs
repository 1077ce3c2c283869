//! Solving for the charge of a curved mesh.

use std::sync::Arc;
use std::time::Instant;

use faer::{Mat, Par};
use meshes::Vec3;
use rayon::prelude::*;

use super::assembly::Assembly;
use super::charge::CurvedCharge;
use super::element::CurvedMesh;
use super::iterative::Iterative;
use super::sum::CurvedSum;
use crate::Samples;
use crate::boundary_problem::SolveError;
use crate::constants::COULOMB;
use crate::gauss::gauss;
use crate::linear::solve_transposed;
use crate::multipole::IterativeError;
use crate::plane::Plane;
use crate::source::Source;
use crate::symmetry::Symmetry;

/// How the equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurvedBy {
    /// By their matrix up to some thousand unknowns, else by multipoles.
    #[default]
    Size,
    /// By their matrix.
    Matrix,
    /// By multipoles and iterations.
    Multipoles,
}

/// Unknowns after symmetry from which on iterations are faster than a matrix. Plates with square holes on one core: 1300
/// unknowns take 0.5 s either way at 1e-4, 2800 take 2.4 s by their matrix and 1.6 s by iterations; at 1e-6 1550 take 0.7 s
/// and 1.8 s, 3500 take 4.2 s and 2.8 s.
const MANY: usize = 2_500;

/// The electrostatic problem of conductors with curved elements.
#[derive(Clone, Copy, Debug)]
pub struct CurvedProblem<'a> {
    /// Names of the electrodes, for errors.
    pub names: &'a [String],
    /// Fields in closed form; each induces charges on the electrodes.
    pub sources: &'a [Source],
    /// A grounded plane, with everything above it.
    pub ground: Option<Plane>,
    /// Make use of symmetry where there is any.
    pub symmetric: bool,
    /// Bytes that may be used.
    pub max_bytes: u64,
    /// By a matrix or without.
    pub by: CurvedBy,
}

/// Charges of a curved mesh, and what they add up to.
#[derive(Clone, Debug)]
pub struct CurvedSolution {
    /// The charges.
    pub charge: CurvedCharge,
    /// Charge on each electrode (row) for each basis function (column), C.
    pub totals: Vec<Vec<f64>>,
    /// Unknowns after symmetry, of all sectors together.
    pub unknowns: usize,
    /// Order of the symmetry group.
    pub symmetry: usize,
    /// The grounded plane below.
    pub ground: Option<Plane>,
    /// Largest error of the potential at points that were looked at, V per V.
    pub residual: f64,
    /// Applications of the operator, all sectors together; none where a matrix was factorised.
    pub iterations: usize,
    /// Bytes of the matrices.
    pub matrix_bytes: u64,
    /// Filling them, s.
    pub assembly_seconds: f64,
    /// Factorising and solving, s.
    pub solve_seconds: f64,
}

impl CurvedSolution {
    /// Potentials and gradients of all basis functions at points off the surface, without the sources' own.
    pub fn sample(&self, points: &[Vec3]) -> Samples {
        let n = self.charge.functions;
        let unit = |k: usize| (0..n).map(|l| f64::from(u8::from(k == l))).collect::<Vec<f64>>();
        let weights: Vec<Arc<[f64]>> = (0..n).map(|k| Arc::from(unit(k))).collect();
        let field = CurvedSum::new(&self.charge, &weights);
        let sums: Vec<Vec<f64>> = points.par_chunks(4).map(|some| field.sum(some)).collect();
        let mut samples = Samples::default();
        for sum in sums.iter().flat_map(|s| s.chunks_exact(4)) {
            samples.potential.push(sum[0]);
            samples.gradient.push(Vec3::new(sum[1], sum[2], sum[3]));
        }
        samples
    }
}

impl CurvedProblem<'_> {
    /// Wanted potentials at the points, V: a column for each electrode, then one for each source.
    fn wanted(&self, mesh: &CurvedMesh, points: &[Vec3], electrode: &[u32]) -> Result<Mat<f64>, SolveError> {
        let mut wanted = Mat::<f64>::zeros(points.len(), mesh.electrodes + self.sources.len());
        for (p, &e) in electrode.iter().enumerate() {
            wanted[(p, e as usize)] = 1.0;
        }
        for (s, source) in self.sources.iter().enumerate() {
            for (p, point) in points.iter().enumerate() {
                let outside = source.potential_and_gradient_above(self.ground.as_ref(), point).0;
                if !outside.is_finite() {
                    let electrode = self.names[electrode[p] as usize].clone();
                    return Err(SolveError::SourceOnElectrode { source_number: s + 1, electrode });
                }
                wanted[(p, mesh.electrodes + s)] = -outside;
            }
        }
        Ok(wanted)
    }

    /// Unknowns of each sector of a mesh: its points as far as symmetry leaves them.
    ///
    /// # Errors
    /// A source on an electrode.
    pub fn unknowns(&self, mesh: &CurvedMesh) -> Result<usize, SolveError> {
        let (points, electrode) = (mesh.points(), mesh.electrode_of_points());
        let wanted = self.wanted(mesh, &points, &electrode)?;
        Ok(self.symmetry(&points, &electrode, &wanted).representatives.len())
    }

    fn symmetry(&self, points: &[Vec3], electrode: &[u32], wanted: &Mat<f64>) -> Symmetry {
        if !self.symmetric {
            return Symmetry::none(points.len());
        }
        Symmetry::find(points, electrode, wanted, self.ground.as_ref().map(|plane| &plane.normal))
    }

    /// Bytes that [`CurvedProblem::solve`] takes for that many unknowns after symmetry in each of some sectors, and points.
    pub fn memory_needed(unknowns: usize, sectors: usize, points: usize) -> u64 {
        let (n, s, p) = (unknowns as u64, sectors as u64, points as u64);
        8 * (s * n * n + 64 * p * 2 + 60 * p)
    }

    /// Solves for every electrode at 1 V with the others at 0 V, and for every source of strength one with all electrodes at
    /// 0 V. `accuracy` is that of the integrals, relative.
    ///
    /// # Errors
    /// A source on an electrode, too little memory, iterations that do not arrive.
    pub fn solve(
        &self,
        mesh: &CurvedMesh,
        accuracy: f64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<CurvedSolution, SolveError> {
        let start = Instant::now();
        let (points, electrode) = (mesh.points(), mesh.electrode_of_points());
        let wanted = self.wanted(mesh, &points, &electrode)?;
        let symmetry = self.symmetry(&points, &electrode, &wanted);
        let parts = symmetry.parts(&wanted);
        let iterate = match self.by {
            CurvedBy::Size => symmetry.representatives.len() > MANY,
            CurvedBy::Matrix => false,
            CurvedBy::Multipoles => true,
        };
        let mut charges = Charges::new(points.len(), wanted.ncols());
        let needed = Self::memory_needed(symmetry.representatives.len(), parts.len(), points.len());
        let assembly = Assembly::new(mesh, &points, self.ground, accuracy);
        // When the operator was ready.
        let iterated = |charges: &mut Charges| -> Result<Instant, SolveError> {
            let (columns, most) = (wanted.ncols(), self.max_bytes);
            let operator = Iterative::new(mesh, &assembly, &points, &symmetry, self.ground, accuracy, columns, most)?;
            let ready = Instant::now();
            progress(0.4);
            charges.matrix_bytes = operator.bytes();
            for (s, (sector, part)) in parts.iter().enumerate() {
                let done = |f: f64| progress(0.4 + 0.6 * (s as f64 + f) / parts.len() as f64);
                let solved = operator.solve(*sector, part.as_ref(), &done)?;
                charges.unknowns += solved.values.nrows();
                charges.iterations += solved.iterations;
                Symmetry::unfold(&solved.values, &solved.of, &mut charges.values);
            }
            Ok(ready)
        };
        let iterated = match iterate.then(|| iterated(&mut charges)) {
            // Thin wires between plates, of which a patch of elements sees nothing: where the matrix fits it knows no such limit.
            Some(Err(SolveError::Iterative(IterativeError::NotConverged { .. })))
                if self.by == CurvedBy::Size && needed <= self.max_bytes =>
            {
                charges = Charges::new(points.len(), wanted.ncols());
                None
            }
            Some(done) => Some(done?),
            None => None,
        };
        let assembled = if let Some(ready) = iterated {
            ready
        } else {
            if needed > self.max_bytes {
                let (unknowns, available) = (symmetry.representatives.len(), self.max_bytes);
                return Err(SolveError::TooLarge { unknowns, needed, available });
            }
            let sectors: Vec<u32> = parts.iter().map(|(sector, _)| *sector).collect();
            let matrices = assembly.matrices(&symmetry, &sectors, &|f| progress(0.9 * f));
            let ready = Instant::now();
            for ((sector, part), matrix) in parts.iter().zip(matrices) {
                let (of, own) = symmetry.orbits(*sector);
                charges.unknowns += own.len();
                charges.matrix_bytes += 8 * (own.len() * own.len()) as u64;
                let mut columns = Mat::from_fn(own.len(), part.ncols(), |i, c| part[(own[i] as usize, c)]);
                solve_transposed(matrix, &mut columns, Par::rayon(0));
                Symmetry::unfold(&columns, &of, &mut charges.values);
            }
            ready
        };
        let Charges { values, unknowns, matrix_bytes, iterations } = charges;
        let each = mesh.order * mesh.order;
        let rule = gauss(mesh.order);
        let mut totals = vec![vec![0.0; wanted.ncols()]; mesh.electrodes];
        for p in 0..points.len() {
            let local = p % each;
            let weight = rule.weights[local / mesh.order] * rule.weights[local % mesh.order] / COULOMB;
            for (c, total) in totals[electrode[p] as usize].iter_mut().enumerate() {
                *total += weight * values[(p, c)];
            }
        }
        let residual = residual(&assembly, &values, &wanted);
        Ok(CurvedSolution {
            residual,
            charge: CurvedCharge::new(mesh.clone(), &values, accuracy),
            totals,
            unknowns,
            symmetry: symmetry.order(),
            ground: self.ground,
            iterations,
            matrix_bytes,
            assembly_seconds: (assembled - start).as_secs_f64(),
            solve_seconds: assembled.elapsed().as_secs_f64(),
        })
    }
}

/// The charges of all points, and what they took.
struct Charges {
    values: Mat<f64>,
    unknowns: usize,
    matrix_bytes: u64,
    iterations: usize,
}

impl Charges {
    fn new(points: usize, columns: usize) -> Self {
        Self { values: Mat::zeros(points, columns), unknowns: 0, matrix_bytes: 0, iterations: 0 }
    }
}

/// Points at which the residual is looked at; each costs as much as a row of the matrix.
const CHECKED: usize = 32;

/// Largest relative error of the potentials at some points, each computed anew without symmetry.
fn residual(assembly: &Assembly, values: &Mat<f64>, wanted: &Mat<f64>) -> f64 {
    let n = values.nrows();
    let rows: Vec<usize> = (0..n).step_by(n.div_ceil(CHECKED).max(1)).collect();
    let largest = |c: usize| wanted.col(c).iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    let largest: Vec<f64> = (0..values.ncols()).map(largest).collect();
    let of_row = |&target: &usize| {
        let mut row = vec![0.0; n];
        assembly.row(target, &mut row);
        (0..values.ncols())
            .map(|c| {
                let potential: f64 = row.iter().zip(values.col(c).iter()).map(|(a, q)| a * q).sum();
                (potential - wanted[(target, c)]).abs() / largest[c]
            })
            .fold(0.0, f64::max)
    };
    rows.par_iter().map(of_row).reduce(|| 0.0, f64::max)
}
