"""The add-on's modules that do without Blender, and a bundle of a clamped and of a free bar."""
import os
import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
BUILD = pathlib.Path(os.environ.get("EXMAT_BUILD", ROOT / "build/release"))
sys.path.insert(0, str(ROOT / "examples/blender"))


@pytest.fixture(scope="session")
def bar():
    """Vertices, tets and a bent pose of a bar along x, in cubes of six tets."""
    import numpy as np

    cells, size = (8, 2, 2), np.array([2.0, 0.5, 0.5])
    grid = np.stack(np.meshgrid(*(np.arange(count + 1) for count in cells), indexing="ij"), -1).reshape(-1, 3)
    place = {tuple(at): number for number, at in enumerate(grid)}
    tets = []
    for cube in np.ndindex(cells):
        for order, even in (((0, 1, 2), 1), ((1, 2, 0), 1), ((2, 0, 1), 1), ((0, 2, 1), 0), ((1, 0, 2), 0), ((2, 1, 0), 0)):
            path = [np.array(cube)]
            for axis in order:
                path.append(path[-1] + np.eye(3, dtype=int)[axis])
            tet = [place[tuple(at)] for at in path]
            tets.append(tet if even else [tet[0], tet[1], tet[3], tet[2]])
    rest = grid / cells * size
    bent = np.stack([(2 - rest[:, 2]) * np.sin(rest[:, 0] / 2), rest[:, 1], 2 - (2 - rest[:, 2]) * np.cos(rest[:, 0] / 2)], 1)
    return rest, np.array(tets), bent


@pytest.fixture(scope="session")
def bundles(bar, tmp_path_factory):
    """Paths by "clamped" and "free"."""
    import exmat
    import numpy as np

    if not (BUILD / "bin/exmat-precompute").exists() and "EXMAT_PRECOMPUTE" not in os.environ:
        pytest.skip("built without the offline stage")
    rest, tets, bent = bar
    made = {}
    for name, fixed in (("clamped", {"fixed": {"ids": np.flatnonzero(rest[:, 0] == 0)}}), ("free", {})):
        made[name] = tmp_path_factory.mktemp("bundles") / f"{name}.h5"
        asset = {"name": name, "object": {"mesh": (rest, tets), "material": {"youngs_modulus": 1e6, "poisson_ratio": 0.4, "density": 1000}, **fixed},
                 "examples": [{"name": "bow", "mesh": bent}], "basis": {"size": 10, "linear_modes": 8, "training": "none"}, "cubature": {"elements": 20}}
        exmat.precompute.bundle(asset, made[name])
    return made
