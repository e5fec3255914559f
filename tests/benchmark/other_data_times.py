#!/usr/bin/python3
"""How long the tests of docs/studies/other_data.md take, in its column of seconds.

Usage: other_data_times.py FOLDER_OF_BUILD PAGE.md    runs each test that a row names, and renews the page
"""
import re
import subprocess
import sys
from pathlib import Path


def seconds(build, tests):
    pattern = "|".join(rf"(^|/){name}([./].*)?$" for name in tests)
    out = subprocess.run(["ctest", "--test-dir", build, "-R", pattern], capture_output=True, text=True).stdout
    taken = re.findall(r"(Passed|Failed|Timeout\S*) +([\d.]+) sec", out)
    if not taken or any(result != "Passed" for result, _ in taken):
        sys.exit(f"{pattern}:\n{out}")
    return sum(float(time) for _, time in taken)


def main():
    build, page = sys.argv[1], Path(sys.argv[2])
    lines = page.read_text().splitlines()
    for k, line in enumerate(lines):
        cells = line.split(" | ")
        tests = re.findall(r"`([^`]+)`", cells[4]) if line.startswith("| ") and len(cells) == 6 else []
        if tests:
            cells[5] = f"{seconds(build, tests):.1f} |"
            lines[k] = " | ".join(cells)
            print(lines[k][:80], cells[5], flush=True)
    page.write_text("\n".join(lines) + "\n")


main()
