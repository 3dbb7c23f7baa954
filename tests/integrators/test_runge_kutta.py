"""Explicit Runge-Kutta tables and pairs: rooted trees, published numbers, error estimates."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import scipy.integrate

from integrators import METHODS, Method, MethodError, RungeKutta, unroll
from integrators.analysis import driven_pendulum, observed_order, order_conditions, principal_error, single_step
from integrators.analysis.trees import density, rooted_trees, symmetry, vertices_of
from integrators.method import exact
from integrators.tables.butcher import row, triangle

PAIRS = {name: method for name, method in METHODS.items() if isinstance(method, RungeKutta) and method.embedded}


def test_as_many_trees_as_there_are() -> None:
    """The numbers of trees are those of Butcher 2016, table 301(II), without repetition."""
    for order, count in enumerate((0, 1, 1, 2, 4, 9, 20, 48, 115, 286, 719)):
        trees = rooted_trees(order)
        assert len(trees) == len(set(trees)) == count
        assert all(vertices_of(tree) == order for tree in trees)


@pytest.mark.parametrize("order", range(1, 10))
def test_trees_are_counted_by_their_symmetries_and_densities(order: int) -> None:
    """Cayley: n^(n-1) ways to label all of them; (n-1)! ways with labels that increase outwards (Butcher 2016, 304)."""
    whole = math.factorial(order)
    assert sum(Fraction(whole, symmetry(tree)) for tree in rooted_trees(order)) == order ** (order - 1)
    increasing = sum(Fraction(whole, symmetry(tree) * density(tree)) for tree in rooted_trees(order))
    assert increasing == math.factorial(order - 1)


def test_tall_and_bushy_trees() -> None:
    tall = ((((),),),)
    bushy = ((), (), ())
    assert (vertices_of(tall), density(tall), symmetry(tall)) == (4, 24, 1)
    assert (vertices_of(bushy), density(bushy), symmetry(bushy)) == (4, 4, 6)


# Ralston 1962: 1/6, the least possible for two stages. Dormand & Prince 1980: RK5(4)7M. Verner's values are part of his
# file names: 65.IIIXb.Efficient.00000144617, 76.IIa.Efficient.00001675585, 98.IIa.Efficient.000000349; the name of the
# pair 8(7), 87.IIa.Efficient.000000282866, omits a seven of 2.82[7]866.
PUBLISHED_ERRORS = {
    "ralston": "0.16667",
    "dopri5": "0.000399",
    "verner6": "0.00000144617",
    "verner7": "0.00001675585",
    "verner8": "0.0000002827866",
    "verner9": "0.000000349",
}


@pytest.mark.parametrize("name", PUBLISHED_ERRORS)
def test_leading_errors_have_the_published_size(name: str) -> None:
    written = PUBLISHED_ERRORS[name]
    assert abs(principal_error(name) - float(written)) < 0.51 * 10.0 ** -len(written.split(".")[1])


def test_one_wrong_digit_breaks_a_condition() -> None:
    good = METHODS["verner9"]
    assert isinstance(good, RungeKutta)
    last = list(good.a[14])
    last[13] += Fraction(1, 10**20)
    last[12] -= Fraction(1, 10**20)
    bad = replace(good, a=(*good.a[:14], tuple(last), good.a[15]))
    assert max(abs(c.defect) for c in order_conditions(bad)) > 1e-23


def test_conditions_are_for_tables() -> None:
    for measure in (order_conditions, principal_error):
        with pytest.raises(MethodError, match="velocity_verlet: only Runge-Kutta tables have rooted trees, splitting"):
            measure("velocity_verlet")
        with pytest.raises(MethodError, match="did you mean dopri5"):
            measure("dopri55")


# Verner's fractions for coefficients that do not follow from the others of their row.
FRACTIONS = {
    ("verner6", 6, 5): "755005057777788994734129/136485922925633667082436",
    ("verner6", 9, 8): "163193540017/946795234",
    ("verner7", 10, 3): "2822037469238841750/15064746656776439",
    ("verner7", 6, 3): "27569888999279458303270493567994248533230000/2551701010245296220859455115479340650299761",
    ("verner8", 12, 11): "-6122933601070769591613093993993358877250/1050517001510235513198246721302027675953",
    ("verner8", 13, 10): "53381024589235611084013897674181629296875/8959357584795694524874969598508592944141",
    ("verner9", 14, 13): (
        "4746930876023919335079451612726717649218264199984/18592065538407049755200144388134089346432755594877"
    ),
    ("verner9", 16, 11): (
        "-292603171929706291053929402159930330736639136252680853622275/"
        "15473622826279161150227076887290262443510550964275858143964"
    ),
}


@pytest.mark.parametrize(("name", "i", "j"), FRACTIONS)
def test_forty_decimals_of_the_published_fractions(name: str, i: int, j: int) -> None:
    assert abs(PAIRS[name].a[i - 1][j - 1] - Fraction(FRACTIONS[name, i, j])) <= Fraction(1, 2 * 10**40)


@pytest.mark.parametrize(("name", "theirs"), [("bs3", "RK23"), ("dopri5", "RK45"), ("dop853", "DOP853")])
def test_tables_are_those_of_scipy(name: str, theirs: str) -> None:
    """Tables equal SciPy's in double precision; SciPy's error weights are differences to b."""
    method, other = PAIRS[name], getattr(scipy.integrate, theirs)
    count = len(other.B)
    ours = np.array(method.a, dtype=float)[:count, : other.A.shape[1]]
    assert ours == pytest.approx(np.array(other.A), rel=1e-15, abs=1e-17)
    assert [float(x) for x in method.b[:count]] == pytest.approx(list(other.B), rel=1e-15)
    errors = [other.E5, other.E3] if theirs == "DOP853" else [other.E]
    for pair, error in zip(method.embedded, errors, strict=True):
        mine = [float(x - y) for x, y in zip(method.b, pair.b, strict=True)]
        mine += [0.0] * (len(error) - len(mine))
        assert np.abs(mine) == pytest.approx(np.abs(error), rel=1e-12, abs=1e-16)


# Evaluations of a plain step, and of a step with its estimate if the first slope is known from the last step, or not.
COSTS = {
    "bs3": (3, 4, True),
    "dopri5": (6, 7, True),
    "tsit5": (6, 7, True),
    "dop853": (12, 12, False),
    "verner6": (8, 9, True),
    "verner7": (9, 10, False),
    "verner8": (12, 13, False),
    "verner9": (15, 16, False),
}


def test_stages_that_serve_the_estimate_alone_are_not_taken() -> None:
    found = {name: (m.evaluations, len(m.b), m.first_same_as_last) for name, m in PAIRS.items() if not m.implicit}
    assert found == COSTS
    for name, (needed, stages, _) in COSTS.items():
        source = unroll(PAIRS[name], quadratures=("work",))
        assert source.count("rates(") == needed
        assert (f"a{stages}," in source) == (needed == stages)


@pytest.mark.parametrize("name", [name for name, m in METHODS.items() if isinstance(m, RungeKutta) and not m.embedded])
def test_methods_without_estimates_take_all_their_stages(name: str) -> None:
    method = METHODS[name]
    assert isinstance(method, RungeKutta)
    assert method.stages == tuple(range(len(method.b)))
    assert method.first_same_as_last == (name == "trapezoid")


def test_quadratures_have_the_order_of_the_pair() -> None:
    """On q'' = 0 the integral of t^7 is exact for order 8, and that of t^8 is not."""
    space: dict[str, object] = {"rates": lambda t, q, v: (0.0, t**7, t**8)}
    exec(unroll(PAIRS["dop853"], quadratures=("seventh", "eighth")), space)
    _, _, seventh, eighth = space["step"](0.0, 0.0, 1.0, 1.0)  # type: ignore[operator]
    assert seventh == pytest.approx(1 / 8, abs=1e-15)
    assert abs(eighth - 1 / 9) > 1e-7


def estimate(method: RungeKutta, low: Method, h: mpmath.mpf, damped: str | None) -> mpmath.mpf:
    """Return the distance between the results of one step by the method and by one of its embedded formulas."""
    system, zero = driven_pendulum(damped), mpmath.mpf(0)
    t, q, v = mpmath.mpf("0.25"), mpmath.mpf("0.5"), mpmath.mpf(1)
    (q1, v1), (q2, v2) = (single_step(m, system, zero)(t, q, v, h) for m in (method, low))
    return mpmath.hypot(q1 - q2, v1 - v2)


@pytest.mark.parametrize("damped", [None, "linear", "quadratic"])
@pytest.mark.parametrize("name", PAIRS)
def test_estimates_have_their_order(name: str, damped: str | None) -> None:
    """The estimate is O(h^(p+1)) for weights of order p; Hairer's for dop853, E5²/(E3/10), is O(h^8)."""
    method = PAIRS[name]
    with mpmath.workdps(80):
        steps = [mpmath.mpf(2) ** -k for k in (12, 13)]
        found = {low.order: [estimate(method, low, h, damped) for h in steps] for low in method.formulas[1:]}
        for order, (coarse, fine) in found.items():
            assert float(mpmath.log(coarse / fine, 2)) == pytest.approx(order + 1, abs=0.02)
        if name == "dop853":
            coarse, fine = (x**2 / mpmath.hypot(x, y / 10) for x, y in zip(found[5], found[3], strict=True))
            assert float(mpmath.log(coarse / fine, 2)) == pytest.approx(8, abs=0.02)


@pytest.mark.parametrize("name", ["bs3", "dopri5"])
def test_the_lower_result_is_a_method_of_its_own(name: str) -> None:
    method = PAIRS[name]
    (pair,) = method.embedded
    alone = replace(method, b=pair.b, order=pair.order, embedded=(), dense=None)
    assert alone.evaluations == len(method.b)
    assert observed_order(alone, damped="linear") == pytest.approx(pair.order, abs=0.1)


def test_rows_and_triangles() -> None:
    assert row("3/4", 0, "1/2") == exact("1/4", 0, "1/2")
    assert triangle(row("1/2"), row(1, 2)) == (exact(0, 0, 0), exact("1/2", 0, 0), exact(-1, 2, 0))
