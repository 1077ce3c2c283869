use super::*;
use crate::{GridPattern, Hole, Outline, Shape, triangulate};

fn shapes() -> Vec<Shape> {
    let holes = |hole, thickness| Shape::GridPlate {
        outline: Outline::Rectangle([1.0, 0.8]),
        pitch: 0.25,
        pattern: GridPattern::Perforated { hole, open: 0.15, thickness },
    };
    vec![
        Shape::Sphere { radius: 0.7 },
        Shape::Ring { radius: 1.0, wire_radius: 0.1 },
        Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.2 },
        Shape::EndCap { radius: 1.0, opening: 1.2, thickness: 0.1 },
        Shape::Cylinder { radius: 0.5, length: 2.0, caps: true },
        Shape::HyperbolicCap { r0: 1.0, z0: 0.7, extent: 2.0 },
        Shape::HyperbolicRing { r0: 1.0, z0: 0.7, extent: 2.0 },
        Shape::Box { size: [1.0, 0.7, 0.4] },
        Shape::Plate { size: [1.0, 0.7], thickness: 0.0 },
        Shape::Plate { size: [1.0, 0.7], thickness: 0.1 },
        holes(Hole::Square, 0.0),
        holes(Hole::Square, 0.05),
        holes(Hole::Slot, 0.0),
        holes(Hole::Slot, 0.05),
        holes(Hole::Round, 0.0),
        holes(Hole::Round, 0.05),
        Shape::GridPlate {
            outline: Outline::Rectangle([1.0, 0.75]),
            pitch: 0.25,
            pattern: GridPattern::Perforated { hole: Hole::Round, open: 0.15, thickness: 0.05 },
        },
    ]
}

/// Area and enclosed volume by the midpoint rule.
fn area_and_volume(all: &[Patch]) -> (f64, f64) {
    const N: usize = 60;
    let (mut area, mut volume) = (0.0, 0.0);
    for patch in all {
        for i in 0..N {
            for j in 0..N {
                let at = |k: usize| (k as f64 + 0.5) / N as f64;
                let [s, t] = patch.tangents(at(i), at(j));
                let normal = s.cross(&t) / (N * N) as f64;
                area += normal.norm();
                volume += normal.dot(&patch.at(at(i), at(j))) / 3.0;
            }
        }
    }
    (area, volume)
}

#[test]
fn patches_cover_the_surface_once_and_look_outwards() {
    for shape in shapes() {
        let all = patches(&shape).unwrap();
        let mesh = triangulate(&shape, 6.0).unwrap();
        let (area, volume) = area_and_volume(&all);
        assert!((area / mesh.area() - 1.0).abs() < 4e-3, "{shape:?}: {area} {}", mesh.area());
        if mesh.open_edges().is_empty() {
            // The midpoint rule leaves 1e-3 at stretched edges; polygons of thin tubes have the charge of round ones.
            assert!((volume / mesh.volume() - 1.0).abs() < 2e-2, "{shape:?}: {volume} {}", mesh.volume());
        }
    }
}

#[test]
fn tangents_are_derivatives_and_parameters_are_found_again() {
    for patch in shapes().iter().flat_map(|shape| patches(shape).unwrap()) {
        for (xi, eta) in [(0.31, 0.62), (0.8, 0.1)] {
            let (h, point) = (1e-5, patch.at(xi, eta));
            let along = (patch.at(xi + h, eta) - patch.at(xi - h, eta)) / (2.0 * h);
            let across = (patch.at(xi, eta + h) - patch.at(xi, eta - h)) / (2.0 * h);
            let [s, t] = patch.tangents(xi, eta);
            assert!((along - s).norm() < 1e-7 && (across - t).norm() < 1e-7, "{patch:?}");
            let [x, y] = patch.parameters(&point);
            assert!((patch.at(x, y) - point).norm() < 1e-9, "{patch:?}: {x} {y}");
        }
    }
}
