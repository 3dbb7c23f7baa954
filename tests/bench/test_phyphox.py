"""The source `phyphox` against a local server written after the app's documentation: motion, faults, refusals."""

from __future__ import annotations

import math
import re
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from acquiring import GAMMA, LENGTH, Swing, recorded
from false_phone import ACCELEROMETER, LINEAR, MAGNETOMETER, FalsePhone
from numpy.typing import NDArray

from pendulum_env.bench.source import SourceError
from pendulum_env.bench.sources import phyphox
from pendulum_env.bench.sources.phyphox import Phyphox
from pendulum_env.lab import Recording, fit
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]
GRAVITY = 9.81  # of the scene behind


@pytest.fixture(scope="module")
def swing() -> Swing:
    return Swing(120.0)


def gyroscope(swing: Swing, seed: int = 1) -> Callable[[Array], Array]:
    """A phone's angular velocities: a leaning axis, a bias on each, noise."""
    noise = np.random.default_rng(seed)
    lean = np.array([0.1, math.sqrt(1.0 - 0.0125), 0.05])
    return lambda at: (np.outer(swing.velocity(at), lean) + [0.01, -0.005, 0.003]
                       + 0.004 * noise.standard_normal((len(at), 3)))


def accelerometer(swing: Swing, tilt: float = 0.05) -> Callable[[Array], Array]:
    """A phone that is the bob: along the rod it feels g cos(theta) + L omega², across it g sin(theta) + L alpha."""
    noise = np.random.default_rng(2)

    def felt(at: Array) -> Array:
        angle, velocity, acceleration = swing.angle(at), swing.velocity(at), swing.acceleration(at)
        across = GRAVITY * np.sin(angle) + LENGTH * acceleration
        along = GRAVITY * np.cos(angle) + LENGTH * velocity**2
        axes = [math.cos(tilt) * across - math.sin(tilt) * along, math.sin(tilt) * across + math.cos(tilt) * along]
        return np.stack([*axes, np.zeros(len(at))], 1) + 0.02 * noise.standard_normal((len(at), 3))

    return felt


def ramp(at: Array) -> Array:
    """Readings that tell their own true time: t, 2 t, 3 t."""
    return np.outer(at, [1.0, 2.0, 3.0])


class Taken:
    """Samples that are read from a source until enough came."""

    def __init__(self, source: Phyphox) -> None:
        self.source, self.time, self.values, self.lost = source, np.empty(0), np.empty((0, 3)), 0

    def more(self, count: int = 1, longest: float = 10.0) -> Taken:
        """Wait for ``count`` more samples."""
        wanted, until = len(self.time) + count, time.monotonic() + longest
        while len(self.time) < wanted:
            assert time.monotonic() < until, (len(self.time), wanted, self.source.problem)
            chunk = self.source.read(0.05)
            if len(chunk.values):
                assert chunk.time is not None
                self.time = np.append(self.time, chunk.time)
                self.values = np.vstack([self.values, chunk.values])
            self.lost += chunk.lost
        return self

    def refusal(self, longest: float = 10.0) -> str:
        """The sentence with which the source gives up."""
        until = time.monotonic() + longest
        while time.monotonic() < until:
            try:
                self.source.read(0.05)
            except SourceError as refused:
                return str(refused)
        raise AssertionError("it was not given up")


def passed(condition: Callable[[], Any], longest: float = 5.0) -> None:
    until = time.monotonic() + longest
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


# --- a recording fits the scene behind it ----------------------------------------------------------------------------


def check_fit(recording: Recording, most: float) -> None:
    found = fit(recording, "linear", mass=1.0).parameters
    for name, truth in (("length", LENGTH), ("linear_drag.gamma", GAMMA)):
        assert abs(found[name].value - truth) < 4.0 * found[name].error, (name, found[name])
        assert found[name].error < most * truth


@pytest.mark.slow
def test_a_gyroscope_of_a_phone_fits_the_scene_behind_it(swing: Swing, tmp_path: Path) -> None:
    with FalsePhone(gyroscope(swing), speed=60.0) as phone:
        source = Phyphox(phone.host, every=0.02)
        recording = recorded(source, tmp_path / "swing.csv", 15.0)
        assert source.quantity == "rate"
        assert recording.rate is not None
        assert "Gyroscope y (rad/s)" in (tmp_path / "swing.csv").read_text("utf-8")
        np.testing.assert_allclose(np.diff(recording.time), 0.01, atol=2e-5)  # nothing lost, the phone's own clock
        assert phone.kept_alive == 0
        assert {path.split("?")[0] for path in phone.requests} == {"/config", "/get", "/time", "/control"}
        assert phone.requests[-1] == "/control?cmd=stop"
        assert not phone.measuring
    check_fit(recording, 2e-3)


@pytest.mark.slow
def test_an_accelerometer_of_a_phone_fits_the_scene_behind_it(swing: Swing, tmp_path: Path) -> None:
    with FalsePhone(accelerometer(swing), sensor=ACCELEROMETER, speed=60.0) as phone:
        source = Phyphox(phone.host, every=0.02)
        recording = recorded(source, tmp_path / "swing.csv", 15.0)
    assert source.quantity == "force"
    assert recording.force is not None
    check_fit(recording, 2e-2)
    distance = fit(recording, "linear", mass=1.0).parameters["sensor_distance"]
    assert abs(distance.value - LENGTH) < 4.0 * distance.error


# --- faults ----------------------------------------------------------------------------------------------------------


def test_closed_connections_and_buffers_of_unequal_length_lose_nothing() -> None:
    with FalsePhone(ramp, speed=10.0) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(20)
        phone.dropped, phone.lagging = 3, 7
        taken.more(100)
        phone.lagging, phone.repeats = 0, True
        phone.dropped = 2
        taken.more(100)
        source.close()
    np.testing.assert_allclose(np.diff(taken.time), 0.01, atol=1e-6)
    np.testing.assert_allclose(taken.values @ [1.0, -0.5, 0.0], 0.0, atol=1e-5)  # rows belong together
    np.testing.assert_allclose(taken.values[:, 2], 3.0 * taken.values[:, 0], atol=1e-5)
    assert taken.lost == 0
    assert source.notes == ("phone: gyroscope of the experiment 'Gyroscope'",)


def test_a_phone_that_sleeps_is_waited_for_and_catches_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phyphox, "QUIET", 0.1)
    with FalsePhone(ramp) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(5)
        phone.asleep = True
        passed(lambda: source.problem)
        assert source.problem.startswith("the phone has not answered for ")
        began = time.monotonic()
        source.read(0.05)  # in the time that was given
        assert time.monotonic() - began < 1.0
        phone.asleep = False
        taken.more(30)
        source.close()
    assert source.problem == ""
    np.testing.assert_allclose(np.diff(taken.time), 0.01, atol=1e-6)
    assert taken.lost == 0
    assert re.fullmatch(r"phone: 1 times without an answer, \d\.\d s at most; what it had measured came later",
                        source.notes[-1])


def test_a_phone_that_never_answers_again_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    with FalsePhone(ramp) as phone:
        source = Phyphox(phone.host, every=0.01, patience=0.2)
        source.open()
        taken = Taken(source).more(1)
        phone.asleep = True
        assert re.match(r"The phone has not answered for 0 s \(.+\); wake it, keep phyphox open, and start again",
                        taken.refusal())
        phone.asleep = False
        source.close()
        source.close()


def test_a_pause_is_added_to_the_phones_times() -> None:
    """The experiment's clock leaves pauses out, but the pendulum swings on."""
    with FalsePhone(ramp, speed=10.0) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(50)
        phone.pause()
        passed(lambda: source.problem)
        assert source.problem == "the measurement is paused on the phone; press start there"
        time.sleep(0.1)
        phone.start()
        taken.more(50)
        source.close()
    gap = float(np.max(np.diff(taken.values[:, 0])))
    assert gap > 1.0
    np.testing.assert_allclose(taken.time - taken.time[0], taken.values[:, 0] - taken.values[0, 0], atol=2e-5)
    assert re.fullmatch(r"phone: paused for \d\.\d s, which are added to its times", source.notes[-1])
    assert taken.lost == 0


def test_a_pause_of_an_old_app_that_tells_none_ends_the_run() -> None:
    with FalsePhone(ramp, times=False) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(5)
        phone.pause()
        passed(lambda: source.problem)
        phone.start()
        assert "(before 1.1.8) does not tell for how long; start again here" in taken.refusal()
        source.close()


def test_a_sensor_that_stalls_is_told_and_its_gap_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phyphox, "QUIET", 0.05)
    with FalsePhone(ramp, speed=10.0) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(100)
        phone.stalled = True
        passed(lambda: source.problem)
        assert "its sensor gives no samples" in source.problem
        phone.stalled = False
        taken.more(20)
        source.close()
    assert taken.lost == round(float(np.max(np.diff(taken.time))) / 0.01) - 1 > 0


@pytest.mark.slow
def test_measurements_that_are_cleared_or_replaced_end_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phyphox, "QUIET", 0.05)
    with FalsePhone(ramp) as phone:
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(50)
        phone.clear()
        phone.start()
        assert "was cleared on the phone" in taken.refusal()
        source.close()
        phone.start()
        source = Phyphox(phone.host, every=0.01)
        source.open()
        taken = Taken(source).more(5)
        phone.session = "another"
        assert taken.refusal() == "Another experiment was opened on the phone; start again here"
        source.close()
        assert phone.measuring  # it was started by hand, so it goes on


def test_a_measurement_that_runs_is_joined_at_its_end() -> None:
    with FalsePhone(ramp, speed=10.0) as phone:
        phone.start()
        time.sleep(0.1)
        source = Phyphox(phone.host)
        began = phone.now()
        source.open()
        taken = Taken(source).more(5)
        source.close()
        assert taken.values[0, 0] > began - 0.02
        assert phone.measuring
        assert not any(path.startswith("/control") for path in phone.requests)


def test_readings_that_are_no_numbers_are_passed_on_as_such() -> None:
    with FalsePhone(lambda at: np.stack([at, np.where(at > 0.2, np.nan, at), at], 1)) as phone:
        source = Phyphox(phone.host)
        source.open()
        taken = Taken(source).more(30)
        source.close()
    assert np.isnan(taken.values[-1, 1])
    assert np.isfinite(taken.time).all()


# --- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sensor", "wanted", "listed", "said"), [
    (MAGNETOMETER, None, True, "'Magnetometer' has no gyroscope or accelerometer with times (it reads magnetic field); "
                               "open 'Gyroscope (rotation rate)' or 'Acceleration with g' in phyphox"),
    (LINEAR, None, True, "(it reads linear acceleration; linear acceleration is without g); open"),
    (ACCELEROMETER, "gyroscope", True, "has no gyroscope with times (it reads accelerometer); open 'Gyroscope"),
    (MAGNETOMETER, None, False, "(it reads no sensor)"),
])
def test_an_experiment_without_a_usable_sensor_is_refused(sensor: Any, wanted: str | None, listed: bool,
                                                          said: str) -> None:
    with FalsePhone(ramp, sensor=sensor, listed=listed) as phone, pytest.raises(SourceError, match=re.escape(said)):
        Phyphox(phone.host, sensor=wanted).open()


def test_a_wrong_host_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    monkeypatch.setattr(phyphox, "PORTS", (port, port))  # without a port, both are tried
    for host, ports in ((f"127.0.0.1:{port}", 1), ("127.0.0.1", 2)):
        with pytest.raises(SourceError) as refused:
            Phyphox(host).open()
        assert str(refused.value).count(f"port {port}: connection refused") == ports
        assert "choose 'Allow remote access' in phyphox, give the address that it shows" in str(refused.value)
    with pytest.raises(SourceError, match=r"^phyphox needs an address, as phyphox:192"):
        Phyphox().open()


def test_without_a_port_the_second_one_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    with FalsePhone(ramp) as phone, socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setattr(phyphox, "PORTS", (free.getsockname()[1], phone.port))
        source = Phyphox("http://127.0.0.1/")
        source.open()
        Taken(source).more(1)
        source.close()


@pytest.mark.parametrize("answer", [b"<html>a printer</html>", b"{}", b"[1]", b"\xff\xfe"])
def test_what_is_not_phyphox_is_refused(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        def serve() -> None:
            connection, _ = server.accept()
            connection.recv(4096)
            connection.sendall(b"HTTP/1.0 200 OK\r\n\r\n" + answer)
            connection.close()

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(SourceError, match="is not phyphox, or one too old"):
            Phyphox(f"127.0.0.1:{server.getsockname()[1]}").open()


@pytest.mark.parametrize("host", ["", "127.0.0.1:99999", "a b", "127.0.0.1:x", 5, "evil\r\nhost"])
def test_addresses_that_are_none_are_refused(host: Any) -> None:
    with pytest.raises(SceneError, match=r"^host must be the address that the app shows, as 192\.168"):
        Phyphox(host)
