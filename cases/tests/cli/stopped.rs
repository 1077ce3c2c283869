//! Runs that are stopped half way: what stands in the folder is whole, and what stood there before is as it was.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::harness::{Scratch, command, contents, graintrap, is_whole, tiny};

/// When a run is stopped.
#[derive(Clone, Copy, Debug)]
enum Moment {
    /// After this fraction of the time that a whole one takes.
    After(f64),
    /// As soon as this file has been begun.
    At(&'static str),
}

/// Reading, meshing, solving and tabulating, by the clock; the writing, where the clock is too coarse, by its files.
const MOMENTS: [Moment; 11] = [
    Moment::After(0.1),
    Moment::After(0.15),
    Moment::After(0.25),
    Moment::After(0.4),
    Moment::After(0.6),
    Moment::After(0.8),
    Moment::At(".electrodes.vtu.partial"),
    Moment::At("cache/.solution.bin.partial"),
    Moment::At(".trajectories.csv.partial"),
    Moment::At("grains/.grains_00020.vtp.partial"),
    Moment::At(".coordinates.png.partial"),
];

/// Runs that are stopped while they write, whatever the clock does: the last moments but one, for the very last may be too
/// late.
const SURE: usize = 4;

/// What makes the second run's files differ from the first one's.
const CHANGE: &str = "electrode.left.dc=3 V";

type Files = BTreeMap<String, Vec<u8>>;

/// A run with the changed voltage, under way.
fn start(out: &str) -> Child {
    let tiny = tiny();
    let mut run = command(Path::new(out), &["run", &tiny, "-o", out, "--fresh", "--set", CHANGE]);
    run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Both complete runs, and how long the second took.
struct Runs {
    scratch: Scratch,
    first: Files,
    second: Files,
    whole: Duration,
}

impl Runs {
    fn new() -> Self {
        let scratch = Scratch::new();
        graintrap(&["run", &tiny(), "-o", &scratch.at("first")]).done();
        let first = contents(&scratch.0.join("first"));
        let start = Instant::now();
        graintrap(&["run", &tiny(), "-o", &scratch.at("second"), "--set", CHANGE]).done();
        let whole = start.elapsed();
        let second = contents(&scratch.0.join("second"));
        for (name, bytes) in first.iter().chain(&second) {
            assert!(is_whole(name, bytes), "{name}");
        }
        assert_ne!(first["trajectories.csv"], second["trajectories.csv"]);
        Self { scratch, first, second, whole }
    }

    /// Stops a run after the first one at a moment.
    fn stop(&self, moment: Moment, how: impl Fn(&mut Child)) -> (Output, Files) {
        let awaited = match moment {
            Moment::After(_) => None,
            Moment::At(name) => Some(self.scratch.0.join("first").join(name)),
        };
        // Of a run before.
        let _ = awaited.as_ref().map(std::fs::remove_file);
        let mut child = start(&self.scratch.at("first"));
        match (moment, awaited) {
            (Moment::After(fraction), _) => sleep(self.whole.mul_f64(fraction)),
            (_, Some(file)) => while !file.exists() && child.try_wait().unwrap().is_none() {},
            _ => unreachable!(),
        }
        how(&mut child);
        let output = child.wait_with_output().unwrap();
        assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"), "{output:?}");
        (output, contents(&self.scratch.0.join("first")))
    }

    /// Back to the first run, with whatever is left over lying about.
    fn restore(&self) {
        for (name, bytes) in &self.first {
            std::fs::write(self.scratch.0.join("first").join(name), bytes).unwrap();
        }
    }

    /// Whether the folder holds the second run. If not, it must hold the first, byte for byte.
    fn is_second(&self, found: &Files, moment: Moment) -> bool {
        let named: Files =
            found.iter().filter(|(name, _)| !is_partial(name)).map(|(n, b)| (n.clone(), b.clone())).collect();
        if named == self.first {
            return false;
        }
        for (name, bytes) in &named {
            assert!(is_whole(name, bytes), "{name} is not whole, stopped {moment:?}");
            // The summary tells times, which no two runs share.
            assert!(name == "summary.json" || *bytes == self.second[name], "{name} is of no run, stopped {moment:?}");
        }
        true
    }
}

fn is_partial(name: &str) -> bool {
    name.ends_with(".partial")
}

#[test]
fn cli_a_killed_run_leaves_what_was_there() {
    let runs = Runs::new();
    let (mut kept, mut left_over) = (0, 0);
    for moment in MOMENTS {
        let (_, found) = runs.stop(moment, |child| child.kill().unwrap());
        if runs.is_second(&found, moment) {
            runs.restore();
        } else {
            kept += 1;
        }
        left_over += usize::from(found.keys().any(|name| is_partial(name)));
    }
    println!("{kept} killed runs left the files before as they were, {left_over} left unfinished ones");
    assert!(
        kept >= SURE && left_over >= SURE,
        "only {kept} runs were killed in time, {left_over} of them while they wrote"
    );
    let out = runs.scratch.at("first");
    graintrap(&["run", &tiny(), "-o", &out, "--set", CHANGE]).done();
    let found = contents(Path::new(&out));
    assert!(found.keys().eq(runs.second.keys()), "{:?}", found.keys());
    assert!(runs.is_second(&found, Moment::After(1.0)));
}

#[test]
fn cli_an_interrupted_run_leaves_what_was_there_and_nothing_else() {
    let runs = Runs::new();
    let mut stopped = 0;
    for (k, moment) in MOMENTS.into_iter().enumerate() {
        let signal = if k % 2 == 0 { "-INT" } else { "-TERM" };
        let (output, found) = runs.stop(moment, |child| {
            let done = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status();
            assert!(done.is_ok());
        });
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!found.keys().any(|name| is_partial(name)), "{moment:?}: {:?}", found.keys());
        let second = runs.is_second(&found, moment);
        match output.status.code() {
            Some(0) => assert!(second, "{moment:?}: done, but the files are old: {words}"),
            Some(1) if second => assert!(words.contains("all files were written"), "{moment:?}: {words}"),
            Some(1) => {
                assert!(words.contains("stopped: no file was written"), "{moment:?}: {words}");
                stopped += 1;
            }
            other => panic!("{moment:?}: ended with {other:?}: {words}"),
        }
        if second {
            runs.restore();
        }
    }
    println!("{stopped} runs were stopped");
    assert!(stopped >= SURE, "only {stopped} runs were stopped in time");
}

/// A limit of the size of files stands for a full disk: writing fails in the same way, at another size of each file.
#[test]
fn cli_a_full_disk_ends_in_one_message() {
    let runs = Runs::new();
    let out = runs.scratch.at("first");
    let mut sizes: Vec<usize> = runs.second.values().map(Vec::len).collect();
    sizes.sort_unstable();
    // Room for almost nothing, for half of the files and for all but the largest, in blocks of 512 bytes.
    for room in [1, sizes[sizes.len() / 2] / 512, sizes[sizes.len() - 1] / 512 - 1] {
        let program = command(Path::new(&out), &[]).get_program().to_owned();
        let limited = format!("trap '' XFSZ; ulimit -f {room}; exec \"$@\"");
        let mut shell = Command::new("sh");
        shell.args(["-c", &limited, "sh"]).arg(program);
        let output = shell.args(["run", &tiny(), "-o", &out, "--fresh", "--set", CHANGE]).output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{room} blocks: {words}");
        assert_eq!(words.matches("error:").count(), 1, "{room} blocks: {words}");
        assert!(words.contains("cannot be written") && words.contains("make room on the disk"), "{words}");
        let found = contents(Path::new(&out));
        assert_eq!(found, runs.first, "{room} blocks: files of before were touched or new ones left over");
    }
}
