#!/usr/bin/python3
"""Pages print what the programs print: runs the commands of pages and compares each block of output with what came out.

Usage: test_pages.py BUILD_FOLDER [--renew] PAGE...    pages from the top folder: docs/getting_started.md

Each page is run from top to bottom in an empty folder, with the programs and examples/tools in PATH.

- An indented block holds commands of the shell, on pages that name their folder. They end with status 0.
- A fenced block without a language is what the commands since the last such block print (stdout and stderr).
  A line of three dots stands for any number of lines.
- Comments that no reader sees:
  <!-- file: NAME -->    the next fenced block is written to NAME
  <!-- folder: NAME -->  the page's folder, below a top folder that has examples and docs; else build/pages, and
                         indented blocks are not run
  <!-- needs: PACKAGE --> the next run, and the block that it prints, are left out where pkg-config knows no such package
  <!-- run: COMMAND -->  a command that is not shown; EXMAT_TOP is the repository, EXMAT_BUILD the build folder
  <!-- rows: COMMAND --> the command prints the last numbers of each row of the next table; $1, $2... are the row's cells
  <!-- quote: FILE PART --> the next fenced block is what FILE (from the top folder) has between "// recipe: PART" and
                         the next such line; all of it where there is no PART
  <!-- status: N -->     the next command ends with status N
  <!-- skip -->          the next block is neither run nor compared

Lines are compared word by word. Whole numbers below 10,000 are equal. Others agree where they differ by at most half a
percent, or by one in the last place that the page prints; below 1e-9 all are zero. A hash (8 to 64 hexadecimal digits) is any, but the same wherever the page
repeats it. What a clock or the machine says is not compared: lines of progress, the time of a line of the log, numbers
before "us", those of the lines of LINES_OF_TIMES, and those in columns that COLUMNS_OF_TIMES heads.

--renew writes the lines that differ, where only numbers do, into the page.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
TOLERANCE = 0.005
ZERO = 1e-9
COUNTS = 10000

LINES_OF_TIMES = re.compile(r"(steps per second|mean step time|median step time|95 percent step time|real-time factor) ")
COLUMNS_OF_TIMES = re.compile(r"(?:(?:mean|median|95 %) us|(?:step|p95) \[us\]|seconds|peak memory \[MB\])(?= |$)")
PROGRESS = re.compile(r"[a-z ]+: \d+ of \d+, \d+ s, about \d+ s left")
CLOCK = re.compile(r"\[\d\d:\d\d:\d\d\]")
HASH = re.compile(r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)[0-9a-f]{8,64}\b")
NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e[-+]\d+)?(?![\w.]*[A-Za-z_])")
DIRECTIVE = re.compile(r"<!-- (file|folder|needs|run|rows|quote|status|skip)(?:: (.*?))? -->", re.S)
BEGUN = re.compile(r"<!-- (file|folder|needs|run|rows|quote|status|skip)\b")


class Block:
    """Lines of a page that mean the same: commands, output, file, table, or a directive."""

    def __init__(self, kind, first, lines, word=""):
        self.kind, self.first, self.lines, self.word = kind, first, lines, word


def blocks_of(lines):
    """Blocks in their order; `first` is the index of the first of their lines."""
    at = 0
    while at < len(lines):
        line = lines[at]
        end = at + 1
        if line.startswith("```"):
            while not lines[end].startswith("```"):
                end += 1
            yield Block("fence", at + 1, lines[at + 1:end], line[3:].strip())
            end += 1
        elif line.startswith("<!-- "):
            while "-->" not in lines[end - 1]:
                end += 1
            match = DIRECTIVE.fullmatch("\n".join(lines[at:end]))
            if match:
                yield Block(match.group(1), at, lines[at:end], (match.group(2) or "").strip())
            elif BEGUN.match(line):
                yield Block("unknown", at, lines[at:end])
        elif line.startswith("    ") and (at == 0 or not lines[at - 1].strip()):
            while end < len(lines) and lines[end].startswith("    "):
                end += 1
            yield Block("commands", at, [part[4:] for part in lines[at:end]])
        elif line.startswith("|"):
            while end < len(lines) and lines[end].startswith("|"):
                end += 1
            yield Block("table", at, lines[at:end])
        at = end


class Text:
    """Lines as they are compared: words, numbers, and what is not compared."""

    def __init__(self, lines):
        self.lines, self.words, columns = lines, [], ()
        for line in lines:
            if not line.strip():
                columns = ()
            heads = [match.end() for match in COLUMNS_OF_TIMES.finditer(line)]
            columns = heads or columns
            self.words.append(self.split(line, () if heads else columns))

    @staticmethod
    def split(line, columns):
        line = CLOCK.sub(lambda match: "~" * len(match.group()), line)
        timed = bool(LINES_OF_TIMES.match(line))
        found, end = [], 0
        marks = sorted([*HASH.finditer(line), *NUMBER.finditer(line)], key=lambda match: match.start())
        for match in marks:
            if match.start() < end:
                continue
            found += line[end:match.start()].split()
            text, end = match.group(), match.end()
            if HASH.fullmatch(text):
                found.append(("hash", text))
            elif timed or end in columns or re.match(r" us\b", line[end:]):
                found.append(("time", text))
            else:
                found.append(("number", text))
        return found + line[end:].split()

    def skeleton(self, at):
        return [word if isinstance(word, str) else word[0] for word in self.words[at]]


def value(text):
    return float(text.replace(",", ""))


def agree(page, printed, counts=True):
    wanted, found = value(page), value(printed)
    if counts and abs(wanted) < COUNTS and not re.search(r"[.e]", page + printed):
        return wanted == found
    digits = page.split("e")[0]
    place = 10.0 ** -len(digits.partition(".")[2]) * (float("1e" + page.split("e")[1]) if "e" in page else 1)
    if abs(wanted) < ZERO and abs(found) < ZERO:
        return True
    return abs(wanted - found) <= max(TOLERANCE * abs(wanted), (1.001 if re.search("[.e]", page) else 0 if counts else 0.501) * place)


class Page:
    def __init__(self, name, build, renew):
        self.name, self.renew = name, renew
        self.path = ROOT / name
        self.lines = self.path.read_text().splitlines()
        self.hashes, self.faults, self.printed, self.quotes = {}, [], [], []
        self.top = Path(tempfile.mkdtemp(prefix="exmat_page_"))
        for folder in ("examples", "docs"):
            (self.top / folder).symlink_to(ROOT / folder)
        self.environment = {**os.environ, "PATH": os.pathsep.join([str(build / "bin"), str(ROOT / "examples/tools"), str(Path(__file__).parent),
                                                                   "/usr/bin", os.environ["PATH"]]),  # Debian's Python
                            "PYTHONPATH": str(build / "python"),
                            "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",  # other tests run beside it; results do not depend on it
                            "EXMAT_TOP": str(ROOT), "EXMAT_BUILD": str(build), "PYTHONDONTWRITEBYTECODE": "1", "LC_ALL": "C.UTF-8"}
        self.set_folder("build/pages")
        self.runs = False

    def set_folder(self, name):
        self.folder = self.top / name
        self.folder.mkdir(parents=True, exist_ok=True)

    def fault(self, line, what):
        self.faults.append(f"{self.name}:{line + 1}: {what}")

    def shell(self, command, line, status=0, arguments=()):
        # Line by line, so that results and messages come in the order in which a terminal shows them.
        done = subprocess.run(["stdbuf", "-oL", "bash", "-euo", "pipefail", "-c", command, "page", *arguments], cwd=self.folder,
                              env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != status:
            self.fault(line, f"status {done.returncode}, expected {status}: {command}\n{done.stdout}")
        return [line for line in done.stdout.splitlines() if not PROGRESS.fullmatch(line)]

    def same(self, page, printed):
        """Of two lines' words of the same skeleton, whether they say the same."""
        for wanted, found in zip(page, printed):
            if isinstance(wanted, str) or wanted[0] == "time":
                continue
            if wanted[0] == "hash":
                if self.hashes.setdefault(wanted[1], found[1]) != found[1]:
                    return False
            elif not agree(wanted[1], found[1]):
                return False
        return True

    def compare(self, block):
        page, printed = Text(block.lines), Text(self.printed)
        next_line, free = 0, False
        for at, line in enumerate(block.lines):
            if line == "...":
                free = True
                continue
            if not line.strip():
                continue
            candidates = range(next_line, len(printed.lines))
            if not free:
                candidates = [k for k in candidates if printed.lines[k].strip()][:1]
            alike = [k for k in candidates if printed.skeleton(k) == page.skeleton(at)]
            if not alike:
                here = printed.lines[next_line] if next_line < len(printed.lines) else "nothing"
                self.fault(block.first + at, f"no such line was printed: {line}\n    " + ("" if free else f"printed: {here}"))
                free = True
                continue
            best = next((k for k in alike if self.same(page.words[at], printed.words[k])), None)
            if best is None:
                best = alike[0]
                self.differ(block.first + at, line, printed.lines[best])
            next_line, free = best + 1, False

    def differ(self, at, line, printed):
        if self.renew:
            clock = CLOCK.match(line)
            self.lines[at] = CLOCK.sub(clock.group(), printed) if clock else printed
        else:
            self.fault(at, f"the page has {line}\n    printed: {printed}")

    def compare_quote(self, block, source):
        name, _, part = source.partition(" ")
        text = (ROOT / name).read_text()
        found = re.search(rf"^// recipe: {re.escape(part)}\n(.*?)^// recipe: ", text, re.M | re.S) if part else re.match("(.*)", text, re.S)
        if not found:
            self.fault(block.first, f"{name} has no recipe {part}")
        elif found.group(1).strip().splitlines() != block.lines and not self.renew:
            self.fault(block.first, f"this is not the recipe {part} of {name}")
        elif self.renew:
            self.quotes.append((block.first, len(block.lines), found.group(1).strip().splitlines()))

    def compare_rows(self, table, command):
        for at, row in enumerate(table.lines[2:], table.first + 2):
            cells = [cell.strip().strip("`") for cell in row.strip("|").split("|")]
            printed = " ".join(self.shell(command, at, arguments=[cell.replace(",", "") for cell in cells])).split()
            marks = list(NUMBER.finditer(row))[-len(printed):] if printed else []
            if len(marks) != len(printed) or not printed:
                self.fault(at, f"expected numbers for the end of the row, printed: {' '.join(printed)}")
                continue
            for mark, found in reversed(list(zip(marks, printed))):
                if not agree(mark.group(), found, counts=False):
                    digits = len(mark.group().partition(".")[2])
                    row = row[:mark.start()] + f"{value(found):,.{digits}f}" + row[mark.end():]
            if row != self.lines[at]:
                self.differ(at, self.lines[at], row)

    def run(self):
        status, file, skip, rows, quote, needs = 0, None, False, None, None, None
        for block in blocks_of(self.lines):
            if block.kind in ("file", "needs", "rows", "status", "skip", "quote"):
                file = block.word if block.kind == "file" else file
                needs = block.word if block.kind == "needs" else needs
                rows = block.word if block.kind == "rows" else rows
                quote = block.word if block.kind == "quote" else quote
                status = int(block.word) if block.kind == "status" else status
                skip = skip or block.kind == "skip"
            elif block.kind == "unknown":
                self.fault(block.first, "the comment is none of those that are known; it ends its last line")
            elif block.kind == "folder":
                self.set_folder(block.word)
                self.runs = True
            elif skip and block.kind in ("fence", "commands", "table"):
                skip = False
            elif block.kind == "run" and needs and subprocess.run(["pkg-config", "--exists", needs], check=False).returncode:
                print(f"{self.name}:{block.first + 1}: left out: there is no {needs}")
                skip, needs = True, None
            elif block.kind == "run" or (block.kind == "commands" and self.runs):
                command = block.word if block.kind == "run" else "\n".join(block.lines)
                self.printed += self.shell(command, block.first, status)
                status, needs = 0, None
            elif block.kind == "fence" and quote:
                self.compare_quote(block, quote)
                quote = None
            elif block.kind == "fence" and file:
                (self.folder / file).write_text("\n".join(block.lines) + "\n")
                file = None
            elif block.kind == "fence" and not block.word and (self.runs or self.printed):
                self.compare(block)
                self.printed = []
            elif block.kind == "table" and rows:
                self.compare_rows(block, rows)
                rows = None
        for first, count, lines in reversed(self.quotes):
            self.lines[first:first + count] = lines
        if self.renew:
            self.path.write_text("\n".join(self.lines) + "\n")
        shutil.rmtree(self.top)
        return self.faults


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=Path)
    parser.add_argument("pages", nargs="+")
    parser.add_argument("--renew", action="store_true")
    arguments = parser.parse_args()
    faults = [fault for name in arguments.pages for fault in Page(name, arguments.build.resolve(), arguments.renew).run()]
    print("\n".join(faults) if faults else f"{len(arguments.pages)} pages print what the programs print")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
