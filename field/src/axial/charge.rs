//! An axial solution in place, as the charge of an electrode basis.

use std::f64::consts::TAU;

use meshes::Vec3;
use serde::{Deserialize, Serialize};

use super::gauss::legendre;
use super::{AxialBody, AxialData, AxialError, AxialSolution, Axis};
use crate::constants::COULOMB;
use crate::pieces::{Piece, Rectangles};

/// A solution and where its axis stands.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct AxialCharge {
    /// The solution.
    pub solution: AxialSolution,
    /// Its axis.
    pub axis: Axis,
}

#[derive(Serialize, Deserialize)]
struct Stored {
    bodies: Vec<AxialBody>,
    data: AxialData,
    axis: Axis,
}

impl From<AxialCharge> for Stored {
    fn from(charge: AxialCharge) -> Self {
        Self { bodies: charge.solution.bodies, data: charge.solution.data, axis: charge.axis }
    }
}

impl TryFrom<Stored> for AxialCharge {
    type Error = AxialError;

    fn try_from(stored: Stored) -> Result<Self, AxialError> {
        Ok(Self { solution: AxialSolution::restored(&stored.bodies, stored.data)?, axis: stored.axis })
    }
}

impl AxialCharge {
    /// Distance from the axis and height of a point, m.
    fn beside(&self, point: &Vec3) -> [f64; 2] {
        let d = point - self.axis.origin;
        let z = d.dot(&self.axis.frame[2]);
        [(d - self.axis.frame[2] * z).norm(), z]
    }

    /// Charge density of every unit solution at points near the surface, each with its electrode: C/m² per volt,
    /// `point * functions + function`.
    pub fn densities(&self, points: &[(Vec3, usize)]) -> Vec<f64> {
        let bodies = &self.solution.bodies;
        let functions = self.solution.functions();
        let mut densities = vec![0.0; points.len() * functions];
        for ((point, electrode), out) in points.iter().zip(densities.chunks_exact_mut(functions)) {
            let [rho, z] = self.beside(point);
            let mut best: Option<(f64, usize, usize, f64)> = None;
            for (b, body) in bodies.iter().enumerate().filter(|(_, body)| body.electrode == *electrode) {
                let own = [rho, if body.flipped { body.height - z } else { z - body.height }];
                for (piece, curve) in body.profile.curves.iter().enumerate() {
                    let t = curve.nearest(own);
                    let there = curve.at(t).0;
                    let distance = (there[0] - own[0]).hypot(there[1] - own[1]);
                    if best.is_none_or(|(d, ..)| distance < d) {
                        best = Some((distance, b, piece, t));
                    }
                }
            }
            let Some((_, body, piece, t)) = best else { continue };
            for (function, out) in out.iter_mut().enumerate() {
                // Off the very edge, where the density is infinite.
                *out = self.solution.density(function, body, piece, t.clamp(1e-6, 1.0 - 1e-6)).unwrap_or(0.0);
            }
        }
        densities
    }
}

/// Sectors of an element to begin with.
const SECTORS: usize = 4;

/// Parts may reach this much farther from their middle than their corners do.
const BULGE: f64 = 1.05;

/// Elements of the curves times sectors, with Legendre coefficients of their charge.
pub(crate) struct AxialPieces<'a> {
    charge: &'a AxialCharge,
    /// First coefficient of each element.
    first: Vec<usize>,
    /// Charge per parameter over ρ, over Coulomb's constant, V: `function * unknowns + first + k`.
    coefficients: Vec<f64>,
}

impl<'a> AxialPieces<'a> {
    /// Of a charge.
    pub fn new(charge: &'a AxialCharge) -> Self {
        let solution = &charge.solution;
        let mut first = vec![0];
        for element in &solution.data.elements {
            first.push(first[first.len() - 1] + element.order);
        }
        first.pop();
        let of = |function: usize| -> Vec<f64> {
            let charges: Vec<f64> = solution.charges(function).iter().map(|q| COULOMB * q).collect();
            solution.coefficients(&charges)
        };
        Self { charge, first, coefficients: (0..solution.functions()).flat_map(of).collect() }
    }

    fn place(&self, [rho, z]: [f64; 2], (sin, cos): (f64, f64)) -> Vec3 {
        let axis = &self.charge.axis;
        axis.origin + (axis.frame[0] * cos + axis.frame[1] * sin) * rho + axis.frame[2] * z
    }
}

impl Rectangles for AxialPieces<'_> {
    fn elements(&self) -> Vec<Piece> {
        let sector = |k: usize| TAU * k as f64 / SECTORS as f64;
        (0..self.first.len() as u32)
            .flat_map(|e| (0..SECTORS).map(move |k| (e, k)))
            .map(|(e, k)| self.part(e, [0.0, sector(k)], [1.0, sector(k + 1)]))
            .collect()
    }

    fn part(&self, element: u32, low: [f64; 2], high: [f64; 2]) -> Piece {
        let solution = &self.charge.solution;
        let element_of = &solution.data.elements[element as usize];
        let rows = [low[0], 0.5 * (low[0] + high[0]), high[0]].map(|u| element_of.at(&solution.bodies, u).0);
        let turns = [low[1], 0.5 * (low[1] + high[1]), high[1]].map(f64::sin_cos);
        let at = |i: usize, j: usize| self.place(rows[i], turns[j]);
        let center = at(1, 1);
        let mut radius = 0.0_f64;
        for i in 0..3 {
            for j in 0..3 {
                radius = radius.max((at(i, j) - center).norm());
            }
        }
        let along = (at(0, 1) - center).norm().max((at(2, 1) - center).norm());
        // On a cap the middle line is shorter than the outer one.
        let across = (0..3).map(|i| 0.5 * (at(i, 0) - at(i, 2)).norm()).fold(0.0, f64::max);
        Piece::rectangle(center, BULGE * radius, [BULGE * along, BULGE * across], element, low, high)
    }

    fn points(
        &self,
        element: u32,
        low: [f64; 2],
        high: [f64; 2],
        degree: [usize; 2],
        each: &mut dyn FnMut(&Vec3, &[f64]),
    ) {
        let solution = &self.charge.solution;
        let of = &solution.data.elements[element as usize];
        let rule = |points: usize| solution.rules().rule(points.clamp(1, super::assembly::LARGEST_ORDER));
        // The charge is ρ times a polynomial of degree order - 1; round the axis it is constant.
        let (along, across) = (rule((degree[0] + of.order + 1).div_ceil(2)), rule((degree[1] + 2) / 2));
        let turns: Vec<(f64, f64)> =
            across.points.iter().map(|v| (low[1] + v * (high[1] - low[1])).sin_cos()).collect();
        let (n, functions) = (solution.unknowns(), solution.functions());
        let share = (high[0] - low[0]) * (high[1] - low[1]) / TAU;
        let (mut values, mut charges) = (vec![0.0; of.order], vec![0.0; functions]);
        let mut row = vec![0.0; functions];
        for (x, wx) in along.points.iter().zip(&along.weights) {
            let u = low[0] + x * (high[0] - low[0]);
            let place = of.at(&solution.bodies, u).0;
            legendre(u, &mut values);
            for (function, row) in row.iter_mut().enumerate() {
                let first = function * n + self.first[element as usize];
                let sum: f64 = self.coefficients[first..first + of.order].iter().zip(&values).map(|(c, p)| c * p).sum();
                *row = wx * share * place[0] * sum;
            }
            for (turn, wy) in turns.iter().zip(&across.weights) {
                for (q, row) in charges.iter_mut().zip(&row) {
                    *q = wy * row;
                }
                each(&self.place(place, *turn), &charges);
            }
        }
    }
}
