#!/usr/bin/python3
"""Many runs of exmat-precompute at once, each without mpirun: none fails, none leaves anything in the temporary directory.

Usage: test_many_runs.py FOLDER_OF_PROGRAMS [RUNS]
"""
import itertools
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PROGRAM = Path(sys.argv.pop(1)).resolve() / "exmat-precompute"
RUNS = int(sys.argv.pop(1)) if len(sys.argv) > 1 else 64
AT_ONCE = 16
KILLED = 20
SHARED_MEMORY = Path("/dev/shm")


def bar(bend, cells=(4, 2, 2)):
    """Text of a .veg file: cells of six tets each, 96 in all, bent."""
    corner = {place: number for number, place in enumerate(itertools.product(*(range(n + 1) for n in cells)), 1)}
    tets = []
    for origin in itertools.product(*map(range, cells)):
        for order in itertools.permutations(range(3)):
            place = list(origin)
            path = [corner[tuple(place)]]
            for axis in order:
                place[axis] += 1
                path.append(corner[tuple(place)])
            tets.append(path)
    lines = ["*VERTICES", f"{len(corner)} 3 0 0"]
    lines += [f"{number} {x} {y + bend * x * x} {z}" for (x, y, z), number in corner.items()]
    lines += ["*ELEMENTS", "TET", f"{len(tets)} 4 0"] + [" ".join(map(str, [t + 1, *tet])) for t, tet in enumerate(tets)]
    return "\n".join(lines) + "\n"


def shared_memory():
    """What Open MPI may have there."""
    if not SHARED_MEMORY.is_dir():
        return set()
    return {name for name in os.listdir(SHARED_MEMORY) if re.match("open_mpi|vader|sm_|psm", name)}


class ManyRuns(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)
        self.temporary = self.folder / "temporary"
        self.temporary.mkdir()
        (self.folder / "rest.veg").write_text(bar(0))
        (self.folder / "bent.veg").write_text(bar(0.05))
        asset = {"name": "bar", "object": {"mesh": "rest.veg", "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000}},
                 "shape_space": {"eigenfunctions": 4},
                 "examples": [{"name": "rest", "mesh": "rest.veg", "rest": True}, {"name": "bent", "mesh": "bent.veg"}]}
        (self.folder / "asset.json").write_text(json.dumps(asset))

    def start(self, temporary):
        return subprocess.Popen([PROGRAM, "check", self.folder / "asset.json", "--threads", "1"], stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(temporary)})

    def check(self, temporary):
        """What a run says where it fails."""
        run = self.start(temporary)
        _, errors = run.communicate()
        return "" if run.returncode == 0 else f"status {run.returncode}: {errors}"

    def require_nothing_left(self, before):
        self.assertEqual(os.listdir(self.temporary), [])
        for _ in range(60):  # other programs of this machine may have some for a while
            left = shared_memory() - before
            if not left:
                return
            time.sleep(0.5)
        self.fail(f"left in {SHARED_MEMORY}: {sorted(left)}")

    def test_none_fails_and_nothing_is_left(self):
        before = shared_memory()
        with ThreadPoolExecutor(AT_ONCE) as pool:
            failures = list(filter(None, pool.map(lambda _: self.check(self.temporary), range(RUNS))))
        self.assertEqual((len(failures), failures[:1]), (0, []))
        self.require_nothing_left(before)

    def test_killed_runs_leave_nothing(self):
        before = shared_memory()
        moments = random.Random(1)
        for _ in range(KILLED):
            run = self.start(self.temporary)
            time.sleep(moments.uniform(0, 0.15))
            run.kill()
            run.communicate()
        self.require_nothing_left(before)

    def test_the_temporary_directory_may_be_missing_or_far_down(self):
        # Sockets have paths of at most 107 bytes.
        far = self.folder / Path(*["a_long_name_of_a_folder"] * 8)
        far.mkdir(parents=True)
        self.assertEqual(self.check(far), "")
        self.assertEqual(self.check(self.folder / "missing"), "")


if __name__ == "__main__":
    unittest.main()
