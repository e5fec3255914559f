#!/usr/bin/python3
"""The Debian packages: what they depend on, what they hold, and that their programs run.

Usage: test_packages.py BUILD_FOLDER
"""
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

BUILD = Path(sys.argv.pop(1)).resolve()
ROOT = Path(__file__).resolve().parents[3]
PYTHON = (BUILD / "python/exmat").is_dir()
OFFLINE = (BUILD / "bin/exmat-precompute").exists()
VIEWER = (BUILD / "bin/exmat-viewer").exists()
MESHING = (BUILD / "lib/exmat/exmat-mesher.so").exists()


def output_of(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        made = Path(cls.folder.name) / "made"
        output_of("cpack", "--config", str(BUILD / "CPackConfig.cmake"), "-B", str(made))
        cls.packages = {path.name.split("_")[0]: path for path in made.glob("*.deb")}

    def depends(self, name):
        return output_of("dpkg-deb", "--field", str(self.packages[name]), "Depends")

    def unpacked(self, name):
        target = Path(self.folder.name) / name
        output_of("dpkg-deb", "--extract", str(self.packages[name]), str(target))
        return target

    def files(self, root):
        return {str(path.relative_to(root)) for path in root.rglob("*") if not path.is_dir()}

    def test_one_for_each_stage(self):
        built = {"exmat-runtime": True, "exmat-doc": True, "exmat-precompute": OFFLINE, "exmat-meshing": MESHING, "exmat-viewer": VIEWER,
                 "python3-exmat": PYTHON}
        self.assertEqual(set(self.packages), {name for name, is_built in built.items() if is_built})

    def man_pages(self, program, *commands):
        """Files of the pages of a program and of its commands."""
        names = [program, *(f"{program}-{command}" for command in commands)] if shutil.which("help2man") else []
        return {f"usr/share/man/man1/{name}.1.gz" for name in names}

    @unittest.skipUnless(shutil.which("help2man"), "built without man pages")
    def test_man_pages_say_what_help_says(self):
        pages = self.unpacked("exmat-runtime") / "usr/share/man/man1"
        self.assertEqual({f"usr/share/man/man1/{page.name}" for page in pages.iterdir()},
                         self.man_pages("exmat-runtime", "run", "bench", "export", "info", "pack", "validate"))
        text = output_of("man", "-l", str(pages / "exmat-runtime-run.1.gz"))
        for option in re.findall(r"--[a-z-]+", output_of(str(BUILD / "bin/exmat-runtime"), "run", "--help")):
            self.assertIn(option, text)
        self.assertNotIn(str(BUILD), text)

    def test_pages_schemas_and_examples_link_to_each_other(self):
        root = self.unpacked("exmat-doc") / "usr/share/doc/exmat-doc"
        self.assertEqual({path.name for path in (ROOT / "schemas").iterdir()}, {path.name for path in (root / "schemas").iterdir()})
        for page in root.rglob("*.md"):
            for target in re.findall(r"\]\(([^)#\s:]+)(?:#[^)]*)?\)", page.read_text()):
                inside = not re.search(r"(^|/)(CONTRIBUTING.md|LICENSE|tests|runtime|precompute|common)\b", target)
                self.assertTrue(not inside or (page.parent / target).exists(), f"{page.relative_to(root)}: {target}")

    def test_the_run_time_needs_neither_mpi_nor_petsc(self):
        depends = self.depends("exmat-runtime")
        self.assertIn("libhdf5", depends)
        for foreign in ("mpi", "petsc", "slepc", "mumps", "exmat-precompute"):
            self.assertNotIn(foreign, depends)

    def test_the_run_time_holds_program_library_and_headers(self):
        root = self.unpacked("exmat-runtime")
        files = self.files(root)
        self.assertIn("usr/bin/exmat-runtime", files)
        self.assertIn("usr/include/exmat/exmat.h", files)
        self.assertIn("usr/share/doc/exmat-runtime/copyright", files)
        self.assertTrue(any(name.endswith("exmat-config.cmake") for name in files))
        self.assertFalse(any("precompute" in name or "python" in name for name in files))
        self.assertIn("HDF5", output_of(str(root / "usr/bin/exmat-runtime"), "--version"))

    @unittest.skipUnless(OFFLINE, "built without the offline stage")
    def test_the_offline_stage_is_its_program(self):
        self.assertIn("petsc", self.depends("exmat-precompute"))
        root = self.unpacked("exmat-precompute")
        self.assertEqual(self.files(root), {"usr/bin/exmat-precompute", "usr/share/doc/exmat-precompute/copyright",
                                            *self.man_pages("exmat-precompute", "new", "bundle", "check", "mesh", "study", "full-space")})
        self.assertIn("SLEPc", output_of(str(root / "usr/bin/exmat-precompute"), "--version"))

    @unittest.skipUnless(MESHING, "built without the mesher")
    def test_the_mesher_is_a_module_with_its_own_licence(self):
        self.assertNotIn("gmp", self.depends("exmat-precompute"))
        root = self.unpacked("exmat-meshing")
        self.assertEqual(self.files(root), {"usr/lib/exmat/exmat-mesher.so", "usr/share/doc/exmat-meshing/copyright"})
        self.assertIn("GPL-3", (root / "usr/share/doc/exmat-meshing/copyright").read_text())
        alone = self.unpacked("exmat-precompute") / "usr/bin/exmat-precompute"
        self.assertIn("mesher: none", output_of(str(alone), "--version"))
        beside = output_of("env", f"EXMAT_MESHER_FOLDER={root / 'usr/lib/exmat'}", str(alone), "--version")
        self.assertIn("mesher: CGAL", beside)

    @unittest.skipUnless(VIEWER, "built without the viewer")
    def test_the_viewer_is_its_program_on_the_run_times_library(self):
        depends = self.depends("exmat-viewer")
        self.assertIn("exmat-runtime (= ", depends)
        self.assertIn("libglfw3", depends)
        for window in ("libglfw", "libepoxy", "libGL"):
            self.assertNotIn(window, self.depends("exmat-runtime"))
        root, library = self.unpacked("exmat-viewer"), next(self.unpacked("exmat-runtime").rglob("libexmat_runtime.so.*"))
        self.assertEqual(self.files(root), {"usr/bin/exmat-viewer", "usr/share/doc/exmat-viewer/copyright", *self.man_pages("exmat-viewer")})
        found = subprocess.run([str(root / "usr/bin/exmat-viewer"), "--version"], capture_output=True, text=True, check=True,
                               env={"LD_LIBRARY_PATH": str(library.parent)}).stdout
        self.assertIn("exmat-viewer", found)

    @unittest.skipUnless(PYTHON, "built without the Python package")
    def test_the_python_package_runs_on_the_run_times_library(self):
        depends = self.depends("python3-exmat")
        self.assertIn("exmat-runtime (= ", depends)
        self.assertIn("python3-numpy", depends)
        self.assertNotIn("petsc", depends)
        root, library = self.unpacked("python3-exmat"), next(self.unpacked("exmat-runtime").rglob("libexmat_runtime.so.*"))
        place = root / "usr/lib/python3/dist-packages"
        self.assertIn("usr/lib/python3/dist-packages/exmat/py.typed", self.files(root))
        self.assertEqual(len(list(place.glob("exmat/_exmat*.so"))), 1)
        script = "import exmat; print(exmat.__file__, exmat.Body.step.__doc__)"
        found = subprocess.run(["/usr/bin/python3", "-c", script], capture_output=True, text=True, check=True,
                               env={"PYTHONPATH": str(place), "LD_LIBRARY_PATH": str(library.parent)}).stdout
        self.assertIn(str(place), found)
        self.assertIn("NonFinite", found)


if __name__ == "__main__":
    unittest.main(verbosity=2)
