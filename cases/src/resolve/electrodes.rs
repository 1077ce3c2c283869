//! `[[electrode]]` resolved.

use field::Waveform;
use meshes::Placement;

use super::at::At;
use super::waveforms::{Drives, Role};
use super::{names, shapes};
use crate::case::{Drive, Electrode};
use crate::error::CaseError;
use crate::keys::electrode::{CommonKeys, ElectrodeKeys};
use crate::keys::value::{DirectionKeys, Vector};
use crate::quantity::Kind;
use crate::quantity::kinds::Length;

pub(super) fn electrodes(list: &At, keys: &[ElectrodeKeys], drives: &Drives) -> Result<Vec<Electrode>, CaseError> {
    let one = |(n, ElectrodeKeys(common, shape)): (usize, &ElectrodeKeys)| {
        let at = list.entry(n);
        names::check(&at.key("name"), &common.name)?;
        Ok(Electrode {
            name: common.name.clone(),
            shape: shapes::shape(&at, shape)?,
            placement: placement(&at, common.center.as_ref(), common.axis.as_ref(), common.up.as_ref())?,
            drive: drive(&at, common, drives)?,
            hollow: common.hollow,
            panels: common.panels.map(|panels| panels.count()),
        })
    };
    keys.iter().enumerate().map(one).collect()
}

/// Where something stands, with the defaults of [`Placement`].
pub(super) fn placement(
    at: &At,
    center: Option<&Vector<Length>>,
    axis: Option<&DirectionKeys>,
    up: Option<&DirectionKeys>,
) -> Result<Placement, CaseError> {
    let mut placement = Placement::default();
    if let Some(center) = center {
        placement.center = center.si();
    }
    if let Some(axis) = axis {
        placement.axis = axis.vector();
    }
    placement.up = up.map(DirectionKeys::vector);
    if placement.up.is_some_and(|up| up.norm() == 0.0) {
        return Err(at.key("up").error("{value} has no direction", "give it a length other than zero"));
    }
    match placement.frame() {
        Ok(_) => Ok(placement),
        Err(error) => {
            let at = at.key(error.key);
            let value = if at.written() { "{value} " } else { "" };
            Err(at.error(format!("{value}{}", error.problem), error.help))
        }
    }
}

fn drive(at: &At, common: &CommonKeys, drives: &Drives) -> Result<Drive, CaseError> {
    if let Some(charge) = common.charge {
        for (key, given) in [("dc", common.dc.is_some()), ("rf", common.rf.is_some())] {
            if given {
                let problem = format!(
                    "`charge` and `{key}` exclude each other: a charged electrode floats, a driven one is held"
                );
                return Err(at.key("charge").key_error(problem, format!("leave out `charge` or `{key}`")));
            }
        }
        return Ok(Drive::Charge(charge.value));
    }
    let role = Role { kind: Kind::Voltage, whom: "an electrode".to_owned() };
    Ok(Drive::Voltage(Waveform {
        // An electrode of which nothing is said is grounded.
        constant: common.dc.map_or(0.0, |dc| dc.value),
        parts: drives.parts(&at.key("rf"), common.rf.as_ref(), &role)?,
    }))
}
