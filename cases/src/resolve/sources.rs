//! `[[source]]` resolved.

use field::Waveform;

use super::at::At;
use super::electrodes::placement;
use super::names;
use super::waveforms::{Drives, Role};
use crate::case::{Source, SourceKind};
use crate::error::CaseError;
use crate::keys::source::{CommonKeys, SourceKeys, SourceKind as Keys};
use crate::quantity::{Amplitude, Kind};

pub(super) fn sources(list: &At, keys: &[SourceKeys], drives: &Drives) -> Result<Vec<Source>, CaseError> {
    keys.iter().enumerate().map(|(n, keys)| source(&list.entry(n), keys, n, drives)).collect()
}

fn source(at: &At, SourceKeys(common, kind): &SourceKeys, n: usize, drives: &Drives) -> Result<Source, CaseError> {
    let name = names::or_default(at, common.name.as_deref(), "source", n)?;
    let center = common.center.as_ref();
    let (kind, placement, measures, whom) = match kind {
        Keys::Quadrupole { r0, z0, dimensions, axis, up } => {
            let dimensions = dimensions.map_or(3, |dimensions| dimensions.0);
            if dimensions == 2 && z0.is_some() {
                let problem = "`z0` is the distance of the caps; a quadrupole in two dimensions has none";
                return Err(at.key("z0").key_error(problem, "leave out `z0`, or write dimensions = 3"));
            }
            let kind = SourceKind::Quadrupole { r0: r0.value, z0: z0.map(|z0| z0.value), dimensions };
            (kind, placement(at, center, axis.as_ref(), up.as_ref())?, Kind::Voltage, "a quadrupole")
        }
        Keys::Uniform { direction } => {
            let Some(unit) = direction.vector().try_normalize(f64::MIN_POSITIVE.sqrt()) else {
                return Err(at.key("direction").error("{value} has no direction", "give it a length other than zero"));
            };
            let mut placement = placement(at, center, None, None)?;
            placement.axis = unit;
            (SourceKind::Uniform { direction: unit }, placement, Kind::ElectricField, "a uniform field")
        }
        Keys::Point {} => (SourceKind::Point, placement(at, center, None, None)?, Kind::Charge, "a point"),
        Keys::ThinRing { radius, axis } => {
            let kind = SourceKind::ThinRing { radius: radius.value };
            (kind, placement(at, center, axis.as_ref(), None)?, Kind::Charge, "a thin ring")
        }
    };
    let role = Role { kind: measures, whom: whom.to_owned() };
    let waveform = Waveform {
        constant: constant(at, common, &role)?,
        parts: drives.parts(&at.key("rf"), common.rf.as_ref(), &role)?,
    };
    if !["dc", "rf", "charge"].iter().any(|key| at.key(key).written()) {
        // Unlike an electrode, which shapes the field even when it is grounded, such a source does nothing at all.
        let key = if measures == Kind::Charge { "charge" } else { "dc" };
        let help = format!("add {key} = \"{}\", or rf = {{ ... }}", measures.example());
        return Err(at.missing(key, &format!("{whom} without `{key}` and `rf` does nothing"), help));
    }
    Ok(Source { name, kind, placement, waveform })
}

/// The constant strength: `charge` for charges, `dc` for the others.
fn constant(at: &At, common: &CommonKeys, role: &Role) -> Result<f64, CaseError> {
    let charged = role.kind == Kind::Charge;
    let whom = &role.whom;
    let (right, wrong) = if charged { (common.charge, common.dc) } else { (common.dc, common.charge) };
    let (right_key, wrong_key) = if charged { ("charge", "dc") } else { ("dc", "charge") };
    if wrong.is_some() {
        let problem = match role.kind {
            Kind::Charge => format!("`dc` is a voltage, but {whom} has no surface to hold one: it has a charge"),
            Kind::ElectricField => format!("`charge` makes no uniform field: {whom} has a strength in volts per metre"),
            _ => format!("`charge` makes no ideal quadrupole: {whom} has a voltage between its electrodes"),
        };
        let help = format!("write {right_key} = \"{}\"", role.kind.example());
        return Err(at.key(wrong_key).key_error(problem, help));
    }
    match right {
        Some(Amplitude { kind: Some(kind), .. }) if kind != role.kind => {
            let help = format!("{whom} takes {}, as in \"{}\"", role.kind.si(), role.kind.example());
            Err(at.key(right_key).error(format!("{{value}} is {}, not {}", kind.noun(), role.kind.noun()), help))
        }
        Some(amplitude) => Ok(amplitude.value),
        None => Ok(0.0),
    }
}
