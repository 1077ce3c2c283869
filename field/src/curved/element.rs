//! The elements that a surface is cut into.

use meshes::{Patch, Vec3};
use serde::{Deserialize, Serialize};

use crate::gauss::gauss;

/// A rectangle in the parameters of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Element {
    /// Which patch.
    pub patch: u32,
    /// Least ξ and η.
    pub low: [f64; 2],
    /// Greatest ξ and η.
    pub high: [f64; 2],
}

impl Element {
    /// Parameters of the patch at local ones from 0 to 1.
    pub fn parameters(&self, x: f64, y: f64) -> [f64; 2] {
        [self.low[0] + x * (self.high[0] - self.low[0]), self.low[1] + y * (self.high[1] - self.low[1])]
    }

    /// Halves along one direction.
    pub fn halves(&self, along: usize) -> [Self; 2] {
        let middle = 0.5 * (self.low[along] + self.high[along]);
        let (mut first, mut last) = (*self, *self);
        first.high[along] = middle;
        last.low[along] = middle;
        [first, last]
    }

    /// Halves along the side that is longer in space, as corners.
    pub fn halves_of_longer_side(&self, patch: &Patch) -> [([f64; 2], [f64; 2]); 2] {
        let sides = Ball::new(patch, self.low, self.high).sides;
        self.halves(usize::from(sides[1] > sides[0])).map(|half| (half.low, half.high))
    }
}

/// Where a rectangle of a patch is and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its middle, m.
    pub center: Vec3,
    /// Largest distance of its corners and of the middles of its sides from there, m.
    pub reach: f64,
    /// Length of its middle lines along ξ and η, m.
    pub sides: [f64; 2],
}

impl Ball {
    /// Of a rectangle of a patch.
    #[inline(always)]
    pub fn new(patch: &Patch, low: [f64; 2], high: [f64; 2]) -> Self {
        let middle = |k: usize| 0.5 * (low[k] + high[k]);
        let rows = [low[0], middle(0), high[0]].map(|x| patch.row(x));
        let columns = [low[1], middle(1), high[1]].map(|y| patch.column(y));
        let e = patch.direction();
        let at = |i: usize, j: usize| columns[j].base + columns[j].step * rows[i][0] + e * rows[i][1];
        let center = at(1, 1);
        let off = |i: usize, j: usize| (at(i, j) - center).norm();
        let [left, right, below, above] = [off(0, 1), off(2, 1), off(1, 0), off(1, 2)];
        let corners = [off(0, 0), off(0, 2), off(2, 0), off(2, 2)];
        let reach = corners.into_iter().fold(left.max(right).max(below).max(above), f64::max);
        Self { center, reach, sides: [left + right, below + above] }
    }
}

/// A surface cut into elements of one order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvedMesh {
    /// The patches of all electrodes.
    pub patches: Vec<Patch>,
    /// Electrode of each patch.
    pub electrode: Vec<u32>,
    /// Number of electrodes.
    pub electrodes: usize,
    /// Elements; together they cover every patch once.
    pub elements: Vec<Element>,
    /// Points along each side of an element.
    pub order: usize,
}

impl CurvedMesh {
    /// Number of unknowns: points of all elements.
    pub fn unknowns(&self) -> usize {
        self.elements.len() * self.order * self.order
    }

    /// Electrode of an element.
    pub fn electrode_of(&self, element: usize) -> usize {
        self.electrode[self.elements[element].patch as usize] as usize
    }

    /// Patch of an element.
    pub fn patch_of(&self, element: usize) -> &Patch {
        &self.patches[self.elements[element].patch as usize]
    }

    /// All points, element after element, `u * order + v` within one, m.
    pub fn points(&self) -> Vec<Vec3> {
        let rule = gauss(self.order);
        let mut points = Vec::with_capacity(self.unknowns());
        for element in &self.elements {
            let patch = &self.patches[element.patch as usize];
            let side = |k: usize| -> Vec<f64> {
                rule.points.iter().map(|x| element.low[k] + x * (element.high[k] - element.low[k])).collect()
            };
            let rows: Vec<[f64; 2]> = side(0).iter().map(|&x| patch.row(x)).collect();
            let columns: Vec<_> = side(1).iter().map(|&y| patch.column(y)).collect();
            let e = patch.direction();
            for [s, c] in &rows {
                points.extend(columns.iter().map(|column| column.base + column.step * *s + e * *c));
            }
        }
        points
    }

    /// The electrode of each point.
    pub fn electrode_of_points(&self) -> Vec<u32> {
        let each = self.order * self.order;
        (0..self.elements.len()).flat_map(|e| std::iter::repeat_n(self.electrode_of(e) as u32, each)).collect()
    }
}
