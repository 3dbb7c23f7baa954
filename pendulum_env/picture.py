"""From a scene and a state to what the render room draws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.physics.scene import Scene
from pendulum_env.render import Apparatus, View, frame

TRAIL_SECONDS = 0.6
"""How long a trail stays behind the bob [s]."""

LONGEST_TRAIL = 10_000
"""Places of the bob in a trail, at most."""

THICKNESS = {"rod": 0.002, "wire": 0.0002}
"""Radius to draw a suspension with [m]."""


def trail_length(dt: float) -> int:
    """Places of the bob that a trail keeps, one for every control step of ``dt`` [s]."""
    return max(2, math.ceil(min(TRAIL_SECONDS / dt, LONGEST_TRAIL)))


def snapshot(
    machine: Machine, state: Any, h: float, share: float, trail: Iterable[float], size: int | tuple[int, int],
    every: int = 1,
) -> NDArray[np.uint8]:
    """The frame of a machine's whole state; the trail is of every so many steps, the last at their end."""
    values, places = [float(value) for value in state], tuple(trail)
    initial = values[machine.names.index("initial")]
    last = math.ceil(values[INDEX] / every)
    times = (h * min(values[INDEX], every * (last - k)) for k in reversed(range(len(places))))
    shown = view(machine, values, h, initial, share, places, times)
    return frame(apparatus(machine.scene), shown, size=size)


def apparatus(scene: Scene) -> Apparatus:
    """What hangs from the stand."""
    body = scene.body
    return Apparatus(body.length, body.radius, body.suspension, THICKNESS[body.suspension], title=scene.name,
                     sway=_sum(effect.sway for effect in scene.effects))


def pivots(scene: Scene, time: float, times: Iterable[float]) -> dict[str, Any]:
    """Where a view has the pivot, at a time [s] and at those of its trail; nothing where none moves."""
    moving = [effect for effect in scene.effects if any(effect.sway)]
    if not moving:
        return {}
    found = [_sum(effect.pivot(moment) for effect in moving) for moment in (*times, time)]
    return {"pivot": found[-1], "trail_pivots": tuple(found[:-1])}


def _sum(places: Iterable[tuple[float, float]]) -> tuple[float, float]:
    x, y = zip((0.0, 0.0), *places, strict=True)
    return sum(x), sum(y)


def view(
    machine: Machine, state: Sequence[float], h: float, initial: float, share: float, trail: tuple[float, ...],
    times: Iterable[float],
) -> View:
    """One instant: ``state`` after ``state[0]`` steps of ``h`` [s], ``initial`` energy [J], motor ``share``.

    ``times`` are those of the trail [s].
    """
    ledger = machine.ledger(state, initial)
    motor, works = any(effect.controlled for effect in machine.scene.effects), "work" in machine.sums
    return View(
        time=state[INDEX] * h,
        angle=state[ANGLE] + TWO_PI * state[TURNS],
        velocity=state[VELOCITY],
        torque_share=share if motor else None,
        kinetic=float(ledger.kinetic),
        potential=float(ledger.potential),
        heat=float(ledger.heat),
        work=float(ledger.work) if works else None,
        residual=float(ledger.residual) if machine.accounts else None,
        trail=trail,
        caption=machine.label,
        energy_scale=max(initial, 2.0 * machine.scale if works else 0.0) or None,
        **pivots(machine.scene, state[INDEX] * h, times),
    )
