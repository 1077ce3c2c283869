//! Symmetry of a problem, found from its points: which of them carry the same charge.
//!
//! Mirrors in the three coordinate planes through the middle, and exchanges of two coordinates, are tried one by one. Those
//! that map points to points and leave every wanted potential as it is make all charges symmetric: one unknown for each
//! **orbit** of points. Mirrors that change the wanted potentials (two rings, one of them at 1 V) split them into even and odd
//! parts, solved one after the other: **sectors**.

use std::collections::HashMap;

use faer::Mat;
use meshes::Vec3;

/// Orbits of points under a group, with the signs of each sector.
#[derive(Clone, Debug)]
pub struct Symmetry {
    /// For each operation of the group, where each point goes; the identity first.
    pub images: Vec<Vec<u32>>,
    /// For each operation, which sign-changing mirrors it contains, one bit each.
    pub parity: Vec<u32>,
    /// Number of sign-changing mirrors.
    pub mirrors: u32,
    /// One point of each orbit, ascending.
    pub representatives: Vec<u32>,
}

/// A coordinate operation: `out[k] = sign[k] * in[from[k]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Operation {
    from: [usize; 3],
    sign: [f64; 3],
}

impl Operation {
    const IDENTITY: Self = Self { from: [0, 1, 2], sign: [1.0; 3] };

    fn apply(&self, v: &Vec3) -> Vec3 {
        Vec3::from_fn(|k, _| self.sign[k] * v[self.from[k]])
    }

    /// First `self`, then `next`.
    fn then(&self, next: &Self) -> Self {
        Self {
            from: std::array::from_fn(|k| self.from[next.from[k]]),
            sign: std::array::from_fn(|k| next.sign[k] * self.sign[next.from[k]]),
        }
    }

    /// Mirrors in coordinate planes, then exchanges of two coordinates.
    fn candidates() -> Vec<Self> {
        let mirror = |k: usize| {
            let mut sign = [1.0; 3];
            sign[k] = -1.0;
            Self { from: [0, 1, 2], sign }
        };
        let exchange = |i: usize, j: usize| {
            let mut from = [0, 1, 2];
            from.swap(i, j);
            Self { from, sign: [1.0; 3] }
        };
        vec![mirror(0), mirror(1), mirror(2), exchange(0, 1), exchange(1, 2), exchange(0, 2)]
    }
}

/// How far an image may lie from a point, relative to the whole extent.
const TOLERANCE: f64 = 1e-9;

/// What is left of a potential that vanishes by symmetry, relative.
const ROUNDING: f64 = 1e-13;

/// Points by place.
struct Places<'a> {
    points: &'a [Vec3],
    cell: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Places<'a> {
    fn new(points: &'a [Vec3], cell: f64) -> Self {
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(points.len());
        for (p, x) in points.iter().enumerate() {
            cells.entry(Self::key(x, cell)).or_default().push(p as u32);
        }
        Self { points, cell, cells }
    }

    fn key(x: &Vec3, cell: f64) -> [i64; 3] {
        [0, 1, 2].map(|k| (x[k] / cell).floor() as i64)
    }

    /// The nearest point within the tolerance.
    fn find(&self, x: &Vec3, tolerance: f64) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        let [low, high] = [-tolerance, tolerance].map(|t| Self::key(&x.add_scalar(t), self.cell));
        for i in low[0]..=high[0] {
            for j in low[1]..=high[1] {
                for k in low[2]..=high[2] {
                    for &p in self.cells.get(&[i, j, k]).into_iter().flatten() {
                        let d = (self.points[p as usize] - x).norm();
                        if d <= tolerance && best.is_none_or(|(least, _)| d < least) {
                            best = Some((d, p));
                        }
                    }
                }
            }
        }
        best.map(|(_, p)| p)
    }
}

impl Symmetry {
    /// No symmetry: every point an orbit of its own.
    pub fn none(points: usize) -> Self {
        let identity: Vec<u32> = (0..points as u32).collect();
        Self { images: vec![identity.clone()], parity: vec![0], mirrors: 0, representatives: identity }
    }

    /// Finds the symmetry of points on electrodes with wanted potentials, a column for each problem, above a plane with this
    /// normal if there is one.
    pub fn find(points: &[Vec3], electrode: &[u32], wanted: &Mat<f64>, plane: Option<&Vec3>) -> Self {
        let Some(first) = points.first() else { return Self::none(0) };
        let (low, high) = points.iter().fold((*first, *first), |(l, h), p| (l.inf(p), h.sup(p)));
        let (center, size) = (0.5 * (low + high), (high - low).norm());
        let tolerance = TOLERANCE * size;
        let centred: Vec<Vec3> = points.iter().map(|p| p - center).collect();
        let places = Places::new(&centred, (size / (points.len() as f64).cbrt().max(1.0)).max(4.0 * tolerance));
        let image = |operation: &Operation| -> Option<Vec<u32>> {
            // A plane stays where it is if its normal does: the middle of all points does in any case.
            if plane.is_some_and(|normal| (operation.apply(normal) - normal).norm() > TOLERANCE) {
                return None;
            }
            // A few points decide most cases.
            let probe = |p: usize| places.find(&operation.apply(&centred[p]), tolerance);
            let stride = (points.len() / 16).max(1);
            if (0..points.len()).step_by(stride).any(|p| probe(p).is_none()) {
                return None;
            }
            let images: Option<Vec<u32>> = (0..points.len()).map(probe).collect();
            let images = images?;
            let mut hit = vec![false; points.len()];
            let mut electrodes: HashMap<u32, u32> = HashMap::new();
            for (p, &q) in images.iter().enumerate() {
                if std::mem::replace(&mut hit[q as usize], true) {
                    return None;
                }
                if *electrodes.entry(electrode[p]).or_insert(electrode[q as usize]) != electrode[q as usize] {
                    return None;
                }
            }
            Some(images)
        };
        let scale = (0..wanted.ncols()).map(|c| (0..wanted.nrows()).fold(0.0_f64, |m, p| m.max(wanted[(p, c)].abs())));
        let scale: Vec<f64> = scale.collect();
        let keeps = |images: &[u32]| {
            (0..wanted.ncols()).all(|c| {
                let same = |p: usize, q: u32| (wanted[(p, c)] - wanted[(q as usize, c)]).abs() <= 1e-9 * scale[c];
                images.iter().enumerate().all(|(p, &q)| same(p, q))
            })
        };
        // Generators: operations that keep all potentials, and mirrors that do not, one bit each.
        let mut generators: Vec<Generator> = Vec::new();
        let mut mirrors = 0;
        for (number, operation) in Operation::candidates().into_iter().enumerate() {
            let Some(images) = image(&operation) else { continue };
            if keeps(&images) {
                generators.push((operation, 0, images));
            } else if number < 3 {
                generators.push((operation, 1 << mirrors, images));
                mirrors += 1;
            }
        }
        let identity: Vec<u32> = (0..points.len() as u32).collect();
        let group = closure(&generators, &identity).unwrap_or_else(|| {
            // Exchanges that turn one sign-changing mirror into another: mirrors alone always go together.
            generators.retain(|(operation, ..)| operation.from == [0, 1, 2]);
            closure(&generators, &identity).unwrap_or_default()
        });
        if group.is_empty() {
            return Self::none(points.len());
        }
        let mut symmetry = Self { images: Vec::new(), parity: Vec::new(), mirrors, representatives: Vec::new() };
        for (_, parity, images) in group {
            symmetry.images.push(images);
            symmetry.parity.push(parity);
        }
        let least = |p: usize| symmetry.images.iter().map(|images| images[p]).min();
        symmetry.representatives = (0..points.len() as u32).filter(|&p| least(p as usize) == Some(p)).collect();
        symmetry
    }

    /// Order of the group.
    pub fn order(&self) -> usize {
        self.images.len()
    }

    /// Sign of each operation in a sector.
    pub fn signs(&self, sector: u32) -> Vec<f64> {
        self.parity.iter().map(|parity| if (parity & sector).count_ones() % 2 == 1 { -1.0 } else { 1.0 }).collect()
    }

    /// For each point in a sector its orbit, a number into the unknowns of the sector, and its sign; `None` where the sector
    /// has no charge (on the plane of an odd mirror).
    pub fn orbits(&self, sector: u32) -> (Vec<Option<(u32, f64)>>, Vec<u32>) {
        let signs = self.signs(sector);
        let mut of = vec![None; self.images[0].len()];
        let mut unknowns = Vec::new();
        for &p in &self.representatives {
            let fixed_oddly =
                self.images.iter().zip(&signs).any(|(images, sign)| images[p as usize] == p && *sign < 0.0);
            if fixed_oddly {
                continue;
            }
            for (images, sign) in self.images.iter().zip(&signs) {
                of[images[p as usize] as usize] = Some((unknowns.len() as u32, *sign));
            }
            unknowns.push(p);
        }
        (of, unknowns)
    }

    /// A row of a matrix with the columns of an orbit added up, for that many unknowns.
    pub fn folded(row: &[f64], of: &[Option<(u32, f64)>], unknowns: usize) -> Vec<f64> {
        let mut folded = vec![0.0; unknowns];
        for (value, orbit) in row.iter().zip(of) {
            if let Some((unknown, sign)) = orbit {
                folded[*unknown as usize] += sign * value;
            }
        }
        folded
    }

    /// Adds a sector's unknowns to the values of all points.
    pub fn unfold(unknowns: &Mat<f64>, of: &[Option<(u32, f64)>], values: &mut Mat<f64>) {
        for c in 0..unknowns.ncols() {
            for (p, orbit) in of.iter().enumerate() {
                if let Some((unknown, sign)) = orbit {
                    values[(p, c)] += sign * unknowns[(*unknown as usize, c)];
                }
            }
        }
    }

    /// The parts of wanted potentials that belong to the sectors; sectors in which nothing is wanted are left out.
    pub fn parts(&self, wanted: &Mat<f64>) -> Vec<(u32, Mat<f64>)> {
        let all = (0..1_u32 << self.mirrors).map(|sector| (sector, self.part(sector, wanted)));
        let largest = |m: &Mat<f64>, c: usize| m.col(c).iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        all.filter(|(_, part)| (0..part.ncols()).any(|c| largest(part, c) > ROUNDING * largest(wanted, c))).collect()
    }

    /// The part of wanted potentials that belongs to a sector.
    pub(crate) fn part(&self, sector: u32, wanted: &Mat<f64>) -> Mat<f64> {
        let signs = self.signs(sector);
        let share = 1.0 / self.order() as f64;
        Mat::from_fn(wanted.nrows(), wanted.ncols(), |p, c| {
            let sum: f64 = self.images.iter().zip(&signs).map(|(images, s)| s * wanted[(images[p] as usize, c)]).sum();
            share * sum
        })
    }
}

/// An operation, its parity, and where it takes each point.
type Generator = (Operation, u32, Vec<u32>);

/// All products of generators, the identity first; `None` if one operation would have two parities.
fn closure(generators: &[Generator], identity: &[u32]) -> Option<Vec<Generator>> {
    let mut group = vec![(Operation::IDENTITY, 0, identity.to_vec())];
    let mut next = 0;
    while next < group.len() {
        for (generator, bit, moves) in generators {
            let (operation, parity, images) = &group[next];
            let product = (operation.then(generator), parity ^ bit);
            match group.iter().find(|(o, ..)| *o == product.0) {
                Some((_, known, _)) if *known != product.1 => return None,
                Some(_) => {}
                None => {
                    let images = images.iter().map(|&p| moves[p as usize]).collect();
                    group.push((product.0, product.1, images));
                }
            }
        }
        next += 1;
    }
    Some(group)
}
