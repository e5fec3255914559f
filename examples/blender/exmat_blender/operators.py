"""The panel's buttons."""
import bpy

from . import baking, jobs, playing, reading
from .fault import Fault


class Worded:
    """An operator whose faults go to the panel."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def execute(self, context):
        obj = context.object
        try:
            said = self.work(obj, context)
        except Fault as fault:
            jobs.say(obj, str(fault), failed=True)
            self.report({"WARNING"}, str(fault))
            return {"CANCELLED"}
        if said:
            jobs.say(obj, said)
        return {"FINISHED"}


class EXMAT_OT_precompute(Worded, bpy.types.Operator):
    """Make the bundle of this object, in the background"""

    bl_idname, bl_label = "exmat.precompute", "Precompute"
    wait: bpy.props.BoolProperty(name="Wait", description="Until it has ended, for scripts", options={"HIDDEN", "SKIP_SAVE"})

    def work(self, obj, context):
        playing.stop(obj)
        jobs.start(obj, context.scene)
        if self.wait:
            jobs.wait(obj.name)
            if obj.exmat.failed:
                raise Fault(obj.exmat.message)


class EXMAT_OT_cancel(Worded, bpy.types.Operator):
    """Cancel Precompute; the bundle stays as it was"""

    bl_idname, bl_label = "exmat.cancel", "Cancel"

    def work(self, obj, context):
        jobs.cancel(obj.name)


class EXMAT_OT_play(Worded, bpy.types.Operator):
    """Simulate live: the body follows the timeline, and the empties that draw it"""

    bl_idname, bl_label = "exmat.play", "Play"

    def work(self, obj, context):
        if obj.name in jobs.running:
            raise Fault("The bundle is being made: wait, or cancel.")
        baking.clear(obj)
        playing.start(obj, context.scene)
        if not bpy.app.background and context.screen is not None and not context.screen.is_animation_playing:
            bpy.ops.screen.animation_play()
        limited = any(spring.limited for spring in playing.playing[obj.name].player.springs)
        return "A spring is weaker than asked for: more steps a frame make it stiffer." if limited else "Playing."


class EXMAT_OT_stop(Worded, bpy.types.Operator):
    """Stop simulating, and show the object as it was"""

    bl_idname, bl_label = "exmat.stop", "Stop"

    def work(self, obj, context):
        playing.stop(obj)
        if not bpy.app.background and context.screen is not None and context.screen.is_animation_playing and not playing.playing:
            bpy.ops.screen.animation_cancel(restore_frame=False)
        return "Stopped."


class EXMAT_OT_bake_cache(Worded, bpy.types.Operator):
    """Simulate the scene's frames into a point cache (.pc2), which a Mesh Cache modifier shows"""

    bl_idname, bl_label = "exmat.bake_cache", "Mesh Cache"

    def work(self, obj, context):
        return f"Baked into {baking.bake_cache(obj, context.scene)}."


class EXMAT_OT_bake_keys(Worded, bpy.types.Operator):
    """Simulate the scene's frames into shape keys with actions, and a free body's motion on the object"""

    bl_idname, bl_label = "exmat.bake_keys", "Shape Keys"

    def work(self, obj, context):
        return f"Baked into {baking.bake_keys(obj, context.scene)} shape keys."


class EXMAT_OT_clear(Worded, bpy.types.Operator):
    """Take away what was baked"""

    bl_idname, bl_label = "exmat.clear", "Clear Bake"

    def work(self, obj, context):
        baking.clear(obj)
        return "Cleared."


class EXMAT_OT_add_region(Worded, bpy.types.Operator):
    """Add a region"""

    bl_idname, bl_label = "exmat.add_region", "Add Region"

    def work(self, obj, context):
        obj.exmat.regions.add()


class EXMAT_OT_remove_region(Worded, bpy.types.Operator):
    """Remove this region"""

    bl_idname, bl_label = "exmat.remove_region", "Remove Region"
    index: bpy.props.IntProperty()

    def work(self, obj, context):
        obj.exmat.regions.remove(self.index)


class EXMAT_OT_add_grip(Worded, bpy.types.Operator):
    """Add an empty at the 3D cursor that draws the nearest vertex"""

    bl_idname, bl_label = "exmat.add_grip", "Add Empty"

    def work(self, obj, context):
        empty = bpy.data.objects.new(f"{obj.name} grip", None)
        empty.empty_display_type = "SPHERE"
        empty.empty_display_size = 0.1 * max(obj.dimensions)
        empty.location = context.scene.cursor.location
        context.collection.objects.link(empty)
        obj.exmat.grips.add().target = empty


class EXMAT_OT_remove_grip(Worded, bpy.types.Operator):
    """Remove this grip; the empty stays"""

    bl_idname, bl_label = "exmat.remove_grip", "Remove Grip"
    index: bpy.props.IntProperty()

    def work(self, obj, context):
        obj.exmat.grips.remove(self.index)


CLASSES = (EXMAT_OT_precompute, EXMAT_OT_cancel, EXMAT_OT_play, EXMAT_OT_stop, EXMAT_OT_bake_cache, EXMAT_OT_bake_keys,
           EXMAT_OT_clear, EXMAT_OT_add_region, EXMAT_OT_remove_region, EXMAT_OT_add_grip, EXMAT_OT_remove_grip)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
