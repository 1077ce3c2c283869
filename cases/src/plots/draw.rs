//! From a figure to a scene of lines and text, and from there to SVG and PNG.
//!
//! Axes are laid out by kuva, panel by panel, with the margins computed here so that stacked axes line up; title and legend are
//! set around them.

use std::fmt::Write;
use std::sync::Arc;

use kuva::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::annotations::ShadedRegion;
use kuva::render::color::Color;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor, render_multiple};

use super::axis::{Axis, drawable};
use super::legend::Legend;
use super::{Figure, Panel, PlotError, Shape, thin};

/// Text and marks.
pub(super) const INK: &str = "#222222";
/// Bands.
pub(super) const GROUND: &str = "#dddddd";
const QUIET: &str = "#666666";

/// Colours told apart with any colour vision, all dark enough for a line on white: Okabe and Ito (2008) without yellow,
/// then three of Paul Tol's muted scheme (2021).
const PALETTE: [&str; 10] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#882255", "#999933", "#332288"];

const TITLE: u32 = 22;
const SUBTITLE: u32 = 15;
const LABEL: u32 = 16;
const TICK: u32 = 14;
/// White around the figure, pixels.
const BORDER: f64 = 16.0;
/// Above the axes, for the label of the vertical one, and below them, for tick labels; pixels.
const HEAD: f64 = 30.0;
const FOOT: f64 = 32.0;
/// Right of the axes, for half a tick label.
const RIGHT: f64 = 26.0;
/// The smallest axes worth looking at, pixels.
const SMALLEST: [f64; 2] = [80.0, 50.0];
/// An image of this side squared takes 256 MB to draw.
const LARGEST: f64 = 8000.0;
/// Points drawn in a figure, shared by its panels. At 12 bytes a point an SVG stays near 1.3 MB; a curve of 10⁵
/// samples over 1100 columns needs 4400.
const POINTS: usize = 110_000;

/// The colour of the palette with this number, counted round.
pub(super) fn colour(index: usize) -> &'static str {
    PALETTE[index % PALETTE.len()]
}

/// The same, half way to white: a line among many. (Opaque: transparent joints of a line would show as dots.)
fn pale(index: usize) -> String {
    let code = u32::from_str_radix(&colour(index)[1..], 16).unwrap_or(0);
    let mixed = [16, 8, 0].map(|shift| ((code >> shift & 0xff) + 0xff) / 2);
    format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
}

/// What a curve is drawn with, and its sample in the legend.
pub(super) fn stroke(index: usize, faint: bool) -> String {
    if faint { pale(index) } else { colour(index).to_owned() }
}

/// Width of a line of text, pixels: the widths of DejaVu Sans in four classes, a few per cent wide of the truth.
pub(super) fn text_width(text: &str, size: u32) -> f64 {
    let em = |c: char| match c {
        'i' | 'j' | 'l' | 'f' | 't' | 'I' | ' ' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | '(' | ')' | '[' | ']' => {
            0.4
        }
        'm' | 'w' | 'M' | 'W' | '@' | '%' | '+' | '=' | '<' | '>' | '\u{2212}' => 0.9,
        'A'..='Z' => 0.75,
        c if c > '\u{2e7f}' => 1.05,
        _ => 0.64,
    };
    f64::from(size) * text.chars().map(em).sum::<f64>()
}

/// `text` without control characters, cut to `width` pixels.
pub(super) fn shortened(text: &str, size: u32, width: f64) -> String {
    let mut text: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    // XML knows no way to write these two.
    text.retain(|c| !matches!(c, '\u{fffe}' | '\u{ffff}'));
    if text_width(&text, size) <= width {
        return text;
    }
    while !text.is_empty() && text_width(&text, size) + f64::from(size) > width {
        text.pop();
    }
    text + "…"
}

/// Dollar signs would start mathematics.
fn plain(text: &str) -> String {
    text.replace('$', "\\$")
}

pub(super) fn text(scene: &mut Scene, at: [f64; 2], content: &str, size: u32, anchor: TextAnchor, colour: &str) {
    scene.add(Primitive::Text {
        x: at[0],
        y: at[1],
        content: plain(content),
        size,
        anchor,
        rotate: None,
        bold: false,
        color: Some(Color::from(colour)),
    });
}

/// A mark, on a curve or in the legend.
pub(super) fn mark_shape(scene: &mut Scene, shape: Shape, x: f64, y: f64) {
    let path = |d: String, fill: Option<Color>| {
        Primitive::Path(Box::new(PathData {
            d,
            fill,
            stroke: Color::from(INK),
            stroke_width: 2.0,
            opacity: None,
            stroke_dasharray: None,
        }))
    };
    let r = 5.0;
    match shape {
        Shape::Circle => scene.add(Primitive::Circle {
            cx: x,
            cy: y,
            r: 4.0,
            fill: Color::from(INK),
            fill_opacity: None,
            stroke: None,
            stroke_width: None,
        }),
        Shape::Cross => {
            let (left, right, top, bottom) = (x - r, x + r, y - r, y + r);
            scene.add(path(format!("M {left:.1} {top:.1} L {right:.1} {bottom:.1}"), None));
            scene.add(path(format!("M {left:.1} {bottom:.1} L {right:.1} {top:.1}"), None));
        }
        Shape::Triangle => {
            let (left, right, top, bottom) = (x - r, x + r, y - r, y + r);
            scene.add(path(
                format!("M {x:.1} {top:.1} L {right:.1} {bottom:.1} L {left:.1} {bottom:.1} Z"),
                Some(Color::from(INK)),
            ));
        }
    }
}

/// Everything on the sheet.
pub(super) fn scene(figure: &Figure) -> Result<Scene, PlotError> {
    let (width, height) = (figure.width, figure.height);
    if !(width <= LARGEST && height <= LARGEST) {
        return Err(PlotError::TooLarge { width, height, limit: LARGEST });
    }
    let columns = figure.columns.max(1);
    let rows = figure.panels.len().div_ceil(columns).max(1);
    let middle = 0.5 * width;
    let legend = Legend::of(&figure.panels, width - 2.0 * BORDER);

    let head =
        BORDER + if figure.title.is_empty() { 0.0 } else { 30.0 } + if figure.subtitle.is_empty() { 0.0 } else { 22.0 };
    let too_small = || PlotError::TooSmall { panels: figure.panels.len(), columns, width, height };
    // Rows whose horizontal axes are labelled are that much higher, so that all axes are equally high.
    let labels: Vec<f64> =
        figure.panels.chunks(columns).map(|row| row.iter().map(x_label_height).fold(0.0, f64::max)).collect();
    let free = height - head - BORDER - legend.height() - labels.iter().sum::<f64>();
    let axes_height = free / rows as f64 - HEAD - FOOT;
    let cell_width = (width - 2.0 * BORDER) / columns as f64;
    let axes: Vec<_> = figure.panels.iter().map(|panel| y_axis(panel, axes_height)).collect();
    // Panels above each other share their left margin, so that equal times stand above each other.
    let left_of = |column: usize| {
        let chars = axes.iter().skip(column).step_by(columns).map(Axis::label_chars).max().unwrap_or(1);
        18.0 + 0.65 * f64::from(TICK) * chars as f64
    };
    let room = (0..columns.min(axes.len())).map(|column| cell_width - left_of(column) - RIGHT);
    if !(axes_height >= SMALLEST[1] && room.fold(f64::INFINITY, f64::min) >= SMALLEST[0]) {
        return Err(too_small());
    }

    let mut scene = Scene::new(width.round(), height.round());
    scene.background_color = Some("white".to_owned());
    scene.font_family = Some("DejaVu Sans, Verdana, Arial, sans-serif".to_owned());
    scene.text_color = Some(INK.to_owned());

    let mut y = BORDER;
    if !figure.title.is_empty() {
        let title = shortened(&figure.title, TITLE, width - 2.0 * BORDER);
        text(&mut scene, [middle, y + 20.0], &title, TITLE, TextAnchor::Middle, INK);
        y += 30.0;
    }
    if !figure.subtitle.is_empty() {
        let subtitle = shortened(&figure.subtitle, SUBTITLE, width - 2.0 * BORDER);
        text(&mut scene, [middle, y + 14.0], &subtitle, SUBTITLE, TextAnchor::Middle, QUIET);
    }

    let mut top = head;
    for (row, (panels, label)) in figure.panels.chunks(columns).zip(&labels).enumerate() {
        let cell = [cell_width, HEAD + axes_height + FOOT + label];
        for (column, panel) in panels.iter().enumerate() {
            let origin = [BORDER + column as f64 * cell_width, top];
            let place = Place { origin, cell, left: left_of(column), bottom: FOOT + label };
            draw_panel(&mut scene, panel, axes[row * columns + column], &place, POINTS / axes.len());
        }
        top += cell[1];
    }
    legend.draw(&mut scene, middle, height - BORDER - legend.height() + 6.0);
    Ok(scene)
}

/// Everything drawn in a panel, but bands.
fn points(panel: &Panel) -> impl Iterator<Item = &[f64; 2]> {
    let curves = panel.curves.iter().flat_map(|curve| &curve.points);
    curves.chain(panel.marks.iter().flat_map(|mark| &mark.points)).filter(|point| drawable(point))
}

/// A tick for every 24 pixels of height, at most 12: steps of 1, 2 and 5 make that about 40.
fn y_axis(panel: &Panel, height: f64) -> Axis {
    Axis::over(points(panel).map(|p| p[1]), 0.06, ((height / 24.0) as usize).min(12))
}

/// Ticks as close as their labels allow, at most 12.
fn x_axis(panel: &Panel, width: f64) -> Axis {
    let bands = panel.bands.iter().flat_map(|band| band.span).filter(|x| drawable(&[*x, 0.0]));
    let mut ticks = 12;
    let mut axis = Axis::over(points(panel).map(|p| p[0]).chain(bands), 0.02, ticks);
    let crowded = |axis: &Axis| {
        let label = 0.65 * f64::from(TICK) * axis.label_chars() as f64 + 18.0;
        label > width * axis.step / (axis.max - axis.min)
    };
    while ticks > 1 && crowded(&axis) {
        ticks -= 1;
        axis.set_ticks(ticks);
    }
    axis
}

/// Both axes with as many units to a pixel, and the same ticks: the one with room to spare shows more.
fn equal_scales(mut x: Axis, mut y: Axis, inner: [f64; 2]) -> (Axis, Axis) {
    let scale = ((x.max - x.min) / inner[0]).max((y.max - y.min) / inner[1]);
    for (axis, pixels) in [(&mut x, inner[0]), (&mut y, inner[1])] {
        let (middle, half) = (0.5 * (axis.min + axis.max), 0.5 * scale * pixels);
        (axis.min, axis.max) = (middle - half, middle + half);
    }
    // A tick for every 70 pixels keeps the labels of the horizontal axis apart.
    x.set_ticks((inner[0] / 70.0) as usize);
    y.step = x.step;
    (x, y)
}

/// Room for the label of the horizontal axis.
fn x_label_height(panel: &Panel) -> f64 {
    if panel.x_label.is_empty() { 0.0 } else { 1.5 * f64::from(LABEL) }
}

/// Where a panel stands on the sheet, and the margins of its axes there; pixels.
struct Place {
    origin: [f64; 2],
    cell: [f64; 2],
    left: f64,
    bottom: f64,
}

fn draw_panel(scene: &mut Scene, panel: &Panel, y: Axis, place: &Place, budget: usize) {
    let Place { origin, cell, left, bottom } = *place;
    let (top, right) = (HEAD, RIGHT);
    let inner = [cell[0] - left - right, cell[1] - top - bottom];
    let (x, y) = match (x_axis(panel, inner[0]), panel.equal) {
        (x, false) => (x, y),
        (x, true) => equal_scales(x, y, inner),
    };

    let labels = |axis: Axis| {
        let format = axis.format();
        TickFormat::Custom(Arc::new(move |value| format.label(value)))
    };
    let mut layout = Layout::new((x.min, x.max), (y.min, y.max))
        .with_x_axis_min(x.min)
        .with_x_axis_max(x.max)
        .with_y_axis_min(y.min)
        .with_y_axis_max(y.max)
        .with_x_tick_step(x.step)
        .with_y_tick_step(y.step)
        .with_x_tick_format(labels(x))
        .with_y_tick_format(labels(y))
        .with_width(cell[0])
        .with_height(cell[1])
        .with_force_margins(left, right)
        .with_force_margins_y(top, bottom)
        .with_box_axes()
        .with_label_size(LABEL)
        .with_tick_size(TICK);
    if !panel.x_label.is_empty() {
        layout = layout.with_x_label(plain(&shortened(&panel.x_label, LABEL, inner[0])));
    }
    for band in &panel.bands {
        let [from, to] = [band.span[0].clamp(x.min, x.max), band.span[1].clamp(x.min, x.max)];
        layout = layout.with_shaded_region(ShadedRegion::vertical(from, to).with_color(GROUND).with_opacity(1.0));
    }

    let axes_scene = render_multiple(plots(panel, x, y, inner, budget), layout);
    scene.add(Primitive::GroupStart {
        transform: Some(format!("translate({},{})", origin[0], origin[1])),
        title: None,
        extra_attrs: None,
    });
    // Everything lies within the axes. Clips would be numbered through the life of the process, and make equal figures differ.
    let clips = |element: &Primitive| matches!(element, Primitive::ClipStart { .. } | Primitive::ClipEnd);
    axes_scene.elements.into_iter().filter(|element| !clips(element)).for_each(|element| scene.add(element));
    scene.add(Primitive::GroupEnd);
    for mark in &panel.marks {
        for point in mark.points.iter().filter(|point| drawable(point)) {
            let right = (point[0] - x.min) / (x.max - x.min) * inner[0];
            let up = (point[1] - y.min) / (y.max - y.min) * inner[1];
            mark_shape(scene, mark.shape, origin[0] + left + right, origin[1] + top + inner[1] - up);
        }
    }
    // Bands cover the frame, so it is drawn once more.
    scene.add(Primitive::Rect {
        x: origin[0] + left,
        y: origin[1] + top,
        width: inner[0],
        height: inner[1],
        fill: Color::None,
        stroke: Some(Color::from(INK)),
        stroke_width: Some(1.0),
        opacity: None,
    });
    // Upright: read without tilting the head, and sharper than turned letters.
    let y_label = shortened(&panel.y_label, LABEL, inner[0]);
    text(scene, [origin[0] + left, origin[1] + top - 8.0], &y_label, LABEL, TextAnchor::Start, INK);
    if !panel.title.is_empty() {
        let title = shortened(&panel.title, LABEL, 0.5 * inner[0]);
        let at = [origin[0] + left + 0.5 * inner[0], origin[1] + top - 8.0];
        text(scene, at, &title, LABEL, TextAnchor::Middle, INK);
    }
}

/// Curves of a panel, thinned to `budget` points, gaps cut out.
fn plots(panel: &Panel, x: Axis, y: Axis, inner: [f64; 2], budget: usize) -> Vec<Plot> {
    let mut plots = Vec::new();
    for (curve, points) in panel.curves.iter().zip(thinned(panel, x, y, inner, budget)) {
        let stroke = stroke(curve.colour, curve.faint);
        let width = if curve.faint { 1.0 } else { 2.0 };
        for run in points.split(|point| !drawable(point)) {
            match run {
                [] => {}
                [alone] => {
                    let dot = ScatterPlot::new().with_data([(alone[0], alone[1])]);
                    plots.push(dot.with_color(&stroke).with_size(width).into());
                }
                _ => {
                    let line = LinePlot::new().with_data(run.iter().map(|p| (p[0], p[1])));
                    plots.push(line.with_color(&stroke).with_stroke_width(width).into());
                }
            }
        }
    }
    if plots.is_empty() {
        plots.push(LinePlot::new().into());
    }
    plots
}

/// The points of all curves, together at most about `budget`.
fn thinned(panel: &Panel, x: Axis, y: Axis, inner: [f64; 2], budget: usize) -> Vec<Vec<[f64; 2]>> {
    let curves = || panel.curves.iter().map(|curve| &curve.points[..]);
    let advancing = curves().all(|points| {
        let mut last = f64::NEG_INFINITY;
        points.iter().filter(|point| drawable(point)).all(|point| std::mem::replace(&mut last, point[0]) <= point[0])
    });
    if !advancing {
        let resolution = [0.5 * (x.max - x.min) / inner[0], 0.5 * (y.max - y.min) / inner[1]];
        let share = budget / panel.curves.len();
        return curves().map(|points| thin::by_plane(points, resolution, share)).collect();
    }
    // One column a pixel, or fewer: extremes stay in any case.
    let mut columns = inner[0] as usize;
    loop {
        let thinned: Vec<_> = curves().map(|points| thin::by_column(points, x.min, x.max, columns)).collect();
        if columns <= 8 || thinned.iter().map(Vec::len).sum::<usize>() <= budget {
            return thinned;
        }
        columns -= columns.div_ceil(4);
    }
}

pub(super) fn png(scene: &Scene) -> Result<Vec<u8>, PlotError> {
    RasterBackend::new().with_scale(1.0).render_scene(scene).map_err(PlotError::Png)
}

/// Curves become paths with a tenth of a pixel: a third of the size.
pub(super) fn svg(mut scene: Scene) -> String {
    for element in &mut scene.elements {
        if let Primitive::PolyLine { points, stroke, stroke_width, stroke_dasharray } = element {
            let mut d = String::with_capacity(12 * points.len());
            for (i, (x, y)) in points.iter().enumerate() {
                let _ = write!(d, "{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, x, y);
            }
            *element = Primitive::Path(Box::new(PathData {
                d,
                fill: None,
                stroke: stroke.clone(),
                stroke_width: *stroke_width,
                opacity: None,
                stroke_dasharray: stroke_dasharray.clone(),
            }));
        }
    }
    SvgBackend::new().with_pretty(true).render_scene(&scene)
}
