"""Reads the files of `meshes/examples/vtk_samples.rs` back and compares every value, bit for bit.

    python read_samples.py OUTDIR      with meshio and VTK, as far as they are installed
    pvpython read_samples.py OUTDIR    with ParaView's own readers and its VTK

Prints one line per file and reader, then "N passed, M failed"; exit status 0 or 1.
"""

import json
import os
import sys

import numpy as np

try:
    from paraview import servermanager, simple
except ImportError:
    simple = None
try:
    import meshio
except ImportError:
    meshio = None
import vtk
from vtk.util.numpy_support import vtk_to_numpy

XML_READERS = {
    ".vtu": vtk.vtkXMLUnstructuredGridReader,
    ".vtp": vtk.vtkXMLPolyDataReader,
    ".vti": vtk.vtkXMLImageDataReader,
}
MESHIO_TYPES = {"vertex": 1, "line": 3, "triangle": 5}


class Wrong(Exception):
    """What a reader found does not agree with what was written."""


def demand(condition, *what):
    if not condition:
        raise Wrong(" ".join(map(str, what)))


def same(found, wanted, dtype, what):
    """Equality of bits, so that -0 is not 0."""
    found = np.ascontiguousarray(found)
    demand(found.dtype.newbyteorder("=") == dtype, what, "has type", found.dtype, "instead of", dtype)
    wanted = np.array(wanted, dtype=np.float64).astype(dtype)
    demand(found.size == wanted.size, what, "has", found.size, "values instead of", wanted.size)
    demand(found.tobytes() == wanted.tobytes(), what, "differs")


def arrays_agree(found, wanted, tuples, what):
    """`found`: name -> (array of shape (n,) or (n, components))."""
    names = [array["name"] for array in wanted]
    demand(sorted(found) == sorted(names), what, "are", sorted(found), "instead of", sorted(names))
    for array in wanted:
        name, components = array["name"], array["components"]
        shape = (tuples,) if components == 1 else (tuples, components)
        values = found[name]
        demand(values.shape == shape, what, name, "has shape", values.shape, "instead of", shape)
        same(values, array["values"], array["type"], f"{what} {name}")


def attributes(data):
    """The arrays of points or cells of a VTK data set."""
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def check_vtk(data, wanted):
    """A VTK data set, whoever read it."""
    if "dimensions" in wanted:
        demand(data.IsA("vtkImageData"), "is a", data.GetClassName())
        demand(list(data.GetDimensions()) == wanted["dimensions"], "dimensions", data.GetDimensions())
        demand(list(data.GetOrigin()) == wanted["origin"], "origin", data.GetOrigin(), wanted["origin"])
        demand(list(data.GetSpacing()) == wanted["spacing"], "spacing", data.GetSpacing(), wanted["spacing"])
    else:
        points = vtk_to_numpy(data.GetPoints().GetData()) if data.GetNumberOfPoints() else np.zeros((0, 3))
        same(points, wanted["points"], "float64", "points")
        types = [data.GetCellType(i) for i in range(data.GetNumberOfCells())]
        demand(types == wanted["types"], "types of cells differ")
        for i, corners in enumerate(wanted["cells"]):
            ids = vtk.vtkIdList()
            data.GetCellPoints(i, ids)
            demand([ids.GetId(k) for k in range(ids.GetNumberOfIds())] == corners, "cell", i, "differs")
    arrays_agree(attributes(data.GetPointData()), wanted["point_arrays"], data.GetNumberOfPoints(), "point arrays")
    arrays_agree(attributes(data.GetCellData()), wanted["cell_arrays"], data.GetNumberOfCells(), "cell arrays")


def with_vtk(path, wanted):
    reader = XML_READERS[os.path.splitext(path)[1]]()
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append(1))
    reader.SetFileName(path)
    reader.Update()
    demand(not errors, "the reader reports an error")
    check_vtk(reader.GetOutput(), wanted)


def with_meshio(path, wanted):
    mesh = meshio.read(path)
    same(mesh.points, wanted["points"], "float64", "points")
    types = [float(MESHIO_TYPES[block.type]) for block in mesh.cells for _ in block.data]
    demand(types == wanted["types"], "types of cells differ")
    corners = [row.tolist() for block in mesh.cells for row in block.data]
    demand(corners == wanted["cells"], "cells differ")
    arrays_agree(mesh.point_data, wanted["point_arrays"], len(mesh.points), "point arrays")
    cell_data = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    arrays_agree(cell_data, wanted["cell_arrays"], len(corners), "cell arrays")


def with_paraview(path, wanted):
    source = simple.OpenDataFile(path)
    demand(source is not None, "no reader takes it")
    source.UpdatePipeline()
    check_vtk(servermanager.Fetch(source), wanted)
    simple.Delete(source)


def collection_with_paraview(path, wanted, frames):
    source = simple.OpenDataFile(path)
    times = list(source.TimestepValues)
    demand(times == wanted["times"], "times are", times, "instead of", wanted["times"])
    for time, name in zip(times, wanted["files"]):
        source.UpdatePipeline(time)
        data = servermanager.Fetch(source)
        if data.IsA("vtkCompositeDataSet"):
            data = data.GetBlock(0)
        check_vtk(data, frames[name])
    simple.Delete(source)


def main(folder):
    with open(os.path.join(folder, "expected.json"), encoding="utf-8") as file:
        expected = json.load(file)
    frames = {wanted["file"]: wanted for wanted in expected}
    passed = failed = 0
    for wanted in expected:
        name = wanted["file"]
        path = os.path.join(folder, name)
        checks = []
        if name.endswith(".pvd"):
            if simple:
                checks.append(("ParaView", lambda: collection_with_paraview(path, wanted, frames)))
        else:
            checks.append(("VTK", lambda: with_vtk(path, wanted)))
            if simple:
                checks.append(("ParaView", lambda: with_paraview(path, wanted)))
            # meshio fails on a file without cells, whoever wrote it.
            if meshio and name.endswith(".vtu") and wanted["cells"]:
                checks.append(("meshio", lambda: with_meshio(path, wanted)))
        for reader, check in checks:
            try:
                check()
                outcome = "ok"
                passed += 1
            except Exception as error:  # a reader's own failure counts like a difference
                outcome = f"FAILED: {type(error).__name__}: {error}"
                failed += 1
            print(f"{name:24} {reader:9} {outcome}", flush=True)
    print(f"{passed} passed, {failed} failed")
    return 0 if failed == 0 and passed > 0 else 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
