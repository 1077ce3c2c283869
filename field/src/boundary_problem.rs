//! From a surface to its charge: one factorisation, one solution for each electrode and source.

use std::time::Instant;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{Mat, Par};
use meshes::{SurfaceMesh, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::capacitance::CapacitanceMatrix;
use crate::coarse::{CoarseCapacitance, coarse_capacitance};
use crate::constants::COULOMB;
use crate::electrode_basis::{ElectrodeBasis, SurfaceCharge};
use crate::influence::galerkin;
use crate::influence::{Testing, potential_coefficients_telling};
use crate::linear_operator::GalerkinOperator;
use crate::multipole::IterativeError;
use crate::panel::{Panel, quadrature};
use crate::plane::Plane;
use crate::source::Source;
use crate::{iterative, linear, reduced};

/// The electrostatic problem of conductors in given outside fields: on each electrode the potential is constant.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryProblem<'a> {
    /// The electrodes.
    pub mesh: &'a SurfaceMesh,
    /// Fields in closed form; each induces charges on the electrodes.
    pub sources: &'a [Source],
    /// How the condition is imposed.
    pub testing: Testing,
    /// A grounded plane, with all electrodes above it.
    pub ground: Option<Plane>,
    /// Find what a coarser charge would have given as well, for an error estimate where the surface cannot be meshed anew
    /// (Galerkin testing only).
    pub with_coarse: bool,
    /// What solves the equations.
    pub by: By,
}

/// What solves the equations of panels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum By {
    /// A factorised matrix.
    Dense,
    /// Factorised matrices for one panel of each orbit of the symmetry there is.
    Symmetry,
    /// Iterations with sums by multipoles, Galerkin testing and no grounded plane.
    Multipoles {
        /// Of the charges, relative, from 1e-8 to 0.1.
        tolerance: f64,
    },
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// A panel without area.
    #[error("panel {panel} of electrode `{electrode}` has no area")]
    Degenerate {
        /// Which panel.
        panel: usize,
        /// Its electrode.
        electrode: String,
    },
    /// An electrode reaches down to the grounded plane.
    #[error("electrode `{electrode}` touches or crosses the grounded plane, or stands below it")]
    OnGround {
        /// The electrode.
        electrode: String,
    },
    /// A source's field is infinite on an electrode.
    #[error("the field of source number {source_number} is infinite on electrode `{electrode}`: move one of them")]
    SourceOnElectrode {
        /// Which source, from 1.
        source_number: usize,
        /// The electrode.
        electrode: String,
    },
    /// The matrix is not positive definite, as it must be for panels that do not lie on each other.
    #[error(
        "the matrix of potential coefficients is not positive definite at panel {panel} (electrode `{electrode}`): do panels there lie on each other?"
    )]
    NotPositiveDefinite {
        /// Which panel.
        panel: usize,
        /// Its electrode.
        electrode: String,
    },
    /// More unknowns than are allowed.
    #[error("the electrodes need {unknowns} unknowns, more than field.max_panels = {most}")]
    TooMany {
        /// Unknowns after symmetry.
        unknowns: usize,
        /// How many may be.
        most: usize,
    },
    /// It does not fit in memory.
    #[error("the matrix of {unknowns} unknowns needs {needed} bytes of memory, and {available} may be used")]
    TooLarge {
        /// Unknowns after symmetry.
        unknowns: usize,
        /// Bytes.
        needed: u64,
        /// Bytes.
        available: u64,
    },
    /// Iterations did not arrive.
    #[error(transparent)]
    Iterative(#[from] IterativeError),
    /// The charges do not reproduce the voltages they were asked for.
    #[error(
        "the solution misses its voltages by {residual:.1e} V per V (asked {asked:.0e}): panels of very different size or almost on each other?"
    )]
    Residual {
        /// Largest error of the potential in the rows that were looked at, relative.
        residual: f64,
        /// What it had to be.
        asked: f64,
    },
}

/// Residual a direct solution must reach, V per V. The condition number of some 10⁴ panels stays below 10⁵, so that rounding
/// leaves 1e-11; whatever misses this is broken.
const RESIDUAL: f64 = 1e-7;

/// Rows on which the residual is checked, spread over the panels; each costs as much as one row of the matrix.
const CHECKED_ROWS: usize = 64;

/// Seconds spent where, and how well the equations hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolveReport {
    /// Number of unknowns.
    pub unknowns: usize,
    /// Iterations; none where a matrix was factorised.
    pub iterations: usize,
    /// Filling the matrix, s. Not stored: what is kept took no time.
    #[serde(skip)]
    pub assembly_seconds: f64,
    /// Factorising it and solving, s. Not stored.
    #[serde(skip)]
    pub solve_seconds: f64,
    /// Largest error of the potential on the rows that were looked at, V per V.
    pub residual: f64,
    /// Bytes of the matrix.
    pub matrix_bytes: u64,
}

/// Charges of panels, in units of charge over Coulomb's constant (V m), and how they were found.
pub(crate) struct Solved {
    pub charge: Mat<f64>,
    pub coarse: Option<CoarseCapacitance>,
    pub unknowns: usize,
    pub iterations: usize,
    /// Of the iterations, relative.
    pub residual: f64,
    pub bytes: u64,
    pub assembly_seconds: f64,
    pub solve_seconds: f64,
}

/// Share of the progress bar that filling the matrix takes: a guess, on which nothing but the bar depends.
const ASSEMBLY: f64 = 0.8;

impl<'a> BoundaryProblem<'a> {
    /// The problem of electrodes alone, with Galerkin testing.
    pub fn new(mesh: &'a SurfaceMesh) -> Self {
        Self { mesh, sources: &[], testing: Testing::Galerkin, ground: None, with_coarse: false, by: By::Dense }
    }

    /// Bytes that [`BoundaryProblem::solve`] needs at its peak for that many panels and right-hand sides: the matrix, its
    /// right-hand sides twice, and the panels.
    pub fn memory_needed(panels: usize, right_hand_sides: usize) -> u64 {
        let n = panels as u64;
        8 * n * (n + 3 * right_hand_sides as u64 + 40)
    }

    /// Solves for every electrode at 1 V with the others at 0 V, and for every source of strength one with all electrodes
    /// at 0 V.
    ///
    /// # Errors
    /// See [`SolveError`].
    pub fn solve(&self) -> Result<ElectrodeBasis, SolveError> {
        self.solve_telling(&|_| ())
    }

    /// As [`BoundaryProblem::solve`]; `progress` hears the fraction of the work that is done, as far as it can be told: it
    /// stands still while the matrix is factorised.
    ///
    /// # Errors
    /// See [`SolveError`].
    pub fn solve_telling(&self, progress: &(dyn Fn(f64) + Sync)) -> Result<ElectrodeBasis, SolveError> {
        let mesh = self.mesh;
        let name = |panel: usize| mesh.electrodes[mesh.electrode[panel] as usize].name.clone();
        let panels: Vec<Panel> = (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect();
        // `!(area > 0)` also catches an area that is not a number.
        #[allow(clippy::neg_cmp_op_on_partial_ord)]
        if let Some(panel) = panels.iter().position(|p| !(p.area > 0.0)) {
            return Err(SolveError::Degenerate { panel, electrode: name(panel) });
        }
        let images: Option<Vec<Panel>> =
            self.ground.map(|plane| panels.iter().map(|panel| plane.image_of_panel(panel)).collect());
        #[allow(clippy::neg_cmp_op_on_partial_ord)]
        if let Some(plane) = &self.ground
            && let Some(panel) = panels.iter().position(|p| p.corners.iter().any(|c| !(plane.height(c) > 0.0)))
        {
            return Err(SolveError::OnGround { electrode: name(panel) });
        }
        let charge = self.right_hand_sides(&panels)?;
        let wanted = charge.clone();
        let solved = match self.by {
            By::Dense => self.solve_dense(&panels, images.as_deref(), charge, progress)?,
            By::Symmetry => {
                reduced::solve(mesh, &panels, images.as_deref(), self.ground.as_ref(), self.testing, &charge, progress)
            }
            By::Multipoles { tolerance } => {
                iterative::solve(mesh, &panels, &charge, tolerance, self.with_coarse, progress)?
            }
        };
        let Solved { charge, coarse, .. } = solved;
        let residual = match (self.testing, self.by) {
            // Of the true potentials iterations miss what their tolerance lets them.
            (_, By::Multipoles { .. }) => solved.residual,
            (Testing::Galerkin, _) => residual(&panels, images.as_deref(), &charge, &wanted),
            (Testing::Collocation, _) => 0.0,
        };
        if residual > RESIDUAL && !matches!(self.by, By::Multipoles { .. }) {
            return Err(SolveError::Residual { residual, asked: RESIDUAL });
        }
        // So far potentials were charges over metres.
        let charge = faer::Scale(1.0 / COULOMB) * &charge;
        let on_electrode =
            |electrode: usize, column: usize| -> f64 { mesh.panels_of(electrode).map(|p| charge[(p, column)]).sum() };
        let electrodes = mesh.electrodes.len();
        let charges: Vec<Vec<f64>> =
            (0..electrodes).map(|i| (0..electrodes).map(|k| on_electrode(i, k)).collect()).collect();
        let induced =
            (0..electrodes).map(|i| (electrodes..charge.ncols()).map(|k| on_electrode(i, k)).collect()).collect();
        Ok(ElectrodeBasis {
            mesh: mesh.clone(),
            panels,
            sources: self.sources.to_vec(),
            ground: self.ground,
            capacitance: CapacitanceMatrix::new(&charges),
            induced,
            coarse,
            form: SurfaceCharge::Panels,
            charge,
            report: SolveReport {
                unknowns: solved.unknowns,
                iterations: solved.iterations,
                assembly_seconds: solved.assembly_seconds,
                solve_seconds: solved.solve_seconds,
                residual,
                matrix_bytes: solved.bytes,
            },
        })
    }

    fn solve_dense(
        &self,
        panels: &[Panel],
        images: Option<&[Panel]>,
        mut charge: Mat<f64>,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Solved, SolveError> {
        let mesh = self.mesh;
        let name = |panel: usize| mesh.electrodes[mesh.electrode[panel] as usize].name.clone();
        let start = Instant::now();
        let told = |done| progress(ASSEMBLY * done);
        let matrix = potential_coefficients_telling(panels, images, self.testing, &told);
        let assembled = Instant::now();
        let coarse = (self.with_coarse && self.testing == Testing::Galerkin && !panels.is_empty())
            .then(|| coarse_capacitance(mesh, panels, &matrix))
            .flatten();
        if !panels.is_empty() {
            self.factorise_and_solve(matrix, &mut charge, name)?;
        }
        Ok(Solved {
            charge,
            coarse,
            unknowns: panels.len(),
            iterations: 0,
            residual: 0.0,
            bytes: 8 * (panels.len() * panels.len()) as u64,
            assembly_seconds: (assembled - start).as_secs_f64(),
            solve_seconds: assembled.elapsed().as_secs_f64(),
        })
    }

    /// Wanted potentials on the panels, V: one column for each electrode, then one for each source.
    fn right_hand_sides(&self, panels: &[Panel]) -> Result<Mat<f64>, SolveError> {
        let electrodes = self.mesh.electrodes.len();
        let mut columns = Mat::<f64>::zeros(panels.len(), electrodes + self.sources.len());
        for (p, &e) in self.mesh.electrode.iter().enumerate() {
            columns[(p, e as usize)] = 1.0;
        }
        let of = |source: &Source, x: &Vec3| source.potential_and_gradient_above(self.ground.as_ref(), x).0;
        for (s, source) in self.sources.iter().enumerate() {
            for (p, panel) in panels.iter().enumerate() {
                // The electrode's potential is zero: its own charges cancel what the source brings.
                let outside = match self.testing {
                    Testing::Collocation => of(source, &panel.centroid),
                    Testing::Galerkin => {
                        quadrature::rule(5).on(&panel.corners).map(|(x, weight)| weight * of(source, &x)).sum()
                    }
                };
                if !outside.is_finite() {
                    let electrode = self.mesh.electrodes[self.mesh.electrode[p] as usize].name.clone();
                    return Err(SolveError::SourceOnElectrode { source_number: s + 1, electrode });
                }
                columns[(p, electrodes + s)] = -outside;
            }
        }
        Ok(columns)
    }

    /// Solves for every column in place; the matrix is given up.
    fn factorise_and_solve(
        &self,
        mut matrix: Mat<f64>,
        columns: &mut Mat<f64>,
        name: impl Fn(usize) -> String,
    ) -> Result<(), SolveError> {
        let (n, par) = (matrix.nrows(), Par::rayon(0));
        if self.testing == Testing::Collocation {
            linear::solve(matrix, columns, par);
            return Ok(());
        }
        let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(n, par, Default::default()));
        let memory = MemStack::new(&mut memory);
        llt::factor::cholesky_in_place(matrix.as_mut(), Default::default(), par, memory, Default::default()).map_err(
            |llt::factor::LltError::NonPositivePivot { index }| SolveError::NotPositiveDefinite {
                panel: index,
                electrode: name(index),
            },
        )?;
        let mut memory = MemBuffer::new(llt::solve::solve_in_place_scratch::<f64>(n, columns.ncols(), par));
        llt::solve::solve_in_place(matrix.as_ref(), columns.as_mut(), par, MemStack::new(&mut memory));
        Ok(())
    }
}

/// Largest relative error of the potentials on some rows, each computed anew without the matrix.
fn residual(panels: &[Panel], images: Option<&[Panel]>, charge: &Mat<f64>, wanted: &Mat<f64>) -> f64 {
    let operator = GalerkinOperator { panels };
    let stride = panels.len().div_ceil(CHECKED_ROWS).max(1);
    let rows: Vec<usize> = (0..panels.len()).step_by(stride).collect();
    (0..charge.ncols())
        .map(|column| {
            let x: Vec<f64> = charge.col(column).iter().copied().collect();
            let largest = wanted.col(column).iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
            let of_image = |i: usize| -> f64 {
                let images = images.into_iter().flatten().zip(&x);
                images.map(|(image, x)| galerkin(&panels[i], image, false) * x).sum()
            };
            let potential = |i: usize| operator.row(i, &x) - of_image(i);
            let errors = rows.par_iter().map(|&i| (potential(i) - wanted[(i, column)]).abs() / largest);
            errors.reduce(|| 0.0, f64::max)
        })
        .fold(0.0, f64::max)
}
