#!/usr/bin/python3
"""Drops piles of teddies, steps them until they rest, and writes what came out into docs/performance.md.

Usage: piles.py PROGRAMS RESULTS [--page PAGE.md] [--counts 1,30,100] [--seconds 16] [--bundle TEDDY.h5]
PROGRAMS has exmat-precompute and exmat-pile-benchmark. The target `piles` of the build calls it.
"""
import argparse
import json
import math
import os
import random
import shutil
import subprocess
from pathlib import Path

ASSET = Path(__file__).parents[3] / "examples/10_pile/asset_teddy.json"
STIFFNESS, DAMPING = 5e7, 1.5e5  # [N/m^3], [N s/m^3]
TIME_STEP = 0.004  # [s]
SPACING = 2.95  # turned, they do not reach each other [m]
HASHED_AT = 1.2  # the time of the state that two threads have to reach as well: most have met by then [s]


def diagonal_of(mesh):
    """Of the bounding box of a Gmsh file [m]."""
    nodes = mesh.read_text().split("$Nodes")[1].split("$EndNodes")[0].split("\n")[2:]
    points = [[float(x) for x in line.split()[1:]] for line in nodes if line]
    return math.dist([min(axis) for axis in zip(*points)], [max(axis) for axis in zip(*points)])


def poses(count):
    """A line for each: at random turned, in layers of a square; four of them, or fewer."""
    numbers = random.Random(7)
    side = math.ceil(math.sqrt(count / 4))
    lines = []
    for i in range(count):
        layer, place = divmod(i, side * side)
        turn = [numbers.gauss(0, 1) for _ in range(4)]
        length = math.hypot(*turn)
        x, y = (SPACING * (k - (side - 1) / 2) + numbers.uniform(-0.1, 0.1) for k in (place % side, place // side))
        lines.append(f"{x:.3f} {y:.3f} {0.6 + SPACING * layer:.3f}  " + " ".join(f"{t / length:.9f}" for t in turn))
    return lines, SPACING * side / 2 + 0.8


def write_scene(count, seconds, folder):
    lines, border = poses(count)
    (folder / f"poses_{count}.txt").write_text("\n".join(lines) + "\n")
    law = {"stiffness": STIFFNESS, "damping": DAMPING}
    obstacles = [{"plane": {"normal": [0, 0, 1]}} | law | {"friction": 0.5}]
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):  # slopes about them
        plane = {"point": [-border * x, -border * y, 0], "normal": [0.8 * x, 0.8 * y, 0.6]}
        obstacles.append({"plane": plane} | law | {"friction": 0.3})
    scene = {
        "bodies": [{"name": "teddy", "bundle": "teddy.h5", "poses": f"poses_{count}.txt"}],
        "contact": law | {"friction": 0.4}, "obstacles": obstacles, "gravity": [0, 0, -9.81],
        "damping": {"mass": 1, "stiffness": 0.004}, "time_step": TIME_STEP, "steps": round(seconds / TIME_STEP)}
    path = folder / f"scene_{count}.json"
    path.write_text(json.dumps(scene, indent=1))
    return path


def run(program, scene, seconds, threads):
    steps = round(seconds / TIME_STEP)
    hashed = round(HASHED_AT / TIME_STEP)
    out = subprocess.run([program, scene, str(steps), str(threads), str(hashed)], check=True, text=True, stdout=subprocess.PIPE,
                         env=os.environ | {"OMP_WAIT_POLICY": "passive"}).stdout
    return json.loads(out)


def table(results, diagonal):
    lines = ["| bodies | largest island | at rest after | deepest in another body, in the ground | largest rise of energy | hash of 1 and 2 threads "
             "| us of a processor for a body and step: mean, last second |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for result, other in results:
        rest = f"{result['rest_after']:.2f} s" if result["rest_after"] is not None else f"{result['fastest_at_end']:.2g} m/s at the end"
        deepest = ", ".join(f"{1e3 * result[k]:.1f} mm ({100 * result[k] / diagonal:.2f} %)" for k in ("deepest_bodies", "deepest_obstacles"))
        rise = f"{result['largest_rise'] / result['fallen']:.1e}"
        same = "the same" if result["hash"] == other["hash"] else "DIFFERENT"
        lines.append(f"| {result['bodies']:,} | {result['largest_island']:,} | {rest} | {deepest} | {rise} | {same} | "
                     f"{result['us']:.0f}, {result['us_at_rest']:.0f} |")
        if result["unconverged"]:
            lines.append(f"\n{result['unconverged']} islands of {result['bodies']:,} did not converge.\n")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--page", type=Path)
    parser.add_argument("--counts", default="1,30,100")
    parser.add_argument("--seconds", type=float, default=16)
    parser.add_argument("--bundle", type=Path, help="of the teddy, in place of a new one")
    options = parser.parse_args()
    options.results.mkdir(parents=True, exist_ok=True)
    if options.bundle:
        shutil.copy(options.bundle, options.results / "teddy.h5")
    else:
        subprocess.run([options.programs / "exmat-precompute", "bundle", ASSET, "-o", options.results / "teddy.h5"], check=True)
    diagonal = diagonal_of(ASSET.parent / json.loads(ASSET.read_text())["object"]["mesh"])
    results = []
    for count in map(int, options.counts.split(",")):
        scene = write_scene(count, options.seconds, options.results)
        program = options.programs / "exmat-pile-benchmark"
        results.append((run(program, scene, options.seconds, 1), run(program, scene, HASHED_AT, 2)))
        print(json.dumps(results[-1]), flush=True)
    (options.results / "piles.json").write_text(json.dumps(results, indent=1))
    text = table(results, diagonal)
    print(text)
    if options.page:
        page = options.page.read_text()
        begin, end = "<!-- piles: begin -->", "<!-- piles: end -->"
        options.page.write_text(page[:page.index(begin) + len(begin)] + "\n" + text + "\n" + page[page.index(end):])


if __name__ == "__main__":
    main()
