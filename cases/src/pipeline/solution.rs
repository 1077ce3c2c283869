//! The unit solutions of a case, to the accuracy it asks for.

use std::time::Instant;

use field::influence::Testing;
use field::multipole::bytes_needed;
use field::{BasisField, BoundaryProblem, By, ElectrodeBasis, Errors, Samples, SolveError, Source};
use meshes::{SurfaceMesh, SurfaceTree, Vec3};
use serde::{Deserialize, Serialize};

use super::choice::{Choice, Elements, Solver};
use super::ready::Ready;
use super::surface::Electrodes;
use super::{Failure, Reporter, memory, region};
use crate::CaseSource;
use crate::case::Case;

/// A solved case. What is stored of it is the same whenever the case is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Solution {
    /// The unit solutions, with their mesh.
    pub basis: ElectrodeBasis,
    /// What solved for its charges, and why that.
    pub choice: Choice,
    /// Estimated errors.
    pub errors: Errors,
    /// How the estimate was found.
    pub estimated_by: String,
    /// What was warned of on the way.
    pub warnings: Vec<String>,
    /// Time spent meshing, s; none for what was kept.
    #[serde(skip)]
    pub mesh_seconds: f64,
    /// Time spent solving, all meshes together, s; none for what was kept.
    #[serde(skip)]
    pub solve_seconds: f64,
    /// It was not computed now: an earlier run kept it.
    #[serde(skip)]
    pub kept: bool,
}

/// Fineness to begin with for an accuracy: with 1 errors are about 1.5e-3, and they fall with the square.
fn first_fineness(accuracy: f64) -> f64 {
    (1.5e-3 / accuracy).sqrt().clamp(0.7, 8.0)
}

/// How much coarser the second mesh is from which the error is estimated: coarse enough to cost little, an eighth of the
/// time, and fine enough to be in the range where errors fall with the square of the panel size.
const COARSER: f64 = 1.5;

/// Flat panels from which on iterations are faster than a matrix.
const MANY: usize = 4_000;

/// A dense matrix of 8000 unknowns takes half a gigabyte and some ten seconds on two cores.
const MOST_DENSE: usize = 8_000;

/// As long take so many panels with multipoles.
const MOST_ITERATED: usize = 40_000;

/// And so many points of curved elements: 100 + 100 crossed wires to 1e-3 have a third of it and take a minute on two cores.
const MOST_CURVED: usize = 2_000_000;

/// Meshes whose panels differ less in size than this tell nothing of the error.
const NEAREST: f64 = 1.1;

/// Largest number of solutions on the way to the accuracy.
const ROUNDS: usize = 5;

/// Solves a case. Panels that the case pins come before its accuracy.
///
/// # Errors
/// A geometry that cannot be, work that does not fit in memory, equations that cannot be solved.
pub fn solve(case: &Case, source: &CaseSource, ready: &Ready, reporter: &dyn Reporter) -> Result<Solution, Failure> {
    let mut work = Work::new(case, source, ready, reporter);
    if case.electrodes.is_empty() {
        let basis = work.solve(&ready.mesh, false)?;
        return Ok(work.done(basis, Errors::default(), "closed form"));
    }
    if work.choice.solver == Solver::Axisymmetric {
        if let Some(solution) = work.solve_axial()? {
            return Ok(solution);
        }
        // Not to that accuracy: the whole surface is left.
        work.choice.solver = Solver::Symmetric;
        work.choice.why = "on generating curves the accuracy cannot be reached".to_owned();
    }
    if work.choice.elements == Elements::Curved {
        return work.solve_curved();
    }
    let (mut mesh, mut fineness) = work.starting_mesh()?;
    work.choose_for(&mesh);
    let pinned = is_pinned(case);
    let mut before: Option<ElectrodeBasis> = None;
    for round in 1.. {
        work.check_size(&mesh)?;
        let imported = work.electrodes.any_imported();
        reporter.stage(&format!("solve {} panels", mesh.panels()));
        let basis = work.solve(&mesh, imported)?;
        let (errors, how) = if imported {
            (work.error_from_groups(&basis), "groups of panels")
        } else {
            (work.error_from_coarser_mesh(&basis, before.take(), fineness)?, "a coarser mesh")
        };
        let error = errors.worst();
        if error <= case.field.accuracy || pinned || imported || round == ROUNDS {
            work.warn_if_missed(error, mesh.panels());
            return Ok(work.done(basis, errors, how));
        }
        // Errors fall with the square of the panel size; more than needed, since the estimate is one and meshes come in steps.
        let mut finer = fineness * (1.3 * error / case.field.accuracy).sqrt().clamp(1.15, 2.5);
        mesh = work.mesh(finer, 1.0)?;
        let most = work.most();
        if mesh.panels() > most {
            finer = work.electrodes.fineness_for(case, source, most * 19 / 20)?;
            mesh = work.mesh(finer, 1.0)?;
        }
        work.choose_for(&mesh);
        if finer <= 1.02 * fineness {
            work.warn_if_missed(error, basis.panels.len());
            return Ok(work.done(basis, errors, how));
        }
        fineness = finer;
        before = Some(basis);
    }
    unreachable!("the last round returns")
}

/// The mesh that [`solve`] begins with.
///
/// # Errors
/// A shape that cannot be.
pub fn starting_mesh(case: &Case, source: &CaseSource, ready: &Ready) -> Result<SurfaceMesh, Failure> {
    let mut work = Work::new(case, source, ready, &super::Silent);
    Ok(work.starting_mesh()?.0)
}

/// Whether the case says how many panels there are.
fn is_pinned(case: &Case) -> bool {
    case.field.panels.is_some() || case.electrodes.iter().all(|e| e.panels.is_some())
}

pub(super) struct Work<'a> {
    pub(super) case: &'a Case,
    pub(super) source: &'a CaseSource,
    pub(super) reporter: &'a dyn Reporter,
    pub(super) sources: &'a [Source],
    pub(super) electrodes: &'a Electrodes,
    pub(super) choice: Choice,
    pub(super) warnings: Vec<String>,
    pub(super) mesh_seconds: f64,
    pub(super) solve_seconds: f64,
}

impl<'a> Work<'a> {
    fn new(case: &'a Case, source: &'a CaseSource, ready: &'a Ready, reporter: &'a dyn Reporter) -> Self {
        Self {
            case,
            source,
            reporter,
            sources: &ready.sources,
            electrodes: &ready.electrodes,
            choice: ready.choice.clone(),
            warnings: Vec::new(),
            mesh_seconds: 0.0,
            solve_seconds: 0.0,
        }
    }

    pub(super) fn warn(&mut self, text: String) {
        self.reporter.warning(&text);
        self.warnings.push(text);
    }

    pub(super) fn mesh(&mut self, fineness: f64, share: f64) -> Result<SurfaceMesh, Failure> {
        let start = Instant::now();
        let mesh = self.electrodes.mesh(self.case, self.source, fineness, share)?;
        self.mesh_seconds += start.elapsed().as_secs_f64();
        Ok(mesh)
    }

    fn starting_mesh(&mut self) -> Result<(SurfaceMesh, f64), Failure> {
        let (case, source) = (self.case, self.source);
        let mut fineness = match case.field.panels {
            Some(panels) => self.electrodes.fineness_for(case, source, panels)?,
            None => first_fineness(case.field.accuracy),
        };
        let mut mesh = self.mesh(fineness, 1.0)?;
        let most = self.most();
        if !is_pinned(case) && mesh.panels() > most && !self.electrodes.any_imported() {
            fineness = self.electrodes.fineness_for(case, source, most * 19 / 20)?;
            mesh = self.mesh(fineness, 1.0)?;
        }
        Ok((mesh, fineness))
    }

    fn solve(&mut self, mesh: &SurfaceMesh, with_coarse: bool) -> Result<ElectrodeBasis, Failure> {
        let start = Instant::now();
        let testing = match self.choice.elements {
            Elements::Galerkin => Testing::Galerkin,
            Elements::Collocation => Testing::Collocation,
            Elements::Curved => unreachable!("solved by `solve_curved`"),
        };
        let by = match self.choice.solver {
            Solver::Symmetric => By::Symmetry,
            Solver::Multipole => By::Multipoles { tolerance: self.tolerance() },
            Solver::Dense | Solver::Axisymmetric => By::Dense,
        };
        let ground = self.case.field.ground;
        let problem = BoundaryProblem { mesh, sources: self.sources, testing, ground, with_coarse, by };
        let told = problem.solve_telling(&|done| self.reporter.fraction(done));
        let basis = told.map_err(|error| self.explained(error))?;
        self.solve_seconds += start.elapsed().as_secs_f64();
        Ok(basis)
    }

    /// Relative error of charges that iterations may leave: what the field may have. Fields and sums over electrodes miss less
    /// than single panels do.
    fn tolerance(&self) -> f64 {
        self.case.field.accuracy.clamp(1e-7, 1e-3)
    }

    /// Whether the case leaves it to us to take multipoles for flat panels.
    fn may_iterate(&self) -> bool {
        let flat = self.choice.elements == Elements::Galerkin && self.case.field.ground.is_none();
        flat && self.case.field.solver == crate::case::Solver::Auto
    }

    /// Takes multipoles for many panels, where the case does not say what to take.
    fn choose_for(&mut self, mesh: &SurfaceMesh) {
        if self.may_iterate() && mesh.panels() > MANY {
            self.choice.solver = Solver::Multipole;
            self.choice.why = format!("{} panels are too many for a matrix", mesh.panels());
        }
    }

    /// Largest number of panels, or of points of curved elements, that is chosen by itself.
    pub(super) fn most(&self) -> usize {
        if self.choice.elements == Elements::Curved && self.choice.solver != Solver::Dense {
            return self.case.field.max_panels.unwrap_or(MOST_CURVED);
        }
        let iterate = self.choice.solver == Solver::Multipole || self.may_iterate();
        self.case.field.max_panels.unwrap_or(if iterate { MOST_ITERATED } else { MOST_DENSE })
    }

    pub(super) fn explained(&self, error: SolveError) -> Failure {
        let text = error.to_string();
        match error {
            SolveError::SourceOnElectrode { source_number, .. } => {
                let name = &self.case.sources[source_number - 1].name;
                self.source.error_at(&format!("source.{name}.center"), text, "move the source off the electrode").into()
            }
            SolveError::OnGround { electrode } => {
                let key = format!("electrode.{electrode}.center");
                self.source.error_at(&key, text, "move it up, or the plane down").into()
            }
            SolveError::Degenerate { electrode, .. } | SolveError::NotPositiveDefinite { electrode, .. } => {
                let help = "panels of it may lie on each other or have no area: look at it with `graintrap mesh`";
                self.source.error_at(&format!("electrode.{electrode}"), text, help).into()
            }
            SolveError::TooMany { .. } => {
                let help =
                    "raise field.max_panels if the machine is large enough, or leave out what is too fine to matter";
                self.source.error_at(&self.size_key(), text, help).into()
            }
            SolveError::TooLarge { .. } => {
                let help = "ask for a larger field.accuracy, or leave out what is too fine to matter";
                self.source.error_at("field", text, help).into()
            }
            SolveError::Iterative(_) | SolveError::Residual { .. } => {
                Failure::run(text, "look at the mesh with `graintrap mesh`; ask for fewer or more panels")
            }
        }
    }

    /// Refuses a mesh that is larger than the case allows or than fits in memory.
    fn check_size(&self, mesh: &SurfaceMesh) -> Result<(), Failure> {
        let (panels, settings) = (mesh.panels(), &self.case.field);
        let right_hand_sides = self.case.electrodes.len() + self.sources.len();
        let iterate = self.choice.solver == Solver::Multipole;
        let needed = if iterate {
            bytes_needed(panels, right_hand_sides, self.tolerance())
        } else {
            BoundaryProblem::memory_needed(panels, right_hand_sides)
        };
        let (free, what) = (memory::available(), if iterate { "sums by multipoles" } else { "their matrix" });
        let help = "use fewer panels: a larger `field.accuracy`, a smaller `field.panels`, or a coarser mesh file";
        if needed > free {
            let (needed, free) = (memory::people(needed), memory::people(free));
            let problem = format!("{panels} panels need {needed} of memory for {what}, and {free} are free");
            return Err(self.source.error_at(&self.size_key(), problem, help).into());
        }
        // What the case asks for panel by panel is not bounded by the default.
        let largest = self.case.electrodes.iter().filter_map(|e| e.panels).sum::<usize>() * 13 / 10;
        let most = self.most();
        let bounded = settings.max_panels.is_some() || !(iterate && self.electrodes.any_imported());
        let pinned = settings.panels.is_some() && settings.max_panels.is_none();
        if bounded && !pinned && panels > most * 13 / 10 && panels > largest {
            let needed = memory::people(needed);
            let problem = format!(
                "the electrodes need {panels} panels ({needed} of memory), more than field.max_panels = {most}"
            );
            let help = format!("raise field.max_panels if the machine is large enough, or {help}");
            return Err(self.source.error_at(&self.size_key(), problem, help).into());
        }
        Ok(())
    }

    /// The key that decides how many panels there are.
    fn size_key(&self) -> String {
        let most = self.case.electrodes.iter().filter(|e| e.panels.is_some()).max_by_key(|e| e.panels);
        match most {
            Some(electrode) => format!("electrode.{}.panels", electrode.name),
            None if self.case.field.panels.is_some() => "field.panels".to_owned(),
            None => "field".to_owned(),
        }
    }

    /// Compares with the solution on a coarser mesh, the one before if there is one, and takes the errors of both to fall
    /// with the square of the panel size.
    fn error_from_coarser_mesh(
        &mut self,
        basis: &ElectrodeBasis,
        before: Option<ElectrodeBasis>,
        fineness: f64,
    ) -> Result<Errors, Failure> {
        let ratio = |coarse: usize| (basis.panels.len() as f64 / coarse as f64).sqrt();
        let coarse = match before.filter(|before| ratio(before.panels.len()) > NEAREST) {
            Some(before) => before,
            None => {
                self.reporter.stage("error estimate");
                let mesh = self.mesh(fineness / COARSER, 1.0 / (COARSER * COARSER))?;
                if ratio(mesh.panels()) < NEAREST {
                    // Shapes have least numbers of panels: nothing coarser can be made, and groups of panels stand in.
                    let fine = basis.mesh.clone();
                    let again = self.solve(&fine, true)?;
                    return Ok(self.error_from_groups(&again));
                }
                self.solve(&mesh, false)?
            }
        };
        let difference = Errors {
            capacitance: matrix_difference(&basis.capacitance.matrix, &coarse.capacitance.matrix),
            field: self.field_difference(basis, &coarse),
        };
        Ok(difference.times(1.0 / (ratio(coarse.panels.len()).powi(2) - 1.0)))
    }

    fn error_from_groups(&self, basis: &ElectrodeBasis) -> Errors {
        let error = basis.coarse.as_ref().map_or(f64::NAN, |coarse| {
            // Panels of an imported mesh do not shrink towards edges: first order.
            matrix_difference(&basis.capacitance.matrix, &coarse.matrix) / (coarse.size_ratio - 1.0)
        });
        Errors { capacitance: error, field: error }
    }

    /// Largest difference of the unit fields of two solutions at points of the trap region, against the strongest of each
    /// basis function there.
    fn field_difference(&self, one: &ElectrodeBasis, other: &ElectrodeBasis) -> f64 {
        let points = trap_points(self.case, &one.mesh);
        let (mut a, mut b) = (Samples::default(), Samples::default());
        one.panel_sum().sample(&points, &mut a);
        other.panel_sum().sample(&points, &mut b);
        let n = one.functions();
        (0..n)
            .map(|k| {
                let each = |f: &dyn Fn(usize) -> f64| (0..points.len()).map(|p| f(p * n + k)).fold(0.0, f64::max);
                let strongest = each(&|i| a.gradient[i].norm());
                let apart = each(&|i| (a.gradient[i] - b.gradient[i]).norm());
                if strongest > 0.0 { apart / strongest } else { 0.0 }
            })
            .fold(0.0, f64::max)
    }

    fn warn_if_missed(&mut self, error: f64, panels: usize) {
        let asked = self.case.field.accuracy;
        // An error that is no number has not met what was asked.
        let met = error <= 1.05 * asked;
        if !met && self.case.field.panels.is_none() {
            self.warn(format!(
                "the field has an estimated error of {error:.1e} with {panels} panels; {asked:.0e} was asked. Raise field.max_panels (now {}) to come nearer",
                self.most()
            ));
        }
    }

    pub(super) fn done(&mut self, basis: ElectrodeBasis, errors: Errors, estimated_by: &str) -> Solution {
        let tolerance = errors.capacitance.max(1e-12);
        for defect in basis.capacitance.defects(tolerance) {
            self.warn(format!("the capacitance matrix is not what it must be: {defect}"));
        }
        Solution {
            basis,
            choice: self.choice.clone(),
            errors,
            estimated_by: estimated_by.to_owned(),
            warnings: std::mem::take(&mut self.warnings),
            mesh_seconds: self.mesh_seconds,
            solve_seconds: self.solve_seconds,
            kept: false,
        }
    }
}

/// Largest difference of two matrices, against the largest entry.
pub(super) fn matrix_difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let largest = a.iter().flatten().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / largest
}

/// Points spread over the trap region, clear of conductors: a tenth of the box where there is room for that.
pub(super) fn trap_points(case: &Case, mesh: &SurfaceMesh) -> Vec<Vec3> {
    let region = region::trap_box(case, mesh);
    let tree = SurfaceTree::new(mesh);
    let buried = |p: &Vec3| case.field.ground.is_some_and(|plane| plane.holds(p));
    let size = region.max - region.min;
    // The sequence of Roberts (2018) in three dimensions: even coverage, always the same.
    let g: f64 = 1.220_744_084_605_76;
    let step = Vec3::new(1.0 / g, 1.0 / (g * g), 1.0 / (g * g * g));
    for clearance in [0.1, 0.05, 0.02, 0.005] {
        let reach = clearance * size.max();
        let points: Vec<Vec3> = (1..1000)
            .map(|k| (step * k as f64).map(f64::fract))
            .map(|part| region.min + part.component_mul(&size))
            .filter(|p| tree.nearest(p, reach).is_none() && tree.inside(p).is_none() && !buried(p))
            .take(40)
            .collect();
        if points.len() >= 10 {
            return points;
        }
    }
    Vec::new()
}
