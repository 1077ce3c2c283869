//! `[field]`, `[table]`, `[forces]`, `[trace]` and `[output]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::{Count, DirectionKeys, Fraction, Vector, Whole};
use crate::quantity::kinds::{Acceleration, Force, Length, MagneticField, Memory, Pressure, Temperature, Time};
use crate::quantity::{Drag, NonNegative, Positive, Si};

/// `[field]`
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FieldKeys {
    /// Wanted relative error of the field in the trap region; left out: 1e-3.
    pub accuracy: Option<Fraction>,
    /// Wanted number of panels in all; left out: chosen from the accuracy.
    pub panels: Option<Count>,
    /// No more panels (or unknowns of curved elements) than this; left out: 8000 where there is a matrix (0.5 GB), 40000 with
    /// multipoles.
    pub max_panels: Option<Count>,
    /// What solves for the charges; left out: "auto".
    pub solver: Option<Solver>,
    /// What the charges sit on and how the boundary condition is imposed on them; left out: "auto".
    pub method: Option<Method>,
    /// An infinite plane at 0 V with everything on the side that its axis points to; left out: none.
    pub ground: Option<GroundKeys>,
}

/// An infinite plane at 0 V. The field of a source above it includes that of its image.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GroundKeys {
    /// A point of the plane; the origin if left out.
    pub center: Option<Vector<Length>>,
    /// Its normal, to the side of the electrodes; left out: "z".
    pub axis: Option<DirectionKeys>,
}

/// What solves for the charges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// Chosen from the electrodes and the accuracy.
    #[default]
    Auto,
    /// The whole matrix, factorised: any electrodes, up to some thousand panels.
    Dense,
    /// The whole matrix, reduced by the mirrors and rotations that the electrodes have in common.
    Symmetric,
    /// Charge along the generating curves of electrodes that are round about one axis.
    Axisymmetric,
    /// Without a matrix, far panels together: many panels.
    Multipole,
}

/// What the charges sit on and how the boundary condition is imposed on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Chosen from the electrodes and the accuracy.
    #[default]
    Auto,
    /// Constant charge on flat triangles, the condition on average over each: more exact for the same number of panels.
    Galerkin,
    /// Constant charge on flat triangles, the condition at the centre of each: faster to set up.
    Collocation,
    /// Charge of high order on the true surface: the most exact; not for meshes from files.
    Curved,
}

/// `[table]`
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TableKeys {
    /// Lower corner of the tabulated box; left out (with `max`): chosen around the trap.
    pub min: Option<Vector<Length>>,
    /// Upper corner.
    pub max: Option<Vector<Length>>,
    /// Wanted relative error of the tabulated field; left out: that of `field.accuracy`.
    pub accuracy: Option<Fraction>,
    /// Size of its cells, the same everywhere, a quarter of the distance of its nodes; left out: chosen from the accuracy, smaller
    /// where the field needs it.
    pub spacing: Option<Positive<Length>>,
    /// No more memory than this; left out: chosen from what the machine has.
    pub max_memory: Option<Positive<Memory>>,
}

/// `[forces]`
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ForceKeys {
    /// Drag of the gas: a rate as "0.1 /s", a coefficient as "1e-14 kg/s", or a model.
    pub drag: Option<DragKeys>,
    /// Acceleration of gravity; left out: none.
    pub gravity: Option<Vector<Acceleration>>,
    /// A constant force on every grain; left out: none.
    pub constant: Option<Vector<Force>>,
    /// Whether grains repel each other; left out: they do not.
    pub coulomb: Option<bool>,
    /// Whether grains feel the charges that they all induce on the electrodes; left out: they do not.
    pub image_charge: Option<bool>,
    /// Relative error that the repulsion of some thousand grains and more may have; fewer are summed pair by pair. Left out:
    /// that of `trace.accuracy`.
    pub coulomb_accuracy: Option<Fraction>,
    /// Magnetic field; left out: none.
    pub magnetic_field: Option<Vector<MagneticField>>,
    /// Temperature of the random kicks of the gas (needs `drag`); left out: no kicks.
    pub langevin: Option<NonNegative<Temperature>>,
}

/// `drag = ...`
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum DragKeys {
    /// A rate or a coefficient.
    Quantity(Drag),
    /// A model.
    Table(GasDragKeys),
}

/// Drag from the properties of the gas.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "model")]
pub(crate) enum GasDragKeys {
    /// Viscous, with the slip correction: grains larger than the mean free path.
    Stokes {
        /// The gas.
        gas: Gas,
        /// Its pressure.
        pressure: Positive<Pressure>,
        /// Its temperature; left out: "20 degC".
        temperature: Option<Positive<Temperature>>,
    },
    /// Free molecules: grains smaller than the mean free path.
    Epstein {
        /// The gas.
        gas: Gas,
        /// Its pressure.
        pressure: Positive<Pressure>,
        /// Its temperature; left out: "20 degC".
        temperature: Option<Positive<Temperature>>,
        /// How molecules leave the grain; left out: "diffuse".
        reflection: Option<Reflection>,
    },
}

/// A gas whose molecules and viscosity are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gas {
    /// Dry air.
    Air,
    /// H2.
    Hydrogen,
    /// He.
    Helium,
    /// Ne.
    Neon,
    /// N2.
    Nitrogen,
    /// O2.
    Oxygen,
    /// Ar.
    Argon,
    /// CO2.
    CarbonDioxide,
    /// Kr.
    Krypton,
    /// Xe.
    Xenon,
}

/// How molecules leave a grain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reflection {
    /// Like light from a mirror.
    Specular,
    /// In all directions, as from real, rough grains.
    #[default]
    Diffuse,
}

/// `[trace]`
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TraceKeys {
    /// How long the grains are traced.
    pub duration: Positive<Time>,
    /// Time at which they start, on the clock of the waveforms; left out: 0.
    pub start: Option<Si<Time>>,
    /// Seed of all random numbers; left out: 1.
    pub seed: Option<Whole<0>>,
    /// How the equation of motion is integrated; left out: "auto".
    pub integrator: Option<Integrator>,
    /// Fixed (or first) time step; left out: chosen from the accuracy.
    pub step: Option<Positive<Time>>,
    /// Wanted relative error of the trajectories; left out: 1e-6.
    pub accuracy: Option<Fraction>,
    /// Grains that leave this box are lost; left out: half as large again on every side as all that stands in the case.
    pub region: Option<RegionKeys>,
}

/// A box.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegionKeys {
    /// Lower corner.
    pub min: Vector<Length>,
    /// Upper corner.
    pub max: Vector<Length>,
}

/// How the equation of motion is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Chosen from the forces.
    #[default]
    Auto,
    /// Runge-Kutta of order 8 with adaptive steps.
    Dop853,
    /// Velocity Verlet.
    Verlet,
    /// Boris, for magnetic fields.
    Boris,
    /// With random kicks.
    Langevin,
    /// Symplectic of order 4.
    Symplectic4,
    /// Symplectic of order 6.
    Symplectic6,
    /// Multistep of order 12, one force a step, for smooth forces without magnetic field.
    Stoermer12,
    /// The same with steps from the accuracy, for grains that feel each other.
    Stoermer,
}

/// `[output]`
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutputKeys {
    /// Time between samples of the trajectories; left out: chosen from the fastest motion.
    pub every: Option<Positive<Time>>,
    /// About how many nodes the written field has; left out: chosen.
    pub field_nodes: Option<Count>,
    /// Time on the clock after which a long run keeps anew where its grains are, for --resume; left out: 10 s.
    pub checkpoint: Option<Positive<Time>>,
}
