//! A bounding-volume hierarchy over panels: what a segment hits, what is nearest, what lies inside.

use crate::{SurfaceMesh, Vec3, triangle};

/// Panels in one leaf. Four keeps a leaf within two cache lines of indices and the tree shallow.
const LEAF: usize = 4;

/// Barycentric slack with which panels overlap their edges, so that nothing slips through a seam. A few hundred times the
/// rounding of a crossing on a panel of ordinary shape.
const SEAM: f64 = 1e-12;

/// Axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    const EMPTY: Self = Self {
        min: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Vec3::new(-f64::INFINITY, -f64::INFINITY, -f64::INFINITY),
    };

    fn with(self, p: &Vec3) -> Self {
        Self { min: self.min.inf(p), max: self.max.sup(p) }
    }

    fn union(self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// Squared distance of a point, zero inside.
    fn distance_squared(&self, p: &Vec3) -> f64 {
        (self.min - p).sup(&(p - self.max)).sup(&Vec3::zeros()).norm_squared()
    }

    /// Squared distance of two boxes.
    fn gap_squared(&self, other: &Self) -> f64 {
        (self.min - other.max).sup(&(other.min - self.max)).sup(&Vec3::zeros()).norm_squared()
    }

    /// Whether `from + s · d` with `inverse = 1/d` is in the box for some s in [0, s_max].
    fn meets(&self, from: &Vec3, inverse: &Vec3, s_max: f64) -> bool {
        let (mut enter, mut leave) = (0.0_f64, s_max);
        for k in 0..3 {
            if inverse[k].is_infinite() {
                // Parallel to these faces: in the slab or never; on a face counts as in.
                if from[k] < self.min[k] || from[k] > self.max[k] {
                    return false;
                }
                continue;
            }
            let (a, b) = ((self.min[k] - from[k]) * inverse[k], (self.max[k] - from[k]) * inverse[k]);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave * (1.0 + 4.0 * f64::EPSILON)
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// Leaf: first entry of `order`. Inner node: the second child (the first is the next node).
    link: u32,
    /// Leaf: number of panels. Inner node: 0.
    count: u32,
}

/// Where a moving point meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// How far along the segment, 0 to 1.
    pub fraction: f64,
    /// Where, m.
    pub point: Vec3,
    /// Outward unit normal of the panel.
    pub normal: Vec3,
    /// Which panel.
    pub panel: usize,
    /// Which electrode.
    pub electrode: usize,
}

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// m.
    pub distance: f64,
    /// m.
    pub point: Vec3,
    /// Which panel.
    pub panel: usize,
    /// Which electrode.
    pub electrode: usize,
}

/// A bounding-volume hierarchy over the panels of a mesh, or of one electrode of it.
#[derive(Clone, Debug)]
pub struct SurfaceTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
    corners: Vec<[Vec3; 3]>,
    electrode: Vec<u32>,
    /// For each electrode: closed and not hollow.
    solid: Vec<bool>,
    /// For each electrode: closed.
    closed: Vec<bool>,
}

impl SurfaceTree {
    /// A tree over all panels of a mesh.
    pub fn new(mesh: &SurfaceMesh) -> Self {
        Self::over(mesh, 0..mesh.panels())
    }

    /// A tree over the panels of one electrode of a mesh; panel and electrode numbers are those of the whole mesh.
    pub fn of_electrode(mesh: &SurfaceMesh, electrode: usize) -> Self {
        Self::over(mesh, mesh.panels_of(electrode))
    }

    fn over(mesh: &SurfaceMesh, panels: std::ops::Range<usize>) -> Self {
        let corners: Vec<[Vec3; 3]> = (0..mesh.panels()).map(|p| mesh.corners(p)).collect();
        let mut order: Vec<u32> = panels.map(|p| p as u32).collect();
        let mut nodes = Vec::with_capacity(2 * order.len() / LEAF + 1);
        if !order.is_empty() {
            let count = order.len();
            let centroids: Vec<Vec3> = corners.iter().map(|corners| corners.iter().sum::<Vec3>() / 3.0).collect();
            split(&mut nodes, &corners, &centroids, &mut order, 0, count);
        }
        Self {
            nodes,
            order,
            corners,
            electrode: mesh.electrode.clone(),
            solid: mesh.electrodes.iter().map(|e| e.closed && !e.hollow).collect(),
            closed: mesh.electrodes.iter().map(|e| e.closed).collect(),
        }
    }

    /// The first panel on the way from one point to another, met from either side; ties go to the lowest panel number.
    pub fn first_hit(&self, from: &Vec3, to: &Vec3) -> Option<Hit> {
        let direction = to - from;
        let mut best: Option<(f64, usize)> = None;
        self.walk_segment(from, &direction, 1.0, |panel, s| {
            if best.is_none_or(|(least, which)| s < least || (s == least && panel < which)) {
                best = Some((s, panel));
            }
            best.map_or(1.0, |(least, _)| least)
        });
        best.map(|(fraction, panel)| {
            let [a, b, c] = self.corners[panel];
            Hit {
                fraction,
                point: from + direction * fraction,
                normal: (b - a).cross(&(c - a)).normalize(),
                panel,
                electrode: self.electrode[panel] as usize,
            }
        })
    }

    /// Calls `visit(panel, s)` for crossings with s in [0, limit]; what it returns is the new limit.
    fn walk_segment(&self, from: &Vec3, direction: &Vec3, limit: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let inverse = direction.map(|d| 1.0 / d);
        let mut limit = limit;
        let mut stack = Stack::new(&self.nodes);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index];
            if !node.bounds.meets(from, &inverse, limit) {
                continue;
            }
            if node.count == 0 {
                stack.push(node.link as usize);
                stack.push(index + 1);
                continue;
            }
            for &panel in &self.order[node.link as usize..(node.link + node.count) as usize] {
                let panel = panel as usize;
                if let Some(c) = triangle::crossing(from, direction, &self.corners[panel], SEAM)
                    && (0.0..=limit).contains(&c.s)
                {
                    limit = visit(panel, c.s);
                }
            }
        }
    }

    /// The nearest point of the surface within `reach` (m) of a point, or `None`.
    pub fn nearest(&self, point: &Vec3, reach: f64) -> Option<Nearest> {
        let mut best: Option<Nearest> = None;
        let mut least = reach * reach;
        let mut stack = Stack::new(&self.nodes);
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index];
            if node.bounds.distance_squared(point) > least {
                continue;
            }
            if node.count == 0 {
                let (a, b) = (index + 1, node.link as usize);
                let nearer_first =
                    self.nodes[a].bounds.distance_squared(point) <= self.nodes[b].bounds.distance_squared(point);
                let (near, far) = if nearer_first { (a, b) } else { (b, a) };
                stack.push(far);
                stack.push(near);
                continue;
            }
            for &panel in &self.order[node.link as usize..(node.link + node.count) as usize] {
                let panel = panel as usize;
                let q = triangle::closest_point(point, &self.corners[panel]);
                let d2 = (q - point).norm_squared();
                if d2 < least || (d2 == least && best.is_none_or(|b| panel < b.panel)) {
                    least = d2;
                    best = Some(Nearest {
                        distance: d2.sqrt(),
                        point: q,
                        panel,
                        electrode: self.electrode[panel] as usize,
                    });
                }
            }
        }
        best
    }

    /// The solid electrode (closed, not hollow) whose inside holds the point, or `None`.
    pub fn inside(&self, point: &Vec3) -> Option<usize> {
        self.enclosing(point, &self.solid).first().copied()
    }

    /// Every closed electrode, hollow or not, that encloses the point, in order.
    pub fn enclosed_by(&self, point: &Vec3) -> Vec<usize> {
        self.enclosing(point, &self.closed)
    }

    /// Electrodes among `wanted` with an odd number of crossings on a ray from the point.
    fn enclosing(&self, point: &Vec3, wanted: &[bool]) -> Vec<usize> {
        let Some(root) = self.nodes.first() else { return Vec::new() };
        if root.bounds.distance_squared(point) > 0.0 || !wanted.contains(&true) {
            return Vec::new();
        }
        // Far enough to leave the mesh in any direction.
        let length = 2.0 * (root.bounds.max - root.bounds.min).norm() + f64::MIN_POSITIVE;
        let mut crossings: Vec<(usize, u32)> = Vec::new();
        // Directions with no relation to the axes or to each other; the next is tried when a ray grazes an edge. On the
        // last one a grazing crossing is taken as it comes.
        let directions = [
            [0.6131, 0.5037, 0.6085],
            [-0.3911, 0.8017, -0.4523],
            [0.2039, -0.5479, 0.8113],
            [-0.7001, -0.3593, -0.6171],
        ];
        for (attempt, d) in directions.iter().enumerate() {
            crossings.clear();
            let mut grazing = false;
            let direction = Vec3::from(*d).normalize() * length;
            self.walk_segment(point, &direction, 1.0, |panel, _| {
                let e = self.electrode[panel] as usize;
                if wanted[e] {
                    let margin =
                        triangle::crossing(point, &direction, &self.corners[panel], SEAM).map_or(0.0, |c| c.margin);
                    grazing |= margin < 1e-9;
                    match crossings.iter_mut().find(|(which, _)| *which == e) {
                        Some((_, count)) => *count += 1,
                        None => crossings.push((e, 1)),
                    }
                }
                1.0
            });
            if !grazing || attempt + 1 == directions.len() {
                break;
            }
        }
        let mut inside: Vec<usize> = crossings.iter().filter(|(_, count)| count % 2 == 1).map(|(e, _)| *e).collect();
        inside.sort_unstable();
        inside
    }

    /// Least distance of two surfaces and the panels where it is found, m; zero where they cut or touch. Looks no further
    /// than `reach`, and gives `None` when nothing is within it.
    pub fn gap(&self, other: &Self, reach: f64) -> Option<(f64, usize, usize)> {
        if self.nodes.is_empty() || other.nodes.is_empty() {
            return None;
        }
        let mut best: Option<(f64, usize, usize)> = None;
        let mut least = reach;
        let mut stack = vec![(0_usize, 0_usize)];
        while let Some((i, j)) = stack.pop() {
            let (a, b) = (&self.nodes[i], &other.nodes[j]);
            if a.bounds.gap_squared(&b.bounds) > least * least {
                continue;
            }
            match (a.count, b.count) {
                (0, _) if b.count > 0 || size(a) >= size(b) => stack.extend([(a.link as usize, j), (i + 1, j)]),
                (_, 0) => stack.extend([(i, b.link as usize), (i, j + 1)]),
                _ => {
                    for &p in &self.order[a.link as usize..(a.link + a.count) as usize] {
                        for &q in &other.order[b.link as usize..(b.link + b.count) as usize] {
                            let d = triangle::distance(&self.corners[p as usize], &other.corners[q as usize]);
                            if d < least || (best.is_none() && d <= least) {
                                least = d;
                                best = Some((d, p as usize, q as usize));
                                if d == 0.0 {
                                    return best;
                                }
                            }
                        }
                    }
                }
            }
        }
        best
    }
}

fn size(node: &Node) -> f64 {
    (node.bounds.max - node.bounds.min).norm_squared()
}

/// Splits `order[first..first + count]` at the median of the longest side of its centroids' box, depth first.
fn split(
    nodes: &mut Vec<Node>,
    corners: &[[Vec3; 3]],
    centroids: &[Vec3],
    order: &mut [u32],
    first: usize,
    count: usize,
) {
    let part = &order[first..first + count];
    let bounds = part.iter().flat_map(|&p| corners[p as usize].iter()).fold(Bounds::EMPTY, |b, v| b.with(v));
    let index = nodes.len();
    nodes.push(Node { bounds, link: first as u32, count: count as u32 });
    if count <= LEAF {
        return;
    }
    let centroid = |p: u32| centroids[p as usize];
    let spread = part.iter().fold(Bounds::EMPTY, |b, &p| {
        let c = centroid(p);
        b.union(&Bounds { min: c, max: c })
    });
    let axis = (spread.max - spread.min).imax();
    let half = count / 2;
    // Ties are broken by panel number, so that the tree does not depend on the sorting algorithm.
    order[first..first + count]
        .select_nth_unstable_by(half, |&p, &q| centroid(p)[axis].total_cmp(&centroid(q)[axis]).then(p.cmp(&q)));
    split(nodes, corners, centroids, order, first, half);
    nodes[index].link = nodes.len() as u32;
    nodes[index].count = 0;
    split(nodes, corners, centroids, order, first + half, count - half);
}

/// A stack of node numbers without allocation: the tree is balanced, and 2^32 panels make 32 levels.
struct Stack {
    items: [usize; 72],
    len: usize,
}

impl Stack {
    fn new(nodes: &[Node]) -> Self {
        Self { items: [0; 72], len: usize::from(!nodes.is_empty()) }
    }

    fn push(&mut self, item: usize) {
        self.items[self.len] = item;
        self.len += 1;
    }

    fn pop(&mut self) -> Option<usize> {
        self.len = self.len.checked_sub(1)?;
        Some(self.items[self.len])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ElectrodeSurface;

    /// Closed octahedra of "radius" `r` around the given centres, one electrode each.
    fn octahedra(bodies: &[(Vec3, f64)]) -> SurfaceMesh {
        let mut mesh = SurfaceMesh::default();
        for (e, (c, r)) in bodies.iter().enumerate() {
            let base = mesh.vertices.len() as u32;
            for d in [Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()] {
                mesh.vertices.push(c + d * *r);
            }
            for x in [0, 1] {
                for y in [2, 3] {
                    for z in [4, 5] {
                        let t = [base + x, base + y, base + z];
                        let odd = (x + y + z) % 2 == 1;
                        mesh.triangles.push(if odd { [t[0], t[2], t[1]] } else { t });
                        mesh.electrode.push(e as u32);
                    }
                }
            }
            mesh.electrodes.push(ElectrodeSurface { name: format!("body{e}"), closed: true, hollow: false });
        }
        mesh
    }

    /// Numbers in [0, 1) from a fixed seed.
    fn random() -> impl FnMut() -> f64 {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    fn scattered() -> (SurfaceMesh, Vec<(Vec3, f64)>) {
        let mut next = random();
        let bodies: Vec<_> = (0..40)
            .map(|k| (Vec3::new((k % 4) as f64, (k / 4 % 4) as f64, (k / 16) as f64) * 2.0, 0.3 + 0.5 * next()))
            .collect();
        (octahedra(&bodies), bodies)
    }

    #[test]
    fn octahedra_point_outwards() {
        let (mesh, bodies) = scattered();
        for p in 0..mesh.panels() {
            let centre = bodies[mesh.electrode[p] as usize].0;
            assert!(mesh.area_vector(p).dot(&(mesh.centroid(p) - centre)) > 0.0);
        }
    }

    #[test]
    fn first_hit_and_nearest_agree_with_a_search_of_all_panels() {
        let (mesh, _) = scattered();
        let tree = SurfaceTree::new(&mesh);
        let mut next = random();
        let mut point = || Vec3::new(next(), next(), next()) * 10.0 - Vec3::repeat(1.0);
        let mut hits = 0;
        for _ in 0..2000 {
            let (a, b) = (point(), point());
            let slow = (0..mesh.panels())
                .filter_map(|p| triangle::crossing(&a, &(b - a), &mesh.corners(p), SEAM).map(|c| (c.s, p)))
                .filter(|(s, _)| (0.0..=1.0).contains(s))
                .min_by(|x, y| x.0.total_cmp(&y.0));
            let fast = tree.first_hit(&a, &b);
            assert_eq!(fast.map(|h| (h.fraction, h.panel)), slow);
            hits += usize::from(fast.is_some());
            let slow = (0..mesh.panels())
                .map(|p| (triangle::closest_point(&a, &mesh.corners(p)) - a).norm())
                .min_by(f64::total_cmp);
            assert_eq!(tree.nearest(&a, f64::INFINITY).map(|n| n.distance), slow);
        }
        assert!(hits > 200, "the test must see hits as well as misses: {hits}");
    }

    #[test]
    fn inside_is_where_the_octahedron_says() {
        let (mesh, bodies) = scattered();
        let tree = SurfaceTree::new(&mesh);
        let mut next = random();
        let mut found = 0;
        for _ in 0..5000 {
            let p = Vec3::new(next(), next(), next()) * 8.0 - Vec3::repeat(1.0);
            let expected = bodies.iter().position(|(c, r)| (p - c).abs().sum() < *r);
            assert_eq!(tree.inside(&p), expected, "at {p}");
            found += usize::from(expected.is_some());
        }
        assert!(found > 50, "the test must see insides: {found}");
        // A point from which straight rays along the axes would run through vertices and edges.
        assert_eq!(tree.inside(&bodies[5].0), Some(5));
    }

    #[test]
    fn gap_of_two_bodies() {
        let mesh = octahedra(&[(Vec3::zeros(), 1.0), (Vec3::x() * 2.5, 1.0), (Vec3::x() * 3.5, 1.0)]);
        let tree = |e| SurfaceTree::of_electrode(&mesh, e);
        assert!((tree(0).gap(&tree(1), f64::INFINITY).unwrap().0 - 0.5).abs() < 1e-15);
        assert_eq!(tree(0).gap(&tree(1), 0.4), None);
        assert_eq!(tree(1).gap(&tree(2), f64::INFINITY).unwrap().0, 0.0);
    }

    #[test]
    fn a_ray_along_an_axis_in_the_faces_of_boxes_is_stopped() {
        // The tree of one octahedron has two leaves, halves that share a plane through the centre; rays in it run in a face
        // of both boxes.
        let mesh = octahedra(&[(Vec3::zeros(), 1.0)]);
        let tree = SurfaceTree::new(&mesh);
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for shift in [0.0, 0.25] {
                    let across = Vec3::ith((axis + 1) % 3, shift);
                    let (from, to) = (Vec3::ith(axis, 1.5 * side) + across, Vec3::ith(axis, -0.1 * side) + across);
                    let hit = tree.first_hit(&from, &to).expect("the way into the octahedron is closed");
                    assert!((hit.point - Vec3::ith(axis, (1.0 - shift) * side) - across).norm() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_ray_along_a_seam_is_stopped() {
        let mesh = octahedra(&[(Vec3::zeros(), 1.0)]);
        let tree = SurfaceTree::new(&mesh);
        // Straight at a vertex, and at the middle of an edge.
        for target in [Vec3::x(), Vec3::new(0.5, 0.5, 0.0)] {
            let hit = tree.first_hit(&(target * 3.0), &Vec3::zeros()).expect("the surface is closed");
            assert!((hit.point - target).norm() < 1e-12);
        }
    }
}
