//! Evaluating splines at points, fast: points are found in batches, and a batch's memory is asked for before it is used.

use meshes::Vec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, x86::V3};

use super::lanes::{Lanes, Plain};
use super::octree::{NONE, Octree};
use super::spline::{CELLS, CUBIC, QUINTIC, Splines, edge, per_brick, stride};

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
#[derive(Clone, Copy)]
struct Found<L: Lanes> {
    /// The number of the point.
    point: u32,
    slot: u32,
    /// Where the coefficients that it needs begin, within those of its brick and a channel.
    first: usize,
    /// Where in the cell, from 0 to 1.
    part: L::V,
    /// 1 and cells per metre, from slopes per cell to slopes per metre.
    scale: L::V,
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
        size_of_val(self.splines.numbers()) as u64
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
        if self.splines.reach == CUBIC {
            self.dispatch_to::<CUBIC>(points, wanted, left);
        } else {
            self.dispatch_to::<QUINTIC>(points, wanted, left);
        }
    }

    fn dispatch_to<const REACH: usize>(&self, points: &[Vec3], wanted: Wanted, left: &mut Vec<usize>) {
        let (numbers, channels) = (self.splines.numbers(), self.splines.channels);
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = self.v3 {
            return lanes.vectorize(Run::<V3, REACH> { lanes, kernel: self, numbers, channels, points, wanted, left });
        }
        Run::<Plain, REACH> { lanes: Plain, kernel: self, numbers, channels, points, wanted, left }.run();
    }
}

/// A call for some points.
struct Run<'a, L: Lanes, const REACH: usize> {
    lanes: L,
    kernel: &'a Kernel,
    numbers: &'a [f64],
    channels: usize,
    points: &'a [Vec3],
    wanted: Wanted<'a>,
    left: &'a mut Vec<usize>,
}

#[cfg(target_arch = "x86_64")]
impl<const REACH: usize> NullaryFnOnce for Run<'_, V3, REACH> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.run();
    }
}

impl<L: Lanes, const REACH: usize> Run<'_, L, REACH> {
    /// Splines along each axis that do not vanish at a point.
    const WINDOW: usize = 2 * REACH;

    #[inline(always)]
    fn run(mut self) {
        let zero = self.lanes.splat(0.0);
        let mut found = [Found::<L> { point: 0, slot: 0, first: 0, part: zero, scale: zero }; BATCH];
        let finder = Finder::<L, REACH>::new(self.lanes, self.kernel);
        for (batch, points) in self.points.chunks(BATCH).enumerate() {
            let mut count = 0;
            for (p, point) in points.iter().enumerate() {
                let number = batch * BATCH + p;
                match finder.find(point, number as u32) {
                    Some(place) => {
                        self.fetch(&place);
                        found[count] = place;
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

    /// Asks for the lines of memory that a point will need.
    #[inline(always)]
    fn fetch(&self, found: &Found<L>) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let first = found.slot as usize * self.channels * per_brick(REACH) + found.first;
            let first: *const f64 = self.numbers.as_ptr().wrapping_add(first);
            for z in 0..Self::WINDOW {
                for y in 0..Self::WINDOW {
                    // Safety: a prefetch reads nothing and never fails, whatever the address.
                    #[allow(unsafe_code)]
                    unsafe {
                        _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(stride(REACH) * (y + edge(REACH) * z)).cast());
                    }
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = found;
    }

    #[inline(always)]
    fn evaluate(&mut self, found: &Found<L>) {
        let (lanes, channels, brick) = (self.lanes, self.channels, per_brick(REACH));
        let p = found.point as usize;
        let weights = Weights::<L, REACH>::new(lanes, found.part);
        let first = found.slot as usize * channels * brick;
        let numbers = &self.numbers[first..first + channels * brick];
        match &mut self.wanted {
            Wanted::Channels { potential, gradient } => {
                for c in 0..channels {
                    let window = Self::window(numbers, found, c);
                    let sums = weights.contract(lanes, &[window], &[1.0]);
                    let [value, x, y, z] = lanes.numbers(lanes.mul(sums, found.scale));
                    (potential[p * channels + c], gradient[p * channels + c]) = (value, Vec3::new(x, y, z));
                }
            }
            Wanted::Sum { factors, potential, gradient } => {
                let factors = &factors[p * channels..(p + 1) * channels];
                let first = Self::window(numbers, found, 0);
                let sums = match *factors {
                    [one] => weights.contract(lanes, &[first], &[one]),
                    [a, b] => weights.contract(lanes, &[first, Self::window(numbers, found, 1)], &[a, b]),
                    _ => {
                        let mut sums = lanes.splat(0.0);
                        for (c, factor) in factors.iter().enumerate() {
                            let own = weights.contract(lanes, &[Self::window(numbers, found, c)], &[1.0]);
                            sums = lanes.mul_add(own, lanes.splat(*factor), sums);
                        }
                        sums
                    }
                };
                let [value, x, y, z] = lanes.numbers(lanes.mul(sums, found.scale));
                (potential[p], gradient[p]) = (value, Vec3::new(x, y, z));
            }
        }
    }

    /// What a point needs of a channel of its brick: the rows from its first to its last.
    #[inline(always)]
    fn window<'b>(brick: &'b [f64], found: &Found<L>, channel: usize) -> &'b [f64] {
        let first = channel * per_brick(REACH) + found.first;
        &brick[first..first + window(REACH)]
    }
}

/// Finds the bricks and cells of points.
struct Finder<'a, L: Lanes, const REACH: usize> {
    lanes: L,
    descent: &'a [u32],
    min: L::V,
    max: L::V,
    /// Coarsest bricks per metre.
    per_metre: L::V,
    /// The last of the coarsest bricks along each axis.
    last: L::V,
    /// From the coarsest brick along each axis to its number.
    number: L::V,
    /// 1 and the finest cells of the coarsest bricks per metre.
    scale: L::V,
}

impl<'a, L: Lanes, const REACH: usize> Finder<'a, L, REACH> {
    #[inline(always)]
    fn new(lanes: L, kernel: &'a Kernel) -> Self {
        let (min, max, rate) = (kernel.min, kernel.max, kernel.per_metre);
        let [x, y, z] = kernel.roots.map(f64::from);
        let cells = CELLS as f64;
        Self {
            lanes,
            descent: &kernel.descent,
            min: lanes.of([min.x, min.y, min.z, 0.0]),
            max: lanes.of([max.x, max.y, max.z, 0.0]),
            per_metre: lanes.of([rate.x, rate.y, rate.z, 0.0]),
            last: lanes.of([x - 1.0, y - 1.0, z - 1.0, 0.0]),
            number: lanes.of([1.0, x, x * y, 0.0]),
            scale: lanes.of([1.0, cells * rate.x, cells * rate.y, cells * rate.z]),
        }
    }

    #[inline(always)]
    fn find(&self, point: &Vec3, number: u32) -> Option<Found<L>> {
        let lanes = self.lanes;
        let point = lanes.of([point.x, point.y, point.z, 0.0]);
        let one = lanes.splat(1.0);
        if lanes.at_least(point, self.min) & lanes.at_least(self.max, point) != 0b1111 {
            return None;
        }
        let bricks = lanes.mul(lanes.sub(point, self.min), self.per_metre);
        // The upper face belongs to the last brick.
        let root = lanes.min(lanes.floor(bricks), self.last);
        let mut at = lanes.sub(bricks, root);
        let mut next = self.descent[whole(lanes.dot(root, self.number))];
        let mut scale = self.scale;
        while next & WHOLE == 0 {
            let part = lanes.at_least(at, lanes.splat(0.5)) & 0b111;
            let double = lanes.mul_add(at, one, at);
            at = lanes.sub(double, lanes.min(lanes.floor(double), one));
            scale = lanes.mul(scale, lanes.of([1.0, 2.0, 2.0, 2.0]));
            next = self.descent[(next + part) as usize];
        }
        if next == NONE {
            return None;
        }
        let cells = lanes.mul(at, lanes.splat(CELLS as f64));
        let cell = lanes.min(lanes.floor(cells), lanes.splat(CELLS as f64 - 1.0));
        let rows = stride(REACH) as f64;
        let first = whole(lanes.dot(cell, lanes.of([1.0, rows, rows * edge(REACH) as f64, 0.0])));
        Some(Found { point: number, slot: next & !WHOLE, first, part: lanes.sub(cells, cell), scale })
    }
}

/// A whole number from 0 to 2^32 - 1 as one: it becomes the last bits of the sum with 2^52. A conversion with `as` would take five
/// times as long to make sure of what is known here.
#[inline(always)]
fn whole(number: f64) -> usize {
    ((number + (1_u64 << 52) as f64).to_bits() as u32) as usize
}

/// Values and slopes (per cell) of the B-splines along each axis that do not vanish at a point.
struct Weights<L: Lanes, const REACH: usize> {
    /// Along x: values and slopes, in vectors of four; those of degree five end with two zeros.
    x: [[L::V; 2]; 2],
    /// Along y and z: values and slopes.
    y: [[f64; 8]; 2],
    z: [[f64; 8]; 2],
}

impl<L: Lanes, const REACH: usize> Weights<L, REACH> {
    #[inline(always)]
    fn new(lanes: L, part: L::V) -> Self {
        let [x, y, z, _] = lanes.numbers(part);
        let ([x, x_slope], [y, y_slope], [z, z_slope]) =
            (splines::<L, REACH>(lanes, x), splines::<L, REACH>(lanes, y), splines::<L, REACH>(lanes, z));
        Self {
            x: [x, x_slope],
            y: [numbers(lanes, y), numbers(lanes, y_slope)],
            z: [numbers(lanes, z), numbers(lanes, z_slope)],
        }
    }

    /// Value and slopes along x, y and z of a sum of channels with factors, from the coefficients of each from the first on.
    #[inline(always)]
    fn contract<const N: usize>(&self, lanes: L, numbers: &[&[f64]; N], factors: &[f64; N]) -> L::V {
        let zero = lanes.splat(0.0);
        let mut sums = [zero; 4];
        for half in 0..REACH - 1 {
            // Along z, then y, then x.
            let mut plain = [zero; 6];
            let mut sloped = [zero; 6];
            for k in 0..2 * REACH {
                let (value, slope) = (lanes.splat(self.z[0][k]), lanes.splat(self.z[1][k]));
                for j in 0..2 * REACH {
                    let place = stride(REACH) * (j + edge(REACH) * k) + 4 * half;
                    let mut row = zero;
                    for n in 0..N {
                        let own = &numbers[n][place..place + 4];
                        let own = lanes.of([own[0], own[1], own[2], own[3]]);
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
            for j in 0..2 * REACH {
                let (y, slope) = (lanes.splat(self.y[0][j]), lanes.splat(self.y[1][j]));
                value = lanes.mul_add(plain[j], y, value);
                along_y = lanes.mul_add(plain[j], slope, along_y);
                along_z = lanes.mul_add(sloped[j], y, along_z);
            }
            let (x, slope) = (self.x[0][half], self.x[1][half]);
            sums[0] = lanes.mul_add(value, x, sums[0]);
            sums[1] = lanes.mul_add(value, slope, sums[1]);
            sums[2] = lanes.mul_add(along_y, x, sums[2]);
            sums[3] = lanes.mul_add(along_z, x, sums[3]);
        }
        let sums = lanes.sums(sums);
        if N == 1 { lanes.mul(sums, lanes.splat(factors[0])) } else { sums }
    }
}

/// Numbers from the first to the last that a point needs of a channel.
const fn window(reach: usize) -> usize {
    let last = 2 * reach - 1;
    stride(reach) * (last + edge(reach) * last) + 4 * (reach - 1)
}

/// 6 times the B-splines of degree three that do not vanish in a cell, those of the last node first: lane k of entry n is the
/// coefficient of t^n of spline k (de Boor, A Practical Guide to Splines, 1978).
const OF_DEGREE_3: [[f64; 4]; 4] =
    [[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]];

/// 120 times those of degree five: the first four, and the last two with two zeros.
const OF_DEGREE_5: [[[f64; 4]; 6]; 2] = [
    [
        [1.0, 26.0, 66.0, 26.0],
        [-5.0, -50.0, 0.0, 50.0],
        [10.0, 20.0, -60.0, 20.0],
        [-10.0, 20.0, 0.0, -20.0],
        [5.0, -20.0, 30.0, -20.0],
        [-1.0, 5.0, -10.0, 10.0],
    ],
    [
        [1.0, 0.0, 0.0, 0.0],
        [5.0, 0.0, 0.0, 0.0],
        [10.0, 0.0, 0.0, 0.0],
        [10.0, 0.0, 0.0, 0.0],
        [5.0, 0.0, 0.0, 0.0],
        [-5.0, 1.0, 0.0, 0.0],
    ],
];

/// Values and slopes (per cell) of the B-splines that do not vanish at t in [0, 1] of a cell: four of degree three or six of degree
/// five.
#[inline(always)]
fn splines<L: Lanes, const REACH: usize>(lanes: L, t: f64) -> [[L::V; 2]; 2] {
    if REACH == CUBIC {
        let [value, slope] = horner(lanes, t, &OF_DEGREE_3, 1.0 / 6.0);
        let zero = lanes.splat(0.0);
        return [[value, zero], [slope, zero]];
    }
    let first = horner(lanes, t, &OF_DEGREE_5[0], 1.0 / 120.0);
    let last = horner(lanes, t, &OF_DEGREE_5[1], 1.0 / 120.0);
    [[first[0], last[0]], [first[1], last[1]]]
}

#[inline(always)]
fn numbers<L: Lanes>(lanes: L, [a, b]: [L::V; 2]) -> [f64; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (lanes.numbers(a), lanes.numbers(b));
    [a, b, c, d, e, f, g, h]
}

/// Values and slopes of polynomials with a factor.
#[inline(always)]
fn horner<L: Lanes, const N: usize>(lanes: L, t: f64, of: &[[f64; 4]; N], factor: f64) -> [L::V; 2] {
    let t = lanes.splat(t);
    let mut value = lanes.of(of[N - 1]);
    let mut slope = lanes.splat(0.0);
    // Not through iterators: their closures do not know what the machine has.
    for n in (0..N - 1).rev() {
        slope = lanes.mul_add(slope, t, value);
        value = lanes.mul_add(value, t, lanes.of(of[n]));
    }
    let factor = lanes.splat(factor);
    [lanes.mul(value, factor), lanes.mul(slope, factor)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const REACH: usize>() {
        let splines = |t: f64| splines::<Plain, REACH>(Plain, t).map(|[a, b]| [a[0], a[1], a[2], a[3], b[0], b[1]]);
        for t in [0.0, 0.2, 0.71, 1.0] {
            let [value, slope] = splines(t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15 && slope.iter().sum::<f64>().abs() < 1e-15);
            // The nodes' own places: a spline reproduces them.
            let place: f64 = (0..6).map(|k| (k as f64 - (REACH as f64 - 1.0)) * value[k]).sum();
            assert!((place - t).abs() < 2e-15);
            let (lower, upper) = (splines(t - 1e-5)[0], splines(t + 1e-5)[0]);
            for k in 0..6 {
                assert!(((upper[k] - lower[k]) / 2e-5 - slope[k]).abs() < 1e-9);
            }
        }
        // One spline from cell to cell, up to its last continuous derivative, by differences.
        for k in 1..2 * REACH {
            let (before, after) = (splines(1.0), splines(0.0));
            assert!((before[0][k] - after[0][k - 1]).abs() < 1e-15 && (before[1][k] - after[1][k - 1]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_splines_add_up_to_one_and_slopes_are_slopes() {
        check::<CUBIC>();
        check::<QUINTIC>();
    }
}
