"""Films of a pendulum: the bob is found by its motion, followed from frame to frame, and its angle measured."""

from __future__ import annotations

from pendulum_env.lab.film.frames import is_film
from pendulum_env.lab.film.track import FilmTrack, follow, track

__all__ = ["FilmTrack", "follow", "is_film", "track"]
