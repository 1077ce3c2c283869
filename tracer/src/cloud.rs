//! Where grains start and how fast.

use meshes::Vec3;

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
