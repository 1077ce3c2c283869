//! The shapes of electrodes resolved.

use std::f64::consts::{PI, SQRT_2};

use meshes::{GridPattern, Hole, Outline, Shape, Vec3, Weave};

use super::at::At;
use super::files;
use crate::case::ElectrodeShape;
use crate::error::CaseError;
use crate::keys::electrode::{HoleName, ShapeKeys, WeaveName};
use crate::keys::value::Tuple;
use crate::quantity::kinds::Length;
use crate::quantity::{Positive, Si};

/// A length that may be left out for zero.
fn or_zero<R>(length: &Option<Si<Length, R>>) -> f64 {
    length.as_ref().map_or(0.0, |length| length.value)
}

fn sides<const N: usize>(size: &Tuple<Positive<Length>, N>) -> [f64; N] {
    size.0.map(|side| side.value)
}

pub(super) fn shape(at: &At, keys: &ShapeKeys) -> Result<ElectrodeShape, CaseError> {
    Ok(ElectrodeShape::Shape(match keys {
        ShapeKeys::Sphere { radius } => Shape::Sphere { radius: radius.value },
        ShapeKeys::Ring { radius, wire_radius } => {
            let (radius, wire_radius) = (radius.value, wire_radius.value);
            smaller(at, ("wire_radius", wire_radius), ("radius", radius), "the ring would have no hole")?;
            Shape::Ring { radius, wire_radius }
        }
        ShapeKeys::Disc { radius, hole_radius, thickness } => {
            let (radius, hole_radius) = (radius.value, or_zero(hole_radius));
            smaller(at, ("hole_radius", hole_radius), ("radius", radius), "nothing would be left of the disc")?;
            Shape::Disc { radius, hole_radius, thickness: or_zero(thickness) }
        }
        ShapeKeys::Plate { size, thickness } => Shape::Plate { size: sides(size), thickness: or_zero(thickness) },
        ShapeKeys::EndCap { radius, opening, thickness } => {
            let opening = opening.value;
            if opening >= PI {
                let at = at.key("opening");
                let help = match at.shown() {
                    // A bare number beyond half a turn is degrees without the unit.
                    number if number.parse::<f64>().is_ok_and(|degrees| degrees < 180.0) => {
                        format!("a number without a unit is in radians: write \"{number} deg\"")
                    }
                    _ => {
                        "the half angle of a hemisphere is \"90 deg\"; a whole sphere is shape = \"sphere\"".to_owned()
                    }
                };
                return Err(at.error("{value} is not between 0 and 180 deg", help));
            }
            Shape::EndCap { radius: radius.value, opening, thickness: or_zero(thickness) }
        }
        ShapeKeys::GridPlate { .. } => grid_plate(at, keys)?,
        ShapeKeys::Cylinder { radius, length, caps } => {
            // Without a word about caps it is a tube: the closed form is the special one.
            Shape::Cylinder { radius: radius.value, length: length.value, caps: caps.unwrap_or(false) }
        }
        ShapeKeys::Rod { radius, length } => {
            let (radius, length) = (radius.value, length.value);
            if length <= 2.0 * radius {
                return Err(at.key("length").error(
                    format!(
                        "{{value}} leaves no room for the two hemispherical ends of radius {}",
                        at.key("radius").shown()
                    ),
                    "`length` is measured from tip to tip and must be more than twice the radius",
                ));
            }
            Shape::Rod { radius, length }
        }
        ShapeKeys::Wire { points, wire_radius } => {
            let points: Vec<Vec3> = points.iter().map(|point| point.si()).collect();
            wire(&at.key("points"), &points)?;
            Shape::Wire { points, wire_radius: wire_radius.value }
        }
        ShapeKeys::Box { size } => Shape::Box { size: sides(size) },
        ShapeKeys::HyperbolicRing { r0, z0, extent } => {
            let (r0, z0, extent) = hyperbola(r0, z0, extent);
            if extent <= r0 {
                return Err(at.key("extent").error(
                    format!("{{value}} cuts the whole ring off, which begins at r0 = {}", at.key("r0").shown()),
                    "`extent` is measured from the axis: two to three times r0 is usual",
                ));
            }
            Shape::HyperbolicRing { r0, z0, extent }
        }
        ShapeKeys::HyperbolicCap { r0, z0, extent } => {
            let (r0, z0, extent) = hyperbola(r0, z0, extent);
            Shape::HyperbolicCap { r0, z0, extent }
        }
        ShapeKeys::Mesh { file, group, unit, closed } => {
            let mesh = files::mesh(at, file, group.as_deref(), unit.as_deref(), closed.unwrap_or(false))?;
            return Ok(ElectrodeShape::Imported(mesh));
        }
    }))
}

/// Demands that one length is smaller than another.
fn smaller(at: &At, small: (&str, f64), large: (&str, f64), else_what: &str) -> Result<(), CaseError> {
    if small.1 < large.1 {
        return Ok(());
    }
    let help = format!("make `{}` smaller than `{}`: {else_what}", small.0, large.0);
    Err(at.key(small.0).error(format!("{{value}} is not smaller than {} = {}", large.0, at.key(large.0).shown()), help))
}

/// r0, z0 and extent; z0 = r0 / √2 is the ideal trap, and at 3 r0 the missing rest of the sheet no longer matters
/// near the centre.
fn hyperbola(
    r0: &Positive<Length>,
    z0: &Option<Positive<Length>>,
    extent: &Option<Positive<Length>>,
) -> (f64, f64, f64) {
    let r0 = r0.value;
    (r0, z0.map_or(r0 / SQRT_2, |z0| z0.value), extent.map_or(3.0 * r0, |extent| extent.value))
}

fn wire(at: &At, points: &[Vec3]) -> Result<(), CaseError> {
    if points.len() < 2 {
        let count = if points.is_empty() { "no points" } else { "one point" };
        return Err(at.error(format!("{count}: a wire has two at least"), "write [[x, y, z], [x, y, z], ...]"));
    }
    match points.windows(2).position(|pair| pair[0] == pair[1]) {
        Some(n) => {
            let problem = format!("{{value}} is the same as point {} before it", n + 1);
            Err(at.entry(n + 1).error(problem, "leave one of the two out"))
        }
        None => Ok(()),
    }
}

fn grid_plate(at: &At, keys: &ShapeKeys) -> Result<Shape, CaseError> {
    let ShapeKeys::GridPlate { size, radius, pitch, hole, open, thickness, wires, wire_radius } = keys else {
        return Err(at.error("is not a grid plate", ""));
    };
    let outline = match (size, radius) {
        (Some(size), None) => Outline::Rectangle(sides(size)),
        (None, Some(radius)) => Outline::Disc(radius.value),
        (Some(_), Some(_)) => {
            let problem = "`size` and `radius` exclude each other: a grid_plate is rectangular or round";
            return Err(at.key("radius").key_error(problem, "leave one of the two out"));
        }
        (None, None) => {
            let help =
                "add size = [\"10 cm\", \"10 cm\"] for a rectangular plate, or radius = \"5 cm\" for a round one";
            return Err(at.missing("size", "a grid_plate needs `size` or `radius`", help));
        }
    };
    let smallest = match outline {
        Outline::Rectangle([a, b]) => a.min(b),
        Outline::Disc(radius) => 2.0 * radius,
    };
    let pitch = pitch.value;
    if pitch > smallest {
        return Err(at
            .key("pitch")
            .error("{value} is larger than the plate", "make the pitch smaller, or the plate larger"));
    }
    let stranger = |key: &str, of: &str, than: &str| {
        at.key(key).key_error(
            format!("`{key}` belongs to grid plates with `{of}`; this one has `{than}`"),
            format!("leave out `{key}`, or write `{of}` instead of `{than}`"),
        )
    };
    let pattern = match (hole, wires) {
        (Some(_), Some(_)) => {
            let problem = "`wires` and `hole` exclude each other: a grid_plate is made of wires, or perforated";
            return Err(at.key("wires").key_error(problem, "leave one of the two out"));
        }
        (None, None) => {
            let help =
                "add hole = \"square\" with open = \"1 mm\", or wires = \"crossed\" with wire_radius = \"50 um\"";
            return Err(at.missing("hole", "a grid_plate needs `hole` or `wires`", help));
        }
        (Some(hole), None) => {
            if wire_radius.is_some() {
                return Err(stranger("wire_radius", "wires", "hole"));
            }
            let Some(open) = open else {
                let help = "add open = \"1 mm\": the width of a hole, or its diameter";
                return Err(at.missing("open", "a plate with holes needs it", help));
            };
            smaller(at, ("open", open.value), ("pitch", pitch), "neighbouring holes would merge")?;
            let hole = match hole {
                HoleName::Square => Hole::Square,
                HoleName::Round => Hole::Round,
                HoleName::Hexagonal => Hole::Hexagonal,
                HoleName::Slot => Hole::Slot,
            };
            GridPattern::Perforated { hole, open: open.value, thickness: or_zero(thickness) }
        }
        (None, Some(weave)) => {
            for (key, given) in [("open", open.is_some()), ("thickness", thickness.is_some())] {
                if given {
                    return Err(stranger(key, "hole", "wires"));
                }
            }
            let Some(wire_radius) = wire_radius else {
                return Err(at.missing("wire_radius", "a grid of wires needs it", "add wire_radius = \"50 um\""));
            };
            if 2.0 * wire_radius.value >= pitch {
                let problem = format!("wires of radius {{value}} touch at pitch = {}", at.key("pitch").shown());
                return Err(at.key("wire_radius").error(problem, "make `wire_radius` smaller than half the `pitch`"));
            }
            let weave = match weave {
                WeaveName::Parallel => Weave::Parallel,
                WeaveName::Crossed => Weave::Crossed,
                WeaveName::Woven => Weave::Woven,
            };
            GridPattern::Wires { weave, wire_radius: wire_radius.value }
        }
    };
    Ok(Shape::GridPlate { outline, pitch, pattern })
}
