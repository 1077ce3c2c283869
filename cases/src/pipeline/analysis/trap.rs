//! What is known of a trap for next to nothing once its field is solved: for the summary of every run.

use field::analysis::critical::polish;
use field::analysis::{Expansion, Space, Tones, clearance};
use serde::Serialize;
use tracer::secular::{Neighbourhood, common_period, effective};

use super::report::MathieuReport;
use super::species::{alone, in_order, mathieu};
use crate::case::{Case, GrainGroup};
use crate::pipeline::solution::Solution;
use crate::pipeline::{drives, region};

/// With more panels than this, it would take longer than a second.
const MOST_PANELS: usize = 20_000;

/// Groups that are looked at.
const MOST_GROUPS: usize = 8;

/// Equilibrium and frequencies of a group of grains, at the critical point of its effective potential to which Newton's method
/// leads from the middle of the trap. `analyse` searches for all of them, in more ways, and tells the depth.
#[derive(Clone, Debug, Serialize)]
pub struct Trap {
    /// Name of the group.
    pub grains: String,
    /// m.
    pub center: [f64; 3],
    /// `minimum` where it is held in all directions of the effective potential, or what else the point is.
    pub kind: &'static str,
    /// a and q on the principal axes, where something oscillates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mathieu: Option<MathieuReport>,
    /// Frequency of each mode about the periodic orbit, by the transition matrix over a period of the real field, Hz.
    pub secular_hz: Vec<f64>,
    /// Estimated, Hz.
    pub secular_error: f64,
    /// How fast each dies away, 1/s; negative where it grows.
    pub decay_rate: Vec<f64>,
    /// All of them stay bounded.
    pub held: bool,
}

/// Of each group of grains, those left out for which there is no such point.
pub fn traps(case: &Case, solution: &Solution) -> Vec<Trap> {
    let basis = &solution.basis;
    if basis.panels.len() > MOST_PANELS || case.grains.is_empty() {
        return Vec::new();
    }
    let driven = drives::exact_field(case, basis);
    let Some(tones) = Tones::of(driven.field.waveforms()) else { return Vec::new() };
    let bounds = region::trap_box(case, &basis.mesh);
    let exact = &driven.exact;
    let room = |p: &meshes::Vec3| clearance(exact, p);
    let size = 0.5 * (bounds.max - bounds.min).norm();
    let space = Space { field: &**exact, clearance: &room, error: solution.errors.field, size };
    let of = |group: &GrainGroup| -> Option<Trap> {
        let specific = group.charge / group.mass;
        if specific == 0.0 {
            return None;
        }
        let region = tracer::Region { min: bounds.min, max: bounds.max };
        let rate = alone(case, driven.field.clone(), region).drag_rate(group.mass, group.radius).unwrap_or(0.0);
        let acceleration = case.forces.gravity + case.forces.constant / group.mass;
        let potential = effective(&tones, specific, rate, acceleration);
        let point = polish(&space, &potential, &((bounds.min + bounds.max) * 0.5), size)?;
        let expansion = Expansion::near(space.field, point.position, space.room(&point.position));
        let mathieu = tones
            .strongest()
            .map(|f| mathieu(&tones, space.error, &expansion, &point.position, point.axes, specific, rate, f));
        let frequencies: Vec<f64> = tones.tones.iter().map(|t| t.frequency).collect();
        let period = common_period(&frequencies);
        if period.is_none() && !frequencies.is_empty() {
            return None;
        }
        let near = Neighbourhood {
            expansion: &expansion,
            waveforms: driven.field.waveforms(),
            specific_charge: specific,
            rate,
            acceleration,
            magnetic_field: case.forces.magnetic_field,
            period,
        };
        let modes = in_order(&near.equilibrium(&point.position)?.modes, &point.axes);
        let error = |m: &tracer::secular::Mode| m.frequency_error + space.error * m.frequency;
        Some(Trap {
            grains: group.name.clone(),
            center: point.position.into(),
            kind: point.kind.name(),
            mathieu,
            secular_hz: modes.iter().map(|m| m.frequency).collect(),
            secular_error: modes.iter().map(error).fold(0.0, f64::max),
            decay_rate: modes.iter().map(|m| m.rate).collect(),
            held: modes.iter().all(|m| m.is_held()),
        })
    };
    case.grains.iter().take(MOST_GROUPS).filter_map(of).collect()
}
