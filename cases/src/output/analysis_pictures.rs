//! Pictures of an analysis: maps in a plane, and potentials along the axes.

use field::Samples;
use field::analysis::{Effective, clearance};
use meshes::{SurfaceMesh, Vec3};

use super::{OutputFolder, pictures};
use crate::case::Case;
use crate::pipeline::Failure;
use crate::pipeline::analysis::Shown;
use crate::pipeline::analysis::report::Report;
use crate::pipeline::solution::Solution;
use crate::plots::{Heights, Map, Mark, Shape, axis_potential, potential_maps};

/// Columns and rows of a map, at most.
const CELLS: usize = 150;
/// Lines of equal potential.
const LINES: usize = 24;
/// Points along an axis.
const POINTS: usize = 600;

/// Draws `analysis_map` and `analysis_axes`.
///
/// # Errors
/// The output fails.
pub fn write(
    out: &mut OutputFolder,
    case: &Case,
    title: &str,
    solution: &Solution,
    report: &Report,
    shown: &Shown,
) -> Result<(), Failure> {
    let plane = Plane::of(case, shown);
    let mut maps = Vec::new();
    // Whichever the case has: constant voltages, the effective potential of the first grains.
    if !shown.statics.is_zero() {
        maps.push(map(&plane, shown, &shown.statics, "static potential", 1.0, None, marks(&plane, report, true)));
    }
    if let (Some(effective), Some(first)) = (&shown.effective, report.species.first()) {
        let per_volt = if first.charge == 0.0 { 1.0 } else { first.mass / first.charge };
        let name = format!("effective potential of {}", first.name);
        let depth = first.depth_ev.as_ref().map(|d| (d.volts.copysign(first.charge), first.center));
        maps.push(map(&plane, shown, effective, &name, per_volt, depth, marks(&plane, report, false)));
    }
    if maps.is_empty() {
        return Ok(());
    }
    let cuts = plane.cuts(&solution.basis.mesh);
    let subtitle = format!("the plane through {} m with normal {}", point(&plane.center), point(&plane.normal));
    pictures::write(out, "analysis_map", &potential_maps(title, &subtitle, plane.names(), &maps, &cuts))?;
    along_axes(out, title, report, shown)
}

fn point(p: &Vec3) -> String {
    let number = |x: f64| if x.abs() < 5e-7 { "0".to_owned() } else { format!("{x:.4}") };
    format!("({}, {}, {})", number(p.x), number(p.y), number(p.z)).replace('-', "\u{2212}")
}

/// The plane that maps are drawn in.
struct Plane {
    center: Vec3,
    normal: Vec3,
    across: Vec3,
    up: Vec3,
    /// Both coordinates, m.
    from: [f64; 2],
    to: [f64; 2],
}

impl Plane {
    fn of(case: &Case, shown: &Shown) -> Self {
        let settings = &case.analysis;
        let center = settings.plane_center.unwrap_or(shown.center);
        let normal = settings.plane_normal.unwrap_or(shown.frame[1]);
        // The axis of the trap lies along the page where it can.
        let axis = shown.frame[2];
        let across = (axis - normal * normal.dot(&axis))
            .try_normalize(1e-6)
            .unwrap_or_else(|| (shown.frame[0] - normal * normal.dot(&shown.frame[0])).normalize());
        let up = normal.cross(&across);
        // The first coordinate that is along an axis counts upwards.
        let upwards = |v: Vec3| if v[v.iamax()] < 0.0 { -v } else { v };
        let (across, up) = (upwards(across), upwards(up));
        let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let bound = |k: usize| if corner >> k & 1 == 0 { shown.bounds.min[k] } else { shown.bounds.max[k] };
            let corner = Vec3::from_fn(|k, _| bound(k));
            for (k, direction) in [across, up].iter().enumerate() {
                from[k] = from[k].min(corner.dot(direction));
                to[k] = to[k].max(corner.dot(direction));
            }
        }
        Self { center, normal, across, up, from, to }
    }

    /// The point at coordinates of the plane: those of space along its directions.
    fn place(&self, [x, y]: [f64; 2]) -> Vec3 {
        self.normal * self.normal.dot(&self.center) + self.across * x + self.up * y
    }

    fn coordinates(&self, p: &Vec3) -> [f64; 2] {
        [p.dot(&self.across), p.dot(&self.up)]
    }

    fn names(&self) -> [&'static str; 2] {
        let name = |v: &Vec3, other| (0..3).find(|k| v[*k].abs() > 1.0 - 1e-9).map_or(other, |k| ["x", "y", "z"][k]);
        [name(&self.across, "across"), name(&self.up, "up")]
    }

    /// Where panels cross the plane.
    fn cuts(&self, mesh: &SurfaceMesh) -> Vec<[[f64; 2]; 2]> {
        let offset = self.normal.dot(&self.center);
        let height = |p: &Vec3| {
            let h = self.normal.dot(p) - offset;
            // A corner on the plane would be met twice or not at all.
            if h == 0.0 { f64::MIN_POSITIVE } else { h }
        };
        let mut cuts = Vec::new();
        for panel in 0..mesh.panels() {
            let corners = mesh.corners(panel);
            let sides = [(0, 1), (1, 2), (2, 0)];
            let crossing = |(a, b): (usize, usize)| {
                // The same way round in both panels of an edge.
                let (p, q) = (corners[a], corners[b]);
                let (p, q) = if (p.x, p.y, p.z) < (q.x, q.y, q.z) { (p, q) } else { (q, p) };
                let (g, h) = (height(&p), height(&q));
                ((g > 0.0) != (h > 0.0)).then(|| self.coordinates(&(p + (q - p) * (g / (g - h)))))
            };
            let met: Vec<[f64; 2]> = sides.into_iter().filter_map(crossing).collect();
            if let [a, b] = met[..] {
                cuts.push([a, b]);
            }
        }
        cuts
    }
}

/// Nulls of the static field, or what is critical in the effective potential, that lie in the plane.
fn marks(plane: &Plane, report: &Report, statics: bool) -> Vec<Mark> {
    let size = plane.to[0] - plane.from[0];
    let axis = Vec3::from(report.axis);
    let in_plane = |p: &[f64; 3], many: bool| -> Vec<[f64; 2]> {
        let p = Vec3::from(*p);
        let away = p - plane.center;
        let (along, radius) = (axis * away.dot(&axis), (away - axis * away.dot(&axis)).norm());
        // A ring of points about the axis meets a plane through the axis twice.
        if many && axis.dot(&plane.normal).abs() < 1e-9 && radius > 1e-6 * size {
            let outward = axis.cross(&plane.normal) * radius;
            return [1.0, -1.0].map(|side| plane.coordinates(&(plane.center + along + outward * side))).to_vec();
        }
        if away.dot(&plane.normal).abs() < 2e-3 * size { vec![plane.coordinates(&p)] } else { Vec::new() }
    };
    let mark = |label: &str, shape: Shape, points: Vec<[f64; 2]>| Mark { label: label.to_owned(), points, shape };
    let all = if statics {
        let nulls =
            report.nulls.iter().filter(|n| n.of == "dc").flat_map(|n| in_plane(&n.position, n.one_of_many)).collect();
        vec![mark("null", Shape::Cross, nulls)]
    } else {
        let points = report.species.first().map(|s| s.effective.as_slice()).unwrap_or_default();
        let of = |minimum: bool| {
            points
                .iter()
                .filter(|p| (p.kind == "minimum") == minimum)
                .flat_map(|p| in_plane(&p.position, p.one_of_many))
                .collect()
        };
        vec![mark("minimum", Shape::Circle, of(true)), mark("saddle", Shape::Cross, of(false))]
    };
    all.into_iter().filter(|m| !m.points.is_empty()).collect()
}

fn map(
    plane: &Plane,
    shown: &Shown,
    potential: &Effective,
    title: &str,
    factor: f64,
    depth: Option<(f64, [f64; 3])>,
    marks: Vec<Mark>,
) -> Map {
    let size = [plane.to[0] - plane.from[0], plane.to[1] - plane.from[1]];
    let cell = size[0].max(size[1]) / CELLS as f64;
    let line = |k: usize| -> Vec<f64> {
        let n = ((size[k] / cell).round() as usize).max(2);
        (0..=n).map(|i| plane.from[k] + size[k] * i as f64 / n as f64).collect()
    };
    let (x, y) = (line(0), line(1));
    let places: Vec<Vec3> = y.iter().flat_map(|y| x.iter().map(move |x| [*x, *y])).map(|p| plane.place(p)).collect();
    let mut values = potential.values(shown.driven.field.basis().as_ref(), &places, &mut Samples::default());
    for (value, place) in values.iter_mut().zip(&places) {
        *value *= factor;
        // No lines across a sheet: on its other side the field is another one.
        if clearance(&shown.driven.exact, place) <= 0.6 * cell {
            *value = f64::NAN;
        }
    }
    let levels = levels(
        &values,
        depth.map(|(depth, center)| {
            let center = Vec3::from(center);
            let base = potential.values(shown.driven.field.basis().as_ref(), &[center], &mut Samples::default())[0];
            (base * factor, depth)
        }),
    );
    Map { title: format!("{title} (V)"), heights: Heights { x, y, values }, levels, marks }
}

/// Levels: tenths of the depth of a well and some above it, or such that lines are spread evenly over the map.
fn levels(values: &[f64], well: Option<(f64, f64)>) -> Vec<f64> {
    if let Some((floor, depth)) = well {
        let steps = (1..=10).map(|k| 0.1 * f64::from(k)).chain([1.25, 1.5, 2.0, 3.0, 5.0, 8.0, 13.0]);
        return steps.map(|s| floor + s * depth).collect();
    }
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    if sorted.is_empty() {
        return Vec::new();
    }
    let level = |k: usize| sorted[(k * sorted.len() / (LINES + 1)).min(sorted.len() - 1)];
    (1..=LINES).map(level).collect()
}

/// Potentials along the three directions of the frame through the centre.
fn along_axes(out: &mut OutputFolder, title: &str, report: &Report, shown: &Shown) -> Result<(), Failure> {
    let basis = shown.driven.field.basis();
    let mut figure: Option<crate::plots::Figure> = None;
    for direction in [shown.frame[2], shown.frame[0], shown.frame[1]] {
        // Up to the box on both sides.
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            if direction[k].abs() > 1e-12 {
                let (a, b) = (
                    (shown.bounds.min[k] - shown.center[k]) / direction[k],
                    (shown.bounds.max[k] - shown.center[k]) / direction[k],
                );
                (low, high) = (low.max(a.min(b)), high.min(a.max(b)));
            }
        }
        let steps: Vec<f64> = (0..POINTS).map(|k| low + (high - low) * k as f64 / (POINTS - 1) as f64).collect();
        let places: Vec<Vec3> = steps.iter().map(|s| shown.center + direction * *s).collect();
        let curve = |label: String, potential: &Effective, factor: f64| {
            let values = potential.values(basis.as_ref(), &places, &mut Samples::default());
            let shown = values.iter().zip(&places).zip(&steps).map(|((value, place), s)| {
                let free = clearance(&shown.driven.exact, place) > 0.0;
                [*s + shown.center.dot(&direction), if free { value * factor } else { f64::NAN }]
            });
            (label, shown.collect::<Vec<_>>())
        };
        let mut curves = Vec::new();
        if !shown.statics.is_zero() {
            curves.push(curve("static potential".to_owned(), &shown.statics, 1.0));
        }
        if let (Some(effective), Some(first)) = (&shown.effective, report.species.first())
            && first.charge != 0.0
        {
            let name = format!("effective potential of {}", first.name);
            curves.push(curve(name, effective, first.mass / first.charge));
        }
        let name = (0..3).find(|k| direction[*k].abs() > 1.0 - 1e-9).map_or("distance", |k| ["x", "y", "z"][k]);
        let one = axis_potential(title, name, &curves);
        match &mut figure {
            None => figure = Some(crate::plots::Figure { columns: 1, height: 1200.0, ..one }),
            Some(all) => all.panels.extend(one.panels),
        }
    }
    match figure {
        Some(figure) => pictures::write(out, "analysis_axes", &figure),
        None => Ok(()),
    }
}
