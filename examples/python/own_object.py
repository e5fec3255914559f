#!/usr/bin/python3
"""An object of one's own, from arrays: a disc of tets, and a saddle and a bowl as its examples. No mesh file is written."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from scipy.spatial import Delaunay  # noqa: E402

import exmat  # noqa: E402
import shared  # noqa: E402

RADIUS, THICKNESS, RINGS = 1.0, 0.16, 8
SAG, KAPPA = 0.5, 2000.0


def disc():
    """Vertices (n, 3) [m] and tets (n_t, 4): triangles of rings, each a prism of three tets, in two layers."""
    rings = [np.zeros((1, 2))]
    for ring in range(1, RINGS + 1):
        angle = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        rings.append(RADIUS * ring / RINGS * np.stack([np.cos(angle), np.sin(angle)], 1))
    flat = np.concatenate(rings)
    triangles = np.sort(Delaunay(flat).simplices, 1)
    layers = [np.column_stack([flat, np.full(len(flat), height)]) for height in THICKNESS * np.array([-0.5, 0, 0.5])]
    tets = []
    for layer in range(2):
        low, high = triangles + layer * len(flat), triangles + (layer + 1) * len(flat)
        a, b, c = low.T
        d, e, f = high.T
        tets += [np.stack(tet, 1) for tet in ((a, b, c, f), (a, b, f, e), (a, e, f, d))]
    vertices, tets = np.concatenate(layers), np.concatenate(tets)
    edges = vertices[tets[:, 1:]] - vertices[tets[:, :1]]
    inside_out = np.linalg.det(edges) < 0
    tets[inside_out] = tets[inside_out][:, [0, 1, 3, 2]]
    return vertices, tets


def posed(vertices, sag):
    """Plates bend about their middle: what is a height z above it goes against the slope."""
    x, y, z = vertices.T
    height, slope_x, slope_y = sag(x, y)
    return np.stack([x - z * slope_x, y - z * slope_y, z + height], 1)


def main():
    given = shared.arguments(__doc__, "own_object.png")
    vertices, tets = disc()
    saddle = posed(vertices, lambda x, y: (SAG * (x**2 - y**2), 2 * SAG * x, -2 * SAG * y))
    bowl = posed(vertices, lambda x, y: (SAG * (x**2 + y**2), 2 * SAG * x, 2 * SAG * y))
    asset = {
        "name": "disc",
        "object": {"mesh": (vertices, tets), "fixed": {"sphere": {"center": [0, 0, 0], "radius": 0.2}},
                   "material": {"model": "stable_neo_hookean", "youngs_modulus": 2e5, "poisson_ratio": 0.4, "density": 1000}},
        "examples": [{"name": "saddle", "mesh": saddle}, {"name": "bowl", "mesh": bowl}],
        "basis": {"size": 24, "training": "none"},
    }
    report = exmat.precompute.bundle(asset, given.folder / "disc.h5", if_changed=True)
    print(f"{len(vertices)} vertices, {len(tets)} tets: {report.status}")
    model = exmat.Model(given.folder / "disc.h5", mass_damping=4, example_stiffness=KAPPA, example_damping=20, example_bias=0)
    points = exmat.Points.all_vertices(model)
    top = slice(2 * len(vertices) // 3, None)
    shapes = {"rest": vertices}
    for name, weights in (("saddle", [0, 1, 0]), ("half of each", [0, 0.5, 0.5]), ("bowl", [0, 0, 1])):
        body = exmat.Body(model)
        body.set_example_weights(weights)
        body.step(2000)
        shapes[name] = body.positions(points)
    figure = plt.figure(figsize=(10, 2.8))
    for place, (name, xyz) in enumerate(shapes.items()):
        axes = figure.add_subplot(1, 4, 1 + place, projection="3d", box_aspect=(2, 2, 1))
        axes.plot_trisurf(*xyz[top].T, triangles=Delaunay(vertices[top, :2]).simplices, cmap="viridis", linewidth=0.2, edgecolor="k")
        axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-0.5, 0.5), title=name)
        axes.set_axis_off()
    shared.save(figure, given.picture)


if __name__ == "__main__":
    main()
