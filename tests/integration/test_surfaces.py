#!/usr/bin/python3
"""Bundles from surfaces as an artist has them: one .glb with and without an asset, parts by name, poses of every kind.

Usage: test_surfaces.py FOLDER_OF_PROGRAMS    (Debian: python3-h5py)
"""
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

from programs import UINT, Glb, tube

PROGRAMS = Path(sys.argv.pop(1)).resolve()
PRECOMPUTE = PROGRAMS / "exmat-precompute"
LENGTH = 3.0  # of the tube [m]


def bent(points, degrees):
    """About y, from the end at x = 0; lengths along the axis stay."""
    curvature = np.radians(degrees) / LENGTH
    angle, radius = curvature * points[:, 0], 1 / curvature - points[:, 2]
    return np.stack([radius * np.sin(angle), points[:, 1], 1 / curvature - radius * np.cos(angle)], 1)


def twisted(points, degrees):
    angle = np.radians(degrees) * points[:, 0] / LENGTH
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([points[:, 0], c * points[:, 1] - s * points[:, 2], s * points[:, 1] + c * points[:, 2]], 1)


def write_glb(path, points, triangles, morphs=None, attributes=None, materials=None, colours=None, node=None):
    """`materials`: name -> rows of the triangles, a primitive each. `morphs`: name -> points."""
    glb = Glb()
    mesh = {"name": "tube mesh", "primitives": []}
    glb.json |= {"nodes": [{"mesh": 0, "name": "tube", **(node or {})}], "meshes": [mesh]}
    named = {"POSITION": glb.floats(points, "VEC3")}
    for name, values in (attributes or {}).items():
        named[name] = glb.floats(values, "SCALAR")
    if colours is not None:
        named["COLOR_0"] = glb.floats(colours, "VEC3")
    targets = [{"POSITION": glb.floats(posed - points, "VEC3")} for posed in (morphs or {}).values()]
    if morphs:
        mesh["extras"] = {"targetNames": list(morphs)}
    for name, rows in (materials or {None: slice(None)}).items():
        primitive = {"attributes": named, "indices": glb.accessor(triangles[rows].ravel(), UINT, "SCALAR")}
        if morphs:
            primitive["targets"] = targets
        if name:
            glb.json.setdefault("materials", []).append({"name": name})
            primitive["material"] = len(glb.json["materials"]) - 1
        mesh["primitives"].append(primitive)
    glb.write(path)


def write_obj(path, points, triangles):
    path.write_text("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()) +
                    "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles.tolist()))


def write_pc2(path, frames):
    path.write_bytes(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, len(frames[0]), 0, 1, len(frames)) +
                     np.array(frames, "<f4").tobytes())


class Surfaces(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A cache of stages that all bundles share: most of their time would go into the same cage of the same tube."""
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.cache = ("--cache", holder.name)

    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)
        self.points, self.triangles = tube()
        self.clamp = self.points[:, 0] < 0.3
        write_glb(self.folder / "tube.glb", self.points, self.triangles, {"bend": bent(self.points, 90), "twist": twisted(self.points, 120)},
                  {"_FIXED": self.clamp})

    def run_program(self, *words, status=0, program=PRECOMPUTE, **more):
        done = subprocess.run([program, *words], cwd=self.folder, capture_output=True, text=True, timeout=200, **more)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stdout + done.stderr

    def asset(self, name="asset.json", **changes):
        asset = {"name": "tube", "object": {"surface": "tube.glb", "cells": 400, "fixed": {"part": "_FIXED"},
                                            "material": {"youngs_modulus": 1e5, "poisson_ratio": 0.4, "density": 1000}},
                 "shape_space": {"eigenfunctions": 8}, "basis": {"size": 8, "linear_modes": 5, "training": "none"},
                 "cubature": {"elements": 16, "training_poses": 20}, "needs": ["examples", "render"], "examples": []}
        for key, value in changes.items():
            asset[key] = {**asset.get(key, {}), **value} if isinstance(value, dict) else value
        (self.folder / name).write_text(json.dumps(asset))
        return name

    def bundle(self, **changes):
        printed = self.run_program("bundle", self.asset(**changes), "-o", "tube.h5", *self.cache)
        return h5py.File(self.folder / "tube.h5"), printed

    def refused(self, **changes):
        before = {path.name for path in self.folder.iterdir()} | {"asset.json"}
        printed = self.run_program("bundle", self.asset(**changes), "-o", "none.h5", *self.cache, status=2)
        self.assertEqual({path.name for path in self.folder.iterdir()}, before)
        return printed

    def test_one_file_without_an_asset(self):
        # By a relative name and from another folder; what is written down makes the same bundle. Its stages come from
        # the cache only if all that they depend on is the same.
        self.run_program("bundle", "tube.glb", "-o", "a.h5", "--write-asset", "asset.json", *self.cache)
        asset = json.loads((self.folder / "asset.json").read_text())
        self.assertEqual(asset["object"]["surface"], "tube.glb")
        self.assertEqual([example["morph"] for example in asset["examples"]], ["bend", "twist"])
        self.run_program("bundle", "asset.json", "-o", "b.h5", *self.cache)
        with h5py.File(self.folder / "a.h5") as a, h5py.File(self.folder / "b.h5") as b:
            for name in ("object/vertices", "object/tets", "object/fixed", "modal/basis", "cubature/weights", "examples/bend/pose", "render/vertices"):
                np.testing.assert_array_equal(a[name][:], b[name][:], name)
            rest = a["render/vertices"][:]
            np.testing.assert_allclose(rest, np.float32(self.points), rtol=0, atol=1e-7)
            fixed = a["object/vertices"][:][a["object/fixed"][:] > 0]
            self.assertGreater(len(fixed), 5)
            self.assertLess(fixed[:, 0].max(), 0.3 + 0.5)  # within a cell of the mark
            self.assertLess(a["render"].attrs["farthest"], 0.2)  # half a cell

    def test_a_clamp_that_poses_move_follows_where_the_scene_lets_it(self):
        # Each run ends early, by a region that is not there, when the asset is written.
        spread = self.points * np.where(self.clamp, 1.5, 1)[:, None]
        write_glb(self.folder / "feet.glb", self.points, self.triangles, {"spread": spread}, {"_FIXED": self.clamp})
        for more, reason in (({}, ""), ({"integrator": "newmark"}, "the integrator newmark"),
                             ({"examples": {"stiffness": 1, "force": "elastic"}}, "an elastic example force"),
                             ({"body": {"motion": [{"time": 0}]}}, "a motion that carries the body")):
            scene = {"bundle": "a.h5", "examples": {"stiffness": 1}, "regions": [{"name": "none", "stiffness": 1}], **more}
            (self.folder / "scene.json").write_text(json.dumps(scene))
            printed = self.run_program("bundle", "feet.glb", "-o", "a.h5", "--scene", "scene.json", "--write-asset", "asset.json", status=2)
            asset = json.loads((self.folder / "asset.json").read_text())
            self.assertEqual(asset["object"]["fixed"].get("follow", False), not reason, printed)
            if reason:
                self.assertIn(f"the clamp stands still, also where poses move it: it follows none in a scene with {reason}", printed)
            else:
                self.assertIn("clamped at _FIXED, which poses move: it follows them", printed)

    def test_what_new_writes_becomes_a_motion_by_the_commands_that_it_prints(self):
        printed = self.run_program("new", "tube.glb")
        self.assertEqual({path.name for path in (self.folder / "tube").iterdir()}, {"asset.json", "scene.json"})
        commands = [line.split() for line in printed.splitlines() if line.startswith("  exmat-")]
        self.assertEqual([command[:2] for command in commands],
                         [["exmat-precompute", "bundle"], ["exmat-runtime", "run"], ["exmat-runtime", "export"]])
        # A coarser body shows the same; pages and an example take the default.
        asset = json.loads((self.folder / "tube/asset.json").read_text())
        asset["object"]["cells"] = 400
        (self.folder / "tube/asset.json").write_text(json.dumps(asset))
        for command in commands:
            self.run_program(*command[1:], program=PROGRAMS / command[0])
        self.assertTrue((self.folder / "tube/tube_run.glb").exists())
        with h5py.File(self.folder / "tube/tube.h5") as bundle, h5py.File(self.folder / "tube/tube_run.h5") as run:
            # The body is as near to each pose as it can be, under gravity and by a force that is not strong, when it has had the weight.
            times, frames, rest = run["time"][:], run["vertices"][:], bundle["object/vertices"][:]
            basis = bundle["modal/basis"][:]
            for k, name in enumerate(("bend", "twist")):
                example = bundle["examples"][name]
                self.assertAlmostEqual(example.attrs["settled_error"], example.attrs["best_error"], delta=0.02)
                held = frames[np.abs(times - (2 * k + 1.5)).argmin()] - rest
                # Both poses move the clamp, which follows: what they do there shifts the body.
                pose = np.tensordot(basis, example["pose"][:], 1) + bundle["skeleton/shifts"][k + 1]
                self.assertLess(np.linalg.norm(held - pose), 0.15 * np.linalg.norm(pose), name)
        refused = self.run_program("new", "tube.glb", status=2)
        self.assertIn("tube/asset.json: expected no such file yet", refused)
        self.run_program("new", "tube.glb", "-o", "other/place")
        self.assertEqual(json.loads((self.folder / "other/place/asset.json").read_text())["object"]["surface"], "../../tube.glb")
        # A free body lands on a floor at the height of its lowest point.
        write_glb(self.folder / "loose.glb", self.points, self.triangles)
        self.run_program("new", "loose.glb")
        scene = json.loads((self.folder / "loose/scene.json").read_text())
        self.assertAlmostEqual(scene["obstacles"][0]["plane"]["point"][1], self.points[:, 1].min(), places=6)
        self.assertIn("a surface with the extension .glb", self.run_program("new", "tube/asset.json", status=2))

    def test_targets_as_exporters_write_them(self):
        """The rest shape as a target, names that no bundle can hold, vertices of no triangle."""
        posed = bent(self.points, 90)
        write_glb(self.folder / "tube.glb", self.points, self.triangles,
                  {"rest": self.points, "moved": self.points + (0.2, 0, 0.1), "left/smile": posed, "h0": posed, "left_smile": posed, 40 * "\u00e9": posed})
        printed = self.run_program("check", "tube.glb")
        self.assertIn('the morph target "rest" moves no vertex and is left out', printed)
        self.assertIn('the morph target "moved" moves the body as a whole and is left out', printed)
        self.assertIn('the morph target "left/smile" is the example "left_smile 2"', printed)
        for name in ("left_smile 2", "h0_", "left_smile", 32 * "\u00e9"):
            self.assertRegex(printed, rf"{name} *same_connectivity")
        write_glb(self.folder / "plain.glb", self.points, self.triangles)
        self.assertIn("has no examples", self.run_program("check", "plain.glb"))
        # A vertex far away would make tets of 100 m.
        loose = np.concatenate([self.points, [[1000, 0, 0]]])
        write_glb(self.folder / "loose.glb", loose, self.triangles)
        plain, loose = (self.run_program("mesh", name, "-o", "a.msh") for name in ("plain.glb", "loose.glb"))
        size = lambda printed: printed.split("tets")[1].split()[0]
        self.assertEqual(size(plain), size(loose))
        self.assertIn("1 vertices of no triangle", loose)

    def test_lengths_in_another_unit(self):
        """In centimetres the same body; a body of 300 m is asked for its unit."""
        write_glb(self.folder / "large.glb", 100 * self.points, self.triangles, {"bend": 100 * bent(self.points, 90)}, {"_FIXED": self.clamp})
        bend = [{"name": "bend", "morph": "bend"}]
        found = {}
        for unit, changes in (("cm", {"surface": "large.glb", "unit": "cm"}), ("m", {})):
            file, _ = self.bundle(object=changes, examples=bend)
            with file:
                found[unit] = [np.ptp(file[name][:]) for name in ("render/vertices", "object/vertices")]
                self.assertLess(file["examples/bend"].attrs["surface_rms"], 0.01)
        np.testing.assert_allclose(found["cm"], found["m"], rtol=0.02)
        printed = self.run_program("check", self.asset(object={"surface": "large.glb"}, examples=bend))
        self.assertIn('object.unit of the asset, "mm" or "cm"', printed)

    def test_check_takes_a_surface(self):
        printed = self.run_program("check", "tube.glb")
        for name in ("bend", "twist"):
            self.assertRegex(printed, rf"{name} +same_connectivity")

    def test_poses_of_every_kind_are_the_same_pose(self):
        posed = bent(self.points, 90)
        write_obj(self.folder / "posed.obj", posed, self.triangles)
        write_pc2(self.folder / "posed.pc2", [self.points, posed])
        write_glb(self.folder / "other.glb", self.points, self.triangles, {"there": posed})
        file, _ = self.bundle(examples=[{"name": "morph", "morph": "bend"}, {"name": "obj", "surface": "posed.obj"},
                                        {"name": "frame", "surface": "posed.pc2", "frame": 1},
                                        {"name": "other", "surface": "other.glb", "morph": "there"}])
        with file:
            sources = {"morph": "bend", "obj": "posed.obj", "frame": "posed.pc2", "other": "there"}
            self.assertEqual(sources, {name: file[f"examples/{name}"].attrs["source"].decode() for name in sources})
            poses = {name: file[f"examples/{name}/pose"][:] for name in sources}
            size = np.linalg.norm(poses["morph"])
            for name, pose in poses.items():  # single precision in the files: 1e-7 of 3 m, of a pose of 2 m
                self.assertLess(np.linalg.norm(pose - poses["morph"]), 1e-5 * size, name)
                self.assertIn("same_connectivity", str(file[f"examples/{name}"].attrs["method"]))
                self.assertLess(file[f"examples/{name}"].attrs["surface_rms"], 0.01)

    def test_a_surface_of_other_vertices_is_registered(self):
        points, triangles = tube()
        finer = np.concatenate([points, points[triangles].mean(1)])
        split = np.concatenate([[(a, b, len(points) + k), (b, c, len(points) + k), (c, a, len(points) + k)] for k, (a, b, c) in enumerate(triangles)])
        write_obj(self.folder / "someone.obj", bent(finer, 30), split)
        file, printed = self.bundle(examples=[{"name": "morph", "morph": "bend"}, {"name": "someone", "surface": "someone.obj"}])
        with file:
            self.assertNotIn("same_connectivity", str(file["examples/someone"].attrs["method"]))
            self.assertEqual(file["examples/someone"].attrs["surface_iterations"], 0)

    def test_parts_by_material_colour_node_and_transform(self):
        left = self.points[self.triangles].mean(1)[:, 0] < 1.5
        colours = np.where(self.points[:, :1] < 0.3, [[1.0, 0, 0]], [[0.2, 0.2, 0.2]])
        write_glb(self.folder / "tube.glb", self.points, self.triangles, None, None, {"steel": np.flatnonzero(left), "rubber": np.flatnonzero(~left)},
                  colours, {"translation": [10, 0, 0]})
        file, _ = self.bundle(object={"fixed": {"color": {"rgb": [1, 0, 0]}}, "materials": [
            {"tets": {"part": "rubber"}, "youngs_modulus": 1e4, "poisson_ratio": 0.3, "density": 500}]})
        with file:
            x = file["object/vertices"][:][:, 0] - 10
            fixed = file["object/fixed"][:] > 0
            self.assertGreater(fixed.sum(), 5)
            self.assertLess(x[fixed].max(), 0.8)
            self.assertGreater(x[~fixed].min(), 0.1)
            middles = x[file["object/tets"][:]].mean(1)
            soft = file["object/density"][:] == 500
            self.assertGreater(middles[soft].min(), 1.5 - 0.3)
            self.assertLess(middles[~soft].max(), 1.5 + 0.3)

    def test_a_scene_names_places_as_an_asset_does(self):
        write_glb(self.folder / "tube.glb", self.points, self.triangles, attributes={"_FIXED": self.clamp, "_TIP": self.points[:, 0] > LENGTH - 0.3},
                  colours=np.where(self.points[:, :1] > LENGTH / 2, [[0.9, 0, 0]], [[0, 0, 0.9]]))
        # What the asset's own clamp takes of each is the reference.
        places = {"tip": {"part": "_TIP"}, "red": {"color": {"rgb": [0.9, 0, 0]}}, "box": {"box": {"min": [1, -1, -1], "max": [2, 1, 1]}},
                  "ball": {"sphere": {"center": [LENGTH, 0, 0], "radius": 0.4}}}
        selected = {}
        for name, place in places.items():
            with self.bundle(object={"fixed": place})[0] as f:
                selected[name] = np.flatnonzero(f["object/fixed"][:])
                rest = f["object/vertices"][:]
        self.assertGreater(len(selected["tip"]), 3)
        places["point"], selected["point"] = {"point": [LENGTH, 0, 0.1]}, np.array([np.linalg.norm(rest - [LENGTH, 0, 0.1], axis=1).argmin()])
        self.bundle()[0].close()

        def run(vertices, status=0):
            scene = {"bundle": "tube.h5", "time_step": 0.01, "steps": 10, "forces": [{"vertices": vertices, "force": [0, 0, 0.5]}],
                     "output": {"trajectory": "run.h5", "every": 10}}
            (self.folder / "scene.json").write_text(json.dumps(scene))
            printed = self.run_program("run", "scene.json", program=PROGRAMS / "exmat-runtime", status=status)
            if status:
                return printed
            with h5py.File(self.folder / "run.h5") as f:
                return f["reduced"][:]

        for name, place in places.items():
            with self.subTest(name):
                by_ids = run({"ids": selected[name].tolist()})
                self.assertGreater(np.abs(by_ids[-1]).max(), 0)
                np.testing.assert_array_equal(run(place), by_ids)
        self.assertIn('/forces/0/vertices/part: expected a part of the surface of', run({"part": "_TPI"}, 2))
        self.assertIn('did you mean "_TIP"?', run({"part": "_TPI"}, 2))
        self.assertIn("m off; the mesh lies in", run({"point": [100, 0, 0]}, 2))
        # Training by a scene takes them, too, before there is a bundle.
        scene = json.loads((self.folder / "scene.json").read_text())
        digests = {}
        for name, vertices in (("place", places["tip"]), ("ids", {"ids": selected["tip"].tolist()})):
            scene["forces"][0]["vertices"] = vertices
            (self.folder / "scene.json").write_text(json.dumps(scene))
            self.run_program("bundle", self.asset(), "--scene", "scene.json", "-o", f"{name}.h5", *self.cache)
            with h5py.File(self.folder / f"{name}.h5") as f:
                digests[name] = f.attrs["input_sha256"], f["modal/basis"][:].tobytes()
        self.assertEqual(digests["place"], digests["ids"])

    def test_what_is_wrong_is_said(self):
        self.assertIn('"bend", "twist"', self.refused(examples=[{"name": "wave", "morph": "wave"}]))
        self.assertIn("_FIXED", self.refused(object={"fixed": {"part": "feet"}}))
        self.assertIn("asset.json: /object", self.refused(object={"cells": 400, "cell_size": 0.2}))
        write_pc2(self.folder / "posed.pc2", [self.points])
        self.assertIn("frame", self.refused(examples=[{"name": "a", "surface": "posed.pc2", "frame": 3}]))
        write_pc2(self.folder / "posed.pc2", [self.points[:-1]])
        self.assertIn("posed.pc2", self.refused(examples=[{"name": "a", "surface": "posed.pc2", "frame": 0}]))
        inside_out = self.points * [1, 1, -1]
        write_obj(self.folder / "mirrored.obj", inside_out, self.triangles)
        mirrored = [{"name": "other", "surface": "mirrored.obj"}]
        self.assertIn("it is a mirror image of the object", self.refused(examples=mirrored))
        _, printed = self.bundle(examples=mirrored, alignment={"accept": True})
        self.assertIn("[warning] example other: the cage misses the pose by", printed)
        self.assertIn("[warning] example other: alignment doubtful: it is a mirror image of the object", printed)
        squeezed = self.points * [1, 1, 0]
        write_obj(self.folder / "mirrored.obj", squeezed, self.triangles)
        _, printed = self.bundle(examples=mirrored, alignment={"accept": True})
        self.assertRegex(printed, "warning. example other: .*it squeezes the body to .* times its thickness")
        self.assertNotIn("the surface is flat", printed)
        scattered = self.points[np.random.default_rng(1).permutation(len(self.points))]
        write_obj(self.folder / "mirrored.obj", scattered, self.triangles)
        self.assertRegex(self.refused(examples=mirrored), "example other: .* so its vertices are in another order")

    def test_what_is_hardly_meant_is_warned_of(self):
        def warning(**object):
            said = self.run_program("check", self.asset(object={"cells": 100, **object}))
            return "\n".join(line for line in said.splitlines() if "[warning]" in line)
        write_glb(self.folder / "flat.glb", self.points, self.triangles, node={"scale": [1, 1, 0]})
        said = warning(surface="flat.glb", fixed={"ids": [0]})
        self.assertIn('/nodes/0 "tube" is scaled by 0', said)
        self.assertIn("flat.glb: the surface is flat", said)
        write_obj(self.folder / "small.obj", self.points / 1000, self.triangles)
        self.assertIn("the object is 0.00", warning(surface="small.obj", fixed={"ids": [0]}))
        write_obj(self.folder / "far.obj", self.points + 1e9, self.triangles)
        self.assertIn("m from the origin", warning(surface="far.obj", fixed={"ids": [0]}))
        (self.folder / "bow.obj").write_text("".join(f"v {x} {y} {z}\n" for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
                                             + "f 1 3 2 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n")
        self.assertIn("1 face whose edges cross is cut", warning(surface="bow.obj", fixed={"ids": [0]}))

    def test_names_of_targets_do_not_reach_the_terminal(self):
        write_glb(self.folder / "names.glb", self.points, self.triangles, {"a\0b": self.points, "\x1b[31m\nred": self.points + 1})
        said = self.run_program("new", "names.glb", "-o", "made")
        self.assertRegex(said, r'"a\?b" moves no vertex|"\?\[31m\?red" moves the body as a whole')
        self.assertNotRegex(said, r"[\0\x1b]")

    def test_nothing_is_done_again_where_nothing_has_changed(self):
        name = self.asset(examples=[{"name": "bend", "morph": "bend"}])
        words = ("bundle", name, "-o", "tube.h5", *self.cache, "--depfile", "tube.d", "--if-changed")
        self.run_program(*words)
        made = os.stat(self.folder / "tube.h5").st_mtime_ns
        self.assertIn("nothing to do", self.run_program(*words))
        self.assertEqual(os.stat(self.folder / "tube.h5").st_mtime_ns, made)
        self.assertEqual((self.folder / "tube.d").read_text().count("tube.glb"), 1)
        write_glb(self.folder / "tube.glb", self.points, self.triangles, {"bend": bent(self.points, 60)}, {"_FIXED": self.clamp})
        self.assertNotIn("nothing to do", self.run_program(*words))

    def test_without_the_mesher_a_surface_is_refused_in_words(self):
        alone = self.folder / "alone"
        alone.mkdir()
        program = shutil.copy(PRECOMPUTE, alone)
        printed = self.run_program("bundle", "tube.glb", "-o", "none.h5", status=2, program=program)
        self.assertIn("exmat-meshing", printed)
        self.assertFalse((self.folder / "none.h5").exists())

    def test_the_cage_alone(self):
        printed = self.run_program("mesh", "tube.glb", "-o", "tube.msh")
        self.assertRegex(printed, r"tets +\d+")
        self.assertRegex(printed, r"dihedral angles")
        first = (self.folder / "tube.msh").read_bytes()
        self.run_program("mesh", "tube.glb", "-o", "again.msh")
        self.assertEqual((self.folder / "again.msh").read_bytes(), first)


if __name__ == "__main__":
    unittest.main()
