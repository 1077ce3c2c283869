//! The numbers of `summary.json`.

use serde_json::Value;

use super::numeral::{Cell, exact, grouped, number, place, rough};
use super::table::{Key, Section, Table};
use crate::pipeline::memory::people;

/// Rows and columns of a matrix that are shown.
const ELECTRODES: usize = 12;
/// Ends of flights that are shown.
const ENDS: usize = 200;

/// What people look for first.
pub fn keys(run: &Value) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut put = |name: &str, cell: Cell| keys.push(Key { name: name.to_owned(), cell });
    if let Some(grains) = run["trace"]["grains"].as_u64().filter(|grains| *grains > 0) {
        let flying = run["trace"]["outcomes"]["time_up"].as_u64().unwrap_or(0);
        put("grains still flying at the end", Cell::words(format!("{} of {}", grouped(flying), grouped(grains))));
        if let Some(error) = run["trace"]["position_error_estimate"].as_f64() {
            put("error of their positions", number(error, None, "m").rounded());
        }
    }
    if let Some(error) = run["field_error_estimate"].as_f64() {
        put("relative error of the field", rough(error));
    }
    if let Some(error) = run["table"]["error_estimate"].as_f64() {
        put("relative error of its table", rough(error));
    }
    keys
}

/// All tables.
pub fn sections(run: &Value) -> Vec<Section> {
    vec![
        Section::new("Flights", [flights(run), ends(run), cloud(run)]),
        Section::new("Electrodes", [electrodes(run), capacitances(run)]),
        Section::new("Field", [field(run), table(run)]),
        Section::new("Work", [work(run)]),
    ]
}

fn names(run: &Value) -> Vec<&str> {
    run["electrodes"].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

fn flights(run: &Value) -> Table {
    let mut table = Table::of_values("Grains");
    let trace = &run["trace"];
    if trace["grains"].as_u64().is_none_or(|grains| grains == 0) {
        return table;
    }
    let count = |value: &Value| value.as_u64().map(Cell::count);
    table.put("grains", count(&trace["grains"]));
    let outcomes = &trace["outcomes"];
    table.put("still flying at the end", count(&outcomes["time_up"]));
    for (name, n) in outcomes["struck"].as_object().into_iter().flatten() {
        table.put(&format!("struck {name}"), count(n));
    }
    for (key, name) in [("left_region", "left the region"), ("unstable", "given up as unstable")] {
        table.put(name, count(&outcomes[key]).filter(|cell| cell.value.as_deref() != Some("0")));
    }
    let error = trace["position_error_estimate"].as_f64();
    table.put("estimated error of the final positions", error.map(|error| number(error, None, "m").rounded()));
    table.put("integrator", trace["integrator"].as_str().map(Cell::words));
    table.put("steps of single grains", count(&trace["steps"]));
    table.put("steps tried and rejected", count(&trace["rejected_steps"]));
    table.put("time between samples", trace["every"].as_f64().map(|every| number(every, None, "s")));
    table.put("of which one was kept in", count(&trace["stride"]).filter(|c| c.value.as_deref() != Some("1")));
    table
}

fn ends(run: &Value) -> Table {
    let all = run["trace"]["final"].as_array().map(Vec::as_slice).unwrap_or_default();
    let mut table = Table::with_head("How each flight ended", &["grain", "end", "time", "position", "speed", "energy"]);
    for (grain, end) in all.iter().take(ENDS).enumerate() {
        let outcome = match (end["outcome"].as_str().unwrap_or_default(), end["electrode"].as_str()) {
            (_, Some(electrode)) => format!("struck {electrode}"),
            ("time_up", None) => "still flying".to_owned(),
            (other, None) => other.replace('_', " "),
        };
        let vector =
            |key: &str| -> Vec<f64> { end[key].as_array().into_iter().flatten().filter_map(Value::as_f64).collect() };
        let speed = vector("velocity").iter().map(|v| v * v).sum::<f64>().sqrt();
        let words = Cell::words;
        table.rows.push(vec![
            Cell::count(grain as u64),
            words(outcome),
            end["time"].as_f64().map_or_else(Cell::default, |t| number(t, None, "s")),
            place(&vector("position")),
            number(speed, None, "m/s"),
            end["energy"].as_f64().map_or_else(Cell::default, |e| number(e, None, "J")),
        ]);
    }
    // Energies are told of strikes only.
    if table.rows.iter().all(|row| row[5].text.is_empty()) {
        table.head.pop();
        table.rows.iter_mut().for_each(|row| row.truncate(5));
    }
    if let Some(error) = run["trace"]["position_error_estimate"].as_f64() {
        table.note = format!("Positions within {}.", number(error, None, "m").rounded().text);
    }
    if all.len() > ENDS {
        table.note += &format!(" The first {ENDS} of {}; all are in summary.json.", grouped(all.len() as u64));
    }
    table.sortable = true;
    table.folded = all.len() > 12;
    table
}

fn cloud(run: &Value) -> Table {
    let plasma = &run["trace"]["plasma"];
    let mut table = Table::of_values("The cloud in the last tenth of its flight");
    table.put("grains", plasma["grains"].as_u64().map(Cell::count));
    for (key, name, unit) in [
        ("temperature_kelvin", "kinetic temperature of the secular motion", "K"),
        ("wigner_seitz_radius", "Wigner-Seitz radius", "m"),
        ("nearest_neighbour", "mean distance of nearest neighbours", "m"),
        ("gamma_wigner_seitz", "coupling Γ with the Wigner-Seitz radius", ""),
        ("gamma_nearest_neighbour", "coupling Γ with the distance of neighbours", ""),
    ] {
        table.put(name, plasma[key].as_f64().map(|value| number(value, None, unit)));
    }
    table
}

fn electrodes(run: &Value) -> Table {
    let mut table = Table::with_head("At the start", &["electrode", "voltage", "charge"]);
    let cell =
        |key: &str, k: usize, unit: &str| run[key][k].as_f64().map_or(Cell::default(), |x| number(x, None, unit));
    for (k, name) in names(run).into_iter().enumerate() {
        table.rows.push(vec![Cell::words(name), cell("voltages_at_start", k, "V"), cell("charges_at_start", k, "C")]);
    }
    table.folded = table.rows.len() > ELECTRODES;
    table
}

fn capacitances(run: &Value) -> Table {
    let names = names(run);
    let matrix: Vec<Vec<f64>> = run["capacitance_matrix_farad"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|row| row.as_array().into_iter().flatten().filter_map(Value::as_f64).collect())
        .collect();
    if names.len() > ELECTRODES {
        let mut table = Table::of_values("Capacitance matrix");
        table.put("entries", Cell::words(format!("{0} x {0}, in summary.json", names.len())));
        return table;
    }
    let mut table = Table { title: "Capacitance matrix, Maxwell's form".to_owned(), ..Table::default() };
    table.head = std::iter::once("charge on, with at 1 V").chain(names.iter().copied()).map(str::to_owned).collect();
    // The error is told against the largest entry.
    let largest = matrix.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
    let error = run["error_estimate"].as_f64().map(|error| error * largest);
    for (name, row) in names.iter().zip(&matrix) {
        let cells = row.iter().map(|c| number(*c, error, "F"));
        table.rows.push(std::iter::once(Cell::words(*name)).chain(cells).collect());
    }
    if let Some(error) = run["error_estimate"].as_f64() {
        table.note = format!("Estimated relative error, against the largest entry: {}.", rough(error).text);
    }
    table
}

fn field(run: &Value) -> Table {
    let mut table = Table::of_values("Surface charge");
    let words = |key: &str| run[key].as_str().filter(|text| !text.is_empty()).map(Cell::words);
    let count = |key: &str| run[key].as_u64().map(Cell::count);
    let error = |key: &str| run[key].as_f64().map(rough);
    table.put("relative error of the field in the trap region", error("field_error_estimate"));
    table.put("relative error of the capacitances", error("error_estimate"));
    table.put("estimated by", words("error_estimated_by"));
    table.put("asymmetry of the capacitance matrix", error("capacitance_asymmetry"));
    table.put("solver", words("solver"));
    table.put("chosen because", words("solver_reason"));
    table.put("elements", words("elements"));
    table.put("unknowns", count("unknowns"));
    table.put("panels", count("panels"));
    table
}

fn table(run: &Value) -> Table {
    let of = &run["table"];
    let mut table = Table::of_values("Tabulated potential");
    let error = |key: &str| of[key].as_f64().map(rough);
    table.put("measured relative error", error("error_estimate"));
    table.put("of the potential, V per V", error("potential_error"));
    table.put("of the field", error("field_error"));
    table.put("largest Laplacian", error("laplacian"));
    table.put("largest jump between cells, V per V", error("jump"));
    table.put("nodes", of["nodes"].as_u64().map(Cell::count));
    table.put("memory", of["bytes"].as_u64().map(bytes));
    table.put("largest cells", of["spacing"].as_f64().map(|x| number(x, None, "m")));
    table.put("smallest cells", of["finest_spacing"].as_f64().map(|x| number(x, None, "m")));
    table
}

fn work(run: &Value) -> Table {
    let mut table = Table::of_values("Time and memory");
    for stage in ["mesh", "solve", "table", "trace", "write"] {
        table.put(
            stage,
            run["seconds"][stage].as_f64().map(|t| Cell { text: format!("{t:.2} s"), value: Some(exact(t)) }),
        );
    }
    table.put("threads", run["threads"].as_u64().map(Cell::count));
    table.put("memory at most", run["peak_memory_bytes"].as_u64().filter(|n| *n > 0).map(bytes));
    let reused: Vec<&str> = run["reused"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    table.put("reused from an earlier run", Some(reused.join(", ")).filter(|t| !t.is_empty()).map(Cell::words));
    table
}

fn bytes(number: u64) -> Cell {
    Cell { text: people(number), value: Some(number.to_string()) }
}
