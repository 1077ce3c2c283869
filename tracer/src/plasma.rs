//! How strongly a cloud of charges is coupled: the energy of neighbours over that of the motion.
//!
//!   Γ = k Q² / (r k_B T),  k = 1/(4πε0)
//!
//! with r the Wigner-Seitz radius a = (3/(4π n))^(1/3) of the density n (theory of the one-component plasma: a crystal from
//! Γ = 172 to 180 on, Ichimaru 1982), or the mean distance of nearest neighbours (what a picture shows; in a bcc crystal 1.7589 a).
//! T is that of the secular motion: micromotion is driven, and no disorder.
//!
//! Clouds in traps end. Below some thousand grains they freeze into shells and not into bcc, and n is that of a uniform ellipsoid
//! with the cloud's own second moments, R_k = √5 σ_k.

use field::constants::COULOMB;
use meshes::Vec3;

use crate::Sample;
use crate::constants::BOLTZMANN;

/// k Q² / (r k_B T), for a charge (C), a distance (m) and a temperature (K). Checked by `paper_coupling_tables`.
pub fn coupling(charge: f64, distance: f64, temperature: f64) -> f64 {
    COULOMB * charge * charge / (distance * BOLTZMANN * temperature)
}

/// What a cloud is like.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// Grains in it.
    pub grains: usize,
    /// Kinetic temperature of the secular motion, m⟨v²⟩/(3 k_B), K; what moves as a whole is part of it.
    pub temperature: f64,
    /// Of a uniform ellipsoid with the cloud's second moments, m.
    pub wigner_seitz_radius: f64,
    /// Mean distance of nearest neighbours, m.
    pub nearest_neighbour: f64,
    /// Γ with the Wigner-Seitz radius; infinite at rest.
    pub gamma: f64,
    /// Γ with the nearest neighbours' distance.
    pub gamma_of_neighbours: f64,
    /// Middles of the bins of the radial distribution, m.
    pub distances: Vec<f64>,
    /// Pairs in each bin over those of a uniform ball with the cloud's radius of gyration, whose pairs have the distances
    /// p(s) = 3 s²/R³ - 9 s³/(4 R⁴) + 3 s⁵/(16 R⁶), s < 2 R.
    pub distribution: Vec<f64>,
}

/// Bins of the radial distribution: a fifth of the neighbours' distance for a thousand grains.
const BINS: usize = 60;
/// Grains whose neighbours are looked for; of larger clouds, so many spread evenly through the list.
const CENTRES: usize = 2000;
/// Times that are averaged over, spread over the last tenth of the flights.
const TIMES: usize = 20;

/// What the cloud was like in the last tenth of its flights; `None` below two charged grains that were still flying at the end.
///
/// `tracks`: samples, charge (C) and mass (kg) of the grains that still fly. `period`: of the RF, s, zero without; the secular velocity
/// is how far a grain comes in a period, over it. (It falls short of a motion at β half the RF frequency by sin(πβ/2)/(πβ/2).)
pub fn cloud(tracks: &[(&[Sample], f64, f64)], period: f64) -> Option<Cloud> {
    let tracks: Vec<_> = tracks.iter().filter(|(samples, charge, _)| !samples.is_empty() && *charge != 0.0).collect();
    let count = tracks.len();
    let first = tracks.first()?.0;
    let (begin, end) = (first.first()?.time, first.last()?.time);
    if count < 2 || tracks.iter().any(|(samples, ..)| samples[samples.len() - 1].time < end) {
        return None;
    }
    // Every track is looked up where its own samples lie: at their times within the last tenth, a period after the start.
    let since = (end - 0.1 * (end - begin)).max((begin + period).min(end));
    let late: Vec<f64> = first.iter().map(|s| s.time).filter(|t| *t >= since).collect();
    let stride = late.len().div_ceil(TIMES).max(1);
    let times: Vec<f64> = late.iter().rev().step_by(stride).copied().collect();
    let mut sums = Sums::default();
    for time in &times {
        let now: Vec<(Vec3, Vec3)> = tracks.iter().map(|(samples, ..)| at(samples, *time)).collect();
        let slow = |g: usize| match period > 0.0 && time - period >= begin {
            true => (now[g].0 - at(tracks[g].0, time - period).0) / period,
            false => now[g].1,
        };
        sums.energy += (0..count).map(|g| tracks[g].2 * slow(g).norm_squared()).sum::<f64>() / count as f64;
        let places: Vec<Vec3> = now.iter().map(|(r, _)| *r).collect();
        sums.shape(&places);
        sums.pairs(&places);
    }
    let looks = times.len() as f64;
    let temperature = sums.energy / looks / (3.0 * BOLTZMANN);
    let neighbour = sums.neighbour / looks;
    // A chain or a sheet is as thick as its grains are apart.
    let axes = (sums.moments / looks).map(|s| (5.0 * s).sqrt().max(0.5 * neighbour));
    let wigner_seitz_radius = (axes.product() / count as f64).cbrt();
    let charge = (tracks.iter().map(|(_, charge, _)| charge * charge).sum::<f64>() / count as f64).sqrt();
    let radius = (5.0 / 3.0 * sums.gyration / looks).sqrt();
    let width = 2.0 * radius / BINS as f64;
    // Share of a uniform ball's pairs nearer than t = s/R: t³ - 9 t⁴/16 + t⁶/32.
    let nearer = |t: f64| t.powi(3) - 9.0 / 16.0 * t.powi(4) + t.powi(6) / 32.0;
    let histogram = histogram(&sums.distances, width);
    let all = sums.distances.len().max(1) as f64;
    let distribution = (0..BINS).map(|b| {
        let [from, to] = [b, b + 1].map(|b| nearer(2.0 * b as f64 / BINS as f64));
        histogram[b] / all / (to - from)
    });
    Some(Cloud {
        grains: count,
        temperature,
        wigner_seitz_radius,
        nearest_neighbour: neighbour,
        gamma: coupling(charge, wigner_seitz_radius, temperature),
        gamma_of_neighbours: coupling(charge, neighbour, temperature),
        distances: (0..BINS).map(|b| (b as f64 + 0.5) * width).collect(),
        distribution: distribution.collect(),
    })
}

#[derive(Default)]
struct Sums {
    energy: f64,
    neighbour: f64,
    gyration: f64,
    moments: Vec3,
    distances: Vec<f64>,
}

impl Sums {
    /// Second moments along the principal axes.
    fn shape(&mut self, places: &[Vec3]) {
        let middle = places.iter().sum::<Vec3>() / places.len() as f64;
        let spread = places.iter().map(|r| (r - middle) * (r - middle).transpose()).sum::<nalgebra::Matrix3<f64>>();
        let mut moments = (spread / places.len() as f64).symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        self.gyration += moments.sum();
        self.moments += moments.map(|m| m.max(0.0));
    }

    /// Distances of all pairs, and of nearest neighbours.
    fn pairs(&mut self, places: &[Vec3]) {
        let step = places.len().div_ceil(CENTRES);
        let (mut sum, mut centres) = (0.0, 0.0);
        for i in (0..places.len()).step_by(step) {
            let mut nearest = f64::INFINITY;
            for (j, other) in places.iter().enumerate().filter(|(j, _)| *j != i) {
                let distance = (places[i] - other).norm();
                nearest = nearest.min(distance);
                if j < i || step > 1 {
                    self.distances.push(distance);
                }
            }
            sum += nearest;
            centres += 1.0;
        }
        self.neighbour += sum / centres;
    }
}

fn histogram(distances: &[f64], width: f64) -> Vec<f64> {
    let mut histogram = vec![0.0; BINS];
    for distance in distances {
        if let Some(bin) = histogram.get_mut((distance / width) as usize) {
            *bin += 1.0;
        }
    }
    histogram
}

/// Position and velocity at a time, between samples by Hermite's cubic.
fn at(samples: &[Sample], time: f64) -> (Vec3, Vec3) {
    let after = samples.partition_point(|s| s.time < time).min(samples.len() - 1);
    let b = &samples[after];
    let Some(a) = after.checked_sub(1).map(|before| &samples[before]).filter(|_| b.time > time) else {
        return (b.position, b.velocity);
    };
    let h = b.time - a.time;
    let t = (time - a.time) / h;
    let (t2, t3) = (t * t, t * t * t);
    let position = a.position * (2.0 * t3 - 3.0 * t2 + 1.0)
        + a.velocity * (h * (t3 - 2.0 * t2 + t))
        + b.position * (3.0 * t2 - 2.0 * t3)
        + b.velocity * (h * (t3 - t2));
    let velocity = (b.position - a.position) * (6.0 * (t - t2) / h)
        + a.velocity * (3.0 * t2 - 4.0 * t + 1.0)
        + b.velocity * (3.0 * t2 - 2.0 * t);
    (position, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, Stream};
    use rand_distr::{Distribution, StandardNormal, UnitBall};

    fn track(path: impl Fn(f64) -> (Vec3, Vec3), every: f64, count: usize) -> Vec<Sample> {
        (0..count)
            .map(|k| k as f64 * every)
            .map(|time| {
                let (position, velocity) = path(time);
                Sample { time, position, velocity, force: Vec3::zeros(), potential_energy: 0.0 }
            })
            .collect()
    }

    #[test]
    fn a_uniform_ball_at_a_known_temperature() {
        let (mass, charge, temperature, radius, count) = (1e-13, 1e-14, 300.0, 2e-3, 1500);
        let speed = (BOLTZMANN * temperature / mass).sqrt();
        let omega = std::f64::consts::TAU * 50.0;
        let samples: Vec<Vec<Sample>> = (0..count)
            .map(|g| {
                let mut stream = Stream::new(7, Purpose::Start, g, 0);
                let place = Vec3::from(<UnitBall as Distribution<[f64; 3]>>::sample(&UnitBall, &mut stream)) * radius;
                let drift = Vec3::from_fn(|_, _| speed * Distribution::<f64>::sample(&StandardNormal, &mut stream));
                // Micromotion a thousand times as fast as the drift.
                let shake = 1000.0 * speed / omega;
                track(
                    |t| {
                        let (s, c) = (omega * t).sin_cos();
                        (place + drift * t + Vec3::x() * (shake * s), drift + Vec3::x() * (shake * omega * c))
                    },
                    // No whole part of the period.
                    0.00131,
                    400,
                )
            })
            .collect();
        let tracks: Vec<_> = samples.iter().map(|s| (&s[..], charge, mass)).collect();
        let cloud = cloud(&tracks, 0.02).unwrap();
        // 4500 normal numbers: their mean square is known to sqrt(2/4500) = 2 %, here within three times that; Hermite's cubic
        // misses (ω h)⁴/384 = 7e-5 of the micromotion, which is 0.4 % of the way of a period.
        assert!((cloud.temperature / temperature - 1.0).abs() < 0.06, "{}", cloud.temperature);
        // Second moments of 1500 points: 2 %.
        let a = radius / (count as f64).cbrt();
        assert!((cloud.wigner_seitz_radius / a - 1.0).abs() < 0.03, "{} {a}", cloud.wigner_seitz_radius);
        // Points without order: ⟨nearest⟩ = Γ(4/3) a = 0.89298 a (Hertz 1909), and at the edge of the ball somewhat more.
        let near = cloud.nearest_neighbour / a;
        assert!(near > 0.88 && near < 0.97, "{near}");
        // And flat: a bin of the middle has some 1e5 pairs of 1500 points, ±2 %.
        assert!(cloud.distribution[10..50].iter().all(|g| (g - 1.0).abs() < 0.1), "{:?}", cloud.distribution);
        let gamma = coupling(charge, cloud.wigner_seitz_radius, cloud.temperature);
        assert!((cloud.gamma / gamma - 1.0).abs() < 1e-12, "{} {gamma}", cloud.gamma);
    }

    #[test]
    fn no_cloud() {
        let still = track(|_| (Vec3::zeros(), Vec3::zeros()), 0.1, 10);
        assert_eq!(cloud(&[], 0.0), None);
        assert_eq!(cloud(&[(&still, 1e-15, 1e-13)], 0.0), None);
        assert_eq!(cloud(&[(&still, 1e-15, 1e-13), (&still, 0.0, 1e-13)], 0.0), None);
    }

    #[test]
    fn two_at_rest_are_coupled_without_end() {
        let places = [0.0, 1e-3].map(|x| track(|_| (Vec3::x() * x, Vec3::zeros()), 0.1, 10));
        let pair = cloud(&[(&places[0], 1e-15, 1e-13), (&places[1], 1e-15, 1e-13)], 0.02).unwrap();
        assert_eq!((pair.temperature, pair.nearest_neighbour, pair.gamma), (0.0, 1e-3, f64::INFINITY));
    }
}
