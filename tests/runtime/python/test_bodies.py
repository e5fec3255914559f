"""Models, points and bodies against the program and against their own arrays."""
import copy
import gc
import pickle

import numpy as np
import pytest

import exmat

FALLING = {"time_step": 0.002, "gravity": [0, 0, -9.81], "body": {"linear_velocity": [0.2, 0, -1], "angular_velocity": [1, 2, 3]},
           "obstacles": [{"plane": {"point": [0, 0, -0.05], "normal": [0, 0, 1]}, "stiffness": 1e6, "friction": 0.4}]}


def hash_of(bodies):
    return f"{exmat.state_hash(bodies):016x}"


def test_state_hash_is_that_of_the_program(bundle, runtime, scene_file):
    scene = scene_file(bundle=bundle, steps=200, gravity=[0, 0, -1], damping={"mass": 0.2, "stiffness": 0.01}, instances=3,
                       examples={"stiffness": 4000, "damping": 10, "bias": 0.2})
    world = exmat.Batch(exmat.Model.from_scene(scene), 3)
    world.step(200)
    assert hash_of(world) == runtime("run", scene)["state hash"].strip()
    settings = exmat.Model(bundle, gravity=(0, 0, -1), mass_damping=0.2, stiffness_damping=0.01, example_stiffness=4000, example_damping=10,
                           example_bias=0.2)
    bodies = [exmat.Body(settings) for _ in range(3)]
    for body in bodies:
        body.step(200)
    assert hash_of(bodies) == hash_of(world)


def test_free_bodies_with_obstacles_are_those_of_the_program(free_bundle, runtime, scene_file):
    scene = scene_file(bundle=free_bundle, steps=300, **FALLING)
    body = exmat.Body(exmat.Model.from_scene({"bundle": free_bundle, **FALLING}))
    assert body.step(300).steps == 300
    assert hash_of([body]) == runtime("run", scene)["state hash"].strip()
    assert body.state.numbers.size == exmat.Body(body.model).state.numbers.size + 6 * int(body.state.numbers[4])


def test_a_model_says_its_sizes(model):
    assert (model.modes, model.vertices, model.examples, model.regions, model.time_step) == (12, 340, 2, {}, 0.001)
    assert len(model.input_sha256) == 64
    assert "bar.h5: 12 modes, 340 vertices, 2 examples" in repr(model)


@pytest.mark.parametrize("setting, other", [("integrator", "newmark"), ("example_target", "solve"), ("energy_reference", "rest"), ("time_step", 0.002),
                                            ("gravity", (0, 1, 0)), ("mass_damping", 3.0), ("stiffness_damping", 0.01), ("newton_tolerance", 1e-2)])
def test_each_setting_counts(bundle, setting, other):
    def end(**settings):
        body = exmat.Body(exmat.Model(bundle, **{"gravity": (0, 0, -9.81), "example_stiffness": 4000, "example_bias": 0.2, **settings}))
        body.step(20)
        return body.q.copy()

    assert not np.array_equal(end(), end(**{setting: other}))


def test_report_and_energies(body):
    report = body.step(5)
    assert report.steps == 5 and report.newton_iterations >= 5 and report.seconds > 0 and body.report.residual == report.residual
    energies = body.energies
    assert energies.kinetic == pytest.approx(0.5 * body.v @ body.v, rel=1e-12)  # the modes are orthonormal by mass
    assert energies.total == energies.kinetic + energies.elastic + energies.potential
    assert body.time == pytest.approx(0.005) and "steps=5" in repr(report) and "kinetic" in repr(energies)


def test_positions_are_rest_and_basis_times_q(bundle, body):
    body.step(50)
    points = exmat.Points.all_vertices(body.model)
    found = body.positions(points)
    with exmat.Bundle(bundle) as data:
        expected = data["object/vertices"][:] + np.asarray(data["modal/basis"]) @ body.q
    assert found.dtype == np.float32 and found.shape == (340, 3)
    assert abs(found - expected).max() < 5e-7  # two roundings of coordinates up to 4 m
    some = exmat.Points(body.model, [3, 0, 3])
    assert np.array_equal(body.positions(some), found[[3, 0, 3]]) and len(some) == 3
    at = exmat.Points.at(body.model, expected[:2] * 0 + [[0.5, 0.5, 0.5], [0.5, 0.5, 2.0]])
    assert at.distances[0] == 0 and at.distances[1] > 0.5


def test_out_is_filled_and_refused_where_it_does_not_fit(body):
    points = exmat.Points(body.model, [1, 2])
    out = np.empty((2, 3), np.float32)
    assert body.positions(points, out) is out and body.positions(points, out=out) is out
    for bad in (np.empty((2, 3), int), np.empty((2, 2)), np.empty((3, 2), np.float32), np.empty((2, 6), np.float32)[:, ::2], np.asfortranarray(out)):
        with pytest.raises(exmat.InvalidArgument, match="out: "):
            body.positions(points, bad)
    out.flags.writeable = False
    with pytest.raises(exmat.InvalidArgument, match="can be written"):
        body.positions(points, out)


def test_arrays_are_views_that_change_with_the_body_and_outlive_its_name(model):
    body = exmat.Body(model)
    q, v, weights = body.q, body.v, body.weights
    kept = q.copy()
    body.step(30)
    assert np.array_equal(q, body.q) and not np.array_equal(q, kept) and weights.sum() == pytest.approx(1)
    assert q.__array_interface__["data"] == body.q.__array_interface__["data"]
    for array in (q, v, weights):
        with pytest.raises(ValueError):
            array[0] = 1
    expected = q.copy()
    del body
    gc.collect()
    [exmat.Body(model) for _ in range(100)]
    assert np.array_equal(q, expected)


def test_forces_push(body):
    points = exmat.Points(body.model, [339, 300])
    still = copy.copy(body)
    body.apply_forces(points, [[0, 0, 500], [0, 0, 500]])
    for either in (body, still):
        either.step(40)
    pushed = (body.positions(points) - still.positions(points))[:, 2]
    assert (pushed > 1e-4).all()
    body.clear_forces()
    body.restart_integrator()
    body.reset()
    assert body.time == 0 and np.array_equal(body.q, exmat.Body(body.model).q)


def test_forces_with_an_id_are_changed_and_removed_without_a_trace(body):
    points = exmat.Points(body.model, [339, 300])
    body.apply_forces(points, [[0.1, 0, 0.7], [0, 0.3, 0]])
    never, given = copy.copy(body), copy.copy(body)
    removed = body.add_forces(points, [[3e5, 0, 1e5], [0, 7e4, 0]])
    changed = body.add_forces(points, np.zeros((2, 3)))
    body.set_forces(changed, points, [[0, 5, 0], [0, 0, 5]])
    body.remove_forces(removed)
    given.apply_forces(points, [[0, 5, 0], [0, 0, 5]])
    assert body.state == given.state
    body.remove_forces(changed)
    assert body.state == never.state
    with pytest.raises(exmat.InvalidArgument, match=r"^id = 1: expected that of forces that act on the body$"):
        body.remove_forces(changed)
    for call in (body.add_forces, lambda *given: body.set_forces(0, *given)):
        with pytest.raises(exmat.InvalidArgument, match=r"forces: .*\(2, 3\)"):
            call(points, [[1, 2, 3]])


def test_free_motion_is_set_and_read(free_bundle):
    body = exmat.Body(exmat.Model(free_bundle))
    body.motion = exmat.Motion(position=(1, 2, 3), orientation=(2, 0, 0, 0), linear_velocity=(0.5, 0, 0))
    assert body.motion.orientation.tolist() == [1, 0, 0, 0] and body.motion.linear_velocity.tolist() == [0.5, 0, 0]
    body.step(100)
    assert body.motion.position == pytest.approx([1.05, 2, 3], abs=1e-9)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda body: pickle.loads(pickle.dumps(body))])
def test_a_copied_body_goes_on_to_the_last_bit(body, duplicate):
    body.set_example_stiffness(1234)
    body.set_example_weights([0.25, 0.75])
    body.step(33)
    other = duplicate(body)
    assert other.state == body.state and other.time == body.time
    body.step(33)
    other.step(33)
    assert hash_of([other]) == hash_of([body]) and other.weights.tolist() == [0.25, 0.75]


def test_states_are_set_kept_and_refused(body, bundle, free_bundle):
    body.step(10)
    state = pickle.loads(pickle.dumps(body.state))
    assert state == body.state and state == copy.deepcopy(state)
    body.step(10)
    after = hash_of([body])
    body.state = state
    body.step(10)
    assert hash_of([body]) == after and state != body.state
    with pytest.raises(exmat.InvalidArgument, match="another bundle"):
        exmat.Body(exmat.Model(free_bundle)).state = state
    with pytest.raises(exmat.InvalidArgument, match="time step"):
        exmat.Body(exmat.Model(bundle, time_step=0.01, example_stiffness=1)).state = state
    with pytest.raises(TypeError):
        hash(state)


def test_a_pickled_model_wants_the_same_bundle(model, bundle, free_bundle, tmp_path):
    moved = tmp_path / "bar.h5"
    moved.write_bytes(bundle.read_bytes())
    for kept in (pickle.dumps(exmat.Model(moved)), pickle.dumps(exmat.Model.from_scene({"bundle": moved}))):
        moved.write_bytes(bundle.read_bytes())
        assert pickle.loads(kept).input_sha256 == model.input_sha256
        moved.write_bytes(free_bundle.read_bytes())
        with pytest.raises(exmat.BadInput, match="that was pickled"):
            pickle.loads(kept)
    assert copy.deepcopy(model) is model


def test_settings_of_a_body_are_those_of_a_model(bundle):
    settings = dict(gravity=(0, 0.5, -2), example_stiffness=3000, example_damping=7, example_bias=0.3)
    expected = exmat.Body(exmat.Model(bundle, **settings))
    expected.step(30)
    model = exmat.Model(bundle, example_stiffness=10)
    body = exmat.Body(model)
    body.set_gravity(settings["gravity"])
    body.set_example_stiffness(3000)
    body.set_example_damping(7)
    body.set_example_bias(0.3)
    body.reset()
    twin, kept = copy.copy(body), pickle.loads(pickle.dumps(body))
    for each in (body, twin, kept):
        each.step(30)
        assert hash_of([each]) == hash_of([expected])
    with pytest.raises(exmat.InvalidArgument, match="bias = 2: expected a number of 0 to 1"):
        body.set_example_bias(2)
    with pytest.raises(exmat.InvalidArgument, match="c_kappa = -1"):
        body.set_example_damping(-1)
    for call in (body.set_example_stiffness, body.set_example_damping):
        with pytest.raises(exmat.InvalidArgument, match=r"kappa = 1e\+31: expected a number >= 0, of at most 1e\+30"):
            call(1e31)


def test_given_weights_and_stiffness_are_of_the_body_alone(bundle):
    def end(kappa, model):
        body = exmat.Body(model)
        if kappa is not None:
            body.set_example_stiffness(kappa)
        body.step(30)
        return hash_of([body])

    soft, stiff = (exmat.Model(bundle, gravity=(0, 0, -1), example_stiffness=kappa, example_bias=0.2) for kappa in (10, 4000))
    assert end(4000, soft) == end(None, stiff) != end(None, soft)
    body = exmat.Body(soft)
    body.set_example_weights([0, 1])
    body.step()
    assert body.weights.tolist() == [0, 1]
    body.set_example_weights(None)
    body.step()
    assert body.weights[0] > 0


def test_examples_pull_points_to_places(bundle):
    model = exmat.Model(bundle, mass_damping=8, example_stiffness=4000)
    there, body = exmat.Body(model), exmat.Body(model)
    there.set_example_weights([0.4, 0.6])
    there.step(2000)
    every = exmat.Points(model, range(model.vertices))
    moved = np.linalg.norm(there.positions(every, np.empty((model.vertices, 3))) - every.rest, axis=1)
    points = exmat.Points(model, [int(np.argmax(moved))])
    target = there.positions(points, np.empty((1, 3)))
    body.reach(points, target, change=0.01, highest=[1, 0.9])
    body.step(1)
    assert body.weights[1] == pytest.approx(0.01)
    body.step(2000)
    assert body.weights[1] == pytest.approx(0.6, abs=0.01)
    assert np.linalg.norm(body.positions(points, np.empty((1, 3))) - target) < 0.01
    sensitivity = body.sensitivity(points)
    assert sensitivity.shape == (1, 3, 2) and np.all(sensitivity[..., 0] == 0) and np.abs(sensitivity).max() > 0
    body.reach()
    body.step(10)
    assert body.weights[1] == pytest.approx(0.6, abs=0.01), "they stay as they were"
    with pytest.raises(exmat.InvalidArgument, match=r"reach.highest\[0\] = 3"):
        body.reach(points, target, highest=[3, 1])
    with pytest.raises(exmat.InvalidArgument, match="expected both"):
        body.reach(points)


def test_a_scene_reaches_as_a_host_does(bundle):
    members = {"bundle": str(bundle), "time_step": 0.004, "examples": {"stiffness": 4000}}
    host, there = exmat.Body(exmat.Model.from_scene(members)), exmat.Body(exmat.Model.from_scene(members))
    far = int(np.argmax(exmat.Points(host.model, range(host.model.vertices)).rest[:, 0]))
    there.set_example_weights([0.2, 0.8])
    there.step(500)
    rest, twisted = exmat.Points(host.model, [far]).rest[0], there.positions(exmat.Points(there.model, [far]), np.empty((1, 3)))[0]
    keys = [{"time": 0, "value": rest.tolist()}, {"time": 0.1, "value": twisted.tolist()}]
    reach = {"targets": [{"vertices": {"ids": [far]}, "position": {"keys": keys}}], "change": 0.02}
    scene = exmat.Body(exmat.Model.from_scene({**members, "reach": reach}))
    for step in range(40):
        place = rest + min(1, (step + 1) * 0.004 / 0.1) * (twisted - rest)
        host.reach(exmat.Points(host.model, [far]), [place], change=0.02)
        host.step()
        scene.step()
    assert scene.weights == pytest.approx(host.weights, abs=1e-9) and 0 < scene.weights[1]
    world = exmat.World.from_scene({**members, "reach": reach})
    scene = list(world.bodies)[0]
    points = exmat.Points(scene.model, [far])
    world.step(10)
    snapshot = world.save()
    world.step(30)
    after = world.state_hash
    for change in (lambda: scene.reach(points, [[0, 0, 0]]), scene.reach):
        world.restore(snapshot)
        change()
        world.restore(snapshot)
        world.step(30)
        assert world.state_hash == after
    with pytest.raises(exmat.BadInput, match="/reach/lowest: expected 2 numbers"):
        exmat.Model.from_scene({**members, "reach": {**reach, "lowest": [0, 0, 0]}})
