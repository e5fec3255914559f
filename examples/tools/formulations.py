#!/usr/bin/python3
"""Tell what smoothed elements do to the paper's six scenes: frequencies and motion in the full space, beside those of linear tets.

Usage: formulations.py [--write] [--programs build/release/bin]    (Debian: python3-h5py)

Everything goes to build/formulations, where motions are found again. --write also renews the table of docs/studies/stiffness.md. A few minutes.
"""
import argparse
import json
import pathlib
import re

import h5py
import numpy as np

from accuracy import SCENES, inputs
from other_loads import ROOT, error, fitted, frames_of, mesh_of, run

PAGE = ROOT / "docs/studies/stiffness.md"
HEAD = "| scene | Poisson ratio | lowest frequencies [Hz], linear | smoothed | smoothed over linear | most displacement, linear [m] | smoothed [m] | apart |\n"


def measured(name, formulation, programs, folder):
    """Six lowest frequencies that are above 0, the frames and the mesh of a scene without a basis."""
    asset, scene = inputs(name)
    asset["object"]["formulation"] = formulation
    asset["basis"]["training"] = "none"
    scene["bundle"] = f"{formulation}.h5"
    (folder / "asset.json").write_text(json.dumps(asset, indent=1) + "\n")
    (folder / f"{formulation}.json").write_text(json.dumps(scene, indent=1) + "\n")
    if not (folder / f"{formulation}_full.h5").exists():
        run(folder, programs / "exmat-precompute", "bundle", "asset.json", "-o", scene["bundle"])
        run(folder, programs / "exmat-precompute", "full-space", f"{formulation}.json", "-o", f"{formulation}_full.h5")
    with h5py.File(folder / scene["bundle"]) as file:
        frequencies = file["modal/frequencies"][()]
    return frequencies[frequencies > 1e-3][:6], frames_of(folder / f"{formulation}_full.h5")[1:], mesh_of(folder / scene["bundle"])


def row(name, programs, output):
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    before, linear, mesh = measured(name, "linear", programs, folder)
    after, smoothed, _ = measured(name, "smoothed", programs, folder)
    rest = mesh["vertices"]
    at = (lambda frame: rest) if mesh["fixed"].any() else (lambda frame: fitted(rest, frame, mesh["vertex_mass"]))
    most = [max(np.linalg.norm(frame - at(frame), axis=1).max() for frame in frames) for frames in (linear, smoothed)]
    ratio = json.loads((folder / "asset.json").read_text())["object"]["material"]["poisson_ratio"]
    return (f"| {name} | {ratio} | {before[0]:.3g} to {before[-1]:.3g} | {after[0]:.3g} to {after[-1]:.3g} | {(after / before).min():.2f} to "
            f"{(after / before).max():.2f} | {most[0]:.3g} | {most[1]:.3g} | {100 * error(smoothed, linear, mesh):.2g} % |\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    rows = ""
    for name in SCENES:
        rows += row(name, options.programs.resolve(), ROOT / "build/formulations")
        print(rows.splitlines()[-1], flush=True)
    if options.write:
        PAGE.write_text(re.sub(re.escape(HEAD) + r"\|[- |]*\n(\|.*\n)*", lambda _: HEAD + "|" + " --- |" * HEAD.count(" | ") + " --- |\n" + rows, PAGE.read_text()))


if __name__ == "__main__":
    main()
