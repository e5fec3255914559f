#!/usr/bin/python3
"""Measure error against run time: bodies in their modes and in all vertices, under loads that the basis knows and under hands that it does not.

Usage: error_and_time.py [--write] [--programs build/release/bin] [--seeds 3] [BODY ...]
       (bar, car, cross, teddy; all, and the sizes, where none is named; Debian: python3-h5py, python3-matplotlib)

Each body has bundles of r = 20, 30 and 60 modes that learned from its scene. It is run for a second under the scene's loads, and under hands, of
which each pushes a random patch of the surface; the truth are the same loads in all vertices, in steps of 1 ms, each solved to 1e-8. --write also
renews docs/studies/error_and_time.md and its chart. Half an hour.
"""
import itertools
import json
import re
import subprocess
import sys
import textwrap
import time

import numpy as np

import hands
from other_loads import ROOT, asset_without_inversion, error, frames_of, mesh_of, parser_of, run

BODIES = dict(sorted({**hands.BODIES, "car": ("03_car_wall", 0, {})}.items()))  # the car is free: no hand pushes it
SECONDS = 1.0
REFERENCE, FRAME = 0.001, 0.008  # [s]
MODES = [20, 30, 60]
WAYS = [*(("reduced", modes, 0.004) for modes in MODES), ("reduced", 30, 0.001), *(("full", 30, step) for step in (0.001, 0.004, 0.008))]
SIZES = [300, 600, 1500, 5000, 50000]  # vertices
CROWDS = [1, 100, 10000]  # bodies


def times(step):
    return {"time_step": step, "steps": round(SECONDS / step)}


def frames(step, trajectory):
    return {"output": {"trajectory": trajectory, "every": round(FRAME / step)}}


def measure(body, programs, output, seeds):
    """For each kind of load and way to step: mean error of each run over its mean displacement, and microseconds of a step."""
    name, most, clamp = BODIES[body]
    variant = "arc_recommended" if body == "car" else "recommended"
    folder = output / body
    folder.mkdir(parents=True, exist_ok=True)
    write = lambda path, content: (folder / path).write_text(json.dumps(content, indent=1) + "\n") and folder / path
    source = ROOT / "examples" / name
    scene = json.loads((source / f"scene_{variant}.json").read_text())
    scene |= {"integrator": "bdf2"}
    for modes in MODES:
        asset = asset_without_inversion(source, variant)
        asset["object"] |= clamp
        asset |= {"basis": {"size": modes, "training": "scene"}}
        learned = write("learned.json", scene | times(0.004) | {"bundle": f"{modes}.h5", "space": "auto", "output": {"trajectory": "unused.h5"}})
        if not (folder / f"{modes}.h5").exists():
            run(folder, programs / "exmat-precompute", "bundle", write(f"asset_{modes}.json", asset), "-o", f"{modes}.h5", "--cache", "cache",
                "--scene", learned)
    mesh = mesh_of(folder / "30.h5")
    loads = {"known": [scene]}
    if mesh["fixed"].any():
        loads["hands"] = [scene | {"forces": [hands.hand(seed, mesh, most)]} for seed in range(seeds)]
    found, inverted = {}, 0
    for load, scenes in loads.items():
        for number, loaded in enumerate(scenes):
            truth = folder / f"{load}_{number}.h5"
            if not truth.exists():
                full = write("full.json", loaded | times(REFERENCE) | {"bundle": "30.h5"} | frames(REFERENCE, truth.name))
                run(folder, programs / "exmat-precompute", "full-space", full, "-o", truth)
            expected = frames_of(truth)[1:]
            corners = expected[:, mesh["tets"]]
            inverted = max(inverted, int((np.linalg.det(corners[:, :, 1:] - corners[:, :, :1]) < 0).sum(axis=1).max()))
            for space, modes, step in WAYS:
                own = write("run.json", loaded | times(step) | {"bundle": f"{modes}.h5", "space": space} | frames(step, "run.h5"))
                done = subprocess.run([programs / "exmat-runtime", "run", own], check=True, cwd=folder, capture_output=True, text=True)
                took = float(re.search(r"median step time +([0-9.]+)", done.stdout).group(1))
                found.setdefault((load, space, modes, step), []).append((error(frames_of(folder / "run.h5")[1:], expected, mesh), took))
        print(body, load, *(f"{space} {modes} {1000 * step:g} ms {100 * np.mean([e for e, _ in rows]):.2g} %"
                            for (kind, space, modes, step), rows in found.items() if kind == load), flush=True)
    return {"vertices": len(mesh["vertices"]), "inverted": inverted, "found": {key: np.array(rows) for key, rows in found.items()}}


def block(vertices):
    """A clamped bar of about so many vertices, four times as long as it is wide."""
    across = max(1, round((vertices / 4) ** (1 / 3)) - 1)
    cells = (4 * across, across, across)
    number = lambda x, y, z: (x * (across + 1) + y) * (across + 1) + z
    tets = []
    for cell in itertools.product(*map(range, cells)):
        for order in itertools.permutations(range(3)):
            place, path = list(cell), [number(*cell)]
            for axis in order:
                place[axis] += 1
                path.append(number(*place))
            tets.append(path if np.linalg.det(np.eye(3)[list(order)]) > 0 else [path[0], path[2], path[1], path[3]])
    points = np.array(list(itertools.product(*(range(count + 1) for count in cells)))) / across
    return points, np.array(tets)


def sizes(build, output):
    """Microseconds of a step and body, reduced and full, by the number of vertices, and of reduced bodies in crowds."""
    sys.path.insert(0, str(build / "python"))
    import exmat
    rows = []
    for vertices in SIZES:
        points, tets = block(vertices)
        bundle = output / f"block_{vertices}.h5"
        if not bundle.exists():
            exmat.precompute.bundle({
                "name": "block", "object": {"mesh": (points, tets), "fixed": {"box": {"min": [-1e-6, -9, -9], "max": [1e-6, 9, 9]}},
                                            "material": {"youngs_modulus": 1e5, "poisson_ratio": 0.4, "density": 1000}},
                "basis": {"size": 30, "linear_modes": 30, "training": "none"}, "internal_force": "cubature", "cubature": {"elements": 60},
                "needs": ["full_space"]}, bundle)
        row = {"vertices": len(points)}
        for space in ("reduced", "full"):
            model = exmat.Model(bundle, time_step=0.004, gravity=(0, 0, -3), stiffness_damping=0.01, space=space)
            body = exmat.Body(model)
            body.step(20)
            taken = []
            for _ in range(60 if len(points) < 2000 else 20):
                start = time.perf_counter()
                body.step()
                taken.append(time.perf_counter() - start)
            row[space] = 1e6 * np.median(taken)
            if space == "reduced" and vertices == 600:
                for count in CROWDS[1:]:
                    crowd = exmat.Batch(model, count)
                    crowd.step(5, threads=1)
                    start = time.perf_counter()
                    crowd.step(10, threads=1)
                    row[count] = 1e6 * (time.perf_counter() - start) / 10 / count
        print(row, flush=True)
        rows.append(row)
    return rows


def chart(results, path):
    import matplotlib
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "exmat"
    from matplotlib import pyplot
    figure, panels = pyplot.subplots(1, 2, figsize=(9.6, 4), sharey=True, layout="constrained")
    colors = dict(zip(results, ["#0072b2", "#d55e00", "#009e73", "#cc79a7"]))
    for panel, load in zip(panels, ("known", "hands")):
        for body, result in results.items():
            for space, marker, line in (("reduced", "o", "-"), ("full", "s", "--")):
                points = np.array([(rows[:, 1].mean() / 1000 / step, 100 * rows[:, 0].mean())
                                   for (own, its, _, step), rows in result["found"].items() if (own, its) == (load, space)])
                if len(points):
                    panel.loglog(*points.T, marker=marker, linestyle=line, color=colors[body], markersize=5, label=f"{body}, {space}")
        panel.set_title({"known": "loads that the basis learned from", "hands": "hands that it does not know"}[load])
        panel.set_xlabel("milliseconds a second of motion")
        panel.grid(True, which="major", color="#dddddd")
    panels[0].set_ylabel("mean error [%]")
    panels[0].legend(fontsize=7, ncols=2)
    figure.savefig(path, metadata={"Date": None})


def page(results, rows, seeds):
    wrap = lambda text: textwrap.wrap(text, 120, break_on_hyphens=False)
    lines = ["# Error against run time", "",
             *wrap(f"Written by `examples/tools/error_and_time.py --write`: bodies of the examples for {SECONDS:g} s, in r modes that learned "
                   f"from the scene, and in all vertices; under the scene's own loads, and under {seeds} hands each that push a random patch "
                   "of the surface. The truth are the same loads in all vertices in steps of 1 ms, each solved to 1e-8. Errors are of "
                   "positions, in the mass, mean over a run, over the mean displacement; of the free car of its shape. Times are medians of "
                   "one thread on a machine that others used, too."), "",
             "![error against run time](error_and_time.svg)", "",
             *wrap("What to take: **modes** where loads are known when the bundle is made (`--scene`), for crowds, and for meshes of many "
                   "vertices; **all vertices** where a hand, a host or another body takes hold: there no number of modes is enough. Space "
                   "`auto` changes from the one to the other by itself. What hits a wall (the car) or snaps (the cross) asks for short steps "
                   "first, whatever its space: compare the rows of 1 and 4 ms."), "",
             "| body | vertices | loads | space | modes | step [ms] | mean error | a step [us] | a second of motion [ms] |",
             "| --- | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: |"]
    for body, result in results.items():
        for (load, space, modes, step), runs in result["found"].items():
            errors, took = runs[:, 0].mean(), runs[:, 1].mean()
            lines.append(f"| {body} | {result['vertices']} | {load} | `{space}` | {modes if space == 'reduced' else ''} | {1000 * step:g} | "
                         f"{100 * errors:.2g} % | {took:.3g} | {took / 1000 / step:.3g} |")
    for body, result in results.items():
        if result["inverted"]:
            lines += ["", f"The truth of the {body} has up to {result['inverted']} tets that are inverted for moments: it is a rough one."]
    if rows:
        lines += ["", "## What the reduction buys", "",
                  "A clamped bar that swings by its weight, r = 30, steps of 4 ms. The modes do not see how many vertices there are.", "",
                  "| vertices | in 30 modes [us] | in all vertices [us] | times |", "| ---: | ---: | ---: | ---: |"]
        lines += [f"| {row['vertices']} | {row['reduced']:.3g} | {row['full']:.3g} | {row['full'] / row['reduced']:.2g} |" for row in rows]
        crowd = next(row for row in rows if 100 in row)
        lines += ["", f"Of {crowd['vertices']} vertices, one thread: in a crowd eight bodies of one model step side by side.", "",
                  "| bodies | microseconds a body and step |", "| ---: | ---: |", f"| 1 | {crowd['reduced']:.3g} |"]
        lines += [f"| {count:,} | {crowd[count]:.3g} |" for count in CROWDS[1:]]
    return "\n".join(lines) + "\n"


def main():
    parser = parser_of(__doc__, BODIES)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    output = ROOT / "build/error_and_time"
    output.mkdir(parents=True, exist_ok=True)
    programs = options.programs.resolve()
    results = {body: measure(body, programs, output, options.seeds) for body in options.bodies or BODIES}
    rows = [] if options.bodies else sizes(programs.parent, output)
    print(page(results, rows, options.seeds))
    if options.write and not options.bodies:
        (ROOT / "docs/studies/error_and_time.md").write_text(page(results, rows, options.seeds))
        chart(results, ROOT / "docs/studies/error_and_time.svg")


if __name__ == "__main__":
    main()
