//! The triangulated surface of all electrodes.

use crate::Vec3;

/// What one electrode is, apart from its panels.
#[derive(Clone, Debug, PartialEq)]
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
#[derive(Clone, Debug, Default, PartialEq)]
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
