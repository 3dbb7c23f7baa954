"""Wireless sensors of PASCO, by Bluetooth, through PASCO's library pasco (a licence of PASCO's own, Python 3.11)."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pendulum_env.bench.background import ThreadedSource
from pendulum_env.bench.channels import Channel, choose
from pendulum_env.bench.source import NOTHING, Chunk, SourceError
from pendulum_env.common.texts import clean
from pendulum_env.physics.units import setting, si


@dataclass(frozen=True, repr=False, eq=False)
class Pasco(ThreadedSource):
    """A wireless sensor: the angle of a rotary motion sensor, else a gyroscope, else an accelerometer.

    The library asks for one reading after the other, and the device sends no times: a reading has the host's time of
    the middle between question and answer, and how long that took is said.
    """

    name: ClassVar[str] = "pasco"
    about: ClassVar[str] = "a wireless sensor of PASCO by Bluetooth (library pasco, PASCO's own licence, Python 3.11)"
    address: ClassVar[str] = "device"
    place: ClassVar[str] = "DEVICE"
    extra: ClassVar[str] = "pasco"
    tested: ClassVar[str] = "the library above a false Bluetooth device; no sensor"
    own_clock: ClassVar[bool] = False

    device: str = setting("", "kind or number on the case, or a part of them, as Rotary or 123-456",
                          note="empty: the only one")
    channel: str | None = setting(None, "name of the measurement to read, or a part of it",
                                  note="None: chosen by quantity")
    rate: float = si(50.0, "Hz", "readings per second, as far as Bluetooth can", above=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles of the measurements that are read, such as "Angle (rad)"."""
        return tuple(self._state.get("columns", ("Angle (rad)",)))

    @property
    def notes(self) -> tuple[str, ...]:
        """The device, its measurements, and how long its answers took."""
        took = self._state.get("took", [])
        slow = [f"pasco: an answer takes {1e3 * float(np.median(took)):.2g} ms, {1e3 * max(took):.2g} ms at most; "
                "times are the host's, of the middle between question and answer"] if took else []
        return (*super().notes, *slow)

    def _begin(self) -> None:
        if sys.version_info < (3, 11):
            raise SourceError("pasco: its library needs Python 3.11 or newer; run LabPendulum with that")
        try:
            from pasco.pasco_ble_device import PASCOBLEDevice
        except ImportError:
            raise SourceError("pasco: needs pasco, a library under a licence of PASCO's own; install it with pip "
                              'install "lab-pendulum[pasco]"') from None
        kept = self._state
        kept["took"] = []
        kept["device"] = device = PASCOBLEDevice()
        try:
            seen = device.scan()
        except Exception as error:  # the library hides what its Bluetooth raised
            raise SourceError(f"Bluetooth does not answer ({type(error).__name__}); switch it on, and allow this "
                              "program to use it") from None
        seen = [one for one in seen if self.device.casefold() in one.name.casefold()]
        names = ", ".join(clean(one.name.split(">")[0]) for one in seen)
        if len(seen) != 1:
            named = f" named {self.device!r}" if self.device else ""
            raise SourceError(f"There are {len(seen)} sensors of PASCO ({names}); name one of them, as pasco:Rotary"
                              if seen else f"No sensor of PASCO{named} was found by Bluetooth; switch it on, and "
                              "disconnect it from other programs")
        try:
            device.connect(seen[0])
            measured = device.get_measurement_list()
            channels = [Channel(one, one, device.get_measurement_unit(one) or "") for one in measured]
        except Exception as error:
            raise SourceError(f"{names} does not connect ({clean(str(error)) or type(error).__name__}); switch it off "
                              "and on, and disconnect it from other programs") from None
        said = []
        while True:  # a gap in its tables keeps the library from reading some channels, as the Smart Cart's gyroscope
            chosen = choose(names, channels, self.channel)
            keys = [one.key for one in chosen.channels]
            try:
                device.read_data_list(keys)
                break
            except Exception:
                said.append(f"pasco: the library cannot read {', '.join(keys)} of {names}")
                channels = [one for one in channels if one not in chosen.channels]
        kept.update(columns=chosen.columns, keys=keys, due=time.monotonic())
        vars(self)["quantity"] = chosen.quantity
        kept["said"] = [*said, f"pasco: {', '.join(keys)} of {names}"]

    def _step(self) -> Chunk:
        kept = self._state
        if self._pause(max(kept["due"] - time.monotonic(), 0.0)):
            return NOTHING
        began = time.monotonic()
        try:
            read = kept["device"].read_data_list(kept["keys"])
            values = [float(read[key]) for key in kept["keys"]]
        except Exception as error:
            raise SourceError(f"The sensor of PASCO was lost ({clean(str(error)) or type(error).__name__}); switch it "
                              "on, come nearer, and start again") from None
        now = time.monotonic()
        kept["took"] = [*kept["took"][-999:], now - began]
        kept["due"] = max(kept["due"] + 1.0 / self.rate, now)
        return Chunk(np.array([values]), np.array([0.5 * (began + now)]))

    def _end(self) -> None:
        device = self._state.pop("device", None)
        if device is not None:
            with suppress(Exception):  # it may be gone
                device.disconnect()
            device._loop.close()  # the library leaves it open
