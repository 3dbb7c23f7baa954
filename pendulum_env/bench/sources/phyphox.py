"""The sensors of a phone, through the remote access of the app phyphox.

The app answers requests by HTTP with JSON, without keeping a connection: ``/config`` describes the experiment,
``/control`` starts it, ``/get`` returns what buffers hold beyond a threshold of the buffer of times, ``/time`` tells
when the experiment was started and paused (https://phyphox.org/wiki/index.php/Remote-interface_communication).
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple
from urllib.parse import quote, urlencode, urlsplit

import numpy as np

from pendulum_env.bench.background import ThreadedSource
from pendulum_env.bench.source import NOTHING, Chunk, FloatArray, SourceError
from pendulum_env.common.texts import clean
from pendulum_env.physics.units import SceneError, choice, setting, shown, si

PORTS = (8080, 80)
"""Ports of the app on Android and on iPhones."""
ANSWER = 3.0
"""Longest time for an answer [s]."""
QUIET = 1.0
"""Time without a sample or an answer after which the phone is asked what happened [s]."""
LARGEST = 64_000_000
"""Largest answer that is read [bytes]; a minute of three axes at 500 Hz takes about 2 million."""
UNHEARD = 5.0
"""Time by which the phone's clock may fall behind before a pause is suspected, where the app tells of none [s]."""
GAP = 2.5
"""Steps between two samples, as a multiple of the usual step, beyond which samples were lost."""
AXES = ("x", "y", "z")
NO_ANSWER = (OSError, HTTPException, ValueError, KeyError, TypeError)
"""Errors of a request that was not answered, or not as documented."""


class Kind(NamedTuple):
    """A sensor: its name in the app's files, the quantity, the title of a column, and the experiment that has it."""

    word: str
    quantity: str
    title: str
    experiment: str


PAUSED = "the measurement is paused on the phone; press start there"
UNKNOWN_PAUSE = ("The measurement was paused, and this version of phyphox (before 1.1.8) does not tell for how long; "
                 "start again here, and update the app")

KINDS: Mapping[str, Kind] = {
    "gyroscope": Kind("gyroscope", "rate", "Gyroscope {} (rad/s)", "Gyroscope (rotation rate)"),
    "acceleration": Kind("accelerometer", "force", "Acceleration {} (m/s^2)", "Acceleration with g"),
}
"""Name of the setting -> sensor, the preferred one first."""


class Pause(NamedTuple):
    """A pause: the time of the experiment's clock at which it was, and how long it took [s]."""

    at: float
    length: float


def _address(value: Any, name: str) -> str | None:
    """Return an address without ``http://``, checked; SceneError unless it is a host, perhaps with a port."""
    if value is None:
        return None
    text = value.strip() if isinstance(value, str) else ""
    try:
        host, _ = _split(text)
    except ValueError:
        host = ""
    if not host or any(sign.isspace() or not sign.isprintable() for sign in text):
        raise SceneError(f"{name} must be the address that the app shows, as 192.168.0.42:8080, not {shown(value)}")
    return text


def _split(address: str) -> tuple[str, int | None]:
    """Return host and port of an address; ValueError for an invalid port."""
    parts = urlsplit(address if "//" in address else f"//{address}")
    return parts.hostname or "", parts.port


@dataclass(frozen=True, repr=False, eq=False)
class Phyphox(ThreadedSource):
    """A phone that lies on the pendulum or is its bob, and measures with the app phyphox.

    Choose "Allow remote access" in the app's menu. The gyroscope or the acceleration (with g) of the experiment that
    is open there is read; it is started if it does not measure yet, and then stopped at the end. Times are the
    phone's. A phone that sleeps or leaves the network for a while is waited for; pauses are added to its times.
    """

    name: ClassVar[str] = "phyphox"
    about: ClassVar[str] = "a phone with the app phyphox: its gyroscope or acceleration"
    address: ClassVar[str] = "host"
    place: ClassVar[str] = "HOST[:PORT]"
    tested: ClassVar[str] = "a local server written after the app's documentation; no phone"
    quantity: ClassVar[str] = "rate"

    host: str | None = setting(None, "address that the app shows, as 192.168.0.42:8080", _address,
                               note="without a port: 8080 (Android), then 80 (iPhones)")
    sensor: str | None = choice(None, KINDS, "sensor to read", note="None: the gyroscope if the experiment has it")
    every: float = si(0.05, "s", "time between two requests", above=0.0)
    patience: float = si(60.0, "s", "time without an answer after which the phone is given up", above=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Titles as in the files that the app writes, such as "Gyroscope x (rad/s)"."""
        return tuple(self._state.get("columns", ("Gyroscope x (rad/s)",)))

    @property
    def notes(self) -> tuple[str, ...]:
        """The phone's experiment and sensor, pauses, and times without an answer."""
        kept = self._state
        silent = [f"phone: {kept['silences']} times without an answer, {kept['longest']:.1f} s at most; what it had "
                  "measured came later"] if kept.get("silences") else []
        return (*super().notes, *silent)

    def _begin(self) -> None:
        """Find the app, the sensor's buffers, and start the measurement.

        Raises SourceError if nothing answers, if it is not the app, and for an experiment without a usable sensor.
        """
        if self.host is None:
            raise SourceError("phyphox needs an address, as phyphox:192.168.0.42:8080; the app shows it once you "
                              "choose 'Allow remote access' in its menu")
        config = self._find()
        self._choose(config)
        kept = self._state
        kept.update(last=-math.inf, silences=0, longest=0.0, problem="", heard=time.monotonic(), fresh=time.monotonic(),
                    step=0.0, lag=math.inf, answered=True, started=False, measuring=None)
        try:
            status = self._latest()
        except NO_ANSWER as error:
            raise SourceError(f"phyphox does not tell its latest sample ({_reason(error)}); open the experiment again, "
                              "and update the app") from None
        kept["session"] = status.get("session")
        kept["pauses"] = self._pauses()
        if not status.get("measuring"):
            self._control("start")
            kept["started"] = True

    def _end(self) -> None:
        if self._state.get("started"):
            with suppress(SourceError):  # out of reach, it measures on
                self._control("stop")

    def _find(self) -> Mapping[str, Any]:
        """Return the description of the experiment, from the first port that answers."""
        host, port = _split(self.host or "")
        tried = []
        for one in PORTS if port is None else (port,):
            self._state["place"] = host, one
            try:
                config = self._ask("/config")
            except (OSError, HTTPException) as error:
                tried.append(f"port {one}: {_reason(error)}")
                continue
            except ValueError:
                config = None
            if isinstance(config, Mapping) and isinstance(config.get("inputs"), list):
                return config
            raise SourceError(f"What answers at {host}, port {one}, is not phyphox, or one too old to describe its "
                              "experiment; give the address that the app shows, and update the app")
        raise SourceError(f"No phone answers at {host} ({'; '.join(tried)}); choose 'Allow remote access' in phyphox, "
                          "give the address that it shows, and have phone and computer in one network")

    def _choose(self, config: Mapping[str, Any]) -> None:
        """Choose the sensor and its buffers; SourceError with what the experiment has and which one to open."""
        found = dict(_inputs(config))
        title = clean(str(config.get("title", "")))[:60]
        for name, kind in KINDS.items():
            outputs = found.get(kind.word, {})
            axes = [axis for axis in AXES if axis in outputs] or [axis for axis in ("abs",) if axis in outputs]
            if self.sensor in (None, name) and axes and "t" in outputs:
                columns = [kind.title.format("absolute" if axis == "abs" else axis) for axis in axes]
                self._state.update(columns=columns, buffers=[outputs["t"], *(outputs[axis] for axis in axes)],
                                   said=[f"phone: {kind.word} of the experiment {title!r}"])
                vars(self)["quantity"] = kind.quantity
                return
        wanted = [KINDS[self.sensor]] if self.sensor else [*KINDS.values()]
        has = ", ".join(clean(name).replace("_", " ") for name in found) or "no sensor"
        without = "; linear acceleration is without g" if "linear_acceleration" in found else ""
        raise SourceError(f"The phone's experiment {title!r} has no {' or '.join(kind.word for kind in wanted)} with "
                          f"times (it reads {has}{without}); open "
                          f"{' or '.join(repr(kind.experiment) for kind in wanted)} in phyphox")

    def _latest(self) -> Mapping[str, Any]:
        """Take the time of the latest sample as the last one if there is none yet; return the app's status.

        Raises SourceError if it is earlier than the last one, and the errors NO_ANSWER.
        """
        buffer = self._state["buffers"][0]
        answer = self._ask(f"/get?{quote(buffer)}")
        values, known = _numbers(answer["buffer"][buffer]["buffer"]), answer["status"]
        status: Mapping[str, Any] = {**known}
        latest = float(values[-1]) if len(values) else math.nan
        if latest < self._state["last"]:
            raise SourceError("The measurement was cleared on the phone, so its times begin again; start again here")
        if math.isfinite(latest) and not math.isfinite(self._state["last"]):
            self._state["last"] = latest
        return status

    def _control(self, command: str) -> None:
        try:
            done = self._ask(f"/control?cmd={command}")
            good = isinstance(done, Mapping) and done.get("result") is True
        except (OSError, HTTPException, ValueError) as error:
            raise SourceError(f"phyphox did not {command} ({_reason(error)}); press {command} on the phone") from None
        if not good:
            raise SourceError(f"phyphox refused to {command}; press {command} on the phone")

    def _pauses(self) -> list[Pause] | None:
        """Return the pauses of the experiment so far; None if the app does not tell them (before version 1.1.8)."""
        try:
            events = self._ask("/time")
            times = [(str(one["event"]), float(one["experimentTime"]), float(one["systemTime"])) for one in events]
        except NO_ANSWER:
            return None
        return [Pause(paused[1], max(again[2] - paused[2], 0.0)) for paused, again in pairwise(times)
                if (paused[0], again[0]) == ("PAUSE", "START")]

    def _step(self) -> Chunk:
        """Ask for new samples once; return them, or nothing if none came."""
        kept = self._state
        if self._pause(self.every):
            return NOTHING
        try:
            chunk = self._new()
        except SourceError:
            raise
        except NO_ANSWER as error:
            silent = time.monotonic() - kept["heard"]
            if silent > self.patience:
                raise SourceError(f"The phone has not answered for {silent:.0f} s ({_reason(error)}); wake it, keep "
                                  "phyphox open, and start again") from None
            if silent > QUIET:
                kept["silences"] += kept["answered"]
                kept.update(answered=False, longest=max(kept["longest"], silent),
                            problem=f"the phone has not answered for {silent:.0f} s; wake it and keep phyphox open")
            return NOTHING
        kept["heard"] = time.monotonic()
        return chunk

    def _new(self) -> Chunk:
        kept = self._state
        buffers, last = kept["buffers"], kept["last"]
        beyond = f"{last:.10g}" if math.isfinite(last) else "full"
        asked = {name: f"{beyond}|{buffers[0]}" if name != buffers[0] and beyond != "full" else beyond
                 for name in buffers}
        answer = self._ask(f"/get?{urlencode(asked)}")
        status = answer["status"]
        columns = [_numbers(answer["buffer"][name]["buffer"]) for name in buffers]
        if status.get("session") != kept["session"]:
            kept["started"] = False  # the other experiment is not ours to stop
            raise SourceError("Another experiment was opened on the phone; start again here")
        self._follow(bool(status.get("measuring")))
        rows = np.array([column[:min(map(len, columns))] for column in columns]).T  # a buffer may lag behind
        rows = rows[rows[:, 0] > last]
        rows = rows[np.append(True, np.diff(rows[:, 0]) > 0.0)] if len(rows) else rows
        now = time.monotonic()
        if not len(rows):
            if kept["measuring"] and now - kept["fresh"] > QUIET:
                self._latest()
                kept.update(fresh=now, problem="the phone answers, but its sensor gives no samples; wake it, and keep "
                                               "phyphox in front")
            return NOTHING
        lag = now - float(rows[-1, 0])
        if kept["pauses"] is None and lag > kept["lag"] + UNHEARD:  # its clock stood still
            raise SourceError(UNKNOWN_PAUSE)
        kept.update(last=float(rows[-1, 0]), fresh=now, lag=min(lag, kept["lag"]),
                    problem="" if kept["measuring"] else PAUSED)
        steps = np.diff(rows[:, 0])
        kept["step"] = float(np.median(steps)) if len(steps) > 3 else kept["step"]
        gaps = np.diff(rows[:, 0], prepend=last if math.isfinite(last) else rows[0, 0])
        lost = sum(round(gap / kept["step"]) - 1 for gap in gaps[gaps > GAP * kept["step"]]) if kept["step"] else 0
        return Chunk(rows[:, 1:], self._with_pauses(rows[:, 0]), lost)

    def _follow(self, measuring: bool) -> None:
        """Follow whether the phone measures, and learn of pauses, also of those while it could not be heard."""
        kept = self._state
        if not measuring:
            paused = kept["measuring"] is not None
            kept.update(measuring=False if paused else None, problem=PAUSED)
        elif kept["measuring"] is not True or not kept["answered"]:
            known, resumed = kept["pauses"], kept["measuring"] is False
            kept.update(measuring=True, answered=True, problem="", pauses=self._pauses())
            if kept["pauses"] is None and resumed:
                raise SourceError(UNKNOWN_PAUSE)
            for pause in (kept["pauses"] or [])[len(known or []):]:
                kept["said"] = [*kept["said"], f"phone: paused for {pause.length:.1f} s, which are added to its times"]

    def _with_pauses(self, at: FloatArray) -> FloatArray:
        """Return times with the pauses before them, which the experiment's clock leaves out."""
        return np.asarray(at + sum((pause.length * (at > pause.at) for pause in self._state["pauses"] or ()), 0.0))

    def _ask(self, path: str) -> Any:
        """Return an answer by a connection of its own, as the app keeps none; OSError, HTTPException or ValueError."""
        host, port = self._state["place"]
        connection = HTTPConnection(host, port, timeout=ANSWER)
        try:
            connection.request("GET", path, headers={"Connection": "close"})
            answer = connection.getresponse()
            text = answer.read(LARGEST)
            if answer.status != 200:
                raise ValueError(f"it answers {answer.status}")
            return json.loads(text)
        finally:
            connection.close()


def _inputs(config: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield name and buffers (output -> buffer) of the sensors of an experiment."""
    for one in config["inputs"]:
        if isinstance(one, Mapping) and isinstance(one.get("source"), str):
            outputs = one.get("outputs")
            parts = outputs if isinstance(outputs, list) else [outputs]
            yield one["source"], {str(output): buffer for part in parts if isinstance(part, Mapping)
                                  for output, buffer in part.items() if isinstance(buffer, str)}


def _numbers(values: Any) -> FloatArray:
    """Return the numbers of a buffer, NaN for null; TypeError or ValueError for what is no list of numbers."""
    return np.array([math.nan if value is None else float(value) for value in values])


def _reason(error: Exception) -> str:
    """Return what went wrong, in a few words."""
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, OSError):
        return (error.strerror or str(error) or type(error).__name__).lower()
    return clean(str(error))[:80] or type(error).__name__
