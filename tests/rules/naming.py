#!/usr/bin/python3
"""Names as .clang-tidy asks for them, in every source that is compiled and its headers.

Usage: naming.py ROOT BUILD_FOLDER    prints each violation; exit status 1 if there are any.

libclang parses the units of the build without the bodies of functions, which takes a tenth of the time of clang-tidy:
most of that goes into the templates that bodies instantiate. Headers that many units include are parsed once, which
leaves less than a third. Types and constants in bodies are found by their words. The target tidy runs clang-tidy.
"""
import collections
import json
import os
import re
import shlex
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from clang.cindex import AccessSpecifier, CursorKind, Diagnostic, Index, TranslationUnit, conf

FOLDERS = ("common", "precompute", "runtime")
SUFFIXES = (".h", ".hpp", ".cpp")
FLAGS = ("-I", "-D", "-std=", "-m")
OPTIONS = TranslationUnit.PARSE_SKIP_FUNCTION_BODIES | TranslationUnit.PARSE_INCOMPLETE
PRECOMPILED = """Eigen/Dense Eigen/Sparse Eigen/Eigenvalues algorithm array cmath filesystem functional iostream map memory optional random span string
    thread variant vector fmt/format.h fmt/ranges.h nlohmann/json.hpp""".split()
SHARED = 6  # units that include a header of the project, which is then precompiled
# But headers of the public classes, whose names classes of other units have too.
INCLUDED = re.compile(rf'^#include "((?!runtime/(?:python|viewer)/)(?:{"|".join(FOLDERS)})/[^"]+[.]h)"$', re.M)
CAMEL, CONSTANT, LOWER = r"[A-Z][a-zA-Z0-9]*", r"k[A-Z0-9][a-zA-Z0-9]*", r"([a-z][a-z0-9_]*|minimumOn(Volume|Object))"
TYPES = (CursorKind.CLASS_DECL, CursorKind.STRUCT_DECL, CursorKind.CLASS_TEMPLATE, CursorKind.CLASS_TEMPLATE_PARTIAL_SPECIALIZATION, CursorKind.ENUM_DECL)
FUNCTIONS = (CursorKind.FUNCTION_DECL, CursorKind.FUNCTION_TEMPLATE, CursorKind.CXX_METHOD)
IN_BODIES = [(CAMEL, "type", re.compile(r"^ *(?:struct|class|enum|enum class) (\w+)(?: final)?(?: : [\w:<>, ]+)? \{", re.M)),
             (CONSTANT, "constant", re.compile(r"\bconstexpr (?:const )?[\w:]+(?:<[^;={}()]*>)?[ *&]+(\w+)(?=[ \[{;<=])(?!::)", re.M))]
HIDDEN = re.compile(r"/[/*][^\n]*NOLINTBEGIN\(readability-identifier-naming.*?NOLINTEND\(readability-identifier-naming|//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"", re.S)


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


def wanted(cursor):
    """(pattern, what it is) of the names of a declaration; None where any will do."""
    kind = cursor.kind
    if kind == CursorKind.NAMESPACE:
        return LOWER, "namespace"
    if kind in TYPES:
        return CAMEL, "type"
    if kind == CursorKind.ENUM_CONSTANT_DECL:
        return CONSTANT, "constant"
    if kind in FUNCTIONS:
        return LOWER, "function"
    if kind == CursorKind.FIELD_DECL and cursor.access_specifier == AccessSpecifier.PRIVATE:
        return r"\w*_", "private member"
    return None


def given(cursor):
    """True where others chose the name: nameless ones, operators, constructors, specialised templates, overriding functions."""
    parent = cursor.semantic_parent
    return (not cursor.spelling.isidentifier() or parent is not None and parent.spelling == cursor.spelling
            or conf.lib.clang_getSpecializedCursorTemplate(cursor) is not None
            or any(child.kind == CursorKind.CXX_OVERRIDE_ATTR for child in cursor.get_children()))


class Texts:
    """Sources without comments, strings and what is exempt, each read once."""

    def __init__(self, root):
        self.root, self.known = root, {}

    def own(self, file):
        """The text of a source of the project; else None."""
        if file not in self.known:
            path = Path(os.path.normpath(file))
            ours = path.suffix in SUFFIXES and any(path.is_relative_to(self.root / folder) for folder in FOLDERS)
            self.known[file] = HIDDEN.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), path.read_text("latin-1")) if ours else None
        return self.known[file]


def declared(texts, cursor):
    """Violations among the declarations below a cursor."""
    for child in cursor.get_children():
        location = child.location
        text = location.file and texts.own(location.file.name)
        if text is None and cursor.kind == CursorKind.TRANSLATION_UNIT:
            continue
        rule = wanted(child) if text else None
        if rule and not re.fullmatch(rule[0], child.spelling) and text.startswith(child.spelling, location.offset) and not given(child):
            yield f"{location.file.name}:{location.line}: {rule[1]} {child.spelling}"
        yield from declared(texts, child)


def in_words(texts):
    """Violations among the types and constants of all sources that were read, by their words."""
    for file, text in texts.known.items():
        for pattern, what, words in IN_BODIES if text else []:
            for match in words.finditer(text):
                if not re.fullmatch(pattern, match.group(1)):
                    yield f"{file}:{text[:match.start(1)].count(chr(10)) + 1}: {what} {match.group(1)}"


def shared_headers(root, units):
    """Headers of the project that SHARED units or more include, as they name them."""
    def reached(file, found):
        for name in set(INCLUDED.findall(file.read_text("latin-1"))) - found:
            if (root / name).exists():
                found.add(name)
                reached(root / name, found)
        return found

    of_units = (set().union(*(reached(source, set()) for source in sources_of(unit))) for unit in units)
    counts = collections.Counter(name for names in of_units for name in names)
    return sorted(name for name, count in counts.items() if count >= SHARED)


def with_precompiled(texts, units, folder):
    """The same units, those for every processor with flags that include a precompiled header of what many include;
    and the violations in that header. It leaves out PRECOMPILED where Eigen is not on the path."""
    portable = [(flags, unit) for flags, unit in units if not any(flag.startswith("-m") for flag in flags)]
    paths = dict.fromkeys(flag for flags, _ in portable for flag in flags if flag.startswith(("-I", "-isystem")))
    names = PRECOMPILED if any("eigen3" in path for path in paths) else []
    names = names + shared_headers(texts.root, [unit for _, unit in portable])
    if not names:
        return units, set()
    header, result = folder / "precompiled.h", folder / "precompiled.pch"
    header.write_text("".join(f"#include <{name}>\n" for name in names))
    common = [flag for flag in portable[0][0] if all(flag in flags for flags, _ in portable)]
    parsed = Index.create().parse(str(header), args=["-x", "c++-header", *common, *paths], options=OPTIONS)
    parsed.save(str(result))
    more = ["-include-pch", str(result)]
    extended = [(flags + more if (flags, unit) in portable else flags, unit) for flags, unit in units]
    return extended, faults(texts, parsed)


def faults(texts, parsed):
    """Errors and violations of what was parsed."""
    errors = {f"{fault.location.file}:{fault.location.line}: error: {fault.spelling}"
              for fault in parsed.diagnostics if fault.severity >= Diagnostic.Error}
    return errors | set(declared(texts, parsed.cursor))


def check(texts, flags, unit):
    """Faults of a unit, those of a precompiled header aside."""
    return faults(texts, Index.create(excludeDecls=True).parse(str(unit), args=flags, options=OPTIONS))


def violations(root, build):
    texts = Texts(root)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:
        extended, found = with_precompiled(texts, list(units(root, build)), Path(folder))
        found = found.union(*pool.map(lambda unit: check(texts, *unit), extended))
    return sorted(found.union(in_words(texts)))


def main():
    found = violations(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
    print("\n".join(found) if found else "all names hold")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
