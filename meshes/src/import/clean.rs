//! From the triangles of a file to a surface that can carry charge.

use std::collections::{HashMap, HashSet};
use std::fmt;

use super::ImportedMesh;
use crate::Vec3;

/// Seams are closed up to this fraction of the size of the mesh.
///
/// Files with single-precision numbers or six digits place the two sides of a seam apart by up to 10⁻⁶ of their
/// distance from the origin; gaps that someone meant are far wider.
const SEAM: f64 = 1e-6;

/// No seam is closed beyond this fraction of the shortest edge at either vertex, so that small features stay.
const SEAM_OF_EDGE: f64 = 0.1;

/// What [`ImportedMesh::clean`] did, and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// Vertices that were united with another at the same place.
    pub welded: usize,
    /// Of these, vertices on free edges that were not exactly at the same place.
    pub closed_seams: usize,
    /// Triangles without area, dropped.
    pub without_area: usize,
    /// Triangles between the same corners as an earlier one, dropped.
    pub duplicates: usize,
    /// Triangles that face the other way than in the file.
    pub turned: usize,
    /// Connected pieces without a free edge; their normals point outward.
    pub closed_pieces: usize,
    /// Connected pieces with free edges; their normals agree with most of the file's.
    pub open_pieces: usize,
    /// Of the open pieces, those with only one side, like a Möbius strip: no orientation of them is consistent.
    pub one_sided: usize,
    /// Edges of one triangle.
    pub free_edges: usize,
    /// Edges of three and more triangles, over which no orientation is carried and where pieces end.
    pub branching_edges: usize,
}

impl Cleaned {
    /// The surface has no free edge: it encloses a volume.
    pub fn is_closed(&self) -> bool {
        self.open_pieces == 0
    }
}

impl fmt::Display for Cleaned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted = |count: usize, one: &str, many: &str| match count {
            1 => format!("1 {one}"),
            _ => format!("{count} {many}"),
        };
        write!(
            f,
            "{}, {}",
            counted(self.closed_pieces, "closed piece", "closed pieces"),
            counted(self.open_pieces, "open piece", "open pieces")
        )?;
        for (count, one, many) in [
            (self.one_sided, "of them one-sided", "of them one-sided"),
            (self.welded, "vertex welded", "vertices welded"),
            (self.closed_seams, "of them over a seam", "of them over seams"),
            (self.without_area, "triangle without area dropped", "triangles without area dropped"),
            (self.duplicates, "duplicate dropped", "duplicates dropped"),
            (self.turned, "triangle turned", "triangles turned"),
            (self.free_edges, "free edge", "free edges"),
            (self.branching_edges, "branching edge", "branching edges"),
        ] {
            if count > 0 {
                write!(f, ", {}", counted(count, one, many))?;
            }
        }
        Ok(())
    }
}

impl ImportedMesh {
    /// Makes a surface of a heap of triangles, and tells what that took.
    ///
    /// * Coincident vertices become one (in STL files no two triangles share any). Vertices on free edges are also
    ///   united when they are nearly coincident: within 10⁻⁶ of the size of the mesh, and a tenth of the shortest edge
    ///   there.
    /// * Triangles without area and exact duplicates (the same corners, whichever way around) are dropped.
    /// * Orientation is made consistent over each connected piece, over edges of exactly two triangles. Closed pieces
    ///   are turned outward by the sign of their volume, also a piece inside another; open pieces keep the orientation
    ///   of most of their triangles in the file.
    ///
    /// The order of triangles and vertices stays that of the file. Triangles are not cut: where a corner of one lies on
    /// the edge of another, the edge stays free. A mesh from [`read`](super::read) or [`select`](Self::select) keeps at
    /// least one triangle.
    pub fn clean(mut self) -> (ImportedMesh, Cleaned) {
        let mut cleaned = Cleaned { welded: self.vertices.len(), ..Cleaned::default() };
        self.weld_exactly();
        self = self.compact();
        self.drop_useless(&mut cleaned);
        let before = self.vertices.len();
        if self.close_seams() {
            self = self.compact();
            self.drop_useless(&mut cleaned);
        }
        cleaned.closed_seams = before - self.vertices.len();
        cleaned.welded -= self.vertices.len();
        self.orient(&mut cleaned);
        (self.compact(), cleaned)
    }

    /// Unites vertices with the same coordinates.
    fn weld_exactly(&mut self) {
        let mut first_at = HashMap::with_capacity(self.vertices.len());
        // Adding 0 makes 0 of -0, which is the same place with other bits.
        let key = |v: &Vec3| [v.x, v.y, v.z].map(|x| (x + 0.0).to_bits());
        let first: Vec<u32> =
            self.vertices.iter().zip(0..).map(|(vertex, i)| *first_at.entry(key(vertex)).or_insert(i)).collect();
        self.triangles.iter_mut().flatten().for_each(|v| *v = first[*v as usize]);
    }

    /// Drops triangles without area and repeated ones.
    fn drop_useless(&mut self, cleaned: &mut Cleaned) {
        let mut seen = HashSet::with_capacity(self.triangles.len());
        let keep: Vec<bool> = self
            .triangles
            .iter()
            .map(|&triangle| {
                if self.has_no_area(triangle) {
                    cleaned.without_area += 1;
                    return false;
                }
                let mut corners = triangle;
                corners.sort_unstable();
                let new = seen.insert(corners);
                cleaned.duplicates += usize::from(!new);
                new
            })
            .collect();
        let mut kept = keep.iter();
        self.triangles.retain(|_| kept.next() == Some(&true));
        let mut kept = keep.iter();
        self.group.retain(|_| kept.next() == Some(&true));
    }

    /// Unites vertices on free edges that nearly coincide; whether there were any.
    fn close_seams(&mut self) -> bool {
        let mut on_seam: Vec<u32> = Vec::new();
        for_each_edge(&edges(&self.triangles), |uses| {
            if let [only] = uses {
                on_seam.extend(only.ends());
            }
        });
        on_seam.sort_unstable();
        on_seam.dedup();
        let Some(&first) = on_seam.first() else { return false };

        let start = self.vertices[first as usize];
        let (low, high) = self.vertices.iter().fold((start, start), |(low, high), v| (low.inf(v), high.sup(v)));
        let size = (high - low).norm().max(low.amax()).max(high.amax());
        let reach = SEAM * size;
        let mut own_reach = vec![reach; self.vertices.len()];
        for &[a, b, c] in &self.triangles {
            for (i, j) in [(a, b), (b, c), (c, a)] {
                let edge = SEAM_OF_EDGE * (self.vertices[i as usize] - self.vertices[j as usize]).norm();
                own_reach[i as usize] = own_reach[i as usize].min(edge);
                own_reach[j as usize] = own_reach[j as usize].min(edge);
            }
        }

        // Cells twice as wide as the reach: a vertex has to look into 2 of them per axis at most.
        let cell = |x: f64| (x / (2.0 * reach)).floor() as i64;
        let mut standing: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        let mut united: Vec<u32> = (0..).take(self.vertices.len()).collect();
        let mut any = false;
        for v in on_seam {
            let (at, own) = (self.vertices[v as usize], own_reach[v as usize]);
            let near = |w: &u32| (self.vertices[*w as usize] - at).norm() <= own.min(own_reach[*w as usize]);
            let [x, y, z] = [at.x, at.y, at.z].map(|x| cell(x - own)..=cell(x + own));
            let found = x
                .flat_map(|i| y.clone().map(move |j| (i, j)))
                .flat_map(|(i, j)| z.clone().map(move |k| [i, j, k]))
                .find_map(|key| standing.get(&key)?.iter().copied().find(near));
            match found {
                Some(w) => {
                    united[v as usize] = w;
                    any = true;
                }
                None => standing.entry([at.x, at.y, at.z].map(cell)).or_default().push(v),
            }
        }
        self.triangles.iter_mut().flatten().for_each(|v| *v = united[*v as usize]);
        any
    }

    /// Makes the orientation consistent, and counts pieces and edges.
    fn orient(&mut self, cleaned: &mut Cleaned) {
        let edges = edges(&self.triangles);
        // Over each edge of exactly two triangles: the neighbour, and whether one of them must be turned.
        let mut neighbours: Vec<[Option<(u32, bool)>; 3]> = vec![[None; 3]; self.triangles.len()];
        for_each_edge(&edges, |uses| match uses {
            [_] => cleaned.free_edges += 1,
            [a, b] => {
                let disagree = a.forward == b.forward;
                neighbours[a.triangle as usize][usize::from(a.side)] = Some((b.triangle, disagree));
                neighbours[b.triangle as usize][usize::from(b.side)] = Some((a.triangle, disagree));
            }
            _ => cleaned.branching_edges += 1,
        });

        const NONE: u32 = u32::MAX;
        let mut piece_of = vec![NONE; self.triangles.len()];
        let mut turn = vec![false; self.triangles.len()];
        let mut pieces: Vec<Piece> = Vec::new();
        let mut stack = Vec::new();
        for seed in 0..self.triangles.len() {
            if piece_of[seed] != NONE {
                continue;
            }
            let piece = pieces.len() as u32;
            let mut members = Vec::new();
            let mut one_sided = false;
            piece_of[seed] = piece;
            stack.push(seed);
            while let Some(triangle) = stack.pop() {
                members.push(triangle);
                for (next, disagree) in neighbours[triangle].into_iter().flatten() {
                    let next = next as usize;
                    let wanted = turn[triangle] ^ disagree;
                    if piece_of[next] == NONE {
                        (piece_of[next], turn[next]) = (piece, wanted);
                        stack.push(next);
                    } else {
                        one_sided |= turn[next] != wanted;
                    }
                }
            }
            pieces.push(Piece { members, one_sided, closed: true });
        }

        // A piece is closed if each of its edges is run through as often in one direction as in the other. At a
        // branching edge several closed pieces may meet, each of which must be balanced by itself.
        for_each_edge(&edges, |uses| {
            for one in uses {
                let piece = piece_of[one.triangle as usize];
                let balance: i32 = uses
                    .iter()
                    .filter(|other| piece_of[other.triangle as usize] == piece)
                    .map(|other| if other.forward ^ turn[other.triangle as usize] { 1 } else { -1 })
                    .sum();
                pieces[piece as usize].closed &= balance == 0;
                if uses.len() == 2 {
                    break; // both in the same piece
                }
            }
        });

        for piece in &pieces {
            let reverse = if piece.closed {
                self.volume(&piece.members, &turn) < 0.0
            } else {
                2 * piece.members.iter().filter(|&&t| turn[t]).count() > piece.members.len()
            };
            piece.members.iter().filter(|_| reverse).for_each(|&t| turn[t] = !turn[t]);
            cleaned.closed_pieces += usize::from(piece.closed);
            cleaned.open_pieces += usize::from(!piece.closed);
            cleaned.one_sided += usize::from(piece.one_sided);
        }
        for (triangle, _) in self.triangles.iter_mut().zip(&turn).filter(|(_, turn)| **turn) {
            triangle.swap(1, 2);
            cleaned.turned += 1;
        }
    }

    /// Volume enclosed by some triangles, some of them turned over; negative if they face inward.
    ///
    ///   V = Σ a · (b × c) / 6
    ///
    /// a, b, c the corners of a triangle, seen from a vertex of the piece to keep the digits of pieces far from the
    /// origin. Checked by `the_inside_is_found`.
    fn volume(&self, members: &[usize], turn: &[bool]) -> f64 {
        let origin = self.vertices[self.triangles[members[0]][0] as usize];
        let part = |&t: &usize| {
            let [a, b, c] = self.corners(self.triangles[t]).map(|v| v - origin);
            a.dot(&b.cross(&c)) / if turn[t] { -6.0 } else { 6.0 }
        };
        members.iter().map(part).sum()
    }
}

/// Triangles that are connected over edges of exactly two of them.
struct Piece {
    members: Vec<usize>,
    one_sided: bool,
    closed: bool,
}

/// A side of a triangle.
#[derive(Clone, Copy)]
struct Side {
    /// The vertex with the smaller index in the upper half, the other one in the lower.
    edge: u64,
    triangle: u32,
    /// Which of the triangle's sides.
    side: u8,
    /// The triangle runs from the smaller index to the larger.
    forward: bool,
}

impl Side {
    fn ends(&self) -> [u32; 2] {
        [(self.edge >> 32) as u32, self.edge as u32]
    }
}

/// All sides of all triangles, those of an edge together, in the order of the triangles.
fn edges(triangles: &[[u32; 3]]) -> Vec<Side> {
    let mut sides: Vec<Side> = triangles
        .iter()
        .zip(0..)
        .flat_map(|(&[a, b, c], triangle)| {
            [(a, b), (b, c), (c, a)].into_iter().zip(0..).map(move |((i, j), side)| Side {
                edge: u64::from(i.min(j)) << 32 | u64::from(i.max(j)),
                triangle,
                side,
                forward: i < j,
            })
        })
        .collect();
    sides.sort_unstable_by_key(|side| (side.edge, side.triangle, side.side));
    sides
}

fn for_each_edge(sides: &[Side], mut visit: impl FnMut(&[Side])) {
    sides.chunk_by(|a, b| a.edge == b.edge).for_each(&mut visit);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> ImportedMesh {
        ImportedMesh {
            vertices: vertices.iter().map(|&v| v.into()).collect(),
            triangles: triangles.into(),
            group: vec![Some(0); triangles.len()],
            groups: vec!["all".into()],
        }
    }

    const CORNERS: [[f64; 3]; 8] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ];

    /// The faces of the unit cube, outward.
    const CUBE: [[u32; 3]; 12] = [
        [0, 2, 1],
        [0, 3, 2],
        [4, 5, 6],
        [4, 6, 7],
        [0, 1, 5],
        [0, 5, 4],
        [1, 2, 6],
        [1, 6, 5],
        [2, 3, 7],
        [2, 7, 6],
        [3, 0, 4],
        [3, 4, 7],
    ];

    fn whole_volume(mesh: &ImportedMesh) -> f64 {
        let members: Vec<usize> = (0..mesh.triangles.len()).collect();
        mesh.volume(&members, &vec![false; members.len()])
    }

    /// The same triangles without shared vertices, each moved by a little.
    fn shattered(mesh: &ImportedMesh, jitter: f64) -> ImportedMesh {
        let mut out = ImportedMesh { vertices: vec![], triangles: vec![], ..mesh.clone() };
        for (i, &triangle) in mesh.triangles.iter().enumerate() {
            let first = out.vertices.len() as u32;
            let shift = Vec3::new((i % 3) as f64 - 1.0, (i % 5) as f64 - 2.0, (i % 2) as f64) * (jitter / 3.0);
            out.vertices.extend(mesh.corners(triangle).map(|v| v + shift));
            out.triangles.push([first, first + 1, first + 2]);
        }
        out
    }

    #[test]
    fn a_shattered_cube_is_whole_again() {
        let cube = mesh(&CORNERS, &CUBE);
        for jitter in [0.0, 1e-7] {
            let (clean, report) = shattered(&cube, jitter).clean();
            assert_eq!((clean.vertices.len(), clean.triangles.len()), (8, 12), "{report}");
            assert_eq!((report.welded, report.closed_pieces, report.open_pieces, report.turned), (28, 1, 0, 0));
            assert!((whole_volume(&clean) - 1.0).abs() < 1e-6); // the jitter
            assert_eq!(report.closed_seams > 0, jitter > 0.0);
        }
        // A gap that someone meant stays.
        let (clean, report) = shattered(&cube, 1e-3).clean();
        assert_eq!((clean.vertices.len(), report.free_edges), (36, 36));
    }

    #[test]
    fn seams_do_not_swallow_small_features() {
        // A square of 10⁻⁷ beside a shattered cube of size 1, and well inside the reach of its seams.
        let mut both = shattered(&mesh(&CORNERS, &CUBE), 1e-7);
        let first = both.vertices.len() as u32;
        both.vertices.extend(CORNERS[..4].iter().map(|&v| Vec3::from(v) * 1e-7 + Vec3::new(3.0, 0.0, 0.0)));
        both.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v| v + first)));
        both.group.extend([None, None]);
        let (clean, report) = both.clean();
        assert_eq!((clean.vertices.len(), report.closed_pieces, report.open_pieces), (12, 1, 1), "{report}");
        assert_eq!(report.without_area, 0);
    }

    #[test]
    fn zero_has_no_sign() {
        let mut square = shattered(&mesh(&CORNERS[..4], &[[0, 1, 2], [0, 2, 3]]), 0.0);
        square.vertices[0].z = -0.0;
        square.weld_exactly();
        assert_eq!(square.compact().vertices.len(), 4);
    }

    #[test]
    fn the_inside_is_found() {
        let random = |i: usize| (i * 7 + i * i * 3) % 5 < 2;
        for mask in [|_: usize| false, |_: usize| true, random] {
            let mut cube = mesh(&CORNERS, &CUBE);
            cube.vertices.iter_mut().for_each(|v| *v += Vec3::new(1e3, -2e3, 5e2));
            for (i, triangle) in cube.triangles.iter_mut().enumerate() {
                if mask(i) {
                    triangle.swap(0, 1);
                }
            }
            let turned = (0..12).filter(|&i| mask(i)).count();
            let (clean, report) = cube.clean();
            assert!((whole_volume(&clean) - 1.0).abs() < 1e-9, "{report}"); // round-off at 2000
            assert_eq!((report.turned, report.closed_pieces), (turned, 1));
        }
    }

    #[test]
    fn an_open_piece_keeps_the_majority() {
        let mut sheet = mesh(&CORNERS[..4], &[[0, 1, 2], [0, 2, 3]]);
        sheet.vertices.push(Vec3::new(2.0, 0.0, 0.0));
        sheet.triangles.push([1, 2, 4]); // against the other two
        sheet.group.push(None);
        let (clean, report) = sheet.clone().clean();
        assert_eq!(clean.triangles, [[0, 1, 2], [0, 2, 3], [1, 4, 2]]);
        assert_eq!((report.turned, report.open_pieces, report.free_edges), (1, 1, 5));
        sheet.triangles.rotate_right(1); // the odd one first
        let (clean, _) = sheet.clean();
        assert_eq!(clean.triangles, [[1, 4, 2], [0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn useless_triangles_go() {
        let mut cube = mesh(&CORNERS, &CUBE);
        cube.triangles.extend([[0, 1, 1], [1, 0, 2], [4, 5, 6]]);
        cube.group.extend([None, Some(0), Some(0)]);
        let (clean, report) = cube.clean();
        assert_eq!((report.without_area, report.duplicates, clean.triangles.len()), (1, 2, 12));
        assert_eq!(clean.group.len(), 12);
        let text = report.to_string();
        assert_eq!(text, "1 closed piece, 0 open pieces, 1 triangle without area dropped, 2 duplicates dropped");
    }

    #[test]
    fn cubes_that_share_an_edge_are_two_closed_pieces() {
        let mut vertices = CORNERS.to_vec();
        vertices.extend(CORNERS.map(|[x, y, z]| [x + 1.0, y + 1.0, z]));
        let mut triangles = CUBE.to_vec();
        triangles.extend(CUBE.map(|t| t.map(|v| v + 8)).map(|[a, b, c]| [b, a, c]));
        let (clean, report) = mesh(&vertices, &triangles).clean();
        assert_eq!((clean.vertices.len(), report.closed_pieces, report.branching_edges), (14, 2, 1), "{report}");
        assert!((whole_volume(&clean) - 2.0).abs() < 1e-12 && report.turned == 12); // round-off
    }

    #[test]
    fn a_moebius_strip_is_one_sided() {
        let strip: Vec<[f64; 3]> = (0..8)
            .flat_map(|i| {
                let (s, c) = (i as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
                let (t, u) = (i as f64 * std::f64::consts::FRAC_PI_8).sin_cos();
                [-0.3, 0.3].map(|w| [c * (1.0 + w * u), s * (1.0 + w * u), w * t])
            })
            .collect();
        let mut triangles = Vec::new();
        for i in 0..8_u32 {
            let [a, b] = [2 * i, 2 * i + 1];
            let [c, d] = if i == 7 { [1, 0] } else { [a + 2, b + 2] };
            triangles.extend([[a, b, c], [b, d, c]]);
        }
        let (_, report) = mesh(&strip, &triangles).clean();
        assert_eq!((report.one_sided, report.open_pieces, report.closed_pieces), (1, 1, 0));
        assert!(!report.is_closed());
    }
}
