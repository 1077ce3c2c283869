//! Surfaces from mesh files: Gmsh, STL, OBJ, PLY, VTK and VTU.
//!
//! [`read`] turns the bytes of a file into an [`ImportedMesh`]: triangles, each with the name of the group that it
//! belongs to in the file. [`ImportedMesh::select`] keeps one group; [`ImportedMesh::clean`] makes a surface of it that
//! can carry charge: vertices shared, triangles without area gone, all normals outward.
//!
//! What a *group* is depends on the format:
//!
//! * Gmsh: a physical surface; without a name, `surface 7` after its number. A surface in two groups counts in both.
//! * STL: a solid, by its name in a text file, by the header of its section in a binary file (Gmsh writes one section
//!   per solid). A solid without a name has no group, or is called `solid 2` where there are several.
//! * OBJ: the last `o` or `g` statement before the face.
//! * PLY, VTK, VTU: an integer property or cell array called `electrode`, `group`, `gmsh:physical`, `physical`,
//!   `region`, `part` or `CellEntityIds` (in any case; the first of these that is there). The group is called by the
//!   number: `3`.
//!
//! Elements of higher order are used as flat triangles and quadrilaterals between their corners. Quadrilaterals are cut
//! along the shorter diagonal, polygons into triangles. Points, lines and volumes are passed over.
//!
//! ```
//! use meshes::import::{Format, read};
//!
//! let obj = b"v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\no lid\nf 1 2 3 4\n";
//! let (lid, cleaned) = read(Format::Obj, obj)?.select("lid")?.clean();
//! assert_eq!((lid.triangles.len(), cleaned.open_pieces), (2, 1));
//!
//! let error = read(Format::Obj, obj)?.select("Lid").unwrap_err();
//! assert_eq!(error.to_string(), "no group \"Lid\" in the file, did you mean \"lid\"? it has \"lid\"");
//! # Ok::<(), meshes::import::ImportError>(())
//! ```
//!
//! Why own readers: the crates at hand were tried on whole and on damaged files (November 2026). `stl_io` 0.11 keeps
//! only the first solid of a text file and of Gmsh's binary ones, takes any binary file that begins with "solid " for
//! text, and refuses a text file whose solid has no name. `tobj` 4 names neither line nor number in its errors.
//! `ply-rs-bw` 4 fills the memory when a header announces elements without properties, and takes 1.5 s for 500 000
//! triangles of text. `vtkio` 0.7.0-rc2: see `vtk` and `vtu`. `mshio` 0.4 was left aside without a trial: by its
//! description it reads 4.1 only, and no physical names.

mod build;
mod cells;
mod clean;
mod error;
mod gmsh;
mod obj;
mod ply;
mod polygon;
mod scan;
mod stl;
mod vtk;
mod vtu;

use std::fmt;

pub use clean::Cleaned;
pub use error::{Census, ImportError, Position};
pub use vtu::DataSet;

use crate::Vec3;

/// Triangles read from a file, before anything is known of electrodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportedMesh {
    /// Corner points, in the unit of the file. Each is used by a triangle, and finite.
    pub vertices: Vec<Vec3>,
    /// Corners of each triangle, oriented as in the file.
    pub triangles: Vec<[u32; 3]>,
    /// Group of each triangle, an index into `groups`.
    pub group: Vec<Option<u32>>,
    /// Names of the groups that have a triangle, in the order in which the file uses them.
    pub groups: Vec<String>,
}

/// The kinds of mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Gmsh `.msh` 2.x or 4.1, ASCII or binary of either byte order.
    Gmsh,
    /// STL, ASCII or binary, one solid or several.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// PLY (Stanford polygon file), ASCII or binary of either byte order.
    Ply,
    /// Legacy VTK: polygonal data or an unstructured grid, ASCII or (big-endian) binary.
    Vtk,
    /// VTK's XML files of unstructured grids, and of polygonal data (`.vtp`); all encodings, compressed by zlib or not.
    Vtu,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 6] = [Format::Gmsh, Format::Stl, Format::Obj, Format::Ply, Format::Vtk, Format::Vtu];

    /// The format of files with this extension (without the dot, in any case), if it is one of ours.
    pub fn from_extension(extension: &str) -> Option<Self> {
        Some(match extension.to_ascii_lowercase().as_str() {
            "msh" => Format::Gmsh,
            "stl" => Format::Stl,
            "obj" => Format::Obj,
            "ply" => Format::Ply,
            "vtk" => Format::Vtk,
            "vtu" | "vtp" => Format::Vtu,
            _ => return None,
        })
    }

    /// The format that the first bytes of a file point to. Binary STL and OBJ have no mark of their own.
    fn from_content(bytes: &[u8]) -> Option<Self> {
        let start = &bytes[..bytes.len().min(400)];
        let text = String::from_utf8_lossy(start);
        let text = text.trim_start_matches(|c: char| c == '\u{feff}' || c.is_whitespace());
        [("$MeshFormat", Format::Gmsh), ("# vtk DataFile", Format::Vtk), ("ply", Format::Ply), ("solid", Format::Stl)]
            .into_iter()
            .find(|(mark, _)| text.starts_with(mark))
            .map(|(_, format)| format)
            .or_else(|| text.contains("<VTKFile").then_some(Format::Vtu))
            .or_else(|| text.lines().any(|line| line.starts_with("v ")).then_some(Format::Obj))
    }

    /// The error for a file that does not begin as this format does.
    fn mismatch(self, bytes: &[u8], expected: &'static str) -> ImportError {
        let looks_like = Format::from_content(bytes).filter(|&other| other != self);
        ImportError::WrongFormat { format: self, expected, looks_like }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Gmsh => "Gmsh",
            Format::Stl => "STL",
            Format::Obj => "OBJ",
            Format::Ply => "PLY",
            Format::Vtk => "legacy VTK",
            Format::Vtu => "VTK XML",
        })
    }
}

/// Reads a mesh file that is already in memory.
///
/// The result has at least one triangle with an area, and all of its coordinates are finite.
///
/// # Errors
/// The file is not of this format, is damaged or cut short, or holds no surface; see [`ImportError`]. Memory and time
/// stay in proportion to the size of the file, whatever it claims to hold.
pub fn read(format: Format, bytes: &[u8]) -> Result<ImportedMesh, ImportError> {
    match format {
        Format::Gmsh => gmsh::read(bytes),
        Format::Stl => stl::read(bytes),
        Format::Obj => obj::read(bytes),
        Format::Ply => ply::read(bytes),
        Format::Vtk => vtk::read(bytes),
        Format::Vtu => vtu::read(bytes),
    }
}

impl ImportedMesh {
    /// The triangles of one group.
    ///
    /// # Errors
    /// No group has this name (upper and lower case matter), or its triangles have no area.
    pub fn select(&self, group: &str) -> Result<ImportedMesh, ImportError> {
        let Some(wanted) = self.groups.iter().position(|name| name == group) else {
            return Err(ImportError::NoSuchGroup {
                wanted: group.into(),
                known: self.groups.clone(),
                nearest: nearest(group, &self.groups),
            });
        };
        let belongs = |(triangle, of): (&[u32; 3], &Option<u32>)| (*of == Some(wanted as u32)).then_some(*triangle);
        let triangles: Vec<[u32; 3]> = self.triangles.iter().zip(&self.group).filter_map(belongs).collect();
        if triangles.iter().all(|&t| self.has_no_area(t)) {
            return Err(ImportError::NoArea { triangles: triangles.len() });
        }
        let group = vec![Some(0); triangles.len()];
        let selected = ImportedMesh {
            vertices: self.vertices.clone(),
            triangles,
            group,
            groups: vec![self.groups[wanted].clone()],
        };
        Ok(selected.compact())
    }

    /// The corners of a triangle.
    fn corners(&self, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|v| self.vertices[v as usize])
    }

    /// Two corners coincide, or all three are in line as far as their digits tell.
    ///
    /// The cross product of two edges of length L between points at distance R from the origin has a rounding error of
    /// about ε R L, so a smaller one says nothing about the area. A panel ten times thinner than wide is 10¹⁴ above
    /// this bound.
    fn has_no_area(&self, triangle: [u32; 3]) -> bool {
        let [a, b, c] = self.corners(triangle);
        let (ab, ac, bc) = (b - a, c - a, c - b);
        let longest = ab.norm().max(ac.norm()).max(bc.norm());
        let reach = a.amax().max(b.amax()).max(c.amax());
        ab.cross(&ac).norm() <= 4.0 * f64::EPSILON * reach * longest
    }

    /// The same triangles without the vertices and groups that none of them uses, in the order of the file.
    fn compact(mut self) -> Self {
        let mut new_index = vec![u32::MAX; self.vertices.len()];
        self.triangles.iter().flatten().for_each(|&v| new_index[v as usize] = 0);
        let mut kept = 0;
        for (old, new) in new_index.iter_mut().enumerate() {
            if *new == 0 {
                (*new, self.vertices[kept as usize]) = (kept, self.vertices[old]);
                kept += 1;
            }
        }
        self.vertices.truncate(kept as usize);
        self.triangles.iter_mut().flatten().for_each(|v| *v = new_index[*v as usize]);

        let mut used = vec![false; self.groups.len()];
        self.group.iter().flatten().for_each(|&g| used[g as usize] = true);
        let new_group: Vec<u32> = used
            .iter()
            .scan(0, |count, &used| {
                let index = *count;
                *count += u32::from(used);
                Some(index)
            })
            .collect();
        self.group.iter_mut().flatten().for_each(|g| *g = new_group[*g as usize]);
        let mut used = used.into_iter();
        self.groups.retain(|_| used.next() == Some(true));
        self
    }
}

/// The name spelled most like `wanted`, if one is at all.
fn nearest(wanted: &str, names: &[String]) -> Option<String> {
    // Jaro-Winkler: 0.75 takes "catode" for "cathode" and "Ring 1" for "ring_1", but not "ring" for "cap".
    const LIKE: f64 = 0.75;
    let likeness = |name: &String| strsim::jaro_winkler(&wanted.to_lowercase(), &name.to_lowercase());
    names
        .iter()
        .map(|name| (likeness(name), name))
        .filter(|(likeness, _)| *likeness >= LIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_groups() -> ImportedMesh {
        ImportedMesh {
            vertices: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from).into(),
            triangles: vec![[0, 1, 2], [0, 1, 3], [1, 2, 3]],
            group: vec![Some(1), None, Some(0)],
            groups: vec!["front ring".into(), "back ring".into()],
        }
    }

    #[test]
    fn a_selection_keeps_only_what_it_uses() {
        let back = two_groups().select("back ring").unwrap();
        assert_eq!((back.vertices.len(), &back.triangles[..]), (3, &[[0, 1, 2]][..]));
        assert_eq!((&back.group[..], &back.groups[..]), (&[Some(0)][..], &["back ring".to_string()][..]));
    }

    #[test]
    fn an_unknown_group_is_answered_with_the_nearest() {
        let error = two_groups().select("font ring").unwrap_err().to_string();
        assert!(error.contains("did you mean \"front ring\"? it has \"front ring\" and \"back ring\""), "{error}");
        let error = two_groups().select("x").unwrap_err().to_string();
        assert!(!error.contains("did you mean"), "{error}");
        let bare = ImportedMesh { groups: vec![], group: vec![None; 3], ..two_groups() };
        let error = bare.select("x").unwrap_err().to_string();
        assert!(error.contains("it has none, leave the group out"), "{error}");
    }

    #[test]
    fn extensions() {
        assert_eq!(Format::from_extension("STL"), Some(Format::Stl));
        assert_eq!(Format::from_extension("vtp"), Some(Format::Vtu));
        assert_eq!(Format::from_extension("step"), None);
    }

    #[test]
    fn a_file_of_another_kind_is_recognised() {
        let error = read(Format::Gmsh, b"solid x\nfacet").unwrap_err().to_string();
        assert!(error.contains("it looks like a STL file"), "{error}");
        let error = read(Format::Stl, "$MeshFormat\n2.2 0 8\n".repeat(9).as_bytes()).unwrap_err().to_string();
        assert!(error.contains("it looks like a Gmsh file"), "{error}");
        for format in Format::ALL {
            for bytes in [&b""[..], b"\n", b"hello world", b"\0\0\0\0"] {
                assert!(read(format, bytes).is_err(), "{format} {bytes:?}");
            }
        }
    }

    #[test]
    fn needles_have_an_area_and_lines_have_none() {
        let mut mesh = two_groups();
        mesh.vertices[2] = Vec3::new(0.5, 1e-9, 0.0);
        assert!(!mesh.has_no_area([0, 1, 2]));
        mesh.vertices[2] = Vec3::new(0.3, 0.0, 0.0);
        assert!(mesh.has_no_area([0, 1, 2]));
        assert!(mesh.has_no_area([0, 3, 3]));
    }
}
