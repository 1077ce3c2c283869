//! The electrodes of a case as one mesh, and whether they can stand as they do.

use meshes::import::{Format, ImportedMesh as Imported};
use meshes::{Shape, SurfaceMesh, SurfaceTree, Triangulation, Vec3, triangulate, triangulate_to};
use std::cell::OnceCell;

use super::{Failure, Reporter};
use crate::case::{Case, Drive, ElectrodeShape, GROUND, ImportedMesh, MeshFormat};
use crate::{CaseError, CaseSource};

/// What each electrode is made of, ready to be meshed at any fineness.
#[derive(Clone, Debug)]
pub struct Electrodes {
    /// Shapes in their own frames, in the order of the case; imported ones as [`Shape::Mesh`].
    pub shapes: Vec<Shape>,
    /// How much finer each is to be than the others, for narrow gaps; 1 and more.
    pub emphasis: Vec<f64>,
}

/// Largest emphasis: nine times the panels.
const MOST_EMPHASIS: f64 = 3.0;

/// Surfaces nearer than this, as a fraction of the extent of all electrodes, touch: some thousand roundings.
const TOUCH: f64 = 1e-9;

/// Fineness at which electrodes that seem to touch are looked at again: facets of a sphere then stand off it by 3e-5 radii.
const FINELY: f64 = 12.0;

/// Facets of round surfaces stand off them by less than this share of their longest edges, if twelve or more go round.
const STAND_OFF: f64 = 0.1;

impl Electrodes {
    /// Reads imported meshes.
    ///
    /// # Errors
    /// A mesh file that cannot be read, has no such group, or is not closed where it must be.
    pub fn new(case: &Case, source: &CaseSource, reporter: &dyn Reporter) -> Result<Self, Failure> {
        let shapes = case
            .electrodes
            .iter()
            .map(|electrode| match &electrode.shape {
                ElectrodeShape::Shape(shape) => Ok(shape.clone()),
                ElectrodeShape::Imported(file) => import(file, &electrode.name, source, reporter),
            })
            .collect::<Result<Vec<_>, CaseError>>()?;
        Ok(Self { emphasis: vec![1.0; shapes.len()], shapes })
    }

    /// Whether some electrode comes from a file, so that it cannot be meshed anew.
    pub fn any_imported(&self) -> bool {
        self.shapes.iter().any(|shape| matches!(shape, Shape::Mesh { .. }))
    }

    /// Meshes all electrodes at a fineness (times its emphasis for each; an electrode with a number of panels of its own
    /// gets about that many, times `share`) and finds out which are hollow.
    ///
    /// # Errors
    /// A shape that cannot be.
    pub fn mesh(&self, case: &Case, source: &CaseSource, fineness: f64, share: f64) -> Result<SurfaceMesh, Failure> {
        let mut parts = Vec::new();
        for ((electrode, shape), emphasis) in case.electrodes.iter().zip(&self.shapes).zip(&self.emphasis) {
            let meshed = match electrode.panels {
                Some(panels) => triangulate_to(shape, ((panels as f64 * share) as usize).max(1)).map(|(mesh, _)| mesh),
                None => triangulate(shape, fineness * emphasis),
            };
            let placed: Triangulation = meshed.and_then(|mesh| mesh.placed(&electrode.placement)).map_err(|error| {
                let key = format!("electrode.{}.{}", electrode.name, error.key);
                source.error_at(&key, error.problem, error.help)
            })?;
            parts.push((electrode.name.clone(), placed));
        }
        let mut mesh = SurfaceMesh::assemble(parts);
        find_hollow(&mut mesh, case, source)?;
        Ok(mesh)
    }

    /// One electrode in small panels, if it can be meshed.
    fn finely(&self, case: &Case, electrode: usize) -> Option<SurfaceTree> {
        let (of, shape) = (&case.electrodes[electrode], &self.shapes[electrode]);
        let panels = triangulate(shape, FINELY).ok()?.placed(&of.placement).ok()?;
        Some(SurfaceTree::new(&SurfaceMesh::assemble([(of.name.clone(), panels)])))
    }

    /// The fineness at which all electrodes together have about that many panels, by halving.
    ///
    /// # Errors
    /// As [`Electrodes::mesh`].
    pub fn fineness_for(&self, case: &Case, source: &CaseSource, panels: usize) -> Result<f64, Failure> {
        let (mut low, mut high) = (1e-2_f64, 1e2_f64);
        let mut best = (f64::INFINITY, 1.0);
        for _ in 0..24 {
            let middle = (low * high).sqrt();
            let count = self.mesh(case, source, middle, 1.0)?.panels() as f64;
            let miss = (count / panels as f64).ln().abs();
            if miss < best.0 {
                best = (miss, middle);
            }
            if miss < 0.02 {
                break;
            }
            if count < panels as f64 { low = middle } else { high = middle }
        }
        Ok(best.1)
    }

    /// Finer panels for electrodes with a gap narrower than their panels are wide, up to threefold; beyond that a warning.
    pub fn emphasise_gaps(&mut self, case: &Case, mesh: &SurfaceMesh, reporter: &dyn Reporter) {
        let trees: Vec<SurfaceTree> = (0..self.shapes.len()).map(|e| SurfaceTree::of_electrode(mesh, e)).collect();
        let mut wanted = vec![1.0_f64; trees.len()];
        for i in 0..trees.len() {
            for j in i + 1..trees.len() {
                let Some((gap, p, q)) = trees[i].gap(&trees[j], f64::INFINITY).filter(|(gap, ..)| *gap > 0.0) else {
                    continue;
                };
                for (e, panel) in [(i, p), (j, q)] {
                    wanted[e] = wanted[e].max(mesh.area(panel).sqrt() / gap);
                }
                let worst = wanted[i].max(wanted[j]);
                if worst > 3.0 * MOST_EMPHASIS {
                    let (a, b) = (&case.electrodes[i].name, &case.electrodes[j].name);
                    reporter.warning(&format!(
                        "`{a}` and `{b}` are only {gap:.2e} m apart: their panels are {worst:.0} times as wide there, and the charge in the gap is coarse"
                    ));
                }
            }
        }
        if let Some(plane) = &case.field.ground {
            for (e, wanted) in wanted.iter_mut().enumerate() {
                // A panel's image is twice as far as the plane.
                let narrow = |p: usize| mesh.area(p).sqrt() / (2.0 * plane.height(&mesh.centroid(p)));
                *wanted = mesh.panels_of(e).map(narrow).fold(*wanted, f64::max);
            }
        }
        self.emphasis = wanted.into_iter().map(|w| w.clamp(1.0, MOST_EMPHASIS)).collect();
    }
}

/// Reads, selects, cleans and scales an imported mesh.
fn import(
    file: &ImportedMesh,
    electrode: &str,
    source: &CaseSource,
    reporter: &dyn Reporter,
) -> Result<Shape, CaseError> {
    let at = |key: &str, problem: String, help: &str| {
        source.error_at(&format!("electrode.{electrode}.{key}"), problem, help)
    };
    let name =
        file.path.file_name().map_or_else(|| file.path.display().to_string(), |n| n.to_string_lossy().into_owned());
    let bytes = std::fs::read(&file.path)
        .map_err(|error| at("file", format!("{name} cannot be read: {error}"), "check that the file is still there"))?;
    let format = match file.format {
        MeshFormat::Gmsh => Format::Gmsh,
        MeshFormat::Stl => Format::Stl,
        MeshFormat::Vtu => Format::Vtu,
        MeshFormat::Vtk => Format::Vtk,
        MeshFormat::Obj => Format::Obj,
        MeshFormat::Ply => Format::Ply,
    };
    let whole = meshes::import::read(format, &bytes)
        .map_err(|error| at("file", format!("{name}: {error}"), "export the mesh again, as triangles"))?;
    let part: Imported = match &file.group {
        Some(group) => whole.select(group).map_err(|error| at("group", error.to_string(), "name one of its groups"))?,
        None => whole,
    };
    let (mesh, cleaned) = part.clean();
    if mesh.triangles.is_empty() {
        return Err(at("file", format!("{name} has no triangle with an area"), "export the surface as triangles"));
    }
    if file.closed && !cleaned.is_closed() {
        let problem = format!("{name} has holes: {} edges belong to one triangle only", cleaned.free_edges);
        return Err(at("closed", problem, "mend the mesh, or leave out `closed` if it is a sheet"));
    }
    if cleaned.branching_edges > 0 {
        reporter.warning(&format!(
            "`{electrode}`: {} edges of {name} belong to more than two triangles; its inside is not known",
            cleaned.branching_edges
        ));
    }
    let vertices = mesh.vertices.iter().map(|v| v * file.scale).collect();
    Ok(Shape::Mesh { vertices, triangles: mesh.triangles })
}

/// Closed electrodes that hold others are hollow, unless the case says what they are.
fn find_hollow(mesh: &mut SurfaceMesh, case: &Case, source: &CaseSource) -> Result<(), Failure> {
    let mut holds: Vec<Option<usize>> = vec![None; case.electrodes.len()];
    // Most electrodes stand beside each other: boxes tell that at once.
    let boxes: Vec<(Vec3, Vec3)> = (0..case.electrodes.len())
        .map(|e| {
            let corners = mesh.panels_of(e).flat_map(|p| mesh.corners(p));
            let none = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
            corners.fold(none, |(low, high), corner| (low.inf(&corner), high.sup(&corner)))
        })
        .collect();
    let in_box = |e: usize, p: &Vec3| mesh.electrodes[e].closed && boxes[e].0 <= *p && *p <= boxes[e].1;
    let mut tree = None;
    for inner in 0..case.electrodes.len() {
        // Electrodes that cut each other are found later: one point tells for those that do not.
        let Some(panel) = mesh.panels_of(inner).next() else { continue };
        let point = mesh.centroid(panel);
        if !(0..case.electrodes.len()).any(|outer| outer != inner && in_box(outer, &point)) {
            continue;
        }
        for outer in tree.get_or_insert_with(|| SurfaceTree::new(mesh)).enclosed_by(&point) {
            if outer != inner {
                holds[outer].get_or_insert(inner);
            }
        }
    }
    for (e, electrode) in case.electrodes.iter().enumerate() {
        mesh.electrodes[e].hollow = match (electrode.hollow, holds[e]) {
            (Some(false), Some(inner)) => {
                let inside = &case.electrodes[inner].name;
                let problem = format!("`{inside}` lies inside it, where a solid electrode has metal");
                let key = format!("electrode.{}.hollow", electrode.name);
                return Err(source.error_at(&key, problem, "leave out `hollow`, or move one of them").into());
            }
            (Some(true), _) if !mesh.electrodes[e].closed => {
                let key = format!("electrode.{}.hollow", electrode.name);
                let problem = "the surface is open, so that it encloses nothing";
                return Err(source.error_at(&key, problem, "leave out `hollow`").into());
            }
            (given, inner) => given.unwrap_or(inner.is_some()),
        };
    }
    Ok(())
}

/// Refuses electrodes that touch or cross the grounded plane, or stand below it.
///
/// # Errors
/// Names both.
pub fn check_ground(mesh: &SurfaceMesh, case: &Case, source: &CaseSource) -> Result<(), Failure> {
    let (Some(plane), Some((lo, hi))) = (&case.field.ground, mesh.bounds()) else { return Ok(()) };
    let touch = TOUCH * (hi - lo).norm();
    for (e, electrode) in case.electrodes.iter().enumerate() {
        let corners = mesh.panels_of(e).flat_map(|p| mesh.corners(p));
        let heights = corners.map(|corner| plane.height(&corner));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low > touch {
            continue;
        }
        let (problem, help) = if high <= touch {
            let problem = format!("`{}` stands below the grounded plane `{GROUND}`", electrode.name);
            (problem, "move it to the side that field.ground.axis points to, or turn the axis round")
        } else {
            let problem = format!(
                "`{}` touches or crosses the grounded plane `{GROUND}`: it reaches from {low:.4} m to {high:.4} m above it",
                electrode.name
            );
            (problem, "move it up, or the plane down (field.ground.center)")
        };
        return Err(source.error_at(&format!("electrode.{}.center", electrode.name), problem, help).into());
    }
    Ok(())
}

/// Longest edge of an electrode's panels, m.
fn longest_edge(mesh: &SurfaceMesh, electrode: usize) -> f64 {
    let edge = |panel: usize| {
        let [a, b, c] = mesh.corners(panel);
        (a - b).norm().max((b - c).norm()).max((c - a).norm())
    };
    mesh.panels_of(electrode).map(edge).fold(0.0, f64::max)
}

/// Refuses electrodes that touch or cut each other at different voltages. Facets keep the area of round surfaces and stand out
/// of them here and there: with `curved`, where charges do not sit on facets, those that seem to touch are looked at more
/// finely. Gives the names of the first two that touch at one voltage.
///
/// # Errors
/// Names both and where they meet.
pub fn check_contacts<'a>(
    electrodes: &Electrodes,
    curved: bool,
    mesh: &SurfaceMesh,
    case: &'a Case,
    source: &CaseSource,
    reporter: &dyn Reporter,
) -> Result<Option<[&'a str; 2]>, Failure> {
    let Some((lo, hi)) = mesh.bounds() else { return Ok(None) };
    let mut joined = None;
    let touch = TOUCH * (hi - lo).norm();
    let trees: Vec<SurfaceTree> = (0..case.electrodes.len()).map(|e| SurfaceTree::of_electrode(mesh, e)).collect();
    let fine: Vec<OnceCell<Option<SurfaceTree>>> = trees.iter().map(|_| OnceCell::new()).collect();
    let finely = |e: usize| fine[e].get_or_init(|| electrodes.finely(case, e)).as_ref();
    let stand_off = |e: usize| STAND_OFF * longest_edge(mesh, e);
    for i in 0..trees.len() {
        for j in i + 1..trees.len() {
            // Facets may also hide that the surfaces cut each other.
            let near = if curved { touch + stand_off(i) + stand_off(j) } else { touch };
            let Some((_, p, _)) = trees[i].gap(&trees[j], near) else { continue };
            let apart = match (finely(i), finely(j)) {
                (Some(one), Some(other)) if curved => one.gap(other, touch).is_none(),
                _ => curved && trees[i].gap(&trees[j], touch).is_none(),
            };
            if apart {
                continue;
            }
            let (a, b) = (&case.electrodes[i], &case.electrodes[j]);
            let c = mesh.centroid(p);
            let place = format!("near ({:.4}, {:.4}, {:.4}) m", c.x, c.y, c.z);
            let same = matches!((&a.drive, &b.drive), (Drive::Voltage(v), Drive::Voltage(w)) if v == w);
            if same {
                reporter.warning(&format!(
                    "`{}` and `{}` touch {place}; they have one voltage, but their separate capacitances depend on the mesh",
                    a.name, b.name
                ));
                joined.get_or_insert([a.name.as_str(), b.name.as_str()]);
                continue;
            }
            let floats = [a, b].iter().any(|e| matches!(e.drive, Drive::Charge(_)));
            let why =
                if floats { "one of them floats at a voltage of its own" } else { "they have different voltages" };
            let problem = format!("`{}` touches or cuts `{}` {place}, and {why}", b.name, a.name);
            let help = "move them apart, make one smaller, or give both the same `dc` and `rf`";
            // At what moves the electrode, if it is written.
            return Err(source.error_at(&format!("electrode.{}.center", b.name), problem, help).into());
        }
    }
    Ok(joined)
}
