"""The analysis functions, against closed forms, published values and mpmath."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from nystrom_truths import NYSTROM
from runge_kutta_truths import LIMITS as RUNGE_KUTTA_LIMITS
from runge_kutta_truths import rounding
from taylor_truths import LIMITS as SERIES_LIMITS

from integrators import METHODS, MethodError, Multistep
from integrators.analysis import (
    Term,
    amplification,
    area_order,
    damping_limit,
    driven_pendulum,
    jacobian_determinant,
    leading_error,
    observed_order,
    reference,
    spectral_radius,
    stability_limit,
)
from integrators.analysis.linear import step_matrix
from integrators.analysis.series import PowerSeries, cosine, horner, sine
from integrators.method import exact

DAMPED = [name for name, method in METHODS.items() if "velocity_free" not in method.needs]

# mpmath.odefun at 45 digits, over the run of the test pendulum: angle and velocity.
ODEFUN = {
    None: (
        "1.27356329065019829282639545880050704748346203451",
        "0.749350004456557102441832099217448126868754067367",
    ),
    "linear": (
        "1.20449244916646420758070607590344101654716170138",
        "0.581563133238611751023075891427619765192674123285",
    ),
    "quadratic": (
        "1.17450979083175931779289560437345617261069033208",
        "0.528052592298870969558424866142127492449523359381",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("damped", [
    pytest.param(one, marks=() if one == "quadratic" else pytest.mark.slow) for one in ODEFUN])
def test_reference_agrees_with_odefun(damped):
    with mpmath.workdps(45):
        for found, expected in zip(reference(damped), ODEFUN[damped], strict=True):
            assert abs(found - mpmath.mpf(expected)) < 1e-41


@pytest.mark.parametrize("damped", ODEFUN)
def test_the_test_problems_parts_belong_together(damped):
    """Force plus the rate of the drag flow is the acceleration, and the Jacobian holds its derivatives."""
    with mpmath.workdps(40):
        system = driven_pendulum(damped)
        t, q, v, d = (mpmath.mpf(x) for x in ("0.7", "0.9", "0.6", "1e-13"))
        drag = system.acceleration(t, q, v) - system.force(t, q)
        if damped is None:
            assert drag == 0
            assert system.velocity_free
        else:
            flow = system.dissipative_flow
            assert abs((flow(t, q, v, d) - flow(t, q, v, -d)) / (2 * d) - drag) < 1e-24
            assert abs(flow(t, q, flow(t, q, v, d), 1 - d) - flow(t, q, v, 1)) < 1e-38
        by_q, by_v = system.jacobian(t, q, v)
        a = system.acceleration
        assert abs((a(t, q + d, v) - a(t, q - d, v)) / (2 * d) - by_q) < 1e-24
        assert abs((a(t, q, v + d) - a(t, q, v - d)) / (2 * d) - by_v) < 1e-24


@pytest.mark.slow
def test_a_scheme_that_linear_problems_flatter_is_found_out():
    """The coefficients 1/4, 1/3, 1/2, 1 have order 4 on undriven linear problems, but order 2 on the pendulum."""
    low_storage = replace(
        METHODS["rk4"],
        a=(exact(0, 0, 0, 0), exact("1/4", 0, 0, 0), exact(0, "1/3", 0, 0), exact(0, 0, "1/2", 0)),
        b=exact(0, 0, 0, 1),
        dense=None,
    )
    assert leading_error(low_storage).angle == leading_error("rk4").angle
    assert observed_order(low_storage) == pytest.approx(2, abs=0.05)


def test_orders_that_round_off_hides_are_not_made_up():
    with pytest.raises(MethodError, match="8 digits leave only 0 errors above round-off; increase digits"):
        observed_order("rk4", digits=8)


def test_bad_names_are_refused():
    for measure in (driven_pendulum, lambda damped: observed_order("rk4", damped=damped), reference):
        with pytest.raises(MethodError, match="no damping 'air'; choose from None, 'linear', 'quadratic'"):
            measure("air")
    for measure in (observed_order, leading_error, stability_limit, damping_limit, area_order):
        with pytest.raises(MethodError, match="no integrator 'rk5'; did you mean rk4"):
            measure("rk5")
    with pytest.raises(MethodError, match="did you mean rk4"):
        amplification("rk5", 0.1)


def test_names_and_methods_are_taken_alike():
    assert leading_error("leapfrog") == leading_error(METHODS["velocity_verlet"])
    assert observed_order("euler") == observed_order(METHODS["forward_euler"])


TEXTS = {
    "forward_euler": "error of the angle in a step: -h^2 theta''/2; "
                     "amplitude after a time t: times exp(+omega0^2 h t/2); frequency: -(omega0 h)^2/3 of its value",
    "velocity_verlet": "error of the angle in a step: -h^3 theta'''/6; amplitude exact; "
                       "frequency: +(omega0 h)^2/24 of its value",
    "rk4": "error of the angle in a step: -h^5 theta^(5)/120; "
           "amplitude after a time t: times exp(-omega0^6 h^5 t/144); frequency: -(omega0 h)^4/120 of its value",
}


@pytest.mark.parametrize("name", TEXTS)
def test_leading_errors_in_words(name):
    assert leading_error(name).text == TEXTS[name]


def test_leading_errors_of_other_shapes_in_words():
    made_up = replace(leading_error("rk4"), angle=Term(Fraction(-3, 4), 2), amplitude=None)
    made_up = replace(made_up, frequency=Term(Fraction(2), 1))
    assert made_up.text == (
        "error of the angle in a step: -3 h^2 theta''/4; amplitude exact; frequency: +2 (omega0 h) of its value")
    long = replace(made_up, angle=Term(Fraction(1234567, 10**9), 7), frequency=None)
    assert long.text == "error of the angle in a step: +0.001235 h^7 theta^(7); amplitude exact; frequency exact"
    assert replace(long, angle=None).text.startswith("error of the angle in a step: 0; ")
    assert long.latex.startswith(r"\delta\theta = +0.001235\,h^{7}\theta^{(7)},")
    assert replace(long, angle=None).latex == r"\delta\theta = 0,\quad \delta A = 0,\quad \delta\omega = 0"


def test_leading_errors_in_latex():
    assert leading_error("forward_euler").latex == (
        r"\delta\theta = -\frac{1}{2}\,h^{2}\theta'',\quad "
        r"A \propto \exp\left(+\frac{1}{2}\,\omega_0^{2}h\,t\right),\quad "
        r"\delta\omega/\omega_0 = -\frac{1}{3}\,(\omega_0 h)^{2}"
    )


@pytest.mark.parametrize("name", METHODS)
def test_matplotlib_reads_the_latex(name):
    from matplotlib.mathtext import MathTextParser

    assert MathTextParser("path").parse(f"${leading_error(name).latex}$").width > 0


def test_amplification_matrices():
    """Closed forms: the update rules written as matrices on (theta, velocity/omega0)."""
    z, g = 0.7, 0.3
    e, f = math.exp(-g), math.exp(-g / 2)
    c = 1 - z * z / 2
    expected = {
        "forward_euler": [[1, z], [-z, 1 - g]],
        "backward_euler": np.linalg.inv([[1, -z], [z, 1 + g]]),
        "symplectic_euler": [[1 - z * z, z * (1 - g)], [-z, 1 - g]],
        "symplectic_euler_position_first": [[1, z], [-z * e, (1 - z * z) * e]],
        "conformal_symplectic_euler": [[1 - z * z, z * e], [-z, e]],
        "velocity_verlet": [[c, z * f], [-z * (1 - z * z / 4) * f, c * e]],
        "implicit_midpoint": np.linalg.solve(
            [[1, -z / 2], [z / 2, 1 + g / 2]], [[1, z / 2], [-z / 2, 1 - g / 2]]
        ),
    }
    for name, matrix in expected.items():
        assert amplification(name, z, g) == pytest.approx(np.array(matrix), abs=4e-16), name
    generator = np.array([[0, z], [-z, -g]])
    for name, order in (("midpoint", 2), ("heun", 2), ("rk4", 4)):
        power = [np.linalg.matrix_power(generator, k) / math.factorial(k) for k in range(order + 1)]
        assert amplification(name, z, g) == pytest.approx(sum(power), abs=4e-16), name


@pytest.mark.parametrize("name", [name for name, method in METHODS.items() if not isinstance(method, Multistep)])
def test_matrices_by_series_and_by_steps_agree(name):
    *entries, scale = step_matrix(METHODS[name])
    for z in (0.1, 1.0, 1.9):
        below = horner([float(x) for x in scale.c], z)
        exactly = [horner([float(x) for x in entry.c], z) / below for entry in entries]
        flows = len(getattr(METHODS[name], "flows", ()))
        summed = 5e-17 * flows * max(horner([abs(float(x)) for x in entry.c], z) for entry in entries) / below
        assert amplification(name, z).ravel() == pytest.approx(exactly, abs=1e-14 + rounding(METHODS[name], z) + summed)


@pytest.mark.parametrize("name", DAMPED)
def test_without_a_spring_drag_alone_acts(name):
    matrix = amplification(name, 0.0, 0.5)
    assert matrix[0, 0] == 1.0
    assert matrix[0, 1] == 0.0 or isinstance(METHODS[name], Multistep), "there velocities are in units of the step"
    assert matrix[1, 0] == 0.0
    if "split" in METHODS[name].needs:
        assert matrix[1, 1] == pytest.approx(math.exp(-0.5), abs=2e-16 + 1e-17 * len(METHODS[name].flows))


@pytest.mark.parametrize(("z", "g"), [(0.5, 0.1), (0.5, 3.0), (1.0, 0.0), (3.0, 0.0)])
@pytest.mark.parametrize("name", DAMPED)
def test_spectral_radius_is_the_largest_eigenvalue(name, z, g):
    eigenvalues = np.linalg.eigvals(amplification(name, z, g))
    assert spectral_radius(name, z, g) == pytest.approx(np.max(np.abs(eigenvalues)), rel=1e-12)


# Hairer & Wanner 1996, IV.2 (explicit Runge-Kutta); Hairer, Lubich & Wanner 2006, I.5 (splittings). rk4's limit
# on the negative axis is the real root of 1 + x/2 + x**2/6 + x**3/24.
LIMITS = {
    "forward_euler": (0.0, 2.0),
    "midpoint": (0.0, 2.0),
    "heun": (0.0, 2.0),
    "rk4": (2 * math.sqrt(2), 2.785293563405282),
    "symplectic_euler": (2.0, 2.0),
    "symplectic_euler_position_first": (2.0, math.inf),
    "conformal_symplectic_euler": (2.0, math.inf),
    "velocity_verlet": (2.0, math.inf),
    "backward_euler": (math.inf, math.inf),
    "implicit_midpoint": (math.inf, math.inf),
    "exact": (math.inf, math.inf),
    "taylor": SERIES_LIMITS,
    **RUNGE_KUTTA_LIMITS,
    **{name: (truth.limit, truth.damping) for name, truth in NYSTROM.items()},
}


@pytest.mark.parametrize("name", LIMITS)
def test_stability_limits(name):
    oscillation, drag = LIMITS[name]
    assert stability_limit(name) == pytest.approx(oscillation, rel=2e-16, abs=4e-16)
    if drag is None:
        with pytest.raises(MethodError, match=f"{name} needs forces free of the velocity; it has no damping limit"):
            damping_limit(name)
    else:
        assert damping_limit(name) == pytest.approx(drag, rel=2e-16, abs=4e-16)


@pytest.mark.parametrize(("short", "limit"), [(Fraction(1, 10**30), math.inf), (Fraction(1, 10**9), 0.0)])
def test_tables_rounded_to_many_digits_are_not_taken_for_unstable(short, limit):
    """With a < 1/2 in the implicit midpoint rule every step grows, but negligibly if a is only rounded."""
    method = replace(METHODS["implicit_midpoint"], a=((Fraction(1, 2) - short,),))
    assert stability_limit(method) == limit


def test_area_changes_have_closed_forms():
    """Forward Euler: 1 + h**2 cos q - gamma h; symplectic Euler with drag in its kick: 1 - gamma h."""
    q, v, t, h = "1.1", "0.5", "0.3", "0.2"
    with mpmath.workdps(40):
        step, gamma = mpmath.mpf(h), mpmath.mpf("0.25")
        area = 1 + step**2 * mpmath.cos(mpmath.mpf(q))
        assert abs(jacobian_determinant("forward_euler", q, v, t, h) - area) < 1e-38
        damped = jacobian_determinant("forward_euler", q, v, t, h, damped="linear")
        assert abs(damped - (area - gamma * step)) < 1e-38
        kicked = jacobian_determinant("symplectic_euler", q, v, t, h, damped="linear")
        assert abs(kicked - (1 - gamma * step)) < 1e-38
        for name in ("conformal_symplectic_euler", "velocity_verlet"):
            shrunk = jacobian_determinant(name, q, v, t, h, damped="linear")
            assert abs(shrunk - mpmath.exp(-gamma * step)) < 1e-38


@pytest.mark.parametrize(("name", "power"), [("forward_euler", 2), ("midpoint", 3), ("heun", 4), ("rk4", 6)])
def test_powers_of_area_changes(name, power):
    """Never below order + 1; order 2 with b2 c2**2 = s changes areas by ``(s - 1/2) v sin(q) h**3``.

    This is the divergence of the modified equation (Hairer, Lubich & Wanner 2006, IX.1): -1/4 for midpoint, none
    for Heun.
    """
    assert area_order(name) == pytest.approx(power, abs=0.02)
    if METHODS[name].order == 2:
        share = {"midpoint": -0.25, "heun": 0.0}[name]
        change = (jacobian_determinant(name, 1.1, 0.5, 0.3, 1e-9) - 1) / mpmath.mpf(1e-9) ** 3
        assert float(change) == pytest.approx(share * 0.5 * math.sin(1.1), abs=1e-8)


def test_series_arithmetic():
    terms = 12
    z, one = PowerSeries.variable(terms), PowerSeries.of(1, terms)
    assert (one / (1 - z)).c == (1,) * terms
    root = (1 + z).sqrt()
    assert (root * root - (1 + z)).leading() is None
    assert root.c[:4] == (1, Fraction(1, 2), Fraction(-1, 8), Fraction(1, 16))
    assert sine(terms) * sine(terms) + cosine(terms) * cosine(terms) == one
    assert sine(terms).derivative().head(terms - 1) == cosine(terms - 1)
    assert cosine(terms).integral() == sine(terms)
    assert (2 * z * z * 3).over_z(2).c == (6, *[0] * (terms - 3))
    assert (z - z + Fraction(1, 3)).leading() == (Fraction(1, 3), 0)
    assert horner([1, 2, 3], 2) == 17
    with pytest.raises(ValueError, match=r"has terms below z\*\*1"):
        one.over_z()
    with pytest.raises(ValueError, match="needs the constant term 1, not 0"):
        z.sqrt()
    with pytest.raises(ZeroDivisionError):
        one / z


@pytest.mark.slow
def test_mpmath_is_asked_for_only_when_needed(monkeypatch):
    program = "import sys, integrators.analysis as a; a.leading_error('rk4'); print('mpmath' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
    monkeypatch.setitem(sys.modules, "mpmath", None)
    with pytest.raises(ImportError, match="needs mpmath: pip install mpmath"):
        observed_order("rk4")
