"""Test the grade of a fit: usable, usable with exceptions, or not usable; recordings are simulated by scipy alone."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from virtual_swings import GRAVITY, MASS, even, recorded, swing

from pendulum_env.lab import Recording, TurningPoints
from pendulum_env.lab.fitting.fit import fit
from pendulum_env.lab.fitting.grade import Fault, Grade, growth, of_lost, of_misfit, settled, steady
from pendulum_env.lab.fitting.result import Fit
from pendulum_env.lab.fitting.start import Measured

Array = NDArray[np.float64]
TENTH, QUARTER = math.radians(0.1), math.radians(0.25)
LENGTH = 0.5
OMEGA = math.sqrt(GRAVITY / LENGTH)


def pendulum(time: Array, angle: float, torque: Callable[[float, float], float]) -> Array:
    """Return the angles of ``theta'' = -omega0² sin theta + torque(t, v)``, released from rest."""
    run = solve_ivp(lambda t, y: [y[1], -(OMEGA**2) * math.sin(y[0]) + torque(t, y[1])], (0.0, float(time[-1])),
                    [angle, 0.0], "LSODA", time, rtol=1e-9, atol=1e-11)
    return np.asarray(run.y[0])


def creeping(time: Array) -> Array:
    """Return a swing from 40 degrees under quadratic drag and a friction that fades at small speed, so that the bob
    creeps to rest."""
    return pendulum(time, math.radians(40.0), lambda _t, v: -0.1 * abs(v) * v - 0.4 * math.tanh(v / 0.3))


def driven(time: Array, angle: float, gamma: float, force: float, ratio: float, after: float = 0.0) -> Array:
    """Return a swing driven at ``ratio`` of the small-angle frequency, from ``after`` [s] on."""
    later = np.concatenate([[0.0], time + after]) if after else time
    angles = pendulum(later, angle, lambda t, v: force * math.cos(ratio * OMEGA * t) - gamma * v)
    return angles[1:] if after else angles


def quiet(recording: Recording, *models: str) -> Fit:
    """Return the fit of a recording, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fit(recording, list(models) or "auto", mass=MASS)


# --- the model with the better likelihood ----------------------------------------------------------------------------


@pytest.mark.slow
def test_the_last_degrees_of_a_swing_do_not_overrule_all_others() -> None:
    """The residuals of linear damping are 27 % smaller than those of dry friction, and it is the better model, although
    it swings on where the bob creeps to rest in the last 3 degrees."""
    time = even(20.0, 50.0)
    found = quiet(recorded(time, creeping(time), noise=0.5 * TENTH), "linear", "coulomb")
    comparison = found.comparison
    assert comparison is not None
    linear, dry = comparison["linear"], comparison["coulomb"]
    assert linear.solution.lost
    assert not dry.solution.lost
    assert linear.rms < 0.75 * dry.rms
    assert found.damping == "linear"
    assert comparison.verdicts[0] == "best"
    assert list(comparison.delta_bic) == sorted(comparison.delta_bic)


@pytest.mark.slow
def test_models_within_10_and_the_last_that_is_ruled_out_are_drawn() -> None:
    time = even(20.0, 50.0)
    comparison = quiet(recorded(time, creeping(time), noise=0.5 * TENTH)).comparison
    assert comparison is not None
    drawn = [one.damping for one in comparison.drawn]
    close = [one.damping for one, delta in zip(comparison.fits, comparison.delta_bic, strict=True) if delta < 10.0]
    assert drawn == [*close, comparison.ruled_out[0]]
    assert len(close) >= 2


def test_what_a_model_does_not_follow_counts_by_the_squared_angles() -> None:
    """A swing that decays as exp(-t) has the share exp(-2 T) of its squared angles after T."""
    time = np.linspace(0.0, 10.0, 1001)
    angles = np.exp(-time) * np.cos(40.0 * time)
    assert of_lost("linear", 10.0, time, angles) == []
    (mild,), (serious,) = of_lost("linear", 1.6, time, angles), of_lost("linear", 1.4, time, angles)
    assert math.exp(-3.2) < 0.05 < math.exp(-2.8)
    assert (mild.serious, serious.serious) == (False, True)
    assert "does not follow the readings after 1.6 s, which are within 11 degrees" in mild.text


# --- rounded readings ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("rate", [500.0, 100.0])
def test_a_perfect_swing_at_a_quarter_of_a_degree_is_fitted_to_its_noise(rate: float) -> None:
    """Linear damping from 3 degrees, rounded: the error of a reading is that of rounding, quantum / sqrt(12), however
    many neighbouring readings are equal."""
    time = even(20.0, rate)
    angle = swing(time, math.radians(3.0), length=LENGTH, gamma=0.02)
    found = quiet(recorded(time, angle, quantum=QUARTER), "linear")
    assert found.rounded_alike
    assert found.noise == pytest.approx(QUARTER / math.sqrt(12.0), rel=1e-3)
    assert found.chi2 / found.degrees_of_freedom == pytest.approx(1.0, abs=0.1)
    assert found.p_value > 0.01
    assert found.grade.text.startswith("The model linear follows the recording to within the noise")
    assert found.grade.text.endswith(". The fit is usable.")


def test_a_misfit_is_named_with_its_size() -> None:
    """Residuals of 1.2 errors of a reading are noise, 1.9 no misfit, 2.1 are one, and 6 % of the swing are no fit."""
    wave = math.sqrt(2.0) * np.sin(np.arange(0.0, 60.0 * math.tau, 0.1))
    said, faults = of_misfit("linear", 1.2 * wave, 1.0, 100.0, "°", True)
    assert said.startswith("The model linear follows the recording to within the noise: its residual is 1.2° rms")
    assert faults == []
    said, faults = of_misfit("linear", 1.9 * wave, 1.0, 100.0, "°", True)
    assert said.startswith("The model linear follows the recording: its residual is 1.9° rms, 1.9 times the error of")
    assert faults == []
    said, faults = of_misfit("linear", 2.1 * wave, 1.0, 100.0, "°", True)
    assert said == "The model linear follows the recording only to 2.1° rms, 2.1 times the error of a reading (1°)."
    assert [fault.serious for fault in faults] == [False]
    said, faults = of_misfit("linear", 6.0 * wave, 1.0, 100.0, "°", True)
    assert "does not follow the recording: its residual is 6° rms, 6 times the error of a reading (1°) and 6%" in said
    assert [fault.serious for fault in faults] == [True]


def test_a_misfit_at_the_start_or_the_end_is_named() -> None:
    wave = math.sqrt(2.0) * np.sin(np.arange(0.0, 60.0 * math.tau, 0.1))
    late = np.where(np.arange(len(wave)) < 0.9 * len(wave), 0.1, 10.0) * wave
    assert "in the last tenth it is 10°" in of_misfit("linear", late, 0.1, 100.0, "°", True)[0]
    assert "in the first tenth it is 10°" in of_misfit("linear", late[::-1], 0.1, 100.0, "°", True)[0]


# --- swings that are not free ----------------------------------------------------------------------------------------


def test_three_grades_in_a_sentence_each() -> None:
    mild, serious = Fault("the end is missing", False), Fault("the pendulum is driven", True)
    assert (Grade().text, Grade().word) == ("The fit is usable.", "usable")
    assert Grade((mild,)).text == "The fit is usable, except that the end is missing."
    assert Grade((serious, mild)).text == "The fit is not usable, because the pendulum is driven."
    assert [grade.usable for grade in (Grade(), Grade((mild,)), Grade((mild, serious)))] == [True, True, False]
    mended = Grade((), "It follows.", ("The zero jumps.",))
    assert mended.text == "It follows. The zero jumps. The fit is usable, but better without this fault."
    assert (mended.word, mended.usable, mended.conclusive) == ("usable with exceptions", True, False)
    assert [grade.conclusive for grade in (Grade(), Grade((mild,)), Grade((serious,)))] == [True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("quantum", [0.0, QUARTER])
def test_a_steady_driven_swing_is_called_driven(quantum: float) -> None:
    """In the steady state, 200 s after the drive is switched on, the amplitude stays; no damping is named."""
    time = even(60.0, 50.0)
    angle = driven(time, 0.0, 0.1, 0.1, 0.995, after=200.0)
    seen = recorded(time, angle, quantum=quantum, noise=0.0 if quantum else TENTH)
    with pytest.warns(UserWarning, match=r"The fit is not usable, because the swings do not decay .* driven"):
        found = fit(seen, ["none", "coulomb"], mass=MASS)
    comparison = found.comparison
    assert comparison is not None
    assert comparison.text == found.grade.text
    assert "verdict" not in comparison.table.head


@pytest.mark.slow
def test_a_swing_that_settles_is_called_driven() -> None:
    time = even(60.0, 50.0)
    found = quiet(recorded(time, driven(time, 0.6, 0.3, 0.2, 0.98), noise=TENTH), "quadratic")
    assert "The fit is not usable, because the swings settle at 7.6" in found.grade.text
    assert "the pendulum is driven" in found.grade.text


@pytest.mark.slow
def test_a_push_of_one_per_cent_leaves_the_fit_usable() -> None:
    """A push in one swing, which does the work F 2 A, makes the amplitude larger by 2 F / omega0², less the damping."""
    time = even(20.0, 50.0)
    angle = pendulum(time, 0.2, lambda t, v: -0.02 * v + (0.045 if 9.0 < t < 10.4 and v > 0.0 else 0.0))
    seen = recorded(time, angle, noise=0.2 * TENTH)
    share, _, lasting = growth(Measured.of(seen).points)
    assert 0.008 < share < 0.02
    assert lasting < 0.05
    found = quiet(seen, "linear")
    assert f"The fit is usable, except that the swings grow by {100.0 * share:.3g} %" in found.grade.text
    assert abs(found.parameters["length"].value - LENGTH) < 4.0 * found.parameters["length"].error


def points(sizes: Array, error: float = 1e-4) -> TurningPoints:
    """Return turning points with the given amplitudes, half a second apart."""
    signs = np.where(np.arange(len(sizes)) % 2, -1.0, 1.0)
    return TurningPoints(0.5 * np.arange(len(sizes)), signs * sizes, np.full(len(sizes), error))


def test_a_decaying_swing_is_never_called_driven() -> None:
    """Check the amplitudes of dry friction, linear and quadratic drag, over many swings and over few."""
    step = np.arange(200.0)
    slow = 0.5 * np.exp(-3e-4 * step)
    for sizes in (0.5 - 0.0024 * step, 0.5 * np.exp(-0.02 * step), 0.5 / (1.0 + 0.2 * step), slow):
        for count in (8, 40, 200):
            seen = points(sizes[:count])
            assert not settled(seen)
            assert steady(seen, math.tau) < 5000.0


def test_amplitudes_that_a_coarse_sensor_rounds_alike_are_not_steady() -> None:
    """The error of an amplitude limits the quality factor to pi n / (8 error/A), however many swings there are: the
    first and the last amplitude differ by less than 2 errors, twice."""
    coarse = points(np.full(100, 0.05), error=6e-4)
    assert steady(coarse, math.tau) == pytest.approx(math.pi * 99.0 / (8.0 * 6e-4 / 0.05), rel=0.05)
    assert steady(points(np.full(100, 0.05), error=1e-5), math.tau) > 5000.0
