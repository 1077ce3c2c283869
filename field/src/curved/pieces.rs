//! Curved elements in pieces, for tables.

use meshes::Vec3;

use super::charge::CurvedCharge;
use super::element::Ball;
use super::kernel::Moments;
use super::legendre::{MAX_ORDER, Transform, legendre};
use crate::gauss::gauss;
use crate::pieces::{Piece, Rectangles};

/// Curved elements with the coefficients of their charges.
pub(crate) struct CurvedPieces<'a> {
    charge: &'a CurvedCharge,
    /// `element * functions + function`.
    coefficients: Vec<Moments>,
}

impl<'a> CurvedPieces<'a> {
    /// Of a charge.
    pub fn new(charge: &'a CurvedCharge) -> Self {
        let transform = Transform::new(charge.mesh.order);
        let of = |e: usize| (0..charge.functions).map(move |f| (e, f));
        let coefficients = (0..charge.mesh.elements.len())
            .flat_map(of)
            .map(|(e, f)| transform.coefficients(charge.of_element(e, f)))
            .collect();
        Self { charge, coefficients }
    }
}

/// Points of a rectangle may lie this much farther from its middle than its corners do.
const BULGE: f64 = 1.05;

impl Rectangles for CurvedPieces<'_> {
    fn elements(&self) -> Vec<Piece> {
        let all = self.charge.mesh.elements.iter().enumerate();
        all.map(|(e, element)| self.part(e as u32, element.low, element.high)).collect()
    }

    fn part(&self, element: u32, low: [f64; 2], high: [f64; 2]) -> Piece {
        let ball = Ball::new(self.charge.mesh.patch_of(element as usize), low, high);
        Piece::rectangle(ball.center, BULGE * ball.reach, ball.sides.map(|side| 0.5 * BULGE * side), element, low, high)
    }

    fn points(
        &self,
        element: u32,
        low: [f64; 2],
        high: [f64; 2],
        degree: [usize; 2],
        each: &mut dyn FnMut(&Vec3, &[f64]),
    ) {
        let mesh = &*self.charge.mesh;
        let (patch, whole) = (mesh.patch_of(element as usize), &mesh.elements[element as usize]);
        let [along, across] = degree.map(|degree| gauss((degree + mesh.order).div_ceil(2).min(32)));
        let width = [0, 1].map(|k| whole.high[k] - whole.low[k]);
        let place = |k: usize, x: f64| low[k] + x * (high[k] - low[k]);
        let share = (high[0] - low[0]) * (high[1] - low[1]) / (width[0] * width[1]);
        let columns: Vec<_> = across
            .points
            .iter()
            .map(|y| (patch.column(place(1, *y)), legendre((place(1, *y) - whole.low[1]) / width[1])))
            .collect();
        let functions = self.charge.functions;
        let of = &self.coefficients[element as usize * functions..(element as usize + 1) * functions];
        let (e, mut rows) = (patch.direction(), vec![[0.0; MAX_ORDER]; functions]);
        let mut charges = vec![0.0; functions];
        for (x, wx) in along.points.iter().zip(&along.weights) {
            let ([s, c], pu) = (patch.row(place(0, *x)), legendre((place(0, *x) - whole.low[0]) / width[0]));
            for (row, of) in rows.iter_mut().zip(of) {
                *row = [0.0; MAX_ORDER];
                for i in 0..mesh.order {
                    for j in 0..mesh.order {
                        row[j] += pu[i] * of[i][j];
                    }
                }
            }
            for ((column, pv), wy) in columns.iter().zip(&across.weights) {
                for (q, row) in charges.iter_mut().zip(&rows) {
                    *q = wx * wy * share * row.iter().zip(pv).map(|(a, p)| a * p).sum::<f64>();
                }
                each(&(column.base + column.step * s + e * c), &charges);
            }
        }
    }
}
