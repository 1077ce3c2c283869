//! SI prefixes for axes.

/// A unit of an axis: SI values times `factor` are in `name`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AxisUnit {
    pub name: String,
    pub factor: f64,
}

const PREFIXES: [(i32, &str); 8] =
    [(-15, "f"), (-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m"), (0, ""), (3, "k"), (6, "M")];

/// The multiple of the SI unit `si` in which the largest of `values` lies between 1 and 1000; the unit itself when all
/// are zero. Prefixes end at 10^`highest`: seconds and metres per second are not counted in thousands.
pub(crate) fn axis_unit(values: impl Iterator<Item = f64>, si: &str, highest: i32) -> AxisUnit {
    let largest = values.filter(|v| v.is_finite()).fold(0.0, |largest: f64, v| largest.max(v.abs()));
    if largest == 0.0 {
        return AxisUnit { name: si.to_owned(), factor: 1.0 };
    }
    // Round-off must not turn 1 mm into 1000 µm.
    let magnitude = (largest * (1.0 + 1e-9)).log10();
    let exponent = ((magnitude / 3.0).floor() as i32 * 3).clamp(PREFIXES[0].0, highest.min(6));
    let prefix = PREFIXES.iter().find(|(e, _)| *e == exponent).map_or("", |(_, name)| name);
    AxisUnit { name: format!("{prefix}{si}"), factor: 10f64.powi(-exponent) }
}

impl AxisUnit {
    /// The label of an axis: `x (mm)`.
    pub fn label(&self, quantity: &str) -> String {
        format!("{quantity} ({})", self.name)
    }
}
