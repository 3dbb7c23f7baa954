"""The source `pasco`: the library pasco above a false Bluetooth device. Run in an environment that has the library."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from acquiring import GAMMA, LENGTH, Swing, recorded
from pasco import pasco_ble_device

from pendulum_env.bench.source import SourceError
from pendulum_env.bench.sources.pasco import Pasco
from pendulum_env.lab import fit


def uuid(service: int, characteristic: int) -> str:
    return f"4a5c000{service}-000{characteristic}-0000-0000-5c1e741f1c00"


class Device:
    """A wireless sensor: its advertised name, whose last letters tell its kind, and the bytes of its channels."""

    def __init__(self, name: str, channels: dict[int, Callable[[float], bytes]]) -> None:
        self.name, self.channels = name, channels
        self.address = name
        self.is_connected, self.away, self.disconnected = False, False, False
        self.began = time.monotonic()
        self.services = [SimpleNamespace(characteristics=[SimpleNamespace(
            uuid=uuid(service, 3), handle=10 * service + 3, properties=["notify"])]) for service in (0, *channels)]
        self._heard: Any = None

    async def connect(self) -> None:
        if self.away:
            raise OSError("out of range")
        self.is_connected = True

    async def disconnect(self) -> None:
        self.is_connected, self.disconnected = False, True

    async def start_notify(self, _: Any, heard: Any) -> None:
        self._heard = heard

    async def write_gatt_char(self, to: Any, command: bytes) -> None:
        if self.away:
            raise OSError("out of range")
        service = int(str(to)[7])
        read = command[0] == 0x05
        data = self.channels[service](time.monotonic() - self.began) if read else b""
        answer = bytearray([0xC0, 0x00, command[0]]) + data
        characteristic = SimpleNamespace(handle=10 * service + 3)
        asyncio.get_running_loop().call_later(0.004, lambda: asyncio.ensure_future(self._heard(characteristic, answer)))


@pytest.fixture
def near(monkeypatch: pytest.MonkeyPatch) -> list[Device]:
    """Devices in reach of Bluetooth."""
    devices: list[Device] = []

    class Scanner:
        @staticmethod
        async def discover() -> list[Device]:
            return [SimpleNamespace(name=None), *devices]  # type: ignore[list-item]

    monkeypatch.setattr(pasco_ble_device, "BleakScanner", Scanner)
    monkeypatch.setattr(pasco_ble_device, "BleakClient",
                        lambda address: next(one for one in devices if one.address == address))
    return devices


@pytest.fixture(scope="module")
def swing() -> Swing:
    return Swing(60.0)


def rotary(swing: Swing) -> Device:
    """The wireless rotary motion sensor: changes of a count, 2000 per turn, since it was last asked."""
    last = [0]

    def changed(at: float) -> bytes:
        count = round(float(swing.angle(np.array(at))) * 2000.0 / math.tau)
        change, last[0] = count - last[0], count
        return (change % 65536).to_bytes(2, "little")

    return Device("Rotary Motion 123-456>R1", {1: changed})


def rates(swing: Swing, at: float) -> bytes:
    """Three angular velocities in steps of 0.07 degrees per second; the swing is about the second axis."""
    rate = math.degrees(float(swing.velocity(np.array(at))))
    return b"".join((round(share * rate / 0.07) % 65536).to_bytes(2, "little") for share in (0.0, 1.0, 0.0))


def accelerometer(swing: Swing) -> Device:
    """The wireless acceleration and altimeter sensor, whose gyroscope is its second channel."""
    return Device("Accel Alt 444-555>X", {1: lambda _: bytes(6), 2: lambda at: rates(swing, at), 3: lambda _: bytes(4)})


def cart(swing: Swing) -> Device:
    """The Smart Cart, whose gyroscope is its fourth channel."""
    return Device("Smart Cart 222-333>5", {1: lambda _: bytes(2), 2: lambda _: bytes(6), 3: lambda _: bytes(2),
                                           4: lambda at: rates(swing, at)})


def test_a_rotary_motion_sensor_fits_the_scene_behind_it(near: list[Device], swing: Swing, tmp_path: Path) -> None:
    near.append(rotary(swing))
    source = Pasco()
    recording = recorded(source, tmp_path / "swing.csv", 12.0)
    assert source.columns == ("Angle (rad)",)
    assert not recording.indirect
    assert not source.own_clock
    assert source.notes[0] == "pasco: Angle of Rotary Motion 123-456"
    assert "times are the host's" in source.notes[1]
    assert np.median(np.diff(recording.time)) == pytest.approx(0.02, abs=0.01)
    found = fit(recording, "linear", mass=1.0, robust=True).parameters  # a busy machine reads one late
    for name, truth in (("length", LENGTH), ("linear_drag.gamma", GAMMA)):
        assert abs(found[name].value - truth) < 4.0 * found[name].error, (name, found[name])
        assert found[name].error < 0.1 * truth
    assert near[0].disconnected


def test_a_gyroscope_is_found_among_channels(near: list[Device], swing: Swing, tmp_path: Path) -> None:
    near.append(accelerometer(swing))
    source = Pasco("444-555", rate=40.0)
    recording = recorded(source, tmp_path / "swing.csv", 8.0)
    assert source.quantity == "rate"
    assert source.columns == tuple(f"Angular velocity {axis} (deg/s)" for axis in "xyz")
    assert recording.rate is not None
    found = fit(recording, "linear", mass=1.0).parameters["length"]
    assert abs(found.value - LENGTH) < 4.0 * found.error


def test_channels_that_the_library_cannot_read_are_passed_over(near: list[Device], swing: Swing) -> None:
    """Its table of the Smart Cart's gyroscope has a misspelt entry, in version 0.3.65."""
    near.append(cart(swing))
    source = Pasco()
    source.open()
    assert len(source.read(5.0).values)
    source.close()
    axes = ", ".join(f"AngularVelocity{axis}" for axis in "xyz")
    missing = f"pasco: the library cannot read {axes} of Smart Cart 222-333" in source.notes
    assert missing == (source.quantity == "force")
    assert source.columns[0] in ("Acceleration x (m/s^2)", "Angular velocity x (deg/s)")


def refusal(source: Pasco) -> str:
    with pytest.raises(SourceError) as refused:
        source.open()
    source.close()
    return str(refused.value)


def test_no_wrong_and_several_devices_are_refused(near: list[Device], swing: Swing,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    assert refusal(Pasco()) == ("No sensor of PASCO was found by Bluetooth; switch it on, and disconnect it from other "
                                "programs")
    near += [rotary(swing), cart(swing)]
    assert refusal(Pasco()) == ("There are 2 sensors of PASCO (Rotary Motion 123-456, Smart Cart 222-333); name one of "
                                "them, as pasco:Rotary")
    assert refusal(Pasco("999")).startswith("No sensor of PASCO named '999' was found")
    assert "has no channel 'angel'" in refusal(Pasco("Rotary", channel="angel"))
    near[0].away = True
    assert refusal(Pasco("Rotary")).startswith("Rotary Motion 123-456 does not connect (Could not connect to the "
                                               "sensor); switch it off and on")
    near[:] = [Device("Temperature 111-222>0", {1: lambda _: bytes(2)})]
    assert "measures no angle, angular velocity or acceleration" in refusal(Pasco())

    class Off:
        @staticmethod
        async def discover() -> None:
            raise OSError("no radio")

    monkeypatch.setattr(pasco_ble_device, "BleakScanner", Off)
    assert refusal(Pasco()).startswith("Bluetooth does not answer (BLEScanFailed); switch it on")


def test_a_device_out_of_reach_is_lost(near: list[Device], swing: Swing) -> None:
    near.append(rotary(swing))
    source = Pasco()
    source.open()
    assert len(source.read(5.0).values)
    near[0].away = True
    until = time.monotonic() + 10.0
    said = ""
    while not said and time.monotonic() < until:
        try:
            source.read(0.05)
        except SourceError as error:
            said = str(error)
    source.close()
    assert said.startswith("The sensor of PASCO was lost (")
    assert said.endswith("; switch it on, come nearer, and start again")
