"""Place the bob within a pixel, by least squares of the whole picture around it, with an error from the picture itself.

The picture is modelled as ``I = g (B (1 - m) + U)``: the background B behind the bob, the bob's opacity m (1 inside, 0
outside, between them at its rim) and its light U, both seen from the bob: turned by the swing's angle, so that a rod or
a marked bob stays itself, and smeared along the arc by what the bob moves during the exposure (the middle of the streak
is then the bob's place at the middle of the exposure). The brightness g takes up flickering lamps and clouds. B is the
median of frames of that place in which the bob is elsewhere; m and U come from slow frames of the same film, in turns
with the places in them. The place (x, y) and g are found by Gauss-Newton steps. Their covariance is ``s² (J' W J)^-1``
with the residual s² of that picture, as for any least squares.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray
from pendulum_env.lab.film.frames import Picture, packages

Image = NDArray[np.float32]
_UNKNOWN = 60.0  # error of a background that was never seen [grey levels]
_RIM = 3  # pixels around what is opaque in which a bob's rim ends
_STEPS = 8  # Gauss-Newton steps at most


LARGE = 12.0
"""Half width of a bob [pixels] at which its pictures are made half as large: it is no less certain then."""


class Place(NamedTuple):
    """Place of the bob in a picture [pixels], its covariance, and how well the bob fits there.

    ``seen``: the bob's contrast against the background as a share of the usual; ``misfit``: the residual's rms in units
    of the noise.
    """

    x: float
    y: float
    covariance: FloatArray
    seen: float
    misfit: float


class Background(NamedTuple):
    """Background of a part of the picture that begins at ``left``, ``top``, and its variance, in grey levels²."""

    left: int
    top: int
    picture: Image
    variance: Image


def background_of(pictures: list[Picture], gain: FloatArray, covered: list[NDArray[np.bool_]], noise: float,
                  box: tuple[int, int, int, int]) -> Background:
    """Return the median of pictures where they are not covered by the bob, in a box (left, top, right, bottom)."""
    cv = packages()[1]
    left, top, right, bottom = box
    stack = np.stack([np.where(mask, np.float32(1e4), picture[top:bottom, left:right] / np.float32(one))
                      for picture, one, mask in zip(pictures, gain, covered, strict=True)])
    stack.sort(axis=0)
    count = (stack < 1e4).sum(axis=0)
    low, high = (np.take_along_axis(stack, np.maximum(place, 0)[None], 0)[0]
                 for place in ((count - 1) // 2, count // 2))
    known = count >= 2
    median = np.where(known, 0.5 * (low + np.where(high < 1e4, high, low)), 0.0).astype(np.float32)
    if not known.all():
        median = cv.inpaint(np.clip(median, 0, 255).astype(np.uint8), (~known).astype(np.uint8), 3,
                            cv.INPAINT_TELEA).astype(np.float32) * ~known + median * known
    variance = np.where(known, 1.57 * noise**2 / np.maximum(count, 1), _UNKNOWN**2).astype(np.float32)
    return Background(left, top, median, variance)


class Bob:
    """Appearance of a bob, learned from pictures: opacity ``m`` and light ``U`` in its own frame.

    The columns of its frame are along the arc, its rows away from the pivot.
    """

    def __init__(self, background: Background, radius: float, noise: float) -> None:
        self.cv = packages()[1]
        self.background, self.radius, self.noise = background, radius, noise
        self.half = math.ceil(1.35 * radius + 3.0)
        side = 2 * self.half + 1
        self.opacity, self.light = np.zeros((side, side), np.float32), np.zeros((side, side), np.float32)
        self.exposure = 0.0
        self._usual = 1.0
        self._blurred: dict[int, tuple[Image, Image]] = {}

    def learn(self, pictures: list[Picture], gain: FloatArray, places: FloatArray, angles: FloatArray) -> FloatArray:
        """Learn the appearance from pictures of a slow bob; return its places in them, improved."""
        places = places.copy()
        for turn in range(3):
            self._average(pictures, gain, places, angles)
            for k, picture in enumerate(pictures):
                found = self.place(picture, (places[k, 0], places[k, 1]), angles[k], 0.0)
                if found is not None and np.hypot(found.x - places[k, 0], found.y - places[k, 1]) < self.radius:
                    places[k] = found.x, found.y
            if turn < 2:  # the first may hold a part of a shadow
                shift = self._middle()
                turned = np.stack([np.cos(angles) * shift[0] + np.sin(angles) * shift[1],
                                   -np.sin(angles) * shift[0] + np.cos(angles) * shift[1]], axis=1)
                places = places + turned
        self._average(pictures, gain, places, angles)
        return places

    def _middle(self) -> tuple[float, float]:
        """Return the middle of the opacity in the bob's frame, around the widest disc in it: without its rod."""
        h = np.arange(-self.half, self.half + 1)
        depth = self.cv.distanceTransform((self.opacity > 0.5).astype(np.uint8), self.cv.DIST_L2, 5)
        inner = np.where(depth >= 0.7 * depth.max(), depth, 0.0)
        x, y = (float(inner.sum(axis=axis) @ h) / max(float(inner.sum()), 1e-9) for axis in (0, 1))
        disc = np.hypot(h - x, h[:, None] - y) < float(depth.max()) + 1.5
        weight = np.where(disc & (self.opacity > 0.3), self.opacity, 0.0)
        total = float(weight.sum())
        return (float(weight.sum(axis=0) @ h) / total, float(weight.sum(axis=1) @ h) / total) if total else (0.0, 0.0)

    def _average(self, pictures: list[Picture], gain: FloatArray, places: FloatArray, angles: FloatArray) -> None:
        """Learn opacity and light from pictures whose places are known."""
        h = np.arange(-self.half, self.half + 1, dtype=np.float32)
        across, along = np.meshgrid(h, h)
        seen, behind = [], []
        for picture, one, (x, y), angle in zip(pictures, gain, places, angles, strict=True):
            c, s = math.cos(angle), math.sin(angle)
            px, py = (x + c * across + s * along).astype(np.float32), (y - s * across + c * along).astype(np.float32)
            seen.append(self._at(picture.astype(np.float32) / np.float32(one), px, py))
            behind.append(self._at(self.background.picture, px - self.background.left, py - self.background.top))
        looks, walls = np.stack(seen), np.stack(behind)
        usual = np.median(looks - walls, axis=0)
        inside = np.hypot(across, along) < 0.6 * self.radius
        core = float(np.quantile(np.abs(usual[inside]), 0.5)) if inside.any() else float(np.abs(usual).max())
        reach = np.hypot(across, along)
        first = np.clip(np.abs(usual) / max(core, 1.0), 0.0, 1.0)
        first = np.where(reach < 0.7 * self.radius, 1.0, first)
        spread = walls.var(axis=0)
        together = ((looks - looks.mean(axis=0)) * (walls - walls.mean(axis=0))).mean(axis=0)
        prior = 4.0 * self.noise**2 + 25.0
        slope = (together + prior * (1.0 - first)) / (spread + prior)
        opacity = np.clip(1.0 - slope, 0.0, 1.0)
        edge = np.clip(self.half + 0.5 - np.maximum(np.abs(across), np.abs(along)), 0.0, 1.0)
        opacity = np.where((opacity < 0.04) | ~self._own(opacity), 0.0, opacity) * edge
        self.opacity = opacity.astype(np.float32)
        self.light = np.where(opacity > 0.0, np.median(looks - (1.0 - opacity) * walls, axis=0), 0.0).astype(np.float32)
        self._blurred = {}

    def _own(self, opacity: FloatArray) -> NDArray[np.bool_]:
        """Return where the opacity is the bob's and its rod's: what is opaque in one piece with its middle, and a rim.

        A shadow beside it and what passed by would draw the bob towards them, differently in each picture.
        """
        cv = self.cv
        solid = cv.erode((opacity > 0.5).astype(np.uint8), cv.getStructuringElement(cv.MORPH_CROSS, (3, 3)))
        labels = cv.connectedComponents(solid)[1]
        h = np.arange(-self.half, self.half + 1)
        near = labels[(labels > 0) & (np.hypot(h[:, None], h) < 0.6 * self.radius)]
        if not len(near):
            return np.ones(opacity.shape, dtype=bool)
        piece = (labels == np.bincount(near).argmax()).astype(np.uint8)
        return np.asarray(cv.dilate(piece, cv.getStructuringElement(cv.MORPH_ELLIPSE, (2 * _RIM + 1,) * 2)) > 0)

    def _at(self, picture: Image, x: Image, y: Image) -> Image:
        """Return a picture's values at places within it, interpolated."""
        return np.asarray(self.cv.remap(picture, x, y, self.cv.INTER_LINEAR, borderMode=self.cv.BORDER_REPLICATE),
                          dtype=np.float32)

    def smeared(self, streak: float) -> tuple[Image, Image, int]:
        """Return opacity and light of a bob that moves by ``streak`` pixels during the exposure, and half the width."""
        key = round(4.0 * streak)
        reach = self.half + math.ceil(0.125 * key + 0.5)
        if key not in self._blurred:
            pad = reach - self.half
            width = 0.25 * key
            kernel = np.zeros(2 * pad + 1, np.float32)
            for i in range(-pad, pad + 1):
                kernel[i + pad] = max(0.0, min(i + 0.5, 0.5 * width) - max(i - 0.5, -0.5 * width))
            kernel = kernel / kernel.sum() if width > 0.0 else (np.arange(2 * pad + 1) == pad).astype(np.float32)
            images = []
            for one in (self.opacity, self.light):
                wide = self.cv.copyMakeBorder(one, 0, 0, pad, pad, self.cv.BORDER_CONSTANT)
                images.append(self.cv.filter2D(wide, -1, kernel[None], borderType=self.cv.BORDER_CONSTANT))
            self._blurred[key] = (images[0], images[1])
        return (*self._blurred[key], reach)

    def place(self, picture: Picture, near: tuple[float, float], angle: float, streak: float,
              curved: float = 0.0) -> Place | None:
        """Return the place of the bob near a place in a picture; None where it does not fit or leaves the picture.

        ``angle`` [rad] is that of the rod, ``streak`` what the bob moves during the exposure [pixels], and ``curved``
        the reciprocal of its arc's radius: the middle of a streak is ``streak² curved / 24`` above the arc.
        """
        opacity, light, reach = self.smeared(streak)
        c, s = math.cos(angle), math.sin(angle)
        x, y = near
        room = math.ceil(abs(c) * reach + abs(s) * self.half), math.ceil(abs(s) * reach + abs(c) * self.half)
        bg = self.background
        height, width = bg.picture.shape
        corner: tuple[int, int] | None = None
        moved = 0.0
        for step in range(_STEPS):
            at = round(x), round(y)
            if corner != at:
                corner = at
                left, right = max(at[0] - room[0] - 1, bg.left), min(at[0] + room[0] + 2, bg.left + width)
                top, low = max(at[1] - room[1] - 1, bg.top), min(at[1] + room[1] + 2, bg.top + height)
                if right - left < 6 or low - top < 6:
                    return None
                part = picture[top:low, left:right].astype(np.float32)
                B = bg.picture[top - bg.top : low - bg.top, left - bg.left : right - bg.left]
                var = bg.variance[top - bg.top : low - bg.top, left - bg.left : right - bg.left]
                gx, gy = np.meshgrid(np.arange(left, right, dtype=np.float32), np.arange(top, low, dtype=np.float32))
            dx, dy = gx - np.float32(x), gy - np.float32(y)
            u, v = c * dx - s * dy + np.float32(reach), s * dx + c * dy + np.float32(self.half)
            m, mu, mv = self._sloped(opacity, u, v)
            U, Uu, Uv = self._sloped(light, u, v)
            model = B * (1.0 - m) + U
            inside = (np.abs(u - reach) <= reach) & (np.abs(v - self.half) <= self.half)
            weight = inside / (self.noise**2 + (1.0 - m) ** 2 * var)
            du, dv = mu * B - Uu, mv * B - Uv  # minus the slope of the model along the bob's own axes
            J = np.stack([(c * du + s * dv).ravel(), (-s * du + c * dv).ravel(), model.ravel()]).astype(np.float64)
            w = weight.ravel().astype(np.float64)
            WJ = J * w
            if step == 0:
                g = float((WJ[2] @ part.ravel()) / max(WJ[2] @ J[2], 1e-9))
            rest = (part - np.float32(g) * model).ravel().astype(np.float64)
            J[:2] *= g
            WJ[:2] *= g
            normal = WJ @ J.T
            try:
                change = np.linalg.solve(normal + 1e-9 * np.diag(np.diag(normal)), WJ @ rest)
            except np.linalg.LinAlgError:
                return None
            size = math.hypot(change[0], change[1])
            limit = 0.5 * self.radius + 1.0
            factor = min(1.0, limit / size) if size > 0.0 else 1.0
            x, y, g = x + factor * change[0], y + factor * change[1], g + factor * change[2]
            moved = math.hypot(x - near[0], y - near[1])
            if not moved < 4.0 * self.radius + streak + 8.0 or not 0.2 < g < 5.0:
                return None
            if size < 0.004:
                break
        else:
            if size > 0.1:
                return None
        own = (U - m * B).ravel().astype(np.float64)
        size2 = float((w * own) @ own)
        if not size2 > 0.0:
            return None
        excess = part.ravel() / g - B.ravel()
        seen = float((w * own) @ excess) / size2
        count = max(int((w > 0).sum()) - 3, 1)
        chi2 = float((w * rest) @ rest) / count
        covariance = np.asarray(np.linalg.pinv(normal)[:2, :2] * chi2, dtype=np.float64)
        rim = 0.6 * self.radius
        if not (bg.left + rim <= x <= bg.left + width - rim and bg.top + rim <= y <= bg.top + height - rim):
            return None
        sagitta = streak * streak * curved / 24.0
        return Place(x + s * sagitta, y + c * sagitta, covariance, seen, math.sqrt(chi2))

    def _sloped(self, image: Image, u: Image, v: Image) -> tuple[Image, Image, Image]:
        """Return an image of the bob's frame and its slopes along u and v, at places; 0 outside."""
        cv = self.cv
        value = cv.remap(image, u, v, cv.INTER_LINEAR, borderMode=cv.BORDER_CONSTANT)
        key = id(image)
        if getattr(self, "_slope_of", None) is None:
            self._slope_of: dict[int, Any] = {}
        if key not in self._slope_of or self._slope_of[key][0] is not image:
            wide = cv.copyMakeBorder(image, 1, 1, 1, 1, cv.BORDER_CONSTANT)
            self._slope_of[key] = (image, 0.5 * (wide[1:-1, 2:] - wide[1:-1, :-2]),
                                   0.5 * (wide[2:, 1:-1] - wide[:-2, 1:-1]))
        _, across, along = self._slope_of[key]
        return (value, cv.remap(across, u, v, cv.INTER_LINEAR, borderMode=cv.BORDER_CONSTANT),
                cv.remap(along, u, v, cv.INTER_LINEAR, borderMode=cv.BORDER_CONSTANT))

    def expose(self, pictures: list[Picture], places: FloatArray, angles: FloatArray, speeds: FloatArray,
               frame: float) -> float:
        """Find the exposure [s], at most the time ``frame`` between frames, that fits pictures of a fast bob best."""
        shares = np.linspace(0.0, 1.0, 11)
        table = []
        for share in shares:
            fits = [self.place(picture, (x, y), angle, speed * share * frame)
                    for picture, (x, y), angle, speed in zip(pictures, places, angles, speeds, strict=True)]
            table.append(np.median([fit.misfit**2 if fit is not None else 100.0 for fit in fits]))
        best = int(np.argmin(table))
        share = float(shares[best])
        if 0 < best < len(shares) - 1:
            a, b, c = table[best - 1 : best + 2]
            share += 0.1 * 0.5 * float((a - c) / max(a - 2 * b + c, 1e-12))
        self.exposure = share * frame
        return self.exposure
