"""The function :func:`rollout`: runs of a scene that JAX can differentiate, compile, map and run on any device."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from integrators import Method, MethodError
from integrators.solving.equal import MOST_STEPS
from pendulum_env.common.checks import boolean
from pendulum_env.common.many import twin_of
from pendulum_env.engine.certificate import ErrorEstimator, endless
from pendulum_env.engine.generate import Program, program
from pendulum_env.engine.machine import check_diagnostics, find_method
from pendulum_env.engine.random_streams import MOST_SEED, Streams
from pendulum_env.engine.report import SEEN
from pendulum_env.engine.result import ESTIMATE
from pendulum_env.engine.shape import HOLD, SLACK, STOP_REASONS
from pendulum_env.engine.starts import checked_control, checked_limit, checked_steps, frequency, start_values
from pendulum_env.jax.parameters import is_array, numbers, with_parameters
from pendulum_env.jax.programs import Later, Unchanged, bare, functions
from pendulum_env.physics import random
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.effects.smooth_friction import NARROWEST
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, one_of, shown, whole_number

Turn = Callable[[Any, Any], Any]
DTYPES = {"float32": np.float32, "float64": np.float64}
"""Names of the types of numbers in a run."""
LONG = 1000
"""Number of steps from which a run keeps only some of its states for a derivative, and computes the others anew."""


REFUSED: Mapping[str, str] = {
    "compensated": "whose compiler may contract and reorder sums",
    **dict.fromkeys(("rtol", "atol"), "where the number of steps must be known beforehand"),
    **dict.fromkeys(("events", "dense", "file", "backend", "num_threads", "progress"),
                    "where a run is one pure function of arrays"),
}
"""Keyword of :func:`pendulum_env.rollout` that :func:`rollout` does not take -> the reason."""


# --- what cannot be done ----------------------------------------------------------------------------------------------


def check_fits(scene: Scene, method: Method, kind: Any) -> None:
    """Raise SceneError or MethodError, with the reason and the nearest choice, for what has no twin in JAX."""
    dry = next((effect for effect in scene.effects if effect.dry), None)
    if dry is not None:
        raise SceneError(
            f"{dry.name} has no twin in JAX: whether the bob sticks is decided by searches within steps, which have no "
            "derivative; smooth it, as with smooth=0.01 [rad/s], leave it out, as with damping='linear', or use "
            "pendulum_env.rollout."
        )
    if method.python_functions:
        names = " and ".join(method.python_functions)
        raise MethodError(f"{method.name} calls the Python function {names}, which JAX cannot trace; write its step "
                          "without conditions on numbers, or use a method of the list, such as rk4.")
    drawing = next((effect for effect in scene.effects if effect.draws), None)
    if drawing is not None and kind != np.float64:
        raise SceneError(f"The random numbers of {drawing.name} need float64; call "
                         "jax.config.update('jax_enable_x64', True) first, or leave the effect out.")


# --- one step ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Twin:
    """The step of a scene with a method as a pure function on arrays.

    Attributes:
        program: the generated program; scenes that differ only in numbers share it.
    """

    program: Program

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of a state's entries."""
        return self.program.shape.state

    def parameters(self, values: Mapping[str, Any], hold: int, kind: Any) -> tuple[Any, ...]:
        """Return the numbers that a step takes, as arrays: those of a scene, with ``hold`` steps in a control step."""
        values = {**values, HOLD[0]: float(hold)}
        return tuple(jnp.asarray(values[name], kind) for name in self.program.shape.params)

    def motion(self, state: Any) -> tuple[Any, Any, Any]:
        """Return angle, turns and velocity of a state."""
        angle, turns, velocity = (state[self.names.index(name)] for name in ("angle", "turns", "velocity"))
        return angle, turns, velocity

    def turned(self, state: Any) -> Any:
        """Return the unwrapped angle of a state [rad]."""
        angle, turns, _ = self.motion(state)
        return angle + 2.0 * math.pi * turns

    @property
    def size(self) -> int:
        """Return the number of a state's entries that are carried from step to step, before the reported ones."""
        return self.program.shape.phi

    @property
    def read(self) -> frozenset[int]:
        """Return the indices of the entries of a state from which the next step starts; the others are left at 0."""
        return functions(self.program.text).entries_read("run", "state")

    def start(self, angle: Any, velocity: Any, parameters: Any, drawn: Mapping[str, float], kind: Any) -> Any:
        """Return the state at the start, a tuple of arrays."""
        shape = self.program.shape
        angle, velocity = (jnp.asarray(value, kind) for value in (angle, velocity))
        turns = jnp.zeros((), kind)
        if shape.periodic:
            call = functions(self.program.text).call
            halves = call("half_turns", angle)
            angle, turns = call("without_half_turns", angle, halves), 0.5 * halves
        form = jnp.broadcast_shapes(angle.shape, velocity.shape, *(jnp.shape(value) for value in parameters))
        known = {"angle": angle, "turns": turns, "velocity": velocity, **drawn}
        state = tuple(jnp.broadcast_to(jnp.asarray(known.get(name, 0.0), kind), form)
                      for name in self.names[: self.size])
        return self.run(state, parameters, 0.0, 1.0, steps=0)[1]

    def run(self, state: Any, parameters: Any, control: Any, h: Any, speed_limit: Any = math.inf, steps: int = 1,
            report: bool = False, known: bool = False) -> tuple[Any, Any, Any]:
        """Return the stop code, the state and the reported values after ``steps`` steps, 0 or 1, of the program.

        The reported values are the entries of ``info``, "phi" and the observation, by name; empty without ``report``.

        ``known`` says that this is not the first step and that the control is that of the step before.
        """
        held = [*state, *[0.0] * (len(self.names) - len(state))]
        seen = [0.0] * 3 if report else []
        if known:
            held[0], control = Later(held[0]), Unchanged(control)
            if "held" in self.names:
                held[self.names.index("held")] = control
        with np.errstate(over="ignore"):  # bounds such as 1e150 are infinite in float32
            stop = functions(self.program.text).call(
                "run", held, list(parameters), control, h, steps, 1, speed_limit, [], seen)
        like = state[1]
        after = [jnp.broadcast_to(jnp.asarray(bare(value), like.dtype), like.shape) for value in (stop, *held, *seen)]
        stop, read = after[0], self.read
        values = [value if i in read else jnp.zeros_like(value) for i, value in enumerate(after[1: 1 + self.size])]
        reports = dict(zip((*self.names[self.size:], *SEEN), after[1 + self.size:], strict=True)) if report else {}
        return stop, tuple(values), reports

    def step(self, carry: Any, parameters: Any, control: Any, h: Any, speed_limit: Any = math.inf,
             known: bool = False) -> tuple[Any, Any]:
        """Return the state and the stop code after one step from both; a run that has stopped keeps them."""
        state, stop = carry
        code, after, _ = self.run(state, parameters, control, h, speed_limit, known=known)
        after = tuple(jnp.where(stop == 0.0, new, old) for new, old in zip(after, state, strict=True))
        ended = (stop == 0.0) & (code == float(SLACK))
        if self.program.shape.slack:
            after = tuple(without_derivative(value, ended) for value in after)
        return after, jnp.where(stop == 0.0, code, stop)


@jax.custom_jvp  # type: ignore[untyped-decorator]
def without_derivative(value: Any, where: Any) -> Any:
    """Return a value, whose derivative is nan where a condition holds."""
    return value


@without_derivative.defjvp  # type: ignore[untyped-decorator]
def _(primals: Any, tangents: Any) -> Any:
    value, where = primals
    return value, tangents[0] * jnp.where(where, jnp.nan, 1.0).astype(value.dtype)


def twin(scene: Scene, method: Method, diagnostics: tuple[str, ...] = ("energy",)) -> Twin:
    """Return the step of a scene with a method as a pure function on arrays."""
    return Twin(program(scene, method, diagnostics, refines=True))


# --- runs -------------------------------------------------------------------------------------------------------------


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TwinRollout:
    """A run in JAX arrays; time is the last axis of the arrays of states.

    Attributes:
        time: times of the states [s].
        angle: unwrapped angle [rad].
        velocity: angular velocity [rad/s].
        values: further reported quantities by name, such as "energy", "work", "heat" and "energy_residual" [J].
        stop: code of the stop reason, 0 if the run did not stop; the states after a stop repeat the last one.
        scene: name of the scene.
        integrator: name of the method.
        dtype: type of the numbers, "float32" or "float64".
    """

    time: Any
    angle: Any
    velocity: Any
    values: dict[str, Any]
    stop: Any
    scene: str = field(metadata={"static": True})
    integrator: str = field(metadata={"static": True})
    dtype: str = field(metadata={"static": True})

    def __getattr__(self, name: str) -> Any:
        values = vars(self).get("values", {})
        if isinstance(values, dict) and name in values:
            return values[name]
        raise AttributeError(f"A TwinRollout has no {name}; it has time, angle, velocity, {', '.join(values)}.")

    @property
    def stop_reason(self) -> Any:
        """Return the stop reason, "" if the run did not stop; an array of texts for a batch. Not while JAX traces."""
        names = np.array([STOP_REASONS.get(int(code), "") for code in np.ravel(self.stop)])
        return str(names[0]) if np.ndim(self.stop) == 0 else names.reshape(np.shape(self.stop))


def rollout(
    scene: str | Scene | Mapping[str, object] = "lab",
    *,
    integrator: str | Method = "rk4",
    damping: Damping = "scene",
    angle: Any = None,
    velocity: Any = None,
    duration: float | None = None,
    steps: int | None = None,
    dt: Any = None,
    every: int = 1,
    control: Any = 0.0,
    actions: Any = None,
    substeps: int = 1,
    diagnostics: Sequence[str] = ("energy",),
    speed_limit: Any = math.inf,
    estimate_error: bool = False,
    smooth: float | None = None,
    seed: int = 0,
    dtype: Any = None,
    parameters: Mapping[str, Any] | None = None,
    **more: Any,
) -> TwinRollout:
    """Simulate a scene in JAX: a pure function of start, parameters, actions and step.

    ``jax.grad``, ``jax.jit`` and ``jax.vmap`` work on a function that calls it. Everything that may be an array of JAX
    may also be an array of runs, which broadcast. The numbers are those of :func:`pendulum_env.rollout` up to rounding.

    Args:
        scene, integrator, damping, diagnostics: as in :func:`pendulum_env.rollout`.
        angle, velocity: initial condition [rad, rad/s]; numbers or arrays.
        duration: length of the run [s], rounded up to whole steps; or ``steps``, their number.
        dt: the integrator's step [s]; a number or an array. With an array, give ``steps``.
        every: record one state per this many steps.
        control: constant motor torque, as a fraction of its largest torque; a number or an array.
        actions: the fractions, one per control step, in place of ``control``: an array with time as its last axis.
            Each acts for ``substeps`` steps; they give the length of the run.
        substeps: steps per control step.
        speed_limit: |velocity| at which a run ends with "speed_limit" [rad/s].
        estimate_error: True computes ``error_estimate`` [rad] from a second run with steps of half the length, as in
            :func:`pendulum_env.rollout`: inf from where the motion cannot be predicted. A derivative means nothing from
            there on, as in long chaotic runs, and a warning says so.
        smooth: velocity [rad/s] over which dry friction is smoothed, so that it has derivatives; the bob then creeps
            where it would stick (:class:`pendulum_env.physics.effects.SmoothFriction`).
        seed: seed of gusts.
        dtype: "float32" or "float64", or JAX's type of this name, such as ``jnp.float32``; by default float64 where JAX
            has it enabled. float64 needs ``jax.config.update("jax_enable_x64", True)``.
        parameters: parameters of the scene by name, such as ``{"length": x}``; numbers or arrays.
        **more: the same by keyword, such as ``length=x``.

    Returns a :class:`TwinRollout`. Runs of more than 1000 steps keep the states of some steps only and compute the
    others again for a derivative, so that its memory grows with the square root of the number of steps. At a wire that
    goes slack the derivative of the state is nan.

    Raises SceneError or MethodError for invalid arguments, and for what has no twin: dry friction without ``smooth``,
    steps that call Python.
    """
    if parameters is not None and not isinstance(parameters, Mapping):
        raise SceneError(f"parameters must be a dict of values by name, not {shown(parameters)}.")
    given = {**(parameters or {}), **more}
    for name, why in REFUSED.items():
        if name in given:
            raise MethodError(f"{name} has no twin in JAX, {why}; leave it out, or use pendulum_env.rollout.")
    place = with_parameters(smoothed(build_scene(scene, damping, {}), smooth), given)
    method = find_method(integrator, place)
    kind = kind_of(dtype)
    check_fits(place, method, kind)
    estimates = boolean(estimate_error, "estimate_error")
    usual = place.run
    h = usual.dt if dt is None else dt if is_array(dt) else number(dt, "dt", above=0.0, unit="s")
    hold = whole_number(substeps, "substeps", MOST_STEPS)
    count, controls = _length(usual.duration if duration is None else duration, duration, steps, h, actions, hold)
    stride = min(whole_number(every, "every"), count)
    if count % stride:
        raise SceneError(f"every must divide the number of steps, {count}, in JAX, where all records are of one "
                         f"length; {stride} does not.")
    one = twin(place, method, check_diagnostics(diagnostics))
    values = numbers(place)
    share = control if is_array(control) else checked_control(control)
    start = [value if is_array(value) else start_values(usual_one if value is None else value, name, unit)
             for name, value, usual_one, unit in (
                 ("angle", angle, usual.angle, "rad"), ("velocity", velocity, usual.velocity, "rad/s"))]
    drawn = _drawn(one, whole_number(seed, "seed", MOST_SEED, 0))
    most = speed_limit if is_array(speed_limit) else checked_limit(speed_limit)
    forced = None if controls is None else jnp.asarray(controls, kind)
    start, share, limit = jax.tree.map(lambda value: jnp.asarray(value, kind), (start, share, most))
    run: TwinRollout = _runner(one, count, stride, hold, place.name, method.name, kind)(
        *start, one.parameters(values, hold, kind), drawn, share, forced, jnp.asarray(h, kind), limit)
    if not estimates:
        return run
    arrays = one.parameters(endless(values), 2 * hold, kind)
    second = _runner(one, 2 * count, 2 * stride, 2 * hold, place.name, method.name, kind)(
        *start, arrays, drawn, share, forced, jnp.asarray(0.5 * h, kind), jnp.asarray(math.inf, kind))
    estimator = ErrorEstimator.of(place, method, h, {**values, "omega0": twin_of(frequency(place))}, False,
                                  library=jnp)
    estimate = lax.stop_gradient(_estimated(estimator, run, second, stride, functions(one.program.text)))
    jax.debug.callback(partial(_warn, place.name), run.time, estimate)
    return replace(run, values={**run.values, ESTIMATE: estimate})


def smoothed(scene: Scene, width: float | None) -> Scene:
    """Return a scene whose dry friction is smoothed over a width of velocities [rad/s], and any other unchanged.

    Raises SceneError for a width below 1e-9 rad/s, and for a scene without dry friction.
    """
    if width is None:
        return scene
    number(width, "smooth", least=NARROWEST, unit="rad/s")
    if not any(effect.dry for effect in scene.effects):
        raise SceneError(f"smooth is for dry friction, which the scene '{scene.name}' does not have; leave it out.")
    return scene.with_effects(effect.smoothed(width) for effect in scene.effects)


def _estimated(estimator: ErrorEstimator, run: TwinRollout, second: TwinRollout, stride: int, program: Any) -> Any:
    """Return the error estimates of a run's angles [rad], from a second run at half the step."""
    angle, velocity, last = run.angle, run.velocity, run.angle.ndim - 1
    low, high = lax.cummin(angle, axis=last), lax.cummax(angle, axis=last)
    row = jnp.broadcast_to(jnp.arange(angle.shape[-1]), angle.shape)
    each = {name: jnp.asarray(getattr(estimator, name))[..., None] for name in ("h", "omega0", "most")}

    def tilted(q: Any) -> Any:
        return program.call("without_half_turns", q, program.call("half_turns", q))

    estimator = replace(estimator, **each, roundoff=float(jnp.finfo(angle.dtype).eps) / 2.0)
    error, _, trusted = estimator(
        stride * row.astype(angle.dtype), (angle, second.angle), (velocity, second.velocity), high - low,
        lax.cummax(abs(velocity), axis=last), jnp.minimum, jnp.maximum, jnp.sqrt, tilted)
    whole = jnp.diff(run.time, axis=-1, prepend=-math.inf) > 0.9 * stride * each["h"]  # False from the end of a run
    lost = lax.cummax(jnp.where(whole & ~trusted, 1, 0), axis=last)
    error = jnp.where(lost, math.inf, error)
    return jnp.take_along_axis(error, lax.cummax(jnp.where(whole, row, 0), axis=last), axis=-1)


def _warn(name: str, time: Any, estimate: Any) -> None:
    """Warn of derivatives from where error estimates are inf."""
    lost = np.isinf(estimate)
    if lost.any():
        warnings.warn(f"Derivatives of a run of '{name}' mean nothing from t = {np.asarray(time)[lost].min():.4g} s, "
                      "where its error_estimate is inf; take a shorter run or a shorter step.", stacklevel=2)


def kind_of(dtype: Any) -> Any:
    """Return the type of numbers, given by name or as ``jnp.float32``; SceneError for float64 where JAX has it off."""
    wide = bool(jax.config.jax_enable_x64)
    for name in DTYPES:
        if dtype is getattr(jnp, name) or dtype is getattr(np, name) or (
                isinstance(dtype, np.dtype) and dtype.name == name):
            dtype = name
    name = ("float64" if wide else "float32") if dtype is None else one_of(dtype, "dtype", DTYPES)
    if name == "float64" and not wide:
        raise SceneError("JAX has float64 turned off; call jax.config.update('jax_enable_x64', True) first, or take "
                         "dtype='float32'.")
    return DTYPES[name]


def _length(length: float, duration: float | None, steps: int | None, h: Any, actions: Any, hold: int,
            ) -> tuple[int, Any]:
    """Return the number of steps, and the actions if there are any."""
    if actions is not None:
        if steps is not None or duration is not None:
            raise SceneError("actions give the length of the run; leave duration and steps out.")
        forces = actions if is_array(actions) else start_values(actions, "actions", "1")
        if forces.ndim < 1 or forces.shape[-1] < 1:
            raise SceneError("actions must be an array with one number per control step.")
        return int(forces.shape[-1]) * hold, forces
    if steps is not None:
        if duration is not None:
            raise SceneError("Give duration or steps, not both.")
        return whole_number(steps, "steps", MOST_STEPS), None
    if is_array(h):
        raise SceneError("With dt as an array, give steps, because the number of steps must be known.")
    return checked_steps(number(length, "duration", above=0.0, unit="s"), h), None


def _drawn(one: Twin, seed: int) -> dict[str, float]:
    """Return the random start of effects such as gusts, equal to that of :func:`pendulum_env.rollout`."""
    names = one.program.shape.drawn
    if not names:
        return {}
    streams = Streams((seed,))
    return {name: float(random.started(float(streams.uniform(np.zeros(1, dtype=np.intp))[0]))) for name in names}


@lru_cache(maxsize=128)
def _runner(one: Twin, count: int, every: int, hold: int, scene: str, integrator: str, kind: Any) -> Callable[..., Any]:
    """Return the compiled run of a number of steps, a function of start, numbers and controls."""
    shape = one.program.shape

    def run(angle: Any, velocity: Any, parameters: Any, drawn: Any, control: Any, actions: Any, h: Any,
            speed_limit: Any) -> TwinRollout:
        if actions is not None:
            angle = jnp.broadcast_to(angle, jnp.broadcast_shapes(angle.shape, actions.shape[:-1]))
        angle = angle + 0.0 * (control + h)
        state = one.start(angle, velocity, parameters, drawn, kind)
        start = carry = (state, jnp.zeros_like(state[1]))
        by_step = None if actions is None else jnp.repeat(jnp.moveaxis(actions, -1, 0), hold, axis=0)
        taken = int(by_step is None and bool(shape.memory) and not shape.remembered)
        if taken:  # the first step computes the history; the others know it
            carry = one.step(carry, parameters, control, h, speed_limit)

        def turn(carry: Any, i: Any) -> Any:
            acting = control if by_step is None else by_step[i]
            known = not shape.remembered and (by_step is None or not shape.memory)
            return one.step(carry, parameters, acting, h, speed_limit, known)

        rows = _recorded(turn, carry, taken, count, every)
        states, stops = jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), start, rows)
        judged, _, reports = one.run(tuple(states), parameters, control, h, report=True, steps=0)
        ends = jnp.where(stops[-1] != 0.0, stops[-1], jnp.max(judged, axis=0))
        series = {name: jnp.moveaxis(value, 0, -1) for name, value in reports.items()
                  if name not in ("phi", *SEEN)}
        time = series.pop("time", jnp.moveaxis(states[0] * h, 0, -1))
        angles = series.pop("angle", jnp.moveaxis(one.turned(states), 0, -1))
        velocities = series.pop("velocity", jnp.moveaxis(one.motion(states)[2], 0, -1))
        return TwinRollout(time, angles, velocities, series, ends, scene, integrator, np.dtype(kind).name)

    return jax.jit(run)  # type: ignore[no-any-return]


def _recorded(turn: Turn, carry: Any, taken: int, count: int, every: int) -> Any:
    """Return the states and stop codes after every ``every`` steps, along a new first axis.

    ``taken`` steps, 0 or 1, were taken before. Long runs are divided into parts, of which only the first state is
    stored for a derivative.
    """
    part = math.isqrt(count) if count > LONG else count

    def many(carry: Any, begin: Any, steps: int) -> Any:
        if steps == 1:
            return turn(carry, begin)
        return _in_parts(lambda carry, i: (turn(carry, i), None), carry, begin, steps, part)[0]

    def row(carry: Any, k: Any) -> tuple[Any, Any]:
        after = many(carry, k * every, every)
        return after, after

    records = []
    if taken:
        carry = many(carry, jnp.asarray(taken), every - taken) if every > taken else carry
        records.append(jax.tree.map(lambda value: value[None], carry))
    _, rows = _in_parts(row, carry, taken, count // every - taken, max(1, part // every))
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *records, rows)


def _in_parts(body: Callable[[Any, Any], tuple[Any, Any]], carry: Any, first: Any, count: int, part: int) -> Any:
    """Return what ``lax.scan`` returns for a body over the numbers from ``first`` on, ``count`` of them.

    They are divided into parts, of which only the first carried value is stored for a derivative.
    """
    def some(carry: Any, begin: Any, count: int) -> Any:
        return lax.scan(body, carry, begin + jnp.arange(count))

    whole, rest = divmod(count, part) if count > part else (0, count)
    results = []
    if whole:
        carry, parts = lax.scan(jax.checkpoint(lambda carry, i: some(carry, first + i * part, part)), carry,
                                jnp.arange(whole))
        results.append(jax.tree.map(lambda value: value.reshape((-1, *value.shape[2:])), parts))
    if rest or not whole:
        carry, last = some(carry, first + whole * part, rest)
        results.append(last)
    return carry, jax.tree.map(lambda *parts: jnp.concatenate(parts), *results)
