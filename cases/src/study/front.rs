//! Light against field: which grids are worth making.

use serde_json::{Value, json};

use super::row::Row;
use crate::case::{Sweep, Weighing};
use crate::output::summary::metres;
use crate::plots::{Curve, Figure, Mark, Panel, Shape};

/// A grid as a compromise.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    /// Which row.
    row: usize,
    /// Transparency.
    light: f64,
    /// Largest deviation of the field, against the strongest.
    deviation: f64,
}

/// The grids that no other surpasses in both light and field.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// All that were looked at and can be made.
    grids: Vec<Grid>,
    /// Places in `grids`, from dark to bright.
    front: Vec<usize>,
    /// The last from which more light costs little; none where the front has no bend towards the better.
    knee: Option<usize>,
    /// The best of the user's own weighting.
    optimum: usize,
    /// The name of the number that tells the transparency.
    light: &'static str,
    tolerated: f64,
}

impl Front {
    /// Of the rows of a study of grids. `None` where no row tells of light and field.
    pub fn of(rows: &[Row], weighing: &Weighing) -> Option<Self> {
        // Light from a cone is what an instrument sees, where the study looks at one.
        let light =
            if rows.iter().any(|row| row.value("light.cone").is_some()) { "light.cone" } else { "open_fraction" };
        let grid = |(n, row): (usize, &Row)| {
            // A wire as narrow as can be made, to rounding.
            let makeable = row.value("wire")? >= weighing.smallest_wire * (1.0 - 1e-9);
            let (light, deviation) = (row.value(light)?, row.value("field_deviation_max")?);
            makeable.then_some(Grid { row: n, light, deviation })
        };
        let grids: Vec<Grid> = rows.iter().enumerate().filter_map(grid).collect();
        let front = front(&grids);
        let cost = |grid: &Grid| weighing.weight * (1.0 - grid.light) + grid.deviation / weighing.tolerated;
        let optimum = (0..grids.len()).min_by(|a, b| cost(&grids[*a]).total_cmp(&cost(&grids[*b])))?;
        let knee = knee(&grids, &front);
        Some(Self { front, knee, optimum, grids, light, tolerated: weighing.tolerated })
    }

    /// For programs: points are counted from 1, as in the table.
    pub fn json(&self, rows: &[Row]) -> Value {
        let point = |grid: usize| rows[self.grids[grid].row].point + 1;
        json!({
            "transparency": self.light,
            "front": self.front.iter().map(|grid| point(*grid)).collect::<Vec<_>>(),
            "knee": self.knee.map(point),
            "optimum": point(self.optimum),
        })
    }

    /// What the plot says, in words.
    pub fn sentence(&self, sweep: &Sweep, rows: &[Row]) -> String {
        let told = |n: usize| {
            let grid = &self.grids[n];
            let row = &rows[grid.row];
            let keys = sweep.axes.iter().zip(&row.values).map(|(axis, value)| format!("{} = {value}", axis.key));
            let size = |name: &str| row.value(name).map(metres).unwrap_or_default();
            format!(
                "point {} ({}; pitch {}, wire {}) lets {:.1} % of the light through and changes the field by at most {:.2} %",
                row.point + 1,
                keys.collect::<Vec<_>>().join(", "),
                size("pitch"),
                size("wire"),
                100.0 * grid.light,
                100.0 * grid.deviation
            )
        };
        let within = self.grids.iter().enumerate().filter(|(_, grid)| grid.deviation <= self.tolerated);
        let brightest = within.max_by(|a, b| a.1.light.total_cmp(&b.1.light)).map(|(n, _)| n);
        let budget = match brightest {
            Some(n) => format!("the brightest within {:.2} % of the field: {}", 100.0 * self.tolerated, told(n)),
            None => format!("none is within {:.2} % of the field", 100.0 * self.tolerated),
        };
        format!(
            "of {} grids {} are surpassed by none in both light and field; {}; {budget}; the best by the study's weights: {}",
            self.grids.len(),
            self.front.len(),
            self.knee.map_or("there is no knee between the ends of these".to_owned(), |knee| format!(
                "the knee: {}",
                told(knee)
            )),
            told(self.optimum)
        )
    }

    /// Deviation over light, a curve for each wire.
    pub fn figure(&self, title: &str, _: &Sweep, rows: &[Row]) -> Figure {
        let at = |n: &usize| [100.0 * self.grids[*n].light, (100.0 * self.grids[*n].deviation).log10()];
        let wire = |n: usize| rows[self.grids[n].row].value("wire").unwrap_or(0.0);
        let mut wires: Vec<f64> = (0..self.grids.len()).map(wire).collect();
        wires.sort_by(f64::total_cmp);
        wires.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * b.abs());
        let mut curves = Vec::new();
        // Wires that are all different, as where holes shrink in one plate, make one curve.
        if wires.len() <= MOST_CURVES {
            for (colour, width) in wires.iter().enumerate() {
                let mut of: Vec<usize> =
                    (0..self.grids.len()).filter(|n| (wire(*n) - width).abs() <= 1e-9 * width).collect();
                of.sort_by(|a, b| self.grids[*a].light.total_cmp(&self.grids[*b].light));
                let points = of.iter().map(at).collect();
                curves.push(Curve { label: format!("wire {}", metres(*width)), points, colour, faint: false });
            }
        }
        let mark = |label: &str, of: Vec<usize>, shape: Shape| Mark {
            label: label.to_owned(),
            points: of.iter().map(at).collect(),
            shape,
        };
        let marks = vec![
            mark("surpassed by none", self.front.clone(), Shape::Circle),
            mark("knee", self.knee.into_iter().collect(), Shape::Triangle),
            mark("best by weight", vec![self.optimum], Shape::Cross),
        ];
        let budget = (100.0 * self.tolerated).log10();
        let ends = || self.grids.iter().map(|grid| 100.0 * grid.light);
        let line = [ends().fold(f64::INFINITY, f64::min), ends().fold(f64::NEG_INFINITY, f64::max)];
        curves.push(Curve {
            label: format!("tolerated {:.2} %", 100.0 * self.tolerated),
            points: line.map(|x| [x, budget]).to_vec(),
            colour: 6,
            faint: true,
        });
        let panel = Panel {
            x_label: if self.light == "light.cone" { "light from the cone (%)" } else { "open fraction (%)" }
                .to_owned(),
            y_label: "log₁₀ of the largest deviation of the field (%)".to_owned(),
            curves,
            marks,
            ..Panel::default()
        };
        let subtitle = format!("{} grids; below and to the right is better", self.grids.len());
        Figure { title: title.to_owned(), subtitle, panels: vec![panel], ..Figure::default() }
    }
}

/// Curves in one panel: colours but the one of the budget.
const MOST_CURVES: usize = 6;

/// What is on the line between the ends but for rounding is not below it, in units of the front's extent.
const ROUNDING: f64 = 1e-9;

/// The grids that none surpasses, from dark to bright.
fn front(grids: &[Grid]) -> Vec<usize> {
    let surpasses = |a: &Grid, b: &Grid| {
        a.light >= b.light && a.deviation <= b.deviation && (a.light > b.light || a.deviation < b.deviation)
    };
    let mut front: Vec<usize> =
        (0..grids.len()).filter(|n| !grids.iter().any(|other| surpasses(other, &grids[*n]))).collect();
    front.sort_by(|a, b| grids[*a].light.total_cmp(&grids[*b].light));
    front
}

/// The grid of the front furthest below the line between its ends, light against the logarithm of the deviation, both in units of
/// the front's extent; `None` where none is below it: an end of the front is no knee.
///
/// Source: Das 1999, the normal-boundary characterisation of the knee. Checked by `the_front_and_its_knee`.
fn knee(grids: &[Grid], front: &[usize]) -> Option<usize> {
    let (first, last) = (&grids[*front.first()?], &grids[*front.last()?]);
    let height = |grid: &Grid| grid.deviation.max(1e-15).ln();
    let (width, rise) = (last.light - first.light, height(last) - height(first));
    let below = |n: &usize| {
        let part = |x: f64, whole: f64| if whole > 0.0 { x / whole } else { 0.0 };
        part(grids[*n].light - first.light, width) - part(height(&grids[*n]) - height(first), rise)
    };
    let lowest = front.iter().copied().max_by(|a, b| below(a).total_cmp(&below(b)))?;
    (below(&lowest) > ROUNDING).then_some(lowest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_and_its_knee() {
        let grid = |(row, (light, deviation)): (usize, (f64, f64))| Grid { row, light, deviation };
        // Three on a front with a bend at 0.8, one equal to none of them but worse, one brighter and as far off as the last.
        let points = [(0.5, 1e-3), (0.8, 2e-3), (0.95, 1e-1), (0.7, 3e-3), (0.96, 1e-1)];
        let grids: Vec<Grid> = points.into_iter().enumerate().map(grid).collect();
        let found = front(&grids);
        assert_eq!(found, [0, 1, 4]);
        assert_eq!(knee(&grids, &found), Some(1));
        // One alone, two, and three that bend the other way have none.
        let none = |points: &[(f64, f64)]| {
            let grids: Vec<Grid> = points.iter().copied().enumerate().map(grid).collect();
            assert_eq!(knee(&grids, &front(&grids)), None, "{points:?}");
        };
        none(&points[..1]);
        none(&points[..2]);
        none(&[(0.5, 1e-3), (0.6, 5e-2), (0.95, 1e-1)]);
    }
}
