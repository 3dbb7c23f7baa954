"""A local server that answers as the app phyphox does, written after its wiki page "Remote-interface communication".

What is known of the app beside that page: it writes eight digits, and its numbers beyond a threshold begin a little
later than it. A true second takes ``1 / speed`` seconds, so that a minute's swing is measured in a few.
"""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
from numpy.typing import NDArray

GYROSCOPE = ("gyroscope", "Gyroscope", {"x": "gyrX", "y": "gyrY", "z": "gyrZ", "abs": "gyr", "t": "gyr_time"})
ACCELEROMETER = ("accelerometer", "Acceleration with g", {"x": "accX", "y": "accY", "z": "accZ", "t": "acc_time"})
LINEAR = ("linear_acceleration", "Acceleration (without g)", {"x": "accX", "y": "accY", "z": "accZ", "t": "acc_time"})
MAGNETOMETER = ("magnetic_field", "Magnetometer", {"x": "magX", "t": "mag_time"})


class FalsePhone:
    """A phone whose sensor reads ``motion(times)``, an array of shape (times, axes), ``rate`` times a second.

    Attributes that tests change: ``asleep`` (requests get no answer), ``dropped`` (so many of the next requests are
    closed without an answer), ``lagging`` (the last axis lacks so many samples), ``stalled`` (no samples),
    ``repeats`` (the sample at a threshold is sent again, as rounding may do).
    """

    def __init__(self, motion: Callable[[NDArray[np.float64]], NDArray[np.float64]], *, sensor: Any = GYROSCOPE,
                 rate: float = 100.0, speed: float = 1.0, times: bool = True, listed: bool = True) -> None:
        self.motion, self.rate, self.speed, self.times, self.listed = motion, rate, speed, times, listed
        self.source, self.title, self.outputs = sensor
        self.asleep, self.stalled, self.dropped, self.lagging, self.repeats = False, False, 0, 0, False
        self.requests: list[str] = []
        self.kept_alive = 0
        self.session = "a1b2c3"
        self.measuring = False
        self.events: list[dict[str, Any]] = []
        self._lock = threading.Lock()
        self.clear()
        self._began, self._at, self._paused_at = time.monotonic(), 0.0, 0.0
        phone = self

        class Answers(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                phone.kept_alive += self.headers.get("Connection", "").lower() != "close"
                phone.requests.append(self.path)
                if phone.asleep or phone.dropped > 0:
                    phone.dropped -= not phone.asleep
                    return  # and the connection closes
                answer = phone.answer(self.path)
                body = json.dumps(answer if answer is not None else {"error": "Not found."}).encode()
                self.send_response(200 if answer is not None else 404)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
        self.port: int = self.server.server_address[1]
        self._thread = threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True)

    def __enter__(self) -> FalsePhone:
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self.server.shutdown()
        self.server.server_close()

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    def clear(self) -> None:
        """Empty the buffers; the experiment's clock begins again at its next start."""
        self.buffers: dict[str, list[float]] = {name: [] for name in self.outputs.values()}
        self.measuring = False
        self.events.clear()

    def now(self) -> float:
        """The true time [s]."""
        return (time.monotonic() - self._began) * self.speed

    def start(self) -> None:
        with self._lock:
            if not self.measuring:
                self._start_at = self.now()
                self.measuring, self._taken = True, math.ceil(self._start_at * self.rate)
                last = self.events[-1]["experimentTime"] if self.events else 0.0
                self._shift = last - self._start_at
                self.events.append({"event": "START", "experimentTime": last, "systemTime": 1.7e9 + self._start_at})

    def pause(self) -> None:
        with self._lock:
            self._measure()
            if self.measuring:
                self.measuring, at = False, self.now()  # one reading of the clock: between two, other work may run
                self.events.append({"event": "PAUSE", "experimentTime": at + self._shift, "systemTime": 1.7e9 + at})

    def _measure(self) -> None:
        """Take the samples up to now."""
        if not self.measuring:
            return
        count = math.floor(self.now() * self.rate) + 1
        at = np.arange(self._taken, max(count, self._taken)) / self.rate
        self._taken = max(count, self._taken)
        if len(at) and not self.stalled:
            self.buffers[self.outputs["t"]] += (at + self._shift).tolist()
            for axis, column in zip([name for name in "xyz" if name in self.outputs], self.motion(at).T, strict=False):
                self.buffers[self.outputs[axis]] += column.tolist()

    def answer(self, path: str) -> Any:
        parts = urlsplit(path)
        asked = dict(parse_qsl(parts.query, keep_blank_values=True))
        if parts.path == "/config":
            inputs = [{"source": self.source, "outputs": [{axis: name} for axis, name in self.outputs.items()]}]
            buffers = [{"name": name, "size": 0} for name in self.buffers]
            return {"title": self.title, "category": "Raw Sensors", "crc32": "e04c0bfa", "buffers": buffers,
                    "inputs": inputs if self.listed else [], "export": []}
        if parts.path == "/control":
            {"start": self.start, "stop": self.pause}[asked["cmd"]]()
            return {"result": True}
        if parts.path == "/time":
            return self.events if self.times else None
        with self._lock:
            self._measure()
            return {"buffer": {name: self._part(name, how) for name, how in asked.items()},
                    "status": {"session": self.session, "measuring": self.measuring, "timedRun": False, "countDown": 0}}

    def _part(self, name: str, how: str) -> Mapping[str, Any]:
        values = self.buffers[name]
        if not how:
            return {"size": 0, "updateMode": "single", "buffer": [_digits(value) for value in values[-1:]] or [None]}
        if how == "full":
            threshold, mode, reference = -math.inf, "full", values
        else:
            number, _, other = how.partition("|")
            threshold, mode, reference = float(number), "partial", self.buffers[other or name]
            threshold -= 1e-3 if self.repeats else 0.0
            threshold += 10.0 ** math.floor(math.log10(abs(threshold) / 1e7)) if threshold else 0.0
        if self.lagging and name == self.outputs.get("z"):
            values = values[:-self.lagging]
        found = [_digits(v) for v, at in zip(values, reference, strict=False) if at > threshold]
        return {"size": 0, "updateMode": mode, "buffer": found}


def _digits(value: float) -> float | None:
    return float(f"{value:.7e}") if math.isfinite(value) else None
