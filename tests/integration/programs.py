"""What tests of programs share: a mesh, a surface, and runs that have to end as they should."""
import itertools
import json
import subprocess
from pathlib import Path

import numpy as np


def bar():
    """Text of a .veg file: 8 x 2 x 2 cubes of six tets each, 4 m long; and the vertices at x = 0, 0-based."""
    number = {place: k + 1 for k, place in enumerate(itertools.product(range(9), range(3), range(3)))}
    tets = []
    for cell in itertools.product(range(8), range(2), range(2)):
        for order in itertools.permutations(range(3)):
            place, path = list(cell), [number[cell]]
            for axis in order:
                place[axis] += 1
                path.append(number[tuple(place)])
            tets.append(path)
    lines = ["*VERTICES", f"{len(number)} 3 0 0"] + [f"{k} {0.5 * x} {0.5 * y} {0.5 * z}" for (x, y, z), k in number.items()]
    lines += ["*ELEMENTS", "TET", f"{len(tets)} 4 0"] + [" ".join(map(str, [k + 1, *tet])) for k, tet in enumerate(tets)]
    return "\n".join(lines) + "\n", [k - 1 for (x, _, _), k in number.items() if x == 0]


def tube(length=3.0, steps=24, around=16):
    """A closed round tube along x, 1 m thick: points and triangles."""
    rings = [(0.0, 0.0)] + [(length * k / steps, 0.5) for k in range(steps + 1)] + [(length, 0.0)]
    angles = 2 * np.pi * np.arange(around) / around
    points = np.array([[x, r * np.cos(a), r * np.sin(a)] for x, r in rings[1:-1] for a in angles] + [[0, 0, 0], [length, 0, 0]])
    start, end = len(points) - 2, len(points) - 1
    at = lambda ring, k: around * ring + k % around
    triangles = [t for k in range(around) for t in
                 ([(start, at(0, k + 1), at(0, k)), (end, at(steps, k), at(steps, k + 1))]
                  + [t for ring in range(steps) for t in ((at(ring, k), at(ring, k + 1), at(ring + 1, k + 1)),
                                                          (at(ring, k), at(ring + 1, k + 1), at(ring + 1, k)))])]
    return points, np.array(triangles)


def write_bar(folder):
    """bar.veg, and end.txt with the vertices of its end."""
    mesh, clamp = bar()
    (folder / "bar.veg").write_text(mesh)
    (folder / "end.txt").write_text("\n".join(str(k + 1) for k in clamp))


def write_json(file, content):
    Path(file).write_text(json.dumps(content))
    return file


def call(*words, status=0, **options):
    """What a program prints, of a run that ends with this status: its messages where that is not 0."""
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    assert done.returncode == status, f"{words}: status {done.returncode}, expected {status}\n{done.stdout}{done.stderr}"
    return done.stdout if status == 0 else done.stderr
