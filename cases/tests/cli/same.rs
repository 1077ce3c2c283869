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

#[test]
fn cli_what_is_kept_is_used_again_and_changes_no_bit() {
    let scratch = Scratch::new();
    let (anew, kept) = (scratch.at("anew"), scratch.at("kept"));
    let run = go("run", &anew, &[]);
    assert!(reused(&run).is_empty());
    go("run", &kept, &[]);
    let trace = go("trace", &kept, &[]);
    assert_eq!((trace["command"].as_str(), reused(&trace)), (Some("trace"), vec!["solution", "table"]));
    assert_eq!(trace["trace"], run["trace"]);
    assert_same_files(&anew, &kept);

    // A voltage is a weight on the kept solution; so are grains, forces and times.
    for change in
        ["electrode.left.dc=7 V", "electrode.left.rf.amplitude=60 V", "trace.duration=20 ms", "forces.coulomb=false"]
    {
        let fast = go("trace", &kept, &["--set", change]);
        assert_eq!(reused(&fast), ["solution", "table"], "{change}");
        assert_ne!(fast["trace"], run["trace"], "{change}");
        go("run", &anew, &["--set", change]);
        assert_same_files(&anew, &kept);
    }
    // A geometry is another one; so are the cells of a table.
    for change in ["electrode.left.radius=10.1 mm", "field.panels=400", "table.spacing=1.9 mm"] {
        go("run", &kept, &[]);
        let slow = go("trace", &kept, &["--set", change]);
        assert!(!reused(&slow).contains(&"table"), "{change}: {:?}", reused(&slow));
        go("run", &anew, &["--set", change]);
        assert_same_files(&anew, &kept);
    }
}

#[test]
fn cli_a_damaged_cache_is_passed_over() {
    let scratch = Scratch::new();
    let (anew, kept) = (scratch.at("anew"), scratch.at("kept"));
    let run = go("run", &anew, &[]);
    go("run", &kept, &[]);
    let cache = Path::new(&kept).join("cache/fields.bin");
    let whole = fs::read(&cache).unwrap();
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        bytes
    };
    // Flipped: the first word, the digest of the case, that of the content, the content; cut short; lengthened; empty.
    let longer: Vec<u8> = whole.iter().copied().chain([0]).collect();
    let damages = [
        flipped(0),
        flipped(30),
        flipped(70),
        flipped(whole.len() / 2),
        flipped(whole.len() - 1),
        whole[..whole.len() - 1].to_vec(),
        whole[..40].to_vec(),
        longer,
        Vec::new(),
    ];
    for (number, damage) in damages.into_iter().enumerate() {
        fs::write(&cache, damage).unwrap();
        let trace = go("trace", &kept, &[]);
        assert!(reused(&trace).is_empty(), "damage {number}: {:?}", reused(&trace));
        assert_eq!(trace["trace"], run["trace"], "damage {number}");
        assert_same_files(&anew, &kept);
    }
}
