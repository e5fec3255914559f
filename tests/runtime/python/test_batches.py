"""Many bodies as arrays."""
import pickle

import numpy as np
import pytest

import exmat


@pytest.fixture
def batch(model):
    return exmat.Batch(model, 5)


def test_arrays_are_rows_of_its_bodies(batch):
    rng = np.random.default_rng(1)
    q, v = 1e-2 * rng.standard_normal((2, 5, 12))
    batch.set_reduced(q, v)
    assert np.array_equal(batch.q, q) and np.array_equal(batch.v, v)
    batch.step(7)
    points = exmat.Points(batch.model, [339, 1])
    positions = batch.positions(points)
    assert positions.shape == (5, 2, 3) and len(batch) == 5 and batch.weights.shape == (5, 2)
    for i, body in enumerate(batch):
        assert np.array_equal(batch.q[i], body.q) and np.array_equal(batch.v[i], body.v)
        assert np.array_equal(positions[i], body.positions(points)) and np.array_equal(batch.weights[i], body.weights)
        assert batch.energies[i].tolist() == [body.energies.kinetic, body.energies.elastic, body.energies.potential]
        assert batch.time == body.time and batch.status[i] == body.report.status
    out = np.empty((5, 12))
    assert batch.displacements(out) is out and np.array_equal(out, batch.q) and np.array_equal(batch.velocities(), batch.v)
    assert batch[-1] is batch[4]
    with pytest.raises(IndexError):
        batch[5]


def test_steps_do_not_depend_on_threads_or_company(batch, model):
    kappa = np.linspace(0, 8000, 5)
    batch.set_example_stiffness(kappa)
    batch.step(3, threads=1)
    batch.step(17, threads=3)
    for i, stiffness in enumerate(kappa):
        alone = exmat.Body(model)
        alone.set_example_stiffness(stiffness)
        alone.step(20)
        # Five step side by side, where sums have another order: 1e-13 of a step.
        assert np.linalg.norm(alone.q - batch[i].q) <= 20e-13 * np.linalg.norm(alone.q)
    once = exmat.Batch(model, 5)
    once.set_example_stiffness(kappa)
    once.step(20, threads=1)
    assert exmat.state_hash(list(once)) == exmat.state_hash(list(batch))


def test_forces_and_weights_by_rows_or_for_all(batch):
    points = exmat.Points(batch.model, [339])
    push = np.zeros((5, 1, 3))
    push[:, 0, 2] = np.arange(5)
    batch.apply_forces(points, push)
    batch.set_example_weights([[k / 4, 1 - k / 4] for k in range(5)])
    batch.step(20)
    assert batch.weights[:, 0].tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert len({row.tobytes() for row in batch.q}) == 5
    batch.reset()
    batch.clear_forces()
    batch.set_example_weights(None)
    batch.apply_forces(points, [[0, 0, 3]])
    batch.set_example_stiffness(77)
    batch.step(20)
    assert len({row.tobytes() for row in batch.q}) == 1


def test_states_are_kept_and_pickled(batch):
    batch.set_example_stiffness(np.arange(5.0))
    batch.step(5)
    state = batch.state
    other = pickle.loads(pickle.dumps(batch))
    for either in (batch, other):
        either.step(5)
    assert exmat.state_hash(batch) == exmat.state_hash(other)
    batch.state = state
    batch.step(5)
    assert exmat.state_hash(batch) == exmat.state_hash(other)


def test_what_does_not_fit_is_refused(batch, model):
    points = exmat.Points(model, [0, 1])
    for call in (lambda: batch.set_reduced(np.zeros((5, 11)), np.zeros((5, 12))), lambda: batch.apply_forces(points, np.zeros((4, 2, 3))),
                 lambda: batch.set_example_stiffness([1, 2]), lambda: batch.set_example_weights(np.ones((5, 3)) / 3),
                 lambda: setattr(batch, "state", exmat.Batch(model, 4).state), lambda: exmat.Batch(model, 0), lambda: batch.displacements(np.empty((4, 12)))):
        with pytest.raises(exmat.InvalidArgument):
            call()


def test_obstacles_are_those_of_all(model, free_bundle):
    free = exmat.Model(free_bundle, time_step=0.002, gravity=(0, 0, -9.81), use_contact=True)
    batch, alone = exmat.Batch(free, 5), exmat.Body(free)
    law = dict(stiffness=1e6, damping=2e4, friction=0.5)
    below = exmat.Motion(position=(0, 0, -0.3))
    floor = batch.add_obstacle(exmat.Shape.plane((0, 0, 1)), motion=below, **law)
    assert alone.add_obstacle(exmat.Shape.plane((0, 0, 1)), motion=below, **law) == floor == 0
    batch[4].set_group(2, 0)
    assert batch[4].group == (2, 0) and batch[3].group == (1, 2**32 - 1)
    batch.step(300)
    alone.step(300)
    assert len(alone.contacts) > 0 and len(batch[0].contacts) == len(alone.contacts) and len(batch[4].contacts) == 0
    assert np.allclose(batch[0].q, alone.q, rtol=0, atol=1e-9 * np.linalg.norm(alone.q))
    assert batch[4].motion.position[2] < alone.motion.position[2] - 0.5, "it meets nobody"
    force, torque = batch.obstacle_load(floor)
    assert np.allclose(force, sum(body.contact_load(floor)[0] for body in batch)) and np.allclose(batch[4].contact_load(floor)[0], 0)
    with pytest.raises(exmat.InvalidArgument, match="the body is in a world"):
        batch[0].add_obstacle(exmat.Shape.plane((0, 0, 1)))
    other = pickle.loads(pickle.dumps(batch))
    for either in (batch, other):
        either.step(50)
    assert exmat.state_hash(other) == exmat.state_hash(batch) and other[4].group == (2, 0)
