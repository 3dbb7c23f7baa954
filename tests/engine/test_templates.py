"""The engine's programs are plain functions, templates, that run as they stand, and are specialised."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Scene
from pendulum_env.engine.advance import (
    GAUSS,
    After,
    Clip,
    State,
    adapt,
    adapt_evenly,
    advance,
    resting,
    stick_slip,
)
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.loops import run
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.problem import problem_of
from pendulum_env.engine.report import observed
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.slack import settle, slack_after, taut
from pendulum_env.engine.specialise import Names, SpecialiseError, lines_of, name, specialised, spliced
from pendulum_env.engine.templates import Templates

Function = Callable[..., Any]
Floats = tuple[float, ...]


# --- templates as they stand, beside a program's functions ------------------------------------------------------------


def flat(value: Any) -> Iterator[Any]:
    """The numbers in nested tuples."""
    if isinstance(value, tuple):
        for part in value:
            yield from flat(part)
    else:
        yield value


def nested(numbers: Iterator[Any], like: Any) -> Any:
    """Numbers in tuples like these; a NamedTuple makes a NamedTuple."""
    if not isinstance(like, tuple):
        return next(numbers)
    parts = [nested(numbers, part) for part in like]
    return type(like)(*parts) if hasattr(like, "_fields") else tuple(parts)


class Plain:
    """The templates of a program, called as they stand with the program's functions.

    A program's functions take and return numbers; here they take and return a template's tuples.
    """

    def __init__(self, scene: str, method: str, adaptive: bool = False, **options: Any) -> None:
        self.scene = SCENES[scene]
        problem = problem_of(self.scene, integrators.get(method), ("energy", "heat_by_effect"), adaptive, **options)
        made = program(self.scene, integrators.get(method), ("energy", "heat_by_effect"), adaptive, **options)
        self.templates, self.functions = Templates(problem), interpreted(made.text, made.title)
        self.values = self.templates.names.value
        bob = (("stop", self.values("bob1"), "size", "taken", "rejected", self.values("portion")) if adaptive
               else ("stop", self.values("bob1")))
        self.results = {
            "step": self.values("after"), "stick_slip": self.values("after"), "advance": bob, "land": bob,
            "settle": ("stop", self.values("bob1"), self.values("portion")), "begin": self.values("memory"),
            "rates": ("a", self.values("rates")), "resting": self.values("parts"), "remember": self.values("effects1"),
        }

    def function(self, called: str) -> Function:
        """A function of the program that takes and returns tuples."""
        one, like = self.functions.get(called), self.results.get(called, "number")
        if called == "acceleration" and one is None:
            return lambda *given: (self.functions["rates"](*flat(given)),)
        return lambda *given: nested(flat(one(*flat(given))), like) if one else None  # type: ignore[misc]

    def __call__(self, template: Function, *given: Any) -> Any:
        """Call a template, with what is known of the program as its arguments after ``*``."""
        known = {}
        for one in template.__kwdefaults__ or _known(template):
            value = self.templates.known.get(one, name(one))
            if one == "limit":
                value = self.scene.coefficients["dry_limit"]
            elif one == "step":
                step = self.function("step")
                value = lambda *given, step=step: (lambda a: (a.q, a.v, a.given, a.parts))(step(*given))  # noqa: E731
            elif isinstance(value, ast.Name):
                value = self.function(value.id)
            elif one == "watch":
                value = value._replace(tension=self.function("tension"))
            known[one] = value
        return template(*given, **known)


def _known(template: Function) -> tuple[str, ...]:
    code = template.__code__
    return code.co_varnames[code.co_argcount:code.co_argcount + code.co_kwonlyargcount]


def bits(value: Any) -> list[str]:
    return [float(one).hex() for one in flat(value)]


def extra_of(scene: Scene, side: float, control: float = 0.0) -> tuple[float, ...]:
    """The arguments of a scene's torques after time, angle and velocity."""
    steered = (control,) if any(effect.controlled for effect in scene.effects) else ()
    return (*scene.coefficients.values(), *((side,) if scene.periodic else ()), *steered)


RANDOM = np.random.default_rng(59)


@pytest.mark.parametrize("method", ["rk4", "gauss4"])
def test_stick_slip_has_the_bits_of_its_program(method: str) -> None:
    plain, extra = Plain("sticky_bearing", method), extra_of(SCENES["sticky_bearing"], 1.0)
    for q, v in RANDOM.normal(0.0, 0.05, (40, 2)):
        for start in (v, 0.0):
            made = plain.functions["stick_slip"](0.0, q, start, 0.02, *extra)
            assert bits(plain(stick_slip, 0.0, q, start, (), 0.02, extra)) == bits(made)


def test_the_search_for_slack_has_the_bits_of_its_program() -> None:
    plain, scene = Plain("exercise_large", "rk4"), SCENES["exercise_large"]
    machine = Machine(scene, "rk4")
    extra, pull = extra_of(scene, -1.0), tuple(machine.parameters[len(scene.coefficients) + 2:][:2])
    found = []
    for q, v in RANDOM.normal(0.0, (0.6, 12.0), (60, 2)):
        made = plain.functions["slack_after"](0.0, q, v, 0.05, *extra, *pull)
        assert bits(plain(slack_after, 0.0, q, v, (), 0.05, extra, pull)) == bits(made)
        q1, v1, *_ = plain.functions["step"](0.0, q, v, 0.05, *extra)
        assert plain(taut, 0.0, q, v, q1, v1, 0.05, extra, pull) == plain.functions["taut"](
            0.0, q, v, q1, v1, 0.05, *extra, *pull)
        bob = State(q, (2.0, -1.0), v, (), (), (0.0,), (), ())
        made = plain.functions["settle"](0.0, 0.05, 100.0, *flat(bob), *extra[:-1], *pull)
        assert bits(plain(settle, 0.0, 0.05, 100.0, bob, extra[:-1], (), pull)) == bits(made)
        found.append(made[0])
    assert {0.0, 3.0} <= {*found}  # some go on, some are slack


@pytest.mark.parametrize("even", [False, True])
def test_adaptive_steps_have_the_bits_of_their_program(even: bool) -> None:
    plain, extra = Plain("lab", "dopri5", True, even=even), extra_of(SCENES["lab"], 1.0, 0.3)
    template = adapt_evenly if even else adapt
    paused = plain.templates.known["paused"]
    for q, v in RANDOM.normal(0.0, (0.5, 3.0), (10, 2)):
        for tries in (1000.0, 3.0):
            one, other = [0.0] * (paused + 20), [0.0] * (paused + 20)
            given = (0.0, q, v, 0.3, 0.05, tries)
            made = plain.functions["adapt"](*given, one, 1e-9, 1e-9, *extra)
            assert bits(plain(template, *given, other, 1e-9, 1e-9, extra, (), ())) == bits(made)
            assert one == other


@pytest.mark.parametrize(("scene", "method", "options"), [
    ("lab", "rk4", {}), ("vacuum", "stoermer4", {}), ("exercise_large", "rk4", {}), ("sticky_bearing", "rk4", {}),
    ("exercise", "rk4", {"compensated": True}), ("lab", "velocity_verlet", {"compensated": True}),
    ("windy", "rk4", {}), ("water", "dopri5", {"adaptive": True}),
])
def test_a_whole_run_has_the_bits_of_its_program(scene: str, method: str, options: dict[str, Any]) -> None:
    """Each row is taken by a call of its own, so that the state that a run leaves counts, too."""
    plain, diagnostics = Plain(scene, method, **options), ("energy", "heat_by_effect")
    machine = Machine(SCENES[scene], method, diagnostics, backend="python",
                      compensated="compensated" in options, rtol=1e-8 if "adaptive" in options else None)
    found = []
    for one in (plain.functions["run"], lambda *given: plain(run, *given)):
        state = [float(x) for x in machine.state(2.2, 3.0)]
        params, seen, out = [float(x) for x in machine.parameters], [0.0] * 3, np.zeros((3, len(state)))
        stops = [one(state, params, 0.1, 0.01, 2, 3, 100.0, out, seen) for _ in range(3)]
        found.append((stops, bits((*state, *params, *seen)), out.tobytes()))
    assert found[0] == found[1]


def test_advance_has_the_bits_of_its_program() -> None:
    plain, scene = Plain("lab", "rk4"), SCENES["lab"]
    extra = extra_of(scene, 1.0, 0.4)
    parameters, further = extra[:len(scene.coefficients)], extra[-1:]
    sums = plain.templates.names.texts["sums"]
    for q, v in RANDOM.normal(0.0, (1.0, 30.0), (40, 2)):
        bob = State(q, (4.0, 1.0), v, (), (), (0.5,) * len(sums), (), ())
        made = plain.functions["advance"](0.3, 0.05, 40.0, *flat(bob), *parameters, *further)
        assert bits(plain(advance, 0.3, 0.05, 40.0, bob, parameters, further, ())) == bits(made)


# --- templates as they stand, beside closed forms ---------------------------------------------------------------------


def test_a_sliding_bob_stops_where_coulombs_law_says() -> None:
    """Under a constant torque g and friction m > g: it stops after v/(m - g), at v²/(2 (m - g)), and stays there."""
    g, m, v = 0.3, 0.8, 0.7

    def step(t: float, q: float, v: float, lost: Floats, h: float, extra: Floats, direction: float) -> Any:
        a = g - direction*m
        return q + h*(v + 0.5*h*a), v + h*a, (), (v*h + 0.5*h*h*a,)

    q, v1, _, (path,) = stick_slip(
        0.0, 0.1, v, (), 5.0, (), step=step, acceleration=lambda *_: g, resting=lambda *_: (), limit=m, count=1,
        timed=False, held=False)
    assert v1 == 0.0
    assert q == pytest.approx(0.1 + v*v/(2*(m - g)), rel=1e-14)
    assert path == pytest.approx(v*v/(2*(m - g)), rel=1e-14)


def test_a_sticking_bob_breaks_away_when_the_torque_exceeds_the_limit() -> None:
    """Under the torque t it starts at the time m; afterwards q = (t - m)³/6."""
    m = 0.4

    def step(t: float, q: float, v: float, lost: Floats, h: float, extra: Floats, direction: float) -> Any:
        a = t - direction*m
        return q + h*v + h*h*a/2 + h**3/6, v + h*a + h*h/2, (), ()

    q, v, _, _ = stick_slip(0.0, 0.0, 0.0, (), 1.0, (), step=step, acceleration=lambda t, *_: t,
                            resting=lambda *_: (), limit=m, count=0, timed=True, held=False)
    assert q == pytest.approx((1 - m)**3/6, rel=1e-13)
    assert v == pytest.approx((1 - m)**2/2, rel=1e-13)


@pytest.mark.parametrize("power", range(10))
def test_work_on_a_bob_at_rest_is_the_integral_of_the_power(power: int) -> None:
    """Gauss's rule with five nodes is exact for t**9; the heat is here twice the work."""
    work, heat = resting(0.5, 0.0, 1.5, (), rates=lambda t, *_: (0.0, (t**power, 2.0*t**power)), nodes=GAUSS)
    exact = (2.0**(power + 1) - 0.5**(power + 1))/(power + 1)
    assert work == pytest.approx(exact, rel=1e-14)
    assert heat == pytest.approx(2.0*exact, rel=1e-14)


PULLS: dict[str, tuple[Function, float]] = {
    "cosine": (math.cos, math.pi/2), "steep at the end": (lambda t: 1.0 - t**9, 1.0),
    "steep at the start": (lambda t: (2.0 - t)**9 - 1.0, 1.0),
}
"""Pulls over the time, and where each is zero; the rule of false position alone needs many more trials for two."""


@pytest.mark.parametrize("pull", PULLS)
@pytest.mark.parametrize("h", [1.6, 1.7, 1.9])
def test_the_search_finds_the_zero_of_a_pull_in_some_10_trials(pull: str, h: float) -> None:
    function, zero = PULLS[pull]
    trials = list[float]()

    def pull_after(t: float, q: float, v: float, given: Floats, part: float, *_: Any) -> float:
        trials.append(part)
        return float(function(t + part))

    found = slack_after(0.0, 0.0, 0.0, (), h, (), (1.0, 1.0), tension=lambda t, *_: function(t), pull_after=pull_after)
    assert found == pytest.approx(zero, abs=1e-13)
    assert len(trials) < 25


@pytest.mark.parametrize("h", [1.6, 2.0, 3.1, 4.5])
def test_a_pull_that_only_touches_zero_is_not_slack(h: float) -> None:
    assert slack_after(0.0, 0.0, 0.0, (), h, (), (1.0, 1.0), tension=lambda t, *_: 1.0 + math.cos(t),
                       pull_after=lambda t, q, v, given, part, *_: 1.0 + math.cos(t + part)) == math.inf


def moved(path: float, speed: float) -> Function:
    """A step that goes this way, whatever the time, and has this velocity."""
    return lambda t, q, v, memory, given, h, extra: After(q + path, speed, (), (), (0.25,), ())


@pytest.mark.parametrize("path", [0.1, 1.5, -1.6, 3.0, 8.0, -40.0])
def test_a_step_wraps_the_angle_and_counts_half_turns(path: float) -> None:
    stop, bob = advance(0.0, 0.1, 10.0, State(0.4, (-1.5, -1.0), 1.0, (), (), (2.0,), (), ()), (), (), (),
                        take=moved(path, 9.0), taut=moved, potential=moved, clip=None, slack=False)
    assert stop == 0.0
    assert bob.q + 2*math.pi*bob.winding[0] == pytest.approx(0.4 - 3*math.pi + path, abs=1e-13)
    assert abs(bob.q) <= math.pi/2
    assert bob.winding[1] == math.copysign(1.0, math.cos(0.4 - 3*math.pi + path))
    assert bob.sums == (2.25,)


@pytest.mark.parametrize(("path", "speed", "stops"), [
    (0.1, 9.0, "continues"), (0.1, -10.5, "speed_limit"), (math.nan, 1.0, "diverged"), (0.1, 1e200, "diverged")])
def test_a_step_is_checked(path: float, speed: float, stops: str) -> None:
    stop, _ = advance(0.0, 0.1, 10.0, State(0.4, (), 1.0, (), (), (2.0,), (), ()), (), (), (),
                      take=moved(path, speed), taut=moved, potential=moved, clip=None, slack=False)
    assert STOP_REASONS.get(int(stop), "continues") == stops


def test_a_clip_takes_the_energy_that_it_tells() -> None:
    _, bob = advance(0.0, 0.1, 10.0, State(0.4, (), 1.0, (), (), (0.0, 0.0), (), ()), (), (), (), take=moved(0.1, 5.0),
                     taut=moved, potential=lambda q, parameters: 3.0*q, clip=Clip(2.0, 0.5, True), slack=False)
    assert bob.v == 2.0
    assert bob.q == pytest.approx(0.5 - 0.5*0.1*3.0, abs=1e-15)
    assert bob.sums == pytest.approx((0.25, 0.5*(25 - 4) + 3.0*0.5*0.1*3.0), abs=1e-14)


@pytest.mark.parametrize("angle", [0.3, -1.4, 1.9, -3.0, 3.1, 9.0])
def test_an_observation_is_that_of_the_angle(angle: float) -> None:
    """Also where the angle is wrapped; phi is measured from upright."""
    halves = round(angle/math.pi)
    wrapped = State(angle - halves*math.pi, (0.5*halves, math.cos(halves*math.pi)), 2.0, (), (), (), (), ())
    for bob in (wrapped, wrapped._replace(q=angle, winding=())):
        cosine, sine, rate, phi = observed(bob)
        assert (cosine, sine, rate) == pytest.approx((math.cos(angle), math.sin(angle), 2.0), abs=1e-14)
        assert -math.pi <= phi <= math.pi
        assert (math.cos(phi), math.sin(phi)) == pytest.approx((-math.cos(angle), -math.sin(angle)), abs=1e-14)


def test_adaptive_steps_follow_an_oscillator() -> None:
    """Heun's method with Euler's inside, for q'' = -q: the error of cos(1) is near the tolerance."""
    def take(t: float, q: float, v: float, memory: Floats, given: Floats, h: float, extra: Floats) -> After:
        q1, v1 = q + h*v, v - h*q
        end = q + 0.5*h*(v + v1), v - 0.5*h*(q + q1)
        return After(*end, (), (-end[0],), (), (end[0] - q1, end[1] - v1))

    def power(x: float, y: float) -> float:
        return float(x**y)

    q, v, _, size, taken, rejected, reason, _ = adapt(
        0.0, 1.0, 0.0, 1.0, 0.5, 1e6, [0.0]*20, 1e-7, 1e-7, (), (), (), take=take, slope=lambda t, q, v, e: (-q, ()),
        power=power, taut=power, slack_after=power, order=1.0, count=0, paused=0, slack=False, ends_slack=False,
        lenient=False)
    assert reason == 0.0
    assert rejected >= 1.0
    assert 1000 < taken < 10000
    assert q == pytest.approx(math.cos(1), abs=1e-6)
    assert v == pytest.approx(-math.sin(1), abs=1e-6)
    assert 0 < size < 0.01


# --- specialisation ---------------------------------------------------------------------------------------------------

LIMIT = 3
NAMES = Names({"xs": ("a", "b"), "none": (), "ys": ("c", "d"), "bob": ("a", "z")})


def folded(t: float, xs: Floats, none: Floats, *, wide: bool, count: int) -> Any:
    """Fold what is known."""
    if none:
        t = t + none[0]
    zeros = (0.0,)*count
    for i, x in enumerate(xs):
        t = t - (t - x*zeros[0]) if i else t + x
    while t < LIMIT and True:
        t = 2.0*(t + 1.0) if wide else -t
    return t, none, tuple(x for x in xs if wide)


@spliced
def halved(x: float) -> float:
    """Return half a number."""
    half = 0.5*x
    return half


@spliced
def early(x: float) -> float:
    if x > 0.0:
        return x
    return -x


def splices(t: float) -> float:
    half = halved(t - 1.0)
    return half + 1.0


def clobbers_in_a_formula(t: float) -> float:
    half = halved(t - 1.0)
    return half*halved(3.0)


def clobbers_its_target(half: float) -> float:
    half = half*halved(3.0)
    return half


def splices_into_a_choice(t: float) -> float:
    return halved(t) if t > 0.0 else t


def splices_into_a_test(t: float) -> float:
    while halved(t) > 1.0:
        t = t - 1.0
    return t


def clobbers(t: float, half: float) -> float:
    t = halved(t)
    return t + half


def returns_early(t: float) -> float:
    return early(t)


def swaps(xs: Floats) -> Floats:
    xs = (xs[1], xs[0])
    return xs


def reads_what_changed(xs: Floats, t: float) -> float:
    pair = (xs[0], t)
    t = 1.0
    return pair[0] + pair[1]


def reads_a_part(bob: Floats, xs: Floats) -> Any:
    xs = (1.0, 2.0)
    return bob, xs


def shadows(t: float, xs: Floats) -> Any:
    """A comprehension has variables of its own."""
    half = 0.5*t
    ys = tuple(half*t for t in xs)
    return ys, tuple(half for half in xs), t, half


def unknown(t: float) -> float:
    return t + undefined  # type: ignore[name-defined, no-any-return]  # noqa: F821


def too_few(xs: Floats) -> Floats:
    xs = (xs[0],)
    return xs


def made(template: Function, **known: Any) -> str:
    return str(specialised(template, NAMES, known, "@inline", template.__name__))


def test_what_is_known_is_folded() -> None:
    assert made(folded, wide=True, count=1) == (
        '@inline\ndef folded(t, a, b):\n    """Fold what is known."""\n    t = t + a\n    t = t - (t - b*0.0)\n'
        "    while t < 3.0:\n        t = 2.0*(t + 1.0)\n    return t, a, b\n")
    assert made(folded, wide=False, count=1).endswith("    while t < 3.0:\n        t = -t\n    return t\n")


def test_a_template_and_its_function_compute_the_same() -> None:
    names: dict[str, Any] = {"inline": lambda function: function}
    exec(made(folded, wide=True, count=1), names)
    for t, a, b in RANDOM.normal(size=(20, 3)):
        assert bits(folded(t, (a, b), (), wide=True, count=1)) == bits(names["folded"](t, a, b))


def test_variables_of_a_comprehension_are_its_own() -> None:
    names: dict[str, Any] = {"inline": lambda function: function}
    exec(made(shadows), names)
    for t, a, b in RANDOM.normal(size=(20, 3)):
        assert bits(tuple(flat(shadows(t, (a, b))))) == bits(names["shadows"](t, a, b))


def test_a_spliced_function_stands_in_place_of_its_call() -> None:
    assert made(splices) == "@inline\ndef splices(t):\n    half = 0.5*(t - 1.0)\n    return half + 1.0\n"
    assert lines_of(halved, NAMES, {}) == ["half = 0.5*x"]


@pytest.mark.parametrize(("template", "why"), [
    (clobbers, "calls halved, which would change half"),
    (clobbers_in_a_formula, "calls halved, which would change half"),
    (clobbers_its_target, "calls halved, which would change half"),
    (splices_into_a_choice, "splices statements into a condition"),
    (splices_into_a_test, "splices statements into a condition"),
    (returns_early, "is spliced, but returns before its end"),
    (swaps, "sets a and reads it in the same statement"), (unknown, "uses undefined, which is not defined"),
    (reads_what_changed, "reads a part of pair, which was set from variables that have changed"),
    (reads_a_part, "reads a part of bob, which was set from variables that have changed"),
    (too_few, "sets xs, 2 variables, to 1 values"),
])
def test_what_a_program_would_compute_otherwise_is_refused(template: Function, why: str) -> None:
    with pytest.raises(SpecialiseError, match=why):
        made(template)


def test_errors_name_the_line_of_the_template() -> None:
    line = unknown.__code__.co_firstlineno + 1
    with pytest.raises(SpecialiseError, match=rf"test_templates\.py, line {line}: unknown uses"):
        made(unknown)
