"""A motion kept in the file: as a point cache, or as actions of shape keys."""
import json

import bpy
from mathutils import Matrix

from . import playing, reading
from .columns import keys_of
from .fault import Fault
from .point_cache import write_pc2

MODIFIER = "exmat"
PLACE = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")
KEY = reading.OWN_KEY + " {:03d}"


def run(obj, scene, take):
    """Calls take(frame, session) at each frame of the scene's range. Raises Fault."""
    playing.stop(obj)
    clear(obj)
    first, last, current = scene.frame_start, scene.frame_end, scene.frame_current
    manager = bpy.context.window_manager
    scene.frame_set(first)
    session = playing.Session(obj, scene)
    manager.progress_begin(first, last)
    try:
        for frame in range(first, last + 1):
            scene.frame_set(frame)
            take(frame, session.go_to(obj, frame), session)
            manager.progress_update(frame)
    finally:
        manager.progress_end()
        scene.frame_set(current)
    return session


def bake_cache(obj, scene):
    """Writes the cache and puts a modifier in front of the others. Returns its path. Raises Fault."""
    path = reading.file_of(obj, obj.exmat.cache, ".pc2")
    frames = []
    run(obj, scene, lambda frame, local, session: frames.append(local.astype("f4")))
    try:
        write_pc2(path, frames, scene.frame_start)
    except OSError as error:
        raise Fault(f"{path} cannot be written: {error.strerror}.") from None
    modifier = obj.modifiers.new(MODIFIER, "MESH_CACHE")
    with bpy.context.temp_override(object=obj):
        bpy.ops.object.modifier_move_to_index(modifier=MODIFIER, index=0)
    modifier.cache_format = "PC2"
    modifier.filepath = path if obj.exmat.cache and not obj.exmat.cache.startswith("//") else bpy.path.relpath(path)
    modifier.frame_start = scene.frame_start
    return path


def bake_keys(obj, scene):
    """One shape key for each column of U, keyed with q; the motion of a free body on the object. Returns their number."""
    displacements, motions, columns = [], [], None

    def take(frame, local, session):
        nonlocal columns
        if columns is None:
            check_keyed(obj, session)
            columns = session.player.columns()
        displacements.append(session.player.body.q.copy())
        if session.free:
            motions.append(session.frame.moved(*session.player.rigid_motion(columns)))

    session = run(obj, scene, take)
    keep = {"muted": [], "action": None, "key_action": None, "bare": obj.data.shape_keys is None}
    if keep["bare"]:
        obj.shape_key_add(name="Basis", from_mix=False)
    keys = obj.data.shape_keys
    for key in keys.key_blocks:
        if key != keys.reference_key and not key.mute:
            keep["muted"].append(key.name)
            key.mute = True
    keep["key_action"] = new_action(keys, f"{obj.name} exmat")
    rest, first = reading.rest_of(obj), scene.frame_start
    found = keys_of(columns, displacements, session.size)
    for number, (displacement, values) in enumerate(found):
        key = obj.shape_key_add(name=KEY.format(number), from_mix=False)
        key.slider_min, key.slider_max = -1, 1
        key.data.foreach_set("co", (rest + session.frame.to_local(displacement)).astype("f4").ravel())
        for place, value in enumerate(values):
            key.value = value
            key.keyframe_insert("value", frame=first + place)
    if motions:
        keep["place"] = {name: list(getattr(obj, name)) for name in PLACE}
        keep["mode"] = obj.rotation_mode
        keep["action"] = new_action(obj, f"{obj.name} exmat motion")
        obj.rotation_mode = "QUATERNION"
        for place, matrix in enumerate(motions):
            before = obj.rotation_quaternion.copy()
            obj.matrix_world = Matrix(matrix.tolist())
            if place and before.dot(obj.rotation_quaternion) < 0:
                obj.rotation_quaternion.negate()
            obj.keyframe_insert("location", frame=first + place)
            obj.keyframe_insert("rotation_quaternion", frame=first + place)
    obj.exmat.kept = json.dumps(keep)
    scene.frame_set(scene.frame_current)
    return len(found)


def check_keyed(obj, session):
    """What motion on shape keys and on the object needs."""
    if obj.data.users > 1:
        raise Fault("Other objects share the mesh, and would move too: make it single-user first (Object, Relations).")
    if session.free and session.frame.sheared:
        raise Fault("The object is sheared by its parent, so its motion cannot be keyed: bake a mesh cache, or clear the parent.")
    if session.free and len(obj.constraints):
        raise Fault("The object has constraints, so its motion cannot be keyed: bake a mesh cache, or remove them.")


def new_action(owner, name):
    """Gives the owner an action of its own; the name of the one before."""
    animation = owner.animation_data or owner.animation_data_create()
    before = animation.action
    if before is not None:
        before.use_fake_user = True
    animation.action = bpy.data.actions.new(name)
    return before.name if before is not None else None


def clear(obj):
    """Takes away what Bake has made, and puts back what was there. The cache stays a file."""
    modifier = obj.modifiers.get(MODIFIER)
    if modifier is not None and modifier.type == "MESH_CACHE":
        obj.modifiers.remove(modifier)
    if not obj.exmat.kept:
        return
    keep, keys = json.loads(obj.exmat.kept), obj.data.shape_keys
    obj.exmat.kept = ""
    if keys is not None:
        put_back(keys, keep["key_action"])
        for key in [key for key in keys.key_blocks if key.name.startswith(reading.OWN_KEY)]:
            obj.shape_key_remove(key)
        for name in keep["muted"]:
            if name in keys.key_blocks:
                keys.key_blocks[name].mute = False
        if keep["bare"]:
            obj.shape_key_clear()
    if "place" in keep:
        put_back(obj, keep["action"])
        obj.rotation_mode = keep["mode"]
        for name, values in keep["place"].items():
            setattr(obj, name, values)


def put_back(owner, name):
    animation = owner.animation_data
    if animation is None:
        return
    ours = animation.action
    animation.action = bpy.data.actions.get(name) if name else None
    if ours is not None and ours.users == 0:
        bpy.data.actions.remove(ours)
