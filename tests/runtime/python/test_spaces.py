"""Bodies that step in all vertices of their mesh while something acts that no basis was made for."""
import copy
import pickle

import numpy as np
import pytest

import exmat

SETTINGS = dict(time_step=0.004, stiffness_damping=0.005, example_stiffness=400, example_bias=0.2)


@pytest.fixture
def touched(bundle):
    return exmat.Model(bundle, space="auto", **SETTINGS)


def pulled(model, steps):
    body = exmat.Body(model)
    body.apply_forces(exmat.Points.at(model, [[4, 1, 1]]), [[0, 3000, 2000]])
    body.step(steps)
    return body


def test_a_hand_takes_a_body_into_all_vertices_and_it_comes_back(touched):
    body = exmat.Body(touched)
    body.step(5)
    assert body.space == "reduced"
    point = exmat.Points.at(touched, [[4, 1, 1]])
    body.apply_forces(point, [[0, 3000, 2000]])
    body.step(25)
    assert body.space == "full"
    energy = body.energies.total
    body.clear_forces()
    body.step(100)
    assert body.space == "full"
    body.step(50)
    assert body.space == "reduced"
    assert 0 < body.energies.total < energy


def test_positions_and_energies_are_those_of_the_vertices(touched):
    body = pulled(touched, 60)
    everywhere = exmat.Points.all_vertices(touched)
    surface = exmat.Surface(touched)
    xyz, drawn = body.positions(everywhere), body.positions(surface)
    assert np.array_equal(drawn, xyz[surface.vertices])
    # The modes nearest to the body are not where it is: a point load is finer than they are.
    rest = exmat.Body(touched)
    rest.set_reduced(body.q, np.zeros_like(body.q))
    assert np.abs(rest.positions(everywhere) - xyz).max() > 0.01
    assert body.energies.elastic > 0 and np.isfinite(body.energy_density(surface)).all()


def test_states_and_copies_go_on_to_the_last_bit(touched):
    body = pulled(touched, 20)
    twin, other = copy.deepcopy(body), pickle.loads(pickle.dumps(body))
    for one in (body, twin, other):
        one.step(30)
        assert one.space == "full"
    assert exmat.state_hash([body]) == exmat.state_hash([twin]) == exmat.state_hash([other])


def test_space_is_a_setting_of_a_body(touched, bundle):
    body = exmat.Body(touched)
    body.space = "full"
    body.step(1)
    assert body.space == "full"
    body.space = "reduced"
    body.step(1)
    assert body.space == "reduced"
    with pytest.raises(exmat.InvalidArgument, match="space"):
        body.space = "all"
    with pytest.raises(exmat.InvalidArgument, match="created for steps in the modes alone"):
        exmat.Body(exmat.Model(bundle)).space = "auto"
    with pytest.raises(exmat.InvalidArgument, match="space_release"):
        exmat.Model(bundle, space="auto", space_release=0)


def test_one_touched_body_of_a_world_is_in_all_vertices(bundle):
    touched = exmat.Model(bundle, space="auto", use_contact=True, **SETTINGS)
    world = exmat.World()
    ids = [world.add(exmat.Body(touched)) for _ in range(12)]
    for i in ids:
        world[i].set_group(1, 0)  # they stand in the same place
    point = exmat.Points.at(touched, [[4, 1, 1]])
    world[ids[3]].apply_forces(point, [[0, 3000, 2000]])
    world.step(20)
    assert [world[i].space for i in ids] == ["full" if i == ids[3] else "reduced" for i in ids]
    alone = exmat.Body(touched)
    alone.apply_forces(point, [[0, 3000, 2000]])
    alone.step(20)
    assert exmat.state_hash([alone]) == exmat.state_hash([world[ids[3]]])
