//! Grains in flight: ensembles, forces, integrators, how a flight ends, what is kept of it.
//!
//! * **grain**: a charged sphere, small enough to be a point to the field; many of them are an [`Ensemble`], drawn from a
//!   [`Place`] and a [`Launch`];
//! * **system**: what grains fly through ([`System`]): forces, drag, magnetic field, noise, surfaces, a region;
//! * **flight**: the way of a grain from its start to its [`Outcome`]: it struck an electrode, left the region, or the
//!   time was up;
//! * **observer**: who keeps samples of the flights ([`Observer`], [`Trajectories`]).
//!
//! [`trace()`] flies an ensemble through a system. This crate knows no panels (only the tree of surfaces that grains may
//! strike) and no files; volts come to it inside a [`field::DrivenField`].
//!
//! # A grain in a Paul trap
//!
//! ```
//! use std::sync::Arc;
//!
//! use field::{BasisField, DrivenField, Samples, Waveform, WaveformPart};
//! use meshes::Vec3;
//! use tracer::{Drag, Ensemble, Group, Launch, Options, Outcome, Place, Region, System, Trajectories, trace};
//!
//! // 1. The field at 1 V, here in closed form: φ = (x² + y² - 2 z²) / (2 r0²) with r0 = 1 cm.
//! struct Ideal;
//!
//! impl BasisField for Ideal {
//!     fn channels(&self) -> usize {
//!         1
//!     }
//!
//!     fn sample(&self, points: &[Vec3], samples: &mut Samples) {
//!         samples.reset(points.len(), 1);
//!         for (p, r) in points.iter().enumerate() {
//!             let gradient = Vec3::new(r.x, r.y, -2.0 * r.z) / 1e-4;
//!             samples.potential[p] = 0.5 * gradient.dot(r);
//!             samples.gradient[p] = gradient;
//!         }
//!     }
//! }
//!
//! // 2. Volts: 400 V at 60 Hz. For grains of 1 mC/kg that is q_z = 4 Q V / (m r0² Ω²) = 0.11, well inside the stable region.
//! let drive = WaveformPart::Sine { amplitude: 400.0, frequency: 60.0, phase: 0.0 };
//! let field = DrivenField::new(Arc::new(Ideal), vec![Waveform { constant: 0.0, parts: vec![drive] }]);
//!
//! // 3. What the grains fly through: the field, a little gas, a box they may not leave.
//! let system = System::new()
//!     .with_field(field)
//!     .with_drag(Drag::Rate(5.0))
//!     .with_region(Region { min: Vec3::repeat(-0.01), max: Vec3::repeat(0.01) });
//!
//! // 4. Twenty grains from a ball around the centre, each with random numbers of its own.
//! let group = Group {
//!     count: 20,
//!     charge: 1e-15,
//!     mass: 1e-12,
//!     radius: 0.0,
//!     place: Place::Ball { center: Vec3::zeros(), radius: 2e-3 },
//!     launch: Launch::Rest,
//! };
//! let mut grains = Ensemble::new();
//! grains.add_group(0, &group, 1)?;
//!
//! // 5. Two seconds, sampled every millisecond. The drag brings all grains to the centre, and the error is known.
//! let options = Options { duration: 2.0, every: Some(1e-3), ..Options::default() };
//! let tracks = Trajectories::default();
//! let traced = trace(&system, &grains, &options, &tracks)?;
//! assert!(traced.endings.iter().all(|ending| ending.outcome == Outcome::TimeUp));
//! assert!(traced.ensemble.positions().iter().all(|p| p.norm() < 1e-4));
//! assert!(traced.error.is_some_and(|error| error.position < 1e-9));
//! assert_eq!(tracks.into_samples()[0].len(), 2001);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What runs underneath
//!
//! Grains that do not feel each other are traced in blocks that stay in a core's cache, every grain with steps of its own,
//! blocks shared between threads. Grains that do (Coulomb) share their steps, and the work of each force is shared. In
//! both cases no bit of the result depends on the number of threads; random numbers belong to grain and step
//! ([`stream::Stream`]).
//!
//! Where forces are linear in the position (an ideal quadrupole, a uniform field, gravity: fields that say so through
//! [`field::BasisField::quadratics`]), the default is a symplectic scheme of order 6 with a step from the tolerance, which flies
//! vectors of grains over many steps at once as long as nothing is near.
//!
//! Elsewhere it is Dormand and Prince's of order 8, whose dense output gives samples, and the time and place of a strike, to the
//! accuracy of the steps themselves. [`Method`] lists the others; `Stoermer12` takes a quarter of the forces where these are
//! smooth and dear, and hundreds of grains that feel each other in a smooth field fly by `Stoermer`, the same with steps from the
//! tolerance. Surfaces cost nothing while a grain is far from them, and no step is too long for a wire to be met.
//!
//! The mutual force of some thousand grains is summed pair by pair, that of more by multipoles to an accuracy
//! ([`Coulomb`]). [`stability`] maps where motions in a quadrupole stay bounded, without flying grains at all.
//!
//! # What flights are judged by
//!
//! [`spectrum`] finds the lines of a motion, [`plasma`] tells how strongly a cloud is coupled, and [`crystal`] where equal charges
//! rest in a harmonic well, and how they swing there.

pub mod checkpoint;
pub mod cloud;
pub mod constants;
pub mod crystal;
pub mod drag;
pub mod error;
pub mod estimate;
pub mod event;
pub mod force;
pub mod fraction;
pub mod gas;
pub mod grains;
pub mod observer;
pub mod options;
pub mod outcome;
pub mod plasma;
pub mod secular;
pub mod spectrum;
pub mod stability;
pub mod stream;
pub mod system;
pub mod trace;

mod block;
mod flight;
mod integrator;
mod linear;
mod path;
mod progress;

pub use checkpoint::{Frame, Journal, Standing};
pub use cloud::{CloudError, Group, Launch, Place, grain_id};
pub use drag::{Drag, DragError, DragLaw};
pub use error::TraceError;
pub use estimate::{ErrorEstimate, Tightened};
pub use event::{Crossing, Event, Met, Region};
pub use force::coulomb::{Coulomb, MANY};
pub use force::electric::Electric;
pub use force::image_charge::ImageCharge;
pub use force::linear_form::{LinearChannel, LinearForm};
pub use force::uniform::{ConstantForce, Gravity};
pub use force::{Batch, Force, Nature, Scratch};
pub use fraction::wilson;
pub use gas::{Gas, GasKind};
pub use grains::{Ensemble, Grain, GrainError};
pub use observer::{Nothing, Observer, Sample, Sink, Trajectories};
pub use options::{Method, Options};
pub use outcome::{Ending, Outcome};
pub use system::System;
pub use trace::{DEAR, Traced, natural_step, trace};
