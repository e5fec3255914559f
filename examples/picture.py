#!/usr/bin/python3
"""Draw meshes, motions and eigenfunctions off-screen with VTK (Debian: python3-vtk9 python3-h5py python3-pil xvfb).

  picture.py meshes PICTURE.png MESH.msh...                 Gmsh 2.2 ASCII meshes, side by side
  picture.py motion PICTURE.png SCENE.json...               a row for each scene that was run, some of its frames side by side
  picture.py eigenfunction PICTURE.png BUNDLE.h5 NUMBER     an eigenfunction on the surface and, cut open by a plane, inside
"""
import argparse
import itertools
import json
import os
import pathlib
import sys

import h5py
import numpy as np
import PIL.Image
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

import pose

PALE_TO_RED = [(0.95, 0.93, 0.82), (0.99, 0.80, 0.42), (0.95, 0.50, 0.22), (0.78, 0.15, 0.16), (0.45, 0.02, 0.20)]
COOL_WARM = [(0.23, 0.30, 0.75), (0.87, 0.87, 0.87), (0.71, 0.02, 0.15)]
PLAIN, OTHER_HALF = (0.85, 0.66, 0.42), (0.55, 0.66, 0.75)
FINER = 2  # drawn at so many times the pixels
PIXELS_A_PANEL = 300  # the longer side of what is drawn
CAPTION_PIXELS = (7.5, 22)  # width of a letter, height


# What is drawn.


def poly_data(points, polygons):
    data = vtk.vtkPolyData()
    data.SetPoints(vtk.vtkPoints())
    data.GetPoints().SetData(numpy_to_vtk(np.ascontiguousarray(points, float), deep=True))
    cells = vtk.vtkCellArray()
    corners = polygons.shape[1]
    ids = np.concatenate([np.full((len(polygons), 1), corners), polygons], 1).astype(np.int64)
    cells.SetCells(len(polygons), numpy_to_vtkIdTypeArray(ids.ravel(), deep=True))
    data.SetPolys(cells)
    return data


def colours(stops, low, high):
    table = vtk.vtkColorTransferFunction()
    for value, colour in zip(np.linspace(low, high, len(stops)), stops):
        table.AddRGBPoint(value, *colour)
    return table


def actor_of(data, colour=PLAIN, table=None, opacity=1, edges=True):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarVisibility(table is not None)
    if table is not None:
        mapper.SetLookupTable(table)
        mapper.InterpolateScalarsBeforeMappingOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*colour)
    look.SetOpacity(opacity)
    look.SetInterpolationToFlat()
    look.SetAmbient(0.35)
    look.SetDiffuse(0.7)
    look.SetEdgeVisibility(edges)
    look.SetEdgeColor(*((0.6 if data.GetNumberOfPoints() < 3000 else 0.75) * np.array(colour)))
    look.SetLineWidth(1.2)
    return actor


def body(points, triangles, values=None, table=None, **look):
    data = poly_data(points, triangles)
    if values is not None:
        data.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values, float), deep=True))
    return actor_of(data, table=table, **look)


def marks(points, shape, scale, colour, directions=None):
    """The same small shape at each of some points."""
    data = vtk.vtkPolyData()
    data.SetPoints(vtk.vtkPoints())
    data.GetPoints().SetData(numpy_to_vtk(np.ascontiguousarray(points, float), deep=True))
    if directions is not None:
        data.GetPointData().SetVectors(numpy_to_vtk(np.ascontiguousarray(directions, float), deep=True))
    glyph = vtk.vtkGlyph3D()
    glyph.SetSourceConnection(shape.GetOutputPort())
    glyph.SetInputData(data)
    glyph.SetScaleModeToDataScalingOff()
    glyph.SetScaleFactor(scale)
    glyph.Update()
    return actor_of(glyph.GetOutput(), colour, edges=False)


def rotation(quaternion):
    w, x, y, z = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def obstacle_data(obstacle, low, high):
    """Polygons of an obstacle; a plane is cut off at the box low..high, which all others may leave."""
    if "plane" in obstacle:
        normal = np.array(obstacle["plane"]["normal"], float)
        point = np.array(obstacle["plane"].get("point", [0, 0, 0]), float)
        axis = int(np.argmax(abs(normal)))
        b, c = (axis + 1) % 3, (axis + 2) % 3
        corners = np.zeros((4, 3))
        corners[:, b], corners[:, c] = [low[b], high[b], high[b], low[b]], [low[c], low[c], high[c], high[c]]
        corners[:, axis] = ((point - corners) @ normal) / normal[axis]
        return poly_data(corners, np.arange(4)[None])
    if "box" in obstacle:
        box = obstacle["box"]
        corners = np.array(list(itertools.product((-1, 1), repeat=3))) * box["half_extents"]
        faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
        return poly_data(corners @ rotation(box.get("orientation", [1, 0, 0, 0])).T + box.get("center", [0, 0, 0]), faces)
    ball = obstacle.get("sphere") or obstacle["capsule"]
    start = np.array(ball.get("start", ball.get("center", [0, 0, 0])), float)
    end = np.array(ball.get("end", start), float)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 33), np.linspace(0, np.pi, 17))
    unit = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1).reshape(-1, 3)
    grid = np.arange(17 * 33).reshape(17, 33)
    faces = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], -1).reshape(-1, 4)
    return poly_data(np.where((unit @ (end - start) > 0)[:, None], end, start) + ball["radius"] * unit, faces)


# Panels on a sheet.


def light(renderer):
    """From the upper left, and some from the eye."""
    for position, intensity in ((-0.7, 1, 0.6), 0.7), ((0.3, 0.2, 1), 0.6):
        lamp = vtk.vtkLight()
        lamp.SetLightTypeToCameraLight()
        lamp.SetPosition(*position)
        lamp.SetIntensity(intensity)
        renderer.AddLight(lamp)


class Sheet:
    """Rows of panels of one size, all seen along one direction and at one scale."""

    def __init__(self, rows, view):
        self.rows = rows  # [[(title, [actor...])...]...]
        azimuth, elevation = np.radians(view)
        self.to_eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        self.right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        self.up = np.cross(self.to_eye, self.right)

    def save(self, path, low, high, pixels=PIXELS_A_PANEL):
        """Draw what lies in the box low..high."""
        corners = np.array(list(itertools.product(*zip(low, high))))
        flat = np.stack([corners @ self.right, corners @ self.up])
        middle, extent = (flat.max(1) + flat.min(1)) / 2, 1.04 * np.ptp(flat, axis=1)
        columns, title = max(map(len, self.rows)), CAPTION_PIXELS[1]
        per_metre = pixels / extent.max()
        letters = max(len(caption) for row in self.rows for caption, _ in row)
        width = int(max(per_metre * extent[0], CAPTION_PIXELS[0] * letters + 16))
        height = int(per_metre * extent[1]) + title
        window = vtk.vtkRenderWindow()
        window.SetOffScreenRendering(1)
        window.SetMultiSamples(0)
        window.SetSize(FINER * columns * width, FINER * len(self.rows) * height)
        for (k, row), (j, panel) in itertools.product(enumerate(self.rows), enumerate(range(columns))):
            renderer = vtk.vtkRenderer()
            renderer.SetViewport(j / columns, 1 - (k + 1) / len(self.rows), (j + 1) / columns, 1 - k / len(self.rows))
            renderer.SetBackground(1, 1, 1)
            renderer.SetUseDepthPeeling(1)
            window.AddRenderer(renderer)
            if panel >= len(row):
                continue
            for actor in row[panel][1]:
                renderer.AddActor(actor)
            renderer.AddActor(self.caption(row[panel][0], height))
            light(renderer)
            self.look(renderer.GetActiveCamera(), middle, height / per_metre / 2, title / per_metre / 2)
            renderer.ResetCameraClippingRange()
        window.Render()
        grab = vtk.vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.Update()
        colours_of_pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
        image = PIL.Image.fromarray(colours_of_pixels.reshape(*window.GetSize()[::-1], 3)[::-1].copy()).reduce(FINER)
        image.quantize(96, dither=PIL.Image.Dither.NONE).save(path, optimize=True)
        print(f"{path}: {len(self.rows)} x {columns} panels")

    def caption(self, text, height):
        caption = vtk.vtkTextActor()
        caption.SetInput(text)
        caption.GetTextProperty().SetColor(0.1, 0.1, 0.1)
        caption.GetTextProperty().SetFontSize(FINER * 13)
        caption.SetPosition(FINER * 8, FINER * (height - 20))
        return caption

    def look(self, camera, middle, scale, lift):
        target = middle[0] * self.right + (middle[1] + lift) * self.up
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(*target)
        camera.SetPosition(*(target + 100 * scale * self.to_eye))
        camera.SetViewUp(*self.up)
        camera.SetParallelScale(scale)


# The three kinds of pictures.


def surface_of(tets):
    """Triangles that belong to one tet."""
    faces = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def draw_meshes(a):
    panels, boxes, rest = [], [], {}
    table = colours([PLAIN, OTHER_HALF], -0.01, 0.01)
    for path in a.meshes:
        points, tets = pose.read(path)
        points = points - (points.min(0) + points.max(0)) / 2
        boxes.append(np.ptp(points, axis=0) / 2)
        side = rest.setdefault(len(points), points) @ a.halves if a.halves else np.full(len(points), -1)
        panels.append((f"{pathlib.Path(path).stem}: {len(points)} vertices", [body(points, surface_of(tets), side, table)]))
    largest = np.max(boxes, 0)
    Sheet([panels], a.view).save(a.picture, -largest, largest)


def frames_of(times, wanted, count):
    if wanted:
        return [int(np.argmin(abs(times - t))) for t in wanted]
    return np.unique(np.linspace(0, len(times) - 1, count).astype(int))


class Run:
    """Chosen frames of a scene that was run."""

    def __init__(self, path, wanted, count):
        path = pathlib.Path(path)
        self.scene = json.loads(path.read_text())
        self.label = path.stem.removeprefix("scene").removeprefix("_").replace("_", " ")
        with h5py.File(path.parent / self.scene["bundle"]) as f:
            self.rest, self.surface = f["/object/vertices"][:], f["/object/surface"][:]
            self.fixed = np.flatnonzero(f["/object/fixed"][:]) if "/object/fixed" in f else []
            centre = f["/rigid/centre_of_mass"][:] if "rigid" in f else None
        with h5py.File(path.parent / self.scene["output"]["trajectory"]) as f:
            frames = frames_of(f["/time"][:], wanted, count)
            pick = lambda name: np.array([f[name][k] for k in frames])
            self.times, self.positions = pick("/time"), pick("/vertices").astype(float)
            bodies = list(zip(pick("/body/position"), pick("/body/orientation")))
        self.displacement = np.array([self.without_rigid_motion(x, centre, *b) for x, b in zip(self.positions, bodies)])

    def without_rigid_motion(self, positions, centre, position, orientation):
        """Length of the displacement of each vertex; of a free body in its own frame."""
        if centre is not None:
            positions = (positions - centre - position) @ rotation(orientation) + centre
        return np.linalg.norm(positions - self.rest, axis=1)

    def obstacles(self):
        return [x for x in self.scene.get("obstacles", []) if not x.get("motion")]

    def forces(self, time):
        """Vertices and directions of the forces that act at a time."""
        acting = [x for x in self.scene.get("forces", []) if x.get("start", 0) <= time < x.get("end", np.inf)]
        pairs = [(k, x["force"]) for x in acting for k in x["vertices"].get("ids", [])]
        return [k for k, _ in pairs], np.array([x for _, x in pairs])

    def panel(self, k, table, low, high, ghost):
        size = np.linalg.norm(np.ptp(self.rest, axis=0))
        actors = [body(self.positions[k], self.surface, self.displacement[k], table)]
        if ghost:
            actors.append(body(self.rest, self.surface, colour=(0.5, 0.5, 0.5), opacity=0.12, edges=False))
        if len(self.fixed):
            actors.append(marks(self.positions[k][self.fixed], vtk.vtkSphereSource(), 0.018 * size, (0.1, 0.3, 0.7)))
        ids, directions = self.forces(self.times[k])
        if ids:
            actors.append(marks(self.positions[k][ids], vtk.vtkArrowSource(), 0.15 * size, (0.1, 0.1, 0.1), directions))
        for obstacle in self.obstacles():
            actors.append(actor_of(obstacle_data(obstacle, low, high), (0.6, 0.6, 0.65), opacity=0.35))
        return f"{self.label}  t = {self.times[k]:.2f} s".strip(), actors


def draw_motion(a):
    runs = [Run(path, a.times, a.frames) for path in a.scenes]
    shown = np.concatenate([r.positions.reshape(-1, 3) for r in runs])
    low, high = shown.min(0), shown.max(0)
    for obstacle in itertools.chain(*(r.obstacles() for r in runs)):
        bounds = np.reshape(obstacle_data(obstacle, low, high).GetBounds(), (3, 2))
        low, high = np.minimum(low, bounds[:, 0]), np.maximum(high, bounds[:, 1])
    table = colours(PALE_TO_RED, 0, max(r.displacement.max() for r in runs) or 1)
    rows = [[r.panel(k, table, low, high, a.ghost) for k in range(len(r.times))] for r in runs]
    if a.columns:
        rows = [row[k : k + a.columns] for row in [sum(rows, [])] for k in range(0, len(row), a.columns)]
    Sheet(rows, a.view).save(a.picture, low, high)


def draw_eigenfunction(a):
    with h5py.File(a.bundle) as f:
        points, tets = f["/object/vertices"][:], f["/object/tets"][:].astype(np.int64)
        values, eigenvalue = f["/shape_space/eigenfunctions"][:, a.number - 1], f["/shape_space/eigenvalues"][a.number - 1]
    table = colours(COOL_WARM, -abs(values).max(), abs(values).max())
    grid = vtk.vtkUnstructuredGrid()
    whole = poly_data(points, surface_of(tets))
    grid.SetPoints(whole.GetPoints())
    cells = vtk.vtkCellArray()
    cells.SetCells(len(tets), numpy_to_vtkIdTypeArray(np.insert(tets, 0, 4, axis=1).ravel(), deep=True))
    grid.SetCells(vtk.VTK_TETRA, cells)
    grid.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values), deep=True))
    plane = vtk.vtkPlane()
    plane.SetOrigin(*((points.min(0) + points.max(0)) / 2))
    plane.SetNormal(*a.cut)
    clip = vtk.vtkClipDataSet()
    clip.SetInputData(grid)
    clip.SetClipFunction(plane)
    clip.InsideOutOn()
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputConnection(clip.GetOutputPort())
    surface.Update()
    panels = [(f"eigenfunction {a.number} (eigenvalue {eigenvalue:.3g})", [body(points, surface_of(tets), values, table, edges=False)]),
              ("cut open", [actor_of(surface.GetOutput(), table=table, edges=False)])]
    Sheet([panels], a.view).save(a.picture, points.min(0), points.max(0), 400)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    vector = lambda text: [float(x) for x in text.split(",")]

    def command(name, draw):
        made = commands.add_parser(name)
        made.add_argument("picture")
        made.set_defaults(draw=draw)
        made.add_argument("--view", type=vector, default=[-50, 22], help="AZIMUTH,ELEVATION of the eye [degrees], z is up; write --view=-50,22")
        return made

    meshes = command("meshes", draw_meshes)
    meshes.add_argument("meshes", nargs="+")
    meshes.add_argument("--halves", type=vector, help="a pose shows in another colour what was on this side of the middle in the mesh before it with the same number of vertices")
    motion = command("motion", draw_motion)
    motion.add_argument("scenes", nargs="+")
    motion.add_argument("--frames", type=int, default=4, help="so many, spread evenly over the run")
    motion.add_argument("--times", type=vector, help="instead the frames at these times [s]: T,T,...")
    motion.add_argument("--columns", type=int, help="panels in a row, instead of a row for each scene")
    motion.add_argument("--ghost", action="store_true", help="the rest shape, faint, in each panel")
    eigenfunction = command("eigenfunction", draw_eigenfunction)
    eigenfunction.add_argument("bundle")
    eigenfunction.add_argument("number", type=int)
    eigenfunction.add_argument("--cut", type=vector, default=[0, -1, 0], help="normal of the plane through the middle, towards what is taken off")
    a = parser.parse_args()
    a.draw(a)


if __name__ == "__main__":
    if "DISPLAY" not in os.environ:  # Debian's VTK draws through an X server
        os.execvp("xvfb-run", ["xvfb-run", "-a", *sys.argv])
    main()
