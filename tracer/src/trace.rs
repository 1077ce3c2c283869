//! Whole runs.

use std::collections::BTreeMap;

use meshes::Vec3;
use rayon::prelude::*;

use crate::block::Block;
use crate::checkpoint::{Flying, Landed};
use crate::flight::{BlockResult, LEAST_TRAVEL, Loop, Run};
use crate::force::coulomb::MANY;
use crate::integrator::boris::Boris;
use crate::integrator::dop853::Dop853;
use crate::integrator::langevin::Langevin;
use crate::integrator::linear_splitting::LinearSplitting;
use crate::integrator::scheme::{BLANES_MOAN_4, BLANES_MOAN_6, BLANES_MOAN_14, Scheme, VERLET};
use crate::integrator::splitting::Splitting;
use crate::integrator::stoermer::{AdaptiveStoermer, Stoermer};
use crate::progress::Meter;
use crate::{Ending, Ensemble, ErrorEstimate, Method, Observer, Options, Standing, System, TraceError};

/// What came of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Traced {
    /// The grains at their ends.
    pub ensemble: Ensemble,
    /// How and when each flight ended, in the order of the ensemble.
    pub endings: Vec<Ending>,
    /// The integrator that was used.
    pub method: Method,
    /// Its step, s, unless it adapts.
    pub step: Option<f64>,
    /// Steps of single grains that were accepted.
    pub accepted: u64,
    /// Steps of single grains that were rejected.
    pub rejected: u64,
    /// Forces on single grains that were evaluated.
    pub force_evaluations: u64,
    /// How far off the ends are, from a few grains traced again; `None` with noise, when told not to, when stopped, and
    /// for runs of grains that feel each other when the second run would cost too much.
    pub error: Option<ErrorEstimate>,
}

/// Traces every grain until its flight ends.
///
/// Grains that do not feel each other fly in blocks, each with steps of its own; a grain's flight does not depend, to
/// the last bit, on the others, on the size of the blocks, or on the number of threads. (Only the default step of
/// integrators that do not adapt is chosen for all grains together.) Grains that feel each other share their steps; their
/// flights do not depend on the number of threads. Runs on the current rayon pool.
///
/// # Errors
/// Options that make no sense, forces that the integrator cannot do, drag that cannot be told, a tolerance that cannot
/// be reached.
pub fn trace(
    system: &System,
    ensemble: &Ensemble,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Traced, TraceError> {
    options.check()?;
    let method = resolve(system, ensemble.len(), options)?;
    let step = match options.step {
        Some(step) => step,
        None if method.is_adaptive() || ensemble.is_empty() => options.duration,
        None if options.method == Method::Auto && method == Method::BlanesMoan14 => {
            linear_step(system, ensemble, options)?
        }
        None => natural_step(system, ensemble, options)?,
    };
    observer.begin(ensemble.len(), options.samples());
    let fixed = Options { method, step: Some(step), ..options.clone() };
    let mut traced = run(system, ensemble, &fixed, observer)?;
    if options.estimate_error && !options.cancelled() {
        traced.error = crate::estimate::estimate(system, ensemble, &fixed, &traced)?;
    }
    if let Some(listener) = options.progress.as_ref().filter(|_| !options.cancelled()) {
        listener(1.0);
    }
    traced.step = (!method.is_adaptive()).then_some(step);
    Ok(traced)
}

/// The integrator to use, if it can do what is asked.
fn resolve(system: &System, grains: usize, options: &Options) -> Result<Method, TraceError> {
    let refuse = |method, reason, advice| Err(TraceError::Method { method, reason, advice });
    if let Some(temperature) = system.noise {
        if !(temperature.is_finite() && temperature >= 0.0) {
            let expected = "zero or more, in K";
            return Err(TraceError::Option { option: "noise temperature", value: temperature, expected });
        }
        if system.drag.is_none() {
            return refuse("noise", "there is no drag", "set the drag of the gas that makes the noise");
        }
    }
    let nature = system.nature();
    // What the multistep can do: forces known from the positions, with many derivatives.
    let smooth = system.magnetic_field == Vec3::zeros() && !nature.needs_velocity && !nature.rough;
    let method = match (options.method, system.noise) {
        (Method::Auto, Some(_)) => Method::Langevin,
        (Method::Auto, None) if options.max_step.is_none() && system.linear_form().is_some() => Method::BlanesMoan14,
        (Method::Auto, None) if smooth && nature.couples_grains && (DEAR..=MANY).contains(&grains) => Method::Stoermer,
        (Method::Auto, None) => Method::Dop853,
        (method, _) => method,
    };
    if system.noise.is_some() && method != Method::Langevin {
        return refuse(method.name(), "there is noise", "use langevin, or leave the noise out");
    }
    if matches!(method, Method::Stoermer | Method::Stoermer12) && system.magnetic_field != Vec3::zeros() {
        return refuse(method.name(), "there is a magnetic field", "use dop853, or leave the field out");
    }
    if method != Method::Dop853 && nature.needs_velocity {
        return refuse(method.name(), "a force depends on the velocity", "use dop853");
    }
    Ok(method)
}

/// Grains from which on their mutual forces are so dear that `Auto` takes the multistep, if the other forces are smooth. Above
/// [`MANY`] these forces themselves jump.
pub const DEAR: usize = 100;

/// Where a run stands that was never begun.
static NOWHERE: Standing = Standing::new();

/// One pass over all grains.
pub(crate) fn run(
    system: &System,
    ensemble: &Ensemble,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Traced, TraceError> {
    let shared = system.nature().couples_grains;
    let region = system.region.map_or(0.0, |region| (region.max - region.min).norm());
    let period = system.nature().shortest_period.unwrap_or(f64::INFINITY);
    let run = Run {
        system,
        ensemble,
        options,
        observer,
        events: system.all_events(),
        meter: Meter::new(options.progress.as_ref(), ensemble.len() as f64 * options.duration),
        step: options.step.unwrap_or(options.duration),
        max_step: options.max_step.unwrap_or(period * LONGEST_STEP),
        least_travel: LEAST_TRAVEL * region,
        shared,
        linear: system.linear_form(),
    };
    let standing = options.resume.as_deref().unwrap_or(&NOWHERE);
    if let Some(grain) = standing.stranger(ensemble.len()) {
        return Err(TraceError::Resume { grain, grains: ensemble.len() });
    }
    standing.tell(observer);
    let flown = standing.flying.values().map(|flying| flying.state.time - options.start).sum::<f64>();
    run.meter.add(standing.landed.len() as f64 * options.duration + flown);
    let all: Vec<usize> = (0..ensemble.len()).filter(|grain| !standing.landed.contains_key(grain)).collect();
    let results: Vec<Result<BlockResult, TraceError>> = if shared {
        // From one of the pool's own threads: others sleep and are woken for every force.
        vec![rayon::scope(|_| fly(&run, &all))]
    } else {
        // Blocks small enough that all threads have some.
        let share = all.len().div_ceil(2 * rayon::current_num_threads()).max(1);
        // In linear forces the coefficients of a step are found once for a block: they should not cost more than its grains.
        let block = if run.linear.is_some() { 8 * options.block } else { options.block };
        // The multistep has one step for all grains of a block.
        let size = if options.method == Method::Stoermer { 1 } else { block.min(share) };
        // Steps that are not each grain's own are those of a whole block: only grains that stand at the same moment share one.
        let mut moments: BTreeMap<Option<[u64; 4]>, Vec<usize>> = BTreeMap::new();
        for grain in all {
            let flying = standing.flying.get(&grain).filter(|_| !options.method.is_adaptive());
            moments.entry(flying.map(Flying::moment)).or_default().push(grain);
        }
        let blocks: Vec<&[usize]> = moments.values().flat_map(|grains| grains.chunks(size)).collect();
        blocks.into_par_iter().map(|grains| fly(&run, grains)).collect()
    };
    let mut traced = Traced {
        ensemble: ensemble.clone(),
        endings: vec![Ending { outcome: crate::Outcome::Stopped, time: options.start }; ensemble.len()],
        method: options.method,
        step: None,
        accepted: 0,
        rejected: 0,
        force_evaluations: 0,
        error: None,
    };
    let mut counts = standing.counts;
    let mut land = |landed: &Landed| {
        traced.ensemble.place(landed.grain, landed.position, landed.velocity);
        traced.endings[landed.grain] = landed.ending;
    };
    standing.landed.values().for_each(&mut land);
    for result in results {
        let result = result?;
        counts.add(result.counts);
        result.landed.iter().for_each(&mut land);
    }
    (traced.accepted, traced.rejected, traced.force_evaluations) =
        (counts.accepted, counts.rejected, counts.evaluations);
    Ok(traced)
}

/// The longest step, in shortest periods of the forces.
///
/// *Why a quarter:* in a Paul trap with q from 0.02 to 0.8 and tolerances from 1e-6 to 1e-12 the error control by itself
/// takes 4 to 33 steps a period, and a bound between 1/4 and 2 periods changes neither steps nor error. It is there for
/// motions that hardly feel the RF, so that no step can run over a whole period unseen: with twelve stages in a quarter
/// none can. A bound of 1/20 would cost five times the steps at 1e-6, half as much again at 1e-9.
const LONGEST_STEP: f64 = 0.25;

fn fly(run: &Run, grains: &[usize]) -> Result<BlockResult, TraceError> {
    match run.options.method {
        Method::Auto | Method::Dop853 => Loop::new(run, Dop853::new(), grains)?.fly(),
        Method::Verlet => split(run, &VERLET, grains),
        Method::Boris => Loop::new(run, Boris::new(), grains)?.fly(),
        Method::Langevin => Loop::new(run, Langevin::new(), grains)?.fly(),
        Method::BlanesMoan4 => split(run, &BLANES_MOAN_4, grains),
        Method::BlanesMoan6 => split(run, &BLANES_MOAN_6, grains),
        Method::BlanesMoan14 => split(run, &BLANES_MOAN_14, grains),
        Method::Stoermer12 => Loop::new(run, Stoermer::new(), grains)?.fly(),
        Method::Stoermer => Loop::new(run, AdaptiveStoermer::new(), grains)?.fly(),
    }
}

fn split(run: &Run, scheme: &'static Scheme, grains: &[usize]) -> Result<BlockResult, TraceError> {
    match &run.linear {
        Some(form) => Loop::new(run, LinearSplitting::new(scheme, form.clone()), grains)?.fly(),
        None => Loop::new(run, Splitting::new(scheme), grains)?.fly(),
    }
}

/// The step chosen when none is given, for integrators that do not adapt, s: the shortest time found in the forces, over the
/// steps that the integrator's order asks for.
///
/// Looked at are the shortest period, the gyration in the magnetic field, the time in which a grain falls or flies
/// through a hundredth of the region, and the steepest change of force near the starts, by differences: a grain in a
/// force of gradient k feels the time 2π sqrt(m / |k|).
///
/// # Errors
/// Drag that cannot be told.
pub fn natural_step(system: &System, ensemble: &Ensemble, options: &Options) -> Result<f64, TraceError> {
    let nature = system.nature();
    let mut shortest = options.duration.min(nature.shortest_period.unwrap_or(f64::INFINITY));
    let grains: Vec<usize> = (0..ensemble.len()).collect();
    let mut block = Block::new(system, ensemble, &grains)?;
    let region = system.region.map(|region| (region.max - region.min).norm());
    let center = ensemble.positions().iter().sum::<Vec3>() / ensemble.len().max(1) as f64;
    let spread = ensemble.positions().iter().map(|p| (p - center).norm()).fold(0.0, f64::max);
    let length = region.unwrap_or(spread);
    // Differences over a millionth of the length: far above the rounding of the force, far below its change.
    let small = if length > 0.0 { 1e-6 * length } else { 1e-6 };
    let periods = nature.shortest_period.map_or(1, |_| 8);
    let (mut here, mut there) = (Vec::new(), Vec::new());
    let mut consider = |time: f64| {
        if time.is_finite() && time > 0.0 {
            shortest = shortest.min(time);
        }
    };
    for k in 0..periods {
        let phase = nature.shortest_period.unwrap_or(0.0) * k as f64 / periods as f64;
        let time = vec![options.start + phase; ensemble.len()];
        block.forces.accelerations(&time, ensemble.positions(), ensemble.velocities(), &mut here);
        for axis in 0..3 {
            let moved: Vec<Vec3> = ensemble.positions().iter().map(|p| p + Vec3::ith(axis, small)).collect();
            block.forces.accelerations(&time, &moved, ensemble.velocities(), &mut there);
            for (a, b) in here.iter().zip(&there) {
                consider(std::f64::consts::TAU * (small / (b - a).norm()).sqrt());
            }
        }
        for (a, v) in here.iter().zip(ensemble.velocities()) {
            consider((0.02 * length / a.norm()).sqrt());
            consider(0.01 * length / v.norm());
        }
    }
    for linear in &block.linear {
        consider(std::f64::consts::TAU / linear.omega.norm());
    }
    Ok(shortest / options.method.steps_per_period())
}

/// Steps of `BlanesMoan14` in the shortest time of a linear force that err by 1e-10 of the excursion in that time. In Paul traps
/// of q = 0.2 to 0.8 it is 4e-12 to 9e-11, and goes with the sixth power of the step. Checked by
/// `exact_default_in_linear_forces`.
const LINEAR_STEPS: f64 = 16.0;

/// The step by default in forces that are linear in the position, s: such that a tenth of the tolerance is left of an RF period,
/// as `Dop853` leaves.
///
/// The shortest time is the period of the forces, that of the fastest oscillation that the steepest force would make if it
/// stayed, or that of the drag. It does not depend on where grains are.
fn linear_step(system: &System, ensemble: &Ensemble, options: &Options) -> Result<f64, TraceError> {
    let mut shortest = system.nature().shortest_period.unwrap_or(f64::INFINITY);
    if let Some(form) = system.linear_form() {
        let ratios = ensemble.charges().iter().zip(ensemble.masses()).map(|(q, m)| (q / m).abs());
        let steepest = form.steepest() * ratios.fold(0.0, f64::max);
        if steepest > 0.0 {
            shortest = shortest.min(std::f64::consts::TAU / steepest.sqrt());
        }
    }
    let grains: Vec<usize> = (0..ensemble.len()).collect();
    for linear in &Block::new(system, ensemble, &grains)?.linear {
        if linear.rate > 0.0 {
            shortest = shortest.min(std::f64::consts::TAU / linear.rate);
        }
    }
    let steps = LINEAR_STEPS * (1e-9 / options.tolerance).powf(1.0 / 6.0);
    Ok(shortest.min(options.duration) / steps.max(4.0))
}

impl Method {
    /// As it is called in messages and case files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Dop853 => "dop853",
            Self::Verlet => "verlet",
            Self::Boris => "boris",
            Self::Langevin => "langevin",
            Self::BlanesMoan4 => "blanes-moan-4",
            Self::BlanesMoan6 => "blanes-moan-6",
            Self::BlanesMoan14 => "blanes-moan-14",
            Self::Stoermer12 => "stoermer-12",
            Self::Stoermer => "stoermer",
        }
    }

    /// Whether its steps follow the error.
    pub fn is_adaptive(self) -> bool {
        matches!(self, Self::Auto | Self::Dop853 | Self::Stoermer)
    }

    /// Order of the error of a run in the step (weak order for `Langevin`); of the method that `Auto` takes without noise.
    pub fn order(self) -> u32 {
        match self {
            Self::Auto | Self::Dop853 => 8,
            Self::Verlet | Self::Boris | Self::Langevin => 2,
            Self::BlanesMoan4 => 4,
            Self::BlanesMoan6 | Self::BlanesMoan14 => 6,
            Self::Stoermer12 | Self::Stoermer => 12,
        }
    }

    /// Default steps in the shortest time of the forces. On the Mathieu flights of the reference, 6 to 32 periods long,
    /// they leave 3e-3, 5e-7 and 2e-8 of the excursion for orders 2, 4 and 6.
    fn steps_per_period(self) -> f64 {
        match self {
            Self::Auto | Self::Dop853 | Self::Stoermer => 20.0,
            Self::Verlet | Self::Boris | Self::Langevin => 200.0,
            Self::BlanesMoan4 => 40.0,
            Self::BlanesMoan6 => 20.0,
            // 1e-10 of the excursion for each period at q = 0.8, 2e-11 at q = 0.4.
            Self::BlanesMoan14 => 16.0,
            // 3e-11 at q = 0.8, 3e-12 at q = 0.4.
            Self::Stoermer12 => 48.0,
        }
    }
}
