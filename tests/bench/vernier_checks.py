"""The source `vernier`: the library godirect above a false USB device, which answers by Go Direct's packets.

Run in an environment that has godirect. What the packets hold is taken from how the library reads them.
"""

from __future__ import annotations

import asyncio
import re
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from acquiring import GAMMA, LENGTH, Swing, recorded

from pendulum_env.bench.source import SourceError
from pendulum_env.bench.sources import vernier
from pendulum_env.bench.sources.vernier import Vernier
from pendulum_env.lab import fit


class Sensor(NamedTuple):
    """A channel: number, description, unit, least period [us], and its readings at a time [s]."""

    number: int
    description: str
    unit: str
    reads: Callable[[float], float]
    least: int = 10_000
    excludes: int = 0


def zero(_: float) -> float:
    return 0.0


class Device:
    """A Go Direct sensor on USB; its clock runs ``speed`` times faster than ours."""

    def __init__(self, name: str, sensors: list[Sensor], *, speed: float = 1.0) -> None:
        self.name, self.sensors, self.speed = name, sensors, speed
        self.answers: list[bytes] = []
        self.period, self.mask, self.began, self.sent = 0.1, 0, 0.0, 0
        self.running, self.unplugged, self.silent, self.dropping, self.closed = False, False, False, False, False

    def open_path(self, path: bytes) -> None:
        if self.unplugged:
            raise OSError("open failed")

    def close(self) -> None:
        self.closed = True

    def write(self, packet: list[int]) -> None:
        assert len(packet) == 65
        if self.unplugged:
            raise OSError("write error")
        command = bytes(packet[2:2 + packet[1]])
        assert command[0] == 0x58
        assert (sum(command) - command[3]) % 256 == command[3]  # the library's checksum
        payload = b""
        if command[4] == 0x10:
            payload = struct.pack("<BBBBHBBHBB", 0, 0, 1, 2, 3, 1, 2, 3, 90, 0)
        elif command[4] == 0x55:
            payload = struct.pack("<16s16s32sHHBBBBHBBHBBBBBBI64s", self.name.split()[0].encode(), b"0K100123",
                                  self.name.encode(), 1, 2024, 5, 6, 1, 2, 3, 1, 2, 3, 1, 2, 3, 4, 5, 6, 0, b"a sensor")
        elif command[4] == 0x51:
            payload = struct.pack("<I", sum(1 << one.number for one in self.sensors))
        elif command[4] == 0x50:
            one = next(one for one in self.sensors if one.number == command[5])
            payload = struct.pack("<bBIBB60s32sdddIQIII", one.number, 0, 7, 0, 0, one.description.encode(),
                                  one.unit.encode(), 0.001, -1e3, 1e3, one.least, 10_000_000, 100_000, 1000,
                                  one.excludes)
        elif command[4] == 0x1B:
            self.period = 1e-6 * struct.unpack("<I", command[7:11])[0]
        elif command[4] == 0x18:
            self.mask, = struct.unpack("<I", command[7:11])
            self.running, self.began, self.sent = True, time.monotonic(), 0
        elif command[4] == 0x19:
            self.running = False
        body = bytes([0x98, 6 + len(payload), 0, 0, command[4], 0]) + payload
        self.answers += [bytes([64]) + body[i:i + 64].ljust(64, b"\0") for i in range(0, len(body), 64)]

    def read(self, size: int, timeout: float) -> list[int]:
        assert size == 65
        until = time.monotonic() + 1e-3 * timeout
        while time.monotonic() < until:
            if self.unplugged:
                raise OSError("read error")
            if self.answers:
                return list(self.answers.pop(0))
            due = int((time.monotonic() - self.began) * self.speed / self.period)
            if self.running and not self.silent and due >= self.sent + 2:
                at = [self.period * self.sent, self.period * (self.sent + 1)]
                self.sent += 2
                if self.dropping:
                    continue
                used = [one for one in self.sensors if self.mask >> one.number & 1]
                data = b"".join(struct.pack("<f", one.reads(t)) for t in at for one in used)
                packet = bytes([0x20, 9 + len(data), 0, 0, 0x06]) + struct.pack("<HBB", self.mask, 2, 0) + data
                return list(bytes([len(packet)]) + packet.ljust(64, b"\0"))
            time.sleep(0.0005)
        return []


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> list[Device]:
    """Devices that are found by USB; none by Bluetooth."""
    devices: list[Device] = []
    hid: Any = ModuleType("hid")
    hid.enumerate = lambda vid, pid: [{"path": str(i).encode(), "product_string": one.name}
                                      for i, one in enumerate(devices) if (vid, pid) == (0x08F7, 0x0010)]
    hid.device = lambda: devices[-1]
    for name in ("godirect.backend_usb", "godirect.device_usb"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "hid", hid)

    async def discover(**_: Any) -> dict[str, Any]:
        await asyncio.sleep(0.0)
        return {}

    monkeypatch.setattr("bleak.BleakScanner.discover", discover)
    return devices


def rotary(swing: Swing, **more: Any) -> Device:
    """A rotary motion sensor of 0.25°, which has its angle in radians, too."""
    step = np.pi / 720.0
    return Device("GDX-RMS 0K100123", [
        Sensor(1, "Angle", "rad", lambda t: float(np.round(swing.angle(np.array(t)) / step) * step)),
        Sensor(2, "Angular velocity", "rad/s", zero), Sensor(3, "Angular acceleration", "rad/s²", zero),
        Sensor(4, "Position", "m", zero)], **more)


def imu(swing: Swing, **more: Any) -> Device:
    """An acceleration sensor with a gyroscope and a tilt, whose readings swing."""
    axes = [Sensor(i + 1, f"{axis}-axis acceleration", "m/s²", zero) for i, axis in enumerate("XYZ")]
    gyro = [Sensor(i + 5, f"{axis}-axis gyro", "rad/s",
                   lambda t, share=share: share * float(swing.velocity(np.array(t))) + 0.01)
            for i, (axis, share) in enumerate(zip("XYZ", (0.6, 0.8, 0.0), strict=True))]
    return Device("GDX-ACC 0K200456", [*axes, *gyro, Sensor(9, "Angle", "°", zero)], **more)


@pytest.fixture(scope="module")
def swing() -> Swing:
    return Swing(60.0)


def check_fit(recording: Any) -> None:
    found = fit(recording, "linear", mass=1.0).parameters
    for name, truth in (("length", LENGTH), ("linear_drag.gamma", GAMMA)):
        assert abs(found[name].value - truth) < 4.0 * found[name].error, (name, found[name])
        assert found[name].error < 0.05 * truth


def test_a_rotary_motion_sensor_fits_the_scene_behind_it(plugged: list[Device], swing: Swing, tmp_path: Path) -> None:
    plugged.append(rotary(swing, speed=10.0))
    source = Vernier()
    recording = recorded(source, tmp_path / "swing.csv", 20.0)
    assert source.columns == ("Angle (rad)",)
    np.testing.assert_allclose(np.diff(recording.time), 0.02, atol=2e-6)
    assert not recording.indirect
    assert source.notes[0] == "vernier: Angle of GDX-RMS 0K100123, 50 readings per second by its own clock"
    check_fit(recording)
    assert plugged[0].closed
    assert not plugged[0].running


def test_a_gyroscope_fits_the_scene_behind_it(plugged: list[Device], swing: Swing, tmp_path: Path) -> None:
    """It is preferred to the tilt, which gravity shows and a swing hides."""
    plugged.append(imu(swing, speed=10.0))
    source = Vernier(rate=100.0)
    recording = recorded(source, tmp_path / "swing.csv", 20.0)
    assert source.quantity == "rate"
    assert source.columns == tuple(f"Angular velocity {axis} (rad/s)" for axis in "xyz")
    assert recording.rate is not None
    assert recording.time[1] - recording.time[0] == pytest.approx(0.01, abs=2e-6)
    found = fit(recording, "linear", mass=1.0).parameters
    assert found["length"].value == pytest.approx(LENGTH, rel=1e-4)  # no noise but of single precision
    assert found["linear_drag.gamma"].value == pytest.approx(GAMMA, rel=1e-3)


def test_the_rate_is_one_that_the_sensor_can_give_and_a_channel_can_be_chosen(plugged: list[Device],
                                                                               swing: Swing) -> None:
    plugged.append(imu(swing))
    source = Vernier("acc", rate=1e4, channel="y-axis acc")
    source.open()
    source.close()
    assert source.columns == ("Acceleration y (m/s^2)",)
    assert source.quantity == "force"
    assert "100 readings per second" in source.notes[0]
    assert plugged[0].mask == 1 << 2


def taken(source: Vernier, seconds: float) -> tuple[np.ndarray[Any, Any], int]:
    until, times, lost = time.monotonic() + seconds, [np.empty(0)], 0
    while time.monotonic() < until:
        chunk = source.read(0.05)
        if chunk.time is not None:
            times.append(chunk.time)
        lost += chunk.lost
    return np.concatenate(times), lost


def test_packets_lost_on_the_way_show_in_the_times(plugged: list[Device], swing: Swing,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vernier, "WINDOW", 0.3)
    plugged.append(rotary(swing))
    source = Vernier(rate=100.0)
    source.open()
    before, lost = taken(source, 1.5)
    assert lost == 0
    plugged[0].dropping = True
    taken(source, 0.5)
    plugged[0].dropping = False
    after, lost = taken(source, 1.5)
    source.close()
    assert lost == pytest.approx(50, abs=6)
    assert after[-1] - before[0] == pytest.approx(3.5, abs=0.1)
    assert re.fullmatch(r"vernier: about \d+ readings lost on the way", source.notes[-1])


def refusal(source: Vernier) -> str:
    with pytest.raises(SourceError) as refused:
        source.open()
    source.close()
    return str(refused.value)


def lost(source: Vernier) -> str:
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        try:
            source.read(0.05)
        except SourceError as error:
            source.close()
            return str(error)
    raise AssertionError("not lost")


def test_a_device_that_is_unplugged_or_falls_silent_is_lost(plugged: list[Device], swing: Swing,
                                                            monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vernier, "PATIENCE", 0.5)
    monkeypatch.setattr(vernier, "PACKET", 100)
    plugged.append(rotary(swing))
    source = Vernier()
    source.open()
    plugged[0].unplugged = True
    assert lost(source) == "The Go Direct sensor was lost (read error); connect it again and start again"
    plugged[0] = rotary(swing)
    source.open()
    plugged[0].silent = True
    assert lost(source) == ("The Go Direct sensor has sent nothing for 0.5 s; switch it on, connect it again and "
                            "start again")


def test_no_wrong_and_several_devices_are_refused(plugged: list[Device], swing: Swing,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    assert refusal(Vernier()).startswith("No Go Direct sensor was found by USB or Bluetooth; switch it on")

    async def none(**_: Any) -> None:
        raise OSError("no radio")

    with monkeypatch.context() as patch:
        patch.setattr("bleak.BleakScanner.discover", none)
        assert "; Bluetooth does not answer (no radio); " in refusal(Vernier())
    plugged += [rotary(swing), imu(swing)]
    assert refusal(Vernier()) == ("There are 2 Go Direct sensors (GDX-RMS 0K100123, GDX-ACC 0K200456); name one of "
                                  "them, as vernier:GDX-RMS")
    assert refusal(Vernier("GDX-TMP")).startswith("No Go Direct sensor named 'GDX-TMP' was found")
    plugged[:] = [Device("GDX-TMP 1", [Sensor(1, "Temperature", "°C", zero)])]
    assert refusal(Vernier()) == ("GDX-TMP 1 measures no angle, angular velocity or acceleration in a known unit, but "
                                  "Temperature (°C); connect a rotary motion sensor, or one with a gyroscope")


def test_a_device_that_does_not_open_is_refused(plugged: list[Device], swing: Swing) -> None:
    plugged.append(rotary(swing))
    plugged[0].unplugged = True
    assert refusal(Vernier()).startswith("GDX-RMS 0K100123 does not open (open failed); close other programs")


def test_channels_that_exclude_each_other_are_refused(plugged: list[Device]) -> None:
    plugged.append(Device("GDX-ACC 1", [Sensor(1, "X-axis gyro", "rad/s", zero, excludes=1 << 2),
                                        Sensor(2, "Y-axis gyro", "rad/s", zero)]))
    assert "cannot read X-axis gyro, Y-axis gyro together" in refusal(Vernier())
