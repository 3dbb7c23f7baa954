"""Latency of the page of acquire: the time from a reading to the frame that shows it, in Chromium without a screen.

Needs playwright (`pip install -e ".[test]"`) and a Chromium on the path. A source gives readings that are the times at
which they were due; the page notes, after each frame was painted, the latest reading that is in it. The time of a
reading is that until the first such frame. What a screen adds, one of its frames and its own delay, is not in it.
"""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import sync_playwright

from pendulum_env.bench.page import served
from pendulum_env.bench.source import Chunk, Source


@dataclass(frozen=True, repr=False, eq=False)
class Ticking(Source):
    """Readings that are the times [s] since the source was opened at which they were due, ``rate`` of them a second."""

    name: ClassVar[str] = "ticking"
    about: ClassVar[str] = "readings that are their own times"
    tested: ClassVar[str] = "the benchmark of the latency"

    rate: float = 100.0
    _state: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def open(self) -> None:
        """Begin to count."""
        self._state.update(count=0, began=time.time())

    def read(self, timeout: float = 0.1) -> Chunk:
        """Return the readings that are due."""
        state, until = self._state, time.monotonic() + timeout
        while (due := int((time.time() - state["began"]) * self.rate)) <= state["count"]:
            if time.monotonic() >= until:
                return Chunk(np.empty((0, 1)), np.empty(0))
            time.sleep(0.0005)
        at = np.arange(state["count"] + 1, due + 1) / self.rate
        state["count"] = due
        return Chunk(at[:, None], at)

    def close(self) -> None:
        """Nothing is to be closed."""


def screen_latency(rate: float = 100.0, duration: float = 8.0) -> NDArray[np.float64]:
    """Return the times [s] from readings, ``rate`` of them a second, to the painted frames that show them, sorted.

    The first second, in which the browser compiles the page, is left out.
    """
    source = Ticking(rate)
    with (TemporaryDirectory() as folder, served(source, out=Path(folder) / "x.csv") as page,
          sync_playwright() as driver):
        path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        shown = browser.new_page(viewport={"width": 1280, "height": 800})
        shown.goto(page.address)
        shown.click("#start")
        shown.wait_for_timeout(1000.0 * duration)
        drawn = np.array(shown.evaluate("LabPendulum.desk.drawn"), dtype=float)
        browser.close()
    drawn = drawn[np.isfinite(drawn[:, 0])]
    latest, painted = drawn[:, 0], drawn[:, 1] / 1000.0 - source._state["began"]
    readings = np.arange(np.floor((latest[0] + 1.0) * rate) + 1, np.floor(latest[-1] * rate + 0.5) + 1) / rate
    first = np.searchsorted(latest, readings - 1e-5)
    return np.sort(painted[first] - readings)


if __name__ == "__main__":
    for rate in (100.0, 1000.0):
        found = 1000.0 * screen_latency(rate)
        print(f"{rate:g} readings a second: {np.median(found):.0f} ms from a reading to the screen, 95 % within "
              f"{np.quantile(found, 0.95):.0f} ms, the longest of {len(found)} {found[-1]:.0f} ms")
