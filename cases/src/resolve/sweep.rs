//! `[sweep]` resolved: each key it varies exists or can be set, each spread is a list of values, and so are samples.

use super::at::At;
use crate::case::{Sampling, Sweep, SweepAxis};
use crate::error::CaseError;
use crate::keys::sweep::{End, Scale, SpreadKeys, SweepKeys, SweepTable};
use crate::set::set;
use crate::study::sampling::unit_samples;

/// Beyond this a study would not end, and its points not fit in memory.
const MOST_POINTS: usize = 100_000;

pub(super) fn sweep(at: &At, keys: SweepTable) -> Result<Sweep, CaseError> {
    if keys.axes.is_empty() {
        let help = "add a line such as \"electrode.left.dc\" = [\"1 V\", \"2 V\"]";
        return Err(at.error("the sweep varies nothing", help));
    }
    let sampling = keys.sampling;
    let samples = samples(at, &keys)?;
    let mut axes = Vec::with_capacity(keys.axes.len());
    for (number, (key, values)) in keys.axes.into_iter().enumerate() {
        let at = at.key(&key);
        let drawn: Option<Vec<f64>> = samples.as_ref().map(|samples| samples.iter().map(|s| s[number]).collect());
        let axis = axis(&at, key, values, drawn.as_deref())?;
        varies(&at, &axis.key, &axis.values)?;
        axes.push(axis);
    }
    if sampling == Sampling::Zip {
        let first = &axes[0];
        if let Some(other) = axes.iter().find(|axis| axis.values.len() != first.values.len()) {
            let (n, m) = (other.values.len(), first.values.len());
            let problem = format!("{n} values, and `{}` takes {m}: zipped keys take equally many", first.key);
            return Err(at.key(&other.key).error(problem, "give both as many values, or write sampling = \"grid\""));
        }
    }
    let sweep = Sweep { axes, sampling, report: keys.report };
    match sweep.count() {
        Some(count) if count <= MOST_POINTS => Ok(sweep),
        _ => Err(at.error(
            format!("the sweep has more than {MOST_POINTS} points"),
            "take fewer steps, or sampling = \"sobol\" with as many samples as you want",
        )),
    }
}

/// Points of the unit cube, where the sweep samples one.
fn samples(at: &At, keys: &SweepTable) -> Result<Option<Vec<Vec<f64>>>, CaseError> {
    let drawn = matches!(keys.sampling, Sampling::LatinHypercube | Sampling::Sobol);
    match keys.samples {
        Some(_) if !drawn => {
            let help = "leave it out, or write sampling = \"latin_hypercube\" or \"sobol\"";
            Err(at.key("samples").key_error("a grid has as many points as its values make", help))
        }
        None if drawn => Err(at.missing("samples", "so many points are drawn", "add samples = 100")),
        Some(count) if count.count() > MOST_POINTS => {
            Err(at.key("samples").error(format!("{{value}} is more than {MOST_POINTS}"), "draw fewer"))
        }
        Some(count) => {
            let seed = keys.seed.map_or(1, |seed| seed.0);
            let samples = unit_samples(keys.sampling, count.count(), keys.axes.len(), seed);
            samples.map(Some).map_err(|most| {
                let problem = format!("{} keys: Sobol's sequence serves at most {most}", keys.axes.len());
                at.key("sampling").error(problem, "write sampling = \"latin_hypercube\"")
            })
        }
        None => Ok(None),
    }
}

/// The values of one key: its list, its spread, or at the samples drawn for it.
fn axis(at: &At, key: String, values: SweepKeys, drawn: Option<&[f64]>) -> Result<SweepAxis, CaseError> {
    match values {
        SweepKeys::List(values) if values.is_empty() => {
            Err(at.error("{value} holds no values", "write [\"1 V\", \"2 V\"]"))
        }
        SweepKeys::List(values) => {
            let listed: Vec<String> = (0..values.len()).map(|n| at.entry(n).text().to_owned()).collect();
            let of = |u: f64| listed[((u * listed.len() as f64) as usize).min(listed.len() - 1)].clone();
            let values = match drawn {
                Some(drawn) => drawn.iter().map(|u| of(*u)).collect(),
                None => listed,
            };
            Ok(SweepAxis { key, values, log: false, range: None, unit: String::new() })
        }
        SweepKeys::Table(keys) => spread(at, key, &keys, drawn),
    }
}

/// Whether the key can be set at all.
pub(super) fn varies(at: &At, key: &str, values: &[String]) -> Result<(), CaseError> {
    let of = |table: &str| key == table || key.starts_with(&format!("{table}."));
    if of("sweep") || of("study") {
        return Err(at.key_error("a sweep cannot vary itself", "vary a key of the case, as \"electrode.left.dc\""));
    }
    let mut tree = at.source.tree.clone();
    let first = values.first().map_or("", String::as_str);
    set(&mut tree, &format!("{key}={first}"), 0)
        .map_err(|fault| at.key_error(fault.problem, fault.help.unwrap_or_default()))
}

fn spread(at: &At, key: String, keys: &SpreadKeys, drawn: Option<&[f64]>) -> Result<SweepAxis, CaseError> {
    let (from, unit) = end(&at.key("from"), &keys.from)?;
    let (to, unit_to) = end(&at.key("to"), &keys.to)?;
    if unit != unit_to {
        let problem = format!("{{value}} has another unit than from = {}", at.key("from").shown());
        return Err(at.key("to").error(problem, "write both ends in the same unit"));
    }
    let log = matches!(keys.scale, Some(Scale::Log));
    if log && from * to <= 0.0 {
        let problem = "{value} needs two ends of the same sign, neither of them zero";
        return Err(at.key("scale").error(problem, "write scale = \"linear\", or move the ends"));
    }
    let parts: Vec<f64> = match (keys.steps, drawn) {
        (Some(_), Some(_)) => {
            return Err(at.key("steps").key_error("samples are drawn from the range, not steps", "leave it out"));
        }
        (None, Some(drawn)) => drawn.to_vec(),
        (None, None) => return Err(at.missing("steps", "", "add steps = 10, or a `sampling` to the sweep")),
        (Some(steps), None) if steps.count() > MOST_POINTS => {
            return Err(at.key("steps").error(format!("{{value}} is more than {MOST_POINTS}"), "take fewer steps"));
        }
        (Some(steps), None) => (0..steps.count()).map(|n| n as f64 / (steps.count() - 1) as f64).collect(),
    };
    let text = |t: &f64| {
        let value = match *t {
            // The ends exactly as written.
            0.0 => from,
            1.0 => to,
            t if log => from * (to / from).powf(t),
            t => from + (to - from) * t,
        };
        if unit.is_empty() { format!("{value:?}") } else { format!("\"{value} {unit}\"") }
    };
    Ok(SweepAxis { key, values: parts.iter().map(text).collect(), log, range: Some([from, to]), unit })
}

/// Number and unit of an end.
pub(super) fn end(at: &At, end: &End) -> Result<(f64, String), CaseError> {
    match end {
        End::Number(number) => Ok((number.value, String::new())),
        End::String(text) => {
            let (number, unit) = crate::quantity::split(text.trim());
            match number.parse::<f64>() {
                Ok(value) if value.is_finite() && !unit.is_empty() => Ok((value, unit.to_owned())),
                _ => Err(at.error("{value} is not a number with a unit", "write from = \"10 V\"")),
            }
        }
    }
}
