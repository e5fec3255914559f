"""Models: bundles prepared for stepping."""
import importlib
import os
import pathlib
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from . import _exmat
from .arrays import StrPath
from .errors import BadInput, InvalidArgument
from .inputs import json_text, plain_members


class Model(_exmat.Model):
    """A bundle prepared for stepping, and what acts on its bodies. It never changes; any number of threads may use it.

    `bundle` is a path, of a bundle or a pack of one, or the bytes of a pack.

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
    use_contact          whether bodies can touch obstacles of add_obstacle() and each other in a World; False
    sleep_energy         a body is left alone once its kinetic energy has been below this [J]; 0: never
    sleep_time           for so long, > 0 [s]; 0.5
    space                "reduced": steps in the modes of the bundle; "full": in all vertices of its mesh, right under any
                         load; "auto": in all vertices while applied forces act or obstacles touch, in the modes else
    space_release        how long "auto" stays in all vertices after the last such load, > 0 [s]; 0.5
    precision            "double", or "mixed": of bodies side by side, with their stiffness in single precision

    Raises BadInput (the bundle) and InvalidArgument (a setting).
    """

    def __init__(
        self,
        bundle: Union[StrPath, bytes],
        *,
        time_step: Optional[float] = None,
        gravity: Optional[Sequence[float]] = None,
        integrator: Optional[str] = None,
        internal_force: Optional[str] = None,
        mass_damping: Optional[float] = None,
        stiffness_damping: Optional[float] = None,
        newton_iterations: Optional[int] = None,
        newton_tolerance: Optional[float] = None,
        use_examples: Optional[bool] = None,
        example_stiffness: Optional[float] = None,
        example_damping: Optional[float] = None,
        example_bias: Optional[float] = None,
        example_target: Optional[str] = None,
        target_iterations: Optional[int] = None,
        energy_reference: Optional[str] = None,
        use_contact: bool = False,
        sleep_energy: Optional[float] = None,
        sleep_time: Optional[float] = None,
        precision: Optional[str] = None,
        space: Optional[str] = None,
        space_release: Optional[float] = None,
    ) -> None:
        examples = dict(example_stiffness=example_stiffness, example_damping=example_damping, example_bias=example_bias,
                        example_target=example_target, target_iterations=target_iterations, energy_reference=energy_reference)
        if use_examples is None:
            use_examples = any(value is not None for value in examples.values())
        others = dict(time_step=time_step, gravity=gravity, integrator=integrator, internal_force=internal_force,
                      mass_damping=mass_damping, stiffness_damping=stiffness_damping, newton_iterations=newton_iterations,
                      newton_tolerance=newton_tolerance, use_examples=flag("use_examples", use_examples),
                      use_contact=flag("use_contact", use_contact),
                      sleep_energy=sleep_energy, sleep_time=sleep_time, precision=precision, space=space,
                      space_release=space_release)
        self._load(bundle, {name: value for name, value in {**others, **examples}.items() if value is not None})

    @classmethod
    def from_scene(cls, scene: Union[StrPath, Mapping[str, Any]], *, use_contact: bool = False) -> "Model":
        """Of a scene, with its scripted forces, obstacles, motions and start; a path, or the members of such a file.

        Paths in members are relative to the current folder. Steps, instances and output are not the model's business.
        With `use_contact` bodies can touch also where the scene has no obstacles. A scene of several bodies is for
        World.from_scene().
        """
        model = cls.__new__(cls)
        flag("use_contact", use_contact)
        if isinstance(scene, Mapping):
            model._load_members(plain_members(scene), use_contact)
        elif use_contact and os.path.exists(scene):
            model._load_text(pathlib.Path(scene).read_bytes(), os.fspath(scene))
        else:
            model._load(scene, None)
        return model

    def _load(self, path: Union[StrPath, bytes], settings: Optional[Dict[str, Any]]) -> None:
        if isinstance(path, bytes):
            _exmat.Model.__init__(self, path, settings or {})
            self._recipe: Tuple[str, Any, Optional[Dict[str, Any]]] = ("file", path, settings)
            return
        _exmat.Model.__init__(self, os.fspath(path), settings)
        self._recipe = ("file", os.path.abspath(path), settings)

    def _load_text(self, scene: bytes, path: str) -> None:
        _exmat.Model.__init__(self, scene, path, True)
        self._recipe = ("text", (scene, os.path.abspath(path)), None)

    def _load_members(self, scene: Dict[str, Any], use_contact: bool) -> None:
        _exmat.Model.__init__(self, json_text(scene), os.path.abspath("scene.json"), use_contact)
        self._recipe = ("members", scene, {"use_contact": use_contact})

    @classmethod
    def _of_kind(cls, world: _exmat.World, kind: int, recipe: Any) -> "Model":
        """That of the bodies of a kind in a new world, which `recipe` makes."""
        model = cls.__new__(cls)
        _exmat.Model.__init__(model, world, kind)
        model._recipe = ("world", (recipe, kind), None)
        return model

    def mass_matrix(self) -> Any:
        """The consistent mass M of the object, shape (3n, 3n) [kg]: x y z of one vertex after another, the fixed ones among them.

        A scipy.sparse.csr_matrix; where SciPy is missing, the tuple (data, indices, indptr) that would make one.
        """
        return self._sparse(self._mass())

    def stiffness_matrix(self) -> Any:
        """The stiffness K of the object, the Hessian of its elastic energy at rest [N/m]: as mass_matrix()."""
        return self._sparse(self._stiffness())

    def _sparse(self, rows: Tuple[Any, Any, Any]) -> Any:
        try:
            sparse = importlib.import_module("scipy.sparse")
        except ImportError:
            return rows
        return sparse.csr_matrix(rows, shape=(3 * self.vertices, 3 * self.vertices))

    def __copy__(self) -> "Model":
        return self

    def __deepcopy__(self, memo: Dict[int, Any]) -> "Model":
        return self

    def __reduce__(self) -> Any:
        """It is loaded again where it is unpickled: from the same file, which has to hold the same bundle."""
        return _reload, (self._recipe, self.input_sha256)

    def __repr__(self) -> str:
        return f"<exmat.Model {_name(self._recipe)}: {self.modes} modes, {self.vertices} vertices, {self.examples} examples>"


def flag(name: str, value: Any) -> int:
    if not any(value is known for known in (False, True, 0, 1)) and not isinstance(value, np.bool_):
        raise InvalidArgument(f"{name} = {value!r}: expected True or False")
    return int(value)


def _name(recipe: Tuple[str, Any, Optional[Dict[str, Any]]]) -> str:
    """Of the file that a model is of."""
    kind, what, _ = recipe
    if kind == "world":
        return f"{world_name(what[0])}[{what[1]}]"
    if isinstance(what, bytes):
        return "pack in memory"
    return pathlib.Path(what["bundle"] if kind == "members" else what[1] if kind == "text" else what).name


def world_name(recipe: Tuple[str, Any]) -> str:
    return pathlib.Path(recipe[1]).name if recipe[0] == "file" else "scene"


def _reload(recipe: Tuple[str, Any, Optional[Dict[str, Any]]], sha: str) -> Model:
    kind, what, settings = recipe
    model = Model.__new__(Model)
    if kind == "members":
        model._load_members(what, bool(settings and settings["use_contact"]))
    elif kind == "text":
        model._load_text(*what)
    elif kind == "world":
        from .world import world_of

        made, place = what
        model = Model._of_kind(world_of(made), place, made)
    else:
        model._load(what, settings)
    if model.input_sha256 != sha:
        raise BadInput(f"{_name(recipe)}: expected the bundle {sha} that was pickled, found {model.input_sha256}; unpickle it beside the same "
                       "bundle")
    return model
