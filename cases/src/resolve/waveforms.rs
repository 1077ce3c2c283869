//! Waveforms: `rf = ...`, and the drives they refer to.

use std::collections::BTreeMap;

use field::WaveformPart;

use super::at::At;
use super::{files, names};
use crate::error::CaseError;
use crate::keys::waveform::{RfEntry, RfKeys, WaveformKeys};
use crate::quantity::{Amplitude, Kind};
use crate::suggestion::{list, nearest};

/// What a waveform drives, which decides what its amplitude measures.
#[derive(Clone)]
pub(super) struct Role {
    /// Volts, volts per metre or coulombs.
    pub kind: Kind,
    /// "an electrode", "a point".
    pub whom: String,
}

/// A waveform with what its amplitude says it measures.
#[derive(Clone)]
struct Part {
    part: WaveformPart,
    /// None: a bare number, or a file.
    kind: Option<Kind>,
    /// The drive that said so, if it was one.
    drive: Option<String>,
}

/// The drives of a case, resolved.
pub(super) struct Drives(BTreeMap<String, Part>);

impl Drives {
    /// Resolves all drives, which may refer to each other.
    pub fn resolve(root: &At, keys: &BTreeMap<String, WaveformKeys>) -> Result<Self, CaseError> {
        let mut drives = Self(BTreeMap::new());
        for name in keys.keys() {
            names::check_key(&root.key("drive").key(name), name)?;
            drives.add(root, keys, name, &mut Vec::new())?;
        }
        Ok(drives)
    }

    /// Resolves one drive after those it refers to. `above`: the drives that wait for it.
    fn add<'k>(
        &mut self,
        root: &At,
        keys: &'k BTreeMap<String, WaveformKeys>,
        name: &str,
        above: &mut Vec<&'k str>,
    ) -> Result<(), CaseError> {
        if self.0.contains_key(name) {
            return Ok(());
        }
        let Some((name, waveform)) = keys.get_key_value(name) else {
            return Ok(()); // said by whoever refers to it
        };
        let at = root.key("drive").key(name);
        above.push(name);
        if let WaveformKeys::Drive { drive, .. } = waveform {
            if above.contains(&drive.as_str()) {
                let chain = above.iter().copied().chain([drive.as_str()]).collect::<Vec<_>>().join(" -> ");
                let problem = format!("{{value}} goes round in a circle: {chain}");
                return Err(at.key("drive").error(problem, "let one of them be a waveform of its own"));
            }
            self.add(root, keys, drive, above)?;
        }
        above.pop();
        let part = self.part(&at, waveform, keys.keys())?;
        self.0.insert(name.to_owned(), Part { drive: Some(name.to_owned()), ..part });
        Ok(())
    }

    /// The parts of an `rf`.
    pub fn parts(&self, at: &At, rf: Option<&RfKeys>, role: &Role) -> Result<Vec<WaveformPart>, CaseError> {
        let one = |at: &At, waveform: &WaveformKeys| {
            let part = self.part(at, waveform, self.0.keys())?;
            let where_said = match waveform {
                WaveformKeys::Drive { .. } => at.key("drive"),
                _ => at.key("amplitude"),
            };
            fits(&where_said, &part, role)?;
            Ok(part.part)
        };
        let named = |at: &At, name: &str| {
            let part = self.named(at, name, self.0.keys())?;
            fits(at, part, role)?;
            Ok(part.part.clone())
        };
        match rf {
            None => Ok(Vec::new()),
            Some(RfKeys::String(name)) => Ok(vec![named(at, name)?]),
            Some(RfKeys::Table(waveform)) => Ok(vec![one(at, waveform)?]),
            Some(RfKeys::List(entries)) => entries
                .iter()
                .enumerate()
                .map(|(n, entry)| match entry {
                    RfEntry::String(name) => named(&at.entry(n), name),
                    RfEntry::Table(waveform) => one(&at.entry(n), waveform),
                })
                .collect(),
        }
    }

    fn named<'n>(&self, at: &At, name: &str, known: impl Iterator<Item = &'n String>) -> Result<&Part, CaseError> {
        self.0.get(name).ok_or_else(|| {
            let known: Vec<&String> = known.collect();
            let quoted: Vec<String> = known.iter().map(|name| format!("\"{name}\"")).collect();
            let help = match (nearest(name, &known), quoted.is_empty()) {
                (Some(name), _) => format!("did you mean \"{name}\"? The drives of the case: {}", list(&quoted, "and")),
                (None, false) => format!("the drives of the case: {}", list(&quoted, "and")),
                (None, true) if name.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '-') => format!(
                    "an rf in figures is a table: {{ amplitude = \"{name}\", frequency = \"60 Hz\" }}; a constant voltage is `dc`"
                ),
                (None, true) => format!("the case has no drives: add [drive.{name}] with amplitude and frequency"),
            };
            at.error("there is no drive {value}", help)
        })
    }

    fn part<'n>(
        &self,
        at: &At,
        waveform: &WaveformKeys,
        known: impl Iterator<Item = &'n String>,
    ) -> Result<Part, CaseError> {
        let own = |part, amplitude: &Amplitude| Ok(Part { part, kind: amplitude.kind, drive: None });
        match waveform {
            WaveformKeys::Sine { amplitude, frequency, phase } => {
                let phase = phase.map_or(0.0, |phase| phase.value);
                let (peak, frequency) = (amplitude.value, frequency.value);
                own(WaveformPart::Sine { amplitude: peak, frequency, phase }, amplitude)
            }
            WaveformKeys::Square { amplitude, frequency, phase, duty } => {
                let phase = phase.map_or(0.0, |phase| phase.value);
                let duty = duty.map_or(0.5, |duty| duty.value);
                let (peak, frequency) = (amplitude.value, frequency.value);
                own(WaveformPart::Square { amplitude: peak, frequency, phase, duty }, amplitude)
            }
            WaveformKeys::Ramp { amplitude, start, duration } => {
                let start = start.map_or(0.0, |start| start.value);
                let part = WaveformPart::Ramp { amplitude: amplitude.value, start, duration: duration.value };
                own(part, amplitude)
            }
            WaveformKeys::Sampled { file, scale, repeat } => {
                let repeat = repeat.unwrap_or(false);
                let (times, values) = files::samples(&at.key("file"), file, repeat)?;
                let scale = scale.map_or(1.0, |scale| scale.value);
                let part = WaveformPart::Sampled { times: times.into(), values: values.into(), scale, repeat };
                Ok(Part { part, kind: None, drive: None })
            }
            WaveformKeys::Drive { drive, scale, phase } => {
                let mut part = self.named(&at.key("drive"), drive, known)?.clone();
                let factor = scale.map_or(1.0, |scale| scale.value);
                let too_large =
                    || at.key("scale").error("{value} times the amplitude is too large", "numbers end at 1.8e308");
                match &mut part.part {
                    WaveformPart::Sine { amplitude, phase: own, .. }
                    | WaveformPart::Square { amplitude, phase: own, .. } => {
                        *amplitude *= factor;
                        *own += phase.map_or(0.0, |phase| phase.value);
                    }
                    WaveformPart::Ramp { .. } | WaveformPart::Sampled { .. } if phase.is_some() => {
                        let problem = format!("`phase` means nothing to the drive \"{drive}\", which has no frequency");
                        return Err(at.key("phase").error(problem, "leave `phase` out"));
                    }
                    WaveformPart::Ramp { amplitude, .. } => *amplitude *= factor,
                    WaveformPart::Sampled { scale, .. } => *scale *= factor,
                }
                let peak = match &part.part {
                    WaveformPart::Sine { amplitude, .. }
                    | WaveformPart::Square { amplitude, .. }
                    | WaveformPart::Ramp { amplitude, .. } => amplitude,
                    WaveformPart::Sampled { scale, .. } => scale,
                };
                if peak.is_finite() { Ok(part) } else { Err(too_large()) }
            }
        }
    }
}

/// Whether a waveform's amplitude measures what it drives.
fn fits(at: &At, part: &Part, role: &Role) -> Result<(), CaseError> {
    let Some(kind) = part.kind.filter(|kind| *kind != role.kind) else { return Ok(()) };
    let whom = &role.whom;
    let help = format!("{whom} is driven by {}, as in \"{}\"", role.kind.si(), role.kind.example());
    Err(match &part.drive {
        Some(drive) => {
            let problem =
                format!("the drive \"{drive}\" is {}, but {whom} is driven by {}", kind.noun(), role.kind.noun());
            at.error(problem, format!("see `drive.{drive}.amplitude`; {help}"))
        }
        None => at.error(format!("{{value}} is {}, not {}", kind.noun(), role.kind.noun()), help),
    })
}
