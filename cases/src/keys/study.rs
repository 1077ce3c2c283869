//! `[study]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::sweep::{End, Scale};
use super::value::{Count, DirectionKeys, Fraction, Number, Vector, Whole};
use crate::quantity::kinds::{Angle, Length};
use crate::quantity::{NonNegative, Positive, Range};

/// Keys of `[study]` that only an optimisation has.
pub(crate) const OF_OPTIMISATION: [&str; 10] =
    ["objective", "goal", "constraints", "vary", "tie", "evaluations", "tolerance", "optimiser", "starts", "seed"];

/// `[study]`
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StudyKeys {
    /// What is asked; left out: "sweep".
    pub kind: Option<StudyKind>,
    /// About which point the multipoles of the field are told; left out: the middle of the trap region.
    pub center: Option<Vector<Length>>,
    /// Along which axis; left out: "z".
    pub axis: Option<DirectionKeys>,
    /// On which sphere; left out: half the way to the nearest conductor.
    pub radius: Option<Positive<Length>>,
    /// Angles from the normal at which light falls on grids; left out: straight on.
    #[serde(default)]
    pub angles: Vec<NonNegative<Angle>>,
    /// Half angle of a cone from which light falls on grids; left out: none.
    pub cone: Option<Positive<Angle>>,
    /// How many rays each transparency is told from; left out: 20000.
    pub rays: Option<Count>,
    /// How many field lines are followed to each grid from both sides; left out: 200 where grains fly, else none.
    pub lines: Option<Count>,
    /// What light that is lost counts against the deviation of the field over what is tolerated; left out: 1.
    pub weight: Option<Number<Above>>,
    /// Deviation of the field that is tolerated, against the strongest; left out: 0.01.
    pub tolerated: Option<Fraction>,
    /// The narrowest wire, or bar between holes, that can be made; left out: any.
    pub smallest_wire: Option<Positive<Length>>,
    /// What is optimised, of the numbers that are reported: "depth_ev", "-abs(A4 / A2)", "depth_ev / 1e6 - 2 * (q_z - 0.3)^2".
    pub objective: Option<String>,
    /// Whether the objective is to be as large or as small as can be; left out: "maximise".
    pub goal: Option<Goal>,
    /// What must hold, as "q_z <= 0.4" or "wire >= 0.1 mm".
    #[serde(default)]
    pub constraints: Vec<String>,
    /// What is varied to that end: key paths in quotes, as "electrode.ring.radius", and names of lengths, voltages, ... that `tie`
    /// makes keys of.
    #[serde(default)]
    pub vary: BTreeMap<String, VaryKeys>,
    /// Keys that follow: key paths in quotes with what they are made of, as "electrode.left.opening" = "electrode.right.opening".
    #[serde(default)]
    pub tie: BTreeMap<String, String>,
    /// How many cases may be worked out; left out: 200.
    pub evaluations: Option<Count>,
    /// When to stop: what is varied is known to this part of its range; left out: 1e-4.
    pub tolerance: Option<Fraction>,
    /// What searches; left out: "cobyla".
    pub optimiser: Option<Optimiser>,
    /// From how many places the search starts: the given one, then points of Sobol's sequence; left out: 1.
    pub starts: Option<Count>,
    /// Of these points; left out: 1.
    pub seed: Option<Whole<0>>,
}

/// The bounds of what is varied.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct VaryKeys {
    /// The least value: a number, or a string with a unit.
    pub from: End,
    /// The largest, in the same unit.
    pub to: End,
    /// Where the search starts, in the same unit; left out: in the middle.
    pub start: Option<End>,
    /// Only `from` and whole steps above it, as can be made; left out: any value.
    pub step: Option<End>,
    /// Whether equal differences or equal ratios count alike; left out: "linear".
    pub scale: Option<Scale>,
}

/// Which way is better.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// Larger.
    #[default]
    Maximise,
    /// Smaller.
    Minimise,
}

/// What searches for the optimum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Optimiser {
    /// Without derivatives, by linear models in a region that shrinks (Powell 1994); for whatever is reported.
    #[default]
    Cobyla,
    /// With gradients from central differences, by quadratic models (Kraft 1988); for what is smooth.
    Slsqp,
}

/// More than zero.
#[derive(Clone, Copy)]
pub(crate) struct Above;
impl Range for Above {
    const MUST: &'static str = "must be more than 0";
    const BOUNDS: &'static [(&'static str, f64)] = &[("exclusiveMinimum", 0.0)];
    const SIGNED: bool = false;
    fn contains(value: f64) -> bool {
        value > 0.0
    }
}

/// What a study asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StudyKind {
    /// The numbers of each point.
    #[default]
    Sweep,
    /// How much light grids let through, and how far the field is from that of plates without holes.
    GridTransparency,
    /// Which values of some keys make an objective as large, or as small, as can be.
    Optimise,
}
