//! The numbers that a study can report of a case, by name, and what each of them takes.

use meshes::Shape;

use crate::case::{Asked, Case, Drive, ElectrodeShape};

/// What a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// The solved field: always there.
    Field,
    /// Grains that fly.
    Flights,
    /// The grid and plates in its place.
    Grids,
    /// Linear motion at the centre.
    Linear,
    /// The well.
    Well,
    /// Null points next to the centre.
    Nulls,
    /// The circle on which grains gather.
    Annulus,
}

/// Degrees of multipoles that are told.
const DEGREES: usize = field::zonal::HIGHEST;

/// All names there are in a case, in the order in which people would look for them. `struck.` and the like stand for each electrode.
pub fn names(case: &Case) -> Vec<(String, From)> {
    let mut all: Vec<(String, From)> = Vec::new();
    let mut add = |from: From, list: &[&str]| all.extend(list.iter().map(|name| ((*name).to_owned(), from)));
    if !case.grains.is_empty() {
        add(From::Well, &["depth_ev", "depth_v", "minimum_x", "minimum_y", "minimum_z"]);
        add(From::Linear, &["a_x", "a_y", "a_z", "q_x", "q_y", "q_z", "beta_x", "beta_y", "beta_z"]);
        add(From::Linear, &["secular_x", "secular_y", "secular_z"]);
        add(From::Annulus, &["annulus_radius"]);
    }
    add(From::Nulls, &["null_x", "null_y", "null_z", "dc_null_x", "dc_null_y", "dc_null_z"]);
    let grid = |e: &crate::case::Electrode| matches!(e.shape, ElectrodeShape::Shape(Shape::GridPlate { .. }));
    if case.electrodes.iter().any(grid) {
        add(From::Grids, &["pitch", "wire", "open_fraction", "field_deviation_max", "field_deviation_rms"]);
        add(From::Grids, &["A0_shift", "A2_shift", "A4_shift", "delta", "tau", "leakage", "light"]);
        if !case.grains.is_empty() {
            add(From::Flights, &["grains_passed", "grains_caught", "grains_turned"]);
        }
    }
    if !case.grains.is_empty() {
        add(From::Flights, &["grains", "still_flying", "struck", "left_region", "unstable", "steps"]);
        add(From::Flights, &["cloud_x", "cloud_y", "cloud_z", "cloud_radius", "temperature", "gamma_wigner_seitz"]);
        add(From::Flights, &["grain1", "grain2", "grain3", "grain4", "grain5", "table_nodes", "table_error"]);
    }
    for kind in ["", "_static", "_rf"] {
        all.extend((0..=DEGREES).map(|l| (format!("A{l}{kind}"), From::Field)));
    }
    let mut add = |list: &[&str]| all.extend(list.iter().map(|name| ((*name).to_owned(), From::Field)));
    add(&["panels", "unknowns", "capacitance_error", "field_error"]);
    for (n, electrode) in case.electrodes.iter().enumerate() {
        let name = &electrode.name;
        all.push((format!("charge.{name}"), From::Field));
        if matches!(electrode.drive, Drive::Charge(_)) {
            all.push((format!("voltage.{name}"), From::Field));
        }
        let pairs = case.electrodes.iter().skip(n).map(|other| format!("capacitance.{name}.{}", other.name));
        all.extend(pairs.map(|name| (name, From::Field)));
    }
    all
}

/// What a number comes from; `None` where a case has no number of that name.
pub fn origin(names: &[(String, From)], name: &str) -> Option<From> {
    // One name stands for many: struck.left, light.cone, grain1.x, grains_passed_low.
    const MANY: [&str; 7] = ["struck", "light", "grain1", "grain2", "grain3", "grain4", "grain5"];
    let of = |known: &str| {
        name == known && !MANY.contains(&known)
            || name.strip_prefix(known).is_some_and(|rest| {
                MANY.contains(&known) && rest.starts_with('.')
                    || known.starts_with("grains_") && matches!(rest, "_low" | "_high")
            })
    };
    names.iter().find(|(known, _)| of(known)).map(|(_, from)| *from)
}

/// What names take together; `flights`: grains fly in any case.
pub fn asked<'n>(case: &Case, wanted: impl Iterator<Item = &'n str>, flights: bool) -> Asked {
    let known = names(case);
    let mut asked = Asked { flights, ..Asked::OF_SWEEPS };
    for name in wanted {
        match origin(&known, name) {
            Some(From::Flights) => asked.flights = true,
            Some(From::Grids) => asked.grids = true,
            Some(From::Linear) => asked.linear = true,
            Some(From::Well) => asked.well = true,
            Some(From::Nulls) => asked.nulls = true,
            Some(From::Annulus) => asked.annulus = true,
            Some(From::Field) | None => {}
        }
        // Grains are counted where the grid is known.
        asked.grids |= name.starts_with("grains_");
    }
    asked
}

/// The names in a sentence: numbered ones together.
pub fn listed(names: &[(String, From)]) -> String {
    let hidden = |name: &str| {
        let mut rest = name.trim_start_matches('A').chars();
        name.starts_with('A') && rest.next().is_some_and(|c| c.is_ascii_digit() && c != '0') && !name.ends_with("shift")
            || name.starts_with("grain") && name.ends_with(|c: char| c.is_ascii_digit() && c != '1')
    };
    let shown = names.iter().filter(|(name, _)| !hidden(name)).map(|(name, _)| match name.as_str() {
        "A0" | "A0_static" | "A0_rf" => format!("{name} to {}", name.replacen('0', "8", 1)),
        "struck" => "struck.ELECTRODE".to_owned(),
        "light" => "light.cone, light.ANGLEdeg".to_owned(),
        "grain1" => "grain1.x ...".to_owned(),
        _ => name.clone(),
    });
    shown.collect::<Vec<_>>().join(", ")
}
