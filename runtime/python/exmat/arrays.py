"""What is given as an array, checked."""
import os
from typing import Any, List, Tuple, Union

import numpy as np

from .errors import InvalidArgument

StrPath = Union[str, "os.PathLike[str]"]


def numbers(values: Any, name: str) -> Any:
    """`values` as doubles, True as 1; `name` is for the message."""
    given = np.asarray(values)
    if given.dtype.kind not in "fiub":
        raise InvalidArgument(f"{name}: expected real numbers")
    return given.astype("f8")


def array(values: Any, name: str, width: int, kind: str) -> Any:
    """`values` as (..., width) of the type `kind`; `name` is for the message."""
    given = np.asarray(values)
    if given.ndim != 2 or given.shape[1] != width:
        raise InvalidArgument(f"{name}: shape {given.shape}: expected (..., {width})")
    if given.dtype.kind not in "fiu":
        raise InvalidArgument(f"{name}: expected numbers")
    return np.ascontiguousarray(given, kind)


def cells(values: Any, name: str, width: int, vertices: int, kind: str) -> Any:
    """`values` as (..., width) of the type `kind`, at least one row, all of them vertices from 0 to `vertices` - 1."""
    given = np.asarray(values)
    if given.ndim == 2 and given.shape[1] == width and given.dtype.kind not in "iu":
        raise InvalidArgument(f"{name}: expected whole numbers")
    converted = array(given, name, width, kind)
    if len(given) == 0:
        raise InvalidArgument(f"{name}: expected at least one")
    for row, column in np.argwhere((given < 0) | (given >= vertices)):
        raise InvalidArgument(f"{name}[{row}, {column}] = {given[row, column]}: expected a vertex, 0 to {vertices - 1}")
    return converted


def surface_arrays(vertices: Any, triangles: Any) -> Tuple[Any, Any]:
    """A surface's vertices (v, 3) and triangles (f, 3), checked."""
    points = array(vertices, "vertices", 3, "f8")
    return points, cells(triangles, "triangles", 3, len(points), "i8")


__all__: List[str] = ["StrPath", "array", "cells", "numbers", "surface_arrays"]
