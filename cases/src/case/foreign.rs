//! How shapes, waveforms and places of the other members are stored.
//!
//! *Why here*: they do not know serde. The definitions below repeat theirs field by field, and the compiler compares them.

use std::sync::Arc;

use field::{Waveform, WaveformPart};
use meshes::{GridPattern, Hole, Outline, Placement, Shape, Vec3, Weave};
use serde::{Serialize, Serializer};
use tracer::{Launch, Place};

macro_rules! stored {
    ($function:ident, $type:ty, $definition:ty) => {
        pub(super) fn $function<S: Serializer>(value: &$type, serializer: S) -> Result<S::Ok, S::Error> {
            <$definition>::serialize(value, serializer)
        }
    };
}

stored!(placement, Placement, PlacementStored);
stored!(shape, Shape, ShapeStored);
stored!(waveform, Waveform, WaveformStored);
stored!(place, Place, PlaceStored);
stored!(launch, Launch, LaunchStored);

#[derive(Serialize)]
#[serde(remote = "Placement")]
struct PlacementStored {
    center: Vec3,
    axis: Vec3,
    up: Option<Vec3>,
}

#[derive(Serialize)]
#[serde(remote = "Shape", rename_all = "snake_case")]
enum ShapeStored {
    Sphere {
        radius: f64,
    },
    Ring {
        radius: f64,
        wire_radius: f64,
    },
    Disc {
        radius: f64,
        hole_radius: f64,
        thickness: f64,
    },
    Plate {
        size: [f64; 2],
        thickness: f64,
    },
    EndCap {
        radius: f64,
        opening: f64,
        thickness: f64,
    },
    GridPlate {
        #[serde(with = "OutlineStored")]
        outline: Outline,
        pitch: f64,
        #[serde(with = "GridPatternStored")]
        pattern: GridPattern,
    },
    Cylinder {
        radius: f64,
        length: f64,
        caps: bool,
    },
    Rod {
        radius: f64,
        length: f64,
    },
    Wire {
        points: Vec<Vec3>,
        wire_radius: f64,
    },
    Box {
        size: [f64; 3],
    },
    HyperbolicRing {
        r0: f64,
        z0: f64,
        extent: f64,
    },
    HyperbolicCap {
        r0: f64,
        z0: f64,
        extent: f64,
    },
    Mesh {
        vertices: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
    },
}

#[derive(Serialize)]
#[serde(remote = "Outline", rename_all = "snake_case")]
enum OutlineStored {
    Rectangle([f64; 2]),
    Disc(f64),
}

#[derive(Serialize)]
#[serde(remote = "GridPattern", rename_all = "snake_case")]
enum GridPatternStored {
    Perforated {
        #[serde(with = "HoleStored")]
        hole: Hole,
        open: f64,
        thickness: f64,
    },
    Wires {
        #[serde(with = "WeaveStored")]
        weave: Weave,
        wire_radius: f64,
    },
}

#[derive(Serialize)]
#[serde(remote = "Hole", rename_all = "snake_case")]
enum HoleStored {
    Square,
    Round,
    Hexagonal,
    Slot,
}

#[derive(Serialize)]
#[serde(remote = "Weave", rename_all = "snake_case")]
enum WeaveStored {
    Parallel,
    Crossed,
    Woven,
}

#[derive(Serialize)]
#[serde(remote = "Waveform")]
struct WaveformStored {
    constant: f64,
    #[serde(serialize_with = "parts")]
    parts: Vec<WaveformPart>,
}

fn parts<S: Serializer>(parts: &[WaveformPart], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Part<'p>(#[serde(serialize_with = "part")] &'p WaveformPart);
    fn part<S: Serializer>(part: &&WaveformPart, serializer: S) -> Result<S::Ok, S::Error> {
        WaveformPartStored::serialize(part, serializer)
    }
    serializer.collect_seq(parts.iter().map(Part))
}

#[derive(Serialize)]
#[serde(remote = "WaveformPart", rename_all = "snake_case")]
enum WaveformPartStored {
    Sine { amplitude: f64, frequency: f64, phase: f64 },
    Square { amplitude: f64, frequency: f64, phase: f64, duty: f64 },
    Ramp { amplitude: f64, start: f64, duration: f64 },
    Sampled { times: Arc<[f64]>, values: Arc<[f64]>, scale: f64, repeat: bool },
}

#[derive(Serialize)]
#[serde(remote = "Place", rename_all = "snake_case")]
enum PlaceStored {
    Points(Vec<Vec3>),
    Ball { center: Vec3, radius: f64 },
    Shell { center: Vec3, radius: f64 },
    Box { min: Vec3, max: Vec3 },
    Disc { center: Vec3, axis: Vec3, radius: f64 },
    Beam { center: Vec3, axis: Vec3, radius: f64, length: f64 },
}

#[derive(Serialize)]
#[serde(remote = "Launch", rename_all = "snake_case")]
enum LaunchStored {
    Rest,
    Uniform(Vec3),
    Thermal(f64),
    Isotropic(f64),
    Each(Vec<Vec3>),
}
