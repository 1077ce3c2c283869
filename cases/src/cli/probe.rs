//! `graintrap probe`: potential and field at points.

use std::path::Path;

use field::Samples;
use meshes::Vec3;
use serde::Serialize;

use super::arguments::ProbeArguments;
use super::fields::{solved, tabulated};
use super::session::Session;
use crate::case::GROUND;
use crate::pipeline::drives::{exact_field, tabulated_field};
use crate::pipeline::ready::ready;
use crate::pipeline::{Failure, region};
use crate::quantity::{Kind, parse};

/// Points that are listed for people; all are in the file and in the JSON.
const LISTED: usize = 30;

#[derive(Serialize)]
struct Probed {
    command: &'static str,
    title: String,
    /// s.
    time: f64,
    /// `panel sum` or `table`.
    method: &'static str,
    /// `solved` now, or `kept` from an earlier command.
    solution: &'static str,
    /// Estimated relative error of the field.
    error_estimate: f64,
    points: Vec<Point>,
    warnings: Vec<String>,
    files: Vec<String>,
}

#[derive(Serialize)]
struct Point {
    /// m.
    position: [f64; 3],
    /// V.
    potential: f64,
    /// V/m.
    field: [f64; 3],
    /// Potential of each electrode at 1 V with the others grounded, and of each source at strength one.
    basis: serde_json::Map<String, serde_json::Value>,
    /// The conductor that the point lies in.
    #[serde(skip_serializing_if = "Option::is_none")]
    inside: Option<String>,
    /// The table was asked for and does not cover the point: the sum over all panels was used.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    outside_table: bool,
}

pub(super) fn probe(session: &Session, arguments: &ProbeArguments) -> Result<(), Failure> {
    let (case, source) = (&session.case, &session.source);
    let time = match &arguments.time {
        None => case.trace.as_ref().map_or(0.0, |trace| trace.start),
        Some(text) => seconds(text)?,
    };
    let points = read_points(&arguments.at)?;
    let mut out = session.output()?;
    let ready = ready(case, source, &*session.progress)?;
    let solution = solved(session, case, &ready)?;
    let basis = &solution.basis;
    let exact = basis.panel_sum();
    if let Some((line, p)) = points.iter().find(|(_, p)| exact.singular_at(p).is_some()) {
        let name = exact.singular_at(p).map_or("", |s| &case.sources[s].name);
        let problem = format!(
            "{}:{line}: the point ({}, {}, {}) lies on the source `{name}`, where the field is infinite",
            arguments.at.display(),
            p.x,
            p.y,
            p.z
        );
        return Err(Failure::usage(problem, "move the point"));
    }
    let mut error_estimate = solution.errors.worst();
    let planned = if arguments.table { Some(tabulated(session, &solution)?) } else { None };
    session.cache.write(&mut out, case, &solution, planned.as_ref().map(|(plan, tabulated)| (plan, tabulated)))?;
    let (driven, covered) = match planned {
        Some((_, tabulated)) => {
            error_estimate = error_estimate.max(tabulated.report.error());
            (tabulated_field(case, basis, &tabulated.table), Some(tabulated.table))
        }
        None => (exact_field(case, basis), None),
    };
    let places: Vec<Vec3> = points.iter().map(|(_, p)| *p).collect();
    let mut scratch = Samples::default();
    let (mut potential, mut field) = (vec![0.0; places.len()], vec![Vec3::zeros(); places.len()]);
    driven.field.evaluate(&places, &vec![time; places.len()], &mut scratch, &mut potential, &mut field);
    let mut unit = Samples::default();
    match &covered {
        Some(table) => field::BasisField::sample(
            &field::TabulatedField::combined(basis, table, &identity(basis.functions())),
            &places,
            &mut unit,
        ),
        None => field::BasisField::sample(&exact, &places, &mut unit),
    }
    let names: Vec<&String> =
        case.electrodes.iter().map(|e| &e.name).chain(case.sources.iter().map(|s| &s.name)).collect();
    let functions = names.len();
    let bounds = region::table_box(case, &basis.mesh);
    let probed: Vec<Point> = (0..places.len())
        .map(|p| Point {
            position: places[p].into(),
            potential: potential[p],
            field: field[p].into(),
            basis: names
                .iter()
                .zip(&unit.potential[p * functions..(p + 1) * functions])
                .map(|(name, value)| ((*name).clone(), (*value).into()))
                .collect(),
            inside: match exact.inside(&places[p]) {
                Some(electrode) => Some(case.electrodes[electrode].name.clone()),
                None => exact.below_ground(&places[p]).then(|| GROUND.to_owned()),
            },
            outside_table: arguments.table
                && (0..3).any(|k| places[p][k] < bounds.min[k] || places[p][k] > bounds.max[k]),
        })
        .collect();
    out.write("probe.csv", |w| write_csv(w, &names, &probed))?;
    let files = out.names().to_vec();
    out.commit()?;
    let object = Probed {
        command: "probe",
        title: session.title(),
        time,
        solution: if solution.kept { "kept" } else { "solved" },
        method: if arguments.table { "table" } else { "panel sum" },
        error_estimate,
        points: probed,
        warnings: session.progress.warnings(),
        files,
    };
    session.say(&object, || words(&object, &session.folder));
    Ok(())
}

/// A time as in a case file: a number of seconds, or text with a unit.
fn seconds(text: &str) -> Result<f64, Failure> {
    let help = "give seconds, or a time with a unit: --time \"3 ms\"";
    let number: Option<f64> = text.trim().parse().ok();
    let value = match number {
        Some(number) => number,
        None => parse(text, &[Kind::Time]).map_err(|error| Failure::usage(format!("--time {text}: {error}"), help))?.0,
    };
    if value.is_finite() { Ok(value) } else { Err(Failure::usage(format!("--time {text} is not finite"), help)) }
}

fn identity(n: usize) -> Vec<Vec<f64>> {
    (0..n).map(|k| (0..n).map(|l| f64::from(u8::from(k == l))).collect()).collect()
}

/// Points with their lines: three columns, in metres, with or without a line of names.
fn read_points(path: &Path) -> Result<Vec<(u64, Vec3)>, Failure> {
    let help = "give a CSV file with columns x,y,z in metres, one point to a line";
    let wrong = |problem: String| Failure::usage(problem, help);
    let file = path.display();
    let bytes = std::fs::read(path).map_err(|error| {
        let reason = error.to_string();
        let reason = reason.split(" (os error").next().unwrap_or_default().to_lowercase();
        wrong(format!("{file} cannot be read: {reason}"))
    })?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes));
    let mut points = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| wrong(format!("{file}: {error}")))?;
        let line = record.position().map_or(0, csv::Position::line);
        let fields: Vec<&str> = record.iter().collect();
        let is_names = points.is_empty() && fields.iter().all(|f| f.parse::<f64>().is_err());
        if is_names {
            let names: Vec<String> = fields.iter().map(|f| f.to_lowercase()).collect();
            if names != ["x", "y", "z"] {
                return Err(wrong(format!("{file}:{line}: the columns are {}, not x,y,z", fields.join(","))));
            }
            continue;
        }
        if fields.len() != 3 {
            return Err(wrong(format!("{file}:{line}: {} columns instead of three", fields.len())));
        }
        let mut p = Vec3::zeros();
        for (k, text) in fields.iter().enumerate() {
            p[k] = text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
                wrong(format!("{file}:{line}: {} = `{text}` is no finite number", ["x", "y", "z"][k]))
            })?;
        }
        points.push((line, p));
    }
    if points.is_empty() {
        return Err(wrong(format!("{file} has no points")));
    }
    Ok(points)
}

fn write_csv(out: &mut dyn std::io::Write, names: &[&String], points: &[Point]) -> Result<(), csv::Error> {
    let mut csv = csv::Writer::from_writer(out);
    let head = ["x_m", "y_m", "z_m", "potential_V", "Ex_V_m", "Ey_V_m", "Ez_V_m"].map(str::to_owned);
    csv.write_record(head.into_iter().chain(names.iter().map(|name| format!("unit_potential {name}"))))?;
    for point in points {
        let numbers = point.position.iter().chain([&point.potential]).chain(&point.field);
        let unit = names.iter().map(|name| point.basis[*name].as_f64().unwrap_or(f64::NAN));
        csv.write_record(numbers.copied().chain(unit).map(|value| format!("{value:e}")))?;
    }
    csv.flush()?;
    Ok(())
}

fn words(probed: &Probed, folder: &Path) -> String {
    let mut text = format!(
        "{:>12} {:>12} {:>12} {:>14} {:>13} {:>13} {:>13}\n",
        "x m", "y m", "z m", "potential V", "Ex V/m", "Ey V/m", "Ez V/m"
    );
    for point in probed.points.iter().take(LISTED) {
        let ([x, y, z], [ex, ey, ez]) = (point.position, point.field);
        let note = match &point.inside {
            Some(name) => format!("  inside {name}"),
            None if point.outside_table => "  outside the table: exact".to_owned(),
            None => String::new(),
        };
        text += &format!(
            "{x:>12.5e} {y:>12.5e} {z:>12.5e} {:>14.7e} {ex:>13.5e} {ey:>13.5e} {ez:>13.5e}{note}\n",
            point.potential
        );
    }
    if probed.points.len() > LISTED {
        text += &format!("... {} more\n", probed.points.len() - LISTED);
    }
    text += &format!(
        "at {} s, from the {}, error of the field about {:.0e}; files: {}: {}\n",
        probed.time,
        probed.method,
        probed.error_estimate,
        folder.display(),
        probed.files.join(", ")
    );
    text
}
