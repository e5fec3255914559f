#!/usr/bin/python3
"""Measure how far the paper's six scenes are from the full space with their recommended assets, and with other sizes of the basis.

Usage: accuracy.py [--write] [--programs build/release/bin] [SCENE ...]    (bar-cuboid; all where none is named; Debian: python3-h5py)

Everything goes to build/accuracy, where motions in full space are found again. --write also renews docs/studies/accuracy.md, where all scenes were run.
A quarter of an hour; on a machine that does nothing else, or the times mean little.
"""
import argparse
import json
import pathlib
import shutil
import subprocess
import time

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

Written by `examples/tools/accuracy.py --write` on {processor}. Mean error over the whole scene against the full space, of the position, of the free cross
and car of the shape ([definitions](../error_metrics.md)); the cross and the car with stable neo-Hookean, since St.Venant-Kirchhoff leaves tets inverted
in their full space. A step and a bundle are timed on this machine, the bundle with nothing cached and with its training.

| scene | m | r | s | internal force | error | step [us] | bundle [s] |
| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: |
"""


def measure(name, size, programs, output):
    """One row of the table."""
    folder_name, variant, material = SCENES[name]
    source, folder = ROOT / "examples" / folder_name, output / name
    folder.mkdir(parents=True, exist_ok=True)
    scene = json.loads((source / f"scene_{variant}.json").read_text())
    asset = absolute(json.loads((source / f"asset_{variant}.json").read_text()), source)
    if material:
        asset["object"]["material"]["model"] = material
        asset["internal_force"] = "cubature"
    if SIZES[size]:
        asset["basis"]["size"], asset["cubature"]["elements"] = SIZES[size]
    files = {part: f"{part}_{size}.json" for part in ("asset", "scene")}
    scene |= {"bundle": f"{size}.h5", "output": {"trajectory": "run.h5", "every": max(1, scene["steps"] // FRAMES)}}
    (folder / files["asset"]).write_text(json.dumps(asset, indent=1) + "\n")
    (folder / files["scene"]).write_text(json.dumps(scene, indent=1) + "\n")
    if not SIZES[size]:
        shutil.rmtree(folder / "cache", ignore_errors=True)  # its bundle is timed
    begin = time.monotonic()
    run(folder, programs / "exmat-precompute", "bundle", files["asset"], "-o", scene["bundle"], "--scene", files["scene"],
        "--cache", "cache")
    seconds = time.monotonic() - begin
    if not (folder / "full.h5").exists():
        run(folder, programs / "exmat-precompute", "full-space", files["scene"], "-o", "full.h5")
    run(folder, programs / "exmat-runtime", "run", files["scene"])
    bench = json.loads(subprocess.run([programs / "exmat-runtime", "bench", files["scene"], "--json", "--progress", "none"], cwd=folder,
                                      check=True, capture_output=True, text=True).stdout)
    away = error(frames_of(folder / "run.h5")[1:], frames_of(folder / "full.h5")[1:], mesh_of(folder / scene["bundle"]))
    cells = (name if size == "recommended" else "", asset["shape_space"]["eigenfunctions"], asset["basis"]["size"], asset["cubature"]["elements"],
             asset["internal_force"], f"{100 * away:.2g} %", f"{bench['step']['median_us']:.1f}", "" if SIZES[size] else f"{seconds:.0f}")
    row = "| " + " | ".join(str(cell) for cell in cells) + " |"
    print(row, flush=True)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", choices=[[], *SCENES])
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    names = options.scenes or list(SCENES)
    rows = [measure(name, size, options.programs.resolve(), ROOT / "build/accuracy") for name in names for size in SIZES]
    if options.write and len(names) == len(SCENES):
        processor = next(line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
        (ROOT / "docs/studies/accuracy.md").write_text(HEAD.format(processor=processor) + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
