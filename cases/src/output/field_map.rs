//! Potential and field on a grid, for viewers.

use std::f64::consts::TAU;
use std::io::Write;

use field::{DrivenField, Samples, WaveformPart};
use meshes::Vec3;
use meshes::vtk::{DataArray, ImageGrid, VtkError, write_image};
use rayon::prelude::*;

use crate::case::{Case, Region};
use crate::pipeline::drives::Driven;

/// Name of the file.
pub const FILE: &str = "field.vti";

/// Nodes when the case does not say: enough to see the field between electrodes, in a file of some tens of megabytes.
pub const NODES: usize = 100_000;

/// Points that one task samples.
const CHUNK: usize = 256;

/// The field of a case on a grid.
pub struct FieldMap {
    grid: ImageGrid,
    /// Names of the channels: the electrodes (and sources) that go together in time.
    names: Vec<String>,
    /// Unit potential of each channel at each node: `channel`, then node.
    potential: Vec<Vec<f64>>,
    /// Unit gradient likewise.
    gradient: Vec<Vec<Vec3>>,
    /// 0 outside conductors, 1 + the number of the electrode inside it; below a grounded plane one more than the last.
    conductor: Vec<u32>,
    /// Voltage of each channel at the start.
    at_start: Vec<f64>,
    /// Constant part of each channel's voltage.
    constant: Vec<f64>,
    /// Pseudopotential of the first group of grains, J, where the field oscillates.
    pseudopotential: Option<Vec<f64>>,
}

impl FieldMap {
    /// Samples the field of a case in a box.
    pub fn new(case: &Case, driven: &Driven, bounds: &Region) -> Self {
        let (field, exact, names) = (&driven.field, &driven.exact, driven.names.clone());
        let grid = lattice(bounds, case.output.field_nodes.unwrap_or(NODES));
        let [nx, ny, nz] = grid.points;
        let nodes: Vec<Vec3> = (0..nx * ny * nz)
            .map(|n| [n % nx, n / nx % ny, n / (nx * ny)])
            .map(|at| grid.origin + Vec3::from_fn(|k, _| at[k] as f64 * grid.spacing[k]))
            // A node on a point charge would be infinite: look a thousandth of a cell beside it.
            .map(|p| if exact.singular_at(&p).is_some() { p + grid.spacing * 1e-3 } else { p })
            .collect();
        let channels = names.len();
        let sampled: Vec<(Samples, Vec<u32>)> = nodes
            .par_chunks(CHUNK)
            .map(|points| {
                let mut samples = Samples::default();
                field.basis().sample(points, &mut samples);
                let ground = |p: &Vec3| if exact.below_ground(p) { case.electrodes.len() as u32 + 1 } else { 0 };
                let conductor = |p: &Vec3| exact.inside(p).map_or_else(|| ground(p), |e| e as u32 + 1);
                (samples, points.iter().map(conductor).collect())
            })
            .collect();
        let channel = |c: usize| sampled.iter().flat_map(move |(s, _)| s.potential.iter().skip(c).step_by(channels));
        let slope = |c: usize| sampled.iter().flat_map(move |(s, _)| s.gradient.iter().skip(c).step_by(channels));
        let start = case.trace.as_ref().map_or(0.0, |trace| trace.start);
        let mut map = Self {
            grid,
            names,
            potential: (0..channels).map(|c| channel(c).copied().collect()).collect(),
            gradient: (0..channels).map(|c| slope(c).copied().collect()).collect(),
            conductor: sampled.iter().flat_map(|(_, inside)| inside.iter().copied()).collect(),
            at_start: field.waveforms().iter().map(|w| w.value(start)).collect(),
            constant: field.waveforms().iter().map(|w| w.constant).collect(),
            pseudopotential: None,
        };
        map.pseudopotential = case.grains.first().and_then(|g| map.pseudopotential(field, g.charge, g.mass));
        map
    }

    /// Bytes that a map of so many nodes and channels takes.
    pub fn bytes_for(nodes: usize, channels: usize) -> u64 {
        (nodes as u64).saturating_mul(8 * (8 * channels as u64 + 12))
    }

    /// Writes potential and field at the start, the static part of the potential, the unit potential and field of each group
    /// of electrodes, the pseudopotential, and which nodes lie inside which conductor.
    ///
    /// # Errors
    /// The output fails.
    pub fn write(&self, out: &mut dyn Write) -> Result<(), VtkError> {
        let mut arrays = vec![
            DataArray::scalars("potential", self.sum(&self.at_start)),
            DataArray::vectors("field", &self.field_at_start()),
            DataArray::scalars("potential_dc", self.sum(&self.constant)),
            DataArray::scalars("conductor", self.conductor.as_slice()),
        ];
        if let Some(pseudopotential) = &self.pseudopotential {
            arrays.push(DataArray::scalars("pseudopotential", pseudopotential.as_slice()));
        }
        for (c, name) in self.names.iter().enumerate() {
            arrays.push(DataArray::scalars(format!("unit_potential {name}"), self.potential[c].as_slice()));
            let field: Vec<Vec3> = self.gradient[c].iter().map(|g| -g).collect();
            arrays.push(DataArray::vectors(format!("unit_field {name}"), &field));
        }
        write_image(out, &self.grid, &arrays, &[])
    }

    fn sum(&self, weights: &[f64]) -> Vec<f64> {
        (0..self.conductor.len()).map(|n| self.potential.iter().zip(weights).map(|(p, w)| w * p[n]).sum()).collect()
    }

    fn field_at_start(&self) -> Vec<Vec3> {
        let at = |n: usize| self.gradient.iter().zip(&self.at_start).map(|(g, w)| g[n] * -*w).sum();
        (0..self.conductor.len()).map(at).collect()
    }

    /// Time-averaged energy of a grain in the oscillating part of the field (the pseudopotential), J.
    ///
    ///   Ψ = Σ_ω q² |E_ω|² / (4 m ω²)
    ///
    /// q charge, m mass, ω each angular frequency, E_ω the complex field amplitude at it. Valid while the grain moves little
    /// over one period compared with the length on which E_ω varies (Dehmelt 1967). `None` where nothing oscillates, or
    /// something does otherwise than as a sine, or so strongly that the energy is beyond any number.
    fn pseudopotential(&self, field: &DrivenField, charge: f64, mass: f64) -> Option<Vec<f64>> {
        // (frequency, for each channel its cosine and sine amplitude)
        let mut tones: Vec<(f64, Vec<(f64, f64)>)> = Vec::new();
        for (c, waveform) in field.waveforms().iter().enumerate() {
            for part in &waveform.parts {
                let WaveformPart::Sine { amplitude, frequency, phase } = part else { return None };
                let tone = match tones.iter().position(|(f, _)| f == frequency) {
                    Some(tone) => tone,
                    None => {
                        tones.push((*frequency, vec![(0.0, 0.0); self.names.len()]));
                        tones.len() - 1
                    }
                };
                tones[tone].1[c].0 += amplitude * phase.cos();
                tones[tone].1[c].1 += amplitude * phase.sin();
            }
        }
        if tones.is_empty() || mass <= 0.0 {
            return None;
        }
        let at = |n: usize| -> f64 {
            tones
                .iter()
                .map(|(frequency, amplitudes)| {
                    let part = |pick: fn(&(f64, f64)) -> f64| -> Vec3 {
                        self.gradient.iter().zip(amplitudes).map(|(g, a)| g[n] * pick(a)).sum()
                    };
                    let squared = part(|a| a.0).norm_squared() + part(|a| a.1).norm_squared();
                    charge * charge * squared / (4.0 * mass * (TAU * frequency).powi(2))
                })
                .sum()
        };
        let energies: Vec<f64> = (0..self.conductor.len()).map(at).collect();
        energies.iter().all(|energy| energy.is_finite()).then_some(energies)
    }
}

/// About so many nodes with equal spacing that fill a box.
fn lattice(bounds: &Region, nodes: usize) -> ImageGrid {
    let size = bounds.max - bounds.min;
    let spacing = (size.product() / nodes as f64).cbrt();
    let points: [usize; 3] = std::array::from_fn(|k| ((size[k] / spacing).round() as usize).max(1) + 1);
    ImageGrid { points, origin: bounds.min, spacing: Vec3::from_fn(|k, _| size[k] / (points[k] - 1) as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_fills_its_box_with_about_so_many_nodes() {
        let bounds = Region { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(1.0, 1.0, 2.5) };
        let grid = lattice(&bounds, 100_000);
        let count: usize = grid.points.iter().product();
        assert!((90_000..115_000).contains(&count), "{count}");
        for k in 0..3 {
            let far = grid.origin[k] + grid.spacing[k] * (grid.points[k] - 1) as f64;
            assert!((far - bounds.max[k]).abs() < 1e-14);
        }
        let flat = lattice(&Region { min: Vec3::zeros(), max: Vec3::new(1.0, 1.0, 1e-9) }, 1000);
        assert!(flat.points.iter().all(|n| *n >= 2));
    }
}
