"""Draw a film of a swing, as a phone on a stand sees it, track its bob, and fit a scene to the track.

The film has a patterned wall, noise and compression, and a hand that lets go after a second. The motion is simulated,
so the true numbers are known. Your own film takes the place of swing.mp4: `track("swing.mp4")` is all that it needs.
"""

import av
import numpy as np

from pendulum_env import fit, rollout
from pendulum_env.lab import follow
from pendulum_env.lab.simulated import true_scene
from pendulum_env.study.film_report import write

RATE, HELD, SECONDS = 30, 30, 12  # frames per second, frames in which the hand holds the bob, length of the film
SIZE, PIVOT, RADIUS, BOB = (432, 288), (222.0, 20.0), 225.0, 10.0  # pixels
BALL = {"mass": 0.01, "radius": 0.02}
random = np.random.default_rng(1)
y, x = np.mgrid[:SIZE[1], :SIZE[0]].astype(np.float32)
wall = 165.0 + 20.0 * np.sin(x / 97.0 + y / 61.0) + 5.0 * np.sin(x / 7.0) * np.sin(y / 9.0)


def drawn_over(picture: np.ndarray, start: tuple, end: tuple, half: float, light: float) -> np.ndarray:
    """Return a picture with a line of round ends, ``half`` as wide as given, over it; a point is a disc."""
    (x0, y0), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    along = np.clip(((x - x0) * dx + (y - y0) * dy) / max(dx * dx + dy * dy, 1e-9), 0.0, 1.0)
    cover = np.clip(half + 0.5 - np.hypot(x - x0 - along * dx, y - y0 - along * dy), 0.0, 1.0)
    return picture * (1.0 - cover) + light * cover


run = rollout(true_scene(), integrator="dop853", dt=1.0 / RATE, duration=SECONDS - HELD / RATE, angle=0.28)
with av.open("swing.mp4", "w") as file:
    stream = file.add_stream("libx264", rate=RATE, options={"crf": "26"})
    stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
    for k, angle in enumerate(np.concatenate([np.full(HELD, run.angle[0]), run.angle])):
        bob = (PIVOT[0] + RADIUS * np.sin(angle), PIVOT[1] + RADIUS * np.cos(angle))
        picture = drawn_over(wall, PIVOT, bob, 0.5, 90.0)
        picture = drawn_over(picture, bob, bob, BOB, 45.0)
        away = bob[0] + 8.0 + 12.0 * max(k - HELD, 0.0)  # the hand, which goes away to the right
        picture = drawn_over(picture, (away, bob[1] + 2.0), (away + 300.0, bob[1] + 60.0), 11.0, 195.0)
        grey = np.clip(picture + random.normal(0.0, 2.5, wall.shape), 0, 255).astype(np.uint8)
        file.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="gray")))
    file.mux(stream.encode(None))

found = follow("swing.mp4")
print(found)
print(*write(found, "swing.mp4", "out/track"), sep="\n")
assert found.share > 0.8
assert np.hypot(found.pivot[0] - PIVOT[0], found.pivot[1] - PIVOT[1]) < 4.0 * found.radius.error + 0.5
true = np.interp(found.time - HELD / RATE, run.time, run.angle)
free = found.time > HELD / RATE + 0.3
print(f"{np.degrees(np.std((found.angle - true)[free])):.4f} degrees from the truth (rms)")

result = fit(found.recording, "linear+quadratic", **BALL)
print(result.text)
length, true_length = result.parameters["length"], true_scene().body.length
print(f"length {length}, true {true_length} m")
assert abs(length.value - true_length) < 4.0 * length.error + 2e-4 * true_length
