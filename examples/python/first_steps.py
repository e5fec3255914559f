#!/usr/bin/python3
"""First steps: the bar of 01_twisted_bar from its asset to a curve. Ten lines are exmat, the rest is matplotlib."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import exmat  # noqa: E402
import shared  # noqa: E402


def main():
    given = shared.arguments(__doc__, "first_steps.png")
    model = exmat.Model(shared.twisted_bar(given.folder), **shared.SETTINGS)
    points = exmat.Points.all_vertices(model)
    body = exmat.Body(model)
    times, weights, energies, shapes = [], [], [], {}
    for frame in range(101):
        times.append(body.time)
        weights.append(body.weights.copy())
        energies.append((body.energies.kinetic, body.energies.elastic))
        if frame in (0, 25, 100):
            shapes[body.time] = body.positions(points)
        body.step(20)

    with exmat.Bundle(given.folder / "twisted_bar.h5") as bundle:
        surface = bundle["object/surface"][:]
    figure = plt.figure(figsize=(11, 3.4))
    figure.subplots_adjust(wspace=0.4, hspace=0.3)
    for place, (time, xyz) in enumerate(shapes.items()):
        axes = figure.add_subplot(1, 4, 1 + place, projection="3d", box_aspect=np.ptp(xyz, axis=0))
        axes.plot_trisurf(*xyz.T, triangles=surface, cmap="viridis", linewidth=0.2, edgecolor="k")
        axes.set_title(f"{time:.1f} s", fontsize=9)
        axes.set_axis_off()
    axes = figure.add_subplot(2, 4, 4)
    axes.plot(times, np.array(weights)[:, 1], "C1")
    axes.set_ylabel("weight of the twist", fontsize=7)
    axes = figure.add_subplot(2, 4, 8)
    axes.plot(times, energies)
    axes.legend(["kinetic", "elastic"], fontsize=6)
    axes.set_ylabel("energy [J]", fontsize=7)
    axes.set_xlabel("time [s]", fontsize=7)
    shared.save(figure, given.picture)


if __name__ == "__main__":
    main()
