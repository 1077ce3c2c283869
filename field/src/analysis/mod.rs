//! What a field is like as a trap: where it vanishes, how it curves there, how deep its well is.
//!
//! * **expansion**: all unit potentials about a point as solid harmonics, from their values on a sphere ([`Expansion`]): every
//!   derivative in the ball, as exact as the field itself;
//! * **multipoles**: the same about the centre of a trap, in the units of designers ([`Multipoles`]);
//! * **effective potential**: a combination of unit potentials, a uniform slope and squares of fields ([`Effective`]). With the
//!   factors that charge and mass give, which this crate does not know, it is pseudopotential + DC + gravity;
//! * **critical point**: where the gradient of an effective potential vanishes ([`CriticalPoint`]): a null of a static field, a
//!   minimum or a saddle of a well;
//! * **well**: what can be reached from a minimum below a height ([`Well`]), and where it opens first.
//!
//! All of it asks the field through [`BasisField`] in batches of points, and [`Space`] for the distance of the nearest
//! charge.

pub mod critical;
pub mod effective;
pub mod expansion;
pub mod multipoles;
pub mod tones;
pub mod voltages;
pub mod well;

pub use critical::{CriticalPoint, Kind, Lattice, Search, critical_points, critical_points_on, values_on};
pub use effective::{Effective, Local, Square};
pub use expansion::{Expansion, Jet};
pub use multipoles::Multipoles;
pub use tones::{Tone, Tones};
pub use voltages::{Voltages, voltages};
pub use well::{Opening, Well, well};

use meshes::Vec3;

use crate::{BasisField, PanelSum};

/// A field and the space that it is free of charges in.
#[derive(Clone, Copy)]
pub struct Space<'a> {
    /// The unit potentials.
    pub field: &'a dyn BasisField,
    /// Distance of the nearest charge from a point, m; zero in conductors, infinite where there is none.
    pub clearance: &'a (dyn Fn(&Vec3) -> f64 + Sync),
    /// Estimated relative error of the unit fields, against the strongest near the point asked for.
    pub error: f64,
    /// A length beyond which nothing is asked for, m: the size of the trap.
    pub size: f64,
}

impl Space<'_> {
    /// The clearance, and no more than the size.
    pub fn room(&self, point: &Vec3) -> f64 {
        (self.clearance)(point).min(self.size)
    }
}

/// Distance (m) of the nearest charge from a point: surfaces of electrodes, the grounded plane, point charges and thin rings.
/// Zero inside of conductors and below the plane.
pub fn clearance(exact: &PanelSum, point: &Vec3) -> f64 {
    if exact.inside(point).is_some() || exact.below_ground(point) {
        return 0.0;
    }
    let surface = exact.tree().nearest(point, f64::INFINITY).map_or(f64::INFINITY, |nearest| nearest.distance);
    surface.min(exact.distance_of_sources(point))
}
