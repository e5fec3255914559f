#!/usr/bin/python3
"""Draws times of a run of several bodies side by side, a colour for each kind.

Usage: draw.py PICTURE.png TRAJECTORY.h5 TIME [TIME ...]    (Debian: python3-h5py python3-vtk9)
"""
import sys

import h5py
import numpy as np
import vtk
from vtk.util import numpy_support

COLOURS = [(0.84, 0.55, 0.24), (0.22, 0.48, 0.70), (0.55, 0.75, 0.55)]  # apart for the colour-blind, too
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def boundary(tets):
    faces = np.concatenate([tets[:, face] for face in FACES])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def actor(points, triangles, colour):
    mesh = vtk.vtkPolyData()
    held = vtk.vtkPoints()
    held.SetData(numpy_support.numpy_to_vtk(points, deep=True))
    mesh.SetPoints(held)
    cells = vtk.vtkCellArray()
    rows = np.column_stack([np.full(len(triangles), 3), triangles]).astype(np.int64).ravel()
    cells.SetCells(len(triangles), numpy_support.numpy_to_vtkIdTypeArray(rows, deep=True))
    mesh.SetPolys(cells)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(mesh)
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.GetProperty().SetColor(*colour)
    return made


def floor():
    plane = vtk.vtkPlaneSource()
    plane.SetOrigin(-4, -12, 0)
    plane.SetPoint1(4, -12, 0)
    plane.SetPoint2(-4, 12, 0)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(plane.GetOutputPort())
    made = vtk.vtkActor()
    made.SetMapper(mapper)
    made.GetProperty().SetColor(0.9, 0.9, 0.9)
    made.GetProperty().SetAmbient(0.6)
    return made


def main():
    picture, trajectory, *times = sys.argv[1:]
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(480 * len(times), 640)
    with h5py.File(trajectory) as file:
        kinds = []
        for name in file["bodies"]:
            kind = name.rsplit("_", 1)[0]
            if kind not in kinds:
                kinds.append(kind)
        for i, time in enumerate(times):
            renderer = vtk.vtkRenderer()
            renderer.SetBackground(1, 1, 1)
            renderer.SetViewport(i / len(times), 0, (i + 1) / len(times), 1)
            renderer.AddActor(floor())
            for name, body in file["bodies"].items():
                frame = int(np.argmin(np.abs(body["time"][:] - float(time))))
                colour = COLOURS[kinds.index(name.rsplit("_", 1)[0]) % len(COLOURS)]
                renderer.AddActor(actor(body["vertices"][frame].astype(float), boundary(body["tets"][:]), colour))
            camera = renderer.GetActiveCamera()
            camera.SetViewUp(0, 0, 1)
            camera.SetPosition(3, -34, 10)
            camera.SetFocalPoint(0, 0, 5)
            renderer.ResetCameraClippingRange()
            window.AddRenderer(renderer)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(picture)
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main()
