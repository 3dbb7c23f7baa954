"""fit: recordings with a known truth, of every kind that a lab makes, and what is refused."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from virtual_swings import MASS, even, recorded, swing, uneven

from pendulum_env.lab import Recording, RecordingError
from pendulum_env.lab.fitting import core, shooting
from pendulum_env.lab.fitting.fit import fit
from pendulum_env.lab.fitting.model import Model
from pendulum_env.lab.fitting.result import Fit, FitComparison, against
from pendulum_env.lab.fitting.shooting import FitSolution, followed
from pendulum_env.lab.fitting.start import Measured
from pendulum_env.physics.units import SceneError

TENTH = math.radians(0.1)
PLAIN = {"length": 0.5, "gamma": 0.05, "c": 0.02}
NAMES = {"gamma": "linear_drag.gamma", "c": "quadratic_drag.c", "friction": "coulomb_friction.friction_torque"}
"""What virtual swings call a damping's number, and what fits call it."""


def found_truth(found: Fit, truth: dict[str, float]) -> None:
    """AssertionError unless each number is within 4 standard errors of the truth."""
    for name, value in truth.items():
        own = found.parameters[NAMES.get(name, name)]
        assert abs(own.value - value) < 4.0 * own.error, (name, own)


def plain(time: np.ndarray | None = None, **sensor: Any) -> Recording:
    time = even(20.0, 50.0) if time is None else time
    return recorded(time, swing(time, 0.6, **PLAIN), **{"noise": TENTH, **sensor})


def test_a_fit_finds_the_truth() -> None:
    """Within the standard errors, which are a thousandth of the numbers; and leaves the noise."""
    found = fit(plain(zero=0.3), "linear+quadratic", mass=MASS)
    found_truth(found, {**PLAIN, "zero": 0.3})
    assert found.rms == pytest.approx(TENTH, rel=0.05)
    assert found.parameters["length"].error < 2e-5
    assert found.comparison is None
    assert not found.solution.lost


def test_a_fit_ends_at_the_minimum() -> None:
    """To 3e-7 of the errors: the next Gauss-Newton step, from differences of a thousandth of each error."""
    found = fit(plain(), "linear+quadratic", mass=MASS)
    model, values = found.solution.model, found.solution.values
    changes = 1e-3 * np.diag([one.error for one in found.parameters.values()])
    slopes = (model.angles(values + changes) - model.angles(values - changes)).T / 2e-3  # by each error
    step = np.linalg.lstsq(slopes, plain().angle - model.angles(values)[0], rcond=None)[0]
    assert np.abs(step).max() < 3e-7


@pytest.mark.slow
def test_a_gap_does_no_harm() -> None:
    time = even(40.0, 50.0)
    time = time[((time < 6.0) | (time > 9.3)) & ((time < 20.0) | (time > 31.0))]
    found_truth(fit(plain(time), "linear+quadratic", mass=MASS), PLAIN)


def test_a_gap_is_no_long_oscillation() -> None:
    """The period that a fit begins with, where 4 of 14 oscillations are not seen."""
    time = even(20.0, 50.0)
    time = time[(time < 8.0) | (time > 13.9)]
    assert Measured.of(plain(time)).period == pytest.approx(math.tau * math.sqrt(0.5 / 9.81), rel=2e-3)


@pytest.mark.slow
def test_a_model_does_no_worse_than_one_that_it_contains(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where its own fit ended in a wrong minimum, it is fitted anew from the simpler one's."""
    calls: list[tuple[str, ...]] = []
    real = shooting.solve

    def solve(model: Model, *given: Any, **more: Any) -> FitSolution:
        calls.append(model.damping)
        found = real(model, *given, **more)
        return replace(found, residual=found.residual + 0.1) if len(calls) == 1 else found

    monkeypatch.setattr(shooting, "solve", solve)
    found = fit(plain(), ["linear", "linear+quadratic"], mass=MASS)
    assert calls == [("linear", "quadratic"), ("linear",), ("linear", "quadratic")]
    assert found.damping == "linear+quadratic"
    found_truth(found, PLAIN)


@pytest.mark.slow
def test_needless_dampings_leave_the_least_squares() -> None:
    """All of them on a swing without: no more squares than without, and the length as good."""
    time = even(15.0, 30.0)
    seen = recorded(time, swing(time, math.radians(10.0), length=0.5), noise=TENTH)
    bare, full = fit(seen, "none", mass=MASS), fit(seen, "linear+quadratic+coulomb", mass=MASS)
    assert full.rms <= bare.rms * (1.0 + 1e-6)
    assert full.parameters["length"].value == pytest.approx(bare.parameters["length"].value, abs=1e-6)


def test_a_recording_may_begin_in_mid_swing_and_last_three_swings() -> None:
    time = even(4.6, 50.0)
    begun = recorded(time, swing(time, 0.05, velocity=-2.0, length=0.5, gamma=0.05), noise=TENTH)
    found_truth(fit(begun, "linear", mass=MASS), {"length": 0.5, "gamma": 0.05})


def test_gravity_instead_of_length() -> None:
    found = fit(plain(), "linear+quadratic", length=0.5, mass=MASS, free=("gravity",))
    found_truth(found, {"gravity": 9.81})
    assert found.scene.body.length == 0.5


@pytest.mark.slow
def test_the_sensors_scale_is_told_by_the_period() -> None:
    """A scale 1 % too large: to 0.03 % from 60 degrees in 40 s."""
    time = even(40.0, 50.0)
    seen = recorded(time, swing(time, math.radians(60.0), **PLAIN), noise=TENTH, scale=1.01)
    found = fit(seen, "linear+quadratic", mass=MASS, free=("length", "scale"))
    found_truth(found, {**PLAIN, "scale": 1.01})
    assert found.parameters["scale"].error < 3e-4


def test_a_fit_against_what_was_told() -> None:
    found = fit(plain(), "linear+quadratic", mass=MASS)
    assert found.against(length=(0.47, 0.01))["length"] == pytest.approx(3.0, abs=0.01)
    assert against(found, {NAMES["c"]: (0.02, 1.0)})[NAMES["c"]] == pytest.approx(0.0, abs=1e-3)
    for wrong, said in (({"lenght": (0.5, 0.01)}, "did you mean length"), ({"length": 0.5}, "length must be"),
                        ({"length": (0.5,)}, "a value and its standard error"), ({"length": (0.5, 0.0)}, "above 0")):
        with pytest.raises(SceneError, match=said):
            found.against(**wrong)  # type: ignore[arg-type]


@pytest.mark.slow
def test_what_follows_and_what_slips() -> None:
    """A model whose length is off by 0.6 % is half a turn behind after 1/(2 * 0.003) periods: astray by half an
    amplitude, 30 degrees of phase, after a sixth of these."""
    time = even(120.0, 50.0)
    length = 0.5
    model = Model.of(fit(plain(), "linear", mass=MASS).scene, ("linear",), time, program=("linear", "quadratic"))
    angle = swing(time, 0.1, length=length)
    off = np.array([0.1, 0.0, 0.0, length * 1.006, 0.0])
    last = time[followed(model, off, angle, np.full(len(time), 1e-4)) - 1]
    period = math.tau * math.sqrt(length / 9.81)
    assert last / period == pytest.approx(1.0 / 6.0 / 2.0 / 0.003, abs=1.0)
    assert followed(model, off * [1, 1, 1, 1 / 1.006, 1], angle, np.full(len(time), 1e-4)) == len(time)


@pytest.mark.slow
def test_a_model_that_cannot_follow_is_said_to() -> None:
    """A swing from 150 degrees that dies out, without damping."""
    time = even(30.0, 50.0)
    dying = recorded(time, swing(time, 2.6, length=0.5, gamma=0.15), noise=TENTH)
    with pytest.warns(UserWarning, match="^The fit is not usable, because the model none follows the recording only"):
        found = fit(dying, "none", mass=MASS)
    assert found.solution.lost
    assert not found.grade.usable
    assert FitComparison.of([found]).text == found.grade.text


@pytest.mark.quick("-0.1")
@pytest.mark.parametrize("gamma", [-0.01, -0.1])
def test_swings_that_grow_are_said_to(gamma: float) -> None:
    """No damping is what the comparison would find, as none of them drives."""
    time = even(20.0, 50.0)
    driven = recorded(time, swing(time, 0.17, length=0.5, gamma=gamma), noise=TENTH)
    with pytest.warns(UserWarning, match=r"^The fit is not usable, because the swings grow by \d+\.\d+ % "):
        fit(driven, ["none", "linear"], mass=MASS)


@pytest.mark.slow
def test_a_steady_growth_of_a_per_cent_leaves_the_fit_usable() -> None:
    time = even(60.0, 50.0)
    driven = recorded(time, swing(time, 0.35, length=0.353, gamma=-2.0 * math.log(1.013) / 60.0), noise=TENTH)
    with pytest.warns(UserWarning, match=r"^The fit is usable, except that the swings grow by 1\.\d+ % "):
        found = fit(driven, "linear", mass=MASS)
    assert found.scene.body.length == pytest.approx(0.353, abs=3e-4)


@pytest.mark.quick("10.0-0.1-0.0")
@pytest.mark.parametrize(("degrees", "noise", "quantum"), [(94.0, 0.0, 0.0), (10.0, 0.1, 0.0), (3.0, 0.0, 0.25)])
def test_swings_that_keep_their_size_do_not_grow(degrees: float, noise: float, quantum: float) -> None:
    time = even(20.0, 50.0)
    seen = recorded(time, swing(time, math.radians(degrees), length=0.5), noise=math.radians(noise),
                    quantum=math.radians(quantum))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(seen, "none", mass=MASS)


@pytest.mark.slow
def test_bad_readings_do_not_end_a_swing() -> None:
    """Three that are 20 degrees off, of 1000: they are in the scatter and the errors, and said."""
    time = even(20.0, 50.0)
    angle = swing(time, 0.6, **PLAIN)
    angle[[101, 402, 777]] += 0.35
    with pytest.warns(UserWarning, match=r"^3 readings are up to 20\.\d° off .*--robust"):
        found = fit(recorded(time, angle, noise=TENTH), "linear+quadratic", mass=MASS)
    assert not found.solution.lost
    found_truth(found, PLAIN)


@pytest.mark.slow
def test_a_number_per_inertia_needs_no_mass() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(plain(), "linear")


@pytest.mark.slow
def test_a_number_of_a_mass_that_nobody_told_is_said_to_be() -> None:
    with pytest.warns(UserWarning, match="bearing_viscosity holds for a bob of 1 kg"):
        fit(plain(), "bearing", length=0.5)


@pytest.mark.slow
def test_progress_ends_at_one() -> None:
    told: list[float] = []
    fit(plain(), ["linear", "quadratic"], mass=MASS, progress=lambda done, _what: told.append(done))
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert all(0.0 <= done <= 1.0 for done in told)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "a misspelt damping": ({"effects": "quadratc"}, "There is no damping 'quadratc'.*did you mean quadratic"),
    "a damping twice": ({"effects": "linear+linear"}, "names one damping twice"),
    "a model twice": ({"effects": ["linear+coulomb", "coulomb+linear"]}, r"names the model linear\+coulomb twice"),
    "no model": ({"effects": []}, "effects must be 'auto'"),
    "a number": ({"effects": 3}, "effects must be 'auto'"),
    "a model that is a number": ({"effects": [3]}, "A model in effects"),
    "one name as free": ({"free": "length"}, "free must be a list of names"),
    "a misspelt free name": ({"free": ("lenght",)}, "did you mean length"),
    "what is no number": ({"free": ("suspension",)}, "not a positive parameter"),
    "both of a ratio": ({"free": ("length", "gravity")}, "determines only their ratio"),
    "one twice": ({"free": ("length", "length")}, "names a parameter twice"),
    "a misspelt keyword": ({"lenght": 0.5}, "did you mean length"),
    "a misspelt own keyword": ({"efects": "linear"}, "did you mean effects"),
    "an impossible length": ({"length": -1.0}, "length must be"),
    "nothing that swings": ({"scene": {}}, "has no restoring force"),
    "an array of effects": ({"effects": np.ones(2)}, "effects must be 'auto'"),
    "drag in a vacuum": ({"effects": "sphere_drag", "density": 0.0}, "vacuum|density|air"),
}


@pytest.mark.parametrize(("keywords", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_is_refused_in_one_sentence(keywords: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneError, match=said) as caught:
        fit(plain(even(3.0, 50.0)), **keywords)
    assert "\n" not in str(caught.value)


def over_the_top() -> Recording:
    """Four times too large a scale."""
    time = even(10.0, 100.0)
    return recorded(time, swing(time, 1.0, length=0.5, gamma=0.3), noise=TENTH, scale=4.0)


def overdamped() -> Recording:
    time = even(10.0, 50.0)
    return recorded(time, swing(time, 0.5, length=0.5, gamma=20.0), noise=TENTH)


UNFIT: dict[str, tuple[Any, str]] = {
    "a path": (lambda: "swing.txt", "recording must be a Recording"),
    "overdamped": (overdamped, "turns back"),
    "half a swing": (lambda: plain(even(0.8, 50.0)), "turning points"),
    "over the top": (over_the_top, "over the top"),
    "few readings": (lambda: plain(even(4.0, 2.0)), "turns back"),
}


@pytest.mark.parametrize(("make", "said"), UNFIT.values(), ids=UNFIT)
def test_what_is_no_free_swing_is_refused(make: Any, said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        fit(make(), "linear", mass=MASS)


# --- recordings as sensors make them --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_quarter_of_a_degree_at_uneven_times_from_three_degrees() -> None:
    time = uneven(70.0, 0.05)
    truth = {"length": 0.5, "gamma": 0.02}
    seen = recorded(time, swing(time, math.radians(3.0), **truth), quantum=math.radians(0.25))
    found = fit(seen, "linear", mass=MASS)
    found_truth(found, truth)
    assert found.parameters["length"].error < 5e-5


@pytest.mark.slow
def test_an_encoder_over_125_cycles_to_rest_off_centre() -> None:
    """1200 counts a turn at 10 ms, from 94 degrees until dry friction holds the bob at 0.03 of the 0.16 degrees that it
    can; of the rest, rounded the same way 2200 times, a period counts."""
    time = even(137.0, 100.0)
    truth = {"length": 0.3, "gamma": 0.005, "c": 0.001, "friction": 8e-4}
    angle = swing(time, math.radians(94.0), **truth)
    assert np.all(angle[-2000:] == angle[-1])
    assert abs(angle[-1]) > 4e-4
    found = fit(recorded(time, angle, quantum=math.radians(0.3)), "linear+quadratic+coulomb", mass=MASS)
    found_truth(found, truth)
    assert found.rms == pytest.approx(math.radians(0.3) / math.sqrt(12.0), rel=0.02)
    assert not found.solution.lost
    assert "the reading does not change" in found.recording.notes[-1]
    assert 114.0 < found.recording.time[-1] < 117.0
    assert found.scene.run.duration == pytest.approx(137.0, abs=1e-9)


@pytest.mark.slow
def test_48000_readings_at_uneven_times() -> None:
    time = uneven(81.6, 0.0017)
    truth = {"length": 0.4, "c": 0.02}
    seen = recorded(time, swing(time, 0.7, **truth), quantum=TENTH, noise=0.5 * TENTH)
    assert len(seen.time) == 48000
    found_truth(fit(seen, "quadratic", mass=MASS), truth)


@pytest.mark.slow
def test_from_170_degrees() -> None:
    time = even(60.0, 100.0)
    truth = {"length": 0.3, "gamma": 0.03, "c": 0.01}
    found = fit(recorded(time, swing(time, math.radians(170.0), **truth), quantum=math.radians(0.25)),
                "linear+quadratic", mass=MASS)
    found_truth(found, truth)
    assert found.rms < 1.05 * math.radians(0.25) / math.sqrt(12.0)


@pytest.mark.slow
def test_a_model_that_stops_has_no_angles_from_there_on() -> None:
    """Nan, not an error of the interpolation; runs beside it in the batch are as they were."""
    time = even(20.0, 50.0)
    model = Model.of(fit(plain(), "none").scene, ("quadratic",), time)
    whole = np.array([0.6, 0.0, 0.0, 0.5, 0.02])
    wild = np.array([0.6, 1e9, 0.0, 0.5, 0.02])
    found = model.angles(np.stack([whole, wild]))
    np.testing.assert_array_equal(found[0], model.angles(whole)[0])
    assert np.isnan(found[1][1:]).all()


@pytest.mark.slow
def test_a_length_that_is_far_off_is_said_to_fit_nothing() -> None:
    """A fixed length of twice the true one: trial motions stop, the fit ends with its warning."""
    with pytest.warns(UserWarning, match="^The fit is not usable, because"):
        assert fit(plain(), "quadratic", mass=MASS, length=1.5, free=()).solution.lost


def test_a_ball_that_can_not_swing_so_fast() -> None:
    with (pytest.warns(UserWarning, match="5 cm would be radius=0.05"),
          pytest.raises(SceneError, match=r"No length gives a bob of radius 5 m the recorded period of 1\.4\d s\.")):
        fit(plain(), "linear", mass=MASS, radius=5.0)


# --- least squares ---------------------------------------------------------------------------------------------------


class Decay:
    """A problem with a known answer: ``a exp(-b t) + c``, with ``c`` at least 0."""

    def __init__(self, readings: np.ndarray) -> None:
        self.time, self.readings, self.least = even(5.0, 20.0), readings, np.array([-math.inf, -math.inf, 0.0])

    def sizes(self, values: np.ndarray) -> np.ndarray:
        return np.ones(3)

    def residual(self, values: np.ndarray, ahead: bool = False) -> np.ndarray:
        a, b, c = values
        return self.readings - (a * np.exp(-b * self.time) + c)

    def slopes(self, values: np.ndarray, central: bool = False) -> np.ndarray:
        a, b, _ = values
        fall = np.exp(-b * self.time)
        return np.stack([fall, -a * self.time * fall, np.ones_like(fall)], axis=1)


@pytest.mark.parametrize("offset", [0.2, -0.1])
@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_the_search_and_the_last_steps_end_where_scipy_does(offset: float, loss: str) -> None:
    """Within a bound, which an offset below 0 reaches; the last steps are for least squares."""
    source = np.random.default_rng(0)
    problem = Decay(2.0 * np.exp(-0.7 * even(5.0, 20.0)) + offset + 0.01 * source.standard_normal(101))
    problem.readings[7] += 1.0
    truth = least_squares(lambda x: -problem.residual(x), [1.0, 1.0, 0.1], bounds=(problem.least, np.inf), loss=loss,
                          f_scale=0.02, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    start = np.array([1.0, 1.0, 0.1])
    rough = core.search(problem, start, {"ftol": 1e-9, "xtol": 1e-9}, loss, 0.02)
    np.testing.assert_allclose(rough, truth, atol=1e-4)
    if loss == "linear":
        near = truth + np.array([0.01, 0.01, 0.0])
        values, squares = core.refit(problem, near, problem.slopes(near))
        np.testing.assert_allclose(values, truth, atol=1e-6)
        assert squares == pytest.approx(float(np.sum(problem.residual(values) ** 2)), rel=1e-9)
    assert (rough[2] == 0.0) == (offset < 0.0)


def test_derivatives_are_those_of_the_formula() -> None:
    """One-sided ones to first order, central ones to second, and beside a bound within it."""
    problem, values = Decay(np.zeros(101)), np.array([2.0, 0.7, 0.0])
    steps, seen = np.full(3, 1e-3), []

    def simulate(rows: np.ndarray) -> np.ndarray:
        seen.append(rows[:, 2].min())
        return -np.array([problem.residual(row) for row in rows])

    for central, error in ((False, 2e-3), (True, 2e-6)):
        readings, slopes = core.derivatives(simulate, values, steps, problem.least, central)
        np.testing.assert_array_equal(readings, -problem.residual(values))
        assert np.abs(slopes - problem.slopes(values)).max() < error
    assert min(seen) == 0.0


def test_a_fit_is_a_result() -> None:
    """Its tables are those of its files, and pandas takes them."""
    found = fit(plain(), ["linear", "linear+quadratic"], mass=MASS)
    tables = found.to_dict()["tables"]
    assert set(tables) == {"parameters", "residuals", "models"}
    assert tables["parameters"]["columns"]["parameter"] == list(found.names)
    frame = found.to_pandas("residuals")
    np.testing.assert_allclose(frame["recorded_rad"] - frame["model_rad"], found.residual, atol=1e-15)
    assert frame.attrs["units"]["time_s"] == "s"
    assert found.origin()["recording"] == "virtual"
    assert found.table.head == ("parameter", "value", "unit")
