//! The sum over all pairs of grains, every pair once.

use std::ops::Range;

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, x86::V4};
use rayon::prelude::*;

use super::Batch;

/// Grains of a tile.
const TILE: usize = 32;

/// Sums of what targets do to a source run in so many columns, target `i` in column `i % COLUMNS`: those of a vector of any width.
const COLUMNS: usize = 8;

/// Tiles are put together to stripes, at most so many and about twice the root of the number of tiles: parts enough for threads,
/// few enough that adding up what they did to each other does not show.
const MOST_STRIPES: usize = 48;

/// Pairs from which on threads share the stripes: ten microseconds of work.
const WORTH_SHARING: usize = 20_000;

/// Q_i Σ_j Q_j (r_i - r_j) / |r_i - r_j|³ for every grain i of a batch, C²/m².
///
/// A pair is computed once and told to both: half of the roots and divisions, which take the time. *Why the bits do not depend on
/// threads:* which stripe meets which is fixed by the number of grains; in a stripe every sum runs over the sources in a fixed
/// order; and what stripes did to each other is added up in their order. Machines with other vectors round otherwise.
///
/// Told grain by grain; `memory` is scratch. Checked by `the_fast_sum_is_the_slow_sum`,
/// `every_machine_gives_the_same_sums`.
pub(super) fn forces(batch: &Batch, memory: &mut Vec<f64>, mut add: impl FnMut(usize, Vec3)) {
    let machine = Machine::new();
    let grains = Grains::new(batch, memory);
    let stripes = Stripes::new(grains.count);
    let one = |stripe| machine.sums(Stripe { grains: &grains, stripes: &stripes, stripe });
    let mut parts: Vec<Sums> = if grains.count * grains.count < WORTH_SHARING {
        (0..stripes.count).map(one).collect()
    } else {
        (0..stripes.count).into_par_iter().with_max_len(1).map(one).collect()
    };
    let Some((all, others)) = parts.split_first_mut() else { return };
    for other in others {
        all.0.iter_mut().zip(&other.0).for_each(|(all, other)| *all += other);
    }
    let [x, y, z] = all.parts();
    for i in 0..grains.count {
        add(i, Vec3::new(x[i], y[i], z[i]));
    }
}

/// Σ_j Q_j / |r_i - r_j| at every grain i of a batch, C/m; `memory` is scratch.
///
/// Every pair twice, as energies are asked for at samples only. Checked by
/// `forces_of_a_cloud_add_up_to_nothing_and_follow_the_energy`.
pub(super) fn potentials(batch: &Batch, memory: &mut Vec<f64>) -> Vec<f64> {
    let (arch, grains) = (Arch::new(), Grains::new(batch, memory));
    let one = |target| arch.dispatch(Potential { grains: &grains, target });
    (0..grains.count).into_par_iter().with_min_len(TILE).map(one).collect()
}

/// The potential at a grain by all others.
struct Potential<'a> {
    grains: &'a Grains<'a>,
    target: usize,
}

impl WithSimd for Potential<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { grains: g, target } = self;
        let (x, _) = S::as_simd_f64s(g.x);
        let (y, _) = S::as_simd_f64s(g.y);
        let (z, _) = S::as_simd_f64s(g.z);
        let (charge, _) = S::as_simd_f64s(g.charge);
        let (number, _) = S::as_simd_f64s(g.number);
        let (tx, ty, tz) = (simd.splat_f64s(g.x[target]), simd.splat_f64s(g.y[target]), simd.splat_f64s(g.z[target]));
        let (zero, own) = (simd.splat_f64s(0.0), simd.splat_f64s(target as f64));
        let mut sum = zero;
        for v in 0..x.len() {
            let (dx, dy, dz) = (simd.sub_f64s(x[v], tx), simd.sub_f64s(y[v], ty), simd.sub_f64s(z[v], tz));
            let part = simd.div_f64s(charge[v], simd.sqrt_f64s(square(simd, dx, dy, dz)));
            sum = simd.add_f64s(sum, simd.select_f64s(simd.equal_f64s(number[v], own), zero, part));
        }
        simd.reduce_sum_f64s(sum)
    }
}

/// What the sum runs on.
#[derive(Clone, Copy)]
enum Machine {
    /// Vectors of eight, with a table of inverse roots.
    #[cfg(target_arch = "x86_64")]
    Wide(V4),
    Any(Arch),
}

impl Machine {
    fn new() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(wide) = V4::try_new() {
            return Self::Wide(wide);
        }
        Self::Any(Arch::new())
    }

    fn sums(self, stripe: Stripe) -> Sums {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Wide(wide) => wide.vectorize(Wide { wide, stripe }),
            Self::Any(arch) => arch.dispatch(stripe),
        }
    }
}

/// Where the places that fill up the last tile are, m: so far that they do nothing, so near that the cube of it is a number.
const FAR: f64 = 1e90;

/// Positions and charges in arrays of their own, filled up to whole tiles with uncharged grains far away.
struct Grains<'a> {
    count: usize,
    x: &'a [f64],
    y: &'a [f64],
    z: &'a [f64],
    charge: &'a [f64],
    /// 0, 1, 2, ...: tells a target from itself.
    number: &'a [f64],
}

impl<'a> Grains<'a> {
    /// The arrays lie in `memory`, one after the other.
    fn new(batch: &Batch, memory: &'a mut Vec<f64>) -> Self {
        let count = batch.len();
        let padded = count.div_ceil(TILE) * TILE;
        memory.clear();
        for k in 0..3 {
            memory.extend(batch.position.iter().map(|r| r[k]));
            memory.resize((k + 1) * padded, FAR);
        }
        memory.extend_from_slice(batch.charge);
        memory.resize(4 * padded, 0.0);
        memory.extend((0..padded).map(|i| i as f64));
        let part = |k: usize| &memory[k * padded..(k + 1) * padded];
        Self { count, x: part(0), y: part(1), z: part(2), charge: part(3), number: part(4) }
    }
}

/// Which tiles go together.
struct Stripes {
    count: usize,
    tiles: usize,
    /// Tiles of a stripe; the last may have fewer.
    each: usize,
}

impl Stripes {
    fn new(grains: usize) -> Self {
        let tiles = grains.div_ceil(TILE);
        let wanted = ((2.0 * (tiles as f64).sqrt()) as usize).clamp(1, MOST_STRIPES);
        let each = tiles.div_ceil(wanted).max(1);
        Self { count: tiles.div_ceil(each), tiles, each }
    }

    fn tiles_of(&self, stripe: usize) -> Range<usize> {
        stripe * self.each..((stripe + 1) * self.each).min(self.tiles)
    }

    /// The stripes that one meets: the half of the others that comes after it, all in a circle. Of an even number, the one across
    /// is met by the first of the two.
    fn partners(&self, stripe: usize) -> impl Iterator<Item = usize> {
        let n = self.count;
        let across = n.is_multiple_of(2) && stripe >= n / 2;
        let half = n / 2 - usize::from(across);
        (1..=half).map(move |k| (stripe + k) % n)
    }
}

/// x, y and z of a sum at every grain, padded as they are, one after the other.
struct Sums(Vec<f64>);

impl Sums {
    fn parts(&self) -> [&[f64]; 3] {
        let (x, rest) = self.0.split_at(self.0.len() / 3);
        let (y, z) = rest.split_at(x.len());
        [x, y, z]
    }

    #[inline(always)]
    fn parts_mut(&mut self) -> [&mut [f64]; 3] {
        let third = self.0.len() / 3;
        let (x, rest) = self.0.split_at_mut(third);
        let (y, z) = rest.split_at_mut(third);
        [x, y, z]
    }
}

/// All that the grains of a stripe and those they meet do to each other.
struct Stripe<'a> {
    grains: &'a Grains<'a>,
    stripes: &'a Stripes,
    stripe: usize,
}

/// What targets do to the sources of a tile, by source and column.
type Reaction = [[f64; TILE * COLUMNS]; 3];

impl WithSimd for Stripe<'_> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Sums {
        self.sums(simd, Divided)
    }
}

#[cfg(target_arch = "x86_64")]
struct Wide<'a> {
    wide: V4,
    stripe: Stripe<'a>,
}

#[cfg(target_arch = "x86_64")]
impl NullaryFnOnce for Wide<'_> {
    type Output = Sums;

    #[inline(always)]
    fn call(self) -> Sums {
        self.stripe.sums(self.wide, Refined)
    }
}

impl Stripe<'_> {
    #[inline(always)]
    fn sums<S: Simd>(self, simd: S, inverse: impl InverseCube<S>) -> Sums {
        let Self { grains: g, stripes, stripe } = self;
        let mut sums = Sums(vec![0.0; 3 * g.x.len()]);
        let mut reaction: Reaction = [[0.0; TILE * COLUMNS]; 3];
        let own = stripes.tiles_of(stripe);
        for target in own.clone() {
            tile::<S, true>(simd, inverse, g, target, target, &mut sums, &mut reaction);
        }
        for source in own.start + 1..own.end {
            reaction = [[0.0; TILE * COLUMNS]; 3];
            for target in own.start..source {
                tile::<S, false>(simd, inverse, g, target, source, &mut sums, &mut reaction);
            }
            take(&reaction, source, &mut sums);
        }
        for partner in stripes.partners(stripe) {
            for source in stripes.tiles_of(partner) {
                reaction = [[0.0; TILE * COLUMNS]; 3];
                for target in own.clone() {
                    tile::<S, false>(simd, inverse, g, target, source, &mut sums, &mut reaction);
                }
                take(&reaction, source, &mut sums);
            }
        }
        sums
    }
}

/// Adds up the columns and what they hold to the sources' sums.
#[inline(always)]
fn take(reaction: &Reaction, source: usize, sums: &mut Sums) {
    for (sum, reaction) in sums.parts_mut().into_iter().zip(reaction) {
        for (sum, r) in sum[source * TILE..].iter_mut().zip(reaction.chunks_exact(COLUMNS)) {
            *sum -= ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
        }
    }
}

/// Adds what the sources of a tile do to the targets of a tile, and the other way round; of a tile with itself (`SAME`) each pair is
/// seen from both sides, and there is no other way round.
#[inline(always)]
fn tile<S: Simd, const SAME: bool>(
    simd: S,
    inverse: impl InverseCube<S>,
    g: &Grains,
    target: usize,
    source: usize,
    sums: &mut Sums,
    reaction: &mut Reaction,
) {
    let targets = target * TILE..(target + 1) * TILE;
    let sources = source * TILE..((source + 1) * TILE).min(g.count);
    let (x, _) = S::as_simd_f64s(&g.x[targets.clone()]);
    let (y, _) = S::as_simd_f64s(&g.y[targets.clone()]);
    let (z, _) = S::as_simd_f64s(&g.z[targets.clone()]);
    let (charge, _) = S::as_simd_f64s(&g.charge[targets.clone()]);
    let (number, _) = S::as_simd_f64s(&g.number[targets.clone()]);
    let [sum_x, sum_y, sum_z] = sums.parts_mut();
    let (sum_x, _) = S::as_mut_simd_f64s(&mut sum_x[targets.clone()]);
    let (sum_y, _) = S::as_mut_simd_f64s(&mut sum_y[targets.clone()]);
    let (sum_z, _) = S::as_mut_simd_f64s(&mut sum_z[targets]);
    let [back_x, back_y, back_z] = reaction;
    let (back_x, _) = S::as_mut_simd_f64s(back_x);
    let (back_y, _) = S::as_mut_simd_f64s(back_y);
    let (back_z, _) = S::as_mut_simd_f64s(back_z);
    let zero = simd.splat_f64s(0.0);
    // Vectors of a row of columns. Two rows at a time: their chains of root and division overlap, and all sums stay in registers.
    // (No closures here: what they hold would not be compiled for wide vectors.)
    let row = COLUMNS / S::F64_LANES;
    // Nothing is summed for the places that fill up the last tile, but for those in its last rows.
    let filled = (g.count - target * TILE).min(TILE).div_ceil(S::F64_LANES);
    for first in (0..filled).step_by(2 * row) {
        for v in first..first + row {
            let w = v + row;
            let (ax, ay, az, a_charge, a_number) = (x[v], y[v], z[v], charge[v], number[v]);
            let (bx, by, bz, b_charge, b_number) = (x[w], y[w], z[w], charge[w], number[w]);
            let (mut a_x, mut a_y, mut a_z) = (sum_x[v], sum_y[v], sum_z[v]);
            let (mut b_x, mut b_y, mut b_z) = (sum_x[w], sum_y[w], sum_z[w]);
            for j in sources.clone() {
                let (jx, jy, jz) = (simd.splat_f64s(g.x[j]), simd.splat_f64s(g.y[j]), simd.splat_f64s(g.z[j]));
                let acting = simd.splat_f64s(g.charge[j]);
                let (adx, ady, adz) = (simd.sub_f64s(ax, jx), simd.sub_f64s(ay, jy), simd.sub_f64s(az, jz));
                let (bdx, bdy, bdz) = (simd.sub_f64s(bx, jx), simd.sub_f64s(by, jy), simd.sub_f64s(bz, jz));
                let mut a_weight = inverse.of(simd, square(simd, adx, ady, adz));
                let mut b_weight = inverse.of(simd, square(simd, bdx, bdy, bdz));
                if SAME {
                    let j = simd.splat_f64s(j as f64);
                    a_weight = simd.select_f64s(simd.equal_f64s(a_number, j), zero, a_weight);
                    b_weight = simd.select_f64s(simd.equal_f64s(b_number, j), zero, b_weight);
                }
                a_weight = simd.mul_f64s(a_weight, simd.mul_f64s(a_charge, acting));
                b_weight = simd.mul_f64s(b_weight, simd.mul_f64s(b_charge, acting));
                let (fx, gx) = (simd.mul_f64s(adx, a_weight), simd.mul_f64s(bdx, b_weight));
                let (fy, gy) = (simd.mul_f64s(ady, a_weight), simd.mul_f64s(bdy, b_weight));
                let (fz, gz) = (simd.mul_f64s(adz, a_weight), simd.mul_f64s(bdz, b_weight));
                (a_x, a_y, a_z) = (simd.add_f64s(a_x, fx), simd.add_f64s(a_y, fy), simd.add_f64s(a_z, fz));
                (b_x, b_y, b_z) = (simd.add_f64s(b_x, gx), simd.add_f64s(b_y, gy), simd.add_f64s(b_z, gz));
                if !SAME {
                    let k = (j - sources.start) * row + v - first;
                    back_x[k] = simd.add_f64s(back_x[k], simd.add_f64s(fx, gx));
                    back_y[k] = simd.add_f64s(back_y[k], simd.add_f64s(fy, gy));
                    back_z[k] = simd.add_f64s(back_z[k], simd.add_f64s(fz, gz));
                }
            }
            (sum_x[v], sum_y[v], sum_z[v]) = (a_x, a_y, a_z);
            (sum_x[w], sum_y[w], sum_z[w]) = (b_x, b_y, b_z);
        }
    }
}

/// d².
#[inline(always)]
fn square<S: Simd>(simd: S, dx: S::f64s, dy: S::f64s, dz: S::f64s) -> S::f64s {
    simd.mul_add_e_f64s(dz, dz, simd.mul_add_e_f64s(dy, dy, simd.mul_f64s(dx, dx)))
}

/// A way to 1 / d³.
trait InverseCube<S: Simd>: Copy {
    /// 1 / d³ from d².
    fn of(self, simd: S, square: S::f64s) -> S::f64s;
}

/// By a root and a division.
#[derive(Clone, Copy)]
struct Divided;

impl<S: Simd> InverseCube<S> for Divided {
    #[inline(always)]
    fn of(self, simd: S, square: S::f64s) -> S::f64s {
        simd.div_f64s(simd.splat_f64s(1.0), simd.mul_f64s(square, simd.sqrt_f64s(square)))
    }
}

/// From the inverse root that the machine knows to 2⁻¹⁴: with 1 - d² y² = h, |h| < 1.3e-4, the rest is the binomial series
/// d⁻³ = y³ (1 - h)^(-3/2) = y³ (1 + 3/2 h + 15/8 h² + 35/16 h³ + 315/128 h⁴ + ...), where the next term is below 1e-19.
/// The whole sum takes a fifth less than with a root and a division.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
struct Refined;

#[cfg(target_arch = "x86_64")]
impl InverseCube<V4> for Refined {
    #[inline(always)]
    fn of(self, simd: V4, square: <V4 as Simd>::f64s) -> <V4 as Simd>::f64s {
        let y: <V4 as Simd>::f64s = pulp::cast(simd.avx512f._mm512_rsqrt14_pd(pulp::cast(square)));
        let y2 = simd.mul_f64s(y, y);
        let h = simd.mul_add_f64s(simd.neg_f64s(square), y2, simd.splat_f64s(1.0));
        let mut series = simd.splat_f64s(315.0 / 128.0);
        for factor in [35.0 / 16.0, 15.0 / 8.0, 3.0 / 2.0, 1.0] {
            series = simd.mul_add_f64s(series, h, simd.splat_f64s(factor));
        }
        simd.mul_f64s(simd.mul_f64s(y2, y), series)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, Stream};

    #[test]
    fn every_two_stripes_meet_once() {
        for grains in [1, 32, 33, 100, 257, 1000, 4000, 100_000] {
            let stripes = Stripes::new(grains);
            assert!(stripes.count <= MOST_STRIPES + 1 && stripes.count * stripes.each * TILE >= grains);
            let mut met = vec![0; stripes.count * stripes.count];
            for stripe in 0..stripes.count {
                assert!(!stripes.tiles_of(stripe).is_empty());
                for partner in stripes.partners(stripe) {
                    met[stripe * stripes.count + partner] += 1;
                    met[partner * stripes.count + stripe] += 1;
                }
            }
            let once = |k: usize| usize::from(k / stripes.count != k % stripes.count);
            assert!(met.iter().enumerate().all(|(k, met)| *met == once(k)), "{grains} grains");
        }
    }

    /// Sums of one machine over those of one number at a time, for 333 grains: the largest difference over the largest sum.
    #[test]
    fn every_machine_gives_the_same_sums() {
        let mut stream = Stream::new(9, Purpose::Start, 0, 0);
        let mut next = || stream.unit() - 0.5;
        let position: Vec<Vec3> = (0..333).map(|_| Vec3::new(next(), next(), next())).collect();
        let charge: Vec<f64> = (0..333).map(|_| next()).collect();
        let (zero, id) = (vec![0.0; 333], vec![0; 333]);
        let (velocity, time, mass, radius) = (&position[..], &zero[..], &zero[..], &zero[..]);
        let batch = Batch { position: &position, velocity, time, charge: &charge, mass, radius, id: &id };
        let mut memory = Vec::new();
        let grains = Grains::new(&batch, &mut memory);
        let stripes = Stripes::new(333);
        for stripe in 0..stripes.count {
            let task = || Stripe { grains: &grains, stripes: &stripes, stripe };
            let one = Simd::vectorize(pulp::Scalar::new(), task());
            let mut others = vec![Machine::new().sums(task()), Arch::new().dispatch(task())];
            #[cfg(target_arch = "x86_64")]
            others.extend(pulp::x86::V3::try_new().map(|simd| Simd::vectorize(simd, task())));
            for other in others {
                for (a, b) in one.parts().into_iter().zip(other.parts()) {
                    let largest = a[..333].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                    // Of 333 terms each is off by a few roundings.
                    let off = a[..333].iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off < 20.0 * f64::EPSILON * largest, "{off:e} of {largest:e}");
                }
            }
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn refined_cubes_are_divided_ones() {
        struct Both(V4);
        impl NullaryFnOnce for Both {
            type Output = f64;
            #[inline(always)]
            fn call(self) -> f64 {
                let mut worst = 0.0_f64;
                for k in 0..4000 {
                    // Over twelve decades, and over all parts of an octave.
                    let square = self.0.splat_f64s(1e-12 * 1.007_f64.powi(k));
                    let (refined, divided) = (Refined.of(self.0, square), Divided.of(self.0, square));
                    let ratio: [f64; 8] = pulp::cast(self.0.div_f64s(refined, divided));
                    worst = ratio.iter().fold(worst, |worst, r| worst.max((r - 1.0).abs()));
                }
                worst
            }
        }
        if let Some(wide) = V4::try_new() {
            let worst = wide.vectorize(Both(wide));
            assert!(worst < 6.0 * f64::EPSILON, "{worst:e}");
        }
    }
}
