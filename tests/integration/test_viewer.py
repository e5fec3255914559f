#!/usr/bin/python3
"""The viewer without a screen: what is in its pictures, beside what the bundle says should be there.

Usage: test_viewer.py FOLDER_OF_PROGRAMS [FOLDER]    (Debian: xvfb libgl1-mesa-dri python3-h5py python3-pil python3-numpy)

FOLDER holds scenes of the examples with their bundles, as their tests leave them; each is opened.
"""
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import h5py
import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from programs import bar, call, write_json

PROGRAMS = Path(sys.argv[1]).resolve()
EXAMPLES = Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
sys.argv = sys.argv[:1]
VIEWER, RUNTIME, PRECOMPUTE = (PROGRAMS / name for name in ("exmat-viewer", "exmat-runtime", "exmat-precompute"))
WITHIN = 2  # pixels
SIZE = (480, 270)


def projected(points, camera):
    """Pixels of points [n x 3], by a pinhole."""
    eye, target = np.array(camera["position"]), np.array(camera["target"])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, camera["up"])
    right /= np.linalg.norm(right)
    way = np.asarray(points) - eye
    depth = way @ forward
    focal = 0.5 * SIZE[1] / np.tan(0.5 * camera["field_of_view"])
    return np.stack([0.5 * SIZE[0] + focal * (way @ right) / depth, 0.5 * SIZE[1] - focal * (way @ np.cross(right, forward)) / depth], axis=1)


class Viewer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        read, write = os.pipe()
        cls.server = subprocess.Popen(["Xvfb", "-noreset", "-displayfd", str(write), "-screen", "0", "640x480x24"], pass_fds=[write],
                                      stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            cls.display = f":{pipe.readline().strip()}"
        cls.addClassCleanup(cls.server.wait)
        cls.addClassCleanup(cls.server.terminate)
        cls.folder = Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, True)
        mesh, fixed = bar()
        (cls.folder / "bar.veg").write_text(mesh)
        for name, more in (("bar", {"fixed": {"ids": fixed}}), ("free", {})):
            asset = {"name": name, "object": {"mesh": "bar.veg", **more,
                                              "material": {"model": "stvk", "youngs_modulus": 1e5, "poisson_ratio": 0.3, "density": 1000}},
                     "basis": {"size": 12, "training": "none"}, "needs": ["contact", "rigid"] if name == "free" else ["contact"]}
            call(PRECOMPUTE, "bundle", cls.write(f"{name}_asset.json", asset), "-o", cls.folder / f"{name}.h5", "--log-level", "warning")
        cls.write("scene.json", {"bundle": "bar.h5", "damping": {"mass": 2, "stiffness": 0.02}})

    @classmethod
    def write(cls, name, content):
        return write_json(cls.folder / name, content)

    def view(self, *arguments, status=0, **environment):
        """What it prints, of a run that ends with this status."""
        return call(VIEWER, *arguments, status=status, env={**os.environ, "DISPLAY": self.display, "LIBGL_ALWAYS_SOFTWARE": "1", **environment})

    @staticmethod
    def run_scene(*words):
        """By one thread: two that wait for each other in each step are slow where others run beside them."""
        return call(RUNTIME, "run", *words, env={**os.environ, "OMP_NUM_THREADS": "1"})

    def picture(self, script, name, *arguments):
        file = self.folder / f"{name}.png"
        self.view(self.folder / "scene.json", "--script", self.write(f"{name}.json", script), "--screenshot", file, "--dump",
                  self.folder / f"{name}_dump.json", "--size", f"{SIZE[0]}x{SIZE[1]}", "--hide-interface", *arguments)
        return Image.open(file).convert("RGB"), json.loads((self.folder / f"{name}_dump.json").read_text())

    def expected_mask(self, dump, bundle="bar.h5", bodies=None, triangles=()):
        """Where surfaces of bodies are, posed and projected here, and other triangles [f x 3 x 3]."""
        with h5py.File(self.folder / bundle) as file:
            rest, basis, surface = (file[name][:] for name in ("object/vertices", "modal/basis", "object/surface"))
        mask = Image.new("L", SIZE)
        draw = ImageDraw.Draw(mask)
        corners = list(triangles)
        for body in dump["bodies"] if bodies is None else [dump["bodies"][k] for k in bodies]:
            placement = np.array(body["placement"]).reshape(3, 4)
            if body["space"] == "full":  # those of the surface alone
                points = rest.copy()
                points[np.unique(surface)] = np.array(body["positions"]).reshape(-1, 3)
                corners += list(points[surface])
                continue
            points = (rest + (basis @ np.array(body["reduced"])).reshape(rest.shape)) @ placement[:, :3].T + placement[:, 3]
            corners += list(points[surface])
        for pixels in (projected(corner, dump["camera"]) for corner in corners):
            draw.polygon([tuple(pixel - 0.5) for pixel in pixels], fill=255)
        return mask

    def assertSameArea(self, found, expected):
        """Neither has anything further than WITHIN from the other."""
        grow = ImageFilter.MaxFilter(2 * WITHIN + 1)
        for one, other in ((found, expected), (expected, found)):
            outside = (np.array(one) > 0) & (np.array(other.filter(grow)) == 0)
            self.assertEqual(int(outside.sum()), 0)

    def test_draws_bodies_where_the_library_has_them(self):
        camera = {"position": [6, -9, 5], "target": [2, 0.5, 0.5], "field_of_view": 0.6}
        start = {"time": 0, "camera": camera, "show": {"floor": False}}
        empty, _ = self.picture({"actions": [{**start, "show": {"floor": False, "surface": False}}]}, "empty")
        drag = [{**start, "grab": {"hand": "tip", "point": [4, 0.5, 1]}}, {"time": 0, "move": {"hand": "tip", "by": [-0.4, 0.6, 1], "duration": 1}}]
        masks = []
        for name, actions in (("rest", [start]), ("dragged", drag)):
            picture, dump = self.picture({"actions": actions}, name)
            change = np.abs(np.array(picture).astype(int) - np.array(empty)).max(axis=2) > 12
            if name == "dragged":  # but for the hand, which is drawn over it
                hand = projected([dump["hands"][0]["point"], dump["hands"][0]["target"]], dump["camera"])
                y, x = np.mgrid[:SIZE[1], :SIZE[0]]
                near = np.min([np.hypot(x - hx, y - hy) for hx, hy in hand], axis=0) < 14
            else:
                near = np.zeros(change.shape, bool)
            expected = np.array(self.expected_mask(dump))
            change[near] = expected[near] > 0
            masks.append(change)
            self.assertSameArea(Image.fromarray((255 * change).astype(np.uint8)), Image.fromarray(expected))
        moved = json.loads((self.folder / "dragged_dump.json").read_text())["hands"][0]
        self.assertLess(np.linalg.norm(np.subtract(moved["point"], moved["target"])), 0.3)
        self.assertGreater((masks[0] != masks[1]).sum(), 1000)

    def assertSameHash(self, one, other):
        hashes = [re.search("state hash +([0-9a-f]{16})", text).group(1) for text in (one, other)]
        self.assertEqual(*hashes)
        return hashes[0]

    def world(self):
        """Two free bars that fall, one of its own kind, onto the floor and a pyramid."""
        (self.folder / "pyramid.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 1 1\n"
                                                 "f 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n")
        law = {"stiffness": 2e5, "damping": 2e3}
        return self.write("world.json", {
            "time_step": 0.002, "gravity": [0, 0, -9.81], "damping": {"mass": 1, "stiffness": 0.01}, "contact": {**law, "friction": 0.3},
            "obstacles": [{"plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}, **law},
                          {"mesh": {"file": "pyramid.obj", "position": [1, -4, -1]}, **law}],
            "bodies": [{"name": "low", "bundle": "free.h5"}, {"name": "high", "bundle": "free.h5", "body": {"position": [0.4, 0.1, 1.3]}}]})

    def test_bodies_that_touch_are_drawn_held_and_saved(self):
        camera = {"position": [9, -14, 7], "target": [2, -0.5, 0.5], "field_of_view": 0.6}
        start = {"time": 0, "camera": camera, "show": {"floor": False}}
        hidden = self.write("hidden.json", {"actions": [{**start, "show": {"floor": False, "surface": False}}]})
        drag = self.write("held.json", {"frame_rate": 50, "actions": [
            {**start, "grab": {"hand": "a", "point": [4, 0.5, 1], "body": 1}, "set": {"bodies": "high", "gravity": [0, 0, -5]}},
            {"time": 0, "move": {"hand": "a", "by": [0, 0.3, 2.5], "duration": 0.6}, "move_obstacle": {"obstacle": 1, "by": [-2, 0, 0.5], "duration": 0.4}},
            {"time": 0.7}]})
        common = ("--size", f"{SIZE[0]}x{SIZE[1]}", "--hide-interface")
        self.view(self.world(), "--script", hidden, "--screenshot", self.folder / "hidden.png", *common)
        self.view(self.world(), "--script", drag, "--screenshot", self.folder / "held.png", "--dump", self.folder / "held_dump.json", *common)
        dump = json.loads((self.folder / "held_dump.json").read_text())
        hand, obstacle = dump["hands"][0], np.array(dump["obstacles"][1]["position"])
        self.assertEqual(hand["body"], 1)
        self.assertLess(np.linalg.norm(np.subtract(hand["point"], hand["target"])), 0.6)
        np.testing.assert_allclose(obstacle, [-2, 0, 0.5], atol=1e-2)
        self.assertGreater(dump["bodies"][1]["placement"][11] - dump["bodies"][0]["placement"][11], 1)
        place = np.array([1, -4, -1])
        base = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]]) + place
        pyramid = base[[[0, 3, 2], [0, 2, 1], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]]
        empty = self.expected_mask(dump, bodies=[], triangles=pyramid)
        expected = np.array(self.expected_mask(dump, "free.h5", triangles=pyramid + obstacle)) > 0
        pictures = [np.array(Image.open(self.folder / f"{name}.png").convert("RGB")).astype(int) for name in ("held", "hidden")]
        change = np.abs(pictures[0] - pictures[1]).max(axis=2) > 12
        hand_pixels = projected([hand["point"], hand["target"]], dump["camera"])
        y, x = np.mgrid[:SIZE[1], :SIZE[0]]
        left_out = (np.min([np.hypot(x - hx, y - hy) for hx, hy in hand_pixels], axis=0) < 14) | (np.array(empty.filter(ImageFilter.MaxFilter(5))) > 0)
        change[left_out] = expected[left_out]
        self.assertSameArea(Image.fromarray((255 * change).astype(np.uint8)), Image.fromarray((255 * expected).astype(np.uint8)))

    def test_bodies_that_touch_are_saved_as_a_scene_that_runs_to_the_same_state(self):
        script = self.write("world_set.json", {"frame_rate": 50, "actions": [
            {"time": 0, "set": {"gravity": [0, 0, -7], "mass_damping": 0.3}}, {"time": 0, "set": {"bodies": "high", "stiffness_damping": 0.005}}]})
        (self.folder / "other").mkdir(exist_ok=True)
        saved = self.folder / "other/world_saved.json"
        printed = self.view(self.world(), "--script", script, "--frames", 20, "--save-scene", saved)
        self.assertIn("steps 200", printed)
        found = self.assertSameHash(printed, self.run_scene(saved))
        self.assertNotIn(found, self.view(self.world(), "--frames", 20, "--frame-rate", 50))
        thrown = self.write("thrown.json", {"frame_rate": 50, "actions": [{"time": 0, "throw": {"body": 1, "velocity": [0, 0, 4]}}, {"time": 0.1}]})
        self.view(self.world(), "--script", thrown, "--dump", self.folder / "thrown_dump.json")
        low, high = json.loads((self.folder / "thrown_dump.json").read_text())["bodies"]
        self.assertGreater(high["placement"][11] - low["placement"][11], 1.5)
        self.assertIn("add it to \"bodies\"", self.view(self.world(), self.folder / "bar.h5", "--frames", 1, status=2))
        wrong = self.write("wrong.json", {"actions": [{"time": 0, "set": {"bodies": "none", "gravity": [0, 0, 0]}}]})
        self.assertIn("low, high", self.view(self.world(), "--script", wrong, status=2))

    def test_runs_say_what_the_basis_loses_of_contacts(self):
        printed = self.run_scene(self.world(), "--steps", "400")
        for body in ("low", "high"):
            self.assertTrue(0 <= float(re.search(f"lost work, {body} contact +([0-9.]+) % at", printed).group(1)) <= 100)
        scene = self.write("dropped.json", {"bundle": "free.h5", "time_step": 0.002, "gravity": [0, 0, -9.81], "steps": 100,
                                            "obstacles": [{"plane": {"point": [0, 0, -0.1], "normal": [0, 0, 1]}, "stiffness": 2e5}]})
        self.assertRegex(self.run_scene(scene), "lost work, contact +[0-9.]+ % at 0.[0-9]+ s, when it is [0-9.e+]+ N")
        self.assertNotIn("lost work", self.run_scene(self.write("still.json", {"bundle": "free.h5", "steps": 5})))
        self.assertIn("nothing touched", self.run_scene(self.folder / "still.json", "--load-capacity"))

    def test_saved_settings_are_a_scene_that_runs_to_the_same_state(self):
        script = self.write("set.json", {"frame_rate": 50, "actions": [
            {"time": 0, "set": {"gravity": [0, 0, -9.81], "mass_damping": 0.3, "stiffness_damping": 0.001, "integrator": "backward_euler"}}]})
        saved = self.folder / "saved.json"
        printed = self.view(self.folder / "scene.json", "--script", script, "--frames", 20, "--save-scene", saved)
        self.assertIn("steps 400", printed)
        found = self.assertSameHash(printed, self.run_scene(saved))
        self.assertNotIn(found, self.view(self.folder / "scene.json", "--frames", 20, "--frame-rate", 50))

    def test_lost_work_of_a_hand_is_that_of_the_same_force_in_a_scene(self):
        """The hand is smaller than the bar's edges: what it holds is a vertex."""
        grab = {"time": 0, "grab": {"hand": "a", "point": [4, 0.5, 1]}}
        move = {"time": 0, "move": {"hand": "a", "by": [0, 0, 0.2], "duration": 0.1}}
        _, dump = self.picture({"actions": [grab, move]}, "felt")
        self.assertEqual((dump["lost_work"]["hand"], dump["bodies"][0]["space"]), (0, "full"))
        _, dump = self.picture({"actions": [{"time": 0, "set": {"space": "reduced"}}, grab, move]}, "lost")
        vertex = 9 * 8 + 3 * 1 + 2
        scene = self.write("pushed.json", {"bundle": "bar.h5", "steps": 1, "forces": [{"vertices": {"ids": [vertex]}, "force": dump["hands"][0]["force"]}]})
        printed = self.run_scene(scene)
        found = float(re.search("lost work, force 0 +([0-9.]+) %", printed).group(1)) / 100
        self.assertAlmostEqual(dump["lost_work"]["hand"], found, delta=0.001)
        self.assertTrue(0.01 < found < 0.99)

    def test_the_same_script_makes_the_same_pictures(self):
        script = self.write("twice.json", {"actions": [{"time": 0, "grab": {"hand": "a", "point": [4, 0, 0]}, "show": {"colour": "strain_energy", "elements": True}},
                                                       {"time": 0, "move": {"hand": "a", "by": [0, 1, 0], "duration": 0.1}}]})
        for folder in ("one", "two"):
            self.view(self.folder / "scene.json", "--script", script, "--frames", 3, "--record", self.folder / folder, "--size", "160x90",
                      "--hide-interface")
        pictures = sorted(path.name for path in (self.folder / "one").iterdir())
        self.assertEqual(pictures, [f"{i:05}.png" for i in range(4)])
        for name in pictures:
            self.assertEqual((self.folder / "one" / name).read_bytes(), (self.folder / "two" / name).read_bytes())
        self.assertNotEqual((self.folder / "one/00000.png").read_bytes(), (self.folder / "one/00003.png").read_bytes())

    def test_opens_bundles_alone_and_many_bodies(self):
        many = self.write("many.json", {"bundle": "bar.h5", "gravity": [0, 0, -1], "instances": 5,
                                        "obstacles": [{"plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}},
                                                      {"sphere": {"center": [3, 0.5, -1], "radius": 0.4}}, {"box": {"half_extents": [0.1, 0.2, 0.3]}},
                                                      {"capsule": {"start": [0, 2, 0], "end": [1, 2, 0], "radius": 0.2}}]})
        shown = self.write("all.json", {"actions": [{"time": 0, "show": {"colour": "contact_force", "wireframe": True, "elements": True, "targets": True,
                                                                         "examples": True, "help": True}}, {"time": 0.1}]})
        for files in ([self.folder / "bar.h5"], [many], [self.folder / "scene.json", self.folder / "bar.h5"]):
            self.view(*files, "--script", shown, "--screenshot", self.folder / "x.png", "--size", "320x180")

    @unittest.skipUnless(EXAMPLES and EXAMPLES.is_dir(), "no scenes of examples")
    def test_opens_the_scenes_of_the_examples(self):
        scenes = sorted(EXAMPLES.glob("*/scene*.json"))
        if not scenes:
            self.skipTest("the tests of the examples, which come before this one, make the bundles")
        for scene in scenes:
            content = json.loads(scene.read_text())
            with self.subTest(scene=scene.parent.name):
                for kind in content.get("bodies", [content]):
                    self.assertTrue((scene.parent / kind["bundle"]).is_file(), kind["bundle"])
                self.view(scene, "--frames", 2, "--screenshot", self.folder / "x.png", "--size", "160x90")

    @unittest.skipUnless(shutil.which("ffmpeg"), "there is no ffmpeg")
    def test_records_movies(self):
        for name, start in (("m.gif", b"GIF89a"), ("m.mp4", b"\0\0\0")):
            self.view(self.folder / "scene.json", "--frames", 3, "--record", self.folder / name, "--size", "160x90")
            self.assertTrue((self.folder / name).read_bytes().startswith(start))

    def test_says_what_is_missing(self):
        scene = self.folder / "scene.json"
        self.assertIn("xvfb-run", self.view(scene, "--frames", 1, status=1, DISPLAY=""))
        self.assertRegex(self.view(scene, "--frames", 1, status=1, MESA_GL_VERSION_OVERRIDE="2.1"), "OpenGL 3.3 is needed, found 2.1")
        self.assertIn("ffmpeg", self.view(scene, "--record", self.folder / "m.mp4", status=2, PATH="/nonexistent"))
        self.assertIn("a folder, or a movie", self.view(scene, "--record", self.folder / "m.avi", status=2))
        self.assertIn("no such file", self.view(self.folder / "none.json", "--frames", 1, status=2))
        bad = self.write("bad.json", {"actions": [{"time": 0, "grab": {"hand": "a"}}]})
        self.assertIn("/actions/0/grab", self.view(scene, "--script", bad, status=2))

    def test_writes_over_none_of_its_files(self):
        scene = self.write("ground_scene.json", {"bundle": "bar.h5", "obstacles": [{"mesh": {"file": "ground.obj", "thickness": 0.1}}]})
        (self.folder / "ground.obj").write_text("v -9 -9 -3\nv 9 -9 -3\nv 0 9 -3\nf 1 2 3\n")
        script = self.write("still.json", {"actions": []})
        (self.folder / "link.png").symlink_to("bar.h5")
        before = {path: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}
        for option in ("--screenshot", "--save-scene", "--dump"):
            for name in ("bar.h5", "link.png", "ground_scene.json", "ground.obj", "still.json"):
                said = self.view(scene, "--script", script, "--frames", 1, option, self.folder / name, status=2)
                self.assertIn(f"{name}: {option}: expected a file that this command does not read", said)
        movie = self.folder / "bar.gif"
        movie.symlink_to("bar.h5")
        if shutil.which("ffmpeg"):
            self.assertIn("--record: expected a file that this command does not read", self.view(scene, "--record", movie, status=2))
        pictures = self.folder / "pictures"
        said = self.view(scene, "--record", pictures, "--dump", pictures, status=2)
        self.assertIn("pictures: --dump: expected a file of its own, found that of --record", said)
        self.assertIn("bar.h5: --screenshot", self.view(self.folder / "bar.h5", "--screenshot", self.folder / "bar.h5", status=2))
        movie.unlink()
        self.assertEqual({path: path.read_bytes() for path in self.folder.iterdir() if path.is_file()}, before)

    def test_memory_does_not_grow(self):
        most = []
        for frames in (20, 200):
            folder = self.folder / f"frames_{frames}"
            process = subprocess.Popen([VIEWER, self.folder / "scene.json", "--frames", str(frames), "--record", folder, "--size", "96x64",
                                        "--hide-interface"], env={**os.environ, "DISPLAY": self.display}, stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = status
            self.assertEqual(status, 0)
            most.append(usage.ru_maxrss)
        self.assertLess(most[1] - most[0], 6000)  # kB

    def test_a_window_runs_until_it_is_ended(self):
        process = subprocess.Popen([VIEWER, self.folder / "scene.json", "--size", "320x240"], env={**os.environ, "DISPLAY": self.display},
                                   stderr=subprocess.DEVNULL)
        time.sleep(2)
        self.assertIsNone(process.poll())
        process.terminate()
        process.wait(20)


if __name__ == "__main__":
    unittest.main(verbosity=2)
