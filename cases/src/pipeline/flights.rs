//! The flights of a case's grains.

use std::sync::Arc;
use std::time::Instant;

use field::{DrivenField, Induction, Plane};
use meshes::{ElectrodeSurface, SurfaceMesh, SurfaceTree, Vec3};
use tracer::{
    DragLaw, Ensemble, Gas, GasKind, Group, ImageCharge, Journal, Method, Options, Region, Sample, Standing, System,
    TraceError, Traced, Trajectories, trace,
};

use super::surface::Electrodes;
use super::{Failure, Reporter, memory};
use crate::CaseSource;
use crate::case::{Case, Drag, Drive, GROUND, Gas as CaseGas, Integrator, Reflection, TraceSettings};

/// Traced grains and what was kept of their ways.
#[derive(Clone, Debug)]
pub struct Flights {
    /// Ends and counts.
    pub traced: Traced,
    /// Samples of each grain, in the order of the ensemble; every `stride`-th was kept.
    pub samples: Vec<Vec<Sample>>,
    /// One sample in how many was kept.
    pub stride: usize,
    /// Time between samples before thinning, s.
    pub every: f64,
    /// Of the fastest voltage, s; zero where all are constant.
    pub period: f64,
    /// Where grains were followed.
    pub region: Region,
    /// s.
    pub seconds: f64,
}

/// Where flights begin that an earlier run left, and where it is kept how they stand.
pub struct Kept {
    /// The keeper.
    pub journal: Arc<dyn Journal>,
    /// Where the grains stood.
    pub standing: Option<Arc<Standing>>,
}

/// Samples of a flight when the case does not say, unless RF asks for more.
const SAMPLES: f64 = 500.0;

/// Samples to an RF period that show the micromotion, and the most samples that are taken for it.
const SAMPLES_PER_PERIOD: f64 = 20.0;
const MOST_SAMPLES: f64 = 4000.0;

/// Steps of the default integrator err by at most this fraction of the accuracy asked of the trajectories: errors add up over
/// some thousand steps (measured: 1e-8 after a hundred RF periods at 1e-9).
const STEP_SHARE: f64 = 1e-3;

/// Samples of one grain beyond which none can be kept, and taking them takes minutes.
const MOST_SAMPLES_OF_A_GRAIN: f64 = 1e8;

/// Periods or steps of one flight from which on a person is told that it takes long: a minute at a few million steps a second
/// for the simplest forces.
const MANY_STEPS: f64 = 1e7;

/// Steps beyond which each is lost in the rounding of the time.
const MOST_STEPS: f64 = 1e15;

/// Bytes that a grain takes while it is traced: its state, its coefficients between steps, its ending, its first and last
/// sample.
const BYTES_OF_A_GRAIN: u64 = 1000;

/// Refuses more grains than fit in memory, and times between samples or steps that no run comes to the end of.
///
/// # Errors
/// Names the key that asks for so much.
fn check_amounts(case: &Case, settings: &TraceSettings, source: &CaseSource) -> Result<(), Failure> {
    let count = case.grains.iter().fold(0_u64, |sum, group| sum.saturating_add(group.count as u64));
    let (needed, free) = (count.saturating_mul(BYTES_OF_A_GRAIN), memory::available());
    if let Some(largest) = case.grains.iter().max_by_key(|group| group.count).filter(|_| needed > free) {
        let (needed, free) = (memory::people(needed), memory::people(free));
        let problem = format!("{count} grains need some {needed} of memory, and {free} are free");
        return Err(source.error_at(&format!("grains.{}.count", largest.name), problem, "trace fewer grains").into());
    }
    if let Some(every) = case.output.every.filter(|every| settings.duration / every > MOST_SAMPLES_OF_A_GRAIN) {
        let samples = settings.duration / every;
        let problem = format!("{samples:.0e} samples of each grain are more than can be kept");
        let help = format!("sample every {:.0e} s or more, or trace for a shorter time", settings.duration / 1e6);
        return Err(source.error_at("output.every", problem, help).into());
    }
    if let Some(step) = settings.step.filter(|step| settings.duration / step > MOST_STEPS) {
        let problem =
            format!("{:.0e} steps in the duration: each is lost in the rounding of the time", settings.duration / step);
        return Err(source.error_at("trace.step", problem, "take longer steps, or leave out `step`").into());
    }
    Ok(())
}

/// Tells when a flight has so many steps that it takes long.
fn warn_of_long_flights(settings: &TraceSettings, field: &DrivenField, reporter: &dyn Reporter) {
    let periods = field.shortest_period().map_or(0.0, |period| settings.duration / period);
    if periods > MANY_STEPS {
        reporter.warning(&format!(
            "the duration holds {periods:.0e} periods of the fastest voltage, with ten steps and more in each: this takes long. Is trace.duration meant, and the frequency?"
        ));
    }
    let steps = settings.step.map_or(0.0, |step| settings.duration / step);
    if steps > MANY_STEPS {
        reporter.warning(&format!("{steps:.0e} steps of each grain take long. Is trace.step meant?"));
    }
}

/// Draws the grains of a case.
///
/// # Errors
/// A group that cannot be drawn, more grains or samples than can be.
pub fn ensemble(case: &Case, settings: &TraceSettings, source: &CaseSource) -> Result<Ensemble, Failure> {
    check_amounts(case, settings, source)?;
    let mut ensemble = Ensemble::new();
    for (number, group) in case.grains.iter().enumerate() {
        let drawn = Group {
            count: group.count,
            charge: group.charge,
            mass: group.mass,
            radius: group.radius,
            place: group.place.clone(),
            launch: group.launch.clone(),
        };
        ensemble.add_group(number as u32, &drawn, settings.seed).map_err(|error| {
            source.error_at(&format!("grains.{}", group.name), error.to_string(), "change this group")
        })?;
    }
    Ok(ensemble)
}

/// Time between samples: the case's, or such that flights have some hundred samples and RF periods a score.
pub fn sampling(case: &Case, settings: &TraceSettings, field: &DrivenField) -> f64 {
    case.output.every.unwrap_or_else(|| {
        let wanted = field
            .shortest_period()
            .map_or(SAMPLES, |period| (settings.duration / period * SAMPLES_PER_PERIOD).clamp(SAMPLES, MOST_SAMPLES));
        settings.duration / wanted
    })
}

/// Everything that acts on the grains.
///
/// # Errors
/// None of its own; drags that cannot be told are found by the tracer.
pub fn system(
    case: &Case,
    field: DrivenField,
    induction: Option<Arc<Induction>>,
    surface: Option<Arc<SurfaceTree>>,
    region: Region,
) -> System {
    let mut system = System::new()
        .with_field(field)
        .with_gravity(case.forces.gravity)
        .with_constant_force(case.forces.constant)
        .with_magnetic_field(case.forces.magnetic_field)
        .with_region(region);
    if case.forces.coulomb {
        let accuracy = case.forces.coulomb_accuracy.or(case.trace.as_ref().map(|settings| settings.accuracy));
        system = match accuracy {
            Some(accuracy) => system.with_coulomb_to(accuracy),
            None => system.with_coulomb(),
        };
    }
    if let Some(induction) = induction {
        system = system.with_force(ImageCharge { induction });
    }
    if let Some(drag) = drag(&case.forces.drag) {
        system = system.with_drag(drag);
    }
    if let Some(temperature) = case.forces.langevin {
        system = system.with_noise(temperature);
    }
    if let Some(surface) = surface {
        system = system.with_surface(surface);
    }
    system
}

fn drag(drag: &Drag) -> Option<tracer::Drag> {
    let gas = |kind: CaseGas, pressure: f64, temperature: f64| {
        let kind = match kind {
            CaseGas::Air => GasKind::Air,
            CaseGas::Hydrogen => GasKind::Hydrogen,
            CaseGas::Helium => GasKind::Helium,
            CaseGas::Neon => GasKind::Neon,
            CaseGas::Nitrogen => GasKind::Nitrogen,
            CaseGas::Oxygen => GasKind::Oxygen,
            CaseGas::Argon => GasKind::Argon,
            CaseGas::CarbonDioxide => GasKind::CarbonDioxide,
            CaseGas::Krypton => GasKind::Krypton,
            CaseGas::Xenon => GasKind::Xenon,
        };
        Gas::new(kind, pressure, temperature)
    };
    Some(match *drag {
        Drag::None => return None,
        Drag::Rate(rate) => tracer::Drag::Rate(rate),
        Drag::Coefficient(c) => tracer::Drag::Coefficient(c),
        Drag::Stokes { gas: kind, pressure, temperature } => {
            tracer::Drag::Sphere { gas: gas(kind, pressure, temperature), law: DragLaw::Stokes }
        }
        Drag::Epstein { gas: kind, pressure, temperature, reflection } => {
            let law = match reflection {
                Reflection::Specular => DragLaw::EpsteinSpecular,
                Reflection::Diffuse => DragLaw::EpsteinDiffuse,
            };
            tracer::Drag::Sphere { gas: gas(kind, pressure, temperature), law }
        }
    })
}

/// Panels on which grains induce charges: a tenth of a second to invert, about a millisecond each time a few grains are to be
/// told their force, and errors of some thousandths from two panels' width on. With 2000 the three grains of two_rings, which
/// take 64 000 of these, fly for 157 s on two cores.
const INDUCTION_PANELS: usize = 1000;

/// Imported meshes cannot be made coarser; beyond this each step takes a good part of a second.
const MOST_INDUCTION_PANELS: usize = 12_000;

/// The electrodes as they answer to the grains' charges, if the case asks for it.
///
/// # Errors
/// Meshes that are too fine, electrodes that lie on each other.
pub fn induction(
    case: &Case,
    source: &CaseSource,
    electrodes: &Electrodes,
    reporter: &dyn Reporter,
) -> Result<Option<Arc<Induction>>, Failure> {
    if !case.forces.image_charge {
        return Ok(None);
    }
    reporter.stage("induced charges");
    let mesh = match case.electrodes.is_empty() {
        true => SurfaceMesh::assemble([]),
        false => {
            let fineness = electrodes.fineness_for(case, source, INDUCTION_PANELS)?;
            electrodes.mesh(case, source, fineness, 1.0)?
        }
    };
    let (needed, free) = (Induction::memory_needed(mesh.panels()), memory::available());
    if mesh.panels() > MOST_INDUCTION_PANELS || needed > free {
        let (count, needed, free) = (mesh.panels(), memory::people(needed), memory::people(free));
        let problem = format!(
            "charges on {count} panels are too many to follow the grains (at most {MOST_INDUCTION_PANELS}; they need {needed} of memory, and {free} are free)"
        );
        let help = "give the electrodes as shapes or as coarser meshes, or leave out `image_charge`";
        return Err(source.error_at("forces.image_charge", problem, help).into());
    }
    let floating: Vec<bool> = case.electrodes.iter().map(|e| matches!(e.drive, Drive::Charge(_))).collect();
    let induction = Induction::new(&mesh, case.field.ground, &floating).map_err(|error| {
        let help = "look at the electrodes with `graintrap mesh`, or leave out `image_charge`";
        source.error_at("forces.image_charge", error.to_string(), help)
    })?;
    Ok(Some(Arc::new(induction)))
}

/// What grains strike: the electrodes and, as one more, so much of a grounded plane as lies in the region. `None` where there
/// is nothing.
pub fn obstacles(mesh: &SurfaceMesh, ground: Option<&Plane>, region: &Region) -> Option<Arc<SurfaceTree>> {
    let Some(plane) = ground else { return (mesh.panels() > 0).then(|| Arc::new(SurfaceTree::new(mesh))) };
    let mut mesh = mesh.clone();
    let middle = (region.min + region.max) * 0.5;
    let foot = middle - plane.normal * plane.height(&middle);
    let across = plane.normal.cross(&Vec3::ith(plane.normal.iamin(), 1.0)).normalize();
    let along = plane.normal.cross(&across);
    // From the foot point the region reaches half its diagonal in the plane; twice that.
    let reach = (region.max - region.min).norm();
    let first = mesh.vertices.len() as u32;
    let corners = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
    mesh.vertices.extend(corners.map(|(a, b)| foot + across * (2.0 * a * reach) + along * (2.0 * b * reach)));
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh.electrode.extend([mesh.electrodes.len() as u32; 2]);
    mesh.electrodes.push(ElectrodeSurface { name: GROUND.to_owned(), closed: false, hollow: false });
    Some(Arc::new(SurfaceTree::new(&mesh)))
}

/// Traces the grains of a case. `forces`: samples hold forces and energies, too.
///
/// # Errors
/// An integrator that cannot do what the forces ask, a tolerance that cannot be reached.
#[allow(clippy::too_many_arguments)]
pub fn fly(
    case: &Case,
    settings: &TraceSettings,
    source: &CaseSource,
    field: DrivenField,
    induction: Option<Arc<Induction>>,
    surface: Option<Arc<SurfaceTree>>,
    ensemble: &Ensemble,
    region: Region,
    forces: bool,
    kept: Option<Kept>,
    reporter: &Arc<dyn Reporter>,
) -> Result<Flights, Failure> {
    reporter.stage("trace");
    let start = Instant::now();
    let every = sampling(case, settings, &field);
    let period = field.shortest_period().unwrap_or(0.0);
    warn_of_long_flights(settings, &field, &**reporter);
    // A quarter of what is free, and no more than a gigabyte: beyond that files are too large to look at.
    let limit = (memory::available() / 4).min(1 << 30) as usize;
    // A checkpoint holds all samples, those that are left out of the tracks with them: where these are too many, so are those.
    let samples = ensemble.len() as f64 * (settings.duration / every);
    let (journal, standing) = kept.map_or((None, None), |kept| (Some(kept.journal), kept.standing));
    let journal = journal.filter(|_| samples * size_of::<Sample>() as f64 <= limit as f64);
    let system = system(case, field, induction, surface, region);
    let listener = Arc::clone(reporter);
    let options = Options {
        method: match settings.integrator {
            Integrator::Auto => Method::Auto,
            Integrator::Dop853 => Method::Dop853,
            Integrator::Verlet => Method::Verlet,
            Integrator::Boris => Method::Boris,
            Integrator::Langevin => Method::Langevin,
            Integrator::Symplectic4 => Method::BlanesMoan4,
            Integrator::Symplectic6 => Method::BlanesMoan6,
            Integrator::Stoermer12 => Method::Stoermer12,
            Integrator::Stoermer => Method::Stoermer,
        },
        start: settings.start,
        duration: settings.duration,
        tolerance: (STEP_SHARE * settings.accuracy).clamp(1e-13, 1e-3),
        step: settings.step,
        every: Some(every),
        forces,
        seed: settings.seed,
        journal,
        resume: standing,
        progress: Some(Arc::new(move |done| listener.fraction(done))),
        ..Options::default()
    };
    let observer = Trajectories::with_limit(limit);
    let traced = trace(&system, ensemble, &options, &observer).map_err(|error| explained(error, source))?;
    let stride = observer.stride();
    if stride > 1 {
        reporter.warning(&format!(
            "the tracks are too long to keep: one sample in {stride} is written, and no checkpoint. Raise output.every"
        ));
    }
    let samples = observer.into_samples();
    if let Some(grain) = samples.iter().position(Vec::is_empty) {
        let group = &case.grains[ensemble.groups()[grain] as usize].name;
        let problem = format!("grain {grain} cannot start: the force on it is beyond any number");
        let help = "look for a charge, a voltage or a mass that is off by many powers of ten";
        return Err(source.error_at(&format!("grains.{group}"), problem, help).into());
    }
    Ok(Flights { traced, samples, stride, every, period, region, seconds: start.elapsed().as_secs_f64() })
}

fn explained(error: TraceError, source: &CaseSource) -> Failure {
    let text = error.to_string();
    match error {
        TraceError::Option { option, .. } => {
            let key = match option {
                "noise temperature" => "forces.langevin".to_string(),
                "tolerance" => "trace.accuracy".to_string(),
                option => format!("trace.{option}"),
            };
            source.error_at(&key, text, "change it").into()
        }
        TraceError::Method { advice, .. } => source.error_at("trace.integrator", text, advice).into(),
        TraceError::Drag { .. } => source.error_at("forces.drag", text, "change the drag or the grain's radius").into(),
        TraceError::StepUnderflow { advice, .. } => Failure::run(text, advice),
        TraceError::Journal(_) => Failure::run(text, "make room on the disk, or write elsewhere with -o DIR"),
        TraceError::Resume { .. } => Failure::usage(text, "start anew, without --resume"),
    }
}
