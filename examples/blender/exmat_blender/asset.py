"""From what the panel says to the members of an asset and of a scene (schemas/asset.json, schemas/scene.json)."""
import dataclasses
import hashlib
import json
from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from .fault import Fault

CLAMP = "_FIXED"
NEEDS = ("examples", "targets", "rigid", "contact", "regions", "render")  # rigid: the object may carry the body
RESERVED = {".", "..", "gram", "h0", "hq"}
LONGEST = 64  # bytes of a name
STILL = 1e-6  # of the size: a pose that moves no vertex farther shows the rest shape
ROUNDED = 1e-5  # of the scale
SPRING = 0.05  # of Young's modulus times size: a spring that is stiff beside the body


@dataclasses.dataclass
class Region:
    """Part of a body that some examples act on alone."""

    name: str
    marks: np.ndarray  #: (v,) bool
    examples: Sequence[str]


@dataclasses.dataclass
class Shape:
    """A mesh object, in local coordinates or as the body's frame has it [m]."""

    name: str
    vertices: np.ndarray  #: (v, 3) at rest
    triangles: np.ndarray  #: (f, 3)
    poses: Dict[str, np.ndarray] = dataclasses.field(default_factory=dict)  #: shape keys: (v, 3)
    clamp: Optional[np.ndarray] = None  #: (v,) bool; none: a free body
    regions: List[Region] = dataclasses.field(default_factory=list)

    def mapped(self, to):
        """With vertices to(vertices)."""
        return dataclasses.replace(self, vertices=to(self.vertices), poses={name: to(pose) for name, pose in self.poses.items()})

    @property
    def size(self):
        """Longest edge of the bounding box [m]."""
        return float(np.ptp(self.vertices, axis=0).max()) if len(self.vertices) else 0.0


@dataclasses.dataclass
class BodySettings:
    """How the body is made."""

    cells: int = 2000
    modes: int = 30
    training: bool = False
    youngs_modulus: float = 0.0  #: [Pa]; 0: 30 times what the body's own weight presses with
    poisson_ratio: float = 0.4
    density: float = 1000.0  #: [kg/m^3]


@dataclasses.dataclass
class MotionSettings:
    """What acts on it, in SI and the body's frame."""

    frame_time: float = 1 / 24  #: [s]
    steps: int = 40  #: of a frame
    gravity: Sequence[float] = (0.0, 0.0, -9.81)  #: [m/s^2]
    mass_damping: float = 0.5  #: [1/s]
    stiffness_damping: float = 0.002  #: [s]
    example_stiffness: float = 1000.0  #: kappa [1/s^2]
    example_damping: float = 10.0  #: [1/s]
    example_bias: float = 0.5
    floor: Optional[Dict[str, Any]] = None  #: point [m], normal, friction


def youngs_modulus(shape, settings):
    """[Pa]; the one that exmat-precompute assumes of a surface, where the panel has none."""
    return settings.youngs_modulus or 30 * settings.density * 9.81 * shape.size


def spring_stiffness(shape, settings):
    """[N/m] of a spring that draws a point of the body along."""
    return SPRING * youngs_modulus(shape, settings) * shape.size


def asset_of(shape, settings):
    """Members of the asset; meshes as arrays. Raises Fault."""
    _check(shape)
    names = example_names(shape.poses)
    members = {"vertices": shape.vertices, "triangles": shape.triangles, "parts": {}}
    body = {"surface": members, "cells": settings.cells,
            "material": {"model": "stable_neo_hookean", "youngs_modulus": youngs_modulus(shape, settings),
                         "poisson_ratio": settings.poisson_ratio, "density": settings.density}}
    if shape.clamp is not None:
        members["parts"][CLAMP] = shape.clamp
        body["fixed"] = {"part": CLAMP}
    asset = {"name": _name(shape.name) or "object", "object": body,
             "examples": [{"name": names[key], "surface": pose} for key, pose in shape.poses.items()],
             "basis": {"size": settings.modes, "training": "auto" if settings.training else "none"},
             "cubature": {"elements": 2 * settings.modes}, "needs": list(NEEDS)}
    regions = []
    for number, region in enumerate(shape.regions):
        part = f"_REGION_{number}"
        members["parts"][part] = region.marks
        regions.append({"name": _name(region.name), "vertices": {"part": part}, "example_vertices": {"part": part},
                        "examples": [names[key] for key in region.examples]})
    if regions:
        asset["regions"] = regions
    return asset


def scene_of(shape, settings, bundle):
    """Members of the scene."""
    scene = {"bundle": str(bundle), "time_step": settings.frame_time / settings.steps, "gravity": [float(g) for g in settings.gravity],
             "damping": {"mass": settings.mass_damping, "stiffness": settings.stiffness_damping}}
    force = {"stiffness": settings.example_stiffness, "damping": settings.example_damping, "bias": settings.example_bias}
    local = {key for region in shape.regions for key in region.examples}
    if set(shape.poses) - local:
        scene["examples"] = force
    if shape.regions:
        scene["regions"] = [{"name": _name(region.name), **force} for region in shape.regions]
    if settings.floor is not None:
        floor = settings.floor
        scene["obstacles"] = [{"plane": {"point": [float(x) for x in floor["point"]], "normal": [float(x) for x in floor["normal"]]},
                               "friction": floor["friction"]}]
    return scene


def made_of(shape, stretch):
    """What a bundle is made of, to be kept with it: a digest of the object in local coordinates, and how it is scaled (3, 3)."""
    digest = hashlib.sha256()
    for array in (shape.vertices, *shape.poses.values()):
        digest.update(np.ascontiguousarray(array, "<f8").tobytes())
    digest.update(np.ascontiguousarray(shape.triangles, "<i8").tobytes())
    digest.update(b"free" if shape.clamp is None else shape.clamp.astype("u1").tobytes())
    for region in shape.regions:
        digest.update(repr((region.name, sorted(region.examples))).encode() + region.marks.astype("u1").tobytes())
    digest.update("\0".join(shape.poses).encode())
    return json.dumps({"shape": digest.hexdigest(), "stretch": np.asarray(stretch).ravel().tolist()})


def is_made_of(kept, shape, stretch):
    """Whether it is what was kept; the scale to single precision, since objects may be moved and turned."""
    now, then = json.loads(made_of(shape, stretch)), json.loads(kept)
    return now["shape"] == then["shape"] and np.abs(np.subtract(now["stretch"], then["stretch"])).max() <= ROUNDED * np.abs(stretch).max()


def notes(shape):
    """What is no fault, and yet not what everybody wants."""
    found = []
    if not shape.poses:
        found.append("No shape keys: an elastic body without examples.")
    if shape.clamp is None:
        found.append("No clamp: the body is free, and falls.")
    edges = np.sort(shape.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True) if len(edges) else (None, np.zeros(0))
    if (counts == 1).any():
        found.append("The mesh is open: holes narrower than a cell are bridged, sheets become as thick as a cell.")
    return found


def example_names(keys):
    """Names that a bundle takes, each once, by shape key."""
    names = {}
    for key in keys:
        name = base = _name(key) or "pose"
        number = 1
        while name in names.values():
            number += 1
            name = f"{base[:LONGEST - 4]}_{number}"
        names[key] = name
    return names


def _name(key):
    name = "".join("_" if letter == "/" or ord(letter) < 32 else letter for letter in key)
    while len(name.encode()) > LONGEST - 1:
        name = name[:-1]
    return name + "_" if name in RESERVED else name


def _check(shape):
    if len(shape.triangles) == 0:
        raise Fault("The mesh has no faces: a body needs a surface.")
    if not np.isfinite(shape.vertices).all():
        raise Fault("The mesh has vertices that are not finite numbers.")
    if shape.size <= 0:
        raise Fault("All vertices of the mesh are in one place.")
    for key, pose in shape.poses.items():
        if not np.isfinite(pose).all():
            raise Fault(f"The shape key '{key}' has vertices that are not finite numbers.")
        if np.abs(pose - shape.vertices).max() <= STILL * shape.size:
            raise Fault(f"The shape key '{key}' moves nothing: shape it, mute it or remove it.")
    if shape.clamp is not None and not shape.clamp.any():
        raise Fault("The clamp's vertex group is empty: assign vertices with a weight above 0.5, or choose no clamp.")
    if shape.clamp is not None and shape.clamp.all():
        raise Fault("The clamp's vertex group holds all vertices: nothing is left to move.")
    names = set()
    for region in shape.regions:
        if _name(region.name) in names:
            raise Fault(f"There are two regions named '{region.name}'.")
        names.add(_name(region.name))
        if not region.marks.any():
            raise Fault(f"The region '{region.name}' is empty: assign vertices to its group with a weight above 0.5.")
        if not region.examples:
            raise Fault(f"The region '{region.name}' has no shape key: choose one, or remove it.")
        for key in region.examples:
            if key not in shape.poses:
                raise Fault(f"The region '{region.name}' names the shape key '{key}', which is not there or is muted.")
