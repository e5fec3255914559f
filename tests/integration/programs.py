"""What tests of programs share: a mesh, a surface, and runs that have to end as they should."""
import itertools
import json
import struct
import subprocess
from pathlib import Path

import numpy as np


FLOAT, UBYTE, USHORT, UINT = 5126, 5121, 5123, 5125
KINDS = {FLOAT: np.float32, UBYTE: np.uint8, USHORT: np.uint16, UINT: np.uint32}


def bar():
    """Text of a .veg file: 8 x 2 x 2 cubes of six tets each, 4 m long; and the vertices at x = 0, 0-based."""
    number = {place: k + 1 for k, place in enumerate(itertools.product(range(9), range(3), range(3)))}
    tets = []
    for cell in itertools.product(range(8), range(2), range(2)):
        for order in itertools.permutations(range(3)):
            place, path = list(cell), [number[cell]]
            for axis in order:
                place[axis] += 1
                path.append(number[tuple(place)])
            tets.append(path)
    lines = ["*VERTICES", f"{len(number)} 3 0 0"] + [f"{k} {0.5 * x} {0.5 * y} {0.5 * z}" for (x, y, z), k in number.items()]
    lines += ["*ELEMENTS", "TET", f"{len(tets)} 4 0"] + [" ".join(map(str, [k + 1, *tet])) for k, tet in enumerate(tets)]
    return "\n".join(lines) + "\n", [k - 1 for (x, _, _), k in number.items() if x == 0]


def tube(length=3.0, steps=24, around=16):
    """A closed round tube along x, 1 m thick: points and triangles."""
    rings = [(0.0, 0.0)] + [(length * k / steps, 0.5) for k in range(steps + 1)] + [(length, 0.0)]
    angles = 2 * np.pi * np.arange(around) / around
    points = np.array([[x, r * np.cos(a), r * np.sin(a)] for x, r in rings[1:-1] for a in angles] + [[0, 0, 0], [length, 0, 0]])
    start, end = len(points) - 2, len(points) - 1
    at = lambda ring, k: around * ring + k % around
    triangles = [t for k in range(around) for t in
                 ([(start, at(0, k + 1), at(0, k)), (end, at(steps, k), at(steps, k + 1))]
                  + [t for ring in range(steps) for t in ((at(ring, k), at(ring, k + 1), at(ring + 1, k + 1)),
                                                          (at(ring, k), at(ring + 1, k + 1), at(ring + 1, k)))])]
    return points, np.array(triangles)


class Glb:
    """A .glb that is made: its JSON, and arrays that become accessors."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "accessors": [], "bufferViews": []}
        self.binary = bytearray()

    def view(self, data):
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data + b"\0" * (-len(data) % 4)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array, code, kind, **more):
        array = np.ascontiguousarray(array, KINDS[code])
        self.json["accessors"].append({"bufferView": self.view(array.tobytes()), "componentType": code, "count": len(array), "type": kind, **more})
        return len(self.json["accessors"]) - 1

    def floats(self, array, kind):
        return self.accessor(array, FLOAT, kind)

    def positions(self, points):
        points = np.asarray(points, np.float32)
        return self.accessor(points, FLOAT, "VEC3", min=points.min(0).tolist(), max=points.max(0).tolist())

    def write(self, path):
        document = {**self.json, "buffers": [{"byteLength": len(self.binary)}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(self.binary)) + struct.pack("<I4s", len(text), b"JSON") + text
                         + struct.pack("<I4s", len(self.binary), b"BIN\0") + bytes(self.binary))


def write_skinned(path, bulge=0.0):
    """A .glb of a tube on three bones of 1 m in a row, whose weights go over within 0.3 m; an animation turns each by 30 degrees about z,
    and back. A morph target bulges the middle."""
    points, triangles = tube()
    bones = 3
    glb = Glb()
    bone = np.clip(points[:, 0].astype(int), 0, bones - 1)
    to_next = np.where(bone < bones - 1, np.clip((points[:, 0] - bone - 0.7) / 0.3, 0, 1) / 2, 0)
    to_last = np.where(bone > 0, np.clip((0.3 - (points[:, 0] - bone)) / 0.3, 0, 1) / 2, 0)
    joints = np.stack([bone, np.minimum(bone + 1, bones - 1), np.maximum(bone - 1, 0), bone], 1)
    weights = np.stack([1 - to_next - to_last, to_next, to_last, 0 * to_last], 1)
    mesh = {"primitives": [{
        "attributes": {"POSITION": glb.positions(points), "JOINTS_0": glb.accessor(joints, UBYTE, "VEC4"), "WEIGHTS_0": glb.floats(weights, "VEC4")},
        "indices": glb.accessor(triangles.ravel(), UINT, "SCALAR")}]}
    if bulge:
        out = bulge * np.exp(-((points[:, 0] - 1.5) / 0.3) ** 2)[:, None] * points * [0, 1, 1]
        mesh["primitives"][0]["targets"] = [{"POSITION": glb.positions(out)}]
        mesh["extras"] = {"targetNames": ["flex"]}
    inverse = np.tile(np.eye(4), (bones, 1, 1))
    inverse[:, 0, 3] = -np.arange(bones)
    half = np.radians(30) / 2
    times = glb.floats(np.array([0, 0.5, 1.0]), "SCALAR")
    turns = glb.floats(np.array([[0, 0, 0, 1], [0, 0, np.sin(half), np.cos(half)], [0, 0, 0, 1]]), "VEC4")
    glb.json |= {
        "meshes": [mesh], "scenes": [{"nodes": [0, 1]}],
        "skins": [{"joints": [1, 2, 3], "inverseBindMatrices": glb.floats(inverse.transpose(0, 2, 1).reshape(-1, 16), "MAT4")}],
        "nodes": [{"mesh": 0, "skin": 0}, {"name": "root", "children": [2]}, {"name": "middle", "translation": [1, 0, 0], "children": [3]},
                  {"name": "tip", "translation": [1, 0, 0]}],
        "animations": [{"name": "curl", "samplers": [{"input": times, "output": turns}],
                        "channels": [{"sampler": 0, "target": {"node": node, "path": "rotation"}} for node in (1, 2, 3)]}]}
    glb.write(path)


def write_bar(folder):
    """bar.veg, and end.txt with the vertices of its end."""
    mesh, clamp = bar()
    (folder / "bar.veg").write_text(mesh)
    (folder / "end.txt").write_text("\n".join(str(k + 1) for k in clamp))


def write_json(file, content):
    Path(file).write_text(json.dumps(content))
    return file


def call(*words, status=0, **options):
    """What a program prints, of a run that ends with this status: its messages where that is not 0."""
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    assert done.returncode == status, f"{words}: status {done.returncode}, expected {status}\n{done.stdout}{done.stderr}"
    return done.stdout if status == 0 else done.stderr
