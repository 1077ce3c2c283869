//! Surfaces and points, through vtkio: inline base64.
//!
//! Three things vtkio does are guarded against here. It leaves `NumberOfPoints` and `NumberOfCells` out when they are
//! zero, and VTK then calls the file broken: empty data take the way of [`super::appended`]. It ignores short writes
//! and the errors of its last flush: [`Whole`] sees to both. It panics on more than 2³² points or cells: checked first.

use std::io::{self, Write};

use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, IOBuffer, PolyDataPiece, UnstructuredGridPiece,
    Version, VertexNumbers, Vtk,
};
use vtkio::xml::Compressor;

use super::appended::Document;
use super::array::{check_all, check_finite, flat};
use super::{DataArray, Values, VtkError};
use crate::{SurfaceMesh, Vec3};

/// Level of zlib for surfaces. 1e5 panels take 0.44 s and 4 MB, against 0.06 s and 9 MB without (numbers of corners
/// shrink most); level 6 takes half as long again and gains 3 %.
const ZLIB_LEVEL: u32 = 1;

/// Writes a surface as an UnstructuredGrid of triangles (`.vtu`), with one tuple per vertex in `point_arrays` and one
/// per panel in `cell_arrays`.
///
/// ```
/// use meshes::vtk::{DataArray, write_surface};
/// use meshes::{SurfaceMesh, Vec3};
///
/// let mesh = SurfaceMesh {
///     vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::y()],
///     triangles: vec![[0, 1, 2]],
///     electrode: vec![0],
///     electrodes: vec![],
/// };
/// let electrode = DataArray::scalars("electrode", mesh.electrode.as_slice());
/// write_surface(&mut Vec::new(), &mesh, &[], &[electrode])?;
/// # Ok::<(), meshes::vtk::VtkError>(())
/// ```
///
/// # Errors
/// A bad name, a length that does not match, a corner that is not there or a value that is not finite, before anything
/// is written; an output that fails.
pub fn write_surface(
    out: &mut dyn Write,
    mesh: &SurfaceMesh,
    point_arrays: &[DataArray],
    cell_arrays: &[DataArray],
) -> Result<(), VtkError> {
    let (vertices, panels) = (mesh.vertices.len(), mesh.triangles.len());
    check_all(point_arrays, vertices, "points")?;
    check_all(cell_arrays, panels, "cells")?;
    for (panel, corners) in mesh.triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(VtkError::Vertex { panel, vertex, vertices });
        }
    }
    let coordinates = coordinates(&mesh.vertices)?;
    if panels == 0 {
        let mut document =
            Document::new("UnstructuredGrid", "", &format!(" NumberOfPoints=\"{vertices}\" NumberOfCells=\"0\""));
        points(&mut document, &coordinates, point_arrays, cell_arrays)?;
        document.element("Cells", |document| {
            document.array::<i64>("connectivity", 0, 1, |_| Ok(()))?;
            document.array::<i64>("offsets", 0, 1, |_| Ok(()))?;
            document.array::<u8>("types", 0, 1, |_| Ok(()))
        })?;
        return document.write(out);
    }
    countable("panels", panels)?;
    let piece = UnstructuredGridPiece {
        points: IOBuffer::F64(coordinates),
        cells: Cells {
            cell_verts: VertexNumbers::XML {
                connectivity: mesh.triangles.iter().flatten().map(|&vertex| vertex.into()).collect(),
                offsets: (1..=panels as u64).map(|panel| 3 * panel).collect(),
            },
            types: vec![CellType::Triangle; panels],
        },
        data: Attributes { point: attributes(point_arrays)?, cell: attributes(cell_arrays)? },
    };
    write_inline(out, DataSet::inline(piece), Compressor::ZLib, ZLIB_LEVEL)
}

/// Writes points as PolyData (`.vtp`), each with a vertex cell so that viewers show it: one frame of an animation.
///
/// Not compressed: the values are as good as random, and there may be a thousand frames.
///
/// # Errors
/// A bad name, a length that does not match or a value that is not finite, before anything is written; an output that
/// fails.
pub fn write_points(out: &mut dyn Write, places: &[Vec3], arrays: &[DataArray]) -> Result<(), VtkError> {
    check_all(arrays, places.len(), "points")?;
    let coordinates = coordinates(places)?;
    if places.is_empty() {
        let mut document = Document::new(
            "PolyData",
            "",
            " NumberOfPoints=\"0\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\"",
        );
        points(&mut document, &coordinates, arrays, &[])?;
        return document.write(out);
    }
    let count = places.len() as u64;
    let piece = PolyDataPiece {
        points: IOBuffer::F64(coordinates),
        verts: Some(VertexNumbers::XML { connectivity: (0..count).collect(), offsets: (1..=count).collect() }),
        data: Attributes { point: attributes(arrays)?, cell: vec![] },
        ..Default::default()
    };
    write_inline(out, DataSet::inline(piece), Compressor::None, 0)
}

/// Coordinates as vtkio wants them.
fn coordinates(places: &[Vec3]) -> Result<Vec<f64>, VtkError> {
    countable("points", places.len())?;
    let coordinates = flat(places);
    check_finite("Points", 3, &coordinates, 0)?;
    Ok(coordinates)
}

fn countable(what: &str, count: usize) -> Result<(), VtkError> {
    match u32::try_from(count) {
        Ok(_) => Ok(()),
        Err(_) => Err(VtkError::TooLarge { what: format!("{count} {what}") }),
    }
}

/// The points of a data set without cells, and its arrays.
fn points<'d>(
    document: &mut Document<'d>,
    coordinates: &'d [f64],
    point_arrays: &'d [DataArray<'d>],
    cell_arrays: &'d [DataArray<'d>],
) -> Result<(), VtkError> {
    document.data("PointData", point_arrays)?;
    document.data("CellData", cell_arrays)?;
    document.element("Points", |document| {
        document.array::<f64>("Points", coordinates.len() as u64 / 3, 3, |sink| sink.put(coordinates))
    })
}

/// Arrays as vtkio wants them: owned and whole.
fn attributes(arrays: &[DataArray]) -> Result<Vec<Attribute>, VtkError> {
    let attribute = |array: &DataArray| {
        let components = u32::try_from(array.components)
            .map_err(|_| VtkError::TooLarge { what: format!("the components of array `{}`", array.name) })?;
        let data = match &array.values {
            Values::F64(values) => IOBuffer::F64(values.to_vec()),
            Values::F32(values) => IOBuffer::F32(values.to_vec()),
            Values::I32(values) => IOBuffer::I32(values.to_vec()),
            Values::U32(values) => IOBuffer::U32(values.to_vec()),
            Values::U8(values) => IOBuffer::U8(values.to_vec()),
            Values::Computed(_) => {
                let mut whole = Vec::with_capacity(array.values.len());
                array.blocks(|_, block| {
                    whole.extend_from_slice(block);
                    Ok(())
                })?;
                IOBuffer::F64(whole)
            }
        };
        Ok(Attribute::generic(&array.name, components).with_data(data))
    };
    arrays.iter().map(attribute).collect()
}

fn write_inline(out: &mut dyn Write, data: DataSet, compressor: Compressor, level: u32) -> Result<(), VtkError> {
    // Version 1.0 is the first with 64-bit lengths, which vtkio writes, and the last that meshio accepts.
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data,
    };
    let encoding = |error: vtkio::xml::Error| VtkError::Encoding(error.to_string());
    let file = vtk.try_into_xml_format(compressor, level).map_err(encoding)?;
    let mut whole = Whole { out, failure: None };
    let outcome = file.write(&mut whole);
    if let Some(failure) = whole.failure {
        return Err(VtkError::Io(failure));
    }
    outcome.map_err(encoding)?;
    out.flush()?;
    Ok(())
}

/// An output that takes all it is given or remembers why it could not.
struct Whole<'o> {
    out: &'o mut dyn Write,
    failure: Option<io::Error>,
}

impl Write for Whole<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failure.is_none() {
            self.failure = self.out.write_all(bytes).err();
        }
        match &self.failure {
            None => Ok(bytes.len()),
            Some(failure) => Err(failure.kind().into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
