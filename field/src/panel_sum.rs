//! The field as what it is: the sum over all charges, on panels, curved elements or generating curves. Exact for the charges
//! found, and judge of every table.

use std::sync::Arc;

use meshes::{ElectrodeSurface, SurfaceTree, Vec3};
use rayon::prelude::*;

use crate::axial::AxialSum;
use crate::constants::COULOMB;
use crate::curved::CurvedSum;
use crate::electrode_basis::{ElectrodeBasis, SurfaceCharge};
use crate::panel_groups::{ON_SURFACE, PanelGroups};
use crate::plane::Plane;
use crate::quadratic::Quadratic;
use crate::source::Source;
use crate::{BasisField, Samples};

/// Potentials and gradients of channels by summing over all charges and sources.
///
/// Inside a solid electrode the potential is its own and the field zero; on the surface of a solid electrode the field is that
/// just outside, on a sheet or a hollow electrode the mean of both sides. With flat panels, closer to a surface than a panel is
/// wide, the field repeats the steps of the charge from panel to panel.
///
/// Above a grounded plane all charges have their images; on the plane the field is that just above, below it there is none.
pub struct PanelSum {
    charges: Charges,
    sources: Vec<Source>,
    ground: Option<Plane>,
    /// Weight of each source in each channel: `source * channels + channel`.
    source_weight: Vec<f64>,
    /// Potential of each electrode in each channel, V: `electrode * channels + channel`.
    electrode_potential: Vec<f64>,
    tree: Arc<SurfaceTree>,
    any_solid: bool,
    /// Distance within which a point counts as on the surface, m.
    surface_reach: f64,
    channels: usize,
}

/// Charges in the form in which they are summed.
enum Charges {
    Panels(PanelGroups),
    Curved(CurvedSum),
    Axial(Box<AxialSum>),
}

impl Charges {
    /// Panels, or points of elements: a measure of the work for one point.
    fn len(&self) -> usize {
        match self {
            Self::Panels(panels) => panels.len(),
            // A point charge takes a tenth of a panel's time.
            Self::Curved(elements) => elements.len() / 10,
            // And a ring as long as a panel.
            Self::Axial(rings) => rings.rings(),
        }
    }

    /// Potential and gradient of every channel at every point, `(point * channels + channel) * 4`.
    fn sum(&self, points: &[Vec3]) -> Vec<f64> {
        match self {
            Self::Panels(panels) => panels.sum(points),
            Self::Curved(elements) => elements.sum(points),
            Self::Axial(rings) => rings.sum(points),
        }
    }
}

impl PanelSum {
    pub(crate) fn new(basis: &ElectrodeBasis, weights: Vec<Arc<[f64]>>) -> Self {
        let (channels, electrodes) = (weights.len(), basis.mesh.electrodes.len());
        let solid = |e: &ElectrodeSurface| e.closed && !e.hollow;
        let on_solid: Vec<bool> =
            basis.mesh.electrode.iter().map(|&e| solid(&basis.mesh.electrodes[e as usize])).collect();
        let density = |panel: usize, channel: usize| {
            let charge: f64 = weights[channel].iter().enumerate().map(|(k, w)| w * basis.charge[(panel, k)]).sum();
            COULOMB * charge / basis.panels[panel].area
        };
        let per = |first: usize, count: usize| -> Vec<f64> {
            (first..first + count).flat_map(|k| weights.iter().map(move |row| row[k])).collect()
        };
        let charges = match &basis.form {
            SurfaceCharge::Panels => Charges::Panels(PanelGroups::new(&basis.panels, &on_solid, channels, density)),
            SurfaceCharge::Curved(charge) => Charges::Curved(CurvedSum::new(charge, &weights)),
            SurfaceCharge::Axial(charge) => {
                Charges::Axial(Box::new(AxialSum::new(&charge.solution, &weights, charge.axis)))
            }
        };
        Self {
            charges,
            sources: basis.sources.clone(),
            ground: basis.ground,
            source_weight: per(electrodes, basis.sources.len()),
            electrode_potential: per(0, electrodes),
            tree: Arc::new(SurfaceTree::new(&basis.mesh)),
            any_solid: basis.mesh.electrodes.iter().any(solid),
            surface_reach: ON_SURFACE * basis.panels.iter().map(|p| p.radius).fold(0.0, f64::max),
            channels,
        }
    }

    /// The surface the charges sit on.
    pub fn tree(&self) -> &Arc<SurfaceTree> {
        &self.tree
    }

    /// The solid electrode that holds a point, if any.
    pub fn inside(&self, point: &Vec3) -> Option<usize> {
        if self.any_solid { self.tree.inside(point) } else { None }
    }

    /// Whether a point lies below the grounded plane.
    pub fn below_ground(&self, point: &Vec3) -> bool {
        self.ground.is_some_and(|plane| plane.holds(point))
    }

    /// Whether there is a grounded plane.
    pub(crate) fn is_grounded(&self) -> bool {
        self.ground.is_some()
    }

    /// Whether there are sources in closed form.
    pub(crate) fn has_sources(&self) -> bool {
        !self.sources.is_empty()
    }

    /// The solid electrode that holds a point and does not have it on its surface.
    fn below_surface(&self, point: &Vec3) -> Option<usize> {
        self.inside(point).filter(|_| self.tree.nearest(point, self.surface_reach).is_none())
    }

    /// Number of sources whose field is infinite at a point, or `None`.
    pub fn singular_at(&self, point: &Vec3) -> Option<usize> {
        self.sources.iter().position(|s| s.is_singular_at(point))
    }

    /// Distance of the nearest source whose field is infinite somewhere, and of the grounded plane, m.
    pub(crate) fn distance_of_sources(&self, point: &Vec3) -> f64 {
        let plane = self.ground.iter().map(|plane| plane.height(point).abs());
        self.sources.iter().map(|s| s.distance_of_singularity(point)).chain(plane).fold(f64::INFINITY, f64::min)
    }

    /// Adds potential and gradient of the closed-form sources in every channel at a point.
    pub(crate) fn add_sources(&self, point: &Vec3, potential: &mut [f64], gradient: &mut [Vec3]) {
        for (s, source) in self.sources.iter().enumerate() {
            let (value, slope) = source.potential_and_gradient_above(self.ground.as_ref(), point);
            for c in 0..self.channels {
                let weight = self.source_weight[s * self.channels + c];
                if weight != 0.0 {
                    potential[c] += weight * value;
                    gradient[c] += slope * weight;
                }
            }
        }
    }
}

/// Panels times points from which on threads share the points: some hundred microseconds of work.
const WORTH_SHARING: usize = 30_000;

/// Points that are summed together when there are many, so that a panel's numbers are read once for all of them.
const BATCH: usize = 32;

impl BasisField for PanelSum {
    fn channels(&self) -> usize {
        self.channels
    }

    fn quadratics(&self) -> Option<Vec<Quadratic>> {
        // Without electrodes the field is that of the sources.
        if !self.electrode_potential.is_empty() || self.ground.is_some() {
            return None;
        }
        let mut channels = vec![Quadratic::default(); self.channels];
        for (s, source) in self.sources.iter().enumerate() {
            let form = source.quadratic()?;
            for (c, channel) in channels.iter_mut().enumerate() {
                channel.add(&form, self.source_weight[s * self.channels + c]);
            }
        }
        Some(channels)
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.channels;
        samples.reset(points.len(), n);
        if n == 0 || points.is_empty() {
            return;
        }
        let some = |points: &[Vec3], potential: &mut [f64], gradient: &mut [Vec3]| {
            let inside: Vec<Option<usize>> = points.iter().map(|point| self.below_surface(point)).collect();
            let free = |p: &usize| inside[*p].is_none() && !self.below_ground(&points[*p]);
            let outside: Vec<usize> = (0..points.len()).filter(free).collect();
            let sums = self.charges.sum(&outside.iter().map(|&p| points[p]).collect::<Vec<_>>());
            // What images do to a point their charges do to its image; rings have their images with them.
            let images = self.ground.filter(|_| !matches!(self.charges, Charges::Axial(_))).map(|plane| {
                let points: Vec<Vec3> = outside.iter().map(|&p| plane.image(&points[p])).collect();
                (plane, self.charges.sum(&points))
            });
            let first_of: Vec<usize> = (0..outside.len()).map(|k| k * 4 * n).collect();
            for ((p, first), sums) in outside.into_iter().zip(first_of).zip(sums.chunks_exact(4 * n)) {
                let (potential, gradient) = (&mut potential[p * n..(p + 1) * n], &mut gradient[p * n..(p + 1) * n]);
                for (c, sum) in sums.chunks_exact(4).enumerate() {
                    potential[c] = sum[0];
                    gradient[c] = Vec3::new(sum[1], sum[2], sum[3]);
                    if let Some((plane, images)) = &images {
                        let image = &images[first + 4 * c..first + 4 * c + 4];
                        potential[c] -= image[0];
                        gradient[c] -= plane.turned(&Vec3::new(image[1], image[2], image[3]));
                    }
                }
                self.add_sources(&points[p], potential, gradient);
            }
            for (p, electrode) in inside.into_iter().enumerate().filter_map(|(p, e)| Some((p, e?))) {
                let own = &self.electrode_potential[electrode * n..(electrode + 1) * n];
                potential[p * n..(p + 1) * n].copy_from_slice(own);
            }
        };
        if points.len() > 1 && points.len() * self.charges.len() >= WORTH_SHARING {
            let batch = (points.len() / (4 * rayon::current_num_threads())).clamp(1, BATCH);
            let all = (samples.potential.par_chunks_mut(batch * n), samples.gradient.par_chunks_mut(batch * n));
            points
                .par_chunks(batch)
                .zip(all)
                .for_each(|(points, (potential, gradient))| some(points, potential, gradient));
        } else {
            some(points, &mut samples.potential, &mut samples.gradient);
        }
    }
}
