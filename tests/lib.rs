//! What the validation suites share: reference values, meshes of several electrodes, random numbers from a fixed seed. The
//! suites themselves are the test targets beside this file, one for each kind of evidence.

use meshes::{Placement, Shape, SurfaceMesh, Vec3, triangulate_to};
use serde_json::Value;

/// A reference case: what goes in and what must come out, to so many digits.
pub struct Reference {
    /// Its name in the file.
    pub id: String,
    /// Parameters.
    pub inputs: Value,
    /// Exact values.
    pub outputs: Value,
}

impl Reference {
    /// A number among the inputs.
    pub fn input(&self, key: &str) -> f64 {
        number(&self.inputs[key])
    }

    /// A number among the outputs.
    pub fn output(&self, key: &str) -> f64 {
        number(&self.outputs[key])
    }
}

/// A JSON number.
///
/// # Panics
/// It is none.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// A JSON list of numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list")).iter().map(number).collect()
}

/// A JSON list of three numbers.
pub fn vector(value: &Value) -> Vec3 {
    Vec3::from_vec(numbers(value))
}

/// The cases of a file in `tests/reference`.
pub fn reference(file: &str) -> Vec<Reference> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("reference").join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let all: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let cases = all["cases"].as_array().unwrap_or_else(|| panic!("{}: no cases", path.display()));
    cases
        .iter()
        .map(|c| Reference {
            id: c["id"].as_str().unwrap_or_default().to_string(),
            inputs: c["inputs"].clone(),
            outputs: c["outputs"].clone(),
        })
        .collect()
}

/// One case of a file in `tests/reference`.
///
/// # Panics
/// There is none of that name.
pub fn reference_case(file: &str, id: &str) -> Reference {
    reference(file).into_iter().find(|c| c.id == id).unwrap_or_else(|| panic!("{file} has no case {id}"))
}

/// A mesh of one electrode with about so many panels, at the origin.
pub fn single(shape: &Shape, panels: usize) -> SurfaceMesh {
    several(&[(shape.clone(), Placement::default(), panels)])
}

/// A mesh of several electrodes, each with about so many panels.
pub fn several(parts: &[(Shape, Placement, usize)]) -> SurfaceMesh {
    SurfaceMesh::assemble(parts.iter().enumerate().map(|(i, (shape, placement, panels))| {
        let mesh = triangulate_to(shape, *panels).expect("the shape can be").0;
        (format!("electrode{i}"), mesh.placed(placement).expect("it has a direction"))
    }))
}

/// Centred there, with the axis along z.
pub fn at(center: Vec3) -> Placement {
    Placement { center, ..Placement::default() }
}

/// Numbers in [0, 1) from a fixed seed (xorshift of Marsaglia 2003).
pub fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}
