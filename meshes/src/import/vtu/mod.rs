//! VTK's XML files of unstructured grids (`.vtu`) and polygonal data (`.vtp`).
//!
//! Source: "VTK XML file formats" of the VTK documentation, and what VTK 9 and meshio write. Every array may be text,
//! base64 in its place, or a stretch of one block at the end of the file, which is base64 or raw; and may be compressed
//! (see `data`).
//!
//! Why not `vtkio` 0.7.0-rc2, which writes our files: of those that VTK 9.7 and meshio 5.3 write it read text, base64 in
//! place and appended, and both with zlib; but no appended raw data ("unknown variant `raw`"), which ParaView writes.
//! Files with one flipped bit made it slice out of range, or ask for 10¹⁶ bytes because a header said so, which no caller
//! can catch. XML, base64 and inflation are left to `roxmltree`, `base64` and `flate2`, which return errors. LZ4 and LZMA
//! are refused with the advice to use zlib.

mod data;
mod data_set;

use roxmltree::{Document, Node};

use self::data::Storage;
pub use self::data_set::DataSet;
use super::build::Builder;
use super::cells::{add_cell, group_rank, groups_of};
use super::{Format, ImportError, ImportedMesh, Position};
use crate::Vec3;

type Result<T> = std::result::Result<T, ImportError>;

pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh> {
    parsed(bytes, |grid, storage, polygonal| {
        let mut mesh = Builder::new(0);
        for piece in grid.children().filter(|node| node.has_tag_name("Piece")) {
            read_piece(&mut mesh, piece, storage, polygonal)?;
        }
        mesh.finish()
    })
}

/// Hands over the element that contains the pieces of a file, where its arrays are, and whether it is polygonal.
fn parsed<T>(bytes: &[u8], read: impl FnOnce(Node<'_, '_>, &Storage<'_>, bool) -> Result<T>) -> Result<T> {
    if Format::from_content(bytes) != Some(Format::Vtu) {
        return Err(Format::Vtu.mismatch(bytes, "\"<VTKFile\""));
    }
    // Raw data are no XML: the block is cut off, and the elements that contain it closed by hand.
    const BLOCK: &[u8] = b"<AppendedData";
    let cut = bytes.windows(BLOCK.len()).position(|window| window == BLOCK);
    let (markup, block) = bytes.split_at(cut.unwrap_or(bytes.len()));
    let markup = std::str::from_utf8(markup).map_err(|error| ImportError::Invalid {
        at: Position::Byte(error.valid_up_to()),
        problem: "not UTF-8 text: the file is damaged, export it again".into(),
    })?;
    let closed = if block.is_empty() { markup.into() } else { format!("{markup}</VTKFile>") };
    let document = Document::parse(&closed).map_err(|error| ImportError::Invalid {
        at: Position::Line(error.pos().row as usize),
        problem: format!("the XML is broken ({error}): the file was cut short or damaged, export it again"),
    })?;

    let root = document.root_element();
    let storage = Storage::new(root, block, markup.len())?;
    let kind = root.attribute("type").unwrap_or_default();
    let Some(grid) = root.children().find(|node| node.has_tag_name(kind) && !kind.is_empty()) else {
        return Err(invalid(root, format!("the file has no element <{kind}>: export it again")));
    };
    if !matches!(kind, "UnstructuredGrid" | "PolyData") {
        return Err(ImportError::Unsupported {
            what: format!("the data set is of type {kind}, not a surface in one file"),
            change: "save the surface as .vtu (UnstructuredGrid), all in one file",
        });
    }
    read(grid, &storage, kind == "PolyData")
}

fn line(node: Node<'_, '_>) -> Position {
    Position::Line(node.document().text_pos_at(node.range().start).row as usize)
}

fn invalid(node: Node<'_, '_>, problem: String) -> ImportError {
    ImportError::Invalid { at: line(node), problem }
}

/// A number in an attribute; 0 if it is left out.
fn count(node: Node<'_, '_>, attribute: &str) -> Result<usize> {
    let Some(text) = node.attribute(attribute) else { return Ok(0) };
    text.trim().parse().map_err(|_| ImportError::Unexpected {
        at: line(node),
        expected: format!("a number as {attribute}"),
        found: super::scan::shown(text.as_bytes()),
    })
}

fn child<'a, 'd>(node: Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The array of this name (or the only one, with an empty name) in an element of a piece.
fn array<'a, 'd>(parent: Node<'a, 'd>, name: &str) -> Result<Node<'a, 'd>> {
    parent
        .children()
        .find(|node| node.has_tag_name("DataArray") && (name.is_empty() || node.attribute("Name") == Some(name)))
        .ok_or_else(|| {
            let tag = parent.tag_name().name();
            invalid(parent, format!("<{tag}> lacks its array {name}: the file is damaged, export it again"))
        })
}

fn read_piece(mesh: &mut Builder, piece: Node<'_, '_>, storage: &Storage<'_>, polygonal: bool) -> Result<()> {
    let points = count(piece, "NumberOfPoints")?;
    if points == 0 {
        return Ok(());
    }
    let first = mesh.vertices() as i64;
    let element =
        child(piece, "Points").ok_or_else(|| invalid(piece, "the piece has no <Points>: export it again".into()))?;
    let coordinates = storage.reals(array(element, "")?, points.saturating_mul(3))?;
    mesh.reserve(points, 0);
    coordinates.chunks_exact(3).for_each(|p| mesh.vertex(Vec3::new(p[0], p[1], p[2])));

    // Vertices, lines, polygons, strips: the order in which polygonal data number their cells.
    const POLYGONAL: [(&str, &str, i64); 4] = [
        ("Verts", "NumberOfVerts", 2),
        ("Lines", "NumberOfLines", 4),
        ("Polys", "NumberOfPolys", 7),
        ("Strips", "NumberOfStrips", 6),
    ];
    let mut lists: Vec<(Node<'_, '_>, Vec<i64>, CellList)> = Vec::new();
    if polygonal {
        for (name, attribute, kind) in POLYGONAL {
            let cells = count(piece, attribute)?;
            if let Some(element) = child(piece, name).filter(|_| cells > 0) {
                let list = CellList::read(element, storage, cells)?;
                lists.push((element, vec![kind; list.ends.len()], list));
            }
        }
    } else {
        let cells = count(piece, "NumberOfCells")?;
        if let Some(element) = child(piece, "Cells").filter(|_| cells > 0) {
            let list = CellList::read(element, storage, cells)?;
            let kinds = storage.integers(array(element, "types")?, cells)?;
            lists.push((element, kinds, list));
        }
    }

    let total = lists.iter().map(|(_, kinds, _)| kinds.len()).sum();
    let mut groups = groups(mesh, piece, storage, total)?.into_iter();
    for (element, kinds, list) in lists {
        let mut begin = 0;
        let mut corners = Vec::new();
        for (kind, end) in kinds.into_iter().zip(list.ends) {
            corners.clear();
            // Each piece counts its points from 0. The offsets were checked by `CellList::read`.
            for &corner in &list.corners[begin..end] {
                // A number outside of this piece must not reach into another.
                if !usize::try_from(corner).is_ok_and(|corner| corner < points) {
                    let (at, vertex, first) = (line(element), corner, Some(0));
                    return Err(ImportError::NoSuchVertex { at, vertex, vertices: points, first });
                }
                corners.push(first + corner);
            }
            add_cell(mesh, kind, &corners, groups.next().flatten(), || line(element))?;
            begin = end;
        }
    }
    Ok(())
}

/// Corner lists one after another, and where each ends.
struct CellList {
    corners: Vec<i64>,
    ends: Vec<usize>,
}

impl CellList {
    fn read(element: Node<'_, '_>, storage: &Storage<'_>, cells: usize) -> Result<Self> {
        let offsets = storage.integers(array(element, "offsets")?, cells)?;
        let mut ends = Vec::with_capacity(offsets.len());
        let mut last = 0;
        for (cell, offset) in offsets.into_iter().enumerate() {
            match usize::try_from(offset) {
                Ok(end) if end >= last => last = end,
                _ => {
                    let problem = format!("the offset of cell {cell} is {offset}, after {last}: export the file again");
                    return Err(invalid(element, problem));
                }
            }
            ends.push(last);
        }
        let corners = storage.integers(array(element, "connectivity")?, last)?;
        Ok(Self { corners, ends })
    }
}

/// The group of each cell of a piece.
fn groups(mesh: &mut Builder, piece: Node<'_, '_>, storage: &Storage<'_>, cells: usize) -> Result<Vec<Option<u32>>> {
    let arrays = child(piece, "CellData").into_iter().flat_map(|data| data.children());
    let mut dividing: Vec<(usize, Node<'_, '_>)> = arrays
        .filter(|node| node.has_tag_name("DataArray"))
        .filter(|node| node.attribute("NumberOfComponents").is_none_or(|n| matches!(n.trim(), "1" | "0" | "")))
        .filter_map(|node| Some((group_rank(node.attribute("Name")?)?, node)))
        .collect();
    dividing.sort_by_key(|(rank, _)| *rank);
    for (_, node) in dividing {
        let values = storage.reals(node, cells)?;
        if let Some(values) = values.into_iter().map(super::scan::whole).collect::<Option<Vec<i64>>>() {
            return Ok(groups_of(mesh, &values));
        }
    }
    Ok(vec![None; cells])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(cells: &str, data: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"2\">\n<Points>\n\
             <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 1 1 0 0 1 \
             0</DataArray>\n</Points>\n\
             <Cells>\n{cells}\n</Cells>\n<CellData>{data}</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )
    }

    const CELLS: &str = "<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 0 1 2 3</DataArray>\n\
        <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3 7</DataArray>\n\
        <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">5 9</DataArray>";

    #[test]
    fn the_most_telling_array_of_whole_numbers_divides() {
        let data = "<DataArray type=\"Float32\" Name=\"electrode\" format=\"ascii\">0.5 1</DataArray>\
            <DataArray type=\"Int32\" Name=\"part\" format=\"ascii\">1 1</DataArray>\
            <DataArray type=\"Int64\" Name=\"group\" format=\"ascii\">\n-3 8\n</DataArray>\
            <DataArray type=\"Float64\" Name=\"charge\" format=\"ascii\">nan nan</DataArray>";
        let mesh = read(file(CELLS, data).as_bytes()).unwrap();
        assert_eq!(
            (&mesh.groups[..], &mesh.group[..]),
            (&["-3".to_string(), "8".to_string()][..], &[Some(0), Some(1), Some(1)][..])
        );
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn pieces_count_their_points_from_zero() {
        let whole = file(CELLS, "");
        let (before, rest) = whole.split_once("<Piece").unwrap();
        let (piece, after) = rest.split_once("</Piece>").unwrap();
        let two = format!("{before}<Piece{piece}</Piece>\n<Piece{piece}</Piece>{after}");
        let mesh = read(two.as_bytes()).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len(), mesh.triangles[5]), (8, 6, [4, 6, 7]));
        // A point of the other piece is no point of this one.
        for (corner, piece) in [(4, 0), (-1, 1)] {
            let mut pieces: Vec<String> = two.split("0 1 2 3<").map(String::from).collect();
            pieces[piece] += &format!("0 1 2 {corner}<");
            pieces[1 - piece] += "0 1 2 3<";
            let error = read(pieces.concat().as_bytes()).unwrap_err().to_string();
            assert!(error.contains(&format!("vertex {corner} does not exist, the file has 4 vertices")), "{error}");
        }
    }

    #[test]
    fn polygonal_data() {
        let cells = "<Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray>\
            <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">3</DataArray></Polys>\
            <Strips><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 3 2</DataArray>\
            <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">4</DataArray></Strips>";
        let data = "<DataArray type=\"Int32\" Name=\"part\" format=\"ascii\">1 2</DataArray>";
        let text = file("", data)
            .replace("UnstructuredGrid", "PolyData")
            .replace("<Cells>\n\n</Cells>", cells)
            .replace("NumberOfCells=\"2\"", "NumberOfPolys=\"1\" NumberOfStrips=\"1\"");
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!((&mesh.groups.concat()[..], mesh.triangles.len()), ("12", 3));
        assert_eq!(mesh.group, [Some(0), Some(1), Some(1)]);
    }

    #[test]
    fn errors_name_the_line() {
        let say = |text: String| read(text.as_bytes()).unwrap_err().to_string();
        let with = |from: &str, to: &str| say(file(CELLS, "").replace(from, to));
        assert!(
            with("0 1 2 3<", "0 1 2 9<")
                .starts_with("line 8: vertex 9 does not exist, the file has 4 vertices (0 to 3)")
        );
        assert!(with("3 7", "3 2").starts_with("line 8: the offset of cell 1 is 2, after 3"));
        assert!(with("3 7", "3 9").starts_with("line 9: the array connectivity has 7 values instead of 9"));
        assert!(with("5 9<", "5 99<").contains("cells of type 99 are not read"));
        assert!(with("1 1 0 0", "1 x 0 0").starts_with("line 6: expected a number, found \"x\""));
        assert!(with("1 1 0 0", "1 inf 0 0").contains("vertex 2 is not finite"));
        assert!(with("\"offsets\"", "\"offset\"").contains("<Cells> lacks its array offsets"));
        assert!(with("</Cells>", "").contains("the XML is broken"));
        assert!(with("Int32", "Int33").contains("expected a type such as"));
        assert!(with("NumberOfPoints=\"4\"", "NumberOfPoints=\"-4\"").contains("a number as NumberOfPoints"));
        assert!(with("UnstructuredGrid", "ImageData").contains("not a surface"));
        assert!(say("<VTKFile type=\"UnstructuredGrid\"/>".into()).contains("no element <UnstructuredGrid>"));
    }

    #[test]
    fn deep_nesting_ends_in_an_error() {
        let text = format!("<VTKFile type=\"PolyData\">{}", "<a>".repeat(200_000));
        assert!(read(text.as_bytes()).is_err());
    }
}
