//! `graintrap analyse` against exact values: multipoles and nulls of reference geometries, closed forms of ideal traps.
//!
//! Half a minute of processor time together.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::harness::{Scratch, contents, graintrap, is_whole};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("no list: {value}")).iter().map(number).collect()
}

/// Analyses a case of this text.
fn analysed(text: &str, more: &[&str]) -> Value {
    let scratch = Scratch::new();
    let (case, out) = (scratch.file("trap.toml", text), scratch.at("out"));
    let mut args = vec!["analyse", &case, "--json", "-o", &out];
    args.extend(more);
    graintrap(&args).done().json()
}

fn shipped(name: &str, more: &[&str]) -> Value {
    let scratch = Scratch::new();
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join(name).join("case.toml");
    let out = scratch.at("out");
    let mut args = vec!["analyse", case.to_str().unwrap(), "--json", "-o", &out];
    args.extend(more);
    let object = graintrap(&args).done().json();
    // What is named is there and whole.
    let found = contents(Path::new(&out));
    for file in object["files"].as_array().unwrap() {
        let name = file.as_str().unwrap();
        assert!(is_whole(name, found.get(name).unwrap_or_else(|| panic!("there is no {name}"))), "{name}");
    }
    for name in ["analysis.json", "analysis_map.svg", "analysis_map.png", "analysis_axes.svg", "analysis_axes.png"] {
        assert!(found.contains_key(name), "{name} is not in {:?}", found.keys());
    }
    object
}

/// The reference geometries (spectral, twelve digits) with voltages `dc`, about their centre.
fn reference_case(case: &Value, dc: &[f64]) -> String {
    let mut text = format!("[analysis]\ncenter = [0, 0, {}]\nnodes = 8000\n", case["inputs"]["centre_z"]);
    for (k, e) in case["inputs"]["electrodes"].as_array().unwrap().iter().enumerate() {
        let shape = match e["type"].as_str() {
            Some("torus") => format!("shape = \"ring\"\nradius = {}\nwire_radius = {}", e["R"], e["a"]),
            Some("disc") => format!("shape = \"disc\"\nradius = {}", e["a"]),
            other => panic!("{other:?}"),
        };
        let _ =
            write!(text, "[[electrode]]\nname = \"e{k}\"\n{shape}\ncenter = [0, 0, {}]\ndc = {:?}\n", e["z"], dc[k]);
    }
    text
}

fn reference() -> Vec<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/composite.json");
    let all: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    all["cases"].as_array().unwrap().clone()
}

/// A_0 ... A_8 of two rings, ring and plate, ring and two plates, with the accuracy that a case has by itself.
#[test]
fn exact_multipoles_of_the_reference_geometries() {
    for case in reference() {
        let excitations = case["outputs"]["excitations"].as_array().unwrap();
        let object = analysed(&reference_case(&case, &numbers(&excitations[0]["V"])), &[]);
        let units: Vec<(Vec<f64>, Vec<f64>)> = object["multipoles"]["electrodes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|e| (numbers(&e["A"]), numbers(&e["error_estimate"])))
            .collect();
        assert!(units.iter().all(|(a, _)| a.len() == 13), "degree 12");
        let radius = number(&object["multipoles"]["radius"]);
        for excitation in excitations {
            let (volts, exact) = (numbers(&excitation["V"]), numbers(&excitation["A_l"]));
            // The largest term on the sphere: what rounding and symmetry make of a zero is small against that.
            let size = (1..9).map(|l| exact[l].abs() * radius.powi(l as i32)).fold(0.0, f64::max);
            for (l, exact) in exact.iter().enumerate() {
                let got: f64 = units.iter().zip(&volts).map(|((a, _), v)| a[l] * v).sum();
                let told: f64 = units.iter().zip(&volts).map(|((_, e), v)| (e[l] * v).abs()).sum();
                // Asked are 1e-3; the generating curves are solved to 1e-7 and better.
                let slack = 1e-6 * exact.abs() + 1e-9 * size / radius.powi(l as i32);
                assert!((got - exact).abs() < slack, "{} {volts:?}: A{l} {got} instead of {exact}", case["id"]);
                // Rounding of twelve digits beside what is told.
                assert!((got - exact).abs() < told + 1e-9 * exact.abs().max(size / radius.powi(l as i32)));
            }
        }
        // The first excitation is what the case drives; a static potential has no source in free space.
        let driven = numbers(&object["multipoles"]["driven"][0]["A"]);
        let exact = numbers(&excitations[0]["A_l"]);
        assert!((driven[2] / exact[2] - 1.0).abs() < 1e-6);
        for null in object["nulls"].as_array().unwrap() {
            let curvatures = numbers(&null["curvatures"]);
            assert!(number(&null["curvature_sum"]).abs() < 1e-9 * curvatures[0].abs(), "{null}");
            assert!(!null["repels_positive_along"].as_array().unwrap().is_empty(), "Earnshaw: {null}");
        }
    }
}

/// Plate and ring at the voltages whose exact fields cancel at z = 0.25: the null is there, A2 = 0.394 per volt on the ring.
#[test]
fn exact_null_of_ring_and_plate() {
    let case = reference().into_iter().find(|c| c["id"] == "ring_and_plate_config1").unwrap();
    let all = case["outputs"]["excitations"].as_array().unwrap();
    let a = |k: usize, l: usize| number(&all[k]["A_l"][l]);
    let plate = -a(0, 1) / a(1, 1);
    let object = analysed(&reference_case(&case, &[1.0, plate]), &[]);
    let nulls = object["nulls"].as_array().unwrap();
    // The field on the axis vanishes twice: physics, section 5.1.
    assert_eq!(nulls.len(), 2, "{nulls:?}");
    let null = nulls.iter().min_by(|a, b| number(&a["position"][2]).total_cmp(&number(&b["position"][2]))).unwrap();
    let position = numbers(&null["position"]);
    // Asked are 1e-4 of the trap's size, 0.25 m; the field is good for 1e-9.
    assert!(position[0].hypot(position[1]) < 1e-8 && (position[2] - 0.25).abs() < 1e-7, "{position:?}");
    let along = 2.0 * (a(0, 2) + plate * a(1, 2));
    assert!((number(&null["curvatures"][0]) / along - 1.0).abs() < 1e-6, "{null}");
    assert!((0.5 * along - 0.394).abs() < 5e-4);
    assert_eq!(null["repels_positive_along"].as_array().unwrap().len(), 2);
}

/// A grain of Q/m = 1 C/kg in an ideal field.
fn ideal(source: &str, forces: &str) -> String {
    format!(
        "[[source]]\nkind = \"quadrupole\"\n{source}\n[[grains]]\ncount = 1\nmass = 1e-13\ncharge = 1e-13\nplace = {{ kind = \"ball\", radius = 1e-3 }}\n[trace]\nduration = 1\n{forces}\n[analysis]\nnodes = 8000\n"
    )
}

fn modes(object: &Value) -> &Vec<Value> {
    object["secular_hz"]["modes"].as_array().unwrap()
}

/// The sets of tables 3 and 4 of the study in the ideal trap: a and q in closed form, β to seven digits (`mathieu.json`), and
/// three ways to the frequencies.
#[test]
fn exact_secular_frequencies_in_the_ideal_trap() {
    for (omega, beta_z, beta_r) in [(1.1, 0.238_335_4, 0.118_221_4), (1.0, 0.291_815_7, 0.143_265_7)] {
        let rf = format!(
            "r0 = 1\ndc = 5e-5\nrf = {{ amplitude = 0.1, frequency = \"{omega} rad/s\", phase = \"180 deg\" }}"
        );
        let object = analysed(&ideal(&rf, ""), &[]);
        let mathieu = &object["mathieu"];
        // The axis of the caps is the stiffest.
        let (a, q) = (numbers(&mathieu["a"]), numbers(&mathieu["q"]));
        let w2 = omega * omega;
        for (got, exact) in
            [(a[0], -4e-4 / w2), (a[1], 2e-4 / w2), (q[0], -0.4 / w2), (q[1], 0.2 / w2), (q[2], 0.2 / w2)]
        {
            assert!((got / exact - 1.0).abs() < 1e-10, "{got} {exact}");
        }
        for (mode, beta) in modes(&object).iter().zip([beta_z, beta_r, beta_r]) {
            let exact = beta * omega / (2.0 * TAU);
            // The seven digits that are quoted.
            assert!((number(&mode["transition"]) / exact - 1.0).abs() < 1e-6, "{mode} {exact}");
            assert!((number(&mode["mathieu"]) / exact - 1.0).abs() < 1e-6, "{mode} {exact}");
            assert!((number(&mode["spectrum"]) / exact - 1.0).abs() < 1e-4, "{mode} {exact}");
            assert_eq!((mode["agree"].as_bool(), mode["held"].as_bool()), (Some(true), Some(true)), "{mode}");
            // Small q: 3 % off at q = 0.4, and said so.
            let small = number(&mode["small_q"]);
            assert!(
                (small / exact - 1.0).abs() < 0.04 && (small - exact).abs() < 1.01 * number(&mode["small_q_error"])
            );
        }
        // Nothing closes the well of a field without electrodes.
        assert_eq!(object["depth_ev"]["opening"], "edge");
    }
}

/// w± = (w_c ± sqrt(w_c² - 2 w_z²))/2 with w_z² = 4 Q U/(m (r0² + 2 z0²)): an ion of mass 40 at 1 T and 1 V in a trap of 5 mm.
#[test]
fn exact_frequencies_of_a_penning_trap() {
    let object = analysed(
        "[[source]]\nkind = \"quadrupole\"\nr0 = \"5 mm\"\ndc = \"-1 V\"\n[[grains]]\ncount = 1\nmass = \"6.6421562664e-26 kg\"\ncharge = \"1 e\"\nplace = { kind = \"points\", points = [[0, 0, 0]] }\n[trace]\nduration = \"1 us\"\n[forces]\nmagnetic_field = [0, 0, \"1 T\"]\n",
        &[],
    );
    let (charge, mass): (f64, f64) = (1.602_176_634e-19, 40.0 * 1.660_539_066_6e-27);
    let (cyclotron, axial) = (charge / mass, (4.0 * charge / mass / (2.0 * 25e-6)).sqrt());
    let root = (cyclotron * cyclotron - 2.0 * axial * axial).sqrt();
    let exact = [0.5 * (cyclotron - root), axial, 0.5 * (cyclotron + root)].map(|w| w / TAU);
    let mut got: Vec<(f64, f64)> =
        modes(&object).iter().map(|m| (number(&m["transition"]), number(&m["spectrum"]))).collect();
    got.sort_by(|a, b| a.0.total_cmp(&b.0));
    for ((transition, spectrum), exact) in got.iter().zip(exact) {
        // The mass unit has ten digits; the flight lasts for a few magnetron turns only.
        assert!((transition / exact - 1.0).abs() < 1e-8, "{transition} {exact}");
        assert!((spectrum / exact - 1.0).abs() < 1e-3, "{spectrum} {exact}");
    }
    assert_eq!(object["secular_hz"]["held"], true);
    assert!(object["mathieu"].is_null() && object["depth_ev"].is_null(), "nothing oscillates and nothing is a minimum");
}

/// The shipped hyperbolic trap against the closed form q_z = 4 Q V / (m r0² Ω²), and the depth D_r = q_r V / 8 at its ring.
#[test]
fn exact_parameters_of_the_hyperbolic_trap() {
    let object = shipped("paul_trap", &["--set", "analysis.nodes=15000"]);
    let omega = TAU * 60.0;
    let exact = 4.0 * 2.37e-2 * 135.0 / (1e-4 * omega * omega);
    let q = numbers(&object["mathieu"]["q"]);
    // Hyperboloids cut off at 2 r0 are the ideal trap to 1e-5.
    assert!((q[0] / exact - 1.0).abs() < 1e-4 && (q[1] / exact + 0.5).abs() < 1e-4, "{q:?} {exact}");
    assert!(numbers(&object["mathieu"]["a"]).iter().all(|a| a.abs() < 1e-12));
    let limit = number(&object["mathieu"]["q_limits"][0][1]);
    assert!((limit - 0.908_046_333_7).abs() < 1e-8, "{limit}");
    for (mode, (beta, other)) in modes(&object)
        .iter()
        .zip(object["mathieu"]["beta"].as_array().unwrap().iter().zip(["spectrum", "spectrum", "spectrum"]))
    {
        let exact = number(beta) * 30.0;
        assert!((number(&mode["transition"]) / exact - 1.0).abs() < 1e-6, "{mode} {exact}");
        assert!((number(&mode[other]) / exact - 1.0).abs() < 1e-3, "{mode} {exact}");
        assert_eq!(mode["agree"], true, "{mode}");
    }
    let depth = &object["depth_ev"];
    let ring = q[1].abs() * 135.0 / 8.0;
    // Extrapolated to the true surface from panels that lie inside of it by a hundredth.
    assert_eq!(depth["opening"], "ring");
    assert!((number(&depth["volts"]) / ring - 1.0).abs() < 2e-3, "{depth} {ring}");
    assert!((number(&depth["value"]) / (number(&depth["joules"]) / 1.602_176_634e-19) - 1.0).abs() < 1e-12);
}

/// Two rings: all three ways to the frequencies, with drag; and q = 4 (Q/m) V A2/W² from the reference's A2.
#[test]
fn exact_parameters_of_two_rings() {
    let object = shipped("two_rings", &[]);
    let case = reference().into_iter().find(|c| c["id"] == "two_equal_tori_fig14").unwrap();
    let a2 = number(&case["outputs"]["excitations"][0]["A_l"][2]);
    let q = numbers(&object["mathieu"]["q"]);
    let exact = 4.0 * 185.0 * a2 / (4.0 * PI).powi(2);
    assert!((q[0] / exact + 1.0).abs() < 1e-6 && (q[1] / exact - 0.5).abs() < 1e-6, "{q:?} {exact}");
    for mode in modes(&object) {
        let (transition, spectrum) = (number(&mode["transition"]), number(&mode["spectrum"]));
        assert!((transition / spectrum - 1.0).abs() < 1e-4, "{mode}");
        assert_eq!((mode["agree"].as_bool(), mode["held"].as_bool()), (Some(true), Some(true)), "{mode}");
        // Half the drag rate.
        assert!((number(&mode["decay_rate"]) - 0.1).abs() < 1e-6, "{mode}");
    }
    assert_eq!(object["depth_ev"]["opening"], "saddle");
    // The well in the middle opens to those beside it where the effective potential on the axis is highest.
    assert!(number(&object["depth_ev"]["point"][0]).abs() > 0.4);
    assert!(number(&object["depth_ev"]["error_estimate"]) < 1e-3 * number(&object["depth_ev"]["value"]));
}

/// Gravity moves a grain off the null by g/ω², and the voltages that are told bring it back.
#[test]
fn law_compensation_brings_a_grain_back() {
    let case = |top: f64, bottom: f64| {
        let cap = |name: &str, z: f64, axis: f64, dc: f64| {
            format!(
                "[[electrode]]\nname = \"{name}\"\nshape = \"disc\"\nradius = \"20 mm\"\ncenter = [0, 0, {z}]\naxis = [0, 0, {axis}]\ndc = {dc:?}\n"
            )
        };
        format!(
            "{}{}[[electrode]]\nname = \"ring\"\nshape = \"ring\"\nradius = \"20 mm\"\nwire_radius = \"2 mm\"\nrf = {{ amplitude = \"600 V\", frequency = \"100 Hz\" }}\n[[grains]]\ncount = 1\nmass = \"1e-13 kg\"\ncharge = \"3e-15 C\"\nplace = {{ kind = \"ball\", radius = \"1 mm\" }}\n[forces]\ngravity = [0, 0, \"-9.81 m/s2\"]\n[trace]\nduration = \"1 s\"\n[analysis]\nnodes = 15000\n",
            cap("top", 0.012, -1.0, top),
            cap("bottom", -0.012, 1.0, bottom)
        )
    };
    let object = analysed(&case(0.0, 0.0), &[]);
    let species = &object["species"][0];
    let offset = &species["offset"];
    let shift = number(&offset["shift"][2]);
    assert!(shift < 0.0, "it sags: {shift}");
    let volts = &offset["compensation"]["volts"];
    assert!(number(&volts["top"]) * number(&volts["bottom"]) < 0.0, "{volts}");
    let back = analysed(&case(number(&volts["top"]), number(&volts["bottom"])), &[]);
    let (before, after) = (number(&species["center"][2]), number(&back["species"][0]["center"][2]));
    // The voltages make the field at the null exactly; to first order nothing is left.
    assert!(after.abs() < 1e-3 * before.abs(), "{before} {after}");
}

/// Wishes: what can be is reached within the limit, what cannot be is said so.
#[test]
fn law_wishes_come_true() {
    let plates = "[[electrode]]\nname = \"left\"\nshape = \"disc\"\nradius = 1\ncenter = [-0.5, 0, 0]\naxis = \"x\"\n[[electrode]]\nname = \"right\"\nshape = \"disc\"\nradius = 1\ncenter = [0.5, 0, 0]\naxis = \"x\"\n[analysis]\nnodes = 8000\ncenter = [0, 0, 0]\n[analysis.wish]\n";
    let asked =
        analysed(&format!("{plates}field = [\"10 V/m\", 0, 0]\nmultipoles = [{{ l = 2, value = 3.0 }}]\n"), &[]);
    let wish = &asked["wish"];
    assert_eq!(wish["reached"], true, "{wish}");
    // The voltages, put on the electrodes, make what was asked for.
    let dc = |name: &str| format!("electrode.{name}.dc={}", number(&wish["volts"][name]));
    let (left, right) = (dc("left"), dc("right"));
    let made = analysed(&format!("{plates}field = [\"10 V/m\", 0, 0]\n"), &["--set", &left, "--set", &right]);
    let a = numbers(&made["multipoles"]["driven"][0]["A"]);
    assert!((a[1] + 10.0).abs() < 1e-4 && (a[2] - 3.0).abs() < 1e-4, "{a:?}");
    // Round electrodes make no field across their axis, and a limit is a limit.
    let limited = analysed(&format!("{plates}field = [\"10 V/m\", \"5 V/m\", 0]\nlimit = \"2 V\"\n"), &[]);
    let verdicts: Vec<&str> =
        limited["wish"]["wanted"].as_array().unwrap().iter().map(|w| w["verdict"].as_str().unwrap()).collect();
    assert_eq!(verdicts, ["beyond the limit", "not with these electrodes", "reached"]);
    assert_eq!(limited["wish"]["at_limit"].as_array().unwrap().len(), 2);
    assert!((number(&limited["wish"]["volts"]["left"]) - 2.0).abs() < 1e-12);
}

/// The edges of a chart's row that is nearest to a value of y.
fn edges(chart: &Value, y: f64, list: &str) -> Vec<f64> {
    let rows = chart["rows"].as_array().unwrap();
    let away = |row: &Value| (number(&row["y"]) - y).abs();
    numbers(&rows.iter().min_by(|a, b| away(a).total_cmp(&away(b))).unwrap()[list])
}

/// The chart of an ideal trap: ejection at q = 0.908046 where a = 0, and at the tip of the region no q is stable; grains leave where
/// the linear motion does, as there is no other.
#[test]
fn exact_chart_of_the_ideal_trap() {
    let rf = "r0 = 1\ndc = 5e-5\nrf = { amplitude = 0.1, frequency = \"1 rad/s\", phase = \"180 deg\" }";
    let chart = "[analysis.chart]\nx = { key = \"q\", from = 0, to = 1.4, steps = 71 }\ny = { key = \"a\", from = -0.7, to = 0.3, steps = 51 }\ngrains = { steps = 8, periods = 150 }\n";
    let object = analysed(&(ideal(rf, "") + chart), &[]);
    let chart = &object["chart"];
    let edge = |y: f64, list: &str| *edges(chart, y, list).last().unwrap();
    for list in ["edges", "ideal_edges"] {
        // Straight between values 0.02 apart, of a half trace whose bend there is about 1: 0.02²/8 of q.
        assert!((edge(0.0, list) - 0.908_046).abs() < 2e-4, "{}", edge(0.0, list));
        assert!(edges(chart, -0.7, list).is_empty(), "below the tip at a = -0.671");
    }
    // At a = 0 and q = 0 nothing acts at all: on which side that is, rounding tells.
    for row in chart["rows"].as_array().unwrap().iter().filter(|row| number(&row["y"]).abs() > 1e-9) {
        let (own, ideal) = (numbers(&row["edges"]), numbers(&row["ideal_edges"]));
        assert_eq!(own.len(), ideal.len(), "{row}");
        // One field, two ways: a matrix of six by steps of order four, half a trace on each axis.
        assert!(own.iter().zip(&ideal).all(|(a, b)| (a - b).abs() < 1e-4), "{row}");
    }
    let grains = chart["traced"].as_array().unwrap();
    let stay = grains.iter().filter(|g| g["outcome"] == "retained").count();
    assert!(grains.len() == 64 && stay > 5 && stay < 40, "{stay}");
    assert!(grains.iter().all(|g| g["outcome"] == "retained" || g["point"].is_array()));
    // A grain next to the edge grows too slowly to be lost in time, or is told by the nearest value: of 64 a few.
    let wrong = number(&chart["retained_beyond_the_edge"]) + number(&chart["lost_before_the_edge"]);
    assert!(wrong <= 4.0, "{wrong} of 64 stand on the other side");
}

/// The chart of real electrodes: the cut-off hyperbolic trap ejects between 135 V (q = 0.9) and 137.2 V (0.915), in linear motion,
/// as an ideal trap of its curvatures does.
#[test]
fn chart_of_the_hyperbolic_trap() {
    let scratch = Scratch::new();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("paul_trap/case.toml");
    let text = std::fs::read_to_string(path).unwrap()
        + "[analysis]\nnodes = 8000\n[analysis.chart]\nx = { key = \"drive.main.amplitude\", from = \"100 V\", to = \"150 V\", steps = 26 }\ny = { key = \"electrode.ring.dc\", from = \"-4 V\", to = \"4 V\", steps = 9 }\n";
    let (case, out) = (scratch.file("trap.toml", &text), scratch.at("out"));
    let object = graintrap(&["analyse", &case, "--json", "-o", &out]).done().json();
    let chart = &object["chart"];
    let own = *edges(chart, 0.0, "edges").last().unwrap();
    assert!(own > 135.0 && own < 137.2, "{own} V");
    // q is proportional to the voltage: the limit over q at the case's 135 V.
    let q = numbers(&object["mathieu"]["q"]).iter().fold(0.0_f64, |m, q| m.max(q.abs()));
    // Straight between values 2 V apart: 1e-4 of the voltage.
    assert!((own / (135.0 * 0.908_046 / q) - 1.0).abs() < 3e-4, "{own} V, q {q}");
    let found = contents(Path::new(&out));
    for name in ["stability_chart.svg", "stability_chart.png", "stability_chart.csv"] {
        assert!(is_whole(name, found.get(name).unwrap_or_else(|| panic!("there is no {name}"))), "{name}");
    }
    let rows = String::from_utf8(found["stability_chart.csv"].clone()).unwrap();
    assert_eq!(rows.lines().count(), 1 + 26 * 9);
}
