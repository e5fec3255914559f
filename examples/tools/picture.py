#!/usr/bin/python3
"""Draw meshes, motions and eigenfunctions off-screen with VTK (Debian: python3-vtk9 python3-h5py python3-pil xvfb).

  picture.py meshes PICTURE.png MESH.msh...                 Gmsh 2.2 ASCII meshes, side by side
  picture.py motion PICTURE.png SCENE.json...               a row for each scene that was run, some of its frames side by side
  picture.py movie PICTURE.gif SCENE.json...                the same, one after the other, the scenes side by side
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
import vtk

import pose
import sheet

PALE_TO_RED = [(0.95, 0.93, 0.82), (0.99, 0.80, 0.42), (0.95, 0.50, 0.22), (0.78, 0.15, 0.16), (0.45, 0.02, 0.20)]
COOL_WARM = [(0.23, 0.30, 0.75), (0.87, 0.87, 0.87), (0.71, 0.02, 0.15)]
OTHER_HALF = (0.55, 0.66, 0.75)
FULL_SPACE = "full space"


def surface_of(tets):
    """Triangles that belong to one tet."""
    faces = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def draw_meshes(a):
    panels, boxes, rest = [], [], {}
    table = sheet.colours([sheet.PLAIN, OTHER_HALF], -0.01, 0.01)
    for path in a.meshes:
        points, tets = pose.read(path)
        points = points - (points.min(0) + points.max(0)) / 2
        boxes.append(np.ptp(points, axis=0) / 2)
        side = rest.setdefault(len(points), points) @ a.halves if a.halves else np.full(len(points), -1)
        panels.append((f"{pathlib.Path(path).stem}: {len(points)} vertices", [sheet.body(points, surface_of(tets), side, table)]))
    largest = np.max(boxes, 0)
    sheet.Sheet([panels], a.view).save(a.picture, -largest, largest)


def frames_of(times, wanted, count):
    if wanted:
        return [int(np.argmin(abs(times - t))) for t in wanted]
    return np.unique(np.linspace(0, len(times) - 1, count).astype(int))


class Run:
    """Chosen frames of a scene that was run."""

    def __init__(self, path, wanted, count, kind=""):
        path = pathlib.Path(path)
        self.scene = json.loads(path.read_text())
        self.label = path.stem.removeprefix("scene").removeprefix("_").replace("_", " ") + (kind and f", {kind}")
        trajectory = path.parent / self.scene["output"]["trajectory"]
        if kind == FULL_SPACE:
            trajectory = trajectory.with_stem(trajectory.stem + "_full")
        with h5py.File(path.parent / self.scene["bundle"]) as f:
            self.rest, self.surface = f["/object/vertices"][:], f["/object/surface"][:]
            drawn_rest = f["/render/vertices"][:] if "render" in f else self.rest
            self.fixed = np.flatnonzero(f["/object/fixed"][:]) if "/object/fixed" in f else []
            centre = f["/rigid/centre_of_mass"][:] if "rigid" in f else None
        with h5py.File(trajectory) as f:
            frames = frames_of(f["/time"][:], wanted, count)
            pick = lambda name: np.array([f[name][k] for k in frames])
            origin = f.attrs.get("origin", np.zeros(3))
            self.times, self.positions = pick("/time"), pick("/vertices") + origin
            bodies = list(zip(pick("/body/position"), pick("/body/orientation")))
            # The render mesh, where there is one, in place of the tets' surface.
            self.drawn, self.drawn_rest, self.edges = self.positions, self.rest, True
            if "render" in f:
                self.drawn, self.surface = pick("/render/vertices") + origin, f["/render/triangles"][:]
                self.drawn_rest, self.edges = drawn_rest, False
        self.displacement = np.array([self.without_rigid_motion(x, centre, *b) for x, b in zip(self.drawn, bodies)])

    def without_rigid_motion(self, positions, centre, position, orientation):
        """Length of the displacement of each vertex; of a free body in its own frame."""
        if centre is not None:
            positions = (positions - centre - position) @ sheet.rotation(orientation) + centre
        return np.linalg.norm(positions - self.drawn_rest, axis=1)

    def obstacles(self):
        return [x for x in self.scene.get("obstacles", []) if not x.get("motion")]

    def forces(self, time):
        """Vertices and directions of the forces that act at a time."""
        acting = [x for x in self.scene.get("forces", []) if x.get("start", 0) <= time < x.get("end", np.inf)]
        pairs = [(k, x["force"]) for x in acting for k in x["vertices"].get("ids", [])]
        return [k for k, _ in pairs], np.array([x for _, x in pairs])

    def panel(self, k, table, low, high, ghost):
        size = np.linalg.norm(np.ptp(self.rest, axis=0))
        actors = [sheet.body(self.drawn[k], self.surface, self.displacement[k], table, edges=self.edges)]
        if ghost:
            actors.append(sheet.body(self.drawn_rest, self.surface, colour=(0.5, 0.5, 0.5), opacity=0.12, edges=False))
        if len(self.fixed):
            actors.append(sheet.marks(self.positions[k][self.fixed], vtk.vtkSphereSource(), 0.018 * size, (0.1, 0.3, 0.7)))
        ids, directions = self.forces(self.times[k])
        if ids:
            actors.append(sheet.marks(self.positions[k][ids], vtk.vtkArrowSource(), 0.15 * size, (0.1, 0.1, 0.1), directions))
        for obstacle in self.obstacles():
            actors.append(sheet.actor_of(sheet.obstacle_data(obstacle, low, high), (0.6, 0.6, 0.65), opacity=0.35))
        return f"{self.label}  t = {self.times[k]:.2f} s".strip(), actors


    def turn_upright(self):
        """From y up, as in a surface's .glb, to z up."""
        for name in ("rest", "drawn", "drawn_rest", "positions"):
            setattr(self, name, getattr(self, name)[..., [0, 2, 1]] * (1, -1, 1))


def box_of(runs):
    """What holds all that the runs show."""
    shown = np.concatenate([r.drawn.reshape(-1, 3) for r in runs])
    low, high = shown.min(0), shown.max(0)
    for obstacle in itertools.chain(*(r.obstacles() for r in runs)):
        bounds = np.reshape(sheet.obstacle_data(obstacle, low, high).GetBounds(), (3, 2))
        low, high = np.minimum(low, bounds[:, 0]), np.maximum(high, bounds[:, 1])
    return low, high


def panels_of(runs, low, high, ghost):
    """Of each run the panels of its frames, in colours that mean the same in all."""
    table = sheet.colours(PALE_TO_RED, 0, max(r.displacement.max() for r in runs) or 1)
    return [[r.panel(k, table, low, high, ghost) for k in range(len(r.times))] for r in runs]


def draw_motion(a):
    kinds = [FULL_SPACE, "reduced"] if a.full_space else [""]
    runs = [Run(path, a.times, a.frames, kind) for kind in kinds for path in a.scenes]
    for run in runs if a.up == "y" else ():
        run.turn_upright()
    low, high = box_of(runs)
    rows = panels_of(runs, low, high, a.ghost)
    if a.columns:
        rows = [row[k : k + a.columns] for row in [sum(rows, [])] for k in range(0, len(row), a.columns)]
    sheet.Sheet(rows, a.view).save(a.picture, low, high)


def draw_movie(a):
    runs = [Run(path, None, a.frames) for path in a.scenes]
    for run, title in zip(runs, a.titles):
        run.label = title
    low, high = box_of(runs)
    images = [sheet.Sheet([row], a.view).image(low, high, a.pixels) for row in zip(*panels_of(runs, low, high, a.ghost))]
    sheet.save_movie(a.picture, images, 1000 * a.slower * runs[0].times[-1] / len(images))


def draw_eigenfunction(a):
    with h5py.File(a.bundle) as f:
        points, tets = f["/object/vertices"][:], f["/object/tets"][:].astype(np.int64)
        values, eigenvalue = f["/shape_space/eigenfunctions"][:, a.number - 1], f["/shape_space/eigenvalues"][a.number - 1]
    table = sheet.colours(COOL_WARM, -abs(values).max(), abs(values).max())
    whole = sheet.body(points, surface_of(tets), values, table, edges=False)
    panels = [(f"eigenfunction {a.number} (eigenvalue {eigenvalue:.3g})", [whole]),
              ("cut open", [sheet.cut_open(points, tets, values, a.cut, table)])]
    sheet.Sheet([panels], a.view).save(a.picture, points.min(0), points.max(0), 400)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    vector = lambda text: [float(x) for x in text.split(",")]

    def command(name, draw):
        made = commands.add_parser(name)
        made.add_argument("picture")
        made.set_defaults(draw=draw)
        made.add_argument("--view", type=vector, default=[-50, 22],
                          help="AZIMUTH,ELEVATION of the eye [degrees], z is up: --view=-50,22")
        return made

    meshes = command("meshes", draw_meshes)
    meshes.add_argument("meshes", nargs="+")
    meshes.add_argument("--halves", type=vector, help="direction; in another colour what lies on this side of the middle, in a pose what lay there at rest "
                        "(in the first mesh of as many vertices)")
    motion = command("motion", draw_motion)
    motion.add_argument("scenes", nargs="+")
    motion.add_argument("--frames", type=int, default=4, help="so many, spread evenly over the run")
    motion.add_argument("--times", type=vector, help="instead the frames at these times [s]: T,T,...")
    motion.add_argument("--columns", type=int, help="panels in a row, instead of a row for each scene")
    motion.add_argument("--ghost", action="store_true", help="the rest shape, faint, in each panel")
    motion.add_argument("--up", choices="yz", default="z", help="the axis that points up; y: without obstacles and forces")
    motion.add_argument("--full-space", action="store_true", help="before the scenes, the same by exmat-precompute full-space, which wrote "
                        "NAME_full.h5 beside each trajectory NAME.h5")
    movie = command("movie", draw_movie)
    movie.add_argument("scenes", nargs="+")
    movie.add_argument("--frames", type=int, default=50, help="so many, spread evenly over the run")
    movie.add_argument("--slower", type=float, default=1, help="so many times as long as the run")
    movie.add_argument("--titles", type=lambda text: text.split(","), default=[], help="what stands above each scene: TITLE,TITLE,...")
    movie.add_argument("--pixels", type=int, default=300, help="length of the longer side of a panel")
    movie.add_argument("--ghost", action="store_true", help="the rest shape, faint, in each panel")
    eigenfunction = command("eigenfunction", draw_eigenfunction)
    eigenfunction.add_argument("bundle")
    eigenfunction.add_argument("number", type=int)
    eigenfunction.add_argument("--cut", type=vector, default=[0, -1, 0], help="normal of the plane through the middle, towards what is taken off")
    a = parser.parse_args()
    a.draw(a)


if __name__ == "__main__":
    if "DISPLAY" not in os.environ:  # Debian's VTK draws through an X server
        os.execvp("xvfb-run", ["xvfb-run", "-a", sys.executable, *sys.argv])
    main()
