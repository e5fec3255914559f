#!/usr/bin/python3
"""What the viewer takes: steps and drawing of a picture, and how many bodies move at 60 pictures a second.

Usage: xvfb-run -a viewer_times.py FOLDER_OF_PROGRAMS SCENE.json ...    [--rounds N]

Prints rows of the table of docs/viewer.md, each the best of N runs (5) of 12 pictures of 1280 x 720 with the interface.
Bodies: the most `instances` of a scene whose steps fit into a sixtieth of a second, found by bisection, without drawing.
"""
import argparse
import json
import re
import subprocess
import tempfile
from pathlib import Path

PICTURES = 12
FRAME = 1e3 / 60  # ms


def measured(viewer, scene, rounds, size="1280x720", *options):
    """Triangles, and the least ms of steps and of drawing."""
    best = {}
    for _ in range(rounds):
        words = [viewer, scene, "--frames", PICTURES, "--size", size, "--time", "--log-level", "error", *options]
        printed = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=True).stdout
        for name, number in re.findall(r"^(triangles|bodies|simulation|drawing) ([0-9.]+)", printed, re.M):
            best[name] = min(best.get(name, float("inf")), float(number))
    return best


def most_bodies(viewer, scene, folder, of_one, rounds):
    content = json.loads(scene.read_text())
    if "bodies" in content:
        return "-"
    content["bundle"] = str(scene.parent / content["bundle"])
    for obstacle in content.get("obstacles", []):
        for shape in ("mesh", "height_field"):
            if "file" in obstacle.get(shape, {}):
                obstacle[shape]["file"] = str(scene.parent / obstacle[shape]["file"])

    def fits(count):
        copy = folder / "many.json"
        copy.write_text(json.dumps({**content, "instances": count}))
        return measured(viewer, copy, rounds, "64x64", "--hide-interface")["simulation"] <= FRAME

    least, most = 0, max(2, int(4 * FRAME / of_one))
    while most - least > max(1, least // 10):
        middle = (least + most) // 2
        least, most = (middle, most) if fits(middle) else (least, middle)
    return least


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    viewer = arguments.programs.resolve() / "exmat-viewer"
    print("| scene | triangles | steps of a picture | drawing of a picture | bodies at 60 a second, steps alone |\n| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes:
            scene = scene.resolve()
            best = measured(viewer, scene, arguments.rounds)
            bodies = most_bodies(viewer, scene, Path(folder), best["simulation"], max(1, arguments.rounds // 2))
            print(f"| {scene.parent.name} | {int(best['triangles']):,} | {best['simulation']:.2f} ms | {best['drawing']:.0f} ms | {bodies} |", flush=True)


if __name__ == "__main__":
    main()
