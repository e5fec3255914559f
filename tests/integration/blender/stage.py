"""Objects and measures for what is tested inside Blender."""
import json
import math
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
BUILD, FOLDER = (Path(given) for given in sys.argv[sys.argv.index("--") + 1 :][:2])
sys.path[:0] = [str(BUILD / "python"), str(ROOT / "examples/blender")]


def fresh(name="scene.blend", unit=1.0, frames=50):
    """An empty file that is saved in FOLDER, with the add-on on."""
    import addon_utils

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("exmat_blender", default_set=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    scene.unit_settings.scale_length = unit
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / name))
    return scene


def bar(cells=(24, 4, 4), size=(3.0, 0.5, 0.5), name="bar", keys=("bow",)):
    """A bar of quads along x, active and selected; shape keys bend and twist it; the group "clamp" is its end at x = 0."""
    grid = np.stack(np.meshgrid(*(np.arange(count + 1) for count in cells), indexing="ij"), -1).reshape(-1, 3)
    outside = (grid == 0).any(1) | (grid == cells).any(1)
    number = np.where(outside, np.cumsum(outside) - 1, -1)
    quads = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cells[axis]):
            for j in range(cells[first]):
                for k in range(cells[second]):
                    quad = []
                    for dj, dk in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        corner = [0, 0, 0]
                        corner[axis], corner[first], corner[second] = side, j + dj, k + dk
                        quad.append(int(number[np.ravel_multi_index(corner, [count + 1 for count in cells])]))
                    quads.append(quad if side else quad[::-1])
    vertices = grid[outside] / cells * size - [0, size[1] / 2, size[2] / 2]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], quads)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    obj.vertex_groups.new(name="clamp").add([int(v) for v in np.flatnonzero(vertices[:, 0] == 0)], 1.0, "REPLACE")
    obj.vertex_groups.new(name="tip").add([int(v) for v in np.flatnonzero(vertices[:, 0] > 0.5 * size[0])], 1.0, "REPLACE")
    if keys:
        obj.shape_key_add(name="Basis")
    for key in keys:
        obj.shape_key_add(name=key).data.foreach_set("co", posed(vertices, key, size[0]).astype("f4").ravel())
    obj.exmat.cells, obj.exmat.modes, obj.exmat.steps = 500, 12, 20
    return obj


def posed(vertices, key, length, angle=1.2):
    """The bar bent upwards, or twisted."""
    x, y, z = vertices.T
    if key == "twist":
        turn = angle * x / length
        return np.stack([x, np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z], 1)
    radius = length / angle
    return np.stack([(radius - z) * np.sin(x / radius), y, radius - (radius - z) * np.cos(x / radius)], 1)


def stand_askew(obj):
    """Moved, turned and scaled differently along its axes."""
    obj.location, obj.rotation_euler, obj.scale = (1, -2, 3), (0.3, -0.4, math.radians(70)), (2, 1.5, 1.2)
    bpy.context.view_layer.update()


def evaluated(obj):
    """World vertices (v, 3) [m], with all modifiers and keys, as Blender would draw them."""
    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    shown = obj.evaluated_get(graph)
    mesh = shown.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), "f4")
    mesh.vertices.foreach_get("co", flat)
    matrix = np.array(shown.matrix_world)
    shown.to_mesh_clear()
    return (flat.reshape(-1, 3).astype(float) @ matrix[:3, :3].T + matrix[:3, 3]) * bpy.context.scene.unit_settings.scale_length


def trajectory_of(members, frames, steps, name="run"):
    """Render positions (frames, v, 3) [m] of the same scene as exmat-runtime runs it, in the body's frame."""
    import h5py

    scene = {**members, "steps": steps * (frames - 1), "output": {"every": steps, "render": True}}
    file, run = FOLDER / f"{name}.json", FOLDER / f"{name}.h5"
    file.write_text(json.dumps(scene))
    subprocess.run([str(BUILD / "bin/exmat-runtime"), "run", str(file), "-o", str(run)], check=True, capture_output=True)
    with h5py.File(run) as data:
        return data["render/vertices"][:]


def to_world(body, matrix, unit):
    """From the body's frame [m] to the world [m]: the frame stands where the object stands, unscaled."""
    matrix = np.array(matrix)
    turn = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    return body @ turn.T + unit * matrix[:3, 3]


def message(operator, **arguments):
    """What the panel says after an operator."""
    try:
        operator(**arguments)
    except RuntimeError as error:  # only reports of errors raise
        return str(error)
    obj = bpy.context.object
    return obj.exmat.message if obj is not None else ""
