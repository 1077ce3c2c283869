//! Where grains start and how fast.

use std::ops::Range;

use meshes::Vec3;
use rand_distr::{Distribution, StandardNormal, UnitBall, UnitDisc, UnitSphere};
use thiserror::Error;

use crate::constants::BOLTZMANN;
use crate::stream::{Purpose, Stream};
use crate::{Ensemble, Grain, GrainError};

/// Where the grains of one group start.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// At these points, m.
    Points(Vec<Vec3>),
    /// Uniform in a ball.
    Ball {
        /// m.
        center: Vec3,
        /// m.
        radius: f64,
    },
    /// Uniform on a sphere.
    Shell {
        /// m.
        center: Vec3,
        /// m.
        radius: f64,
    },
    /// Uniform in a box.
    Box {
        /// Lower corner, m.
        min: Vec3,
        /// Upper corner, m.
        max: Vec3,
    },
    /// Uniform on a flat disc.
    Disc {
        /// m.
        center: Vec3,
        /// Normal of the disc; any length.
        axis: Vec3,
        /// m.
        radius: f64,
    },
    /// Uniform in a cylinder that starts at `center` and reaches back along the axis.
    Beam {
        /// Middle of the front face, m.
        center: Vec3,
        /// Direction of flight; any length.
        axis: Vec3,
        /// m.
        radius: f64,
        /// m; zero is a disc.
        length: f64,
    },
}

/// How the grains of one group start to move.
#[derive(Clone, Debug, PartialEq)]
pub enum Launch {
    /// At rest.
    Rest,
    /// All with this velocity, m/s.
    Uniform(Vec3),
    /// Maxwell-Boltzmann at this temperature, K.
    Thermal(f64),
    /// This speed, m/s, in random directions.
    Isotropic(f64),
    /// Each with a velocity of its own, m/s; as many as there are points.
    Each(Vec<Vec3>),
}

/// Grains of one kind that start together.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// How many. With `Place::Points`: as many as there are points.
    pub count: usize,
    /// Of each grain, C.
    pub charge: f64,
    /// Of each grain, kg.
    pub mass: f64,
    /// Of each grain, m; zero when nothing asks for it.
    pub radius: f64,
    /// Where they start.
    pub place: Place,
    /// How fast.
    pub launch: Launch,
}

/// Why a group cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CloudError {
    /// Points or velocities are listed, but not one for each grain.
    #[error("{given} {what} are given for {count} grains; give one for each grain, or change the count")]
    Count {
        /// Points or velocities.
        what: &'static str,
        /// How many there are.
        given: usize,
        /// How many grains.
        count: usize,
    },
    /// A number that makes no sense.
    #[error("{what} is {value}; give {expected}")]
    Value {
        /// Which.
        what: &'static str,
        /// What it was.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// A grain could not be added.
    #[error(transparent)]
    Grain(#[from] GrainError),
}

/// The id of a grain: its group's number and its own within the group, so that no other group moves it.
pub fn grain_id(group: u32, index: usize) -> u64 {
    (u64::from(group) << 40) | index as u64
}

impl Ensemble {
    /// Draws a group of grains and adds them; gives their indices.
    ///
    /// Every grain has a random stream of its own, named by the seed, the number of the group and the grain's place in it:
    /// adding grains to one group, or another group, moves no other grain.
    ///
    /// # Errors
    /// Lists of the wrong length, sizes or temperatures that are negative or not finite, a grain without mass.
    pub fn add_group(&mut self, number: u32, group: &Group, seed: u64) -> Result<Range<usize>, CloudError> {
        check(group)?;
        let first = self.len();
        for index in 0..group.count {
            let id = grain_id(number, index);
            let mut stream = Stream::new(seed, Purpose::Start, id, 0);
            let position = position(&group.place, index, &mut stream);
            let velocity = velocity(&group.launch, index, group.mass, &mut stream);
            let (charge, mass, radius) = (group.charge, group.mass, group.radius);
            self.push(Grain { position, velocity, charge, mass, radius, id, group: number })?;
        }
        Ok(first..self.len())
    }
}

fn check(group: &Group) -> Result<(), CloudError> {
    let value = |ok: bool, what, value, expected| {
        if ok { Ok(()) } else { Err(CloudError::Value { what, value, expected }) }
    };
    let size = |what, x: f64| value(x.is_finite() && x >= 0.0, what, x, "zero or more, in m");
    let direction = |axis: &Vec3| {
        let length = axis.norm();
        value(length.is_finite() && length > 0.0, "length of the axis", length, "an axis that is not zero")
    };
    let list = |what, given: usize| {
        if given == group.count { Ok(()) } else { Err(CloudError::Count { what, given, count: group.count }) }
    };
    match &group.place {
        Place::Points(points) => list("points", points.len())?,
        Place::Ball { radius, .. } | Place::Shell { radius, .. } => size("radius of the cloud", *radius)?,
        Place::Box { min, max } => {
            for k in 0..3 {
                size("extent of the box", max[k] - min[k])?;
            }
        }
        Place::Disc { axis, radius, .. } => {
            direction(axis)?;
            size("radius of the disc", *radius)?;
        }
        Place::Beam { axis, radius, length, .. } => {
            direction(axis)?;
            size("radius of the beam", *radius)?;
            size("length of the beam", *length)?;
        }
    }
    match &group.launch {
        Launch::Thermal(t) => value(t.is_finite() && *t >= 0.0, "temperature", *t, "zero or more, in K"),
        Launch::Isotropic(v) => value(v.is_finite() && *v >= 0.0, "speed", *v, "zero or more, in m/s"),
        Launch::Each(velocities) => list("velocities", velocities.len()),
        Launch::Rest | Launch::Uniform(_) => Ok(()),
    }
}

fn position(place: &Place, index: usize, stream: &mut Stream) -> Vec3 {
    match place {
        Place::Points(points) => points[index],
        Place::Ball { center, radius } => {
            let p: [f64; 3] = UnitBall.sample(stream);
            center + Vec3::from(p) * *radius
        }
        Place::Shell { center, radius } => {
            let p: [f64; 3] = UnitSphere.sample(stream);
            center + Vec3::from(p) * *radius
        }
        Place::Box { min, max } => {
            let u = Vec3::new(stream.unit(), stream.unit(), stream.unit());
            min + (max - min).component_mul(&u)
        }
        Place::Disc { center, axis, radius } => center + across(axis, stream) * *radius,
        Place::Beam { center, axis, radius, length } => {
            let back = axis.normalize() * (length * stream.unit());
            center + across(axis, stream) * *radius - back
        }
    }
}

/// A point of the unit disc across an axis.
fn across(axis: &Vec3, stream: &mut Stream) -> Vec3 {
    let n = axis.normalize();
    // The coordinate axis least along n gives a first direction across it.
    let e = Vec3::ith(n.iamin(), 1.0);
    let u = n.cross(&e).normalize();
    let [a, b]: [f64; 2] = UnitDisc.sample(stream);
    u * a + n.cross(&u) * b
}

fn velocity(launch: &Launch, index: usize, mass: f64, stream: &mut Stream) -> Vec3 {
    match launch {
        Launch::Rest => Vec3::zeros(),
        Launch::Uniform(v) => *v,
        // Each component is normal with variance kB T / m.
        Launch::Thermal(temperature) => normal_vector(stream) * (BOLTZMANN * temperature / mass).sqrt(),
        Launch::Isotropic(speed) => {
            let d: [f64; 3] = UnitSphere.sample(stream);
            Vec3::from(d) * *speed
        }
        Launch::Each(velocities) => velocities[index],
    }
}

/// Three independent normal numbers of variance one.
pub(crate) fn normal_vector(stream: &mut Stream) -> Vec3 {
    let mut next = || StandardNormal.sample(stream);
    Vec3::new(next(), next(), next())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEED: u64 = 20_261_122;
    const COUNT: usize = 40_000;

    fn draw(place: Place, launch: Launch) -> Ensemble {
        let group = Group { count: COUNT, charge: 1e-15, mass: 2e-15, radius: 1e-6, place, launch };
        let mut grains = Ensemble::new();
        grains.add_group(3, &group, SEED).unwrap();
        grains
    }

    /// Mean of a function over the points must be `expected` within five standard errors, the variance of one draw given.
    fn mean_is(points: &[Vec3], expected: f64, variance: f64, what: &str, f: impl Fn(&Vec3) -> f64) {
        let mean = points.iter().map(f).sum::<f64>() / points.len() as f64;
        let sigma = (variance / points.len() as f64).sqrt();
        assert!((mean - expected).abs() < 5.0 * sigma, "{what}: {mean}, expected {expected} ± {sigma}");
    }

    #[test]
    fn a_ball_is_filled_evenly() {
        let center = Vec3::new(1.0, -2.0, 3.0);
        let grains = draw(Place::Ball { center, radius: 0.5 }, Launch::Rest);
        let unit: Vec<Vec3> = grains.positions().iter().map(|p| (p - center) / 0.5).collect();
        assert!(unit.iter().all(|p| p.norm() <= 1.0));
        // r^3 is uniform in [0, 1]; each coordinate has variance 1/5 and mean fourth power 3/35.
        mean_is(&unit, 0.5, 1.0 / 12.0, "r^3", |p| p.norm().powi(3));
        mean_is(&unit, 1.0 / 3.0, 4.0 / 45.0, "r^6", |p| p.norm().powi(6));
        for k in 0..3 {
            mean_is(&unit, 0.0, 0.2, "coordinate", |p| p[k]);
            mean_is(&unit, 0.2, 3.0 / 35.0 - 0.04, "square", |p| p[k] * p[k]);
            mean_is(&unit, 0.0, 1.0 / 35.0, "mixed", |p| p[k] * p[(k + 1) % 3]);
        }
    }

    #[test]
    fn a_shell_is_covered_evenly() {
        let grains = draw(Place::Shell { center: Vec3::zeros(), radius: 2.0 }, Launch::Rest);
        let unit: Vec<Vec3> = grains.positions().iter().map(|p| p / 2.0).collect();
        assert!(unit.iter().all(|p| (p.norm() - 1.0).abs() < 1e-14), "on the sphere to rounding");
        // Archimedes: each coordinate is uniform in [-1, 1].
        for k in 0..3 {
            mean_is(&unit, 0.0, 1.0 / 3.0, "coordinate", |p| p[k]);
            mean_is(&unit, 1.0 / 3.0, 1.0 / 5.0 - 1.0 / 9.0, "square", |p| p[k] * p[k]);
            mean_is(&unit, 0.5, 0.25, "cap", |p| f64::from(p[k] > 0.0));
        }
    }

    #[test]
    fn a_disc_and_a_beam_lie_across_their_axis() {
        let (center, axis) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, 2.0, -2.0));
        let disc = draw(Place::Disc { center, axis, radius: 0.3 }, Launch::Rest);
        let unit: Vec<Vec3> = disc.positions().iter().map(|p| (p - center) / 0.3).collect();
        assert!(unit.iter().all(|p| p.dot(&axis).abs() < 1e-14), "flat to rounding");
        // r^2 is uniform in [0, 1].
        mean_is(&unit, 0.5, 1.0 / 12.0, "r^2", Vec3::norm_squared);
        mean_is(&unit, 1.0 / 3.0, 4.0 / 45.0, "r^4", |p| p.norm_squared().powi(2));
        let beam = draw(Place::Beam { center, axis, radius: 0.3, length: 6.0 }, Launch::Rest);
        let along: Vec<Vec3> =
            beam.positions().iter().map(|p| Vec3::x() * (p - center).dot(&axis) / 3.0 / 6.0).collect();
        assert!(along.iter().all(|p| (-1.0..1e-15).contains(&p.x)), "it reaches back");
        mean_is(&along, -0.5, 1.0 / 12.0, "along", |p| p.x);
    }

    #[test]
    fn thermal_velocities_have_the_variance_of_the_temperature() {
        let place = Place::Box { min: Vec3::repeat(-1.0), max: Vec3::repeat(1.0) };
        let grains = draw(place, Launch::Thermal(300.0));
        let s2 = BOLTZMANN * 300.0 / 2e-15;
        let scaled: Vec<Vec3> = grains.velocities().iter().map(|v| v / s2.sqrt()).collect();
        for k in 0..3 {
            mean_is(&scaled, 0.0, 1.0, "mean", |v| v[k]);
            mean_is(&scaled, 1.0, 2.0, "variance", |v| v[k] * v[k]);
            mean_is(&scaled, 3.0, 96.0, "fourth moment", |v| v[k].powi(4));
            mean_is(&scaled, 0.0, 1.0, "correlation", |v| v[k] * v[(k + 1) % 3]);
        }
        // The start and the speed of a grain are drawn from one stream and must not know of each other.
        for k in 0..3 {
            let mixed: f64 = grains.positions().iter().zip(&scaled).map(|(p, v)| p[k] * v[k]).sum();
            assert!(mixed.abs() < 5.0 * (COUNT as f64 / 3.0).sqrt(), "{mixed}");
        }
    }

    #[test]
    fn a_grain_starts_the_same_whatever_the_others_do() {
        let group = |count| Group {
            count,
            charge: 0.0,
            mass: 1.0,
            radius: 0.0,
            place: Place::Ball { center: Vec3::zeros(), radius: 1.0 },
            launch: Launch::Thermal(1.0),
        };
        let (mut few, mut many) = (Ensemble::new(), Ensemble::new());
        few.add_group(1, &group(5), SEED).unwrap();
        many.add_group(0, &group(7), SEED).unwrap();
        let second = many.add_group(1, &group(50), SEED).unwrap();
        let same: Vec<usize> = second.take(5).collect();
        assert_eq!(many.subset(&same), few);
        assert_ne!(many.positions()[0], many.positions()[7], "groups have streams of their own");
    }

    #[test]
    fn lists_must_match_the_count() {
        let group = Group {
            count: 2,
            charge: 0.0,
            mass: 1.0,
            radius: 0.0,
            place: Place::Points(vec![Vec3::zeros()]),
            launch: Launch::Rest,
        };
        let error = Ensemble::new().add_group(0, &group, 0).unwrap_err().to_string();
        assert_eq!(error, "1 points are given for 2 grains; give one for each grain, or change the count");
        let wrong = Group { place: Place::Ball { center: Vec3::zeros(), radius: -1.0 }, ..group };
        assert!(Ensemble::new().add_group(0, &wrong, 0).is_err());
    }
}
