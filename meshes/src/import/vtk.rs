//! Legacy VTK files of polygonal data and unstructured grids.
//!
//! Source: "VTK file formats" of the VTK user's guide, and what VTK 9, Gmsh and meshio write. Keywords are text; the
//! numbers after them are text or big-endian binary. Up to version 4.2 cells are rows `n v0 ... v(n-1)`; from 5.0 on
//! two arrays, offsets and connectivity.
//!
//! Why not `vtkio` 0.7.0-rc2: it knows no arrays of type `vtktypeint64` other than offsets and connectivity, so that it
//! refuses what meshio writes, no `nan` in a text, no field before the points, and its errors tell no place.

use super::build::Builder;
use super::cells::{add_cell, group_rank, groups_of};
use super::scan::{Scalar, Scan, shown, whole};
use super::{Format, ImportError, ImportedMesh};
use crate::Vec3;

type Result<T> = std::result::Result<T, ImportError>;

/// Cells of one keyword: corner lists one after another.
struct Cells {
    /// Cell type for `cells::add_cell`; `None` for an unstructured grid, which has a list of types.
    kind: Option<i64>,
    corners: Vec<i64>,
    /// Where in `corners` each cell ends.
    ends: Vec<usize>,
    start: usize,
}

/// A file while it is read.
struct Reader<'a> {
    scan: Scan<'a>,
    mesh: Builder,
    cells: Vec<Cells>,
    types: Vec<i64>,
    /// The array that divides the surface: how telling its name is, and a value for each cell.
    groups: Option<(usize, Vec<i64>)>,
}

pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh> {
    let mut scan = Scan::new(bytes);
    let first = scan.line().unwrap_or_default();
    if !first.to_ascii_lowercase().starts_with(b"# vtk datafile") {
        return Err(Format::Vtk.mismatch(bytes, "\"# vtk DataFile Version\""));
    }
    scan.line(); // the title
    let kind = scan.line().unwrap_or_default();
    let binary = match kind.trim_ascii().to_ascii_uppercase().as_slice() {
        b"ASCII" => false,
        b"BINARY" => true,
        _ => {
            let at = scan.place(bytes.len() - scan.remaining().max(1));
            return Err(ImportError::Unexpected { at, expected: "ASCII or BINARY".into(), found: shown(kind) });
        }
    };
    (scan.binary, scan.big_endian) = (binary, true);
    let mut file = Reader { scan, mesh: Builder::new(0), cells: Vec::new(), types: Vec::new(), groups: None };
    file.sections()?;
    file.assemble()
}

impl<'a> Reader<'a> {
    fn sections(&mut self) -> Result<()> {
        // Number of values of an attribute, and whether they are of cells.
        let mut attributes = (0, false);
        while let Some(keyword) = self.scan.token() {
            match keyword.to_ascii_uppercase().as_slice() {
                b"DATASET" => self.dataset()?,
                b"POINTS" => self.points()?,
                b"CELLS" => self.cells(None)?,
                b"VERTICES" => self.cells(Some(2))?,
                b"LINES" => self.cells(Some(4))?,
                b"POLYGONS" => self.cells(Some(7))?,
                b"TRIANGLE_STRIPS" => self.cells(Some(6))?,
                b"CELL_TYPES" => {
                    let count = self.header_count("cell types")?;
                    self.types = self.integers(Scalar::I32, count, "cell types")?;
                }
                b"CELL_DATA" => attributes = (self.header_count("cell data")?, true),
                b"POINT_DATA" => attributes = (self.header_count("point data")?, false),
                b"METADATA" => self.metadata(),
                b"FIELD" => self.field(attributes.1)?,
                keyword => self.attribute(keyword, attributes)?,
            }
        }
        Ok(())
    }

    /// Remarks to the array before, up to a blank line.
    fn metadata(&mut self) {
        self.scan.line();
        while self.scan.line().is_some_and(|line| !line.trim_ascii().is_empty()) {}
    }

    fn dataset(&mut self) -> Result<()> {
        let kind = self.scan.word("the kind of data set")?;
        match kind.to_ascii_uppercase().as_str() {
            "POLYDATA" | "UNSTRUCTURED_GRID" | "FIELD" => Ok(()),
            _ => Err(ImportError::Unsupported {
                what: format!("the data set is a {kind}, not a surface"),
                change: "save the surface as polygonal data or an unstructured grid",
            }),
        }
    }

    /// A number of the line of a keyword.
    fn header_count(&mut self, what: &'static str) -> Result<usize> {
        let count = self.scan.number(what)?;
        let count = self.scan.room(count, 0, what)?;
        self.scan.line();
        Ok(count)
    }

    /// Fewest bytes that a number takes.
    fn bytes_each(&self, kind: Scalar) -> usize {
        if self.scan.binary { kind.size() } else { 1 }
    }

    /// So many integers.
    fn integers(&mut self, kind: Scalar, count: usize, what: &'static str) -> Result<Vec<i64>> {
        self.scan.room(count as i64, self.bytes_each(kind), what)?;
        (0..count).map(|_| self.scan.integer(kind, "a whole number")).collect()
    }

    fn points(&mut self) -> Result<()> {
        let count: i64 = self.scan.number("the number of points")?;
        let kind = self.type_word()?;
        self.scan.line();
        let Type::Number(kind) = kind else {
            return Err(self.scan.invalid(self.scan.pos, "points that are no numbers: save the file again"));
        };
        let count = self.scan.room(count, 3 * self.bytes_each(kind), "points")?;
        self.mesh.reserve(count, 0);
        for _ in 0..count {
            let mut coordinate = || self.scan.real(kind, "a coordinate of a point");
            let position = Vec3::new(coordinate()?, coordinate()?, coordinate()?);
            self.mesh.vertex(position);
        }
        Ok(())
    }

    fn cells(&mut self, kind: Option<i64>) -> Result<()> {
        let start = self.scan.pos;
        let count: i64 = self.scan.number("the number of cells")?;
        let size: i64 = self.scan.number("the number of numbers that describe the cells")?;
        self.scan.line();
        let count = self.scan.room(count, 1, "cells")?;
        let size = self.scan.room(size, 1, "numbers that describe cells")?;
        if self.scan.peek().is_some_and(|word| word.eq_ignore_ascii_case(b"OFFSETS")) {
            return self.offset_cells(kind, count, size, start);
        }
        let numbers = self.integers(Scalar::I32, size, "vertex numbers")?;
        let (mut corners, mut ends) = (Vec::with_capacity(size), Vec::with_capacity(count));
        let mut rest = &numbers[..];
        for cell in 0..count {
            let row = rest.split_first().and_then(|(&n, rest)| rest.split_at_checked(usize::try_from(n).ok()?));
            let Some((row, after)) = row else {
                let problem = match rest.first() {
                    Some(n) => format!(
                        "cell {cell} has {n} corners, but {} numbers are left (were binary numbers written \
                        little-endian? \
                         legacy VTK files are big-endian)",
                        rest.len() - 1
                    ),
                    None => format!("{count} cells are announced, but only {cell} are there: save the file again"),
                };
                return Err(self.scan.invalid(start, problem));
            };
            corners.extend_from_slice(row);
            ends.push(corners.len());
            rest = after;
        }
        self.cells.push(Cells { kind, corners, ends, start });
        Ok(())
    }

    /// The layout of version 5: as many offsets as there are cells, and one more.
    fn offset_cells(&mut self, kind: Option<i64>, count: usize, size: usize, start: usize) -> Result<()> {
        let mut array = |name: &str, count: usize, what: &'static str| {
            let word = self.scan.word(name)?;
            if !word.eq_ignore_ascii_case(name) {
                return Err(self.scan.unexpected(word.as_bytes(), name));
            }
            let kind = self.type_word()?;
            self.scan.line();
            match kind {
                Type::Number(kind) => self.integers(kind, count, what),
                _ => Err(self.scan.invalid(self.scan.pos, format!("{name} that are no numbers: save the file again"))),
            }
        };
        let offsets = array("OFFSETS", count, "offsets of cells")?;
        let corners = array("CONNECTIVITY", size, "vertex numbers")?;
        let mut ends = Vec::with_capacity(count);
        for pair in offsets.windows(2) {
            match usize::try_from(pair[1]) {
                Ok(end) if pair[0] <= pair[1] && end <= corners.len() && pair[0] >= 0 => ends.push(end),
                _ => {
                    let problem = format!(
                        "the offsets of cell {} are {} and {}, of {} vertex numbers: save the file again",
                        ends.len(),
                        pair[0],
                        pair[1],
                        corners.len()
                    );
                    return Err(self.scan.invalid(start, problem));
                }
            }
        }
        if offsets.first().is_some_and(|&first| first != 0) {
            return Err(self
                .scan
                .invalid(start, format!("the first offset is {}, not 0: save the file again", offsets[0])));
        }
        self.cells.push(Cells { kind, corners, ends, start });
        Ok(())
    }

    /// Arrays `name components tuples type`, each with its values.
    fn field(&mut self, of_cells: bool) -> Result<()> {
        self.scan.word("the name of a field")?;
        let count = self.scan.number("the number of arrays of a field")?;
        for _ in 0..self.scan.room(count, 8, "arrays of a field")? {
            let mut name = self.scan.word("the name of an array")?;
            if name.eq_ignore_ascii_case("METADATA") {
                self.metadata();
                name = self.scan.word("the name of an array")?;
            }
            let components: usize = self.scan.number("the number of components of an array")?;
            let tuples: usize = self.scan.number("the number of tuples of an array")?;
            let kind = self.type_word()?;
            self.scan.line();
            let count = components.saturating_mul(tuples);
            self.array(name, kind, count, of_cells && components == 1)?;
        }
        Ok(())
    }

    /// An attribute of points or cells; `count` values of it.
    fn attribute(&mut self, keyword: &[u8], (count, of_cells): (usize, bool)) -> Result<()> {
        let components = match keyword {
            b"SCALARS" | b"COLOR_SCALARS" | b"LOOKUP_TABLE" | b"TEXTURE_COORDINATES" => 1,
            b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => 1,
            b"VECTORS" | b"NORMALS" => 3,
            b"TENSORS" => 9,
            b"TENSORS6" => 6,
            _ => return Err(self.scan.unexpected(keyword, "a keyword such as POLYGONS, CELLS or CELL_DATA")),
        };
        let name = self.scan.word("the name of an array")?;
        let (kind, components) = match keyword {
            b"SCALARS" => {
                let kind = self.type_word()?;
                let line = self.scan.line().unwrap_or_default();
                let components = Scan::new(line).number("").unwrap_or(1);
                if self.scan.peek().is_some_and(|word| word.eq_ignore_ascii_case(b"LOOKUP_TABLE")) {
                    self.scan.skip_space();
                    self.scan.line();
                }
                (kind, components)
            }
            b"TEXTURE_COORDINATES" => {
                let components = self.scan.number("the number of components of an array")?;
                (self.type_word()?, components)
            }
            // Colours: bytes, or numbers from 0 to 1 in a text.
            b"COLOR_SCALARS" => (Type::Number(Scalar::U8), self.scan.number("the number of colours")?),
            b"LOOKUP_TABLE" => {
                let entries: usize = self.scan.number("the size of a table")?;
                self.scan.line();
                return self.skip(Type::Number(Scalar::U8), entries.saturating_mul(4));
            }
            _ => (self.type_word()?, components),
        };
        if keyword != b"SCALARS" {
            self.scan.line();
        }
        self.array(name, kind, count.saturating_mul(components), of_cells && components == 1)
    }

    /// The values of an array: kept if its name divides a surface into groups, better than the one that was kept
    /// before.
    fn array(&mut self, name: &str, kind: Type, count: usize, may_divide: bool) -> Result<()> {
        let rank = group_rank(&percent_decoded(name)).filter(|_| may_divide);
        match (rank, kind) {
            (Some(rank), Type::Number(kind)) if self.groups.as_ref().is_none_or(|(best, _)| rank < *best) => {
                self.scan.room(count as i64, self.bytes_each(kind), "values of an array")?;
                let values = (0..count)
                    .map(|_| Ok(whole(self.scan.real(kind, "a value of an array")?)))
                    .collect::<Result<Option<Vec<i64>>>>();
                if let Some(values) = values? {
                    self.groups = Some((rank, values));
                }
                Ok(())
            }
            _ => self.skip(kind, count),
        }
    }

    fn skip(&mut self, kind: Type, count: usize) -> Result<()> {
        match kind {
            Type::Number(kind) if self.scan.binary => {
                self.scan.take(count.saturating_mul(kind.size()), "the values of an array")?;
            }
            Type::Bit if self.scan.binary => {
                self.scan.take(count.div_ceil(8), "the values of an array")?;
            }
            // In a text strings stand on a line each.
            Type::Text if !self.scan.binary => {
                for _ in 0..count {
                    self.scan.line().ok_or_else(|| self.scan.truncated("the values of an array"))?;
                }
            }
            Type::Text => {
                for _ in 0..count {
                    let length = self.string_length()?;
                    self.scan.take(length, "a string")?;
                }
            }
            _ => {
                for _ in 0..count {
                    self.scan.token().ok_or_else(|| self.scan.truncated("the values of an array"))?;
                }
            }
        }
        Ok(())
    }

    /// Length of a binary string: the two highest bits say in how many bytes it is stored
    /// (vtkDataWriter::EncodeString).
    fn string_length(&mut self) -> Result<usize> {
        let first = self.scan.take(1, "the length of a string")?[0];
        let more = [7, 3, 1, 0][usize::from(first >> 6)];
        let rest = self.scan.take(more, "the length of a string")?;
        let length = rest.iter().fold(u64::from(first & 0x3f), |sum, &byte| (sum << 8) | u64::from(byte));
        Ok(usize::try_from(length).unwrap_or(usize::MAX))
    }

    /// A type of number.
    fn type_word(&mut self) -> Result<Type> {
        let word = self.scan.word("a type such as \"double\"")?;
        Ok(Type::Number(match word.to_ascii_lowercase().as_str() {
            "bit" => return Ok(Type::Bit),
            "string" | "utf8_string" => return Ok(Type::Text),
            "char" | "signed_char" | "vtktypeint8" => Scalar::I8,
            "unsigned_char" | "vtktypeuint8" => Scalar::U8,
            "short" | "vtktypeint16" => Scalar::I16,
            "unsigned_short" | "vtktypeuint16" => Scalar::U16,
            // VTK writes its ids as 32 bits, whatever they are in memory.
            "int" | "vtkidtype" | "vtktypeint32" => Scalar::I32,
            "unsigned_int" | "vtktypeuint32" => Scalar::U32,
            // 64 bits, except for files of Windows, which nobody can tell.
            "long" | "long_long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
            "float" | "vtktypefloat32" => Scalar::F32,
            "double" | "vtktypefloat64" => Scalar::F64,
            _ => return Err(self.scan.unexpected(word.as_bytes(), "a type such as \"double\"")),
        }))
    }

    /// Puts cells, types and groups together. Polygonal data number their cells by kind: vertices, lines, polygons,
    /// strips, in whatever order the sections stand.
    fn assemble(mut self) -> Result<ImportedMesh> {
        self.cells.sort_by_key(|cells| match cells.kind {
            Some(2) => 0,
            Some(4) => 1,
            Some(7) => 2,
            _ => 3,
        });
        let total: usize = self.cells.iter().map(|cells| cells.ends.len()).sum();
        let grid: usize = self.cells.iter().filter(|cells| cells.kind.is_none()).map(|cells| cells.ends.len()).sum();
        if grid != self.types.len() {
            let problem = format!("{grid} cells, but {} cell types: save the file again", self.types.len());
            return Err(self.scan.invalid(self.scan.pos, problem));
        }
        let groups = match &self.groups {
            Some((_, values)) if values.len() == total => groups_of(&mut self.mesh, values),
            Some((_, values)) => {
                let problem = format!("{total} cells, but group numbers for {}: save the file again", values.len());
                return Err(self.scan.invalid(self.scan.pos, problem));
            }
            None => vec![None; total],
        };
        let mut groups = groups.into_iter();
        let mut types = self.types.iter();
        for cells in &self.cells {
            let mut begin = 0;
            for &end in &cells.ends {
                let kind = cells.kind.or_else(|| types.next().copied()).unwrap_or(0);
                let group = groups.next().flatten();
                let corners = &cells.corners[begin..end];
                add_cell(&mut self.mesh, kind, corners, group, || self.scan.place(cells.start))?;
                begin = end;
            }
        }
        self.mesh.finish()
    }
}

/// What an array consists of.
#[derive(Clone, Copy)]
enum Type {
    Number(Scalar),
    Bit,
    Text,
}

/// Array names may have no blanks: VTK writes `%20`.
fn percent_decoded(name: &str) -> String {
    let mut out = Vec::new();
    let mut rest = name.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let code = after.get(..2).and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        match code {
            Some(code) if byte == b'%' => {
                out.push(code);
                rest = &after[2..];
            }
            _ => {
                out.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "# vtk DataFile Version 3.0\na square\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 1 0 0\n\
        1 1 0 0 1 0 2 2 2\n";

    fn of(text: &str) -> Result<ImportedMesh> {
        read(format!("{HEAD}{text}").as_bytes())
    }

    #[test]
    fn polygonal_data_number_their_cells_by_kind() {
        let text = "TRIANGLE_STRIPS 1 5\n4 0 1 3 2\nVERTICES 1 2\n1 0\nPOLYGONS 2 9\n3 0 1 2\n4 0 1 2 3\n\n\
            LINES 1 3\n2 0 1\n\
            POINT_DATA 5\nSCALARS part int 1\nLOOKUP_TABLE default\n1 2 3 4 5\nVECTORS v double\n\
            1 2 3 4 5 6 7 8 9 nan inf 0 0 0 0\n\
            CELL_DATA 5\nNORMALS n float\n1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\nFIELD FieldData 3\nnames 1 2 string\n\
            first name\nsecond\n\
            CellEntityIds 1 5 int\n9 9 9 9 9\npart 1 5 double\nMETADATA\nINFORMATION 0\n\n10 20 30 31 40\n";
        // Metadata stand after the values in files of VTK; tolerate them between arrays, too.
        let text = text
            .replace("part 1 5 double\nMETADATA\nINFORMATION 0\n\n", "METADATA\nINFORMATION 0\n\npart 1 5 double\n");
        let mesh = of(&text).unwrap();
        assert_eq!(mesh.groups, ["30", "31", "40"]);
        assert_eq!(mesh.group, [Some(0), Some(1), Some(1), Some(2), Some(2)]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 1, 3], [3, 1, 2]]);
    }

    #[test]
    fn unstructured_grids_of_both_layouts() {
        let head = HEAD.replace("POLYDATA", "UNSTRUCTURED_GRID");
        let old = "CELLS 3 12\n4 0 1 2 3\n3 0 1 2\n2 0 1\nCELL_TYPES 3\n9 5 3\n";
        let new = "CELLS 4 9\nOFFSETS vtktypeint64\n0 4 7 9\nCONNECTIVITY vtktypeint64\n0 1 2 3 0 1 2 0 1\n\
            CELL_TYPES 3\n9 5 3\n";
        let meshes = [old, new].map(|cells| read(format!("{head}{cells}").as_bytes()).unwrap());
        assert_eq!(meshes[0], meshes[1]);
        assert_eq!(meshes[0].triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let say = |text: &str| of(text).unwrap_err().to_string();
        assert!(say("POLYGONS 1 4\n3 0 1 7\n").starts_with("line 8: vertex 7 does not exist"));
        assert!(say("POLYGONS 2 4\n3 0 1 2\n").contains("2 cells are announced, but only 1 are there"));
        assert!(say("POLYGONS 1 4\n50331648 0 1 2\n").contains("little-endian"));
        assert!(say("POLYGONS 900000000 4\n3 0 1 2\n").contains("900000000 cells are announced"));
        assert!(say("POLYGONS 1 4\n3 0 1 x\n").starts_with("line 9: expected a whole number, found \"x\""));
        assert!(say("POLYGONS 1 4\n3 0 1").contains("the file ends at line 9"));
        assert!(say("LINES 1 3\n2 0 1\n").starts_with("no triangles: the file has 1 line element"));
        assert!(
            say("POLYGONS 1 4\n3 0 1 2\nCELL_DATA 2\nSCALARS part int\nLOOKUP_TABLE d\n1 2\n")
                .contains("group numbers for 2")
        );
        assert!(say("CELLS 1 4\n3 0 1 2\n").contains("1 cells, but 0 cell types"));
        assert!(say("POLYGONES 1 4\n3 0 1 2\n").starts_with("line 8: expected a keyword"));
        let image = HEAD.replace("POLYDATA", "STRUCTURED_POINTS");
        assert!(read(image.as_bytes()).unwrap_err().to_string().contains("not a surface"));
    }

    #[test]
    fn names_are_decoded() {
        assert_eq!(percent_decoded("gmsh%3Aphysical%2"), "gmsh:physical%2");
    }
}
