//! One file of every kind the VTK writers make, with what a reader must find in them.
//!
//!     cargo run -p graintrap-meshes --example vtk_samples -- OUTDIR
//!     python .ci/read_samples.py OUTDIR          (meshio and VTK)
//!     pvpython .ci/read_samples.py OUTDIR        (ParaView)
//!     python .ci/read_back.py OUTDIR/run         (the checks that a run must pass)
//!
//! 1. Values are random bits where any bits will do: a reader that rounds, swaps bytes or loses an array is caught.
//! 2. Sizes include the awkward ones: nothing, one point, arrays of a whole number of compressed blocks.
//! 3. `OUTDIR/run` looks like a run of the solver and has a `summary.json` that agrees with it.

use std::error::Error;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;

use meshes::vtk::{
    DataArray, ImageGrid, PolylineArray, Polylines, Values, write_collection, write_image, write_line_cells,
    write_points, write_polylines, write_surface,
};
use meshes::{ElectrodeSurface, SurfaceMesh, Vec3};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn main() -> Outcome {
    let folder = std::env::args().nth(1).ok_or("usage: vtk_samples OUTDIR")?;
    let folder = Path::new(&folder);
    fs::create_dir_all(folder.join("run/grains"))?;
    let mut random = Random(1);
    let mut expected = Vec::new();

    // Surfaces: none, one triangle, and 4096, whose f64 arrays are whole numbers of vtkio's blocks of 32 KiB.
    for panels in [0, 1, 20, 4096] {
        let file = format!("surface_{panels}.vtu");
        let mesh = strip(panels, &mut random);
        let point_arrays = random.arrays(mesh.vertices.len());
        let cell_arrays = random.arrays(panels);
        write_surface(&mut create(folder, &file)?, &mesh, &point_arrays, &cell_arrays)?;
        expected.push(json(&[
            ("file", text(&file)),
            ("points", numbers(mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z]))),
            ("types", numbers(vec![5.0; panels])),
            ("cells", list(mesh.triangles.iter().map(|t| numbers(t.map(f64::from))))),
            ("point_arrays", arrays(&point_arrays)),
            ("cell_arrays", arrays(&cell_arrays)),
        ]));
    }

    // Points: none, one, some, and a whole number of blocks.
    for count in [0, 1, 50, 4096] {
        let file = format!("points_{count}.vtp");
        let points = random.points(count);
        let point_arrays = random.arrays(count);
        write_points(&mut create(folder, &file)?, &points, &point_arrays)?;
        expected.push(json(&[
            ("file", text(&file)),
            ("points", numbers(points.iter().flat_map(|v| [v.x, v.y, v.z]))),
            ("types", numbers(vec![1.0; count])),
            ("cells", list((0..count).map(|i| numbers([i as f64])))),
            ("point_arrays", arrays(&point_arrays)),
            ("cell_arrays", arrays(&[])),
        ]));
    }

    // Polylines: none, a dot, dots only, lines and dots mixed; one line of every small length, since the offsets of
    // appended arrays (and what readers make of them) depend on it.
    let mixed: Vec<usize> = (0..200).map(|i| [1, 7, 2, 300, 1][i % 5]).collect();
    for (name, lengths) in [("none", vec![]), ("dots", vec![1; 5]), ("mixed", mixed)] {
        polylines(folder, name, &lengths, &mut random, &mut expected)?;
    }
    for length in 1..=30 {
        polylines(folder, &format!("of_{length}"), &[length], &mut random, &mut expected)?;
    }

    // Lattices: a box, a sheet in each plane, a row, a single point; awkward origins.
    for points in [[5, 4, 3], [1, 6, 7], [6, 1, 7], [6, 7, 1], [9, 1, 1], [1, 1, 9], [1, 1, 1], [2, 1, 1]] {
        let [nx, ny, nz] = points;
        let file = format!("image_{nx}_{ny}_{nz}.vti");
        let origin = random.points(1)[0];
        let spacing = random.points(1)[0].abs() * 1e-7;
        let grid = ImageGrid { points, origin, spacing };
        let (n_points, n_cells) = grid.counts()?;
        let mut point_arrays = random.arrays(n_points);
        // The same numbers again, computed while they are written.
        let ramp: Vec<f64> = (0..2 * n_points).map(|i| (i as f64).sqrt()).collect();
        point_arrays.push(DataArray { name: "ramp".into(), components: 2, values: ramp.into() });
        let cell_arrays = random.arrays(n_cells);
        let what = [
            ("file", text(&file)),
            ("dimensions", numbers(points.map(|n| n as f64))),
            ("origin", numbers([origin.x, origin.y, origin.z])),
            ("spacing", numbers([spacing.x, spacing.y, spacing.z])),
            ("point_arrays", arrays(&point_arrays)),
            ("cell_arrays", arrays(&cell_arrays)),
        ];
        expected.push(json(&what));
        point_arrays.pop();
        point_arrays.push(DataArray::computed("ramp", 2, n_points, |tuples, out| {
            for (i, value) in (2 * tuples.start..).zip(out) {
                *value = (i as f64).sqrt();
            }
        }));
        write_image(&mut create(folder, &file)?, &grid, &point_arrays, &cell_arrays)?;
    }

    // A collection, whose frames have ever fewer points and a name that needs escaping.
    let times = [0.0, 1e-12, 0.1, 0.30000000000000004, 12345.678];
    let mut frames = Vec::new();
    for (k, &time) in times.iter().enumerate() {
        let file = format!("frame & {k}.vtp");
        let points = random.points(4 - k);
        let point_arrays = random.arrays(points.len());
        write_points(&mut create(folder, &file)?, &points, &point_arrays)?;
        expected.push(json(&[
            ("file", text(&file)),
            ("points", numbers(points.iter().flat_map(|v| [v.x, v.y, v.z]))),
            ("types", numbers(vec![1.0; points.len()])),
            ("cells", list((0..points.len()).map(|i| numbers([i as f64])))),
            ("point_arrays", arrays(&point_arrays)),
            ("cell_arrays", arrays(&[])),
        ]));
        frames.push((time, file));
    }
    write_collection(&mut create(folder, "frames.pvd")?, &frames)?;
    expected.push(json(&[
        ("file", text("frames.pvd")),
        ("times", numbers(times)),
        ("files", list(frames.iter().map(|(_, file)| text(file)))),
    ]));

    fs::write(folder.join("expected.json"), list(expected))?;
    run(&folder.join("run"), &mut random)
}

/// The same polylines as `.vtp` and as `.vtu`.
fn polylines(folder: &Path, name: &str, lengths: &[usize], random: &mut Random, expected: &mut Vec<String>) -> Outcome {
    let starts: Vec<usize> = lengths.iter().scan(0, |next, n| Some(std::mem::replace(next, *next + n))).collect();
    let count = lengths.iter().sum();
    let points = random.points(count);
    let scalars = random.doubles(count);
    let vectors = random.points(count);
    let lines = Polylines::new(lengths, |line, point| points[starts[line] + point]);
    let point_arrays = [
        PolylineArray::scalars("scalar <&>", |line, point| scalars[starts[line] + point]),
        PolylineArray::vectors("vector", |line, point| vectors[starts[line] + point]),
    ];
    let line_arrays = random.arrays(lengths.len());
    let (polydata, grid) = (format!("polylines_{name}.vtp"), format!("line_cells_{name}.vtu"));
    write_polylines(&mut create(folder, &polydata)?, &lines, &point_arrays, &line_arrays)?;
    write_line_cells(&mut create(folder, &grid)?, &lines, &point_arrays, &line_arrays)?;

    // Dots come first; in the .vtu a line array is repeated for each segment.
    let order = || {
        let of = |dot: bool| (0..lengths.len()).filter(move |&line| (lengths[line] == 1) == dot);
        of(true).chain(of(false))
    };
    for (file, segments) in [(&polydata, false), (&grid, true)] {
        let (mut cells, mut types, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for line in order() {
            let (first, n) = (starts[line], lengths[line]);
            let mut cell = |kind: f64, points: std::ops::Range<usize>| {
                cells.push(numbers(points.map(|i| i as f64)));
                types.push(kind);
                owners.push(line);
            };
            match (n, segments) {
                (1, _) => cell(1.0, first..first + 1),
                (2.., false) => cell(if n == 2 { 3.0 } else { 4.0 }, first..first + n),
                _ => (0..n - 1).for_each(|k| cell(3.0, first + k..first + k + 2)),
            }
        }
        let chosen: Vec<DataArray> = line_arrays.iter().map(|array| picked(array, &owners)).collect();
        expected.push(json(&[
            ("file", text(file)),
            ("points", numbers(points.iter().flat_map(|v| [v.x, v.y, v.z]))),
            ("types", numbers(types)),
            ("cells", list(cells)),
            (
                "point_arrays",
                arrays(&[DataArray::scalars("scalar <&>", scalars.as_slice()), DataArray::vectors("vector", &vectors)]),
            ),
            ("cell_arrays", arrays(&chosen)),
        ]));
    }
    Ok(())
}

/// A folder as a run of the solver leaves it: two square plates, four grains, one of which never moved.
fn run(folder: &Path, random: &mut Random) -> Outcome {
    // 1. Two plates of 2 x 2 panels; the capacitance matrix is made up, and each density is constant on an electrode.
    let names = ["left", "right <plate>"];
    let matrix = [[3.25e-11, -1.5e-11], [-1.5e-11, 2.75e-11]];
    let mut mesh = SurfaceMesh::default();
    for (k, name) in names.iter().enumerate() {
        let first = mesh.vertices.len() as u32;
        let corner = |a: f64, b: f64| Vec3::new(k as f64, a, b);
        mesh.vertices.extend([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        mesh.electrode.extend([k as u32; 2]);
        mesh.electrodes.push(ElectrodeSurface { name: (*name).into(), closed: false, hollow: false });
    }
    let mut cell_arrays = vec![
        DataArray::scalars("electrode", mesh.electrode.as_slice()),
        DataArray::scalars("charge_density", random.places(4)),
    ];
    for (driven, name) in names.iter().enumerate() {
        // Each plate has area 1 m².
        let density: Vec<f64> = mesh.electrode.iter().map(|&e| matrix[e as usize][driven]).collect();
        cell_arrays.push(DataArray::scalars(format!("unit_charge_density {name}"), density));
    }
    write_surface(&mut create(folder, "electrodes.vtu")?, &mesh, &[], &cell_arrays)?;

    // 2. The field on a lattice.
    let grid = ImageGrid { points: [4, 5, 6], origin: Vec3::new(-0.1, 0.2, 0.3), spacing: Vec3::new(0.1, 0.1, 1e-3) };
    let (n, _) = grid.counts()?;
    let field: Vec<Vec3> = (0..n).map(|_| Vec3::from_fn(|_, _| random.place())).collect();
    let point_arrays = [
        DataArray::scalars("potential", random.places(n)),
        DataArray::vectors("field", &field),
        DataArray::scalars("inside_conductor", vec![0u8; n]),
    ];
    write_image(&mut create(folder, "field.vti")?, &grid, &point_arrays, &[])?;

    // 3. Tracks sampled every 10 ms; grain 2 has only its first sample.
    let step = 0.01;
    let lengths = [5, 3, 1, 5];
    let tracks: Vec<Vec<Vec3>> =
        lengths.iter().map(|&n| (0..n).map(|_| Vec3::from_fn(|_, _| random.place())).collect()).collect();
    let lines = Polylines::new(&lengths, |line, point| tracks[line][point]);
    let point_arrays = || {
        [
            PolylineArray::scalars("time", |_, point| point as f64 * step),
            PolylineArray::scalars("speed", |line, point| (line * 10 + point) as f64),
            PolylineArray::vectors("force", |line, point| tracks[line][point] * 1e-13),
        ]
    };
    let line_arrays = || [DataArray::scalars("grain", vec![0u32, 1, 2, 3])];
    write_polylines(&mut create(folder, "trajectories.vtp")?, &lines, &point_arrays(), &line_arrays())?;
    write_line_cells(&mut create(folder, "trajectories.vtu")?, &lines, &point_arrays(), &line_arrays())?;

    // 4. One frame per sample, with the grains that are still there.
    let mut frames = Vec::new();
    for k in 0..5 {
        let file = format!("grains/{k:05}.vtp");
        let there = || (0u32..).zip(&tracks).filter_map(|(grain, track)| Some((grain, *track.get(k)?)));
        let present: Vec<u32> = there().map(|(grain, _)| grain).collect();
        let places: Vec<Vec3> = there().map(|(_, place)| place).collect();
        let grain = DataArray::scalars("grain", present);
        write_points(&mut create(folder, &file)?, &places, &[grain])?;
        frames.push((k as f64 * step, file));
    }
    write_collection(&mut create(folder, "grains.pvd")?, &frames)?;

    // 5. The summary.
    let finals = tracks.iter().zip(lengths).map(|(track, n)| {
        let last = track[n - 1];
        json(&[
            ("position", numbers([last.x, last.y, last.z])),
            ("velocity", numbers([0.0; 3])),
            ("outcome", text("time_up")),
            ("time", format!("{:?}", (n - 1) as f64 * step)),
        ])
    });
    let trace = json(&[
        ("grains", "4".into()),
        ("steps", "400".into()),
        ("outcomes", json(&[("time_up", "4".into()), ("left_region", "0".into()), ("struck", "{}".into())])),
        ("final", list(finals)),
    ]);
    let files = ["electrodes.vtu", "field.vti", "trajectories.vtp", "trajectories.vtu", "grains.pvd", "summary.json"];
    let summary = json(&[
        ("electrodes", list(names.map(text))),
        ("capacitance_matrix_farad", list(matrix.map(numbers))),
        ("panels", "4".into()),
        ("trace", trace),
        ("files", list(files.map(text))),
    ]);
    fs::write(folder.join("summary.json"), summary)?;
    Ok(())
}

fn create(folder: &Path, file: &str) -> Outcome<BufWriter<File>> {
    Ok(BufWriter::new(File::create(folder.join(file))?))
}

/// A strip of triangles over random vertices, which need not lie sensibly.
fn strip(panels: usize, random: &mut Random) -> SurfaceMesh {
    let vertices = if panels == 0 { 0 } else { panels + 2 };
    SurfaceMesh {
        vertices: random.points(vertices),
        triangles: (0..panels as u32).map(|i| [i, i + 1, i + 2]).collect(),
        electrode: vec![0; panels],
        electrodes: vec![],
    }
}

/// The tuples of an array that belong to these lines.
fn picked<'a>(array: &DataArray, lines: &[usize]) -> DataArray<'a> {
    fn pick<T: Copy>(values: &[T], components: usize, lines: &[usize]) -> Vec<T> {
        lines.iter().flat_map(|&line| values[line * components..][..components].iter().copied()).collect()
    }
    let values = match &array.values {
        Values::F64(values) => pick(values, array.components, lines).into(),
        Values::F32(values) => pick(values, array.components, lines).into(),
        Values::I32(values) => pick(values, array.components, lines).into(),
        Values::U32(values) => pick(values, array.components, lines).into(),
        Values::U8(values) => pick(values, array.components, lines).into(),
        Values::Computed(_) => Values::from(Vec::<f64>::new()),
    };
    DataArray { name: array.name.clone(), components: array.components, values }
}

/// SplitMix64 (Steele, Lea and Flood 2014): enough for samples, and the same everywhere.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Between 0 and 1.
    fn place(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn places(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.place()).collect()
    }

    /// Any finite f64: subnormal, huge, negative zero.
    fn double(&mut self) -> f64 {
        const CORNERS: [f64; 6] = [-0.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::MIN, 0.1];
        let bits = self.bits();
        if bits.is_multiple_of(8) {
            CORNERS[(bits >> 8) as usize % 6]
        } else {
            self.finite(f64::from_bits, f64::is_finite)
        }
    }

    fn finite<T: Copy>(&mut self, from: fn(u64) -> T, finite: fn(T) -> bool) -> T {
        loop {
            let value = from(self.bits());
            if finite(value) {
                return value;
            }
        }
    }

    fn doubles(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.double()).collect()
    }

    /// Points of a reasonable size with all digits in use: viewers compute bounds from them.
    fn points(&mut self, n: usize) -> Vec<Vec3> {
        (0..n).map(|_| Vec3::from_fn(|_, _| 2.0 * self.place() - 1.0)).collect()
    }

    /// An array of every type, under names that need escaping.
    fn arrays<'a>(&mut self, n: usize) -> Vec<DataArray<'a>> {
        let single = |random: &mut Self| random.finite(|bits| f32::from_bits(bits as u32), f32::is_finite);
        vec![
            DataArray::scalars("f64 <a & \"b\">", self.doubles(n)),
            DataArray { name: "vector, µm".into(), components: 3, values: self.doubles(3 * n).into() },
            DataArray { name: "matrix".into(), components: 9, values: self.doubles(9 * n).into() },
            DataArray::scalars("f32 'single'", (0..n).map(|_| single(self)).collect::<Vec<_>>()),
            DataArray::scalars("i32", (0..n).map(|_| self.bits() as i32).collect::<Vec<_>>()),
            DataArray {
                name: "u32 pair".into(),
                components: 2,
                values: (0..2 * n).map(|_| self.bits() as u32).collect::<Vec<_>>().into(),
            },
            DataArray::scalars(" u8 ", (0..n).map(|_| self.bits() as u8).collect::<Vec<_>>()),
        ]
    }
}

// JSON, as far as it is needed here.

fn json(pairs: &[(&str, String)]) -> String {
    let members: Vec<String> = pairs.iter().map(|(key, value)| format!("{}: {value}", text(key))).collect();
    format!("{{{}}}", members.join(", "))
}

fn list(items: impl IntoIterator<Item = String>) -> String {
    format!("[{}]\n", items.into_iter().collect::<Vec<_>>().join(", "))
}

fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    list(values.into_iter().map(|value| format!("{value:?}")))
}

fn text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn arrays(arrays: &[DataArray]) -> String {
    let mut out = Vec::new();
    for DataArray { name, components, values } in arrays {
        let (kind, values): (&str, Vec<f64>) = match values {
            Values::F64(values) => ("float64", values.to_vec()),
            Values::F32(values) => ("float32", values.iter().map(|&x| x.into()).collect()),
            Values::I32(values) => ("int32", values.iter().map(|&x| x.into()).collect()),
            Values::U32(values) => ("uint32", values.iter().map(|&x| x.into()).collect()),
            Values::U8(values) => ("uint8", values.iter().map(|&x| x.into()).collect()),
            Values::Computed(_) => continue,
        };
        let mut array = String::new();
        let _ = write!(
            array,
            "{{\"name\": {}, \"components\": {components}, \"type\": \"{kind}\", \"values\": {}}}",
            text(name),
            numbers(values)
        );
        out.push(array);
    }
    list(out)
}
