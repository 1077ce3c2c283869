//! `[study]` resolved.

use meshes::Vec3;

use super::at::At;
use crate::case::{Asked, Study, Weighing};
use crate::error::CaseError;
use crate::keys::study::StudyKeys;
use crate::keys::value::{DirectionKeys, Vector};

pub(super) fn study(at: &At, keys: &StudyKeys) -> Result<Study, CaseError> {
    let axis = keys.axis.as_ref().map_or_else(Vec3::z, DirectionKeys::vector);
    let Some(axis) = axis.try_normalize(f64::MIN_POSITIVE.sqrt()) else {
        return Err(at.key("axis").error("{value} has no direction", "give it a length other than zero"));
    };
    let mut angles = Vec::with_capacity(keys.angles.len().max(1));
    for (n, angle) in keys.angles.iter().enumerate() {
        steep(&at.key("angles").entry(n), angle.value)?;
        angles.push(angle.value);
    }
    if angles.is_empty() {
        angles.push(0.0);
    }
    let cone = keys.cone.map(|cone| cone.value);
    cone.map_or(Ok(()), |cone| steep(&at.key("cone"), cone))?;
    Ok(Study {
        kind: keys.kind.unwrap_or_default(),
        center: keys.center.as_ref().map(Vector::si),
        axis,
        radius: keys.radius.map(|radius| radius.value),
        angles,
        cone,
        rays: keys.rays.map_or(RAYS, |rays| rays.count()),
        lines: keys.lines.map(|lines| lines.count()),
        weighing: Weighing {
            weight: keys.weight.map_or(1.0, |weight| weight.value),
            tolerated: keys.tolerated.map_or(TOLERATED, |tolerated| tolerated.value),
            smallest_wire: keys.smallest_wire.map_or(0.0, |wire| wire.value),
        },
        // What these depend on is known when the whole case is.
        asked: Asked::OF_SWEEPS,
        optimise: None,
    })
}

/// Enough for half a percent of the light.
const RAYS: usize = 20_000;

/// What the study of traps asks of its fields.
const TOLERATED: f64 = 0.01;

/// Refuses light that comes from the side: it would have to cross an endless grid.
fn steep(at: &At, angle: f64) -> Result<(), CaseError> {
    const STEEPEST: f64 = 80.0;
    if angle.to_degrees() > STEEPEST * (1.0 + 1e-12) {
        return Err(
            at.error(format!("{{value}} is more than {STEEPEST} deg"), "measure angles from the normal of the grid")
        );
    }
    Ok(())
}
