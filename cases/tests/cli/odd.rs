//! Odd cases that are not wrong, and what is done with them.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::sync::mpsc::channel;
use std::time::Duration;

use crate::harness::{Scratch, command, contents, graintrap, graintrap_in, is_whole};

/// A trap in closed form, without a single electrode.
const TRAP: &str = r#"
[[source]]
name = "trap"
kind = "quadrupole"
r0   = "1 cm"
rf   = { amplitude = "30 V", frequency = "50 Hz" }

[[grains]]
count  = 2
mass   = "1e-12 kg"
charge = "1 fC"
place  = { kind = "ball", radius = "1 mm" }

[trace]
duration = "10 ms"

[output]
field_nodes = 500
"#;

#[test]
fn cli_without_electrodes_every_verb_works() {
    let scratch = Scratch::new();
    let (case, points) = (scratch.file("trap.toml", TRAP), scratch.file("points.csv", "0,0,0\n0.001,0,0\n1e9,0,0\n"));
    for verb in ["check", "mesh", "solve", "table", "run", "trace", "probe", "probe --table"] {
        let out = scratch.at("out");
        let mut args: Vec<&str> = verb.split(' ').collect();
        args.extend([case.as_str(), "--json", "-o", &out]);
        if verb.starts_with("probe") {
            args.extend(["--at", &points]);
        }
        let object = graintrap(&args).done().json();
        if verb.starts_with("probe") {
            // φ = 30 V (x² + y² - 2 z²) / (2 r0²) up to a constant: 0.15 V a millimetre off the axis. Both methods are exact for
            // a field of second degree, but for round-off.
            let potential = |k: usize| object["points"][k]["potential"].as_f64().unwrap();
            assert!(((potential(1) - potential(0)).abs() - 0.15).abs() < 1e-9, "{object}");
        }
        if let Some(trace) = object.get("trace") {
            assert_eq!(trace["outcomes"]["time_up"], 2);
        }
    }
    for (name, bytes) in contents(Path::new(&scratch.at("out"))) {
        assert!(is_whole(&name, &bytes), "{name}");
    }
}

/// A folder whose name needs quotes in a shell, and no `-o` at all.
#[test]
fn cli_output_folders() {
    let scratch = Scratch::new();
    scratch.file("trap.toml", TRAP);
    graintrap_in(&scratch.0, &["solve", "trap.toml", "-o", "my run/\"no 1\" ü"]).done();
    assert!(scratch.0.join("my run/\"no 1\" ü/summary.json").exists());
    graintrap_in(&scratch.0, &["solve", "trap.toml"]).done();
    assert!(scratch.0.join("out/trap/summary.json").exists());
}

/// Names of other alphabets arrive in every file as they are written; markup in a title breaks none.
#[test]
fn cli_names_and_titles_of_any_letters() {
    let scratch = Scratch::new();
    let title = "title = \"<b>Falle & Körner</b> \\\"1\\\" 粒\"\n";
    let case = scratch.file("trap.toml", &(title.to_owned() + &TRAP.replace("\"trap\"", "\"Käfig-粒_1\"")));
    let (out, points) = (scratch.at("out"), scratch.file("points.csv", "0,0,0\n"));
    let run = graintrap(&["run", &case, "--json", "-o", &out]).done().json();
    assert_eq!(run["title"], "<b>Falle & Körner</b> \"1\" 粒");
    let probe = graintrap(&["probe", &case, "--json", "-o", &out, "--at", &points]).done().json();
    assert!(probe["points"][0]["basis"]["Käfig-粒_1"].is_number(), "{probe}");
    let found = contents(Path::new(&out));
    for (name, bytes) in &found {
        assert!(is_whole(name, bytes), "{name}");
    }
    for name in ["probe.csv", "field.vti"] {
        assert!(String::from_utf8_lossy(&found[name]).contains("unit_potential Käfig-粒_1"), "{name}");
    }
}

/// No field, no forces: grains stay where they are, and everything is written all the same.
#[test]
fn cli_grains_at_rest_stay() {
    let scratch = Scratch::new();
    let still = TRAP.replace("rf   = { amplitude = \"30 V\", frequency = \"50 Hz\" }", "dc = \"0 V\"");
    let case = scratch.file("still.toml", &still);
    let run = graintrap(&["run", &case, "--json", "-o", &scratch.at("out")]).done().json();
    for end in run["trace"]["final"].as_array().unwrap() {
        assert_eq!((end["outcome"].as_str(), end["time"].as_f64()), (Some("time_up"), Some(0.01)));
        assert_eq!(end["velocity"], serde_json::json!([0.0, 0.0, 0.0]));
    }
}

/// A run that takes days says so before it starts.
#[test]
fn cli_a_run_that_takes_days_says_so() {
    let scratch = Scratch::new();
    let long = TRAP.replace("50 Hz", "1 GHz").replace("10 ms", "1 s");
    let (case, out) = (scratch.file("long.toml", &long), scratch.at("out"));
    let mut run = command(&scratch.0, &["run", &case, "-o", &out]).stderr(Stdio::piped()).spawn().unwrap();
    let (stderr, (tell, told)) = (run.stderr.take().unwrap(), channel());
    std::thread::spawn(move || tell.send(BufReader::new(stderr).lines().next()));
    let first = told.recv_timeout(Duration::from_secs(60));
    run.kill().unwrap();
    run.wait().unwrap();
    let words = first.expect("nothing is said in a minute").unwrap().unwrap();
    assert!(words.starts_with("warning: the duration holds 1e9 periods of the fastest voltage"), "{words}");
}
