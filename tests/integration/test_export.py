#!/usr/bin/python3
"""Motions as other programs read them: .glb by VTK's reader, .usda by its text, each against the trajectory.

Usage: test_export.py FOLDER_OF_PROGRAMS [--keep FOLDER]    (Debian: python3-vtk9 python3-h5py)

--keep copies the .glb files that were written into a folder.
"""
import itertools
import json
import re
import shutil
import struct
import sys
import tempfile
import unittest
import zlib
from pathlib import Path

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from programs import bar, call, write_bar, write_json, write_skinned

PROGRAMS = Path(sys.argv.pop(1)).resolve()
KEPT = Path(sys.argv.pop()) if "--keep" in sys.argv else None
sys.argv = sys.argv[:1]
PRECOMPUTE, RUNTIME = PROGRAMS / "exmat-precompute", PROGRAMS / "exmat-runtime"
SIZE = np.linalg.norm([4, 1, 1])
WITHIN = 1e-5 * SIZE  # single precision at coordinates up to 10 m: 1e-6 m


def tube():
    """Text of an .obj file: a round tube about the bar's axis, its seam twice."""
    lines = []
    for i, j in itertools.product(range(41), range(25)):
        angle = 2 * np.pi * (j % 24) / 24
        lines.append(f"v {0.1 * i} {0.5 + 0.45 * np.cos(angle)} {0.5 + 0.45 * np.sin(angle)}")
    for i, j in itertools.product(range(40), range(24)):
        a = 25 * i + j + 1
        lines.append(f"f {a} {a + 1} {a + 26} {a + 25}")
    return "\n".join(lines) + "\n"


def contents(path):
    """JSON of a .glb, and its arrays by accessor."""
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20:20 + size])
    binary = data[28 + size:]
    arrays = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        offset = view.get("byteOffset", 0)
        array = np.frombuffer(binary[offset:offset + view["byteLength"]], kind).reshape(-1, width)
        assert len(array) == accessor["count"]
        for name, found in (("min", array.min(0)), ("max", array.max(0))):
            assert name not in accessor or np.array_equal(np.array(accessor[name], np.float32), found)
        arrays.append(array)
    return document, arrays


class Export(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)
        write_bar(cls.folder)
        (cls.folder / "tube.obj").write_text(tube())
        for name, more in (("free", {}), ("clamped", {"fixed": {"file": "end.txt"}})):
            asset = {"name": name, "object": {"mesh": "bar.veg", "render_mesh": "tube.obj", **more,
                                              "material": {"youngs_modulus": 2e5, "poisson_ratio": 0.4, "density": 1000}},
                     "basis": {"size": 8, "linear_modes": 4, "training": "none"}, "cubature": {"elements": 16, "training_poses": 20},
                     "needs": ["rigid", "render", "contact"], "examples": []}
            write_json(cls.folder / f"{name}.json", asset)
            cls.call(PRECOMPUTE, "bundle", f"{name}.json", "-o", f"{name}.h5")
        cls.run_scene("clamped", {"gravity": [0, 0, -9.81]})
        cls.run_scene("free", {"gravity": [0, -9.81, 0], "body": {"position": [2, 1, -1], "orientation": [0.8, 0, 0.6, 0],
                                                                   "angular_velocity": [1, 4, 9], "linear_velocity": [3, 5, 0]}})
        half = np.sqrt(0.5)
        cls.run_scene("clamped", {"body": {"motion": [{"time": 0}, {"time": 0.5, "position": [0, 2, 0], "orientation": [half, 0, half, 0]},
                                                      {"time": 2, "position": [1, 0, 0]}]}}, "carried")

        several = {"time_step": 0.01, "steps": 60, "gravity": [0, -1, 0], "output": {"trajectory": "several_run.h5", "every": 5}, "bodies": [
            {"name": "thrown-one", "bundle": "free.h5", "body": {"position": [0, 9, 0], "angular_velocity": [1, 4, 9]}},
            {"name": "held", "bundle": "clamped.h5"},
            {"name": "drop", "bundle": "free.h5", "body": {"position": [0, 1.1, 0.2], "orientation": [0.8, 0, 0.6, 0]},
             "grid": {"counts": [1, 2, 1], "spacing": [0, 2, 0]}}]}
        write_json(cls.folder / "several.json", several)
        cls.call(RUNTIME, "run", "several.json")

    @classmethod
    def call(cls, *words, status=0):
        return call(*words, status=status, cwd=cls.folder)

    @classmethod
    def run_scene(cls, bundle, members, name=None):
        name = name or bundle
        scene = {"bundle": f"{bundle}.h5", "time_step": 0.01, "steps": 100, **members,
                 "output": {"trajectory": f"{name}_run.h5", "every": 5, "render": True}}
        write_json(cls.folder / f"{name}_scene.json", scene)
        cls.call(RUNTIME, "run", f"{name}_scene.json")

    def export(self, *words):
        printed = self.call(RUNTIME, "export", *words)
        if KEPT and (name := words[words.index("-o") + 1]).endswith(".glb"):
            shutil.copy(self.folder / name, KEPT / f"{self.id().split('.')[-1]}_{len(list(KEPT.iterdir()))}.glb")
        return printed

    def trajectory(self, name):
        with h5py.File(self.folder / f"{name}_run.h5") as f:
            return {key: f[key][:] for key in ("time", "vertices", "render/vertices", "reduced")}

    def frames(self, file, times):
        """Points of the one body at times, by VTK."""
        (body,) = self.frames_of_bodies(file, times)
        return body

    def frames_of_bodies(self, file, times):
        """Points of each body at times, by VTK, in the order of the nodes."""
        reader = vtk.vtkGLTFReader()
        reader.SetFileName(str(self.folder / file))
        reader.ApplyDeformationsToGeometryOn()
        reader.SetFrameRate(1000)  # of the times that the reader offers: those of the frames are among them
        reader.UpdateInformation()
        reader.EnableAnimation(0)
        reader.UpdateInformation()
        frames = []
        for time in times:
            reader.UpdateTimeStep(time)
            reader.Update()
            iterator = reader.GetOutput().NewIterator()
            iterator.InitTraversal()
            bodies = []
            while not iterator.IsDoneWithTraversal():
                bodies.append(vtk_to_numpy(iterator.GetCurrentDataObject().GetPoints().GetData()).astype(float))
                iterator.GoToNextItem()
            frames.append(bodies)
        return [np.array(body) for body in zip(*frames)]

    def check(self, name, within=WITHIN, file="motion.glb"):
        run = self.trajectory(name)
        missed = np.linalg.norm(self.frames(file, run["time"]) - run["render/vertices"], axis=2)
        self.assertLess(missed.max(), within)
        return missed

    def test_a_reader_of_gltf_sees_the_trajectory(self):
        for name in ("clamped", "free", "carried"):
            with self.subTest(name):
                printed = self.export(f"{name}_run.h5", "-o", "motion.glb")
                self.assertRegex(printed, r"morph targets +8, modes")
                self.assertRegex(printed, r"surface +1025 vertices, 1920 triangles of /render")
                self.check(name)
                x = self.trajectory(name)["render/vertices"]
                self.assertGreater(np.linalg.norm(x - x[0], axis=2).max(), 0.3)  # it moves

    def bundle_in_full_space(self, name, source, **more):
        asset = json.loads((self.folder / f"{source}.json").read_text())
        write_json(self.folder / f"{name}.json", {**asset, "needs": [*asset["needs"], "full_space"], **more})
        self.call(PRECOMPUTE, "bundle", f"{name}.json", "-o", f"{name}.h5")

    def test_a_body_in_full_space_is_drawn_as_it_was(self):
        """Also where its modes are elsewhere, as under a hand that pulls at a corner, and for bodies of which one is reduced."""
        self.bundle_in_full_space("touched", "clamped")
        self.bundle_in_full_space("thrown", "free")
        hand = {"forces": [{"vertices": {"ids": [80]}, "force": [0, 0, 400], "start": 0, "end": 0.5}], "space": "full"}
        self.run_scene("touched", hand)
        self.run_scene("thrown", {**hand, "body": {"angular_velocity": [1, 4, 9], "linear_velocity": [3, 5, 0]}})
        for name in ("touched", "thrown"):
            with self.subTest(name), h5py.File(self.folder / f"{name}_run.h5") as run, h5py.File(self.folder / f"{name}.h5") as bundle:
                self.assertGreaterEqual(run.attrs["full_frames"], 20)  # all, or all after the start
                printed = self.export(f"{name}_run.h5", "-o", "motion.glb")
                self.assertRegex(printed, r"morph targets +\d+, components")
                missed = self.check(name)
                largest = float(re.search(r"largest (\S+) m", printed)[1])
                self.assertLess(missed.max(), 1.1 * largest + 1e-6)  # of the trajectory's own rounding
                if name == "touched":
                    modes = bundle["modal/basis"][:] @ run["reduced"][:].T + bundle["object/vertices"][:][:, :, None]
                    off = np.linalg.norm(modes.transpose(2, 0, 1) - run["vertices"][:], axis=2).max()
                    self.assertGreater(off, 1e-3 * SIZE)  # what modes would draw
        self.assertIn("expected at most", self.refused("touched_run.h5", "-o", "a.glb", "--targets", "22"))
        pair = {"time_step": 0.01, "steps": 60, "gravity": [0, 0, -9.81], "output": {"trajectory": "pair_run.h5", "every": 5}, "bodies": [
            {"name": "a", "bundle": "touched.h5", "space": "full"}, {"name": "b", "bundle": "touched.h5", "body": {"motion": [{"time": 0, "position": [0, 5, 0]}]}}]}
        write_json(self.folder / "pair.json", pair)
        self.call(RUNTIME, "run", "pair.json")
        self.export("pair_run.h5", "-o", "motion.glb", "--mesh")
        with h5py.File(self.folder / "pair_run.h5") as run:
            for drawn, name in zip(self.frames_of_bodies("motion.glb", run["bodies/a/time"][:]), "ab"):
                self.check_drawn(drawn, run[f"bodies/{name}/vertices"][:])

    def test_a_skin_moves_by_its_bones_and_the_flesh_on_top(self):
        write_skinned(self.folder / "skinned.glb", bulge=0.4)
        asset = {"name": "skinned", "object": {"surface": "skinned.glb", "cells": 500, "render_mesh": "skinned.glb",
                                               "material": {"youngs_modulus": 2e6, "poisson_ratio": 0.4, "density": 1000}},
                 "basis": {"size": 8, "linear_modes": 6, "training": "none"}, "cubature": {"elements": 20}, "needs": ["render"]}
        write_json(self.folder / "skinned.json", asset)
        self.call(PRECOMPUTE, "bundle", "skinned.json", "-o", "skinned.h5")
        self.run_scene("skinned", {"gravity": [0, -9.81, 0], "time_step": 0.005, "damping": {"stiffness": 0.005},
                                   "body": {"animation": {"name": "curl", "start": 0.1}}})
        for words in ([], ["--up", "z"]):
            printed = self.export("skinned_run.h5", "-o", "motion.glb", *words)
            self.assertRegex(printed, r"skin +3 bones")
            run = self.trajectory("skinned")
            drawn = self.frames("motion.glb", run["time"])
            if words:
                drawn = np.stack([drawn[:, :, 0], -drawn[:, :, 2], drawn[:, :, 1]], 2)
            self.assertLess(np.linalg.norm(drawn - run["render/vertices"], axis=2).max(), 1e-5 * np.linalg.norm([3, 1, 1]))
        document, arrays = contents(self.folder / "motion.glb")
        names = [node.get("name") for node in document["nodes"]]
        (skin,) = document["skins"]
        self.assertEqual([names[joint] for joint in skin["joints"]], ["root", "middle", "tip"])
        self.assertEqual([names[child] for child in document["nodes"][names.index("middle")]["children"]], ["tip"])
        # The bones turn as their animation says, and the flesh does beside: what the bones alone would draw is elsewhere.
        channels = {(names[c["target"]["node"]], c["target"]["path"]): document["animations"][0]["samplers"][c["sampler"]]
                    for c in document["animations"][0]["channels"]}
        times = arrays[channels["tip", "rotation"]["input"]].ravel()
        angle = np.radians(60) * np.minimum(times + 0.1, 1 - (times + 0.1))  # 30 degrees in half a second and back
        expected = np.stack([0 * angle, 0 * angle, np.sin(angle / 2), np.cos(angle / 2)], 1)
        np.testing.assert_allclose(arrays[channels["tip", "rotation"]["output"]], expected, atol=1e-6)
        primitive = document["meshes"][0]["primitives"][0]
        weights = arrays[primitive["attributes"]["WEIGHTS_0"]]
        np.testing.assert_allclose(weights.sum(1), 1, atol=1e-7)
        flesh = np.array([np.abs(arrays[target["POSITION"]]).max() for target in primitive["targets"]])
        self.assertGreater(flesh.max(), 0.01)
        self.assertLess(flesh.max(), 0.3)  # a limb goes 1.6 m

    def test_fewer_targets_miss_what_is_said(self):
        for name, fewer in itertools.product(("clamped", "free"), (1, 3)):
            with self.subTest(name, targets=fewer):
                printed = self.export(f"{name}_run.h5", "-o", "motion.glb", "--targets", str(fewer))
                largest, share, rms = map(float, re.search(r"largest (\S+) m \((\S+) of the size\), RMS (\S+) m", printed).groups())
                missed = self.check(name, within=2)
                self.assertAlmostEqual(missed.max() / largest, 1, delta=0.06)  # two digits are printed
                self.assertAlmostEqual(np.sqrt((missed**2).mean()) / rms, 1, delta=0.06)
                size = np.linalg.norm([4, 0.9, 0.9])
                self.assertAlmostEqual(share * size / largest, 1, delta=0.1)

    def test_the_file_is_what_the_format_asks_for(self):
        self.export("free_run.h5", "-o", "motion.glb", "--targets", "4")
        document, arrays = contents(self.folder / "motion.glb")
        mesh = document["meshes"][0]
        self.assertEqual(mesh["extras"]["targetNames"], [f"component {k}" for k in range(1, 5)])
        self.assertEqual(len(mesh["weights"]), 4)
        primitive = mesh["primitives"][0]
        normals = arrays[primitive["attributes"]["NORMAL"]]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
        channels = {c["target"]["path"]: document["animations"][0]["samplers"][c["sampler"]] for c in document["animations"][0]["channels"]}
        self.assertEqual(set(channels), {"translation", "rotation", "weights"})
        weights = arrays[channels["weights"]["output"]]
        self.assertEqual(len(weights), 21 * 4)
        self.assertAlmostEqual(np.abs(weights).max(), 1, places=6)
        np.testing.assert_allclose(np.linalg.norm(arrays[channels["rotation"]["output"]], axis=1), 1, atol=1e-6)
        self.assertTrue(np.all(np.diff(arrays[channels["weights"]["input"]].ravel()) > 0))

    def test_it_is_smaller_than_a_point_cache(self):
        self.export("clamped_run.h5", "-o", "motion.glb", "--targets", "3")
        self.export("clamped_run.h5", "-o", "motion.pc2")
        glb, cache = ((self.folder / f"motion.{kind}").stat().st_size for kind in ("glb", "pc2"))
        self.assertLess(glb, 0.5 * cache)  # of 21 frames; a frame more costs 3 + 1 numbers in place of 3,075

    def test_z_up_is_turned(self):
        self.export("carried_run.h5", "-o", "motion.glb", "--up", "z")
        run = self.trajectory("carried")
        x, y, z = np.moveaxis(run["render/vertices"], 2, 0)
        self.assertLess(np.abs(self.frames("motion.glb", run["time"]) - np.stack([x, z, -y], 2)).max(), WITHIN)

    def test_the_mesh_in_place_of_the_render_mesh(self):
        self.export("clamped_run.h5", "-o", "motion.glb", "--mesh")
        run = self.trajectory("clamped")
        drawn = self.frames("motion.glb", run["time"])
        pairs = np.linalg.norm(drawn[0][:, None] - run["vertices"][0][None], axis=2).argmin(1)
        self.assertEqual(len(set(pairs)), 9 * 9 - 7)  # all but those inside
        self.assertLess(np.abs(drawn - run["vertices"][:, pairs]).max(), WITHIN)

    NAMES = ["drop_0", "drop_1", "held", "thrown-one"]  # in ascending order

    def positions_of_several(self):
        with h5py.File(self.folder / "several_run.h5") as f:
            return f[f"bodies/{self.NAMES[0]}/time"][:], [f[f"bodies/{name}/vertices"][:] for name in self.NAMES]

    def check_drawn(self, drawn, expected):
        """The surface of the tets, its vertices in another order."""
        pairs = np.linalg.norm(drawn[0][:, None] - expected[0][None], axis=2).argmin(1)
        self.assertEqual(len(set(pairs)), 9 * 9 - 7)  # all but those inside
        self.assertLess(np.abs(drawn - expected[:, pairs]).max(), 3 * WITHIN)  # up to 12 m away

    def test_several_bodies_are_nodes_of_one_file(self):
        printed = self.export("several_run.h5", "-o", "motion.glb", "--mesh")
        self.assertRegex(printed, r"bodies +4 of 2 meshes")
        document, _ = contents(self.folder / "motion.glb")
        self.assertEqual([node["name"] for node in document["nodes"]], self.NAMES)
        self.assertEqual([node["mesh"] for node in document["nodes"]], [0, 0, 1, 0])
        self.assertEqual(document["scenes"][0]["nodes"], [0, 1, 2, 3])
        self.assertEqual([mesh["name"] for mesh in document["meshes"]], ["free", "clamped"])
        times, expected = self.positions_of_several()
        drawn = self.frames_of_bodies("motion.glb", times)
        self.assertEqual(len(drawn), 4)
        for body, positions in zip(drawn, expected):
            self.check_drawn(body, positions)
        self.export("several_run.h5", "-o", "upright.glb", "--mesh", "--up", "z", "--targets", "3")
        document, _ = contents(self.folder / "upright.glb")
        self.assertEqual(document["scenes"][0]["nodes"], [0])
        self.assertEqual(document["nodes"][0]["children"], [1, 2, 3, 4])
        self.assertEqual([len(node["weights"]) for node in document["nodes"][1:]], [3] * 4)

    def test_one_body_of_several(self):
        times, expected = self.positions_of_several()
        self.export("several_run.h5", "-o", "motion.glb", "--mesh", "--body", "drop_1")
        document, _ = contents(self.folder / "motion.glb")
        self.assertEqual([node["name"] for node in document["nodes"]], ["drop_1"])
        self.check_drawn(self.frames("motion.glb", times), expected[1])
        self.export("several_run.h5", "-o", "motion.pc2", "--body", "drop_1")
        data = (self.folder / "motion.pc2").read_bytes()
        np.testing.assert_array_equal(np.frombuffer(data[32:], "<f4").reshape(expected[1].shape), expected[1])
        for words, message in ((["-o", "a.pc2"], "write a file for each: --body drop_0, and so on"),
                               (["-o", "a.glb", "--body", "nobody"], "it has drop_0, drop_1, held, thrown-one"),
                               (["-o", "a.usda", "--body", "nobody"], "/bodies: expected a body \"nobody\"")):
            self.assertIn(message, self.refused("several_run.h5", *words))
        self.assertIn("leave out --body", self.refused("free_run.h5", "-o", "a.glb", "--body", "drop_1"))

    def test_usd_of_several_bodies(self):
        printed = self.export("several_run.h5", "-o", "motion.usda")
        self.assertRegex(printed, r"bodies +4")
        text = (self.folder / "motion.usda").read_text()
        self.assertIn('defaultPrim = "bodies"', text)
        self.assertEqual(text.count("faceVertexIndices"), 1)  # the same mesh of tets
        self.assertEqual(text.count("inherits = </triangles_0>"), 4)
        self.assertEqual(text.count("{"), text.count("}"))
        self.assertEqual(re.findall(r'    def Mesh "(.*?)"', text), ["drop_0", "drop_1", "held", "thrown_one"])
        times, expected = self.positions_of_several()
        samples = re.findall(r"points.timeSamples = \{\n(.*?)\n +\}", text, re.S)
        self.assertEqual(len(samples), 4)
        for body, positions in zip(samples, expected):
            found = np.array([re.findall(r"[-+.\de]+", line.split(":")[1]) for line in body.splitlines()], np.float32)
            np.testing.assert_array_equal(found.reshape(positions.shape), positions)
        self.export("several_run.h5", "-o", "motion.usda", "--body", "held")
        self.assertIn('defaultPrim = "body"', (self.folder / "motion.usda").read_text())

    def test_modes_without_a_motion(self):
        printed = self.export("--bundle", "clamped.h5", "-o", "modes.glb")
        self.assertRegex(printed, r"morph targets +8, modes")
        document, arrays = contents(self.folder / "modes.glb")
        self.assertNotIn("animations", document)
        primitive = document["meshes"][0]["primitives"][0]
        rest = arrays[primitive["attributes"]["POSITION"]].astype(float)
        targets = np.array([arrays[target["POSITION"]] for target in primitive["targets"]], float)
        run = self.trajectory("clamped")
        drawn = rest + np.einsum("fk,kvc->fvc", run["reduced"], targets)  # the weights are q
        self.assertLess(np.abs(drawn - run["render/vertices"]).max(), WITHIN)

    def test_usd_has_the_points_of_the_trajectory(self):
        for name, mesh in (("free", False), ("clamped", True)):
            self.export(f"{name}_run.h5", "-o", "motion.usda", "--frame-rate", "50", *(["--mesh"] if mesh else []))
            text = (self.folder / "motion.usda").read_text()
            self.assertTrue(text.startswith("#usda 1.0\n"))
            self.assertIn("timeCodesPerSecond = 50\n", text)
            self.assertIn("endTimeCode = 50\n", text)
            run = self.trajectory(name)
            expected = run["vertices" if mesh else "render/vertices"]
            samples = re.search(r"points.timeSamples = \{\n(.*?)\n    \}", text, re.S)[1].splitlines()
            self.assertEqual(len(samples), len(expected))
            for line, time, points in zip(samples, run["time"], expected):
                code, values = line.split(":")
                self.assertAlmostEqual(float(code), 50 * time, places=6)
                found = np.array(re.findall(r"[-+.\de]+", values), np.float32).reshape(-1, 3)
                np.testing.assert_array_equal(found, points)  # to the last digit
            counts, corners = (np.array(re.search(rf"int\[\] {key} = \[(.*?)\]", text)[1].split(", "), int)
                               for key in ("faceVertexCounts", "faceVertexIndices"))
            self.assertTrue((counts == 3).all())
            faces = corners.reshape(-1, 3)
            self.assertEqual(len(faces), len(counts))
            a, b, c = (expected[0].astype(float)[faces[:, k]] for k in range(3))
            volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
            if mesh:
                self.assertAlmostEqual(volume, 4, delta=1e-5)  # closed, outward

    def bar_at(self, shift, kind, name):
        """A run of the bar at another place: its positions in double, where they are measured from, and what was printed."""
        lines = bar()[0].splitlines()
        for k in range(2, 2 + int(lines[1].split()[0])):
            number, *place = lines[k].split()
            lines[k] = " ".join([number, *(repr(float(x) + s) for x, s in zip(place, shift))])
        (self.folder / f"{name}.veg").write_text("\n".join(lines) + "\n")
        asset = json.loads((self.folder / f"{kind}.json").read_text())
        asset["object"] = {key: value for key, value in asset["object"].items() if key != "render_mesh"} | {"mesh": f"{name}.veg"}
        write_json(self.folder / f"{name}.json", asset | {"needs": ["rigid"]})
        self.call(PRECOMPUTE, "bundle", f"{name}.json", "-o", f"{name}.h5")
        write_json(self.folder / f"{name}_scene.json", {"bundle": f"{name}.h5", "time_step": 0.01, "steps": 40, "gravity": [0, 0, -9.81],
                                                        "output": {"trajectory": f"{name}_run.h5", "every": 10}})
        printed = self.call(RUNTIME, "run", f"{name}_scene.json")
        with h5py.File(self.folder / f"{name}_run.h5") as f:
            return f["vertices"][:].astype(float), f.attrs["origin"], printed

    def placed_mesh(self, name):
        """Points of the mesh of a .glb at rest, in double, and the translation of its node "origin"."""
        document, arrays = contents(self.folder / f"{name}.glb")
        nodes = {node["name"]: node for node in document["nodes"]}
        origin = np.array(nodes.get("origin", {}).get("translation", [0, 0, 0]))
        (body,) = [node for node in document["nodes"] if "mesh" in node]
        return arrays[document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]] + np.array(body["translation"]) + origin, origin

    def test_far_from_zero_positions_have_an_origin(self):
        shift = np.array([452345.5, 5412345.25, 312])
        for kind in ("free", "clamped"):
            near, none, printed = self.bar_at((0, 0, 0), kind, f"near_{kind}")
            self.assertFalse(none.any())
            self.assertNotIn("origin ", printed)
            far, origin, printed = self.bar_at(shift, kind, f"far_{kind}")
            self.assertTrue((origin == np.round(origin)).all() and abs(origin - shift).max() < 3)
            self.assertIn(f"origin {16 * ' '}{origin[0]:.0f} {origin[1]:.0f} {origin[2]:.0f} m", printed)
            self.assertLess(abs(far + (origin - shift) - near).max(), 2e-6)
            for name in ("near", "far"):
                self.export(f"{name}_{kind}_run.h5", "-o", f"{name}_{kind}.glb")
            (drawn_near, none), (drawn_far, origin) = self.placed_mesh(f"near_{kind}"), self.placed_mesh(f"far_{kind}")
            self.assertFalse(none.any())
            self.assertTrue(origin.all())
            self.assertLess(abs(drawn_far - shift - drawn_near).max(), 2e-6)
            self.assertIn("origin ", self.export(f"far_{kind}_run.h5", "-o", "far.usda"))
            self.assertIn(f"xformOp:translate = ({origin[0]:.0f}, ", (self.folder / "far.usda").read_text())
            self.assertIn("origin ", self.export(f"far_{kind}_run.h5", "-o", "far.pc2"))

    def refused(self, *words, status=2):
        before = set(self.folder.iterdir())
        message = self.call(RUNTIME, "export", *words, status=status)
        self.assertEqual(set(self.folder.iterdir()), before)
        return message

    def test_what_cannot_be_is_refused_in_words(self):
        run = "free_run.h5"
        self.assertIn("Alembic is not written", self.refused(run, "-o", "a.abc"))
        self.assertIn("expected an output with the extension .glb, .usda or .pc2, found \".fbx\"", self.refused(run, "-o", "a.fbx"))
        self.assertIn("expected a trajectory, or a bundle by --bundle, found neither", self.refused("-o", "a.glb"))
        self.assertIn("expected a trajectory to write as .usda", self.refused("--bundle", "free.h5", "-o", "a.usda"))
        self.assertIn("expected at most 8 targets", self.refused(run, "-o", "a.glb", "--targets", "9"))
        self.assertIn("--targets", self.refused(run, "-o", "a.usda", "--targets", "3"))
        self.assertIn("whose components", self.refused("--bundle", "free.h5", "-o", "a.glb", "--targets", "3"))
        self.assertIn("--frame-rate", self.refused(run, "-o", "a.glb", "--frame-rate", "3"))
        self.assertIn("/@input_sha256", self.refused(run, "--bundle", "clamped.h5", "-o", "a.glb"))
        self.assertIn("is this a trajectory?", self.refused("free.h5", "-o", "a.glb"))

    def test_a_trajectory_finds_its_bundle(self):
        moved = self.folder / "elsewhere"
        moved.mkdir(exist_ok=True)
        (moved / "lost.h5").write_bytes((self.folder / "free_run.h5").read_bytes())
        self.assertIn("name it by --bundle BUNDLE.h5", self.refused("elsewhere/lost.h5", "-o", "a.glb"))
        self.export("elsewhere/lost.h5", "--bundle", "free.h5", "-o", "motion.glb")
        self.check("free")
        call(RUNTIME, "export", self.folder / "free_run.h5", "-o", self.folder / "motion.glb", cwd="/")

    def test_damage_is_found(self):
        damaged = self.folder / "damaged.h5"
        for dataset, row in (("reduced", 3), ("body/position", 2)):
            damaged.write_bytes((self.folder / "free_run.h5").read_bytes())
            with h5py.File(damaged, "r+") as f:
                f[dataset][row, 0] += 1
            self.assertIn("checksum", self.refused("damaged.h5", "-o", "a.glb"))
        # Times that do not increase, or are no numbers, in every format.
        for times in ((0, np.nan), (2, 1)):
            damaged.write_bytes((self.folder / "free_run.h5").read_bytes())
            with h5py.File(damaged, "r+") as f:
                f["time"][1:3] = times
            for target in ("a.glb", "a.usda", "a.pc2"):
                self.assertIn("/time", self.refused("damaged.h5", "-o", target))
        damaged.write_bytes((self.folder / "free_run.h5").read_bytes())
        with h5py.File(damaged, "r+") as f:
            del f["reduced"]
        self.assertIn("export it as .usda or .pc2", self.refused("damaged.h5", "-o", "a.glb"))

    def test_every_format_refuses_what_another_cannot_draw(self):
        damaged = self.folder / "damaged.h5"

        def refused_after(change, message):
            damaged.write_bytes((self.folder / "free_run.h5").read_bytes())
            with h5py.File(damaged, "r+") as f:
                change(f)
                for name in ("time", "vertices", "render/vertices", "reduced", "body/position", "body/orientation"):
                    f[name].attrs["crc32"] = np.uint32(zlib.crc32(f[name][:].tobytes()))
            for target in ("a.glb", "a.usda", "a.pc2"):
                self.assertIn(message, self.refused("damaged.h5", "-o", target))

        for name in ("vertices", "render/vertices", "reduced", "body/position", "body/orientation"):
            def spoil(f, name=name):
                f[name][3] = np.nan
            refused_after(spoil, f"/{name}")
        refused_after(lambda f: f.attrs.__setitem__("origin", [0, np.nan, 0]), "/@origin: expected three finite numbers")
        refused_after(lambda f: f["time"].write_direct(f["time"][:] * 1e300), "/time: expected times of at most 1e+30 s, found 1e+300 s")


if __name__ == "__main__":
    unittest.main()
