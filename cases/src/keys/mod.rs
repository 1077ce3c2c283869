//! The keys of a case file: the structs it is read into, and of which its JSON Schema is made.
//!
//! The comments here are what an editor shows beside a key. What a key means, and what may stand in it by itself, is said
//! here; what keys demand of each other is checked where they are resolved (see [`crate::resolve`]).

pub(crate) mod analysis;
pub(crate) mod electrode;
pub(crate) mod grains;
pub(crate) mod settings;
pub(crate) mod source;
pub(crate) mod study;
pub(crate) mod sweep;
pub(crate) mod value;
pub(crate) mod waveform;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

/// A case: electrodes and sources, what drives them, and the grains between them.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "graintrap case")]
pub(crate) struct CaseKeys {
    /// What the case shows, in a line.
    pub title: Option<String>,
    /// Electrodes: surfaces at a voltage or with a fixed charge.
    #[serde(default)]
    pub electrode: Vec<electrode::ElectrodeKeys>,
    /// Fields in closed form, beside electrodes or instead of them.
    #[serde(default)]
    pub source: Vec<source::SourceKeys>,
    /// Generators that several electrodes and sources share, by name.
    #[serde(default)]
    pub drive: BTreeMap<String, waveform::WaveformKeys>,
    /// How exactly the field is computed.
    #[serde(default)]
    pub field: settings::FieldKeys,
    /// The tabulated potential.
    #[serde(default)]
    pub table: settings::TableKeys,
    /// Groups of grains.
    #[serde(default)]
    pub grains: Vec<grains::GrainKeys>,
    /// What acts on the grains besides the field. What is not named does not act.
    #[serde(default)]
    pub forces: settings::ForceKeys,
    /// How the grains are traced.
    pub trace: Option<settings::TraceKeys>,
    /// What is written.
    #[serde(default)]
    pub output: settings::OutputKeys,
    /// What `graintrap analyse` looks at.
    #[serde(default)]
    pub analysis: analysis::AnalysisKeys,
    /// Keys to vary: turns the case into a study.
    pub sweep: Option<sweep::SweepTable>,
    /// What a study asks.
    #[serde(default)]
    pub study: study::StudyKeys,
}
