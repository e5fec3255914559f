#!/usr/bin/python3
"""Draw the paper's figures that take more than one example, or a motion in full space.

Usage: figures.py [--programs build/release/bin] [--output build/figures] [FIGURE ...]    (3; all where none is named)

  3   a load twists a bar: in full space and reduced, without examples, with a cuboid and with a cylinder
  4   a free bar falls, with an S as its example: that of a cuboid, and of a cylinder
  7   the cross: its left and right region with their examples, and its middle with its own

Bundles, trajectories and OUTPUT/figure_N.png go to OUTPUT; minutes for each. Pictures are copied by hand beside the pages of the examples.
"""
import argparse
import json
import pathlib
import subprocess
import sys

TOOLS = pathlib.Path(__file__).resolve().parent
EXAMPLES = TOOLS.parent
BAR, CYLINDER, FALL, CROSS = (EXAMPLES / name for name in ("04_bar_cuboid", "05_bar_cylinder", "02_falling_bar", "06_cross"))


def read(path):
    return json.loads(path.read_text())


def named(scene, name):
    """A scene with a bundle and a trajectory of this name."""
    return scene | {"bundle": f"{name}.h5", "output": scene["output"] | {"trajectory": f"{name}_run.h5"}}


def of_regions(scene, regions):
    """A scene in which these regions alone have example forces."""
    return scene | {"regions": [region for region in scene["regions"] if region["name"] in regions]}


def falling_asset(name, rest, posed):
    """The bar of figure 3, free, with one posed example beside the rest pose."""
    asset = read(FALL / "asset.json")
    examples = [{"name": "rest", "mesh": str(rest), "rest": True}, {"name": "s", "mesh": str(posed)}]
    return asset | {"name": name, "object": asset["object"] | {"mesh": str(BAR / "object.msh")}, "examples": examples,
                    "alignment": {"frame": "shared"}}


def falling_scene():
    """Lying, one end lower, its middle 2.5 m above the floor. It is meshed upright, from 0 down to -4 m."""
    scene = read(FALL / "scene.json")
    return scene | {"body": {"position": [0, 0, 4.5], "orientation": [0.8788, 0, 0.4772, 0]}}


class Figures:
    def __init__(self, programs, output):
        self.programs, self.output = programs.resolve(), output.resolve()
        self.output.mkdir(parents=True, exist_ok=True)

    def command(self, *words):
        print("figures:", *words, file=sys.stderr)
        subprocess.run([str(word) for word in words], check=True, cwd=self.output)

    def bundle(self, asset, name):
        self.command(self.programs / "exmat-precompute", "bundle", asset, "-o", f"{name}.h5")

    def run(self, scene, name, full_space=False):
        """Returns the scene's file, scene_NAME.json."""
        path = self.output / f"scene_{name}.json"
        path.write_text(json.dumps(scene, indent=2) + "\n")
        self.command(self.programs / "exmat-runtime", "run", path)
        if full_space:
            trajectory = pathlib.Path(scene["output"]["trajectory"])
            self.command(self.programs / "exmat-precompute", "full-space", path, "-o", trajectory.with_stem(trajectory.stem + "_full"))
        return path

    def picture(self, kind, name, *words):
        self.command(TOOLS / "picture.py", kind, f"{name}.png", *words)

    def figure_3(self):
        sources = {"no_examples": (BAR, "none"), "cuboid": (BAR, "recommended"), "cylinder": (CYLINDER, "recommended")}
        scenes = []
        for name, (folder, variant) in sources.items():
            self.bundle(folder / f"asset_{variant}.json", name)
            scenes.append(self.run(named(read(folder / f"scene_{variant}.json"), name), name, full_space=True))
        self.picture("motion", "figure_3", *scenes, "--full-space", "--times=2", "--columns=3", "--view=-60,15")

    def figure_4(self):
        scenes = []
        for name, folder in {"cuboid": BAR, "cylinder": CYLINDER}.items():
            rest, posed, name = folder / "example_rest.msh", self.output / f"s_{name}.msh", f"falling_{name}"
            self.command(TOOLS / "pose.py", rest, posed, "s", 90, "axis=z", "towards=x")
            asset = self.output / f"asset_{name}.json"
            asset.write_text(json.dumps(falling_asset(name, rest, posed), indent=2) + "\n")
            self.bundle(asset, name)
            scenes.append(self.run(named(falling_scene(), name), name))
        self.picture("motion", "figure_4", *scenes, "--frames=5")
        self.picture("meshes", "figure_4_meshes", BAR / "object.msh", self.output / "s_cuboid.msh", self.output / "s_cylinder.msh")

    def figure_7(self):
        self.bundle(CROSS / "asset_recommended.json", "cross")
        whole, scenes = read(CROSS / "scene_recommended.json"), []
        for name, regions in {"left_and_right": ["left", "right"], "middle": ["middle"]}.items():
            scene = named(of_regions(whole, regions), name) | {"bundle": "cross.h5"}
            scenes.append(self.run(scene, name))
        self.picture("motion", "figure_7", *scenes, "--times=0,0.2,1.5", "--view=-70,15")


FIGURES = {"3": Figures.figure_3, "4": Figures.figure_4, "7": Figures.figure_7}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help=", ".join(FIGURES))
    parser.add_argument("--programs", type=pathlib.Path, default=EXAMPLES.parent / "build/release/bin")
    parser.add_argument("--output", type=pathlib.Path, default=EXAMPLES.parent / "build/figures")
    options = parser.parse_args()
    unknown = set(options.figures) - set(FIGURES)
    if unknown:
        parser.error(f"no figure {', '.join(sorted(unknown))}; there are: {', '.join(FIGURES)}")
    figures = Figures(options.programs, options.output)
    for name in options.figures or FIGURES:
        FIGURES[name](figures)


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(f"figures: {error.cmd[0]} ended with status {error.returncode}")
