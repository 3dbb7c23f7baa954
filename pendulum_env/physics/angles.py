"""Units of angles, by the place where they are typed, read or written: one table, to which errors about units lead."""

from __future__ import annotations

SEE = "see lab-pendulum list units --all"
"""End of an error or a warning about an angle's unit."""
HEAD = ("place", "units of angles and velocities, and what has them")
ROWS = (
    ("Python", "rad, rad/s: all that is given and returned: rollout, gym.make, options of reset, observations, info, "
     "results"),
    ("command line", "degrees, rad/s: --angle, --phase, settings of a scene that are angles, amplitudes by hand"),
    ("window, pages", "degrees, rad/s: what is typed, dragged and shown; also titles and most figures, whose axes name "
     "the unit"),
    ("scenes, results", "rad, rad/s: files in JSON, CSV and zip; heads of columns name the unit"),
    ("recordings", "deg or rad: as a title or a header says; without one, degrees if the largest angle is above 2 pi "
     "or the steps are coarse, else rad; unit= in Python and --unit on the command line decide"),
)
"""Place, and units. Everything else is in SI; the angle is 0 straight down and grows counter-clockwise."""
