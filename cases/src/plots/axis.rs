//! The range, ticks and tick labels of one axis.

/// Beyond this a number is not drawn: ranges must not overflow.
const LARGEST: f64 = 1e200;

/// Whether both coordinates can be drawn.
pub(super) fn drawable(point: &[f64; 2]) -> bool {
    point.iter().all(|v| v.abs() < LARGEST)
}

/// A range of one axis and the step of its ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub min: f64,
    pub max: f64,
    pub step: f64,
}

impl Axis {
    /// An axis that shows `values` with a margin of `pad` of the range on each side and about `ticks` ticks.
    ///
    /// Values equal to nine digits are a constant, shown in the middle of an axis of ±10 %: what differs later is round-off.
    pub fn over(values: impl Iterator<Item = f64>, pad: f64, ticks: usize) -> Axis {
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            min = min.min(value);
            max = max.max(value);
        }
        if min > max {
            (min, max) = (0.0, 1.0);
        }
        let scale = min.abs().max(max.abs());
        if scale < 1e-200 {
            (min, max) = (-1.0, 1.0);
        } else if max - min <= 1e-9 * scale {
            (min, max) = (min - 0.1 * scale, max + 0.1 * scale);
        } else {
            let margin = pad * (max - min);
            (min, max) = (min - margin, max + margin);
        }
        let mut axis = Axis { min, max, step: 1.0 };
        axis.set_ticks(ticks);
        axis
    }

    /// Choose the step for at most `ticks` intervals: 1, 2 or 5 times a power of ten.
    pub fn set_ticks(&mut self, ticks: usize) {
        let rough = (self.max - self.min) / ticks.max(1) as f64;
        let decade = 10f64.powi(rough.log10().floor() as i32);
        let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * decade >= rough * (1.0 - 1e-9)).unwrap_or(10.0);
        self.step = factor * decade;
    }

    /// The widest tick label, in characters.
    pub fn label_chars(&self) -> usize {
        let format = self.format();
        let (first, last) = ((self.min / self.step).ceil() as i64, (self.max / self.step).floor() as i64);
        (first..=last).map(|i| format.label(i as f64 * self.step).chars().count()).max().unwrap_or(1)
    }

    /// How this axis writes its numbers.
    pub fn format(&self) -> Format {
        let scale = self.min.abs().max(self.max.abs());
        let magnitude = scale.log10().floor();
        // 5 x 10^-k is computed, not exact: the margin keeps its decade.
        let finest = (self.step.log10() + 1e-9).floor();
        if (-4.0..6.0).contains(&magnitude) {
            Format { step: self.step, digits: (-finest).max(0.0) as usize, scientific: false }
        } else {
            Format { step: self.step, digits: (magnitude - finest).max(0.0) as usize, scientific: true }
        }
    }
}

/// How the numbers of one axis are written: all with the same decimals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Format {
    step: f64,
    digits: usize,
    scientific: bool,
}

impl Format {
    /// The label of the tick at `value`.
    pub fn label(&self, value: f64) -> String {
        let label = if value.abs() < 1e-6 * self.step {
            "0".to_owned()
        } else if self.scientific {
            format!("{value:.*e}", self.digits)
        } else {
            format!("{value:.*}", self.digits)
        };
        label.replace('-', "\u{2212}")
    }
}
