#!/usr/bin/python3
"""Write the tets of a Gmsh 2.2 ASCII mesh, posed by analytic deformations of its vertices; connectivity stays.

Usage: pose.py REST.msh POSED.msh [KIND DEGREES [OPTION=VALUE]...]...    without a deformation: the tets alone, with short numbers

Each deformation acts on the result of the one before, along a line:
  twist     turns about the line by an angle that grows along it to DEGREES (evenly; from a given start smoothly)
  arc       bends the line by DEGREES from end to end
  s         the same, but forth in its first half and back in the second
Options; a direction is x, y, z, -x, -y, -z or X,Y,Z:
  axis=DIRECTION      of the line; absent: the longest of the bounding box
  towards=DIRECTION   that it bends to (arc, s)
  from=X,Y,Z          where it starts. What lies before stays, what lies beyond its end follows rigidly. Absent: the line goes
                      through the middle of the whole body, and the middle stays instead
  length=L            of the line; absent: to the end of the body
  radius=R,FALLOFF    only what is within R of the line (carried on beyond its end) follows, and fades out over FALLOFF
"""
import sys

import numpy as np

TET = 4  # Gmsh's number of the element type
KINDS = ("twist", "arc", "s")
OPTIONS = ("axis", "towards", "from", "length", "radius")


def read(path):
    """Vertices [n x 3] and tets [n_t x 4, from 0] of a mesh; vertices without a tet are left out."""
    with open(path) as f:
        lines = f.read().splitlines()
    first = lines.index("$Nodes") + 2
    rows = [line.split() for line in lines[first : first + int(lines[first - 1])]]
    number = {row[0]: k for k, row in enumerate(rows)}
    points = np.array([[float(x) for x in row[1:4]] for row in rows])
    first = lines.index("$Elements") + 2
    elements = [line.split() for line in lines[first : first + int(lines[first - 1])]]
    tets = np.array([[number[node] for node in row[-4:]] for row in elements if int(row[1]) == TET])
    used, tets = np.unique(tets, return_inverse=True)
    return points[used], tets.reshape(-1, 4)


def write(path, points, tets):
    with open(path, "w") as f:
        f.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n")
        f.writelines(f"{k} " + " ".join(f"{c:.6g}" for c in point) + "\n" for k, point in enumerate(points + 0.0, 1))
        f.write(f"$EndNodes\n$Elements\n{len(tets)}\n")
        f.writelines(f"{k} {TET} 0 " + " ".join(map(str, tet)) + "\n" for k, tet in enumerate(tets + 1, 1))
        f.write("$EndElements\n")


def numbers(text):
    return np.array([float(x) for x in text.split(",")])


def direction(text):
    letter = text[-1]
    vector = np.eye(3)["xyz".index(letter)] * (-1 if text[0] == "-" else 1) if letter in "xyz" else numbers(text)
    return vector / np.linalg.norm(vector)


def smooth_step(t):
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def line_through(points, options):
    """Start, unit axis and length of the line, and whether it is that of the whole body."""
    low, high = points.min(0), points.max(0)
    axis = direction(options["axis"]) if "axis" in options else np.eye(3)[np.argmax(high - low)]
    whole = "from" not in options
    start = (low + high) / 2 if whole else numbers(options["from"])
    along = (points - start) @ axis
    if whole:
        start = start + along.min() * axis
    return start, axis, float(options.get("length", along.max() - (along.min() if whole else 0))), whole


def turn(across, angle, axis):
    """Turn vectors that are normal to the axis about it, each by its angle."""
    return across * np.cos(angle)[:, None] + np.cross(axis, across) * np.sin(angle)[:, None]


def twisted(along, across, length, angle, axis, whole):
    t = along / length
    return along[:, None] * axis + turn(across, angle * (np.clip(t, 0, 1) if whole else smooth_step(t)), axis)


def bent(along, across, length, slope, axis, towards, whole):
    """Bend the line so that it has the angle slope(t) to the axis at t = 0..1; cross-sections stay plane and upright on it."""
    fine = np.linspace(0, 1, 2001)
    if whole:  # on average it keeps its direction and place
        middle = slope((fine[1:] + fine[:-1]) / 2).mean()
        held = lambda t: slope(t) - middle
    else:
        held = slope
    line = [np.concatenate([[0], np.cumsum(f(held((fine[1:] + fine[:-1]) / 2)))]) * length / 2000 for f in (np.cos, np.sin)]
    if whole:
        line = [line[0] - line[0].mean() + length / 2, line[1] - line[1].mean()]
    t = np.clip(along / length, 0, 1)
    cos, sin, beyond = np.cos(held(t)), np.sin(held(t)), along - length * t
    height = across @ towards
    on_axis = np.interp(t, fine, line[0]) + beyond * cos - height * sin
    on_towards = np.interp(t, fine, line[1]) + beyond * sin + height * cos
    return on_axis[:, None] * axis + on_towards[:, None] * towards + across - height[:, None] * towards


def deformed(points, kind, degrees, options):
    start, axis, length, whole = line_through(points, options)
    angle = np.radians(degrees)
    along = (points - start) @ axis
    across = points - start - along[:, None] * axis
    if kind == "twist":
        posed = twisted(along, across, length, angle, axis, whole)
    else:
        slope = {"arc": lambda t: angle * t, "s": lambda t: angle * np.sin(np.pi * t) ** 2}[kind]
        towards = direction(options["towards"])
        towards = towards - (towards @ axis) * axis
        posed = bent(along, across, length, slope, axis, towards / np.linalg.norm(towards), whole)
    if "radius" not in options:
        return start + posed
    radius, falloff = numbers(options["radius"])
    distance = np.linalg.norm(across + np.minimum(along, 0)[:, None] * axis, axis=1)
    share = 1 - smooth_step((distance - radius) / falloff)
    return points + share[:, None] * (start + posed - points)


def deformations(words):
    """(kind, degrees, options) of each deformation on a command line."""
    while words:
        kind, degrees = words.pop(0), words.pop(0) if words else ""
        options = {}
        while words and "=" in words[0]:
            name, value = words.pop(0).split("=")
            options[name] = value
        if kind not in KINDS:
            sys.exit(f"pose.py: no deformation {kind}; there are {', '.join(KINDS)}")
        if strange := set(options) - set(OPTIONS):
            sys.exit(f"pose.py: no option {strange.pop()}; there are {', '.join(OPTIONS)}")
        if kind != "twist" and "towards" not in options:
            sys.exit(f"pose.py: {kind} needs towards=DIRECTION")
        try:
            yield kind, float(degrees), options
        except ValueError:
            sys.exit(f"pose.py: {kind}: expected degrees, found {degrees or 'nothing'}")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    points, tets = read(sys.argv[1])
    for kind, degrees, options in deformations(sys.argv[3:]):
        points = deformed(points, kind, degrees, options)
    write(sys.argv[2], points, tets)


if __name__ == "__main__":
    main()
