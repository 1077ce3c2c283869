//! The rows of `study.json`.

use serde_json::Value;

use super::numeral::{Cell, bare, number};
use super::table::{Key, Section, Table};

/// Rows that are shown; all are in `study.csv`.
const ROWS: usize = 2000;
/// Numbers of the best point that stand above everything.
const MOST_BEST: usize = 4;
/// Keys that have their place on the page.
const KNOWN: [&str; 8] = ["version", "command", "title", "points", "failed", "threads", "seconds", "peak_memory_bytes"];

/// What people look for first.
pub fn keys(study: &Value) -> Vec<Key> {
    let mut keys = best(study);
    for (key, name) in [("points", "points"), ("failed", "of which failed"), ("solved", "fields solved")] {
        if let Some(count) = study[key].as_u64() {
            keys.push(Key { name: name.to_owned(), cell: Cell::count(count) });
        }
    }
    keys
}

/// What an optimisation found: the objective, and where.
fn best(study: &Value) -> Vec<Key> {
    let row = &study["best"];
    let columns = study["columns"].as_array().map(Vec::as_slice).unwrap_or_default();
    // Between the number of the point and its status stands what was varied.
    let varied = columns.iter().skip(1).map_while(|column| column["name"].as_str().filter(|name| *name != "status"));
    let broken = row["violation"].as_f64().is_some_and(|violation| violation > 0.0);
    let objective = study["objective"].as_str().unwrap_or("objective");
    let title = if broken { format!("{objective}, with constraints broken") } else { format!("best {objective}") };
    let told = |(column, name): (&str, String)| {
        let unit = columns.iter().find(|known| known["name"] == column).and_then(|known| known["unit"].as_str());
        let cell = match &row[column] {
            Value::String(text) => Cell::words(text),
            value => {
                number(value.as_f64()?, row[&format!("{column}_error")].as_f64(), unit.unwrap_or_default()).short()
            }
        };
        Some(Key { name, cell })
    };
    let all = [("objective", title)].into_iter().chain(varied.map(|name| (name, name.to_owned())));
    all.filter_map(told).take(MOST_BEST).collect()
}

/// All tables.
pub fn sections(study: &Value) -> Vec<Section> {
    vec![Section::new("Study", [rows(study), facts(study)])]
}

/// One column for each of the study; a number and its error stand together.
fn rows(study: &Value) -> Table {
    let described = study["columns"].as_array().map(Vec::as_slice).unwrap_or_default();
    let names: Vec<(&str, &str)> = described
        .iter()
        .filter_map(|column| Some((column["name"].as_str()?, column["unit"].as_str().unwrap_or_default())))
        .collect();
    let is_error =
        |name: &str| name.strip_suffix("_error").is_some_and(|of| names.iter().any(|(known, _)| *known == of));
    let all = study["rows"].as_array().map(Vec::as_slice).unwrap_or_default();
    // Columns of reasons and warnings that nobody has would only be in the way.
    let there = |name: &str| all.iter().any(|row| !row[name].is_null());
    let shown: Vec<&(&str, &str)> = names.iter().filter(|(name, _)| !is_error(name) && there(name)).collect();
    let mut table = Table { title: "Points".to_owned(), sortable: true, ..Table::default() };
    let head =
        shown.iter().map(|(name, unit)| if unit.is_empty() { (*name).to_owned() } else { format!("{name} ({unit})") });
    table.head = head.collect();
    for row in all.iter().take(ROWS) {
        let cell = |(name, _): &&(&str, &str)| match &row[name] {
            Value::Number(n) if n.is_u64() || n.is_i64() => Cell { text: n.to_string(), value: Some(n.to_string()) },
            // The unit stands above the column.
            Value::Number(n) => {
                let error = row[&format!("{name}_error")].as_f64();
                n.as_f64().map_or(Cell::default(), |x| number(x, error, ""))
            }
            Value::String(text) => Cell::words(text),
            _ => Cell::default(),
        };
        table.rows.push(shown.iter().map(cell).collect());
    }
    if all.len() > ROWS {
        table.note = format!("The first {ROWS} of {} rows; all are in study.csv.", all.len());
    }
    table
}

/// Whatever else the study says in a word or a number.
fn facts(study: &Value) -> Table {
    let mut table = Table::of_values("About the study");
    for (key, value) in study.as_object().into_iter().flatten().filter(|(key, _)| !KNOWN.contains(&key.as_str())) {
        let cell = match value {
            Value::Number(n) if n.is_u64() => n.as_u64().map(Cell::count),
            Value::Number(n) => n.as_f64().map(bare),
            Value::String(text) => Some(Cell::words(text)),
            _ => None,
        };
        table.put(&key.replace('_', " "), cell);
    }
    table.put("time", study["seconds"].as_f64().map(|t| number(t, None, "s")));
    table.put("threads", study["threads"].as_u64().map(Cell::count));
    table
}
