//! What an analysis found, as `analysis.json` holds it. SI throughout, but where a key says otherwise.

use field::analysis::CriticalPoint;
use meshes::Vec3;
use serde::Serialize;

use super::chart::{Scan, edges};
use crate::case::{Chart, ChartAxis, GrainGroup};
use crate::output::summary::CaseText;

/// What `graintrap analyse` prints as JSON.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// Version of the program.
    pub version: &'static str,
    /// `analyse`.
    pub command: &'static str,
    /// Title of the case.
    pub title: String,
    /// The case itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub case: Option<CaseText>,
    /// Centre of the multipoles, m.
    pub center: [f64; 3],
    /// What it is.
    pub center_is: String,
    /// Polar axis of the multipoles.
    pub axis: [f64; 3],
    /// Estimated relative error of the unit fields in the trap region.
    pub field_error_estimate: f64,
    /// Lower corner of the box that was searched, m.
    pub search_min: [f64; 3],
    /// Upper corner, m.
    pub search_max: [f64; 3],
    /// Where the static field, and where what oscillates, vanishes.
    pub nulls: Vec<Null>,
    /// Multipoles about the centre.
    pub multipoles: TrapMultipoles,
    /// Of the first group of grains.
    pub mathieu: Option<MathieuReport>,
    /// Of the first group of grains.
    pub secular_hz: Option<SecularReport>,
    /// Of the first group of grains.
    pub depth_ev: Option<Depth>,
    /// Everything that depends on charge and mass, for each group of grains.
    pub species: Vec<Species>,
    /// What came of `[analysis.wish]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wish: Option<WishReport>,
    /// What came of `[analysis.chart]`; all of it is in `stability_chart.csv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chart: Option<ChartReport>,
    /// Wall-clock time of the analysis, s.
    pub seconds: f64,
    /// What a person should know.
    pub warnings: Vec<String>,
    /// Files that were written.
    pub files: Vec<String>,
}

/// A point at which a field vanishes.
#[derive(Clone, Debug, Serialize)]
pub struct Null {
    /// Whose: `dc`, or `rf` with the frequency.
    pub of: String,
    /// m.
    pub position: [f64; 3],
    /// What the potential does about it.
    pub kind: &'static str,
    /// Of the potential (of the RF's amplitude) along the axes, V/m², largest first.
    pub curvatures: [f64; 3],
    /// Principal axes.
    pub axes: [[f64; 3]; 3],
    /// Zero in free space: what it is not is error, V/m².
    pub curvature_sum: f64,
    /// Potential there, V.
    pub potential: f64,
    /// Along these axes a static field drives positive charges away (Earnshaw).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repels_positive_along: Option<Vec<[f64; 3]>>,
    /// And negative ones along these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repels_negative_along: Option<Vec<[f64; 3]>>,
    /// It is one of a line or a ring of such points.
    pub one_of_many: bool,
    /// Estimated error of the curvatures, V/m².
    pub curvature_error_estimate: f64,
    /// Estimated error of the position, m.
    pub error_estimate: f64,
}

impl Null {
    /// A critical point of the potential of that name.
    pub fn new(of: &str, point: &CriticalPoint) -> Self {
        let along = |sign: f64| -> Option<Vec<[f64; 3]>> {
            let bends = point.curvatures.iter().zip(&point.axes);
            (of == "dc").then(|| bends.filter(|(c, _)| **c * sign < 0.0).map(|(_, axis)| (*axis).into()).collect())
        };
        Self {
            of: of.to_owned(),
            position: point.position.into(),
            kind: point.kind.name(),
            curvatures: point.curvatures,
            axes: point.axes.map(Into::into),
            curvature_sum: point.curvatures.iter().sum(),
            potential: point.value,
            repels_positive_along: along(1.0),
            repels_negative_along: along(-1.0),
            one_of_many: point.flat,
            curvature_error_estimate: point.curvature_error,
            error_estimate: point.position_error,
        }
    }
}

/// Multipoles about the centre, φ = Σ r^l (A_l0 P_l + ...), in Schmidt's normalisation.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TrapMultipoles {
    /// m.
    pub center: [f64; 3],
    /// The azimuth begins at the first, the third is the polar axis.
    pub frame: [[f64; 3]; 3],
    /// Of the sphere on which they were found, m.
    pub radius: f64,
    /// Largest degree.
    pub order: usize,
    /// Of each electrode at 1 V with the others grounded, and each source at strength one.
    pub electrodes: Vec<UnitMultipoles>,
    /// Of the constant voltages, and of the amplitudes at each frequency, V/m^l.
    pub driven: Vec<UnitMultipoles>,
}

/// The multipoles of one potential.
#[derive(Clone, Debug, Serialize)]
pub struct UnitMultipoles {
    /// Of what.
    pub name: String,
    /// A_0, A_1, A_2, ...: what is round about the axis, 1/m^l per volt.
    #[serde(rename = "A")]
    pub a: Vec<f64>,
    /// Estimated error of each.
    pub error_estimate: Vec<f64>,
    /// Largest part that is not round against the largest one, on the sphere.
    pub roughness: f64,
    /// All that are above 1e-9 of the largest on the sphere.
    pub terms: Vec<Term>,
}

/// One multipole.
#[derive(Clone, Debug, Serialize)]
pub struct Term {
    /// Degree.
    pub l: usize,
    /// Order.
    pub m: usize,
    /// With the sine of the azimuth.
    pub sine: bool,
    /// 1/m^l per volt.
    pub value: f64,
    /// Estimated.
    pub error_estimate: f64,
}

impl Term {
    /// The k-th in the order of [`field::analysis::Multipoles`].
    pub fn new(k: usize, l: usize, value: f64, error_estimate: f64) -> Self {
        let place = k - l * l;
        Self { l, m: place.div_ceil(2), sine: place > 0 && place.is_multiple_of(2), value, error_estimate }
    }
}

/// What depends on charge and mass.
#[derive(Clone, Debug, Serialize)]
pub struct Species {
    /// Name of the group.
    pub name: String,
    /// C.
    pub charge: f64,
    /// kg.
    pub mass: f64,
    /// γ, 1/s.
    pub drag_rate: f64,
    /// The point that everything else is about, m.
    pub center: [f64; 3],
    /// What it is.
    pub center_is: String,
    /// Minima and saddles of the effective potential (pseudopotential, static potential, gravity).
    pub effective: Vec<Point>,
    /// Mathieu's parameters.
    pub mathieu: Option<MathieuReport>,
    /// Secular frequencies.
    pub secular_hz: Option<SecularReport>,
    /// How deep the well is; nothing where there is none.
    pub depth_ev: Option<Depth>,
    /// 2 |Q| |grad E_rf| / (m Ω²) at the centre: below 0.3 the effective potential is good.
    pub adiabaticity: Option<f64>,
    /// How grains shake with the RF.
    pub micromotion: Option<Micromotion>,
    /// What gravity, constant forces and stray fields do.
    pub offset: Option<Offset>,
}

/// A critical point of an effective potential.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// m.
    pub position: [f64; 3],
    /// What it is.
    pub kind: &'static str,
    /// Effective potential above that of the centre, V (times the charge it is an energy).
    pub volts: f64,
    /// Squares of secular angular frequencies, 1/s², largest first.
    pub curvatures: [f64; 3],
    /// Principal axes.
    pub axes: [[f64; 3]; 3],
    /// It is one of a line or a ring of such points.
    pub one_of_many: bool,
    /// Of the position, m.
    pub error_estimate: f64,
}

/// a and q on the principal axes at the centre.
#[derive(Clone, Debug, Serialize)]
pub struct MathieuReport {
    /// Principal axes.
    pub axes: [[f64; 3]; 3],
    /// From the static field.
    pub a: [f64; 3],
    /// From the RF field.
    pub q: [f64; 3],
    /// γ / Ω.
    pub k: f64,
    /// Largest part of either matrix off its diagonal: above zero the axes are coupled.
    pub coupling: f64,
    /// β by Mathieu's equation on each axis; nothing where it is unstable.
    pub beta: [Option<f64>; 3],
    /// β for small a and q.
    pub beta_small_q: [Option<f64>; 3],
    /// Size of q from which and up to which each axis is stable at this a and drag.
    pub q_limits: [Option<[Option<f64>; 2]>; 3],
    /// Drag counted.
    pub stable: [bool; 3],
    /// Estimated error of a and q.
    pub error_estimate: f64,
}

/// Frequencies of the motion about the centre.
#[derive(Clone, Debug, Serialize)]
pub struct SecularReport {
    /// One for each principal axis.
    pub modes: Vec<ModeReport>,
    /// All of them stay bounded.
    pub held: bool,
    /// Largest of the transition matrix, Hz.
    pub error_estimate: f64,
}

/// A mode, its frequency found in several ways.
#[derive(Clone, Debug, Serialize)]
pub struct ModeReport {
    /// Direction in which it swings most.
    pub axis: [f64; 3],
    /// 0 on a line, 1 on a circle.
    pub roundness: f64,
    /// By the transition matrix over a period of the real field, Hz.
    pub transition: f64,
    /// Estimated, Hz.
    pub transition_error: f64,
    /// How fast it dies away, 1/s; negative where it grows.
    pub decay_rate: f64,
    /// It stays bounded.
    pub held: bool,
    /// By Mathieu's equation on the axis, Hz.
    pub mathieu: Option<f64>,
    /// By the formula for small a and q (the curvature of the effective potential), Hz.
    pub small_q: Option<f64>,
    /// How far the formula is off at this a and q, Hz.
    pub small_q_error: Option<f64>,
    /// In the spectrum of a grain that was traced, Hz.
    pub spectrum: Option<f64>,
    /// Estimated, Hz.
    pub spectrum_error: Option<f64>,
    /// What there is of these is the same within the errors.
    pub agree: bool,
}

/// How deep a well is.
#[derive(Clone, Debug, Serialize)]
pub struct Depth {
    /// eV.
    pub value: f64,
    /// eV.
    pub error_estimate: f64,
    /// V.
    pub volts: f64,
    /// J.
    pub joules: f64,
    /// What opens it: `saddle`, the name of an electrode, or `edge` of the box that was searched (it may be deeper).
    pub opening: String,
    /// Where, m.
    pub point: [f64; 3],
}

/// How grains shake with the RF.
#[derive(Clone, Debug, Serialize)]
pub struct Micromotion {
    /// Amplitude at the equilibrium, where forces hold it off the null, m.
    pub at_equilibrium: Option<f64>,
    /// Amplitude over distance, along each principal axis: |q|/2.
    pub per_distance: [f64; 3],
}

/// What constant forces do to an equilibrium.
#[derive(Clone, Debug, Serialize)]
pub struct Offset {
    /// How far gravity and constant forces move it, m.
    pub shift: [f64; 3],
    /// How far 1 V/m of stray field along each principal axis moves it, m.
    pub per_field: [f64; 3],
    /// What to add to the electrodes' constant voltages to have it back.
    pub compensation: Option<Compensation>,
}

/// Voltages against a constant force.
#[derive(Clone, Debug, Serialize)]
pub struct Compensation {
    /// The field that is needed, V/m.
    pub field: [f64; 3],
    /// To be added to each electrode, V.
    pub volts: serde_json::Map<String, serde_json::Value>,
    /// What the field then has too much, V/m: electrodes cannot make every direction.
    pub residual: [f64; 3],
}

/// What came of a wish.
#[derive(Clone, Debug, Serialize)]
pub struct WishReport {
    /// m.
    pub at: [f64; 3],
    /// Constant voltage of each electrode, V.
    pub volts: serde_json::Map<String, serde_json::Value>,
    /// Electrodes that stand at the limit.
    pub at_limit: Vec<String>,
    /// What was asked for, one by one.
    pub wanted: Vec<Wanted>,
    /// All of it is reached to a thousandth.
    pub reached: bool,
}

/// One number of a wish.
#[derive(Clone, Debug, Serialize)]
pub struct Wanted {
    /// What: `field x`, `A 2 0`, `B 3 1`.
    pub what: String,
    /// V/m^l.
    pub wanted: f64,
    /// V/m^l.
    pub got: f64,
    /// What no voltages of these electrodes can take away, whatever their size; V/m^l.
    pub out_of_reach: f64,
    /// In a word: `reached`, `beyond the limit`, or `not with these electrodes`.
    pub verdict: &'static str,
    /// Estimated error of what was got, V/m^l.
    pub error_estimate: f64,
}

/// A chart of stability in short.
#[derive(Clone, Debug, Serialize)]
pub struct ChartReport {
    /// To the right.
    pub x: ChartAxis,
    /// Upwards.
    pub y: ChartAxis,
    /// Whose charge and mass.
    pub grains: String,
    /// Where the linear motion was looked at, m.
    pub center: [f64; 3],
    /// Principal axes of what oscillates.
    pub axes: [[f64; 3]; 3],
    /// The one of them, from 1, whose q is largest: a and q of the chart are those along it.
    pub main_axis: usize,
    /// Longest period, s.
    pub period: f64,
    /// For each value of y.
    pub rows: Vec<ChartRow>,
    /// Start of traced grains off the centre, along each axis, m.
    pub distance: Option<f64>,
    /// Traced grains, row by row.
    pub traced: Vec<ChartGrain>,
    /// Traced grains that stayed.
    pub retained: usize,
    /// And stayed where the linear motion does not.
    pub retained_beyond_the_edge: usize,
    /// Lost where the linear motion stays bounded.
    pub lost_before_the_edge: usize,
}

/// Where a row of a chart passes into or out of stability, straight between its values.
#[derive(Clone, Debug, Serialize)]
pub struct ChartRow {
    /// Value of y.
    pub y: f64,
    /// Values of x at the edges of the linear motion at the centre.
    pub edges: Vec<f64>,
    /// And of an ideal trap with this a and q.
    pub ideal_edges: Vec<f64>,
}

/// A traced grain of a chart.
#[derive(Clone, Debug, Serialize)]
pub struct ChartGrain {
    /// Value of x.
    pub x: f64,
    /// Value of y.
    pub y: f64,
    /// `retained`, the name of the electrode it struck, or `left_region`.
    pub outcome: String,
    /// When, s.
    pub time: f64,
    /// Where it was lost, m.
    pub point: Option<[f64; 3]>,
}

impl ChartReport {
    /// Of a scan about a centre, with what else it says.
    pub fn new(chart: &Chart, group: &GrainGroup, scan: &Scan, about: &ChartCenter) -> Self {
        let [xs, ys] = &scan.values;
        let row = |(j, y): (usize, &f64)| {
            let edges_of = |list: &[f64]| edges(xs, |i| list[j * xs.len() + i]);
            ChartRow { y: *y, edges: edges_of(&scan.floquet), ideal_edges: edges_of(&scan.ideal) }
        };
        let stayed = |grain: &&ChartGrain| grain.outcome == "retained";
        // Of the value next to the grain's.
        let bounded = |grain: &ChartGrain| {
            let next = |list: &[f64], value: f64| {
                let place = (value - list[0]) / (list[list.len() - 1] - list[0]) * (list.len() - 1) as f64;
                (place.round() as usize).min(list.len() - 1)
            };
            scan.floquet[next(ys, grain.y) * xs.len() + next(xs, grain.x)] < 0.0
        };
        Self {
            x: chart.axes[0].clone(),
            y: chart.axes[1].clone(),
            grains: group.name.clone(),
            center: about.center.into(),
            axes: about.axes.map(Into::into),
            main_axis: about.main + 1,
            period: about.period,
            rows: ys.iter().enumerate().map(row).collect(),
            distance: chart.grains.map(|_| about.distance),
            retained: scan.grains.iter().filter(stayed).count(),
            retained_beyond_the_edge: scan.grains.iter().filter(|g| stayed(g) && !bounded(g)).count(),
            lost_before_the_edge: scan.grains.iter().filter(|g| !stayed(g) && bounded(g)).count(),
            traced: scan.grains.clone(),
        }
    }
}

/// Where and how a chart was made.
#[derive(Clone, Copy, Debug)]
pub struct ChartCenter {
    /// m.
    pub center: Vec3,
    /// Principal axes of what oscillates.
    pub axes: [Vec3; 3],
    /// The one with the largest q.
    pub main: usize,
    /// Start of grains along each axis, m.
    pub distance: f64,
    /// s.
    pub period: f64,
}
