"""Checks of user arguments, with errors that say what was wrong and what is allowed; and warnings beside them.

A warning names the user's line of code, not a line of this package or of Gymnasium.
"""

from __future__ import annotations

import difflib
import inspect
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from inspect import signature
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.many import Many
from pendulum_env.common.texts import LONGEST, shortened


class SceneError(ValueError):
    """Error of an invalid scene or argument: an unknown name, a value out of range, a contradiction."""


class UnknownParameterError(SceneError, TypeError):
    """Error of a keyword that is not a parameter of the scene; also a TypeError, as Python raises for unknown keywords.

    Attributes:
        given: the unknown keyword.
    """

    def __init__(self, message: str, given: str = "") -> None:
        super().__init__(message)
        self.given = given


MEANT = {
    "g": "the acceleration of gravity is gravity=9.81 [m/s^2].",
    "m": "the mass of the bob is mass=0.04 [kg].",
    "l": "the length of the pendulum is length=0.353 [m].",
    "L": "the length of the pendulum is length=0.353 [m].",
    "max_speed": "the speed that ends an episode is speed_limit=8.0 [rad/s]; the speed is never clipped.",
    "reward": "the reward is chosen by task=, the name of one or a pendulum_env.Task with a reward of your own.",
    "reward_fn": "the reward is chosen by task=, the name of one or a pendulum_env.Task with a reward of your own.",
    "latency": "delays are observation_delay=0.02 and action_delay=0.02 [s].",
    "delay": "delays are observation_delay=0.02 and action_delay=0.02 [s].",
    "noise": "the noise of readings is sensor=Sensor(noise=0.01) [rad].",
    "noise_std": "the noise of readings is sensor=Sensor(noise=0.01) [rad].",
    "drag": "losses are chosen by damping=, as in damping='linear+quadratic'.",
    "max_steps": "the length of an episode is duration=10.0 [s], or gym.make(..., max_episode_steps=500).",
    "num_steps": "the length of an episode is duration=10.0 [s], or gym.make(..., max_episode_steps=500).",
    "friction": "losses are chosen by damping=, as in damping='linear+coulomb'.",
    "seed": "the seed is an argument of reset, reset(seed=0), and of rollout.",
    "timestep": "the step is dt=0.01 [s].",
    "time_step": "the step is dt=0.01 [s].",
    "method": "the method is chosen by integrator=, as in integrator='rk4'.",
    "solver": "the method is chosen by integrator=, as in integrator='rk4'.",
    "theta0": "the angle at which a run starts is angle= [rad].",
    "theta": "the angle at which a run starts is angle= [rad].",
    "frame_skip": "a control step of dt [s] has substeps steps of the integrator, as in dt=0.02, substeps=4.",
    "control_freq": "the control step is dt=0.02 [s], 1/control_freq, and has substeps steps of the integrator.",
}
"""Keywords that people use for other programs' pendulums -> what to use here."""

LONGEST_PATH = 4096
"""Largest number of characters of a path."""


def shown(value: Any) -> str:
    """Return a value as short text in one line, for error messages."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python refuses to print integers of several thousand digits
        text = f"a {type(value).__name__} too long to be written"
    return shortened(text, LONGEST)


def number(value: Any, name: str, *, above: float | None = None, least: float | None = None, unit: str = "") -> float:
    """Return a value as a float after checking that it is a finite number in its range.

    An instance of Many (one number with a value per environment) is returned unchanged if all its values are in the
    range. Raises SceneError that names the argument and the allowed range.
    """
    if isinstance(value, Many):
        for end in (value.values.min(), value.values.max()):
            number(end, name, above=above, least=least, unit=unit)
        return value  # type: ignore[return-value]
    bound = f" above {above:g}" if above is not None else f" of at least {least:g}" if least is not None else ""
    wanted = f"a finite number{bound}" + (f" [{unit}]" if unit not in ("", "1") else "")
    try:
        plain = value.item() if getattr(value, "shape", None) == () else value
        if isinstance(plain, (bool, str, bytes)) or hasattr(plain, "__len__"):
            raise TypeError
        checked = float(plain)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be {wanted}, not {shown(value)}.") from None
    low = (above is not None and not checked > above) or (least is not None and checked < least)
    if not math.isfinite(checked) or low:
        raise SceneError(f"{name} must be {wanted}, not {checked!r}.")
    return checked


def whole_number(value: Any, name: str, most: int | None = None, least: int = 1) -> int:
    """Return a value as an int from ``least`` to ``most`` (if given); raises SceneError for anything else."""
    try:
        checked = None if isinstance(value, bool) else index(value)
    except TypeError:
        checked = None
    if checked is None or checked < least or (most is not None and checked > most):
        span = f"from {least}{'' if most is None else f' to {most}'}"
        raise SceneError(f"{name} must be a whole number {span}, not {shown(value)}.")
    return checked


def line(value: Any, name: str) -> str:
    """Return a value after checking that it is one line of printable text; raises SceneError otherwise."""
    if not isinstance(value, str):
        raise SceneError(f"{name} must be text, not {shown(value)}.")
    if not value.isprintable() or not 0 < len(value) <= LONGEST:
        raise SceneError(f"{name} must be one line of 1 to {LONGEST} characters, not {shown(value)}.")
    return value


def printable(text: str) -> str:
    """Return a text with a space in place of each character that cannot be printed, such as a newline."""
    return "".join(c if c.isprintable() else " " for c in text)


def one_of(value: Any, name: str, allowed: Iterable[str]) -> str:
    """Return a value after checking that it is an allowed word; raises SceneError that names similar words otherwise.
    """
    if not isinstance(value, str) or value not in allowed:
        raise SceneError(f"There is no {name} {shown(value)}{nearest(value, allowed)}")
    return value


def boolean(value: Any, name: str) -> bool:
    """Return a value after checking that it is True or False; raises SceneError otherwise."""
    checked = value.item() if getattr(value, "shape", None) == () else value
    if not isinstance(checked, bool):
        raise SceneError(f"{name} must be True or False, not {shown(value)}.")
    return checked


def several(value: Any, name: str, what: str) -> tuple[Any, ...]:
    """Return the entries of a list or another iterable as a tuple; raises SceneError for a text, a dict or a number.

    ``what`` names the entries in the error message, in the plural.
    """
    single = isinstance(value, (str, bytes, Mapping)) or getattr(value, "shape", None) == ()
    if single or not isinstance(value, Iterable):
        raise SceneError(f"{name} must be a list of {what}, not {shown(value)}.")
    return tuple(value)


def function(value: Any, name: str) -> Callable[..., Any]:
    """Return a value after checking that it can be called; raises SceneError otherwise."""
    if not callable(value):
        raise SceneError(f"{name} must be a function, not {shown(value)}.")
    return value  # type: ignore[no-any-return]


def file_path(value: Any, name: str) -> Path:
    """Return a value as the path of a file or folder; raises SceneError if it is empty, too long or no path."""
    try:
        text = os.fspath(value)
    except TypeError:
        text = None
    if not isinstance(text, str) or not 0 < len(text) <= LONGEST_PATH or "\0" in text:
        raise SceneError(f"{name} must be a path of 1 to {LONGEST_PATH} characters without NUL, not {shown(value)}.")
    return Path(text)


def first_line(documented: Any) -> str:
    """Return the first line of an object's docstring without its full stop."""
    return (documented.__doc__ or "").strip().partition("\n")[0].rstrip(".")


@contextmanager
def naming_keywords(function: Callable[..., Any]) -> Iterator[None]:
    """Add a suggestion to the error if a keyword of ``function`` is misspelt in a call.

    The code in the ``with`` block treats unknown keywords as parameters of a scene and raises UnknownParameterError for
    them. If a keyword of ``function`` is similar, the error names it; otherwise it is passed on unchanged.
    """
    try:
        yield
    except UnknownParameterError as error:
        if error.given in MEANT:
            raise UnknownParameterError(
                f"unexpected keyword argument {shown(error.given)}; {MEANT[error.given]}", error.given) from None
        near = difflib.get_close_matches(error.given, signature(function).parameters, n=1, cutoff=0.75)
        if not near:
            raise
        message = f"unexpected keyword argument {shown(error.given)}; did you mean {near[0]}?"
        raise UnknownParameterError(message, error.given) from None


MOST_NAMES = 12
"""Largest number of allowed names that an error message lists."""


def nearest(name: Any, known: Iterable[str]) -> str:
    """Return the end of an error message on an unknown name: up to three similar names, else all allowed names.

    If there are more than 12 names (MOST_NAMES), only the first three are given.
    """
    names, text = list(known), name[:LONGEST].lower() if isinstance(name, str) else ""
    if near := difflib.get_close_matches(text, names, n=3, cutoff=0.5):
        return f"; did you mean {' or '.join(near)}?"
    if len(names) <= MOST_NAMES:
        return f"; there are {', '.join(names)}."
    return f"; there are {len(names)}, such as {', '.join(names[:3])}."


def float_array(value: Any) -> NDArray[np.float64]:
    """Return a number, nested lists of numbers or an array as a float64 array.

    Raises TypeError for anything else, including truth values.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind in "iufO":
            return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"no array of numbers: {type(value).__name__}")


BETWEEN = ("pendulum_env", "integrators", "gymnasium")
"""Packages whose lines a warning does not name."""


def warn(text: str) -> None:
    """Emit a UserWarning that points to the user's line of code: the nearest caller outside this package and Gymnasium.
    """
    here = inspect.currentframe()
    frame, level = here.f_back if here is not None else None, 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in BETWEEN:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


@cache
def warn_once(text: str) -> None:
    """Emit a UserWarning as :func:`warn` does, but the same text once per process only."""
    warn(text)
