//! The grains of a run: where they are, how fast, how charged, how heavy.

use meshes::Vec3;
use thiserror::Error;

/// One grain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain {
    /// m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// C; of either sign, or zero.
    pub charge: f64,
    /// kg; positive.
    pub mass: f64,
    /// m; zero when nothing asks for it (only gas drag does).
    pub radius: f64,
    /// Names the grain's random stream. No two grains of an ensemble that is to feel noise should share one.
    pub id: u64,
    /// Which group the grain belongs to.
    pub group: u32,
}

/// What is wrong with a grain.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum GrainError {
    /// A number that makes no sense.
    #[error("grain {index}: {what} is {value}; give {expected}")]
    Value {
        /// Where the grain would have stood in the ensemble.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
        /// What it was.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
}

/// Grains as a structure of arrays; all arrays have the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ensemble {
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    charge: Vec<f64>,
    mass: Vec<f64>,
    radius: Vec<f64>,
    id: Vec<u64>,
    group: Vec<u32>,
}

impl Ensemble {
    /// No grains yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a grain.
    ///
    /// # Errors
    /// A mass that is not positive, a negative radius, or anything that is not finite.
    pub fn push(&mut self, grain: Grain) -> Result<(), GrainError> {
        let index = self.len();
        let check = |ok: bool, what, value, expected| {
            if ok { Ok(()) } else { Err(GrainError::Value { index, what, value, expected }) }
        };
        for (what, vector) in [("position", grain.position), ("velocity", grain.velocity)] {
            for x in vector.iter() {
                check(x.is_finite(), what, *x, "finite components")?;
            }
        }
        check(grain.mass.is_finite() && grain.mass > 0.0, "mass", grain.mass, "a positive mass in kg")?;
        check(grain.charge.is_finite(), "charge", grain.charge, "a finite charge in C")?;
        check(
            grain.radius.is_finite() && grain.radius >= 0.0,
            "radius",
            grain.radius,
            "a radius of zero or more, in m",
        )?;
        self.position.push(grain.position);
        self.velocity.push(grain.velocity);
        self.charge.push(grain.charge);
        self.mass.push(grain.mass);
        self.radius.push(grain.radius);
        self.id.push(grain.id);
        self.group.push(grain.group);
        Ok(())
    }

    /// How many grains.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// One grain.
    ///
    /// # Panics
    /// `index` is not below `len`.
    pub fn grain(&self, index: usize) -> Grain {
        Grain {
            position: self.position[index],
            velocity: self.velocity[index],
            charge: self.charge[index],
            mass: self.mass[index],
            radius: self.radius[index],
            id: self.id[index],
            group: self.group[index],
        }
    }

    /// The grains with these indices, in this order.
    ///
    /// # Panics
    /// An index is not below `len`.
    pub fn subset(&self, indices: &[usize]) -> Self {
        Self {
            position: indices.iter().map(|&i| self.position[i]).collect(),
            velocity: indices.iter().map(|&i| self.velocity[i]).collect(),
            charge: indices.iter().map(|&i| self.charge[i]).collect(),
            mass: indices.iter().map(|&i| self.mass[i]).collect(),
            radius: indices.iter().map(|&i| self.radius[i]).collect(),
            id: indices.iter().map(|&i| self.id[i]).collect(),
            group: indices.iter().map(|&i| self.group[i]).collect(),
        }
    }

    /// m, one for each grain.
    pub fn positions(&self) -> &[Vec3] {
        &self.position
    }

    /// m/s, one for each grain.
    pub fn velocities(&self) -> &[Vec3] {
        &self.velocity
    }

    /// C, one for each grain.
    pub fn charges(&self) -> &[f64] {
        &self.charge
    }

    /// kg, one for each grain.
    pub fn masses(&self) -> &[f64] {
        &self.mass
    }

    /// m, one for each grain.
    pub fn radii(&self) -> &[f64] {
        &self.radius
    }

    /// Names of the grains' random streams.
    pub fn ids(&self) -> &[u64] {
        &self.id
    }

    /// The group of each grain.
    pub fn groups(&self) -> &[u32] {
        &self.group
    }

    /// Puts a grain somewhere else (m), with another velocity (m/s).
    ///
    /// # Panics
    /// `index` is not below `len`.
    pub fn place(&mut self, index: usize, position: Vec3, velocity: Vec3) {
        self.position[index] = position;
        self.velocity[index] = velocity;
    }

    /// Kinetic energy of all grains together, J.
    pub fn kinetic_energy(&self) -> f64 {
        self.velocity.iter().zip(&self.mass).map(|(v, m)| 0.5 * m * v.norm_squared()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grain_without_mass_is_refused_with_its_number() {
        let good = Grain {
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            charge: 0.0,
            mass: 1.0,
            radius: 0.0,
            id: 0,
            group: 0,
        };
        let mut grains = Ensemble::new();
        grains.push(good).unwrap();
        let error = grains.push(Grain { mass: 0.0, ..good }).unwrap_err();
        assert_eq!(error.to_string(), "grain 1: mass is 0; give a positive mass in kg");
        assert!(grains.push(Grain { charge: f64::NAN, ..good }).is_err());
        assert!(grains.push(Grain { position: Vec3::new(0.0, f64::INFINITY, 0.0), ..good }).is_err());
        assert_eq!(grains.len(), 1);
    }
}
