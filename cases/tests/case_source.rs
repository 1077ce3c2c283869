//! Errors found after reading, and what else a case's text is kept for.

use cases::case::{Drive, ElectrodeShape};
use cases::{Case, CaseError, CaseSource, Look};
use meshes::{Shape, Vec3};

const CASE: &str = r#"title = "Two balls"

[[electrode]]
name   = "left"
shape  = "sphere"
radius = "1 cm"
center = ["-1 m", 0, 0]
rf     = "main"

[[electrode]]
name   = "right"
shape  = "sphere"
radius = "1 cm"

[drive.main]
amplitude = "300 V"
frequency = "60 Hz"
"#;

fn read(sets: &[&str]) -> (Case, CaseSource) {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    Case::parse("traps/case.toml", CASE, &sets).unwrap()
}

fn fails(text: &str) -> CaseError {
    Case::parse("case.toml", text, &[]).unwrap_err()
}

#[test]
fn values_are_si() {
    let (case, _) = read(&["electrode.right.dc=-2 kV", "drive.main.phase=90 deg", "electrode.right.axis=x"]);
    let [left, right] = &case.electrodes[..] else { panic!("two electrodes") };
    assert_eq!(left.shape, ElectrodeShape::Shape(Shape::Sphere { radius: 0.01 }));
    assert_eq!(left.placement.center, Vec3::new(-1.0, 0.0, 0.0));
    assert_eq!(right.placement.axis, Vec3::x());
    let Drive::Voltage(waveform) = &left.drive else { panic!("a voltage") };
    // cos(pi / 2) to round-off of the argument, times 300 V
    assert!(waveform.value(0.0).abs() < 1e-13 * 300.0);
    let Drive::Voltage(waveform) = &right.drive else { panic!("a voltage") };
    assert!(waveform.is_constant() && waveform.constant == -2000.0);
}

#[test]
fn later_errors_find_their_line() {
    let (_, source) = read(&["electrode.right.center=[0, 0, \"1 mm\"]"]);
    let at = |key: &str| source.error_at(key, "touches electrode.right", "move one of them");
    let shown = |key: &str| at(key).to_string();
    assert_eq!(shown("electrode.left.center"), "traps/case.toml:7:10: electrode.left.center: touches electrode.right");
    // Not written: at the header of its table.
    assert_eq!(shown("electrode.left.axis"), "traps/case.toml:3:1: electrode.left.axis: touches electrode.right");
    assert_eq!(shown("electrode.2.panels"), "traps/case.toml:10:1: electrode.right.panels: touches electrode.right");
    // Set on the command line.
    let set = at("electrode.right.center");
    assert_eq!(set.set.as_deref(), Some("electrode.right.center=[0, 0, \"1 mm\"]"));
    assert!(set.to_string().starts_with("traps/case.toml, --set 'electrode.right.center=[0, 0, \"1 mm\"]': "));
    assert!(set.report(Look::PLAIN).contains("^^^^^^^^^^^^^^"), "{set:?}");
    // Nowhere at all.
    assert_eq!(shown("field.max_panels"), "traps/case.toml: field.max_panels: touches electrode.right");
}

#[test]
fn entries_without_a_name_are_found_by_the_name_they_are_given() {
    let text = "[[source]]\nkind = \"point\"\ncharge = \"1 e\"\n[[source]]\nkind = \"point\"\ncharge = \"2 e\"\n";
    let sets = ["source.source1.charge=3 e".to_owned()];
    let (case, source) = Case::parse("case.toml", text, &sets).unwrap();
    let names: Vec<&str> = case.sources.iter().map(|source| source.name.as_str()).collect();
    assert_eq!(names, ["source1", "source2"]);
    assert!((case.sources[0].waveform.constant / 1.602_176_634e-19 - 3.0).abs() < 1e-15); // round-off
    assert_eq!(source.error_at("source.source2.charge", "is odd", "").line, Some(6));
}

#[test]
fn long_values_are_shown_by_their_beginning() {
    let points = "[0, 0, 0], ".repeat(40);
    let wire = "[[electrode]]\nname = \"w\"\nshape = \"wire\"\nwire_radius = \"1 mm\"\n";
    let long = fails(&format!("{wire}points = [{points}]\n")).report(Look::PLAIN);
    assert!(long.contains("case.toml:5:") && long.len() < 300, "{long}");
    let lines = points.replace("], ", "],\n");
    let (_, source) =
        Case::parse("case.toml", &format!("{wire}points = [[0, 0, 1],\n{}]\n", &lines[..11]), &[]).unwrap();
    let first = source.error_at("electrode.w.points", "meets itself", "pull it straight").report(Look::PLAIN);
    assert!(first.contains("^^^^^^^^^^^") && !first.contains(" 7 |"), "{first}");
}

#[test]
fn errors_for_programs_have_all_parts() {
    let json = fails("[[electrode]]\nname = \"left\"\nshape = \"sphere\"\nradius = \"2 V\"\n").json();
    assert_eq!(json["error"]["file"], "case.toml");
    assert_eq!((json["error"]["line"].as_u64(), json["error"]["column"].as_u64()), (Some(4), Some(10)));
    assert_eq!(json["error"]["key"], "electrode.left.radius");
    assert_eq!(json["error"]["value"], "\"2 V\"");
    assert_eq!(json["error"]["help"], "V is a unit of voltage");
}

#[test]
fn reports_suit_their_reader() {
    let error = fails("[[electrode]]\nname = \"left\"\nshape = \"sphere\"\nradius = \"2 V\"\n");
    let plain = error.report(Look::PLAIN);
    assert!(plain.is_ascii() && plain.contains("case.toml:4:10"), "{plain}");
    assert!(error.report(Look::TERMINAL).contains("\u{1b}["), "colours");
}

#[test]
fn line_ends_and_byte_order_marks_do_not_matter() {
    let text = format!("\u{feff}{}", CASE.replace('\n', "\r\n"));
    Case::parse("case.toml", &text, &[]).unwrap();
    let error = fails(&text.replace("1 cm", "1 V"));
    assert_eq!((error.line, error.column), (Some(6), Some(10)));
    assert!(!error.report(Look::PLAIN).contains('\r'));
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let missing = Case::read("no/such/case.toml", &[]).unwrap_err();
    assert!(missing.to_string().starts_with("no/such/case.toml: cannot be read: no such file"), "{missing}");
    let folder = Case::read(env!("CARGO_MANIFEST_DIR"), &[]).unwrap_err();
    assert!(folder.report(Look::PLAIN).contains("give the case.toml in it"), "{folder:?}");
}

#[test]
fn parts_change_with_what_they_hold() {
    let parts = |sets: &[&str]| read(sets).0.parts();
    let (base, same) = (parts(&[]), parts(&["title=Other", "electrode.left.radius=10 mm"]));
    assert_eq!(base, same);
    let louder = parts(&["drive.main.amplitude=500 V"]);
    assert_eq!((&base.geometry, &base.table, &base.grains), (&louder.geometry, &louder.table, &louder.grains));
    assert_ne!(base.drives, louder.drives);
    assert_ne!(base.geometry, parts(&["electrode.left.radius=11 mm"]).geometry);
    assert_ne!(base.geometry, parts(&["field.solver=dense"]).geometry);
    assert_ne!(base.table, parts(&["table.accuracy=1e-5"]).table);
    assert_eq!(base.geometry, parts(&["table.accuracy=1e-5"]).geometry);
    assert_ne!(base.grains, parts(&["forces.coulomb=true"]).grains);
}

#[test]
fn a_case_is_stored_as_json() {
    let json = serde_json::to_value(read(&[]).0).unwrap();
    assert_eq!(json["electrodes"][0]["shape"]["shape"]["sphere"]["radius"], 0.01);
    assert_eq!(json["electrodes"][0]["drive"]["voltage"]["parts"][0]["sine"]["frequency"], 60.0);
}
