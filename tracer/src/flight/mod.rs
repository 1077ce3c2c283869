//! The loop over steps of one block.

mod lane;
mod log;
mod sampling;

use meshes::Vec3;

pub(crate) use self::lane::Pace;
use self::lane::{Fate, Grid, Kind, Lane};
use self::log::Log;
use self::sampling::Point;

use crate::block::{Block, State, Trial, retain};
use crate::checkpoint::{Counts, Landed};
use crate::event::first_event;
use crate::force::linear_form::LinearForm;
use crate::integrator::{Integrator, IntegratorNature};
use crate::linear::Linear;
use crate::path::Path;
use crate::progress::Meter;
use crate::{Ensemble, Event, Observer, Options, System, TraceError};

/// What all blocks of a run have in common.
pub(crate) struct Run<'a> {
    pub system: &'a System,
    pub ensemble: &'a Ensemble,
    pub options: &'a Options,
    pub observer: &'a dyn Observer,
    pub events: Vec<&'a dyn Event>,
    pub meter: Meter<'a>,
    /// Step of integrators that do not adapt, s.
    pub step: f64,
    /// Longest step, s.
    pub max_step: f64,
    /// See `Block`.
    pub least_travel: f64,
    /// All grains step together.
    pub shared: bool,
    /// The forces, where they are linear in the position.
    pub linear: Option<LinearForm>,
}

/// What came of a block.
#[derive(Default)]
pub(crate) struct BlockResult {
    pub landed: Vec<Landed>,
    pub counts: Counts,
}

/// Motions smaller than this part of the region are traced as if they were this large: relative to the region, they err
/// by this part of the tolerance.
pub(crate) const LEAST_TRAVEL: f64 = 1e-3;

/// How far a grain looks around for surfaces, in steps. From the middle of a sphere of 20 000 panels the true distance
/// costs 200 µs, because all panels are about as far; to learn that none is within 32 steps costs 1 µs, every 32 steps.
const LOOK_AHEAD: f64 = 32.0;

/// Most steps that are tried at once: their coefficients (fifteen kicks of 72 bytes each) stay in the first cache, and what the
/// loop does between them no longer shows.
const LONGEST_LEAP: u64 = 32;

/// Rounds between looks at the progress meter.
const ROUNDS: u64 = 16;

pub(crate) struct Loop<'a, 'b, I> {
    run: &'b Run<'a>,
    integrator: I,
    nature: IntegratorNature,
    block: Block<'a>,
    lanes: Vec<Lane>,
    result: BlockResult,
    /// Of the lanes that need one, this round.
    paths: Vec<Path>,
    path_lanes: Vec<usize>,
    points: Vec<Point>,
    log: Log,
    /// Steps to try at once.
    leap: u64,
}

impl<'a, 'b, I: Integrator> Loop<'a, 'b, I> {
    pub fn new(run: &'b Run<'a>, mut integrator: I, grains: &[usize]) -> Result<Self, TraceError> {
        let mut block = Block::new(run.system, run.ensemble, grains)?;
        block.seed = run.options.seed;
        block.tolerance = run.options.tolerance;
        block.least_travel = run.least_travel;
        block.watched = !run.events.is_empty();
        let start = run.options.start;
        let margin = block.forces.margin(start, start);
        let lanes = grains.iter().enumerate().map(|(lane, &grain)| {
            let kept = run.options.resume.as_ref().and_then(|standing| standing.flying.get(&grain));
            let pace = match kept {
                Some(flying) => {
                    block.state[lane] = flying.state;
                    flying.pace
                }
                None => {
                    block.state[lane].time = start;
                    Pace {
                        corner: run.system.next_corner(start + 2.0 * margin),
                        wanted: 0.0,
                        rejected: false,
                        grid: Grid::default(),
                        number: 0,
                        sample: 0,
                        anchor: Vec3::zeros(),
                        clear: 0.0,
                        sampled: f64::NEG_INFINITY,
                    }
                }
            };
            Lane { grain, begun: kept.is_some(), pace, buffer: Vec::new(), fate: None }
        });
        let lanes: Vec<Lane> = lanes.collect();
        let known = |lane: &Lane| Some(run.options.resume.as_ref()?.flying.get(&lane.grain)?.memory.as_slice());
        let memory: Vec<&[f64]> = lanes.iter().filter_map(known).collect();
        if memory.len() == lanes.len() && memory.iter().all(|numbers| !numbers.is_empty()) {
            integrator.remember(&block, &memory);
        }
        Ok(Self {
            run,
            nature: integrator.nature(),
            integrator,
            block,
            lanes,
            result: BlockResult::default(),
            paths: Vec::new(),
            path_lanes: Vec::new(),
            points: Vec::new(),
            log: Log::new(),
            leap: LONGEST_LEAP,
        })
    }

    pub fn fly(mut self) -> Result<BlockResult, TraceError> {
        self.begin();
        let mut rounds = 0_u64;
        while !self.lanes.is_empty() {
            if self.run.options.cancelled() {
                self.end_all(Kind::Stopped);
                break;
            }
            self.refresh();
            if self.lanes.is_empty() {
                break;
            }
            self.plan();
            if !self.leap() {
                self.integrator.advance(&mut self.block);
            }
            self.judge()?;
            rounds += 1;
            if rounds.is_multiple_of(ROUNDS) || self.lanes.is_empty() {
                self.run.meter.report();
                self.keep_if_due()?;
            }
        }
        self.run.meter.report();
        self.result.counts.evaluations = self.block.forces.evaluations;
        if !self.run.options.cancelled() {
            self.keep()?;
        }
        Ok(self.result)
    }

    /// First samples, and the end of grains that must not start where they do.
    fn begin(&mut self) {
        for lane in 0..self.lanes.len() {
            if self.lanes[lane].begun {
                continue;
            }
            let state = self.block.state[lane];
            let (position, velocity) = (state.motion.position, state.motion.velocity);
            let excluded = self.run.events.iter().find_map(|event| event.excludes(&position));
            let over = state.time >= self.run.options.end();
            let kind = excluded.map(Kind::Met).or(over.then_some(Kind::TimeUp));
            let time = state.time;
            self.lanes[lane].fate = kind.map(|kind| Fate { time, position, velocity, kind });
            if kind.is_none() && self.run.options.every.is_some() {
                self.points.push(Point { lane, time, position, velocity });
                self.lanes[lane].pace.sample = 1;
            }
        }
        self.take_samples();
        self.finish();
    }

    /// Accelerations at the states that lack them.
    fn refresh(&mut self) {
        if !self.nature.starts_from_force {
            return;
        }
        loop {
            let stale: Vec<usize> = (0..self.lanes.len()).filter(|&lane| !self.block.state[lane].fresh).collect();
            if stale.is_empty() {
                return;
            }
            let state = |lane: &usize| &self.block.state[*lane];
            // Just after the time, so that a waveform that jumps there is taken after the jump.
            let time: Vec<f64> =
                stale.iter().map(state).map(|s| s.time + self.block.forces.margin(s.time, s.time)).collect();
            let position: Vec<Vec3> = stale.iter().map(state).map(|s| s.motion.position).collect();
            let velocity: Vec<Vec3> = stale.iter().map(state).map(|s| s.motion.velocity).collect();
            let mut out = Vec::new();
            self.block.forces.accelerations_of(&stale, &time, &position, &velocity, &mut out);
            for (&lane, acceleration) in stale.iter().zip(&out) {
                let state = &mut self.block.state[lane];
                state.motion.acceleration = *acceleration;
                state.fresh = true;
                if !finite(acceleration) {
                    self.lanes[lane].fate = Some(Fate::here(state.time, &state.motion, Kind::Unstable));
                }
            }
            // Where one that others feel ends here, theirs are to be found again.
            self.finish();
        }
    }

    /// Chooses the steps to try.
    fn plan(&mut self) {
        for lane in 0..self.lanes.len() {
            if self.run.shared && lane > 0 {
                let Trial { step, end, number, steps, first, room, longest, error, .. } = self.block.trial[0];
                let trial = &mut self.block.trial[lane];
                (trial.step, trial.end, trial.number, trial.error) = (step, end, number, error);
                (trial.steps, trial.first, trial.room, trial.longest) = (steps, first, room, longest);
                continue;
            }
            let state = &self.block.state[lane];
            let l = &mut self.lanes[lane];
            let stop = self.run.options.end().min(l.pace.corner);
            let room = stop - state.time;
            let (step, end) = if self.nature.adaptive {
                if l.pace.wanted == 0.0 {
                    let first = |(state, linear)| self.run.first_step(state, linear);
                    l.pace.wanted = if self.run.shared {
                        self.block.state.iter().zip(&self.block.linear).map(first).fold(f64::INFINITY, f64::min)
                    } else {
                        first((state, &self.block.linear[lane]))
                    };
                }
                let step = self.integrator.asks().unwrap_or(l.pace.wanted).min(self.run.max_step);
                // Never leave a remainder that is a small part of a step.
                let end = if step >= room * (1.0 - 1e-12) {
                    stop
                } else if 2.0 * step > room {
                    state.time + 0.5 * room
                } else {
                    state.time + step
                };
                (end - state.time, end)
            } else {
                if l.pace.grid.taken == l.pace.grid.count {
                    let sample = if self.nature.dense { f64::INFINITY } else { self.run.sample_time(l.pace.sample) };
                    let stop = stop.min(sample);
                    l.pace.grid = Grid::new(state.time, stop, self.run.step.min(self.run.max_step));
                }
                (l.pace.grid.step, l.pace.grid.next_end())
            };
            let trial = &mut self.block.trial[lane];
            (trial.step, trial.end, trial.number, trial.error) = (step, end, l.pace.number, 0.0);
            (trial.steps, trial.first) = (1, l.pace.grid.taken == 0);
            (trial.room, trial.longest) = (room, self.run.max_step);
        }
    }

    /// Tries many steps at once, if the integrator can and nothing comes near any grain meanwhile; what they did is then in
    /// the trials, as one step.
    fn leap(&mut self) -> bool {
        let Some(first) = self.lanes.first().filter(|_| !self.run.shared && !self.nature.adaptive) else {
            return false;
        };
        let (grid, steps) = (first.pace.grid, self.leap.min(first.pace.grid.count - first.pace.grid.taken));
        if steps < 2 {
            self.leap = (2 * self.leap).min(LONGEST_LEAP);
            return false;
        }
        let (planned, evaluations) = (self.block.trial.clone(), self.block.forces.evaluations);
        let ends: Vec<f64> = (1..=steps).map(|k| grid.end_after(k)).collect();
        let done = self.integrator.leap(&mut self.block, &ends);
        let clear = done && (0..self.lanes.len()).all(|lane| self.is_finite(lane) && !self.may_meet(lane));
        self.leap = if clear { (2 * self.leap).min(LONGEST_LEAP) } else { (self.leap / 4).max(1) };
        if !clear {
            self.block.trial = planned;
            self.block.forces.evaluations = evaluations;
        }
        clear
    }

    /// Accepts or rejects what was tried, looks for events, takes samples.
    fn judge(&mut self) -> Result<(), TraceError> {
        let n = self.lanes.len();
        let worst = if self.run.shared { self.share_error() } else { 0 };
        let good: Vec<bool> = (0..n).map(|lane| self.is_good(lane)).collect();
        if self.run.shared && good.contains(&false) {
            return self.reject_all(worst);
        }
        for lane in (0..n).filter(|&lane| !good[lane]) {
            self.reject(lane)?;
        }
        self.find_paths(&good);
        if self.meet(&good) {
            return Ok(());
        }
        self.sample(&good);
        self.take_samples();
        self.commit_all(&good);
        self.finish();
        Ok(())
    }

    fn is_good(&self, lane: usize) -> bool {
        // Shared errors are infinite where anything is.
        self.block.trial[lane].error <= 1.0 && (self.run.shared || self.is_finite(lane))
    }

    fn is_finite(&self, lane: usize) -> bool {
        let (trial, m) = (&self.block.trial[lane], &self.block.trial[lane].motion);
        let acceleration = !trial.fresh || finite(&m.acceleration);
        finite(&m.position) && finite(&m.velocity) && acceleration && trial.reach.is_finite() && trial.error.is_finite()
    }

    /// With shared steps the largest error counts for all, and one grain that is not finite fails all. Which grain it is.
    fn share_error(&mut self) -> usize {
        let all_finite = (0..self.lanes.len()).all(|lane| self.is_finite(lane));
        let (mut worst, mut which) = (0.0, 0);
        for (lane, trial) in self.block.trial.iter().enumerate() {
            if trial.error > worst {
                (worst, which) = (trial.error, lane);
            }
        }
        for trial in &mut self.block.trial {
            trial.error = if all_finite { worst } else { f64::INFINITY };
        }
        which
    }

    /// Makes the step of a grain smaller after a failure; `false` when it cannot be.
    fn shorten(&mut self, lane: usize) -> bool {
        self.result.counts.rejected += 1;
        if !self.nature.adaptive {
            return false;
        }
        let (l, trial) = (&mut self.lanes[lane], &self.block.trial[lane]);
        l.pace.wanted = trial.step * if trial.error.is_finite() { shrink(trial.error) } else { 0.1 };
        l.pace.rejected = true;
        l.pace.wanted >= self.least_step(lane)
    }

    /// Below this, time hardly advances, s.
    fn least_step(&self, lane: usize) -> f64 {
        16.0 * f64::EPSILON * self.block.state[lane].time.abs().max(self.run.options.end().abs())
    }

    /// Lets a grain try again, or ends it where it is.
    fn reject(&mut self, lane: usize) -> Result<(), TraceError> {
        if self.shorten(lane) {
            return Ok(());
        }
        if self.nature.adaptive && self.is_finite(lane) {
            return Err(self.underflow(lane));
        }
        let state = &self.block.state[lane];
        self.lanes[lane].fate = Some(Fate::here(state.time, &state.motion, Kind::Unstable));
        Ok(())
    }

    /// Lets all grains try again, without those whose forces are not finite however short the step.
    fn reject_all(&mut self, worst: usize) -> Result<(), TraceError> {
        let mut shorter = true;
        for lane in 0..self.lanes.len() {
            shorter &= self.shorten(lane);
        }
        if shorter {
            return Ok(());
        }
        if self.nature.adaptive && self.block.trial[worst].error.is_finite() {
            return Err(self.underflow(worst));
        }
        let culprits = self.culprits();
        for (lane, culprit) in culprits.into_iter().enumerate() {
            if culprit {
                let state = &self.block.state[lane];
                self.lanes[lane].fate = Some(Fate::here(state.time, &state.motion, Kind::Unstable));
            }
        }
        self.finish();
        Ok(())
    }

    fn underflow(&self, lane: usize) -> TraceError {
        let state = &self.block.state[lane];
        TraceError::StepUnderflow {
            grain: self.lanes[lane].grain,
            position: state.motion.position,
            time: state.time,
            step: self.least_step(lane),
            tolerance: self.run.options.tolerance,
            advice: "raise the tolerance, or look for a charge or an edge that the grain runs into",
        }
    }

    /// Which of the grains that feel each other have a force that is not finite at the end of a straight flight over the
    /// step, all others being there too. When none stands out, all.
    fn culprits(&mut self) -> Vec<bool> {
        let (mut time, mut position, mut velocity) = (Vec::new(), Vec::new(), Vec::new());
        for (state, trial) in self.block.state.iter().zip(&self.block.trial) {
            time.push(trial.end);
            position.push(state.motion.position + state.motion.velocity * trial.step);
            velocity.push(state.motion.velocity);
        }
        let mut out = Vec::new();
        self.block.forces.accelerations(&time, &position, &velocity, &mut out);
        let none = out.iter().all(finite);
        out.iter().map(|a| none || !finite(a)).collect()
    }

    /// The paths of the grains that may meet something or are to be sampled within the step.
    fn find_paths(&mut self, good: &[bool]) {
        self.path_lanes.clear();
        self.paths.clear();
        let mut all = false;
        for lane in (0..self.lanes.len()).filter(|&lane| good[lane]) {
            let sampled =
                self.nature.dense && self.run.sample_time(self.lanes[lane].pace.sample) < self.block.trial[lane].end;
            let met = self.lanes[lane].fate.is_none() && self.may_meet(lane);
            if sampled || met {
                self.path_lanes.push(lane);
                all |= self.run.shared;
            }
        }
        if all {
            self.path_lanes = (0..self.lanes.len()).collect();
        }
        if !self.path_lanes.is_empty() {
            self.integrator.paths(&mut self.block, &self.path_lanes, &mut self.paths);
        }
    }

    /// Whether the step may have come near an event. Costs next to nothing while the grain is far from all of them.
    fn may_meet(&mut self, lane: usize) -> bool {
        if self.run.events.is_empty() {
            return false;
        }
        let (from, reach) = (self.block.state[lane].motion.position, self.block.trial[lane].reach);
        let l = &mut self.lanes[lane];
        if reach == 0.0 || (from - l.pace.anchor).norm() + reach < l.pace.clear {
            return false;
        }
        l.pace.anchor = from;
        let look = reach * (LOOK_AHEAD / self.block.trial[lane].steps as f64).max(2.0);
        l.pace.clear = self.run.events.iter().map(|event| event.distance(&from, look)).fold(look, f64::min);
        reach >= l.pace.clear
    }

    /// Notes what grains meet on their paths. With shared steps: whether the step is to be taken again, up to the first
    /// event.
    fn meet(&mut self, good: &[bool]) -> bool {
        let mut first = f64::INFINITY;
        let mut met = Vec::new();
        for (&lane, path) in self.path_lanes.iter().zip(&self.paths) {
            if !good[lane] || self.lanes[lane].fate.is_some() || self.run.events.is_empty() {
                continue;
            }
            if let Some((theta, crossing)) = first_event(path, &self.run.events) {
                let trial = &self.block.trial[lane];
                let time = path.time(theta).min(trial.end);
                let velocity = path.velocity(theta);
                met.push((lane, Fate { time, position: crossing.point, velocity, kind: Kind::Met(crossing) }));
                first = first.min(time);
            }
        }
        // A random step taken again would be another one: there, grains leave at the end of the step.
        if !self.run.shared || self.nature.random || met.is_empty() {
            for (lane, fate) in met {
                self.lanes[lane].fate = Some(fate);
            }
            return false;
        }
        let (start, end) = (self.block.state[0].time, self.block.trial[0].end);
        let margin = 4.0 * self.block.forces.margin(start, end);
        for (lane, fate) in met.iter().filter(|(_, fate)| fate.time <= first + margin) {
            self.lanes[*lane].fate = Some(*fate);
        }
        if first >= end - margin {
            return false;
        }
        if first <= start + margin {
            // Nothing to step over: these grains end where the step began.
            self.finish();
            return true;
        }
        for lane in &mut self.lanes {
            lane.pace.grid = Grid::default();
        }
        self.take_to(first);
        true
    }

    /// Steps all grains to a time within the step just tried, at which some of them end.
    fn take_to(&mut self, time: f64) {
        for trial in &mut self.block.trial {
            trial.end = time;
        }
        let start = self.block.state[0].time;
        for trial in &mut self.block.trial {
            trial.step = time - start;
        }
        self.integrator.advance(&mut self.block);
        self.share_error();
        // A shorter step than one that was good: good.
        let good = vec![true; self.lanes.len()];
        self.find_paths(&good);
        self.sample(&good);
        self.take_samples();
        self.commit_all(&good);
        self.finish();
    }

    /// Makes the ends of good steps the new states.
    fn commit_all(&mut self, good: &[bool]) {
        // Errors that are shared make the same of all steps.
        let first = self.block.trial.first().filter(|_| self.run.shared && self.nature.adaptive);
        let growth = first.map(|trial| grow(trial.error));
        let mut flown = 0.0;
        for ((trial, state), _) in self.block.trial.iter().zip(&self.block.state).zip(good).filter(|(_, good)| **good) {
            self.result.counts.accepted += trial.steps;
            flown += trial.end - state.time;
        }
        self.run.meter.add(flown);
        let lanes = self.lanes.iter_mut().zip(&mut self.block.state).zip(&self.block.trial).zip(good);
        for (((lane, state), trial), _) in lanes.filter(|(_, good)| **good) {
            let margin = self.block.forces.margin(trial.end, trial.end);
            self.run.commit(self.nature.adaptive, lane, state, trial, growth, margin);
        }
    }

    fn end_all(&mut self, kind: Kind) {
        for (lane, state) in self.lanes.iter_mut().zip(&self.block.state) {
            lane.fate = Some(Fate::here(state.time, &state.motion, kind));
        }
        self.finish();
    }

    /// Takes grains that have ended out of the block.
    fn finish(&mut self) {
        if self.lanes.iter().all(|lane| lane.fate.is_none()) {
            return;
        }
        if self.run.options.every.is_some() {
            for (lane, l) in self.lanes.iter().enumerate() {
                if let Some(Fate { time, position, velocity, .. }) = l.fate {
                    self.points.push(Point { lane, time, position, velocity });
                }
            }
            self.points.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.lane.cmp(&b.lane)));
            self.take_samples();
        }
        let keep: Vec<bool> = self.lanes.iter().map(|lane| lane.fate.is_none()).collect();
        for lane in 0..self.lanes.len() {
            let Some(fate) = self.lanes[lane].fate else { continue };
            let ending = fate.ending(self.block.forces.mass[lane]);
            self.run.meter.add(self.run.options.end() - self.block.state[lane].time);
            self.record(lane);
            let grain = self.lanes[lane].grain;
            self.run.observer.end(grain, &ending);
            let landed = Landed { grain, ending, position: fate.position, velocity: fate.velocity };
            self.result.landed.push(landed);
        }
        self.block.retain(&keep);
        self.integrator.retain(&keep, self.run.shared);
        retain(&mut self.lanes, &keep);
        if self.run.shared {
            // The others no longer feel those that have ended.
            for state in &mut self.block.state {
                state.fresh = false;
            }
        }
    }
}

impl Run<'_> {
    /// Makes the end of a step the new state; `growth` of the step is known where errors are shared.
    fn commit(
        &self,
        adaptive: bool,
        lane: &mut Lane,
        state: &mut State,
        trial: &Trial,
        growth: Option<f64>,
        margin: f64,
    ) {
        state.time = trial.end;
        state.motion = trial.motion;
        state.fresh = trial.fresh;
        let pace = &mut lane.pace;
        pace.number += trial.steps;
        pace.grid.taken = (pace.grid.taken + trial.steps).min(pace.grid.count);
        if adaptive {
            state.travel = state.travel.max((trial.motion.position - state.origin).norm());
            state.top_speed = state.top_speed.max(trial.motion.velocity.norm());
            let growth = growth.unwrap_or_else(|| grow(trial.error));
            let factor = if pace.rejected { growth.min(1.0) } else { growth };
            // A step cut short by a stop says nothing against the longer one that was wanted.
            let cut = factor >= 1.0 && trial.step < 0.99 * pace.wanted.min(self.max_step);
            pace.wanted = if cut { pace.wanted.max(trial.step * factor) } else { trial.step * factor };
            pace.rejected = false;
        }
        if trial.end >= pace.corner {
            state.fresh = false;
            pace.corner = self.system.next_corner(trial.end + 2.0 * margin);
        }
        if lane.fate.is_none() && trial.end >= self.options.end() {
            lane.fate = Some(Fate::here(trial.end, &trial.motion, Kind::TimeUp));
        }
    }

    /// First step to try, s: a hundredth of the shortest time that the grain itself shows. The error control makes it
    /// grow sixfold a step, so a short one costs little.
    fn first_step(&self, state: &State, linear: &Linear) -> f64 {
        let (v, a) = (
            state.motion.velocity.norm(),
            (state.motion.acceleration + linear.acceleration(&state.motion.velocity)).norm(),
        );
        let length = self.least_travel / LEAST_TRAVEL;
        let times = [
            self.options.duration,
            self.max_step,
            1.0 / linear.rate,
            1.0 / linear.omega.norm(),
            length / v,
            (length / a).sqrt(),
        ];
        let usable = |x: &f64| x.is_finite() && *x > 0.0;
        let others = times.into_iter().filter(usable).fold(f64::INFINITY, f64::min);
        let turning = Some(v / a).filter(usable).unwrap_or(others).max(1e-6 * others);
        0.01 * others.min(turning)
    }
}

fn finite(v: &Vec3) -> bool {
    v.iter().all(|x| x.is_finite())
}

/// Factor on the step after an accepted one, by the order of the error estimate (8): Hairer, Nørsett and Wanner, II.4, with
/// their safety and bounds.
fn grow(error: f64) -> f64 {
    if error == 0.0 { 6.0 } else { (0.9 * error.powf(-0.125)).clamp(1.0 / 3.0, 6.0) }
}

/// Factor on the step after a rejected one.
fn shrink(error: f64) -> f64 {
    (0.9 * error.powf(-0.125)).clamp(1.0 / 3.0, 0.9)
}
