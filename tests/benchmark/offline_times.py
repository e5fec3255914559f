#!/usr/bin/python3
"""What bundles of bars cost, as a table: seconds and memory of the whole command, seconds of the stages that grow with the mesh.

Usage: offline_times.py FOLDER_OF_PROGRAMS [--most TETS] [--training] [--page PAGE.md]    renews the page's table

With --training there are rows of bars that are trained, which take longer than all others together.
"""
import itertools
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PROGRAM = Path(sys.argv[1]).resolve() / "exmat-precompute"
MOST = int(sys.argv[sys.argv.index("--most") + 1]) if "--most" in sys.argv else 10**9
TRAINING = "--training" in sys.argv
PAGE = Path(sys.argv[sys.argv.index("--page") + 1]) if "--page" in sys.argv else None
BEGIN, END = "<!-- offline: begin -->\n\n", "\n<!-- offline: end -->"
LENGTHS = (4, 1, 0.8)
BEND = 1.2  # of the example, over the length [rad]
# cells, name, examples, training
RUNS = [
    ((48, 12, 10), "alone", 0, "none"),
    ((48, 12, 10), "an example", 1, "none"),
    ((48, 12, 10), "an example, training", 1, "auto"),
    ((84, 22, 18), "alone", 0, "none"),
    ((84, 22, 18), "an example", 1, "none"),
    ((84, 22, 18), "an example, training", 1, "auto"),
    ((147, 36, 32), "alone", 0, "none"),
    ((147, 36, 32), "an example", 1, "none"),
]
STAGES = ["shape space and examples", "factorisation", "linear modes", "modal derivatives", "poses of the examples", "targets", "training", "cubature"]


def bar(cells):
    """Vertices and tets of a bar, six a cell, upright."""
    counts = np.array(cells) + 1
    vertices = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3)
    origins = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), -1).reshape(-1, 3)
    tets = []
    for order in itertools.permutations(range(3)):
        corners = [origins]
        for axis in order:
            corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
        tet = np.stack([(c @ [counts[1] * counts[2], counts[2], 1]) for c in corners], 1)
        tets.append(tet[:, [1, 0, 2, 3]] if order in ((0, 2, 1), (1, 0, 2), (2, 1, 0)) else tet)
    return vertices * (np.array(LENGTHS) / cells), np.stack(tets, 1).reshape(-1, 4)


def bent(vertices):
    radius, height = LENGTHS[0] / BEND, vertices[:, 2] - LENGTHS[2] / 2
    angle = vertices[:, 0] / radius
    return np.stack([(radius - height) * np.sin(angle), vertices[:, 1], radius - (radius - height) * np.cos(angle) + LENGTHS[2] / 2], 1)


def write(path, vertices, tets):
    """Gmsh 2.2, binary."""
    nodes = np.zeros(len(vertices), [("tag", "<i4"), ("place", "<f8", 3)])
    nodes["tag"], nodes["place"] = np.arange(len(vertices)) + 1, vertices
    elements = np.ones((len(tets), 7), "<i4")
    elements[:, 0], elements[:, 3:] = np.arange(len(tets)) + 1, tets + 1
    head = np.array([4, len(tets), 2], "<i4")
    path.write_bytes(b"$MeshFormat\n2.2 1 8\n" + np.array([1], "<i4").tobytes() + b"\n$EndMeshFormat\n$Nodes\n%d\n" % len(vertices) + nodes.tobytes()
                     + b"\n$EndNodes\n$Elements\n%d\n" % len(tets) + head.tobytes() + elements.tobytes() + b"\n$EndElements\n")


def measure(folder, cells, examples, training):
    vertices, tets = bar(cells)
    write(folder / "bar.msh", vertices, tets)
    write(folder / "bent.msh", bent(vertices), tets)
    material = {"model": "stvk", "youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000}
    asset = {"name": "bar", "object": {"mesh": "bar.msh", "material": material, "fixed": {"box": {"min": [-1, -1, -1], "max": [0.001, 2, 2]}}},
             "shape_space": {"eigenfunctions": 20}, "basis": {"size": 30, "linear_modes": 15, "training": training},
             "cubature": {"elements": 60}, "internal_force": "cubature"}
    if examples:
        asset["examples"] = [{"name": "bend", "mesh": "bent.msh"}]
    (folder / "bar.json").write_text(json.dumps(asset))
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    result = subprocess.run([PROGRAM, "bundle", folder / "bar.json", "-o", folder / "bar.h5", "--report", folder / "report.json"], capture_output=True, text=True)
    if result.returncode:
        sys.exit(result.stderr)
    wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    stages = {stage["stage"]: stage for stage in json.loads((folder / "report.json").read_text())["stages"]}
    memory = max(stage["peak_memory_bytes"] for stage in stages.values()) / 1e9
    return len(tets), wall, cpu, memory, {name: stage["seconds"] for name, stage in stages.items()}


def main():
    lines = ["| tets | bar | seconds | of CPU | GB | " + " | ".join(STAGES) + " |", "| ---: | --- |" + " ---: |" * (3 + len(STAGES))]
    for cells, name, examples, training in RUNS:
        if 6 * np.prod(cells) > MOST or (training != "none" and not TRAINING):
            continue
        with tempfile.TemporaryDirectory() as folder:
            tets, wall, cpu, memory, stages = measure(Path(folder), cells, examples, training)
        cost = [f"{stages[stage]:.2g}" if stages.get(stage, 0) < 10 and stage in stages else f"{stages[stage]:.0f}" if stage in stages else "" for stage in STAGES]
        lines.append(f"| {tets:,} | {name} | {wall:.3g} | {cpu:.3g} | {memory:.2g} | " + " | ".join(cost) + " |")
        print(lines[-1], flush=True)
    if PAGE:
        text = PAGE.read_text()
        head, rest = text.split(BEGIN)
        load = f"{os.getloadavg()[2]:.1f}"
        PAGE.write_text(head + BEGIN + "\n".join(lines) + f"\n\nThe machine had {os.cpu_count()} processors and {load} processes that wanted them, with those of the runs.\n" + END + rest.split(END)[1])


main()
