//! Solving on the true surface, to the accuracy that a case asks for.

use std::time::Instant;

use field::curved::{CurvedBy, CurvedMesh, CurvedProblem, CurvedSolution, solve_to};
use field::{ElectrodeBasis, Errors, Plane, Samples, Source};
use meshes::{Patch, SurfaceMesh, Vec3, patches};

use super::choice::Solver;
use super::solution::{Solution, Work, matrix_difference, trap_points};
use super::{Failure, memory};

/// Panels of the mesh that shows the charge and that grains strike: facets of a sphere then lie within 3e-3 of its radius.
const SHOWN: f64 = 4000.0;

impl Work<'_> {
    /// Solves with curved elements.
    pub(super) fn solve_curved(mut self) -> Result<Solution, Failure> {
        let shown = self.shown_mesh()?;
        let (patches, electrode) = self.patches()?;
        let names: Vec<String> = self.case.electrodes.iter().map(|e| e.name.clone()).collect();
        let symmetric = self.choice.solver != Solver::Dense;
        let by = self.by();
        let ground = self.case.field.ground;
        let problem = CurvedProblem {
            names: &names,
            sources: self.sources,
            ground,
            symmetric,
            max_bytes: memory::available() / 10 * 9,
            by,
        };
        let start = Instant::now();
        let points = trap_points(self.case, &shown);
        let sources = self.sources;
        let difference =
            |fine: &CurvedSolution, coarse: &CurvedSolution| difference(fine, coarse, &points, sources, ground);
        let (asked, limit) = (self.case.field.accuracy, self.limit());
        let begins = |mesh: &CurvedMesh| self.reporter.stage(&format!("solve {} curved elements", mesh.elements.len()));
        let progress = |done: f64| self.reporter.fraction(done);
        let refined = solve_to(&problem, &patches, &electrode, asked, limit, &difference, &begins, &progress);
        let refined = refined.map_err(|error| self.explained(error))?;
        if refined.solution.iterations > 0 && self.choice.solver != Solver::Multipole {
            self.choice.solver = Solver::Multipole;
            self.choice.why = format!("{} unknowns are too many for a matrix", refined.solution.unknowns);
        }
        let basis = ElectrodeBasis::from_curved(shown, sources.to_vec(), ground, refined.solution);
        self.solve_seconds += start.elapsed().as_secs_f64();
        self.warn_of_accuracy(refined.errors, basis.report.unknowns);
        Ok(self.done(basis, refined.errors, "a finer solution"))
    }

    /// Says so when the accuracy was not reached.
    pub(super) fn warn_of_accuracy(&mut self, errors: Errors, unknowns: usize) {
        let (asked, error, most) = (self.case.field.accuracy, errors.worst(), self.most());
        // An error that is no number has not met what was asked.
        let met = error <= asked;
        if !met {
            self.warn(format!(
                "the field has an estimated error of {error:.1e} with {unknowns} unknowns; {asked:.0e} was asked. Raise field.max_panels (now {most}) to come nearer"
            ));
        }
    }

    /// By a matrix or without, as the case has it.
    fn by(&self) -> CurvedBy {
        match self.choice.solver {
            Solver::Dense => CurvedBy::Matrix,
            Solver::Multipole => CurvedBy::Multipoles,
            Solver::Symmetric | Solver::Axisymmetric => CurvedBy::Size,
        }
    }

    /// Largest number of points, or of unknowns of a matrix: what the case allows, and what fits in memory.
    fn limit(&self) -> usize {
        if self.by() != CurvedBy::Matrix {
            return self.most();
        }
        // Two matrices at a time, and as much again for the rest.
        let fits = ((memory::available() / 4 / 8) as f64).sqrt() as usize;
        self.most().min(fits)
    }

    /// The mesh that shows the solution.
    pub(super) fn shown_mesh(&mut self) -> Result<SurfaceMesh, Failure> {
        let start = self.mesh(1.0, 1.0)?;
        let fineness = (SHOWN / start.panels().max(1) as f64).sqrt().clamp(1.0, 4.0);
        if fineness < 1.1 { Ok(start) } else { self.mesh(fineness, 1.0) }
    }

    /// The patches of all electrodes in place, and the electrode of each.
    fn patches(&self) -> Result<(Vec<Patch>, Vec<u32>), Failure> {
        let (mut all, mut owner) = (Vec::new(), Vec::new());
        for (e, (electrode, shape)) in self.case.electrodes.iter().zip(&self.electrodes.shapes).enumerate() {
            for patch in patches(shape).unwrap_or_default() {
                let placed = patch.placed(&electrode.placement).map_err(|error| {
                    let key = format!("electrode.{}.{}", electrode.name, error.key);
                    self.source.error_at(&key, error.problem, error.help)
                })?;
                all.push(placed);
                owner.push(e as u32);
            }
        }
        Ok((all, owner))
    }
}

/// Two relative differences: of the capacitance matrices, against the largest entry, and of the unit fields at
/// points, against the strongest of each.
fn difference(
    fine: &CurvedSolution,
    coarse: &CurvedSolution,
    points: &[Vec3],
    sources: &[Source],
    ground: Option<Plane>,
) -> Errors {
    let electrodes = fine.totals.len();
    let own = |solution: &CurvedSolution| -> Vec<Vec<f64>> {
        solution.totals.iter().map(|row| row[..electrodes].to_vec()).collect()
    };
    let (a, b) = (fine.sample(points), coarse.sample(points));
    let of_sources = |s: usize, p: &Vec3| sources[s].potential_and_gradient_above(ground.as_ref(), p).1;
    let field = field_difference(&a, &b, points, electrodes, sources.len(), &of_sources);
    Errors { capacitance: matrix_difference(&own(fine), &own(coarse)), field }
}

/// Largest difference of the unit fields, against the strongest of each; `own` is the field of a source itself.
pub(super) fn field_difference(
    a: &Samples,
    b: &Samples,
    points: &[Vec3],
    electrodes: usize,
    sources: usize,
    own: &dyn Fn(usize, &Vec3) -> Vec3,
) -> f64 {
    let n = electrodes + sources;
    let mut largest = 0.0_f64;
    for k in 0..n {
        let source = |p: usize| k.checked_sub(electrodes).map_or(Vec3::zeros(), |s| own(s, &points[p]));
        let all = |value: &dyn Fn(usize) -> f64| (0..points.len()).map(value).fold(0.0, f64::max);
        let strongest = all(&|p| (a.gradient[p * n + k] + source(p)).norm());
        let apart = all(&|p| (a.gradient[p * n + k] - b.gradient[p * n + k]).norm());
        if strongest > 0.0 {
            largest = largest.max(apart / strongest);
        }
    }
    largest
}
