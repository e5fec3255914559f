"""Bodies that frames of their host hold."""
import copy
import pickle

import numpy as np
import pytest

import exmat

MASS = 1000 * 4  # of the bar of conftest.py [kg]


@pytest.fixture(scope="module")
def hung(free_bundle):
    return exmat.Model(free_bundle, space="auto", time_step=0.004, mass_damping=4, stiffness_damping=0.02, gravity=(0, 0, -10))


def end_of(model):
    """Vertices of the bar's first end, and where they are."""
    everything = exmat.Points(model, np.arange(model.vertices))
    xyz = exmat.Body(model).positions(everything, np.empty((model.vertices, 3)))
    found = np.flatnonzero(xyz[:, 0] < xyz[:, 0].min() + 1e-6)
    return found, xyz[found]


def frame_at(position, degrees=0):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.column_stack([[[c, -s, 0], [s, c, 0], [0, 0, 1]], position])


@pytest.mark.parametrize("kind", ["fixed", "ball", "spring"])
def test_what_hangs_weighs_on_its_frames(hung, kind):
    vertices, xyz = end_of(hung)
    body = exmat.Body(hung)
    held = [body.attach(vertices, frame_at(xyz.mean(0)), kind=kind, stiffness=1e6, damping=1e4)]
    if kind != "fixed":  # which would swing
        everything = exmat.Points(hung, np.arange(hung.vertices))
        places = body.positions(everything, np.empty((hung.vertices, 3)))
        other = np.flatnonzero(places[:, 0] > places[:, 0].max() - 1e-6)
        held.append(body.attach(other, frame_at(places[other].mean(0)), kind=kind, stiffness=1e6, damping=1e4))
    body.step(4000)
    loads = [body.attachment_load(one) for one in held]
    force = sum(load[0] for load in loads)
    assert not any(load[2] for load in loads)
    assert abs(force[2] + 10 * MASS) < 3e-3 * 10 * MASS
    if kind == "fixed":
        assert loads[0][1][1] > 10 * MASS  # it sticks out by more than 1 m


def test_modes_alone_hold_what_hangs(free_bundle):
    model = exmat.Model(free_bundle, time_step=0.004, mass_damping=4, stiffness_damping=0.02, gravity=(0, 0, -10))
    vertices, xyz = end_of(model)
    body = exmat.Body(model)
    held = body.attach(vertices, frame_at(xyz.mean(0)))
    here = exmat.Points(model, vertices)
    for k in range(1, 400):
        position = xyz.mean(0) + [0, 0.01 * min(k, 50), 0]
        body.move_attachment(held, frame_at(position, min(k, 50)))
        body.step()
        assert np.abs(body.positions(here, np.empty((len(vertices), 3))).mean(0) - position).max() < 0.05
    body.step(12000)  # it swings slowly, with a period of 12 s
    assert body.space == "reduced"
    force, torque, broken = body.attachment_load(held)
    assert not broken and abs(force[2] + 10 * MASS) < 1e-3 * 10 * MASS
    assert np.linalg.norm(torque) > 10 * MASS  # it sticks out by more than 1 m
    body.detach(held)
    body.step()
    assert np.abs(body.motion.linear_velocity[2] + 0.04) < 1e-3


def test_modes_alone_refuse_what_they_cannot_hold(bundle, free_bundle):
    model = exmat.Model(bundle)
    vertices, _ = end_of(model)
    with pytest.raises(exmat.InvalidArgument, match="fixed"):
        exmat.Body(model).attach(vertices[:1], frame_at([0, 0, 0]))
    free = exmat.Body(exmat.Model(free_bundle))
    with pytest.raises(exmat.InvalidArgument, match="cannot hold"):
        for vertex in range(50):
            free.attach([vertex], frame_at([0, 0, 0]))


@pytest.mark.parametrize("joins_first", [False, True])
def test_what_another_body_lies_on_goes_with_its_frame(free_bundle, joins_first):
    """Both step in their modes, in one island."""
    model = exmat.Model(free_bundle, time_step=0.002, use_contact=True, gravity=(0, 0, -10), stiffness_damping=0.01)
    world = exmat.World(stiffness=1e6, damping=1e3)
    below, above = exmat.Body(model), exmat.Body(model)
    if joins_first:
        world.add(below)
    corner = exmat.Points(model, [0])
    start = below.positions(corner, np.empty((1, 3)))[0]
    held = below.attach([0], frame_at([0, 0, 0]), kind="ball")
    if not joins_first:
        world.add(below)
    xyz = below.positions(exmat.Points.all_vertices(model))
    above.motion = exmat.Motion(position=(0, 0, np.ptp(xyz[:, 2])))
    world.add(above)
    touched = 0
    for k in range(1, 60):
        below.move_attachment(held, frame_at([0, 0.004 * k, 0.002 * k]))
        world.step(1)
        touched += len(world.contacts) > 0
        now = below.positions(corner, np.empty((1, 3)))[0]
        assert np.abs(now - start - [0, 0.004 * k, 0.002 * k]).max() < 1e-10 * np.ptp(xyz)
        assert below.space == "reduced"
    assert touched > 5


def test_impulses_change_momenta(free_bundle):
    model = exmat.Model(free_bundle)
    vertices, xyz = end_of(model)
    body = exmat.Body(model)
    points = exmat.Points(model, vertices[:2])
    velocity, compliance = body.compliance(points)
    assert np.abs(velocity).max() == 0 and np.allclose(compliance, compliance.T)
    impulses = np.array([[0, 0, 100.0], [50, 0, 0]])
    body.apply_impulses(points, impulses)
    after, _ = body.compliance(points)
    assert np.abs(after.ravel() - compliance @ impulses.ravel()).max() < 1e-3 * np.abs(after).max()
    assert np.abs(np.array(body.motion.linear_velocity) * MASS - impulses.sum(0)).max() < 1e-9


def test_impulses_put_a_body_of_two_spaces_into_all_vertices(hung):
    vertices, _ = end_of(hung)
    body = exmat.Body(hung)
    points = exmat.Points(hung, vertices[:1])
    impulse = np.array([[0, 0, 2.0]])
    body.step(3)
    body.apply_impulses(points, impulse)
    assert body.space == "full"
    before, compliance = body.compliance(points)
    body.apply_impulses(points, impulse)
    after, _ = body.compliance(points)
    # The second reads the stiffness after the first has moved the body.
    assert np.abs(after - before - compliance @ impulse.ravel()).max() < 1e-2 * np.abs(after - before).max()
    body.step(400)
    assert body.space == "reduced"


def test_what_is_held_goes_with_its_frame_and_is_let_go(hung):
    vertices, xyz = end_of(hung)
    body = exmat.Body(hung)
    body.step(3)
    assert body.space == "reduced"
    here = body.positions(exmat.Points(hung, vertices), np.empty((len(vertices), 3)))
    held = body.attach(vertices, frame_at([0, 0, 0]))
    for k in range(1, 60):
        body.move_attachment(held, frame_at([0, 0.04 * k, 0], 2 * k))
        body.step()
        assert body.space == "full"
        now = body.positions(exmat.Points(hung, vertices), np.empty((len(vertices), 3)))
        turn = frame_at([0, 0, 0], 2 * k)[:, :3]
        assert np.abs(now - here @ turn.T - [0, 0.04 * k, 0]).max() < 1e-11
    body.detach(held)
    body.step(400)
    assert body.space == "reduced"


def test_what_cannot_be_is_refused(hung, bundle):
    vertices, _ = end_of(hung)
    body = exmat.Body(hung)
    frame = frame_at([0, 0, 0])
    body.attach(vertices[:4], frame)
    with pytest.raises(exmat.InvalidArgument, match="detach it first"):
        body.space = "reduced"
    for given, words in (([vertices[0]], "held already"), ([10**6], "no such vertex"), ([vertices[5]] * 2, "twice"), ([], "count")):
        with pytest.raises(exmat.InvalidArgument, match=words):
            body.attach(given, frame)
    with pytest.raises(exmat.InvalidArgument, match="kind"):
        body.attach(vertices[5:6], frame, kind="glue")
    with pytest.raises(exmat.InvalidArgument, match="stiffness"):
        body.attach(vertices[5:6], frame, kind="spring", stiffness=-1)
    with pytest.raises(exmat.InvalidArgument, match="no such attachment"):
        body.detach(7)
    with pytest.raises(exmat.InvalidArgument, match="frame"):
        body.move_attachment(0, frame * np.nan)
    clamped = exmat.Model(bundle, space="full")
    with pytest.raises(exmat.InvalidArgument, match="fixed"):
        exmat.Body(clamped).attach(end_of(clamped)[0][:1], frame)


def test_an_attachment_of_a_scene_goes_with_its_obstacle(free_bundle):
    scene = {"bundle": free_bundle, "time_step": 0.004, "space": "full", "obstacles": [{"sphere": {"radius": 0.1, "center": [0, 9, 0]}}],
             "attachments": [{"vertices": {"point": [0, 0, 0]}, "to": {"obstacle": 0}}]}
    model = exmat.Model.from_scene(scene)
    body = exmat.Body(model)
    points = exmat.Points(model, np.arange(model.vertices))
    start = body.positions(points, np.empty((model.vertices, 3)))
    held = np.linalg.norm(start, axis=1).argmin()
    for k in range(1, 20):
        body.move_obstacle(0, exmat.Motion(position=(0, 0.002 * k, 0)))
        body.step()
        now = body.positions(points, np.empty((model.vertices, 3)))
        assert np.abs(now[held] - start[held] - [0, 0.002 * k, 0]).max() < 1e-10
    assert np.abs(body.attachment_load(0)[0]).max() > 1
    body.move_attachment(0, frame_at([0, 0, 0]))
    body.step()
    assert np.abs(body.positions(points, np.empty((model.vertices, 3)))[held] - start[held]).max() < 1e-10
    body.detach(0)
    body.reset()
    body.step()
    assert np.abs(body.positions(points, np.empty((model.vertices, 3)))[held] - start[held] - [0, 0.002 * 19, 0]).max() < 1e-10
    with pytest.raises(exmat.BadInput, match="/attachments/0/vertices"):
        exmat.Model.from_scene({**scene, "attachments": [{"vertices": {"ids": [10**6]}}]})


def test_a_snapshot_brings_back_what_an_attachment_of_a_scene_follows(free_bundle):
    motion = [{"time": 0, "position": [0, 0, 0]}, {"time": 0.2, "position": [0, 0.1, 0]}]
    model = exmat.Model.from_scene({"bundle": free_bundle, "time_step": 0.004, "space": "full",
                                    "obstacles": [{"plane": {"point": [0, -9, 0], "normal": [0, 1, 0]}}],
                                    "attachments": [{"vertices": {"point": [0, 0, 0]}, "motion": motion}]})
    world, body = exmat.World(), exmat.Body(model)
    world.add(body)
    world.step(2)
    snapshot = world.save()
    world.step(5)
    after = world.state_hash
    for change in (lambda: body.move_attachment(0, frame_at([0, 0, 0])), lambda: body.detach(0)):
        world.restore(snapshot)
        change()
        world.step(5)
        assert world.state_hash != after
        world.restore(snapshot)
        world.step(5)
        assert world.state_hash == after


def test_bodies_are_tied_to_each_other(free_bundle):
    model = exmat.Model(free_bundle, time_step=0.004, gravity=(0, 0, -10), use_contact=True)
    world, bodies = exmat.World(), [exmat.Body(model), exmat.Body(model)]
    for body in bodies:
        world.add(body)
    vertices, _ = end_of(model)
    everything = exmat.Points(model, np.arange(model.vertices))
    xyz = exmat.Body(model).positions(everything, np.empty((model.vertices, 3)))
    other = np.flatnonzero(xyz[:, 0] > xyz[:, 0].max() - 1e-6)
    bodies[1].motion = exmat.Motion(position=bodies[1].motion.position + [xyz[:, 0].max() - xyz[:, 0].min(), 0, 0],
                                    linear_velocity=(0, 1, 0))
    tied = bodies[1].attach_to(vertices, bodies[0], other, kind="ball")
    for k in range(1, 40):
        before = np.array(bodies[1].motion.linear_velocity)
        world.step(1)
        rate = (np.array(bodies[1].motion.linear_velocity) - before) / 0.004
        force, _, broken = bodies[1].attachment_load(tied)
        assert np.abs(MASS * (rate - [0, 0, -10]) + force).max() < 1e-9 * MASS * 10 and not broken
    total = sum(np.array(body.motion.linear_velocity) for body in bodies)
    assert np.abs(total - [0, 1, -2 * 10 * 0.004 * 39]).max() < 1e-12
    with pytest.raises(exmat.InvalidArgument, match="no frame"):
        bodies[1].move_attachment(tied, frame_at([0, 0, 0]))
    with pytest.raises(exmat.InvalidArgument, match="another body"):
        bodies[1].attach_to(vertices, bodies[1], other)
    with pytest.raises(exmat.InvalidArgument, match="other_vertices"):
        bodies[1].attach_to(vertices, bodies[0], [10**6])
    bodies[1].detach(tied)
    world.step(1)
    world.remove(0)


def test_ties_that_rounding_would_move_are_refused(free_bundle):
    model = exmat.Model(free_bundle, time_step=0.004, use_contact=True)
    world, bodies = exmat.World(), [exmat.Body(model), exmat.Body(model)]
    for body in bodies:
        world.add(body)
    for given, words in (({"stiffness": 1e22}, "stiffness: 1e\\+22: expected <="), ({"damping": 1e22}, "damping: 1e\\+22: expected <=")):
        with pytest.raises(exmat.InvalidArgument, match=words):
            bodies[0].attach_to([0, 1, 2], bodies[1], [0, 1, 2], kind="spring", **given)
        with pytest.raises(exmat.InvalidArgument, match=words):
            bodies[0].attach([0, 1, 2], frame_at([0, 0, 0]), kind="spring", **given)
    with pytest.raises(exmat.InvalidArgument, match="to/vertices: 2 in a line: 0, 1"):
        bodies[0].attach_to(end_of(model)[0], bodies[1], [0, 1], kind="fixed")


def test_ties_of_full_space_are_refused(free_bundle):
    for spaces in (("full", "reduced"), ("reduced", "auto"), ("full", "full")):
        world = exmat.World()
        for space in spaces:
            world.add(exmat.Body(exmat.Model(free_bundle, time_step=0.004, use_contact=True, space=space)))
        for own, other in ((0, 1), (1, 0)):
            with pytest.raises(exmat.InvalidArgument, match="may step in all vertices: expected two bodies of space reduced"):
                world[own].attach_to([0, 1, 2], world[other], [0, 1, 2], kind="ball")
    world = exmat.World()
    for _ in range(2):
        body = exmat.Body(exmat.Model(free_bundle, time_step=0.004, use_contact=True, space="auto"))
        body.space = "reduced"
        world.add(body)
    tied = world[0].attach_to([0, 1, 2], world[1], [0, 1, 2], kind="ball")
    for body in world.bodies:  # the one that is held, and the one that holds
        with pytest.raises(exmat.InvalidArgument, match="detach it first"):
            body.space = "full"
    world[0].detach(tied)
    world[1].space = "full"


def test_frames_have_a_rotation(free_bundle):
    body = exmat.Body(exmat.Model(free_bundle))
    for turn, determinant in ((np.zeros((3, 3)), "0"), (np.diag([1, 1, -1]), "-1"), (np.diag([1, 1, 0]), "0")):
        with pytest.raises(exmat.InvalidArgument, match=f"frame 0: .* determinant {determinant}: expected a rotation"):
            body.attach([0, 1, 2], np.column_stack([turn, [0, 0, 0]]))


def test_bodies_that_touch_obstacles_alone_are_not_tied(free_bundle):
    body = exmat.Body(exmat.Model(free_bundle))
    with pytest.raises(exmat.InvalidArgument, match="same world"):
        body.attach_to([60], exmat.Body(exmat.Model(free_bundle)), [60])


def duplicates(thing):
    return [copy.copy(thing), copy.deepcopy(thing), pickle.loads(pickle.dumps(thing))]


def test_copies_of_a_body_are_held_as_it_is(hung):
    vertices, xyz = end_of(hung)
    body = exmat.Body(hung)
    held = body.attach(vertices, frame_at(xyz.mean(0)), kind="ball")
    body.step(20)
    for other in duplicates(body):
        twin = copy.copy(body)
        for moved in (other, twin):
            moved.move_attachment(held, frame_at(xyz.mean(0) + [0, 0, 0.01]))
            moved.step(30)
        assert exmat.state_hash([other]) == exmat.state_hash([twin]) != exmat.state_hash([body])
        for loads in zip(other.attachment_load(held), twin.attachment_load(held)):
            np.testing.assert_array_equal(*loads)
        other.detach(held)
    body.attachment_load(held)


def test_copies_of_a_world_have_its_ties(free_bundle):
    model = exmat.Model(free_bundle, time_step=0.004, use_contact=True, gravity=(0, 0, -10))
    world, bodies = exmat.World(), [exmat.Body(model), exmat.Body(model)]
    for body in bodies:
        world.add(body)
    vertices, xyz = end_of(model)
    world[0].attach(vertices, frame_at(xyz.mean(0)), kind="spring", stiffness=1e5)
    tie = world[1].attach_to(vertices, world[0], vertices, kind="ball", break_force=1e9)
    world.step(20)
    for other in duplicates(world):
        twin = copy.copy(world)
        other.step(30)
        twin.step(30)
        assert other.state_hash == twin.state_hash != world.state_hash
        assert other[1].attachment_load(tie)[0].any()
        other[1].detach(tie)
    world[1].attachment_load(tie)
    with pytest.raises(exmat.InvalidArgument):  # a copy of a body of a world is in none, and held by nothing
        copy.copy(world[1]).attachment_load(tie)


def test_a_reset_leaves_the_attachments_of_the_host(hung):
    vertices, xyz = end_of(hung)
    body = exmat.Body(hung)
    held = body.attach(vertices, frame_at(xyz.mean(0)))
    body.reset()
    with pytest.raises(exmat.InvalidArgument):
        body.attachment_load(held)
