//! The flights of a case's grains.

use std::sync::Arc;
use std::time::Instant;

use field::DrivenField;
use meshes::SurfaceTree;
use tracer::{
    DragLaw, Ensemble, Gas, GasKind, Group, Method, Options, Region, Sample, System, TraceError, Traced, Trajectories,
    trace,
};

use super::{Failure, Reporter, memory};
use crate::CaseSource;
use crate::case::{Case, Drag, Gas as CaseGas, Integrator, Reflection, TraceSettings};

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
    /// Where grains were followed.
    pub region: Region,
    /// s.
    pub seconds: f64,
}

/// Samples of a flight when the case does not say, unless RF asks for more.
const SAMPLES: f64 = 500.0;

/// Samples to an RF period that show the micromotion, and the most samples that are taken for it.
const SAMPLES_PER_PERIOD: f64 = 20.0;
const MOST_SAMPLES: f64 = 4000.0;

/// Steps of the default integrator err by at most this fraction of the accuracy asked of the trajectories: errors add up over
/// some thousand steps (measured: 1e-8 after a hundred RF periods at 1e-9).
const STEP_SHARE: f64 = 1e-3;

/// Draws the grains of a case.
///
/// # Errors
/// A group that cannot be drawn.
pub fn ensemble(case: &Case, settings: &TraceSettings, source: &CaseSource) -> Result<Ensemble, Failure> {
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
pub fn system(case: &Case, field: DrivenField, surface: Option<Arc<SurfaceTree>>, region: Region) -> System {
    let mut system = System::new()
        .with_field(field)
        .with_gravity(case.forces.gravity)
        .with_constant_force(case.forces.constant)
        .with_magnetic_field(case.forces.magnetic_field)
        .with_region(region);
    if case.forces.coulomb {
        system = system.with_coulomb();
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

/// Traces the grains of a case.
///
/// # Errors
/// An integrator that cannot do what the forces ask, a tolerance that cannot be reached.
#[allow(clippy::too_many_arguments)]
pub fn fly(
    case: &Case,
    settings: &TraceSettings,
    source: &CaseSource,
    field: DrivenField,
    surface: Option<Arc<SurfaceTree>>,
    ensemble: &Ensemble,
    region: Region,
    reporter: &Arc<dyn Reporter>,
) -> Result<Flights, Failure> {
    reporter.stage("trace");
    let start = Instant::now();
    let every = sampling(case, settings, &field);
    let system = system(case, field, surface, region);
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
        },
        start: settings.start,
        duration: settings.duration,
        tolerance: (STEP_SHARE * settings.accuracy).clamp(1e-13, 1e-3),
        step: settings.step,
        every: Some(every),
        seed: settings.seed,
        progress: Some(Arc::new(move |done| listener.fraction(done))),
        ..Options::default()
    };
    // A quarter of what is free, and no more than a gigabyte: beyond that files are too large to look at.
    let limit = (memory::available() / 4).min(1 << 30) as usize;
    let observer = Trajectories::with_limit(limit);
    let traced = trace(&system, ensemble, &options, &observer).map_err(|error| explained(error, source))?;
    let stride = observer.stride();
    if stride > 1 {
        reporter.warning(&format!(
            "the tracks are too long to keep: one sample in {stride} is written. Raise output.every"
        ));
    }
    let samples = observer.into_samples();
    Ok(Flights { traced, samples, stride, every, region, seconds: start.elapsed().as_secs_f64() })
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
    }
}
