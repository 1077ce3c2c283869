//! The solution of a boundary problem: charges on every panel for each unit excitation.

use std::sync::Arc;

use faer::Mat;
use meshes::{SurfaceMesh, Vec3};
use serde::{Deserialize, Serialize};

use crate::axial::AxialCharge;
use crate::boundary_problem::SolveReport;
use crate::capacitance::CapacitanceMatrix;
use crate::coarse::CoarseCapacitance;
use crate::curved::{CurvedCharge, CurvedSolution};
use crate::panel::Panel;
use crate::panel_sum::PanelSum;
use crate::plane::Plane;
use crate::shown;
use crate::source::Source;

/// What the charges of a solution are.
#[derive(Clone, Debug)]
pub enum SurfaceCharge {
    /// Constant on each panel.
    Panels,
    /// Of high order on the true surface; the panels show it.
    Curved(Arc<CurvedCharge>),
    /// On generating curves about one axis; the panels show it.
    Axial(Arc<AxialCharge>),
}

/// Unit solutions: basis function k is electrode k at 1 V with the others at 0 V; after the electrodes come the sources, each
/// of strength one with all electrodes at 0 V.
///
/// It can be stored with serde, and comes back the same to the last bit, without what can be found again: panels, times, the
/// coarse capacitances.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct ElectrodeBasis {
    /// The surface.
    pub mesh: SurfaceMesh,
    /// Its panels, in the same order.
    pub panels: Vec<Panel>,
    /// Outside fields in closed form.
    pub sources: Vec<Source>,
    /// A grounded plane, with everything above it: every charge and every source has an image of opposite sign.
    pub ground: Option<Plane>,
    /// What its charges are.
    pub form: SurfaceCharge,
    /// Charge of each panel (row) in each basis function (column), C per volt or per unit of source strength. Where the form is
    /// not panels, what the density makes of the panel, with the right sum on each electrode.
    pub charge: Mat<f64>,
    /// Charges on electrodes for unit voltages.
    pub capacitance: CapacitanceMatrix,
    /// Charge on each electrode (row) that each source (column) of strength one induces, C.
    pub induced: Vec<Vec<f64>>,
    /// Capacitances of a coarser charge on the same surface, where they were asked for.
    pub coarse: Option<CoarseCapacitance>,
    /// How the solution went.
    pub report: SolveReport,
}

impl ElectrodeBasis {
    /// A solution that was kept: `charges` as [`ElectrodeBasis::charges`] gives them.
    ///
    /// # Panics
    /// The number of charges is not that of panels times basis functions.
    pub fn from_charges(
        mesh: SurfaceMesh,
        sources: Vec<Source>,
        ground: Option<Plane>,
        charges: &[f64],
        capacitance: CapacitanceMatrix,
        induced: Vec<Vec<f64>>,
        report: SolveReport,
    ) -> Self {
        let (rows, columns) = (mesh.panels(), mesh.electrodes.len() + sources.len());
        assert_eq!(charges.len(), rows * columns, "a charge for each panel and basis function");
        let panels = (0..rows).map(|p| Panel::new(mesh.corners(p))).collect();
        let charge = Mat::from_fn(rows, columns, |p, k| charges[k * rows + p]);
        Self {
            mesh,
            panels,
            sources,
            ground,
            form: SurfaceCharge::Panels,
            charge,
            capacitance,
            induced,
            coarse: None,
            report,
        }
    }

    /// A solution with curved elements; `mesh` shows it and is what grains strike.
    pub fn from_curved(
        mesh: SurfaceMesh,
        sources: Vec<Source>,
        ground: Option<Plane>,
        solution: CurvedSolution,
    ) -> Self {
        let electrodes = mesh.electrodes.len();
        let part = |from: usize, to: usize| -> Vec<Vec<f64>> {
            solution.totals.iter().map(|row| row[from..to].to_vec()).collect()
        };
        let capacitance = CapacitanceMatrix::new(&part(0, electrodes));
        let induced = part(electrodes, electrodes + sources.len());
        let report = SolveReport {
            unknowns: solution.unknowns,
            iterations: solution.iterations,
            assembly_seconds: solution.assembly_seconds,
            solve_seconds: solution.solve_seconds,
            residual: solution.residual,
            matrix_bytes: solution.matrix_bytes,
        };
        let form = SurfaceCharge::Curved(Arc::new(solution.charge));
        Self::shown(mesh, sources, ground, form, capacitance, induced, report)
    }

    /// A solution on generating curves; `mesh` shows it and is what grains strike. `seconds` is what it took.
    pub fn from_axial(
        mesh: SurfaceMesh,
        sources: Vec<Source>,
        ground: Option<Plane>,
        charge: AxialCharge,
        seconds: f64,
    ) -> Self {
        let unknowns = charge.solution.unknowns();
        let report = SolveReport {
            unknowns,
            iterations: 0,
            assembly_seconds: 0.0,
            solve_seconds: seconds,
            residual: charge.solution.data.misfit,
            matrix_bytes: 8 * (unknowns * unknowns) as u64,
        };
        let (capacitance, induced) = (charge.solution.capacitance.clone(), charge.solution.data.induced.clone());
        Self::shown(mesh, sources, ground, SurfaceCharge::Axial(Arc::new(charge)), capacitance, induced, report)
    }

    fn shown(
        mesh: SurfaceMesh,
        sources: Vec<Source>,
        ground: Option<Plane>,
        form: SurfaceCharge,
        capacitance: CapacitanceMatrix,
        induced: Vec<Vec<f64>>,
        report: SolveReport,
    ) -> Self {
        let panels: Vec<Panel> = (0..mesh.panels()).map(|p| Panel::new(mesh.corners(p))).collect();
        let densities = |points: &[(Vec3, usize)]| match &form {
            SurfaceCharge::Panels => Vec::new(),
            SurfaceCharge::Curved(charge) => charge.densities(points),
            SurfaceCharge::Axial(charge) => charge.densities(points),
        };
        let electrodes = mesh.electrodes.len();
        let wanted = |e: usize, k: usize| match k.checked_sub(electrodes) {
            None => capacitance.matrix[e][k],
            Some(source) => induced[e][source],
        };
        let charge = shown::charges(&mesh, &panels, electrodes + sources.len(), &densities, &wanted);
        Self { mesh, panels, sources, ground, form, charge, capacitance, induced, coarse: None, report }
    }

    /// The charges of all panels, basis function after basis function, C.
    pub fn charges(&self) -> Vec<f64> {
        (0..self.functions()).flat_map(|k| (0..self.panels.len()).map(move |p| self.charge[(p, k)])).collect()
    }

    /// Number of basis functions: electrodes and sources.
    pub fn functions(&self) -> usize {
        self.mesh.electrodes.len() + self.sources.len()
    }

    /// Surface charge density of each panel in one basis function, C/m² per volt (or per unit of strength).
    pub fn charge_density(&self, function: usize) -> Vec<f64> {
        self.panels.iter().enumerate().map(|(p, panel)| self.charge[(p, function)] / panel.area).collect()
    }

    /// The exact field of every basis function.
    pub fn panel_sum(&self) -> PanelSum {
        let identity: Vec<Vec<f64>> = (0..self.functions())
            .map(|k| (0..self.functions()).map(|l| f64::from(u8::from(k == l))).collect())
            .collect();
        self.combined(&identity)
    }

    /// The exact field of combinations of basis functions: channel c is Σ_k `weights[c][k]` times basis function k.
    ///
    /// # Panics
    /// A row of weights has another length than there are basis functions.
    pub fn combined(&self, weights: &[Vec<f64>]) -> PanelSum {
        assert!(weights.iter().all(|row| row.len() == self.functions()), "a weight for each basis function");
        PanelSum::new(self, weights.iter().map(|row| Arc::from(row.as_slice())).collect())
    }
}

/// A solution as it is stored.
#[derive(Serialize, Deserialize)]
struct Stored {
    mesh: SurfaceMesh,
    sources: Vec<Source>,
    ground: Option<Plane>,
    charge: StoredCharge,
    capacitance: CapacitanceMatrix,
    induced: Vec<Vec<f64>>,
    report: SolveReport,
}

/// Charges as they are stored: a variant for each way to represent them.
#[derive(Serialize, Deserialize)]
enum StoredCharge {
    /// Constant on each panel, C: basis function after basis function.
    Panels(Vec<f64>),
    /// Curved elements.
    Curved(CurvedCharge),
    /// Generating curves.
    Axial(Box<AxialCharge>),
}

impl From<ElectrodeBasis> for Stored {
    fn from(basis: ElectrodeBasis) -> Self {
        let charge = match &basis.form {
            SurfaceCharge::Panels => StoredCharge::Panels(basis.charges()),
            SurfaceCharge::Curved(charge) => StoredCharge::Curved((**charge).clone()),
            SurfaceCharge::Axial(charge) => StoredCharge::Axial(Box::new((**charge).clone())),
        };
        let ElectrodeBasis { mesh, sources, ground, capacitance, induced, report, .. } = basis;
        Self { mesh, sources, ground, charge, capacitance, induced, report }
    }
}

impl TryFrom<Stored> for ElectrodeBasis {
    type Error = &'static str;

    /// Numbers that do not fit together make no solution.
    fn try_from(stored: Stored) -> Result<Self, Self::Error> {
        let Stored { mesh, sources, ground, charge, capacitance, induced, report } = stored;
        let (panels, electrodes) = (mesh.triangles.len(), mesh.electrodes.len());
        let corners = mesh.triangles.iter().flatten().all(|v| (*v as usize) < mesh.vertices.len());
        let owners = mesh.electrode.len() == panels && mesh.electrode.iter().all(|e| (*e as usize) < electrodes);
        let square =
            |rows: &[Vec<f64>], columns: usize| rows.len() == electrodes && rows.iter().all(|row| row.len() == columns);
        if !corners || !owners || !square(&capacitance.matrix, electrodes) || !square(&induced, sources.len()) {
            return Err("the mesh or the capacitances do not fit together");
        }
        match charge {
            StoredCharge::Panels(charges) if panels.checked_mul(electrodes + sources.len()) == Some(charges.len()) => {
                Ok(Self::from_charges(mesh, sources, ground, &charges, capacitance, induced, report))
            }
            StoredCharge::Panels(_) => Err("not a charge for each panel and basis function"),
            StoredCharge::Curved(charge)
                if charge.is_whole(electrodes) && charge.functions == electrodes + sources.len() =>
            {
                let form = SurfaceCharge::Curved(Arc::new(charge));
                Ok(Self::shown(mesh, sources, ground, form, capacitance, induced, report))
            }
            StoredCharge::Axial(charge)
                if charge.solution.capacitance == capacitance && charge.solution.data.induced == induced =>
            {
                let form = SurfaceCharge::Axial(Arc::new(*charge));
                Ok(Self::shown(mesh, sources, ground, form, capacitance, induced, report))
            }
            StoredCharge::Curved(_) | StoredCharge::Axial(_) => Err("charges and elements do not fit together"),
        }
    }
}
