//! The path of one grain, and which of many are drawn.

use super::{Mark, Shape};

/// How the path of a grain ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It flew until the time was up.
    TimeUp,
    /// It struck a surface.
    Struck,
    /// It left the region.
    Left,
}

/// The path of one grain. Samples beyond the shortest of the three lists are not drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Its number, for the legend.
    pub grain: usize,
    /// Times of the samples, increasing, s.
    pub times: Vec<f64>,
    /// Positions, m.
    pub positions: Vec<[f64; 3]>,
    /// Velocities, m/s.
    pub velocities: Vec<[f64; 3]>,
    /// How it ended, marked at the last sample.
    pub ended: Ending,
}

/// Above this many grains, lines are thin and the legend names none: the palette has no more colours.
pub(super) const NAMED: usize = 10;

/// Above this many grains, only this many are drawn: more cover each other.
pub(super) const DRAWN: usize = 100;

/// The tracks to draw, spread evenly through the list, first and last among them.
pub(super) fn drawn(tracks: &[Track]) -> Vec<&Track> {
    if tracks.len() <= DRAWN {
        return tracks.iter().collect();
    }
    (0..DRAWN).map(|i| &tracks[i * (tracks.len() - 1) / (DRAWN - 1)]).collect()
}

/// The line below the title: how many grains of how many.
pub(super) fn subtitle(tracks: &[Track]) -> String {
    match tracks.len() {
        0 => "no grains".to_owned(),
        1 => "1 grain".to_owned(),
        n if n <= DRAWN => format!("{n} grains"),
        n => format!("{DRAWN} of {n} grains"),
    }
}

/// The label in the legend of a track among `count`.
pub(super) fn label(track: &Track, count: usize) -> String {
    if count > NAMED { String::new() } else { format!("grain {}", track.grain) }
}

/// The ends of curves as marks, one per kind of ending.
pub(super) fn endings(ends: &[(Ending, Option<[f64; 2]>)]) -> Vec<Mark> {
    [
        (Ending::TimeUp, Shape::Circle, "time up"),
        (Ending::Struck, Shape::Cross, "struck"),
        (Ending::Left, Shape::Triangle, "left the region"),
    ]
    .into_iter()
    .filter_map(|(ending, shape, label)| {
        let points: Vec<_> = ends.iter().filter(|end| end.0 == ending).filter_map(|end| end.1).collect();
        (!points.is_empty()).then(|| Mark { label: label.to_owned(), points, shape })
    })
    .collect()
}
