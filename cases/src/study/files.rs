//! The rows of a study as files: `study.csv`, `study.parquet`, `study.json`.

use std::io::Write;
use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};
use serde_json::{Map, Value, json};

use super::row::{Number, Row};
use crate::case::{Case, Sweep, SweepAxis};
use crate::quantity::split;

/// Names of the files.
pub const CSV: &str = "study.csv";
/// The same for programs that read columns.
pub const PARQUET: &str = "study.parquet";
/// The same with everything that is known of the study.
pub const JSON: &str = "study.json";

/// What stands in one column.
#[derive(Clone, Debug, PartialEq)]
pub enum Cells {
    /// Whole numbers.
    Counts(Vec<i64>),
    /// Numbers, where there are.
    Numbers(Vec<Option<f64>>),
    /// Words, where there are.
    Words(Vec<Option<String>>),
}

/// A column: its name, its unit (empty: none), its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Unique in the table.
    pub name: String,
    /// As written in the case for varied keys, SI for numbers.
    pub unit: String,
    /// One for each row.
    pub cells: Cells,
}

/// Rows as columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// All of the same length.
    pub columns: Vec<Column>,
    /// Number of rows.
    pub rows: usize,
}

/// The value of a varied key as a number, and its unit.
pub fn number_and_unit(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let bare = text.strip_prefix(['"', '\'']).and_then(|text| text.strip_suffix(['"', '\''])).unwrap_or(text);
    let (number, unit) = split(bare.trim());
    // TOML's 1_000.
    number.replace('_', "").parse().ok().filter(|x: &f64| x.is_finite()).map(|x| (x, unit.trim()))
}

/// The values of a key as numbers in one unit, if that is what all of them are.
pub fn in_one_unit<'r>(values: impl Iterator<Item = &'r str>) -> Option<(Vec<f64>, String)> {
    let pairs: Vec<(f64, &str)> = values.map(number_and_unit).collect::<Option<_>>()?;
    let unit = pairs.first()?.1;
    pairs.iter().all(|(_, u)| *u == unit).then(|| (pairs.iter().map(|(x, _)| *x).collect(), unit.to_owned()))
}

/// The names of all numbers of the rows, in the order in which they first appear, with their units, and whether some row tells
/// an error of it. Only those that the sweep asks for, if it names any.
pub fn reported(sweep: &Sweep, rows: &[Row]) -> Vec<(String, String, bool)> {
    let mut names: Vec<(String, String, bool)> = Vec::new();
    for Number { name, unit, error, .. } in rows.iter().flat_map(Row::numbers) {
        if !is_asked(&sweep.report, name) {
            continue;
        }
        match names.iter_mut().find(|(known, ..)| known == name) {
            Some(entry) => entry.2 |= error.is_some(),
            None => names.push((name.clone(), unit.clone(), error.is_some())),
        }
    }
    names
}

/// Whether a sweep that reports `asked` reports a number: all where it names none; `struck` stands for `struck.left` too.
pub fn is_asked(asked: &[String], name: &str) -> bool {
    asked.is_empty()
        || asked.iter().any(|a| a == name || name.strip_prefix(a.as_str()).is_some_and(|r| r.starts_with('.')))
}

impl Table {
    /// Of the rows of a study, in their order.
    pub fn new(sweep: &Sweep, rows: &[Row]) -> Self {
        let mut columns = Vec::new();
        let mut column = |name: String, unit: String, cells: Cells| columns.push(Column { name, unit, cells });
        column("point".to_owned(), String::new(), Cells::Counts(rows.iter().map(|r| r.point as i64 + 1).collect()));
        for (k, SweepAxis { key, .. }) in sweep.axes.iter().enumerate() {
            let texts = || rows.iter().map(|row| row.values[k].as_str());
            match in_one_unit(texts()) {
                Some((numbers, unit)) => {
                    column(key.clone(), unit, Cells::Numbers(numbers.into_iter().map(Some).collect()));
                }
                None => {
                    let bare = |text: &str| Some(text.trim_matches('"').to_owned());
                    column(key.clone(), String::new(), Cells::Words(texts().map(bare).collect()));
                }
            }
        }
        let status = |row: &Row| Some(if row.reason().is_none() { "done" } else { "failed" }.to_owned());
        column("status".to_owned(), String::new(), Cells::Words(rows.iter().map(status).collect()));
        for (name, unit, with_error) in reported(sweep, rows) {
            let of = |what: fn(&Number) -> Option<f64>| {
                let cell = |row: &Row| row.numbers().iter().find(|n| n.name == name).and_then(what);
                Cells::Numbers(rows.iter().map(cell).collect())
            };
            column(name.clone(), unit.clone(), of(|n| n.value));
            if with_error {
                column(format!("{name}_error"), unit.clone(), of(|n| n.error));
            }
        }
        let reason = |row: &Row| row.reason().map(str::to_owned);
        column("reason".to_owned(), String::new(), Cells::Words(rows.iter().map(reason).collect()));
        let warnings = |row: &Row| Some(row.warnings.join("; ")).filter(|text| !text.is_empty());
        column("warnings".to_owned(), String::new(), Cells::Words(rows.iter().map(warnings).collect()));
        Self { columns, rows: rows.len() }
    }

    /// As CSV with a line of names; a number in as many digits as it needs, nothing where there is none.
    ///
    /// # Errors
    /// The output fails.
    pub fn csv(&self, out: &mut dyn Write) -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_writer(out);
        writer.write_record(self.columns.iter().map(|column| match column.unit.as_str() {
            "" => column.name.clone(),
            unit => format!("{} ({unit})", column.name),
        }))?;
        for row in 0..self.rows {
            writer.write_record(self.columns.iter().map(|column| match &column.cells {
                Cells::Counts(cells) => cells[row].to_string(),
                Cells::Numbers(cells) => cells[row].map(written).unwrap_or_default(),
                Cells::Words(cells) => cells[row].clone().unwrap_or_default(),
            }))?;
        }
        writer.flush()?;
        Ok(())
    }

    /// As Apache Parquet: one row group; columns as in the CSV file, units in the metadata under `unit.<column>`.
    ///
    /// # Errors
    /// None that a table of ours can cause.
    pub fn parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let field = |column: &Column| -> Result<TypePtr, ParquetError> {
            let builder =
                match &column.cells {
                    Cells::Counts(_) => Type::primitive_type_builder(&column.name, Physical::INT64)
                        .with_repetition(Repetition::REQUIRED),
                    Cells::Numbers(_) => Type::primitive_type_builder(&column.name, Physical::DOUBLE)
                        .with_repetition(Repetition::OPTIONAL),
                    Cells::Words(_) => Type::primitive_type_builder(&column.name, Physical::BYTE_ARRAY)
                        .with_repetition(Repetition::OPTIONAL)
                        .with_logical_type(Some(LogicalType::String))
                        .with_converted_type(ConvertedType::UTF8),
                };
            Ok(Arc::new(builder.build()?))
        };
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Arc::new(Type::group_type_builder("study").with_fields(fields).build()?);
        let units = self.columns.iter().filter(|column| !column.unit.is_empty());
        let units = units
            .map(|column| parquet::file::metadata::KeyValue::new(format!("unit.{}", column.name), column.unit.clone()));
        let properties = WriterProperties::builder().set_key_value_metadata(Some(units.collect())).build();
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
        let mut group = writer.next_row_group()?;
        for column in &self.columns {
            let Some(mut chunk) = group.next_column()? else { break };
            match &column.cells {
                Cells::Counts(cells) => {
                    chunk.typed::<Int64Type>().write_batch(cells, None, None)?;
                }
                Cells::Numbers(cells) => {
                    let there: Vec<f64> = cells.iter().flatten().copied().collect();
                    chunk.typed::<DoubleType>().write_batch(&there, Some(&levels(cells)), None)?;
                }
                Cells::Words(cells) => {
                    let there: Vec<ByteArray> = cells.iter().flatten().map(|text| text.as_str().into()).collect();
                    chunk.typed::<ByteArrayType>().write_batch(&there, Some(&levels(cells)), None)?;
                }
            }
            chunk.close()?;
        }
        group.close()?;
        writer.close()?;
        Ok(bytes)
    }

    /// The rows as JSON objects, what is not there left out.
    pub fn json(&self) -> Vec<Value> {
        let object = |row: usize| {
            let cell = |column: &Column| match &column.cells {
                Cells::Counts(cells) => Some(json!(cells[row])),
                Cells::Numbers(cells) => cells[row].map(|x| json!(x)),
                Cells::Words(cells) => cells[row].as_ref().map(|text| json!(text)),
            };
            let entries = self.columns.iter().filter_map(|column| Some((column.name.clone(), cell(column)?)));
            Value::Object(entries.collect::<Map<_, _>>())
        };
        (0..self.rows).map(object).collect()
    }
}

/// Whether each cell is there, as Parquet counts it.
fn levels<T>(cells: &[Option<T>]) -> Vec<i16> {
    cells.iter().map(|cell| i16::from(cell.is_some())).collect()
}

/// A number in as many digits as it needs.
pub fn written(x: f64) -> String {
    let magnitude = x.abs();
    if x == 0.0 || (1e-4..1e7).contains(&magnitude) { format!("{x}") } else { format!("{x:e}") }
}

/// Warns of a `report` that names what no row has.
///
/// # Errors
/// The first such name, and all names there are.
pub fn unknown_report(case: &Case, rows: &[Row]) -> Result<(), (String, Vec<String>)> {
    let asked = case.sweep.iter().flat_map(|sweep| &sweep.report);
    let mut names: Vec<String> = Vec::new();
    for number in rows.iter().flat_map(Row::numbers) {
        if !names.contains(&number.name) {
            names.push(number.name.clone());
        }
    }
    if names.is_empty() {
        return Ok(());
    }
    let there = |asked: &String| names.iter().any(|name| is_asked(std::slice::from_ref(asked), name));
    match asked.into_iter().find(|asked| !there(asked)) {
        Some(unknown) => Err((unknown.clone(), names)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::super::row::End;
    use super::*;
    use crate::case::Sampling;

    fn sweep(report: &[&str]) -> Sweep {
        let axis = |key: &str| SweepAxis {
            key: key.to_owned(),
            values: vec!["1".to_owned()],
            log: false,
            range: None,
            unit: String::new(),
        };
        let report = report.iter().map(|name| (*name).to_owned()).collect();
        Sweep { axes: vec![axis("electrode.left.dc"), axis("title")], sampling: Sampling::Zip, report }
    }

    fn rows() -> Vec<Row> {
        let numbers = |x: f64| {
            End::Done(vec![
                Number::new("A2_rf", "V/m^2", x, 1e-3 * x),
                Number::new("struck.left", "", 2.0, None),
                Number::new("bad", "", f64::NAN, f64::INFINITY),
            ])
        };
        let values = |volts: &str, title: &str| vec![volts.to_owned(), title.to_owned()];
        vec![
            Row { point: 0, values: values("\"1.5 kV\"", "\"a, b\""), end: numbers(0.1 + 0.2), warnings: Vec::new() },
            Row {
                point: 1,
                values: values("\"-2 kV\"", "\"c\""),
                end: End::Refused("case.toml: no \"such\" thing".into()),
                warnings: vec!["x".into(), "y".into()],
            },
        ]
    }

    #[test]
    fn a_table_is_read_back_from_csv_and_parquet() {
        let table = Table::new(&sweep(&[]), &rows());
        let mut text = Vec::new();
        table.csv(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "point,electrode.left.dc (kV),title,status,A2_rf (V/m^2),A2_rf_error (V/m^2),struck.left,bad,reason,warnings"
        );
        assert_eq!(lines[1], "1,1.5,\"a, b\",done,0.30000000000000004,0.00030000000000000003,2,,,");
        assert_eq!(lines[2], "2,-2,c,failed,,,,,\"case.toml: no \"\"such\"\" thing\",x; y");

        let reader = SerializedFileReader::new(bytes::Bytes::from(table.parquet().unwrap())).unwrap();
        let back: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!(back.len(), 2);
        assert_eq!((back[0].get_long(0).unwrap(), back[1].get_double(1).unwrap()), (1, -2.0));
        assert_eq!(back[0].get_double(4).unwrap().to_bits(), (0.1_f64 + 0.2).to_bits());
        assert!(back[1].get_double(4).is_err() && back[0].get_double(7).is_err(), "nothing where there is no number");
        assert_eq!(back[1].get_string(8).unwrap(), "case.toml: no \"such\" thing");
    }

    #[test]
    fn a_sweep_reports_what_it_names() {
        let table = Table::new(&sweep(&["struck"]), &rows());
        let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["point", "electrode.left.dc", "title", "status", "struck.left", "reason", "warnings"]);
    }

    #[test]
    fn values_of_keys_are_numbers_where_they_share_a_unit() {
        assert_eq!(in_one_unit(["\"1 mm\"", "\"2.5e1 mm\""].into_iter()), Some((vec![1.0, 25.0], "mm".to_owned())));
        assert_eq!(in_one_unit(["1", "1e-3"].into_iter()), Some((vec![1.0, 1e-3], String::new())));
        assert_eq!(in_one_unit(["\"1 mm\"", "\"1 cm\""].into_iter()), None);
        assert_eq!(in_one_unit(["[0, 0, 1]"].into_iter()), None);
    }
}
