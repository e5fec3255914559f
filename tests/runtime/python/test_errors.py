"""Exceptions, threads and memory."""
import gc
import resource
import threading

import numpy as np
import pytest

import exmat


def test_each_has_its_kind():
    for kind, built_in in ((exmat.BadInput, ValueError), (exmat.InvalidArgument, ValueError), (exmat.NonFinite, ArithmeticError),
                           (exmat.Failure, RuntimeError), (exmat.Cancelled, Exception)):
        assert issubclass(kind, exmat.Error) and issubclass(kind, built_in)


def test_messages_are_the_librarys(model, body, tmp_path):
    with pytest.raises(exmat.BadInput, match="nowhere.h5"):
        exmat.Model(tmp_path / "nowhere.h5")
    scene = tmp_path / "scene.json"
    scene.write_text('{"bundel": "bar.h5"}')
    with pytest.raises(exmat.BadInput, match='scene.json: .*did you mean "bundle"'):
        exmat.Model.from_scene(scene)
    with pytest.raises(exmat.InvalidArgument, match="settings: .*time_step"):
        exmat.Model(model._recipe[1], time_step=-1)
    with pytest.raises(exmat.InvalidArgument, match="integrator = 'euler': expected one of bdf2, backward_euler, newmark"):
        exmat.Model(model._recipe[1], integrator="euler")
    with pytest.raises(TypeError, match="timestep"):
        exmat.Model(model._recipe[1], timestep=0.1)
    with pytest.raises(exmat.InvalidArgument, match=r"ids\[1\] = 340: expected vertices of the object, 0 to 339"):
        exmat.Points(model, [0, 340])
    with pytest.raises(exmat.InvalidArgument, match=r"forces: shape \(3,\): expected \(1, 3\)"):
        body.apply_forces(exmat.Points(model, [0]), [1, 2, 3])
    with pytest.raises(exmat.InvalidArgument, match="can only be read"):
        body.apply_forces(exmat.Points.all_vertices(model), np.zeros((340, 3)))
    with pytest.raises(exmat.InvalidArgument, match="steps = -1"):
        body.step(-1)
    with pytest.raises(exmat.InvalidArgument, match="fixed vertices"):
        body.motion = exmat.Motion()
    with pytest.raises(exmat.InvalidArgument, match="found None"):
        exmat.state_hash([None])
    with pytest.raises(exmat.InvalidArgument, match="none that is named leg"):
        body.region_weights("leg")


def test_a_body_of_no_finite_numbers_is_as_it_was(bundle):
    body = exmat.Body(exmat.Model(bundle, time_step=0.001))
    body.set_reduced(np.full(12, 1e200), np.zeros(12))
    before = body.q.copy()
    with pytest.raises(exmat.NonFinite, match="NaN or infinity"):
        body.step()
    assert np.array_equal(body.q, before) and body.report.steps == 0
    batch = exmat.Batch(body.model, 3)
    batch.set_reduced([[0] * 12, [1e200] * 12, [0] * 12], np.zeros((3, 12)))
    with pytest.raises(exmat.NonFinite, match="body 1"):
        batch.step(4)
    assert batch.time == 0.001 and np.array_equal(batch.q[1], before)  # the step that the others have taken is the last


def test_steps_let_other_threads_run_and_refuse_the_same_body(model):
    body, other = exmat.Body(model), exmat.Body(model)
    done = threading.Event()

    def long():
        body.step(40000)
        done.set()

    thread = threading.Thread(target=long)
    thread.start()
    refused = stepped = 0
    while not done.is_set():
        other.step()
        stepped += 1
        try:
            body.step()
        except exmat.InvalidArgument as error:
            assert "another thread steps this body" in str(error)
            refused += 1
    thread.join()
    assert stepped > 10 and refused > 10
    body.step()


def test_threads_with_bodies_of_their_own_agree(model):
    ends = [0] * 4

    def run(place):
        body = exmat.Body(model)
        for _ in range(200):
            body.step()
        ends[place] = exmat.state_hash([body])

    threads = [threading.Thread(target=run, args=(place,)) for place in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(ends)) == 1


def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def test_a_hundred_thousand_creations_leave_no_memory(model, body):
    points = exmat.Points(model, [0])

    def create():
        new = exmat.Body(model)
        return new.q, new.report, new.energies, new.motion, body.state, body.positions(points)

    for _ in range(2000):
        create()
    gc.collect()
    before = resident()
    for _ in range(100_000):
        create()
    gc.collect()
    # 16 bytes for each creation: a body alone has tens of kilobytes, the smallest Python object 16 bytes.
    assert resident() - before < 16 * 100_000


@pytest.mark.parametrize("call", [
    lambda m: exmat.Body(None), lambda m: exmat.Points(None, [0]), lambda m: exmat.Points.at(None, [[0, 0, 0]]),
    lambda m: exmat.Points.all_vertices(None), lambda m: exmat.Points.elements(None), lambda m: exmat.Surface(None), lambda m: exmat.Capacity(None),
    lambda m: exmat.Batch(None, 3), lambda m: exmat.World().add(None), lambda m: exmat.World().add_obstacle(None),
    lambda m: exmat.Body(m).add_obstacle(None), lambda m: exmat.Body(m).positions(None), lambda m: exmat.Body(m).apply_forces(None, [[0, 0, 0]]),
    lambda m: exmat.Body.__new__(exmat.Body).q, lambda m: exmat.Body.__new__(exmat.Body).step(), lambda m: exmat.World.__new__(exmat.World).step(),
    lambda m: exmat.Batch.__new__(exmat.Batch).q, lambda m: exmat.Points.__new__(exmat.Points).distances, lambda m: exmat.Shape.__new__(exmat.Shape).kind,
    lambda m: exmat.Model.__new__(exmat.Model).modes, lambda m: exmat.Surface.__new__(exmat.Surface).rest,
    lambda m: exmat.World().add_obstacle(exmat.Shape.sphere(1), motion=exmat.Motion.__new__(exmat.Motion))])
def test_none_and_objects_that_nobody_made_are_type_errors(model, call):
    with pytest.raises(TypeError):
        call(model)


def test_points_beyond_all_bodies_are_refused(model):
    for far in (1e155, 1e300):
        with pytest.raises(exmat.InvalidArgument, match=r"^xyz\[0\] = 1e\+[0-9]+: expected at most 1e\+30 m$"):  # no function of C
            exmat.Points.at(model, [[far, 0, 0]])
