//! The keys that other programs rely on, and what goes where: objects to standard output, words to standard error.

use std::path::Path;

use serde_json::Value;

use crate::common::folder;
use crate::harness::{Said, Scratch, contents, graintrap, is_whole, tiny};

/// Runs a verb on the quick case with `--json`; gives the object, alone on one line of standard output.
fn object(verb: &str, out: &str, more: &[&str]) -> Value {
    let tiny = tiny();
    let mut args = vec![verb, tiny.as_str(), "--json", "-o", out];
    args.extend(more);
    let said = graintrap(&args).done();
    assert!(said.out.ends_with("}\n") && said.out.matches('\n').count() == 1, "{said:?}");
    assert_plain(&said);
    let object = said.json();
    assert!(object.is_object());
    object
}

/// Nothing for terminals where there is none: no escape codes, no bars drawn over each other.
fn assert_plain(said: &Said) {
    assert!(!said.err.contains(['\x1b', '\r']) && !said.out.contains(['\x1b', '\r']), "{said:?}");
}

fn numbers(value: &Value, length: usize) {
    let list = value.as_array().unwrap_or_else(|| panic!("no list: {value}"));
    assert!(list.len() == length && list.iter().all(Value::is_number), "{value}");
}

fn names(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

fn solve_keys(object: &Value) {
    assert_eq!(names(&object["electrodes"]), ["left", "right"]);
    let matrix = object["capacitance_matrix_farad"].as_array().unwrap();
    assert_eq!(matrix.len(), 2);
    for row in matrix {
        numbers(row, 2);
    }
    // Maxwell's form: symmetric to the last bit, for both halves are written from one.
    assert_eq!(matrix[0][1], matrix[1][0]);
    let at = |i: usize, j: usize| matrix[i][j].as_f64().unwrap();
    assert!(at(0, 0) > 0.0 && at(0, 1) < 0.0 && at(0, 0) + at(0, 1) > 0.0, "{matrix:?}");
    // The rings are mirror images: equal but for the rounding of their meshes.
    assert!((at(0, 0) / at(1, 1) - 1.0).abs() < 1e-12, "{matrix:?}");
    assert!(object["panels"].as_u64().unwrap() > 100 && object["unknowns"].as_u64().unwrap() > 100);
    assert_eq!((object["solver"].as_str(), object["elements"].as_str()), (Some("dense"), Some("galerkin")));
    assert!(object["solver_reason"].as_str().unwrap().contains("how many panels"));
    let error = object["error_estimate"].as_f64().unwrap();
    assert!(error > 0.0 && error < 0.1, "{error}");
    assert!(object["seconds"]["mesh"].is_f64() && object["seconds"]["solve"].as_f64().unwrap() > 0.0);
    assert!(object["peak_memory_bytes"].is_u64());
}

fn table_keys(object: &Value) {
    assert!(object["table"]["nodes"].as_u64().unwrap() > 100);
    assert!(object["table"]["bytes"].as_u64().unwrap() > 1000);
    assert!(object["table"]["error_estimate"].as_f64().unwrap() < 1e-2, "{}", object["table"]);
    assert!(object["seconds"]["table"].as_f64().unwrap() > 0.0 && object["seconds"]["write"].is_f64());
}

/// Every file that is named exists and is whole, and no file stands in the folder that is not named or said to belong.
fn files(object: &Value, out: &str, expected: &[&str]) {
    let listed = names(&object["files"]);
    let found = contents(Path::new(out));
    for name in expected {
        assert!(listed.contains(name), "{name} is not in {listed:?}");
    }
    for name in &listed {
        assert!(is_whole(name, found.get(*name).unwrap_or_else(|| panic!("there is no {name}"))), "{name}");
    }
    for name in found.keys() {
        let belongs = name.starts_with("grains/grains_") || name.starts_with("cache/");
        assert!(belongs || listed.contains(&name.as_str()), "{name} is not in {listed:?}");
    }
}

#[test]
fn cli_json_of_check_and_mesh() {
    let scratch = Scratch::new();
    let check = object("check", &scratch.at("out"), &[]);
    assert_eq!(names(&check["electrodes"]), ["left", "right"]);
    assert_eq!((check["grains"].as_u64(), check["title"].as_str()), (Some(4), Some("Two small rings")));
    assert!(check["warnings"].as_array().unwrap().is_empty());
    assert!(!Path::new(&scratch.at("out")).exists(), "check wrote");
    let mesh = object("mesh", &scratch.at("out"), &[]);
    let electrodes = mesh["mesh"]["electrodes"].as_array().unwrap();
    assert_eq!(electrodes.len(), 2);
    for electrode in electrodes {
        // A torus: 4 pi² R a, but for what coarse polygons around it and along it change; closed, its normals outwards.
        let area = electrode["area"].as_f64().unwrap() / (4.0 * std::f64::consts::PI.powi(2) * 1e-2 * 2.5e-3);
        assert!((area - 1.0).abs() < 0.1, "{area}");
        assert_eq!((electrode["open_edges"].as_u64(), electrode["bad_edges"].as_u64()), (Some(0), Some(0)));
        assert_eq!(electrode["outward"], true);
        assert!(electrode["volume"].as_f64().unwrap() > 0.0);
    }
    files(&mesh, &scratch.at("out"), &["electrodes.vtu"]);
}

#[test]
fn cli_json_of_solve_table_and_probe() {
    let scratch = Scratch::new();
    let solve = object("solve", &scratch.at("solve"), &[]);
    solve_keys(&solve);
    assert!(solve.get("table").is_none());
    files(&solve, &scratch.at("solve"), &["electrodes.vtu", "summary.json"]);
    let table = object("table", &scratch.at("table"), &[]);
    solve_keys(&table);
    table_keys(&table);
    files(&table, &scratch.at("table"), &["electrodes.vtu", "field.vti", "summary.json"]);

    let points = folder("run").join("points.csv");
    let at = ["--at", points.to_str().unwrap()];
    let exact = object("probe", &scratch.at("solve"), &at);
    let tabulated = object("probe", &scratch.at("table"), &[at[0], at[1], "--table"]);
    let asked = [[0.0, 0.0, 0.0], [0.001, 0.002, -0.001], [-0.005, 0.01, 0.0]];
    for probe in [&exact, &tabulated] {
        let list = probe["points"].as_array().unwrap();
        assert_eq!(list.len(), 3);
        for (point, asked) in list.iter().zip(asked) {
            assert_eq!(point["position"], serde_json::json!(asked));
            numbers(&point["field"], 3);
            let unit = |name: &str| point["basis"][name].as_f64().unwrap();
            // At the start the left ring is at 2 V + 50 V, the right one at -1 V. Sums of the same numbers: round-off.
            let sum = 52.0 * unit("left") - unit("right");
            let potential = point["potential"].as_f64().unwrap();
            assert!((potential - sum).abs() < 1e-10 * potential.abs().max(1.0), "{potential} {sum}");
        }
        // Points on a centre of a wire are inside the conductor, at its voltage: table or not, the error is the mesh's.
        assert_eq!(list[2]["inside"], "left");
    }
    for k in 0..2 {
        let potential = |probe: &Value| probe["points"][k]["potential"].as_f64().unwrap();
        // The table was asked for 1e-2 V per V.
        assert!((potential(&exact) - potential(&tabulated)).abs() < 1e-2 * 52.0);
    }
    // A quarter of a period later the RF voltage is nil.
    let later = object("probe", &scratch.at("solve"), &[at[0], at[1], "--time", "4.16666666666667 ms"]);
    let first = &later["points"][0];
    let dc = 2.0 * first["basis"]["left"].as_f64().unwrap() - first["basis"]["right"].as_f64().unwrap();
    // 14 digits of the time leave some 1e-13 of 50 V.
    assert!((first["potential"].as_f64().unwrap() - dc).abs() < 1e-10);
    let csv = String::from_utf8(contents(Path::new(&scratch.at("solve")))["probe.csv"].clone()).unwrap();
    assert_eq!(csv.lines().count(), 4, "{csv}");
}

#[test]
fn cli_json_of_run() {
    let scratch = Scratch::new();
    let out = scratch.at("out");
    let run = object("run", &out, &[]);
    solve_keys(&run);
    table_keys(&run);
    let trace = &run["trace"];
    assert_eq!(trace["grains"], 4);
    assert!(trace["steps"].as_u64().unwrap() > 10);
    let outcomes = &trace["outcomes"];
    let struck: u64 = outcomes["struck"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(outcomes["time_up"].as_u64().unwrap() + struck + outcomes["left_region"].as_u64().unwrap(), 4);
    let finals = trace["final"].as_array().unwrap();
    assert_eq!(finals.len(), 4);
    for end in finals {
        numbers(&end["position"], 3);
        numbers(&end["velocity"], 3);
        assert_eq!((end["outcome"].as_str(), end["time"].as_f64()), (Some("time_up"), Some(0.05)));
    }
    for stage in ["mesh", "solve", "table", "trace", "write"] {
        assert!(run["seconds"][stage].is_f64(), "{stage}");
    }
    assert!(run["warnings"].as_array().unwrap().is_empty(), "{}", run["warnings"]);
    let expected = ["electrodes.vtu", "field.vti", "trajectories.vtp", "trajectories.vtu", "trajectories.csv"];
    files(&run, &out, &expected);
    files(&run, &out, &["grains.pvd", "summary.json", "potential.svg", "potential.png"]);
    let found = contents(Path::new(&out));
    // 50 ms every millisecond, both ends: 51 samples of each of four grains below one line of names.
    assert_eq!(String::from_utf8_lossy(&found["trajectories.csv"]).lines().count(), 1 + 4 * 51);
    assert_eq!(found.keys().filter(|name| name.starts_with("grains/")).count(), 51);
    let kept: Value = serde_json::from_slice(&found["summary.json"]).unwrap();
    assert_eq!(kept["trace"], run["trace"]);
    assert_eq!(kept["files"], run["files"]);
}

/// Final states are listed for up to a thousand grains.
#[test]
fn cli_json_of_many_grains() {
    let scratch = Scratch::new();
    let case =
        scratch.file("case.toml", &std::fs::read_to_string(tiny()).unwrap().replace("count  = 4", "count  = 1001"));
    let short = ["--set", "trace.duration=1 us", "--set", "output.every=1 us", "--set", "forces.coulomb=false"];
    let mut args = vec!["run", &case, "--json", "-o"];
    let out = scratch.at("out");
    args.push(&out);
    args.extend(short);
    let run = graintrap(&args).done().json();
    assert_eq!((run["trace"]["grains"].as_u64(), run["trace"].get("final")), (Some(1001), None));
    assert_eq!(run["trace"]["outcomes"]["time_up"], 1001);
}

#[test]
fn cli_quiet_prints_nothing() {
    let scratch = Scratch::new();
    let (out, points) = (scratch.at("out"), folder("run").join("points.csv"));
    for verb in ["check", "mesh", "solve", "table", "run", "trace", "probe"] {
        let tiny = tiny();
        let mut args = vec![verb, &tiny, "--quiet", "-o", &out];
        if verb == "probe" {
            args.extend(["--at", points.to_str().unwrap()]);
        }
        let said = graintrap(&args).done();
        assert_eq!((said.out.as_str(), said.err.as_str()), ("", ""), "{verb}");
    }
    // With words, no escape codes into files and pipes.
    for verb in ["check", "run"] {
        let said = graintrap(&[verb, &tiny(), "-o", &out]).done();
        assert_plain(&said);
        assert!(said.out.contains("left, right") && said.err.is_empty(), "{said:?}");
    }
}
