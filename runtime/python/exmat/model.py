"""Models: bundles prepared for stepping."""
import json
import os
import pathlib
import tempfile
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple, Union

from . import _exmat
from .errors import BadInput

StrPath = Union[str, "os.PathLike[str]"]


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
    sleep_energy         a body is left alone once its kinetic energy has been below this [J]; 0: never
    sleep_time           for so long, > 0 [s]; 0.5
    precision            "double", or "mixed": of bodies side by side, with their stiffness in single precision

    Raises BadInput (the bundle) and InvalidArgument (a setting).
    """

    def __init__(
        self,
        bundle: StrPath,
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
        sleep_energy: Optional[float] = None,
        sleep_time: Optional[float] = None,
        precision: Optional[str] = None,
    ) -> None:
        examples = dict(example_stiffness=example_stiffness, example_damping=example_damping, example_bias=example_bias,
                        example_target=example_target, target_iterations=target_iterations, energy_reference=energy_reference)
        if use_examples is None:
            use_examples = any(value is not None for value in examples.values())
        others = dict(time_step=time_step, gravity=gravity, integrator=integrator, internal_force=internal_force,
                      mass_damping=mass_damping, stiffness_damping=stiffness_damping, newton_iterations=newton_iterations,
                      newton_tolerance=newton_tolerance, use_examples=int(use_examples), sleep_energy=sleep_energy,
                      sleep_time=sleep_time, precision=precision)
        self._load(bundle, {name: value for name, value in {**others, **examples}.items() if value is not None})

    @classmethod
    def from_scene(cls, scene: Union[StrPath, Mapping[str, Any]]) -> "Model":
        """Of a scene, with its scripted forces, obstacles, motions and start; a path, or the members of such a file.

        Paths in members are relative to the current folder. Steps, instances and output are not the model's business.
        """
        model = cls.__new__(cls)
        if not isinstance(scene, Mapping):
            model._load(scene, None)
            return model
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.json"
            path.write_text(json.dumps(_with_absolute_paths(scene)))
            model._load(path, None)
        model._recipe = ("members", dict(_with_absolute_paths(scene)), None)
        return model

    def _load(self, path: StrPath, settings: Optional[Dict[str, Any]]) -> None:
        _exmat.Model.__init__(self, os.fspath(path), settings)
        self._recipe: Tuple[str, Any, Optional[Dict[str, Any]]] = ("file", os.path.abspath(path), settings)

    def __copy__(self) -> "Model":
        return self

    def __deepcopy__(self, memo: Dict[int, Any]) -> "Model":
        return self

    def __reduce__(self) -> Any:
        """It is loaded again where it is unpickled: from the same file, which has to hold the same bundle."""
        return _reload, (self._recipe, self.input_sha256)

    def __repr__(self) -> str:
        kind, what, _ = self._recipe
        name = pathlib.Path(what if kind == "file" else what["bundle"]).name
        return f"<exmat.Model {name}: {self.modes} modes, {self.vertices} vertices, {self.examples} examples>"


def _reload(recipe: Tuple[str, Any, Optional[Dict[str, Any]]], sha: str) -> Model:
    kind, what, settings = recipe
    if kind == "members":
        model = Model.from_scene(what)
    else:
        model = Model.__new__(Model)
        model._load(what, settings)
    if model.input_sha256 != sha:
        raise BadInput(f"{what if kind == 'file' else what['bundle']}: expected the bundle {sha} that was pickled, found "
                       f"{model.input_sha256}; unpickle it beside the same bundle")
    return model


def _with_absolute_paths(scene: Mapping[str, Any]) -> Dict[str, Any]:
    members = dict(scene)
    if "bundle" in members:
        members["bundle"] = os.path.abspath(members["bundle"])
    members["forces"] = [_absolute_file(force) for force in scene.get("forces", [])]
    if not members["forces"]:
        del members["forces"]
    return members


def _absolute_file(force: Mapping[str, Any]) -> Dict[str, Any]:
    vertices = dict(force.get("vertices", {}))
    if "file" in vertices:
        vertices["file"] = os.path.abspath(vertices["file"])
    return {**force, "vertices": vertices}
