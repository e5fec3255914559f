"""Worlds: bodies that are stepped together, and their obstacles."""
import os
from typing import Any, Dict, Mapping, Optional, Tuple, Type, Union

from . import _exmat
from .arrays import StrPath
from .errors import BadInput
from .inputs import json_text, plain_members
from .model import Model, flag, world_name


class World(_exmat.World):
    """Bodies that touch each other and the world's obstacles, stepped together: of any models that know of contact
    (use_contact, or a scene with obstacles) and have the same time step. It is a mapping of ids to bodies. A world is for
    one thread at a time.

    stiffness      pressure per depth, > 0, at most 1e15 [N/m^3]
    damping        pressure per approach velocity, >= 0 [N s/m^3]
    friction       Coulomb's coefficient, >= 0
    self_contact   whether a body also touches itself; takes time for each model when its first body is added

    All are per area of the bodies' surfaces. copy.copy() and pickle keep the bodies, their ids, what was set for each, the
    law, the obstacles and the state.
    """

    _recipe: Optional[Tuple[str, Any]] = None

    def __init__(self, *, stiffness: float = 1e6, damping: float = 0.0, friction: float = 0.0, self_contact: bool = False) -> None:
        _exmat.World.__init__(self, stiffness, damping, friction, bool(flag("self_contact", self_contact)))

    @classmethod
    def from_scene(cls, scene: Union[StrPath, Mapping[str, Any]]) -> "World":
        """All bodies of a scene, where they start, and its obstacles; a path, or the members of such a file. Ids of either
        are 0, 1, ... in its order. The instances of a scene of one "bundle" do not touch each other.

        Paths in members are relative to the current folder. Steps and output are not the world's business.
        """
        if isinstance(scene, Mapping):
            return world_of(("members", plain_members(scene)), cls)
        return world_of(("file", os.path.abspath(scene)), cls)

    def __copy__(self) -> "World":
        return _remade(self._recipe, self.contact_law.self_contact, {}, self._kept(), type(self))

    def __deepcopy__(self, memo: Dict[int, Any]) -> "World":
        return self.__copy__()

    def __reduce__(self) -> Any:
        """It is made again where it is unpickled: from the same files, which have to hold the same bundles."""
        shas = {self.kind(id): self[id].model.input_sha256 for id in self if self.kind(id) >= 0}
        return _remade, (self._recipe, self.contact_law.self_contact, shas, self._kept(), type(self))

    def __repr__(self) -> str:
        law = self.contact_law
        return f"<exmat.World: {len(self)} bodies, stiffness {law.stiffness:g}, damping {law.damping:g}, friction {law.friction:g}>"


def world_of(recipe: Tuple[str, Any], cls: Type[World] = World) -> World:
    """The world of a scene, where it starts."""
    kind, scene = recipe
    world = cls.__new__(cls)
    if kind == "file":
        _exmat.World.__init__(world, scene)
    else:
        _exmat.World.__init__(world, json_text(scene), os.path.abspath("scene.json"))
    world._recipe = recipe
    world._take_models([Model._of_kind(world, place, recipe) for place in range(world._kinds)])
    return world


def _remade(recipe: Optional[Tuple[str, Any]], self_contact: bool, shas: Mapping[int, str], kept: Dict[str, Any],
            cls: Type[World]) -> World:
    if recipe is None:
        world = cls.__new__(cls)
        _exmat.World.__init__(world, 1e6, 0.0, 0.0, self_contact)
    else:
        world = world_of(recipe, cls)
        for id in world:
            found, expected = world[id].model.input_sha256, shas.get(world.kind(id))
            if expected is not None and found != expected:
                raise BadInput(f"{world_name(recipe)}: expected for {world.name(id)} the bundle {expected} that was pickled, found {found}; "
                               "unpickle it beside the same bundles")
    world._restore(kept)
    return world
