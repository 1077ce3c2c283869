//! Kicks and free flights in a force that is linear in the position: many steps of many grains without leaving registers.

use pulp::{Arch, Simd, WithSimd};

use super::scheme::Scheme;
use super::splitting::paths_between;
use super::{Integrator, IntegratorNature};
use crate::block::Block;
use crate::force::linear_form::LinearForm;
use crate::linear::{Linear, LinearFlow};
use crate::path::Path;

/// The same schemes as [`super::splitting::Splitting`], to rounding, for forces of a [`LinearForm`] with drag:
///
///   r += s_n v,  v *= e_n;  v -= [(Q/m) b_n h H(t)] r,  v += (Q/m) b_n h E(t) + b_n h (g + F₀/m)
///
/// for each flight and kick of the step, axis by axis. All grains of a block are at the same time, so that the coefficients
/// are found once for all of them; a vector holds the same coordinate of neighbouring grains, and a few vectors fly over all
/// stages of many steps before the next ones do. A grain's numbers do not depend on its neighbours, on the width of the
/// vectors, or on how many steps are taken at once. Checked by `law_linear_forces_fly_as_others_do`.
///
/// *Why Q/m multiplies the coefficient and not the position:* where all grains of a block have the same, it does so once for
/// all of them, which saves a third of the work and gives the same bits.
pub(crate) struct LinearSplitting {
    scheme: &'static Scheme,
    form: LinearForm,
    /// Neither a uniform field nor gravity nor a constant force.
    unpushed: bool,
    stages: Vec<Stage>,
    kicks: Vec<Kick>,
    lanes: Lanes,
    arch: Arch,
}

/// A flight and the kick after it.
struct Stage {
    /// Which of the flights of different lengths.
    flight: usize,
    /// When the kick comes, in steps.
    at: f64,
    /// The kick, in steps; the last flight of schemes that end with one has none.
    kick: f64,
}

/// A kick on a charge of 1 C and a mass of 1 kg, and the flight before it.
#[derive(Clone, Copy, Default)]
struct Kick {
    /// -b h Σ V H along the axes, 1/s.
    slope: [f64; 3],
    /// b h Σ V s, m/s.
    push: [f64; 3],
    /// b h, s.
    time: f64,
    /// How far the flight before it goes at unit speed without drag, s.
    shift: f64,
    /// Which of the flights of different lengths that is.
    flight: usize,
}

/// The grains in arrays of their own, filled up to whole vectors.
#[derive(Default)]
struct Lanes {
    /// x, y, z of the position at the start, then of the velocity.
    start: [Vec<f64>; 6],
    /// The same at the end.
    end: [Vec<f64>; 6],
    /// Q/m, C/kg.
    charge: Vec<f64>,
    /// g + F₀/m along each axis, m/s².
    push: [Vec<f64>; 3],
    /// Squares of the farthest from the start (m²) and of the fastest (m²/s²) at ends of steps.
    far: Vec<f64>,
    fast: Vec<f64>,
    damped: bool,
    /// All have the same Q/m.
    uniform: bool,
    /// For each length of flight: how far one goes at unit speed, s, and the part of the speed that is left.
    flights: Vec<(Vec<f64>, Vec<f64>)>,
    /// What `flights` were found for.
    of: (Vec<Linear>, f64),
}

/// Numbers that lists are filled up to a multiple of: the widest vector.
const WIDTH: usize = 8;

impl LinearSplitting {
    pub fn new(scheme: &'static Scheme, form: LinearForm) -> Self {
        let mut stages = Vec::new();
        let mut at = 0.0;
        if scheme.outer_kicks {
            // A flight of no length before the first kick.
            stages.push(Stage { flight: scheme.lengths().len(), at: 0.0, kick: scheme.kick(0) });
        }
        for flight in 0..scheme.flights() {
            at += scheme.flight(flight);
            let number = flight + usize::from(scheme.outer_kicks);
            let kick = if number < scheme.kicks() { scheme.kick(number) } else { 0.0 };
            stages.push(Stage { flight: scheme.length_of(flight), at, kick });
        }
        Self {
            unpushed: form.channels.iter().all(|c| c.field == meshes::Vec3::zeros())
                && form.acceleration == meshes::Vec3::zeros()
                && form.force == meshes::Vec3::zeros(),
            scheme,
            form,
            stages,
            kicks: Vec::new(),
            lanes: Lanes::default(),
            arch: Arch::new(),
        }
    }

    /// The kicks of steps of length `step` from `start` to each of `ends` (s). Returns bounds of |Σ V H| and |Σ V s|.
    fn find_kicks(&mut self, block: &Block, start: f64, step: f64, ends: &[f64]) -> (f64, f64) {
        self.kicks.clear();
        let (mut from, mut steepest, mut strongest) = (start, 0.0_f64, 0.0_f64);
        for &end in ends {
            for stage in &self.stages {
                let lengths = self.scheme.lengths();
                let shift = lengths.get(stage.flight).map_or(0.0, |part| part * step);
                let mut kick = Kick { shift, flight: stage.flight, ..Kick::default() };
                if stage.kick != 0.0 {
                    let (slope, field) = self.form.at(block.forces.within(from + stage.at * step, from, end));
                    kick.time = stage.kick * step;
                    kick.slope = (slope * -kick.time).into();
                    kick.push = (field * kick.time).into();
                    steepest = steepest.max(slope.amax());
                    strongest = strongest.max(field.amax());
                }
                self.kicks.push(kick);
            }
            from = end;
        }
        // Of the largest component; a vector is up to sqrt(3) longer.
        (steepest, strongest * 3.0_f64.sqrt())
    }
}

impl Integrator for LinearSplitting {
    fn nature(&self) -> IntegratorNature {
        IntegratorNature {
            order: self.scheme.order,
            adaptive: false,
            dense: false,
            random: false,
            starts_from_force: false,
        }
    }

    fn advance(&mut self, block: &mut Block) {
        let end = block.trial.first().map_or(0.0, |trial| trial.end);
        self.leap(block, &[end]);
    }

    fn leap(&mut self, block: &mut Block, ends: &[f64]) -> bool {
        let (Some(trial), Some(state), Some(&last)) = (block.trial.first(), block.state.first(), ends.last()) else {
            return true;
        };
        let (start, step) = (state.time, trial.step);
        let (steepest, strongest) = self.find_kicks(block, start, step, ends);
        self.lanes.fill(block, self.scheme, &self.form, step);
        if self.lanes.uniform && self.unpushed {
            let charge = self.lanes.charge[0];
            for kick in &mut self.kicks {
                kick.slope = kick.slope.map(|slope| charge * slope);
            }
        }
        let flight = Flight { stages: self.stages.len(), kicks: &self.kicks, lanes: &mut self.lanes };
        match (flight.lanes.damped, self.unpushed, flight.lanes.uniform) {
            (false, true, true) => self.arch.dispatch(Variant::<false, false, true>(flight)),
            (false, true, false) => self.arch.dispatch(Variant::<false, false, false>(flight)),
            (false, false, _) => self.arch.dispatch(Variant::<false, true, false>(flight)),
            (true, true, true) => self.arch.dispatch(Variant::<true, false, true>(flight)),
            (true, true, false) => self.arch.dispatch(Variant::<true, false, false>(flight)),
            (true, false, _) => self.arch.dispatch(Variant::<true, true, false>(flight)),
        }
        let kicks = self.stages.iter().filter(|s| s.kick != 0.0).count();
        block.forces.evaluations += (block.len() * ends.len() * kicks) as u64;
        for (lane, trial) in block.trial.iter_mut().enumerate() {
            let (state, l) = (&block.state[lane], &self.lanes);
            let [x, y, z, vx, vy, vz] = [0, 1, 2, 3, 4, 5].map(|k| l.end[k][lane]);
            trial.motion.position = meshes::Vec3::new(x, y, z);
            trial.motion.velocity = meshes::Vec3::new(vx, vy, vz);
            trial.end = last;
            trial.steps = ends.len() as u64;
            trial.fresh = false;
            // Between ends of steps a grain is not farther from them than its speed, and what forces add to it, take it.
            let (far, fast) = (l.far[lane].sqrt(), l.fast[lane].sqrt().max(state.motion.velocity.norm()));
            let out = state.motion.position.norm() + far + fast * step;
            let push = [0, 1, 2].map(|k| l.push[k][lane]);
            let pull = l.charge[lane].abs() * (steepest * out + strongest)
                + push.iter().map(|p| p * p).sum::<f64>().sqrt()
                + block.linear[lane].rate * fast;
            trial.reach = far + step * (fast + step * pull);
        }
        true
    }

    fn paths(&mut self, block: &mut Block, lanes: &[usize], paths: &mut Vec<Path>) {
        // The accelerations at the ends serve events alone; which ways are looked at depends on how many steps were tried at
        // once, and the count of forces must not.
        let evaluations = block.forces.evaluations;
        paths_between(block, lanes, paths, false);
        block.forces.evaluations = evaluations;
    }
}

impl Lanes {
    fn fill(&mut self, block: &Block, scheme: &Scheme, form: &LinearForm, step: f64) {
        let padded = block.len().div_ceil(WIDTH) * WIDTH;
        for k in 0..6 {
            self.start[k].clear();
            self.start[k].extend(block.state.iter().map(|s| {
                let m = &s.motion;
                if k < 3 { m.position[k] } else { m.velocity[k - 3] }
            }));
            self.start[k].resize(padded, 0.0);
            self.end[k].resize(padded, 0.0);
        }
        for list in [&mut self.far, &mut self.fast] {
            list.resize(padded, 0.0);
        }
        if self.of.0 == block.linear && self.of.1 == step && self.charge.len() == padded {
            return;
        }
        self.charge.clear();
        self.charge.extend(block.forces.charge.iter().zip(&block.forces.mass).map(|(q, m)| q / m));
        self.uniform = self.charge.windows(2).all(|pair| pair[0] == pair[1]);
        self.charge.resize(padded, 0.0);
        for k in 0..3 {
            self.push[k].clear();
            self.push[k].extend(block.forces.mass.iter().map(|m| form.acceleration[k] + form.force[k] / m));
            self.push[k].resize(padded, 0.0);
        }
        self.damped = block.linear.iter().any(|linear| linear.rate != 0.0);
        self.flights.clear();
        for part in scheme.lengths().iter().chain([&0.0]) {
            let flows = block.linear.iter().map(|linear| LinearFlow::new(linear, part * step).along());
            let (mut shift, mut decay): (Vec<f64>, Vec<f64>) = flows.unzip();
            shift.resize(padded, 0.0);
            decay.resize(padded, 1.0);
            self.flights.push((shift, decay));
        }
        self.of = (block.linear.clone(), step);
    }
}

/// What is to be flown: `kicks` has one entry for each stage of each step.
struct Flight<'a> {
    /// Of one step.
    stages: usize,
    kicks: &'a [Kick],
    lanes: &'a mut Lanes,
}

struct Variant<'a, const DAMPED: bool, const PUSHED: bool, const UNIFORM: bool>(Flight<'a>);

impl<const DAMPED: bool, const PUSHED: bool, const UNIFORM: bool> WithSimd for Variant<'_, DAMPED, PUSHED, UNIFORM> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut flight = self.0;
        let vectors = flight.lanes.charge.len() / S::F64_LANES;
        let mut first = 0;
        // Two vectors of each number stay in 16 registers, and their chains of operations overlap. (Three would fit in 32; they
        // were slower.)
        while first + 2 <= vectors {
            fly::<S, 2, DAMPED, PUSHED, UNIFORM>(simd, &mut flight, first);
            first += 2;
        }
        while first < vectors {
            fly::<S, 1, DAMPED, PUSHED, UNIFORM>(simd, &mut flight, first);
            first += 1;
        }
    }
}

/// Flies `T` vectors of grains over all steps.
#[allow(clippy::needless_range_loop)] // one index runs over several arrays
#[inline(always)]
fn fly<S: Simd, const T: usize, const DAMPED: bool, const PUSHED: bool, const UNIFORM: bool>(
    simd: S,
    flight: &mut Flight,
    first: usize,
) {
    let Flight { stages, kicks, lanes } = flight;
    let load = |list: &[f64]| -> [S::f64s; T] {
        let (list, _) = S::as_simd_f64s(list);
        std::array::from_fn(|t| list[first + t])
    };
    let mut x: [[S::f64s; T]; 3] = std::array::from_fn(|k| load(&lanes.start[k]));
    let mut v: [[S::f64s; T]; 3] = std::array::from_fn(|k| load(&lanes.start[3 + k]));
    let charge = load(&lanes.charge);
    let zero = simd.splat_f64s(0.0);
    let (mut far, mut fast) = ([zero; T], [zero; T]);
    for kicks in kicks.chunks_exact(*stages) {
        for kick in kicks {
            if DAMPED {
                let (shifts, decays) = &lanes.flights[kick.flight];
                let (shift, decay) = (load(shifts), load(decays));
                for t in 0..T {
                    for k in 0..3 {
                        x[k][t] = simd.mul_add_f64s(shift[t], v[k][t], x[k][t]);
                        v[k][t] = simd.mul_f64s(decay[t], v[k][t]);
                    }
                }
            } else {
                // The same for all grains.
                let shift = simd.splat_f64s(kick.shift);
                for t in 0..T {
                    for k in 0..3 {
                        x[k][t] = simd.mul_add_f64s(shift, v[k][t], x[k][t]);
                    }
                }
            }
            for k in 0..3 {
                let slope = simd.splat_f64s(kick.slope[k]);
                for t in 0..T {
                    let slope = if UNIFORM { slope } else { simd.mul_f64s(charge[t], slope) };
                    v[k][t] = simd.mul_add_f64s(slope, x[k][t], v[k][t]);
                    if PUSHED {
                        v[k][t] = simd.mul_add_f64s(charge[t], simd.splat_f64s(kick.push[k]), v[k][t]);
                    }
                }
            }
            if PUSHED {
                let time = simd.splat_f64s(kick.time);
                for k in 0..3 {
                    let push = load(&lanes.push[k]);
                    for t in 0..T {
                        v[k][t] = simd.mul_add_f64s(time, push[t], v[k][t]);
                    }
                }
            }
        }
        let from: [[S::f64s; T]; 3] = std::array::from_fn(|k| load(&lanes.start[k]));
        for t in 0..T {
            let (mut away, mut speed) = (zero, zero);
            for k in 0..3 {
                let d = simd.sub_f64s(x[k][t], from[k][t]);
                away = simd.mul_add_f64s(d, d, away);
                speed = simd.mul_add_f64s(v[k][t], v[k][t], speed);
            }
            far[t] = simd.max_f64s(far[t], away);
            fast[t] = simd.max_f64s(fast[t], speed);
        }
    }
    // By value: references to the numbers would keep them in memory all the way.
    let store = |list: &mut [f64], values: [S::f64s; T]| {
        let (list, _) = S::as_mut_simd_f64s(list);
        for (to, from) in list[first..first + T].iter_mut().zip(values) {
            *to = from;
        }
    };
    for k in 0..3 {
        store(&mut lanes.end[k], x[k]);
        store(&mut lanes.end[3 + k], v[k]);
    }
    store(&mut lanes.far, far);
    store(&mut lanes.fast, fast);
}
