"""Numbers that were likely meant in another unit: degrees, centimetres, millimetres or grams."""

from __future__ import annotations

import math
import warnings

import gymnasium
import numpy as np
import pytest
import typer

from pendulum_env import SCENES, SceneError, fit, rollout
from pendulum_env.cli.options import AngleOrNone
from pendulum_env.lab.recording import Recording
from pendulum_env.physics import exact
from pendulum_env.physics.effects import Buoyancy, Gravity


@pytest.mark.parametrize("angle", [5, 10.0, 7.5, -4.5, [5.0, 10.0], 13.7])
def test_angles_that_were_meant_in_degrees(angle: float | list[float]) -> None:
    far = float(np.max(np.abs(angle)))
    with pytest.warns(UserWarning, match=rf"in radians: .*; -?{far:g} degrees would be -?{math.radians(far):.4g} rad"):
        rollout("vacuum", angle=angle, duration=0.1, backend="python")
    with pytest.warns(UserWarning, match="in radians"):
        gymnasium.make("LabPendulum-v0").reset(options={"angle": np.ravel(angle)[-1]})


@pytest.mark.parametrize("angle", [3.0, math.pi, -math.pi, 3.3, math.radians(355.0), np.arange(-6.0, 6.0, 0.5)])
def test_angles_that_are_no_mistake(angle: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rollout("vacuum", angle=angle, duration=0.1, backend="python")


def test_degrees_that_were_converted_are_not_taken_for_radians() -> None:
    with pytest.warns(UserWarning, match=r"An initial angle of 900 degrees is 2\.5 turns from the bottom\.") as seen:
        rollout("vacuum", angle=math.radians(900.0), duration=0.1, backend="python")
    assert len(seen) == 1


def received(degrees: float | None) -> float | None:
    """The angle that a command receives for an option of --angle."""
    command = typer.Typer(add_completion=False)
    angles: list[float | None] = []

    @command.command()
    def told(angle: AngleOrNone = None) -> None:
        angles.append(angle)

    command([] if degrees is None else ["--angle", str(degrees)], standalone_mode=False)
    return angles[0]


@pytest.mark.parametrize(("degrees", "meant"), [(0.0873, 5), (0.5236, 30), (-1.5708, -90), (1.57, 90), (0.7854, 45)])
def test_radians_on_the_command_line(degrees: float, meant: int) -> None:
    with pytest.warns(UserWarning, match=f"command line are in degrees: {degrees:g} rad would be {meant} degrees"):
        assert received(degrees) == math.radians(degrees)


@pytest.mark.parametrize("degrees", [None, 0.0, 0.1, 0.2, 0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 5.0, 30.0, 90.0, 180.0])
def test_small_degrees_on_the_command_line(degrees: float | None) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert received(degrees) == (None if degrees is None else math.radians(degrees))


SENTENCES = {
    "length is in m, and 35.3 m is unusual for a pendulum; 35.3 cm would be length=0.353.": {"length": 35.3},
    "length is in m, and 353 m is unusual for a pendulum; 353 mm would be length=0.353.": {"length": 353.0},
    "mass is in kg, and 40 kg is unusual for a pendulum; 40 g would be mass=0.04.": {"mass": 40.0},
    "radius is in m, and 1.07 m is unusual for a pendulum; 1.07 cm would be radius=0.0107.": {
        "radius": 1.07, "length": 3.0},
    "radius is in m, and 10.7 m is unusual for a pendulum; 10.7 mm would be radius=0.0107.": {
        "radius": 10.7, "length": 30000.0},
    "gravity is in m/s^2, and 981 m/s^2 is unusual for a pendulum; 981 cm/s^2 would be gravity=9.81.": {
        "gravity": 981.0},
}


@pytest.mark.parametrize("sentence", SENTENCES)
def test_sizes_that_were_meant_in_another_unit(sentence: str) -> None:
    numbers = SENTENCES[sentence]
    with pytest.warns(UserWarning, match="is unusual for a pendulum") as seen:
        rollout("exercise", duration=0.1, backend="python", **numbers)
    assert sentence in [str(one.message) for one in seen]


@pytest.mark.parametrize("numbers", [
    {"length": 9.9}, {"length": 5000.0}, {"mass": 19.0}, {"mass": 1e9}, {"gravity": 24.8}, {"gravity": 274.0},
    {"length": 1e-3, "radius": 1e-4}, {"mass": 1e-3},
])
def test_unusual_sizes_without_a_better_unit(numbers: dict[str, float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rollout("exercise", duration=0.001, dt=1e-4, backend="python", **numbers)


@pytest.mark.parametrize(("numbers", "said"), [
    ({"mass": 40.0, "radius": 10.7}, r"C_d cannot be derived.* Perhaps a unit is mistaken: mass is in kg, .* 40 g "
                                     r"would be mass=0.04\. radius is in m, .* 10.7 mm would be radius=0.0107\."),
    ({"radius": 20.0}, r"would float in air.* Perhaps a unit is mistaken: radius is in m, .* would be radius=0.02\."),
    ({"radius": 0.29}, r"would float in air, where it displaces [\d.]+ kg; a pendulum has to hang\.$"),
])
def test_a_refused_scene_names_the_unit_that_was_perhaps_meant(numbers: dict[str, float], said: str) -> None:
    scene = "lab" if "mass" in numbers else SCENES["lab"].with_effects((Gravity(), Buoyancy()))
    with pytest.raises(SceneError, match=said):
        rollout(scene, backend="python", **numbers)


@pytest.mark.slow
def test_a_fit_names_grams_and_centimetres() -> None:
    time = np.arange(0.0, 8.0, 0.05)
    angle, _ = exact.linear(time, 0.2, 0.0, SCENES["exercise"].omega0, 0.02)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fit(Recording(time, angle, "made.txt"), "linear", mass=40.0, radius=1.07, length=3.0, free=("gravity",))
    said = " ".join(str(one.message) for one in seen)
    assert "40 g would be mass=0.04." in said
    assert "1.07 cm would be radius=0.0107." in said
