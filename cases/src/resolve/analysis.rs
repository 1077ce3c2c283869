//! `[analysis]` resolved.

use meshes::Vec3;

use super::at::At;
use super::settings;
use crate::case::{Analysis, Drive, Electrode, WantedMultipole, Wish};
use crate::error::CaseError;
use crate::keys::analysis::{AnalysisKeys, WishKeys};
use crate::keys::value::{DirectionKeys, Vector};

/// Multipoles to this degree, as a designer of traps asks for.
const ORDER: usize = 12;
/// Beyond this the numbers are rounding: 0.5^30 = 1e-9 of the potential.
const LARGEST_ORDER: usize = 30;
/// Cells of a thirtieth of the box: a second of work on the largest flat meshes.
const NODES: usize = 40_000;
/// More take minutes.
const MOST_NODES: usize = 5_000_000;
/// Voltages a million times larger than need be count as much as the whole field.
const WEIGHT: f64 = 1e-6;

pub(super) fn analysis(at: &At, keys: &AnalysisKeys, electrodes: &[Electrode]) -> Result<Analysis, CaseError> {
    let order = keys.order.map_or(ORDER, |order| order.count());
    if order > LARGEST_ORDER {
        let help = "beyond that degree multipoles are smaller than rounding";
        return Err(at.key("order").error(format!("{{value}} is more than {LARGEST_ORDER}"), help));
    }
    let nodes = keys.nodes.map_or(NODES, |nodes| nodes.count());
    if nodes > MOST_NODES {
        let help = "make the box smaller with `min` and `max`";
        return Err(at.key("nodes").error(format!("{{value}} is more than {MOST_NODES}"), help));
    }
    let plane = keys.plane.as_ref();
    Ok(Analysis {
        center: keys.center.as_ref().map(Vector::si),
        axis: keys.axis.as_ref().map(|axis| direction(&at.key("axis"), axis)).transpose()?,
        radius: keys.radius.map(|radius| radius.value),
        order,
        region: settings::corners(at, keys.min.as_ref(), keys.max.as_ref())?,
        nodes,
        plane_center: plane.and_then(|plane| plane.center.as_ref()).map(Vector::si),
        plane_normal: plane
            .and_then(|plane| plane.axis.as_ref())
            .map(|axis| direction(&at.key("plane").key("axis"), axis))
            .transpose()?,
        wish: keys.wish.as_ref().map(|wish| self::wish(&at.key("wish"), wish, electrodes, order)).transpose()?,
        // It needs the rest of the case.
        chart: None,
    })
}

fn direction(at: &At, keys: &DirectionKeys) -> Result<Vec3, CaseError> {
    keys.vector()
        .try_normalize(f64::MIN_POSITIVE.sqrt())
        .ok_or_else(|| at.error("{value} has no direction", "give it a length other than zero"))
}

fn wish(at: &At, keys: &WishKeys, electrodes: &[Electrode], order: usize) -> Result<Wish, CaseError> {
    if keys.field.is_none() && keys.multipoles.is_empty() {
        let help = "add field = [\"1 V/m\", 0, 0], or multipoles = [{ l = 2, value = 1000 }]";
        return Err(at.error("the wish asks for nothing", help));
    }
    let mut multipoles = Vec::with_capacity(keys.multipoles.len());
    for (n, wanted) in keys.multipoles.iter().enumerate() {
        let at = at.key("multipoles").entry(n);
        let (l, m) = (wanted.l.count(), wanted.m.map_or(0, |m| m.count()));
        if l > order {
            let help = format!("raise `analysis.order`, which is {order}");
            return Err(at.key("l").error("{value} is beyond the multipoles that are looked at", help));
        }
        if m > l {
            return Err(at.key("m").error(format!("{{value}} is more than l = {l}"), "m goes from 0 to l"));
        }
        let sine = wanted.sine.unwrap_or(false);
        if sine && m == 0 {
            let help = "leave out `sine`, or give m";
            return Err(at.key("sine").error("with m = 0 there is no sine of the azimuth", help));
        }
        multipoles.push(WantedMultipole { l, m, sine, value: wanted.value.value });
    }
    let floats = |e: &Electrode| matches!(e.drive, Drive::Charge(_));
    let chosen = match &keys.electrodes {
        None => (0..electrodes.len()).filter(|e| !floats(&electrodes[*e])).collect(),
        Some(names) => {
            let mut chosen = Vec::with_capacity(names.len());
            for (n, name) in names.iter().enumerate() {
                let at = at.key("electrodes").entry(n);
                let known: Vec<String> = electrodes.iter().map(|e| e.name.clone()).collect();
                let Some(e) = electrodes.iter().position(|e| &e.name == name) else {
                    let quoted: Vec<String> = known.iter().map(|name| format!("\"{name}\"")).collect();
                    let help = match crate::suggestion::nearest(name, &known) {
                        Some(meant) => format!("did you mean \"{meant}\"?"),
                        None => format!("the case has {}", crate::suggestion::list(&quoted, "and")),
                    };
                    return Err(at.error("{value} is no electrode", help));
                };
                if floats(&electrodes[e]) {
                    return Err(at.error("{value} floats: its voltage follows from its charge", "give it a `dc`"));
                }
                chosen.push(e);
            }
            chosen
        }
    };
    if chosen.is_empty() {
        let problem = "the case has no electrode whose voltage may be chosen";
        return Err(at.error(problem, "give an electrode a `dc`, or leave out [analysis.wish]"));
    }
    Ok(Wish {
        at: keys.at.as_ref().map(Vector::si),
        field: keys.field.as_ref().map(Vector::si),
        multipoles,
        electrodes: chosen,
        limit: keys.limit.map_or(f64::INFINITY, |limit| limit.value),
        weight: keys.weight.map_or(WEIGHT, |weight| weight.value),
    })
}
