"""Track the bob of a film: places in every frame, angles with errors, and a verdict in plain words."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from pendulum_env.common.progress import Progress, part_of, with_bar
from pendulum_env.common.results import Plotted, one_line
from pendulum_env.common.texts import Table
from pendulum_env.lab.checked import Drop, FloatArray, RecordingError, file_name, numbers, one_number, spans
from pendulum_env.lab.film.finding import CLEAR, FAINTEST, Sample, Swing, basis, gains, moved, sampled, spots_of, swings
from pendulum_env.lab.film.frames import CHANNELS, Film, Picture, packages, smaller
from pendulum_env.lab.film.geometry import alone, angles_of, bent_of, blurred, calibrated, middle_of, rest_of
from pendulum_env.lab.film.position import LARGE, Bob, Place, background_of
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.recording import Filmed, Recording
from pendulum_env.lab.tracks import fit_circle
from pendulum_env.physics.units import shown

_FINDING = 0.4  # of the progress bar
_LEAST = 0.3  # least share of the frames that are read
_FEW = 12  # readings
_REPEATED = 0.3  # of the change that the bob's motion makes: a picture that changes less is the one before
_MOVES = 0.5  # pixels per frame, from which a repeated picture is told from a bob that turns back
_BENT = 0.02  # cube of the angle, from which a picture is too bent
_SHAKEN = 0.7  # pixels: a camera that moves further is refused


@dataclass(frozen=True, eq=False, repr=False)
class FilmTrack(Plotted):
    """The track of a bob in a film; ``recording`` is what a fit takes, ``print`` shows a verdict.

    Attributes:
        source: name of the film.
        time, angle, error: arrays of the readings [s, rad, rad]; angles are from the middle of the swing, positive to
            the right, and errors standard errors of one reading, without those of the pivot.
        rest: array of what a smooth swing leaves of the angles [rad]; NaN where too few readings are near.
        x, y: arrays of the bob's place in the picture [pixels], from the middle of the pixel at the top left, y down.
        pivot: (x, y) of the pivot [pixels].
        radius: distance of the bob from the pivot [pixels], with its error.
        bob: half the bob's width [pixels].
        frames: number of frames that were looked at.
        left_out: number of frames without a reading, by reason.
        missing: array of the times of these frames [s].
        step: usual time between frames [s].
        even: True if all times between frames are about the same.
        exposure: time for which each frame was exposed [s], as the streaks of the bob show it.
        blur: longest streak [pixels].
        roll: angle [rad] of the swing's middle from straight down in the picture.
        swings: what swings in the film, in words; the first was followed.
        notes: one line for each thing that was inferred.
        picture: a frame of the film in grey, for figures.
        size: (width, height) of the film [pixels].
        rate: frames per second that were given [Hz]; None: by the time stamps of the file.
        end: time of the last frame that was looked at [s].
        complete: False if tracking was interrupted.
    """

    source: str
    time: FloatArray
    angle: FloatArray
    error: FloatArray
    rest: FloatArray
    x: FloatArray
    y: FloatArray
    pivot: tuple[float, float]
    radius: Measurement
    bob: float
    frames: int
    left_out: dict[str, int]
    missing: FloatArray
    step: float
    even: bool
    exposure: float
    blur: float
    roll: float
    swings: tuple[str, ...]
    notes: tuple[str, ...]
    picture: Picture
    size: tuple[int, int]
    rate: float | None
    end: float
    complete: bool = True

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.time)} readings in {self.frames} frames")

    @property
    def recording(self) -> Recording:
        """The track as a recording: times, angles, errors, and notes."""
        away = np.hypot(self.x - self.pivot[0], self.y - self.pivot[1])
        return Recording(self.time, self.angle, self.source, (*self.notes, *self.verdict), radius=self.radius,
                         error=self.error, filmed=Filmed(self.frames, len(self.time), 1.0 / self.step, self.blur,
                                                         float(away.std()), self.roll))

    @property
    def share(self) -> float:
        """Share of the frames with a reading."""
        return len(self.time) / self.frames

    @property
    def table(self) -> Table:
        """Table of quantities: frames, rate, readings, error of one, bob, pivot, radius, blur, roll."""
        rate = f"{1.0 / self.step:.5g} Hz, {'even' if self.even else 'uneven'}"
        rows = [("frames", f"{self.frames}"), ("frames with a reading", f"{100.0 * self.share:.1f} %"),
                ("rate", rate), ("error of a reading", f"{math.degrees(float(np.median(self.error))):.2g} degrees, "
                                 f"{float(np.median(self.error)) * self.radius.value:.2g} pixels"),
                ("width of the bob", f"{2.0 * self.bob:.3g} pixels"),
                ("pivot", f"({self.pivot[0]:.1f}, {self.pivot[1]:.1f})"), ("radius", f"{self.radius}"),
                ("longest streak", f"{self.blur:.2g} pixels"),
                ("roll of the camera", f"{math.degrees(self.roll):.2f} degrees")]
        return Table(("quantity", "value"), tuple(rows))

    @property
    def verdict(self) -> tuple[str, ...]:
        """Sentences on what was followed, what is missing, and what to do about it."""
        lines = [f"film: {len(self.time)} readings in {self.frames} frames at {1.0 / self.step:.5g} Hz, error of one "
                 f"{math.degrees(float(np.median(self.error))):.2g} degrees"]
        if self.left_out:
            reasons = ", ".join(f"{count} {why}" for why, count in self.left_out.items())
            lines.append(f"left out: {reasons}")
        lines.append(f"followed: what swings with {self.swings[0]}" + (
            f"; also seen: {'; '.join(self.swings[1:])} (bob= chooses)" if len(self.swings) > 1 else ""))
        if not self.complete:
            lines.append(f"interrupted at {self.time[-1]:.4g} s; what was tracked until then is kept")
        return tuple(lines)

    @property
    def text(self) -> str:
        """The verdict and the notes, a line each."""
        return "\n".join((*self.verdict, *self.notes))

    def __str__(self) -> str:
        return self.text


def track(
    path: str | os.PathLike[str],
    *,
    pivot: Sequence[float] | None = None,
    bob: Sequence[float] | None = None,
    length: float | None = None,
    until: float | None = None,
    drop: Drop | None = None,
    rate: float | None = None,
    progress: Progress | bool | None = None,
) -> Recording:
    """Return the swing of a filmed pendulum as a recording [s, rad] with an error for each angle.

    :func:`follow` describes how, its arguments and errors, and returns the places in the picture, too.
    """
    return follow(path, pivot=pivot, bob=bob, length=length, until=until, drop=drop, rate=rate,
                  progress=progress).recording


@with_bar("track")
def follow(
    path: str | os.PathLike[str],
    *,
    pivot: Sequence[float] | None = None,
    bob: Sequence[float] | None = None,
    length: float | None = None,
    until: float | None = None,
    drop: Drop | None = None,
    rate: float | None = None,
    progress: Progress | bool | None = None,
) -> FilmTrack:
    """Follow the bob of a filmed pendulum from frame to frame.

    The bob is found by its motion (:mod:`pendulum_env.lab.film.finding`), placed within a pixel by least squares
    (:mod:`pendulum_env.lab.film.position`), and its angle measured about the centre of the circle through its places
    (:mod:`pendulum_env.lab.film.geometry`). Ctrl-C ends the film there; what was tracked is returned.

    Args:
        path: the film, of any kind that FFmpeg reads.
        pivot: (x, y) of the pivot [pixels] from the top left, y down; None: the centre of the circle.
        bob: (x, y) of a place on the bob's way [pixels], which chooses among several things that swing.
        length: distance of the bob from the pivot [m], for the scale of the picture, which is noted.
        until: time in the film [s] after which frames are left out.
        drop: times in the film [s] between which readings are left out: "12.5:13.1", (12.5, 13.1), or several.
        rate: frames per second at which the camera recorded [Hz], for slow motion; None: as the file says.
        progress: as for other long computations; True shows a bar.

    Raises RecordingError for a file that is no film, if nothing swings in it or the camera moves, if the arc is too
    short to find its pivot, and if fewer than 30 % of the frames could be read.
    """
    tell: Progress = progress  # type: ignore[assignment]
    name = file_name(path)
    where = {"pivot": _point(pivot, "pivot"), "bob": _point(bob, "bob")}
    dropped = [] if drop is None else spans(drop)
    size = None if length is None else one_number(length, "length", above=0.0, unit="m")
    film, sample, found = _found(name, rate, until, part_of(tell, 0.0, _FINDING))
    chosen = _chosen(film, found, where["bob"])
    shrink = max(1, int(chosen.width / LARGE))
    near = shrunk(where["pivot"], shrink)
    read = _Reading(film, shrink, *_learned(film, sample, chosen.shrunk(shrink), near, shrink))
    complete = read.all(part_of(tell, _FINDING, 1.0))
    return _result(film, read, chosen, found, where["pivot"], size, dropped, complete,
                   sample.full[len(sample.full) // 2], rate)


def shrunk(point: tuple[float, float] | None, by: int) -> tuple[float, float] | None:
    """Return the place in a picture made smaller ``by`` a number of a place in the picture as it was."""
    return None if point is None else ((point[0] + 0.5) / by - 0.5, (point[1] + 0.5) / by - 0.5)


def _point(value: Any, name: str) -> tuple[float, float] | None:
    """Return a place in the picture as two floats; RecordingError for another value."""
    if value is None:
        return None
    try:
        point = numbers(value, name)
    except RecordingError:
        point = np.empty(0)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise RecordingError(f"{name} must be (x, y), two numbers in pixels from the top left, got {shown(value)}")
    return float(point[0]), float(point[1])


def _found(name: str, rate: float | None, until: float | None, tell: Progress) -> tuple[Film, Sample, list[Swing]]:
    """Return the film in the channel in which something swings, its first part, and what swings there."""
    best: tuple[Film, Sample, list[Swing]] | None = None
    for channel in range(len(CHANNELS)):
        film = Film(name, rate=rate, until=until, channel=channel)
        sample = sampled(film, tell)
        if not channel and (shift := moved(sample)) > _SHAKEN:
            raise RecordingError(f"{film.name}: the camera moves, by {shift:.2g} pixels; put it on a stand, or lean it "
                                 "against something heavy, as angles are measured from its picture")
        found = swings(sample)
        if found and (best is None or found[0].rank > 1.5 * best[2][0].rank):
            best = film, sample, found
        if best is not None and best[2][0].rank > CLEAR:
            break
    if best is None or best[2][0].rank < FAINTEST:
        raise RecordingError(f"{film.name}: nothing swings to and fro in the film as a pendulum's bob does; the camera "
                             "must stand still, and the bob look unlike the wall")
    return best


def _chosen(film: Film, found: list[Swing], bob: tuple[float, float] | None) -> Swing:
    """Return the swing whose way leads through a place, by default the one of the highest rank."""
    if bob is None:
        return found[0]
    far = [float(np.hypot(one.x - bob[0], one.y - bob[1]).min()) for one in found]
    best = int(np.argmin(far))
    if not far[best] < 3.0 * found[best].width + 10.0:
        ways = "; ".join(one.in_words() for one in found)
        raise RecordingError(f"{film.name}: nothing swings through bob=({bob[0]:g}, {bob[1]:g}); what swings: {ways}")
    return found[best]


class Guess:
    """Where the bob is expected: between its known places or, where there are none, by its harmonics."""

    def __init__(self, swing: Swing, pivot: tuple[float, float]) -> None:
        self.omega, self.pivot = swing.omega, pivot
        self.times, self.points = swing.times, np.stack([swing.x, swing.y], axis=1)
        self._fitted: tuple[float, float, FloatArray] | None = None
        self.own: list[tuple[float, float, float]] = []

    def _harmonic(self, t: float) -> FloatArray:
        """Return the place by harmonics fitted to the places of the nearest periods."""
        span = 2.5 * math.tau / self.omega
        if self._fitted is None or not self._fitted[0] - 0.2 * span <= t <= self._fitted[1]:
            times, points = self.times, self.points
            if self.own and t > self.times[-1]:
                recent = np.array(self.own[-4000:])
                times, points = recent[:, 0], recent[:, 1:]
            near = np.flatnonzero(np.abs(times - t) < span)
            if len(near) < 12:
                near = np.argsort(np.abs(times - t))[:200]
            times, points = times[near], points[near]
            harmonics = 2 if len(times) > 24 else 1
            middle = float(times.mean())
            solution = np.linalg.lstsq(basis(times - middle, self.omega, harmonics), points, rcond=None)[0]
            self._fitted = (t, t + 0.2 * span, np.vstack([np.full((1, 2), middle), solution]))
        table = self._fitted[2]
        harmonics = 2 if len(table) > 6 else 1
        return np.asarray((basis(np.array([t - table[0, 0]]), self.omega, harmonics) @ table[1:])[0])

    def at(self, t: float) -> FloatArray:
        """Return the place (x, y) [pixels] at a time [s]."""
        i = int(np.searchsorted(self.times, t))
        near = 0.15 * math.tau / self.omega
        if 0 < i < len(self.times) and self.times[i] - self.times[i - 1] < near:
            share = (t - self.times[i - 1]) / (self.times[i] - self.times[i - 1])
            return np.asarray(self.points[i - 1] + share * (self.points[i] - self.points[i - 1]))
        place = self._harmonic(t)
        if self.own and t > self.times[-1] and t - self.own[-1][0] < near:
            last = self.own[-1]
            place = place + np.array(last[1:]) - self._harmonic(last[0])
        return place

    def speed(self, t: float, step: float) -> float:
        """Return the speed [pixels/s] at a time [s]."""
        return float(np.hypot(*(self.at(t + 0.5 * step) - self.at(t - 0.5 * step)))) / step

    def angle(self, x: float, y: float) -> float:
        """Return the angle [rad] about the pivot, from straight down."""
        return math.atan2(x - self.pivot[0], y - self.pivot[1])

    def curved(self, x: float, y: float) -> float:
        """Return the reciprocal of the distance from the pivot [1/pixel]."""
        return 1.0 / max(math.hypot(x - self.pivot[0], y - self.pivot[1]), 1.0)


def _rough_pivot(swing: Swing) -> tuple[float, float]:
    """Return the pivot by the places that were found, or one far above for an arc that is too flat to tell."""
    try:
        circle = fit_circle(swing.x, swing.y)
    except RecordingError:
        circle = None
    if circle is None or not circle.error < 0.3 * circle.radius or not circle.radius < 30.0 * swing.reach:
        return float(np.median(swing.x)), float(np.median(swing.y)) - 1e6
    return circle.x, circle.y


def _learned(film: Film, sample: Sample, swing: Swing, pivot: tuple[float, float] | None, shrink: int
             ) -> tuple[Bob, Guess]:
    """Return the bob as it looks in pictures made smaller by a number, as the swing is, and where it is expected."""
    guess = Guess(swing, _rough_pivot(swing) if pivot is None else pivot)
    times = sample.times[sample.kept]
    places = np.array([guess.at(t) for t in times])
    speeds = np.array([guess.speed(t, film.step) for t in times])
    angles = np.array([guess.angle(x, y) for x, y in places])
    small = np.median(sample.small[:: max(1, len(sample.small) // 60)], axis=0).astype(np.float32)
    gain = gains(sample.small[sample.kept], small)
    full = [smaller(one, shrink) for one in sample.full]
    noise = _noise(full)
    margin = math.ceil(1.35 * swing.width + 8.0 + 0.5 * speeds.max() * film.step)
    width, height = (side // shrink for side in film.size)
    box = (max(int(swing.x.min()) - margin, 0), max(int(swing.y.min()) - margin, 0),
           min(int(swing.x.max()) + margin + 1, width), min(int(swing.y.max()) + margin + 1, height))
    gx, gy = np.meshgrid(np.arange(box[0], box[2]), np.arange(box[1], box[3]))
    reach = 1.3 * swing.width + 2.0 + 0.5 * speeds * film.step
    covered = [np.hypot(gx - x, gy - y) < far for (x, y), far in zip(places, reach, strict=True)]
    background = background_of(full, gain, covered, noise, box)
    bob = Bob(background, swing.width, noise)
    known = np.array([float(np.abs(swing.times - t).min()) < 0.5 * film.step for t in times])
    pool = np.flatnonzero(known) if known.sum() >= 6 else np.arange(len(times))
    slow = pool[np.argsort(speeds[pool])[: max(10, len(pool) // 4)]]
    bob.learn([full[k] for k in slow], gain[slow], places[slow], angles[slow])
    fast = pool[np.argsort(speeds[pool])[-8:]]
    if speeds[fast].max() * film.step > 2.0:
        bob.expose([full[k] for k in fast], places[fast], angles[fast], speeds[fast], film.step)
    return bob, guess


def _noise(pictures: list[Picture]) -> float:
    """Return the standard deviation of the pixels of pictures in time [grey levels], at least that of rounding."""
    pairs = [(a.astype(np.float32) - b)[::3, ::3] for a, b in zip(pictures[:-1:4], pictures[1::4], strict=False)]
    spread = float(np.median([1.48 * np.median(np.abs(one - np.median(one))) for one in pairs]))
    return max(spread / math.sqrt(2.0), 0.5)


class _Reading:
    """The readings of a film as they grow: times, places, covariances, shares seen, misfits and streaks.

    Places are those in pictures made smaller by ``shrink``.
    """

    def __init__(self, film: Film, shrink: int, bob: Bob, guess: Guess) -> None:
        self.film, self.shrink, self.bob, self.guess = film, shrink, bob, guess
        self.stamps: list[float] = []
        self.rows: list[tuple[float, Place, float] | None] = []
        self.repeated = 0
        self._last: Picture | None = None
        wall = float(np.median(bob.background.picture))
        self._picture = np.zeros((film.size[1] // shrink, film.size[0] // shrink), np.uint8)
        self._change = float(np.abs(np.diff(bob.light - wall * bob.opacity, axis=1)).sum()) / (2 * bob.half) ** 2

    def all(self, tell: Progress) -> bool:
        """Read all frames; return False if interrupted by Ctrl-C."""
        expected, film, guess = self.film.count, self.film, self.guess
        try:
            for frame in film.frames():
                fit = self._one(self._smaller(frame.picture), frame.time)
                self.stamps.append(frame.time)
                self.rows.append(None if fit is None else (frame.time, *fit))
                if fit is not None and 0.85 < fit[0].seen < 1.2:
                    guess.own.append((frame.time, fit[0].x, fit[0].y))
                if not len(self.stamps) % 20:
                    tell(min(len(self.stamps) / expected, 1.0), f"{frame.time:.0f} s")
        except KeyboardInterrupt:
            if len(guess.own) < _FEW:
                raise
            return False
        return True

    def _smaller(self, picture: Picture) -> Picture:
        """Return a picture made smaller where the bob may be; elsewhere it is black."""
        if self.shrink == 1:
            return picture
        bg, by = self.bob.background, self.shrink
        height, width = bg.picture.shape
        part = picture[bg.top * by : (bg.top + height) * by, bg.left * by : (bg.left + width) * by]
        self._picture[bg.top : bg.top + height, bg.left : bg.left + width] = smaller(part, by)
        return self._picture

    def _one(self, picture: Picture, time: float) -> tuple[Place, float] | None:
        """Return the bob's place in a picture and its streak; None where it is not found."""
        near = self.guess.at(time)
        moves = self.guess.speed(time, self.film.step) * self.film.step
        streak = moves * self.bob.exposure / self.film.step
        if self._same(picture, near, moves):
            self.repeated += 1
            return None
        fit = self.bob.place(picture, (float(near[0]), float(near[1])), self.guess.angle(*near), streak,
                             self.guess.curved(*near))
        if fit is None or not 0.7 < fit.seen < 1.3:
            other = self._searched(picture, near)
            if other is not None:
                again = self.bob.place(picture, other, self.guess.angle(*other), streak, self.guess.curved(*other))
                if again is not None and (fit is None or again.misfit < fit.misfit):
                    fit = again
        return None if fit is None else (fit, streak)

    def _same(self, picture: Picture, near: FloatArray, moves: float) -> bool:
        """Return True if a picture is the one before, written again, although the bob moves."""
        half = self.bob.half
        left, top = max(round(near[0]) - half, 0), max(round(near[1]) - half, 0)
        part, last = picture[top : top + 2 * half, left : left + 2 * half], self._last
        self._last = picture if self.shrink == 1 else picture.copy()
        if last is None or not part.size or moves < _MOVES:
            return False
        before = last[top : top + 2 * half, left : left + 2 * half]
        expected = self._change * min(moves, self.bob.radius)  # grey levels, by which the pixels change
        return float(np.abs(part.astype(np.int16) - before).mean()) < _REPEATED * expected

    def _searched(self, picture: Picture, near: FloatArray) -> tuple[float, float] | None:
        """Return the place of the spot that is nearest to where the bob is expected; None if there is none alike."""
        cv, bg, bob = packages()[1], self.bob.background, self.bob
        height, width = bg.picture.shape
        part = picture[bg.top : bg.top + height, bg.left : bg.left + width].astype(np.float32)
        ratio = float(np.median(part[::4, ::4] / np.maximum(bg.picture[::4, ::4], 1.0)))
        difference = cv.GaussianBlur(part - np.float32(ratio) * bg.picture, (3, 3), 0.8)
        spots = [one for one in spots_of(difference, max(4.0, 4.0 * bob.noise)) if 0.5 < one[2] / bob.radius < 2.0]
        if not spots:
            return None
        x, y = near[0] - bg.left, near[1] - bg.top
        best = min(spots, key=lambda one: math.hypot(one[0] - x, one[1] - y))
        return best[0] + bg.left, best[1] + bg.top


def _result(film: Film, read: _Reading, chosen: Swing, found: list[Swing], pivot: tuple[float, float] | None,
            length: float | None, dropped: list[tuple[float, float]], complete: bool, picture: Picture,
            rate: float | None) -> FilmTrack:
    """Return the track of the frames that were read, without doubtful ones."""
    frames, kept = len(read.stamps), [row for row in read.rows if row is not None]
    few = RecordingError(f"{film.name}: the bob could be read in too few frames ({len(kept)} of {frames}); give "
                         "bob=(x, y) of a place on its way, or until= the time at which it is out of sight")
    if len(kept) < max(_FEW, _LEAST * frames):
        raise few
    left_out = {"without the bob in full": frames - len(kept) - read.repeated,
                "in which nothing moves": read.repeated}
    time = np.array([row[0] for row in kept])
    places, by = [row[1] for row in kept], read.shrink
    x, y = (by * (np.array(side) + 0.5) - 0.5 for side in ([one.x for one in places], [one.y for one in places]))
    covariance = by * by * np.array([one.covariance for one in places])
    seen, misfit = np.array([one.seen for one in places]), np.array([one.misfit for one in places])
    streaks = by * np.array([row[2] for row in kept])
    clear = np.abs(seen - np.median(seen)) < max(0.06, 5.0 * 1.48 * float(np.median(np.abs(seen - np.median(seen)))))
    clear &= misfit < 2.5 * float(np.median(misfit))
    left_out["hidden in part"] = int((~clear).sum())
    given = clear & np.any([(time >= first) & (time <= last) for first, last in dropped or [(1.0, 0.0)]], axis=0)
    left_out["as given"] = int(given.sum())
    keep = np.flatnonzero(clear & ~given)
    if len(keep) < max(_FEW, _LEAST * frames):
        raise few
    angles = angles_of(film.name, x[keep], y[keep], covariance[keep], pivot)
    rest = rest_of(time[keep], angles.angle, angles.error, chosen.omega)
    error, factor = calibrated(angles.error, rest)
    off = alone(rest, factor)
    left_out["off the swing"] = int(off.sum())
    if off.any():
        keep = keep[~off]
        angles = angles_of(film.name, x[keep], y[keep], covariance[keep], pivot)
        rest = rest_of(time[keep], angles.angle, angles.error, chosen.omega)
        error, factor = calibrated(angles.error, rest)
    roll, how = _vertical(film.name, time[keep], angles.angle, error, chosen.omega)
    radius, tilted = blurred(angles.radius, angles.angle - roll, float(streaks[keep].max())), ""
    bent = bent_of(time[keep], angles.angle - roll, error, rest, chosen.omega)
    if bent is not None:
        tilted = (f"tilt: the swing looks bent, by {math.degrees(bent.error):.1g} degrees: the camera looks at it at "
                  f"an angle, or its lens bends the picture; all angles may be off by {100.0 * bent.scale:.0f} %; put "
                  "the camera straight before the swing, far away")
        if abs(bent.cube) > _BENT and bent.error > float(np.median(error)) and pivot is None:
            raise RecordingError(f"{film.name}: {tilted}, or give pivot=(x, y) to keep the angles as they are")
        error = np.hypot(error, bent.error)
        radius = Measurement(radius.value, math.hypot(radius.error, bent.scale * radius.value), radius.unit)
    steps = np.diff(read.stamps)
    usual = float(np.median(steps))
    centre = f"centre of the circle through the places (rms {angles.rms:.2g} pixels)"
    notes = [f"pivot: ({angles.pivot[0]:.6g}, {angles.pivot[1]:.6g}), {'as given' if pivot is not None else centre}",
             f"radius: {radius}", f"vertical: {how}"]
    if film.slower != 1.0:
        notes.append(f"rate: {1.0 / film.step:g} Hz as given, {film.slower:g} times that of the file")
    if film.channel:
        notes.append(f"channel: {CHANNELS[film.channel]}, as nothing swings in the brightness")
    if tilted:
        notes.append(tilted)
    if length is not None:
        notes.append(f"scale: {angles.radius.value / length:.6g} pixels per metre, by the given length")
    if film.broken:
        notes.append(f"the film ends early: {film.broken}")
    return FilmTrack(film.name, time[keep], angles.angle - roll, error, rest * angles.error, x[keep], y[keep],
                     angles.pivot, radius, by * read.bob.radius, frames,
                     {why: count for why, count in left_out.items() if count},
                     np.setdiff1d(read.stamps, time[keep]), usual,
                     bool(np.ptp(steps) < 0.02 * usual), read.bob.exposure, float(streaks[keep].max()), roll,
                     tuple(one.in_words() for one in (chosen, *(other for other in found if other is not chosen))),
                     tuple(notes), picture, film.size, rate, read.stamps[-1], complete)


def _vertical(name: str, time: FloatArray, angle: FloatArray, error: FloatArray, omega: float) -> tuple[float, str]:
    """Return the angle [rad] of the swing's middle in the picture, and how it was found."""
    start = 0.0
    with suppress(RecordingError):
        start = Recording(time, angle, name).released().release or 0.0
    free = time >= start
    zero = middle_of(time[free], angle[free], error[free], omega)
    if zero is None:
        return 0.0, "straight down in the picture, as there is no swing to and fro"
    return zero, f"the middle of the swing, {math.degrees(zero):.3g} degrees from straight down in the picture"
