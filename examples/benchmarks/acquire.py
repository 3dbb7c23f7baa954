"""A long acquisition of 1000 samples per second: losses, memory, share of a core, and latency from reading to listener.

The virtual sensor is read for ``--seconds`` (600), each sample is written to a journal and heard by a listener, which
notes how long ago the reading was due. Then the journal is read: every sample must be in it.

Goals: no sample lost; memory flat; at most half a core; less than 100 ms from a reading to the screen, of which this is
the part before the page.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from machine import describe

from pendulum_env import Recording
from pendulum_env.bench.acquisition import Acquisition
from pendulum_env.bench.sources.virtual import Virtual


def memory() -> float:
    """Return the memory that this process has in use now [MB]; its largest so far where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
    return pages * resource.getpagesize() / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    given = parser.parse_args()
    print(describe())
    source = Virtual(rate=given.rate)
    acquisition = Acquisition(source)
    late = np.zeros(20_000, dtype=np.int64)  # chunks by how late their oldest reading was heard, in steps of 0.1 ms
    heard_last = begun = 0.0

    def before(at: np.ndarray, _values: np.ndarray) -> None:
        nonlocal heard_last
        heard_last = float(at[-1])

    def heard(at: np.ndarray, _values: np.ndarray) -> None:
        late[min(int(1e4 * (time.monotonic() - begun - float(at[0]))), len(late) - 1)] += 1

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "swing.csv"
        acquisition.open()
        opened = time.monotonic()
        while not heard_last:
            acquisition.poll(0.01, before)
        acquisition.start(path, duration=given.seconds)
        begun = opened + heard_last + 1.0 / given.rate  # when the run's first reading is due
        used, early, least = time.process_time(), 0.0, memory()
        while not acquisition.status.full:
            acquisition.poll(0.01, heard)
            if not early and acquisition.status.time > 0.1 * given.seconds:
                early = memory()
        used = (time.process_time() - used) / given.seconds
        last = memory()
        acquisition.close()
        samples, size = acquisition.status.samples, path.stat().st_size / 1e6
        recording = Recording.read(path)
    steps = np.diff(recording.time)
    kept = len(recording.time) == samples and bool(np.all(np.abs(steps - 1.0 / given.rate) < 1e-5))
    expected = round(given.seconds * given.rate) + 1
    print(f"{samples} samples in {given.seconds:g} s at {given.rate:g} per second, {expected - samples} missing, "
          f"{acquisition.status.lost} lost; the journal of {size:.1f} MB has {'all' if kept else 'NOT all'} of them")
    print(f"memory: {least:.1f} MB at the start, {early:.1f} MB after a tenth, {last:.1f} MB at the end "
          f"({last - early:+.1f} MB; goal: flat)")
    print(f"share of a core: {100.0 * used:.1f} % (goal: at most 50 %)")
    share = np.cumsum(late) / late.sum()
    half, most = (0.1 * (1 + int(np.argmax(share >= part))) for part in (0.5, 0.99))
    print(f"from a reading to a listener: median {half:.1f} ms, 99 % within {most:.1f} ms, longest "
          f"{0.1 * (1 + int(np.flatnonzero(late)[-1])):.1f} ms, of the oldest reading in each chunk (goal: 100 ms to "
          "the screen)")


if __name__ == "__main__":
    main()
