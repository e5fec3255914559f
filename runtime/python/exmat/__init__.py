"""Real-time example-based elastic materials.

A Model is a bundle prepared once, a Body is what is stepped, Points are what is pushed and drawn, a World is bodies
that are stepped together and touch each other and its obstacles, a Batch is many bodies of one model in arrays.
Trajectory and Bundle open the files; exmat.precompute makes bundles.

    import exmat
    model = exmat.Model("bar.h5", example_stiffness=4000, example_bias=0.5)
    points = exmat.Points.all_vertices(model)
    body = exmat.Body(model)
    body.step(16)
    xyz = body.positions(points)      # (n, 3) [m]

Units are SI, positions those of the world. r modes, K examples, n vertices.
"""
import copyreg
from typing import Any

from . import _exmat, precompute
from ._exmat import (Batch, Body, Capacity, ContactLaw, Energies, Motion, Obstacle, Points, RayHit, Report, Shape, State, Surface, WorldReport,
                     WorldState, state_hash)
from ._exmat import version as __version__
from .errors import BadInput, Cancelled, Error, Failure, InvalidArgument, NonFinite
from .fields import Bundle, Field, Trajectory
from .model import Model
from .world import World


def _reduce(kept: Any) -> Any:
    """As pickle's later protocols do it; by the first two pybind11 ends the interpreter."""
    read_state = getattr(type(kept), "__getstate__", None)
    if read_state is None or read_state is getattr(object, "__getstate__", None):
        raise TypeError(f"cannot pickle {type(kept).__name__!r} object")
    return copyreg.__newobj__, (type(kept),), read_state(kept)  # type: ignore[attr-defined]


for _class in [value for value in vars(_exmat).values() if isinstance(value, type)]:
    _class.__reduce__ = _reduce  # type: ignore[assignment]

__all__ = ["BadInput", "Batch", "Body", "Bundle", "Cancelled", "Capacity", "ContactLaw", "Energies", "Error", "Failure", "Field", "InvalidArgument", "Model",
           "Motion", "NonFinite", "Obstacle", "Points", "RayHit", "Report", "Shape", "State", "Surface", "Trajectory", "World", "WorldReport",
           "WorldState", "precompute", "state_hash"]
