//! Voltages as functions of time.

use std::f64::consts::TAU;
use std::sync::Arc;

/// One term of a waveform.
#[derive(Clone, Debug, PartialEq)]
pub enum WaveformPart {
    /// `amplitude · cos(2π frequency t + phase)`.
    Sine {
        /// Peak value, V.
        amplitude: f64,
        /// Hz.
        frequency: f64,
        /// Radians.
        phase: f64,
    },
    /// `+amplitude` while `cos` of the same argument would be in the first `duty` of its period (centred on its
    /// maximum), `-amplitude` else. With `duty` one half: the sign of the cosine.
    Square {
        /// Peak value, V.
        amplitude: f64,
        /// Hz.
        frequency: f64,
        /// Radians.
        phase: f64,
        /// Fraction of the period spent high, between 0 and 1.
        duty: f64,
    },
    /// Zero until `start`, then linear to `amplitude` over `duration`, then constant.
    Ramp {
        /// Final value, V.
        amplitude: f64,
        /// s.
        start: f64,
        /// s; positive.
        duration: f64,
    },
    /// Piecewise linear between samples, constant before the first and after the last.
    Sampled {
        /// Sample times, s, strictly increasing, at least one.
        times: Arc<[f64]>,
        /// Values, V, one for each time.
        values: Arc<[f64]>,
        /// Factor on the values.
        scale: f64,
        /// Start again after the last sample: the waveform has the period `last - first`.
        repeat: bool,
    },
}

/// A voltage as a function of time: a constant and a sum of parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Waveform {
    /// V.
    pub constant: f64,
    /// What is added to it.
    pub parts: Vec<WaveformPart>,
}

impl Waveform {
    /// A constant voltage, V.
    pub fn constant(volts: f64) -> Self {
        Self { constant: volts, parts: Vec::new() }
    }

    /// Voltage at time `t` (s), V.
    pub fn value(&self, t: f64) -> f64 {
        self.parts.iter().fold(self.constant, |sum, part| sum + part.value(t))
    }

    /// The first time after `t` at which the waveform jumps or has a corner, s, or infinity.
    pub fn next_corner(&self, t: f64) -> f64 {
        self.parts.iter().map(|part| part.next_corner(t)).fold(f64::INFINITY, f64::min)
    }

    /// The shortest period among the parts, s.
    pub fn shortest_period(&self) -> Option<f64> {
        self.parts.iter().filter_map(WaveformPart::period).min_by(f64::total_cmp)
    }

    /// Whether the voltage never changes.
    pub fn is_constant(&self) -> bool {
        self.parts.is_empty()
    }
}

impl WaveformPart {
    /// Its amplitude, V; the factor of samples.
    pub fn amplitude_mut(&mut self) -> &mut f64 {
        match self {
            Self::Sine { amplitude, .. } | Self::Square { amplitude, .. } | Self::Ramp { amplitude, .. } => amplitude,
            Self::Sampled { scale, .. } => scale,
        }
    }

    /// Value at time `t` (s), V.
    pub fn value(&self, t: f64) -> f64 {
        match self {
            Self::Sine { amplitude, frequency, phase } => amplitude * (TAU * frequency * t + phase).cos(),
            Self::Square { amplitude, frequency, phase, duty } => {
                let turn = (frequency * t + phase / TAU + 0.5 * duty).rem_euclid(1.0);
                if turn < *duty { *amplitude } else { -amplitude }
            }
            Self::Ramp { amplitude, start, duration } => amplitude * ((t - start) / duration).clamp(0.0, 1.0),
            Self::Sampled { times, values, scale, repeat } => {
                let (first, last) = (times[0], times[times.len() - 1]);
                let t = if *repeat && last > first { first + (t - first).rem_euclid(last - first) } else { t };
                let after = times.partition_point(|&s| s <= t);
                let value = if after == 0 {
                    values[0]
                } else if after == times.len() {
                    values[after - 1]
                } else {
                    let (t0, t1) = (times[after - 1], times[after]);
                    let (v0, v1) = (values[after - 1], values[after]);
                    v0 + (v1 - v0) * ((t - t0) / (t1 - t0))
                };
                scale * value
            }
        }
    }

    /// The first time after `t` at which the part is not smooth, s, or infinity.
    pub fn next_corner(&self, t: f64) -> f64 {
        match self {
            Self::Sine { .. } => f64::INFINITY,
            Self::Square { frequency, phase, duty, .. } => {
                // Jumps stand where the turn is 0 and where it is `duty`.
                let turn = frequency * t + phase / TAU + 0.5 * duty;
                [0.0, *duty]
                    .map(|edge| {
                        let mut n = (turn - edge).floor() + 1.0;
                        let at = |n: f64| t + (n + edge - turn) / frequency;
                        if at(n) <= t {
                            n += 1.0;
                        }
                        at(n)
                    })
                    .into_iter()
                    .fold(f64::INFINITY, f64::min)
            }
            Self::Ramp { start, duration, .. } => {
                if t < *start {
                    *start
                } else if t < start + duration {
                    start + duration
                } else {
                    f64::INFINITY
                }
            }
            Self::Sampled { times, repeat, .. } => {
                let (first, last) = (times[0], times[times.len() - 1]);
                let period = last - first;
                if *repeat && period > 0.0 {
                    let turns = ((t - first) / period).floor();
                    let base = turns * period;
                    let next = times.iter().map(|s| s + base).find(|&s| s > t);
                    next.unwrap_or(times[1] + base + period)
                } else {
                    let after = times.partition_point(|&s| s <= t);
                    times.get(after).copied().unwrap_or(f64::INFINITY)
                }
            }
        }
    }

    /// Its period, s, where it has one.
    pub fn period(&self) -> Option<f64> {
        match self {
            Self::Sine { frequency, .. } | Self::Square { frequency, .. } => Some(1.0 / frequency),
            Self::Sampled { times, repeat: true, .. } => Some(times[times.len() - 1] - times[0]),
            Self::Ramp { .. } | Self::Sampled { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_a_square_wave_are_where_it_jumps() {
        let square = WaveformPart::Square { amplitude: 2.0, frequency: 10.0, phase: 0.3, duty: 0.2 };
        let (mut t, mut corners) = (-0.05, 0);
        while t < 1.0 {
            let next = square.next_corner(t);
            assert!(next > t && next - t <= 0.1 + 1e-12);
            // 1e-9 s is far above the rounding of the corner and far below the distance of two corners.
            assert_eq!(square.value(next - 1e-9), -square.value(next + 1e-9));
            (t, corners) = (next, corners + 1);
        }
        assert!(corners >= 20, "two corners in each of ten periods, found {corners}");
    }

    #[test]
    fn sampled_waveform_interpolates_holds_and_repeats() {
        let part = |repeat| WaveformPart::Sampled {
            times: [1.0, 2.0, 4.0].into(),
            values: [0.0, 10.0, 0.0].into(),
            scale: 2.0,
            repeat,
        };
        assert_eq!([0.0, 1.5, 2.0, 3.0, 9.0].map(|t| part(false).value(t)), [0.0, 10.0, 20.0, 10.0, 0.0]);
        assert_eq!([4.5, 6.0, 0.0].map(|t| part(true).value(t)), [10.0, 10.0, 10.0]);
        assert_eq!([0.0, 1.0, 3.9, 4.0].map(|t| part(false).next_corner(t)), [1.0, 2.0, 4.0, f64::INFINITY]);
        assert_eq!([0.0, 1.0, 3.9, 4.0].map(|t| part(true).next_corner(t)), [1.0, 2.0, 4.0, 5.0]);
    }
}
