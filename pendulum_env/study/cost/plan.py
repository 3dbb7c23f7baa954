"""Which runs a cost study makes, in which order, and about how much work each is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from integrators import Method
from integrators.steps.estimates import evaluations_tried, has_estimates, order_of_estimate
from pendulum_env.study.cost.runs import SPARSE, Setting

RECORDS = 16
"""Times per small-angle period at which errors are measured, or a few more; also the fewest steps of the default
ladder."""
DOUBLINGS = 13
"""Rungs of the default ladder: period/16, period/32, ... period/65536."""
MOST_STEPS = {"compiled": 2**20, "python": 2**13}
"""The default ladder ends where a run would take more steps than this."""
MOST_WORK = {"compiled": 2**24, "python": 2**19}
"""It also ends where a run would take more force evaluations than this."""
SWEEPS = 10.0
"""What an evaluation of an implicit method takes, with the equations that are solved, in those of an explicit one."""
COMPILING = {"compiled": 1e8, "python": 0.0}
"""The same of a program that is made for a method."""
LOOSEST = 1e-2
"""Tolerance with which about one step per SPARSE records is taken."""


@dataclass(frozen=True)
class Rung:
    """One method at one step or tolerance: ``substeps`` from one record to the next, or ``rtol``."""

    method: str
    substeps: int | None = None
    rtol: float | None = None

    @classmethod
    def of(cls, point: Mapping[str, Any]) -> Rung:
        return cls(point["method"], point.get("substeps"), point.get("rtol"))

    def point(self, repeat: int) -> dict[str, Any]:
        """As :func:`pendulum_env.study.cost.runs.measure` takes it."""
        at = {"substeps": self.substeps} if self.rtol is None else {"rtol": self.rtol}
        return {"method": self.method, **at, "repeat": repeat}


@dataclass
class Plan:
    """The runs of a study.

    Args:
        setting, methods, repeats: of the study.
        wanted: steps from one record to the next; None for the default ladder.
        rtols: tolerances, from large to small.

    Attributes:
        rungs: in the order of the methods, each from long steps to short, then from loose tolerances to tight.
        points: those to measure: the repeats outermost, then the rungs from long steps to short, so that each method
            has its turn before any has the next.
        left_out: what was left out of the default ladders for the work that it would be, as a sentence; or "".
    """

    setting: Setting
    methods: Sequence[Method]
    wanted: Sequence[int] | None
    rtols: Sequence[float]
    repeats: int
    rungs: list[Rung] = field(init=False)
    points: list[dict[str, Any]] = field(init=False)
    left_out: str = field(init=False)

    def __post_init__(self) -> None:
        self._methods = {method.name: method for method in self.methods}
        lines = [line for method in self.methods for line in (self._steps(method), self._tolerances(method))]
        self.rungs = [rung for line in lines for rung in line]
        rounds = [line[k] for k in range(max(map(len, lines))) for line in lines if k < len(line)]
        self.points = [rung.point(repeat) for repeat in range(self.repeats) for rung in rounds]
        self._first = {(line[0].method, line[0].rtol is None): line[0] for line in lines if line}
        self.left_out = self._said()

    def work(self, point: Mapping[str, Any]) -> float:
        """About how much work a point is, in force evaluations."""
        rung = Rung.of(point)
        once = 1e4 + self._evaluations(rung)
        if point["repeat"]:
            return once
        new = self._first[rung.method, rung.rtol is None] == rung
        return 2.0 * once + new * COMPILING[self.setting.backend]

    def _steps(self, method: Method) -> list[Rung]:
        if self.wanted is not None:
            return [Rung(method.name, count) for count in self.wanted]
        ladder = [Rung(method.name, 2**k) for k in range(DOUBLINGS)]
        return [rung for k, rung in enumerate(ladder) if k == 0 or self._bearable(rung)]

    def _tolerances(self, method: Method) -> list[Rung]:
        if not has_estimates(method):
            return []
        return [rung for rtol in self.rtols if self._bearable(rung := Rung(method.name, rtol=rtol))]

    def _bearable(self, rung: Rung) -> bool:
        backend = self.setting.backend
        return self._count(rung) <= MOST_STEPS[backend] and self._evaluations(rung) <= MOST_WORK[backend]

    def _count(self, rung: Rung) -> float:
        """Steps of a run, those with a tolerance by the order of the estimate."""
        if rung.rtol is None:
            return float((rung.substeps or 1) * self.setting.records)
        power = 1.0 / order_of_estimate(self._methods[rung.method])
        return self.setting.records / SPARSE * float(max(1.0, LOOSEST / rung.rtol) ** power)

    def _evaluations(self, rung: Rung) -> float:
        method = self._methods[rung.method]
        each = evaluations_tried(method) if rung.rtol is not None else method.evaluations
        return self._count(rung) * each * (SWEEPS if method.implicit else 1.0)

    def _said(self) -> str:
        """What the default ladders lack."""
        if self.wanted is not None:
            return ""
        gap, ends = self.setting.gap, dict[int, list[str]]()
        for method in self.methods:
            most = max(rung.substeps or 1 for rung in self.rungs if rung.method == method.name)
            ends.setdefault(most, []).append(method.name)
        longest = max(ends)
        parts = [f"below {gap / most:.2g} s with {', '.join(ends[most])}" for most in sorted(ends) if most < longest]
        if not parts:
            return ""
        return (
            f"Steps down to {gap / longest:.2g} s, but for the time that they would take none "
            + "; none ".join(parts) + "."
        )
