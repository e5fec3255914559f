"""pip installs the package, of the build folder's module and library, offline."""
import os
import pathlib
import subprocess
import sys

from conftest import BUILD, ROOT


def test_pip_installs_a_package_that_needs_nothing_of_the_build(tmp_path):
    target = tmp_path / "site"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    # From a copy: pip and setuptools write beside pyproject.toml.
    source = tmp_path / "source"
    (source / "runtime/python").mkdir(parents=True)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        (source / name).write_bytes((ROOT / name).read_bytes())
    (source / "runtime/python/exmat").symlink_to(ROOT / "runtime/python/exmat")
    subprocess.run([sys.executable, "-m", "pip", "install", "--no-index", "--no-build-isolation", "--no-deps", "--target", str(target), str(source)],
                   check=True, capture_output=True, env={**environment, "EXMAT_BUILD_FOLDER": str(BUILD.resolve())})
    names = {path.name for path in (target / "exmat").iterdir()}
    assert {"__init__.py", "_exmat.pyi", "py.typed", "libexmat_runtime.so.0.1"} <= names
    script = "import exmat, os; print(exmat.__file__); print(open(f'/proc/{os.getpid()}/maps').read())"
    found = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, env={**environment, "PYTHONPATH": str(target)}).stdout
    assert found.startswith(str(target)) and str(target / "exmat/libexmat_runtime.so.0.1") in found
    assert str(pathlib.Path(BUILD).resolve() / "lib") not in found
