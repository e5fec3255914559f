#!/usr/bin/python3
"""Bundles of broken surfaces: each is valid, with all of the surface in the tets, or refused for what is wrong with it.

Usage: test_broken_surfaces.py FOLDER_OF_PROGRAMS [COUNT]    (100; the same ones each time)
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

PROGRAMS = pathlib.Path(sys.argv[1])
COUNT = int(sys.argv[2]) if len(sys.argv) > 2 else 100
OUTSIDE = 0.08  # of the diagonal: three quarters of a cell of 400
KEPT_MODES = {"size": 6, "linear_modes": 5, "training": "none"}


def ball(n=14):
    """A unit ball, of squares cut in two."""
    polar, round_ = np.linspace(0, np.pi, n + 1)[1:-1], np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)
    rings = [[(np.sin(p) * np.cos(r), np.sin(p) * np.sin(r), np.cos(p)) for r in round_] for p in polar]
    points = np.array([(0, 0, 1)] + [point for ring in rings for point in ring] + [(0, 0, -1)])
    m, last, triangles = 2 * n, len(points) - 1, []
    at = lambda ring, k: 1 + ring * m + k % m
    for k in range(m):
        triangles += [(0, at(0, k), at(0, k + 1)), (last, at(n - 2, k + 1), at(n - 2, k))]
        for ring in range(n - 2):
            triangles += [(at(ring, k), at(ring + 1, k), at(ring + 1, k + 1)), (at(ring, k), at(ring + 1, k + 1), at(ring, k + 1))]
    return points, np.array(triangles)


def torus(n=24, m=12):
    points = np.array([((1 + 0.35 * np.cos(b)) * np.cos(a), (1 + 0.35 * np.cos(b)) * np.sin(a), 0.35 * np.sin(b))
                       for a in 2 * np.pi * np.arange(n) / n for b in 2 * np.pi * np.arange(m) / m])
    at = lambda i, j: (i % n) * m + j % m
    return points, np.array([t for i in range(n) for j in range(m) for t in
                             ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))])


def limb():
    """A ball drawn out and bent."""
    points, triangles = ball()
    points = points * (2.2, 0.6, 0.5)
    points[:, 2] += 0.2 * points[:, 0] ** 2
    return points, triangles


def holes(rng, points, triangles):
    return points, triangles[rng.random(len(triangles)) > rng.uniform(0.03, 0.15)]


def soup(rng, points, triangles):
    corners = points[triangles].reshape(-1, 3)
    return corners + 1e-4 * rng.standard_normal(corners.shape), np.arange(len(corners)).reshape(-1, 3)


def cut_off(rng, points, triangles):
    direction = rng.standard_normal(3)
    height = points @ direction / np.linalg.norm(direction)
    return points, triangles[(height[triangles] < np.quantile(height, 0.85)).all(1)]


def flipped_and_doubled(rng, points, triangles):
    flipped = np.where(rng.random(len(triangles))[:, None] < 0.3, triangles[:, ::-1], triangles)
    return points, np.concatenate([flipped, flipped[rng.random(len(flipped)) < 0.3]])


def crossing(rng, points, triangles):
    shift = 0.6 * rng.standard_normal(3) / np.sqrt(3)
    return np.concatenate([points, 0.9 * points[:, [1, 2, 0]] + shift]), np.concatenate([triangles, triangles + len(points)])


def two_near(rng, points, triangles):
    gap = np.ptp(points[:, 0]) * 1.002
    return np.concatenate([points, points + (gap, 0, 0)]), np.concatenate([triangles, triangles + len(points)])


def two_far(rng, points, triangles):
    gap = np.ptp(points[:, 0]) * rng.uniform(3, 6)
    return np.concatenate([points, points + (gap, 0, 0)]), np.concatenate([triangles, triangles + len(points)])


def sheet(rng, points, triangles):
    return points * (1, 1, rng.choice([0, 1e-6, 1e-3])), triangles


def needles(rng, points, triangles):
    """Some triangles with a corner more, a hair's breadth beside an edge."""
    chosen = rng.choice(len(triangles), 30, replace=False)
    a, b = points[triangles[chosen, 0]], points[triangles[chosen, 1]]
    tips = (a + b) / 2 + 1e-9 * rng.standard_normal(a.shape)
    numbers = len(points) + np.arange(len(tips))
    extra = np.stack([triangles[chosen, 0], triangles[chosen, 1], numbers], 1)
    return np.concatenate([points, tips]), np.concatenate([triangles, extra])


def fins(rng, points, triangles):
    """Triangles that stand out of edges, which then have three."""
    chosen = rng.choice(len(triangles), 12, replace=False)
    a, b = points[triangles[chosen, 0]], points[triangles[chosen, 1]]
    tips = 1.15 * (a + b) / 2
    numbers = len(points) + np.arange(len(tips))
    extra = np.stack([triangles[chosen, 0], triangles[chosen, 1], numbers], 1)
    return np.concatenate([points, tips]), np.concatenate([triangles, extra])


def tiny(rng, points, triangles):
    return 1e-6 * points, triangles


def huge(rng, points, triangles):
    return 1e6 * points, triangles


def far_away(rng, points, triangles):
    return points + 1e4 * rng.standard_normal(3), triangles


def no_area(rng, points, triangles):
    return points * (1, 0, 0), triangles


def wrong_number(rng, points, triangles):
    broken = triangles.copy()
    broken[rng.integers(len(broken)), 1] = len(points) + 5
    return points, broken


FAULTS = (holes, soup, cut_off, flipped_and_doubled, crossing, two_near, two_far, sheet, needles, fins, tiny, huge, far_away, no_area,
          wrong_number)
# What the message of a refusal names.
REFUSED_FOR = {two_far: "component", no_area: "triangles that have an area", wrong_number: "vertices 1 to"}


def write_obj(path, points, triangles):
    with open(path, "w") as f:
        f.writelines("v %.17g %.17g %.17g\n" % tuple(point) for point in points)
        f.writelines("f %d %d %d\n" % tuple(triangle) for triangle in triangles + 1)


def run(*words):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=120)


def farthest_outside(bundle):
    """Of the surface's vertices from the tets, over the diagonal, by the render mesh's coordinates in its tets, which are tested
    against their positions."""
    tets, vertices = bundle["object/tets"][()], bundle["object/vertices"][()]
    weights, inside = bundle["render/barycentric"][()], bundle["render/tets"][()]
    positions = bundle["render/vertices"][()]
    diagonal = np.linalg.norm(np.ptp(positions, axis=0))
    assert np.abs(np.einsum("vk,vka->va", weights, vertices[tets[inside]]) - positions).max() < 1e-9 * (diagonal + np.abs(positions).max())
    heights = []  # the least height of each tet bounds how far a negative coordinate is outside
    for tet in vertices[tets[inside]]:
        edges = np.linalg.inv((tet[1:] - tet[0]).T)
        gradients = np.concatenate([[-edges.sum(0)], edges])
        heights.append(1 / np.linalg.norm(gradients, axis=1))
    used = np.ones(len(positions), bool)
    used[np.setdiff1d(np.arange(len(positions)), bundle["render/triangles"][()])] = False
    return max((-weights * np.array(heights)).max(1)[used].max(), 0) / diagonal


class BrokenSurfaces(unittest.TestCase):
    def test_each_gives_a_bundle_or_a_reason(self):
        rng = np.random.default_rng(20)
        valid, refused, farthest = 0, 0, 0
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for k in range(COUNT):
                fault = FAULTS[k % len(FAULTS)]
                shape = (ball, torus, limb)[k // len(FAULTS) % 3]
                points, triangles = fault(rng, *shape())
                with self.subTest(number=k, fault=fault.__name__, shape=shape.__name__):
                    write_obj(folder / "s.obj", points, triangles)
                    size = np.ptp(points, axis=0).max()
                    asset = {"name": "s", "basis": KEPT_MODES, "cubature": {"elements": 12, "training_poses": 20},
                             "object": {"surface": "s.obj", "cells": 400, "material": {
                                 "model": "stable_neo_hookean", "youngs_modulus": 1e6 * max(size, 1), "poisson_ratio": 0.4, "density": 1000}}}
                    (folder / "s.json").write_text(json.dumps(asset))
                    (folder / "s.h5").unlink(missing_ok=True)
                    made = run(PROGRAMS / "exmat-precompute", "bundle", folder / "s.json", "-o", folder / "s.h5")
                    last = (made.stderr.strip().splitlines() or [""])[-1]
                    if fault in REFUSED_FOR:
                        self.assertEqual(made.returncode, 2, last)
                        self.assertIn(REFUSED_FOR[fault], last)
                        self.assertFalse((folder / "s.h5").exists())
                        refused += 1
                        continue
                    self.assertEqual(made.returncode, 0, last)
                    checked = run(PROGRAMS / "exmat-runtime", "validate", folder / "s.h5")
                    self.assertEqual(checked.returncode, 0, checked.stderr)
                    with h5py.File(folder / "s.h5") as bundle:
                        outside = farthest_outside(bundle)
                    self.assertLess(outside, OUTSIDE)
                    farthest = max(farthest, outside)
                    valid += 1
        print(f"{COUNT} surfaces: {valid} valid bundles, {refused} refused for what is wrong; the farthest vertex is {farthest:.1g} "
              "of the diagonal outside its tets")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
