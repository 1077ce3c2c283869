//! `[study]` resolved.

use meshes::Vec3;

use super::at::At;
use crate::case::Study;
use crate::error::CaseError;
use crate::keys::study::StudyKeys;
use crate::keys::value::{DirectionKeys, Vector};

pub(super) fn study(at: &At, keys: &StudyKeys) -> Result<Study, CaseError> {
    let axis = keys.axis.as_ref().map_or_else(Vec3::z, DirectionKeys::vector);
    let Some(axis) = axis.try_normalize(f64::MIN_POSITIVE.sqrt()) else {
        return Err(at.key("axis").error("{value} has no direction", "give it a length other than zero"));
    };
    Ok(Study {
        kind: keys.kind.unwrap_or_default(),
        center: keys.center.as_ref().map(Vector::si),
        axis,
        radius: keys.radius.map(|radius| radius.value),
    })
}
