"""Find the bob without help: what moves to and fro with one period along one arc before a still background.

1. *Background*: the median of frames spread over the first part of the film (at most 600 frames, made smaller).
2. *Spots*: connected pixels that differ from it by more than noise and by more than they usually do. A spot's place is
   the middle of the widest disc in it (distance transform, Borgefors 1986), so that a rod or a wire does not move it,
   and of a wide spot what differs by half as much as its most, so that a shadow that touches the bob does not, either.
3. *Paths*: spots linked from frame to frame, each to the nearest place that its velocity predicts.
4. *Swings*: paths whose place is c + (a + a' t) cos(w t) + (b + b' t) sin(w t), with harmonics for the arc's height.
   The frequency is scanned. Each swing then takes all spots that are where it predicts the bob, also behind gaps.
5. *Rank*: share of the frames, times contrast, times width: shadows and reflections are fainter than what throws them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.film.frames import Film, Picture, packages, smaller

_FRAMES, _PIXELS, _RATE = 600, 260_000, 32.0  # at most so many frames of so many pixels, about so many per second
_KEPT = 48  # frames that are kept at full size
_SLOWEST, _FASTEST = 0.1, 6.0  # frequencies of a pendulum [Hz]
_ONE_SIGMA = {0.3: 0.3853, 0.1: 0.1257}  # quantiles of the size of normal errors
_VOTES = 7  # of 16 parts of the picture, which agree that the camera moved
_SOME = 5000  # pixels that show the brightness of a picture
_SPOTS = 24  # the largest spots of a frame
_THICK = 3.0  # half width from which a spot may have a shadow [pixels]
_SOLID, _WHOLE_DISC = 0.45, 0.75  # shares of its difference and of its width that its part without the shadow has
_LEAST = 12  # spots of a path
_LOST = 8  # frames for which a thing may be hidden on its path
_LONG = 6.0  # half widths: the ends of longer spots, such as bare rods, are places of their own
_HIDING = 6.0  # half widths of what swings: with a shorter way, it may hide its background most of the time
_MOVES = 4.0  # pixels: what moves less is no swing
_ALIKE = 0.2  # of its size, by which width and contrast of one thing may differ from path to path
_BEGINS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # shares of a path that are tried without
_WHOLE = 0.01  # of its variance that a swing may leave for nothing to be tried
_PERIODS = 3.0  # of a swing, from which more make it no surer
_EXPLAINED = 0.85  # least share of a path's variance that a swing explains


CLEAR, FAINTEST = 60.0, 12.0
"""Rank below which a swing may be noise, so that other channels are looked at, too; and below which it is no swing."""


class Sample(NamedTuple):
    """The first part of a film: numbers, times [s] and small pictures of its frames, and some at full size.

    ``scale`` is the size of a small picture's pixel; ``kept`` are the places of the full pictures among the small ones.
    """

    times: FloatArray
    small: NDArray[np.uint8]
    scale: int
    kept: list[int]
    full: list[Picture]


@dataclass(frozen=True)
class Swing:
    """What moves to and fro: seen ``x``, ``y`` [pixels] at ``times`` [s], with half ``width`` and ``contrast``.

    Attributes:
        omega: angular frequency [rad/s].
        share: share of the sampled frames in which it was seen.
        rank: by which swings are ordered.
    """

    times: FloatArray
    x: FloatArray
    y: FloatArray
    omega: float
    width: float
    contrast: float
    share: float
    rank: float

    @property
    def reach(self) -> float:
        """Half the distance between the ends of the arc [pixels]."""
        return 0.5 * float(np.hypot(np.ptp(self.x), np.ptp(self.y)))

    def shrunk(self, by: int) -> Swing:
        """Return the swing in a picture made smaller by a number."""
        return replace(self, x=(self.x + 0.5) / by - 0.5, y=(self.y + 0.5) / by - 0.5, width=self.width / by)

    def along(self, other: Swing) -> bool:
        """Return True if the other swing is at the same place at most times, as the edge of one bob is."""
        at = np.clip(np.searchsorted(other.times, self.times), 0, len(other.times) - 1)
        near = np.hypot(self.x - other.x[at], self.y - other.y[at]) < 1.5 * (self.width + other.width)
        return bool(np.mean(near & (np.abs(self.times - other.times[at]) < 0.2)) > 0.5)

    def in_words(self) -> str:
        """Return period and place of the swing as a text."""
        return (f"{math.tau / self.omega:.3g} s, {2 * self.reach:.0f} pixels wide about "
                f"({np.median(self.x):.0f}, {np.median(self.y):.0f})")


def sampled(film: Film, tell: Callable[[float, str], None]) -> Sample:
    """Return the first part of a film, small."""
    scale = 1
    while film.size[0] * film.size[1] > _PIXELS * scale**2:
        scale *= 2
    every = max(1, round(1.0 / (film.step * _RATE)))
    expected = min(film.count // every, _FRAMES)
    apart = max(1, expected // _KEPT)
    times: list[float] = []
    small: list[Picture] = []
    kept: list[int] = []
    full: list[Picture] = []
    for number, (_, time, picture) in enumerate(film.frames()):
        if number % every:
            continue
        if len(small) == _FRAMES:
            break
        if len(small) % apart == apart // 2 and len(full) < 2 * _KEPT:
            kept.append(len(small))
            full.append(picture.copy())
        times.append(time)
        small.append(smaller(picture, scale) if scale > 1 else picture.copy())
        if not len(small) % 20:
            tell(len(small) / max(expected, len(small)), "finding the bob")
    if len(small) < _LEAST:
        raise RecordingError(f"{film.name}: expected a film of at least {_LEAST} frames, found {len(small)}")
    return Sample(np.array(times), np.array(small), scale, kept, full)


def moved(sample: Sample) -> float:
    """Return by how many pixels the camera moves between frames of a sample; 0 where nothing shows that it moves.

    The shift of a frame against another is that of their phase correlation (Kuglin & Hines 1975). It counts if
    it explains most of the change in seven or more of 16 parts of the picture, as a moving bob does not.
    """
    cv = packages()[1]
    flat = [one.astype(np.float32) - cv.GaussianBlur(one.astype(np.float32), (0, 0), 6.0)
            for one in sample.small[:: max(1, len(sample.small) // 12)]]
    found = [_shift(base, flat) for base in flat[len(flat) // 6 :: max(1, len(flat) // 3)][:3]]
    return float(np.median(found)) * sample.scale  # against three, as somebody may walk by in one


def _shift(base: NDArray[np.float32], flat: list[NDArray[np.float32]]) -> float:
    """Return by how much most pictures are shifted against one [pixels]."""
    cv = packages()[1]
    height, width = base.shape
    window = cv.createHanningWindow((width, height), cv.CV_32F)
    smooth = cv.GaussianBlur(base, (0, 0), 1.2)  # without the noise, which shifting by parts of a pixel takes away, too
    slope = np.hypot(cv.Sobel(smooth, cv.CV_32F, 1, 0), cv.Sobel(smooth, cv.CV_32F, 0, 1))
    strong = slope > max(40.0, 3.0 * float(np.median(slope)))
    shifts = []
    for one in flat:
        (dx, dy), _ = cv.phaseCorrelate(base, one, window)
        if math.hypot(dx, dy) < 0.4:
            shifts.append(0.0)
            continue
        one = cv.GaussianBlur(one, (0, 0), 1.2)
        turned = cv.warpAffine(one, np.array([[1.0, 0.0, -dx], [0.0, 1.0, -dy]]), (width, height),
                               borderMode=cv.BORDER_REFLECT)
        votes = 0
        for rows in np.array_split(np.arange(height), 4):
            for columns in np.array_split(np.arange(width), 4):
                part = np.ix_(rows, columns)
                here = strong[part]
                if here.sum() >= 12:
                    before, after = (np.median(np.abs(other[part] - smooth[part])[here]) for other in (one, turned))
                    votes += bool(after < 0.7 * before)
        shifts.append(math.hypot(dx, dy) if votes >= _VOTES else 0.0)
    return float(np.quantile(shifts, 0.8))


def gains(pictures: NDArray[np.uint8], background: NDArray[np.floating]) -> FloatArray:
    """Return the brightness of each picture relative to the background: the median of the ratios of their pixels."""
    by = max(1, round(math.sqrt(background.size / _SOME)))
    part = np.maximum(background[::by, ::by], 1.0)
    return np.array([np.median(one[::by, ::by] / part) for one in pictures])


class Spots(NamedTuple):
    """Spots of all frames, an array each: frame, x, y [small pixels], half width, and difference from the background.
    """

    frame: NDArray[np.intp]
    x: FloatArray
    y: FloatArray
    width: FloatArray
    contrast: FloatArray


def spots_of(difference: NDArray[np.float32], level: NDArray[np.float32] | float) -> list[tuple[float, ...]]:
    """Return x, y, half width and mean difference of the spots of a picture whose size is beyond ``level``."""
    cv = packages()[1]
    mask = (np.abs(difference) > level).astype(np.uint8)
    count, labels, stats, _ = cv.connectedComponentsWithStats(mask, connectivity=8)
    if count < 2:
        return []
    found: list[tuple[float, ...]] = []
    order = np.argsort(stats[1:, cv.CC_STAT_AREA])[::-1][:_SPOTS] + 1
    for label in order.tolist():
        left, top, across, along, area = stats[label].tolist()
        if area < 4:
            break
        box = (slice(top, top + along), slice(left, left + across))
        own, size = labels[box] == label, np.abs(difference[box])
        depth = _depth(own)
        most = float(depth.max())
        if most > _THICK:
            solid = own & (size > _SOLID * float(size[own].max()))
            deep = _depth(solid)
            if deep.max() > _WHOLE_DISC * most:
                own, depth, most = solid, deep, float(deep.max())
        weight = np.where(depth >= 0.7 * most, depth, 0.0)
        total = float(weight.sum())
        rows, columns = np.nonzero(weight)
        values = weight[rows, columns]
        mean = float(difference[box][own].mean())
        x, y = float(columns @ values) / total, float(rows @ values) / total
        found.append((left + x, top + y, most, mean))
        if math.hypot(np.ptp(rows), np.ptp(columns)) > _LONG * most > _LONG * 2.0:
            found += [(left + a, top + b, most, mean) for a, b in _ends(rows, columns, x, y)]
    return found


def _depth(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return how far inside a mask its pixels are [pixels]."""
    cv = packages()[1]
    wide = cv.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv.BORDER_CONSTANT)
    return np.asarray(cv.distanceTransform(wide, cv.DIST_L2, 5)[1:-1, 1:-1], dtype=np.float32)


def _ends(rows: NDArray[np.intp], columns: NDArray[np.intp], x: float, y: float) -> list[tuple[float, float]]:
    """Return the places of both ends of the ridge of a long spot, whose middle is at (x, y)."""
    ridge = np.stack([columns - x, rows - y], axis=1)
    axis = np.linalg.eigh(ridge.T @ ridge)[1][:, 1]
    along = ridge @ axis
    ends = (along <= np.quantile(along, 0.03)), (along >= np.quantile(along, 0.97))
    return [(x + float(ridge[end, 0].mean()), y + float(ridge[end, 1].mean())) for end in ends]


def seen(sample: Sample, share: float) -> Spots:
    """Return the spots of a sample's frames that differ from the background.

    The background is the ``share`` quantile of each pixel: the median or, for a bob that hides a place more than half
    of the time, a brighter or darker one.
    """
    cv = packages()[1]
    small = sample.small
    some = slice(None, None, max(1, len(small) // 60))
    background = np.quantile(small[some], share, axis=0).astype(np.float32)
    gain = gains(small, background)
    away = np.abs(small[some].astype(np.float32) - background * gain[some, None, None].astype(np.float32))
    part = 0.3 if share == 0.5 else 0.1  # of the time, at which a place shows its background
    usual = (np.quantile(away, part, axis=0) / _ONE_SIGMA[part]).astype(np.float32)
    noise = float(np.median(usual[::2, ::2]))
    level = np.maximum(3.5 * cv.blur(usual, (3, 3)), max(2.5, 3.0 * noise)).astype(np.float32)
    rows = []
    for k, picture in enumerate(small):
        difference = cv.GaussianBlur(picture.astype(np.float32) - np.float32(gain[k]) * background, (3, 3), 0.8)
        rows += [(k, *spot) for spot in spots_of(difference, level)]
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Spots(table[:, 0].astype(np.intp), table[:, 1], table[:, 2], table[:, 3], table[:, 4])


def paths_of(spots: Spots, times: FloatArray) -> list[NDArray[np.intp]]:
    """Return paths, each the indices of the spots that one thing made, by nearest predicted place."""
    by_frame = np.searchsorted(spots.frame, np.arange(len(times) + 1))
    active: list[list[int]] = []
    done: list[list[int]] = []
    for k in range(len(times)):
        here = np.arange(by_frame[k], by_frame[k + 1])
        free = set(here.tolist())
        if active and len(here):
            ends = [path[-1] for path in active]
            before = [path[-2] if len(path) > 1 else path[-1] for path in active]
            gap = times[k] - times[spots.frame[ends]]
            span = np.maximum(times[spots.frame[ends]] - times[spots.frame[before]], 1e-9)
            ahead = np.where(np.array(ends) == np.array(before), 0.0, gap / span)
            px = spots.x[ends] + (spots.x[ends] - spots.x[before]) * ahead
            py = spots.y[ends] + (spots.y[ends] - spots.y[before]) * ahead
            speed = np.hypot(px - spots.x[ends], py - spots.y[ends])
            room = 0.5 * speed + 2.0 * spots.width[ends] + 3.0
            far = np.hypot(px[:, None] - spots.x[here], py[:, None] - spots.y[here]) / room[:, None]
            wide, before_wide = np.maximum(spots.width[here], 0.5), np.maximum(spots.width[ends], 0.5)
            far += 0.5 * np.abs(np.log(wide / before_wide[:, None]))
            for place in np.argsort(far, axis=None)[: 4 * len(here)].tolist():
                i, j = divmod(place, len(here))
                if far[i, j] > 1.0:
                    break
                if int(here[j]) in free and active[i][-1] < by_frame[k]:
                    active[i].append(int(here[j]))
                    free.discard(int(here[j]))
        waiting = [path for path in active if k - spots.frame[path[-1]] <= _LOST]
        done += [path for path in active if k - spots.frame[path[-1]] > _LOST]
        active = [*waiting, *([spot] for spot in sorted(free))]
    return [np.array(path, dtype=np.intp) for path in (*done, *active) if len(path) >= _LEAST]


def basis(times: FloatArray, omega: float, harmonics: int = 1) -> FloatArray:
    """Return the columns 1, cos, sin, t cos, t sin of a swing, and cos and sin of the further harmonics."""
    phase = omega * times
    columns = [np.ones_like(times), np.cos(phase), np.sin(phase), times * np.cos(phase), times * np.sin(phase)]
    for n in range(2, harmonics + 1):
        columns += [np.cos(n * phase), np.sin(n * phase)]
    return np.stack(columns, axis=1)


def frequency(times: FloatArray, place: FloatArray) -> tuple[float, float]:
    """Return the angular frequency [rad/s] of a swing through places along a line, and the share that it explains."""
    span = float(np.ptp(times))
    step = float(np.median(np.diff(times)))
    own = place - place.mean()
    total = float(own @ own)
    least, most = max(_SLOWEST, 1.2 / span), min(_FASTEST, 0.35 / step)
    if not total > 0.0 or least >= most:
        return 0.0, 0.0

    t = (times - times.mean()) / span

    def left(f: FloatArray) -> FloatArray:
        phase = math.tau * f[:, None] * span * t
        c, s = np.cos(phase), np.sin(phase)
        table = np.stack([np.ones_like(c), c, s, t * c, t * s], axis=1)
        right = table @ own
        normal = table @ table.transpose(0, 2, 1) + 1e-9 * len(t) * np.eye(5)
        return np.asarray(total - np.sum(right * np.linalg.solve(normal, right[..., None])[..., 0], axis=1))

    grid = np.arange(least, most, 0.2 / span)
    best = float(grid[int(np.argmin(left(grid)))])
    for size in (0.2 / span, 0.025 / span):
        fine = np.linspace(max(best - size, least), best + size, 17)
        rest = left(fine)
        best = float(fine[int(np.argmin(rest))])
    return math.tau * best, 1.0 - max(float(rest.min()), 0.0) / total


def swings(sample: Sample) -> list[Swing]:
    """Return what swings in a film's first part, the best first."""
    found = _swings(sample, 0.5)
    if not found or found[0].reach < _HIDING * found[0].width:
        found += _swings(sample, 0.88) + _swings(sample, 0.12)
    order = sorted(found, key=lambda one: one.rank, reverse=True)
    return [one for i, one in enumerate(order) if not any(one.along(other) for other in order[:i])]


def _swings(sample: Sample, share: float) -> list[Swing]:
    """Return what swings before the background that is a quantile of each pixel."""
    spots, times = seen(sample, share), sample.times
    found: list[Swing] = []
    taken = np.zeros(len(spots.frame), dtype=bool)
    paths = [path for path in paths_of(spots, times) if _reach(path, spots) * sample.scale >= _MOVES]
    paths = sorted(paths, key=len, reverse=True)[:40]
    for path in paths:
        if taken[path].mean() > 0.5:
            continue
        grown = _grown(path, spots, times) or _grown(_again(path, paths, spots), spots, times)
        if grown is None:
            continue
        path, omega, sure = grown
        if taken[path].mean() > 0.5:
            continue
        taken[path] = True
        scale = sample.scale
        share = len(path) / len(times)
        width, contrast = float(np.median(spots.width[path])), float(np.median(np.abs(spots.contrast[path])))
        x, y = (scale * (place[path] + 0.5) - 0.5 for place in (spots.x, spots.y))
        reach = float(np.hypot(np.ptp(x), np.ptp(y)))
        if share < 0.15 or sure < 0.2:
            continue
        sure *= min(float(np.ptp(times[spots.frame[path]])) * omega / (math.tau * _PERIODS), 1.0)
        found.append(Swing(times[spots.frame[path]], x, y, omega, scale * width, contrast, share,
                           share * sure * contrast * math.sqrt(scale * width) * reach**0.25))
    return found


def _reach(path: NDArray[np.intp], spots: Spots) -> float:
    """Return how far a path reaches [small pixels]."""
    return float(np.hypot(np.ptp(spots.x[path]), np.ptp(spots.y[path])))


def _again(path: NDArray[np.intp], paths: list[NDArray[np.intp]], spots: Spots) -> NDArray[np.intp]:
    """Return a path with those at other times of spots as wide and as dark: a post hides the bob between them."""
    frames, looks = set(spots.frame[path].tolist()), _looks(path, spots)
    parts = [path]
    for other in paths:
        own = spots.frame[other].tolist()
        if np.all(np.abs(np.log(_looks(other, spots) / looks)) < _ALIKE) and frames.isdisjoint(own):
            parts.append(other)
            frames.update(own)
    return np.sort(np.concatenate(parts))


def _looks(path: NDArray[np.intp], spots: Spots) -> FloatArray:
    """Return the usual width and contrast of a path's spots."""
    return np.array([np.median(spots.width[path]), abs(np.median(spots.contrast[path])) + 1e-9])


def _turns(place: FloatArray) -> int:
    """Return how often places along a line turn back, by a third of their range or more."""
    clear, turns, direction = float(np.ptp(place)) / 3.0, 0, 0
    high = low = float(place[0])
    for one in place.tolist():
        high, low = max(high, one), min(low, one)
        if direction >= 0 and one < high - clear:
            turns, direction, low = turns + 1, -1, one
        elif direction <= 0 and one > low + clear:
            turns, direction, high = turns + 1, 1, one
    return turns - 1  # the first is where the motion begins


def _free(path: NDArray[np.intp], spots: Spots, times: FloatArray) -> NDArray[np.intp]:
    """Return a path without its beginning, as far as this must go for the rest to be a swing: a hand holds the bob."""
    t = times[spots.frame[path]]
    parts, left = [], []
    for begin in _BEGINS:
        part = path[np.flatnonzero(t >= t[0] + begin * float(np.ptp(t)))]
        if len(part) < _LEAST:
            break
        points = np.stack([spots.x[part], spots.y[part]], axis=1)
        centred = points - points.mean(axis=0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        if _turns(along) >= 2:
            parts.append(part)
            left.append(1.0 - frequency(times[spots.frame[part]], along)[1])
            if left[-1] < _WHOLE:
                break
    return next((part for part, one in zip(parts, left, strict=True) if one <= max(2.0 * min(left), _WHOLE)), path)


def _grown(path: NDArray[np.intp], spots: Spots, times: FloatArray) -> tuple[NDArray[np.intp], float, float] | None:
    """Return all spots of the swing that a path belongs to, its angular frequency, and how sure it is, 0 to 1.

    Spots that are anywhere by chance would fill the room within which they are taken evenly: 0. None if it is no swing.
    """
    middle, area = times.mean(), float(np.ptp(spots.x) * np.ptp(spots.y)) + 1.0
    free = _free(path, spots, times)
    held = spots.frame < (spots.frame[free[0]] if len(free) < len(path) else 0)
    path, best = free, None
    for turn in range(4):
        t = times[spots.frame[path]] - middle
        points = np.stack([spots.x[path], spots.y[path]], axis=1)
        centred = points - points.mean(axis=0)
        axis = np.linalg.svd(centred, full_matrices=False)[2][0]
        omega, explained = frequency(t, centred @ axis)
        if explained < _EXPLAINED or _turns(centred @ axis) < 2:
            return best if turn > 1 else None
        harmonics = 2 if len(path) > 30 and np.ptp(t) * omega > 9.0 else 1
        solution = np.linalg.lstsq(basis(t, omega, harmonics), points, rcond=None)[0]
        size = float(np.ptp(centred @ axis))
        rest = np.hypot(*(points - basis(t, omega, harmonics) @ solution).T)
        gate = max(1.5, 5.0 * float(np.median(rest)), (0.25, 0.12, 0.06, 0.06)[turn] * size)
        where = basis(times - middle, omega, harmonics) @ solution
        near = np.hypot(spots.x - where[spots.frame, 0], spots.y - where[spots.frame, 1])
        alike = ~held & (spots.width > 0.4 * np.median(spots.width[path]))
        near = np.where(alike & (np.sign(spots.contrast) == np.sign(np.median(spots.contrast[path]))), near, np.inf)
        order = np.lexsort((near, spots.frame))
        first = order[np.unique(spots.frame[order], return_index=True)[1]]
        inside = first[near[first] < gate]
        if len(inside) < _LEAST:
            return None
        path = inside
        chance = min(1.0, len(spots.frame) / len(times) * math.pi * gate**2 / area)
        inner = float(np.mean(near[path] < 0.5 * gate))
        best = (path, omega, max(0.0, (inner - 0.3) / 0.7) * (1.0 - chance))
    return best
