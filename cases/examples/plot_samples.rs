//! Draws every kind of plot from made-up data, the awkward cases among them, to be looked at: `plot_samples [folder]`.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use cases::plots::{Ending, Figure, Track, axis_potential, coordinates, phase_planes};

/// A grain on a secular orbit with micromotion, as far as a plot can tell.
fn orbit(grain: usize, samples: usize, cycles: f64, size: f64, duration: f64) -> Track {
    let phase = 0.7 * grain as f64;
    let size = size * (1.0 + 0.3 * (1.3 * grain as f64).sin());
    let ended = [Ending::TimeUp, Ending::Struck, Ending::Left][grain % 3];
    let span = if ended == Ending::TimeUp { 1.0 } else { 0.4 + 0.5 * (2.1 * grain as f64).sin().abs() };
    let times: Vec<f64> = (0..samples).map(|i| span * duration * i as f64 / (samples - 1).max(1) as f64).collect();
    let at = |t: f64, k: usize| {
        let rate = TAU * cycles / duration * (1.0 + 0.4 * k as f64);
        let slow = (rate * t + phase + k as f64).sin();
        (size * slow * (1.0 + 0.1 * (9.0 * rate * t).cos()), size * rate * (rate * t + phase + k as f64).cos())
    };
    let positions = times.iter().map(|&t| [0, 1, 2].map(|k| at(t, k).0)).collect();
    let velocities = times.iter().map(|&t| [0, 1, 2].map(|k| at(t, k).1)).collect();
    Track { grain: grain + 1, times, positions, velocities, ended }
}

fn orbits(count: usize, samples: usize, cycles: f64, size: f64, duration: f64) -> Vec<Track> {
    (0..count).map(|grain| orbit(grain, samples, cycles, size, duration)).collect()
}

fn write(folder: &Path, name: &str, figure: &Figure) {
    let (svg, png) = (figure.svg().expect("an SVG"), figure.png().expect("a PNG"));
    println!("{name:24} {:8} bytes of SVG, {:8} of PNG", svg.len(), png.len());
    std::fs::write(folder.join(format!("{name}.svg")), svg).expect("a writable folder");
    std::fs::write(folder.join(format!("{name}.png")), png).expect("a writable folder");
}

fn main() {
    let folder = std::env::args().nth(1).map_or_else(|| std::env::temp_dir().join("graintrap_plots"), PathBuf::from);
    std::fs::create_dir_all(&folder).expect("a writable folder");

    let axis = |v: &dyn Fn(f64) -> f64| (0..=400).map(|i| 1e-4 * f64::from(i - 200)).map(|z| [z, v(z)]).collect();
    let inside = |z: f64| (z.abs() - 0.0125).abs() < 0.0015;
    let curves = [
        ("static part".to_owned(), axis(&|z| if inside(z) { f64::NAN } else { 40.0 * (150.0 * z).sin() })),
        ("RF amplitude".to_owned(), axis(&|z| if inside(z) { f64::NAN } else { 300.0 / (1.0 + (z / 0.01).powi(2)) })),
        ("at start".to_owned(), axis(&|z| if inside(z) { f64::NAN } else { -200.0 + 3e5 * z * z })),
    ];
    write(&folder, "axis", &axis_potential("Potential along the axis of the trap", "z", &curves));
    write(&folder, "axis_empty", &axis_potential("No curves", "z", &[]));
    let flat = [("grounded $".to_owned(), axis(&|_| 0.0)), ("5 V <plate>".to_owned(), axis(&|_| 5.0))];
    write(&folder, "axis_flat", &axis_potential("Flat & grounded, $5 a piece", "x", &flat));

    let rest = Track {
        grain: 1,
        times: vec![0.0, 1.0],
        positions: vec![[0.0, 0.002, 1e-7]; 2],
        velocities: vec![[0.0; 3]; 2],
        ended: Ending::TimeUp,
    };
    let mut gaps = orbits(2, 300, 3.0, 1e-3, 1.0);
    gaps[0].positions[100..140].fill([f64::NAN; 3]);
    gaps[1].positions[50] = [f64::INFINITY; 3];
    let mut offset = orbits(1, 500, 3.0, 1e-6, 1e-3);
    offset[0].positions.iter_mut().for_each(|p| p[2] += 0.1);
    let samples = [
        ("none", vec![]),
        ("one", orbits(1, 1500, 8.0, 5e-3, 0.2)),
        ("three", orbits(3, 1500, 6.0, 5e-3, 0.2)),
        ("ten", orbits(10, 1500, 3.0, 0.2, 30.0)),
        ("many", orbits(1000, 400, 3.0, 5e-3, 0.2)),
        ("long", orbits(1, 100_000, 3000.0, 5e-3, 10.0)),
        ("long_ten", orbits(10, 100_000, 700.0, 5e-3, 10.0)),
        ("long_many", orbits(100, 20_000, 300.0, 5e-3, 10.0)),
        ("two_samples", orbits(3, 2, 1.3, 5e-3, 0.2)),
        ("one_sample", orbits(2, 1, 1.3, 5e-3, 0.2)),
        ("rest", vec![rest]),
        ("tiny", orbits(3, 300, 2.0, 1e-9, 1e-10)),
        ("huge", orbits(3, 300, 2.0, 3e9, 1e6)),
        ("gaps", gaps),
        ("offset", offset),
    ];
    for (name, tracks) in &samples {
        write(&folder, &format!("coordinates_{name}"), &coordinates("Grains in two coaxial rings", tracks));
        write(&folder, &format!("phase_{name}"), &phase_planes("Grains in two coaxial rings", tracks));
    }
}
