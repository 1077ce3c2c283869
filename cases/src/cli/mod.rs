//! The command line: one file for each verb.

mod analyse;
mod arguments;
mod check;
mod fields;
mod interrupt;
mod mesh;
mod optimise;
mod probe;
mod progress;
mod report;
mod run;
mod session;
mod study;

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use crate::pipeline::Failure;
use crate::{Look, schema};
use arguments::{Arguments, Common, Verb};
use fields::Extent;
use session::Session;

/// Reads the arguments and does what they ask; gives the exit status: 0 done, 1 the run failed, 2 wrong use or a wrong case.
pub fn main() -> ExitCode {
    let verb = Arguments::parse().verb;
    let json = verb.json();
    match dispatch(&verb) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            refuse(&failure, json);
            ExitCode::from(failure.status())
        }
    }
}

fn dispatch(verb: &Verb) -> Result<(), Failure> {
    match verb {
        Verb::Run(arguments) => run::run(&open(&arguments.common)?, arguments.resume, false),
        Verb::Trace(arguments) => run::run(&open(&arguments.common)?, arguments.resume, true),
        Verb::Check(common) => check::check(&open(common)?),
        Verb::Mesh(common) => mesh::mesh(&open(common)?),
        Verb::Solve(common) => fields::fields(&open(common)?, Extent::Solution),
        Verb::Table(common) => fields::fields(&open(common)?, Extent::Table),
        Verb::Analyse(common) => analyse::analyse(&open(common)?),
        Verb::Probe(arguments) => probe::probe(&open(&arguments.common)?, arguments),
        Verb::Study(arguments) => study::study(open(&arguments.common)?, arguments),
        Verb::Report(arguments) => report::report(arguments),
        Verb::Schema => {
            let text = serde_json::to_string_pretty(&schema()).unwrap_or_default();
            print(&format!("{text}\n"));
            Ok(())
        }
        Verb::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Arguments::command(), "graintrap", &mut script);
            print(&String::from_utf8_lossy(&script));
            Ok(())
        }
    }
}

fn open(common: &Common) -> Result<Session, Failure> {
    if let Some(threads) = common.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(|error| {
            Failure::run(format!("{threads} threads cannot be started: {error}"), "ask for fewer with --threads")
        })?;
    }
    Session::open(common)
}

/// Writes to standard output. A reader that has gone away (`| head`) is no failure.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

fn refuse(failure: &Failure, json: bool) {
    let (words, object) = match failure {
        Failure::Case(error) => (error.report(Look::of_stderr()), error.json()),
        Failure::Usage { problem, help } | Failure::Run { problem, help } => (
            format!("error: {problem}\n  help: {help}\n"),
            serde_json::json!({ "error": { "message": problem, "problem": problem, "help": help } }),
        ),
    };
    let _ = std::io::stderr().write_all(words.as_bytes());
    if json {
        print(&format!("{object}\n"));
    }
}
