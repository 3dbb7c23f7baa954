"""Runs as films show them: several under one clock, each with its trail and its past, still once it has ended."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.trajectory import simulate
from pendulum_env.orbit import curves
from pendulum_env.physics.effects import Motor
from pendulum_env.physics.scene import Scene
from pendulum_env.picture import apparatus, pivots, trail_length
from pendulum_env.reel import kept
from pendulum_env.render import Apparatus, Curves, Look, Past, View

FloatArray = NDArray[np.float64]
Panel = tuple[Apparatus, View]

PAST = ("angle", "velocity", "kinetic", "potential", "heat", "work", "residual")
"""What a past holds of a run's series."""


@dataclass(frozen=True, eq=False)
class Track:
    """One run at the instants of a film.

    Attributes:
        scene, apparatus: what ran, and as it is drawn.
        label: its caption.
        series: the numbers of a :class:`View` by name, arrays with a value for each instant; after the end, the last.
        end, reason: when [s] and why it stopped early; inf and "" if it did not.
        accent, energy_scale, torque_share, curves: as a View's.
    """

    scene: Scene
    apparatus: Apparatus
    label: str
    series: Mapping[str, FloatArray]
    end: float = math.inf
    reason: str = ""
    accent: str | None = None
    energy_scale: float | None = None
    torque_share: float | None = None
    curves: Curves | None = None

    def view(self, time: FloatArray, i: int, past: bool) -> View:
        """What it shows at the i-th instant of the film: its end, if that was before."""
        now, k = float(time[i]), i
        stopped = now > self.end
        if stopped:
            now, k = self.end, int(np.searchsorted(time, self.end))
        trail = slice(max(1, k + 1 - trail_length(float(time[1] - time[0]))) if k else 1, k + 1)
        numbers: dict[str, Any] = {"torque_share": self.torque_share}
        numbers |= {name: float(values[i]) for name, values in self.series.items()}
        return View(
            time=now, **numbers,
            trail=tuple(self.series["angle"][trail].tolist()),
            caption=f"{self.label}: {self.reason}" if stopped else self.label, stopped=stopped,
            energy_scale=self.energy_scale, accent=self.accent,
            past=self._past(time, k) if past else None, curves=self.curves,
            **pivots(self.scene, now, np.minimum(time[trail], now).tolist()),
        )

    def _past(self, time: FloatArray, k: int) -> Past:
        """The last ten seconds before an instant; of many instants, every so many, and the same in all frames."""
        every, count = kept(float(time[1] - time[0])) if len(time) > 1 else (1, 1)
        first = max(0, k // every + 1 - count) * every
        part = slice(first, k, every)
        return Past(time[part], **{name: self.series[name][part] for name in PAST if name in self.series})


def instants(tracks: Sequence[Track], time: FloatArray, past: bool = False) -> Iterator[list[Panel]]:
    """What each instant [s] shows of each run; one and the same list from the moment on when all have stopped.

    ``past``: True where the look of the frames shows the past.
    """
    still: list[Panel] = []
    for i, now in enumerate(time.tolist()):
        if not still:
            shown = [(track.apparatus, track.view(time, i, past)) for track in tracks]
            still = shown if all(now > track.end for track in tracks) else []
        yield shown


def track_of(
    machine: Machine, angle: float, velocity: float, h: float, every: int, control: float, time: FloatArray, look: Look,
    *, label: str, title: str, accent: str | None,
) -> Track:
    """Run a machine from a start [rad, rad/s] in steps of ``h`` [s], ``every`` from one of the film's instants on to
    the next."""
    states, reason = simulate(machine, angle, velocity, h=h, rows=len(time), every=every, control=control)
    initial, scene = float(machine.ledger(states[0], 0.0).energy), machine.scene
    ledger, works = machine.ledger(states, initial), "work" in machine.sums
    series = {
        "angle": states[:, ANGLE] + TWO_PI * states[:, TURNS], "velocity": states[:, VELOCITY],
        "kinetic": ledger.kinetic, "potential": ledger.potential, "heat": ledger.heat, "residual": ledger.residual,
        **({"work": ledger.work} if works else {}),
    }
    (lag,) = [effect.lag for effect in scene.effects if isinstance(effect, Motor)] or [0.0]
    if lag:
        series["torque_share"] = -control * np.expm1(-states[:, INDEX] * h / lag)
    held = {name: np.concatenate((values, np.full(len(time) - len(values), values[-1])))
            for name, values in series.items()}
    return Track(
        scene, replace(apparatus(scene), title=title), label, held,
        end=float(states[-1, INDEX]) * h if reason else math.inf, reason=reason, accent=accent,
        energy_scale=max(initial, 2.0 * machine.scale if works else 0.0) or None,
        torque_share=control if any(effect.controlled for effect in scene.effects) else None,
        curves=curves(scene, initial) if "curves" in look.needs else None,
    )


def at_times(run: Rollout, time: FloatArray, works: bool) -> dict[str, FloatArray]:
    """The series of a run at a film's instants: between its own by straight lines, after its end as it was."""
    ledger = run.ledger
    series = {"angle": run.angle, "velocity": run.velocity, "kinetic": ledger.kinetic, "potential": ledger.potential,
              "heat": ledger.heat, "residual": ledger.residual, **({"work": ledger.work} if works else {})}
    return {name: np.interp(time, run.time, values) for name, values in series.items()}
