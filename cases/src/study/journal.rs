//! Rows as they come: a line for each, so that a study that was stopped goes on where it was.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::row::{End, Row};
use crate::cache::Digest;
use crate::output::folder::plain;
use crate::pipeline::Failure;

/// Name of the journal within the output folder.
pub const JOURNAL: &str = "cache/points.jsonl";

#[derive(Serialize, Deserialize)]
struct Line {
    key: String,
    row: Row,
}

/// The rows that a folder holds, by the digests of their points. A line cut short, as a killed study may leave one, is passed over.
pub fn kept(folder: &Path) -> HashMap<String, Row> {
    let text = fs::read(folder.join(JOURNAL)).unwrap_or_default();
    let lines = text.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Line>(line).ok());
    lines.map(|line| (line.key, line.row)).collect()
}

/// A digest as it stands in a journal.
pub fn name(key: &Digest) -> String {
    key.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The rows among `kept` that a study need not work out again: all but those whose work failed, for whatever reason there was.
pub fn usable(kept: &HashMap<String, Row>, key: &Digest) -> Option<Row> {
    kept.get(&name(key)).filter(|row| !matches!(row.end, End::Failed(_))).cloned()
}

/// Where rows are written as they come.
pub struct Journal {
    path: PathBuf,
    file: Mutex<File>,
}

impl Journal {
    /// Opens the journal of a folder; `fresh`: without what it held.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn open(folder: &Path, fresh: bool) -> Result<Self, Failure> {
        let path = folder.join(JOURNAL);
        let open = || {
            path.parent().map_or(Ok(()), fs::create_dir_all)?;
            if fresh {
                return File::create(&path);
            }
            let mut file = OpenOptions::new().create(true).append(true).open(&path)?;
            // A line cut short must not swallow the next.
            if fs::read(&path)?.last().is_some_and(|byte| *byte != b'\n') {
                file.write_all(b"\n")?;
            }
            Ok(file)
        };
        let file = open().map_err(|error| failed(&path, &error))?;
        Ok(Self { path, file: Mutex::new(file) })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add(&self, key: &Digest, row: &Row) -> Result<(), Failure> {
        self.add_named(&name(key), row)
    }

    /// The same with the digest as it stands in a journal.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add_named(&self, key: &str, row: &Row) -> Result<(), Failure> {
        let line = Line { key: key.to_owned(), row: row.clone() };
        let write = || {
            let mut text = serde_json::to_vec(&line).map_err(io::Error::other)?;
            text.push(b'\n');
            self.file.lock().unwrap_or_else(PoisonError::into_inner).write_all(&text)
        };
        write().map_err(|error| failed(&self.path, &error))
    }
}

fn failed(path: &Path, error: &io::Error) -> Failure {
    let help = "make room on the disk, or write elsewhere with -o DIR";
    Failure::run(format!("{} cannot be written: {}", path.display(), plain(error)), help)
}

#[cfg(test)]
mod tests {
    use super::super::row::Number;
    use super::*;

    fn row(point: usize, end: End) -> Row {
        Row { point, values: vec!["\"3 V\"".to_owned()], end, warnings: Vec::new() }
    }

    #[test]
    fn rows_come_back_to_the_last_bit_and_a_torn_line_is_passed_over() {
        let folder = std::env::temp_dir().join(format!("graintrap-journal-{}", std::process::id()));
        let numbers = [0.1 + 0.2, f64::MIN_POSITIVE, -1.0 / 3.0, 6.02e23, 5e-324, -0.0];
        let done = End::Done(numbers.map(|x| Number::new("n", "m", x, x.abs())).to_vec());
        let rows = [row(0, done), row(1, End::Refused("too thick".into())), row(2, End::Failed("disk full".into()))];
        let journal = Journal::open(&folder, true).unwrap();
        for (n, row) in rows.iter().enumerate() {
            journal.add(&[n as u8; 32], row).unwrap();
        }
        let path = folder.join(JOURNAL);
        let whole = fs::read(&path).unwrap();
        let back = kept(&folder);
        assert_eq!(usable(&back, &[0; 32]), Some(rows[0].clone()));
        let bits = |row: &Row| row.numbers().iter().map(|n| n.value.map(f64::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&usable(&back, &[0; 32]).unwrap()), bits(&rows[0]));
        assert_eq!(usable(&back, &[1; 32]), Some(rows[1].clone()));
        assert_eq!(usable(&back, &[2; 32]), None, "what failed is tried again");

        fs::write(&path, &whole[..whole.len() - 20]).unwrap();
        let journal = Journal::open(&folder, false).unwrap();
        journal.add(&[9; 32], &rows[1]).unwrap();
        let back = kept(&folder);
        assert_eq!(back.len(), 3);
        assert!(back.contains_key(&name(&[9; 32])) && !back.contains_key(&name(&[2; 32])));
        fs::remove_dir_all(folder).unwrap();
    }
}
