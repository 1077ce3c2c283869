//! The shapes an electrode can have, in metres and radians.

use crate::Vec3;

/// Where a shape stands and which way it faces.
///
/// The local frame is (`e1`, `e2`, `e3`), right-handed: `e3` is `axis`, `e2` is `up` made orthogonal to it, `e1 = e2 × e3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Centre of symmetry, m.
    pub center: Vec3,
    /// Normal of flat shapes, axis of round ones, from the centre to the pole for caps. Need not be of unit length.
    pub axis: Vec3,
    /// In-plane direction of flat rectangles and boxes. `None`: z, or y where the axis is (nearly) along z.
    pub up: Option<Vec3>,
}

impl Default for Placement {
    fn default() -> Self {
        Self { center: Vec3::zeros(), axis: Vec3::z(), up: None }
    }
}

impl Placement {
    /// The local frame `[e1, e2, e3]`, orthonormal.
    ///
    /// # Errors
    /// The axis has no direction, or `up` is parallel to it.
    pub fn frame(&self) -> Result<[Vec3; 3], ShapeError> {
        let e3 = self
            .axis
            .try_normalize(f64::MIN_POSITIVE.sqrt())
            .filter(|v| v.iter().all(|x| x.is_finite()))
            .ok_or_else(|| ShapeError::new("axis", "has no direction", "give it a length other than zero"))?;
        let up = self.up.unwrap_or(if e3.z.abs() > 0.9 { Vec3::y() } else { Vec3::z() });
        let e2 = (up - e3 * up.dot(&e3))
            .try_normalize(1e-9 * up.norm().max(f64::MIN_POSITIVE))
            .ok_or_else(|| ShapeError::new("up", "is parallel to the axis", "give a direction across the axis"))?;
        Ok([e2.cross(&e3), e2, e3])
    }
}

/// The form of a hole in a perforated plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hole {
    /// Squares on a square lattice.
    Square,
    /// Circles on a square lattice.
    Round,
    /// Regular hexagons on a triangular lattice (a honeycomb); the pitch is the distance of neighbouring centres.
    Hexagonal,
}

/// How the wires of a wire grid lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weave {
    /// One layer of wires along `e2`.
    Parallel,
    /// A layer along `e1` on top of a layer along `e2`, touching.
    Crossed,
    /// Each wire passes over and under its neighbours in turn.
    Woven,
}

/// Outline of a flat electrode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// A rectangle with sides `a` along `e1` and `b` along `e2`, m.
    Rectangle([f64; 2]),
    /// A disc of this radius, m.
    Disc(f64),
}

/// What a grid plate is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridPattern {
    /// A plate with holes.
    Perforated {
        /// Form of the holes.
        hole: Hole,
        /// Width across flats, or diameter, of a hole, m.
        open: f64,
        /// Thickness of the plate, m; zero is a sheet.
        thickness: f64,
    },
    /// Round wires.
    Wires {
        /// How they lie.
        weave: Weave,
        /// Radius of a wire, m.
        wire_radius: f64,
    },
}

/// An electrode's shape in its local frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A sphere.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// A torus of round wire about the axis.
    Ring {
        /// Radius of the wire's centre line, m.
        radius: f64,
        /// Radius of the wire, m.
        wire_radius: f64,
    },
    /// A flat disc, with or without a concentric hole.
    Disc {
        /// Outer radius, m.
        radius: f64,
        /// Radius of the hole, m; zero is none.
        hole_radius: f64,
        /// Thickness, m, half to either side of the centre; zero is a sheet.
        thickness: f64,
    },
    /// A flat rectangle.
    Plate {
        /// Sides along `e1` and `e2`, m.
        size: [f64; 2],
        /// Thickness, m, half to either side of the centre; zero is a sheet.
        thickness: f64,
    },
    /// Part of a sphere about its pole: a bowl.
    EndCap {
        /// Radius of the sphere, m; of its inner side where there is a thickness.
        radius: f64,
        /// Half angle seen from the centre, rad; a right angle is a hemisphere.
        opening: f64,
        /// Thickness, m, outwards from `radius`; zero is a sheet.
        thickness: f64,
    },
    /// A plate that lets light through.
    GridPlate {
        /// Outline of the plate.
        outline: Outline,
        /// Distance of neighbouring holes or wires, centre to centre, m.
        pitch: f64,
        /// Holes or wires.
        pattern: GridPattern,
    },
    /// A round tube.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Length along the axis, m.
        length: f64,
        /// Closed by flat caps; without them it is an open sheet.
        caps: bool,
    },
    /// A round rod with hemispherical ends.
    Rod {
        /// Radius, m.
        radius: f64,
        /// Length from tip to tip along the axis, m.
        length: f64,
    },
    /// A bent round wire with hemispherical ends (none where the last point is the first).
    Wire {
        /// Its centre line in the local frame, m.
        points: Vec<Vec3>,
        /// Radius of the wire, m.
        wire_radius: f64,
    },
    /// A rectangular block.
    Box {
        /// Sides along `e1`, `e2`, `e3`, m.
        size: [f64; 3],
    },
    /// The ring electrode of a quadrupole trap, the sheet r² - 2 z² = r0².
    HyperbolicRing {
        /// Distance of the ring from the centre, m.
        r0: f64,
        /// Distance of the caps from the centre, m.
        z0: f64,
        /// Distance from the axis at which the sheet is cut off, m.
        extent: f64,
    },
    /// One end-cap of a quadrupole trap, the sheet 2 z² - r² = 2 z0² on the side the axis points to.
    HyperbolicCap {
        /// Distance of the ring from the centre, m.
        r0: f64,
        /// Distance of the caps from the centre, m.
        z0: f64,
        /// Distance from the axis at which the sheet is cut off, m.
        extent: f64,
    },
    /// Triangles as given, in the local frame.
    Mesh {
        /// Corner points, m.
        vertices: Vec<Vec3>,
        /// Corners of each triangle.
        triangles: Vec<[u32; 3]>,
    },
}

/// A shape that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}` {problem}")]
pub struct ShapeError {
    /// The case-file key at fault.
    pub key: &'static str,
    /// What is wrong with it, with the numbers that help.
    pub problem: String,
    /// What to change.
    pub help: String,
}

impl ShapeError {
    /// An error about one key.
    pub fn new(key: &'static str, problem: impl Into<String>, help: impl Into<String>) -> Self {
        Self { key, problem: problem.into(), help: help.into() }
    }
}
