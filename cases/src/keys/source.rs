//! `[[source]]`.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error};

use super::value::{DirectionKeys, Vector, Whole};
use super::waveform::RfKeys;
use crate::quantity::Positive;
use crate::quantity::kinds::Length;

/// A source: keys that all have, and those of its kind.
#[derive(Deserialize)]
pub(crate) struct SourceKeys(pub CommonKeys, pub SourceKind);

/// Keys of every source.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CommonKeys {
    /// Its name; left out: source1, source2, ...
    #[schemars(regex(pattern = crate::key_path::NAME_PATTERN))]
    pub name: Option<String>,
    /// Its centre; the origin if left out.
    pub center: Option<Vector<Length>>,
    /// Constant part, of a quadrupole in volts, of a uniform field in volts per metre.
    pub dc: Option<crate::quantity::Amplitude>,
    /// Time-dependent part, in the same unit as `dc` (or `charge`, whichever the kind takes).
    pub rf: Option<RfKeys>,
    /// Constant charge, of a point or a thin ring.
    pub charge: Option<crate::quantity::Amplitude>,
}

/// Keys of the kinds of source.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "kind")]
pub(crate) enum SourceKind {
    /// An ideal quadrupole; the voltage is the whole difference between its two families of electrodes.
    Quadrupole {
        /// Distance of the ring (3D) or the rods (2D) from the centre.
        r0: Positive<Length>,
        /// Distance of the caps from the centre (3D); left out: r0 / sqrt 2.
        z0: Option<Positive<Length>>,
        /// 3: ring and caps about the axis. 2: four rods along the axis. Left out: 3.
        dimensions: Option<Dimensions>,
        /// Axis of the ring, or direction of the rods; left out: "z".
        axis: Option<DirectionKeys>,
        /// Direction of the negative pair of rods (2D).
        up: Option<DirectionKeys>,
    },
    /// A uniform field. Its potential is zero at the centre.
    Uniform {
        /// Where the field points.
        direction: DirectionKeys,
    },
    /// A point charge.
    Point {},
    /// A thin charged ring.
    ThinRing {
        /// Its radius.
        radius: Positive<Length>,
        /// Its axis; left out: "z".
        axis: Option<DirectionKeys>,
    },
}

/// 2 or 3.
#[derive(Clone, Copy)]
pub(crate) struct Dimensions(pub u8);

impl<'de> Deserialize<'de> for Dimensions {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Whole::<0>::deserialize(deserializer)?.0 {
            2 => Ok(Self(2)),
            3 => Ok(Self(3)),
            _ => Err(D::Error::custom("{value} is not possible: expected 2 (four rods) or 3 (a ring and two caps)")),
        }
    }
}

impl JsonSchema for Dimensions {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "Dimensions".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "enum": [2, 3] })
    }
}
