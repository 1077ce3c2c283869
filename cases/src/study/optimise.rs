//! An optimisation: the search over what is varied, every evaluation a row.
//!
//! *Why* a point that cannot be is no end of the search: electrodes that touch, or a grain inside of one, are a place to stay away from.
//! Such a point counts as worse than all before it, by as much as these differ, and breaks every constraint; its row says why. The
//! rows before are the same whether they were kept or worked out, so that a search that was stopped goes the same way again.

use std::collections::HashMap;

use super::journal::usable;
use super::points::{Point, case_at, key, value_in_si};
use super::row::{End, Number, Row};
use super::sampling::unit_samples;
use super::search::{Judged, Landscape, Settings, search, settle};
use super::work::{Tally, Work};
use crate::cache::solution_key;
use crate::case::{Goal, Optimise, Sampling, Sweep, SweepAxis};
use crate::output::OutputFolder;
use crate::pipeline::{Failure, Reporter};

/// First steps of a search: a fifth of each range sees what is there, and stays within.
const FIRST_STEP: f64 = 0.2;

/// By how much a constraint may be broken, of its size: rounding.
const BROKEN: f64 = 1e-9;

/// Name of the objective in rows.
pub const OBJECTIVE: &str = "objective";

/// Name of the largest part, of its size, by which a constraint is broken.
pub const VIOLATION: &str = "violation";

/// What came of an optimisation.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// All evaluations, in their order.
    pub rows: Vec<Row>,
    /// The row of the best that holds all constraints.
    pub best: Option<usize>,
    /// Whether its place came to be known to the tolerance.
    pub converged: bool,
    /// What holds the best back: bounds and constraints, in words.
    pub active: Vec<String>,
    /// Value of the objective at the best row, and its error from those of the numbers.
    pub objective: Option<(f64, f64)>,
    /// What it took.
    pub tally: Tally,
}

/// The search, with all that it knows.
struct Climb<'a, 'w> {
    work: &'a Work<'w>,
    reporter: &'a dyn Reporter,
    out: &'a mut OutputFolder,
    optimise: &'a Optimise,
    kept: &'a HashMap<String, Row>,
    rows: Vec<Row>,
    /// What was found at the places of the rows.
    judged: Vec<Judged>,
    places: Vec<Vec<f64>>,
    seen: HashMap<Vec<String>, usize>,
    /// Size of the objective and of each constraint, from the first row that has numbers.
    sizes: Option<(f64, Vec<f64>)>,
    tally: Tally,
    failure: Option<Failure>,
    /// How many evaluations this start may make in all.
    until: usize,
}

/// What is varied as if it were a sweep, for tables and plots.
pub fn as_sweep(optimise: &Optimise) -> Sweep {
    let axes = optimise.varied.iter().map(|varied| SweepAxis {
        key: varied.key.clone(),
        values: Vec::new(),
        log: varied.log,
        range: Some(varied.range),
        unit: varied.unit.clone(),
    });
    Sweep { axes: axes.collect(), sampling: Sampling::Sobol, report: Vec::new() }
}

/// Searches, and gives all rows.
///
/// # Errors
/// The case is wrong at the place of the start; the journal or the cache cannot be written.
pub fn optimise(
    work: &Work,
    reporter: &dyn Reporter,
    out: &mut OutputFolder,
    optimise: &Optimise,
    kept: &HashMap<String, Row>,
) -> Result<Outcome, Failure> {
    let first: Vec<f64> = optimise.varied.iter().map(|varied| varied.place(varied.start).clamp(0.0, 1.0)).collect();
    let mut climb = Climb {
        work,
        reporter,
        out,
        optimise,
        kept,
        rows: Vec::new(),
        judged: Vec::new(),
        places: Vec::new(),
        seen: HashMap::new(),
        sizes: None,
        tally: Tally::default(),
        failure: None,
        until: 0,
    };
    // What is wrong where the user starts is wrong with the case.
    case_at(work.case, work.source, &climb.values(&first))?;
    let mut starts = vec![first];
    if optimise.starts > 1 {
        let drawn = unit_samples(Sampling::Sobol, optimise.starts - 1, optimise.varied.len(), optimise.seed);
        starts.extend(drawn.map_err(|most| {
            let problem = format!("{} keys: Sobol's sequence serves at most {most}", optimise.varied.len());
            work.source.error_at("study.starts", problem, "start once")
        })?);
    }
    let settings = Settings {
        optimiser: optimise.optimiser,
        tolerance: optimise.tolerance,
        first_step: FIRST_STEP,
        steps: optimise.varied.iter().any(|varied| varied.step.is_some()),
        constraints: optimise.constraints.len(),
        // Steps that can be made let a search come to the same row again, which costs nothing.
        evaluations: 10 * optimise.evaluations,
    };
    let count = starts.len();
    for (n, start) in starts.iter().enumerate() {
        // Equal shares, and what earlier ones left.
        climb.until = optimise.evaluations * (n + 1) / count;
        reporter.stage(&if count == 1 { "search".to_owned() } else { format!("search {} of {count}", n + 1) });
        // The first searches find the valley, what follows its bottom.
        search(&mut climb, start, &Settings { tolerance: settings.coarse(), ..settings });
        climb.failure.take().map_or(Ok(()), Err)?;
    }
    climb.until = optimise.evaluations;
    reporter.stage("search about the best");
    let mut converged = settle(&mut climb, &settings);
    climb.failure.take().map_or(Ok(()), Err)?;
    // Linear models do not see steps: of what comes in steps no neighbour of the best may be better.
    if settings.steps {
        while let Some(best) = climb.best_row()
            && !climb.is_over()
        {
            let around = climb.neighbours(best);
            climb.judge(&around);
            climb.failure.take().map_or(Ok(()), Err)?;
            if climb.best_row() == Some(best) {
                converged = !climb.is_over();
                break;
            }
            converged = false;
        }
    }
    Ok(climb.outcome(converged))
}

impl Landscape for Climb<'_, '_> {
    fn judge(&mut self, places: &[Vec<f64>]) -> Vec<Judged> {
        let values: Vec<Vec<String>> = places.iter().map(|place| self.values(place)).collect();
        if let Err(failure) = self.work_out(places, &values) {
            self.failure.get_or_insert(failure);
        }
        let of = |values: &Vec<String>| match self.seen.get(values) {
            Some(row) => self.judged[*row].clone(),
            // Beyond the budget: nothing to be had here.
            None => self.worst(),
        };
        values.iter().map(of).collect()
    }

    fn is_over(&self) -> bool {
        self.failure.is_some() || self.rows.len() >= self.until
    }

    fn best(&self) -> Option<(Vec<f64>, Judged)> {
        let violation = |row: &usize| self.judged[*row].slack.iter().fold(0.0_f64, |m, s| m.max(-s));
        let done = (0..self.rows.len()).filter(|row| self.rows[*row].reason().is_none());
        let nearest = || done.min_by(|a, b| violation(a).total_cmp(&violation(b)));
        self.best_row().or_else(nearest).map(|row| (self.places[row].clone(), self.judged[row].clone()))
    }

    /// Central differences of a function known to ε are off by h² from its bends and by ε/h from the errors: h = ε^(1/3).
    fn difference(&self) -> f64 {
        let least = (10.0 * self.optimise.tolerance).min(0.01);
        // Against the objective where the search began: at the optimum it may be zero.
        let size = self.sizes.as_ref().map(|(size, _)| *size);
        let relative = self.best_row().zip(size).and_then(|(best, size)| Some(self.error(&self.rows[best])? / size));
        relative.unwrap_or(1e-6).cbrt().clamp(least, 0.03)
    }
}

impl Climb<'_, '_> {
    /// The values of what is varied at a place, as they are written.
    fn values(&self, place: &[f64]) -> Vec<String> {
        self.optimise.varied.iter().zip(place).map(|(varied, x)| varied.written(varied.at(*x))).collect()
    }

    /// The places one step away from a row along each key that comes in steps, and along each pair of them.
    fn neighbours(&self, row: usize) -> Vec<Vec<f64>> {
        let place = &self.places[row];
        let mut around = vec![place.clone()];
        for (k, varied) in self.optimise.varied.iter().enumerate() {
            let Some(step) = varied.step else { continue };
            let here = varied.at(place[k]);
            let moved = |from: &Vec<f64>, by: f64| {
                let mut to = from.clone();
                to[k] = varied.place(here + by);
                to
            };
            let single = |from: &Vec<f64>| from.iter().zip(place).filter(|(a, b)| a != b).count() < 2;
            let more: Vec<Vec<f64>> = around
                .iter()
                .filter(|from| single(from))
                .flat_map(|from| [moved(from, -step), moved(from, step)])
                .collect();
            around.extend(more);
        }
        around.retain(|to| to != place && to.iter().all(|x| (-1e-9..=1.0 + 1e-9).contains(x)));
        around
    }

    /// Works out the rows that are not there yet, as far as the budget goes.
    fn work_out(&mut self, places: &[Vec<f64>], values: &[Vec<String>]) -> Result<(), Failure> {
        if self.failure.is_some() {
            return Ok(());
        }
        let first = self.rows.len();
        let (mut points, mut rows) = (Vec::new(), Vec::new());
        let mut fresh: Vec<&Vec<f64>> = Vec::new();
        for (place, values) in places.iter().zip(values) {
            let number = first + fresh.len();
            if self.seen.contains_key(values) || number >= self.until {
                continue;
            }
            self.seen.insert(values.clone(), number);
            fresh.push(place);
            match case_at(self.work.case, self.work.source, values) {
                Ok((case, _)) => {
                    let (key, solution) = (key(&case), solution_key(&case));
                    match usable(self.kept, &key) {
                        Some(row) => {
                            rows.push(Row { point: number, values: values.clone(), ..row });
                            self.tally.rows_kept += 1;
                        }
                        None => points.push(Point { number, values: values.clone(), key, solution }),
                    }
                }
                Err(error) => {
                    let end = End::refused(&error);
                    rows.push(Row { point: number, values: values.clone(), end, warnings: Vec::new() });
                }
            }
        }
        if !points.is_empty() {
            let (worked, tally) = self.work.rows(self.out, points, Vec::new(), &HashMap::new())?;
            self.tally.solved += tally.solved;
            self.tally.solutions_kept += tally.solutions_kept;
            self.tally.tabulated += tally.tabulated;
            rows.extend(worked);
        }
        rows.sort_by_key(|row| row.point);
        for (row, place) in rows.into_iter().zip(fresh) {
            self.add(row, place.clone());
        }
        self.reporter.fraction(self.rows.len() as f64 / self.optimise.evaluations as f64);
        Ok(())
    }

    /// Judges a row and keeps it.
    fn add(&mut self, mut row: Row, place: Vec<f64>) {
        let found = match row.reason() {
            None => self.objective(&row).and_then(|objective| Ok((objective, self.slacks(&row)?))),
            Some(reason) => Err(reason.to_owned()),
        };
        let judged = match found {
            Ok((objective, slack)) => {
                let size = |x: f64| if x == 0.0 { 1.0 } else { x.abs() };
                let (whole, sizes) = self.sizes.get_or_insert_with(|| {
                    let of = |(small, large): &(f64, f64)| size(small.abs().max(large.abs()));
                    (size(objective), slack.iter().map(of).collect())
                });
                let sign = if self.optimise.goal == Goal::Maximise { -1.0 } else { 1.0 };
                let slack: Vec<f64> =
                    slack.iter().zip(sizes.iter()).map(|((small, large), size)| (large - small) / size).collect();
                let judged = Judged { value: sign * objective / *whole, slack };
                if let End::Done(numbers) = &mut row.end {
                    let violation = judged.slack.iter().fold(0.0_f64, |m, s| m.max(-s));
                    numbers.insert(0, Number::new(OBJECTIVE, "", objective, None));
                    numbers.insert(1, Number::new(VIOLATION, "", violation, None));
                }
                judged
            }
            Err(reason) => {
                // Numbers there may be, but none that the objective could be made of.
                if row.reason().is_none() {
                    row.end = End::Refused(reason);
                }
                self.worst()
            }
        };
        if let Some(error) = self.error(&row)
            && let End::Done(numbers) = &mut row.end
            && let Some(first) = numbers.first_mut()
        {
            first.error = Some(error).filter(|error| error.is_finite() && *error > 0.0);
        }
        self.rows.push(row);
        self.judged.push(judged);
        self.places.push(place);
    }

    /// Worse than everything before, by as much as that differs.
    fn worst(&self) -> Judged {
        let done = || self.judged.iter().zip(&self.rows).filter(|(_, row)| row.reason().is_none()).map(|(j, _)| j);
        let largest = done().map(|j| j.value).fold(f64::NEG_INFINITY, f64::max);
        let least = done().map(|j| j.value).fold(f64::INFINITY, f64::min);
        let value = if largest.is_finite() { largest + (largest - least).max(0.1 * largest.abs()) } else { 1.0 };
        let slack = |n: usize| done().map(|j| j.slack[n]).fold(-0.1, f64::min);
        Judged { value, slack: (0..self.optimise.constraints.len()).map(slack).collect() }
    }

    /// The value of a name in a row: of a number, of what is varied in SI, or of a multipole of the RF where there is one.
    fn named(&self, row: &Row, name: &str) -> Option<f64> {
        let varied = || {
            let n = self.optimise.varied.iter().position(|varied| varied.key == name)?;
            value_in_si(&row.values[n])
        };
        number(row, name).and_then(|number| number.value).or_else(varied)
    }

    fn objective(&self, row: &Row) -> Result<f64, String> {
        self.optimise.objective.value(|name| self.named(row, name))
    }

    /// Both sides of each constraint.
    fn slacks(&self, row: &Row) -> Result<Vec<(f64, f64)>, String> {
        let side = |side: &super::expression::Expression| side.value(|name| self.named(row, name));
        self.optimise.constraints.iter().map(|c| Ok((side(&c.small)?, side(&c.large)?))).collect()
    }

    /// What the errors of the numbers make of the objective, one after the other.
    fn error(&self, row: &Row) -> Option<f64> {
        let value = self.objective(row).ok()?;
        let names = self.optimise.objective.names();
        let by = |changed: &String| {
            let by = number(row, changed)?.error?;
            let of = |name: &str| Some(self.named(row, name)? + if name == changed { by } else { 0.0 });
            Some((self.optimise.objective.value(of).ok()? - value).abs())
        };
        Some(names.iter().filter_map(by).sum())
    }

    fn holds(&self, row: usize) -> bool {
        self.rows[row].reason().is_none() && self.judged[row].slack.iter().all(|s| *s >= -BROKEN)
    }

    /// The best row that holds all constraints; the first of equals.
    fn best_row(&self) -> Option<usize> {
        let holding = (0..self.rows.len()).filter(|row| self.holds(*row));
        holding.min_by(|a, b| self.judged[*a].value.total_cmp(&self.judged[*b].value))
    }

    fn outcome(self, converged: bool) -> Outcome {
        let best = self.best_row();
        let mut active = Vec::new();
        if let Some(best) = best {
            // Within what the search tells apart.
            let near = (10.0 * self.optimise.tolerance).max(1e-3);
            for (varied, place) in self.optimise.varied.iter().zip(&self.places[best]) {
                let side = if *place < near {
                    Some(("lower", varied.range[0]))
                } else if *place > 1.0 - near {
                    Some(("upper", varied.range[1]))
                } else {
                    None
                };
                if let Some((which, bound)) = side {
                    let bound = varied.written(bound);
                    active.push(format!("{} at its {which} bound {}", varied.key, bound.trim_matches('"')));
                }
            }
            for (constraint, slack) in self.optimise.constraints.iter().zip(&self.judged[best].slack) {
                if *slack < near {
                    active.push(constraint.text.clone());
                }
            }
        }
        let objective = best.and_then(|best| {
            let row = &self.rows[best];
            Some((self.objective(row).ok()?, self.error(row).unwrap_or(0.0)))
        });
        Outcome { rows: self.rows, best, converged: converged && best.is_some(), active, objective, tally: self.tally }
    }
}

/// A number of a row; A2 is that of the RF where there is one, else of the constant voltages.
fn number<'r>(row: &'r Row, name: &str) -> Option<&'r Number> {
    let of = |name: &str| row.numbers().iter().find(|number| number.name == name);
    let multipole = name.starts_with('A') && name[1..].bytes().all(|b| b.is_ascii_digit()) && name.len() > 1;
    of(name).or_else(|| multipole.then(|| of(&format!("{name}_rf")).or_else(|| of(&format!("{name}_static"))))?)
}
