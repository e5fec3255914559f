#!/usr/bin/python3
"""Builds the compiled part of the Python package by CMake, for pip; pyproject.toml says the rest.

EXMAT_BUILD_FOLDER names a build folder of the project to take or to make; build/pip where it is not set.
"""
import os
import pathlib
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent
FOLDER = ROOT / os.environ.get("EXMAT_BUILD_FOLDER", "build/pip")
OPTIONS = ["-DCMAKE_BUILD_TYPE=Release", "-DEXMAT_BUILD_PRECOMPUTE=OFF", "-DEXMAT_BUILD_TESTS=OFF", "-DEXMAT_INSTALL=OFF", "-DEXMAT_BUILD_PYTHON=ON"]


class CMakeBuild(build_ext):
    """Takes module and library from the build folder into the package."""

    def build_extension(self, extension: Extension) -> None:
        if not (FOLDER / "CMakeCache.txt").exists():
            subprocess.run(["cmake", "-S", str(ROOT), "-B", str(FOLDER), "-GNinja", f"-DPython_EXECUTABLE={sys.executable}", *OPTIONS], check=True)
        subprocess.run(["cmake", "--build", str(FOLDER), "--target", "exmat_python"], check=True)
        target = pathlib.Path(self.get_ext_fullpath(extension.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(FOLDER / "python/exmat" / target.name, target)
        library = next((FOLDER / "lib").glob("libexmat_runtime.so.*.*.*"))
        shutil.copy(library, target.parent / ".".join(library.name.split(".")[:-1]))


setup(ext_modules=[Extension("exmat._exmat", [])], cmdclass={"build_ext": CMakeBuild})
