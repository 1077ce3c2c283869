//! What a cached result depends on, as text to hash.

use serde_json::{Value, json};

use super::Case;

/// A case in parts, each as JSON text that is the same whenever the part means the same.
///
/// | cached | depends on |
/// |---|---|
/// | mesh, unit solutions, capacitances, table of unit potentials | `geometry`, `table`, `starts` |
/// | trajectories | all |
///
/// Imported meshes enter by the hash of their bytes and not by their path, so that a moved case keeps its cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseParts {
    /// Names, shapes and places of the electrodes, and how the field is computed.
    pub geometry: String,
    /// Sources without their strength, and the settings of the table.
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
            geometry: json!([without("electrodes", "drive"), whole["field"]]).to_string(),
            table: json!([without("sources", "waveform"), whole["table"]]).to_string(),
            starts: of("grains", "place").to_string(),
            drives: json!([of("electrodes", "drive"), of("sources", "waveform")]).to_string(),
            grains: json!([whole["grains"], whole["forces"], whole["trace"], whole["output"]]).to_string(),
        }
    }
}
