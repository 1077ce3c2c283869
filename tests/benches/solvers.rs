//! What a solution costs and how exact it is: `graintrap solve`, as a user starts it, on problems whose capacitance is known.
//!
//! Two tables in Markdown. The first: for each problem, accuracy asked and solver the true error, the error that the program
//! estimates, processor and wall-clock seconds of the whole process, its peak memory and its unknowns. The second: for many
//! geometries, whether the accuracy asked is met, and how honest the estimate is. One thread, nothing kept from before.
//!
//!     cargo bench -p graintrap-tests --bench solvers -- [--part cost|accuracy] [--problems sphere,cube] [--accuracies 1e-2,1e-3]
//!         [--solvers auto,dense] [--patience SECONDS] [--binary PATH] [--set KEY=VALUE]... [--out FILE]
//!
//! A run that fails, or takes longer than the patience, has its row too.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use graintrap_tests::{Reference, number, numbers, reference};
use serde_json::Value;

/// 4 pi eps0, F/m (CODATA 2018).
const FOUR_PI_EPS0: f64 = 1.112_650_055_447_870_3e-10;

/// A geometry and where its capacitances are known from.
struct Problem {
    name: &'static str,
    /// `[[electrode]]` tables and, if need be, `[field]` keys behind them.
    case: String,
    /// File in `tests/reference` and name in it.
    known: (&'static str, &'static str),
}

/// An electrode called `e0`, `e1`, ... with these keys.
fn electrodes(list: &[&str]) -> String {
    let one = |(n, keys): (usize, &&str)| format!("[[electrode]]\nname = \"e{n}\"\n{}\n\n", keys.replace("; ", "\n"));
    list.iter().enumerate().map(one).collect()
}

fn problem(name: &'static str, list: &[&str], file: &'static str, id: &'static str) -> Problem {
    Problem { name, case: electrodes(list), known: (file, id) }
}

const CAPACITANCE: &str = "capacitance.json";
const COMPOSITE: &str = "composite.json";
const OWN: &str = "solvers.json";

const SPHERE: &str = "shape = \"sphere\"; radius = 1";
const CUBE: &str = "shape = \"box\"; size = [1, 1, 1]";
const PLATE: &str = "shape = \"plate\"; size = [1, 1]";
const DISC: &str = "shape = \"disc\"; radius = 1";
const RING_1: &str = "shape = \"ring\"; radius = 1; wire_radius = 0.02; center = [0, 0, -0.5]";
const RING_2: &str = "shape = \"ring\"; radius = 1; wire_radius = 0.02; center = [0, 0, 0.5]";

fn torus(a: f64) -> String {
    format!("shape = \"ring\"; radius = 1; wire_radius = {a}")
}

fn bowl(opening: u32) -> String {
    format!("shape = \"end_cap\"; radius = 1; opening = \"{opening} deg\"")
}

fn ball(radius: f64, z: f64) -> String {
    format!("shape = \"sphere\"; radius = {radius}; center = [0, 0, {z}]")
}

/// What the first table is made of.
fn cost_problems() -> Vec<Problem> {
    let grid = |holes: u32| {
        format!(
            "shape = \"grid_plate\"; size = [1, 1]; pitch = {0}; hole = \"square\"; open = {1}",
            1.0 / f64::from(holes),
            0.7 / f64::from(holes)
        )
    };
    vec![
        problem("sphere", &[SPHERE], CAPACITANCE, "sphere.a=1"),
        problem("cube", &[CUBE], CAPACITANCE, "cube.side=1"),
        problem("torus 0.05", &[&torus(0.05)], CAPACITANCE, "torus.a=0.05.R=1"),
        problem("hemisphere", &[&bowl(90)], CAPACITANCE, "cap.a=1.half_angle_deg=90"),
        problem("plate", &[PLATE], CAPACITANCE, "square_plate.side=1"),
        problem("two rings 0.02", &[RING_1, RING_2], OWN, "two_rings.a=0.02.distance=1"),
        problem("disc", &[DISC], CAPACITANCE, "disc.a=1"),
        problem("annulus", &["shape = \"disc\"; radius = 1; hole_radius = 0.5"], OWN, "annulus.inner=0.5.outer=1"),
        problem(
            "closed cylinder",
            &["shape = \"cylinder\"; radius = 0.5; length = 2; caps = true"],
            OWN,
            "closed_cylinder.radius=0.5.length=2",
        ),
        problem("grid 10x10", &[&grid(10)], OWN, "grid_plate.holes=10.bar=0.3"),
        problem("grid 20x20", &[&grid(20)], OWN, "grid_plate.holes=20.bar=0.3"),
    ]
}

/// What the second table is made of.
fn accuracy_problems() -> Vec<Problem> {
    let mut list = vec![
        problem("sphere", &[SPHERE], CAPACITANCE, "sphere.a=1"),
        problem("disc", &[DISC], CAPACITANCE, "disc.a=1"),
    ];
    let caps = [
        (15, "bowl 15 deg", "cap.a=1.half_angle_deg=15"),
        (30, "bowl 30 deg", "cap.a=1.half_angle_deg=30"),
        (60, "bowl 60 deg", "cap.a=1.half_angle_deg=60"),
        (90, "bowl 90 deg", "cap.a=1.half_angle_deg=90"),
        (120, "bowl 120 deg", "cap.a=1.half_angle_deg=120"),
        (150, "bowl 150 deg", "cap.a=1.half_angle_deg=150"),
        (170, "bowl 170 deg", "cap.a=1.half_angle_deg=170"),
    ];
    list.extend(caps.map(|(opening, name, id)| problem(name, &[&bowl(opening)], CAPACITANCE, id)));
    let tori = [
        (0.02, "torus 0.02", "torus.a=0.02.R=1"),
        (0.1, "torus 0.1", "torus.a=0.1.R=1"),
        (0.5, "torus 0.5", "torus.a=0.5.R=1"),
    ];
    list.extend(tori.map(|(a, name, id)| problem(name, &[&torus(a)], CAPACITANCE, id)));
    let pairs = [
        (1.0, 2.1, "spheres 2.1 apart", "two_spheres.a=1.b=1.d=2.1"),
        (1.0, 2.5, "spheres 2.5 apart", "two_spheres.a=1.b=1.d=2.5"),
        (1.0, 5.0, "spheres 5 apart", "two_spheres.a=1.b=1.d=5"),
        (0.5, 2.0, "unequal spheres", "two_spheres.a=1.b=0.5.d=2"),
    ];
    list.extend(pairs.map(|(b, d, name, id)| problem(name, &[&ball(1.0, 0.0), &ball(b, d)], CAPACITANCE, id)));
    let shell = |radius: f64| format!("{}; hollow = true", ball(radius, 0.0));
    let disc = |radius: f64, z: f64| format!("shape = \"disc\"; radius = {radius}; center = [0, 0, {z}]");
    let ring = |radius: f64, wire: f64, z: f64| {
        format!("shape = \"ring\"; radius = {radius}; wire_radius = {wire}; center = [0, 0, {z}]")
    };
    list.extend([
        problem("concentric 1 and 2", &[&ball(1.0, 0.0), &shell(2.0)], CAPACITANCE, "concentric.a=1.b=2"),
        problem("concentric 0.9 and 1", &[&ball(0.9, 0.0), &shell(1.0)], CAPACITANCE, "concentric.a=0.9.b=1"),
        problem("cube", &[CUBE], CAPACITANCE, "cube.side=1"),
        problem("plate", &[PLATE], CAPACITANCE, "square_plate.side=1"),
        problem(
            "closed cylinder",
            &["shape = \"cylinder\"; radius = 0.5; length = 2; caps = true"],
            OWN,
            "closed_cylinder.radius=0.5.length=2",
        ),
        problem("two rings", &[&ring(1.0, 0.05, -1.0), &ring(1.0, 0.05, 1.0)], COMPOSITE, "two_equal_tori_fig14"),
        problem("ring and disc", &[&ring(0.25, 0.0125, 0.5), &disc(1.0, 0.0)], COMPOSITE, "ring_and_plate_config1"),
        problem(
            "ring and two discs",
            &[&ring(1.0, 0.1, 0.0), &disc(0.8, -0.7), &disc(0.8, 0.7)],
            COMPOSITE,
            "ring_two_plates",
        ),
    ]);
    list
}

/// The exact capacitance matrix over 4 pi eps0, m.
fn exact(known: &Reference) -> Vec<Vec<f64>> {
    let out = &known.outputs;
    if let Some(rows) = out["c_matrix_over_4pi_eps0"].as_array() {
        return rows.iter().map(numbers).collect();
    }
    if out["C_over_4pi_eps0"].is_number() {
        return vec![vec![known.output("C_over_4pi_eps0")]];
    }
    let c = |key: &str| known.output(&format!("c{key}_over_4pi_eps0"));
    vec![vec![c("11"), c("12")], vec![c("12"), c("22")]]
}

/// One solution.
struct Measured {
    solver: String,
    /// Largest error of a capacitance, against the largest of them; not a number where none is known.
    error: f64,
    estimate: f64,
    core_seconds: f64,
    wall_seconds: f64,
    peak_bytes: f64,
    unknowns: u64,
}

struct Bench {
    binary: PathBuf,
    scratch: PathBuf,
    patience: Duration,
    sets: Vec<String>,
}

impl Bench {
    /// Solves a problem in a process of its own.
    fn measure(&self, problem: &Problem, accuracy: &str, solver: &str) -> Result<Measured, String> {
        let (file, id) = problem.known;
        let known = reference(file).iter().find(|case| case.id == id).map(exact).unwrap_or_default();
        let case = self.scratch.join("case.toml");
        let text = format!("{}[field]\naccuracy = {accuracy}\nsolver = \"{solver}\"\n", problem.case);
        fs::write(&case, text).map_err(|error| error.to_string())?;
        let mut command = Command::new(&self.binary);
        command
            .arg("solve")
            .arg(&case)
            .args(["--json", "--fresh", "--threads", "1", "-o"])
            .arg(self.scratch.join("out"));
        command.args(self.sets.iter().flat_map(|set| ["--set", set])).env("RAYON_NUM_THREADS", "1");
        let (before, start) = (children_seconds(), Instant::now());
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(|error| error.to_string())?;
        while child.try_wait().map_err(|error| error.to_string())?.is_none() {
            if start.elapsed() > self.patience {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("more than {:.0} s", self.patience.as_secs_f64()));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        let wall_seconds = start.elapsed().as_secs_f64();
        let output = child.wait_with_output().map_err(|error| error.to_string())?;
        let core_seconds = children_seconds() - before;
        let said: Value = serde_json::from_slice(&output.stdout).map_err(|error| error.to_string())?;
        if !output.status.success() {
            return Err(said["error"]["problem"].as_str().unwrap_or("failed").to_owned());
        }
        let found: Vec<Vec<f64>> =
            said["capacitance_matrix_farad"].as_array().into_iter().flatten().map(numbers).collect();
        let largest = known.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let pairs = known.iter().flatten().zip(found.iter().flatten());
        Ok(Measured {
            solver: said["solver"].as_str().unwrap_or_default().to_owned(),
            error: match largest {
                0.0 => f64::NAN,
                largest => pairs.map(|(c, f)| (f / FOUR_PI_EPS0 - c).abs() / largest).fold(0.0, f64::max),
            },
            estimate: number(&said["error_estimate"]),
            core_seconds,
            wall_seconds,
            peak_bytes: number(&said["peak_memory_bytes"]),
            unknowns: said["unknowns"].as_u64().unwrap_or_default(),
        })
    }
}

/// Processor time, user and system, of all processes that were started here and have ended, s.
#[cfg(unix)]
fn children_seconds() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + 1e-6 * time.tv_usec() as f64;
    getrusage(UsageWho::RUSAGE_CHILDREN)
        .map_or(f64::NAN, |usage| seconds(usage.user_time()) + seconds(usage.system_time()))
}

#[cfg(not(unix))]
fn children_seconds() -> f64 {
    f64::NAN
}

/// What was asked for on the command line.
struct Wanted {
    parts: Vec<String>,
    problems: Vec<String>,
    accuracies: Vec<String>,
    solvers: Vec<String>,
    patience: f64,
    binary: Option<PathBuf>,
    sets: Vec<String>,
    out: Option<PathBuf>,
}

fn wanted(mut arguments: impl Iterator<Item = String>) -> Wanted {
    let mut wanted = Wanted {
        parts: ["cost", "accuracy"].map(str::to_owned).into(),
        problems: Vec::new(),
        accuracies: Vec::new(),
        solvers: Vec::new(),
        patience: 900.0,
        binary: None,
        sets: Vec::new(),
        out: None,
    };
    while let Some(name) = arguments.next() {
        if name == "--bench" {
            continue;
        }
        let value = arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        let list = || value.split(',').map(str::to_owned).collect();
        match name.as_str() {
            "--part" => wanted.parts = list(),
            "--problems" => wanted.problems = list(),
            "--accuracies" => wanted.accuracies = list(),
            "--solvers" => wanted.solvers = list(),
            "--patience" => wanted.patience = value.parse().expect("seconds"),
            "--binary" => wanted.binary = Some(value.into()),
            "--set" => wanted.sets.push(value),
            "--out" => wanted.out = Some(value.into()),
            _ => panic!("{name}? Known are --part --problems --accuracies --solvers --patience --binary --set --out"),
        }
    }
    wanted
}

fn or(list: &[String], otherwise: &[&str]) -> Vec<String> {
    if list.is_empty() { otherwise.iter().map(|s| (*s).to_owned()).collect() } else { list.to_vec() }
}

/// The release binary beside this one's folder, built if need be.
fn release_binary() -> PathBuf {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let built = Command::new(cargo).args(["build", "--release", "-p", "graintrap", "--bin", "graintrap"]).status();
    assert!(built.is_ok_and(|status| status.success()), "graintrap cannot be built");
    let this = std::env::current_exe().expect("a path");
    // target/release/deps/solvers-...
    this.ancestors().nth(2).expect("a folder").join("graintrap")
}

/// A path as it was given in the root of the repository; benches run in the folder of their member.
fn from_root(path: &Path) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    fs::canonicalize(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("only on demand: cargo bench -p graintrap-tests --bench solvers");
        return;
    }
    let wanted = wanted(arguments.into_iter());
    let scratch = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("solvers-{}", std::process::id()));
    fs::create_dir_all(&scratch).expect("a folder for case files");
    let bench = Bench {
        binary: wanted.binary.as_deref().map_or_else(release_binary, from_root),
        scratch: scratch.clone(),
        patience: Duration::from_secs_f64(wanted.patience),
        sets: wanted.sets.clone(),
    };
    let mut report = String::new();
    let mut row = |line: String| {
        println!("{line}");
        let _ = writeln!(report, "{line}");
        if let Some(out) = &wanted.out {
            fs::write(out, &report).expect("the report can be written");
        }
    };
    let chosen = |problem: &Problem| wanted.problems.is_empty() || wanted.problems.iter().any(|p| p == problem.name);
    if wanted.parts.iter().any(|part| part == "cost") {
        cost(&bench, &wanted, chosen, &mut row);
    }
    if wanted.parts.iter().any(|part| part == "accuracy") {
        accuracy(&bench, &wanted, chosen, &mut row);
    }
    let _ = fs::remove_dir_all(scratch);
}

fn cost(bench: &Bench, wanted: &Wanted, chosen: impl Fn(&Problem) -> bool, row: &mut impl FnMut(String)) {
    row("| problem | asked | solver | true error | estimate | core s | wall s | memory | unknowns |".to_owned());
    row("|---|---|---|---|---|---|---|---|---|".to_owned());
    let solvers = or(&wanted.solvers, &["auto", "dense", "symmetric", "axisymmetric", "multipole"]);
    for problem in cost_problems().iter().filter(|problem| chosen(problem)) {
        for asked in or(&wanted.accuracies, &["1e-2", "1e-3", "1e-4", "1e-5", "1e-6"]) {
            for solver in &solvers {
                let head = format!("| {} | {asked} |", problem.name);
                row(match bench.measure(problem, &asked, solver) {
                    Ok(m) => {
                        let solver = if *solver == m.solver { m.solver } else { format!("{solver}: {}", m.solver) };
                        let memory = m.peak_bytes / 1e6;
                        format!(
                            "{head} {solver} | {:.1e} | {:.1e} | {:.2} | {:.2} | {memory:.0} MB | {} |",
                            m.error, m.estimate, m.core_seconds, m.wall_seconds, m.unknowns
                        )
                    }
                    Err(why) => format!("{head} {solver} | {why} | | | | | |"),
                });
            }
        }
    }
}

fn accuracy(bench: &Bench, wanted: &Wanted, chosen: impl Fn(&Problem) -> bool, row: &mut impl FnMut(String)) {
    row("| geometry | asked | true error | estimate | true / estimate | met | solver | core s |".to_owned());
    row("|---|---|---|---|---|---|---|---|".to_owned());
    let (mut met, mut all) = (0, 0);
    for problem in accuracy_problems().iter().filter(|problem| chosen(problem)) {
        for asked in or(&wanted.accuracies, &["1e-3", "1e-4", "1e-5"]) {
            for solver in or(&wanted.solvers, &["auto"]) {
                let head = format!("| {} | {asked} |", problem.name);
                all += 1;
                row(match bench.measure(problem, &asked, &solver) {
                    Ok(m) => {
                        let pass = m.error <= asked.parse().expect("an accuracy is a number");
                        met += usize::from(pass);
                        format!(
                            "{head} {:.1e} | {:.1e} | {:.2} | {} | {} | {:.2} |",
                            m.error,
                            m.estimate,
                            m.error / m.estimate,
                            if pass { "yes" } else { "no" },
                            m.solver,
                            m.core_seconds
                        )
                    }
                    Err(why) => format!("{head} {why} | | | no | {solver} | |"),
                });
            }
        }
    }
    row(format!("\n{met} of {all} met"));
}
