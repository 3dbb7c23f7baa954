"""Drag of a sphere as a function of the Reynolds number Re, as a multiple of Stokes' drag ``6 pi mu a V``.

``C_d = (24/Re) multiple(Re)``. A multiple is 1 at Re = 0 and finite for every Re below 1e150, so that the drag is once
differentiable through rest; where the lowest power of Re is below 1, its second derivative is infinite there. All
functions here are plain functions of floats, because their source is copied into the generated program of a step: see
:mod:`pendulum_env.physics.effects.effect`. For each law there are the multiple, its ``growth``, which is ``Re d
multiple/d Re``, and the torque with its derivatives. The torque takes ``sphere_stokes_rate`` [1/s], Stokes' drag per
inertia, and ``sphere_reynolds_rate`` [s], the Reynolds number per angular velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pendulum_env.common.many import applied
from pendulum_env.physics.elementary import exp, log, power

__all__ = ["LAWS", "DragLaw"]

Function = Callable[..., float]


def clift_gauvin(reynolds: float) -> float:
    size = log(reynolds)
    turn = exp(0.94 * size)
    return 1.0 + 0.152 * exp(0.677 * size) + 0.417 / 24.0 * reynolds * (turn / (turn + 5070.0))


def clift_gauvin_growth(reynolds: float) -> float:
    size = log(reynolds)
    turn = exp(0.94 * size)
    form = 0.417 / 24.0 * reynolds * (turn / (turn + 5070.0))
    return 0.152 * (0.677 * exp(0.677 * size)) + form * (1.0 + 0.94 * (5070.0 / (turn + 5070.0)))


def clift_gauvin_drag(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * clift_gauvin(sphere_reynolds_rate * speed) * slip


def clift_gauvin_by_velocity(velocity: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    reynolds = sphere_reynolds_rate * abs(velocity)
    return -sphere_stokes_rate * (clift_gauvin(reynolds) + clift_gauvin_growth(reynolds))


def clift_gauvin_by_speed(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * clift_gauvin_growth(sphere_reynolds_rate * speed) * slip


def morrison(reynolds: float) -> float:
    size = log(reynolds)
    eighth = reynolds / 263000.0
    eighth = eighth * eighth
    eighth = eighth * eighth
    wake = 0.52 * reynolds / (1.0 + exp(1.52 * size - 2.4463456268998326))
    form = 0.411 * exp(0.06 * size - 0.7487945586695941) / (1.0 + eighth * eighth)
    return 1.0 + reynolds / 24.0 * (wake + form + exp(0.8 * size) / 461000.0)


def morrison_growth(reynolds: float) -> float:
    size = log(reynolds)
    eighth = reynolds / 263000.0
    eighth = eighth * eighth
    eighth = eighth * eighth
    early = 1.0 / (1.0 + exp(1.52 * size - 2.4463456268998326))
    crisis = 1.0 / (1.0 + eighth * eighth)
    wake = 0.52 * reynolds * early * (2.0 - 1.52 * (1.0 - early))
    form = 0.411 * exp(0.06 * size - 0.7487945586695941) * crisis * (1.0 + (0.06 - 8.0 * (1.0 - crisis)))
    rough = exp(0.8 * size) / 461000.0
    return reynolds / 24.0 * (wake + form + (rough + 0.8 * rough))


def morrison_drag(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * morrison(sphere_reynolds_rate * speed) * slip


def morrison_by_velocity(velocity: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    reynolds = sphere_reynolds_rate * abs(velocity)
    return -sphere_stokes_rate * (morrison(reynolds) + morrison_growth(reynolds))


def morrison_by_speed(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * morrison_growth(sphere_reynolds_rate * speed) * slip


def schiller_naumann(reynolds: float) -> float:
    return 1.0 + 0.15 * power(reynolds, 0.687)


def schiller_naumann_growth(reynolds: float) -> float:
    return 0.15 * (0.687 * power(reynolds, 0.687))


def schiller_naumann_drag(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * schiller_naumann(sphere_reynolds_rate * speed) * slip


def schiller_naumann_by_velocity(velocity: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    reynolds = sphere_reynolds_rate * abs(velocity)
    return -sphere_stokes_rate * (schiller_naumann(reynolds) + schiller_naumann_growth(reynolds))


def schiller_naumann_by_speed(
    slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float
) -> float:
    return -sphere_stokes_rate * schiller_naumann_growth(sphere_reynolds_rate * speed) * slip


def brown_lawler(reynolds: float) -> float:
    return 1.0 + 0.15 * power(reynolds, 0.681) + 0.407 / 24.0 * reynolds * (reynolds / (reynolds + 8710.0))


def brown_lawler_growth(reynolds: float) -> float:
    form = 0.407 / 24.0 * reynolds * (reynolds / (reynolds + 8710.0))
    return 0.15 * (0.681 * power(reynolds, 0.681)) + form * (1.0 + 8710.0 / (reynolds + 8710.0))


def brown_lawler_drag(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * brown_lawler(sphere_reynolds_rate * speed) * slip


def brown_lawler_by_velocity(velocity: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    reynolds = sphere_reynolds_rate * abs(velocity)
    return -sphere_stokes_rate * (brown_lawler(reynolds) + brown_lawler_growth(reynolds))


def brown_lawler_by_speed(slip: float, speed: float, sphere_stokes_rate: float, sphere_reynolds_rate: float) -> float:
    return -sphere_stokes_rate * brown_lawler_growth(sphere_reynolds_rate * speed) * slip


@dataclass(frozen=True)
class DragLaw:
    """A law for the drag coefficient of a smooth sphere in steady flow.

    Attributes:
        name: the value of ``law=`` that selects it.
        most: largest Reynolds number to which the law was fitted; all laws approach Stokes' law at Re = 0.
        formula: C_d as text.
        source: author, year, where.
        multiple, growth: functions of Re: the drag as a multiple of Stokes' drag, ``C_d/(24/Re)``, and Re times the
            derivative of this multiple by Re.
        torque, by_velocity, by_speed: the functions of the effect :class:`pendulum_env.physics.effects.SphereDrag` for
            this law.
    """

    name: str
    most: float
    formula: str
    source: str
    multiple: Function
    growth: Function
    torque: Function
    by_velocity: Function
    by_speed: Function

    def coefficient(self, reynolds: float) -> float:
        """Return C_d at a Reynolds number; ValueError for a Reynolds number outside the law's range."""
        if not 0.0 < reynolds <= self.most:
            raise ValueError(f"A sphere's drag coefficient is known for 0 < Re <= {self.most:g}, not {reynolds}.")
        return 24.0 / reynolds * applied(self.multiple, reynolds)


_ALL = (
    DragLaw(
        "clift_gauvin", 2.0e5, "24/Re (1 + 0.152 Re^0.677) + 0.417/(1 + 5070 Re^-0.94)",
        "form: Clift & Gauvin 1970, Proc. Chemeca 70, 14; coefficients: Brown & Lawler 2003, J. Environ. Eng. 129, 222",
        clift_gauvin, clift_gauvin_growth, clift_gauvin_drag, clift_gauvin_by_velocity, clift_gauvin_by_speed,
    ),
    DragLaw(
        "morrison", 1.0e6,
        "24/Re + (2.6 Re/5)/(1 + (Re/5)^1.52) + 0.411 (Re/263000)^-7.94/(1 + (Re/263000)^-8) + Re^0.8/461000",
        "Morrison 2013, An Introduction to Fluid Mechanics",
        morrison, morrison_growth, morrison_drag, morrison_by_velocity, morrison_by_speed,
    ),
    DragLaw(
        "schiller_naumann", 1.0e3, "24/Re (1 + 0.15 Re^0.687)",
        "Schiller & Naumann 1933, Z. Ver. Dtsch. Ing. 77, 318; range: Clift, Grace & Weber 1978, table 5.1",
        schiller_naumann, schiller_naumann_growth, schiller_naumann_drag, schiller_naumann_by_velocity,
        schiller_naumann_by_speed,
    ),
    DragLaw(
        "brown_lawler", 2.0e5, "24/Re (1 + 0.150 Re^0.681) + 0.407/(1 + 8710/Re)",
        "Brown & Lawler 2003, J. Environ. Eng. 129, 222",
        brown_lawler, brown_lawler_growth, brown_lawler_drag, brown_lawler_by_velocity, brown_lawler_by_speed,
    ),
)

LAWS: Mapping[str, DragLaw] = MappingProxyType({law.name: law for law in _ALL})
"""Every law for the drag of a sphere by name; the first is the default."""
