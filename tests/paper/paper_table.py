#!/usr/bin/python3
"""Print Table 2 of the paper with our columns beside the paper's, from the bundles and times of the examples.

Usage: paper_table.py [--write] [--programs build/release/bin]    (Debian: python3-h5py)

Bundles that are missing in build/examples, or older than their asset, are made first. --write also renews docs/paper_table.md.
The method of Zhu et al. as we wrote it is exmat-paper-baseline (tests/paper), beside the other programs.
"""
import argparse
import json
import pathlib
import platform
import subprocess
import sys

import h5py

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "tools"))
import pose  # noqa: E402

# Scene: its example here; DOFs, tets, vertices of the last example, m, r, s; t_interp, t_total of Zhu et al. and of the paper [ms].
PAPER = {
    "bar-cuboid": ("04_bar_cuboid", "{}", (981, 1053, 327, 10, 30, 60), (51.2, 55.5), (35.1, 41.5)),
    "bar-cylinder": ("05_bar_cylinder", "{}", (981, 1053, 2478, 10, 30, 60), (266.8, 271.6), (32.7, 39.4)),
    "cross": ("06_cross", "{}", (4683, 4912, 3172, 10, 42, 21), (564.1, 592.4), (11.9, 18.3)),
    "car": ("03_car_wall", "s_{}", (2181, 2369, 1019, 6, 20, 23), (207.7, 221.6), (16.7, 21.2)),
    "teddy-global": ("07_teddy_global", "{}", (1773, 1755, 11193, 6, 30, 30), (70.3, 83.5), (28.7, 33.4)),
    "teddy-local": ("08_teddy_local", "{}", (1773, 1755, 11193, 6, 30, 30), (302.8, 313.7), (33.2, 38.4)),
}
KINDS = ("paper", "recommended")
BASELINE = """How many times as long the full-space method of Zhu et al. takes: t_interp / t_total. The first column of ratios is the
paper's own. The others compare the baseline, which is that method as we wrote it (`tests/paper`), with ours on one
machine, with the paper's m, r and s. All are medians, the baseline's over its first 50 steps."""


class Failed(Exception):
    """The last line that a program said before it failed."""


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise Failed(done.stderr.strip().splitlines()[-1])
    return done.stdout


def sizes_of(bundle, asset):
    """DOFs, tets, vertices of the last example, m, r, s."""
    last = json.loads(asset.read_text())["examples"][-1]["mesh"]
    with h5py.File(bundle) as f:
        return (3 * len(f["/object/vertices"]), len(f["/object/tets"]), len(pose.read(asset.parent / last)[0]),
                len(f["/shape_space/eigenvalues"]), f["/modal/basis"].shape[2], len(f["/cubature/weights"]))


def bench(scene, folder, target, programs):
    """Interpolation and whole step, median [us]; the target from the table or by minimisation in each step."""
    content = json.loads(scene.read_text())
    for part in [content["examples"]] if "examples" in content else content["regions"]:
        part["target"] = target
    changed = folder / f"bench_{target}_{scene.name}"
    changed.write_text(json.dumps(content))
    result = json.loads(run(programs / "exmat-runtime", "bench", changed, "--json", "--progress", "none"))
    interpolation = sum(result["stages"][name]["median_us"] for name in ("weights", "target"))
    return interpolation, result["step"]["median_us"]


def files_of(name, variant):
    """Asset, scene, and the folder of its bundle."""
    source, folder = ROOT / "examples" / name, ROOT / "build" / "examples" / name
    folder.mkdir(parents=True, exist_ok=True)
    return source / f"asset_{variant}.json", source / f"scene_{variant}.json", folder


def made(bundle, asset, programs, *options):
    """The bundle, after it was made where it was missing or older than its asset."""
    if not bundle.exists() or bundle.stat().st_mtime < asset.stat().st_mtime:
        print(f"paper_table: {bundle.name}", file=sys.stderr)
        run(programs / "exmat-precompute", "bundle", asset, "-o", bundle, *options)
    return bundle


def measure(name, variant, programs):
    """Sizes, and times with the target by minimisation (as in the paper) and from the table."""
    asset, scene, folder = files_of(name, variant)
    bundle = made(folder / json.loads(scene.read_text())["bundle"], asset, programs, "--scene", scene)
    return sizes_of(bundle, asset), bench(scene, folder, "solve", programs), bench(scene, folder, "auto", programs)


def baseline(name, variant, programs):
    """Interpolation and whole step of the method of Zhu et al. as we wrote it, median [us]."""
    asset, scene, folder = files_of(name, variant)
    content = json.loads(scene.read_text())
    content["bundle"] = made(folder / f"whole_{content['bundle']}", asset, programs).name
    changed = folder / f"baseline_{scene.name}"
    changed.write_text(json.dumps(content))
    result = json.loads(run(programs / "exmat-paper-baseline", changed, "--progress", "none"))
    return result["interp_us"], result["median_us"]


def table(head, rows):
    """Markdown with columns of one width."""
    cells = [head, *rows]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    columns = zip(*cells)
    columns = [[c.rjust(w) if k else c.ljust(w) for c in column] for k, (column, w) in enumerate(zip(columns, widths))]
    lines = ["| " + " | ".join(row) + " |" for row in zip(*columns)]
    rule = "| " + " | ".join("-" * (w - 1) + (":" if k else "-") for k, w in enumerate(widths)) + " |"
    return "\n".join([lines[0], rule, *lines[1:]])


def rows_of(kind, programs):
    """Rows of sizes and of times, and why a scene has none."""
    sizes, times, failures = [], [], []
    for scene, (name, variant, paper_sizes, zhu, paper) in PAPER.items():
        try:
            ours, solved, tabled = measure(name, variant.format(kind), programs)
        except Failed as failure:
            failures.append(f"{scene} is left out: {str(failure).replace(f'{ROOT}/', '')}")
            continue
        sizes.append([scene, *(f"{a} / {b}" for a, b in zip(ours, paper_sizes))])
        times.append([scene, *(f"{t}" for t in (zhu[0], paper[0])), f"{solved[0]:.1f}", f"{tabled[0]:.1f}",
                      f"{1000 * paper[0] / solved[0]:.0f}", *(f"{t}" for t in (zhu[1], paper[1])), f"{solved[1]:.1f}",
                      f"{tabled[1]:.1f}", f"{1000 * paper[1] / solved[1]:.0f}", f"{1000 * paper[1] / tabled[1]:.0f}"])
    return sizes, times, failures


def pair(first, second, form="{:.3g}"):
    return f"{form.format(first)} / {form.format(second)}"


def baseline_row(scene, zhu, paper, here, solved, tabled):
    """How many times as long the method of Zhu et al. takes: by the paper, and as we wrote it by ours."""
    return [scene, pair(zhu[0] / paper[0], zhu[1] / paper[1]), pair(1e-3 * here[0], 1e-3 * here[1]),
            *(pair(here[0] / ours[0], here[1] / ours[1], "{:.0f}") for ours in (solved, tabled))]


def baseline_table(programs):
    rows = []
    for scene, (name, variant, _, zhu, paper) in PAPER.items():
        variant = variant.format("paper")
        _, solved, tabled = measure(name, variant, programs)
        rows.append(baseline_row(scene, zhu, paper, baseline(name, variant, programs), solved, tabled))
    return table(["scene", "Zhu et al. by the paper", "baseline here [ms]", "baseline by ours, solve", "baseline by ours, table"], rows)


def report(programs):
    parts = []
    for kind in KINDS:
        sizes, times, failures = rows_of(kind, programs)
        title = {"paper": "With the paper's m, r and s", "recommended": "With the m, r and s that we recommend"}[kind]
        parts += [f"## {title}", "Sizes, ours / the paper's:",
                  table(["scene", "DOFs", "tets", "example vertices", "m", "r", "s"], sizes),
                  "Times of one step (Zhu et al. and the paper: ms; ours: us, median, one core):",
                  table(["scene", "interp: Zhu ms", "paper ms", "solve us", "table us", "ratio", "total: Zhu ms", "paper ms",
                         "solve us", "table us", "ratio", "ratio (table)"], times), *failures]
    parts += ["## Beside the method of Zhu et al.", BASELINE, baseline_table(programs)]
    return "\n\n".join(parts) + "\n"


def cpu():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    return next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), platform.machine())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build" / "release" / "bin")
    a = parser.parse_args()
    text = report(a.programs)
    print(text)
    if a.write:
        head = f"""# The paper's Table 2

Written by `tests/paper/paper_table.py --write` on {cpu()}. The paper's columns were measured on an Intel Core i5 at
2.8 GHz. t_interp is the interpolation of the examples (here the stages weights and target of `exmat-runtime bench`),
t_total a whole step. "solve" finds the target by minimisation in each step, as the paper does. "table" takes it from
the bundle's table, the default of a scene. A ratio is the paper's time by ours (with "solve" unless it says otherwise).
DOFs, tets, m, r and s are read from the bundles, the vertices from the mesh of the last example.

Compare ratios here, not microseconds: the six scenes run one after the other beside whatever else the machine does. The
time of a step by r and s on a quiet machine is in [performance](performance.md#whole-steps-avx512).

"""
        (ROOT / "docs" / "paper_table.md").write_text(head + text)


if __name__ == "__main__":
    main()
