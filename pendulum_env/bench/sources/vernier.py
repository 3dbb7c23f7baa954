"""Sensors of Vernier's Go Direct family, by USB or Bluetooth, through Vernier's library godirect (GPL-3.0)."""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pendulum_env.bench.background import ThreadedSource
from pendulum_env.bench.channels import Channel, choose
from pendulum_env.bench.source import NOTHING, Chunk, SourceError
from pendulum_env.common.texts import clean
from pendulum_env.physics.units import setting, si

PATIENCE = 5.0
"""Longest time without a packet before the device is taken as lost [s]."""
PACKET = 1000
"""Longest time for a packet, after which the library is called again [ms]."""
WINDOW = 2.0
"""Time over which the earliest arrival is sought, by which lost packets are noticed [s]."""
LATE = 3.0
"""Periods by which even the earliest arrival of a window must be late before packets count as lost."""


@dataclass(frozen=True, repr=False, eq=False)
class Vernier(ThreadedSource):
    """A Go Direct sensor: the angle of a rotary motion sensor, else a gyroscope, else an accelerometer.

    Its clock gives the period of readings, the library no times: the k-th reading is at k periods. Packets that were
    lost show by later ones that all come late; the times then go on from there, and a note says how many are missing.
    """

    name: ClassVar[str] = "vernier"
    about: ClassVar[str] = "a Go Direct sensor of Vernier by USB or Bluetooth (library godirect, GPL-3.0)"
    address: ClassVar[str] = "device"
    place: ClassVar[str] = "DEVICE"
    extra: ClassVar[str] = "vernier"
    tested: ClassVar[str] = "the library above a false USB device; no sensor"

    device: str = setting("", "order code or serial number, or a part of them, as GDX-RMS", note="empty: the only one")
    channel: str | None = setting(None, "name of the channel to read, or a part of it", note="None: chosen by quantity")
    rate: float = si(50.0, "Hz", "readings per second, as far as the sensor can", above=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of the channels that are read, such as "Angle (rad)"."""
        return tuple(self._state.get("columns", ("Angle (rad)",)))

    @property
    def notes(self) -> tuple[str, ...]:
        """The device, its channels, its period, and lost packets."""
        lost = self._state.get("lost", 0)
        return (*super().notes, *([f"vernier: about {lost} readings lost on the way"] if lost else []))

    def _begin(self) -> None:
        self._state["loop"] = asyncio.new_event_loop()
        asyncio.set_event_loop(self._state["loop"])  # the library takes the thread's
        try:
            from godirect import GoDirect
        except ImportError:
            raise SourceError('vernier: needs godirect, a library under the GPL-3.0; install it with pip install '
                              '"lab-pendulum[vernier]"') from None
        kept = self._state
        kept.update(lost=0, count=0)
        device = self._found(GoDirect)
        name = clean(device.name or "the sensor")
        try:
            opened = device.open()
        except Exception as error:  # of the library's USB and Bluetooth, of many kinds
            raise SourceError(f"{name} does not open ({clean(str(error))[:80] or type(error).__name__}); close other "
                              "programs that use it, check the permissions of USB, and connect it again") from None
        if not opened:
            raise SourceError(f"{name} does not answer; switch it off and on, and connect it again")
        kept["device"] = device
        sensors = device.list_sensors() or {}
        chosen = choose(name, [Channel(number, sensor.sensor_description, sensor.sensor_units)
                               for number, sensor in sensors.items()], self.channel)
        keys = [one.key for one in chosen.channels]
        device.enable_sensors(keys)
        enabled = [sensor.sensor_number for sensor in device.get_enabled_sensors()]
        if sorted(enabled) != sorted(keys):
            raise SourceError(f"{name} cannot read {', '.join(clean(one.name) for one in chosen.channels)} together; "
                              "choose one of them by --channel")
        kept["sensors"] = [sensors[key] for key in keys]
        least = max(float(sensor.min_measurement_period) for sensor in kept["sensors"])
        grain = max(float(sensor.measurement_period_granularity) for sensor in kept["sensors"])
        period = max(1000.0 / self.rate, least)
        period = round(period / grain) * grain if grain > 0.0 else period
        kept.update(columns=chosen.columns, period=1e-3 * period)
        vars(self)["quantity"] = chosen.quantity
        kept["said"] = [f"vernier: {', '.join(clean(one.name) for one in chosen.channels)} of {name}, "
                        f"{1000.0 / period:.4g} readings per second by its own clock"]
        kept["heard"] = time.monotonic()
        if not device.start(period=period):
            raise SourceError(f"{name} does not start; switch it off and on, and connect it again")

    def _found(self, library: Any) -> Any:
        """Return the one device, by USB, else by Bluetooth."""
        seen, silent = [], ""
        for by_bluetooth in (False, True):
            try:
                seen = library(use_ble=by_bluetooth, use_usb=not by_bluetooth).list_devices()
            except Exception as error:  # no radio, no permission, no service
                silent = f"; Bluetooth does not answer ({clean(str(error))[:80] or type(error).__name__})"
            seen = [device for device in seen if self.device.casefold() in f"{device.name}".casefold()]
            if seen:
                break
        if not seen:
            named = f" named {self.device!r}" if self.device else ""
            raise SourceError(f"No Go Direct sensor{named} was found by USB or Bluetooth{silent}; switch it on, "
                              "connect it by USB, or disconnect it from other programs")
        if len(seen) > 1:
            names = ", ".join(clean(str(device.name)) for device in seen)
            raise SourceError(f"There are {len(seen)} Go Direct sensors ({names}); name one of them, as "
                              "vernier:GDX-RMS")
        return seen[0]

    def _step(self) -> Chunk:
        kept = self._state
        try:
            came = kept["device"].read(timeout=PACKET)
        except Exception as error:  # the library's USB and Bluetooth raise many kinds
            raise SourceError(f"The Go Direct sensor was lost ({clean(str(error))[:80] or type(error).__name__}); "
                              "connect it again and start again") from None
        now = time.monotonic()
        rows = list(zip(*(sensor.values for sensor in kept["sensors"]), strict=False))
        for sensor in kept["sensors"]:
            sensor.clear()
        if not came or not rows:
            if now - kept["heard"] > PATIENCE:
                raise SourceError(f"The Go Direct sensor has sent nothing for {PATIENCE:g} s; switch it on, connect it "
                                  "again and start again")
            return NOTHING
        kept["heard"] = now
        lost = self._missing(now, len(rows))
        at = (kept["count"] + np.arange(len(rows))) * kept["period"]
        kept["count"] += len(rows)
        return Chunk(np.array(rows, dtype=np.float64), at, lost)

    def _missing(self, now: float, count: int) -> int:
        """Return the readings that were lost: even the earliest arrival of a window is late against those before."""
        kept = self._state
        lag = now - (kept["count"] + count) * kept["period"]
        window = kept.setdefault("window", [now, lag])
        window[1] = min(window[1], lag)
        if now - window[0] < WINDOW:
            return 0
        usual, kept["window"] = kept.get("usual", window[1]), [now, lag]
        behind = round((window[1] - usual) / kept["period"])
        kept["usual"] = window[1] if abs(behind) <= LATE else usual
        if behind <= LATE:
            return 0
        kept["count"] += behind
        kept["lost"] += behind
        kept["window"] = [now, lag - behind * kept["period"]]
        return int(behind)

    def _end(self) -> None:
        device = self._state.pop("device", None)
        if device is not None:
            with suppress(Exception):  # it may be gone
                device.stop()
            with suppress(Exception):
                device.close()
        asyncio.set_event_loop(None)
        self._state.pop("loop").close()
