#!/usr/bin/python3
"""Malformed and mistaken inputs: each is right, warned of or refused with a reason that is true.

Usage: test_mistakes.py FOLDER_OF_PROGRAMS [--all] [--page PAGE.md]    a share of them, or all, with counts; these renew a page
"""
import collections
import itertools
import json
import os
import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PROGRAM = Path(sys.argv[1]).resolve() / "exmat-precompute"
ALL = "--all" in sys.argv
PAGE = Path(sys.argv[sys.argv.index("--page") + 1]) if "--page" in sys.argv else None
SHARE = 18  # one of so many is tried by default
BEGIN, END = "<!-- mistakes: begin -->", "<!-- mistakes: end -->"
RIGHT, WARNED, REFUSED = "right", "warned", "refused"
MESH_TURN = 2.0


class Mesh:
    def __init__(self, vertices, tets):
        self.vertices, self.tets = np.array(vertices, float), np.array(tets, int)

    def moved(self, function):
        return Mesh([function(x) for x in self.vertices], self.tets)

    def scaled(self, factor):
        return Mesh(self.vertices * factor, self.tets)

    def turned(self, rotation):
        return Mesh(self.vertices @ np.array(rotation).T, self.tets)

    def mirrored(self, mended=True):
        tets = self.tets[:, [1, 0, 2, 3]] if mended else self.tets
        return Mesh(self.vertices * [1, 1, -1], tets)

    def without(self, hole):
        kept = [t for t in self.tets if not hole(self.vertices[t].mean(axis=0))]
        used = sorted({v for t in kept for v in t})
        number = {v: k for k, v in enumerate(used)}
        return Mesh(self.vertices[used], [[number[v] for v in t] for t in kept])

    def text(self):
        lines = ["*VERTICES", f"{len(self.vertices)} 3 0 0"]
        lines += [f"{k} {x[0]:.10g} {x[1]:.10g} {x[2]:.10g}" for k, x in enumerate(self.vertices, 1)]
        lines += ["*ELEMENTS", "TET", f"{len(self.tets)} 4 0"]
        return "\n".join(lines + [" ".join(map(str, [k, *(t + 1)])) for k, t in enumerate(self.tets, 1)]) + "\n"


def box(cells, lengths):
    corner = {place: k for k, place in enumerate(itertools.product(*(range(n + 1) for n in cells)))}
    vertices = [[length * x / n for x, n, length in zip(place, cells, lengths)] for place in corner]
    tets = []
    for origin in itertools.product(*map(range, cells)):
        for order in itertools.permutations(range(3)):
            place, path = list(origin), [corner[origin]]
            for axis in order:
                place[axis] += 1
                path.append(corner[tuple(place)])
            odd = order in ((0, 2, 1), (1, 0, 2), (2, 1, 0))
            tets.append([path[1], path[0], *path[2:]] if odd else path)
    return Mesh(vertices, tets)


def body(cells=(10, 5, 2)):
    """A bar with an arm that no rotation and no mirror lays upon itself."""
    return box(cells, (4, 2, 0.6)).without(lambda x: x[1] > 0.8 and (x[0] < 2.4 or x[0] > 3.2 or x[2] > 0.3))


def armless(mesh):
    return mesh.without(lambda x: x[1] > 0.8)


def bent(angle):
    def move(x):
        radius = 4 / angle
        turn = (x[0] - 2) / radius
        return [(radius - x[2]) * np.sin(turn), x[1], radius - (radius - x[2]) * np.cos(turn)]
    return move


def rotation(axis, angle):
    axis = np.array(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Case:
    """Files of an asset, what may come of it, and what a message of it says."""

    def __init__(self, kind, allowed, reason="", **changes):
        self.kind, self.allowed, self.reason = kind, allowed, reason
        strength = changes.pop("strength", 0.9)
        self.object = changes.pop("object", body())
        self.rest = changes.pop("rest", body())
        self.pose = changes.pop("pose", None) or self.rest.moved(bent(strength))
        self.files = changes.pop("files", {})  # name: text, or a function of the text that would be there
        self.edit = changes.pop("edit", lambda asset: asset)
        assert not changes, changes

    def write(self, folder):
        asset = {"name": "case", "object": {"mesh": "object.veg", "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000}},
                 "examples": [{"name": "rest", "mesh": "rest.veg", "rest": True}, {"name": "pose", "mesh": "pose.veg"}],
                 "shape_space": {"eigenfunctions": 15}}
        files = {"object.veg": self.object.text(), "rest.veg": self.rest.text(), "pose.veg": self.pose.text()}
        files["asset.json"] = json.dumps(self.edit(asset))
        for name, text in self.files.items():
            files[name] = text(files[name]) if callable(text) else text
        for name, text in files.items():
            if isinstance(text, bytes):
                (folder / name).write_bytes(text)
            elif text is not None:
                (folder / name).write_text(text)

    def run(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            self.write(folder)
            command = [PROGRAM, "check", folder / "asset.json"]
            done = subprocess.run(command, capture_output=True, text=True, timeout=300, env={**os.environ, "OMP_NUM_THREADS": "1"})
        said = done.stdout + done.stderr
        if done.returncode == 0:
            of_inputs = re.sub(r".*times as stiff as its material.*", "", said)  # what any coarse mesh is
            outcome = WARNED if re.search(r"warn", of_inputs, re.I) else RIGHT
        else:
            outcome = REFUSED if done.returncode in (1, 2) else f"exit status {done.returncode}"
        faults = []
        if outcome not in self.allowed:
            faults.append(f"{outcome}, expected {' or '.join(self.allowed)}")
        if outcome != RIGHT and self.reason and not re.search(self.reason, said, re.I):
            faults.append("the reason is not among: " + self.reason)
        if re.search(r"PETSC ERROR|MPI_ABORT|terminate called|Sanitizer", said):
            faults.append("it crashed")
        return outcome, faults, said


def scales(draw):
    units = [10, 100, 1000, 25.4, 0.1, 0.01, 0.001]
    own, other = body(), body((10, 10, 4))
    for _ in range(3):
        for unit in units:
            angle = draw.uniform(0.5, 1.2)
            yield Case("examples in another unit", (RIGHT, WARNED), "size|unit|large|small", rest=own.scaled(unit), strength=1,
                       pose=own.moved(bent(angle)).scaled(unit))
            yield Case("a pose of the rest example's mesh in another unit", (REFUSED,), "unit of length", pose=own.moved(bent(angle)).scaled(unit))
            yield Case("a pose of another mesh in another unit", (RIGHT, WARNED), "unit|volume|size", pose=other.moved(bent(angle)).scaled(unit))
        yield Case("a pose at no unit's scale", (WARNED, REFUSED), "times as large|volume|size|unit",
                   pose=other.moved(bent(0.8)).scaled(draw.uniform(4, 8)))
    for exponent in range(-6, 7):
        for _ in range(3):
            factor = draw.uniform(1, 9.9) * 10**exponent
            yield Case("everything scaled by 1e-6 to 1e6", (RIGHT, WARNED), "large|small|size|stiff|light|heavy|unit|material",
                       object=own.scaled(factor), rest=own.scaled(factor), pose=own.moved(bent(0.9)).scaled(factor))


def frames(draw):
    own, other = body(), body((10, 10, 4))
    shared = {"alignment": {"frame": "shared"}}
    for axis in np.eye(3):
        for quarters in (1, 2, 3):
            turn = rotation(axis, quarters * np.pi / 2)
            for mesh in (own, other):
                pose = mesh.moved(bent(draw.uniform(0.5, 1))).turned(turn)
                yield Case("examples with another axis up", (RIGHT, WARNED), "turned|doubt|fit", rest=own.turned(turn), pose=pose)
                yield Case("the same in a shared frame", (REFUSED, WARNED), "turned|stand|fit|doubt|from what was found", rest=own.turned(turn), pose=pose,
                           edit=lambda asset: {**asset, **shared})
    for _ in range(12):
        pose = other.moved(bent(draw.uniform(0.5, 1))).turned(rotation([draw.gauss(0, 1) for _ in range(3)], draw.uniform(1.6, 3)))
        yield Case("a pose alone turned", (RIGHT, WARNED, REFUSED), "turned|doubt|fit|frame|what was found|shrinks|surface", pose=pose)
    for _ in range(10):
        angle = draw.uniform(0.5, 1.2)
        for mesh in (own, other):
            yield Case("mirrored examples", (REFUSED,), "mirror", rest=own.mirrored(), pose=mesh.moved(bent(angle)).mirrored())
        yield Case("mirrored, their tets inside out", (REFUSED,), "inside out|negative|orient|volume|inverted", rest=own.mirrored(False))


def parts(draw):
    own, other = body(), body((10, 10, 4))
    for _ in range(8):
        angle = draw.uniform(0.5, 1.2)
        yield Case("a pose without the arm", (WARNED, REFUSED), "parts", pose=armless(other).moved(bent(angle)))
        yield Case("a rest example without the arm", (WARNED, REFUSED), "parts|volume|size", rest=armless(own), pose=armless(own).moved(bent(angle)))
        side = draw.uniform(1, 2)
        yield Case("another body for a pose", (REFUSED, WARNED), "body|volume|doubt|fit|parts|what was found|size",
                   pose=box((5, 5, 5), (side, side, side)))
    for _ in range(5):
        yield Case("the rest pose for a pose", (REFUSED,), "rest pose", pose=own)
        turn = rotation([1, 2, draw.uniform(1, 3)], draw.uniform(0.2, 1))
        yield Case("the rest pose, turned, for a pose", (REFUSED,), "rest pose", pose=own.turned(turn))
        shaken = Mesh(own.vertices + [[draw.uniform(-0.3, 0.3) for _ in range(3)] for _ in own.vertices], own.tets)
        yield Case("a pose of turned-out tets", (REFUSED, WARNED), "inside out|inverted|volume", pose=shaken)


def topology(draw):
    own = body()
    drop = lambda name: lambda asset: {**asset, "object": {**asset["object"], "drop": [name]}}
    stray = lambda mesh: Mesh(np.vstack([mesh.vertices, [[draw.uniform(0, 4), draw.uniform(0, 1), 0.1]]]), mesh.tets)
    far = lambda mesh, place: Mesh(np.vstack([mesh.vertices, mesh.vertices[own.tets[0]] + place]),
                                   np.vstack([mesh.tets, np.arange(4) + len(mesh.vertices)]))
    for _ in range(8):
        yield Case("an unused vertex", (REFUSED,), "vert.*(no tet|not|unreferenced|unused)|unreferenced", object=stray(own), rest=own)
        yield Case("an unused vertex, dropped", (RIGHT, WARNED), "", object=stray(own), rest=own, edit=drop("unreferenced_vertices"))
        place = [draw.uniform(6, 20), 0, 0]
        yield Case("two components", (REFUSED,), "component|connected", object=far(own, place), rest=own)
        yield Case("two components, one dropped", (RIGHT, WARNED), "", object=far(own, place), rest=own, edit=drop("smaller_components"))
        shattered = Mesh(own.vertices[own.tets.reshape(-1)], np.arange(own.tets.size).reshape(-1, 4))
        yield Case("vertices of each tet its own", (REFUSED,), "component|connected|coinc|duplicate", object=shattered, rest=own)
        twice = Mesh(own.vertices, np.vstack([own.tets, own.tets[draw.randrange(len(own.tets))]]))
        yield Case("a tet that is there twice", (REFUSED, WARNED), "twice|same|duplicate|face|tet", object=twice, rest=own)
    for height in (1e-2, 1e-4, 1e-5, 1e-7, 1e-9, 1e-12, 0):
        for _ in range(4):
            flat = Mesh(own.vertices, own.tets)
            tet = flat.tets[draw.randrange(len(flat.tets))]
            a, b, c, d = flat.vertices[tet]
            normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
            apex = (d + (height - np.dot(d - a, normal)) * normal) if np.dot(d - a, normal) > 0 else d + (-height - np.dot(d - a, normal)) * normal
            flat.vertices[tet[3]] = apex
            yield Case("slivers of heights 1e-2 to 0", (RIGHT, WARNED, REFUSED), "volume|flat|degenerate|sliver|quality|inside out|inverted|rest pose", object=flat,
                       rest=flat, pose=flat.moved(bent(0.8)))


def malformed(draw):
    lines_of = lambda text: text.splitlines()

    def cut(text):
        return text[:draw.randrange(30, len(text) - 8)]

    def letter(text):
        lines = lines_of(text)
        lines[draw.randrange(2, len(lines) // 4)] = "1 x 0 0"
        return "\n".join(lines)

    def beyond(text):
        lines = lines_of(text)
        at = draw.randrange(len(lines) * 3 // 4, len(lines))
        lines[at] = lines[at].rsplit(" ", 1)[0] + f" {draw.choice([0, -3, 100000, 2**40])}"
        return "\n".join(lines)

    def not_finite(text):
        lines = lines_of(text)
        at = draw.randrange(2, len(lines) // 5)
        lines[at] = lines[at].rsplit(" ", 1)[0] + " " + draw.choice(["nan", "inf", "1e999"])
        return "\n".join(lines)

    def same_corner(text):
        lines = lines_of(text)
        number, a, _, c, d = lines[-1].split()
        lines[-1] = " ".join([number, a, a, c, d])
        return "\n".join(lines)

    for _ in range(5):
        for name in ("object.veg", "rest.veg", "pose.veg"):
            for fault, change in (("a file that ends early", cut), ("a letter for a number", letter), ("a corner that is no vertex", beyond),
                                  ("a coordinate that is no number", not_finite), ("a corner twice in a tet", same_corner)):
                yield Case(fault, (REFUSED,), name.replace(".", r"\."), files={name: change})
    for name in ("object.veg", "rest.veg", "pose.veg"):
        yield Case("an empty file", (REFUSED,), name, files={name: ""})
        yield Case("no file", (REFUSED,), name, files={name: None})


def assets(draw):
    material = lambda **change: lambda asset: {**asset, "object": {**asset["object"], "material": {**asset["object"]["material"], **change}}}
    landmarks = lambda method="auto": lambda asset: {**asset, "alignment": {"landmarks": "landmarks.txt", "method": method}}
    for value in (-1, 0, "stiff", None):
        yield Case("a material that is none", (REFUSED,), "youngs_modulus", edit=material(youngs_modulus=value))
        yield Case("a material that is none", (REFUSED,), "density", edit=material(density=value))
    for value in (0.5, 0.6, -1, 2, "high"):
        yield Case("a material that is none", (REFUSED,), "poisson", edit=material(poisson_ratio=value))
    for member in ("objects", "example", "shapespace", "frame"):
        yield Case("a member that is unknown", (REFUSED,), member, edit=lambda asset, member=member: {**asset, member: 1})
    for member in ("name", "object"):
        yield Case("a member that is missing", (REFUSED,), member, edit=lambda asset, member=member: {k: v for k, v in asset.items() if k != member})
    for _ in range(6):
        yield Case("an asset that ends early", (REFUSED,), "asset.json", files={"asset.json": lambda text: text[:draw.randrange(1, len(text) - 1)]})
    yield Case("two rest examples", (REFUSED,), "rest", edit=lambda asset: {**asset, "examples": [{**e, "rest": True} for e in asset["examples"]]})
    yield Case("two examples of a name", (REFUSED,), "name|twice", edit=lambda asset: {**asset, "examples": [{**e, "name": "a"} for e in asset["examples"]]})
    own, other = body(), body((10, 10, 4))
    nearest = lambda mesh, x: int(np.argmin(((mesh.vertices - x)**2).sum(axis=1)))
    corners = [(0, 0, 0), (4, 0, 0), (0, 0.8, 0), (4, 0.8, 0.6), (0, 0, 0.6), (4, 0.8, 0), (2.4, 2, 0), (3.2, 2, 0.3)]
    for k in range(8):
        pose = other.moved(bent(draw.uniform(0.5, 1.1)))
        rows = [[nearest(own, x) + 1, nearest(own, x) + 1, nearest(other, x) + 1] for x in corners]
        text = lambda table: "\n".join(" ".join(map(str, row)) for row in table) + "\n"
        yield Case("right landmarks", (RIGHT, WARNED), "landmark", pose=pose, files={"landmarks.txt": text(rows)}, edit=landmarks())
        bad = [list(row) for row in rows]
        bad[k][2] = rows[(k + 4) % 8][2] if abs(corners[k][0] - corners[(k + 4) % 8][0]) > 1 else nearest(other, (4 - corners[k][0], 0.4, 0.3)) + 1
        yield Case("one landmark of eight elsewhere", (WARNED, REFUSED), f"landmark {k + 1} misses", pose=pose, files={"landmarks.txt": text(bad)},
                   edit=landmarks())
        yield Case("few landmarks", (REFUSED,), "landmark", pose=pose, files={"landmarks.txt": text(rows[:2])}, edit=landmarks("landmarks"))
        beyond = [list(row) for row in rows]
        beyond[k][draw.randrange(3)] = draw.choice([0, 99999, -4, "x"])
        yield Case("a landmark that is no vertex", (REFUSED,), "landmarks.txt", pose=pose, files={"landmarks.txt": text(beyond)}, edit=landmarks())


def spellings(_draw):
    """The same numbers as other programs write them."""
    commas = lambda text: text.replace(".", ",")
    in_capitals = lambda asset: {**asset, "object": {**asset["object"], "mesh": "OBJECT.VEG"}}
    renamed = lambda *names: lambda asset: {**asset, "examples": [{**e, "name": name} for e, name in zip(asset["examples"], names)]}
    for name in ("object.veg", "rest.veg", "pose.veg", "asset.json"):
        if name != "asset.json":
            yield Case("a byte order mark, or other line ends", (RIGHT,), files={name: lambda text: text.replace("\n", "\r").encode()})
            yield Case("decimal commas", (REFUSED,), name.replace(".", r"\."), files={name: commas})
        yield Case("a byte order mark, or other line ends", (RIGHT,), files={name: lambda text: text.encode("utf-8-sig")})
        yield Case("a byte order mark, or other line ends", (RIGHT,), files={name: lambda text: text.replace("\n", "\r\n").encode()})
        yield Case("UTF-16", (REFUSED,), "UTF-16", files={name: lambda text: text.encode("utf-16")})
    yield Case("an ending in capitals", (RIGHT,), files={"object.veg": None, "OBJECT.VEG": body().text()}, edit=in_capitals)
    for rest in ("\0", "\0garbage", "{}", "x"):
        yield Case("something after the asset", (REFUSED,), "asset.json", files={"asset.json": lambda text, rest=rest: text + rest})
    for name in ("a/b", "..", ".", "x" * 65, "tab\t", ""):
        yield Case("a name that HDF5 cannot have", (REFUSED,), "/examples/1/name", edit=renamed("rest", name))
    gmsh_1 = "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$ENDNOD\n$ELM\n1\n1 4 1 1 4 1 2 3 4\n$ENDELM\n"
    as_gmsh = lambda asset: {**asset, "object": {**asset["object"], "mesh": "object.msh"}}
    yield Case("Gmsh 1", (REFUSED,), "gmsh .*-format", files={"object.msh": gmsh_1}, edit=as_gmsh)
    corners = "".join(f"{k + 1} {k & 1} {k >> 1 & 1} {k >> 2}\n" for k in range(8))
    for kind, cell, count in (("hexahedra", 5, 8), ("prisms", 6, 6), ("pyramids", 7, 5)):
        numbers = " ".join(map(str, [1, 2, 4, 3, 5, 6, 8, 7][:count]))
        mesh = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n{corners}$EndNodes\n$Elements\n1\n1 {cell} 2 1 1 {numbers}\n$EndElements\n"
        yield Case("cells that are no tets", (REFUSED,), kind[:5], files={"object.msh": mesh}, edit=as_gmsh)
    for ending, told in ((".fbx", "fbx"), (".npz", "npz"), (".stp", "stp"), ("", "no extension")):
        foreign = lambda asset, ending=ending: {**asset, "object": {**asset["object"], "mesh": "object" + ending}}
        yield Case("a format that is not read", (REFUSED,), told, files={"object" + ending: "x"}, edit=foreign)


def surfaces(draw):
    """Surfaces of a block with a notch, whose faces are polygons: its volume is 14, that of a mesh by other corners is not."""
    outline = [(0, 0), (4, 0), (4, 4), (3, 4), (3, 1.5), (1, 1.5), (1, 4), (0, 4)]
    count = len(outline)

    def text(first=0, extra="", number=lambda x: f"{x:.6f}"):
        points = [(x, y, z) for z in (0, 1) for x, y in outline]
        turned = [(k + first) % count for k in range(count)]
        faces = [[k + 1 for k in reversed(turned)], [count + k + 1 for k in turned]]
        faces += [[k + 1, (k + 1) % count + 1, count + (k + 1) % count + 1, count + k + 1] for k in range(count)]
        lines = ["v " + " ".join(number(x) for x in point) for point in points]
        return "\n".join(lines + [extra] + ["f " + " ".join(map(str, face)) for face in faces]) + "\n"

    def asset_of(file, **members):
        own = {"surface": file, "cells": 200, "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.3, "density": 1000}, **members}
        return lambda _asset: {"name": "case", "object": own}

    for first in range(count):
        yield Case("polygons that are not convex", (RIGHT,), files={"object.obj": text(first)}, edit=asset_of("object.obj"))
    for _ in range(2):
        stray = f"v {draw.uniform(20, 90):.3f} 0 0"
        yield Case("an unused vertex of a surface", (RIGHT, WARNED), "vert", files={"object.obj": text(extra=stray)}, edit=asset_of("object.obj"))
    yield Case("decimal commas", (REFUSED,), "decimal points", files={"object.obj": text(number=lambda x: f"{x:.6f}".replace(".", ","))},
               edit=asset_of("object.obj"))
    yield Case("an ending in capitals", (RIGHT,), files={"OBJECT.OBJ": text()}, edit=asset_of("OBJECT.OBJ"))
    yield Case("a byte order mark, or other line ends", (RIGHT,), files={"object.obj": text().encode("utf-8-sig")}, edit=asset_of("object.obj"))
    yield Case("a byte order mark, or other line ends", (RIGHT,), files={"object.obj": text().replace("\n", "\r").encode()}, edit=asset_of("object.obj"))
    yield Case("UTF-16", (REFUSED,), "UTF-16", files={"object.obj": text().encode("utf-16")}, edit=asset_of("object.obj"))
    yield Case("centimetres", (WARNED,), "object.unit", files={"object.obj": text(number=lambda x: f"{100 * x:.6f}")}, edit=asset_of("object.obj"))
    yield Case("centimetres that are said", (RIGHT,), files={"object.obj": text(number=lambda x: f"{100 * x:.6f}")}, edit=asset_of("object.obj", scale=0.01))
    for ending in (".fbx", ".npz", ".blend"):
        yield Case("a format that is not read", (REFUSED,), ending[1:], files={"object" + ending: "x"}, edit=asset_of("object" + ending))


def cases():
    draw = random.Random(1)
    groups = (scales, frames, parts, topology, malformed, assets, spellings, surfaces)
    return [case for group in groups for case in group(draw)]


def main():
    counts, kinds, faulty = collections.Counter(), collections.defaultdict(collections.Counter), 0
    chosen = cases() if ALL else cases()[::SHARE]
    for number, case in enumerate(chosen):
        outcome, faults, said = case.run()
        counts[outcome] += 1
        kinds[case.kind][outcome] += 1
        if faults:
            faulty += 1
            print(f"{number}, {case.kind}: {'; '.join(faults)}\n  " + "\n  ".join(said.strip().splitlines()[-6:]), flush=True)
    table = ["| input | cases | right | warned of | refused |", "| --- | --- | --- | --- | --- |"]
    table += [f"| {kind} | {sum(c.values())} | {c[RIGHT]} | {c[WARNED]} | {c[REFUSED]} |" for kind, c in kinds.items()]
    table += [f"| all | {sum(counts.values())} | {counts[RIGHT]} | {counts[WARNED]} | {counts[REFUSED]} |"]
    print("\n".join(table) + f"\n{faulty} not as expected")
    if PAGE and not faulty:
        text = PAGE.read_text()
        PAGE.write_text(text[:text.index(BEGIN) + len(BEGIN)] + "\n" + "\n".join(table) + "\n" + text[text.index(END):])
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
