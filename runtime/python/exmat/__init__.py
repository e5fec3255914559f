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
from . import precompute
from ._exmat import (Batch, Body, Capacity, ContactLaw, Energies, Motion, Obstacle, Points, Report, Shape, State, Surface, WorldReport,
                     WorldState, state_hash)
from ._exmat import version as __version__
from .errors import BadInput, Cancelled, Error, Failure, InvalidArgument, NonFinite
from .fields import Bundle, Field, Trajectory
from .model import Model
from .world import World

__all__ = ["BadInput", "Batch", "Body", "Bundle", "Cancelled", "Capacity", "ContactLaw", "Energies", "Error", "Failure", "Field", "InvalidArgument", "Model",
           "Motion", "NonFinite", "Obstacle", "Points", "Report", "Shape", "State", "Surface", "Trajectory", "World", "WorldReport",
           "WorldState", "precompute", "state_hash"]
