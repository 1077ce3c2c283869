//! How far off a run may be, found by tracing some of it again.

use crate::observer::Nothing;
use crate::trace::{Traced, run};
use crate::{Ensemble, Method, Options, Outcome, System, TraceError};

/// The difference between a run and a tighter one.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// The grains traced again (indices).
    pub grains: Vec<usize>,
    /// How many of them ended otherwise: at another electrode, or not at all. Chaotic flights do; their ends are then no
    /// better known than that.
    pub otherwise: usize,
    /// Largest difference of the final position among those that ended alike, m.
    pub position: f64,
    /// Largest difference of the time of their ends, s.
    pub time: f64,
    /// What the second run tightened: the tolerance by 30, or the step by 2.
    pub tightened: Tightened,
}

/// How the second run was made tighter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tightened {
    /// The tolerance, 30 times. The difference is then the first run's error but for a few parts in a hundred.
    Tolerance,
    /// The step, by half. The difference times 2^p / (2^p - 1), p the order, would be the first run's error.
    Step,
}

/// Grains traced again when grains do not feel each other: enough to meet the worst few per cent of an ensemble, few
/// enough to cost a minor part of a run of hundreds.
const SAMPLE: usize = 16;

/// Forces on pairs of grains that a second run of coupled grains may cost: ten seconds of one core.
const PAIRS: f64 = 1e10;

/// How much tighter the tolerance is. At 30 the difference is the error of the first run to 3 %, and the run costs half as
/// much again per grain (30^(1/8) = 1.5).
const TIGHTER: f64 = 30.0;

/// Traces a few grains again, tighter; all of them when they feel each other.
pub(crate) fn estimate(
    system: &System,
    ensemble: &Ensemble,
    options: &Options,
    traced: &Traced,
) -> Result<Option<ErrorEstimate>, TraceError> {
    let n = ensemble.len();
    if n == 0 || options.method == Method::Langevin {
        return Ok(None);
    }
    let coupled = system.nature().couples_grains;
    if coupled && traced.force_evaluations as f64 * n as f64 * 2.0 > PAIRS {
        return Ok(None);
    }
    let count = if coupled { n } else { n.min(SAMPLE) };
    let grains: Vec<usize> = (0..count).map(|k| k * n / count).collect();
    let (mut tighter, tightened) = (
        options.clone(),
        match options.method {
            method if method.is_adaptive() => Tightened::Tolerance,
            _ => Tightened::Step,
        },
    );
    match tightened {
        Tightened::Tolerance => tighter.tolerance = (options.tolerance / TIGHTER).max(1e-14),
        Tightened::Step => tighter.step = options.step.map(|step| 0.5 * step),
    }
    (tighter.every, tighter.progress, tighter.journal, tighter.resume) = (None, None, None, None);
    let again = match run(system, &ensemble.subset(&grains), &tighter, &Nothing) {
        Ok(again) => again,
        // The tighter tolerance may be out of reach where the wanted one was not.
        Err(TraceError::StepUnderflow { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    if again.endings.iter().any(|ending| ending.outcome == Outcome::Stopped) {
        return Ok(None);
    }
    let mut estimate = ErrorEstimate { grains, otherwise: 0, position: 0.0, time: 0.0, tightened };
    for (k, &grain) in estimate.grains.iter().enumerate() {
        let (first, second) = (&traced.endings[grain], &again.endings[k]);
        if !alike(&first.outcome, &second.outcome) {
            estimate.otherwise += 1;
            continue;
        }
        let moved = (traced.ensemble.positions()[grain] - again.ensemble.positions()[k]).norm();
        estimate.position = estimate.position.max(moved);
        estimate.time = estimate.time.max((first.time - second.time).abs());
    }
    Ok(Some(estimate))
}

/// Whether two flights ended in the same way.
fn alike(a: &Outcome, b: &Outcome) -> bool {
    match (a, b) {
        (Outcome::Struck { electrode: a, .. }, Outcome::Struck { electrode: b, .. }) => a == b,
        _ => std::mem::discriminant(a) == std::mem::discriminant(b),
    }
}
