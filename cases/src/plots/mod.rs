//! The plots a run writes: plain data in, SVG text or PNG bytes out.
//!
//! * **curve**: points joined by a line; a point that is not finite is a gap;
//! * **panel**: one set of axes with its curves, marks and bands;
//! * **figure**: panels in columns, with a title and one legend below.
//!
//! SVG and PNG are drawn from the same scene, and equal figures give equal bytes. A PNG needs no font on the machine; an
//! SVG names its fonts and leaves the choice to the viewer (embedding them would cost 3 MB).
//!
//! ```
//! use cases::plots::axis_potential;
//!
//! let saddle = (-50..=50).map(|i| f64::from(i) * 1e-4).map(|z| [z, 2e5 * z * z]).collect();
//! let figure = axis_potential("Quadrupole", "z", &[("at start".to_owned(), saddle)]);
//! assert_eq!(figure.panels[0].x_label, "z (mm)");
//! assert!(figure.svg().unwrap().contains("at start"));
//! ```

mod axis;
mod axis_potential;
mod contour;
mod coordinates;
mod draw;
mod legend;
mod phase_planes;
mod potential_map;
pub(crate) mod prefix;
mod spectrum;
mod thin;
mod track;
mod tracks;

pub use axis_potential::axis_potential;
pub use contour::{Heights, joined};
pub use coordinates::coordinates;
pub use phase_planes::phase_planes;
pub use potential_map::{Map, potential_maps};
pub use spectrum::spectrum;
pub use track::{Ending, Track};
pub use tracks::{outlines, tracks};

#[cfg(test)]
mod tests;

/// Why a figure could not be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlotError {
    /// The panels do not fit on the sheet.
    #[error(
        "{panels} panels in {columns} columns on {width:.0} x {height:.0} pixels leave no room for axes; make the figure larger"
    )]
    TooSmall {
        /// Number of panels.
        panels: usize,
        /// Columns asked for.
        columns: usize,
        /// Width of the sheet, pixels.
        width: f64,
        /// Height of the sheet, pixels.
        height: f64,
    },
    /// The sheet has a side longer than the largest allowed.
    #[error("a figure of {width:.0} x {height:.0} pixels; keep both sides below {limit:.0}")]
    TooLarge {
        /// Width of the sheet, pixels.
        width: f64,
        /// Height of the sheet, pixels.
        height: f64,
        /// The longest side allowed, pixels.
        limit: f64,
    },
    /// The PNG could not be written.
    #[error("the PNG could not be encoded: {0}")]
    Png(String),
}

/// One curve: points joined in their order, in the units of the axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// What the legend says; curves with the same label share an entry, an empty label has none.
    pub label: String,
    /// Points. One that is not finite breaks the line.
    pub points: Vec<[f64; 2]>,
    /// Which colour of the palette, counted round.
    pub colour: usize,
    /// Thin and pale: one of many.
    pub faint: bool,
}

/// The shape of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A disc.
    Circle,
    /// A diagonal cross.
    Cross,
    /// A triangle pointing up.
    Triangle,
}

/// Points marked by a shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// What the legend says; marks with the same label share an entry.
    pub label: String,
    /// Points, in the units of the axes. Those that are not finite are left out.
    pub points: Vec<[f64; 2]>,
    /// The shape.
    pub shape: Shape,
}

/// A stretch of the horizontal axis on grey ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// What the legend says; bands with the same label share an entry.
    pub label: String,
    /// Both ends, in units of the horizontal axis.
    pub span: [f64; 2],
}

/// One set of axes. Ranges follow from what is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Above the axes; may be empty.
    pub title: String,
    /// Horizontal axis, with its unit: `x (mm)`.
    pub x_label: String,
    /// Vertical axis, with its unit.
    pub y_label: String,
    /// Drawn first to last.
    pub curves: Vec<Curve>,
    /// Drawn above the curves.
    pub marks: Vec<Mark>,
    /// Drawn below the curves.
    pub bands: Vec<Band>,
    /// As many units to a pixel on both axes: what is round looks round.
    pub equal: bool,
}

/// One figure: panels row by row, a title above, a legend below.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// The title.
    pub title: String,
    /// A smaller line below the title; may be empty.
    pub subtitle: String,
    /// Panels side by side; at least 1.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Width, pixels.
    pub width: f64,
    /// Height, pixels.
    pub height: f64,
}

impl Default for Figure {
    /// One column on 1200 x 900 pixels: fills a slide, and is still read at half its size.
    fn default() -> Self {
        Figure {
            title: String::new(),
            subtitle: String::new(),
            columns: 1,
            panels: Vec::new(),
            width: 1200.0,
            height: 900.0,
        }
    }
}

impl Figure {
    /// The figure as an SVG document, below 2 MB however long its curves are.
    ///
    /// # Errors
    ///
    /// [`PlotError`] when the panels do not fit, or the sheet is too large.
    pub fn svg(&self) -> Result<String, PlotError> {
        Ok(draw::svg(draw::scene(self)?))
    }

    /// The figure as a PNG image of `width x height` pixels.
    ///
    /// # Errors
    ///
    /// [`PlotError`] when the panels do not fit, the sheet is too large, or encoding fails.
    pub fn png(&self) -> Result<Vec<u8>, PlotError> {
        draw::png(&draw::scene(self)?)
    }
}
