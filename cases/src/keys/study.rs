//! `[study]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::{DirectionKeys, Vector};
use crate::quantity::Positive;
use crate::quantity::kinds::Length;

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
}

/// What a study asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StudyKind {
    /// The numbers of each point.
    #[default]
    Sweep,
}
