"""The function :func:`rollout`: simulation of a scene from given initial conditions, one run or a batch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import Event, Method
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.engine.certificate import with_estimates
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.motion import named_events, trace
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.result import Rollout as Rollout
from pendulum_env.engine.runs import recorded, result_of, result_of_all
from pendulum_env.engine.settings import RunSettings, described, documented
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.starts import check_count, npy_path
from pendulum_env.engine.threads import MOST_THREADS
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, naming_keywords, whole_number

Array = NDArray[np.float64]

FIRST = np.zeros(1, dtype=np.intp)
"""Index of the only random stream of a single run."""


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
    progress: Progress | bool | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    even_steps: bool = False,
    compensated: bool = False,
    estimate_error: bool = False,
    substeps: int = 1,
    seed: int = 0,
    warn: bool = True,
    events: Any = None,
    dense: bool = False,
    **parameters: Any,
) -> Rollout:
    """Simulate a pendulum scene from one initial condition, or a batch of runs from several.

    Args:
        {arguments}
        angle, velocity: initial condition [rad, rad/s]; numbers, or arrays for a batch; by default that of the scene's
            usual run.
        duration: length of the run [s], rounded up to whole steps; by default that of the usual run.
        every: record one state per this many steps, and the last state.
        control: constant motor torque, as a fraction of its largest torque, within [-1, 1].
        even_steps: True divides every step of ``dt`` into adaptive steps of equal length. Their number is chosen once
            for each ``dt``, from the largest error of a step in the ``dt`` before, which takes less time than to choose
            every step by itself. Needs ``rtol``; not for batches, nor with events, ``dense``, ``estimate_error`` or a
            wire that may go slack.
        estimate_error: True computes ``error_estimate`` from a second run with steps of half the length, in 4 to 12
            times the time. On smooth motions the estimate is correct within a factor of 10, down to rounding; it is
            inf from the time on from which no estimate is possible; see :mod:`pendulum_env.engine.certificate`.
        seed: seed of gusts, a whole number from 0; run ``i`` of a batch has ``seed + i``.
        num_threads: number of threads for a batch; None uses every core for large batches. The results are equal bit
            by bit.
        file: path of a ".npy" file to which a batch's records are written as they are computed; see
            :mod:`pendulum_env.engine.growing_file`.
        progress: True shows a progress bar, False none; by default a notebook shows one for batches over 1.5 s. A
            function is called with the fraction done and the present activity.
        events: names, functions ``g(t, angle, velocity)`` or :class:`integrators.Event` of either, whose changes of
            sign are located between the steps, to rounding. Names are "turning" (zeros of the velocity), "bottom",
            "top" and "period" (whole periods of the drive). A function may have attributes ``direction`` and
            ``terminal``, as in SciPy's ``solve_ivp``; a run that a terminal event ends has the stop reason "event".
            Costs some 0.1 ms per step; see :mod:`pendulum_env.engine.motion` and :mod:`integrators.solving.events`.
        dense: True for a Rollout that can be called at any time of a single run, at the method's dense order; under dry
            friction in pieces between stops.
        **parameters: single parameters of the scene, such as ``length=0.5``; arrays in a batch.

    Work and heat are computed only with the diagnostics "energy" or "heat_by_effect"; "error" is ``estimate_error``.
    With ``rtol`` adaptive steps end at every ``dt``, which so is the longest step, as ``max_step`` is that of
    :func:`integrators.solve`. A run ends with "step_too_short" if no step meets the tolerance (root mean square of
    angle and velocity); in a batch every run takes adaptive steps of its own, with the same bits as by itself. Warnings
    before a run are those of a start that is likely in degrees, of an effect's formula that does not hold at the speed
    at the bottom, of unstable steps, and of steps that turn the rod by more than half a turn.

    Returns a Rollout. A run that leaves the finite range, or whose energy residual is absurdly large, ends there with
    ``stop_reason`` "diverged"; the states recorded before are kept.

    Raises SceneError or MethodError for invalid arguments.
    """
    with naming_keywords(rollout):
        spec = RunSpec.of(
            scene, integrator, damping, parameters, angle=angle, velocity=velocity, duration=duration, dt=dt,
            every=every, control=control, diagnostics=diagnostics, speed_limit=speed_limit, backend=backend, rtol=rtol,
            atol=atol, even_steps=even_steps, compensated=compensated, estimate_error=estimate_error,
            substeps=substeps, seed=seed, warn=warn,
        )
    watched = () if events is None else named_events(events, spec.scene)
    dense = boolean(dense, "dense")
    if spec.even_steps and (dense or watched):
        raise SceneError(f"even_steps cannot be combined with {'dense' if dense else 'events'}; leave one of them out.")
    if estimate_error and any(event.terminal for event in watched):
        raise SceneError("estimate_error cannot be combined with an event that ends the run; leave one of them out.")
    if num_threads is not None:
        num_threads = whole_number(num_threads, "num_threads", MOST_THREADS)
    telling = telling_of(progress, f"{math.prod(spec.shape)} runs")
    if spec.shape == () and file is None:
        return run(spec, watched, dense)
    if dense:
        raise SceneError("dense=True is for single runs without file=; call rollout for each run of the batch.")
    if file is not None and watched:
        raise SceneError("events cannot be combined with file=; leave one of them out.")
    if spec.shape == ():
        raise SceneError("file= is for batches; give angle, velocity or a parameter as an array.")
    result = _run_many(spec, num_threads, None if file is None else npy_path(file), telling)
    return _with_events(spec, result, watched) if watched else result


documented(rollout, arguments=described(RunSettings, form="{name}", hang=4))


def run(spec: RunSpec, events: tuple[Event, ...] = (), dense: bool = False) -> Rollout:
    """Simulate the single run that a RunSpec describes, with the warnings before and after it.

    ``events`` and ``dense`` are those of :func:`rollout`.

    Raises MethodError for a tolerance or a compensation that the method does not support, SceneError for too many
    records.
    """
    assert spec.plan is not None
    assert spec.start is not None
    check_count(spec.plan.count)
    machine = spec.machine()
    spec.tell()
    streams = Streams(spec.seeds) if machine.drawn else None
    drawn = [float(streams.uniform(FIRST)[0]) for _ in machine.drawn] if streams else []
    state = machine.state(float(spec.start[0]), float(spec.start[1]), drawn)
    start = machine.array(state)
    further: dict[str, Any] = {}
    if events or dense:
        states, reason, further = trace(machine, state, spec.plan, spec.control, spec.speed_limit, events, dense)
    else:
        states, reason = recorded(machine, state, spec.plan, spec.control, spec.speed_limit)
    spec.tell_end(machine, states, state, reason)
    result = replace(result_of(machine, states, reason, spec.h, state), **further)
    if "stop_time" in further:
        result.time[-1] = result.stop_time
    return with_estimates(machine, start, result, spec.control) if spec.estimate_error else result


def _with_events(spec: RunSpec, result: Rollout, events: tuple[Event, ...]) -> Rollout:
    """Return a batch's result with the events of its runs, each simulated once more by itself.

    Records after a terminal event are nan.
    """
    assert spec.start is not None
    runs = [run(spec.alone(i), events) for i in range(math.prod(spec.shape))]
    stops = np.array([one.stop_time for one in runs]).reshape(spec.shape)
    after = result.time > stops[..., None]

    def by_run(name: str) -> tuple[Any, ...]:
        """Return an object array with the results of all runs for each event."""
        columns = [np.empty(len(runs), dtype=object) for _ in events]
        for k, column in enumerate(columns):
            column[:] = [getattr(one, name)[k] for one in runs]
        return tuple(column.reshape(spec.shape) for column in columns)

    def cut(values: Any) -> Any:
        return values if values is None else np.where(after, np.nan, values)

    ledger = result.ledger
    return replace(
        result, angle=cut(result.angle), velocity=cut(result.velocity),
        ledger=Ledger(cut(ledger.kinetic), cut(ledger.potential), cut(ledger.work), cut(ledger.heat), ledger.initial),
        heat_by_effect={name: cut(values) for name, values in result.heat_by_effect.items()},
        watched={name: cut(values) for name, values in result.watched.items()},
        lost_angle=cut(result.lost_angle), lost_velocity=cut(result.lost_velocity),
        error_estimate=cut(result.error_estimate), velocity_error_estimate=cut(result.velocity_error_estimate),
        stop_time=stops, stop_reason=tuple(str(one.stop_reason) for one in runs),
        t_events=by_run("t_events"), angle_events=by_run("angle_events"), velocity_events=by_run("velocity_events"),
    )


def _run_many(spec: RunSpec, num_threads: int | None, path: Path | None, telling: AbstractContextManager[Progress],
              ) -> Rollout:
    """Simulate the batch of runs that a RunSpec describes, with records in memory or in a file."""
    runs = spec.runs(num_threads)
    if path is None:
        check_count(runs.plan.count * runs.size)
    spec.tell()
    with telling as tell:
        result = result_of_all(runs, spec.shape, path, tell)
    spec.tell_of_turns(runs.fastest)
    spec.tell_of_slack(runs.slackened)
    spec.tell_of_stops(enumerate(runs.reasons), runs.kept)
    return result
