//! The JSON Schema of the case file, judged by a validator.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/cli").join(name)
}

/// The case files of a folder as JSON; those that are not TOML are left out, and those changed by `--set`.
fn instances(name: &str) -> Vec<(String, Value)> {
    let mut paths: Vec<PathBuf> = fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if text.contains("#! set:") { None } else { Some((name, toml::from_str(&text).ok()?)) }
    };
    paths.into_iter().filter_map(read).collect()
}

#[test]
fn schema_accepts_what_the_reader_accepts() {
    let schema = cases::schema();
    jsonschema::meta::validate(&schema).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let good = instances("good");
    assert!(good.len() >= 12, "{} good cases", good.len());
    for (name, case) in good {
        if let Err(error) = validator.validate(&case) {
            panic!("{name} at {}: {error}", error.instance_path());
        }
    }
}

/// What only the reader can refuse: rules between keys, units, other files, and numbers that JSON has no words for.
const BEYOND_A_SCHEMA: &str = "\
    analysis_chart_backwards analysis_chart_no_grains analysis_chart_q_alone analysis_chart_radius analysis_chart_unknown_electrode \
    analysis_order analysis_multipole_m analysis_wish_of_nothing analysis_wish_electrode analysis_wish_in_volts amplitude_in_coulombs axis_without_direction disc_hole_too_large drive_circle drive_is_a_voltage drive_phase_of_ramp \
    drive_unknown drive_unknown_in_table field_too_many_panels \
    grains_box_inside_out grains_count_missing grains_count_of_points grains_density_of_points \
    grains_file_and_speed grains_file_columns grains_file_empty grains_file_folder grains_file_letters grains_file_semicolons \
    grains_file_short_row grains_names grid_holes_and_wires grid_holes_merge grid_no_outline grid_of_nothing \
    grid_pitch_too_large grid_wire_radius_of_holes grid_wires_touch hyperbola_cut_off integrator_langevin_alone \
    langevin_not_followed drag_of_points mesh_format mesh_missing mesh_unit \
    name_taken_by_source name_of_the_ground ground_without_direction names_taken opening_half_turn opening_in_degrees region_inside_out ring_too_thick rod_too_short \
    samples_backwards samples_missing samples_nan source_caps_in_two_dimensions source_driven_by_volts \
    source_uniform_in_volts sweep_units_differ sweep_unknown_electrode table_inside_out table_spacing up_along_axis \
    wire_point_twice temperature_below_zero opening_zero quantity_trailing sweep_of_nothing sweep_zip sweep_without_samples sweep_without_steps sweep_endless study_grazing \
    study_unknown_number study_not_a_formula study_constant_objective study_without_objective study_varies_nothing study_empty_bounds \
    study_start_outside study_start_in_another_unit study_step_too_wide study_log_through_zero study_name_of_nothing \
    study_tie_of_nothing study_tied_and_varied study_no_constraint study_constraint_on_nothing study_too_few_evaluations \
    study_too_many_evaluations study_objective_of_a_sweep study_sweeps_too \
    drag_unit frequency_in_seconds quantity_overflow source_without_strength table_memory temperature_in_coulombs \
    unit_of_another_kind unit_unknown unit_wrong_case vector_with_wrong_unit";

#[test]
fn schema_refuses_what_it_can() {
    let validator = jsonschema::validator_for(&cases::schema()).unwrap();
    let beyond: BTreeSet<&str> = BEYOND_A_SCHEMA.split_whitespace().collect();
    let mut wrong = Vec::new();
    for (name, case) in instances("bad") {
        let name = name.trim_end_matches(".toml");
        if validator.is_valid(&case) != beyond.contains(name) {
            wrong.push(name.to_owned());
        }
    }
    assert!(wrong.is_empty(), "the list and the schema disagree about {wrong:?}");
}

/// Keys of tables, each with the kind of table it stands in.
type Keys = BTreeSet<(String, String)>;

fn kind_of(table: &serde_json::Map<String, Value>, name: impl Fn(&Value) -> Option<String>) -> String {
    ["shape", "kind", "model"].into_iter().find_map(|tag| name(table.get(tag)?)).unwrap_or_default()
}

fn keys_in_schema(schema: &Value, keys: &mut Keys) {
    match schema {
        Value::Object(table) => {
            if let Some(properties) = table.get("properties").and_then(Value::as_object) {
                let kind = kind_of(properties, |tag| Some(tag["const"].as_str()?.to_owned()));
                keys.extend(properties.keys().map(|key| (kind.clone(), key.clone())));
            }
            table.values().for_each(|value| keys_in_schema(value, keys));
        }
        Value::Array(list) => list.iter().for_each(|value| keys_in_schema(value, keys)),
        _ => {}
    }
}

fn keys_in_case(case: &Value, keys: &mut Keys) {
    match case {
        Value::Object(table) => {
            let kind = kind_of(table, |tag| Some(tag.as_str()?.to_owned()));
            keys.extend(table.keys().map(|key| (kind.clone(), key.clone())));
            table.values().for_each(|value| keys_in_case(value, keys));
        }
        Value::Array(list) => list.iter().for_each(|value| keys_in_case(value, keys)),
        _ => {}
    }
}

#[test]
fn good_cases_use_every_key() {
    let (mut known, mut used) = (Keys::new(), Keys::new());
    keys_in_schema(&cases::schema(), &mut known);
    instances("good").iter().for_each(|(_, case)| keys_in_case(case, &mut used));
    // The kind of a study has no keys of its own.
    let kinds: BTreeSet<String> = known.iter().map(|(kind, _)| kind.clone()).collect();
    let of = |kind: String| if kinds.contains(&kind) { kind } else { String::new() };
    let used: Keys = used.into_iter().map(|(kind, key)| (of(kind), key)).collect();
    // Every electrode and source takes the common keys; that each shape has been seen with each of them is not asked.
    let common = ["center", "axis", "up", "dc", "rf", "charge", "hollow", "panels", "name"];
    let unused: Vec<_> = known.difference(&used).filter(|(_, key)| !common.contains(&key.as_str())).collect();
    assert!(unused.is_empty(), "no good case has {unused:?}");
}
