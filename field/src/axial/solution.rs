//! Charges on generating curves, and what they say.

use std::f64::consts::TAU;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use super::assembly::LARGEST_ORDER;
use super::element::Element;
use super::gauss::{Rules, legendre};
use super::sum::{AxialSum, Axis};
use super::{AxialBody, AxialError};
use crate::capacitance::CapacitanceMatrix;

/// What of a solution is worth keeping: with the bodies it gives the solution again, by [`AxialSolution::restored`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxialData {
    /// Elements of the generating curves.
    pub elements: Vec<Element>,
    /// Charge at each node (Gauss's nodes of each element in u), basis function after basis function, C.
    pub charges: Vec<f64>,
    /// Capacitance matrix, F.
    pub capacitance: Vec<Vec<f64>>,
    /// Its asymmetry before it was made symmetric, as a part of its largest entry.
    pub asymmetry: f64,
    /// Charge on each electrode (row) that each source (column) induces, C.
    pub induced: Vec<Vec<f64>>,
    /// Largest potential of each source on the bodies, V.
    pub source_scales: Vec<f64>,
    /// Height of the grounded plane, m.
    pub ground: Option<f64>,
    /// Error of the capacitance matrix, as a part of its largest entry (with sources: or of induced charges, see
    /// [`AxialSolution::difference`]), measured by comparison with a better solution.
    pub capacitance_error: f64,
    /// Largest error of the potential found on the surfaces, V per V (for sources: of their largest potential there).
    pub misfit: f64,
}

/// Unit solutions of coaxial bodies: first each electrode at 1 V with the others at 0 V, then each source with all at 0 V.
#[derive(Clone, Debug)]
pub struct AxialSolution {
    /// The bodies.
    pub bodies: Vec<AxialBody>,
    /// Charges on electrodes for unit voltages, F.
    pub capacitance: CapacitanceMatrix,
    /// Everything else, in numbers.
    pub data: AxialData,
    rules: std::sync::Arc<Rules>,
}

/// By how much the fields of two solutions differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldDifference {
    /// Largest difference of potential, V per V.
    pub potential: f64,
    /// Largest difference of its gradient, V/m per V.
    pub gradient: f64,
}

impl AxialSolution {
    pub(crate) fn new(
        bodies: &[AxialBody],
        elements: Vec<Element>,
        charges: Vec<f64>,
        (capacitance, induced): (CapacitanceMatrix, Vec<Vec<f64>>),
        source_scales: Vec<f64>,
        ground: Option<f64>,
    ) -> Self {
        let data = AxialData {
            elements,
            charges,
            capacitance: capacitance.matrix.clone(),
            asymmetry: capacitance.asymmetry,
            induced,
            source_scales,
            ground,
            capacitance_error: f64::NAN,
            misfit: f64::NAN,
        };
        Self { bodies: bodies.to_vec(), capacitance, data, rules: std::sync::Arc::new(Rules::new(LARGEST_ORDER)) }
    }

    /// A solution that was kept, of the same bodies.
    ///
    /// # Errors
    /// The numbers do not belong to these bodies or to each other: [`AxialError::Data`].
    pub fn restored(bodies: &[AxialBody], data: AxialData) -> Result<Self, AxialError> {
        let fits = |e: &Element| {
            bodies.get(e.body).is_some_and(|b| e.piece < b.profile.curves.len())
                && (4..=LARGEST_ORDER).contains(&e.order)
                && (1..=8).contains(&e.power)
        };
        let n: usize = data.elements.iter().map(|e| e.order).sum();
        let electrodes = data.capacitance.len();
        let functions = electrodes + data.source_scales.len();
        let whole = data.elements.iter().all(fits)
            && data.charges.len() == n * functions
            && data.capacitance.iter().all(|row| row.len() == electrodes)
            && data.induced.len() == electrodes
            && data.induced.iter().all(|row| row.len() == data.source_scales.len())
            && bodies.iter().all(|b| b.electrode < electrodes);
        if !whole {
            return Err(AxialError::Data);
        }
        let capacitance = CapacitanceMatrix { matrix: data.capacitance.clone(), asymmetry: data.asymmetry };
        let rules = std::sync::Arc::new(Rules::new(LARGEST_ORDER));
        Ok(Self { bodies: bodies.to_vec(), capacitance, data, rules })
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.data.elements.iter().map(|e| e.order).sum()
    }

    /// Number of unit solutions: electrodes and sources.
    pub fn functions(&self) -> usize {
        self.capacitance.electrodes() + self.data.source_scales.len()
    }

    /// Charges of one unit solution, C, node after node.
    pub(crate) fn charges(&self, function: usize) -> &[f64] {
        let n = self.unknowns();
        &self.data.charges[function * n..(function + 1) * n]
    }

    /// Nodes (ρ, z), m, in the order of the charges.
    pub fn nodes(&self) -> Vec<[f64; 2]> {
        let places = |e: &Element| -> Vec<[f64; 2]> {
            self.rules.rule(e.order).points.iter().map(|&u| e.at(&self.bodies, u).0).collect()
        };
        self.data.elements.iter().flat_map(places).collect()
    }

    /// Legendre coefficients of the charge per parameter over ρ of every element, C/m: `first node of the element + k`.
    pub(crate) fn coefficients(&self, charges: &[f64]) -> Vec<f64> {
        let mut all = Vec::with_capacity(charges.len());
        let mut first = 0;
        for element in &self.data.elements {
            all.extend(self.coefficients_of(element, &charges[first..first + element.order]));
            first += element.order;
        }
        all
    }

    fn coefficients_of(&self, element: &Element, charges: &[f64]) -> Vec<f64> {
        let n = element.order;
        let (nodes, transform) = (&self.rules.rule(n).points, self.rules.transform(n));
        let values: Vec<f64> = nodes.iter().zip(charges).map(|(&u, q)| q / element.at(&self.bodies, u).0[0]).collect();
        (0..n).map(|k| (0..n).map(|j| transform[k * n + j] * values[j]).sum()).collect()
    }

    /// Surface charge density of one unit solution at a place on a body, C/m² per V: `t` from 0 to 1 along a piece of its
    /// profile. Infinite only at edges; on a sheet that of both sides together.
    ///
    /// `None` for a place that there is not.
    pub fn density(&self, function: usize, body: usize, piece: usize, t: f64) -> Option<f64> {
        if function >= self.functions() || !(0.0..=1.0).contains(&t) {
            return None;
        }
        let mut first = 0;
        for element in &self.data.elements {
            if element.body == body
                && element.piece == piece
                && let Some(u) = element.parameter(t)
            {
                let coefficients = self.coefficients_of(element, &self.charges(function)[first..first + element.order]);
                return Some(density(element, &self.bodies, u, &coefficients));
            }
            first += element.order;
        }
        None
    }

    /// Largest difference of capacitances, as a part of the largest capacitance, or of induced charges, as a part of what the
    /// largest capacitance holds at the source's largest potential.
    pub fn difference(&self, other: &Self) -> f64 {
        let largest = other.data.capacitance.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let capacitances = self.data.capacitance.iter().flatten().zip(other.data.capacitance.iter().flatten());
        let worst = capacitances.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let scales = self.data.induced.iter().flat_map(|_| &self.data.source_scales);
        let induced = self.data.induced.iter().flatten().zip(other.data.induced.iter().flatten()).zip(scales);
        let worst = induced.map(|((a, b), s)| (a - b).abs() / s).fold(worst, f64::max);
        worst / largest
    }

    /// Largest differences of the fields of each unit solution at points (m; z is the axis, heights as those of the bodies).
    ///
    /// # Panics
    /// The solutions have different numbers of electrodes or sources.
    pub fn difference_at(&self, other: &Self, points: &[Vec3]) -> Vec<FieldDifference> {
        let functions = self.functions();
        assert_eq!(functions, other.functions(), "solutions of the same problem");
        let [one, two] = [self, other].map(|s| AxialSum::every(s, Axis::default()).sum(points));
        let mut all = vec![FieldDifference::default(); functions];
        for (k, (a, b)) in one.chunks_exact(4).zip(two.chunks_exact(4)).enumerate() {
            let worst = &mut all[k % functions];
            let slope = Vec3::new(a[1] - b[1], a[2] - b[2], a[3] - b[3]).norm();
            worst.potential = worst.potential.max((a[0] - b[0]).abs());
            worst.gradient = worst.gradient.max(slope);
        }
        all
    }

    pub(crate) fn rules(&self) -> &std::sync::Arc<Rules> {
        &self.rules
    }
}

/// Charge per area of an element whose charge per parameter over ρ has these Legendre coefficients.
pub(crate) fn density(element: &Element, bodies: &[AxialBody], u: f64, coefficients: &[f64]) -> f64 {
    // At an edge the length per parameter vanishes: a step beside it.
    let u = if element.power > 1 { u.max(1e-7) } else { u };
    let (_, d) = element.at(bodies, u);
    let mut values = [0.0; LARGEST_ORDER];
    let values = &mut values[..coefficients.len()];
    legendre(u, values);
    let charge: f64 = coefficients.iter().zip(values.iter()).map(|(a, b)| a * b).sum();
    charge / (TAU * d[0].hypot(d[1]))
}
