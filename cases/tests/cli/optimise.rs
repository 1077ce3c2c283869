//! Optimisations: known optima, constraints, places that fail, and the same rows after a kill.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Scratch, graintrap, killed_with, number, study};

/// A quadrupole in closed form: nothing is solved, and every number is known.
const QUADRUPOLE: &str = r#"
[[source]]
name = "q"
kind = "quadrupole"
r0   = "10 mm"
dimensions = 3
dc   = "3 V"
rf   = { amplitude = "500 V", frequency = "60 Hz" }

[[grains]]
count  = 1
mass   = "1e-13 kg"
charge = "1e-15 C"
place  = { kind = "points", points = [[0, 0, 0]] }

[trace]
duration = "1 ms"

[study]
kind   = "optimise"
center = [0, 0, 0]
radius = "2 mm"
"#;

fn close(got: f64, exact: f64, by: f64) {
    assert!((got - exact).abs() <= by, "{got} instead of {exact}");
}

#[test]
fn cli_optimise_finds_known_optima() {
    let scratch = Scratch::new();
    // q_z = -2 q_x = 4 Q V |A2| / (m Ω²) with |A2| = V / r0² (physics of the ideal trap): 0.5 at V = 0.5 m Ω² r0² / (4 Q).
    let omega = std::f64::consts::TAU * 60.0;
    let volts = |q: f64| q * 1e-13 * omega * omega * 1e-4 / (4.0 * 1e-15);
    // 1. A sum of squares over two voltages: its bottom is where both are zero. By both methods.
    for (name, optimiser) in [("c", "cobyla"), ("s", "slsqp")] {
        let text = format!(
            "{QUADRUPOLE}goal = \"minimise\"\noptimiser = \"{optimiser}\"\nevaluations = 300\ntolerance = 1e-5\n\
             objective = \"(abs(q_z) - 0.5)^2 + (A2_static / 1e4 + 1.2)^2\"\n[study.vary]\n\
             \"source.q.rf.amplitude\" = {{ from = \"100 V\", to = \"900 V\" }}\n\
             \"source.q.dc\" = {{ from = \"-5 V\", to = \"5 V\", start = \"0 V\" }}\n"
        );
        let (case, out) = (scratch.file(&format!("{name}.toml"), &text), scratch.at(name));
        let json = study(&case, &out, &[]).done().json();
        let best = &json["best"];
        assert_eq!(json["converged"], true, "{optimiser}");
        assert_eq!(json["active"].as_array().unwrap().len(), 0, "{}", json["active"]);
        // Linear models come to rest where the parabola is flat: 5e-4 of a range from its bottom it is 3e-5 higher at most.
        close(number(best, "source.q.rf.amplitude"), volts(0.5), 5e-4 * 800.0);
        close(number(best, "source.q.dc"), 1.2, 5e-4 * 10.0);
        // 2. The best case is a case like any other, with the numbers that it was chosen for.
        let best_case = Path::new(&out).join("best.toml");
        let words = fs::read_to_string(&best_case).unwrap();
        assert!(words.starts_with("# ") && words.contains("objective") && !words.contains("[study.vary]"), "{words}");
        let analysed = graintrap(&["analyse", best_case.to_str().unwrap(), "--json", "-o", &scratch.at("analysed")]);
        let analysed = analysed.done().json();
        let q =
            analysed["mathieu"]["q"].as_array().unwrap().iter().map(|q| q.as_f64().unwrap().abs()).fold(0.0, f64::max);
        close(q, number(best, "source.q.rf.amplitude") / volts(1.0), 1e-9);
        let files = ["history.png", "history.svg", "study.png", "study.csv", "study.parquet"];
        assert!(files.iter().all(|file| Path::new(&out).join(file).is_file()));
    }
    // 3. As strong as can be under a limit: at the limit. And as small as can be without one: at the bound.
    let text = |rest: &str| {
        let vary =
            "[study.vary]\n\"source.q.rf.amplitude\" = { from = \"100 V\", to = \"900 V\", start = \"120 V\" }\n";
        scratch.file("limit.toml", &format!("{QUADRUPOLE}{rest}\n{vary}"))
    };
    let case = text("objective = \"secular_z\"\nconstraints = [\"abs(q_z) <= 0.4\", \"0.9 >= abs(q_z)\"]");
    let json = study(&case, &scratch.at("limit"), &[]).done().json();
    close(number(&json["best"], "source.q.rf.amplitude"), volts(0.4), 1e-3 * 800.0);
    assert!(number(&json["best"], "source.q.rf.amplitude") <= volts(0.4) * (1.0 + 1e-9), "a limit is one");
    assert_eq!(json["active"].as_array().unwrap(), &["abs(q_z) <= 0.4"]);
    let json = study(&text("objective = \"-abs(q_z)\""), &scratch.at("bound"), &[]).done().json();
    assert_eq!(number(&json["best"], "source.q.rf.amplitude"), 100.0);
    assert_eq!(json["active"].as_array().unwrap(), &["source.q.rf.amplitude at its lower bound 100 V"]);
    // 4. What nothing can hold is said so.
    let said = study(&text("objective = \"secular_z\"\nconstraints = [\"abs(q_z) >= 9\"]"), &scratch.at("none"), &[]);
    assert_eq!(said.status, Some(1));
    assert!(said.err.contains("no evaluation holds all constraints; the nearest breaks one by"), "{}", said.err);
    // 5. Only what can be made: steps of 50 V, of which the last below a q of 0.5 is the second.
    let most = 100.0 + 50.0 * ((volts(0.5) - 100.0) / 50.0).floor();
    let rest = "objective = \"abs(q_z)\"\nconstraints = [\"abs(q_z) <= 0.5\"]\n[study.vary]\n\
                \"source.q.rf.amplitude\" = { from = \"100 V\", to = \"900 V\", step = \"50 V\" }\n";
    let case = scratch.file("steps.toml", &format!("{QUADRUPOLE}{rest}"));
    let json = study(&case, &scratch.at("steps"), &[]).done().json();
    assert_eq!(number(&json["best"], "source.q.rf.amplitude"), most);
    assert!(json["points"].as_u64().unwrap() <= 17, "no step is worked out twice");
}

/// Two rings, `half` of their distance varied.
const RINGS: &str = r#"
[[electrode]]
name        = "left"
shape       = "ring"
radius      = "10 mm"
wire_radius = "1 mm"
center      = [0, 0, "-5 mm"]
dc          = "1 V"
[[electrode]]
name        = "right"
shape       = "ring"
radius      = "10 mm"
wire_radius = "1 mm"
center      = [0, 0, "5 mm"]
dc          = "1 V"
[study]
kind        = "optimise"
center      = [0, 0, 0]
axis        = "z"
radius      = "2 mm"
objective   = "A4^2 / 1e10"
goal        = "minimise"
evaluations = 40
[study.vary]
half = { from = "0.5 mm", to = "8 mm", start = "2 mm" }
[study.tie]
"electrode.left.center.3"  = "-half"
"electrode.right.center.3" = "half"
"#;

#[test]
fn cli_optimise_goes_on_after_a_kill() {
    let scratch = Scratch::new();
    let case = scratch.file("rings.toml", RINGS);
    let (whole, cut) = (scratch.at("whole"), scratch.at("cut"));
    let said = study(&case, &whole, &["--threads", "1"]).done();
    let json = said.json();
    // Two thin rings have A4 = 0 at h/R = 0.36151 (physics of section 5.2); a wire of a tenth of the radius moves that by the square of it.
    close(number(&json["best"], "half"), 3.6151, 0.1);
    assert_eq!(json["converged"], true);
    // Killed when some rows are kept, and gone on with more threads: the same rows.
    killed_with(5, &scratch, &case, &cut);
    let json = study(&case, &cut, &["--threads", "2"]).done().json();
    assert!(json["rows_kept"].as_u64().unwrap() >= 5, "{}", json["rows_kept"]);
    for name in ["study.csv", "study.parquet", "history.svg", "best.toml"] {
        let file = |folder: &str| fs::read(Path::new(folder).join(name)).unwrap();
        assert_eq!(file(&whole), file(&cut), "{name}");
    }
    // Where the search starts must be a case.
    let text = RINGS.replace(
        "half = { from = \"0.5 mm\", to = \"8 mm\", start = \"2 mm\" }",
        "half = { from = \"1 V\", to = \"2 V\" }",
    );
    let text = text.replace("\"-half\"", "\"0 - half\"").replace("left.center.3", "left.radius");
    let said = study(&scratch.file("volts.toml", &text), &scratch.at("volts"), &[]);
    assert_eq!(said.status, Some(2), "{}", said.err);
    assert!(said.err.contains("electrode.left.radius"), "{}", said.err);
    let said = study(&case, &whole, &["--shard", "1/2"]);
    assert!(said.status == Some(2) && said.err.contains("come one after the other"), "{}", said.err);
}

/// A shipped study.
fn shipped(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name).join("study.toml").to_str().unwrap().to_owned()
}

/// The shipped study with one grain that nothing repels: the circle is then the minimum of the effective potential, which an analysis
/// finds by Newton's method in all directions.
#[test]
fn cli_optimise_annulus_voltages() {
    let scratch = Scratch::new();
    let (case, out) = (shipped("annulus_radius"), scratch.at("out"));
    let json = study(&case, &out, &["--set", "forces.coulomb=false", "--set", "analysis.nodes=4000"]).done().json();
    // Where no circle is, a row failed; but all are on one solution.
    assert_eq!(json["solved"].as_u64(), Some(1), "voltages solve once");
    assert_eq!(json["converged"], true);
    let radius = number(&json["best"], "annulus_radius");
    close(radius, 0.5, 1.000_001e-4);
    let best = Path::new(&out).join("best.toml");
    let analysed =
        graintrap(&["analyse", best.to_str().unwrap(), "--json", "-o", &scratch.at("analysed")]).done().json();
    let minima = analysed["species"][0]["effective"].as_array().unwrap();
    let radii = minima.iter().filter(|p| p["kind"] == "minimum").map(|p| {
        let x = |k: usize| p["position"][k].as_f64().unwrap();
        x(1).hypot(x(2))
    });
    let off = radii.map(|r| (r - radius).abs()).fold(f64::INFINITY, f64::min);
    // Central differences over a thousandth of the reach (1.3 m) are off by the square of that, times bends of order one.
    assert!(off < 1e-5, "{off}");
}

/// A4 = A6 = 0, as another solver sees it: curved elements in place of generating curves.
#[test]
fn cli_optimise_end_caps_for_a_pure_quadrupole() {
    let scratch = Scratch::new();
    let (case, out) = (shipped("optimal_end_caps"), scratch.at("out"));
    let json = study(&case, &out, &[]).done().json();
    let share =
        |row: &Value, l: i32| (number(row, &format!("A{l}_rf")) / number(row, "A2_rf") * 0.5_f64.powi(l - 2)).abs();
    // What the objective asks for to a square of 1e-8.
    let best = &json["best"];
    assert!(share(best, 4) < 1e-4 && share(best, 6) < 1e-4, "{} {}", share(best, 4), share(best, 6));
    let best = Path::new(&out).join("best.toml");
    // A sweep of one value reports the multipoles of a case.
    let swept = scratch.file(
        "again.toml",
        &format!("{}\n[sweep]\n\"electrode.left.dc\" = [\"0 V\"]\n", fs::read_to_string(best).unwrap()),
    );
    let sets = ["--set", "field.solver=\"symmetric\"", "--set", "field.accuracy=1e-5"];
    let json = study(&swept, &scratch.at("again"), &sets).done().json();
    let row = &json["rows"][0];
    // The field of the other solver to 1e-5, of which A4 has up to a hundredfold share on its sphere.
    assert!(share(row, 4) < 1e-3 && share(row, 6) < 1e-3, "{} {}", share(row, 4), share(row, 6));
    // The next multipole is what is left.
    assert!(share(row, 8) > 1e-3, "{}", share(row, 8));
}

/// As near as two rings at different voltages can come: beyond, they touch.
#[test]
fn cli_optimise_steps_round_what_cannot_be() {
    let scratch = Scratch::new();
    let text = RINGS
        .replace("\"A4^2 / 1e10\"", "\"half\"")
        .replace("start = \"2 mm\"", "start = \"1.5 mm\"")
        .replace("evaluations = 40", "evaluations = 15");
    let apart = text.rfind("dc          = \"1 V\"").unwrap();
    let text = format!("{}{}", &text[..apart], text[apart..].replacen("1 V", "2 V", 1));
    let case = scratch.file("near.toml", &text);
    let said = study(&case, &scratch.at("near"), &[]);
    let json = said.json();
    assert_eq!(said.status, Some(0), "{}", said.err);
    let half = number(&json["best"], "half");
    assert!((1.0..1.5).contains(&half), "{half}: wires of 1 mm touch at 1 mm");
    let table = fs::read_to_string(Path::new(&scratch.at("near")).join("study.csv")).unwrap();
    assert!(table.lines().any(|row| row.contains("touches or cuts")), "{table}");
    assert!(said.err.contains("evaluations failed"), "{}", said.err);
}
