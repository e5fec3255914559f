#!/usr/bin/python3
"""Runs exmat-benchmark with every instruction set and writes the results into docs/performance.md.

Usage: report.py --results DIR --page PAGE.md [--compiler NAME] [--run EXMAT-BENCHMARK] [--worlds]
Without --run, the JSON files of an earlier run in DIR are reported again. The targets `benchmark` and, with --worlds, `worlds_benchmark` of the build call it.
"""
import argparse
import json
import os
import re
import subprocess
import textwrap
from pathlib import Path

SETS = ("avx512", "avx2", "portable")  # the fastest first; the first one that the machine has runs everything
REPETITIONS = 5
WORLD_REPETITIONS = CROWD_REPETITIONS = 3
KERNELS = {
    "force_and_stiffness": "force and stiffness", "force": "force", "energy": "energy",
    "polynomial": "polynomial (force and stiffness)", "cholesky": "Cholesky", "solve": "solve",
    "target_table": "target, table", "target_solve": "target, solve", "weights": "weights",
    "positions_1000": "positions of 1,000 vertices", "positions_100000": "positions of 100,000 vertices"}
MATERIALS = {"stable_neo_hookean": "stable neo-Hookean", "corotational": "corotational"}
TARGETS = {"no_examples": "no examples", "table": "examples, table", "solve": "examples, solve"}


def run(program, results):
    results.mkdir(parents=True, exist_ok=True)
    first = True
    for name in SETS:
        output = results / f"{name}.json"
        output.unlink(missing_ok=True)
        command = [str(program), f"--benchmark_out={output}", "--benchmark_out_format=json", "--benchmark_min_time=0.1",
                   f"--benchmark_repetitions={REPETITIONS}", "--benchmark_enable_random_interleaving=true",
                   "--benchmark_filter=" + ("-^(world|crowd)/" if first else "^kernel/")]
        subprocess.run(command, check=True, env=os.environ | {"EXMAT_SIMD": name})
        if json.loads(output.read_text())["context"]["instruction_set"] == name:
            first = False
        else:  # this machine does not have it
            output.unlink()


def run_some(program, output, kind, repetitions):
    output.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run([str(program), f"--benchmark_out={output}", "--benchmark_out_format=json", f"--benchmark_filter=^{kind}/", "--benchmark_min_time=0.2",
                    f"--benchmark_repetitions={repetitions}", "--benchmark_enable_random_interleaving=true"], check=True)


class Results:
    """Of one instruction set: for each benchmark the best repetition, and the best DGEMM rate of them all."""

    def __init__(self, path):
        document = json.loads(path.read_text())
        self.name = document["context"]["instruction_set"]
        runs = [run for run in document["benchmarks"] if run["run_type"] == "iteration"]
        self.dgemm = max(run.get("dgemm_gflops", 0) for run in runs)
        self.best = {}
        for run in runs:
            real = run["run_name"].endswith("/real_time")
            nanoseconds = run["real_time" if real else "cpu_time"]
            name = re.sub("/iterations:[0-9]+", "", run["run_name"].removesuffix("/real_time"))
            if name not in self.best or nanoseconds < self.best[name]["nanoseconds"]:
                self.best[name] = run | {"nanoseconds": nanoseconds}

    def microseconds(self, name):
        return self.best[name]["nanoseconds"] / 1e3

    def ratio(self, name):
        return self.best[name]["nanoseconds"] * self.dgemm / self.best[name]["flops"]

    def cell(self, name):
        return f"{number(self.microseconds(name))} ({number(self.ratio(name))})" if name in self.best else ""


def number(value):
    if value >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def paragraph(text):
    return textwrap.fill(text, 120, break_long_words=False, break_on_hyphens=False)


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join(["---"] * len(header)) + " |"]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def by_size(name):
    """Orders kernel/NAME/rR/sS by R and S."""
    return [int(size) for size in re.findall(r"/[rs](\d+)", name)]


def machine(results, compiler):
    info = Path("/proc/cpuinfo").read_text()
    model = re.search(r"model name\s*: (.*)", info)
    caches = {}
    for index in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        level, kind, size = ((index / part).read_text().strip() for part in ("level", "type", "size"))
        if kind != "Instruction":
            caches[level] = size
    rates = ", ".join(f"{result.dgemm:.1f} ({result.name})" for result in results)
    return table(("machine", ""), [
        ("processor", model.group(1) if model else "unknown"),
        ("cores", os.cpu_count()),
        ("caches", ", ".join(f"L{level} {size}" for level, size in caches.items())),
        ("compiler", compiler),
        ("DGEMM in one thread [GFLOP/s]", rates)])


def kernels(results):
    rows = []
    for kernel, title in KERNELS.items():
        names = sorted((name for name in results[0].best if name.startswith(f"kernel/{kernel}/")), key=by_size)
        for name in names:
            sizes = by_size(name) + [""]
            rows.append((title, sizes[0], sizes[1], *(result.cell(name) for result in results)))
    return table(("kernel", "r", "s", *(result.name for result in results)), rows)


def materials(results):
    """Times over those of St.Venant-Kirchhoff, of 60 elements."""
    rows = []
    for material, title in MATERIALS.items():
        for kernel in list(KERNELS)[:3]:
            suffix = f"kernel/{kernel}_{material}/"
            found = (name for name in results[0].best if name.startswith(suffix) and name.endswith("/s60"))
            for name in sorted(found, key=by_size):
                base = name.replace(f"_{material}", "")
                ratios = (result.microseconds(name) / result.microseconds(base) for result in results)
                rows.append((title, KERNELS[kernel], *by_size(name), *(f"{ratio:.2f}" for ratio in ratios)))
    return table(("material", "kernel", "r", "s", *(result.name for result in results)), rows)


def steps(result):
    found = {tuple(name.split("/")[1:]) for name in result.best if name.startswith("step/")}
    cubature = sorted((force for _, force, _ in found if force[1:].isdigit()), key=lambda force: int(force[1:]))
    columns = [*dict.fromkeys(cubature), "polynomial"]
    rows = []
    for modes in sorted({modes for modes, _, _ in found}):
        for target, title in TARGETS.items():
            rows.append((modes[1:], title, *(result.cell(f"step/{modes}/{force}/{target}") for force in columns)))
    titles = [f"s = {force[1:]}" if force[1:].isdigit() else force for force in columns]
    return table(("r", "", *titles), rows)


def free_bodies(result):
    rows = []
    for name in sorted((name for name in result.best if name.startswith("free/")), key=by_size):
        modes, elements = name.split("/")[1:]
        free, clamped = result.microseconds(name), result.microseconds(f"step/{modes}/{elements}/table")
        rows.append((modes[1:], elements[1:], number(clamped), number(free), f"{free / clamped:.2f}"))
    return table(("r", "s", "clamped [us]", "free [us]", "ratio"), rows)


def contacts(result):
    found = sorted((name for name in result.best if name.startswith("contact/")),
                   key=lambda name: result.best[name]["near_vertices"])
    away = result.microseconds(found[0])
    rows = []
    for name in found:
        near, time = int(result.best[name]["near_vertices"]), result.microseconds(name)
        rows.append((near, number(time), number((time - away) / near) if near else ""))
    return table(("vertices near the floor", "a step [us]", "a vertex [us]"), rows)


def sizes(result):
    names = {int(name.split("/")[1].removesuffix("_tets")): name for name in result.best if name.startswith("size/")}
    first = result.microseconds(names[min(names)])
    rows = []
    for tets, name in sorted(names.items()):
        time, read = result.microseconds(name), result.best[name]["bytes_read"]
        rows.append((f"{tets:,}", number(time), f"{time / first:.2f}", f"{read:,.0f}"))
    return table(("tets", "a step [us]", "over the smallest", "bytes read at load"), rows)


def crowds(result):
    """A row for each number of bodies, a column for each model and number of threads; and the ratios of the largest."""
    found = sorted((name.split("/")[1:] for name in result.best if name.startswith("crowd/")), key=lambda name: (name[0], *(int(size[1:]) for size in name[1:3])))
    rows = []
    for kind in dict.fromkeys(name[0] for name in found):
        for count in sorted({int(name[4]) for name in found}):
            cells = []
            for modes, elements in dict.fromkeys((name[1], name[2]) for name in found):
                for threads in ("threads1", "threads2"):
                    name = "/".join(("crowd", kind, modes, elements, threads, str(count)))
                    cells.append(f"{number(result.microseconds(name) / count)} ({number(result.ratio(name))})" if name in result.best else "")
            if any(cells):
                rows.append((kind.replace("_", ", "), f"{count:,}", *cells))
    titles = [f"r = {modes[1:]}, s = {elements[1:]}, {threads}" for modes, elements in dict.fromkeys((name[1], name[2]) for name in found)
              for threads in ("1 thread", "2")]
    return table(("", "bodies", *titles), rows)


def over_elements(result, bodies=1000):
    """How many times as long clamped bodies side by side take as the flops of one by itself, whose stiffness is a sum over elements."""
    found = []
    for alone in (name for name in result.best if re.fullmatch("crowd/clamped/r[0-9]+/s[0-9]+/threads1/1", name)):
        together = alone.removesuffix("/1") + f"/{bodies}"
        if together in result.best:
            found.append((by_size(alone), result.microseconds(together) / bodies / result.microseconds(alone) * result.ratio(alone)))
    return ", ".join(f"{number(ratio)} (r = {size[0]}, s = {size[1]})" for size, ratio in sorted(found))


def report_crowds(result):
    return paragraph(
        f"Microseconds of wall clock for a step of one body, the best of {CROWD_REPETITIONS} ({result.name}), four examples, table, 1 ms; "
        "each is thrown by a speed of its own, free ones turn. In parentheses how many times as long as its flops at the DGEMM rate of one "
        "thread. Side by side the stiffness is a polynomial where that has fewer flops, and those are counted. Over the flops of one by "
        f"itself, a sum over elements, 1,000 clamped bodies take {over_elements(result)}.") + "\n\n" + crowds(result)


def worlds(result):
    cells = {"apart": ("on the floor, apart", (8, 200)), "stacks": ("stacks of five", (5, 100)), "heap": ("stacks that lean on each other", (5, 100))}
    rows = [("a body on the floor, alone", 1, "", number(result.microseconds("world/alone")), ""),
            ("two on each other", 2, "2", number(result.microseconds("world/pair") / 2), "")]
    for kind, (words, counts) in cells.items():
        for count in counts:
            names = [f"world/{kind}/threads{threads}/{count}" for threads in (1, 2)]
            if names[0] not in result.best:
                continue
            per_body = [number(result.microseconds(name) / count) if name in result.best else "" for name in names]
            largest = result.best[names[0]]["largest_island"]
            rows.append((words, f"{count:,}", f"{largest:,.0f}" if largest > 0 else "", *per_body))
    return table(("", "bodies", "largest island", "1 thread", "2 threads"), rows)


def own_contact(result):
    certificate = 1e3 * result.microseconds("world/certificate")
    closed, apart, without = (number(result.microseconds(f"world/fork/{name}")) for name in ("closed", "open", "never"))
    return paragraph(
        f"The test whether a body may touch itself takes {number(certificate)} ns. A fork (r = 20) takes {without} us a step "
        f"without self-contact, {apart} us with it while its prongs are apart, {closed} us while they press on each other.")


def report_worlds(result):
    return "\n\n".join((
        paragraph(
            f"Microseconds of wall clock for a step of one body, the best of {WORLD_REPETITIONS} ({result.name}): blocks of r = 20, s = 96, "
            "45 vertices on the surface, without examples, at rest on a floor and on each other, 2 ms."),
        worlds(result), own_contact(result)))


def report(results, compiler):
    fastest = results[0]
    return "\n\n".join((
        machine(results, compiler),
        paragraph(
            f"Each number is the best of {REPETITIONS} repetitions, which were taken in random order so that a disturbance "
            "does not hit all of one benchmark's. Times of one thread are of its processor time, those of several bodies "
            "of the wall clock."),
        f"### Whole steps ({fastest.name})\n\nMicroseconds of a step; in parentheses how many times as long as its "
        "flops at the DGEMM rate.",
        steps(fastest),
        f"### Free bodies ({fastest.name})\n\nFour examples, table; the free bar spins at 2 rad/s.",
        free_bodies(fastest),
        f"### Contact ({fastest.name})\n\nA free bar, r = 20, s = 30, no examples, on a floor or 100 m above it.",
        contacts(fastest),
        f"### Size of the mesh ({fastest.name})\n\nThe same reduced model (r = 20, s = 60, four examples, table) in "
        "bundles of meshes that differ in size alone,\nloaded as `exmat-runtime run` does without a trajectory.",
        sizes(fastest),
        "### Kernels\n\nMicroseconds; in parentheses how many times as long as its flops at the DGEMM rate of the same "
        "instruction set.",
        kernels(results),
        "### Materials\n\nThe kernels of other materials: times over those of St.Venant-Kirchhoff in the same run.",
        materials(results)))


def put(page, name, result):
    """Between the marks of that name."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    text = page.read_text()
    before, after = text[:text.index(begin) + len(begin)], text[text.index(end):]
    page.write_text(f"{before}\n{result}\n{after}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--results", type=Path, required=True)
    parser.add_argument("--page", type=Path, required=True)
    parser.add_argument("--compiler", default="unknown")
    parser.add_argument("--worlds", action="store_true", help="of bodies that touch, instead of all else")
    parser.add_argument("--crowds", action="store_true", help="of many bodies, likewise")
    parser.add_argument("--bullet", action="store_true", help="what the comparison with Bullet prints, likewise")
    options = parser.parse_args()
    if options.bullet:
        put(options.page, "bullet", subprocess.run([options.run], check=True, capture_output=True, text=True).stdout.strip())
        return
    for name, wanted, repetitions, write in (("world", options.worlds, WORLD_REPETITIONS, report_worlds), ("crowd", options.crowds, CROWD_REPETITIONS, report_crowds)):
        if not wanted:
            continue
        output = options.results / f"{name}s.json"
        if options.run:
            run_some(options.run, output, name, repetitions)
        put(options.page, f"{name}s", write(Results(output)))
        return
    if options.run:
        run(options.run, options.results)
    results = [Results(path) for name in SETS if (path := options.results / f"{name}.json").exists()]
    put(options.page, "results", report(results, options.compiler))


if __name__ == "__main__":
    main()
