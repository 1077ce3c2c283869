//! Panels or elements in clusters of neighbours, and which of them are near each other.

use meshes::Vec3;
use std::ops::Range;

/// A box of panels in a binary tree.
#[derive(Clone, Debug)]
struct Node {
    /// Bounds of the centroids, m.
    low: Vec3,
    high: Vec3,
    /// Largest radius of a panel, m.
    radius: f64,
    panels: Range<usize>,
    /// The second half; the first follows its parent. Zero for a leaf.
    second: usize,
}

/// Panels ordered so that each cluster, and each half of the tree above, is compact.
#[derive(Clone, Debug)]
pub(crate) struct Clusters {
    /// Number of the panel at each place.
    pub order: Vec<u32>,
    nodes: Vec<Node>,
}

impl Clusters {
    /// Halves along the longest side until no cluster has more than `size` panels.
    ///
    /// Each panel is its middle and how far it reaches from there, m.
    pub fn new(panels: &[(Vec3, f64)], size: usize) -> Self {
        let mut clusters = Self { order: (0..panels.len() as u32).collect(), nodes: Vec::new() };
        if !panels.is_empty() {
            let mut order = std::mem::take(&mut clusters.order);
            clusters.divide(panels, &mut order, 0, size);
            clusters.order = order;
        }
        clusters
    }

    fn divide(&mut self, panels: &[(Vec3, f64)], order: &mut [u32], first: usize, size: usize) {
        let panel = |p: &u32| panels[*p as usize];
        let start = panel(&order[0]).0;
        let (low, high, radius) = order
            .iter()
            .map(panel)
            .fold((start, start, 0.0_f64), |(l, h, r), (x, reach)| (l.inf(&x), h.sup(&x), r.max(reach)));
        let at = self.nodes.len();
        self.nodes.push(Node { low, high, radius, panels: first..first + order.len(), second: 0 });
        if order.len() > size {
            let axis = (high - low).imax();
            let half = order.len() / 2;
            // Ties are broken by number, so that the order does not depend on the sorting algorithm.
            order.select_nth_unstable_by(half, |p, q| panel(p).0[axis].total_cmp(&panel(q).0[axis]).then(p.cmp(q)));
            let (below, above) = order.split_at_mut(half);
            self.divide(panels, below, first, size);
            self.nodes[at].second = self.nodes.len();
            self.divide(panels, above, first + half, size);
        }
    }

    /// Places of each cluster.
    pub fn leaves(&self) -> Vec<Range<usize>> {
        self.nodes.iter().filter(|n| n.second == 0).map(|n| n.panels.clone()).collect()
    }

    /// Runs of places that may hold panels nearer to a point than `factor` times the sum of their radius and `radius`.
    pub fn near(&self, point: &Vec3, radius: f64, factor: f64, mut found: impl FnMut(Range<usize>)) {
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(n) = open.pop() {
            let node: &Node = &self.nodes[n];
            let gap = (node.low - point).sup(&(point - node.high)).sup(&Vec3::zeros()).norm_squared();
            if gap > (factor * (radius + node.radius)).powi(2) {
                continue;
            }
            if node.second == 0 {
                found(node.panels.clone());
            } else {
                open.push(node.second);
                open.push(n + 1);
            }
        }
    }
}
