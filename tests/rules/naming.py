#!/usr/bin/python3
"""clang-tidy's identifier naming over every source that is compiled.

Usage: naming.py ROOT BUILD_FOLDER    prints each violation; exit status 1 if there are any.

Most of the time of clang-tidy goes into the headers of Eigen and the library, once for each source. So sources are read together,
as many in one unit as have no local names in common, with the include folders and definitions of all of them. Of a unit that does
not compile, the sources with errors, and those whose local names these are about, are read again apart from the others.
"""
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FOLDERS = ("common", "precompute", "runtime")
CHECKS = "-*,readability-identifier-naming"
LARGEST_UNIT = 32
LOCAL_SCOPE = re.compile(r"^namespace \{$(.*?)^\}  // namespace$", re.S | re.M)
LOCAL_NAME = re.compile(r"^(?!\s|//).*?\b(\w+)\s*(?:\(|=|\{|;|\[)", re.M)
LOCAL_CONSTANT = re.compile(r", (k[A-Z]\w*) =")
MAIN = re.compile(r"^int main\(", re.M)


def local_names(path):
    """Names that a source keeps to itself, roughly, and the name of a program's main function."""
    text = path.read_text()
    return {name for scope in LOCAL_SCOPE.findall(text) for kind in (LOCAL_NAME, LOCAL_CONSTANT) for name in kind.findall(scope)} | set(MAIN.findall(text))


def flags_of(entry):
    """What a source is read with (include folders, definitions, the standard) and the machine that it is compiled for."""
    words = shlex.split(entry["command"])
    read = {word for word in words if word.startswith(("-I", "-D", "-std="))}
    read |= {"-isystem" + word for before, word in zip(words, words[1:]) if before == "-isystem"}
    return read, tuple(word for word in words if word.startswith("-m"))


def units(root, build):
    """(flags, sources) of the units that sources are read in."""
    result, read = [], set()
    for entry in json.loads((build / "compile_commands.json").read_text()):
        path = Path(entry["file"])
        if not any(path.is_relative_to(root / folder) for folder in FOLDERS):
            continue
        names = local_names(path)
        flags, machine = flags_of(entry)
        read |= flags
        for unit in result:
            if unit["machine"] == machine and len(unit["sources"]) < LARGEST_UNIT and not unit["names"] & names:
                break
        else:
            unit = {"machine": machine, "sources": [], "names": set()}
            result.append(unit)
        unit["sources"].append(path)
        unit["names"] |= names
    return [((*sorted(read), *unit["machine"]), unit["sources"]) for unit in result]


def check(root, flags, sources):
    """Violations in some sources and their headers."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / ".clang-tidy").write_text((root / ".clang-tidy").read_text())
        unit = Path(folder) / "unit.cpp"
        unit.write_text("".join(f'#include "{source}"\n' for source in sources))
        result = subprocess.run(["clang-tidy", "-quiet", f"--checks={CHECKS}", f"--header-filter=^{root}/({'|'.join(FOLDERS)})/.*[.](h|hpp|cpp)$", str(unit),
                                 "--", *flags], capture_output=True, text=True)
    if "[clang-diagnostic-error]" in result.stdout and len(sources) > 1:
        errors = [line for line in result.stdout.splitlines() if line.endswith("[clang-diagnostic-error]")]
        clashing = {name for line in errors for name in re.findall(r"'(\w+)'", line)}
        apart = [source for source in sources if local_names(source) & clashing or any(line.startswith(f"{source}:") for line in errors)]
        if len(apart) in (0, len(sources)):
            apart = sources[:len(sources) // 2]
        return check(root, flags, apart) | check(root, flags, [source for source in sources if source not in apart])
    found = {line for line in result.stdout.splitlines() if re.search(r"\b(error|warning):", line)}
    return found if found or result.returncode == 0 else {f"{sources[0]}: clang-tidy: {result.stderr[-1000:]}"}


def violations(root, build):
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return sorted(set().union(*pool.map(lambda unit: check(root, *unit), units(root, build))))


def main():
    found = violations(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
    print("\n".join(found) if found else "all names hold")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
