//! The shipped cases, `cases/*/case.toml`: each gives the number that its comments promise.
//!
//! They run with fewer panels than by themselves where the promise allows it, and with few nodes in the file for viewers:
//! half a minute together on two busy cores, about four times that otherwise.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Scratch, graintrap};

/// 4 pi eps0, F/m (CODATA 2018; ten digits are enough here).
const FOUR_PI_EPS0: f64 = 1.112_650_055_447_870_3e-10;

fn case(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name).join("case.toml").to_str().unwrap().to_owned()
}

/// Does a verb on a shipped case, with some keys set.
fn go(verb: &str, name: &str, scratch: &Scratch, set: &[&str], more: &[&str]) -> Value {
    let (case, out) = (case(name), scratch.at("out"));
    let mut args = vec![verb, &case, "--json", "-o", &out, "--set", "output.field_nodes=2000"];
    args.extend(set.iter().flat_map(|set| ["--set", set]));
    args.extend(more);
    graintrap(&args).done().json()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn length(value: &Value) -> f64 {
    value.as_array().unwrap().iter().map(|x| number(x).powi(2)).sum::<f64>().sqrt()
}

fn finals(run: &Value) -> &Vec<Value> {
    run["trace"]["final"].as_array().unwrap()
}

/// Every shipped case is tested here.
#[test]
fn golden_cases_are_all_here() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .flatten()
        .filter(|entry| entry.path().join("case.toml").exists())
        .map(|entry| entry.file_name().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    let here = ["grid_plate", "paul_trap", "ring_and_end_caps", "ring_and_plate", "sphere", "two_rings"];
    // What these give is held by tests/experiments.
    let experiments = [
        "annulus_end_caps",
        "annulus_plates",
        "cloud_plates",
        "crystal_ball",
        "crystal_chain",
        "dust_in_air",
        "mass_filter",
        "mathieu",
        "mathieu_corner",
        "penning",
        "penning_drag",
        "planar_toy",
        "plasma_cold",
        "plasma_hot",
        "ring_and_plate_no_null",
        "two_rings_held",
        "two_rings_lost",
        "two_rings_narrow",
        "two_rings_wide",
    ];
    let mut all = [&here[..], &experiments[..]].concat();
    all.sort_unstable();
    assert_eq!(names, all);
    for name in names {
        graintrap(&["check", &case(&name), "--quiet"]).done();
    }
}

#[test]
fn golden_sphere() {
    let scratch = Scratch::new();
    // As shipped, on its generating curve: the reported error is rounding's.
    let run = go("run", "sphere", &scratch, &[], &[]);
    let error = number(&run["error_estimate"]);
    assert!(error < 1e-9, "{error}");
    let capacitance = number(&run["capacitance_matrix_farad"][0][0]) / (FOUR_PI_EPS0 * 0.1) - 1.0;
    assert!(capacitance.abs() < error, "{capacitance} {error}");
    let end = &finals(&run)[0];
    assert_eq!((end["outcome"].as_str(), end["electrode"].as_str()), (Some("struck"), Some("sphere")));
    // E = Q V (1 - φ(3R)/V): what the table is asked for.
    let energy = number(&end["energy"]) / (1e-13 * 1e3 * 2.0 / 3.0) - 1.0;
    assert!(energy.abs() < 1e-3, "{energy}");
    // On a facet, off the sphere by no more than facets of this size are, half a panel's square over the radius.
    let depth = 1.0 - length(&end["position"]) / 0.1;
    assert!(depth.abs() < 5e-3, "{depth}");
}

#[test]
fn golden_two_rings() {
    let scratch = Scratch::new();
    let run = go("run", "two_rings", &scratch, &["field.panels=1500"], &[]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/composite.json");
    let reference: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let cases = reference["cases"].as_array().unwrap();
    let exact = &cases.iter().find(|case| case["id"] == "two_equal_tori_fig14").unwrap()["outputs"];
    let largest = FOUR_PI_EPS0 * number(&exact["c_matrix_over_4pi_eps0"][0][0]);
    let error = number(&run["error_estimate"]);
    for i in 0..2 {
        for j in 0..2 {
            let capacitance = number(&run["capacitance_matrix_farad"][i][j]);
            let apart = capacitance - FOUR_PI_EPS0 * number(&exact["c_matrix_over_4pi_eps0"][i][j]);
            // The reported error is against the largest entry, and an estimate.
            assert!(apart.abs() < error * largest, "{i} {j}: {apart} {error}");
        }
    }
    assert!(error < 1e-2, "{error}");
    assert_eq!(run["trace"]["outcomes"]["time_up"], 3);
    // Three equal charges at rest form a triangle where Q²/(4 pi eps0) / (√3 r²) = m w² r, w the slow frequency. Radially
    // q = -0.2: w = |q| W / (2 √2) but for a percent, W = 2 pi 2 Hz; r = 81 mm. Micromotion and the rest of the motion after
    // e^(-0.1 30) of it: 10 %.
    let w = 0.2 * std::f64::consts::TAU * 2.0 / 8.0_f64.sqrt();
    let r = (1e-26 / FOUR_PI_EPS0 / 3.0_f64.sqrt() / (1e-13 * w * w)).cbrt();
    for end in finals(&run) {
        assert_eq!(end["outcome"], "time_up");
        assert!((length(&end["position"]) / r - 1.0).abs() < 0.1, "{end} {r}");
        // In the plane across the axis, where the trap is weaker.
        assert!(number(&end["position"][0]).abs() < 0.02, "{end}");
    }
}

#[test]
fn golden_ring_and_plate() {
    let scratch = Scratch::new();
    let few = ["field.panels=1500"];
    let run = go("run", "ring_and_plate", &scratch, &few, &[]);
    let end = &finals(&run)[0];
    assert_eq!(end["outcome"], "left_region");
    // From 1 mm to 2.5 m is e^7.8; the first e-foldings start slowly, by ln 2 (cosh), the last go faster than linear.
    let foldings = 6.3 * number(&end["time"]);
    assert!(foldings > 7.0 && foldings < 9.5, "{foldings}");

    let points = scratch.file("points.csv", "x,y,z\n0.25,0,0\n0.24,0,0\n0.26,0,0\n");
    let probe = go("probe", "ring_and_plate", &scratch, &few, &["--at", &points]);
    let error = number(&probe["error_estimate"]);
    assert!(error < 5e-3, "{error}");
    // Two fields of 130 V/m cancel: what is left is within their errors.
    let field = |k: usize| number(&probe["points"][k]["field"][0]);
    assert!(length(&probe["points"][0]["field"]) < 130.0 * error, "{} {error}", probe["points"][0]["field"]);
    // E_x = -2 A2 V x with A2 = 0.394 /m² per volt of the ring: it points back on both sides, and off the axis away from it.
    let slope = (field(2) - field(1)) / 0.02;
    assert!((slope / -78.8 - 1.0).abs() < 0.05, "{slope}");
}

#[test]
fn golden_ring_and_end_caps() {
    let scratch = Scratch::new();
    let run = go("run", "ring_and_end_caps", &scratch, &["field.panels=1500"], &[]);
    assert_eq!(run["trace"]["outcomes"]["time_up"], 10);
    let radii: Vec<f64> = finals(&run).iter().map(|end| length(&end["position"])).collect();
    // The quadrupole of the comments, from the ring's unit potential at 0 and ±5 cm on the axis: A2 = (φ+ + φ- - 2 φ0) / 2 x².
    // 2 %: A4 x² adds 0.1 %, and 1500 panels err by 1 %.
    let points = scratch.file("points.csv", "x,y,z\n-0.05,0,0\n0,0,0\n0.05,0,0\n");
    let probe = go("probe", "ring_and_end_caps", &scratch, &["field.panels=1500"], &["--at", &points]);
    let ring = |k: usize| number(&probe["points"][k]["basis"]["ring"]);
    let a2 = (ring(0) + ring(2) - 2.0 * ring(1)) / (2.0 * 0.05 * 0.05);
    assert!((a2 / -0.730 - 1.0).abs() < 0.02, "{a2}");
    // They start in a ball of 0.2 m and end in a cloud a third as large, held apart by their charges.
    assert!(radii.iter().all(|r| *r < 0.1), "{radii:?}");
    assert!(radii.iter().filter(|r| **r > 0.03).count() >= 7, "{radii:?}");
}

#[test]
fn golden_paul_trap() {
    let scratch = Scratch::new();
    // 1400 panels already put the limit between the two voltages, 0.9 % below and 0.8 % above it.
    let few = ["field.panels=1500"];
    let stays = go("run", "paul_trap", &scratch, &few, &[]);
    assert_eq!(stays["trace"]["outcomes"]["time_up"], 1);
    // The cloud's size is that of its start, 28 µm, times what amplitudes near the limit do: far below r0 = 10 mm.
    assert!(length(&finals(&stays)[0]["position"]) < 1e-3, "{}", finals(&stays)[0]);
    let leaves = go("trace", "paul_trap", &scratch, &[few[0], "drive.main.amplitude=137.2 V"], &[]);
    assert_eq!(leaves["reused"], serde_json::json!(["solution", "table"]));
    let end = &finals(&leaves)[0];
    assert_eq!(end["outcome"], "struck");
    let struck = end["electrode"].as_str().unwrap();
    assert!(struck == "top" || struck == "bottom", "{struck}");
    // At the tip of a cap, z0 = 7.07 mm, less what the facets change.
    assert!((number(&end["position"][2]).abs() - 7.071e-3).abs() < 2e-5, "{end}");
}

#[test]
fn golden_grid_plate() {
    let scratch = Scratch::new();
    let run = go("run", "grid_plate", &scratch, &["field.panels=2500", "grains.1.count=20"], &[]);
    let outcomes = &run["trace"]["outcomes"];
    let struck = |name: &str| outcomes["struck"][name].as_u64().unwrap_or(0);
    assert_eq!(struck("disc") + struck("grid"), 20, "{outcomes}");
    // Holes are pi 3² / 10² = 28 % of the plate: 5.7 of twenty grains, give or take 2 of chance.
    assert!((1..=11).contains(&struck("disc")), "{outcomes}");

    // What comes around the edge of a plate without holes, solved as well; and what comes through the holes: delta of the endless
    // plate (grid_plate.json, hole_array.a=0.3: 0.019098 pitches) over the 20 mm to the disc, times the plate's own unit
    // potential. 5 %, since the plate ends two pitches and a half from the middle hole and its mesh is coarse: panels of 4000,
    // 7400 and 12000 give 0.01900, 0.01884 and 0.01878 V.
    let points = scratch.file("points.csv", "x,y,z\n0,0,0.01\n");
    let probe = go("probe", "grid_plate", &scratch, &["field.panels=2500"], &["--at", &points]);
    let unit = &probe["points"][0]["basis"];
    let text = fs::read_to_string(case("grid_plate")).unwrap();
    let solid: String = text
        .replace("\"grid_plate\"", "\"disc\"")
        .lines()
        .filter(|line| !["pitch ", "hole ", "open "].iter().any(|key| line.starts_with(key)))
        .map(|line| format!("{line}\n"))
        .collect();
    let solid = scratch.file("solid.toml", &solid);
    let (out, few) = (scratch.at("solid"), "field.panels=1500");
    let closed = graintrap(&["probe", &solid, "--json", "-o", &out, "--set", few, "--at", &points]).done().json();
    let closed = &closed["points"][0]["basis"];
    let expected = number(&closed["disc"]) + 0.190_98 / 20.0 * number(&closed["grid"]);
    assert!((number(&unit["disc"]) / expected - 1.0).abs() < 0.05, "{unit} {expected}");
}
