"""Surfaces in arrays: object, poses and parts."""
import json
import struct

import numpy as np
import pytest

import exmat
from conftest import BUILD
from exmat.precompute import write_glb

HAS_MESHER = any((BUILD / place / "exmat-mesher.so").exists() for place in ("lib/exmat", "bin"))


def bar_surface(cells=(12, 3, 3), size=(3.0, 0.75, 0.75)):
    """Vertices and triangles of the six sides of a box, joined along its edges."""
    grid = np.stack(np.meshgrid(*(np.arange(count + 1) for count in cells), indexing="ij"), -1).reshape(-1, 3)
    outside = (grid == 0).any(1) | (grid == cells).any(1)
    number = np.where(outside, np.cumsum(outside) - 1, -1)

    def at(corner):
        return number[np.ravel_multi_index(corner, [count + 1 for count in cells])]

    triangles = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cells[axis]):
            for j in range(cells[first]):
                for k in range(cells[second]):
                    quad = []
                    for dj, dk in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        corner = [0, 0, 0]
                        corner[axis], corner[first], corner[second] = side, j + dj, k + dk
                        quad.append(at(corner))
                    quad = quad if side else quad[::-1]
                    triangles += [quad[:3], [quad[0], quad[2], quad[3]]]
    return grid[outside] / cells * size, np.array(triangles)


def bent(vertices, angle=1.0):
    """The bar as an arc in the plane of x and z."""
    radius, x, z = 3.0 / angle, vertices[:, 0], vertices[:, 2]
    turn = x / radius
    return np.stack([(radius - z) * np.sin(turn), vertices[:, 1], radius - (radius - z) * np.cos(turn)], 1)


def test_a_glb_holds_what_was_given(tmp_path):
    vertices, triangles = bar_surface()
    clamp = vertices[:, 0] == 0
    write_glb(tmp_path / "bar.glb", vertices, triangles, {"bow": bent(vertices)}, {"clamp": clamp, "_WEIGHT": 0.25 * vertices[:, 0]})
    data = (tmp_path / "bar.glb").read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON") and size % 4 == 0
    document = json.loads(data[20 : 20 + size])
    binary = data[28 + size :]
    assert document["buffers"][0]["byteLength"] == len(binary) == struct.unpack_from("<I", data, 20 + size)[0]

    def read(number):
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        columns = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        return np.frombuffer(binary, kind, accessor["count"] * columns, view["byteOffset"]).reshape(-1, columns)

    mesh = document["meshes"][0]
    primitive = mesh["primitives"][0]
    assert np.array_equal(read(primitive["attributes"]["POSITION"]), vertices.astype("f4"))
    assert np.array_equal(read(primitive["indices"]).reshape(-1, 3), triangles)
    assert np.array_equal(read(primitive["attributes"]["_clamp"])[:, 0], clamp)
    assert np.array_equal(read(primitive["attributes"]["_WEIGHT"])[:, 0], (0.25 * vertices[:, 0]).astype("f4"))
    assert mesh["extras"]["targetNames"] == ["bow"]
    assert np.array_equal(read(primitive["targets"][0]["POSITION"]), (bent(vertices) - vertices).astype("f4"))


@pytest.mark.skipif(not HAS_MESHER, reason="built without the mesher")
def test_a_surface_in_arrays_becomes_a_bundle(tmp_path):
    vertices, triangles = bar_surface()
    surface = {"vertices": vertices, "triangles": triangles, "parts": {"_FIXED": vertices[:, 0] == 0}}
    asset = {"name": "bar", "object": {"surface": surface, "cells": 400, "fixed": {"part": "_FIXED"},
                                       "material": {"model": "stable_neo_hookean", "youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000}},
             "examples": [{"name": "bow", "surface": bent(vertices)}],
             "basis": {"size": 12, "linear_modes": 6, "training": "none"}, "cubature": {"elements": 24}}
    report = exmat.precompute.bundle(asset, tmp_path / "bar.h5")
    assert [example.name for example in report.examples][-1] == "bow"
    with exmat.Bundle(tmp_path / "bar.h5") as data:
        assert abs(data["render/vertices"][:] - vertices).max() < 1e-6  # single precision
        assert np.array_equal(data["render/triangles"][:], triangles)
        fixed, rest = data["object/fixed"][:].astype(bool), data["object/vertices"][:]
        assert fixed.any() and rest[fixed, 0].max() < 0.5 and rest[~fixed, 0].max() > 2.9
    body = exmat.Body(exmat.Model(tmp_path / "bar.h5"))
    points = exmat.Points.at(body.model, vertices)
    assert abs(body.positions(points) - vertices).max() < 1e-6


def test_bad_surfaces_are_refused(tmp_path):
    vertices, triangles = bar_surface()
    for members, message in (
        ({"object": {"surface": vertices}}, r"object.surface: expected a path or \(vertices, triangles\)"),
        ({"object": {"surface": (vertices, triangles + 1000)}}, r"triangles\[0, 0\] = 1[0-9]{3}: expected a vertex, 0 to"),
        ({"object": {"surface": (vertices, triangles[:0])}}, "triangles: expected at least one"),
        ({"object": {"surface": (vertices * np.nan, triangles)}}, "expected finite numbers"),
        ({"object": {"surface": {"vertices": vertices, "triangles": triangles, "parts": {"_FIXED": [1, 0]}}}}, "part _FIXED: shape"),
        ({"object": {"surface": (vertices, triangles)}, "examples": [{"name": "bow", "surface": vertices[1:]}]}, "pose bow: shape"),
        ({"object": {"surface": "bar.obj"}, "examples": [{"name": "bow", "surface": vertices}]}, "found vertices alone"),
    ):
        with pytest.raises(exmat.InvalidArgument, match=message):
            exmat.precompute.check({"name": "bar", **members})
    with pytest.raises(exmat.BadInput, match="nowhere.obj"):
        exmat.precompute.check({"name": "bar", "object": {"surface": tmp_path / "nowhere.obj"}})
