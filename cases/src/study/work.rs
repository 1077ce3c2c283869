//! The work of a study: solutions one after the other, the points on each of them in parallel.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::grid;
use super::grid::strikes::{Book, Strike};
use super::journal::{Journal, usable};
use super::numbers;
use super::points::{Point, Refused, case_at};
use super::row::{End, Number, Row};
use super::trap;
use crate::CaseSource;
use crate::cache::{Cache, Digest, solution_key, table_key};
use crate::case::Case;
use crate::output::OutputFolder;
use crate::pipeline::flights::{Flights, fly, induction, obstacles};
use crate::pipeline::ready::{Ready, check_starts_again, flight_region, ready};
use crate::pipeline::solution::{Solution, solve};
use crate::pipeline::tables::{Plan, Tabulated, table};
use crate::pipeline::{Failure, Reporter, drives};

/// A point that came to nothing before it could fly.
type Fallen = Box<(Point, Failure)>;

/// Points that are prepared at a time: their first meshes are in memory together.
const CHUNK: usize = 32;

/// What a study took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Solutions of the field that were worked out.
    pub solved: usize,
    /// Solutions that an earlier command had kept.
    pub solutions_kept: usize,
    /// Tables that were worked out.
    pub tabulated: usize,
    /// Rows that an earlier study had kept.
    pub rows_kept: usize,
}

/// Collects warnings, and tells nobody else.
#[derive(Default)]
pub(super) struct Quiet(Mutex<Vec<String>>);

impl Quiet {
    fn said(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Reporter for Quiet {
    fn stage(&self, _: &str) {}
    fn fraction(&self, _: f64) {}
    fn warning(&self, text: &str) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.to_owned());
    }
}

/// A study that is being worked out.
pub struct Work<'a> {
    /// The case with its sweep.
    pub case: &'a Case,
    /// Where it was written.
    pub source: &'a CaseSource,
    /// Where solutions and tables are kept.
    pub cache: &'a Cache,
    /// Where rows are kept.
    pub journal: &'a Journal,
    /// Where strikes on grids are kept.
    pub strikes: &'a Book,
    /// Who is told how far the work is.
    pub reporter: &'a dyn Reporter,
    /// What was solved with plates in place of grids.
    pub solids: Mutex<HashMap<Digest, Arc<Solution>>>,
    /// The last solution: points that come one after the other may share it.
    pub last: Mutex<Option<(Digest, Arc<Solution>)>>,
}

/// A point whose case stands ready to fly.
struct Standing {
    point: Point,
    case: Case,
    source: CaseSource,
    ready: Ready,
    plan: Option<Plan>,
    warnings: Vec<String>,
}

impl Work<'_> {
    /// Works out all points, and gives their rows in the order of the sweep.
    ///
    /// # Errors
    /// The journal or the cache cannot be written. What is wrong at a point is in its row.
    pub fn rows(
        &self,
        out: &mut OutputFolder,
        points: Vec<Point>,
        refused: Vec<Refused>,
        kept: &HashMap<String, Row>,
    ) -> Result<(Vec<Row>, Tally), Failure> {
        let total = points.len();
        let (mut rows, mut tally) = (Vec::new(), Tally::default());
        for Refused { number, values, error } in refused {
            rows.push(Row { point: number, values, end: End::refused(&error), warnings: Vec::new() });
        }
        // In the order in which solutions first appear.
        let mut groups: Vec<Vec<Point>> = Vec::new();
        let mut place: HashMap<Digest, usize> = HashMap::new();
        for point in points {
            if let Some(row) = usable(kept, &point.key) {
                rows.push(Row { point: point.number, values: point.values, ..row });
                tally.rows_kept += 1;
                continue;
            }
            let next = groups.len();
            let at = *place.entry(point.solution).or_insert(next);
            if at == next {
                groups.push(Vec::new());
            }
            groups[at].push(point);
        }
        let done = AtomicUsize::new(tally.rows_kept);
        let count = groups.len();
        for (number, group) in groups.into_iter().enumerate() {
            let stage = format!("field {} of {count}", number + 1);
            self.reporter.stage(&stage);
            self.reporter.fraction(done.load(Ordering::Relaxed) as f64 / total.max(1) as f64);
            rows.extend(self.group(out, group, &mut tally, &|| {
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                self.reporter.fraction(done as f64 / total as f64);
            })?);
        }
        rows.sort_by_key(|row| row.point);
        Ok((rows, tally))
    }

    /// The points on one solution.
    fn group(
        &self,
        out: &mut OutputFolder,
        group: Vec<Point>,
        tally: &mut Tally,
        done: &(dyn Fn() + Sync),
    ) -> Result<Vec<Row>, Failure> {
        let shared = group.len() > 1;
        let mut rows = Vec::with_capacity(group.len());
        let mut solved: Option<Result<Arc<Solution>, Failure>> = None;
        let mut last: Option<(Digest, Tabulated)> = None;
        let mut rest = group.into_iter().peekable();
        while rest.peek().is_some() {
            let chunk: Vec<Point> = rest.by_ref().take(CHUNK).collect();
            let standing: Vec<Result<Standing, Fallen>> =
                chunk.into_par_iter().with_max_len(1).map(|point| self.stand(point)).collect();
            let mut flying = Vec::new();
            for standing in standing {
                let Some(standing) = self.standing(standing, &mut rows, done)? else { continue };
                let solution = solved.get_or_insert_with(|| self.solution(&standing, tally));
                match solution {
                    Ok(_) => flying.push(standing),
                    Err(failure) => rows.push(self.failed(standing.point, failure, done)?),
                }
            }
            let Some(Ok(solution)) = &solved else { continue };
            let compared = match flying.first().map(|first| self.solid(first, tally)).transpose() {
                Ok(compared) => compared.flatten(),
                Err(failure) => {
                    for standing in flying {
                        rows.push(self.failed(standing.point, &failure, done)?);
                    }
                    continue;
                }
            };
            if shared
                && !solution.kept
                && let Some(first) = flying.first()
            {
                self.cache.write_solution(out, &first.case, solution)?;
            }
            let planned: Vec<Result<Standing, Fallen>> =
                flying.into_par_iter().with_max_len(1).map(|standing| planned(standing, solution)).collect();
            let mut by_table: Vec<(Option<Digest>, Vec<Standing>)> = Vec::new();
            for standing in planned {
                let Some(standing) = self.standing(standing, &mut rows, done)? else { continue };
                let key = standing.plan.as_ref().map(|plan| table_key(&standing.case, plan));
                match by_table.iter_mut().find(|(known, _)| *known == key) {
                    Some((_, members)) => members.push(standing),
                    None => by_table.push((key, vec![standing])),
                }
            }
            for (key, members) in by_table {
                if let Some(key) = key
                    && last.as_ref().is_none_or(|(known, _)| *known != key)
                {
                    last = None;
                    match self.table(out, &members, solution, tally) {
                        Ok(tabulated) => last = Some((key, tabulated)),
                        Err(failure) => {
                            for standing in members {
                                rows.push(self.failed(standing.point, &failure, done)?);
                            }
                            continue;
                        }
                    }
                }
                let tabulated = key.and(last.as_ref()).map(|(_, tabulated)| tabulated);
                let worked: Result<Vec<Row>, Failure> = members
                    .into_par_iter()
                    .with_max_len(1)
                    .map(|standing| {
                        let key = standing.point.key;
                        let (row, struck) = row(standing, solution, compared.as_deref(), tabulated);
                        self.strikes.add(&key, struck)?;
                        self.journal.add(&key, &row)?;
                        done();
                        Ok(row)
                    })
                    .collect();
                rows.extend(worked?);
            }
        }
        Ok(rows)
    }

    /// A point that stands; one that does not becomes a row.
    fn standing(
        &self,
        standing: Result<Standing, Fallen>,
        rows: &mut Vec<Row>,
        done: &(dyn Fn() + Sync),
    ) -> Result<Option<Standing>, Failure> {
        match standing {
            Ok(standing) => Ok(Some(standing)),
            Err(fallen) => {
                let (point, failure) = *fallen;
                rows.push(self.failed(point, &failure, done)?);
                Ok(None)
            }
        }
    }

    /// The row of a point that failed, kept.
    fn failed(&self, point: Point, failure: &Failure, done: &(dyn Fn() + Sync)) -> Result<Row, Failure> {
        let key = point.key;
        let end = End::of(failure);
        let row = Row { point: point.number, values: point.values, end, warnings: Vec::new() };
        self.journal.add(&key, &row)?;
        done();
        Ok(row)
    }

    /// The case of a point, with its first mesh and its grains.
    fn stand(&self, point: Point) -> Result<Standing, Fallen> {
        let quiet = Quiet::default();
        let stands = || -> Result<_, Failure> {
            let (case, source) = case_at(self.case, self.source, &point.values)?;
            let ready = ready(&case, &source, &quiet)?;
            Ok((case, source, ready))
        };
        match stands() {
            Ok((case, source, ready)) => {
                Ok(Standing { point, case, source, ready, plan: None, warnings: quiet.said() })
            }
            Err(failure) => Err(Box::new((point, failure))),
        }
    }

    fn solution(&self, first: &Standing, tally: &mut Tally) -> Result<Arc<Solution>, Failure> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let key = first.point.solution;
        if let Some((known, solution)) = &*last
            && *known == key
        {
            return Ok(Arc::clone(solution));
        }
        // Before the next is there: two may not fit.
        *last = None;
        let solution = match self.cache.solution(&first.case) {
            Ok(Some(solution)) => {
                tally.solutions_kept += 1;
                solution
            }
            _ => {
                tally.solved += 1;
                // Its warnings come with the solution, kept or not.
                solve(&first.case, &first.source, &first.ready, &Quiet::default())?
            }
        };
        let solution = Arc::new(solution);
        *last = Some((key, Arc::clone(&solution)));
        Ok(solution)
    }

    /// The same trap with plates in place of its grids, where the study is one of grids.
    fn solid(&self, first: &Standing, tally: &mut Tally) -> Result<Option<Arc<Solution>>, Failure> {
        if !first.case.study.asked.grids {
            return Ok(None);
        }
        let case = grid::with_plates(&first.case, &first.source)?;
        let key = solution_key(&case);
        let mut solids = self.solids.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(solid) = solids.get(&key) {
            return Ok(Some(Arc::clone(solid)));
        }
        tally.solved += 1;
        let ready = ready(&case, &first.source, &Quiet::default())?;
        let solid = Arc::new(solve(&case, &first.source, &ready, &Quiet::default())?);
        solids.insert(key, Arc::clone(&solid));
        Ok(Some(solid))
    }

    fn table(
        &self,
        out: &mut OutputFolder,
        members: &[Standing],
        solution: &Solution,
        tally: &mut Tally,
    ) -> Result<Tabulated, Failure> {
        let Some((first, plan)) = members.first().and_then(|m| Some((m, m.plan.as_ref()?))) else {
            return Err(Failure::run("there is nothing to tabulate", "this is a defect of graintrap"));
        };
        if let Ok(Some(tabulated)) = self.cache.table(&first.case, plan) {
            return Ok(tabulated);
        }
        tally.tabulated += 1;
        let tabulated = table(&first.case, &first.source, &solution.basis, plan, &Quiet::default())?;
        if members.len() > 1 {
            self.cache.write_table(out, &first.case, plan, &tabulated)?;
        }
        Ok(tabulated)
    }
}

/// Plans the table of a point whose grains fly.
fn planned(standing: Standing, solution: &Solution) -> Result<Standing, Fallen> {
    let plan = || {
        let Standing { case, source, ready, .. } = &standing;
        check_starts_again(case, source, ready, &solution.basis)?;
        if ready.ensemble.is_empty() || !case.study.asked.flights {
            return Ok(None);
        }
        Ok(Some(Plan::new(case, &solution.basis)))
    };
    match plan() {
        Ok(plan) => Ok(Standing { plan, ..standing }),
        Err(failure) => Err(Box::new((standing.point, failure))),
    }
}

/// Flies the grains of a point, if it has any, and reports; with the strikes on grids, where the study is one of those.
fn row(
    standing: Standing,
    solution: &Solution,
    solid: Option<&Solution>,
    tabulated: Option<&Tabulated>,
) -> (Row, Vec<Strike>) {
    let quiet: Arc<Quiet> = Arc::default();
    let worked = worked(&standing, solution, solid, tabulated, &quiet);
    let mut warnings = solution.warnings.clone();
    warnings.extend(standing.warnings);
    warnings.extend(quiet.said());
    let (end, struck) = match worked {
        Ok((numbers, struck)) => (End::Done(numbers), struck),
        Err(failure) => (End::of(&failure), Vec::new()),
    };
    (Row { point: standing.point.number, values: standing.point.values, end, warnings }, struck)
}

fn worked(
    standing: &Standing,
    solution: &Solution,
    solid: Option<&Solution>,
    tabulated: Option<&Tabulated>,
    quiet: &Arc<Quiet>,
) -> Result<(Vec<Number>, Vec<Strike>), Failure> {
    let case = &standing.case;
    let mut numbers = numbers::of_field(case, solution);
    let mut struck = Vec::new();
    if let Some(solid) = solid {
        numbers.extend(grid::of_grid(case, &standing.source, solution, solid, tabulated, &**quiet)?);
    }
    numbers.extend(trap::of_trap(case, &standing.source, solution)?);
    if let Some(tabulated) = tabulated {
        tabulated.warn_if_missed(case, &**quiet);
        numbers.extend(numbers::of_table(tabulated));
        if let Some(flights) = flights(standing, solution, tabulated, quiet)? {
            numbers.extend(numbers::of_flights(case, &flights));
            if solid.is_some() {
                numbers.extend(grid::of_grains(case, &standing.ready.ensemble, &flights));
                struck = grid::strikes::strikes(case, &flights);
            }
        }
    }
    Ok((numbers, struck))
}

fn flights(
    standing: &Standing,
    solution: &Solution,
    tabulated: &Tabulated,
    quiet: &Arc<Quiet>,
) -> Result<Option<Flights>, Failure> {
    let Standing { case, source, ready, .. } = standing;
    let Some(settings) = &case.trace else { return Ok(None) };
    let mesh = &solution.basis.mesh;
    let driven = drives::tabulated_field(case, &solution.basis, &tabulated.table);
    let region = flight_region(case, mesh);
    let surface = obstacles(mesh, case.field.ground.as_ref(), &region);
    let induction = induction(case, source, &ready.electrodes, &**quiet)?;
    let reporter: Arc<dyn Reporter> = quiet.clone();
    // Rows tell where grains are and how fast, not what pushes them.
    fly(case, settings, source, driven.field, induction, surface, &ready.ensemble, region, false, None, &reporter)
        .map(Some)
}
