//! From unit solutions to driven fields: here the volts come in.

use std::sync::Arc;

use field::{
    BasisField, Channels, DrivenField, ElectrodeBasis, PanelSum, PotentialTable, Source, SourceKind, TabulatedField,
    Waveform,
};

use crate::CaseSource;
use crate::case::{Case, SourceKind as CaseSourceKind};

use super::Failure;

/// The closed-form sources of a case at strength one.
///
/// # Errors
/// A source without a direction.
pub fn sources(case: &Case, source: &CaseSource) -> Result<Vec<Source>, Failure> {
    case.sources
        .iter()
        .map(|s| {
            let frame = s.placement.frame().map_err(|error| {
                source.error_at(&format!("source.{}.{}", s.name, error.key), error.problem, error.help)
            })?;
            let kind = match s.kind {
                CaseSourceKind::Quadrupole { r0, dimensions: 2, .. } => SourceKind::PlanarQuadrupole { r0 },
                CaseSourceKind::Quadrupole { r0, z0, .. } => {
                    SourceKind::Quadrupole { r0, z0: z0.unwrap_or(r0 / 2.0_f64.sqrt()) }
                }
                CaseSourceKind::Uniform { .. } => SourceKind::Uniform,
                CaseSourceKind::Point => SourceKind::Point,
                CaseSourceKind::ThinRing { radius } => SourceKind::ThinRing { radius },
            };
            Ok(Source { kind, center: s.placement.center, frame })
        })
        .collect()
}

/// The channels of a case: floating electrodes at the voltage that gives them their charge.
pub fn channels(case: &Case, basis: &ElectrodeBasis) -> Channels {
    channels_of(case, basis, &case.given().0)
}

/// The same with other voltages, strengths and charges: see [`Case::given`].
pub fn channels_of(case: &Case, basis: &ElectrodeBasis, waveforms: &[Waveform]) -> Channels {
    let (_, floating) = case.given();
    let electrodes = case.electrodes.len();
    let rows = basis.capacitance.floating_voltages(&floating[..electrodes], &basis.induced);
    let combinations: Vec<(usize, Vec<f64>)> = (0..electrodes).filter(|&e| floating[e]).zip(rows).collect();
    Channels::with_floating(waveforms, &combinations)
}

/// The field of a case, driven.
#[derive(Clone)]
pub struct Driven {
    /// The field, tabulated or not.
    pub field: DrivenField,
    /// The same channels as exact sums, which also know what is inside conductors.
    pub exact: Arc<PanelSum>,
    /// What each channel is made of: names of electrodes and sources, as `left+right` or `left-right`.
    pub names: Vec<String>,
    /// Weight of each electrode and source in each channel.
    pub weights: Vec<Arc<[f64]>>,
}

impl Driven {
    /// Volts of each electrode and strength of each source, from volts of each channel.
    pub fn functions(&self, channels: &[f64]) -> Vec<f64> {
        let functions = self.weights.first().map_or(0, |row| row.len());
        (0..functions).map(|f| self.weights.iter().zip(channels).map(|(row, volts)| row[f] * volts).sum()).collect()
    }
}

/// The exact field of a case.
pub fn exact_field(case: &Case, basis: &ElectrodeBasis) -> Driven {
    let channels = at_least_one(channels(case, basis), basis.functions());
    let names = channel_names(case, &channels.weights);
    let exact = Arc::new(basis.combined(&channels.weights));
    let shared: Arc<dyn BasisField> = exact.clone();
    let weights = channels.weights.iter().map(|row| Arc::from(&row[..])).collect();
    Driven { field: DrivenField::new(shared, channels.waveforms), exact, names, weights }
}

/// The tabulated field of a case, exact where the table does not reach.
pub fn tabulated_field(case: &Case, basis: &ElectrodeBasis, table: &PotentialTable) -> Driven {
    let channels = at_least_one(channels(case, basis), basis.functions());
    let names = channel_names(case, &channels.weights);
    let field = TabulatedField::combined(basis, table, &channels.weights);
    let exact = Arc::clone(&field.exact);
    let weights = channels.weights.iter().map(|row| Arc::from(&row[..])).collect();
    Driven { field: DrivenField::new(Arc::new(field), channels.waveforms), exact, names, weights }
}

/// The voltage of each electrode and the strength of each source at a time, floating electrodes included.
pub fn strengths(case: &Case, basis: &ElectrodeBasis, time: f64) -> Vec<f64> {
    let channels = channels(case, basis);
    (0..basis.functions()).map(|function| channels.waveform_of(function).value(time)).collect()
}

/// Weights below this, against the largest in a channel, are rounding: they give no name.
const NAMELESS: f64 = 1e-9;

/// Electrodes that a channel's name lists.
const NAMED: usize = 4;

/// A name for each channel, each different.
fn channel_names(case: &Case, weights: &[Vec<f64>]) -> Vec<String> {
    let all: Vec<&String> =
        case.electrodes.iter().map(|e| &e.name).chain(case.sources.iter().map(|s| &s.name)).collect();
    let mut names: Vec<String> = Vec::with_capacity(weights.len());
    for row in weights {
        let members: Vec<(&str, f64)> =
            all.iter().map(|n| n.as_str()).zip(row.iter().copied()).filter(|(_, w)| w.abs() > NAMELESS).collect();
        let mut name = String::new();
        for (member, weight) in members.iter().take(NAMED) {
            let sign = if *weight < 0.0 { "-" } else { "+" };
            name += if name.is_empty() && sign == "+" { "" } else { sign };
            name += member;
        }
        if members.len() > NAMED {
            name += &format!("+{} more", members.len() - NAMED);
        }
        if name.is_empty() {
            name += "none";
        }
        let same = names.iter().filter(|n| **n == name || n.starts_with(&format!("{name} ("))).count();
        names.push(if same == 0 { name } else { format!("{name} ({})", same + 1) });
    }
    names
}

/// A field without channels would have no potential to speak of: give it one that is zero.
fn at_least_one(mut channels: Channels, functions: usize) -> Channels {
    if channels.weights.is_empty() {
        channels.weights.push(vec![0.0; functions]);
        channels.waveforms.push(Waveform::default());
    }
    channels
}
