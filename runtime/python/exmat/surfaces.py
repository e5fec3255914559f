"""Surfaces in arrays as binary glTF: vertices, triangles, poses as morph targets, parts as attributes of vertices."""
import json
import pathlib
import struct
from typing import Any, Dict, List, Mapping, Optional

import numpy as np

from .arrays import StrPath, numbers, surface_arrays
from .errors import InvalidArgument

FLOAT, INDEX = 5126, 5125  # types of accessors: float, unsigned int
VERTICES, CORNERS = 34962, 34963  # what a buffer view holds


def write_glb(path: StrPath, vertices: Any, triangles: Any, poses: Optional[Mapping[str, Any]] = None,
              parts: Optional[Mapping[str, Any]] = None) -> None:
    """Writes a surface, `vertices` (v, 3) [m] and `triangles` (f, 3) of 0-based vertices, as .glb, in single precision.

    poses   name: vertices of a pose (v, 3) [m], as a morph target
    parts   name: which vertices belong to it, (v,) of bool or of numbers, above 0.5 inside, as a custom attribute;
            an underscore is put in front of a name that has none
    """
    points, faces = surface_arrays(vertices, triangles)
    file = _Glb()
    primitive: Dict[str, Any] = {"attributes": {"POSITION": file.add(points, "VEC3", FLOAT, VERTICES)},
                                 "indices": file.add(faces.reshape(-1), "SCALAR", INDEX, CORNERS), "mode": 4}
    for name, marks in (parts or {}).items():
        values = numbers(marks, f"part {name}")
        if values.shape != (len(points),):
            raise InvalidArgument(f"part {name}: shape {values.shape}: expected ({len(points)},), a number for each vertex")
        primitive["attributes"][part_name(name)] = file.add(values, "SCALAR", FLOAT, VERTICES)
    targets = []
    for name, pose in (poses or {}).items():
        moved = numbers(pose, f"pose {name}")
        if moved.shape != points.shape:
            raise InvalidArgument(f"pose {name}: shape {moved.shape}: expected {points.shape}, a place for each vertex")
        targets.append({"POSITION": file.add(moved - points, "VEC3", FLOAT, VERTICES)})
    mesh: Dict[str, Any] = {"primitives": [primitive]}
    if targets:
        primitive["targets"] = targets
        mesh["extras"] = {"targetNames": list(poses or {})}
    file.write(path, mesh)


def part_name(name: str) -> str:
    """As an asset names the part: glTF wants an underscore in front of attributes of one's own."""
    return name if name.startswith("_") else "_" + name


class _Glb:
    def __init__(self) -> None:
        self._bytes: List[bytes] = []
        self._views: List[Dict[str, Any]] = []
        self._accessors: List[Dict[str, Any]] = []

    def add(self, values: Any, kind: str, component: int, target: int) -> int:
        array = np.ascontiguousarray(values, "<f4" if component == FLOAT else "<u4")
        if component == FLOAT and not np.isfinite(array).all():
            raise InvalidArgument("surface: expected finite numbers, in the range of single precision")
        accessor = {"bufferView": len(self._views), "componentType": component, "count": len(array), "type": kind}
        if kind == "VEC3":
            accessor.update(min=array.min(0).tolist(), max=array.max(0).tolist())
        self._views.append({"buffer": 0, "byteOffset": sum(map(len, self._bytes)), "byteLength": array.nbytes, "target": target})
        self._bytes.append(array.tobytes())
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def write(self, path: StrPath, mesh: Mapping[str, Any]) -> None:
        binary = b"".join(self._bytes)
        document = {"asset": {"version": "2.0", "generator": "exmat"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                    "meshes": [mesh], "accessors": self._accessors, "bufferViews": self._views, "buffers": [{"byteLength": len(binary)}]}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sIIII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(binary), len(text), 0x4E4F534A)
        pathlib.Path(path).write_bytes(head + text + struct.pack("<II", len(binary), 0x004E4942) + binary)


__all__: List[str] = ["part_name", "write_glb"]
