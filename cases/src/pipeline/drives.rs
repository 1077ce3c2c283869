//! From unit solutions to driven fields: here the volts come in.

use std::sync::Arc;

use field::{Channels, DrivenField, ElectrodeBasis, PotentialTable, Source, SourceKind, TabulatedField, Waveform};

use crate::CaseSource;
use crate::case::{Case, Drive, SourceKind as CaseSourceKind};

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

/// What each basis function (electrodes, then sources) is given: a voltage, a strength, or a charge for floating electrodes.
fn given(case: &Case) -> (Vec<Waveform>, Vec<bool>) {
    let electrodes = case.electrodes.iter().map(|e| match &e.drive {
        Drive::Voltage(waveform) => (waveform.clone(), false),
        Drive::Charge(charge) => (Waveform::constant(*charge), true),
    });
    let sources = case.sources.iter().map(|s| (s.waveform.clone(), false));
    electrodes.chain(sources).unzip()
}

/// The channels of a case: floating electrodes at the voltage that gives them their charge.
pub fn channels(case: &Case, basis: &ElectrodeBasis) -> Channels {
    let (waveforms, floating) = given(case);
    let electrodes = case.electrodes.len();
    let rows = basis.capacitance.floating_voltages(&floating[..electrodes], &basis.induced);
    let combinations: Vec<(usize, Vec<f64>)> = (0..electrodes).filter(|&e| floating[e]).zip(rows).collect();
    Channels::with_floating(&waveforms, &combinations)
}

/// The exact field of a case. Without any voltage it has one channel at zero.
pub fn exact_field(case: &Case, basis: &ElectrodeBasis) -> DrivenField {
    let channels = at_least_one(channels(case, basis), basis.functions());
    DrivenField::new(Arc::new(basis.combined(&channels.weights)), channels.waveforms)
}

/// The tabulated field of a case, exact where the table does not reach.
pub fn tabulated_field(case: &Case, basis: &ElectrodeBasis, table: &PotentialTable) -> DrivenField {
    let channels = at_least_one(channels(case, basis), basis.functions());
    let field = TabulatedField::combined(basis, table, &channels.weights);
    DrivenField::new(Arc::new(field), channels.waveforms)
}

/// A field without channels would have no potential to speak of: give it one that is zero.
fn at_least_one(mut channels: Channels, functions: usize) -> Channels {
    if channels.weights.is_empty() {
        channels.weights.push(vec![0.0; functions]);
        channels.waveforms.push(Waveform::default());
    }
    channels
}
