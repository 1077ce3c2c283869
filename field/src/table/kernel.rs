//! Evaluating splines at points, fast: points are found in batches, and a batch's memory is asked for before it is used.

use meshes::Vec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, x86::V3};

use super::lanes::{Lanes, Plain};
use super::octree::{NONE, Octree};
use super::spline::{CELLS, EDGE, ROWS, Row, Splines};

/// Points that are found before they are evaluated: enough for their memory to be fetched side by side, few enough to stay in
/// the nearest cache.
const BATCH: usize = 16;

/// The brick is whole: the rest is its slot.
const WHOLE: u32 = 1 << 31;

/// Splines with what finds a point in them.
pub(super) struct Kernel {
    min: Vec3,
    max: Vec3,
    /// Coarsest bricks per metre.
    per_metre: Vec3,
    roots: [u32; 3],
    /// For each brick the first of its parts, or [`WHOLE`] and its slot, or [`NONE`].
    descent: Vec<u32>,
    splines: Splines,
    /// What the machine has.
    #[cfg(target_arch = "x86_64")]
    v3: Option<V3>,
}

/// Where a point lies.
#[derive(Clone, Copy, Default)]
struct Found {
    /// The number of the point.
    point: u32,
    slot: u32,
    /// The cell within the brick.
    cell: [u8; 3],
    /// Where in the cell, from 0 to 1.
    part: [f64; 3],
    /// Cells per metre.
    scale: [f64; 3],
}

/// What is wanted of each point.
enum Wanted<'a> {
    /// Potential and gradient of each channel.
    Channels { potential: &'a mut [f64], gradient: &'a mut [Vec3] },
    /// Potential and gradient of a sum of channels with factors for each point.
    Sum { factors: &'a [f64], potential: &'a mut [f64], gradient: &'a mut [Vec3] },
}

impl Kernel {
    pub fn new(octree: &Octree, splines: Splines) -> Self {
        let grid = octree.grid();
        let descent = octree
            .parts()
            .zip(&splines.slots)
            .map(|(parts, slot)| match (parts, *slot) {
                (NONE, NONE) => NONE,
                (NONE, slot) => WHOLE | slot,
                (parts, _) => parts,
            })
            .collect();
        Self {
            min: grid.min,
            max: grid.max,
            per_metre: grid.spacing().map(f64::recip),
            roots: grid.cells.map(|n| n as u32),
            descent,
            splines,
            #[cfg(target_arch = "x86_64")]
            v3: V3::try_new(),
        }
    }

    pub fn channels(&self) -> usize {
        self.splines.channels
    }

    pub fn bytes(&self) -> u64 {
        size_of_val(self.splines.rows.as_slice()) as u64
    }

    /// Potential and gradient of every channel at points, entry `point * channels + channel`; numbers of points that are in no
    /// interpolated brick go to `left`, and nothing is written for them.
    pub fn channels_at(&self, points: &[Vec3], potential: &mut [f64], gradient: &mut [Vec3], left: &mut Vec<usize>) {
        self.dispatch(points, Wanted::Channels { potential, gradient }, left);
    }

    /// Σ_c `factors[point * channels + c]` times channel c at points: one potential and gradient for each.
    pub fn sum_at(
        &self,
        points: &[Vec3],
        factors: &[f64],
        potential: &mut [f64],
        gradient: &mut [Vec3],
        left: &mut Vec<usize>,
    ) {
        self.dispatch(points, Wanted::Sum { factors, potential, gradient }, left);
    }

    fn dispatch(&self, points: &[Vec3], wanted: Wanted, left: &mut Vec<usize>) {
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = self.v3 {
            return lanes.vectorize(Run { lanes, kernel: self, points, wanted, left });
        }
        Run { lanes: Plain, kernel: self, points, wanted, left }.run();
    }

    /// The brick and cell of a point.
    #[inline(always)]
    fn locate(&self, point: &Vec3) -> Option<Found> {
        let inside = (point.x >= self.min.x)
            & (point.x <= self.max.x)
            & (point.y >= self.min.y)
            & (point.y <= self.max.y)
            & (point.z >= self.min.z)
            & (point.z <= self.max.z);
        if !inside {
            return None;
        }
        let mut at = [0.0; 3];
        let mut root = [0_u32; 3];
        for (k, (at, root)) in at.iter_mut().zip(&mut root).enumerate() {
            let bricks = (point[k] - self.min[k]) * self.per_metre[k];
            // The upper face belongs to the last brick.
            *root = (bricks as i32 as u32).min(self.roots[k] - 1);
            *at = bricks - f64::from(*root as i32);
        }
        let mut number = root[0] + self.roots[0] * (root[1] + self.roots[1] * root[2]);
        let mut size = CELLS as f64;
        let mut next = self.descent[number as usize];
        while next & WHOLE == 0 {
            let mut part = 0;
            for (k, x) in at.iter_mut().enumerate() {
                let upper = *x >= 0.5;
                part |= u32::from(upper) << k;
                *x = 2.0 * *x - if upper { 1.0 } else { 0.0 };
            }
            size *= 2.0;
            number = next + part;
            next = self.descent[number as usize];
        }
        if next == NONE {
            return None;
        }
        let mut found = Found { slot: next & !WHOLE, ..Found::default() };
        for k in 0..3 {
            let cells = CELLS as f64 * at[k];
            let cell = (cells as i32).min(CELLS as i32 - 1);
            found.cell[k] = cell as u8;
            found.part[k] = cells - f64::from(cell);
            found.scale[k] = size * self.per_metre[k];
        }
        Some(found)
    }

    /// Asks for the lines of memory that a point will need.
    #[inline(always)]
    fn fetch(&self, found: &Found) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let brick = found.slot as usize * self.splines.channels * ROWS;
            let first = brick + usize::from(found.cell[1]) + EDGE * usize::from(found.cell[2]);
            let rows: *const Row = self.splines.rows.as_ptr().wrapping_add(first);
            for z in 0..4 {
                for y in 0..4 {
                    // Safety: a prefetch reads nothing and never fails, whatever the address.
                    #[allow(unsafe_code)]
                    unsafe {
                        _mm_prefetch::<_MM_HINT_T0>(rows.wrapping_add(y + EDGE * z).cast());
                    }
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = found;
    }
}

impl Found {
    /// From slopes per cell to slopes per metre.
    #[inline(always)]
    fn per_metre(&self, slope: [f64; 3]) -> Vec3 {
        Vec3::new(slope[0] * self.scale[0], slope[1] * self.scale[1], slope[2] * self.scale[2])
    }
}

/// A call for some points.
struct Run<'a, L: Lanes> {
    lanes: L,
    kernel: &'a Kernel,
    points: &'a [Vec3],
    wanted: Wanted<'a>,
    left: &'a mut Vec<usize>,
}

#[cfg(target_arch = "x86_64")]
impl NullaryFnOnce for Run<'_, V3> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.run();
    }
}

impl<L: Lanes> Run<'_, L> {
    #[inline(always)]
    fn run(mut self) {
        let mut found = [Found::default(); BATCH];
        for (batch, points) in self.points.chunks(BATCH).enumerate() {
            let mut count = 0;
            for (p, point) in points.iter().enumerate() {
                let number = batch * BATCH + p;
                match self.kernel.locate(point) {
                    Some(place) => {
                        found[count] = Found { point: number as u32, ..place };
                        self.kernel.fetch(&found[count]);
                        count += 1;
                    }
                    None => self.left.push(number),
                }
            }
            for found in &found[..count] {
                self.evaluate(found);
            }
        }
    }

    #[inline(always)]
    fn evaluate(&mut self, found: &Found) {
        let channels = self.kernel.splines.channels;
        let p = found.point as usize;
        let weights = Weights::new(self.lanes, &found.part);
        let first = found.slot as usize * channels * ROWS;
        let rows = &self.kernel.splines.rows[first..first + channels * ROWS];
        match &mut self.wanted {
            Wanted::Channels { potential, gradient } => {
                let (potential, gradient) = (&mut potential[p * channels..], &mut gradient[p * channels..]);
                for (c, rows) in rows.chunks_exact(ROWS).enumerate() {
                    let [value, x, y, z] = weights.contract(self.lanes, &[rows], &[1.0], found.cell);
                    (potential[c], gradient[c]) = (value, found.per_metre([x, y, z]));
                }
            }
            Wanted::Sum { factors, potential, gradient } => {
                let factors = &factors[p * channels..(p + 1) * channels];
                let [value, x, y, z] = match *factors {
                    [one] => weights.contract(self.lanes, &[rows], &[one], found.cell),
                    [a, b] => {
                        let (first, second) = rows.split_at(ROWS);
                        weights.contract(self.lanes, &[first, second], &[a, b], found.cell)
                    }
                    _ => {
                        let mut sums = [0.0; 4];
                        for (rows, factor) in rows.chunks_exact(ROWS).zip(factors) {
                            let own = weights.contract(self.lanes, &[rows], &[*factor], found.cell);
                            (0..4).for_each(|k| sums[k] += own[k]);
                        }
                        sums
                    }
                };
                (potential[p], gradient[p]) = (value, found.per_metre([x, y, z]));
            }
        }
    }
}

/// Values and slopes (per cell) of the four cubic B-splines along each axis that do not vanish at a point.
struct Weights<L: Lanes> {
    /// Along x: values, slopes.
    x: [L::V; 2],
    /// The k-th spline along y and z: values, slopes.
    y: [[f64; 2]; 4],
    z: [[f64; 2]; 4],
}

impl<L: Lanes> Weights<L> {
    #[inline(always)]
    fn new(lanes: L, part: &[f64; 3]) -> Self {
        let [x, y, z] = [splines(part[0]), splines(part[1]), splines(part[2])];
        let pairs = |[v, s]: [[f64; 4]; 2]| [[v[0], s[0]], [v[1], s[1]], [v[2], s[2]], [v[3], s[3]]];
        Self { x: [lanes.of(x[0]), lanes.of(x[1])], y: pairs(y), z: pairs(z) }
    }

    /// Value and slopes along x, y and z of a sum of channels with factors.
    #[inline(always)]
    fn contract<const N: usize>(&self, lanes: L, rows: &[&[Row]; N], factors: &[f64; N], cell: [u8; 3]) -> [f64; 4] {
        let zero = lanes.splat(0.0);
        let (x, first) = (usize::from(cell[0] & 3), usize::from(cell[1]) + EDGE * usize::from(cell[2]));
        // Along z, then y, then x.
        let mut plain = [zero; 4];
        let mut sloped = [zero; 4];
        for k in 0..4 {
            let (value, slope) = (lanes.splat(self.z[k][0]), lanes.splat(self.z[k][1]));
            for j in 0..4 {
                let mut row = zero;
                for n in 0..N {
                    let own = &rows[n][first + j + EDGE * k].0;
                    let own = lanes.of([own[x], own[x + 1], own[x + 2], own[x + 3]]);
                    row = match n {
                        // A factor of one channel is left for the end.
                        0 if N == 1 => own,
                        0 => lanes.mul(own, lanes.splat(factors[0])),
                        _ => lanes.mul_add(own, lanes.splat(factors[n]), row),
                    };
                }
                plain[j] = lanes.mul_add(row, value, plain[j]);
                sloped[j] = lanes.mul_add(row, slope, sloped[j]);
            }
        }
        let (mut value, mut along_y, mut along_z) = (zero, zero, zero);
        for j in 0..4 {
            let (y, slope) = (lanes.splat(self.y[j][0]), lanes.splat(self.y[j][1]));
            value = lanes.mul_add(plain[j], y, value);
            along_y = lanes.mul_add(plain[j], slope, along_y);
            along_z = lanes.mul_add(sloped[j], y, along_z);
        }
        let [x, slope] = self.x;
        let mut sums =
            lanes.sums([lanes.mul(value, x), lanes.mul(value, slope), lanes.mul(along_y, x), lanes.mul(along_z, x)]);
        if N == 1 {
            sums = [factors[0] * sums[0], factors[0] * sums[1], factors[0] * sums[2], factors[0] * sums[3]];
        }
        sums
    }
}

/// Values and slopes (per cell) of the four cubic B-splines that do not vanish at t in [0, 1] of a cell.
#[inline(always)]
fn splines(t: f64) -> [[f64; 4]; 2] {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    let sixth = 1.0 / 6.0;
    [
        [sixth * s2 * s, (0.5 * t - 1.0) * t2 + 2.0 / 3.0, (0.5 * s - 1.0) * s2 + 2.0 / 3.0, sixth * t2 * t],
        [-0.5 * s2, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_splines_add_up_to_one_and_slopes_are_slopes() {
        for t in [0.0, 0.2, 0.71, 1.0] {
            let [value, slope] = splines(t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15 && slope.iter().sum::<f64>().abs() < 1e-15);
            // The node's own place, from minus one to two: a cubic spline reproduces it.
            let place: f64 = (0..4).map(|k| (k as f64 - 1.0) * value[k]).sum();
            assert!((place - t).abs() < 1e-15);
            let (lower, upper) = (splines(t - 1e-5)[0], splines(t + 1e-5)[0]);
            for k in 0..4 {
                assert!(((upper[k] - lower[k]) / 2e-5 - slope[k]).abs() < 1e-9);
            }
        }
    }
}
