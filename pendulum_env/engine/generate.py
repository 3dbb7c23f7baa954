"""A scene and a method become the source of one readable file that holds those effects and no others.

The same text is run by Python as it is and compiled by numba: ``inline`` and ``entry`` are the decorators that the
runner provides (nothing, or njit), ``U`` makes an index that cannot be negative. All values are per moment of inertia.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import FunctionType

from integrators import DiscreteGradient, Exact, ForceGradient, Method, Multistep, Nystrom, Splitting, Taylor, unroll
from integrators.steps.compensated import added, scaled
from pendulum_env.engine import air, blocks, report, subflows, watch, whole
from pendulum_env.engine.adapt import CALLED, adapt
from pendulum_env.engine.layout import LIMITS, Layout
from pendulum_env.engine.loops import run, stick_slip
from pendulum_env.engine.shape import WATCHED, Shape
from pendulum_env.engine.source import Plain, arguments, check_names, constants_of, text_of, with_callees
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.equation import equation_text
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError

ARGUMENTS = {"time": "t", "angle": "q", "tilt": "q", "velocity": "v", "duration": "h"}
STILL = {"slip": "v", "speed": "abs(v)"}
"""Names that effects use -> names in a step, where they differ; STILL: in a medium at rest."""

WHOLE_ANGLE = "(q + 1.5707963267948966*(1.0 - side))"
"""The angle from the bottom, in scenes whose steps keep it from the nearer of bottom and top."""


@dataclass(frozen=True)
class Program:
    """Generated source with the names of what it takes and holds.

    Attributes:
        text: the file.
        shape: arguments, sums and reports.
        title: what it is, for file names and messages.
    """

    text: str
    shape: Shape
    title: str


@dataclass(frozen=True)
class BatchProgram(Program):
    """A program over blocks of environments; ``layout`` says where a block keeps what."""

    layout: Layout


@lru_cache(maxsize=512)
def program(
    scene: Scene, method: Method, diagnostics: tuple[str, ...] = ("energy",), adaptive: bool = False,
    compensated: bool = False,
) -> Program:
    """The program of one scene's effects with one method; parameters' values are left open."""
    writer = _Writer(scene, method, diagnostics, adaptive, compensated)
    return Program(writer.text([run(writer.shape), report.info(writer.shape)]), writer.shape, writer.title)


@lru_cache(maxsize=512)
def batch_program(
    scene: Scene,
    method: Method,
    diagnostics: tuple[str, ...],
    varying: frozenset[str],
    task: tuple[Callable[[float, float, float], float], Callable[[float], bool]] | None = None,
    compensated: bool = False,
) -> BatchProgram:
    """The same over blocks of environments, with a task's reward and loss, or of runs without a task.

    ``varying`` names the numbers of which each has its own. See :mod:`pendulum_env.engine.blocks`.
    """
    writer = _Writer(scene, method, diagnostics, compensated=compensated)
    names = None if task is None else (task[0].__name__, task[1].__name__)
    layout = Layout(writer.shape, varying & {*writer.shape.numbers, *LIMITS}, names)
    text = writer.text(blocks.loops(layout), task or ())
    return BatchProgram(text, writer.shape, f"{writer.title}-{'runs' if task is None else 'batch'}", layout)


class _Writer:
    """Puts together the functions that one method calls on one set of effects."""

    def __init__(
        self, scene: Scene, method: Method, diagnostics: tuple[str, ...], adaptive: bool = False,
        compensated: bool = False,
    ) -> None:
        self.scene, self.method = scene, method
        if "flow" in diagnostics and scene.medium.density and not scene.medium.viscosity:
            raise SceneError(f"The diagnostic 'flow' needs a viscosity, and {scene.medium.name} has none.")
        self.parameters = tuple(scene.coefficients)
        self.dry = next((effect.dry for effect in scene.effects if effect.dry), "")
        self.drives = [effect for effect in scene.of_kind("drive") if effect.torque]
        self.drags = [effect for effect in scene.of_kind("dissipative") if effect.torque]
        self.torques = [effect for effect in scene.effects if effect.torque]
        self.heats = self._heats(scene, diagnostics)
        self.windy = air.moving(scene.effects)
        self.ledger = self.heats is not None
        work = ("work",) if (self.drives or self.windy) and self.ledger else ()
        self.quadratures = (*work, *dict.fromkeys((self.heats or {}).values()))
        side = ("side",) if scene.periodic else ()
        held = [name for effect in scene.effects for name in effect.memory if name in self._taken(effect)]
        control = ("control",) if any(effect.controlled for effect in scene.effects) else ()
        self.extra = (*self.parameters, *side, *control, *held)
        self.place = (*self.parameters, *side)
        self.slides = bool(self.dry) and not isinstance(method, Splitting)
        slack = scene.body.suspension == "wire" and (self.windy or any(map(watch.may_push, scene.effects)))
        self.shape = Shape(
            parameters=self.parameters, place=self.place, extra=self.extra, quadratures=self.quadratures,
            memory=() if adaptive else method.memory_with(self.quadratures),
            dry=self.dry, slides=self.slides, periodic=scene.periodic,
            slack=slack, lenient=slack and scene.body.slack == "warn",
            ledger="energy" in diagnostics, by_effect="heat_by_effect" in diagnostics,
            adaptive=adaptive, compensated=compensated,
            watched=tuple(name for asked in diagnostics for name in WATCHED.get(asked, ())),
            remembered=tuple(name for effect in scene.effects for name in effect.memory),
            drawn=tuple(name for effect in scene.effects if effect.draws for name in effect.memory[-effect.draws:]),
        )
        self.used: list[Plain] = []
        names = "+".join(effect.name for effect in scene.effects) or "nothing"
        self.title = f"{names}-{method.name}-{'+'.join(diagnostics) or 'bare'}"
        self.title += f"{'-adaptive' if adaptive else ''}{'-compensated' if compensated else ''}"

    @staticmethod
    def _heats(scene: Scene, diagnostics: tuple[str, ...]) -> dict[str, str] | None:
        """Dissipative effect -> name of the quadrature that takes its heat; None if no ledger is wanted."""
        if "heat_by_effect" in diagnostics:
            return {effect.name: f"heat_{effect.name}" for effect in scene.of_kind("dissipative")}
        if "energy" in diagnostics:
            return {effect.name: "heat" for effect in scene.of_kind("dissipative")}
        return None

    @staticmethod
    def _taken(effect: Effect) -> set[str]:
        """Names that an effect's torque and wind take."""
        return {name for role in (effect.torque, effect.wind_x, effect.wind_y) if role for name in arguments(role)}

    # --- pieces of text -----------------------------------------------------------------------------------------

    def call(self, function: Plain, **renamed: str) -> str:
        """A call of an effect's function, its arguments found by name."""
        self.used.append(function)
        whole = {"angle": WHOLE_ANGLE} if self.scene.periodic else {"side": "1.0"}
        names = {**ARGUMENTS, **({} if self.windy else STILL), **whole, **renamed}
        return f"{function.__name__}({', '.join(names.get(name, name) for name in arguments(function))})"

    def sum_of(self, effects: Sequence[Effect], *roles: str) -> str:
        """The sum of one role's functions over effects, of the first that each has; "0.0" if there are none."""
        having = ([getattr(effect, role) for role in roles if getattr(effect, role)] for effect in effects)
        return " + ".join(self.call(found[0]) for found in having if found) or "0.0"

    def define(self, name: str, first: str, body: Sequence[str], extra: Sequence[str] | None = None) -> str:
        more = "".join(f", {name}" for name in (self.extra if extra is None else extra))
        return f"@inline\ndef {name}({first}{more}):\n" + "".join(f"    {line}\n" for line in body)

    def heat_of(self, effect: Effect) -> str:
        return (self.heats or {}).get(effect.name, "")

    # --- the problem's functions --------------------------------------------------------------------------------

    def acceleration(self, name: str = "acceleration", first: str = "t, q, v", *roles: str) -> str:
        before, total = air.motion(self), self.sum_of(self.torques, *roles, "torque")
        if not self.slides:
            return self.define(name, first, [*before, f"return {total}"])
        return self.define(name, first, [*before, f"return {total} - direction*{self.dry}"],
                           (*self.extra, "direction"))

    def rates(self) -> str:
        """Acceleration, power of the drives, power of the drags: torque times velocity, by construction."""
        lines = [*air.motion(self), *(f"torque_{e.name} = {self.call(e.torque)}" for e in self.torques if e.torque)]
        total = " + ".join(f"torque_{e.name}" for e in self.torques) or "0.0"
        results = [total + (f" - direction*{self.dry}" if self.slides else "")]
        for name in self.quadratures:
            slipping = [e for e in self.drags if self.windy and air.slipping(e)]
            if name == "work":
                driving = [f"v*({' + '.join(f'torque_{e.name}' for e in self.drives)})"] if self.drives else []
                results.append(" + ".join([*driving, *(air.work(self, e) for e in slipping)]))
                continue
            terms = [f"torque_{e.name}" for e in self.drags if self.heat_of(e) == name and e not in slipping]
            if self.slides and self.heat_of(self.dry_effect) == name:
                terms.append(f"-direction*{self.dry}")
            heats = [f"-v*({' + '.join(terms)})"] if terms else []
            results.append(" + ".join([*heats, *(air.heat(self, e) for e in slipping if self.heat_of(e) == name)]))
        return self.define(
            "rates", "t, q, v", [*lines, f"return {', '.join(results)}"],
            (*self.extra, "direction") if self.slides else self.extra,
        )

    def remember(self) -> str:
        """What effects remember, advanced by one control step."""
        lines = [f"{', '.join(f'{name}1' for name in effect.memory)}, = {self.call(effect.advance)}"
                 for effect in self.scene.effects if effect.advance]
        names = self.shape.remembered
        lines.append(f"return {', '.join(f'{name}1' for name in names)},")
        return self.define("remember", ", ".join((*names, "control", "first", "span")), lines, self.parameters)

    @property
    def dry_effect(self) -> Effect:
        return next(effect for effect in self.scene.effects if effect.dry)

    def jacobian(self, name: str = "jacobian", first: str = "t, q, v", *roles: str) -> str:
        still = [effect for effect in self.torques if not (self.windy and air.slipping(effect))]
        by_angle, by_velocity = self.sum_of(still, *roles, "by_angle"), self.sum_of(still, "by_velocity")
        lines: list[str] = []
        if self.windy:
            more, angle, velocity = air.derivatives(self)
            lines = [*air.motion(self), *more]
            by_angle, by_velocity = f"{by_angle} + {angle}", f"{by_velocity} + {velocity}"
        extra = (*self.extra, "direction") if self.slides else self.extra
        return self.define(name, first, [*lines, f"return {by_angle}, {by_velocity}"], extra)

    def force(self) -> str:
        still = [effect for effect in self.torques if effect.kind != "dissipative"]
        return self.define("force", "t, q", [f"return {self.sum_of(still, 'torque')}"])

    # --- the file -----------------------------------------------------------------------------------------------

    def text(self, loops: Sequence[str], functions: Sequence[Plain] = ()) -> str:
        """The file: what is called, the problem's functions, the step, then the loops around it."""
        hooks: dict[str, tuple[str, ...]] = {}
        pieces: list[str] = []
        if isinstance(self.method, Exact):
            pieces.append(whole.exact_flow(self))
        elif isinstance(self.method, ForceGradient):
            pieces, hooks = whole.force_gradient(self, self.method)
        elif isinstance(self.method, Nystrom) and self.method.velocity_free:
            pieces += [self.force(), *([self.acceleration()] if self.shape.adaptive and not self.quadratures else [])]
            pieces += [self.rates()] if self.quadratures else []
        elif not isinstance(self.method, Splitting):
            means = isinstance(self.method, DiscreteGradient)
            both = isinstance(self.method, Multistep)
            if self.slides or both or not (means or (self.quadratures and not self.method.implicit)):
                pieces.append(self.acceleration())
            if self.quadratures:
                pieces.append(self.rates())
            if means:
                pieces.append(self.acceleration("mean_acceleration", "t, q, v, spread", "mean"))
                pieces.append(self.jacobian("mean_jacobian", "t, q, v, spread", "mean_by_end"))
            elif self.method.implicit:
                pieces.append(self.jacobian())
            elif isinstance(self.method, Taylor):
                pieces.append(whole.taylor_series(self, self.method))
        else:
            pushes = not self.method.needs & {"split", "velocity_free"}
            pieces.append(self.acceleration() if pushes else self.force())
            if self.dry or self.quadratures:
                source, kicks = whole.stored(self) or subflows.kick(self, "push" if pushes else "kick")
                hooks |= kicks
                pieces.append(source)
            if self.drags and not pushes:
                source, hooks["drag"] = subflows.drag(self)
                pieces.append(source)
        extra = (*self.extra, "direction") if self.slides else self.extra
        one_drag = len(self.drags) < 2
        adaptive, compensated = self.shape.adaptive, self.shape.compensated
        step = unroll(
            self.method, quadratures=self.quadratures, extra=extra, hooks=hooks, exact_drag=one_drag,
            estimates=adaptive, compensated=compensated, glides=bool(self.dry),
        )
        pieces.append(step.replace("def ", "@inline\ndef "))
        if adaptive:
            pieces.append(adapt(self.shape, self.method))
        if self.slides:
            pieces.append(stick_slip(self.shape, whole.in_time(self)))
        if self.shape.remembered:
            pieces.append(self.remember())
        potentials = [effect for effect in self.scene.effects if effect.potential]
        pieces.append(self.define("potential", "q", [f"return {self.sum_of(potentials, 'potential')}"],
                                  self.place))
        pieces += [watch.tension(self)] if self.shape.pull else []
        pieces += watch.flow(self) if "quality_factor" in self.shape.watched else []
        copies = with_callees([*self.used, *report.called(self.shape), *(CALLED if adaptive else ()),
                               *((added, scaled) if compensated else ()), *functions])
        copied = "\n\n".join(f"@inline\n{_plain(function)}" for function in copies)
        head = f'"""{equation_text(self.scene.effects)}\n\nMethod: {self.method.name} ({self.method.source}).\n"""\n'
        numbers = {"NAN": "float('nan')", **{name: repr(value) for name, value in constants_of(copies).items()}}
        constants = "".join(f"{name} = {value}\n" for name, value in numbers.items())
        body = "\n\n".join([copied, *pieces, *loops])
        head += "from math import sqrt\n\n" if "sqrt(" in body else ""
        check_names(body, self.parameters)
        return "\n\n".join([head + constants, body])


def _plain(function: FunctionType) -> str:
    """Source without annotations in the signature, which a generated file has no names for."""
    lines = text_of(function).splitlines()
    end = next(i for i, line in enumerate(lines) if line.rstrip().endswith(":"))
    signature = f"def {function.__name__}({', '.join(arguments(function))}):"
    return "\n".join([signature, *lines[end + 1 :]]) + "\n"
