//! A case above a grounded plane, from its file to its grains.

use serde_json::Value;

use crate::harness::{Scratch, graintrap};

const CASE: &str = r#"
[[electrode]]
name   = "ball"
shape  = "sphere"
radius = "5 mm"
center = [0, 0, "20 mm"]
dc     = "100 V"

[field]
ground   = { center = [0, 0, 0], axis = "z" }
accuracy = 5e-3

[[grains]]
name   = "below"
mass   = "1e-12 kg"
charge = "1e-14 C"
place  = { kind = "points", points = [[0, 0, "10 mm"], ["10 mm", "3 mm", "12 mm"]] }

[trace]
duration = "1 s"

[output]
field_nodes = 2000
"#;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// Grains that a ball repels fall to the ground, and arrive with the energy that they had above it.
#[test]
fn cli_grains_strike_the_ground() {
    let scratch = Scratch::new();
    let (case, out) = (scratch.file("case.toml", CASE), scratch.at("out"));
    let run = graintrap(&["run", &case, "--json", "-o", &out]).done().json();
    assert_eq!(run["trace"]["outcomes"]["struck"], serde_json::json!({ "ground": 2 }), "{}", run["trace"]);
    // 4 π ε0 a sinh α Σ 1/sinh(n α), cosh α = 4.
    let alpha = 4.0_f64.acosh();
    let images: f64 = (1..100).map(|n| 1.0 / (f64::from(n) * alpha).sinh()).sum();
    let exact = 1.112_650_055_447_870_3e-10 * 5e-3 * alpha.sinh() * images;
    let error = number(&run["capacitance_matrix_farad"][0][0]) / exact - 1.0;
    assert!(error.abs() < number(&run["error_estimate"]), "{error}");

    let points = scratch.file("points.csv", "x,y,z\n0,0,0.01\n0.01,0.003,0.012\n0.3,0.1,0\n0.01,0,-0.001\n");
    let probe = graintrap(&["probe", &case, "--json", "-o", &out, "--at", &points]).done().json();
    let potential = |k: usize| number(&probe["points"][k]["potential"]);
    for (k, end) in run["trace"]["final"].as_array().unwrap().iter().enumerate() {
        assert_eq!((end["outcome"].as_str(), end["electrode"].as_str()), (Some("struck"), Some("ground")));
        // On the plane to the rounding of the crossing.
        assert!(number(&end["position"][2]).abs() < 1e-12, "{end}");
        // The table's field is the gradient of its potential, which is asked to 5e-4 of 100 V.
        let energy = number(&end["energy"]) / (1e-14 * potential(k));
        assert!((energy - 1.0).abs() < 2e-3, "grain {k}: {energy}");
    }
    assert_eq!((potential(2), potential(3)), (0.0, 0.0));
    let field = |k: usize, axis: usize| number(&probe["points"][k]["field"][axis]);
    assert!(field(2, 2) < 0.0 && field(2, 0).abs() < 1e-12 * field(2, 2).abs(), "{}", probe["points"][2]);
    assert_eq!(probe["points"][3]["inside"], "ground");
    assert_eq!((field(3, 0), field(3, 2)), (0.0, 0.0));
    // The ground belongs to the geometry.
    let change = ["--set", "field.ground.center=[0, 0, \"-1 mm\"]"];
    let again = graintrap(&["solve", &case, "--json", "-o", &out, change[0], change[1]]).done().json();
    assert_eq!(again["solution"], "solved");
}

/// A source has an image, with no electrode at all; and grains fall towards it.
#[test]
fn cli_a_source_above_the_ground_has_an_image() {
    let scratch = Scratch::new();
    let case = scratch.file(
        "case.toml",
        r#"
[[source]]
name   = "spot"
kind   = "point"
charge = "1 pC"
center = [0, 0, "1 cm"]

[field]
ground = {}

[[grains]]
mass   = "1e-12 kg"
charge = "-1e-15 C"
place  = { kind = "points", points = [["1 m", 0, "1 mm"]] }
speed  = { kind = "uniform", velocity = [0, 0, "-1 m/s"] }

[trace]
duration = "1 s"

[output]
field_nodes = 500
"#,
    );
    let points = scratch.file("points.csv", "0.02,0,0.03\n0.01,0.01,0\n0,0,-0.01\n");
    let out = scratch.at("out");
    let probe = graintrap(&["probe", &case, "--json", "-o", &out, "--at", &points]).done().json();
    let potential = |k: usize| number(&probe["points"][k]["potential"]);
    let (near, far) = (0.02_f64.hypot(0.02), 0.02_f64.hypot(0.04));
    let exact = 1e-12 / 1.112_650_055_447_87e-10 * (1.0 / near - 1.0 / far);
    assert!((potential(0) / exact - 1.0).abs() < 1e-9, "{} {exact}", potential(0));
    assert_eq!((potential(1), potential(2)), (0.0, 0.0));
    let run = graintrap(&["run", &case, "--json", "-o", &out]).done().json();
    assert_eq!(run["trace"]["outcomes"]["struck"], serde_json::json!({ "ground": 1 }), "{}", run["trace"]);
}

/// A grain falls onto the ground, drawn by nothing but its image: Kepler's radial fall, π/2 sqrt(2 m h³ / (k Q²)) long.
#[test]
fn cli_a_grain_falls_towards_its_image() {
    let scratch = Scratch::new();
    let case = scratch.file(
        "case.toml",
        r#"
[[source]]
name   = "nothing"
kind   = "point"
charge = "0 C"
center = ["1 m", 0, "1 m"]

[field]
ground = {}

[[grains]]
mass   = "1e-9 kg"
charge = "1e-12 C"
radius = "1 um"
place  = { kind = "points", points = [[0, 0, "1 cm"]] }

[forces]
image_charge = true

[trace]
duration = "3 s"

[output]
field_nodes = 500
"#,
    );
    let out = scratch.at("out");
    let run = graintrap(&["run", &case, "--json", "-o", &out]).done().json();
    let end = &run["trace"]["final"][0];
    assert_eq!((end["outcome"].as_str(), end["electrode"].as_str()), (Some("struck"), Some("ground")), "{end}");
    let exact = 0.5 * std::f64::consts::PI * (2.0 * 1e-9 * 1e-6 * 1.112_650_055_447_87e-10 / 1e-24_f64).sqrt();
    assert!((number(&end["time"]) / exact - 1.0).abs() < 1e-6, "{end} {exact}");
}
