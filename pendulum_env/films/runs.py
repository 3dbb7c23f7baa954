"""Runs as films show them: several under one clock, each with its trail and its past, still once it has ended."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine, followed
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films.orbit import curves
from pendulum_env.films.picture import apparatus, pivots, trail_length
from pendulum_env.films.reel import kept
from pendulum_env.physics.effects import Motor
from pendulum_env.physics.scene import Scene
from pendulum_env.render import Apparatus, Curves, FrameStyle, PastSamples, View

FloatArray = NDArray[np.float64]
Panel = tuple[Apparatus, View]

PAST = ("angle", "velocity", "kinetic", "potential", "heat", "work", "residual")
"""What a past holds of a run's series."""
NEAR = 1e-9
"""An instant so near to a state's, as a share of the time to the next, is that state's."""


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

    def _past(self, time: FloatArray, k: int) -> PastSamples:
        """The last ten seconds before an instant; of many instants, every so many, and the same in all frames."""
        every, count = kept(float(time[1] - time[0])) if len(time) > 1 else (1, 1)
        first = max(0, k // every + 1 - count) * every
        part = slice(first, k, every)
        return PastSamples(time[part], **{name: self.series[name][part] for name in PAST if name in self.series})


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
    spec: RunSpec, machine: Machine, time: FloatArray, look: FrameStyle, *, label: str, title: str, accent: str | None,
) -> Track:
    """Run a machine as described, as far as a film's instants go [s]."""
    assert spec.plan is not None
    assert spec.start is not None
    h, every, control = spec.h, spec.plan.every, spec.control
    rows = 1 + math.ceil(float(time[-1]) / (every * h) * (1.0 - 1e-12) - NEAR)
    scene, state = machine.scene, machine.state(float(spec.start[0]), float(spec.start[1]))
    spec.tell()
    states, reason = followed(machine, state, h, rows, every, 0, control, math.inf)
    spec.tell_end(machine, state, reason)
    initial = float(machine.ledger(states[0], 0.0).energy)
    ledger, works = machine.ledger(states, initial), "work" in machine.sums
    moved = (states[:, INDEX] * h, states[:, ANGLE] + TWO_PI * states[:, TURNS], states[:, VELOCITY])
    shown = _between(time, *moved, ledger, works)
    (lag,) = [effect.lag for effect in scene.effects if isinstance(effect, Motor)] or [0.0]
    if lag:
        shown["torque_share"] = -control * np.expm1(-np.minimum(time, moved[0][-1]) / lag)
    return Track(
        scene, replace(apparatus(scene), title=title), label, shown,
        end=float(states[-1, INDEX]) * h if reason else math.inf, reason=reason, accent=accent,
        energy_scale=max(initial, 2.0 * machine.scale if works else 0.0) or None,
        torque_share=control if any(effect.controlled for effect in scene.effects) else None,
        curves=curves(scene, initial) if "curves" in look.needs else None,
    )


def at_times(run: Rollout, time: FloatArray, works: bool) -> dict[str, FloatArray]:
    """The series of a run at a film's instants, after its end as it was."""
    return _between(time, run.time, run.angle, run.velocity, run.ledger, works)


def _between(
    time: FloatArray, at: FloatArray, angle: FloatArray, velocity: FloatArray, ledger: Any, works: bool
) -> dict[str, FloatArray]:
    """A view's numbers at instants between those of a run's states, [s]: exactly the state's where they meet.

    The angle is the cubic with both angles and velocities (Hermite), the velocities limited to 3 times the mean one
    where they have one sign, so that it does not overshoot (Fritsch and Carlson 1980); energies change linearly.
    """
    low = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 1)
    high = np.minimum(low + 1, len(at) - 1)
    gap = np.where(high > low, at[high] - at[low], 1.0)
    s = np.where(high > low, np.clip((time - at[low]) / gap, 0.0, 1.0), 0.0)
    s = np.where(s < NEAR, 0.0, np.where(s > 1.0 - NEAR, 1.0, s))
    series = {name: getattr(ledger, name) for name in PAST[2:] if works or name != "work"}
    with np.errstate(over="ignore", invalid="ignore"):
        found = {name: (1.0 - s) * values[low] + s * values[high] for name, values in series.items()}
        mean, first, last = (angle[high] - angle[low]) / gap, velocity[low], velocity[high]
        most = np.where(np.sign(first) * np.sign(last) >= 0.0, 3.0 * np.abs(mean), math.inf)
        share, v, w = s * s * (3.0 - 2.0 * s), np.clip(first, -most, most), np.clip(last, -most, most)
        found["angle"] = (1.0 - share) * angle[low] + share * angle[high] + gap * s * (1.0 - s) * (
            (1.0 - s) * v - s * w)
        found["velocity"] = (6.0 * s * (1.0 - s) * mean + (1.0 - s) * (1.0 - 3.0 * s) * v + s * (3.0 * s - 2.0) * w)
    series |= {"angle": angle, "velocity": velocity}
    return {name: np.where(s == 1.0, series[name][high], np.where((s > 0.0) & np.isfinite(mix), mix, series[name][low]))
            for name, mix in found.items()}
