"""An incremental encoder on a counter of National Instruments' hardware, through the library nidaqmx (MIT)."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pendulum_env.bench.background import ThreadedSource
from pendulum_env.bench.source import ANGLE, NOTHING, Chunk, SourceError
from pendulum_env.common.texts import clean
from pendulum_env.physics.units import count, setting, si

EDGES = 4
"""Counts of a quadrature encoder for each line of its disc, as the counter counts every edge (X4)."""
WAIT = 0.02
"""Time between two looks for clocked samples [s]."""
QUIET = 3.0
"""Time without a clocked sample after which the clock is said to stand still [s]."""


@dataclass(frozen=True, repr=False, eq=False)
class Nidaq(ThreadedSource):
    """An angular encoder on a counter, as ``nidaq:Dev1/ctr0``, its signals A and B at the counter's usual terminals.

    Most counters have no sample clock of their own. With ``clock``, the terminal of one that runs at ``rate``, the k-th
    reading is at k / rate by the device's clock. Without it the counter is read on demand, with the host's times.
    """

    name: ClassVar[str] = "nidaq"
    about: ClassVar[str] = "an encoder on a counter of National Instruments (library nidaqmx, MIT, and NI's driver)"
    address: ClassVar[str] = "counter"
    place: ClassVar[str] = "Dev1/ctr0"
    extra: ClassVar[str] = "nidaq"
    tested: ClassVar[str] = "the library above a false driver; no device"
    own_clock: ClassVar[bool] = False

    counter: str | None = setting(None, "counter, as Dev1/ctr0", note="names are in NI MAX, or nidaqmx's System")
    counts: int | None = count(None, "counts per turn, four times the encoder's lines", 4_000_000,
                               note="None: none, so give it")
    clock: str | None = setting(None, "terminal of a sample clock, as /Dev1/ai/SampleClock",
                                note="None: read on demand, with the host's times")
    rate: float = si(100.0, "Hz", "readings per second, those of the clock if there is one,", above=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Title of the angle in degrees."""
        return ANGLE

    def _begin(self) -> None:
        if not self.counter:
            raise SourceError("nidaq needs a counter, as nidaq:Dev1/ctr0")
        if self.counts is None or self.counts % EDGES:
            raise SourceError(f"nidaq needs --counts, the encoder's counts per turn: {EDGES} times its lines, as "
                              f"--counts 4000 for 1000 lines{f', not {self.counts}' if self.counts else ''}")
        try:
            import nidaqmx
            from nidaqmx.constants import READ_ALL_AVAILABLE, AcquisitionType, AngleUnits, EncoderType
            from nidaqmx.errors import DaqNotFoundError, Error
        except ImportError:
            raise SourceError('nidaq: needs nidaqmx; install it with pip install "lab-pendulum[nidaq]", and the driver '
                              'NI-DAQmx from ni.com') from None
        kept = self._state
        kept.update(all=READ_ALL_AVAILABLE, error=Error, taken=0)
        lines = self.counts // EDGES
        try:
            kept["task"] = task = nidaqmx.Task()
            task.ci_channels.add_ci_ang_encoder_chan(self.counter, decoding_type=EncoderType.X_4,
                                                     units=AngleUnits.DEGREES, pulses_per_rev=lines)
            if self.clock is not None:
                task.timing.cfg_samp_clk_timing(self.rate, source=self.clock, sample_mode=AcquisitionType.CONTINUOUS,
                                                samps_per_chan=max(round(10.0 * self.rate), 1000))
            task.start()
        except DaqNotFoundError:
            raise SourceError("nidaq: the driver NI-DAQmx is not installed; get it from ni.com") from None
        except Error as error:
            raise SourceError(f"nidaq: {self.counter} cannot be read ({_said(error)}); check its name"
                              f"{', that of the clock,' if self.clock else ''} and that no other program uses it"
                              ) from None
        own = self.clock is not None
        vars(self)["own_clock"] = own
        kept.update(due=time.monotonic(), fresh=time.monotonic())
        kept["said"] = [f"nidaq: clocked by {self.clock} at {self.rate:g} Hz, times are the device's" if own else
                        "nidaq: no clock was given, so that the counter is read on demand and times are the host's"]

    def _step(self) -> Chunk:
        """Return clocked samples that wait in the device, or one reading on demand."""
        kept = self._state
        pause = WAIT if self.clock is not None else max(kept["due"] - time.monotonic(), 0.0)
        if self._pause(pause):
            return NOTHING
        began = time.monotonic()
        try:
            read = kept["task"].read(kept["all"], timeout=0.0) if self.clock is not None else [kept["task"].read()]
        except kept["error"] as error:
            raise SourceError(f"nidaq: {self.counter} was lost ({_said(error)}); connect the device again, or lower "
                              "--rate if its buffer ran over, and start again") from None
        now = time.monotonic()
        values = np.asarray(read, dtype=np.float64)
        if self.clock is None:
            kept["due"] = max(kept["due"] + 1.0 / self.rate, now)
            return Chunk(values[:, None], np.array([0.5 * (began + now)]))
        if not len(values):
            if now - kept["fresh"] > QUIET:
                kept["problem"] = f"no sample by the clock {self.clock}; start the task that makes it run"
            return NOTHING
        at = (kept["taken"] + np.arange(len(values))) / self.rate
        kept.update(taken=kept["taken"] + len(values), fresh=now, problem="")
        return Chunk(values[:, None], at)

    def _end(self) -> None:
        task = self._state.pop("task", None)
        if task is not None:
            with suppress(Exception):  # the device may be gone
                task.stop()
            with suppress(Exception):
                task.close()


def _said(error: Exception) -> str:
    """Return the first sentence of the driver's message."""
    return clean(str(error).split("\n")[0])[:120]
