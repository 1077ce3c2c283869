//! Grains side by side: where they are and the step they try.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use crate::force::{Batch, Scratch};
use crate::linear::Linear;
use crate::path::Motion;
use crate::{Ensemble, System, TraceError};

/// Grains traced together: a few dozen independent ones, or all that feel each other.
///
/// Every array has one entry for each grain still flying, in the order of the ensemble.
pub(crate) struct Block<'a> {
    pub forces: Forces<'a>,
    pub linear: Vec<Linear>,
    /// kB T / m of the noise, m²/s².
    pub thermal: Vec<f64>,
    pub state: Vec<State>,
    pub trial: Vec<Trial>,
    /// Names the random numbers.
    pub seed: u64,
    /// Relative error a step may make.
    pub tolerance: f64,
    /// Whether anything can end a flight on its way, so that `reach` is wanted.
    pub watched: bool,
    /// Length below which motions need not be resolved relative to themselves, m.
    pub least_travel: f64,
}

/// Where a grain is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct State {
    /// s.
    pub time: f64,
    /// The acceleration is that of the forces alone, without drag and magnetic field.
    pub motion: Motion,
    /// Whether the acceleration is known.
    pub fresh: bool,
    /// Where it started, m.
    pub origin: Vec3,
    /// The farthest it has been from there, m.
    pub travel: f64,
    /// The fastest it has been, m/s.
    pub top_speed: f64,
}

/// A step to try, and what came of it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Trial {
    /// s.
    pub step: f64,
    /// s.
    pub end: f64,
    /// Time from its start to the next corner of the forces or the end of the run, s.
    pub room: f64,
    /// Longest step that the run allows, s.
    pub longest: f64,
    /// Whether it is the first of even steps.
    pub first: bool,
    /// How many steps of length `step` it stands for.
    pub steps: u64,
    /// Number of the step, for the random numbers.
    pub number: u64,
    /// At the end; the acceleration is that of the forces alone.
    pub motion: Motion,
    /// Whether that acceleration is known.
    pub fresh: bool,
    /// Estimated error over what is allowed; zero for integrators that do not estimate.
    pub error: f64,
    /// How far from the start of the step the grain may have been on its way, m.
    pub reach: f64,
}

impl<'a> Block<'a> {
    pub fn new(system: &'a System, ensemble: &Ensemble, grains: &[usize]) -> Result<Self, TraceError> {
        let (charge, mass, radius) = (ensemble.charges(), ensemble.masses(), ensemble.radii());
        let mut linear = Vec::with_capacity(grains.len());
        for &g in grains {
            let of_grain = system.linear(charge[g], mass[g], radius[g]);
            linear.push(of_grain.map_err(|source| TraceError::Drag { grain: g, source })?);
        }
        Ok(Self {
            forces: Forces {
                system,
                charge: grains.iter().map(|&g| charge[g]).collect(),
                mass: grains.iter().map(|&g| mass[g]).collect(),
                radius: grains.iter().map(|&g| radius[g]).collect(),
                id: grains.iter().map(|&g| ensemble.ids()[g]).collect(),
                period: system.nature().shortest_period.unwrap_or(0.0),
                evaluations: 0,
                scratch: Scratch::default(),
                gathered: Gathered::default(),
                force: Vec::new(),
            },
            linear,
            thermal: grains.iter().map(|&g| system.thermal(mass[g])).collect(),
            state: grains.iter().map(|&g| State::new(ensemble, g)).collect(),
            trial: vec![Trial::default(); grains.len()],
            seed: 0,
            tolerance: 0.0,
            watched: true,
            least_travel: 0.0,
        })
    }

    pub fn len(&self) -> usize {
        self.state.len()
    }

    /// Acceleration of everything, drag and magnetic field with the forces, m/s².
    pub fn whole_acceleration(&self, lane: usize, motion: &Motion) -> Vec3 {
        motion.acceleration + self.linear[lane].acceleration(&motion.velocity)
    }

    /// What steps are held to.
    pub fn limits(&self) -> Limits {
        Limits { tolerance: self.tolerance, least_travel: self.least_travel }
    }

    /// Keeps the grains for which `keep` is true, in their order.
    pub fn retain(&mut self, keep: &[bool]) {
        retain(&mut self.forces.charge, keep);
        retain(&mut self.forces.mass, keep);
        retain(&mut self.forces.radius, keep);
        retain(&mut self.forces.id, keep);
        retain(&mut self.linear, keep);
        retain(&mut self.thermal, keep);
        retain(&mut self.state, keep);
        retain(&mut self.trial, keep);
    }
}

/// What steps are held to.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    tolerance: f64,
    least_travel: f64,
}

impl Limits {
    /// What a step that ends there may err in position (m) and velocity (m/s): the tolerance relative to the way that the grain has
    /// come so far and to its highest speed.
    pub fn allowed(&self, state: &State, position: &Vec3, velocity: &Vec3) -> [f64; 2] {
        let moved = (position - state.motion.position).norm().max((position - state.origin).norm());
        let length = state.travel.max(moved).max(self.least_travel);
        let speed = state.top_speed.max(velocity.norm());
        [(self.tolerance * length).max(4.0 * f64::EPSILON * position.amax()), self.tolerance * speed]
    }
}

impl State {
    fn new(ensemble: &Ensemble, grain: usize) -> Self {
        let (position, velocity) = (ensemble.positions()[grain], ensemble.velocities()[grain]);
        Self {
            time: 0.0,
            motion: Motion { position, velocity, acceleration: Vec3::zeros() },
            fresh: false,
            origin: position,
            travel: 0.0,
            top_speed: velocity.norm(),
        }
    }
}

/// Keeps the entries for which `keep` is true, in their order.
pub(crate) fn retain<T>(items: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    items.retain(|_| flags.next().copied().unwrap_or(true));
}

/// The forces on the grains of a block.
pub(crate) struct Forces<'a> {
    pub system: &'a System,
    pub charge: Vec<f64>,
    pub mass: Vec<f64>,
    pub radius: Vec<f64>,
    pub id: Vec<u64>,
    /// Shortest period of the forces, or zero, s.
    pub period: f64,
    /// Forces on single grains asked for so far.
    pub evaluations: u64,
    scratch: Scratch,
    gathered: Gathered,
    force: Vec<Vec3>,
}

/// What some of the grains are like.
#[derive(Default)]
struct Gathered {
    charge: Vec<f64>,
    mass: Vec<f64>,
    radius: Vec<f64>,
    id: Vec<u64>,
}

impl Forces<'_> {
    /// Acceleration by the forces alone of all grains at these times, places and velocities, m/s².
    pub fn accelerations(&mut self, time: &[f64], position: &[Vec3], velocity: &[Vec3], out: &mut Vec<Vec3>) {
        let (charge, mass, radius, id) = (&self.charge[..], &self.mass[..], &self.radius[..], &self.id[..]);
        let batch = Batch { position, velocity, time, charge, mass, radius, id };
        out.resize(batch.len(), Vec3::zeros());
        self.evaluations += batch.len() as u64;
        self.system.sum_forces(&batch, &mut self.scratch, out);
        for (a, m) in out.iter_mut().zip(mass) {
            *a /= *m;
        }
    }

    /// The same for some grains, by lane; a lane may appear more than once. With forces that couple grains: all of them.
    pub fn accelerations_of(
        &mut self,
        lanes: &[usize],
        time: &[f64],
        position: &[Vec3],
        velocity: &[Vec3],
        out: &mut Vec<Vec3>,
    ) {
        self.gather(lanes);
        let batch = self.gathered.batch(time, position, velocity);
        out.resize(batch.len(), Vec3::zeros());
        self.evaluations += batch.len() as u64;
        self.system.sum_forces(&batch, &mut self.scratch, out);
        for (a, m) in out.iter_mut().zip(batch.mass) {
            *a /= *m;
        }
    }

    /// Forces (N, without drag and magnetic field) and potential energies (J) of some grains, as before.
    pub fn forces_and_energies(
        &mut self,
        lanes: &[usize],
        time: &[f64],
        position: &[Vec3],
        velocity: &[Vec3],
    ) -> (Vec<Vec3>, Vec<f64>) {
        self.gather(lanes);
        let batch = self.gathered.batch(time, position, velocity);
        self.force.resize(batch.len(), Vec3::zeros());
        let mut energy = vec![0.0; batch.len()];
        self.evaluations += batch.len() as u64;
        self.system.sum_forces(&batch, &mut self.scratch, &mut self.force);
        self.system.sum_energies(&batch, &mut self.scratch, &mut energy);
        (self.force.clone(), energy)
    }

    /// A time a little inside a step, so that a waveform that jumps at an end is taken on the step's side of the jump.
    ///
    /// The margin is a few roundings of the times and of the phase of the waveform; what it changes is of that size too.
    pub fn within(&self, time: f64, start: f64, end: f64) -> f64 {
        let margin = self.margin(start, end);
        if end - start > 2.0 * margin { time.clamp(start + margin, end - margin) } else { 0.5 * (start + end) }
    }

    /// See `within`, s.
    pub fn margin(&self, start: f64, end: f64) -> f64 {
        8.0 * f64::EPSILON * (start.abs() + end.abs() + self.period)
    }

    fn gather(&mut self, lanes: &[usize]) {
        fn pick<T: Copy>(to: &mut Vec<T>, from: &[T], lanes: &[usize]) {
            to.clear();
            to.extend(lanes.iter().map(|&lane| from[lane]));
        }
        pick(&mut self.gathered.charge, &self.charge, lanes);
        pick(&mut self.gathered.mass, &self.mass, lanes);
        pick(&mut self.gathered.radius, &self.radius, lanes);
        pick(&mut self.gathered.id, &self.id, lanes);
    }
}

impl Gathered {
    fn batch<'a>(&'a self, time: &'a [f64], position: &'a [Vec3], velocity: &'a [Vec3]) -> Batch<'a> {
        Batch { position, velocity, time, charge: &self.charge, mass: &self.mass, radius: &self.radius, id: &self.id }
    }
}
