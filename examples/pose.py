#!/usr/bin/python3
"""Pose a Gmsh 2.2 ASCII mesh by an analytic deformation of its vertices; connectivity stays.

Usage: pose.py REST.msh POSED.msh twist DEGREES           total angle from the low to the high end of the longest axis
       pose.py REST.msh POSED.msh arc|s DEGREES x|y|z     bend the longest axis towards another one; it turns by
                                                          DEGREES from end to end (arc), or to the middle (s)
"""
import sys

import numpy as np


def read_nodes(lines):
    first = lines.index("$Nodes") + 2
    count = int(lines[first - 1])
    rows = [line.split() for line in lines[first : first + count]]
    return first, [row[0] for row in rows], np.array([[float(x) for x in row[1:4]] for row in rows])


def along_longest_axis(points):
    """That axis, the middle of the bounding box, the length, and where each point is along it, from 0 to 1."""
    low, high = points.min(0), points.max(0)
    axis = int(np.argmax(high - low))
    return axis, (low + high) / 2, high[axis] - low[axis], (points[:, axis] - low[axis]) / (high[axis] - low[axis])


def twist(points, degrees):
    """Rotate about the longest axis through the middle of the bounding box, by an angle that grows along it."""
    axis, middle, _, t = along_longest_axis(points)
    b, c = (axis + 1) % 3, (axis + 2) % 3
    angle = np.radians(degrees) * t
    posed = points.copy()
    y, z = points[:, b] - middle[b], points[:, c] - middle[c]
    posed[:, b] += y * (np.cos(angle) - 1) - z * np.sin(angle)
    posed[:, c] += y * np.sin(angle) + z * (np.cos(angle) - 1)
    return posed


def bend(points, towards, slope):
    """Bend the middle line so that it has the angle slope(t) at t; cross-sections stay plane and upright on it."""
    axis, middle, length, t = along_longest_axis(points)
    fine = np.linspace(0, 1, 2001)
    step = length / 2000
    line = [np.cumsum(f(slope((fine[1:] + fine[:-1]) / 2))) * step for f in (np.cos, np.sin)]
    line = [np.interp(t, fine, np.concatenate([[0], x]) - x.mean()) for x in line]
    height = points[:, towards] - middle[towards]
    posed = points.copy()
    posed[:, axis] = middle[axis] + line[0] - height * np.sin(slope(t))
    posed[:, towards] = middle[towards] + line[1] + height * np.cos(slope(t))
    return posed


def main():
    rest, posed, kind, degrees, *towards = sys.argv[1:]
    angle = np.radians(float(degrees))
    lines = open(rest).read().splitlines()
    first, tags, points = read_nodes(lines)
    if kind == "twist":
        points = twist(points, float(degrees))
    else:
        slope = {"arc": lambda t: angle * (0.5 - t), "s": lambda t: -angle / 2 * np.cos(2 * np.pi * t)}[kind]
        points = bend(points, "xyz".index(towards[0]), slope)
    for k, (tag, point) in enumerate(zip(tags, points)):
        lines[first + k] = f"{tag} " + " ".join(f"{x:.12g}" for x in point)
    open(posed, "w").write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
