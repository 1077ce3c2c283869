//! Lines of a field on their way through a grid.

use meshes::{Nearest, SurfaceTree, Vec3};

use crate::grid_ripple::GridFrame;
use crate::{BasisField, Samples};

/// What became of lines that came towards a grid from one side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FieldLines {
    /// How many were followed.
    pub followed: usize,
    /// Came through.
    pub passed: usize,
    /// Ended on the grid, or, which comes to the same, began there.
    pub caught: usize,
}

/// Height over the surface of a grid at which lines start, and below it at which they are through, in pitches: there the ripple is
/// 1.6e-4 of the field, so that as many lines go through any part of the cell.
const START: f64 = 1.5;

/// A step, as a part of the distance to the next surface, and at most in pitches, by Runge and Kutta's rule of order four. With half of
/// both, none of two thousand lines about wires of a hundredth of the pitch ended elsewhere.
const STEP: f64 = 0.5;
const LONGEST: f64 = 0.3;

/// Nearer to the grid than this part of a wire's width, a line that heads for it ends there: on a wire in a uniform field all lines that
/// are within this angle (its cosine) of straight on do, ψ = (r + a²/r) sin θ < 2a.
const LANDING: f64 = 0.05;
const STRAIGHT: f64 = 0.8;

/// Panels stand out of a round surface here, and lie below it there. Where, this near (in widths of a wire), the field has fallen to
/// this part of what it was a step before, a line has gone through the true surface.
const NEAR: f64 = 0.25;
const GONE: f64 = 0.1;

/// Steps after which a line is in a place where there is no field.
const MOST: usize = 400;

/// Follows lines of the field Σ w_c ∇φ_c from one side of a grid (`side` 1: that of its normal; -1) towards it, as many as are asked for,
/// spread evenly over a cell by the sequence of Roberts (2018). `own`: the number of the grid among the electrodes of `surface`.
///
/// Lines are what grains without inertia follow. What neither passes nor is caught turned back, went to another electrode, or came to
/// a place without a field.
///
/// `None` where something stands between the start and the grid.
///
/// Checked by `lines_end_on_wires_in_a_uniform_field` and `lines_pass_wires_where_the_other_field_is_strong_enough`; in the field of
/// solved grids by `cli_study_follows_lines_through_wires`.
pub fn field_lines(
    field: &dyn BasisField,
    weights: &[f64],
    surface: &SurfaceTree,
    own: usize,
    grid: &GridFrame,
    side: f64,
    lines: usize,
) -> Option<FieldLines> {
    let normal = grid.frame[2] * side;
    let height = grid.half_thickness + START * grid.pitch;
    // The root of x^3 = x + 1.
    let g: f64 = 1.324_717_957_244_746;
    let start = |k: usize| {
        let part = |n: i32| (0.5 + k as f64 * g.powi(-n)).fract() - 0.5;
        let across = grid.frame[0] * (part(1) * grid.cell[0]) + grid.frame[1] * (part(2) * grid.cell[1]);
        grid.center + across + normal * height
    };
    let mut places: Vec<Vec3> = (1..=lines).map(start).collect();
    let near = |p: &Vec3| p - normal * (height - grid.half_thickness - 0.01 * grid.pitch);
    if places.iter().any(|p| surface.first_hit(p, &near(p)).is_some_and(|hit| hit.electrode != own)) {
        return None;
    }
    let mut counts = FieldLines { followed: lines, ..FieldLines::default() };
    let mut samples = Samples::default();
    let mut slopes = |points: &[Vec3]| -> Vec<Vec3> {
        field.sample(points, &mut samples);
        let sum = |gradients: &[Vec3]| gradients.iter().zip(weights).map(|(g, w)| g * *w).sum::<Vec3>();
        samples.gradient.chunks(field.channels()).map(sum).collect()
    };
    // Each line goes up or down the potential as it goes towards the grid.
    let mut ways: Vec<f64> = slopes(&places).iter().map(|s| if s.dot(&normal) > 0.0 { -1.0 } else { 1.0 }).collect();
    let unit = |slopes: &[Vec3], ways: &[f64]| -> Vec<Vec3> {
        slopes.iter().zip(ways).map(|(s, w)| s.try_normalize(0.0).unwrap_or_else(Vec3::zeros) * *w).collect()
    };
    let along = |places: &[Vec3], steps: &[f64], by: &[Vec3], part: f64| -> Vec<Vec3> {
        places.iter().zip(steps).zip(by).map(|((p, h), k)| p + k * (h * part)).collect()
    };
    let mut sizes = vec![0.0; places.len()];
    for _ in 0..MOST {
        if places.is_empty() {
            break;
        }
        let longest = LONGEST * grid.pitch;
        let near: Vec<_> = places.iter().map(|p| surface.nearest(p, longest / STEP)).collect();
        // A step from the surface itself must leave it or end there.
        let free = |near: &Option<Nearest>| near.map_or(longest, |near| STEP * near.distance).max(1e-2 * grid.wire);
        let steps: Vec<f64> = near.iter().map(free).collect();
        let here = slopes(&places);
        let k1 = unit(&here, &ways);
        let k2 = unit(&slopes(&along(&places, &steps, &k1, 0.5)), &ways);
        let k3 = unit(&slopes(&along(&places, &steps, &k2, 0.5)), &ways);
        let k4 = unit(&slopes(&along(&places, &steps, &k3, 1.0)), &ways);
        let mut going = Vec::new();
        for n in 0..places.len() {
            let step = (k1[n] + (k2[n] + k3[n]) * 2.0 + k4[n]) * (steps[n] / 6.0);
            let (from, to) = (places[n], places[n] + step);
            if let Some(near) = near[n].filter(|near| near.electrode == own && near.distance < NEAR * grid.wire) {
                let lands = k1[n].dot(&(near.point - from)) > STRAIGHT * near.distance;
                if lands && near.distance < LANDING * grid.wire || here[n].norm() < GONE * sizes[n] {
                    counts.caught += 1;
                    continue;
                }
            }
            let over = (to - grid.center).dot(&normal);
            match surface.first_hit(&from, &to) {
                Some(hit) if hit.electrode == own => counts.caught += 1,
                // Another electrode behind the grid is where lines go that pass.
                Some(_) if over < -grid.half_thickness => counts.passed += 1,
                Some(_) => {}
                None if over < -height => counts.passed += 1,
                None if over > height * (1.0 + 1e-9) || step == Vec3::zeros() => {}
                None => going.push((to, ways[n], here[n].norm())),
            }
        }
        places = going.iter().map(|line| line.0).collect();
        ways = going.iter().map(|line| line.1).collect();
        sizes = going.iter().map(|line| line.2).collect();
    }
    Some(counts)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use meshes::{GridPattern, Outline, Shape, SurfaceMesh, Weave, triangulate};
    use nalgebra::Complex;

    use super::*;

    /// Wires along y, a length of 1 apart, in a uniform field and charged, by multipoles of their lattice: with w = x + iz and
    ///
    ///   φ = Im(w + a cot πw) + λ Re(ln sin πw + b / sin² πw)
    ///
    /// both parts are constant on |w| = r but for terms of r⁴: a = πr² / (1 + π²r²/3), b = (πr)⁴/6 / (1 + (πr)⁴/15) take away those with
    /// one and two periods round the wire. Slopes far away are 1 ± πλ.
    struct Wires {
        radius: f64,
        charge: f64,
    }

    impl Wires {
        /// a and b.
        fn moments(&self) -> [f64; 2] {
            let s = (PI * self.radius).powi(2);
            [s / PI / (1.0 + s / 3.0), s * s / 6.0 / (1.0 + s * s / 15.0)]
        }

        /// λ at which the field vanishes at the top of a wire: with more, no line of the weaker side ends there. At w = ir the dipoles make
        /// φ_z = 1 + πa / sinh² πr, the charges πλ (coth πr + 2 b cosh πr / sinh³ πr).
        fn full_passage(&self) -> f64 {
            let [a, b] = self.moments();
            let (sinh, cosh) = ((PI * self.radius).sinh(), (PI * self.radius).cosh());
            (1.0 + PI * a / (sinh * sinh)) / (PI * (cosh / sinh + 2.0 * b * cosh / sinh.powi(3)))
        }

        /// Slopes far away on the stronger side over the weaker.
        fn ratio(&self) -> f64 {
            (1.0 + PI * self.charge) / (1.0 - PI * self.charge)
        }
    }

    impl BasisField for Wires {
        fn channels(&self) -> usize {
            1
        }
        fn sample(&self, points: &[Vec3], samples: &mut Samples) {
            samples.reset(points.len(), 1);
            let [a, b] = self.moments();
            for (k, p) in points.iter().enumerate() {
                let w = Complex::new(PI * p.x, PI * p.z);
                let (sin, cos) = (w.sin(), w.cos());
                // φ = Im f + Re g: (φ_x, φ_z) = (Im f' + Re g', Re f' - Im g').
                let f = Complex::new(1.0, 0.0) - Complex::new(PI * a, 0.0) / (sin * sin);
                let g = (cos / sin - cos * (2.0 * b) / (sin * sin * sin)) * (PI * self.charge);
                samples.gradient[k] = Vec3::new(f.im + g.re, 0.0, f.re - g.im);
            }
        }
    }

    fn follow(radius: f64, charge: f64, side: f64, lines: usize) -> FieldLines {
        let shape = Shape::GridPlate {
            outline: Outline::Rectangle([5.0, 5.0]),
            pitch: 1.0,
            pattern: GridPattern::Wires { weave: Weave::Parallel, wire_radius: radius },
        };
        let mesh = SurfaceMesh::assemble([("wires".to_owned(), triangulate(&shape, 3.0).unwrap())]);
        let tree = SurfaceTree::new(&mesh);
        let grid = GridFrame {
            center: Vec3::zeros(),
            frame: [Vec3::x(), Vec3::y(), Vec3::z()],
            cell: [1.0; 2],
            pitch: 1.0,
            wire: 2.0 * radius,
            half_thickness: radius,
        };
        field_lines(&Wires { radius, charge }, &[1.0], &tree, 0, &grid, side, lines).unwrap()
    }

    /// r/s, the share of lines that wires take in equal fields, and the ratio of fields from which on all of the weaker side pass.
    const WIRES: [(f64, f64, f64); 3] =
        [(0.01, 0.039_983, 1.133_95), (0.05, 0.198_35, 1.884_23), (0.1, 0.387_14, 3.666_02)];

    #[test]
    fn lines_end_on_wires_in_a_uniform_field() {
        let lines = 2000;
        for (radius, share, _) in WIRES {
            // The lines between both stagnation points: 4a / (πr), four radii for thin wires.
            let exact = 4.0 * Wires { radius, charge: 0.0 }.moments()[0] / (PI * radius);
            assert!((exact / share - 1.0).abs() < 1e-3, "{exact} instead of {share}");
            for side in [1.0, -1.0] {
                let found = follow(radius, 0.0, side, lines);
                assert_eq!(found.followed, found.passed + found.caught);
                let caught = found.caught as f64 / lines as f64;
                println!("r/s = {radius}: {caught:.5} of {share} end on wires");
                // Even points miss each of two edges by some 1/N; of the surface facets leave out what `LANDING` and `GONE` make good.
                assert!((caught - share).abs() < (0.01 * share).max(1e-3), "{caught} instead of {share}");
            }
        }
    }

    #[test]
    fn lines_pass_wires_where_the_other_field_is_strong_enough() {
        for (radius, _, ratio) in WIRES {
            let exact = Wires { radius, charge: Wires { radius, charge: 0.0 }.full_passage() };
            // The next multipoles of the lattice: (πr)⁴/45 and less, against one.
            assert!((exact.ratio() / ratio - 1.0).abs() < 2e-3, "{} instead of {ratio}", exact.ratio());
            // As near to it as lines tell: what wires take there goes with the third power of the square root of what is missing.
            let charge = |ratio: f64| (ratio - 1.0) / (ratio + 1.0) / PI;
            let lines = 4000;
            let caught = |part: f64| follow(radius, charge(1.0 + part * (ratio - 1.0)), -1.0, lines).caught;
            println!("r/s = {radius}: {} lines at 0.95 of it, {} at 1.01", caught(0.95), caught(1.01));
            assert_eq!(caught(1.01), 0, "{radius}");
            assert!(caught(0.95) > 0, "{radius}");
        }
    }
}
