//! The field as what it is: the sum over all panels. Exact for the charges found, and judge of every table.

use std::sync::Arc;

use meshes::{ElectrodeSurface, SurfaceTree, Vec3};
use rayon::prelude::*;

use crate::constants::COULOMB;
use crate::electrode_basis::ElectrodeBasis;
use crate::panel::{Panel, quadrature};
use crate::source::Source;
use crate::{BasisField, Samples};

/// From this distance on, in panel radii, a panel acts through the points of a rule of degree 5 instead of the closed form. The
/// error of the panel's share is below (1/8)⁶ times the rule's small constant, 1e-7, and a thousandth of that further out.
const RULE_FROM: f64 = 8.0;

/// Degree of that rule, seven points.
const DEGREE: usize = 5;

/// A point this near to a panel's plane and over its area is on the panel, in panel radii: the rounding of a point that was
/// computed to lie on it.
const ON_SURFACE: f64 = 1e-12;

/// Potentials and gradients of channels by summing over all panels and sources.
///
/// Inside a solid electrode the potential is its own and the field zero; on the surface of a solid electrode the field is that
/// just outside, on a sheet or a hollow electrode the mean of both sides. Closer to a surface than a panel is wide the field repeats the steps of the
/// charge from panel to panel.
pub struct PanelSum {
    panels: Vec<Panel>,
    /// Rule points of all panels, seven each.
    points: Vec<Vec3>,
    /// Coulomb's constant times charge density, V/m: entry `panel * channels + channel`.
    density: Vec<f64>,
    /// Coulomb's constant times charge times the weight of a rule point is this times the density.
    weight: Vec<f64>,
    sources: Vec<Source>,
    /// Weight of each source in each channel: `source * channels + channel`.
    source_weight: Vec<f64>,
    /// Potential of each electrode in each channel, V: `electrode * channels + channel`.
    electrode_potential: Vec<f64>,
    tree: Arc<SurfaceTree>,
    /// Of each panel: on a solid electrode, so that only its outside counts.
    solid: Vec<bool>,
    any_solid: bool,
    /// Distance within which a point counts as on the surface, m.
    surface_reach: f64,
    channels: usize,
}

impl PanelSum {
    pub(crate) fn new(basis: &ElectrodeBasis, weights: Vec<Arc<[f64]>>) -> Self {
        let (channels, electrodes) = (weights.len(), basis.mesh.electrodes.len());
        let rule = quadrature::rule(DEGREE);
        let solid = |e: &ElectrodeSurface| e.closed && !e.hollow;
        let mut density = Vec::with_capacity(basis.panels.len() * channels);
        for (p, panel) in basis.panels.iter().enumerate() {
            for row in &weights {
                let charge: f64 = row.iter().enumerate().map(|(k, w)| w * basis.charge[(p, k)]).sum();
                density.push(COULOMB * charge / panel.area);
            }
        }
        let per = |first: usize, count: usize| -> Vec<f64> {
            (first..first + count).flat_map(|k| weights.iter().map(move |row| row[k])).collect()
        };
        Self {
            points: basis.panels.iter().flat_map(|p| rule.on(&p.corners).map(|(x, _)| x).collect::<Vec<_>>()).collect(),
            weight: basis.panels.iter().flat_map(|p| rule.weights.iter().map(|w| w * p.area)).collect(),
            density,
            sources: basis.sources.clone(),
            source_weight: per(electrodes, basis.sources.len()),
            electrode_potential: per(0, electrodes),
            tree: Arc::new(SurfaceTree::new(&basis.mesh)),
            solid: basis.mesh.electrode.iter().map(|&e| solid(&basis.mesh.electrodes[e as usize])).collect(),
            any_solid: basis.mesh.electrodes.iter().any(solid),
            surface_reach: ON_SURFACE * basis.panels.iter().map(|p| p.radius).fold(0.0, f64::max),
            panels: basis.panels.clone(),
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

    /// Number of sources whose field is infinite at a point, or `None`.
    pub fn singular_at(&self, point: &Vec3) -> Option<usize> {
        self.sources.iter().position(|s| s.is_singular_at(point))
    }

    /// Adds potential and gradient of the closed-form sources in every channel at a point.
    pub(crate) fn add_sources(&self, point: &Vec3, potential: &mut [f64], gradient: &mut [Vec3]) {
        for (s, source) in self.sources.iter().enumerate() {
            let (value, slope) = source.potential_and_gradient(point);
            for c in 0..self.channels {
                let weight = self.source_weight[s * self.channels + c];
                if weight != 0.0 {
                    potential[c] += weight * value;
                    gradient[c] += slope * weight;
                }
            }
        }
    }

    fn add_panels(&self, point: &Vec3, potential: &mut [f64], gradient: &mut [Vec3]) {
        let per_panel = self.points.len() / self.panels.len().max(1);
        for (p, panel) in self.panels.iter().enumerate() {
            let far = (point - panel.centroid).norm_squared() > (RULE_FROM * panel.radius).powi(2);
            let (value, slope) = if far {
                let (mut value, mut slope) = (0.0, Vec3::zeros());
                for k in p * per_panel..(p + 1) * per_panel {
                    let d = point - self.points[k];
                    let inverse = 1.0 / d.norm_squared();
                    let share = self.weight[k] * inverse.sqrt();
                    value += share;
                    slope -= d * (share * inverse);
                }
                (value, slope)
            } else {
                let (value, slope) = panel.potential_and_gradient(point);
                (value, slope + self.step_outside(p, panel, point))
            };
            let density = &self.density[p * self.channels..(p + 1) * self.channels];
            for (c, sigma) in density.iter().enumerate() {
                potential[c] += sigma * value;
                gradient[c] += slope * *sigma;
            }
        }
    }

    /// What the gradient of a panel's potential needs so that on the panel itself it is the one just outside: -2π n.
    fn step_outside(&self, index: usize, panel: &Panel, point: &Vec3) -> Vec3 {
        let height = panel.normal.dot(&(point - panel.corners[0]));
        if !self.solid[index] || height.abs() > ON_SURFACE * panel.radius {
            return Vec3::zeros();
        }
        let nearest = meshes::triangle::closest_point(point, &panel.corners);
        if (nearest - point).norm() > ON_SURFACE * panel.radius {
            return Vec3::zeros();
        }
        // The closed form has the solid angle ±2π for points off the plane by less than that, and zero in it.
        let (_, here) = panel.potential_and_gradient(point);
        let outside = -std::f64::consts::TAU;
        panel.normal * (outside - here.dot(&panel.normal))
    }
}

/// Panels times points from which on threads share the points: some hundred microseconds of work.
const WORTH_SHARING: usize = 10_000;

impl BasisField for PanelSum {
    fn channels(&self) -> usize {
        self.channels
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.channels;
        samples.reset(points.len(), n);
        let one = |point: &Vec3, potential: &mut [f64], gradient: &mut [Vec3]| {
            let on_surface = self.any_solid && self.tree.nearest(point, self.surface_reach).is_some();
            if let Some(electrode) = self.inside(point).filter(|_| !on_surface) {
                potential.copy_from_slice(&self.electrode_potential[electrode * n..(electrode + 1) * n]);
                return;
            }
            self.add_panels(point, potential, gradient);
            self.add_sources(point, potential, gradient);
        };
        if n == 0 {
            return;
        }
        let all = (samples.potential.chunks_mut(n), samples.gradient.chunks_mut(n));
        if points.len() > 1 && points.len() * self.panels.len() >= WORTH_SHARING {
            let all = (samples.potential.par_chunks_mut(n), samples.gradient.par_chunks_mut(n));
            points.par_iter().zip(all).for_each(|(point, (potential, gradient))| one(point, potential, gradient));
        } else {
            points
                .iter()
                .zip(all.0.zip(all.1))
                .for_each(|(point, (potential, gradient))| one(point, potential, gradient));
        }
    }
}
