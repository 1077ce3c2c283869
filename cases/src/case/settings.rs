//! Everything in a case that is neither electrode nor source.

use field::Plane;
use meshes::Vec3;
use serde::Serialize;
use tracer::{Launch, Place};

use super::{Asked, Gas, Integrator, Method, Optimise, Reflection, Sampling, Solver, StudyKind, foreign};

/// How exactly the field is computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldSettings {
    /// Wanted relative error of the field in the trap region.
    pub accuracy: f64,
    /// Wanted number of panels in all; `None`: to be chosen.
    pub panels: Option<usize>,
    /// No more panels (or unknowns of curved elements) than this; `None`: what the solver can do in some ten seconds.
    pub max_panels: Option<usize>,
    /// What solves for the charges.
    pub solver: Solver,
    /// What the charges sit on and how the boundary condition is imposed on them.
    pub method: Method,
    /// An infinite plane at 0 V with everything above it. Then nothing else is called [`GROUND`].
    pub ground: Option<Plane>,
}

/// What the grounded plane is called in results.
pub const GROUND: &str = "ground";

/// The tabulated potential.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableSettings {
    /// Corners of the box, m; `None`: to be chosen around the trap.
    pub region: Option<Region>,
    /// Wanted relative error of the tabulated field.
    pub accuracy: f64,
    /// Distance of nodes, m; `None`: to be chosen.
    pub spacing: Option<f64>,
    /// Bytes; `None`: to be chosen.
    pub max_memory: Option<u64>,
}

/// A box with edges along the axes; in every direction `min < max`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Region {
    /// Lower corner, m.
    pub min: Vec3,
    /// Upper corner, m.
    pub max: Vec3,
}

/// Equal grains that start in the same way.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GrainGroup {
    /// Letters, digits, `_` and `-`; unique among groups.
    pub name: String,
    /// How many; at least one.
    pub count: usize,
    /// Of one grain, kg.
    pub mass: f64,
    /// Of one grain, C.
    pub charge: f64,
    /// Of one grain, m; zero is a point.
    pub radius: f64,
    /// Where they start.
    #[serde(serialize_with = "foreign::place")]
    pub place: Place,
    /// How they start to move.
    #[serde(serialize_with = "foreign::launch")]
    pub launch: Launch,
}

/// What acts on the grains besides the field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forces {
    /// Drag of the gas.
    pub drag: Drag,
    /// m/s².
    pub gravity: Vec3,
    /// On every grain, N.
    pub constant: Vec3,
    /// Grains repel each other.
    pub coulomb: bool,
    /// Grains feel the charges that they all induce on the electrodes.
    pub image_charge: bool,
    /// Relative error that this may have with many grains; `None`: that of the trajectories.
    pub coulomb_accuracy: Option<f64>,
    /// T.
    pub magnetic_field: Vec3,
    /// Temperature of the random kicks of the gas, K; then there is a drag.
    pub langevin: Option<f64>,
}

/// Drag, which opposes the velocity v of a grain of mass m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Drag {
    /// No gas.
    None,
    /// Force = -rate m v, 1/s.
    Rate(f64),
    /// Force = -coefficient v, kg/s.
    Coefficient(f64),
    /// Viscous gas, with the slip correction. Every grain has a radius.
    Stokes {
        /// The gas.
        gas: Gas,
        /// Pa.
        pressure: f64,
        /// K.
        temperature: f64,
    },
    /// Free molecules. Every grain has a radius.
    Epstein {
        /// The gas.
        gas: Gas,
        /// Pa.
        pressure: f64,
        /// K.
        temperature: f64,
        /// How molecules leave the grain.
        reflection: Reflection,
    },
}

/// How the grains are traced.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TraceSettings {
    /// s; positive.
    pub duration: f64,
    /// Time on the clock of the waveforms at which they start, s.
    pub start: f64,
    /// Of all random numbers.
    pub seed: u64,
    /// How the equation of motion is integrated.
    pub integrator: Integrator,
    /// s; `None`: to be chosen from the accuracy.
    pub step: Option<f64>,
    /// Wanted relative error of the trajectories.
    pub accuracy: f64,
    /// Grains that leave it are lost; `None`: half as large again on every side as all that stands in the case.
    pub region: Option<Region>,
}

/// What is written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Output {
    /// Time between samples of the trajectories, s; `None`: to be chosen.
    pub every: Option<f64>,
    /// About how many nodes the written field has; `None`: to be chosen.
    pub field_nodes: Option<usize>,
    /// Time on the clock between checkpoints, s; `None`: to be chosen. No result depends on it.
    #[serde(skip)]
    pub checkpoint: Option<f64>,
}

/// A study: the case once for each combination of values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sweep {
    /// What is varied, in the order of the file; at least one.
    pub axes: Vec<SweepAxis>,
    /// How the values of several keys are combined.
    pub sampling: Sampling,
    /// What to report of each point; none: everything.
    pub report: Vec<String>,
}

/// One key and the values it takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepAxis {
    /// A key path of the case.
    pub key: String,
    /// Each as text that stands behind the `=` of a `--set`; at least one. Unless `sampling` is a grid, one for each point.
    pub values: Vec<String>,
    /// They are spread with equal ratios.
    pub log: bool,
    /// The ends of the range they are from, in their unit, where they are from one.
    pub range: Option<[f64; 2]>,
    /// The unit of the range; empty for pure numbers.
    pub unit: String,
}

impl Sweep {
    /// How many points there are; `None` beyond any number.
    pub fn count(&self) -> Option<usize> {
        match self.sampling {
            Sampling::Grid => self.axes.iter().try_fold(1_usize, |n, axis| n.checked_mul(axis.values.len())),
            _ => self.axes.first().map(|axis| axis.values.len()),
        }
    }

    /// The values of one point, one for each axis. Of a grid the last axis changes fastest.
    pub fn point(&self, number: usize) -> Vec<&str> {
        let mut rest = number;
        let mut values: Vec<&str> = self
            .axes
            .iter()
            .rev()
            .map(|axis| {
                let n = if self.sampling == Sampling::Grid { rest % axis.values.len() } else { number };
                rest /= axis.values.len();
                axis.values[n].as_str()
            })
            .collect();
        values.reverse();
        values
    }
}

/// What a study asks, and where it looks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// What is asked.
    pub kind: StudyKind,
    /// About which point multipoles are told, m; `None`: the middle of the trap region.
    pub center: Option<Vec3>,
    /// Along which axis, of unit length.
    pub axis: Vec3,
    /// On which sphere, m; `None`: half the way to the nearest conductor.
    pub radius: Option<f64>,
    /// Angles from the normal at which light falls on grids, rad; below a right angle.
    pub angles: Vec<f64>,
    /// Half angle of a cone from which it falls, rad.
    pub cone: Option<f64>,
    /// How many rays each transparency is told from.
    pub rays: usize,
    /// How many field lines are followed from each side; `None`: to be chosen.
    pub lines: Option<usize>,
    /// What a study of grids weighs. Rows do not depend on it.
    #[serde(skip)]
    pub weighing: Weighing,
    /// Which numbers are worked out.
    #[serde(skip_serializing_if = "Asked::is_of_sweeps")]
    pub asked: Asked,
    /// What is optimised. Rows do not depend on it.
    #[serde(skip)]
    pub optimise: Option<Optimise>,
}

/// What makes a grid the best: the least of `weight` (1 - T) + deviation / `tolerated`, T the transparency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighing {
    /// Of light that is lost.
    pub weight: f64,
    /// Deviation of the field that is tolerated, against the strongest.
    pub tolerated: f64,
    /// The narrowest wire, or bar between holes, that can be made, m.
    pub smallest_wire: f64,
}
