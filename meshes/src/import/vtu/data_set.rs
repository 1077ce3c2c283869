//! VTK XML files read back as they were written: every cell and the named arrays, nothing merged or left out.

use roxmltree::Node;

use super::data::Storage;
use super::{CellList, Result, array, child, count, invalid, parsed};
use crate::Vec3;

/// Points, cells and named arrays of an unstructured grid (`.vtu`) or of polygonal data (`.vtp`), in one piece.
///
/// ```
/// use meshes::Vec3;
/// use meshes::import::DataSet;
/// use meshes::vtk::{DataArray, write_points};
///
/// let mut file = Vec::new();
/// write_points(&mut file, &[Vec3::x(), Vec3::y()], &[DataArray::scalars("speed", vec![1.5, 2.5])])?;
/// let back = DataSet::read(&file, |name| name == "speed")?;
/// assert_eq!((back.points[1], back.point_array("speed")), (Vec3::y(), Some(&[1.5, 2.5][..])));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataSet {
    /// Points, in the unit of the file.
    pub points: Vec<Vec3>,
    /// Points of all cells, one cell after the other; of polygonal data first vertices, then lines, then polygons. All are
    /// there.
    pub corners: Vec<u32>,
    /// Where each cell ends in `corners`.
    pub ends: Vec<usize>,
    /// Names and values of the arrays of points that were wanted; tuples stand one after the other.
    pub point_arrays: Vec<(String, Vec<f64>)>,
    /// The same of cells.
    pub cell_arrays: Vec<(String, Vec<f64>)>,
}

impl DataSet {
    /// Reads a file, and of its arrays those whose names are `wanted`.
    ///
    /// # Errors
    /// [`ImportError`](super::ImportError): no VTK XML file, a broken one, or one of several pieces.
    pub fn read(bytes: &[u8], wanted: impl Fn(&str) -> bool) -> Result<Self> {
        parsed(bytes, |grid, storage, polygonal| {
            let mut pieces = grid.children().filter(|node| node.has_tag_name("Piece"));
            match (pieces.next(), pieces.next()) {
                (Some(piece), None) => Self::of_piece(piece, storage, polygonal, &wanted),
                (first, _) => {
                    let found = if first.is_none() { "no piece" } else { "several pieces" };
                    Err(invalid(grid, format!("the file has {found} instead of one")))
                }
            }
        })
    }

    fn of_piece(
        piece: Node<'_, '_>,
        storage: &Storage<'_>,
        polygonal: bool,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Self> {
        let mut set = Self::default();
        let count_of = count(piece, "NumberOfPoints")?;
        if let Some(element) = child(piece, "Points").filter(|_| count_of > 0) {
            let coordinates = storage.reals(array(element, "")?, count_of.saturating_mul(3))?;
            set.points = coordinates.chunks_exact(3).map(Vec3::from_column_slice).collect();
        }
        let lists: &[(&str, &str)] = match polygonal {
            true => &[("Verts", "NumberOfVerts"), ("Lines", "NumberOfLines"), ("Polys", "NumberOfPolys")],
            false => &[("Cells", "NumberOfCells")],
        };
        for (name, attribute) in lists {
            let cells = count(piece, attribute)?;
            let Some(element) = child(piece, name).filter(|_| cells > 0) else { continue };
            let list = CellList::read(element, storage, cells)?;
            let before = set.corners.len();
            for corner in list.corners {
                match u32::try_from(corner) {
                    Ok(point) if (point as usize) < set.points.len() => set.corners.push(point),
                    _ => {
                        let points = set.points.len();
                        return Err(invalid(element, format!("a cell has point {corner}, there are {points}")));
                    }
                }
            }
            set.ends.extend(list.ends.into_iter().map(|end| before + end));
        }
        set.point_arrays = arrays(piece, "PointData", storage, set.points.len(), wanted)?;
        set.cell_arrays = arrays(piece, "CellData", storage, set.ends.len(), wanted)?;
        Ok(set)
    }

    /// The points of each cell.
    pub fn cells(&self) -> impl Iterator<Item = &[u32]> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        begins.zip(&self.ends).map(|(begin, &end)| &self.corners[begin..end])
    }

    /// The values of an array of points.
    pub fn point_array(&self, name: &str) -> Option<&[f64]> {
        named(&self.point_arrays, name)
    }

    /// The values of an array of cells.
    pub fn cell_array(&self, name: &str) -> Option<&[f64]> {
        named(&self.cell_arrays, name)
    }
}

fn named<'a>(arrays: &'a [(String, Vec<f64>)], name: &str) -> Option<&'a [f64]> {
    arrays.iter().find(|(known, _)| known == name).map(|(_, values)| values.as_slice())
}

fn arrays(
    piece: Node<'_, '_>,
    element: &str,
    storage: &Storage<'_>,
    tuples: usize,
    wanted: &dyn Fn(&str) -> bool,
) -> Result<Vec<(String, Vec<f64>)>> {
    let nodes = child(piece, element).into_iter().flat_map(|data| data.children());
    let mut found = Vec::new();
    for node in nodes.filter(|node| node.has_tag_name("DataArray")) {
        let Some(name) = node.attribute("Name").filter(|name| wanted(name)) else { continue };
        let components = count(node, "NumberOfComponents")?.max(1);
        found.push((name.to_owned(), storage.reals(node, tuples.saturating_mul(components))?));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceMesh;
    use crate::vtk::{DataArray, PolylineArray, Polylines, write_polylines, write_surface};

    fn mesh() -> SurfaceMesh {
        SurfaceMesh {
            vertices: vec![Vec3::zeros(), Vec3::new(0.1, 0.0, 1e-30), Vec3::y(), Vec3::z()],
            triangles: vec![[0, 1, 2], [0, 3, 1]],
            electrode: vec![1, 0],
            electrodes: vec![],
        }
    }

    #[test]
    fn a_surface_is_read_back_bit_for_bit() {
        let (mesh, density) = (mesh(), vec![-0.1, 3e-300]);
        let arrays =
            [DataArray::scalars("electrode", mesh.electrode.as_slice()), DataArray::scalars("a < b", density.clone())];
        let mut file = Vec::new();
        write_surface(&mut file, &mesh, &[], &arrays).unwrap();
        let back = DataSet::read(&file, |_| true).unwrap();
        assert_eq!(back.points, mesh.vertices);
        assert!(back.cells().eq(mesh.triangles.iter().map(|t| &t[..])));
        assert_eq!(back.cell_array("electrode"), Some(&[1.0, 0.0][..]));
        assert_eq!(back.cell_array("a < b"), Some(&density[..]));
        assert_eq!(DataSet::read(&file, |name| name == "electrode").unwrap().cell_arrays.len(), 1);
    }

    /// Dots come before lines, in the cells and in their arrays; points stay in the order of the polylines.
    #[test]
    fn polylines_are_read_back_bit_for_bit() {
        let lengths = [2, 1, 3];
        let lines = Polylines::new(&lengths, |line, k| Vec3::new(line as f64, 0.1 * k as f64, 0.0));
        let time = PolylineArray::scalars("time", |line, k| line as f64 + 0.3 * k as f64);
        let force = PolylineArray::vectors("force", |_, k| Vec3::repeat(k as f64));
        let mut file = Vec::new();
        let numbers = DataArray::scalars("grain", vec![0_u32, 1, 2]);
        write_polylines(&mut file, &lines, &[time, force], &[numbers]).unwrap();
        let back = DataSet::read(&file, |_| true).unwrap();
        let cells: Vec<&[u32]> = back.cells().collect();
        assert_eq!(cells, [&[2][..], &[0, 1], &[3, 4, 5]]);
        assert_eq!(back.cell_array("grain"), Some(&[1.0, 0.0, 2.0][..]));
        assert_eq!(back.point_array("time").unwrap()[..3], [0.0, 0.3, 1.0]);
        assert_eq!((back.points[5], back.point_array("force").unwrap().len()), (Vec3::new(2.0, 0.2, 0.0), 18));
    }

    #[test]
    fn nothing_written_is_nothing_read() {
        let mut file = Vec::new();
        write_surface(&mut file, &SurfaceMesh { vertices: vec![], triangles: vec![], ..mesh() }, &[], &[]).unwrap();
        assert_eq!(DataSet::read(&file, |_| true).unwrap(), DataSet::default());
    }

    /// Whatever is cut off, an error says so.
    #[test]
    fn a_file_that_was_cut_short_is_an_error() {
        let mut file = Vec::new();
        let mesh = mesh();
        let electrode = DataArray::scalars("electrode", mesh.electrode.as_slice());
        write_surface(&mut file, &mesh, &[], &[electrode]).unwrap();
        for length in 0..file.len() - 20 {
            assert!(DataSet::read(&file[..length], |_| true).is_err(), "{length}");
        }
    }
}
