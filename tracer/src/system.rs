//! Everything that acts on grains and ends their flights.

use std::ops::AddAssign;
use std::sync::Arc;

use field::DrivenField;
use meshes::{SurfaceTree, Vec3};
use rayon::prelude::*;

use crate::constants::BOLTZMANN;
use crate::force::linear_form::LinearForm;
use crate::force::{Batch, Force, Nature, Scratch};
use crate::linear::Linear;
use crate::{ConstantForce, Coulomb, Drag, DragError, Electric, Event, Gravity, Region};

/// What grains fly through: forces, drag, magnetic field, noise, surfaces and a region.
///
/// Drag and magnetic field stand apart from the other forces, because integrators that split know their exact flow.
#[derive(Clone, Default)]
pub struct System {
    /// Added up in this order, those that couple grains after all others.
    pub forces: Vec<Arc<dyn Force>>,
    /// Drag in proportion to the speed.
    pub drag: Option<Drag>,
    /// B, the same everywhere and always, T.
    pub magnetic_field: Vec3,
    /// Temperature of the gas whose molecules kick the grains, K. Needs drag: the two are one thing (Einstein 1905).
    pub noise: Option<f64>,
    /// What grains may strike.
    pub surface: Option<Arc<SurfaceTree>>,
    /// What grains may not leave.
    pub region: Option<Region>,
    /// Other things that end a flight.
    pub events: Vec<Arc<dyn Event>>,
}

impl System {
    /// Nothing: grains fly straight.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a force.
    pub fn with_force(mut self, force: impl Force + 'static) -> Self {
        self.forces.push(Arc::new(force));
        self
    }

    /// Adds the field of driven electrodes.
    pub fn with_field(self, field: DrivenField) -> Self {
        self.with_force(Electric { field })
    }

    /// Adds gravity, m/s².
    pub fn with_gravity(self, acceleration: Vec3) -> Self {
        self.with_force(Gravity { acceleration })
    }

    /// Adds the same force on every grain, N.
    pub fn with_constant_force(self, force: Vec3) -> Self {
        self.with_force(ConstantForce { force })
    }

    /// Adds the mutual force of the grains, every pair of them.
    pub fn with_coulomb(self) -> Self {
        self.with_force(Coulomb::default())
    }

    /// Adds the mutual force of the grains, for many of them to this accuracy ([`Coulomb::accuracy`]).
    pub fn with_coulomb_to(self, accuracy: f64) -> Self {
        self.with_force(Coulomb { accuracy: Some(accuracy) })
    }

    /// Sets the drag.
    pub fn with_drag(mut self, drag: Drag) -> Self {
        self.drag = Some(drag);
        self
    }

    /// Sets the magnetic field, T.
    pub fn with_magnetic_field(mut self, field: Vec3) -> Self {
        self.magnetic_field = field;
        self
    }

    /// Lets the molecules of a gas at this temperature (K) kick the grains.
    pub fn with_noise(mut self, temperature: f64) -> Self {
        self.noise = Some(temperature);
        self
    }

    /// Sets the surface that grains may strike.
    pub fn with_surface(mut self, surface: Arc<SurfaceTree>) -> Self {
        self.surface = Some(surface);
        self
    }

    /// Sets the region that grains may not leave.
    pub fn with_region(mut self, region: Region) -> Self {
        self.region = Some(region);
        self
    }

    /// Adds something else that ends flights.
    pub fn with_event(mut self, event: impl Event + 'static) -> Self {
        self.events.push(Arc::new(event));
        self
    }

    /// What the forces are like, taken together.
    pub fn nature(&self) -> Nature {
        self.forces.iter().map(|f| f.nature()).fold(Nature::default(), |a, b| Nature {
            couples_grains: a.couples_grains || b.couples_grains,
            needs_velocity: a.needs_velocity || b.needs_velocity,
            rough: a.rough || b.rough,
            shortest_period: match (a.shortest_period, b.shortest_period) {
                (Some(x), Some(y)) => Some(x.min(y)),
                (x, y) => x.or(y),
            },
        })
    }

    /// The first time after `t` (s) at which some force is not smooth, or infinity.
    pub fn next_corner(&self, t: f64) -> f64 {
        self.forces.iter().map(|f| f.next_corner(t)).fold(f64::INFINITY, f64::min)
    }

    /// The sum of the forces as a linear function of position along each axis by itself, if it is one, and no magnetic field
    /// mixes the axes.
    pub(crate) fn linear_form(&self) -> Option<LinearForm> {
        let forms: Option<Vec<LinearForm>> = self.forces.iter().map(|f| f.linear_form()).collect();
        let sum = forms?.into_iter().fold(LinearForm::default(), LinearForm::plus);
        (sum.is_diagonal() && self.magnetic_field == Vec3::zeros()).then_some(sum)
    }

    /// Everything that ends flights, in a fixed order.
    pub(crate) fn all_events(&self) -> Vec<&dyn Event> {
        let surface = self.surface.as_deref().map(|s| s as &dyn Event);
        let region = self.region.as_ref().map(|r| r as &dyn Event);
        surface.into_iter().chain(region).chain(self.events.iter().map(Arc::as_ref)).collect()
    }

    /// Drag and magnetic field as one grain feels them.
    pub(crate) fn linear(&self, charge: f64, mass: f64, radius: f64) -> Result<Linear, DragError> {
        let coefficient = self.drag.map_or(Ok(0.0), |drag| drag.coefficient(radius, mass))?;
        Ok(Linear { rate: coefficient / mass, omega: self.magnetic_field * (-charge / mass) })
    }

    /// kB T / m of the noise, m²/s².
    pub(crate) fn thermal(&self, mass: f64) -> f64 {
        self.noise.map_or(0.0, |temperature| BOLTZMANN * temperature / mass)
    }

    /// Sum of the forces (N), without drag and magnetic field, into `force`.
    ///
    /// A large batch is shared between threads in parts; that changes no bit.
    pub(crate) fn sum_forces(&self, batch: &Batch, scratch: &mut Scratch, force: &mut [Vec3]) {
        self.each(batch, scratch, force, Vec3::zeros(), |f, b, s, out| f.add(b, s, out));
    }

    /// Sum of the potential energies (J), into `energy`.
    pub(crate) fn sum_energies(&self, batch: &Batch, scratch: &mut Scratch, energy: &mut [f64]) {
        self.each(batch, scratch, energy, 0.0, |f, b, s, out| f.add_energy(b, s, out));
    }

    fn each<T: Send + Copy + AddAssign>(
        &self,
        batch: &Batch,
        scratch: &mut Scratch,
        out: &mut [T],
        zero: T,
        add: impl Fn(&dyn Force, &Batch, &mut Scratch, &mut [T]) + Sync,
    ) {
        /// Grains of one part: what a block of independent grains has at most, and enough to be worth a task.
        const PART: usize = 64;
        let all = |couples: bool| {
            let forces = self.forces.iter().map(Arc::as_ref);
            forces.filter(move |force| force.nature().couples_grains == couples)
        };
        out.fill(zero);
        if batch.len() <= 2 * PART {
            all(false).chain(all(true)).for_each(|force| add(force, batch, scratch, out));
            return;
        }
        let single = |out: &mut [T]| {
            out.par_chunks_mut(PART).enumerate().for_each_init(Scratch::default, |scratch, (k, out)| {
                let part = batch.part(k * PART..k * PART + out.len());
                all(false).for_each(|force| add(force, &part, scratch, out));
            });
        };
        if all(true).next().is_none() {
            single(out);
            return;
        }
        // Side by side: threads that are done with one kind help with the other.
        let mut coupled = vec![zero; out.len()];
        let both = &mut coupled[..];
        rayon::join(|| all(true).for_each(|force| add(force, batch, scratch, both)), || single(out));
        out.iter_mut().zip(coupled).for_each(|(out, own)| *out += own);
    }
}
