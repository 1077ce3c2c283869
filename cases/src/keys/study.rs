//! `[study]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::{Count, DirectionKeys, Fraction, Number, Vector};
use crate::quantity::kinds::{Angle, Length};
use crate::quantity::{NonNegative, Positive, Range};

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
}
