"""Many bodies as arrays."""
import pickle

import numpy as np
import pytest

import exmat


@pytest.fixture
def world(model):
    return exmat.World(model, 5)


def test_arrays_are_rows_of_its_bodies(world):
    rng = np.random.default_rng(1)
    q, v = 1e-2 * rng.standard_normal((2, 5, 12))
    world.set_reduced(q, v)
    assert np.array_equal(world.q, q) and np.array_equal(world.v, v)
    world.step(7)
    points = exmat.Points(world.model, [339, 1])
    positions = world.positions(points)
    assert positions.shape == (5, 2, 3) and len(world) == 5 and world.weights.shape == (5, 2)
    for i, body in enumerate(world):
        assert np.array_equal(world.q[i], body.q) and np.array_equal(world.v[i], body.v)
        assert np.array_equal(positions[i], body.positions(points)) and np.array_equal(world.weights[i], body.weights)
        assert world.energies[i].tolist() == [body.energies.kinetic, body.energies.elastic, body.energies.potential]
        assert world.time[i] == body.time and world.status[i] == body.report.status
    out = np.empty((5, 12))
    assert world.displacements(out) is out and np.array_equal(out, world.q) and np.array_equal(world.velocities(), world.v)
    assert world[-1] is world[4]
    with pytest.raises(IndexError):
        world[5]


def test_steps_do_not_depend_on_threads_or_company(world, model):
    kappa = np.linspace(0, 8000, 5)
    world.set_example_stiffness(kappa)
    world.step(3, threads=1)
    world.step(17, threads=3)
    for i, stiffness in enumerate(kappa):
        alone = exmat.Body(model)
        alone.set_example_stiffness(stiffness)
        alone.step(20)
        # Five step side by side, where sums have another order: 1e-13 of a step.
        assert np.linalg.norm(alone.q - world[i].q) <= 20e-13 * np.linalg.norm(alone.q)
    once = exmat.World(model, 5)
    once.set_example_stiffness(kappa)
    once.step(20, threads=1)
    assert exmat.state_hash(list(once)) == exmat.state_hash(list(world))


def test_forces_and_weights_by_rows_or_for_all(world):
    points = exmat.Points(world.model, [339])
    push = np.zeros((5, 1, 3))
    push[:, 0, 2] = np.arange(5)
    world.apply_forces(points, push)
    world.set_example_weights([[k / 4, 1 - k / 4] for k in range(5)])
    world.step(20)
    assert world.weights[:, 0].tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert len({row.tobytes() for row in world.q}) == 5
    world.reset()
    world.clear_forces()
    world.set_example_weights(None)
    world.apply_forces(points, [[0, 0, 3]])
    world.set_example_stiffness(77)
    world.step(20)
    assert len({row.tobytes() for row in world.q}) == 1


def test_states_are_kept_and_pickled(world):
    world.set_example_stiffness(np.arange(5.0))
    world.step(5)
    states = world.states
    other = pickle.loads(pickle.dumps(world))
    for either in (world, other):
        either.step(5)
    assert exmat.state_hash(world) == exmat.state_hash(other)
    world.states = states
    world.step(5)
    assert exmat.state_hash(world) == exmat.state_hash(other)


def test_what_does_not_fit_is_refused(world, model):
    points = exmat.Points(model, [0, 1])
    for call in (lambda: world.set_reduced(np.zeros((5, 11)), np.zeros((5, 12))), lambda: world.apply_forces(points, np.zeros((4, 2, 3))),
                 lambda: world.set_example_stiffness([1, 2]), lambda: world.set_example_weights(np.ones((5, 3)) / 3),
                 lambda: setattr(world, "states", []), lambda: exmat.World(model, 0), lambda: world.displacements(np.empty((4, 12)))):
        with pytest.raises(exmat.InvalidArgument):
            call()
