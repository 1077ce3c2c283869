//! Samples taken during steps.

use meshes::Vec3;

use super::{Loop, Run, finite};
use crate::integrator::Integrator;
use crate::{Options, Sample};

/// A sample without its forces.
pub(super) struct Point {
    pub lane: usize,
    pub time: f64,
    pub position: Vec3,
    pub velocity: Vec3,
}

/// Samples kept back before the observer is called: a few kB for each grain.
const BUFFER: usize = 128;

impl<I: Integrator> Loop<'_, '_, I> {
    /// Collects the samples that fall into the step.
    pub(super) fn sample(&mut self, good: &[bool]) {
        if self.run.options.every.is_none() {
            return;
        }
        let mut paths = self.path_lanes.iter().zip(&self.paths).peekable();
        for lane in (0..self.lanes.len()).filter(|&lane| good[lane]) {
            let path = paths.next_if(|(which, _)| **which == lane).map(|(_, path)| path);
            let trial = &self.block.trial[lane];
            let l = &mut self.lanes[lane];
            let until = l.fate.map_or(trial.end, |fate| fate.time);
            loop {
                let time = self.run.sample_time(l.pace.sample);
                if time > until || (l.fate.is_some() && time >= until) {
                    break;
                }
                let (position, velocity) = if time >= trial.end {
                    (trial.motion.position, trial.motion.velocity)
                } else if let Some(path) = path {
                    let theta = (time - path.start) / path.step;
                    (path.position(theta), path.velocity(theta))
                } else {
                    break;
                };
                self.points.push(Point { lane, time, position, velocity });
                l.pace.sample += 1;
            }
        }
        if self.run.shared {
            // The same times for all grains: sorted by time, then grain, they make whole ensembles.
            self.points.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.lane.cmp(&b.lane)));
        }
    }

    /// Completes the collected samples with forces and energies and stores them.
    pub(super) fn take_samples(&mut self) {
        let points = std::mem::take(&mut self.points);
        if self.run.shared {
            // Forces that couple grains are asked for all grains at once; a time at which some have ended already takes
            // the others where they are.
            for group in points.chunk_by(|a, b| a.time == b.time) {
                let mut all: Vec<Point> = (0..self.lanes.len())
                    .map(|lane| {
                        let m = self.block.state[lane].motion;
                        Point { lane, time: group[0].time, position: m.position, velocity: m.velocity }
                    })
                    .collect();
                for p in group {
                    all[p.lane].position = p.position;
                    all[p.lane].velocity = p.velocity;
                }
                let samples = self.complete(&all);
                for p in group {
                    self.store(p.lane, samples[p.lane]);
                }
            }
        } else if !points.is_empty() {
            let samples = self.complete(&points);
            for (p, sample) in points.iter().zip(samples) {
                self.store(p.lane, sample);
            }
        }
    }

    fn complete(&mut self, points: &[Point]) -> Vec<Sample> {
        let Options { forces, start, .. } = *self.run.options;
        if !forces && points.iter().all(|p| p.time > start) {
            let bare = |p: &Point| Sample {
                time: p.time,
                position: p.position,
                velocity: p.velocity,
                force: Vec3::zeros(),
                potential_energy: 0.0,
            };
            return points.iter().map(bare).collect();
        }
        let lanes: Vec<usize> = points.iter().map(|p| p.lane).collect();
        let time: Vec<f64> = points.iter().map(|p| p.time).collect();
        let position: Vec<Vec3> = points.iter().map(|p| p.position).collect();
        let velocity: Vec<Vec3> = points.iter().map(|p| p.velocity).collect();
        let (forces, energies) = self.block.forces.forces_and_energies(&lanes, &time, &position, &velocity);
        let completed = points.iter().zip(forces.iter().zip(energies)).map(|(p, (force, potential_energy))| {
            let linear = self.block.linear[p.lane].acceleration(&p.velocity) * self.block.forces.mass[p.lane];
            let (time, position, velocity) = (p.time, p.position, p.velocity);
            Sample { time, position, velocity, force: force + linear, potential_energy }
        });
        completed.collect()
    }

    fn store(&mut self, lane: usize, sample: Sample) {
        let l = &mut self.lanes[lane];
        // A run that is stopped may end at a sample just taken; a grain in a singular field has no force to show.
        if sample.time <= l.pace.sampled || !finite(&sample.force) || !sample.potential_energy.is_finite() {
            return;
        }
        l.pace.sampled = sample.time;
        l.buffer.push(sample);
        if l.buffer.len() >= BUFFER {
            self.record(lane);
        }
    }
}

impl Run<'_> {
    /// Time of a sample, s; the end of the run is sampled as the end of the flight, not here.
    pub(super) fn sample_time(&self, number: u64) -> f64 {
        let Some(every) = self.options.every else { return f64::INFINITY };
        let time = self.options.start + number as f64 * every;
        if time < self.options.end() - 1e-9 * every { time } else { f64::INFINITY }
    }
}
