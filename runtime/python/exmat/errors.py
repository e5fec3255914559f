"""Exceptions of exmat. All are of Error; each also is the built-in one that it is a kind of."""
import re


def in_words(text: str) -> str:
    """The text of a TypeError of pybind11 as a message: what the function takes, and what it was given."""
    name, separator, rest = text.partition("(): incompatible ")
    if not separator:
        return text
    found = rest.partition("Invoked with: ")[2].partition("\n\nDid you forget")[0].strip()
    takes = []
    for scope, arguments in re.findall(r"^ +\d+\. ([\w.]*)\((.*?)\)(?: -> .*)?$", rest, re.M):
        if name == "__init__" and scope:
            name = scope.rpartition(".")[2]
        own, _, others = arguments.partition(", ")
        if own.startswith("self: ") or not name:  # a property has no name
            arguments = others if name else others.partition(": ")[2]
            found = re.sub(r"^<[^<>]*>(, )?", "", found)
        takes.append(f"({arguments})" if name else arguments)
    expected, given = " or ".join(takes), f"({found})" if found and name else found or "nothing"
    return f"{name}{': ' if name else ''}expected {expected}, found {given}".replace("_exmat.", "")


MAKERS = {"Shape": "Shape.plane(), sphere(), box(), capsule(), mesh() or height_field()", "State": "Body.state", "Report": "Body.step()",
          "WorldState": "World.state", "WorldReport": "World.step()", "Energies": "energies", "ContactLaw": "contact_law",
          "Obstacle": "obstacle()", "RayHit": "Body.cast_ray()"}


def without_constructor(name: str) -> str:
    """The text of the TypeError of a class that is called although it has no constructor."""
    return f"{name}: expected one that exmat makes, found a call of the class; take that of {MAKERS.get(name, 'another object')}"


class Error(Exception):
    """Something that exmat says; its text is the library's or the program's message."""


class Failure(Error, RuntimeError):
    """Out of memory, a file that cannot be read to its end, a program that failed while working."""


class BadInput(Error, ValueError):
    """A bundle, scene or asset is wrong: the message has file, place, what was expected and found, and advice."""


class InvalidArgument(Error, ValueError):
    """An argument of a function is wrong."""


class NonFinite(Error, ArithmeticError):
    """A step met NaN or infinity; the body is as it was before that step."""


class Cancelled(Error):
    """A computation was cancelled; it has written nothing."""
