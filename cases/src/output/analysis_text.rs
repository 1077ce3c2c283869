//! An analysis for people.

use std::fmt::Write as _;
use std::path::Path;

use super::summary::metres;
use crate::pipeline::analysis::report::{ChartReport, Null, Report, Species, UnitMultipoles, WishReport};

/// Points that are listed of each kind; all are in the file.
const LISTED: usize = 8;

/// The analysis as a text for a terminal.
pub fn text(report: &Report, folder: &Path) -> String {
    let mut text = format!("{}\n", report.title);
    let mut head = |label: &str, words: String| {
        let _ = writeln!(text, "{label:<12} {words}");
    };
    head("centre", format!("{}: {}", place(&report.center), report.center_is));
    head("field", format!("estimated error {:.0e}", report.field_error_estimate));
    if report.nulls.is_empty() {
        head("nulls", "none in the box that was searched".to_owned());
    }
    for (n, null) in report.nulls.iter().take(LISTED).enumerate() {
        head(if n == 0 { "nulls" } else { "" }, self::null(null));
    }
    more(&mut text, report.nulls.len());
    multipoles(&mut text, report);
    report.species.iter().for_each(|one| species(&mut text, one));
    if let Some(found) = &report.wish {
        wish(&mut text, found);
    }
    if let Some(found) = &report.chart {
        chart(&mut text, found);
    }
    for warning in &report.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    let _ = writeln!(text, "{:<12} {:.2} s", "time", report.seconds);
    let _ = writeln!(text, "{:<12} {}: {}", "files", folder.display(), report.files.join(", "));
    text
}

fn more(text: &mut String, count: usize) {
    if count > LISTED {
        let _ = writeln!(text, "{:<12} ... {} more in analysis.json", "", count - LISTED);
    }
}

/// A place in the unit of its largest coordinate.
fn place(p: &[f64; 3]) -> String {
    let largest = p.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let (factor, unit) = match largest {
        l if l < 1e-9 => return "(0, 0, 0)".to_owned(),
        l if l < 1e-4 => (1e6, "um"),
        l if l < 0.1 => (1e3, "mm"),
        _ => (1.0, "m"),
    };
    // Rounding is no coordinate.
    let [x, y, z] = p.map(|x| if x.abs() < 1e-9 * largest.max(1e-3) { 0.0 } else { factor * x });
    let number = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.6}") };
    format!("({}, {}, {}) {unit}", number(x), number(y), number(z))
}

fn null(null: &Null) -> String {
    let [a, b, c] = null.curvatures;
    let many = if null.one_of_many { ", one of a line or ring of such points" } else { "" };
    format!(
        "{} at {} within {}: {}{many}; curvatures {a:.5e}, {b:.5e}, {c:.5e} V/m2, their sum {:.0e}",
        null.of,
        place(&null.position),
        metres(null.error_estimate),
        null.kind,
        null.curvature_sum
    )
}

fn multipoles(text: &mut String, report: &Report) {
    let all = &report.multipoles;
    let [x, y, z] = report.axis;
    let _ = writeln!(
        text,
        "multipoles   about the axis ({x:.3}, {y:.3}, {z:.3}) on a sphere of {}; A_l r^l P_l, 1/m^l per volt",
        metres(all.radius)
    );
    let shown = all.order.min(8);
    let width = all.electrodes.iter().chain(&all.driven).map(|e| e.name.chars().count()).max().unwrap_or(0).max(8);
    let header: String = (0..=shown).map(|l| format!(" {:>13}", format!("A{l}"))).collect();
    let _ = writeln!(text, "{:<12} {:width$}{header}  not round", "", "");
    let row = |text: &mut String, unit: &UnitMultipoles, what: &str| {
        // What is below its error is written as zero.
        let clean = |(a, e): (&f64, &f64)| if a.abs() <= *e { 0.0 } else { *a };
        let numbers: String = unit
            .a
            .iter()
            .zip(&unit.error_estimate)
            .take(shown + 1)
            .map(clean)
            .map(|a| format!(" {a:>13.5e}"))
            .collect();
        let _ = writeln!(text, "{what:<12} {:width$}{numbers}  {:.0e}", unit.name, unit.roughness);
    };
    all.electrodes.iter().take(2 * LISTED).for_each(|unit| row(text, unit, ""));
    all.driven.iter().for_each(|unit| row(text, unit, "  driven (V)"));
}

fn species(text: &mut String, one: &Species) {
    let mut line = |label: &str, words: String| {
        let _ = writeln!(text, "{label:<12} {words}");
    };
    line(
        "grains",
        format!(
            "{}: {:.4e} C, {:.4e} kg ({:.4e} C/kg), drag rate {:.4e} /s",
            one.name,
            one.charge,
            one.mass,
            one.charge / one.mass,
            one.drag_rate
        ),
    );
    line("  about", format!("{}: {}", place(&one.center), one.center_is));
    for point in one.effective.iter().take(LISTED) {
        let many = if point.one_of_many { ", one of a line or ring" } else { "" };
        line("", format!("{} at {}, {:+.5e} V{many}", point.kind, place(&point.position), point.volts));
    }
    more(text, one.effective.len());
    let mut line = |label: &str, words: String| {
        let _ = writeln!(text, "{label:<12} {words}");
    };
    if let Some(m) = &one.mathieu {
        for k in 0..3 {
            let [x, y, z] = m.axes[k];
            let beta = m.beta[k].map_or("no beta: unstable without drag".to_owned(), |b| format!("beta {b:.6}"));
            let limits = match m.q_limits[k] {
                Some([low, high]) => format!(
                    "stable for |q| from {:.4} to {}",
                    low.unwrap_or(0.0),
                    high.map_or("40 and beyond".to_owned(), |q| format!("{q:.6}"))
                ),
                None => "UNSTABLE".to_owned(),
            };
            let label = if k == 0 { "  a and q" } else { "" };
            line(label, format!("({x:+.3}, {y:+.3}, {z:+.3}): a {:+.6e}, q {:+.6}, {beta}, {limits}", m.a[k], m.q[k]));
        }
        line("", format!("error {:.0e}, coupling {:.0e}, gamma/Omega {:.3e}", m.error_estimate, m.coupling, m.k));
    }
    if let Some(s) = &one.secular_hz {
        line(
            "  secular Hz",
            format!(
                "{:>13} {:>9} {:>13} {:>13} {:>9} {:>10}",
                "transition", "+-", "small q", "spectrum", "+-", "decay 1/s"
            ),
        );
        let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.7e}"));
        let error = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.0e}"));
        for mode in &s.modes {
            let [x, y, z] = mode.axis;
            let agree = match (mode.held, mode.agree) {
                (false, _) => "  NOT HELD",
                (true, true) => "",
                (true, false) => "  DISAGREE",
            };
            line(
                "",
                format!(
                    "{:>13.7e} {:>9.0e} {:>13} {:>13} {:>9} {:>10.2e}  ({x:+.3}, {y:+.3}, {z:+.3}){agree}",
                    mode.transition,
                    mode.transition_error,
                    number(mode.small_q),
                    number(mode.spectrum),
                    error(mode.spectrum_error),
                    mode.decay_rate
                ),
            );
        }
    }
    if let Some(d) = &one.depth_ev {
        let opening = match d.opening.as_str() {
            "saddle" => "opens over a saddle".to_owned(),
            "edge" => "and more: up to the edge of the box that was searched".to_owned(),
            name => format!("opens at the electrode `{name}`"),
        };
        line(
            "  depth",
            format!(
                "{:.5e} V = {:.5e} J = {:.5e} eV within {:.0e} eV, {opening} at {}",
                d.volts,
                d.joules,
                d.value,
                d.error_estimate,
                place(&d.point)
            ),
        );
    }
    if let Some(eta) = one.adiabaticity {
        let words =
            if eta < 0.3 { "the effective potential is good" } else { "above 0.3 the effective potential is rough" };
        line("  adiabatic", format!("{eta:.4}: {words}"));
    }
    if let Some(m) = &one.micromotion {
        let [a, b, c] = m.per_distance;
        let here = m.at_equilibrium.map_or(String::new(), |x| format!("{} at the equilibrium, ", metres(x)));
        line("  micromotion", format!("{here}{a:.4}, {b:.4}, {c:.4} of the distance along the axes"));
    }
    if let Some(o) = &one.offset {
        let [a, b, c] = o.per_field;
        line("  stray field", format!("1 V/m along the axes shifts by {}, {}, {}", metres(a), metres(b), metres(c)));
        if o.shift.iter().any(|x| *x != 0.0) {
            line("  offset", format!("constant forces shift by {}", place(&o.shift)));
        }
        if let Some(c) = &o.compensation {
            let volts: Vec<String> =
                c.volts.iter().map(|(name, v)| format!("{name} {:+.5e} V", v.as_f64().unwrap_or(0.0))).collect();
            let size = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let (left, all) = (size(&c.residual), size(&c.field));
            let short = if left > 1e-3 * all {
                format!("; {:.0} % of it CANNOT be made", 100.0 * left / all)
            } else {
                String::new()
            };
            line("", format!("compensated by {all:.4e} V/m: add {}{short}", volts.join(", ")));
        }
    }
}

fn wish(text: &mut String, found: &WishReport) {
    let volts: Vec<String> =
        found.volts.iter().map(|(name, v)| format!("{name} {:.6e} V", v.as_f64().unwrap_or(0.0))).collect();
    let _ = writeln!(text, "{:<12} at {}: {}", "wish", place(&found.at), volts.join(", "));
    for one in &found.wanted {
        let _ =
            writeln!(text, "{:<12} {}: wanted {:.5e}, got {:.5e}: {}", "", one.what, one.wanted, one.got, one.verdict);
    }
    if !found.at_limit.is_empty() {
        let _ = writeln!(text, "{:<12} at the limit: {}", "", found.at_limit.join(", "));
    }
}

fn chart(text: &mut String, found: &ChartReport) {
    let axis = |a: &crate::case::ChartAxis| format!("{} from {} to {} {}", a.key, a.from, a.to, a.unit);
    let _ = writeln!(text, "{:<12} {}; {}", "chart", axis(&found.x).trim(), axis(&found.y).trim());
    let rows = [0, found.rows.len() / 2, found.rows.len().saturating_sub(1)].map(|n| found.rows.get(n));
    for row in rows.into_iter().flatten() {
        let list = |edges: &[f64]| match edges {
            [] => "none".to_owned(),
            edges => edges.iter().map(|x| format!("{x:.5}")).collect::<Vec<_>>().join(", "),
        };
        let (here, ideal) = (list(&row.edges), list(&row.ideal_edges));
        let _ = writeln!(text, "{:<12} at {:.5}: edges {here}; of an ideal trap {ideal}", "", row.y);
    }
    if let Some(distance) = found.distance {
        let _ = writeln!(
            text,
            "{:<12} grains from {} off: {} of {} stay, {} beyond the edge; {} lost before it",
            "",
            metres(distance),
            found.retained,
            found.traced.len(),
            found.retained_beyond_the_edge,
            found.lost_before_the_edge
        );
    }
}
