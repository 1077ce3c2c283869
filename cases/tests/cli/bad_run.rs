//! Cases that can be read and cannot be run: `tests/cli/bad_run`, with the message in the file, and wrong uses of the command.
//!
//! `#! verb: run` names the verb and arguments of it (without: `check` and `run`, which must agree), `#! set: key=value`
//! arguments of `--set`, `#! expect: words` what the message holds.

use std::fs;
use std::path::Path;

use crate::common::{directives, files, flat, folder};
use crate::harness::{Said, Scratch, contents, graintrap, graintrap_in, tiny};

/// What an earlier run left, and no failure may touch.
fn earlier(scratch: &Scratch) -> String {
    let out = scratch.at("out");
    for part in ["grains", "cache"] {
        fs::create_dir_all(Path::new(&out).join(part)).unwrap();
    }
    for name in ["summary.json", "electrodes.vtu", "trajectories.csv", "grains/grains_00000.vtp", "cache/solution.bin"]
    {
        fs::write(Path::new(&out).join(name), format!("the earlier {name}")).unwrap();
    }
    out
}

/// The words of a refusal with `--json`: the object is alone on standard output, and people read the same.
fn refusal(said: &Said) -> Result<String, String> {
    let object = serde_json::from_str::<serde_json::Value>(&said.out).map_err(|error| format!("no object: {error}"))?;
    let error = object.get("error").ok_or("no key `error`")?;
    let text = |key: &str| error[key].as_str().map(str::to_owned).ok_or(format!("no text `error.{key}`"));
    let (message, problem, help) = (text("message")?, text("problem")?, text("help")?);
    let people = flat(&said.err);
    for part in [&problem, &help] {
        if !people.contains(&flat(part)) {
            return Err(format!("standard error does not say `{part}`"));
        }
    }
    if let Some(line) = error["line"].as_u64() {
        let place = format!("{}:{line}:", error["file"].as_str().unwrap_or_default());
        if !said.err.contains(&place) {
            return Err(format!("standard error does not name {place}"));
        }
    }
    Ok(format!("{message}\n{people}"))
}

#[test]
fn cli_bad_runs_say_what_is_wrong_and_write_nothing() {
    let files = files("bad_run");
    assert!(files.len() >= 35, "{} bad runs", files.len());
    let mut failed = Vec::new();
    for path in files {
        let name = path.file_name().unwrap().to_str().unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let (expected, set) = (directives(&text, "expect"), directives(&text, "set"));
        assert!(!expected.is_empty(), "{name} expects nothing");
        let mut verbs = directives(&text, "verb");
        if verbs.is_empty() {
            verbs = vec!["check".to_owned(), "run".to_owned()];
        }
        for verb in verbs {
            let scratch = Scratch::new();
            let out = earlier(&scratch);
            let before = contents(&scratch.0);
            let mut words = verb.split_whitespace();
            let mut args = vec![words.next().unwrap(), name, "--json", "-o", &out];
            args.extend(words);
            args.extend(set.iter().flat_map(|set| ["--set", set]));
            let said = graintrap_in(&folder("bad_run"), &args);
            if said.status != Some(2) {
                failed.push(format!("{verb} {name} ends with {:?}: {said:?}", said.status));
            }
            match refusal(&said) {
                Err(problem) => failed.push(format!("{verb} {name}: {problem}: {said:?}")),
                Ok(words) => failed.extend(
                    expected
                        .iter()
                        .filter(|message| !words.contains(*message))
                        .map(|message| format!("{verb} {name} does not say `{message}` but:\n{words}\n{}", said.err)),
                ),
            }
            if contents(&scratch.0) != before {
                failed.push(format!("{verb} {name} changed {:?}", contents(&scratch.0).keys()));
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Everything that must be refused before anything is written: arguments, exit status, words.
#[test]
fn cli_wrong_uses_are_explained() {
    let scratch = Scratch::new();
    let (tiny, out) = (tiny(), scratch.at("out"));
    let folder = scratch.0.to_str().unwrap();
    let empty = scratch.file("empty.toml", "");
    let latin = scratch.at("latin.toml");
    fs::write(&latin, b"title = \"caf\xe9\"\n").unwrap();
    let missing = scratch.at("missing.toml");
    let uses: [(&[&str], &str); 10] = [
        (&["run", &missing], "missing.toml"),
        (&["run", &missing], "no such file"),
        (&["run", folder], "folder"),
        (&["run", &empty], "neither electrodes nor sources"),
        (&["run", &latin], "UTF-8"),
        (&["run", &tiny, "--threads", "0"], "a number from 1 to 1024"),
        (&["run", &tiny, "--set", "no"], "--set"),
        (&["walk", &tiny], "walk"),
        (&["run"], "<CASE>"),
        (&["probe", &tiny], "--at"),
    ];
    for (args, words) in uses {
        let mut all = args.to_vec();
        all.extend(["-o", &out]);
        let said = graintrap(&all);
        assert_eq!(said.status, Some(2), "{all:?}: {said:?}");
        assert!(said.err.to_lowercase().contains(&words.to_lowercase()), "{all:?} does not say `{words}`: {said:?}");
        assert!(said.out.is_empty(), "{said:?}");
        assert!(!Path::new(&out).exists(), "{all:?} made a folder");
    }
}

/// An output folder that cannot be is a failure of the run, told before the work: exit status 1.
#[test]
fn cli_output_folders_that_cannot_be() {
    let scratch = Scratch::new();
    let file = scratch.file("file", "mine");
    let mut folders = vec![file.clone(), format!("{file}/sub")];
    if cfg!(target_os = "linux") {
        folders.push("/proc/graintrap".to_owned());
    }
    let points = folder("run").join("points.csv");
    for out in folders {
        for verb in ["run", "solve", "table", "trace", "mesh", "probe", "analyse"] {
            let tiny = tiny();
            let mut args = vec![verb, &tiny, "--json", "-o", &out];
            if verb == "probe" {
                args.extend(["--at", points.to_str().unwrap()]);
            }
            let said = graintrap(&args);
            assert_eq!(said.status, Some(1), "{verb} {out}: {said:?}");
            let words = refusal(&said).unwrap();
            assert!(words.contains(&out) && words.contains("cannot be written"), "{verb}: {words}");
            assert!(words.contains("give another one with -o DIR"), "{verb}: {words}");
        }
    }
    assert_eq!(fs::read_to_string(file).unwrap(), "mine");
}

/// A folder where a file has to go: nothing of the run appears, and nothing of an earlier one changes.
#[test]
fn cli_a_folder_under_the_name_of_a_file() {
    let scratch = Scratch::new();
    let out = earlier(&scratch);
    fs::create_dir_all(Path::new(&out).join("trajectories.vtp")).unwrap();
    let before = contents(&scratch.0);
    let said = graintrap(&["run", &tiny(), "--json", "-o", &out]);
    assert_eq!(said.status, Some(1), "{said:?}");
    let words = refusal(&said).unwrap();
    assert!(words.contains("trajectories.vtp cannot be written"), "{words}");
    assert_eq!(contents(&scratch.0), before);
}
