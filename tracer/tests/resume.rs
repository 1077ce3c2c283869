//! Runs that were ended by force and go on from what was kept.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use meshes::Vec3;
use tracer::{
    Drag, Ensemble, Frame, Group, Journal, Launch, Method, Options, Place, Region, Standing, System, TraceError,
    Traced, Trajectories, trace,
};

/// Keeps every frame in memory, as if written and read back.
#[derive(Default)]
struct Frames(Mutex<Vec<Frame>>);

impl Journal for Frames {
    fn interval(&self) -> Duration {
        Duration::ZERO
    }

    fn keep(&self, frame: &Frame) -> Result<(), String> {
        self.0.lock().unwrap().push(frame.clone());
        Ok(())
    }
}

struct Full;

impl Journal for Full {
    fn interval(&self) -> Duration {
        Duration::ZERO
    }

    fn keep(&self, _: &Frame) -> Result<(), String> {
        Err("no space left".to_owned())
    }
}

fn cloud(count: usize) -> Ensemble {
    let group = Group {
        count,
        charge: 1e-15,
        mass: 1e-12,
        radius: 0.0,
        place: Place::Ball { center: Vec3::zeros(), radius: 2e-3 },
        launch: Launch::Rest,
    };
    let mut grains = Ensemble::new();
    grains.add_group(0, &group, 7).unwrap();
    grains
}

/// Grains fall out of a box, some sooner than others.
fn falling() -> System {
    System::new()
        .with_gravity(Vec3::new(0.0, 0.3, -9.81))
        .with_drag(Drag::Rate(3.0))
        .with_region(Region { min: Vec3::repeat(-3e-3), max: Vec3::repeat(3e-3) })
}

fn run(system: &System, grains: &Ensemble, options: &Options) -> (Traced, Vec<Vec<tracer::Sample>>) {
    let tracks = Trajectories::default();
    let traced = trace(system, grains, options, &tracks).unwrap();
    (traced, tracks.into_samples())
}

#[test]
fn law_resumed_flights_end_with_the_same_bits() {
    let alone = falling();
    let noisy = falling().with_noise(300.0);
    let coupled = falling().with_coulomb();
    for (name, system, method) in [
        ("adaptive", &alone, Method::Dop853),
        ("symplectic", &alone, Method::BlanesMoan6),
        ("multistep", &alone, Method::Stoermer12),
        ("coupled, multistep", &coupled, Method::Stoermer12),
        ("adaptive multistep", &alone, Method::Stoermer),
        ("coupled, adaptive multistep", &coupled, Method::Stoermer),
        ("noise", &noisy, Method::Langevin),
        ("coupled", &coupled, Method::Dop853),
        ("coupled, fixed steps", &coupled, Method::Verlet),
    ] {
        let grains = cloud(40);
        let options = Options {
            method,
            duration: 0.05,
            step: (!method.is_adaptive()).then_some(2e-5),
            every: Some(1e-3),
            block: 7,
            ..Options::default()
        };
        let undisturbed = run(system, &grains, &options);
        let journal = Arc::new(Frames::default());
        let keeping = Options { journal: Some(journal.clone()), ..options.clone() };
        assert!(run(system, &grains, &keeping) == undisturbed, "{name}: keeping frames changes the flights");
        let frames = journal.0.lock().unwrap().clone();
        assert!(frames.len() > 3, "{name}: {}", frames.len());
        for kept in [0, 1, 2, frames.len() / 3, frames.len() / 2, frames.len() - 1, frames.len()] {
            let mut standing = Standing::default();
            frames[..kept].iter().cloned().for_each(|frame| standing.add(frame));
            // Other blocks than before, and frames again.
            let again = Arc::new(Frames::default());
            let journal: Option<Arc<dyn Journal>> = Some(again.clone());
            let resumed = Options { resume: Some(Arc::new(standing.clone())), block: 16, journal, ..options.clone() };
            assert!(run(system, &grains, &resumed) == undisturbed, "{name}: {kept} of {} frames", frames.len());
            // And a second time, from the frames of both runs.
            let more = again.0.lock().unwrap().clone();
            let half = more.len() / 2;
            more.into_iter().take(half).for_each(|frame| standing.add(frame));
            let twice = Options { resume: Some(Arc::new(standing)), ..options.clone() };
            assert!(run(system, &grains, &twice) == undisturbed, "{name}: {kept} and {half} frames");
        }
    }
}

#[test]
fn a_journal_that_fails_ends_the_run_with_its_words() {
    let options = Options { duration: 0.01, journal: Some(Arc::new(Full)), ..Options::default() };
    let failed = trace(&falling(), &cloud(3), &options, &tracer::Nothing);
    assert_eq!(failed, Err(TraceError::Journal("no space left".to_owned())));
}

#[test]
fn flights_of_other_grains_are_not_resumed() {
    let journal = Arc::new(Frames::default());
    let options = Options { duration: 0.01, journal: Some(journal.clone()), ..Options::default() };
    trace(&falling(), &cloud(9), &options, &tracer::Nothing).unwrap();
    let mut standing = Standing::default();
    journal.0.lock().unwrap().drain(..).for_each(|frame| standing.add(frame));
    let other = Options { duration: 0.01, resume: Some(Arc::new(standing)), ..Options::default() };
    let refused = trace(&falling(), &cloud(3), &other, &tracer::Nothing);
    assert!(matches!(refused, Err(TraceError::Resume { grains: 3, .. })), "{refused:?}");
}
