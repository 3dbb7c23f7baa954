"""``solve`` with any method on any problem, against closed forms and the documentation of its arguments."""

from __future__ import annotations

import doctest
import math
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from runge_kutta_truths import rounding

import integrators
from integrators import MethodError, Multistep, System, solve
from integrators.families.splitting import DRIFT
from integrators.families.taylor import coefficients

METHODS = {name: method for name, method in integrators.METHODS.items() if "exact_flow" not in method.needs}
"""Methods that accept bare functions."""
ANY_FUNCTION = [name for name, method in METHODS.items() if "taylor" not in method.needs]
"""Methods that accept functions with any operations."""
IMPLICIT = [name for name, method in METHODS.items() if method.implicit]
STAGED = [name for name in IMPLICIT if not isinstance(METHODS[name], Multistep)]
EXPLICIT = [name for name, method in METHODS.items() if not method.implicit]


def oscillator(t, q, v):
    return -q


def test_the_documentation_runs():
    assert doctest.testmod(integrators).failed == 0


@pytest.mark.parametrize("name", METHODS)
def test_a_free_fall_is_what_galilei_says(name):
    """Constant acceleration is exact for order 2 and more, and wrong by half a step's speed gain for order 1."""
    found = solve(lambda t, q, v: -9.8, 1.0, 2.0, [0.0, 0.5], method=name, h=0.125)
    error = 1e-14 + (4 * 9.8 if isinstance(METHODS[name], Multistep) else 4) * rounding(METHODS[name], 0.125)
    assert found.v[-1] == pytest.approx(2.0 - 9.8 * 0.5, abs=error)
    off = 0.0 if METHODS[name].order > 1 else 9.8 * 0.125 / 2 * 0.5
    assert abs(found.q[-1] - (1.0 + 2.0 * 0.5 - 9.8 / 2 * 0.25)) == pytest.approx(off, abs=error)


def test_euler_multiplies_the_energy_of_the_oscillator():
    """Forward Euler by 1 + h**2 in each step, backward Euler by the inverse."""
    for name, factor in (("forward_euler", 1.01), ("backward_euler", 1 / 1.01)):
        found = solve(oscillator, 1.0, 0.0, np.arange(0, 21) * 0.1, method=name, h=0.1)
        energy = found.q**2 + found.v**2
        assert energy == pytest.approx(factor ** np.arange(21), rel=1e-14)


def test_rk4_follows_the_cosine():
    times = np.linspace(0.0, 10.0, 11)
    found = solve(oscillator, 1.0, 0.0, times, method="rk4", h=0.01)
    assert found.q == pytest.approx(np.cos(times), abs=10 / 120 * 1e-8 * 1.01)
    assert found.v == pytest.approx(-np.sin(times), abs=10 / 120 * 1e-8 * 1.01)
    assert found.steps == 1000
    assert found.method == "rk4"
    assert found.t.tolist() == times.tolist()


def test_rk4_is_the_default_and_aliases_are_reported_by_their_names():
    assert solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=0.1).method == "rk4"
    assert solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=0.1, method="leapfrog").method == "velocity_verlet"
    method = METHODS["heun"]
    assert solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=0.1, method=method).method == "heun"


@pytest.mark.parametrize(("h", "steps"), [(0.1, 10 + 5), (0.3, 4 + 2), (5.0, 2), (0.25, 4 + 2)])
def test_intervals_are_cut_into_equal_steps_no_longer_than_h(h, steps):
    seen = []

    def acceleration(t, q, v):
        seen.append(t)
        return -q

    found = solve(System(acceleration), 1.0, 0.0, [0.0, 1.0, 1.5], method="forward_euler", h=h)
    assert found.steps == steps == len(seen)
    assert max(np.diff([*seen, 1.5])) <= h * (1 + 1e-12)


def test_one_time_gives_the_start():
    found = solve(oscillator, 1, 2, [3.0], h=0.1)
    assert (found.t.tolist(), found.q.tolist(), found.v.tolist(), found.steps) == ([3.0], [1.0], [2.0], 0)


def test_whole_numbers_are_numbers():
    whole = solve(oscillator, 1, 0, [0, 1], h=1)
    assert whole.q.tolist() == solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=1.0).q.tolist()


@pytest.mark.parametrize("name", METHODS)
def test_stopping_on_the_way_changes_nothing(name):
    """Output times at multiples of a step that is exact in binary leave steps and bits unchanged."""
    through = solve(oscillator, 1.0, 0.5, [0.0, 2.0], method=name, h=0.125)
    stops = solve(oscillator, 1.0, 0.5, [0.0, 0.5, 1.25, 2.0], method=name, h=0.125)
    assert (stops.q[-1], stops.v[-1]) == (through.q[-1], through.v[-1])


@pytest.mark.quick("rk4", "velocity_verlet", "gauss4", "blanes_moan_srkn11b", "quinlan8a", "mclachlan_ss5")
@pytest.mark.parametrize("name", METHODS)
def test_coupled_components_swing_in_their_normal_modes(name):
    """Two equal oscillators with a spring of stiffness 3/2 between them: frequencies 1 and 2."""
    stiffness = np.array([[2.5, -1.5], [-1.5, 2.5]])
    start = np.array([1.0, 0.0])
    h = 0.02 if METHODS[name].implicit and METHODS[name].order > 3 else 0.002
    h = 0.001 if name in ("ab2", "bdf2") else h
    found = solve(lambda t, q, v: -stiffness @ q, start, np.zeros(2), [0.0, 1.0], method=name, h=h)
    modes = np.array([math.cos(1.0) + math.cos(2.0), math.cos(1.0) - math.cos(2.0)]) / 2
    assert found.q.shape == (2, 2)
    assert found.q[-1] == pytest.approx(modes, abs=4e-3 if METHODS[name].order == 1 else 4e-6)
    assert start.tolist() == [1.0, 0.0], "the caller's array stays as it was"


def linear_step(name, stiffness, gamma, q, v, h):
    """Return the velocity after one step on q'' = -K q - gamma v, where (1 + gamma h A + h² A² x K) k = r."""
    method, size = METHODS["implicit_midpoint" if name == "discrete_gradient" else name], len(q)
    with mpmath.workdps(40):
        a = mpmath.matrix([[mpmath.mpf(x.numerator) / x.denominator for x in row] for row in method.a])
        b = mpmath.matrix([[mpmath.mpf(x.numerator) / x.denominator for x in method.b]])
        square, stages, one = a * a, range(len(method.b)), mpmath.eye(size)
        K, q, v = mpmath.matrix(stiffness), mpmath.matrix(q), mpmath.matrix(v)
        whole, right = mpmath.matrix(size * len(stages)), mpmath.matrix(size * len(stages), 1)
        for i in stages:
            start = -K * (q + sum(a[i, j] for j in stages) * h * v) - gamma * v
            for m in range(size):
                right[size * i + m] = start[m]
            for j in stages:
                block = (gamma * h * a[i, j] + (i == j)) * one + h * h * square[i, j] * K
                for m in range(size):
                    for n in range(size):
                        whole[size * i + m, size * j + n] = block[m, n]
        k = mpmath.lu_solve(whole, right)
        return [float(v[m] + h * sum(b[j] * k[size * j + m] for j in stages)) for m in range(size)]


@pytest.mark.parametrize("name", STAGED)
def test_implicit_stages_are_solved_to_round_off(name):
    """Stages of one stiff implicit step on a linear problem equal the solution of the linear equations."""
    gamma, h = 5000.0, 0.01
    (wanted,) = linear_step(name, [[1.0]], gamma, [1.0], [2.0], h)
    for problem in (
        System(
            lambda t, q, v: -q - gamma * v, jacobian=lambda t, q, v: (-1.0, -gamma),
            mean_acceleration=lambda t, q, v, s: -q - gamma * v, mean_jacobian=lambda t, q, v, s: (-1.0, -gamma),
        ),
        lambda t, q, v: -q - gamma * v,
    ):
        found = solve(problem, 1.0, 2.0, [0.0, h], method=name, h=h)
        assert found.v[-1] == pytest.approx(wanted, abs=2.0 * gamma * h * 4e-16)


@pytest.mark.parametrize("name", STAGED)
def test_implicit_stages_are_solved_with_all_couplings(name):
    """Stages of one long step on q'' = -K q with one-sided coupling equal the solution of the linear equations."""
    stiffness = np.array([[1.0, 50.0], [0.0, 4.0]])
    q, v, h = np.array([1.0, 0.5]), np.array([0.0, -1.0]), 2.0
    wanted = linear_step(name, stiffness.tolist(), 0.0, q.tolist(), v.tolist(), h)
    found = solve(lambda t, q, v: -stiffness @ q, q, v, [0.0, h], method=name, h=h)
    assert found.v[-1] == pytest.approx(wanted, abs=1e-13)


@pytest.mark.quick("float")
@pytest.mark.parametrize("start", [(2.5, 0.0), (np.array([2.5, -1.0]), np.array([0.0, 3.0]))], ids=["float", "array"])
def test_the_discrete_gradient_keeps_the_energy_of_a_bare_polynomial_force(start):
    """In steps of half a second, in which other methods fail; the mean force comes from a quadrature."""

    def force(t, q, v):
        return q - q**3 - q**7 / 64

    found = solve(force, *start, np.arange(50) / 2, method="discrete_gradient", h=0.5)
    energy = found.v**2 / 2 + found.q**8 / 512 - found.q**2 / 2 + found.q**4 / 4
    assert np.max(np.abs(energy - energy[0])) < 2e-14 * np.max(energy[0])
    other = solve(force, *start, found.t, method="gauss4", h=0.5)
    assert np.max(np.abs(other.q - found.q)) > 0.1


def test_mpmath_numbers_keep_their_digits():
    with mpmath.workdps(40):
        one = mpmath.mpf(1)
        found = solve(oscillator, one, 0 * one, [0 * one, one], method="rk4", h=one / 10)
        c, s = mpmath.mpf(1) - one / 200 + one / 240000, one / 10 - one / 6000
        power = (c + 1j * s) ** 10
        assert abs(found.q[-1] - power.real) < 1e-38
        assert abs(found.v[-1] + power.imag) < 1e-38
        assert found.q.dtype == object


def test_times_may_be_any_iterable():
    found = solve(oscillator, 1.0, 0.0, (t / 2 for t in range(3)), h=0.1)
    assert found.t.tolist() == [0.0, 0.5, 1.0]


def test_bare_functions_are_probed_for_the_velocity():
    found = solve(lambda t, q, v: -math.sin(q), 1.0, 0.0, [0.0, 1.0], method="velocity_verlet", h=0.1)
    assert found.steps == 10
    for damped in (
        lambda t, q, v: -q - 0.1 * v,
        lambda t, q, v: -q - abs(v) * v,
        lambda t, q, v: -q - q * v,
        lambda t, q, v: -q + math.sqrt(v),
    ):
        with pytest.raises(MethodError, match=r"velocity_verlet needs forces free of the velocity.*heun.* fit"):
            solve(damped, 0.0, 0.0, [0.0, 1.0], method="velocity_verlet", h=0.1)


@pytest.mark.parametrize("times", [[0.0, 1.0], [1.0, 0.0], [0, 1], [0.0, 0.3, 1.0]])
@pytest.mark.parametrize("damped", [lambda t: t > 0.5, lambda t: t < 0.5, lambda t: 0.3 < t < 0.6, lambda t: t == 1.0])
def test_bare_functions_are_probed_for_the_velocity_all_along(damped, times):
    with pytest.raises(MethodError, match="velocity_verlet needs forces free of the velocity"):
        solve(lambda t, q, v: -q - (v if damped(t) else 0.0), 1.0, 0.0, times, method="velocity_verlet", h=0.1)


@pytest.mark.parametrize(
    ("q", "times", "h"),
    [(1, "0 1", "1/10"), (1, "0 1", 1), (1, [0, 1], "1/10"), (1.0, "0 1", 1.0), (1.0, [0.0, 1.0], "1/10")],
)
def test_the_finest_numbers_decide_how_coefficients_are_rounded(q, times, h):
    """Start, times or step may have the highest precision; rk4 on the oscillator with steps of 1/10 or 1, by hand."""
    with mpmath.workdps(40):
        marks = [mpmath.mpf(t) for t in times.split()] if isinstance(times, str) else times
        step = mpmath.mpf(1) / 10 if h == "1/10" else h
        found = solve(oscillator, q, 0 * q, marks, method="rk4", h=step)
        part = (marks[1] - marks[0]) / found.steps
        part = mpmath.mpf(part)
        c, s = 1 - part**2 / 2 + part**4 / 24, part - part**3 / 6
        power = (c + 1j * s) ** found.steps
        assert abs(found.q[-1] - power.real) < 1e-38
        assert abs(found.v[-1] + power.imag) < 1e-38


def test_numbers_that_do_not_go_together():
    with pytest.raises(MethodError, match="must have compatible numeric types, not Decimal, float"):
        solve(oscillator, Decimal(1), Decimal(0), [0.0, 1.0], h=0.1)


@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "backward_euler"])
@pytest.mark.parametrize(
    ("start", "made"),
    [(np.ones(2), np.ones(3)), (np.ones(2), np.ones((2, 1))), (1.0, np.ones(2)), (np.ones((1, 2)), np.ones((2, 2)))],
)
def test_accelerations_of_another_shape(method, start, made):
    with pytest.raises(MethodError, match="acceleration must have the shape of q and v"):
        solve(lambda t, q, v: made, start, 0.0 * start, [0.0, 1.0], method=method, h=0.1)


def test_accelerations_that_change_their_shape():
    with pytest.raises(MethodError, match="acceleration must have the shape of q and v"):
        solve(System(lambda t, q, v: np.ones(2)), 1.0, 0.0, [0.0, 1.0], h=0.1)


def test_a_number_is_an_acceleration_of_all_components():
    found = solve(lambda t, q, v: -9.8, np.zeros(2), np.zeros(2), [0.0, 1.0], h=0.5)
    assert found.q[-1] == pytest.approx([-4.9, -4.9], abs=1e-14)


@pytest.mark.parametrize(
    ("times", "h"), [([0.0, 1.0], 1e-320), ([0.0, 1e300], 1.0), ([-1e308, 1e308], 1.0), ([0.0, 1.0], 0.9e-10),
                     (np.array([-1e308, 1e308]), 1e300), ([0, 10**400], 1)]
)
def test_runs_that_would_never_end(times, h):
    with pytest.raises(MethodError, match=r"h = .* are too short: they would be|times must hold"):
        solve(oscillator, 1.0, 0.0, times, h=h)


def test_forces_that_exist_only_in_places_are_no_velocities():
    found = solve(lambda t, q, v: -math.sqrt(1 - q), 0.9, 0.0, [0.0, 0.1], method="velocity_verlet", h=0.05)
    assert found.steps == 2


def test_missing_derivatives_are_named():
    with pytest.raises(MethodError, match=r"implicit_midpoint needs the derivatives .*jacobian.*heun.* fit"):
        solve(System(oscillator), 1.0, 0.0, [0.0, 1.0], method="implicit_midpoint", h=0.1)


NAN, INF = math.nan, math.inf
TIMES = [0.0, 1.0]


@pytest.mark.parametrize("h", [0, 0.0, -0.1, NAN, INF, -INF, "0.1", None, [0.1], np.array([0.1, 0.2]), 1j])
def test_steps_that_are_none(h):
    with pytest.raises(MethodError, match="h must be a finite step above zero, not "):
        solve(oscillator, 1.0, 0.0, TIMES, h=h)


@pytest.mark.parametrize(
    "times", [[], [0.0, NAN], [INF, 0.0], "ab", ["a", "b"], 1.0, None, [[0.0], [1.0]], [0, 1j]]
)
def test_times_that_are_none(times):
    with pytest.raises(MethodError, match="times must hold at least one time, all of them finite, not "):
        solve(oscillator, 1.0, 0.0, times, h=0.1)


@pytest.mark.parametrize("times", [[0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 0.5], [0.0, -1.0, -0.5]])
def test_times_that_turn_back(times):
    with pytest.raises(MethodError, match="times must be strictly increasing or strictly decreasing"):
        solve(oscillator, 1.0, 0.0, times, h=0.1)


@pytest.mark.parametrize(
    ("q", "v"),
    [
        (NAN, 0.0),
        (1.0, INF),
        ("1", 0.0),
        (None, 0.0),
        ([1.0], [NAN]),
        (np.ones(3), np.ones(2)),
        (np.ones(3), 0.0),
        (np.array([1.0, NAN]), np.zeros(2)),
    ],
)
def test_states_that_are_none(q, v):
    with pytest.raises(MethodError, match="q and v must be finite numbers or arrays of one shape, not "):
        solve(oscillator, q, v, TIMES, h=0.1)


@pytest.mark.parametrize("method", ["rk5", 3, None, METHODS])
def test_methods_that_are_none(method):
    with pytest.raises(MethodError, match="There is no integrator "):
        solve(oscillator, 1.0, 0.0, TIMES, method=method, h=0.1)


def test_problems_that_are_none():
    with pytest.raises(MethodError, match=r"must be a function a\(t, q, v\) or an integrators.System"):
        solve(3.0, 1.0, 0.0, TIMES, h=0.1)
    for faulty in (lambda t, q, v: NAN, lambda t, q, v: None, lambda t, q, v: "a"):
        with pytest.raises(MethodError, match="must be finite numbers, not"):
            solve(faulty, 1.0, 0.0, TIMES, h=0.1)
    with pytest.raises(MethodError, match=r"fails at the start, t = 0\.0: float division by zero"):
        solve(lambda t, q, v: 1.0 / t, 1.0, 0.0, TIMES, h=0.1)


def fails(name, end, h):
    """Return the error message for a force that fails from this time on: in that step or the next."""
    elapsed = reach = 0.0
    for kind, fraction, *_ in getattr(METHODS[name], "flows", ()):
        elapsed += float(fraction) if kind == DRIFT else 0.0
        reach = max(reach, elapsed)
    first = math.ceil(end / h - max(reach, 1.0) - 1e-9)
    steps, times = f"({first + 1}|{first + 2})", f"({first * h:.3}|{first * h + h:.3})"
    return rf"{name} left the finite range in step {steps}, from t = {times}"


@pytest.mark.parametrize("name", ANY_FUNCTION)
@pytest.mark.parametrize("start", [1.0, np.array([1.0, 2.0])], ids=["float", "array"])
def test_a_force_that_turns_nan_is_reported_with_the_time(name, start):
    def acceleration(t, q, v):
        return -q * (NAN if t > 0.55 else 1.0)

    with pytest.raises(MethodError, match=fails(name, 0.55, 0.1)):
        solve(acceleration, start, 0.0 * start, TIMES, method=name, h=0.1)


@pytest.mark.parametrize("name", ANY_FUNCTION)
def test_a_force_that_raises_is_reported_with_the_time(name):
    def acceleration(t, q, v):
        return -q * math.sqrt(0.55 - t)

    with pytest.raises(MethodError, match=fails(name, 0.55, 0.1) + ".*math domain error"):
        solve(acceleration, 1.0, 0.0, TIMES, method=name, h=0.1)


@pytest.mark.parametrize("name", ANY_FUNCTION)
def test_a_force_that_divides_arrays_by_zero_is_reported_without_a_warning(name):
    with pytest.raises(MethodError, match=fails(name, 0.65, 0.125)):
        solve(lambda t, q, v: -q / max(0.65 - t, 0.0), np.ones(2), np.zeros(2), TIMES, method=name, h=0.125)


@pytest.mark.parametrize("name", EXPLICIT)
@pytest.mark.parametrize("start", [1.0, np.array([1.0, 2.0])], ids=["float", "array"])
@pytest.mark.parametrize("power", [1, 3])
def test_runs_that_diverge_are_stopped(name, start, power):
    with pytest.raises(MethodError, match=rf"{name} left the finite range in step \d+, from t = .*too long"):
        solve(lambda t, q, v: -1e4 * q**power, start, 0.0 * start, [0.0, 1e4], method=name, h=1.0)


@pytest.mark.parametrize("name", IMPLICIT)
@pytest.mark.parametrize("start", [1.0, np.array([1.0]), mpmath.mpf(1)], ids=["float", "array", "mpmath"])
def test_stages_without_a_solution_are_reported(name, start):
    """k = 1 + (q + d (v + d k))**2 has no real k for q = 1, v = 0 and d**2 >= 1."""
    message = rf"{name} left the finite range in step 1, from t = 0.*no solution"
    with pytest.raises(MethodError, match=message):
        solve(lambda t, q, v: 1 + q * q, start, 0 * start, [0.0, 4.0], method=name, h=4.0)


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.int64, np.int8, np.uint8])
@pytest.mark.parametrize("given", [{"h": 0.25}, {"rtol": 2.0**-10, "method": "dopri5"}])
@pytest.mark.parametrize("where", ["q", "v", "times", "h", "rtol", "all"])
def test_narrow_numbers_are_taken_as_doubles(kind, given, where):
    """Numbers that both types represent exactly give the same bits."""
    whole = {"q": 1.0, "v": 2.0, "times": [0.0, 1.0, 3.0], **given}
    kept = {name: value if isinstance(value, str) or where not in (name, "all") else
            [kind(t) for t in value] if name == "times" else kind(value) for name, value in whole.items()}
    if np.dtype(kind).kind in "iu":
        kept |= given
    found, wanted = solve(oscillator, **kept), solve(oscillator, **whole)
    assert found.steps == wanted.steps
    for name in "tqv":
        assert getattr(found, name).dtype == np.float64
        assert np.array_equal(getattr(found, name), getattr(wanted, name))


def test_whole_numbers_take_the_kind_of_the_others():
    system = System(oscillator, velocity_free=True)
    times, h = [Decimal(0), Decimal("0.25")], Decimal("0.125")
    wanted = solve(system, Decimal(1), Decimal(0), times, h=h, method="velocity_verlet").q[-1]
    for one in (1, np.int64(1), np.int8(1)):
        assert solve(system, one, 0, times, h=h, method="velocity_verlet").q[-1] == wanted
    q, v = np.array([100], dtype=np.int8), np.array([0], dtype=np.int8)
    squares = solve(lambda t, q, v: -q * q, q, v, [0, 0.1], h=0.05)
    assert squares.q[-1, 0] == solve(lambda t, q, v: -q * q, 100.0, 0.0, [0.0, 0.1], h=0.05).q[-1]


def test_narrow_arrays_are_taken_as_doubles():
    q, v = np.array([1.0, 2.0]), np.array([0.5, 0.25])
    wanted = solve(oscillator, q, v, [0.0, 1.0], h=0.125, dense=True)
    for kind in (np.float32, np.float16):
        times = np.array([0.0, 1.0], dtype=kind)
        found = solve(oscillator, q.astype(kind), v.astype(kind), times, h=kind(0.125), dense=True)
        assert np.array_equal(found.q, wanted.q)
        assert np.array_equal(found(kind(0.3125))[0], wanted(0.3125)[0])


@pytest.mark.parametrize("switch", ["dense", "compensated"])
def test_switches_may_be_numpys(switch):
    for kind in (np.bool_, np.array):
        found = [solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=0.125, **{switch: value}) for value in (kind(True), True)]
        assert np.array_equal(found[0].q, found[1].q)
        assert (found[0].dense is None) == (found[1].dense is None)
        assert (found[0].lost_q is None) == (found[1].lost_q is None)
    assert System(oscillator, velocity_free=np.bool_(True)).offers() == System(oscillator, velocity_free=True).offers()
    with pytest.raises(MethodError, match=f"{switch} must be True or False, not 1"):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], h=0.125, **{switch: 1})


# what a user's function may return, and what it may not do ------------------------------------------------------------


@pytest.mark.parametrize("name", ANY_FUNCTION)
def test_lists_are_arrays(name):
    """As states, and as what the acceleration returns."""
    found = solve(lambda t, q, v: [-q[0], -4 * q[1]], [1.0, 2.0], (0.0, 0.0), TIMES, method=name, h=0.1)
    same = solve(lambda t, q, v: np.array([-1, -4]) * q, np.array([1.0, 2.0]), np.zeros(2), TIMES, method=name, h=0.1)
    assert found.q.tolist() == same.q.tolist()


@pytest.mark.parametrize(("q", "v", "said"), [
    (1j, 0j, "q must be real, not 1j"),
    (1.0, 0j, "v must be real, not 0j"),
    ([1.0, 1j], [0, 0], "q must be real"),
    (np.ones(2, complex), np.zeros(2), "q must be real"),
    (mpmath.mpc(1, 1), 0.0, "q must be real"),
    (np.array([mpmath.mpf(1)]), np.zeros(1), "are integrated one by one, not in an array"),
    ([[1.0], [1.0, 2.0]], [0.0, 0.0], "q must be a number or an array of real numbers"),
    (["a"], [0.0], "q must be a number or an array of real numbers"),
])
def test_states_of_other_kinds_are_refused_in_a_sentence(q, v, said):
    with pytest.raises(MethodError, match=said):
        solve(oscillator, q, v, TIMES, h=0.1)


WIDE = np.finfo(np.longdouble).bits > 64


@pytest.mark.skipif(not WIDE, reason="longdouble is float64 here")
@pytest.mark.parametrize("place", ["q", "v", "times", "h", "rtol"])
def test_longdouble_is_refused_wherever_it_comes_from(place):
    """It became float64 without a word."""
    given = {"q": 1.0, "v": 0.0, "times": [0.0, 1.0], "h": 0.1, "rtol": 1e-8}
    given[place] = [np.longdouble(0), np.longdouble(1)] if place == "times" else np.longdouble(given[place])
    with pytest.raises(MethodError, match="longdouble, which solve does not compute with; convert it to float64"):
        solve(oscillator, method="dop853", **given)


@pytest.mark.parametrize(("function", "q", "said"), [
    (lambda t, q, v: 1j * q, 1.0, r"The acceleration must be real, not \(?1j"),
    (lambda t, q, v: 1j * q, np.ones(2), "The acceleration must be real, not array"),
    (lambda t, q, v: np.ma.masked_array(-q, mask=[0, 1]), np.ones(2), "must be a plain array, not a masked one"),
    (lambda t, q, v: [1.0], 1.0, r"must have the shape of q and v, \(\), not \(1,\)"),
    (lambda t, q, v: [[1.0], [1.0, 2.0]], np.ones(2), "must be finite numbers, not"),
    (lambda t, q, v: q > 0.0, np.ones(2), "must be finite numbers, not array"),
    (np.add, 1.0, "The acceleration fails at the start, t = 0.0"),
    (lambda t, q: -q, 1.0, r"must be a function of \(t, q, v\), not of \(t, q\): too many positional arguments"),
    (lambda t, q, v, k: -k * q, 1.0, r"must be a function of \(t, q, v\).*missing a required argument: 'k'"),
])
def test_accelerations_of_other_kinds_are_refused_in_a_sentence(function, q, said):
    with pytest.raises(MethodError, match=said):
        solve(function, q, 0 * q, TIMES, h=0.1)


def test_functions_of_a_system_and_events_of_other_arguments_are_named():
    with pytest.raises(MethodError, match=r"force must be a function of \(t, q\), not of \(t, q, v\)"):
        solve(System(oscillator, force=oscillator, velocity_free=True), 1.0, 0.0, TIMES, h=0.1)
    with pytest.raises(MethodError, match=r"Event <lambda> must be a function of \(t, q, v\), not of \(t, y\)"):
        solve(oscillator, 1.0, 0.0, TIMES, h=0.1, events=lambda t, y: y[0])


@pytest.mark.parametrize("after", [-1.0, 1.0])
@pytest.mark.parametrize("name", ["q", "v"])
@pytest.mark.parametrize("wrap", [lambda a: a, System])
def test_an_acceleration_that_changes_the_state_in_place_is_refused(name, wrap, after):
    def acceleration(t, q, v):
        changed = q if name == "q" else v
        if t > after:
            changed += 1.0
        return -q

    q, v = np.array([1.0, 2.0]), np.zeros(2)
    with pytest.raises(MethodError, match=f"changes its argument {name} in place"):
        solve(wrap(acceleration), q, v, [0.0, 3.0], h=0.1)
    assert (q.tolist(), v.tolist()) == ([1.0, 2.0], [0.0, 0.0])


@pytest.mark.parametrize(("wrap", "way"), [
    *((wrap, way) for wrap in (lambda a: a, System) for way in ({"h": 0.1}, {"method": "dopri5", "rtol": 1e-8})),
    (lambda a: a, {"method": "taylor", "rtol": 1e-8}),
])
@pytest.mark.parametrize("value", [-9.81, -10, np.float32(-10.0), Decimal("-9.81"), [-9.81], np.full(1, -9.81)])
def test_one_number_accelerates_all_components(value, wrap, way):
    found = solve(wrap(lambda t, q, v: value), np.array([1.0, 2.0]), np.zeros(2), [0.0, 2.0], **way)
    assert found.q[-1] == pytest.approx(np.array([1.0, 2.0]) + 2.0 * float(np.ravel(value)[0]), abs=1e-12)


@pytest.mark.parametrize("way", [{"h": 0.1}, {"method": "dopri5", "rtol": 1e-8}])
@pytest.mark.parametrize(("q", "later", "said"), [
    (1.0, None, "TypeError: .*NoneType.*; the acceleration must return real numbers at every time"),
    (1.0, Decimal(1), "TypeError: .*Decimal.*; the acceleration must return real numbers at every time"),
    (1.0, np.zeros(3), r"must have the shape of q and v, \(\), not \(3,\)"),
    (np.ones(2), None, "The acceleration must be finite numbers, not None"),
    (np.ones(2), np.zeros(3), r"must have the shape of q and v, \(2,\), not \(3,\)"),
])
def test_what_an_acceleration_returns_later_is_checked_too(q, later, said, way):
    with pytest.raises(MethodError, match=said):
        solve(lambda t, q, v: -q if t < 1.3 else later, q, 0 * q, [0.0, 3.0], **way)


@pytest.mark.parametrize(("q", "said"), [
    (np.ma.masked_array([1.0, 2.0], mask=[0, 1]), "q must be a plain array, not a masked one"),
    ([], r"q must have at least one component, not the shape \(0,\)"),
])
def test_states_without_numbers_are_refused(q, said):
    with pytest.raises(MethodError, match=said):
        solve(oscillator, q, q, TIMES, h=0.1)


def test_a_duration_that_doubles_cannot_square_is_refused():
    for times in ([0.0, 1e200], [0.0, -1e200]):
        with pytest.raises(MethodError, match=r"times may span at most 1e\+150 with rtol, not 1e\+200"):
            solve(lambda t, q, v: 0.0 * q, 0.0, 1.0, times, method="dopri5", rtol=1e-8)
    found = solve(lambda t, q, v: 0.0 * q, 0.0, 1.0, [0.0, 1e150], method="dopri5", rtol=1e-8)
    assert found.q[-1] == pytest.approx(1e150, rel=1e-14)


def test_dense_output_takes_times_of_any_real_number():
    found = solve(oscillator, 1.0, 0.0, [0.0, 3.0], method="dop853", rtol=1e-12, dense=True)
    for t in (Decimal("1.5"), Fraction(3, 2), np.float32(1.5), 1.5):
        assert found(t)[0] == pytest.approx(math.cos(1.5), abs=1e-11)
    for t in (10**400, [10**400], None):
        with pytest.raises(MethodError, match="t must be a finite time"):
            found(t)


def test_a_solution_does_not_change_with_the_arrays_that_it_began_with():
    q, v = np.array([1.0, 2.0]), np.zeros(2)
    found = solve(oscillator, q, v, TIMES, method="rk4", h=0.1, dense=True)
    q[:] = 9.0
    assert found(TIMES[0])[0].tolist() == [1.0, 2.0]


@pytest.mark.parametrize(("name", "method"), [
    ("acceleration", "rk4"), ("force", "dprkn8"), ("exact_flow", "exact"), ("taylor_coefficients", "taylor"),
], ids=["acceleration", "force", "exact flow", "series"])
def test_functions_of_a_system_may_reuse_their_arrays(name, method):
    """Each returns arrays that its next call writes over."""
    functions = {
        "acceleration": oscillator, "force": lambda t, q: -q,
        "exact_flow": lambda t, q, v, h: (q * np.cos(h) + v * np.sin(h), v * np.cos(h) - q * np.sin(h)),
        "taylor_coefficients": coefficients(oscillator),
    }
    function, stored = functions[name], [np.zeros(2) for _ in range(14)]

    def reused(*arguments):
        value = function(*arguments)
        several = isinstance(value, (tuple, list))
        for place, x in zip(stored, value if several else [value], strict=False):
            place[:] = x
        return stored[: len(value)] if several else stored[0]

    system = System(**{"acceleration": oscillator, "velocity_free": True, name: reused})
    found = solve(system, [1.0, 0.5], [0.0, 0.2], TIMES, method=method, h=0.1)
    c, s = (f(np.array(TIMES)[:, None] - TIMES[0]) for f in (np.cos, np.sin))
    assert found.q == pytest.approx(np.array([1.0, 0.5]) * c + np.array([0.0, 0.2]) * s, abs=2e-6)


@pytest.mark.parametrize("name", ["rk4", "velocity_verlet", "dop853", "ab4", "kahan_li8", "taylor"])
def test_decimals_go_through_a_bare_function_too(name):
    one = Decimal(1)
    found = solve(oscillator, one, 0 * one, [0 * one, one], method=name, h=one / 20)
    assert float(found.q[-1]) == pytest.approx(math.cos(1), abs=20 * 0.05 ** METHODS[name].order + 1e-14)


@pytest.mark.parametrize("name", ["backward_euler", "gauss4", "bdf3"])
def test_decimals_of_implicit_methods_are_refused_in_a_sentence(name):
    one = Decimal(1)
    with pytest.raises(MethodError, match=f"{name} cannot compute with numbers of the type Decimal"):
        solve(oscillator, one, 0 * one, [0 * one, one], method=name, h=one / 20)


# far from t = 0 -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.0, 1e9, 1e12])
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("name", ["dop853", "dopri5", "verner9", "dprkn12", "taylor"])
def test_adaptive_steps_are_as_long_as_the_times_say(name, sense, start):
    """An error of 3.4e-10 is that of SciPy's DOP853 at 1e-10, from each of these times."""
    found = solve(oscillator, 1.0, 0.0, [start, start + sense * 10.0], method=name, rtol=1e-10)
    assert (found.q[-1], found.v[-1]) == pytest.approx((math.cos(10), -sense * math.sin(10)), abs=3e-9)


@pytest.mark.parametrize("name", ["ab4", "bdf4", "quinlan_tremaine8", "stoermer6"])
def test_rounded_times_far_from_zero_do_not_restart_a_history(name, recwarn):
    times = 1e9 + np.linspace(0.0, 10.0, 101)
    found = solve(oscillator, 1.0, 0.0, times, method=name, h=0.1)
    assert found.steps == 100
    assert not [warning for warning in recwarn if "history" in str(warning.message)]
    near = solve(oscillator, 1.0, 0.0, np.linspace(0.0, 10.0, 101), method=name, h=0.1)
    assert found.q == pytest.approx(near.q, abs=1e-6)  # the times are rounded by 6e-8


def test_steps_shorter_than_the_rounding_of_times_have_dense_output_all_the_same():
    """At 1e15 times are 1/8 apart, and steps 1/100 long."""
    start = 1e15
    found = solve(oscillator, 1.0, 0.0, [start, start + 2.0], method="rk4", h=0.01, dense=True)
    places = start + np.arange(1, 16) / 8
    assert found(places)[0] == pytest.approx(np.cos(places - start), abs=1e-9)
    assert [found(t)[0] for t in places] == pytest.approx(np.cos(places - start), abs=1e-9)


@pytest.mark.slow
def test_slow_motions_over_long_times_are_no_fault():
    """``q'' = -1e-14 q`` over 1e11, 1591 periods: the first step was refused as too short."""
    found = solve(lambda t, q, v: -1e-14 * q, 1.0, 0.0, [0.0, 1e11], method="dop853", rtol=1e-9)
    assert found.q[-1] == pytest.approx(math.cos(1e4), abs=1e-5)
    first = solve(lambda t, q, v: -1e-14 * q, 1.0, 0.0, [0.0, 1e5], method="dop853", rtol=1e-9)
    assert first.steps < 10
    solve(lambda t, q, v: -1e-14 * q, 1.0, 0.0, [0.0, 1e11], method="dop853", rtol=1e-6, h=1e-9)


@pytest.mark.parametrize("start", [0.0, -1.0])
def test_a_force_that_ends_at_time_zero_is_still_refused(start):
    with pytest.raises(integrators.StepSizeError, match="not finite"):
        solve(System(lambda t, q, v: math.nan if t > 0 else -q), 1.0, 0.0, [start, 1.0], method="dop853", rtol=1e-8)
