//! Where grains strike grids: kept as they come beside the rows, and told as a table and a picture of the cell.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use tracer::Outcome;

use super::super::journal::name;
use super::grids;
use crate::cache::Digest;
use crate::case::Case;
use crate::output::folder::plain;
use crate::pipeline::Failure;
use crate::pipeline::flights::Flights;
use crate::plots::{Figure, Mark, Panel, Shape};

/// Name of the file within the output folder.
const KEPT: &str = "cache/strikes.jsonl";

/// Name of the table.
pub const CSV: &str = "strikes.csv";

/// Points of the study that are drawn.
const PANELS: usize = 6;

/// A grain that struck a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strike {
    /// From 1, in the order of the case.
    grain: usize,
    /// The grid.
    electrode: String,
    /// Along the plate and its normal from the middle of the plate, m.
    place: [f64; 3],
    /// Within a cell whose corner is in the middle of the plate, in cells.
    cell: [f64; 2],
    /// s.
    time: f64,
    /// m/s.
    speed: f64,
    /// J.
    energy: f64,
}

/// All strikes of a flight on grids.
pub fn strikes(case: &Case, flights: &Flights) -> Vec<Strike> {
    let grids: Vec<_> = grids(case).filter_map(|grid| Some((grid.electrode, grid.placed()?))).collect();
    let strike = |(grain, ending): (usize, &tracer::Ending)| {
        let Outcome::Struck { electrode, point, energy, speed, .. } = ending.outcome else { return None };
        let (_, grid) = grids.iter().find(|(own, _)| *own == electrode)?;
        let place = grid.frame.map(|axis| axis.dot(&(point - grid.center)));
        Some(Strike {
            grain: grain + 1,
            electrode: case.electrodes[electrode].name.clone(),
            place,
            cell: [0, 1].map(|k| (place[k] / grid.cell[k]).rem_euclid(1.0)),
            time: ending.time,
            speed,
            energy,
        })
    };
    flights.traced.endings.iter().enumerate().filter_map(strike).collect()
}

#[derive(Serialize, Deserialize)]
struct Line {
    key: String,
    strikes: Vec<Strike>,
}

/// The strikes that a folder holds, by the digests of their points. Of a line cut short nothing is known, and its point has no row.
pub fn kept(folder: &Path) -> HashMap<String, Vec<Strike>> {
    let text = fs::read(folder.join(KEPT)).unwrap_or_default();
    let lines = text.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Line>(line).ok());
    lines.map(|line| (line.key, line.strikes)).collect()
}

/// Where strikes are kept as they come; a file only where there are any.
pub struct Book {
    path: PathBuf,
    file: Mutex<Option<File>>,
}

impl Book {
    /// For a folder; `fresh`: without what it held.
    pub fn new(folder: &Path, fresh: bool) -> Self {
        let path = folder.join(KEPT);
        if fresh {
            // Where there is none there is nothing to remove; where it cannot be, writing fails.
            let _ = fs::remove_file(&path);
        }
        Self { path, file: Mutex::new(None) }
    }

    /// Adds the strikes of a point; to be called before its row is kept.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn add(&self, key: &Digest, strikes: Vec<Strike>) -> Result<(), Failure> {
        if strikes.is_empty() {
            return Ok(());
        }
        self.add_named(name(key), strikes)
    }

    /// The same with the digest as it stands in a journal.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn add_named(&self, key: String, strikes: Vec<Strike>) -> Result<(), Failure> {
        let write = || {
            let mut text = serde_json::to_vec(&Line { key, strikes }).map_err(io::Error::other)?;
            text.push(b'\n');
            let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            let file = match &mut *file {
                Some(file) => file,
                none => {
                    let torn = fs::read(&self.path).is_ok_and(|old| old.last().is_some_and(|byte| *byte != b'\n'));
                    let file = none.insert(OpenOptions::new().create(true).append(true).open(&self.path)?);
                    if torn {
                        file.write_all(b"\n")?;
                    }
                    file
                }
            };
            file.write_all(&text)
        };
        write().map_err(|error: io::Error| {
            let help = "make room on the disk, or write elsewhere with -o DIR";
            Failure::run(format!("{} cannot be written: {}", self.path.display(), plain(&error)), help)
        })
    }
}

/// Points of a study, counted from 1, with their strikes.
pub type Struck = Vec<(usize, Vec<Strike>)>;

/// A row for each strike.
///
/// # Errors
/// The output fails.
pub fn csv(struck: &Struck, out: &mut dyn Write) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(out);
    let names = "point,grain,electrode,u (m),v (m),w (m),cell u,cell v,time (s),speed (m/s),energy (J)";
    writer.write_record(names.split(','))?;
    for (point, strikes) in struck {
        for s in strikes {
            let numbers = s.place.iter().chain(&s.cell).chain([&s.time, &s.speed, &s.energy]).map(f64::to_string);
            let first = [point.to_string(), s.grain.to_string(), s.electrode.clone()];
            writer.write_record(first.into_iter().chain(numbers))?;
        }
    }
    writer.flush()?;
    Ok(())
}

/// The cell, with a mark where each grain struck.
pub fn figure(title: &str, struck: &Struck) -> Option<Figure> {
    let panel = |(point, strikes): &(usize, Vec<Strike>)| Panel {
        title: format!("point {point}: {} strikes", strikes.len()),
        x_label: "across the cell (cells)".to_owned(),
        y_label: "along the cell (cells)".to_owned(),
        marks: vec![Mark {
            label: "grains that struck the grid".to_owned(),
            points: strikes.iter().map(|s| s.cell).collect(),
            shape: Shape::Circle,
        }],
        equal: true,
        ..Panel::default()
    };
    let panels: Vec<Panel> = struck.iter().take(PANELS).map(panel).collect();
    let columns = panels.len().min(2);
    let height = 150.0 + 420.0 * panels.len().div_ceil(2) as f64;
    let subtitle = "where on the cell of the grid; its corners are where the middle of the plate is".to_owned();
    (!panels.is_empty()).then(|| Figure {
        title: title.to_owned(),
        subtitle,
        columns,
        panels,
        height,
        ..Figure::default()
    })
}
