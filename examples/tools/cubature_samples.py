#!/usr/bin/python3
"""Tell how well as many nodes as tets hold a body's force, as a table: errors of the poses that the selection has not seen.

Usage: cubature_samples.py [--programs build/release/bin]    (Debian: python3-h5py)

Everything goes to build/cubature_samples. A quarter of an hour.
"""
import argparse
import json
import pathlib

import h5py
import numpy as np

from other_loads import ROOT, absolute, run

ASSETS = {"bar": "01_twisted_bar/asset.json", "cross": "06_cross/asset_recommended.json", "car": "03_car_wall/asset_twist_recommended.json"}
SIZES, SEEDS = (20, 30, 60, 90), (1, 2, 3)
ERRORS = {"force": "heldout_error", "energy": "heldout_energy_error", "stiffness": "heldout_stiffness_error"}


def errors(file, formulation, size, programs, folder):
    """Means over the seeds of a bundle's errors, in the order of ERRORS."""
    rows = []
    for seed in SEEDS:
        asset = absolute(json.loads(file.read_text()), file.parent) | {"seed": seed, "cubature": {"elements": size}, "internal_force": "cubature"}
        asset["object"]["formulation"] = formulation
        (folder / "asset.json").write_text(json.dumps(asset))
        run(folder, programs / "exmat-precompute", "bundle", "asset.json", "-o", "bundle.h5")
        with h5py.File(folder / "bundle.h5") as bundle:
            rows.append([bundle["cubature"].attrs[name] for name in ERRORS.values()])
    return np.mean(rows, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    programs, folder = parser.parse_args().programs.resolve(), ROOT / "build/cubature_samples"
    folder.mkdir(parents=True, exist_ok=True)
    print(f"| body | s | {' | '.join(f'{error}, tets [%] | nodes [%]' for error in ERRORS)} |\n|{' --- |' * (2 + 2 * len(ERRORS))}")
    for body, asset in ASSETS.items():
        for size in SIZES:
            pairs = np.stack([errors(ROOT / "examples" / asset, formulation, size, programs, folder) for formulation in ("linear", "smoothed")], 1)
            print(f"| {body} | {size} | {' | '.join(f'{100 * error:.2g}' for error in pairs.ravel())} |", flush=True)


if __name__ == "__main__":
    main()
