"""Models: bundles prepared for stepping."""
import os
import pathlib
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple, Union

from . import _exmat
from .arrays import StrPath
from .errors import BadInput
from .inputs import json_text, plain_members


class Model(_exmat.Model):
    """A bundle prepared for stepping, and what acts on its bodies. It never changes; any number of threads may use it.

    Settings are the members of a scene file that belong to a model, with the same defaults and ranges:

    time_step            > 0 [s]; 0.001
    gravity              three numbers [m/s^2]; 0
    integrator           "bdf2", "backward_euler" or "newmark"
    internal_force       "auto" (as the bundle says), "cubature" or "polynomial"
    mass_damping         alpha >= 0 [1/s]; 0
    stiffness_damping    beta >= 0 [s]; 0
    newton_iterations    most in one step, 1 to 10000; 200
    newton_tolerance     in (0, 1), relative; 1e-6
    use_examples         whether there is an example force; where it is absent: whether any setting of examples is given
    example_stiffness    kappa >= 0 [1/s^2]; 0
    example_damping      c_kappa >= 0 [1/s]; 0
    example_bias         in [0, 1], factor on the weight of the rest pose; 1
    example_target       "auto", "table" or "solve"
    target_iterations    most in one step, 1 to 1000; 4
    energy_reference     "example" or "rest"
                      newton_tolerance=newton_tolerance, use_examples=int(use_examples), sleep_energy=sleep_energy,
                      sleep_time=sleep_time)
