//! Bricks over a box, halved where the field needs smaller ones: an octree.
//!
//! A brick is a cell of the grid on which derivatives are known, and holds 4 x 4 x 4 cells of the splines that are evaluated.
//! Neighbours that touch in a face, an edge or a corner differ by a factor of two at most.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use super::grid::Grid;

/// Times that a brick may be halved.
pub(super) const MAX_LEVEL: u8 = 12;

/// Fewer coarsest bricks than this are along each axis, so that the places of the smallest ones can be counted.
pub(super) const MOST_BRICKS: usize = 1 << (31 - MAX_LEVEL);

/// Stands for no brick, no node, no numbers.
pub(super) const NONE: u32 = u32::MAX;

/// A brick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Brick {
    /// How often the coarsest brick that holds it was halved.
    pub level: u8,
    /// Its place, counted in bricks of its level.
    pub at: [u32; 3],
    /// Whether it is interpolated; if not it is left to the panel sum.
    pub tabulated: bool,
    /// The first of its eight parts, if it was halved.
    parts: u32,
    /// The nodes at its corners, if they are known: corner `i + 2 j + 4 k` stands at (i, j, k).
    pub(super) corners: [u32; 8],
}

impl Brick {
    fn new(level: u8, at: [u32; 3]) -> Self {
        Self { level, at, tabulated: false, parts: NONE, corners: [NONE; 8] }
    }

    /// Whether it was halved.
    pub fn is_halved(&self) -> bool {
        self.parts != NONE
    }

    /// Whether the nodes at its corners are known.
    pub(super) fn is_filled(&self) -> bool {
        self.corners[0] != NONE
    }

    /// The place of a corner in units of the smallest bricks there may be: one name for each node, whatever brick it belongs to.
    pub(super) fn corner(&self, corner: usize) -> [u32; 3] {
        std::array::from_fn(|k| (self.at[k] + (corner >> k & 1) as u32) << (MAX_LEVEL - self.level))
    }

    /// Volume in units of the coarsest bricks.
    pub(super) fn volume(&self) -> f64 {
        0.125_f64.powi(i32::from(self.level))
    }
}

/// All bricks of a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Octree {
    /// The coarsest bricks are its cells.
    grid: Grid,
    /// The coarsest ones, x fastest, then the parts of halved ones, eight together.
    bricks: Vec<Brick>,
}

impl Octree {
    /// The coarsest bricks: the cells of a grid.
    pub fn new(grid: Grid) -> Self {
        let bricks = (0..grid.cell_count()).map(|n| Brick::new(0, grid.cell_indices(n).map(|i| i as u32))).collect();
        Self { grid, bricks }
    }

    /// The grid of the coarsest bricks.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// All bricks, halved ones too.
    pub fn all(&self) -> &[Brick] {
        &self.bricks
    }

    pub(super) fn brick_mut(&mut self, number: usize) -> &mut Brick {
        &mut self.bricks[number]
    }

    /// Bricks that were not halved, with their numbers.
    pub fn whole(&self) -> impl Iterator<Item = (usize, &Brick)> + Clone {
        self.bricks.iter().enumerate().filter(|(_, brick)| !brick.is_halved())
    }

    /// The grid whose cells are the bricks of a level.
    pub(super) fn grid_of(&self, level: u8) -> Grid {
        Grid { cells: self.grid.cells.map(|n| n << level), ..self.grid }
    }

    /// Edges of the bricks of a level, m.
    pub fn size(&self, level: u8) -> Vec3 {
        self.grid.spacing() * 0.5_f64.powi(i32::from(level))
    }

    /// A point of a brick, from 0 to 1 along each edge, m.
    pub fn point(&self, brick: &Brick, part: [f64; 3]) -> Vec3 {
        let size = self.size(brick.level);
        Vec3::from_fn(|k, _| self.grid.min[k] + (f64::from(brick.at[k]) + part[k]) * size[k])
    }

    /// Halves a brick; nothing is known of its parts.
    pub(super) fn halve(&mut self, number: usize) {
        let brick = self.bricks[number];
        let first = self.bricks.len() as u32;
        self.bricks.extend(
            (0..8).map(|part| Brick::new(brick.level + 1, std::array::from_fn(|k| 2 * brick.at[k] + (part >> k & 1)))),
        );
        self.bricks[number] = Brick { tabulated: false, parts: first, ..brick };
    }

    /// The brick of that level and place, or the larger whole one that holds it; `None` outside the box.
    pub(super) fn holder(&self, level: u8, at: [i64; 3]) -> Option<usize> {
        if (0..3).any(|k| at[k] < 0 || at[k] >= (self.grid.cells[k] as i64) << level) {
            return None;
        }
        let mut number = self.grid.cell(at.map(|i| (i >> level) as usize));
        for down in (0..level).rev() {
            let Brick { parts, .. } = self.bricks[number];
            if parts == NONE {
                break;
            }
            number = parts as usize + (0..3).map(|k| ((at[k] >> down & 1) << k) as usize).sum::<usize>();
        }
        Some(number)
    }

    /// The bricks around a brick, up to so many `steps` away, and itself, of its own size or larger: with n = 2 steps + 1 entry
    /// `(x + steps) + n ((y + steps) + n (z + steps))` lies x, y, z bricks away.
    pub(super) fn around(&self, brick: &Brick, steps: usize) -> Vec<Option<usize>> {
        let side = 2 * steps + 1;
        let at = |n: usize| {
            let step = [n % side, n / side % side, n / (side * side)];
            self.holder(brick.level, std::array::from_fn(|k| i64::from(brick.at[k]) + step[k] as i64 - steps as i64))
        };
        (0..side * side * side).map(at).collect()
    }

    /// The whole brick that holds a point, and where in it from 0 to 1; `None` outside the box.
    pub fn locate(&self, point: &Vec3) -> Option<(usize, [f64; 3])> {
        let (cell, mut part) = self.grid.locate(point)?;
        let mut number = self.grid.cell(cell);
        while self.bricks[number].parts != NONE {
            let mut which = 0;
            for (k, x) in part.iter_mut().enumerate() {
                let upper = usize::from(*x >= 0.5);
                which |= upper << k;
                *x = 2.0 * *x - upper as f64;
            }
            number = self.bricks[number].parts as usize + which;
        }
        Some((number, part))
    }

    /// The parts of each brick, [`NONE`] for whole ones: all that a descent needs.
    pub(super) fn parts(&self) -> impl Iterator<Item = u32> {
        self.bricks.iter().map(|brick| brick.parts)
    }

    /// Adds to the marked bricks all larger neighbours of what will become of them, until there are none.
    pub(super) fn balance(&self, marked: &mut Vec<usize>) {
        let mut is_marked = vec![false; self.bricks.len()];
        marked.iter().for_each(|m| is_marked[*m] = true);
        let mut next = 0;
        while next < marked.len() {
            let brick = &self.bricks[marked[next]];
            next += 1;
            for neighbour in self.around(brick, 1).into_iter().flatten() {
                if self.bricks[neighbour].level < brick.level && !is_marked[neighbour] {
                    is_marked[neighbour] = true;
                    marked.push(neighbour);
                }
            }
        }
    }

    /// Whether places, parts and corners are what they should be for so many nodes; a tree that was read from somewhere may lie.
    pub(super) fn is_whole(&self, nodes: usize) -> bool {
        let sensible = self.grid.cells.iter().all(|n| *n > 0 && *n < MOST_BRICKS);
        let roots = self.grid.cells.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
        let good = |(number, brick): (usize, &Brick)| {
            let parts = brick.parts as usize;
            let sound = brick.parts == NONE
                || (parts > number
                    && parts.checked_add(8).is_some_and(|end| end <= self.bricks.len())
                    && (0..8).all(|part| {
                        let own = &self.bricks[parts + part];
                        own.level == brick.level + 1
                            && (0..3).all(|k| own.at[k] == 2 * brick.at[k] + (part >> k & 1) as u32)
                    }));
            let in_place = (0..3).all(|k| (brick.at[k] as usize) < self.grid.cells[k] << brick.level);
            let known = brick.corners.iter().all(|c| (*c as usize) < nodes);
            brick.level <= MAX_LEVEL && in_place && sound && (known || !brick.tabulated)
        };
        sensible && roots.is_some_and(|n| n <= self.bricks.len()) && self.bricks.iter().enumerate().all(good)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree() -> Octree {
        let mut tree = Octree::new(Grid::new(Vec3::repeat(-1.0), Vec3::repeat(1.0), 0.5));
        let mut marked = vec![21];
        tree.balance(&mut marked);
        marked.into_iter().for_each(|m| tree.halve(m));
        let mut deeper = vec![tree.all().len() - 1];
        tree.balance(&mut deeper);
        deeper.into_iter().for_each(|m| tree.halve(m));
        tree
    }

    #[test]
    fn points_are_found_in_their_bricks() {
        let tree = tree();
        for point in [Vec3::new(0.3, -0.9, 0.99), Vec3::new(-0.01, -0.02, -0.03), Vec3::repeat(1.0)] {
            let (number, part) = tree.locate(&point).unwrap();
            let brick = &tree.all()[number];
            assert!(!brick.is_halved() && part.iter().all(|x| (0.0..=1.0).contains(x)));
            assert!((tree.point(brick, part) - point).norm() < 1e-14);
            assert_eq!(tree.holder(brick.level, brick.at.map(i64::from)), Some(number));
        }
        assert!(tree.locate(&Vec3::repeat(1.0 + 1e-12)).is_none());
    }

    #[test]
    fn neighbours_differ_by_a_factor_of_two_at_most() {
        let tree = tree();
        assert!(tree.all().iter().any(|brick| brick.level == 2));
        for (_, brick) in tree.whole() {
            for neighbour in tree.around(brick, 1).into_iter().flatten() {
                assert!(tree.all()[neighbour].level + 1 >= brick.level);
            }
        }
        assert!(tree.is_whole(0), "nothing is tabulated");
    }
}
