#!/usr/bin/python3
"""Measure how right bodies are under hands that no training has seen, in their three spaces, against the full space.

Usage: hands.py [--write] [--programs build/release/bin] [--seeds 12] [BODY ...]    (bar, teddy, cross; all where none is named; Debian: python3-h5py)

Each hand pushes a random patch of the half of the surface that is farthest from the clamp, in a random direction, from 0.02 to 0.5 s of one
second, in steps of 4 ms, with the scene's examples acting. The bundle learned from loads of all kinds. --write also renews
docs/studies/hands.md. Fifteen minutes.
"""
import json
import re
import subprocess

import numpy as np

from other_loads import ROOT, asset_without_inversion, frames_of, mesh_of, parser_of, run

FOOT = {"box": {"min": [-1, -1, -2.21], "max": [1, 1, -2.19]}}
BODIES = {  # push over the weight, at most; a clamp where the example has none
    "bar": ("04_bar_cuboid", 0.3, {}),
    "teddy": ("07_teddy_global", 1, {}),
    "cross": ("06_cross", 0.1, {"fixed": FOOT}),
}
SPACES = ["reduced", "auto", "full"]
PATCH = 6  # vertices
TIMES = {"time_step": 0.004, "steps": 250}


def hand(seed, mesh, most):
    random = np.random.default_rng(seed)
    points, fixed = mesh["vertices"], mesh["fixed"].astype(bool)
    surface = np.unique(mesh["surface"])
    surface = surface[~fixed[surface]]
    distance = np.linalg.norm(points[surface] - points[fixed].mean(0), axis=1)
    taken = random.choice(surface[np.argsort(-distance)][:len(surface) // 2])
    patch = surface[np.argsort(np.linalg.norm(points[surface] - points[taken], axis=1))[:PATCH]]
    direction = random.normal(size=3)
    force = direction / np.linalg.norm(direction) * 9.81 * mesh["mass"] * most * random.uniform(0.4, 1) / PATCH
    return {"vertices": {"ids": patch.tolist()}, "force": force.tolist(), "start": 0.02, "end": 0.5}


def measure(body, programs, output, seeds):
    """Of each space: mean and largest error of each run over the largest displacement, and microseconds of a step; and the displacements."""
    name, most, clamp = BODIES[body]
    source, folder = ROOT / "examples" / name, output / body
    folder.mkdir(parents=True, exist_ok=True)
    write = lambda path, content: (folder / path).write_text(json.dumps(content, indent=1) + "\n") and folder / path
    asset = asset_without_inversion(source)
    asset["object"] |= clamp
    run(folder, programs / "exmat-precompute", "bundle", write("asset.json", asset | {"internal_force": "cubature"}), "-o", "body.h5")
    mesh = mesh_of(folder / "body.h5")
    diagonal = np.linalg.norm(np.ptp(mesh["vertices"], axis=0))
    scene = json.loads((source / "scene_recommended.json").read_text()) | TIMES | {"bundle": "body.h5"}
    norm = lambda u: np.sqrt((mesh["vertex_mass"][:, None] * u**2).sum(axis=(1, 2)))
    found, moved = {space: [] for space in SPACES}, []
    for seed in range(seeds):
        pushed = scene | {"forces": [hand(seed, mesh, most)], "output": {"trajectory": "run.h5", "every": 1}}
        run(folder, programs / "exmat-precompute", "full-space", write("full.json", pushed), "-o", "full.h5")
        expected = frames_of(folder / "full.h5")
        moved.append(np.linalg.norm(expected - mesh["vertices"], axis=2).max() / diagonal)
        for space in SPACES:
            done = subprocess.run([programs / "exmat-runtime", "run", write("run.json", pushed | {"space": space})], check=True, cwd=folder,
                                  capture_output=True, text=True)
            error = norm(frames_of(folder / "run.h5") - expected) / norm(expected - mesh["vertices"]).max()
            found[space].append((error.mean(), error.max(), float(re.search(r"median step time +([0-9.]+)", done.stdout).group(1))))
        print(body, seed, *(f"{space} {100 * found[space][-1][0]:.2g} %" for space in SPACES), flush=True)
    return {space: np.array(rows) for space, rows in found.items()}, np.array(moved)


def page(results, seeds):
    lines = ["# Hands that training has not seen", "",
             "Written by `examples/tools/hands.py --write`: bodies of the examples with smoothed elements, stable neo-Hookean, r = 30",
             f"modes trained without a scene, pushed by {seeds} random hands each, in steps of 4 ms, beside `exmat-precompute full-space` in",
             "the same steps. Errors are of positions, in the mass, over the largest displacement of a run: the mean over a run, the",
             "mean and the worst of all runs, and the worst moment of any. Times are medians of one thread, in turns, on a machine",
             "that others used, too.", "",
             "| body | displacement over the size | space | mean | worst run | worst moment | a step [us] |", "| --- | --- | --- | ---: | ---: | ---: | ---: |"]
    for body, (found, moved) in results.items():
        for space, rows in found.items():
            mean, largest, times = rows.T
            lines.append(f"| {body} | {moved.min():.2f} to {moved.max():.2f} | `{space}` | {100 * mean.mean():.2g} % | {100 * mean.max():.2g} % | "
                         f"{100 * largest.max():.2g} % | {np.median(times):.0f} |")
    return "\n".join(lines + ["", "In space `auto` the body is back in its modes half a second after the hand has let go, while it still vibrates: there it",
                              "loses what the modes do. A larger `space_release` waits longer. The reference solves each step to 1e-8; `full` takes few",
                              "iterations, and its worst moments are those in which the hand begins to push or lets go."]) + "\n"


def main():
    parser = parser_of(__doc__, BODIES)
    parser.add_argument("--seeds", type=int, default=12)
    options = parser.parse_args()
    results = {body: measure(body, options.programs.resolve(), ROOT / "build/hands", options.seeds) for body in options.bodies or BODIES}
    print(page(results, options.seeds))
    if options.write and len(results) == len(BODIES):
        (ROOT / "docs/studies/hands.md").write_text(page(results, options.seeds))


if __name__ == "__main__":
    main()
