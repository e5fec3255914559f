"""Where an object's vertices are for exmat: metres, in the object's place and turn, its scale applied.

Blender has local coordinates [units], the object's matrix and the scene's length of a unit [m]. The body is simulated in
a frame that stands where the object stands: x_body = P x_local [m], x_world = R x_body / unit + t [units]. So objects may
be moved and turned after the bundle was made; another scale is another body.
"""
import numpy as np

from .fault import Fault

LEAST_SCALE = 1e-9  # of the largest


class BodyFrame:
    """`matrix` is the object's matrix_world (4, 4), `unit` the length of a Blender unit [m]."""

    def __init__(self, matrix, unit=1.0):
        matrix = np.array(matrix, float)
        linear = matrix[:3, :3]
        scales = np.linalg.svd(linear, compute_uv=False)
        if not np.isfinite(matrix).all() or scales[-1] <= LEAST_SCALE * scales[0]:
            raise Fault("The object's scale is 0 along an axis: set it to another number.")
        self.unit = float(unit)
        self.origin = matrix[:3, 3].copy()
        self.turn = _turn(linear)
        self.stretch = self.turn.T @ linear * self.unit
        self.sheared = bool(np.abs(self.stretch - np.diag(np.diag(self.stretch))).max() > 1e-5 * scales[0] * self.unit)

    def to_body(self, local):
        """Of local coordinates (v, 3) [units]: (v, 3) [m]."""
        return np.asarray(local, float) @ self.stretch.T

    def to_local(self, body):
        """The reverse; of displacements, too."""
        return np.asarray(body, float) @ np.linalg.inv(self.stretch).T

    def point_to_body(self, world):
        """Of a point of the world (3,) [units]: (3,) [m]."""
        return self.turn.T @ (np.asarray(world, float) - self.origin) * self.unit

    def direction_to_body(self, world):
        """Of a direction of the world, its length kept."""
        return self.turn.T @ np.asarray(world, float)

    def motion_to(self, other):
        """Rotation (3, 3) and translation (3,) [m] of another frame in this one: x -> rotation x + translation. Raises Fault."""
        if np.abs(other.stretch - self.stretch).max() > 1e-4 * np.abs(self.stretch).max():
            raise Fault("The object's scale is animated: a body keeps its scale.")
        return self.turn.T @ other.turn, self.point_to_body(other.origin)

    def moved(self, rotation, translation):
        """The object's matrix (4, 4) where the body has moved by x -> rotation x + translation [m], in its frame."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.turn @ rotation @ self.stretch / self.unit
        matrix[:3, 3] = self.origin + self.turn @ translation / self.unit
        return matrix


def quaternion(rotation):
    """Of a rotation (3, 3): w, x, y, z."""
    r = np.asarray(rotation)
    # Eigenvector of the largest eigenvalue: exact to rounding at any angle.
    symmetric = np.array([
        [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [0, r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[0, 2] + r[2, 0]],
        [0, 0, r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2]],
        [0, 0, 0, r[2, 2] - r[0, 0] - r[1, 1]]])
    return np.linalg.eigh(symmetric, UPLO="U")[1][:, -1]


def _turn(linear):
    """The rotation of a matrix: its columns where they are orthogonal, else that of the polar decomposition."""
    lengths = np.linalg.norm(linear, axis=0)
    columns = linear / lengths
    if np.abs(columns.T @ columns - np.eye(3)).max() > 1e-5:
        left, _, right = np.linalg.svd(linear)
        turn = left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right
        return turn
    left, _, right = np.linalg.svd(columns)  # orthogonal to the last bit
    turn = left @ right
    if np.linalg.det(turn) < 0:
        turn[:, 0] *= -1
    return turn
