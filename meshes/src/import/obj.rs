//! Wavefront OBJ.

use super::build::Builder;
use super::scan::Scan;
use super::{Format, ImportError, ImportedMesh};
use crate::Vec3;

/// Why the last `o` or `g` names a face, whichever it is: programs write objects, or groups, or an object and then its
/// groups; the last one is the finest division in each case.
pub(super) fn read(bytes: &[u8]) -> Result<ImportedMesh, ImportError> {
    let mut mesh = Builder::new(1);
    let mut group = None;
    let mut scan = Scan::new(bytes);
    let mut statements = 0;
    let mut corners = Vec::new();
    loop {
        let start = scan.pos;
        let Some(line) = scan.line() else { break };
        // A backslash at its end carries a statement over to the next line.
        let mut joined = Vec::new();
        let mut line = line;
        while let Some(head) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(head);
            joined.push(b' ');
            line = scan.line().unwrap_or_default();
        }
        if !joined.is_empty() {
            joined.extend_from_slice(line);
            line = &joined;
        }

        let mut words = Scan::new(line);
        let Some(keyword) = words.token() else { continue };
        let invalid = |problem: String| scan.invalid(start, problem);
        match keyword {
            b"v" => {
                // A weight or a colour may follow: neither moves the vertex.
                let mut coordinate = |axis: &str| {
                    let word = words.token().ok_or_else(|| invalid(format!("the vertex has no {axis} coordinate")))?;
                    number::<f64>(word).ok_or_else(|| unexpected(&scan, start, word, &format!("the {axis} coordinate")))
                };
                let (x, y, z) = (coordinate("x")?, coordinate("y")?, coordinate("z")?);
                mesh.vertex(Vec3::new(x, y, z));
            }
            b"f" => {
                corners.clear();
                while let Some(word) = words.token() {
                    let index = word.split(|&b| b == b'/').next().unwrap_or_default();
                    let index: i64 =
                        number(index).ok_or_else(|| unexpected(&scan, start, word, "a vertex number of the face"))?;
                    corners.push(match index {
                        0 => return Err(invalid("vertex 0 of a face: OBJ files count from 1, export it again".into())),
                        // Backwards from the latest vertex.
                        i64::MIN..0 => index.saturating_add(mesh.vertices() as i64),
                        _ => index - 1,
                    });
                }
                if corners.len() < 3 {
                    let count = corners.len();
                    return Err(invalid(format!(
                        "a face with {count} corners: it needs three at least, export it again"
                    )));
                }
                mesh.polygon(&corners, group, || scan.place(start))?;
            }
            b"o" | b"g" => {
                let name = String::from_utf8_lossy(words.rest()).trim().to_string();
                group = (!name.is_empty()).then(|| mesh.group(&name));
            }
            b"l" => mesh.census.lines += 1,
            b"p" => mesh.census.points += 1,
            b"curv" | b"curv2" | b"surf" => {
                return Err(ImportError::Unsupported {
                    what: format!("free-form geometry (\"{}\")", String::from_utf8_lossy(keyword)),
                    change: "export the surface as polygons",
                });
            }
            _ => {}
        }
        // Any text has lines; statements tell an OBJ file from other text.
        statements += usize::from(matches!(keyword, b"v" | b"f" | b"o" | b"g" | b"l" | b"p"));
    }
    if statements == 0 {
        return Err(Format::Obj.mismatch(bytes, "any vertex (\"v x y z\") or face (\"f 1 2 3\")"));
    }
    mesh.finish()
}

fn number<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn unexpected(scan: &Scan<'_>, start: usize, found: &[u8], expected: &str) -> ImportError {
    ImportError::Unexpected { at: scan.place(start), expected: expected.into(), found: super::scan::shown(found) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "# a square\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\n";

    fn of(text: &str) -> Result<ImportedMesh, ImportError> {
        read(format!("{SQUARE}{text}").as_bytes())
    }

    #[test]
    fn faces_in_every_notation() {
        for face in ["1 2 3", "1/1 2/2 3/3", "1//7 2//7 3//7", "1/2/3 2/2/3 3/2/3", "-4 -3 -2", "1 2 \\\n 3"] {
            let mesh = of(&format!("f {face}\n")).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2]], "{face}");
        }
    }

    #[test]
    fn objects_and_groups_name_what_follows() {
        let mesh =
            of("f 1 2 3\no trap ring\nf 1 2 3\ng cap\nf 1 2 3 4\ng\nf 1 2 4\no trap ring\nf 2 3 4\nl 1 2\n").unwrap();
        assert_eq!(mesh.groups, ["trap ring", "cap"]);
        assert_eq!(mesh.group, [None, Some(0), Some(1), Some(1), None, Some(0)]);
    }

    #[test]
    fn errors_name_the_line() {
        let say = |text: &str| of(text).unwrap_err().to_string();
        assert_eq!(
            say("f 1 2 9\n"),
            "line 6: vertex 9 does not exist, the file has 4 vertices (1 to 4): export it again"
        );
        assert!(say("\n\nf 1 2 -9\n").starts_with("line 8: vertex -4 does not exist"));
        assert!(say("f 0 1 2\n").starts_with("line 6: vertex 0 of a face"));
        assert_eq!(say("f 1 x 2\n"), "line 6: expected a vertex number of the face, found \"x\"");
        assert_eq!(say("v 1 2\n"), "line 6: the vertex has no z coordinate");
        assert!(say("v 1 2 inf\nf 1 2 5\n").starts_with("line 7: vertex 5 is not finite"));
        assert!(say("f 1 2\n").contains("a face with 2 corners"));
        assert!(say("l 1 2\nl 2 3\n").starts_with("no triangles: the file has 2 line elements"));
        assert!(say("f 1 2 2\n").starts_with("no triangles: all 1 have zero area"));
    }
}
