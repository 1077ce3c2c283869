//! `rf = ...` and `[drive.NAME]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::value::{Fraction, Number};
use crate::quantity::kinds::{Angle, Frequency, Time};
use crate::quantity::{Amplitude, Positive, Si};

/// What is added to a constant voltage.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum RfKeys {
    /// The name of a drive.
    String(String),
    /// A waveform.
    Table(WaveformKeys),
    /// Several, added.
    List(Vec<RfEntry>),
}

/// One of several.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum RfEntry {
    /// The name of a drive.
    String(String),
    /// A waveform.
    Table(WaveformKeys),
}

/// One waveform. Without `kind` it is a sine, or a drive where `drive` is given.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "kind", transform = crate::schema::waveform_kind_may_be_left_out)]
pub(crate) enum WaveformKeys {
    /// amplitude cos(2 pi frequency t + phase).
    Sine {
        /// Peak value: a voltage for electrodes.
        amplitude: Amplitude,
        /// Frequency; "rad/s" is converted.
        frequency: Positive<Frequency>,
        /// Phase at time zero; left out: 0.
        phase: Option<Si<Angle>>,
    },
    /// Plus or minus the amplitude in turn.
    Square {
        /// Peak value: a voltage for electrodes.
        amplitude: Amplitude,
        /// Frequency; "rad/s" is converted.
        frequency: Positive<Frequency>,
        /// Phase at time zero; left out: 0.
        phase: Option<Si<Angle>>,
        /// Fraction of the period spent high; left out: 0.5.
        duty: Option<Fraction>,
    },
    /// Zero until `start`, then linear to `amplitude` within `duration`, then constant.
    Ramp {
        /// Final value: a voltage for electrodes.
        amplitude: Amplitude,
        /// Left out: 0.
        start: Option<Si<Time>>,
        /// How long it rises.
        duration: Positive<Time>,
    },
    /// From a CSV file with columns time, value in SI; linear between the samples.
    Sampled {
        /// The file, relative to the case file.
        file: String,
        /// Factor on the values; left out: 1.
        scale: Option<Number>,
        /// Start again after the last sample; left out: hold it.
        repeat: Option<bool>,
    },
    /// What a `[drive.NAME]` gives.
    Drive {
        /// Its name.
        drive: String,
        /// Factor on its amplitude; left out: 1.
        scale: Option<Number>,
        /// Added to its phase; left out: 0.
        phase: Option<Si<Angle>>,
    },
}
