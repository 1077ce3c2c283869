//! The tracks of grains, for viewers and for spreadsheets.

use std::io::Write;

use meshes::Vec3;
use meshes::vtk::{
    DataArray, PolylineArray, Polylines, VtkError, write_collection, write_line_cells, write_points, write_polylines,
};
use tracer::{Ensemble, Outcome, Sample};

use super::OutputFolder;
use crate::pipeline::Failure;
use crate::pipeline::flights::Flights;

/// How a flight ended, as the number in the array `outcome` of the tracks.
fn code(outcome: &Outcome) -> u32 {
    match outcome {
        Outcome::TimeUp => 0,
        Outcome::Struck { .. } => 1,
        Outcome::LeftRegion { .. } => 2,
        Outcome::Unstable { .. } => 3,
        Outcome::Stopped => 4,
    }
}

/// Kinetic energy, J.
fn kinetic(mass: f64, sample: &Sample) -> f64 {
    0.5 * mass * sample.velocity.norm_squared()
}

/// Writes the tracks in all forms: `trajectories.vtp` (a polyline for each grain), `trajectories.vtu` (the same as line cells),
/// `trajectories.csv`, and `grains.pvd` with a frame for each sampled time.
///
/// # Errors
/// The output fails.
pub fn write(out: &mut OutputFolder, flights: &Flights, ensemble: &Ensemble) -> Result<(), Failure> {
    let samples = &flights.samples;
    let lengths: Vec<usize> = samples.iter().map(Vec::len).collect();
    let masses = ensemble.masses();
    let lines = Polylines::new(&lengths, |grain, k| samples[grain][k].position);
    let point_arrays = || {
        [
            PolylineArray::scalars("time", |grain, k| samples[grain][k].time),
            PolylineArray::scalars("speed", |grain, k| samples[grain][k].velocity.norm()),
            PolylineArray::vectors("velocity", |grain, k| samples[grain][k].velocity),
            PolylineArray::scalars("energy", |grain, k| kinetic(masses[grain], &samples[grain][k])),
            PolylineArray::scalars("potential_energy", |grain, k| samples[grain][k].potential_energy),
            PolylineArray::vectors("force", |grain, k| samples[grain][k].force),
        ]
    };
    let numbers: Vec<u32> = (0..ensemble.len() as u32).collect();
    let outcomes: Vec<u32> = flights.traced.endings.iter().map(|e| code(&e.outcome)).collect();
    let line_arrays = || {
        [
            DataArray::scalars("grain", numbers.as_slice()),
            DataArray::scalars("group", ensemble.groups()),
            DataArray::scalars("charge", ensemble.charges()),
            DataArray::scalars("mass", masses),
            DataArray::scalars("outcome", outcomes.as_slice()),
        ]
    };
    out.write("trajectories.vtp", |w| write_polylines(w, &lines, &point_arrays(), &line_arrays()))?;
    out.write("trajectories.vtu", |w| write_line_cells(w, &lines, &point_arrays(), &line_arrays()))?;
    out.write("trajectories.csv", |w| write_csv(w, samples, masses))?;
    write_frames(out, samples, ensemble)
}

fn write_csv(out: &mut dyn Write, samples: &[Vec<Sample>], masses: &[f64]) -> std::io::Result<()> {
    writeln!(out, "grain,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,energy_J,potential_energy_J")?;
    for (grain, (track, mass)) in samples.iter().zip(masses).enumerate() {
        for s in track {
            let ([x, y, z], [u, v, w]) = (s.position.into(), s.velocity.into());
            let (kinetic, potential) = (kinetic(*mass, s), s.potential_energy);
            writeln!(out, "{grain},{:e},{x:e},{y:e},{z:e},{u:e},{v:e},{w:e},{kinetic:e},{potential:e}", s.time)?;
        }
    }
    Ok(())
}

/// The times of the animation: those of the track with the most samples. All grains are sampled at the same times until they
/// end.
fn frame_times(samples: &[Vec<Sample>]) -> Vec<f64> {
    let longest = samples.iter().max_by_key(|track| track.len());
    let mut times: Vec<f64> = longest.into_iter().flatten().map(|s| s.time).collect();
    times.dedup();
    times
}

fn write_frames(out: &mut OutputFolder, samples: &[Vec<Sample>], ensemble: &Ensemble) -> Result<(), Failure> {
    let times = frame_times(samples);
    let mut next = vec![0; samples.len()];
    let mut frames = Vec::with_capacity(times.len());
    for (number, &time) in times.iter().enumerate() {
        let mut here: Vec<(usize, &Sample)> = Vec::new();
        for (grain, track) in samples.iter().enumerate() {
            while track.get(next[grain]).is_some_and(|s| s.time < time) {
                next[grain] += 1;
            }
            here.extend(track.get(next[grain]).filter(|s| s.time == time).map(|s| (grain, s)));
        }
        let of = |value: &dyn Fn(usize, &Sample) -> f64| here.iter().map(|(g, s)| value(*g, s)).collect::<Vec<f64>>();
        let vectors = |value: fn(&Sample) -> Vec3| here.iter().map(|(_, s)| value(s)).collect::<Vec<Vec3>>();
        let (places, velocities, forces) = (vectors(|s| s.position), vectors(|s| s.velocity), vectors(|s| s.force));
        let grains: Vec<u32> = here.iter().map(|(g, _)| *g as u32).collect();
        let groups: Vec<u32> = here.iter().map(|(g, _)| ensemble.groups()[*g]).collect();
        let arrays = [
            DataArray::scalars("grain", grains),
            DataArray::scalars("group", groups),
            DataArray::scalars("charge", of(&|g, _| ensemble.charges()[g])),
            DataArray::scalars("mass", of(&|g, _| ensemble.masses()[g])),
            DataArray::scalars("radius", of(&|g, _| ensemble.radii()[g])),
            DataArray::scalars("speed", of(&|_, s| s.velocity.norm())),
            DataArray::scalars("energy", of(&|g, s| kinetic(ensemble.masses()[g], s))),
            DataArray::vectors("velocity", &velocities),
            DataArray::vectors("force", &forces),
        ];
        let name = format!("grains/grains_{number:05}.vtp");
        out.write_unlisted(&name, |w| write_points(w, &places, &arrays))?;
        frames.push((time, name));
    }
    out.write("grains.pvd", |w| -> Result<(), VtkError> { write_collection(w, &frames) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(times: &[f64]) -> Vec<Sample> {
        let sample = |time: &f64| Sample {
            time: *time,
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            force: Vec3::zeros(),
            potential_energy: 0.0,
        };
        times.iter().map(sample).collect()
    }

    #[test]
    fn frames_are_at_the_common_times() {
        let tracks = [track(&[0.0, 1.0, 1.3]), track(&[0.0, 1.0, 2.0, 3.0]), track(&[0.0])];
        assert_eq!(frame_times(&tracks), [0.0, 1.0, 2.0, 3.0]);
        assert!(frame_times(&[]).is_empty());
    }
}
