#!/usr/bin/python3
"""Measure what a basis is worth under loads that it has not learned from, against the full space.

Usage: other_loads.py [--write] [--programs build/release/bin] [BODY ...]    (bar, teddy, cross; all where none is named; Debian: python3-h5py)

For each body there are bundles whose bases learned from nothing, from the scene, from declared loads, and from loads of all kinds. Each is run
under the scene's loads and under others, the last one in the spaces auto and full, too. Everything goes to build/other_loads, where runs in full space are found again. --write also renews
docs/studies/other_loads.md, where all bodies were run. Ten minutes.
"""
import argparse
import json
import pathlib
import subprocess
import textwrap
import sys

import h5py
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
BODIES = {
    "bar": ("04_bar_cuboid", {"time_step": 0.002, "steps": 1000}),
    "teddy": ("07_teddy_global", {"time_step": 0.002, "steps": 750}),
    "cross": ("06_cross", {"time_step": 0.005, "steps": 120}),
}
MODES, ELEMENTS = 30, 90
FRAMES = 50
TRAININGS = {
    "nothing": "`basis.training`: `none`",
    "the scene": "`scene`: the loads of the first row, varied",
    "declared loads": "`loads`, with `basis.loads`: the scene's pushed vertices, its kappa and gravity, in any direction",
    "all kinds": "`auto`, without a scene and `basis.loads`: pushes on patches of the surface, gravity and examples of all strengths",
}
SPACES = {
    "auto": "the bundle of all kinds in space `auto`: all vertices while the loads act, and for half a second after",
    "full": "the same in space `full`: all vertices throughout",
}
PUSHED = 4  # vertices of the push elsewhere


def run(folder, *words):
    print("other_loads:", *words, file=sys.stderr)
    subprocess.run([str(word) for word in words], check=True, cwd=folder, stdout=subprocess.DEVNULL)


def example_forces(scene):
    return [scene["examples"]] if "examples" in scene else scene["regions"]


def scaled_examples(scene, factor):
    """The scene with example forces of so many times their stiffness, their damping relative to it unchanged."""
    scene = json.loads(json.dumps(scene))
    for force in example_forces(scene):
        force["stiffness"] *= factor
        force["damping"] *= factor**0.5
    return scene


def without_examples(scene):
    return {name: part for name, part in scene.items() if name not in ("examples", "regions")}


def total_force(scene):
    return sum(np.linalg.norm(force["force"]) * len(force["vertices"]["ids"]) for force in scene.get("forces", []))


def far_vertices(mesh, scene):
    """Of the surface: those nearest to the one that lies farthest from all that is held or pushed."""
    used = np.flatnonzero(mesh["fixed"])
    pushed = [i for force in scene.get("forces", []) for i in force["vertices"]["ids"]]
    held = mesh["vertices"][np.unique(np.concatenate([used, pushed]).astype(int))]
    surface = np.unique(mesh["surface"])
    points = mesh["vertices"][surface]
    distance = np.array([np.linalg.norm(held - p, axis=1).min() if len(held) else np.linalg.norm(p) for p in points])
    near = np.argsort(np.linalg.norm(points - points[distance.argmax()], axis=1))
    return [int(i) for i in surface[near[:PUSHED]]]


def tests(scene, mesh):
    """Name and scene of each row."""
    rows = {"the scene": scene}
    weight = 9.81 * mesh["mass"]
    if "forces" in scene:
        turned = [force | {"force": force["force"][1:] + force["force"][:1]} for force in scene["forces"]]
        rows["its pushes, turned by a quarter"] = scene | {"forces": turned}
    push = (total_force(scene) / 2 if "forces" in scene else 0.2 * weight) / PUSHED
    rows["a push elsewhere"] = scene | {"forces": [{"vertices": {"ids": far_vertices(mesh, scene)}, "force": [push, 0, 0]}]}
    rows["examples of four times the stiffness"] = scaled_examples(scene, 4)
    rows["examples of a quarter of the stiffness"] = scaled_examples(scene, 0.25)
    if "forces" in scene:
        rows["no examples"] = without_examples(scene)
        rows["gravity alone, sideways"] = {name: part for name, part in without_examples(scene).items() if name != "forces"} | {"gravity": [3, 0, 0]}
    else:
        rows["a push elsewhere, no examples"] = without_examples(rows["a push elsewhere"])
    return rows


def declared(scene):
    """basis.loads of what the scene does, without its directions."""
    force = example_forces(scene)[0]
    pushes = [{"vertices": part["vertices"], "force": float(np.linalg.norm(part["force"]))} for part in scene.get("forces", [])]
    return {"forces": pushes, "gravity": scene.get("gravity", [0, 0, 0]), "examples": {"stiffness": force["stiffness"]}}


def absolute(asset, source):
    """An asset that may lie elsewhere, without its render mesh."""
    asset = json.loads(json.dumps(asset))
    asset["object"].pop("render_mesh", None)
    for part in (asset["object"], *asset["examples"]):
        part["mesh"] = str((source / part["mesh"]).resolve())
    return asset


def asset_without_inversion(source, variant="recommended"):
    """An asset of an example, absolute(). References that stay inverted are no truth: its material does not."""
    asset = absolute(json.loads((source / f"asset_{variant}.json").read_text()), source)
    asset["object"]["material"]["model"] = "stable_neo_hookean"
    return asset


def trained_asset(source, training, scene):
    asset = asset_without_inversion(source)
    asset |= {"internal_force": "cubature", "cubature": {"elements": ELEMENTS}}
    asset["basis"] |= {"size": MODES, "training": {"nothing": "none", "the scene": "scene", "declared loads": "loads", "all kinds": "auto"}[training]}
    if training == "declared loads":
        asset["basis"]["loads"] = declared(scene)
    return asset


def frames_of(trajectory):
    with h5py.File(trajectory) as f:
        return f["vertices"][()].astype(float)


def fitted(points, onto, mass):
    """`points` moved rigidly onto `onto`, as near as in the mass they come. Kabsch 1976."""
    share = mass / mass.sum()
    a, b = points - share @ points, onto - share @ onto
    u, _, vt = np.linalg.svd((a * mass[:, None]).T @ b)
    return a @ u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt + share @ onto


def error(found, expected, mesh):
    """Mean error over mean displacement, in the mass; of a free body of its shape (docs/error_metrics.md)."""
    mass, rest = mesh["vertex_mass"], mesh["vertices"]
    norm = lambda u: np.sqrt((mass[:, None] * u**2).sum())
    if not mesh["fixed"].any():
        found = [fitted(a, b, mass) for a, b in zip(found, expected)]
        moved = np.mean([norm(fitted(rest, b, mass) - b) for b in expected])
    else:
        moved = np.mean([norm(b - rest) for b in expected])
    return np.mean([norm(a - b) for a, b in zip(found, expected)]) / moved


def mesh_of(bundle):
    with h5py.File(bundle) as f:
        mesh = {name: f["object"][name][()] for name in ("vertices", "tets", "surface", "fixed", "density")}
    corners = mesh["vertices"][mesh["tets"]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    mesh["vertex_mass"] = np.bincount(mesh["tets"].ravel(), np.repeat(volumes * mesh["density"] / 4, 4), len(mesh["vertices"]))
    mesh["mass"] = mesh["vertex_mass"].sum()
    return mesh


def measure(body, programs, output):
    """Table of a body: its tests, and errors by test and training."""
    name, times = BODIES[body]
    source, folder = ROOT / "examples" / name, output / body
    folder.mkdir(parents=True, exist_ok=True)
    scene = json.loads((source / "scene_recommended.json").read_text()) | times
    write = lambda path, content: (folder / path).write_text(json.dumps(content, indent=1) + "\n") and folder / path
    for k, training in enumerate(TRAININGS):
        learned_from = write("scene.json", scene | {"bundle": f"{k}.h5", "output": {"trajectory": "unused.h5"}})
        made_of = write(f"asset_{k}.json", trained_asset(source, training, scene))
        of_a_scene = [] if training == "all kinds" else ["--scene", learned_from]
        run(folder, programs / "exmat-precompute", "bundle", made_of, "-o", f"{k}.h5", "--cache", "cache", *of_a_scene)
    mesh = mesh_of(folder / "0.h5")
    result = {}
    for row, (test, changed) in enumerate(tests(scene, mesh).items()):
        errors = []
        every = {"every": scene["steps"] // FRAMES}
        reference = folder / f"full_{row}.h5"
        full = write(f"full_{row}.json", changed | {"bundle": "0.h5", "output": {"trajectory": reference.name} | every})
        if not reference.exists():
            run(folder, programs / "exmat-precompute", "full-space", full, "-o", reference)
        last = len(TRAININGS) - 1
        for k, space in [(k, "reduced") for k in range(len(TRAININGS))] + [(last, space) for space in SPACES]:
            of_body = {"bundle": f"{k}.h5", "space": space, "output": {"trajectory": "run.h5"} | every}
            run(folder, programs / "exmat-runtime", "run", write("run.json", changed | of_body))
            errors.append(error(frames_of(folder / "run.h5")[1:], frames_of(reference)[1:], mesh))
        result[test] = errors
        print(body, test, " ".join(f"{100 * e:.2g} %" for e in errors), flush=True)
    return result


def page(tables):
    lines = ["# Loads that training has not seen", "",
             f"Written by `examples/tools/other_loads.py --write`: error of the reduced motion (r = {MODES}, s = {ELEMENTS}, stable neo-Hookean)",
             "against the full space, mean over 1.5 to 2 s (the cross 0.6 s), of the position, on the free cross of the shape",
             "([definitions](../error_metrics.md)). Columns are what the basis and the cubature of a bundle have learned from, rows",
             "what the bundle is then run with. The last two columns step in all vertices, whatever the basis has learned.", ""]
    lines += [line for name, text in (TRAININGS | SPACES).items() for line in textwrap.wrap(f"- {name}: {text}.", 120, subsequent_indent="  ")]
    lines += ["", "Make the bundle for the scene that it is to run (`--scene`), and make it again when the loads change: their sizes may",
              "differ by a factor of four, their directions and vertices may not. If loads are known only when the scene runs, declare",
              "what is known of them (`basis.loads`), take a larger `basis.size`, and look at `/fidelity`, which says how far loads of",
              "that kind are from the full space. If no example acts and the body is stiff, `basis.training`: `none` is as good and",
              "takes no time. Strong pushes anywhere on a soft body are beyond 30 modes of any kind: take space `auto`, which costs",
              "4 to 9 times as much a step while such a load acts."]
    for body, rows in tables.items():
        lines += ["", f"## {body.capitalize()}", "", "| run with | " + " | ".join(TRAININGS | SPACES) + " |",
                  "| --- |" + " ---: |" * len(TRAININGS | SPACES)]
        lines += [f"| {test} | " + " | ".join(f"{100 * e:.2g} %" for e in errors) + " |" for test, errors in rows.items()]
    return "\n".join(lines) + "\n"


def parser_of(description, bodies):
    """Of the arguments that tools which measure bodies share."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", nargs="*", metavar="BODY", choices=[[], *bodies])
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--write", action="store_true")
    return parser


def main():
    options = parser_of(__doc__, BODIES).parse_args()
    output = ROOT / "build/other_loads"
    tables = {body: measure(body, options.programs.resolve(), output) for body in options.bodies or BODIES}
    print(page(tables))
    if options.write and len(tables) == len(BODIES):
        (ROOT / "docs/studies/other_loads.md").write_text(page(tables))


if __name__ == "__main__":
    main()
