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

THICKNESS = {"rod": 0.002, "wire": 0.0002}
"""Radius to draw a suspension with [m]."""


def trail_length(dt: float) -> int:
    """Places of the bob that a trail keeps, one for every control step of ``dt`` [s]."""
    return max(2, math.ceil(TRAIL_SECONDS / dt))


def snapshot(
    machine: Machine, state: Any, h: float, share: float, trail: Iterable[float], size: int | tuple[int, int]
) -> NDArray[np.uint8]:
    """The frame of a machine's whole state."""
    values = [float(value) for value in state]
    initial = values[machine.names.index("initial")]
    shown = view(machine, values, h, initial, share, tuple(trail))
    return frame(apparatus(machine.scene), shown, size=size)


def apparatus(scene: Scene) -> Apparatus:
    """What hangs from the stand."""
    body = scene.body
    return Apparatus(body.length, body.radius, body.suspension, THICKNESS[body.suspension], title=scene.name)


def view(
    machine: Machine, state: Sequence[float], h: float, initial: float, share: float, trail: tuple[float, ...]
) -> View:
    """One instant: ``state`` after ``state[0]`` steps of ``h`` [s], ``initial`` energy [J], motor ``share``."""
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
    )
