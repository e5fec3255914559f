"""Frames, assets and scenes of the add-on."""
import json
import pathlib
import struct

import numpy as np
import pytest
from exmat_blender import library
from exmat_blender.asset import BodySettings, MotionSettings, Region, Shape, asset_of, example_names, is_made_of, made_of, notes, scene_of
from exmat_blender.fault import Fault
from exmat_blender.frame import BodyFrame, quaternion
from exmat_blender.point_cache import write_pc2

ROOT = pathlib.Path(__file__).resolve().parents[3]


def askew(scale=(2, 0.5, 1)):
    turn, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = (turn * np.sign(np.linalg.det(turn))) @ np.diag(scale), (3, -1, 2)
    return matrix


def tetrahedron():
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    return Shape("thing", vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]), {"bow": vertices + [[0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]]})


@pytest.mark.parametrize("scale", [(2, 0.5, 1), (-1, 2, 3), (1, 1, 1)])
@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_the_frame_keeps_the_world(scale, unit):
    matrix = askew(scale)
    frame = BodyFrame(matrix, unit)
    local = np.random.default_rng(2).standard_normal((5, 3))
    world = (local @ matrix[:3, :3].T + matrix[:3, 3]) * unit
    body = frame.to_body(local)
    assert np.allclose(frame.turn.T @ frame.turn, np.eye(3), atol=1e-14) and np.linalg.det(frame.turn) > 0 and not frame.sheared
    assert np.allclose(body @ frame.turn.T + unit * matrix[:3, 3], world, atol=1e-12)
    assert np.allclose(frame.to_local(body), local, atol=1e-12)
    assert np.allclose(frame.point_to_body(world[0] / unit), body[0], atol=1e-12)
    assert np.allclose(frame.direction_to_body(frame.turn @ [0, 0, -9.81]), [0, 0, -9.81])
    assert np.allclose(frame.moved(np.eye(3), np.zeros(3)), matrix, atol=1e-12)
    lifted = frame.moved(np.eye(3), frame.direction_to_body([0, 0, 2 * unit]))
    assert np.allclose(lifted[:3, 3], matrix[:3, 3] + [0, 0, 2], atol=1e-12)


def test_a_frame_that_moves():
    rng = np.random.default_rng(4)
    for _ in range(20):
        wxyz = rng.standard_normal(4)
        w, x, y, z = wxyz / np.linalg.norm(wxyz)
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        found = quaternion(turn)
        assert min(np.abs(found - [w, x, y, z]).max(), np.abs(found + [w, x, y, z]).max()) < 1e-14
        first, carry = askew(), np.eye(4)
        carry[:3, :3], carry[:3, 3] = turn, rng.standard_normal(3)
        before, after = BodyFrame(first, 0.1), BodyFrame(carry @ first, 0.1)
        rotation, translation = before.motion_to(after)
        assert np.allclose(before.moved(rotation, translation), carry @ first, atol=1e-12)
    with pytest.raises(Fault, match="scale is animated"):
        BodyFrame(askew()).motion_to(BodyFrame(askew((2, 1, 1))))


def test_a_sheared_object_and_one_without_a_scale():
    matrix = np.eye(4)
    matrix[0, 1] = 0.5
    frame = BodyFrame(matrix)
    assert frame.sheared and np.allclose(frame.turn @ frame.stretch, matrix[:3, :3]) and np.allclose(frame.turn @ frame.turn.T, np.eye(3))
    with pytest.raises(Fault, match="scale is 0 along an axis"):
        BodyFrame(askew((1, 0, 1)))


def test_the_asset_says_what_the_panel_says():
    shape = tetrahedron()
    shape.clamp = np.array([True, False, False, False])
    shape.poses["a/b"] = shape.vertices * 2
    shape.regions = [Region("tip", np.array([False, True, True, True]), ["a/b"])]
    asset = asset_of(shape, BodySettings(cells=700, modes=8, density=500))
    body = asset["object"]
    assert body["surface"]["parts"]["_FIXED"].tolist() == [True, False, False, False] and body["fixed"] == {"part": "_FIXED"}
    assert body["cells"] == 700 and body["material"]["youngs_modulus"] == pytest.approx(30 * 500 * 9.81 * 2)
    assert [example["name"] for example in asset["examples"]] == ["bow", "a_b"]
    assert asset["regions"] == [{"name": "tip", "vertices": {"part": "_REGION_0"}, "example_vertices": {"part": "_REGION_0"}, "examples": ["a_b"]}]
    assert asset["basis"] == {"size": 8, "training": "none"} and asset["cubature"] == {"elements": 16}
    assert "fixed" not in asset_of(tetrahedron(), BodySettings())["object"]
    members = json.loads((ROOT / "schemas/asset.json").read_text())["properties"]
    assert set(asset) <= set(members) and set(body) <= set(members["object"]["properties"])


def test_the_scene_has_the_forces_that_the_bundle_has():
    shape, settings = tetrahedron(), MotionSettings(frame_time=0.04, steps=20, gravity=np.array([0, 0, -9.81]))
    scene = scene_of(shape, settings, "bar.h5")
    assert scene["time_step"] == pytest.approx(0.002) and scene["examples"]["bias"] == 0.5 and "regions" not in scene and "obstacles" not in scene
    shape.regions = [Region("tip", np.ones(4, bool), ["bow"])]
    settings.floor = {"point": np.zeros(3), "normal": np.array([0, 0, 1]), "friction": 0.3}
    scene = scene_of(shape, settings, "bar.h5")
    assert "examples" not in scene and scene["regions"][0]["name"] == "tip" and scene["obstacles"][0]["friction"] == 0.3
    json.dumps(scene)
    assert set(scene) <= set(json.loads((ROOT / "schemas/scene.json").read_text())["properties"])


def test_what_cannot_be_made_is_said():
    def after(change, words):
        shape = tetrahedron()
        change(shape)
        with pytest.raises(Fault, match=words):
            asset_of(shape, BodySettings())

    ones = np.ones(4, bool)
    after(lambda s: setattr(s, "triangles", np.zeros((0, 3), int)), "no faces")
    after(lambda s: s.vertices.fill(1), "in one place")
    after(lambda s: s.vertices.fill(np.nan), "finite")
    after(lambda s: s.poses.update(idle=s.vertices), "'idle' moves nothing")
    after(lambda s: s.poses.update(odd=s.vertices + np.inf), "'odd'.*finite")
    after(lambda s: setattr(s, "clamp", ~ones), "group is empty")
    after(lambda s: setattr(s, "clamp", ones), "holds all vertices")
    after(lambda s: s.regions.append(Region("tip", ~ones, ["bow"])), "'tip' is empty")
    after(lambda s: s.regions.append(Region("tip", ones, [])), "'tip' has no shape key")
    after(lambda s: s.regions.append(Region("tip", ones, ["wave"])), "'wave', which is not there")
    after(lambda s: s.regions.extend([Region("a/b", ones, ["bow"]), Region("a_b", ones, ["bow"])]), "two regions")


def test_notes():
    shape = tetrahedron()
    assert notes(shape) == ["No clamp: the body is free, and falls."]
    shape.poses, shape.triangles = {}, shape.triangles[1:]
    assert [note.split(":")[0] for note in notes(shape)] == ["No shape keys", "No clamp", "The mesh is open"]


def test_names_are_those_that_a_bundle_takes():
    names = example_names(["a/b", "a_b", "..", "h0", "é" * 40, "line\nbreak", ""])
    assert names["a/b"] == "a_b" and names["a_b"] == "a_b_2" and names[".."] == ".._" and names["h0"] == "h0_" and names[""] == "pose"
    assert len(set(names.values())) == 7 and all(len(name.encode()) <= 64 and "/" not in name and "\n" not in name for name in names.values())


def test_a_bundle_knows_what_it_was_made_of():
    shape, stretch = tetrahedron(), np.eye(3)
    kept = made_of(shape, stretch)
    assert is_made_of(kept, tetrahedron(), stretch * (1 + 1e-7)) and not is_made_of(kept, shape, stretch * 1.01)
    for change in (lambda s: s.vertices.__setitem__((0, 0), 1e-3), lambda s: s.poses.clear(), lambda s: setattr(s, "clamp", np.ones(4, bool)),
                   lambda s: s.poses.__setitem__("bow", s.vertices * 2), lambda s: s.regions.append(Region("tip", np.ones(4, bool), ["bow"]))):
        other = tetrahedron()
        change(other)
        assert not is_made_of(kept, other, stretch)


def test_a_cache_appears_whole(tmp_path):
    frames = np.random.default_rng(3).standard_normal((3, 5, 3)).astype("f4")
    write_pc2(tmp_path / "a.pc2", frames, 7)
    data = (tmp_path / "a.pc2").read_bytes()
    assert struct.unpack_from("<12siiffi", data) == (b"POINTCACHE2\0", 1, 5, 7.0, 1.0, 3)
    assert np.array_equal(np.frombuffer(data, "<f4", offset=32).reshape(3, 5, 3), frames)
    with pytest.raises(OSError):
        write_pc2(tmp_path / "nowhere/a.pc2", frames)
    with pytest.raises(ValueError):
        write_pc2(tmp_path / "a.pc2", [frames[0], "no numbers"])
    assert (tmp_path / "a.pc2").read_bytes() == data and len(list(tmp_path.iterdir())) == 1


def test_where_the_library_is_not(tmp_path, monkeypatch):
    with pytest.raises(Fault, match="no package exmat in"):
        library.load(str(tmp_path))
    import sys

    for name in [name for name in sys.modules if name == "exmat" or name.startswith("exmat.")]:
        monkeypatch.delitem(sys.modules, name)
    (tmp_path / "exmat").mkdir()
    (tmp_path / "exmat/__init__.py").write_text("from . import _exmat\n")
    monkeypatch.setattr(sys, "path", list(sys.path))
    with pytest.raises(Fault, match="cannot be loaded|another Python than Blender's"):
        library.load(str(tmp_path))
    (tmp_path / "exmat/__init__.py").write_text("import nowhere_to_be_found\n")
    with pytest.raises(Fault, match="needs the Python package nowhere_to_be_found"):
        library.load(str(tmp_path))
    (tmp_path / "exmat/__init__.py").write_text("\n")
    with pytest.raises(Fault, match="another package"):
        library.load(str(tmp_path))
