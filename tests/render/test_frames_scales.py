"""Scales of panels include all values, and nothing is drawn at a wrong place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from lettering import inked, overlaps

from pendulum_env import SCENES, Scene
from pendulum_env.engine.spec import RunSpec
from pendulum_env.films import orbit, picture
from pendulum_env.films.runs import track_of
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.units import si
from pendulum_env.render import Apparatus, FrameStyle, Orbits, PastSamples, View, frame
from pendulum_env.render.layout import Box
from pendulum_env.render.palette import LIGHT
from pendulum_env.render.portrait import wide_enough
from pendulum_env.render.strip import History, recent
from pendulum_env.render.text import MINUS

ROD = Apparatus(length=0.353, bob_radius=0.0107)
BLUE = "#0072B2"


def texts(monkeypatch: pytest.MonkeyPatch, view: View, panel: str, size: Any = 600) -> list[str]:
    written = inked(monkeypatch, lambda: frame(ROD, view, size, FrameStyle("light", (panel,))))
    assert not overlaps(written)
    return [text for text, *_ in written]


def blue(view: View) -> Any:
    """Return rows and columns of the blue pixels in a phase portrait, in a frame of 440 x 500 pixels."""
    image = frame(ROD, view, (440, 500), FrameStyle("light", ("phase",))).astype(float)
    return np.nonzero(image[..., 2] - image[..., 0] > 60)


# --- the phase portrait ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "velocity", "labels"), [
    (0.5, 2.0, ("±10 rad/s", "90°")), (0.5, 37.0, ("±40 rad/s", "90°")), (0.5, -1.23e5, ("±1.5e+05 rad/s", "90°")),
    (-20.0, 2.0, ("±10 rad/s", "1500°")), (1e9, 2.0, ("±10 rad/s", "8e+10°")), (1e300, -1e300, ())])
def test_a_portrait_goes_as_far_as_the_run(
    angle: float, velocity: float, labels: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    curves = Orbits(angle_reach=0.5 * math.pi, velocity_reach=10.0, periodic=False)
    view = View(1.0, angle, velocity, curves=curves)
    assert set(labels) <= set(texts(monkeypatch, view, "phase"))
    before = PastSamples(np.array([0.5]), np.array([angle]), np.array([velocity]))
    assert set(labels) <= set(texts(monkeypatch, View(1.0, 0.0, curves=curves, past=before), "phase"))


def test_the_portraits_reaches_hold_what_was_and_what_is() -> None:
    curves = Orbits(angle_reach=0.1, velocity_reach=0.5)
    for angle, velocity in ((0.05, 0.2), (0.3, 9.0), (-3.1, 0.1), (2e9, -1e30)):
        widened = wide_enough(View(1.0, angle, velocity, curves=curves))
        assert widened.velocity_reach >= abs(velocity)
        assert min(math.pi, max(0.1, abs(math.remainder(angle, 2 * math.pi)))) <= widened.angle_reach <= math.pi


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_line_goes_up_to_both_sides_where_it_goes_round(way: float) -> None:
    """A step from 150° to 210° is drawn at both sides of a portrait that ends at 180°, and nowhere between."""
    angles = way * np.array([math.radians(150.0), math.radians(210.0)])
    over = PastSamples(np.array([0.9]), angles[:1], np.array([8.0]))
    _, columns = blue(View(1.0, angles[1], 8.0, past=over, curves=Orbits(velocity_reach=10.0)))
    left, right = columns.min(), columns.max()
    assert right - left > 410
    inside = (columns - left) / (right - left)
    assert not ((inside > 0.15) & (inside < 0.85)).any()
    assert (inside < 0.02).any()
    assert (inside > 0.98).any()


@dataclass(frozen=True)
class Spring(Effect):
    spring: float = si(0.01, "N m/rad", "torque over angle", least=0.0)

    name = "spring"
    kind = "conservative"
    periodic = False
    torque = staticmethod(lambda angle, own_rate: -own_rate * angle)
    potential = staticmethod(lambda angle, own_rate: 0.5 * own_rate * angle * angle)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"own_rate": self.spring / scene.inertia}


def test_orbits_are_shown_only_where_they_are_known() -> None:
    for name in ("vacuum", "exercise"):
        scene = SCENES[name]
        assert orbit.curves(scene, 0.01).orbit
        drawn = orbit.curves(scene.with_effects((*scene.effects, Spring())), 0.01)
        assert not any((drawn.orbit, drawn.separatrix, drawn.notes))


@pytest.mark.quick("exercise_large-orbit without losses", "kapitza-orbit without losses and drives")
@pytest.mark.parametrize(("scene", "note"), [
    ("vacuum", "exact orbit"), ("textbook", "exact orbit"), ("exercise_large", "orbit without losses"),
    ("windy", "orbit without losses and drives"), ("kapitza", "orbit without losses and drives")])
def test_a_portrait_says_what_its_orbit_is(scene: str, note: str, monkeypatch: pytest.MonkeyPatch) -> None:
    curves = orbit.curves(SCENES[scene], 0.01)
    assert curves.notes[0] == note
    assert note in texts(monkeypatch, View(0.0, 0.1, curves=curves), "phase", 900)
    assert set(curves.notes) & set(texts(monkeypatch, View(0.0, 0.1, curves=curves), "phase", (240, 500)))
    assert not orbit.curves(SCENES[scene], 0.0).notes


def test_small_swings_are_looked_at_from_near_unless_something_drives_them() -> None:
    for name, near in (("vacuum", True), ("clock_bob", True), ("lab", False), ("driven", False)):
        scene = SCENES[name]
        stiffness = scene.inertia * scene.coefficients["gravity_rate"]
        narrow, wide = (orbit.curves(scene, stiffness * (1 - math.cos(amplitude))) for amplitude in (0.02, 0.3))
        reach = max(np.abs(line[:, 0]).max() for line in narrow.orbit)
        assert reach == pytest.approx(0.02, rel=1e-3)
        assert (narrow.angle_reach < 1.5 * reach) == near
        assert wide.angle_reach == math.pi


# --- energies over time ----------------------------------------------------------------------------------------------


def history(kinetic: float, work: float, scale: float) -> View:
    """Return a view whose energies jump to the given values."""
    time, one = np.linspace(0.0, 9.9, 100), np.ones(100)
    past = PastSamples(time, 0 * one, 0 * one, kinetic * one, 0 * one, 0 * one, work * one, 0 * one)
    return View(10.0, 0.0, kinetic=kinetic, work=work, residual=0.0, past=past, energy_scale=scale)


@pytest.mark.parametrize(("kinetic", "work", "labels"), [
    (0.3, 0.1, {"277 mJ", "0 J"}), (0.1, -0.05, {"277 mJ", "0 J"}), (0.0, 0.0, {"277 mJ", "0 J"}),
    (0.004, 0.0, {"5.00 mJ", "0 J"}), (30.0, 0.0, {"50.0 J", "0 J"}), (math.inf, 0.3, {"277 mJ", "0 J"}),
    (0.1, -0.3, {"500 mJ", "0 J", f"{MINUS}500 mJ"}), (0.01, -0.05, {"50.0 mJ", "0 J", f"{MINUS}50.0 mJ"})])
def test_energies_are_on_the_bars_scale_or_on_one_that_holds_them(
    kinetic: float, work: float, labels: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert labels == {text for text in texts(monkeypatch, history(kinetic, work, 0.277), "history") if "J" in text}


@pytest.mark.parametrize("energies", [(0.3, 0.1), (0.004, 0.0), (30.0, 0.0), (0.1, -0.3), (1e-9, -0.05)])
def test_a_history_leaves_its_plot_nowhere(energies: tuple[float, float]) -> None:
    view = history(*energies, 0.277)
    panel = History(Box(0, 0, 400, 200), 15, LIGHT, True, ("kinetic", "work"), True)
    scale, zero, unit = panel.axis(view, [recent(view, name) for name in panel.names])
    for energy in energies:
        assert panel.plot.top < zero - energy / scale * unit < panel.plot.bottom


# --- the apparatus ---------------------------------------------------------------------------------------------------


def test_the_arrow_is_the_torque_of_a_motor_that_lags(monkeypatch: pytest.MonkeyPatch) -> None:
    """The arrow shows the mean of 1 - exp(-t / lag) over the last control step."""
    shown: list[Any] = []
    monkeypatch.setattr(picture, "drawn", lambda _, view, *_more: shown.append(view) or np.zeros((50, 50, 3)))
    env = gym.make("LabPendulum-v0", lag=0.5, dt=0.1, render_mode="rgb_array", backend="python").unwrapped
    env.reset(seed=0)
    env.render()
    for _ in range(3):
        env.step(np.array([1.0], dtype=np.float32))
        env.render()
    edges = np.exp(-np.arange(4) * 0.1 / 0.5)
    expected = [0.0, *(1.0 + 0.5 / 0.1 * np.diff(edges))]
    np.testing.assert_allclose([view.torque_share for view in shown], expected, rtol=1e-12)


def test_a_films_arrow_is_the_torque_of_a_motor_that_lags() -> None:
    time = 0.1 * np.arange(4)
    spec = RunSpec.of(SCENES["lab"].replace(lag=0.5), angle=0.0, velocity=0.0, dt=0.1, control=-1.0, backend="python")
    track = track_of(spec, spec.machine(), time, FrameStyle(), label="", title="", accent=None)
    shown = [track.view(time, i, False).torque_share for i in range(4)]
    np.testing.assert_allclose(shown, np.exp(-time / 0.5) - 1.0, rtol=1e-12)


@pytest.mark.parametrize(("scene", "radius"), [("clock_bob", 0.003), ("exercise", 0.00015), ("lab", 0.001)])
def test_a_suspension_is_as_thick_as_the_bodys(scene: str, radius: float) -> None:
    assert picture.apparatus(SCENES[scene]).rod_radius == pytest.approx(radius)


def test_a_reading_of_nothing_has_no_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    written = texts(monkeypatch, View(0.0, -1e-5, -1e-3), "apparatus", (900, 500))
    assert {"θ = 0.0°", "ω = 0.00 rad/s"} <= set(written)
