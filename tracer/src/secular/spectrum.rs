//! Lines in the spectrum of a signal.

use std::f64::consts::TAU;

use nalgebra::Complex;

type C = Complex<f64>;

/// A line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Hz.
    pub frequency: f64,
    /// Estimated error of it, Hz: what it changes by when only the first two thirds of the signal are looked at.
    pub error: f64,
    /// Amplitude, in the signal's unit.
    pub amplitude: f64,
}

/// The strongest lines of evenly sampled values below a frequency (Hz), strongest first: the largest value of the Fourier integral
/// under a window cos⁴, taken away, and again.
///
/// The window's side lobes fall with the fifth power of the distance, so that a line is found to 1e-6 of its distance to others
/// after twenty turns. Source: Laskar 1993 (numerical analysis of fundamental frequencies). Checked by
/// `lines_are_found_and_told_apart`.
pub fn lines(signal: &[f64], every: f64, below: f64, count: usize) -> Vec<Line> {
    let whole = found(signal, every, below, count);
    let part = found(&signal[..signal.len() * 2 / 3], every, below, count);
    let error = |f: f64| part.iter().map(|(other, _)| (other - f).abs()).fold(f64::INFINITY, f64::min);
    // The shorter signal errs some ten times more: its window is that much wider where others leak in.
    whole.into_iter().map(|(frequency, amplitude)| Line { frequency, error: error(frequency), amplitude }).collect()
}

fn found(signal: &[f64], every: f64, below: f64, count: usize) -> Vec<(f64, f64)> {
    let n = signal.len();
    if n < 16 {
        return Vec::new();
    }
    let mean = signal.iter().sum::<f64>() / n as f64;
    let mut rest: Vec<f64> = signal.iter().map(|x| x - mean).collect();
    let window: Vec<f64> =
        (0..n).map(|k| (TAU * (k as f64 + 0.5) / n as f64).cos()).map(|c| (0.5 - 0.5 * c).powi(2)).collect();
    let total: f64 = window.iter().sum();
    let amplitude = |rest: &[f64], frequency: f64| -> C {
        // A turning pointer, set anew now and then.
        let turn = C::from_polar(1.0, -TAU * frequency * every);
        let (mut sum, mut pointer) = (C::ZERO, C::new(1.0, 0.0));
        for (k, (x, w)) in rest.iter().zip(&window).enumerate() {
            if k % 64 == 0 {
                pointer = C::from_polar(1.0, -TAU * frequency * every * k as f64);
            }
            sum += pointer * (x * w);
            pointer *= turn;
        }
        sum * (2.0 / total)
    };
    let resolution = 1.0 / (n as f64 * every);
    let steps = (below / (0.5 * resolution)).ceil().max(2.0) as usize;
    let mut lines: Vec<(f64, f64)> = Vec::new();
    for _ in 0..count {
        // Below two turns in the whole time a line cannot be told from a drift.
        let frequencies = (2..=steps).map(|k| 0.5 * resolution * k as f64);
        let best = frequencies.map(|f| (f, amplitude(&rest, f).norm())).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((near, _)) = best else { break };
        let (mut low, mut high) = (near - 0.6 * resolution, near + 0.6 * resolution);
        for _ in 0..45 {
            let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
            if amplitude(&rest, a).norm() < amplitude(&rest, b).norm() { low = a } else { high = b }
        }
        let frequency = 0.5 * (low + high);
        let size = amplitude(&rest, frequency);
        for (k, x) in rest.iter_mut().enumerate() {
            *x -= (size * C::from_polar(1.0, TAU * frequency * every * k as f64)).re;
        }
        lines.push((frequency, size.norm()));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_and_told_apart() {
        let at = |t: f64| 0.3 * (TAU * 1.234_567 * t).cos() + 0.1 * (TAU * 3.3 * t + 1.0).sin() + 0.7;
        let signal: Vec<f64> = (0..2000).map(|k| at(0.01 * k as f64)).collect();
        let lines = lines(&signal, 0.01, 20.0, 2);
        for (line, (frequency, amplitude)) in lines.iter().zip([(1.234_567, 0.3), (3.3, 0.1)]) {
            // Twenty-five turns: the other line, forty bins away, leaks 40^-5 = 1e-8 into this one.
            assert!((line.frequency - frequency).abs() < 2e-6, "{line:?}");
            assert!((line.frequency - frequency).abs() < line.error.max(1e-9), "{line:?}");
            assert!((line.amplitude / amplitude - 1.0).abs() < 1e-4);
        }
    }
}
