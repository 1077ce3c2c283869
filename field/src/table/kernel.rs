//! Evaluating splines at points, fast: points are found and their splines weighed four at a time, in the lanes of vectors; what
//! they need of a brick is then added up for each, row by row.

use meshes::Vec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, x86::V3};

use super::PotentialTable;
use super::finder::{Finder, Found, Places, TOGETHER};
use super::lanes::{Lanes, Plain};
use super::octree::NONE;
use super::rows::{Number, Rows};
use super::spline::{CUBIC, QUINTIC, Splines, edge, slots, stride};

/// Accuracies of the field down to which coefficients may be kept in single precision: what is rounded off is a thousandth of it.
pub(super) const SINGLE: f64 = 1e-4;

/// Tables with more bytes than this do not stay in the caches: memory is asked for before it is used.
const NEAR: u64 = 16 << 20;

/// Fours whose memory is asked for side by side.
const AHEAD: usize = 4;

/// Coefficients of some degree and precision.
enum Coefficients {
    Single(Rows<f32>),
    Cubic(Rows<f64>),
    Quintic(Rows<f64>),
}

/// Splines with what finds a point in them.
pub(super) struct Kernel {
    places: Places,
    channels: usize,
    coefficients: Coefficients,
    /// Memory is far away.
    is_far: bool,
    /// What the machine has.
    #[cfg(target_arch = "x86_64")]
    v3: Option<V3>,
}

/// What is wanted of each point.
enum Wanted<'a> {
    /// Potential and gradient of each channel.
    Channels { potential: &'a mut [f64], gradient: &'a mut [Vec3] },
    /// Potential and gradient of a sum of channels with factors for each point.
    Sum { factors: &'a [f64], potential: &'a mut [f64], gradient: &'a mut [Vec3] },
}

impl Kernel {
    /// Channel c is Σ_k `weights[c][k]` times function k of the table.
    pub fn new(table: &PotentialTable, weights: &[Vec<f64>]) -> Self {
        let slots = slots(&table.octree);
        let bricks = slots.iter().filter(|slot| **slot != NONE).count();
        let channels = weights.len();
        let coefficients = match (table.smooth, table.accuracy >= SINGLE) {
            (true, _) => Coefficients::Quintic(rows(table, QUINTIC, &slots, bricks, weights)),
            (false, true) => Coefficients::Single(rows(table, CUBIC, &slots, bricks, weights)),
            (false, false) => Coefficients::Cubic(rows(table, CUBIC, &slots, bricks, weights)),
        };
        let bytes = coefficients.bytes();
        Self {
            places: Places::new(&table.octree, &slots),
            channels,
            coefficients,
            is_far: bytes > NEAR,
            #[cfg(target_arch = "x86_64")]
            v3: V3::try_new(),
        }
    }

    pub fn channels(&self) -> usize {
        self.channels
    }

    pub fn bytes(&self) -> u64 {
        self.coefficients.bytes()
    }

    /// Bytes of so many bricks and channels at the peak, when the last channel is added.
    pub fn bytes_for(accuracy: f64, smooth: bool, bricks: usize, channels: usize) -> u64 {
        let (rows, splines) = if smooth {
            (Rows::<f64>::bytes_for(QUINTIC, bricks, channels), Splines::bytes_for(QUINTIC, bricks))
        } else if accuracy >= SINGLE {
            (Rows::<f32>::bytes_for(CUBIC, bricks, channels), Splines::bytes_for(CUBIC, bricks))
        } else {
            (Rows::<f64>::bytes_for(CUBIC, bricks, channels), Splines::bytes_for(CUBIC, bricks))
        };
        rows.saturating_add(splines)
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
        match &self.coefficients {
            Coefficients::Single(rows) => self.dispatch_to::<_, CUBIC>(rows, points, wanted, left),
            Coefficients::Cubic(rows) => self.dispatch_to::<_, CUBIC>(rows, points, wanted, left),
            Coefficients::Quintic(rows) => self.dispatch_to::<_, QUINTIC>(rows, points, wanted, left),
        }
    }

    fn dispatch_to<N: Number, const REACH: usize>(
        &self,
        rows: &Rows<N>,
        points: &[Vec3],
        wanted: Wanted,
        left: &mut Vec<usize>,
    ) {
        let (numbers, planes, channels, is_far) = (rows.numbers(), &rows.planes[..], self.channels, self.is_far);
        let layers = 2 * rows.reach;
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = self.v3 {
            let finder = Finder::new(lanes, &self.places);
            let run =
                Run::<V3, N, REACH> { lanes, finder, numbers, planes, channels, is_far, layers, points, wanted, left };
            return lanes.vectorize(run);
        }
        let (lanes, finder) = (Plain, Finder::new(Plain, &self.places));
        Run::<Plain, N, REACH> { lanes, finder, numbers, planes, channels, is_far, layers, points, wanted, left }.run();
    }
}

impl Coefficients {
    fn bytes(&self) -> u64 {
        match self {
            Self::Single(rows) => rows.bytes(),
            Self::Cubic(rows) | Self::Quintic(rows) => rows.bytes(),
        }
    }
}

/// All channels, one after the other: splines take more memory while they are made.
fn rows<N: Number>(
    table: &PotentialTable,
    reach: usize,
    slots: &[u32],
    bricks: usize,
    weights: &[Vec<f64>],
) -> Rows<N> {
    let mut rows = Rows::new(reach, bricks, weights.len());
    for (channel, weights) in weights.iter().enumerate() {
        rows.fill(channel, &Splines::new(table, reach, slots, weights));
    }
    rows
}

/// A call for some points.
struct Run<'a, L: Lanes, N, const REACH: usize> {
    lanes: L,
    finder: Finder<'a, L, REACH>,
    numbers: &'a [N],
    planes: &'a [[f64; 4]],
    channels: usize,
    is_far: bool,
    layers: usize,
    points: &'a [Vec3],
    wanted: Wanted<'a>,
    left: &'a mut Vec<usize>,
}

#[cfg(target_arch = "x86_64")]
impl<N: Number, const REACH: usize> NullaryFnOnce for Run<'_, V3, N, REACH> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.run();
    }
}

impl<L: Lanes, N: Number, const REACH: usize> Run<'_, L, N, REACH> {
    /// Splines along each axis that do not vanish at a point.
    const WINDOW: usize = 2 * REACH;

    #[inline(always)]
    fn run(mut self) {
        let (fours, rest) = self.points.as_chunks::<TOGETHER>();
        let mut done = 0;
        if self.is_far {
            let mut found = [Found::NOTHING; AHEAD];
            for fours in fours.as_chunks::<AHEAD>().0 {
                for k in 0..AHEAD {
                    self.finder.find(&fours[k], TOGETHER, &mut found[k]);
                    self.fetch(&found[k]);
                }
                for found in &found {
                    self.evaluate_all(done, TOGETHER, found);
                    done += TOGETHER;
                }
            }
        }
        let mut found = Found::NOTHING;
        for four in &fours[done / TOGETHER..] {
            self.finder.find(four, TOGETHER, &mut found);
            self.evaluate_all(done, TOGETHER, &found);
            done += TOGETHER;
        }
        if !rest.is_empty() {
            let mut four = [Vec3::zeros(); TOGETHER];
            four[..rest.len()].copy_from_slice(rest);
            self.finder.find(&four, rest.len(), &mut found);
            self.evaluate_all(done, rest.len(), &found);
        }
    }

    /// Asks for the lines of memory that points will need.
    #[inline(always)]
    fn fetch(&self, found: &Found<REACH>) {
        #[cfg(target_arch = "x86_64")]
        for l in 0..TOGETHER {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let first = found.slot[l] as usize * self.channels * Rows::<N>::per_brick(REACH) + found.first[l] as usize;
            let first: *const N = self.numbers.as_ptr().wrapping_add(first);
            for z in 0..Self::WINDOW {
                for y in 0..Self::WINDOW {
                    // Two rows of the short ones share a line.
                    if y % 2 == 1 && y + 1 < Self::WINDOW && size_of::<N>() * stride(REACH) <= 32 {
                        continue;
                    }
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
    fn evaluate_all(&mut self, first: usize, count: usize, found: &Found<REACH>) {
        for lane in 0..count {
            if found.slot[lane] == NONE {
                self.left.push(first + lane);
            } else {
                self.evaluate(first + lane, lane, found);
            }
        }
    }

    #[inline(always)]
    fn evaluate(&mut self, p: usize, lane: usize, found: &Found<REACH>) {
        let (lanes, channels, brick) = (self.lanes, self.channels, Rows::<N>::per_brick(REACH));
        let first = found.slot[lane] as usize * channels;
        let numbers = &self.numbers[first * brick..(first + channels) * brick];
        let planes = &self.planes[first..first + channels];
        let point = Point { lane, found, numbers, planes, layers: self.layers };
        match &mut self.wanted {
            Wanted::Channels { potential, gradient } => {
                for c in 0..channels {
                    let [value, x, y, z] = lanes.numbers(point.contract::<L, 1>(lanes, [c], [1.0]));
                    (potential[p * channels + c], gradient[p * channels + c]) = (value, Vec3::new(x, y, z));
                }
            }
            Wanted::Sum { factors, potential, gradient } => {
                let factors = &factors[p * channels..(p + 1) * channels];
                let sums = match *factors {
                    [one] => point.contract(lanes, [0], [one]),
                    [a, b] => point.contract(lanes, [0, 1], [a, b]),
                    _ => {
                        let mut sums = lanes.splat(0.0);
                        for (c, factor) in factors.iter().enumerate() {
                            sums = lanes.add(sums, point.contract(lanes, [c], [*factor]));
                        }
                        sums
                    }
                };
                let [value, x, y, z] = lanes.numbers(sums);
                (potential[p], gradient[p]) = (value, Vec3::new(x, y, z));
            }
        }
    }
}

/// A point and its brick.
struct Point<'a, N, const REACH: usize> {
    lane: usize,
    found: &'a Found<REACH>,
    /// Of all channels of the brick.
    numbers: &'a [N],
    planes: &'a [[f64; 4]],
    layers: usize,
}

impl<N: Number, const REACH: usize> Point<'_, N, REACH> {
    /// Potential and gradient of a sum of channels with factors.
    #[inline(always)]
    fn contract<L: Lanes, const C: usize>(&self, lanes: L, channels: [usize; C], factors: [f64; C]) -> L::V {
        let (found, lane, zero) = (self.found, self.lane, lanes.splat(0.0));
        let mut rows = [&self.numbers[..0]; C];
        let mut plane = zero;
        for n in 0..C {
            let first = channels[n] * Rows::<N>::per_brick(REACH) + found.first[lane] as usize;
            rows[n] = &self.numbers[first..first + window(REACH)];
            let own = lanes.of(self.planes[channels[n]]);
            // A factor of one channel is left for the end.
            plane = if C == 1 { own } else { lanes.mul_add(own, lanes.splat(factors[n]), plane) };
        }
        let mut sums = [lanes.mul(plane, lanes.of(found.from_middle[lane])), zero, zero, zero];
        for half in 0..REACH - 1 {
            // Along z, then y, then x.
            let mut plain = [zero; 6];
            let mut sloped = [zero; 6];
            // Where rows are many the loop must stay one: all of them at a time do not fit in registers.
            for k in 0..if REACH == CUBIC { 2 * REACH } else { self.layers.min(2 * REACH) } {
                let (value, slope) =
                    (lanes.splat(found.z[0][k / 2][k % 2][lane]), lanes.splat(found.z[1][k / 2][k % 2][lane]));
                for j in 0..2 * REACH {
                    let place = stride(REACH) * (j + edge(REACH) * k) + 4 * half;
                    let mut row = zero;
                    for n in 0..C {
                        let own = &rows[n][place..place + 4];
                        let own = N::four(lanes, [own[0], own[1], own[2], own[3]]);
                        row = match n {
                            0 if C == 1 => own,
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
                let (y, slope) =
                    (lanes.splat(found.y[0][j / 2][j % 2][lane]), lanes.splat(found.y[1][j / 2][j % 2][lane]));
                value = lanes.mul_add(plain[j], y, value);
                along_y = lanes.mul_add(plain[j], slope, along_y);
                along_z = lanes.mul_add(sloped[j], y, along_z);
            }
            let (x, slope) = (lanes.of(found.x[lane][0][half]), lanes.of(found.x[lane][1][half]));
            sums[0] = lanes.mul_add(value, x, sums[0]);
            sums[1] = lanes.mul_add(value, slope, sums[1]);
            sums[2] = lanes.mul_add(along_y, x, sums[2]);
            sums[3] = lanes.mul_add(along_z, x, sums[3]);
        }
        // The plane has its value already, and its slopes not yet.
        let sums = lanes.mul_add(plane, lanes.of([0.0, 1.0, 1.0, 1.0]), lanes.sums(sums));
        let sums = if C == 1 { lanes.mul(sums, lanes.splat(factors[0])) } else { sums };
        lanes.mul(sums, lanes.of(found.scale[lane]))
    }
}

/// Numbers from the first to the last that a point needs of a channel.
const fn window(reach: usize) -> usize {
    let last = 2 * reach - 1;
    stride(reach) * (last + edge(reach) * last) + 4 * (reach - 1)
}
