#!/usr/bin/python3
"""Measure how far the paper's six scenes are from the full space with their recommended assets, and with other sizes of the basis.

Usage: accuracy.py [--split] [--write] [--programs build/release/bin] [SCENE ...]    (bar-cuboid; all where none is named; Debian: python3-h5py)

Everything goes to build/accuracy, where motions in full space are found again. --split also tells what each approximation adds to the error. --write
renews docs/studies/accuracy.md from all that has been measured. Ten minutes, half as much again for the split.
"""
import argparse
import json
import pathlib
import shutil

from other_loads import ROOT, absolute, error, frames_of, mesh_of, run

# Folder and variant; a material that tets do not stay inverted with, where the paper's does not do: a reference with inverted tets is no truth.
SCENES = {
    "bar-cuboid": ("04_bar_cuboid", "recommended", None),
    "bar-cylinder": ("05_bar_cylinder", "recommended", None),
    "cross": ("06_cross", "recommended", "stable_neo_hookean"),
    "car": ("03_car_wall", "s_recommended", "stable_neo_hookean"),
    "teddy-global": ("07_teddy_global", "recommended", None),
    "teddy-local": ("08_teddy_local", "recommended", None),
}
SIZES = {"recommended": None, "20": (20, 60), "42": (42, 84)}  # r, s
FRAMES = 100

HEAD = """# The six scenes beside their full space

Written by `examples/tools/accuracy.py --split --write` on {processor}.
The error is the mean over the whole scene against
the full space: of the position, and of the free cross and car of the shape ([definitions](../error_metrics.md)). The
cross and the car have stable neo-Hookean material here, since St.Venant-Kirchhoff leaves tets inverted in their full
space. The time of a step depends on r and s: [performance](../performance.md#whole-steps-avx512).

| scene | m | r | s | internal force | error |
| --- | ---: | ---: | ---: | --- | ---: |
{rows}
The teddy of local examples with 20 modes is above 3 %: its internal force is exact there (a polynomial), so 20 modes
are too few for an arm that moves alone. The cross and the car, which are free, are 2 to 3 % off with all of them.

## What each approximation adds

[Errors by source](../error_metrics.md#errors-by-source) of the recommended assets. The full problem has twice the
eigenfunctions and half the time step of the scene, so the total is not the error above, which is against the full space
with the scene's own settings. The part of the alignment is not known: poses are on the rest example's mesh, not the
object's. "Settled" is the total in the last tenth of the time.

| scene | {sources} | total | settled |
| --- | {rules} |
{split}
The part of the eigenfunctions says how far the motion moves with twice as many. It is not a distance from a limit:
functions finer than a few edges follow the tessellation more than the pose. If the mesh has no more of them, the part
is not known.

![The bar's error by its sources](bar-cuboid-sources.svg)
"""
SOURCES = {"time_step": "time step", "eigenfunctions": "eigenfunctions", "targets": "targets", "basis": "basis", "cubature": "cubature", "table": "table"}


def inputs(name):
    """Asset and scene of SCENES, the scene with FRAMES frames of its trajectory."""
    folder_name, variant, material = SCENES[name]
    source = ROOT / "examples" / folder_name
    scene = json.loads((source / f"scene_{variant}.json").read_text())
    asset = absolute(json.loads((source / f"asset_{variant}.json").read_text()), source)
    if material:
        asset["object"]["material"]["model"] = material
        asset["internal_force"] = "cubature"
    return asset, scene | {"output": {"trajectory": "run.h5", "every": max(1, scene["steps"] // FRAMES)}}


def measure(name, size, programs, output):
    """Bundle, run, full space: what a row of the table holds."""
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    asset, scene = inputs(name)
    if SIZES[size]:
        asset["basis"]["size"], asset["cubature"]["elements"] = SIZES[size]
    files = {part: f"{part}_{size}.json" for part in ("asset", "scene")}
    scene["bundle"] = f"{size}.h5"
    (folder / files["asset"]).write_text(json.dumps(asset, indent=1) + "\n")
    (folder / files["scene"]).write_text(json.dumps(scene, indent=1) + "\n")
    run(folder, programs / "exmat-precompute", "bundle", files["asset"], "-o", scene["bundle"], "--scene", files["scene"],
        "--cache", "cache")
    if not (folder / "full.h5").exists():
        run(folder, programs / "exmat-precompute", "full-space", files["scene"], "-o", "full.h5")
    run(folder, programs / "exmat-runtime", "run", files["scene"])
    away = error(frames_of(folder / "run.h5")[1:], frames_of(folder / "full.h5")[1:], mesh_of(folder / scene["bundle"]))
    result = {"m": asset["shape_space"]["eigenfunctions"], "r": asset["basis"]["size"], "s": asset["cubature"]["elements"],
              "internal_force": asset["internal_force"], "error": away}
    (folder / f"result_{size}.json").write_text(json.dumps(result, indent=1) + "\n")


def split(name, programs, output):
    """The error of the recommended asset by its sources, from the files that `measure` has written."""
    folder = output / name
    study = {"name": name, "asset": "asset_recommended.json", "scene": "scene_recommended.json", "timing": {"rounds": 1, "steps": 200}, "sources": {}}
    (folder / "study.json").write_text(json.dumps(study, indent=1) + "\n")
    shutil.rmtree(folder / "study", ignore_errors=True)
    run(folder, programs / "exmat-precompute", "study", "study.json", "-o", "study")


def read(file):
    return json.loads(file.read_text()) if file.exists() else None


def percent(share):
    return f"{100 * share:.2g} %"


def size_row(name, size, result):
    cells = (name if size == "recommended" else "", result["m"], result["r"], result["s"], result["internal_force"], percent(result["error"]))
    return "| " + " | ".join(str(cell) for cell in cells) + " |\n"


def split_row(name, sources):
    parts = {part["source"]: percent(part["added"]["mean"]) if part["added"] else part["status"].replace("_", " ") for part in sources["parts"]}
    cells = [name] + [parts[source] for source in SOURCES] + [percent(sources["total"][kind]) for kind in ("mean", "settled")]
    return "| " + " | ".join(cells) + " |\n"


def page(output):
    """What has been measured, as docs/studies/accuracy.md."""
    results = [(name, size, read(output / name / f"result_{size}.json")) for name in SCENES for size in SIZES]
    studies = [(name, read(output / name / "study/results.json")) for name in SCENES]
    processor = next(line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
    return HEAD.format(processor=processor, rows="".join(size_row(*row) for row in results if row[2]),
                       sources=" | ".join(SOURCES.values()), rules=" | ".join(["---:"] * (len(SOURCES) + 2)),
                       split="".join(split_row(name, study["sources"]) for name, study in studies if study))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", choices=[[], *SCENES])
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--split", action="store_true")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    programs, output = options.programs.resolve(), ROOT / "build/accuracy"
    for name in options.scenes or SCENES:
        for size in SIZES:
            measure(name, size, programs, output)
            print(size_row(name, size, read(output / name / f"result_{size}.json")), end="", flush=True)
        if options.split:
            split(name, programs, output)
            print(split_row(name, read(output / name / "study/results.json")["sources"]), end="", flush=True)
    if options.write:
        (ROOT / "docs/studies/accuracy.md").write_text(page(output))
        picture = output / "bar-cuboid/study/sources.svg"
        if picture.exists():
            shutil.copy(picture, ROOT / "docs/studies/bar-cuboid-sources.svg")


if __name__ == "__main__":
    main()
