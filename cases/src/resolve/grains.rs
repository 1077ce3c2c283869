//! `[[grains]]` resolved.

use std::f64::consts::PI;

use meshes::Vec3;
use tracer::{Launch, Place};

use super::at::At;
use super::{files, names};
use crate::case::GrainGroup;
use crate::error::CaseError;
use crate::keys::grains::{GrainKeys, PlaceKeys, SpeedKeys};
use crate::keys::value::{DirectionKeys, Vector};
use crate::quantity::kinds::Length;

pub(super) fn groups(list: &At, keys: &[GrainKeys]) -> Result<Vec<GrainGroup>, CaseError> {
    let groups: Vec<GrainGroup> =
        keys.iter().enumerate().map(|(n, keys)| group(&list.entry(n), keys, n)).collect::<Result<_, _>>()?;
    let all: Vec<_> = groups.iter().enumerate().map(|(n, group)| (group.name.as_str(), "grains", n)).collect();
    names::different(&At::root(list.source), &all, "give each group a name of its own")?;
    Ok(groups)
}

fn group(at: &At, keys: &GrainKeys, n: usize) -> Result<GrainGroup, CaseError> {
    let name = names::or_default(at, keys.name.as_deref(), "grains", n)?;
    let radius = keys.radius.map_or(0.0, |radius| radius.value);
    let mass = match (keys.mass, keys.density) {
        (Some(mass), None) => mass.value,
        (None, Some(density)) if radius > 0.0 => density.value * 4.0 / 3.0 * PI * radius.powi(3),
        (None, Some(_)) => {
            return Err(at.missing(
                "radius",
                "a mass from `density` needs it",
                "add radius = \"5 um\", or give `mass`",
            ));
        }
        (Some(_), Some(_)) => {
            let problem = "`density` and `mass` exclude each other: with a radius, one follows from the other";
            return Err(at.key("density").key_error(problem, "leave one of the two out"));
        }
        (None, None) => {
            let help = "add mass = \"1e-13 kg\", or density = \"2.2 g/cm^3\" with a radius";
            return Err(at.missing("mass", "", help));
        }
    };
    if mass == 0.0 || !mass.is_finite() {
        let problem = format!("{{value}} and the radius give a mass of {mass} kg");
        return Err(at.key("density").error(problem, "check the units of both"));
    }
    let (place, launch, listed) = start(at, keys)?;
    let count = match (keys.count.map(|count| count.count()), listed) {
        (Some(count), None) => count,
        (None, Some(listed)) => listed,
        (Some(count), Some(listed)) if count == listed => count,
        (Some(_), Some(listed)) => {
            let problem = format!("{{value}} grains do not fit the {listed} listed in `place`");
            return Err(at.key("count").error(problem, format!("leave `count` out, or write {listed}")));
        }
        (None, None) => return Err(at.missing("count", "", "add count = 10: how many grains start there")),
    };
    Ok(GrainGroup { name, count, mass, charge: keys.charge.value, radius, place, launch })
}

fn center(center: &Option<Vector<Length>>) -> Vec3 {
    center.as_ref().map_or(Vec3::zeros(), Vector::si)
}

fn axis(at: &At, axis: &Option<DirectionKeys>) -> Result<Vec3, CaseError> {
    let axis = axis.as_ref().map_or(Vec3::z(), DirectionKeys::vector);
    match axis.try_normalize(f64::MIN_POSITIVE.sqrt()) {
        Some(unit) => Ok(unit),
        None => Err(at.key("axis").error("{value} has no direction", "give it a length other than zero")),
    }
}

/// Place, launch, and how many grains the place lists, if it does.
fn start(at: &At, keys: &GrainKeys) -> Result<(Place, Launch, Option<usize>), CaseError> {
    let launch = match &keys.speed {
        None | Some(SpeedKeys::Rest {}) => Launch::Rest,
        Some(SpeedKeys::Thermal { temperature }) => Launch::Thermal(temperature.value),
        Some(SpeedKeys::Uniform { velocity }) => Launch::Uniform(velocity.si()),
        Some(SpeedKeys::Isotropic { speed }) => Launch::Isotropic(speed.value),
    };
    let at_place = at.key("place");
    let place = match &keys.place {
        PlaceKeys::Points { points } if points.is_empty() => {
            return Err(at_place.key("points").error("{value} lists no points", "write [[x, y, z], ...]"));
        }
        PlaceKeys::Points { points } => {
            let points: Vec<Vec3> = points.iter().map(Vector::si).collect();
            let count = points.len();
            return Ok((Place::Points(points), launch, Some(count)));
        }
        PlaceKeys::File { file } => {
            let (points, velocities) = files::grains(&at_place.key("file"), file)?;
            let count = points.len();
            let launch = match velocities {
                Some(_) if keys.speed.is_some() => {
                    let problem = format!("`speed` and the velocities in \"{file}\" exclude each other");
                    let help = "leave `speed` out, or the columns vx,vy,vz";
                    return Err(at.key("speed").key_error(problem, help));
                }
                Some(velocities) => Launch::Each(velocities),
                None => launch,
            };
            return Ok((Place::Points(points), launch, Some(count)));
        }
        PlaceKeys::Ball { center: c, radius } => Place::Ball { center: center(c), radius: radius.value },
        PlaceKeys::Shell { center: c, radius } => Place::Shell { center: center(c), radius: radius.value },
        PlaceKeys::Box { min, max } => {
            let (min, max) = (min.si(), max.si());
            // A flat box is a rectangle, a fine place to start from; one that is turned inside out is a slip.
            if let Some(i) = (0..3).find(|&i| min[i] > max[i]) {
                let above = at_place.key("max").entry(i).shown();
                let problem = format!("{{value}} is above max = {above} in {}", ["x", "y", "z"][i]);
                return Err(at_place.key("min").entry(i).error(problem, "exchange the two"));
            }
            Place::Box { min, max }
        }
        PlaceKeys::Disc { center: c, axis: a, radius } => {
            Place::Disc { center: center(c), axis: axis(&at_place, a)?, radius: radius.value }
        }
        PlaceKeys::Beam { center: c, axis: a, radius, length } => Place::Beam {
            center: center(c),
            axis: axis(&at_place, a)?,
            radius: radius.value,
            length: length.map_or(0.0, |length| length.value),
        },
    };
    Ok((place, launch, None))
}
