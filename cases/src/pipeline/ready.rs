//! A case that can be run: what is wrong with its geometry is found before the long work starts.

use field::{ElectrodeBasis, PotentialTable, Source};
use meshes::{SurfaceMesh, SurfaceTree, Vec3};
use tracer::{Ensemble, Region};

use super::choice::{Choice, Elements, choose, of_joined};
use super::surface::{Electrodes, check_contacts, check_ground};
use super::tables::many_coupled_flights;
use super::{Failure, Reporter, drives, flights, memory, region};
use crate::CaseSource;
use crate::case::{Case, GROUND, SourceKind};

/// What a run starts from.
#[derive(Clone, Debug)]
pub struct Ready {
    /// Electrodes, ready to be meshed at any fineness.
    pub electrodes: Electrodes,
    /// A first mesh of them, with the number of panels that shapes have by themselves.
    pub mesh: SurfaceMesh,
    /// Closed-form sources at strength one.
    pub sources: Vec<Source>,
    /// What will solve for the charges.
    pub choice: Choice,
    /// Grains as they start; none where nothing is traced.
    pub ensemble: Ensemble,
}

/// Meshes the electrodes once, draws the grains, and checks that they can stand and start as they do.
///
/// # Errors
/// A solver that does not suit the electrodes, electrodes that touch at different voltages, shapes or mesh files that cannot be, grains that start inside a conductor,
/// a table that fits in no memory.
pub fn ready(case: &Case, source: &CaseSource, reporter: &dyn Reporter) -> Result<Ready, Failure> {
    reporter.stage("mesh");
    let mut choice = choose(case, source)?;
    let sources = drives::sources(case, source)?;
    let mut electrodes = Electrodes::new(case, source, reporter)?;
    let mesh = electrodes.mesh(case, source, 1.0, 1.0)?;
    check_ground(&mesh, case, source)?;
    let curved = choice.elements == Elements::Curved;
    let joined = check_contacts(&electrodes, curved, &mesh, case, source, reporter)?;
    if let Some(names) = joined.filter(|_| curved) {
        choice = of_joined(case, source, names)?;
    }
    if choice.elements != Elements::Curved {
        electrodes.emphasise_gaps(case, &mesh, reporter);
    }
    check_table(case, source, &mesh, &sources)?;
    let tree = SurfaceTree::new(&mesh);
    check_sources(case, source, &tree)?;
    let ensemble = match &case.trace {
        Some(settings) => flights::ensemble(case, settings, source)?,
        None => Ensemble::new(),
    };
    let bounds = flight_region(case, &mesh);
    check_starts(case, source, &ensemble, &tree, &sources, &bounds)?;
    check_apart(case, source, &ensemble)?;
    Ok(Ready { electrodes, mesh, sources, choice, ensemble })
}

/// Refuses grains that repel each other and start in one place: the force between them has no direction and no end.
fn check_apart(case: &Case, source: &CaseSource, ensemble: &Ensemble) -> Result<(), Failure> {
    if !case.forces.coulomb {
        return Ok(());
    }
    let at = |grain: usize| -> [f64; 3] { ensemble.positions()[grain].into() };
    let mut order: Vec<usize> = (0..ensemble.len()).collect();
    let compare = |a: &usize, b: &usize| at(*a).partial_cmp(&at(*b)).unwrap_or(std::cmp::Ordering::Equal);
    order.sort_by(compare);
    let Some(pair) = order.windows(2).find(|pair| at(pair[0]) == at(pair[1])) else { return Ok(()) };
    let (group, [x, y, z]) = (&case.grains[ensemble.groups()[pair[1]] as usize].name, at(pair[0]));
    let problem =
        format!("two grains start in one place, ({x:.4}, {y:.4}, {z:.4}) m, and repel each other without end");
    let help = "move them apart, or leave out `coulomb`";
    Err(source.error_at(&format!("grains.{group}.place"), problem, help).into())
}

/// The region in which grains are followed.
pub fn flight_region(case: &Case, mesh: &SurfaceMesh) -> Region {
    let bounds = region::flight_box(case, mesh);
    Region { min: bounds.min, max: bounds.max }
}

/// Checks the starts again on the surface that is solved and struck: it is a little elsewhere than the first one.
///
/// # Errors
/// As [`ready`].
pub fn check_starts_again(
    case: &Case,
    source: &CaseSource,
    ready: &Ready,
    basis: &ElectrodeBasis,
) -> Result<(), Failure> {
    if ready.ensemble.is_empty() {
        return Ok(());
    }
    let bounds = flight_region(case, &basis.mesh);
    check_starts(case, source, &ready.ensemble, &SurfaceTree::new(&basis.mesh), &ready.sources, &bounds)
}

/// Memory that a table may take when the case does not say, and no more than half of what is free: beyond this, finer cells
/// cost more in caches than they gain.
const USUAL_BYTES: u64 = 1 << 29;

/// Memory that the table of a case may take.
pub fn table_memory(case: &Case) -> u64 {
    let free = memory::available();
    match (case.table.max_memory, case.table.spacing) {
        (Some(bytes), _) => bytes.min(free),
        // Asked for outright: all that can be had.
        (None, Some(_)) => free / 10 * 9,
        (None, None) => USUAL_BYTES.min(free / 2),
    }
}

/// Refuses point charges in metal: there is no field for them to make.
fn check_sources(case: &Case, source: &CaseSource, tree: &SurfaceTree) -> Result<(), Failure> {
    for point in case.sources.iter().filter(|s| matches!(s.kind, SourceKind::Point)) {
        if let Some(electrode) = tree.inside(&point.placement.center) {
            let problem = format!("it lies inside the conductor `{}`", case.electrodes[electrode].name);
            let help = "move it; if the electrode is a chamber around it, give that hollow = true";
            return Err(source.error_at(&format!("source.{}.center", point.name), problem, help).into());
        }
    }
    let Some(plane) = &case.field.ground else { return Ok(()) };
    for field in &case.sources {
        // How far below its centre it reaches; the others are everywhere.
        let depth = match field.kind {
            SourceKind::Point => 0.0,
            SourceKind::ThinRing { radius } => {
                let axis = field.placement.axis.try_normalize(0.0).unwrap_or_else(Vec3::z);
                radius * axis.cross(&plane.normal).norm()
            }
            SourceKind::Quadrupole { .. } | SourceKind::Uniform { .. } => continue,
        };
        if plane.height(&field.placement.center) <= depth {
            let problem = format!("it lies on or below the grounded plane `{GROUND}`");
            let help = "move it up, or the plane down (field.ground.center)";
            return Err(source.error_at(&format!("source.{}.center", field.name), problem, help).into());
        }
    }
    Ok(())
}

/// Refuses a table whose spacing is given and that cannot fit.
fn check_table(case: &Case, source: &CaseSource, mesh: &SurfaceMesh, sources: &[Source]) -> Result<(), Failure> {
    let Some(spacing) = case.table.spacing else { return Ok(()) };
    let bounds = region::table_box(case, mesh);
    let functions = mesh.electrodes.len() + sources.len();
    let available = table_memory(case);
    let needed = |spacing: f64| {
        let bricks = PotentialTable::bricks_for(bounds.min, bounds.max, spacing);
        let smooth = many_coupled_flights(case);
        (bricks.nodes(), PotentialTable::bytes_while_filling(&bricks, functions, case.table.accuracy, smooth))
    };
    let (nodes, bytes) = needed(spacing);
    if bytes <= available {
        return Ok(());
    }
    let mut fits = spacing;
    while needed(fits).1 > available && fits < (bounds.max - bounds.min).max() {
        fits *= 1.05;
    }
    Err(table_too_large(case, source, nodes as u64, functions, bytes, available, fits))
}

/// The error of a table that does not fit.
pub(super) fn table_too_large(
    case: &Case,
    source: &CaseSource,
    nodes: u64,
    functions: usize,
    needed: u64,
    available: u64,
    fits: f64,
) -> Failure {
    let key = if case.table.spacing.is_some() { "table.spacing" } else { "table.max_memory" };
    // Beyond a thousand millions nobody reads digits, and the largest count is not exact.
    let count = if nodes < 1_000_000_000 { nodes.to_string() } else { format!("{:.0e}", nodes as f64) };
    let problem = format!(
        "a table of {count} nodes for {functions} electrodes and sources needs {} of memory, and {} may be used",
        memory::people(needed),
        memory::people(available)
    );
    let help = format!("a spacing of {fits:.2e} m would fit; or make the box smaller (table.min, table.max)");
    source.error_at(key, problem, help).into()
}

/// Refuses grains that start where they cannot be: inside a conductor, below the grounded plane, outside the region, or on a source.
///
/// # Errors
/// Names the group, how many of its grains, and where.
pub fn check_starts(
    case: &Case,
    source: &CaseSource,
    ensemble: &Ensemble,
    tree: &SurfaceTree,
    fields: &[Source],
    region: &Region,
) -> Result<(), Failure> {
    for (number, group) in case.grains.iter().enumerate() {
        let members = (0..ensemble.len()).filter(|&g| ensemble.groups()[g] as usize == number);
        let (mut inside, mut outside, mut below) = (Vec::new(), Vec::new(), Vec::new());
        for g in members {
            let p = &ensemble.positions()[g];
            if let Some(electrode) = tree.inside(p) {
                inside.push((g, electrode));
            } else if case.field.ground.is_some_and(|plane| plane.height(p) <= 0.0) {
                below.push(g);
            } else if (0..3).any(|k| p[k] < region.min[k] || p[k] > region.max[k]) {
                outside.push(g);
            } else if let Some(s) = fields.iter().position(|s| s.is_singular_at(p)) {
                let name = &case.sources[s].name;
                let problem = format!("a grain starts on the source `{name}`, where its field is infinite");
                let key = format!("grains.{}.place", group.name);
                return Err(source.error_at(&key, problem, "move the grains or the source").into());
            }
        }
        let place = |g: usize| {
            let p = &ensemble.positions()[g];
            format!("({:.4}, {:.4}, {:.4}) m", p.x, p.y, p.z)
        };
        let of = |n: usize| {
            if group.count == 1 { "the grain starts".into() } else { format!("{n} of {} grains start", group.count) }
        };
        let key = format!("grains.{}.place", group.name);
        if let Some(&(g, electrode)) = inside.first() {
            let electrode = &case.electrodes[electrode].name;
            let problem = format!("{} inside the conductor `{electrode}`, one at {}", of(inside.len()), place(g));
            let help =
                "move or shrink the cloud; if the electrode is a chamber that grains fly in, give it hollow = true";
            return Err(source.error_at(&key, problem, help).into());
        }
        if let Some(&g) = below.first() {
            let problem = format!("{} on or below the grounded plane `{GROUND}`, one at {}", of(below.len()), place(g));
            let help = "move or shrink the cloud, or move the plane (field.ground.center)";
            return Err(source.error_at(&key, problem, help).into());
        }
        if let Some(&g) = outside.first() {
            let (lo, hi) = (region.min, region.max);
            let problem = format!(
                "{} outside the region ({:.3}, {:.3}, {:.3}) to ({:.3}, {:.3}, {:.3}) m, one at {}",
                of(outside.len()),
                lo.x,
                lo.y,
                lo.z,
                hi.x,
                hi.y,
                hi.z,
                place(g)
            );
            return Err(source.error_at(&key, problem, "move the cloud, or enlarge trace.region").into());
        }
    }
    Ok(())
}
