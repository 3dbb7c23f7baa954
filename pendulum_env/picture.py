"""From a scene and a state to what the render room draws."""

from __future__ import annotations

from collections.abc import Sequence

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.physics.scene import Scene
from pendulum_env.render import Apparatus, View

TRAIL_SECONDS = 0.6
"""How long a trail stays behind the bob [s]."""

THICKNESS = {"rod": 0.002, "wire": 0.0002}
"""Radius to draw a suspension with [m]."""


def apparatus(scene: Scene) -> Apparatus:
    """What hangs from the stand."""
    body = scene.body
    return Apparatus(body.length, body.radius, body.suspension, THICKNESS[body.suspension], title=scene.name)


def view(
    machine: Machine, state: Sequence[float], h: float, initial: float, share: float, trail: tuple[float, ...]
) -> View:
    """One instant: ``state`` after ``state[0]`` steps of ``h`` [s], ``initial`` energy [J], motor ``share``."""
    ledger = machine.ledger(state, initial)
    drives = bool(machine.scene.of_kind("drive"))
    return View(
        time=state[INDEX] * h,
        angle=state[ANGLE] + TWO_PI * state[TURNS],
        velocity=state[VELOCITY],
        torque_share=share if drives else None,
        kinetic=float(ledger.kinetic),
        potential=float(ledger.potential),
        heat=float(ledger.heat),
        work=float(ledger.work) if drives else None,
        residual=float(ledger.residual) if machine.diagnostics else None,
        trail=trail,
        caption=machine.label,
        energy_scale=max(initial, 2.0 * machine.scale if drives else 0.0) or None,
    )
