"""The add-on inside Blender, without a window: bundle, play, bake, and what an artist does wrong.

Usage: blender --background --factory-startup --python-exit-code 1 --python blender_check.py -- BUILD_FOLDER FOLDER [TEST ...]
"""
import sys
import unittest
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import stage  # noqa: E402
from stage import FOLDER, bar, evaluated, fresh, message, stand_askew, to_world, trajectory_of  # noqa: E402

FRAMES = 50
CLOSE = 1e-5  # of the size: coordinates are in single precision here and there


def made(obj, clamp="clamp", **settings):
    """The object with a bundle."""
    obj.exmat.clamp = clamp
    for name, value in settings.items():
        setattr(obj.exmat, name, value)
    assert bpy.ops.exmat.precompute(wait=True) == {"FINISHED"}, obj.exmat.message
    return obj


class Motion(unittest.TestCase):
    def agrees(self, found, expected):
        size = np.ptp(expected[0], axis=0).max()
        self.assertLess(np.abs(found - expected).max(), CLOSE * size)
        self.assertGreater(np.abs(found[-1] - found[0]).max(), 0.01 * size)  # it has moved

    def shown(self, obj, scene):
        frames = []
        for frame in range(1, FRAMES + 1):
            scene.frame_set(frame)
            frames.append(evaluated(obj))
        return np.array(frames)

    def expected(self, obj, scene):
        from exmat_blender import playing

        members = playing.Session(obj, scene).scene
        self.assertEqual(scene.frame_current, 1)
        body = trajectory_of(members, FRAMES, obj.exmat.steps)
        return to_world(body, obj.matrix_world, scene.unit_settings.scale_length)

    def check_all(self, obj, scene):
        scene.frame_set(1)
        still, matrix = evaluated(obj), obj.matrix_world.copy()
        expected = self.expected(obj, scene)
        self.assertEqual(bpy.ops.exmat.play(), {"FINISHED"}, obj.exmat.message)
        self.agrees(self.shown(obj, scene), expected)
        scene.frame_set(20)  # back: as it was simulated
        self.assertLess(np.abs(evaluated(obj) - expected[19]).max(), CLOSE * np.ptp(still, axis=0).max())
        self.agrees(self.shown(obj, scene), expected)  # twice
        bpy.ops.exmat.stop()
        scene.frame_set(1)
        self.assertFalse(np.any(evaluated(obj) - still))

        self.assertEqual(bpy.ops.exmat.bake_cache(), {"FINISHED"}, obj.exmat.message)
        self.agrees(self.shown(obj, scene), expected)
        self.assertEqual(bpy.ops.exmat.bake_keys(), {"FINISHED"}, obj.exmat.message)
        self.assertNotIn("exmat", obj.modifiers)
        self.agrees(self.shown(obj, scene), expected)
        bpy.ops.wm.save_mainfile()
        bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
        obj, scene = bpy.data.objects["bar"], bpy.context.scene
        self.agrees(self.shown(obj, scene), expected)
        bpy.ops.exmat.clear()
        scene.frame_set(1)
        self.assertFalse(np.any(evaluated(obj) - still))
        self.assertEqual(obj.matrix_world, matrix)
        self.assertFalse([key.name for key in obj.data.shape_keys.key_blocks if key.name.startswith("exmat")])

    def test_clamped_askew_in_centimetres(self):
        scene = fresh(unit=0.01, frames=FRAMES)
        obj = bar(keys=("bow", "twist"))
        stand_askew(obj)
        self.check_all(made(obj), scene)

    def test_free_askew_onto_a_floor(self):
        scene = fresh(unit=0.5, frames=FRAMES)
        obj = bar()
        stand_askew(obj)
        obj.exmat.floor, obj.exmat.floor_height = True, -2.0
        self.check_all(made(obj, clamp=""), scene)

    def test_the_object_carries_a_clamped_body(self):
        scene = fresh(unit=0.1, frames=FRAMES)
        obj = bar()
        stand_askew(obj)
        for frame, place, turn in ((1, (1, -2, 3), 1.2), (15, (2, -2, 3.5), 1.5), (40, (1, 0, 3), -1)):
            obj.location, obj.rotation_euler.z = place, turn
            obj.keyframe_insert("location", frame=frame)
            obj.keyframe_insert("rotation_euler", frame=frame)
        scene.frame_set(1)
        self.check_all(made(obj), scene)

    def test_regions(self):
        scene = fresh(frames=FRAMES)
        obj = bar(keys=("bow", "twist"))
        row = obj.exmat.regions.add()
        row.group, row.key = "tip", "twist"
        self.check_all(made(obj), scene)

    def test_an_empty_draws_the_body(self):
        scene = fresh(frames=FRAMES)
        obj = made(bar(), clamp="clamp")
        scene.cursor.location = (3, 0, 0)
        bpy.ops.exmat.add_grip()
        empty = obj.exmat.grips[0].target
        bpy.context.view_layer.update()
        empty.keyframe_insert("location", frame=1)
        empty.location = (2.5, 1.0, 1.0)
        empty.keyframe_insert("location", frame=20)
        obj.exmat.stiffness, obj.exmat.steps = 0, 40
        bpy.ops.exmat.play()
        shown = self.shown(obj, scene)
        vertex = np.linalg.norm(shown[0] - [3, 0, 0], axis=1).argmin()
        self.assertLess(np.linalg.norm(shown[-1][vertex] - empty.location), 0.1 * np.linalg.norm([0.5, 1, 1]))
        bpy.ops.exmat.stop()
        bpy.ops.exmat.bake_cache()
        self.agrees(self.shown(obj, scene), shown)
        bpy.ops.exmat.clear()
        # Dragged by hand while it plays: no keys, and frames beyond those that were simulated follow.
        empty.animation_data_clear()
        empty.location = (3, 0, 0)
        bpy.ops.exmat.play()
        scene.frame_set(5)
        empty.location = (2.5, -1, 1)
        bpy.context.view_layer.update()
        scene.frame_set(40)
        self.assertLess(np.linalg.norm(evaluated(obj)[vertex] - empty.location), 0.1 * np.linalg.norm([0.5, 1, 1]))


class Mistakes(unittest.TestCase):
    def says(self, words, operator=None, **arguments):
        found = message(operator or bpy.ops.exmat.precompute, **arguments)
        self.assertRegex(found, words)
        self.assertTrue(bpy.context.object.exmat.failed)

    def test_inputs(self):
        fresh()
        obj = bar()
        obj.exmat.clamp = "nothing"
        self.says("There is no vertex group 'nothing'")
        obj.vertex_groups.new(name="nothing")
        self.says("clamp's vertex group is empty")
        obj.exmat.clamp = "clamp"
        obj.shape_key_add(name="idle", from_mix=False)
        self.says("'idle' moves nothing")
        obj.data.shape_keys.key_blocks["idle"].mute = True
        row = obj.exmat.regions.add()
        self.says("region has no vertex group")
        row.group, row.key = "tip", "idle"
        self.says("'idle', which is not there or is muted")
        obj.exmat.regions.clear()
        obj.scale = (1, 0, 1)
        bpy.context.view_layer.update()
        self.says("scale is 0 along an axis")
        obj.scale = (1, 1, 1)
        obj.exmat.bundle = "/nowhere/at/all.h5"
        self.says("no folder /nowhere/at")
        obj.exmat.bundle = ""
        bpy.ops.object.mode_set(mode="EDIT")
        self.says("Leave edit mode")
        bpy.ops.object.mode_set(mode="OBJECT")
        self.says("no bundle yet", bpy.ops.exmat.play)
        obj.data.shape_keys.use_relative = False
        self.says("shape keys are absolute")

    def test_no_faces(self):
        fresh()
        mesh = bpy.data.meshes.new("dots")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
        obj = bpy.data.objects.new("dots", mesh)
        bpy.context.collection.objects.link(obj)
        bpy.context.view_layer.objects.active = obj
        self.says("no faces")

    def test_what_the_program_refuses(self):
        fresh()
        obj = bar()
        other = bar(size=(0.1, 0.1, 0.1), keys=(), cells=(2, 2, 2))
        other.location = (50, 0, 0)
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = obj
        bpy.ops.object.join()
        self.says("(?i)one body|component|parts|apart", wait=True)

    def test_an_unsaved_file(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        import addon_utils

        addon_utils.enable("exmat_blender", default_set=True)
        obj = bar()
        self.says("Save the file first")
        obj.exmat.bundle = str(FOLDER / "unsaved.h5")
        self.assertEqual(bpy.ops.exmat.precompute(wait=True), {"FINISHED"})
        self.says("Save the file first: the cache", bpy.ops.exmat.bake_cache)

    def test_no_library(self):
        from exmat_blender import library
        from exmat_blender.fault import Fault

        with self.assertRaisesRegex(Fault, "no package exmat in /nowhere"):
            library.load("/nowhere")
        fresh()
        obj = bar()
        bpy.context.preferences.addons["exmat_blender"].preferences.program = str(FOLDER / "nowhere")
        obj.exmat.clamp = "clamp"
        self.says("nowhere")

    def test_a_changed_mesh(self):
        fresh()
        obj = made(bar())
        obj.scale = (1, 1, 2)
        bpy.context.view_layer.update()
        self.says("changed since the bundle was made", bpy.ops.exmat.play)
        obj.scale = (1, 1, 1)
        obj.location, obj.rotation_euler = (5, 5, 5), (1, 0, 0)  # another place is no other body
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.exmat.play(), {"FINISHED"})

    def test_no_shape_keys_an_open_mesh_and_a_modifier(self):
        scene = fresh(frames=FRAMES)
        obj = bar(keys=())
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="DESELECT")
        bpy.ops.object.mode_set(mode="OBJECT")
        obj.data.polygons[0].select = True
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.delete(type="ONLY_FACE")
        bpy.ops.object.mode_set(mode="OBJECT")
        obj.modifiers.new("smooth", "SUBSURF")
        made(obj)
        self.assertRegex(obj.exmat.message, "No shape keys.*mesh is open")
        before = len(evaluated(obj))
        bpy.ops.exmat.play()
        scene.frame_set(10)
        self.assertEqual(len(evaluated(obj)), before)
        bpy.ops.exmat.stop()
        self.assertIsNone(obj.data.shape_keys)
        bpy.ops.exmat.bake_cache()
        self.assertEqual(obj.modifiers[0].name, "exmat")
        self.assertEqual(len(evaluated(obj)), before)
        bpy.ops.exmat.bake_keys()
        bpy.ops.exmat.clear()
        self.assertIsNone(obj.data.shape_keys)

    def test_cancelled_in_the_middle(self):
        from exmat_blender import jobs

        fresh()
        obj = bar()
        obj.exmat.clamp, obj.exmat.training, obj.exmat.modes = "clamp", "runs", 30
        bpy.ops.exmat.precompute()
        self.says("made already")
        while not obj.exmat.message.startswith(("training", "basis", "linear")) and obj.name in jobs.running:
            jobs.running[obj.name].job.wait(0.1)
            jobs.look()
        self.assertIn("s", obj.exmat.message)
        self.says("being made: wait", bpy.ops.exmat.play)
        bpy.ops.exmat.cancel()
        self.assertEqual(obj.exmat.message, "Cancelled.")
        self.assertFalse((FOLDER / "bar.h5").exists() and obj.exmat.made_of)
        self.says("no bundle yet", bpy.ops.exmat.play)
        bpy.ops.exmat.precompute()
        fresh("other.blend")  # another file in the middle
        self.assertFalse(jobs.running)

    def test_undo_and_reload_while_it_plays(self):
        from exmat_blender import playing

        scene = fresh(frames=FRAMES)
        obj = made(bar())
        still = evaluated(obj)
        bpy.ops.ed.undo_push(message="before")
        bpy.ops.exmat.play()
        scene.frame_set(10)
        bpy.ops.ed.undo_push(message="played")
        bpy.ops.ed.undo()
        scene, obj = bpy.context.scene, bpy.data.objects["bar"]
        scene.frame_set(11)
        self.assertTrue(np.any(evaluated(obj) - still))
        bpy.ops.wm.save_mainfile()
        bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
        obj = bpy.data.objects["bar"]
        self.assertFalse(playing.playing)
        self.assertFalse(np.any(evaluated(obj) - still))
        bpy.ops.exmat.play()
        bpy.data.objects.remove(obj)
        bpy.context.scene.frame_set(3)
        self.assertFalse(playing.playing)

    def test_what_was_animated_is_so_again(self):
        scene = fresh(frames=10)
        obj = bar()
        key = obj.data.shape_keys.key_blocks["bow"]
        for frame, value in ((1, 0.0), (10, 1.0)):
            key.value = value
            key.keyframe_insert("value", frame=frame)
            obj.location.x = value
            obj.keyframe_insert("location", frame=frame)
        made(obj, clamp="")
        scene.frame_set(10)
        before, actions = evaluated(obj), (obj.animation_data.action, obj.data.shape_keys.animation_data.action)
        bpy.ops.exmat.play()
        bpy.ops.exmat.stop()
        scene.frame_set(10)
        self.assertFalse(np.any(evaluated(obj) - before))
        bpy.ops.exmat.bake_keys()
        bpy.ops.exmat.bake_keys()
        self.assertTrue(key.mute)
        self.assertEqual(len(bpy.data.actions), 4)
        bpy.ops.exmat.clear()
        scene.frame_set(10)
        self.assertEqual((obj.animation_data.action, obj.data.shape_keys.animation_data.action), actions)
        self.assertFalse(np.any(evaluated(obj) - before))
        self.assertEqual(len(bpy.data.actions), 2)

    def test_what_cannot_be_keyed(self):
        fresh(frames=5)
        obj = made(bar(), clamp="")
        twin = bpy.data.objects.new("twin", obj.data)
        bpy.context.collection.objects.link(twin)
        self.says("Other objects share the mesh", bpy.ops.exmat.bake_keys)
        bpy.data.objects.remove(twin)
        obj.constraints.new("LIMIT_LOCATION")
        self.says("has constraints", bpy.ops.exmat.bake_keys)
        self.assertEqual(bpy.ops.exmat.bake_cache(), {"FINISHED"})
        obj.constraints.clear()
        parent = bpy.data.objects.new("parent", None)
        bpy.context.collection.objects.link(parent)
        obj.parent, parent.scale, obj.rotation_euler = parent, (1, 2, 1), (0, 0, 0.5)
        bpy.context.view_layer.update()
        bpy.ops.exmat.precompute(wait=True)
        self.says("sheared by its parent", bpy.ops.exmat.bake_keys)
        self.assertEqual(bpy.ops.exmat.bake_cache(), {"FINISHED"})

    def test_undo_leaves_the_bundle_known(self):
        fresh(frames=5)
        bpy.ops.ed.undo_push(message="begin")
        obj = made(bar())
        obj.exmat.bias = 0.1
        bpy.ops.ed.undo_push(message="bias")
        bpy.ops.ed.undo()
        self.assertAlmostEqual(bpy.data.objects["bar"].exmat.bias, 0.5)
        self.assertEqual(bpy.ops.exmat.play(), {"FINISHED"})
        bpy.context.object.name = "other"
        bpy.context.scene.frame_set(3)
        bpy.ops.exmat.stop()
        self.assertNotIn("exmat live", bpy.context.object.data.shape_keys.key_blocks)

    def test_a_body_that_cannot_be_stepped(self):
        from exmat_blender import playing

        scene = fresh(frames=FRAMES)
        obj = made(bar())
        bpy.ops.exmat.play()
        session = playing.playing["bar"]
        exmat, step = session.player._exmat, session.player.model.time_step
        session.player.body = exmat.Body(exmat.Model(session.scene["bundle"], time_step=step, stiffness_damping=1e300))
        session.player.body.set_reduced(np.full(12, 1e30), np.full(12, 1e30))
        scene.frame_set(2)
        self.assertRegex(obj.exmat.message, "simulation stopped at")
        self.assertNotIn("exmat live", obj.data.shape_keys.key_blocks)


if __name__ == "__main__":
    rest = sys.argv[sys.argv.index("--") + 3 :]
    done = unittest.main(argv=["blender_check", "-v", *rest], exit=False)
    sys.exit(0 if done.result.wasSuccessful() else 1)
