"""Damped springs that draw points of a body to targets."""
import numpy as np

FASTEST = 0.25  # of the spring's frequency times the time step: beyond it a force that is taken from the step before grows


class Spring:
    """Draws the middle of some points of the body to a target.

    `rest`: the points at rest (k, 3) [m]; `stiffness` [N/m], of which as much acts as the time step can follow;
    `damping`: a share of the critical one.
    """

    def __init__(self, exmat, model, bundle, rest, stiffness, damping=1.0):
        self.points = exmat.Points.at(model, np.atleast_2d(rest))
        count = len(self.points)
        inverse_mass = _inverse_mass(exmat, exmat.Model(bundle), rest)
        limit = (FASTEST / model.time_step) ** 2 / inverse_mass
        self.limited = stiffness > limit
        self.stiffness = min(stiffness, limit)  #: [N/m] that acts
        self.damping = 2 * damping * np.sqrt(self.stiffness / inverse_mass)  #: [N s/m]
        self._share = np.full((count, 1), 1 / count)
        self._place = None

    def middle(self, body):
        """Of its points [m]."""
        return body.positions(self.points).astype(float).mean(0)

    def restart(self):
        """Forgets how fast the points move: after the body's state was set."""
        self._place = None

    def act(self, body, target, velocity, dt):
        """Adds the force of this step: `target` [m], its `velocity` [m/s], `dt` [s] since the last."""
        place = self.middle(body)
        moving = np.zeros(3) if self._place is None else (place - self._place) / dt
        self._place = place
        force = self.stiffness * (target - place) + self.damping * (velocity - moving)
        body.apply_forces(self.points, self._share * force)


def _inverse_mass(exmat, model, rest):
    """Largest acceleration of the points' middle by a force of 1 N on it [1/kg]: that of all modes, and of a free body.

    `model` has neither gravity nor obstacles.
    """
    points = exmat.Points.at(model, np.atleast_2d(rest))
    body = exmat.Body(model)
    middle = body.positions(points).astype(float).mean(0)
    columns = []
    for mode in range(model.modes):
        q = np.zeros(model.modes)
        q[mode] = 1
        body.set_reduced(q, np.zeros(model.modes))
        columns.append(body.positions(points).astype(float).mean(0) - middle)
    columns = np.array(columns)
    return np.linalg.eigvalsh(columns.T @ columns)[-1] + 4 / _free_mass(exmat, model)  # 4: a slender body's end turns, too


def _free_mass(exmat, model):
    """[kg]; infinite where the body is clamped."""
    body = exmat.Body(model)
    try:
        body.motion = exmat.Motion(linear_velocity=(1, 0, 0))
    except exmat.Error:
        return np.inf
    body.step(1)
    return 2 * body.energies.kinetic
