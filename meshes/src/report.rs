//! What a mesh is like: counts, areas, quality, distances.

use std::fmt;

use crate::{SurfaceMesh, SurfaceTree, triangle};

/// What one electrode's mesh is like.
#[derive(Clone, Debug, PartialEq)]
pub struct ElectrodeReport {
    /// Name.
    pub name: String,
    /// Number of panels.
    pub panels: usize,
    /// m².
    pub area: f64,
    /// Enclosed volume, m³, for a closed surface.
    pub volume: Option<f64>,
    /// Worst longest-side-over-height among the panels.
    pub worst_aspect: f64,
    /// Smallest and largest square root of a panel's area, m.
    pub panel_size: [f64; 2],
    /// Number of edges that belong to one panel only: zero for a closed surface.
    pub open_edges: usize,
    /// Number of edges that more than two panels share, or that two panels run along in the same direction.
    pub bad_edges: usize,
    /// Normals point outwards; `None` for an open surface, which has no outside.
    pub outward: Option<bool>,
    /// Distance to the nearest other electrode, m, and its name.
    pub nearest: Option<(f64, String)>,
}

/// What a mesh is like.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshReport {
    /// One entry for each electrode.
    pub electrodes: Vec<ElectrodeReport>,
    /// Panels in all.
    pub panels: usize,
    /// Worst longest-side-over-height among all panels.
    pub worst_aspect: f64,
}

impl MeshReport {
    /// Measures a mesh.
    pub fn new(mesh: &SurfaceMesh) -> Self {
        let trees: Vec<SurfaceTree> = (0..mesh.electrodes.len()).map(|e| SurfaceTree::of_electrode(mesh, e)).collect();
        let electrodes: Vec<ElectrodeReport> = mesh
            .electrodes
            .iter()
            .enumerate()
            .map(|(e, electrode)| {
                let panels = mesh.panels_of(e);
                let sizes = panels.clone().map(|p| mesh.area(p).sqrt());
                let (open_edges, bad_edges) = mesh.edge_defects(e);
                let volume: f64 = panels.clone().map(|p| mesh.centroid(p).dot(&mesh.area_vector(p)) / 3.0).sum();
                let closed = open_edges == 0 && bad_edges == 0;
                let nearest = (0..trees.len())
                    .filter(|&other| other != e)
                    .filter_map(|other| trees[e].gap(&trees[other], f64::INFINITY).map(|(d, ..)| (d, other)))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(d, other)| (d, mesh.electrodes[other].name.clone()));
                ElectrodeReport {
                    name: electrode.name.clone(),
                    panels: panels.len(),
                    area: panels.clone().map(|p| mesh.area(p)).sum(),
                    volume: closed.then_some(volume.abs()),
                    worst_aspect: panels.clone().map(|p| triangle::aspect_ratio(&mesh.corners(p))).fold(0.0, f64::max),
                    panel_size: [sizes.clone().fold(f64::INFINITY, f64::min), sizes.fold(0.0, f64::max)],
                    open_edges,
                    bad_edges,
                    outward: closed.then_some(volume > 0.0),
                    nearest,
                }
            })
            .collect();
        Self {
            panels: mesh.panels(),
            worst_aspect: electrodes.iter().map(|e| e.worst_aspect).fold(0.0, f64::max),
            electrodes,
        }
    }
}

impl fmt::Display for MeshReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.electrodes.iter().map(|e| e.name.len()).max().unwrap_or(0).max(9);
        writeln!(
            f,
            "{:width$} {:>8} {:>11} {:>11} {:>8} {:>21}  {:20} nearest",
            "electrode", "panels", "area m2", "volume m3", "aspect", "panel size m", "surface"
        )?;
        for e in &self.electrodes {
            let volume = e.volume.map_or("-".to_string(), |v| format!("{v:.4e}"));
            let size = format!("{:.2e} .. {:.2e}", e.panel_size[0], e.panel_size[1]);
            let surface = match (e.bad_edges, e.outward, e.open_edges) {
                (0, Some(true), _) => "closed, outward".to_string(),
                (0, Some(false), _) => "closed, INWARD".to_string(),
                (0, None, n) => format!("open, {n} edges"),
                (bad, ..) => format!("{bad} BAD EDGES"),
            };
            let nearest = e.nearest.as_ref().map_or("-".to_string(), |(d, name)| format!("{d:.4e} m to {name}"));
            writeln!(
                f,
                "{:width$} {:>8} {:>11.4e} {volume:>11} {:>8.1} {size:>21}  {surface:20} {nearest}",
                e.name, e.panels, e.area, e.worst_aspect
            )?;
        }
        write!(f, "{} panels in all, worst aspect ratio {:.1}", self.panels, self.worst_aspect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Placement, Shape, Vec3, triangulate};

    #[test]
    fn two_spheres_and_a_sheet() {
        let sphere = triangulate(&Shape::Sphere { radius: 1.0 }, 1.0).unwrap();
        let plate = triangulate(&Shape::Plate { size: [1.0, 1.0], thickness: 0.0 }, 1.0).unwrap();
        let at = |x: f64| Placement { center: Vec3::x() * x, axis: Vec3::x(), up: None };
        let mesh = SurfaceMesh::assemble([
            ("a".to_string(), sphere.clone().placed(&at(0.0)).unwrap()),
            ("b".to_string(), sphere.placed(&at(3.0)).unwrap()),
            ("sheet".to_string(), plate.placed(&at(-2.0)).unwrap()),
        ]);
        let report = MeshReport::new(&mesh);
        assert_eq!(report.panels, mesh.panels());
        let [a, _, sheet] = &report.electrodes[..] else { panic!("three electrodes") };
        assert_eq!((a.open_edges, a.bad_edges, a.outward), (0, 0, Some(true)));
        // Faceted spheres of the true area stand out by some percent of the panel size.
        let (gap, name) = a.nearest.clone().unwrap();
        assert!((gap - 1.0).abs() < 0.02 && (name == "b" || name == "sheet"), "{gap} to {name}");
        assert!(sheet.outward.is_none() && sheet.open_edges > 40 && sheet.volume.is_none());
        assert!(mesh.electrodes[0].closed && !mesh.electrodes[2].closed);
        let text = report.to_string();
        assert!(text.contains("closed, outward") && text.contains("open, "), "{text}");
    }
}
