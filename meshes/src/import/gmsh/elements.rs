//! Gmsh's kinds of element.

/// What an element is, as far as a surface mesh cares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Point,
    Line,
    /// The first three nodes are its corners.
    Triangle,
    /// The first four nodes are its corners.
    Quadrilateral,
    Tetrahedron,
    /// Hexahedron, prism or pyramid.
    OtherVolume,
}

/// Kind and number of nodes of an element type, or `None` for one that is unknown or (polygons) has no fixed number.
///
/// Source: GmshDefines.h; numbers compared with `gmsh.model.mesh.getElementProperties` of Gmsh 4.15.
pub(super) fn element(number: i64) -> Option<(Kind, usize)> {
    use Kind::{Line, OtherVolume, Point, Quadrilateral, Tetrahedron, Triangle};
    let kind = match number {
        15 => Point,
        1 | 8 | 26..=28 | 62..=66 | 84 => Line,
        2 | 9 | 20..=25 | 42..=46 | 52..=56 | 85 => Triangle,
        3 | 10 | 16 | 36..=41 | 47..=51 | 57..=61 | 86 => Quadrilateral,
        4 | 11 | 29..=33 | 71..=75 | 79..=83 | 87 | 137 => Tetrahedron,
        5..=7 | 12..=14 | 17..=19 | 88..=132 => OtherVolume,
        _ => return None,
    };
    let nodes = match number {
        15 | 84..=89 | 132 => 1,
        1 => 2,
        2 | 8 => 3,
        3 | 4 | 26 => 4,
        7 | 27 => 5,
        6 | 9 | 28 => 6,
        62 => 7,
        5 | 16 | 63 => 8,
        10 | 20 | 64 => 9,
        11 | 21 | 65 => 10,
        66 => 11,
        22 | 39 => 12,
        19 => 13,
        14 => 14,
        18 | 23 | 24 => 15,
        36 | 40 | 137 => 16,
        13 | 52 => 18,
        17 | 29 | 41 => 20,
        25 | 53 | 125 => 21,
        32 => 22,
        54 | 57 | 111 => 24,
        37 => 25,
        12 | 55 => 27,
        33 | 42 | 58 => 28,
        126 => 29,
        56 | 118 => 30,
        59 | 99 => 32,
        112 => 33,
        79 => 34,
        30 => 35,
        38 | 43 | 60 => 36,
        127 => 37,
        61 | 80 | 90 => 40,
        113 => 42,
        100 => 44,
        44 | 128 => 45,
        81 => 46,
        47 => 49,
        114 => 51,
        82 => 52,
        129 => 53,
        45 | 119 => 55,
        31 | 101 => 56,
        83 => 58,
        115 => 60,
        130 => 61,
        48 | 92 => 64,
        46 => 66,
        102 => 68,
        116 | 131 => 69,
        91 => 75,
        117 => 78,
        103 => 80,
        49 => 81,
        71 => 84,
        120 => 91,
        104 => 92,
        50 => 100,
        105 => 104,
        72 => 120,
        51 => 121,
        93 => 125,
        106 => 126,
        121 => 140,
        73 => 165,
        107 => 196,
        122 => 204,
        94 => 216,
        74 => 220,
        75 => 286,
        123 => 285,
        108 => 288,
        95 => 343,
        124 => 385,
        109 => 405,
        96 => 512,
        110 => 550,
        97 => 729,
        98 => 1000,
        _ => return None,
    };
    Some((kind, nodes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complete_elements_have_the_nodes_of_their_order() {
        let choose = |n: usize, k: usize| (1..=k).fold(1, |c, i| c * (n + 1 - i) / i);
        // Types of the complete triangles, quadrilaterals and tetrahedra, from first order on.
        for (order, number) in (1..).zip([2, 9, 21, 23, 25, 42, 43, 44, 45, 46]) {
            assert_eq!(element(number), Some((Kind::Triangle, choose(order + 2, 2))));
        }
        for (order, number) in (1_usize..).zip([3, 10, 36, 37, 38, 47, 48, 49, 50, 51]) {
            assert_eq!(element(number), Some((Kind::Quadrilateral, (order + 1).pow(2))));
        }
        for (order, number) in (1..).zip([4, 11, 29, 30, 31, 71]) {
            let nodes = if order == 6 { 84 } else { choose(order + 3, 3) };
            assert_eq!(element(number), Some((Kind::Tetrahedron, nodes)));
        }
        for (order, number) in (1_usize..).zip([5, 12, 92, 93, 94, 95, 96, 97, 98]) {
            assert_eq!(element(number), Some((Kind::OtherVolume, (order + 1).pow(3))));
        }
    }

    #[test]
    fn every_known_kind_has_a_number_of_nodes() {
        for number in 0..200 {
            let corners = match element(number) {
                Some((Kind::Triangle, nodes)) => Some((3, nodes)),
                Some((Kind::Quadrilateral, nodes)) => Some((4, nodes)),
                _ => None,
            };
            assert!(corners.is_none_or(|(corners, nodes)| nodes >= corners || nodes == 1), "{number}");
        }
        assert_eq!(element(34), None, "polygons have no fixed number of nodes");
    }
}
