//! `[[grains]]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::value::{Count, DirectionKeys, Vector};
use crate::quantity::kinds::{Charge, Density, Length, Mass, Temperature, Velocity};
use crate::quantity::{NonNegative, Positive, Si};

/// A group of equal grains.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GrainKeys {
    /// Its name; left out: grains1, grains2, ...
    #[schemars(regex(pattern = crate::key_path::NAME_PATTERN))]
    pub name: Option<String>,
    /// How many; may be left out where `place` lists them.
    pub count: Option<Count>,
    /// Mass of one.
    pub mass: Option<Positive<Mass>>,
    /// Density of the material, instead of `mass`; needs `radius`.
    pub density: Option<Positive<Density>>,
    /// Charge of one; "10 e" are ten elementary charges.
    pub charge: Si<Charge>,
    /// Radius of one; left out: 0, a point.
    pub radius: Option<NonNegative<Length>>,
    /// Where they start.
    pub place: PlaceKeys,
    /// How they start to move; left out: at rest.
    pub speed: Option<SpeedKeys>,
}

/// Where grains start.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "kind")]
pub(crate) enum PlaceKeys {
    /// At these points.
    Points {
        /// A list of [x, y, z].
        #[schemars(length(min = 1))]
        points: Vec<Vector<Length>>,
    },
    /// Uniform in a ball.
    Ball {
        /// The origin if left out.
        center: Option<Vector<Length>>,
        /// Radius of the ball.
        radius: Positive<Length>,
    },
    /// Uniform on a sphere.
    Shell {
        /// The origin if left out.
        center: Option<Vector<Length>>,
        /// Radius of the sphere.
        radius: Positive<Length>,
    },
    /// Uniform in a box.
    Box {
        /// Lower corner.
        min: Vector<Length>,
        /// Upper corner.
        max: Vector<Length>,
    },
    /// Uniform on a flat disc.
    Disc {
        /// The origin if left out.
        center: Option<Vector<Length>>,
        /// Normal of the disc; left out: "z".
        axis: Option<DirectionKeys>,
        /// Radius of the disc.
        radius: Positive<Length>,
    },
    /// Uniform in a cylinder that starts at the centre and reaches back along the axis.
    Beam {
        /// Middle of the front face; the origin if left out.
        center: Option<Vector<Length>>,
        /// Direction of flight; left out: "z".
        axis: Option<DirectionKeys>,
        /// Radius of the beam.
        radius: Positive<Length>,
        /// Length of the beam; left out: 0, a disc.
        length: Option<NonNegative<Length>>,
    },
    /// From a CSV file with columns x, y, z or x, y, z, vx, vy, vz in SI.
    File {
        /// The file, relative to the case file.
        file: String,
    },
}

/// How grains start to move.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "kind")]
pub(crate) enum SpeedKeys {
    /// At rest.
    Rest {},
    /// Maxwell-Boltzmann.
    Thermal {
        /// Temperature.
        temperature: NonNegative<Temperature>,
    },
    /// All with the same velocity.
    Uniform {
        /// [vx, vy, vz].
        velocity: Vector<Velocity>,
    },
    /// The same speed in random directions.
    Isotropic {
        /// Speed.
        speed: NonNegative<Velocity>,
    },
}
