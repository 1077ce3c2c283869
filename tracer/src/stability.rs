//! Where motions in a quadrupole under RF stay bounded: maps over the Mathieu plane.
//!
//!   u'' + 2 k u' + (a - 2 q cos 2ζ) u = 0
//!
//! ζ half the phase of the RF, so that a period is π; k half the drag rate over half the RF's angular frequency.

use std::f64::consts::PI;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::integrator::scheme::{BLANES_MOAN_6, BLANES_MOAN_14, Scheme};

/// What becomes of motions, one row for each value of a and in it one entry for each value of q.
#[derive(Clone, Debug, PartialEq)]
pub struct StabilityMap {
    /// a of each row.
    pub a: Vec<f64>,
    /// q of each entry of a row.
    pub q: Vec<f64>,
    /// What was found, `a × q`: see who made the map.
    pub value: Vec<f64>,
    /// Motions stay bounded where the size of the value is below this.
    pub limit: f64,
}

impl StabilityMap {
    /// Whether motions at the i-th a and j-th q stay bounded.
    ///
    /// # Panics
    /// There is no such entry.
    pub fn is_stable(&self, i: usize, j: usize) -> bool {
        self.value[i * self.q.len() + j].abs() < self.limit
    }
}

/// The map by Floquet's theorem: `value` is half the trace of the map of (u, u') over one period at a - k², which is cos(πβ) of
/// the undamped motion, and motions stay bounded while it is below cosh(πk).
///
/// Half a period is integrated: with an even drive, half the trace is u₁ u₂' + u₂ u₁' of the two principal solutions at π/2. The
/// error of the value is below 1e-9 of its size and of one for |a| + 2 |q| up to 20.
///
/// Source: McLachlan 1947, chapter IV; with drag, u = e^(-kζ) w. Checked by `exact_stability_by_floquet`.
pub fn mathieu_map(a: &[f64], q: &[f64], k: f64) -> StabilityMap {
    let steepest =
        a.iter().fold(0.0_f64, |m, a| m.max((a - k * k).abs())) + 2.0 * q.iter().fold(0.0_f64, |m, q| m.max(q.abs()));
    // Steps of a period's sixteenth where the motion is as fast as the RF.
    let steps = (10.0 * (0.5 * steepest).sqrt().max(1.0)).ceil() as usize;
    let value = rows(a, q, |a, value| {
        let kicks = Kicks::new(&BLANES_MOAN_14, a - k * k, 0.5 * PI, steps);
        let fly = |start: (f64, f64)| kicks.fly(q, start, 1);
        let (cosine, sine) = (fly((1.0, 0.0)), fly((0.0, 1.0)));
        for (j, value) in value.iter_mut().enumerate() {
            *value = cosine.u[j] * sine.v[j] + sine.u[j] * cosine.v[j];
        }
    });
    StabilityMap { a: a.to_vec(), q: q.to_vec(), value, limit: (PI * k).cosh() }
}

/// Steps of a period in [`mathieu_map_by_flights`]: limits of the first region move by less than 1e-5.
const STEPS: usize = 4;

/// The map by flying from (u, u') = (1, 0) without drag: `value` is the largest size of u at the end of any of so many periods, and
/// motions count as bounded while it is below `limit`.
///
/// A judge that knows no theorem, and as blunt as it is: close to the limits motions grow slowly or beat widely. Checked by
/// `exact_stability_by_flights`.
pub fn mathieu_map_by_flights(a: &[f64], q: &[f64], periods: usize, limit: f64) -> StabilityMap {
    let value = rows(a, q, |a, value| {
        value.copy_from_slice(&Kicks::new(&BLANES_MOAN_6, a, PI, STEPS).fly(q, (1.0, 0.0), periods).peak);
    });
    StabilityMap { a: a.to_vec(), q: q.to_vec(), value, limit }
}

fn rows(a: &[f64], q: &[f64], row: impl Fn(f64, &mut [f64]) + Sync) -> Vec<f64> {
    let mut value = vec![0.0; a.len() * q.len()];
    if !q.is_empty() {
        value.par_chunks_mut(q.len()).zip(a).for_each(|(value, &a)| row(a, value));
    }
    value
}

/// Flights and kicks over some time, for one a:  u += shift v;  v += (steady + sway q) u.
struct Kicks {
    parts: Vec<Part>,
    arch: Arch,
}

struct Part {
    shift: f64,
    steady: f64,
    sway: f64,
}

/// u and u' at the end, and the largest |u| at ends of periods.
struct Flown {
    u: Vec<f64>,
    v: Vec<f64>,
    peak: Vec<f64>,
}

impl Kicks {
    fn new(scheme: &Scheme, a: f64, time: f64, steps: usize) -> Self {
        let step = time / steps as f64;
        let mut parts: Vec<Part> = Vec::new();
        let mut put = |shift: f64, at: f64, kick: f64| {
            let (steady, sway) = (-a * kick, 2.0 * kick * (2.0 * at).cos());
            match parts.last_mut() {
                // Two kicks in a row are one.
                Some(last) if shift == 0.0 => {
                    last.steady += steady;
                    last.sway += sway;
                }
                _ => parts.push(Part { shift, steady, sway }),
            }
        };
        for n in 0..steps {
            let mut at = n as f64 * step;
            let outer = usize::from(scheme.outer_kicks);
            if scheme.outer_kicks {
                put(0.0, at, scheme.kick(0) * step);
            }
            for flight in 0..scheme.flights() {
                let shift = scheme.flight(flight) * step;
                at += shift;
                let kick = if flight + outer < scheme.kicks() { scheme.kick(flight + outer) * step } else { 0.0 };
                put(shift, at, kick);
            }
        }
        Self { parts, arch: Arch::new() }
    }

    fn fly(&self, q: &[f64], start: (f64, f64), repeats: usize) -> Flown {
        // Filled up to whole groups of vectors of any width.
        let padded = q.len().div_ceil(GROUP) * GROUP;
        let mut all = vec![0.0; 4 * padded];
        let (lists, peak) = all.split_at_mut(3 * padded);
        let (lists, v) = lists.split_at_mut(2 * padded);
        let (filled, u) = lists.split_at_mut(padded);
        filled[..q.len()].copy_from_slice(q);
        u.fill(start.0);
        v.fill(start.1);
        self.arch.dispatch(Row { parts: &self.parts, q: filled, u, v, peak, repeats });
        let cut = |list: &[f64]| list[..q.len()].to_vec();
        Flown { u: cut(u), v: cut(v), peak: cut(peak) }
    }
}

/// Numbers that fly together: four of the widest vectors.
const GROUP: usize = 32;

struct Row<'a> {
    parts: &'a [Part],
    q: &'a [f64],
    u: &'a mut [f64],
    v: &'a mut [f64],
    peak: &'a mut [f64],
    repeats: usize,
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        /// Vectors whose chains of operations overlap.
        const T: usize = 4;
        let (q, _) = S::as_simd_f64s(self.q);
        let (us, _) = S::as_mut_simd_f64s(self.u);
        let (vs, _) = S::as_mut_simd_f64s(self.v);
        let (peaks, _) = S::as_mut_simd_f64s(self.peak);
        for first in (0..q.len()).step_by(T) {
            let q: [S::f64s; T] = std::array::from_fn(|t| q[first + t]);
            let mut u: [S::f64s; T] = std::array::from_fn(|t| us[first + t]);
            let mut v: [S::f64s; T] = std::array::from_fn(|t| vs[first + t]);
            let mut peak: [S::f64s; T] = std::array::from_fn(|t| peaks[first + t]);
            for _ in 0..self.repeats {
                for part in self.parts {
                    let (shift, steady, sway) =
                        (simd.splat_f64s(part.shift), simd.splat_f64s(part.steady), simd.splat_f64s(part.sway));
                    for t in 0..T {
                        u[t] = simd.mul_add_f64s(shift, v[t], u[t]);
                        v[t] = simd.mul_add_f64s(simd.mul_add_f64s(sway, q[t], steady), u[t], v[t]);
                    }
                }
                for t in 0..T {
                    // The larger of two numbers; what is not a number counts as large.
                    let size = simd.abs_f64s(u[t]);
                    let less = simd.less_than_f64s(size, peak[t]);
                    peak[t] = simd.select_f64s(less, peak[t], size);
                }
            }
            for (list, values) in [(&mut *us, u), (&mut *vs, v), (&mut *peaks, peak)] {
                for (to, from) in list[first..first + T].iter_mut().zip(values) {
                    *to = from;
                }
            }
        }
    }
}
