"""Draws a run as the README shows it: electrodes with their charge, lines of equal potential, tracks.

    pvbatch --force-offscreen-rendering cases/picture.py OUTDIR PICTURE.png [NORMAL] [ARRAY]

NORMAL is the axis across which the field is cut, x, y or z; ARRAY what the lines are of, potential or pseudopotential.
"""

import os
import sys

from paraview import simple as pv

folder, picture = sys.argv[1:3]
normal = sys.argv[3] if len(sys.argv) > 3 else "z"
array = sys.argv[4] if len(sys.argv) > 4 else "potential"
LINES = 24


def path(name):
    return os.path.join(folder, name)


view = pv.CreateView("RenderView")
view.ViewSize = [1200, 900]
view.UseColorPaletteForBackground = 0
view.Background = [1.0, 1.0, 1.0]
view.OrientationAxesVisibility = 1
view.OrientationAxesLabelColor = [0.0, 0.0, 0.0]

electrodes = pv.XMLUnstructuredGridReader(FileName=[path("electrodes.vtu")])
electrodes.UpdatePipeline()
field = pv.XMLImageDataReader(FileName=[path("field.vti")])
field.UpdatePipeline()
bounds = field.GetDataInformation().GetBounds()
center = [(bounds[2 * k] + bounds[2 * k + 1]) / 2 for k in range(3)]
size = max(bounds[2 * k + 1] - bounds[2 * k] for k in range(3))

if electrodes.GetDataInformation().GetNumberOfCells():
    shown = pv.Show(electrodes, view)
    pv.ColorBy(shown, ("CELLS", "surface_charge_density"))
    colours = pv.GetColorTransferFunction("surface_charge_density")
    low, high = electrodes.CellData["surface_charge_density"].GetRange()
    # Edges carry most: a fifth of the extreme shows the rest as well.
    reach = max(abs(low), abs(high)) / 5 or 1.0
    colours.ApplyPreset("Cool to Warm", True)
    colours.RescaleTransferFunction(-reach, reach)
    shown.Opacity = 0.55
    shown.SetScalarBarVisibility(view, False)

cut = pv.Slice(Input=field)
cut.SliceType = "Plane"
cut.SliceType.Origin = center
axis = "xyz".index(normal)
cut.SliceType.Normal = [1.0 if k == axis else 0.0 for k in range(3)]
free = pv.Threshold(Input=cut, Scalars=["POINTS", "conductor"], LowerThreshold=0.0, UpperThreshold=0.5)
free.ThresholdMethod = "Between"
free.UpdatePipeline()
low, high = free.PointData[array].GetRange()
if high > low:
    lines = pv.Contour(Input=free, ContourBy=["POINTS", array])
    lines.Isosurfaces = [low + (high - low) * (k + 0.5) / LINES for k in range(LINES)]
    shown = pv.Show(lines, view)
    shown.ColorArrayName = [None, ""]
    shown.AmbientColor = shown.DiffuseColor = [0.35, 0.35, 0.4]
    shown.LineWidth = 1.2
    shown.Ambient, shown.Diffuse = 1.0, 0.0

if os.path.exists(path("trajectories.vtp")):
    tracks = pv.XMLPolyDataReader(FileName=[path("trajectories.vtp")])
    tracks.UpdatePipeline()
    tubes = pv.Tube(Input=tracks, Radius=size / 700)
    shown = pv.Show(tubes, view)
    pv.ColorBy(shown, ("POINTS", "time"))
    shown.RescaleTransferFunctionToDataRange(False, True)
    pv.GetColorTransferFunction("time").ApplyPreset("Viridis (matplotlib)", True)
    shown.SetScalarBarVisibility(view, True)
    bar = pv.GetScalarBar(pv.GetColorTransferFunction("time"), view)
    bar.Title, bar.ComponentTitle = "time (s)", ""
    bar.TitleColor = bar.LabelColor = [0.0, 0.0, 0.0]
    bar.ScalarBarLength = 0.3
    # Where the grains are at the end.
    ends = pv.OpenDataFile(path("grains.pvd"))
    ends.UpdatePipeline()
    times = ends.TimestepValues
    last = times[-1] if hasattr(times, "__len__") else times
    view.ViewTime = last
    balls = pv.Glyph(Input=ends, GlyphType="Sphere")
    balls.ScaleFactor = size / 60
    balls.GlyphMode = "All Points"
    shown = pv.Show(balls, view)
    shown.ColorArrayName = [None, ""]
    shown.AmbientColor = shown.DiffuseColor = [0.1, 0.1, 0.1]

across = [1.0 if k == axis else 0.0 for k in range(3)]
side = [0.55, 0.35, 0.55]
direction = [across[k] * 1.6 + (side[k] if k != axis else 0.0) for k in range(3)]
pv.ResetCamera(view)
view.CameraFocalPoint = center
view.CameraPosition = [center[k] + size * 1.3 * direction[k] for k in range(3)]
view.CameraViewUp = [0.0, 0.0, 1.0] if normal != "z" else [0.0, 1.0, 0.0]
pv.Render(view)
pv.SaveScreenshot(picture, view, ImageResolution=[1200, 900])
