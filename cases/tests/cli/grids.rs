//! Grids in studies: against tests/reference/grid_plate.json, and against the other commands.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Scratch, file, graintrap, killed_with, number, study, tiny};

#[test]
fn cli_study_finds_the_penetration_length_and_the_shadow_of_a_grid() {
    let scratch = Scratch::new();
    // A grid of 9 x 9 holes half way between two plates, with grains that feel nothing falling straight onto its middle.
    let text = r#"
[[electrode]]
name  = "grid"
shape = "grid_plate"
size  = [9, 9]
pitch = 1
hole  = "square"
open  = 0.8

[[electrode]]
name   = "top"
shape  = "plate"
size   = [9, 9]
center = [0, 0, 2]
dc     = 1

[[electrode]]
name   = "bottom"
shape  = "plate"
size   = [9, 9]
center = [0, 0, -2]

[field]
accuracy = 5e-3

[table]
min      = [-2.5, -2.5, -1]
max      = [2.5, 2.5, 1]
spacing  = 0.5
accuracy = 0.5

[[grains]]
count  = 100
mass   = "1 kg"
charge = "1e-30 C"
place  = { kind = "box", min = [-2.5, -2.5, 0.5], max = [2.5, 2.5, 0.6] }
speed  = { kind = "uniform", velocity = [0, 0, -1] }

[trace]
duration = 1.5

[study]
kind   = "grid_transparency"
center = [0, 0, 1]
radius = 0.5
angles = ["0 deg", "45 deg"]
cone   = "20 deg"

[sweep]
sampling = "zip"
"electrode.grid.hole" = ["square", "round"]
"electrode.grid.open" = [0.8, 0.6]
"#;
    let case = scratch.file("sandwich.toml", text);
    let json = study(&case, &scratch.at("out"), &[]).done().json();
    let rows = json["rows"].as_array().unwrap();
    // tests/reference/grid_plate.json: square_mesh_flat.b=0.2 and hole_array.a=0.3, for endless plates.
    for (row, (delta, open)) in
        rows.iter().zip([(0.074_857_631_1, 0.64), (0.019_097_969_99, std::f64::consts::PI * 0.09)])
    {
        let (got, error) = (number(row, "delta"), number(row, "delta_error"));
        println!("delta {got:.6} of {delta:.6}, error told {error:.1e}");
        assert!((got / delta - 1.0).abs() < 1e-2, "delta {got} instead of {delta}");
        assert!((number(row, "open_fraction") - open).abs() < 1e-12);
        // Sheets: as open from everywhere, as rays tell it, some 1/√N of a fifth of the cell.
        for name in ["light.0deg", "light.45deg", "light.cone"] {
            assert!((number(row, name) - open).abs() < 5e-3, "{name} of {row}");
        }
        // Grains that feel nothing see what light sees: within the interval of 95 %, a little widened, of 100 of them.
        let passed = number(row, "grains_passed");
        assert!((passed - open).abs() < 1.5 * number(row, "grains_passed_error"), "{passed} of {open} passed");
        assert!((passed + number(row, "grains_caught") - 1.0).abs() < 1e-12, "none turns back");
        assert!(number(row, "grains_passed_low") < passed && passed < number(row, "grains_passed_high"));
    }
    // Smaller holes, darker and nearer to the plate: both are on the front.
    assert!(number(&rows[0], "field_deviation_max") > number(&rows[1], "field_deviation_max"));
    assert_eq!(json["front"]["front"], serde_json::json!([2, 1]));
    assert!(Path::new(&scratch.at("out")).join("front.png").is_file());
    // Every strike has its row, on a bar of the cell whose corner is the middle of a hole.
    let csv = String::from_utf8(file(&scratch.at("out"), "strikes.csv")).unwrap();
    let caught: f64 = rows.iter().map(|row| 100.0 * number(row, "grains_caught")).sum();
    assert_eq!(csv.lines().count(), 1 + caught.round() as usize);
    for line in csv.lines().filter(|line| line.starts_with("1,")) {
        let cell: Vec<f64> = line.split(',').skip(6).take(2).map(|x| x.parse().unwrap()).collect();
        assert!(cell.iter().any(|x| (x - 0.5).abs() < 0.1 + 1e-9), "{line}");
    }
    // Rows and strikes are joined from the folder of the study without any work.
    let joined = scratch.at("joined");
    let again = study(&case, &joined, &["--merge", &scratch.at("out")]).done().json();
    assert_eq!(again["solved"].as_u64(), Some(0));
    for name in ["study.csv", "front.png", "strikes.csv", "strikes.png"] {
        assert_eq!(file(&scratch.at("out"), name), file(&joined, name), "{name}");
    }
    // A case without a grid.
    let text = fs::read_to_string(tiny()).unwrap() + "[sweep]\n\"electrode.left.dc\" = [\"1 V\", \"2 V\"]\n";
    let case = scratch.file("none.toml", &text);
    let said = graintrap(&["study", &case, "--set", "study.kind=grid_transparency", "-o", &scratch.at("no")]);
    assert!(said.err.contains("study.kind: the case has no grid to study"), "{}", said.err);
}

#[test]
fn cli_study_of_strikes_goes_on_after_a_kill() {
    let scratch = Scratch::new();
    // Grains that feel nothing fall onto two by two whole cells of crossed wires, and see of them what light does.
    let text = r#"
[[electrode]]
name        = "grid"
shape       = "grid_plate"
size        = [3, 3]
pitch       = 1
wires       = "crossed"
wire_radius = 0.2

[[electrode]]
name   = "top"
shape  = "plate"
size   = [3, 3]
center = [0, 0, 2]
dc     = 1

[field]
accuracy = 5e-2

[table]
min      = [-1, -1, -1]
max      = [1, 1, 1]
spacing  = 0.5
accuracy = 0.5

[[grains]]
count  = 30
mass   = "1 kg"
charge = "1e-30 C"
place  = { kind = "box", min = [-1, -1, 0.6], max = [1, 1, 0.7] }
speed  = { kind = "uniform", velocity = [0, 0, -1] }

[trace]
duration = 1.2

[study]
kind   = "grid_transparency"
center = [0, 0, 1.2]
radius = 0.3
lines  = 1
rays   = 100

[sweep]
"grains.1.count" = [30, 35, 40]
"#;
    let case = scratch.file("crossed.toml", text);
    let (whole, cut) = (scratch.at("whole"), scratch.at("cut"));
    let json = study(&case, &whole, &["--threads", "1"]).done().json();
    for row in json["rows"].as_array().unwrap() {
        let (passed, error) = (number(row, "grains_passed"), number(row, "grains_passed_error"));
        // (1 - 0.4)² of the cell is open; the interval of 95 %, a little widened.
        assert!((number(row, "open_fraction") - 0.36).abs() < 1e-12);
        assert!((passed - 0.36).abs() < 1.5 * error, "{passed} ± {error} passed");
        assert!((passed + number(row, "grains_caught") - 1.0).abs() < 1e-12, "none turns back");
    }
    // Killed with two rows of three, the second as a kill while it is written would leave it: its strikes are kept, the row is not.
    let journal = killed_with(2, &scratch, &case, &cut);
    let text = fs::read(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 30]).unwrap();
    let json = study(&case, &cut, &["--threads", "2"]).done().json();
    assert_eq!(json["rows_kept"].as_u64(), Some(1));
    for name in ["study.csv", "study.parquet", "front.svg", "strikes.csv", "strikes.svg"] {
        assert_eq!(file(&whole, name), file(&cut, name), "{name}");
    }
}

/// Parallel wires, 7 x 7 pitches, half way between two plates; no grains.
const WIRES: &str = r#"
[[electrode]]
name        = "grid"
shape       = "grid_plate"
size        = [7, 7]
pitch       = 1
wires       = "parallel"
wire_radius = 0.1

[[electrode]]
name   = "top"
shape  = "plate"
size   = [9, 9]
center = [0, 0, 2]
dc     = 1

[[electrode]]
name   = "bottom"
shape  = "plate"
size   = [9, 9]
center = [0, 0, -2]
dc     = -1

[field]
accuracy = 1e-2

[table]
min = [-1.5, -1.5, -1.5]
max = [1.5, 1.5, 1.5]

[study]
kind   = "grid_transparency"
center = [0, 0, 1]
radius = 0.5
rays   = 100
"#;

#[test]
fn cli_study_follows_lines_through_wires() {
    let scratch = Scratch::new();
    // One solution for all voltages of each radius.
    let text = "lines = 300\n[sweep]\nsampling = \"zip\"\n\"electrode.grid.wire_radius\" = [0.1, 0.1, 0.1, 0.05]\n\
                \"electrode.bottom.dc\" = [-1, -3, -4.6, -1]\n";
    let (case, out) = (scratch.file("wires.toml", &format!("{WIRES}{text}")), scratch.at("out"));
    let json = study(&case, &out, &[]).done().json();
    assert_eq!((json["solved"].as_u64(), json["failed"].as_u64()), (Some(3), Some(0)));
    let rows = json["rows"].as_array().unwrap();
    // Equal fields on both sides: so many lines end on endless wires (potential theory of the lattice). Even points miss each of two
    // edges by up to 1/300.
    for (row, share) in [(&rows[0], 0.387_14), (&rows[3], 0.198_35)] {
        for side in ["above", "below"] {
            let caught = number(row, &format!("lines_caught.{side}"));
            assert!((caught - share).abs() < 2.0 / 300.0, "{side}: {caught} instead of {share}");
            assert!((caught + number(row, &format!("lines_passed.{side}")) - 1.0).abs() < 1e-12);
        }
    }
    // All lines of the weaker side come through from a ratio of 3.66602 on.
    for row in &rows[1..3] {
        let ratio = number(row, "field_below") / number(row, "field_above");
        let caught = number(row, "lines_caught.above");
        println!("ratio {ratio:.4}: {caught} caught");
        assert!((ratio - 3.666).abs() > 0.1 && (caught == 0.0) == (ratio > 3.666), "{ratio}: {caught}");
        // As many lines pass from below as above has.
        let passed = number(row, "lines_passed.below");
        assert!((passed - (1.0 - caught) / ratio).abs() < 0.01, "{passed} of 1/{ratio}");
    }
    // Wires of tests/reference/grid_plate.json, r/d = 0.1, to 1 %.
    let delta = number(&rows[0], "delta");
    assert!((delta / 0.073_874_505 - 1.0).abs() < 1e-2, "{delta}");
    // The ripple of the field of charged wires, 2 e^(-2πz/d) of half the jump, is 1 % of it some 0.8 pitches away.
    let depth = number(&rows[0], "ripple_above");
    assert!((0.3..1.0).contains(&depth), "{depth}");

    // That ratio itself, and the one of thinner wires: where the field at the top of a wire vanishes. It is linear in the voltages, as are
    // the fields far away.
    let text = "[sweep]\nsampling = \"zip\"\n\"electrode.grid.wire_radius\" = [0.1, 0.1, 0.05, 0.05]\n\
                \"electrode.bottom.dc\" = [-1, -3, -1, -3]\n";
    let (case, cache) = (scratch.file("far.toml", &format!("{WIRES}{text}")), format!("{out}/cache"));
    let json = study(&case, &scratch.at("far"), &["--cache", &cache]).done().json();
    let rows = json["rows"].as_array().unwrap();
    for (rows, ratio) in [(&rows[..2], 3.666_02), (&rows[2..], 1.884_23)] {
        let radius = number(&rows[0], "electrode.grid.wire_radius");
        // A thousandth of the radius above it, where the field is that of the surface to as much.
        let points = scratch.file("top.csv", &format!("x,y,z\n0,0,{}\n", 1.001 * radius));
        let top = |row: &Value| {
            let sets = ["grid.wire_radius", "bottom.dc"]
                .map(|key| format!("electrode.{key}={}", row[format!("electrode.{key}")]));
            let (at, sets) = (scratch.at("probe"), ["--set", &sets[0], "--set", &sets[1]]);
            let probe = ["probe", &case, "--at", &points, "--cache", &cache, "-o", &at, "--json"];
            graintrap(&[&probe[..], &sets[..]].concat()).done().json()["points"][0]["field"][2].as_f64().unwrap()
        };
        let (one, other) = (top(&rows[0]), top(&rows[1]));
        let part = one / (one - other);
        let far = |name: &str| number(&rows[0], name) * (1.0 - part) + number(&rows[1], name) * part;
        let seen = far("field_below") / far("field_above");
        println!("r/d = {radius}: all lines pass from a ratio of {seen:.4} on, {ratio} for endless wires");
        assert!((seen / ratio - 1.0).abs() < 1e-2, "{seen} instead of {ratio}");
    }
}

#[test]
fn cli_study_of_slots_finds_the_penetration_length_of_flat_strips() {
    let scratch = Scratch::new();
    let text = WIRES.replace("wires       = \"parallel\"\nwire_radius = 0.1", "hole = \"slot\"\nopen = 0.9");
    let case = scratch.file("slots.toml", &format!("{text}[sweep]\n\"electrode.grid.open\" = [0.95, 0.8, 0.5]\n"));
    let json = study(&case, &scratch.at("out"), &[]).done().json();
    for row in json["rows"].as_array().unwrap() {
        // Strips of width b: δ = -(d/2π) ln sin(πb/2d), τ = 0 (tests/reference/grid_plate.json, strips.b).
        let open = number(row, "electrode.grid.open");
        let delta = -(std::f64::consts::FRAC_PI_2 * (1.0 - open)).sin().ln() / std::f64::consts::TAU;
        println!("open {open}: delta {:.5} of {delta:.5}, tau {:.1e}", number(row, "delta"), number(row, "tau"));
        assert!((number(row, "delta") / delta - 1.0).abs() < 1e-2, "{} instead of {delta}", number(row, "delta"));
        assert!(number(row, "tau").abs() < 1e-2 * delta, "{}", number(row, "tau"));
        assert!((number(row, "open_fraction") - open).abs() < 1e-12);
    }
}

#[test]
fn cli_probe_finds_the_field_of_a_single_hole() {
    let scratch = Scratch::new();
    // Half way between wide discs 100 radii apart, of which the lower one is earthed as the plane is: E1 = 1, E2 = 0.
    let disc = |name: &str, z: i32, rest: &str| {
        format!("[[electrode]]\nname = \"{name}\"\nshape = \"disc\"\nradius = 400\ncenter = [0, 0, {z}]\n{rest}\n")
    };
    let discs = [disc("plane", 0, "hole_radius = 1"), disc("above", 50, "dc = 50"), disc("below", -50, "")].concat();
    let field = "[field]\naccuracy = 1e-6\n[table]\nmin = [-2.5, -2.5, -2.5]\nmax = [2.5, 2.5, 2.5]\n";
    let case = scratch.file("hole.toml", &format!("{discs}{field}"));
    let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/grid_plate.json");
    let reference: Value = serde_json::from_slice(&fs::read(reference).unwrap()).unwrap();
    let hole = reference["cases"].as_array().unwrap().iter().find(|case| case["id"] == "single_hole.a=1").unwrap();
    let rows = hole["inputs"]["points_rho_z"].as_array().unwrap().iter();
    let rows: String = rows.map(|p| format!("{},0,{}\n", p[0], p[1])).collect();
    let points = scratch.file("points.csv", &format!("x,y,z\n{rows}"));
    let said = graintrap(&["probe", &case, "--at", &points, "-o", &scratch.at("out"), "--json"]).done().json();
    let exact = hole["outputs"]["phi"].as_array().unwrap().iter();
    for (point, exact) in said["points"].as_array().unwrap().iter().zip(exact) {
        let (got, exact) = (number(point, "potential"), exact.as_f64().unwrap());
        // The field of the hole falls off with 1/r³, and images of it stand 100 away; and 1e-6 of the field over a radius.
        assert!((got - exact).abs() < 1e-5, "{got} instead of {exact} at {}", point["position"]);
    }
}

#[test]
fn cli_study_shifts_are_those_of_two_analyses() {
    let scratch = Scratch::new();
    // A ring between two round plates of two bars each; bars are wires, so that the solid trap is round and solved in no time.
    let plate = |name: &str, z: i32, shape: &str| {
        format!("[[electrode]]\nname = \"{name}\"\nradius = \"24 mm\"\ncenter = [0, 0, \"{z} mm\"]\n{shape}\n")
    };
    let case = |shape: &str| {
        let ring = "[[electrode]]\nname = \"ring\"\nshape = \"ring\"\nradius = \"20 mm\"\nwire_radius = \"2 mm\"\ndc = \"1 V\"\n\
                    rf = { amplitude = \"300 V\", frequency = \"60 Hz\" }\n";
        let rest = "[field]\naccuracy = 3e-2\n[table]\naccuracy = 1e-2\n[[grains]]\ncount = 4\nmass = \"1e-13 kg\"\n\
                    charge = \"3e-15 C\"\nradius = \"2 um\"\nplace = { kind = \"ball\", radius = \"2 mm\" }\n[trace]\n\
                    duration = \"1 ms\"\n[analysis]\ncenter = [0, 0, 0]\naxis = \"z\"\nradius = \"5 mm\"\nnodes = 500\n\
                    min = [-0.015, -0.015, -0.015]\nmax = [0.015, 0.015, 0.015]\n";
        format!("{ring}{}{}{rest}", plate("upper", 14, shape), plate("lower", -14, shape))
    };
    let grid = case("shape = \"grid_plate\"\npitch = \"16 mm\"\nwires = \"parallel\"\nwire_radius = \"2 mm\"");
    let analysed = |name: &str, text: &str| {
        let case = scratch.file(&format!("{name}.toml"), text);
        graintrap(&["analyse", &case, "--json", "-o", &scratch.at(name)]).done().json()
    };
    let (with, without) = (analysed("grid", &grid), analysed("solid", &case("shape = \"disc\"")));
    let text = "[study]\nkind = \"grid_transparency\"\ncenter = [0, 0, 0]\nradius = \"5 mm\"\nrays = 1\nlines = 1\n\
                [sweep]\n\"electrode.ring.dc\" = [\"1 V\"]\n";
    let study = study(&scratch.file("study.toml", &format!("{grid}{text}")), &scratch.at("study"), &[]).done().json();
    let row = &study["rows"][0];
    // Along the axis with the largest q.
    let parameter = |of: &Value, name: &str| of["mathieu"][name][0].as_f64().unwrap();
    let depth = |of: &Value| number(&of["depth_ev"], "value");
    let (q, q0) = (parameter(&with, "q").abs(), parameter(&without, "q").abs());
    let (a, a0) = (parameter(&with, "a"), parameter(&without, "a"));
    // Multipoles of the RF, which is on the ring alone.
    let multipole = |of: &Value, l: usize| {
        let ring = of["multipoles"]["electrodes"].as_array().unwrap().iter().find(|e| e["name"] == "ring").unwrap();
        300.0 * ring["A"][l].as_f64().unwrap()
    };
    let change = |l: usize| multipole(&with, l) - multipole(&without, l);
    let quadrupole = multipole(&without, 2).abs();
    for (name, expected, by) in [
        // The study flies in a table and looks for the well there, too: 1e-2 was asked of it, and a hundredth of that comes out in the middle.
        ("q", q, 1e-3 * q),
        ("q_shift", q / q0 - 1.0, 1e-3),
        ("a", a, 1e-3 * a.abs()),
        ("a_shift", a - a0, 1e-3 * a.abs()),
        // Both search for the pass between nodes of their own.
        ("depth", depth(&with), 1e-3 * depth(&with)),
        ("depth_shift", depth(&with) / depth(&without) - 1.0, 5e-3),
        // Told of the same sphere, by sums over other points.
        ("A0_shift", change(0), 5e-3),
        ("A2_shift", change(2) / multipole(&without, 2), 2e-4),
        ("A4_shift", change(4) * 0.005_f64.powi(2) / quadrupole, 2e-4),
    ] {
        let got = number(row, name);
        println!("{name}: {got:.7} in the study, {expected:.7} by two analyses");
        assert!((got - expected).abs() <= by, "{name}: {got} instead of {expected}");
        // All are far from nothing, so that a sign or a factor would be seen.
        assert!(expected.abs() > 3.0 * by, "{name}: {expected}");
    }
}
