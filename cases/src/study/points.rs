//! The points of a sweep.

use super::files::number_and_unit;
use crate::cache::{Digest, digest, solution_key};
use crate::case::{Case, Optimise};
use crate::quantity::in_si;
use crate::{CaseError, CaseSource};

/// One point of a sweep.
#[derive(Clone, Debug)]
pub struct Point {
    /// From 0, in the order of the sweep.
    pub number: usize,
    /// The value of each varied key, as it is written.
    pub values: Vec<String>,
    /// What it is known by: of everything its row depends on.
    pub key: Digest,
    /// Of what its solution depends on; points that have it in common share that.
    pub solution: Digest,
}

/// The point of a sweep that cannot be, and why.
#[derive(Clone, Debug)]
pub struct Refused {
    /// From 0, in the order of the sweep.
    pub number: usize,
    /// The value of each varied key, as it is written.
    pub values: Vec<String>,
    /// What is wrong with the case there.
    pub error: CaseError,
}

/// Raised when the same case gives other rows than before.
const EDITION: u32 = 2;

/// The case at a point of its sweep.
///
/// # Errors
/// The values make no case.
pub fn case_at(case: &Case, source: &CaseSource, values: &[String]) -> Result<(Case, CaseSource), CaseError> {
    let varied: Vec<(String, String)> = match &case.study.optimise {
        Some(optimise) => edits(optimise, values).map_err(|(key, problem)| {
            source.error_at(&format!("study.tie.{key:?}"), problem, "tie it to what has a value within the bounds")
        })?,
        None => {
            let keys = case.sweep.iter().flat_map(|sweep| &sweep.axes).map(|axis| axis.key.clone());
            keys.zip(values.iter().cloned()).collect()
        }
    };
    let varied = varied.into_iter().map(|(key, value)| format!("{key}={value}"));
    let sets: Vec<String> = source.sets.iter().cloned().chain(varied).collect();
    Case::parse(&source.path, &source.text, &sets)
}

/// The keys of the case that a point of an optimisation sets, with their values as they are written.
///
/// # Errors
/// A tie without a value: its key, and why.
pub fn edits(optimise: &Optimise, values: &[String]) -> Result<Vec<(String, String)>, (String, String)> {
    let pairs = || optimise.varied.iter().zip(values);
    let mut edits: Vec<(String, String)> = pairs()
        .filter(|(varied, _)| varied.is_key)
        .map(|(varied, value)| (varied.key.clone(), value.clone()))
        .collect();
    let of = |name: &str| pairs().find(|(varied, _)| varied.key == name).and_then(|(_, value)| value_in_si(value));
    for tie in &optimise.ties {
        let value = tie.value.value(of).map_err(|problem| (tie.key.clone(), problem))?;
        edits.push((tie.key.clone(), format!("{value:?}")));
    }
    Ok(edits)
}

/// A value of a key as it is written, in SI.
pub fn value_in_si(text: &str) -> Option<f64> {
    let (number, unit) = number_and_unit(text)?;
    if unit.is_empty() { Some(number) } else { in_si(&format!("{number} {unit}")) }
}

/// All points of a case's sweep, and those that cannot be.
pub fn points(case: &Case, source: &CaseSource) -> (Vec<Point>, Vec<Refused>) {
    let (mut points, mut refused) = (Vec::new(), Vec::new());
    let Some(sweep) = &case.sweep else { return (points, refused) };
    for number in 0..sweep.count().unwrap_or(0) {
        let values: Vec<String> = sweep.point(number).into_iter().map(str::to_owned).collect();
        match case_at(case, source, &values) {
            Ok((at, _)) => points.push(Point { number, values, key: key(&at), solution: solution_key(&at) }),
            Err(error) => refused.push(Refused { number, values, error }),
        }
    }
    (points, refused)
}

/// The digest of everything that a row depends on.
pub fn key(case: &Case) -> Digest {
    let parts = case.parts();
    let mut study = serde_json::to_string(&case.study).unwrap_or_default();
    if case.study.asked.trap() {
        study += &format!("{:?} {}", case.analysis.region, case.analysis.nodes);
    }
    let edition = format!("row {EDITION} of {}", env!("CARGO_PKG_VERSION"));
    digest(&[
        edition.as_bytes(),
        parts.geometry.as_bytes(),
        parts.sources.as_bytes(),
        parts.table.as_bytes(),
        parts.starts.as_bytes(),
        parts.drives.as_bytes(),
        parts.grains.as_bytes(),
        study.as_bytes(),
    ])
}
