//! A charged surface in pieces that can be cut smaller, whatever its charges are: what tables are filled from.

use meshes::Vec3;

use crate::axial::AxialPieces;
use crate::constants::COULOMB;
use crate::curved::CurvedPieces;
use crate::electrode_basis::{ElectrodeBasis, SurfaceCharge};
use crate::panel::{Panel, quadrature};
use crate::plane::Plane;

/// A part of a charged surface.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    /// Its middle, m.
    pub center: Vec3,
    /// Largest distance of its points from there, m.
    pub radius: f64,
    /// How far it reaches along its two directions from the middle, m.
    reach: [f64; 2],
    form: Form,
    /// It is the image of that part in the grounded plane, with the opposite charge.
    image: bool,
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
        Self { center, radius, reach: [radius; 2], form: Form::Triangle { corners, panel, share }, image: false }
    }

    /// A rectangle in the parameters of an element.
    pub fn rectangle(center: Vec3, radius: f64, reach: [f64; 2], element: u32, low: [f64; 2], high: [f64; 2]) -> Self {
        Self { center, radius, reach, form: Form::Rectangle { element, low, high }, image: false }
    }
}

/// Surfaces whose elements are rectangles in some parameters.
pub(crate) trait Rectangles: Sync {
    /// All elements.
    fn elements(&self) -> Vec<Piece>;

    /// Part of an element.
    fn part(&self, element: u32, low: [f64; 2], high: [f64; 2]) -> Piece;

    /// Calls `each` with points (m) and their charges for all functions, over Coulomb's constant (V m): a rule that is exact
    /// for polynomials of these degrees along the two directions times the charge.
    fn points(
        &self,
        element: u32,
        low: [f64; 2],
        high: [f64; 2],
        degree: [usize; 2],
        each: &mut dyn FnMut(&Vec3, &[f64]),
    );
}

/// The pieces of a solution, with their images in a grounded plane.
pub(crate) struct Pieces<'a> {
    surface: Surface<'a>,
    ground: Option<Plane>,
}

enum Surface<'a> {
    /// Triangles of constant charge: the panels, and their charges over Coulomb's constant, `panel * functions + function`.
    Panels(&'a [Panel], Vec<f64>, usize),
    /// Elements with charges of their own.
    Elements(Box<dyn Rectangles + 'a>),
}

impl<'a> Pieces<'a> {
    /// Of a solution.
    pub fn new(basis: &'a ElectrodeBasis) -> Self {
        let functions = basis.functions();
        let surface = match &basis.form {
            SurfaceCharge::Panels => {
                let charge = |p: usize| (0..functions).map(move |k| COULOMB * basis.charge[(p, k)]);
                Surface::Panels(&basis.panels, (0..basis.panels.len()).flat_map(charge).collect(), functions)
            }
            SurfaceCharge::Curved(charge) => Surface::Elements(Box::new(CurvedPieces::new(charge))),
            SurfaceCharge::Axial(charge) => Surface::Elements(Box::new(AxialPieces::new(charge))),
        };
        Self { surface, ground: basis.ground }
    }

    /// The whole surface.
    pub fn all(&self) -> Vec<Piece> {
        let mut all = match &self.surface {
            Surface::Panels(panels, ..) => {
                panels.iter().enumerate().map(|(p, panel)| Piece::triangle(panel.corners, p as u32, 1.0)).collect()
            }
            Surface::Elements(elements) => elements.elements(),
        };
        if let Some(plane) = &self.ground {
            let images: Vec<Piece> =
                all.iter().map(|piece| Piece { center: plane.image(&piece.center), image: true, ..*piece }).collect();
            all.extend(images);
        }
        all
    }

    /// The parts of a piece: four, or halves of one much longer than wide.
    pub fn parts(&self, piece: &Piece) -> impl Iterator<Item = Piece> {
        let mut parts: [Option<Piece>; 4] = [None; 4];
        match (piece.form, &self.surface) {
            (Form::Triangle { corners: [a, b, c], panel, share }, _) => {
                let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
                parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
                    .map(|corners| Some(Piece::triangle(corners, panel, 0.25 * share)));
            }
            (Form::Rectangle { element, low, high }, Surface::Elements(elements)) => {
                let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
                let cut = [0, 1].map(|k| piece.reach[k] > 0.5 * piece.reach[1 - k]);
                for (upper, part) in [[false, false], [true, false], [false, true], [true, true]].iter().zip(&mut parts)
                {
                    if (0..2).any(|k| upper[k] && !cut[k]) {
                        continue;
                    }
                    let from = [0, 1].map(|k| if upper[k] { middle[k] } else { low[k] });
                    let to = [0, 1].map(|k| if cut[k] && !upper[k] { middle[k] } else { high[k] });
                    *part = Some(elements.part(element, from, to));
                }
            }
            (Form::Rectangle { .. }, Surface::Panels(..)) => {}
        }
        let plane = self.ground.filter(|_| piece.image);
        parts.into_iter().flatten().map(move |part| match plane {
            Some(plane) => Piece { center: plane.image(&part.center), image: true, ..part },
            None => part,
        })
    }

    /// Calls `each` with points and charges that act like the piece: exact for polynomials of the degree that a part of some
    /// size (m) asks for.
    pub fn points(&self, piece: &Piece, degree: &dyn Fn(f64) -> usize, each: &mut dyn FnMut(&Vec3, &[f64])) {
        match self.ground.filter(|_| piece.image) {
            None => self.real_points(piece, degree, each),
            Some(plane) => {
                let mut opposite = Vec::new();
                self.real_points(piece, degree, &mut |y, charges| {
                    opposite.clear();
                    opposite.extend(charges.iter().map(|q| -q));
                    each(&plane.image(y), &opposite);
                });
            }
        }
    }

    fn real_points(&self, piece: &Piece, degree: &dyn Fn(f64) -> usize, each: &mut dyn FnMut(&Vec3, &[f64])) {
        match (piece.form, &self.surface) {
            (Form::Triangle { corners, panel, share }, Surface::Panels(_, charge, functions)) => {
                let own = &charge[panel as usize * functions..(panel as usize + 1) * functions];
                let mut charges = vec![0.0; *functions];
                for (y, weight) in quadrature::rule(degree(piece.radius)).on(&corners) {
                    for (c, q) in charges.iter_mut().zip(own) {
                        *c = weight * share * q;
                    }
                    each(&y, &charges);
                }
            }
            (Form::Rectangle { element, low, high }, Surface::Elements(elements)) => {
                elements.points(element, low, high, piece.reach.map(degree), each);
            }
            _ => {}
        }
    }
}
