//! A charged surface in pieces that can be cut smaller, whatever its charges are: what tables are filled from.

use meshes::Vec3;

use crate::curved::CurvedPieces;
use crate::electrode_basis::{ElectrodeBasis, SurfaceCharge};
use crate::panel::{Panel, quadrature};

/// A part of a charged surface.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    /// Its middle, m.
    pub center: Vec3,
    /// Largest distance of its points from there, m.
    pub radius: f64,
    form: Form,
}

#[derive(Clone, Copy)]
enum Form {
    Triangle { corners: [Vec3; 3], panel: u32, share: f64 },
    Rectangle { element: u32, low: [f64; 2], high: [f64; 2] },
}

impl Piece {
    fn triangle(corners: [Vec3; 3], panel: u32, share: f64) -> Self {
        let center = corners.iter().sum::<Vec3>() / 3.0;
        let radius = corners.iter().map(|c| (c - center).norm()).fold(0.0, f64::max);
        Self { center, radius, form: Form::Triangle { corners, panel, share } }
    }

    /// A rectangle in the parameters of an element.
    pub fn rectangle(center: Vec3, radius: f64, element: u32, low: [f64; 2], high: [f64; 2]) -> Self {
        Self { center, radius, form: Form::Rectangle { element, low, high } }
    }
}

/// Surfaces whose elements are rectangles in some parameters.
pub(crate) trait Rectangles: Sync {
    /// All elements.
    fn elements(&self) -> Vec<Piece>;

    /// Part of an element.
    fn part(&self, element: u32, low: [f64; 2], high: [f64; 2]) -> Piece;

    /// Calls `each` with points (m) and their charges for all functions, over Coulomb's constant (V m): a rule that is exact
    /// for polynomials of that degree times the charge.
    fn points(&self, element: u32, low: [f64; 2], high: [f64; 2], degree: usize, each: &mut dyn FnMut(&Vec3, &[f64]));
}

/// The pieces of a solution.
pub(crate) enum Pieces<'a> {
    /// Triangles of constant charge: the panels, and their charges over Coulomb's constant, `panel * functions + function`.
    Panels(&'a [Panel], Vec<f64>, usize),
    /// Elements with charges of their own.
    Elements(Box<dyn Rectangles + 'a>),
}

impl<'a> Pieces<'a> {
    /// Of a solution.
    pub fn new(basis: &'a ElectrodeBasis) -> Self {
        let functions = basis.functions();
        match &basis.form {
            SurfaceCharge::Panels => {
                let charge = |p: usize| (0..functions).map(move |k| crate::constants::COULOMB * basis.charge[(p, k)]);
                Self::Panels(&basis.panels, (0..basis.panels.len()).flat_map(charge).collect(), functions)
            }
            SurfaceCharge::Curved(charge) => Self::Elements(Box::new(CurvedPieces::new(charge))),
        }
    }

    /// The whole surface.
    pub fn all(&self) -> Vec<Piece> {
        match self {
            Self::Panels(panels, ..) => {
                panels.iter().enumerate().map(|(p, panel)| Piece::triangle(panel.corners, p as u32, 1.0)).collect()
            }
            Self::Elements(elements) => elements.elements(),
        }
    }

    /// The four parts of a piece.
    pub fn quarters(&self, piece: &Piece) -> [Piece; 4] {
        match (piece.form, self) {
            (Form::Triangle { corners: [a, b, c], panel, share }, _) => {
                let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
                    .map(|corners| Piece::triangle(corners, panel, 0.25 * share))
            }
            (Form::Rectangle { element, low, high }, Self::Elements(elements)) => {
                let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
                [[false, false], [true, false], [false, true], [true, true]].map(|upper| {
                    let from = [0, 1].map(|k| if upper[k] { middle[k] } else { low[k] });
                    let to = [0, 1].map(|k| if upper[k] { high[k] } else { middle[k] });
                    elements.part(element, from, to)
                })
            }
            (Form::Rectangle { .. }, Self::Panels(..)) => [*piece; 4],
        }
    }

    /// Calls `each` with points and charges that act like the piece: exact for polynomials of that degree.
    pub fn points(&self, piece: &Piece, degree: usize, each: &mut dyn FnMut(&Vec3, &[f64])) {
        match (piece.form, self) {
            (Form::Triangle { corners, panel, share }, Self::Panels(_, charge, functions)) => {
                let own = &charge[panel as usize * functions..(panel as usize + 1) * functions];
                let mut charges = vec![0.0; *functions];
                for (y, weight) in quadrature::rule(degree).on(&corners) {
                    for (c, q) in charges.iter_mut().zip(own) {
                        *c = weight * share * q;
                    }
                    each(&y, &charges);
                }
            }
            (Form::Rectangle { element, low, high }, Self::Elements(elements)) => {
                elements.points(element, low, high, degree, each);
            }
            _ => {}
        }
    }
}
