//! `[analysis]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::sweep::End;
use super::value::{Count, DirectionKeys, Fraction, Number, Vector, Whole};
use crate::quantity::Positive;
use crate::quantity::kinds::{ElectricField, Length, Voltage};

/// `[analysis]`: what `graintrap analyse` looks at. All of it may be left out.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct AnalysisKeys {
    /// Centre of the multipoles; left out: the minimum of the first grains' effective potential, or else the null, that is
    /// nearest to the middle of the electrodes.
    pub center: Option<Vector<Length>>,
    /// Polar axis of the multipoles; left out: the axis of the first electrode or source.
    pub axis: Option<DirectionKeys>,
    /// Radius of the sphere that multipoles are found on; left out: half the distance of the nearest electrode.
    pub radius: Option<Positive<Length>>,
    /// Largest degree of the multipoles, up to 30; left out: 12.
    pub order: Option<Count>,
    /// Lower corner of the box in which nulls and minima are looked for; left out (with `max`): round electrodes and sources.
    pub min: Option<Vector<Length>>,
    /// Upper corner.
    pub max: Option<Vector<Length>>,
    /// About how many places of the box are looked at first; left out: 40000.
    pub nodes: Option<Count>,
    /// The plane that maps are drawn in.
    pub plane: Option<PlaneKeys>,
    /// Voltages that are asked for.
    pub wish: Option<WishKeys>,
    /// Where the first grains stay, over two voltages or over a and q.
    pub chart: Option<ChartKeys>,
}

/// A plane to draw maps in.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaneKeys {
    /// A point of it; left out: the centre of the analysis.
    pub center: Option<Vector<Length>>,
    /// Its normal; left out: across the axis of the multipoles.
    pub axis: Option<DirectionKeys>,
}

/// The field that constant voltages are to make, at least one of `field` and `multipoles`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct WishKeys {
    /// Where; left out: the centre of the analysis.
    pub at: Option<Vector<Length>>,
    /// The electric field there.
    pub field: Option<Vector<ElectricField>>,
    /// Multipoles about that point.
    #[serde(default)]
    pub multipoles: Vec<MultipoleKeys>,
    /// The electrodes whose voltages may be chosen; left out: all that do not float.
    pub electrodes: Option<Vec<String>>,
    /// No voltage larger than this; left out: any.
    pub limit: Option<Positive<Voltage>>,
    /// How much small voltages count against an exact field; left out: 1e-6.
    pub weight: Option<Fraction>,
}

/// One multipole in Schmidt's normalisation.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MultipoleKeys {
    /// Its degree.
    pub l: Whole<1>,
    /// Its order, up to `l`; left out: 0, round about the axis.
    pub m: Option<Whole<0>>,
    /// Whether it goes with the sine of the azimuth; left out: with the cosine.
    pub sine: Option<bool>,
    /// In V/m^l.
    pub value: Number,
}

/// A chart of stability.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChartKeys {
    /// What varies to the right.
    pub x: ChartAxisKeys,
    /// What varies upwards.
    pub y: ChartAxisKeys,
    /// Grains that are traced, from off the centre; left out: none.
    pub grains: Option<ChartGrainsKeys>,
}

/// An axis of a chart.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChartAxisKeys {
    /// The path of a key that sets a voltage, as "electrode.ring.dc" or "drive.main.amplitude"; or "q" (to the right) and "a"
    /// (upwards), which scale all that oscillates and all that is constant.
    pub key: String,
    /// The first value: a number, or a string with a unit.
    pub from: End,
    /// The last value, in the same unit.
    pub to: End,
    /// How many values, both ends counted, up to 400; left out: 40.
    pub steps: Option<Whole<2>>,
}

/// Grains of a chart.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChartGrainsKeys {
    /// How far from the centre they start, along each principal axis; left out: a tenth of the way to the nearest electrode.
    pub distance: Option<Positive<Length>>,
    /// How many periods of the slowest voltage they must stay; left out: 200.
    pub periods: Option<Count>,
    /// How many to the right and upwards, up to 100; left out: 12.
    pub steps: Option<Whole<2>>,
}
