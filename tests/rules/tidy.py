#!/usr/bin/python3
"""clang-tidy with all checks of .clang-tidy (bugprone, performance, names) over every source that is compiled: the target tidy.

Usage: tidy.py ROOT BUILD_FOLDER [UNIT...]    prints each finding; exit status 1 if there are any. UNIT: a part of the names of units.
"""
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from naming import FOLDERS, units

CHECKS = "-bugprone-suspicious-include"  # units of a unity build include sources


def findings(root, flags, unit):
    """In a unit and its headers."""
    result = subprocess.run(["clang-tidy", "-quiet", f"--checks={CHECKS}", f"--config-file={root}/.clang-tidy",
                             f"--header-filter=^{root}/({'|'.join(FOLDERS)})/.*[.](h|hpp|cpp)$", str(unit), "--", *flags], capture_output=True, text=True)
    found = {line for line in result.stdout.splitlines() if re.search(r"\b(error|warning):", line)}
    return found if found or result.returncode == 0 else {f"{unit}: clang-tidy: {result.stderr[-1000:]}"}


def main():
    root, build, *names = sys.argv[1:]
    root, build = Path(root).resolve(), Path(build).resolve()
    chosen = [entry for entry in units(root, build) if not names or any(name in entry[1].name for name in names)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = sorted(set().union(*pool.map(lambda entry: findings(root, *entry), chosen)))
    print("\n".join(found) if found else f"{len(chosen)} units are clean")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
