"""Error estimates of whole runs, computed from the difference to a second run with half the step.

This is step doubling (Richardson; Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, II.4), over
the whole run. If the error of a method of order p is ``C(t) h**p``, a run q with steps h and a run Q with steps h/2
give::

    error of q = |q - Q| 2**p / (2**p - 1)

An adaptive run is compared with a run at half the interval and with tolerances divided by 32 (TIGHTER), because its
error depends on both. The estimate is the error of the method alone: the state of effects, such as gusts, is the same
in both runs.

Rounding differs between the runs, so that their difference shows it, too; but a rounding that both runs share, such as
that of a coefficient, does not show, and the difference may be zero by chance. Therefore the estimate is never below
the following bound, with the unit roundoff u::

    u (|angle| + (sqrt(n) + omega0 t) (|tilt| + |velocity| reach))        reach = min(t, 1/omega0)

``sqrt(n)`` is the random walk of the roundings of n steps, 1 with compensated sums; ``omega0 t`` is the effect of one
rounding of the frequency on the phase; ``tilt`` is the angle from the nearer of bottom and top. Where rounding
dominates, methods of many stages may round more at half the step: their estimates are then up to 30 times too high.

The estimate is inf from one time to the end of the run as soon as the difference exceeds a fifth (TRUST) of the
motion so far (half the range of the angle, or the largest velocity over omega0) or, in periodic scenes, 1 rad (MOST):
a method that brings the bob to rest in both runs, or chaos, could otherwise end with a small difference. It is also inf
if a step is too long to resolve the motion: longer than half a period of a swing or of a drive, or than half a turn.

Every certificate is two runners and a comparison. The comparison is an :class:`ErrorEstimator`, with the
:class:`MotionSoFar` of the runs; :func:`along` applies it to recorded runs. The runners are those of runs without
estimates, and the second uses the same compiled program on another state, so that nothing more is compiled:
:func:`with_estimates` (a recorded run), :class:`CertifiedRuns` (many), :class:`CertifiedMachine` (an environment) and
:class:`CertifiedBatch` (a vector of them).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.solving.adaptive import FINEST
from pendulum_env.common.progress import Progress
from pendulum_env.engine.batch import UNCHANGED, Batch, Results
from pendulum_env.engine.each import Each
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, NOWHERE, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, motion_of
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.result import ESTIMATE, VELOCITY_ESTIMATE, Rollout
from pendulum_env.engine.runs import RecordSchedule, Runs
from pendulum_env.engine.sensing import Sensing
from pendulum_env.engine.shape import DIVERGED, HOLD, STOP_REASONS
from pendulum_env.engine.starts import frequency
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Numbers = Mapping[str, Any]
Motion = tuple[Array, Array]
"""Unwrapped angles [rad] and velocities [rad/s], arrays with a row for every step and a column for every run."""

TRUST = 0.2
"""Largest trusted difference of the two runs, as a fraction of the motion so far."""
MOST = 1.0
"""Largest trusted difference of the two angles in periodic scenes [rad]."""
TIGHTER = 32.0
"""Factor by which the second adaptive run has smaller tolerances; its error is then a few per cent of the first."""
SLACK = 64.0
"""Ignore differences below this multiple of the rounding bound."""
ROUNDOFF = 2.0**-53
"""Unit roundoff of double precision."""

STRETCH = 2**14
"""Number of steps of a single run that are compared with the second run at a time."""
EXTREMES = ("low", "high", "fastest")
"""Entries of an environment's state for its episode so far: range of the angle [rad], largest |velocity| [rad/s]."""

ENDLESS = ("speed_limit", "scale", "swing_pull")
"""Limits that are inf in the run at half the step, so that only a non-finite state ends this run."""


def tilted(angle: Any) -> Any:
    """Return the angle from the nearer of bottom and top [rad]."""
    return without_half_turns(angle, half_turns(angle))


@dataclass(frozen=True)
class ErrorEstimator:
    """Computation of error estimates from the differences of a run and a second run at half the step.

    The attributes h, omega0, gain and most may be arrays with one entry per run of a batch.

    Attributes:
        h: step of the run [s].
        omega0: small-angle angular frequency, 1 where there is no gravity [1/s].
        gain: ``2**p/(2**p - 1)`` for a method of order p, the ratio of the error to the difference.
        most: largest trusted difference of the angles [rad]; below 0 if steps are too long to resolve a drive.
        periodic: True if the torques repeat after a whole turn.
        walks: True if rounding errors accumulate, False with compensated summation.
        roundoff: unit roundoff of the run's numbers.
    """

    h: float
    omega0: Any
    gain: float
    most: Any
    periodic: bool
    walks: bool
    roundoff: float = ROUNDOFF

    @classmethod
    def of(
        cls, scene: Scene, method: Method, h: Any, numbers: Numbers, compensated: bool, adaptive: bool = False,
        library: Any = np,
    ) -> ErrorEstimator:
        """Return the error estimator for a scene, a method and steps of ``h`` [s].

        ``numbers`` holds the scene's coefficients and "omega0", as floats or as arrays of a library with NumPy's
        functions, one entry per run.
        """
        fastest = numbers["omega0"] if scene.omega0 else 0.0
        for effect in scene.effects:
            if effect.beat:
                fastest = library.maximum(fastest, abs(numbers[effect.beat]))
        resolved = adaptive | (library.asarray(fastest) * h <= math.pi)
        most = library.where(resolved, MOST if scene.periodic else math.inf, -1.0)
        most = float(most) if library is np and not most.ndim else most
        gain = 1.0 if math.isinf(method.order) else 2.0**method.order / (2.0**method.order - 1.0)
        return cls(h, numbers["omega0"], gain, most, scene.periodic, not compensated)

    def __call__(
        self, index: Any, angles: tuple[Any, Any], velocities: tuple[Any, Any], span: Any, fastest: Any,
        smaller: Callable[[Any, Any], Any] = np.minimum, larger: Callable[[Any, Any], Any] = np.maximum,
        root: Callable[[Any], Any] = np.sqrt, tilt_of: Callable[[Any], Any] = tilted,
    ) -> tuple[Any, Any, Any]:
        """Return error estimates of a run's angle [rad] and velocity [rad/s], and True where they can be trusted.

        Args:
            index: number of steps taken.
            angles, velocities: pairs of the value in the run and the value in the run at half the step.
            span, fastest: range of the run's angle so far [rad], and its largest |velocity| [rad/s].
            smaller, larger, root: functions for minimum, maximum and square root; Python's own are faster for floats
                and give the same bits as numpy's.
            tilt_of: function that returns the angle from the nearer of bottom and top.
        """
        angle, velocity = angles[0], velocities[0]
        tilt = tilt_of(angle) if self.periodic else angle
        reach = smaller(index * self.h, 1.0 / self.omega0)
        walk = (root(index) if self.walks else smaller(index, 1.0)) + self.omega0 * (index * self.h)
        least = self.roundoff * (abs(angle) + walk * (abs(tilt) + abs(velocity) * reach))
        least_v = self.roundoff * (walk * (abs(velocity) + abs(tilt) * self.omega0))
        error, error_v = (self.gain * abs(y[0] - y[1]) for y in (angles, velocities))
        motion = larger(0.5 * span, fastest / self.omega0)
        trusted = error <= smaller(larger(TRUST * motion, SLACK * least), self.most)
        if self.periodic:
            trusted = trusted & (fastest * self.h <= math.pi)
        return larger(error, least), larger(error_v, least_v), trusted


def endless(numbers: Numbers) -> dict[str, Any]:
    """Return a scene's numbers with speed limit, energy check and slack check disabled by inf.

    A run with these numbers ends early only at a state that is not finite.
    """
    return {
        name: (np.full_like(value, math.inf) if isinstance(value, np.ndarray) else math.inf)
        if name in ENDLESS else value for name, value in numbers.items()
    }


def halved(given: Numbers) -> dict[str, Any]:
    """Return a scene's numbers for the second run, at half the step, of an error estimate.

    It has no speed limit, twice as many steps per control step, and tolerances divided by 32 (TIGHTER).
    """
    factors = {**dict.fromkeys(HOLD, 2.0), **dict.fromkeys(("rtol", "atol"), 1.0 / TIGHTER)}
    numbers = {name: value * factors.get(name, 1.0) for name, value in endless(given).items()}
    if "rtol" in numbers:
        numbers["rtol"] = max(numbers["rtol"], FINEST)
    return numbers


def running(reduce: np.ufunc, first: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    """Return running extremes: for every row, ``reduce`` (such as np.minimum) of ``first`` and all rows up to this row.
    """
    if len(rows) > len(first):
        return np.asarray(reduce.accumulate(np.concatenate((first[None], rows)))[1:])
    result = np.empty_like(rows)
    for i, row in enumerate(rows):
        first = reduce(first, row, out=result[i])
    return result


class MotionSoFar:
    """Angle range [rad] and largest |velocity| [rad/s] of runs so far; True where error estimates can be trusted."""

    def __init__(self, angle: Array, velocity: Array) -> None:
        self.low, self.high, self.fastest = angle.copy(), angle.copy(), np.abs(velocity)
        self.trusted = np.ones(np.shape(angle), dtype=np.bool_)

    def begin(self, which: NDArray[np.intp], angle: Array, velocity: Array) -> None:
        """Restart the angle range, largest velocity and trust of the runs ``which`` from these initial conditions."""
        self.low[which], self.high[which], self.fastest[which] = angle, angle, np.abs(velocity)
        self.trusted[which] = True

    def estimates(
        self, estimator: ErrorEstimator, index: Array, angles: tuple[Array, Array], velocities: tuple[Array, Array]
    ) -> Array:
        """Return error estimates of angle and velocity at every row (recorded time), shape ``(rows, 2, runs)``.

        The range, the largest |velocity| and the trust stored in this object are brought up to the last row. ``angles``
        and ``velocities`` are pairs of arrays ``(rows, runs)``: of the runs, and of the runs at half the step.
        ``index`` is the number of steps taken, of shape ``(rows, 1)`` or ``(rows, runs)``.
        """
        with np.errstate(all="ignore"):
            low, high = running(np.minimum, self.low, angles[0]), running(np.maximum, self.high, angles[0])
            fastest = running(np.maximum, self.fastest, np.abs(velocities[0]))
            error, error_v, now = estimator(index, angles, velocities, high - low, fastest)
            trusted = running(np.logical_and, self.trusted, now)
        if len(angles[0]):
            self.low, self.high, self.fastest, self.trusted = low[-1], high[-1], fastest[-1], trusted[-1]
        return np.where(trusted[:, None], np.stack((error, error_v), axis=1), math.inf)


def estimator_of(runner: Machine | Batch | Runs, scene: Scene, h: float, numbers: Numbers) -> ErrorEstimator:
    """Return the error estimator for runs of a runner with steps of ``h`` [s]; see :meth:`ErrorEstimator.of`."""
    return ErrorEstimator.of(scene, runner.method, h, numbers, runner.compensated, bool(runner.tolerance))


def estimator_of_one(machine: Machine, h: float) -> ErrorEstimator:
    """Return the error estimator for runs of one pendulum with steps of ``h`` [s]."""
    return estimator_of(machine, machine.scene, h, {**machine.scene.coefficients, "omega0": frequency(machine.scene)})


def parameters_of(machine: Machine, half: bool) -> Any:
    """Return a machine's parameters for one of the two runs of an error estimate, without limits that end a run.

    The result is for the run with the machine's own steps or, with ``half``, for the run with steps of half the length.
    """
    given = dict(zip(machine.numbers, machine.parameters, strict=True))
    return machine.array((halved(given) if half else endless(given)).values())


# --- recorded runs --------------------------------------------------------------------------------------------------


def along(
    estimator: ErrorEstimator, own: Iterable[Motion], half: Iterable[Motion], marks: NDArray[np.int64],
    progress: Progress | None = None,
) -> Iterator[Array]:
    """Yield the error estimates at the recorded steps ``marks``, arrays ``(records, 2, runs)``, some at a time.

    ``own`` and ``half`` yield the motion of the runs with the same step and with half the step, at the start and after
    every step of the runs, in the same portions; nan where it is no longer finite. The shorter of them ends the
    estimates.
    """
    done, so_far = 0, None
    for both in zip(own, half, strict=False):
        angles, velocities = zip(*both, strict=True)
        so_far = so_far or MotionSoFar(angles[0][0], velocities[0][0])
        last = done + len(angles[0])
        index = np.arange(done, last, dtype=np.float64)[:, None]
        errors = so_far.estimates(estimator, index, angles, velocities)
        if progress is not None:
            progress(last / (int(marks[-1]) + 1), "running")
        yield errors[marks[(marks >= done) & (marks < last)] - done]
        done = last


def with_estimates(machine: Machine, start: Any, run: Rollout, control: float) -> Rollout:
    """Return the Rollout ``run`` of a single pendulum with error estimates added.

    The machine repeats the run from its initial state ``start``, with the same step and with half the step, and
    compares the two after every step. The estimates are inf after either of them is no longer finite, and at the end of
    a run that diverged. Where a wire goes slack within a step, the estimate is that at the end of the step.
    """
    marks = np.ceil(run.time / run.dt * (1.0 - 4.0 * ROUNDOFF)).astype(np.int64)
    own, half = (_every_step(machine, start, control, run.dt, int(marks[-1]), parts) for parts in (1, 2))
    known = np.concatenate([*along(estimator_of_one(machine, run.dt), own, half, marks)])
    estimates = np.full((2, len(marks)), math.inf)
    estimates[:, : len(known)] = known[..., 0].T
    if run.stop_reason == STOP_REASONS[DIVERGED]:
        estimates[:, -1] = math.inf
    return replace(run, error_estimate=estimates[0], velocity_error_estimate=estimates[1])


def _every_step(machine: Machine, start: Any, control: float, h: float, steps: int, parts: int) -> Iterator[Motion]:
    """Yield the motion of a run at the start and after every step of ``h`` [s], which is taken in ``parts`` parts.

    After its end, at a state that is no longer finite, the run is nan.
    """
    state, parameters = machine.array(start), parameters_of(machine, half=parts > 1)
    for done in range(0, max(1, steps), STRETCH):
        count = min(STRETCH, steps - done)
        out = np.empty((count + 1, machine.width))
        machine.run(state, parameters, control, h / parts, count, parts, math.inf, out, UNSEEN)
        reached = int(state[INDEX]) // parts - done
        out[reached + 1 :] = math.nan
        rows = out[1:, None] if done else out[:, None]  # the first row was the last one before
        yield rows[..., ANGLE] + TWO_PI * rows[..., TURNS], rows[..., VELOCITY]
        if reached < count:
            return


class CertifiedRuns(Runs):
    """A batch of runs with error estimates of angle and velocity as the last entries of their records.

    For the estimates every run is simulated twice more, with every step recorded: with the same step and with half the
    step.
    """

    def __init__(
        self, each: Each, method: str | Method, diagnostics: Sequence[str], backend: Backend, *, plan: RecordSchedule,
        hold: int = 1, streams: Streams | None = None, **options: Any,
    ) -> None:
        free = copy.copy(each)
        free.numbers = endless(each.numbers)
        twin = copy.deepcopy(streams), copy.deepcopy(streams)
        super().__init__(each, method, diagnostics, backend, plan=plan, hold=hold, streams=streams, **options)
        self._pair = [
            Runs(free, method, diagnostics, backend, plan=RecordSchedule(plan.h / parts, parts * plan.steps, parts),
                 hold=parts * hold, streams=twin[parts - 1], **{**options, **tolerance})
            for parts, tolerance in ((1, self.tolerance), (2, halved(self.tolerance)))
        ]
        self._columns = [self.names.index(name) for name in ("angle", "velocity")]
        self.names = (*self.names, ESTIMATE, VELOCITY_ESTIMATE)
        self._estimator = estimator_of(self, each.scene, plan.h, each.numbers)

    def rows(self, progress: Progress | None = None, whole: Array | None = None) -> Iterator[Array]:
        """Yield the records of all runs with error estimates, some rows (recorded times) at a time.

        ``progress`` is called with the progress of the estimates, which take most of the time.
        """
        angle, velocity = self._columns
        own, half = (((rows[:, angle], rows[:, velocity]) for rows in pair.rows()) for pair in self._pair)
        estimates = along(self._estimator, own, half, self.plan.marks, progress)
        ready = next(estimates)
        for rows in super().rows(None, whole):
            while len(ready) < len(rows):
                ready = np.concatenate((ready, next(estimates)))
            stopped = np.isnan(rows[:, angle])
            rows[:, -2:] = np.where(stopped[:, None], math.nan, ready[: len(rows)])
            ready = ready[len(rows) :]
            yield rows


# --- environments ---------------------------------------------------------------------------------------------------


class CertifiedMachine(Machine):
    """Machine (simulator of one pendulum) for one environment with error estimates.

    Its state holds a Machine's state, the state of the run at half the step, EXTREMES (angle range and largest velocity
    of the episode) and the error estimate. ``run`` advances both runs and records nothing; ``info`` has the further
    entry "error_estimate".
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._info_of_state, self._own = self.info, len(self.names)
        self.names = (*self.names, *(f"half_{name}" for name in self.names), *EXTREMES, ESTIMATE)
        self._set_runs()
        self._unread = (*self.watched.values(), *range(self.phi, self._own))
        self.direct, self.info = self.run, self._with_estimate

    def _set_runs(self) -> None:
        """Set the parameters of both runs from those of the machine; the estimator is made when first needed."""
        self._half_parameters, self._free_parameters = parameters_of(self, half=True), parameters_of(self, half=False)
        self._estimator: ErrorEstimator | None = None

    def take(self, scene: Scene) -> None:
        """Continue with a scene that has other parameter values; see :meth:`Machine.take`."""
        super().take(scene)
        self._set_runs()

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        """Return the initial state of an episode, for the run and the run at half the step; see :meth:`Machine.state`.
        """
        own = super().state(angle, velocity, uniform)
        half = own[: self._own]
        unwrapped = motion_of(half)[0]
        return self.array([*half, *half, unwrapped, unwrapped, abs(velocity), 0.0])

    def run(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        """Advance the run and the run at half the step, and update the error estimate; see :meth:`Machine.run`.

        Where a wire goes slack within a step, the estimate is that at the end of the step.
        """
        earlier = state.copy()
        code = super().run(state, parameters, control, h, rows, every, speed_limit, out, seen)
        own, index = self._own, float(math.ceil(state[INDEX]))
        full, half = state, state[own : 2 * own]
        more = int(2.0 * index - half[INDEX])
        if more > 0:
            try:
                super().run(half, self._half_parameters, control, 0.5 * h, 1, more, math.inf, NOWHERE, UNSEEN.copy())
                if index > state[INDEX]:
                    full, steps = earlier[:own].copy(), int(index - earlier[INDEX])
                    super().run(full, self._free_parameters, control, h, 1, steps, math.inf, NOWHERE, UNSEEN.copy())
            except BaseException:
                state[:] = earlier
                raise
            for entry in self._unread:
                half[entry] = 0.0
            state[own : 2 * own] = half
        low, high, fastest, before = (float(value) for value in state[2 * own :])
        angles, velocities = zip(*(motion_of(values) for values in (full, half)), strict=True)
        low, high, fastest = min(low, angles[0]), max(high, angles[0]), max(fastest, abs(velocities[0]))
        error, trusted = math.inf, False
        if code != DIVERGED and float(half[INDEX]) == 2.0 * index == 2.0 * full[INDEX] and before != math.inf:
            if self._estimator is None or self._estimator.h != h:
                self._estimator = estimator_of_one(self, h)
            error, _, trusted = self._estimator(index, angles, velocities, high - low, fastest, min, max, math.sqrt)
        for entry, value in enumerate((low, high, fastest, error if trusted else math.inf), 2 * own):
            state[entry] = value
        return code

    def _with_estimate(self, values: list[float]) -> dict[str, float]:
        """Return the entries of the environment's ``info`` for a state, with the error estimate added."""
        return {**self._info_of_state(values), ESTIMATE: values[-1]}


class CertifiedBatch(Batch):
    """A batch of environments with error estimates, computed together with a batch at half the step.

    The estimates are the last entry of ``names`` and of the results' ``info``. If an environment stops within a control
    step, its run at half the step is continued to the same time by the interpreter, which gives the same bits. The
    arguments are those of a Batch, with the integrator's step ``h`` [s].
    """

    def __init__(
        self, scene: Scene, method: str | Method, diagnostics: Sequence[str], backend: Backend,
        numbers: Mapping[str, Any], *, size: int, h: float, substeps: int, most: float, **options: Any,
    ) -> None:
        super().__init__(scene, method, diagnostics, backend, numbers, size=size, h=h, substeps=substeps, most=most,
                         **options)
        self._row, self.names = len(self.names), (*self.names, ESTIMATE)
        self._half_numbers = {**endless(numbers)}
        self._half = Batch(scene, method, diagnostics, backend, self._half_numbers, size=size, h=h / 2,
                           substeps=2 * substeps, most=math.inf, **{**options, **halved(self.tolerance)})
        self._unread = self._half.results(lasting=True)
        self._alone: Machine | None = None
        self._estimator = estimator_of(self, scene, h, numbers)
        self._so_far = MotionSoFar(np.zeros(size), np.zeros(size))
        self._estimate = np.zeros(size)

    def step(self, action: NDArray[np.floating[Any]], into: Results) -> bool:
        """Take one control step of every environment with the full and with half the step, and fill ``into``.

        The results in ``into`` include the error estimate; see :meth:`Batch.step`.
        """
        before, earlier = self.get("index"), self._state.copy()
        if not super().step(action, into):
            return False
        own = self.motion()
        after = np.ceil(own[0])
        short, cut = (own[0] > before) & (own[0] < before + self.substeps), own[0] < after
        alone = [self._by_itself(self._half, index, action, int(after[index] - before[index]))
                 for index in np.flatnonzero(short).tolist()]
        free = [self._by_itself(self, index, action, int(after[index] - before[index]), earlier)
                for index in np.flatnonzero(cut).tolist()]
        self._half.go_on()
        self._half.step(action, self._unread)
        half = self._half.motion()
        for motion, which, ended in ((own, cut, free), (half, short, alone)):
            for values, column in zip(motion, zip(*ended, strict=True), strict=False):
                values[which] = column
        good = (half[0] == 2.0 * after) & (own[0] == after) & (self.get("status") != DIVERGED)
        self._judge(np.arange(self.size), own, half, good)
        into.info[self._row] = self._estimate
        return True

    def step_in_parts(
        self, sensing: Sensing, action: NDArray[np.floating[Any]], into: Results, seen: NDArray[np.float32]
    ) -> None:
        """Take one control step, which has only one part here; see :meth:`Batch.step_in_parts`."""
        sensing.act(action)
        self.step(sensing.acting(0), into)
        sensing.sample(self._state, sensing.turn(self.substeps), self.substeps)
        sensing.give(seen, into.info[-1])

    def look(self, into: Results) -> None:
        """Write observations, rewards and reported quantities of all environments in their present states to ``into``.
        """
        super().look(into)
        into.info[self._row] = self._estimate

    def start(
        self, which: Places | None, angle: Array, velocity: Array, drawn: Mapping[str, Array], into: Results,
        numbers: Mapping[str, Array] = UNCHANGED,
    ) -> None:
        """Start new episodes in the batch and in the batch at half the step; see :meth:`Batch.start`."""
        super().start(which, angle, velocity, drawn, into, numbers)
        self._half.start(which, angle, velocity, drawn, self._unread, endless(numbers))
        if numbers:
            self._half_numbers = {**endless(self.numbers)}
            self._estimator = estimator_of(self, self._source[0], self.h, self.numbers)
        places = np.arange(self.size) if which is None else which
        self._so_far.begin(places, self.angles()[places], self.get("v", places))
        self._judge(places, self.motion(), self._half.motion(), np.ones(self.size, dtype=np.bool_))
        into.info[self._row] = self._estimate

    def _judge(self, which: Places, own: Sequence[Array], half: Sequence[Array], good: NDArray[np.bool_]) -> None:
        """Update the error estimates of the environments ``which``.

        ``own`` and ``half`` are the steps taken, angles and velocities of all environments, in their own runs and at
        half the step; where ``good`` is False, they are not comparable, and the estimate is inf for the rest of the
        episode.
        """
        self._so_far.trusted &= good
        index, angles, velocities = ((one[None], other[None]) for one, other in zip(own, half, strict=True))
        errors = self._so_far.estimates(self._estimator, index[0], angles, velocities)
        self._estimate[which] = errors[0, 0, which]

    def _by_itself(
        self, batch: Batch, index: int, action: NDArray[np.floating[Any]], steps: int, blocks: Array | None = None
    ) -> tuple[float, float, float]:
        """Return step count, angle and velocity that one environment would have if it had not stopped early.

        The control step is repeated for this environment alone, by Python's interpreter, over ``steps`` steps of full
        length. ``batch`` is this batch, or the one that takes two half steps for each; ``blocks`` is a copy of its
        states at the start of the control step, by default its present states.
        """
        if self._alone is None:
            self._alone = Machine(self._source[0], self.method, self.diagnostics, "python",
                                  compensated=self.compensated,
                                  rtol=self.tolerance.get("rtol"), atol=self.tolerance.get("atol"))
        machine, at, parts = self._alone, np.array([index]), batch.substeps // self.substeps
        values = {**dict(zip(machine.numbers, machine.parameters, strict=True)), **self._half_numbers,
                  HOLD[0]: float(batch.substeps), **batch.tolerance}
        parameters = [float(self._half.get(name, at)[0]) if name in self._half.layout.varying else float(values[name])
                      for name in machine.numbers]
        state = batch.state(index, machine.names, blocks)
        control = max(-1.0, min(1.0, float(action[index])))
        machine.run(state, parameters, control, batch.h, 1, parts * steps, math.inf, NOWHERE, UNSEEN.copy())
        return (float(state[INDEX]), *motion_of(state))
