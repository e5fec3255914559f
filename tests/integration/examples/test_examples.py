#!/usr/bin/python3
"""The pose tool against closed forms, and the meshes of the paper's scenes against the sizes of its Table 2."""
import importlib.machinery
import importlib.util
import json
import pathlib
import sys
import tempfile
import unittest

import numpy as np
from scipy.integrate import quad

EXAMPLES = pathlib.Path(__file__).resolve().parents[3] / "examples"
TOOLS = EXAMPLES / "tools"
PAPER = EXAMPLES.parent / "tests" / "paper"
sys.dont_write_bytecode = True
sys.path.insert(0, str(TOOLS))
import pose  # noqa: E402

LENGTH = 3.0
ANGLE = np.radians(70)
LIMB = {"axis": "x", "from": "1,0,0", "length": str(LENGTH), "towards": "z"}  # from x = 1 to x = 4
# The line of a bend is integrated in 2,000 steps, midpoint rule: the error is (angle / 2000)^2 / 24 of the length, and less.
CLOSE = 1e-6


def deformed(points, kind, **options):
    return pose.deformed(np.array(points, float), kind, np.degrees(ANGLE), options)


class Pose(unittest.TestCase):
    def check(self, found, expected):
        np.testing.assert_allclose(found, expected, atol=CLOSE)

    def test_arc_is_a_circle(self):
        radius = LENGTH / ANGLE
        for t in (0.25, 1.0):
            a = ANGLE * t
            expected = [1 + radius * np.sin(a), 0, radius * (1 - np.cos(a))]
            across = [-0.2 * np.sin(a), 0.3, 0.2 * np.cos(a)]
            found = deformed([[1 + LENGTH * t, 0, 0], [1 + LENGTH * t, 0.3, 0.2]], "arc", **LIMB)
            self.check(found, [expected, np.add(expected, across)])

    def test_s_ends_parallel_to_its_start(self):
        end = [1 + LENGTH * quad(lambda t: np.cos(ANGLE * np.sin(np.pi * t) ** 2), 0, 1)[0], 0,
               LENGTH * quad(lambda t: np.sin(ANGLE * np.sin(np.pi * t) ** 2), 0, 1)[0]]
        found = deformed([[4, 0, 0], [4, 0.3, 0.2], [4.7, 0, 0]], "s", **LIMB)
        self.check(found, [end, np.add(end, [0, 0.3, 0.2]), np.add(end, [0.7, 0, 0])])

    def test_twist_turns_cross_sections(self):
        c, s = np.cos(ANGLE / 2), np.sin(ANGLE / 2)
        self.check(deformed([[1 + LENGTH / 2, 1, 0], [1 + LENGTH / 2, 0, 2]], "twist", **LIMB), [[2.5, c, s], [2.5, -2 * s, 2 * c]])

    def test_what_lies_before_stays_and_what_lies_beyond_is_rigid(self):
        generator = np.random.default_rng(1)
        before, beyond = generator.uniform(-1, 1, (2, 20, 3)) + [[[0, 0, 0]], [[5.5, 0, 0]]]
        for kind in ("arc", "s", "twist"):
            self.check(deformed(before, kind, **LIMB), before)
            posed = deformed(beyond, kind, **LIMB)
            self.check(np.linalg.norm(posed - posed[0], axis=1), np.linalg.norm(beyond - beyond[0], axis=1))

    def test_the_middle_of_a_whole_body_stays(self):
        points = np.array([[x, y, z] for x in np.linspace(-2, 2, 2001) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        for kind in ("arc", "s"):
            line = deformed(points, kind, towards="z").reshape(-1, 4, 3).mean(1)
            turned = np.arctan2(*(line[-1] - line[0])[[2, 0]])
            self.check(turned, 0)
            self.check(line.mean(0), 0)

    def test_radius_limits_what_follows(self):
        inside, outside, between = [3, 0.1, 0.1], [3, 1.0, 0], [3, 0.6, 0]
        everything = deformed([inside, outside, between], "arc", **LIMB)
        limited = deformed([inside, outside, between], "arc", **LIMB, radius="0.5,0.2")
        self.check(limited[:2], [everything[0], outside])
        self.check(limited[2], (everything[2] + between) / 2)  # halfway through the falloff

    def test_meshes_are_read_and_written(self):
        with tempfile.TemporaryDirectory() as folder:
            path = folder + "/m.msh"
            with open(path, "w") as f:  # a triangle, a vertex that nothing uses, two tags
                f.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n7 1 0 0\n3 0 1 0\n4 9 9 9\n5 0 0 1\n$EndNodes\n"
                        "$Elements\n2\n1 2 2 0 1 1 7 3\n2 4 2 0 1 1 7 3 5\n$EndElements\n")
            points, tets = pose.read(path)
            pose.write(path, points, tets)
            again, same = pose.read(path)
        np.testing.assert_array_equal(points, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        np.testing.assert_array_equal(tets, [[0, 1, 2, 3]])
        np.testing.assert_array_equal(again, points)
        np.testing.assert_array_equal(same, tets)


class Surfaces(unittest.TestCase):
    def test_the_teddys_surface_is_closed_and_encloses_about_its_tets(self):
        folder = EXAMPLES / "07_teddy_global"
        rows = [line.split() for line in (folder / "surface.obj").read_text().splitlines()]
        points = np.array([row[1:] for row in rows if row[0] == "v"], float)
        triangles = np.array([row[1:] for row in rows if row[0] == "f"], int) - 1
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        directed = {tuple(edge) for edge in edges.tolist()}
        self.assertEqual(len(directed), len(edges))
        self.assertEqual({(b, a) for a, b in directed}, directed)
        volume = np.linalg.det(points[triangles]).sum() / 6
        body, tets = pose.read(folder / "object.msh")
        corners = body[tets]
        # The tets are inscribed in the ellipsoids, whose seams the surface rounds.
        np.testing.assert_allclose(volume, abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6, rtol=0.1)
        np.testing.assert_allclose([points.min(0), points.max(0)], [body.min(0), body.max(0)], atol=0.06)  # the nose sticks out


def tool(name, folder=TOOLS):
    """A tool of the examples as a module."""
    loader = importlib.machinery.SourceFileLoader(name, str(folder / f"{name}.py"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


class Meshes(unittest.TestCase):
    def setUp(self):
        self.table = tool("paper_table", PAPER)

    def test_sizes_are_near_the_papers(self):
        for name, variant, (dofs, tets, example_vertices, m, r, s), *_ in self.table.PAPER.values():
            folder = EXAMPLES / name
            asset = self.table.json.loads((folder / f"asset_{variant.format('paper')}.json").read_text())
            with self.subTest(name):
                points, elements = pose.read(folder / asset["object"]["mesh"])
                examples = [pose.read(folder / example["mesh"]) for example in asset["examples"]]
                found = [3 * len(points), len(elements), len(examples[-1][0])]
                np.testing.assert_allclose(found, [dofs, tets, example_vertices], rtol=0.1)
                for posed in examples[1:]:
                    np.testing.assert_array_equal(posed[1], examples[0][1])
                asked = asset["shape_space"]["eigenfunctions"], asset["basis"]["size"], asset["cubature"]["elements"]
                self.assertEqual(asked, (m, r, s))

    def test_the_baseline_stands_beside_the_papers_and_ours(self):
        row = self.table.baseline_row("bar", (8, 50), (4, 10), (10000, 40000), (20, 40), (0.5, 10))
        self.assertEqual(row, ["bar", "2 / 5", "10 / 40", "500 / 1000", "20000 / 4000"])


class Studies(unittest.TestCase):
    """What examples/tools/studies.py makes of results of round numbers."""

    @staticmethod
    def point(s, internal_force, target, mean, from_all, interp, total):
        settings = {"eigenfunctions": 5, "basis_size": 20, "linear_modes": 15, "cubature_elements": s, "material": "stvk", "time_step": 0.001,
                    "integrator": "bdf2", "internal_force": internal_force, "target": target}
        errors = {"position": {"mean": 10 * mean}, "shape": {"mean": mean}, "from_all_elements": from_all and {"mean": from_all}}
        return {"settings": settings, "elements": s or 99, "target": target, "failure": "", "errors": errors,
                "times": {"interp_us": interp, "median_us": total}}

    def setUp(self):
        self.studies = tool("studies")
        points = [self.point(30, "cubature", "table", 0.05, 0.03, 0.5, 10), self.point(30, "cubature", "solve", 0.05, 0.03, 20, 40),
                  self.point(60, "cubature", "table", 0.045, 0.01, 0.5, 15), self.point(None, "all_elements", "table", 0.04, None, 0.5, 100)]
        self.result = {"points": points, "own": 0, "headline": "shape", "no_truth": "", "processor": "X"}

    def test_errors_stand_by_elements(self):
        self.assertIn("| bar | 5 | 20 | 4 % | 5 % (3 %) | 4.5 % (1 %) |\n", self.studies.error_table({"bar": self.result}))

    def test_a_reference_that_is_no_truth_is_told(self):
        self.assertNotIn("inverted", self.studies.error_table({"bar": self.result}))
        self.result["no_truth"] = "No truth: 7 inverted tets."
        self.assertIn("\nbar: No truth: 7 inverted tets.\n\n|", self.studies.error_table({"bar": self.result}))

    def test_failures_are_told(self):
        self.assertEqual(self.studies.failures({"bar": self.result}), "")
        self.result["points"][1]["failure"] = "broke"
        self.assertIn("- bar: 1 failed, the first: broke", self.studies.failures({"bar": self.result}))

    def test_scenes_are_those_of_the_papers_table(self):
        for name, (folder, *_) in tool("paper_table", PAPER).PAPER.items():
            self.assertEqual(self.studies.STUDIES[name], f"{folder}/study.json")
            self.assertEqual(json.loads((EXAMPLES / self.studies.STUDIES[name]).read_text())["name"], name)


class Figures(unittest.TestCase):
    """Scenes and assets that examples/tools/figures.py makes of those of the examples."""

    def setUp(self):
        self.figures = tool("figures")

    def test_regions_act_apart_and_are_otherwise_the_examples(self):
        whole = self.figures.read(EXAMPLES / "06_cross/scene_recommended.json")
        names = lambda scene: [region["name"] for region in scene["regions"]]
        apart = [self.figures.of_regions(whole, regions) for regions in (["left", "right"], ["middle"])]
        self.assertEqual([names(scene) for scene in apart], [["left", "right"], ["middle"]])
        for scene in apart:
            self.assertEqual(scene | {"regions": whole["regions"]}, whole)
        self.assertEqual(names(whole), ["left", "right", "middle"])

    def test_names_are_those_of_bundle_and_trajectory(self):
        scene = self.figures.named(self.figures.read(EXAMPLES / "04_bar_cuboid/scene_none.json"), "x")
        self.assertEqual((scene["bundle"], scene["output"]), ("x.h5", {"trajectory": "x_run.h5", "every": 10}))

    def test_the_falling_bar_begins_above_the_floor_and_tilted(self):
        points, _ = pose.read(self.figures.BAR / "object.msh")
        body = self.figures.falling_scene()["body"]
        w, x, y, z = body["orientation"]
        self.assertAlmostEqual(w * w + x * x + y * y + z * z, 1, places=4)
        centre = (points.min(0) + points.max(0)) / 2
        np.testing.assert_allclose(centre + body["position"], [0, 0, 2.5], atol=1e-9)
        turn = np.array([[1 - 2 * y * y, 0, 2 * w * y], [0, 1, 0], [-2 * w * y, 0, 1 - 2 * y * y]])
        placed = (points - centre) @ turn.T + centre + body["position"]
        self.assertGreater(placed[:, 2].min(), 0.5)
        self.assertGreater(np.ptp(placed[:, 0]), 3, "it lies")

    def test_the_falling_bar_is_free(self):
        asset = self.figures.falling_asset("a", "rest.msh", "posed.msh")
        self.assertNotIn("fixed", asset["object"])
        self.assertEqual([example["mesh"] for example in asset["examples"]], ["rest.msh", "posed.msh"])


if __name__ == "__main__":
    unittest.main()
