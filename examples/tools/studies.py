#!/usr/bin/python3
"""Run the studies of the paper's six scenes, and the two of the reduction alone, and write what came out into build/studies.

Usage: studies [--programs build/release/bin] [--jobs N] [NAME ...]    (bar-cuboid; all where none is named)

Each goes to build/studies/NAME, with its report.html; an interrupted one is resumed there. build/studies/tables.md has the errors and times
of all that have run. Minutes to hours; on a machine that does nothing else, or the times mean little. Exit status 1 if a study fails.
"""
import argparse
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
STUDIES = {
    "bar-cuboid": "04_bar_cuboid/study.json",
    "bar-cylinder": "05_bar_cylinder/study.json",
    "cross": "06_cross/study.json",
    "car": "03_car_wall/study.json",
    "teddy-global": "07_teddy_global/study.json",
    "teddy-local": "08_teddy_local/study.json",
    "reduction-bar": "reduction/bar_study.json",
    "reduction-cross": "reduction/cross_study.json",
}

HEAD = """# Studies of the paper's assets

By `exmat-precompute study` for each scene: error against run time, against the full space. Pages to open in a browser: {pages}.
"""

ERRORS = """
## Errors

Mean, of shape where a body is free and of position where it is not: of r modes with all elements against the full space, and of s cubature elements
against all elements ("of all"). The scenes of the reduction alone have no examples.
{no_truth}
| scene | m | r | all elements | {columns} |
| --- | ---: | ---: | ---: | {rules} |
"""

def percent(share):
    return "-" if share is None else f"{100 * share:.2g} %"


def error_rows(name, result):
    """A line for each m, r: all elements against the full space, each s against all elements."""
    sound = [point for point in result["points"] if not point["failure"]]
    for all_elements in (p for p in sound if p["settings"]["internal_force"] == "all_elements"):
        own = {k: all_elements["settings"].get(k) for k in ("eigenfunctions", "basis_size", "linear_modes", "training", "material", "time_step", "integrator", "elastic_stiffness")}
        by_elements = {}
        for point in sound:
            from_all = point["errors"]["from_all_elements"]
            if from_all and all(point["settings"].get(k) == own[k] for k in own):
                by_elements[point["elements"]] = (point["errors"][result["headline"]]["mean"], from_all["mean"])
        label = f"{name}, training {own['training']}" if name.startswith("reduction") else name
        yield [label, own["eigenfunctions"], own["basis_size"], all_elements["errors"][result["headline"]]["mean"]], by_elements


def error_table(results):
    rows = [row for name, result in results.items() for row in error_rows(name, result)]
    elements = sorted({s for _, cells in rows for s in cells})
    if not elements:
        return ""
    no_truth = "".join(f"\n{name}: {result['no_truth']}\n" for name, result in results.items() if result["no_truth"])
    text = ERRORS.format(no_truth=no_truth, columns=" | ".join(f"s = {s} (of all)" for s in elements), rules=" | ".join("---:" for _ in elements))
    for (name, m, r, error), cells in rows:
        parts = [f"{percent(cells[s][0])} ({percent(cells[s][1])})" if s in cells else "" for s in elements]
        text += f"| {name} | {m} | {r} | {percent(error)} | {' | '.join(parts)} |\n"
    return text


def failures(results):
    lines = []
    for name, result in results.items():
        texts = [p["failure"] for p in result["points"] if p["failure"]]
        lines += [f"- {name}: {len(texts)} failed, the first: {texts[0]}" for _ in texts[:1]]
    return "\n## What failed\n\n" + "\n".join(lines) + "\n" if lines else ""


def write_page(folder):
    results = {name: json.loads((folder / name / "results.json").read_text())
               for name in STUDIES if (folder / name / "results.json").exists()}
    text = HEAD.format(pages=", ".join(f"[{name}]({name}/report.html)" for name in results)) + error_table(results)
    (folder / "tables.md").write_text(text + failures(results))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(STUDIES))
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    unknown = set(options.names) - set(STUDIES)
    if unknown:
        parser.error(f"no study {', '.join(sorted(unknown))}; there are: {', '.join(STUDIES)}")
    folder = ROOT / "build/studies"
    failed = []
    for name in options.names or STUDIES:
        output = folder / name
        output.mkdir(parents=True, exist_ok=True)
        print(f"studies: {name}", file=sys.stderr)
        done = subprocess.run([options.programs / "exmat-precompute", "study", ROOT / "examples" / STUDIES[name], "-o", output,
                               "--jobs", str(options.jobs)])
        if done.returncode:
            failed.append(name)
    write_page(folder)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
