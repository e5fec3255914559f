"""Bodies on the skeleton of a glTF file: a tube on three bones, which curls."""
import copy
import json
import os
import pathlib
import pickle
import subprocess
import sys

import h5py
import numpy as np
import pytest

import exmat

TESTS = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TESTS / "integration"))
from programs import bar, write_json, write_skinned  # noqa: E402

BUILD = pathlib.Path(os.environ.get("EXMAT_BUILD", TESTS.parent / "build/release"))
LENGTH = 3.0
SETTINGS = dict(time_step=0.004, stiffness_damping=0.005, gravity=(0, -9.81, 0))


def bundle_of(path, cells, material={}, **more):
    if not (BUILD / "bin/exmat-precompute").exists() and "EXMAT_PRECOMPUTE" not in os.environ:
        pytest.skip("built without the offline stage")
    exmat.precompute.bundle({
        "name": "tube", "object": {"surface": path, "cells": cells,
                                   "material": {"youngs_modulus": 3e5, "poisson_ratio": 0.4, "density": 1000, **material}},
        "basis": {"size": 12, "linear_modes": 8, "training": "none"}, "cubature": {"elements": 30}, **more}, path.with_suffix(".h5"))
    return path.with_suffix(".h5")


@pytest.fixture(scope="module")
def skinned(folder):
    write_skinned(folder / "tube.glb")
    return bundle_of(folder / "tube.glb", 1500)


@pytest.fixture(scope="module")
def model(skinned):
    return exmat.Model(skinned, **SETTINGS)


@pytest.fixture(scope="module")
def held(skinned):
    """The vertices that bones hold, at rest, and each one's bone."""
    with h5py.File(skinned) as file:
        fixed = np.flatnonzero(file["/object/fixed"][:])
        return fixed, file["/object/vertices"][:][fixed], file["/skeleton/weights"][:][fixed].argmax(1)


def rotation(turn):
    """The matrix of a turn by its rotation vector (Rodrigues)."""
    angle = np.linalg.norm(turn)
    x, y, z = turn / angle if angle > 0 else turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def off_bones(body, transforms, held):
    """Largest distance of the held vertices from where the bones take them [m]."""
    vertices, rest, bones = held
    points = exmat.Points(body.model, vertices)
    found = body.positions(points, np.empty((len(vertices), 3)))
    bound = body.model.bound_bones
    local = np.einsum("kji,kj->ki", bound[bones, :, :3], rest - bound[bones, :, 3])
    return np.abs(found - np.einsum("kij,kj->ki", transforms[bones, :, :3], local) - transforms[bones, :, 3]).max()


def turned(transforms, degrees, shift):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    moved = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ transforms
    moved[:, :, 3] += shift
    return moved


def test_a_model_has_the_bones_of_the_file(model, held):
    assert model.bones == {"root": None, "middle": "root", "tip": "middle"}
    assert np.allclose(model.bound_bones[:, :, 3], [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert model.animations == {"curl": 1.0}
    tip = model.animated_bones("curl", 0.25)[2]
    assert np.allclose(tip[:, 0], [np.cos(np.radians(45)), np.sin(np.radians(45)), 0], atol=1e-6)
    vertices, rest, bones = held
    assert len(vertices) >= 12 and set(bones) == {0, 1, 2}
    assert (np.linalg.norm(rest[:, 1:], axis=1) < 0.35).all()


def test_held_vertices_are_where_their_bones_are(model, held):
    body = exmat.Body(model)
    for k in range(100):
        bones = turned(model.animated_bones("curl", 0.01 * k), 720 * 0.004 * k, [0, 0, 10 * 0.004 * k])
        body.set_bones(bones)
        assert body.step().status == 0
        assert off_bones(body, bones, held) < 1e-12 * LENGTH
    assert np.allclose(body.bones, bones, atol=1e-12)
    elsewhere = turned(model.bound_bones, 40, [50, 3, 0])
    body.set_bones(elsewhere, teleport=True)
    assert off_bones(body, elsewhere, held) < 1e-12 * 50


def test_the_flesh_follows_and_comes_to_rest_as_it_hangs(model):
    body, still = exmat.Body(model), exmat.Body(model)
    body.set_damping(3, 0.02)
    still.set_damping(3, 0.02)
    everywhere = exmat.Points.all_vertices(model)
    for k in range(1200):
        body.set_bones(model.animated_bones("curl", min(0.004 * k, 1.0)))
        body.step()
        still.step()
    xyz, expected = body.positions(everywhere), still.positions(everywhere)
    assert np.abs(xyz - expected).max() < 1e-3
    assert np.abs(expected - exmat.Body(model).positions(everywhere)).max() > 0.005  # it sags


def test_flesh_that_is_folded_at_joints_stays_at_its_bones(folder):
    """Damping is by the stiffness of the first iterate, which was indefinite where a later one alone showed it: the step had no minimum,
    and flesh flew 1e8 m away."""
    path = folder / "folded.glb"
    write_skinned(path)
    bundle_of(path, 1500, material={"model": "stable_neo_hookean"})
    model = exmat.Model(path.with_suffix(".h5"), **SETTINGS | {"stiffness_damping": 0.003})
    bound, everywhere = model.bound_bones, exmat.Points.all_vertices(model)
    generator = np.random.default_rng(4)
    turns = generator.normal(size=(3, 3))
    turns *= 1.5 / np.linalg.norm(turns, axis=1, keepdims=True)
    rates = generator.uniform(0.5, 3, 3)
    body = exmat.Body(model)
    for k in range(1, 301):
        bones, axes, joint = bound.copy(), np.eye(3), bound[0, :, 3]
        for bone in range(3):
            if bone > 0:
                joint = joint + axes @ (bound[bone, :, 3] - bound[bone - 1, :, 3])
            axes = axes @ rotation(turns[bone] * np.sin(2 * np.pi * rates[bone] * 0.004 * k))
            bones[bone] = np.column_stack([axes @ bound[bone, :, :3], joint])
        body.set_bones(bones)
        assert body.step().status == 0
        assert np.abs(body.positions(everywhere)).max() < 10 * LENGTH  # it is soft, and swings


def test_an_animation_of_the_scene_is_that_of_a_host(skinned, model):
    scene = {"bundle": str(skinned), "time_step": 0.004, "steps": 200, "gravity": [0, -9.81, 0], "damping": {"stiffness": 0.005},
             "body": {"animation": {"name": "curl", "speed": 0.5, "start": 0.1}}}
    played = exmat.Body(exmat.Model.from_scene(scene))
    body = exmat.Body(model)
    body.set_bones(model.animated_bones("curl", 0.1))
    for k in range(200):
        body.set_bones(model.animated_bones("curl", 0.1 + 0.5 * 0.004 * (k + 1)))
        body.step()
    played.step(200)
    everywhere = exmat.Points.all_vertices(model)
    assert np.abs(played.positions(exmat.Points.all_vertices(played.model)) - body.positions(everywhere)).max() < 1e-6


def test_states_and_copies_go_on_to_the_last_bit(model):
    body = exmat.Body(model)
    for k in range(20):
        body.set_bones(model.animated_bones("curl", 0.004 * k))
        body.step()
    twin, other, third = copy.deepcopy(body), pickle.loads(pickle.dumps(body)), exmat.Body(model)
    third.state = body.state
    for k in range(20, 40):
        for one in (body, twin, other, third):
            one.set_bones(model.animated_bones("curl", 0.004 * k))
            one.step()
    assert len({exmat.state_hash([one]) for one in (body, twin, other, third)}) == 1


def test_the_program_goes_on_from_a_state_to_the_last_bit(skinned, folder):
    scene = {"bundle": str(skinned), "time_step": 0.004, "steps": 60, "gravity": [0, -9.81, 0], "body": {"animation": {"name": "curl"}}}
    path = folder / "curl.json"
    path.write_text(json.dumps(scene))

    def run(*words):
        done = subprocess.run([BUILD / "bin/exmat-runtime", "run", path, *map(str, words)], capture_output=True, text=True, check=True)
        return [line for line in done.stdout.splitlines() if line.startswith("state hash")]

    whole = run()
    run("--steps", 30, "--dump-state", folder / "half.json")
    assert run("--from-state", folder / "half.json", "--steps", 30) == whole


def test_what_cannot_be_is_refused(model, bundle):
    body = exmat.Body(model)
    bones = model.bound_bones
    with pytest.raises(exmat.InvalidArgument, match="transforms"):
        body.set_bones(bones[:2])
    bones[1, 2, 3] = np.nan
    with pytest.raises(exmat.InvalidArgument, match="finite"):
        body.set_bones(bones)
    with pytest.raises(exmat.InvalidArgument, match="skeleton"):
        body.space = "reduced"
    with pytest.raises(exmat.InvalidArgument, match="skeleton"):
        body.set_reduced(np.zeros(model.modes), np.zeros(model.modes))
    with pytest.raises(exmat.InvalidArgument, match="none that is named run"):
        model.animated_bones("run", 0)
    other = exmat.Model(bundle)
    assert other.bones == {} and other.animations == {}
    with pytest.raises(exmat.InvalidArgument, match="no bones"):
        exmat.Body(other).set_bones(np.empty((0, 3, 4)))


def test_keys_of_a_joint_turn_what_hangs_on_it(skinned, model, held):
    angle = np.radians(40)
    keys = [{"time": 0}, {"time": 0.2, "orientation": [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]}]
    scene = {"bundle": str(skinned), "time_step": 0.004, "damping": {"stiffness": 0.005},
             "body": {"animation": {"name": "curl"}, "bones": [{"joint": "middle", "motion": keys}]}}
    body = exmat.Body(exmat.Model.from_scene(scene))
    body.step(75)
    expected = model.animated_bones("curl", 0.3)
    turn, joint = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]), expected[1, :, 3].copy()
    expected[1:] = turn @ expected[1:]
    expected[1:, :, 3] += joint - turn @ joint
    assert np.allclose(body.bones, expected, atol=1e-12)
    assert off_bones(body, body.bones, held) < 1e-12 * LENGTH
    body.set_bones(model.bound_bones)  # of the host, in place of the scene's
    body.step()
    assert np.allclose(body.bones, model.bound_bones)
    scene["body"]["bones"][0]["joint"] = "midle"
    with pytest.raises(exmat.BadInput, match=r'/body/bones/0/joint: .*did you mean "middle"'):
        exmat.Model.from_scene(scene)


def test_a_joint_drives_the_weight_of_an_example(folder):
    write_skinned(folder / "arm.glb", bulge=0.4)
    bundle = bundle_of(folder / "arm.glb", 400, examples=[{"name": "flex", "morph": "flex"}], targets={"tolerance": 0.01})
    driver = {"example": "flex", "joint": "middle", "axis": [0, 0, 1], "angles": [0, np.radians(60)]}
    scene = {"bundle": str(bundle), "time_step": 0.004, "damping": {"mass": 10, "stiffness": 0.01},
             "examples": {"stiffness": 20000, "drivers": [driver]}, "body": {"animation": {"name": "curl"}}}
    body = exmat.Body(exmat.Model.from_scene(scene))
    assert np.allclose(body.weights, [1, 0])
    for k in range(1, 60):
        body.step()
        assert np.allclose(body.weights[1], 0.004 * k, atol=1e-6)  # 30 degrees in half a second, keys in single precision
    for member, value in (("example", "fles"), ("joint", "mittle")):
        with pytest.raises(exmat.BadInput, match=f"/examples/drivers/0/{member}: .*did you mean"):
            exmat.Model.from_scene({**scene, "examples": {"stiffness": 1, "drivers": [{**driver, member: value}]}})
    with pytest.raises(exmat.BadInput, match="axis and angles, or rotation and radius"):
        exmat.Model.from_scene({**scene, "examples": {"stiffness": 1, "drivers": [{**driver, "radius": 1}]}})


def folded(skinned, self_contact):
    """The tube bent by 90 degrees at both joints, its tip then 0.65 m above the root, which both are 0.5 m thick on either side."""
    world = exmat.World.from_scene({
        "bodies": [{"name": "tube", "bundle": str(skinned)}], "time_step": 0.004, "damping": {"stiffness": 0.02},
        "contact": {"stiffness": 1e8, "damping": 1e5, "self": self_contact}})
    body = world[0]
    for k in range(300):
        angle, bones, place = np.radians(90) * min(1.0, k / 150), body.model.bound_bones.copy(), np.zeros(3)
        for bone in range(3):
            c, s = np.cos(bone * angle), np.sin(bone * angle)
            bones[bone] = np.column_stack([[c, s, 0], [-s, c, 0], [0, 0, 1], place])
            place = place + bones[bone, :, 0]
        bones[2, 1, 3] -= 0.35 * np.clip((k - 150) / 100, 0, 1)
        body.set_bones(bones)
        assert world.step(1, threads=1).unconverged_islands == 0
    return body, bones


def test_flesh_does_not_go_through_flesh(skinned, held):
    with h5py.File(skinned) as file:
        tets, rest = file["/object/tets"][:], file["/object/vertices"][:]
    root, tip = tets[(rest[tets, 0] < 0.8).all(1)], rest[:, 0] > 2.3
    deep = []  # vertices of the tip more than a twentieth of a tet's height inside the root
    for self_contact in (False, True):
        body, bones = folded(skinned, self_contact)
        assert off_bones(body, bones, held) < 1e-12 * LENGTH
        xyz = body.positions(exmat.Points.all_vertices(body.model)).astype(float)
        corners = xyz[root]
        inverse = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
        shares = np.einsum("tij,tkj->tki", inverse, xyz[tip] - corners[:, :1])
        deep.append(int((np.minimum(shares.min(2), 1 - shares.sum(2)).max(0) > 0.05).sum()))
    assert deep[0] > 5 and deep[1] == 0


def test_tets_hang_on_the_bones_of_a_file(folder, monkeypatch):
    monkeypatch.chdir(folder)
    mesh, clamp = bar()
    lower = list(range(4 * len(clamp)))  # the half before x = 2
    pathlib.Path("boned.veg").write_text(mesh)
    write_json("bones.json", {
        "joints": [{"name": "lower", "position": [0, 0.5, 0.5]}, {"name": "upper", "parent": "lower", "position": [2, 0.5, 0.5]}],
        "weights": [{"joint": "lower", "vertices": lower}, {"joint": "upper", "vertices": list(range(len(lower), 9 * len(clamp)))}]})
    path = bundle_of(folder / "boned.veg", None, object={
        "mesh": "boned.veg", "skeleton": "bones.json", "material": {"youngs_modulus": 3e5, "poisson_ratio": 0.4, "density": 1000}})
    model = exmat.Model(path, **SETTINGS)
    assert model.bones == {"lower": None, "upper": "lower"}
    body = exmat.Body(model)
    bones = model.bound_bones
    bones[1, :, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    for _ in range(5):
        body.set_bones(bones)
        body.step()
    with h5py.File(path) as file:
        fixed = np.flatnonzero(file["/object/fixed"][:])
        held = fixed, file["/object/vertices"][:][fixed], (fixed >= len(lower)).astype(int)
    assert set(held[2]) == {0, 1}
    assert off_bones(body, bones, held) < 1e-12 * 4
