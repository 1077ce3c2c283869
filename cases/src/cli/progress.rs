//! Progress on standard error while someone watches.

use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::pipeline::Reporter;

/// Steps of a bar; finer than any terminal is wide.
const STEPS: u64 = 1000;

/// Draws a bar for each stage on a terminal, and collects warnings.
pub(super) struct Progress {
    shown: bool,
    stage: Mutex<Option<(String, Instant, ProgressBar)>>,
    warnings: Mutex<Vec<String>>,
}

impl Progress {
    /// Silent when told to be or when nobody watches.
    pub fn new(quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        Self { shown, stage: Mutex::default(), warnings: Mutex::default() }
    }

    /// The last stage is over.
    pub fn finish(&self) {
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((name, start, bar)) = stage.take() {
            bar.finish_and_clear();
            let seconds = start.elapsed().as_secs_f64();
            if seconds >= 0.05 {
                eprintln!("  {name:<20} {seconds:>6.1} s");
            }
        }
    }

    /// What was warned of.
    pub fn warnings(&self) -> Vec<String> {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}

impl Reporter for Progress {
    fn stage(&self, name: &str) {
        if !self.shown {
            return;
        }
        self.finish();
        let bar = ProgressBar::new(STEPS);
        // Until it is known how far the work is.
        bar.set_style(style("  {prefix:20} {spinner} {elapsed}"));
        bar.set_prefix(name.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        let mut stage = self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        *stage = Some((name.to_owned(), Instant::now(), bar));
    }

    fn fraction(&self, done: f64) {
        if !self.shown {
            return;
        }
        if let Some((_, start, bar)) = &*self.stage.lock().unwrap_or_else(PoisonError::into_inner) {
            if bar.position() == 0 {
                bar.set_style(style("  {prefix:20} [{bar:32}] {percent:>3} %  {elapsed} {msg}"));
            }
            bar.set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
            let left = start.elapsed().as_secs_f64() * (1.0 / done.max(1e-9) - 1.0);
            if done > 0.02 && left.is_finite() {
                bar.set_message(format!("about {left:.0} s left"));
            }
        }
    }

    fn warning(&self, text: &str) {
        let line = format!("warning: {text}");
        match &*self.stage.lock().unwrap_or_else(PoisonError::into_inner) {
            Some((_, _, bar)) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
    }
}
