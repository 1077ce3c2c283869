//! What the validation suites share: reference values, meshes of several electrodes, random numbers from a fixed seed. The
//! suites themselves are the test targets beside this file, one for each kind of evidence.

use field::{BoundaryProblem, CELLS_PER_BRICK, ElectrodeBasis, PotentialTable, TableOptions, TabulatedField, tabulate};
use meshes::{Placement, Shape, SurfaceMesh, SurfaceTree, Vec3, triangulate_to};
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

/// A ring about z, a sheet of a disc above it and a solid sphere below, off the axis: three electrodes of so many panels each.
pub fn ring_disc_sphere(panels: usize) -> SurfaceMesh {
    several(&[
        (Shape::Ring { radius: 1.0, wire_radius: 0.1 }, at(Vec3::zeros()), panels),
        (Shape::Disc { radius: 0.8, hole_radius: 0.0, thickness: 0.0 }, at(Vec3::z()), panels),
        (Shape::Sphere { radius: 0.3 }, at(Vec3::new(0.2, 0.0, -1.4)), panels),
    ])
}

/// Two rings of radius 1 about z at z = ±1, solved and tabulated in the cube of that half side.
pub struct TwoRings {
    /// Their solution.
    pub basis: ElectrodeBasis,
    /// The table.
    pub table: PotentialTable,
    /// Half the side of the cube about the origin, m.
    pub half: f64,
}

impl TwoRings {
    /// With a table of so many bricks along each side.
    pub fn tabulated(bricks: usize) -> Self {
        let ring = Shape::Ring { radius: 1.0, wire_radius: 0.02 };
        let mesh = several(&[(ring.clone(), at(-Vec3::z()), 400), (ring, at(Vec3::z()), 400)]);
        let basis = BoundaryProblem::new(&mesh).solve().expect("sound rings");
        let half = 0.6;
        let (min, max) = (Vec3::repeat(-half), Vec3::repeat(half));
        let spacing = Some(2.0 * half / (bricks * CELLS_PER_BRICK) as f64);
        // The accuracy sets how exact the nodes are, here as exact as can be. Bricks that do not reach it with their spacing
        // are interpolated all the same: the table is to err by interpolation and by nothing else.
        let options = TableOptions { min, max, accuracy: 1e-8, spacing, max_bytes: 1 << 30, smooth: false };
        let mut table = tabulate(&basis, &options, &|_| ()).expect("a small table").0;
        table.tabulate_all();
        Self { basis, table, half }
    }

    /// Combinations of the two rings' unit fields.
    pub fn field(&self, weights: &[Vec<f64>]) -> TabulatedField {
        TabulatedField::combined(&self.basis, &self.table, weights)
    }
}

/// Random points in a cube of that half side (m) about the origin, outside of solid electrodes and at least `clearance` (m)
/// away from all of them.
pub fn clear_points(mesh: &SurfaceMesh, half: f64, clearance: f64, count: usize, seed: u64) -> Vec<Vec3> {
    let (tree, mut next) = (SurfaceTree::new(mesh), random(seed));
    let points = std::iter::repeat_with(|| Vec3::from_fn(|_, _| half * (2.0 * next() - 1.0)));
    points.filter(|p| tree.nearest(p, clearance).is_none() && tree.inside(p).is_none()).take(count).collect()
}

/// Slope of log error over log step between neighbours.
pub fn slopes(steps: &[f64], errors: &[f64]) -> Vec<f64> {
    let pairs = steps.windows(2).zip(errors.windows(2));
    pairs.map(|(h, e)| (e[0] / e[1]).ln() / (h[0] / h[1]).ln()).collect()
}

/// Numbers in two digits, for people.
pub fn list(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:.1e}")).collect::<Vec<_>>().join(" ")
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
