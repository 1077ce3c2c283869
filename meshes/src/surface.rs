//! The triangulated surface of all electrodes.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::{Triangulation, Vec3};

/// What one electrode is, apart from its panels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElectrodeSurface {
    /// Its name in the case file; unique.
    pub name: String,
    /// Every edge belongs to two panels: the surface has an inside.
    pub closed: bool,
    /// A closed surface whose inside is vacuum (a chamber) instead of metal.
    pub hollow: bool,
}

/// All electrodes as triangles.
///
/// Vertices are shared inside an electrode and never between electrodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceMesh {
    /// Corner points, m.
    pub vertices: Vec<Vec3>,
    /// Corners of each panel, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Electrode of each panel, an index into `electrodes`. Panels of an electrode are contiguous and in order.
    pub electrode: Vec<u32>,
    /// The electrodes, in the order of the case.
    pub electrodes: Vec<ElectrodeSurface>,
}

impl SurfaceMesh {
    /// Puts the triangulations of named electrodes, already in place, into one mesh. Whether each is closed is found from
    /// its edges; none is hollow until said so.
    pub fn assemble(parts: impl IntoIterator<Item = (String, Triangulation)>) -> Self {
        let mut mesh = Self::default();
        for (name, part) in parts {
            let base = mesh.vertices.len() as u32;
            let electrode = mesh.electrodes.len();
            mesh.vertices.extend(part.vertices);
            mesh.electrode.extend(std::iter::repeat_n(electrode as u32, part.triangles.len()));
            mesh.triangles.extend(part.triangles.into_iter().map(|t| t.map(|v| v + base)));
            mesh.electrodes.push(ElectrodeSurface { name, closed: false, hollow: false });
            mesh.electrodes[electrode].closed = mesh.edge_defects(electrode) == (0, 0);
        }
        mesh
    }

    /// Edges of an electrode that belong to one panel only, and edges that more than two panels share or that two panels
    /// run along in the same direction.
    pub fn edge_defects(&self, electrode: usize) -> (usize, usize) {
        // For each edge: how many panels run along it upwards and downwards in vertex number.
        let mut uses: HashMap<[u32; 2], [u32; 2]> = HashMap::new();
        for t in &self.triangles[self.panels_of(electrode)] {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let count = uses.entry([a.min(b), a.max(b)]).or_default();
                count[usize::from(a > b)] += 1;
            }
        }
        let open = uses.values().filter(|[up, down]| up + down == 1).count();
        let bad = uses.values().filter(|count| !matches!(count, [1, 1] | [1, 0] | [0, 1])).count();
        (open, bad)
    }

    /// Number of panels.
    pub fn panels(&self) -> usize {
        self.triangles.len()
    }

    /// The three corners of a panel, m.
    pub fn corners(&self, panel: usize) -> [Vec3; 3] {
        self.triangles[panel].map(|v| self.vertices[v as usize])
    }

    /// Mean of the three corners of a panel, m.
    pub fn centroid(&self, panel: usize) -> Vec3 {
        let [a, b, c] = self.corners(panel);
        (a + b + c) / 3.0
    }

    /// Half the cross product of two edges of a panel: its outward normal times its area, m².
    pub fn area_vector(&self, panel: usize) -> Vec3 {
        let [a, b, c] = self.corners(panel);
        (b - a).cross(&(c - a)) * 0.5
    }

    /// Area of a panel, m².
    pub fn area(&self, panel: usize) -> f64 {
        self.area_vector(panel).norm()
    }

    /// The panels of one electrode, as a range of panel numbers.
    pub fn panels_of(&self, electrode: usize) -> std::ops::Range<usize> {
        let first = self.electrode.partition_point(|&e| (e as usize) < electrode);
        let last = self.electrode.partition_point(|&e| (e as usize) <= electrode);
        first..last
    }

    /// Smallest box that holds every vertex, or `None` for an empty mesh.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), v| (lo.inf(v), hi.sup(v))))
    }
}
