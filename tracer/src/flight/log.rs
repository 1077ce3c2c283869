//! What a block tells the journal.

use std::time::Instant;

use super::Loop;
use crate::checkpoint::{Counts, Flying, Frame};
use crate::integrator::Integrator;
use crate::{Sample, TraceError};

/// What has come since the last frame.
pub(super) struct Log {
    /// When that was.
    kept: Instant,
    /// Samples since then; none where nobody keeps frames.
    samples: Vec<(usize, Vec<Sample>)>,
    /// How many had landed, and the work that had been done.
    landed: usize,
    counts: Counts,
}

impl Log {
    pub fn new() -> Self {
        Self { kept: Instant::now(), samples: Vec::new(), landed: 0, counts: Counts::default() }
    }
}

impl<I: Integrator> Loop<'_, '_, I> {
    /// Hands on the samples that a grain's lane holds back.
    pub(super) fn record(&mut self, lane: usize) {
        let l = &mut self.lanes[lane];
        if l.buffer.is_empty() {
            return;
        }
        self.run.observer.record(l.grain, &l.buffer);
        if self.run.options.journal.is_some() {
            self.log.samples.push((l.grain, l.buffer.clone()));
        }
        l.buffer.clear();
    }

    /// Keeps a frame if the last one is long ago.
    pub(super) fn keep_if_due(&mut self) -> Result<(), TraceError> {
        match &self.run.options.journal {
            Some(journal) if self.log.kept.elapsed() >= journal.interval() => self.keep(),
            _ => Ok(()),
        }
    }

    /// Keeps a frame: where the grains are that fly, which have landed, which samples were taken.
    pub(super) fn keep(&mut self) -> Result<(), TraceError> {
        let Some(journal) = self.run.options.journal.clone() else { return Ok(()) };
        for lane in 0..self.lanes.len() {
            self.record(lane);
        }
        let counts = Counts { evaluations: self.block.forces.evaluations, ..self.result.counts };
        let memory = self.integrator.memory(self.lanes.len());
        let flying = self.lanes.iter().zip(&self.block.state).zip(memory).map(|((l, state), memory)| Flying {
            grain: l.grain,
            state: *state,
            pace: l.pace,
            memory,
        });
        let frame = Frame {
            flying: flying.collect(),
            landed: self.result.landed[self.log.landed..].to_vec(),
            samples: std::mem::take(&mut self.log.samples),
            counts: counts.since(self.log.counts),
        };
        journal.keep(&frame).map_err(TraceError::Journal)?;
        (self.log.kept, self.log.landed, self.log.counts) = (Instant::now(), self.result.landed.len(), counts);
        Ok(())
    }
}
