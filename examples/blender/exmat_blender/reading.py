"""From Blender's data to arrays."""
import json
import os

import bpy
import numpy as np

from . import library
from .asset import BodySettings, MotionSettings, Region, Shape, spring_stiffness
from .fault import Fault
from .frame import BodyFrame
from .properties import preferences

OWN_KEY = "exmat"  # shape keys of the add-on's own begin with it
INSIDE = 0.5  # weight of a vertex that belongs to a group


def exmat():
    """The library."""
    given = preferences()
    return library.load(bpy.path.abspath(given.folder).rstrip("/\\") if given is not None and given.folder else "")


def program():
    """Path of exmat-precompute; none: exmat looks for it."""
    given = preferences()
    return bpy.path.abspath(given.program) if given is not None and given.program else None


def unit_of(scene):
    """[m] of a Blender unit."""
    return scene.unit_settings.scale_length if scene.unit_settings.system != "NONE" else 1.0


def frame_of(obj, scene):
    return BodyFrame(obj.matrix_world, unit_of(scene))


def coordinates(data):
    """Of vertices or of a shape key's points (v, 3)."""
    flat = np.empty(3 * len(data), "f4")
    data.foreach_get("co", flat)
    return flat.reshape(-1, 3).astype(float)


def check_object(obj):
    if obj is None or obj.type != "MESH":
        raise Fault("Select a mesh object.")
    if obj.mode == "EDIT":
        raise Fault("Leave edit mode first.")
    if obj.library is not None or obj.data.library is not None:
        raise Fault("The object is linked from another file: make it local first.")
    if obj.data.shape_keys is not None and not obj.data.shape_keys.use_relative:
        raise Fault("The shape keys are absolute: tick 'Relative'.")


def rest_of(obj):
    """Local vertices at rest (v, 3)."""
    keys = obj.data.shape_keys
    return coordinates(keys.reference_key.data if keys is not None else obj.data.vertices)


def poses_of(obj):
    """Local vertices of the shape keys that are examples: neither the basis, nor muted, nor the add-on's own."""
    keys = obj.data.shape_keys
    if keys is None:
        return {}
    rest, poses = coordinates(keys.reference_key.data), {}
    for key in keys.key_blocks:
        if key == keys.reference_key or key.name.startswith(OWN_KEY) or (key.mute and key.name not in muted_by_bake(obj)):
            continue
        moved = coordinates(key.data) - coordinates(key.relative_key.data)
        if key.vertex_group:
            moved *= weights_of(obj, key.vertex_group)[:, None]
        poses[key.name] = rest + moved
    return poses


def muted_by_bake(obj):
    return set(json.loads(obj.exmat.kept).get("muted", [])) if obj.exmat.kept else set()


def weights_of(obj, name):
    """Of all vertices in the vertex group (v,). Raises Fault."""
    group = obj.vertex_groups.get(name)
    if group is None:
        raise Fault(f"There is no vertex group '{name}'.")
    weights = np.zeros(len(obj.data.vertices))
    for vertex in obj.data.vertices:
        for member in vertex.groups:
            if member.group == group.index:
                weights[vertex.index] = member.weight
    return weights


def shape_of(obj):
    """The object in local coordinates. Raises Fault."""
    check_object(obj)
    settings, mesh = obj.exmat, obj.data
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), "i4")
    mesh.loop_triangles.foreach_get("vertices", triangles)
    shape = Shape(obj.name, rest_of(obj), triangles.reshape(-1, 3).astype("i8"), poses_of(obj))
    if settings.clamp:
        shape.clamp = weights_of(obj, settings.clamp) > INSIDE
    for row in settings.regions:
        if not row.group:
            raise Fault("A region has no vertex group: choose one, or remove it.")
        region = next((region for region in shape.regions if region.name == row.group), None)
        if region is None:
            region = Region(row.group, weights_of(obj, row.group) > INSIDE, [])
            shape.regions.append(region)
        if row.key and row.key not in region.examples:
            region.examples.append(row.key)
    return shape


def body_settings(obj):
    given = obj.exmat
    return BodySettings(given.cells, given.modes, given.training == "runs", given.youngs_modulus, given.poisson_ratio, given.density)


def motion_settings(obj, scene, frame):
    """What acts on the body, in its frame."""
    given, unit = obj.exmat, frame.unit
    gravity = np.array(scene.gravity) * unit if scene.use_gravity else np.zeros(3)
    settings = MotionSettings(
        frame_time=scene.render.fps_base / scene.render.fps, steps=given.steps, gravity=frame.direction_to_body(gravity),
        mass_damping=given.mass_damping, stiffness_damping=given.stiffness_damping, example_stiffness=given.stiffness,
        example_damping=given.damping, example_bias=given.bias)
    if given.floor:
        settings.floor = {"point": frame.point_to_body((0, 0, given.floor_height)), "normal": frame.direction_to_body((0, 0, 1)),
                          "friction": given.friction}
    return settings


def springs_of(obj, shape, frame):
    """Springs of a Player, where the empties are now."""
    stiffness = spring_stiffness(shape, body_settings(obj))
    springs = []
    for row in obj.exmat.grips:
        if row.target is None:
            raise Fault("A grip has no empty: choose one, or remove it.")
        if row.group:
            marks = weights_of(obj, row.group) > INSIDE
            if not marks.any():
                raise Fault(f"The vertex group '{row.group}' of a grip is empty.")
            points = shape.vertices[marks]
        else:
            place = frame.point_to_body(row.target.matrix_world.translation)
            points = shape.vertices[[np.linalg.norm(shape.vertices - place, axis=1).argmin()]]
        springs.append((points, row.strength * stiffness, row.damping))
    return springs


def targets_of(obj, frame):
    """Where the empties are [m]."""
    return [frame.point_to_body(row.target.matrix_world.translation) for row in obj.exmat.grips if row.target is not None]


def file_of(obj, given, ending):
    """The path in a setting, or the one that is named after the object. Raises Fault."""
    path = given or f"//{bpy.path.clean_name(obj.name)}{ending}"
    if path.startswith("//") and not bpy.data.filepath:
        raise Fault(f"Save the file first: the {'bundle' if ending == '.h5' else 'cache'} goes beside it. Or give it a path.")
    path = os.path.abspath(bpy.path.abspath(path))
    if not os.path.isdir(os.path.dirname(path)):
        raise Fault(f"There is no folder {os.path.dirname(path)}.")
    return path


def bundle_of(obj):
    return file_of(obj, obj.exmat.bundle, ".h5")
