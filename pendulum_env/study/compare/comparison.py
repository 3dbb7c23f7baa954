"""Comparison of several integrators on one scene from one start."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators import Method
from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Column, Columns, Result, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.rollout import Rollout
from pendulum_env.engine.rollout import run as run_of
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import checked_methods, checked_steps
from pendulum_env.lab.recording import Recording
from pendulum_env.lab.turning import turning_points
from pendulum_env.physics import exact
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.flow import CLIFT_GAUVIN_LIMIT, regime, sphere_drag_coefficient
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, number, shown
from pendulum_env.study.compare.drift import ADAPTIVE, Drift, row
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import true_motion

ROWS = 200_000
"""Largest number of records of one run; longer runs are recorded every few steps."""
LARGE = 0.4
"""Amplitude A [rad] from which the period with small-angle gravity is 1 % too short (A²/16)."""
CLEARLY = 0.2
"""Part of a run's mean angle that a recording must have before its side of the bottom is judged."""
FIGURES = ("angle", "velocity", "phase", "energy")
"""Names of the figures of a comparison."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Runs of several integrators from one start, with their errors.

    Attributes:
        scene: the scene of all runs.
        runs: dict of label -> rollout, in the order of the methods.
        drift: rows of the drift table, one for each run.
        truth: reference solution from which the errors are computed.
        recording: recording, cut to the free swing, centred and shifted to the run's time zero; None without one.
        angle, velocity, dt, duration: start [rad, rad/s], step and length of the run [s].
        tolerance: "rtol" and "atol" of adaptive runs, whose steps end at all multiples of dt; else empty.
        estimates: dict of label -> largest error of the angle by the run's own estimate [rad], inf if unknown; only
            where no reference solution is known.
    """

    scene: Scene
    runs: Mapping[str, Rollout]
    drift: tuple[Drift, ...]
    truth: Truth
    recording: Recording | None
    angle: float
    velocity: float
    dt: float
    duration: float
    tolerance: Mapping[str, float] = dataclasses.field(default_factory=dict)
    estimates: Mapping[str, float] = dataclasses.field(default_factory=dict)
    titled = True

    def __repr__(self) -> str:
        return one_line(self, f"{self.scene.name}, {self.duration:g} s: {', '.join(self.runs)}")

    def origin(self) -> Mapping[str, str]:
        """Return scene, methods, step, start and reference solution, with what computed them."""
        source = {} if self.recording is None else {"recording": self.recording.source}
        return provenance(
            scene=self.scene.to_dict(), integrators=[run.method.name for run in self.runs.values()], dt=self.dt,
            duration=self.duration, angle=self.angle, velocity=self.velocity, truth=self.truth.how, **self.tolerance,
            **source,
        )

    def tables(self) -> Mapping[str, Columns]:
        """Return the motions, one row for each time, with empty cells after a run's end; and the drift table."""
        time = np.unique(np.concatenate([run.time for run in self.runs.values()]))
        motions = {"time_s": Column(time.tolist(), "s")}
        for run in self.runs.values():
            for name, unit, series in (("angle_rad", "rad", run.angle), ("velocity_rad_per_s", "rad/s", run.velocity),
                                       ("energy_J", "J", run.energy), ("residual_J", "J", run.energy_residual)):
                cells = np.full(len(time), None)
                cells[np.searchsorted(time, run.time)] = series.tolist()
                motions[f"{run.method.name}_{name}"] = Column(cells.tolist(), unit)
        energy = self.energy_name.replace(" / ", "_over_").replace(" ", "_")
        drifts = {f.metadata["csv"].format(energy=energy): Column([getattr(row, f.name) for row in self.drift],
                                                                  f.metadata["unit"]) for f in self.columns}
        return {"comparison": motions, "drift": drifts}

    def pictures(self) -> Mapping[str, str]:
        """Return the kind of each figure, by the name of its file."""
        return {name: name for name in FIGURES}

    @property
    def energy_name(self) -> str:
        """Title of the drift table's energy columns: "relative energy error", or with losses "ledger residual / E0"."""
        conserved = not (self.scene.of_kind("dissipative") or self.scene.of_kind("drive"))
        return "relative energy error" if conserved else "ledger residual / E0"

    @property
    def table(self) -> Table:
        """Drift table: one row for each run, with its errors of energy, amplitude and phase and the time of a step."""
        head = tuple(f.metadata["title"].format(energy=self.energy_name) for f in self.columns)
        return Table(head, tuple(
            tuple("-" if (value := getattr(entry, f.name)) in (None, "") else format(value, f.metadata["form"])
                  for f in self.columns) for entry in self.drift))

    @property
    def columns(self) -> list[Any]:
        """Columns of the drift table: the dataclass fields of :class:`Drift` that these runs have values for."""
        absent = {*(ADAPTIVE if not self.tolerance else ()), *(("recording",) if self.recording is None else ())}
        return [f for f in dataclasses.fields(Drift) if f.name not in absent]

    @property
    def stepping(self) -> str:
        """Text on the step or the tolerances of the runs, for example "dt = 0.01 s"."""
        limits = "".join(f"{name} = {value:g}, " for name, value in self.tolerance.items())
        return f"{limits}{'steps that end at every' if limits else 'dt ='} {self.dt:g} s"

    @property
    def flow(self) -> str:
        """Sentence on the bob's Reynolds number and its meaning for the drag; "" for a scene without drag or medium."""
        if not any(effect.name.endswith("_drag") for effect in self.scene.effects):
            return ""
        started = dataclasses.replace(self.scene.run, angle=self.angle, velocity=self.velocity)
        reynolds = dataclasses.replace(self.scene, effects=(), run=started).reynolds
        if not reynolds or math.isinf(reynolds):
            return ""
        where = f"at the bottom, without losses: {reynolds:.0f} in {self.scene.medium.name}"
        sentence = f"Reynolds number {where}; {regime(reynolds)}."
        if 1.0 < reynolds <= CLIFT_GAUVIN_LIMIT:
            drag = sphere_drag_coefficient(reynolds)
            factor = drag * reynolds / 24.0
            sentence += f" At this number C_d = {drag:.2f}, and Stokes' law gives {factor:.1f} times too little drag."
        return sentence

    @property
    def large(self) -> str:
        """Warning that small-angle gravity gives a wrong period at this amplitude; "" where it is accurate enough."""
        swing = math.hypot(self.angle, self.velocity / self.scene.omega0) if self.scene.omega0 else 0.0
        if not any(effect.name == "small_angle_gravity" for effect in self.scene.effects) or swing < LARGE:
            return ""
        if swing >= math.pi:
            return (
                "Small-angle gravity is wrong for this start: a real pendulum would go over the top, or stay there; "
                "use the effect 'gravity'."
            )
        longer = exact.period(swing, self.scene.omega0) * self.scene.omega0 / math.tau - 1.0
        where = f"from {math.degrees(swing):.4g}°"
        return (
            f"Small-angle gravity is inaccurate for this start: a real pendulum's period is {longer:.1%} longer "
            f"{where}; use the effect 'gravity'."
        )

    @property
    def opposite(self) -> str:
        """Warning that the recorded bob was released on the other side than the runs; "" if it was not."""
        if self.recording is None:
            return ""
        run = next(iter(self.runs.values()))
        passed = np.flatnonzero(run.angle * run.angle[min(1, len(run.angle) - 1)] < 0.0)
        first = run.time[passed[0]] if passed.size else run.time[-1]
        until = self.recording.time <= first
        ours = np.interp(self.recording.time[until], run.time, run.angle)
        there, here = (float(np.mean(angles)) if angles.size else 0.0 for angles in (self.recording.angle[until], ours))
        if there * here >= 0.0 or abs(there) < CLEARLY * abs(here):
            return ""
        return ("The recording begins on the other side of the bottom than the runs, so they swing in opposite "
                "directions. Turn its sign round with Recording.read(..., scale=-1), or --read scale=-1 on the command "
                f"line, or start the runs from {math.degrees(-self.angle):.4g}°.")

    @property
    def text(self) -> str:
        """Description of the runs, the reference solution and the flow around the bob, in a few lines."""
        lines = [
            f"{self.scene.name}: {self.scene.equation()}, from {math.degrees(self.angle):.4g}° and {self.velocity:.4g} "
            f"rad/s, {self.stepping}, {self.duration:g} s.",
            f"Reference solution: {self.truth.how.rstrip('.')}"
            + (f" (error about {self.truth.error:.1g} rad)." if self.truth.known else "."),
            self.large,
            self.flow,
            f"Leading errors: h is the step, t the time, and omega0 = {self.scene.omega0:.4g} rad/s the angular "
            "frequency of small swings." if self.scene.omega0 else "",
        ]
        lines += [run.method.remark for run in self.runs.values()]
        lines += [f"{label}: {run.ending}" for label, run in self.runs.items() if run.stop_reason == "slack"][:1]
        if self.estimates:
            errors = (f"{label} {'unknown' if math.isinf(value) else f'{value:.1g} rad'}"
                      for label, value in self.estimates.items())
            lines.append(f"Largest error of the angle, from a second run at half the step: {', '.join(errors)}.")
        if self.recording is not None:
            lines += [f"Recording {self.recording.source}: {'; '.join(self.recording.notes)}.", self.opposite]
        return "\n".join(line for line in lines if line)


@with_bar("compare")
def compare(
    scene: str | Scene | Mapping[str, object],
    integrators: str | Method | Sequence[str | Method],
    *,
    damping: Damping = "scene",
    angle: float | None = None,
    velocity: float | None = None,
    dt: float | None = None,
    duration: float | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    recording: Recording | None = None,
    progress: Progress | bool | None = None,
    **parameters: Any,
) -> Comparison:
    """Run several integrators on the same scene from the same start, and compare them with the true motion.

    Args:
        scene, damping, dt: see :func:`pendulum_env.rollout`.
        **parameters: see :func:`pendulum_env.rollout`.
        integrators: names of methods, one string with commas between them, or one Method; none twice.
        angle, velocity: start [rad, rad/s]; by default the scene's usual start, or the recording's first turning
            point, unless the run begins at the recording's release.
        duration: length of the run [s]; by default the scene's usual run, or the recording's length.
        rtol, atol: tolerances, see :func:`pendulum_env.rollout`; all methods must be adaptive. Steps end at all
            multiples of dt, where the states are recorded.
        recording: recording of a real swing, which is cut to the free swing and centred. Time zero is the first turning
            point with readings on both sides, or the release if the scene was fitted to this recording: then the
            scene's ``run.duration`` is the duration of the free swing.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.

    Raises SceneError, MethodError or RecordingError for an invalid argument.
    """
    with naming_keywords(compare):
        place, shared = scene_and_shared(scene, damping, parameters)
    methods = checked_methods(integrators, place)
    if recording is not None and not isinstance(recording, Recording):
        raise SceneError(f"recording must be a Recording, for example of Recording.read, not {shown(recording)}.")
    swing = None if recording is None else from_release(recording, place)
    start, speed, usual = place.run.angle, place.run.velocity, place.run.duration
    if recording is not None and swing is None:
        swing = aligned(recording, angle)
        start, speed, usual = float(swing.angle[0]), 0.0, float(swing.time[-1])
    q = number(start if angle is None else angle, "angle", unit="rad")
    v = number(speed if velocity is None else velocity, "velocity", unit="rad/s")
    h = number(place.run.dt if dt is None else dt, "dt", above=0.0, unit="s")
    length = number(usual if duration is None else duration, "duration", above=0.0, unit="s")
    every = max(1, math.ceil(checked_steps(length, h) / ROWS))
    tell = told_by(progress)

    runs: dict[str, Rollout] = {}
    specs = [RunSpec.of(place, method, angle=q, velocity=v, dt=h, duration=length, every=every, rtol=rtol, atol=atol,
                        **shared) for method in methods]
    machines = [spec.machine() for spec in specs]
    for i, (spec, machine) in enumerate(zip(specs, machines, strict=True)):
        tell(i / (len(methods) + 1), f"running {spec.integrator}")
        runs[machine.label] = run_of(spec)
    tell(len(methods) / (len(methods) + 1), "computing the reference solution")
    longest = max(len(run.time) for run in runs.values())
    true = true_motion(place, q, v, np.arange(max(longest, 2), dtype=np.float64) * (every * h))
    recorded = None if swing is None else (swing.time, swing.angle)
    rows = [row(run, machine, true.angle, recorded) for run, machine in zip(runs.values(), machines, strict=True)]
    own = {}
    for label, spec in zip(runs, specs, strict=True) if not true.known else ():
        again = run_of(dataclasses.replace(spec, estimate_error=True, warn=False)).error_estimate
        own[label] = math.inf if again is None else float(np.max(again))
    tell(1.0, "compared")
    return Comparison(place, runs, tuple(rows), true, swing, q, v, h, length, machines[0].tolerance, own)


def from_release(recording: Recording, scene: Scene) -> Recording | None:
    """Return the free swing of a recording from its release on, centred; None if the scene was not fitted to it.

    A scene that was fitted to the recording is recognised by its usual run, which is as long as the free swing.
    """
    free = recording.released()
    if abs(free.time[-1] - scene.run.duration) > 1e-3 * float(np.median(np.diff(free.time))):
        return None
    centred = free.centred()
    return dataclasses.replace(centred, notes=(*centred.notes, "time zero: the release, as in the scene's usual run"))


def aligned(recording: Recording, start: float | None = None) -> Recording:
    """Return the free swing of a recording, centred, from its first turning point with readings on both sides.

    That turning point is time zero, with its angle fitted to the readings around it. If runs start from an
    angle ``start`` [rad] on the other side, and earlier readings show that the bob came from there, time zero is the
    second turning point. Raises RecordingError for a recording without a free swing.
    """
    full = recording.centred()
    free = full.released()
    points = turning_points(full)
    begin = full.time[-1] - free.time[-1]
    seen = np.flatnonzero(points.time >= begin - 0.5 * float(np.median(np.diff(full.time))))
    if not seen.size:
        return free
    zero, first = float(points.time[seen[0]]), float(points.angle[seen[0]])
    if start is not None and start * first < 0.0 and len(seen) > 1:
        before = -math.copysign(1.0, first) * full.angle[full.time < zero]
        if before.size and float(np.max(before)) > CLEARLY * abs(first):
            zero, first = float(points.time[seen[1]]), float(points.angle[seen[1]])
    later = full.time > zero
    note = f"time zero: turning point at {math.degrees(first):.4g}°, {zero:.4g} s in the file"
    time, angle = full.time[later] - zero, full.angle[later]
    return dataclasses.replace(
        full, time=np.concatenate(([0.0], time)), angle=np.concatenate(([first], angle)), notes=(*full.notes, note)
    )
