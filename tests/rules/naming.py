#!/usr/bin/python3
"""clang-tidy's identifier naming over every source that is compiled.

Usage: naming.py ROOT BUILD_FOLDER    prints each violation; exit status 1 if there are any.

Reads the units of the build: most of the time goes into the headers of Eigen and the library, once for each, so that a unity build
(preset release) takes a third of the time of one by single sources.
"""
import json
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FOLDERS = ("common", "precompute", "runtime")
CHECKS = "-*,readability-identifier-naming"
FLAGS = ("-I", "-D", "-std=", "-m")


def sources_of(unit):
    """What a unit of a unity build includes; else itself."""
    return [Path(name) for name in re.findall(r'^#include "(/.*[.]cpp)"$', unit.read_text(), re.M)] if unit.parent.name == "Unity" else [unit]


def units(root, build):
    """(flags, unit) of what has sources of the project."""
    for entry in json.loads((build / "compile_commands.json").read_text()):
        unit = Path(entry["file"])
        if any(source.is_relative_to(root / folder) for source in sources_of(unit) for folder in FOLDERS):
            words = shlex.split(entry["command"])
            yield [word for word in words if word.startswith(FLAGS)] + ["-isystem" + word for before, word in zip(words, words[1:]) if before == "-isystem"], unit


def check(root, flags, unit):
    """Violations in a unit and its headers."""
    result = subprocess.run(["clang-tidy", "-quiet", f"--checks={CHECKS}", f"--config-file={root}/.clang-tidy",
                             f"--header-filter=^{root}/({'|'.join(FOLDERS)})/.*[.](h|hpp|cpp)$", str(unit), "--", *flags], capture_output=True, text=True)
    found = {line for line in result.stdout.splitlines() if re.search(r"\b(error|warning):", line)}
    return found if found or result.returncode == 0 else {f"{unit}: clang-tidy: {result.stderr[-1000:]}"}


def violations(root, build):
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return sorted(set().union(*pool.map(lambda unit: check(root, *unit), units(root, build))))


def main():
    found = violations(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
    print("\n".join(found) if found else "all names hold")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
