//! What VTK's two file formats and PLY share: kinds of cell, and arrays that say which group a cell belongs to.

use super::build::Builder;
use super::{ImportError, Position};

/// Names of the arrays that divide a surface into groups, the most telling first.
pub(super) const GROUP_ARRAYS: [&str; 7] =
    ["electrode", "group", "gmsh:physical", "physical", "region", "part", "CellEntityIds"];

/// How well an array of this name divides a surface: less is better, `None` is not at all. Case does not matter.
pub(super) fn group_rank(name: &str) -> Option<usize> {
    GROUP_ARRAYS.iter().position(|known| known.eq_ignore_ascii_case(name))
}

/// Adds a cell of an unstructured grid (cell types of vtkCellType.h).
pub(super) fn add_cell(
    mesh: &mut Builder,
    kind: i64,
    corners: &[i64],
    group: Option<u32>,
    at: impl Fn() -> Position,
) -> Result<(), ImportError> {
    let first = |n: usize| {
        corners.get(..n).ok_or_else(|| ImportError::Invalid {
            at: at(),
            problem: format!(
                "a cell of type {kind} with {} corners instead of {n}: export the file again",
                corners.len()
            ),
        })
    };
    match kind {
        // Triangles and quadrilaterals of any order begin with their corners.
        5 | 22 | 34 | 69 | 76 => mesh.polygon(first(3)?, group, at),
        9 | 23 | 28 | 30 | 70 | 77 => mesh.polygon(first(4)?, group, at),
        6 => mesh.strip(corners, group, at),
        7 => {
            first(3)?;
            mesh.polygon(corners, group, at)
        }
        // A pixel is a quadrilateral whose corners go along the axes instead of around.
        8 => {
            let c = first(4)?;
            mesh.polygon(&[c[0], c[1], c[3], c[2]], group, at)
        }
        // A quadratic polygon: all corners, then all middles of edges.
        36 => {
            first(6)?;
            mesh.polygon(&corners[..corners.len() / 2], group, at)
        }
        0 => Ok(()),
        1 | 2 => {
            mesh.census.points += 1;
            Ok(())
        }
        3 | 4 | 21 | 35 | 68 | 75 => {
            mesh.census.lines += 1;
            Ok(())
        }
        10 | 24 | 71 | 78 => {
            mesh.census.tetrahedra += 1;
            Ok(())
        }
        11..=16 | 25..=27 | 29 | 31..=33 | 37 | 41 | 42 | 72..=74 | 79..=81 => {
            mesh.census.other_volumes += 1;
            Ok(())
        }
        _ => Err(ImportError::Unsupported {
            what: format!("{}: cells of type {kind} are not read", at()),
            change: "export the surface as triangles, quadrilaterals or polygons",
        }),
    }
}

/// The group of each cell from the values of an array, `None` where the values are no whole numbers.
pub(super) fn groups_of(mesh: &mut Builder, values: &[i64]) -> Vec<Option<u32>> {
    values.iter().map(|value| Some(mesh.group(&value.to_string()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    #[test]
    fn every_kind_of_surface_cell_covers_the_square() {
        // Corners of the unit square in order, then middles of its edges, then its centre.
        let points = [
            (0.0, 0.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (0.0, 1.0),
            (0.5, 0.0),
            (1.0, 0.5),
            (0.5, 1.0),
            (0.0, 0.5),
            (0.5, 0.5),
        ];
        let cells: [(i64, &[i64], f64); 9] = [
            (5, &[0, 1, 2], 0.5),
            (6, &[0, 1, 3, 2], 1.0),
            (7, &[0, 4, 1, 2, 3], 1.0),
            (8, &[0, 1, 3, 2], 1.0),
            (9, &[0, 1, 2, 3], 1.0),
            (22, &[0, 1, 2, 4, 5, 8], 0.5),
            (23, &[0, 1, 2, 3, 4, 5, 6, 7], 1.0),
            (36, &[0, 1, 2, 3, 4, 5, 6, 7], 1.0),
            (70, &[0, 1, 2, 3, 4, 5, 6, 7, 8], 1.0),
        ];
        for (kind, corners, area) in cells {
            let mut mesh = Builder::new(0);
            points.iter().for_each(|&(x, y)| mesh.vertex(Vec3::new(x, y, 0.0)));
            add_cell(&mut mesh, kind, corners, None, || Position::Byte(0)).unwrap();
            let mesh = mesh.finish().unwrap();
            let sum: Vec3 =
                mesh.triangles.iter().map(|&t| mesh.corners(t)).map(|[a, b, c]| (b - a).cross(&(c - a)) * 0.5).sum();
            assert_eq!(sum, Vec3::new(0.0, 0.0, area), "type {kind}"); // exact: halves
        }
    }

    #[test]
    fn bad_cells() {
        let mut mesh = Builder::new(0);
        let at = || Position::Line(3);
        let say = |result: Result<(), ImportError>| result.unwrap_err().to_string();
        assert!(say(add_cell(&mut mesh, 9, &[0, 1], None, at)).starts_with("line 3: a cell of type 9 with 2 corners"));
        assert!(say(add_cell(&mut mesh, 99, &[0, 1], None, at)).starts_with("line 3: cells of type 99"));
        assert!(say(add_cell(&mut mesh, 5, &[0, 1, -1], None, at)).contains("vertex 0 does not exist"));
    }

    #[test]
    fn group_arrays_are_ranked() {
        assert_eq!(group_rank("Electrode"), Some(0));
        assert!(group_rank("gmsh:physical") < group_rank("CellEntityIds"));
        assert_eq!(group_rank("charge"), None);
    }
}
