"""A motion as shape keys: one for each column of U, and its values over time."""
import numpy as np

UNUSED = 1e-8  # of the size: columns that never move a vertex farther are left out


def columns_of(exmat, model, points):
    """U at the points: (r, k, 3), displacement [m] by one of q."""
    body = exmat.Body(model)
    still = np.zeros(model.modes)
    rest = body.positions(points).astype(float)
    size = max(np.ptp(rest, axis=0).max(), 1e-30)
    columns = np.empty((model.modes, len(rest), 3))
    for mode in range(model.modes):
        scale = 1.0
        for _ in range(2):  # positions are in single precision: the second time they move by about the size
            q = still.copy()
            q[mode] = scale
            body.set_reduced(q, still)
            moved = (body.positions(points) - rest) / scale
            farthest = np.abs(moved).max()
            scale = size / farthest if farthest > 0 else 1.0
        columns[mode] = moved
    return columns


def keys_of(columns, q, size):
    """What to key: pairs of displacements (k, 3) and values (frames,) in [-1, 1], whose products add up to the motion."""
    keys = []
    for column, values in zip(columns, np.asarray(q).T):
        most = np.abs(values).max()
        if most > 0 and most * np.abs(column).max() > UNUSED * size:
            keys.append((most * column, values / most))
    return keys


def rigid_part(positions, shape, orientation):
    """Rotation (3, 3) and translation (3,) with positions = rotation shape + translation, of arrays (k, 3)."""
    w, x, y, z = orientation
    rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    return rotation, (positions - shape @ rotation.T).mean(0)
