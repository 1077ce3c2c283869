//! Motion close to an equilibrium: its frequencies, whether it is held, and how fast it dies away.
//!
//! Three ways to the same numbers: the transition matrix over a period of the real field ([`Neighbourhood::equilibrium`]), Mathieu's
//! equation on each axis by itself ([`Mathieu`]), and the spectrum of a grain that was traced ([`traced()`]).

pub mod mathieu;
pub mod modes;
pub mod traced;

use field::Waveform;
use field::analysis::Expansion;
use meshes::Vec3;
use nalgebra::{Complex, Matrix3, Matrix6, Vector6};

use crate::{DragError, System};

pub use mathieu::Mathieu;
pub use modes::{Mode, modes};
pub use traced::{effective, traced};

/// A grain close to a point of a driven field: the exact field about the point, and everything else that is linear.
#[derive(Clone, Debug)]
pub struct Neighbourhood<'a> {
    /// The unit potentials about the point.
    pub expansion: &'a Expansion,
    /// Voltage of each channel.
    pub waveforms: &'a [Waveform],
    /// Q/m, C/kg.
    pub specific_charge: f64,
    /// Drag rate γ, 1/s.
    pub rate: f64,
    /// Of gravity and constant forces, m/s².
    pub acceleration: Vec3,
    /// B, T.
    pub magnetic_field: Vec3,
    /// Common period of all voltages, s; none where all are constant.
    pub period: Option<f64>,
}

/// A periodic orbit (a point where nothing oscillates) and the linear motion about it.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// At the start of a period, m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// Half the largest extent of the orbit: the amplitude of the micromotion at the equilibrium, m.
    pub excursion: f64,
    /// The modes of the motion about it.
    pub modes: Vec<Mode>,
}

/// Steps of a period: doubling them and extrapolating leaves some 1e-10 of the matrix.
const STEPS: usize = 400;

/// Steps of a period where only stability is asked for.
const COARSE_STEPS: usize = 60;

/// Steps of Newton's method for the orbit.
const ROUNDS: usize = 12;

impl System {
    /// γ of a grain's drag, 1/s.
    ///
    /// # Errors
    /// A drag that needs what the grain does not have.
    pub fn drag_rate(&self, mass: f64, radius: f64) -> Result<f64, DragError> {
        Ok(self.linear(0.0, mass, radius)?.rate)
    }
}

impl Neighbourhood<'_> {
    /// The periodic orbit next to a point, found by Newton's method on the map over a period (shooting), and the motion about
    /// it by the same map's derivative (Floquet 1883). Velocities count in units of position per period (or per second).
    ///
    /// `None` where there is no orbit within the ball of the expansion.
    pub fn equilibrium(&self, start: &Vec3) -> Option<Equilibrium> {
        let Some(period) = self.period else { return self.rest(start) };
        let (position, velocity, coarse) = self.orbit(start, period, STEPS)?;
        let fine = self.flow(&position, &velocity, period, 2 * STEPS)?;
        // Richardson: the scheme is of order four.
        let better = fine.matrix + (fine.matrix - coarse.matrix) / 15.0;
        let modes = modes::of_period(&better, &fine.matrix, period);
        Some(Equilibrium { position, velocity, excursion: fine.excursion, modes })
    }

    /// How far the motion next to a point is from the edge of stability: below zero it stays bounded, and through zero it goes
    /// evenly as voltages change. `None` without a period, or where there is no orbit within the ball of the expansion.
    ///
    ///   max |(μ + 1/μ) / 2| - cosh(γT/2)
    ///
    /// over the multipliers μ of the map over a period T, times e^(γT/2): then they come in pairs μ, 1/μ. On one axis it is
    /// half the trace of [`mathieu_map`](crate::stability::mathieu_map) and its limit. With sixty steps a period the edge is good
    /// for 1e-5 of the voltages. Source: Floquet 1883. Checked by `the_edge_is_that_of_mathieu`.
    pub fn excess(&self, start: &Vec3) -> Option<f64> {
        let period = self.period?;
        // Steps that meet jumps err more.
        let smooth = self.waveforms.iter().all(|w| w.next_corner(0.0).is_infinite());
        let steps = if smooth { COARSE_STEPS } else { 4 * COARSE_STEPS };
        let (_, _, flown) = self.orbit(start, period, steps)?;
        let shrunk = (0.5 * self.rate * period).exp();
        let size = |multiplier: Complex<f64>| {
            let half = (multiplier + multiplier.inv()) * 0.5;
            // Four of them, off the circle and off the axis: two modes drive each other.
            if half.im.abs() > 1e-5 * (1.0 + half.re.abs()) { multiplier.norm().ln().cosh() } else { half.re.abs() }
        };
        let largest = flown.matrix.complex_eigenvalues().iter().map(|z| size(z * shrunk)).fold(0.0, f64::max);
        largest.is_finite().then(|| largest - (0.5 * self.rate * period).cosh())
    }

    /// The periodic orbit next to a point, as position and velocity, with a flight along it.
    fn orbit(&self, start: &Vec3, period: f64, steps: usize) -> Option<(Vec3, Vec3, Flown)> {
        let (mut position, mut velocity) = (*start, Vec3::zeros());
        let mut flown = self.flow(&position, &velocity, period, steps)?;
        for _ in 0..ROUNDS {
            let miss = Vector6::from_iterator(
                (flown.position - position).iter().chain(((flown.velocity - velocity) * period).iter()).copied(),
            );
            let step = (Matrix6::identity() - flown.matrix).lu().solve(&miss)?;
            position += step.fixed_rows::<3>(0);
            velocity += step.fixed_rows::<3>(3) / period;
            if (position - self.expansion.center).norm() > self.expansion.radius || !step.norm().is_finite() {
                return None;
            }
            if step.norm() < 1e-12 * self.expansion.radius {
                break;
            }
            flown = self.flow(&position, &velocity, period, steps)?;
        }
        Some((position, velocity, flown))
    }

    /// The point of rest of a static field.
    fn rest(&self, start: &Vec3) -> Option<Equilibrium> {
        let mut position = *start;
        for _ in 0..ROUNDS {
            let (force, slope) = self.push(0.0, &position);
            let step = -slope.try_inverse()? * force;
            position += step;
            if (position - self.expansion.center).norm() > self.expansion.radius || !step.norm().is_finite() {
                return None;
            }
            if step.norm() < 1e-13 * self.expansion.radius {
                break;
            }
        }
        let (_, slope) = self.push(0.0, &position);
        let mut generator = Matrix6::zeros();
        // Velocities in positions per time of the fastest motion: entries of one size, or the eigenvalues lose their digits.
        let time = 1.0 / slope.norm().sqrt().max(self.turning().norm()).max(f64::MIN_POSITIVE);
        generator.fixed_view_mut::<3, 3>(0, 3).copy_from(&(Matrix3::identity() / time));
        generator.fixed_view_mut::<3, 3>(3, 0).copy_from(&(slope * time));
        generator.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.turning());
        let modes = modes::of_generator(&generator);
        Some(Equilibrium { position, velocity: Vec3::zeros(), excursion: 0.0, modes })
    }

    /// Acceleration by all that does not depend on the velocity, and its derivative in space.
    fn push(&self, time: f64, position: &Vec3) -> (Vec3, Matrix3<f64>) {
        self.pushed(time, &self.expansion.slopes(position))
    }

    fn pushed(&self, time: f64, slopes: &[(Vec3, Matrix3<f64>)]) -> (Vec3, Matrix3<f64>) {
        let (mut force, mut bend) = (self.acceleration, Matrix3::zeros());
        for ((slope, hessian), waveform) in slopes.iter().zip(self.waveforms) {
            let volts = self.specific_charge * waveform.value(time);
            force -= slope * volts;
            bend -= hessian * volts;
        }
        (force, bend)
    }

    /// What turns and slows velocities: v' = -γ v + (Q/m) v × B.
    fn turning(&self) -> Matrix3<f64> {
        Matrix3::identity() * -self.rate - self.magnetic_field.cross_matrix() * self.specific_charge
    }

    /// Flies over some time with the matrix of neighbouring flights, by the classical scheme of order four (Kutta 1901).
    fn flow(&self, position: &Vec3, velocity: &Vec3, time: f64, steps: usize) -> Option<Flown> {
        let h = time / steps as f64;
        let turning = self.turning();
        let mut flown = Flown { position: *position, velocity: *velocity, matrix: Matrix6::identity(), excursion: 0.0 };
        // A grain at rest in a null asks for the same derivatives again and again.
        let mut cache = (*position, self.expansion.slopes(position));
        let mut rates = |t: f64, state: &Flown| -> (Vec3, Vec3, Matrix6<f64>) {
            if cache.0 != state.position {
                cache = (state.position, self.expansion.slopes(&state.position));
            }
            let (force, bend) = self.pushed(t, &cache.1);
            let mut generator = Matrix6::zeros();
            // Velocities are stretched by the time.
            generator.fixed_view_mut::<3, 3>(0, 3).copy_from(&(Matrix3::identity() / time));
            generator.fixed_view_mut::<3, 3>(3, 0).copy_from(&(bend * time));
            generator.fixed_view_mut::<3, 3>(3, 3).copy_from(&turning);
            (state.velocity, force + turning * state.velocity, generator * state.matrix)
        };
        let moved = |from: &Flown, by: &(Vec3, Vec3, Matrix6<f64>), h: f64| Flown {
            position: from.position + by.0 * h,
            velocity: from.velocity + by.1 * h,
            matrix: from.matrix + by.2 * h,
            excursion: from.excursion,
        };
        let (mut low, mut high) = (*position, *position);
        for n in 0..steps {
            let t = n as f64 * h;
            let k1 = rates(t, &flown);
            let k2 = rates(t + 0.5 * h, &moved(&flown, &k1, 0.5 * h));
            let k3 = rates(t + 0.5 * h, &moved(&flown, &k2, 0.5 * h));
            let k4 = rates(t + h, &moved(&flown, &k3, h));
            for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                flown = moved(&flown, &k, weight * h / 6.0);
            }
            if (flown.position - self.expansion.center).norm() > self.expansion.radius {
                return None;
            }
            (low, high) = (low.inf(&flown.position), high.sup(&flown.position));
        }
        flown.excursion = 0.5 * (high - low).norm();
        flown.matrix.iter().all(|x| x.is_finite()).then_some(flown)
    }
}

#[derive(Clone, Debug)]
struct Flown {
    position: Vec3,
    velocity: Vec3,
    matrix: Matrix6<f64>,
    excursion: f64,
}

/// The shortest time that is a whole number of periods of every frequency (Hz), if these are as small multiples of something.
pub fn common_period(frequencies: &[f64]) -> Option<f64> {
    let slowest = frequencies.iter().copied().reduce(f64::min)?;
    // Beyond a hundred turns a matrix over the common period says little about the motion between.
    (1..=100).map(f64::from).find_map(|turns| {
        let whole = |f: &f64| {
            let n = f * turns / slowest;
            (n - n.round()).abs() < 1e-9 * n
        };
        frequencies.iter().all(whole).then_some(turns / slowest)
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use field::{QuadraticField, WaveformPart};

    use super::*;

    fn expansion() -> Expansion {
        Expansion::near(&QuadraticField::quadrupole(Vec3::new(1.0, 1.0, -2.0), 1.0), Vec3::zeros(), 10.0)
    }

    fn near<'a>(expansion: &'a Expansion, waveforms: &'a [Waveform], period: Option<f64>) -> Neighbourhood<'a> {
        Neighbourhood {
            expansion,
            waveforms,
            specific_charge: 1.0,
            rate: 0.0,
            acceleration: Vec3::zeros(),
            magnetic_field: Vec3::zeros(),
            period,
        }
    }

    fn driven(dc: f64, amplitude: f64) -> Vec<Waveform> {
        let part = WaveformPart::Sine { amplitude, frequency: 1.0 / TAU, phase: 0.3 };
        vec![Waveform { constant: dc, parts: vec![part] }]
    }

    /// β of Mathieu's equation (physics: 20 digits in `tests/reference/mathieu.json`, trap3d of tables 3 and 4): a_z = -4e-4,
    /// q_z = 0.4 at Ω = 1 rad/s.
    #[test]
    fn exact_frequencies_of_the_ideal_trap() {
        let (expansion, waveforms) = (expansion(), driven(5e-5, 0.1));
        let all = near(&expansion, &waveforms, Some(TAU)).equilibrium(&Vec3::zeros()).unwrap();
        let mut betas: Vec<f64> = all.modes.iter().map(|m| m.frequency * 2.0 * TAU).collect();
        betas.sort_by(f64::total_cmp);
        for (beta, exact) in betas.iter().zip([0.143_265_7, 0.143_265_7, 0.291_815_7]) {
            // The seven digits that are quoted.
            assert!((beta - exact).abs() < 1e-7, "{beta} {exact}");
        }
        assert!(all.modes.iter().all(|m| m.is_held() && m.frequency_error < 1e-8 && m.rate.abs() < 1e-9), "{all:#?}");
    }

    #[test]
    fn drag_and_gravity() {
        // Beside the null a grain under gravity sits on an orbit; the frequencies of a linear field do not change, and drag makes
        // a of Mathieu's equation smaller by (γ/Ω)².
        let (expansion, waveforms) = (expansion(), driven(0.0, 0.1));
        let mut problem = near(&expansion, &waveforms, Some(TAU));
        problem.rate = 0.05;
        problem.acceleration = Vec3::z() * -1e-3;
        let all = problem.equilibrium(&Vec3::zeros()).unwrap();
        let along = all.modes.iter().max_by(|a, b| a.axis.z.abs().total_cmp(&b.axis.z.abs())).unwrap();
        let mathieu = Mathieu { a: 0.0, q: 0.4, k: 0.05 };
        let beta = mathieu.beta().unwrap();
        assert!((along.frequency * 2.0 * TAU / beta - 1.0).abs() < 1e-7, "{along:?} {beta}");
        assert!((along.rate - 0.025).abs() < 1e-9 && along.is_held());
        // z = -g/ω² but for higher orders of q, and micromotion of q/2 of that.
        let well = 2.0 * 0.1_f64.powi(2);
        assert!((all.position.z * well / -1e-3 - 1.0).abs() < 0.4, "{}", all.position.z);
        assert!(all.excursion > 0.1 * all.position.z.abs() && all.excursion < 0.4 * all.position.z.abs());
    }

    #[test]
    fn exact_frequencies_of_a_penning_trap() {
        // φ = U (2z² - x² - y²)/2: w_z² = 2U, w± = (w_c ± sqrt(w_c² - 2 w_z²))/2, for any direction of B their squares add up.
        let expansion = expansion();
        let waveforms = [Waveform::constant(-0.02)];
        let mut problem = near(&expansion, &waveforms, None);
        problem.magnetic_field = Vec3::z();
        let mut got: Vec<f64> =
            problem.equilibrium(&Vec3::repeat(0.01)).unwrap().modes.iter().map(|m| m.frequency * TAU).collect();
        got.sort_by(f64::total_cmp);
        let (axial, root) = (0.04_f64, (1.0_f64 - 0.08).sqrt());
        for (got, exact) in got.iter().zip([0.5 * (1.0 - root), axial.sqrt(), 0.5 * (1.0 + root)]) {
            assert!((got / exact - 1.0).abs() < 1e-10, "{got} {exact}");
        }
        problem.magnetic_field = Vec3::new(0.1, 0.05, 0.99);
        let squares: f64 =
            problem.equilibrium(&Vec3::zeros()).unwrap().modes.iter().map(|m| (m.frequency * TAU).powi(2)).sum();
        // The invariance theorem (Brown and Gabrielse 1982).
        assert!((squares / problem.magnetic_field.norm_squared() - 1.0).abs() < 1e-10);
        // Without a magnetic field two directions are not held.
        problem.magnetic_field = Vec3::zeros();
        let modes = problem.equilibrium(&Vec3::zeros()).unwrap().modes;
        assert_eq!(modes.iter().filter(|m| m.is_held()).count(), 1, "{modes:#?}");
        assert!(modes.iter().any(|m| (m.rate + 0.02_f64.sqrt()).abs() < 1e-10));
    }

    #[test]
    fn the_edge_is_that_of_mathieu() {
        let expansion = expansion();
        for rate in [0.0, 0.1] {
            for (a, q) in [(0.0, 0.3), (0.0, 0.907), (0.0, 0.909), (-0.02, 0.1), (-0.02, 0.25), (0.1, 0.5), (-0.6, 1.2)]
            {
                // On z a = -8 U, q = 4 V at Ω = 1 rad/s; half of it, the other way, on x and y.
                let waveforms = driven(-a / 8.0, q / 4.0);
                let mut problem = near(&expansion, &waveforms, Some(TAU));
                problem.rate = rate;
                let map = |factor: f64| crate::stability::mathieu_map(&[a * factor], &[q * factor], rate);
                let exact = [1.0, -0.5].map(|f| map(f).value[0].abs() - map(f).limit).into_iter().fold(-9.0, f64::max);
                let got = problem.excess(&Vec3::zeros()).unwrap();
                // Sixty steps of order four: (2π/60)^4 / 120 of the value.
                assert!((got - exact).abs() < 2e-5 * (1.0 + exact.abs()), "{rate} {a} {q}: {got} {exact}");
            }
        }
    }

    #[test]
    fn periods_in_common() {
        assert_eq!(common_period(&[60.0]), Some(1.0 / 60.0));
        assert!((common_period(&[60.0, 90.0]).unwrap() - 1.0 / 30.0).abs() < 1e-15);
        assert_eq!(common_period(&[1.0, 2.0_f64.sqrt()]), None);
    }
}
