#!/usr/bin/python3
"""Compare a trajectory with the values that its example expects.

Usage: expect.py [--renew] EXPECTED.json TRAJECTORY.h5    (Debian: python3-h5py)

EXPECTED.json: {"DATASET[last]" or "DATASET[max]": {"value": number or list, "margin": relative to the largest magnitude}, ...}.
[last][ROW] is a row of the last frame, such as one vertex of /vertices. Exit status 0 when every value is within its margin.
--renew writes the values found into EXPECTED.json instead; names and margins stay.
"""
import json
import re
import sys

import h5py
import numpy as np


def value_of(trajectory, name):
    dataset, what, row = re.fullmatch(r"(.*)\[(last|max)\](?:\[(\d+)\])?", name).groups()
    values = trajectory[dataset][:]
    found = values[-1] if what == "last" else np.abs(values).max(0)
    return found if row is None else found[int(row)]


def compare(expected, found):
    failures = 0
    for name, entry in expected.items():
        wanted = np.asarray(entry["value"])
        error = np.abs(found[name] - wanted).max() / np.abs(wanted).max()
        ok = error <= entry["margin"]
        failures += not ok
        size = np.size(found[name])
        shown = found[name] if size <= 4 else f"{size} values, norm {np.linalg.norm(found[name]):.6g}"
        print(f"{'ok  ' if ok else 'FAIL'} {name}: {shown}, off by {error:.1e} (margin {entry['margin']:g})")
    return 1 if failures else 0


def renew(path, expected, found):
    rounded = {name: np.vectorize(lambda x: float(f"{x:.6g}"))(value).tolist() for name, value in found.items()}
    lines = [f'  "{name}": {{"value": {json.dumps(rounded[name])}, "margin": {entry["margin"]}}}' for name, entry in expected.items()]
    with open(path, "w") as f:
        f.write("{\n" + ",\n".join(lines) + "\n}\n")
    return 0


def main():
    path, trajectory = sys.argv[-2:]
    with open(path) as f:
        expected = json.load(f)
    with h5py.File(trajectory) as f:
        found = {name: value_of(f, name) for name in expected}
    return renew(path, expected, found) if sys.argv[1] == "--renew" else compare(expected, found)


if __name__ == "__main__":
    sys.exit(main())
