"""What is given as an array, checked."""
import os
from typing import Any, List, Tuple, Union

import numpy as np

from .errors import InvalidArgument

StrPath = Union[str, "os.PathLike[str]"]


def array(values: Any, name: str, width: int, kind: str) -> Any:
    """`values` as (..., width) of the type `kind`; `name` is for the message."""
    given = np.asarray(values)
    if given.ndim != 2 or given.shape[1] != width:
        raise InvalidArgument(f"{name}: shape {given.shape}: expected (..., {width})")
    if "i" in kind and given.dtype.kind not in "iu":
        raise InvalidArgument(f"{name}: expected whole numbers")
    return np.ascontiguousarray(given, kind)


def surface_arrays(vertices: Any, triangles: Any) -> Tuple[Any, Any]:
    """A surface's vertices (v, 3) and triangles (f, 3), checked."""
    points = array(vertices, "vertices", 3, "f8")
    faces = array(triangles, "triangles", 3, "i8")
    if len(faces) == 0 or faces.min() < 0 or faces.max() >= len(points):
        raise InvalidArgument(f"triangles: expected at least one, of vertices from 0 to {len(points) - 1}")
    return points, faces


__all__: List[str] = ["StrPath", "array", "surface_arrays"]
