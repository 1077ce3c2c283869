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
    /// Width of a wire, or of a bar between holes, m.
    wire: f64,
}

impl Grid {
    /// Of the same wire, to rounding.
    fn same_wire(&self, other: &Self) -> bool {
        (self.wire - other.wire).abs() <= 1e-9 * self.wire
    }
}

/// Where a front bends most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Knee {
    /// At this grid, with grids of the same wire on both sides.
    At(usize),
    /// At this grid, where those of its wire end: what is beyond has not been looked at.
    End(usize),
}

/// The grids that no other surpasses in both light and field.
#[derive(Clone, Debug, PartialEq)]
pub struct Front {
    /// All that were looked at and can be made.
    grids: Vec<Grid>,
    /// Places in `grids`, from dark to bright.
    front: Vec<usize>,
    /// Where the front bends towards the better, if it does.
    knee: Option<Knee>,
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
            let wire = row.value("wire")?;
            let makeable = wire >= weighing.smallest_wire * (1.0 - 1e-9);
            let (light, deviation) = (row.value(light)?, row.value("field_deviation_max")?);
            makeable.then_some(Grid { row: n, light, deviation, wire })
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
            "knee": self.knee.and_then(|knee| if let Knee::At(grid) = knee { Some(point(grid)) } else { None }),
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
            match self.knee {
                Some(Knee::At(grid)) => format!("the knee: {}", told(grid)),
                Some(Knee::End(grid)) => format!(
                    "there is no knee: they bend most at point {}, the last of its wire that was looked at",
                    rows[self.grids[grid].row].point + 1
                ),
                None => "there is no knee between the ends of these".to_owned(),
            },
            told(self.optimum)
        )
    }

    /// Deviation over light, a curve for each wire.
    pub fn figure(&self, title: &str) -> Figure {
        let at = |n: &usize| [100.0 * self.grids[*n].light, (100.0 * self.grids[*n].deviation).log10()];
        let mut wires = self.grids.clone();
        wires.sort_by(|a, b| a.wire.total_cmp(&b.wire));
        wires.dedup_by(|a, b| b.same_wire(a));
        let mut curves = Vec::new();
        // Wires that are all different, as where holes shrink in one plate, make one curve.
        if wires.len() <= MOST_CURVES {
            for (colour, first) in wires.iter().enumerate() {
                let mut of: Vec<usize> = (0..self.grids.len()).filter(|n| first.same_wire(&self.grids[*n])).collect();
                of.sort_by(|a, b| self.grids[*a].light.total_cmp(&self.grids[*b].light));
                let points = of.iter().map(at).collect();
                curves.push(Curve { label: format!("wire {}", metres(first.wire)), points, colour, faint: false });
            }
        }
        let mark = |label: &str, of: Vec<usize>, shape: Shape| Mark {
            label: label.to_owned(),
            points: of.iter().map(at).collect(),
            shape,
        };
        let knee = self.knee.and_then(|knee| if let Knee::At(grid) = knee { Some(grid) } else { None });
        let mut marks = vec![
            mark("surpassed by none", self.front.clone(), Shape::Circle),
            mark("best by weight", vec![self.optimum], Shape::Cross),
        ];
        marks.extend(knee.map(|knee| mark("knee", vec![knee], Shape::Triangle)));
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
/// the front's extent; `None` where none is below it: an end of the front is no knee. Nor is the end of a part of it that is of one wire:
/// there the front bends because nobody has looked further.
///
/// Source: Das 1999, the normal-boundary characterisation of the knee. Checked by `the_front_and_its_knee`.
fn knee(grids: &[Grid], front: &[usize]) -> Option<Knee> {
    let (first, last) = (&grids[*front.first()?], &grids[*front.last()?]);
    let height = |grid: &Grid| grid.deviation.max(1e-15).ln();
    let (width, rise) = (last.light - first.light, height(last) - height(first));
    let below = |n: &usize| {
        let part = |x: f64, whole: f64| if whole > 0.0 { x / whole } else { 0.0 };
        part(grids[*n].light - first.light, width) - part(height(&grids[*n]) - height(first), rise)
    };
    let lowest = front.iter().copied().max_by(|a, b| below(a).total_cmp(&below(b)))?;
    let (grid, brighter) = (&grids[lowest], |other: &&Grid| other.light > grids[lowest].light);
    let mut wire = grids.iter().filter(|other| grid.same_wire(other) && other.light != grid.light);
    let alone = wire.clone().next().is_none();
    let between = wire.clone().any(|other| brighter(&other)) && wire.any(|other| !brighter(&other));
    let knee = if alone || between { Knee::At(lowest) } else { Knee::End(lowest) };
    (below(&lowest) > ROUNDING).then_some(knee)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_and_its_knee() {
        let grid = |(row, (light, deviation)): (usize, (f64, f64))| Grid { row, light, deviation, wire: 1e-4 };
        // Three on a front with a bend at 0.8, one equal to none of them but worse, one brighter and as far off as the last.
        let points = [(0.5, 1e-3), (0.8, 2e-3), (0.95, 1e-1), (0.7, 3e-3), (0.96, 1e-1)];
        let grids: Vec<Grid> = points.into_iter().enumerate().map(grid).collect();
        let found = front(&grids);
        assert_eq!(found, [0, 1, 4]);
        assert_eq!(knee(&grids, &found), Some(Knee::At(1)));
        // The same bend where grids of one wire end and those of another go on.
        let mut two = grids.clone();
        two[0].wire = 2e-4;
        two[3].wire = 2e-4;
        assert_eq!(knee(&two, &front(&two)), Some(Knee::End(1)));
        // Wires that are all different make one curve.
        let mut each = grids.clone();
        each.iter_mut().for_each(|grid| grid.wire *= 1.0 + grid.light);
        assert_eq!(knee(&each, &found), Some(Knee::At(1)));
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
