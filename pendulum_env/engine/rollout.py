"""Runs of a scene from given starts: arrays in, arrays out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Method, MethodError
from integrators.steps.compensated import LOST
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.provenance import provenance
from pendulum_env.engine.certificate import ESTIMATE, VELOCITY_ESTIMATE
from pendulum_env.engine.certified import with_estimates
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY, Machine, followed
from pendulum_env.engine.result import Rollout as Rollout
from pendulum_env.engine.runs import Runs
from pendulum_env.engine.shape import LEFT_OUT
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import check_count, npy_path
from pendulum_env.engine.stream import Stream, read
from pendulum_env.engine.streams import Streams
from pendulum_env.engine.threads import MOST_THREADS
from pendulum_env.engine.wrap import left_out
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, naming_keywords, whole_number

Array = NDArray[np.float64]

FIRST = np.zeros(1, dtype=np.intp)


def rollout(
    scene: str | Scene | Mapping[str, object] = "lab",
    *,
    integrator: str | Method = "rk4",
    damping: Damping = "scene",
    angle: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    dt: float | None = None,
    every: int = 1,
    control: float = 0.0,
    diagnostics: Sequence[str] = ("energy",),
    speed_limit: float = math.inf,
    backend: Backend = "auto",
    num_threads: int | None = None,
    file: str | Path | None = None,
    progress: Progress | bool = False,
    rtol: float | None = None,
    atol: float | None = None,
    compensated: bool = False,
    estimate_error: bool = False,
    substeps: int = 1,
    seed: int = 0,
    warn: bool = True,
    **parameters: Any,
) -> Rollout:
    """Simulate a scene from a start, or from many.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrator: name of a method, or a Method.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`; the parameters change what it left.
        angle, velocity: start [rad, rad/s]; numbers, or arrays for a batch; by default the scene's usual run.
        duration: [s]; by default the usual run's. Rounded up to whole steps.
        dt: the integrator's step [s]; by default the usual run's.
        every: record every so many steps, and the last.
        control: constant share of the motor's torque, within [-1, 1].
        diagnostics: "energy", "heat_by_effect", "tension", "flow", "error" (``estimate_error``); without the first two
            neither work nor heat.
        speed_limit: |velocity| at which a run ends with "speed_limit" [rad/s]. backend: as in gym.make; same bits.
        rtol, atol: for single runs with a method that estimates its error, such as "dop853": each step of ``dt`` is
            taken in as many as keep each one's error below ``atol + rtol |y|`` (root mean square of angle and
            velocity); ``atol`` is ``rtol`` by default. A run ends with "step_too_short" where none does.
        compensated: True adds what rounding takes in each addition with the next, for long runs without damping; see
            :mod:`integrators.steps.compensated`. Not with ``rtol``.
        estimate_error: True runs again beside steps of half the length, for ``error_estimate``, in 4 to 12 times the
            time: within a factor of 10 on smooth motions, down to rounding, inf from where nothing is known; see
            :mod:`pendulum_env.engine.certificate`.
        substeps: steps in a control step, for which what a lagging motor or gusts remember holds.
        seed: of gusts, a whole number from 0; run ``i`` of a batch has ``seed + i``.
        num_threads: for batches; None takes every core for large ones. Same bits.
        file: ".npy" that a batch's records go to as they are made; see :mod:`pendulum_env.engine.stream`.
        progress: True shows a bar, for batches; or what is called with the fraction done and a word for it.
        warn: False for no warning that a start is likely in degrees, that an effect's formula does not hold at its
            speed at the bottom, that steps are too long for the method to be stable, or that it found no solution.
        **parameters: single parameters of the scene, such as ``length=0.5``; arrays in a batch. And ``careful``: True
            refuses with a SceneError what would be warned of before the run.

    Returns a Rollout. A run that leaves the finite range, or whose energy residual is beyond all sense, ends there
    with ``stop_reason`` "diverged", and what it had found before is kept.

    Raises SceneError or MethodError for anything that cannot be.
    """
    with naming_keywords(rollout):
        spec = RunSpec.of(
            scene, integrator, damping, parameters, angle=angle, velocity=velocity, duration=duration, dt=dt,
            every=every, control=control, diagnostics=diagnostics, speed_limit=speed_limit, backend=backend, rtol=rtol,
            atol=atol, compensated=compensated, estimate_error=estimate_error, substeps=substeps, seed=seed, warn=warn,
        )
    telling = telling_of(progress, f"{math.prod(spec.shape)} runs")
    if spec.shape == () and file is None:
        return run(spec)
    if rtol is not None or atol is not None:
        raise MethodError("rtol and atol are for single runs, not written to a file: those of a batch step together.")
    if spec.shape == ():
        raise SceneError("A file takes the records of a batch; give angle, velocity or a parameter as an array.")
    if num_threads is not None:
        num_threads = whole_number(num_threads, "num_threads", MOST_THREADS)
    return _run_many(spec, num_threads, None if file is None else npy_path(file), telling)


def run(spec: RunSpec) -> Rollout:
    """Run one pendulum as described, and warn before and after it.

    Raises MethodError for a tolerance or a compensation that the method does not have, SceneError for too many records.
    """
    assert spec.plan is not None
    assert spec.start is not None
    check_count(spec.plan.count)
    machine = spec.machine()
    spec.tell()
    streams = Streams(spec.seeds)
    drawn = [float(streams.uniform(FIRST)[0]) for _ in machine.drawn]
    state = machine.state(float(spec.start[0]), float(spec.start[1]), drawn)
    start = machine.array(state)
    rows, rest = 1 + spec.plan.steps // spec.plan.every, spec.plan.steps % spec.plan.every
    states, reason = followed(machine, state, spec.h, rows, spec.plan.every, rest, spec.control, spec.speed_limit)
    spec.tell_end(machine, state, reason)
    counts = {name: int(state[i]) for name, i in machine.kept.items()}
    found = result_of(machine, states, reason, spec.h, counts)
    return with_estimates(machine, start, found, spec.control) if spec.estimate_error else found


def _run_many(spec: RunSpec, num_threads: int | None, path: Path | None, telling: AbstractContextManager[Progress],
              ) -> Rollout:
    """Run a batch as described, into memory or a file."""
    runs = spec.runs(num_threads)
    if path is None:
        check_count(runs.plan.count * runs.size)
    spec.tell()
    with telling as tell:
        found = _recorded(runs, spec.shape, path, tell)
    spec.tell_of_slack(runs.slackened)
    spec.tell_of_stops(enumerate(runs.reasons), runs.kept)
    return found


def result_of(machine: Machine, states: Array, reason: str, h: float, counts: Mapping[str, int]) -> Rollout:
    """Return the rollout of a machine's recorded states.

    ``reason`` says what ended the run, ``h`` is the control step [s], ``counts`` has the numbers of steps taken and
    rejected.
    """
    angle = states[:, ANGLE] + TWO_PI * states[:, TURNS]
    lost_q, lost_v = (states[:, machine.names.index(name)] if machine.compensated else None for name in LOST)
    return Rollout(
        time=states[:, INDEX] * h,
        angle=angle,
        velocity=states[:, VELOCITY],
        ledger=machine.ledger(states, machine.ledger(states[:1], 0.0).energy),
        heat_by_effect=machine.heat_by_effect(states),
        watched={name: states[:, place] for name, place in machine.watched.items()},
        stop_reason=reason,
        stop_time=float(states[-1, INDEX]) * h,
        scene=machine.scene,
        method=machine.method,
        dt=h,
        tolerance=machine.tolerance,
        steps=counts.get("taken", 0),
        rejected=counts.get("rejected", 0),
        lost_angle=None if lost_q is None else left_out(angle, states[:, ANGLE], lost_q, states[:, TURNS]),
        lost_velocity=lost_v,
    )


def _recorded(runs: Runs, shape: tuple[int, ...], path: Path | None, progress: Progress) -> Rollout:
    """The rollout of a batch: its records in memory, or in a file that they are read from."""
    plan, names = runs.plan, runs.names
    time: Array = plan.marks.astype(np.float64) * plan.h
    if path is None:
        whole = np.empty((len(time), len(names), runs.size))
        for _ in runs.rows(progress, whole):
            pass
        each = whole.reshape(len(time), len(names), *shape)
        found = {name: np.moveaxis(each[:, i], 0, -1) for i, name in enumerate(names)}
    else:
        done = 0
        facts = provenance(scene=runs.scene.to_dict(), integrator=runs.method.name, dt=plan.h, every=plan.every,
                           compensated=runs.compensated)
        with Stream(path, names, shape, facts) as stream:
            for rows in runs.rows(progress):
                stream.append(time[done : done + len(rows)], rows)
                done += len(rows)
        records = read(path)
        found = {name: np.moveaxis(records[name], 0, -1) for name in names}
    nothing = np.broadcast_to(0.0, found["angle"].shape)
    work, heat = (found.get(name, nothing) for name in ("work", "heat"))
    kinetic, potential = found["kinetic_energy"], found["potential_energy"]
    initial = kinetic[..., :1] + potential[..., :1]
    return Rollout(
        time=time,
        angle=found["angle"],
        velocity=found["velocity"],
        ledger=Ledger(kinetic, potential, work, heat, initial),
        heat_by_effect={name.removeprefix("heat_"): found[name] for name in names if name.startswith("heat_")},
        watched={name: found[name] for name in runs.layout.shape.watched},
        stop_reason=runs.reasons,
        stop_time=runs.ends.reshape(shape),
        scene=runs.scene,
        method=runs.method,
        dt=plan.h,
        lost_angle=found.get(LEFT_OUT[0]),
        lost_velocity=found.get(LEFT_OUT[1]),
        error_estimate=found.get(ESTIMATE),
        velocity_error_estimate=found.get(VELOCITY_ESTIMATE),
    )
