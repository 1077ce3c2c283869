//! Runs that are killed while they trace, and go on.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::harness::{Said, Scratch, command, contents, graintrap, tiny};

/// Grains that both rings hold with RF, in three blocks, for half a second of tracing.
const SETS: [&str; 9] = [
    "trace.duration=1 s",
    "grains.1.count=150",
    "forces.coulomb=false",
    "electrode.left.dc=0 V",
    "electrode.right.dc=0 V",
    "electrode.right.rf={ amplitude = \"50 V\", frequency = \"60 Hz\" }",
    "forces.drag=3 /s",
    "output.every=20 ms",
    "output.checkpoint=10 ms",
];

fn arguments<'a>(case: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["run", case, "-o", out];
    SETS.iter().for_each(|set| all.extend(["--set", set]));
    all.extend(more);
    all
}

/// Starts a run and kills it when its checkpoint has so many bytes.
fn kill_at(case: &str, out: &str, more: &[&str], bytes: u64) -> PathBuf {
    let file = Path::new(out).join("checkpoint.bin");
    let mut run = command(Path::new(env!("CARGO_TARGET_TMPDIR")), &arguments(case, out, more));
    let mut child = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while fs::metadata(&file).map_or(0, |data| data.len()) < bytes {
        assert!(child.try_wait().unwrap().is_none(), "the run ended before its checkpoint had {bytes} bytes");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    file
}

fn resume(case: &str, out: &str, more: &[&str]) -> Said {
    graintrap(&[arguments(case, out, more), vec!["--resume"]].concat())
}

/// Every file but the summary, which tells times.
fn results(folder: &str) -> Vec<(String, Vec<u8>)> {
    contents(Path::new(folder)).into_iter().filter(|(name, _)| name != "summary.json").collect()
}

#[test]
fn cli_a_killed_run_goes_on_to_the_same_bits() {
    let (scratch, case) = (Scratch::new(), tiny());
    let (whole, cut) = (scratch.at("whole"), scratch.at("cut"));
    graintrap(&arguments(&case, &whole, &[])).done();
    assert!(!Path::new(&whole).join("checkpoint.bin").exists(), "nothing is left to resume");
    let undisturbed = results(&whole);

    // Killed, resumed on one thread, killed again later, resumed.
    let file = kill_at(&case, &cut, &[], 30_000);
    let first = fs::metadata(&file).unwrap().len();
    kill_at(&case, &cut, &["--resume", "--threads", "1"], first + 60_000);
    let resumed = resume(&case, &cut, &["--json"]).done();
    assert!(results(&cut) == undisturbed, "other bits after {first} bytes of checkpoint");
    // The field was kept with the first frame.
    assert_eq!(resumed.json()["reused"], serde_json::json!(["solution", "table"]));

    // A frame cut short, one that was given room but nothing else, and one of which a bit was turned: the flights go on from what is sound.
    let file = kill_at(&case, &cut, &[], 100_000);
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() - 1000]).unwrap();
    let said = resume(&case, &cut, &[]).done();
    assert!(results(&cut) == undisturbed && !said.err.contains("damaged"), "{said:?}");
    let mut empty = bytes.clone();
    empty.extend(5000_u64.to_le_bytes());
    empty.resize(empty.len() + 5000 + 16, 0);
    fs::write(&file, empty).unwrap();
    let said = resume(&case, &cut, &[]).done();
    assert!(results(&cut) == undisturbed && !said.err.contains("damaged"), "{said:?}");
    let mut turned = bytes.clone();
    turned[bytes.len() / 2] ^= 1;
    fs::write(&file, turned).unwrap();
    let said = resume(&case, &cut, &[]).done();
    assert!(said.err.contains("is damaged: the flights go on from its sound part"), "{said:?}");
    assert!(results(&cut) == undisturbed);

    // Of another case, or no checkpoint at all: refused, and left alone.
    fs::write(&file, &bytes).unwrap();
    let refused = resume(&case, &cut, &["--set", "trace.seed=5"]);
    assert_eq!(refused.status, Some(2), "{refused:?}");
    assert!(refused.err.contains("is of another case") && refused.err.contains("without --resume"), "{refused:?}");
    assert_eq!(fs::read(&file).unwrap(), bytes);
    fs::write(&file, b"a letter to whoever opens this file, long enough to be taken for a checkpoint of sorts")
        .unwrap();
    let refused = resume(&case, &cut, &[]);
    assert_eq!((refused.status, refused.err.contains("another version")), (Some(2), true), "{refused:?}");
    // A run that does not resume says what it is about to replace.
    let anew = graintrap(&arguments(&case, &cut, &[])).done();
    assert!(anew.err.contains("--resume would go on with it"), "{anew:?}");
    assert!(results(&cut) == undisturbed && !file.exists());
    let nothing = resume(&case, &cut, &[]).done();
    assert!(nothing.err.contains("to resume: the run begins anew"), "{nothing:?}");
}
