"""What the panel sets, kept on each object and in the file."""
import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty,
                       StringProperty)

PACKAGE = __package__


class ExmatRegion(bpy.types.PropertyGroup):
    """A vertex group on which a shape key acts alone; rows of one group are one region."""

    group: StringProperty(name="Vertex Group", description="Vertices of the region, with a weight above 0.5")
    key: StringProperty(name="Shape Key", description="Example that acts there, and nowhere else")


class ExmatGrip(bpy.types.PropertyGroup):
    """An empty that draws a point of the body."""

    target: PointerProperty(name="Empty", type=bpy.types.Object, description="The body is drawn to it by a damped spring")
    group: StringProperty(name="Vertex Group", description="What is drawn; without a group the vertex nearest to the empty at the first frame")
    strength: FloatProperty(name="Strength", default=1, min=0, soft_max=10, description="1 is stiff beside the body")
    damping: FloatProperty(name="Damping", default=1, min=0, max=1, description="1: the spring does not swing by itself")


class ExmatSettings(bpy.types.PropertyGroup):
    """Settings of one body."""

    bundle: StringProperty(name="Bundle", subtype="FILE_PATH", default="", description="File of the bundle; empty: named after the object, beside the .blend file")
    clamp: StringProperty(name="Clamp", description="Vertex group that never moves (weight above 0.5); empty: a free body")
    regions: CollectionProperty(type=ExmatRegion)
    grips: CollectionProperty(type=ExmatGrip)
    cells: IntProperty(name="Tets", default=2000, min=50, max=2000000, soft_max=20000, description="About how many tets enclose the surface")
    modes: IntProperty(name="Modes", default=30, min=1, max=10000, soft_max=100, description="How many shapes the body moves in")
    training: EnumProperty(name="Training", default="none", items=(
        ("none", "None", "Seconds: to try things out"),
        ("runs", "From Runs", "Minutes: basis and cubature learn from runs of the body with all its degrees of freedom")))
    youngs_modulus: FloatProperty(name="Young's Modulus", default=0, min=0, precision=0, description="[Pa]; 0: such that the body sags a little under its weight")
    poisson_ratio: FloatProperty(name="Poisson Ratio", default=0.4, min=-0.79, max=0.49, description="0.5 would keep the volume")
    density: FloatProperty(name="Density", default=1000, min=1e-3, description="[kg/m^3]; water has 1000")
    stiffness: FloatProperty(name="Example Stiffness", default=1000, min=0, description="kappa [1/s^2]: how much the examples pull")
    damping: FloatProperty(name="Example Damping", default=10, min=0, description="[1/s]")
    bias: FloatProperty(name="Weight of Rest", default=0.5, min=0, max=1, description="1: the examples act as the pose asks; less: always toward the shape keys")
    mass_damping: FloatProperty(name="Drag", default=0.5, min=0, description="alpha of Rayleigh's damping [1/s]")
    stiffness_damping: FloatProperty(name="Inner Damping", default=0.002, min=0, precision=4, description="beta of Rayleigh's damping [s]")
    steps: IntProperty(name="Steps a Frame", default=40, min=1, max=10000, description="Time steps from frame to frame")
    floor: BoolProperty(name="Floor", description="A plane that the body touches")
    floor_height: FloatProperty(name="Height", subtype="DISTANCE", description="Z of the floor")
    friction: FloatProperty(name="Friction", default=0.5, min=0, description="Coulomb's coefficient")
    cache: StringProperty(name="Cache", subtype="FILE_PATH", default="", description="Point cache that Bake writes; empty: named after the object, beside the .blend file")
    message: StringProperty(options={"SKIP_SAVE"})
    failed: BoolProperty(options={"SKIP_SAVE"})
    made_of: StringProperty(description="Fingerprint of what the bundle was made of")
    kept: StringProperty(description="What Bake has to put back, as JSON")


class ExmatPreferences(bpy.types.AddonPreferences):
    """Where exmat is."""

    bl_idname = PACKAGE
    folder: StringProperty(name="Python package", subtype="DIR_PATH", description="Folder that holds the folder exmat; empty: Blender's own path")
    program: StringProperty(name="exmat-precompute", subtype="FILE_PATH", description="The program; empty: that of the build, or of the PATH")

    def draw(self, context):
        self.layout.prop(self, "folder")
        self.layout.prop(self, "program")


CLASSES = (ExmatRegion, ExmatGrip, ExmatSettings, ExmatPreferences)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Object.exmat = PointerProperty(type=ExmatSettings)


def unregister():
    del bpy.types.Object.exmat
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)


def preferences():
    """Of the add-on; none where it was registered by a script."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon is not None else None
