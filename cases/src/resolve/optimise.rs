//! What a study optimises, resolved: formulas read, names known, bounds in order.

use super::at::At;
use super::sweep::{end, varies};
use crate::case::{Asked, Case, Constraint, Optimise, StudyKind, Tie, Varied};
use crate::error::CaseError;
use crate::keys::study::{OF_OPTIMISATION, StudyKeys, VaryKeys};
use crate::keys::sweep::Scale;
use crate::study::expression::Expression;
use crate::study::names::{From, asked, listed, names, origin};
use crate::suggestion::nearest;

/// Beyond this an optimisation would not end.
const MOST_EVALUATIONS: usize = 100_000;

/// What is optimised, if anything is, and the numbers that the study takes.
pub(super) fn optimise(at: &At, keys: &StudyKeys, case: &Case) -> Result<(Option<Optimise>, Asked), CaseError> {
    if case.study.kind != StudyKind::Optimise {
        if let Some(key) = OF_OPTIMISATION.iter().find(|key| at.key(key).written()) {
            let help = "write kind = \"optimise\" in [study], or leave this out";
            return Err(at.key(key).key_error("only an optimisation has this key", help));
        }
        let report = case.sweep.iter().flat_map(|sweep| &sweep.report);
        let grids = case.study.kind == StudyKind::GridTransparency;
        // A sweep that names no number of its flights does without them.
        let all = case.sweep.as_ref().is_none_or(|sweep| sweep.report.is_empty());
        return Ok((None, Asked { grids, ..asked(case, report.map(String::as_str), all) }));
    }
    if case.sweep.is_some() {
        let help = "leave [sweep] out, or write kind = \"sweep\" in [study]";
        return Err(At::root(at.source).key("sweep").key_error("an optimisation varies what [study.vary] says", help));
    }
    if keys.vary.is_empty() {
        let help =
            "add [study.vary] with a line such as \"electrode.ring.radius\" = { from = \"5 mm\", to = \"20 mm\" }";
        return Err(at.missing("vary", "an optimisation has to vary something", help));
    }
    let ties = ties(&at.key("tie"), keys)?;
    let varied: Vec<Varied> = keys
        .vary
        .iter()
        .map(|(key, keys)| varied(&at.key("vary").key(key), key, keys, &ties))
        .collect::<Result<_, _>>()?;
    let known = Known { names: names(case), varied: &varied };
    for tie in &ties {
        for name in tie.value.names() {
            if !varied.iter().any(|varied| varied.key == *name) {
                let all: Vec<String> = varied.iter().map(|varied| varied.key.clone()).collect();
                let help = format!("what [study.vary] varies can be used: {}", all.join(", "));
                return Err(at
                    .key("tie")
                    .key(&tie.key)
                    .error(format!("{{value}} uses `{name}`, which is not varied"), help));
            }
        }
    }
    let Some(text) = &keys.objective else {
        let help = "add objective = \"depth_ev\", or another formula over reported numbers";
        return Err(at.missing("objective", "an optimisation has to say what is to be large or small", help));
    };
    let objective = known.formula(&at.key("objective"), text)?;
    if objective.names().is_empty() {
        let help = format!("use numbers that change: {}", listed(&known.names));
        return Err(at.key("objective").error("{value} is the same everywhere", help));
    }
    let constraints: Vec<Constraint> = keys
        .constraints
        .iter()
        .enumerate()
        .map(|(n, text)| known.constraint(&at.key("constraints").entry(n), text))
        .collect::<Result<_, _>>()?;
    let evaluations = keys.evaluations.map_or(EVALUATIONS, |n| n.count());
    if evaluations > MOST_EVALUATIONS {
        return Err(at.key("evaluations").error(format!("{{value}} is more than {MOST_EVALUATIONS}"), "allow fewer"));
    }
    let starts = keys.starts.map_or(1, |n| n.count());
    // A simplex has to be begun and moved.
    let least = starts.saturating_mul(varied.len() + 2);
    if evaluations < least {
        let problem = format!("{evaluations} evaluations are too few for {starts} starts and {} keys", varied.len());
        return Err(at.key("evaluations").error(problem, format!("allow at least {least}")));
    }
    let formulas = constraints.iter().flat_map(|c| [&c.small, &c.large]).chain([&objective]);
    let asked = asked(case, formulas.flat_map(Expression::names).map(String::as_str), false);
    let optimise = Optimise {
        objective,
        goal: keys.goal.unwrap_or_default(),
        constraints,
        varied,
        ties,
        evaluations,
        tolerance: keys.tolerance.map_or(TOLERANCE, |tolerance| tolerance.value),
        optimiser: keys.optimiser.unwrap_or_default(),
        starts,
        seed: keys.seed.map_or(1, |seed| seed.0),
    };
    Ok((Some(optimise), asked))
}

/// Enough for four keys without derivatives.
const EVALUATIONS: usize = 200;

/// A ten thousandth of a range is below what is made.
const TOLERANCE: f64 = 1e-4;

/// What formulas may name.
struct Known<'a> {
    names: Vec<(String, From)>,
    varied: &'a [Varied],
}

impl Known<'_> {
    fn formula(&self, at: &At, text: &str) -> Result<Expression, CaseError> {
        let formula = read(at, text)?;
        for name in formula.names() {
            if self.varied.iter().any(|varied| varied.key == *name) || origin(&self.names, name).is_some() {
                continue;
            }
            let varied: Vec<String> = self.varied.iter().map(|varied| varied.key.clone()).collect();
            let all: Vec<String> = self.names.iter().map(|(name, _)| name.clone()).chain(varied.clone()).collect();
            let meant = nearest(name, &all).map(|name| format!("did you mean `{name}`? ")).unwrap_or_default();
            let help = format!("{meant}There are {}, and what is varied: {}", listed(&self.names), varied.join(", "));
            return Err(at.error(format!("{{value}}: no number of this case is called `{name}`"), help));
        }
        Ok(formula)
    }

    fn constraint(&self, at: &At, text: &str) -> Result<Constraint, CaseError> {
        let help =
            "write two formulas with <= or >= between them, as \"q_z <= 0.4\"; for an equality, \"abs(A4) <= 1\"";
        let wrong = || at.error("{value} is no constraint", help);
        let at_sign = text.find(['<', '>', '=']).ok_or_else(wrong)?;
        let (left, rest) = text.split_at(at_sign);
        let right = rest.trim_start_matches(['<', '>', '=']);
        let sign = rest[..rest.len() - right.len()].trim();
        if right.contains(['<', '>', '=']) {
            return Err(wrong());
        }
        let (left, right) = (self.formula(at, left)?, self.formula(at, right)?);
        if left.names().is_empty() && right.names().is_empty() {
            return Err(at.error("{value} does not depend on anything", help));
        }
        let text = text.trim().to_owned();
        match sign {
            "<=" | "<" => Ok(Constraint { text, small: left, large: right }),
            ">=" | ">" => Ok(Constraint { text, small: right, large: left }),
            _ => Err(wrong()),
        }
    }
}

fn read(at: &At, text: &str) -> Result<Expression, CaseError> {
    Expression::parse(text).map_err(|problem| {
        let help = "write a formula such as \"depth_ev - 2 * abs(A4 / A2)\"";
        at.error(format!("{{value}} is no formula: {problem}"), help)
    })
}

fn ties(at: &At, keys: &StudyKeys) -> Result<Vec<Tie>, CaseError> {
    let tie = |(key, text): (&String, &String)| {
        let at = at.key(key);
        varies(&at, key, &["0".to_owned()])?;
        if keys.vary.contains_key(key) {
            return Err(at.key_error("this key is varied too", "vary it or tie it, not both"));
        }
        Ok(Tie { key: key.clone(), value: read(&at, text)? })
    };
    keys.tie.iter().map(tie).collect()
}

fn varied(at: &At, key: &str, keys: &VaryKeys, ties: &[Tie]) -> Result<Varied, CaseError> {
    let (from, unit) = end(&at.key("from"), &keys.from)?;
    let mut range = [from, 0.0];
    let (mut start, mut step) = (None, None);
    for (name, written) in [("to", Some(&keys.to)), ("start", keys.start.as_ref()), ("step", keys.step.as_ref())] {
        let Some(written) = written else { continue };
        let (value, other) = end(&at.key(name), written)?;
        if other != unit {
            let problem = format!("{{value}} has another unit than from = {}", at.key("from").shown());
            return Err(at.key(name).error(problem, "write all of them in the same unit"));
        }
        match name {
            "to" => range[1] = value,
            "start" => start = Some(value),
            _ => step = Some(value),
        }
    }
    if range[0] >= range[1] {
        let problem = format!("{{value}} is not above from = {}", at.key("from").shown());
        return Err(at
            .key("to")
            .error(problem, "leave room between the bounds; a key that does not vary is set in the case"));
    }
    if let Some(step) = step
        && !(step > 0.0 && step <= range[1] - range[0])
    {
        let problem = "{value} is not above zero and within the bounds";
        return Err(at.key("step").error(problem, "write a step that fits between the bounds at least once"));
    }
    let log = matches!(keys.scale, Some(Scale::Log));
    if log && range[0] * range[1] <= 0.0 {
        let problem = "{value} needs two bounds of the same sign, neither of them zero";
        return Err(at.key("scale").error(problem, "write scale = \"linear\", or move the bounds"));
    }
    let used = ties.iter().any(|tie| tie.value.names().iter().any(|name| name == key));
    // A name without points is no key that could vary: then it is one for ties.
    let is_key = key.contains('.');
    if is_key {
        varies(at, key, &["0".to_owned()])?;
    } else if !used {
        let help = "name a key, as \"electrode.ring.radius\", or use the name in [study.tie], as \"electrode.left.opening\" = \"NAME\"";
        return Err(at.key_error("this is no key of the case, and no tie uses it", help.replace("NAME", key)));
    }
    let mut varied = Varied { key: key.to_owned(), is_key, range, start: 0.0, step, unit, log };
    varied.start = start.unwrap_or_else(|| varied.at(0.5));
    if !(range[0]..=range[1]).contains(&varied.start) {
        let problem = format!("{{value}} is not between {} and {}", at.key("from").shown(), at.key("to").shown());
        return Err(at.key("start").error(problem, "start within the bounds"));
    }
    Ok(varied)
}
