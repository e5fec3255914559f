"""Worlds of bodies that touch each other."""
import copy
import gc
import pickle
import threading

import h5py
import numpy as np
import pytest

import exmat

LAW = dict(stiffness=1e7, damping=2e4, friction=0.4)
STEP = 0.002


@pytest.fixture(scope="module")
def model(free_bundle):
    return exmat.Model(free_bundle, time_step=STEP, example_stiffness=100, use_contact=True)


def body_at(model, position, velocity=(0, 0, 0)):
    body = exmat.Body(model)
    body.motion = exmat.Motion(position=position, linear_velocity=velocity)
    return body


@pytest.fixture
def world(model):
    """Two bars that are about to meet, off centre."""
    world = exmat.World(**LAW)
    world.add(body_at(model, (0, 0, 0), (0, 0, 2)))
    world.add(body_at(model, (0.1, 0.07, 1.05), (0, 0, -2)))
    return world


@pytest.fixture
def scene(free_bundle):
    return {"bodies": [{"name": "low", "bundle": str(free_bundle), "body": {"position": [0, 0, 0.05]}, "gravity": [0, 0, -5]},
                       {"name": "high", "bundle": str(free_bundle), "body": {"position": [0.2, 0.1, 1.1]}, "examples": {"stiffness": 100},
                        "grid": {"counts": [1, 1, 2], "spacing": [1, 1, 1.1]}}],
            "contact": LAW, "obstacles": [{"plane": {"normal": [0, 0, 1]}, "stiffness": 1e7, "damping": 2e4, "friction": 0.5}],
            "gravity": [0, 0, -9.81], "time_step": STEP, "steps": 120, "output": {"every": 60}}


def run_hash(runtime, path, tmp_path):
    return int(runtime("run", path, "--threads", 1, "-o", tmp_path / "run.h5")["state hash"].split()[0], 16)


def test_a_ray_meets_the_nearest_body(model, world):
    surface = exmat.Surface(model)
    exact = [body.positions(surface, np.empty((len(surface), 3))) for body in world.bodies]
    middle = exact[0].mean(0)
    for direction, nearest in (([0, 0, -2], 1), ([0, 0, 3], 0)):
        origin = middle - 5 * np.array(direction)
        hit = world.cast_ray([surface], origin, direction)
        assert (hit.body, hit.surface) == (nearest, 0)
        own = world[nearest].cast_ray(surface, origin, direction)
        assert (hit.triangle, hit.distance) == (own.triangle, own.distance) and np.array_equal(hit.normal, own.normal)
        place = hit.shares @ exact[nearest][surface.triangles[hit.triangle]]
        np.testing.assert_allclose(place, origin + hit.distance * np.array(direction) / np.linalg.norm(direction), atol=1e-12)
        assert world.cast_ray([surface], origin, direction, within=0.99 * hit.distance) is None
    assert world.cast_ray([], origin, direction) is None
    floor = world.add_obstacle(exmat.Shape.sphere(0.5, (0, 0, -4)))
    hit = world.cast_ray([surface], (0, 0, -9), (0, 0, 1))
    assert (hit.obstacle, hit.body, hit.triangle, hit.surface) == (floor, -1, -1, -1)
    np.testing.assert_allclose([hit.distance, *hit.normal], [4.5, 0, 0, -1], atol=1e-14)
    assert own.obstacle == -1
    with pytest.raises(exmat.InvalidArgument, match="direction: expected one that is not 0"):
        world.cast_ray([surface], origin, [0, 0, 0])
    with pytest.raises(exmat.InvalidArgument, match="surfaces: expected surfaces, found None"):
        world.cast_ray([None], origin, direction)


def test_a_world_of_a_scene_is_that_of_the_program(scene, scene_file, runtime, tmp_path):
    path = scene_file(**scene)
    worlds = exmat.World.from_scene(path), exmat.World.from_scene(scene)
    for world in worlds:
        assert world.ids.tolist() == list(world) == [0, 1, 2] and len(world) == 3
        assert [world.name(id) for id in world] == ["low", "high_0", "high_1"] and [world.kind(id) for id in world] == [0, 1, 1]
        assert world[1].model is world[2].model and isinstance(world[0].model, exmat.Model)
        report = world.step(120, threads=1)
        assert report.steps == 120 and report.largest_island > 1 and world.report.steps == 120
        assert world.state_hash == exmat.state_hash(world.bodies) == run_hash(runtime, path, tmp_path)
    assert "[1]" in repr(worlds[0][1].model)


def test_a_world_by_hand_is_that_of_a_scene(scene, free_bundle):
    expected = exmat.World.from_scene(scene)
    settings = dict(time_step=STEP, gravity=(0, 0, -9.81), use_contact=True)
    plain, elastic = exmat.Model(free_bundle, **settings), exmat.Model(free_bundle, example_stiffness=7, **settings)
    world = exmat.World(**LAW)
    for model, z, x in ((plain, 0.05, 0), (elastic, 1.1, 0.2), (elastic, 2.2, 0.2)):
        world.add(body_at(model, (x, x / 2, z)))
    world.add_obstacle(exmat.Shape.plane((0, 0, 1)), stiffness=1e7, damping=2e4, friction=0.5)
    world[0].set_gravity((0, 0, -5))
    for id in (1, 2):
        world[id].set_example_stiffness(100)
    expected.step(120, threads=1)
    for _ in range(12):
        world.step(10, threads=2)
    assert world.state_hash == expected.state_hash
    of_bodies = sum(body.energies.total for body in world.bodies)
    assert world.energies.total == expected.energies.total == pytest.approx(of_bodies + world.energies.contact, rel=1e-12)


def test_contacts_are_equal_and_opposite(world):
    met = False
    for _ in range(40):
        before = [body.motion.linear_velocity for body in world.bodies]
        world.step(1, threads=1)
        contacts = world.contacts
        loads = [body.contact_load()[0] for body in world.bodies]
        # Two equal bodies: what one gains the other loses, and by the load.
        change = [body.motion.linear_velocity - old for body, old in zip(world.bodies, before)]
        assert np.allclose(change[0], -change[1], rtol=0, atol=1e-12) and np.allclose(loads[0], -loads[1], rtol=0, atol=1e-6)
        if len(contacts):
            assert (contacts["body"] + contacts["other"] == 1).all() and contacts["force"].shape == (len(contacts), 3)
            own = np.where(contacts["body"][:, None] == 0, contacts["force"], -contacts["force"]).sum(0)
            met = met or np.linalg.norm(own) > 100
            assert (np.einsum("ik,ik->i", contacts["force"], contacts["normal"]) > 0).all()
            # The load is the change of momentum; listed are contacts with a normal force, not what friction alone holds.
            assert np.linalg.norm(own - loads[0]) <= 0.05 * np.linalg.norm(loads[0])
    assert met and world.contacts.dtype.names == ("body", "other", "vertex", "position", "normal", "force", "depth")


def test_bodies_come_and_go(world, model):
    body = world[0]
    assert world.bodies[0] is body and 1 in world and 2 not in world and body.model is model
    with pytest.raises(exmat.InvalidArgument, match="world"):
        body.step()
    with pytest.raises(exmat.InvalidArgument, match="in a world already"):
        exmat.World().add(body)
    with pytest.raises(KeyError, match="no body 2"):
        world[2]
    world.step(20)
    assert len(world.contacts)
    taken = world.remove(0)
    assert taken is body and len(world.contacts) == 0 and list(world) == [1] and world.name(1) == "" and world.kind(1) == -1
    taken.step(3)
    assert world.add(taken) == 2 and world.ids.tolist() == [1, 2]
    assert world[2].time == world[1].time == world.time == pytest.approx(20 * STEP), "that of the world"


def test_a_body_outlives_its_world(world):
    body = world.bodies[0]
    q = body.q
    world.step(20)
    expected = q.copy()
    del world
    gc.collect()
    assert np.array_equal(body.q, expected) and body.time == pytest.approx(20 * STEP)


def test_the_law_is_changed_and_read(world):
    world.set_contact_law(stiffness=5e6)
    law = world.contact_law
    assert (law.stiffness, law.damping, law.friction, law.self_contact) == (5e6, 2e4, 0.4, False)
    assert exmat.World(self_contact=True).contact_law.self_contact
    other = copy.copy(world)
    other.set_contact_law(stiffness=5e7)
    deepest = []
    for each in (world, other):
        most = 0
        for _ in range(30):
            each.step()
            most = max([most, *each.contacts["depth"]])
        deepest.append(most)
    assert deepest[1] < 0.5 * deepest[0]
    with pytest.raises(exmat.InvalidArgument, match="law.friction = -1"):
        world.set_contact_law(friction=-1)
    with pytest.raises(exmat.InvalidArgument, match="law.stiffness = 0"):
        exmat.World(stiffness=0)


def test_states_go_back_to_the_last_bit(world, model):
    world.step(18)
    state = world.state
    assert state == pickle.loads(pickle.dumps(state)) == copy.deepcopy(state) and len(state.input_sha256) == 2
    world.step(40)
    there = world.state_hash
    world.state = state
    assert world.state == state
    world.step(40, threads=2)
    assert world.state_hash == there
    world.remove(0)
    with pytest.raises(exmat.InvalidArgument, match="other bundles"):
        world.state = state
    with pytest.raises(TypeError):
        hash(state)


def test_a_snapshot_goes_back_to_the_last_bit(world):
    world.step(18)
    world[0].set_example_stiffness(50)
    snapshot = world.save()
    assert isinstance(snapshot, bytes)
    world.step(40)
    there = world.state_hash
    world.restore(snapshot)
    assert world.save() == snapshot
    world[0].set_example_stiffness(1000)
    world.step(3)
    world.restore(snapshot)
    world.step(40, threads=2)
    assert world.state_hash == there
    for wrong, words in ((snapshot[:-1], "ends early"), (snapshot[:200] + b"x" + snapshot[201:], "changed"), (b"no", "expected a snapshot")):
        with pytest.raises(exmat.InvalidArgument, match=words):
            world.restore(wrong)
    assert world.state_hash == there
    world.remove(0)
    with pytest.raises(exmat.InvalidArgument, match="other bodies"):
        world.restore(snapshot)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda world: pickle.loads(pickle.dumps(world))])
def test_a_copied_world_goes_on_to_the_last_bit(world, model, duplicate):
    world.remove(world.add(body_at(model, (5, 5, 5))))
    world.add(body_at(model, (0, 0, -1.3), (0, 0, 4)))
    world.remove(world.add(body_at(model, (5, 5, 5))))
    world[0].set_gravity((0, 0, 1))
    world[1].set_example_stiffness(300)
    world.add_obstacle(exmat.Shape.sphere(1, center=(0.5, 0, 3)), motion=exmat.Motion(position=(0, 0, -0.2)), **LAW)
    world.set_contact_law(friction=0.2)
    world.step(20)
    assert len(world.contacts)
    other = duplicate(world)
    assert list(other) == list(world) == [0, 1, 3] and other.state == world.state and other.contact_law.friction == 0.2
    for either in (world, other):
        either.step(40)
    assert other.state_hash == world.state_hash
    assert other.add(body_at(model, (5, 5, 5))) == world.add(body_at(model, (5, 5, 5))) == 5


def test_a_copied_world_of_a_scene_goes_on_to_the_last_bit(scene, scene_file, model):
    for given in (scene, scene_file(**scene)):
        world = exmat.World.from_scene(given)
        taken = world.remove(1)
        world.add(body_at(model, (0.2, 0.1, 1.1)))
        world.add(taken)
        world.remove_obstacle(0)
        world.add_obstacle(exmat.Shape.plane((0, 0, 1)), stiffness=1e7)
        world.step(60, threads=1)
        other = pickle.loads(pickle.dumps(world))
        assert list(other) == [0, 2, 3, 4] and other.name(2) == "high_1" and other.name(4) == "" and other[2].obstacles.tolist() == [1]
        for either in (world, other):
            either.step(60, threads=1)
        assert other.state_hash == world.state_hash


def test_a_world_that_was_pickled_wants_the_same_bundles(scene, free_bundle, tmp_path):
    moved = tmp_path / "bar.h5"
    moved.write_bytes(free_bundle.read_bytes())
    for member in scene["bodies"]:
        member["bundle"] = str(moved)
    kept = pickle.dumps(exmat.World.from_scene(scene))
    assert len(pickle.loads(kept)) == 3
    kept_body = pickle.dumps(exmat.World.from_scene(scene)[2])
    assert pickle.loads(kept_body).model.input_sha256 == exmat.Model(free_bundle).input_sha256
    with h5py.File(moved, "r+") as file:
        file.attrs.modify("input_sha256", file.attrs["input_sha256"].translate(bytes.maketrans(b"0123", b"3210")))
    for each in (kept, kept_body):
        with pytest.raises(exmat.BadInput, match="that was pickled"):
            pickle.loads(each)


def test_while_a_world_is_stepped_others_wait(world):
    done = threading.Event()
    refused = 0

    def long():
        world.step(4000)
        done.set()

    thread = threading.Thread(target=long)
    thread.start()
    while not done.is_set():
        for call in (world.step, world[0].reset, lambda: world.contacts, lambda: world.state, lambda: world.remove(0)):
            try:
                if not done.is_set():
                    call()
            except exmat.InvalidArgument as error:
                refused += "another thread steps this" in str(error)
    thread.join()
    assert refused > 10


def test_a_body_of_no_finite_numbers_is_named(world, free_bundle):
    damped = exmat.Model(free_bundle, time_step=STEP, use_contact=True, stiffness_damping=1e300)
    world.remove(1)
    broken = world.add(body_at(damped, (9, 0, 0)))
    world[broken].set_group(2, 0)  # it reaches all others
    world[broken].set_reduced(*2 * [np.full(damped.modes, 1e30)])
    with pytest.raises(exmat.NonFinite, match=f"body {broken}"):
        world.step(5)
    assert world.report.steps == 0


def test_what_cannot_touch_is_refused(world, free_bundle, scene):
    for message, model in (("knows no contact", exmat.Model(free_bundle, time_step=STEP)),
                           ("time step", exmat.Model(free_bundle, time_step=0.001, use_contact=True))):
        with pytest.raises(exmat.InvalidArgument, match=message):
            world.add(exmat.Body(model))
    with pytest.raises(exmat.BadInput, match="nowhere"):
        exmat.World.from_scene("nowhere.json")
    with pytest.raises(exmat.BadInput):
        exmat.Model.from_scene(scene)


@pytest.mark.parametrize("make", [lambda bundle: exmat.Model(bundle, use_contact=True), lambda bundle: exmat.Model.from_scene({"bundle": bundle}, use_contact=True)])
def test_what_is_of_a_model_keeps_it(free_bundle, make):
    body, points = exmat.Body(make(free_bundle)), exmat.Points(make(free_bundle), [0])
    batch = exmat.Batch(make(free_bundle), 2)
    gc.collect()
    assert isinstance(body.model, exmat.Model) and isinstance(points.model, exmat.Model) and isinstance(batch.model, exmat.Model)
    body.step(3)
    other = pickle.loads(pickle.dumps(body))
    assert exmat.state_hash([other]) == exmat.state_hash([body]) and other.model.input_sha256 == body.model.input_sha256
    assert len(pickle.loads(pickle.dumps(batch))) == 2
    other.add_obstacle(exmat.Shape.sphere(1))


def test_a_scene_file_may_know_of_contact(free_bundle, scene_file):
    path = scene_file(bundle=free_bundle, gravity=[0, 0, -1])
    with pytest.raises(exmat.InvalidArgument, match="knows no contact"):
        exmat.Body(exmat.Model.from_scene(path)).add_obstacle(exmat.Shape.sphere(1))
    body = pickle.loads(pickle.dumps(exmat.Body(exmat.Model.from_scene(path, use_contact=True))))
    assert body.add_obstacle(exmat.Shape.sphere(1)) == 0
    with pytest.raises(exmat.BadInput, match="nowhere"):
        exmat.Model.from_scene("nowhere.json", use_contact=True)


def test_a_scene_with_one_bundle_is_a_world_of_its_instances(free_bundle, scene_file, runtime, tmp_path):
    path = scene_file(bundle=free_bundle, gravity=[0, 0, -9.81], instances=5, steps=60, time_step=STEP,
                      obstacles=[{"plane": {"normal": [0, 0, 1], "point": [0, 0, -0.6]}, "stiffness": 1e6}], output={"every": 60})
    world = exmat.World.from_scene(path)
    assert list(world) == [0, 1, 2, 3, 4] and world.obstacles.tolist() == [0]
    world.step(60)
    assert world.state_hash == run_hash(runtime, path, tmp_path)
    world.reset()
    assert world.time == 0 and world[3].time == 0
    world.step(60, threads=2)
    assert world.state_hash == run_hash(runtime, path, tmp_path)


def test_a_pile_falls_asleep_and_wakes_as_a_whole(free_bundle):
    model = exmat.Model(free_bundle, time_step=STEP, gravity=(0, 0, -9.81), mass_damping=8, stiffness_damping=0.01, use_contact=True,
                        sleep_energy=1e-3, sleep_time=0.1)
    world = exmat.World(stiffness=1e6, damping=1e5, friction=0.5)
    world.add_obstacle(exmat.Shape.plane((0, 0, 1), point=(0, 0, -0.01)), stiffness=1e6, damping=1e5, friction=0.5)
    for z in (0, 1.02):
        world.add(body_at(model, (0, 0, z)))
    for _ in range(200):
        if world.step(20).asleep == 2:
            break
    assert world.report.asleep == 2 and world.report.islands == 0
    at_rest = world.state_hash
    world.step(50)
    assert world.state_hash == at_rest
    points = exmat.Points(model, [0])
    world[1].apply_forces(points, [[0, 0, 1]])
    assert world.step(1).asleep == 0, "what it lies on wakes with it"
