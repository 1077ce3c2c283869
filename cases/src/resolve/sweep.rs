//! `[sweep]` resolved: each key it varies exists or can be set, each spread is a list of values.

use super::at::At;
use crate::case::{Sweep, SweepAxis};
use crate::error::CaseError;
use crate::keys::sweep::{End, Scale, SpreadKeys, SweepKeys, SweepTable};
use crate::set::set;

pub(super) fn sweep(at: &At, keys: SweepTable) -> Result<Sweep, CaseError> {
    if keys.axes.is_empty() {
        let help = "add a line such as \"electrode.left.dc\" = [\"1 V\", \"2 V\"]";
        return Err(at.error("the sweep varies nothing", help));
    }
    let mut axes = Vec::with_capacity(keys.axes.len());
    for (key, values) in keys.axes {
        let at = at.key(&key);
        let values = match values {
            SweepKeys::List(values) if values.is_empty() => {
                return Err(at.error("{value} holds no values", "write [\"1 V\", \"2 V\"]"));
            }
            SweepKeys::List(values) => (0..values.len()).map(|n| at.entry(n).text().to_owned()).collect(),
            SweepKeys::Table(keys) => spread(&at, &keys)?,
        };
        varies(&at, &key, &values)?;
        axes.push(SweepAxis { key, values });
    }
    Ok(Sweep { axes, report: keys.report })
}

/// Whether the key can be set at all.
fn varies(at: &At, key: &str, values: &[String]) -> Result<(), CaseError> {
    if key == "sweep" || key.starts_with("sweep.") {
        return Err(at.key_error("a sweep cannot vary itself", "vary a key of the case, as \"electrode.left.dc\""));
    }
    let mut tree = at.source.tree.clone();
    let first = values.first().map_or("", String::as_str);
    set(&mut tree, &format!("{key}={first}"), 0)
        .map_err(|fault| at.key_error(fault.problem, fault.help.unwrap_or_default()))
}

fn spread(at: &At, keys: &SpreadKeys) -> Result<Vec<String>, CaseError> {
    let (from, unit) = end(&at.key("from"), &keys.from)?;
    let (to, unit_to) = end(&at.key("to"), &keys.to)?;
    if unit != unit_to {
        let problem = format!("{{value}} has another unit than from = {}", at.key("from").shown());
        return Err(at.key("to").error(problem, "write both ends in the same unit"));
    }
    let steps = keys.steps.count();
    // Beyond this a study would not end, and the list not fit in memory.
    const MOST_STEPS: usize = 100_000;
    if steps > MOST_STEPS {
        return Err(at.key("steps").error(format!("{{value}} is more than {MOST_STEPS}"), "take fewer steps"));
    }
    let log = matches!(keys.scale, Some(Scale::Log));
    if log && from * to <= 0.0 {
        let problem = "{value} needs two ends of the same sign, neither of them zero";
        return Err(at.key("scale").error(problem, "write scale = \"linear\", or move the ends"));
    }
    let text = |n: usize| {
        let t = n as f64 / (steps - 1) as f64;
        let value = match n {
            // The ends exactly as written.
            0 => from,
            n if n + 1 == steps => to,
            _ if log => from * (to / from).powf(t),
            _ => from + (to - from) * t,
        };
        if unit.is_empty() { format!("{value:?}") } else { format!("\"{value} {unit}\"") }
    };
    Ok((0..steps).map(text).collect())
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
