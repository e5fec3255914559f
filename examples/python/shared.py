"""What the examples of Python share: the bar of 01_twisted_bar, bundles that are made once, pictures."""
import argparse
import pathlib

import exmat

HERE = pathlib.Path(__file__).resolve().parent
BAR = HERE.parent / "01_twisted_bar"
SCENE = {"gravity": [0, 0, -1], "damping": {"mass": 0.2, "stiffness": 0.01}, "examples": {"stiffness": 4000, "damping": 10, "bias": 0.2}}
SETTINGS = {"gravity": (0, 0, -1), "mass_damping": 0.2, "stiffness_damping": 0.01, "example_stiffness": 4000, "example_damping": 10,
            "example_bias": 0.2}


def arguments(description, picture):
    """The folder for bundles, and where the picture goes."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("build/examples/python"), help="for bundles (%(default)s)")
    parser.add_argument("--picture", type=pathlib.Path, default=HERE / picture, help="to be drawn (%(default)s)")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    return given


def twisted_bar(folder):
    """The bundle of 01_twisted_bar; nothing is computed where it is there."""
    path = folder / "twisted_bar.h5"
    exmat.precompute.bundle(BAR / "asset.json", path, scene=SCENE, if_changed=True)
    return path


def save(figure, picture):
    figure.savefig(picture, dpi=110, bbox_inches="tight", metadata={"Software": None})
    print(picture)
