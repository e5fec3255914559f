#!/usr/bin/python3
"""A project that adds exmat to its own by add_subdirectory() keeps its flags, standard, folders and tests.

Usage: test_guest.py BUILD_FOLDER    configures the project beside this file, builds nothing
"""
import json
import re
import shlex
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
BUILD = Path(sys.argv.pop(1)) if len(sys.argv) > 1 else ROOT / "build/release"


def cached(name):
    """-DNAME=VALUE as in the build folder's own cache."""
    match = re.search(rf"^{name}:\w+=(.*)$", (BUILD / "CMakeCache.txt").read_text(), re.M)
    return f"-D{name}={match.group(1)}"


class Guest(unittest.TestCase):
    def configured(self, folder, *options):
        result = subprocess.run(["cmake", "-S", str(HERE), "-B", str(folder), "-GNinja", f"-DEXMAT_FOLDER={ROOT}",
                                 cached("CMAKE_CXX_COMPILER"), *options], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_keeps_what_it_has(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name).resolve()
            self.configured(folder, "-DEXMAT_BUILD_PRECOMPUTE=OFF")
            self.check_commands(folder)
            self.check_files(folder)
            self.check_tests(folder)

    @unittest.skipUnless((BUILD / "bin/exmat-precompute").exists(), "built without the offline stage")
    def test_keeps_it_beside_the_offline_stage(self):
        with tempfile.TemporaryDirectory() as folder:
            self.configured(folder, "-DEXMAT_BUILD_PRECOMPUTE=ON")

    def check_commands(self, folder):
        """Each compiles by its own standard; warnings of exmat are not for the guest, whose source compiles."""
        commands = {entry["file"]: entry for entry in json.loads((folder / "compile_commands.json").read_text())}
        own, inner = commands[str(HERE / "unit.cpp")], commands[str(ROOT / "runtime/api/exmat.cpp")]
        self.assertNotIn("-std=c++20", own["command"])
        self.assertIn("-std=c++20", inner["command"])
        self.assertIn("-Wconversion", inner["command"])
        self.assertNotRegex(own["command"], r"-W|-O\d|EIGEN|isystem")
        subprocess.run([*shlex.split(own["command"]), "-fsyntax-only"], cwd=own["directory"], check=True)

    def check_files(self, folder):
        """The guest's layout is that of all it builds."""
        programs = {Path(line).parent for line in (folder / "where.txt").read_text().split()}
        self.assertEqual(programs, {folder / "programs"})
        self.assertFalse((folder / "CPackConfig.cmake").exists())
        self.assertNotRegex((folder / "CMakeCache.txt").read_text(), r"(?m)^CMAKE_BUILD_TYPE:\w+=.")

    def check_tests(self, folder):
        listed = subprocess.run(["ctest", "-N"], cwd=folder, capture_output=True, text=True, check=True).stdout
        self.assertEqual(re.findall(r"Test +#\d+: (\S+)", listed), ["unit"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
