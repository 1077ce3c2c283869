//! Studies: sweeps that solve once, go on after a kill, and are shared out.

use std::fs;
use std::path::Path;

use crate::harness::{Scratch, command, file, graintrap, killed_with, number, study, tiny};

/// The quick case with a sweep behind it.
fn swept(scratch: &Scratch, sweep: &str) -> String {
    let text = fs::read_to_string(tiny()).unwrap();
    scratch.file("swept.toml", &format!("{text}\n[sweep]\n{sweep}\n"))
}

/// Voltages and grains: every point has the same field.
const FLOWN: &str = "\"electrode.left.dc\" = { from = \"-2 V\", to = \"2 V\", steps = 5 }\n\
                     \"grains.1.charge\" = [\"1e-14 C\", \"2e-14 C\", \"3e-14 C\"]";

/// The tables and plots of a study; not what tells times.
fn same(one: &str, other: &str) {
    for name in ["study.csv", "study.parquet", "study.svg", "study.png"] {
        assert_eq!(file(one, name), file(other, name), "{name} of {one} and {other}");
    }
}

#[test]
fn cli_study_of_200_voltages_solves_once() {
    let scratch = Scratch::new();
    let sweep = "\"electrode.left.dc\" = { from = \"-9 V\", to = \"10 V\", steps = 20 }\n\
                 \"electrode.right.dc\" = { from = \"1 V\", to = \"1000 V\", steps = 10, scale = \"log\" }";
    let case = swept(&scratch, sweep);
    // Nothing flies: the whole study is weights on one solution.
    let text = fs::read_to_string(&case).unwrap();
    let (head, rest) = text.split_once("[[grains]]").unwrap();
    let case = scratch.file("still.toml", &format!("{head}\n[sweep]{}", rest.split_once("[sweep]").unwrap().1));
    let out = scratch.at("out");
    let json = study(&case, &out, &[]).done().json();
    assert_eq!((json["points"].as_u64(), json["failed"].as_u64()), (Some(200), Some(0)));
    assert_eq!((json["solved"].as_u64(), json["solutions_kept"].as_u64()), (Some(1), Some(0)));
    let rows = json["rows"].as_array().unwrap();
    // Charge is linear in the voltages, with the capacitances as factors.
    for row in rows {
        let volts = |electrode: &str| number(row, &format!("electrode.{electrode}.dc"));
        // The RF stands at its largest at the start.
        let left = volts("left") + 50.0;
        let expected =
            number(row, "capacitance.left.left") * left + number(row, "capacitance.left.right") * volts("right");
        // Rounding, against the larger of the two terms.
        let scale = number(row, "capacitance.left.left") * (left.abs() + volts("right"));
        assert!((number(row, "charge.left") - expected).abs() < 1e-12 * scale, "{row}");
    }
    // The last key varies fastest; ends stand as they were written.
    assert_eq!(number(&rows[1], "electrode.left.dc"), -9.0);
    assert!((number(&rows[1], "electrode.right.dc") - 1000_f64.powf(1.0 / 9.0)).abs() < 1e-12);
    assert_eq!((number(&rows[199], "electrode.left.dc"), number(&rows[199], "electrode.right.dc")), (10.0, 1000.0));
}

#[test]
fn cli_study_goes_on_after_a_kill_and_is_shared_out() {
    let scratch = Scratch::new();
    let case = swept(&scratch, FLOWN);
    let (whole, cut, parts) = (scratch.at("whole"), scratch.at("cut"), scratch.at("parts"));
    let json = study(&case, &whole, &["--threads", "1"]).done().json();
    assert_eq!(
        (json["points"].as_u64(), json["solved"].as_u64(), json["tabulated"].as_u64()),
        (Some(15), Some(1), Some(1))
    );
    assert!(json["rows"].as_array().unwrap().iter().all(|row| number(row, "grains") == 4.0));

    // Killed when some rows are kept.
    let journal = killed_with(4, &scratch, &case, &cut);
    assert!(!Path::new(&cut).join("study.csv").exists());
    // As a kill in the middle of a line would leave it.
    let text = fs::read(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 30]).unwrap();
    let json = study(&case, &cut, &["--threads", "2"]).done().json();
    let kept = json["rows_kept"].as_u64().unwrap();
    assert!((3..15).contains(&kept), "{kept} rows were kept");
    assert_eq!((json["solved"].as_u64(), json["solutions_kept"].as_u64()), (Some(0), Some(1)));
    same(&whole, &cut);

    // In two parts: one told by an argument, one as by Open MPI's launcher.
    study(&case, &parts, &["--shard", "1/2"]).done();
    let half = Path::new(&parts).join("shard-1-of-2");
    let refused = graintrap(&["study", &case, "-o", &parts, "--merge", half.to_str().unwrap()]);
    assert_eq!(refused.status, Some(1));
    assert!(
        refused.err.contains("7 of 15 points are in none of these folders: 2, 4, 6, 8, 10, ..."),
        "{}",
        refused.err
    );
    let mut rank = command(&scratch.0, &["study", &case, "-o", &parts]);
    let said = rank.env("OMPI_COMM_WORLD_RANK", "1").env("OMPI_COMM_WORLD_SIZE", "2").output().unwrap();
    let words = String::from_utf8(said.stderr).unwrap();
    assert!(said.status.success() && words.contains("part 2/2 of the study, as OMPI_COMM_WORLD_RANK says"), "{words}");
    let other = Path::new(&parts).join("shard-2-of-2");
    let merge = ["--merge", half.to_str().unwrap(), other.to_str().unwrap()];
    let json = study(&case, &parts, &merge).done().json();
    assert_eq!((json["points"].as_u64(), json["solved"].as_u64()), (Some(15), Some(0)));
    same(&whole, &parts);
}

#[test]
fn cli_study_of_geometries_keeps_going_where_a_point_fails() {
    let scratch = Scratch::new();
    // The third wire is thicker than its ring is wide; the last cuts the other ring.
    let sweep = "\"electrode.left.wire_radius\" = [\"1 mm\", \"0.5 mm\", \"11 mm\", \"1 mm\", \"9 mm\"]\n\
                 \"electrode.left.panels\" = [150, 150, 150, 200, 150]\nsampling = \"zip\"\n\
                 report = [\"capacitance\", \"still_flying\", \"depth_of_field\"]";
    let (case, out) = (swept(&scratch, sweep), scratch.at("out"));
    let said = study(&case, &out, &[]).done();
    let json = said.json();
    assert_eq!(
        (json["points"].as_u64(), json["failed"].as_u64(), json["solved"].as_u64()),
        (Some(5), Some(2), Some(3))
    );
    let rows = json["rows"].as_array().unwrap();
    let reason = |row: usize| rows[row]["reason"].as_str().unwrap();
    assert!(reason(2).starts_with("electrode.left.wire_radius: \"11 mm\" is not smaller"), "{}", reason(2));
    assert!(reason(4).contains("`right` touches or cuts `left`"), "{}", reason(4));
    // A thinner wire holds less charge.
    assert!(number(&rows[1], "capacitance.left.left") < number(&rows[0], "capacitance.left.left"));
    assert!(said.err.contains("`depth_of_field`, which no point has; there are panels"), "{}", said.err);
    assert!(rows[0].get("panels").is_none(), "only what was asked for");
    let csv = String::from_utf8(file(&out, "study.csv")).unwrap();
    assert_eq!(csv.lines().count(), 6);
}

#[test]
fn cli_study_tells_the_multipoles_of_a_quadrupole() {
    let scratch = Scratch::new();
    // V (r² - 2 z²) / r0² about (0, 0, 1 mm), V = 3 V: A2 = -2 V / r0² on the axis, whatever point is looked at; about a point h
    // higher A1 = -4 V h / r0² and A0 = -2 V h² / r0².
    let text = "[[source]]\nname = \"q\"\nkind = \"quadrupole\"\nr0 = \"10 mm\"\ndimensions = 3\ndc = \"3 V\"\n\
                rf = { amplitude = \"5 V\", frequency = \"60 Hz\", phase = \"180 deg\" }\ncenter = [0, 0, \"1 mm\"]\n\
                [study]\ncenter = [0, 0, \"3 mm\"]\nradius = \"2 mm\"\n[sweep]\n\"source.q.dc\" = [\"3 V\", \"6 V\"]\n";
    let case = scratch.file("quadrupole.toml", text);
    let json = study(&case, &scratch.at("out"), &[]).done().json();
    let rows = json["rows"].as_array().unwrap();
    let near = |name: &str, row: usize, exact: f64, scale: f64| {
        let got = number(&rows[row], name);
        // Rounding of the rule, against the largest term on the sphere.
        assert!((got - exact).abs() < 1e-11 * scale, "{name}: {got} instead of {exact}");
    };
    let a2 = number(&rows[0], "A2_static");
    near("A2_static", 1, 2.0 * a2, a2.abs());
    near("A2_rf", 0, -a2 * 5.0 / 3.0, a2.abs());
    near("A1_static", 0, 2.0 * a2 * 2e-3, a2.abs());
    near("A4_static", 0, 0.0, a2.abs() / 4e-6);
    // The ends of the trap at r0 and z0 = r0/√2: φ = ± V/2 there makes A2 = -V / r0² of a 3D quadrupole driven by V between
    // ring and caps; of the potential V (r² - 2 z²)/(r0² + 2 z0²) it is -2 V / (2 r0²).
    near("A2_static", 0, -3.0 / 1e-4, 3e4);
}

#[test]
fn cli_study_refuses_what_cannot_be() {
    let scratch = Scratch::new();
    let said = graintrap(&["study", &tiny(), "-o", &scratch.at("out")]);
    assert_eq!(said.status, Some(2));
    assert!(said.err.contains("the case varies nothing") && !Path::new(&scratch.at("out")).exists(), "{}", said.err);
    // Wrong at every point: the case is wrong.
    let case = swept(&scratch, "\"electrode.left.wire_radius\" = [\"20 mm\", \"30 mm\"]");
    let said = graintrap(&["study", &case, "-o", &scratch.at("out")]);
    assert_eq!(said.status, Some(2), "{}", said.err);
    assert!(said.err.contains("wire_radius") && !Path::new(&scratch.at("out")).exists(), "{}", said.err);
    let said = graintrap(&["study", &case, "--shard", "3/2"]);
    assert!(said.status == Some(2) && said.err.contains("i from 1 to n"), "{}", said.err);
}
