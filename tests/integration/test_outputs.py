#!/usr/bin/python3
"""Bundles where things go wrong: killed at any moment, a full disk, a folder that cannot be written, two writers at once.

Usage: test_outputs.py FOLDER_OF_PROGRAMS
"""
import itertools
import json
import os
import random
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

PROGRAMS = Path(sys.argv.pop(1)).resolve()
PRECOMPUTE, RUNTIME = PROGRAMS / "exmat-precompute", PROGRAMS / "exmat-runtime"
MOMENTS = 50


def bar(bend):
    """Text of a .veg file: two cubes of six tets each, bent."""
    corner = {}
    for place in itertools.product(range(3), range(2), range(2)):
        corner[place] = len(corner) + 1
    tets = []
    for i in range(2):
        for order in itertools.permutations(range(3)):
            place, path = [i, 0, 0], [corner[i, 0, 0]]
            for axis in order:
                place[axis] += 1
                path.append(corner[tuple(place)])
            tets.append(path)
    lines = ["*VERTICES", f"{len(corner)} 3 0 0"]
    lines += [f"{number} {0.5 * x} {0.5 * y + bend * x * x} {0.5 * z}" for (x, y, z), number in corner.items()]
    lines += ["*ELEMENTS", "TET", f"{len(tets)} 4 0"] + [" ".join(map(str, [t + 1, *tet])) for t, tet in enumerate(tets)]
    return "\n".join(lines) + "\n"


class Outputs(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)
        (self.folder / "rest.veg").write_text(bar(0))
        (self.folder / "bent.veg").write_text(bar(0.05))
        asset = {"name": "bar", "object": {"mesh": "rest.veg", "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000}},
                 "shape_space": {"eigenfunctions": 3}, "basis": {"size": 3, "linear_modes": 2},
                 "cubature": {"elements": 3, "training_poses": 10},
                 "examples": [{"name": "rest", "mesh": "rest.veg", "rest": True}, {"name": "bent", "mesh": "bent.veg"}]}
        (self.folder / "asset.json").write_text(json.dumps(asset))
        self.out = self.folder / "out"
        self.out.mkdir()
        self.bundle = self.out / "bundle.h5"

    def start(self, bundle=None, seed_of_asset="asset.json"):
        return subprocess.Popen([PRECOMPUTE, "bundle", self.folder / seed_of_asset, "-o", bundle or self.bundle, "--threads", "1"],
                                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def finish(self, process):
        errors = process.communicate(timeout=120)[1]
        return process.returncode, errors

    def check_sound(self, bundle=None):
        subprocess.run([RUNTIME, "validate", bundle or self.bundle], check=True, capture_output=True)

    def test_killed_at_any_moment_the_old_bundle_stays_and_the_next_run_cleans_up(self):
        begin = time.monotonic()
        self.assertEqual(self.finish(self.start())[0], 0)
        length = time.monotonic() - begin
        old = self.bundle.read_bytes()
        moments, whole = random.Random(1), 0
        for _ in range(MOMENTS):
            process = self.start()
            time.sleep(moments.uniform(0, 1.1 * length))
            process.kill()
            whole += self.finish(process)[0] == 0
            self.assertEqual(self.bundle.read_bytes(), old)  # the same inputs: also the new one has these bytes
        self.assertLess(whole, MOMENTS / 2, "most runs had ended before they were killed")
        self.assertEqual(self.finish(self.start())[0], 0)
        self.assertEqual([path.name for path in self.out.iterdir()], ["bundle.h5"])
        self.check_sound()

    def test_an_environment_that_cannot_be_is_said(self):
        for name, value in (("OMP_NUM_THREADS", "100000"), ("EXMAT_SIMD", "AVX2"), ("EXMAT_SIMD", "")):
            run = subprocess.run([PRECOMPUTE, "bundle", self.folder / "asset.json", "-o", self.bundle], env={**os.environ, name: value},
                                 capture_output=True, text=True, timeout=60)
            self.assertEqual(run.returncode, 2, run.stderr)
            self.assertIn(name, run.stderr)
            self.assertFalse(self.bundle.exists())

    def test_two_at_once_leave_one_whole_bundle(self):
        other = json.loads((self.folder / "asset.json").read_text())
        other["seed"] = 2
        (self.folder / "other.json").write_text(json.dumps(other))
        for _ in range(3):
            processes = [self.start(), self.start(seed_of_asset="other.json")]
            self.assertEqual([self.finish(process)[0] for process in processes], [0, 0])
            self.check_sound()
            self.assertEqual([path.name for path in self.out.iterdir()], ["bundle.h5"])

    def test_a_full_disk_is_said_and_leaves_nothing(self):
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", self.out], capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest("cannot mount a small file system: " + mounted.stderr.strip())
        self.addCleanup(subprocess.run, ["umount", self.out])
        status, errors = self.finish(self.start())
        self.assertEqual(status, 1)
        self.assertIn(str(self.bundle), errors)
        self.assertIn("No space left on device", errors)
        self.assertEqual(list(self.out.iterdir()), [])

    def test_a_folder_that_cannot_be_written_is_said_before_the_work(self):
        if os.geteuid() == 0:
            self.skipTest("root writes anywhere")
        self.out.chmod(0o500)
        self.addCleanup(self.out.chmod, 0o700)
        status, errors = self.finish(self.start())
        self.assertEqual(status, 1)
        self.assertIn(f"cannot write {self.bundle}: Permission denied", errors)

    def test_a_read_only_file_system_is_said_before_the_work(self):
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", self.out], capture_output=True, text=True)
        if mounted.returncode != 0:
            self.skipTest("cannot mount a file system: " + mounted.stderr.strip())
        self.addCleanup(subprocess.run, ["umount", self.out])
        status, errors = self.finish(self.start())
        self.assertEqual(status, 1)
        self.assertIn(f"cannot write {self.bundle}: Read-only file system", errors)
        self.assertNotIn("eigen", errors)


if __name__ == "__main__":
    unittest.main(verbosity=2)
