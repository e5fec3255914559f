#!/usr/bin/python3
"""Write mushroom.glb, the surface of docs/artists_tutorial.md: a mushroom, a pose of it, and the part that is clamped."""
import numpy as np
from exmat import precompute

# Radius [m] by height [m]: a stem, and a cap on it; y is up.
outline = np.array([(0.00, 0.16), (0.05, 0.14), (0.30, 0.11), (0.60, 0.10), (0.62, 0.20), (0.63, 0.36), (0.68, 0.40),
                    (0.78, 0.36), (0.88, 0.26), (0.95, 0.13), (0.97, 0.02)])
turns = np.linspace(0, 2 * np.pi, 32, endpoint=False)
along = np.linspace(0, len(outline) - 1, 60)
height, radius = (np.interp(along, range(len(outline)), column) for column in outline.T)
rest = np.stack([np.outer(radius, np.cos(turns)), np.repeat(height[:, None], 32, 1), np.outer(radius, np.sin(turns))],
                -1).reshape(-1, 3)
ring, corner = np.divmod(np.arange(59 * 32), 32)
a, b = 32 * ring + corner, 32 * ring + (corner + 1) % 32
triangles = np.concatenate([np.stack([a, a + 32, b], 1), np.stack([b, a + 32, b + 32], 1)])

x, y, z = rest.T
angle = 0.9 * np.clip(y, 0, 0.6) / 0.6                          # the stem bends along its length, the cap goes with it
bend = lambda s: np.stack([0.6 / 0.9 * (1 - np.cos(s)), 0.6 / 0.9 * np.sin(s)], -1)
middle = bend(angle) + np.clip(y - 0.6, 0, None)[:, None] * np.stack([np.sin(angle), np.cos(angle)], -1)
bow = np.stack([middle[:, 0] + x * np.cos(angle), middle[:, 1] - x * np.sin(angle), z], -1)

precompute.write_glb("mushroom.glb", rest, triangles, {"bow": bow}, {"_FIXED": y < 0.03})
