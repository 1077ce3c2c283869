//! `[[electrode]]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::value::{Count, DirectionKeys, Tuple, Vector};
use super::waveform::RfKeys;
use crate::quantity::kinds::{Angle, Charge, Length, Voltage};
use crate::quantity::{NonNegative, Positive, Si};

/// An electrode: keys that all have, and those of its shape.
#[derive(Deserialize)]
pub(crate) struct ElectrodeKeys(pub CommonKeys, pub ShapeKeys);

/// Keys of every electrode.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CommonKeys {
    /// Its name, in results and in key paths: letters, digits, `_` and `-`.
    #[schemars(regex(pattern = crate::key_path::NAME_PATTERN))]
    pub name: String,
    /// Centre of symmetry; the origin if left out.
    pub center: Option<Vector<Length>>,
    /// Normal of flat shapes, axis of round ones, from the centre to the pole for caps: "x", "-z" or [a, b, c]. Left out: "z".
    pub axis: Option<DirectionKeys>,
    /// In-plane direction of flat rectangles and boxes. Left out: "z", or "y" where the axis is along z.
    pub up: Option<DirectionKeys>,
    /// Constant voltage. Left out: 0.
    pub dc: Option<Si<Voltage>>,
    /// What is added to `dc`: a waveform, the name of a drive, or a list of these.
    pub rf: Option<RfKeys>,
    /// Fixed total charge of a floating conductor, instead of `dc` and `rf`.
    pub charge: Option<Si<Charge>>,
    /// Whether the inside counts as free space, where a closed electrode encloses the trap. Left out: found out.
    pub hollow: Option<bool>,
    /// Wanted number of panels. Left out: chosen from the accuracy of the field.
    pub panels: Option<Count>,
}

/// Keys of the shapes.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(tag = "shape")]
pub(crate) enum ShapeKeys {
    /// A sphere.
    Sphere {
        /// Radius.
        radius: Positive<Length>,
    },
    /// A torus of round wire about the axis.
    Ring {
        /// Radius of the wire's centre line.
        radius: Positive<Length>,
        /// Radius of the wire.
        wire_radius: Positive<Length>,
    },
    /// A flat disc, with or without a concentric hole.
    Disc {
        /// Outer radius.
        radius: Positive<Length>,
        /// Radius of the hole; left out: none.
        hole_radius: Option<NonNegative<Length>>,
        /// Thickness, half to either side of the centre; left out: a sheet.
        thickness: Option<NonNegative<Length>>,
    },
    /// A flat rectangle.
    Plate {
        /// Sides [a, b]; b is along `up`.
        size: Tuple<Positive<Length>, 2>,
        /// Thickness, half to either side of the centre; left out: a sheet.
        thickness: Option<NonNegative<Length>>,
    },
    /// Part of a sphere about its pole: a bowl.
    EndCap {
        /// Radius of the sphere; of its inner side where there is a thickness.
        radius: Positive<Length>,
        /// Half angle seen from the centre; "90 deg" is a hemisphere.
        opening: Positive<Angle>,
        /// Thickness, outwards; left out: a sheet.
        thickness: Option<NonNegative<Length>>,
    },
    /// A plate that lets light through: perforated (`hole`, `open`), or of wires (`wires`, `wire_radius`).
    GridPlate {
        /// Sides [a, b] of a rectangular plate; b is along `up`.
        size: Option<Tuple<Positive<Length>, 2>>,
        /// Radius of a round plate.
        radius: Option<Positive<Length>>,
        /// Distance of neighbouring holes or wires, centre to centre.
        pitch: Positive<Length>,
        /// Form of the holes.
        hole: Option<HoleName>,
        /// Width across flats, or diameter, of a hole; width of a slot.
        open: Option<Positive<Length>>,
        /// Thickness of a perforated plate; left out: a sheet.
        thickness: Option<NonNegative<Length>>,
        /// How the wires lie.
        wires: Option<WeaveName>,
        /// Radius of a wire.
        wire_radius: Option<Positive<Length>>,
    },
    /// A round tube.
    Cylinder {
        /// Radius.
        radius: Positive<Length>,
        /// Length along the axis.
        length: Positive<Length>,
        /// Closed by flat caps; left out: open.
        caps: Option<bool>,
    },
    /// A round rod with hemispherical ends.
    Rod {
        /// Radius.
        radius: Positive<Length>,
        /// Length from tip to tip.
        length: Positive<Length>,
    },
    /// A bent round wire with hemispherical ends, or a closed one where the last point is the first.
    Wire {
        /// Its centre line, before it is turned to `axis` and moved to `center`.
        #[schemars(length(min = 2))]
        points: Vec<Vector<Length>>,
        /// Radius of the wire.
        wire_radius: Positive<Length>,
    },
    /// A rectangular block.
    Box {
        /// Sides [a, b, c]; b is along `up`, c along the axis.
        size: Tuple<Positive<Length>, 3>,
    },
    /// The ring electrode of a quadrupole trap.
    HyperbolicRing {
        /// Distance of the ring from the centre.
        r0: Positive<Length>,
        /// Distance of the caps from the centre; left out: r0 / sqrt 2.
        z0: Option<Positive<Length>>,
        /// Distance from the axis at which it is cut off; left out: 3 r0.
        extent: Option<Positive<Length>>,
    },
    /// One end-cap of a quadrupole trap, on the side the axis points to.
    HyperbolicCap {
        /// Distance of the ring from the centre.
        r0: Positive<Length>,
        /// Distance of the caps from the centre; left out: r0 / sqrt 2.
        z0: Option<Positive<Length>>,
        /// Distance from the axis at which it is cut off; left out: 3 r0.
        extent: Option<Positive<Length>>,
    },
    /// A surface from a file.
    Mesh {
        /// The file, relative to the case file: .msh, .stl, .vtu, .vtk, .obj or .ply.
        file: String,
        /// The part of the file, by its name there; left out: all of it.
        group: Option<String>,
        /// Unit of the coordinates in the file; left out: "m".
        unit: Option<String>,
        /// Demand that the surface is watertight.
        closed: Option<bool>,
    },
}

/// Form of the holes of a grid plate.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum HoleName {
    /// Squares on a square lattice.
    Square,
    /// Circles on a square lattice.
    Round,
    /// Hexagons on a triangular lattice.
    Hexagonal,
    /// Slots along `up`: flat bars in a frame.
    Slot,
}

/// How the wires of a grid plate lie.
#[derive(Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum WeaveName {
    /// A layer on top of another.
    Crossed,
    /// One layer.
    Parallel,
    /// Over and under in turn.
    Woven,
}
