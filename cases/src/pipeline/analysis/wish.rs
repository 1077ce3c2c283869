//! Voltages from wishes.

use field::Samples;
use field::analysis::{Multipoles, Space, voltages};
use meshes::Vec3;

use super::report::{Wanted, WishReport};
use super::{Failure, Ground, sphere};
use crate::case::Wish;

/// What counts as reached, of the largest number of its kind.
const REACHED: f64 = 1e-3;

/// Solves a wish. Electrodes that are not named and sources keep their constant voltages.
pub(super) fn wish(ground: &Ground, wish: &Wish, center: Vec3, frame: [Vec3; 3]) -> Result<WishReport, Failure> {
    let (case, basis) = (ground.case, &ground.solution.basis);
    let at = wish.at.unwrap_or(center);
    if ground.space.room(&at) <= 0.0 {
        let problem = "the wish is about a point in a conductor";
        return Err(ground.source.error_at("analysis.wish.at", problem, "move it").into());
    }
    let units = basis.panel_sum();
    let constant: Vec<f64> = {
        let channels = super::drives::channels(case, basis);
        (0..basis.functions())
            .map(|f| channels.weights.iter().zip(&ground.tones.constant).map(|(w, v)| w[f] * v).sum())
            .collect()
    };
    let chosen = &wish.electrodes;
    let (mut names, mut rows, mut wanted, mut errors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    // All unit potentials of each row; those that are not chosen stay as they are.
    let mut put = |name: String, all: Vec<f64>, value: f64, errs: f64| {
        let kept: f64 = (0..all.len()).filter(|k| !chosen.contains(k)).map(|k| all[k] * constant[k]).sum();
        names.push((name, value, kept));
        rows.push(chosen.iter().map(|k| all[*k]).collect::<Vec<f64>>());
        wanted.push(value - kept);
        errors.push(errs);
    };
    if let Some(field) = wish.field {
        let mut samples = Samples::default();
        field::BasisField::sample(&units, &[at], &mut samples);
        for k in 0..3 {
            let all: Vec<f64> = samples.gradient.iter().map(|g| -g[k]).collect();
            let error = ground.space.error * samples.gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
            put(format!("field {}", ["x", "y", "z"][k]), all, field[k], error);
        }
    }
    if !wish.multipoles.is_empty() {
        let radius = sphere(ground, &at)?;
        let space = Space { field: &units, ..ground.space };
        let found = Multipoles::new(&space, at, frame, radius, case.analysis.order);
        for ask in &wish.multipoles {
            let k = Multipoles::at(ask.l, ask.m, ask.sine);
            let all: Vec<f64> = found.coefficients.iter().map(|list| list[k]).collect();
            let error = found.errors.iter().map(|list| list[k]).fold(0.0, f64::max);
            put(format!("{} {} {}", if ask.sine { "B" } else { "A" }, ask.l, ask.m), all, ask.value, error);
        }
    }
    let found = voltages(&rows, &wanted, wish.limit, wish.weight);
    let sum: f64 = found.values.iter().map(|v| v.abs()).sum();
    let mut list = Vec::with_capacity(names.len());
    for (i, (what, value, kept)) in names.iter().enumerate() {
        let got = found.residual[i] + wanted[i] + kept;
        // Against what the row could be at these voltages.
        let scale = value.abs().max(rows[i].iter().zip(&found.values).map(|(a, v)| (a * v).abs()).fold(0.0, f64::max));
        let scale = scale.max(f64::MIN_POSITIVE);
        let verdict = if found.residual[i].abs() <= REACHED * scale {
            "reached"
        } else if found.out_of_reach[i].abs() > REACHED * scale {
            "not with these electrodes"
        } else if found.at_limit.contains(&true) {
            "beyond the limit"
        } else {
            "given up for smaller voltages (weight)"
        };
        list.push(Wanted {
            what: what.clone(),
            wanted: *value,
            got,
            out_of_reach: found.out_of_reach[i],
            verdict,
            error_estimate: errors[i] * sum,
        });
    }
    let name = |k: usize| case.electrodes[chosen[k]].name.clone();
    Ok(WishReport {
        at: at.into(),
        volts: (0..chosen.len()).map(|k| (name(k), found.values[k].into())).collect(),
        at_limit: (0..chosen.len()).filter(|k| found.at_limit[*k]).map(name).collect(),
        reached: list.iter().all(|w| w.verdict == "reached"),
        wanted: list,
    })
}
