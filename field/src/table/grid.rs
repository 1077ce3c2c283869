//! A uniform grid of cells over a box.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

/// Cells of one size that fill a box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Lower corner, m.
    pub min: Vec3,
    /// Upper corner, m.
    pub max: Vec3,
    /// Cells along each axis.
    pub cells: [usize; 3],
}

impl Grid {
    /// Cells of about that size (m), so many that they fill the box exactly; at least four along each axis.
    pub fn new(min: Vec3, max: Vec3, spacing: f64) -> Self {
        let cells = std::array::from_fn(|k| (((max[k] - min[k]) / spacing - 1e-9).ceil() as usize).max(4));
        Self { min, max, cells }
    }

    /// Edges of a cell, m.
    pub fn spacing(&self) -> Vec3 {
        Vec3::from_fn(|k, _| (self.max[k] - self.min[k]) / self.cells[k] as f64)
    }

    /// Number of nodes; the largest number there is where they cannot be counted.
    pub fn nodes(&self) -> usize {
        self.cells.iter().fold(1_usize, |product, n| product.saturating_mul(n.saturating_add(1)))
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// The number of a node, x fastest.
    pub fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        i + (self.cells[0] + 1) * (j + (self.cells[1] + 1) * k)
    }

    /// The number of a cell, x fastest.
    pub fn cell(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.cells[0] * (j + self.cells[1] * k)
    }

    /// The indices of a cell number.
    pub fn cell_indices(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// A point in units of cells from the lower corner, m.
    pub fn point(&self, at: [f64; 3]) -> Vec3 {
        let spacing = self.spacing();
        Vec3::from_fn(|k, _| self.min[k] + at[k] * spacing[k])
    }

    /// The cell that holds a point, and where in it from 0 to 1; `None` outside the box.
    pub fn locate(&self, point: &Vec3) -> Option<([usize; 3], [f64; 3])> {
        let (mut cell, mut part) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            if !(self.min[k]..=self.max[k]).contains(&point[k]) {
                return None;
            }
            let at = (point[k] - self.min[k]) / (self.max[k] - self.min[k]) * self.cells[k] as f64;
            cell[k] = (at as usize).min(self.cells[k] - 1);
            part[k] = at - cell[k] as f64;
        }
        Some((cell, part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_found_in_their_cells_and_nowhere_outside() {
        let grid = Grid::new(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 0.5, 3.0), 0.1);
        assert_eq!(grid.cells, [20, 5, 10]);
        let (cell, part) = grid.locate(&Vec3::new(0.05, 0.5, 2.0)).unwrap();
        assert_eq!(cell, [10, 4, 0]);
        assert!((part[0] - 0.5).abs() < 1e-12 && part[1] == 1.0 && part[2] == 0.0);
        assert!(grid.locate(&Vec3::new(1.0 + 1e-12, 0.1, 2.5)).is_none());
        assert!(grid.locate(&Vec3::new(f64::NAN, 0.1, 2.5)).is_none());
        assert_eq!(grid.cell_indices(grid.cell([7, 3, 9])), [7, 3, 9]);
        assert!((grid.point([20.0, 5.0, 10.0]) - grid.max).norm() < 1e-15);
    }
}
