//! Few channels for many electrodes: basis functions that go together in time become one.
//!
//! Every waveform is a sum of elementary functions of time (1, cos ωt, sin ωt, a square wave of a phase, ...). Each elementary
//! function multiplies a combination of basis functions, its pattern in space. Equal patterns (up to a factor) are one channel:
//! two rings driven alike need one, however many frequencies drive them.

use std::f64::consts::FRAC_PI_2;

use crate::waveform::{Waveform, WaveformPart};

/// Patterns that differ by less than this, as fractions of their largest entry, are one: rounding of products of amplitudes.
const SAME: f64 = 1e-12;

/// Channels: patterns in space and their waveforms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    /// For each channel a weight for each basis function, the largest of them 1 or -1.
    pub weights: Vec<Vec<f64>>,
    /// For each channel its voltage over time: V (or the unit of a source's strength).
    pub waveforms: Vec<Waveform>,
}

impl Channels {
    /// The channels of basis functions with these waveforms, one for each. Functions that are always at zero take part in
    /// none.
    pub fn new(waveforms: &[Waveform]) -> Self {
        let mut elements = Elements::default();
        for (function, waveform) in waveforms.iter().enumerate() {
            elements.add(function, waveforms.len(), waveform, 1.0);
        }
        elements.channels()
    }

    /// As [`Channels::new`], with basis function `f` of `combinations[i] = (f, row)` at `Σ_k row[k]` times waveform k instead of
    /// its own: floating electrodes, whose voltages follow from those of the others (`waveforms[f]` then holds its charge).
    pub fn with_floating(waveforms: &[Waveform], combinations: &[(usize, Vec<f64>)]) -> Self {
        let mut elements = Elements::default();
        for (function, waveform) in waveforms.iter().enumerate() {
            match combinations.iter().find(|(f, _)| *f == function) {
                None => elements.add(function, waveforms.len(), waveform, 1.0),
                Some((_, row)) => {
                    for (factor, given) in row.iter().zip(waveforms) {
                        elements.add(function, waveforms.len(), given, *factor);
                    }
                }
            }
        }
        elements.channels()
    }

    /// The waveform of one basis function: its weights times the channels' waveforms.
    pub fn waveform_of(&self, function: usize) -> Waveform {
        let mut sum = Waveform::default();
        for (row, waveform) in self.weights.iter().zip(&self.waveforms) {
            if row[function] != 0.0 {
                sum.constant += row[function] * waveform.constant;
                sum.parts.extend(waveform.parts.iter().map(|part| scaled(part, row[function])));
            }
        }
        sum
    }
}

/// Elementary functions of time with their patterns.
#[derive(Default)]
struct Elements {
    /// Amplitude one; `None` is the constant 1.
    times: Vec<Option<WaveformPart>>,
    patterns: Vec<Vec<f64>>,
}

impl Elements {
    fn add(&mut self, function: usize, functions: usize, waveform: &Waveform, factor: f64) {
        self.put(function, functions, None, factor * waveform.constant);
        for part in &waveform.parts {
            for (element, amplitude) in elementary(part) {
                self.put(function, functions, Some(element), factor * amplitude);
            }
        }
    }

    fn put(&mut self, function: usize, functions: usize, time: Option<WaveformPart>, amplitude: f64) {
        if amplitude == 0.0 {
            return;
        }
        let at = self.times.iter().position(|t| *t == time).unwrap_or_else(|| {
            self.times.push(time);
            self.patterns.push(vec![0.0; functions]);
            self.times.len() - 1
        });
        self.patterns[at][function] += amplitude;
    }

    fn channels(self) -> Channels {
        let mut channels = Channels::default();
        for (time, pattern) in self.times.into_iter().zip(self.patterns) {
            // The entry of largest size; of equals the first.
            let peak =
                pattern.iter().fold(0.0_f64, |best, x| if x.abs() > best.abs() * (1.0 + SAME) { *x } else { best });
            if peak == 0.0 {
                continue;
            }
            let weights: Vec<f64> = pattern.iter().map(|x| x / peak).collect();
            let alike = |row: &Vec<f64>| row.iter().zip(&weights).all(|(a, b)| (a - b).abs() <= SAME);
            let channel = channels.weights.iter().position(alike).unwrap_or_else(|| {
                channels.weights.push(weights.clone());
                channels.waveforms.push(Waveform::default());
                channels.weights.len() - 1
            });
            let waveform = &mut channels.waveforms[channel];
            match time {
                None => waveform.constant += peak,
                Some(part) => waveform.parts.push(scaled(&part, peak)),
            }
        }
        for waveform in &mut channels.waveforms {
            merge_sines(&mut waveform.parts);
        }
        channels
    }
}

/// A part as elementary functions of amplitude one with factors. A sine of any phase is a cosine and a sine of phase zero, so
/// that electrodes driven with different phases share two patterns.
fn elementary(part: &WaveformPart) -> Vec<(WaveformPart, f64)> {
    match part {
        WaveformPart::Sine { amplitude, frequency, phase } => {
            let (sin, cos) = phase.sin_cos();
            let of = |phase: f64| WaveformPart::Sine { amplitude: 1.0, frequency: *frequency, phase };
            // cos(ωt + φ) = cos φ cos ωt + sin φ cos(ωt + π/2). What is only the rounding of φ does not count.
            let clean = |x: f64| if x.abs() < 1e-15 { 0.0 } else { x };
            vec![(of(0.0), amplitude * clean(cos)), (of(FRAC_PI_2), amplitude * clean(sin))]
        }
        WaveformPart::Square { amplitude, frequency, phase, duty } => {
            vec![(
                WaveformPart::Square { amplitude: 1.0, frequency: *frequency, phase: *phase, duty: *duty },
                *amplitude,
            )]
        }
        WaveformPart::Ramp { amplitude, start, duration } => {
            vec![(WaveformPart::Ramp { amplitude: 1.0, start: *start, duration: *duration }, *amplitude)]
        }
        WaveformPart::Sampled { times, values, scale, repeat } => {
            let one =
                WaveformPart::Sampled { times: times.clone(), values: values.clone(), scale: 1.0, repeat: *repeat };
            vec![(one, *scale)]
        }
    }
}

fn scaled(part: &WaveformPart, factor: f64) -> WaveformPart {
    let mut part = part.clone();
    match &mut part {
        WaveformPart::Sine { amplitude, .. }
        | WaveformPart::Square { amplitude, .. }
        | WaveformPart::Ramp { amplitude, .. } => *amplitude *= factor,
        WaveformPart::Sampled { scale, .. } => *scale *= factor,
    }
    part
}

/// Puts sines of one frequency together again.
fn merge_sines(parts: &mut Vec<WaveformPart>) {
    let mut merged: Vec<WaveformPart> = Vec::new();
    for part in parts.drain(..) {
        if let WaveformPart::Sine { amplitude, frequency, phase } = &part {
            let same = merged.iter_mut().find_map(|other| match other {
                WaveformPart::Sine { amplitude: a, frequency: f, phase: p } if f == frequency => Some((a, p)),
                _ => None,
            });
            if let Some((a, p)) = same {
                let (cos, sin) = (*a * p.cos() + amplitude * phase.cos(), *a * p.sin() + amplitude * phase.sin());
                (*a, *p) = (cos.hypot(sin), sin.atan2(cos));
                continue;
            }
        }
        merged.push(part);
    }
    *parts = merged;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(amplitude: f64, frequency: f64, phase: f64) -> WaveformPart {
        WaveformPart::Sine { amplitude, frequency, phase }
    }

    fn driven(constant: f64, parts: &[WaveformPart]) -> Waveform {
        Waveform { constant, parts: parts.to_vec() }
    }

    /// Every function's voltage is what its own waveform says.
    fn agrees(waveforms: &[Waveform], channels: &Channels) {
        for (function, waveform) in waveforms.iter().enumerate() {
            for t in [0.0, 0.013, 1.7] {
                let sum: f64 =
                    channels.weights.iter().zip(&channels.waveforms).map(|(w, c)| w[function] * c.value(t)).sum();
                assert!((sum - waveform.value(t)).abs() < 1e-11, "function {function} at {t}: {sum}");
                assert!((channels.waveform_of(function).value(t) - waveform.value(t)).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn electrodes_driven_alike_are_one_channel() {
        let ring = driven(5.0, &[sine(300.0, 60.0, 0.4)]);
        let waveforms = [ring.clone(), ring, Waveform::default()];
        let channels = Channels::new(&waveforms);
        assert_eq!(channels.weights, [[1.0, 1.0, 0.0]]);
        assert_eq!(channels.waveforms[0].parts.len(), 1, "one sine again");
        agrees(&waveforms, &channels);
    }

    #[test]
    fn dc_and_rf_of_different_patterns_are_two() {
        let rf = [sine(300.0, 60.0, 0.0)];
        let opposite = [sine(150.0, 60.0, std::f64::consts::PI)];
        let waveforms = [driven(5.0, &rf), driven(5.0, &opposite), driven(-3.0, &[])];
        let channels = Channels::new(&waveforms);
        assert_eq!(channels.weights.len(), 2);
        agrees(&waveforms, &channels);
    }

    #[test]
    fn different_phases_need_two_patterns_and_no_more() {
        let waveforms: Vec<Waveform> = (0..4).map(|k| driven(0.0, &[sine(2.0, 10.0, k as f64)])).collect();
        let channels = Channels::new(&waveforms);
        assert_eq!(channels.weights.len(), 2);
        agrees(&waveforms, &channels);
    }

    #[test]
    fn a_floating_electrode_follows_the_others() {
        let waveforms = [driven(0.0, &[sine(10.0, 5.0, 0.0)]), Waveform::constant(2.0)];
        // Function 1 holds a charge of 2 and floats at 0.5 · 2 + 0.25 · the voltage of function 0.
        let channels = Channels::with_floating(&waveforms, &[(1, vec![0.25, 0.5])]);
        let floating = driven(1.0, &[sine(2.5, 5.0, 0.0)]);
        agrees(&[waveforms[0].clone(), floating], &channels);
    }

    #[test]
    fn squares_ramps_and_samples_stay_what_they_are() {
        let square = WaveformPart::Square { amplitude: 3.0, frequency: 2.0, phase: 0.1, duty: 0.3 };
        let ramp = WaveformPart::Ramp { amplitude: 2.0, start: 0.5, duration: 1.0 };
        let sampled =
            WaveformPart::Sampled { times: [0.0, 1.0].into(), values: [1.0, 3.0].into(), scale: 2.0, repeat: false };
        let waveforms = [driven(1.0, &[square.clone(), ramp]), driven(2.0, &[scaled(&square, 2.0), sampled])];
        let channels = Channels::new(&waveforms);
        // Constant and square go together 1 : 2; ramp and samples stand alone.
        assert_eq!(channels.weights.len(), 3);
        agrees(&waveforms, &channels);
    }
}
