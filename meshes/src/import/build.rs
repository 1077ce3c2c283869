//! Where every reader puts what it finds, and where indices, coordinates and counts are checked once for all of them.

use std::collections::HashMap;

use super::polygon::{self, MOST_CORNERS};
use super::{Census, ImportError, ImportedMesh, Position};
use crate::Vec3;

/// Coordinates beyond this are damage, not geometry.
///
/// Volumes are of third order: up to here they stay far from overflow, whatever the unit of the file.
const LARGEST_COORDINATE: f64 = 1e100;

/// How a file numbers its vertices.
pub(super) enum Numbering {
    /// In order, from this number.
    From(i64),
    /// By a tag each.
    Tags(Vec<i64>),
}

/// A mesh while it is read.
pub(super) struct Builder {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    group: Vec<Option<u32>>,
    groups: Vec<String>,
    group_of_name: HashMap<String, u32>,
    /// For messages.
    pub(super) numbering: Numbering,
    /// What is passed over.
    pub(super) census: Census,
}

impl Builder {
    /// An empty mesh whose vertices are numbered from this number.
    pub(super) fn new(first: i64) -> Self {
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            group: Vec::new(),
            groups: Vec::new(),
            group_of_name: HashMap::new(),
            numbering: Numbering::From(first),
            census: Census::default(),
        }
    }

    /// Makes room, for counts that were checked against the size of the file.
    pub(super) fn reserve(&mut self, vertices: usize, triangles: usize) {
        self.vertices.reserve(vertices);
        self.triangles.reserve(triangles);
        self.group.reserve(triangles);
    }

    pub(super) fn vertices(&self) -> usize {
        self.vertices.len()
    }

    pub(super) fn vertex(&mut self, position: Vec3) {
        self.vertices.push(position);
    }

    /// The index of a group name, new or known.
    pub(super) fn group(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.group_of_name.get(name) {
            return index;
        }
        let index = self.groups.len() as u32; // fewer groups than bytes in the file, and triangles are numbered by u32
        self.groups.push(name.into());
        self.group_of_name.insert(name.into(), index);
        index
    }

    /// Adds a polygon whose corners are vertex indices counted from 0 (outside the range: an error). With fewer than
    /// three corners it is a point or a line, and counted as one.
    pub(super) fn polygon(
        &mut self,
        corners: &[i64],
        group: Option<u32>,
        at: impl Fn() -> Position,
    ) -> Result<(), ImportError> {
        for &corner in corners {
            let position = usize::try_from(corner).ok().and_then(|corner| self.vertices.get(corner));
            let Some(position) = position else {
                let first = if let Numbering::From(first) = self.numbering { first } else { 0 };
                return Err(ImportError::NoSuchVertex {
                    at: at(),
                    vertex: corner.saturating_add(first),
                    vertices: self.vertices.len(),
                    first: Some(first),
                });
            };
            if !position.iter().all(|x| x.abs() <= LARGEST_COORDINATE) {
                let vertex = match &self.numbering {
                    Numbering::From(first) => corner.saturating_add(*first),
                    Numbering::Tags(tags) => tags.get(corner as usize).copied().unwrap_or(corner),
                };
                return Err(ImportError::NotFinite { at: at(), vertex, coordinates: (*position).into() });
            }
        }
        match corners.len() {
            0 => {}
            1 => self.census.points += 1,
            2 => self.census.lines += 1,
            3 => self.push([0, 1, 2].map(|i| corners[i] as u32), group),
            n if n > MOST_CORNERS => {
                return Err(ImportError::Invalid {
                    at: at(),
                    problem: format!(
                        "a polygon with {n} corners (at most {MOST_CORNERS}): let the exporting program cut faces \
                        into triangles"
                    ),
                });
            }
            n => {
                let mut cut = Vec::with_capacity(n - 2);
                polygon::split(n, |i| self.vertices[corners[i] as usize], |t| cut.push(t.map(|i| corners[i] as u32)));
                cut.into_iter().for_each(|t| self.push(t, group));
            }
        }
        Ok(())
    }

    fn push(&mut self, triangle: [u32; 3], group: Option<u32>) {
        self.triangles.push(triangle);
        self.group.push(group);
    }

    /// Adds a strip of triangles, every second of them turned so that all face the same way.
    pub(super) fn strip(
        &mut self,
        corners: &[i64],
        group: Option<u32>,
        at: impl Fn() -> Position,
    ) -> Result<(), ImportError> {
        for (i, window) in corners.windows(3).enumerate() {
            let (a, b, c) = (window[0], window[1], window[2]);
            self.polygon(&if i % 2 == 0 { [a, b, c] } else { [b, a, c] }, group, &at)?;
        }
        Ok(())
    }

    /// The mesh, without the vertices and the groups that no triangle uses.
    pub(super) fn finish(mut self) -> Result<ImportedMesh, ImportError> {
        if self.vertices.len() > u32::MAX as usize {
            return Err(ImportError::TooLarge);
        }
        if self.triangles.is_empty() {
            self.census.vertices = self.vertices.len();
            return Err(ImportError::NoTriangles { census: self.census });
        }
        let mesh =
            ImportedMesh { vertices: self.vertices, triangles: self.triangles, group: self.group, groups: self.groups }
                .compact();
        if mesh.triangles.iter().all(|&t| mesh.has_no_area(t)) {
            return Err(ImportError::NoArea { triangles: mesh.triangles.len() });
        }
        Ok(mesh)
    }
}
