#!/usr/bin/python3
"""A sweep of kappa: 1,000 bodies, each with a stiffness of the example force of its own, stepped as one World."""
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import exmat  # noqa: E402
import shared  # noqa: E402

BODIES, FRAMES, STEPS = 1000, 50, 20


def main():
    given = shared.arguments(__doc__, "kappa_sweep.png")
    model = exmat.Model(shared.twisted_bar(given.folder), **shared.SETTINGS)
    world = exmat.Batch(model, BODIES)
    kappa = np.geomspace(1, 1e5, BODIES)
    world.set_example_stiffness(kappa)
    twist = np.empty((FRAMES, BODIES))
    begun = time.perf_counter()
    for frame in range(FRAMES):
        world.step(STEPS)
        twist[frame] = world.weights[:, 1]
    seconds = time.perf_counter() - begun
    print(f"{BODIES} bodies, {FRAMES * STEPS} steps each: {seconds:.1f} s, {1e6 * seconds / (BODIES * FRAMES * STEPS):.1f} us a step")

    figure, axes = plt.subplots(figsize=(5.5, 3.6))
    image = axes.pcolormesh(kappa, model.time_step * STEPS * np.arange(1, FRAMES + 1), twist, shading="nearest", cmap="magma")
    axes.set_xscale("log")
    axes.set_xlabel("kappa [1/s^2]")
    axes.set_ylabel("time [s]")
    figure.colorbar(image, label="weight of the twist")
    shared.save(figure, given.picture)


if __name__ == "__main__":
    main()
