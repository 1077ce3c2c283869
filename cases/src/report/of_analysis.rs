//! The numbers of `analysis.json`.

use serde_json::Value;

use super::numeral::{Cell, bare, number, place, rough};
use super::table::{Key, Section, Table};

/// Multipoles that are shown, from A_0 on.
const DEGREES: usize = 9;
/// Null points, critical points and electrodes that are shown of each kind.
const LISTED: usize = 20;
const ALL: &str = "More are in analysis.json.";

/// What people look for first: of the first group of grains.
pub fn keys(analysis: &Value) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut put = |name: &str, value: f64, error: Option<f64>, unit: &str| {
        // Six digits at most: this is a glance.
        let error = error.map(|error| error.max(1e-6 * value.abs()));
        keys.push(Key { name: name.to_owned(), cell: number(value, error, unit).short() });
    };
    let mathieu = &analysis["mathieu"];
    let largest = list(&mathieu["q"]).into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    if let Some(q) = largest {
        put("largest q of Mathieu's equation", q, mathieu["error_estimate"].as_f64(), "");
    }
    let modes = analysis["secular_hz"]["modes"].as_array().map(Vec::as_slice).unwrap_or_default();
    if let (Some(low), Some(high)) = (modes.last(), modes.first())
        && analysis["secular_hz"]["held"].as_bool() == Some(true)
    {
        for (name, mode) in [("lowest secular frequency", low), ("highest secular frequency", high)] {
            if let Some(f) = mode["transition"].as_f64() {
                put(name, f, mode["transition_error"].as_f64(), "Hz");
            }
        }
    }
    if let Some(volts) = analysis["depth_ev"]["volts"].as_f64() {
        put("depth of the well", volts, None, "V");
    }
    keys
}

/// All tables.
pub fn sections(analysis: &Value) -> Vec<Section> {
    let mut sections = vec![Section::new("Field analysis", [center(analysis), nulls(analysis), multipoles(analysis)])];
    for species in analysis["species"].as_array().into_iter().flatten() {
        let name = species["name"].as_str().unwrap_or("grains");
        let tables = [about(species), mathieu(species), secular(species), well(species), effective(species)];
        sections.push(Section::new(&format!("The trap for {name}"), tables));
    }
    sections.push(Section::new("Voltages for a wish", [wish(&analysis["wish"]), wanted(&analysis["wish"])]));
    sections.push(Section::new("Chart of stability", [chart(&analysis["chart"])]));
    sections
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

fn words(value: &Value) -> Option<Cell> {
    value.as_str().filter(|text| !text.is_empty()).map(Cell::words)
}

fn point(value: &Value) -> Option<Cell> {
    Some(list(value)).filter(|p| p.len() == 3).map(|p| place(&p))
}

/// A direction.
fn direction(value: &Value) -> Cell {
    let shown = |x: f64| if x.abs() < 5e-4 { "0".to_owned() } else { format!("{x:.3}").replace('-', "\u{2212}") };
    Cell::words(format!("({})", list(value).into_iter().map(shown).collect::<Vec<_>>().join(", ")))
}

fn yes(value: &Value) -> Cell {
    Cell::words(if value.as_bool() == Some(true) { "yes" } else { "no" })
}

fn center(analysis: &Value) -> Table {
    let mut table = Table::of_values("What it is about");
    table.put("centre", point(&analysis["center"]));
    table.put("which is", words(&analysis["center_is"]));
    table.put("axis", Some(&analysis["axis"]).filter(|axis| axis.is_array()).map(direction));
    table.put("relative error of the field", analysis["field_error_estimate"].as_f64().map(rough));
    table
}

fn nulls(analysis: &Value) -> Table {
    let head = ["field", "kind", "position", "within", "curvatures of the potential (V/m²)", "potential"];
    let mut table = Table::with_head("Null points", &head);
    let all = analysis["nulls"].as_array().map(Vec::as_slice).unwrap_or_default();
    for null in all.iter().take(LISTED) {
        let error = null["curvature_error_estimate"].as_f64();
        let curvatures = list(&null["curvatures"]).into_iter().map(|c| number(c, error, "").short().text);
        let many =
            if null["one_of_many"].as_bool() == Some(true) { ", one of a line or ring of such points" } else { "" };
        table.rows.push(vec![
            words(&null["of"]).unwrap_or_default(),
            Cell::words(format!("{}{many}", null["kind"].as_str().unwrap_or_default())),
            point(&null["position"]).unwrap_or_default(),
            null["error_estimate"].as_f64().map_or(Cell::default(), |e| number(e, None, "m").rounded()),
            Cell::words(curvatures.collect::<Vec<_>>().join(", ")),
            null["potential"].as_f64().map_or(Cell::default(), |v| number(v, None, "V")),
        ]);
    }
    table.note = if all.len() > LISTED { ALL.to_owned() } else { String::new() };
    table
}

fn multipoles(analysis: &Value) -> Table {
    let all = &analysis["multipoles"];
    let mut table = Table { title: "Multipoles of φ = Σ Aₗ rˡ Pₗ(cos θ)".to_owned(), ..Table::default() };
    let of = |key: &str| all[key].as_array().cloned().unwrap_or_default();
    let electrodes = of("electrodes");
    let rows: Vec<(Value, &str)> = electrodes
        .iter()
        .take(LISTED)
        .cloned()
        .map(|unit| (unit, " at 1 V"))
        .chain(of("driven").into_iter().map(|unit| (unit, ", driven")))
        .collect();
    let degrees = rows.iter().map(|(unit, _)| list(&unit["A"]).len()).max().unwrap_or(0).min(DEGREES);
    let name = |(unit, what): &(Value, &str)| format!("{}{what}", unit["name"].as_str().unwrap_or_default());
    table.head = std::iter::once("l".to_owned()).chain(rows.iter().map(name)).collect();
    for l in 0..degrees {
        // What is below its error is shown as zero within it.
        let cell = |(unit, _): &(Value, &str)| {
            let (Some(a), error) = (unit["A"][l].as_f64(), unit["error_estimate"][l].as_f64()) else {
                return Cell::default();
            };
            let shown = if error.is_some_and(|error| a.abs() <= error) { 0.0 } else { a };
            Cell { value: bare(a).value, ..number(shown, error, "") }
        };
        table.rows.push(std::iter::once(Cell::words(format!("A{l}"))).chain(rows.iter().map(cell)).collect());
    }
    let radius = all["radius"].as_f64().map_or(String::new(), |r| number(r, None, "m").text);
    table.note = format!("Found on a sphere of {radius}; 1/mˡ for electrodes, V/mˡ for what is driven.");
    table
}

fn about(species: &Value) -> Table {
    let mut table = Table::of_values("Grains");
    for (key, name, unit) in [("charge", "charge", "C"), ("mass", "mass", "kg"), ("drag_rate", "drag rate", "1/s")] {
        table.put(name, species[key].as_f64().map(|x| number(x, None, unit)));
    }
    table.put("everything is about", point(&species["center"]));
    table.put("which is", words(&species["center_is"]));
    table
}

fn mathieu(species: &Value) -> Table {
    let of = &species["mathieu"];
    let mut table = Table::with_head("Mathieu's parameters", &["axis", "a", "q", "β", "stable for |q|", "stable"]);
    let error = of["error_estimate"].as_f64();
    for k in 0..of["axes"].as_array().map_or(0, Vec::len) {
        let at = |key: &str| of[key][k].as_f64();
        let limits = match (of["q_limits"][k][0].as_f64(), of["q_limits"][k][1].as_f64()) {
            (None, None) => String::new(),
            (low, Some(high)) => format!("{:.4} to {high:.6}", low.unwrap_or(0.0)),
            (Some(low), None) => format!("from {low:.4}"),
        };
        table.rows.push(vec![
            direction(&of["axes"][k]),
            at("a").map_or(Cell::default(), |a| number(a, error, "")),
            at("q").map_or(Cell::default(), |q| number(q, error, "")),
            at("beta").map_or(Cell::words("none"), bare),
            Cell::words(limits),
            yes(&of["stable"][k]),
        ]);
    }
    if let (Some(coupling), Some(k)) = (of["coupling"].as_f64(), of["k"].as_f64()) {
        table.note = format!("Coupling of the axes {}; γ/Ω {}.", rough(coupling).text, bare(k).text);
    }
    table
}

fn secular(species: &Value) -> Table {
    let head = ["along", "transition matrix", "small q", "spectrum of a flight", "decay (1/s)", "held", "agree"];
    let mut table = Table::with_head("Secular frequencies", &head);
    for mode in species["secular_hz"]["modes"].as_array().into_iter().flatten() {
        let with = |key: &str, error: &str| {
            mode[key].as_f64().map_or(Cell::default(), |f| number(f, mode[error].as_f64(), "Hz"))
        };
        table.rows.push(vec![
            direction(&mode["axis"]),
            with("transition", "transition_error"),
            with("small_q", "small_q_error"),
            with("spectrum", "spectrum_error"),
            mode["decay_rate"].as_f64().map_or(Cell::default(), bare),
            yes(&mode["held"]),
            yes(&mode["agree"]),
        ]);
    }
    table
}

fn well(species: &Value) -> Table {
    let mut table = Table::of_values("Well");
    let depth = &species["depth_ev"];
    table.put("depth", depth["value"].as_f64().map(|x| number(x, depth["error_estimate"].as_f64(), "eV")));
    table.put("for the charge that is", depth["volts"].as_f64().map(|x| number(x, None, "V")));
    let opening = match depth["opening"].as_str() {
        Some("saddle") => Some("over a saddle".to_owned()),
        Some("edge") => Some("at the edge of the box that was searched: it may be deeper".to_owned()),
        Some(name) => Some(format!("at the electrode {name}")),
        None => None,
    };
    table.put("it opens", opening.map(Cell::words));
    table.put("there", point(&depth["point"]));
    table.put("adiabaticity", species["adiabaticity"].as_f64().map(bare));
    table.put(
        "micromotion at the equilibrium",
        species["micromotion"]["at_equilibrium"].as_f64().map(|x| number(x, None, "m")),
    );
    table.put("gravity and constant forces shift it by", point(&species["offset"]["shift"]));
    table.put("1 V/m of stray field along each axis shifts it by", point(&species["offset"]["per_field"]));
    let volts = species["offset"]["compensation"]["volts"].as_object().into_iter().flatten();
    for (name, v) in volts {
        table.put(&format!("to bring it back, add to {name}"), v.as_f64().map(|v| number(v, None, "V")));
    }
    table
}

fn effective(species: &Value) -> Table {
    let mut table = Table::with_head(
        "Minima and saddles of the effective potential",
        &["kind", "position", "within", "above the centre"],
    );
    let all = species["effective"].as_array().map(Vec::as_slice).unwrap_or_default();
    for one in all.iter().take(LISTED) {
        let many = if one["one_of_many"].as_bool() == Some(true) { ", one of a line or ring" } else { "" };
        table.rows.push(vec![
            Cell::words(format!("{}{many}", one["kind"].as_str().unwrap_or_default())),
            point(&one["position"]).unwrap_or_default(),
            one["error_estimate"].as_f64().map_or(Cell::default(), |e| number(e, None, "m").rounded()),
            one["volts"].as_f64().map_or(Cell::default(), |v| number(v, None, "V")),
        ]);
    }
    table.note = if all.len() > LISTED { ALL.to_owned() } else { String::new() };
    table
}

fn wish(wish: &Value) -> Table {
    let mut table = Table::with_head("Constant voltages", &["electrode", "voltage", ""]);
    let limit: Vec<&str> = wish["at_limit"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    for (name, volts) in wish["volts"].as_object().into_iter().flatten() {
        let at_limit = if limit.contains(&name.as_str()) { "at the limit" } else { "" };
        let volts = volts.as_f64().map_or(Cell::default(), |v| number(v, None, "V"));
        table.rows.push(vec![Cell::words(name), volts, Cell::words(at_limit)]);
    }
    table
}

fn wanted(wish: &Value) -> Table {
    let mut table = Table::with_head("What was asked for (V/mˡ)", &["what", "wanted", "got", "verdict"]);
    for one in wish["wanted"].as_array().into_iter().flatten() {
        table.rows.push(vec![
            words(&one["what"]).unwrap_or_default(),
            one["wanted"].as_f64().map_or(Cell::default(), bare),
            one["got"].as_f64().map_or(Cell::default(), |x| number(x, one["error_estimate"].as_f64(), "")),
            words(&one["verdict"]).unwrap_or_default(),
        ]);
    }
    table
}

fn chart(chart: &Value) -> Table {
    let mut table = Table::of_values("Traced grains");
    let count = |key: &str| chart[key].as_u64().map(Cell::count);
    let traced = chart["traced"].as_array().map_or(0, Vec::len);
    if traced == 0 {
        return table;
    }
    table.put("traced", Cell::count(traced as u64));
    table.put("started off the centre by", chart["distance"].as_f64().map(|x| number(x, None, "m")));
    table.put("stayed", count("retained"));
    table.put("stayed where the linear motion does not", count("retained_beyond_the_edge"));
    table.put("lost where the linear motion stays", count("lost_before_the_edge"));
    table
}
