"""A body that follows a timeline."""
import numpy as np

from .columns import columns_of, rigid_part
from .fault import Fault
from .spring import Spring


class Player:
    """Steps one body from frame to frame and keeps the state of each, so that the timeline can go back.

    `scene`: members of a scene; `rest`: vertices of the surface (v, 3) [m]; `steps`: of a frame; `springs`: triples of
    points at rest (k, 3), stiffness [N/m] and damping. `first` is the frame at rest.
    """

    def __init__(self, exmat, scene, rest, steps, springs=(), first=1):
        self._exmat, self.steps, self.first = exmat, steps, first
        try:
            self.model = exmat.Model.from_scene(scene)
        except exmat.Error as error:
            raise Fault(str(error)) from None
        self.points = exmat.Points.at(self.model, rest)
        self.rest = np.asarray(rest, float)
        self.springs = [Spring(exmat, self.model, scene["bundle"], *spring) for spring in springs]
        self.body = exmat.Body(self.model)
        self._states = {first: self.body.state}
        self._targets = None
        self._shown = first

    @property
    def last(self):
        """The last frame that was simulated."""
        return max(self._states)

    def restart(self):
        """Back to rest at the first frame."""
        self.body.reset()
        self._states = {self.first: self.body.state}
        self._targets = None
        self._shown = self.first
        for spring in self.springs:
            spring.restart()

    def go_to(self, frame, targets=()):
        """The body as it is at `frame`: as it was simulated, or simulated now, with a target [m] for each spring.

        Frames before the first show the first.
        """
        frame = max(frame, self.first)
        if frame not in self._states:
            last = self.last
            if self._shown != last:
                self.body.state = self._states[last]
                for spring in self.springs:
                    spring.restart()
            for between in range(last + 1, frame + 1):
                self._advance(targets)
                self._states[between] = self.body.state
                self._shown = between
        if self._shown != frame:
            self.body.state = self._states[frame]
        self._shown = frame

    def positions(self):
        """Of the vertices (v, 3) [m]."""
        return self.body.positions(self.points)

    def columns(self):
        """U at the vertices: (r, v, 3)."""
        return columns_of(self._exmat, self.model, self.points)

    def rigid_motion(self, columns):
        """Rotation (3, 3) and translation (3,) [m] of a free body, without its deformation."""
        shape = self.rest + np.tensordot(self.body.q, columns, 1)
        return rigid_part(self.positions().astype(float), shape, self.body.motion.orientation)

    def _advance(self, targets):
        try:
            if not self.springs:
                self.body.step(self.steps)
                return
            self._advance_with_springs([np.asarray(target, float) for target in targets])
        except self._exmat.Error as error:
            raise Fault(f"The simulation stopped at {self.body.time:.3g} s: {error}. Try more steps a frame, or weaker forces.") from None

    def _advance_with_springs(self, targets):
        before = self._targets if self._targets is not None else targets
        dt = self.model.time_step
        velocities = [(now - then) / (self.steps * dt) for now, then in zip(targets, before)]
        for step in range(self.steps):
            self.body.clear_forces()
            for spring, then, velocity in zip(self.springs, before, velocities):
                spring.act(self.body, then + (step + 1) * dt * velocity, velocity, dt)
            self.body.step(1)
        self.body.clear_forces()
        self._targets = targets
