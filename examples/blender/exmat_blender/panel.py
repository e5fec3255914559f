"""The panel: Properties, Physics, exmat."""
import textwrap

import bpy

from . import jobs, playing

LINE = 48  # letters of a message in one line


class EXMAT_PT_body(bpy.types.Panel):
    bl_label = "exmat"
    bl_idname = "EXMAT_PT_body"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "physics"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context):
        obj, layout = context.object, self.layout
        given = obj.exmat
        layout.use_property_split = True
        if obj.name in jobs.running:
            row = layout.row(align=True)
            row.label(text="Precompute is running", icon="TIME")
            row.operator("exmat.cancel", icon="CANCEL")
        else:
            layout.operator("exmat.precompute", icon="MOD_PHYSICS")
        row = layout.row(align=True)
        row.operator("exmat.play", icon="PLAY")
        row.operator("exmat.stop", icon="PAUSE", depress=obj.name in playing.playing)
        row = layout.row(align=True)
        row.operator("exmat.bake_cache", icon="FILE_CACHE")
        row.operator("exmat.bake_keys", icon="SHAPEKEY_DATA")
        row.operator("exmat.clear", text="", icon="X")
        box = layout.box()
        for number, line in enumerate(textwrap.wrap(given.message or "Shape keys are the examples.", LINE)):
            box.label(text=line, icon="NONE" if number else "ERROR" if given.failed else "INFO")
        layout.prop_search(given, "clamp", obj, "vertex_groups")
        layout.prop(given, "bundle")


class Child:
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "physics"
    bl_parent_id = "EXMAT_PT_body"
    bl_options = {"DEFAULT_CLOSED"}


class EXMAT_PT_grips(Child, bpy.types.Panel):
    bl_label = "Empties"
    bl_options = set()

    def draw(self, context):
        obj, layout = context.object, self.layout
        for number, grip in enumerate(obj.exmat.grips):
            row = layout.row(align=True)
            row.prop(grip, "target", text="")
            row.prop_search(grip, "group", obj, "vertex_groups", text="")
            row.operator("exmat.remove_grip", text="", icon="X").index = number
            column = layout.column(align=True)
            column.use_property_split = True
            column.prop(grip, "strength")
            column.prop(grip, "damping")
        layout.operator("exmat.add_grip", icon="EMPTY_AXIS")


class EXMAT_PT_examples(Child, bpy.types.Panel):
    bl_label = "Examples"

    def draw(self, context):
        obj, layout = context.object, self.layout
        layout.use_property_split = True
        for name in ("stiffness", "damping", "bias"):
            layout.prop(obj.exmat, name)
        layout.label(text="Regions: a shape key that acts in a group alone")
        for number, region in enumerate(obj.exmat.regions):
            row = layout.row(align=True)
            row.prop_search(region, "group", obj, "vertex_groups", text="")
            if obj.data.shape_keys is not None:
                row.prop_search(region, "key", obj.data.shape_keys, "key_blocks", text="")
            row.operator("exmat.remove_region", text="", icon="X").index = number
        layout.operator("exmat.add_region", icon="ADD")


class EXMAT_PT_material(Child, bpy.types.Panel):
    bl_label = "Body"

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ("cells", "modes", "training", "youngs_modulus", "poisson_ratio", "density"):
            self.layout.prop(context.object.exmat, name)


class EXMAT_PT_motion(Child, bpy.types.Panel):
    bl_label = "Motion"

    def draw(self, context):
        self.layout.use_property_split = True
        given = context.object.exmat
        for name in ("steps", "mass_damping", "stiffness_damping", "floor"):
            self.layout.prop(given, name)
        column = self.layout.column()
        column.enabled = given.floor
        column.prop(given, "floor_height")
        column.prop(given, "friction")
        self.layout.prop(given, "cache")


CLASSES = (EXMAT_PT_body, EXMAT_PT_grips, EXMAT_PT_examples, EXMAT_PT_material, EXMAT_PT_motion)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
