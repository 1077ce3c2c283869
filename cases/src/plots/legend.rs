//! The legend: one entry per label, in rows below the panels.

use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::draw::{GROUND, INK, mark_shape, shortened, stroke, text, text_width};
use super::{Panel, Shape};

const SIZE: u32 = 15;
const ROW: f64 = 24.0;
const SAMPLE: f64 = 34.0;
const GAP: f64 = 26.0;

/// What stands before a label.
#[derive(Clone, Copy)]
enum Sample {
    Line(usize, bool),
    Mark(Shape),
    Ground,
}

/// Entries, broken into rows.
pub(super) struct Legend {
    rows: Vec<Vec<(Sample, String)>>,
}

impl Legend {
    /// The legend of `panels`, at most `width` pixels wide.
    pub fn of(panels: &[Panel], width: f64) -> Legend {
        let mut entries: Vec<(Sample, String)> = Vec::new();
        let mut enter = |sample: Sample, label: &str| {
            let label = shortened(label, SIZE, width - SAMPLE - GAP);
            if !label.is_empty() && !entries.iter().any(|(_, entered)| *entered == label) {
                entries.push((sample, label));
            }
        };
        for panel in panels {
            panel.curves.iter().for_each(|curve| enter(Sample::Line(curve.colour, curve.faint), &curve.label));
        }
        for panel in panels {
            panel.marks.iter().for_each(|mark| enter(Sample::Mark(mark.shape), &mark.label));
            panel.bands.iter().for_each(|band| enter(Sample::Ground, &band.label));
        }
        let mut rows: Vec<Vec<_>> = Vec::new();
        let mut used = f64::INFINITY;
        for entry in entries {
            let needed = entry_width(&entry.1);
            if used + needed > width {
                rows.push(Vec::new());
                used = 0.0;
            }
            used += needed;
            if let Some(row) = rows.last_mut() {
                row.push(entry);
            }
        }
        Legend { rows }
    }

    /// Height, pixels.
    pub fn height(&self) -> f64 {
        self.rows.len() as f64 * ROW
    }

    /// Draw the rows centred about `middle`, the first of them below `top`.
    pub fn draw(&self, scene: &mut Scene, middle: f64, top: f64) {
        for (i, row) in self.rows.iter().enumerate() {
            let y = top + (i as f64 + 0.5) * ROW;
            let total: f64 = row.iter().map(|(_, label)| entry_width(label)).sum::<f64>() - GAP;
            let mut x = middle - 0.5 * total;
            for (sample, label) in row {
                match sample {
                    Sample::Line(index, faint) => scene.add(Primitive::Line {
                        x1: x,
                        y1: y,
                        x2: x + SAMPLE - 8.0,
                        y2: y,
                        stroke: Color::from(stroke(*index, *faint).as_str()),
                        stroke_width: 3.0,
                        stroke_dasharray: None,
                    }),
                    Sample::Mark(shape) => mark_shape(scene, *shape, x + 0.5 * (SAMPLE - 8.0), y),
                    Sample::Ground => scene.add(Primitive::Rect {
                        x,
                        y: y - 7.0,
                        width: SAMPLE - 8.0,
                        height: 14.0,
                        fill: Color::from(GROUND),
                        stroke: None,
                        stroke_width: None,
                        opacity: None,
                    }),
                }
                text(scene, [x + SAMPLE, y + 5.0], label, SIZE, TextAnchor::Start, INK);
                x += entry_width(label);
            }
        }
    }
}

fn entry_width(label: &str) -> f64 {
    SAMPLE + text_width(label, SIZE) + GAP
}
