//! Many polylines, of any length, in two forms: whole polylines, and lines of two points each.

use std::io::Write;
use std::ops::Range;

use super::appended::{Document, Sink};
use super::array::{PolylineArray, check_all, check_name, check_unique};
use super::{DataArray, VtkError};
use crate::Vec3;

/// Polylines whose points are asked for while they are written.
///
/// Only the number of points of each must be in memory. A polyline of one point is a dot; one without is an error.
///
/// ```
/// use meshes::Vec3;
/// use meshes::vtk::{DataArray, PolylineArray, Polylines, write_polylines};
///
/// let tracks = [vec![Vec3::zeros(), Vec3::x()], vec![Vec3::y()]];
/// let lengths: Vec<usize> = tracks.iter().map(Vec::len).collect();
/// let lines = Polylines::new(&lengths, |line, point| tracks[line][point]);
/// let time = PolylineArray::scalars("time", |_line, point| point as f64 * 1e-3);
/// let charge = DataArray::scalars("charge", vec![1e-13, 2e-13]);
/// let mut file = Vec::new();
/// write_polylines(&mut file, &lines, &[time], &[charge])?;
/// # Ok::<(), meshes::vtk::VtkError>(())
/// ```
pub struct Polylines<'a> {
    lengths: &'a [usize],
    positions: PolylineArray<'a>,
}

impl<'a> Polylines<'a> {
    /// Polylines with `lengths[line]` points each; the place of a point is `position(line, point)`, m.
    pub fn new(lengths: &'a [usize], position: impl Fn(usize, usize) -> Vec3 + 'a) -> Self {
        Self { lengths, positions: PolylineArray::vectors("Points", position) }
    }

    /// The same, with the points of one polyline set a range at a time: `fill(line, points, out)`, three values each.
    pub fn with_fill(lengths: &'a [usize], fill: impl Fn(usize, Range<usize>, &mut [f64]) + 'a) -> Self {
        Self { lengths, positions: PolylineArray::new("Points", 3, fill) }
    }

    fn checked(&self, point_arrays: &[PolylineArray], line_arrays: &[DataArray]) -> Result<Counts, VtkError> {
        point_arrays.iter().try_for_each(|array| check_name(&array.name, array.components))?;
        check_unique(point_arrays.iter().map(|array| array.name.as_str()))?;
        check_all(line_arrays, self.lengths.len(), "polylines")?;
        if let Some(line) = self.lengths.iter().position(|&length| length == 0) {
            return Err(VtkError::EmptyLine { line });
        }
        // VTK numbers points with signed 64-bit integers.
        let points = (self.lengths.iter())
            .try_fold(0i64, |sum, &length| sum.checked_add(i64::try_from(length).ok()?))
            .ok_or_else(|| VtkError::TooLarge { what: "the points of all polylines".into() })?;
        let dots = self.lengths.iter().filter(|&&length| length == 1).count() as u64;
        Ok(Counts { points: points as u64, dots, lines: self.lengths.len() as u64 - dots })
    }

    /// The number of the first point of each polyline, and how many points it has.
    fn spans(&self) -> impl Iterator<Item = (i64, i64)> + use<'a> {
        self.lengths.iter().scan(0, |next, &length| {
            let first = *next;
            *next += length as i64;
            Some((first, length as i64))
        })
    }

    /// Adds the points and their arrays to a file.
    fn points<'d>(
        &'d self,
        document: &mut Document<'d>,
        points: u64,
        arrays: &'d [PolylineArray<'d>],
    ) -> Result<(), VtkError> {
        document.element("PointData", |document| {
            arrays.iter().try_for_each(|array| {
                let body = |sink: &mut Sink| array.put_all(sink, self.lengths);
                document.array::<f64>(&array.name, points, array.components, body)
            })
        })?;
        document.element("Points", |document| {
            document.array::<f64>("Points", points, 3, |sink| self.positions.put_all(sink, self.lengths))
        })
    }

    /// Adds the arrays of the polylines: first the tuples of dots, then each other tuple as often as `repeats` says
    /// for a polyline of that many points.
    fn cells<'d>(
        &'d self,
        document: &mut Document<'d>,
        cells: u64,
        arrays: &'d [DataArray<'d>],
        repeats: fn(usize) -> usize,
    ) -> Result<(), VtkError> {
        document.element("CellData", |document| {
            arrays.iter().try_for_each(|array| {
                let body = move |sink: &mut Sink| {
                    array.put(sink, |line| usize::from(self.lengths[line] == 1))?;
                    array.put(sink, |line| if self.lengths[line] == 1 { 0 } else { repeats(self.lengths[line]) })
                };
                document.untyped_array(&array.name, array.values.scalar(), cells, array.components, Box::new(body))
            })
        })
    }
}

struct Counts {
    points: u64,
    /// Polylines of one point.
    dots: u64,
    /// Polylines of two points and more.
    lines: u64,
}

/// Writes polylines as PolyData (`.vtp`): one line cell each, or a vertex cell where there is only one point.
///
/// Point arrays follow the points, polyline after polyline. VTK wants vertices before lines: in the file, and so in the
/// line arrays as a viewer numbers them, the polylines of one point come first.
///
/// # Errors
/// A bad name, a length that does not match, a polyline without points or a value in memory that is not finite, before
/// anything is written; a computed value that is not finite, or an output that fails, in the middle of it.
pub fn write_polylines(
    out: &mut dyn Write,
    polylines: &Polylines,
    point_arrays: &[PolylineArray],
    line_arrays: &[DataArray],
) -> Result<(), VtkError> {
    let Counts { points, dots, lines } = polylines.checked(point_arrays, line_arrays)?;
    let mut document = Document::new(
        "PolyData",
        "",
        &format!(
            " NumberOfPoints=\"{points}\" NumberOfVerts=\"{dots}\" NumberOfLines=\"{lines}\" NumberOfStrips=\"0\" \
             NumberOfPolys=\"0\""
        ),
    );
    polylines.points(&mut document, points, point_arrays)?;
    polylines.cells(&mut document, dots + lines, line_arrays, |_length| 1)?;
    document.element("Verts", |document| {
        document.array::<i64>("connectivity", dots, 1, |sink| {
            sink.put_each(polylines.spans().filter(|&(_, length)| length == 1).map(|(first, _)| first))
        })?;
        document.array::<i64>("offsets", dots, 1, move |sink| sink.put_each(1..=dots as i64))
    })?;
    let spans = || polylines.spans().filter(|&(_, length)| length > 1);
    document.element("Lines", |document| {
        document.array::<i64>("connectivity", points - dots, 1, move |sink| {
            spans().try_for_each(|(first, length)| sink.put_each(first..first + length))
        })?;
        document.array::<i64>("offsets", lines, 1, move |sink| {
            sink.put_each(spans().scan(0, |end, (_, length)| {
                *end += length;
                Some(*end)
            }))
        })
    })?;
    document.write(out)
}

/// Writes polylines as an UnstructuredGrid (`.vtu`) of lines of two points each, for readers that know no polylines.
///
/// Points and point arrays are those of [`write_polylines`], bit for bit. A polyline of n points becomes n - 1 cells,
/// which all carry its line arrays; those of one point become vertex cells and come first.
///
/// meshio fails on a file without any cell, that is without any polyline.
///
/// # Errors
/// As [`write_polylines`].
pub fn write_line_cells(
    out: &mut dyn Write,
    polylines: &Polylines,
    point_arrays: &[PolylineArray],
    line_arrays: &[DataArray],
) -> Result<(), VtkError> {
    let Counts { points, dots, lines } = polylines.checked(point_arrays, line_arrays)?;
    let segments = points - dots - lines;
    let cells = dots + segments;
    let mut document =
        Document::new("UnstructuredGrid", "", &format!(" NumberOfPoints=\"{points}\" NumberOfCells=\"{cells}\""));
    polylines.points(&mut document, points, point_arrays)?;
    polylines.cells(&mut document, cells, line_arrays, |length| length - 1)?;
    document.element("Cells", |document| {
        document.array::<i64>("connectivity", dots + 2 * segments, 1, |sink| {
            sink.put_each(polylines.spans().filter(|&(_, length)| length == 1).map(|(first, _)| first))?;
            polylines.spans().try_for_each(|(first, length)| {
                sink.put_each((first..first + length - 1).flat_map(|point| [point, point + 1]))
            })
        })?;
        document.array::<i64>("offsets", cells, 1, move |sink| {
            let (dots, segments) = (dots as i64, segments as i64);
            sink.put_each(1..=dots)?;
            sink.put_each((1..=segments).map(|segment| dots + 2 * segment))
        })?;
        document.array::<u8>("types", cells, 1, move |sink| {
            sink.put_each((0..dots).map(|_| VERTEX))?;
            sink.put_each((0..segments).map(|_| LINE))
        })
    })?;
    document.write(out)
}

/// VTK's numbers for the kinds of cells.
const VERTEX: u8 = 1;
const LINE: u8 = 3;
