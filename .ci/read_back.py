"""Reads back what a run wrote and checks that it is whole and agrees with itself and with its summary.

    python read_back.py OUTDIR

Every file is opened with each reader that can read its kind: VTK for all, meshio for .vtu. One line per check; the last
line says "N passed, M failed", and the exit status is 0 only if none failed.
"""

import json
import os
import sys
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# What the arrays are called. A name with {} stands for one array per electrode.
ELECTRODE = "electrode"
UNIT_CHARGE_DENSITY = "unit_charge_density {}"
GRAIN = "grain"
TIME = "time"

# Relative to the largest entry of the matrix: the sums on both sides run over the same panels, so that only round-off
# of some 1e5 terms remains.
CHARGE_TOLERANCE = 1e-9
# Relative to the same: the matrix is said to be symmetric, that is made so if discretisation has not.
SYMMETRY_TOLERANCE = 1e-9
# Relative to the extent of the tracks: both are the same f64, one of them printed and parsed.
POSITION_TOLERANCE = 1e-12

READERS = {
    ".vtu": vtk.vtkXMLUnstructuredGridReader,
    ".vtp": vtk.vtkXMLPolyDataReader,
    ".vti": vtk.vtkXMLImageDataReader,
}
# meshio's names for the kinds of cells, as VTK numbers them.
VERTEX, LINE, TRIANGLE = 1, 3, 5
MESHIO_KINDS = {"vertex": VERTEX, "line": LINE, "triangle": TRIANGLE}


class Data:
    """A data set as plain arrays: the same whichever reader it comes from."""

    def __init__(self, points, kinds, connectivity, offsets, point_arrays, cell_arrays):
        self.points = points  # n x 3, or None for a lattice
        self.kinds = kinds  # VTK's number of each cell's kind, or None for a lattice
        self.connectivity = connectivity  # points of all cells, one after the other
        self.offsets = offsets  # where each cell begins in it, and where the last one ends
        self.point_arrays = point_arrays
        self.cell_arrays = cell_arrays

    def corners(self, kind):
        """Points of all cells of a kind with as many points each, one row per cell."""
        cells = np.flatnonzero(self.kinds == kind)
        if len(cells) == 0:
            return np.zeros((0, 0), dtype=np.int64)
        width = self.offsets[cells[0] + 1] - self.offsets[cells[0]]
        return self.connectivity[self.offsets[cells][:, None] + np.arange(width)]

    def arrays(self):
        """Every array, with a name to print."""
        if self.points is not None:
            yield "points", self.points
        for name, values in self.point_arrays.items():
            yield f"point array {name!r}", values
        for name, values in self.cell_arrays.items():
            yield f"cell array {name!r}", values


def vtk_arrays(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def cell_array(cells):
    """Connectivity and offsets of a vtkCellArray."""
    return (
        vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64),
        vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64),
    )


def read_with_vtk(path):
    """The file as `Data`, and the number of points and cells that VTK counts."""
    reader = READERS[os.path.splitext(path)[1]]()
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("VTK reports an error"))
    reader.SetFileName(path)
    reader.Update()
    if errors:
        raise ValueError(errors[0])
    found = reader.GetOutput()
    points = kinds = connectivity = offsets = None
    if not found.IsA("vtkImageData"):
        points = np.zeros((0, 3))
        if found.GetNumberOfPoints():
            points = vtk_to_numpy(found.GetPoints().GetData())
    if found.IsA("vtkUnstructuredGrid"):
        kinds = np.zeros(0, dtype=np.uint8)
        connectivity, offsets = np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
        if found.GetNumberOfCells():
            count = found.GetNumberOfCells()
            kinds = np.fromiter(map(found.GetCellType, range(count)), dtype=np.uint8, count=count)
            connectivity, offsets = cell_array(found.GetCells())
    elif found.IsA("vtkPolyData"):
        dots, dot_offsets = cell_array(found.GetVerts())
        lines, line_offsets = cell_array(found.GetLines())
        kinds = np.repeat(np.array([VERTEX, LINE], dtype=np.uint8), [len(dot_offsets) - 1, len(line_offsets) - 1])
        connectivity = np.concatenate([dots, lines])
        offsets = np.concatenate([dot_offsets, dot_offsets[-1] + line_offsets[1:]])
    data = Data(
        points, kinds, connectivity, offsets, vtk_arrays(found.GetPointData()), vtk_arrays(found.GetCellData())
    )
    return data, found.GetNumberOfPoints(), found.GetNumberOfCells()


def read_with_meshio(path):
    mesh = meshio.read(path)
    kinds, widths, corners = [], [], []
    for block in mesh.cells:
        kinds.append(np.full(len(block.data), MESHIO_KINDS[block.type], dtype=np.uint8))
        widths.append(np.full(len(block.data), block.data.shape[1], dtype=np.int64))
        corners.append(np.asarray(block.data, dtype=np.int64).ravel())
    cell_arrays = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(widths))])
    return Data(
        mesh.points, np.concatenate(kinds), np.concatenate(corners), offsets, dict(mesh.point_data), cell_arrays
    )


def same_bits(a, b):
    """Equal in type, shape and every bit, so that -0 is not 0."""
    a, b = (np.ascontiguousarray(x, dtype=x.dtype.newbyteorder("=")) for x in (a, b))
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def differing(a, b):
    """Names of arrays that two dictionaries do not share bit for bit."""
    names = sorted(set(a) | set(b))
    return [name for name in names if name not in a or name not in b or not same_bits(a[name], b[name])]


def segments(data):
    """Pairs of neighbouring points of all polylines, and the cell that each pair belongs to."""
    ends = np.zeros(len(data.connectivity), dtype=bool)
    ends[data.offsets[1:] - 1] = True
    cell = np.repeat(np.arange(len(data.offsets) - 1), np.diff(data.offsets))
    first = np.flatnonzero(~ends)
    return np.stack([data.connectivity[first], data.connectivity[first + 1]], axis=1), cell[first]


def frames_of(path):
    """(time, file) of each entry of a .pvd."""
    entries = ElementTree.parse(path).getroot().findall("./Collection/DataSet")
    return [(float(entry.attrib["timestep"]), entry.attrib["file"]) for entry in entries]


class Run:
    """The folder of a run; each file is read once, when a check first asks for it."""

    FILES = ["electrodes.vtu", "field.vti", "trajectories.vtp", "trajectories.vtu", "grains.pvd", "summary.json"]

    def __init__(self, folder):
        self.folder = folder
        self.cache = {}
        with open(self.path("summary.json"), encoding="utf-8") as file:
            self.summary = json.load(file)

    def path(self, name):
        return os.path.join(self.folder, *name.split("/"))

    def vtk(self, name):
        """A file's data as VTK reads it."""
        return self.counted(name)[0]

    def counted(self, name):
        return self.once(("VTK", name), lambda: read_with_vtk(self.path(name)))

    def meshio(self, name):
        return self.once(("meshio", name), lambda: read_with_meshio(self.path(name)))

    def frames(self):
        return self.once("frames", lambda: frames_of(self.path("grains.pvd")))

    def once(self, key, read):
        if key not in self.cache:
            self.cache[key] = read()
        return self.cache[key]


# Each check below is a generator of (what is checked, whether it holds, what was found instead). An exception fails the
# check it happens in, and the next check goes on.


def check_files(run):
    """Everything that must be there is, and so is everything that the summary promises."""
    tracks = {"trajectories.vtp", "trajectories.vtu", "grains.pvd"}
    expected = set(Run.FILES) - (set() if run.summary["trace"]["grains"] else tracks)
    for name in sorted(expected | set(run.summary.get("files", []))):
        yield f"{name} is there", os.path.isfile(run.path(name)), "no such file"
    partial = [name for _, _, names in os.walk(run.folder) for name in names if name.endswith(".partial")]
    yield "nothing is left half written", not partial, partial


def sound(name, data, points, cells):
    """Every array is finite and as long as there are points or cells."""
    wrong = [what for what, values in data.arrays() if not np.all(np.isfinite(values))]
    yield f"{name}: every value is finite", not wrong, wrong
    wrong = [what for what, values in data.point_arrays.items() if len(values) != points]
    wrong += [what for what, values in data.cell_arrays.items() if len(values) != cells]
    yield f"{name}: every array fits {points} points and {cells} cells", not wrong, wrong
    if data.connectivity is not None:
        ok = np.all((data.connectivity >= 0) & (data.connectivity < points))
        yield f"{name}: every cell's points are there", ok, "a cell names a point out of range"


def check_electrodes_vtu(run):
    yield from sound("electrodes.vtu", *run.counted("electrodes.vtu"))


def check_field_vti(run):
    data, points, cells = run.counted("field.vti")
    yield from sound("field.vti", data, points, cells)
    yield "field.vti: has point arrays", len(data.point_arrays) > 0, "none"


def check_trajectories_vtp(run):
    yield from sound("trajectories.vtp", *run.counted("trajectories.vtp"))


def check_trajectories_vtu(run):
    yield from sound("trajectories.vtu", *run.counted("trajectories.vtu"))


def both_readers_agree(run, name):
    by_vtk = run.vtk(name)
    if len(by_vtk.kinds) == 0:
        yield f"{name}: no cells, which meshio cannot read", True, ""
        return
    by_meshio = run.meshio(name)
    yield f"{name}: meshio and VTK agree on points", same_bits(by_meshio.points, by_vtk.points), "they differ"
    cells_agree = (
        np.array_equal(by_meshio.kinds, by_vtk.kinds)
        and np.array_equal(by_meshio.offsets, by_vtk.offsets)
        and np.array_equal(by_meshio.connectivity, by_vtk.connectivity)
    )
    yield f"{name}: meshio and VTK agree on cells", cells_agree, "they differ"
    wrong = differing(by_meshio.point_arrays, by_vtk.point_arrays)
    wrong += differing(by_meshio.cell_arrays, by_vtk.cell_arrays)
    yield f"{name}: meshio and VTK agree on every array", not wrong, wrong


def check_readers_agree_on_electrodes(run):
    yield from both_readers_agree(run, "electrodes.vtu")


def check_readers_agree_on_trajectories(run):
    yield from both_readers_agree(run, "trajectories.vtu")


def check_both_forms_of_trajectories(run):
    """Polylines and line cells are the same tracks."""
    whole, cut = run.vtk("trajectories.vtp"), run.vtk("trajectories.vtu")
    yield "trajectories: the same points in .vtp and .vtu", same_bits(whole.points, cut.points), "they differ"
    wrong = differing(whole.point_arrays, cut.point_arrays)
    yield "trajectories: the same point arrays in .vtp and .vtu", not wrong, wrong
    pairs, owners = segments(whole)
    dots = np.flatnonzero(whole.kinds == VERTEX)
    cut_dots, cut_pairs = cut.corners(VERTEX).ravel(), cut.corners(LINE).reshape(-1, 2)
    same = np.array_equal(whole.corners(VERTEX).ravel(), cut_dots) and np.array_equal(pairs, cut_pairs)
    yield "trajectories: the .vtu has every segment of the .vtp", same, "they differ"
    owners = np.concatenate([dots, owners])
    wrong = differing({name: values[owners] for name, values in whole.cell_arrays.items()}, cut.cell_arrays)
    yield "trajectories: segments carry the arrays of their track", not wrong, wrong


def tracks(run):
    """Grain of each cell of trajectories.vtp, and of each of its points."""
    data = run.vtk("trajectories.vtp")
    grain = data.cell_arrays[GRAIN].astype(np.int64)
    of_point = np.full(len(data.points), -1, dtype=np.int64)
    of_point[data.connectivity] = np.repeat(grain, np.diff(data.offsets))
    return data, grain, of_point


def check_tracks(run):
    data, grain, of_point = tracks(run)
    yield "trajectories.vtp: one track per grain", len(np.unique(grain)) == len(grain), "a grain has two"
    yield "trajectories.vtp: every point is on a track", np.all(of_point >= 0), "some are on none"
    if TIME in data.point_arrays:
        pairs, _ = segments(data)
        steps = np.diff(data.point_arrays[TIME][pairs], axis=1)
        # Velocity jumps where grains touch: two samples may share a time.
        yield "trajectories.vtp: time never runs backwards", np.all(steps >= 0), f"by {-steps.min(initial=0)} s"


def check_frames(run):
    """The animation: times increase, every file can be read, and the grains are where their tracks say."""
    frames = run.frames()
    times = np.array([time for time, _ in frames])
    yield "grains.pvd: has frames", len(frames) > 0, "none"
    yield "grains.pvd: times increase", np.all(np.diff(times) > 0), times
    missing = [name for _, name in frames if not os.path.isfile(run.path(name))]
    yield "grains.pvd: every file is there", not missing, missing
    data, _, of_point = tracks(run)
    time_of_point = data.point_arrays.get(TIME)
    broken, names, crowded, astray, compared = [], set(), [], [], 0
    for time, name in frames:
        frame, points, cells = read_with_vtk(run.path(name))
        broken += [what for what, ok, _ in sound(name, frame, points, cells) if not ok]
        names.add(tuple(sorted(frame.point_arrays)))
        if points > len(np.unique(of_point)):
            crowded.append(name)
        if GRAIN in frame.point_arrays and time_of_point is not None:
            now = np.flatnonzero(time_of_point == time)
            place = dict(zip(of_point[now].tolist(), data.points[now]))
            for grain, point in zip(frame.point_arrays[GRAIN].tolist(), frame.points):
                if grain in place:
                    compared += 1
                    if not np.array_equal(place[grain], point):
                        astray.append((name, grain))
    yield f"grains.pvd: {len(frames)} frames are sound", not broken, broken[:5]
    yield "grains.pvd: all frames have the same arrays", len(names) <= 1, sorted(names)[:5]
    yield "grains.pvd: no frame has more grains than there are tracks", not crowded, crowded[:5]
    yield f"grains.pvd: {compared} grains are where their tracks are", compared > 0 and not astray, astray[:5]


def check_summary_panels(run):
    data = run.vtk("electrodes.vtu")
    wanted, found = run.summary["panels"], len(data.kinds)
    yield f"summary: {wanted} panels", wanted == found, f"electrodes.vtu has {found}"
    yield "electrodes.vtu: only triangles", np.all(data.kinds == TRIANGLE), np.unique(data.kinds)


def check_summary_electrodes(run):
    data, names = run.vtk("electrodes.vtu"), run.summary["electrodes"]
    found = np.unique(data.cell_arrays[ELECTRODE])
    yield f"summary: electrodes {names}", np.array_equal(found, np.arange(len(names))), f"panels belong to {found}"
    missing = [name for name in names if UNIT_CHARGE_DENSITY.format(name) not in data.cell_arrays]
    yield "electrodes.vtu: a density at 1 V for each electrode", not missing, missing


def check_summary_capacitance(run):
    """The charge on electrode i, with electrode k at 1 V and the others grounded, is the matrix's entry i, k."""
    data, names = run.vtk("electrodes.vtu"), run.summary["electrodes"]
    matrix = np.array(run.summary["capacitance_matrix_farad"], dtype=float).reshape(len(names), len(names))
    if not names:
        yield "summary: no electrodes, no panels", run.summary["panels"] == 0, f"{run.summary['panels']} panels"
        return
    a, b, c = np.moveaxis(data.points[data.corners(TRIANGLE)], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    electrode = data.cell_arrays[ELECTRODE].astype(np.int64)
    scale = np.abs(matrix).max()
    asymmetry = np.abs(matrix - matrix.T).max() / scale
    yield "summary: the capacitance matrix is symmetric", asymmetry <= SYMMETRY_TOLERANCE, f"off by {asymmetry:.1e}"
    for k, name in enumerate(names):
        charges = areas * data.cell_arrays[UNIT_CHARGE_DENSITY.format(name)]
        total = np.bincount(electrode, weights=charges, minlength=len(names))
        error = np.abs(total - matrix[:, k]).max() / scale
        what = f"summary: charges at 1 V on {name!r} add up to the matrix"
        yield what, error <= CHARGE_TOLERANCE, f"off by {error:.1e}"


def check_summary_grains(run):
    trace = run.summary["trace"]
    _, grain, _ = tracks(run)
    yield f"summary: {trace['grains']} grains", trace["grains"] == len(grain), f"{len(grain)} tracks"
    if "outcomes" in trace:
        outcomes = trace["outcomes"]
        total = outcomes.get("time_up", 0) + outcomes.get("left_region", 0) + sum(outcomes.get("struck", {}).values())
        yield "summary: every grain has an outcome", total == trace["grains"], f"{total} outcomes"


def check_summary_final(run):
    """The last point of each track is the final position of its grain."""
    final = run.summary["trace"].get("final")
    if final is None:
        return
    data, grain, _ = tracks(run)
    yield "summary: a final position for each track", len(final) == len(grain), f"{len(final)} for {len(grain)}"
    last = data.connectivity[data.offsets[1:] - 1]
    wanted = np.array([final[g]["position"] for g in grain], dtype=float).reshape(-1, 3)
    extent = max(np.abs(data.points).max(initial=0), np.finfo(float).tiny)
    error = np.abs(data.points[last] - wanted).max(initial=0) / extent
    yield "summary: tracks end at the final positions", error <= POSITION_TOLERANCE, f"off by {error:.1e}"
    if TIME in data.point_arrays:
        ends = np.array([final[g]["time"] for g in grain], dtype=float)
        error = np.abs(data.point_arrays[TIME][last] - ends).max(initial=0)
        ok = error <= POSITION_TOLERANCE * np.abs(ends).max(initial=0)
        yield "summary: tracks end at the final times", ok, f"off by {error:.1e} s"


CHECKS = [
    check_files,
    check_electrodes_vtu,
    check_field_vti,
    check_trajectories_vtp,
    check_trajectories_vtu,
    check_readers_agree_on_electrodes,
    check_readers_agree_on_trajectories,
    check_both_forms_of_trajectories,
    check_tracks,
    check_frames,
    check_summary_panels,
    check_summary_electrodes,
    check_summary_capacitance,
    check_summary_grains,
    check_summary_final,
]

WITHOUT_GRAINS = [
    check_files,
    check_electrodes_vtu,
    check_field_vti,
    check_readers_agree_on_electrodes,
    check_summary_panels,
    check_summary_electrodes,
    check_summary_capacitance,
]


def outcomes(check, run):
    """What a check yields, and one more failure if it breaks."""
    try:
        yield from check(run)
    except Exception as error:  # whatever a reader throws is a file that cannot be read back
        yield f"{check.__name__} can be carried out", False, f"{type(error).__name__}: {error}"


def main(folder):
    passed = failed = 0
    try:
        run = Run(folder)
    except (OSError, ValueError) as error:
        print(f"FAILED  summary.json can be read: {error}")
        print("0 passed, 1 failed")
        return 1
    for check in CHECKS if run.summary["trace"]["grains"] else WITHOUT_GRAINS:
        for what, holds, found in outcomes(check, run):
            if holds:
                passed += 1
                print(f"ok      {what}")
            else:
                failed += 1
                print(f"FAILED  {what}: {found}")
    print(f"{passed} passed, {failed} failed")
    return 0 if failed == 0 else 1


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
