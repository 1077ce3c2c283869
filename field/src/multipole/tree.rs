//! An adaptive octree over sources and targets, and who meets whom in it.

use meshes::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Levels of halving: what a key of 63 bits holds.
const DEEPEST: u8 = 20;

/// Side of the root over the extent of the points, and where it stands: electrodes are symmetric, and panels crowd at their
/// edges. With a root that fits, these would be edges and corners of cubes, where expansions are worst: errors of 1e-8
/// instead of 4e-9 for a graded sheet.
const MARGIN: f64 = 1.07;
const ASIDE: [f64; 3] = [0.0217, -0.0173, 0.0271];

/// One cube of the octree.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// 0 for the root.
    pub level: u8,
    /// Number of the cube along each axis among the cubes of its level.
    pub cell: [u32; 3],
    /// Its sources, in the tree's order.
    pub sources: Range<u32>,
    /// Its targets, in the tree's order.
    pub targets: Range<u32>,
    /// The cube that holds it.
    pub parent: u32,
    /// Its eighths that hold anything, one after the other; empty for a leaf.
    pub children: Range<u32>,
    /// Largest distance below which one of its sources is not a point, m.
    pub reach: f64,
}

impl Node {
    pub fn is_leaf(&self) -> bool {
        self.children.is_empty()
    }

    pub fn source_range(&self) -> Range<usize> {
        self.sources.start as usize..self.sources.end as usize
    }

    pub fn target_range(&self) -> Range<usize> {
        self.targets.start as usize..self.targets.end as usize
    }

    pub fn child_range(&self) -> Range<usize> {
        self.children.start as usize..self.children.end as usize
    }

    /// Which eighth of its parent it is: bit k for axis k.
    pub fn octant(&self) -> usize {
        (0..3).map(|k| ((self.cell[k] & 1) as usize) << k).sum()
    }

    /// Whether two cubes, the first not smaller than the second, touch or overlap.
    fn touches(&self, smaller: &Self) -> bool {
        let shift = smaller.level - self.level;
        (0..3).all(|k| {
            let (low, high) = (u64::from(self.cell[k]) << shift, (u64::from(self.cell[k]) + 1) << shift);
            let cell = u64::from(smaller.cell[k]);
            cell + 1 >= low && cell <= high
        })
    }
}

/// The octree: levels from the root down, each in the order of a space-filling curve.
#[derive(Clone, Debug)]
pub(super) struct Octree {
    pub nodes: Vec<Node>,
    pub levels: Vec<Range<usize>>,
    /// Corner of the root, m.
    corner: Vec3,
    /// Side of the root, m.
    side: f64,
    /// Number of each source in the order of the tree.
    pub source_order: Vec<u32>,
    /// Number of each target in the order of the tree.
    pub target_order: Vec<u32>,
}

/// How many of what a leaf holds, and what decides between expansions and sums.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// A cube with more sources or targets is halved.
    pub leaf: usize,
    /// Pairs of points up to which two cubes act point by point rather than by a translation.
    pub pairs: usize,
    /// Points up to which a cube acts point by point rather than by values of an expansion at single points.
    pub single: usize,
}

/// What acts on one cube.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    /// Sources that act point by point on all targets of the cube.
    pub direct: Vec<Range<u32>>,
    /// Cubes of the same size whose multipoles are translated, with the direction from them to here.
    pub translated: Vec<(u32, [i8; 3])>,
    /// Larger leaves whose sources go into the local expansion one by one.
    pub sources: Vec<u32>,
    /// Smaller cubes whose multipoles are evaluated at each target (for leaves only).
    pub multipoles: Vec<u32>,
}

/// Spreads 21 bits to every third place.
fn spread(v: u32) -> u64 {
    let mut x = u64::from(v) & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

impl Octree {
    /// A tree; `reach` is empty or holds one distance for each source.
    pub fn new(sources: &[Vec3], targets: &[Vec3], reach: &[f64], shape: &Shape) -> Self {
        let bounds = |points: &[Vec3]| {
            points
                .iter()
                .fold((Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)), |(l, h), p| (l.inf(p), h.sup(p)))
        };
        let ((l1, h1), (l2, h2)) = (bounds(sources), bounds(targets));
        let (low, high) = (l1.inf(&l2), h1.sup(&h2));
        let extent = (high - low).max();
        let side = if extent > 0.0 && extent.is_finite() { extent * MARGIN } else { 1.0 };
        let corner = if extent.is_finite() {
            (low + high) / 2.0 - (Vec3::repeat(0.5) + Vec3::from(ASIDE)) * side
        } else {
            Vec3::zeros()
        };
        let scale = f64::from(1_u32 << DEEPEST) / side;
        let highest = (1_u32 << DEEPEST) - 1;
        let sorted = |points: &[Vec3]| -> Vec<(u64, u32)> {
            let mut keys: Vec<(u64, u32)> = points
                .par_iter()
                .enumerate()
                .map(|(i, p)| {
                    // Conversion saturates.
                    let cell = ((p - corner) * scale).map(|v| (v as u32).min(highest));
                    (spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2, i as u32)
                })
                .collect();
            keys.par_sort_unstable();
            keys
        };
        let (source_keys, target_keys) = (sorted(sources), sorted(targets));
        let largest = |range: &Range<u32>| {
            if reach.is_empty() {
                return 0.0;
            }
            let keys = &source_keys[range.start as usize..range.end as usize];
            keys.iter().map(|(_, i)| reach[*i as usize]).fold(0.0, f64::max)
        };
        let all = 0..sources.len() as u32;
        let mut nodes = vec![Node {
            level: 0,
            cell: [0; 3],
            reach: largest(&all),
            sources: all,
            targets: 0..targets.len() as u32,
            parent: 0,
            children: 0..0,
        }];
        let mut levels: Vec<Range<usize>> = Vec::new();
        levels.push(0..1);
        for level in 0..DEEPEST {
            let width = side / f64::from(1_u32 << level);
            let these = levels[level as usize].clone();
            let below: Vec<Vec<Node>> = these
                .clone()
                .into_par_iter()
                .map(|n| {
                    let node: &Node = &nodes[n];
                    let crowded = node.sources.len() > shape.leaf || node.targets.len() > shape.leaf;
                    if !crowded || 0.5 * width < node.reach {
                        return Vec::new();
                    }
                    let shift = 3 * u32::from(DEEPEST - level - 1);
                    let cut = |keys: &[(u64, u32)], range: &Range<u32>, octant: u64| {
                        let part = &keys[range.start as usize..range.end as usize];
                        range.start + part.partition_point(|(key, _)| (key >> shift) & 7 < octant) as u32
                    };
                    (0..8_u64)
                        .filter_map(|octant| {
                            let range = |keys: &[(u64, u32)], all: &Range<u32>| {
                                cut(keys, all, octant)..cut(keys, all, octant + 1)
                            };
                            let own = range(&source_keys, &node.sources);
                            let targets = range(&target_keys, &node.targets);
                            (!own.is_empty() || !targets.is_empty()).then(|| Node {
                                level: level + 1,
                                cell: std::array::from_fn(|k| 2 * node.cell[k] + (octant >> k & 1) as u32),
                                reach: largest(&own),
                                sources: own,
                                targets,
                                parent: n as u32,
                                children: 0..0,
                            })
                        })
                        .collect()
                })
                .collect();
            let first = nodes.len();
            for (n, children) in these.zip(below) {
                let start = nodes.len() as u32;
                nodes.extend(children);
                nodes[n].children = start..nodes.len() as u32;
            }
            if nodes.len() == first {
                break;
            }
            levels.push(first..nodes.len());
        }
        let order = |keys: Vec<(u64, u32)>| keys.into_iter().map(|(_, i)| i).collect();
        Self { nodes, levels, corner, side, source_order: order(source_keys), target_order: order(target_keys) }
    }

    /// Half the side of a node, m.
    pub fn half(&self, node: &Node) -> f64 {
        0.5 * self.side / f64::from(1_u32 << node.level)
    }

    /// Centre of a node, m.
    pub fn center(&self, node: &Node) -> Vec3 {
        let half = self.half(node);
        self.corner + Vec3::from(node.cell.map(|c| (2.0 * f64::from(c) + 1.0) * half))
    }

    /// What acts on each node. Every pair of a source and a target is in exactly one list, counting ancestors' lists.
    pub fn lists(&self, shape: &Shape) -> Vec<Lists> {
        let mut lists = vec![Lists::default(); self.nodes.len()];
        let mut near: Vec<Vec<u32>> = Vec::new();
        for range in &self.levels {
            let before = if range.start == 0 { 0 } else { self.nodes[self.nodes[range.start].parent as usize].level };
            let offset = self.levels[before as usize].start;
            let (found, next): (Vec<Lists>, Vec<Vec<u32>>) = range
                .clone()
                .into_par_iter()
                .map(|n| {
                    let node = &self.nodes[n];
                    let mut own = Lists::default();
                    if node.targets.is_empty() {
                        return (own, Vec::new());
                    }
                    let near = if n == 0 {
                        vec![0]
                    } else {
                        self.near(node, &near[node.parent as usize - offset], shape, &mut own)
                    };
                    if node.is_leaf() {
                        self.finish(node, &near, shape, &mut own);
                        return (own, Vec::new());
                    }
                    (own, near)
                })
                .unzip();
            for (n, found) in range.clone().zip(found) {
                lists[n] = found;
            }
            near = next;
        }
        lists
    }

    /// Nodes that touch a node, not smaller than it, out of those that touch its parent; the rest of these go to its lists.
    fn near(&self, node: &Node, parents: &[u32], shape: &Shape, own: &mut Lists) -> Vec<u32> {
        let mut near = Vec::new();
        for &p in parents {
            let other = &self.nodes[p as usize];
            if other.is_leaf() {
                if other.touches(node) {
                    near.push(p);
                } else if node.targets.len() <= shape.single || 2.0 * self.half(node) < other.reach {
                    own.direct.push(other.sources.clone());
                } else {
                    own.sources.push(p);
                }
                continue;
            }
            for c in other.children.clone() {
                let child = &self.nodes[c as usize];
                if child.sources.is_empty() {
                    continue;
                }
                if child.touches(node) {
                    near.push(c);
                } else if child.sources.len() * node.targets.len() <= shape.pairs {
                    own.direct.push(child.sources.clone());
                } else {
                    let direction = std::array::from_fn(|k| (i64::from(node.cell[k]) - i64::from(child.cell[k])) as i8);
                    own.translated.push((c, direction));
                }
            }
        }
        near
    }

    /// The lists of a leaf out of the nodes that touch it.
    fn finish(&self, leaf: &Node, near: &[u32], shape: &Shape, own: &mut Lists) {
        let mut open: Vec<u32> = near.iter().rev().copied().collect();
        while let Some(n) = open.pop() {
            let other = &self.nodes[n as usize];
            if other.sources.is_empty() {
                continue;
            }
            if !leaf_touches(leaf, other) {
                if other.sources.len() <= shape.single {
                    own.direct.push(other.sources.clone());
                } else {
                    own.multipoles.push(n);
                }
            } else if other.is_leaf() {
                own.direct.push(other.sources.clone());
            } else {
                open.extend(other.children.clone().rev());
            }
        }
        // Neighbours in memory in one piece.
        own.direct.sort_unstable_by_key(|range| range.start);
        own.direct.dedup_by(|next, last| {
            let joined = last.end == next.start;
            if joined {
                last.end = next.end;
            }
            joined
        });
    }
}

fn leaf_touches(leaf: &Node, other: &Node) -> bool {
    if other.level >= leaf.level { leaf.touches(other) } else { other.touches(leaf) }
}
