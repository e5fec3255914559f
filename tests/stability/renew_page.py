#!/usr/bin/python3
"""Puts the tables of the stability suite into its page.

Usage: renew_page.py TABLES.md PAGE.md    the part of PAGE.md between the marks of results becomes TABLES.md
"""
import sys
from pathlib import Path

BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"


def main():
    tables, page = Path(sys.argv[1]), Path(sys.argv[2])
    text = page.read_text()
    if BEGIN not in text or END not in text:
        sys.exit(f"{page}: expected the marks {BEGIN} and {END}, found none")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    page.write_text(f"{before}{BEGIN}\n{tables.read_text()}{END}{after}")


if __name__ == "__main__":
    main()
