//! `[field]`, `[table]`, `[forces]`, `[trace]` and `[output]` resolved, with the reasons for their defaults.

use field::Plane;
use meshes::Vec3;

use super::at::At;
use crate::case::{Drag, FieldSettings, Forces, GrainGroup, Integrator, Output, Region, TableSettings, TraceSettings};
use crate::error::CaseError;
use crate::keys::settings::{
    DragKeys, FieldKeys, ForceKeys, GasDragKeys, GroundKeys, OutputKeys, TableKeys, TraceKeys,
};
use crate::keys::value::{DirectionKeys, Vector};
use crate::quantity::Kind;

/// Wanted relative error of the field: what one usually knows of real electrodes, and what constant charge on a few thousand
/// panels gives in seconds.
const FIELD_ACCURACY: f64 = 1e-3;
/// Wanted relative error of trajectories: well below that of the field, so that it is not noticed beside it.
const TRACE_ACCURACY: f64 = 1e-6;
/// "20 degC", K.
const ROOM_TEMPERATURE: f64 = 293.15;

pub(super) fn field(at: &At, keys: &FieldKeys) -> Result<FieldSettings, CaseError> {
    let panels = keys.panels.map(|panels| panels.count());
    let max_panels = keys.max_panels.map(|count| count.count());
    if let (Some(panels), Some(max_panels)) = (panels, max_panels)
        && panels > max_panels
    {
        let problem = format!("{{value}} is more than max_panels = {max_panels}");
        return Err(at.key("panels").error(problem, "raise `max_panels`, or ask for fewer"));
    }
    let accuracy = keys.accuracy.map_or(FIELD_ACCURACY, |accuracy| accuracy.value);
    Ok(FieldSettings {
        accuracy,
        panels,
        max_panels,
        solver: keys.solver.unwrap_or_default(),
        method: keys.method.unwrap_or_default(),
        ground: keys.ground.as_ref().map(|keys| ground(&at.key("ground"), keys)).transpose()?,
    })
}

fn ground(at: &At, keys: &GroundKeys) -> Result<Plane, CaseError> {
    let axis = keys.axis.as_ref().map_or_else(Vec3::z, DirectionKeys::vector);
    let Some(normal) = axis.try_normalize(f64::MIN_POSITIVE.sqrt()) else {
        return Err(at.key("axis").error("{value} has no direction", "give it a length other than zero"));
    };
    Ok(Plane { point: keys.center.as_ref().map_or_else(Vec3::zeros, Vector::si), normal })
}

pub(super) fn table(at: &At, keys: &TableKeys, field: &FieldSettings) -> Result<TableSettings, CaseError> {
    let region = corners(at, keys.min.as_ref(), keys.max.as_ref())?;
    if let (Some(spacing), Some(region)) = (keys.spacing, &region)
        && spacing.value > (region.max - region.min).min()
    {
        return Err(at.key("spacing").error("{value} is larger than the table", "make it a small part of the box"));
    }
    Ok(TableSettings {
        region,
        accuracy: keys.accuracy.map_or(field.accuracy, |accuracy| accuracy.value),
        spacing: keys.spacing.map(|spacing| spacing.value),
        // A fraction of a byte means nothing.
        max_memory: keys.max_memory.map(|bytes| bytes.value.ceil() as u64),
    })
}

/// A box of which both corners are given, or none.
pub(super) fn corners(
    at: &At,
    min: Option<&Vector<crate::quantity::kinds::Length>>,
    max: Option<&Vector<crate::quantity::kinds::Length>>,
) -> Result<Option<Region>, CaseError> {
    match (min, max) {
        (Some(min), Some(max)) => Ok(Some(region(at, min, max)?)),
        (None, None) => Ok(None),
        (Some(_), None) => Err(one_corner(at, "max", "min")),
        (None, Some(_)) => Err(one_corner(at, "min", "max")),
    }
}

fn one_corner(at: &At, missing: &str, given: &str) -> CaseError {
    let problem = format!("`{given}` is given without `{missing}`");
    let help = "give both corners of the box, or neither: then it is chosen around the trap";
    at.key(given).key_error(problem, help)
}

/// A box with an inside.
fn region(
    at: &At,
    min: &Vector<crate::quantity::kinds::Length>,
    max: &Vector<crate::quantity::kinds::Length>,
) -> Result<Region, CaseError> {
    let (min, max) = (min.si(), max.si());
    match (0..3).find(|&i| min[i] >= max[i]) {
        Some(i) => {
            let above = at.key("max").entry(i).shown();
            let problem = format!("{{value}} is not below max = {above} in {}", ["x", "y", "z"][i]);
            Err(at.key("min").entry(i).error(problem, "`min` is the lower corner of the box, `max` the upper one"))
        }
        None => Ok(Region { min, max }),
    }
}

pub(super) fn forces(at: &At, keys: &ForceKeys, grains: &[GrainGroup]) -> Result<Forces, CaseError> {
    let vector = |v: Option<Vec3>| v.unwrap_or_else(Vec3::zeros);
    let forces = Forces {
        drag: drag(at, keys, grains)?,
        gravity: vector(keys.gravity.as_ref().map(Vector::si)),
        constant: vector(keys.constant.as_ref().map(Vector::si)),
        // No force acts unless the case names it, this one included: it also makes all grains step together.
        coulomb: keys.coulomb.unwrap_or(false),
        image_charge: keys.image_charge.unwrap_or(false),
        coulomb_accuracy: keys.coulomb_accuracy.map(|accuracy| accuracy.value),
        magnetic_field: vector(keys.magnetic_field.as_ref().map(Vector::si)),
        langevin: keys.langevin.map(|temperature| temperature.value),
    };
    let dragged = !matches!(forces.drag, Drag::None | Drag::Rate(0.0) | Drag::Coefficient(0.0));
    if forces.langevin.is_some() && !dragged {
        let problem = "random kicks need a drag: the same gas does both, and their strength follows from it";
        return Err(at.key("langevin").key_error(problem, "add drag = \"0.1 /s\", or leave out `langevin`"));
    }
    Ok(forces)
}

fn drag(at: &At, keys: &ForceKeys, grains: &[GrainGroup]) -> Result<Drag, CaseError> {
    let (model, drag) = match &keys.drag {
        None => return Ok(Drag::None),
        Some(DragKeys::Quantity(drag)) if drag.kind == Kind::DragCoefficient => {
            return Ok(Drag::Coefficient(drag.value));
        }
        Some(DragKeys::Quantity(drag)) => return Ok(Drag::Rate(drag.value)),
        Some(DragKeys::Table(GasDragKeys::Stokes { gas, pressure, temperature })) => {
            let temperature = temperature.map_or(ROOM_TEMPERATURE, |temperature| temperature.value);
            ("stokes", Drag::Stokes { gas: *gas, pressure: pressure.value, temperature })
        }
        Some(DragKeys::Table(GasDragKeys::Epstein { gas, pressure, temperature, reflection })) => {
            let temperature = temperature.map_or(ROOM_TEMPERATURE, |temperature| temperature.value);
            let reflection = reflection.unwrap_or_default();
            ("epstein", Drag::Epstein { gas: *gas, pressure: pressure.value, temperature, reflection })
        }
    };
    if let Some(n) = grains.iter().position(|group| group.radius == 0.0) {
        let group = At::root(at.source).key("grains").entry(n);
        let why = format!("the {model} drag of a grain follows from it");
        let help = "add radius = \"5 um\", or give the drag as a rate, \"0.1 /s\"";
        return Err(match group.key("radius") {
            radius if radius.written() => radius.error(format!("{{value}} is a point: {why}"), help),
            _ => group.missing("radius", &why, help),
        });
    }
    Ok(drag)
}

pub(super) fn trace(
    root: &At,
    keys: Option<&TraceKeys>,
    grains: &[GrainGroup],
    forces: &Forces,
) -> Result<Option<TraceSettings>, CaseError> {
    let at = root.key("trace");
    let Some(keys) = keys else {
        if grains.is_empty() {
            return Ok(None);
        }
        let help = "add a table [trace] with duration = \"1 s\"";
        return Err(root
            .key("grains")
            .entry(0)
            .error("there are grains, but nothing says for how long to trace them", help));
    };
    let integrator = keys.integrator.unwrap_or_default();
    let random = integrator == Integrator::Langevin;
    match forces.langevin {
        None if random => {
            let help = "add langevin = \"300 K\" and a drag to [forces], or choose another integrator";
            return Err(at.key("integrator").error("{value} needs a temperature", help));
        }
        Some(_) if !random && integrator != Integrator::Auto => {
            let problem = "{value} cannot follow the random kicks that `forces.langevin` asks for";
            let help = "write integrator = \"langevin\", or leave it out";
            return Err(at.key("integrator").error(problem, help));
        }
        _ => {}
    }
    let region = keys.region.as_ref().map(|keys| region(&at.key("region"), &keys.min, &keys.max)).transpose()?;
    Ok(Some(TraceSettings {
        duration: keys.duration.value,
        start: keys.start.map_or(0.0, |start| start.value),
        seed: keys.seed.map_or(1, |seed| seed.0),
        integrator,
        step: keys.step.map(|step| step.value),
        accuracy: keys.accuracy.map_or(TRACE_ACCURACY, |accuracy| accuracy.value),
        region,
    }))
}

pub(super) fn output(keys: &OutputKeys) -> Output {
    Output {
        every: keys.every.map(|every| every.value),
        field_nodes: keys.field_nodes.map(|nodes| nodes.count()),
        checkpoint: keys.checkpoint.map(|checkpoint| checkpoint.value),
    }
}
