//! The search for the least value of a function in the unit cube, with constraints.
//!
//! Both methods are those of NLopt, in Rust: COBYLA (Powell 1994, "A direct search optimization method that models the objective and
//! constraint functions by linear interpolation") and SLSQP (Kraft 1988, DFVLR-FB 88-28). Neither draws random numbers: the same
//! values give the same search.

use std::cell::RefCell;

use crate::case::Optimiser;

/// A place and what was found there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judged {
    /// To be as small as can be; of the order of one.
    pub value: f64,
    /// Each to be zero or more; of the order of one.
    pub slack: Vec<f64>,
}

/// What is searched.
pub trait Landscape {
    /// What is found at each of some places in the unit cube, in their order.
    fn judge(&mut self, places: &[Vec<f64>]) -> Vec<Judged>;

    /// Whether nothing more may be asked.
    fn is_over(&self) -> bool;

    /// The best place of those that were asked for and hold all constraints; where none does, the one that breaks them least.
    fn best(&self) -> Option<(Vec<f64>, Judged)>;

    /// Distance (part of the range) of central differences: where the error of the values and that of the differences are alike.
    fn difference(&self) -> f64;
}

/// How a search is done.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// What searches.
    pub optimiser: Optimiser,
    /// Part of each range to which the place is to be known.
    pub tolerance: f64,
    /// The size of the first steps, as part of each range.
    pub first_step: f64,
    /// Whether something is varied in steps: then there are no slopes.
    pub steps: bool,
    /// How many constraints there are.
    pub constraints: usize,
    /// How many places may be asked for.
    pub evaluations: usize,
}

/// To what part of each range linear models search before other models go on from there: over a valley they come to rest where it is
/// as wide as their steps, hundreds of tolerances from its lowest place (`valleys_are_followed_to_the_tolerance`).
const COARSE: f64 = 0.01;

/// First steps of linear models that start again at the best place: at most these, else so many times what the search before moved it,
/// or the tolerance.
const SECOND_STEP: f64 = 0.04;
const OF_LAST_MOVE: f64 = 4.0;

impl Settings {
    /// The tolerance of a search after which [`settle`] is to follow. Where constraints meet linear models are right, and what these leave
    /// may be narrower than coarse steps.
    pub fn coarse(&self) -> f64 {
        let is_coarse = self.optimiser == Optimiser::Cobyla && self.constraints == 0;
        if is_coarse { self.tolerance.max(COARSE) } else { self.tolerance }
    }
}

/// Starts again at the best place, with fresh steps, until that moves it by no more than the tolerance in any direction, or makes it
/// better by no more than the square of that (over a parabola as high as it is wide they are the same); gives whether it came to that. By slopes and, unless the study is sure of those, by linear models in turn: the first find the bottom of a smooth
/// valley, the second go on where there are kinks and where constraints meet, and both have to stay where they are.
///
/// Checked by `valleys_are_followed_to_the_tolerance`.
pub fn settle(landscape: &mut dyn Landscape, settings: &Settings) -> bool {
    let methods = match settings.optimiser {
        Optimiser::Slsqp => &[Optimiser::Slsqp][..],
        Optimiser::Cobyla if settings.steps => &[Optimiser::Cobyla],
        Optimiser::Cobyla => &[Optimiser::Slsqp, Optimiser::Cobyla],
    };
    let mut moved = f64::INFINITY;
    let mut at_rest = 0;
    for optimiser in methods.iter().copied().cycle() {
        let Some((start, before)) = landscape.best().filter(|_| !landscape.is_over()) else { break };
        let first_step = (OF_LAST_MOVE * moved.max(settings.tolerance)).min(SECOND_STEP.max(settings.tolerance));
        let ended = search(landscape, &start, &Settings { optimiser, first_step, ..*settings });
        let (now, after) = landscape.best().unwrap_or_else(|| (start.clone(), before.clone()));
        moved = now.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // What breaks constraints may get worse to hold them.
        let gain = if before.slack.iter().all(|s| *s >= 0.0) { before.value - after.value } else { f64::INFINITY };
        let is_at_rest = moved <= settings.tolerance || gain <= settings.tolerance * settings.tolerance;
        at_rest = if is_at_rest { at_rest + 1 } else { 0 };
        if at_rest == methods.len() {
            // Where slopes lead nowhere at all, linear models have the last word.
            return ended || methods.len() > 1 && !landscape.is_over();
        }
    }
    false
}

/// Searches from a place; gives whether the place came to be known to the tolerance. What was found is in the landscape's own memory.
pub fn search(landscape: &mut dyn Landscape, start: &[f64], settings: &Settings) -> bool {
    match settings.optimiser {
        Optimiser::Cobyla => cobyla(landscape, start, settings),
        Optimiser::Slsqp => slsqp(landscape, start, settings),
    }
}

/// Places are told apart to this part of the tolerance: a search that stays within it costs nothing more. Not so where constraints meet,
/// which may be in no place that is told apart.
const APART: f64 = 1.0 / 16.0;

/// Of values and slacks of the order of one.
const NOWHERE: f64 = 1e6;

/// The last place that was asked for, so that objective and constraints are told of one evaluation.
struct Memory<'l> {
    landscape: &'l mut dyn Landscape,
    last: Option<(Vec<f64>, Judged)>,
    /// The same with derivatives: of the value, then of each slack.
    slopes: Option<(Vec<f64>, Vec<Vec<f64>>)>,
    /// Where the search starts, and how far apart the places are that are asked for.
    start: Vec<f64>,
    apart: f64,
}

impl<'l> Memory<'l> {
    fn new(landscape: &'l mut dyn Landscape, start: &[f64], settings: &Settings) -> Self {
        let apart = if settings.constraints == 0 { APART * settings.tolerance } else { 0.0 };
        Self { landscape, last: None, slopes: None, start: start.to_vec(), apart }
    }

    /// Within the bounds, and one of the places that are told apart; bounds are.
    fn place(&self, place: &[f64]) -> Vec<f64> {
        let near = |x: f64, from: f64| from + ((x - from) / self.apart).round() * self.apart;
        let told =
            |(x, from): (&f64, &f64)| if self.apart > 0.0 && *x > 0.0 && *x < 1.0 { near(*x, *from) } else { *x };
        place.iter().zip(&self.start).map(told).map(|x| x.clamp(0.0, 1.0)).collect()
    }

    fn judged(&mut self, place: &[f64]) -> Judged {
        if !place.iter().all(|x| x.is_finite()) {
            return self.nowhere();
        }
        let place = self.place(place);
        if let Some((known, judged)) = &self.last
            && *known == place
        {
            return judged.clone();
        }
        let judged = self.landscape.judge(std::slice::from_ref(&place)).pop().unwrap_or_default();
        self.last = Some((place, judged.clone()));
        judged
    }

    /// What is told of a place that is none: quadratic models without a slope lead there. Worse than all that was found.
    fn nowhere(&self) -> Judged {
        let slack = self.last.as_ref().map_or(0, |(_, judged)| judged.slack.len());
        Judged { value: NOWHERE, slack: vec![-NOWHERE; slack] }
    }

    fn slopes(&mut self, place: &[f64]) -> Vec<Vec<f64>> {
        if !place.iter().all(|x| x.is_finite()) {
            let count = 1 + self.nowhere().slack.len();
            return vec![vec![0.0; place.len()]; count];
        }
        let place = self.place(place);
        if let Some((known, slopes)) = &self.slopes
            && *known == place
        {
            return slopes.clone();
        }
        let h = self.landscape.difference();
        let beside = |k: usize, by: f64| {
            let mut beside = place.clone();
            // At a bound the difference is one-sided.
            beside[k] = (place[k] + by).clamp(0.0, 1.0);
            beside
        };
        let places: Vec<Vec<f64>> = (0..place.len()).flat_map(|k| [beside(k, -h), beside(k, h)]).collect();
        let judged = self.landscape.judge(&places);
        let count = judged.first().map_or(0, |j| j.slack.len());
        let of = |j: &Judged, what: usize| if what == 0 { j.value } else { j.slack[what - 1] };
        let slope = |what: usize| {
            let along = |k: usize| {
                let apart = places[2 * k + 1][k] - places[2 * k][k];
                (of(&judged[2 * k + 1], what) - of(&judged[2 * k], what)) / apart
            };
            (0..place.len()).map(along).collect()
        };
        let slopes: Vec<Vec<f64>> = (0..=count).map(slope).collect();
        self.slopes = Some((place, slopes.clone()));
        slopes
    }
}

fn cobyla(landscape: &mut dyn Landscape, start: &[f64], settings: &Settings) -> bool {
    let memory = RefCell::new(Memory::new(landscape, start, settings));
    let value = |x: &[f64], _: &mut ()| memory.borrow_mut().judged(x).value;
    let slack = |n: usize| {
        let memory = &memory;
        move |x: &[f64], _: &mut ()| memory.borrow_mut().judged(x).slack[n]
    };
    let slacks: Vec<_> = (0..settings.constraints).map(slack).collect();
    let constraints: Vec<&dyn cobyla::Func<()>> = slacks.iter().map(|f| f as &dyn cobyla::Func<()>).collect();
    let stop = cobyla::StopTols { xtol_abs: vec![settings.tolerance; start.len()], ..cobyla::StopTols::default() };
    let bounds = vec![(0.0, 1.0); start.len()];
    let first = cobyla::RhoBeg::All(settings.first_step);
    let ended = cobyla::minimize(value, start, &bounds, &constraints, (), settings.evaluations, first, Some(stop));
    let over = memory.borrow().landscape.is_over();
    // Where rounding stops it, nothing more is to be had.
    !over
        && match ended {
            Ok((status, ..)) => !matches!(status, cobyla::SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, cobyla::FailStatus::RoundoffLimited),
        }
}

fn slsqp(landscape: &mut dyn Landscape, start: &[f64], settings: &Settings) -> bool {
    let memory = RefCell::new(Memory::new(landscape, start, settings));
    let value = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
        let mut memory = memory.borrow_mut();
        let value = memory.judged(x).value;
        if let Some(gradient) = gradient {
            gradient.copy_from_slice(&memory.slopes(x)[0]);
        }
        value
    };
    // Negative where it holds.
    let slack = |n: usize| {
        let memory = &memory;
        move |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let mut memory = memory.borrow_mut();
            let value = -memory.judged(x).slack[n];
            if let Some(gradient) = gradient {
                gradient.iter_mut().zip(&memory.slopes(x)[n + 1]).for_each(|(g, s)| *g = -s);
            }
            value
        }
    };
    let slacks: Vec<_> = (0..settings.constraints).map(slack).collect();
    let constraints: Vec<&dyn slsqp::Func<()>> = slacks.iter().map(|f| f as &dyn slsqp::Func<()>).collect();
    let stop = slsqp::StopTols { xtol_abs: vec![settings.tolerance; start.len()], ..slsqp::StopTols::default() };
    let bounds = vec![(0.0, 1.0); start.len()];
    let ended = slsqp::minimize(value, start, &bounds, &constraints, (), settings.evaluations, Some(stop));
    let over = memory.borrow().landscape.is_over();
    !over
        && match ended {
            Ok((status, ..)) => !matches!(status, slsqp::SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, slsqp::FailStatus::RoundoffLimited),
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function of places, and how often it was asked for.
    struct Counted<F> {
        function: F,
        asked: usize,
        most: usize,
        best: (f64, Vec<f64>),
    }

    impl<F: Fn(&[f64]) -> Judged> Landscape for Counted<F> {
        fn judge(&mut self, places: &[Vec<f64>]) -> Vec<Judged> {
            self.asked += places.len();
            assert!(places.iter().flatten().all(|x| (0.0..=1.0).contains(x)), "{places:?}");
            let judged: Vec<Judged> = places.iter().map(|p| (self.function)(p)).collect();
            for (place, found) in places.iter().zip(&judged) {
                if found.slack.iter().all(|s| *s >= -1e-9) && found.value < self.best.0 {
                    self.best = (found.value, place.clone());
                }
            }
            judged
        }
        fn is_over(&self) -> bool {
            self.asked >= self.most
        }
        fn best(&self) -> Option<(Vec<f64>, Judged)> {
            let (value, place) = &self.best;
            value.is_finite().then(|| (place.clone(), (self.function)(place)))
        }
        fn difference(&self) -> f64 {
            1e-3
        }
    }

    fn counted<F>(function: F, most: usize) -> Counted<F> {
        Counted { function, asked: 0, most, best: (f64::INFINITY, Vec::new()) }
    }

    fn settings(optimiser: Optimiser, tolerance: f64, constraints: usize) -> Settings {
        Settings { optimiser, tolerance, first_step: 0.2, steps: false, constraints, evaluations: 2000 }
    }

    fn least(optimiser: Optimiser, constraints: usize, start: &[f64], function: impl Fn(&[f64]) -> Judged) -> Vec<f64> {
        let mut landscape = counted(function, 2000);
        let settings = settings(optimiser, 1e-6, constraints);
        assert!(search(&mut landscape, start, &settings), "{optimiser:?}: {} evaluations", landscape.asked);
        landscape.best.1
    }

    #[test]
    fn valleys_are_followed_to_the_tolerance() {
        // Across the axes of the cube, steeper across than along by up to 300, smooth or with a kink, about thirty places; and with a
        // wall through them, on which the lowest place is where both slopes along it balance.
        type Form = fn(f64, f64, f64) -> f64;
        let smooth: Form = |k, u, v| k * u * u + v * v;
        let kinked: Form = |k, u, v| k * u.abs() + v.abs();
        let tolerance = 1e-4;
        for (form, steep, wall, most, tolerances) in [
            (smooth, 1.0, false, 100, 1.0),
            (smooth, 6.0, false, 150, 1.0),
            (smooth, 300.0, false, 150, 1.0),
            (smooth, 6.0, true, 300, 1.0),
            // The edge of a fold has no slope: linear models alone walk along it.
            (kinked, 6.0, false, 300, 2.0),
        ] {
            for n in 0..30 {
                let at = [0.3 + 0.013 * f64::from(n), 0.62 - 0.007 * f64::from(n)];
                let expected = if wall { [at[0] - 0.1, at[1] + 0.1 * (steep - 1.0) / (steep + 1.0)] } else { at };
                let function = |x: &[f64]| {
                    let (x, y) = (x[0] - at[0], x[1] - at[1]);
                    let slack = if wall { vec![-0.1 - x] } else { Vec::new() };
                    Judged { value: form(steep, x + y, x - y), slack }
                };
                for optimiser in [Optimiser::Cobyla, Optimiser::Slsqp] {
                    if optimiser == Optimiser::Slsqp && (wall || tolerances > 1.0) {
                        continue;
                    }
                    let mut landscape = counted(function, 1000);
                    let settings = settings(optimiser, tolerance, usize::from(wall));
                    search(&mut landscape, &[0.5, 0.5], &Settings { tolerance: settings.coarse(), ..settings });
                    let case = format!("{optimiser:?}, {steep}, {wall}, {n}: {} evaluations", landscape.asked);
                    assert!(settle(&mut landscape, &settings), "{case}");
                    let off = landscape.best.1.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off <= tolerances * tolerance, "{case}: {off}");
                    assert!(landscape.asked <= most, "{case}, then {}", landscape.asked);
                }
            }
        }
    }

    #[test]
    fn optima_of_closed_forms_are_found() {
        for optimiser in [Optimiser::Cobyla, Optimiser::Slsqp] {
            let near = |found: Vec<f64>, expected: &[f64], by: f64| {
                let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < by, "{optimiser:?}: {found:?}, not {expected:?}");
            };
            // 1. A bowl, its axes across those of the cube. Linear models know the place of a parabola's bottom to the tolerance or so.
            let bowl = |x: &[f64]| {
                let (s, d) = (x[0] + x[1] - 1.0, x[0] - x[1] + 0.2);
                Judged { value: 3.0 * s * s + 0.5 * d * d, slack: Vec::new() }
            };
            near(least(optimiser, 0, &[0.9, 0.1], bowl), &[0.4, 0.6], 1e-4);
            // 2. A slope: a corner of the cube, to the last bit.
            let slope = |x: &[f64]| Judged { value: x[0] - 2.0 * x[1], slack: Vec::new() };
            near(least(optimiser, 0, &[0.5, 0.5], slope), &[0.0, 1.0], 1e-12);
            // 3. The point of a circle that is farthest down (Lagrange): centre minus radius times (3, 4)/5.
            let circle = |x: &[f64]| {
                let r = (x[0] - 0.5).powi(2) + (x[1] - 0.5).powi(2);
                Judged { value: 3.0 * x[0] + 4.0 * x[1], slack: vec![0.0625 - r] }
            };
            near(least(optimiser, 1, &[0.5, 0.6], circle), &[0.35, 0.3], 1e-4);
        }
    }
}
