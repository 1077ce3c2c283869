//! The same numbers, to the last bit, however they were come by: with any number of threads, from a kept solution or anew.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Scratch, contents, graintrap, tiny};

/// Runs a verb with `--json` on the quick case.
fn go(verb: &str, out: &str, more: &[&str]) -> Value {
    let tiny = tiny();
    let mut args = vec![verb, &tiny, "--json", "-o", out];
    args.extend(more);
    graintrap(&args).done().json()
}

fn reused(object: &Value) -> Vec<&str> {
    object["reused"].as_array().unwrap().iter().map(|stage| stage.as_str().unwrap()).collect()
}

/// All files but `summary.json`, which tells times.
fn assert_same_files(one: &str, other: &str) {
    let (one, other) = (contents(Path::new(one)), contents(Path::new(other)));
    assert!(one.keys().eq(other.keys()), "{:?} {:?}", one.keys(), other.keys());
    for (name, bytes) in &one {
        assert!(name == "summary.json" || *bytes == other[name], "{name} differs");
    }
}

#[test]
fn cli_threads_change_no_bit() {
    let scratch = Scratch::new();
    let out = |threads: &str| scratch.at(&format!("out{threads}"));
    let runs: Vec<Value> = ["1", "2", "5"].iter().map(|n| go("run", &out(n), &["--threads", n])).collect();
    for (n, run) in ["2", "5"].iter().zip(&runs[1..]) {
        assert_eq!(run["threads"].to_string(), *n);
        assert_eq!(run["trace"], runs[0]["trace"]);
        assert_eq!(run["capacitance_matrix_farad"], runs[0]["capacitance_matrix_farad"]);
        assert_same_files(&out("1"), &out(n));
    }
}

/// Does what was asked for with everything kept and with nothing, and looks that both leave the same bits.
fn same_when_fresh(verb: &str, kept: &str, anew: &str, change: &str) -> Value {
    let fast = go(verb, kept, &["--set", change]);
    let slow = go(verb, anew, &["--fresh", "--set", change]);
    assert_eq!((slow["solution"].as_str(), reused(&slow)), (Some("solved"), vec![]), "{change}");
    assert_eq!((&fast["trace"], &fast["table"]), (&slow["trace"], &slow["table"]), "{change}");
    assert_same_files(anew, kept);
    fast
}

#[test]
fn cli_what_is_kept_is_used_again_and_changes_no_bit() {
    let scratch = Scratch::new();
    let (anew, kept) = (scratch.at("anew"), scratch.at("kept"));
    let run = go("run", &anew, &[]);
    assert_eq!((run["solution"].as_str(), reused(&run)), (Some("solved"), vec![]));
    go("run", &kept, &[]);
    for verb in ["trace", "run"] {
        let again = go(verb, &kept, &[]);
        assert_eq!((again["command"].as_str(), reused(&again)), (Some(verb), vec!["solution", "table"]));
        assert_eq!((again["solution"].as_str(), again["seconds"]["solve"].as_f64()), (Some("kept"), Some(0.0)));
        assert_eq!(again["seconds"]["table"], 0.0);
        for key in ["trace", "capacitance_matrix_farad", "error_estimate", "unknowns", "solver_reason", "warnings"] {
            assert_eq!(again[key], run[key], "{key}");
        }
        assert_same_files(&anew, &kept);
    }

    // A voltage is a weight on the kept solution; grains, forces and times come later.
    for change in [
        "electrode.left.dc=7 V",
        "electrode.left.rf.amplitude=60 V",
        "trace.duration=20 ms",
        "forces.coulomb=false",
        "grains.1.count=2",
        "grains.1.place.radius=2 mm",
        "grains.1.charge=2e-14 C",
    ] {
        let fast = same_when_fresh("run", &kept, &anew, change);
        assert_eq!((fast["solution"].as_str(), reused(&fast)), (Some("kept"), vec!["solution", "table"]), "{change}");
        assert_ne!(fast["trace"], run["trace"], "{change}");
    }
    // A geometry is another one, and what is asked of the field.
    for change in [
        "electrode.left.radius=10.1 mm",
        "electrode.right.center=[\"5.1 mm\", 0, 0]",
        "field.panels=400",
        "field.accuracy=2e-3",
        "field.method=collocation",
    ] {
        go("run", &kept, &[]);
        let slow = same_when_fresh("run", &kept, &anew, change);
        assert_eq!((slow["solution"].as_str(), reused(&slow)), (Some("solved"), vec![]), "{change}");
    }
    // Of a table alone the solution stays.
    for change in ["table.spacing=0.45 mm", "table.accuracy=2e-2"] {
        go("run", &kept, &[]);
        let half = same_when_fresh("run", &kept, &anew, change);
        assert_eq!(reused(&half), ["solution"], "{change}");
    }
}

/// Without a box of its own, a table lies round all that stands in the case: grains count for it where they start beyond it.
#[test]
fn cli_a_table_follows_grains_only_as_far_as_it_must() {
    let scratch = Scratch::new();
    let text = std::fs::read_to_string(tiny()).unwrap();
    let open: String = text
        .lines()
        .filter(|line| !["min ", "max ", "spacing "].iter().any(|key| line.starts_with(key)))
        .flat_map(|line| [line, "\n"])
        .collect();
    let (case, out) = (scratch.file("open.toml", &open), scratch.at("out"));
    let run = |change: &str| {
        graintrap(&["run", &case, "--json", "-o", &out, "--set", "trace.duration=1 ms", "--set", change]).done().json()
    };
    assert!(reused(&run("grains.1.count=3")).is_empty());
    assert_eq!(reused(&run("grains.1.count=4")), ["solution", "table"]);
    assert_eq!(reused(&run("grains.1.place.radius=2 mm")), ["solution", "table"]);
    assert_eq!(reused(&run("electrode.right.dc=3 V")), ["solution", "table"]);
    // Beyond the box that the electrodes have.
    assert_eq!(reused(&run("grains.1.place.center=[\"3 cm\", 0, 0]")), ["solution"]);
}

#[test]
fn cli_every_verb_uses_what_another_one_kept() {
    let scratch = Scratch::new();
    let (out, shared) = (scratch.at("out"), scratch.at("shared"));
    let points = crate::common::folder("run").join("points.csv");
    let at = ["--at", points.to_str().unwrap()];
    assert_eq!(go("probe", &out, &at)["solution"], "solved");
    assert_eq!(go("solve", &out, &[])["solution"], "kept");
    assert_eq!(reused(&go("table", &out, &[])), ["solution"]);
    assert_eq!(reused(&go("run", &out, &[])), ["solution", "table"]);
    assert_eq!(go("probe", &out, &[at[0], at[1], "--table"])["solution"], "kept");

    // A folder that many cases share holds them all.
    let with = |out: &str, more: &[&str]| {
        let cache = ["--cache", shared.as_str()];
        let args: Vec<&str> = cache.iter().chain(more).copied().collect();
        reused(&go("table", &scratch.at(out), &args)).len()
    };
    let other = ["--set", "electrode.left.radius=10.1 mm"];
    assert_eq!((with("a", &[]), with("b", &other)), (0, 0));
    assert_eq!((with("c", &[]), with("d", &other)), (2, 2));
    assert_same_files(&scratch.at("a"), &scratch.at("c"));
    assert!(!Path::new(&scratch.at("a")).join("cache").exists());
    let file = scratch.file("file", "mine");
    let said = graintrap(&["solve", &tiny(), "-o", &out, "--cache", &file]);
    assert!(said.status == Some(1) && said.err.contains("the cache folder"), "{said:?}");
}

#[test]
fn cli_a_damaged_cache_is_passed_over() {
    let scratch = Scratch::new();
    let (anew, kept) = (scratch.at("anew"), scratch.at("kept"));
    let run = go("run", &anew, &[]);
    go("run", &kept, &[]);
    for (name, other) in [("solution.bin", "table"), ("table.bin", "solution")] {
        let cache = Path::new(&kept).join("cache").join(name);
        let whole = fs::read(&cache).unwrap();
        let flipped = |at: usize| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            bytes
        };
        let longer: Vec<u8> = whole.iter().copied().chain([0]).collect();
        let other_version = [b"graintrap solution 0 of 0.0.1\n".as_slice(), &whole[30..]].concat();
        // Flipped: the first word, the content, the digest; cut short; lengthened; of another version; empty.
        let damages = [
            (flipped(0), "was written by another version"),
            (flipped(100), "is damaged"),
            (flipped(whole.len() / 2), "is damaged"),
            (flipped(whole.len() - 1), "is damaged"),
            (whole[..whole.len() - 1].to_vec(), "is damaged"),
            (whole[..40].to_vec(), "is damaged"),
            (longer, "is damaged"),
            (other_version, "was written by another version"),
            (Vec::new(), "is damaged"),
        ];
        for (damage, words) in damages {
            fs::write(&cache, damage).unwrap();
            let said = graintrap(&["run", &tiny(), "--json", "-o", &kept]).done();
            assert!(said.err.contains(&format!("{name} {words}: computing the field anew")), "{said:?}");
            let trace = said.json();
            assert_eq!(reused(&trace), [other], "{name} that {words}");
            assert_eq!(trace["trace"], run["trace"], "{name} that {words}");
            assert_same_files(&anew, &kept);
        }
        // With the digest of another case it is no fault at all, and nobody is bothered.
        fs::write(&cache, flipped(50)).unwrap();
        let said = graintrap(&["run", &tiny(), "--json", "-o", &kept]).done();
        assert_eq!((said.err.as_str(), reused(&said.json())), ("", vec![other]));
        assert_same_files(&anew, &kept);
    }
}
