#!/usr/bin/python3
"""Commands and their files: no output over an input or over another output, nothing left after a signal, a full limit or a
full standard output, and nothing taken from the folder that a user happens to stand in.

Usage: test_command_files.py FOLDER_OF_PROGRAMS
"""
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from programs import Glb, bar, write_json  # noqa: E402

PROGRAMS = Path(sys.argv.pop(1)).resolve()
PRECOMPUTE, RUNTIME = PROGRAMS / "exmat-precompute", PROGRAMS / "exmat-runtime"
SURFACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


class Commands(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.made = Path(holder.name)
        mesh, clamped = bar()
        (cls.made / "bar.veg").write_text(mesh)
        asset = {"name": "bar", "object": {"mesh": "bar.veg", "fixed": {"ids": clamped},
                                           "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000}},
                 "basis": {"size": 3, "linear_modes": 2}, "cubature": {"elements": 3, "training_poses": 10}}
        write_json(cls.made / "asset.json", asset)
        (cls.made / "ground.obj").write_text("v -9 -9 -3\nv 9 -9 -3\nv 0 9 -3\nf 1 2 3\n")
        (cls.made / "surface.obj").write_text(SURFACE)
        write_json(cls.made / "scene.json", {"bundle": "bar.h5", "steps": 3, "gravity": [0, 0, -9.81], "output": {"every": 1}})
        contact = {"bundle": "bar.h5", "steps": 3, "obstacles": [{"mesh": {"file": "ground.obj", "thickness": 0.1}}]}
        write_json(cls.made / "contact.json", contact)
        cls.command(cls, "bundle", "asset.json", "-o", "bar.h5", folder=cls.made)

    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name).resolve()
        shutil.copytree(self.made, self.folder, dirs_exist_ok=True)

    def command(self, name, *words, folder=None, status=0, **options):
        program = RUNTIME if name in ("run", "bench", "export", "info", "validate", "pack") else PRECOMPUTE
        done = subprocess.run([program, name, *map(str, words)], cwd=folder or self.folder, text=True, timeout=120,
                              **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options})
        assert done.returncode == status, f"{name} {words}: status {done.returncode}, expected {status}\n{done.stdout}{done.stderr}"
        return done.stderr

    def contents(self):
        return {path.name: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}

    def refused(self, *words, said=(), unsaid=()):
        """The command ends with status 2, one message, and every file as it was."""
        before = self.contents()
        errors = self.command(*words, status=2)
        self.assertEqual(self.contents(), before, words)
        messages = [line for line in errors.splitlines() if line.startswith("exmat-")]
        self.assertEqual(len(messages), 1, errors)
        for text in said:
            self.assertIn(text, messages[0])
        for text in unsaid:
            self.assertNotIn(text, messages[0])

    def test_no_output_is_written_over_an_input(self):
        bundle = self.folder / "bar.h5"
        (self.folder / "link.h5").symlink_to("bar.h5")
        (self.folder / "hard.h5").hardlink_to(bundle)
        (self.folder / "sub").mkdir()
        for name in ("bar.h5", bundle, "./sub/../bar.h5", "link.h5", "hard.h5"):
            self.refused("run", "scene.json", "-o", name, said=["does not read", "-o"])
            self.refused("run", "scene.json", "--dump-state", name, said=["--dump-state"])
            self.refused("full-space", "scene.json", "-o", name, said=["-o"])
            self.refused("pack", "bar.h5", "-o", name, said=["does not read", "-o"])
        for option in ("-o", "--dump-state"):
            self.refused("run", "scene.json", option, "scene.json", said=["scene.json", option])
            self.refused("run", "contact.json", option, "ground.obj", said=["ground.obj", option])
        self.refused("full-space", "scene.json", "-o", "scene.json")
        self.refused("pack", "bar.h5", "-o", "scene.json", "--scene", "scene.json", said=["scene.json", "-o"])
        for words in (["-o", "bar.veg"], ["-o", "asset.json"], ["-o", "new.h5", "--report", "bar.veg"],
                      ["-o", "new.h5", "--report", "asset.json"], ["-o", "new.h5", "--depfile", "bar.veg"],
                      ["-o", "new.h5", "--scene", "contact.json", "--depfile", "contact.json"],
                      ["-o", "ground.obj", "--scene", "contact.json"]):
            self.refused("bundle", "asset.json", *words, said=["does not read"])
        self.refused("bundle", "surface.obj", "-o", "new.h5", "--write-asset", "surface.obj", said=["--write-asset"])
        (self.folder / "surface.msh").symlink_to("surface.obj")
        self.refused("mesh", "surface.obj", "-o", "surface.msh", said=["-o"])
        self.command("run", "scene.json", "-o", "t.h5")
        shutil.copy(self.folder / "t.h5", self.folder / "t.glb")
        self.refused("export", "t.glb", "-o", "t.glb", said=["-o"])
        (self.folder / "bar.glb").symlink_to("bar.h5")
        self.refused("export", "t.h5", "-o", "bar.glb", said=["-o"])

    def test_files_that_an_asset_names_are_inputs_also_where_they_are_not_read(self):
        """The scene has no examples, so that none is read."""
        asset = json.loads((self.folder / "asset.json").read_text())
        for name in ("rest.veg", "bent.veg"):
            shutil.copy(self.folder / "bar.veg", self.folder / name)
        (self.folder / "part.txt").write_text("1, 2\n")
        asset |= {"examples": [{"name": "rest", "mesh": "rest.veg", "rest": True}, {"name": "bent", "mesh": "bent.veg"}],
                  "regions": [{"name": "part", "vertices": {"file": "part.txt"}, "examples": ["bent"]}]}
        write_json(self.folder / "examples.json", asset)
        for name in ("rest.veg", "bent.veg", "part.txt"):
            for outputs in (["-o", name], ["-o", "new.h5", "--report", name], ["-o", "new.h5", "--depfile", name]):
                self.refused("bundle", "examples.json", "--scene", "scene.json", *outputs, said=[name, "does not read"])

    def test_nothing_but_an_earlier_output_is_replaced(self):
        """Files that no command reads, as those that the bundle of a scene was made of, or a model that a .glb is exported beside."""
        self.command("run", "scene.json", "-o", "t.h5", "--dump-state", "state.json")
        self.command("bundle", "asset.json", "-o", "other.h5", "--report", "report.json", "--depfile", "bar.d")
        Glb().write(self.folder / "model.glb")
        (self.folder / "kept.xdmf").write_text("<Xdmf/>")
        (self.folder / "kept.msh").write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n")
        (self.folder / "to").symlink_to("bar.veg")
        for name, found in (("asset.json", "a JSON file"), ("bar.veg", "a .veg mesh"), ("to", "a .veg mesh"), ("state.json", "a JSON file"), ("other.h5", "an exmat-bundle")):
            for command in ("run", "full-space"):
                self.refused(command, "scene.json", "-o", name, said=[f"{name}: -o: expected a trajectory to replace, or the name of a new file, found {found}"])
        for command in ("run", "full-space"):
            self.refused(command, "scene.json", "-o", "kept.h5", said=["kept.xdmf: the .xdmf beside -o: expected an .xdmf to replace"])
        for name in ("asset.json", "bar.veg", "t.h5"):
            self.refused("run", "scene.json", "--dump-state", name, said=["--dump-state: expected a state file to replace"])
        for name in ("scene.json", "ground.obj", "t.h5", "report.json"):
            self.refused("bundle", "asset.json", "-o", name, said=["-o: expected a bundle to replace"])
            self.refused("pack", "bar.h5", "-o", name, said=["-o: expected a pack to replace"])
        for option, name, said in (("--report", "scene.json", "a report"), ("--report", "ground.obj", "a report"), ("--depfile", "scene.json", "a depfile"), ("--depfile", "ground.obj", "a depfile")):
            self.refused("bundle", "asset.json", "-o", "new.h5", option, name, said=[f"{option}: expected {said} to replace"])
        self.refused("mesh", "surface.obj", "-o", "kept.msh", said=["-o: expected a mesh in the format .msh 2.2 to replace"])
        self.refused("export", "t.h5", "-o", "model.glb", said=["-o: expected a .glb of exmat-runtime to replace", "found that of another program"])
        for ending in (".glb", ".usda", ".pc2"):
            shutil.copy(self.folder / "ground.obj", self.folder / ("kept" + ending))
            self.refused("export", "t.h5", "-o", "kept" + ending, said=["to replace, or the name of a new file"])

    def test_earlier_outputs_are_replaced(self):
        for name in ("t.h5", "t.xdmf", "state.json", "report.json", "bar.d", "bar.exmat", "t.glb", "t.usda", "t.pc2", "tets.msh"):
            (self.folder / name).touch()
        for _ in range(2):
            self.command("bundle", "asset.json", "-o", "bar.h5", "--report", "report.json", "--depfile", "bar.d")
            self.command("run", "scene.json", "-o", "t.h5", "--dump-state", "state.json")
            self.command("pack", "bar.h5", "-o", "bar.exmat")
            self.command("mesh", "surface.obj", "-o", "tets.msh", "--cells", 50)
            for ending in (".glb", ".usda", ".pc2"):
                self.command("export", "t.h5", "-o", "t" + ending)
            self.command("full-space", "scene.json", "-o", "t.h5")
        damaged = (self.folder / "bar.h5").read_bytes()[:3000]
        (self.folder / "bar.h5").write_bytes(damaged)
        self.command("bundle", "asset.json", "-o", "bar.h5")

    def test_a_body_where_numbers_lose_its_shape_is_warned_of(self):
        asset = json.loads((self.folder / "asset.json").read_text())
        del asset["object"]["fixed"]
        write_json(self.folder / "free.json", asset)
        self.command("bundle", "free.json", "-o", "free.h5")
        for place, said in ((4.5e15, "starts 4.5e+15 m from the origin"), (1e30, "starts 1e+30 m from the origin"), (100, "")):
            write_json(self.folder / "far.json", {"bundle": "free.h5", "steps": 3, "body": {"position": [0, place, 0]}})
            errors = self.command("run", "far.json")
            self.assertEqual("from the origin" in errors, bool(said), errors)
            self.assertIn(said, errors)

    def test_a_pack_steps_as_its_bundle(self):
        self.command("pack", "bar.h5", "-o", "whole.exmat")
        self.command("pack", "bar.h5", "-o", "least.exmat", "--scene", "scene.json")
        whole, least = ((self.folder / name).stat().st_size for name in ("whole.exmat", "least.exmat"))
        self.assertLess(least, whole)
        scene = json.loads((self.folder / "scene.json").read_text())
        states = []
        for name in ("bar.h5", "whole.exmat", "least.exmat"):
            write_json(self.folder / "packed.json", {**scene, "bundle": name})
            self.command("run", "packed.json", "--dump-state", "state.json")
            states.append(json.loads((self.folder / "state.json").read_text())["bodies"])
            self.command("validate", name)
            self.command("info", name)
        self.assertEqual(states[1:], states[:1] * 2)
        self.refused("pack", "whole.exmat", "-o", "again.exmat", said=["found a pack"])
        (self.folder / "cut.exmat").write_bytes((self.folder / "whole.exmat").read_bytes()[:-1])
        self.refused("info", "cut.exmat", said=["cut short by 1 bytes"])

    def test_a_study_keeps_its_inputs(self):
        study = {"name": "small", "asset": "recommended_asset.json", "scene": "scene.json", "sweeps": [{"basis_size": [3]}]}
        shutil.copy(self.folder / "asset.json", self.folder / "recommended_asset.json")
        write_json(self.folder / "results.json", study)
        self.refused("study", "results.json", "-o", ".", said=["results.json", "does not read"])
        write_json(self.folder / "study.json", study)
        self.refused("study", "study.json", "-o", ".", said=["recommended_asset.json", "does not read"])
        shutil.copy(self.folder / "scene.json", self.folder / "stability.json")
        self.refused("study", "--stability", "stability.json", "-o", ".", said=["stability.json", "does not read"])

    def test_a_failure_writes_its_report_over_no_other_file(self):
        """The asset fails before the mesh of the report's name is read."""
        (self.folder / "broken.json").write_text('{"name": "x", "object": {"mesh": "bar.veg"}, "bass": 1}')
        before = self.contents()
        self.assertIn("is no report", self.command("bundle", "broken.json", "-o", "new.h5", "--report", "bar.veg", status=2))
        self.assertEqual(self.contents(), before)
        for _ in range(2):  # the second replaces that of the first
            self.command("bundle", "broken.json", "-o", "new.h5", "--report", "report.json", status=2)
        self.assertIn("bass", (self.folder / "report.json").read_text())

    def test_no_two_outputs_are_one_file(self):
        self.refused("bundle", "asset.json", "-o", "new.h5", "--depfile", "./new.h5", said=["--depfile", "-o"])
        self.refused("bundle", "asset.json", "-o", "new", "--report", "new", said=["--report", "that of -o"])
        self.refused("bundle", "asset.json", "-o", "new.h5", "--report", "x.d", "--depfile", "./x.d", said=["--report", "that of --depfile"])
        self.refused("bundle", "asset.json", "-o", "new.h5", "--cache", "new.h5", said=["--cache", "that of -o"])
        self.refused("run", "scene.json", "-o", "t.h5", "--dump-state", "t.xdmf", said=["--dump-state", ".xdmf"])
        self.refused("run", "scene.json", "-o", "t.h5", "--dump-state", "t.h5", said=["--dump-state"])
        self.refused("run", "scene.json", "-o", "t.xdmf", said=[".xdmf", ".h5"])
        self.refused("full-space", "scene.json", "-o", "t.xdmf", said=[".xdmf", ".h5"])
        (self.folder / "to").symlink_to("t.h5")
        self.refused("run", "scene.json", "-o", "t.h5", "--dump-state", "to", said=["--dump-state"])

    def test_folders_are_no_files(self):
        for words in (["bundle", "asset.json", "-o", "new.h5", "--cache", "bar.veg"], ["bundle", "asset.json", "-o", "new.h5", "--alignment-report", "bar.veg"],
                      ["study", "study.json", "-o", "bar.veg"], ["study", "--stability", "scene.json", "-o", "scene.json"]):
            self.refused(*words, said=[words[-2], "expected a folder"])

    def test_outputs_have_a_folder_before_any_work(self):
        """Runs of as many steps would not end."""
        write_json(self.folder / "long.json", {"bundle": "bar.h5", "steps": 10 ** 12})
        (self.folder / "dangling.h5").symlink_to("nodir/x.h5")
        bundle = ["bundle", "asset.json", "-o", "new.h5"]
        for name in ("nodir/x.h5", "dangling.h5", "asset.json/x.h5"):
            for words in (["run", "long.json", "-o", name], ["run", "long.json", "--dump-state", name], ["full-space", "long.json", "-o", name],
                          ["bundle", "asset.json", "-o", name], ["mesh", "surface.obj", "-o", name], ["pack", "bar.h5", "-o", name],
                          ["export", "bar.h5", "-o", name], [*bundle, "--report", name], [*bundle, "--depfile", name],
                          ["bundle", "surface.obj", "-o", "new.h5", "--write-asset", name]):
                self.refused(*words, said=[words[-2], "expected a name in a folder that exists, found no folder"])
        for option in ("-o", "--dump-state"):
            self.refused("run", "long.json", option, "new.h5/", said=[option, "found the name of a folder"])
        self.refused(*bundle, "--cache", "new.h5/", said=["--cache", "that of -o"])
        for name in ("asset.json/x", "asset.json/x/y", "/proc/x"):
            for words in ([*bundle, "--cache", name], [*bundle, "--alignment-report", name], ["check", "asset.json", "--alignment-report", name],
                          ["study", "study.json", "-o", name], ["study", "--stability", "scene.json", "-o", name], ["new", "surface.obj", "-o", name]):
                self.refused(*words, said=[words[-2], "expected a folder, or one that can be made"])
        self.command(*bundle, "--cache", "some/new/folder/")

    def test_outputs_are_files(self):
        """Before any work: runs of as many steps would not end."""
        write_json(self.folder / "long.json", {"bundle": "bar.h5", "steps": 10 ** 12})
        os.mkfifo(self.folder / "pipe.h5")
        for name in ("/dev/null", "pipe.h5", "."):
            for words in (["run", "long.json", "--dump-state", name], ["run", "long.json", "-o", name], ["pack", "bar.h5", "-o", name],
                          ["bundle", "asset.json", "-o", "new.h5", "--report", name], ["bundle", "asset.json", "-o", "new.h5", "--depfile", name]):
                self.refused(*words, said=[words[-2], "a file, or the name of a new one"])

    def test_options_that_no_solver_takes_are_said(self):
        for option, value in (("--eps-max_it", "0"), ("--eps-tol", "nan"), ("--eps-ncv", "1"), ("--st-type", "foo"), ("--eps-nev", "x")):
            self.refused("bundle", "asset.json", "-o", "new.h5", option, value,
                         said=[f"command line: {option.replace('_', '-')} {value}: expected options by which", "mend their values"], unsaid=["PETSc", "http"])
        # Eigenpairs that are found, but not exact.
        asset = json.loads((self.folder / "asset.json").read_text())
        asset["object"].pop("fixed")
        write_json(self.folder / "free.json", {**asset, "basis": {"size": 15, "training": "none"}})
        self.refused("bundle", "free.json", "-o", "new.h5", "--eps-tol", "1", said=["command line: --eps-tol 1: expected options by which"], unsaid=["16 digits"])
        for kind in ("lapack", "foo", "ciss"):
            self.refused("bundle", "asset.json", "-o", "new.h5", "--eps-type", kind, said=["--eps-type: expected one of krylovschur", f"'{kind}'"])

    def test_values_of_options_are_asked_for_in_words(self):
        for option in ("--cache", "--depfile", "--report", "--scene"):
            for word in (f"{option}=", option):
                self.refused("bundle", "asset.json", "-o", "new.h5", word, said=[f"{option}: expected a path, found none; give one, or leave"])
        self.refused("bundle", "asset.json", "-o", "new.h5", "--eigensolver", "x", said=["--eigensolver: x not in {auto,direct,gamg,lobpcg,mixed}"])
        for value in ("1e3", "1.5", "x", "0", "-1"):
            self.refused("run", "scene.json", "--steps", value, said=[f"--steps: expected a whole number from 1 to 1000000000000, found '{value}'"])
        self.refused("run", "scene.json", "--steps=", said=["--steps: expected a value, found none"])

    def test_options_of_the_solvers_write_no_files(self):
        for option in ("--eps-view", "--eps-monitor", "--st-ksp-view", "--eps-view-values"):
            self.refused("bundle", "asset.json", "-o", "new.h5", option, "ascii:bar.veg", said=["writes no file", option[2:]])

    def test_a_name_may_be_as_long_as_the_system_takes(self):
        name = 250 * "x" + ".h5"
        self.command("run", "scene.json", "-o", name)
        self.assertTrue((self.folder / name).exists())

    def test_what_is_no_mesh_is_called_by_its_name(self):
        for ending in (".dae", ".abc", ".off", ".vtu", ".inp", ".step"):
            (self.folder / f"x{ending}").write_text("<?xml ?>")
            self.assertIn(f"found '{ending}'", self.command("bundle", f"x{ending}", "-o", "new.h5", status=2))

    def test_memory_that_runs_out_ends_the_command(self):
        """Threads of a library that could not be made were waited for at the end."""
        for most in (150, 200, 250, 300):
            def limit():
                resource.setrlimit(resource.RLIMIT_AS, (most << 20, most << 20))
            done = subprocess.run([PRECOMPUTE, "bundle", "asset.json", "-o", "new.h5"], cwd=self.folder, text=True, timeout=60, capture_output=True,
                                  preexec_fn=limit)
            self.assertNotEqual(done.returncode, 0)

    def test_an_unchanged_bundle_is_its_own_output(self):
        self.assertIn("nothing to do", self.command("bundle", "asset.json", "-o", "bar.h5", "--if-changed"))

    def test_links_that_lead_to_each_other_are_refused(self):
        (self.folder / "a").symlink_to("b")
        (self.folder / "b").symlink_to("a")
        for option in ("-o", "--dump-state"):
            self.refused("run", "scene.json", option, "a", said=["a: expected a name, or links that lead to one, found links that lead to each other"])
        self.assertEqual([os.readlink(self.folder / name) for name in ("a", "b")], ["b", "a"])

    def test_a_link_stays_a_link(self):
        (self.folder / "link.h5").symlink_to("real.h5")
        for _ in range(2):
            self.command("run", "scene.json", "-o", "link.h5")
            self.assertTrue((self.folder / "link.h5").is_symlink())
            self.assertGreater((self.folder / "real.h5").stat().st_size, 1000)

    def test_nothing_comes_from_the_current_folder_or_the_environment(self):
        """PETSc would load a library and write a file where these options reached it."""
        options = "-dll_append ./evil.so\n-log_view :log.txt\n-options_view\n-no_such_option\n"
        for name in (".petscrc", "petscrc", ".slepcrc"):
            (self.folder / name).write_text(options)
        before = set(self.contents())
        errors = self.command("bundle", "asset.json", "-o", "new.h5",
                              env={**os.environ, "HOME": str(self.folder), "PETSC_OPTIONS": options.replace("\n", " ")})
        self.assertEqual(set(self.contents()) - before, {"new.h5"})
        self.assertNotIn("PETSc", errors)

    def test_a_folder_that_is_gone_is_said(self):
        gone = self.folder / "gone"
        before = self.contents()
        for program, *words in ((PRECOMPUTE, "bundle", self.folder / "asset.json", "-o", self.folder / "new.h5"),
                                (PRECOMPUTE, "new", self.folder / "surface.obj"),
                                (PRECOMPUTE, "new", self.folder / "surface.obj", "-o", self.folder / "begin"),
                                (RUNTIME, "run", self.folder / "scene.json", "-o", "t.h5")):
            gone.mkdir()
            done = subprocess.run(["bash", "-c", 'rmdir "$1"; shift; exec "$@"', "bash", gone, program, *words], cwd=gone, capture_output=True, text=True)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("current folder: expected a folder that exists", done.stderr)
        self.assertEqual(self.contents(), before)

    def test_a_full_standard_output_is_a_failure(self):
        with open("/dev/full", "w") as full:
            for words in (["run", "scene.json"], ["info", "bar.h5"], ["validate", "bar.h5"], ["bench", "scene.json", "--steps", 3],
                          ["check", "asset.json"], ["bundle", "asset.json", "-o", "new.h5"], ["run", "--help"], ["mesh", "--help"]):
                errors = self.command(*words, status=1, stdout=full)
                self.assertIn("standard output", errors, words)

    def test_signals_leave_no_temporary_file(self):
        write_json(self.folder / "long.json", {"bundle": "bar.h5", "steps": 10 ** 9, "output": {"every": 10 ** 6}})
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGALRM):
            process = subprocess.Popen([RUNTIME, "run", "long.json", "-o", "t.h5"], cwd=self.folder, stdout=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, text=True)
            for _ in range(500):
                if list(self.folder.glob("t.h5*.tmp")):
                    break
                time.sleep(0.02)
            process.send_signal(number)
            errors = process.communicate(timeout=60)[1]
            self.assertEqual(process.returncode, -number)
            self.assertIn(f"ended by {number.name}; not written: t.h5", errors)
            self.assertEqual(list(self.folder.glob("t.*")), [])

    def test_a_limit_of_file_sizes_is_a_failure(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        before = set(self.contents())
        for words in (["bundle", "asset.json", "-o", "new.h5"], ["run", "scene.json", "-o", "t.h5"]):
            self.assertIn("File too large", self.command(*words, status=1, preexec_fn=limit))
            self.assertEqual(set(self.contents()), before)

    def test_pipes_and_devices_are_no_inputs(self):
        os.mkfifo(self.folder / "pipe.json")
        os.mkfifo(self.folder / "pipe.veg")
        for name in ("pipe.json", "/dev/zero"):
            for command in ("run", "bench", "info"):
                self.assertIn("a pipe or a device", self.command(command, name, status=2))
            for command in (["check", name], ["bundle", "asset.json", "-o", "new.h5", "--scene", name], ["study", name, "-o", "s"]):
                self.assertIn("a pipe or a device", self.command(*command, status=2))
        write_json(self.folder / "piped.json", {"name": "bar", "object": {"mesh": "pipe.veg"}})
        self.assertIn("a pipe or a device", self.command("check", "piped.json", status=2))

    def test_json_ends_with_its_text(self):
        whole = (self.folder / "scene.json").read_bytes()
        for tail in (b"\0", b"\0 garbage", b" garbage", b"\x1a", b"}"):
            (self.folder / "tail.json").write_bytes(whole + tail)
            self.assertIn("tail.json: line 1, column", self.command("run", "tail.json", status=2))

    def test_values_that_are_none_are_refused(self):
        for option in ("--cache", "--depfile", "--report", "--scene", "--alignment-report", "--write-asset", "-o"):
            output = [] if option == "-o" else ["-o", "new.h5"]
            self.assertIn("an empty one", self.command("bundle", "asset.json", *output, option, "", status=2))
        for option in ("-o", "--dump-state", "--from-state"):
            self.assertIn("an empty one", self.command("run", "scene.json", option, "", status=2))
        for words in (["--stability", ""], [""]):  # in a group of options
            errors = self.command("study", *words, "-o", "s", status=2)
            self.assertIn(f"{'--stability' if words[0] else 'STUDY'}: expected a value, found an empty one", errors)
        for value in ("nan", "NaN", "-nan", "inf", "0", "-1", "1e400"):
            self.assertIn(f"found '{value}'", self.command("bundle", "asset.json", "-o", "new.h5", f"--training-budget={value}", status=2))
        self.assertIn("found 'nan'", self.command("mesh", "surface.obj", "-o", "new.msh", "--cell-size", "nan", status=2))
        self.assertIn("found 'nan'", self.command("export", "t.h5", "-o", "t.pc2", "--frame-rate", "nan", status=2))

    def test_usage_names_the_command_that_was_meant(self):
        def said(*words):
            return subprocess.run([PRECOMPUTE, *words], capture_output=True, text=True).stderr
        self.assertIn("did you mean bundle?", said("bundel", "asset.json"))
        self.assertIn("-o,--output is required", said("bundle", "asset.json"))
        for words, option, nearest in ((["bundle", "a.json", "--ouput", "x.h5"], "--ouput", "--output"),
                                       (["bundle", "a.json", "-o", "x.h5", "--cahce=y"], "--cahce", "--cache"),
                                       (["study", "--stabilty", "scene.json", "-o", "s"], "--stabilty", "--stability"),
                                       (["check", "a.json", "--thread", "2"], "--thread", "--threads")):
            self.assertIn(f"there is no option '{option}'; did you mean {nearest}?", said(*words))
        self.assertIn("there is no option '--zzzzzzzz'; see", said("check", "a.json", "--zzzzzzzz"))

    def test_a_missing_bundle_is_said_by_the_scenes_member(self):
        write_json(self.folder / "lost.json", {"bundle": "lost.h5"})
        for command in (["run", "lost.json"], ["bench", "lost.json"], ["full-space", "lost.json", "-o", "t.h5"]):
            errors = self.command(*command, status=2)
            self.assertIn("lost.json: /bundle: expected a bundle, found no such file", errors)

    def test_a_missing_file_is_said_by_the_member_that_names_it(self):
        scene, asset = (json.loads((self.folder / name).read_text()) for name in ("scene.json", "asset.json"))
        heights = {"file": "lost.csv", "spacing": [1, 1]}
        for members, said in (({"obstacles": [{"plane": {"normal": [0, 0, 1]}}, {"mesh": {"file": "lost.obj"}}]},
                               "/obstacles/1/mesh/file: expected a surface, found no such file: lost.obj"),
                              ({"obstacles": [{"height_field": heights}]},
                               "/obstacles/0/height_field/file: expected a text file of heights, found no such file: lost.csv"),
                              ({"forces": [{"vertices": {"file": "lost.txt"}, "force": [0, 0, 1]}]},
                               "/forces/0/vertices/file: expected a text file of vertex ids, found no such file: lost.txt")):
            write_json(self.folder / "lost.json", {**scene, **members})
            self.refused("run", "lost.json", said=["lost.json: " + said])
            self.refused("bundle", "asset.json", "--scene", "lost.json", "-o", "new.h5", said=["lost.json: " + said])
        pose = {"name": "bent", "mesh": "lost.veg"}
        for members, said in (({"object": {**asset["object"], "mesh": "lost.veg"}}, "/object/mesh: expected a mesh of tets, found no such file: lost.veg"),
                              ({"object": {**asset["object"], "render_mesh": "lost.obj"}},
                               "/object/render_mesh: expected a surface, found no such file: lost.obj"),
                              ({"examples": [{"name": "rest", "mesh": "bar.veg", "rest": True}, pose]},
                               "/examples/1/mesh: expected a mesh of tets, found no such file: lost.veg")):
            write_json(self.folder / "lost.json", {**asset, **members})
            self.refused("check", "lost.json", said=["lost.json: " + said])

    def test_other_files_are_called_by_their_kinds(self):
        self.command("pack", "bar.h5", "-o", "bar.exmat")
        (self.folder / "ascii.stl").write_text("solid x\nendsolid x\n")
        for name, kind in (("surface.obj", "an .obj surface"), ("ascii.stl", "an STL surface"), ("bar.veg", "a .veg mesh"), ("bar.exmat", "a pack of a bundle"),
                           ("bar.h5", "an HDF5 file")):
            self.refused("run", name, said=[f"{name}: expected a JSON file, found {kind}", "a scene names its bundle in a JSON file"])
        for name, kind in (("surface.obj", "an .obj surface"), ("scene.json", "a JSON file (a scene or an asset?)")):
            for words in (["info", name], ["export", name, "-o", "x.glb"], ["pack", name, "-o", "x.exmat"]):
                self.refused(*words, said=[f"{name}: expected an HDF5 file, found {kind}; exmat-precompute bundle writes bundles"])
        self.refused("export", "bar.exmat", "-o", "x.glb", said=["found a pack of a bundle"])
        self.refused("new", "asset.json", said=["asset.json: expected a surface with the extension", "found '.json'"])
        (self.folder / "x.npz").write_bytes(b"PK\3\4")
        self.refused("bundle", "x.npz", "-o", "new.h5", said=["exmat.precompute.write_mesh or exmat.precompute.bundle"])

    def test_depfiles_hold_every_path_that_make_can_read(self):
        odd = self.folder / "a b#c$d:e"
        odd.mkdir()
        for name in ("asset.json", "bar.veg"):
            shutil.copy(self.folder / name, odd / name)
        self.command("bundle", odd / "asset.json", "-o", "new.h5", "--depfile", "new.d")
        (self.folder / "Makefile").write_text("new.h5:\n\ttouch new.h5\ninclude new.d\n")
        if shutil.which("make"):
            subprocess.run(["make", "-s", "new.h5"], cwd=self.folder, check=True)
            self.assertEqual(subprocess.run(["make", "-q", "new.h5"], cwd=self.folder).returncode, 0)
            later = time.time() + 10
            os.utime(odd / "bar.veg", (later, later))
            self.assertEqual(subprocess.run(["make", "-q", "new.h5"], cwd=self.folder).returncode, 1)
        broken = self.folder / "a\nb"
        odd.rename(broken)
        self.assertIn("line ends", self.command("bundle", broken / "asset.json", "-o", "other.h5", "--depfile", "new.d", status=2))
        self.assertFalse((self.folder / "other.h5").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
