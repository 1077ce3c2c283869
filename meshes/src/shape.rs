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
    /// Slots along `e2`, side by side along `e1`, as long as the plate but for a rim of half a bar: flat bars in a frame.
    Slot,
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
        /// Distance from the axis at which the sheet is cut off, m. At 2 r0 or more the quadrupole in the centre is that of
        /// whole hyperboloids to 1e-3 or better; at 1.1 r0 it is 6e-2 weaker.
        extent: f64,
    },
    /// One end-cap of a quadrupole trap, the sheet 2 z² - r² = 2 z0² on the side the axis points to.
    HyperbolicCap {
        /// Distance of the ring from the centre, m.
        r0: f64,
        /// Distance of the caps from the centre, m.
        z0: f64,
        /// Distance from the axis at which the sheet is cut off, m. At 2 r0 or more the quadrupole in the centre is that of
        /// whole hyperboloids to 1e-3 or better; at 1.1 r0 it is 6e-2 weaker.
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

impl Shape {
    /// Whether the shape can be at all.
    ///
    /// # Errors
    /// The first dimension that is not a positive number, or that contradicts another: which key, why, and what to change.
    pub fn check(&self) -> Result<(), ShapeError> {
        match self {
            Self::Sphere { radius } => positive("radius", *radius),
            Self::Ring { radius, wire_radius } => {
                positive("radius", *radius)?;
                positive("wire_radius", *wire_radius)?;
                smaller("wire_radius", *wire_radius, "radius", *radius)
            }
            Self::Disc { radius, hole_radius, thickness } => {
                positive("radius", *radius)?;
                not_negative("hole_radius", *hole_radius)?;
                not_negative("thickness", *thickness)?;
                smaller("hole_radius", *hole_radius, "radius", *radius)
            }
            Self::Plate { size, thickness } => {
                size.iter().try_for_each(|s| positive("size", *s))?;
                not_negative("thickness", *thickness)
            }
            Self::EndCap { radius, opening, thickness } => {
                positive("radius", *radius)?;
                not_negative("thickness", *thickness)?;
                positive("opening", *opening)?;
                if *opening < 179.5_f64.to_radians() {
                    return Ok(());
                }
                Err(ShapeError::new(
                    "opening",
                    format!("is {} deg, and a cap needs a half angle below 179.5 deg", opening.to_degrees()),
                    "use shape = \"sphere\" for a whole sphere; a hemisphere is 90 deg",
                ))
            }
            Self::GridPlate { outline, pitch, pattern } => check_grid(outline, *pitch, pattern),
            Self::Cylinder { radius, length, .. } => {
                positive("radius", *radius)?;
                positive("length", *length)
            }
            Self::Rod { radius, length } => {
                positive("radius", *radius)?;
                positive("length", *length)?;
                if *length >= 2.0 * radius {
                    return Ok(());
                }
                Err(ShapeError::new(
                    "length",
                    format!("is {length} m, less than the two hemispherical ends of radius {radius} m need"),
                    format!("make it {} m or more: it counts from tip to tip", 2.0 * radius),
                ))
            }
            Self::Wire { points, wire_radius } => check_wire(points, *wire_radius),
            Self::Box { size } => size.iter().try_for_each(|s| positive("size", *s)),
            Self::HyperbolicRing { r0, z0, extent } | Self::HyperbolicCap { r0, z0, extent } => {
                positive("r0", *r0)?;
                positive("z0", *z0)?;
                positive("extent", *extent)?;
                let ring = matches!(self, Self::HyperbolicRing { .. });
                if !ring || *extent > *r0 {
                    return Ok(());
                }
                Err(ShapeError::new(
                    "extent",
                    format!("is {extent} m, but the ring begins at r0 = {r0} m from the axis"),
                    "make it larger than r0; two to three times r0 is usual",
                ))
            }
            Self::Mesh { vertices, triangles } => {
                let finite = vertices.iter().flatten().all(|x| x.is_finite());
                let known = triangles.iter().flatten().all(|v| (*v as usize) < vertices.len());
                if finite && known && !triangles.is_empty() {
                    return Ok(());
                }
                Err(ShapeError::new("file", "holds no usable triangles", "export the surface as triangles"))
            }
        }
    }
}

fn positive(key: &'static str, value: f64) -> Result<(), ShapeError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ShapeError::new(key, format!("is {value}, and has to be greater than zero"), "give a positive number"))
}

fn not_negative(key: &'static str, value: f64) -> Result<(), ShapeError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ShapeError::new(key, format!("is {value}, and cannot be negative"), "give zero or a positive number"))
}

fn smaller(key: &'static str, value: f64, than_key: &str, than: f64) -> Result<(), ShapeError> {
    if value < than {
        return Ok(());
    }
    let problem = format!("is {value} m, not less than {than_key} = {than} m");
    Err(ShapeError::new(key, problem, format!("make {key} smaller or {than_key} larger")))
}

fn check_grid(outline: &Outline, pitch: f64, pattern: &GridPattern) -> Result<(), ShapeError> {
    match outline {
        Outline::Rectangle(size) => size.iter().try_for_each(|s| positive("size", *s))?,
        Outline::Disc(radius) => positive("radius", *radius)?,
    }
    positive("pitch", pitch)?;
    let none = |what: &str| {
        let help = "make the pitch smaller or the plate larger";
        ShapeError::new("pitch", format!("is {pitch} m: not one {what} fits on the plate"), help)
    };
    match pattern {
        GridPattern::Perforated { hole, open, thickness } => {
            positive("open", *open)?;
            not_negative("thickness", *thickness)?;
            smaller("open", *open, "pitch", pitch)?;
            if crate::lattice::hole_lattice(*outline, pitch, *hole).is_empty() { Err(none("hole")) } else { Ok(()) }
        }
        GridPattern::Wires { weave, wire_radius } => {
            positive("wire_radius", *wire_radius)?;
            // Woven wires need room to pass between their neighbours.
            let least = if *weave == Weave::Woven { 4.0 } else { 2.0 } * wire_radius;
            if pitch <= least {
                let problem = format!("is {pitch} m, too small for wires of radius {wire_radius} m");
                return Err(ShapeError::new("pitch", problem, format!("make it larger than {least} m")));
            }
            let layers = if *weave == Weave::Parallel { &[true][..] } else { &[true, false][..] };
            let missing =
                |second: &bool| crate::lattice::wires_along(*outline, pitch, *wire_radius, *second).is_empty();
            if layers.iter().any(missing) { Err(none("wire")) } else { Ok(()) }
        }
    }
}

fn check_wire(points: &[Vec3], wire_radius: f64) -> Result<(), ShapeError> {
    positive("wire_radius", wire_radius)?;
    let bad = |problem: String, help: &str| Err(ShapeError::new("points", problem, help));
    if points.len() < 2 {
        return bad(format!("has {} point(s)", points.len()), "a wire needs two points or more");
    }
    if !points.iter().flatten().all(|x| x.is_finite()) {
        return bad("has a coordinate that is not a number".into(), "give finite coordinates");
    }
    let closed = points.len() > 2 && (points[0] - points[points.len() - 1]).norm() < 1e-9 * wire_radius;
    let pieces = points.len() - 1;
    let piece = |i: usize| points[(i % pieces) + 1] - points[i % pieces];
    for i in 0..pieces {
        if piece(i).norm() < 2.0 * wire_radius {
            let (from, to) = (i + 1, i + 2);
            let length = piece(i).norm();
            return bad(
                format!("{from} and {to} are {length} m apart, less than the wire is thick"),
                "leave more room between points, or make the wire thinner",
            );
        }
        if i + 1 < pieces || closed {
            let turn = piece(i).angle(&piece(i + 1));
            // A mitre of angle θ reaches r tan(θ/2) along each side.
            let reach = wire_radius * (0.5 * turn).tan();
            if turn > 2.4 || reach > 0.5 * piece(i).norm().min(piece(i + 1).norm()) {
                let degrees = turn.to_degrees();
                return bad(
                    format!("turn by {degrees:.0} deg at point {}, too sharp for this wire", i + 2),
                    "round the bend off with more points, or make the wire thinner",
                );
            }
        }
    }
    Ok(())
}
