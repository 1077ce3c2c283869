//! Fewer triangles for the same picture.

use std::collections::HashMap;

use meshes::Vec3;

/// Triangles with a number each; which one of the file a triangle was stands beside it.
pub struct Triangles {
    /// Corners.
    pub vertices: Vec<Vec3>,
    /// Each with its number in the file.
    pub triangles: Vec<([u32; 3], usize)>,
}

/// At most so many triangles: vertices within one cell of a lattice become one, and triangles whose corners do, none. The lattice
/// becomes coarser until they are few enough. Method: vertex clustering, Rossignac and Borrel 1993; the first vertex of a cell stands for all, so
/// that edges stay where they were.
pub fn simplified(vertices: &[Vec3], triangles: Vec<([u32; 3], usize)>, most: usize) -> Triangles {
    let all = Triangles { vertices: vertices.to_vec(), triangles };
    let low = vertices.iter().copied().reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let size = vertices.iter().fold(0.0_f64, |size, v| size.max((v - low).amax()));
    if all.triangles.len() <= most || size == 0.0 {
        return all;
    }
    let mut cell = size / 4096.0;
    loop {
        let fewer = clustered(&all, low, cell);
        if fewer.triangles.len() <= most || cell > size {
            return fewer;
        }
        cell *= 1.5;
    }
}

fn clustered(all: &Triangles, low: Vec3, cell: f64) -> Triangles {
    let mut first: HashMap<[i64; 3], u32> = HashMap::new();
    let mut vertices = Vec::new();
    let stands: Vec<u32> = all
        .vertices
        .iter()
        .map(|v| {
            let key = [0, 1, 2].map(|k| ((v[k] - low[k]) / cell).floor() as i64);
            *first.entry(key).or_insert_with(|| {
                vertices.push(*v);
                (vertices.len() - 1) as u32
            })
        })
        .collect();
    let moved = all.triangles.iter().map(|(t, number)| (t.map(|v| stands[v as usize]), *number));
    let triangles = moved.filter(|([a, b, c], _)| a != b && b != c && c != a).collect();
    Triangles { vertices, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of n x n cells.
    fn square(n: u32) -> (Vec<Vec3>, Vec<([u32; 3], usize)>) {
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let vertices = (0..=n).flat_map(|i| (0..=n).map(move |j| Vec3::new(i.into(), j.into(), 0.0))).collect();
        let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let triangles = cells.flat_map(|(i, j)| {
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        });
        (vertices, triangles.enumerate().map(|(k, t)| (t, k)).collect())
    }

    fn area(mesh: &Triangles) -> f64 {
        let corner = |v: u32| mesh.vertices[v as usize];
        mesh.triangles
            .iter()
            .map(|([a, b, c], _)| (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a))).norm() / 2.0)
            .sum()
    }

    #[test]
    fn few_triangles_stay_and_many_become_fewer_over_the_same_square() {
        let (vertices, triangles) = square(60);
        let whole = simplified(&vertices, triangles.clone(), 7200);
        assert_eq!((whole.triangles.len(), whole.vertices.len()), (7200, 3721));
        let fewer = simplified(&vertices, triangles, 1000);
        assert!((100..=1000).contains(&fewer.triangles.len()), "{}", fewer.triangles.len());
        // A plane stays a plane; a rim of less than a cell of the lattice may be lost.
        assert!((area(&fewer) / 3600.0 - 1.0).abs() < 0.15, "{}", area(&fewer));
        assert!(fewer.triangles.iter().all(|(t, _)| t.iter().all(|v| (*v as usize) < fewer.vertices.len())));
    }
}
