"""Stubs, docstrings, and the snippets of the page."""
import inspect
import os
import pathlib
import re
import subprocess
import sys

import pytest

import exmat
from conftest import BUILD, ROOT
from exmat import _exmat

HERE = pathlib.Path(__file__).resolve().parent
PACKAGE = pathlib.Path(exmat.__file__).resolve().parent


def checked(*arguments, cwd):
    done = subprocess.run([sys.executable, "-m", *arguments], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_is_typed(tmp_path):
    checked("mypy", "--strict", "--cache-dir", str(tmp_path), "-p", "exmat", cwd=PACKAGE.parent)
    (tmp_path / "use.py").write_text("import exmat\nbody = exmat.Body(exmat.Model('a.h5', time_step=0.1))\nreveal_type(body.q)\nbody.step('x')\n")
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), "use.py"], cwd=tmp_path, capture_output=True,
                          text=True, env={**os.environ, "MYPYPATH": str(PACKAGE.parent)})
    assert "float64" in done.stdout or "floating" in done.stdout, done.stdout
    assert 'Argument 1 to "step" of "Body" has incompatible type "str"; expected "int"' in done.stdout


def test_stubs_are_those_of_the_module(tmp_path):
    checked("mypy.stubtest", "exmat._exmat", "--allowlist", str(HERE / "stubtest.txt"), "--ignore-unused-allowlist", cwd=PACKAGE.parent)


def test_everything_has_a_docstring():
    for owner in (exmat, exmat.precompute):
        for name in owner.__all__:
            item = getattr(owner, name)
            assert inspect.getdoc(item), name
            if inspect.isclass(item):
                for member, value in vars(item).items():
                    if not member.startswith("_") and (callable(value) or isinstance(value, property)) and item not in (exmat.Field,):
                        assert inspect.getdoc(value), f"{name}.{member}"
    for name in ("q", "v", "weights", "positions"):
        assert re.search(r"shape \(|\(N, |\(k, ", inspect.getdoc(getattr(_exmat.Body, name)))
        assert re.search(r"\[.*\]|sum 1", inspect.getdoc(getattr(_exmat.Body, name)))
    assert exmat.__version__ == _exmat.version


@pytest.mark.skipif(not (BUILD / "bin/exmat-precompute").exists(), reason="built without the offline stage")
def test_snippets_of_the_page_run(tmp_path):
    snippets = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/python.md").read_text(), re.S | re.M)
    assert len(snippets) >= 5
    script = tmp_path / "snippets.py"
    script.write_text(f"import os\nos.chdir({str(tmp_path)!r})\nROOT = {str(ROOT)!r}\n" + "\n".join(snippets))
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(PACKAGE.parent)})
    assert done.returncode == 0, done.stderr
