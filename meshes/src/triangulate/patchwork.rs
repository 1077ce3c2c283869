//! Triangles put together from pieces whose borders coincide.

use std::collections::HashMap;

use super::Triangulation;
use crate::Vec3;

/// A surface under construction: pieces are added one by one and sewn together at the end.
#[derive(Default)]
pub(super) struct Patchwork {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Patchwork {
    /// Adds a point and returns its number.
    pub fn vertex(&mut self, p: Vec3) -> u32 {
        self.vertices.push(p);
        (self.vertices.len() - 1) as u32
    }

    /// The point of that number.
    pub fn at(&self, vertex: u32) -> Vec3 {
        self.vertices[vertex as usize]
    }

    /// Adds a triangle, counter-clockwise seen from outside.
    pub fn triangle(&mut self, a: u32, b: u32, c: u32) {
        self.triangles.push([a, b, c]);
    }

    /// Adds a quadrilateral, counter-clockwise seen from outside, cut along its shorter diagonal; `lean` decides when
    /// both are equally long.
    pub fn quad(&mut self, [a, b, c, d]: [u32; 4], lean: bool) {
        let length = |i: u32, j: u32| (self.vertices[i as usize] - self.vertices[j as usize]).norm();
        let (ac, bd) = (length(a, c), length(b, d));
        let along_ac = if (ac - bd).abs() <= 1e-9 * (ac + bd) { lean } else { ac < bd };
        if along_ac {
            self.triangle(a, b, c);
            self.triangle(a, c, d);
        } else {
            self.triangle(b, c, d);
            self.triangle(b, d, a);
        }
    }

    /// Adds the image of a grid of lines `us` × `vs`; ∂u × ∂v points outwards. Diagonals are mirrored in the middle of
    /// the grid, so that a symmetric patch has a symmetric mesh.
    pub fn grid(&mut self, us: &[f64], vs: &[f64], map: impl Fn(f64, f64) -> Vec3) {
        let base = self.vertices.len() as u32;
        let width = vs.len() as u32;
        for &u in us {
            for &v in vs {
                self.vertices.push(map(u, v));
            }
        }
        for i in 0..us.len() as u32 - 1 {
            for j in 0..width - 1 {
                let at = |i: u32, j: u32| base + i * width + j;
                let lean = (2 * i + 1 < us.len() as u32 - 1) == (2 * j + 1 < width - 1);
                self.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], lean);
            }
        }
    }

    /// Sews points closer than 1e-9 of the whole extent into one and drops what collapses (the quads at a pole).
    pub fn finish(self) -> Triangulation {
        let mut mesh = Triangulation { vertices: Vec::new(), triangles: Vec::new() };
        let Some(first) = self.vertices.first() else { return mesh };
        let (lo, hi) = self.vertices.iter().fold((*first, *first), |(lo, hi), v| (lo.inf(v), hi.sup(v)));
        let tolerance = 1e-9 * (hi - lo).norm().max(f64::MIN_POSITIVE);
        // Cells much larger than the tolerance: a twin is in the same cell or, near a wall, in a neighbouring one.
        let cell = 64.0 * tolerance;
        let key = |p: &Vec3| ((p - lo) / cell).map(|x| x.floor() as i64);
        let mut seen: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        let number: Vec<u32> = self
            .vertices
            .iter()
            .map(|p| {
                let corners = [key(&(p - Vec3::repeat(tolerance))), key(&(p + Vec3::repeat(tolerance)))];
                for x in corners[0].x..=corners[1].x {
                    for y in corners[0].y..=corners[1].y {
                        for z in corners[0].z..=corners[1].z {
                            let twin = seen.get(&[x, y, z]).and_then(|list| {
                                list.iter().find(|&&v| (mesh.vertices[v as usize] - p).norm() <= tolerance)
                            });
                            if let Some(&twin) = twin {
                                return twin;
                            }
                        }
                    }
                }
                let new = mesh.vertices.len() as u32;
                mesh.vertices.push(*p);
                let k = key(p);
                seen.entry([k.x, k.y, k.z]).or_default().push(new);
                new
            })
            .collect();
        for t in self.triangles {
            let [a, b, c] = t.map(|v| number[v as usize]);
            if a != b && b != c && c != a {
                mesh.triangles.push([a, b, c]);
            }
        }
        mesh
    }
}
