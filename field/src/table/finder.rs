//! Finding points in bricks, four at a time.

use meshes::Vec3;

use super::bspline::splines;
use super::lanes::Lanes;
use super::octree::{NONE, Octree};
use super::spline::{CELLS, CUBIC, edge, stride};

/// Points that are found together.
pub(super) const TOGETHER: usize = 4;

/// The brick is whole: the rest is its slot.
const WHOLE: u32 = 1 << 31;

/// One in the lanes whose bits are set.
const ONES: [[f64; 4]; 16] = {
    let mut ones = [[0.0; 4]; 16];
    let mut n = 0;
    while n < 64 {
        ones[n / 4][n % 4] = ((n / 4) >> (n % 4) & 1) as f64;
        n += 1;
    }
    ones
};

/// What finds a point in an octree.
pub(super) struct Places {
    min: Vec3,
    max: Vec3,
    /// Coarsest bricks per metre.
    per_metre: Vec3,
    roots: [f64; 3],
    /// For each brick the first of its parts, or [`WHOLE`] and its slot, or [`NONE`].
    descent: Vec<u32>,
}

impl Places {
    pub fn new(octree: &Octree, slots: &[u32]) -> Self {
        let grid = octree.grid();
        let descent = octree
            .parts()
            .zip(slots)
            .map(|(parts, slot)| match (parts, *slot) {
                (NONE, NONE) => NONE,
                (NONE, slot) => WHOLE | slot,
                (parts, _) => parts,
            })
            .collect();
        let roots = grid.cells.map(|n| n as f64);
        Self { min: grid.min, max: grid.max, per_metre: grid.spacing().map(f64::recip), roots, descent }
    }
}

/// Where points lie.
#[derive(Clone, Copy)]
pub(super) struct Found<const REACH: usize> {
    /// Slots of their bricks; [`NONE`] for points that are in no interpolated brick.
    pub slot: [u32; TOGETHER],
    /// Where the coefficients that they need begin, within those of a brick and a channel.
    pub first: [u32; TOGETHER],
    /// For each point 1 and how many cells it lies from the middle of its brick.
    pub from_middle: [[f64; 4]; TOGETHER],
    /// For each point 1 and cells per metre, from slopes per cell to slopes per metre.
    pub scale: [[f64; 4]; TOGETHER],
    /// For each point values and slopes (per cell) of the splines along x, in vectors of four; those of degree five end with two
    /// zeros.
    pub x: [[[[f64; 4]; REACH]; 2]; TOGETHER],
    /// Values and slopes along y and z: of spline 2 i + j at each point in place (i, j).
    pub y: [Across<REACH>; 2],
    pub z: [Across<REACH>; 2],
}

impl<const REACH: usize> Found<REACH> {
    /// Nothing yet.
    pub const NOTHING: Self = Self {
        slot: [NONE; TOGETHER],
        first: [0; TOGETHER],
        from_middle: [[0.0; 4]; TOGETHER],
        scale: [[0.0; 4]; TOGETHER],
        x: [[[[0.0; 4]; REACH]; 2]; TOGETHER],
        y: [[[[0.0; TOGETHER]; 2]; REACH]; 2],
        z: [[[[0.0; TOGETHER]; 2]; REACH]; 2],
    };
}

/// Of each spline at each point.
type Across<const REACH: usize> = [[[f64; TOGETHER]; 2]; REACH];

/// Finds points with vectors.
pub(super) struct Finder<'a, L: Lanes, const REACH: usize> {
    lanes: L,
    descent: &'a [u32],
    min: [L::V; 3],
    max: [L::V; 3],
    /// Coarsest bricks per metre.
    per_metre: [L::V; 3],
    /// The coarsest bricks along each axis.
    roots: [L::V; 3],
    /// The last of them.
    last: [L::V; 3],
    /// Cells of the coarsest bricks per metre.
    scale: [L::V; 3],
}

impl<'a, L: Lanes, const REACH: usize> Finder<'a, L, REACH> {
    #[inline(always)]
    pub fn new(lanes: L, places: &'a Places) -> Self {
        let (min, max, rate, [x, y, z]) = (places.min, places.max, places.per_metre, places.roots);
        let cells = CELLS as f64;
        Self {
            lanes,
            descent: &places.descent,
            min: [lanes.splat(min.x), lanes.splat(min.y), lanes.splat(min.z)],
            max: [lanes.splat(max.x), lanes.splat(max.y), lanes.splat(max.z)],
            per_metre: [lanes.splat(rate.x), lanes.splat(rate.y), lanes.splat(rate.z)],
            roots: [lanes.splat(x), lanes.splat(y), lanes.splat(z)],
            last: [lanes.splat(x - 1.0), lanes.splat(y - 1.0), lanes.splat(z - 1.0)],
            scale: [lanes.splat(cells * rate.x), lanes.splat(cells * rate.y), lanes.splat(cells * rate.z)],
        }
    }

    /// Finds the first so many of four points.
    #[inline(always)]
    pub fn find(&self, points: &[Vec3; TOGETHER], count: usize, found: &mut Found<REACH>) {
        let lanes = self.lanes;
        let one = lanes.splat(1.0);
        let [a, b, c, d] = points;
        let triples = [[a.x, a.y, a.z, b.x], [b.y, b.z, c.x, c.y], [c.z, d.x, d.y, d.z]];
        let point = lanes.triples([lanes.of(triples[0]), lanes.of(triples[1]), lanes.of(triples[2])]);
        let mut inside = (1 << count) - 1;
        // Where in the coarsest brick, and which it is.
        let (mut at, mut root) = (point, point);
        for k in 0..3 {
            inside &= lanes.at_least(point[k], self.min[k]) & lanes.at_least(self.max[k], point[k]);
            let bricks = lanes.mul(lanes.sub(point[k], self.min[k]), self.per_metre[k]);
            // The upper face belongs to the last brick.
            root[k] = lanes.min(lanes.floor(bricks), self.last[k]);
            at[k] = lanes.sub(bricks, root[k]);
        }
        let number = lanes.mul_add(lanes.mul_add(root[2], self.roots[1], root[1]), self.roots[0], root[0]);
        let number = self.whole(number);
        let mut next = [NONE; TOGETHER];
        let mut halved = 0;
        for l in 0..TOGETHER {
            if inside >> l & 1 == 1 {
                next[l] = self.descent[number[l] as usize];
                halved |= !next[l] & WHOLE;
            }
        }
        let mut fineness = one;
        while halved != 0 {
            halved = 0;
            let (mut upper, mut parts, mut goes_on) = (at, [0; 3], 0);
            for k in 0..3 {
                at[k] = lanes.add(at[k], at[k]);
                upper[k] = lanes.min(lanes.floor(at[k]), one);
                parts[k] = lanes.at_least(upper[k], one);
            }
            for (l, next) in next.iter_mut().enumerate() {
                if *next & WHOLE == 0 {
                    goes_on |= 1 << l;
                    let part = (parts[0] >> l & 1) + 2 * (parts[1] >> l & 1) + 4 * (parts[2] >> l & 1);
                    *next = self.descent[(*next + part) as usize];
                    halved |= !*next & WHOLE;
                }
            }
            let goes_on = lanes.of(ONES[goes_on % ONES.len()]);
            // Half of what was doubled, where the brick is whole.
            let stays = lanes.mul(lanes.sub(one, goes_on), lanes.splat(0.5));
            for k in 0..3 {
                let part = lanes.mul(lanes.sub(at[k], upper[k]), goes_on);
                at[k] = lanes.mul_add(at[k], stays, part);
            }
            fineness = lanes.mul_add(fineness, goes_on, fineness);
        }
        let (mut cell, mut middle) = (at, at);
        for k in 0..3 {
            let cells = lanes.mul(at[k], lanes.splat(CELLS as f64));
            cell[k] = lanes.min(lanes.floor(cells), lanes.splat(CELLS as f64 - 1.0));
            at[k] = lanes.sub(cells, cell[k]);
            middle[k] = lanes.sub(cells, lanes.splat(CELLS as f64 / 2.0));
        }
        let (row, layer) = (stride(REACH) as f64, (stride(REACH) * edge(REACH)) as f64);
        let first = lanes.mul_add(cell[1], lanes.splat(row), cell[0]);
        let first = self.whole(lanes.mul_add(cell[2], lanes.splat(layer), first));
        let scale = [
            lanes.mul(self.scale[0], fineness),
            lanes.mul(self.scale[1], fineness),
            lanes.mul(self.scale[2], fineness),
        ];
        found.slot = [slot(next[0]), slot(next[1]), slot(next[2]), slot(next[3])];
        found.first = first;
        found.from_middle = self.each([one, middle[0], middle[1], middle[2]]);
        found.scale = self.each([one, scale[0], scale[1], scale[2]]);
        self.along_x(at[0], &mut found.x);
        self.across(at[1], &mut found.y);
        self.across(at[2], &mut found.z);
    }

    /// Whole numbers from 0 to 2^32 - 1 as such: they become the last bits of the sum with 2^52. Conversions with `as` would take
    /// five times as long to make sure of what is known here.
    #[inline(always)]
    fn whole(&self, numbers: L::V) -> [u32; 4] {
        let [a, b, c, d] = self.lanes.numbers(self.lanes.add(numbers, self.lanes.splat((1_u64 << 52) as f64)));
        [a.to_bits() as u32, b.to_bits() as u32, c.to_bits() as u32, d.to_bits() as u32]
    }

    /// Four numbers of each point, from vectors of one number of all points.
    #[inline(always)]
    fn each(&self, vectors: [L::V; 4]) -> [[f64; 4]; TOGETHER] {
        let [a, b, c, d] = self.lanes.transposed(vectors);
        [self.lanes.numbers(a), self.lanes.numbers(b), self.lanes.numbers(c), self.lanes.numbers(d)]
    }

    #[inline(always)]
    fn along_x(&self, part: L::V, along: &mut [[[[f64; 4]; REACH]; 2]; TOGETHER]) {
        let zero = self.lanes.splat(0.0);
        let both = splines::<L, REACH>(self.lanes, part);
        for of in 0..2 {
            let [a, b, c, d, e, f] = both[of];
            let first = self.each([a, b, c, d]);
            for l in 0..TOGETHER {
                along[l][of][0] = first[l];
            }
            if REACH > CUBIC {
                let last = self.each([e, f, zero, zero]);
                for l in 0..TOGETHER {
                    along[l][of][1] = last[l];
                }
            }
        }
    }

    #[inline(always)]
    fn across(&self, part: L::V, across: &mut [Across<REACH>; 2]) {
        let both = splines::<L, REACH>(self.lanes, part);
        for of in 0..2 {
            for k in 0..2 * REACH {
                across[of][k / 2][k % 2] = self.lanes.numbers(both[of][k]);
            }
        }
    }
}

#[inline(always)]
fn slot(whole: u32) -> u32 {
    if whole == NONE { NONE } else { whole & !WHOLE }
}
