//! Mutual repulsion and attraction of the grains.

use faer::Mat;
use field::constants::COULOMB;
use field::multipole::Points;
use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::{Batch, Force, Nature, Scratch};

/// Targets of one task. Enough registers' worth to hide the latency of roots and divisions, and small enough to share
/// a hundred grains between threads.
const TILE: usize = 32;

/// Every grain on every other:
///
///   F_i = k Q_i Σ_j Q_j (r_i - r_j) / |r_i - r_j|³,  energy of a pair k Q_i Q_j / |r_i - r_j|
///
/// k Coulomb's constant 1 / (4 π ε0), Q charge in C, r position in m. Point charges; the field of one grain's charge by
/// way of the electrodes (images, screening) is not in it. Two grains at one point give an answer that is not finite.
///
/// Source: Coulomb's law. Checked by `the_fast_sum_is_the_slow_sum` and `exact_two_grains_collide_as_kepler_says`.
///
/// *Why direct:* exact, and 1e9 pairs a second and core carry some thousand grains. *Why a vector across targets:* each
/// target's sum then runs over the sources in their order, one after the other, without fused operations: the same
/// bits for any number of threads, any width of vector and any neighbours. A vector across sources would need no
/// broadcast, but would end in a sum whose order depends on the machine.
///
/// With an `accuracy`, more grains than [`MANY`] are summed by the fast multipole method ([`field::multipole::Points`]),
/// whose work grows as their number. Checked by `the_multipole_sum_errs_by_less_than_asked`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coulomb {
    /// Relative error that the forces on many grains may have, root mean square of the errors over that of the forces, from
    /// 1e-11 to 1; where near grains of both signs cancel, relative to what they would give without. Momentum is then kept as
    /// well as that, and grains at one point do not feel each other. Default: none; every pair is summed.
    ///
    /// Such forces jump by as much when grains cross from cell to cell: adaptive steps of a finer tolerance become short.
    pub accuracy: Option<f64>,
}

/// Grains above which the multipole method takes less time than all pairs: on one core 1.5 µs a grain at 1e-4 and 3.3 at 1e-6,
/// against 0.85 ns a pair.
pub const MANY: usize = 4000;

/// The multipole method is asked for so much of the accuracy: its errors are estimates for even clouds, and reach 1.1 of what is
/// asked in lumpy ones.
const SHARE: f64 = 0.5;

/// Pairs from which on threads share the targets: ten microseconds of work.
const WORTH_SHARING: usize = 10_000;

impl Coulomb {
    /// Potentials (V) and gradients (V/m) at all grains by the multipole method, row by row; `None` where all pairs are to be
    /// summed.
    fn far(&self, batch: &Batch, gradients: bool) -> Option<Mat<f64>> {
        let accuracy = self.accuracy.filter(|_| batch.len() > MANY)?;
        // Positions that are not finite are refused; all pairs then tell whose they are.
        let points = Points::new(batch.position, batch.position, (SHARE * accuracy).clamp(1e-11, 1.0)).ok()?;
        let charges = Mat::from_fn(batch.len(), 1, |i, _| batch.charge[i]);
        let sum =
            |charges| if gradients { points.potentials_and_gradients(charges) } else { points.potentials(charges) };
        Some(sum(charges.as_ref()))
    }
}

impl Force for Coulomb {
    fn nature(&self) -> Nature {
        Nature { couples_grains: true, ..Nature::default() }
    }

    fn add(&self, batch: &Batch, scratch: &mut Scratch, force: &mut [Vec3]) {
        if let Some(field) = self.far(batch, true) {
            for (i, f) in force.iter_mut().enumerate() {
                let gradient = Vec3::new(field[(i, 1)], field[(i, 2)], field[(i, 3)]);
                *f -= gradient * (COULOMB * batch.charge[i]);
            }
            return;
        }
        let sources = Sources::new(batch, &mut scratch.numbers);
        let arch = Arch::new();
        let one = |(tile, force): (usize, &mut [Vec3])| {
            let field = arch.dispatch(Tile { sources: &sources, first: tile * TILE });
            for (lane, f) in force.iter_mut().enumerate() {
                *f += Vec3::new(field.x[lane], field.y[lane], field.z[lane])
                    * (COULOMB * batch.charge[tile * TILE + lane]);
            }
        };
        if batch.len() * batch.len() < WORTH_SHARING {
            force.chunks_mut(TILE).enumerate().for_each(one);
        } else {
            force.par_chunks_mut(TILE).enumerate().for_each(one);
        }
    }

    fn add_energy(&self, batch: &Batch, _: &mut Scratch, energy: &mut [f64]) {
        if let Some(potential) = self.far(batch, false) {
            for (i, w) in energy.iter_mut().enumerate() {
                *w += 0.5 * COULOMB * batch.charge[i] * potential[(i, 0)];
            }
            return;
        }
        energy.par_iter_mut().enumerate().for_each(|(i, w)| {
            let mut sum = 0.0;
            for (j, (r, q)) in batch.position.iter().zip(batch.charge).enumerate() {
                if j != i {
                    sum += q / (batch.position[i] - r).norm();
                }
            }
            *w += 0.5 * COULOMB * batch.charge[i] * sum;
        });
    }
}

/// The obvious double loop: the judge of the fast one.
pub fn slow_coulomb(batch: &Batch, force: &mut [Vec3]) {
    for (i, force) in force.iter_mut().enumerate() {
        let mut sum = Vec3::zeros();
        for j in 0..batch.len() {
            if j != i {
                let d = batch.position[i] - batch.position[j];
                let r2 = d.x * d.x + d.y * d.y + d.z * d.z;
                sum += d * (batch.charge[j] / (r2 * r2.sqrt()));
            }
        }
        *force += sum * (COULOMB * batch.charge[i]);
    }
}

/// Positions and charges in arrays of their own, filled up to whole tiles with uncharged grains far away.
struct Sources<'a> {
    count: usize,
    x: &'a [f64],
    y: &'a [f64],
    z: &'a [f64],
    charge: &'a [f64],
    /// 0, 1, 2, ...: tells a target from itself.
    number: &'a [f64],
}

impl<'a> Sources<'a> {
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

/// Σ Q_j (r_i - r_j) / |r_i - r_j|³ for the targets of a tile.
struct Tile<'a> {
    sources: &'a Sources<'a>,
    first: usize,
}

struct TileField {
    x: [f64; TILE],
    y: [f64; TILE],
    z: [f64; TILE],
}

impl WithSimd for Tile<'_> {
    type Output = TileField;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> TileField {
        let Self { sources: s, first } = self;
        let mut out = TileField { x: [0.0; TILE], y: [0.0; TILE], z: [0.0; TILE] };
        let last = (first + TILE).min(s.count);
        let tile = first..first + TILE;
        let (x, _) = S::as_simd_f64s(&s.x[tile.clone()]);
        let (y, _) = S::as_simd_f64s(&s.y[tile.clone()]);
        let (z, _) = S::as_simd_f64s(&s.z[tile.clone()]);
        let (number, _) = S::as_simd_f64s(&s.number[tile]);
        let (out_x, _) = S::as_mut_simd_f64s(&mut out.x);
        let (out_y, _) = S::as_mut_simd_f64s(&mut out.y);
        let (out_z, _) = S::as_mut_simd_f64s(&mut out.z);
        // Two vectors at a time: their chains of root and division overlap, and all sums stay in registers.
        for v in (0..(last - first).div_ceil(S::F64_LANES)).step_by(2) {
            let w = (v + 1).min(x.len() - 1);
            let zero = simd.splat_f64s(0.0);
            let mut sum = [[zero; 3]; 2];
            let at = [[x[v], y[v], z[v]], [x[w], y[w], z[w]]];
            for j in 0..first {
                pair::<S, false>(simd, s, j, &at, &[number[v], number[w]], &mut sum);
            }
            for j in first..last {
                pair::<S, true>(simd, s, j, &at, &[number[v], number[w]], &mut sum);
            }
            for j in last..s.count {
                pair::<S, false>(simd, s, j, &at, &[number[v], number[w]], &mut sum);
            }
            for (k, lane) in [v, w].into_iter().enumerate() {
                out_x[lane] = sum[k][0];
                out_y[lane] = sum[k][1];
                out_z[lane] = sum[k][2];
            }
        }
        out
    }
}

/// Adds the field of source `j` at two vectors of targets; `NEAR` where a target may be the source.
#[inline(always)]
fn pair<S: Simd, const NEAR: bool>(
    simd: S,
    s: &Sources,
    j: usize,
    at: &[[S::f64s; 3]; 2],
    number: &[S::f64s; 2],
    sum: &mut [[S::f64s; 3]; 2],
) {
    let source = [simd.splat_f64s(s.x[j]), simd.splat_f64s(s.y[j]), simd.splat_f64s(s.z[j])];
    let charge = simd.splat_f64s(s.charge[j]);
    for k in 0..2 {
        let d = [0, 1, 2].map(|c| simd.sub_f64s(at[k][c], source[c]));
        let [xx, yy, zz] = d.map(|d| simd.mul_f64s(d, d));
        let r2 = simd.add_f64s(simd.add_f64s(xx, yy), zz);
        let mut weight = simd.div_f64s(charge, simd.mul_f64s(r2, simd.sqrt_f64s(r2)));
        if NEAR {
            let itself = simd.equal_f64s(number[k], simd.splat_f64s(j as f64));
            weight = simd.select_f64s(itself, simd.splat_f64s(0.0), weight);
        }
        for c in 0..3 {
            sum[k][c] = simd.add_f64s(sum[k][c], simd.mul_f64s(d[c], weight));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, Stream};

    struct Cloud {
        position: Vec<Vec3>,
        charge: Vec<f64>,
        zero: Vec<f64>,
        id: Vec<u64>,
    }

    impl Cloud {
        fn new(count: usize) -> Self {
            let mut stream = Stream::new(7, Purpose::Start, 0, 0);
            let mut next = || stream.unit() - 0.5;
            let position = (0..count).map(|_| Vec3::new(next(), next(), next())).collect();
            let charge = (0..count).map(|_| 1e-13 * next()).collect();
            Self { position, charge, zero: vec![0.0; count], id: vec![0; count] }
        }

        fn batch(&self) -> Batch<'_> {
            Batch {
                position: &self.position,
                velocity: &self.position,
                time: &self.zero,
                charge: &self.charge,
                mass: &self.zero,
                radius: &self.zero,
                id: &self.id,
            }
        }
    }

    fn fast(cloud: &Cloud) -> Vec<Vec3> {
        let mut force = vec![Vec3::zeros(); cloud.position.len()];
        Coulomb::default().add(&cloud.batch(), &mut Scratch::default(), &mut force);
        force
    }

    #[test]
    fn the_fast_sum_is_the_slow_sum() {
        for count in [0, 1, 2, 3, 31, 32, 33, 100, 257] {
            let cloud = Cloud::new(count);
            let mut slow = vec![Vec3::zeros(); count];
            slow_coulomb(&cloud.batch(), &mut slow);
            // The same operations in the same order, so the same bits; only the sign of a zero may differ.
            assert_eq!(fast(&cloud), slow, "{count} grains");
        }
    }

    #[test]
    fn every_width_of_vector_gives_the_same_bits() {
        let cloud = Cloud::new(77);
        let mut memory = Vec::new();
        let sources = Sources::new(&cloud.batch(), &mut memory);
        let tile = |first| Tile { sources: &sources, first };
        for first in [0, 32, 64] {
            let one = Simd::vectorize(pulp::Scalar::new(), tile(first));
            let mut others = vec![Arch::new().dispatch(tile(first))];
            #[cfg(target_arch = "x86_64")]
            {
                others.extend(pulp::x86::V3::try_new().map(|simd| Simd::vectorize(simd, tile(first))));
                others.extend(pulp::x86::V4::try_new().map(|simd| Simd::vectorize(simd, tile(first))));
            }
            let lanes = (77 - first).min(TILE);
            for other in others {
                for (a, b) in [(&one.x, &other.x), (&one.y, &other.y), (&one.z, &other.z)] {
                    assert_eq!(a[..lanes], b[..lanes]);
                }
            }
        }
    }

    #[test]
    fn forces_of_a_cloud_add_up_to_nothing_and_follow_the_energy() {
        let cloud = Cloud::new(60);
        let force = fast(&cloud);
        let size: f64 = force.iter().map(Vec3::norm).sum();
        // Round-off of 3600 terms.
        assert!(force.iter().sum::<Vec3>().norm() < 1e-14 * size);
        let energy = |cloud: &Cloud| {
            let mut energy = vec![0.0; 60];
            Coulomb::default().add_energy(&cloud.batch(), &mut Scratch::default(), &mut energy);
            energy.iter().sum::<f64>()
        };
        let step = 1e-6;
        for k in 0..3 {
            let moved = |by: f64| {
                let mut cloud = Cloud::new(60);
                cloud.position[17][k] += by;
                energy(&cloud)
            };
            let slope = (moved(-step) - moved(step)) / (2.0 * step);
            // Central difference: O(step²) against distances of 0.1, and the rounding of the energy over the step.
            assert!((slope - force[17][k]).abs() < 1e-7 * force[17].norm(), "{slope} {}", force[17][k]);
        }
    }

    #[test]
    fn the_multipole_sum_errs_by_less_than_asked() {
        // A ball of one sign, lumps of one sign, and charges of both signs: forces and energies against all pairs, at a
        // thousand of the grains; and what is left of the momentum, of the same size.
        for (name, lumps, signs) in [("even", 0, false), ("lumpy", 5, false), ("both signs", 0, true)] {
            let mut cloud = Cloud::new(MANY + 1);
            for (i, (r, q)) in cloud.position.iter_mut().zip(&mut cloud.charge).enumerate() {
                if lumps > 0 {
                    *r = *r * 0.05 + Vec3::new((i % lumps) as f64, ((i % lumps) as f64).sin(), 0.0);
                }
                *q = if signs { *q } else { q.abs() };
            }
            let mut direct = vec![Vec3::zeros(); cloud.position.len()];
            Coulomb::default().add(&cloud.batch(), &mut Scratch::default(), &mut direct);
            let mut energy = vec![0.0; cloud.position.len()];
            Coulomb::default().add_energy(&cloud.batch(), &mut Scratch::default(), &mut energy);
            for accuracy in [1e-2, 1e-4, 1e-6] {
                let many = Coulomb { accuracy: Some(accuracy) };
                let mut force = vec![Vec3::zeros(); direct.len()];
                many.add(&cloud.batch(), &mut Scratch::default(), &mut force);
                let off: f64 = force.iter().zip(&direct).map(|(a, b)| (a - b).norm_squared()).sum();
                let size: f64 = direct.iter().map(Vec3::norm_squared).sum();
                let error = (off / size).sqrt();
                println!("{name}, asked {accuracy:e}: {error:e}");
                assert!(error < accuracy, "{name}, asked {accuracy:e}: {error:e}");
                let left = force.iter().sum::<Vec3>().norm() / force.iter().map(Vec3::norm).sum::<f64>();
                assert!(left < accuracy, "{name}, asked {accuracy:e}: momentum {left:e}");
                let mut potential = vec![0.0; direct.len()];
                many.add_energy(&cloud.batch(), &mut Scratch::default(), &mut potential);
                let off: f64 = potential.iter().zip(&energy).map(|(a, b)| (a - b) * (a - b)).sum();
                assert!((off / energy.iter().map(|w| w * w).sum::<f64>()).sqrt() < accuracy, "{name}: energies");
            }
        }
    }

    #[test]
    fn grains_at_one_point_are_not_hidden() {
        let mut cloud = Cloud::new(40);
        cloud.position[3] = cloud.position[35];
        assert!(!fast(&cloud)[3].norm().is_finite());
    }
}
