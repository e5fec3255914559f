"""The teddy's hug stops at its own body: contact of a body with itself, judged by every tet and every triangle."""
import sys

import numpy as np
import pytest

import exmat
from conftest import ROOT

sys.path.insert(0, str(ROOT / "examples/tools"))
import pose  # noqa: E402

STIFFNESS = 1000  # of the example [1/s^2]
FAR = 0.3  # what is nearer to a vertex at rest is its own part of the body: folds are not meant [m]


class Teddy:
    """Its mesh, and a pose in which both arms bend down and through the belly."""

    def __init__(self):
        self.rest, self.tets = pose.read(ROOT / "examples/07_teddy_global/object.msh")
        self.posed = self.rest
        for side in (1, -1):
            arm = {"axis": f"{0.93 * side},0,-0.37", "from": f"{0.35 * side},-0.05,1.21", "length": "0.6", "towards": "0,-0.5,-1", "radius": "0.2,0.25"}
            self.posed = pose.deformed(self.posed, "arc", 190, arm)
        faces = np.concatenate([self.tets[:, corners] for corners in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3])])
        _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
        self.surface = faces[first[count == 1]]

    def inside(self, x):
        """Depths of the surface's vertices that are inside a tet of another part of the body [m]."""
        corner = x[self.tets[:, 0]]
        to_shares = np.linalg.inv(np.stack([x[self.tets[:, k]] - corner for k in (1, 2, 3)], 2))
        depths = []
        for vertex in np.unique(self.surface):
            far = self.is_far(self.tets, vertex)
            shares = np.einsum("tij,tj->ti", to_shares[far], x[vertex] - corner[far])
            if ((shares > 0).all(1) & (shares.sum(1) < 1)).any():
                depths.append(nearest(x[vertex], x[self.surface[self.is_far(self.surface, vertex)]]))
        return depths

    def is_far(self, cells, vertex):
        return np.linalg.norm(self.rest[cells].mean(1) - self.rest[vertex], axis=1) > FAR


def nearest(point, triangles):
    """Least distance of a point from triangles (f, 3, 3): from the planes of those that it is above, from all edges."""
    corners = [triangles[:, k] for k in range(3)]
    edges = [(corners[k], corners[(k + 1) % 3]) for k in range(3)]
    normals = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    heights = np.einsum("ij,ij->i", point - corners[0], normals)
    above = np.all([np.einsum("ij,ij->i", np.cross(end - start, point - start), normals) >= 0 for start, end in edges], axis=0)
    distances = [np.abs(heights[above]).min(initial=np.inf)]
    for start, end in edges:
        share = np.einsum("ij,ij->i", point - start, end - start) / np.einsum("ij,ij->i", end - start, end - start)
        distances.append(np.linalg.norm(point - start - np.clip(share, 0, 1)[:, None] * (end - start), axis=1).min())
    return min(distances)


@pytest.fixture(scope="module")
def teddy():
    return Teddy()


@pytest.fixture(scope="module")
def hug(teddy, bundle, folder):
    asset = {
        "name": "teddy",
        "object": {"mesh": (teddy.rest, teddy.tets), "formulation": "linear",  # the depths are those of its stiffness
                   "fixed": {"box": {"min": [-0.4, 0.3, 0.5], "max": [0.4, 0.5, 1.4]}},
                   "material": {"model": "stable_neo_hookean", "youngs_modulus": 1e5, "poisson_ratio": 0.4, "density": 300}},
        "shape_space": {"eigenfunctions": 30},
        "examples": [{"name": "rest", "mesh": (teddy.rest, teddy.tets), "rest": True}, {"name": "hug", "mesh": teddy.posed}],
        "alignment": {"frame": "shared"},
        "basis": {"size": 40, "linear_modes": 10, "training": "none"},
        "cubature": {"elements": 40},
        "internal_force": "cubature",
        "needs": ["examples", "contact"],
    }
    exmat.precompute.bundle(asset, folder / "hug.h5")
    return folder / "hug.h5"


def depths_at_the_end(teddy, hug, stiffness, self_contact):
    """Pulled to the pose alone, until it lies still."""
    world = exmat.World.from_scene({
        "bodies": [{"name": "teddy", "bundle": hug, "examples": {"stiffness": STIFFNESS, "damping": 20, "weights": [0, 1]}}],
        "contact": {"stiffness": stiffness, "damping": stiffness / 100, "self": self_contact},
        "damping": {"mass": 1, "stiffness": 0.01}, "time_step": 0.004})
    assert world.step(250, threads=1).unconverged_islands == 0
    body = world[0]
    assert body.energies.kinetic < 1e-2 * body.energies.elastic
    return teddy.inside(body.positions(exmat.Points.all_vertices(body.model)).astype(float))


def test_inside_and_nearest_are_what_they_say(teddy):
    assert teddy.inside(teddy.rest) == []
    assert len(teddy.inside(teddy.posed)) > 30
    triangle = np.array([[[0, 0, 0], [2, 0, 0], [0, 2, 0]]], float)
    for point, distance in (((0.5, 0.5, 3), 3), ((-3, 0, 4), 5), ((2, 2, 0), np.sqrt(2)), ((1, -2, 0), 2)):
        assert nearest(np.array(point, float), triangle) == pytest.approx(distance)


def test_a_hug_goes_through_the_body_without_contact(teddy, hug):
    depths = depths_at_the_end(teddy, hug, 1e7, False)
    assert len(depths) > 25 and max(depths) > 0.12


# 1e7 N/m^3 gives way to the pull by nine millimetres (half as much again is allowed), three times as stiff a surface by a third of that.
@pytest.mark.parametrize("stiffness, deepest", [(1e7, 0.015), (3e7, 0.005)])
def test_a_hug_stops_at_the_body(teddy, hug, stiffness, deepest):
    depths = depths_at_the_end(teddy, hug, stiffness, True)
    assert len(depths) <= 4 and max(depths, default=0) <= deepest
