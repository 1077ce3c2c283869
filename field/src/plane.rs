//! A grounded infinite plane, by images.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use crate::panel::Panel;

/// An infinite plane at 0 V, with everything on the side its normal points to.
///
/// A charge above it has an image of opposite sign below it (Thomson 1848): potentials are those of charges less those of their
/// mirror images, φ(x) = S(x) - S(x'), x' the mirror image of x. Below the plane potential and field are zero. What makes a
/// field without charges of its own (a closed-form source) is mirrored likewise, and its field above a plane includes its
/// image: of a uniform field the part along the normal is doubled, and the part along the plane vanishes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// A point on it, m.
    pub point: Vec3,
    /// The side that is not metal; of length one.
    pub normal: Vec3,
}

/// Points below the plane by less than this, as a fraction of their distance from its point, are on it: rounding.
const ON_PLANE: f64 = 1e-13;

impl Plane {
    /// Signed distance of a point, positive above, m.
    pub fn height(&self, point: &Vec3) -> f64 {
        (point - self.point).dot(&self.normal)
    }

    /// Whether a point lies in the metal, and not on its surface.
    pub fn holds(&self, point: &Vec3) -> bool {
        let arm = point - self.point;
        arm.dot(&self.normal) < -ON_PLANE * arm.norm()
    }

    /// The mirror image of a point.
    pub fn image(&self, point: &Vec3) -> Vec3 {
        point - self.normal * (2.0 * self.height(point))
    }

    /// The mirror image of a direction.
    pub fn turned(&self, direction: &Vec3) -> Vec3 {
        direction - self.normal * (2.0 * direction.dot(&self.normal))
    }

    /// The mirror image of a panel, its outside outside.
    pub fn image_of_panel(&self, panel: &Panel) -> Panel {
        let [a, b, c] = panel.corners.map(|corner| self.image(&corner));
        Panel::new([a, c, b])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_as_far_below_as_points_are_above() {
        let plane = Plane { point: Vec3::new(0.3, -0.1, 0.2), normal: Vec3::new(1.0, 2.0, -0.5).normalize() };
        let p = Vec3::new(0.7, 1.1, -0.4);
        let image = plane.image(&p);
        assert!((plane.height(&p) + plane.height(&image)).abs() < 1e-15 && plane.height(&p) > 0.0);
        assert!((plane.image(&image) - p).norm() < 1e-15);
        assert!((plane.turned(&(p - plane.point)) - (image - plane.point)).norm() < 1e-15);
        assert!(plane.holds(&image) && !plane.holds(&p) && !plane.holds(&((p + image) / 2.0)));
        let panel = Panel::new([p, p + Vec3::x(), p + Vec3::y()]);
        let mirrored = plane.image_of_panel(&panel);
        assert!((mirrored.normal - plane.turned(&panel.normal)).norm() < 1e-15);
        assert!((mirrored.area / panel.area - 1.0).abs() < 1e-14);
    }
}
