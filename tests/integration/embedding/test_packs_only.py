#!/usr/bin/python3
"""The library without HDF5 (EXMAT_WITH_HDF5=OFF) is made of C++20 and Eigen alone: its configuration looks for no other
library, and no source of it includes a header of one, by whatever way.

Usage: test_packs_only.py SOURCE_FOLDER
"""
import json
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCES = Path(sys.argv.pop(1)).resolve()
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)
# The standard libraries of C++ and C, the system's where it has no other, Eigen.
ALLOWED = re.compile(r"[a-z_0-9]+|(std(def|int)|inttypes|immintrin|pthread|sched|unistd|fcntl|sys/stat)\.h|(unsupported/)?Eigen/\w+")
LIBRARIES = ("HDF5", "fmt", "spdlog", "CLI11", "nlohmann_json", "ZLIB", "OpenMP", "PkgConfig")


def foreign_headers(sources, folders):
    """What sources include, themselves or by headers of the project, and is in none of these folders."""
    foreign, seen, left = set(), set(), [Path(source) for source in sources]
    while left:
        file = left.pop()
        if file in seen:
            continue
        seen.add(file)
        for _, name in INCLUDE.findall(file.read_text()):
            own = next((path for path in (file.parent / name, *(folder / name for folder in folders)) if path.is_file()), None)
            if own is not None:
                left.append(own.resolve())
            elif not ALLOWED.fullmatch(name):
                foreign.add(f"{file.name} includes {name}")
    return foreign, seen


class PacksOnly(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.build = Path(holder.name)
        without = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in LIBRARIES]
        subprocess.run(["cmake", "-S", SOURCES, "-B", cls.build, "-G", "Ninja", "-DEXMAT_WITH_HDF5=OFF", *without], check=True,
                       capture_output=True)
        # By its command alone: ninja would compile the kernels first.
        embed = subprocess.run(["ninja", "-C", cls.build, "-t", "commands", "-s", "runtime/ports/embedded_schemas.cpp"], check=True,
                               capture_output=True, text=True).stdout
        subprocess.run(embed, shell=True, check=True)
        cls.commands = json.loads((cls.build / "compile_commands.json").read_text())
        folders = {Path(folder) for command in cls.commands for folder in re.findall(r"-I(\S+)", command["command"])}
        cls.foreign, cls.seen = foreign_headers([command["file"] for command in cls.commands], sorted(folders))

    def test_no_source_includes_another_library(self):
        self.assertEqual(self.foreign, set())
        names = {file.relative_to(SOURCES).as_posix() for file in self.seen if file.is_relative_to(SOURCES)}
        self.assertTrue({"common/bundle/pack_store.h", "runtime/sim/world/world.h", "runtime/ports/fmt/format.h"} <= names)
        self.assertEqual([name for name in names if name.startswith("common/hdf5/hdf5")], [])

    def test_what_its_headers_declare_is_compiled(self):
        """A shared library does not say what it lacks. Of these headers it takes the types alone, or has functions of its own."""
        types_alone = {"common/bundle/scene_places.h", "common/config/scene_config.h", "common/config/vertex_selection.h"}
        replaced = {"common/surface_io/height_reader.h", "common/surface_io/plain_surface.h", "runtime/api/settings_ranges.h"}
        compiled = {Path(command["file"]).resolve() for command in self.commands}
        lacking = {file.relative_to(SOURCES).as_posix() for file in self.seen if file.suffix == ".h" and file.is_relative_to(SOURCES)
                   and file.with_suffix(".cpp").exists() and file.with_suffix(".cpp") not in compiled}
        self.assertEqual(lacking, types_alone | replaced)

    def test_a_planted_include_is_found(self):
        source = self.build / "planted.cpp"
        source.write_text("#include <vector>\n#include <hdf5.h>\n#include <CLI/CLI.hpp>\n")
        self.assertEqual(len(foreign_headers([source], [SOURCES])[0]), 2)


if __name__ == "__main__":
    unittest.main()
