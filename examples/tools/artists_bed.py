#!/usr/bin/python3
"""Measure how near settled bodies come to the poses that were posed: ten surfaces, made here, 97 poses, at default settings.

Usage: artists_bed.py [--write] [--programs build/release/bin] [--output build/artists_bed] [BODY ...]
       (Debian: python3-h5py, python3-vtk9; the Python module that is built with exmat)

Each surface becomes a bundle as it is, and a second one with a scene: gravity, and targets that make up for it. Errors are what the bundles
say: of the body settled under one example alone, over the displacement of the pose. Rows are kept in --output, one file for each surface.
--write renews docs/studies/poses.md by the rows of all surfaces, those that are not named by the rows that are kept. Half an hour.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import textwrap
import time

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "studies" / "poses.md"
GRID = 70  # cells along the longest side that a surface is contoured on
SCENE = {"time_step": 0.004, "steps": 1, "gravity": [0, -9.81, 0], "examples": {"stiffness": 4000, "compensate": True}}


# Solids, by the distance of points [n x 3] from them: below 0 inside.


def capsule(start, end, radius, flat=(1, 1, 1)):
    """`flat`: how many times thinner it is along each axis."""
    start, end = np.array(start, float), np.array(end, float)

    def distance(points):
        along = np.clip((points - start) @ (end - start) / max((end - start) @ (end - start), 1e-12), 0, 1)
        return (np.linalg.norm((points - start - along[:, None] * (end - start)) * flat, axis=1) - radius) / max(flat)
    return distance


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)

    def distance(points):
        out = np.maximum(low - points, points - high)
        return np.linalg.norm(np.maximum(out, 0), axis=1) + np.minimum(out.max(1), 0)
    return distance


def torus(radius, thickness):
    return lambda p: np.hypot(np.hypot(p[:, 0], p[:, 2]) - radius, p[:, 1]) - thickness


def union(*solids, blend=0.03):
    return lambda p: -blend * np.log(sum(np.exp(-np.clip(solid(p) / blend, -60, 60)) for solid in solids))


def without(solid, hole):
    return lambda p: np.maximum(solid(p), -hole(p))


def contour(solid, low, high, cells):
    """Vertices [v x 3] and triangles of its surface."""
    cell = max(np.subtract(high, low)) / cells
    sizes = np.ceil(np.subtract(high, low) / cell).astype(int) + 1
    axes = [low[a] + cell * np.arange(sizes[a]) for a in range(3)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    grid = vtk.vtkImageData()
    grid.SetDimensions(*sizes)
    grid.SetOrigin(*low)
    grid.SetSpacing(cell, cell, cell)
    grid.GetPointData().SetScalars(numpy_to_vtk(solid(np.stack([x.ravel(), y.ravel(), z.ravel()], 1)), deep=True))
    surface = vtk.vtkContourFilter()
    surface.SetInputData(grid)
    surface.SetValue(0, 0)
    surface.Update()
    made = surface.GetOutput()
    return vtk_to_numpy(made.GetPoints().GetData()).astype(float), vtk_to_numpy(made.GetPolys().GetData()).reshape(-1, 4)[:, [1, 3, 2]]


# Poses, as functions of points.


def smooth(x):
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def turned(points, axis, angles, pivot=(0, 0, 0)):
    """By an angle for each point [rad]."""
    axis, arm = np.array(axis, float) / np.linalg.norm(axis), points - pivot
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return pivot + cosine * arm + sine * np.cross(axis, arm) + (1 - cosine) * (arm @ axis)[:, None] * axis


def twist(axis, degrees, start, length):
    """About a line through the origin, from `start` on along it."""
    unit = np.eye(3)["xyz".index(axis)]
    return lambda p: turned(p, unit, np.radians(degrees) * np.clip((p @ unit - start) / length, 0, 1))


def bend(along, towards, degrees, start, length):
    """An arc: what is beyond it follows rigidly."""
    u, t = np.eye(3)["xyz".index(along)], np.eye(3)["xyz".index(towards)]

    def pose(p):
        angle = np.radians(degrees)
        radius = length / angle
        s, height = p @ u - start, p @ t
        on_arc = np.clip(s, 0, length)
        turn = on_arc / radius
        beyond = s - on_arc
        new_s = (radius - height) * np.sin(turn) + beyond * np.cos(turn)
        new_height = radius - (radius - height) * np.cos(turn) + beyond * np.sin(turn)
        return p + ((new_s + start) - p @ u)[:, None] * u + (new_height - height)[:, None] * t
    return pose


def joint(pivot, axis, degrees, toward, width):
    """What lies `toward` of the pivot turns about it, over so wide a crease."""
    toward = np.array(toward, float) / np.linalg.norm(toward)
    return lambda p: turned(p, axis, np.radians(degrees) * smooth(((p - pivot) @ toward) / width + 0.5), pivot)


def squash(axis, factor):
    """To so much of its length, at the same volume."""
    scale = np.full(3, factor**-0.5)
    scale["xyz".index(axis)] = factor
    return lambda p: p * scale


def bump(middle, radius, way):
    return lambda p: p + np.exp(-(((p - middle) / radius) ** 2).sum(1))[:, None] * np.array(way, float)


def within(inside, pose):
    """A pose of what is inside, an amount from 0 to 1 for each point."""
    return lambda p: p + inside(p)[:, None] * (pose(p) - p)


def then(*poses):
    def pose(p):
        for one in poses:
            p = one(p)
        return p
    return pose


# The bodies: solid, box that holds it, poses, what is clamped.


def figure():
    parts = [capsule((0, 0.95, 0), (0, 1.4, 0), 0.17), capsule((0, 1.58, 0), (0, 1.72, 0), 0.13)]
    for side in (1, -1):
        parts += [capsule((0.2 * side, 1.38, 0), (0.76 * side, 1.22, 0), 0.07), capsule((0.11 * side, 0.9, 0), (0.18 * side, 0.1, 0), 0.09),
                  capsule((0.18 * side, 0.06, 0), (0.2 * side, 0.06, 0.15), 0.07)]
    leg = lambda side: lambda p: smooth(p[:, 0] * side / 0.06 + 0.5) * smooth((0.95 - p[:, 1]) / 0.2)
    slide = lambda side: within(leg(side), joint(np.array([0.11 * side, 0.9, 0]), (0, 0, 1), 14 * side, (0, -1, 0), 0.2))
    above = lambda p: smooth((p[:, 1] - 0.98) / 0.1)
    arm = lambda side, degrees: within(above, joint(np.array([0.2 * side, 1.38, 0]), (0, 0, 1), degrees * side, (side, 0, 0), 0.15))
    poses = {"wave": arm(1, 70), "arms down": then(arm(1, -45), arm(-1, -45)), "bow": bend("y", "z", 50, 0.95, 0.4),
             "feet slide": then(slide(1), slide(-1)),
             "turn": twist("y", 50, 0.9, 0.6), "squash": squash("y", 0.8)}
    return union(*parts), ((-0.9, -0.06, -0.3), (0.9, 1.9, 0.35)), poses, lambda p: p[:, 1] < 0.06


def hand():
    parts = [capsule((-0.05, 0.1, 0), (0.05, 0.1, 0), 0.1, (1, 1, 2)), capsule((0, -0.1, 0), (0, 0, 0), 0.07, (1, 1, 1.4)),
             capsule((0.1, 0.05, 0), (0.2, 0.14, 0.02), 0.03)]
    places = [-0.105, -0.035, 0.035, 0.1]
    lengths = [0.14, 0.18, 0.19, 0.17]
    parts += [capsule((x, 0.16, 0), (1.15 * x, 0.16 + length, 0), 0.026) for x, length in zip(places, lengths)]
    column = lambda x: lambda p: smooth(1.5 - np.abs(p[:, 0] - x * (1 + 0.5 * np.clip(p[:, 1] - 0.16, 0, 1))) / 0.034) * smooth((p[:, 1] - 0.16) / 0.05)
    curl = lambda x, degrees: within(column(x), bend("y", "z", degrees, 0.19, 0.16))
    poses = {"point": then(*(curl(x, 100) for x in places[:3])), "fist": then(*(curl(x, 110) for x in places)),
             "spread": lambda p: p + smooth((p[:, 1] - 0.15) / 0.2)[:, None] * p * (0.35, 0, 0),
             "thumb": joint(np.array([0.1, 0.05, 0]), (0, 1, 0), -50, (1, 0.8, 0), 0.06),
             "cup": lambda p: p + (2.5 * p[:, 0] ** 2 * smooth((p[:, 1] + 0.02) / 0.1))[:, None] * (0, 0, 1)}
    return union(*parts, blend=0.01), ((-0.2, -0.2, -0.12), (0.26, 0.42, 0.12)), poses, lambda p: p[:, 1] < -0.1


def bird():
    parts = [capsule((0, 0, -0.25), (0, 0, 0.2), 0.11), capsule((0, 0.05, 0.28), (0, 0.08, 0.36), 0.07),
             capsule((0, 0.02, -0.55), (0, 0.02, -0.3), 0.1, (1, 3, 1))]
    parts += [capsule((0.1 * s, 0.03, 0), (0.75 * s, 0.03, -0.06), 0.13, (1, 4, 1)) for s in (1, -1)]
    beat = lambda degrees: then(*(bend_side(s, degrees) for s in (1, -1)))
    bend_side = lambda s, degrees: lambda p: np.where((p[:, 0] * s > 0)[:, None], mirror(bend("x", "y", degrees, 0.12, 0.5)(mirror(p, s)), s), p)
    mirror = lambda p, s: p * (s, 1, 1)
    poses = {"up": beat(60), "down": beat(-45), "bank": twist("z", 40, -0.3, 0.6), "tail": bend("z", "y", 25, -0.3, 0.5),
             "fold": lambda p: p + np.abs(p[:, 0])[:, None] ** 2 * (0, 0, -0.6)}
    return union(*parts), ((-0.95, -0.2, -0.72), (0.95, 0.25, 0.5)), poses, None


def fish():
    parts = [capsule((-0.3, 0, 0), (0.25, 0, 0), 0.18, (1, 1, 1.8)), capsule((-0.62, 0.12, 0), (-0.45, 0, 0), 0.07, (1, 1, 2)),
             capsule((-0.62, -0.12, 0), (-0.45, 0, 0), 0.07, (1, 1, 2)),
             capsule((-0.1, 0.2, 0), (0.1, 0.17, 0), 0.08, (1, 1, 2.5))]
    wave = lambda amount, phase: lambda p: p + (amount * np.sin(5 * p[:, 0] + phase) * smooth((0.3 - p[:, 0]) / 0.8))[:, None] * (0, 0, 1)
    poses = {"left": bend("x", "z", 60, -0.5, 0.8), "right": bend("x", "z", -60, -0.5, 0.8), "s": wave(0.12, 0),
             "s back": wave(-0.12, 0), "puff": lambda p: p * (1 + 0.3 * np.exp(-((p / 0.3) ** 2).sum(1)))[:, None],
             "roll": twist("x", 50, -0.5, 0.8)}
    return union(*parts), ((-0.78, -0.32, -0.2), (0.52, 0.32, 0.2)), poses, None


def face():
    head = union(capsule((0, 0.02, 0), (0, 0.06, 0), 0.11), capsule((0, -0.06, 0.03), (0, -0.05, 0.04), 0.075),
                 capsule((0, 0.02, 0.115), (0, -0.01, 0.13), 0.016), capsule((0, -0.2, -0.03), (0, -0.1, -0.02), 0.055), blend=0.012)
    solid = without(head, box((-0.04, -0.052, 0.06), (0.04, -0.046, 0.2)))
    jaw = lambda p: smooth((-0.047 - p[:, 1]) / 0.012 + 0.5) * smooth((p[:, 2] + 0.02) / 0.06) * smooth((p[:, 1] + 0.16) / 0.05)
    poses = {"jaw open": within(jaw, lambda p: turned(p, (1, 0, 0), np.full(len(p), np.radians(16)), np.array([0, 0, 0]))),
             "jaw left": within(jaw, lambda p: p + (0.01, 0, 0))}
    places = {"brow": (0.035, 0.085, 0.1), "lid": (0.04, 0.055, 0.1), "cheek": (0.055, 0, 0.085), "nostril": (0.018, -0.012, 0.125),
              "corner": (0.035, -0.047, 0.1), "upper lip": (0.012, -0.035, 0.115),
              "lower lip": (0.012, -0.062, 0.11), "temple": (0.085, 0.06, 0.04), "jowl": (0.06, -0.06, 0.05)}
    ways = {"up": (0, 0.008, 0), "down": (0, -0.008, 0), "out": (0, 0, 0.008)}
    for (place, middle), (way, move) in [(a, b) for a in places.items() for b in ways.items()]:
        for side, name in ((1, "left"), (-1, "right")):
            if len(poses) < 52:
                poses[f"{place} {way} {name}"] = bump(np.array(middle) * (side, 1, 1), 0.022, move)
    return solid, ((-0.15, -0.28, -0.15), (0.15, 0.2, 0.18)), poses, lambda p: p[:, 1] < -0.2


def tree():
    parts = [capsule((0, 0, 0), (0, 1, 0), 0.1), capsule((0, 0.9, 0), (0.45, 1.5, 0), 0.07),
             capsule((0, 0.9, 0), (-0.4, 1.45, 0.2), 0.07), capsule((0, 1, 0), (0.05, 1.7, -0.25), 0.06),
             capsule((0.45, 1.5, 0), (0.45, 1.5, 0.01), 0.22), capsule((-0.4, 1.45, 0.2), (-0.4, 1.45, 0.21), 0.2),
             capsule((0.05, 1.7, -0.25), (0.05, 1.7, -0.24), 0.2)]
    poses = {"sway": bend("y", "x", 35, 0.1, 1.2), "storm": bend("y", "x", -60, 0.1, 1.2), "twist": twist("y", 60, 0, 1.2),
             "droop": lambda p: p + (np.hypot(p[:, 0], p[:, 2]) ** 2 * smooth((p[:, 1] - 0.9) / 0.3))[:, None] * (0, -0.8, 0)}
    return union(*parts), ((-0.72, -0.14, -0.55), (0.75, 2, 0.5)), poses, lambda p: p[:, 1] < 0.02


def letters():
    bars = [box((0, 0, 0), (0.12, 0.6, 0.15)), box((0, 0, 0), (0.4, 0.12, 0.15)), box((0, 0.24, 0), (0.35, 0.36, 0.15)),
            box((0, 0.48, 0), (0.4, 0.6, 0.15))]  # E
    bars += [box((0.35, 0, 0), (0.95, 0.06, 0.15)), box((0.55, 0, 0), (0.67, 0.6, 0.15)), box((0.83, 0, 0), (0.95, 0.6, 0.15)),
             box((0.55, 0.44, 0), (0.95, 0.56, 0.15))]  # on a foot, n
    poses = {"italic": lambda p: p + p[:, 1:2] * (0.4, 0, 0),
             "arch": lambda p: p + ((0.22 - (p[:, 0] - 0.47) ** 2) * smooth(p[:, 1] / 0.3))[:, None] * (0, 0.5, 0),
             "lean": bend("y", "z", 40, 0, 0.6),
             "squash": squash("y", 0.7), "wind": lambda p: p + (0.12 * np.sin(7 * p[:, 0]) * p[:, 1] / 0.6)[:, None] * (0, 0, 1)}
    return union(*bars, blend=0.008), ((-0.05, -0.05, -0.05), (1, 0.65, 0.2)), poses, lambda p: p[:, 1] < 0.02


def sheet():
    poses = {"roll": bend("x", "y", 150, -0.4, 0.9),
             "wave": lambda p: p + (0.1 * np.sin(8 * (p[:, 0] + 0.5)) * smooth((p[:, 0] + 0.5) / 0.3))[:, None] * (0, 1, 0),
             "twist": twist("x", 80, -0.5, 1), "fold": bend("x", "y", 110, -0.1, 0.25)}
    return box((-0.5, -0.02, -0.4), (0.5, 0.02, 0.4)), ((-0.55, -0.06, -0.45), (0.55, 0.06, 0.45)), poses, lambda p: p[:, 0] < -0.47


def ring():
    oval = lambda a: lambda p: p * (1 + a, 1, 1 / (1 + a))
    poses = {"oval": oval(0.35), "across": oval(-0.25),
             "saddle": lambda p: p + ((p[:, 0] ** 2 - p[:, 2] ** 2) / 0.5)[:, None] * (0, 0.5, 0),
             "figure of eight": twist("x", 100, -0.5, 1), "fold": bend("x", "y", 100, -0.3, 0.6)}
    return torus(0.42, 0.11), ((-0.56, -0.14, -0.56), (0.56, 0.14, 0.56)), poses, None


def machine():
    parts = [box((-0.4, 0, -0.25), (0.4, 0.3, 0.25)), capsule((0.2, 0.3, 0), (0.2, 0.75, 0), 0.1),
             capsule((-0.2, 0.28, 0), (-0.2, 0.5, 0), 0.14), box((-0.5, 0, -0.08), (0.5, 0.08, 0.08)),
             capsule((-0.05, 0.45, 0), (0.2, 0.62, 0), 0.05)]
    poses = {"stamp": lambda p: p + smooth((p[:, 1] - 0.3) / 0.2)[:, None] * smooth(p[:, 0] / 0.1)[:, None] * (0, -0.15, 0),
             "lean": bend("y", "x", 30, 0.1, 0.5), "shake": twist("y", 35, 0.05, 0.5),
             "swell": lambda p: p + np.exp(-(((p - (-0.2, 0.35, 0)) / 0.25) ** 2).sum(1))[:, None] * (p - (-0.2, 0.25, 0)) * 0.5,
             "crush": squash("y", 0.7)}
    return union(*parts, blend=0.015), ((-0.56, -0.05, -0.32), (0.56, 0.92, 0.32)), poses, lambda p: p[:, 1] < 0.02


BODIES = {make.__name__: make for make in (figure, hand, bird, fish, face, tree, letters, sheet, ring, machine)}


def write_surface(name, path):
    sys.path.insert(0, str(ROOT / "build" / "release" / "python"))
    import exmat.precompute  # what is built
    solid, (low, high), poses, fixed = BODIES[name]()
    points, triangles = contour(solid, low, high, GRID)
    marks = {} if fixed is None else {"_FIXED": fixed(points)}
    exmat.precompute.write_glb(path, points, triangles, {pose: move(points) for pose, move in poses.items()}, marks)
    return len(triangles), len(poses), fixed is not None


def errors_of(bundle):
    """Of each pose its error settled, over its displacement."""
    with h5py.File(bundle) as file:
        examples = {name: group.attrs for name, group in file["examples"].items() if isinstance(group, h5py.Group)}
        return {name: float(example["settled_error"]) for name, example in examples.items() if not example["is_rest"]}


def bundle(folder, programs, source, way, scene=None):
    """Errors, or why there are none."""
    command = [programs / "exmat-precompute", "bundle", source, "-o", f"{way}.h5"]
    if not source.endswith(".json"):
        command += ["--write-asset", "assumed.json"]
    if scene is not None:
        (folder / "scene.json").write_text(json.dumps({"bundle": f"{way}.h5", **scene}))
        command += ["--scene", "scene.json"]
    start = time.time()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    (folder / f"{way}.log").write_text(done.stdout + done.stderr)
    found = errors_of(folder / f"{way}.h5") if done.returncode == 0 else done.stderr.strip().splitlines()[-1]
    print(folder.name, way, f"{time.time() - start:.0f} s", found if done.returncode else
          f"mean {100 * np.mean(list(found.values())):.2g} %, worst {100 * max(found.values()):.2g} %", flush=True)
    return found


def measure(name, programs, output):
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    surface = f"{name}.glb"
    triangles, poses, clamped = write_surface(name, folder / surface)
    row = {"triangles": triangles, "poses": poses}
    row["alone"] = bundle(folder, programs, surface, "alone")
    if clamped:
        row["gravity"] = bundle(folder, programs, surface, "gravity", SCENE)
    row["follows"] = json.loads((folder / "assumed.json").read_text())["object"].get("fixed", {}).get("follow", False)
    (output / f"{name}.json").write_text(json.dumps(row))
    return row


WAYS = ("alone", "gravity")


def cells_of(errors):
    if not isinstance(errors, dict):
        return ["" if errors is None else "refused", ""]
    worst = max(errors, key=errors.get)
    return [f"{100 * np.mean(list(errors.values())):.2g} %", f"{100 * errors[worst]:.2g} % ({worst})"]


def page(found):
    wrap = lambda text: textwrap.wrap(text, 120, break_on_hyphens=False)
    errors = {way: [error for row in found.values() if isinstance(row.get(way), dict) for error in row[way].values()] for way in WAYS}
    share = lambda errors, limit: f"{sum(error < limit for error in errors)} of {len(errors)}"
    return "\n".join([
        "# The pose that was posed", "",
        *wrap("Written by `examples/tools/artists_bed.py --write`: ten surfaces that the script makes, with the poses that artists give such "
              "things, as morph targets of a `.glb`. Each becomes a bundle as it is, with all defaults. Where poses move what is clamped, as feet "
              "that slide, the clamp follows. Clamped bodies have another bundle with a scene under gravity whose targets make up for it "
              "(`compensate`, kappa 4000, which does not hold all that is crushed or folded: by 40,000 the fist is 0.5 % off). The error is "
              "that of the body settled under one example alone, over the pose's displacement, of all causes together."), "",
        *wrap(f"Without gravity {share(errors['alone'], 0.02)} poses settle within 2 % of their displacement and "
              f"{share(errors['alone'], 0.05)} within 5 %; under gravity {share(errors['gravity'], 0.02)} and {share(errors['gravity'], 0.05)}."), "",
        "| surface | triangles | poses | clamp | without gravity, mean | worst | with gravity, mean | worst |",
        "| --- | ---: | ---: | --- | ---: | --- | ---: | --- |",
        *(f"| {name} | {row['triangles']} | {row['poses']} | {'follows' if row['follows'] else 'stands' if 'gravity' in row else ''} | "
          f"{' | '.join(cell for way in WAYS for cell in cells_of(row.get(way)))} |" for name, row in found.items())]) + "\n"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bodies", nargs="*", metavar="BODY")
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build" / "release" / "bin")
    parser.add_argument("--output", type=pathlib.Path, default=ROOT / "build" / "artists_bed")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    rows = {name: measure(name, given.programs.resolve(), given.output) for name in given.bodies or BODIES}
    if given.write:
        rows = {name: rows.get(name) or json.loads((given.output / f"{name}.json").read_text()) for name in BODIES}
    print(page(rows))
    if given.write:
        PAGE.write_text(page(rows))


if __name__ == "__main__":
    main()
