"""Bundles and trajectories by name, the offline stage, arrays in place of files."""
import pathlib
import pickle
import threading

import h5py
import numpy as np
import pytest

import exmat
from conftest import ASSET, BAR


def box(cells=(6, 2, 2), size=(3.0, 1.0, 1.0)):
    """Vertices and tets of a box of cubes of six tets."""
    nx, ny, nz = (count + 1 for count in cells)
    grid = np.stack(np.meshgrid(*(np.arange(count + 1) / count * length for count, length in zip(cells, size)), indexing="ij"), -1)
    corner = np.arange(nx * ny * nz).reshape(nx, ny, nz)
    tets = []
    for steps in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (1, 0, 2), (2, 1, 0)):
        path = [np.zeros(3, int)]
        for axis in steps:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        tet = [corner[tuple(slice(at[axis], at[axis] + cells[axis]) for axis in range(3))].ravel() for at in path]
        tets.append(np.stack(tet if steps in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else tet[:2] + tet[:1:-1], 1))
    return grid.reshape(-1, 3), np.concatenate(tets)


def test_fields_of_a_bundle_are_read_by_name(bundle):
    with exmat.Bundle(bundle) as data, h5py.File(bundle) as file:
        names = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        assert list(data) == names and "examples" in data.features and "constrained" in data.features
        for name, field in data.items():
            assert field.units == file[name].attrs["units"].decode() and field.description and field.shape == file[name].shape
            assert np.array_equal(field[:], file[name][:])
        basis = data["/modal/basis"]
        assert basis.units == "kg^(-1/2)" and basis[3].shape == (3, 12) and "modal/basis" in repr(basis)
        assert data.attributes["asset_name"] == "bar" and data.attributes_of("examples/twist")["index"] == 1
        with pytest.raises(KeyError, match="there is no field modal/bases"):
            data["modal/bases"]


def test_a_trajectory_is_read_frame_by_frame(bundle, scene_file, runtime, tmp_path):
    scene = scene_file(bundle=bundle, steps=40, gravity=[0, 0, -1], output={"every": 10})
    runtime("run", scene, "-o", tmp_path / "run.h5")
    body = exmat.Body(exmat.Model.from_scene(scene))
    points = exmat.Points.all_vertices(body.model)
    with exmat.Trajectory(tmp_path / "run.h5") as run:
        assert run.frames == 5 and run.vertices.shape == (5, 340, 3) and run.vertices.units == "m" and run.tets.shape[1] == 4
        for frame, time in enumerate(run.time):
            assert body.time == pytest.approx(time)
            # Positions of trajectories are summed in double precision.
            assert abs(run.vertices[frame] - body.positions(points)).max() < 1e-6
            assert np.array_equal(run["reduced"][frame], body.q)
            body.step(10)
    with pytest.raises(exmat.BadInput, match="expected \"exmat-trajectory\", found \"exmat-bundle\""):
        exmat.Trajectory(bundle)
    with pytest.raises(exmat.BadInput, match="nowhere.h5"):
        exmat.Bundle(tmp_path / "nowhere.h5")


def test_progress_and_report_of_a_bundle(bundle, tmp_path):
    heard = []
    report = exmat.precompute.bundle(ASSET, tmp_path / "bar.h5", progress=heard.append)
    assert report.status == "done" and report.sizes.modes == 12 and report["cubature"]["method"]
    assert [example.name for example in report.examples] == ["rest", "twist"]
    stages = {progress.stage for progress in heard if progress.finished}
    assert {"linear modes", "cubature", "writing the bundle"} <= stages
    assert exmat.precompute.bundle(ASSET, tmp_path / "bar.h5", if_changed=True).status == "unchanged"
    assert exmat.Model(tmp_path / "bar.h5").input_sha256 == exmat.Model(bundle).input_sha256
    with pytest.raises(AttributeError, match="there is no stage"):
        report.stage


def test_arrays_give_the_bundle_of_their_files(bundle, tmp_path):
    vertices, tets = box()
    twisted = vertices.copy()
    angle = 0.5 * vertices[:, 0]
    y, z = vertices[:, 1] - 0.5, vertices[:, 2] - 0.5
    twisted[:, 1], twisted[:, 2] = 0.5 + np.cos(angle) * y - np.sin(angle) * z, 0.5 + np.sin(angle) * y + np.cos(angle) * z
    members = {**ASSET, "object": {**ASSET["object"], "mesh": (vertices, tets), "fixed": {"ids": np.flatnonzero(vertices[:, 0] == 0)}},
               "examples": [{"name": "twist", "mesh": twisted}]}
    exmat.precompute.bundle(members, tmp_path / "arrays.h5")
    with exmat.Bundle(tmp_path / "arrays.h5") as data:
        assert np.array_equal(data["object/vertices"][:], vertices) and np.array_equal(data["object/tets"][:], tets)
        assert data["object/fixed"][:].sum() == (vertices[:, 0] == 0).sum()
    for name, points in (("object", vertices), ("twist", twisted)):
        exmat.precompute.write_mesh(tmp_path / f"{name}.vtk", points, tets)
    files = {**members, "object": {**members["object"], "mesh": tmp_path / "object.vtk"}, "examples": [{"name": "twist", "mesh": tmp_path / "twist.vtk"}]}
    exmat.precompute.bundle(files, tmp_path / "files.h5")
    with exmat.Bundle(tmp_path / "arrays.h5") as first, exmat.Bundle(tmp_path / "files.h5") as second:
        assert list(first) == list(second)
        assert all(np.array_equal(first[name][()], second[name][()]) for name in first)


def test_check_and_scene_as_members(bundle, tmp_path):
    found = exmat.precompute.check(ASSET)
    assert [(example.name, example.verdict) for example in found.examples] == [("rest", "good"), ("twist", "good")]
    assert 0 < found.examples[1].shape_space_error < 0.5
    report = exmat.precompute.bundle(ASSET, tmp_path / "bar.h5", scene={"gravity": [0, 0, -1]})
    assert "examples" not in [group.group for group in report.groups if group.included]


def test_bad_assets_are_refused_with_the_programs_message(tmp_path):
    out = tmp_path / "bar.h5"
    with pytest.raises(exmat.BadInput, match='^asset.json: /basis/sizes; unknown member "sizes"'):
        exmat.precompute.bundle({**ASSET, "basis": {"sizes": 3}}, out)
    with pytest.raises(exmat.BadInput, match="nowhere.msh"):
        exmat.precompute.check({**ASSET, "object": {"mesh": "nowhere.msh"}})
    vertices, tets = box()
    for mesh, message in (((vertices, tets + 400), r"tets\[0, [0-3]\] = 4[0-9]{2}: expected a vertex, 0 to 62"), (vertices, "found vertices alone"),
                          ((vertices[:, :2], tets), "expected"), ((vertices, tets * 1.0), "whole numbers")):
        with pytest.raises(exmat.InvalidArgument, match=message):
            exmat.precompute.check({"name": "box", "object": {"mesh": mesh}})
    with pytest.raises(exmat.Failure, match="there is no exmat-precompute|No such file|nowhere"):
        exmat.precompute.check(ASSET, program=tmp_path / "nowhere")
    assert not out.exists() and not list(tmp_path.iterdir())


def test_a_cancelled_bundle_is_not_there(bundle, tmp_path):
    def stop(progress):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        exmat.precompute.bundle(ASSET, tmp_path / "bar.h5", progress=stop)
    asset = {**ASSET, "basis": {"size": 30, "linear_modes": 15}}
    job = exmat.precompute.start_bundle(asset, tmp_path / "bar.h5", scene=BAR / "scene.json")
    while job.latest is None and not job.wait(0.05):
        pass
    job.cancel()
    with pytest.raises(exmat.Cancelled):
        job.result()
    assert not (tmp_path / "bar.h5").exists() and threading.active_count() < 5


def test_a_study_is_an_object(bundle, tmp_path):
    study = {"name": "bar", "asset": BAR / "asset.json", "scene": BAR / "scene.json", "steps": 20,
             "sweeps": [{"basis_size": [10], "cubature_elements": [20], "training": ["none"]}], "timing": {"rounds": 1, "steps": 20}}
    result = exmat.precompute.study(study, tmp_path / "study")
    assert result.name == "bar" and len(result.points) == 1 and (result.folder / "report.html").exists()
    assert pathlib.Path(result.folder, "results.json").exists()


def test_a_pack_is_a_model_from_its_file_and_from_bytes(bundle, runtime, tmp_path):
    runtime("pack", bundle, "-o", tmp_path / "bar.exmat")
    pack = (tmp_path / "bar.exmat").read_bytes()
    settings = dict(gravity=(0, 0, -1), example_stiffness=4000, example_bias=0.2)
    bodies = [exmat.Body(exmat.Model(source, **settings)) for source in (bundle, tmp_path / "bar.exmat", pack)]
    bodies.append(exmat.Body(pickle.loads(pickle.dumps(bodies[-1].model))))
    for body in bodies:
        body.step(50)
        assert np.array_equal(body.q, bodies[0].q)
    with pytest.raises(exmat.BadInput, match="the pack in memory: .*cut short by 1 bytes"):
        exmat.Model(pack[:-1])
