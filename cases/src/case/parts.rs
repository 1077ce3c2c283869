//! What a cached result depends on, as text to hash.

use serde_json::{Value, json};

use super::Case;

/// A case in parts, each as JSON text that is the same whenever the part means the same.
///
/// | cached | depends on |
/// |---|---|
/// | mesh, unit solutions, capacitances | `geometry`, `sources` |
/// | table of unit potentials | `geometry`, `sources`, `table`, and what it takes from `starts`: its box and its first spacing |
/// | trajectories | all |
///
/// Imported meshes enter by the hash of their bytes and not by their path, so that a moved case keeps its cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseParts {
    /// Names, shapes and places of the electrodes, how the field is computed, and where it is to be as exact as asked.
    pub geometry: String,
    /// Sources without their strength.
    pub sources: String,
    /// The settings of the table.
    pub table: String,
    /// Where grains start: a box that the case leaves open is chosen around them.
    pub starts: String,
    /// Voltages, charges and strengths.
    pub drives: String,
    /// Grains, forces, tracing and output.
    pub grains: String,
}

impl Case {
    /// What cached results depend on.
    pub fn parts(&self) -> CaseParts {
        let whole = json!(self);
        let without = |list: &str, key: &str| -> Value {
            let mut list = whole[list].clone();
            for entry in list.as_array_mut().into_iter().flatten() {
                if let Some(entry) = entry.as_object_mut() {
                    entry.remove(key);
                }
                if let Some(imported) = entry.pointer_mut("/shape/imported").and_then(Value::as_object_mut) {
                    imported.remove("path");
                }
            }
            list
        };
        let of = |list: &str, key: &str| -> Value {
            let entries = whole[list].as_array().into_iter().flatten();
            entries.map(|entry| json!([entry["name"], entry[key]])).collect()
        };
        CaseParts {
            geometry: json!([without("electrodes", "drive"), whole["field"], whole["table"]["region"]]).to_string(),
            sources: without("sources", "waveform").to_string(),
            table: whole["table"].to_string(),
            starts: of("grains", "place").to_string(),
            drives: json!([of("electrodes", "drive"), of("sources", "waveform")]).to_string(),
            grains: json!([whole["grains"], whole["forces"], whole["trace"], whole["output"]]).to_string(),
        }
    }
}
