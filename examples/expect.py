#!/usr/bin/python3
"""Compare a trajectory with the values that its example expects.

Usage: expect.py EXPECTED.json TRAJECTORY.h5    (Debian: python3-h5py)

EXPECTED.json: {"DATASET[last]" or "DATASET[max]": {"value": number or list, "margin": relative to the largest magnitude}, ...}.
[last][ROW] is a row of the last frame, such as one vertex of /vertices.
Exit status 0 when every value is within its margin.
"""
import json
import re
import sys

import h5py
import numpy as np


def main():
    failures = 0
    with open(sys.argv[1]) as f:
        expected = json.load(f)
    with h5py.File(sys.argv[2]) as trajectory:
        for name, entry in expected.items():
            dataset, what, row = re.fullmatch(r"(.*)\[(last|max)\](?:\[(\d+)\])?", name).groups()
            values = trajectory[dataset][:]
            found = values[-1] if what == "last" else np.abs(values).max(0)
            found = found if row is None else found[int(row)]
            wanted = np.asarray(entry["value"])
            error = np.abs(found - wanted).max() / np.abs(wanted).max()
            ok = error <= entry["margin"]
            failures += not ok
            shown = found if np.size(found) <= 4 else f"{np.size(found)} values, norm {np.linalg.norm(found):.6g}"
            print(f"{'ok  ' if ok else 'FAIL'} {name}: {shown}, off by {error:.1e} (margin {entry['margin']:g})")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
