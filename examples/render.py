#!/usr/bin/python3
"""Draw frames of a trajectory side by side, coloured by displacement.

Usage: render.py BUNDLE.h5 TRAJECTORY.h5 PICTURE.png [FRAMES]    (Debian: python3-h5py python3-matplotlib)
"""
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection


def shade(triangles, colours):
    """Lambert shading with a light from the upper left."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
    light = np.array([-0.4, -0.7, 0.6])
    brightness = 0.55 + 0.45 * np.clip(normals @ (light / np.linalg.norm(light)), 0, 1)
    return np.concatenate([colours[:, :3] * brightness[:, None], np.ones((len(colours), 1))], 1)


def draw(axes, positions, rest, surface, largest, title):
    displacement = np.linalg.norm(positions - rest, axis=1)
    colours = plt.cm.viridis(displacement[surface].mean(1) / largest)
    triangles = positions[surface]
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=shade(triangles, colours), edgecolors=(0, 0, 0, 0.15), linewidths=0.3))
    axes.set_title(title, fontsize=9)
    axes.set_axis_off()
    axes.view_init(elev=22, azim=-50)


def main():
    bundle, trajectory, picture = sys.argv[1:4]
    count = int(sys.argv[4]) if len(sys.argv) > 4 else 4
    with h5py.File(bundle) as f:
        rest, surface = f["/object/vertices"][:], f["/object/surface"][:]
    with h5py.File(trajectory) as f:
        frames = np.unique(np.linspace(0, len(f["/time"]) - 1, count).astype(int))
        time, vertices = f["/time"][frames], f["/vertices"][frames]
    largest = max(np.linalg.norm(v - rest, axis=1).max() for v in vertices) or 1
    low, high = vertices.min((0, 1)), vertices.max((0, 1))
    figure = plt.figure(figsize=(3.4 * len(frames), 2.6))
    for k, (t, positions) in enumerate(zip(time, vertices)):
        axes = figure.add_subplot(1, len(frames), k + 1, projection="3d")
        draw(axes, positions, rest, surface, largest, f"t = {t:.2f} s")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1.02)
    figure.tight_layout(pad=0.2)
    figure.savefig(picture, dpi=110)
    print(f"{picture}: {len(frames)} frames, largest displacement {largest:.3g} m")


if __name__ == "__main__":
    main()
