"""Motions that exmat-runtime exports as glTF, by Blender's own importer."""
import bpy
import numpy as np
from bpy_extras.io_utils import ImportHelper


class EXMAT_OT_import_motion(bpy.types.Operator, ImportHelper):
    """Import a motion that exmat-runtime has exported; weights of its shape keys may be negative"""

    bl_idname, bl_label = "exmat.import_motion", "exmat motion (.glb)"
    bl_options = {"REGISTER", "UNDO"}
    filename_ext = ".glb"
    filter_glob: bpy.props.StringProperty(default="*.glb;*.gltf", options={"HIDDEN"})

    def execute(self, context):
        before = set(bpy.data.objects)
        try:
            import_gltf(self.filepath)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).strip().splitlines()[-1])
            return {"CANCELLED"}
        for obj in set(bpy.data.objects) - before:
            open_ranges(obj)
        context.scene.frame_set(context.scene.frame_current)
        return {"FINISHED"}


def import_gltf(path):
    """The importer of Blender 3.4 names numpy.bool, which NumPy of Debian 12 no longer has."""
    missing = "bool" not in vars(np)
    if missing:
        np.bool = bool
    try:
        bpy.ops.import_scene.gltf(filepath=path)
    finally:
        if missing:
            del np.bool


def open_ranges(obj):
    """From -1 to 1: the importer leaves 0 to 1, and Blender cuts off what is outside."""
    keys = obj.data.shape_keys if obj.type == "MESH" else None
    for key in keys.key_blocks if keys is not None else ():
        key.slider_min, key.slider_max = min(key.slider_min, -1), max(key.slider_max, 1)


def menu(self, context):
    self.layout.operator(EXMAT_OT_import_motion.bl_idname)


def register():
    bpy.utils.register_class(EXMAT_OT_import_motion)
    bpy.types.TOPBAR_MT_file_import.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    bpy.utils.unregister_class(EXMAT_OT_import_motion)
