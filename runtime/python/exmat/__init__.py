"""Real-time example-based elastic materials.

A Model is a bundle prepared once, a Body is what is stepped, Points are what is pushed and drawn, a World is many bodies
in arrays, a TouchingWorld is bodies that touch each other. Trajectory and Bundle open the files; exmat.precompute makes bundles.

    import exmat
    model = exmat.Model("bar.h5", example_stiffness=4000, example_bias=0.5)
    points = exmat.Points.all_vertices(model)
    body = exmat.Body(model)
    body.step(16)
    xyz = body.positions(points)      # (n, 3) [m]

Units are SI, positions those of the world. r modes, K examples, n vertices.
"""
from . import precompute
from ._exmat import (Body, ContactLaw, Energies, Motion, Obstacle, Points, Report, Shape, State, World, WorldReport, WorldState,
                     state_hash, step)
from ._exmat import version as __version__
from .errors import BadInput, Cancelled, Error, Failure, InvalidArgument, NonFinite
from .fields import Bundle, Field, Trajectory
from .model import Model
from .touching_world import TouchingWorld

__all__ = ["BadInput", "Body", "Bundle", "Cancelled", "ContactLaw", "Energies", "Error", "Failure", "Field", "InvalidArgument", "Model",
           "Motion", "NonFinite", "Obstacle", "Points", "Report", "Shape", "State", "TouchingWorld", "Trajectory", "World", "WorldReport",
           "WorldState", "precompute", "state_hash", "step"]
