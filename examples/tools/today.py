#!/usr/bin/python3
"""Figures that docs/studies/README.md opens with, from the tables of the pages beside it.

Usage: today.py ROW    prints the least and the largest number [%] of the row's table
"""
import re
import sys
from pathlib import Path

STUDIES = Path(__file__).resolve().parents[2] / "docs/studies"
ROWS = {
    "recommended assets": ("accuracy.md", r"^\| [a-z-]+ \| \d+ \| .* \| ([\d.]+) % \|$"),
    "hands in the modes": ("hands.md", r"^\| .* \| `reduced` \| ([\d.]+) % "),
    "hands in space auto": ("hands.md", r"^\| .* \| `auto` \| ([\d.]+) % "),
    "learned loads": ("other_loads.md", r"^\| the scene \| [\d.]+ % \| ([\d.]+) % "),
    "other loads in the modes": ("other_loads.md", r"^\| (?!the scene)[^|]* (?:\| [\d.]+ % ){3}\| ([\d.]+) % \|"),
    "other loads in space full": ("other_loads.md", r"^\| (?!the scene)[^|]* (?:\| [\d.]+ % ){5}\| ([\d.]+) % \|"),
}


def main():
    page, pattern = ROWS[sys.argv[1]]
    found = [float(number) for number in re.findall(pattern, (STUDIES / page).read_text(), re.M)]
    print(min(found), max(found))


if __name__ == "__main__":
    main()
