//! Mutual repulsion and attraction of the grains.

use faer::Mat;
use field::constants::COULOMB;
use field::multipole::Points;
use meshes::Vec3;

use super::{Batch, Force, Nature, Scratch, pairs};

/// Every grain on every other:
///
///   F_i = k Q_i Σ_j Q_j (r_i - r_j) / |r_i - r_j|³,  energy of a pair k Q_i Q_j / |r_i - r_j|
///
/// k Coulomb's constant 1 / (4 π ε0), Q charge in C, r position in m. Point charges; the field of one grain's charge by
/// way of the electrodes (images, screening) is not in it. Two grains at one point give an answer that is not finite.
///
/// Source: Coulomb's law. Checked by `the_fast_sum_is_the_slow_sum` and `exact_two_grains_collide_as_kepler_says`.
///
/// *Why direct:* exact, and 2e9 pairs a second and core carry some thousand grains.
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
/// against 0.5 ns a pair.
pub const MANY: usize = 4000;

/// The multipole method is asked for so much of the accuracy: its errors are estimates for even clouds, and reach 1.1 of what is
/// asked in lumpy ones.
const SHARE: f64 = 0.5;

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
        pairs::forces(batch, &mut scratch.numbers, |i, own| force[i] += own * COULOMB);
    }

    fn add_energy(&self, batch: &Batch, scratch: &mut Scratch, energy: &mut [f64]) {
        if let Some(potential) = self.far(batch, false) {
            for (i, w) in energy.iter_mut().enumerate() {
                *w += 0.5 * COULOMB * batch.charge[i] * potential[(i, 0)];
            }
            return;
        }
        let potential = pairs::potentials(batch, &mut scratch.numbers);
        for ((w, potential), charge) in energy.iter_mut().zip(potential).zip(batch.charge) {
            *w += 0.5 * COULOMB * charge * potential;
        }
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
            for (i, (fast, slow)) in fast(&cloud).iter().zip(&slow).enumerate() {
                // Another order of the sum: rounding of as many terms.
                let term = |j: usize| cloud.charge[j] / (cloud.position[i] - cloud.position[j]).norm_squared();
                let size: f64 = (0..count).filter(|j| *j != i).map(|j| term(j).abs()).sum();
                let allowed = f64::EPSILON * count as f64 * COULOMB * cloud.charge[i].abs() * size;
                assert!((fast - slow).norm() <= allowed, "{count} grains: {fast}, {slow}");
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
