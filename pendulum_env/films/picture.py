"""Views (input of :mod:`pendulum_env.render`) of the states that a compiled program of a scene computes."""

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
from pendulum_env.render import Apparatus, FrameStyle, Orbits, PastSamples, View
from pendulum_env.render.panel import drawn

TRAIL_SECONDS = 0.6
"""Time that a trail covers [s]."""

LONGEST_TRAIL = 10_000
"""Largest number of positions in a trail."""

LAGGING = "motor_share"
"""Name of the state of a motor with a lag: its mean torque over the last control step, over its largest torque."""


def trail_length(dt: float) -> int:
    """Return the number of positions in the bob's trail, one for every control step of ``dt`` [s]."""
    return max(2, math.ceil(min(TRAIL_SECONDS / dt, LONGEST_TRAIL)))


@dataclass(frozen=True)
class Facts:
    """Properties of a machine (compiled program of a scene with a method) that all its frames share.

    Attributes:
        motor: True if the scene has a motor.
        label: name of the method.
        moving: effects that move the pivot.
        lagging: index, in the state vector, of the torque (over the largest torque) of a motor with a lag; None if
            there is no such motor.
    """

    motor: bool
    label: str
    moving: tuple[Effect, ...]
    lagging: int | None

    @classmethod
    def of(cls, machine: Machine) -> Facts:
        """Return the properties that all frames of a machine's states share."""
        effects = machine.scene.effects
        return cls(any(effect.controlled for effect in effects), machine.label, moving_pivots(machine.scene),
                   machine.names.index(LAGGING) if LAGGING in machine.names else None)


class Camera:
    """Painter of the frames of one run in one size and style, from the states of the simulation.

    The machine (compiled program of a scene with a method) takes steps of ``h`` [s], ``every`` of them in a control
    step. Values that stay the same from frame to frame are computed once, and values that no panel shows are not
    computed.
    """

    def __init__(self, machine: Machine, h: float, every: int, size: tuple[int, int], look: FrameStyle) -> None:
        self.machine, self.h, self.every, self.size, self.look = machine, h, every, size, look
        self.apparatus, self._initial = apparatus(machine.scene), machine.names.index("initial")
        self.facts = Facts.of(machine)
        self._curves: tuple[float, Orbits] | None = None

    def frame(self, state: Any, share: float, trail: Iterable[float], past: PastSamples | None) -> NDArray[np.uint8]:
        """Return the frame, an RGB picture (H, W, 3), of a state of the simulation.

        share: motor torque as a fraction of the largest.  trail: angles [rad] at the ends of the last control steps.
        past: samples before the state, for panels that show them.
        """
        return drawn(self.apparatus, self.view(state, share, trail, past), self.size, self.look)

    def view(self, state: Any, share: float, trail: Iterable[float], past: PastSamples | None) -> View:
        """Return the view (the numbers that a frame shows) of a state of the simulation.

        The arguments are those of :meth:`frame`.
        """
        values = state if type(state) is list else state.tolist()
        places, initial, h, needs = tuple(trail), values[self._initial], self.h, self.look.needs
        last = math.ceil(values[INDEX] / self.every)
        times = (h * min(values[INDEX], self.every * (last - k)) for k in reversed(range(len(places))))
        more: dict[str, Any] = {}
        if "curves" in needs:
            if self._curves is None or self._curves[0] != initial:
                self._curves = initial, curves(self.machine.scene, initial)
            more["curves"] = self._curves[1]
        return view(self.machine, values, h, initial, share, places, times, "energies" in needs, self.facts,
                    past=past, **more)


def apparatus(scene: Scene) -> Apparatus:
    """Return a scene's pendulum with the dimensions that frames draw."""
    body = scene.body
    return Apparatus(body.reach, body.radius, body.suspension, 0.5 * body.diameter, title=scene.name,
                     sway=_sum(effect.sway for effect in scene.effects), outline=body.outline)


def pivots(scene: Scene, time: float, times: Iterable[float]) -> dict[str, Any]:
    """Return the position of a moving pivot at a time [s], and its positions at the times of the bob's trail.

    The result is a dict with the entries ``pivot`` and ``trail_pivots`` of a view; empty if no effect moves the pivot.
    """
    return _pivots(moving_pivots(scene), time, times)


def moving_pivots(scene: Scene) -> tuple[Effect, ...]:
    """Return the effects of a scene that move the pivot."""
    return tuple(effect for effect in scene.effects if any(effect.sway))


def _pivots(moving: tuple[Effect, ...], time: float, times: Iterable[float]) -> dict[str, Any]:
    """Return the summed displacement of the pivot by the effects ``moving``, at a time [s] and at earlier times.

    The result is a dict with the entries ``pivot`` and ``trail_pivots`` of a view; empty if there are no such effects.
    """
    if not moving:
        return {}
    places = [_sum(effect.pivot(moment) for effect in moving) for moment in (*times, time)]
    return {"pivot": places[-1], "trail_pivots": tuple(places[:-1])}


def _sum(places: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Return the sum of displacements (x, y), (0, 0) if there are none."""
    x, y = zip((0.0, 0.0), *places, strict=True)
    return sum(x), sum(y)


def view(
    machine: Machine, state: Sequence[float], h: float, initial: float, share: float, trail: tuple[float, ...],
    times: Iterable[float], energies: bool = True, facts: Facts | None = None, **more: Any,
) -> View:
    """Return the view, the input of a frame, of a simulation's state after ``state[0]`` steps of ``h`` [s].

    initial: energy at the run's start [J].  share: motor torque as a fraction of the largest.  trail, times: recent
    angles [rad] and their times [s].  energies: False leaves the energy ledger out.  more: further attributes of the
    view.
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
