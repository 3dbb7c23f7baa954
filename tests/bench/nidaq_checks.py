"""The source `nidaq`: the library nidaqmx above a false driver. Run in an environment that has the library."""

from __future__ import annotations

import importlib
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from acquiring import GAMMA, LENGTH, Swing, recorded
from nidaqmx.constants import AngleUnits, ChannelType, EncoderType, UsageTypeCI
from nidaqmx.errors import DaqError, DaqReadError

from pendulum_env.bench.source import SourceError
from pendulum_env.bench.sources import nidaq
from pendulum_env.bench.sources.nidaq import Nidaq
from pendulum_env.lab import fit

LINES = 1000
LIBRARY = importlib.import_module("nidaqmx._library_interpreter")  # the layer above the driver


class Driver(LIBRARY.LibraryInterpreter):  # type: ignore[misc]
    """What the driver does for one counter with an encoder; its sample clock runs ``speed`` times faster than ours."""

    swing: Swing
    version: tuple[int, int] = (24, 5)
    speed = 1.0
    removed = overrun = still = False
    log: list[Any] = []  # noqa: RUF012

    def __init__(self) -> None:
        self._driver_version = self.version

    def create_task(self, name: str) -> tuple[int, bool]:
        return 1, True

    def get_task_attribute_string(self, task: int, attribute: int) -> str:
        return "a task"

    def internal_get_last_created_chan(self) -> str:
        raise NotImplementedError

    def create_ci_ang_encoder_chan(self, task: int, counter: str, name: str, decoding: int, zidx: bool, value: float,
                                   phase: int, units: int, lines: int, initial: float, scale: str) -> None:
        if counter != "Dev1/ctr0":
            raise DaqError("Physical channel specified does not exist on this device.\nDevice: Dev1", -200170)
        assert (decoding, units) == (EncoderType.X_4.value, AngleUnits.DEGREES.value)
        type(self).lines = lines

    def cfg_samp_clk_timing(self, task: int, rate: float, source: str, edge: int, mode: int, count: int) -> None:
        if source != "/Dev1/ai/SampleClock":
            raise DaqError("Source terminal to be routed could not be found on the device.", -89120)
        type(self).clock = rate

    def start_task(self, task: int) -> None:
        type(self).began, type(self).sent = time.monotonic(), 0
        self.log.append("started")

    def stop_task(self, task: int) -> None:
        self.log.append("stopped")

    def clear_task(self, task: int) -> None:
        self.log.append("cleared")

    def get_read_attribute_string(self, task: int, attribute: int) -> str:
        return "Dev1/ctr0"

    def get_chan_attribute_int32(self, task: int, channel: str, attribute: int) -> int:
        return {0x187F: ChannelType.COUNTER_INPUT.value, 0x18A0: UsageTypeCI.POSITION_ANGULAR_ENCODER.value}[attribute]

    def get_timing_attribute_int32(self, task: int, attribute: int) -> int:
        return 10123  # continuous

    def get_read_attribute_uint32(self, task: int, attribute: int) -> int:
        due = math.floor((time.monotonic() - self.began) * self.speed * self.clock)
        return 0 if self.still else due - self.sent

    def read_counter_f64_ex(self, task: int, count: int, timeout: float, mode: int, data: Any) -> tuple[Any, int]:
        if self.removed:
            raise DaqReadError("Device removed from the system.", -201003, 0)
        if self.overrun:
            raise DaqReadError("The application is not able to keep up with the hardware acquisition.", -200279, 0)
        at = (np.arange(count) + self.sent) / self.clock if self.clock else np.array([time.monotonic() - self.began])
        type(self).sent += count
        step = 360.0 / (4 * self.lines)
        data[:] = np.floor(np.degrees(self.swing.angle(at)) / step) * step
        return data, count

    began, sent, clock, lines = 0.0, 0, 0.0, 0


@pytest.fixture(scope="module")
def swing() -> Swing:
    return Swing(60.0)


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, swing: Swing) -> type[Driver]:
    kind = type("OneDriver", (Driver,), {"swing": swing, "log": []})
    monkeypatch.setattr(LIBRARY, "LibraryInterpreter", kind)
    return kind


def check_fit(recording: Any) -> None:
    found = fit(recording, "linear", mass=1.0).parameters
    for name, truth in (("length", LENGTH), ("linear_drag.gamma", GAMMA)):
        assert abs(found[name].value - truth) < 4.0 * found[name].error, (name, found[name])
        assert found[name].error < 0.05 * truth


@pytest.mark.parametrize("version", [(24, 5), (20, 0)])
def test_a_clocked_counter_fits_the_scene_behind_it(driver: Any, version: tuple[int, int], tmp_path: Path) -> None:
    driver.version, driver.speed = version, 10.0
    source = Nidaq("Dev1/ctr0", counts=4 * LINES, clock="/Dev1/ai/SampleClock", rate=200.0)
    recording = recorded(source, tmp_path / "swing.csv", 20.0)
    assert source.own_clock
    assert source.notes == ("nidaq: clocked by /Dev1/ai/SampleClock at 200 Hz, times are the device's",)
    np.testing.assert_allclose(np.diff(recording.time), 0.005, atol=2e-6)
    assert driver.lines == LINES
    assert driver.log == ["started", "stopped", "cleared"]
    check_fit(recording)


def test_a_counter_on_demand_fits_with_the_hosts_times(driver: Any, tmp_path: Path) -> None:
    source = Nidaq("Dev1/ctr0", counts=4 * LINES)
    recording = recorded(source, tmp_path / "swing.csv", 10.0)
    assert not source.own_clock
    assert source.notes == ("nidaq: no clock was given, so that the counter is read on demand and times are the "
                            "host's",)
    assert np.median(np.diff(recording.time)) == pytest.approx(0.01, abs=0.005)
    check_fit(recording)


def refusal(source: Nidaq) -> str:
    with pytest.raises(SourceError) as refused:
        source.open()
    source.close()
    return str(refused.value)


def test_wrong_counters_clocks_and_counts_are_refused(driver: Any) -> None:
    assert refusal(Nidaq("Dev1/ctr9", counts=4000)) == (
        "nidaq: Dev1/ctr9 cannot be read (Physical channel specified does not exist on this device.); check its name "
        "and that no other program uses it")
    assert "check its name, that of the clock, and that no" in refusal(Nidaq("Dev1/ctr0", counts=4000, clock="/Dev1/x"))
    assert driver.log == ["cleared"] * 2 or driver.log == ["stopped", "cleared"] * 2


def test_a_driver_that_is_not_installed_is_told() -> None:
    assert refusal(Nidaq("Dev1/ctr0", counts=4000)) == ("nidaq: the driver NI-DAQmx is not installed; get it from "
                                                        "ni.com")


@pytest.mark.parametrize("fault", ["removed", "overrun"])
@pytest.mark.parametrize("clock", [None, "/Dev1/ai/SampleClock"])
def test_a_device_that_is_lost_ends_the_run(driver: Any, fault: str, clock: str | None) -> None:
    source = Nidaq("Dev1/ctr0", counts=4000, clock=clock)
    source.open()
    assert len(source.read(5.0).values)
    setattr(driver, fault, True)
    until, said = time.monotonic() + 5.0, ""
    while not said and time.monotonic() < until:
        try:
            source.read(0.05)
        except SourceError as error:
            said = str(error)
    source.close()
    assert said.startswith("nidaq: Dev1/ctr0 was lost (")
    assert said.endswith("; connect the device again, or lower --rate if its buffer ran over, and start again")


def test_a_clock_that_stands_still_is_told(driver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nidaq, "QUIET", 0.1)
    driver.still = True
    source = Nidaq("Dev1/ctr0", counts=4000, clock="/Dev1/ai/SampleClock")
    source.open()
    time.sleep(0.4)
    assert source.problem == "no sample by the clock /Dev1/ai/SampleClock; start the task that makes it run"
    source.close()
