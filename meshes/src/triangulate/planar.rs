//! Triangles between closed curves in a plane.

use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation as _};

use crate::{ShapeError, Vec3};

/// A closed curve in the plane z = 0: its corners in order, m.
pub(super) type Loop = Vec<[f64; 2]>;

/// Twice the signed area of a loop: positive when it runs counter-clockwise.
pub(super) fn winding(curve: &[[f64; 2]]) -> f64 {
    let n = curve.len();
    (0..n).map(|i| curve[i][0] * curve[(i + 1) % n][1] - curve[(i + 1) % n][0] * curve[i][1]).sum()
}

/// Whether a point is inside an odd number of the loops.
fn odd(loops: &[Loop], [x, y]: [f64; 2]) -> bool {
    let mut inside = false;
    for curve in loops {
        for (i, [x1, y1]) in curve.iter().enumerate() {
            let [x0, y0] = curve[(i + curve.len() - 1) % curve.len()];
            if (*y1 > y) != (y0 > y) && x < (x0 - x1) * (y - y1) / (y0 - y1) + x1 {
                inside = !inside;
            }
        }
    }
    inside
}

/// Triangulates what lies inside an odd number of loops with triangles of at most `max_area` (m²), without adding points on
/// the loops, so that it fits to what is meshed on their other side. Normals along +z.
///
/// # Errors
/// The loops cut each other.
pub(super) fn fill(loops: &[Loop], max_area: f64) -> Result<(Vec<Vec3>, Vec<[u32; 3]>), ShapeError> {
    let crossed =
        || ShapeError::new("pitch", "leaves no room for the rim", "make the pitch smaller or the plate larger");
    let mut net = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    for curve in loops {
        let handles = curve
            .iter()
            .map(|[x, y]| net.insert(Point2::new(*x, *y)).map_err(|_| crossed()))
            .collect::<Result<Vec<_>, _>>()?;
        for (i, from) in handles.iter().enumerate() {
            let to = handles[(i + 1) % handles.len()];
            if !net.can_add_constraint(*from, to) {
                return Err(crossed());
            }
            net.add_constraint(*from, to);
        }
    }
    let total: f64 = loops.iter().map(|l| winding(l).abs() / 2.0).sum();
    let most = (8.0 * total / max_area) as usize + 20 * net.num_vertices() + 1000;
    net.refine(
        RefinementParameters::<f64>::new()
            .keep_constraint_edges()
            .exclude_outer_faces(true)
            .with_max_allowed_area(max_area)
            .with_angle_limit(AngleLimit::from_deg(22.0))
            .with_max_additional_vertices(most),
    );
    let vertices = net.vertices().map(|v| Vec3::new(v.position().x, v.position().y, 0.0)).collect();
    let triangles = net
        .inner_faces()
        .filter(|face| {
            let c = face.center();
            odd(loops, [c.x, c.y])
        })
        .map(|face| face.vertices().map(|v| v.index() as u32))
        .collect();
    Ok((vertices, triangles))
}
