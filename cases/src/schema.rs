//! JSON Schema of the case file, made of the structs it is read into.
//!
//! It says what a key may hold by itself. What keys demand of each other (a wire thinner than its ring, a drive that
//! exists) only [`crate::Case::read`] can say, apart from a few rules added here that JSON Schema has words for.

use std::borrow::Cow;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Value, json};

use crate::keys::{CaseKeys, electrode, grains, settings, source, waveform};

/// The JSON Schema (draft 2020-12) of the case file, for editors.
pub fn schema() -> Value {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<CaseKeys>().to_value();
    without_null(&mut schema);
    schema["properties"]["drive"]["propertyNames"] = json!({ "pattern": crate::key_path::NAME_PATTERN });
    either(&mut schema, "/$defs/GrainKeys", &["mass", "density"]);
    if let Some(common) = schema.pointer_mut("/$defs/ElectrodeKeys/oneOf").and_then(Value::as_array_mut) {
        for shape in common {
            shape["dependentSchemas"] =
                json!({ "charge": { "not": { "anyOf": [{ "required": ["dc"] }, { "required": ["rf"] }] } } });
        }
    }
    // Some field there must be.
    schema["anyOf"] = json!([{ "required": ["electrode"] }, { "required": ["source"] }]);
    schema["dependentRequired"] = json!({ "grains": ["trace"] });
    for name in ["TableKeys", "AnalysisKeys"] {
        if let Some(table) = schema.pointer_mut(&format!("/$defs/{name}")) {
            table["dependentRequired"] = json!({ "min": ["max"], "max": ["min"] });
        }
    }
    if let Some(forces) = schema.pointer_mut("/$defs/ForceKeys") {
        forces["dependentRequired"] = json!({ "langevin": ["drag"] });
    }
    schema
}

/// Takes back that keys which may be left out may be null: TOML has no null.
fn without_null(schema: &mut Value) {
    match schema {
        Value::Object(table) => {
            if let Some(types) = table.get_mut("type").and_then(Value::as_array_mut) {
                types.retain(|name| name != "null");
                if let [only] = &types[..] {
                    table["type"] = only.clone();
                }
            }
            if let Some(forms) = table.get_mut("anyOf").and_then(Value::as_array_mut) {
                forms.retain(|form| form != &json!({ "type": "null" }));
            }
            table.values_mut().for_each(without_null);
        }
        Value::Array(list) => list.iter_mut().for_each(without_null),
        _ => {}
    }
}

/// Demands exactly one of two keys.
fn either(schema: &mut Value, pointer: &str, keys: &[&str]) {
    if let Some(table) = schema.pointer_mut(pointer) {
        table["oneOf"] = keys.iter().map(|key| json!({ "required": [key] })).collect();
    }
}

/// The names of a family of tables and the keys of each: for "`wire_radius` belongs to ring, wire and grid_plate".
pub(crate) fn keys_of(family: &str) -> Vec<(String, Vec<String>)> {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let (tag, schema) = match family {
        "ShapeKeys" => ("shape", generator.into_root_schema_for::<electrode::ShapeKeys>()),
        "SourceKind" => ("kind", generator.into_root_schema_for::<source::SourceKind>()),
        "PlaceKeys" => ("kind", generator.into_root_schema_for::<grains::PlaceKeys>()),
        "SpeedKeys" => ("kind", generator.into_root_schema_for::<grains::SpeedKeys>()),
        "WaveformKeys" => ("kind", generator.into_root_schema_for::<waveform::WaveformKeys>()),
        "GasDragKeys" => ("model", generator.into_root_schema_for::<settings::GasDragKeys>()),
        "settings" => return settings_keys(),
        _ => return Vec::new(),
    };
    let variants = schema.as_value()["oneOf"].as_array().cloned().unwrap_or_default();
    let keys = |variant: &Value| {
        let properties = variant["properties"].as_object()?;
        let name = properties.get(tag)?["const"].as_str()?.to_owned();
        Some((name, properties.keys().filter(|key| *key != tag).cloned().collect()))
    };
    variants.iter().filter_map(keys).collect()
}

/// The same for the tables of settings.
fn settings_keys() -> Vec<(String, Vec<String>)> {
    let schema = schema();
    let table = |name: &str, pointer: &str| {
        let properties = schema.pointer(pointer).and_then(Value::as_object);
        (name.to_owned(), properties.map(|keys| keys.keys().cloned().collect()).unwrap_or_default())
    };
    [
        ("field", "Field"),
        ("analysis", "Analysis"),
        ("table", "Table"),
        ("forces", "Force"),
        ("trace", "Trace"),
        ("output", "Output"),
    ]
    .map(|(name, keys)| table(name, &format!("/$defs/{keys}Keys/properties")))
    .into()
}

/// The schema of a table that is read as two structs: each variant of the second with the keys of the first.
fn merged(common: Schema, mut variants: Schema) -> Schema {
    let common = common.to_value();
    let empty = serde_json::Map::new();
    let (properties, required) = (common["properties"].as_object().unwrap_or(&empty), common["required"].as_array());
    if let Some(list) = variants.get_mut("oneOf").and_then(Value::as_array_mut) {
        for variant in list {
            for (key, value) in properties {
                variant["properties"][key] = value.clone();
            }
            if let (Some(all), Some(required)) = (variant["required"].as_array_mut(), required) {
                all.extend(required.iter().cloned());
            }
        }
    }
    variants
}

impl JsonSchema for electrode::ElectrodeKeys {
    fn schema_name() -> Cow<'static, str> {
        "ElectrodeKeys".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        merged(electrode::CommonKeys::json_schema(generator), electrode::ShapeKeys::json_schema(generator))
    }
}

impl JsonSchema for source::SourceKeys {
    fn schema_name() -> Cow<'static, str> {
        "SourceKeys".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = merged(source::CommonKeys::json_schema(generator), source::SourceKind::json_schema(generator));
        // Charges are charged, the others have a dc.
        for variant in schema.get_mut("oneOf").and_then(Value::as_array_mut).into_iter().flatten() {
            let charged = matches!(variant["properties"]["kind"]["const"].as_str(), Some("point" | "thin_ring"));
            if let Some(properties) = variant["properties"].as_object_mut() {
                properties.remove(if charged { "dc" } else { "charge" });
            }
        }
        schema
    }
}

/// A waveform without `kind` is a sine, or a drive where `drive` is given.
pub(crate) fn waveform_kind_may_be_left_out(schema: &mut Schema) {
    for variant in schema.get_mut("oneOf").and_then(Value::as_array_mut).into_iter().flatten() {
        let kind = variant["properties"]["kind"]["const"].as_str().unwrap_or_default();
        if matches!(kind, "sine" | "drive")
            && let Some(required) = variant["required"].as_array_mut()
        {
            required.retain(|key| key != "kind");
        }
    }
}
