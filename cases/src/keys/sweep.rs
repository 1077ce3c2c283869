//! `[sweep]`.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::value::{Count, Whole};

/// Keys of the case and the values they take, how these are combined, and what to report.
#[derive(Default)]
pub(crate) struct SweepTable {
    pub axes: Vec<(String, SweepKeys)>,
    pub report: Vec<String>,
    pub sampling: Sampling,
    pub samples: Option<Count>,
    pub seed: Option<Whole<0>>,
}

/// How the values of several keys are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Every value of each with every value of the others.
    #[default]
    Grid,
    /// The first of each, the second of each, ...
    Zip,
    /// So many samples that each range is cut into as many equal parts, one sample in each (McKay, Beckman and Conover 1979).
    LatinHypercube,
    /// So many points of Sobol's sequence, scrambled after Owen: they fill the space more evenly than random ones.
    Sobol,
}

/// The values of one key.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum SweepKeys {
    /// These.
    List(#[schemars(length(min = 1))] Vec<AnyValue>),
    /// Evenly spread.
    Table(SpreadKeys),
}

/// Any value; what may stand there is what the varied key takes.
#[derive(Deserialize, JsonSchema)]
pub(crate) struct AnyValue(#[schemars(with = "serde_json::Value")] IgnoredAny);

/// Values spread between two ends.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpreadKeys {
    /// The first value: a number, or a string with a unit.
    pub from: End,
    /// The last value, in the same unit.
    pub to: End,
    /// How many values, both ends counted; not for samples.
    pub steps: Option<Whole<2>>,
    /// Equal differences or equal ratios; left out: "linear".
    pub scale: Option<Scale>,
}

/// An end of a spread.
#[derive(Clone, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(untagged)]
pub(crate) enum End {
    /// With a unit.
    String(String),
    /// In SI.
    Number(super::value::Number),
}

/// How values are spread.
#[derive(Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Scale {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios.
    Log,
}

struct SweepVisitor;

impl<'de> Visitor<'de> for SweepVisitor {
    type Value = SweepTable;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SweepTable, A::Error> {
        let mut sweep = SweepTable::default();
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "report" => sweep.report = map.next_value()?,
                "sampling" => sweep.sampling = map.next_value()?,
                "samples" => sweep.samples = Some(map.next_value()?),
                "seed" => sweep.seed = Some(map.next_value()?),
                _ => sweep.axes.push((key, map.next_value()?)),
            }
        }
        Ok(sweep)
    }
}

impl<'de> Deserialize<'de> for SweepTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SweepVisitor)
    }
}

impl JsonSchema for SweepTable {
    fn schema_name() -> Cow<'static, str> {
        "Sweep".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let values = generator.subschema_for::<SweepKeys>();
        let sampling = generator.subschema_for::<Sampling>();
        let mut samples = generator.subschema_for::<Count>();
        samples.insert("description".to_owned(), "How many points a Latin hypercube or Sobol's sequence has.".into());
        let mut seed = generator.subschema_for::<Whole<0>>();
        seed.insert("description".to_owned(), "Of random samples; left out: 1.".into());
        json_schema!({
            "type": "object",
            "description": "Key paths in quotes, as \"electrode.left.dc\", each with a list of values or { from, to, steps, scale }.",
            "properties": {
                "report": { "type": "array", "items": { "type": "string" }, "description": "The numbers to report of each point; left out: all." },
                "sampling": sampling,
                "samples": samples,
                "seed": seed
            },
            "additionalProperties": values
        })
    }
}
