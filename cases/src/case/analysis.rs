//! What an analysis looks at.

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
