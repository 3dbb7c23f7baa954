"""The class :class:`Machine`, a simulator of one scene with one method, and the check that the method fits the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import integrators
from integrators import Method, MethodError
from integrators.method import NEEDS
from integrators.solving.adaptive import checked
from integrators.solving.solve import accepted
from integrators.steps.compensated import check_compensated
from pendulum_env.engine import equations
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, functions, resolve
from pendulum_env.engine.pieces import NOWHERE as NOWHERE
from pendulum_env.engine.pieces import Pace, run_in_pieces
from pendulum_env.engine.problem import moving, program_parts, slipping
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.series import untraceable
from pendulum_env.engine.shape import ADAPTED, BOUND, HOLD, PAUSED, SLACKENED, STATE, WATCHED
from pendulum_env.engine.wrap import split_turns
from pendulum_env.physics import random
from pendulum_env.physics.energy import Ledger
from pendulum_env.physics.exact.flows import flow_of
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, one_of, several, shown

Array = NDArray[np.float64]
Function = Callable[..., Any]
TWO_PI = 2.0 * math.pi
DIAGNOSTICS = ("energy", "heat_by_effect", *WATCHED, "error")
"""Names of the quantities that can be computed beside the motion."""

FORMAT = 2
"""Number of the form in which machines are pickled; raised by one whenever the arguments of Machine change."""

UNSEEN = np.empty(3, dtype=np.float32)
"""Array into which a run writes observations that are not used."""

INDEX, ANGLE, TURNS, VELOCITY, KINETIC, POTENTIAL = range(len(STATE))
"""Indices of the first entries of a state."""


ALWAYS = frozenset({"acceleration"})
"""Properties that every scene offers, so that a method that needs no others fits without a look at the scene."""
BY_ANGLE, BY_VELOCITY = frozenset({"angle", "tilt"}), frozenset({"velocity", "slip", "speed"})
"""Arguments of a torque that depends on the angle, and of one that depends on the velocity."""


def offers(scene: Scene) -> frozenset[str]:
    """Return the properties of a scene that methods may require, as names in :data:`integrators.method.NEEDS`."""
    offered = {*ALWAYS}
    losses, windy = scene.of_kind("dissipative"), moving(scene.effects)
    dry = any(effect.dry for effect in losses)
    torques = [(effect, {*arguments(effect.torque)}) for effect in scene.effects if effect.torque]
    flows = all((effect.fade if windy and slipping(effect) else effect.flow) or effect.dry for effect in losses)
    flows = flows and all(effect.flow for effect, names in torques
                          if effect.kind != "dissipative" and BY_VELOCITY & names)
    if flows and not (windy and dry):
        offered.add("split")
    if not dry:
        offered |= {"reversible", *(() if any(effect.limit for effect in scene.effects) else ("smooth",))}
        if not any(BY_VELOCITY & names for _, names in torques):
            offered.add("velocity_free")
    known = True
    for effect, names in torques:
        known &= not (BY_ANGLE & names and effect.by_angle is None)
        known &= not (BY_VELOCITY & names and effect.by_velocity is None)
        known &= not (windy and {"slip", "speed"} <= names and effect.by_speed is None)
    if known:
        offered.add("jacobian")
        if all(effect.mean and effect.mean_by_end for effect, names in torques
               if effect.kind == "conservative" and BY_ANGLE & names):
            offered.add("mean")
    if flow_of(scene.effects):
        offered.add("exact_flow")
    if not untraceable(scene.effects, scene.periodic):
        offered.add("taylor")
    return frozenset(offered)


def fitting(scene: Scene) -> dict[str, Method]:
    """Return the registered methods that fit a scene, a dict from name to method."""
    offered = offers(scene)
    return {name: method for name, method in integrators.METHODS.items() if method.needs <= offered}


def find_method(integrator: str | Method, scene: Scene) -> Method:
    """Return the method; MethodError if it is unknown, contradicts its declared order or does not fit the scene."""
    if isinstance(integrator, str) and integrator == "auto":
        raise MethodError(
            "integrator='auto' works only in gym.make and gym.make_vec, together with accuracy; elsewhere, choose a "
            "method and a step with lab-pendulum auto or lab-pendulum cost."
        )
    method = accepted(integrator)
    missing = method.needs - ALWAYS
    if missing and (missing := missing - offers(scene)):
        wants = " and ".join(NEEDS.get(need, need) for need in sorted(missing))
        names = list(fitting(scene))
        fits = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        why = " " + untraceable(scene.effects, scene.periodic) if "taylor" in missing else ""
        raise MethodError(
            f"{method.name} needs {wants}, which the scene '{scene.name}' does not offer; these fit: {fits}.{why}"
        )
    return method


def check_diagnostics(diagnostics: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the diagnostics as a tuple in a fixed order; SceneError for a name that is not a diagnostic.
    """
    if isinstance(diagnostics, str):
        raise SceneError(f"diagnostics must be a tuple of names, as in ({shown(diagnostics)},).")
    names = [one_of(name, "diagnostic", DIAGNOSTICS) for name in several(diagnostics, "diagnostics", "names")]
    return tuple(name for name in DIAGNOSTICS if name in names)


def checked_tolerance(method: Method, scene: Scene, rtol: float | None, atol: float | None) -> dict[str, float]:
    """Return the tolerances "rtol" and "atol" of adaptive steps by name; empty for fixed steps.

    Raises MethodError for a method without error estimates, a scene with dry friction, and invalid tolerances.
    """
    if rtol is None:
        if atol is not None:
            raise MethodError("atol goes with rtol, which is missing.")
        return {}
    tolerance = checked(method, rtol, atol)
    tolerance.check_rounding()
    if any(effect.dry for effect in scene.effects):
        raise MethodError(
            f"rtol cannot be used with dry friction, as in the scene '{scene.name}'; leave it out: fixed steps are cut "
            "at every zero of the velocity."
        )
    return {"rtol": float(tolerance.rtol), "atol": float(tolerance.atol)}


def check_even(even_steps: Any, tolerance: Mapping[str, float]) -> bool:
    """Return ``even_steps``, which must be True or False; raise MethodError if it is True without a tolerance."""
    even = boolean(even_steps, "even_steps")
    if even and not tolerance:
        raise MethodError("even_steps goes with rtol, which is missing.")
    return even


def numbers_of(scene: Scene, watched: bool = True) -> dict[str, float]:
    """Return all numbers of a scene that generated programs take as parameters, by name.

    With ``watched=False`` those for the pull on the suspension and for the flow past the bob are left out.
    """
    scale = scene.restoring
    further = equations.flow_numbers(scene) if watched else {}
    return {**scene.coefficients, "inertia": scene.inertia, "scale": scale, **further}


def motion_of(state: Any) -> tuple[float, float]:
    """Return the unwrapped angle [rad] and the velocity [rad/s] of a Machine's state vector."""
    return float(state[ANGLE]) + TWO_PI * float(state[TURNS]), float(state[VELOCITY])


class Runner:
    """A method that fits a scene, with all that a program depends on, for one pendulum or for many.

    Attributes:
        method, diagnostics, backend, compensated: the arguments of these names.
        tolerance: "rtol" and "atol" of adaptive steps by name; empty for fixed steps.
        compiled: True if numba compiles the program.

    Raises MethodError if the method does not fit the scene or the tolerance, EngineError for a backend that is not
    available.
    """

    def __init__(
        self, scene: Scene, method: str | Method, diagnostics: Sequence[str], backend: Backend, rtol: float | None,
        atol: float | None, compensated: bool,
    ) -> None:
        self.backend: Backend = backend
        self.method = find_method(method, scene)
        self.compensated = check_compensated(compensated, rtol)
        self.tolerance = checked_tolerance(self.method, scene, rtol, atol)
        self.diagnostics = check_diagnostics(diagnostics)
        self.compiled = resolve(backend, self.method.python_functions) == "compiled"


class Machine(Runner):
    """A simulator of one pendulum: a scene and a method with their generated program and parameter values.

    Attributes, beside those of a Runner:
        scene: the argument of this name.
        entry: the generated function ``run``; see :func:`pendulum_env.engine.loops.run`.
        direct: like :meth:`run`, but in one call that Ctrl-C cannot interrupt; for up to 4096 steps (FEW in
            :mod:`pendulum_env.engine.pieces`).
        info: the generated function from a state to the dict ``info``.
        phi: index of the angle from upright in a state.
        parameters: parameters of the program; ``numbers`` are their names.
        names: names of a state's entries; the first ``width`` are recorded.
        sums: name -> index in a state, for the quadratures (work and heat).
        watched: name -> index in a state, for the diagnostics "tension" and "flow".
        kept: name -> index in a state, for the counts and the step size of adaptive runs, and for the step at which
            the wire went slack.
        scale: ``m g L`` [J].
        hold: number of steps per control step, during which the state of effects, such as gusts, does not change.
        drawn: names of a state's entries that start as random numbers.
        even_steps: True if it divides every step of h into steps of equal length.

    Raises MethodError and EngineError as a Runner, and MethodError for even steps where a wire may go slack.
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
        even_steps: bool = False,
    ) -> None:
        super().__init__(scene, method, diagnostics, backend, rtol, atol, compensated)
        self.scene, self.hold = scene, hold
        self.even_steps = check_even(even_steps, self.tolerance)
        source = program(scene, self.method, self.diagnostics, bool(self.tolerance), self.compensated,
                         even=self.even_steps)
        if source.shape.even and source.shape.slack:
            raise MethodError(f"even_steps cannot be used where a wire may go slack, as in the scene '{scene.name}'; "
                              "leave it out, or hang the bob on a rod.")
        generated = functions(source, backend)
        self.entry: Function = generated["run"]
        self.direct: Function = self.run if self.tolerance else self.entry
        self.info: Function = generated["info"]
        self.phi = source.shape.phi
        self._pulled, self._parts = bool(source.shape.pull or source.shape.watched), program_parts(scene)
        values = numbers_of(scene, self._pulled) | self.tolerance
        self.scale = values["scale"]
        self.drawn = source.shape.drawn
        self._pace = Pace()
        values |= {HOLD[0]: float(hold), BOUND[0]: float(self._pace.units), BOUND[1]: -1.0}
        self.numbers = source.shape.params
        values |= {name: 0.0 for name in self.numbers if name not in values}
        self.parameters = self.array(values[name] for name in self.numbers)
        self.names = source.shape.state
        self.watched = {name: self.names.index(name) for name in source.shape.watched}
        self.width = len(source.shape.recorded)
        self.kept = {name: self.names.index(name) for name in (*ADAPTED, *SLACKENED) if name in source.shape.kept}
        self.sums = {name: i for i, name in enumerate(source.shape.recorded) if name in source.shape.sums}
        self._at_once = self._pace.units if not self.tolerance else 0 if source.shape.remembered else 1

    def __reduce__(self) -> tuple[Callable[..., Machine], tuple[Any, ...]]:
        """Return the arguments that rebuild a copied or unpickled machine; compiled functions are not pickled."""
        return _rebuilt, (FORMAT, type(self), *self.arguments)

    def take(self, scene: Scene) -> None:
        """Continue with a scene that has other parameter values: its numbers replace those in ``parameters``.

        Raises SceneError, and changes nothing, for a scene that needs another program.
        """
        self.check(scene)
        values = numbers_of(scene, self._pulled)
        self.scene, self.scale = scene, values["scale"]
        for place, name in enumerate(self.numbers):
            if name in values:
                self.parameters[place] = values[name]

    def check(self, scene: Scene) -> None:
        """Raise SceneError if a scene needs another program than that of this machine."""
        if program_parts(scene) != self._parts:
            raise SceneError(f"The scene '{scene.name}' with these values needs another program than the one that "
                             "runs; make a new environment with them.")

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Return the arguments that make an equal machine, in the order of Machine's parameters."""
        tolerance = (self.tolerance.get("rtol"), self.tolerance.get("atol"))
        return (self.scene, self.method, self.diagnostics, self.backend, *tolerance, self.compensated, self.hold,
                self.even_steps)

    @property
    def ready(self) -> bool:
        """Return True if a run starts at once: the program is interpreted, or was compiled in this process."""
        return not self.compiled or bool(getattr(self.entry, "signatures", ()))

    @property
    def accounts(self) -> bool:
        """Return True if work and heat are computed, so that the energy residual is meaningful."""
        return not {"energy", "heat_by_effect"}.isdisjoint(self.diagnostics)

    @property
    def label(self) -> str:
        """Return the method's name for plots and tables.

        The text "+ exact drag flow" is appended if the method computes the drag by its exact solution.
        """
        drags = any(effect.flow for effect in self.scene.effects)
        return f"{self.method.name} + exact drag flow" if drags and "split" in self.method.needs else self.method.name

    def array(self, values: Iterable[float]) -> Any:
        """Return numbers in the type that the backend needs: a float64 array (compiled) or a list of floats."""
        numbers = [float(value) for value in values]
        return np.array(numbers) if self.compiled else numbers

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        """Return the state at step 0 for an angle [rad] and a velocity [rad/s]; its energies are not computed yet.

        ``uniform`` holds a random number in [0, 1) for every name in ``drawn``, the variables that start at random; 0.5
        each by default.
        """
        angle, turns = split_turns(angle, self.scene.periodic)
        state = [0.0, angle, turns, velocity, *[0.0] * (len(self.names) - 4)]
        for name, number in zip(self.drawn, uniform or [0.5] * len(self.drawn), strict=True):
            state[self.names.index(name)] = random.started(number)
        return self.array(state)

    def run(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        """Advance a state in place by ``rows`` times ``every`` steps of ``h`` [s]; return a stop code or 0.

        The stop code is a key of :data:`pendulum_env.engine.shape.STOP_REASONS`.

        Args:
            state: the state; see :meth:`state`.
            parameters: the machine's ``parameters``, or an array with other values.
            control: constant fraction of the motor's torque, -1 to 1.
            speed_limit: |velocity| that ends the run [rad/s].
            out: array ``(rows + 1, width)`` for the initial state and the state after every ``every`` steps; empty for
                no records.
            seen: array of three float32 for the observation at the end.

        Long runs are divided into short calls of the program, so that KeyboardInterrupt (Ctrl-C) can end them; the
        state is then restored.
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
        """Advance a state as :meth:`run` does, in several short calls of the program that Ctrl-C can interrupt.

        A call may end within a control step divided into adaptive steps; it stores its progress in ``parameters``.
        """
        pace, work = self._pace, [INDEX]
        tries = self.numbers.index(BOUND[0]) if self.tolerance else 0
        if self.tolerance:
            parameters[tries + 1] = 0.0
            work = [self.kept[name] for name in ADAPTED[1:]]

        def call(rows: int, every: int, out: Any, seen: Any) -> int:
            """Call the generated ``run`` with a limit of the number of adaptive step attempts."""
            if self.tolerance:
                parameters[tries] = float(pace.units)
            return int(self.entry(state, parameters, control, h, rows, every, speed_limit, out, seen))

        code = run_in_pieces(call, pace, work, state, rows, every, out, seen)
        self._at_once = 0 if self.tolerance else pace.units
        return code

    def advance(self, state: Any, control: float, h: float, steps: int, speed_limit: float = math.inf) -> int:
        """Advance a state in place by ``steps`` steps of ``h`` [s]; return a stop code (key of STOP_REASONS) or 0."""
        return int(self.run(state, self.parameters, control, h, 1, steps, speed_limit, NOWHERE, UNSEEN))

    def ledger(self, rows: Any, initial: Any) -> Ledger:
        """Return the energy ledger of one state, or of an array of states, shape ``(..., states, entries)``.

        That of a list of numbers, one state, holds floats.
        """
        inertia, sums = self.scene.inertia, self.sums
        columns = rows if type(rows) is list else np.moveaxis(np.asarray(rows, dtype=float), -1, 0)
        kinetic, potential = inertia * columns[KINETIC], inertia * columns[POTENTIAL]
        zero: Any = 0.0 if type(rows) is list else np.zeros_like(kinetic)
        work = inertia * columns[sums["work"]] if "work" in sums else zero
        heat = sum((inertia * columns[i] for name, i in sums.items() if name.startswith("heat")), zero)
        return Ledger(kinetic, potential, work, heat, initial)

    def heat_by_effect(self, rows: Any) -> dict[str, NDArray[np.float64]]:
        """Return the heat of every dissipative effect [J] by name; empty without the diagnostic "heat_by_effect"."""
        columns = np.asarray(rows, dtype=float)
        places = {name: i for name, i in self.sums.items() if name.startswith("heat_")}
        return {name.removeprefix("heat_"): self.scene.inertia * columns[..., i] for name, i in places.items()}


def _rebuilt(form: int, kind: type[Machine], *arguments: Any) -> Machine:
    """Return an unpickled machine from its arguments; SceneError if another version of the package has pickled it."""
    if form != FORMAT:
        raise SceneError(f"This machine was pickled by another version of the package, in the format {shown(form)} and "
                         f"not {FORMAT}; make it anew from its scene and method.")
    return kind(*arguments)
