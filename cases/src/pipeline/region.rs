//! Boxes that the case leaves open: where the potential is tabulated, and where grains may be.

use field::Plane;
use meshes::{SurfaceMesh, Vec3};
use tracer::Place;

use crate::case::{Case, Region};

/// Room round everything in the tabulated box, as a fraction of its longest side.
const MARGIN: f64 = 0.1;

/// How much larger than everything the region is in which grains are followed, as a fraction of its longest side on each
/// side.
const BEYOND: f64 = 0.5;

/// The smallest box that holds a list of points.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hull(Option<(Vec3, Vec3)>);

impl Hull {
    fn with(self, p: &Vec3) -> Self {
        Self(Some(self.0.map_or((*p, *p), |(lo, hi)| (lo.inf(p), hi.sup(p)))))
    }

    /// With the foot points of its corners on a grounded plane: what lies above it is between it and the plane.
    fn down_to(self, ground: Option<&Plane>) -> Self {
        let (Some((lo, hi)), Some(plane)) = (self.0, ground) else { return self };
        (0..8).fold(self, |hull, corner| {
            let p = Vec3::from_fn(|k, _| if corner >> k & 1 == 0 { lo[k] } else { hi[k] });
            hull.with(&(p - plane.normal * plane.height(&p)))
        })
    }

    /// Grown by a fraction of the longest side on every side; flat boxes get a thickness.
    fn grown(self, fraction: f64) -> Option<Region> {
        let (lo, hi) = self.0?;
        let longest = (hi - lo).max();
        // Of a single point nothing is known: a metre round it.
        let room = if longest > 0.0 { fraction * longest } else { 1.0 };
        Some(Region { min: lo - Vec3::repeat(room), max: hi + Vec3::repeat(room) })
    }
}

/// Everything that makes the field and has a place: electrodes, sources with a size.
fn makers(case: &Case, mesh: &SurfaceMesh) -> Hull {
    let mut hull = Hull(None);
    if let Some((lo, hi)) = mesh.bounds() {
        hull = hull.with(&lo).with(&hi);
    }
    for source in &case.sources {
        let reach = match source.kind {
            crate::case::SourceKind::Quadrupole { r0, .. } => r0,
            crate::case::SourceKind::ThinRing { radius } => radius,
            crate::case::SourceKind::Point => 0.0,
            // A uniform field is everywhere.
            crate::case::SourceKind::Uniform { .. } => continue,
        };
        let center = source.placement.center;
        hull = hull.with(&(center - Vec3::repeat(reach))).with(&(center + Vec3::repeat(reach)));
    }
    hull.down_to(case.field.ground.as_ref())
}

/// The same with the starting grains.
fn hull(case: &Case, mesh: &SurfaceMesh) -> Hull {
    let mut hull = makers(case, mesh);
    for group in &case.grains {
        let (center, reach) = match &group.place {
            Place::Points(points) => {
                hull = points.iter().fold(hull, Hull::with);
                continue;
            }
            Place::Ball { center, radius } | Place::Shell { center, radius } | Place::Disc { center, radius, .. } => {
                (center, *radius)
            }
            Place::Box { min, max } => {
                hull = hull.with(min).with(max);
                continue;
            }
            Place::Beam { center, radius, length, axis } => {
                let back = center - axis.try_normalize(0.0).unwrap_or_else(Vec3::zeros) * *length;
                hull = hull.with(&(back - Vec3::repeat(*radius))).with(&(back + Vec3::repeat(*radius)));
                (center, *radius)
            }
        };
        hull = hull.with(&(center - Vec3::repeat(reach))).with(&(center + Vec3::repeat(reach)));
    }
    hull.down_to(case.field.ground.as_ref())
}

/// The box of the table: the case's, or one round electrodes, sources and starting grains.
pub fn table_box(case: &Case, mesh: &SurfaceMesh) -> Region {
    case.table
        .region
        .or_else(|| hull(case, mesh).grown(MARGIN))
        .unwrap_or(Region { min: Vec3::repeat(-1.0), max: Vec3::repeat(1.0) })
}

/// Where the field is to be as exact as the case asks: the table's box if the case gives one, else one round electrodes and
/// sources. Grains have no part in it, so that a solution serves all of them.
pub fn trap_box(case: &Case, mesh: &SurfaceMesh) -> Region {
    case.table
        .region
        .or_else(|| makers(case, mesh).grown(MARGIN))
        .unwrap_or(Region { min: Vec3::repeat(-1.0), max: Vec3::repeat(1.0) })
}

/// The region beyond which grains are lost: the case's, or half as large again on every side as the table and all that
/// stands in the case.
pub fn flight_box(case: &Case, mesh: &SurfaceMesh) -> Region {
    let table = table_box(case, mesh);
    case.trace.as_ref().and_then(|trace| trace.region).unwrap_or_else(|| {
        let all = hull(case, mesh).with(&table.min).with(&table.max);
        all.grown(BEYOND).unwrap_or(table)
    })
}
