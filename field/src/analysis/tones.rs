//! Waveforms as a constant and sines.

use std::f64::consts::PI;

use crate::{Waveform, WaveformPart};

/// One frequency, with what oscillates at it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tone {
    /// Hz.
    pub frequency: f64,
    /// Amplitude of the cosine of each channel, V.
    pub cosine: Vec<f64>,
    /// Amplitude of the sine of each channel, V.
    pub sine: Vec<f64>,
}

/// The channels' voltages once transients are over: what is constant, and what oscillates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tones {
    /// Constant part of each channel, V.
    pub constant: Vec<f64>,
    /// What oscillates, in the order of the waveforms.
    pub tones: Vec<Tone>,
}

/// Harmonics of a square wave that are kept: its pseudopotential falls with the fourth power of their number, and what is left
/// out is below 1e-7 of it.
const HARMONICS: usize = 127;

impl Tones {
    /// Of the waveforms of all channels. Ramps count with the voltage they end at, and square waves by their Fourier series:
    ///
    ///   mean (2d - 1) V,  amplitudes 4 V sin(nπd) / (nπ)
    ///
    /// d duty. `None` where a voltage is sampled: it has neither.
    pub fn of(waveforms: &[Waveform]) -> Option<Self> {
        let mut all = Self { constant: waveforms.iter().map(|w| w.constant).collect(), tones: Vec::new() };
        for (c, waveform) in waveforms.iter().enumerate() {
            for part in &waveform.parts {
                match *part {
                    WaveformPart::Sine { amplitude, frequency, phase } => all.add(c, frequency, amplitude, phase),
                    WaveformPart::Square { amplitude, frequency, phase, duty } => {
                        all.constant[c] += (2.0 * duty - 1.0) * amplitude;
                        for n in 1..=HARMONICS {
                            let order = n as f64;
                            let share = 4.0 * amplitude * (order * PI * duty).sin() / (order * PI);
                            if share.abs() > 1e-9 * amplitude.abs() {
                                all.add(c, order * frequency, share, order * phase);
                            }
                        }
                    }
                    WaveformPart::Ramp { amplitude, .. } => all.constant[c] += amplitude,
                    WaveformPart::Sampled { .. } => return None,
                }
            }
        }
        Some(all)
    }

    fn add(&mut self, channel: usize, frequency: f64, amplitude: f64, phase: f64) {
        let none = vec![0.0; self.constant.len()];
        let at = self.tones.iter().position(|tone| tone.frequency == frequency).unwrap_or_else(|| {
            self.tones.push(Tone { frequency, cosine: none.clone(), sine: none });
            self.tones.len() - 1
        });
        // V cos(ωt + φ) = V cos φ cos ωt - V sin φ sin ωt.
        self.tones[at].cosine[channel] += amplitude * phase.cos();
        self.tones[at].sine[channel] -= amplitude * phase.sin();
    }

    /// The frequency with the largest amplitude, Hz.
    pub fn strongest(&self) -> Option<f64> {
        let size = |tone: &Tone| tone.cosine.iter().zip(&tone.sine).map(|(c, s)| c * c + s * s).sum::<f64>();
        self.tones.iter().max_by(|a, b| size(a).total_cmp(&size(b))).map(|tone| tone.frequency)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tones_are_the_waveform() {
        let parts = vec![
            WaveformPart::Square { amplitude: 2.0, frequency: 5.0, phase: 0.7, duty: 0.3 },
            WaveformPart::Sine { amplitude: 3.0, frequency: 7.0, phase: -0.4 },
        ];
        let waveform = Waveform { constant: 0.5, parts };
        let tones = Tones::of(std::slice::from_ref(&waveform)).unwrap();
        for t in [0.05, 0.083, 0.11] {
            let angle = |tone: &Tone| std::f64::consts::TAU * tone.frequency * t;
            let sum: f64 = tones.tones.iter().map(|k| k.cosine[0] * angle(k).cos() + k.sine[0] * angle(k).sin()).sum();
            // Far from the jumps a series of 127 harmonics is good for a hundredth.
            assert!((sum + tones.constant[0] - waveform.value(t)).abs() < 0.05, "{t}");
        }
        assert!((tones.constant[0] - (0.5 - 0.4 * 2.0)).abs() < 1e-14);
        assert_eq!(Tones::of(&[Waveform::constant(1.0)]).unwrap().strongest(), None);
    }
}
