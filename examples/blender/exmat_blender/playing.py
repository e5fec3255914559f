"""Bodies that follow the timeline live: a shape key of the add-on's own shows them."""
import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import jobs, reading
from .asset import is_made_of, scene_of
from .fault import Fault
from .frame import quaternion
from .player import Player

LIVE_KEY = reading.OWN_KEY + " live"
STILL = 1e-6  # of the scale: an object that moves no farther stands
playing = {}  # sessions, by the name of their object


class Session:
    """A Player of an object, in the frame where the object stood when it began."""

    def __init__(self, obj, scene):
        reading.check_object(obj)
        exmat = reading.exmat()
        self.frame = reading.frame_of(obj, scene)
        local = reading.shape_of(obj)
        shape = local.mapped(self.frame.to_body)
        bundle = reading.bundle_of(obj)
        if not obj.exmat.made_of:
            raise Fault("There is no bundle yet: press Precompute.")
        if not is_made_of(obj.exmat.made_of, local, self.frame.stretch):
            raise Fault("The mesh, its scale, shape keys or groups have changed since the bundle was made: press Precompute.")
        settings = reading.motion_settings(obj, scene, self.frame)
        self.scene = scene_of(shape, settings, bundle)
        self.motions = {} if shape.clamp is None else motions_of(obj, scene, self.frame)
        if self.motions:
            self.scene["body"] = {"motion": [
                {"time": (frame - scene.frame_start) * settings.frame_time, "position": list(translation), "orientation": list(quaternion(rotation))}
                for frame, (rotation, translation) in self.motions.items()]}
        self.player = Player(exmat, self.scene, shape.vertices, settings.steps, reading.springs_of(obj, shape, self.frame),
                             scene.frame_start)
        self.free = shape.clamp is None
        self.size = shape.size

    def go_to(self, obj, frame):
        """Local vertices at a frame (v, 3)."""
        if len(obj.data.vertices) != len(self.player.rest):
            raise Fault("The mesh has other vertices than when Play began: press Stop, then Precompute.")
        self.player.go_to(frame, reading.targets_of(obj, self.frame))
        positions = self.player.positions()
        if self.motions:  # the object carries the body: Blender adds its motion
            rotation, translation = self.motions[min(max(frame, min(self.motions)), max(self.motions))]
            positions = (positions - translation) @ rotation
        return self.frame.to_local(positions)


def motions_of(obj, scene, frame):
    """How the object moves over the scene's frames, from its frame at the first: rotations and translations; empty where it stands."""
    current, found = scene.frame_current, {}
    for number in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(number)
        found[number] = frame.motion_to(reading.frame_of(obj, scene))
    scene.frame_set(current)
    moves = any(np.abs(rotation - np.eye(3)).max() > STILL or np.abs(translation).max() > STILL * np.abs(frame.stretch).max()
                for rotation, translation in found.values())
    return found if moves else {}


def start(obj, scene):
    """Raises Fault."""
    stop(obj)
    scene.frame_set(scene.frame_start)
    session = playing[obj.name] = Session(obj, scene)
    try:
        show(obj, session.go_to(obj, scene.frame_current))
    except Exception:
        stop(obj)
        raise
    if on_frame not in bpy.app.handlers.frame_change_post:
        bpy.app.handlers.frame_change_post.append(on_frame)


def stop(obj):
    """Takes the shape key away again."""
    playing.pop(obj.name, None)
    keys = obj.data.shape_keys
    live = keys.key_blocks.get(LIVE_KEY) if keys is not None else None
    if live is not None:
        obj.show_only_shape_key = bool(obj.get("exmat_pinned", False))
        active = obj.get("exmat_active", 0)
        obj.shape_key_remove(live)
        obj.active_shape_key_index = min(active, len(keys.key_blocks) - 1)
        if obj.get("exmat_bare"):
            obj.shape_key_clear()
    for name in ("exmat_pinned", "exmat_active", "exmat_bare"):
        if name in obj:
            del obj[name]
    if not playing and on_frame in bpy.app.handlers.frame_change_post:
        bpy.app.handlers.frame_change_post.remove(on_frame)


def show(obj, local):
    """The vertices by the live key, which is pinned: other keys have no say."""
    keys = obj.data.shape_keys
    if keys is None or LIVE_KEY not in keys.key_blocks:
        obj["exmat_bare"] = keys is None
        obj["exmat_pinned"] = obj.show_only_shape_key
        obj["exmat_active"] = obj.active_shape_key_index
        if keys is None:
            obj.shape_key_add(name="Basis", from_mix=False)
        obj.shape_key_add(name=LIVE_KEY, from_mix=False)
        keys = obj.data.shape_keys
        obj.active_shape_key_index = keys.key_blocks.find(LIVE_KEY)
        obj.show_only_shape_key = True
    keys.key_blocks[LIVE_KEY].data.foreach_set("co", np.ascontiguousarray(local, "f4").ravel())
    keys.update_tag()
    obj.data.update_tag()


def on_frame(scene, *_):
    """Handler of frame changes: at the first frame the bodies begin anew, elsewhere they follow."""
    for name, session in list(playing.items()):
        obj = bpy.data.objects.get(name)
        if obj is None:
            playing.pop(name)
            continue
        try:
            if scene.frame_current == session.player.first and session.player.last > session.player.first:
                session.player.restart()
            show(obj, session.go_to(obj, scene.frame_current))
        except Fault as fault:
            jobs.say(obj, str(fault), failed=True)
            stop(obj)


@persistent
def on_load(*_):
    """Another file: nothing of the one before plays, and what was saved while it played is cleared away."""
    playing.clear()
    for obj in bpy.data.objects:
        if obj.type == "MESH" and obj.library is None and obj.data.library is None:
            stop(obj)


@persistent
def before_load(*_):
    jobs.cancel_all()
    playing.clear()


def register():
    bpy.app.handlers.load_pre.append(before_load)
    bpy.app.handlers.load_post.append(on_load)


def unregister():
    for name in list(playing):
        obj = bpy.data.objects.get(name)
        if obj is not None:
            stop(obj)
    playing.clear()
    for handlers, ours in ((bpy.app.handlers.load_pre, before_load), (bpy.app.handlers.load_post, on_load),
                           (bpy.app.handlers.frame_change_post, on_frame)):
        if ours in handlers:
            handlers.remove(ours)
