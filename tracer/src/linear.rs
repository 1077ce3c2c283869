//! Free flight with drag, magnetic field and noise: exact, for any step.

use meshes::Vec3;
use nalgebra::Complex;

/// The part of the motion that is linear in the velocity and the same everywhere:
///
///   r' = v,  v' = -γ v + ω × v
///
/// γ = c / m drag rate, 1/s; ω = -(Q/m) B cyclotron vector, rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear {
    /// γ, 1/s.
    pub rate: f64,
    /// ω, rad/s.
    pub omega: Vec3,
}

impl Linear {
    /// Acceleration at a velocity, m/s².
    pub fn acceleration(&self, v: &Vec3) -> Vec3 {
        self.omega.cross(v) - v * self.rate
    }

    /// Whether the flight is a straight line at constant speed.
    pub fn is_free(&self) -> bool {
        self.rate == 0.0 && self.omega == Vec3::zeros()
    }
}

/// The flow of [`Linear`] over a step h, of either sign.
///
/// Along ω, and across it with the plane read as complex numbers (the direction ω × is i):
///
///   v -> e^(-λh) v,  r -> r + v (1 - e^(-λh)) / λ,  λ = γ along, λ = γ - i |ω| across
///
/// Exact. Checked by `the_flow_is_that_of_the_equation`.
#[derive(Clone, Copy, Debug)]
pub struct LinearFlow {
    axis: Vec3,
    along: Pair<f64>,
    across: Pair<Complex<f64>>,
}

#[derive(Clone, Copy, Debug)]
struct Pair<T> {
    decay: T,
    shift: T,
}

impl LinearFlow {
    /// The flow over `h` (s).
    pub fn new(linear: &Linear, h: f64) -> Self {
        let (axis, size) = axis_of(&linear.omega);
        let lambda = Complex::new(linear.rate, -size);
        Self {
            axis,
            along: Pair { decay: (-linear.rate * h).exp(), shift: shift(Complex::new(linear.rate, 0.0), h).re },
            across: Pair { decay: (-lambda * h).exp(), shift: shift(lambda, h) },
        }
    }

    /// Where a grain is and how fast after the step.
    pub fn apply(&self, r: &mut Vec3, v: &mut Vec3) {
        *r += self.times(v, self.along.shift, self.across.shift);
        *v = self.turned(v);
    }

    /// The velocity after the step.
    pub fn turned(&self, v: &Vec3) -> Vec3 {
        self.times(v, self.along.decay, self.across.decay)
    }

    /// Along the magnetic field, or anywhere without one: how far a grain of 1 m/s gets, s, and the part of its speed that is
    /// left.
    pub fn along(&self) -> (f64, f64) {
        (self.along.shift, self.along.decay)
    }

    /// `along` times the part along the axis and `across` times the part across it.
    fn times(&self, v: &Vec3, along: f64, across: Complex<f64>) -> Vec3 {
        times(&self.axis, v, along, across)
    }
}

fn axis_of(omega: &Vec3) -> (Vec3, f64) {
    let size = omega.norm();
    (if size > 0.0 { omega / size } else { Vec3::z() }, size)
}

fn times(axis: &Vec3, v: &Vec3, along: f64, across: Complex<f64>) -> Vec3 {
    let parallel = axis * axis.dot(v);
    parallel * along + (v - parallel) * across.re + axis.cross(v) * across.im
}

/// (1 - e^(-λh)) / λ.
fn shift(lambda: Complex<f64>, h: f64) -> Complex<f64> {
    if lambda == Complex::ZERO { Complex::new(h, 0.0) } else { -expm1(-lambda * h) / lambda }
}

/// e^z - 1 without loss for small z.
fn expm1(z: Complex<f64>) -> Complex<f64> {
    let half = (0.5 * z.im).sin();
    Complex::new(z.re.exp_m1() * z.im.cos() - 2.0 * half * half, z.re.exp() * z.im.sin())
}

/// The flow of [`Linear`] with the noise of a gas of temperature T over a step h > 0:
///
///   dv = (-γ v + ω × v) dt + sqrt(2 γ) s dW,  s² = kB T / m
///
/// Position and velocity receive normal numbers with the exact covariances
///
///   <Δv Δv> = s² (1 - e^(-2γh)),  <Δr Δv*> = 2 γ s² ∫ S e^(-λ* u) du,  <Δr Δr*> = 2 γ s² ∫ |S|² du
///
/// with S(u) = (1 - e^(-λu)) / λ, the integrals over u from 0 to h, along ω and across it (complex) as in [`LinearFlow`].
/// So a free grain diffuses as it should whatever γ h is.
///
/// Source: Ornstein and Uhlenbeck 1930; Chandrasekhar 1943 (joint distribution); Gillespie 1996 (exact update). Checked
/// by `noise_has_the_covariances_of_many_small_steps` and `law_noise_makes_the_thermal_speed_and_free_diffusion`.
#[derive(Clone, Copy, Debug)]
pub struct NoisyFlow {
    flow: LinearFlow,
    /// Of Δv with the first random vector.
    speed: f64,
    /// Of Δr with the first random vector, along and across.
    shared: (f64, Complex<f64>),
    /// Of Δr with the second, along and across.
    own: (f64, f64),
}

impl NoisyFlow {
    /// The flow over `h` (s) of a grain whose thermal speed along one axis squared is `thermal` = kB T / m (m²/s²).
    pub fn new(linear: &Linear, thermal: f64, h: f64) -> Self {
        let size = linear.omega.norm();
        let variance = -thermal * (-2.0 * linear.rate * h).exp_m1();
        let speed = variance.sqrt();
        let strength = 2.0 * linear.rate * thermal;
        let parts = |omega: f64| {
            let (cross, spread) = integrals(Complex::new(linear.rate, -omega), h);
            if variance == 0.0 {
                return (Complex::ZERO, 0.0);
            }
            let shared = cross * (strength / speed);
            (shared, (strength * spread - shared.norm_sqr()).max(0.0).sqrt())
        };
        let (along, across) = (parts(0.0), parts(size));
        Self { flow: LinearFlow::new(linear, h), speed, shared: (along.0.re, across.0), own: (along.1, across.1) }
    }

    /// Where a grain is and how fast after the step, given two vectors of independent normal numbers.
    pub fn apply(&self, r: &mut Vec3, v: &mut Vec3, first: &Vec3, second: &Vec3) {
        self.flow.apply(r, v);
        *v += first * self.speed;
        *r += self.flow.times(first, self.shared.0, self.shared.1)
            + self.flow.times(second, self.own.0, Complex::new(self.own.1, 0.0));
    }
}

/// ∫ S(u) e^(-λ* u) du and ∫ |S(u)|² du from 0 to h, S(u) = (1 - e^(-λu)) / λ.
fn integrals(lambda: Complex<f64>, h: f64) -> (Complex<f64>, f64) {
    if lambda.norm() * h < 1.0 {
        // The closed form loses digits for small λh; eight Gauss points are exact to rounding for λh < 1.
        const NODES: [(f64, f64); 4] = [
            (0.183_434_642_495_649_8, 0.362_683_783_378_362),
            (0.525_532_409_916_329, 0.313_706_645_877_887_3),
            (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
            (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
        ];
        let (mut cross, mut spread) = (Complex::ZERO, 0.0);
        for (node, weight) in NODES {
            for x in [-node, node] {
                let u = 0.5 * h * (1.0 + x);
                let s = shift(lambda, u);
                cross += s * (-lambda.conj() * u).exp() * (0.5 * h * weight);
                spread += s.norm_sqr() * (0.5 * h * weight);
            }
        }
        return (cross, spread);
    }
    let s = shift(lambda, h);
    let double = shift(Complex::new(2.0 * lambda.re, 0.0), h).re;
    ((s.conj() - double) / lambda, (h - 2.0 * s.re + double) / lambda.norm_sqr())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vec3 {
        Vec3::new(x, y, z)
    }

    #[test]
    fn the_flow_is_that_of_the_equation() {
        for linear in [
            Linear { rate: 0.7, omega: v(0.3, -1.1, 0.4) },
            Linear { rate: 0.0, omega: v(0.0, 0.0, 2.0) },
            Linear { rate: 3.0, omega: v(0.0, 0.0, 0.0) },
            Linear { rate: 1e-9, omega: v(1e-8, 0.0, 0.0) },
            Linear::default(),
        ] {
            let at = |t: f64| {
                let (mut r, mut u) = (v(0.1, 0.2, 0.3), v(1.0, -2.0, 0.5));
                LinearFlow::new(&linear, t).apply(&mut r, &mut u);
                (r, u)
            };
            let ((r0, v0), (r1, v1), (r2, v2)) = (at(0.9), at(1.0), at(1.1));
            // The equation itself, by central differences: O(0.1²) times third derivatives of size 27.
            assert!(((r2 - r0) / 0.2 - v1).norm() < 0.05 * v1.norm() + 1e-12);
            assert!(
                ((v2 - v0) / 0.2 - linear.acceleration(&v1)).norm() < 0.05 * linear.acceleration(&v1).norm() + 1e-8
            );
            // A step is two half steps, and a step back undoes it: rounding.
            let (mut r, mut u) = (v(0.1, 0.2, 0.3), v(1.0, -2.0, 0.5));
            LinearFlow::new(&linear, 0.5).apply(&mut r, &mut u);
            LinearFlow::new(&linear, 0.5).apply(&mut r, &mut u);
            assert!((r - r1).norm() + (u - v1).norm() < 1e-14);
            LinearFlow::new(&linear, -1.0).apply(&mut r, &mut u);
            assert!((r - v(0.1, 0.2, 0.3)).norm() + (u - v(1.0, -2.0, 0.5)).norm() < 1e-13);
        }
    }

    #[test]
    fn noise_has_the_covariances_of_many_small_steps() {
        // Covariances of n steps of h/n, carried forward by the flow, are those of one step of h. The matrices are
        // propagated exactly, with unit vectors as "random" ones; 3x3 blocks [rr, rv, vv].
        let linear = Linear { rate: 0.8, omega: v(0.5, 1.5, -1.0) };
        let noise = |h: f64| {
            let flow = NoisyFlow::new(&linear, 2.0, h);
            let mut columns = Vec::new();
            for k in 0..6 {
                let (mut r, mut u) = (Vec3::zeros(), Vec3::zeros());
                let e = |on: bool| if on { Vec3::ith(k % 3, 1.0) } else { Vec3::zeros() };
                flow.apply(&mut r, &mut u, &e(k < 3), &e(k >= 3));
                columns.push((r, u));
            }
            columns
        };
        let covariance = |columns: &[(Vec3, Vec3)]| {
            let sum = |f: &dyn Fn(&(Vec3, Vec3)) -> nalgebra::Matrix3<f64>| columns.iter().map(f).sum();
            let rr: nalgebra::Matrix3<f64> = sum(&|(r, _)| r * r.transpose());
            let rv: nalgebra::Matrix3<f64> = sum(&|(r, u)| r * u.transpose());
            let vv: nalgebra::Matrix3<f64> = sum(&|(_, u)| u * u.transpose());
            (rr, rv, vv)
        };
        for (h, n) in [(0.05, 8), (0.4, 8), (3.0, 64), (20.0, 256)] {
            let step = h / n as f64;
            let flow = LinearFlow::new(&linear, step);
            let mut columns = Vec::new();
            for _ in 0..n {
                for (r, u) in &mut columns {
                    flow.apply(r, u);
                }
                columns.extend(noise(step));
            }
            let (many, one) = (covariance(&columns), covariance(&noise(h)));
            for (a, b) in [(many.0, one.0), (many.1, one.1), (many.2, one.2)] {
                // Rounding of up to 1536 columns.
                assert!((a - b).norm() < 1e-12 * b.norm(), "h = {h}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_long_step_ends_in_equilibrium() {
        let flow = NoisyFlow::new(&Linear { rate: 2.0, omega: Vec3::zeros() }, 3.0, 100.0);
        assert_eq!(flow.speed, 3.0_f64.sqrt());
        // Free diffusion: <x²> = 2 D h - 3 D / γ with D = s² / γ.
        let spread = flow.shared.0.powi(2) + flow.own.0.powi(2);
        assert!((spread - (2.0 * 1.5 * 100.0 - 3.0 * 0.75)).abs() < 1e-12 * spread);
    }
}
