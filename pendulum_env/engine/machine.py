"""A scene with a method, ready to run, recorded or not: what the environment, the studies and the lab all use."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
from integrators import Method, MethodError
from integrators.method import NEEDS
from integrators.solving.adaptive import checked
from integrators.steps.compensated import check_compensated
from pendulum_env.engine import watch
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, functions, resolve
from pendulum_env.engine.pieces import NOWHERE as NOWHERE
from pendulum_env.engine.pieces import Pace, run_in_pieces
from pendulum_env.engine.problem import moving, slipping
from pendulum_env.engine.series import untraceable
from pendulum_env.engine.shape import ADAPTED, BOUND, HOLD, PAUSED, SLACKENED, STATE, STOP_REASONS, WATCHED
from pendulum_env.engine.source import arguments
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics import random
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.exact.flows import flow_of
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of, several, shown

Array = NDArray[np.float64]
Function = Callable[..., Any]
TWO_PI = 2.0 * math.pi
DIAGNOSTICS = ("energy", "heat_by_effect", *WATCHED, "error")
"""What can be asked for beside the motion."""

UNSEEN = np.empty(3, dtype=np.float32)
"""What ``run`` puts an observation into that nobody reads."""

INDEX, ANGLE, TURNS, VELOCITY, KINETIC, POTENTIAL = range(len(STATE))


def offers(scene: Scene) -> frozenset[str]:
    """What a scene offers to methods, in the words of :data:`integrators.method.NEEDS`."""
    found = {"acceleration"}
    losses, windy = scene.of_kind("dissipative"), moving(scene.effects)
    dry = any(effect.dry for effect in losses)
    flows = all((effect.fade if windy and slipping(effect) else effect.flow) or effect.dry for effect in losses)
    if flows and not (windy and dry):
        found.add("split")
    if not dry:
        found |= {"reversible", "smooth"}
        if not any(_by_velocity(effect) for effect in scene.effects):
            found.add("velocity_free")
    known = True
    for effect in scene.effects:
        known &= not (_by_angle(effect) and effect.by_angle is None)
        known &= not (_by_velocity(effect) and effect.by_velocity is None)
        known &= not (windy and slipping(effect) and "speed" in arguments(effect.torque) and effect.by_speed is None)
    if known:
        found.add("jacobian")
        if all(effect.mean and effect.mean_by_end for effect in scene.of_kind("conservative") if _by_angle(effect)):
            found.add("mean")
    if flow_of(scene.effects):
        found.add("exact_flow")
    if not untraceable(scene.effects, scene.periodic):
        found.add("taylor")
    return frozenset(found)


def _by_angle(effect: Effect) -> bool:
    """True if an effect's torque depends on the angle."""
    return effect.torque is not None and not {"angle", "tilt"}.isdisjoint(arguments(effect.torque))


def _by_velocity(effect: Effect) -> bool:
    """True if an effect's torque depends on the velocity."""
    return effect.torque is not None and not {"velocity", "slip", "speed"}.isdisjoint(arguments(effect.torque))


def fitting(scene: Scene) -> dict[str, Method]:
    """The methods whose needs a scene meets, by name."""
    offered = offers(scene)
    return {name: method for name, method in integrators.METHODS.items() if method.needs <= offered}


def find_method(integrator: str | Method, scene: Scene) -> Method:
    """The method of this name; MethodError if there is none or if it does not fit the scene."""
    if isinstance(integrator, str) and integrator == "auto":
        raise MethodError(
            "integrator='auto' goes with an accuracy in gym.make and gym.make_vec; lab-pendulum auto and lab-pendulum "
            "cost tell which method and step to take elsewhere."
        )
    method = integrator if isinstance(integrator, Method) else integrators.get(integrator)
    missing = method.needs - offers(scene)
    if missing:
        wants = " and ".join(NEEDS.get(need, need) for need in sorted(missing))
        names = list(fitting(scene))
        fits = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        why = " " + untraceable(scene.effects, scene.periodic) if "taylor" in missing else ""
        raise MethodError(
            f"{method.name} needs {wants}, which the scene '{scene.name}' does not offer; these fit: {fits}.{why}"
        )
    return method


def check_diagnostics(diagnostics: Sequence[str]) -> tuple[str, ...]:
    """The names as a tuple; SceneError for one that does not exist."""
    if isinstance(diagnostics, str):
        raise SceneError(f"diagnostics must be a tuple of names, as in ({shown(diagnostics)},).")
    asked = [one_of(name, "diagnostic", DIAGNOSTICS) for name in several(diagnostics, "diagnostics", "names")]
    return tuple(name for name in DIAGNOSTICS if name in asked)


def reported(diagnostics: Sequence[str]) -> tuple[str, ...]:
    """Those that programs report: all but "error", which takes a second run; see engine/certificate.py."""
    return tuple(name for name in diagnostics if name != "error")


def checked_tolerance(method: Method, scene: Scene, rtol: float | None, atol: float | None) -> dict[str, float]:
    """The tolerance of each step by name; empty for steps of one length.

    Raises MethodError for a method without estimates, a scene with dry friction, or tolerances that cannot be.
    """
    if rtol is None:
        if atol is not None:
            raise MethodError("atol goes with rtol, which is missing.")
        return {}
    found = checked(method, rtol, atol)
    found.check_rounding()
    if any(effect.dry for effect in scene.effects):
        raise MethodError(
            f"rtol is not for scenes with dry friction such as '{scene.name}', whose stops it does not find; leave it "
            "out, and a step is cut at each zero of the velocity."
        )
    return {"rtol": float(found.rtol), "atol": float(found.atol)}


def numbers_of(scene: Scene) -> dict[str, float]:
    """Every number that programs take of a scene: its coefficients, and those of :mod:`pendulum_env.engine.shape`."""
    scale = scene.gravity * scene.weight_moment
    return {**scene.coefficients, "inertia": scene.inertia, "scale": scale, **watch.numbers(scene)}


class Machine:
    """A scene and a method with its functions, for one set of parameter values.

    Attributes:
        scene, method, diagnostics: as given.
        compiled: True if numba runs it.
        entry: the generated function ``run``; see :func:`pendulum_env.engine.loops.run`.
        direct: as :meth:`run`, without its bound of the work, for up to FEW steps of :mod:`pendulum_env.engine.pieces`.
        info: the generated function from a state's numbers to what ``info`` holds; ``phi``: place of the angle from
            upright among them.
        parameters: run-time parameters, as the functions take them; ``numbers`` are their names.
        names: names of a state's entries; the first ``width`` are recorded.
        sums: names of the quadratures -> their place in a state; ``watched``: of what else was asked for.
        scale: ``m g L`` [J].
        hold: steps in a control step, for which what effects remember, such as gusts, holds.
        drawn: names of entries of a state that start as random numbers.
        tolerance: "rtol" and "atol" of an adaptive machine, whose steps of h are taken in as many as these ask for;
            else empty. ``compensated``: as given. ``kept``: places in a state of "size", "taken" and "rejected" then.

    Raises MethodError if the method does not fit the scene or the tolerance, EngineError for a backend that cannot be
    had.
    """

    def __init__(
        self,
        scene: Scene,
        method: str | Method,
        diagnostics: Sequence[str] = ("energy",),
        backend: Backend = "auto",
        rtol: float | None = None,
        atol: float | None = None,
        compensated: bool = False,
        hold: int = 1,
    ) -> None:
        self.scene, self.backend, self.hold = scene, backend, hold
        self.method = find_method(method, scene)
        self.compensated = compensated = check_compensated(compensated, rtol)
        self.tolerance = checked_tolerance(self.method, scene, rtol, atol)
        self.diagnostics = check_diagnostics(diagnostics)
        self.compiled = resolve(backend) == "compiled"
        made = program(scene, self.method, reported(self.diagnostics), bool(self.tolerance), compensated)
        found = functions(made, backend)
        self.entry: Function = found["run"]
        self.direct: Function = self.run if self.tolerance else self.entry
        self.info: Function = found["info"]
        self.phi = made.shape.phi
        values = numbers_of(scene) | self.tolerance
        self.scale = values["scale"]
        self.drawn = made.shape.drawn
        self._pace = Pace()
        values |= {HOLD[0]: float(hold), BOUND[0]: float(self._pace.units), BOUND[1]: -1.0}
        self.numbers = made.shape.params
        values |= {name: 0.0 for name in self.numbers if name not in values}
        self.parameters = self.array(values[name] for name in self.numbers)
        self.names = made.shape.state
        self.watched = {name: self.names.index(name) for name in made.shape.watched}
        self.width = len(made.shape.recorded)
        self.kept = {name: self.names.index(name) for name in (*ADAPTED, *SLACKENED) if name in made.shape.kept}
        self.sums = {name: i for i, name in enumerate(made.shape.recorded) if name in made.shape.quadratures}
        self._at_once = self._pace.units if not self.tolerance else 0 if made.shape.remembered else 1

    def __reduce__(self) -> tuple[type[Machine], tuple[Any, ...]]:
        """Compiled functions are made anew where a machine is unpickled or copied."""
        tolerance = (self.tolerance.get("rtol"), self.tolerance.get("atol"))
        rest = (*tolerance, self.compensated, self.hold)
        return type(self), (self.scene, self.method, self.diagnostics, self.backend, *rest)

    @property
    def accounts(self) -> bool:
        """True if work and heat are summed, so that the energy's residual means something."""
        return not {"energy", "heat_by_effect"}.isdisjoint(self.diagnostics)

    @property
    def label(self) -> str:
        """The method, with how it treats drag where that is part of what runs."""
        drags = any(effect.flow for effect in self.scene.of_kind("dissipative"))
        return f"{self.method.name} + exact drag flow" if drags and "split" in self.method.needs else self.method.name

    def array(self, values: Iterable[float]) -> Any:
        """Numbers as the backend takes them: float64 arrays, or lists of Python floats."""
        numbers = [float(value) for value in values]
        return np.array(numbers) if self.compiled else numbers

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        """A state at step zero, its energies not yet filled in; the angle is kept from the nearer of bottom and top.

        ``uniform``: a number in [0, 1) for each of ``drawn``; 0.5 by default.
        """
        turns = 0.0
        if self.scene.periodic:
            halves = half_turns(angle)
            angle, turns = without_half_turns(angle, halves), 0.5 * halves
        found = [0.0, angle, turns, velocity, *[0.0] * (len(self.names) - 4)]
        for name, number in zip(self.drawn, uniform or [0.5] * len(self.drawn), strict=True):
            found[self.names.index(name)] = random.started(number)
        return self.array(found)

    def run(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        """Take ``rows`` times ``every`` steps of ``h`` [s] in place; return a key of STOP_REASONS, or 0.

        Args:
            parameters: of the machine, or others of the same names.
            control: constant share of the motor's torque.
            speed_limit: |velocity| that ends the run [rad/s].
            out: ``(rows + 1, width)``, takes the start and the state after every ``every`` steps; empty for no records.
            seen: three float32, takes the observation at the end.

        It returns to Python after each moment's work, so that KeyboardInterrupt ends it; the state is then as it was.
        """
        if rows * every <= self._at_once:
            code = int(self.entry(state, parameters, control, h, rows, every, speed_limit, out, seen))
            if code != PAUSED:
                return code
        return self._in_pieces(state, parameters.copy(), control, h, rows, every, speed_limit, out, seen)

    def _in_pieces(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        """:meth:`run` in calls of bounded work, between which adaptive steps pause in the ``parameters``."""
        before, pace, work = state.copy(), self._pace, [INDEX]
        tries = self.numbers.index(BOUND[0]) if self.tolerance else 0
        if self.tolerance:
            parameters[tries + 1] = 0.0
            work = [self.kept[name] for name in ADAPTED[1:]]

        def call(rows: int, every: int, out: Any, seen: Any) -> int:
            if self.tolerance:
                parameters[tries] = float(pace.units)
            return int(self.entry(state, parameters, control, h, rows, every, speed_limit, out, seen))

        if rows * every <= pace.units and (code := call(rows, every, out, seen)) != PAUSED:
            return code
        code = run_in_pieces(call, pace, work, state, before, rows, every, out, seen)
        self._at_once = 0 if self.tolerance else pace.units
        return code

    def advance(self, state: Any, control: float, h: float, steps: int, speed_limit: float = math.inf) -> int:
        """Some steps of ``h`` [s] in place, at a constant share of the motor; a key of STOP_REASONS, or 0."""
        return int(self.run(state, self.parameters, control, h, 1, steps, speed_limit, NOWHERE, UNSEEN))

    def ledger(self, rows: Any, initial: Any) -> Ledger:
        """The ledger of states: one state, or an array of them along the last axis but one."""
        inertia = self.scene.inertia
        columns = np.asarray(rows, dtype=float)
        kinetic, potential = inertia * columns[..., KINETIC], inertia * columns[..., POTENTIAL]
        zero = np.zeros_like(kinetic)
        work = inertia * columns[..., self.sums["work"]] if "work" in self.sums else zero
        heat = sum((inertia * columns[..., i] for name, i in self.sums.items() if name.startswith("heat")), zero)
        return Ledger(kinetic, potential, work, heat, initial)

    def heat_by_effect(self, rows: Any) -> dict[str, NDArray[np.float64]]:
        """Heat of each dissipative effect [J], by its name; empty unless asked for in ``diagnostics``."""
        columns = np.asarray(rows, dtype=float)
        found = {name: i for name, i in self.sums.items() if name.startswith("heat_")}
        return {name.removeprefix("heat_"): self.scene.inertia * columns[..., i] for name, i in found.items()}


# --- recorded runs ----------------------------------------------------------------------------------------------------


def simulate(
    machine: Machine,
    angle: float,
    velocity: float,
    *,
    h: float,
    rows: int,
    every: int = 1,
    rest: int = 0,
    control: float = 0.0,
    speed_limit: float = math.inf,
) -> tuple[Array, str]:
    """Return the states of one run of a machine, and why it stopped, or "".

    There are ``rows`` states, the start and one after every ``every`` steps of ``h``, and one more after a ``rest`` of
    fewer steps, if any; where the run stops early, the last one is there.
    """
    return followed(machine, machine.state(angle, velocity), h, rows, every, rest, control, speed_limit)


def followed(
    machine: Machine, state: Any, h: float, rows: int, every: int, rest: int, control: float, speed_limit: float
) -> tuple[Array, str]:
    """Return those of a run from a ``state``, which is advanced; see :func:`simulate`."""
    out = np.empty((rows + (rest > 0), machine.width))
    code = machine.run(state, machine.parameters, control, h, rows - 1, every, speed_limit, out[:rows], UNSEEN)
    if rest and not code:
        code = machine.run(state, machine.parameters, control, h, 1, rest, speed_limit, out[rows - 1 :], UNSEEN)
    return out[: 1 + math.ceil(state[INDEX] / every)], STOP_REASONS.get(code, "")
