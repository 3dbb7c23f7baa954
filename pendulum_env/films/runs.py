"""Runs of a film, interpolated to the instants of its frames; runs that end early stand still afterwards."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.runs import RecordSchedule, recorded
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films.orbit import curves
from pendulum_env.films.picture import apparatus, pivots, trail_length
from pendulum_env.films.reel import kept
from pendulum_env.physics.effects import Motor
from pendulum_env.physics.scene import Scene
from pendulum_env.render import Apparatus, FrameStyle, Orbits, PastSamples, View
from pendulum_env.render.strip import WINDOW

FloatArray = NDArray[np.float64]
Panel = tuple[Apparatus, View]

PAST = ("angle", "velocity", "kinetic", "potential", "heat", "work", "residual")
"""Names of a run's series that frames show of the time before them."""
SMALL = math.radians(30.0)
"""Largest |angle| of a film whose picture shows the arc of the swing only [rad]."""
NEAR = 1e-9
"""Instants closer than this to a state, as a share of the time between states, show that state."""


@dataclass(frozen=True, eq=False)
class Track:
    """One run of a film, with its values at the instants of the film's frames.

    Attributes:
        scene, apparatus: the scene of the run, and the pendulum as frames draw it.
        label: caption of the run.
        series: dict of quantity (such as "angle") -> array with a value for each frame; the last value is repeated
            after the run's end.
        end, reason: time [s] and reason of an early end; inf and "" if the run did not end early.
        accent, energy_scale, torque_share, curves: as in :class:`View`.
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
    curves: Orbits | None = None

    def view(self, time: FloatArray, i: int, past: bool) -> View:
        """Return the view at the i-th instant of the film, or at the run's end if that is earlier.

        past: True if a panel of the frames shows earlier samples.
        """
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
        """Return the samples of the last ten seconds before the k-th instant of a film, for plots in its frames.

        Samples are taken at the same instants in all frames, so that the plots do not flicker.
        """
        every, count = kept(float(time[1] - time[0])) if len(time) > 1 else (1, 1)
        first = max(0, k // every + 1 - count) * every
        part = slice(first, k, every)
        return PastSamples(time[part], **{name: self.series[name][part] for name in PAST if name in self.series})


def instants(tracks: Sequence[Track], time: FloatArray, past: bool = False) -> Iterator[list[Panel]]:
    """Yield for each instant ``time`` [s] of a film the list of (apparatus, view) of all runs, the input of a frame.

    When all runs have stopped, the last list is repeated.

    past: True if a panel of the frames shows earlier samples.
    """
    still: list[Panel] = []
    for i, now in enumerate(time.tolist()):
        if not still:
            shown = [(track.apparatus, track.view(time, i, past)) for track in tracks]
            still = shown if all(now > track.end for track in tracks) else []
        yield shown


def drawn_large(tracks: Sequence[Track]) -> list[Track]:
    """Return the runs of a film with pendulums drawn about twice as long if all swings stay below 30 degrees (SMALL).

    The picture then shows the arc of the largest swing, not the pendulum's full circle. Films with a moving pivot, a
    compound pendulum or a motor's torque stay as they are.
    """
    swing = max(float(np.abs(track.series["angle"]).max()) for track in tracks)
    if not swing < SMALL or any(any(track.apparatus.sway) or track.apparatus.outline or track.torque_share
                                for track in tracks):
        return [*tracks]
    return [replace(track, apparatus=replace(track.apparatus, swing=swing)) for track in tracks]


def strip_span(time: FloatArray) -> float:
    """Return the time that a film's strip of angles covers [s]: the film's, at most ten seconds, whole if above 1 s.

    ``time`` are the instants of the film's frames [s].
    """
    lasts = float(time[-1])
    return min(WINDOW, max(math.ceil(lasts - NEAR) if lasts > 1.0 else lasts, NEAR))


def track_of(
    spec: RunSpec, machine: Machine, time: FloatArray, look: FrameStyle, *, label: str, title: str, accent: str | None,
) -> Track:
    """Simulate the run that ``spec`` describes, and return it at the instants ``time`` [s] of the frames of a film."""
    assert spec.plan is not None
    assert spec.start is not None
    h, every, control = spec.h, spec.plan.every, spec.control
    rows = math.ceil(float(time[-1]) / (every * h) * (1.0 - 1e-12) - NEAR)
    scene, state = machine.scene, machine.state(float(spec.start[0]), float(spec.start[1]))
    spec.tell()
    states, reason = recorded(machine, state, RecordSchedule(h, rows * every, every), control)
    spec.tell_end(machine, states, state, reason)
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
    """Return angle, velocity and energies of a run at the instants ``time`` [s]; after its end, the last values.

    works: True to include the work of drives.
    """
    return _between(time, run.time, run.angle, run.velocity, run.ledger, works)


def _between(
    time: FloatArray, at: FloatArray, angle: FloatArray, velocity: FloatArray, ledger: Any, works: bool
) -> dict[str, FloatArray]:
    """Return angle, velocity and energies at the instants ``time`` [s], interpolated from values at times ``at`` [s].

    The angle follows the cubic Hermite interpolant of angles and velocities. Velocities of equal sign are limited to 3
    times the mean velocity, so that the angle does not overshoot (Fritsch and Carlson 1980). Energies are interpolated
    linearly. An instant that coincides with a state gets exactly its values.
    """
    low = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 1)
    high = np.minimum(low + 1, len(at) - 1)
    gap = np.where(high > low, at[high] - at[low], 1.0)
    s = np.where(high > low, np.clip((time - at[low]) / gap, 0.0, 1.0), 0.0)
    s = np.where(s < NEAR, 0.0, np.where(s > 1.0 - NEAR, 1.0, s))
    series = {name: getattr(ledger, name) for name in PAST[2:] if works or name != "work"}
    with np.errstate(over="ignore", invalid="ignore"):
        mixed = {name: (1.0 - s) * values[low] + s * values[high] for name, values in series.items()}
        mean, first, last = (angle[high] - angle[low]) / gap, velocity[low], velocity[high]
        most = np.where(np.sign(first) * np.sign(last) >= 0.0, 3.0 * np.abs(mean), math.inf)
        share, v, w = s * s * (3.0 - 2.0 * s), np.clip(first, -most, most), np.clip(last, -most, most)
        mixed["angle"] = (1.0 - share) * angle[low] + share * angle[high] + gap * s * (1.0 - s) * (
            (1.0 - s) * v - s * w)
        mixed["velocity"] = (6.0 * s * (1.0 - s) * mean + (1.0 - s) * (1.0 - 3.0 * s) * v + s * (3.0 * s - 2.0) * w)
    series |= {"angle": angle, "velocity": velocity}
    return {name: np.where(s == 1.0, series[name][high], np.where((s > 0.0) & np.isfinite(mix), mix, series[name][low]))
            for name, mix in mixed.items()}
