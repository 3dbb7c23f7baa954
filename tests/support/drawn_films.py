"""Films of pendulums with known truth, drawn by numpy alone and encoded by libx264: nothing of the code under test.

A frame is a stack of layers (discs, bars), each of which covers pixels with soft edges, averaged over the exposure;
a frame's time stamp is the middle of its exposure. Pixel (0, 0) has its middle at x = 0, y = 0; y points down. Motions
come from :func:`virtual_swings.swing`, by SciPy's integrator.

    python tests/support/drawn_films.py FOLDER [--only NAME ...] [--seed 1]
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter
from virtual_swings import GRAVITY, swing

Array = NDArray[np.float64]
Colour = tuple[float, float, float]  # Y, U, V: grey is U = V = 128
DARK, WIRE, SKIN, WOOD = (50.0, 128.0, 128.0), (100.0, 128.0, 128.0), (165.0, 112.0, 150.0), (90.0, 118.0, 138.0)
SOFT = 1.4  # width [px] over which an edge rises, as a lens draws it
PARTS = 8  # sub-frames of an exposure


@dataclass(frozen=True)
class Film:
    """A film to draw: what stands before the camera, how it moves, and how the camera sees and writes it."""

    name: str
    sentence: str
    size: tuple[int, int] = (480, 360)
    fps: float = 30.0
    seconds: float = 7.0
    pivot: tuple[float, float] = (240.0, 40.0)  # px, where the camera looks straight
    radius: float = 240.0  # px
    length: float = 0.65  # m
    amplitude: float = 20.0  # degrees
    begin: float = 0.3  # s after a turning point at which the film begins
    gamma: float = 0.03  # 1/s, damping
    bob: float = 24.0  # px, diameter
    colour: Colour = DARK
    light: float = 170.0  # of the background
    thread: float = 1.5  # px, width of wire or rod
    thread_colour: Colour = WIRE
    noise: float = 2.0  # grey levels
    crf: int = 23
    exposure: float = 0.004  # s
    pattern: float = 0.0  # grey levels of a patterned background
    drift: float = 0.0  # share by which the light changes slowly
    flicker: float = 0.0  # share of the light that flickers at 100 Hz
    readout: float = 0.0  # s from the first row to the last
    shadow: float = 0.0  # darkness of the bob's shadow on the wall, 0 to 1
    mirror: bool = False  # a shiny table below the bob
    hand: float = 0.0  # s until a hand lets go
    yaw: float = 0.0  # degrees, camera to the side
    pitch: float = 0.0  # degrees, camera above
    roll: float = 0.0  # degrees, camera about its axis
    lens: float = 0.0  # share by which the corners are drawn in
    shake: float = 0.0  # px by which the camera shakes in the hand
    pan: float = 0.0  # px/s by which the camera follows
    uneven: float = 0.0  # s by which frames come earlier or later
    dropped: float = 0.0  # share of frames that are lost, with true time stamps
    repeated: int = 0  # every such frame shows the frame before once more
    turned: int = 0  # degrees by which the file's flag turns the picture
    stated: float = 0.0  # frames per second that a slow-motion file states
    second: bool = False  # another pendulum beside it
    stand: float = 0.0  # px, width of a post before the bob
    walker: str = ""  # somebody walks by "behind" or "before" the pendulum
    still: bool = False  # nothing swings
    options: dict[str, Any] = field(default_factory=dict)  # keywords that the tracker needs
    refusal: str = ""  # words of which one is in the sentence of the refusal


@dataclass(frozen=True)
class Truth:
    """What a film shows: a row for each frame, in the picture as shown, and the motion between them."""

    film: Film
    time: Array
    angle: Array
    x: Array
    y: Array
    visible: Array  # share of the bob that is seen, 0 to 1
    free: NDArray[np.bool_]  # no hand holds the bob
    fine_time: Array
    fine_angle: Array
    pivot: tuple[float, float]

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Frames in which a tracker should find the bob."""
        return np.asarray(self.free & (self.visible >= 0.98))

    @property
    def period(self) -> float:
        """Period of small swings [s]."""
        return 2.0 * math.pi * math.sqrt(self.film.length / GRAVITY)

    @property
    def first_bob(self) -> tuple[float, float]:
        """Place of the bob in the first frame in which it swings and is seen."""
        first = int(np.argmax(self.seen))
        return float(self.x[first]), float(self.y[first])


FILMS = (
    Film("plain", "A dark bob of 24 px on a bright wall."),
    Film("six_pixels", "A bob of 6 px.", bob=6.0, thread=1.0),
    Film("eighty_pixels", "A bob of 80 px.", bob=80.0, radius=220.0, pivot=(240.0, 70.0)),
    Film("faint", "A bob 14 grey levels darker than the wall, in noise of 3.", colour=(156.0, 128.0, 128.0), noise=3.0,
         thread_colour=(160.0, 128.0, 128.0)),
    Film("strong", "A white bob before black cloth.", colour=(230.0, 128.0, 128.0), light=25.0),
    Film("noisy", "A dim room: noise of 12 grey levels.", noise=12.0, light=110.0),
    Film("crf_18", "Little compression, a patterned wall.", pattern=12.0, crf=18),
    Film("crf_30", "Strong compression, a patterned wall.", pattern=12.0, crf=30),
    Film("crf_38", "The strongest compression, a patterned wall.", pattern=12.0, crf=38),
    Film("shadow", "The bob's shadow on the wall swings with it.", shadow=0.45),
    Film("touching", "A large bob's shadow, which touches it.", shadow=0.3, bob=52.0, pattern=6.0),
    Film("mirror", "A shiny table shows the bob upside down.", mirror=True, radius=190.0),
    Film("patterned", "A wall of strong pattern, darker and brighter than the bob.", pattern=30.0,
         colour=(128.0, 128.0, 128.0)),
    Film("colour", "A red bob as bright as the wall.", colour=(165.0, 100.0, 190.0), light=168.0,
         thread_colour=(160.0, 128.0, 128.0)),
    Film("clouds", "The daylight changes slowly by a third.", drift=0.33, pattern=12.0),
    Film("hand", "A hand pulls the bob aside and lets go.", hand=2.0, seconds=9.0),
    Film("blur", "An exposure in which the bob moves by its diameter.", bob=16.0, exposure=0.033, amplitude=25.0,
         radius=250.0),
    Film("half_blur", "An exposure in which the bob moves by half its diameter, at 60 frames a second.", bob=24.0,
         exposure=0.0155, amplitude=32.0, fps=60.0, seconds=5.0),
    Film("yaw", "A camera 15 degrees to the side.", yaw=15.0, amplitude=30.0),
    Film("pitch", "A camera 15 degrees above.", pitch=15.0, amplitude=30.0),
    Film("roll", "A camera turned by 6 degrees.", roll=6.0),
    Film("uneven", "A phone's varying rate, with true time stamps.", uneven=0.009),
    Film("dropped", "A tenth of the frames lost, with true time stamps.", dropped=0.1),
    Film("repeated", "Every fifth frame shows the frame before once more.", repeated=5),
    Film("leaves", "The bob leaves the picture on the right.", pivot=(360.0, 30.0), amplitude=32.0),
    Film("two", "A second pendulum swings beside it, by half the angle.", second=True, pivot=(150.0, 40.0),
         amplitude=18.0),
    Film("rod", "A rod of 9 px instead of a wire.", thread=9.0, thread_colour=WOOD, bob=34.0),
    Film("bare_rod", "A rod as dark as its bob, which is hardly wider.", thread=12.0, thread_colour=DARK, bob=18.0),
    Film("flicker_30", "A lamp of 100 Hz, seen at 30 frames a second, row by row.", flicker=0.12, readout=0.008),
    Film("flicker_60", "A lamp of 100 Hz, seen at 60 frames a second, row by row.", flicker=0.12, fps=60.0,
         seconds=5.0, readout=0.008),
    Film("stand", "A post of 30 px before the bob.", stand=30.0),
    Film("pivot_outside", "The pivot is 200 px above the picture.", pivot=(240.0, -200.0), radius=480.0, amplitude=16.0,
         length=1.2),
    Film("turned", "Filmed upright: the file's flag turns the picture by 90 degrees.", size=(360, 480), turned=90,
         pivot=(180.0, 50.0), radius=340.0, amplitude=20.0),
    Film("slow_motion", "120 frames a second, in a file that states 30.", fps=120.0, stated=30.0, seconds=4.0,
         exposure=0.002, options={"rate": 120.0}),
    Film("behind", "Somebody walks by behind the pendulum.", walker="behind", seconds=8.0),
    Film("before", "Somebody walks by before the pendulum.", walker="before", seconds=8.0),
    Film("wide", "Swings of 75 degrees.", amplitude=75.0, radius=170.0, pivot=(240.0, 130.0), fps=60.0, seconds=5.0),
    Film("narrow", "Swings of 3 degrees, with the pivot given.", amplitude=3.0, radius=300.0, pivot=(240.0, 30.0),
         options={"pivot": (240.0, 30.0)}),
    Film("lens", "A wide-angle lens that draws the corners in by 12 %.", lens=0.12, amplitude=40.0, refusal="lens"),
    Film("shake", "A camera in the hand.", shake=3.0, pattern=25.0, refusal="camera"),
    Film("pan", "A camera that turns slowly.", pan=8.0, pattern=25.0, refusal="camera"),
    Film("still", "A pendulum at rest.", still=True, refusal="swing|move|to and fro"),
    Film("passer", "Somebody walks by, and nothing swings.", still=True, walker="behind",
         refusal="swing|move|to and fro"),
)
NAMES = {film.name: film for film in FILMS}


def other(film: Film, seed: int) -> Film:
    """Return a film of the same kind with other numbers, by a seed; seed 0: the film itself."""
    if not seed:
        return film
    random = np.random.default_rng([seed, *film.name.encode()])
    near = random.uniform
    side = near(-12.0, 12.0)
    options = dict(film.options)
    if "pivot" in options:
        options["pivot"] = (film.pivot[0] + side, film.pivot[1])
    return replace(
        film, pivot=(film.pivot[0] + side, film.pivot[1]), radius=film.radius * near(0.9, 1.02), options=options,
        amplitude=film.amplitude * near(0.85, 1.1), length=film.length * near(0.8, 1.4), begin=near(0.0, 1.0),
        gamma=film.gamma * near(0.3, 2.5), bob=film.bob * near(0.95, 1.2), light=film.light * near(0.97, 1.06),
        noise=film.noise * near(0.6, 1.25), yaw=-film.yaw * near(0.7, 1.1), roll=-film.roll * near(0.6, 1.2),
        pitch=-film.pitch * near(0.7, 1.1), crf=film.crf + int(random.integers(-2, 3)), hand=film.hand * near(0.7, 1.1))


def motion(film: Film) -> tuple[CubicSpline, Array, Array]:
    """Return the angle [rad] as a spline of the time [s], and the fine times and angles through which it passes."""
    fine = np.arange(-0.1, film.seconds + 0.2, 1.0 / 500.0)
    first = math.radians(film.amplitude)
    if film.still:
        return CubicSpline(fine, 0.0 * fine), fine, 0.0 * fine
    free = np.arange(0.0, film.seconds + 0.5 + film.begin, 1.0 / 500.0)
    swung = CubicSpline(free, swing(free, -first if film.hand else first, length=film.length, gamma=film.gamma))
    if not film.hand:
        angle = np.asarray(swung(np.maximum(fine + film.begin, 0.0)))
    else:
        pull = np.clip(fine / (0.6 * film.hand), 0.0, 1.0)
        held = -first * (3.0 * pull**2 - 2.0 * pull**3 + 0.004 * np.sin(9.0 * fine) * (film.hand - fine) * (pull == 1))
        angle = np.where(fine < film.hand, held, swung(np.maximum(fine - film.hand, 0.0)))
    return CubicSpline(fine, angle), fine, np.asarray(angle)


def stamps(film: Film) -> tuple[Array, NDArray[np.bool_]]:
    """Return the times of the frames [s], and which of them show the frame before once more."""
    random = np.random.default_rng([1, *film.name.encode()])
    time = np.arange(round(film.seconds * film.fps)) / film.fps
    if film.uneven:
        time = time + film.uneven * random.uniform(-1.0, 1.0, len(time))
        time = time - time[0]
    if film.dropped:
        lost = random.random(len(time)) < film.dropped
        lost[len(time) // 2 : len(time) // 2 + 6] = True
        lost[0] = False
        time = time[~lost]
    time = np.round(time * 90000.0) / 90000.0  # as the file writes them
    again = np.arange(len(time)) % film.repeated == film.repeated - 1 if film.repeated else np.zeros(len(time), bool)
    return time, again


def seen_at(film: Film, angle: Array, pivot: tuple[float, float] | None = None, radius: float | None = None) -> Array:
    """Return the place in the picture [px] of a bob at these angles, shape (..., 2); radius 0: of the pivot."""
    length = film.radius if radius is None else radius
    foot = film.pivot if pivot is None else pivot
    x, y, z = length * np.sin(angle), length * np.cos(angle), np.zeros_like(angle)
    for degrees, flat in ((film.yaw, "x"), (film.pitch, "y")):
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        if flat == "x":
            x, z = c * x, s * x + z
        else:
            y, z = c * y - s * z, s * y + c * z
    near = 6.0 * film.radius / (6.0 * film.radius + z)
    x, y = x * near, y * near
    c, s = math.cos(math.radians(film.roll)), math.sin(math.radians(film.roll))
    x, y = foot[0] + c * x - s * y, foot[1] + s * x + c * y
    if film.lens:
        middle = np.array([film.size[0] / 2.0, film.size[1] / 2.0])
        out = ((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / float(middle @ middle)
        x, y = middle[0] + (x - middle[0]) * (1.0 - film.lens * out), middle[1] + (y - middle[1]) * (
            1.0 - film.lens * out)
    return np.stack([x, y], axis=-1)


@dataclass(frozen=True)
class Layer:
    """A bar with round ends from ``a`` to ``b`` (arrays (sub-frames, 2)); a disc where these are one place."""

    a: Array
    b: Array
    width: float
    colour: Colour
    share: float = 1.0  # 1: opaque

    def cover(self, shape: tuple[int, int], scale: float = 1.0) -> tuple[tuple[slice, slice], Array]:
        """Return the box of pixels that the layer touches and the share of each that it covers."""
        a, b = ((place - 0.5 * (1.0 - scale) / scale) * scale for place in (self.a, self.b))
        half, soft = 0.5 * self.width * scale, SOFT * max(scale, 0.7)
        ends = np.concatenate([a, b])
        low = np.clip(np.floor(ends.min(axis=0) - half - soft), 0, shape[::-1]).astype(int)
        high = np.clip(np.ceil(ends.max(axis=0) + half + soft) + 1, 0, shape[::-1]).astype(int)
        box = slice(low[1], high[1]), slice(low[0], high[0])
        x = np.arange(low[0], high[0])[None, :]
        y = np.arange(low[1], high[1])[:, None]
        total = np.zeros((max(high[1] - low[1], 0), max(high[0] - low[0], 0)))
        for (ax, ay), (bx, by) in zip(a, b, strict=True):
            dx, dy = bx - ax, by - ay
            long = dx * dx + dy * dy
            along = np.clip(((x - ax) * dx + (y - ay) * dy) / long, 0.0, 1.0) if long > 1e-9 else 0.0
            away = np.hypot(x - ax - along * dx, y - ay - along * dy)
            total += np.clip((half - away) / soft + 0.5, 0.0, 1.0)
        return box, self.share * total / len(a)


class Stage:
    """The scene of a film: its background, its motion, and its layers at a time."""

    def __init__(self, film: Film) -> None:
        self.film = film
        self.angle, self.fine_time, self.fine_angle = motion(film)
        random = np.random.default_rng([2, *film.name.encode()])
        self.margin = 64 if film.shake or film.pan else 0
        height, width = film.size[1] + 2 * self.margin, film.size[0] + 2 * self.margin + int(film.pan * film.seconds)
        back = np.full((height, width), film.light)
        if film.pattern:
            rough = sum(gaussian_filter(random.standard_normal(back.shape), wide) * wide for wide in (2.0, 6.0, 20.0))
            back += film.pattern * rough / np.std(rough)
            brick = (np.arange(height)[:, None] // 24 % 2 * 30 + np.arange(width)[None, :]) % 60 < 2
            back -= film.pattern * (brick | (np.arange(height)[:, None] % 24 < 2))
        across = np.linspace(-1.0, 1.0, width)[None, :]
        self.back = np.clip(back * (1.0 - 0.06 * across**2), 16.0, 235.0)
        phase = random.uniform(0.0, 6.3, 6)
        self.sway = lambda t: np.array([
            math.sin(2.1 * t + phase[0]) + 0.6 * math.sin(5.3 * t + phase[1]) + 0.3 * math.sin(13.0 * t + phase[2]),
            math.sin(1.7 * t + phase[3]) + 0.6 * math.sin(4.7 * t + phase[4]) + 0.3 * math.sin(15.0 * t + phase[5])])
        self.noise = random.standard_normal(film.size[0] * film.size[1] * 3).astype(np.float32)
        self.random = random

    def offset(self, t: float) -> Array:
        """Return by how much the picture is moved by the camera [px]."""
        return self.film.shake * np.asarray(self.sway(t)) + np.array([-self.film.pan * t, 0.0])

    def bob_at(self, time: Array) -> Array:
        """Return the place of the bob [px] at these times, each seen when its row is read out."""
        place = seen_at(self.film, self.angle(time))
        for _ in range(3 if self.film.readout else 0):
            late = self.film.readout * (place[..., 1] / self.film.size[1] - 0.5)
            place = seen_at(self.film, self.angle(time + late))
        return place

    def layers(self, t: float) -> tuple[list[Layer], Layer, list[Layer]]:
        """Return the layers behind the bob, the bob, and those before it."""
        film, parts = self.film, PARTS if self.film.exposure > 0.006 else 2
        times = t + film.exposure * ((np.arange(parts) + 0.5) / parts - 0.5)
        moved = self.offset(t)
        bob, foot = self.bob_at(times) + moved, seen_at(film, self.angle(times), radius=0.0) + moved
        behind: list[Layer] = []
        front: list[Layer] = []

        def fixed(x: float, y: float) -> Array:
            return np.array([[x, y]]) + moved

        width, height = film.size
        if film.walker:
            x = -0.3 * width + (t - 2.5) * 0.4 * width + 6.0 * math.sin(7.0 * t)
            body = [Layer(fixed(x, 0.55 * height), fixed(x - 8.0, 1.1 * height), 0.2 * width, (75.0, 140.0, 118.0)),
                    Layer(fixed(x, 0.22 * height), fixed(x, 0.24 * height), 0.1 * width, SKIN)]
            (behind if film.walker == "behind" else front).extend(body)
        if film.shadow:
            cast = np.array([46.0, 18.0])
            behind.append(Layer(bob + cast, bob + cast, film.bob * 1.15, (20.0, 128.0, 128.0),
                                film.shadow))
            behind.append(Layer(foot + cast, bob + cast, film.thread, (20.0, 128.0, 128.0),
                                0.5 * film.shadow))
        if film.mirror:
            line = height - 75.0
            image = np.stack([bob[:, 0], 2.0 * line - bob[:, 1]], axis=1)
            behind.append(Layer(image, image, film.bob, film.colour, 0.4))
        if film.second:
            other_foot = (film.pivot[0] + 190.0, film.pivot[1])
            swung = 0.5 * math.radians(film.amplitude) * np.cos(math.sqrt(GRAVITY / film.length) * 1.19 * times + 1.0)
            place = seen_at(film, swung, other_foot, film.radius / 1.19**2)
            behind.append(Layer(seen_at(film, swung, other_foot, 0.0), place, film.thread, film.thread_colour))
            behind.append(Layer(place, place, film.bob, film.colour))
        behind.append(Layer(foot, bob, film.thread, film.thread_colour))
        if film.hand:
            gone = max(t - film.hand, 0.0)
            left = seen_at(film, self.angle(np.full(parts, film.hand - 1e-6))) + moved
            hand = bob if gone == 0.0 else left - np.array([220.0 * gone + 90.0 * gone**2, 0.0])
            fingers = hand + np.array([-0.45 * film.bob, 4.0])
            elbow = np.stack([0.0 * fingers[:, 0] - 60.0, fingers[:, 1] + 60.0], axis=1)
            front.append(Layer(fingers - (6.0, 0.0), fingers, 0.9 * film.bob + 10.0, SKIN))
            front.append(Layer(elbow, fingers - (16.0, 0.0), 0.8 * film.bob + 12.0, (120.0, 150.0, 110.0)))
        if film.stand:
            at = film.pivot[0] + 0.45 * film.radius * math.sin(math.radians(film.amplitude))
            front.append(Layer(fixed(at, -20.0), fixed(at, height + 20.0), film.stand, WOOD))
        return behind, Layer(bob, bob, film.bob, film.colour), front

    def light_at(self, t: float) -> Array:
        """Return the factor of the light, row by row."""
        film = self.film
        rows = t + film.readout * (np.arange(film.size[1]) / film.size[1] - 0.5)
        light = np.ones(film.size[1])
        if film.flicker:
            part = math.sin(math.pi * 100.0 * film.exposure) / (math.pi * 100.0 * film.exposure)
            light += film.flicker * part * np.cos(2.0 * math.pi * 100.0 * 1.003 * rows)
        if film.drift:
            light += -0.5 * film.drift + film.drift * (0.5 + 0.3 * np.sin(0.7 * t + 0.004 * np.arange(film.size[1])))
        return light[:, None]

    def frame(self, t: float) -> tuple[NDArray[np.uint8], float]:
        """Return the frame as planes of yuv420p, one below the other, and the share of the bob that is seen in it."""
        film = self.film
        width, height = film.size
        if self.margin:
            dx, dy = self.offset(t)
            x0, y0 = self.margin - dx, self.margin - dy
            i, j = int(y0), int(x0)
            fy, fx = y0 - i, x0 - j
            cut = self.back[i : i + height + 1, j : j + width + 1]
            cut = (1 - fy) * cut[:-1] + fy * cut[1:]
            planes = [(1 - fx) * cut[:, :-1] + fx * cut[:, 1:]]
        else:
            planes = [self.back.copy()]
        planes += [np.full((height // 2, width // 2), 128.0) for _ in range(2)]
        behind, bob, front = self.layers(t)
        box, seen = bob.cover((height, width))
        hidden = np.zeros((height, width))
        for layer in front:
            where, cover = layer.cover((height, width))
            hidden[where] = 1.0 - (1.0 - hidden[where]) * (1.0 - cover)
        area = math.pi * 0.25 * (film.bob**2 + SOFT**2 / 3.0)
        visible = min(float(np.sum(seen * (1.0 - hidden[box]))) / area, 1.0)
        for layer in (*behind, bob, *front):
            for k, plane in enumerate(planes):
                if k and layer.colour[k] == 128.0 and not film.walker and not film.hand and film.colour[k] == 128.0:
                    continue
                where, cover = layer.cover(plane.shape, 0.5 if k else 1.0)
                plane[where] += cover * (layer.colour[k] - plane[where])
        planes[0] *= self.light_at(t)
        at = int(self.random.integers(len(self.noise) - width * height))
        planes[0] += film.noise * self.noise[at : at + width * height].reshape(height, width)
        flat = [np.clip(np.rint(plane), 16, 235).astype(np.uint8).reshape(-1, width) for plane in planes]
        return np.concatenate(flat), visible


def draw(film: Film, path: Path | None = None) -> Truth:
    """Draw a film, write it to ``path`` (None: only the truth), and return its truth."""
    stage = Stage(film)
    time, again = stamps(film)
    place = stage.bob_at(time) + np.array([stage.offset(float(t)) for t in time])
    pivot = seen_at(film, np.zeros(1), radius=0.0)[0]
    visible = np.ones(len(time))

    def frames() -> Iterator[NDArray[np.uint8]]:
        last = None
        for k, t in enumerate(time):
            if last is None or not again[k]:
                last, visible[k] = stage.frame(float(t))
            else:
                visible[k] = 0.0
            yield last

    if path is not None:
        encode(path, frames(), np.arange(len(time)) / film.stated if film.stated else time, film)
    angle = np.asarray(stage.angle(time))
    return Truth(film, time, angle, place[:, 0], place[:, 1], visible, time >= film.hand, stage.fine_time,
                 stage.fine_angle, (float(pivot[0]), float(pivot[1])))


def encode(path: Path, frames: Iterator[NDArray[np.uint8]], time: Array, film: Film) -> None:
    """Write frames of yuv420p with their time stamps by libx264; the file's flag turns the picture by film.turned."""
    import av

    plain = path.with_suffix(".upright.mp4") if film.turned else path
    with av.open(str(plain), "w") as box:
        stream = box.add_stream("libx264", rate=Fraction(round(film.stated or film.fps)),
                                options={"crf": str(film.crf), "preset": "superfast"})
        width, height = film.size if film.turned != 90 else film.size[::-1]
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 90000)
        for picture, t in zip(frames, time, strict=True):
            if film.turned == 90:
                tall = film.size[1]
                planes = picture[:tall], *(picture[tall:].reshape(2, tall // 2, -1))
                picture = np.concatenate([np.rot90(plane).reshape(-1, width) for plane in planes])
            image = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="yuv420p")
            image.pts, image.time_base = round(float(t) * 90000), Fraction(1, 90000)
            box.mux(stream.encode(image))
        box.mux(stream.encode(None))
    if film.turned:
        import subprocess

        import imageio_ffmpeg

        flag = ["-display_rotation", str(-film.turned), "-i", str(plain), "-c", "copy", str(path)]
        subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *flag], check=True)
        plain.unlink()


def write(film: Film, folder: Path) -> Truth:
    """Write a film with its truth as JSON and NPZ into a folder."""
    truth = draw(film, folder / f"{film.name}.mp4")
    facts = {"name": film.name, "sentence": film.sentence, "size": film.size, "fps": film.fps, "bob": film.bob,
             "pivot": truth.pivot, "radius": film.radius, "length": film.length, "period0": truth.period,
             "amplitude": math.radians(film.amplitude), "options": film.options, "refusal": film.refusal or None,
             "first_bob": truth.first_bob, "film": asdict(film)}
    (folder / f"{film.name}.json").write_text(json.dumps(facts, indent=1))
    rows = ["time", "angle", "x", "y", "visible", "free", "fine_time", "fine_angle"]
    np.savez_compressed(folder / f"{film.name}.npz", **{name: getattr(truth, name) for name in rows})
    return truth


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Draw films with their truths into a folder.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=list(NAMES))
    parser.add_argument("--seed", type=int, default=0, help="other numbers of the same kinds")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.only:
        write(other(NAMES[name], given.seed), given.folder)
        print(name)
