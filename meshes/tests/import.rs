//! Mesh files of the programs that people use, read and compared with what is known of the shapes in them.
//!
//! `fixtures/make.py` made the files and says what is in them: a box of volume 2 and area 10, a rectangle of area 6 and
//! a triangle of area 1/2, with integer coordinates. All comparisons are therefore exact, in single precision and in
//! six digits too.

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use meshes::Vec3;
use meshes::import::{Format, ImportError, ImportedMesh, read};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn format(name: &str) -> Format {
    let extension = name.rsplit('.').next().unwrap_or_default();
    Format::from_extension(extension).unwrap_or_else(|| panic!("{name} has no known extension"))
}

fn load(name: &str) -> Result<ImportedMesh, ImportError> {
    read(format(name), &bytes(name))
}

fn corners(mesh: &ImportedMesh, triangle: usize) -> [Vec3; 3] {
    mesh.triangles[triangle].map(|v| mesh.vertices[v as usize])
}

fn area(mesh: &ImportedMesh, triangle: usize) -> f64 {
    let [a, b, c] = corners(mesh, triangle);
    0.5 * (b - a).cross(&(c - a)).norm()
}

fn total_area(mesh: &ImportedMesh) -> f64 {
    (0..mesh.triangles.len()).map(|t| area(mesh, t)).sum()
}

fn volume(mesh: &ImportedMesh) -> f64 {
    (0..mesh.triangles.len()).map(|t| corners(mesh, t)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
}

/// Area of each group; what belongs to none is under "".
fn group_areas(mesh: &ImportedMesh) -> BTreeMap<String, f64> {
    let mut areas = BTreeMap::new();
    for (t, group) in mesh.group.iter().enumerate() {
        let name = group.map_or("", |group| mesh.groups[group as usize].as_str());
        *areas.entry(name.to_string()).or_insert(0.0) += area(mesh, t);
    }
    areas
}

/// The three surfaces, by the names that a file has for their groups (none: it has no groups).
fn check(name: &str, vertices: usize, groups: &[&str]) {
    let mesh = load(name).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (vertices, 33), "{name}");
    assert_eq!(total_area(&mesh), 16.5, "{name}");
    let expected: Vec<(&str, f64)> = match groups {
        [] => vec![("", 16.5)],
        [only] => vec![(only, 16.5)],
        _ => groups.iter().copied().zip([10.0, 6.0, 0.5]).collect(),
    };
    let expected: BTreeMap<String, f64> = expected.into_iter().map(|(group, area)| (group.to_string(), area)).collect();
    assert_eq!(group_areas(&mesh), expected, "{name}");

    let (clean, report) = mesh.clone().clean();
    assert_eq!((clean.vertices.len(), clean.triangles.len()), (27, 33), "{name}: {report}");
    assert_eq!((report.closed_pieces, report.open_pieces, report.free_edges), (1, 2, 13), "{name}: {report}");
    assert_eq!((report.duplicates, report.without_area, report.branching_edges), (0, 0, 0), "{name}: {report}");

    if let [anode, plate, _] = groups {
        let (box_alone, report) = mesh.select(anode).unwrap().clean();
        assert_eq!((box_alone.vertices.len(), box_alone.triangles.len()), (12, 20), "{name}");
        assert_eq!((volume(&box_alone), report.is_closed()), (2.0, true), "{name}: {report}");
        assert_eq!(box_alone.groups, [*anode], "{name}");
        let (plate_alone, report) = mesh.select(plate).unwrap().clean();
        assert_eq!((plate_alone.vertices.len(), total_area(&plate_alone)), (12, 6.0), "{name}");
        assert_eq!((report.open_pieces, report.free_edges), (1, 10), "{name}: {report}");
    }
}

const NUMBERED: [&str; 3] = ["3", "5", "7"];

#[test]
fn gmsh_files() {
    for name in [
        "gmsh_22_ascii.msh",
        "gmsh_22_binary.msh",
        "gmsh_22_big_endian.msh",
        "gmsh_22_quads_order2.msh",
        "gmsh_22_turned.msh",
        "gmsh_41_ascii.msh",
        "gmsh_41_binary.msh",
        "gmsh_41_big_endian.msh",
        "gmsh_41_partitioned.msh",
        "gmsh_41_quads_order2.msh",
        "gmsh_41_turned.msh",
    ] {
        check(name, 27, &["anode", "cathode plate", "surface 7"]);
    }
}

/// Encodings of one mesh: equal to the last digit, in the order of the file.
#[test]
fn encodings_of_the_same_mesh_are_equal() {
    for names in [
        &[
            "gmsh_22_ascii.msh",
            "gmsh_22_binary.msh",
            "gmsh_22_big_endian.msh",
            "gmsh_41_ascii.msh",
            "gmsh_41_binary.msh",
            "gmsh_41_big_endian.msh",
        ][..],
        &["gmsh_22_turned.msh", "gmsh_41_turned.msh"],
        &["gmsh_ascii.vtk", "gmsh_binary.vtk"],
        &["hand_groups_ascii.ply", "hand_groups_little_endian.ply", "hand_groups_big_endian.ply"],
        &[
            "meshio_ascii.vtu",
            "meshio_base64.vtu",
            "meshio_zlib.vtu",
            "meshio_42_binary.vtk",
            "meshio_51_ascii.vtk",
            "meshio_51_binary.vtk",
        ],
        &["vtk_ascii.vtu", "vtk_base64.vtu", "vtk_zlib.vtu", "vtk_appended_raw.vtu", "vtk_grid_42_binary.vtk"],
        &["vtk_strips.vtp", "vtk_strips_42_ascii.vtk", "vtk_strips_51_binary.vtk"],
    ] {
        let first = load(names[0]).unwrap();
        for name in &names[1..] {
            assert_eq!(load(name).unwrap(), first, "{name} and {}", names[0]);
        }
    }
}

/// A physical group may take its surfaces turned over (with negative numbers in Gmsh).
#[test]
fn gmsh_groups_that_turn_their_surfaces() {
    let upward = |name: &str| -> f64 {
        let plate = load(name).unwrap().select("cathode plate").unwrap();
        (0..plate.triangles.len()).map(|t| corners(&plate, t)).map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).z).sum()
    };
    assert_eq!(upward("gmsh_41_ascii.msh"), 6.0);
    assert_eq!(upward("gmsh_41_turned.msh"), -6.0);
    assert_eq!(upward("gmsh_22_turned.msh"), -6.0);
}

#[test]
fn stl_files() {
    for name in ["gmsh_ascii.stl", "gmsh_binary.stl"] {
        check(name, 99, &["anode", "cathode plate", "Gmsh Physical Surface 7"]);
    }
    check("meshio_ascii.stl", 99, &[]);
    check("hand_solid.stl", 99, &["trap"]);
    let mesh = load("meshio_binary.stl").unwrap();
    assert_eq!((mesh.triangles.len(), mesh.groups.len()), (33, 1)); // the name of meshio in the header
}

#[test]
fn obj_files() {
    check("gmsh.obj", 27, &[]);
    check("hand_groups.obj", 27, &["anode", "cathode plate", "nameless"]);
}

#[test]
fn ply_files() {
    for name in ["meshio_ascii.ply", "meshio_binary.ply", "vtk_big_endian.ply"] {
        check(name, 27, &[]);
    }
    for name in ["hand_groups_ascii.ply", "hand_groups_big_endian.ply", "hand_groups_little_endian.ply"] {
        check(name, 27, &NUMBERED);
    }
}

#[test]
fn legacy_vtk_files() {
    for name in
        ["gmsh_ascii.vtk", "gmsh_binary.vtk", "meshio_42_binary.vtk", "meshio_51_ascii.vtk", "meshio_51_binary.vtk"]
    {
        check(name, 27, &NUMBERED);
    }
    for shape in ["grid", "strips"] {
        for kind in ["42_ascii", "42_binary", "51_ascii", "51_binary"] {
            check(&format!("vtk_{shape}_{kind}.vtk"), 27, &NUMBERED);
        }
    }
}

#[test]
fn vtk_xml_files() {
    for name in [
        "meshio_ascii.vtu",
        "meshio_base64.vtu",
        "meshio_zlib.vtu",
        "vtk_ascii.vtu",
        "vtk_base64.vtu",
        "vtk_base64_big_endian_64.vtu",
        "vtk_zlib.vtu",
        "vtk_zlib_64.vtu",
        "vtk_appended_raw.vtu",
        "vtk_appended_raw_64.vtu",
        "vtk_appended_raw_big_endian.vtu",
        "vtk_appended_raw_zlib.vtu",
        "vtk_appended_base64.vtu",
        "vtk_appended_base64_zlib_64.vtu",
        "vtk_strips.vtp",
    ] {
        check(name, 27, &NUMBERED);
    }
}

/// What is not read says what to do instead.
#[test]
fn files_that_are_not_read() {
    let say = |name: &str| load(name).unwrap_err().to_string();
    let message = say("gmsh_41_volume_only.msh");
    assert!(
        message.starts_with("no triangles: the file has 1 line element and 12 tetrahedra; save the surface"),
        "{message}"
    );
    assert!(say("vtk_lz4.vtu").contains("vtkLZ4DataCompressor: save it with zlib compression"));
    assert!(say("meshio_lzma.vtu").contains("vtkLZMADataCompressor: save it with zlib compression"));
    let message = read(Format::Stl, &bytes("gmsh_22_binary.msh")).unwrap_err().to_string();
    assert!(message.contains("it looks like a Gmsh file"), "{message}");
}

/// Every mesh of the folder is in one of the tests above.
#[test]
fn no_fixture_is_forgotten() {
    let this = std::fs::read_to_string(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/import.rs")).unwrap();
    for name in fixtures() {
        let stem = name.replace("vtk_grid_", "").replace("vtk_strips_", "").replace(".vtk", "");
        assert!(this.contains(&name) || this.contains(&format!("\"{stem}\"")), "{name} is not tested");
    }
}

fn fixtures() -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.rsplit('.').next().is_some_and(|extension| Format::from_extension(extension).is_some()))
        .collect();
    names.sort();
    names
}

/// The largest piece of memory that was asked for at once.
static LARGEST_REQUEST: AtomicUsize = AtomicUsize::new(0);

/// The system's memory, with a note of the largest request: a header that lies must not be believed.
struct Watched;

// The one way to see what is reserved, and it only passes on what it is given.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST_REQUEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static MEMORY: Watched = Watched;

/// Numbers that look random and are the same in every run (Marsaglia 2003, xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }
}

/// Files cut short, with bits flipped, bytes overwritten or pieces moved: read or refused, never a panic, and what is
/// read is sound.
///
/// About 2 s. A panic fails the test by itself; what is reserved is watched by `Watched`.
#[test]
fn damaged_files_are_refused_or_sound() {
    let start = Instant::now();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut read_anyway, mut refused) = (0, 0);
    for name in fixtures() {
        let whole = bytes(&name);
        for round in 0..1200 {
            let mut damaged = whole.clone();
            match round % 4 {
                0 => damaged.truncate(random.below(whole.len())),
                1 => {
                    for _ in 0..1 + random.below(3) {
                        let at = random.below(whole.len());
                        damaged[at] ^= 1 << random.below(8);
                    }
                }
                2 => {
                    // A count or an index at its largest, or a digit more.
                    let at = random.below(whole.len());
                    let end = (at + 1 + random.below(8)).min(whole.len());
                    damaged[at..end].fill([0xff, 0x7f, 0x00, b'9'][random.below(4)]);
                }
                _ => {
                    let (from, to) = (random.below(whole.len()), random.below(whole.len()));
                    let piece = whole[from..(from + random.below(64)).min(whole.len())].to_vec();
                    damaged.splice(to..to, piece);
                }
            }
            let before = Instant::now();
            match read(format(&name), &damaged) {
                Err(error) => {
                    let message = error.to_string();
                    assert!(!message.is_empty() && message.len() < 2000, "{name}, round {round}: {message}");
                    refused += 1;
                }
                Ok(mesh) => {
                    sound(&mesh, &format!("{name}, round {round}"));
                    let (clean, _) = mesh.clean();
                    sound(&clean, &format!("{name}, round {round}, cleaned"));
                    read_anyway += 1;
                }
            }
            // A thousand times what a whole fixture takes.
            assert!(before.elapsed() < Duration::from_secs(1), "{name}, round {round}: {:?}", before.elapsed());
        }
    }
    // Else the damage would be no test of one or the other.
    assert!(read_anyway > 1000 && refused > 1000, "{read_anyway} read, {refused} refused");
    println!("{read_anyway} read, {refused} refused in {:?}", start.elapsed());
    // The largest fixture has 8 kB; a count that is believed asks for gigabytes.
    let most = LARGEST_REQUEST.load(Ordering::Relaxed);
    assert!(most < 4 << 20, "{most} bytes were reserved at once");
}

/// Every truncation of every fixture, for files whose end matters are small.
#[test]
fn every_prefix_is_refused_or_sound() {
    for name in fixtures() {
        let whole = bytes(&name);
        for length in (0..whole.len()).step_by(7) {
            if let Ok(mesh) = read(format(&name), &whole[..length]) {
                sound(&mesh, &format!("{name} cut to {length} bytes"));
            }
        }
    }
}

fn sound(mesh: &ImportedMesh, what: &str) {
    assert!(!mesh.triangles.is_empty(), "{what}");
    assert_eq!(mesh.triangles.len(), mesh.group.len(), "{what}");
    assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()), "{what}");
    assert!(mesh.group.iter().flatten().all(|&g| (g as usize) < mesh.groups.len()), "{what}");
    assert!(mesh.vertices.iter().flat_map(|v| v.iter()).all(|x| x.is_finite()), "{what}");
}
