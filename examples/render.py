#!/usr/bin/python3
"""Draw frames of a trajectory side by side, coloured by displacement (of a free body: without its rigid motion).

Usage: render.py BUNDLE.h5 TRAJECTORY.h5 PICTURE.png [FRAMES] [--scene SCENE.json]
(Debian: python3-h5py python3-matplotlib). With the scene, its obstacles are drawn too, those that do not move.
"""
import argparse
import itertools
import json

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection


def shade(triangles, colours):
    """Lambert shading with a light from the upper left."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
    light = np.array([-0.4, -0.7, 0.6])
    brightness = 0.55 + 0.45 * np.clip(normals @ (light / np.linalg.norm(light)), 0, 1)
    return np.concatenate([colours[:, :3] * brightness[:, None], np.ones((len(colours), 1))], 1)


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def polygons_of(obstacle, low, high):
    """Polygons of an obstacle; a plane is cut off at the box low..high, which all others may leave."""
    if "plane" in obstacle:
        normal = np.array(obstacle["plane"]["normal"], float)
        normal /= np.linalg.norm(normal)
        point = np.array(obstacle["plane"].get("point", [0, 0, 0]), float)
        axis = int(np.argmax(abs(normal)))
        b, c = (axis + 1) % 3, (axis + 2) % 3
        corners = np.zeros((4, 3))
        corners[:, b], corners[:, c] = [low[b], high[b], high[b], low[b]], [low[c], low[c], high[c], high[c]]
        corners[:, axis] = ((point - corners) @ normal) / normal[axis]
        return corners[None]
    if "box" in obstacle:
        box = obstacle["box"]
        square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
        cube = np.array([np.roll(square * sign, k, 1) for k in range(3) for sign in (-1, 1)]) * box["half_extents"]
        return cube @ rotation(box.get("orientation", [1, 0, 0, 0])).T + box.get("center", [0, 0, 0])
    ball = obstacle.get("sphere") or obstacle["capsule"]
    start = np.array(ball.get("start", ball.get("center", [0, 0, 0])), float)
    end = np.array(ball.get("end", start), float)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    unit = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1)
    grid = np.where((unit @ (end - start) > 0)[..., None], end, start) + ball["radius"] * unit
    return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], 2).reshape(-1, 4, 3)


def draw(axes, positions, displacement, surface, largest, title):
    colours = plt.cm.viridis(displacement[surface].mean(1) / largest)
    triangles = positions[surface]
    style = {"edgecolors": (0, 0, 0, 0.15), "linewidths": 0.3, "zorder": 2}
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=shade(triangles, colours), **style))
    axes.set_title(title, fontsize=9)
    axes.set_axis_off()
    axes.view_init(elev=22, azim=-50)


def fit(axes, low, high):
    """Limits, true proportions, and the zoom at which the box low..high fills the axes."""
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    zoom = 1
    for _ in range(3):
        axes.set_box_aspect(high - low, zoom=zoom)
        corners = np.array(list(itertools.product(*zip(low, high))))
        flat = np.array(proj3d.proj_transform(*corners.T, axes.get_proj())[:2])
        zoom *= 0.98 / max(abs(flat).max(1) / [axes.viewLim.x1, axes.viewLim.y1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("bundle", "trajectory", "picture"):
        parser.add_argument(name)
    parser.add_argument("frames", type=int, nargs="?", default=4)
    parser.add_argument("--scene")
    a = parser.parse_args()
    with h5py.File(a.bundle) as f:
        rest, surface = f["/object/vertices"][:], f["/object/surface"][:]
        centre = f["/rigid/centre_of_mass"][:] if "rigid" in f else None
    with h5py.File(a.trajectory) as f:
        frames = np.unique(np.linspace(0, len(f["/time"]) - 1, a.frames).astype(int))
        time, vertices = f["/time"][frames], f["/vertices"][frames]
        bodies = f["/body/position"][frames], f["/body/orientation"][frames]
    displacements = []
    for positions, c, turn in zip(vertices, *bodies):
        local = positions if centre is None else (positions - centre - c) @ rotation(turn) + centre
        displacements.append(np.linalg.norm(local - rest, axis=1))
    largest = np.max(displacements) or 1
    low, high = vertices.min((0, 1)), vertices.max((0, 1))
    obstacles = json.load(open(a.scene)).get("obstacles", []) if a.scene else []
    obstacles = [polygons_of(x, low, high) for x in obstacles if not x.get("motion")]
    for polygons in obstacles:
        low, high = np.minimum(low, polygons.min((0, 1))), np.maximum(high, polygons.max((0, 1)))
    figure = plt.figure(figsize=(3.4 * len(frames), 2.6))
    for k, (t, positions, displacement) in enumerate(zip(time, vertices, displacements)):
        axes = figure.add_subplot(1, len(frames), k + 1, projection="3d", computed_zorder=False)
        for polygons in obstacles:
            grey = {"facecolors": (0.6, 0.6, 0.65, 0.35), "edgecolors": (0, 0, 0, 0.2), "linewidths": 0.3}
            axes.add_collection3d(Poly3DCollection(polygons, **grey))
        draw(axes, positions, displacement, surface, largest, f"t = {t:.2f} s")
        fit(axes, low, high)
    figure.tight_layout(pad=0.2)
    figure.savefig(a.picture, dpi=110)
    print(f"{a.picture}: {len(frames)} frames, largest displacement {largest:.3g} m")


if __name__ == "__main__":
    main()
