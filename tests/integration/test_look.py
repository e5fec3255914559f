#!/usr/bin/python3
"""Materials, textures, texture coordinates, colours and names of a surface, from its .glb through a bundle to an exported .glb.

Usage: test_look.py FOLDER_OF_PROGRAMS [--keep FOLDER]    (Debian: python3-h5py)

--keep copies the .glb files that were written into a folder.
"""
import json
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib
from pathlib import Path

import h5py
import numpy as np

from programs import FLOAT, KINDS, UBYTE, UINT, USHORT, Glb, call, write_bar, write_json

PROGRAMS = Path(sys.argv.pop(1)).resolve()
KEPT = Path(sys.argv.pop()) if "--keep" in sys.argv else None
sys.argv = sys.argv[:1]
PRECOMPUTE, RUNTIME = PROGRAMS / "exmat-precompute", PROGRAMS / "exmat-runtime"
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TURN = np.array([0, 0, np.sin(0.3), np.cos(0.3)])


def png(colour):
    """A picture of 2 x 2 pixels."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + bytes(colour) * 2 for _ in range(2))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, 2, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def rotation(q):
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


class Document:
    """A .glb that is read, by the format alone."""

    def __init__(self, path):
        data = path.read_bytes()
        assert data[:4] == b"glTF" and struct.unpack("<I", data[8:12])[0] == len(data)
        size, = struct.unpack("<I", data[12:16])
        self.json, self.binary = json.loads(data[20:20 + size]), data[28 + size:]

    def bytes_of_view(self, index):
        view = self.json["bufferViews"][index]
        return self.binary[view.get("byteOffset", 0):view.get("byteOffset", 0) + view["byteLength"]]

    def array(self, index):
        accessor = self.json["accessors"][index]
        flat = np.frombuffer(self.bytes_of_view(accessor["bufferView"])[accessor.get("byteOffset", 0):], KINDS[accessor["componentType"]])
        return flat[:accessor["count"] * WIDTHS[accessor["type"]]].reshape(accessor["count"], -1)

    def said(self, index):
        """What an accessor says and holds."""
        return {key: value for key, value in self.json["accessors"][index].items() if key not in ("bufferView", "byteOffset")}, self.array(index).tobytes()

    def image(self, texture):
        return self.bytes_of_view(self.json["images"][self.json["textures"][texture]["source"]]["bufferView"])

    def drawn_nodes(self):
        """Nodes with a mesh in the order in which they are met, each with those above it."""
        found = []

        def visit(node, above):
            if "mesh" in self.json["nodes"][node]:
                found.append(above + [node])
            for child in self.json["nodes"][node].get("children", []):
                visit(child, above + [node])

        for root in self.json["scenes"][self.json["scene"]]["nodes"]:
            visit(root, [])
        return found

    def key(self, node, path, frame, otherwise):
        for animation in self.json.get("animations", []):
            for channel in animation["channels"]:
                if channel["target"] == {"node": node, "path": path}:
                    sampler = animation["samplers"][channel["sampler"]]
                    values = self.array(sampler["output"]).ravel().reshape(self.json["accessors"][sampler["input"]]["count"], -1)
                    return values[frame].astype(float)
        return np.array(otherwise, float)

    def frame(self, frame):
        """Positions and normals of all primitives as they are drawn."""
        drawn = []
        for path in self.drawn_nodes():
            linear, shift = np.eye(3), np.zeros(3)
            for index in path:
                node = self.json["nodes"][index]
                own = rotation(self.key(index, "rotation", frame, node.get("rotation", [0, 0, 0, 1]))) @ np.diag(node.get("scale", [1, 1, 1]))
                shift = shift + linear @ self.key(index, "translation", frame, node.get("translation", [0, 0, 0]))
                linear = linear @ own
            weights = self.key(path[-1], "weights", frame, [])
            for primitive in self.json["meshes"][self.json["nodes"][path[-1]]["mesh"]]["primitives"]:
                blend = lambda name: self.array(primitive["attributes"][name]).astype(float) + sum(
                    w * self.array(target[name]) for w, target in zip(weights, primitive["targets"]))
                normals = blend("NORMAL") @ np.linalg.inv(linear)
                drawn.append((blend("POSITION") @ linear.T + shift, normals / np.linalg.norm(normals, axis=1, keepdims=True)))
        return drawn


def tube():
    """Points of a tube about the bar's axis, its seam twice, texture coordinates, outward normals and triangles."""
    i, j = np.divmod(np.arange(21 * 13), 13)
    angle = 2 * np.pi * (j % 12) / 12
    out = np.stack([0 * angle, np.cos(angle), np.sin(angle)], 1)
    quads = np.array([13 * a + b for a in range(20) for b in range(12)])
    triangles = np.concatenate([np.stack([quads, quads + 1, quads + 13], 1), np.stack([quads + 1, quads + 14, quads + 13], 1)])
    return np.stack([0.2 * i, 0 * i, 0 * i], 1) + 0.4 * out + [0, 0.5, 0.5], np.stack([j / 12, i / 20], 1), out, triangles


def artists_glb(path, colour=(200, 10, 10)):
    """Two nodes with one mesh, one of them mirrored, below a node with another, which has two materials."""
    points, uv, out, triangles = tube()
    glb = Glb()
    glb.json["asset"]["copyright"] = "2026 an artist"
    # The surface stands in the scene after a turn, a scale and a shift of its node.
    local = (points - [1, 0, 0]) @ rotation(TURN) / 2
    attributes = {"POSITION": glb.positions(local), "NORMAL": glb.accessor(out @ rotation(TURN), FLOAT, "VEC3"),
                  "TANGENT": glb.accessor(np.tile([1, 0, 0, 1], (len(points), 1)), FLOAT, "VEC4"),
                  "TEXCOORD_0": glb.accessor(uv, FLOAT, "VEC2"),
                  "TEXCOORD_1": glb.accessor(65535 * uv[:, ::-1], USHORT, "VEC2", normalized=True),
                  "COLOR_0": glb.accessor(255 * np.stack([uv[:, 0], uv[:, 1], 0 * uv[:, 0], 0 * uv[:, 0] + 1], 1), UBYTE, "VEC4", normalized=True)}
    left = points[triangles].mean(1)[:, 0] < 2
    primitives = [{"attributes": attributes, "indices": glb.accessor(triangles[rows].ravel(), USHORT, "SCALAR"), "material": k, "extras": {"half": k}}
                  for k, rows in enumerate((left, ~left))]
    # Without normals, a strip.
    square = {"attributes": {"POSITION": glb.positions(np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0.2, 0.2, 0]])),
                             "TEXCOORD_0": glb.accessor([[0, 0], [1, 0], [0, 1], [1, 1]], FLOAT, "VEC2")}, "mode": 5, "material": 2}
    inner = glb.view(png(colour))
    glb.json.update(
        meshes=[{"name": "tube mesh", "primitives": primitives, "extras": {"maker": "me"}}, {"name": "square mesh", "primitives": [square]}],
        nodes=[{"name": "Tube", "mesh": 0, "children": [1, 2, 3], "translation": [1, 0, 0], "rotation": TURN.tolist(), "scale": [2, 2, 2]},
               {"name": "Square", "mesh": 1, "translation": [0.5, 0.2, 0.4]},
               {"name": "Mirrored", "mesh": 1, "translation": [1.2, 0, 0.4], "scale": [-1, 2, 1], "extras": {"side": "left"}},
               {"name": "Lamp", "translation": [0, 9, 0]}],
        materials=[{"name": "painted", "pbrMetallicRoughness": {"baseColorTexture": {"index": 1, "texCoord": 1}, "roughnessFactor": 0.25},
                    "normalTexture": {"index": 0, "scale": 0.5, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}},
                   {"name": "steel", "doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 1}},
                   {"name": "glowing", "emissiveFactor": [1, 0.5, 0], "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": {"index": 0}}}}],
        textures=[{"source": 0, "sampler": 0}, {"source": 1, "name": "paint"}], samplers=[{"magFilter": 9728, "wrapS": 33071}],
        images=[{"uri": "pictures/other%20one.png"}, {"name": "inner", "bufferView": inner, "mimeType": "image/png"}],
        extensionsUsed=["KHR_texture_transform", "KHR_materials_clearcoat", "KHR_lights_punctual"], cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}],
        animations=[{"channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                     "samplers": [{"input": glb.accessor([0, 1], FLOAT, "SCALAR", min=[0], max=[1]), "output": glb.accessor([[0, 0, 0], [1, 1, 1]], FLOAT, "VEC3")}]}])
    (path.parent / "pictures").mkdir(exist_ok=True)
    (path.parent / "pictures/other one.png").write_bytes(png((9, 9, 250)))
    glb.write(path)


class Looks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)
        write_bar(cls.folder)
        artists_glb(cls.folder / "artist.glb")
        artists_glb(cls.folder / "other.glb", (7, 77, 7))
        cls.bundle("clamped", "artist.glb", fixed={"file": "end.txt"})
        cls.bundle("free", "other.glb")
        cls.run_scene("clamped", {"gravity": [0, 0, -9.81]})
        cls.run_scene("free", {"gravity": [0, -9.81, 0], "body": {"position": [2, 1, -1], "orientation": [0.8, 0, 0.6, 0], "angular_velocity": [1, 4, 9]}})

    @classmethod
    def bundle(cls, name, render_mesh, **more):
        drawn = {"render_mesh": render_mesh} if render_mesh else {}
        asset = {"name": name, "object": {"mesh": "bar.veg", **drawn, **more,
                                          "material": {"youngs_modulus": 2e5, "poisson_ratio": 0.4, "density": 1000}},
                 "basis": {"size": 8, "linear_modes": 4, "training": "none"}, "cubature": {"elements": 16, "training_poses": 20},
                 "needs": ["rigid", *(["render"] if drawn else []), "contact"], "examples": []}
        write_json(cls.folder / f"{name}.json", asset)
        return call(PRECOMPUTE, "bundle", f"{name}.json", "-o", f"{name}.h5", cwd=cls.folder)

    @classmethod
    def run_scene(cls, bundle, members):
        scene = {"bundle": f"{bundle}.h5", "time_step": 0.01, "steps": 60, **members, "output": {"trajectory": f"{bundle}_run.h5", "every": 10, "render": True}}
        write_json(cls.folder / f"{bundle}_scene.json", scene)
        call(RUNTIME, "run", f"{bundle}_scene.json", cwd=cls.folder)

    def export(self, *words, status=0):
        printed = call(RUNTIME, "export", *words, "-o", "out.glb", cwd=self.folder, status=status)
        if KEPT and status == 0:
            shutil.copy(self.folder / "out.glb", KEPT / f"{self.id().split('.')[-1]}_{len(list(KEPT.iterdir()))}.glb")
        return printed

    def material_with_images(self, document, material):
        """A material with the bytes of its images and the samplers in place of numbers of textures."""
        def resolved(value):
            if isinstance(value, dict):
                value = {key: resolved(member) for key, member in value.items()}
                if "index" in value:
                    texture = document.json["textures"][value["index"]]
                    sampler = document.json["samplers"][texture["sampler"]] if "sampler" in texture else None
                    value["index"] = (document.image(value["index"]), sampler)
                return value
            return value
        return resolved(document.json["materials"][material])

    def source(self, name):
        """The artist's file, its image that is beside it put in."""
        document = Document(self.folder / name)
        picture = (self.folder / "pictures/other one.png").read_bytes()
        document.binary += picture
        document.json["bufferViews"].append({"buffer": 0, "byteOffset": len(document.binary) - len(picture), "byteLength": len(picture)})
        document.json["images"][0]["bufferView"] = len(document.json["bufferViews"]) - 1
        return document

    def compare(self, source, document, paths):
        """Primitives of the artist's file and those of nodes that stand for them."""
        nodes = source.drawn_nodes()
        self.assertEqual(len(paths), len(nodes))
        for path, above in zip(paths, nodes):
            node, found = source.json["nodes"][above[-1]], document.json["nodes"][path[-1]]
            for key in ("name", "translation", "rotation", "scale", "extras"):
                self.assertEqual(found.get(key), node.get(key))
            self.assertEqual([document.json["nodes"][k]["name"] for k in path[-len(above):]], [source.json["nodes"][k]["name"] for k in above])
            mesh, drawn = source.json["meshes"][node["mesh"]], document.json["meshes"][found["mesh"]]
            self.assertEqual(drawn["name"], mesh["name"])
            self.assertEqual({key: value for key, value in drawn["extras"].items() if key != "targetNames"}, mesh.get("extras", {}))
            self.assertEqual(len(drawn["primitives"]), len(mesh["primitives"]))
            for primitive, exported in zip(mesh["primitives"], drawn["primitives"]):
                names = set(primitive["attributes"]) - {"TANGENT"}
                self.assertEqual(set(exported["attributes"]), names | {"NORMAL"})
                for name in names:
                    self.assertEqual(document.said(exported["attributes"][name]), source.said(primitive["attributes"][name]), name)
                self.assertEqual("indices" in exported, "indices" in primitive)
                if "indices" in primitive:
                    self.assertEqual(document.said(exported["indices"]), source.said(primitive["indices"]))
                self.assertEqual(exported.get("mode", 4), primitive.get("mode", 4))
                self.assertEqual(exported.get("extras"), primitive.get("extras"))
                self.assertEqual(self.material_with_images(document, exported["material"]), self.material_with_images(source, primitive["material"]))

    def test_what_the_artist_made_comes_back(self):
        for name, file in (("clamped", "artist.glb"), ("free", "other.glb")):
            with self.subTest(name):
                printed = self.export(f"{name}_run.h5")
                self.assertRegex(printed, r"look +3 materials and 2 images")
                source, document = self.source(file), Document(self.folder / "out.glb")
                self.compare(source, document, document.drawn_nodes())
                self.assertEqual(document.json["materials"], source.json["materials"])
                self.assertEqual(document.json["extensionsUsed"], ["KHR_texture_transform", "KHR_materials_clearcoat"])
                self.assertEqual(document.json["asset"]["copyright"], "2026 an artist")
                self.assertEqual([image["name"] for image in document.json["images"]], ["other one", "inner"])
                self.assertEqual([animation["name"] for animation in document.json["animations"]], ["motion"])
                for absent in ("cameras", "skins"):
                    self.assertNotIn(absent, document.json)

    def test_it_moves_as_the_trajectory_does(self):
        for name in ("clamped", "free"):
            with self.subTest(name), h5py.File(self.folder / f"{name}_run.h5") as f:
                self.export(f"{name}_run.h5")
                document, positions, triangles = Document(self.folder / "out.glb"), f["render/vertices"][:].astype(float), f["render/triangles"][:]
                self.assertGreater(np.linalg.norm(positions - positions[0], axis=2).max(), 0.2)
                for frame, expected in enumerate(positions):
                    (tube, normals), (again, _), (first, _), (second, _) = document.frame(frame)
                    np.testing.assert_array_equal(tube, again)  # the primitives share their vertices
                    drawn = np.concatenate([tube, first, second])
                    np.testing.assert_allclose(drawn, expected, atol=2e-5)
                    seam = 13 * np.arange(21)
                    np.testing.assert_array_equal(drawn[seam], drawn[seam + 12])  # it does not open
                    # Normals against those of the triangles as they are drawn.
                    a, b, c = (expected[triangles[:480, k]] for k in range(3))
                    areas, sums = np.cross(b - a, c - a), np.zeros((len(tube), 3))
                    for k in range(3):
                        np.add.at(sums, triangles[:480, k], areas)
                    sums[seam] = sums[seam + 12] = sums[seam] + sums[seam + 12]
                    cosines = (normals * sums).sum(1) / np.linalg.norm(sums, axis=1)
                    inner = (np.arange(len(tube)) // 13 % 20) > 0
                    self.assertGreater(cosines[inner].min(), 0.97)

    def test_two_looks_and_a_body_without_one(self):
        self.bundle("bare", None)
        scene = {"time_step": 0.01, "steps": 20, "output": {"trajectory": "several_run.h5", "every": 10}, "bodies": [
            {"name": "a", "bundle": "clamped.h5"}, {"name": "b", "bundle": "free.h5", "body": {"position": [0, 9, 0]}},
            {"name": "c", "bundle": "free.h5", "body": {"position": [0, 19, 0]}}, {"name": "d", "bundle": "bare.h5", "body": {"position": [0, 29, 0]}}]}
        write_json(self.folder / "several.json", scene)
        call(RUNTIME, "run", "several.json", cwd=self.folder)
        self.export("several_run.h5")
        document = Document(self.folder / "out.glb")
        paths = document.drawn_nodes()
        self.assertEqual([document.json["nodes"][path[0]]["name"] for path in paths], ["a"] * 3 + ["b"] * 3 + ["c"] * 3 + ["d"])
        for first, file in ((0, "artist.glb"), (3, "other.glb"), (6, "other.glb")):
            self.compare(self.source(file), document, paths[first:first + 3])
        self.assertEqual(len(document.json["meshes"]), 7)  # two bodies share theirs
        (bare,) = document.json["meshes"][document.json["nodes"][paths[-1][-1]]["mesh"]]["primitives"]
        self.assertEqual(document.json["materials"][bare["material"]]["name"], "material")
        self.assertEqual(document.json["extensionsUsed"], ["KHR_texture_transform", "KHR_materials_clearcoat"])
        with h5py.File(self.folder / "several_run.h5") as f, h5py.File(self.folder / "free.h5") as bundle:
            tets, weights = bundle["object/tets"][:][bundle["render/tets"][:]], bundle["render/barycentric"][:]
            for k, name in ((4, "b"), (8, "c")):
                vertices = f[f"bodies/{name}/vertices"][2].astype(float)
                expected = np.einsum("vc,vcx->vx", weights, vertices[tets])[:273]
                np.testing.assert_allclose(document.frame(2)[k][0], expected, atol=2e-5)

    def test_a_unit_scales_the_nodes(self):
        mesh = (self.folder / "bar.veg").read_text().splitlines()
        count = int(mesh[1].split()[0])
        for k in range(2, 2 + count):
            number, *place = mesh[k].split()
            mesh[k] = " ".join([number, *(str(100 * float(x)) for x in place)])
        (self.folder / "bar_cm.veg").write_text("\n".join(mesh) + "\n")
        document = Document(self.folder / "artist.glb")
        document.json["nodes"][0].update(scale=[200, 200, 200], translation=[100, 0, 0])
        glb = Glb()
        glb.json, glb.binary = {key: value for key, value in document.json.items() if key != "buffers"}, bytearray(document.binary)
        glb.write(self.folder / "artist_cm.glb")
        self.bundle("cm", "artist_cm.glb", mesh="bar_cm.veg", unit="cm", fixed={"file": "end.txt"})
        self.run_scene("cm", {"gravity": [0, 0, -9.81]})
        self.export("cm_run.h5")
        document = Document(self.folder / "out.glb")
        with h5py.File(self.folder / "cm_run.h5") as f:
            np.testing.assert_allclose(document.frame(6)[0][0], f["render/vertices"][6, :273], atol=2e-5)

    def test_without_materials_it_is_as_it_was(self):
        points, _, _, triangles = tube()
        glb = Glb()
        primitive = {"attributes": {"POSITION": glb.positions(points), "_FIXED": glb.accessor(points[:, :1] < 0.1, FLOAT, "SCALAR")},
                     "indices": glb.accessor(triangles.ravel(), USHORT, "SCALAR")}
        glb.json.update(meshes=[{"primitives": [primitive]}], nodes=[{"mesh": 0, "name": "unseen"}])
        glb.write(self.folder / "white.glb")
        self.bundle("white", "white.glb", fixed={"file": "end.txt"})
        with h5py.File(self.folder / "white.h5") as f:
            self.assertEqual([f[f"render/{name}"].size for name in ("look", "look_vertices", "look_frames")], [0, 0, 0])
        self.run_scene("white", {})
        self.assertNotIn("look", self.export("white_run.h5"))
        document = Document(self.folder / "out.glb")
        self.assertEqual([node["name"] for node in document.json["nodes"]], ["white"])
        self.assertEqual([material["name"] for material in document.json["materials"]], ["material"])
        self.assertNotIn("look", self.export("clamped_run.h5", "--mesh"))  # the tets have none

    def test_the_bundle_holds_a_file_by_itself(self):
        with h5py.File(self.folder / "clamped.h5") as f:
            data, whole = f["render/look"][:].tobytes(), (self.folder / "clamped.h5").stat().st_size
        (self.folder / "look.glb").write_bytes(data)
        source, document = self.source("artist.glb"), Document(self.folder / "look.glb")
        self.assertEqual(document.json["materials"], source.json["materials"])
        given = sum((self.folder / name).stat().st_size for name in ("artist.glb", "pictures/other one.png"))
        self.assertLess(len(data), given)  # tangents and animations are left out
        print(f"bundle {whole} bytes, {len(data)} of them its look, of files of {given}", file=sys.stderr)
        if KEPT:
            shutil.copy(self.folder / "look.glb", KEPT / "look.glb")

    def test_images_that_change_make_another_bundle(self):
        words = [PRECOMPUTE, "bundle", "clamped.json", "-o", "again.h5"]
        call(*words, cwd=self.folder)
        call(*words, "--depfile", "again.d", cwd=self.folder)
        self.assertIn("other", (self.folder / "again.d").read_text())
        digest = lambda: h5py.File(self.folder / "again.h5").attrs["input_sha256"]
        before, picture = digest(), self.folder / "pictures/other one.png"
        kept = picture.read_bytes()
        picture.write_bytes(png((1, 2, 3)))
        try:
            call(*words, cwd=self.folder)
        finally:
            picture.write_bytes(kept)
        self.assertNotEqual(digest(), before)

    def test_a_missing_image_is_said_and_named(self):
        (self.folder / "lost").mkdir(exist_ok=True)
        for name in ("artist.glb", "bar.veg", "clamped.json", "end.txt"):
            shutil.copy(self.folder / name, self.folder / "lost")
        done = self.bundle_in("lost")
        self.assertIn("the image pictures/other one.png is not in its folder", done)
        document = Document(self.folder / "lost/rest.glb")
        self.assertEqual(document.json["images"][0], {"uri": "pictures/other%20one.png"})

    def bundle_in(self, folder):
        done = subprocess.run([PRECOMPUTE, "bundle", "clamped.json", "-o", "clamped.h5"], cwd=self.folder / folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        call(RUNTIME, "export", "--bundle", "clamped.h5", "-o", "rest.glb", cwd=self.folder / folder)
        return done.stdout + done.stderr

    def test_damage_is_named(self):
        def change(data):
            shutil.copy(self.folder / "clamped.h5", self.folder / "bad.h5")
            with h5py.File(self.folder / "bad.h5", "r+") as f:
                old = f["render/look"]
                attributes = dict(old.attrs)
                del f["render/look"]
                new = f.create_dataset("render/look", data=np.frombuffer(data, np.uint8))
                for key, value in attributes.items():
                    new.attrs[key] = value
                new.attrs["crc32"] = np.int64(zlib.crc32(data))
            return self.export("--bundle", "bad.h5", status=2)

        with h5py.File(self.folder / "clamped.h5") as f:
            data = f["render/look"][:].tobytes()
        glb = Glb()
        glb.json = json.loads(data[20:20 + struct.unpack("<I", data[12:16])[0]])
        for key, value in (("meshes", []), ("meshes", 3), ("accessors", []), ("nodes", None), ("materials", [{"normalTexture": {"index": "one"}}])):
            document = {**glb.json, key: value}
            text = json.dumps(document).encode()
            text += b" " * (-len(text) % 4)
            body = struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text
            self.assertIn("precompute the bundle again", change(body), key)
        self.assertIn("bad.h5: /render/look: byte", change(b"nothing"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
