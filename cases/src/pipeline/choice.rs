//! Which solver a case is solved by, and on what its charges sit: the one place where that is decided.

use meshes::{Placement, Shape, Vec3, revolved};
use serde::{Deserialize, Serialize};

use super::Failure;
use crate::case::{Case, Electrode, ElectrodeShape, Method, Solver as Asked, SourceKind};
use crate::{CaseError, CaseSource};

/// What solves for the charges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Solver {
    /// The whole matrix.
    Dense,
    /// The whole matrix, reduced by symmetry.
    Symmetric,
    /// Charge along generating curves.
    Axisymmetric,
    /// Without a matrix.
    Multipole,
}

impl Solver {
    /// As in a case file and in summaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dense => "dense",
            Self::Symmetric => "symmetric",
            Self::Axisymmetric => "axisymmetric",
            Self::Multipole => "multipole",
        }
    }
}

/// What the charges sit on and how the boundary condition is imposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Elements {
    /// Constant charge on flat triangles, on average over each.
    Galerkin,
    /// Constant charge on flat triangles, at the centre of each.
    Collocation,
    /// Charge of high order on the true surface.
    Curved,
}

impl Elements {
    /// As in a case file and in summaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Galerkin => "galerkin",
            Self::Collocation => "collocation",
            Self::Curved => "curved",
        }
    }
}

/// How a case is solved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Choice {
    /// By what.
    pub solver: Solver,
    /// On what.
    pub elements: Elements,
    /// Why, in a sentence for people.
    pub why: String,
}

/// Decides how a case is solved.
///
/// # Errors
/// A solver or elements that the electrodes do not admit, at the key that asks for them.
pub fn choose(case: &Case, source: &CaseSource) -> Result<Choice, Failure> {
    let refused = |key: &str, problem: String, help: &str| -> Failure { source.error_at(key, problem, help).into() };
    let (solver, method) = (case.field.solver, case.field.method);
    if case.electrodes.is_empty() {
        let why = "there are no electrodes, and sources are in closed form".to_owned();
        return Ok(Choice { solver: Solver::Dense, elements: Elements::Galerkin, why });
    }
    if method == Method::Curved
        && let Some(electrode) = case.electrodes.iter().find(|e| matches!(e.shape, ElectrodeShape::Imported(_)))
    {
        let problem = format!(
            "\"curved\" needs the true surface of every electrode, and of `{}` only triangles are known",
            electrode.name
        );
        return Err(refused("field.method", problem, "write method = \"galerkin\", or leave it out"));
    }
    if solver == Asked::Axisymmetric {
        check_axisymmetric(case, source)?;
    }
    if method == Method::Collocation && matches!(solver, Asked::Axisymmetric | Asked::Multipole) {
        let problem = format!("\"collocation\" needs a matrix, and solver = \"{}\" has none", asked_name(solver));
        return Err(refused("field.method", problem, "write solver = \"dense\", or leave out `method`"));
    }
    if method == Method::Galerkin && solver == Asked::Axisymmetric {
        let problem = "\"galerkin\" is for flat triangles, and solver = \"axisymmetric\" has curves".to_owned();
        return Err(refused("field.method", problem, "leave out `method`, or choose another solver"));
    }
    let panels = case.field.panels.is_some() || case.electrodes.iter().any(|e| e.panels.is_some());
    let flat = flat_only(case);
    if let (Method::Curved, Some(electrode)) = (method, flat) {
        let problem = format!("\"curved\" does not know the true surface of `{electrode}` yet, only its triangles");
        return Err(refused("field.method", problem, "write method = \"galerkin\", or leave it out"));
    }
    let (elements, because) = match (method, solver) {
        (Method::Curved, _) => (Elements::Curved, "the case asks for curved elements"),
        (Method::Auto, Asked::Axisymmetric) => (Elements::Curved, "curves are what it solves on"),
        (Method::Collocation | Method::Galerkin, _) => {
            let method = if method == Method::Galerkin { Elements::Galerkin } else { Elements::Collocation };
            (method, "the case asks for flat panels")
        }
        (Method::Auto, _) if panels => (Elements::Galerkin, "the case says how many panels there are"),
        (Method::Auto, _) if flat.is_some() => (Elements::Galerkin, "of some electrode only triangles are known"),
        (Method::Auto, _) => (Elements::Curved, "the true surface of every electrode is known"),
    };
    if case.field.ground.is_some() && solver == Asked::Multipole && elements != Elements::Curved {
        let help = "leave it out, or leave out `ground` and put a large electrode there";
        let problem = format!("\"{}\" knows no grounded plane with flat panels", asked_name(solver));
        return Err(refused("field.solver", problem, help));
    }
    let (solver, why) = match solver {
        Asked::Auto if elements == Elements::Curved && check_axisymmetric(case, source).is_ok() => {
            (Solver::Axisymmetric, "everything is round about one axis")
        }
        Asked::Auto if elements == Elements::Curved => (Solver::Symmetric, because),
        Asked::Auto => (Solver::Dense, because),
        Asked::Dense => (Solver::Dense, "the case asks for it"),
        Asked::Symmetric => (Solver::Symmetric, "the case asks for it"),
        Asked::Axisymmetric => (Solver::Axisymmetric, "the case asks for it"),
        Asked::Multipole => (Solver::Multipole, "the case asks for it"),
    };
    let choice = Choice { solver, elements, why: why.to_owned() };
    connected(&choice, source)?;
    Ok(choice)
}

/// What solves for electrodes that touch or cut each other where curved elements would be chosen: charge grows without bound where
/// smooth surfaces meet, in the midst of elements, and no refinement of these comes to an end.
///
/// # Errors
/// The case insists on curved elements.
pub fn of_joined(case: &Case, source: &CaseSource, [one, other]: [&str; 2]) -> Result<Choice, Failure> {
    let key = if case.field.method == Method::Curved { "field.method" } else { "field.solver" };
    let solver = match (case.field.method, case.field.solver) {
        (Method::Auto, Asked::Auto | Asked::Dense) => Solver::Dense,
        (Method::Auto, Asked::Symmetric) => Solver::Symmetric,
        (Method::Auto, Asked::Multipole) => Solver::Multipole,
        _ => {
            let problem =
                format!("`{one}` and `{other}` touch or cut each other, and curved elements must stand apart");
            return Err(source.error_at(key, problem, "leave it out, or move them apart").into());
        }
    };
    let choice =
        Choice { solver, elements: Elements::Galerkin, why: format!("`{one}` and `{other}` touch or cut each other") };
    connected(&choice, source)?;
    Ok(choice)
}

/// An electrode of which only triangles are known.
fn flat_only(case: &Case) -> Option<&str> {
    let smooth =
        |shape: &ElectrodeShape| matches!(shape, ElectrodeShape::Shape(shape) if meshes::patches(shape).is_some());
    case.electrodes.iter().find(|e| !smooth(&e.shape)).map(|e| e.name.as_str())
}

fn asked_name(solver: Asked) -> &'static str {
    match solver {
        Asked::Auto => "auto",
        Asked::Dense => Solver::Dense.name(),
        Asked::Symmetric => Solver::Symmetric.name(),
        Asked::Axisymmetric => Solver::Axisymmetric.name(),
        Asked::Multipole => Solver::Multipole.name(),
    }
}

/// Refuses what `solution::solve` cannot do yet. Whoever connects a solver there takes it out here.
fn connected(choice: &Choice, source: &CaseSource) -> Result<(), CaseError> {
    let help = "leave it out";
    let connected = match choice.elements {
        Elements::Curved => true,
        Elements::Galerkin => choice.solver != Solver::Axisymmetric,
        Elements::Collocation => matches!(choice.solver, Solver::Dense | Solver::Symmetric),
    };
    if !connected {
        let problem = format!("\"{}\" does not go with {} elements", choice.solver.name(), choice.elements.name());
        return Err(source.error_at("field.solver", problem, help));
    }
    Ok(())
}

/// Refuses electrodes and sources that are not round about one axis.
fn check_axisymmetric(case: &Case, source: &CaseSource) -> Result<(), CaseError> {
    let refused = |problem: String| {
        let help = "leave out `solver`, or move what stands beside the axis onto it";
        source.error_at("field.solver", format!("\"axisymmetric\" needs one axis for all: {problem}"), help)
    };
    let name = |e: usize| &case.electrodes[e].name;
    let axis = axis_of(&case.electrodes).map_err(|off| {
        refused(match off {
            OffAxis::NotRevolved { electrode } => format!("`{}` is not round about any", name(electrode)),
            OffAxis::Elsewhere { electrode, other: Some(other) } => {
                format!("`{}` does not stand on that of `{}`", name(electrode), name(other))
            }
            OffAxis::Elsewhere { electrode, other: None } => {
                format!("the parts of `{}` stand on different ones", name(electrode))
            }
        })
    })?;
    let Some(axis) = axis else { return Ok(()) };
    if let Some(plane) = &case.field.ground
        && plane.normal.cross(&axis.direction).norm() > ON_AXIS
    {
        return Err(refused("the grounded plane does not stand across that of the electrodes".to_owned()));
    }
    for field in &case.sources {
        let along = |direction: &Vec3| direction.cross(&axis.direction).norm() <= ON_AXIS * direction.norm();
        let centred = axis.distance(&field.placement.center) <= ON_AXIS * axis.size;
        let round = match field.kind {
            SourceKind::Point => centred,
            SourceKind::Uniform { direction } => along(&direction),
            SourceKind::ThinRing { .. } => centred && along(&field.placement.axis),
            SourceKind::Quadrupole { dimensions, .. } => dimensions == 3 && centred && along(&field.placement.axis),
        };
        if !round {
            return Err(refused(format!("the source `{}` is not round about that of the electrodes", field.name)));
        }
    }
    Ok(())
}

/// The line that everything is round about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// A point on it, m.
    pub point: Vec3,
    /// Its direction, of length one.
    pub direction: Vec3,
    /// How far from `point` electrodes reach, m.
    pub size: f64,
}

impl Axis {
    /// Distance of a point from the line, m.
    pub fn distance(&self, point: &Vec3) -> f64 {
        (point - self.point).cross(&self.direction).norm()
    }
}

/// Why there is no common axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OffAxis {
    /// An electrode is no body of revolution.
    NotRevolved {
        /// Which.
        electrode: usize,
    },
    /// An electrode stands elsewhere.
    Elsewhere {
        /// Which.
        electrode: usize,
        /// The one that gave the axis; `None`: it is the same, made of bodies on several axes.
        other: Option<usize>,
    },
}

/// How far bodies may stand off a common axis, as a fraction of the extent of all electrodes: some thousand roundings of
/// coordinates, and far below what any accuracy notices.
const ON_AXIS: f64 = 1e-9;

/// A body of revolution in place.
struct Body {
    electrode: usize,
    center: Vec3,
    /// Of length one.
    axis: Vec3,
    /// How far it reaches from its centre, m.
    reach: f64,
    /// Round about every axis through its centre.
    sphere: bool,
}

/// The axis that all electrodes are round about; `None` where there is none to speak of, without electrodes.
///
/// Spheres are round about any line through their centres: they take the axis of the others, and two of them alone have the
/// line between them.
///
/// # Errors
/// Which electrode stands off it.
pub fn common_axis(electrodes: &[(&Shape, &Placement)]) -> Result<Option<Axis>, OffAxis> {
    let mut bodies: Vec<Body> = Vec::new();
    for (electrode, (shape, placement)) in electrodes.iter().enumerate() {
        let (Some(parts), Ok(frame)) = (revolved(shape), placement.frame()) else {
            return Err(OffAxis::NotRevolved { electrode });
        };
        let turned = |v: &Vec3| frame[0] * v.x + frame[1] * v.y + frame[2] * v.z;
        for part in parts {
            let points = part.profile.curves.iter().flat_map(|curve| (0..=8).map(|k| curve.at(f64::from(k) / 8.0).0));
            bodies.push(Body {
                electrode,
                center: placement.center + turned(&part.center),
                axis: turned(&part.frame[2]),
                reach: points.map(|p| p[0].hypot(p[1])).fold(0.0, f64::max),
                sphere: matches!(shape, Shape::Sphere { .. }),
            });
        }
    }
    let Some(leader) = bodies.iter().find(|body| !body.sphere).or(bodies.first()) else { return Ok(None) };
    let point = leader.center;
    let size = bodies.iter().map(|body| (body.center - point).norm() + body.reach).fold(0.0, f64::max);
    let off = ON_AXIS * size;
    let beside = || bodies.iter().map(|body| body.center - point).find(|arm| arm.norm() > off);
    let direction = if leader.sphere { beside().map_or(leader.axis, |arm| arm.normalize()) } else { leader.axis };
    let axis = Axis { point, direction, size };
    for body in &bodies {
        let tilted = !body.sphere && body.axis.cross(&direction).norm() * body.reach > off;
        if tilted || axis.distance(&body.center) > off {
            let other = (body.electrode != leader.electrode).then_some(leader.electrode);
            return Err(OffAxis::Elsewhere { electrode: body.electrode, other });
        }
    }
    Ok(Some(axis))
}

/// The same for the electrodes of a case; those from files are round about nothing.
///
/// # Errors
/// As [`common_axis`].
pub fn axis_of(electrodes: &[Electrode]) -> Result<Option<Axis>, OffAxis> {
    let placed = electrodes.iter().enumerate().map(|(electrode, e)| match &e.shape {
        ElectrodeShape::Shape(shape) => Ok((shape, &e.placement)),
        ElectrodeShape::Imported(_) => Err(OffAxis::NotRevolved { electrode }),
    });
    common_axis(&placed.collect::<Result<Vec<_>, _>>()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(center: [f64; 3], axis: [f64; 3]) -> Placement {
        Placement { center: center.into(), axis: axis.into(), up: None }
    }

    fn ring() -> Shape {
        Shape::Ring { radius: 1.0, wire_radius: 0.1 }
    }

    #[test]
    fn rings_on_one_line_have_an_axis_and_rings_beside_it_have_none() {
        let (shape, direction) = (ring(), [1.0, 2.0, -0.5]);
        let on = |s: f64| at([0.3 + s, 0.1 + 2.0 * s, -0.5 * s], direction);
        let (first, second, turned) = (on(0.0), on(3.0), at([0.3, 0.1, 0.0], [-1.0, -2.0, 0.5]));
        let axis = common_axis(&[(&shape, &first), (&shape, &second), (&shape, &turned)]).unwrap().unwrap();
        assert!(axis.direction.cross(&Vec3::from(direction)).norm() < 1e-14);
        assert!(axis.distance(&second.center) < 1e-14);

        let elsewhere = OffAxis::Elsewhere { electrode: 1, other: Some(0) };
        let aside = |by: f64| at([0.3 + by, 0.1, 0.0], direction);
        assert_eq!(common_axis(&[(&shape, &first), (&shape, &aside(1e-6))]), Err(elsewhere));
        // A rounding of the coordinates does not count.
        assert!(common_axis(&[(&shape, &first), (&shape, &aside(1e-11))]).is_ok());
        let tilted = at([0.3, 0.1, 0.0], [1.0, 2.0, -0.50001]);
        assert_eq!(common_axis(&[(&shape, &first), (&shape, &tilted)]), Err(elsewhere));
    }

    #[test]
    fn spheres_take_any_axis_through_their_centres() {
        let (ball, shape) = (Shape::Sphere { radius: 0.2 }, ring());
        let (here, there) = (Placement::default(), at([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]));
        let axis = common_axis(&[(&ball, &here), (&ball, &there)]).unwrap().unwrap();
        assert!((axis.direction - Vec3::new(1.0, 1.0, 0.0).normalize()).norm() < 1e-14);
        // The ring says where the axis is, wherever it stands in the list.
        assert!(common_axis(&[(&ball, &here), (&shape, &at([2.0, 0.0, 0.0], [1.0, 0.0, 0.0]))]).is_ok());
        let off = common_axis(&[(&ball, &there), (&shape, &here)]);
        assert_eq!(off, Err(OffAxis::Elsewhere { electrode: 0, other: Some(1) }));
        assert_eq!(common_axis(&[(&ball, &here)]).unwrap().unwrap().direction, Vec3::z());
        assert_eq!(common_axis(&[]), Ok(None));
    }

    #[test]
    fn plates_are_not_round_and_a_bent_wire_is_not() {
        let (shape, here) = (ring(), Placement::default());
        let plate = Shape::Plate { size: [1.0, 1.0], thickness: 0.0 };
        let round = common_axis(&[(&shape, &here), (&plate, &here)]);
        assert_eq!(round, Err(OffAxis::NotRevolved { electrode: 1 }));
        let along = |tip: Vec3| Shape::Wire { points: vec![Vec3::zeros(), tip], wire_radius: 0.01 };
        // A wire is round about itself, wherever its points lead.
        assert!(common_axis(&[(&shape, &here), (&along(Vec3::z()), &here)]).is_ok());
        let across = common_axis(&[(&shape, &here), (&along(Vec3::x()), &here)]);
        assert_eq!(across, Err(OffAxis::Elsewhere { electrode: 1, other: Some(0) }));
    }

    fn chosen(field: &str, more: &str) -> Result<Choice, String> {
        let ring = "[[electrode]]\nname = \"left\"\nshape = \"ring\"\nradius = 1\nwire_radius = 0.1\n";
        let text = format!("{ring}{more}\n[field]\n{field}\n");
        let (case, source) = Case::parse("case.toml", &text, &[]).unwrap();
        choose(&case, &source).map_err(|failure| failure.to_string())
    }

    #[test]
    fn what_the_case_asks_for_is_chosen_or_refused_at_its_key() {
        let auto = chosen("", "").unwrap();
        assert_eq!((auto.solver, auto.elements), (Solver::Axisymmetric, Elements::Curved));
        assert!(auto.why.contains("one axis"));
        let counted = chosen("panels = 500", "").unwrap();
        assert_eq!((counted.solver, counted.elements), (Solver::Dense, Elements::Galerkin));
        let plain = chosen("method = \"collocation\"", "").unwrap();
        assert_eq!((plain.solver, plain.elements), (Solver::Dense, Elements::Collocation));
        assert!(plain.why.contains("flat panels"), "{}", plain.why);
        let curved = chosen("solver = \"multipole\"\nmethod = \"curved\"", "").unwrap();
        assert_eq!((curved.solver, curved.elements), (Solver::Multipole, Elements::Curved));
        let surface = chosen("solver = \"multipole\"", "").unwrap();
        assert_eq!((surface.solver, surface.elements), (Solver::Multipole, Elements::Curved));
        let panels = chosen("solver = \"multipole\"\npanels = 500", "").unwrap();
        assert_eq!((panels.solver, panels.elements), (Solver::Multipole, Elements::Galerkin));

        let plate = "[[electrode]]\nname = \"plate\"\nshape = \"plate\"\nsize = [1, 1]\ncenter = [0, 0, 2]";
        let aside = "[[electrode]]\nname = \"aside\"\nshape = \"sphere\"\nradius = 0.1\ncenter = [3, 0, 0]";
        let point = "[[source]]\nname = \"spot\"\nkind = \"point\"\ncharge = \"1 fC\"\ncenter = [0.2, 0, 1]";
        let axisymmetric = "solver = \"axisymmetric\"";
        for (field, more, key, words) in [
            (axisymmetric, plate, "field.solver", "`plate` is not round"),
            (axisymmetric, aside, "field.solver", "`aside` does not stand on that of `left`"),
            (axisymmetric, point, "field.solver", "the source `spot`"),
            ("solver = \"axisymmetric\"\nmethod = \"galerkin\"", "", "field.method", "curves"),
            ("solver = \"multipole\"\nmethod = \"collocation\"", "", "field.method", "needs a matrix"),
        ] {
            let error = chosen(field, more).unwrap_err();
            assert!(error.contains(key) && error.contains(words), "{error}");
        }
    }
}
