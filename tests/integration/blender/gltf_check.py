"""Round trip of glTF through Blender, without a window: what it exports becomes a bundle, what exmat-runtime exports it plays.

Usage: blender --background --factory-startup --python-exit-code 1 --python gltf_check.py -- BUILD_FOLDER FOLDER [TEST ...]
"""
import json
import subprocess
import sys
import unittest
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from stage import BUILD, FOLDER, bar, evaluated, fresh, posed, stand_askew  # noqa: E402

KEYS = ("bow", "twist")
RATE = 25  # frames a second, of the trajectory and of the scene
FRAMES = 50
MODES = 15


def run(program, *arguments):
    done = subprocess.run([str(BUILD / "bin" / program), *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def y_up(points):
    """From Blender's axes to those of glTF."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], 1)


def z_up(points):
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], -1)


def exported(name, fixed):
    """A bar as Blender exports it, askew; its world vertices at rest and in each pose, by the axes of glTF."""
    fresh(f"{name}.blend")
    obj = bar(name=name, keys=KEYS)
    if fixed:  # by a material: 3.4 does not export attributes of one's own
        for each in ("rubber", "_FIXED"):
            obj.data.materials.append(bpy.data.materials.new(each))
        for face in obj.data.polygons:
            face.material_index = int(face.center.x < 0.2)
    stand_askew(obj)
    rest = np.array([v.co[:] for v in obj.data.vertices], float)
    matrix = np.array(obj.matrix_world)
    path = FOLDER / f"{name}.glb"
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", use_selection=True, export_morph=True)
    places = {key: y_up((rest if key is None else posed(rest, key, 3.0)) @ matrix[:3, :3].T + matrix[:3, 3]) for key in (None, *KEYS)}
    return path, places


def nearest(points, others):
    """Largest distance of a point from the nearest of the others."""
    return max(np.linalg.norm(others - point, axis=1).min() for point in points)


class RoundTrip(unittest.TestCase):
    def test_what_blender_exports_becomes_a_bundle(self):
        import exmat

        path, places = exported("clamped", fixed=True)
        bundle, file = FOLDER / "clamped.h5", FOLDER / "clamped.json"
        run("exmat-precompute", "bundle", path, "-o", bundle, "--write-asset", file)  # as an artist would, without an asset
        asset = json.loads(file.read_text())
        self.assertEqual([example.get("morph") for example in asset["examples"]], list(KEYS))
        size = np.ptp(places[None], axis=0).max()
        with exmat.Bundle(bundle) as data:
            drawn = data["render/vertices"][:]
            self.assertLess(max(nearest(drawn, places[None]), nearest(places[None], drawn)), 1e-5 * size)
            self.assertIn("constrained", data.features)
            vertices, basis, tets = data["object/vertices"][:], data["modal/basis"][:], data["object/tets"][:]
            corners, shares = tets[data["render/tets"][:]], data["render/barycentric"][:]
            pairs = [np.linalg.norm(places[None] - point, axis=1).argmin() for point in drawn]
            for key in KEYS:
                self.assertLess(data.attributes_of(f"examples/{key}")["surface_rms"], 0.01)
                posed_tets = vertices + basis @ data[f"examples/{key}/pose"][:]
                carried = (posed_tets[corners] * shares[..., None]).sum(1)
                missed, moved = carried - places[key][pairs], places[key][pairs] - places[None][pairs]
                self.assertLess(np.linalg.norm(missed), 0.3 * np.linalg.norm(moved))  # what 20 eigenfunctions and 30 modes lose of it

    def test_blender_plays_what_the_runtime_exports(self):
        for fixed in (True, False):
            for targets in ((), ("--targets",)):
                with self.subTest(fixed=fixed, targets=targets):
                    self.plays(fixed, targets)

    def plays(self, fixed, targets):
        import h5py

        name = "carried" if fixed else "free"
        path, places = exported(name, fixed=False)
        body = {"surface": str(path), "cells": 500, "material": {"model": "stable_neo_hookean", "youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000}}
        if fixed:
            body["fixed"] = {"sphere": {"center": [1, 3, 2], "radius": 1}}
        file = FOLDER / f"{name}_asset.json"
        file.write_text(json.dumps({"name": name, "object": body, "examples": [{"name": key, "morph": key} for key in KEYS],
                                    "basis": {"size": MODES, "training": "none"}}))
        bundle, scene, motion = FOLDER / f"{name}.h5", FOLDER / f"{name}.json", FOLDER / f"{name}_motion.glb"
        run("exmat-precompute", "bundle", file, "-o", bundle)
        body = {} if fixed else {"body": {"angular_velocity": [1, 2, 3]}}
        scene.write_text(json.dumps({"bundle": str(bundle), "time_step": 1 / RATE / 20, "steps": 20 * (FRAMES - 1), "gravity": [0, -9.81, 0], **body,
                                     "examples": {"stiffness": 2000, "damping": 5, "bias": 0.2}, "output": {"every": 20, "render": True}}))
        run("exmat-runtime", "run", scene, "-o", FOLDER / f"{name}_run.h5")
        with h5py.File(FOLDER / f"{name}_run.h5") as data:
            expected = data["render/vertices"][:]
        if targets:
            targets = ("--targets", str(MODES))
        run("exmat-runtime", "export", FOLDER / f"{name}_run.h5", "-o", motion, *targets)

        scene = fresh(f"{name}_import.blend")
        scene.render.fps = RATE
        self.assertEqual(bpy.ops.exmat.import_motion(filepath=str(motion)), {"FINISHED"})
        obj = next(obj for obj in bpy.data.objects if obj.type == "MESH")
        size = np.ptp(expected[0], axis=0).max()
        for frame in np.linspace(0, FRAMES - 1, 10).astype(int):
            scene.frame_set(int(frame))
            found = evaluated(obj)
            self.assertEqual(found.shape, expected[frame].shape)
            self.assertLess(np.abs(found - z_up(expected[frame])).max(), 1e-5 * size, f"frame {frame}")
        self.assertGreater(np.abs(expected[-1] - expected[0]).max(), 0.01 * size)


if __name__ == "__main__":
    rest = sys.argv[sys.argv.index("--") + 3 :]
    done = unittest.main(argv=["gltf_check", "-v", *rest], exit=False)
    sys.exit(0 if done.result.wasSuccessful() else 1)
