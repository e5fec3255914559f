#!/usr/bin/python3
"""Alignments of bodies whose true poses are known, as tables: how many are wrong, and what doubt says of that.

Usage: report.py PROGRAM [--jobs N] [--seed N] [--every N] [--lines FILE.csv] [--page PAGE.md] [--check]
Reads the lines if they are there; renews a page; --every takes each Nth case of a kind; --check fails where the limits are not kept.
"""
import argparse
import csv
import statistics
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

BEGIN, END = "<!-- truth: begin -->", "<!-- truth: end -->"
KINDS = 12
MEMBERS = "kind body pose verdict doubt residual ideal ours seconds truth message".split()
MOST_REFUSED, MOST_ERROR = 0.05, 1.4  # share of cases; median of the error over that of the ideal projection
CLASSES = [0, 0.25, 0.5, 0.8, 1.2, float("inf")]


def lines_of(arguments):
    if arguments.lines and arguments.lines.exists():
        return arguments.lines.read_text()

    def run(kind):
        command = [arguments.program, "--seed", str(arguments.seed), "--every", str(arguments.every), "--kind", str(kind)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    with ThreadPoolExecutor(arguments.jobs) as pool:
        text = "".join(pool.map(run, range(KINDS)))
    if arguments.lines:
        arguments.lines.write_text(text)
    return text


def cases_of(text):
    cases = [dict(zip(MEMBERS, row)) for row in csv.reader(text.splitlines())]
    for case in cases:
        case.update({name: float(case[name]) for name in ("doubt", "residual", "ideal", "ours", "seconds")}, wrong=case["truth"] == "wrong")
    return cases


def row(name, cases):
    of = lambda verdict, wrong: sum(c["verdict"] == verdict and c["wrong"] == wrong for c in cases)
    taken = [c["ours"] / c["ideal"] for c in cases if c["verdict"] != "refused"]
    cells = [name, len(cases)] + [f"{of(v, False) + of(v, True)} ({of(v, True)})" for v in ("good", "doubtful", "refused")]
    cells += [f"{statistics.median(taken):.2f}" if taken else "-", f"{statistics.median(c['seconds'] for c in cases):.1f}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def tables(cases):
    groups = lambda member: {name: [c for c in cases if c[member] == name] for name in dict.fromkeys(c[member] for c in cases)}
    lines = ["| meshes, bodies | cases | good (wrong) | warned of (wrong) | refused (wrong) | median error | CPU s |", "| --- | --- | --- | --- | --- | --- | --- |"]
    lines += [row(name, group) for member in ("kind", "body") for name, group in groups(member).items()]
    lines += [row("all", cases), ""]
    silent = sum(c["wrong"] and c["verdict"] == "good" for c in cases)
    refused = sum(not c["wrong"] and c["verdict"] == "refused" for c in cases)
    lines += [f"Silently wrong: {silent} of {len(cases)}. Refused though right: {refused} ({100 * refused / len(cases):.1f} %).", ""]
    lines += ["| doubt | cases | wrong |", "| --- | --- | --- |"]
    for low, high in zip(CLASSES, CLASSES[1:]):
        group = [c for c in cases if low <= c["doubt"] < high]
        wrong = sum(c["wrong"] for c in group)
        name = f"{low} to {high}" if high < float("inf") else f"above {low}"
        lines += [f"| {name} | {len(group)} | {wrong}" + (f" ({100 * wrong / len(group):.0f} %) |" if group else " |")]
    over = [(c["ours"] - c["ideal"], c["doubt"]) for c in cases]
    pairs = [a[1] > b[1] for a in over for b in over if a[0] > b[0] + 0.1]
    lines += ["", f"Of two cases whose errors differ by more than 0.1, doubt puts {100 * sum(pairs) / max(1, len(pairs)):.0f} % in their order."]
    return "\n".join(lines) + "\n"


def broken_limits(cases):
    silent = [f"silently wrong: {c['kind']}, {c['body']}, {c['pose']}" for c in cases if c["wrong"] and c["verdict"] == "good"]
    refused = sum(not c["wrong"] and c["verdict"] == "refused" for c in cases) / len(cases)
    error = statistics.median(c["ours"] / c["ideal"] for c in cases if c["verdict"] != "refused")
    return (silent + [f"right ones refused: {refused:.3f} of all, at most {MOST_REFUSED}"] * (refused > MOST_REFUSED) +
            [f"median error: {error:.2f}, at most {MOST_ERROR}"] * (error > MOST_ERROR))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--lines", type=Path)
    parser.add_argument("--page", type=Path)
    arguments = parser.parse_args()
    cases = cases_of(lines_of(arguments))
    text = tables(cases)
    print(text)
    if arguments.page:
        page = arguments.page.read_text()
        arguments.page.write_text(page[:page.index(BEGIN) + len(BEGIN)] + "\n" + text + page[page.index(END):])
    broken = broken_limits(cases) if arguments.check else []
    print("\n".join(broken))
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
