"""What the bob moves through: density and viscosity."""

from __future__ import annotations

from dataclasses import dataclass

from pendulum_env.physics.units import Checked, line, number, si

ZERO_CELSIUS = 273.15


@dataclass(frozen=True)
class Medium(Checked):
    """A still fluid. Raises SceneError for values out of range."""

    name: str = "vacuum"
    density: float = si(0.0, "kg/m^3", "density of the fluid", least=0.0)
    viscosity: float = si(0.0, "Pa s", "dynamic viscosity of the fluid", least=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        line(self.name, "A medium's name")

    @property
    def empty(self) -> bool:
        """True for vacuum: nothing that could drag."""
        return self.density == 0.0 and self.viscosity == 0.0


VACUUM = Medium()


def air(temperature: float = 20.0, pressure: float = 101325.0) -> Medium:
    """Dry air at ``temperature`` [degrees Celsius] and ``pressure`` [Pa].

    Viscosity 1.458e-6 T^1.5/(T + 110.4) (Sutherland's law, U.S. Standard Atmosphere 1976), density of the ideal gas
    with R = 287.05 J/(kg K). Raises SceneError below absolute zero.
    """
    kelvin = number(temperature, "temperature", above=-ZERO_CELSIUS, unit="degrees Celsius") + ZERO_CELSIUS
    pascal = number(pressure, "pressure", above=0.0, unit="Pa")
    return Medium("air", pascal / (287.05 * kelvin), 1.458e-6 * kelvin**1.5 / (kelvin + 110.4))


def water(temperature: float = 20.0) -> Medium:
    """Water at ``temperature`` [degrees Celsius], 0 to 100.

    Viscosity 2.414e-5 * 10^(247.8/(T - 140)) (Al-Shemmeri 2012); density 1000 (1 - (t + 288.9414)(t - 3.9863)^2 /
    (508929.2 (t + 68.12963))) (McCutcheon, Martin & Barnwell 1993).
    """
    celsius = number(temperature, "temperature", least=0.0, unit="degrees Celsius")
    viscosity = 2.414e-5 * 10.0 ** (247.8 / (celsius + ZERO_CELSIUS - 140.0))
    density = 1000.0 * (1.0 - (celsius + 288.9414) * (celsius - 3.9863) ** 2 / (508929.2 * (celsius + 68.12963)))
    return Medium("water", density, viscosity)
