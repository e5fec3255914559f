#!/usr/bin/python3
"""How well as many nodes as tets hold a body's force, as a table: errors of the poses that the selection has not seen, smoothed over linear.

Usage: cubature_samples.py FOLDER_OF_PROGRAMS    a quarter of an hour
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

PROGRAM = Path(sys.argv[1]).resolve() / "exmat-precompute"
EXAMPLES = Path(__file__).parents[2] / "examples"
ASSETS = {"bar": "01_twisted_bar/asset.json", "cross": "06_cross/asset_recommended.json", "car": "03_car_wall/asset_twist_recommended.json"}
SIZES, SEEDS = (20, 30, 60, 90), (1, 2, 3)
ERRORS = {"force": "heldout_error", "energy": "heldout_energy_error", "stiffness": "heldout_stiffness_error"}


def errors(asset, formulation, size, folder):
    """Means over the seeds of a bundle's errors, in the order of ERRORS."""
    rows = []
    for seed in SEEDS:
        config = json.loads(asset.read_text())
        config |= {"seed": seed, "cubature": {"elements": size}, "internal_force": "cubature"}
        config["object"]["formulation"] = formulation
        for part in [config["object"], *config["examples"]]:
            part["mesh"] = str((asset.parent / part["mesh"]).resolve())
        (folder / "asset.json").write_text(json.dumps(config))
        subprocess.run([PROGRAM, "bundle", folder / "asset.json", "-o", folder / "bundle.h5"], check=True, capture_output=True)
        with h5py.File(folder / "bundle.h5") as file:
            rows.append([file["cubature"].attrs[name] for name in ERRORS.values()])
    return np.mean(rows, 0)


def main():
    print(f"| body | s | {' | '.join(f'{error}, tets [%] | nodes [%]' for error in ERRORS)} |\n|{' --- |' * (2 + 2 * len(ERRORS))}")
    with tempfile.TemporaryDirectory() as folder:
        for body, asset in ASSETS.items():
            for size in SIZES:
                pairs = np.stack([errors(EXAMPLES / asset, formulation, size, Path(folder)) for formulation in ("linear", "smoothed")], 1)
                print(f"| {body} | {size} | {' | '.join(f'{100 * error:.2g}' for error in pairs.ravel())} |", flush=True)


if __name__ == "__main__":
    main()
