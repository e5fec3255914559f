#!/usr/bin/python3
"""The rules hold in the project, and each one catches a planted violation.

Usage: test_rules.py BUILD_FOLDER
"""
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import rules

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(sys.argv.pop(1)) if len(sys.argv) > 1 else ROOT / "build/release"

PLANTED = [
    ("direction", "runtime/io/x.cpp", '#include "precompute/fem/assembly.h"\n'),
    ("direction", "common/mesh/x.h", '#include "runtime/sim/model.h"\n'),
    ("direction", "precompute/study/x.cpp", '#include "runtime/sim/model.h"\n'),
    ("lean", "common/elastic/x.h", "#include <nlohmann/json.hpp>\n"),
    ("lean", "common/model/x.h", '#include "common/bundle/bundle.h"\n'),
    ("lean", "runtime/sim/x.cpp", "#include <hdf5.h>\n"),
    ("lean", "common/mesh/x.cpp", "#include <unistd.h>\n"),
    ("hot_path", "runtime/sim/x.cpp", "#include <iostream>\n"),
    ("hot_path", "runtime/sim/x.cpp", "void f() { throw 1; }\n"),
    ("petsc", "precompute/modes/x.cpp", "#include <petscmat.h>\n"),
    ("petsc", "precompute/solvers/x.h", "#include <slepceps.h>\n"),
    ("petsc", "precompute/modes/x.cpp", '#include "precompute/solvers/petsc_handles.h"\n'),
    ("hdf5", "precompute/pipeline/x.cpp", "#include <hdf5.h>\n"),
    ("top_level", "scratch/x.txt", "\n"),
    ("formatting", "common/core/x.cpp", "int  f( ) {return 1 ;}\n"),
]

HARMLESS = [
    ("runtime/sim/x.cpp", "// throw nothing, try nothing\n#include <Eigen/Core>\n#include <cmath>\n"),
    ("runtime/io/x.cpp", "#include <hdf5.h>\n"),
    ("precompute/solvers/x.cpp", "#include <petscmat.h>\n"),
]


def planted_tree(folder, file, text):
    for name in ("common", "precompute", "runtime", "tests"):
        (folder / name).mkdir(parents=True)
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


class Rules(unittest.TestCase):
    def test_hold_in_the_project(self):
        self.assertEqual(rules.violations(ROOT), [])

    def test_each_catches_a_planted_violation(self):
        for rule, file, text in PLANTED:
            with self.subTest(rule=rule, file=file), tempfile.TemporaryDirectory() as folder:
                planted_tree(Path(folder), file, text)
                self.assertTrue(any(found.startswith(rule + ": ") for found in rules.violations(Path(folder))))
        self.assertEqual({rule for rule, _, _ in PLANTED}, set(rules.RULES))

    def test_let_sound_sources_pass(self):
        for file, text in HARMLESS:
            with self.subTest(file=file), tempfile.TemporaryDirectory() as folder:
                planted_tree(Path(folder), file, text)
                self.assertEqual(rules.violations(Path(folder)), [])


class Linking(unittest.TestCase):
    """The run time needs neither MPI nor PETSc nor SLEPc, and the serial HDF5."""

    @staticmethod
    def faults(program):
        libraries = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True).stdout
        found = [name for name in ("mpi", "petsc", "slepc", "mumps") if name in libraries.lower()]
        return found + ([] if "libhdf5_serial" in libraries else ["no serial HDF5"])

    def test_of_the_run_time(self):
        self.assertEqual(self.faults(BUILD / "bin/exmat-runtime"), [])

    @unittest.skipUnless((BUILD / "bin/exmat-precompute").exists(), "built without the offline stage")
    def test_catches_a_program_that_links_the_offline_stage(self):
        self.assertIn("petsc", self.faults(BUILD / "bin/exmat-precompute"))


class Naming(unittest.TestCase):
    """clang-tidy's identifier naming, as in .clang-tidy, over every source that is compiled."""

    CHECKS = "--checks=-*,readability-identifier-naming"

    def test_holds_in_the_project(self):
        pattern = f"^{ROOT}/(common|precompute|runtime)/.*"
        jobs = str(os.cpu_count())
        result = subprocess.run(["run-clang-tidy", "-quiet", "-j", jobs, "-p", str(BUILD), "-checks=-*,readability-identifier-naming",
                                 pattern], capture_output=True, text=True)
        plain = re.sub(r"\x1b\[[0-9;]*m", "", result.stdout)
        self.assertEqual([line for line in plain.splitlines() if re.search(r"\b(error|warning):", line)], [])
        self.assertEqual(result.returncode, 0, plain[-2000:] + result.stderr[-2000:])

    def test_catches_a_planted_violation(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "x.cpp"
            path.write_text("struct bad_type {\n  int Function();\n};\nconstexpr int limit = 1;\n")
            config = f"--config-file={ROOT / '.clang-tidy'}"
            result = subprocess.run(["clang-tidy", self.CHECKS, config, str(path), "--", "-std=c++20"], capture_output=True, text=True)
            for name in ("bad_type", "Function", "limit"):
                self.assertIn(name, result.stdout)


class RuntimeAlone(unittest.TestCase):
    """-DEXMAT_BUILD_PRECOMPUTE=OFF configures and compiles where PETSc, SLEPc and MPI cannot be found."""

    def test_builds(self):
        with tempfile.TemporaryDirectory() as folder:
            blind = dict(os.environ, PKG_CONFIG_PATH="/nowhere")
            options = ["-DEXMAT_BUILD_PRECOMPUTE=OFF", "-DEXMAT_BUILD_TESTS=OFF", "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_DISABLE_FIND_PACKAGE_MPI=ON"]
            subprocess.run(["cmake", "-S", str(ROOT), "-B", folder, "-GNinja", *options], check=True, env=blind, capture_output=True)
            result = subprocess.run(["cmake", "--build", folder, "--target", "exmat-runtime"], env=blind, capture_output=True, text=True)
            self.assertEqual(result.returncode, 0, result.stdout[-3000:])
            self.assertEqual(Linking.faults(Path(folder) / "bin/exmat-runtime"), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
