//! How much light a grid plate lets through.

use std::f64::consts::{FRAC_PI_4, PI};

use crate::{GridPattern, Hole, Outline, Shape, ShapeError, SurfaceMesh, SurfaceTree, Vec3, Weave, triangulate};

/// The open fraction of an endless grid at normal incidence, in closed form: the area of the holes, or of the gaps between the
/// shadows of the wires (1 - 2r/d, its square for two layers, woven or not), over that of the plate.
///
/// Checked by `rays_see_the_open_fraction`.
pub fn open_fraction(pitch: f64, pattern: &GridPattern) -> f64 {
    match *pattern {
        GridPattern::Perforated { hole, open, .. } => {
            let ratio = open / pitch;
            match hole {
                // On the lattice of the honeycomb the cell is a hexagon of width `pitch`.
                Hole::Square | Hole::Hexagonal => ratio * ratio,
                Hole::Round => FRAC_PI_4 * ratio * ratio,
                Hole::Slot => ratio,
            }
        }
        GridPattern::Wires { weave, wire_radius } => {
            let gap = 1.0 - 2.0 * wire_radius / pitch;
            if weave == Weave::Parallel { gap } else { gap * gap }
        }
    }
}

/// The smallest rectangle along `e1` and `e2` with which a grid repeats, m: two hexagons of a honeycomb, two wires of a weave.
pub fn unit_cell(pitch: f64, pattern: &GridPattern) -> [f64; 2] {
    match pattern {
        GridPattern::Perforated { hole: Hole::Hexagonal, .. } => [pitch, 3.0_f64.sqrt() * pitch],
        GridPattern::Wires { weave: Weave::Woven, .. } => [2.0 * pitch, 2.0 * pitch],
        _ => [pitch, pitch],
    }
}

/// Half of what a grid takes up along its normal, m; none for a sheet.
pub fn half_thickness(pattern: &GridPattern) -> f64 {
    match *pattern {
        GridPattern::Perforated { thickness, .. } => 0.5 * thickness,
        GridPattern::Wires { weave: Weave::Parallel, wire_radius } => wire_radius,
        GridPattern::Wires { wire_radius, .. } => 2.0 * wire_radius,
    }
}

/// Rays of light onto a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incidence {
    /// All at this angle from the normal, rad, from all sides alike.
    Angle(f64),
    /// From all directions of a cone of this half angle about the normal, rad, as bright from each.
    Cone(f64),
}

/// A piece of an endless grid, as triangles, for rays.
#[derive(Clone, Debug)]
pub struct GridPatch {
    tree: SurfaceTree,
    cell: [f64; 2],
    half_thickness: f64,
    /// The steepest angle from the normal whose rays stay over the patch, rad.
    pub steepest: f64,
}

/// Facets of wires and holes: with this fineness the shadow of a round wire is within 0.3 % of its width.
const FINENESS: f64 = 3.0;

impl GridPatch {
    /// Of a grid, large enough for rays at `angle` (rad) from the normal.
    ///
    /// # Errors
    /// A pattern that cannot be.
    pub fn new(pitch: f64, pattern: &GridPattern, angle: f64) -> Result<Self, ShapeError> {
        // A little above the plate, so that nothing lies on its surface.
        let half_thickness = 1.05 * half_thickness(pattern) + 1e-3 * pitch;
        let hexagonal = matches!(pattern, GridPattern::Perforated { hole: Hole::Hexagonal, .. });
        let drift = 2.0 * half_thickness * angle.tan() / pitch;
        // Whole cells on either side of the one that rays start over; hexagons lose a rim, weaves have cells of two.
        let around = (drift.ceil() as usize + if hexagonal { 4 } else { 2 }).min(MOST_AROUND);
        let side = (2 * around + 1) as f64 * pitch;
        let shape = Shape::GridPlate { outline: Outline::Rectangle([side, side]), pitch, pattern: *pattern };
        let mesh = SurfaceMesh::assemble([("grid".to_owned(), triangulate(&shape, FINENESS)?)]);
        let reach = (around as f64 - if hexagonal { 3.0 } else { 0.5 }) * pitch;
        Ok(Self {
            tree: SurfaceTree::new(&mesh),
            cell: unit_cell(pitch, pattern),
            half_thickness,
            steepest: (reach / (2.0 * half_thickness)).atan(),
        })
    }

    /// Of so many rays how many come through. They are spread evenly over a cell and over directions by the sequence of Roberts
    /// (2018), always the same.
    pub fn passed(&self, incidence: Incidence, rays: usize) -> usize {
        // The root of x^5 = x + 1.
        let g: f64 = 1.167_303_978_261_418_7;
        let part = |k: usize, n: i32| (0.5 + k as f64 * g.powi(-n)).fract();
        let through = |k: &usize| {
            let cos = match incidence {
                Incidence::Angle(angle) => angle.cos(),
                Incidence::Cone(half) => 1.0 - part(*k, 3) * (1.0 - half.cos()),
            };
            let (sin, (s, c)) = ((1.0 - cos * cos).sqrt(), (2.0 * PI * part(*k, 4)).sin_cos());
            let start =
                Vec3::new((part(*k, 1) - 0.5) * self.cell[0], (part(*k, 2) - 0.5) * self.cell[1], self.half_thickness);
            let way = Vec3::new(sin * c, sin * s, -cos) * (2.0 * self.half_thickness / cos);
            self.tree.first_hit(&start, &(start + way)).is_none()
        };
        (1..=rays).filter(through).count()
    }
}

/// Cells on either side at most: 41 x 41.
const MOST_AROUND: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    const RAYS: usize = 20_000;

    fn light(pattern: &GridPattern, incidence: Incidence) -> f64 {
        let patch = GridPatch::new(1.0, pattern, PI / 3.0).unwrap();
        patch.passed(incidence, RAYS) as f64 / RAYS as f64
    }

    fn wires(weave: Weave, wire_radius: f64) -> GridPattern {
        GridPattern::Wires { weave, wire_radius }
    }

    fn plate(hole: Hole, open: f64, thickness: f64) -> GridPattern {
        GridPattern::Perforated { hole, open, thickness }
    }

    #[test]
    fn rays_see_the_open_fraction() {
        for pattern in [
            plate(Hole::Square, 0.7, 0.0),
            plate(Hole::Round, 0.7, 0.0),
            plate(Hole::Hexagonal, 0.7, 0.0),
            plate(Hole::Square, 0.7, 0.3),
            plate(Hole::Slot, 0.7, 0.0),
            plate(Hole::Slot, 0.7, 0.3),
            wires(Weave::Parallel, 0.1),
            wires(Weave::Crossed, 0.1),
            wires(Weave::Woven, 0.1),
        ] {
            let (seen, exact) = (light(&pattern, Incidence::Angle(0.0)), open_fraction(1.0, &pattern));
            // Facets 0.3 % of what is dark, and evenly spread rays some 1/√N of a fifth.
            assert!((seen - exact).abs() < 3e-3, "{pattern:?}: {seen} instead of {exact}");
        }
    }

    #[test]
    fn thick_plates_and_wires_shade_more_at_an_angle() {
        // Through a square hole of width a in a plate of thickness t, at θ from the side φ: (a - t tan θ |cos φ|)(a - t tan θ |sin φ|),
        // on average over φ  a² - (4/π) a h + h²/π  with h = t tan θ < a.
        let (a, t, angle) = (0.8, 0.2, PI / 4.0);
        let h = t * f64::tan(angle);
        let exact = a * a - 4.0 / PI * a * h + h * h / PI;
        let seen = light(&plate(Hole::Square, a, t), Incidence::Angle(angle));
        assert!((seen - exact).abs() < 3e-3, "{seen} instead of {exact}");

        // Through slots only the direction across them counts: a - t tan θ |cos φ|, on average over φ a - 2 h / π.
        let seen = light(&plate(Hole::Slot, a, t), Incidence::Angle(angle));
        assert!((seen - (a - 2.0 * h / PI)).abs() < 3e-3, "{seen} through slots");

        // Wires along y seen at θ from x: the shadow of a cylinder is 2r / cos(angle to its normal plane), on average over φ.
        let (r, angle) = (0.1, PI / 6.0);
        let steps = 1000;
        let exact: f64 = (0..steps)
            .map(|k| {
                let phi = 2.0 * PI * (k as f64 + 0.5) / steps as f64;
                // The wire is long: only the direction across it counts.
                let slope = angle.tan() * phi.cos();
                1.0 - 2.0 * r * (1.0 + slope * slope).sqrt()
            })
            .sum::<f64>()
            / steps as f64;
        let seen = light(&wires(Weave::Parallel, r), Incidence::Angle(angle));
        assert!((seen - exact).abs() < 3e-3, "{seen} instead of {exact}");

        // A thin sheet is as open from everywhere; a cone is the mean of its angles.
        let thin = plate(Hole::Square, a, 0.0);
        assert!((light(&thin, Incidence::Cone(1.0)) - a * a).abs() < 3e-3);
        let thick = plate(Hole::Square, a, t);
        let (half, mut sum) = (PI / 4.0, 0.0);
        for k in 0..100 {
            let cos = 1.0 - (k as f64 + 0.5) / 100.0 * (1.0 - f64::cos(half));
            let h = t * (1.0 - cos * cos).sqrt() / cos;
            sum += (a * a - 4.0 / PI * a * h + h * h / PI) / 100.0;
        }
        let seen = light(&thick, Incidence::Cone(half));
        assert!((seen - sum).abs() < 3e-3, "{seen} instead of {sum}");
    }
}
