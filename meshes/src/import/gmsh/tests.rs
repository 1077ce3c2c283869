use super::*;

/// A square of two triangles in group "lid" and a quadrilateral in group 8, a line, and gaps in the node numbers.
const TWO: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 4 \"lid\"\n2 4 \"the \"big\" lid\"\n\
    3 1 \"metal\"\n\
    $EndPhysicalNames\n$Comments\nanything $Nodes\n$EndComments\n$Nodes\n4\n10 0 0 0\n3 1 0 0\n7 1 1 0\n8 0 1 0\n\
    $EndNodes\n\
    $Elements\n4\n1 1 2 4 1 10 3\n2 2 2 4 1 10 3 7\n3 2 2 -4 1 10 8 7\n4 3 3 8 1 0 10 3 7 8\n$EndElements\n";

const FOUR: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 4 \"the \"big\" lid\"\n\
    $EndPhysicalNames\n\
    $Entities\n1 1 3 0\n9 0 0 0 0\n1 0 0 0 1 1 0 1 4 2 9 9\n1 0 0 0 1 1 0 1 4 0\n2 0 0 0 1 1 0 1 -4 0\n\
    3 0 0 0 1 1 0 1 8 0\n$EndEntities\n\
    $Nodes\n2 4 3 10\n2 1 0 3\n10\n3\n7\n0 0 0\n1 0 0\n1 1 0\n2 2 1 1\n8\n0 1 0 0.5 0.5\n$EndNodes\n\
    $Elements\n4 4 1 4\n1 1 1 1\n1 10 3\n2 1 2 1\n2 10 3 7\n2 2 2 1\n3 10 8 7\n2 3 3 1\n4 10 3 7 8\n$EndElements\n";

#[test]
fn both_versions_read_the_same() {
    let (two, four) = (read(TWO.as_bytes()).unwrap(), read(FOUR.as_bytes()).unwrap());
    assert_eq!(two, four);
    assert_eq!(two.groups, ["the \"big\" lid", "surface 8"]);
    assert_eq!(two.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3]]);
    assert_eq!(two.group, [Some(0), Some(0), Some(1), Some(1)]);
}

#[test]
fn line_ends_of_any_system() {
    assert_eq!(read(TWO.replace('\n', "\r\n").as_bytes()), read(TWO.as_bytes()));
}

#[test]
fn a_surface_in_two_groups_counts_in_both() {
    let text = FOUR.replace("1 0 0 0 1 1 0 1 4 0\n", "1 0 0 0 1 1 0 2 4 8 0\n");
    let mesh = read(text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.len(), 5);
    assert_eq!(mesh.select("surface 8").unwrap().triangles.len(), 3);
    assert_eq!(mesh.clean().1.duplicates, 3);
}

#[test]
fn partitioned_meshes_name_the_parts() {
    let parts = "$PartitionedEntities\n2\n0\n0 0 1 0\n21 2 1 1 1 0 0 0 1 1 0 1 4 0\n$EndPartitionedEntities\n$Nodes";
    let text = FOUR.replacen("$Nodes", parts, 1).replace("\n2 1 2 1\n", "\n2 21 2 1\n");
    assert_eq!(read(text.as_bytes()), read(FOUR.as_bytes()));
}

#[test]
fn errors_say_what_is_wrong() {
    let say = |text: String| read(text.as_bytes()).unwrap_err().to_string();
    let two = |from: &str, to: &str| say(TWO.replace(from, to));
    let four = |from: &str, to: &str| say(FOUR.replace(from, to));
    assert!(two("2.2 0", "4 0").contains("Gmsh format 4: save as version 4.1 or 2.2"));
    assert!(two("2.2 0", "2.2 7").contains("expected the kind of file"));
    assert!(
        two("10 3 7\n3", "10 3 99\n3")
            .starts_with("line 23: vertex 99 does not exist, the file has 4 vertices: export")
    );
    assert!(two("7 1 1 0", "3 1 1 0").contains("node 3 is defined twice"));
    assert!(two("7 1 1 0", "7 1 nan 0").contains("vertex 7 is not finite"));
    assert!(two("7 1 1 0", "7 1 1 z").starts_with("line 17: expected a coordinate of a node, found \"z\""));
    assert!(two("$Nodes\n4", "$Nodes\n4000000000").starts_with("line 14: 4000000000 nodes are announced"));
    assert!(two("2 2 2 4", "2 34 2 4").contains("line 23: elements of type 34 are not read"));
    assert!(two("$EndElements\n", "").contains("$EndElements should follow"));
    assert!(two("$Elements\n4", "$Elements\n3").contains("expected $EndElements, found \"4\""));
    assert!(four("$Elements\n4 4", "$Elements\n4 5").contains("the blocks hold 4 elements, 5 were announced"));
    assert!(four("$Nodes\n2 4", "$Nodes\n2 3").contains("the blocks hold 4 nodes, 3 were announced"));
    let lines = "$Elements\n2 9 1 9\n1 1 1 2\n1 10 3\n2 3 7\n3 1 4 7\n3 10 3 7 8\n4 10 3 7 8\n5 10 3 7 8\n6 10 3 7 8\n\
        7 10 3 7 8\n8 10 3 7 8\n9 10 3 7 8\n$EndElements\n";
    let text = format!("{}{lines}", FOUR.split_once("$Elements").unwrap().0);
    let error = say(text);
    assert!(
        error.starts_with("no triangles: the file has 2 line elements and 7 tetrahedra; save the surface"),
        "{error}"
    );
}

#[test]
fn node_numbers_with_and_without_gaps() {
    let plain = Nodes::new(&[5, 6, 7]).unwrap();
    assert_eq!(
        [4, 5, 7, 8, i64::MIN, i64::MAX].map(|tag| plain.index(tag)),
        [None, Some(0), Some(2), None, None, None]
    );
    let wild = Nodes::new(&[50, -6, 7]).unwrap();
    assert_eq!([50, -6, 7, 8].map(|tag| wild.index(tag)), [Some(0), Some(1), Some(2), None]);
    assert_eq!(Nodes::new(&[1, 5, 1]).err(), Some(1));
}
