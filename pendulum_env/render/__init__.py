"""Off-screen frames and films of pendulums, from plain numbers to uint8 RGB arrays and video files.

For example::

    apparatus = Apparatus(length=0.353, bob_radius=0.0107, suspension="wire")
    picture = frame(apparatus, View(time=0.0, angle=0.5), size=500)            # (500, 500, 3)
    picture = frame(apparatus, view, look=FrameStyle("dark", ("apparatus", "phase")))
    write_film("swing.mp4", pictures, fps=50)

Importing this package needs NumPy only. The first picture imports pygame-ce, for its font, and numba, which compiles
the loops over pixels; where numba is missing, or with ``LAB_PENDULUM_BACKEND=python``, Python runs them, and a frame
takes some 20 ms. The first film imports imageio-ffmpeg.
"""

from pendulum_env.render.film import write_film
from pendulum_env.render.palette import METHOD_COLOURS, THEMES, Theme, colour
from pendulum_env.render.panel import frame, side_by_side
from pendulum_env.render.stage import PANELS, FrameStyle
from pendulum_env.render.view import Apparatus, Orbits, PastSamples, View

__all__ = [
           "METHOD_COLOURS",
           "PANELS",
           "THEMES",
           "Apparatus",
           "FrameStyle",
           "Orbits",
           "PastSamples",
           "Theme",
           "View",
           "colour",
           "frame",
           "side_by_side",
           "write_film",
]
