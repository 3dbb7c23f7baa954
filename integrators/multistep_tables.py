"""The tables of the linear multistep methods: Adams, backward differences, Störmer, Numerov, Quinlan & Tremaine."""

from __future__ import annotations

from fractions import Fraction

from integrators.collocation import COLLOCATION
from integrators.extrapolation import extrapolated_midpoint
from integrators.method import RungeKutta, exact
from integrators.multistep import Adams, BackwardDifference, SecondOrder
from integrators.runge_kutta import EXPLICIT

RK4 = next(method for method in EXPLICIT if method.name == "rk4")
RADAU5 = next(method for method in COLLOCATION if method.name == "radau5")
HNW = "Hairer, Norsett & Wanner 1993"


def _starter(order: int) -> RungeKutta:
    """What begins an explicit method: rk4, or extrapolation of the next even order."""
    return RK4 if order <= 4 else extrapolated_midpoint(order + order % 2)


def _adams(order: int, *b: str) -> Adams:
    return Adams(
        name=f"ab{order}",
        aliases=(f"adams_bashforth{order}",),
        order=order,
        source=f"Bashforth & Adams 1883, Theories of Capillary Action; {HNW}, III.1",
        summary=f"slopes of {order} steps extrapolated over the next: one force a step",
        b=exact(*b),
        starter=_starter(order),
    )


def _backward(order: int, *alpha: str) -> BackwardDifference:
    angle = ("", " and L-stable", ", A(86)-stable", ", A(73)-stable", ", A(51)-stable", ", A(17)-stable")[order - 1]
    return BackwardDifference(
        name=f"bdf{order}",
        aliases=(f"gear{order}",),
        order=order,
        a_stable=order == 2,
        l_stable=order == 2,
        source=f"Curtiss & Hirschfelder 1952, Proc. Natl. Acad. Sci. 38, 235; {HNW}, III.1",
        summary=f"slope of a polynomial through the last {order} steps and the new one{angle}",
        alpha=exact(*alpha),
        starter=RADAU5,
    )


def _stoermer(order: int, *beta: str) -> SecondOrder:
    return SecondOrder(
        name=f"stoermer{order}",
        order=order,
        source=f"Störmer 1907, Arch. Sci. Phys. Nat. 24, 5; {HNW}, III.10",
        summary=f"second difference from {order} forces: for forces free of the velocity, one a step",
        alpha=exact(1, -2, 1),
        beta=exact(0, *beta),
        starter=_starter(order),
    )


def _mirrored(*half: str) -> tuple[Fraction, ...]:
    """A row that reads the same from both ends, from its half with the middle."""
    return exact(*half, *half[-2::-1])


def _symmetric(name: str, order: int, source: str, alpha: str, beta: str, scale: int) -> SecondOrder:
    return SecondOrder(
        name=name,
        order=order,
        source=source,
        summary=f"symmetric, {2 * len(alpha.split()) - 2} steps, one force a step: for orbits without drag, short steps",
        alpha=_mirrored(*alpha.split()),
        beta=tuple(x / scale for x in _mirrored(*beta.split())),
        starter=extrapolated_midpoint(order + 2),
    )


ADAMS = (
    _adams(2, "3/2", "-1/2"),
    _adams(3, "23/12", "-4/3", "5/12"),
    _adams(4, "55/24", "-59/24", "37/24", "-3/8"),
    _adams(5, "1901/720", "-1387/360", "109/30", "-637/360", "251/720"),
    _adams(6, "4277/1440", "-2641/480", "4991/720", "-3649/720", "959/480", "-95/288"),
    Adams(
        name="abm4",
        aliases=("adams_bashforth_moulton4",),
        order=4,
        source=f"Moulton 1926, New Methods in Exterior Ballistics; {HNW}, III.1 (PECE)",
        summary="ab4 corrected by the implicit Adams method of four slopes: two forces a step",
        b=exact("55/24", "-59/24", "37/24", "-3/8"),
        corrector=exact("3/8", "19/24", "-5/24", "1/24"),
        starter=RK4,
    ),
)

BACKWARD = (
    _backward(2, "3/2", "-2", "1/2"),
    _backward(3, "11/6", "-3", "3/2", "-1/3"),
    _backward(4, "25/12", "-4", "3", "-4/3", "1/4"),
    _backward(5, "137/60", "-5", "5", "-10/3", "5/4", "-1/5"),
    _backward(6, "49/20", "-6", "15/2", "-20/3", "15/4", "-6/5", "1/6"),
)

STOERMER = (
    _stoermer(3, "13/12", "-1/6", "1/12"),
    _stoermer(4, "7/6", "-5/12", "1/3", "-1/12"),
    _stoermer(5, "299/240", "-11/15", "97/120", "-2/5", "19/240"),
    _stoermer(6, "317/240", "-133/120", "187/120", "-23/20", "109/240", "-3/40"),
    SecondOrder(
        name="numerov",
        aliases=("cowell4",),
        order=4,
        source=f"Numerov 1924, Mon. Not. R. Astron. Soc. 84, 592; {HNW}, III.10",
        summary="second difference from forces at both ends and between: for forces free of the velocity",
        alpha=exact(1, -2, 1),
        beta=exact("1/12", "5/6", "1/12"),
        starter=RK4,
    ),
)

QT, Q = "Quinlan & Tremaine 1990, Astron. J. 100, 1694", "Quinlan 1999, arXiv:astro-ph/9901136"
SYMMETRIC = (
    _symmetric("quinlan_tremaine8", 8, QT, "1 -2 2 -1 0", "0 17671 -23622 61449 -50516", 12096),
    _symmetric("quinlan8a", 8, Q, "1 -2 2 -2 2", "0 22081 -29418 75183 -75212", 15120),
    _symmetric("quinlan8b", 8, Q, "1 0 0 -1/2 -1", "0 192481 6582 816783 -156812", 120960),
    _symmetric(
        "quinlan_tremaine10", 10, QT, "1 -1 1 -1 1 -2", "0 399187 -485156 2391436 -2816732 4651330", 241920),
    _symmetric(
        "quinlan_tremaine12", 12, QT, "1 -2 2 -1 0 0 0",
        "0 90987349 -229596838 812627169 -1628539944 2714971338 -3041896548", 53222400,
    ),
    _symmetric(
        "quinlan_tremaine14", 14, QT, "1 -2 2 -1 0 0 0 0",
        "0 433489274083 -1364031998256 5583113380398 -14154444148720 28630585332045 -42056933842656 48471792742212",
        237758976000,
    ),
)

MULTISTEP = (*ADAMS, *BACKWARD, *STOERMER, *SYMMETRIC)
