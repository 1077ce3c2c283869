//! STL, ASCII and binary.
//!
//! A binary file is an 80-byte header of free text, a count, and 50 bytes a triangle; Gmsh writes one such section
//! after another when a file has several solids. Some programs begin the header with "solid", as a text file does: the
//! kind is told by the counts, which in a whole binary file lead exactly to its end.

use super::build::Builder;
use super::scan::{Scan, shown};
use super::{Format, ImportError, ImportedMesh, Position};
use crate::Vec3;

/// Header and count of a binary section, bytes.
const HEAD: usize = 84;
/// Normal, three corners, and an attribute that nobody agrees about, bytes.
const RECORD: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh, ImportError> {
    if is_text(bytes) {
        return read_text(bytes);
    }
    if bytes.len() < HEAD {
        return Err(Format::Stl.mismatch(bytes, "\"solid\", or the 84 bytes of a binary header,"));
    }
    // What another format can be recognised by cannot be a binary header, unless the counts say so.
    if !counts_match(bytes) && Format::from_content(bytes).is_some_and(|format| format != Format::Stl) {
        return Err(Format::Stl.mismatch(bytes, "\"solid\" or a binary header"));
    }
    read_binary(bytes)
}

/// The counts of the sections of a binary file lead to its end.
fn counts_match(bytes: &[u8]) -> bool {
    let mut pos = 0;
    while let Some(count) = section(bytes, pos) {
        pos = pos.saturating_add(HEAD + RECORD * count);
        if pos == bytes.len() {
            return true;
        }
    }
    false
}

/// The number of triangles that a binary section at this offset announces.
fn section(bytes: &[u8], pos: usize) -> Option<usize> {
    let count = bytes.get(pos..)?.get(80..HEAD)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

/// It begins with "solid" and goes on as text: a binary header would be followed by zeros or wild bytes soon.
fn is_text(bytes: &[u8]) -> bool {
    let mut scan = Scan::new(bytes);
    let solid = scan.token().is_some_and(|token| token.eq_ignore_ascii_case(b"solid"));
    let start = &bytes[..bytes.len().min(4 * HEAD)];
    solid && !counts_match(bytes) && start.iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace() || *b >= 0x80)
}

fn read_binary(bytes: &[u8]) -> Result<ImportedMesh, ImportError> {
    let mut mesh = Builder::new(0);
    let mut pos = 0;
    while pos < bytes.len() {
        let rest = &bytes[pos..];
        if rest.iter().all(|&b| b == 0) && pos > 0 {
            break; // padding
        }
        let Some(count) = section(bytes, pos) else {
            return Err(ImportError::Invalid {
                at: Position::Byte(pos),
                problem: format!("{} bytes are left over after the last triangle: export the file again", rest.len()),
            });
        };
        let body = &rest[HEAD..];
        if body.len() / RECORD < count {
            return Err(ImportError::Count {
                at: Position::Byte(pos + 80),
                what: "triangles",
                count: count as u64,
                remaining: body.len(),
            });
        }
        let group = header_name(&rest[..80]).map(|name| mesh.group(&name));
        mesh.reserve(3 * count, count);
        for (i, record) in body.chunks_exact(RECORD).take(count).enumerate() {
            let first = mesh.vertices() as i64;
            for corner in record[12..48].chunks_exact(12) {
                let x = |k: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|b| corner[4 * k + b])));
                mesh.vertex(Vec3::new(x(0), x(1), x(2)));
            }
            let at = || Position::Byte(pos + HEAD + i * RECORD);
            mesh.polygon(&[first, first + 1, first + 2], group, at)?;
        }
        pos += HEAD + count * RECORD;
    }
    mesh.finish()
}

/// The text of a binary header, which names the solid as far as it names anything.
fn header_name(header: &[u8]) -> Option<String> {
    let text = header.split(|&b| b == 0).next().unwrap_or_default();
    let text = std::str::from_utf8(text).ok()?.trim();
    let text = text.strip_prefix("solid").map_or(text, str::trim);
    (!text.is_empty() && !text.contains(char::is_control)).then(|| text.into())
}

fn read_text(bytes: &[u8]) -> Result<ImportedMesh, ImportError> {
    let mut mesh = Builder::new(0);
    let mut scan = Scan::new(bytes);
    let mut solids = 0;
    while scan.peek().is_some() {
        expect(&mut scan, "solid")?;
        solids += 1;
        let line = scan.line().unwrap_or_default();
        let name = String::from_utf8_lossy(line).trim().to_string();
        // A nameless solid is called by its place in the file, if there is anything to tell it from.
        let group = match name.as_str() {
            "" if solids == 1 => None,
            "" => Some(mesh.group(&format!("solid {solids}"))),
            name => Some(mesh.group(name)),
        };
        read_solid(&mut scan, &mut mesh, group)?;
    }
    mesh.finish()
}

/// The facets of a solid, to the end of its `endsolid` line.
fn read_solid(scan: &mut Scan<'_>, mesh: &mut Builder, group: Option<u32>) -> Result<(), ImportError> {
    loop {
        let word = scan.word("\"facet\" or \"endsolid\"")?;
        match word.to_ascii_lowercase().as_str() {
            "endsolid" => {
                scan.line();
                return Ok(());
            }
            "facet" => {}
            _ => return Err(scan.unexpected(word.as_bytes(), "\"facet\" or \"endsolid\"")),
        }
        let start = scan.pos;
        // The normal is not used, and some programs write "nan" for it: any three words will do.
        for expected in ["\"normal\"", "the normal", "the normal", "the normal"] {
            scan.word(expected)?;
        }
        expect(scan, "outer")?;
        expect(scan, "loop")?;
        let first = mesh.vertices() as i64;
        let mut corners = Vec::with_capacity(3);
        while scan.peek().is_some_and(|word| word.eq_ignore_ascii_case(b"vertex")) {
            scan.token();
            let [x, y, z] = [(); 3].map(|()| scan.number("a coordinate"));
            mesh.vertex(Vec3::new(x?, y?, z?));
            corners.push(first + corners.len() as i64);
        }
        if corners.len() < 3 {
            let found = scan.token().unwrap_or_default();
            return Err(scan.unexpected(found, "\"vertex\""));
        }
        expect(scan, "endloop")?;
        expect(scan, "endfacet")?;
        mesh.polygon(&corners, group, || scan.place(start))?;
    }
}

/// The next word must be this one, in any case.
fn expect(scan: &mut Scan<'_>, keyword: &str) -> Result<(), ImportError> {
    let token = scan.token().ok_or_else(|| scan.truncated(&format!("\"{keyword}\"")))?;
    if token.eq_ignore_ascii_case(keyword.as_bytes()) {
        return Ok(());
    }
    Err(ImportError::Unexpected {
        at: scan.place(scan.pos - token.len()),
        expected: format!("\"{keyword}\""),
        found: shown(token),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACET: &str =
        "facet normal nan nan nan\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 1e0 0\n endloop\nendfacet\n";

    fn section(header: &str, count: u32, triangles: usize) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        bytes.resize(80, 0);
        bytes.extend(count.to_le_bytes());
        for i in 0..triangles {
            let corners = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, i as f32, 0.0, 1.0, i as f32];
            corners.iter().for_each(|x: &f32| bytes.extend(x.to_le_bytes()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn text_with_several_solids_in_any_case_and_line_ending() {
        let text = format!("solid the ring\n{FACET}endsolid the ring\n\nSOLID\n{}ENDSOLID", FACET.to_uppercase());
        for text in [text.replace('\n', "\r\n"), text] {
            let mesh = read(text.as_bytes()).unwrap();
            assert_eq!(mesh.groups, ["the ring", "solid 2"]);
            assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (6, 2));
        }
        let one = read(format!("solid\n{FACET}endsolid").as_bytes()).unwrap();
        assert_eq!(one.group, [None]);
    }

    #[test]
    fn binary_files_that_begin_with_solid() {
        let mesh = read(&section("solid cap of the trap", 2, 2)).unwrap();
        assert_eq!((&mesh.groups[..], mesh.triangles.len()), (&["cap of the trap".to_string()][..], 2));
        assert_eq!(mesh.vertices[5], Vec3::new(0.0, 1.0, 1.0));
        let cut = section("solid", 3, 2);
        let error = read(&cut).unwrap_err().to_string();
        assert!(error.starts_with("byte 80: 3 triangles are announced, but only 100 bytes follow"), "{error}");
    }

    #[test]
    fn binary_sections_are_solids() {
        let bytes = [section("ring", 2, 2), section("end cap", 1, 1)].concat();
        let mesh = read(&bytes).unwrap();
        assert_eq!(
            (&mesh.groups[..], &mesh.group[..]),
            (&["ring".to_string(), "end cap".to_string()][..], &[Some(0), Some(0), Some(1)][..])
        );
        let padded = [&bytes[..], &[0; 7]].concat();
        assert_eq!(read(&padded).unwrap(), mesh);
        let extra = [&bytes[..], b"surplus"].concat();
        assert_eq!(
            read(&extra).unwrap_err().to_string(),
            format!("byte {}: 7 bytes are left over after the last triangle: export the file again", bytes.len())
        );
    }

    #[test]
    fn errors_name_line_and_vertex() {
        let text = format!("solid s\n{FACET}endsolid");
        let say = |text: String| read(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(say(text.replace("1e0", "one")), "line 6: expected a coordinate, found \"one\"");
        assert!(say(text.replace("1e0", "nan")).starts_with("line 2: vertex 2 is not finite"));
        assert_eq!(say(text.replace("endfacet", "end")), "line 8: expected \"endfacet\", found \"end\"");
        assert!(say(text.replace("endsolid", "")).contains("\"facet\" or \"endsolid\" should follow"));
        assert!(say("solid s\nendsolid".into()).starts_with("no triangles"));
    }
}
