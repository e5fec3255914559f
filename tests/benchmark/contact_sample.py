#!/usr/bin/python3
"""What a sample of the surface changes of a landing, as a table: bodies fall five times onto a plane, with all vertices and with samples.

Usage: contact_sample.py FOLDER_OF_PROGRAMS CROSS.msh [--page PAGE.md]    renews the page's table
"""
import itertools
import json
import math
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

PROGRAMS, CROSS = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
PAGE = Path(sys.argv[sys.argv.index("--page") + 1]) if "--page" in sys.argv else None
BEGIN, END = "<!-- sample: begin -->\n\n", "\n<!-- sample: end -->"
STEP, SECONDS = 0.001, 4
FALLS = [(1.3, [1, 0, 0], 0.25), (1.6, [1, 2, 0.3], 0.8), (1.6, [0, 1, 0], 1.4), (1.6, [2, 1, 0], 1.9), (1.4, [1, 1, 1], 2.5)]
# name, vertices taken (more than there are: all), time step
RUNS = [("all", 10**6, STEP), ("all, half the time step", 10**6, STEP / 2), ("1,000", None, STEP), ("300", 300, STEP)]


def cells_of(inside, counts, size):
    """The cells of a grid that are inside, six tets each, as a .veg file: a staircase."""
    number, tets = {}, []
    for origin in itertools.product(*map(range, counts)):
        if not inside((np.array(origin) + 0.5) * size - np.array(counts) * size / 2):
            continue
        for order in itertools.permutations(range(3)):
            place, path = list(origin), [number.setdefault(origin, len(number))]
            for axis in order:
                place[axis] += 1
                path.append(number.setdefault(tuple(place), len(number)))
            tets.append([path[1], path[0], *path[2:]] if order in ((0, 2, 1), (1, 0, 2), (2, 1, 0)) else path)
    lines = ["*VERTICES", f"{len(number)} 3 0 0"] + [f"{k + 1} " + " ".join(f"{size * x:.9g}" for x in place) for place, k in number.items()]
    lines += ["*ELEMENTS", "TET", f"{len(tets)} 4 0"] + [f"{k} " + " ".join(str(v + 1) for v in tet) for k, tet in enumerate(tets, 1)]
    return "\n".join(lines) + "\n"


def letter(x):
    return 0.55 < math.hypot(x[0], x[1]) < 1 and abs(x[2]) < 0.2 and not (x[0] > 0 and abs(x[1]) < 0.45)


BODIES = {
    "letter C, a staircase": (lambda: cells_of(letter, (28, 28, 6), 1 / 14), 1),
    "bar 4 x 1 x 0.6": (lambda: cells_of(lambda _: True, (40, 10, 6), 0.1), 1.2),
    "cross of `06_cross`": (CROSS.read_text, 2.2),
}


def program(name, *arguments):
    result = subprocess.run([PROGRAMS / name, *arguments], capture_output=True, text=True)
    if result.returncode:
        sys.exit(result.stderr)
    return result.stdout


def bundle_of(folder, mesh, count):
    material = {"model": "stvk", "youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000}
    asset = {"name": "body", "object": {"mesh": mesh.name, "material": material}, "basis": {"size": 20, "linear_modes": 20}, "cubature": {"elements": 60}}
    if count:
        asset["contact"] = {"count": count}
    (folder / "asset.json").write_text(json.dumps(asset))
    bundle = folder / f"{count}.h5"
    if not bundle.exists():
        program("exmat-precompute", "bundle", folder / "asset.json", "-o", bundle)
    return bundle


def fall(folder, bundle, step, lift, start):
    """Vertices at rest, of how many the sample is, and the median time of a step [us]."""
    height, axis, angle = start
    turn = math.sin(angle / 2) * np.array(axis) / np.linalg.norm(axis)
    scene = {
        "bundle": bundle.name, "time_step": step, "steps": round(SECONDS / step), "gravity": [0, 0, -9.81], "damping": {"stiffness": 0.005},
        "body": {"position": [0, 0, lift * height], "orientation": [math.cos(angle / 2), *turn]},
        "obstacles": [{"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "stiffness": 1e7, "damping": 2e4, "friction": 0.5}],
        "output": {"trajectory": "run.h5", "every": round(SECONDS / step)},
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    summary = program("exmat-runtime", "run", folder / "scene.json")
    with h5py.File(folder / "run.h5") as run:
        return run["vertices"][-1], float(re.search(r"median step time +([\d.]+) us", summary)[1])


def difference(truth, found):
    """Height of the centre over the size, and the angles from the vertical and about it: how `found` lies beside `truth`."""
    a, b = truth - truth.mean(axis=0), found - found.mean(axis=0)
    u, _, v = np.linalg.svd(b.T @ a)
    rotation = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    height = (found.mean(axis=0) - truth.mean(axis=0))[2] / np.linalg.norm(np.ptp(truth, axis=0))
    return abs(height), math.acos(np.clip(rotation[2, 2], -1, 1)), abs(math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1]))


def rows(folder, name, mesh_text, lift):
    mesh = folder / ("object.msh" if mesh_text.startswith("$") else "object.veg")
    mesh.write_text(mesh_text)
    truth, lines = [], []
    for label, count, step in RUNS:
        bundle = bundle_of(folder, mesh, count)
        with h5py.File(bundle) as file:
            taken = len(file["contact/vertices"])
        fell = [fall(folder, bundle, step, lift, start) for start in FALLS]
        truth = truth or [vertices for vertices, _ in fell]
        apart = [difference(*pair) for pair in zip(truth, (vertices for vertices, _ in fell))]
        near = [one for one in apart if one[1] < 0.02]
        cells = ["", "", "", ""]
        if label != "all":
            cells = [f"{100 * max(one[0] for one in near):.2g}", f"{max(one[1] for one in near):.1g}", f"{statistics.median(one[2] for one in near):.2g}", str(len(apart) - len(near))]
        lines.append(f"| {name} | {label} ({taken}) | " + " | ".join(cells) + f" | {statistics.median(time for _, time in fell):.0f} |")
        print(lines[-1], flush=True)
    return lines


def main():
    lines = ["| body | vertices | centre, most [% of the size] | tilt, most [rad] | turn about the vertical, median [rad] | lies on another side | step [us] |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for name, (mesh_text, lift) in BODIES.items():
        with tempfile.TemporaryDirectory() as folder:
            lines += rows(Path(folder), name, mesh_text(), lift)
    if PAGE:
        page = PAGE.read_text()
        PAGE.write_text(page[: page.index(BEGIN) + len(BEGIN)] + "\n".join(lines) + page[page.index(END):])


main()
