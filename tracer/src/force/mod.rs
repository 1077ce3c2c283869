//! What pushes grains, apart from drag and magnetic field.

pub mod coulomb;
pub mod electric;
pub mod image_charge;
pub mod linear_form;
mod pairs;
pub mod uniform;

use field::Samples;
use meshes::Vec3;

use self::linear_form::LinearForm;

/// Grains as a force sees them: one entry for each, every grain at a time of its own.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// m.
    pub position: &'a [Vec3],
    /// m/s.
    pub velocity: &'a [Vec3],
    /// s.
    pub time: &'a [f64],
    /// C.
    pub charge: &'a [f64],
    /// kg.
    pub mass: &'a [f64],
    /// m.
    pub radius: &'a [f64],
    /// The grains' ids.
    pub id: &'a [u64],
}

impl<'a> Batch<'a> {
    /// How many grains.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Some consecutive grains of the batch.
    ///
    /// # Panics
    /// The range reaches past the end.
    pub fn part(&self, range: std::ops::Range<usize>) -> Batch<'a> {
        Batch {
            position: &self.position[range.clone()],
            velocity: &self.velocity[range.clone()],
            time: &self.time[range.clone()],
            charge: &self.charge[range.clone()],
            mass: &self.mass[range.clone()],
            radius: &self.radius[range.clone()],
            id: &self.id[range],
        }
    }
}

/// What a force is like, as far as integrators care.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nature {
    /// The force on a grain depends on where the others are: then all grains share one step, and the force is always
    /// asked for all of them at once, at one time.
    pub couples_grains: bool,
    /// It depends on the velocity: then integrators that split cannot be used.
    pub needs_velocity: bool,
    /// Its derivatives jump at many places: then schemes of high order do not pay.
    pub rough: bool,
    /// Its shortest period, s.
    pub shortest_period: Option<f64>,
}

/// A force on grains.
pub trait Force: Send + Sync {
    /// What kind of force it is.
    fn nature(&self) -> Nature {
        Nature::default()
    }

    /// Adds the force (N) on each grain of the batch to `force`.
    ///
    /// Unless it couples grains, it runs on the calling thread, and what it adds for a grain does not depend, to the
    /// last bit, on the other grains of the batch. Where the force is singular it adds something that is not finite.
    fn add(&self, batch: &Batch, scratch: &mut Scratch, force: &mut [Vec3]);

    /// Adds the potential energy (J) of each grain to `energy`; nothing for a force that has none. The energy of a pair
    /// is shared evenly by the two, so that the sum over grains is the energy of the whole.
    fn add_energy(&self, _batch: &Batch, _scratch: &mut Scratch, _energy: &mut [f64]) {}

    /// The force as a linear function of position, if it is one everywhere. It gives what [`Force::add`] gives, to rounding.
    fn linear_form(&self) -> Option<LinearForm> {
        None
    }

    /// The first time after `t` (s) at which the force is not smooth in time, or infinity.
    fn next_corner(&self, _t: f64) -> f64 {
        f64::INFINITY
    }
}

/// Memory that forces may use during a call; its contents mean nothing between calls.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Of a basis of fields.
    pub samples: Samples,
    /// One number for each grain.
    pub scalar: Vec<f64>,
    /// One vector for each grain.
    pub vector: Vec<Vec3>,
    /// Any numbers.
    pub numbers: Vec<f64>,
}
