#!/usr/bin/python3
"""Error against run time: a study of 01_twisted_bar over the number of modes and of cubature elements, drawn."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

import exmat  # noqa: E402
import shared  # noqa: E402

STUDY = {
    "name": "twisted_bar",
    "asset": shared.BAR / "asset.json",
    "scene": shared.BAR / "scene.json",
    "steps": 300,
    "sweeps": [{"basis_size": [6, 12, 24, 32], "cubature_elements": [24, 60, 120], "training": ["scene"]}],
    "timing": {"rounds": 3},
}


def main():
    given = shared.arguments(__doc__, "error_against_time.png")
    result = exmat.precompute.study(STUDY, given.folder / "study")
    figure, axes = plt.subplots(figsize=(5.5, 3.6))
    for elements, mark in zip((24, 60, 120), "osv"):
        points = [point for point in result.points if point.settings.cubature_elements == elements]
        places = [(point.times.median_us, 100 * point.errors.position.mean) for point in points]
        axes.loglog(*zip(*places), mark, label=f"s = {elements}")
        for point, place in zip(points, places):
            axes.annotate(point.settings.basis_size, place, fontsize=6, xytext=(3, 3), textcoords="offset points")
    axes.set_xlabel("one step [us]")
    axes.set_ylabel("error of position [%]")
    axes.set_title("numbers are modes r", fontsize=8)
    axes.legend(fontsize=7)
    shared.save(figure, given.picture)


if __name__ == "__main__":
    main()
