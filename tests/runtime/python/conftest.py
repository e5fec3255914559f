"""A bundle of the twisted bar, models and bodies of it. EXMAT_BUILD names the build folder."""
import json
import os
import pathlib
import subprocess

import pytest

import exmat

ROOT = pathlib.Path(__file__).resolve().parents[3]
BUILD = pathlib.Path(os.environ.get("EXMAT_BUILD", ROOT / "build/release"))
BAR = ROOT / "examples/01_twisted_bar"
# A pose on the object's mesh, no training: a second.
ASSET = {
    "name": "bar",
    "object": {"mesh": BAR / "bar.msh", "material": {"youngs_modulus": 1.0e6, "poisson_ratio": 0.4, "density": 1000},
               "fixed": {"box": {"min": [-0.01, -0.01, -0.01], "max": [0.01, 1.01, 1.01]}}},
    "examples": [{"name": "rest", "mesh": BAR / "example_rest.msh", "rest": True}, {"name": "twist", "mesh": BAR / "example_twist.msh"}],
    "basis": {"size": 12, "linear_modes": 8, "training": "none"},
    "cubature": {"elements": 30},
    "internal_force": "cubature",
}


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("exmat")


@pytest.fixture(scope="session")
def bundle(folder):
    if not (BUILD / "bin/exmat-precompute").exists() and "EXMAT_PRECOMPUTE" not in os.environ:
        pytest.skip("built without the offline stage")
    exmat.precompute.bundle(ASSET, folder / "bar.h5")
    return folder / "bar.h5"


@pytest.fixture(scope="session")
def free_bundle(folder, bundle):
    asset = {**ASSET, "object": {name: member for name, member in ASSET["object"].items() if name != "fixed"}, "needs": ["rigid", "contact", "examples"]}
    exmat.precompute.bundle(asset, folder / "free.h5")
    return folder / "free.h5"


@pytest.fixture(scope="session")
def model(bundle):
    return exmat.Model(bundle, gravity=(0, 0, -1), example_stiffness=4000, example_damping=10, example_bias=0.2)


@pytest.fixture
def body(model):
    return exmat.Body(model)


@pytest.fixture(scope="session")
def runtime():
    """Runs exmat-runtime; what it prints as a dict."""

    def run(*arguments):
        done = subprocess.run([str(BUILD / "bin/exmat-runtime"), *map(str, arguments)], capture_output=True, text=True, check=True)
        return dict(line.rstrip().split("  ", 1) for line in done.stdout.splitlines() if "  " in line)

    return run


@pytest.fixture
def scene_file(tmp_path):
    def write(**members):
        path = tmp_path / "scene.json"
        path.write_text(json.dumps({name: str(member) if isinstance(member, pathlib.Path) else member for name, member in members.items()}))
        return path

    return write
