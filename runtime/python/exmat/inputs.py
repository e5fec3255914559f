"""Files for exmat-precompute from what a program has: members as dicts, meshes as arrays."""
import json
import math
import os
import pathlib
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from .arrays import StrPath, array, cells, surface_arrays
from .errors import InvalidArgument
from .surfaces import write_glb

PATHS = ("mesh", "surface", "skeleton", "render_mesh", "file", "landmarks", "asset", "scene", "bundle", "exact_examples", "poses")
_TOO_DEEP = "expected members as JSON has them, found some that are nested hundreds deep, or hold themselves"


def write_mesh(path: StrPath, vertices: Any, tets: Any) -> None:
    """Writes a tet mesh, `vertices` (n, 3) [m] and `tets` (n_t, 4) of 0-based vertices, as legacy .vtk in double precision."""
    points = array(vertices, "vertices", 3, ">f8")
    corners = cells(tets, "tets", 4, len(points), ">i4")
    counted = np.column_stack([np.full(len(corners), 4, ">i4"), corners]).astype(">i4")
    with open(path, "wb") as file:
        file.write(b"# vtk DataFile Version 3.0\nexmat\nBINARY\nDATASET UNSTRUCTURED_GRID\n")
        file.write(f"POINTS {len(points)} double\n".encode() + points.tobytes())
        file.write(f"\nCELLS {len(corners)} {5 * len(corners)}\n".encode() + counted.tobytes())
        file.write(f"\nCELL_TYPES {len(corners)}\n".encode() + np.full(len(corners), 10, ">i4").tobytes() + b"\n")


def write_surface(path: StrPath, vertices: Any, triangles: Any) -> None:
    """Writes a surface, `vertices` (v, 3) [m] and `triangles` (f, 3) of 0-based vertices, as .obj."""
    points, faces = surface_arrays(vertices, triangles)
    lines = ["v {!r} {!r} {!r}".format(*map(float, point)) for point in points]
    lines += ["f {} {} {}".format(*(int(corner) + 1 for corner in face)) for face in faces]
    pathlib.Path(path).write_text("\n".join(lines) + "\n")


def write_asset(asset: Union[StrPath, Mapping[str, Any]], folder: pathlib.Path) -> pathlib.Path:
    """The asset file: `asset` where it is one, else one in `folder`, with the meshes that are given as arrays beside it."""
    if not isinstance(asset, Mapping):
        return pathlib.Path(asset)
    members: Dict[str, Any] = plain_members(asset)
    given = asset.get("object", {})
    examples = asset.get("examples", [])
    if not isinstance(given, Mapping) or not isinstance(examples, (list, tuple)) or not all(isinstance(example, Mapping) for example in examples):
        return _write_json(folder / "asset.json", members)  # which the program refuses
    _take_object(given, members.get("object", {}), folder)
    _take_surfaces(given, examples, members, folder)
    for place, example in enumerate(examples):
        if "mesh" in example:
            path, name = folder / f"example_{place}.vtk", f"examples[{place}].mesh"
            members["examples"][place]["mesh"] = _mesh_file(example["mesh"], path, _mesh_of_poses(examples, given), name)
    return _write_json(folder / "asset.json", members)


def write_members(given: Union[StrPath, Mapping[str, Any]], path: pathlib.Path) -> pathlib.Path:
    """The file `given`, or `path` with these members; paths in members become absolute."""
    return _write_json(path, plain_members(given)) if isinstance(given, Mapping) else pathlib.Path(given)


def _take_object(given: Mapping[str, Any], members: Dict[str, Any], folder: pathlib.Path) -> None:
    if "mesh" in given:
        members["mesh"] = _mesh_file(given["mesh"], folder / "object.vtk", None, "object.mesh")
    surface = given.get("render_mesh")
    if surface is not None and not isinstance(surface, (str, os.PathLike)):
        place = "object.render_mesh"
        members["render_mesh"] = _written(write_surface, folder / "render_mesh.obj", _pair(surface, place, "triangles"), place)


def _take_surfaces(given: Any, examples: Any, members: Dict[str, Any], folder: pathlib.Path) -> None:
    """Surfaces in arrays: the object's as a .glb whose morph targets are the poses, examples with triangles of their own as .obj."""
    surface = given.get("surface") if isinstance(given, Mapping) else None
    poses: Dict[str, Any] = {}
    for place, example in enumerate(examples):
        pose, name = example.get("surface"), f"examples[{place}].surface"
        if pose is None or isinstance(pose, (str, os.PathLike)):
            continue
        if isinstance(pose, (tuple, Mapping)):
            members["examples"][place]["surface"] = _written(write_surface, folder / f"example_{place}.obj", _pair(pose, name, "triangles"), name)
        elif surface is None or isinstance(surface, (str, os.PathLike)):
            raise InvalidArgument(f"{name}: expected (vertices, triangles), or vertices alone where the object's surface is "
                                  "given in arrays; found vertices alone")
        elif "name" not in example:
            raise InvalidArgument(f"examples[{place}]: expected a name, found none")
        else:
            poses[example["name"]] = pose
            del members["examples"][place]["surface"]
            members["examples"][place]["morph"] = example["name"]
    if surface is None or isinstance(surface, (str, os.PathLike)):
        return
    parts = surface.get("parts") if isinstance(surface, Mapping) else None
    if isinstance(surface, Mapping):
        surface = {name: value for name, value in surface.items() if name != "parts"}
    write_glb(folder / "surface.glb", *_pair(surface, "object.surface", "triangles"), poses, parts)
    members["object"]["surface"] = str(folder / "surface.glb")


def _mesh_file(mesh: Any, path: pathlib.Path, posed: Optional[Tuple[Any, Any]], place: str) -> Any:
    if mesh is None or isinstance(mesh, (str, os.PathLike)):
        return None if mesh is None else os.path.abspath(mesh)
    if not isinstance(mesh, (tuple, Mapping)):
        if posed is None:
            raise InvalidArgument(f"{place}: expected (vertices, tets), or vertices alone where the rest example or the object is given so; "
                                  "found vertices alone")
        expected, found = (len(array(vertices, place, 3, "f8")) for vertices in (posed[0], mesh))
        if found != expected:
            raise InvalidArgument(f"{place}: expected {expected} vertices, as the mesh has that it is a pose of, found {found}")
        mesh = (mesh, posed[1])
    return _written(write_mesh, path, _pair(mesh, place, "tets"), place)


def _written(write: Callable[..., None], path: pathlib.Path, mesh: Tuple[Any, Any], place: str) -> str:
    """The path, once the file is written; `place` is for the message."""
    try:
        write(path, *mesh)
    except InvalidArgument as error:
        raise InvalidArgument(f"{place}: {error}") from None
    return str(path)


def _pair(mesh: Any, place: str, cells: str) -> Tuple[Any, Any]:
    if isinstance(mesh, Mapping) and set(mesh) == {"vertices", cells}:
        return mesh["vertices"], mesh[cells]
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return mesh[0], mesh[1]
    raise InvalidArgument(f"{place}: expected a path or (vertices, {cells})")


def _mesh_of_poses(examples: Any, given: Any) -> Optional[Tuple[Any, Any]]:
    """The mesh in arrays that vertices alone are a pose of: the rest example, the object where there is none."""
    rest = next((example.get("mesh") for example in examples if example.get("rest")), None)
    mesh = given.get("mesh") if rest is None else rest
    return _pair(mesh, "mesh", "tets") if isinstance(mesh, (tuple, Mapping)) else None


def plain_members(value: Any) -> Any:
    """As JSON has it: arrays as lists, numbers finite, paths absolute. Meshes in arrays are left out."""
    try:
        return _plain(value, "", "")
    except RecursionError:
        raise InvalidArgument(_TOO_DEEP) from None


def _plain(value: Any, key: str, place: str) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(member, str(name), f"{place}/{name}") for name, member in value.items()}
    if isinstance(value, os.PathLike) or (isinstance(value, str) and key in PATHS):
        return os.path.abspath(value)
    if key in ("mesh", "surface", "render_mesh"):
        return None
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), key, place)
    if isinstance(value, np.generic):
        return _plain(value.item(), key, place)
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidArgument(f"{place}: expected a finite number, found {value}")
    return [_plain(member, "", f"{place}/{index}") for index, member in enumerate(value)] if isinstance(value, (list, tuple)) else value


def _write_json(path: pathlib.Path, members: Mapping[str, Any]) -> pathlib.Path:
    path.write_text(json_text(members))
    return path


def json_text(members: Mapping[str, Any]) -> str:
    try:
        return json.dumps(members, indent=1)
    except RecursionError:
        raise InvalidArgument(_TOO_DEEP) from None
    except TypeError as error:
        raise InvalidArgument(f"expected members as JSON has them: {error}") from None


__all__: List[str] = ["json_text", "plain_members", "write_asset", "write_members", "write_mesh", "write_surface"]
