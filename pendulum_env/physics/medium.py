"""Media that the bob moves through, with their density and viscosity."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

from pendulum_env.physics.elementary import exp, power
from pendulum_env.physics.units import Checked, SceneError, line, nearest, number, shown, si

ZERO_CELSIUS = 273.15


@dataclass(frozen=True)
class Medium(Checked):
    """A fluid at rest, with its density and viscosity. Raises SceneError for values out of range."""

    name: str = "vacuum"
    density: float = si(0.0, "kg/m^3", "density of the fluid", least=0.0)
    viscosity: float = si(0.0, "Pa s", "dynamic viscosity of the fluid", least=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        line(self.name, "A medium's name")

    @property
    def empty(self) -> bool:
        """Return True for a vacuum, which has neither density nor viscosity."""
        return self.density == 0.0 and self.viscosity == 0.0

    @property
    def kinematic_viscosity(self) -> float:
        """Return the kinematic viscosity ``nu = mu/rho`` [m²/s]; nan without density."""
        return self.viscosity / self.density if self.density > 0.0 else math.nan


VACUUM = Medium()


def vacuum() -> Medium:
    """Return the vacuum as a medium: no density, no viscosity."""
    return VACUUM


def air(temperature: float = 20.0, pressure: float = 101325.0) -> Medium:
    """Return dry air at ``temperature`` [degrees Celsius], -100 to 1600, and ``pressure`` [Pa].

    Viscosity 1.458e-6 T^1.5/(T + 110.4) (Sutherland's law, U.S. Standard Atmosphere 1976; within 2 % from 170 to
    1900 K: White 2006, Viscous Fluid Flow, table 1-2), density of the ideal gas with R = 287.05 J/(kg K). Raises
    SceneError for other temperatures and for a pressure that is not positive.
    """
    kelvin = _celsius(temperature, -100.0, 1600.0) + ZERO_CELSIUS
    pascal = number(pressure, "pressure", above=0.0, unit="Pa")
    return Medium("air", pascal / (287.05 * kelvin), 1.458e-6 * power(kelvin, 1.5) / (kelvin + 110.4))


def water(temperature: float = 20.0) -> Medium:
    """Return water at ``temperature`` [degrees Celsius], 0 to 100.

    Viscosity 2.414e-5 * 10^(247.8/(T - 140)) (Al-Shemmeri 2012); density 1000 (1 - (t + 288.9414)(t - 3.9863)^2 /
    (508929.2 (t + 68.12963))) (McCutcheon, Martin & Barnwell 1993). Raises SceneError for other temperatures.
    """
    celsius = _celsius(temperature, 0.0, 100.0)
    viscosity = 2.414e-5 * power(10.0, 247.8 / (celsius + ZERO_CELSIUS - 140.0))
    away = celsius - 3.9863
    density = 1000.0 * (1.0 - (celsius + 288.9414) * away * away / (508929.2 * (celsius + 68.12963)))
    return Medium("water", density, viscosity)


def glycerol(temperature: float = 20.0) -> Medium:
    """Return pure glycerol at ``temperature`` [degrees Celsius], 0 to 100.

    Viscosity 12.1 exp((t - 1233) t/(9900 + 70 t)), density 1277 - 0.654 t (Cheng 2008, Ind. Eng. Chem. Res. 47, 3285).
    Raises SceneError for other temperatures.
    """
    celsius = _celsius(temperature, 0.0, 100.0)
    viscosity = 12.1 * exp((celsius - 1233.0) * celsius / (9900.0 + 70.0 * celsius))
    return Medium("glycerol", 1277.0 - 0.654 * celsius, viscosity)


def _celsius(temperature: Any, least: float, most: float) -> float:
    """Return a temperature as a float; SceneError if it is not a number from ``least`` to ``most`` [degrees Celsius].
    """
    celsius = number(temperature, "temperature", unit="degrees Celsius")
    if not least <= celsius <= most:
        raise SceneError(f"temperature must be from {least:g} to {most:g} degrees Celsius, not {celsius:g}.")
    return celsius


MEDIA: Mapping[str, Callable[..., Medium]] = MappingProxyType(
    {make.__name__: make for make in (vacuum, air, water, glycerol)}
)
"""Functions that return a medium, by its name; they take a temperature, and for air a pressure."""


def medium_from(data: Any) -> Medium:
    """Return a medium from a dict of the values of :class:`Medium`, or of a name from MEDIA and its arguments.

    ``{"name": "water", "temperature": 40.0}`` is ``water(40.0)``. Raises SceneError for unknown keys, with the nearest,
    and for a name without density and viscosity that is not in MEDIA.
    """
    if not isinstance(data, Mapping):
        raise SceneError("A scene's medium must be given by a dict of its values, as {'name': 'water'}, "
                         f"not {shown(data)}.")
    values, own = dict(data), [f.name for f in fields(Medium)]
    name = values.get("name")
    given = {"density", "viscosity"} & values.keys()
    make = MEDIA.get(name) if isinstance(name, str) and not given else None
    known = ["name", *inspect.signature(make).parameters] if make else own
    for key in values:
        if key not in known:
            raise SceneError(f"The medium {shown(name)} has no value {shown(key)}{nearest(key, known)}")
    if make:
        return make(**{key: value for key, value in values.items() if key != "name"})
    if isinstance(name, str) and values.keys() == {"name"}:
        raise SceneError(f"There is no medium {shown(name)} without density and viscosity{nearest(name, MEDIA)}")
    return Medium(**values)
