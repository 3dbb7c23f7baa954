"""From a scene and a state to what the render room draws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.films.orbit import curves
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.render import Apparatus, Curves, FrameStyle, PastSamples, View, frame

TRAIL_SECONDS = 0.6
"""How long a trail stays behind the bob [s]."""

LONGEST_TRAIL = 10_000
"""Places of the bob in a trail, at most."""

LAGGING = "motor_share"
"""Where a state keeps what a motor that lags has of its largest torque, in the mean over the last control step."""


def trail_length(dt: float) -> int:
    """Places of the bob that a trail keeps, one for every control step of ``dt`` [s]."""
    return max(2, math.ceil(min(TRAIL_SECONDS / dt, LONGEST_TRAIL)))


@dataclass(frozen=True)
class Facts:
    """What all views of a machine share.

    motor: whether it has one.  label.  moving: the effects that move the pivot.
    lagging: where the state keeps the share of a motor that lags; None for one that does not.
    """

    motor: bool
    label: str
    moving: tuple[Effect, ...]
    lagging: int | None

    @classmethod
    def of(cls, machine: Machine) -> Facts:
        """Those of a machine."""
        effects = machine.scene.effects
        return cls(any(effect.controlled for effect in effects), machine.label, moving_pivots(machine.scene),
                   machine.names.index(LAGGING) if LAGGING in machine.names else None)


class Camera:
    """Frames of a machine that takes steps of ``h`` [s], ``every`` of them in a control step, in a size and a look.

    What stays the same from frame to frame is worked out once; panels that the look leaves out cost nothing.
    """

    def __init__(self, machine: Machine, h: float, every: int, size: tuple[int, int], look: FrameStyle) -> None:
        self.machine, self.h, self.every, self.size, self.look = machine, h, every, size, look
        self.apparatus, self._initial = apparatus(machine.scene), machine.names.index("initial")
        self.facts = Facts.of(machine)
        self._made: tuple[float, Curves] | None = None

    def frame(self, state: Any, share: float, trail: Iterable[float], past: PastSamples | None) -> NDArray[np.uint8]:
        """The frame of a whole state; the trail is of every control step, the last at the end of the state's."""
        return frame(self.apparatus, self.view(state, share, trail, past), size=self.size, look=self.look)

    def view(self, state: Any, share: float, trail: Iterable[float], past: PastSamples | None) -> View:
        """What ``frame`` shows."""
        values = state if type(state) is list else state.tolist()
        places, initial, h, needs = tuple(trail), values[self._initial], self.h, self.look.needs
        last = math.ceil(values[INDEX] / self.every)
        times = (h * min(values[INDEX], self.every * (last - k)) for k in reversed(range(len(places))))
        more: dict[str, Any] = {}
        if "curves" in needs:
            if self._made is None or self._made[0] != initial:
                self._made = initial, curves(self.machine.scene, initial)
            more["curves"] = self._made[1]
        return view(self.machine, values, h, initial, share, places, times, "energies" in needs, self.facts,
                    past=past, **more)


def apparatus(scene: Scene) -> Apparatus:
    """What hangs from the stand."""
    body = scene.body
    return Apparatus(body.length, body.radius, body.suspension, 0.5 * body.diameter, title=scene.name,
                     sway=_sum(effect.sway for effect in scene.effects))


def pivots(scene: Scene, time: float, times: Iterable[float]) -> dict[str, Any]:
    """Where a view has the pivot, at a time [s] and at those of its trail; nothing where none moves."""
    return _pivots(moving_pivots(scene), time, times)


def moving_pivots(scene: Scene) -> tuple[Effect, ...]:
    """The effects that move the pivot."""
    return tuple(effect for effect in scene.effects if any(effect.sway))


def _pivots(moving: tuple[Effect, ...], time: float, times: Iterable[float]) -> dict[str, Any]:
    if not moving:
        return {}
    found = [_sum(effect.pivot(moment) for effect in moving) for moment in (*times, time)]
    return {"pivot": found[-1], "trail_pivots": tuple(found[:-1])}


def _sum(places: Iterable[tuple[float, float]]) -> tuple[float, float]:
    x, y = zip((0.0, 0.0), *places, strict=True)
    return sum(x), sum(y)


def view(
    machine: Machine, state: Sequence[float], h: float, initial: float, share: float, trail: tuple[float, ...],
    times: Iterable[float], energies: bool = True, facts: Facts | None = None, **more: Any,
) -> View:
    """One instant: ``state`` after ``state[0]`` steps of ``h`` [s], ``initial`` energy [J], motor ``share``.

    ``times`` are those of the trail [s].  ``energies``: False leaves the ledger out.  ``facts``: of the machine.
    ``more``: of the view as it is.
    """
    facts = facts or Facts.of(machine)
    share = share if facts.lagging is None else state[facts.lagging]
    if energies:
        ledger, works = machine.ledger(state, initial), "work" in machine.sums
        more |= {
            "kinetic": float(ledger.kinetic),
            "potential": float(ledger.potential),
            "heat": float(ledger.heat),
            "work": float(ledger.work) if works else None,
            "residual": float(ledger.residual) if machine.accounts else None,
            "energy_scale": max(initial, 2.0 * machine.scale if works else 0.0) or None,
        }
    return View(
        time=state[INDEX] * h,
        angle=state[ANGLE] + TWO_PI * state[TURNS],
        velocity=state[VELOCITY],
        torque_share=share if facts.motor else None,
        trail=trail,
        caption=facts.label,
        **_pivots(facts.moving, state[INDEX] * h, times),
        **more,
    )
