#!/usr/bin/python3
"""Pose a Gmsh 2.2 ASCII mesh by an analytic deformation of its vertices; connectivity stays.

Usage: pose.py REST.msh POSED.msh twist DEGREES    total angle from the low to the high end of the longest axis
"""
import sys

import numpy as np


def read_nodes(lines):
    first = lines.index("$Nodes") + 2
    count = int(lines[first - 1])
    rows = [line.split() for line in lines[first : first + count]]
    return first, [row[0] for row in rows], np.array([[float(x) for x in row[1:4]] for row in rows])


def twist(points, degrees):
    """Rotate about the longest axis through the middle of the bounding box, by an angle that grows along it."""
    low, high = points.min(0), points.max(0)
    axis = int(np.argmax(high - low))
    b, c = (axis + 1) % 3, (axis + 2) % 3
    angle = np.radians(degrees) * (points[:, axis] - low[axis]) / (high[axis] - low[axis])
    posed = points.copy()
    y, z = points[:, b] - (low[b] + high[b]) / 2, points[:, c] - (low[c] + high[c]) / 2
    posed[:, b] += y * (np.cos(angle) - 1) - z * np.sin(angle)
    posed[:, c] += y * np.sin(angle) + z * (np.cos(angle) - 1)
    return posed


def main():
    rest, posed, kind, amount = sys.argv[1:]
    lines = open(rest).read().splitlines()
    first, tags, points = read_nodes(lines)
    points = {"twist": twist}[kind](points, float(amount))
    for k, (tag, point) in enumerate(zip(tags, points)):
        lines[first + k] = f"{tag} " + " ".join(f"{x:.12g}" for x in point)
    open(posed, "w").write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
