//! Lines in the motion of a grain: which frequencies, how strong.
//!
//! A record of n samples taken every h seconds tells frequencies below 1/(2h) (Nyquist's limit; what is faster appears folded
//! back below it) and tells apart lines some 4/(n h) from each other: the main lobe of Hann's window, by which the record is
//! multiplied so that a strong line does not cover weak ones far from it.

use std::f64::consts::TAU;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Below so many samples there is no spectrum worth the name.
pub const FEWEST: usize = 64;

/// Amplitudes over frequencies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Distance of neighbouring frequencies, 1 over the record's duration, Hz. Entry k of the amplitudes is at k times it.
    pub spacing: f64,
    /// Amplitude of a sine that would give this entry when its frequency is the entry's; the unit of the samples.
    pub amplitudes: Vec<f64>,
}

/// A line of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Hz.
    pub frequency: f64,
    /// Of the sine, in the unit of the samples.
    pub amplitude: f64,
}

/// A line with its estimated error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Hz.
    pub frequency: f64,
    /// Estimated error of it, Hz: what it changes by when only the first two thirds of the record are looked at.
    pub error: f64,
    /// Of the sine, in the unit of the samples.
    pub amplitude: f64,
}

/// Lines weaker than this against the strongest are the window's side lobes: 40⁻³ of it.
const WEAKEST: f64 = 1e-5;

/// At most `most` lines below a frequency (Hz), the strongest first, each with what the record says about its error. A line and
/// those nearest to it must lie some four entries apart in two thirds of the record.
///
/// Other lines and the image at the negative frequency, d entries away, move a line by some d⁻³ entries: the shorter record errs
/// some five times more. Checked by `lines_are_measured`.
pub fn measured(samples: &[f64], every: f64, below: f64, most: usize) -> Vec<Measured> {
    let found = |samples: &[f64]| {
        let mut spectrum = spectrum(samples, every);
        let kept = if spectrum.spacing > 0.0 { (below / spectrum.spacing).ceil() as usize } else { 0 };
        spectrum.amplitudes.truncate(kept.saturating_add(1));
        spectrum.lines(most, WEAKEST)
    };
    let part = found(&samples[..samples.len() * 2 / 3]);
    let change = |f: f64| part.iter().map(|other| (other.frequency - f).abs()).fold(f64::INFINITY, f64::min);
    let line =
        |line: Line| Measured { frequency: line.frequency, error: change(line.frequency), amplitude: line.amplitude };
    found(samples).into_iter().map(line).collect()
}

/// The spectrum of samples taken every `every` seconds, their mean taken off, under Hann's window; empty below [`FEWEST`]
/// samples or where one is not finite.
pub fn spectrum(samples: &[f64], every: f64) -> Spectrum {
    let count = samples.len();
    if count < FEWEST || every.is_nan() || every <= 0.0 || samples.iter().any(|x| !x.is_finite()) {
        return Spectrum::default();
    }
    let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / count as f64).cos();
    // The mean under the window: what would leak from zero frequency into the first entries.
    let mean = samples.iter().enumerate().map(|(k, x)| window(k) * x).sum::<f64>() / (0.5 * count as f64);
    let mut values: Vec<Complex<f64>> =
        samples.iter().enumerate().map(|(k, x)| Complex::new(window(k) * (x - mean), 0.0)).collect();
    FftPlanner::new().plan_fft_forward(count).process(&mut values);
    // A sine of amplitude one has n/2 in its entry, Hann's window takes half of that.
    let amplitudes = values[..=count / 2].iter().map(|v| v.norm() * 4.0 / count as f64).collect();
    Spectrum { spacing: 1.0 / (count as f64 * every), amplitudes }
}

impl Spectrum {
    /// At most `most` lines, the strongest first: entries above all within four of them and above `floor` times the strongest.
    ///
    /// Between entries a line is placed by the ratio α of the larger neighbour to the entry, δ = (2α - 1)/(1 + α) entries away:
    /// exact for a single sine under Hann's window, but for terms of the order of the square of the spacing over the
    /// frequency (Grandke 1983, eq. 8). Its amplitude follows from the window's shape, sin(πδ)/(πδ (1 - δ²)).
    /// Checked by `lines_of_two_sines`.
    pub fn lines(&self, most: usize, floor: f64) -> Vec<Line> {
        let a = &self.amplitudes;
        let strongest = a.iter().copied().fold(0.0, f64::max);
        let mut lines: Vec<Line> = (2..a.len().saturating_sub(1))
            .filter(|&k| {
                let around = k.saturating_sub(4)..(k + 5).min(a.len());
                a[k] > floor * strongest && around.into_iter().all(|i| i == k || a[i] < a[k] || (a[i] == a[k] && i > k))
            })
            .map(|k| {
                let (side, neighbour) = if a[k + 1] >= a[k - 1] { (1.0, a[k + 1]) } else { (-1.0, a[k - 1]) };
                let ratio = neighbour / a[k];
                let shift = ((2.0 * ratio - 1.0) / (1.0 + ratio)).clamp(0.0, 0.5);
                let x = std::f64::consts::PI * shift;
                let lobe = if shift > 1e-9 { x.sin() / (x * (1.0 - shift * shift)) } else { 1.0 };
                Line { frequency: (k as f64 + side * shift) * self.spacing, amplitude: a[k] / lobe }
            })
            .collect();
        lines.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
        lines.truncate(most);
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_measured() {
        let at = |t: f64| 0.3 * (TAU * 1.234_567 * t).cos() + 0.1 * (TAU * 3.3 * t + 1.0).sin() + 0.7;
        let samples: Vec<f64> = (0..2000).map(|k| at(0.01 * f64::from(k))).collect();
        let lines = measured(&samples, 0.01, 20.0, 2);
        for (line, (frequency, amplitude)) in lines.iter().zip([(1.234_567, 0.3), (3.3, 0.1)]) {
            // Other lines 40 entries away, the stronger one three times as strong: 3/40³ of an entry of 0.05 Hz.
            assert!((line.frequency - frequency).abs() < 2e-6, "{line:?}");
            assert!((line.frequency - frequency).abs() < line.error.max(1e-9), "{line:?}");
            assert!((line.amplitude / amplitude - 1.0).abs() < 1e-4);
        }
        assert_eq!(lines.len(), 2);
        assert_eq!(measured(&samples, 0.01, 3.0, 2).len(), 1, "only what is below");
        assert_eq!(measured(&samples[..50], 0.01, 20.0, 2), []);
    }

    #[test]
    fn lines_of_two_sines() {
        // A secular motion and a sideband a thousandth as strong, neither on an entry.
        let every = 0.05;
        let samples: Vec<f64> = (0..2000)
            .map(|k| f64::from(k) * every)
            .map(|t| 3.0 + 2.0 * (TAU * 0.29256 * t + 0.4).sin() + 2e-3 * (TAU * 1.70744 * t).cos())
            .collect();
        let lines = spectrum(&samples, every).lines(5, 1e-4);
        assert_eq!(lines.len(), 2, "{lines:?}");
        // The image at the negative frequency, 58 entries away, moves it by about 1/58³ of an entry.
        assert!((lines[0].frequency - 0.29256).abs() < 1e-7 && (lines[0].amplitude - 2.0).abs() < 1e-5, "{lines:?}");
        // What the strong one leaves there, 2 / (2π 141³) of it, is 1e-4 of the weak one.
        assert!((lines[1].frequency - 1.70744).abs() < 1e-5 && (lines[1].amplitude / 2e-3 - 1.0).abs() < 1e-3);
        assert_eq!(spectrum(&samples[..FEWEST - 1], every), Spectrum::default());
        assert_eq!(spectrum(&[f64::NAN; 100], every), Spectrum::default());
    }
}
