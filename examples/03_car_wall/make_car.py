#!/usr/bin/python3
"""Write a car of 4 x 1.6 x 1.3 m, nose at low x, wheels on z = 0 (Gmsh 2.2 ASCII): bent cubes of 0.2 m, five tets each.

Usage: make_car.py car.msh
"""
import sys

import numpy as np

EDGE = 0.2  # [m]
# Boxes of cells [low, high) along x, y, z: body, cabin, four wheels.
BODY = ((0, 20), (0, 8), (2, 4))
CABIN = ((6, 16), (0, 8), (4, 6))
WHEELS = [((x, x + 4), (y, y + 2), (0, 2)) for x in (2, 14) for y in (0, 6)]
# The five tets of a cube by corners (bits x, y, z), for cubes of even and, mirrored along x, of odd parity.
FIVE = np.array([[0, 1, 2, 4], [3, 1, 7, 2], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]])


def shape(node):
    """Place of a grid node: round wheels, slanted windows, a nose that slopes."""
    x, y, z = (float(c) for c in node)
    if z < 2:  # lower half of a wheel: squeeze the rectangle towards a half disc
        middle = 4 if x < 10 else 16
        a, b = (x - middle) / 2, (2 - z) / 2
        x, z = middle + 2 * a * np.sqrt(1 - 0.4 * b * b), 2 - 2 * b * np.sqrt(1 - 0.4 * a * a)
    if z > 4:  # cabin: narrower and shorter towards the roof, and less high than its cells
        up = (z - 4) / 2
        x += up * (1.8 * (16 - x) / 10 - 1.2 * (x - 6) / 10)
        y += up * 0.8 * (4 - y) / 4
        z = 4 + 2.5 * up
    elif z > 2:  # the nose slopes and the ends are rounded, seen from above
        z -= 0.5 * (z - 2) / 2 * max(0, 1 - x / 6)
        x += 0.8 * abs(y / 4 - 1) ** 3 * (1 - x / 10) ** 5
    return EDGE * x, EDGE * (y - 4), EDGE * z


def main():
    cells = sorted({(x, y, z) for (x0, x1), (y0, y1), (z0, z1) in [BODY, CABIN, *WHEELS]
                    for x in range(x0, x1) for y in range(y0, y1) for z in range(z0, z1)})
    numbers, tets = {}, []
    for cell in cells:
        odd = sum(cell) % 2
        corners = [tuple(c + (bit >> k & 1 ^ (odd and k == 0)) for k, c in enumerate(cell)) for bit in range(8)]
        ids = [numbers.setdefault(corner, len(numbers) + 1) for corner in corners]
        tets += [[ids[c] for c in tet] for tet in FIVE]
    points = np.array([shape(node) for node in numbers])
    for tet in tets:  # positive volume
        a, b, c, d = points[np.array(tet) - 1]
        if np.linalg.det([b - a, c - a, d - a]) < 0:
            tet[2:] = tet[:1:-1]
    with open(sys.argv[1], "w") as f:
        f.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n")
        f.writelines(f"{k} {x:.6g} {y:.6g} {z:.6g}\n" for k, (x, y, z) in enumerate(points, 1))
        f.write(f"$EndNodes\n$Elements\n{len(tets)}\n")
        f.writelines(f"{k} 4 2 0 1 {a} {b} {c} {d}\n" for k, (a, b, c, d) in enumerate(tets, 1))
        f.write("$EndElements\n")


if __name__ == "__main__":
    main()
