//! What an analysis looks at.

use field::Waveform;
use meshes::Vec3;
use serde::Serialize;

use super::Region;

/// What `graintrap analyse` looks at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Analysis {
    /// Centre of the multipoles, m; `None`: to be chosen.
    pub center: Option<Vec3>,
    /// Polar axis, of length one; `None`: that of the first electrode or source.
    pub axis: Option<Vec3>,
    /// Radius of the multipoles' sphere, m; `None`: to be chosen.
    pub radius: Option<f64>,
    /// Largest degree of multipoles.
    pub order: usize,
    /// Where nulls are looked for; `None`: round electrodes and sources.
    pub region: Option<Region>,
    /// About how many nodes the search has.
    pub nodes: usize,
    /// A point of the plane of the maps, m; `None`: the centre.
    pub plane_center: Option<Vec3>,
    /// Its normal, of length one; `None`: across the axis.
    pub plane_normal: Option<Vec3>,
    /// Voltages that are asked for.
    pub wish: Option<Wish>,
    /// A chart of stability.
    pub chart: Option<Chart>,
}

/// A chart of stability over two voltages, or over a and q.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chart {
    /// To the right, upwards.
    pub axes: [ChartAxis; 2],
    /// What varies.
    #[serde(skip)]
    pub voltages: ChartVoltages,
    /// Grains that are traced.
    pub grains: Option<ChartGrains>,
}

/// An axis of a chart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChartAxis {
    /// The key it varies; `q` or `a`.
    pub key: String,
    /// In which its values are; may be empty.
    pub unit: String,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// How many, at least 2.
    pub steps: usize,
}

/// What the axes of a chart do to the voltages. It follows from the rest of the case.
#[derive(Clone, Debug, PartialEq)]
pub enum ChartVoltages {
    /// Scale all that oscillates, and all that is constant.
    Scaled,
    /// Of each electrode (a charge where it floats) and source at the corners of the chart: both first, x last, y last, both
    /// last. Between them voltages are bilinear.
    Corners(Box<[Vec<Waveform>; 4]>),
}

/// Grains of a chart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChartGrains {
    /// Start off the centre, along each principal axis, m; `None`: to be chosen.
    pub distance: Option<f64>,
    /// Periods they are traced for.
    pub periods: usize,
    /// How many along each axis of the chart.
    pub steps: usize,
}

/// The field that constant voltages are to make.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wish {
    /// Where, m; `None`: the centre.
    pub at: Option<Vec3>,
    /// V/m.
    pub field: Option<Vec3>,
    /// In the order of the case.
    pub multipoles: Vec<WantedMultipole>,
    /// Numbers of the electrodes whose voltages may be chosen; at least one.
    pub electrodes: Vec<usize>,
    /// Largest voltage, V; infinite for none.
    pub limit: f64,
    /// Of small voltages, against the largest singular value.
    pub weight: f64,
}

/// One multipole that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WantedMultipole {
    /// Degree.
    pub l: usize,
    /// Order.
    pub m: usize,
    /// With the sine of the azimuth.
    pub sine: bool,
    /// V/m^l.
    pub value: f64,
}
