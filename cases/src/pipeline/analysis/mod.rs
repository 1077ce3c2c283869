//! What a case is like as a trap: null points, multipoles, and for each group of grains its equilibrium, frequencies and depth.

pub mod brief;
pub mod chart;
pub mod report;
pub(crate) mod species;
pub mod trap;
mod wish;

use std::sync::Arc;

use field::analysis::critical::polish;
use field::analysis::{
    CriticalPoint, Effective, Jet, Kind, Lattice, Multipoles, Search, Space, Tones, clearance, critical_points_on,
    values_on,
};
use field::{PanelSum, Plane};
use meshes::{Placement, Vec3};

use super::drives::{self, Driven};
use super::solution::Solution;
use super::{Failure, Reporter, region};
use crate::CaseSource;
use crate::case::{Case, Region};
use report::{Null, Report, Term, TrapMultipoles, UnitMultipoles};

/// The parts of an analysis that pictures are drawn from.
pub struct Shown {
    /// The driven field.
    pub driven: Driven,
    /// Static part of the potential.
    pub statics: Effective,
    /// Effective potential of the first grains, J/kg; none where there are none.
    pub effective: Option<Effective>,
    /// Where everything was looked for.
    pub bounds: Region,
    /// Centre of the analysis.
    pub center: Vec3,
    /// Frame of the multipoles, the third its axis.
    pub frame: [Vec3; 3],
}

/// What the steps of an analysis share.
struct Ground<'a> {
    case: &'a Case,
    source: &'a CaseSource,
    solution: &'a Solution,
    driven: &'a Driven,
    tones: Tones,
    space: Space<'a>,
    lattice: Lattice,
    bounds: Region,
    /// Where no effective potential says what the centre is.
    fallback: (Vec3, String),
    /// Whether the motion about equilibria is looked at.
    motion: bool,
}

/// How much of the largest multipole a smaller one must be on the sphere to be listed.
const LISTED: f64 = 1e-9;

/// Patterns of what oscillates that are looked at: a square wave has one, at many frequencies.
const PATTERNS: usize = 6;

/// Analyses a solved case.
///
/// # Errors
/// A centre or a sphere that is in a conductor, voltages without a mean.
pub fn analyse(
    case: &Case,
    source: &CaseSource,
    solution: &Solution,
    reporter: &dyn Reporter,
) -> Result<(Report, Shown), Failure> {
    reporter.stage("nulls");
    let basis = &solution.basis;
    let driven = drives::exact_field(case, basis);
    let exact: Arc<PanelSum> = Arc::clone(&driven.exact);
    let Some(tones) = Tones::of(driven.field.waveforms()) else {
        let problem = "a voltage that is sampled from a file has no mean and no frequency to analyse";
        return Err(source.error_at("analysis", problem, "give it as dc, sine or square waves").into());
    };
    let bounds = case.analysis.region.unwrap_or_else(|| region::trap_box(case, &basis.mesh));
    let search = Search { min: bounds.min, max: bounds.max, nodes: case.analysis.nodes };
    let room = |p: &Vec3| clearance(&exact, p);
    let space = Space {
        field: &*exact,
        clearance: &room,
        error: solution.errors.field,
        size: 0.5 * (bounds.max - bounds.min).norm(),
    };
    let middle = (bounds.min + bounds.max) * 0.5;
    let lattice = search.lattice();
    // 1. Nulls: of the static field, and of what oscillates.
    let (mut nulls, mut at) = (Vec::new(), Vec::new());
    let statics = Effective::of_static(tones.constant.clone());
    let mut look = |of: &str, effective: &Effective| {
        let values = values_on(&space, effective, &lattice);
        let found = critical_points_on(&space, effective, &lattice, &values);
        for point in found {
            nulls.push(Null::new(of, &point));
            at.push((of.to_owned(), point));
        }
    };
    if !statics.is_zero() {
        look("dc", &statics);
    }
    for (name, pattern) in patterns(&tones) {
        look(&name, &Effective::of_static(pattern));
    }
    let nearest = |rf: bool| {
        let of = at.iter().filter(|(of, _)| (of != "dc") == rf).map(|(_, p)| p);
        of.min_by(|a, b| (a.position - middle).norm().total_cmp(&(b.position - middle).norm()))
    };
    let fallback = match (nearest(true), nearest(false)) {
        (Some(null), _) => (null.position, "the null of the RF field nearest to the middle".to_owned()),
        (None, Some(null)) => (null.position, "the null of the static field nearest to the middle".to_owned()),
        (None, None) => (middle, "the middle of electrodes and sources".to_owned()),
    };
    let ground =
        Ground { case, source, solution, driven: &driven, tones, space, lattice, bounds, fallback, motion: true };
    // 2. Each group of grains.
    let mut species = Vec::with_capacity(case.grains.len());
    let mut effective = None;
    for group in &case.grains {
        reporter.stage(&format!("grains {}", group.name));
        let (report, potential) = species::species(&ground, group, reporter)?;
        effective.get_or_insert(potential);
        species.push(report);
    }
    // 3. Multipoles about the centre.
    reporter.stage("multipoles");
    let (center, center_is) = match (&case.analysis.center, species.first()) {
        (Some(center), _) => (*center, "as given".to_owned()),
        (None, Some(first)) => (first.center.into(), first.center_is.clone()),
        (None, None) => ground.fallback.clone(),
    };
    let frame = frame(case);
    let multipoles = multipoles(&ground, center, frame)?;
    let wish = case.analysis.wish.as_ref().map(|wish| wish::wish(&ground, wish, center, frame)).transpose()?;
    let first = species.first();
    let report = Report {
        center: center.into(),
        center_is,
        axis: frame[2].into(),
        field_error_estimate: solution.errors.field,
        search_min: bounds.min.into(),
        search_max: bounds.max.into(),
        nulls,
        multipoles,
        mathieu: first.and_then(|s| s.mathieu.clone()),
        secular_hz: first.and_then(|s| s.secular_hz.clone()),
        depth_ev: first.and_then(|s| s.depth_ev.clone()),
        species,
        wish,
        ..Report::default()
    };
    let shown = Shown { driven: driven.clone(), statics, effective, bounds, center, frame };
    Ok((report, shown))
}

/// The patterns in space of what oscillates, each with its name; those that are alike are one.
pub(crate) fn patterns(tones: &Tones) -> Vec<(String, Vec<f64>)> {
    let mut found: Vec<(String, Vec<f64>)> = Vec::new();
    for tone in &tones.tones {
        for (phase, pattern) in [("", &tone.cosine), (" sine", &tone.sine)] {
            let norm = |list: &[f64]| list.iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm(pattern) == 0.0 || found.len() == PATTERNS {
                continue;
            }
            let alike = |other: &Vec<f64>| {
                let dot: f64 = other.iter().zip(pattern).map(|(a, b)| a * b).sum();
                dot.abs() > (1.0 - 1e-12) * norm(other) * norm(pattern)
            };
            if !found.iter().any(|(_, other)| alike(other)) {
                found.push((format!("rf {} Hz{phase}", tone.frequency), pattern.clone()));
            }
        }
    }
    found
}

/// The polar axis with two directions across it.
fn frame(case: &Case) -> [Vec3; 3] {
    let placements = || case.electrodes.iter().map(|e| &e.placement).chain(case.sources.iter().map(|s| &s.placement));
    let axis = case.analysis.axis.or_else(|| placements().find_map(|p| p.axis.try_normalize(0.0)));
    let axis = axis.unwrap_or_else(Vec3::z);
    // Along an axis of coordinates the azimuth begins at the next one.
    for k in 0..3 {
        if axis[k].abs() > 1.0 - 1e-12 {
            return [Vec3::ith((k + 1) % 3, 1.0), Vec3::ith((k + 2) % 3, 1.0), Vec3::ith(k, 1.0)];
        }
    }
    Placement { axis, ..Placement::default() }.frame().unwrap_or([Vec3::x(), Vec3::y(), Vec3::z()])
}

/// Checks that the sphere about a centre is free, and chooses its radius.
fn sphere(ground: &Ground, center: &Vec3) -> Result<f64, Failure> {
    let room = ground.space.room(center);
    let place = format!("({:.4e}, {:.4e}, {:.4e}) m", center.x, center.y, center.z);
    if room <= 0.0 {
        let problem = format!("the centre {place} is in a conductor: there are no multipoles about it");
        return Err(ground.source.error_at("analysis.center", problem, "give another centre").into());
    }
    match ground.case.analysis.radius {
        Some(radius) if radius >= room => {
            let problem = format!("a sphere of {radius} m about {place} reaches a charge, {room:.4e} m away");
            Err(ground.source.error_at("analysis.radius", problem, "make it smaller, or leave it out").into())
        }
        Some(radius) => Ok(radius),
        // Half the room: degree 12 is then 2e-4 of what it is at the electrode, far above rounding, and aliases are far below.
        None => Ok(0.5 * room),
    }
}

fn multipoles(ground: &Ground, center: Vec3, frame: [Vec3; 3]) -> Result<TrapMultipoles, Failure> {
    let case = ground.case;
    let radius = sphere(ground, &center)?;
    let units = ground.solution.basis.panel_sum();
    let space = Space { field: &units, ..ground.space };
    let found = Multipoles::new(&space, center, frame, radius, case.analysis.order);
    let unit = |name: &str, values: &[f64], errors: &[f64]| {
        let axial = |list: &[f64]| (0..=found.order).map(|l| list[l * l]).collect();
        let degree: Vec<usize> = field::analysis::multipoles::degrees(found.order).collect();
        let size = |k: usize| values[k].abs() * radius.powi(degree[k] as i32);
        let largest = (1..values.len()).map(size).fold(0.0, f64::max);
        let rough = (1..values.len()).filter(|k| degree[*k].pow(2) != *k).map(size).fold(0.0, f64::max);
        let terms = (0..values.len())
            .filter(|k| size(*k) > LISTED * largest)
            .map(|k| Term::new(k, degree[k], values[k], errors[k]));
        UnitMultipoles {
            name: name.to_owned(),
            a: axial(values),
            error_estimate: axial(errors),
            roughness: if largest > 0.0 { rough / largest } else { 0.0 },
            terms: terms.collect(),
        }
    };
    let names = case.electrodes.iter().map(|e| &e.name).chain(case.sources.iter().map(|s| &s.name));
    let each = names.enumerate().map(|(k, name)| unit(name, &found.coefficients[k], &found.errors[k])).collect();
    // Channels are combinations of basis functions, and tones of channels.
    let channels = drives::channels(case, &ground.solution.basis);
    let weights = |of: &[f64]| -> Vec<f64> {
        let mut sum = vec![0.0; found.coefficients.len()];
        for (row, w) in channels.weights.iter().zip(of) {
            sum.iter_mut().zip(row).for_each(|(s, x)| *s += w * x);
        }
        sum
    };
    let mut driven = Vec::new();
    if ground.tones.constant.iter().any(|v| *v != 0.0) {
        let (values, errors) = found.combined(&weights(&ground.tones.constant));
        driven.push(unit("dc", &values, &errors));
    }
    for (name, pattern) in patterns(&ground.tones) {
        let (values, errors) = found.combined(&weights(&pattern));
        driven.push(unit(&name, &values, &errors));
    }
    Ok(TrapMultipoles {
        center: center.into(),
        frame: frame.map(Into::into),
        radius,
        order: found.order,
        electrodes: each,
        driven,
    })
}

/// The electrode that a segment meets first, the grounded plane as one more.
pub(crate) fn first_wall(
    exact: &PanelSum,
    ground: Option<&Plane>,
    electrodes: usize,
    from: &Vec3,
    to: &Vec3,
) -> Option<(Vec3, usize)> {
    let hit = exact.tree().first_hit(from, to).map(|hit| (hit.fraction, hit.point, hit.electrode));
    let plane = ground.and_then(|plane| {
        let (a, b) = (plane.height(from), plane.height(to));
        (a > 0.0 && b <= 0.0).then(|| (a / (a - b), from + (to - from) * (a / (a - b)), electrodes))
    });
    let first = hit.into_iter().chain(plane).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((first.1, first.2))
}
