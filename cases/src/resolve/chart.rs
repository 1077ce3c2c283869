//! `[analysis.chart]` resolved: the voltages at its corners.

use field::{Waveform, WaveformPart};

use super::at::At;
use super::{resolved, sweep};
use crate::case::{Case, Chart, ChartAxis, ChartGrains, ChartVoltages};
use crate::error::CaseError;
use crate::keys::analysis::{ChartAxisKeys, ChartKeys};
use crate::set::set;

/// Values of an axis: edges are drawn straight between them, to some 1e-3 of the axis.
const STEPS: usize = 40;
/// Of finer ones no picture shows more.
const MOST_STEPS: usize = 400;
/// Grains along each axis, and the most of them.
const GRAINS: usize = 12;
const MOST_GRAINS: usize = 100;
/// Unstable motion of a grain a tenth of the way to an electrode then grows out of the trap but within 1e-3 of the edge.
const PERIODS: usize = 200;

pub(super) fn chart(at: &At, keys: &ChartKeys, case: &Case) -> Result<Chart, CaseError> {
    if case.grains.is_empty() {
        let help = "add [[grains]] with a charge and a mass, or leave out [analysis.chart]";
        return Err(at.error("a chart of stability needs grains", help));
    }
    let axes = [axis(&at.key("x"), &keys.x)?, axis(&at.key("y"), &keys.y)?];
    let grains = match &keys.grains {
        None => None,
        Some(grains) => {
            let steps = grains.steps.map_or(GRAINS, |steps| steps.count());
            if steps > MOST_GRAINS {
                let problem = format!("{{value}} is more than {MOST_GRAINS}");
                return Err(at.key("grains").key("steps").error(problem, "take fewer grains"));
            }
            let periods = grains.periods.map_or(PERIODS, |periods| periods.count());
            Some(ChartGrains { distance: grains.distance.map(|d| d.value), periods, steps })
        }
    };
    let voltages = match [axes[0].key.as_str(), axes[1].key.as_str()] {
        ["q", "a"] => ChartVoltages::Scaled,
        [x, y] => {
            for (at, key) in [(at.key("x"), x), (at.key("y"), y)] {
                if matches!(key, "q" | "a") {
                    let help = "write x = { key = \"q\", ... } and y = { key = \"a\", ... }, or two voltages";
                    return Err(at.key("key").error("q goes to the right and a upwards, both or none", help));
                }
            }
            if x == y {
                return Err(at.key("y").key("key").error("{value} is varied by both axes", "vary another voltage"));
            }
            ChartVoltages::Corners(Box::new(corners(at, &axes, case)?))
        }
    };
    Ok(Chart { axes, voltages, grains })
}

fn axis(at: &At, keys: &ChartAxisKeys) -> Result<ChartAxis, CaseError> {
    let (from, unit) = sweep::end(&at.key("from"), &keys.from)?;
    let (to, unit_to) = sweep::end(&at.key("to"), &keys.to)?;
    if unit != unit_to {
        let problem = format!("{{value}} has another unit than from = {}", at.key("from").shown());
        return Err(at.key("to").error(problem, "write both ends in the same unit"));
    }
    if from >= to {
        let problem = format!("{{value}} is not more than from = {}", at.key("from").shown());
        return Err(at.key("to").error(problem, "an axis goes from the smaller value to the larger one"));
    }
    if matches!(keys.key.as_str(), "q" | "a") && !unit.is_empty() {
        return Err(at.key("from").error(format!("{} is a pure number", keys.key), "leave out the unit"));
    }
    let steps = keys.steps.map_or(STEPS, |steps| steps.count());
    if steps > MOST_STEPS {
        return Err(at.key("steps").error(format!("{{value}} is more than {MOST_STEPS}"), "take fewer steps"));
    }
    Ok(ChartAxis { key: keys.key.clone(), unit, from, to, steps })
}

/// The voltages at the corners, which may differ from those of the case by amplitudes alone.
fn corners(at: &At, axes: &[ChartAxis; 2], case: &Case) -> Result<[Vec<Waveform>; 4], CaseError> {
    let text = |axis: &ChartAxis, last: bool| {
        let value = if last { axis.to } else { axis.from };
        if axis.unit.is_empty() { format!("{value:?}") } else { format!("\"{value} {}\"", axis.unit) }
    };
    let at_key = |k: usize| at.key(["x", "y"][k]).key("key");
    // One key at a time first: who is at fault is then known.
    let changed = |sets: &[(usize, bool)]| -> Result<Vec<Waveform>, CaseError> {
        let mut source = at.source.clone();
        let named = sets.last().map_or(0, |(k, _)| *k);
        for (k, last) in sets {
            let argument = format!("{}={}", axes[*k].key, text(&axes[*k], *last));
            set(&mut source.tree, &argument, source.sets.len())
                .map_err(|fault| at_key(*k).error(fault.problem, fault.help.unwrap_or_default()))?;
            source.sets.push(argument);
        }
        let corner = resolved(&source, false).map_err(|error| {
            let what = format!("with {} the case is wrong: {}", source.sets[at.source.sets.len()..].join(", "), error);
            at_key(named).error(what, "vary a voltage, from and to values that it may have")
        })?;
        let (waveforms, _) = corner.given();
        let (own, _) = case.given();
        if without_voltages(&corner) != without_voltages(case)
            || waveforms.iter().zip(&own).any(|(a, b)| shape(a) != shape(b))
        {
            let help = "vary a `dc`, an `amplitude`, a `scale` or a `charge`; shapes and frequencies are for a [sweep]";
            return Err(at_key(named).error("{value} changes more than voltages", help));
        }
        Ok(waveforms)
    };
    for k in 0..2 {
        if changed(&[(k, false)])? == changed(&[(k, true)])? {
            let help = "vary the `dc` of an electrode, or the `amplitude` of a drive that is used";
            return Err(at_key(k).error("{value} changes no voltage", help));
        }
    }
    let corner = |x: bool, y: bool| changed(&[(0, x), (1, y)]);
    Ok([corner(false, false)?, corner(true, false)?, corner(false, true)?, corner(true, true)?])
}

/// The case with nothing on its electrodes and sources.
fn without_voltages(case: &Case) -> Case {
    let mut case = case.clone();
    case.electrodes.iter_mut().for_each(|e| match &mut e.drive {
        crate::case::Drive::Voltage(waveform) => *waveform = Waveform::default(),
        crate::case::Drive::Charge(charge) => *charge = 0.0,
    });
    case.sources.iter_mut().for_each(|s| s.waveform = Waveform::default());
    case
}

/// The parts of a waveform at amplitude one.
fn shape(waveform: &Waveform) -> Vec<WaveformPart> {
    let mut parts = waveform.parts.clone();
    parts.iter_mut().for_each(|part| *part.amplitude_mut() = 1.0);
    parts
}
