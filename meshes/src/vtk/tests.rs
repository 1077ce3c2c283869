//! What is in the files, read back by vtkio where it can and by a reader of a few lines where it cannot.
//!
//! Whether ParaView, VTK and meshio agree is the business of `examples/vtk_samples.rs`.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::{self, Write};

use proptest::prelude::*;
use vtkio::model::{Attribute, CellType, DataSet, IOBuffer, Piece, VertexNumbers, Vtk};

use super::array::BLOCK;
use super::*;
use crate::{SurfaceMesh, Vec3};

/// Bytes of an array, with what the header says about it.
#[derive(Debug, PartialEq)]
struct Found {
    scalar: String,
    components: usize,
    bytes: Vec<u8>,
}

impl Found {
    fn f64s(&self) -> Vec<f64> {
        assert_eq!(self.scalar, "Float64");
        self.bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn i64s(&self) -> Vec<i64> {
        assert_eq!(self.scalar, "Int64");
        self.bytes.chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().unwrap())).collect()
    }
}

/// Attributes of the first element with this start, such as `<Piece `.
fn attributes<'x>(xml: &'x str, start: &str) -> BTreeMap<&'x str, &'x str> {
    let at = xml.find(start).unwrap() + start.len();
    let end = at + xml[at..].find('>').unwrap();
    let mut rest = xml[at..end].trim_end_matches('/');
    let mut found = BTreeMap::new();
    while let Some((key, after)) = rest.split_once("=\"") {
        let (value, later) = after.split_once('"').unwrap();
        found.insert(key.trim(), value);
        rest = later;
    }
    found
}

/// Header and arrays of a file with appended data, by `Element/Name`.
///
/// Asserts that the arrays fill the data from end to end, without gap or overlap.
fn read_appended(file: &[u8]) -> (String, BTreeMap<String, Found>) {
    let opening = b"<AppendedData encoding=\"raw\">\n_";
    let start = file.windows(opening.len()).position(|w| w == opening).unwrap() + opening.len();
    let data = file[start..].strip_suffix(b"\n</AppendedData>\n</VTKFile>\n").unwrap();
    let header = String::from_utf8(file[..start].to_vec()).unwrap();
    let (mut arrays, mut places, mut element) = (BTreeMap::new(), Vec::new(), "");
    for line in header.lines() {
        if let Some(tag) = line.strip_prefix("<DataArray ") {
            let array = attributes(tag, "");
            assert_eq!(array["format"], "appended");
            let offset: usize = array["offset"].parse().unwrap();
            let length = u64::from_le_bytes(data[offset..offset + 8].try_into().unwrap()) as usize;
            places.push((offset, offset + 8 + length));
            let found = Found {
                scalar: array["type"].into(),
                components: array.get("NumberOfComponents").map_or(1, |n| n.parse().unwrap()),
                bytes: data[offset + 8..offset + 8 + length].to_vec(),
            };
            assert!(arrays.insert(format!("{element}/{}", array["Name"]), found).is_none());
        } else if !line.starts_with("</") {
            element = line.trim_matches(['<', '>']);
        }
    }
    places.sort();
    let end = places.iter().fold(0, |end, &(from, to)| {
        assert_eq!(from, end);
        to
    });
    assert_eq!(end, data.len());
    (header, arrays)
}

/// The only piece of a file that vtkio reads.
fn read_inline(file: &[u8]) -> (Vec<f64>, VertexNumbers, Vec<CellType>, Vec<Attribute>, Vec<Attribute>) {
    match Vtk::parse_xml(file).unwrap().data {
        DataSet::UnstructuredGrid { pieces, .. } => match pieces.into_iter().next().unwrap() {
            Piece::Inline(piece) => (
                piece.points.into_vec().unwrap(),
                piece.cells.cell_verts,
                piece.cells.types,
                piece.data.point,
                piece.data.cell,
            ),
            _ => panic!("no inline piece"),
        },
        DataSet::PolyData { pieces, .. } => match pieces.into_iter().next().unwrap() {
            Piece::Inline(piece) => {
                let verts = piece.verts.unwrap();
                let types = vec![CellType::Vertex; verts.num_cells()];
                (piece.points.into_vec().unwrap(), verts, types, piece.data.point, piece.data.cell)
            }
            _ => panic!("no inline piece"),
        },
        _ => panic!("another kind of data set"),
    }
}

fn buffer<'a>(attributes: &'a [Attribute], wanted: &str) -> &'a IOBuffer {
    let named = |attribute: &'a Attribute| match attribute {
        Attribute::DataArray(array) if array.name == wanted => Some(&array.data),
        _ => None,
    };
    attributes.iter().find_map(named).unwrap()
}

/// Distinct values with all digits in use.
fn ramp(n: usize, phase: f64) -> Vec<f64> {
    (0..n).map(|i| (i as f64 + phase).sin() / 3.0).collect()
}

fn places(n: usize) -> Vec<Vec3> {
    ramp(3 * n, 0.5).chunks_exact(3).map(Vec3::from_column_slice).collect()
}

fn strip(panels: usize) -> SurfaceMesh {
    let vertices = if panels == 0 { 0 } else { panels + 2 };
    SurfaceMesh {
        vertices: places(vertices),
        triangles: (0..panels as u32).map(|i| [i, i + 1, i + 2]).collect(),
        electrode: vec![0; panels],
        electrodes: vec![],
    }
}

fn file(write: impl FnOnce(&mut dyn Write) -> Result<(), VtkError>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes).unwrap();
    bytes
}

/// The error, which must come before the first byte.
fn refusal(write: impl FnOnce(&mut dyn Write) -> Result<(), VtkError>) -> String {
    let mut bytes = Vec::new();
    let message = write(&mut bytes).unwrap_err().to_string();
    assert!(bytes.is_empty(), "{} bytes came before: {message}", bytes.len());
    message
}

#[test]
fn surface_comes_back_through_vtkio() {
    // 4096 panels: arrays that are a whole number of vtkio's compressed blocks.
    for panels in [1, 2, 1000, 4096] {
        let mesh = strip(panels);
        let point = ramp(2 * mesh.vertices.len(), 0.1);
        let pair = DataArray { name: "a<b> & \"c\" 'd' µ".into(), components: 2, values: point.as_slice().into() };
        let cell = [
            DataArray::scalars("f64", ramp(panels, 0.2)),
            DataArray::scalars("f32", vec![0.1f32; panels]),
            DataArray::scalars("i32", vec![-7i32; panels]),
            DataArray::scalars("u32", mesh.electrode.as_slice()),
            DataArray::scalars("u8", vec![255u8; panels]),
            DataArray::computed("computed", 1, panels, |range, out| out.copy_from_slice(&ramp(panels, 0.3)[range])),
        ];
        let bytes = file(|out| write_surface(out, &mesh, &[pair], &cell));
        let (points, cells, types, point_data, cell_data) = read_inline(&bytes);
        assert_eq!(points, super::array::flat(&mesh.vertices));
        let (connectivity, offsets) = cells.into_xml();
        assert_eq!(connectivity, mesh.triangles.iter().flatten().map(|&v| v as u64).collect::<Vec<_>>());
        assert_eq!(offsets, (1..=panels as u64).map(|i| 3 * i).collect::<Vec<_>>());
        assert!(types.iter().all(|&kind| kind == CellType::Triangle));
        assert_eq!(*buffer(&point_data, "a<b> & \"c\" 'd' µ"), IOBuffer::F64(point));
        assert_eq!(*buffer(&cell_data, "f64"), IOBuffer::F64(ramp(panels, 0.2)));
        assert_eq!(*buffer(&cell_data, "f32"), IOBuffer::F32(vec![0.1; panels]));
        assert_eq!(*buffer(&cell_data, "i32"), IOBuffer::I32(vec![-7; panels]));
        assert_eq!(*buffer(&cell_data, "u32"), IOBuffer::U32(vec![0; panels]));
        assert_eq!(*buffer(&cell_data, "u8"), IOBuffer::U8(vec![255; panels]));
        assert_eq!(*buffer(&cell_data, "computed"), IOBuffer::F64(ramp(panels, 0.3)));
    }
}

#[test]
fn points_come_back_through_vtkio() {
    for count in [1, 2, 777] {
        let points = places(count);
        let arrays = [DataArray::vectors("velocity", &points), DataArray::scalars("id", vec![3u32; count])];
        let bytes = file(|out| write_points(out, &points, &arrays));
        let (found, verts, _, point_data, _) = read_inline(&bytes);
        assert_eq!(found, super::array::flat(&points));
        assert_eq!(verts.into_xml(), ((0..count as u64).collect(), (1..=count as u64).collect()));
        assert_eq!(*buffer(&point_data, "velocity"), IOBuffer::F64(found));
        assert_eq!(*buffer(&point_data, "id"), IOBuffer::U32(vec![3; count]));
    }
}

/// vtkio would leave the counts out, and VTK refuse the file.
#[test]
fn empty_data_sets_say_how_empty_they_are() {
    let none = || [DataArray::scalars("speed", Vec::<f64>::new())];
    let (header, arrays) = read_appended(&file(|out| write_points(out, &[], &none())));
    assert_eq!(attributes(&header, "<Piece ")["NumberOfPoints"], "0");
    assert!(arrays["PointData/speed"].bytes.is_empty());

    let (header, arrays) = read_appended(&file(|out| write_surface(out, &strip(0), &none(), &none())));
    assert_eq!(attributes(&header, "<Piece ")["NumberOfCells"], "0");
    assert!(arrays["CellData/speed"].bytes.is_empty());

    // Vertices without panels are kept.
    let mesh = SurfaceMesh { vertices: places(2), ..Default::default() };
    let (_, arrays) = read_appended(&file(|out| write_surface(out, &mesh, &[], &[])));
    assert_eq!(arrays["Points/Points"].f64s(), super::array::flat(&mesh.vertices));
}

/// Writes polylines both ways and compares every array with what it should be.
fn check_polylines(lengths: &[usize]) {
    let starts: Vec<usize> = lengths.iter().scan(0, |next, n| Some(std::mem::replace(next, *next + n))).collect();
    let count = lengths.iter().sum();
    let (points, time) = (places(count), ramp(count, 0.9));
    let lines = Polylines::new(lengths, |line, point| points[starts[line] + point]);
    let point_arrays = [
        PolylineArray::scalars("time", |line, point| time[starts[line] + point]),
        PolylineArray::new("position again", 3, |line, range, out| {
            let first = starts[line] + range.start;
            out.copy_from_slice(&super::array::flat(&points[first..first + range.len()]));
        }),
    ];
    let id: Vec<u32> = (0..lengths.len() as u32).collect();
    let line_arrays = [
        DataArray::scalars("id", id.as_slice()),
        DataArray::computed("pair", 2, lengths.len(), |range, out| {
            for (i, value) in (2 * range.start..).zip(out) {
                *value = i as f64;
            }
        }),
    ];
    let polydata = file(|out| write_polylines(out, &lines, &point_arrays, &line_arrays));
    let grid = file(|out| write_line_cells(out, &lines, &point_arrays, &line_arrays));
    let (polydata_header, polydata) = read_appended(&polydata);
    let (grid_header, grid) = read_appended(&grid);

    for file in [&polydata, &grid] {
        assert_eq!(file["Points/Points"].f64s(), super::array::flat(&points));
        assert_eq!(file["PointData/position again"].f64s(), super::array::flat(&points));
        assert_eq!(file["PointData/position again"].components, 3);
        assert_eq!(file["PointData/time"].f64s(), time);
    }

    let (dots, long): (Vec<usize>, Vec<usize>) = (0..lengths.len()).partition(|&line| lengths[line] == 1);
    let ids = |lines: &[usize]| lines.iter().flat_map(|&line| (line as u32).to_le_bytes()).collect::<Vec<u8>>();
    let pairs =
        |lines: &[usize]| lines.iter().flat_map(|&i| [2.0 * i as f64, 2.0 * i as f64 + 1.0]).collect::<Vec<_>>();

    // Polylines: dots, then the others.
    let piece = attributes(&polydata_header, "<Piece ");
    assert_eq!(piece["NumberOfPoints"], count.to_string());
    assert_eq!(piece["NumberOfVerts"], dots.len().to_string());
    assert_eq!(piece["NumberOfLines"], long.len().to_string());
    let order: Vec<usize> = dots.iter().chain(&long).copied().collect();
    assert_eq!(polydata["CellData/id"].bytes, ids(&order));
    assert_eq!(polydata["CellData/pair"].f64s(), pairs(&order));
    let dot_points: Vec<i64> = dots.iter().map(|&line| starts[line] as i64).collect();
    assert_eq!(polydata["Verts/connectivity"].i64s(), dot_points);
    assert_eq!(polydata["Verts/offsets"].i64s(), (1..=dots.len() as i64).collect::<Vec<_>>());
    let line_points: Vec<i64> =
        long.iter().flat_map(|&line| (starts[line]..starts[line] + lengths[line]).map(|i| i as i64)).collect();
    assert_eq!(polydata["Lines/connectivity"].i64s(), line_points);
    let ends: Vec<i64> = (1..=long.len()).map(|n| long[..n].iter().map(|&line| lengths[line] as i64).sum()).collect();
    assert_eq!(polydata["Lines/offsets"].i64s(), ends);

    // Line cells: dots, then every segment with the arrays of its polyline.
    let owners: Vec<usize> = long.iter().flat_map(|&line| vec![line; lengths[line] - 1]).collect();
    let order: Vec<usize> = dots.iter().chain(&owners).copied().collect();
    assert_eq!(attributes(&grid_header, "<Piece ")["NumberOfCells"], order.len().to_string());
    assert_eq!(grid["CellData/id"].bytes, ids(&order));
    assert_eq!(grid["CellData/pair"].f64s(), pairs(&order));
    let segments = long
        .iter()
        .flat_map(|&line| (starts[line]..starts[line] + lengths[line] - 1).flat_map(|i| [i as i64, i as i64 + 1]));
    assert_eq!(grid["Cells/connectivity"].i64s(), dot_points.iter().copied().chain(segments).collect::<Vec<_>>());
    let ends = (0..order.len() as i64).map(|i| i + 1 + (i + 1 - dots.len() as i64).max(0));
    assert_eq!(grid["Cells/offsets"].i64s(), ends.collect::<Vec<_>>());
    let types = order.iter().map(|&line| if lengths[line] == 1 { 1u8 } else { 3 });
    assert_eq!(grid["Cells/types"].bytes, types.collect::<Vec<_>>());
}

fn check_image(points: [usize; 3], origin: Vec3, spacing: Vec3) {
    let grid = ImageGrid { points, origin, spacing };
    let (n_points, n_cells) = grid.counts().unwrap();
    assert_eq!(n_points, points.iter().product::<usize>());
    let potential = ramp(n_points, 0.4);
    let mask: Vec<u8> = (0..n_cells).map(|i| (i % 251) as u8).collect();
    let point_arrays = [
        DataArray::scalars("potential", potential.as_slice()),
        DataArray::computed("twice", 2, n_points, |range, out| {
            for (pair, &value) in out.chunks_exact_mut(2).zip(&potential[range]) {
                pair.copy_from_slice(&[value, 2.0 * value]);
            }
        }),
    ];
    let bytes = file(|out| write_image(out, &grid, &point_arrays, &[DataArray::scalars("mask", mask.as_slice())]));
    let (header, arrays) = read_appended(&bytes);
    assert_eq!(arrays["PointData/potential"].f64s(), potential);
    let twice: Vec<f64> = potential.iter().flat_map(|&value| [value, 2.0 * value]).collect();
    assert_eq!(arrays["PointData/twice"].f64s(), twice);
    assert_eq!(arrays["CellData/mask"].bytes, mask);
    let image = attributes(&header, "<ImageData ");
    let triple = |text: &str| Vec3::from_iterator(text.split(' ').map(|word| word.parse().unwrap()));
    assert_eq!(triple(image["Origin"]), origin);
    assert_eq!(triple(image["Spacing"]), spacing);
    let [nx, ny, nz] = points.map(|n| n - 1);
    assert_eq!(image["WholeExtent"], format!("0 {nx} 0 {ny} 0 {nz}"));
    assert_eq!(attributes(&header, "<Piece ")["Extent"], image["WholeExtent"]);
}

proptest! {
    // Failures print their seed and inputs; the cases themselves are the same in every run.
    #![proptest_config(ProptestConfig {
        cases: 64,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(1),
        ..ProptestConfig::default()
    })]

    #[test]
    fn own_reader_finds_every_array(lengths in prop::collection::vec(1usize..9, 0..20)) {
        check_polylines(&lengths);
    }

    #[test]
    fn lattices_of_every_size(
        points in prop::array::uniform3(1usize..6),
        origin in prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL),
        spacing in prop::array::uniform3(prop::num::f64::POSITIVE | prop::num::f64::SUBNORMAL),
    ) {
        let spacing = spacing.map(|s| if s.is_normal() { s.abs() } else { 5e-324 });
        check_image(points, origin.into(), spacing.into());
    }
}

#[test]
fn polylines_longer_than_a_block() {
    check_polylines(&[BLOCK + 1]);
    check_polylines(&[1, BLOCK / 3, 2 * BLOCK, 1, 2]);
}

#[test]
fn more_polylines_than_a_block() {
    let lengths: Vec<usize> = (0..BLOCK + 3).map(|line| 1 + line % 3).collect();
    check_polylines(&lengths);
}

#[test]
fn lattices_larger_than_a_block() {
    check_image([BLOCK + 1, 2, 1], Vec3::new(-0.1, 0.2, 1e-9), Vec3::new(0.1, 1.0 / 3.0, 1e-300));
}

#[test]
fn collection_names_files_and_times() {
    let frames = [(-1.0, "a.vtp"), (0.1 + 0.2, "frames/b & <c>.vtp"), (1e-7 + 1.0, "d.vtp")];
    let text = String::from_utf8(file(|out| write_collection(out, &frames))).unwrap();
    assert!(text.contains("<DataSet timestep=\"-1.0\" part=\"0\" file=\"a.vtp\"/>"));
    assert!(text.contains("timestep=\"0.30000000000000004\" part=\"0\" file=\"frames/b &amp; &lt;c&gt;.vtp\""));

    for frames in [[(0.0, "a"), (0.0, "b")], [(1.0, "a"), (0.5, "b")], [(0.0, "a"), (f64::NAN, "b")]] {
        assert!(refusal(|out| write_collection(out, &frames)).starts_with("frame 1 is at time"));
    }
    for name in ["", "/a.vtp", "../a.vtp", "a\n.vtp"] {
        assert!(refusal(|out| write_collection(out, &[(0.0, name)])).starts_with("frame 0 names the file"));
    }
}

#[test]
fn bad_arrays_are_refused_before_anything_is_written() {
    let points = places(4);
    let with = |arrays: &[DataArray]| refusal(|out| write_points(out, &points, arrays));
    assert_eq!(
        with(&[DataArray { name: "speed".into(), components: 3, values: vec![0.0; 4].into() }]),
        "array `speed` has 4 values, but 4 points of 3 components need 12"
    );
    assert_eq!(
        with(&[DataArray {
            name: "v".into(),
            components: 2,
            values: vec![0.0, 0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0].into()
        }]),
        "array `v` is NaN at index 2, component 1; only finite values are written"
    );
    // Computed arrays too, where vtkio needs them whole anyway.
    assert_eq!(
        with(&[DataArray::computed("c", 1, 4, |range, out| out[..range.len() - 1].fill(0.0))]),
        "array `c` is NaN at index 3, component 0; only finite values are written"
    );
    assert_eq!(
        with(&[DataArray { name: "n".into(), components: 0, values: vec![0.0; 0].into() }]),
        "array `n` has 0 components; it needs between 1 and 65536"
    );
    assert_eq!(with(&[DataArray::scalars("", vec![0.0; 4])]), "an array cannot be named \"\": the name is empty");
    assert!(with(&[DataArray::scalars("a\tb", vec![0.0; 4])]).ends_with("the name has control characters"));
    let twice = || DataArray::scalars("twice", vec![0u8; 4]);
    assert!(with(&[twice(), twice()]).ends_with("the name is taken by another array"));
    let mut places = points.clone();
    places[1].y = f64::INFINITY;
    assert_eq!(
        refusal(|out| write_points(out, &places, &[])),
        "array `Points` is inf at index 1, component 1; only finite values are written"
    );
}

#[test]
fn bad_surfaces_lines_and_lattices_are_refused() {
    let mut mesh = strip(3);
    mesh.triangles[1][2] = 5;
    assert_eq!(
        refusal(|out| write_surface(out, &mesh, &[], &[])),
        "panel 1 has vertex 5, but the surface has only 5 vertices"
    );

    let lines = Polylines::new(&[3, 0, 2], |_, _| Vec3::zeros());
    assert!(refusal(|out| write_polylines(out, &lines, &[], &[])).starts_with("polyline 1 has no points"));
    let lines = Polylines::new(&[usize::MAX, 2], |_, _| Vec3::zeros());
    assert!(refusal(|out| write_line_cells(out, &lines, &[], &[])).starts_with("the points of all polylines"));
    let lines = Polylines::new(&[usize::MAX / 2], |_, _| Vec3::zeros());
    assert!(refusal(|out| write_line_cells(out, &lines, &[], &[])).starts_with("array `Points`"));

    let image =
        |points, origin, spacing| refusal(|out| write_image(out, &ImageGrid { points, origin, spacing }, &[], &[]));
    let one = Vec3::new(1.0, 1.0, 1.0);
    assert!(image([2, 0, 2], one, one).starts_with("the lattice's number of points is 0 along y"));
    assert!(image([2, 2, 2], one * f64::NAN, one).starts_with("the lattice's origin is NaN along x"));
    assert!(image([2, 2, 2], one, -one).starts_with("the lattice's spacing is -1 along x"));
    assert!(image([1 << 30, 1 << 30, 1 << 30], one, one).contains("more than the file format can count"));
}

/// The one kind of error that may leave part of a file behind.
#[test]
fn computed_values_are_checked_as_they_pass() {
    let lines = Polylines::new(&[2, 3], |_, _| Vec3::zeros());
    let bad = PolylineArray::scalars("speed", |line, point| if (line, point) == (1, 2) { f64::NAN } else { 0.0 });
    let error = write_polylines(&mut Vec::new(), &lines, &[bad], &[]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "array `speed` is NaN on polyline 1 at its point 2, component 0; only finite values are written"
    );
    let grid = ImageGrid { points: [BLOCK + 9, 1, 1], origin: Vec3::zeros(), spacing: Vec3::new(1.0, 1.0, 1.0) };
    let bad = DataArray::computed("field", 1, BLOCK + 9, |range, out| {
        for (i, value) in range.zip(out) {
            *value = if i == BLOCK + 5 { f64::INFINITY } else { 0.0 };
        }
    });
    let error = write_image(&mut Vec::new(), &grid, &[bad], &[]).unwrap_err();
    assert!(matches!(error, VtkError::NonFinite { index, .. } if index == BLOCK + 5));
}

/// An output that takes a few bytes at a time and is full after a while.
struct Narrow<'a> {
    taken: Vec<u8>,
    room: usize,
    flushed: &'a Cell<bool>,
}

impl Write for Narrow<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = bytes.len().min(7).min(self.room - self.taken.len());
        self.taken.extend_from_slice(&bytes[..n]);
        if n == 0 && !bytes.is_empty() { Err(io::ErrorKind::StorageFull.into()) } else { Ok(n) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.flushed.set(true);
        Ok(())
    }
}

#[test]
fn narrow_and_full_outputs() {
    let points = places(40);
    let mesh = strip(30);
    let lines = Polylines::new(&[10, 1, 29], |_, point| points[point]);
    let grid = ImageGrid { points: [4, 5, 2], origin: Vec3::zeros(), spacing: Vec3::new(1.0, 1.0, 1.0) };
    let x = || [DataArray::scalars("x", ramp(40, 0.0))];
    type Writer<'a> = Box<dyn Fn(&mut dyn Write) -> Result<(), VtkError> + 'a>;
    let writers: [Writer; 6] = [
        Box::new(|out| write_surface(out, &mesh, &[], &[])),
        Box::new(|out| write_points(out, &points, &x())),
        Box::new(|out| write_polylines(out, &lines, &[], &[])),
        Box::new(|out| write_line_cells(out, &lines, &[], &[])),
        Box::new(|out| write_image(out, &grid, &x(), &[])),
        Box::new(|out| write_collection(out, &[(0.0, "a")])),
    ];
    for write in &writers {
        let whole = file(write);
        let flushed = Cell::new(false);
        let mut narrow = Narrow { taken: Vec::new(), room: whole.len(), flushed: &flushed };
        write(&mut narrow).unwrap();
        assert_eq!(narrow.taken, whole);
        assert!(flushed.get());
        for room in [0, whole.len() / 2, whole.len() - 1] {
            let mut full = Narrow { taken: Vec::new(), room, flushed: &flushed };
            let error = write(&mut full).unwrap_err();
            assert!(matches!(&error, VtkError::Io(e) if e.kind() == io::ErrorKind::StorageFull), "{error}");
        }
    }
}
