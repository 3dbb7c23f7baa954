"""Rendering of a vector of environments: one frame per environment, or one picture in which they are tiles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.batch import Batch
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films.picture import Camera
from pendulum_env.films.reel import Reel
from pendulum_env.render import FrameStyle, View, side_by_side

Places = NDArray[np.intp]


class Cameras:
    """Renderer of a vector environment.

    It records the motor's torques and the earlier states that panels such as "history" show.
    """

    def __init__(
        self, batch: Batch, spec: RunSpec, dt: float, size: tuple[int, int], look: FrameStyle, listed: bool
    ) -> None:
        self._batch, self._spec, self._size, self._look = batch, spec, size, look
        self._reel = Reel(look, dt, "energy" in batch.diagnostics)
        self._shares = np.zeros(batch.size)
        self._cameras: dict[int, Camera] = {}
        self._frames: list[list[NDArray[np.uint8]]] | None = [[] for _ in range(batch.size)] if listed else None

    def keep(self, shares: Any, begun: Places, info: NDArray[np.float64]) -> None:
        """Record the states of all environments after a step, for later frames.

        ``shares`` are the actions, fractions of the motor's torque; None leaves those of the step before. ``begun`` are
        the indices of environments in which an episode has just begun.
        """
        if shares is not None:
            self._shares = np.clip(np.ravel(shares).astype(np.float64), -1.0, 1.0)
        self._shares[begun] = 0.0
        steps, angles, velocities = self._batch.motion()
        values = dict(zip(self._batch.names, info, strict=True))
        self._reel.keep((steps * self._batch.h, angles, velocities), values, begun.size > 0)
        self._reel.cut(begun)
        if self._spec.each is not None and self._spec.each.episode:  # other parameters, drawn for the new episodes
            for place in begun.tolist():
                self._cameras.pop(place, None)
        if self._frames is not None:
            for place in begun.tolist():
                self._frames[place] = []
            for place in begun.tolist() if shares is None else range(self._batch.size):
                self._frames[place].append(self.frame(place))

    def render(self) -> tuple[Any, ...]:
        """Return one frame for each environment or, with "rgb_array_list", one list of those since the last call."""
        return tuple(map(self.taken, range(self._batch.size)))

    def taken(self, place: int) -> Any:
        """Return the frame of one environment or, with "rgb_array_list", the list of those since the last call.

        As with Gymnasium's RenderCollection, a list begins anew with each episode.
        """
        if self._frames is None:
            return self.frame(place)
        frames, self._frames[place] = self._frames[place], []
        return frames

    def frame(self, place: int) -> NDArray[np.uint8]:
        """Return the picture of one environment, the one with index ``place``."""
        return self._camera(place).frame(*self._shown(place))

    def tiles(self, count: int, columns: int | None) -> NDArray[np.uint8]:
        """Return one picture of the first ``count`` environments, in ``columns`` columns."""
        cameras = [self._camera(place) for place in range(count)]
        views: list[View] = [camera.view(*self._shown(place)) for place, camera in enumerate(cameras)]
        apart = len({view.time for view in views}) > 1
        pairs = [(camera.apparatus, view) for camera, view in zip(cameras, views, strict=True)]
        return side_by_side(pairs, self._size, columns, self._look, own_clocks=apart)

    def _camera(self, place: int) -> Camera:
        if place not in self._cameras:
            machine = self._spec.one(place).machine()
            self._cameras[place] = Camera(machine, self._batch.h, self._spec.hold, self._size, self._look)
        return self._cameras[place]

    def _shown(self, place: int) -> tuple[Any, ...]:
        """Return what the camera draws for one environment: state, fraction of motor torque, trail, and past states."""
        state = state_of(self._batch, self._camera(place).machine, place)
        return state, self._shares[place], self._reel.trail_of(place), self._reel.past_of(place)


def state_of(batch: Batch, machine: Machine, place: int) -> Any:
    """Return the state of one environment in the form of its own ``machine``, with the quantities that it reports."""
    state = machine.array(batch.state(place, machine.names))
    machine.advance(state, 0.0, batch.h, 0)
    return state
