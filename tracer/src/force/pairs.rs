//! The sum over all pairs of grains, every pair once.

use std::ops::Range;

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};
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

/// Σ_j Q_j (r_i - r_j) / |r_i - r_j|³ at every grain i of a batch, C/m².
///
/// A pair is computed once and told to both: half of the roots and divisions, which take the time. *Why the bits do not depend on threads
/// or the width of vectors:* which stripe meets which is fixed by the number of grains; in a stripe every sum runs over the sources in
/// a fixed order, in columns that vectors of two, four and eight numbers can all keep, without fused operations; and what
/// stripes did to each other is added up in their order.
///
/// Told grain by grain, in parts that are to be added up; `memory` is scratch. Checked by `the_fast_sum_is_the_slow_sum`,
/// `every_width_of_vector_gives_the_same_bits`.
pub(super) fn field(batch: &Batch, memory: &mut Vec<f64>, mut add: impl FnMut(usize, Vec3)) {
    let arch = Arch::new();
    let grains = Grains::new(batch, memory);
    let stripes = Stripes::new(grains.count);
    let one = |stripe| arch.dispatch(Stripe { grains: &grains, stripes: &stripes, stripe });
    let mut tell = |sums: Sums| {
        let [x, y, z] = sums.parts();
        for i in 0..grains.count {
            add(i, Vec3::new(x[i], y[i], z[i]));
        }
    };
    if grains.count * grains.count < WORTH_SHARING {
        (0..stripes.count).map(one).for_each(tell);
    } else {
        let parts: Vec<Sums> = (0..stripes.count).into_par_iter().map(one).collect();
        parts.into_iter().for_each(&mut tell);
    }
}

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
            memory.resize((k + 1) * padded, f64::MAX.sqrt());
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
        let Self { grains: g, stripes, stripe } = self;
        let mut sums = Sums(vec![0.0; 3 * g.x.len()]);
        let mut reaction: Reaction = [[0.0; TILE * COLUMNS]; 3];
        let own = stripes.tiles_of(stripe);
        for target in own.clone() {
            tile::<S, true>(simd, g, target, target, &mut sums, &mut reaction);
        }
        for source in own.start + 1..own.end {
            reaction = [[0.0; TILE * COLUMNS]; 3];
            for target in own.start..source {
                tile::<S, false>(simd, g, target, source, &mut sums, &mut reaction);
            }
            take(&reaction, source, &mut sums);
        }
        for partner in stripes.partners(stripe) {
            for source in stripes.tiles_of(partner) {
                reaction = [[0.0; TILE * COLUMNS]; 3];
                for target in own.clone() {
                    tile::<S, false>(simd, g, target, source, &mut sums, &mut reaction);
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
                let mut a_weight = inverse_cube(simd, adx, ady, adz);
                let mut b_weight = inverse_cube(simd, bdx, bdy, bdz);
                if SAME {
                    let j = simd.splat_f64s(j as f64);
                    a_weight = simd.select_f64s(simd.equal_f64s(a_number, j), zero, a_weight);
                    b_weight = simd.select_f64s(simd.equal_f64s(b_number, j), zero, b_weight);
                }
                let (a_to, b_to) = (simd.mul_f64s(a_weight, acting), simd.mul_f64s(b_weight, acting));
                a_x = simd.add_f64s(a_x, simd.mul_f64s(adx, a_to));
                a_y = simd.add_f64s(a_y, simd.mul_f64s(ady, a_to));
                a_z = simd.add_f64s(a_z, simd.mul_f64s(adz, a_to));
                b_x = simd.add_f64s(b_x, simd.mul_f64s(bdx, b_to));
                b_y = simd.add_f64s(b_y, simd.mul_f64s(bdy, b_to));
                b_z = simd.add_f64s(b_z, simd.mul_f64s(bdz, b_to));
                if !SAME {
                    let (a_fro, b_fro) = (simd.mul_f64s(a_weight, a_charge), simd.mul_f64s(b_weight, b_charge));
                    let k = (j - sources.start) * row + v - first;
                    let own = simd.add_f64s(simd.mul_f64s(adx, a_fro), simd.mul_f64s(bdx, b_fro));
                    back_x[k] = simd.add_f64s(back_x[k], own);
                    let own = simd.add_f64s(simd.mul_f64s(ady, a_fro), simd.mul_f64s(bdy, b_fro));
                    back_y[k] = simd.add_f64s(back_y[k], own);
                    let own = simd.add_f64s(simd.mul_f64s(adz, a_fro), simd.mul_f64s(bdz, b_fro));
                    back_z[k] = simd.add_f64s(back_z[k], own);
                }
            }
            (sum_x[v], sum_y[v], sum_z[v]) = (a_x, a_y, a_z);
            (sum_x[w], sum_y[w], sum_z[w]) = (b_x, b_y, b_z);
        }
    }
}

/// 1 / d³.
#[inline(always)]
fn inverse_cube<S: Simd>(simd: S, dx: S::f64s, dy: S::f64s, dz: S::f64s) -> S::f64s {
    let squares = simd.add_f64s(simd.mul_f64s(dx, dx), simd.mul_f64s(dy, dy));
    let r2 = simd.add_f64s(squares, simd.mul_f64s(dz, dz));
    simd.div_f64s(simd.splat_f64s(1.0), simd.mul_f64s(r2, simd.sqrt_f64s(r2)))
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

    #[test]
    fn every_width_of_vector_gives_the_same_bits() {
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
            let mut others = vec![Arch::new().dispatch(task())];
            #[cfg(target_arch = "x86_64")]
            {
                others.extend(pulp::x86::V3::try_new().map(|simd| Simd::vectorize(simd, task())));
                others.extend(pulp::x86::V4::try_new().map(|simd| Simd::vectorize(simd, task())));
            }
            for other in others {
                for (a, b) in one.parts().into_iter().zip(other.parts()) {
                    assert_eq!(a[..333], b[..333]);
                }
            }
        }
    }
}
