"""Bodies, obstacles and marks as VTK draws them, and sheets of panels that show them, off-screen."""
import itertools
import pathlib

import numpy as np
import PIL.Image
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

PLAIN = (0.85, 0.66, 0.42)
FINER = 2  # drawn at so many times the pixels
CAPTION_PIXELS = (7.5, 22)  # width of a letter, height


# What is drawn.


def doubles(array):
    return numpy_to_vtk(np.ascontiguousarray(array, float), deep=True)


def points_of(array):
    points = vtk.vtkPoints()
    points.SetData(doubles(array))
    return points


def cells_of(corners):
    """Cells of equally many corners each."""
    cells = vtk.vtkCellArray()
    counted = np.insert(corners.astype(np.int64), 0, corners.shape[1], axis=1)
    cells.SetCells(len(corners), numpy_to_vtkIdTypeArray(counted.ravel(), deep=True))
    return cells


def poly_data(points, polygons):
    data = vtk.vtkPolyData()
    data.SetPoints(points_of(points))
    data.SetPolys(cells_of(polygons))
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
        data.GetPointData().SetScalars(doubles(values))
    return actor_of(data, table=table, **look)


def marks(points, shape, scale, colour, directions=None):
    """The same small shape at each of some points."""
    data = vtk.vtkPolyData()
    data.SetPoints(points_of(points))
    if directions is not None:
        data.GetPointData().SetVectors(doubles(directions))
    glyph = vtk.vtkGlyph3D()
    glyph.SetSourceConnection(shape.GetOutputPort())
    glyph.SetInputData(data)
    glyph.SetScaleModeToDataScalingOff()
    glyph.SetScaleFactor(scale)
    glyph.Update()
    return actor_of(glyph.GetOutput(), colour, edges=False)


def cut_open(points, tets, values, normal, table):
    """What of a body lies on one side of a plane through its middle; the normal points to what is taken off."""
    grid = vtk.vtkUnstructuredGrid()
    grid.SetPoints(points_of(points))
    grid.SetCells(vtk.VTK_TETRA, cells_of(tets))
    grid.GetPointData().SetScalars(doubles(values))
    plane = vtk.vtkPlane()
    plane.SetOrigin(*((points.min(0) + points.max(0)) / 2))
    plane.SetNormal(*normal)
    clip = vtk.vtkClipDataSet()
    clip.SetInputData(grid)
    clip.SetClipFunction(plane)
    clip.InsideOutOn()
    surface = vtk.vtkDataSetSurfaceFilter()
    surface.SetInputConnection(clip.GetOutputPort())
    surface.Update()
    return actor_of(surface.GetOutput(), table=table, edges=False)


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


def image_of(window):
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.Update()
    width, height = window.GetSize()
    pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(height, width, 3)[::-1].copy()
    window.Finalize()
    return PIL.Image.fromarray(pixels).reduce(FINER)


def in_few_colours(image, colours=96, palette=None):
    """Which keeps files small."""
    return image.quantize(colours, palette=palette, dither=PIL.Image.Dither.NONE)


def save_movie(path, images, milliseconds):
    """A GIF that starts again at its end, each image for so long; all have the colours of the last."""
    palette = in_few_colours(images[-1], 64)
    first, *others = [in_few_colours(image, palette=palette) for image in images]
    first.save(path, save_all=True, append_images=others, duration=milliseconds, loop=0, optimize=False)
    print(f"{path}: {len(images)} images of {first.width} x {first.height}, {pathlib.Path(path).stat().st_size} bytes")


class Sheet:
    """Rows of panels of one size, all seen along one direction and at one scale."""

    def __init__(self, rows, view):
        self.rows = rows  # [[(title, [actor...])...]...]
        azimuth, elevation = np.radians(view)
        self.to_eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        self.right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
        self.up = np.cross(self.to_eye, self.right)

    def save(self, path, low, high, pixels=300):
        """Draw what lies in the box low..high, so many pixels long."""
        in_few_colours(self.image(low, high, pixels)).save(path, optimize=True)
        print(f"{path}: {len(self.rows)} x {max(map(len, self.rows))} panels")

    def image(self, low, high, pixels):
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
        for (k, row), j in itertools.product(enumerate(self.rows), range(columns)):
            renderer = vtk.vtkRenderer()
            renderer.SetViewport(j / columns, 1 - (k + 1) / len(self.rows), (j + 1) / columns, 1 - k / len(self.rows))
            renderer.SetBackground(1, 1, 1)
            renderer.SetUseDepthPeeling(1)
            window.AddRenderer(renderer)
            if j < len(row):
                self.fill(renderer, *row[j], height)
                self.look(renderer.GetActiveCamera(), middle, height / per_metre / 2, title / per_metre / 2)
                renderer.ResetCameraClippingRange()
        return image_of(window)

    def fill(self, renderer, text, actors, height):
        caption = vtk.vtkTextActor()
        caption.SetInput(text)
        caption.GetTextProperty().SetColor(0.1, 0.1, 0.1)
        caption.GetTextProperty().SetFontSize(FINER * 13)
        caption.SetPosition(FINER * 8, FINER * (height - 20))
        for actor in [*actors, caption]:
            renderer.AddActor(actor)
        light(renderer)

    def look(self, camera, middle, scale, lift):
        target = middle[0] * self.right + (middle[1] + lift) * self.up
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(*target)
        camera.SetPosition(*(target + 100 * scale * self.to_eye))
        camera.SetViewUp(*self.up)
        camera.SetParallelScale(scale)
