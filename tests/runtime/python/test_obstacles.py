"""Obstacles of a body: given, moved, read, removed, and kept with a copy."""
import copy
import pickle

import numpy as np
import pytest

import exmat

GRAVITY = np.array([0, 0, -9.81])
LAW = dict(stiffness=1e6, damping=2e4, friction=0.5)
CORNERS = np.array([[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (-2, -1)], float)  # of a box below z = -1
# Each face of it, looking outward.
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])


@pytest.fixture(scope="module")
def model(free_bundle):
    return exmat.Model(free_bundle, gravity=GRAVITY, time_step=0.002, mass_damping=1, use_contact=True)


@pytest.fixture(scope="module")
def mass(free_bundle):
    with exmat.Bundle(free_bundle) as data:
        vertices, tets = data["object/vertices"][:], data["object/tets"][:]
        first = vertices[tets[:, 0]]
        volumes = np.linalg.det(np.stack([vertices[tets[:, k]] - first for k in (1, 2, 3)], 1)) / 6
        return 1000 * volumes.sum()


def velocity(body):
    return body.motion.linear_velocity


def test_loads_are_what_changes_the_momentum(model, mass):
    body = exmat.Body(model)
    body.motion = exmat.Motion(position=(0, 0, -0.9), linear_velocity=(0.5, 0, -1))
    floor = body.add_obstacle(exmat.Shape.plane((0, 0, 2), point=(0, 0, -1)), **LAW)
    touched = 0
    for _ in range(100):
        before = velocity(body)
        body.step()
        force, torque = body.contact_load()
        # Backward Euler near obstacles, with mass damping of the deformation alone: m (v - v_0) = dt (f + m g).
        assert np.allclose(mass * (velocity(body) - before) / 0.002, force + mass * GRAVITY, rtol=0, atol=1e-6 * mass * 9.81)
        assert np.allclose(body.contact_load(floor)[0], -force) and torque.shape == (3,)
        contacts = body.contacts
        touched = max(touched, len(contacts))
        if len(contacts):
            assert contacts["force"].shape == (len(contacts), 3) and (contacts["obstacle"] == floor).all()
            assert np.allclose(contacts["normal"], (0, 0, 1)) and np.allclose(contacts["position"][:, 2], -1 - contacts["depth"])
    assert touched > 10


@pytest.mark.parametrize("shape", [exmat.Shape.height_field(np.zeros((4, 7)), (3, 6)), exmat.Shape.mesh(CORNERS + (0, 0, 1), FACES),
                                   exmat.Shape.box((9, 9, 3), center=(0, 0, -3)), exmat.Shape.mesh(CORNERS + (0, 0, 1), FACES[::-1].astype(np.uint8))],
                         ids=lambda shape: shape.kind)
def test_flat_ground_of_any_kind_is_a_plane(model, shape):
    body, expected = exmat.Body(model), exmat.Body(model)
    down = exmat.Motion(position=(0, 0, -1))
    expected.add_obstacle(exmat.Shape.plane((0, 0, 1)), motion=down, **LAW)
    body.add_obstacle(shape, motion=exmat.Motion(position=(-9, -9, -1)) if shape.kind == "height_field" else down, **LAW)
    for either in (body, expected):
        either.motion = exmat.Motion(position=(0, 0, -0.95), linear_velocity=(0.3, 0, -1))
        either.step(60)
    assert len(expected.contacts) > 10
    assert np.array_equal(body.contacts["vertex"], expected.contacts["vertex"])
    assert np.allclose(body.q, expected.q, rtol=0, atol=1e-9) and np.allclose(body.motion.position, expected.motion.position, rtol=0, atol=1e-9)


def test_what_is_added_is_read_moved_changed_and_removed(model):
    body = exmat.Body(model)
    shapes = [exmat.Shape.sphere(0.5, center=(1, 2, 30)), exmat.Shape.capsule((1, 0, 30), (4, 0, 30), 0.25),
              exmat.Shape.box((1, 2, 3), center=(0, 0, 30), orientation=(2, 0, 0, 0)), exmat.Shape.mesh(CORNERS, FACES[:3], thickness=0.1)]
    assert [body.add_obstacle(shape, stiffness=10 + k, friction=0.1) for k, shape in enumerate(shapes)] == [0, 1, 2, 3]
    sphere, capsule, box, mesh = (body.obstacle(k) for k in range(4))
    assert sphere.radius == 0.5 and sphere.point.tolist() == [1, 2, 30] and (sphere.stiffness, sphere.damping, sphere.friction) == (10, 0, 0.1)
    assert capsule.direction.tolist() == [3, 0, 0] and capsule.radius == 0.25 and capsule.stiffness == 11
    assert box.half_extents.tolist() == [1, 2, 3] and box.orientation.tolist() == [1, 0, 0, 0]
    assert [each.kind for each in (sphere, capsule, box, mesh)] == [shape.kind for shape in shapes] == ["sphere", "capsule", "box", "mesh"]
    assert np.array_equal(body.obstacle_triangles(3), CORNERS[FACES[:3]]) and body.obstacle_triangles(0).shape == (0, 3, 3)
    body.set_obstacle_law(1, damping=5)
    assert (body.obstacle(1).stiffness, body.obstacle(1).damping, body.obstacle(1).friction) == (11, 5, 0.1)
    body.move_obstacle(0, exmat.Motion(position=(0, 0, 40), linear_velocity=(1, 2, 3), angular_velocity=(0, 0, 0.5)))
    body.step(50)
    assert np.allclose(body.obstacle(0).motion.position, [0.1, 0.2, 40.3]) and body.obstacle(0).motion.angular_velocity[2] == 0.5
    assert np.allclose(body.obstacle(0).motion.orientation, [np.cos(0.025), 0, 0, np.sin(0.025)])
    body.remove_obstacle(1)
    assert body.obstacles.tolist() == [0, 2, 3] and body.add_obstacle(shapes[0]) == 4


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda body: pickle.loads(pickle.dumps(body))])
def test_a_copy_keeps_obstacles_where_they_are(model, duplicate):
    body = exmat.Body(model)
    body.add_obstacle(exmat.Shape.sphere(1, center=(0, 0, -60)))
    body.add_obstacle(exmat.Shape.height_field(0.1 * np.sin(np.arange(40)).reshape(5, 8), (2, 3)), motion=exmat.Motion(position=(-7, -4, -1.2)), **LAW)
    lift = body.add_obstacle(exmat.Shape.mesh(CORNERS, FACES), **LAW)
    last = body.add_obstacle(exmat.Shape.sphere(1, center=(0, 0, -60)))
    body.remove_obstacle(0)
    body.remove_obstacle(last)
    body.move_obstacle(lift, exmat.Motion(position=(0, 0, 0.1), orientation=(1, 0.01, 0, 0)))
    body.set_obstacle_law(lift, friction=0.2)
    body.set_damping(0.5, 0.001)
    body.set_integrator("backward_euler")
    body.motion = exmat.Motion(position=(0, 0, -0.5))
    body.step(150)
    assert len(body.contacts) > 10
    other = duplicate(body)
    assert other.obstacles.tolist() == [1, 2] and other.obstacle(lift).friction == 0.2
    assert np.array_equal(other.obstacle(lift).motion.position, body.obstacle(lift).motion.position)
    for either in (body, other):
        either.step(100)
    assert exmat.state_hash([other]) == exmat.state_hash([body]) and np.array_equal(body.contacts, other.contacts)
    assert other.add_obstacle(exmat.Shape.sphere(1)) == body.add_obstacle(exmat.Shape.sphere(1)) == 4


def test_a_copy_keeps_what_happened_to_the_scenes_obstacles(free_bundle):
    scene = {"bundle": free_bundle, "time_step": 0.002, "gravity": [0, 0, -9.81],
             "obstacles": [{"plane": {"normal": [0, 0, 1], "point": [0, 0, -1]}, "stiffness": 1e6, "damping": 2e4},
                           {"sphere": {"radius": 0.5, "center": [0, 0, -2]}, "stiffness": 1e6}]}
    model = exmat.Model.from_scene(scene)
    body = exmat.Body(model)
    body.remove_obstacle(1)
    body.set_obstacle_law(0, stiffness=2e6)
    body.move_obstacle(0, exmat.Motion(position=(0, 0, 0.5)))
    body.step(50)
    other = pickle.loads(pickle.dumps(body))
    assert other.obstacles.tolist() == [0] and other.obstacle(0).stiffness == 2e6
    for either in (body, other):
        either.step(50)
    assert exmat.state_hash([other]) == exmat.state_hash([body]) != exmat.state_hash([exmat.Body(model)])


def test_settings_of_a_body_are_those_of_its_model(free_bundle):
    expected = exmat.Body(exmat.Model(free_bundle, gravity=GRAVITY, mass_damping=3, stiffness_damping=0.01, integrator="newmark"))
    body = exmat.Body(exmat.Model(free_bundle, gravity=GRAVITY))
    body.set_damping(3, 0.01)
    body.set_integrator("newmark")
    for either in (body, expected):
        either.set_reduced(np.linspace(0, 1, 12), np.zeros(12))
        either.step(20)
    assert exmat.state_hash([body]) == exmat.state_hash([expected])


def test_what_does_not_fit_is_refused(model, free_bundle):
    body = exmat.Body(model)
    sphere = exmat.Shape.sphere(1)
    for message, call in (
            ("radius = -1", lambda: body.add_obstacle(exmat.Shape.sphere(-1))), ("normal that is not 0", lambda: body.add_obstacle(exmat.Shape.plane((0, 0, 0)))),
            ("stiffness = 0", lambda: body.add_obstacle(sphere, stiffness=0)), ("id = 7", lambda: body.remove_obstacle(7)),
            ("id = 7", lambda: body.obstacle(7)), ("id = 7", lambda: body.move_obstacle(7, exmat.Motion())),
            ("friction = -1", lambda: body.set_obstacle_law(body.add_obstacle(sphere), friction=-1)), ("id = 7", lambda: body.contact_load(7)),
            ("expected a closed mesh", lambda: exmat.Shape.mesh(CORNERS, FACES[1:])), ("whole numbers", lambda: exmat.Shape.mesh(CORNERS, FACES * 1.0)),
            (r"triangles: shape \(12, 2\): expected \(12, 3\)", lambda: exmat.Shape.mesh(CORNERS, FACES[:, :2])),
            (r"triangles\[0\] = ", lambda: exmat.Shape.mesh(CORNERS, FACES + 2**40)), ("2 or more of each", lambda: exmat.Shape.height_field([[1, 2]], (1, 1))),
            ("expected an array of shape", lambda: exmat.Shape.height_field([1, 2], (1, 1))),
            ("expected one of bdf2", lambda: body.set_integrator("euler")), ("alpha", lambda: body.set_damping(-1, 0)),
            ("knows no contact", lambda: exmat.Body(exmat.Model(free_bundle)).add_obstacle(sphere))):
        with pytest.raises(exmat.InvalidArgument, match=message):
            call()
    before = body.obstacles.tolist()
    with pytest.raises(exmat.InvalidArgument, match="quaternion"):
        body.add_obstacle(sphere, motion=exmat.Motion(orientation=(0, 0, 0, 0)))
    assert body.obstacles.tolist() == before
