//! PLY, ASCII and binary of either byte order.
//!
//! Source: G. Turk, "The PLY polygon file format", 1994. Vertices have x, y, z; faces (and the strips of old files) a
//! list of vertex numbers, and perhaps an integer that says which group they belong to.

use super::build::Builder;
use super::cells::group_rank;
use super::scan::{Scalar, Scan, whole};
use super::{Format, ImportError, ImportedMesh};
use crate::Vec3;

type Result<T> = std::result::Result<T, ImportError>;

struct Property {
    name: String,
    kind: Scalar,
    /// Type of the count, where the property is a list.
    list: Option<Scalar>,
}

struct Element {
    name: String,
    count: i64,
    properties: Vec<Property>,
}

impl Element {
    /// Fewest bytes that a row takes.
    fn width(&self, binary: bool) -> usize {
        match binary {
            true => self.properties.iter().map(|p| p.list.unwrap_or(p.kind).size()).sum(),
            false => 2 * self.properties.len(),
        }
    }

    fn position(&self, names: &[&str], list: bool) -> Option<usize> {
        self.properties.iter().position(|p| p.list.is_some() == list && names.contains(&p.name.as_str()))
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh> {
    let mut scan = Scan::new(bytes);
    if scan.line().map(<[u8]>::trim_ascii_end) != Some(b"ply") {
        return Err(Format::Ply.mismatch(bytes, "\"ply\""));
    }
    let (encoding, elements) = header(&mut scan)?;
    (scan.binary, scan.big_endian) = encoding;
    let mut mesh = Builder::new(0);
    for element in &elements {
        let width = element.width(scan.binary);
        if width == 0 {
            continue; // rows without properties leave no trace in the file, however many are announced
        }
        let count = scan.room(element.count, width, "elements")?;
        match element.name.as_str() {
            "vertex" => vertices(&mut scan, &mut mesh, element, count)?,
            "face" | "tristrips" => faces(&mut scan, &mut mesh, element, count)?,
            name => {
                let (mut row, mut list) = (Vec::new(), Vec::new());
                for _ in 0..count {
                    read_row(&mut scan, element, None, &mut row, &mut list)?;
                }
                mesh.census.lines += if name == "edge" { count } else { 0 };
            }
        }
    }
    mesh.finish()
}

/// Whether numbers are binary and big-endian, and the elements in the order in which they follow.
fn header(scan: &mut Scan<'_>) -> Result<((bool, bool), Vec<Element>)> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        if scan.remaining() == 0 {
            return Err(scan.truncated("\"end_header\""));
        }
        let start = scan.pos;
        let mut line = Scan::new(scan.line().unwrap_or_default());
        let located = |error| relocate(scan, start, error);
        match line.token() {
            None | Some(b"comment" | b"obj_info") => {}
            Some(b"format") => {
                let format = line.word("a format").map_err(located)?;
                encoding = Some(match format {
                    "ascii" => (false, false),
                    "binary_little_endian" => (true, false),
                    "binary_big_endian" => (true, true),
                    other => return Err(located(line.unexpected(other.as_bytes(), "ascii or binary_little_endian"))),
                });
            }
            Some(b"element") => {
                let name = line.word("the name of an element").map_err(located)?.to_string();
                let count = line.number("the number of elements").map_err(located)?;
                elements.push(Element { name, count, properties: Vec::new() });
            }
            Some(b"property") => {
                let mut kind = || {
                    let word = line.word("a type of number").map_err(located)?;
                    scalar(word).ok_or_else(|| located(line.unexpected(word.as_bytes(), "a type such as \"float\"")))
                };
                let (list, kind) = match kind()? {
                    Some(kind) => (None, kind),
                    None => match (kind()?, kind()?) {
                        (Some(count), Some(kind)) if count.is_integer() => (Some(count), kind),
                        _ => return Err(scan.invalid(start, "a list of lists: export the file again")),
                    },
                };
                let name = line.word("the name of a property").map_err(located)?.to_string();
                match elements.last_mut() {
                    Some(element) => element.properties.push(Property { name, kind, list }),
                    None => {
                        return Err(scan.invalid(start, "a property before the first element: export the file again"));
                    }
                }
            }
            Some(b"end_header") => {
                return match encoding {
                    Some(encoding) => Ok((encoding, elements)),
                    None => Err(scan.invalid(start, "the header has no \"format\" line: export the file again")),
                };
            }
            Some(other) => return Err(located(line.unexpected(other, "a line of the header, such as \"end_header\""))),
        }
    }
}

/// A type by either of its names; the inner `None` is a list.
fn scalar(word: &str) -> Option<Option<Scalar>> {
    Some(Some(match word {
        "list" => return Some(None),
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        // Not in the standard; some programs write them.
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        _ => return None,
    }))
}

/// An error found in a piece of the file, told with its place in the whole; one row is not the whole file either.
fn relocate(scan: &Scan<'_>, start: usize, error: ImportError) -> ImportError {
    let at = scan.place(start);
    match error {
        ImportError::Unexpected { expected, found, .. } => ImportError::Unexpected { at, expected, found },
        ImportError::Truncated { expected, .. } => {
            ImportError::Unexpected { at, expected, found: "the end of the line".into() }
        }
        other => other,
    }
}

fn vertices(scan: &mut Scan<'_>, mesh: &mut Builder, element: &Element, count: usize) -> Result<()> {
    let axes = ["x", "y", "z"].map(|axis| element.position(&[axis], false));
    let [Some(x), Some(y), Some(z)] = axes else {
        return Err(scan.invalid(scan.pos, "the vertices lack one of the properties x, y, z: export the file again"));
    };
    mesh.reserve(count, 0);
    let (mut row, mut list) = (Vec::new(), Vec::new());
    for _ in 0..count {
        read_row(scan, element, None, &mut row, &mut list)?;
        mesh.vertex(Vec3::new(row[x], row[y], row[z]));
    }
    Ok(())
}

fn faces(scan: &mut Scan<'_>, mesh: &mut Builder, element: &Element, count: usize) -> Result<()> {
    let Some(corners) = element.position(&["vertex_indices", "vertex_index"], true) else {
        let problem = "the faces have no list called vertex_indices: export the file again";
        return Err(scan.invalid(scan.pos, problem));
    };
    let integers = element.properties.iter().enumerate().filter(|(_, p)| p.list.is_none() && p.kind.is_integer());
    let group_property =
        integers.filter_map(|(i, p)| Some((group_rank(&p.name)?, i))).min().map(|(_, property)| property);
    let strips = element.name == "tristrips";
    mesh.reserve(0, if strips { 0 } else { count });
    let (mut row, mut list) = (Vec::new(), Vec::new());
    for _ in 0..count {
        scan.skip_space_of_text();
        let start = scan.pos;
        read_row(scan, element, Some(corners), &mut row, &mut list)?;
        // Properties of at most 32 bits are exact in the f64 of the row; larger numbers do not number groups.
        let group = group_property.and_then(|i| whole(row[i])).map(|value| mesh.group(&value.to_string()));
        let at = || scan.place(start);
        if strips {
            // -1 ends a strip and begins another.
            list.split(|&corner| corner == -1).try_for_each(|strip| mesh.strip(strip, group, at))?;
        } else {
            mesh.polygon(&list, group, at)?;
        }
    }
    Ok(())
}

/// One row of an element: the value of each property (0 for a list), and the contents of the list with the index
/// `wanted`.
fn read_row(
    scan: &mut Scan<'_>,
    element: &Element,
    wanted: Option<usize>,
    row: &mut Vec<f64>,
    list: &mut Vec<i64>,
) -> Result<()> {
    row.clear();
    list.clear();
    if scan.binary {
        return read_properties(scan, element, wanted, row, list);
    }
    // A row of text is a line: a missing number is found where it is missing, not at the end of the file.
    scan.skip_space();
    if scan.remaining() == 0 {
        return Err(scan.truncated(&format!("another {}", element.name)));
    }
    let mut line = scan.row();
    let start = line.pos;
    read_properties(&mut line, element, wanted, row, list).map_err(|error| relocate(scan, start, error))?;
    match line.token() {
        Some(extra) => Err(line.unexpected(extra, "the end of the line")),
        None => Ok(()),
    }
}

fn read_properties(
    scan: &mut Scan<'_>,
    element: &Element,
    wanted: Option<usize>,
    row: &mut Vec<f64>,
    list: &mut Vec<i64>,
) -> Result<()> {
    for (i, property) in element.properties.iter().enumerate() {
        match property.list {
            None => row.push(scan.real(property.kind, "a number")?),
            Some(count) => {
                let count = scan.integer(count, "the length of a list")?;
                let count = scan.room(count, if scan.binary { property.kind.size() } else { 2 }, "list entries")?;
                for _ in 0..count {
                    if wanted == Some(i) {
                        list.push(scan.integer(property.kind, "a vertex number")?);
                    } else {
                        scan.real(property.kind, "a number")?;
                    }
                }
                row.push(0.0);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\n\
        property double y\n\
        property float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\n\
        property short region\n\
        end_header\n";
    const BODY: &str = "0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3 -5\n\n3 0 1 2 7\n";

    /// The same file in binary.
    fn binary(big_endian: bool) -> Vec<u8> {
        let order = |bytes: &[u8]| -> Vec<u8> {
            if big_endian { bytes.iter().rev().copied().collect() } else { bytes.to_vec() }
        };
        let name = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
        let mut out = HEADER.replace("ascii", name).into_bytes();
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            out.extend(order(&(x as f32).to_le_bytes()));
            out.extend(order(&f64::to_le_bytes(y)));
            out.extend([0, 0, 0, 0, 9]);
        }
        for (corners, region) in [(&[0, 1, 2, 3][..], -5_i16), (&[0, 1, 2], 7)] {
            out.push(corners.len() as u8);
            corners.iter().for_each(|c: &i32| out.extend(order(&c.to_le_bytes())));
            out.extend(order(&region.to_le_bytes()));
        }
        out
    }

    #[test]
    fn three_encodings_read_the_same() {
        let text = read(format!("{HEADER}{BODY}").as_bytes()).unwrap();
        assert_eq!(text.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(
            (&text.groups[..], &text.group[..]),
            (&["-5".to_string(), "7".to_string()][..], &[Some(0), Some(0), Some(1)][..])
        );
        assert_eq!(read(&binary(false)).unwrap(), text);
        assert_eq!(read(&binary(true)).unwrap(), text);
        assert_eq!(read(format!("{HEADER}{BODY}").replace('\n', "\r\n").as_bytes()).unwrap(), text);
    }

    #[test]
    fn strips_restart() {
        let header = HEADER.replace("element face 2", "element tristrips 1").replace("property short region\n", "");
        let body = "0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n8 0 1 3 2 -1 0 1 2\n";
        let mesh = read(format!("{header}{body}").as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 3], [3, 1, 2], [0, 1, 2]]);
    }

    #[test]
    fn errors_name_the_line_or_the_byte() {
        let say = |text: String| read(text.as_bytes()).unwrap_err().to_string();
        let with = |from: &str, to: &str| say(format!("{HEADER}{BODY}").replace(from, to));
        assert_eq!(with("1 1 0 9", "1 1 9"), "line 15: expected a number, found the end of the line");
        assert_eq!(with("1 1 0 9", "1 1 0 9 9"), "line 15: expected the end of the line, found \"9\"");
        assert_eq!(with("1 1 0 9", "1 ? 0 9"), "line 15: expected a number, found \"?\"");
        assert!(with("1 1 0 9", "1 nan 0 9").starts_with("line 17: vertex 2 is not finite"));
        assert!(
            with("3 0 1 2 7", "3 0 1 4 7")
                .starts_with("line 19: vertex 4 does not exist, the file has 4 vertices (0 to 3)")
        );
        assert!(with("3 0 1 2 7", "").contains("another face should follow"));
        assert!(with("vertex 4", "vertex 40000000").contains("40000000 elements are announced"));
        assert!(with("uchar int", "uchar integer").starts_with("line 10: expected a type"));
        assert!(with("property float z\n", "").contains("lack one of the properties"));
        assert!(with("format ascii 1.0\n", "").contains("no \"format\" line"));
        let mut cut = binary(false);
        cut.truncate(cut.len() - 1);
        let error = read(&cut).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("the file ends at byte {}, where a number should follow", cut.len())),
            "{error}"
        );
        cut.truncate(cut.len() - 2);
        let error = read(&cut).unwrap_err().to_string();
        assert!(error.contains("3 list entries are announced, but only 11 bytes follow"), "{error}");
    }

    #[test]
    fn elements_without_properties_cost_nothing() {
        let header = HEADER
            .replace("ascii", "binary_little_endian")
            .replace("element vertex", "element none 4000000000\nelement vertex");
        let body = binary(false).split_off(HEADER.replace("ascii", "binary_little_endian").len());
        assert!(read(&[header.as_bytes(), &body].concat()).is_ok());
    }
}
