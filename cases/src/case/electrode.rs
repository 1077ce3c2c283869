//! Electrodes and sources.

use std::path::PathBuf;

use field::Waveform;
use meshes::{Placement, Shape, Vec3};
use serde::Serialize;

use super::foreign;

/// A conductor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Electrode {
    /// Letters, digits, `_` and `-`; unique among electrodes and sources.
    pub name: String,
    /// Its form.
    pub shape: ElectrodeShape,
    /// Where it stands; its frame is known to exist.
    #[serde(serialize_with = "foreign::placement")]
    pub placement: Placement,
    /// What holds its potential or its charge.
    pub drive: Drive,
    /// Whether its inside counts as free space; `None`: to be found out.
    pub hollow: Option<bool>,
    /// Wanted number of panels; `None`: to be chosen.
    pub panels: Option<usize>,
}

/// The form of an electrode.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ElectrodeShape {
    /// One of the built-in shapes (never [`Shape::Mesh`]).
    Shape(#[serde(serialize_with = "foreign::shape")] Shape),
    /// Triangles from a file.
    Imported(ImportedMesh),
}

/// Triangles in a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImportedMesh {
    /// The file; it existed when the case was read.
    pub path: PathBuf,
    /// By its extension.
    pub format: MeshFormat,
    /// The part of the file that is meant; `None`: all of it.
    pub group: Option<String>,
    /// Metres per unit of the file.
    pub scale: f64,
    /// The surface must be watertight.
    pub closed: bool,
    /// FNV-1a hash of the file's bytes, in hexadecimal: tells whether a cached solution still belongs to it.
    pub digest: String,
}

/// Mesh files that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MeshFormat {
    /// `.msh`
    Gmsh,
    /// `.stl`
    Stl,
    /// `.vtu`
    Vtu,
    /// `.vtk`
    Vtk,
    /// `.obj`
    Obj,
    /// `.ply`
    Ply,
}

/// What holds an electrode.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Drive {
    /// A generator holds its voltage, V.
    Voltage(#[serde(serialize_with = "foreign::waveform")] Waveform),
    /// It floats with this total charge, C.
    Charge(f64),
}

/// A field in closed form.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Source {
    /// Letters, digits, `_` and `-`; unique among electrodes and sources.
    pub name: String,
    /// What it is.
    pub kind: SourceKind,
    /// Where it stands; its frame is known to exist. The axis of a uniform field is its direction.
    #[serde(serialize_with = "foreign::placement")]
    pub placement: Placement,
    /// Its strength: V for a quadrupole, V/m for a uniform field, C for a point and a thin ring.
    #[serde(serialize_with = "foreign::waveform")]
    pub waveform: Waveform,
}

/// The kinds of closed-form field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// An ideal quadrupole. Its strength φ0 is the whole voltage between its two families of electrodes.
    Quadrupole {
        /// Distance of ring or rods from the centre, m.
        r0: f64,
        /// Distance of the caps from the centre, m; `None` for r0 / √2, and in two dimensions.
        z0: Option<f64>,
        /// 2: four rods along the axis; 3: a ring and two caps about it.
        dimensions: u8,
    },
    /// A uniform field.
    Uniform {
        /// Where it points, of length one.
        direction: Vec3,
    },
    /// A point charge.
    Point,
    /// A thin charged ring about the axis.
    ThinRing {
        /// m.
        radius: f64,
    },
}
