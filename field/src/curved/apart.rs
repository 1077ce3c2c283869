//! Elements to begin with where surfaces come near each other: what a first solution would not see.
//!
//! Across a narrow gap the charge follows the local width of the gap. Points of elements much larger than the gap miss where it
//! is narrowest, a finer solution may miss it as well, and the two agree on what is wrong. So elements are divided beforehand
//! until the width changes little over each; between parallel faces that needs no division at all.

use meshes::{Patch, Vec3};
use rayon::prelude::*;

use super::element::{Ball, CurvedMesh, Element};
use crate::plane::Plane;
use crate::source::{Source, SourceKind};

/// Only where something is nearer than this share of an element's side.
const NEAR: f64 = 0.7;

/// Largest ratio of distances along an element. With 4, two layers of six wires (gap 1.5 wire radii) ran out of unknowns at 1e-3
/// after 7 s, with 2.8 they took 9.5 s, with 2 1.6 s; but boxes 1e-2 of their size apart are reached with 4 and not with 2.
const VARIATION: f64 = 2.0;

/// Distances are taken on a grid of as many points each way.
const GRID: usize = 5;

/// Most elements for each patch, on average, and most in all: where that is not enough, the error estimate has to tell.
const MOST: [usize; 2] = [12, 3000];

/// Patches may reach this much farther from their middle than the points that are looked at.
const BULGE: f64 = 1.3;

/// What an element may be near to.
struct Others<'a> {
    patches: &'a [Patch],
    electrode: &'a [u32],
    balls: Vec<Ball>,
    /// Patches by the height of their middles along x.
    sorted: Vec<u32>,
    /// Largest reach of all.
    widest: f64,
    sources: &'a [Source],
    ground: Option<Plane>,
}

impl Others<'_> {
    /// Patches of other electrodes that may come within a distance of a ball; of all, or of those known to be near.
    fn candidates(&self, of: u32, ball: &Ball, within: f64, among: Option<&[u32]>) -> Vec<u32> {
        let near = |&&p: &&u32| {
            let other = &self.balls[p as usize];
            let apart = (other.center - ball.center).norm() - BULGE * (other.reach + ball.reach);
            self.electrode[p as usize] != of && apart < within
        };
        let among = among.unwrap_or_else(|| {
            let most = within + BULGE * (self.widest + ball.reach);
            let up_to = |x: f64| self.sorted.partition_point(|&p| self.balls[p as usize].center.x < x);
            &self.sorted[up_to(ball.center.x - most)..up_to(ball.center.x + most)]
        });
        among.iter().filter(near).copied().collect()
    }

    /// Distance to the nearest other thing, m. The image in a grounded plane is twice as far as the plane.
    fn distance(&self, point: &Vec3, among: &[u32]) -> f64 {
        let mut least = f64::INFINITY;
        for &p in among {
            least = least.min(distance(&self.patches[p as usize], point));
        }
        for source in self.sources {
            let arm = point - source.center;
            match source.kind {
                SourceKind::Point => least = least.min(arm.norm()),
                SourceKind::ThinRing { radius } => {
                    let height = arm.dot(&source.frame[2]);
                    let rho = (arm.norm_squared() - height * height).max(0.0).sqrt();
                    least = least.min((rho - radius).hypot(height));
                }
                _ => {}
            }
        }
        if let Some(plane) = &self.ground {
            least = least.min(2.0 * plane.height(point).abs());
        }
        least
    }

    /// Whether to divide an element along each direction, and which patches it may be near to.
    fn divide(&self, element: &Element, among: Option<&[u32]>) -> ([bool; 2], Vec<u32>) {
        let patch = &self.patches[element.patch as usize];
        let ball = Ball::new(patch, element.low, element.high);
        let longest = ball.sides[0].max(ball.sides[1]);
        let near = self.candidates(self.electrode[element.patch as usize], &ball, NEAR * longest, among);
        let alone = self.ground.is_none() && !self.sources.iter().any(has_place);
        if near.is_empty() && alone {
            return ([false; 2], near);
        }
        let place = |i: usize| (i as f64 + 0.02) / (GRID as f64 - 0.96);
        let mut distance = [[0.0; GRID]; GRID];
        for (i, row) in distance.iter_mut().enumerate() {
            for (j, distance) in row.iter_mut().enumerate() {
                let [xi, eta] = element.parameters(place(i), place(j));
                *distance = self.distance(&patch.at(xi, eta), &near);
            }
        }
        let wanted = |along: usize| {
            (0..GRID).any(|line| {
                let at = |k: usize| if along == 0 { distance[k][line] } else { distance[line][k] };
                let least = (0..GRID).map(at).fold(f64::INFINITY, f64::min);
                let most = (0..GRID).map(at).fold(0.0, f64::max).min(ball.sides[along]);
                least < NEAR * ball.sides[along] && most > VARIATION * least
            })
        };
        ([wanted(0), wanted(1)], near)
    }
}

fn has_place(source: &Source) -> bool {
    matches!(source.kind, SourceKind::Point | SourceKind::ThinRing { .. })
}

/// Divides elements until the distance of other electrodes, of point and ring sources and of a grounded plane changes little
/// over each, where they are near.
pub fn apart(mesh: &CurvedMesh, sources: &[Source], ground: Option<Plane>) -> Vec<Element> {
    let balls: Vec<Ball> = mesh.patches.par_iter().map(|p| Ball::new(p, [0.0; 2], [1.0; 2])).collect();
    let mut sorted: Vec<u32> = (0..mesh.patches.len() as u32).collect();
    sorted.sort_by(|&a, &b| balls[a as usize].center.x.total_cmp(&balls[b as usize].center.x));
    let widest = balls.iter().map(|ball| ball.reach).fold(0.0, f64::max);
    let others = Others { patches: &mesh.patches, electrode: &mesh.electrode, balls, sorted, widest, sources, ground };
    let most = (MOST[0] * mesh.patches.len()).max(MOST[1] / 10).min(MOST[1].max(2 * mesh.elements.len()));
    let mut done = Vec::new();
    let mut pending: Vec<(Element, Option<Vec<u32>>)> = mesh.elements.iter().map(|e| (*e, None)).collect();
    while !pending.is_empty() {
        let enough = done.len() + pending.len() >= most;
        let judged: Vec<([bool; 2], Vec<u32>)> =
            pending.par_iter().map(|(element, among)| others.divide(element, among.as_deref())).collect();
        let mut next = Vec::new();
        for ((element, _), (along, near)) in pending.into_iter().zip(judged) {
            let mut parts = vec![element];
            for k in (0..2).filter(|&k| along[k] && !enough) {
                parts = parts.iter().flat_map(|part| part.halves(k)).collect();
            }
            if parts.len() == 1 {
                done.push(element);
            } else {
                next.extend(parts.into_iter().map(|part| (part, Some(near.clone()))));
            }
        }
        pending = next;
    }
    // Neighbours stay together, patch after patch.
    done.sort_by(|a, b| {
        (a.patch, a.low[0], a.low[1]).partial_cmp(&(b.patch, b.low[0], b.low[1])).unwrap_or(std::cmp::Ordering::Equal)
    });
    done
}

/// Distance of a point from a patch, m.
fn distance(patch: &Patch, point: &Vec3) -> f64 {
    let [a, b] = patch.parameters(point);
    (patch.at(a, b) - point).norm()
}
