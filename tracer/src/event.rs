//! What ends a flight on the way: surfaces and the faces of the region.

use meshes::{SurfaceTree, Vec3};

use crate::path::Path;

/// What a grain has met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Met {
    /// A surface of this electrode.
    Electrode(usize),
    /// A face of the region.
    Edge,
}

/// Where a straight way meets an event's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// How far along, 0 to 1.
    pub fraction: f64,
    /// Where, m.
    pub point: Vec3,
    /// Unit normal of the flat piece that is met, outwards from what it encloses.
    pub normal: Vec3,
    /// What.
    pub met: Met,
}

/// Flat pieces that end a flight when a grain meets them.
pub trait Event: Send + Sync {
    /// The distance of the nearest piece, m, or `reach` if that is less.
    fn distance(&self, point: &Vec3, reach: f64) -> f64;

    /// The first piece on a straight way, met from either side.
    fn crossing(&self, from: &Vec3, to: &Vec3) -> Option<Crossing>;

    /// Whether a grain that starts here has ended before it began (inside a conductor, outside the region).
    fn excludes(&self, point: &Vec3) -> Option<Crossing>;
}

impl Event for SurfaceTree {
    fn distance(&self, point: &Vec3, reach: f64) -> f64 {
        self.nearest(point, reach).map_or(reach, |n| n.distance)
    }

    fn crossing(&self, from: &Vec3, to: &Vec3) -> Option<Crossing> {
        self.first_hit(from, to).map(|hit| Crossing {
            fraction: hit.fraction,
            point: hit.point,
            normal: hit.normal,
            met: Met::Electrode(hit.electrode),
        })
    }

    fn excludes(&self, point: &Vec3) -> Option<Crossing> {
        let electrode = self.inside(point)?;
        let nearest = self.nearest(point, f64::INFINITY)?;
        let normal = (nearest.point - point).try_normalize(0.0).unwrap_or_else(Vec3::x);
        Some(Crossing { fraction: 0.0, point: *point, normal, met: Met::Electrode(electrode) })
    }
}

/// A box that grains may not leave, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Region {
    fn face(&self, axis: usize, upper: bool, fraction: f64, mut point: Vec3) -> Crossing {
        let side = if upper { 1.0 } else { -1.0 };
        point[axis] = if upper { self.max[axis] } else { self.min[axis] };
        Crossing { fraction, point, normal: Vec3::ith(axis, side), met: Met::Edge }
    }
}

impl Event for Region {
    fn distance(&self, point: &Vec3, reach: f64) -> f64 {
        let inside = (point - self.min).inf(&(self.max - point)).min();
        // From outside, too, no face is nearer than the largest overshoot.
        inside.abs().min(reach)
    }

    fn crossing(&self, from: &Vec3, to: &Vec3) -> Option<Crossing> {
        let mut first: Option<Crossing> = None;
        for axis in 0..3 {
            for (upper, bound) in [(false, self.min[axis]), (true, self.max[axis])] {
                let outside = |x: f64| if upper { x > bound } else { x < bound };
                if !outside(from[axis]) && outside(to[axis]) {
                    let fraction = (bound - from[axis]) / (to[axis] - from[axis]);
                    if first.is_none_or(|f| fraction < f.fraction) {
                        first = Some(self.face(axis, upper, fraction, from + (to - from) * fraction));
                    }
                }
            }
        }
        first
    }

    fn excludes(&self, point: &Vec3) -> Option<Crossing> {
        (0..3).find_map(|axis| {
            let (below, above) = (point[axis] < self.min[axis], point[axis] > self.max[axis]);
            (below || above).then(|| {
                let mut crossing = self.face(axis, above, 0.0, *point);
                crossing.point = *point;
                crossing
            })
        })
    }
}

/// How far chords may lie off the path, in units of its length, before they are trusted to meet what the path meets.
///
/// What a chord and its arc enclose can hide only a grazing touch this thin, a hundred times less than the facets of the
/// finest meshes depart from the shapes they stand for (1e-4). Halving it costs half a bisection more near surfaces, so
/// it is not a matter of speed; below 1e-9 the rounding of the dense output would show.
const CHORD: f64 = 1e-6;

/// The first event on a path and its θ.
///
/// Pieces of the path that cannot reach an event's surface are dropped; the others are halved until chord and path agree
/// to `CHORD`, then tested as chords, and the crossing is refined on the path itself against the plane it meets.
pub(crate) fn first_event(path: &Path, events: &[&dyn Event]) -> Option<(f64, Crossing)> {
    let slack = CHORD * path.length();
    let mut first: Option<(f64, Crossing)> = None;
    for event in events {
        let end = first.map_or(1.0, |(theta, _)| theta);
        let search = Search { path, event: *event, slack };
        let found = search.between((0.0, path.position(0.0)), (end, path.position(end)));
        first = found.or(first);
    }
    first
}

struct Search<'a> {
    path: &'a Path,
    event: &'a dyn Event,
    /// m.
    slack: f64,
}

impl Search<'_> {
    fn between(&self, a: (f64, Vec3), b: (f64, Vec3)) -> Option<(f64, Crossing)> {
        let sagitta = self.path.sagitta(b.0 - a.0);
        let radius = 0.5 * (b.1 - a.1).norm() + sagitta;
        let middle = (a.1 + b.1) * 0.5;
        // A little more than the radius, so that rounding of the distance cannot hide a touch.
        let reach = radius * (1.0 + 1e-9) + f64::EPSILON * middle.norm();
        if self.event.distance(&middle, 2.0 * reach) > reach {
            return None;
        }
        let theta = 0.5 * (a.0 + b.0);
        if sagitta > self.slack && theta > a.0 && theta < b.0 {
            let half = (theta, self.path.position(theta));
            return self.between(a, half).or_else(|| self.between(half, b));
        }
        let mut crossing = self.event.crossing(&a.1, &b.1)?;
        let theta = self.refined(a.0, b.0, &crossing);
        let drift = self.path.position(theta) - crossing.point;
        // On the path, and in the plane of what it met.
        crossing.point += drift - crossing.normal * drift.dot(&crossing.normal);
        Some((theta, crossing))
    }

    /// Where the path crosses the plane of a crossing, by the Illinois variant of regula falsi.
    fn refined(&self, mut a: f64, mut b: f64, crossing: &Crossing) -> f64 {
        let height = |theta: f64| (self.path.position(theta) - crossing.point).dot(&crossing.normal);
        let (mut fa, mut fb) = (height(a), height(b));
        if fa * fb > 0.0 {
            return a + (b - a) * crossing.fraction;
        }
        for _ in 0..60 {
            // The root lies between a and b, whichever is the larger; b is the newest point.
            if fa == fb || (b - a).abs() <= f64::EPSILON {
                break;
            }
            let theta = ((a * fb - b * fa) / (fb - fa)).clamp(a.min(b), a.max(b));
            let f = height(theta);
            if f * fb < 0.0 {
                (a, fa) = (b, fb);
            } else {
                fa *= 0.5;
            }
            let moved = (theta - b).abs();
            (b, fb) = (theta, f);
            if f == 0.0 || moved <= f64::EPSILON {
                break;
            }
        }
        b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::Motion;

    const BOX: Region = Region { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 3.0) };

    #[test]
    fn a_region_knows_its_nearest_face() {
        for (point, distance) in [
            (Vec3::zeros(), 1.0),
            (Vec3::new(0.9, 0.0, 0.0), 0.1),
            (Vec3::new(0.0, -1.95, 2.5), 0.05),
            (Vec3::new(4.0, 0.0, 0.0), 3.0),
        ] {
            assert!((BOX.distance(&point, 10.0) - distance).abs() < 1e-15);
            assert!(BOX.distance(&point, 0.01) == 0.01);
        }
        assert!(BOX.excludes(&Vec3::new(0.0, 0.0, 3.0)).is_none(), "a face belongs to the region");
        assert_eq!(BOX.excludes(&Vec3::new(0.0, 0.0, 3.5)).map(|c| c.normal), Some(Vec3::z()));
    }

    #[test]
    fn a_path_that_leaves_and_comes_back_within_a_step_has_left() {
        // x = 4 θ (1 - θ) · 1.2 from the middle: beyond x = 1 between two θ, back at 0 in the end.
        let end = |v: f64| Motion { velocity: Vec3::x() * v, acceleration: Vec3::x() * -9.6, ..Motion::default() };
        let path = Path::quintic(0.0, 1.0, &end(4.8), &end(-4.8));
        let (theta, crossing) = first_event(&path, &[&BOX]).expect("it leaves");
        // 4.8 θ (1 - θ) = 1.
        let expected = 0.5 - (0.25_f64 - 1.0 / 4.8).sqrt();
        assert!((theta - expected).abs() < 1e-14, "{theta} {expected}");
        assert_eq!((crossing.met, crossing.point.x, crossing.normal), (Met::Edge, 1.0, Vec3::x()));
        // Stopping short of the face, it stays.
        let end = |v: f64| Motion { velocity: Vec3::x() * v, acceleration: Vec3::x() * -7.99, ..Motion::default() };
        assert!(first_event(&Path::quintic(0.0, 1.0, &end(3.995), &end(-3.995)), &[&BOX]).is_none());
    }
}
