//! Gmsh's `.msh` files, versions 2.x and 4.1.
//!
//! Source: the Gmsh reference manual, chapter "Gmsh file formats". A file is a row of sections `$Name` ... `$EndName`;
//! in a binary file the headers are still text. In 2.x each element carries its physical group, in 4.1 the geometrical
//! entity does.

mod elements;
mod v2;
mod v4;

use std::collections::HashMap;

use self::elements::{Kind, element};
use super::build::{Builder, Numbering};
use super::scan::{Scalar, Scan};
use super::{Format, ImportError, ImportedMesh};
use crate::Vec3;

type Result<T> = std::result::Result<T, ImportError>;

/// A file while it is read.
struct Reader<'a> {
    scan: Scan<'a>,
    mesh: Builder,
    nodes: Nodes,
    /// Names of the physical surfaces.
    names: HashMap<i64, String>,
    /// Physical groups of each geometrical surface; negative where the group takes it turned over. Version 4.1 only.
    physical: HashMap<i64, Vec<i64>>,
    /// Type in which counts and tags are stored (`size_t` of the machine that wrote the file). Version 4.1 only.
    size: Scalar,
}

pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh> {
    let mut scan = Scan::new(bytes);
    if scan.token() != Some(b"$MeshFormat") {
        return Err(Format::Gmsh.mismatch(bytes, "\"$MeshFormat\""));
    }
    let version = scan.word("the version of the format")?.to_string();
    let file_type: i64 = scan.number("the kind of file, 0 (ASCII) or 1 (binary)")?;
    let size: i64 = scan.number("the size of a number")?;
    let two = version == "2" || version.starts_with("2.");
    if !two && version != "4.1" {
        return Err(ImportError::Unsupported {
            what: format!("Gmsh format {version}"),
            change: "save as version 4.1 or 2.2 (in Gmsh: File > Export, or the option Mesh.MshFileVersion)",
        });
    }
    match file_type {
        0 => {}
        1 => {
            scan.line();
            scan.binary = true;
            let one = scan.take(4, "the number 1 in four bytes")?;
            scan.big_endian = one == [0, 0, 0, 1];
            if !scan.big_endian && one != [1, 0, 0, 0] {
                return Err(scan.unexpected(one, "the number 1 in four bytes (was the file transferred as text?)"));
            }
        }
        _ => return Err(scan.unexpected(file_type.to_string().as_bytes(), "the kind of file, 0 (ASCII) or 1 (binary)")),
    }
    let size = match size {
        8 => Scalar::U64,
        4 if !two => Scalar::U32,
        _ => return Err(scan.unexpected(size.to_string().as_bytes(), "the size of a number, 8")),
    };
    end(&mut scan, "$EndMeshFormat")?;

    let (names, physical) = (HashMap::new(), HashMap::new());
    let mut file = Reader { scan, mesh: Builder::new(0), nodes: Nodes::default(), names, physical, size };
    while let Some(token) = file.scan.token() {
        match token {
            b"$PhysicalNames" => file.physical_names()?,
            b"$Entities" if !two => file.entities(false)?,
            b"$PartitionedEntities" if !two => file.entities(true)?,
            b"$Nodes" if two => file.nodes_2()?,
            b"$Nodes" => file.nodes_4()?,
            b"$Elements" if two => file.elements_2()?,
            b"$Elements" => file.elements_4()?,
            _ => match token.strip_prefix(b"$") {
                Some(name) if !name.starts_with(b"End") => file.scan.skip_past(&[b"$End", name].concat())?,
                _ => return Err(file.scan.unexpected(token, "a section such as \"$Elements\"")),
            },
        }
    }
    file.mesh.finish()
}

/// The mark that ends a section.
fn end(scan: &mut Scan<'_>, mark: &str) -> Result<()> {
    let found = scan.token().ok_or_else(|| scan.truncated(mark))?;
    if found == mark.as_bytes() { Ok(()) } else { Err(scan.unexpected(found, mark)) }
}

impl Reader<'_> {
    /// `dimension tag "name"`, text even in binary files.
    fn physical_names(&mut self) -> Result<()> {
        let count: i64 = self.scan.number("the number of physical names")?;
        for _ in 0..self.scan.room(count, 5, "physical names")? {
            let dimension: i64 = self.scan.number("the dimension of a physical group")?;
            let tag: i64 = self.scan.number("the number of a physical group")?;
            let line = self.scan.line().unwrap_or_default();
            let name = String::from_utf8_lossy(line);
            let name = name.trim().strip_prefix('"').and_then(|name| name.strip_suffix('"'));
            let Some(name) = name else {
                return Err(self.scan.unexpected(line, "the name of a physical group in double quotes"));
            };
            if dimension == 2 {
                self.names.insert(tag, name.to_string());
            }
        }
        end(&mut self.scan, "$EndPhysicalNames")
    }

    /// The group of a physical tag; 0 is none.
    fn group(&mut self, tag: i64) -> Option<u32> {
        let tag = tag.saturating_abs();
        (tag != 0).then(|| match self.names.get(&tag) {
            Some(name) => self.mesh.group(name),
            None => self.mesh.group(&format!("surface {tag}")),
        })
    }

    /// Kind and number of nodes of the element type that was just read.
    fn known(&self, number: i64, start: usize) -> Result<(Kind, usize)> {
        element(number).ok_or_else(|| ImportError::Unsupported {
            what: format!("{}: elements of type {number} are not read", self.scan.place(start)),
            change: "mesh the surfaces with triangles",
        })
    }

    /// Adds an element of which `tags` are the nodes; `turned` reverses it.
    fn add(&mut self, kind: Kind, tags: &[i64], group: Option<u32>, turned: bool, start: usize) -> Result<()> {
        let corners = match kind {
            Kind::Triangle => 3,
            Kind::Quadrilateral => 4,
            Kind::Point => return count(&mut self.mesh.census.points),
            Kind::Line => return count(&mut self.mesh.census.lines),
            Kind::Tetrahedron => return count(&mut self.mesh.census.tetrahedra),
            Kind::OtherVolume => return count(&mut self.mesh.census.other_volumes),
        };
        let place = || self.scan.place(start);
        let Some(tags) = tags.get(..corners) else {
            let problem = format!("a surface element with {} nodes: mesh the surfaces with triangles", tags.len());
            return Err(ImportError::Invalid { at: place(), problem });
        };
        let mut indices = [0; 4];
        for (index, &tag) in indices.iter_mut().zip(tags) {
            *index = self.nodes.index(tag).ok_or_else(|| ImportError::NoSuchVertex {
                at: place(),
                vertex: tag,
                vertices: self.mesh.vertices(),
                first: None,
            })?;
        }
        if turned {
            indices[1..corners].reverse(); // as Gmsh does it
        }
        self.mesh.polygon(&indices[..corners], group, place)
    }

    /// Takes note of the tags of all nodes, in the order in which their positions were given.
    fn finish_nodes(&mut self, tags: Vec<i64>) -> Result<()> {
        self.nodes = Nodes::new(&tags).map_err(|tag| {
            self.scan.invalid(self.scan.pos, format!("node {tag} is defined twice: save the mesh again"))
        })?;
        self.mesh.numbering = Numbering::Tags(tags);
        Ok(())
    }

    /// A position, as three numbers.
    fn position(&mut self) -> Result<Vec3> {
        let mut coordinate = || self.scan.real(Scalar::F64, "a coordinate of a node");
        Ok(Vec3::new(coordinate()?, coordinate()?, coordinate()?))
    }
}

fn count(of: &mut usize) -> Result<()> {
    *of += 1;
    Ok(())
}

/// From node tags to vertex indices.
enum Nodes {
    /// Tags without gaps, in order, from this one.
    Consecutive { first: i64, count: usize },
    /// Tag and index, in the order of the tags.
    Sorted(Vec<(i64, u32)>),
}

impl Default for Nodes {
    fn default() -> Self {
        Nodes::Consecutive { first: 1, count: 0 }
    }
}

impl Nodes {
    /// The index of `tags`; a tag that occurs twice is the error.
    fn new(tags: &[i64]) -> std::result::Result<Self, i64> {
        let first = tags.first().copied().unwrap_or(1);
        if tags.iter().zip(first..).all(|(&tag, expected)| tag == expected) {
            return Ok(Nodes::Consecutive { first, count: tags.len() });
        }
        // More than 2³² nodes do not fit into a mesh anyway; the builder says so.
        let mut sorted: Vec<(i64, u32)> = tags.iter().zip(0..).map(|(&tag, index)| (tag, index)).collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(pair[0].0),
            None => Ok(Nodes::Sorted(sorted)),
        }
    }

    fn index(&self, tag: i64) -> Option<i64> {
        match self {
            Nodes::Consecutive { first, count } => {
                let index = tag.checked_sub(*first)?;
                usize::try_from(index).ok().filter(|index| index < count).map(|_| index)
            }
            Nodes::Sorted(sorted) => {
                let place = sorted.binary_search_by_key(&tag, |&(tag, _)| tag).ok()?;
                Some(i64::from(sorted[place].1))
            }
        }
    }
}

#[cfg(test)]
mod tests;
