//! How flights end.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

/// How a flight ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// It lasted for the whole time.
    TimeUp,
    /// The grain struck an electrode.
    Struck {
        /// Which.
        electrode: usize,
        /// Where, m.
        point: Vec3,
        /// Outward unit normal of the panel.
        normal: Vec3,
        /// Kinetic energy, J.
        energy: f64,
        /// m/s.
        speed: f64,
    },
    /// The grain left the region.
    LeftRegion {
        /// Where, on a face of the box, m.
        point: Vec3,
    },
    /// The forces or the motion were no longer finite.
    Unstable {
        /// The last good position, m.
        point: Vec3,
    },
    /// The run was told to stop.
    Stopped,
}

/// An outcome and its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ending {
    /// How.
    pub outcome: Outcome,
    /// When, s.
    pub time: f64,
}
