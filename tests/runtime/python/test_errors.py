"""Exceptions, threads and memory."""
import fcntl
import gc
import os
import pickle
import re
import resource
import signal
import subprocess
import sys
import threading
import warnings

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


def test_no_message_names_a_function_of_c(bundle, model, body):
    plain, everywhere = exmat.Body(exmat.Model(bundle)), exmat.Points.all_vertices(model)
    of_space = exmat.Body(exmat.Model(bundle, space="auto"))
    for call, said in ((lambda: exmat.World().restore(b"x"), "buffer: expected a snapshot, as the world saves it"),
                       (lambda: body.apply_forces(everywhere, np.zeros((340, 3))), "make points of vertices by their ids, which can be pushed"),
                       (lambda: body.apply_impulses(everywhere, np.zeros((340, 3))), "make points of vertices by their ids, which can be pushed"),
                       (lambda: plain.target(), "the model has no example force: set use_examples"),
                       (lambda: plain.set_example_stiffness(3), "the model has no example force: set use_examples"),
                       (lambda: body.step(-1), "steps = -1"), (lambda: exmat.Batch(model, 0), "count"), (lambda: exmat.Points(model, [340]), "ids"),
                       (lambda: setattr(body, "space", "full"), "created for steps in the modes alone"), (lambda: of_space.set_gravity((1e31, 0, 0)), "1e+31"),
                       (lambda: body.set_reduced(np.zeros(3), np.zeros(3)), "expected"), (lambda: exmat.World().move_obstacle(7, exmat.Motion()), "7")):
        with pytest.raises(exmat.Error) as refused:
            call()
        assert said in str(refused.value)
        assert not re.search("exmat_|EXMAT_", str(refused.value)), refused.value


def test_a_body_of_no_finite_numbers_is_as_it_was(bundle):
    body = exmat.Body(exmat.Model(bundle, time_step=0.001, stiffness_damping=1e300))
    body.set_reduced(np.full(12, 1e30), np.full(12, 1e30))
    before = body.q.copy()
    with pytest.raises(exmat.NonFinite, match="NaN or infinity"):
        body.step()
    assert np.array_equal(body.q, before) and body.report.steps == 0
    held = exmat.Body(body.model)
    held.set_reduced(before, before)
    held.attach([held.model.vertices - 1], np.eye(3, 4), kind="spring", stiffness=1.0)
    with pytest.raises(exmat.NonFinite, match="softer attachments"):
        held.step()
    batch = exmat.Batch(body.model, 3)
    batch.set_reduced(*2 * [[[0] * 12, [1e30] * 12, [0] * 12]])
    with pytest.raises(exmat.NonFinite, match="body 1"):
        batch.step(4)
    assert batch.time == 0.001 and np.array_equal(batch.q[1], before)  # the step that the others have taken is the last


def test_settings_beyond_all_scales_are_refused(bundle):
    for name in ("time_step", "example_stiffness", "example_damping", "sleep_energy", "sleep_time", "space_release"):
        with pytest.raises(exmat.InvalidArgument, match=rf"settings\.{name} = 1e\+200: expected a finite number, of at most 1e\+30"):
            exmat.Model(bundle, **{name: 1e200})
    with pytest.raises(exmat.InvalidArgument, match=r"settings\.gravity\[1\] = -1e\+155: expected a finite number, of at most 1e\+30"):
        exmat.Model(bundle, gravity=(0, -1e155, 0))
    for damping in ("mass_damping", "stiffness_damping"):
        body = exmat.Body(exmat.Model(bundle, **{damping: 1e200}))
        body.step()
        assert np.isfinite(body.q).all() and np.isfinite(body.v).all()


def test_a_body_beyond_single_precision_is_said(free_bundle):
    """Positions in it were infinite after a step that was told as sound."""
    model = exmat.Model(free_bundle, time_step=1e5, gravity=(0, 1e30, 0))
    body = exmat.Body(model)
    with pytest.raises(exmat.NonFinite):
        body.step(2)
    assert np.isfinite(body.positions(exmat.Points(model, [0]))).all()


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
    lambda m: exmat.World().add_obstacle(exmat.Shape.sphere(1), motion=exmat.Motion.__new__(exmat.Motion)),
    lambda m: exmat.Body(exmat.Model.__new__(exmat.Model)), lambda m: exmat.World().add(exmat.Body.__new__(exmat.Body)),
    lambda m: exmat.state_hash([exmat.Body.__new__(exmat.Body)]), lambda m: exmat.ContactLaw.__new__(exmat.ContactLaw).stiffness,
    lambda m: exmat.Obstacle.__new__(exmat.Obstacle).half_extents, lambda m: exmat.Energies.__new__(exmat.Energies).total,
    lambda m: exmat.Report.__new__(exmat.Report).steps, lambda m: exmat.WorldReport.__new__(exmat.WorldReport).steps])
def test_none_and_objects_that_nobody_made_are_type_errors(model, call):
    with pytest.raises(TypeError):
        call(model)


def test_points_beyond_all_bodies_are_refused(model):
    for far in (1e155, 1e300):
        with pytest.raises(exmat.InvalidArgument, match=r"^xyz\[0\] = 1e\+[0-9]+: expected finite numbers of at most 1e\+30 m$"):  # no function of C
            exmat.Points.at(model, [[far, 0, 0]])


@pytest.mark.parametrize("ids, found", [(np.array([2**63], "u8"), r"below 2\^63"), ([0.5], "whole numbers"), ([2**64], "whole numbers"), ([True], "whole"),
                                        (["1"], "whole numbers"), ([2**32], r"ids\[0\] = 4294967296: expected vertices"), (None, "whole numbers")])
def test_indices_that_do_not_fit_are_refused(model, ids, found):
    with pytest.raises(exmat.InvalidArgument, match=found):
        exmat.Points(model, ids)


def test_indices_of_meshes_do_not_wrap():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    for tets, message in ((np.array([[0, 1, 2, 3 + 2**32]]), r"tets\[0, 3\] = 4294967299: expected a vertex, 0 to 3"),
                          (np.array([[0, 1, 2, 2**64 - 1]], "u8"), r"tets\[0, 3\] = 18446744073709551615: expected a vertex"),
                          ([[0, 1, 2, -1]], r"tets\[0, 3\] = -1: expected a vertex"), ([[0, 1, 2, None]], "tets: expected whole numbers"),
                          (np.zeros((0, 4), int), "tets: expected at least one")):
        with pytest.raises(exmat.InvalidArgument, match=message):
            exmat.precompute.check({"name": "tet", "object": {"mesh": (corners, tets)}})
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    exmat.Shape.mesh(corners, faces.astype("u8"))
    for triangles, message in ((faces + 2**32, "expected"), (faces.astype("u8") + 2**63, r"below 2\^63"), (faces * 1.0, "whole numbers")):
        with pytest.raises(exmat.InvalidArgument, match=message):
            exmat.Shape.mesh(corners, triangles)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_every_protocol_of_pickle_keeps_a_body(body, protocol):
    body.step(3)
    assert exmat.state_hash([pickle.loads(pickle.dumps(body, protocol))]) == exmat.state_hash([body])
    with pytest.raises(TypeError, match="cannot pickle 'Points' object"):
        pickle.dumps(exmat.Points(body.model, [0]), protocol)


@pytest.mark.parametrize("settings, message", [
    ({"gravity": 9.81}, r"gravity = 9.81: expected three numbers \[m/s\^2\]"), ({"gravity": (1, 2)}, r"gravity = \(1, 2\): expected three numbers"),
    ({"time_step": "1e-3"}, "time_step = '1e-3': expected a number"), ({"newton_iterations": 2.5}, "newton_iterations = 2.5: expected a whole number"),
    ({"newton_iterations": 2**40}, "newton_iterations = 1099511627776: expected a whole number"), ({"integrator": 3}, "integrator = 3: expected one of bdf2"),
    ({"use_examples": "no"}, "use_examples = 'no': expected True or False"), ({"use_contact": 2}, "use_contact = 2: expected True or False")])
def test_settings_of_another_type_are_named(model, settings, message):
    with pytest.raises(exmat.InvalidArgument, match=message):
        exmat.Model(model._recipe[1], **settings)


def test_vectors_of_another_length_are_named(body):
    for call in (lambda: body.set_gravity(9.81), lambda: exmat.Motion(position=9.81), lambda: exmat.Shape.sphere(1, center=9.81)):
        with pytest.raises(TypeError, match="expected 3 numbers, found 9.81"):
            call()
    with pytest.raises(TypeError, match=r"expected 4 numbers, found \(1, 0, 0\)"):
        exmat.Motion(orientation=(1, 0, 0))


def test_members_that_are_none_are_refused_in_words(model, tmp_path):
    for members in ({"object": None}, {"object": {"mesh": "a.msh"}, "examples": None}, {"object": {"mesh": "a.msh"}, "examples": ["a"]}):
        with pytest.raises(exmat.BadInput, match="expected"):
            exmat.precompute.check({"name": "x", **members})
    with pytest.raises(exmat.InvalidArgument, match="not JSON serializable"):
        exmat.precompute.check({"name": "x", "object": {"mesh": "a.msh", "material": {1, 2}}})
    with pytest.raises(exmat.InvalidArgument, match="count: expected 1 to 1000000"):
        exmat.Batch(model, 2**62)


def test_numbers_whose_results_would_not_be_finite_are_refused(model):
    body = exmat.Body(model)
    far = np.full(model.modes, 1e154)
    corner = exmat.Points(model, [0])
    for call in (lambda: body.set_reduced(far, 0 * far), lambda: body.set_reduced(0 * far, far), lambda: model.elasticity(far),
                 lambda: body.set_gravity((1e154, 0, 0))):
        with pytest.raises(exmat.InvalidArgument, match=r"1e\+154: expected finite (numbers|ones) of at most 1e\+30"):
            call()
    body.set_reduced(0 * far + 1e30, 0 * far)
    assert np.isfinite(body.positions(corner)).all() and np.isfinite(model.elasticity(0 * far + 1e30)[0])


def test_forces_as_large_as_they_may_be_end_in_places_or_in_words(bundle):
    for space in ("reduced", "full", "auto"):
        model = exmat.Model(bundle, space=space)
        body, points = exmat.Body(model), exmat.Points.all_vertices(model)
        point = exmat.Points(model, [300])
        for call in (lambda: body.apply_forces(point, np.array([[0, 1e154, 0]])), lambda: body.set_damping(1e154, 0),
                     lambda: body.set_damping(0, 1e154)):
            with pytest.raises(exmat.InvalidArgument, match=r"1e\+154: expected (finite numbers|a number >= 0,) of at most 1e\+30"):
                call()
        body.apply_forces(point, np.array([[1e30, 0, -1e30]]))
        try:
            body.step(3)
        except exmat.NonFinite:
            pass
        assert np.isfinite(body.positions(points)).all(), space


def test_a_path_with_a_zero_byte_is_refused(bundle):
    for path in (str(bundle) + "\0junk", "a\0b"):
        with pytest.raises(exmat.InvalidArgument, match="expected text, found a zero byte$"):
            exmat.Model(path)


def test_motion_of_absurd_speed_is_refused(free_bundle):
    body = exmat.Body(exmat.Model(free_bundle))
    for motion in (exmat.Motion(linear_velocity=(1e306, 0, 0)), exmat.Motion(position=(0, 1e31, 0)), exmat.Motion(angular_velocity=(0, 0, -1e300))):
        with pytest.raises(exmat.InvalidArgument, match=r"motion: -?1e\+[0-9]+: expected finite numbers of at most 1e\+30"):
            body.motion = motion


def test_obstacles_beyond_all_scales_are_refused():
    world = exmat.World()
    for shape, message in ((exmat.Shape.sphere(1e31), r"obstacle.radius = 1e\+31: expected a number above 0, of at most 1e\+30"),
                           (exmat.Shape.sphere(1, center=(0, 1e154, 0)), r"obstacle.point = 1e\+154: expected finite numbers of at most 1e\+30"),
                           (exmat.Shape.box((1, 1, np.inf)), "obstacle.half_extents = inf")):
        with pytest.raises(exmat.InvalidArgument, match=message):
            world.add_obstacle(shape)
    ball = world.add_obstacle(exmat.Shape.sphere(1e30))
    with pytest.raises(exmat.InvalidArgument, match=r"motion.linear_velocity = 1e\+306"):
        world.move_obstacle(ball, exmat.Motion(linear_velocity=(1e306, 0, 0)))


def test_contacts_stiffer_than_steel_are_refused():
    ball, stiffer = exmat.Shape.sphere(1), r"stiffness = 1e\+16: expected a number above 0, of at most 1e\+15; steel that is 1 mm thick has 2e14 N/m\^3"
    world = exmat.World(stiffness=1e15)
    obstacle = world.add_obstacle(ball, stiffness=1e15)
    for call in (lambda: exmat.World(stiffness=1e16), lambda: world.add_obstacle(ball, stiffness=1e16),
                 lambda: world.set_obstacle_law(obstacle, stiffness=1e16)):
        with pytest.raises(exmat.InvalidArgument, match=stiffer):
            call()


def test_a_child_of_fork_steps_on(model):
    batch = exmat.Batch(model, 20)
    batch.step(2, threads=2)
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # a child that waits for threads which it does not have
        batch.step(2, threads=2)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    batch.step(2, threads=2)


def test_complex_numbers_are_refused(model, body):
    points = exmat.Points(model, [0])
    imaginary = np.full((1, 3), 1j)
    for call in (lambda: body.apply_forces(points, imaginary), lambda: exmat.Points.at(model, imaginary), lambda: body.set_reduced(np.full(12, 1j), np.zeros(12)),
                 lambda: exmat.Shape.height_field(np.full((2, 2), 1j), (1, 1)), lambda: body.set_example_weights(np.array([1j, 1])),
                 lambda: body.set_example_weights([np.complex128(1j), 1]), lambda: body.set_reduced(["1"] * 12, np.zeros(12)), lambda: body.set_reduced(np.full(12, "1"), np.zeros(12))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(TypeError, match="expected .*numpy.float64"):
                call()
    with pytest.raises(exmat.InvalidArgument, match="pose bend: expected real numbers"):
        exmat.precompute.write_glb("none.glb", np.eye(3), [[0, 1, 2]], {"bend": np.eye(3) * 1j})


def test_corners_of_obstacles_are_named_as_they_were_given():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    for corner in (-1, -5, 3, 2**32 + 2, 2**62):
        with pytest.raises(exmat.InvalidArgument, match=rf"triangles\[2\] = {corner}: expected a vertex, 0 to 2"):
            exmat.Shape.mesh(corners, np.array([[0, 1, corner]]), 0.1)


def test_flags_are_true_or_false(model):
    for call in (lambda: exmat.World(self_contact=2), lambda: exmat.World(self_contact="no"), lambda: exmat.Model.from_scene({}, use_contact=2)):
        with pytest.raises(exmat.InvalidArgument, match="_contact = .*: expected True or False"):
            call()
    assert exmat.World(self_contact=np.bool_(True)).contact_law.self_contact


def test_numbers_that_are_not_finite_are_named_by_their_member(bundle):
    for members, place in (({"gravity": [0, 0, np.nan]}, "/gravity/2"), ({"gravity": np.array([0, np.inf, 0])}, "/gravity/1"),
                           ({"time": {"step": np.float32("nan")}}, "/time/step")):
        for call in (exmat.Model.from_scene, exmat.World.from_scene):
            with pytest.raises(exmat.InvalidArgument, match=f"^{place}: expected a finite number, found (nan|inf)$"):
                call({"bundle": bundle, **members})
    with pytest.raises(exmat.InvalidArgument, match="^/object/material/density: expected a finite number, found -inf$"):
        exmat.precompute.check({"name": "x", "object": {"mesh": "a.msh", "material": {"density": -np.inf}}})


def test_a_pose_of_other_vertices_is_named():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    for pose, found in ((corners[:3], 3), (np.vstack([corners, [[9, 9, 9]]]), 5)):
        asset = {"name": "tet", "object": {"mesh": (corners, [[0, 1, 2, 3]])}, "examples": [{"name": "bend", "mesh": pose}]}
        with pytest.raises(exmat.InvalidArgument, match=rf"^examples\[0\].mesh: expected 4 vertices, as the mesh has that it is a pose of, found {found}$"):
            exmat.precompute.check(asset)


def test_members_that_hold_themselves_are_refused(tmp_path):
    endless = {"name": "x"}
    endless["object"] = endless
    deep = []
    for _ in range(5000):
        deep = [deep]
    for members in (endless, {"name": deep}):
        with pytest.raises(exmat.InvalidArgument, match="nested hundreds deep"):
            exmat.precompute.check(members)
        with pytest.raises(exmat.InvalidArgument, match="nested hundreds deep"):
            exmat.Model.from_scene(members)


def test_other_programs_are_failures(tmp_path):
    asset = tmp_path / "asset.json"
    for program in ("/bin/true", "/nowhere/program", "/tmp", ""):
        for call in (lambda: exmat.precompute.check(asset, program=program), lambda: exmat.precompute.bundle(asset, tmp_path / "a.h5", program=program),
                     lambda: exmat.precompute.study(asset, tmp_path / "s", program=program)):
            with pytest.raises(exmat.Failure, match="expected the program exmat-precompute"):
                call()
    for program in (5, "a\0b"):
        with pytest.raises(exmat.InvalidArgument, match="program = "):
            exmat.precompute.check(asset, program=program)


def test_files_that_are_no_bundles_are_said_in_words(tmp_path, bundle):
    text = tmp_path / "text.h5"
    text.write_text("x" * 100)
    for path, found in ((tmp_path / "none.h5", "no such file"), (tmp_path, "a folder"), ("/dev/null", "a pipe or a device"), (text, "another kind of file")):
        with pytest.raises(exmat.BadInput, match=f"expected an HDF5 file of exmat, found {found}"):
            exmat.Bundle(path)
    with open(bundle, "rb+") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        child = subprocess.run([sys.executable, "-c", "import exmat, sys; exmat.Bundle(sys.argv[1])", bundle], capture_output=True, text=True)
    assert "has locked; close it there, or read a copy" in child.stderr.splitlines()[-1]
