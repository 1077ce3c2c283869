use super::*;

/// Values of both ways to solve on one mesh.
fn both(
    shapes: &[(Shape, Placement)],
    cuts: usize,
    order: usize,
    accuracy: f64,
    symmetric: bool,
    ground: Option<Plane>,
) -> [CurvedSolution; 2] {
    let mut mesh = CurvedMesh {
        patches: Vec::new(),
        electrode: Vec::new(),
        electrodes: shapes.len(),
        elements: Vec::new(),
        order,
    };
    for (e, (shape, placement)) in shapes.iter().enumerate() {
        for patch in patches(shape).unwrap() {
            let whole = Element { patch: mesh.patches.len() as u32, low: [0.0; 2], high: [1.0; 2] };
            let mut parts = vec![whole];
            for _ in 0..cuts {
                parts = parts.iter().flat_map(|p| p.halves(0)).flat_map(|p| p.halves(1)).collect();
            }
            mesh.elements.extend(parts);
            mesh.patches.push(patch.placed(placement).unwrap());
            mesh.electrode.push(e as u32);
        }
    }
    let names: Vec<String> = shapes.iter().map(|_| "a".to_owned()).collect();
    [CurvedBy::Matrix, CurvedBy::Multipoles].map(|by| {
        let problem = CurvedProblem { names: &names, sources: &[], ground, symmetric, max_bytes: u64::MAX, by };
        problem.solve(&mesh, accuracy, &|_| ()).unwrap()
    })
}

/// Largest differences of charges of electrodes and of values at points, against the largest of each.
fn apart([a, b]: &[CurvedSolution; 2]) -> (f64, f64) {
    let of = |x: &[f64], y: &[f64]| {
        let largest = x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / largest
    };
    (of(&a.totals.concat(), &b.totals.concat()), of(&a.charge.values, &b.charge.values))
}

fn square_holes(holes: f64) -> Shape {
    Shape::GridPlate {
        outline: Outline::Rectangle([holes + 0.3; 2]),
        pitch: 1.0,
        pattern: GridPattern::Perforated { hole: Hole::Square, open: 0.7, thickness: 0.0 },
    }
}

#[test]
fn multipoles_solve_as_the_matrix_does() {
    let ground = Plane { point: Vec3::new(0.0, 0.0, -0.6), normal: Vec3::z() };
    let tilted = Placement { center: Vec3::new(0.2, 0.1, 1.4), axis: Vec3::new(0.3, -0.2, 1.0), up: None };
    let plate = vec![(square_holes(3.0), Placement::default())];
    let two = vec![
        (Shape::Disc { radius: 1.0, hole_radius: 0.3, thickness: 0.0 }, Placement::default()),
        (Shape::Plate { size: [1.0, 2.0], thickness: 0.2 }, tilted),
    ];
    for (shapes, cuts, order) in [(&plate, 1, 3), (&two, 2, 4)] {
        for (accuracy, ground, symmetric) in
            [(1e-4, None, true), (1e-5, Some(ground), true), (1e-5, Some(ground), false), (1e-8, None, true)]
        {
            let solved = both(shapes, cuts, order, accuracy, symmetric, ground);
            let (totals, values) = apart(&solved);
            println!(
                "{} unknowns, symmetry {}, {accuracy:e}: {totals:.1e} {values:.1e}, {} iterations, residual {:.1e}",
                solved[1].unknowns, solved[1].symmetry, solved[1].iterations, solved[1].residual
            );
            assert!(solved[0].iterations == 0 && solved[1].iterations > 0);
            // Totals see the residual averaged; single points see it over the size of an element.
            assert!(totals < 2.0 * accuracy && values < 100.0 * accuracy, "{totals:.1e} {values:.1e}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let plate = vec![(square_holes(3.0), Placement::default())];
    let values = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [_, solved] = pool.install(|| both(&plate, 1, 3, 1e-5, true, None));
        solved.charge.values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>()
    });
    assert!(values[0] == values[1] && values[1] == values[2]);
}
