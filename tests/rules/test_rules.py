#!/usr/bin/python3
"""The rules hold in the project, and each one catches a planted violation.

Usage: test_rules.py BUILD_FOLDER
"""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import naming
import rules

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(sys.argv.pop(1)) if len(sys.argv) > 1 else ROOT / "build/release"

PLANTED = [
    ("direction", "runtime/output/x.cpp", '#include "precompute/fem/elastic_system.h"\n'),
    ("direction", "common/mesh/x.h", '#include "runtime/sim/step/model.h"\n'),
    ("direction", "common/hdf5/x.h", '#include "common/bundle/bundle.h"\n'),
    ("direction", "precompute/pipeline/x.cpp", '#include "runtime/scene/bodies.h"\n'),
    ("direction", "precompute/pipeline/x.cpp", '#include "precompute/study/measure/runs.h"\n'),
    ("direction", "precompute/study/measure/x.cpp", '#include "precompute/study/sweep/study.h"\n'),
    ("direction", "precompute/study/measure/x.cpp", '#include "runtime/api/settings.h"\n'),
    ("direction", "precompute/cache/x.cpp", '#include "precompute/examples/example_stage.h"\n'),
    ("direction", "precompute/full_space/x.h", '#include "precompute/study/measure/runs.h"\n'),
    ("direction", "runtime/sim/contact/x.h", '#include "runtime/sim/step/state.h"\n'),
    ("direction", "runtime/sim/solver/x.h", '#include "runtime/sim/frame/spin.h"\n'),
    ("direction", "runtime/output/x.cpp", '#include "runtime/scene/bodies.h"\n'),
    ("direction", "precompute/odds_and_ends/x.cpp", "\n"),
    ("lean", "common/elastic/x.h", "#include <nlohmann/json.hpp>\n"),
    ("lean", "common/model/x.h", '#include "common/bundle/bundle.h"\n'),
    ("lean", "runtime/sim/step/x.cpp", "#include <hdf5.h>\n"),
    ("lean", "common/mesh/x.cpp", "#include <unistd.h>\n"),
    ("hot_path", "runtime/sim/step/x.cpp", "#include <iostream>\n"),
    ("hot_path", "runtime/sim/contact/x.cpp", "void f() { throw 1; }\n"),
    ("petsc", "precompute/modes/x.cpp", "#include <petscmat.h>\n"),
    ("petsc", "precompute/solvers/x.h", "#include <slepceps.h>\n"),
    ("petsc", "precompute/modes/x.cpp", '#include "precompute/solvers/petsc_handles.h"\n'),
    ("decompositions", "precompute/modes/x.cpp", "#include <Eigen/SVD>\n"),
    ("decompositions", "tests/common/mesh/x.cpp", "auto x = matrix.bdcSvd();\n"),
    ("hdf5", "precompute/pipeline/x.cpp", "#include <hdf5.h>\n"),
    ("hdf5", "runtime/output/x.cpp", "#include <hdf5.h>\n"),
    ("public_headers", "runtime/include/exmat/x.hpp", "#include <Eigen/Core>\n"),
    ("public_headers", "runtime/include/exmat/x.hpp", '#include "common/core/error.h"\n'),
    ("public_headers", "runtime/include/exmat/x.h", "#include <vector>\n"),
    ("layouts", "runtime/ports/wasi/layouts.cpp", "EXMAT_MEMBER(ray_hit, body)\n"),
    ("direction", "runtime/python/x.cpp", '#include "runtime/sim/step/state.h"\n'),
    ("python_module", "runtime/python/x.cpp", "#include <fmt/format.h>\n"),
    ("viewer", "runtime/viewer/app/x.cpp", '#include "runtime/sim/step/state.h"\n'),
    ("viewer", "runtime/viewer/view/x.cpp", "#include <epoxy/gl.h>\n"),
    ("viewer", "runtime/app/x.cpp", "#include <imgui.h>\n"),
    ("one_header", "runtime/sim/contact/x.cpp", ""),
    ("mirrored_tests", "tests/runtime/sim/nowhere/x_test.cpp", "\n"),
    ("references", "common/core/x.h", "/// As method.md, section 3, says.\n"),
    ("references", "common/core/x.h", "// See the page of\n// docs/nothing.md.\n"),
    ("references", "common/core/x.cpp", "int x = 1;  // of common/core/nothing.h\n"),
    ("references", "common/core/x.cpp", "// of nothing.h\n"),
    ("references", "docs/page.md", "# Page\n\n## One\n\nSee `docs/page.md`, \"Two\".\n"),
    ("references", "docs/x.md", "[there](nothing.md)\n"),
    ("references", "docs/x.md", "Call `exmat_body_fly`.\n"),
    ("references", "docs/x.md", "Set `EXMAT_NO_SUCH_OPTION=1`.\n"),
    ("references", "docs/x.md", "As `FlyingBody` does, `tests/rules` shows.\n"),
    ("references", "docs/x.md", "| message | cause |\n| --- | --- |\n| `no ... prints this` | none |\n"),
    ("columns", "docs/studies/x.md", "word " * 24 + "words\n"),
    ("columns", "README.md", "    exmat-runtime " + "word " * 24 + "\n"),
    ("references", "docs/x.md", "# X\n\n[there](#nothing)\n"),
    ("references", "docs/x.md", "Call `exmat-runtime walk SCENE.json`.\n"),
    ("references", "docs/page.md", "```\nexmat-runtime run SCENE.json --backwards\n```\n"),
    ("references", "tests/rules/x.py", '"""As in docs/nothing.md."""\n'),
    ("references", "tests/run.sh", "# as tests/nothing/at_all does\n"),
    ("top_level", "scratch/x.txt", "\n"),
    ("formatting", "common/core/x.cpp", "int  f( ) {return 1 ;}\n"),
    ("references", "common/core/x.h", "// docs/nowhere.md.\n"),
    ("references", "common/core/x.h", "// As\n// nowhere.md says.\n"),
    ("references", "docs/page.md", "# Page\n## 1. One\n\ndocs/page.md, section 2\n"),
    ("references", "docs/page.md", "# Page\n## 1. One\n\ndocs/page.md, sections 1 and 2\n"),
    ("references", "docs/page.md", '# Page\n## 1. One\n\ndocs/page.md, "Two"\n'),
    ("references", "docs/page.md", "# Page\n1. One\n\ndocs/page.md, step 2\n"),
    ("references", "common/core/x.h", "/* As common/core/nowhere.h does. */\n"),
    ("references", "common/core/x.h", "// By nowhere.h.\n"),
    ("references", "common/CMakeLists.txt", "# tests/nowhere lists them.\n"),
    ("references", "tests/x.py", '"""As tests/nowhere does."""\n'),
    ("references", "tests/x.sh", "#!/bin/sh\n# As tests/{x.sh,nowhere} do.\n"),
    ("references", "docs/page.md", "Do\n\n    ../tools/nowhere.py\n"),
    ("references", "tests/page.md", "Do\n\n    tests/page.md --write\n"),
    ("references", "docs/page.md", "[words](nowhere.md)\n"),
    ("references", "docs/page.md", "# Page\n[words](page.md#two)\n"),
    ("references", "docs/page.md", "# Page\n[words](#two)\n"),
    ("references", "docs/page.md", "`exmat-runtime fly SCENE.json`\n"),
    ("references", "docs/page.md", "Do\n\n    mpirun -n 2 exmat-precompute fly\n"),
    ("references", "docs/page.md", "Do\n\n    exmat-precompute ASSET.json\n        [--fly]\n"),
]

HARMLESS = [
    ("precompute/study/measure/x.cpp", '#include "runtime/output/trajectory_rows.h"\n#include "runtime/scene/bodies.h"\n'),
    ("precompute/targets/x.cpp", '#include "runtime/sim/examples/target.h"\n'),
    ("runtime/sim/step/x.h", "// throw nothing, try nothing\n#include <Eigen/Core>\n#include <cmath>\n"),
    ("precompute/modes/x.cpp", '#include "common/core/decompositions.h"\n\nauto x = matrix.llt();\n'),
    ("common/hdf5/x.cpp", "#include <hdf5.h>\n"),
    ("precompute/solvers/x.cpp", "#include <petscmat.h>\n"),
    ("runtime/include/exmat/x.h", "#include <stdint.h>\n"),
    ("runtime/include/exmat/x.hpp", '#include <vector>\n\n#include "exmat/exmat.h"\n'),
    ("runtime/python/x.cpp", '#include <exmat/exmat.hpp>\n#include <pybind11/stl.h>\n\n#include "runtime/python/objects.h"\n'),
    ("docs/x.md", "| " + "word " * 30 + "|\n\n```\n" + "word " * 30 + "\n```\n\n[" + "word " * 30 + "](x.md)\n" + "word " * 23 + "words\n"),
    ("docs/x.md", "# X\n\n## 1. One (`docs`)\n\n[there](x.md#1-one-docs), docs/x.md, \"One\", docs/x.md, section 1, `docs/{x,x}.md`, NAME.vtk, docs/PAGE.md\n"),
    ("common/core/x.h", "/// Of common/core/x.h, <vector.h> and x.h. A car.veg, tests/NAME.cpp.\n"),
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
        found = [name for name in ("mpi", "petsc", "slepc", "mumps", "glfw", "epoxy", "libgl.") if name in libraries.lower()]
        return found + ([] if "libhdf5_serial" in libraries else ["no serial HDF5"])

    @staticmethod
    def foreign_symbols(library):
        """Names that a library defines for others beside its C interface."""
        lines = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True).stdout
        return [line for line in lines.splitlines() if not line.split()[-1].startswith("exmat_")]

    def test_of_the_run_time(self):
        self.assertEqual(self.faults(BUILD / "bin/exmat-runtime"), [])

    def test_of_the_library(self):
        library = BUILD / "lib/libexmat_runtime.so"
        self.assertEqual(self.faults(library), [])
        self.assertEqual(self.foreign_symbols(library), [])
        symbols = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True).stdout
        header = "".join(path.read_text() for path in sorted((ROOT / "runtime/include/exmat").glob("*.h")))
        for name in re.findall(r"\b(exmat_[a-z_]+)\(", rules.without_comments_and_strings(header)):
            self.assertRegex(symbols, rf" T {name}\b")

    def test_catches_a_library_that_shows_its_insides(self):
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder) / "x.cpp", Path(folder) / "x.so"
            source.write_text('extern "C" void exmat_x() {}\nvoid inside() {}\n')
            subprocess.run(["c++", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
            self.assertEqual(len(self.foreign_symbols(library)), 1)

    @unittest.skipUnless((BUILD / "bin/exmat-precompute").exists(), "built without the offline stage")
    def test_catches_a_program_that_links_the_offline_stage(self):
        self.assertIn("petsc", self.faults(BUILD / "bin/exmat-precompute"))


class Naming(unittest.TestCase):
    """Names as .clang-tidy asks for them, in every source that is compiled."""

    BAD = """struct bad_type {
  int Function();
};
constexpr int limit = 1;
enum class Colour { red };
class Kept {
  int bare;
};
template <class T>
int Inner(T value) {
  constexpr int most = 2;
  struct local_type {
    int x;
  };
  return local_type{most}.x + value;
}
"""
    GOOD = """// NOLINTBEGIN(readability-identifier-naming): of another library
struct foreign_type {
  virtual int Call();
};
// NOLINTEND(readability-identifier-naming)
struct Own : foreign_type {
  Own() = default;
  bool operator==(const Own&) const = default;
  int Call() override;
};
template <class T>
inline constexpr T kZero = 0;
"""

    def test_holds_in_the_project(self):
        self.assertEqual(naming.violations(ROOT, BUILD), [])

    def planted(self, files, unity=False):
        """Violations of a project of these sources, each a unit, or one of all."""
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder).resolve()
            shutil.copy(ROOT / ".clang-tidy", root)
            for name, text in files.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)
            units = [root / name for name in files if name.endswith(".cpp")]
            if unity:
                (root / "Unity").mkdir()
                (root / "Unity/unity.cxx").write_text("".join(f'#include "{unit}"\n' for unit in units))
                units = [root / "Unity/unity.cxx"]
            commands = [{"file": str(unit), "command": f"c++ -std=c++20 -I{root} -o x.o -c {unit}"} for unit in units]
            (root / "compile_commands.json").write_text(json.dumps(commands))
            return "\n".join(naming.violations(root, root))

    def test_catches_planted_violations(self):
        for units in (1, naming.SHARED):  # the header of many is precompiled
            files = {f"common/core/x{k}.cpp": '#include "common/core/x.h"\n' for k in range(units)}
            files |= {"common/core/x.h": "#pragma once\n" + self.BAD, "runtime/sim/y.cpp": "int good();\nint Bad();\n"}
            found = self.planted(files)
            for name in ("type bad_type", "function Function", "constant limit", "constant red", "member bare",
                         "function Inner", "constant most", "type local_type", "function Bad"):
                self.assertEqual(found.count(name), 1, name)
            self.assertNotIn("error", found)

    def test_let_sound_names_pass(self):
        self.assertEqual(self.planted({"common/core/x.cpp": self.GOOD}), "")

    def test_reads_the_sources_of_a_unity_build(self):
        self.assertIn("limit", self.planted({"common/core/x.h": self.BAD, "common/x.cpp": '#include "common/core/x.h"\n'}, unity=True))

    def test_reports_what_does_not_compile(self):
        self.assertIn("error", self.planted({"common/a.cpp": "int f( {\n"}))


class RuntimeAlone(unittest.TestCase):
    """-DEXMAT_BUILD_PRECOMPUTE=OFF configures where PETSc, SLEPc and MPI cannot be found, and its commands are those that built the run
    time here: what compiles and links here does so there."""

    @staticmethod
    def commands(folder):
        """What builds the program and the library, with the build folder left out."""
        folder = folder.resolve()
        lines = subprocess.run(["ninja", "-C", str(folder), "-t", "commands", "bin/exmat-runtime", "lib/libexmat_runtime.so"],
                               capture_output=True, text=True, check=True).stdout.splitlines()
        here = re.compile(rf"{re.escape(str(folder))}/?|\S*ccache |--build-dir=\S+")
        paths = [here.sub("", line).replace(os.path.relpath(ROOT, folder) + "/", str(ROOT) + "/") for line in lines]
        return {line for line in paths if "cmake -E" not in line or " && " in line}

    @staticmethod
    def cached(name):
        match = re.search(rf"^{name}:\w+=(.*)$", (BUILD / "CMakeCache.txt").read_text(), re.M)
        return f"-D{name}={match.group(1)}"

    def test_is_built_by_the_same_commands(self):
        with tempfile.TemporaryDirectory() as folder:
            blind = dict(os.environ, PKG_CONFIG_PATH="/nowhere")
            options = ["-DEXMAT_BUILD_PRECOMPUTE=OFF", "-DEXMAT_BUILD_TESTS=OFF", "-DCMAKE_DISABLE_FIND_PACKAGE_MPI=ON",
                       self.cached("CMAKE_BUILD_TYPE"), self.cached("EXMAT_SANITIZE"), self.cached("CMAKE_UNITY_BUILD"), self.cached("CMAKE_CXX_COMPILER")]
            subprocess.run(["cmake", "-S", str(ROOT), "-B", folder, "-GNinja", *options], check=True, env=blind, capture_output=True)
            alone = self.commands(Path(folder))
        self.assertGreater(len([line for line in alone if " -c " in line]), 20)
        self.assertTrue(any("exmat-runtime" in line and " -o bin/exmat-runtime" in line for line in alone))
        self.assertEqual(alone - self.commands(BUILD), set())
        foreign = [line for line in alone if re.search(r"petsc|slepc|openmpi|precompute", line)]
        self.assertEqual(foreign, [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
