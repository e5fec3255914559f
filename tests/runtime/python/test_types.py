"""Arguments of types that no function takes: a message in Python's words, and never one of pybind11's."""
import inspect
import math

import pytest

import exmat

BINDING = ("incompatible", "pybind", "Invoked with", "_exmat", "std::", "Unable to cast", "No constructor")


class Odd:
    pass


ODD = [None, [1], "x", {}, Odd(), 1.5, (1, 2, 3), [[1]], 1 << 70, -1, math.nan, b"x", True]


@pytest.mark.parametrize("call, message", [
    (lambda body, world: world.step("x"), r"step: expected \(n: int = 1, threads: int = 0\), found \('x'\)"),
    (lambda body, world: body.step([1]), r"step: expected \(n: int = 1\), found \(\[1\]\)"),
    (lambda body, world: exmat.Body(3), r"Body: expected \(model: exmat\.Model\), found \(3\)"),
    (lambda body, world: exmat.Body(), r"Body: expected \(model: exmat\.Model\), found nothing"),
    (lambda body, world: body.target(1.5), r"^target: expected \(region: Optional\[str\] = None\), found \(1\.5\)$"),
    (lambda body, world: body.model.example_names(3), r"example_names: expected \(region: Optional\[str\] = None\), found \(3\)"),
    (lambda body, world: body.set_example_stiffness(1.0, region=[]), r"set_example_stiffness: expected \(kappa: float, region: Optional\[str\] = None\)"),
    (lambda body, world: body.set_example_weights("x"), r"set_example_weights: expected \(weights: Optional\[.*float64\]\], region: .*, found \('x'\)"),
    (lambda body, world: body.set_example_weights([1, 0], region=1), r"set_example_weights: expected .*region: Optional\[str\].*region=1"),
    (lambda body, world: body.set_example_weights([[1], [1, 2]]), r"set_example_weights: expected .*found \(\[\[1\], \[1, 2\]\]\)"),
    (lambda body, world: body.reach(exmat.Points(body.model, [0]), [[0, 0, 0]], lowest="x"), r"reach: expected .*lowest: Optional\[.*lowest='x'"),
    (lambda body, world: world.restore(3), r"restore: expected"),
    (lambda body, world: exmat.state_hash([3]), r"state_hash: expected \(bodies: List\[exmat\.Body\]\), found \(\[3\]\)"),
    (lambda body, world: exmat.Shape(), r"^Shape: expected one that exmat makes, found a call of the class; take that of Shape\.plane\(\), sphere\(\)"),
    (lambda body, world: exmat.RayHit(1, 2), r"^RayHit: expected one that exmat makes, .*; take that of Body\.cast_ray\(\)$"),
    (lambda body, world: setattr(body, "state", "x"), r"^expected exmat\.State, found 'x'$"),
])
def test_a_message_names_what_it_takes_and_what_it_was_given(model, call, message):
    with pytest.raises(TypeError, match=message):
        call(exmat.Body(model), exmat.World())


def test_every_class_without_a_constructor_says_where_its_objects_come_from():
    for name in ("Shape", "State", "Report", "WorldState", "WorldReport", "Energies", "ContactLaw", "Obstacle", "RayHit"):
        with pytest.raises(TypeError, match=f"^{name}: expected .*; take that of (?!another)"):
            getattr(exmat, name)()


def test_no_call_speaks_of_its_binding(model):
    told, calls = set(), 0

    def attempt(function, *arguments, **named):
        nonlocal calls
        calls += 1
        try:
            function(*arguments, **named)
        except Exception as error:  # any kind will do: its words are what counts
            if any(word in str(error) for word in BINDING):
                told.add(str(error).splitlines()[0])

    objects = [exmat.Body(model), exmat.World(), exmat.Batch(model, 2), model]
    callables = [value for value in vars(exmat).values() if callable(value) and not (inspect.isclass(value) and issubclass(value, Exception))]
    for each in objects:
        for name in dir(each):
            if name.startswith("_"):
                continue
            value = getattr(each, name)
            if callable(value):
                callables.append(value)
                continue
            for odd in ODD:
                attempt(setattr, each, name, odd)
    for function in callables:
        attempt(function)
        attempt(function, *[1] * 11)
        attempt(function, nonsense=1)
        for odd in ODD:
            for count in (1, 2, 3):
                attempt(function, *[odd] * count)
    assert not told
    assert calls > 3000
