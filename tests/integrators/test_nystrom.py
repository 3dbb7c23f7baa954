"""Nyström methods: trees, published numbers, quadratures, pairs, and problems that do not fit."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from nystrom_truths import NYSTROM

import integrators
from integrators import METHODS, EmbeddedNystrom, MethodError, Nystrom, RungeKutta, System, solve, unroll
from integrators.analysis import nystrom_conditions, order_conditions, reference, single_step
from integrators.analysis.nystrom_trees import density, nystrom_trees, order_of
from integrators.method import exact
from integrators.steps.estimates import evaluations_tried, order_of_estimate
from pendulum_env import rollout
from pendulum_env.physics.exact import pendulum

TABLES = {name: method for name, method in METHODS.items() if isinstance(method, Nystrom)}
FREE = [name for name, method in TABLES.items() if method.velocity_free]
HALF = Fraction(1, 2)
VERLET = Nystrom(
    name="verlet_as_table", order=2, source="Verlet 1967, Phys. Rev. 159, 98", summary="kick, drift, kick",
    velocity_free=True, c=exact(0, 1), a=(exact(0, 0), exact("1/2", 0)), bbar=exact("1/2", 0), b=exact("1/2", "1/2"),
    av=(exact(0, 0), exact("1/2", "1/2")),
)


# --- trees --------------------------------------------------------------------------------------------------------


def euler_transform(counts: list[int]) -> list[int]:
    """Return the number of multisets of each total size, from the number of elements of each size."""
    found = [1]
    sums = [sum(d * counts[d] for d in range(1, n + 1) if n % d == 0) for n in range(len(counts))]
    for n in range(1, len(counts)):
        found.append(sum(sums[k] * found[n - k] for k in range(1, n + 1)) // n)
    return found


@pytest.mark.parametrize("special", [True, False])
def test_there_are_as_many_trees_as_their_generating_function_says(special: bool) -> None:
    """A = x exp(sum B(x^k)/k): a force depends on any number of positions, x + x A, and velocities, A."""
    highest = 12 if special else 7
    counts = [0]
    for n in range(1, highest + 1):
        below = [0] * n
        for k in range(1, n):
            below[k] = (k == 1) + counts[k - 1] + (0 if special else counts[k])
        counts.append(euler_transform(below)[n - 1])
    for n in range(1, highest + 1):
        trees = nystrom_trees(n, special)
        assert len(trees) == len(set(trees)) == counts[n]
        assert all(order_of(tree) == n for tree in trees)


def as_nystrom(method: RungeKutta, **changes: Any) -> Nystrom:
    """Return a Runge-Kutta method as a Nyström table for (q, v): a = A A, av = A, bbar = b A."""
    def through(row: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
        lines = zip(*method.a, strict=True)
        return tuple(sum((x * y for x, y in zip(row, line, strict=True)), Fraction(0)) for line in lines)

    return Nystrom(
        name="twin", order=method.order, source=method.source, summary=method.summary, c=method.c,
        a=tuple(map(through, method.a)), av=method.a, b=method.b, bbar=through(method.b), **changes,
    )


@pytest.mark.parametrize("name", ["heun", "kutta3", "rk4", "dopri5", "verner6"])
def test_conditions_hold_for_runge_kutta_methods_as_they_must(name: str) -> None:
    """Up to their order by rooted trees and no further; special trees are a subset of all trees."""
    method = METHODS[name]
    assert isinstance(method, RungeKutta)
    for twin in (as_nystrom(method), as_nystrom(method, velocity_free=True)):
        conditions = nystrom_conditions(twin, method.order + 1)
        assert max(abs(c.defect) for c in conditions if c.order <= method.order) < Fraction(1, 10**35)
        assert max(abs(c.defect) for c in conditions if c.order > method.order) > 1e-8
    found = [c.defect for c in nystrom_conditions(as_nystrom(method), method.order + 1) if c.of == "v"]
    assert max(map(abs, found)) <= max(abs(c.defect) for c in order_conditions(method, method.order + 1))


def test_tall_and_bushy_trees() -> None:
    leaf = ("q", None)
    force: tuple[Any, ...] = ()
    bushy, tall, fast = (leaf, leaf, leaf), (("q", (("q", force),)),), (("v", (("v", force),)),)
    assert [(order_of(tree), density(tree)) for tree in (bushy, tall, fast)] == [(4, 4), (5, 120), (3, 6)]


def test_conditions_are_for_tables() -> None:
    with pytest.raises(MethodError, match=r"rk4: Nyström order conditions .* not for Runge-Kutta methods"):
        nystrom_conditions("rk4")
    with pytest.raises(MethodError, match="did you mean dprkn6"):
        nystrom_conditions("dprkn66")


@pytest.mark.parametrize("table", ["b", *(pytest.param(table, marks=pytest.mark.slow) for table in ("a", "av"))])
def test_one_wrong_digit_breaks_a_condition(table: str) -> None:
    """A digit is moved from one coefficient to another, so that sums stay right."""
    good, tiny = TABLES["dprkn12"], Fraction(1, 10**20)

    def moved(row: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
        return (*row[:8], row[8] + tiny, row[9] - tiny, *row[10:])

    rows = getattr(good, table)
    bad = replace(good, **{table: moved(rows) if table == "b" else (*rows[:13], moved(rows[13]), *rows[14:])})
    of = "sum" if table == "av" else "v"
    assert max(abs(c.defect) for c in nystrom_conditions(bad) if c.of == of) > 1e-25


# --- tables -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name, truth in NYSTROM.items() if truth.published])
def test_tables_have_the_published_digits(name: str) -> None:
    for (row, *places), digits in NYSTROM[name].published.items():
        value = getattr(TABLES[name], str(row))
        for place in places:
            value = value[int(place) - 1]
        mantissa, exponent = digits.split("e")
        unit = Fraction(10) ** (int(exponent) - len(mantissa.split(".")[1]))
        assert abs(value - Fraction(digits)) < Fraction(51, 100) * unit, (row, places)


# Evaluations of a plain step, and of a step with its estimate if the first force is known from the last step, or not.
COSTS = {
    "nystrom4": (3, 0, False, False),
    "rkn43": (3, 3, True, True),
    "dprkn6": (5, 5, True, True),
    "dprkn8": (8, 8, True, False),
    "fine4": (5, 5, False, False),
    "fine5": (6, 6, True, False),
    "dprkn12": (17, 17, False, False),
}


def test_first_same_as_last_is_used_where_a_table_has_it() -> None:
    found = {name: (m.evaluations, evaluations_tried(m) if m.embedded else 0, m.first_same_as_last, bool(m.memory))
             for name, m in TABLES.items()}
    assert found == COSTS


def test_verlet_is_one_of_them() -> None:
    """Its Nyström table is symplectic and symmetric with one force per step, and has the splitting's steps."""
    assert (VERLET.symplectic, VERLET.symmetric, bool(VERLET.memory), VERLET.evaluations) == (True, True, True, 1)
    pull = System(lambda t, q, v: t - q * q * q, velocity_free=True)
    table, splitting = (solve(pull, 1.0, 0.5, [0.0, 1.0, 2.0], method=m, h=0.1) for m in (VERLET, "velocity_verlet"))
    assert table.evaluations == splitting.evaluations == 20 + 1
    assert table.q == pytest.approx(splitting.q, abs=1e-14)
    assert table.v == pytest.approx(splitting.v, abs=1e-14)
    assert max(abs(c.defect) for c in nystrom_conditions(VERLET, 2)) == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"a": (exact(0, 0),)}, "a must be 2 rows of 2 numbers, like b"),
        ({"av": (exact(0), exact(0))}, "av must be 2 rows of 2 numbers, like b"),
        ({"c": exact(0)}, "c must be 2 numbers, like b"),
        ({"bbar": exact("1/2")}, "bbar must be 2 numbers, like b"),
        ({"b": exact("1/2", 1)}, "the weights b sum to 3/2, not to 1"),
        ({"bbar": exact("1/2", 1)}, "the weights bbar sum to 3/2, not to 1/2"),
        ({"a": (exact(0, 1), exact(0, 0))}, "a stage may depend only on earlier ones, so a must be zero on and above"),
        ({"velocity_free": False}, "a stage may depend only on earlier ones, so av must be zero on and above"),
        ({"embedded": (EmbeddedNystrom(1, exact(1), None),)}, "embedded bbar must be 2 numbers, like b"),
        ({"embedded": (EmbeddedNystrom(1, exact("1/2", 0), exact(1, 1)),)}, "embedded b sum to 2, not to 1"),
    ],
)
def test_malformed_tables_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=f"verlet_as_table: .*{message}"):
        replace(VERLET, **changes)


# --- quadratures --------------------------------------------------------------------------------------------------


@cache
def quadrature_errors(name: str, steps: int, digits: int = 60) -> tuple[Any, Any, Any]:
    """Return errors of the integrals of v F, v sin q and 3 v² q'' for q'' = F(t) - sin q, F = 1.5 cos 2t.

    Truth: the integrals are the gains of v²/2 - cos q, -cos q and v³, with the motion by Taylor series in 60 digits.
    """
    method = TABLES[name]
    with mpmath.workdps(digits):
        def force(t: Any, q: Any) -> Any:
            return mpmath.mpf(1.5) * mpmath.cos(2 * t) - mpmath.sin(q)

        def rates(t: Any, q: Any, v: Any) -> tuple[Any, ...]:
            a = force(t, q)
            return a, v * (a + mpmath.sin(q)), v * mpmath.sin(q), 3 * v * v * a

        space: dict[str, Any] = {"mpf": mpmath.mpf, "force": force, "rates": rates}
        exec(unroll(method, quadratures=("work", "fall", "cube"),
                    number=lambda x: f"(mpf({x.numerator})/{x.denominator})"), space)
        t, q, v = (mpmath.mpf(x) for x in (0.25, 0.5, 1.0))
        h, start, sums = mpmath.mpf(0.75) / steps, (q, v), [mpmath.mpf(0)] * 3
        carried = [force(t, q)] if method.memory else []
        for i in range(steps):
            q, v, *more = space["step"](t + i * h, q, v, *carried, h)
            carried, found = more[: len(carried)], more[len(carried) :]
            sums = [x + y for x, y in zip(sums, found, strict=True)]
        q1, v1 = reference(None, digits)
        fall = mpmath.cos(start[0]) - mpmath.cos(q1)
        truth = (v1 * v1 / 2 - start[1] ** 2 / 2 + fall, fall, v1**3 - start[1] ** 3)
        return tuple(abs(x - y) for x, y in zip(sums, truth, strict=True))  # type: ignore[return-value]


# In fine4's integral of v F, an error of order 5 exceeds the leading error unless steps are very short.
STEPS = {"fine4": (256, 384), "dprkn6": (96, 144)}


@pytest.mark.parametrize("name", TABLES)
def test_work_rides_along_at_the_methods_order(name: str) -> None:
    """Quadratures with rates linear in v have the method's order; for most methods also the quadratic third one."""
    coarse, fine = STEPS.get(name, (24, 36))
    errors = [quadrature_errors(name, steps) for steps in (coarse, fine)]
    slopes = [float(mpmath.log(x / y)) / math.log(fine / coarse) for x, y in zip(*errors, strict=True)]
    assert min(slopes[:2]) > TABLES[name].order - 0.25
    assert slopes[2] > TABLES[name].order - (0.6 if name == "dprkn8" else 0.25)


@pytest.mark.parametrize("name", FREE)
def test_rates_cost_no_forces(name: str) -> None:
    source = unroll(TABLES[name], quadratures=("work",)).partition("def step")[2]
    assert source.count("force(") == TABLES[name].evaluations
    assert source.count("rates(") == sum(map(bool, TABLES[name].b))


# --- pairs --------------------------------------------------------------------------------------------------------


def test_a_pair_may_compare_the_angle_alone() -> None:
    """The estimate is then the angle's error over sqrt(2), with no error of the velocity."""
    pair = TABLES["rkn43"]
    alone = replace(pair, name="angle_alone", aliases=(), embedded=(EmbeddedNystrom(3, pair.embedded[0].bbar, None),))
    assert order_of_estimate(alone) == 4
    space: dict[str, Any] = {"force": lambda t, q: -math.sin(q)}
    other = dict(space)
    exec(unroll(alone, estimates=True), space)
    exec(unroll(pair, estimates=True), other)
    arguments = (0.0, 2.5, 0.3, -math.sin(2.5), 0.2)
    assert space["step"](*arguments) == (*other["step"](*arguments)[:-1], 0.0)
    errors = []
    for rtol in (1e-6, 1e-8):
        found = solve(lambda t, q, v: -math.sin(q), 2.5, 0.3, [0.0, 10.0], method=alone, rtol=rtol)
        errors.append(abs(found.q[-1] - pendulum(10.0, 2.5, 0.3, 1.0)[0]))
    assert math.log10(errors[0] / errors[1]) / 2 == pytest.approx(1.0, abs=0.3)


# --- where they do not fit ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FREE)
def test_drag_is_refused(name: str) -> None:
    with pytest.raises(MethodError, match=f"{name} needs forces free of the velocity, which this problem does not"):
        solve(lambda t, q, v: -q - v / 10, 1.0, 0.5, [0.0, 1.0], method=name, h=0.1)
    with pytest.raises(MethodError, match=f"{name} needs forces free of the velocity, which the scene 'lab' does not"):
        rollout("lab", integrator=name)


def test_a_step_of_a_free_particle_is_exact() -> None:
    for method in TABLES.values():
        step = single_step(method, System(lambda t, q, v: 0.0 * q, velocity_free=True))
        assert step(0.0, 1.0, 0.5, 0.25)[:2] == (1.125, 0.5)


# --- in scenes ----------------------------------------------------------------------------------------------------


SCENE: dict[str, Any] = {"scene": "lab", "damping": "none", "angle": 1.0, "velocity": 0.3, "control": 0.5}


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_a_motor_without_drag_has_the_same_bits_compiled(name: str) -> None:
    asked = {**SCENE, "integrator": name, "dt": 0.05, "duration": 2.0}
    one, other = (rollout(**asked, backend=backend) for backend in ("python", "compiled"))
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(other, quantity).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_a_motor_without_drag_has_the_same_bits_in_batches(name: str) -> None:
    asked = {**SCENE, "integrator": name, "dt": 0.05, "duration": 2.0}
    one = rollout(**asked, backend="python")
    many = rollout(**{**asked, "angle": np.array([1.0, 0.5]), "backend": "compiled"})
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(many, quantity)[0].tolist()


@pytest.mark.parametrize("name", TABLES)
def test_the_residual_of_the_ledger_shrinks_at_the_order(name: str) -> None:
    steps = {"dprkn8": (0.2, 0.1), "dprkn12": (0.25, 0.125)}.get(name, (0.04, 0.03))
    residuals = []
    for h in steps:
        run = rollout(**SCENE, integrator=name, dt=h, duration=6.0, backend="python")
        residuals.append(np.max(np.abs(run.energy_residual)))
        assert abs(run.ledger.work[-1]) > 1e-2
    assert math.log(residuals[0] / residuals[1]) / math.log(steps[0] / steps[1]) > TABLES[name].order - 0.15


def test_names_of_other_projects_lead_here() -> None:
    assert integrators.get("dprkn4").name == "rkn43"
