//! `[sweep]`.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};

use super::value::Whole;

/// Keys of the case and the values they take, and what to report.
pub(crate) struct SweepTable {
    pub axes: Vec<(String, SweepKeys)>,
    pub report: Vec<String>,
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
    /// How many values, both ends counted.
    pub steps: Whole<2>,
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
        let mut sweep = SweepTable { axes: Vec::new(), report: Vec::new() };
        while let Some(key) = map.next_key::<String>()? {
            if key == "report" {
                sweep.report = map.next_value()?;
            } else {
                sweep.axes.push((key, map.next_value()?));
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
        json_schema!({
            "type": "object",
            "description": "Key paths in quotes, as \"electrode.left.dc\", each with a list of values or { from, to, steps, scale }.",
            "properties": {
                "report": { "type": "array", "items": { "type": "string" }, "description": "What to report of each run." }
            },
            "additionalProperties": values
        })
    }
}
