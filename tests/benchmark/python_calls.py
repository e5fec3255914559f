#!/usr/bin/python3
"""What calls from Python cost: beside a step, beside memory, and a batch of bodies beside `exmat-runtime bench`.

Usage: PYTHONPATH=BUILD/python python_calls.py BUILD [--page docs/python.md]    (the page: renews its table)
"""
import argparse
import json
import re
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import exmat

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples/01_twisted_bar"
BODIES, STEPS, ROUNDS = 1000, 60, 7
POINTS = 100_000


def best(work, rounds, calls=1):
    """Seconds of a call: the least of the rounds."""
    least = np.inf
    for _ in range(rounds):
        begin = time.perf_counter()
        for _ in range(calls):
            work()
        least = min(least, (time.perf_counter() - begin) / calls)
    return least


def calls(model):
    body = exmat.Body(model)
    body.step(1000)
    works = (("step(0)`, a call without a step", lambda: body.step(0)), ("q`", lambda: body.q), ("weights`", lambda: body.weights),
             ("energies`", lambda: body.energies), ("report`", lambda: body.report))
    return [(f"`body.{name}", best(work, 20, 10000)) for name, work in works]


def positions(model):
    rest = np.random.default_rng(1).uniform((0, 0, 0), (4, 1, 1), (POINTS, 3))
    points, body = exmat.Points.at(model, rest), exmat.Body(model)
    body.step(100)
    out = np.empty((POINTS, 3), "f4")
    touched = 3 * POINTS * 4 * (model.modes + 2)  # rows of U, the rest shape and what is written, in single precision
    source = np.random.default_rng(2).standard_normal(touched // 8).astype("f4")  # half is read, half is written
    copy = np.empty_like(source)
    ours, memory = [], []
    for _ in range(20):  # in turn, so that both see the same machine
        ours.append(best(lambda: body.positions(points, out), 3))
        memory.append(best(lambda: np.copyto(copy, source), 3))
    return [(f"positions of 100,000 points into an array, {touched / 1e6:.1f} MB read and written", min(ours)),
            ("`memcpy` that reads and writes as many bytes", min(memory))]


def worlds(build, folder, scene):
    path = folder / "world.json"
    path.write_text(json.dumps({**scene, "instances": BODIES}))
    world = exmat.Batch(exmat.Model.from_scene(path), BODIES)
    bench, ours = [], []

    def stepped():
        world.reset()
        begin = time.perf_counter()
        world.step(STEPS)
        ours.append((time.perf_counter() - begin) / STEPS / BODIES)

    for _ in range(ROUNDS):
        done = subprocess.run([str(build / "bin/exmat-runtime"), "bench", str(path), "--json", "--steps", str(STEPS)], check=True, capture_output=True,
                              text=True)
        bench.append(json.loads(done.stdout)["step"]["mean_us"] * 1e-6)
        stepped()
    return min(ours) / min(bench)


def table(rows, share):
    lines = [f"| {what} | {1e6 * seconds:,.3g} |" for what, seconds in rows]
    return "\n".join(["| | time [us] |", "| --- | ---: |", *lines, "",
                      f"A step of a `Batch` of 1,000 bodies takes {share:.2f} of the time that `exmat-runtime bench` measures."])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=Path)
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = json.loads((EXAMPLE / "scene.json").read_text())
        scene.pop("output")
        scene["bundle"] = str(folder / "bar.h5")
        exmat.precompute.bundle(EXAMPLE / "asset.json", scene["bundle"], scene=scene)
        model = exmat.Model.from_scene(scene)
        text = table(calls(model) + positions(model), worlds(given.build, folder, scene))
    print(text)
    if given.page is not None:
        page = given.page.read_text()
        given.page.write_text(re.sub(r"(<!-- calls: begin -->\n\n).*?(\n<!-- calls: end -->)", lambda match: match[1] + text + match[2], page, flags=re.S))


if __name__ == "__main__":
    main()
