"""A session at the page of :mod:`pendulum_env.bench.page`: one source, its runs, and all that the page may order.

One thread acquires samples, and all orders that concern them are carried out in it, between two readings. Fits and
reports are computed in a second thread, the simulation beside the swing in a third, so that none of them stops the
samples.
"""

from __future__ import annotations

import json
import math
import queue
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import numpy as np

from integrators import MethodError, get
from pendulum_env.bench.acquisition import Acquisition
from pendulum_env.bench.journal import numbered
from pendulum_env.bench.source import TWIN, FloatArray, Source, name_and_unit
from pendulum_env.common.texts import clean
from pendulum_env.engine.rollout import rollout
from pendulum_env.lab import Fit, Recording, RecordingError, fit, turning_points
from pendulum_env.lab.recording import in_words
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.units import SceneError, number, one_of

WAIT = 0.01
"""Longest time [s] that a reading is waited for; orders of the page are carried out after it."""
BATCH = 0.015
"""Shortest time [s] between two events with samples, one frame of a screen."""
NEWS = 0.2
"""Shortest time [s] between two events with the state."""
WAITING = 2000
"""Events that a page may leave unread before it is cut off; it then connects again and is sent the past."""
MOST_POINTS = 12_000
"""Largest number of points of a curve that is sent to the page."""
SETTLED = 30.0
"""Length of a run [s] after which its release is no longer determined again for the simulation beside it."""
HORIZON = 60.0
"""Shortest duration [s] of the simulation beside the swing."""
_ONE_AT_A_TIME = threading.Lock()  # warnings are collected for the whole process, not for one thread

T = TypeVar("T")


class OrderError(SceneError):
    """An order of the page that cannot be carried out now, in one sentence."""


@dataclass(frozen=True)
class Beside:
    """The simulation beside the swing: scene, integrator, step [s] and length [m], None for those of the scene."""

    scene: str
    integrator: str
    dt: float | None = None
    length: float | None = None


@dataclass
class Session:
    """A source, its runs and what was computed from them.

    Attributes:
        source: the source, which :meth:`open` opens.
        out: file that "Save" writes; each run's journal is beside it, ``swing-run1.csv`` for ``swing.csv``.
        force: True lets "Save" replace an existing ``out``. Journals never replace a file.
        beside: the simulation that is drawn over the swing.
    """

    source: Source
    out: Path
    force: bool = False
    beside: Beside = field(default_factory=lambda: Beside("lab", "rk4"))
    shown: bool = False  # whether the simulation is wanted
    problem: str = ""
    run: int = 0
    file: Path | None = None  # of the present run, or the last one
    journals: tuple[Path, ...] = ()
    saved: tuple[Path, ...] = ()
    work: dict[str, Any] | None = None
    found: dict[str, Any] | None = None
    report: dict[str, Any] | None = None
    curves: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        find_scene(self.beside.scene)
        get(self.beside.integrator)
        self.acquisition = Acquisition(self.source)
        self._asked: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = queue.SimpleQueue()
        self.pages: list[queue.Queue[str | None]] = []
        self._pending: list[tuple[list[float], list[float]]] = []
        self._latest, self._turned, self._before = math.nan, 0.0, math.inf
        self._flushed = self._told = 0.0
        self._last = ""
        self._over = threading.Event()
        self._live = False
        self._workers = ThreadPoolExecutor(1, "bench-work")
        self._twin = self.source.columns.index(TWIN) if TWIN in self.source.columns else 0
        self._beside_it: list[tuple[float, float]] = []  # times and angles of the twin in the present run
        self.shown = self.shown or bool(self._twin)
        self._next = 0.0
        self._drawn: tuple[Any, ...] = ()
        self._threads: list[threading.Thread] = []
        self.folders: dict[str, Path] = {}

    # --- the thread of the samples ------------------------------------------------------------------------------------

    def open(self) -> None:
        """Open the source and begin to acquire; raises SourceError."""
        self.acquisition.open()
        self._live = True
        self._threads = [threading.Thread(target=target, daemon=True, name=f"bench-{target.__name__}")
                         for target in (self._acquire, self._follow)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the run, close the source and end all threads and pages; closing twice is allowed."""
        self._over.set()
        for thread in self._threads:
            thread.join(timeout=5.0)
        self._workers.shutdown(wait=False, cancel_futures=True)
        with suppress(OSError):  # of the journal's last lines, on a full disk
            self.acquisition.close()
        for page in self.pages:
            with suppress(queue.Full):
                page.put_nowait(None)

    def _acquire(self) -> None:
        while not self._over.is_set():
            while not self._asked.empty():
                order, answer = self._asked.get()
                try:
                    answer.set_result(order())
                except BaseException as error:  # it belongs to the one who ordered
                    answer.set_exception(error)
            self._poll()
            self._flush()

    def _poll(self) -> None:
        """Take samples; a source or a file that fails is said, and ends neither the page nor what was written."""
        if not self._live:
            time.sleep(WAIT)
            return
        try:
            if self.acquisition.poll(WAIT, self._heard):
                return
            self.problem = "The source has ended."
        except Exception as error:  # of a source of one's own, too; the page stays alive, and says it
            if isinstance(error, OSError) and self.acquisition.status.recording:
                self.problem = f"The run was stopped: {self.file} cannot be written ({error.strerror or error})."
                self._stop()
                return
            self.problem = sentence(error)
        self._live = False
        self._stop()

    def _heard(self, at: FloatArray, values: FloatArray) -> None:
        shown = (values[:, 0] * self.factor).tolist()
        self._latest = shown[-1]
        if self.source.quantity == "rate":
            self._integrate(at, values[:, 0])
        if self.acquisition.status.recording:
            self._pending.append((np.round(at, 6).tolist(), shown))
            if self._twin:
                self._beside_it += zip(at.tolist(), (values[:, self._twin] * self.factor).tolist(), strict=True)

    def _integrate(self, at: FloatArray, rates: FloatArray) -> None:
        """Add to the angle since zero [degrees], which a gyroscope's page shows beside its rate."""
        degrees = 1.0 if not self.title[1].lower().startswith("rad") else math.degrees(1.0)
        steps = np.diff(at, prepend=self._before if 0.0 < at[0] - self._before < 1.0 else at[0])
        self._turned, self._before = self._turned + degrees * float(rates @ steps), float(at[-1])

    def _zero(self) -> None:
        self._turned = 0.0
        if self.source.quantity != "rate":  # of a gyroscope, the integrated angle alone begins at 0
            self.acquisition.set_zero()

    def _flush(self) -> None:
        """Send what came since the last frame, and the state if it changed."""
        now = time.monotonic()
        if now - self._flushed >= BATCH and math.isfinite(self._latest):
            self._flushed = now
            times = [t for part, _ in self._pending for t in part]
            values = [round(y, 6) for _, part in self._pending for y in part]
            self._pending.clear()
            self._tell({"kind": "samples", "run": self.run, "t": times, "y": values, "now": round(self._latest, 6),
                        **({"angle": round(self._turned, 3)} if self.source.quantity == "rate" else {})})
        if now - self._told >= NEWS:
            self._told = now
            state = self._state_text()
            if state != self._last:
                self._last = state
                self._broadcast(state)

    def _tell(self, event: Mapping[str, Any]) -> None:
        self._broadcast(json.dumps(event))

    def _broadcast(self, text: str) -> None:
        for page in list(self.pages):
            try:
                page.put_nowait(text)
            except queue.Full:
                self.pages.remove(page)
                page.get_nowait()
                page.put_nowait(None)

    def between(self, order: Callable[[], T], timeout: float = 30.0) -> T:
        """Carry out an order in the thread of the samples, between two readings, and return its result."""
        answer: Future[T] = Future()
        self._asked.put((order, answer))
        if self._over.is_set():
            raise OrderError("The acquisition has ended.")
        return answer.result(timeout)

    def listen(self) -> queue.Queue[str | None]:
        """Return a queue of events for one page, which begins with the state, the past and the curves."""
        page: queue.Queue[str | None] = queue.Queue(WAITING)

        def begin() -> None:
            self._flushed = 0.0
            self._flush()  # the past holds what is still pending, which a new page must not get twice
            past = self.acquisition.past
            page.put(self._state_text())
            page.put(json.dumps({"kind": "past", "run": self.run, "t": np.round(past.time, 6).tolist(), "y": [
                round(value * self.factor, 6) for value in past.values], "now": _finite(self._latest)}))
            for name, curve in self.curves.items():
                page.put(json.dumps({"kind": "curve", "name": name, **curve}))
            self.pages.append(page)

        self.between(begin)
        return page

    def leave(self, page: queue.Queue[str | None]) -> None:
        """Forget a page that was closed."""
        with suppress(ValueError):
            self.pages.remove(page)

    # --- what the page shows ------------------------------------------------------------------------------------------

    @property
    def title(self) -> tuple[str, str]:
        """Name and unit of the reading, as the page shows it: angles in degrees."""
        name, unit = name_and_unit(self.source.columns[0])
        return name, "°" if self.source.quantity == "angle" else unit

    @property
    def factor(self) -> float:
        """Factor from a reading in the unit of its title to one on the page: degrees for angles."""
        radians = self.source.quantity == "angle" and name_and_unit(self.source.columns[0])[1].lower().startswith("rad")
        return math.degrees(1.0) if radians else 1.0

    def _state_text(self) -> str:
        status, acquisition = self.acquisition.status, self.acquisition
        name, unit = self.title
        return json.dumps({
            "kind": "state", "source": self.source.name, "about": _about(self.source),
            "quantity": self.source.quantity, "title": name, "unit": unit, "hand": hasattr(self.source, "lift"),
            "counted": hasattr(self.source, "counts"), "counts": getattr(self.source, "counts", None),
            "notes": [clean(note, 300) for note in acquisition.notes], "live": self._live,
            "problem": self.problem, "run": self.run, "recording": status.recording, "samples": status.samples,
            "lost": status.lost, "rate": _finite(status.rate), "sign": acquisition.sign,
            "zero": acquisition.zero * self.factor, "file": clean(self.file.name) if self.file else "",
            "save_as": clean(self._free_name()), "saved": [clean(path.name) for path in self.saved],
            "work": self.work, "fit": self.found, "report": self.report,
            "beside": {**vars(self.beside), "shown": self.shown, "twin": bool(self._twin),
                       "problem": str(self.curves.get("beside", {}).get("problem", ""))},
        })

    def _free_name(self) -> str:
        """Return the name under which "Save" would write: that of ``out``, with a number if there is one already."""
        if self.force and self.out not in self.saved:
            return self.out.name
        return next(path.name for path in numbered(self.out) if not path.exists())

    # --- orders of the page -------------------------------------------------------------------------------------------

    def do(self, what: str, wanted: Mapping[str, Any]) -> dict[str, Any]:
        """Carry out an order of the page; raises SceneError, with a sentence, for one that cannot be carried out."""
        orders: dict[str, Callable[[Mapping[str, Any]], dict[str, Any] | None]] = {
            "zero": lambda _: self.between(self._zero), "sign": lambda _: self.between(self._reverse),
            "start": lambda _: self.between(self._start), "stop": lambda _: self.between(self._stop),
            "again": lambda _: self.between(self._again), "counts": self._counts, "lift": self._lift,
            "release": self._release, "beside": self._beside, "fit": self._fit, "report": self._report,
            "save": self._save,
        }
        return orders[one_of(what, "order", orders)](wanted) or {}

    def _start(self) -> None:
        if self.acquisition.status.recording:
            raise OrderError("A run is being recorded; stop it first.")
        if not self._live:
            self._again()
        number_, path = next((i, path) for i, path in enumerate(numbered(self.out, "run"), 1) if not path.exists())
        try:
            self.acquisition.start(path)
        except OSError as error:
            raise OrderError(f"{path} cannot be written: {error.strerror or error}.") from None
        self.run, self.file, self.problem = number_, path, ""
        self.journals = (*self.journals, path)
        self.found = self.report = None
        self.curves.clear()
        self._pending.clear()
        self._beside_it = []
        self._next, self._drawn = 0.0, ()
        self._tell({"kind": "past", "run": self.run, "t": [], "y": [], "now": _finite(self._latest)})

    def _stop(self) -> None:
        self._next = 0.0
        try:
            self.acquisition.stop()
        except OSError as error:  # the last lines, on a full disk
            self.problem = f"The end of {self.file} cannot be written ({error.strerror or error})."

    def _again(self) -> None:
        """Open the source again, after it has ended or was lost."""
        if self.acquisition.status.recording:
            raise OrderError("A run is being recorded; stop it first.")
        kept = self.acquisition
        with suppress(OSError):
            kept.close()
        self.acquisition = Acquisition(self.source, sign=kept.sign)
        self.acquisition.zero, self.acquisition.past = kept.zero, kept.past
        self._live = False
        self.acquisition.open()
        self._live, self.problem = True, ""

    def _reverse(self) -> None:
        if self.acquisition.status.recording:
            raise OrderError("The sign cannot change within a run; stop it first.")
        self.acquisition.sign = -self.acquisition.sign

    def _counts(self, wanted: Mapping[str, Any]) -> None:
        if not hasattr(self.source, "counts"):
            raise OrderError("This source counts no turns; its readings have a unit of their own.")
        counts = number(wanted.get("counts"), "counts per turn", above=0.0)

        def change() -> None:
            if self.acquisition.status.recording:
                raise OrderError("The counts per turn cannot change within a run; stop it first.")
            changed: Any = {"counts": int(counts) if counts.is_integer() else counts}
            source = replace(self.source, **changed)
            self.acquisition.close()
            self.source = source
            self._again()

        self.between(change)

    def _hand(self) -> Any:
        if not hasattr(self.source, "lift"):
            raise OrderError("This pendulum is lifted by hand; only a virtual one can be lifted here.")
        return self.source

    def _lift(self, wanted: Mapping[str, Any]) -> None:
        angle = number(wanted.get("angle"), "angle", least=-360.0, unit="degrees")
        if angle > 360.0:
            raise OrderError("The angle must be from -360 to 360 degrees.")
        source, acquisition = self._hand(), self.acquisition  # the bob goes where the sensor then reads the angle
        zero = 0.0 if wanted.get("rest") else acquisition.zero * self.factor
        source.lift(math.radians((0.0 if wanted.get("rest") else acquisition.sign * angle) + zero))

    def _release(self, wanted: Mapping[str, Any]) -> None:
        self._hand().release()

    # --- files --------------------------------------------------------------------------------------------------------

    def so_far(self) -> bytes:
        """Return the present journal up to its last complete line; raises OrderError without a run."""
        if self.file is None:
            raise OrderError("There is no run yet; press Start.")
        text = self.file.read_bytes()
        return text[:text.rfind(b"\n") + 1]

    @contextmanager
    def recording(self) -> Iterator[Recording]:
        """The run so far, as :class:`pendulum_env.Recording` reads it."""
        text = self.so_far()
        assert self.file is not None
        with TemporaryDirectory() as folder:
            copy = Path(folder) / self.file.name
            copy.write_bytes(text)
            yield Recording.read(copy)

    def _save(self, wanted: Mapping[str, Any]) -> dict[str, Any]:
        name, text = wanted.get("name") or self._free_name(), self.so_far()
        if not isinstance(name, str) or Path(name).name != name or name in (".", "..") or "\\" in name:
            raise OrderError("The name must be that of a file, without a folder.")
        path = self.out.with_name(name)
        lines = [*str(wanted.get("notes") or "").splitlines(), *map(str, wanted.get("readings") or ())]
        comments = "".join(f"# {clean(line, 300)}\n" for line in lines if line.strip()).encode()
        first = text.find(b"\n") + 1  # the line by which a journal is recognised
        replaces = self.force and path == self.out and path not in self.saved
        try:
            with path.open("wb" if replaces else "xb") as file:
                file.write(text[:first] + comments + text[first:])
        except FileExistsError:
            raise OrderError(f"{path} exists already; choose another name.") from None
        except (OSError, ValueError) as error:
            raise OrderError(f"{path} cannot be written: {getattr(error, 'strerror', None) or error}.") from None
        self.saved = (*self.saved, path)
        return {"file": clean(str(path), 300)}

    # --- work that takes time -----------------------------------------------------------------------------------------

    def _start_work(self, what: str, job: Callable[[], None]) -> None:
        if self.work is not None:
            raise OrderError(f"The {self.work['what']} is still being computed.")
        self.so_far()
        self.work = {"what": what, "done": 0.0, "text": "reading"}
        run = self.run

        def whole() -> None:
            try:
                job()
                if self.run == run:
                    self.problem = ""
            except Exception as error:  # said on the page, which stays alive
                self.problem = f"The {what} was not computed: {sentence(error)}"
            finally:
                self.work = None

        self._workers.submit(whole)

    def _progress(self, share: float = 1.0, start: float = 0.0) -> Callable[[float, str], None]:
        def progress(done: float, text: str) -> None:
            if self.work is not None:
                self.work = {**self.work, "done": round(start + share * done, 3), "text": text}
        return progress

    def _fit(self, wanted: Mapping[str, Any]) -> None:
        run, effects = self.run, str(wanted.get("effects") or "auto")
        mass = wanted.get("mass")
        known: dict[str, Any] = {} if mass is None else {"mass": number(mass, "mass", above=0.0, unit="kg")}

        def job() -> None:
            with self.recording() as recording, _warnings() as told:
                found = fit(recording, effects, progress=self._progress(), **known)
            if self.run != run:
                return
            start, readings = found.recording.release or 0.0, found.recording.readings - found.residual
            self.curves["fit"] = self._curve(found.recording.time + start, readings, found.recording)
            self.found = {"words": _words(found), "warnings": told, "until": float(recording.time[-1])}
            self.between(lambda: self._tell({"kind": "curve", "name": "fit", **self.curves["fit"]}))

        self._start_work("fit", job)

    def _report(self, wanted: Mapping[str, Any]) -> None:
        from pendulum_env.exercise.given import Given
        from pendulum_env.exercise.report import need_jinja, write
        from pendulum_env.exercise.worked import work_out

        need_jinja()
        run, file, name = self.run, self.file, str(wanted.get("name") or "")

        def job() -> None:
            assert file is not None
            with self.recording() as recording, _warnings():
                worked = work_out(Given.of(recording=recording), progress=self._progress(0.3))
            folder = file.with_name(f"{file.stem}-report")
            paths = write(worked, folder, name=name, progress=self._progress(0.7, 0.3))
            self.folders[str(run)] = folder
            if self.run == run:
                self.report = {"link": f"report/{run}/{paths[0].name}", "folder": str(folder)}

        self._start_work("report", job)

    def _beside(self, wanted: Mapping[str, Any]) -> None:
        scene, integrator = str(wanted.get("scene", self.beside.scene)), str(wanted.get("integrator",
                                                                                       self.beside.integrator))
        find_scene(scene)
        get(integrator)
        dt, length = (None if wanted.get(name) is None else number(wanted[name], name, above=0.0)
                      for name in ("dt", "length"))
        chosen = Beside(scene, integrator, dt, length)
        shown = bool(wanted.get("shown", True))

        def change() -> None:
            self.beside, self.shown, self._next, self._drawn = chosen, shown, 0.0, ()
            self.curves.pop("beside", None)
            self._tell({"kind": "curve", "name": "beside", "t": [], "y": [], "v": []})

        self.between(change)

    def _follow(self) -> None:
        """Draw the simulation beside the swing anew whenever the release is known better or the run gets long."""
        while not self._over.wait(0.1):
            time_now = self.acquisition.status.time
            if not self.shown or self.file is None or time_now < self._next:
                continue
            later = max(1.02 * time_now, time_now + 0.4) if self._twin else max(1.3 * time_now, time_now + 0.5)
            self._next = later if self.acquisition.status.recording else math.inf
            run, wanted = self.run, self.beside
            try:
                curve = self._of_twin() if self._twin else self._simulated(wanted, time_now)
            except Exception as error:  # said on the page, which stays alive
                early = isinstance(error, RecordingError) and self.acquisition.status.recording
                said = "It begins after the first half swing." if early else sentence(error)
                curve = {"t": [], "y": [], "v": [], "problem": said}
            if curve is not None:
                with suppress(TimeoutError, OrderError):  # the page is being closed
                    self.between(partial(self._draw_beside, curve, run, wanted))

    def _draw_beside(self, curve: dict[str, Any], run: int, wanted: Beside) -> None:
        """Tell the pages the simulation beside the swing, unless another run or simulation has begun meanwhile."""
        if run == self.run and wanted == self.beside and self.shown:
            self.curves["beside"] = curve
            self._tell({"kind": "curve", "name": "beside", **curve})

    def _of_twin(self) -> dict[str, Any] | None:
        """Return the curve of the source's own simulation, of the same actions; None before it has two points."""
        time_, angle = np.array(self._beside_it[:]).reshape(-1, 2).T
        if len(time_) < 2:
            return None
        return _points(time_, angle, np.gradient(angle, time_))

    def _simulated(self, wanted: Beside, now: float) -> dict[str, Any] | None:
        """Return the simulation from the recording's own release on; None if that of before still holds."""
        if self.source.quantity == "force":
            raise OrderError("The simulation beside the swing is compared with angles and angular velocities only.")
        if now > SETTLED and self._drawn and now < self._drawn[0]:
            return None
        with self.recording() as recording, _warnings():
            free = recording.kept(until=SETTLED).released() if now > SETTLED else recording.released()
        start = (free.release or 0.0) + float(free.time[0])
        angle, velocity, zero = beginning(free)
        horizon = max(HORIZON, 2.0 * now) - start
        known: dict[str, Any] = {} if wanted.length is None else {"length": wanted.length}
        with _warnings():
            motion = rollout(wanted.scene, integrator=wanted.integrator, angle=angle, velocity=velocity, dt=wanted.dt,
                             duration=horizon, diagnostics=(), warn=False, **known)
        self._drawn = (0.9 * (horizon + start),)
        seen = np.isfinite(motion.angle) & np.isfinite(motion.velocity) & (np.abs(motion.angle) < 1e4)
        end = len(seen) if seen.all() else int(np.argmin(seen))
        angles = motion.angle[:end] + (zero if free.rate is None else 0.0)
        readings, slope = (angles, motion.velocity[:end]) if free.rate is None else (motion.velocity[:end], None)
        title = motion.scene.body
        return {**self._curve(motion.time[:end] + start, readings, free, slope), "start": math.degrees(angle),
                "release": start, "dt": motion.dt, "body": {
                    "radius": title.radius, "reach": title.reach, "suspension": title.suspension,
                    "outline": title.outline}}

    def _curve(self, time: FloatArray, readings: FloatArray, like: Recording, slope: FloatArray | None = None,
               ) -> dict[str, Any]:
        """Return a curve for the page: times [s], readings in its unit, and their rates per second."""
        factor = in_words(like, 1.0)[0]
        if like.rate is not None and self.title[1].lower().startswith("rad"):
            factor = 1.0
        if slope is None:
            slope = np.gradient(readings, time)
        return _points(time, factor * readings, factor * slope)


def _points(time: FloatArray, readings: FloatArray, slope: FloatArray) -> dict[str, Any]:
    """Return a curve in the form of the page, thinned if it is long."""
    every = max(1, math.ceil(len(time) / MOST_POINTS))
    parts = {"t": time, "y": readings, "v": slope}
    return {name: [float(f"{value:.7g}") for value in part[::every].tolist()] for name, part in parts.items()}


def sentence(error: Exception) -> str:
    """Return what the page says of an error: a known one's own sentence, else with the name of its kind."""
    if isinstance(error, TimeoutError):
        return "The source did not answer in time."
    known = isinstance(error, (SceneError, MethodError, OSError, ImportError))
    return clean(str(error) if known else f"{type(error).__name__}: {error}", 500)


def _words(found: Fit) -> list[str]:
    """Return a fit in words: period, length, damping with errors, and whether it is usable."""
    period = math.tau / found.scene.omega0
    words = []
    if "length" in found.names:
        length = found.parameters["length"]
        error = 0.5 * period * length.error / length.value
        words.append(f"Period of small swings: {replace(length, value=period, error=error, unit='s')}.")
    else:
        words.append(f"Period of small swings: {period:.5g} s.")
    for name in found.names:
        effect, _, own = name.replace("_", " ").rpartition(".")
        if effect or own in ("length", "scale"):
            words.append(f"{own.capitalize()}{f' of {effect}' if effect else ''}: {found.parameter_text(name)}.")
    words.insert(2, f"Damping: {found.damping.replace('+', ' and ')}." if found.damping else "Damping: none.")
    alike = [] if found.comparison is None else [name for name in found.comparison.alike if name != found.damping]
    if alike:
        words.append(f"The swing so far cannot tell this damping from {', '.join(alike).replace('+', ' and ')}.")
    return [*words, f"Residual {found.shown(found.rms):.2g}{found.sign} rms; a reading's error is "
                    f"{found.shown(found.noise):.2g}{found.sign}.", found.grade.text]


def beginning(free: Recording) -> tuple[float, float, float]:
    """Return angle [rad] and velocity [rad/s] at the first reading of a free swing, and its equilibrium [rad].

    They are those of ``(a + a' w t) cos(w t) + (b + b' w t) sin(w t)`` and the third harmonic, fitted to the first
    period, with w from the turning points. With fewer than three turning points the first reading is taken, at rest.
    """
    try:
        swing = free.centred()
        turns = turning_points(swing).time
    except RecordingError:
        turns = np.empty(0)
    if len(turns) < 3:
        return float(free.angle[0]), 0.0, 0.0
    rate = math.tau / float(turns[2] - turns[0])
    phase = rate * (swing.time - swing.time[0])
    x = phase[phase <= math.tau]
    basis = np.stack([np.cos(x), np.sin(x), x * np.cos(x), x * np.sin(x), np.cos(3.0 * x), np.sin(3.0 * x)], axis=1)
    a, b, slope, _, a3, b3 = np.linalg.lstsq(basis, swing.angle[:len(x)], rcond=None)[0].tolist()
    return a + a3, rate * (b + slope + 3.0 * b3), float(np.median(free.angle - swing.angle))


@contextmanager
def _warnings() -> Iterator[list[str]]:
    """Collect warnings as sentences for the page instead of writing them to the terminal."""
    told: list[str] = []
    with _ONE_AT_A_TIME, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield told
    told += [str(one.message) for one in caught]


def _about(source: Source) -> str:
    """Return what a source is, and those of its settings that are not the usual ones, as one line."""
    given = [f"{one.name} {getattr(source, one.name)!s}" for one in fields(source)
             if one.init and getattr(source, one.name) not in (one.default, None)]
    return clean("; ".join([source.about, *given]), 200)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
