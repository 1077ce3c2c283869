//! What can be said on the command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;

use crate::study::shard::Shard;

/// Electrostatic field solver and grain tracer: from a case file to fields, trajectories and pictures.
#[derive(Debug, Parser)]
#[command(name = "graintrap", version, max_term_width = 100)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(super) enum Verb {
    /// Mesh, solve, tabulate, trace, and write everything
    Run(RunArguments),
    /// Read a case, stand its electrodes and grains in place, and say whether it can run
    Check(Common),
    /// Write the meshed electrodes, and report on the quality of the mesh
    Mesh(Common),
    /// Charges on the electrodes and their capacitance matrix
    Solve(Common),
    /// Null points, multipoles, Mathieu's a and q, secular frequencies, depth of the well
    Analyse(Common),
    /// Potential and field at points
    Probe(ProbeArguments),
    /// Tabulate the potential and measure the table's error
    Table(Common),
    /// Like run, for a case that must have grains to trace
    Trace(RunArguments),
    /// A sweep: the case at many points, resumable, in shards if wanted
    Study(StudyArguments),
    /// One HTML page of what a run, an analysis or a study left in a folder
    Report(ReportArguments),
    /// Print the JSON Schema of the case file, for editors
    Schema,
    /// Print a script that completes arguments in a shell
    Completions {
        /// The shell
        shell: Shell,
    },
}

impl Verb {
    pub fn common(&self) -> Option<&Common> {
        match self {
            Self::Check(common)
            | Self::Mesh(common)
            | Self::Solve(common)
            | Self::Table(common)
            | Self::Analyse(common) => Some(common),
            Self::Run(arguments) | Self::Trace(arguments) => Some(&arguments.common),
            Self::Probe(arguments) => Some(&arguments.common),
            Self::Study(arguments) => Some(&arguments.common),
            Self::Report(_) | Self::Schema | Self::Completions { .. } => None,
        }
    }

    /// Whether one JSON object is to be printed.
    pub fn json(&self) -> bool {
        match self {
            Self::Report(arguments) => arguments.json,
            verb => verb.common().is_some_and(|common| common.json),
        }
    }
}

#[derive(Args, Clone, Debug)]
pub(super) struct Common {
    /// Case file, as cases/two_rings/case.toml
    pub case: PathBuf,
    /// Folder for what is written [default: out/<case name>]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Change any key of the case, as electrode.left.dc="7 V"; may be given many times
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Compute everything anew, whatever earlier commands kept
    #[arg(long)]
    pub fresh: bool,
    /// Folder that keeps solutions and tables of many cases [default: the last ones, in the output folder]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Threads to work with [default: one for each processor]; results do not depend on it
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<usize>,
    /// Say nothing but errors and warnings
    #[arg(short, long)]
    pub quiet: bool,
    /// Print one JSON object on standard output, words on standard error
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Clone, Debug)]
pub(super) struct RunArguments {
    #[command(flatten)]
    pub common: Common,
    /// Go on where a run that was stopped or killed left the grains, to the same results
    #[arg(long)]
    pub resume: bool,
}

#[derive(Args, Clone, Debug)]
pub(super) struct StudyArguments {
    #[command(flatten)]
    pub common: Common,
    /// Only the i-th of n parts of the points, into a folder of its own
    /// [default: what Slurm or an MPI launcher says, else everything]
    #[arg(long, value_name = "i/n", conflicts_with = "merge")]
    pub shard: Option<Shard>,
    /// Join the parts that shards wrote
    #[arg(long, value_name = "DIR", num_args = 1..)]
    pub merge: Vec<PathBuf>,
}

#[derive(Args, Clone, Debug)]
pub(super) struct ReportArguments {
    /// Folder that `graintrap run`, `analyse`, `solve` or `study` wrote
    pub folder: PathBuf,
    /// The page [default: DIR/report.html]
    #[arg(short, long, value_name = "FILE.html")]
    pub output: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Clone, Debug)]
pub(super) struct ProbeArguments {
    #[command(flatten)]
    pub common: Common,
    /// CSV file with columns x,y,z in metres
    #[arg(long, value_name = "POINTS.csv")]
    pub at: PathBuf,
    /// Time of the voltages, as 0.2 or "3 ms" [default: the start of the trace]
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    pub time: Option<String>,
    /// Look into the table, as grains do, instead of summing over all panels
    #[arg(long)]
    pub table: bool,
}

/// Threads beyond any machine are a slip of the finger.
const MOST_THREADS: usize = 1024;

fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(threads) if (1..=MOST_THREADS).contains(&threads) => Ok(threads),
        _ => Err(format!("a number from 1 to {MOST_THREADS} was expected")),
    }
}
