//! What can go wrong while a mesh file is read, said so that its author knows what to change.

use std::fmt;

use super::Format;

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Line of a text file, counted from 1.
    Line(usize),
    /// Offset into a binary file, counted from 0.
    Byte(usize),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Position::Line(line) => write!(f, "line {line}"),
            Position::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// A mesh file that cannot be used, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The file is of another kind than its name says.
    #[error("this is not a {format} file: {expected} is missing at its beginning{}", match .looks_like {
        Some(other) => format!("; it looks like a {other} file, rename it accordingly"),
        None => ", check that the right file was given and that it is whole".into(),
    })]
    WrongFormat {
        /// What was asked for.
        format: Format,
        /// What such a file begins with.
        expected: &'static str,
        /// What its first bytes look like.
        looks_like: Option<Format>,
    },
    /// Something else stands in the file than its format demands.
    #[error("{at}: expected {expected}, found {found}")]
    Unexpected {
        /// Where.
        at: Position,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The file is cut short.
    #[error("the file ends at {at}, where {expected} should follow: it was cut short, copy or export it again")]
    Truncated {
        /// Its end.
        at: Position,
        /// What should follow.
        expected: String,
    },
    /// The file announces more than it can hold.
    #[error(
        "{at}: {count} {what} are announced, but only {remaining} bytes follow: the file was cut short or is damaged, \
         copy or export it again"
    )]
    Count {
        /// Where the number stands.
        at: Position,
        /// Of what.
        what: &'static str,
        /// How many.
        count: u64,
        /// Bytes from there to the end of the file.
        remaining: usize,
    },
    /// A panel names a vertex that is not there.
    #[error("{at}: vertex {vertex} does not exist, the file has {vertices} vertices{}: export it again", match .first {
        Some(first) if *.vertices > 0 => format!(" ({first} to {})", *.vertices as i128 - 1 + *first as i128),
        _ => String::new(),
    })]
    NoSuchVertex {
        /// Where it is named.
        at: Position,
        /// The number in the file.
        vertex: i64,
        /// How many there are.
        vertices: usize,
        /// Number of the first, where they are numbered in order.
        first: Option<i64>,
    },
    /// A corner has coordinates that are not numbers, or absurd ones.
    #[error(
        "{at}: vertex {vertex} is not finite (it lies at {}, {}, {}): repair the surface in the program that made it",
        .coordinates[0], .coordinates[1], .coordinates[2]
    )]
    NotFinite {
        /// Where a panel uses it.
        at: Position,
        /// Its number in the file.
        vertex: i64,
        /// What the file says.
        coordinates: [f64; 3],
    },
    /// The file contradicts itself or its format.
    #[error("{at}: {problem}")]
    Invalid {
        /// Where.
        at: Position,
        /// What is wrong, and what to change.
        problem: String,
    },
    /// The file is right, but of a variety that is not read.
    #[error("{what}: {change}")]
    Unsupported {
        /// What is not read.
        what: String,
        /// What to do instead.
        change: &'static str,
    },
    /// Nothing in the file has an area.
    #[error("no triangles: the file has {census}; {}", .census.advice())]
    NoTriangles {
        /// What it has instead.
        census: Census,
    },
    /// All triangles are degenerate.
    #[error("no triangles: all {triangles} have zero area; check the scale and the precision of the export")]
    NoArea {
        /// How many there are.
        triangles: usize,
    },
    /// More vertices than 32 bits can number.
    #[error("the file has more than {} vertices: use a coarser mesh", u32::MAX)]
    TooLarge,
    /// A group was asked for that the file does not have.
    #[error("no group \"{wanted}\" in the file{}{}", match .nearest {
        Some(name) => format!(", did you mean \"{name}\"?"),
        None => ":".into(),
    }, match .known.len() {
        0 => " it has none, leave the group out to take the whole surface".into(),
        _ => format!(" it has {}", quoted(.known)),
    })]
    NoSuchGroup {
        /// The name asked for.
        wanted: String,
        /// The names there are.
        known: Vec<String>,
        /// The one that is spelled most like it.
        nearest: Option<String>,
    },
}

/// `"a", "b" and "c"`, cut after a dozen.
fn quoted(names: &[String]) -> String {
    const SHOWN: usize = 12; // about two lines of a terminal
    let mut list: Vec<String> = names.iter().take(SHOWN).map(|name| format!("\"{name}\"")).collect();
    if names.len() > SHOWN {
        list.push(format!("{} more", names.len() - SHOWN));
    }
    match list.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => list.concat(),
    }
}

/// What a file holds besides surface elements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Isolated points.
    pub points: usize,
    /// Line elements and edges.
    pub lines: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
    /// Hexahedra, prisms, pyramids and other bodies.
    pub other_volumes: usize,
    /// Vertices, used or not.
    pub vertices: usize,
}

impl Census {
    /// What helps an author whose file has this but no triangle.
    fn advice(&self) -> &'static str {
        if self.tetrahedra + self.other_volumes > 0 {
            "save the surface elements too (in Gmsh: give the electrode's surfaces a physical group)"
        } else {
            "mesh the electrode's surface before saving it (in Gmsh: a 2D mesh, its surfaces in a physical group)"
        }
    }
}

impl fmt::Display for Census {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = [
            (self.points, "point element", "point elements"),
            (self.lines, "line element", "line elements"),
            (self.tetrahedra, "tetrahedron", "tetrahedra"),
            (self.other_volumes, "other volume element", "other volume elements"),
        ]
        .into_iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, one, many)| format!("{count} {}", if count == 1 { one } else { many }))
        .collect();
        match parts.split_last() {
            None if self.vertices > 0 => write!(f, "{} vertices and no elements", self.vertices),
            None => write!(f, "no elements"),
            Some((only, [])) => write!(f, "{only}"),
            Some((last, rest)) => write!(f, "{} and {last}", rest.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_census_reads_as_prose() {
        let census = Census { lines: 40, tetrahedra: 12, vertices: 9, ..Census::default() };
        let message = ImportError::NoTriangles { census }.to_string();
        assert!(
            message.starts_with("no triangles: the file has 40 line elements and 12 tetrahedra; save"),
            "{message}"
        );
        assert_eq!(Census { points: 1, ..Census::default() }.to_string(), "1 point element");
        assert_eq!(Census { vertices: 3, ..Census::default() }.to_string(), "3 vertices and no elements");
    }

    #[test]
    fn an_unknown_group_names_those_that_exist() {
        let known = vec!["ring".to_string(), "cap".to_string()];
        let wanted = "rings".to_string();
        let error = ImportError::NoSuchGroup { wanted, known, nearest: Some("ring".into()) };
        assert_eq!(
            error.to_string(),
            "no group \"rings\" in the file, did you mean \"ring\"? it has \"ring\" and \"cap\""
        );
    }

    #[test]
    fn the_range_of_vertex_numbers_is_given() {
        let error = ImportError::NoSuchVertex { at: Position::Line(7), vertex: 9, vertices: 8, first: Some(1) };
        assert_eq!(
            error.to_string(),
            "line 7: vertex 9 does not exist, the file has 8 vertices (1 to 8): export it again"
        );
    }
}
